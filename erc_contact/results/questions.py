"""What a user asks of a result: forces, profiles of contacts, values at points; the same on all ranks.

Everything here is read off an admissible pair, so forces balance to round-off and contact tractions lie in the cone.

Symbols: u^ and sigma^ admissible displacement and stress, r^ admissible contact traction, n normal of the foundation,
d dimension, k degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, geometry
from mpi4py import MPI

from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.elastic import strains
from erc_contact.admissible.contact import MARGIN, ContactTraction, split
from erc_contact.admissible.macro import tensors
from erc_contact.base.exceptions import InputError
from erc_contact.model.expressions import evaluate
from erc_contact.model.model import Model
from erc_contact.mesh.simplex import barycentric, bernstein, coefficients, facet_vertices, lagrange, lattice, mass, nodes

OPEN, SLIP, STICK = 0, 1, 2
"""Codes of the status of a contact."""
FACET_POINTS = {1: 1, 2: 4}
"""Parts of a facet's edge between the points of a profile, by degree: linear functions need only their ends."""
BETWEEN = 1e-9
"""Difference of barycentric coordinates below which a point lies between two sub-simplices [-]."""


@dataclass(frozen=True, eq=False)
class Force:
    """A force on the body with its moment.

    Attributes:
        force: Resultant [force], shape (d,).
        moment: Moment about the origin [force length], shape (1,) in 2D, (3,) in 3D.
    """

    force: np.ndarray
    moment: np.ndarray

    def __add__(self, other: Force) -> Force:
        return Force(self.force + other.force, self.moment + other.moment)


def force(pair: Admissible, part: str) -> Force:
    """Resultant and moment of the tractions sigma^ n on a part of the boundary; collective.

    On a contact it is what the foundation exerts on the body, on a support the reaction with the loads on the
    components that it leaves free, elsewhere the load.

    Args:
        pair: An admissible pair.
        part: Name of a boundary part.

    Raises:
        InputError: If no boundary part has this name.
    """
    model = pair.solution.model
    sides = model.domain.facets(part)
    sides = sides[model.owned(sides)]
    return _force(pair, sides)


def reactions(pair: Admissible) -> dict[str, Force]:
    """The forces on the body by their cause; collective.

    Args:
        pair: An admissible pair.

    Returns:
        The forces of all supports and contacts by the names of their parts, of all tractions on parts without support
        as "tractions" and of the body force as "body force" where the scene has them; as "balance" the sum of all, zero
        up to round-off.
    """
    scene = pair.solution.scene
    held = dict.fromkeys([s.facets for s in scene.supports] + [c.facets for c in scene.contacts])
    result = {name: force(pair, name) for name in held}
    loaded = dict.fromkeys(t.facets for t in pair.solution.model.tractions if t.facets not in held)
    if loaded:
        forces = [force(pair, name) for name in loaded]
        result["tractions"] = sum(forces[1:], start=forces[0])
    if pair.force is not None:
        result["body force"] = _body_force(pair)
    parts = list(result.values())
    result["balance"] = sum(parts[1:], start=parts[0])
    return result


@dataclass(frozen=True, eq=False)
class Values:
    """Values at points.

    Attributes:
        displacement: u^ [length], shape (n, d).
        stress: sigma^ [force/area], shape (n, d, d).
        elastic_stress: C eps(u^) [force/area], shape (n, d, d): its distance from sigma^ is the local error.
    """

    displacement: np.ndarray
    stress: np.ndarray
    elastic_stress: np.ndarray


