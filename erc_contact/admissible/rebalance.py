"""Nodal forces, and the finite element stress in discrete equilibrium with them.

The stress of the contact solve balances the tractions of the contact method. An elastic
solve for the missing forces makes it balance the admissible ones.

Symbols: d dimension, k degree, m moments of a facet, n cells, N_(k-1) coefficients of a
polynomial of degree k-1 in a cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from scipy.linalg import block_diag  # type: ignore[import-untyped]

from erc_contact.admissible.across import Across
from erc_contact.admissible.balance_parts import Motion, OtherForces, UnitJump
from erc_contact.admissible.cells import CellGeometry, facet_forces
from erc_contact.admissible.elastic import CellStress, cell_stress
from erc_contact.admissible.facets import divergence
from erc_contact.admissible.springs import (
    motions_off_springs,
    spring_moments,
    spring_stiffness,
    spring_tractions,
)
from erc_contact.model.given_forces import given_forces
from erc_contact.model.model import Model
from erc_contact.model.motions.held_motions import held_products
from erc_contact.model.motions.rigid_motions import greatest_of_bodies, motions_not_held
from erc_contact.model.motions.unheld import is_round_off, taking_up, works_on
from erc_contact.model.preload import motions_of_halves
from erc_contact.model.space import Space
from erc_contact.newton.linear.solver import ElasticSolver
from namedmesh.simplex import coefficients, local_facet_nodes, mass, nodes

FORCE_ROUND_OFF = 1e-12
"""Unbalanced nodal forces that are round-off, over the forces of the stress [-]."""
BALANCE_SOLVES = 4
"""Greatest number of solves for unbalanced forces.

One is usual, two if the body slides far.
"""
OSCILLATING_SHARE = 0.01
"""Share of a pressure down to which forces are balanced to :data:`FORCE_ROUND_OFF` [-].

More digits than these a solve does not have.
"""
SOLVE_SHARE = 0.3
"""What such a solve may leave of :data:`FORCE_ROUND_OFF` [-]."""


def nodal_forces(
    space: Space, cells: CellGeometry, moments: np.ndarray, force: np.ndarray | None
) -> fem.Function:
    """Assemble nodal forces from moments on facets and cell forces [force].

    They are not yet summed over ranks.

    Args:
        space: The mesh.
        cells: Geometry, n cells.
        moments: Moments of tractions on facets [force], shape (facets, m, d).
        force: Body force times volume of each cell [force], shape (n, N_(k-1), d), or
            None.
    """
    d, k = space.d, space.degree
    owned = space.domain.owned_cells
    b = space.function()
    nodal = b.x.array.reshape(-1, d)
    # The rank that owns the first cell of a facet adds its force, and no other one.
    first = cells.side[0]
    is_owned = (first >= 0) & (first < owned * (d + 1))
    loaded = np.flatnonzero(moments.any(axis=(1, 2)) & is_owned)
    cell, i = np.divmod(first[loaded], d + 1)
    facet_nodes = np.take_along_axis(cells.nodes[cell], local_facet_nodes(d, k)[i], axis=1)
    on_facets = np.matmul(coefficients(d - 1, k).T, moments[loaded])
    np.add.at(nodal, facet_nodes, on_facets)
    if force is not None:
        to_nodes = coefficients(d, k).T @ mass(d, k, k - 1)
        np.add.at(nodal, cells.nodes[:owned], np.matmul(to_nodes, force[:owned]))
    return b


def load_forces(
    model: Model, cells: CellGeometry, moments: np.ndarray, force: np.ndarray | None
) -> fem.Function:
    """Add the forces of rigid faces to the nodal forces of :func:`nodal_forces`."""
    b = nodal_forces(model.space, cells, moments, force)
    if model.face_forces is not None:
        b.x.array[:] += model.face_forces.x.array
    return b


def balanced_forces(
    model: Model,
    cells: CellGeometry,
    loads: np.ndarray,
    fixed: np.ndarray,
    force: np.ndarray | None,
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Balance projected loads on motions that nothing holds; collective.

    A body force that is projected on constants has another moment, and adapted
    integrals have other digits than the quadrature of the solver.

    Args:
        model: The scene on a mesh.
        cells: Geometry, n cells.
        loads: Moments of the loads [force], shape (facets, m, d).
        fixed: Which components of a facet supports take up, shape (facets, d).
        force: Body force times volume of each cell [force], shape (n, N_(k-1), d), or
            None.

    Returns:
        The body force that is in balance, and what it has more [force/volume], constant
        in cells, shape (n, d); None without.
    """
    space = model.space
    functions = model.unheld.functions
    if not functions:
        return force, None
    b = load_forces(model, cells, np.where(fixed[:, None, :], 0.0, loads), force)
    works, sizes = works_on(space, functions, b)
    if is_round_off(works, sizes):
        return force, None
    relief = taking_up(space, functions, works)
    shape = (len(cells.volume), len(nodes(space.d, space.degree - 1)), space.d)
    before = np.zeros(shape) if force is None else force
    return before + (relief * cells.volume[:, None])[:, None], relief


