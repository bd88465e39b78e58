"""Put the contacts of a scene on a mesh: gap, normal and friction bound as UFL.

The law of a contact with a foundation that has moved by d is the law of a contact at
rest, for the displacement ``u - d``: ``u_n <= g + d_n``, and friction acts on
``u_t - d_t``. So d_n is in the gap, and d_t in the displacement that friction counts
from. In a history a step counts from ``s = u_before - d_before + d``: what the last
step leaves is the displacement relative to the foundation.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.base.runtime import compiled
from erc_contact.base.runtime.patches import method_caches_off
from erc_contact.base.traced import field_of
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.drawn_apart import DrawnApart, between_surfaces
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.friction import Friction, bind_friction
from erc_contact.model.contact.friction_set import DISC, WHOLE, Disc, Ellipse
from erc_contact.model.contact.normals import (
    SAME_NORMAL,
    check_turning,
    gap_vectors,
    normal_field,
    normals_of_side,
    turns,
)
from erc_contact.model.contact.periodic import placed, rotation_of
from erc_contact.model.contact.side import Side
from erc_contact.model.contact.trace import Trace
from erc_contact.model.data.symbolic import sum_of
from erc_contact.model.data.users import call_of_user, scalar
from erc_contact.model.data.values import components, number
from erc_contact.model.last_step import LastStep, lost_on_facets
from erc_contact.model.space import Space
from erc_contact.scene.contact import Contact
from erc_contact.scene.law import Law
from erc_contact.scene.material import parameter
from erc_contact.scene.periodic import HELD, HeldTogether
from namedmesh.base.checks import positive
from namedmesh.base.ranks import greatest
from namedmesh.simplex import lagrange, nodes, rule

SAME_MODULUS = 1e-6
"""Difference of the mean moduli of two bodies that counts as none, over one of them."""
SETS: dict[type, Disc] = {HeldTogether: WHOLE}
"""Sets of tangential tractions of laws that allow no disc."""
Sides = tuple[Side, Side]
"""Side of a body at a contact, and the side of the other body or of the foundation."""
PARALLEL = 1e-6
"""Sine of the angle between a normal and an axis of friction that is zero [-]."""
FLAT_NORMALS = 1e-8
"""Largest deviation of the facet normals of a contact that counts as flat [-]."""


def bind_contact(
    space: Space, contact: Contact, modulus: Ufl, last: LastStep | None = None
) -> ContactOnMesh:
    """Put a contact on a mesh; collective.

    Args:
        space: The mesh.
        contact: What the scene declares.
        modulus: The modulus of the material [force/area], UFL.
        last: The last step of a history, or None without history.

    Raises:
        InputError: If gap, normal or friction are no numbers, or cannot be worked with,
            or the last step was one of another body.
    """
    contact = placed(space, contact)
    part, here, there = _sides(space, contact, modulus)
    facets = here.facets
    sign = 1.0 if part == contact.facets else -1.0
    what = f"Contact({contact.facets!r})"
    surface = _true_surface(space, contact)
    gaps = []
    if contact.gap != 0:
        gaps.append(number(space, contact.gap, f"{what}: gap", surface))
    if callable(contact.gap):
        values = space.evaluate(gaps[0], space.facet_points, facets)
        if not np.isfinite(space.extremes(values)).all():
            raise InputError(f"{what}: the gap is not finite everywhere; look at it.")
    sides = here, there
    normals = _normal(space, contact, sides, surface, sign)
    normal, of_corners = normals.field, normals.of_corners
    of_gap = None
    if of_corners is not None:
        normal = normal / ufl.sqrt(ufl.dot(normal, normal))
        if gaps and contact.normal is None:
            field, of_gap = normal_field(space, facets, gap_vectors(space, here, of_corners))
            gaps = [ufl.sqrt(ufl.dot(field, field)) * gaps[0]]
    given_gaps = gaps.copy()
    trace = Trace(
        here,
        there,
        normals.direction,
        corner_normals=of_corners,
        rotation=rotation_of(space, contact),
    )
    apart = DrawnApart()
    if space.domain.distance(contact.facets, contact.against) > 0:
        apart = _drawn_apart(space, trace, normal)
        gaps += apart.gaps
        given_gaps += apart.gaps[1:]
    motion = None
    if contact.motion is not None:
        motion = components(space, contact.motion, f"{what}: motion")
        gaps.append(ufl.dot(motion, normal))
        given_gaps.append(gaps[-1])
    friction = _friction(space, contact, facets, normals.direction)
    stiffnesses = _stiffnesses(space, contact, part, what)
    # Friction alone remembers where the contact was; copies are where they belong.
    before = None
    lost = None
    if last is not None and friction is not None and contact.law is not HELD:
        before, lost = last.on(space, contact.facets, trace, sign)
    moved = None
    if motion is not None:
        moved, lost_of_motion = foundation_motion(space, trace, motion, what)
        if friction is not None:
            before, lost = add_foundation_motion(before, lost, moved, lost_of_motion)
    return ContactOnMesh(
        name=contact.facets,
        against=contact.against,
        is_exchanged=part != contact.facets,
        trace=replace(trace, before=before),
        ds=space.ds(space.domain.tag(part)),
        normal=normal,
        given_normal=normals.given,
        friction=friction,
        gap=sum_of(gaps),
        given_gap=sum_of(given_gaps),
        gap_beside_facets=apart.beside_facets,
        gap_varies=callable(contact.gap) or motion is not None or bool(apart.gaps),
        bilateral=contact.bilateral,
        stiffness=stiffnesses.get("normal"),
        tangential_stiffness=stiffnesses.get("tangential"),
        lost=lost,
        gap_vectors=of_gap,
        moved=moved,
        between=apart.between,
    )


def _stiffnesses(space: Space, contact: Contact, part: str, what: str) -> dict[str, Ufl]:
    """Return the stiffnesses of a compliant foundation [force/length^3]; collective.

    On a curved part they are per area of the true surface, as springs are.
    """
    stiffnesses = {}
    for name in ("normal", "tangential"):
        k = getattr(contact.foundation, name, None)
        if k is not None:
            stiffness = number(space, k, f"{what}: {name} stiffness of the foundation")
            factor = space.area_factor(part)
            density = stiffness if factor is None else factor * stiffness
            stiffnesses[name] = space.on_meridian(density)
    return stiffnesses


def _sides(space: Space, contact: Contact, modulus: Ufl) -> tuple[str, Side, Side]:
    """Return the part on this side of a contact, and both sides; collective.

    Nitsche's method tests the stress on this side. So it is the side of the softer
    body: with the stress of a much stiffer body Newton's method hardly converges. Of
    bodies with the same modulus it is the side with the later name. So the order in
    which the scene names them changes nothing. Sides of copies are of one body, and
    stay as they are named.
    """
    if contact.against is None:
        here = space.side(space.domain.facets(contact.facets), modulus)
        return contact.facets, here, here.only(slice(0))
    facets, facing = space.domain.facing(contact.facets, contact.against)
    here = space.side(facets, modulus)
    there = space.side(facing, modulus)
    if contact.law is HELD:
        return contact.facets, here, there
    of_here, of_there = _mean_moduli(space, here, there)
    is_later = contact.against > contact.facets
    if abs(of_here - of_there) > SAME_MODULUS * of_there:
        is_later = of_here > of_there
    if is_later:
        return contact.against, there, here
    return contact.facets, here, there


def _drawn_apart(space: Space, trace: Trace, normal: Ufl) -> DrawnApart:
    """Measure the gap between two bodies along a unit normal, UFL; collective."""
    # Facing facets are one facet in their parameters, so this is linear on each. A jump
    # that is equal to it brings both points together.
    vectors, between = normal_field(space, trace.here.facets, trace.to_partners)
    added = between_surfaces(space, trace)
    beside_facets = None if added is None else ufl.dot(added, normal)
    return DrawnApart(ufl.dot(vectors, normal), beside_facets, between)


def _mean_moduli(space: Space, here: Side, there: Side) -> np.ndarray:
    """Return the mean modulus along two sides [force/area], (2,); collective."""
    sums = []
    for side in (here, there):
        sums.append([side.owned_areas @ side.modulus, side.owned_areas.sum()])
    sums_of_all = space.comm.allreduce(np.array(sums), MPI.SUM)
    means: np.ndarray = sums_of_all[:, 0] / sums_of_all[:, 1]
    return means


def _friction(
    space: Space, contact: Contact, facets: np.ndarray, direction: np.ndarray
) -> Friction | None:
    """Put the law of a contact on a mesh, None without friction; collective."""
    law = contact.law
    what = f"Contact({contact.facets!r})"
    if law is None:
        return None
    parameters = {}
    for name in law.parameters:
        value = parameter(law, name)
        parameters[name] = number(space, value, f"{what}: {name}")
        if not callable(value):
            continue
        at_nodes = space.evaluate(parameters[name], space.facet_points, facets)
        low, high = space.extremes(at_nodes)
        if not 0 <= low <= high < np.inf:
            raise InputError(f"{what}: {name} is {low:g} somewhere; it must be >= 0 and finite.")
    bound = f"{what}: the friction bound"
    friction = bind_friction(space.mesh, bound, law, parameters, space.section.circumference)
    return replace(friction, allowed=_allowed(space, contact, law, facets, direction))


def _allowed(
    space: Space, contact: Contact, law: Law, facets: np.ndarray, direction: np.ndarray
) -> Disc:
    """Return the set of tangential tractions that a law allows; collective.

    Raises:
        InputError: If a law has axes in the plane, on a tangentially compliant
            foundation, or along the normal, or if its ratio is no number > 0.
    """
    axes = getattr(law, "axes", None)
    if axes is None:
        return SETS.get(type(law), DISC)
    what = f"Contact({contact.facets!r}): {type(law).__name__}"
    if space.d == 2:
        raise InputError(
            f"{what} has axes, and the mesh is in the plane, where friction has one direction;"
            " give Coulomb(friction along it)."
        )
    if getattr(contact.foundation, "tangential", None) is not None:
        raise InputError(
            f"{what} has axes, and the foundation is tangentially compliant; the nearest point of"
            " an ellipse has no closed form. Give an isotropic law, or Foundation(normal=k) alone."
        )
    ratio = positive(f"{what}: ratio", parameter(law, "ratio"), "> 0")
    axis = components(space, axes, f"{what}: axes")
    on_facets = space.evaluate(axis, nodes(2, 0), facets)[:, 0]
    across = np.cross(direction, on_facets)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    size = np.linalg.norm(on_facets, axis=1, keepdims=True)
    # An undefined axis counts as one along the normal.
    is_tangential = bool((length > PARALLEL * size).all())
    if not space.comm.allreduce(is_tangential, MPI.LAND):
        raise InputError(
            f"{what}: axes is zero, not finite or along the normal on a facet; give a vector, or a"
            " callable of x that returns one, whose tangential part is the first axis."
        )
    in_ufl = compiled.constant(space.mesh, ratio)
    return Ellipse(axis, direction, across / length, ratio, in_ufl, is_of_mesh=callable(axes))


def _true_surface(space: Space, contact: Contact) -> Ufl:
    """Return the position at which gap and normal are taken, UFL.

    It is the nearest point of the true surface where that is known: at the flat facets
    they would be wrong by O(h^2).
    """
    varies = callable(contact.gap) or callable(contact.normal)
    if not varies or space.domain.offset is None:
        return space.x
    return space.x + space.domain.offset


class _Normals(NamedTuple):
    """Hold the normals of a contact.

    Attributes:
        field: The unit normal, or the field N of normals that turn, UFL.
        direction: Unit normals in the middle of each facet, shape (f, d).
        of_corners: Unit normals at the vertices of each facet, shape (f, d, d); None
            where they do not turn along any facet.
        given: The normal as the scene gives it, of any length, UFL; None where it does
            not vary.
    """

    field: Ufl
    direction: np.ndarray
    of_corners: np.ndarray | None = None
    given: Ufl | None = None


def _normal(space: Space, contact: Contact, sides: Sides, surface: Ufl, sign: float) -> _Normals:
    """Find the normal of a foundation, or the common normal of bodies; collective.

    Args:
        space: The mesh.
        contact: What the scene declares.
        sides: This side, and the other side.
        surface: Position at which the normal is taken, UFL.
        sign: -1 where this side is the facing part of the scene's contact, else 1.
    """
    facets = sides[0].facets
    if contact.normal is None and contact.against is None:
        direction = _flat_normal(space, contact, facets)
    elif isinstance(contact.normal, tuple):
        direction = sign * np.array(contact.normal)
    else:
        return _varying_normal(space, contact, sides, surface, sign)
    on_facets = np.broadcast_to(direction, (len(facets), space.d))
    return _Normals(compiled.constant(space.mesh, direction), on_facets)


def _flat_normal(space: Space, contact: Contact, facets: np.ndarray) -> np.ndarray:
    """Return the outward normal of a flat boundary part, shape (d,); collective.

    Raises:
        InputError: If the part is not flat.
    """
    normals = space.outward_normals(facets)
    # All ranks compare their facets with the first one of the first rank that has any.
    first_of_rank = normals[0] if len(normals) else None
    firsts = [n for n in space.comm.allgather(first_of_rank) if n is not None]
    first = firsts[0]
    error = None
    if len(normals) and abs(normals - first).max() > FLAT_NORMALS:
        example = (0.0, -1.0) if space.d == 2 else (0.0, 0.0, -1.0)
        error = InputError(
            f"Contact({contact.facets!r}): the boundary part is not flat; give the normal of"
            f" the foundation, e.g. normal={example}, and the gap along it."
        )
    raise_together(space.comm, error)
    return first + 0.0  # no negative zeros


def _varying_normal(
    space: Space, contact: Contact, sides: Sides, surface: Ufl, sign: float
) -> _Normals:
    """Find a normal that varies, as :func:`_normal` returns it; collective."""
    facets = sides[0].facets
    given = None
    if contact.normal is None:
        flat = Trace(*sides, space.outward_normals(facets))
        of_corners = _common_normals(space, contact, flat)
        if greatest(space.comm, of_corners - flat.normals_at_vertices) <= SAME_NORMAL:
            return _Normals(space.n, flat.direction)
    else:
        given = _given_normal(space, contact, surface, sign)
        of_corners = _at_vertices(space, contact, facets, given)
    normal, of_corners = normal_field(space, facets, of_corners)
    middle = of_corners.sum(axis=1)
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    if not turns(space.comm, of_corners):
        return _Normals(normal, middle, None, given)
    check_turning(space.comm, f"Contact({contact.facets!r})", of_corners)
    return _Normals(normal, middle, of_corners, given)


def _common_normals(space: Space, contact: Contact, sides: Trace) -> np.ndarray:
    """Find the unit normals that bodies share at vertices, (f, d, d); collective.

    Where both sides are in one place they are normals of this side. Round bodies that
    are apart have other normals at facing points, until they are pressed onto each
    other: the softer one takes the slope of the stiffer one, and equal bodies meet in
    the middle. So both outward normals count as the moduli of their bodies do: ``N =
    E_here n_here - E_there n_there``. Mirror images have the normal of the mirror, and
    a rigid body keeps its normal, as a foundation does.
    """
    here = sides.here
    there = sides.there
    of_here = normals_of_side(space, here.facets, here.corners)
    if space.domain.distance(contact.facets, contact.against) == 0:
        return of_here
    # Normals of ghosts come from their owners: an owned facet may face a ghost.
    _, of_there = normal_field(
        space, there.facets, normals_of_side(space, there.facets, there.corners)
    )
    modulus_here, modulus_there = _mean_moduli(space, here, there)
    total = modulus_here * of_here - modulus_there * sides.at_partners(of_there)
    common: np.ndarray = total / np.linalg.norm(total, axis=2, keepdims=True)
    return common


def _given_normal(space: Space, contact: Contact, surface: Ufl, sign: float) -> Ufl:
    """Return the normal that a scene gives, of any length, UFL; collective."""
    what = f"Contact({contact.facets!r})"
    if contact.normal == "gap":
        # Not :func:`number`: a table on a mesh has no slope.
        gap = call_of_user(space.comm, what, lambda: scalar(what, field_of(contact.gap, space.x)))  # type: ignore[arg-type]
        with method_caches_off():
            slope = ufl.algorithms.expand_derivatives(-ufl.grad(gap))
        expression = ufl.replace(slope, {space.x: surface})
    else:
        expression = components(space, contact.normal, f"{what}: normal", surface)
    return -expression if sign < 0 else expression


def _at_vertices(space: Space, contact: Contact, facets: np.ndarray, given: Ufl) -> np.ndarray:
    """Return unit vectors along a given normal at vertices, (f, d, d); collective.

    Raises:
        InputError: If it is zero or not finite there.
    """
    values = space.evaluate(given, nodes(space.d - 1, 1), facets)
    length = np.linalg.norm(values, axis=2)
    error = None
    if not (np.isfinite(length).all() and np.all(length > 0)):
        source = "the gap" if contact.normal == "gap" else "its callable"
        error = InputError(
            f"Contact({contact.facets!r}): the normal is zero or not finite at a vertex of a "
            f"facet; look at {source}."
        )
    raise_together(space.comm, error)
    return values / length[..., None]


def foundation_motion(
    space: Space, trace: Trace, motion: Ufl, what: str
) -> tuple[fem.Function, np.ndarray | None]:
    """Interpolate the motion of a foundation at the nodes of a contact; collective.

    Args:
        space: The mesh.
        trace: The displacement of the contact.
        motion: The motion [length], UFL of shape (d,).
        what: The contact, in words for messages.

    Returns:
        The displacement of the foundation [length], zero off the contact, and what
        facets do not represent of its tangential part, ``int_F |d_t - I d_t|^2``
        [length^(d+1)], shape (f,), or None where they represent all.

    Raises:
        InputError: If the motion is not finite.
    """
    facets = trace.here.facets
    at_nodes = space.evaluate(motion, space.facet_points, facets)
    if not np.isfinite(space.extremes(at_nodes)).all():
        raise InputError(f"{what}: the motion is not finite everywhere; look at it.")
    field = space.function()
    field.x.array.reshape(-1, space.d)[space.facet_nodes(facets)] = at_nodes
    points, weights = rule(space.d - 1, 2 * space.degree + 2)
    shape = lagrange(space.d - 1, space.degree, points)
    difference = space.evaluate(motion, points, facets) - np.matmul(shape, at_nodes)
    size = greatest(space.comm, at_nodes)
    return field, lost_on_facets(space, trace, difference, size, points, weights)


def add_foundation_motion(
    before: fem.Function | None,
    lost: np.ndarray | None,
    moved: fem.Function,
    lost_of_motion: np.ndarray | None,
) -> tuple[fem.Function, np.ndarray | None]:
    """Return the displacement that friction counts from, and what facets lose of it.

    Args:
        before: Displacement relative to the foundation at the end of the last step
            [length]; None without one.
        lost: What facets do not represent of its tangential part, or None.
        moved: Displacement of the foundation [length].
        lost_of_motion: What facets do not represent of it, or None.
    """
    if before is None:
        return moved, lost_of_motion
    total = before.copy()
    total.x.array[:] += moved.x.array
    if lost is None or lost_of_motion is None:
        return total, lost_of_motion if lost is None else lost
    # Both may point along each other.
    return total, (np.sqrt(lost) + np.sqrt(lost_of_motion)) ** 2
