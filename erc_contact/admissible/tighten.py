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
couple of a hinge, k = d(d-1)/2 bars of a facet. A pair (F, j) is facet F in the ring of its hinge opposite to node j.

Source: Ladeveze, Leguillon (1983) for the energy of facet tractions; the patches and their basis are ours.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from dolfinx import la
from mpi4py import MPI

from erc_contact.admissible.geometry import Simplices, nodal_forces, signed
from erc_contact.admissible.macro import macro_points, piola, reference_map, tensors
from erc_contact.model import Model, facet_vertices

ITERATIONS = 10
"""Limit of iterations by default."""
GAIN = 0.02
"""The iteration ends after a step that lowers the bulk part of the error by less than this fraction of it. A step costs
2% of the run time of a mesh, for which refinement would lower the error by 1%, and the next step gains less."""
CHUNK = (0, 0, 1024, 256)
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
        moment: Moments on the first side of each facet [force], shape (facets, d, d).
        force: Total body force of each cell [force], shape (n, d), or None.
        free: Components of facets whose traction is not given, shape (facets, d).
        elastic: ``C eps(u^)`` of the owned cells [force/area], shape (owned, q or 1, s).
        compliance: C^-1 [area/force], shape (n or 1, q or 1, s, s).
        iterations: At most so many.

    Returns:
        The moments, and the number of iterations.
    """
    comm, d = model.comm, cells.d
    facets = model.mesh.topology.index_map(d - 1)
    shared = la.vector(facets, d * d)

    def total(values: np.ndarray) -> np.ndarray:
        """Sum what the ranks have for each facet."""
        if comm.size > 1:
            shared.array[:] = values.ravel()
            shared.scatter_reverse(la.InsertMode.add)
            shared.scatter_forward()
            values.ravel()[:] = shared.array
        return values

    def dot(a: np.ndarray, b: np.ndarray) -> float:
        owned = facets.size_local
        return comm.allreduce(float(np.vdot(a[:owned], b[:owned])), MPI.SUM)

    energy = _Energy(cells, model.domain.owned_cells, compliance)
    square, slope = energy.start(moment, force, elastic)
    square = comm.allreduce(square, MPI.SUM)
    patches = _Patches(model, energy, free)
    r = -total(slope)
    moment = moment.copy()
    p, rz = np.zeros_like(r), 1.0
    for done in range(iterations):
        z = total(patches(r))
        new = dot(r, z)
        if not new > np.finfo(float).eps ** 2 * square:  # at the minimum, or nothing is free
            return moment, done
        p *= new / rz if done else 0.0
        p += z
        rz = new
        image = total(energy(p))
        step = rz / dot(p, image)
        moment += step * p
        r -= step * image
        before, square = square, square - step * rz
        if square > (1 - GAIN) ** 2 * before:
            return moment, done + 1
    return moment, iterations


def _chunks(count: int, d: int) -> Iterator[slice]:
    return (slice(i, min(i + CHUNK[d], count)) for i in range(0, count, CHUNK[d]))


class _Energy:
    """The complementary energy as a quadratic form of facet moments; no matrix of a cell is stored.

    On the reference simplex the stress at the points is one matrix times the moments; the rest is in a metric of the
    components, ``|T|/q  P C^-1 P^T`` with P the Piola transform.

    Attributes:
        map: Reference stresses of reference moments, shape (s q, (d+1) d d).
        metric: Shape (n, q or 1, s, s) [length^(4-d)/(force/area)].
        sign: +1 where the cell is the first of its facet, else -1, shape (n, d+1).
    """

    def __init__(self, cells: Simplices, owned: int, compliance: np.ndarray) -> None:
        d = cells.d
        self.cells, self.owned = cells, owned
        near, _ = macro_points(d)
        at_points = np.einsum("qm,kmsfc->skqfc", near, reference_map(d))
        s, q = len(at_points), (d + 1) ** 2
        at_points = at_points.reshape(s * q, -1, d)
        self.body = np.ascontiguousarray(at_points[:, -1].T)
        of_forces = at_points[:, :-1].reshape(-1, d + 1, d, d)
        self.map = nodal_forces(of_forces).reshape(s * q, -1)  # the matrix of nodal_forces is symmetric
        places = np.arange(cells.facets.size).reshape(cells.facets.shape)
        self.sign = np.where(cells.side[0][cells.facets] == places, 1.0, -1.0)
        self.inverse = cells.inverse
        self.metric = np.empty((len(cells.nodes), compliance.shape[1], s, s))
        for some in _chunks(len(cells.nodes), d):
            P = piola(cells, some)[:, None] * np.sqrt(cells.volume[some] / q)[:, None, None, None]
            local = compliance[some] if len(compliance) > 1 else compliance
            self.metric[some] = np.matmul(np.matmul(P, local), P.transpose(0, 1, 3, 2))

    def start(self, moment: np.ndarray, force: np.ndarray | None, elastic: np.ndarray) -> tuple[float, np.ndarray]:
        """``|sigma^ - C eps(u^)|^2`` and half its derivative, of the owned cells.

        The map of facet moments keeps constant stresses, so the mean of C eps(u^) is taken off the tractions.
        """
        cells, d = self.cells, self.cells.d
        mean = tensors(elastic.mean(axis=1), d)
        square, seen = 0.0, np.zeros((cells.facets.size, d * d))
        for some in _chunks(self.owned, d):
            push = np.matmul(cells.area[some], mean[some])
            local = self.sign[some, :, None, None] * moment[cells.facets[some]] - push[:, :, None] / d
            stress = self._stress(local, some)
            if force is not None:
                stress += (np.einsum("nij,nj->ni", self.inverse[some], force[some]) @ self.body).reshape(stress.shape)
            if elastic.shape[1] > 1:
                rest = elastic[some].mean(axis=1, keepdims=True) - elastic[some]
                stress += np.linalg.solve(piola(cells, some).transpose(0, 2, 1), rest.transpose(0, 2, 1))
            dual = self._dual(stress, some)
            square += float(np.vdot(stress, dual))
            self._add(dual, some, seen)
        return square, self._on_facets(seen)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """The derivative's change for a change x of the moments, of the owned cells, shape (facets, d, d)."""
        cells, d = self.cells, self.cells.d
        seen = np.zeros((cells.facets.size, d * d))
        for some in _chunks(self.owned, d):
            local = self.sign[some, :, None, None] * x[cells.facets[some]]
            self._add(self._dual(self._stress(local, some), some), some, seen)
        return self._on_facets(seen)

    def _stress(self, moment: np.ndarray, some: slice) -> np.ndarray:
        """Reference stresses of moments as the cells see them, (c, d+1, d, d) -> (c, s, q)."""
        d, count = self.cells.d, len(moment)
        local = np.matmul(moment.reshape(count, -1, d), self.inverse[some].transpose(0, 2, 1))
        return (local.reshape(count, -1) @ self.map.T).reshape(count, self.metric.shape[-1], -1)

    def _dual(self, stress: np.ndarray, some: slice) -> np.ndarray:
        if self.metric.shape[1] == 1:
            return np.matmul(self.metric[some, 0], stress)
        return np.einsum("nqab,nbq->naq", self.metric[some], stress)

    def _add(self, dual: np.ndarray, some: slice, seen: np.ndarray) -> None:
        """The transpose of ``_stress``, written to the places of the cells."""
        d, count = self.cells.d, len(dual)
        local = np.matmul((dual.reshape(count, -1) @ self.map).reshape(count, -1, d), self.inverse[some])
        local = local.reshape(count, d + 1, d * d)
        np.multiply(local, self.sign[some, :, None], out=seen.reshape(-1, d + 1, d * d)[some])

    def _on_facets(self, seen: np.ndarray) -> np.ndarray:
        """Sum over the two sides, shape (facets, d, d)."""
        first, second = self.cells.side
        values = np.where(first >= 0, 1.0, 0.0)[:, None] * seen[first]
        values += np.where(first != second, 1.0, 0.0)[:, None] * seen[second]
        return values.reshape(-1, self.cells.d, self.cells.d)