def other_forces(
    model: Model,
    cells: CellGeometry,
    loads: np.ndarray,
    fixed: np.ndarray,
    force: np.ndarray | None,
    u: fem.Function,
    bolts: Mapping[str, float],
) -> OtherForces:
    """Compute what contact tractions have to balance on rigid motions; collective.

    These are the loads, the forces of preloads on halves of bolts, the given forces of
    periodic sides on their jumps, and on motions that springs alone hold their pull at
    u, too. It is in balance with the method's own
    contact forces. If r^ has another resultant or moment, the springs have to take up
    the difference. It is small, but costs soft springs much.

    Args:
        model: The scene on a mesh.
        cells: Geometry, n cells.
        loads: Moments of the loads [force], shape (facets, m, d).
        fixed: Which components of a facet supports and stiff springs take up, shape
            (facets, d).
        force: Body force times volume of each cell [force], shape (n, N_(k-1), d), or
            None.
        u: Displacement of the contact solve [length].
        bolts: Forces that sigma^ has in bolts, by the names of preloads [force].
    """
    motions = model.free_motions
    with_springs = bool(model.springs and model.contacts)
    if with_springs:
        values = model.unheld.motions_of_bodies.values
        fixed = model.held_or_anchored
        held = held_products(model.space, model.bodies, values, fixed, faces=model.loose_faces)
        motions = motions_not_held(model.space, model.bodies[0], values, held)
    of_halves, works_on_halves = motions_of_halves(model, bolts)
    of_sides, works_of_sides = _jumps_of_sides(model)
    if not motions and not of_halves and not of_sides:
        return OtherForces([], np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), 0.0)
    if with_springs:
        # On motions that no support holds, loads on supports do no work.
        boundary = loads + spring_moments(model, spring_tractions(model, u))
    else:
        boundary = np.where(fixed[:, None, :], 0.0, loads)
    b = load_forces(model, cells, boundary, force)
    works = [b.x.array @ motion.x.array for motion in motions]
    local = np.array([*works, abs(b.x.array).sum()])
    total = model.space.comm.allreduce(local, MPI.SUM)
    motions = [*motions, *of_halves]
    works = [*total[:-1], *works_on_halves, *works_of_sides]
    size = float(total[-1]) + float(np.sum(np.abs([*works_on_halves, *works_of_sides])))
    # Springs do no work on a jump of periodic sides.
    every = np.eye(len(of_sides))
    stiffness = block_diag(spring_stiffness(model, motions), 0.0 * every)
    free = block_diag(motions_off_springs(model, motions), every)
    return OtherForces([*motions, *of_sides], np.array(works), stiffness, free, size)


