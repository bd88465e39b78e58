"""Small problems of complementary energy on patches of cells: the preconditioner of the tightening.

The centre of a patch is a vertex in 2D and an edge in 3D; the patch is the ring of facets and cells around it. A moment
``int_F t phi_l`` is a force at node l of a facet. What is in balance on every cell of a ring is a sum of

- the same force at a node of the centre on all facets of the ring, passed on from cell to cell;
- the same couple about the centre on all facets: ``(g_j . g_l)/|g_j| N`` at node l of a facet with normal N, where j is
  the node that is not on the centre and g are the gradients of the barycentric coordinates in the facet;
- opposite forces at the two ends of an edge of one facet, as a bar of a truss carries them.

So equilibrium holds by construction, to round-off. In 2D these are the degrees of freedom of Airy's function in the
space of Hsieh, Clough and Tocher. Memory of the whole tightening, measured: 0.7 kB a cell in 2D and 6 kB in 3D, of
which the inverses of the patch matrices take 0.3 and 5 kB; at the peak of :func:`equilibrate` 1.6 and 8.2 kB, of
degree 2 2.7 and 25 kB.

Components come first and facets or patches last, because numpy is fast on long last axes. Symbols: d dimension,
w = (d-1)d + 1 forces and couple of a patch, b = d(d-1)/2 bars of a facet, F facets, H patches. A pair (F, j) is facet F
in the ring of the centre that is opposite to node j of F.

Source: Clough, Tocher (1965) for the space in 2D; the basis by forces, couples and bars is ours.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import combinations

import numpy as np

from erc_contact.admissible.tighten.complementary import ComplementaryEnergy, chunks, stress_map, times
from erc_contact.admissible.tighten.rings import couples, facet_edges, rings, senses, unit
from erc_contact.mesh.simplex import facet_vertices, nodes
from erc_contact.model.space import Space


class Patches:
    """Solves the minimisation on each patch of this rank, and adds up the results.

    The unknowns of a patch are d(d-1) forces at the nodes of its centre, the couple, and the bars of each facet.

    Args:
        space: The mesh.
        energy: The complementary energy.
        free: Components of facets whose traction is not given, shape (F, d).

    Attributes:
        normal: Unit normals of the facets, shape (d, F).
        couple: Couples of the pairs as weights of the normal at node l, shape (d, d, F): j, l, facet.
        edge: Edges of the facets [length], shape (d, b, F).
        sense: Sense in which the first cell of a facet passes through it in the ring of (F, j), shape (d, F).
        patch: Patch of each pair, or one more than the last for patches of other ranks, shape (d, F).
        place: Place of each pair in the list of all pairs of this rank, or one more than the last, shape (d, F).
        groups: For all rings of m facets: the pairs as numbers j * F + facet, shape (m, H), and the inverses of the
            matrices of the patches, shape (H, N, N).
    """

    def __init__(self, space: Space, energy: ComplementaryEnergy, free: np.ndarray) -> None:
        cells, d = energy.cells, energy.cells.d
        self.bars = facet_edges(d)
        self.others = facet_vertices(d - 1)  # nodes of the centre that is opposite to node j
        self.b, self.w = len(self.bars), (d - 1) * d + 1
        cell, i = np.divmod(np.maximum(cells.side[0], 0), d + 1)
        nodes = facet_vertices(d)[i]
        corners = np.concatenate([np.zeros((len(cell), 1, d)), cells.J[cell].transpose(0, 2, 1)], axis=1)
        corners = np.take_along_axis(corners, nodes[:, :, None], axis=1)
        self.edge = np.ascontiguousarray((corners[:, self.bars[:, 1]] - corners[:, self.bars[:, 0]]).transpose(2, 1, 0))
        area = np.ascontiguousarray(cells.area[cell[:, None], nodes].transpose(2, 1, 0))
        self.normal = unit(cells.area[cell, i].T)
        self.couple = couples(area / cells.volume[cell], self.normal)
        sense = senses(cells)
        self.sense = sense[i, :, cell].T.copy()

        pairs, size = rings(space, cells)
        start = np.cumsum(size) - size
        patch = np.repeat(np.arange(len(size)), size)
        slot = np.arange(len(pairs)) - start[patch]
        dofs = self.w + self.b * size
        offset = np.cumsum(dofs**2) - dofs**2
        where = np.full((3, d * len(free)), -1)
        where[:, pairs] = patch, slot, np.arange(len(pairs))
        matrices = np.zeros(int((dofs**2).sum()))
        self._assemble(energy, sense, where[:2], offset, dofs, matrices)

        bars, forces = self._allowed(free, pairs, start)
        where[0, where[0] < 0], where[2, where[2] < 0] = len(size), len(pairs)
        self.patch, self.place = where[[0, 2]].reshape(2, d, -1)
        self.groups = []
        for m in np.unique(size):
            alike = np.flatnonzero(size == m)
            H, N = len(alike), dofs[alike[0]]
            inverse = matrices[offset[alike[0]] :][: H * N**2].reshape(H, N, N)
            rows = slice(start[alike[0]], start[alike[0]] + m * H)
            keep = np.concatenate([forces[alike], bars[rows].reshape(H, -1)], axis=1)
            for some in chunks(H, d):
                _invert(inverse[some], keep[some])
            self.groups.append((np.ascontiguousarray(pairs[rows].reshape(H, m).T), inverse))

    def _assemble(
        self,
        energy: ComplementaryEnergy,
        sense: np.ndarray,
        where: np.ndarray,
        offset: np.ndarray,
        dofs: np.ndarray,
        matrices: np.ndarray,
    ) -> None:
        """Add the energy of every cell to the matrices of its patches, one of each two symmetric entries.

        Args:
            energy: The complementary energy.
            sense: Senses of the cells, shape (d+1, d, n).
            where: Patch of each pair, or -1, and place of the pair in its ring, shape (2, d F).
            offset: First entry of each patch in the matrices, shape (H,).
            dofs: Number of unknowns of each patch, shape (H,).
            matrices: The matrices of all patches one after the other, row by row.
        """
        w, b, facets = self.w, self.b, len(energy.cells.side[0])
        below = np.tril_indices(w + 2 * b)
        for some in chunks(len(energy.cells.nodes), energy.cells.d):
            for sides, j, local in self._cell_energies(energy, sense, some):
                pairs = j[:, None] * facets + energy.facets[sides, some]
                (patch, _), slot = where[:, pairs]
                row = np.empty((len(local), local.shape[-1]), dtype=np.int64)
                row[: w - 1] = np.arange(w - 1)[:, None]
                row[w - 1 : -1] = (w + b * slot[:, None] + np.arange(b)[:, None]).reshape(2 * b, -1)
                row[-1] = w - 1
                at, entries = (offset[patch] + row * dofs[patch])[below[0]] + row[below[1]], local[below]
                here = patch >= 0
                if not here.all():
                    at, entries = at[:, here], entries[:, here]
                np.add.at(matrices, at.ravel(), entries.ravel())

    def _cell_energies(
        self, energy: ComplementaryEnergy, sense: np.ndarray, some: slice
    ) -> Iterator[tuple[list[int], np.ndarray, np.ndarray]]:
        """The energies of some cells for each centre of a cell: forces, bars of its two facets, and the couple, last.

        In reference components, bars and unit forces are the same in all cells. Their energies are one matrix times the
        metric, and the inverse Jacobian transforms the forces. The direction of the couple differs from cell to cell.

        Yields:
            The two facets of a centre, the node of each that is not on the centre, and the energies, of which the lower
            triangle counts, shape (w + 2b, w + 2b, c).
        """
        cells, d, w, b = energy.cells, energy.cells.d, self.w, self.b
        metric = energy.metric[..., some].mean(axis=2, keepdims=True)
        upper, c = metric[*np.triu_indices(len(metric)), 0], metric.shape[-1]
        inverse = energy.inverse[..., some]
        back = inverse.transpose(1, 0, 2, 3)
        area = np.ascontiguousarray(cells.area[some].transpose(2, 1, 0))
        normals = [unit(area[:, f]) for f in range(d + 1)]
        weights = [couples(area[:, v] / cells.volume[some], normals[f]) for f, v in enumerate(facet_vertices(d))]
        normals = [times(inverse[:, :, 0], normal) for normal in normals]
        for sides, j, products, stresses, of_couple in _facet_pairs(d):
            column = np.empty((d, d, 2, c))
            for side, facet in enumerate(sides):
                np.multiply(weights[facet][j[side]], normals[facet][:, None], out=column[:, :, side])
            sign = np.empty((len(stresses), c))
            sign[: w - 1] = sense[sides[0], j[0], some]
            sign[w - 1 : w - 1 + b], sign[w - 1 + b :] = energy.sign[sides, some]
            stress = (of_couple @ column.reshape(-1, c)).reshape(len(metric), -1, c)
            dual = times(metric, stress)
            local = np.empty((len(stresses) + 1, len(stresses) + 1, c))
            np.multiply((products @ upper).reshape(len(stresses), -1, c), sign, out=local[:-1, :-1])
            np.matmul(stresses, dual.reshape(-1, c), out=local[-1, :-1])
            local[:-1, :-1] *= sign[:, None]
            local[-1, :-1] *= sign
            local[-1, -1] = (stress * dual).sum(axis=(0, 1))
            columns = local.transpose(1, 0, 2)
            for h in range(0, w - 1, d):
                columns[h : h + d] = times(back, columns[h : h + d])
            local[:-1, -1] = local[-1, :-1]
            for h in range(0, w - 1, d):
                local[h : h + d, :-1] = times(back, local[h : h + d, :-1])
            yield sides, j, local

    def _allowed(self, free: np.ndarray, pairs: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which bars of each pair, shape (pairs, b), and which forces and couple of each patch, (H, w), may act.

        They may act if they change no given component of a traction. In 3D all bars along the centre of one ring
        together do the same as forces at its two ends, so the first of these bars is left out.
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
        in_centre = (self.bars[None] != np.arange(d)[:, None, None]).all(axis=2)
        bars[start] &= ~(in_centre[j[start]] & may_act(self.edge[:, :, f[start]], force.T[:, None]).T)
        return bars, np.concatenate([np.tile(force, (1, d - 1)), couple[:, None]], axis=1)

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Sum of the corrections of all patches for the residual r [length], shape (d, d, F)."""
        w, b, F = self.w, self.b, r.shape[-1]
        by_pair, by_bar = self._works(r)
        patches = sum(pairs.shape[1] for pairs, _ in self.groups)
        of_patches = np.zeros((w, patches + 1))
        of_bars = np.zeros((b, sum(pairs.size for pairs, _ in self.groups) + 1))
        patch = place = 0
        for pairs, inverse in self.groups:
            m, H = pairs.shape
            for some in chunks(H, len(r)):
                mine = pairs[:, some]
                right = np.empty((w + b * m, mine.shape[1]))
                np.take(by_pair, mine, axis=1).sum(axis=1, out=right[:w])
                right[w:].reshape(m, b, -1)[:] = np.take(by_bar, mine % F, axis=1).transpose(1, 0, 2)
                y = np.matmul(inverse[some], right.T[:, :, None])[..., 0]
                of_patches[:, patch + some.start : patch + some.stop] = y[:, :w].T
                of_bars[:, place + m * some.start : place + m * some.stop] = y[:, w:].reshape(-1, b).T
            patch, place = patch + H, place + m * H
        return self._moments(of_patches, of_bars, r)

    def _works(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Work of r on unit forces and couple of each pair, shape (w, d F), and on the bars of each facet, (b, F)."""
        d, F = len(r), r.shape[-1]
        by_pair, by_bar = np.empty((self.w, d, F)), np.empty((self.b, F))
        for some in chunks(F, d):
            here, sense = r[..., some], self.sense[:, some]
            for j, others in enumerate(self.others):
                for h, node in enumerate(others):
                    np.multiply(here[:, node], sense[j], out=by_pair[h * d : (h + 1) * d, j, some])
            along = (self.normal[:, None, some] * here).sum(axis=0)
            by_pair[-1, :, some] = times(self.couple[..., some], along)
            opening = here[:, self.bars[:, 1]] - here[:, self.bars[:, 0]]
            (opening * self.edge[..., some]).sum(axis=0, out=by_bar[:, some])
        return by_pair.reshape(self.w, -1), by_bar

    def _moments(self, of_patches: np.ndarray, of_bars: np.ndarray, like: np.ndarray) -> np.ndarray:
        """Moments of the facets from the unknowns of all patches, (w, H + 1), and their bars, (b, pairs + 1)."""
        d, z = len(like), np.empty_like(like)
        for some in chunks(like.shape[-1], d):
            here, sense = z[..., some], self.sense[:, some]
            values = np.take(of_patches, self.patch[:, some], axis=1)
            weight = times(self.couple[..., some].transpose(1, 0, 2), values[-1])
            np.multiply(weight, self.normal[:, None, some], out=here)
            for j, others in enumerate(self.others):
                for h, node in enumerate(others):
                    here[:, node] += sense[j] * values[h * d : (h + 1) * d, j]
            bar = np.take(of_bars, self.place[:, some], axis=1).sum(axis=1) * self.edge[..., some]
            for n, (start, end) in enumerate(self.bars):
                here[:, start] -= bar[:, n]
                here[:, end] += bar[:, n]
        return z


@cache
def _facet_pairs(d: int) -> list[tuple[list[int], np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """What is the same in all cells, for each centre between two facets f and g of a cell, for degree 1.

    Returns:
        For each centre: the facets f and g; the node of each that is not on the centre; the products of the stresses of
        unit forces at the centre and of bars for each component of the metric; these stresses; the stresses of all
        moments on f and g.
    """
    vertices, corners, bars = facet_vertices(d), nodes(d, 1), facet_edges(d)
    s = d * (d + 1) // 2
    a, b = np.triu_indices(s)
    of_facets = stress_map(d, 1)
    result = []
    for f, g in combinations(range(d + 1), 2):
        j = np.array([np.flatnonzero(vertices[f] == g)[0], np.flatnonzero(vertices[g] == f)[0]])
        at_centre = facet_vertices(d - 1)[j]
        forces = of_facets[..., at_centre[0], f] - of_facets[..., at_centre[1], g]
        columns = [forces.transpose(0, 1, 3, 2).reshape(s, -1, (d - 1) * d)]
        for facet in (f, g):
            along = np.diff(corners[vertices[facet]][bars], axis=1)[:, 0]
            ends = of_facets[..., bars[:, 1], facet] - of_facets[..., bars[:, 0], facet]
            columns.append(np.einsum("sqct,tc->sqt", ends, along))
        units = np.concatenate(columns, axis=2)
        products = np.einsum("aqx,bqy->abxy", units, units)
        products = (products + products.transpose(1, 0, 2, 3))[a, b] / np.where(a == b, 2, 1)[:, None, None]
        of_couple = np.ascontiguousarray(of_facets[..., [f, g]]).reshape(-1, 2 * d * d)
        stresses = units.reshape(-1, units.shape[2]).T.copy()
        result.append(([f, g], j, products.reshape(len(a), -1).T.copy(), stresses, of_couple))
    return result


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
