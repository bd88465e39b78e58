"""Compute the true errors of an admissible pair, cell by cell (serial).

They are against a nested reference or a known solution.

The reference lives on a mesh that cuts each cell at its barycentre, as the admissible
stress does, and is then refined uniformly: on each of its cells u^ and sigma^ are
polynomials, and all integrals are exact. The augmented Lagrangian keeps the contact
conditions at the nodes exactly. Together: for frictionless scenes whose data the mesh
represents exactly,

    e^2 = |u_ref - u^|^2 + |sigma_ref - sigma^|^2 + 2 int r^_n (u_ref,n - g) + 2 sum_i
    R_i (u^_n - g)_i,  R_i <= 0,

with no term below zero: not even the error of the reference can take the index of both
errors below 1.

Source: Prager, Synge, Quart. Appl. Math. 5 (1947), for the sum of both errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import erc_contact as ec
from namedmesh.base.releases import cell_nodes

import basix.ufl  # isort: skip - after erc_contact, which loads MPI first
import numpy as np
import ufl
from dolfinx import cpp, fem, graph
from dolfinx import mesh as dmesh
from dolfinx.io.utils import distribute_entity_data

from erc_contact.admissible.pair import Admissible
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.friction import CONSTANT
from erc_contact.model.model import Model
from erc_contact.scene.material import mandel_basis, strain
from namedmesh.interface_map import InterfaceMap
from namedmesh.simplex import bernstein, rule
from namedmesh.tags import tag_table, tags_of

FACET_DEGREE = 4
"""Quadrature degree on the facets of the reference."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Hold what counts as the exact solution.

    Attributes:
        model: The scene on the fine mesh.
        parent: Cell of the coarse mesh that holds each fine cell.
        u: Displacement [length], a Function on the fine mesh or UFL of x.
        solution: Where u came from, or None for a known solution.
    """

    model: Model
    parent: np.ndarray
    u: Any
    solution: ec.Solution | None = None


@dataclass(frozen=True, eq=False)
class TrueErrors:
    """Hold errors in the energy norm [sqrt(force length)].

    Attributes:
        displacement: |u - u^| of each cell [sqrt(force length)].
        stress: |sigma - sigma^| of each cell.
        friction: The third term, ``2 int (b - b^)(|u_t - s| - |u^_t - s|)`` over
            contacts whose bound depends on the pressure [force length]; 0 without.
    """

    displacement: np.ndarray
    stress: np.ndarray
    friction: float

    @property
    def of_u(self) -> float:
        """Compute ``|u - u^|`` [sqrt(force length)]."""
        return float(np.linalg.norm(self.displacement))

    @property
    def of_both(self) -> float:
        """Compute ``sqrt(|u - u^|^2 + |sigma - sigma^|^2)`` [sqrt(force length)]."""
        return float(np.hypot(self.of_u, np.linalg.norm(self.stress)))

    @property
    def both(self) -> np.ndarray:
        """Compute the same of each cell [sqrt(force length)]."""
        return np.hypot(self.displacement, self.stress)


def nested(domain: ec.Domain, levels: int) -> tuple[ec.Domain, np.ndarray]:
    """Cut the mesh at the barycentres of its cells and refine it uniformly.

    Returns the mesh, and the old cell of each of its cells.
    """
    if domain.glued is not None and domain.interface_map is not None:
        return _nested_bodies(domain.glued, domain.interface_map, levels)
    mesh, d = domain.mesh, domain.dim
    x, cells = mesh.geometry.x[:, :d], cell_nodes(mesh.geometry)
    points = np.vstack([x, x[cells].mean(axis=1)])
    parts = np.repeat(cells.astype(np.int64)[:, None], d + 1, axis=1)
    parts[:, range(d + 1), range(d + 1)] = len(x) + np.arange(len(cells))[:, None]
    element = basix.ufl.element("Lagrange", mesh.basix_cell(), 1, shape=(d,))
    fine = dmesh.create_mesh(mesh.comm, parts.reshape(-1, d + 1), ufl.Mesh(element), points)
    tags = domain.facet_tags
    nodes = cpp.mesh.entities_to_geometry(mesh._cpp_object, d - 1, tags.indices, False).astype(
        np.int64
    )
    fine.topology.create_connectivity(d - 1, 0)
    fine.topology.create_connectivity(d - 1, d)
    found, values = distribute_entity_data(fine, d - 1, nodes, tags.values)
    facet_tags = dmesh.meshtags_from_entities(fine, d - 1, graph.adjacencylist(found), values)
    origin = (fine.topology.original_cell_index // (d + 1)).astype(np.int32)
    cell_tags = dmesh.meshtags(fine, d, np.arange(len(origin), dtype=np.int32), origin)
    places = None
    if domain.places is not None:
        # Corners of the parts are corners of the old cell, or its middle.
        known, own = (
            np.concatenate([of_cells, of_cells.mean(axis=1, keepdims=True)], axis=1)[origin]
            for of_cells in (x[cells], domain.places)
        )
        new = fine.geometry.x[cell_nodes(fine.geometry), :d]
        nearest = np.linalg.norm(known[:, None] - new[:, :, None], axis=3).argmin(axis=2)
        places = np.take_along_axis(own, nearest[..., None], axis=1)
    result = ec.Domain(fine, facet_tags, domain.names, cell_tags, places=places)
    for _ in range(levels):
        result = result.refined()
    assert result.cell_tags is not None
    return result, result.cell_tags.values


def _nested_bodies(
    glued: ec.Domain, interface_map: InterfaceMap, levels: int
) -> tuple[ec.Domain, np.ndarray]:
    """Do the same for bodies of one glued mesh, whose contacts are split again."""
    fine, origin = nested(glued, levels)
    assert glued.cell_tags is not None
    cells = np.arange(len(origin), dtype=np.int32)
    tags = tags_of(fine.mesh, fine.dim, cells, tag_table(glued.cell_tags)[origin])
    named = ec.Domain(
        fine.mesh, fine.facet_tags, fine.names, tags, glued.regions, places=fine.places
    )
    bodies = named.cut(interface_map.interfaces)
    assert bodies.interface_map is not None
    split_cell = np.empty_like(interface_map.cells)
    split_cell[interface_map.cells] = np.arange(len(interface_map.cells))
    return bodies, split_cell[origin[bodies.interface_map.cells]]


def reference(
    solution: ec.Solution, levels: int, degree: int | None = None, **options: Any
) -> Reference:
    """Compute the solution on the nested mesh.

    It is ``levels`` uniform refinements finer than the cut one.

    It has the degree of the solution, unless a higher one is given.
    """
    fine, origin = nested(solution.domain, levels)
    degree = degree or solution.model.space.degree
    options = {"method": ec.AugmentedLagrangian(), "start": solution, **options}
    found = ec.solve(solution.scene, fine, degree=degree, **options)
    return Reference(found.model, origin, found.u, found)


def known(solution: ec.Solution, u: Any) -> Reference:
    """Make a reference of a known displacement, a callable of x, on the cut mesh."""
    fine, origin = nested(solution.domain, 0)
    model = Model(solution.scene, fine, solution.model.space.degree)
    return Reference(model, origin, u(model.space.x))


def true_errors(pair: Admissible, exact: Reference) -> TrueErrors:
    """Compute the errors of a pair in each of its cells."""
    model, parent = exact.model, exact.parent
    hat = _displacement_on(pair, exact)
    degree = hat.function_space.element.basix_element.degree
    basis = mandel_basis(model.space.d)
    W = fem.functionspace(model.space.mesh, ("DG", degree, (len(basis),)))
    components = fem.Function(W)
    corners = W.tabulate_dof_coordinates()[W.dofmap.list][..., : model.space.d]
    components.x.array.reshape(-1, len(basis))[W.dofmap.list] = stress_at(pair, parent, corners)
    sigma = ufl.dot(components, ufl.as_tensor(basis.tolist()))
    material, values = model.material, model.parameters
    difference, rest = strain(exact.u) - strain(hat), model.stress(exact.u) - sigma
    of_cells = ufl.TestFunction(fem.functionspace(model.space.mesh, ("DG", 0)))
    squares = []
    for density in (
        ufl.inner(material.stress(difference, **values), difference),
        ufl.inner(material.compliance(rest, **values), rest),
    ):
        fine = fem.assemble_vector(fem.form(density * of_cells * model.space.dx)).array
        squares.append(np.bincount(parent, fine, pair.solution.domain.cells))
    return TrueErrors(np.sqrt(squares[0]), np.sqrt(squares[1]), _third_term(pair, exact, hat))


def _displacement_on(pair: Admissible, exact: Reference) -> fem.Function:
    """Interpolate u^ on the fine mesh, which represents it exactly."""
    V = exact.model.space.V
    hat = fem.Function(V)
    cell = np.empty(len(V.tabulate_dof_coordinates()), dtype=np.int32)
    cell[V.dofmap.list] = exact.parent[:, None]
    hat.x.array[:] = pair.displacement.eval(V.tabulate_dof_coordinates(), cell).ravel()
    return hat


def stress_at(pair: Admissible, parent: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Evaluate sigma^ in Mandel components at points of fine cells [force/area].

    The points x (n, q, d) lie within the cells ``parent``; the result has the shape (n,
    q, s).
    """
    cells, d, every = pair.cell_geometry, pair.cell_geometry.d, np.arange(len(parent))
    origin = pair.solution.model.space.V.tabulate_dof_coordinates()[:, :d][
        cells.vertices[parent, 0]
    ]
    local = np.einsum("nij,nqj->nqi", cells.inverse[parent], x - origin[:, None])
    local = np.concatenate([1 - local.sum(axis=2, keepdims=True), local], axis=2)
    k = local.mean(axis=1).argmin(axis=1)
    least = local[every, :, k]
    local -= least[..., None]
    local[every, :, k] = (d + 1) * least
    shape = bernstein(d, cells.degree, local[..., 1:].reshape(-1, d)).reshape(*local.shape[:2], -1)
    return np.einsum("nqm,nms->nqs", shape, pair.stress[parent, k])