class _Patches:
    """Solves the minimisation on the patch of every hinge of this rank, and adds the results up.

    Attributes:
        normal, couple, edge, turn: Unit normals (facets, d); couples about hinge j as weights of the normal at node l
            (facets, d, d); edges (facets, k, d); sense of the ring through (F, j) on the first side (facets, d).
        member: Pairs F * d + j in the order of the hinges.
        groups: For all rings of one size: their part of ``member`` and the inverses, shape (rings, dofs, dofs).
    """

    def __init__(self, model: Model, energy: _Energy, free: np.ndarray) -> None:
        cells, d = energy.cells, energy.cells.d
        self.bars = np.array(list(combinations(range(d), 2)))
        self.others = facet_vertices(d - 1)  # nodes of the hinge opposite to node j
        self.k, self.w = len(self.bars), (d - 1) * d + 1
        cell, i = np.divmod(np.maximum(cells.side[0], 0), d + 1)
        nodes = facet_vertices(d)[i]
        corners = np.zeros((len(cells.nodes), d + 1, d))
        corners[:, 1:] = cells.J.transpose(0, 2, 1)
        corners = corners[cell[:, None], nodes]
        self.edge = corners[:, self.bars[:, 1]] - corners[:, self.bars[:, 0]]
        self.normal = cells.area[cell, i] / np.linalg.norm(cells.area[cell, i], axis=1, keepdims=True)
        self.couple = _couples(cells.area[cell[:, None], nodes] / cells.volume[cell, None, None], self.normal)
        self.turn = _senses(cells)[cell[:, None], i[:, None], np.arange(d)]

        start, size = self._rings(model, cells)
        hinge = np.repeat(np.arange(len(size)), size)
        dofs = self.w + self.k * size
        offset = np.cumsum(dofs**2) - dofs**2
        where = np.full((len(free) * d, 2), -1)
        where[self.member] = np.stack([hinge, np.arange(len(hinge)) - start[hinge]], axis=1)
        matrices = np.zeros(int((dofs**2).sum()))
        self._assemble(energy, where, offset, dofs, matrices)

        along, forces = self._allowed(free, start)
        self.groups = []
        for m in np.unique(size):
            rings = np.flatnonzero(size == m)
            n = len(rings)
            inverse = matrices[offset[rings[0]] :][: n * dofs[rings[0]] ** 2].reshape(n, dofs[rings[0]], -1)
            rows = slice(start[rings[0]], start[rings[0]] + m * n)
            keep = np.concatenate([forces[rings], along[rows].reshape(n, -1)], axis=1)
            for some in _chunks(n, d):
                _invert(inverse[some], keep[some])
            self.groups.append((rows, inverse))

    def _rings(self, model: Model, cells: Simplices) -> tuple[np.ndarray, np.ndarray]:
        """Number the hinges of this rank by the size of their rings; first place in ``member``, and size, of each.

        A hinge is of the rank that owns its node of least global number: that rank has all cells around it.
        """
        d, index_map = cells.d, model.V.dofmap.index_map
        cell, i = np.divmod(np.maximum(cells.side[0], 0), d + 1)
        of_facet = np.take_along_axis(cells.nodes[cell], facet_vertices(d)[i], axis=1)
        hinges = of_facet[:, self.others].reshape(-1, d - 1)
        everywhere = index_map.local_to_global(np.arange(len(model.fixed), dtype=np.int32))
        least = np.take_along_axis(hinges, everywhere[hinges].argmin(axis=1)[:, None], axis=1)[:, 0]
        member = np.flatnonzero(np.repeat(cells.side[0] >= 0, d) & (least < index_map.size_local))
        key = hinges[member] @ (len(model.fixed) ** np.arange(d - 1, dtype=np.int64))
        _, hinge, size = np.unique(key, return_inverse=True, return_counts=True)
        by_size = np.argsort(size, kind="stable")
        rank = np.empty_like(by_size)
        rank[by_size] = np.arange(len(size))
        self.member = member[np.argsort(rank[hinge], kind="stable")]
        size = size[by_size]
        return np.cumsum(size) - size, size

    def _assemble(
        self, energy: _Energy, where: np.ndarray, offset: np.ndarray, dofs: np.ndarray, matrices: np.ndarray
    ) -> None:
        """Add the energy of all cells to the patch matrices, cell by cell for each of its hinges.

        The columns of Q are what forces and couple of the hinge and the bars of its two facets are as reference
        moments of the cell, rows ordered by facet, then by the nodes of the hinge and the other node.
        """
        cells, d, w, k = energy.cells, energy.cells.d, self.w, self.k
        s = energy.metric.shape[-1]
        upper = np.triu_indices(s)
        of_facets = energy.map.reshape(s, -1, d + 1, d, d)
        vertices, reference = facet_vertices(d), np.vstack([np.zeros(d), np.eye(d)])
        hinges = []
        for p, q in combinations(range(d + 1), 2):
            parts, bars = [], np.zeros((2, d, d, 2, k))
            for side, (f, other) in enumerate(((p, q), (q, p))):
                local = np.flatnonzero(vertices[f] == other)[0]
                order = [*self.others[local], local]
                parts.append(of_facets[:, :, f, order])
                for t, (a, b) in enumerate(self.bars):
                    bars[side, order.index(b), :, side, t] = reference[vertices[f, b]] - reference[vertices[f, a]]
                    bars[side, order.index(a), :, side, t] = -bars[side, order.index(b), :, side, t]
                hinges.append((f, local, order))
            part = np.stack(parts, axis=2).reshape(s, -1, 2 * d * d)
            gram = np.einsum("aqx,bqy->abxy", part, part)
            gram = (gram + gram.transpose(1, 0, 2, 3))[upper] * np.where(upper[0] == upper[1], 0.5, 1.0)[:, None, None]
            hinges[-2:] = [(hinges[-2], hinges[-1], gram.reshape(len(gram), -1), bars.reshape(2 * d * d, 2, k))]
        senses = _senses(cells)
        columns = np.arange(w + 2 * k)
        for some in _chunks(len(cells.nodes), d):
            count = len(cells.nodes[some])
            metric = energy.metric[some].mean(axis=1)[:, upper[0], upper[1]]
            inverse, area = energy.inverse[some], cells.area[some]
            normal = area / np.linalg.norm(area, axis=2, keepdims=True)
            couple = [_couples(area[:, v] / cells.volume[some, None, None], normal[:, f]) for f, v in enumerate(vertices)]
            normal = np.matmul(normal, inverse.transpose(0, 2, 1))
            Q = np.zeros((count, 2, d, d, w + 2 * k))
            flat = Q.reshape(count, 2 * d * d, -1)
            for first, second, gram, bars in hinges:
                for side, (f, local, order) in enumerate((first, second)):
                    turned = senses[some, f, local, None, None] * inverse
                    for h in range(d - 1):
                        Q[:, side, h, :, h * d : (h + 1) * d] = turned
                    np.multiply(couple[f][:, local, order, None], normal[:, f, None], out=Q[:, side, :, :, w - 1])
                sign = energy.sign[some][:, [first[0], second[0]]]
                np.multiply(bars, sign[:, None, :, None], out=flat[:, :, w:].reshape(count, -1, 2, k))
                local_matrix = np.matmul(flat.transpose(0, 2, 1), np.matmul((metric @ gram).reshape(count, 2 * d * d, -1), flat))
                pairs = np.stack([cells.facets[some, f] * d + local for f, local, _ in (first, second)], axis=1)
                hinge, slot = where[pairs[:, 0], 0], where[pairs, 1]
                here = hinge >= 0
                hinge, slot = hinge[here], slot[here]
                row = np.broadcast_to(columns, (len(hinge), w + 2 * k)).copy()
                row[:, w:] = (w + k * slot[:, :, None] + np.arange(k)).reshape(len(hinge), -1)
                at = (offset[hinge][:, None] + row * dofs[hinge][:, None])[:, :, None] + row[:, None, :]
                np.add.at(matrices, at.ravel(), local_matrix[here].ravel())

    def _allowed(self, free: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which bars of each member, shape (members, k), and which forces and couple of each hinge, (hinges, w).

        Those that act on no given component of a traction. All bars along an edge of a ring in 3D are together what
        forces at its two ends are: the first one is left out.
        """
        d = free.shape[1]

        def may_act(direction: np.ndarray, free: np.ndarray) -> np.ndarray:
            acts = abs(direction) > 1e-12 * np.linalg.norm(direction, axis=-1, keepdims=True)
            return ~np.any(acts & ~free, axis=-1)

        f, j = np.divmod(self.member, d)
        force = np.logical_and.reduceat(free[f], start) if len(start) else np.zeros((0, d), dtype=bool)
        couple = np.logical_and.reduceat(may_act(self.normal, free)[f], start) if len(start) else np.zeros(0, dtype=bool)
        bars = may_act(self.edge, free[:, None])[f]
        in_hinge = (self.bars[None] != np.arange(d)[:, None, None]).all(axis=2)
        bars[start] &= ~(in_hinge[j[start]] & may_act(self.edge[f[start]], force[:, None]))
        return bars, np.concatenate([np.tile(force, (1, d - 1)), couple[:, None]], axis=1)

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Sum of the corrections of all patches for the residual r [length], shape (facets, d, d)."""
        d, w, k = r.shape[1], self.w, self.k
        table = np.empty((len(r), d, w + k))
        for some in _chunks(len(r), d):
            part, here = table[some], r[some]
            np.multiply(here[:, self.others], self.turn[some, :, None, None], out=part[:, :, : w - 1].reshape(-1, d, d - 1, d))
            along = np.matmul(here, self.normal[some, :, None])
            part[:, :, w - 1] = np.matmul(self.couple[some], along)[..., 0]
            stretch = here[:, self.bars[:, 1]] - here[:, self.bars[:, 0]]
            part[:, :, w:] = np.einsum("fkd,fkd->fk", self.edge[some], stretch)[:, None, :]
        table = table.reshape(-1, w + k)
        result = np.zeros_like(table)
        for rows, inverse in self.groups:
            size = (rows.stop - rows.start) // len(inverse)
            for some in _chunks(len(inverse), d):
                n = len(inverse[some])
                member = self.member[rows][some.start * size : some.stop * size]
                values = table[member].reshape(n, size, w + k)
                right = np.concatenate([values[:, :, :w].sum(axis=1), values[:, :, w:].reshape(n, -1)], axis=1)
                y = np.matmul(inverse[some], right[:, :, None])[..., 0]
                values[:, :, :w] = y[:, None, :w]
                values[:, :, w:] = y[:, w:].reshape(n, size, k)
                result[member] = values.reshape(-1, w + k)
        result = result.reshape(-1, d, w + k)
        z = np.empty_like(r)
        for some in _chunks(len(r), d):
            part = result[some]
            weight = np.matmul(part[:, None, :, w - 1], self.couple[some])
            here = weight.transpose(0, 2, 1) * self.normal[some, None, :]
            force = part[:, :, : w - 1] * self.turn[some, :, None]
            for j, others in enumerate(self.others):
                here[:, others] += force[:, j].reshape(-1, d - 1, d)
            bar = part[:, :, w:].sum(axis=1)[:, :, None] * self.edge[some]
            for t, (a, b) in enumerate(self.bars):
                here[:, a] -= bar[:, t]
                here[:, b] += bar[:, t]
            z[some] = here
        return z


def _couples(slopes: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """``g_j . g_l / |g_j|`` with g the part in the facet of the gradients of its nodes in a cell, shape (n, d, d)."""
    inside = slopes - np.matmul(slopes, normal[:, :, None]) * normal[:, None, :]
    gram = np.matmul(inside, inside.transpose(0, 2, 1))
    return gram / np.sqrt(np.einsum("njj->nj", gram))[:, :, None]


def _senses(cells: Simplices) -> np.ndarray:
    """Sense, +1 or -1, in which a cell passes through its facet f in the ring of the hinge opposite to node j of it.

    It is the orientation of (hinge, node j, the cell's node off the facet), so that the two facets of a cell at a hinge
    are passed in opposite senses, and a facet in the same sense by both cells, one of which sees the opposite force.
    """
    d = cells.d
    parity = np.zeros((d + 1, d))
    for f, vertices in enumerate(facet_vertices(d)):
        for j in range(d):
            hinge = [v for v in vertices if v != vertices[j]]
            parity[f, j] = np.round(np.linalg.det(np.eye(d + 1)[[*hinge, vertices[j], f]]))
    return np.sign(np.linalg.det(cells.J))[:, None, None] * parity


def _invert(matrices: np.ndarray, keep: np.ndarray) -> None:
    """Invert positive definite matrices on the rows and columns to keep, in place; the others become zero."""
    diagonal = np.einsum("nii->ni", matrices)
    scale = np.where(keep, 1 / np.sqrt(np.where(keep, diagonal, 1.0)), 0.0)
    matrices *= scale[:, :, None] * scale[:, None, :]
    diagonal += ~keep
    matrices[:] = np.linalg.inv(matrices)
    matrices *= scale[:, :, None] * scale[:, None, :]
