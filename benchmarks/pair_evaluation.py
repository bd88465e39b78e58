"""Evaluate sigma^ of a pair with numpy alone, for ``attack_pairs.py``.

Nothing here uses the package but to read the coefficients of sigma^ and the mesh: each
sub-simplex of a cell has the vertices of the cell, one of them replaced by the
barycentre, and Bernstein coefficients in Mandel components.

Symbols: n cells, d dimension, N coefficients, q points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from pair_scenes import Case

UNBALANCED = 1e-7
"""What is missing at a point, over the greatest stress, that is no round-off [-]."""
POINTS = 3
"""Random points in each sub-cell and on each facet."""
EDGES = {
    2: [(1, 2), (0, 2), (0, 1)],
    3: [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)],
}
"""Vertices of the edges in the order of their coefficients."""


@dataclass(frozen=True)
class Gathered:
    """Hold sigma^ of all ranks.

    Attributes:
        x: Vertices of each cell [length], shape (n, d+1, d).
        vertices: Their global numbers, shape (n, d+1).
        stress: Coefficients of sigma^ in the sub-simplices [force/area], shape (n, d+1,
            N, d, d).
        digits: Last digit of ``C eps(u)`` in each cell [force/area], shape (n,).
        parts: Name of each boundary part -> vertices of its facets, ascending.
    """

    x: np.ndarray
    vertices: np.ndarray
    stress: np.ndarray
    digits: np.ndarray
    parts: dict[str, set[tuple[int, ...]]]


def gathered(pair: Any) -> Gathered:
    """Gather a pair on all ranks; collective."""
    model = pair.model
    space = model.space
    d, owned, comm = space.d, model.domain.owned_cells, space.comm
    to_global = space.V.dofmap.index_map.local_to_global
    vertices = pair.cell_geometry.nodes[:owned, : d + 1]
    x = space.V.tabulate_dof_coordinates()[vertices, :d]
    global_vertices = to_global(vertices.ravel().astype(np.int32)).reshape(vertices.shape)
    u = abs(pair.displacement.x.array.reshape(-1, d)).max(axis=1)
    height = np.ptp(x, axis=1).max(axis=1)
    modulus = model.cell_modulus.x.array[:owned]
    digits = np.finfo(float).eps * modulus * u[vertices].max(axis=1, initial=0.0) / height
    parts: dict[str, set[tuple[int, ...]]] = {}
    for name in model.domain.outer:
        facets = space.facet_nodes(model.domain.owned_facets(name))[:, :d]
        rows = np.sort(to_global(facets.ravel().astype(np.int32)).reshape(-1, d), axis=1)
        parts[name] = set(map(tuple, np.concatenate(comm.allgather(rows)).tolist()))
    x = np.concatenate(comm.allgather(x))
    numbers = np.concatenate(comm.allgather(global_vertices))
    stress = np.concatenate(comm.allgather(tensors(pair.stress, d)))
    return Gathered(x, numbers, stress, np.concatenate(comm.allgather(digits)), parts)


def tensors(mandel: np.ndarray, d: int) -> np.ndarray:
    """Return tensors (..., d, d) of Mandel components (..., s)."""
    result = np.zeros((*mandel.shape[:-1], d, d))
    pairs = [(i, i) for i in range(d)] + [(i, j) for i in range(d) for j in range(i + 1, d)]
    for s, (i, j) in enumerate(pairs):
        result[..., i, j] = result[..., j, i] = mandel[..., s] / (1.0 if i == j else np.sqrt(2))
    return result


def values(stress: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Evaluate polynomials, coefficients (n, N, d, d), at places (n, q, d+1)."""
    d = places.shape[-1] - 1
    if stress.shape[1] == d + 1:
        return np.einsum("cqn,cnij->cqij", places, stress)
    squares = [places[..., i] ** 2 for i in range(d + 1)]
    products = [2 * places[..., i] * places[..., j] for i, j in EDGES[d]]
    return np.einsum("ncq,cnij->cqij", np.array(squares + products), stress)


def bodies(vertices: np.ndarray) -> np.ndarray:
    """Number the bodies: cells with a common vertex are of one."""
    label = np.arange(len(vertices))
    while True:
        least = np.full(vertices.max() + 1, len(vertices))
        np.minimum.at(least, vertices, label[:, None])
        new = least[vertices].min(axis=1)
        if np.array_equal(new, label):
            return np.unique(label, return_inverse=True)[1].ravel()
        label = new


