"""Rigid motions that nothing holds: loads balance on them, and nodes are anchored.

Neither a support nor a spring nor a contact resists these motions q_k. A solution
exists if the loads do no work on them, ``f(q_k) = 0``, and it is known up to them:
stresses, forces, energies and the error do not depend on them. So the displacements of
as many components of nodes, the *anchors*, are set to zero while the equations are
solved. Loads in balance pull no anchor. The displacement that a user gets has no part
in these motions, ``int u . q_k = 0``.

Bodies that contacts connect have common motions: a *group* of bodies.

Loads may be out of balance by what files round, or by what flat facets lose of curved
sides. Then forces per volume that are constant in each cell, in the shape of the
motions, take up the difference. More is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import NotHeldError
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.data.over_ranks import marks_of_owners
from erc_contact.model.motions.body_words import boundary_parts, hinge_words, lying_words
from erc_contact.model.motions.rigid_motions import (
    BodyMotions,
    Group,
    Unheld,
    kernel,
    motions_together,
)
from erc_contact.model.space import Space
from namedmesh.base.ranks import greatest
from namedmesh.for_solvers import boundary_sides, components, slivers
from namedmesh.simplex import measures

AT_REST = 1e-6
"""Share of a body in a motion that counts as none [-]."""
AT_CONTACT = 0.01
"""Weight of nodes of contacts among the nodes that may be anchored [-]."""
SAME_WEIGHT = 6
"""Digits in which weights of nodes differ."""
ROUND_OFF = 1e-13
"""Resultant over the sum of the loads that is round-off [-]."""
DIGITS = 1e-6
"""Resultant over the sum of the loads that files with seven digits may leave [-]."""
FACETS = 4.5
"""Such a resultant over the square of depth over size of the facets of a load [-].

