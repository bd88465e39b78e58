"""Profiles of contacts: a displacement and a traction along a contact, and which facets are open, slip or stick.

Symbols: u displacement, r contact traction, n normal of the foundation, d dimension, k
degree, f facets, q points of a facet.
"""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.mesh.simplex import barycentric, bernstein, lagrange, lattice
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.model.trace import split

OPEN, SLIP, STICK = 0, 1, 2
"""Codes of the status of a contact."""
FACET_POINTS = {1: 1, 2: 4}
"""Parts of a facet's edge between the points of a profile, by degree: linear functions need only their ends."""

POINT_ON_SIDE = 1e-9
"""Barycentric coordinate below which a point of a facet lies on its side [-]."""


def profile_points(model: Model) -> np.ndarray:
    """The reference points of a facet at which a profile has values, shape (q, d-1)."""
    return lattice(model.d - 1, FACET_POINTS[model.degree])


def profile_weights(model: Model) -> np.ndarray:
    """Compute the shares of a facet's area that its profile points stand for, shape (q,).

    They integrate polynomials of the model's degree exactly. Of all weights that do,
    they are nearest to those of the trapezoidal rule, which integrates linear functions
    only. So they are positive.
    """
    points = profile_points(model)
    on_sides = np.sum(barycentric(points) < POINT_ON_SIDE, axis=1)
    # As many small parts as meet at the point: one at a corner, three on a side and six
    # inside a triangle.
    parts = 1 / np.array([factorial(number + 1) for number in on_sides])
    trapezoids = parts / parts.sum()
    shape = bernstein(model.d - 1, model.degree, points)
    means = np.full(
        shape.shape[1], 1 / shape.shape[1]
    )  # all Bernstein polynomials have the same integral
    return trapezoids + np.linalg.lstsq(shape.T, means - shape.T @ trapezoids)[0]


def facet_status(
    contact: BoundContact,
    pressure: np.ndarray,
    shear: np.ndarray,
    bound: np.ndarray,
    peak: float,
    margin: float = 0.0,
) -> np.ndarray:
    """Which facets of a contact are open, slip or stick.

    A facet without pressure is ``OPEN``, except in a bilateral contact. A facet whose
    shear reaches the friction bound, up to 1e-6, is ``SLIP``; without friction this is
    every pressed facet. All others are ``STICK``. If the friction bound must be
    sampled, less shear counts as ``SLIP``: its share of the bound may be below 1 by the
    relative variation of bound over pressure on the facet.

    Args:
        contact: The contact.
        pressure: -r_n [force/area], shape (f, q).
        shear: Length of r_t [force/area], shape (f, q).
        bound: Friction bound [force/area], shape (f, q).
        peak: Greatest pressure of the contact, which tells pressure from round-off
            [force/area].
        margin: Share of the variation that is added to the variation [-].

    Returns:
        OPEN, SLIP or STICK, shape (f,).
    """
    slope = np.divide(bound, pressure, out=np.zeros_like(pressure), where=pressure > 0)
    most = slope.max(axis=1, initial=0.0)
    variation = np.divide(np.ptp(slope, axis=1), most, out=np.zeros_like(most), where=most > 0)
    variation = np.where(contact.sampled, variation, 0.0)
    slips = shear.sum(axis=1) >= (1 - 1e-6 - (1 + margin) * variation) * bound.sum(axis=1)
    opens = (pressure.max(axis=1, initial=0.0) <= 1e-10 * peak) & (not contact.bilateral)
    return np.where(opens, OPEN, np.where(slips, SLIP, STICK))


