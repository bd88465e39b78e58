"""Move the vertices of curved surfaces until flat facets enclose the true volume.

Facets whose vertices lie on a curved surface cut a sliver off a convex body, and add
one to a concave body: all of one sign, O(h^2) high. The energy changes by the integral
of the energy density over the slivers. So vertices move by m, until what lies between
the facets and the surface has both signs:

    int (m - o).n phi_v = 0   for each vertex v that moves,

with the vector o from a facet to the nearest point of the surface, the normal n of the
facet, and the function phi_v that is linear on facets, 1 at v and 0 at other vertices.
Each integral of the height times such functions vanishes, as the volume does, and the
volume of a ring, whose weight is the radius: what is left of integrals of smooth
functions is of a higher order.

What belongs to several curves or surfaces keeps to all of them. In 3D a vertex of a
sharp edge moves across the edge, with the same equation along the edge: so plane faces
enclose their true areas, and their rims stay in them. Corners stay. The function of a
vertex that does not move is added to the functions of vertices that do, facet by facet,
so that their sums are still 1.

Vertices move along normals of the true surface. So their nearest points are the ones
from which they moved, and the same vertices move by the same vectors each time.

The surface is solved as a whole on rank 0. Symbols: d dimension, p vertices, f facets.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI

from namedmesh.base.logs import log_of
from namedmesh.simplex import edges, lagrange, mass, measures, normals_across, rule

TANGENT = 0.01
"""Least eigenvalue of normals that span a direction [-].

It is 1 - cos of the angle of two normals: surfaces that meet within 8 degrees are one
smooth surface.
"""
MOST_MOVE = 0.25
"""Greatest move of a vertex, over the shortest edge of its facets or sharp edges [-].

On a circle of n facets it is about ``0.55 / n``, and .32 for three. Cells of the
refined mesh could not follow the way back.
"""
SOLVED = 1e-13
"""Relative residual of the equations of the vertices [-]."""


def marks_table(entities: np.ndarray, marks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the different entities, shape (n,), and their marks, shape (n, m).

    Args:
        entities: Numbers of vertices, nodes or edges, shape (k,).
        marks: A mark of each of them, shape (k,).

    Returns:
        Both; m is the greatest number of marks that an entity has, and -1 stands where
        it has fewer.

    Example:
        >>> marks_table(np.array([7, 7, 4, 7]), np.array([1, 2, 1, 2]))
        (array([4, 7]), array([[ 1, -1],
               [ 1,  2]]))
    """
    pairs = np.unique(np.column_stack([entities, marks]), axis=0)
    chosen, first, count = np.unique(pairs[:, 0], return_index=True, return_counts=True)
    table = np.full((len(chosen), int(count.max(initial=1))), -1)
    row = np.repeat(np.arange(len(chosen)), count)
    table[row, np.arange(len(row)) - first[row]] = pairs[:, 1]
    return chosen, table


