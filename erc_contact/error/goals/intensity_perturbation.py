"""The perturbation of a stress intensity factor: a given strain grows at the tip.

See :mod:`erc_contact.error.goals.singular_strain`. Tractions on the faces within the
radius add what they do by themselves,

    - E'/2 int t . eta u- drho,    of rings - E'/(4 pi R) int 2 pi r t . v drho,

with t the traction on the body and v of :mod:`erc_contact.error.goals.ring_strain`. On
the faces u- is ``+- e/sqrt(2 pi rho)`` times -2/E', with e normal to the crack for mode
I and along it for mode II. Where faces touch within the radius, t is the traction r^,
and the number is an estimate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.crack_tips import ON_LINE, Tip, Weight, tip_of
from erc_contact.error.goals.moved_law import MovedLaw
from erc_contact.error.goals.perturbation import BaseScene, Perturbation
from erc_contact.error.goals.singular_strain import INNER_SHARE, SIZE, cut_off
from erc_contact.error.numbers import ROUND_OFF, BoundedNumber
from erc_contact.error.works import strain_work
from erc_contact.model.data.expressions import Everywhere
from erc_contact.model.data.quadrature import polynomials
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.scene.goal import StressIntensity
from erc_contact.scene.scene import Scene
from namedmesh.base.names import listed
from namedmesh.base.ranks import of_all
from namedmesh.for_solvers import boundary_sides
from namedmesh.simplex import rule

SAME_MATERIAL = 1e-9
"""Relative difference of compliances of a material that is the same everywhere [-]."""
DEGREES_OF_FACES = (24, 32)
"""Degrees in s of two rules over faces: 14 are of eta, 6 of tractions, 4 of v.

Where both rules differ, a load varies too much for them.
"""
UNKNOWN = 1e-4
"""What the integral of G may leave unknown, over e and the norm of G [-]."""
Density = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Type of tractions of some facets [force/length], shape (n, q, 2).

They are asked by the numbers of the facets, shape (n,), and by shares of the way from
their first to their second vertex, shape (n, q).
"""


@dataclass(frozen=True)
class TipMaterial:
    """Hold the isotropic material around a tip.

    Attributes:
        kappa: Kolosov's constant [-].
        modulus: E', of plane strain or plane stress [force/area].
    """

    kappa: float
    modulus: float


def stress_intensity(
    error: ConstitutiveError, base: BaseScene, goal: StressIntensity
) -> Perturbation:
    """Return the perturbation for a stress intensity factor; collective.

    Raises:
        InputError: As :func:`checked_material`.
    """
    pair = error.admissible
    model = pair.model
    scene = base.scene
    tip = tip_of(model.space, goal)
    material = checked_material(model, goal)
    unit = tip.strain(material.kappa)

    def scene_at(t: float) -> Scene:
        return replace(scene, strains=(*scene.strains, replace(unit, amount=t)))

    size = SIZE * float(np.sqrt(material.modulus / (goal.radius * tip.length)))

    def psi(u: fem.Function) -> BoundedNumber:
        return strain_work(MovedLaw(singular=unit).move(pair, 1.0), u, UNKNOWN * base.e * size)

    constant = _work_on_faces(error, tip, material.kappa)
    return Perturbation(scene_at, psi, 1.0, constant, base.e / size)


def checked_material(model: Model, goal: StressIntensity) -> TipMaterial:
    """Return the material around the tip; collective.

    Raises:
        InputError: If the number does not exist: the tip is no end of a straight crack
            of the plane as long as the radius, the radius reaches the boundary or the
            axis, or within it the material varies or a load, support, spring or given
            strain is.
    """
    if model.space.d != 2:
        raise InputError(
            f"{goal!r}: stress intensity factors are told of bodies in the plane and of rings."
        )
    if model.strains is not None or model.body_force is not None:
        raise InputError(
            f"{goal!r}: with given strains, preloads or body forces the number has no interval;"
            " replace them by tractions beyond the radius."
        )
    tip = tip_of(model.space, goal)
    _check_crack(model, goal, tip)
    return _material(model, goal, tip)


