"""Hold points of a body that resist its strains by rigid pads, the faces around them.

A pad moves as a rigid body. What the points hold of its motion is held, and along its
other motions no force acts on it: a pad around one point is a joint that turns, and a
pad along an edge is a hinge. Loads on a pad are its force and its moment. A ring has no
such motions: around a circle that is held, the faces are held alike.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from erc_contact.decks.affine import constant
from erc_contact.decks.balance import on_motions, work_on_faces
from erc_contact.decks.grips import Gripped
from erc_contact.decks.histories import FOREVER, Entry
from erc_contact.decks.loads import LoadedFaces
from erc_contact.decks.pad_faces import pads_at
from erc_contact.decks.points import NO_FORCE, HeldPoints
from erc_contact.decks.reading import DeckReading, Grip
from erc_contact.decks.supports import HeldFaces
from namedmesh.for_solvers import components

SMALL = 0.1
"""Greatest area of a pad, as a share of the surface of its body [-]."""
HELD = 1e-6
"""Share of a motion that is held, or is not, up to round-off [-]."""
FREEDOMS = {2: (1, 2, 6), 3: (1, 2, 3, 4, 5, 6)}
"""Degrees of freedom of a deck that a rigid motion has, by the dimension."""
ALONG_AXIS = 2
"""Degree of freedom of a ring that moves as a rigid body."""
ALONG = ("along the radius", "along the axis")
"""Components of rings, in words."""
AXES = {1: "x", 2: "y", 3: "z", 4: "x", 5: "y", 6: "z"}
"""Names of the axes of degrees of freedom."""


def pads_of(reading: DeckReading, points: HeldPoints, taken: np.ndarray) -> Gripped:
    """Return the rigid pads around points of a body; refuse points that have none.

    Args:
        reading: The deck.
        points: The points.
        taken: Faces that are held, or may touch.
    """
    mesh = reading.mesh
    free = _outer_faces(reading, points.body)
    free = free[~np.isin(mesh.corners(free), mesh.corners(taken)).any(axis=1)]
    result: Gripped = []
    for group in _groups(reading, points):
        known = np.concatenate([taken[:0], *(faces for _, faces in result)])
        is_apart = ~np.isin(mesh.corners(free), mesh.corners(known)).any(axis=1)
        faces = _pad(reading, points, group, free[is_apart])
        grip = _grip(reading, points, group) if len(faces) else None
        if grip is None:
            reading.told.refuse(points.card, f"{points.words(group)} {NO_FORCE}")
            return []
        reading.told.assume(
            points.card,
            f"{points.words(group)} resist strains, which points cannot: the faces around them, of "
            f"area {_area(reading, faces):.4g}, are a rigid pad{_turns(reading, grip)}",
        )
        result.append((grip, faces))
    return result


def bands_of(
    reading: DeckReading, points: HeldPoints, held: list[HeldFaces], sides: np.ndarray
) -> list[HeldFaces]:
    """Return what is held of a ring around circles; refuse circles without free faces.

    Args:
        reading: The deck.
        points: The circles.
        held: Faces that the deck holds.
        sides: Faces that may touch.
    """
    result: list[HeldFaces] = []
    every = _outer_faces(reading, points.body)
    for group in _groups(reading, points):
        for row in group:
            component = int(points.components[row])
            beside = [known.faces for known in held if known.component in (component, -1, -2)]
            free = np.setdiff1d(every, np.concatenate([sides, *beside]))
            faces = _pad(reading, points, np.array([row]), free)
            if not len(faces):
                reading.told.refuse(points.card, f"{points.words(group)} {NO_FORCE}")
                return []
            reading.told.assume(
                points.card,
                f"{points.words(np.array([row]))} resist strains, which circles cannot: the faces "
                f"around them, of area {_area(reading, faces):.4g}, are held {ALONG[component]}",
            )
            value = constant(float(points.values[row]), reading.mesh.d)
            name = f"band {reading.mesh.numbers[points.nodes[row]]}"
            entry = points.entries[row]
            named = replace(entry, what=replace(entry.what, name=name))
            result.append(HeldFaces(name, faces, component, value, named))
    return result


def load_pads(
    reading: DeckReading, grips: Gripped, loads: list[LoadedFaces], thickness: float
) -> None:
    """Take loads from the faces of rigid bodies, which get their forces and moments.

    Args:
        reading: The deck.
        grips: Rigid bodies and their faces.
        loads: Loads on faces, which are changed.
        thickness: Thickness of a plane body, by which loads are divided [length].
    """
    mesh = reading.mesh
    freedoms = (ALONG_AXIS,) if reading.is_ring else FREEDOMS[mesh.d]
    for load in loads:
        for grip, faces in grips:
            shared = np.intersect1d(load.faces, faces)
            if not grip.rigid or not len(shared):
                continue
            work, _ = work_on_faces(reading, load, shared, ring=reading.is_ring)
            force = work[: mesh.d]
            # The moment is about the reference node, not about the origin.
            work[mesh.d :] -= on_motions(mesh.x[grip.reference], force)[mesh.d :]
            for freedom, value in zip(FREEDOMS[mesh.d], work, strict=True):
                if freedom not in freedoms:
                    continue
                what = float(value) * thickness
                entry = replace(load.entry, what=what, key=(grip.reference, freedom))
                reading.steps.entries.setdefault("grip force", []).append(entry)
            load.faces = np.setdiff1d(load.faces, shared)
            load.shared = None
            reading.told.assume(
                grip.card, f"loads on {grip.name!r} are the force and the moment on a rigid body"
            )
    loads[:] = [load for load in loads if len(load.faces)]


def _outer_faces(reading: DeckReading, body: int) -> np.ndarray:
    """Return the faces of the surface of a body."""
    mesh = reading.mesh
    every = np.flatnonzero(mesh.outer)
    return every[mesh.bodies[mesh.cell_of_face[every]] == body]


def _area(reading: DeckReading, faces: np.ndarray) -> float:
    """Compute the area of faces, of a ring with its circumference."""
    mesh = reading.mesh
    areas = mesh.measures(faces)
    if reading.is_ring:
        areas = areas * 2 * np.pi * mesh.centres(faces)[:, 0]
    return float(areas.sum())


def _pad(
    reading: DeckReading, points: HeldPoints, group: np.ndarray, free: np.ndarray
) -> np.ndarray:
    """Return the faces of the pad of points; none where it would be too large."""
    mesh = reading.mesh
    nodes = points.nodes[group]
    if not np.isin(mesh.ends[nodes], nodes).all():
        return free[:0]  # they lie between corners that are not held
    along = np.isin(np.arange(mesh.d), points.components[group]).astype(float)
    largest = SMALL * _area(reading, _outer_faces(reading, points.body))
    for faces in pads_at(mesh, nodes, free, along):
        if _area(reading, faces) <= largest:
            return faces
    return free[:0]


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
    """Return the motions of a pad, and add what holds them, from step to step.

    It is None where points hold a motion in part, as lines across the axes do, or move
    as no rigid body.
    """
    mesh = reading.mesh
    x = mesh.mesh.points[:, : mesh.d]
    nodes = points.nodes[group]
    middle = x[nodes].mean(axis=0)
    reference = int(nodes[np.linalg.norm(x[nodes] - middle, axis=1).argmin()])
    units = np.ones(len(FREEDOMS[mesh.d]))
    units[mesh.d :] = np.ptp(mesh.x, axis=0).max()
    rows = points.rows(x - x[reference], ring=False) / units
    entries = [points.entries[i] for i in group]
    changes = sorted({entry.begin for entry in entries} | {entry.end for entry in entries})
    held: set[int] = set()
    moved: list[Entry] = []
    for begin, end in pairwise([*changes, FOREVER]):
        is_held = [entry.begin <= begin < entry.end for entry in entries]
        if not any(is_held):
            continue
        motions = _motions(points, rows, group[is_held])
        if motions is None:
            return None
        for entry, motion in motions:
            for freedom, amount, unit in zip(FREEDOMS[mesh.d], motion, units, strict=True):
                if np.isnan(amount):
                    continue
                held.add(freedom)
                span = {"begin": max(begin, entry.begin), "end": min(end, entry.end)}
                key = (reference, freedom)
                moved.append(replace(entry, what=float(amount / unit), key=key, **span))
    reading.steps.entries.setdefault("grip", []).extend(moved)
    name = f"pad {mesh.numbers[reference]}"
    return Grip(name, nodes, "", reference, None, True, tuple(sorted(held)), points.card)


def _motions(
    points: HeldPoints, rows: np.ndarray, acting: np.ndarray
) -> list[tuple[Entry, np.ndarray]] | None:
    """Return the motions that points give to a pad, for each history in time.

    Args:
        points: The points.
        rows: Their components in the rigid motions about the reference, shape (n, m).
        acting: Which components are held at a time.

    Returns:
        An entry with the history, and the amount of each motion, which is NaN where the
        points leave it free; None if they hold it in part, or move as no rigid body.
    """
    # A value that is given anew stands beside the value that fades.
    held = np.column_stack([points.nodes[acting], points.components[acting]])
    _, first, row = np.unique(held, axis=0, return_index=True, return_inverse=True)
    of_points = rows[acting[first]]
    inverse = np.linalg.pinv(of_points, rcond=HELD)
    share = np.diag(inverse @ of_points)
    if (np.minimum(abs(share), abs(1.0 - share)) > HELD).any():
        return None
    histories: dict[tuple[object, ...], list[int]] = {}
    for place, i in enumerate(acting):
        entry = points.entries[i]
        history = (tuple(entry.times), tuple(entry.factors), entry.begin, entry.end)
        histories.setdefault(history, []).append(place)
    result = []
    for places in histories.values():
        values = np.zeros(len(first))
        np.add.at(values, row.ravel()[places], points.values[acting[places]])
        motion = inverse @ values
        if abs(of_points @ motion - values).max() > HELD * abs(values).max(initial=0.0):
            return None
        motion[share < HELD] = np.nan
        result.append((points.entries[acting[places[0]]], motion))
    return result


def _turns(reading: DeckReading, grip: Grip) -> str:
    """Return in words about which axes a pad turns freely."""
    free = [f for f in FREEDOMS[reading.mesh.d] if f > 3 and f not in grip.components]
    if not free:
        return ""
    return ", free to turn about " + ", ".join(AXES[freedom] for freedom in free)
