"""Reconstruct an admissible pair from a solution: a displacement and a stress.

Source: Coorevits, Hild, Hjiaj, equations (9), (10); Ladeveze, Leguillon (1983).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import comb
from time import perf_counter
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.axisymmetric.bulk import axisymmetric_bulk
from erc_contact.admissible.balance_parts import Motion, TooCoarse
from erc_contact.admissible.bulk import plane_bulk
from erc_contact.admissible.cells import (
    CellGeometry,
    add_moments,
    cell_geometry,
    moments,
    tractions_of,
    values_on,
)
from erc_contact.admissible.contact import admissible_tractions, no_traction
from erc_contact.admissible.displacement import admissible_displacement
from erc_contact.admissible.elastic import CellStress
from erc_contact.admissible.imbalance import Given, proved_imbalance
from erc_contact.admissible.loads import cell_forces, load_moments
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.rebalance import (
    Rebalanced,
    balanced_forces,
    load_forces,
    other_forces,
    rebalanced_stress,
)
from erc_contact.admissible.reconstruction import Reconstruction
from erc_contact.admissible.shared_moments import SharedMoments
from erc_contact.admissible.soft_contacts import with_soft_contacts
from erc_contact.admissible.springs import (
    chosen_tractions,
    spring_moments,
    spring_tractions,
    supported_components,
)
from erc_contact.admissible.surrounded import surrounded
from erc_contact.admissible.tighten.iteration import TIGHTEN
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.exceptions import NotBalanced
from erc_contact.model.space import Space
from erc_contact.newton.solution import Solution
from erc_contact.scene.tied import Preload


def equilibrate(solution: Solution, tighten: int = TIGHTEN) -> Admissible:
    """Reconstruct an admissible pair from a solution; collective.

    Args:
        solution: Any state of the contact solver; the bound does not depend on its
            quality.
        tighten: Greatest number of iterations that tighten sigma^: they minimise its
            complementary energy in equilibrium. 0 for none. They end when as many
            again, at the present pace, would lower e by less than 8%; 4 to 8 are usual,
            10 to 30 near incompressibility, 150 to 500 where edges of a cell differ by
            a factor of a thousand. Plastic bodies take further rounds, 20 to 500
            iterations.

    Returns:
        The admissible pair.

    Raises:
        NotHeldError: If no contact traction that the law allows balances the loads on a
            free rigid motion.
        NotBalanced: If sigma^ is not in equilibrium, see
            ``erc_contact.admissible.imbalance``.

    Example:
        >>> ec.equilibrate(solution)
        <Admissible pair of degree 1 on 16 cells, 1 contacts, tightened 4 times>
    """
    return equilibrated(solution, tighten, None)


def equilibrated(
    solution: Solution, tighten: int, near: Admissible | None, *, is_own: bool = True
) -> Admissible:
    """Reconstruct an admissible pair, as :func:`equilibrate` does; collective.

    Args:
        solution: Any state of the contact solver.
        tighten: Greatest number of iterations that tighten sigma^.
        near: The pair of a scene on the same mesh that is nearly this one, with the
            same supports. Tightening starts from what it has added there. It ends after
            few iterations, and the difference of both stresses is as tight as they are.
        is_own: Whether the contact tractions come from the displacement. Otherwise they
            keep their own resultants.
    """
    began = perf_counter()
    model = solution.model
    cells = cell_geometry(model.space)
    if solution.at_rest:
        pair = _at_rest(solution, cells)
        return replace(pair, seconds=model.space.comm.allreduce(perf_counter() - began, MPI.MAX))
    force = cell_forces(model, cells)
    loads = load_moments(model, cells)
    fixed = supported_components(model, cells)
    force, relief = balanced_forces(model, cells, loads, fixed, force)
    data = _Data(solution, cells, surrounded(model, cells), force, relief, loads, fixed)
    bolts = _forces_of_bolts(solution)
    others = other_forces(model, cells, loads, fixed, force, solution.u, bolts)
    try:
        tractions = admissible_tractions(model, solution, others)
    except TooCoarse:
        if not bolts:
            raise
        # The law may leave too little for the forces of bolts.
        others = other_forces(model, cells, loads, fixed, force, solution.u, {})
        tractions = admissible_tractions(model, solution, others)
    made = _make_pair(data, tractions, others.motions, tighten, near)
    pair = made.pair
    kept = None
    if is_own:
        at_contacts = [r for r in pair.tractions if not r.contact.is_periodic]
        kept = with_soft_contacts(model, others, at_contacts, made.balanced, made.bulk)
    if kept is not None:
        # The first pair stands where the law leaves too little for the free motions
        # beside the resultants, and where the stress is not in equilibrium.
        with suppress(TooCoarse, NotBalanced):
            tractions = admissible_tractions(model, solution, kept)
            again = _make_pair(data, tractions, others.motions, tighten, near)
            pair = again.pair if again.bulk < made.bulk else pair
    seconds = model.space.comm.allreduce(perf_counter() - began, MPI.MAX)
    return replace(pair, seconds=seconds)


def _forces_of_bolts(solution: Solution) -> dict[str, float]:
    """Return the forces of preloads that sigma^ should have [force]; collective.

    They are the given ones, and in a bolt that is locked after them the forces of the
    solution: the shift was found by the stiffness of this mesh, so that its force with
    the exact stiffness is another one. Where the shift itself is given it tells the
    force, and sigma^ is free to come nearer.
    """
    forces = {}
    for tie in solution.scene.ties:
        if not isinstance(tie, Preload):
            continue
        if tie.force is not None:
            forces[tie.facets] = float(tie.force)
        elif tie.locked:
            forces[tie.facets] = solution.bolt_force(tie.facets)
    return forces


def _at_rest(solution: Solution, cells: CellGeometry) -> Admissible:
    """Return the pair of a body at rest, without stress and tractions; collective.

    What loads it has are round-off of its history. Supports and gap allow u, also where
    facets do not represent the gap.
    """
    model = solution.model
    space = model.space
    cell_count = len(cells.nodes)
    moment = np.zeros((space.facet_count, len(space.facet_points), space.d))
    d, k = space.d, space.degree
    fe_stress = np.zeros((cell_count, comb(k - 1 + d, d), d, d))
    components = model.constitution.metric.size
    sigma = np.zeros((space.domain.owned_cells, d + 1, comb(k + d, d), components))
    return Admissible(
        solution=solution,
        displacement=solution.u,
        tractions=[no_traction(space, contact) for contact in model.contacts],
        spring_tractions=chosen_tractions(model, moment, moment),
        cell_geometry=cells,
        balanced=CellStress(fe_stress),
        stress=sigma,
        facet_moments=moment,
        cell_forces=None,
        relief=None,
        tightening=0,
        correction=None,
        imbalance=0.0,
        seconds=0.0,
    )


@dataclass(frozen=True, eq=False)
class _Data:
    """Hold what each pair of a solution is made from.

    Attributes:
        solution: The state.
        cells: Geometry, n cells.
        around: The same with images of cells around them.
        force: Body force times volume of each cell [force], or None.
        relief: What it has more than the loads [force/volume], or None.
        loads: Moments of the loads on all facets [force], shape (facets, m, d).
        fixed: Which components of a facet have any traction, shape (facets, d).
    """

    solution: Solution
    cells: CellGeometry
    around: CellGeometry
    force: np.ndarray | None
    relief: np.ndarray | None
    loads: np.ndarray
    fixed: np.ndarray


class _Made(NamedTuple):
    """Hold a pair, and what it was made from.

    Attributes:
        pair: The pair.
        balanced: The rebalanced stress.
        bulk: Bound of the bulk part of e^2 before bubbles are chosen [force length];
            infinite where nothing was tightened.
    """

    pair: Admissible
    balanced: Rebalanced
    bulk: float


def _make_pair(
    data: _Data,
    tractions: list[ContactTraction],
    motions: list[Motion],
    tighten: int,
    near: Admissible | None,
) -> _Made:
    """Reconstruct a pair with given contact tractions; collective.

    Args:
        data: The solution with its loads.
        tractions: r^ on each contact.
        motions: What they balance.
        tighten: Greatest number of iterations that tighten sigma^.
        near: See :func:`equilibrated`.
    """
    cells = data.cells
    model = data.solution.model
    u = data.solution.u
    u_hat = u
    if tractions:
        if model.space.comm.size > 1:
            tractions = _of_owners(model.space, cells, tractions)
        u_hat = admissible_displacement(model, u, tractions)
    boundary = _boundary(data, tractions)
    b = load_forces(model, cells, boundary, data.force)
    balanced = rebalanced_stress(model, data.solution.stiffness, cells, u, b, motions)
    # Facets between copies are inside the body: sigma^ has tractions of its own there.
    inside = [traction for traction in tractions if traction.contact.is_periodic]
    _add_tractions(model.space, boundary, inside, -1.0)
    if model.springs:
        # They pull at the displacement that is in equilibrium with their pull.
        pulled = spring_moments(model, spring_tractions(model, balanced.displacement))
        boundary += np.where(data.fixed[:, None, :], 0.0, pulled)
    given = Reconstruction(
        model=model,
        cells=cells,
        around=data.around,
        displacement=u_hat,
        balanced=balanced.stress,
        force=data.force,
        boundary=boundary,
        fixed=data.fixed,
        tighten=tighten,
        correction=None if near is None else near.correction,
    )
    bulk = axisymmetric_bulk(given) if model.space.axisymmetric else plane_bulk(given)
    chosen = {}
    for traction in inside:
        values = tractions_of(model.space, bulk.moment, traction.contact.trace.here.facets)
        chosen[traction.contact.name] = replace(traction, values=values)
    tractions = [chosen.get(traction.contact.name, traction) for traction in tractions]
    _add_tractions(model.space, bulk.boundary, list(chosen.values()))
    of_boundary = Given(bulk.boundary, data.fixed, tractions)
    imbalance = proved_imbalance(model, cells, u, bulk.missing, bulk.moment, of_boundary)
    of_springs = []
    if model.springs:
        of_springs = chosen_tractions(model, data.loads, bulk.moment)
    pair = Admissible(
        solution=data.solution,
        displacement=u_hat,
        tractions=tractions,
        spring_tractions=of_springs,
        cell_geometry=cells,
        balanced=balanced.stress,
        stress=bulk.stress,
        facet_moments=bulk.moment,
        cell_forces=data.force,
        relief=data.relief,
        tightening=bulk.iterations,
        correction=bulk.correction,
        imbalance=imbalance,
        seconds=0.0,
    )
    return _Made(pair, balanced, bulk.square)


def _boundary(data: _Data, tractions: list[ContactTraction]) -> np.ndarray:
    """Return moments of loads and r^ on all facets [force], shape (facets, m, d).

    A support takes up the load on its components.
    """
    boundary = np.where(data.fixed[:, None, :], 0.0, data.loads)
    _add_tractions(data.solution.model.space, boundary, tractions)
    return boundary


def _add_tractions(
    space: Space, total: np.ndarray, tractions: Sequence[ContactTraction], times: float = 1.0
) -> None:
    """Add the moments of tractions to the moments of all facets, in place.

    Args:
        space: The mesh.
        total: Moments of all facets [force], shape (facets, m, d).
        tractions: The tractions.
        times: Factor of them [-].
    """
    for traction in tractions:
        of_contact = times * moments(traction.area, traction.values, space.degree)
        trace = traction.contact.trace
        add_moments(space, total, trace.here.facets, of_contact)
        # Action and reaction: on the other body acts the opposite traction.
        add_moments(space, total, trace.there.facets, -trace.on_there(of_contact))


def _of_owners(
    space: Space, cells: CellGeometry, tractions: list[ContactTraction]
) -> list[ContactTraction]:
    """Return r^ as the owner of each facet has computed it; collective.

    After a large slide the round-off of two ranks differs by more than the balance
    allows.
    """
    shared = SharedMoments(space, cells)
    result = []
    for traction in tractions:
        side = traction.contact.trace.here
        total = np.zeros((space.facet_count, len(space.facet_points), space.d))
        add_moments(space, total, side.facets[side.owned], traction.values[side.owned])
        values = values_on(space, shared.total(total), side.facets)
        result.append(replace(traction, values=values))
    return result
