"""Tighten the admissible stress: less complementary energy, with every iterate in equilibrium.

The bulk part of the error is ``|sigma^ - C eps(u^)|``, and sigma^ is linear in the moments of the facet tractions.
Corrections x of these moments that leave every cell in equilibrium, and are zero where the traction is given, lower
it: conjugate gradients, preconditioned by the same minimisation on small patches, all results added.

A hinge is a vertex in 2D, an edge in 3D; its patch is the ring of facets and cells around it. Moments
``int_F t phi_l`` are forces at the nodes l of a facet, and what is in balance on every cell of a ring is a sum of

- the same force at a node of the hinge on all facets of the ring, passed on from cell to cell;
- the same couple about the hinge: ``(g_j . g_l)/|g_j| N`` at node l of a facet with normal N, whose node j is not on
  the hinge, with g the gradients of the barycentric coordinates in the facet;
- opposite forces at the ends of an edge of one facet, as of a bar in a truss.

So equilibrium holds by construction. In 2D these are the degrees of freedom of Airy's function in the space of Hsieh,
Clough and Tocher. Memory: the inverses of the patch matrices, 0.4 kB a cell in 2D and 5 kB in 3D, and as much again
for all the rest in 2D, half as much in 3D.

Symbols: d dimension, s = d(d+1)/2, q = (d+1)^2 points in the sub-simplices of a cell, w = (d-1)d + 1 forces and
couple of a hinge, k = d(d-1)/2 bars of a facet. A pair (F, j) is facet F in the ring of its hinge opposite to node j. Here components
come first and cells, facets or hinges last (n, F, H): numpy is fast on long last axes.

Source: Ladeveze, Leguillon (1983) for the energy of facet tractions; the patches and their basis are ours.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from dolfinx import la
from mpi4py import MPI

from erc_contact.admissible.geometry import Simplices, nodal_forces
from erc_contact.admissible.macro import macro_points, piola, reference_map, tensors
from erc_contact.model import Model, facet_vertices

ITERATIONS = 10
"""Limit of iterations by default."""
GAIN = 0.02
"""The iteration ends after a step that lowers the bulk part of the error by less than this fraction of it. A step costs
about 2% of the run time of a mesh; spent on a finer mesh, that lowers the error by 1%, and the next step gains less."""
CHUNK = (0, 0, 4096, 1024)
"""Number of cells, facets or hinges that are worked on at once, for each d: what stays in the cache."""


def tightened(
    model: Model,
    cells: Simplices,
    moment: np.ndarray,
    force: np.ndarray | None,
    free: np.ndarray,
    elastic: np.ndarray,
    compliance: np.ndarray,
    iterations: int,
) -> tuple[np.ndarray, int]:
    """Tighten the moments of facet tractions that are in equilibrium; collective.

    Args:
        model: The scene on a mesh.
        cells: Geometry, n cells.
        moment: Moments on the first side of each facet [force], shape (F, d, d).
        force: Total body force of each cell [force], shape (n, d), or None.
        free: Components of facets whose traction is not given, shape (F, d).
        elastic: ``C eps(u^)`` of the owned cells [force/area], shape (owned, q or 1, s).
        compliance: C^-1 [area/force], shape (n or 1, q or 1, s, s).
        iterations: At most so many.

    Returns:
        The moments, and the number of iterations.
    """
    comm, d = model.comm, cells.d
    facets = model.mesh.topology.index_map(d - 1)
    shared = la.vector(facets, d * d)
    nodes = _facet_nodes(cells)
    order = np.argsort(_global(model)[nodes], axis=1).T  # the ranks do not agree on the order of the nodes
    back = np.argsort(order, axis=0)

    def total(values: np.ndarray) -> np.ndarray:
        """Sum what the ranks have for each facet."""
        if comm.size > 1:
            sent = np.take_along_axis(values, order[None], axis=1)
            shared.array[:] = sent.reshape(d * d, -1).T.ravel()
            shared.scatter_reverse(la.InsertMode.add)
            shared.scatter_forward()
            sent = shared.array.reshape(-1, d * d).T.reshape(values.shape)
            values[:] = np.take_along_axis(sent, back[None], axis=1)
        return values

    def dot(a: np.ndarray, b: np.ndarray) -> float:
        owned = facets.size_local
        rows = zip(a.reshape(d * d, -1), b.reshape(d * d, -1), strict=True)
        return comm.allreduce(float(sum(np.vdot(x[:owned], y[:owned]) for x, y in rows)), MPI.SUM)

    energy = _Energy(cells, model.domain.owned_cells, compliance)
    square, r = energy.start(moment, force, elastic)
    square = comm.allreduce(square, MPI.SUM)
    patches = _Patches(model, energy, free)
    r = -total(r)
    x, p, rz, done = np.zeros_like(r), np.zeros_like(r), 1.0, 0
    while done < iterations:
        z = total(patches(r))
        new = dot(r, z)
        if not new > np.finfo(float).eps ** 2 * square:  # at the minimum, or nothing is free
            break
        p *= new / rz if done else 0.0
        p += z
        rz = new
        image = total(energy(p))
        step = rz / dot(p, image)
        x += step * p
        r -= step * image
        before, square, done = square, square - step * rz, done + 1
        if square > (1 - GAIN) ** 2 * before:
            break
    return moment + x.transpose(2, 1, 0), done


def _facet_nodes(cells: Simplices) -> np.ndarray:
    """Nodes of each facet, ascending, shape (F, d)."""
    cell, i = np.divmod(np.maximum(cells.side[0], 0), cells.d + 1)
    return cells.nodes[cell[:, None], facet_vertices(cells.d)[i]]


def _global(model: Model) -> np.ndarray:
    """Global numbers of the nodes of this rank."""
    return model.V.dofmap.index_map.local_to_global(np.arange(len(model.fixed), dtype=np.int32))


def _chunks(count: int, d: int) -> Iterator[slice]:
    return (slice(i, min(i + CHUNK[d], count)) for i in range(0, count, CHUNK[d]))


def _times(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Product of small matrices (a, b, ..., n) and vectors (b, ..., n) for all n at once."""
    result = np.empty((len(matrix), *vectors.shape[1:]))
    for row, out in zip(matrix, result, strict=True):
        np.multiply(row[0], vectors[0], out=out)
        for entry, vector in zip(row[1:], vectors[1:], strict=True):
            out += entry * vector
    return result