def _jumps_of_sides(model: Model) -> tuple[list[UnitJump], list[float]]:
    """Return jumps of periodic sides with given forces, and their works; collective."""
    jumps = []
    works = []
    for given in given_forces(model.scene, model):
        if given.of_sides:
            # The traction is on the first side, the force on the other one.
            jumps.append(UnitJump(given.contact, given.direction))
            works.append(given.force)
    return jumps, works


@dataclass(frozen=True, eq=False)
class Rebalanced:
    """Hold the stress in equilibrium with admissible tractions, and what it took.

    Attributes:
        stress: The stress in each cell.
        displacement: The displacement whose stress it is [length]; springs pull there.
        missing: Nodal forces that the contact solve leaves, not summed over ranks
            [force]; None where it leaves round-off.
        change: The displacement by them [length], likewise.
    """

    stress: CellStress
    displacement: fem.Function
    missing: fem.Function | None
    change: fem.Function | None


def rebalanced_stress(
    model: Model,
    elastic: ElasticSolver,
    cells: CellGeometry,
    u: fem.Function,
    b: fem.Function,
    motions: Sequence[Motion],
) -> Rebalanced:
    """Compute the stress in exact discrete equilibrium with nodal forces b; collective.

    The stress of the contact solve is not: b has the admissible tractions. An elastic
    solve for the forces that are missing makes it so, with the factor or hierarchy of
    the contact solve. If displacements are large compared to the strains, as in a body
    that slides far, their round-off is not small compared to the forces, and another
    solve follows. A scene without contact, whose loads do not vary in space, needs
    none. Between copies of a body b gets the forces by which what moves fits.

    Args:
        model: The scene on a mesh.
        elastic: The elastic solver of the contact solve.
        cells: Geometry, n cells.
        u: Displacement of the contact solve [length].
        b: Nodal forces, not yet summed over ranks [force].
        motions: What the tractions of b balance.
    """
    stress = cell_stress(model, cells, u)
    balanced = u
    if model.springs:
        balanced = u.copy()
    missing = None
    first = None
    with elastic.in_memory():
        for _ in range(BALANCE_SOLVES):
            forces = b
            if model.springs:
                pulled = spring_moments(model, spring_tractions(model, balanced))
                forces = nodal_forces(model.space, cells, pulled, None)
                forces.x.array[:] += b.x.array
            residual, size = _residual(model, cells, forces, stress)
            if size <= FORCE_ROUND_OFF:
                break
            tolerance = max(SOLVE_SHARE * FORCE_ROUND_OFF / size, np.finfo(float).eps)
            change = elastic.solve(residual, supports=False, tolerance=tolerance)
            if missing is None and model.domain.periodic:
                between, moved = Across(model, motions).forces(elastic, _sum(u, change))
                b, change = _sum(b, between), _sum(change, moved)
            if missing is None:
                missing, first = residual, change
            stress = stress.plus(cell_stress(model, cells, change, change=True))
            if model.springs:
                balanced.x.array[:] += change.x.array
    return Rebalanced(_stress_of_owners(model.space, cells, stress), balanced, missing, first)


def _sum(first: fem.Function, second: fem.Function) -> fem.Function:
    """Return the sum of two displacements, or of two vectors of nodal forces."""
    total = first.copy()
    total.x.array[:] += second.x.array
    return total


def _stress_of_owners(space: Space, cells: CellGeometry, stress: CellStress) -> CellStress:
    """Return the stress of each cell as its owner has computed it; collective.

    After a large slide the round-off of two ranks differs by more than the balance
    allows. So a rank that has the cell as a ghost takes the stress of the owner.
    """
    if space.comm.size == 1:
        return stress
    return stress.of_owners(partial(_values_of_owners, space), cells)