def bound_at(pair: Admissible, which: int, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Evaluate the friction bound of r^ at points of the contact [force/area].

    The points x (f, q, d) lie in coarse cells; the result has the shape (f, q).
    """
    return _on_contact(pair, which, cell, x, pair.tractions[which].friction_bound)


def normal_traction_at(pair: Admissible, which: int, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Evaluate r^_n at points of the contact in the same way [force/area]."""
    return _on_contact(pair, which, cell, x, pair.tractions[which].normal_component)


def _on_contact(
    pair: Admissible, which: int, cell: np.ndarray, x: np.ndarray, coefficients: np.ndarray
) -> np.ndarray:
    """Evaluate polynomials on the facets of a contact, given by coefficients (n, m)."""
    traction, model = pair.tractions[which], pair.solution.model
    facet = np.zeros(model.domain.cells, dtype=int)
    facet[traction.contact.facets[:, 0]] = np.arange(len(traction.nodes))
    corners = model.space.V.tabulate_dof_coordinates()[:, : model.space.d][
        traction.nodes[facet[cell], : model.space.d]
    ]
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    local = np.einsum("fij,fqj->fqi", np.linalg.pinv(edges), x - corners[:, :1])
    shape = bernstein(
        model.space.d - 1, model.space.degree, local.reshape(-1, model.space.d - 1)
    ).reshape(*local.shape[:2], -1)
    return np.einsum("fqm,fm->fq", shape, coefficients[facet[cell]])


def _third_term(pair: Admissible, exact: Reference, hat: fem.Function) -> float:
    total, model = 0.0, exact.model
    points, weights = rule(model.space.d - 1, FACET_DEGREE)
    for which, contact in enumerate(model.contacts):
        if contact.friction is None or contact.friction.dependence == CONSTANT:
            continue
        assert exact.solution is not None, "a known solution whose friction depends on the pressure"
        n, facets = contact.direction[:, None, :], contact.facets
        r = model.space.evaluate(exact.solution.traction(contact), points, facets)
        x = model.space.evaluate(model.space.x, points, facets)
        parameters = friction_parameters(model.space, contact, points)
        bound = contact.friction_bound(np.maximum(-(r * n).sum(axis=-1), 0.0), parameters)
        bound = bound - bound_at(pair, which, exact.parent[facets[:, 0]], x)
        slips = []
        for u in (exact.u, hat):
            w = model.space.evaluate(contact.jump(u), points, facets)
            slips.append(np.linalg.norm(w - (w * n).sum(axis=-1, keepdims=True) * n, axis=-1))
        total += 2 * float(
            model.space.facet_areas(facets) @ ((bound * (slips[0] - slips[1])) @ weights)
        )
    return total


def rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Compute Spearman's correlation of the ranks of two arrays [-]."""
    return float(np.corrcoef(a.argsort().argsort(), b.argsort().argsort())[0, 1])
