"""Refine the mesh of a deck, and know what its sets and faces are on the finer mesh.

The cells are split into simplices, which are bisected until they have the wanted sizes.
Each new node lies in an old simplex, as a mean of old nodes with barycentric weights.
The old nodes that have a weight tell of which corner, edge, face or cell it is; the
table of all weights carries values at nodes to the finer mesh.

Symbols: d dimension, n new nodes, c new cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy import sparse  # type: ignore[import-untyped]

from namedmesh.base.releases import cell_nodes
from namedmesh.deck_mesh import DeckMesh
from namedmesh.files.of_abaqus import FACES
from namedmesh.partition import distribute
from namedmesh.refinement import refine
from namedmesh.rows import look_up, row_numbers
from namedmesh.sides import connect_facets
from namedmesh.simplex import barycentric, determinants, facet_vertices, measures
from namedmesh.size_field import FILL

ZERO = 1e-9
"""Weight of a node that is none [-]."""
SIMPLEX = {2: "triangle", 3: "tetrahedron"}
"""Shape of the new cells by the dimension."""
EDGES = {2: ((0, 1), (1, 2), (2, 0)), 3: ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))}
"""Corners of the edges of new cells, in the order of their nodes of second order."""


@dataclass(frozen=True, eq=False)
class FinerDeckMesh:
    """Hold a finer mesh of simplices for a deck.

    Attributes:
        deck: The mesh of the deck.
        x: The nodes [length], corners first, shape (n, d).
        cells: Nodes of the cells as Abaqus orders them, shape (c, k).
        parents: The cell of the deck in which each lies, shape (c,).
        weights: Weights of the nodes of the deck in each node, shape (n, nodes of the
            deck).
        faces: The face of the deck on which each side of a cell lies, in the order S1,
            S2, ..., -1 for none, shape (c, d+1).
    """

    deck: DeckMesh
    x: np.ndarray
    cells: np.ndarray
    parents: np.ndarray
    weights: sparse.csr_array
    faces: np.ndarray

    @cached_property
    def node_numbers(self) -> np.ndarray:
        """Return the number of each node; corners of the deck keep theirs, (n,)."""
        known = self.deck.numbers
        numbers = known.max(initial=0) + 1 + np.arange(len(self.x))
        is_old = self.old_nodes >= 0
        numbers[is_old] = known[self.old_nodes[is_old]]
        return np.asarray(numbers)

    @cached_property
    def old_nodes(self) -> np.ndarray:
        """Return the node of the deck at each node, -1 for none, shape (n,)."""
        counts = np.diff(self.weights.indptr)
        old = np.full(len(self.x), -1)
        single = np.flatnonzero(counts == 1)
        old[single] = self.weights.indices[self.weights.indptr[single]]
        return old

    def nodes_within(self, nodes: np.ndarray) -> np.ndarray:
        """Return the nodes that a set of nodes of the deck means, shape (.,).

        They are its own corners, all on the faces whose corners are in the set, and all
        inside, if the set has nodes inside of the bodies, or a whole body.
        """
        deck = self.deck
        chosen = np.zeros(len(deck.x))
        chosen[nodes] = 1.0
        meant = (self.old_nodes >= 0) & (chosen[self.old_nodes] > 0)
        faces = deck.within(nodes)
        meant[self.nodes_on(faces)] = True
        corners = np.flatnonzero(deck.corner_count)
        body = deck.body_of_node[corners]
        left = np.bincount(body, 1.0 - chosen[corners], minlength=body.max(initial=-1) + 1)
        inner = np.ones(len(deck.x), dtype=bool)
        inner[deck.corners(np.flatnonzero(deck.outer))] = False
        has_inner = (chosen[corners] * inner[corners] > 0).any()
        if has_inner or (left == 0).any():
            whole = np.isin(deck.body_of_node, np.flatnonzero(left == 0)) | has_inner
            meant |= self.weights @ (chosen * whole) > 1.0 - ZERO
        return np.flatnonzero(meant)

    def nodes_on(self, faces: np.ndarray) -> np.ndarray:
        """Return the nodes on faces of the deck, shape (.,)."""
        cell, side = self.sides_on(faces)
        return np.unique(self.cells[cell[:, None], self._nodes_of_sides[side]])

    def sides_on(self, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sides that lie on faces of the deck, as cells and numbers."""
        cell, side = np.nonzero(np.isin(self.faces, faces) & (self.faces >= 0))
        return cell, side

    def corners_of_sides(self, cell: np.ndarray, side: np.ndarray) -> np.ndarray:
        """Return the corners of sides, shape (m, d)."""
        return self.cells[cell[:, None], self._nodes_of_sides[side, : self.deck.d]]

    def nodes_of_sides(self, cell: np.ndarray, side: np.ndarray) -> np.ndarray:
        """Return the nodes of sides, corners first, shape (m, .)."""
        return self.cells[cell[:, None], self._nodes_of_sides[side]]

    @property
    def _nodes_of_sides(self) -> np.ndarray:
        """Return the columns of the nodes of the sides S1, S2, ..., corners first."""
        d = self.deck.d
        columns = []
        for face in FACES[SIMPLEX[d]]:
            row = [*face]
            if self.cells.shape[1] > d + 1:
                ends = [frozenset(pair) for pair in EDGES[d]]
                pairs = [frozenset((face[i], face[(i + 1) % d])) for i in range(d)]
                # The side of a triangle has one edge, both ways.
                row += [d + 1 + ends.index(pair) for pair in dict.fromkeys(pairs)]
            columns.append(row)
        return np.array(columns)


