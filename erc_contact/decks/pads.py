"""Hold points of a body that resist its strains by rigid pads, the faces around them.

A pad moves as a rigid body. What the points hold of its motion is held, and along its
other motions no force acts on it: a pad around one point is a joint that turns, and a
pad along an edge is a hinge.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.decks.grips import Gripped
from erc_contact.decks.points import NO_FORCE, HeldPoints
from erc_contact.decks.reading import DeckReading, Grip
from namedmesh.for_solvers import components

SMALL = 0.1
"""Greatest area of a pad, as a share of the surface of its body [-]."""
HELD = 1e-6
"""Share of a motion that is held, or is not, up to round-off [-]."""
FREEDOMS = {2: (1, 2, 6), 3: (1, 2, 3, 4, 5, 6)}
"""Degrees of freedom of a deck that a rigid motion has, by the dimension."""
AXES = {1: "x", 2: "y", 3: "z", 4: "x", 5: "y", 6: "z"}
"""Names of the axes of degrees of freedom."""


def pads_of(reading: DeckReading, points: HeldPoints, taken: np.ndarray) -> Gripped:
    """Return the rigid pads around points of a body; refuse points that have none.

    Args:
        reading: The deck.
        points: The points.
        taken: Faces that are held or loaded, or may touch.
    """
    mesh = reading.mesh
    every = np.flatnonzero(mesh.outer)
    every = every[mesh.bodies[mesh.cell_of_face[every]] == points.body]
    corners = mesh.corners
    free = every[~np.isin(corners(every), corners(taken)).any(axis=1)]
    largest = SMALL * mesh.measures(every).sum()
    result: Gripped = []
    for group in _groups(reading, points):
        nodes = points.nodes[group]
        is_between_them = np.isin(mesh.ends[nodes], nodes).all()
        faces = free[np.isin(corners(free), nodes).any(axis=1)]
        area = mesh.measures(faces).sum()
        touches = any(np.isin(corners(faces), corners(known)).any() for _, known in result)
        is_pad = is_between_them and 0.0 < area <= largest and not touches
        grip = _grip(reading, points, group) if is_pad and not reading.is_ring else None
        if grip is None:
            reading.told.refuse(points.card, f"{points.words(group)} {NO_FORCE}")
            return []
        reading.told.assume(
            points.card,
            f"{points.words(group)} resist strains, which points cannot: the faces around them, of "
            f"area {area:.4g}, are a rigid pad{_turns(reading, grip)}",
        )
        result.append((grip, faces))
    return result


def _groups(reading: DeckReading, points: HeldPoints) -> list[np.ndarray]:
    """Return points in groups whose nodes are on common faces of elements."""
    mesh = reading.mesh
    near = mesh.corners_near(points.nodes)
    number = np.full(len(mesh.x), -1)
    number[near] = np.arange(len(near))
    corners = number[mesh.corners(np.flatnonzero(mesh.outer))]
    ends = number[mesh.ends[points.nodes]]
    links = [ends]
    for i in range(1, corners.shape[1]):
        pair = corners[:, [i - 1, i]]
        links.append(pair[(pair >= 0).all(axis=1)])
    group = components(len(near), np.concatenate(links))[ends[:, 0]]
    return [np.flatnonzero(group == value) for value in np.unique(group)]


def _grip(reading: DeckReading, points: HeldPoints, group: np.ndarray) -> Grip | None:
    """Return the motions of a pad, and add what holds them.

    It is None where points hold a motion in part, as lines across the axes do, or move
    as no rigid body, or are held in different steps.
    """
    mesh = reading.mesh
    steps = reading.steps
    x = mesh.mesh.points[:, : mesh.d]
    nodes = points.nodes[group]
    middle = x[nodes].mean(axis=0)
    reference = int(nodes[np.linalg.norm(x[nodes] - middle, axis=1).argmin()])
    size = np.ptp(mesh.x, axis=0).max()
    units = np.ones(len(FREEDOMS[mesh.d]))
    units[mesh.d :] = size
    of_points = points.rows(x - x[reference], ring=False)[group] / units
    inverse = np.linalg.pinv(of_points, rcond=HELD)
    # The share of each motion that the points hold.
    share = np.diag(inverse @ of_points)
    values = points.values[group]
    motion = inverse @ values
    is_rigid = abs(of_points @ motion - values).max() <= HELD * abs(values).max(initial=0.0)
    is_along_axes = (np.minimum(abs(share), abs(1.0 - share)) < HELD).all()
    entries = [points.entries[i] for i in group]
    is_at_once = len({(entry.begin, entry.end) for entry in entries}) == 1
    if not (is_rigid and is_along_axes and is_at_once):
        return None
    held = []
    for freedom, part, unit, row in zip(FREEDOMS[mesh.d], share, units, inverse, strict=True):
        if part < HELD:
            continue
        held.append(freedom)
        for entry in dict.fromkeys(map(id, entries)):
            of_entry = np.array([id(known) == entry for known in entries])
            amount = float(row[of_entry] @ values[of_entry] / unit)
            first = entries[int(of_entry.argmax())]
            moved = replace(first, what=amount, key=(reference, freedom))
            steps.entries.setdefault("grip", []).append(moved)
    name = f"pad {mesh.numbers[reference]}"
    return Grip(name, nodes, "", reference, None, True, tuple(held), points.card)


def _turns(reading: DeckReading, grip: Grip) -> str:
    """Return in words about which axes a pad turns freely."""
    free = [f for f in FREEDOMS[reading.mesh.d] if f > 3 and f not in grip.components]
    if not free:
        return ""
    return ", free to turn about " + ", ".join(AXES[freedom] for freedom in free)
