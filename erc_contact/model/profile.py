"""Make profiles of contacts: displacement, traction and status along a contact.

Symbols: u displacement, w displacement of a contact: on a foundation u, between two
bodies the jump of u; w_n and w_t its normal and tangential parts, r contact traction, n
normal of the contact out of the body, d dimension, k degree, f facets, q points of a
facet.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

import numpy as np
from dolfinx import fem

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.contact_values import slip_at
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.status import OPEN, facet_status
from erc_contact.model.contact.trace import split, tangents
from erc_contact.model.contact.turning import turning_of
from erc_contact.model.contact_area import ContactArea, area_of_facets, area_of_strips
from erc_contact.model.contact_end import Estimate
from erc_contact.model.contact_force import ContactForce, force_of_points
from erc_contact.model.space import Space
from namedmesh.base.ranks import of_all
from namedmesh.for_solvers import order_along_curves, successors, to_chain_ends
from namedmesh.simplex import (
    barycentric,
    bernstein,
    lagrange,
    lattice,
    measures,
    projection,
    rule,
)

FACET_POINTS = {1: 1, 2: 4}
"""Number of parts of a facet's edge between the points of a profile, by degree.

Linear functions need only their ends.
"""
POINT_ON_SIDE = 1e-9
"""Barycentric coordinate below which a point of a facet lies on its side [-]."""
SAME_X = 1e-9
"""Way along x over the extent of the body that counts as none [-]."""
PLACE_DIGITS = 9
"""Digits of coordinates over the extent of the body that tell points apart [-]."""


def profile_points(space: Space) -> np.ndarray:
    """Return the reference points of a profile on a facet, shape (q, d-1)."""
    return lattice(space.d - 1, FACET_POINTS[space.degree])


def profile_weights(space: Space) -> np.ndarray:
    """Compute the shares of a facet's area of its profile points, shape (q,).

    They integrate polynomials of the model's degree exactly. Of all weights that do,
    they are nearest to the weights of the trapezoidal rule, which integrates linear
    functions only. So they are positive.
    """
    points = profile_points(space)
    on_sides = np.sum(barycentric(points) < POINT_ON_SIDE, axis=1)
    # As many small parts as meet at the point: one at a corner, three on a side and six
    # inside a triangle.
    parts = 1 / np.array([factorial(number + 1) for number in on_sides])
    trapezoids = parts / parts.sum()
    shape = bernstein(space.d - 1, space.degree, points)
    # All Bernstein polynomials have the same integral.
    means = np.full(shape.shape[1], 1 / shape.shape[1])
    return trapezoids + np.linalg.lstsq(shape.T, means - shape.T @ trapezoids)[0]


def profile_traction(space: Space, contact: ContactOnMesh, traction: Ufl) -> np.ndarray:
    """Return the traction of a method at the profile points [force/area], (f, q, d).

    It is projected on polynomials of the degree of u on each facet, which have the same
    force: on a gap that curves within a facet Nitsche's traction is far from its mean
    at single points. So it may pull a little on the facet where a contact ends.
    Where normals turn along facets, the polynomials turn as r^ does, see
    :mod:`erc_contact.model.contact.turning`.
    """
    samples, weights = rule(space.d - 1, space.contact_degree)
    sampled = space.evaluate(traction, samples, contact.facets)
    sampled = space.section.over(sampled, contact.trace.here.points_at(samples))
    turning = turning_of(contact.trace)
    degree = space.degree if turning is None else turning.degree
    project = projection(space.d - 1, degree, samples, weights)
    if turning is None:
        coefficients = np.matmul(project, sampled)
    else:
        coefficients = turning.tractions(turning.nearest(sampled, samples, weights, project))
    return np.matmul(bernstein(space.d - 1, space.degree, profile_points(space)), coefficients)


def profile_table(
    space: Space,
    contact: ContactOnMesh,
    u: fem.Function,
    r: np.ndarray,
    bound: np.ndarray,
) -> np.ndarray:
    """Tabulate gap, slip, tractions and status along a contact; collective.

    Args:
        space: The mesh.
        contact: One of its contacts.
        u: Displacement [length].
        r: Contact traction at the :func:`profile_points` [force/area], shape (f, q, d).
        bound: Friction bound there [force/area], shape (f, q).

    Returns:
        A structured array for numpy and pandas, the same on all ranks, with the columns

        - ``x``, ``y`` and in 3D ``z``: position [length],
        - ``gap``: the gap that is left, g - w_n [length],
        - ``slip``: length of w_t, or of its change since the last step of a history
              [length], without the tangential deflection of a compliant foundation,
        - ``pressure``: -r_n, ``shear``: length of r_t, and ``friction_bound``: the
          greatest length in its direction [force/area],
        - ``status``: status of the facet, 0 open, 1 slip, 2 stick, 3 closed without
          friction, see :func:`erc_contact.model.contact.status.facet_status`,
        - ``weight``: part of the contact that the point stands for [length] in 2D,
          [area] in 3D. The sum of ``weight * pressure`` is the normal force up to
          round-off, because the tractions of an admissible pair are polynomials of
          degree k on facets.

        Of bodies that are modelled apart, places, tractions and weights are on the side
        that the scene names first.

        A contact between two bodies has more columns, which come last: the displacement
        of this side, ``u_x``, ``u_y`` and in 3D ``u_z``, and the displacement of the
        facing point, ``other_u_x``, ``other_u_y`` and ``other_u_z`` [length].

        In 2D the points are in order along the contact, and the first column ``s`` is
        their arc length [length]. An open curve ends at a greater x than it begins, or
        at a greater y where x is the same: where it is a graph over x, x ascends. A
        closed curve begins at its lowest x and has the body on its left. ``slip`` and
        ``shear`` have a sign in 2D, which is positive in this order. Each facet has
        points of its own, because tractions jump from one facet to the next.
    """
    points = profile_points(space)
    facets = contact.facets
    share = _share(space, contact)
    n = contact.sign * contact.trace.normals_at(points)
    shape = lagrange(space.d - 1, space.degree, points)
    w = contact.sign * np.matmul(shape, contact.trace.of(u.x.array))
    w_n = split(w, n).normal
    w_t = contact.sign * slip_at(space, contact, u.x.array, r, points)
    slip = np.linalg.norm(w_t, axis=-1)
    r_n, r_t, shear = split(named_traction(space, contact, r), n)
    needed = contact.friction_set.gauge(r_t, n)
    along_shear = np.divide(shear, needed, out=np.ones_like(needed), where=needed > 0)
    gap = np.zeros(1)
    if contact.gap is not None:
        gap = space.evaluate(contact.gap, points, facets)
    if space.d == 2:
        # In the plane slip and shear have a sign.
        (tangent,) = tangents(n)
        slip = (w_t * tangent).sum(axis=-1)
        shear = (r_t * tangent).sum(axis=-1)
    status = facet_status(space, contact, u, r, bound, points, profile_weights(space))
    columns = profile_places(space, contact)
    columns["gap"] = gap - w_n
    columns["slip"] = slip
    columns["pressure"] = 0.0 - r_n
    columns["shear"] = shear
    columns["friction_bound"] = share * along_shear * bound
    columns["status"] = status[:, None]
    columns["weight"] = named_weights(space, contact)
    if contact.against is not None:
        nodal = u.x.array.reshape(-1, space.d)
        sides = [contact.trace.here.nodes, contact.trace.partners]
        if contact.is_exchanged:
            sides.reverse()
        for name, nodes in zip(("u", "other_u"), sides, strict=True):
            displacement = np.matmul(shape, nodal[nodes])
            for axis, letter in enumerate("xyz"[: space.d]):
                columns[f"{name}_{letter}"] = displacement[..., axis]
    return _in_order(space, contact, columns)


def contact_area(
    space: Space,
    contact: ContactOnMesh,
    u: fem.Function,
    r: np.ndarray,
    bound: np.ndarray,
    *,
    can_open: bool,
    relative_error: float = 0.0,
) -> ContactArea:
    """Find where a contact ends; collective, the same on all ranks.

    Args:
        space: The mesh.
        contact: One of its contacts.
        u: Displacement [length].
        r: Contact traction at the :func:`profile_points` [force/area], shape (f, q, d).
        bound: Friction bound there [force/area], shape (f, q).
        can_open: Whether the contact may open; if not, its area is the area of its
            part.
        relative_error: eps of the solution [-]. An energy that is off by eps^2 moves
            the ends by a like part of their distance, which the margins contain.
    """
    share = relative_error**2
    if space.d == 2:
        table = profile_table(space, contact, u, r, bound)
        is_closed = table["status"].reshape(-1, len(profile_points(space)))[:, 0] != OPEN
        return area_of_strips(space, table, is_closed, share, can_open=can_open)
    points, weights = profile_points(space), profile_weights(space)
    pressures = -split(r, contact.trace.normals_at(points)).normal @ weights
    is_closed = facet_status(space, contact, u, r, bound, points, weights) != OPEN
    if not can_open:
        is_closed[:] = True
    here = contact.trace.here
    return area_of_facets(
        space.comm,
        space.global_numbers(here.nodes[:, : space.d])[here.owned],
        measures(contact.named_corners)[here.owned],
        (pressures * measures(here.corners))[here.owned],
        is_closed[here.owned],
        space.degree,
        share,
    )


def contact_force(
    space: Space, contact: ContactOnMesh, r: np.ndarray, area: Estimate
) -> ContactForce:
    """Sum up the tractions of a contact; collective, the same on all ranks.

    Args:
        space: The mesh.
        contact: One of its contacts.
        r: Contact traction at the :func:`profile_points` [force/area], shape (f, q, d).
        area: Its area.
    """
    normals = contact.sign * contact.trace.normals_at(profile_points(space))
    r_n, r_t, _ = split(named_traction(space, contact, r), normals)
    x = np.stack(list(profile_places(space, contact).values()), axis=-1)
    owned = contact.trace.here.owned
    return force_of_points(
        space,
        -r_n[owned].ravel(),
        r_t[owned].reshape(-1, space.d),
        named_weights(space, contact)[owned].ravel(),
        x[owned].reshape(-1, space.d),
        area,
    )


def named_traction(space: Space, contact: ContactOnMesh, r: np.ndarray) -> np.ndarray:
    """Return the traction on the side that the scene names first [force/area].

    Args:
        space: The mesh.
        contact: One of its contacts.
        r: Traction at the :func:`profile_points` [force/area], shape (f, q, d).
    """
    return contact.sign * _share(space, contact)[..., None] * r


def named_weights(space: Space, contact: ContactOnMesh) -> np.ndarray:
    """Return the parts of a contact that the profile points stand for, (f, q)."""
    named = contact.named_corners
    weights = measures(named)[:, None] * profile_weights(space)
    return space.section.times(weights, np.matmul(barycentric(profile_points(space)), named))


def _share(space: Space, contact: ContactOnMesh) -> np.ndarray:
    """Return areas of this side over areas of the named side [-], (f, q) or (f, 1)."""
    corners = contact.trace.here.corners
    return space.section.area_ratio(corners, contact.named_corners, profile_points(space))


def slip_before_table(space: Space, contact: ContactOnMesh) -> np.ndarray:
    """Tabulate s along a contact [length], in the order of :func:`profile_table`.

    Returns:
        The tangential displacement that friction counts from, of the side that the
        scene names first and relative to the other side, shape (points, d). Collective.
    """
    shape = lagrange(space.d - 1, space.degree, profile_points(space))
    s = contact.sign * np.matmul(shape, contact.trace.slip_before)
    columns = profile_places(space, contact)
    names = [f"s_{letter}" for letter in columns]
    columns |= {name: s[..., axis] for axis, name in enumerate(names)}
    table = _in_order(space, contact, columns)
    return np.stack([table[name] for name in names], axis=1)


def _in_order(space: Space, contact: ContactOnMesh, columns: dict[str, np.ndarray]) -> np.ndarray:
    """Gather columns of all facets, ordered as :func:`profile_table` says; collective.

    Args:
        space: The mesh.
        contact: One of its contacts.
        columns: Arrays that broadcast to (f, q), ghosts included, by their names. The
            first ones are the position.

    Returns:
        A structured array, the same on all ranks.
    """
    table = np.stack(np.broadcast_arrays(*columns.values()), axis=2)
    vertices = space.global_numbers(contact.trace.here.nodes[:, : space.d])
    if space.d == 2:
        _turn_facets(table, vertices, *tangents(contact.sign * contact.direction))
    # Each facet comes from its owner alone.
    owned = contact.trace.here.owned
    table, vertices = of_all(space.comm, table[owned], vertices[owned])
    names = list(columns)
    if space.d == 2:
        signed = [place for place, name in enumerate(names) if name in ("slip", "shear")]
        _let_ascend(table, vertices, signed, space.domain.extent)
        table = _along_curves(table, vertices)
        names = ["s", *names]
    else:
        table = _by_place(table, space.domain.extent)
    rows = table.reshape(-1, len(names))
    kinds = [(name, int if name == "status" else float) for name in names]
    result = np.empty(len(rows), dtype=kinds)
    for name, column in zip(names, rows.T, strict=True):
        result[name] = column
    return result


def profile_places(space: Space, contact: ContactOnMesh) -> dict[str, np.ndarray]:
    """Return the coordinates of the profile points [length], (f, q), by their names."""
    points = profile_points(space)
    x = space.evaluate(space.x, points, contact.facets)
    if contact.is_exchanged and contact.between is not None:
        x = x + np.matmul(barycentric(points), contact.between)
    return {name: x[..., axis] for axis, name in enumerate("xyz"[: space.d])}


def _turn_facets(table: np.ndarray, vertices: np.ndarray, along: np.ndarray) -> None:
    """Give all facets in 2D the direction of the tangent, in place.

    Args:
        table: Rows of the points of each facet, which begin with x and y, shape
            (f, q, c).
        vertices: Vertices of each facet, shape (f, 2).
        along: Unit tangents, shape (f, 2).
    """
    chord = table[:, -1, :2] - table[:, 0, :2]
    backward = (chord * along).sum(axis=1) < 0
    table[backward] = table[backward, ::-1]
    vertices[backward] = vertices[backward, ::-1]


def _let_ascend(
    table: np.ndarray, vertices: np.ndarray, signed: Sequence[int], extent: float
) -> None:
    """Turn open curves in 2D that go to lower x, or straight to lower y, in place.

    Args:
        table: Rows of the points of each facet, which begin with x and y, shape
            (f, q, c). All facets of a curve have its direction.
        vertices: First and last vertex of each facet, shape (f, 2).
        signed: Columns that have the sign of the direction.
        extent: Extent of the body [length].
    """
    successor = successors(*vertices.T)
    count = len(successor)
    _, last = to_chain_ends(successor, np.ones(count))
    # The first facet of an open curve succeeds no other one; a closed curve has none.
    first = np.setdiff1d(np.arange(count), successor[successor != np.arange(count)])
    way = table[last[first], -1, :2] - table[first, 0, :2]
    is_upright = abs(way[:, 0]) <= SAME_X * extent
    descends = np.zeros(count, dtype=bool)
    descends[last[first]] = np.where(is_upright, way[:, 1], way[:, 0]) < 0
    turned = descends[last]
    table[turned] = table[turned, ::-1]
    vertices[turned] = vertices[turned, ::-1]
    for column in signed:
        # without a minus before zero
        table[turned, :, column] = 0.0 - table[turned, :, column]


def _along_curves(table: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Order facets in 2D along their curves, and put the arc length in front.

    Args:
        table: Rows of the points of each facet, which begin with x and y, shape
            (f, q, c).
        vertices: First and last vertex of each facet, shape (f, 2).

    Returns:
        The rows with one more column, shape (f, q, c + 1).
    """
    table = table[order_along_curves(vertices[:, 0], vertices[:, 1], table[:, 0, :2])]
    edge = np.linalg.norm(np.diff(table[..., :2], axis=1), axis=2)
    within = np.pad(np.cumsum(edge, axis=1), ((0, 0), (1, 0)))
    before = np.pad(np.cumsum(edge.sum(axis=1))[:-1], (1, 0))
    arc_length = within + before[:, None]
    return np.concatenate([arc_length[..., None], table], axis=2)


def _by_place(table: np.ndarray, extent: float) -> np.ndarray:
    """Order facets in 3D by their middles, and the points of each by their places.

    So the order does not depend on the ranks.

    Args:
        table: Rows of the points of each facet, which begin with x, y and z, shape
            (f, q, c).
        extent: Extent of the body [length].

    Returns:
        The rows, shape (f q, c).
    """
    place = np.round(table[..., :3] / extent, PLACE_DIGITS)
    middle = place.mean(axis=1).round(PLACE_DIGITS - 1)
    rank_of_facet = np.argsort(np.lexsort(middle.T))
    rank_of_row = np.repeat(rank_of_facet, place.shape[1])
    order = np.lexsort([*place.reshape(-1, 3).T, rank_of_row])
    return table.reshape(-1, table.shape[2])[order]