def own_imbalance(case: Case, it: Gathered, rng: np.random.Generator) -> float:
    """Return what is missing in equilibrium over the greatest stress of a body [-]."""
    body = bodies(it.vertices)
    size = np.zeros(body.max() + 1)
    np.maximum.at(size, body, abs(it.stress).max(axis=(1, 2, 3, 4)))
    np.maximum.at(size, body, it.digits / UNBALANCED)
    size = np.maximum(size, np.finfo(float).eps / UNBALANCED * size.max())
    missing = np.zeros(len(size))
    np.maximum.at(missing, body, in_cells(case, it, rng))
    for of_cell, amount in (across_facets(case, it, rng), of_bodies(case, it, body)):
        np.maximum.at(missing, body[of_cell], amount)
    if not np.isfinite(missing).all():
        return np.inf
    infinite = np.where(missing > 0, np.inf, 0.0)
    return float(np.divide(missing, size, out=infinite, where=size > 0).max())


def in_cells(case: Case, it: Gathered, rng: np.random.Generator) -> np.ndarray:
    """Return what is missing in and between sub-simplices [force/area], shape (n,)."""
    n, _, d = it.x.shape
    h = np.ptp(it.x, axis=1).max(axis=1)
    centre = it.x.mean(axis=1)
    worst = np.zeros(n)
    for i in range(d + 1):
        corners = it.x.copy()
        corners[:, i] = centre
        edges = (corners[:, 1:] - corners[:, :1]) / h[:, None, None]
        inner = np.linalg.inv(edges)  # gradients of coordinates 1 to d, times h, as columns
        slopes = np.concatenate([-inner.sum(axis=2, keepdims=True), inner], axis=2)
        places = np.tile(rng.dirichlet(np.ones(d + 1), POINTS), (n, 1, 1))
        divergence = np.zeros((n, POINTS, d))
        step = 1e-2
        for j in range(d):
            # Central differences are exact for these polynomials.
            move = step * slopes[:, j][:, None]
            difference = values(it.stress[:, i], places + move) - values(
                it.stress[:, i], places - move
            )
            divergence += difference[..., j] / (2 * step)
        left = divergence + case.force * h[:, None, None]
        worst = np.maximum(worst, abs(left).max(axis=(1, 2)))
        for k in range(i):
            weights = rng.dirichlet(np.ones(d), POINTS)
            shared = [v for v in range(d + 1) if v not in (i, k)]
            here, there = np.zeros((2, n, POINTS, d + 1))
            here[..., shared] = there[..., shared] = weights[:, :-1]
            here[..., i] = there[..., k] = weights[:, -1]
            normal = normals(np.concatenate([it.x[:, shared], centre[:, None]], axis=1))
            jump = values(it.stress[:, i], here) - values(it.stress[:, k], there)
            jump = np.einsum("cqij,cj->cqi", jump, normal)
            worst = np.maximum(worst, abs(jump).max(axis=(1, 2)))
    return worst


def facets_of(it: Gathered) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return cell, opposite vertex, sorted vertices and outward normal of each side."""
    n, _, d = it.x.shape
    cell = np.repeat(np.arange(n), d + 1)
    opposite = np.tile(np.arange(d + 1), n)
    others = np.array([[v for v in range(d + 1) if v != i] for i in range(d + 1)])[opposite]
    order = np.argsort(it.vertices[cell[:, None], others], axis=1)
    others = np.take_along_axis(others, order, axis=1)
    corners = it.x[cell[:, None], others]
    normal = normals(corners)
    outward = np.einsum("fi,fi->f", normal, corners[:, 0] - it.x[cell, opposite])
    return cell, opposite, others, normal * np.sign(outward)[:, None]


def on_sides(it: Gathered, weights: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return tractions [force/area] at points (q, d) of each side, with what it is."""
    cell, opposite, others, normal = facets_of(it)
    places = np.zeros((len(cell), len(weights), it.x.shape[1]))
    np.put_along_axis(places, others[:, None, :], weights[None], axis=2)
    t = np.einsum("fqij,fj->fqi", values(it.stress[cell, opposite], places), normal)
    return cell, it.vertices[cell[:, None], others], normal, t, places


