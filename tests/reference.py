"""True errors of an admissible pair against a reference solution on a much finer mesh."""

from __future__ import annotations

from dataclasses import dataclass

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, geometry
from dolfinx import mesh as dmesh

import erc_contact as ec
from erc_contact.admissible.cells import cell_geometry
from erc_contact.admissible.elastic import given_strains, moduli, strains
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.traction import ContactTraction
from erc_contact.model.contact.friction import depends_on_pressure
from namedmesh.base.releases import cell_nodes
from namedmesh.simplex import barycentric, bernstein, lagrange, rule


@dataclass(frozen=True)
class TrueErrors:
    """Energy norms of the errors of u^ and of sigma^, and the third term of the bound where friction has a pressure.

    ``of_cells`` has both errors on each cell of the pair, shape (2, cells).
    """

    displacement: float
    stress: float
    friction: float
    of_cells: np.ndarray

    @property
    def both(self) -> float:
        """sqrt(|u - u^|^2 + |sigma - sigma^|^2)."""
        return float(np.hypot(self.displacement, self.stress))


def true_errors(pair: Admissible, fine: ec.Solution) -> TrueErrors:
    """Errors of a pair against the finite element solution on a mesh that refines its own (serial).

    Both are integrated by a rule of degree 2k on the fine cells: only fine cells cut by
    an edge of the sub-simplices are not exact, and there are none on a mesh that
    :func:`nested` made. The fine solution may be of another degree.
    """
    model, d = fine.model, fine.model.space.d
    cells = cell_geometry(model.space)
    k = max(model.space.degree, pair.cell_geometry.degree)
    points, weights = rule(d, 2 * k)
    x = model.space.V.tabulate_dof_coordinates()[:, :d][cells.vertices]
    at = np.matmul(barycentric(points), x).reshape(-1, d)
    parent = np.repeat(_parents(pair, x.mean(axis=1)), len(points))
    local = _barycentric(pair, parent, at)

    coarse = pair.cell_geometry
    stress = _sigma(pair, parent, local)
    lower = bernstein(d, coarse.degree - 1, local[:, 1:])
    strain = np.einsum("nb,nbs->ns", lower, strains(coarse, pair.displacement)[parent])
    n, q = len(cells.nodes), len(weights)
    fine_strain = np.matmul(bernstein(d, model.space.degree - 1, points), strains(cells, fine.u))
    # Moduli may differ from cell to cell, and do not vary inside.
    C, S = (moduli(model, cells, points, n, inverse=i)[:, 0] for i in (False, True))
    C, S = (np.broadcast_to(matrix, (n, *matrix.shape[1:])) for matrix in (C, S))
    volume = cells.volume[:, None] * weights
    du = fine_strain - strain.reshape(n, q, -1)
    elastic_strain = fine_strain
    if model.strains is not None:
        elastic_strain = fine_strain - given_strains(model, cells, points, n)
    if model.preloads:
        # Their strains depend on the mesh: the elastic strains are compared.
        of_coarse = given_strains(pair.model, coarse, points, len(coarse.nodes))[parent[::q], 0]
        du = elastic_strain - (strain.reshape(n, q, -1) - of_coarse[:, None])
    ds = np.matmul(elastic_strain, C) - stress.reshape(n, q, -1)
    squares = [
        volume * np.einsum("nqa,nab,nqb->nq", rest, M, rest) for rest, M in ((du, C), (ds, S))
    ]
    of_cells = np.sqrt(
        [np.bincount(parent, square.ravel(), len(pair.stress)) for square in squares]
    )
    displacement, stresses = (float(v) for v in np.linalg.norm(of_cells, axis=1))
    return TrueErrors(displacement, stresses, _third_term(pair, fine), of_cells)


