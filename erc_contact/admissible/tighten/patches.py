"""Small problems of complementary energy on the patches around hinges: the preconditioner of the tightening.

A hinge is a vertex in 2D, an edge in 3D; its patch is the ring of facets and cells around it. Moments
``int_F t phi_l`` are forces at the nodes l of a facet, and what is in balance on every cell of a ring is a sum of

- the same force at a node of the hinge on all facets of the ring, passed on from cell to cell;
- the same couple about the hinge: ``(g_j . g_l)/|g_j| N`` at node l of a facet with normal N, whose node j is not on
  the hinge, with g the gradients of the barycentric coordinates in the facet;
- opposite forces at the ends of an edge of one facet, as of a bar in a truss.

So equilibrium holds by construction, to round-off. In 2D these are the degrees of freedom of Airy's function in the
space of Hsieh, Clough and Tocher. Memory of the whole tightening, measured: 0.7 kB a cell in 2D and 6 kB in 3D, of
which the inverses of the patch matrices take 0.3 and 5 kB; at the peak of :func:`equilibrate` 1.6 and 8.2 kB, of
degree 2 2.7 and 25 kB.

Components come first and facets or hinges last: numpy is fast on long last axes. Symbols: d dimension,
w = (d-1)d + 1 forces and couple of a hinge, k = d(d-1)/2 bars of a facet, F facets, H hinges. A pair (F, j) is facet F
in the ring of its hinge opposite to node j.

Source: Clough, Tocher (1965) for the space in 2D; the basis by forces, couples and bars is ours.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np

from erc_contact.admissible.cells import Simplices
from erc_contact.admissible.tighten.energy import Energy, chunks, stress_map, times
from erc_contact.mesh.simplex import facet_vertices, nodes
from erc_contact.model.space import Space


def facet_nodes(cells: Simplices) -> np.ndarray:
    """Vertices of each facet, ascending, shape (F, d)."""
    cell, i = np.divmod(np.maximum(cells.side[0], 0), cells.d + 1)
    return cells.vertices[cell[:, None], facet_vertices(cells.d)[i]]


class Patches:
    """Solves the minimisation on the patch of every hinge of this rank, and adds the results up.

    The unknowns of a patch are d(d-1) forces at the nodes of the hinge and the couple, then the bars of each facet.

    Attributes:
        normal, couple, edge, turn: Of each facet: unit normal (d, F); couples about hinge j as weights of the normal
            at node l (d, d, F); edges (d, k, F); sense of the ring through (F, j) on the first side (d, F).
        hinge, place: Hinge of (F, j) and place in its ring, counted over all hinges; one more than the last for hinges
            of other ranks, shape (d, F).
        groups: For all rings of m facets: the pairs as index j * F + facet, shape (m, H), and the inverses (H, N, N).
    """

    def __init__(self, space: Space, energy: Energy, free: np.ndarray) -> None:
        cells, d = energy.cells, energy.cells.d
        self.bars = _bars(d)
        self.others = facet_vertices(d - 1)  # nodes of the hinge opposite to node j
        self.k, self.w = len(self.bars), (d - 1) * d + 1
        cell, i = np.divmod(np.maximum(cells.side[0], 0), d + 1)
        nodes = facet_vertices(d)[i]
        corners = np.concatenate([np.zeros((len(cell), 1, d)), cells.J[cell].transpose(0, 2, 1)], axis=1)
        corners = np.take_along_axis(corners, nodes[:, :, None], axis=1)
        self.edge = np.ascontiguousarray((corners[:, self.bars[:, 1]] - corners[:, self.bars[:, 0]]).transpose(2, 1, 0))
        area = np.ascontiguousarray(cells.area[cell[:, None], nodes].transpose(2, 1, 0))
        self.normal = _unit(cells.area[cell, i].T)
        self.couple = _couples(area / cells.volume[cell], self.normal)
        senses = _senses(cells)
        self.turn = senses[i, :, cell].T.copy()

        pairs, size = self._rings(space, cells)
        start = np.cumsum(size) - size
        hinge = np.repeat(np.arange(len(size)), size)
        slot = np.arange(len(pairs)) - start[hinge]
        dofs = self.w + self.k * size
        offset = np.cumsum(dofs**2) - dofs**2
        where = np.full((3, d * len(free)), -1)
        where[:, pairs] = hinge, slot, np.arange(len(pairs))
        matrices = np.zeros(int((dofs**2).sum()))
        self._assemble(energy, senses, where[:2], offset, dofs, matrices)

        bars, forces = self._allowed(free, pairs, start)
        where[0, where[0] < 0], where[2, where[2] < 0] = len(size), len(pairs)
        self.hinge, self.place = where[[0, 2]].reshape(2, d, -1)
        self.groups = []
        for m in np.unique(size):
            rings = np.flatnonzero(size == m)
            H, N = len(rings), dofs[rings[0]]
            inverse = matrices[offset[rings[0]] :][: H * N**2].reshape(H, N, N)
            rows = slice(start[rings[0]], start[rings[0]] + m * H)
            keep = np.concatenate([forces[rings], bars[rows].reshape(H, -1)], axis=1)
            for some in chunks(H, d):
                _invert(inverse[some], keep[some])
            self.groups.append((np.ascontiguousarray(pairs[rows].reshape(H, m).T), inverse))

    def _rings(self, space: Space, cells: Simplices) -> tuple[np.ndarray, np.ndarray]:
        """The pairs j * F + facet of all hinges of this rank, hinge after hinge, and the sizes of the rings, ascending.

        A hinge is of the rank that owns its node of least global number: that rank has all cells around it.
        """
        d, nodes = cells.d, facet_nodes(cells)
        hinges = np.concatenate([nodes[:, others] for others in self.others])
        least = np.take_along_axis(hinges, space.global_numbers(hinges).argmin(axis=1)[:, None], axis=1)[:, 0]
        pairs = np.flatnonzero(np.tile(cells.side[0] >= 0, d) & (least < space.V.dofmap.index_map.size_local))
        key = hinges[pairs] @ (space.node_count ** np.arange(d - 1, dtype=np.int64))
        _, hinge, size = np.unique(key, return_inverse=True, return_counts=True)
        by_size = np.argsort(size, kind="stable")
        number = np.empty_like(by_size)
        number[by_size] = np.arange(len(size))
        return pairs[np.argsort(number[hinge], kind="stable")], size[by_size]

    def _assemble(
        self,
        energy: Energy,
        senses: np.ndarray,
        where: np.ndarray,
        offset: np.ndarray,
        dofs: np.ndarray,
        matrices: np.ndarray,
    ) -> None:
        """Add the energy of every cell to the matrices of its hinges, one of each two symmetric entries.

        In reference components, bars and unit forces are the same in all cells; their products are one matrix times the
        metric. Forces then turn with the inverse Jacobian; the couple, whose direction is the cell's own, is added.
        """
        cells, d, w, k = energy.cells, energy.cells.d, self.w, self.k
        facets, vertices = len(cells.side[0]), facet_vertices(d)
        a, b = np.triu_indices(len(energy.metric))
        below = np.tril_indices(w + 2 * k)
        hinges = _hinges(d)
        for some in chunks(len(cells.nodes), d):
            metric = energy.metric[..., some].mean(axis=2, keepdims=True)
            upper, c = metric[a, b, 0], metric.shape[-1]
            inverse = energy.inverse[..., some]
            back = inverse.transpose(1, 0, 2, 3)
            area = np.ascontiguousarray(cells.area[some].transpose(2, 1, 0))
            units = [_unit(area[:, f]) for f in range(d + 1)]
            couples = [_couples(area[:, v] / cells.volume[some], units[f]) for f, v in enumerate(vertices)]
            normals = [times(inverse[:, :, 0], unit) for unit in units]
            for (f, g), j, products, unit, of_couple in hinges:
                column = np.empty((d, d, 2, c))
                for side, facet in enumerate((f, g)):
                    np.multiply(couples[facet][j[side]], normals[facet][:, None], out=column[:, :, side])
                sign = np.empty((len(unit), c))
                sign[: w - 1] = senses[f, j[0], some]
                sign[w - 1 : w - 1 + k], sign[w - 1 + k :] = energy.sign[f, some], energy.sign[g, some]
                stress = (of_couple @ column.reshape(-1, c)).reshape(len(metric), -1, c)
                dual = times(metric, stress)
                local = np.empty((len(unit) + 1, len(unit) + 1, c))
                np.multiply((products @ upper).reshape(len(unit), -1, c), sign, out=local[:-1, :-1])
                np.matmul(unit, dual.reshape(-1, c), out=local[-1, :-1])
                local[:-1, :-1] *= sign[:, None]
                local[-1, :-1] *= sign
                local[-1, -1] = (stress * dual).sum(axis=(0, 1))
                columns = local.transpose(1, 0, 2)
                for h in range(0, w - 1, d):
                    columns[h : h + d] = times(back, columns[h : h + d])
                local[:-1, -1] = local[-1, :-1]
                for h in range(0, w - 1, d):
                    local[h : h + d, :-1] = times(back, local[h : h + d, :-1])

                pairs = j[:, None] * facets + energy.facets[[f, g], some]
                (hinge, _), slot = where[:, pairs]
                row = np.empty((len(local), c), dtype=np.int64)
                row[: w - 1] = np.arange(w - 1)[:, None]
                row[w - 1 : -1] = (w + k * slot[:, None] + np.arange(k)[:, None]).reshape(-1, c)
                row[-1] = w - 1
                at, local = (offset[hinge] + row * dofs[hinge])[below[0]] + row[below[1]], local[below]
                here = hinge >= 0
                if not here.all():
                    at, local = at[:, here], local[:, here]
                np.add.at(matrices, at.ravel(), local.ravel())

    def _allowed(self, free: np.ndarray, pairs: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which bars of each pair, shape (pairs, k), and which forces and couple of each hinge, (H, w), may act.

        Those that act on no given component of a traction. All bars along an edge of a ring in 3D are together what
        forces at its two ends are: the first one is left out.
        """
        d = free.shape[1]

        def may_act(direction: np.ndarray, free: np.ndarray) -> np.ndarray:
            acts = abs(direction) > 1e-12 * np.linalg.norm(direction, axis=0)
            return ~np.any(acts & ~free, axis=0)

        def in_ring(values: np.ndarray) -> np.ndarray:
            return np.logical_and.reduceat(values, start) if len(start) else values[:0]

        j, f = np.divmod(pairs, len(free))
        force, couple = in_ring(free[f]), in_ring(may_act(self.normal, free.T)[f])
        bars = may_act(self.edge, free.T[:, None]).T[f]
        in_hinge = (self.bars[None] != np.arange(d)[:, None, None]).all(axis=2)
        bars[start] &= ~(in_hinge[j[start]] & may_act(self.edge[:, :, f[start]], force.T[:, None]).T)
        return bars, np.concatenate([np.tile(force, (1, d - 1)), couple[:, None]], axis=1)

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Sum of the corrections of all patches for the residual r [length], shape (d, d, F)."""
        d, w, k, F = len(r), self.w, self.k, r.shape[-1]
        table, stretch = np.empty((w, d, F)), np.empty((k, F))
        for some in chunks(F, d):
            here, turn = r[..., some], self.turn[:, some]
            for j, others in enumerate(self.others):
                for h, node in enumerate(others):
                    np.multiply(here[:, node], turn[j], out=table[h * d : (h + 1) * d, j, some])
            along = (self.normal[:, None, some] * here).sum(axis=0)
            table[w - 1, :, some] = times(self.couple[..., some], along)
            opening = here[:, self.bars[:, 1]] - here[:, self.bars[:, 0]]
            (opening * self.edge[..., some]).sum(axis=0, out=stretch[:, some])
        by_pair = table.reshape(w, -1)
        hinges = sum(pairs.shape[1] for pairs, _ in self.groups)
        of_hinges = np.zeros((w, hinges + 1))
        of_bars = np.zeros((k, sum(pairs.size for pairs, _ in self.groups) + 1))
        hinge = place = 0
        for pairs, inverse in self.groups:
            m, H = pairs.shape
            for some in chunks(H, d):
                mine = pairs[:, some]
                right = np.empty((w + k * m, mine.shape[1]))
                np.take(by_pair, mine, axis=1).sum(axis=1, out=right[:w])
                right[w:].reshape(m, k, -1)[:] = np.take(stretch, mine % F, axis=1).transpose(1, 0, 2)
                y = np.matmul(inverse[some], right.T[:, :, None])[..., 0]
                of_hinges[:, hinge + some.start : hinge + some.stop] = y[:, :w].T
                of_bars[:, place + m * some.start : place + m * some.stop] = y[:, w:].reshape(-1, k).T
            hinge, place = hinge + H, place + m * H
        z = np.empty_like(r)
        for some in chunks(F, d):
            here, turn = z[..., some], self.turn[:, some]
            values = np.take(of_hinges, self.hinge[:, some], axis=1)
            weight = times(self.couple[..., some].transpose(1, 0, 2), values[w - 1])
            np.multiply(weight, self.normal[:, None, some], out=here)
            for j, others in enumerate(self.others):
                for h, node in enumerate(others):
                    here[:, node] += turn[j] * values[h * d : (h + 1) * d, j]
            bar = np.take(of_bars, self.place[:, some], axis=1).sum(axis=1) * self.edge[..., some]
            for t, (a, b) in enumerate(self.bars):
                here[:, a] -= bar[:, t]
                here[:, b] += bar[:, t]
        return z


@cache
def _hinges(
    d: int,
) -> list[tuple[tuple[int, int], np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """What is the same in all cells, for each hinge between the facets f and g: energies of degree 1.

    Returns:
        The facets (f, g); the node of each that is not on the hinge; the products of the stresses of unit forces at the
        hinge and of bars for each component of the metric; these stresses; those of all moments on f and g.
    """
    vertices, corners, bars = facet_vertices(d), nodes(d, 1), _bars(d)
    s = d * (d + 1) // 2
    a, b = np.triu_indices(s)
    of_facets = stress_map(d, 1)
    result = []
    for f, g in combinations(range(d + 1), 2):
        j = np.array([np.flatnonzero(vertices[f] == g)[0], np.flatnonzero(vertices[g] == f)[0]])
        on_hinge = facet_vertices(d - 1)[j]
        forces = of_facets[..., on_hinge[0], f] - of_facets[..., on_hinge[1], g]
        columns = [forces.transpose(0, 1, 3, 2).reshape(s, -1, (d - 1) * d)]
        for facet in (f, g):
            along = np.diff(corners[vertices[facet]][bars], axis=1)[:, 0]
            ends = of_facets[..., bars[:, 1], facet] - of_facets[..., bars[:, 0], facet]
            columns.append(np.einsum("sqct,tc->sqt", ends, along))
        unit = np.concatenate(columns, axis=2)
        products = np.einsum("aqx,bqy->abxy", unit, unit)
        products = (products + products.transpose(1, 0, 2, 3))[a, b] / np.where(a == b, 2, 1)[:, None, None]
        of_couple = np.ascontiguousarray(of_facets[..., [f, g]]).reshape(-1, 2 * d * d)
        stresses = unit.reshape(-1, unit.shape[2]).T.copy()
        result.append(((f, g), j, products.reshape(len(a), -1).T.copy(), stresses, of_couple))
    return result


def _bars(d: int) -> np.ndarray:
    """Nodes of the edges of a facet, shape (k, 2)."""
    return np.array(list(combinations(range(d), 2)))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.sqrt((vectors * vectors).sum(axis=0))


def _couples(slopes: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """``g_j . g_l / |g_j|`` with g the part in the facet of slopes (d, d, n): component, node; shape (d, d, n).

    Slopes are area vectors over the volume, the gradients of the nodes in a cell but for the same factor everywhere.
    """
    inside = slopes - normal[:, None] * (slopes * normal[:, None]).sum(axis=0)
    gram = (inside[:, :, None] * inside[:, None]).sum(axis=0)
    return gram / np.sqrt(np.einsum("jjn->jn", gram))[:, None]


def _senses(cells: Simplices) -> np.ndarray:
    """Sense, +1 or -1, in which a cell passes through its facet f in the ring of the hinge opposite to node j of it.

    It is the orientation of (hinge, node j, the cell's node off the facet): the two facets of a cell at a hinge are
    passed in opposite senses, and a facet in opposite senses by its two cells. Shape (d+1, d, n).
    """
    d = cells.d
    parity = np.zeros((d + 1, d, 1))
    for f, vertices in enumerate(facet_vertices(d)):
        for j in range(d):
            hinge = [v for v in vertices if v != vertices[j]]
            parity[f, j] = np.round(np.linalg.det(np.eye(d + 1)[[*hinge, vertices[j], f]]))
    return np.sign(np.linalg.det(cells.J)) * parity


def _invert(matrices: np.ndarray, keep: np.ndarray) -> None:
    """Invert ``A + A^T - diag A`` in place where rows and columns are kept; the others become zero."""
    diagonal = np.einsum("nii->ni", matrices)
    diagonal /= 2
    matrices += matrices.transpose(0, 2, 1).copy()
    scale = np.where(keep, 1 / np.sqrt(np.where(keep, diagonal, 1.0)), 0.0)
    matrices *= scale[:, :, None] * scale[:, None, :]
    diagonal += ~keep
    matrices[:] = np.linalg.inv(matrices)
    matrices *= scale[:, :, None] * scale[:, None, :]
