"""From a solution to an admissible pair: a displacement and a stress that satisfy all but the constitutive law.

The pair (u^, sigma^) with the contact traction r^: u^ = U on Gamma_D and u^_n <= g on Gamma_C; sigma^ is symmetric,
in exact equilibrium with the data's projections, sigma^ n = r^ on Gamma_C with r^ in the Coulomb cone. Whatever the
contact solver did, e (16) of this pair bounds its error.

Source: Coorevits, Hild, Hjiaj, equations (9), (10); Ladeveze, Leguillon (1983).
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.contact import ContactTraction, admissible_tractions
from erc_contact.admissible.displacement import admissible_displacement
from erc_contact.admissible.facets import equilibrated_moments
from erc_contact.admissible.geometry import Simplices, facet_order, moments, nodal_forces, signed, simplices
from erc_contact.admissible.macro import macro_points, macro_stress, mandel, mandel_basis, tensors
from erc_contact.admissible.tighten import tightened
from erc_contact.model import DATA_DEGREE, Model, evaluate, facet_rule, facet_vertices
from erc_contact.solve import Solution


@dataclass(frozen=True, eq=False)
class Admissible:
    """An admissible pair.

    Attributes:
        solution: Where it came from.
        displacement: u^ [length], a continuous P1 Function.
        tractions: r^ on each contact.
        cells: Geometry of the cells.
        fe_stress: The rebalanced finite element stress, mean of each cell [force/area], shape (n, d, d).
        stress: sigma^ of the owned cells in Mandel components at the nodes of the sub-simplices [force/area],
            shape (owned, d+1, d+1, s).
        moment: Moments of the facet tractions on the first side of each facet [force], shape (facets, d, d).
        force: Total body force of each cell [force], shape (n, d), or None without body force.
        tightening: Iterations done to tighten sigma^.
        seconds: Wall time, the largest over the ranks [s].
    """

    solution: Solution
    displacement: fem.Function
    tractions: list[ContactTraction]
    cells: Simplices
    fe_stress: np.ndarray
    stress: np.ndarray
    moment: np.ndarray
    force: np.ndarray | None
    tightening: int
    seconds: float


def equilibrate(solution: Solution, tighten: int = 0) -> Admissible:
    """Reconstruct an admissible pair from a solution; collective.

    Args:
        solution: Any state of the contact solver; the bound does not depend on its quality.
        tighten: At most so many iterations that tighten sigma^ (they end when one gains little: 4 to 8 of 10 are
            done); 0 for none.

    Returns:
        The admissible pair.

    Raises:
        NotHeldError: If no traction in the friction cone balances the loads on a free rigid motion.
    """
    began = perf_counter()
    model = solution.model
    cells = simplices(model)
    force = _cell_forces(model, cells)
    given, fixed = _loads(model, cells)
    on_motions = _work(model, _nodal(model, cells, given, force))
    tractions = admissible_tractions(model, solution, on_motions)
    hat = admissible_displacement(model, solution.u, tractions) if tractions else solution.u
    for t in tractions:
        _add(model, given, t.contact.facets, moments(t.area, t.values))
    stress = cell_stress(model, cells, _rebalanced(solution, _nodal(model, cells, given, force)))
    complete = np.zeros(len(model.fixed), dtype=bool)
    complete[model.nodes[: model.domain.owned_cells]] = True
    moment = equilibrated_moments(cells, stress, force, given, fixed, complete)
    count, iterations = model.domain.owned_cells, 0
    if tighten > 0:
        elastic = np.matmul(macro_moduli(model, count), strains(cells, hat)[:count, None, :, None])[..., 0]
        compliance = macro_moduli(model, len(cells.nodes), inverse=True)
        free = cells.has_second[:, None] | fixed
        moment, iterations = tightened(model, cells, moment, force, free, elastic, compliance, tighten)
    forces = nodal_forces(signed(cells, moment)[:count])
    macro = macro_stress(cells, count, stress, forces, force)
    seconds = model.comm.allreduce(perf_counter() - began, MPI.MAX)
    return Admissible(solution, hat, tractions, cells, stress, macro, moment, force, iterations, seconds)


def strains(cells: Simplices, u: fem.Function) -> np.ndarray:
    """Strain of a P1 displacement in Mandel components, shape (n, s)."""
    values = u.x.array.reshape(-1, cells.d)[cells.nodes]
    gradient = np.matmul((values[:, 1:] - values[:, :1]).transpose(0, 2, 1), cells.inverse)
    return mandel(0.5 * (gradient + gradient.transpose(0, 2, 1)))


def moduli(model: Model, points: np.ndarray, count: int, *, inverse: bool = False) -> np.ndarray:
    """The elasticity (or compliance) matrix in Mandel components at reference points of the cells.

    Args:
        model: The scene on a mesh.
        points: Reference points (q, d).
        count: The first ``count`` cells are done.
        inverse: Compliance C^-1 [area/force] instead of stiffness C [force/area].

    Returns:
        Shape (count, q, s, s), with 1 in place of count or q where the material does not vary.
    """
    material, basis = model.scene.material, mandel_basis(model.d)
    act = material.compliance if inverse else material.stress
    images = [act(ufl.as_tensor(b.tolist()), **model.parameters) for b in basis]
    matrix = ufl.as_matrix([[ufl.inner(ufl.as_tensor(a.tolist()), image) for image in images] for a in basis])
    varies = ufl.algorithms.extract_type(matrix, ufl.classes.SpatialCoordinate)
    if varies:
        return evaluate(matrix, model.domain, points, np.arange(count, dtype=np.int32))
    per_cell = ufl.algorithms.extract_coefficients(matrix)
    number = count if per_cell else min(count, 1)
    return evaluate(matrix, model.domain, points[:1], np.arange(number, dtype=np.int32))


def macro_moduli(model: Model, count: int, *, inverse: bool = False) -> np.ndarray:
    """Elasticity (or compliance) matrices at the points of the sub-simplices, in the order of sorted vertices.

    Args:
        model: The scene on a mesh.
        count: The first ``count`` cells are done.
        inverse: Compliance instead of stiffness.

    Returns:
        Shape (count, (d+1)^2, s, s), with 1 in place of either number where the material does not vary.
    """
    values = moduli(model, macro_points(model.d)[1], count, inverse=inverse)
    if values.shape[1] == 1:
        return values
    n = model.d + 1
    order = np.argsort(model.nodes[:count], axis=1)
    place = (order[:, :, None] * n + order[:, None, :]).reshape(count, n * n)
    return np.take_along_axis(values, place[:, :, None, None], axis=1)


def cell_stress(model: Model, cells: Simplices, u: fem.Function) -> np.ndarray:
    """Mean of ``C eps(u)`` in each cell: it tests against P1 fields as the stress itself, shape (n, d, d)."""
    points, weights = basix.make_quadrature(model.mesh.basix_cell(), DATA_DEGREE)
    stiffness = np.einsum("nqab,q->nab", moduli(model, points, len(cells.nodes)), weights / weights.sum())
    return tensors(np.matmul(stiffness, strains(cells, u)[:, :, None])[..., 0], cells.d)


def _cell_forces(model: Model, cells: Simplices) -> np.ndarray | None:
    """Total body force of each cell, the projection of f on constants [force], shape (n, d)."""
    if model.body_force is None:
        return None
    points, weights = basix.make_quadrature(model.mesh.basix_cell(), DATA_DEGREE)
    values = evaluate(model.body_force, model.domain, points, np.arange(len(cells.nodes), dtype=np.int32))
    return np.einsum("nqi,q->ni", values, weights / weights.sum()) * cells.volume[:, None]


def _loads(model: Model, cells: Simplices) -> tuple[np.ndarray, np.ndarray]:
    """Moments of the loads on each facet, projected on linear functions, and the fixed components of facets."""
    d = cells.d
    given = np.zeros((cells.side.shape[1], d, d))
    fixed = np.zeros((cells.side.shape[1], d), dtype=bool)
    points, weights, shape = facet_rule(d, DATA_DEGREE)
    weighted = weights[:, None] * shape
    for name, _, traction in model.tractions:
        facets = model.domain.facets(name)
        values = evaluate(traction, model.domain, points, facets)
        area = model.facet_areas(facets)
        _add(model, given, facets, np.einsum("qm,fqi->fmi", weighted, values) * area[:, None, None])
    for facets, components in model.fixed_facets:
        fixed[_numbers(model, facets)] |= components
    given[np.broadcast_to(fixed[:, None, :], given.shape)] = 0.0
    return given, fixed


def _numbers(model: Model, facets: np.ndarray) -> np.ndarray:
    """Indices of facets given as (cell, local facet), shape (n,)."""
    of_cell = model.mesh.topology.connectivity(model.d, model.d - 1).array.reshape(-1, model.d + 1)
    return of_cell[facets[:, 0], facets[:, 1]]


def _add(model: Model, given: np.ndarray, facets: np.ndarray, moment: np.ndarray) -> None:
    """Add moments at the nodes of facets, from the order of DOLFINx to the sorted one."""
    order = facet_order(model.facet_nodes(facets))
    given[_numbers(model, facets)] += np.take_along_axis(moment, order[:, :, None], axis=1)


def _nodal(model: Model, cells: Simplices, given: np.ndarray, force: np.ndarray | None) -> fem.Function:
    """Nodal forces of moments on facets and of cell forces, not yet summed over ranks [force]."""
    d, owned = model.d, model.domain.owned_cells
    b = fem.Function(model.V)
    nodal: Any = b.x.array.reshape(-1, d)
    first = cells.side[0]
    loaded = np.flatnonzero(given.any(axis=(1, 2)) & (first >= 0) & (first < owned * (d + 1)))
    cell, i = np.divmod(first[loaded], d + 1)
    np.add.at(nodal, np.take_along_axis(cells.nodes[cell], facet_vertices(d)[i], axis=1), given[loaded])
    if force is not None:
        np.add.at(nodal, cells.nodes[:owned], np.broadcast_to(force[:owned, None] / (d + 1), (owned, d + 1, d)))
    return b


def _work(model: Model, b: fem.Function) -> np.ndarray:
    """Work of nodal forces on the free motions, all ranks [force], shape (motions,)."""
    local = np.array([b.x.array @ motion.x.array for motion in model.free_motions])
    return model.comm.allreduce(local, MPI.SUM)


def _rebalanced(solution: Solution, b: fem.Function) -> fem.Function:
    """The finite element displacement under nodal forces, in exact discrete equilibrium, with the factor at hand.

    A linear scene whose loads do not vary in space is in equilibrium with them already.
    """
    model = solution.model
    loads = model.loads(ufl.TestFunction(model.V))
    varies = loads is not None and ufl.algorithms.extract_type(loads, ufl.classes.SpatialCoordinate)
    u = solution.stiffness.solve(b) if model.contacts or varies else solution.u
    solution.stiffness.free()
    return u