def refined_deck_mesh(
    deck: DeckMesh, at: np.ndarray, sizes: np.ndarray, *, degree: int, most: int
) -> FinerDeckMesh | None:
    """Refine the simplices of a deck to wanted sizes, on this rank alone.

    Args:
        deck: The mesh of the deck.
        at: Points with a wanted size [length], shape (m, d).
        sizes: The sizes there, edges of simplices [length], shape (m,).
        degree: 1, or 2 for cells of second order.
        most: Greatest number of cells.

    Returns:
        The mesh; None if it has more cells.
    """
    from scipy.spatial import cKDTree  # type: ignore[import-untyped]  # noqa: PLC0415 - for decks only

    simplices = deck.simplicial
    used, rows = np.unique(simplices.cells, return_inverse=True)
    corners = rows.reshape(simplices.cells.shape)
    d = deck.d
    mesh = distribute(
        MPI.COMM_SELF, corners.astype(np.int64), np.ascontiguousarray(simplices.x[used])
    )
    connect_facets(mesh)
    root = np.asarray(mesh.topology.original_cell_index)
    tree = cKDTree(at)
    while True:
        x = mesh.geometry.x[:, :d]
        of_cells = x[cell_nodes(mesh.geometry)]
        _, nearest = tree.query(of_cells.mean(axis=1))
        # A marked cell becomes 2^d cells: the mean number is the wanted one.
        volume = measures(of_cells) * FILL[d] / 2 ** (d / 2)
        marked = np.flatnonzero(volume > sizes[nearest] ** d).astype(np.int32)
        if len(of_cells) + (2**d - 1) * len(marked) > most:
            return None
        if not len(marked):
            break
        refinement = refine(mesh, marked, None)
        root = refinement.of_cells(root[refinement.parent_cell][:, None], slice(None))[:, 0]
        mesh = refinement.mesh
    return _with_weights(deck, mesh, root, degree)