def _values_of_owners(space: Space, values: np.ndarray, order: np.ndarray | None) -> np.ndarray:
    """Return values of cells as their owners have them; collective.

    The ranks do not agree on the order of the vertices that sorts them, but on
    DOLFINx's order, in which the values are sent.

    Args:
        space: The mesh.
        values: Values at nodes of the cells, shape (n, nodes, ...).
        order: Place of each node in DOLFINx's order, shape (n, nodes); None for one
            value a cell.
    """
    vector = la.vector(space.mesh.topology.index_map(space.d), int(np.prod(values.shape[1:])))
    shared = vector.array.reshape(values.shape)
    if order is None:
        shared[:] = values
        vector.scatter_forward()
        return shared.copy()
    places = order.reshape(*order.shape, *[1] * (values.ndim - 2))
    np.put_along_axis(shared, places, values, axis=1)
    vector.scatter_forward()
    return np.take_along_axis(shared, places, axis=1)


def _residual(
    model: Model, cells: CellGeometry, b: fem.Function, stress: CellStress
) -> tuple[fem.Function, float]:
    """Subtract the nodal forces of a stress from b [force]; collective.

    Returns:
        The difference, not yet summed over ranks, and its greatest size over the
        greatest force of b or, see :func:`_forces_that_stay`, of the stress on a facet
        in the same body [-].
    """
    space = model.space
    d, k = space.d, space.degree
    owned = model.domain.owned_cells
    to_cells = divergence(d, k)
    on_facets = facet_forces(cells.area[:owned], stress.in_plane[:owned])
    by_cell = on_facets.reshape(owned, to_cells.shape[1], d)
    of_cells = np.matmul(coefficients(d, k).T @ to_cells, by_cell)
    stress.pull(of_cells, coefficients(d, k))
    residual = space.function()
    residual.x.array[:] = b.x.array
    np.add.at(residual.x.array.reshape(-1, d), cells.nodes[:owned], of_cells)

    # Only sums over all ranks tell the size. Reactions of the supports are no residual.
    total = residual.copy()
    total.x.scatter_reverse(la.InsertMode.add)
    nodal = total.x.array.reshape(-1, d)
    bodies = model.bodies
    nodes = np.arange(space.V.dofmap.index_map.size_local)
    left = np.where(model.supported[nodes], 0.0, abs(nodal[nodes]))
    unbalanced = greatest_of_bodies(space.comm, bodies, nodes, left)
    loads = np.where(model.supported, 0.0, abs(b.x.array.reshape(-1, d)))
    of_loads = greatest_of_bodies(space.comm, bodies, np.arange(len(loads)), loads)
    forces = _forces_that_stay(cells, stress.in_plane[:owned], on_facets)
    of_stress = greatest_of_bodies(space.comm, bodies, cells.nodes[:owned, 0], forces)
    greatest = np.maximum(of_loads, of_stress)
    for face in model.loose_faces:
        # On the free motions of a face its resultants and the reactions do no work.
        of_face = (face.work(nodal) / face.sizes)[face.free]
        number = face.body(bodies[0])
        unbalanced[number] = max(unbalanced[number], abs(of_face).max(initial=0.0))
    # One solve is for all bodies: the greatest forces set its last digits.
    greatest = np.maximum(greatest, np.finfo(float).eps / FORCE_ROUND_OFF * greatest.max())
    sizes = np.divide(unbalanced, greatest, out=np.zeros_like(greatest), where=greatest > 0)
    return residual, float(sizes.max())


def _forces_that_stay(cells: CellGeometry, stress: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the size of forces of a stress on facets that sigma^ has, too [force].

    In nearly incompressible cells the pressure of the displacement oscillates, a
    thousand times as large as what is left of it in sigma^. So the size is the force of
    the deviator, in the unit in which a uniaxial stress has all of its force.

    Args:
        cells: Geometry.
        stress: Coefficients of the stress [force/area], shape (n, b, d, d).
        forces: Its forces on facets [force], shape (n, d+1, b, d).
    """
    d = cells.d
    # The force of a pressure is the pressure times the area vector of the facet.
    pressure = np.trace(stress, axis1=2, axis2=3)[:, None, :, None] / d
    deviator = abs(forces - pressure * cells.area[: len(stress), :, None])
    deviator *= d / (d - 1)
    return np.maximum(deviator, OSCILLATING_SHARE * abs(forces))