def at(pair: Admissible, points: Any) -> Values:
    """Displacement and stresses at points of the body; collective.

    Stresses jump between cells, and sigma^ between its sub-simplices: a point between several has the mean.

    Args:
        pair: An admissible pair.
        points: The same on all ranks [length], shape (n, d) or (d,).

    Raises:
        InputError: If the points have another shape or are not finite, or one lies outside the mesh.
    """
    model = pair.solution.model
    d, comm, mesh = model.d, model.comm, model.mesh
    x = np.atleast_2d(np.asarray(points, dtype=float))
    if x.ndim != 2 or x.shape[1] != d or not np.isfinite(x).all():
        raise InputError(f"The points have shape {np.shape(points)}; give finite numbers of shape (n, {d}).")
    three = np.pad(x, ((0, 0), (0, 3 - d)))
    tree = geometry.bb_tree(mesh, d, padding=1e-10 * model.domain.size)
    near = geometry.compute_colliding_cells(mesh, geometry.compute_collisions_points(tree, three), three)
    point, own = np.repeat(np.arange(len(x)), np.diff(near.offsets)), near.array < model.domain.owned_cells
    point, cell = point[own], near.array[own]
    local = np.zeros((len(x), 1 + d + 2 * d * d))
    np.add.at(local, point, np.column_stack([np.ones(len(point)), _values(pair, cell, x[point])]))
    count, total = np.split(comm.allreduce(local, MPI.SUM), [1], axis=1)
    outside = np.flatnonzero(count == 0)
    if len(outside):
        raise InputError(
            f"{len(outside)} of the {len(x)} points lie outside the mesh, the first is "
            f"{tuple(map(float, x[outside[0]]))}; give points of the body (facets cut off a little of a curved one)."
        )
    total /= count
    u, sigma, elastic = np.split(total, [d, d + d * d], axis=1)
    return Values(u, sigma.reshape(-1, d, d), elastic.reshape(-1, d, d))


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
        ``slip`` (length of u^_t) [length]; ``pressure``, ``shear`` (length of r^_t), ``bound`` of the shear
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
    gap: Any = 0.0 if contact.gap is None else evaluate(contact.gap, model.domain, points, contact.facets)
    x = evaluate(model.x, model.domain, points, contact.facets)
    numbers = model.global_numbers(traction.nodes[:, :d])
    if d == 2:
        tangent = np.stack([-n[..., 1], n[..., 0]], axis=-1)
        slip, shear = (w_t * tangent).sum(axis=-1), (r_t * tangent).sum(axis=-1)
    peak = comm.allreduce(float(-traction.normal.min(initial=0.0)), MPI.MAX)
    status = np.broadcast_to(contact_status(traction, peak)[:, None], r_n.shape)
    columns = [*np.moveaxis(x, 2, 0), gap - w_n, slip, -r_n, shear, traction.bound @ shape.T, status]
    table = np.stack(np.broadcast_arrays(*columns), axis=2)
    if d == 2:  # all facets in the direction of the tangent
        back = ((x[:, -1] - x[:, 0]) * tangent[:, 0]).sum(axis=1) < 0
        table[back], numbers[back] = table[back, ::-1], numbers[back, ::-1]
    own = model.owned(contact.facets)
    parts = comm.allgather((table[own], numbers[own]))
    table, numbers = (np.concatenate(part) for part in zip(*parts, strict=True))
    names = [*"xyz"[:d], "gap", "slip", "pressure", "shear", "bound", "status"]
    if d == 3:
        place = np.round(table[..., :3] / model.domain.size, 9)
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
    pressure = -traction.normal
    bound = traction.bound.sum(axis=1)
    slope = np.divide(traction.bound, pressure, out=np.zeros_like(pressure), where=pressure > 0)
    most = slope.max(axis=1, initial=0.0)
    variation = np.divide(np.ptp(slope, axis=1), most, out=np.zeros_like(most), where=most > 0)
    variation = np.where(traction.contact.sampled, variation, 0.0)
    shear = np.linalg.norm(traction.tangential, axis=-1).sum(axis=1)
    slips = shear >= (1 - 1e-6 - (1 + MARGIN) * variation) * bound
    opens = pressure.max(axis=1, initial=0.0) <= 1e-10 * (pressure.max(initial=0.0) if peak is None else peak)
    opens &= not traction.contact.bilateral
    return np.where(opens, OPEN, np.where(slips, SLIP, STICK))