def _check_crack(model: Model, goal: StressIntensity, tip: Tip) -> None:
    """Check that there is a crack and nothing else within the radius; collective."""
    space = model.space
    topology = space.mesh.topology
    facets = np.column_stack(boundary_sides(space.mesh, dmesh.exterior_facet_indices(topology)))
    corners = space.facet_corners(facets)
    on_faces = tip.on_faces(corners)
    beside = tip.distances(corners[~on_faces]).min(initial=np.inf)
    room = space.comm.allreduce(float(beside), MPI.MIN)
    if room < goal.radius * (1 - ON_LINE):
        raise InputError(
            f"{goal!r}: {tip.bounds} comes as near as {room:.3g} to the tip,"
            " where it is not the line of the crack. Give a radius up to that, within which a crack"
            " that bends is straight, or the place of the tip and the direction in which the crack"
            " points."
        )
    # The part of each facet within the radius; both faces have facets of their own.
    back = np.clip(-tip.at(corners[on_faces])[..., 0], 0, goal.radius)
    length = space.comm.allreduce(float(abs(back[:, 1] - back[:, 0]).sum()), MPI.SUM)
    if abs(length - 2 * goal.radius) > ON_LINE * goal.radius:
        raise InputError(
            f"{goal!r}: behind the tip both faces of a crack are {length / 2:.3g} long within the"
            " radius; the tip has to be the end of a straight crack that is as long as the radius"
            " at least, and the direction points away from the crack."
        )
    _check_faces(model, goal, tip)


def _check_faces(model: Model, goal: StressIntensity, tip: Tip) -> None:
    """Refuse supports and springs on the faces within the radius; collective."""
    held = [support.facets for support in model.scene.supports]
    held += [spring.facets for spring in model.scene.springs]
    near = []
    for name in held:
        corners = model.space.facet_corners(model.domain.facets(name))
        if model.space.comm.allreduce(bool(tip.near(corners).any()), MPI.LOR):
            near.append(name)
    if near:
        raise InputError(
            f"{goal!r}: within the radius the faces have to be free; {listed(near)} is a support"
            " or a spring there."
        )


def _material(model: Model, goal: StressIntensity, tip: Tip) -> TipMaterial:
    """Return the material around the tip; collective.

    Raises:
        InputError: If the material varies there, or is not isotropic.
    """
    space = model.space
    corners = space.cell_corners()
    # The tip is a vertex: a cell that the circle meets has an edge within it.
    edges = np.stack([corners[:, [i, (i + 1) % 3]] for i in range(3)], axis=1)
    is_near = tip.near(edges.reshape(-1, 2, 2)).reshape(-1, 3).any(axis=1)
    cells = np.flatnonzero(is_near).astype(np.int32)
    points = np.concatenate([corners[cells], corners[cells].mean(axis=1, keepdims=True)], axis=1)
    metric = model.constitution.metric
    sizes = *points.shape[:2], metric.size, metric.size
    local = np.broadcast_to(metric.of_material(points, cells), sizes)
    (values,) = of_all(space.comm, local.reshape(-1, *sizes[2:]))
    first = values[0]
    changes = abs(values - first).max()
    # In Mandel components C^-1 is 1/(2 mu) and, among normal components, - nu/E.
    normal = np.trace(space.section.basis, axis1=1, axis2=2)
    of_shear = first[0, 0] - first[0, 1]
    isotropic = of_shear * np.eye(metric.size) + first[0, 1] * np.outer(normal, normal)
    if max(changes, abs(first - isotropic).max()) > SAME_MATERIAL * first.max():
        raise InputError(
            f"{goal!r}: within the radius the material has to be one isotropic material; give a"
            " smaller radius."
        )
    kappa = tip.kappa(first)
    return TipMaterial(kappa, float(4 / ((kappa + 1) * of_shear)))