class _Energy:
    """The complementary energy as a quadratic form of facet moments; no matrix of a cell is stored.

    On the reference simplex the stress at the points is one matrix times the moments; the rest is in a metric of the
    components, ``|T|/q  P C^-1 P^T`` with P the Piola transform.

    Attributes:
        map: Reference stresses of reference moments, shape (s q, d d (d+1)): component, node, facet.
        metric: Shape (s, s, q or 1, n) [length^(4-d)/(force/area)].
        inverse: Inverse Jacobians [1/length], shape (d, d, 1, n).
        facets: Facet of each cell opposite to its vertices, shape (d+1, n).
        sign: +1 where the cell is the first of its facet, else -1, shape (d+1, n).
        first, second: The two places of each facet as index i * n + cell, n * (d+1) for none, shape (F,).
    """

    def __init__(self, cells: Simplices, owned: int, compliance: np.ndarray) -> None:
        d, n = cells.d, len(cells.nodes)
        self.cells, self.owned = cells, owned
        near, _ = macro_points(d)
        at_points = np.einsum("qm,kmsfc->skqfc", near, reference_map(d))
        s, q = len(at_points), (d + 1) ** 2
        at_points = at_points.reshape(s * q, -1, d)
        self.body = np.ascontiguousarray(at_points[:, -1])
        moments = nodal_forces(at_points[:, :-1].reshape(-1, d + 1, d, d))  # a symmetric matrix on the nodes
        self.map = np.ascontiguousarray(moments.transpose(0, 3, 2, 1)).reshape(s * q, -1)
        self.facets = np.ascontiguousarray(cells.facets.T)
        places = np.arange(cells.facets.size).reshape(n, d + 1).T
        self.sign = np.where(cells.side[0][self.facets] == places, 1.0, -1.0)
        at = cells.side % (d + 1) * n + cells.side // (d + 1)
        self.first = np.where(cells.side[0] >= 0, at[0], n * (d + 1))
        self.second = np.where(cells.has_second, at[1], n * (d + 1))
        self.inverse = np.ascontiguousarray(cells.inverse.transpose(1, 2, 0))[:, :, None]
        self.metric = np.empty((s, s, compliance.shape[1], n))
        for some in _chunks(n, d):
            P = piola(cells, some)[:, None] * np.sqrt(cells.volume[some] / q)[:, None, None, None]
            local = compliance[some] if len(compliance) > 1 else compliance
            self.metric[..., some] = np.matmul(np.matmul(P, local), P.transpose(0, 1, 3, 2)).transpose(2, 3, 1, 0)

    def start(self, moment: np.ndarray, force: np.ndarray | None, elastic: np.ndarray) -> tuple[float, np.ndarray]:
        """``|sigma^ - C eps(u^)|^2`` and half its derivative, of the owned cells.

        The map of facet moments keeps constant stresses, so the mean of C eps(u^) is taken off the tractions.
        """
        cells, d = self.cells, self.cells.d
        mean = tensors(elastic.mean(axis=1), d)
        moment = np.ascontiguousarray(moment.transpose(2, 1, 0)).reshape(d * d, -1)
        square, seen = 0.0, np.zeros((d * d, self.facets.size + 1))
        for some in _chunks(self.owned, d):
            local = self._seen(moment, some)
            local -= np.matmul(cells.area[some], mean[some]).transpose(2, 1, 0)[:, None] / d
            stress = self._stress(local, some)
            if force is not None:
                inside = _times(self.inverse[:, :, 0, some], force[some].T)
                stress += (self.body @ inside).reshape(stress.shape)
            if elastic.shape[1] > 1:
                rest = elastic[some].mean(axis=1, keepdims=True) - elastic[some]
                rest = np.linalg.solve(piola(cells, some).transpose(0, 2, 1), rest.transpose(0, 2, 1))
                stress += rest.transpose(1, 2, 0)
            dual = _times(self.metric[..., some], stress)
            square += float(np.vdot(stress, dual))
            self._add(dual, some, seen)
        return square, self._on_facets(seen)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """The change of the derivative for a change x of the moments, of the owned cells, shape (d, d, F)."""
        d = self.cells.d
        x = x.reshape(d * d, -1)
        seen = np.zeros((d * d, self.facets.size + 1))
        for some in _chunks(self.owned, d):
            stress = self._stress(self._seen(x, some), some)
            self._add(_times(self.metric[..., some], stress), some, seen)
        return self._on_facets(seen)

    def _seen(self, moment: np.ndarray, some: slice) -> np.ndarray:
        """Moments as some cells see them, (d d, F) -> (d, d, d+1, c)."""
        d = self.cells.d
        local = np.take(moment, self.facets[:, some], axis=1)
        local *= self.sign[:, some]
        return local.reshape(d, d, d + 1, -1)

    def _stress(self, local: np.ndarray, some: slice) -> np.ndarray:
        """Reference stresses of moments as the cells see them, (d, d, d+1, c) -> (s, q, c)."""
        local = _times(self.inverse[..., some], local.reshape(len(local), -1, local.shape[-1]))
        stress = self.map @ local.reshape(-1, local.shape[-1])
        return stress.reshape(len(self.metric), -1, local.shape[-1])

    def _add(self, dual: np.ndarray, some: slice, seen: np.ndarray) -> None:
        """The transpose of ``_stress`` and ``_seen``, written to the places of the cells."""
        d = self.cells.d
        local = (self.map.T @ dual.reshape(-1, dual.shape[-1])).reshape(d, d * (d + 1), -1)
        local = _times(self.inverse.transpose(1, 0, 2, 3)[..., some], local).reshape(d * d, d + 1, -1)
        np.multiply(local, self.sign[:, some], out=seen[:, :-1].reshape(d * d, d + 1, -1)[..., some])

    def _on_facets(self, seen: np.ndarray) -> np.ndarray:
        """Sum over the two sides, shape (d, d, F)."""
        d = self.cells.d
        values = np.take(seen, self.first, axis=1)
        values += np.take(seen, self.second, axis=1)
        return values.reshape(d, d, -1)