def across_facets(
    case: Case, it: Gathered, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is missing on facets of cells [force/area], and their cells."""
    weights = rng.dirichlet(np.ones(it.x.shape[2]), POINTS)
    cell, keys, normal, t, places = on_sides(it, weights)
    turned = np.repeat(normal[:, None], len(weights), axis=1)
    if case.round:
        turned = radial(places, it.x[cell], normal)
    _, number, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    total = np.zeros((len(count), *t.shape[1:]))
    np.add.at(total, number.ravel(), t)
    missing = abs(total[number.ravel()]).max(axis=(1, 2))
    for side in np.flatnonzero(count[number.ravel()] == 1):
        missing[side] = of_boundary(case, it, tuple(keys[side].tolist()), turned[side], t[side])
    return cell, missing


def radial(places: np.ndarray, x: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return normals between radial ones at vertices, at places (f, q, d+1) of sides.

    Args:
        places: Barycentric coordinates in the cells.
        x: Vertices of the cells [length], shape (f, d+1, d).
        normal: Outward normals of the sides, shape (f, d).
    """
    d = x.shape[2]
    across = x * (np.arange(d) != 1) if d == 3 else x
    at_vertices = across / np.linalg.norm(across, axis=2, keepdims=True)
    result = np.einsum("fqv,fvi->fqi", places, at_vertices)
    result *= np.copysign(1.0, np.einsum("fqi,fi->fq", result, normal))[..., None]
    return result / np.linalg.norm(result, axis=2, keepdims=True)


def of_boundary(
    case: Case, it: Gathered, key: tuple[int, ...], normal: np.ndarray, t: np.ndarray
) -> float:
    """Return what a traction on a facet of the boundary may not have [force/area].

    Normals are those at the points of the traction, shape (q, d).
    """
    names = [name for name, facets in it.parts.items() if key in facets]
    if any(name in case.held for name in names):
        return 0.0
    touching = [side for pair in case.sides for side in pair if side is not None]
    if not any(name in touching for name in names):
        load = case.pressed if case.top in names else 0.0
        return float(abs(t - load).max())
    pressure = -np.einsum("qi,qi->q", t, normal)
    shear = np.linalg.norm(t + pressure[:, None] * normal, axis=1)
    law = case.scene.contacts[0].friction
    bound = law.limit if isinstance(law, ec.Tresca) else law * pressure
    return float(max((-pressure).max(), (shear - bound).max(), 0.0))


def of_bodies(case: Case, it: Gathered, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what is missing in resultants and moments of bodies, and a cell of each.

    It is over the area of their greatest facets [force/area].
    """
    d = it.x.shape[2]
    weights, points = gauss(d)
    cell, keys, _, t, places = on_sides(it, points)
    _, number, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    outer = count[number.ravel()] == 1
    middle = it.x.mean(axis=(0, 1))
    x = np.einsum("fqv,fvi->fqi", places, it.x[cell]) - middle
    corners = it.x[cell]
    area = areas(corners, places)
    forces = (weights[:, None] * t) * area[:, None, None]
    volume = abs(np.linalg.det(it.x[:, 1:] - it.x[:, :1])) / (2 if d == 2 else 6)
    total = np.zeros((body.max() + 1, d))
    turn = np.zeros((body.max() + 1, d, d))
    greatest = np.zeros(body.max() + 1)
    np.add.at(total, body[cell[outer]], forces[outer].sum(axis=1))
    np.add.at(turn, body[cell[outer]], np.einsum("fqi,fqj->fij", x[outer], forces[outer]))
    weight = volume[:, None] * case.force
    np.add.at(total, body, weight)
    np.add.at(turn, body, np.einsum("ci,cj->cij", it.x.mean(axis=1) - middle, weight))
    np.maximum.at(greatest, body[cell], area)
    moment = abs(turn - turn.transpose(0, 2, 1)).max(axis=(1, 2)) / np.ptp(it.x, axis=(0, 1)).max()
    missing = np.maximum(abs(total).max(axis=1), moment) / greatest
    _, first = np.unique(body, return_index=True)
    return first, missing


def areas(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the areas of the sides of cells (f, d+1, d) on which places are."""
    d = corners.shape[2]
    on_side = np.argsort((places == 0.0).all(axis=1), axis=1, kind="stable")[:, :d]
    facet = np.take_along_axis(corners, on_side[..., None], axis=1)
    edges = facet[:, 1:] - facet[:, :1]
    if d == 2:
        return np.asarray(np.linalg.norm(edges[:, 0], axis=1))
    return np.asarray(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2)


def gauss(d: int) -> tuple[np.ndarray, np.ndarray]:
    """Return weights and barycentric points on a facet, exact for degree 3."""
    if d == 2:
        a = 0.5 - np.sqrt(3) / 6
        return np.array([0.5, 0.5]), np.array([[a, 1 - a], [1 - a, a]])
    points = [[1 / 3] * 3, [0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]]
    return np.array([-27, 25, 25, 25]) / 48, np.array(points)


def normals(facets: np.ndarray) -> np.ndarray:
    """Return unit normals of facets (n, d, d)."""
    edges = facets[:, 1:] - facets[:, :1]
    edges = edges / abs(edges).max(axis=(1, 2))[:, None, None]
    if facets.shape[1] == 2:
        normal = np.column_stack([-edges[:, 0, 1], edges[:, 0, 0]])
    else:
        normal = np.cross(edges[:, 0], edges[:, 1])
    return normal / np.linalg.norm(normal, axis=1)[:, None]