def _work_on_faces(error: ConstitutiveError, tip: Tip, kappa: float) -> BoundedNumber:
    """Return what tractions on the faces add [force/length^1.5]; collective."""
    model = error.model
    space = model.space
    weight = tip.weight_above(kappa)
    total = BoundedNumber(0.0)
    for load in model.surface_loads:
        facets = model.domain.owned_facets(load.facets)
        density = partial(_of_load, space, space.everywhere(load.density), facets)
        value, unknown, size = _on_faces(space, tip, weight, facets, density)
        total += BoundedNumber(value, unknown, unknown <= ROUND_OFF * size)
    for traction in error.admissible.tractions:
        trace = traction.contact.trace
        here = trace.here
        for side, sign in ((trace.here, 1.0), (trace.there, -1.0)):
            count = len(side.facets)
            owned = here.owned[:count]
            density = partial(_of_contact, space.degree, sign * traction.values[:count][owned])
            value, _, size = _on_faces(space, tip, weight, side.facets[owned], density)
            total += BoundedNumber(value, 0.0, abs(value) <= ROUND_OFF * size)
    return total


def _on_faces(
    space: Space,
    tip: Tip,
    weight: Weight,
    facets: np.ndarray,
    density: Density,
) -> tuple[float, float, float]:
    """Integrate tractions against a weight on the faces; collective.

    With ``rho = s^2`` the weight has no singularity.

    Args:
        space: The mesh.
        tip: The tip.
        weight: Of :meth:`.Tip.weight_above`.
        facets: Facets (cell, local facet), each on one rank, shape (f, 2).
        density: The tractions.

    Returns:
        The integral, how far a rule is off it, and the integral of the sizes of
        tractions and weight [force/length^1.5].
    """
    goal = tip.goal
    corners = space.facet_corners(facets)
    chosen = np.flatnonzero(tip.near(corners) & tip.on_faces(corners))
    middles = space.cell_corners()[facets[chosen, 0]].mean(axis=1)
    side = np.sign(tip.at(middles)[:, 1])
    ends = -tip.at(corners[chosen])[..., 0]
    inner = INNER_SHARE * goal.radius
    totals = np.zeros((2, 2))
    for total, degree in zip(totals, DEGREES_OF_FACES, strict=True):
        points, weights = rule(1, degree)
        for low, high in ((0.0, inner), (inner, goal.radius)):
            # The ends of each facet within this range of rho; equal outside it.
            roots = np.sqrt(np.sort(np.clip(ends, low, high), axis=1))
            width = roots[:, 1:] - roots[:, :1]
            s = roots[:, :1] + width * points[:, 0]
            rho = s**2
            share = (rho - ends[:, :1]) / (ends[:, 1:] - ends[:, :1])
            eta, _, _ = cut_off(np.maximum(rho, inner), goal.radius)
            # d rho is 2 s ds.
            of_s = sum(2 * (s ** (2 * p + 1))[..., None] * c for p, c in weight)
            of_point = side[:, None, None] * (eta * width * weights)[..., None] * of_s
            values = density(chosen, share)
            total[0] += (of_point * values).sum()
            sizes = np.linalg.norm(values, axis=-1) * np.linalg.norm(of_point, axis=-1)
            total[1] += sizes.sum()
    totals = space.comm.allreduce(totals, MPI.SUM)
    (rough, _), (value, size) = totals.tolist()
    return value, abs(value - rough), size


def _of_load(
    space: Space, density: Everywhere, facets: np.ndarray, chosen: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """Return a load on some of its facets, see :data:`Density`."""
    x = np.matmul(_barycentric(share), space.facet_corners(facets[chosen]))
    return density(x, facets[chosen])


def _of_contact(
    degree: int, values: np.ndarray, chosen: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """Return a traction by its coefficients, shape (f, m, 2), see :data:`Density`."""
    return np.asarray(np.matmul(polynomials(degree, _barycentric(share)), values[chosen]))


def _barycentric(share: np.ndarray) -> np.ndarray:
    """Return barycentric coordinates of shares of the way along facets, (n, q, 2)."""
    return np.stack([1 - share, share], axis=-1)