class _Patches:
    """Solves the minimisation on the patch of every hinge of this rank, and adds the results up.

    The unknowns of a patch are d(d-1) forces at the nodes of the hinge and the couple, then the bars of each facet.

    Attributes:
        normal, couple, edge, turn: Of each facet: unit normal (d, F); couples about hinge j as weights of the normal
            at node l (d, d, F); edges (d, k, F); sense of the ring through (F, j) on the first side (d, F).
        hinge, place: Hinge of (F, j) and place in its ring, counted over all hinges; one more than the last for hinges
            of other ranks, shape (d, F).
        groups: For all rings of m facets: the pairs as index j * F + facet, shape (m, H), and the inverses (H, N, N).
    """

    def __init__(self, model: Model, energy: _Energy, free: np.ndarray) -> None:
        cells, d = energy.cells, energy.cells.d
        self.bars = np.array(list(combinations(range(d), 2)))
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

        pairs, size = self._rings(model, cells)
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
            for some in _chunks(H, d):
                _invert(inverse[some], keep[some])
            self.groups.append((np.ascontiguousarray(pairs[rows].reshape(H, m).T), inverse))

    def _rings(self, model: Model, cells: Simplices) -> tuple[np.ndarray, np.ndarray]:
        """The pairs j * F + facet of all hinges of this rank, hinge after hinge, and the sizes of the rings, ascending.

        A hinge is of the rank that owns its node of least global number: that rank has all cells around it.
        """
        d, nodes = cells.d, _facet_nodes(cells)
        hinges = np.concatenate([nodes[:, others] for others in self.others])
        least = np.take_along_axis(hinges, _global(model)[hinges].argmin(axis=1)[:, None], axis=1)[:, 0]
        pairs = np.flatnonzero(np.tile(cells.side[0] >= 0, d) & (least < model.V.dofmap.index_map.size_local))
        key = hinges[pairs] @ (len(model.fixed) ** np.arange(d - 1, dtype=np.int64))
        _, hinge, size = np.unique(key, return_inverse=True, return_counts=True)
        by_size = np.argsort(size, kind="stable")
        number = np.empty_like(by_size)
        number[by_size] = np.arange(len(size))
        return pairs[np.argsort(number[hinge], kind="stable")], size[by_size]

    def _assemble(
        self,
        energy: _Energy,
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
        s, facets = len(energy.metric), len(cells.side[0])
        a, b = np.triu_indices(s)
        below = np.tril_indices(w + 2 * k)
        of_facets = energy.map.reshape(s, -1, d, d, d + 1)
        vertices, reference = facet_vertices(d), np.vstack([np.zeros(d), np.eye(d)])
        known = []
        for f, g in combinations(range(d + 1), 2):
            j = np.array([np.flatnonzero(vertices[f] == g)[0], np.flatnonzero(vertices[g] == f)[0]])
            unit = of_facets[..., self.others[j[0]], f] - of_facets[..., self.others[j[1]], g]
            columns = [unit.transpose(0, 1, 3, 2).reshape(s, -1, w - 1)]
            for facet in (f, g):
                along = (reference[vertices[facet]][self.bars[:, 1]] - reference[vertices[facet]][self.bars[:, 0]]).T
                ends = of_facets[..., self.bars[:, 1], facet] - of_facets[..., self.bars[:, 0], facet]
                columns.append(np.einsum("sqct,ct->sqt", ends, along))
            unit = np.concatenate(columns, axis=2)
            products = np.einsum("aqx,bqy->abxy", unit, unit)
            products = (products + products.transpose(1, 0, 2, 3))[a, b] / np.where(a == b, 2, 1)[:, None, None]
            couple = np.ascontiguousarray(of_facets[..., [f, g]]).reshape(-1, 2 * d * d)
            known.append(((f, g), j, products.reshape(len(a), -1).T.copy(), unit.reshape(-1, unit.shape[2]).T.copy(), couple))

        for some in _chunks(len(cells.nodes), d):
            metric = energy.metric[..., some].mean(axis=2, keepdims=True)
            upper, c = metric[a, b, 0], metric.shape[-1]
            inverse = energy.inverse[..., some]
            back = inverse.transpose(1, 0, 2, 3)
            area = np.ascontiguousarray(cells.area[some].transpose(2, 1, 0))
            normals = [_unit(area[:, f]) for f in range(d + 1)]
            couples = [_couples(area[:, v] / cells.volume[some], normals[f]) for f, v in enumerate(vertices)]
            normals = [_times(inverse[:, :, 0], normal) for normal in normals]
            for (f, g), j, products, unit, of_couple in known:
                column = np.empty((d, d, 2, c))
                for side, facet in enumerate((f, g)):
                    np.multiply(couples[facet][j[side]], normals[facet][:, None], out=column[:, :, side])
                sign = np.empty((len(unit), c))
                sign[: w - 1] = senses[f, j[0], some]
                sign[w - 1 : w - 1 + k], sign[w - 1 + k :] = energy.sign[f, some], energy.sign[g, some]
                stress = (of_couple @ column.reshape(-1, c)).reshape(s, -1, c)
                dual = _times(metric, stress)
                local = np.empty((len(unit) + 1, len(unit) + 1, c))
                np.multiply((products @ upper).reshape(len(unit), -1, c), sign, out=local[:-1, :-1])
                np.multiply(unit @ dual.reshape(-1, c), 1.0, out=local[-1, :-1])
                local[:-1, :-1] *= sign[:, None]
                local[-1, :-1] *= sign
                local[-1, -1] = (stress * dual).sum(axis=(0, 1))
                columns = local.transpose(1, 0, 2)
                for h in range(0, w - 1, d):
                    columns[h : h + d] = _times(back, columns[h : h + d])
                local[:-1, -1] = local[-1, :-1]
                for h in range(0, w - 1, d):
                    local[h : h + d, :-1] = _times(back, local[h : h + d, :-1])

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
        for some in _chunks(F, d):
            here, turn = r[..., some], self.turn[:, some]
            for j, others in enumerate(self.others):
                for h, node in enumerate(others):
                    np.multiply(here[:, node], turn[j], out=table[h * d : (h + 1) * d, j, some])
            along = (self.normal[:, None, some] * here).sum(axis=0)
            table[w - 1, :, some] = _times(self.couple[..., some], along)
            difference = here[:, self.bars[:, 1]] - here[:, self.bars[:, 0]]
            difference *= self.edge[..., some]
            difference.sum(axis=0, out=stretch[:, some])
        table = table.reshape(w, -1)
        hinges = sum(pairs.shape[1] for pairs, _ in self.groups)
        of_hinges = np.zeros((w, hinges + 1))
        of_bars = np.zeros((k, sum(pairs.size for pairs, _ in self.groups) + 1))
        hinge = place = 0
        for pairs, inverse in self.groups:
            m, H = pairs.shape
            for some in _chunks(H, d):
                mine = pairs[:, some]
                right = np.empty((w + k * m, mine.shape[1]))
                np.take(table, mine, axis=1).sum(axis=1, out=right[:w])
                right[w:].reshape(m, k, -1)[:] = np.take(stretch, mine % F, axis=1).transpose(1, 0, 2)
                y = np.matmul(inverse[some], right.T[:, :, None])[..., 0]
                of_hinges[:, hinge + some.start : hinge + some.stop] = y[:, :w].T
                of_bars[:, place + m * some.start : place + m * some.stop] = y[:, w:].reshape(-1, k).T
            hinge, place = hinge + H, place + m * H
        z = np.empty_like(r)
        for some in _chunks(F, d):
            here, turn = z[..., some], self.turn[:, some]
            values = np.take(of_hinges, self.hinge[:, some], axis=1)
            weight = _times(self.couple[..., some].transpose(1, 0, 2), values[w - 1])
            np.multiply(weight, self.normal[:, None, some], out=here)
            for j, others in enumerate(self.others):
                for h, node in enumerate(others):
                    here[:, node] += turn[j] * values[h * d : (h + 1) * d, j]
            bar = np.take(of_bars, self.place[:, some], axis=1).sum(axis=1) * self.edge[..., some]
            for t, (a, b) in enumerate(self.bars):
                here[:, a] -= bar[:, t]
                here[:, b] += bar[:, t]
        return z


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
    """Invert ``A + A^T - diag A``, positive definite on the rows and columns to keep, in place; the others become zero."""
    diagonal = np.einsum("nii->ni", matrices)
    diagonal /= 2
    matrices += matrices.transpose(0, 2, 1).copy()
    scale = np.where(keep, 1 / np.sqrt(np.where(keep, diagonal, 1.0)), 0.0)
    matrices *= scale[:, :, None] * scale[:, None, :]
    diagonal += ~keep
    matrices[:] = np.linalg.inv(matrices)
    matrices *= scale[:, :, None] * scale[:, None, :]
