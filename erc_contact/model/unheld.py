"""Rigid motions that nothing holds: loads balance on them, and nodes are anchored.

Neither a support nor a spring nor a contact resists these motions q_k. A solution
exists if the loads do no work on them, ``f(q_k) = 0``, and it is known up to them:
stresses, forces, energies and the error do not depend on them. So the displacements of
as many components of nodes, the *anchors*, are set to zero while the equations are
solved. Loads in balance pull no anchor. The displacement that a user gets has no part
in these motions, ``int u . q_k = 0``.

Bodies that contacts connect have common motions: a *group* of bodies.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import fem

from erc_contact.base.ranks import greatest
from erc_contact.mesh.graphs import components
from erc_contact.model.body_words import boundary_parts, hinge_words, lying_words
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.motions import BodyMotions, Group, Unheld, kernel, motions_together
from erc_contact.model.over_ranks import marks_of_owners
from erc_contact.model.space import Space

AT_REST = 1e-6
"""Share of a body in a motion that counts as none [-]."""
AT_CONTACT = 0.01
"""Weight of nodes of contacts among the nodes that may be anchored [-]."""
SAME_WEIGHT = 6
"""Digits in which weights of nodes differ."""


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
        if contact.trace.there is not None:
            weights[contact.trace.partners] *= AT_CONTACT
    weights[fixed] = 0.0
    weights = weights[:owned].ravel()
    left = values[:owned].reshape(len(weights), -1)
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