def _with_weights(deck: DeckMesh, mesh: dmesh.Mesh, root: np.ndarray, degree: int) -> FinerDeckMesh:
    """Make the finer mesh, with the weights of its nodes.

    Args:
        deck: The mesh of the deck.
        mesh: The refined mesh.
        root: The simplex of the deck in which each cell lies, shape (c,).
        degree: 1 or 2.
    """
    d = deck.d
    simplices = deck.simplicial
    x = mesh.geometry.x[:, :d].copy()
    cells = cell_nodes(mesh.geometry).astype(np.int64)
    turned = determinants(x[cells]) < 0
    cells[turned] = cells[turned][:, [1, 0, *range(2, d + 1)]]
    # Barycentric coordinates of the corners of each cell in its old simplex.
    old = simplices.x[simplices.cells[root]]
    edges = (old[:, 1:] - old[:, :1]).transpose(0, 2, 1)
    offset = (x[cells] - old[:, :1]).transpose(0, 2, 1)
    local = np.linalg.solve(edges, offset).transpose(0, 2, 1)
    shares = barycentric(local.reshape(-1, d)).reshape(*local.shape[:2], d + 1)
    shares[abs(shares) < ZERO] = 0.0
    _, first = np.unique(cells, return_index=True)
    cell, corner = np.divmod(first, d + 1)
    rows = np.repeat(np.arange(len(x)), d + 1)
    columns = simplices.cells[root[cell]].ravel()
    values = shares[cell, corner].ravel()
    weights = sparse.csr_array((values, (rows, columns)), (len(x), len(simplices.x)))
    weights = sparse.csr_array(weights @ _of_points(deck))
    weights.eliminate_zeros()
    faces = _faces_of_sides(deck, root, shares)
    if degree == 2:
        ends = cells[:, EDGES[d]].reshape(-1, 2)
        (numbers,) = row_numbers(ends)
        _, first = np.unique(numbers, return_index=True)
        a, b = ends[first].T
        middle_weights = sparse.csr_array(0.5 * (weights[a] + weights[b]))
        weights = sparse.csr_array(sparse.vstack([weights, middle_weights]))
        cells = np.hstack([cells, len(x) + numbers.reshape(len(cells), -1)])
        x = np.vstack([x, 0.5 * (x[a] + x[b])])
    return FinerDeckMesh(deck, x, cells, simplices.parents[root], weights, faces)


def _of_points(deck: DeckMesh) -> sparse.csr_array:
    """Return the weights of nodes of the deck in the points of its simplices.

    Points beyond its own are middles of cells.
    """
    simplices = deck.simplicial
    count = len(deck.x)
    added = np.arange(count, len(simplices.x))
    first = np.full(len(simplices.x), -1)
    first[simplices.cells] = simplices.parents[:, None]
    rows = [np.arange(count)]
    columns = [np.arange(count)]
    values = [np.ones(count)]
    for block, numbers in zip(deck.body.cells, deck.body.numbers, strict=True):
        here = added[np.isin(first[added], numbers)]
        place = np.searchsorted(numbers, first[here])
        corners = block.nodes[place]
        rows.append(np.repeat(here, corners.shape[1]))
        columns.append(corners.ravel())
        values.append(np.full(corners.size, 1.0 / max(corners.shape[1], 1)))
    entries = (np.concatenate(rows), np.concatenate(columns))
    shape = (len(simplices.x), count)
    return sparse.csr_array((np.concatenate(values), entries), shape)


def _faces_of_sides(deck: DeckMesh, root: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Return the face of the deck of each side of the cells, shape (c, d+1).

    A side lies in the side of its old simplex on which its corners have no share.

    Args:
        deck: The mesh of the deck.
        root: The simplex of the deck of each cell, shape (c,).
        shares: Barycentric coordinates of their corners in it, shape (c, d+1, d+1).
    """
    d = deck.d
    every = np.arange(len(deck.faces.count))
    sides_of_faces = deck.simplices(every)
    owners = deck.owners_of_simplices(every)
    old_sides = deck.simplicial.cells[:, facet_vertices(d)]
    found = look_up(sides_of_faces, owners, old_sides.reshape(-1, d)).reshape(-1, d + 1)
    result = np.full((len(root), d + 1), -1)
    for side, face in enumerate(FACES[SIMPLEX[d]]):
        is_zero = (shares[:, list(face)] == 0.0).all(axis=1)
        cell, old = np.nonzero(is_zero)
        result[cell, side] = found[root[cell], old]
    return result
