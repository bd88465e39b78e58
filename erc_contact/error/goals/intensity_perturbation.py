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
from erc_contact.error.goals.moved_law import MovedLaw
from erc_contact.error.goals.perturbation import BaseScene, Perturbation
from erc_contact.error.goals.ring_strain import RingStrain, ring_coefficients
from erc_contact.error.goals.singular_strain import INNER_SHARE, SIZE, SingularStrain, cut_off
from erc_contact.error.goals.tip_series import plane_field, ring_fields
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

ON_LINE = 1e-6
"""Distance over the radius up to which facets are on the line of the crack [-]."""
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
    frame = _Frame(goal)
    material = checked_material(model, goal)
    unit = _unit_strain(model, frame, material.kappa)

    def scene_at(t: float) -> Scene:
        return replace(scene, strains=(*scene.strains, replace(unit, amount=t)))

    length = 2 * np.pi * goal.tip[0] if model.space.axisymmetric else 1.0
    size = SIZE * float(np.sqrt(material.modulus / (goal.radius * length)))

    def psi(u: fem.Function) -> BoundedNumber:
        return strain_work(MovedLaw(singular=unit).move(pair, 1.0), u, UNKNOWN * base.e * size)

    constant = _work_on_faces(error, frame, material.kappa)
    return Perturbation(scene_at, psi, 1.0, constant, base.e / size)


def _unit_strain(model: Model, frame: _Frame, kappa: float) -> SingularStrain:
    """Return the given strain G."""
    goal = frame.goal
    cosine, sine = frame.forward.tolist()
    tip_x, tip_y = goal.tip
    plane = SingularStrain(goal.mode, 1.0, tip_x, tip_y, cosine, sine, goal.radius, kappa)
    if not model.space.axisymmetric:
        return plane
    coefficients = ring_coefficients(goal.mode, (3 - kappa) / 4, cosine, sine)
    return RingStrain(**vars(plane), coefficients=coefficients)


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
    frame = _Frame(goal)
    _check_crack(model, goal, frame)
    return _material(model, goal, frame)


class _Frame:
    """Give places in the frame of a crack tip.

    Args:
        goal: What is asked.

    Attributes:
        forward: Unit vector in which the crack points, shape (2,).
        aside: Unit vector at a right angle to the left of it, shape (2,).
    """

    def __init__(self, goal: StressIntensity) -> None:
        self.goal = goal
        self.forward = np.array(goal.direction) / np.linalg.norm(goal.direction)
        self.aside = np.array([-self.forward[1], self.forward[0]])

    def at(self, x: np.ndarray) -> np.ndarray:
        """Return places along the direction and aside [length], shape (..., 2)."""
        to = x - np.array(self.goal.tip)
        return np.stack([to @ self.forward, to @ self.aside], axis=-1)

    def near(self, corners: np.ndarray) -> np.ndarray:
        """Tell which segments, shape (n, 2, 2), have points within the radius, (n,)."""
        return self.distances(corners) < self.goal.radius * (1 - ON_LINE)

    def distances(self, corners: np.ndarray) -> np.ndarray:
        """Return the distances of segments (n, 2, 2) from the tip [length], (n,)."""
        first = self.at(corners[:, 0])
        along = self.at(corners[:, 1]) - first
        share = -(first * along).sum(axis=1) / (along**2).sum(axis=1)
        return np.linalg.norm(first + np.clip(share, 0, 1)[:, None] * along, axis=1)

    def on_faces(self, corners: np.ndarray) -> np.ndarray:
        """Tell which segments are on the line behind the tip, shape (n,)."""
        places = self.at(corners)
        tolerance = ON_LINE * self.goal.radius
        on_line = abs(places[..., 1]) <= tolerance
        return np.asarray((on_line & (places[..., 0] <= tolerance)).all(axis=1))


def _check_crack(model: Model, goal: StressIntensity, frame: _Frame) -> None:
    """Check that there is a crack and nothing else within the radius; collective."""
    space = model.space
    topology = space.mesh.topology
    facets = np.column_stack(boundary_sides(space.mesh, dmesh.exterior_facet_indices(topology)))
    corners = space.facet_corners(facets)
    on_faces = frame.on_faces(corners)
    beside = frame.distances(corners[~on_faces]).min(initial=np.inf)
    room = space.comm.allreduce(float(beside), MPI.MIN)
    if room < goal.radius * (1 - ON_LINE):
        or_axis = " or its axis" if space.axisymmetric else ""
        raise InputError(
            f"{goal!r}: the boundary of the body{or_axis} comes as near as {room:.3g} to the tip,"
            " where it is not the line of the crack. Give a radius up to that, within which a crack"
            " that bends is straight, or the place of the tip and the direction in which the crack"
            " points."
        )
    # The part of each facet within the radius; both faces have facets of their own.
    back = np.clip(-frame.at(corners[on_faces])[..., 0], 0, goal.radius)
    length = space.comm.allreduce(float(abs(back[:, 1] - back[:, 0]).sum()), MPI.SUM)
    if abs(length - 2 * goal.radius) > ON_LINE * goal.radius:
        raise InputError(
            f"{goal!r}: behind the tip both faces of a crack are {length / 2:.3g} long within the"
            " radius; the tip has to be the end of a straight crack that is as long as the radius"
            " at least, and the direction points away from the crack."
        )
    _check_faces(model, goal, frame)