@dataclass(frozen=True, eq=False)
class MarkedSurface:
    """Hold all marked facets of a mesh, on rank 0.

    Attributes:
        x: Vertices [length], shape (p, d).
        facets: Vertices of each facet, shape (f, d).
        marks: Mark of the curve or surface of each facet, shape (f,).
    """

    x: np.ndarray
    facets: np.ndarray
    marks: np.ndarray

    @property
    def dim(self) -> int:
        """Return the dimension of space."""
        return self.x.shape[1]

    @cached_property
    def pairs(self) -> np.ndarray:
        """Return the different pairs (vertex, mark), sorted, shape (k, 2)."""
        rows = np.column_stack([self.facets.ravel(), np.repeat(self.marks, self.dim)])
        return np.unique(rows, axis=0)

    def number_of_pair(self, vertices: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return the row of :attr:`pairs` of pairs that are among them, shape (n,)."""
        width = 1 + self.marks.max(initial=0)
        keys = self.pairs @ np.array([width, 1])
        return np.searchsorted(keys, vertices * width + marks)

    @cached_property
    def edges(self) -> np.ndarray:
        """Return the vertices of the edges of the facets, shape (e, 2)."""
        return self._edges[0]

    @cached_property
    def edges_of_facets(self) -> np.ndarray:
        """Return the edges of each facet, shape (f, d (d-1) / 2)."""
        return self._edges[1]

    @cached_property
    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        ends = np.sort(self.facets[:, edges(self.dim - 1)], axis=2)
        rows, number = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
        return rows, number.reshape(ends.shape[:2])

    @cached_property
    def marks_of_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the different pairs of an edge and its marks, shape (k,) each."""
        each = self.edges_of_facets.shape[1]
        rows = np.column_stack([self.edges_of_facets.ravel(), np.repeat(self.marks, each)])
        edge, mark = np.unique(rows, axis=0).T
        return edge, mark


def balanced(comm: MPI.Comm, surface: MarkedSurface, shape: object) -> np.ndarray:
    """Return moves of the vertices that keep the volume [length]; collective.

    Args:
        comm: Communicator.
        surface: The facets on rank 0, whose vertices lie on the true surface; none on
            other ranks.
        shape: The true shape, a :class:`namedmesh.bodies.Geometry`.

    Returns:
        Shape (p, d).
    """
    normals, is_flat = _normals(comm, surface, shape)
    offset = _offsets_of_middles(comm, surface, shape)
    dims, directions = _directions(surface, normals, is_flat)
    moves = np.zeros(surface.x.shape)
    limited = 0
    if surface.dim == 3:
        # The edges first: they are the rims of the surfaces.
        sharp = _sharp_edges(surface, normals)
        ends = surface.edges[sharp]
        limited += _solve(surface.x, ends, offset[sharp][:, None], directions, dims == 2, moves)
    curved = ~is_flat[surface.number_of_pair(surface.facets[:, 0], surface.marks)]
    facets = surface.facets[curved]
    of_facets = offset[surface.edges_of_facets[curved]]
    limited += _solve(surface.x, facets, of_facets, directions, dims == 1, moves)
    if limited:
        log_of(comm).info(
            "The mesh is too coarse for its curves at %d vertices, as a circle of three facets "
            "is: the facets there do not keep the volume.",
            limited,
        )
    return moves


def _normals(
    comm: MPI.Comm, surface: MarkedSurface, shape: object
) -> tuple[np.ndarray, np.ndarray]:
    """Return a unit normal of each pair (vertex, mark), and whether it is flat.

    Where a curved surface has no normal, as at the tip of a cone, it is nan.
    """
    vertex, mark = surface.pairs.T
    normals = shape.normals(comm, surface.x[vertex], mark)  # type: ignore[attr-defined]
    # Flat curves and surfaces have none at any of their vertices.
    _, number = np.unique(mark, return_inverse=True)
    known = np.bincount(number, np.isfinite(normals).all(axis=1))
    is_flat = known[number] == 0
    across = normals_across(surface.x[surface.facets])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    row = surface.number_of_pair(surface.facets, surface.marks[:, None])
    of_flat = is_flat[row]
    normals[row[of_flat]] = np.repeat(across[:, None], surface.dim, axis=1)[of_flat]
    return normals, is_flat


def _offsets_of_middles(comm: MPI.Comm, surface: MarkedSurface, shape: object) -> np.ndarray:
    """Return the vectors from middles of edges to the true surface [length], (e, d)."""
    middles = surface.x[surface.edges].mean(axis=1)
    _, marks = marks_table(*surface.marks_of_edges)
    return shape.nearest(comm, middles, marks) - middles  # type: ignore[attr-defined]


def _products(count: int, row: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the sums of ``n n^T`` of the normals of each row, shape (count, d, d)."""
    d = normals.shape[1]
    result = np.zeros((count, d, d))
    np.add.at(result, row, normals[:, :, None] * normals[:, None])
    return result


def _directions(
    surface: MarkedSurface, normals: np.ndarray, is_flat: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the directions in which vertices may move.

    A vertex moves along the normals of its curved surfaces, and stays in plane ones.

    Returns:
        Number of dimensions that the normals of each vertex span, 0 where it must stay,
        shape (p,); orthonormal directions as columns, then zeros, shape (p, d, d).
    """
    count = len(surface.x)
    vertex = surface.pairs[:, 0]
    d = surface.dim
    lost = np.zeros(count, dtype=bool)
    unknown = ~np.isfinite(normals).all(axis=1)
    lost[vertex[unknown]] = True
    normals = np.where(unknown[:, None], 0.0, normals)
    of_flat = _products(count, vertex, np.where(is_flat[:, None], normals, 0.0))
    of_curved = _products(count, vertex, np.where(is_flat[:, None], 0.0, normals))
    dims = (np.linalg.eigvalsh(of_flat + of_curved) > TANGENT).sum(axis=1)
    size, axes = np.linalg.eigh(of_flat)
    axes = axes * (size > TANGENT)[:, None]
    free = np.eye(d) - axes @ axes.swapaxes(1, 2)
    size, directions = np.linalg.eigh(free @ of_curved @ free)
    may_move = size > TANGENT
    # A plane that a curved surface touches smoothly leaves nothing across it.
    in_plane = _products(count, vertex, normals * is_flat[:, None]).trace(axis1=1, axis2=2) > 0
    stays = lost | (dims == d) | ((dims == 1) & in_plane) | ~may_move.any(axis=1)
    dims[stays] = 0
    # Eigenvalues ascend: the directions come first when they are turned round.
    return dims, (directions * may_move[:, None])[:, :, ::-1]


def _sharp_edges(surface: MarkedSurface, normals: np.ndarray) -> np.ndarray:
    """Find the edges where surfaces meet at an angle, shape (n,)."""
    edge, mark = surface.marks_of_edges
    known = np.where(np.isfinite(normals), normals, 0.0)
    sharp = np.zeros(len(surface.edges), dtype=bool)
    for end in surface.edges.T:
        row = surface.number_of_pair(end[edge], mark)
        size = np.linalg.eigvalsh(_products(len(sharp), edge, known[row]))
        sharp |= size[:, -2] > TANGENT
    return np.flatnonzero(sharp)


def _solve(
    x: np.ndarray,
    simplices: np.ndarray,
    offset: np.ndarray,
    directions: np.ndarray,
    free: np.ndarray,
    moves: np.ndarray,
) -> int:
    """Find the moves of some vertices of edges or facets, in place.

    Args:
        x: Vertices [length], shape (p, d).
        simplices: The vertices of each edge or facet, shape (n, v).
        offset: Vectors to the true curve or surface in the middles of its edges
            [length], shape (n, e, d).
        directions: Directions in which vertices move, shape (p, d, d).
        free: Whether a vertex moves now, shape (p,).
        moves: The moves [length], shape (p, d); the rows of free vertices are set.

    Returns:
        The number of vertices that :data:`MOST_MOVE` limits.
    """
    from scipy import sparse  # type: ignore[import-untyped]  # noqa: PLC0415 - for curves only
    from scipy.sparse.linalg import cg  # type: ignore[import-untyped]  # noqa: PLC0415

    chosen = free[simplices].any(axis=1)
    simplices, offset = simplices[chosen], offset[chosen]
    if not len(simplices):
        return 0
    d = x.shape[1]
    vertices = simplices.shape[1]
    corners = x[simplices]
    is_free = free[simplices]
    along, _ = np.linalg.qr((corners[:, 1:] - corners[:, :1]).swapaxes(1, 2))
    across = np.eye(d) - along @ along.swapaxes(1, 2)
    # A vertex that stays gives its function to those of its facet that move.
    share = (~is_free / is_free.sum(axis=1, keepdims=True))[:, None]
    tests = is_free[:, :, None] * (np.eye(vertices) + share)
    tests *= measures(corners)[:, None, None]
    of_moves = tests @ mass(vertices - 1, 1, 1)
    of_offset = tests @ _mass_of_middles(vertices - 1)
    known = np.where(is_free[..., None], 0.0, moves[simplices])
    wanted = of_offset @ offset - of_moves @ known
    column = directions[simplices]
    heights = across[:, None] @ column
    load = np.einsum("nvdr,nvd->nvr", heights, wanted)
    blocks = np.einsum("nvw,nvdr,nwds->nvrws", of_moves, heights, heights)
    blocks *= is_free[:, None, None, :, None]
    unknowns = simplices[..., None] * d + np.arange(d)
    rows = np.broadcast_to(unknowns[..., None, None], blocks.shape).ravel()
    columns = np.broadcast_to(unknowns[:, None, None], blocks.shape).ravel()
    size = len(x) * d
    matrix = sparse.coo_array((blocks.ravel(), (rows, columns)), (size, size)).tocsr()
    right = np.bincount(unknowns.ravel(), load.ravel(), size)
    diagonal = matrix.diagonal()
    used = np.flatnonzero(diagonal > 0)
    matrix = matrix[used][:, used]
    inverse = sparse.diags_array(1 / diagonal[used])
    amounts = np.zeros(size)
    amounts[used], _ = cg(matrix, right[used], rtol=SOLVED, M=inverse)
    amounts = amounts.reshape(-1, d)
    found = np.einsum("pdr,pr->pd", directions, amounts)
    # The equations know no cells: a move may be longer than the facets beside it.
    shortest = np.full(len(x), np.inf)
    ends = corners[:, edges(vertices - 1)]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).min(axis=1)
    np.minimum.at(shortest, simplices, length[:, None])
    size = np.linalg.norm(found, axis=1)
    most = MOST_MOVE * shortest
    share = np.divide(most, size, out=np.ones(len(size)), where=size > most)
    moves[free] = (share[:, None] * found)[free]
    return int((share[free] < 1.0).sum())


def _mass_of_middles(k: int) -> np.ndarray:
    """Return the means of linear functions times those of middles of edges, (v, e)."""
    points, weights = rule(k, 3)
    linear = lagrange(k, 1, points)
    of_middles = lagrange(k, 2, points)[:, k + 1 :]
    return linear.T @ (weights[:, None] * of_middles)
