"""The perturbation of a stress intensity factor: a given strain grows at the tip.

See :mod:`erc_contact.error.goals.singular_strain`. Tractions on the faces within the
radius add what they do by themselves,

    - E'/2 int t . eta u- drho,    of rings - E'/(4 pi R) int 2 pi r t . v drho,

with t the traction on the body and v of :mod:`erc_contact.error.goals.ring_strain`. On
straight faces u- is ``+- e/sqrt(2 pi rho)`` times -2/E', with e normal to the crack for
mode I and along it for mode II. Where faces touch within the radius, t is the traction
r^, and the number is an estimate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.bent_strain import BentStrain
from erc_contact.error.goals.crack_line import CrackLine, crack_line
from erc_contact.error.goals.crack_tips import Tip, tip_of
from erc_contact.error.goals.moved_law import MovedLaw
from erc_contact.error.goals.perturbation import BaseScene, Perturbation
from erc_contact.error.goals.singular_strain import INNER_SHARE, SIZE, SingularStrain, cut_off
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


@dataclass(frozen=True, eq=False)
class Crack:
    """Hold a crack within the radius of its tip, and the isotropic material there.

    Attributes:
        tip: The tip.
        line: The line of the crack.
        kappa: Kolosov's constant [-].
        modulus: E', of plane strain or plane stress [force/area].
    """

    tip: Tip
    line: CrackLine
    kappa: float
    modulus: float


def stress_intensity(
    error: ConstitutiveError, base: BaseScene, goal: StressIntensity
) -> Perturbation:
    """Return the perturbation for a stress intensity factor; collective.

    Raises:
        InputError: As :func:`checked_crack`.
    """
    pair = error.admissible
    model = pair.model
    scene = base.scene
    crack = checked_crack(model, goal)
    unit = _unit_strain(model.space, crack)

    def scene_at(t: float) -> Scene:
        return replace(scene, strains=(*scene.strains, replace(unit, amount=t)))

    size = SIZE * float(np.sqrt(crack.modulus / (goal.radius * crack.tip.length)))

    def psi(u: fem.Function) -> BoundedNumber:
        return strain_work(MovedLaw(singular=unit).move(pair, 1.0), u, UNKNOWN * base.e * size)

    constant = _work_on_faces(error, crack)
    return Perturbation(scene_at, psi, 1.0, constant, base.e / size)


def _unit_strain(space: Space, crack: Crack) -> SingularStrain:
    """Return the given strain G; collective."""
    straight = crack.tip.strain(crack.kappa)
    line = crack.line
    if not line.bends:
        return straight
    side = space.domain.function("DG", 0)
    side.x.array[:] = line.sides(crack.tip.at(space.cell_corners()))
    opening, widening = line.horn
    return BentStrain(
        **vars(straight),
        straight=line.straight,
        opening=opening,
        widening=widening,
        side=lambda _: side,
    )


def checked_crack(model: Model, goal: StressIntensity) -> Crack:
    """Return the crack and the material around its tip; collective.

    Raises:
        InputError: If the number does not exist: the tip is no end of a crack of the
            plane or of a ring as long as the radius, the radius reaches the boundary or
            the axis, or within it the material varies or a support, spring or given
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
    line = crack_line(model.space, tip)
    _check_faces(model, goal, tip)
    return Crack(tip, line, *_material(model, goal, tip))


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


def _material(model: Model, goal: StressIntensity, tip: Tip) -> tuple[float, float]:
    """Return Kolosov's constant and E' of the material around the tip; collective.

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
    return kappa, float(4 / ((kappa + 1) * of_shear))


def _work_on_faces(error: ConstitutiveError, crack: Crack) -> BoundedNumber:
    """Return what tractions on the faces add [force/length^1.5]; collective."""
    model = error.model
    space = model.space
    total = BoundedNumber(0.0)
    for load in model.surface_loads:
        facets = model.domain.owned_facets(load.facets)
        density = partial(_of_load, space, space.everywhere(load.density), facets)
        value, unknown, size = _on_faces(space, crack, facets, density)
        total += BoundedNumber(value, unknown, unknown <= ROUND_OFF * size)
    for traction in error.admissible.tractions:
        trace = traction.contact.trace
        here = trace.here
        for side, sign in ((trace.here, 1.0), (trace.there, -1.0)):
            count = len(side.facets)
            owned = here.owned[:count]
            density = partial(_of_contact, space.degree, sign * traction.values[:count][owned])
            value, _, size = _on_faces(space, crack, side.facets[owned], density)
            total += BoundedNumber(value, 0.0, abs(value) <= ROUND_OFF * size)
    return total


def _on_faces(
    space: Space, crack: Crack, facets: np.ndarray, density: Density
) -> tuple[float, float, float]:
    """Integrate tractions against their weight on the faces; collective.

    The distance rho from the tip grows along each facet. With ``rho = s^2`` the weight
    has no singularity.

    Args:
        space: The mesh.
        crack: The crack.
        facets: Facets (cell, local facet), each on one rank, shape (f, 2).
        density: The tractions.

    Returns:
        The integral, how far a rule is off it, and the integral of the sizes of
        tractions and weight [force/length^1.5].
    """
    tip = crack.tip
    radius = tip.goal.radius
    corners = space.facet_corners(facets)
    chosen = np.flatnonzero(tip.near(corners))
    ends = tip.at(corners[chosen])
    cells = tip.at(space.cell_corners()[facets[chosen, 0]])
    side = crack.line.sides(cells)[:, None]
    # The facets from their ends that are nearer to the tip.
    distance = np.linalg.norm(ends, axis=2)
    is_turned = distance[:, 0] > distance[:, 1]
    first = np.where(is_turned[:, None], ends[:, 1], ends[:, 0])
    way = np.where(is_turned[:, None], -1, 1) * (ends[:, 1] - ends[:, 0])
    length = np.linalg.norm(way, axis=1)[:, None]
    # Along the line of a facet, measured from the foot of the tip.
    foot = (first * way).sum(axis=1)[:, None] / length
    height_2 = np.maximum((first**2).sum(axis=1)[:, None] - foot**2, 0.0)
    distance.sort(axis=1)
    weight = tip.weight(crack.kappa)
    inner = INNER_SHARE * radius
    least = (np.finfo(float).eps * radius) ** 2
    totals = np.zeros((2, 2))
    for total, degree in zip(totals, DEGREES_OF_FACES, strict=True):
        points, weights = rule(1, degree)
        for low, high in ((0.0, inner), (inner, radius)):
            # The ends of each facet within this range of rho; equal outside it.
            roots = np.sqrt(np.clip(distance, low, high))
            width = roots[:, 1:] - roots[:, :1]
            s = roots[:, :1] + width * points[:, 0]
            rho = s**2
            along = np.sqrt(np.maximum(rho**2 - height_2, least))
            share = np.clip((along - foot) / length, 0.0, 1.0)
            x = first[:, None] + share[..., None] * way[:, None]
            # The angle goes on from the side of the facet.
            theta = side * (np.pi / 2 + np.arctan2(-x[..., 0], side * x[..., 1]))
            eta, _, _ = cut_off(np.maximum(rho, inner), radius)
            # d rho is 2 s ds, and rho d rho is along times d along.
            of_point = eta * width * weights * 2 * s * rho / along
            vectors = np.stack([component.at(rho, theta) for component in weight], axis=-1)
            vectors *= of_point[..., None]
            values = density(chosen, np.where(is_turned[:, None], 1 - share, share))
            total[0] += (vectors * values).sum()
            total[1] += (np.linalg.norm(values, axis=-1) * np.linalg.norm(vectors, axis=-1)).sum()
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
