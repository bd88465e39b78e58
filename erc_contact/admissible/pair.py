"""From a solution to an admissible pair: a displacement and a stress that satisfy all equations but Hooke's law.

The pair is (u^, sigma^) with the contact traction r^. The displacement satisfies u^ = U
on Gamma_D and u^_n <= g on Gamma_C. The stress is symmetric and in exact equilibrium
with the projections of the loads. On Gamma_C it satisfies sigma^ n = r^, and the
friction law allows r^. The error e (16) of this pair bounds its distance to the exact
solution, for any result of the contact solver.

Source: Coorevits, Hild, Hjiaj, equations (9), (10); Ladeveze, Leguillon (1983).
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI

from erc_contact.admissible.cells import (
    CellGeometry,
    cell_geometry,
    facet_forces,
    facet_order,
    force_coefficients,
    moments,
    signed,
)
from erc_contact.admissible.contact import admissible_tractions
from erc_contact.admissible.displacement import admissible_displacement
from erc_contact.admissible.elastic import cell_stress, elastic_stress, macro_moduli
from erc_contact.admissible.facets import divergence, equilibrated_moments
from erc_contact.admissible.loads import cell_forces, traction_moments
from erc_contact.admissible.macro import macro_stress
from erc_contact.admissible.tighten.complementary import relaxed
from erc_contact.admissible.tighten.iteration import TIGHTEN, tightened
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base import checks
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.simplex import coefficients, local_facet_nodes, mass
from erc_contact.model.model import Model
from erc_contact.newton.solution import Solution

BALANCED = 1e-12
"""Unbalanced nodal forces that count as round-off, over the forces of the stress [-]."""
SOLVES = 4
"""Greatest number of solves for unbalanced forces. One is usual, two if the body slides far."""
SHARE = 0.3
"""What such a solve may leave of :data:`BALANCED` [-]."""


@dataclass(frozen=True, eq=False)
class Admissible:
    """An admissible pair. Polynomials are given by Bernstein coefficients; for degree 1 these are the nodal values.

    Attributes:
        solution: The solution from which it was reconstructed.
        displacement: u^ [length], a continuous Function of degree k.
        tractions: r^ on each contact.
        cell_geometry: Vertices, facets and volumes of the cells.
        fe_stress: The rebalanced finite element stress, projected on polynomials of
            degree k-1 in each cell [force/area], shape (n, N_(k-1), d, d).
        stress: sigma^ of the owned cells in Mandel components, of degree k in the
            sub-simplices [force/area], shape (owned, d+1, N_k, s).
        facet_moments: Moments of the facet tractions on the first side of each facet
            [force], shape (facets, m, d).
        cell_forces: Body force times volume of each cell, projected on degree k-1
            [force], shape (n, N_(k-1), d), or None without body force.
        tightening: Number of iterations that tightened sigma^.
        seconds: Wall time, the largest over the ranks [s].

    Example:
        >>> admissible.stress.shape, admissible.displacement.x.array.size
        ((16, 3, 3, 3), 30)
    """

    solution: Solution
    displacement: fem.Function
    tractions: list[ContactTraction]
    cell_geometry: CellGeometry
    fe_stress: np.ndarray
    stress: np.ndarray
    facet_moments: np.ndarray
    cell_forces: np.ndarray | None
    tightening: int
    seconds: float

    def __repr__(self) -> str:
        """Tell what it is in a line; nothing is computed, so one rank alone may ask."""
        model = self.solution.model
        return (
            f"<Admissible pair of degree {model.degree} on {model.domain.cells} cells, {len(self.tractions)} contacts, "
            f"tightened {self.tightening} times>"
        )


def pair_of(result: Any) -> Admissible:
    """Return the pair itself, or that of an error, or that of the error of a history.

    Raises:
        InputError: If it is none of them.
    """
    error = getattr(result, "error", result)
    pair = getattr(error, "admissible", error)
    if not isinstance(pair, Admissible):
        raise InputError(
            f"The admissible pair is {checks.description(result)}; give a history, an error, or what equilibrate() "
            "returns."
        )
    return pair


def equilibrate(solution: Solution, tighten: int = TIGHTEN) -> Admissible:
    """Reconstruct an admissible pair from a solution; collective.

    Args:
        solution: Any state of the contact solver; the bound does not depend on its
            quality.
        tighten: Greatest number of iterations that tighten sigma^, 0 for none. They end
            when as many again, at the present pace, would lower e by less than 8%; 4 to
            8 are usual, 10 to 30 near incompressibility.

    Returns:
        The admissible pair.

    Raises:
        NotHeldError: If no contact traction that the law allows balances the loads on a
            free rigid motion.

    Example:
        >>> ec.equilibrate(solution)
        <Admissible pair of degree 1 on 16 cells, 1 contacts, tightened 4 times>
    """
    began = perf_counter()
    model = solution.model
    cells = cell_geometry(model)
    force = cell_forces(model, cells)
    hat, tractions, stress, moment, fixed = _before_tightening(solution, cells, force)
    count, iterations = model.domain.owned_cells, 0
    inner = model.degree > 1  # the bubbles are still to be chosen
    if tighten > 0 or inner:
        elastic = elastic_stress(model, cells, hat, count)
        compliance = macro_moduli(model, cells, len(cells.nodes), inverse=True)
    if tighten > 0:
        free = cells.has_second[:, None] | fixed
        moment, iterations = tightened(
            model, cells, moment, force, free, elastic, compliance, tighten
        )
    forces = force_coefficients(signed(cells, moment)[:count], model.degree)
    macro = macro_stress(cells, count, stress, forces, force)
    if inner:
        macro = relaxed(cells, macro, elastic, compliance)
    seconds = model.comm.allreduce(perf_counter() - began, MPI.MAX)
    return Admissible(
        solution, hat, tractions, cells, stress, macro, moment, force, iterations, seconds
    )


def _before_tightening(
    solution: Solution, cells: CellGeometry, force: np.ndarray | None
) -> tuple[fem.Function, list[ContactTraction], np.ndarray, np.ndarray, np.ndarray]:
    """Return the admissible pair before sigma^ is tightened, as facet tractions; collective.

    Returns:
        u^; r^ on each contact; the rebalanced stress [force/area], shape (n, N_(k-1),
        d, d); moments of facet tractions that balance every cell [force], shape
        (facets, m, d); which components of a facet a support fixes, shape (facets, d).
    """
    model = solution.model
    given, fixed = _loads(model, cells)
    tractions = admissible_tractions(
        model, solution, *_work(model, _nodal(model, cells, given, force))
    )
    as_it_is = (
        not tractions or solution.at_rest
    )  # the gap allows u at rest, also where facets do not carry it
    hat = solution.u if as_it_is else admissible_displacement(model, solution.u, tractions)
    for t in tractions:
        _add(model, given, t.contact.facets, moments(t.area, t.values, model.degree))
    stress = _rebalanced(solution, cells, _nodal(model, cells, given, force))
    complete = np.zeros(len(model.fixed), dtype=bool)
    complete[model.nodes[: model.domain.owned_cells]] = True
    return (
        hat,
        tractions,
        stress,
        equilibrated_moments(cells, stress, force, given, fixed, complete),
        fixed,
    )


def _loads(model: Model, cells: CellGeometry) -> tuple[np.ndarray, np.ndarray]:
    """The given tractions and the supports on facets; collective.

    Returns:
        Moments of the loads, projected on degree k [force], shape (facets, m, d), and
        which components of a facet a support fixes, shape (facets, d).
    """
    d = cells.d
    given = np.zeros((cells.side.shape[1], len(model.facet_points), d))
    fixed = np.zeros((cells.side.shape[1], d), dtype=bool)
    for load in model.surface_loads:
        facets = model.domain.facets(load.facets)
        _add(model, given, facets, traction_moments(model, facets, load.density))
    for facets, components in model.fixed_facets:
        fixed[model.facet_numbers(facets)] |= components
    given[np.broadcast_to(fixed[:, None, :], given.shape)] = 0.0
    return given, fixed


def _add(model: Model, given: np.ndarray, facets: np.ndarray, moment: np.ndarray) -> None:
    """Add moments of facets (cell, local facet) in place; their nodes are in the order of DOLFINx, not sorted."""
    order = facet_order(model.facet_nodes(facets)[:, : model.d], model.degree)
    given[model.facet_numbers(facets)] += np.take_along_axis(moment, order[:, :, None], axis=1)


def _nodal(
    model: Model, cells: CellGeometry, given: np.ndarray, force: np.ndarray | None
) -> fem.Function:
    """Nodal forces from moments on facets and cell forces [force], not yet summed over ranks."""
    d, k, owned = model.d, model.degree, model.domain.owned_cells
    b = model.function()
    nodal: Any = b.x.array.reshape(-1, d)
    first = cells.side[0]
    loaded = np.flatnonzero(given.any(axis=(1, 2)) & (first >= 0) & (first < owned * (d + 1)))
    cell, i = np.divmod(first[loaded], d + 1)
    on_facet = np.take_along_axis(cells.nodes[cell], local_facet_nodes(d, k)[i], axis=1)
    np.add.at(nodal, on_facet, np.matmul(coefficients(d - 1, k).T, given[loaded]))
    if force is not None:
        np.add.at(
            nodal,
            cells.nodes[:owned],
            np.matmul(coefficients(d, k).T @ mass(d, k, k - 1), force[:owned]),
        )
    return b


def _work(model: Model, b: fem.Function) -> tuple[np.ndarray, float]:
    """Work of nodal forces on the free motions [force], shape (motions,), and the sum of their sizes; collective."""
    local = np.array(
        [b.x.array @ motion.x.array for motion in model.free_motions] + [abs(b.x.array).sum()]
    )
    total = model.comm.allreduce(local, MPI.SUM)
    return total[:-1], float(total[-1])


def _rebalanced(solution: Solution, cells: CellGeometry, b: fem.Function) -> np.ndarray:
    """The finite element stress in exact discrete equilibrium with nodal forces b; collective.

    The stress of the contact solve is not: b has the admissible tractions. An elastic
    solve for the forces that are missing makes it so, with the factor or hierarchy of
    the contact solve. If displacements are large compared to the strains, as in a body
    that slides far, their round-off is not small compared to the forces, and another
    solve follows. A scene without contact, whose loads do not vary in space, needs
    none.

    Returns:
        Coefficients [force/area], shape (n, N_(k-1), d, d).
    """
    model = solution.model
    stress = cell_stress(model, cells, solution.u)
    for _ in range(SOLVES):
        rest, size = _residual(model, cells, b, stress)
        if size <= BALANCED:
            break
        enough = max(SHARE * BALANCED / size, np.finfo(float).eps)
        change = solution.stiffness.solve(rest, supports=False, tolerance=enough)
        stress += cell_stress(model, cells, change)
    solution.stiffness.free()
    return _of_owners(model, cells, stress)


def _of_owners(model: Model, cells: CellGeometry, stress: np.ndarray) -> np.ndarray:
    """The stress of each cell as its owner has computed it, also on the other ranks that have the cell.

    After a large slide the round-off of two ranks differs by more than the balance
    allows.
    """
    if model.comm.size == 1:
        return stress
    order = cells.order[:, :, None, None]  # the ranks do not agree on the order of the vertices
    shared = la.vector(model.mesh.topology.index_map(model.d), int(np.prod(stress.shape[1:])))
    theirs = shared.array.reshape(stress.shape)
    if stress.shape[1] == 1:
        theirs[:] = stress
    else:
        np.put_along_axis(theirs, order, stress, axis=1)
    shared.scatter_forward()
    return theirs.copy() if stress.shape[1] == 1 else np.take_along_axis(theirs, order, axis=1)


def _residual(
    model: Model, cells: CellGeometry, b: fem.Function, stress: np.ndarray
) -> tuple[fem.Function, float]:
    """Nodal forces b less those of a stress [force], not yet summed over ranks; collective.

    The second result is their greatest size over that of the forces of the stress on
    facets [-].
    """
    d, owned = model.d, model.domain.owned_cells
    rest, inside, push = (
        model.function(),
        divergence(d, model.degree),
        facet_forces(cells.area[:owned], stress[:owned]),
    )
    rest.x.array[:] = b.x.array
    of_cells = np.matmul(
        coefficients(d, model.degree).T @ inside, push.reshape(owned, inside.shape[1], d)
    )
    np.add.at(rest.x.array.reshape(-1, d), cells.nodes[:owned], of_cells)
    whole = rest.copy()
    whole.x.scatter_reverse(la.InsertMode.add)
    free = ~model.fixed[: model.V.dofmap.index_map.size_local].ravel()
    largest = np.array(
        [abs(whole.x.array[: len(free)][free]).max(initial=0.0), abs(push).max(initial=0.0)]
    )
    model.comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
    return rest, float(largest[0] / largest[1]) if largest[1] > 0 else 0.0
