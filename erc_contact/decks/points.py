"""Support bodies at points, which carry no force in a continuum.

The displacement at a point or on an edge has no bound by the energy, so that a support
there does nothing in the limit of small elements. What a deck means by it is taken as
follows, body by body.

- Points that stop rigid motions alone, each motion once, are left out. Their reactions
  follow from balance. Where they are not zero they are loads on the faces around the
  points, as any force at a node.
- Faces around other points are a rigid pad, see :mod:`erc_contact.decks.pads`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from erc_contact.decks.conditions import NodalForces
from erc_contact.decks.histories import Entry
from erc_contact.decks.loads import LoadedFaces, forces_on_faces
from erc_contact.decks.reading import DeckReading
from erc_contact.decks.supports import HeldFaces, LonePoints
from namedmesh.for_solvers import Card

DIGITS = 6
"""Digits to which directions of motions are compared."""
NO_FORCE = (
    "are held as points, which carry no force in a continuum: hold a set of nodes that has whole "
    "faces."
)
"""What is said of points that would carry a force."""
RANK = 1e-9
"""Singular value that is none, as a share of the greatest [-]."""
NONE = np.empty(0, dtype=np.int64)
"""No faces."""


@dataclass(frozen=True)
class HeldPoints:
    """Hold points of a body that are held, component by component.

    Attributes:
        body: Number of the body.
        nodes: The point of each component that is held, shape (n,).
        components: The components, from 0, shape (n,).
        values: Their displacements [length], shape (n,).
        entries: Their entries, with their histories.
        card: The first card that holds them.
        numbers: Numbers of all nodes of the deck.
    """

    body: int
    nodes: np.ndarray
    components: np.ndarray
    values: np.ndarray
    entries: list[Entry]
    card: Card
    numbers: np.ndarray

    def words(self, chosen: np.ndarray | slice = slice(None)) -> str:
        """Return the numbers of the first nodes among some, in words."""
        numbers = np.unique(self.numbers[self.nodes[chosen]])
        return "nodes " + ", ".join(map(str, numbers[:8])) + (", ..." if len(numbers) > 8 else "")

    def rows(self, x: np.ndarray, *, ring: bool) -> np.ndarray:
        """Return their components in all rigid motions, shape (n, 3 or 6).

        Args:
            x: The points of the deck [length], from the centre of rotation.
            ring: Whether the body is axisymmetric.
        """
        rows = np.zeros((len(self.nodes), 3 if x.shape[1] == 2 else 6))
        for component in range(x.shape[1]):
            along = self.components == component
            rows[along] = _rigid_rows(x[self.nodes[along]], component, ring=ring)
        return rows


def points_of_bodies(reading: DeckReading, lone: list[LonePoints]) -> list[HeldPoints]:
    """Return the points of each body."""
    if not lone:
        return []
    mesh = reading.mesh
    nodes = np.concatenate([points for _, points, _ in lone])
    components = np.repeat([component for *_, component in lone], [len(p) for _, p, _ in lone])
    entries = [entry for entry, points, _ in lone for _ in points]
    values = []
    for entry, points, _ in lone:
        order = np.argsort(entry.what.nodes)
        place = order[np.searchsorted(entry.what.nodes, points, sorter=order)]
        values.append(entry.what.values[place])
    every = np.concatenate(values)
    result = []
    for body in np.unique(mesh.body_of_node[nodes]):
        here = np.flatnonzero(mesh.body_of_node[nodes] == body)
        chosen = [entries[i] for i in here]
        card = chosen[0].what.card
        of_body = nodes[here], components[here], every[here]
        result.append(HeldPoints(int(body), *of_body, chosen, card, mesh.numbers))
    return result


def free_motions(reading: DeckReading, held: list[HeldFaces], body: int) -> np.ndarray:
    """Return the rigid motions of a body that faces leave free, shape (3 or 6, k)."""
    mesh = reading.mesh
    count = 3 if mesh.d == 2 else 6
    rows = [np.empty((0, count))]
    for support in held:
        faces = support.faces[mesh.bodies[mesh.cell_of_face[support.faces]] == body]
        rows += _rows_of_faces(reading, support, faces)
    free = _null_space(np.concatenate(rows), count)
    if reading.is_ring:
        free = free[:, abs(free[1]) > RANK]
    return free


def follow_from_balance(
    reading: DeckReading,
    held: list[HeldFaces],
    points: HeldPoints,
    acting: np.ndarray,
    rows: np.ndarray,
) -> bool:
    """Tell whether points hold rigid motions alone, each of them once.

    Args:
        reading: The deck.
        held: Faces that it holds.
        points: The points of a body.
        acting: Their components in the motions that faces leave free, shape (n, k).
        rows: Their components in all rigid motions, shape (n, 3 or 6).
    """
    size = np.linalg.norm(acting, axis=1)
    if (size <= RANK * abs(rows).max(initial=0.0)).any():
        return False  # it resists a strain alone
    # In a plane problem that is meshed in space points across the plane are one.
    mesh = reading.mesh
    across = _held_across(reading, held, points.body)
    places = mesh.mesh.points[points.nodes, : mesh.d] / np.ptp(mesh.x, axis=0).max()
    places[:, across] = 0.0
    alike = np.column_stack([acting / size[:, None], points.components, places])
    _, first = np.unique(np.round(alike, DIGITS), axis=0, return_index=True)
    distinct = acting[first] / size[first, None]
    return len(distinct) <= int(np.linalg.matrix_rank(distinct, tol=10.0**-DIGITS))


def _held_across(reading: DeckReading, held: list[HeldFaces], body: int) -> list[int]:
    """Return the axes along which faces hold all corners of a body."""
    mesh = reading.mesh
    corners = np.flatnonzero(mesh.corner_count)
    corners = corners[mesh.body_of_node[corners] == body]
    result = []
    for axis in range(mesh.d):
        faces = [support.faces for support in held if support.component == axis]
        if np.isin(corners, mesh.corners(np.concatenate([NONE, *faces]))).all():
            result.append(axis)
    return result


def reactions_as_loads(
    reading: DeckReading,
    held: list[HeldFaces],
    points: HeldPoints,
    found: list[tuple[Entry, np.ndarray]],
) -> list[LoadedFaces]:
    """Return the reactions of points, as loads on the faces around them.

    Args:
        reading: The deck.
        held: Faces that it holds.
        points: The points.
        found: Loads with the reactions to them [force], one for each component.
    """
    reading.told.assume(
        points.card,
        f"{points.words()} stop rigid motions alone: they are left out, and displacements are "
        "up to such a motion",
    )
    nodes, row = np.unique(points.nodes, return_inverse=True)
    result = []
    for entry, reactions in found:
        reading.told.assume(
            points.card,
            f"{points.words()} have reactions that follow from balance; they are loads",
        )
        forces = np.zeros((len(nodes), reading.mesh.d))
        np.add.at(forces, (row, points.components), reactions)
        reaction = replace(entry, what=NodalForces("", nodes, forces, points.card))
        result += forces_on_faces(reading, reaction, held, NONE, {}, ring=reading.is_ring)
    return result


def _rows_of_faces(reading: DeckReading, held: HeldFaces, faces: np.ndarray) -> list[np.ndarray]:
    """Return what faces hold of the rigid motions, rows as of :func:`_rigid_rows`."""
    mesh = reading.mesh
    if held.component >= 0:
        nodes = np.unique(mesh.corners(faces))
        return [_rigid_rows(mesh.x[nodes], held.component, ring=reading.is_ring)]
    # Planes and cylinders are held along their normals.
    normals = mesh.normals(faces)
    result = []
    for column in mesh.corners(faces).T:
        rows = [
            _rigid_rows(mesh.x[column], i, ring=reading.is_ring) * normals[:, i, None]
            for i in range(mesh.d)
        ]
        result.append(np.sum(rows, axis=0))
    return result


def _rigid_rows(x: np.ndarray, component: int, *, ring: bool) -> np.ndarray:
    """Return a component of all rigid motions at points, shape (n, 3 or 6).

    Rings move along their axis alone.
    """
    n, d = x.shape
    shifts = np.zeros((n, d))
    shifts[:, component] = 1.0
    if ring:
        return np.column_stack([0 * x[:, 0], shifts[:, 1], 0 * x[:, 0]])
    if d == 2:
        turn = -x[:, 1] if component == 0 else x[:, 0]
        return np.column_stack([shifts, turn])
    turns = np.zeros((n, 3))
    for axis in range(3):
        spin = np.zeros(3)
        spin[axis] = 1.0
        turns[:, axis] = np.cross(spin, x)[:, component]
    return np.column_stack([shifts, turns])


def _null_space(rows: np.ndarray, count: int) -> np.ndarray:
    """Return an orthonormal basis of the motions that rows do not stop, as columns."""
    if not len(rows):
        return np.eye(count)
    _, values, vectors = np.linalg.svd(rows, full_matrices=True)
    rank = int((values > RANK * values.max()).sum())
    return vectors[rank:].T