def nested(domain: ec.Domain, levels: int) -> ec.Domain:
    """The mesh cut at the barycentres of its cells, as sigma^ is, and refined uniformly (serial)."""
    mesh, d, tags = domain.mesh, domain.dim, domain.facet_tags
    x, cells = mesh.geometry.x[:, :d], cell_nodes(mesh.geometry)
    parts = np.repeat(cells.astype(np.int64)[:, None], d + 1, axis=1)
    parts[:, range(d + 1), range(d + 1)] = len(x) + np.arange(len(cells))[:, None]
    element = ufl.Mesh(basix.ufl.element("Lagrange", mesh.basix_cell(), 1, shape=(d,)))
    fine = dmesh.create_mesh(
        mesh.comm, parts.reshape(-1, d + 1), element, np.vstack([x, x[cells].mean(axis=1)])
    )
    fine.topology.create_connectivity(d - 1, d)
    outer = dmesh.exterior_facet_indices(
        fine.topology
    )  # facets of the coarse mesh: known by their middles
    old, new = (
        dmesh.compute_midpoints(mesh, d - 1, tags.indices),
        dmesh.compute_midpoints(fine, d - 1, outer),
    )
    same = abs(new[:, None] - old).max(axis=2).argmin(axis=1)
    result = ec.Domain(fine, dmesh.meshtags(fine, d - 1, outer, tags.values[same]), domain.names)
    for _ in range(levels):
        result = result.refined()
    return result


def _parents(pair: Admissible, middles: np.ndarray) -> np.ndarray:
    """The coarse cell that holds each fine one, whose middles are given."""
    mesh, three = pair.solution.domain.mesh, np.pad(middles, ((0, 0), (0, 3 - middles.shape[1])))
    near = geometry.compute_collisions_points(
        geometry.bb_tree(mesh, mesh.topology.dim, padding=1e-10), three
    )
    fine, cell = np.repeat(np.arange(len(middles)), np.diff(near.offsets)), near.array
    inside = _barycentric(pair, cell, middles[fine]).min(axis=1)
    assert np.bincount(fine[inside > 0], minlength=len(middles)).tolist() == [1] * len(middles)
    return cell[inside > 0]


def _barycentric(pair: Admissible, cells: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of points (n, d) in coarse cells (n,)."""
    origin = pair.solution.model.space.V.tabulate_dof_coordinates()[:, : x.shape[1]][
        pair.cell_geometry.vertices[cells, 0]
    ]
    local = np.einsum("nij,nj->ni", pair.cell_geometry.inverse[cells], x - origin)
    return np.column_stack([1 - local.sum(axis=1), local])


def _sigma(pair: Admissible, parent: np.ndarray, local: np.ndarray) -> np.ndarray:
    """sigma^ at points, in Mandel components."""
    d, every = pair.cell_geometry.d, np.arange(len(parent))
    k = local.argmin(axis=1)
    least = local[every, k]
    sub = local - least[:, None]
    sub[every, k] = (d + 1) * least
    shape = bernstein(d, pair.cell_geometry.degree, sub[:, 1:])
    return np.einsum("nm,nms->ns", shape, pair.stress[parent, k])


def _third_term(pair: Admissible, fine: ec.Solution) -> float:
    """``2 int (b - b^)(|w_t - s| - |w^_t - s|)`` over the contacts, by the fine facets' middles (2D)."""
    space = fine.model.space

    def since(solution: ec.Solution, u: fem.Function, traction: ContactTraction) -> np.ndarray:
        return traction.contact.trace.since(u.x.array)

    total, middle = 0.0, np.array([[0.5]])
    reference = ec.equilibrate(fine, tighten=0)
    for coarse, exact in zip(pair.tractions, reference.tractions, strict=True):
        if not depends_on_pressure(exact.contact.friction):
            continue
        n = exact.contact.direction[0]
        x = space.V.tabulate_dof_coordinates()[:, :2][exact.nodes].mean(axis=1)
        w = (lagrange(1, space.degree, middle) @ since(fine, fine.u, exact))[:, 0]
        ends = pair.solution.model.space.V.tabulate_dof_coordinates()[:, :2][coarse.nodes]
        along = np.array([-n[1], n[0]])
        s, low = x @ along, (ends @ along)
        inside = (s[:, None] >= low.min(axis=1) - 1e-12) & (s[:, None] <= low.max(axis=1) + 1e-12)
        facet = inside.argmax(axis=1)
        t = (s - low[facet, 0]) / (low[facet, 1] - low[facet, 0])
        k = pair.cell_geometry.degree
        nodal = since(pair.solution, pair.displacement, coarse)[facet]
        hat_w = np.einsum("fm,fmi->fi", lagrange(1, k, t[:, None]), nodal)
        hat_bound = np.einsum("fm,fm->f", bernstein(1, k, t[:, None]), coarse.friction_bound[facet])
        slip = abs(w @ along) - abs(hat_w @ along)
        total += float(
            np.sum(
                2
                * exact.area
                * (exact.friction_bound @ bernstein(1, space.degree, middle)[0] - hat_bound)
                * slip
            )
        )
    return total
