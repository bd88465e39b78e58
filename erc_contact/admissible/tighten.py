"""Tighten the admissible stress: less complementary energy of the difference, the tractions still in equilibrium.

The bulk part of the error is ``|sigma^ - C eps(u^)|^2``, and sigma^ is linear in the moments of the facet tractions.
Corrections x of these moments that leave every cell in equilibrium, and that vanish on Gamma_N and Gamma_C, lower it:
preconditioned conjugate gradients, whose preconditioner solves the same problem on small patches and adds the
results up. Every iterate is admissible.

A hinge is a part of codimension 2: a vertex in 2D, an edge in 3D. Its patch is the ring of cells and facets around it.
Moments ``int_F t phi_l`` are forces at the nodes l of a facet, and all forces that are in balance on every cell of a
ring are combinations of three kinds, so that equilibrium holds by construction:

- the same force at a node of the hinge on all facets of the ring, passed on from cell to cell;
- the same couple about the hinge: ``(grad l_j . grad l_l)/|grad l_j| N`` at node l of a facet with normal N, whose
  node j is not on the hinge (l_l the barycentric coordinates, grad their gradients in the facet);
- opposite forces along the edges of one facet, as in a truss.

In 2D they are the degrees of freedom of the Hsieh-Clough-Tocher triangle, taken as Airy's stress function.

Memory for a cell: about 1 kB in 2D and 9 kB in 3D, most of it the inverses of the patches.

Source: Ladeveze, Leguillon (1983) for the energy of facet tractions; the patches and their bases are ours.
"""

from __future__ import annotations

from itertools import combinations
from math import sqrt

import numpy as np
from dolfinx import common, la
from mpi4py import MPI

from erc_contact.admissible.geometry import Simplices, signed
from erc_contact.admissible.macro import macro_points, piola, reference_map

ITERATIONS = 5
GAIN = 0.01
CHUNK = 4096


def tightened(
    cells: Simplices,
    owned: int,
    defect: np.ndarray,
    compliance: np.ndarray,
    free: np.ndarray,
    rank_of_node: np.ndarray,
    facet_map: common.IndexMap,
    comm: MPI.Comm,
    iterations: int,
    gain: float,
) -> tuple[np.ndarray, int]:
    d = cells.d
    energy = Energy(cells, compliance)
    patches = Patches(cells, energy, free, rank_of_node)
    count = facet_map.size_local
    shared = la.vector(facet_map, d * d)

    def total(values):
        if comm.size == 1:
            return values
        shared.array[:] = values.ravel()
        shared.scatter_reverse(la.InsertMode.add)
        shared.scatter_forward()
        return shared.array.reshape(values.shape).copy()

    def dot(a, b):
        return comm.allreduce(float(np.vdot(a[:count], b[:count])), MPI.SUM)

    e2 = comm.allreduce(energy.of(defect, owned), MPI.SUM)
    x = np.zeros((len(free), d, d))
    r = -total(energy.slope(defect, owned))
    p = np.zeros_like(x)
    rz = 1.0
    done = 0
    hist = [e2]
    for _ in range(iterations):
        z = total(patches(r))
        new = dot(r, z)
        p = z + new / rz * p if done else z
        rz = new
        kp = total(energy(p, owned))
        step = rz / dot(p, kp)
        x += step * p
        r -= step * kp
        done += 1
        hist.append(hist[-1] - step * rz)
    tightened.hist = np.sqrt(hist)
    return x, done