def _force(pair: Admissible, sides: np.ndarray) -> Force:
    """Of facets of owned cells on the boundary, (n, 2)."""
    model, cells = pair.solution.model, pair.cells
    d, k = model.d, model.degree
    facets = model.mesh.topology.connectivity(d, d - 1).array.reshape(-1, d + 1)[tuple(sides.T)]
    cell, i = np.divmod(cells.side[0][facets], d + 1)
    corners = np.take_along_axis(cells.vertices[cell], facet_vertices(d)[i], axis=1)
    linear = bernstein(d - 1, 1, nodes(d - 1, k)).T @ coefficients(d - 1, k).T
    return _summed(model, corners, np.matmul(linear, pair.moment[facets]))


def _body_force(pair: Admissible) -> Force:
    """Of the body force in all cells."""
    model, cells, owned = pair.solution.model, pair.cells, pair.solution.domain.owned_cells
    assert pair.force is not None
    moment = np.matmul(mass(model.d, 1, model.degree - 1), pair.force[:owned])
    return _summed(model, cells.vertices[:owned], moment)


def _summed(model: Model, corners: np.ndarray, forces: np.ndarray) -> Force:
    """Sum over all ranks of forces (n, v, d) at nodes (n, v)."""
    x = model.V.tabulate_dof_coordinates()[corners]
    f = np.pad(forces, ((0, 0), (0, 0), (0, 3 - model.d)))
    moment = np.cross(x, f).sum(axis=(0, 1))
    local = np.concatenate([forces.sum(axis=(0, 1)), moment[[2]] if model.d == 2 else moment])
    total = model.comm.allreduce(local, MPI.SUM)
    return Force(total[: model.d], total[model.d :])


def _values(pair: Admissible, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """u^, sigma^ and C eps(u^) at points (n, d) of owned cells (n,), row by row."""
    model, cells = pair.solution.model, pair.cells
    d, k = model.d, model.degree
    corner = model.V.tabulate_dof_coordinates()[cells.vertices[cell, 0], :d]
    local = barycentric(np.einsum("nij,nj->ni", cells.inverse[cell], x - corner))
    u = np.einsum(
        "nv,nvi->ni", lagrange(d, k, local[:, 1:]), pair.displacement.x.array.reshape(-1, d)[cells.nodes[cell]]
    )
    sigma = np.zeros((len(cell), pair.stress.shape[3]))
    lowest = local.min(axis=1)  # of the vertex that the barycentre replaces in the sub-simplex of the point
    among = local <= lowest[:, None] + BETWEEN
    for sub in range(d + 1):
        inside = local - local[:, [sub]]
        inside[:, sub] = (d + 1) * local[:, sub]
        values = np.einsum("nm,nms->ns", bernstein(d, k, inside[:, 1:]), pair.stress[cell, sub])
        sigma += (among[:, sub] / among.sum(axis=1))[:, None] * values
    strain = np.einsum("nb,nbs->ns", bernstein(d, k - 1, local[:, 1:]), strains(cells, pair.displacement)[cell])
    elastic = np.einsum("nab,nb->na", _stiffness_at(model, cell, x), strain)
    return np.hstack([u, tensors(sigma, d).reshape(len(x), d * d), tensors(elastic, d).reshape(len(x), d * d)])


def _stiffness_at(model: Model, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """C in Mandel components at points (n, d) of cells (n,), shape (n, s, s); collective."""
    matrix = model.stiffness_matrix
    if isinstance(matrix, np.ndarray):
        return np.broadcast_to(matrix, (len(x), *matrix.shape))
    point = fem.Function(fem.functionspace(model.mesh, ("DG", 0, (model.d,))))
    there = ufl.replace(matrix, {model.x: point})
    result = np.empty((len(x), *matrix.ufl_shape))
    order = np.argsort(cell, kind="stable")
    turn = np.empty(len(x), dtype=int)
    turn[order] = np.arange(len(x)) - np.searchsorted(cell[order], cell[order])  # each round one point of a cell
    for k in range(model.comm.allreduce(int(turn.max(initial=-1)), MPI.MAX) + 1):
        some = turn == k
        point.x.array.reshape(-1, model.d)[cell[some]] = x[some]
        result[some] = evaluate(there, model.domain, nodes(model.d, 0), cell[some].astype(np.int32))[:, 0]
    return result


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
