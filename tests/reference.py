"""True errors of an admissible pair against a reference solution on a much finer mesh."""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
from dolfinx import geometry

import erc_contact as ec
from erc_contact.admissible import Admissible, moduli, simplices, strains


@dataclass(frozen=True)
class TrueErrors:
    """Energy norms of the errors of u^ and of sigma^, and the third term of the bound where friction has a pressure."""

    displacement: float
    stress: float
    friction: float


def true_errors(pair: Admissible, fine: ec.Solution) -> TrueErrors:
    """Errors of a pair against the finite element solution on a mesh that refines its own (serial).

    Both are integrated by a rule of degree 2 on the fine cells. The fine strain is
    constant in each of them, so that only fine cells cut by an edge of the sub-simplices are not exact.
    """
    model, d = fine.model, fine.model.d
    cells = simplices(model)
    points, weights = basix.make_quadrature(model.mesh.basix_cell(), 2)
    weights = weights / weights.sum()
    shape = np.column_stack([1 - points.sum(axis=1), points])
    x = model.V.tabulate_dof_coordinates()[:, :d][cells.nodes]
    at = np.matmul(shape, x).reshape(-1, d)
    parent, local = _locate(pair, at)

    coarse = pair.cells
    stress, strain = _sigma(pair, parent, local), strains(coarse, pair.displacement)[parent]
    n, q = len(cells.nodes), len(weights)
    fine_strain = strains(cells, fine.u)
    C = moduli(model, points, n)[0, 0]
    S = moduli(model, points, n, inverse=True)[0, 0]
    volume = cells.volume[:, None] * weights
    du = fine_strain[:, None] - strain.reshape(n, q, -1)
    ds = (fine_strain @ C)[:, None] - stress.reshape(n, q, -1)
    displacement = float(np.sqrt(np.sum(volume * np.einsum("nqa,ab,nqb->nq", du, C, du))))
    stresses = float(np.sqrt(np.sum(volume * np.einsum("nqa,ab,nqb->nq", ds, S, ds))))
    return TrueErrors(displacement, stresses, _third_term(pair, fine))


def _locate(pair: Admissible, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The coarse cell of each point and the point's barycentric coordinates there."""
    mesh, d = pair.solution.domain.mesh, pair.cells.d
    tree = geometry.bb_tree(mesh, d, padding=1e-10)
    three = np.zeros((len(at), 3))
    three[:, :d] = at
    found = geometry.compute_colliding_cells(mesh, geometry.compute_collisions_points(tree, three), three)
    parent = found.array[found.offsets[:-1]]
    origin = pair.solution.model.V.tabulate_dof_coordinates()[:, :d][pair.cells.nodes[parent, 0]]
    local = np.einsum("nij,nj->ni", pair.cells.inverse[parent], at - origin)
    return parent, np.column_stack([1 - local.sum(axis=1), local])


def _sigma(pair: Admissible, parent: np.ndarray, local: np.ndarray) -> np.ndarray:
    """sigma^ at points, in Mandel components."""
    d, every = pair.cells.d, np.arange(len(parent))
    k = local.argmin(axis=1)
    least = local[every, k]
    sub = local - least[:, None]
    sub[every, k] = (d + 1) * least
    return np.einsum("nm,nms->ns", sub, pair.stress[parent, k])


def _third_term(pair: Admissible, fine: ec.Solution) -> float:
    """``2 int (b - b^)(|w_t| - |w^_t|)`` over the contacts, by the fine facets' middles (2D)."""
    total = 0.0
    reference = ec.equilibrate(fine, tighten=0)
    for coarse, exact in zip(pair.tractions, reference.tractions, strict=True):
        if exact.contact.law is None:
            continue
        n = exact.contact.direction[0]
        x = fine.model.V.tabulate_dof_coordinates()[:, :2][exact.nodes].mean(axis=1)
        w = fine.u.x.array.reshape(-1, 2)[exact.nodes].mean(axis=1)
        ends = pair.solution.model.V.tabulate_dof_coordinates()[:, :2][coarse.nodes]
        along = np.array([-n[1], n[0]])
        s, low = x @ along, (ends @ along)
        inside = (s[:, None] >= low.min(axis=1) - 1e-12) & (s[:, None] <= low.max(axis=1) + 1e-12)
        facet = inside.argmax(axis=1)
        t = (s - low[facet, 0]) / (low[facet, 1] - low[facet, 0])
        shape = np.column_stack([1 - t, t])
        hat_w = np.einsum("fm,fmi->fi", shape, pair.displacement.x.array.reshape(-1, 2)[coarse.nodes[facet]])
        hat_bound = np.einsum("fm,fm->f", shape, coarse.bound[facet])
        slip = abs(w @ along) - abs(hat_w @ along)
        total += float(np.sum(2 * exact.area * (exact.bound.mean(axis=1) - hat_bound) * slip))
    return total