On a circle of radius R a chord of length h loses ``h^2/(24 R^2)`` of its arc, and the
arc is ``h^2/(8 R)`` deep: this is 2.7 times the square of its depth over h. More is a
margin.
"""
PART = 1e-6
"""Part of a resultant that is told as zero [-]."""
PLACE = 1e-9
"""Coordinate that is told as zero, over the size of the body [-]."""


def find_unheld(
    space: Space,
    bodies: tuple[np.ndarray, int],
    motions: BodyMotions,
    fixed: np.ndarray,
    by_all: np.ndarray,
    contacts: Sequence[ContactOnMesh],
) -> Unheld:
    """Find the motions that nothing holds, and nodes that anchor them; collective.

    Args:
        space: The mesh.
        bodies: Body of each node, and number of bodies.
        motions: The m rigid motions of the bodies.
        fixed: Which components supports prescribe at each node, shape (nodes, d).
        by_all: Products of the motions that anything resists, shape (bodies m, bodies
            m).
        contacts: The contacts.
    """
    body, count = bodies
    m = motions.values.shape[2]
    groups = []
    functions: list[fem.Function] = []
    anchors = np.zeros(fixed.shape, dtype=bool)
    for connected in _group_bodies(by_all.reshape(count, m, count, m)):
        rows = (m * connected[:, None] + np.arange(m)).ravel()
        amounts = kernel(by_all[np.ix_(rows, rows)]).reshape(len(connected), m, -1)
        if amounts.shape[2] == 0:
            continue
        moves = abs(amounts).max(axis=(1, 2)) > AT_REST
        numbers, amounts = connected[moves], amounts[moves]
        places = [""]
        if count > 1:
            places = [f" the body with {boundary_parts(space, body == i)}" for i in numbers]
        words = _words(motions, numbers, places, amounts)
        groups.append(Group(numbers, amounts, words, places))
        values = _values(motions, body, groups[-1])
        for k in range(values.shape[2]):
            functions.append(space.function())
            functions[-1].x.array[:] = values[:, :, k].ravel()
        anchors |= _anchors(space, values, fixed, contacts)
    hint = ""
    if groups:
        loose = np.concatenate([group.bodies for group in groups])
        hint = lying_words(space, body, count) or hinge_words(space, body, loose).strip()
    return Unheld(motions, groups, functions, marks_of_owners(space, anchors), hint)


def _group_bodies(by_all: np.ndarray) -> list[np.ndarray]:
    """Return the numbers of bodies that contacts connect, group by group.

    Args:
        by_all: Products of motions that anything resists, shape (bodies, m, bodies, m).
    """
    links = np.argwhere(by_all.any(axis=(1, 3)))
    label = components(len(by_all), links)
    return [np.flatnonzero(label == group) for group in np.unique(label)]


def _values(motions: BodyMotions, body: np.ndarray, group: Group) -> np.ndarray:
    """Return the motions of a group at the nodes of this rank, shape (nodes, d, K)."""
    values = np.zeros((*motions.values.shape[:2], group.amounts.shape[2]))
    for number, amounts in zip(group.bodies, group.amounts, strict=True):
        of_body = body == number
        values[of_body] = motions.values[of_body] @ amounts
    return values


def _words(
    motions: BodyMotions, numbers: np.ndarray, places: list[str], amounts: np.ndarray
) -> str:
    """Name motions of a group: of its bodies as one, and how many others there are.

    Args:
        motions: The motions of all bodies.
        numbers: Numbers of the b bodies.
        places: These bodies, in words.
        amounts: The K motions, shape (b, m, K).
    """
    m = motions.values.shape[2]
    amounts = amounts.reshape(len(numbers) * m, -1)
    together = motions_together(motions, numbers, m).reshape(-1, m)
    together /= np.linalg.norm(together, axis=0)
    held = together - amounts @ (amounts.T @ together)
    free = kernel(held.T @ held)
    shares = (free**2).sum(axis=1)
    greatest = np.sort(np.argsort(-shares, kind="stable")[: free.shape[1]])
    words = []
    if len(greatest):
        words.append(", ".join(motions.names[k] for k in greatest))
    others = amounts.shape[1] - len(greatest)
    if others:
        words.append(f"{others} {'motion' if others == 1 else 'motions'} along each other")
    of_bodies = f" of{' and'.join(places)}" if any(places) else ""
    return " and ".join(words) + of_bodies


def _anchors(
    space: Space, values: np.ndarray, fixed: np.ndarray, contacts: Sequence[ContactOnMesh]
) -> np.ndarray:
    """Choose components of vertices far apart that anchor motions; collective.

    Args:
        space: The mesh.
        values: The K motions at the nodes, shape (nodes, d, K).
        fixed: Which components supports prescribe at each node, shape (nodes, d).
        contacts: The contacts, whose nodes are taken if there are no others.

    Returns:
        K components, each on the rank of its node, shape (nodes, d).
    """
    comm = space.comm
    owned = space.V.dofmap.index_map.size_local
    weights = np.zeros(fixed.shape)
    weights[space.vertices] = 1.0
    for contact in contacts:
        weights[contact.trace.here.nodes] *= AT_CONTACT
        weights[contact.trace.partners] *= AT_CONTACT
    weights[fixed] = 0.0
    weights = weights[:owned].ravel()
    left = values[:owned].reshape(len(weights), values.shape[2])
    x = space.V.tabulate_dof_coordinates()[:owned]
    anchors = np.zeros(fixed.shape, dtype=bool)
    for _ in range(values.shape[2]):
        sizes = weights * np.linalg.norm(left, axis=1)
        most = greatest(comm, sizes)
        # Of equal ones the first one by its place is taken, on any number of ranks.
        best = np.flatnonzero(np.round(sizes / most, SAME_WEIGHT) >= 1.0)
        offers = [(*x[dof // space.d].tolist(), int(dof % space.d), int(dof)) for dof in best]
        offer = min(offers, default=None)
        of_ranks = comm.allgather(offer)
        rank = min((found[:-1], r) for r, found in enumerate(of_ranks) if found is not None)[1]
        row = None
        if rank == comm.rank and offer is not None:
            dof = offer[-1]
            anchors[dof // space.d, dof % space.d] = True
            row = left[dof] / np.linalg.norm(left[dof])
        row = comm.bcast(row, rank)
        left = left - np.outer(left @ row, row)
    return anchors


@dataclass(frozen=True, eq=False)
class Relief:
    """Hold a force per volume that takes up what loads leave on these motions.

    Attributes:
        density: The force [force/volume], constant in cells; of an axisymmetric body
            times the circumference.
        words: The resultant that it takes up, in words.
    """

    density: fem.Function
    words: str


def relief_of(
    space: Space,
    unheld: Unheld,
    loads: fem.Function,
    loaded: Sequence[str],
    *,
    in_body: bool,
) -> Relief | None:
    """Check that loads are in balance on motions that nothing holds; collective.

    Args:
        space: The mesh.
        unheld: The motions.
        loads: Nodal forces of the loads, not yet summed over ranks [force].
        loaded: Names of the boundary parts with loads.
        in_body: Whether a force acts in the bodies: then all of their facets may lose.

    Returns:
        What takes up a small resultant; None where it is round-off.

    Raises:
        NotHeldError: If the loads are not in balance.
    """
    works, sizes = works_on(space, unheld.functions, loads)
    if is_round_off(works, sizes):
        return None
    allowed = max(DIGITS, _lost_by_facets(space, loaded, in_body=in_body))
    refused = []
    small = []
    first = 0
    for group in unheld.groups:
        of_group = slice(first, first + group.amounts.shape[2])
        first = of_group.stop
        amounts = works[of_group]
        scale = float(sizes[of_group].max())
        beyond = float(abs(amounts).max())
        if beyond <= ROUND_OFF * scale:
            continue
        is_told = len(unheld.groups) > 1
        parts = group.amounts @ amounts
        words = _resultant(unheld.motions_of_bodies, group, parts, space.d, is_told=is_told)
        if beyond > allowed * scale:
            refused.append(words)
        else:
            small.append(f"{words} ({beyond / scale:.1g} of them)")
    if refused:
        hint = f" {unheld.hint}" if unheld.hint else ""
        raise NotHeldError(
            f"Nothing holds the body against: {unheld.words} (no support, and contact cannot hold "
            f"it), and the loads are not in balance there, by {'; '.join(refused)}. Add a "
            "Displacement (None leaves a component free), or friction, or what is missing in the "
            f"loads.{hint}"
        )
    density = space.domain.function("DG", 0, (space.d,))
    density.x.array[:] = taking_up(space, unheld.functions, works).ravel()
    return Relief(density, "; ".join(small))


def works_on(
    space: Space, functions: Sequence[fem.Function], loads: fem.Function
) -> tuple[np.ndarray, np.ndarray]:
    """Return work of loads on K motions, and of their sizes [force]; collective.

    Sizes are the lengths of the vectors: a load across a motion has round-off along it.

    Args:
        space: The mesh.
        functions: The motions.
        loads: Nodal forces, not yet summed over ranks [force].
    """
    works = [loads.x.array @ motion.x.array for motion in functions]
    size = np.linalg.norm(loads.x.array.reshape(-1, space.d), axis=1)
    sizes = []
    for motion in functions:
        sizes.append(size @ np.linalg.norm(motion.x.array.reshape(-1, space.d), axis=1))
    total = space.comm.allreduce(np.array([works, sizes]), MPI.SUM)
    return total[0], total[1]


def is_round_off(works: np.ndarray, sizes: np.ndarray) -> bool:
    """Tell whether loads are in balance up to round-off, see :func:`works_on`."""
    return bool((abs(works) <= ROUND_OFF * sizes).all())


def taking_up(space: Space, functions: Sequence[fem.Function], works: np.ndarray) -> np.ndarray:
    """Return forces per volume in cells that take up work on motions; collective.

    Args:
        space: The mesh.
        functions: K motions.
        works: Work of the loads on them [force], shape (K,).

    Returns:
        Forces per volume [force/volume], shape (cells, d).
    """
    of_cells = []
    for motion in functions:
        of_cells.append(motion.x.array.reshape(-1, space.d)[space.vertices].mean(axis=1))
    shapes = np.stack(of_cells, axis=2)
    owned = slice(0, space.domain.owned_cells)
    volume = measures(space.cell_corners()[owned])
    local = np.einsum("c,cdk,cdl->kl", volume, shapes[owned], shapes[owned])
    products = space.comm.allreduce(local, MPI.SUM)
    return -shapes @ np.linalg.solve(products, works)


def _lost_by_facets(space: Space, loaded: Sequence[str], *, in_body: bool) -> float:
    """Return the share of loads that flat facets may lose; collective.

    See :func:`relief_of` for the arguments.
    """
    offset = space.domain.offset
    curved = space.domain.curved_facets
    worst = 0.0
    if offset is not None and curved is not None:
        parts = [space.domain.owned_facets(name) for name in loaded]
        if in_body:
            # A polygon has its centre beside the centre of the round body.
            of_rank = space.mesh.topology.index_map(space.d - 1).size_local
            owned = curved.indices[curved.indices < of_rank]
            parts.append(np.column_stack(boundary_sides(space.mesh, owned)))
        for facets in parts:
            areas = space.facet_areas(facets)
            sizes = areas ** (1 / (space.d - 1))
            depths = slivers(offset, facets).depths
            worst = max(worst, float(((depths / sizes) ** 2).max(initial=0.0)))
    return FACETS * space.comm.allreduce(worst, MPI.MAX)


def _resultant(
    motions: BodyMotions, group: Group, parts: np.ndarray, d: int, *, is_told: bool
) -> str:
    """Return force and moment of what is not in balance, in words.

    The parts of the bodies have the same work on the motions of the group as the loads.
    So their sum has the resultant and the moment of the loads. Where it is zero the
    bodies are drawn apart or along each other, and each of them is told.

    Args:
        motions: The motions of the bodies.
        group: The group of bodies.
        parts: Force and moment over the size on each body [force], shape (b, m).
        d: Dimension.
        is_told: Whether the bodies are named.
    """
    named = group.places if is_told else []
    if parts.shape[1] == 1:
        return f"a force of {_number(parts.sum())} along the axis{_on(named)}"
    places = motions.centres[group.bodies]
    sizes = motions.sizes[group.bodies]
    together = motions_together(motions, group.bodies, parts.shape[1])
    works = np.einsum("bmk,bm->k", together, parts)
    total = works[:d]
    moment = works[d:] * sizes.max()
    least = PART * float(abs(parts).max())
    if abs(total).max() > least or abs(moment).max() > least * sizes.max():
        return _told(total, moment, places.mean(axis=0), least, float(sizes.max()), named)
    told = []
    for i, name in enumerate(group.places):
        force, turning = parts[i, :d], parts[i, d:] * sizes[i]
        told.append(_told(force, turning, places[i], least, float(sizes[i]), [name]))
    return "; ".join(told)


def _on(places: list[str]) -> str:
    """Return on which bodies something acts, in words."""
    return f" on{' and'.join(places)}" if any(places) else ""


def _told(
    force: np.ndarray,
    moment: np.ndarray,
    about: np.ndarray,
    least: float,
    size: float,
    places: list[str],
) -> str:
    """Return a force, and a moment about a point, in words; in 3D about x, y, z."""
    force = np.where(abs(force) <= least, 0.0, force)
    moment = np.where(abs(moment) <= least * size, 0.0, moment)
    if len(moment) == 3:
        moment = np.array([moment[2], -moment[1], moment[0]])
    about = np.where(abs(about) <= PLACE * size, 0.0, about)
    place = ", ".join(map(_number, about))
    turn = ", ".join(map(_number, moment))
    turn = f"({turn})" if len(moment) > 1 else turn
    return (
        f"a force of ({', '.join(map(_number, force))}) and a moment of {turn} about ({place})"
        f"{_on(places)}"
    )


def _number(value: float) -> str:
    """Write a number with four digits; no -0."""
    return f"{value + 0.0:.4g}"