class Energy:
    """The complementary energy as a quadratic form of facet moments, without a matrix of cells."""

    def __init__(self, cells: Simplices, compliance: np.ndarray) -> None:
        d = self.d = cells.d
        self.cells, self.compliance = cells, compliance
        near, _ = macro_points(d)
        full = np.einsum("qm,kmsfc->skqfc", near, reference_map(d)[..., :-1, :])
        s = len(full)
        full = full.reshape(s, (d + 1) ** 2, d + 1, d, d)
        nodal = d * ((d + 1) * np.eye(d) - 1)
        self.map = np.einsum("sqilc,lm->sqimc", full, nodal).reshape(s * (d + 1) ** 2, -1)
        self.sign = np.where(cells.side[0][cells.facets] == np.arange(cells.facets.size).reshape(cells.facets.shape), 1.0, -1.0)
        self.inverse = np.ascontiguousarray(cells.inverse)
        self.metric = np.empty((len(cells.nodes), compliance.shape[1], s, s))
        for some in self.chunks(len(cells.nodes)):
            image = piola(cells, some)
            local = compliance[some] if len(compliance) > 1 else compliance
            weight = cells.volume[some] / (d + 1) ** 2
            self.metric[some] = np.matmul(np.matmul(image[:, None], local), image[:, None].transpose(0, 1, 3, 2)) * weight[:, None, None, None]

    def chunks(self, count):
        return [slice(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK)]

    def of(self, defect, owned):
        local = self.compliance
        if local.shape[:2] == (1, 1):
            dual = defect @ local[0, 0].T
        else:
            dual = np.matmul(local[:owned], defect[..., None])[..., 0]
        return float(np.einsum("n,nqa,nqa->", self.cells.volume[:owned], dual, defect)) / (self.d + 1) ** 2

    def slope(self, defect, owned):
        local = self.compliance
        n, d = self.cells, self.d
        seen = np.zeros((self.cells.facets.size, d * d))
        for some in self.chunks(owned):
            C = local[some] if len(local) > 1 else local
            dual = np.matmul(C, defect[some][..., None])[..., 0]
            dual = np.einsum("nqa,nba->nbq", dual, piola(n, some)) * (n.volume[some, None, None] / (d + 1) ** 2)
            self._back(dual, some, seen)
        return self._gather(seen)

    def __call__(self, x, owned):
        d, n = self.d, self.cells
        s = self.metric.shape[-1]
        seen = np.zeros((n.facets.size, d * d))
        for some in self.chunks(owned):
            local = x[n.facets[some]] * self.sign[some][:, :, None, None]
            count = len(local)
            local = np.matmul(local.reshape(count, (d + 1) * d, d), self.inverse[some].transpose(0, 2, 1))
            stress = (local.reshape(count, -1) @ self.map.T).reshape(count, s, -1)
            if self.metric.shape[1] == 1:
                stress = np.matmul(self.metric[some, 0], stress)
            else:
                stress = np.einsum("nqab,nbq->naq", self.metric[some], stress)
            self._back(stress, some, seen)
        return self._gather(seen)

    def _back(self, stress, some, seen):
        d = self.d
        count = len(stress)
        local = (stress.reshape(count, -1) @ self.map).reshape(count, (d + 1) * d, d)
        local = np.matmul(local, self.inverse[some]).reshape(count, d + 1, d * d) * self.sign[some][:, :, None]
        seen.reshape(-1, d + 1, d * d)[some] = local

    def _gather(self, seen):
        a, b = self.cells.side
        y = seen[a] + np.where((a != b)[:, None], seen[b], 0.0)
        y[a < 0] = 0.0
        return y.reshape(-1, self.d, self.d)