def profile_table(
    model: Model,
    contact: BoundContact,
    u: fem.Function,
    r: np.ndarray,
    bound: np.ndarray,
    status: np.ndarray,
) -> np.ndarray:
    """Gap, slip, tractions and status along a contact, point by point; collective.

    Args:
        model: The scene on a mesh.
        contact: One of its contacts.
        u: Displacement [length].
        r: Contact traction at the :func:`profile_points` [force/area], shape (f, q, d).
        bound: Friction bound there [force/area], shape (f, q).
        status: OPEN, SLIP or STICK of the facets, shape (f,).

    Returns:
        A structured array for numpy and pandas, the same on all ranks, with the columns

        - ``x``, ``y`` and in 3D ``z``: position [length],
        - ``gap``: the gap that is left, g - u_n [length],
        - ``slip``: length of u_t, or of its change since the last step of a history
          [length],
        - ``pressure``: -r_n, ``shear``: length of r_t, and ``friction_bound``
          [force/area],
        - ``status``: status of the facet, 0 open, 1 slip, 2 stick,
        - ``weight``: part of the contact that the point stands for [length] in 2D,
          [area] in 3D. The sum of ``weight * pressure`` is the normal force up to
          round-off, because the tractions of an admissible pair are polynomials of
          degree k on facets.

        In 2D the points are in order along the contact, and the first column ``s`` is
        their arc length [length]. There ``slip`` and ``shear`` have a sign, which is
        positive in this order. Each facet has points of its own, because tractions jump
        from one facet to the next.
    """
    d, k, comm = model.d, model.degree, model.comm
    points, nodes = profile_points(model), contact.trace.here.nodes
    n = contact.direction[:, None, :]
    w = np.matmul(lagrange(d - 1, k, points), contact.trace.since(u.x.array))
    (w_n, w_t, slip), (r_n, r_t, shear) = split(w, n), split(r, n)
    gap: Any = (
        0.0 if contact.gap is None else evaluate(contact.gap, model.mesh, points, contact.facets)
    )
    x = evaluate(model.x, model.mesh, points, contact.facets)
    numbers = model.global_numbers(nodes[:, :d])
    if d == 2:
        tangent = np.stack([-n[..., 1], n[..., 0]], axis=-1)
        slip, shear = (w_t * tangent).sum(axis=-1), (r_t * tangent).sum(axis=-1)
    weight = contact.trace.here.areas[:, None] * profile_weights(model)
    columns = [
        *np.moveaxis(x, 2, 0),
        gap - w_n,
        slip,
        0.0 - r_n,
        shear,
        bound,
        status[:, None],
        weight,
    ]
    table = np.stack(np.broadcast_arrays(*columns), axis=2)
    if d == 2:  # all facets in the direction of the tangent
        back = ((x[:, -1] - x[:, 0]) * tangent[:, 0]).sum(axis=1) < 0
        table[back], numbers[back] = table[back, ::-1], numbers[back, ::-1]
    own = contact.trace.here.owned
    parts = comm.allgather((table[own], numbers[own]))
    table, numbers = (np.concatenate(part) for part in zip(*parts, strict=True))
    names = [*"xyz"[:d], "gap", "slip", "pressure", "shear", "friction_bound", "status", "weight"]
    if d == 3:
        place = np.round(table[..., :3] / model.domain.extent, 9)
        facet = np.argsort(np.lexsort(place.mean(axis=1).round(8).T))
        within = np.lexsort([*place.reshape(-1, 3).T, np.repeat(facet, place.shape[1])])
        table = table.reshape(-1, table.shape[2])[within][:, None]
    else:
        table = table[_in_order(numbers[:, 0], numbers[:, 1], table[:, 0, :2])]
        edge = np.linalg.norm(np.diff(table[..., :2], axis=1), axis=2)
        along = np.pad(np.cumsum(edge, axis=1), ((0, 0), (1, 0)))
        along += np.pad(np.cumsum(edge.sum(axis=1))[:-1], (1, 0))[:, None]
        table, names = np.concatenate([along[..., None], table], axis=2), ["s", *names]
    rows = table.reshape(-1, len(names))
    result = np.empty(
        len(rows), dtype=[(name, int if name == "status" else float) for name in names]
    )
    for key, column in zip(names, rows.T, strict=True):
        result[key] = column
    return result


def greatest_pressure(model: Model, pressure: np.ndarray) -> float:
    """The greatest of pressures (f, q) over all ranks, at least 0; collective."""
    return model.comm.allreduce(float(pressure.max(initial=0.0)), MPI.MAX)


def _in_order(start: np.ndarray, end: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The order of facets along the open and closed curves that they form, one curve after the other.

    The curve with the lowest first point comes first.

    Args:
        start: Number of the first vertex of each facet, shape (f,).
        end: Number of its last vertex.
        x: Position of the first vertex, shape (f, 2).

    Returns:
        Numbers of the facets in order, shape (f,); found by pointer doubling.
    """
    f = len(start)
    key = np.empty(f, dtype=int)
    key[np.lexsort(x.T[::-1])] = np.arange(f)
    by_start = np.argsort(start)
    place = np.minimum(np.searchsorted(start[by_start], end), f - 1)
    follower = np.append(np.where(start[by_start[place]] == end, by_start[place], f), f)
    rounds = range(int(f).bit_length())
    least, jump = np.append(key, f), follower
    for _ in rounds:
        least, jump = np.minimum(least, least[jump]), jump[jump]
    cut = (jump[:-1] < f) & (
        key[follower[:-1] % f] == least[:-1]
    )  # a closed curve is cut before its lowest point
    follower[:-1][cut] = f
    left, jump = (follower < f).astype(int), follower
    last = np.arange(f + 1)
    for _ in rounds:
        last = np.where(jump < f, last[jump], last)
        left, jump = left + left[jump], jump[jump]
    first = np.full(f + 1, f)
    np.minimum.at(first, last, np.append(np.where(np.isin(np.arange(f), follower[:-1]), f, key), f))
    return np.lexsort([-left[:-1], first[last[:-1]]])
