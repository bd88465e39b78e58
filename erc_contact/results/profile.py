"""Profiles of contacts: gap, slip and tractions along a contact, and which parts are open, slip or stick.

Symbols: u^ admissible displacement, r^ admissible contact traction, n normal of the foundation, d dimension, k degree.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cones import split
from erc_contact.admissible.contact import MARGIN
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.simplex import bernstein, lagrange, lattice
from erc_contact.model.expressions import evaluate

OPEN, SLIP, STICK = 0, 1, 2
"""Codes of the status of a contact."""


FACET_POINTS = {1: 1, 2: 4}
"""Parts of a facet's edge between the points of a profile, by degree: linear functions need only their ends."""


def contact_of(pair: Admissible, name: str) -> ContactTraction:
    """The traction on the contact of a name.

    Raises:
        InputError: If no contact has this name.
    """
    found = {t.contact.name: t for t in pair.tractions}
    if name not in found:
        raise InputError(f"No contact is called {name!r}; this scene has {', '.join(sorted(found)) or 'none'}.")
    return found[name]


def profile(pair: Admissible, name: str) -> np.ndarray:
    """What happens along a contact, point by point; collective.

    Args:
        pair: An admissible pair.
        name: Name of the contact.

    Returns:
        A structured array for numpy and pandas, the same on all ranks: ``x`` (and ``y``, ``z``) position, ``gap`` left,
        ``slip`` (length of u^_t) [length]; ``pressure``, ``shear`` (length of r^_t), ``friction_bound``
        [force/area]; ``status`` of the facet, 0 open, 1 slip, 2 stick. In 2D the points come in order along the
        contact, with their arc length ``s`` [length], and slip and shear have the sign of their direction in this
        order. Each facet has points of its own, as r^ jumps from one to the next.

    Raises:
        InputError: If no contact has this name.
    """
    model, traction = pair.solution.model, contact_of(pair, name)
    d, k, contact, comm = model.d, model.degree, traction.contact, model.comm
    points = lattice(d - 1, FACET_POINTS[k])
    n = contact.direction[:, None, :]
    nodal = pair.displacement.x.array.reshape(-1, d)[traction.nodes]
    shape = bernstein(d - 1, k, points)
    r_n, r_t, shear = split(np.matmul(shape, traction.values), n)
    w_n, w_t, slip = split(np.matmul(lagrange(d - 1, k, points), nodal), n)
    gap: Any = 0.0 if contact.gap is None else evaluate(contact.gap, model.mesh, points, contact.facets)
    x = evaluate(model.x, model.mesh, points, contact.facets)
    numbers = model.global_numbers(traction.nodes[:, :d])
    if d == 2:
        tangent = np.stack([-n[..., 1], n[..., 0]], axis=-1)
        slip, shear = (w_t * tangent).sum(axis=-1), (r_t * tangent).sum(axis=-1)
    peak = comm.allreduce(float(-traction.normal_component.min(initial=0.0)), MPI.MAX)
    status = np.broadcast_to(contact_status(traction, peak)[:, None], r_n.shape)
    columns = [*np.moveaxis(x, 2, 0), gap - w_n, slip, 0.0 - r_n, shear, traction.friction_bound @ shape.T, status]
    table = np.stack(np.broadcast_arrays(*columns), axis=2)
    if d == 2:  # all facets in the direction of the tangent
        back = ((x[:, -1] - x[:, 0]) * tangent[:, 0]).sum(axis=1) < 0
        table[back], numbers[back] = table[back, ::-1], numbers[back, ::-1]
    own = model.owned(contact.facets)
    parts = comm.allgather((table[own], numbers[own]))
    table, numbers = (np.concatenate(part) for part in zip(*parts, strict=True))
    names = [*"xyz"[:d], "gap", "slip", "pressure", "shear", "friction_bound", "status"]
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
    result = np.empty(len(rows), dtype=[(name, int if name == "status" else float) for name in names])
    for key, column in zip(names, rows.T, strict=True):
        result[key] = column
    return result


def contact_status(traction: ContactTraction, peak: float | None = None) -> np.ndarray:
    """Whether each facet of a contact is open, slips or sticks, by its admissible traction.

    A facet without pressure is ``OPEN``, but in a bilateral contact; one whose nodes all have ``|r_t| >= (1 - 1e-6) b``
    with b the friction bound is ``SLIP``, so every pressed facet of a contact without friction; the others are
    ``STICK``. Where the bound must be sampled on a facet, r^ is shrunk to be allowed between the nodes, too, by at most
    about the variation of b/p: that much less is slip.

    Args:
        traction: r^ on a contact.
        peak: Greatest pressure of the contact, which tells pressure from round-off [force/area]; that of the facets at
            hand by default.

    Returns:
        OPEN, SLIP or STICK for each facet of ``traction.contact.facets``, shape (n,).
    """
    pressure = -traction.normal_component
    bound = traction.friction_bound.sum(axis=1)
    slope = np.divide(traction.friction_bound, pressure, out=np.zeros_like(pressure), where=pressure > 0)
    most = slope.max(axis=1, initial=0.0)
    variation = np.divide(np.ptp(slope, axis=1), most, out=np.zeros_like(most), where=most > 0)
    variation = np.where(traction.contact.sampled, variation, 0.0)
    shear = np.linalg.norm(traction.tangential_part, axis=-1).sum(axis=1)
    slips = shear >= (1 - 1e-6 - (1 + MARGIN) * variation) * bound
    opens = pressure.max(axis=1, initial=0.0) <= 1e-10 * (pressure.max(initial=0.0) if peak is None else peak)
    opens &= not traction.contact.bilateral
    return np.where(opens, OPEN, np.where(slips, SLIP, STICK))


def _in_order(start: np.ndarray, end: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The facets of curves one after the other: open and closed ones, those with the lowest first point first.

    Args:
        start: Number of the first vertex of each facet, shape (f,).
        end: Number of its last vertex.
        x: Position of the first vertex, shape (f, 2).

    Returns:
        The order, by pointer doubling.
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
    cut = (jump[:-1] < f) & (key[follower[:-1] % f] == least[:-1])  # a closed curve is cut before its lowest point
    follower[:-1][cut] = f
    left, jump = (follower < f).astype(int), follower
    last = np.arange(f + 1)
    for _ in rounds:
        last = np.where(jump < f, last[jump], last)
        left, jump = left + left[jump], jump[jump]
    first = np.full(f + 1, f)
    np.minimum.at(first, last, np.append(np.where(np.isin(np.arange(f), follower[:-1]), f, key), f))
    return np.lexsort([-left[:-1], first[last[:-1]]])