class Patches:
    def __init__(self, cells, energy, free, mine):
        """free: (facets, d); mine: rank key of nodes: global index if owned else ... ."""
        d = self.d = cells.d
        n = len(cells.nodes)
        self.pairs = np.array(list(combinations(range(d), 2)))
        others = np.array([[l for l in range(d) if l != j] for j in range(d)])
        self.others = others
        k, w = len(self.pairs), (d - 1) * d + 1
        self.k, self.w = k, w
        facets = len(free)
        used = cells.side[0] >= 0
        cell, i = np.divmod(np.maximum(cells.side[0], 0), d + 1)
        vertices = np.array([[v for v in range(d + 1) if v != f] for f in range(d + 1)])
        nodes = np.take_along_axis(cells.nodes[cell], vertices[i], axis=1)  # (F, d)
        # geometry of facets, seen from first
        slope = -cells.area[cell] / (d * cells.volume[cell, None, None])
        N = cells.area[cell, i]
        N = N / np.linalg.norm(N, axis=1, keepdims=True)
        self.normal = N
        self.couple = _couples(np.take_along_axis(slope, vertices[i][:, :, None], axis=1), N)
        x = np.zeros((n, d + 1, d))
        x[:, 1:] = cells.J.transpose(0, 2, 1)
        x = np.take_along_axis(x[cell], vertices[i][:, :, None], axis=1)
        self.edge = x[:, self.pairs[:, 1]] - x[:, self.pairs[:, 0]]
        det = np.sign(np.linalg.det(cells.J))
        parity = np.zeros((d + 1, d + 1))
        for a in range(d + 1):
            for b in range(d + 1):
                if a != b:
                    rest = [v for v in range(d + 1) if v not in (a, b)]
                    parity[a, b] = round(np.linalg.det(np.eye(d + 1)[[*rest, b, a]]))
        self.turn = det[cell][:, None] * parity[i[:, None], vertices[i]]  # (F, d): seen sign of pair (F, j)

        # hinges
        hinge_nodes = nodes[:, others]  # (F, d, d-1)
        key = hinge_nodes[..., 0].astype(np.int64)
        for m in range(1, d - 1):
            key = key * (cells.nodes.max(initial=0) + 1) + hinge_nodes[..., m]
        valid = used[:, None] & mine(hinge_nodes)
        member = np.flatnonzero(valid.ravel())
        _, hinge, size = np.unique(key.ravel()[member], return_inverse=True, return_counts=True)
        order = np.lexsort((hinge, size[hinge]))
        member, hinge = member[order], hinge[order]
        sizes = size[hinge]
        # renumber hinges in order
        first = np.ones(len(member), dtype=bool)
        first[1:] = hinge[1:] != hinge[:-1]
        number = np.cumsum(first) - 1
        start = np.flatnonzero(first)
        slot = np.arange(len(member)) - start[number]
        size = sizes[start]
        dofs = w + k * size
        offset = np.concatenate([[0], np.cumsum(dofs**2)])
        hinge_of = np.full(facets * d, -1)
        slot_of = np.zeros(facets * d, dtype=np.int64)
        hinge_of[member], slot_of[member] = number, slot
        self.member = member
        A = np.zeros(offset[-1])
        symmetric = list(zip(*np.triu_indices(energy.metric.shape[-1])))
        G = energy.map.reshape(len(energy.metric[0, 0]), -1, d + 1, d * d)
        ref = np.vstack([np.zeros(d), np.eye(d)])
        for p, q in combinations(range(d + 1), 2):
            part = G[:, :, [p, q]].reshape(G.shape[0], G.shape[1], 2 * d * d)
            M = []
            for a, b in symmetric:
                m = part[a].T @ part[b]
                M.append(m if a == b else m + m.T)
            M = np.array(M).reshape(len(symmetric), -1)
            ids = np.stack([cells.facets[:, p] * d + q - 1, cells.facets[:, q] * d + p], axis=1)
            here = np.flatnonzero(hinge_of[ids[:, 0]] >= 0)
            for lo in range(0, len(here), CHUNK):
                some = here[lo : lo + CHUNK]
                D = energy.metric[some].mean(axis=1)
                D = np.stack([D[:, a, b] for a, b in symmetric], axis=1)
                H = (D @ M).reshape(len(some), 2 * d * d, 2 * d * d)
                Q = np.zeros((len(some), 2, d, d, w + 2 * k))
                slopes = -cells.area[some] / (d * cells.volume[some, None, None])
                for side, (f, l) in enumerate(((p, q), (q, p))):
                    j = l - (l > f)
                    seen = det[some] * parity[f, l]
                    for h, node in enumerate(others[j]):
                        Q[:, side, node, :, h * d : (h + 1) * d] = energy.inverse[some] * seen[:, None, None]
                    normal = cells.area[some, f] / np.linalg.norm(cells.area[some, f], axis=1, keepdims=True)
                    c = _couples(slopes[:, vertices[f]], normal)[:, j]
                    Q[:, side, :, :, w - 1] = c[:, :, None] * np.einsum("nij,nj->ni", energy.inverse[some], normal)[:, None]
                    for t, (a, b) in enumerate(self.pairs):
                        e = (ref[vertices[f][b]] - ref[vertices[f][a]]) * energy.sign[some, f][:, None]
                        Q[:, side, a, :, w + side * k + t] = -e
                        Q[:, side, b, :, w + side * k + t] = e
                Q = Q.reshape(len(some), 2 * d * d, -1)
                local = np.matmul(Q.transpose(0, 2, 1), np.matmul(H, Q))
                slots = slot_of[ids[some]]
                row = np.concatenate(
                    [np.broadcast_to(np.arange(w), (len(some), w)), (w + k * slots[:, :, None] + np.arange(k)).reshape(len(some), -1)],
                    axis=1,
                )
                h = hinge_of[ids[some, 0]]
                at = (offset[h][:, None] + row * dofs[h][:, None])[:, :, None] + row[:, None, :]
                np.add.at(A, at.ravel(), local.ravel())

        # what is allowed
        held = ~free
        def ok(direction, scale):  # (F, ..., d)
            return ~np.any((abs(direction) > 1e-12 * scale) & held.reshape(facets, *([1] * (direction.ndim - 2)), d), axis=-1)
        truss = ok(self.edge, np.linalg.norm(self.edge, axis=-1, keepdims=True))  # (F,k)
        couple = ok(N, 1.0)  # (F,)
        f, j = np.divmod(member, d)
        allow_f = np.logical_and.reduceat(free[f], start) if len(start) else np.zeros((0, d), bool)
        allow_c = np.logical_and.reduceat(couple[f], start) if len(start) else np.zeros(0, bool)
        on_hinge = np.array([[jj not in pair for pair in self.pairs] for jj in range(d)])
        drop = np.zeros((len(member), k), dtype=bool)
        along = self.edge[f[start]]  # (H, k, d)
        redundant = ~np.any((abs(along) > 1e-12 * np.linalg.norm(along, axis=-1, keepdims=True)) & ~allow_f[:, None], axis=-1)
        drop[start] = on_hinge[j[start]] & redundant
        allow_t = truss[f] & ~drop
        self.groups = []
        for m in np.unique(size):
            hinges = np.flatnonzero(size == m)
            N_ = w + k * m
            W = A[offset[hinges[0]] : offset[hinges[-1] + 1]].reshape(len(hinges), N_, N_)
            rows = slice(start[hinges[0]], start[hinges[0]] + m * len(hinges))
            keep = np.concatenate([np.tile(allow_f[hinges], (1, d - 1)), allow_c[hinges, None], allow_t[rows].reshape(len(hinges), -1)], axis=1)
            for lo in range(0, len(hinges), CHUNK):
                part, kept = W[lo : lo + CHUNK], keep[lo : lo + CHUNK]
                diagonal = np.einsum("nii->ni", part)
                scale = np.where(kept, 1 / np.sqrt(np.where(kept, diagonal, 1.0)), 0.0)
                part *= scale[:, :, None] * scale[:, None, :]
                np.einsum("nii->ni", part)[...] += ~kept
                part[...] = np.linalg.inv(part)
                part *= scale[:, :, None] * scale[:, None, :]
            self.groups.append((rows, W))

    def __call__(self, r):
        d, w, k = self.d, self.w, self.k
        F = len(r)
        table = np.empty((F, d, w + k))
        table[:, :, : w - 1] = (self.turn[:, :, None, None] * r[:, self.others]).reshape(F, d, w - 1)
        along = np.matmul(r, self.normal[:, :, None])[..., 0]
        table[:, :, w - 1] = np.matmul(self.couple, along[:, :, None])[..., 0]
        table[:, :, w:] = np.einsum("fkd,fkd->fk", self.edge, r[:, self.pairs[:, 1]] - r[:, self.pairs[:, 0]])[:, None, :]
        table = table.reshape(F * d, w + k)
        out = np.zeros_like(table)
        for rows, W in self.groups:
            n = len(W)
            mine = table[self.member[rows]].reshape(n, -1, w + k)
            rhs = np.concatenate([mine[:, :, :w].sum(axis=1), mine[:, :, w:].reshape(n, -1)], axis=1)
            y = np.matmul(W, rhs[:, :, None])[..., 0]
            mine[:, :, :w] = y[:, None, :w]
            mine[:, :, w:] = y[:, w:].reshape(n, -1, k)
            out[self.member[rows]] = mine.reshape(-1, w + k)
        out = out.reshape(F, d, w + k)
        z = np.einsum("fjl,fj,fd->fld", self.couple, out[:, :, w - 1], self.normal)
        force = (self.turn[:, :, None] * out[:, :, : w - 1]).reshape(F, d, d - 1, d)
        for j in range(d):
            z[:, self.others[j]] += force[:, j]
        truss = out[:, :, w:].sum(axis=1)[:, :, None] * self.edge
        for t, (a, b) in enumerate(self.pairs):
            z[:, a] -= truss[:, t]
            z[:, b] += truss[:, t]
        return z


def _couples(slopes, normal):
    """(n, d, d) gradients of the facet's nodes in the cell -> weights (n, j, l)."""
    inside = slopes - np.einsum("njd,nd,ne->nje", slopes, normal, normal)
    gram = np.matmul(inside, inside.transpose(0, 2, 1))
    return gram / np.sqrt(np.einsum("njj->nj", gram))[:, :, None]