def _check_faces(model: Model, goal: StressIntensity, frame: _Frame) -> None:
    """Refuse supports and springs on the faces within the radius; collective."""
    held = [support.facets for support in model.scene.supports]
    held += [spring.facets for spring in model.scene.springs]
    near = []
    for name in held:
        corners = model.space.facet_corners(model.domain.facets(name))
        if model.space.comm.allreduce(bool(frame.near(corners).any()), MPI.LOR):
            near.append(name)
    if near:
        raise InputError(
            f"{goal!r}: within the radius the faces have to be free; {listed(near)} is a support"
            " or a spring there."
        )


def _material(model: Model, goal: StressIntensity, frame: _Frame) -> TipMaterial:
    """Return the material around the tip; collective.

    Raises:
        InputError: If the material varies there, or is not isotropic.
    """
    space = model.space
    corners = space.cell_corners()
    # The tip is a vertex: a cell that the circle meets has an edge within it.
    edges = np.stack([corners[:, [i, (i + 1) % 3]] for i in range(3)], axis=1)
    is_near = frame.near(edges.reshape(-1, 2, 2)).reshape(-1, 3).any(axis=1)
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
    if space.axisymmetric:
        kappa = 3 + 4 * first[0, 1] / first[0, 0]
    else:
        # C^-1 has (kappa + 1)/(8 mu) first.
        kappa = 4 * first[0, 0] / of_shear - 1
    return TipMaterial(float(kappa), float(4 / ((kappa + 1) * of_shear)))


def _work_on_faces(error: ConstitutiveError, frame: _Frame, kappa: float) -> BoundedNumber:
    """Return what tractions on the faces add [force/length^1.5]; collective."""
    model = error.model
    space = model.space
    weight = _weight_above(space, frame, kappa)
    total = BoundedNumber(0.0)
    for load in model.surface_loads:
        facets = model.domain.owned_facets(load.facets)
        density = partial(_of_load, space, space.everywhere(load.density), facets)
        value, unknown, size = _on_faces(space, frame, weight, facets, density)
        total += BoundedNumber(value, unknown, unknown <= ROUND_OFF * size)
    for traction in error.admissible.tractions:
        trace = traction.contact.trace
        here = trace.here
        for side, sign in ((trace.here, 1.0), (trace.there, -1.0)):
            count = len(side.facets)
            owned = here.owned[:count]
            density = partial(_of_contact, space.degree, sign * traction.values[:count][owned])
            value, _, size = _on_faces(space, frame, weight, side.facets[owned], density)
            total += BoundedNumber(value, 0.0, abs(value) <= ROUND_OFF * size)
    return total


def _weight_above(space: Space, frame: _Frame, kappa: float) -> list[tuple[float, np.ndarray]]:
    """Return what the factor has of tractions on the face above, see the top.

    It is a sum of ``c rho^p``; on the face below it is the opposite. Tractions of rings
    are times the circumference.

    Returns:
        The powers p, and c in the frame of the mesh [length^(-1/2 - p)], shape (2,).
    """
    goal = frame.goal
    # Components along the crack and aside are those of a complex number.
    along, aside = frame.forward, frame.aside
    factor = -2 / (kappa + 1)
    on_face = factor * plane_field(goal.mode, kappa).on_face()[-0.5]
    plane = on_face.real * along + on_face.imag * aside
    if not space.axisymmetric:
        return [(-0.5, plane)]
    R = goal.tip[0]
    fields = ring_fields(goal.mode, (3 - kappa) / 4, complex(along[0], aside[0]))
    of_ring: dict[float, np.ndarray] = {-0.5: plane}
    for unit, series in zip(np.eye(2), fields.w, strict=True):
        for p, amount in series.on_face().items():
            more = factor * amount.real * R ** (-0.5 - p) * unit
            of_ring[p] = of_ring.get(p, np.zeros(2)) + more
    return [(p, c / (2 * np.pi * R)) for p, c in of_ring.items()]


def _on_faces(
    space: Space,
    frame: _Frame,
    weight: list[tuple[float, np.ndarray]],
    facets: np.ndarray,
    density: Density,
) -> tuple[float, float, float]:
    """Integrate tractions against a weight on the faces; collective.

    With ``rho = s^2`` the weight has no singularity.

    Args:
        space: The mesh.
        frame: The frame of the tip.
        weight: Of :func:`_weight_above`.
        facets: Facets (cell, local facet), each on one rank, shape (f, 2).
        density: The tractions.

    Returns:
        The integral, how far a rule is off it, and the integral of the sizes of
        tractions and weight [force/length^1.5].
    """
    goal = frame.goal
    corners = space.facet_corners(facets)
    chosen = np.flatnonzero(frame.near(corners) & frame.on_faces(corners))
    middles = space.cell_corners()[facets[chosen, 0]].mean(axis=1)
    side = np.sign(frame.at(middles)[:, 1])
    ends = -frame.at(corners[chosen])[..., 0]
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
