"""Put the prescribed displacements of a deck on faces of the body.

A set of nodes holds the faces all of whose corners it has. Nodes without such a face
are points: in a continuum they stop nothing but rigid motions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from erc_contact.decks.affine import Affine, fitted
from erc_contact.decks.conditions import Held
from erc_contact.decks.histories import Entry
from erc_contact.decks.reading import Axes, DeckReading, HeldPoints

FLAT = 1e-6
"""Sine of an angle that is none [-]."""
DIGITS = 6
"""Digits to which directions of motions are compared."""
NO_FORCE = (
    "are held as points, which carry no force in a continuum: hold a set of nodes that has whole "
    "faces."
)
"""What is said of points that would carry a force."""
RANK = 1e-9
"""Singular value that is none, as a share of the greatest [-]."""


@dataclass
class HeldFaces:
    """Hold faces of which a component is prescribed.

    Attributes:
        name: Name of their set.
        faces: The faces.
        component: The component, from 0; -1 is a plane of symmetry, -2 the radius of a
            cylinder.
        value: The displacement [length].
        entry: Its entry, with its history.
        axes: Local axes, of a cylinder.
    """

    name: str
    faces: np.ndarray
    component: int
    value: Affine
    entry: Entry
    axes: Axes | None = None

    @property
    def set_name(self) -> str:
        """Return the name of their set in the deck, "" where it has none."""
        return self.name if self.entry.what.name else ""


SYMMETRY, RADIAL = -1, -2
"""Components that are no component of the coordinates."""


def held_faces(reading: DeckReading) -> list[HeldFaces]:
    """Return the faces that the deck holds; tell of nodes that are points."""
    mesh = reading.mesh
    result: list[HeldFaces] = []
    points: list[tuple[Entry, np.ndarray, int]] = []
    names: dict[Any, str] = {}
    for entry in reading.steps.entries.get("held", []):
        held: Held = entry.what
        if not 1 <= held.component <= mesh.d:
            _other_component(reading, held)
            continue
        faces = _needed(reading, held, mesh.within(held.nodes))
        name = held.name
        if not name:
            # Components of the same nodes are one part.
            name = names.setdefault(held.nodes.tobytes(), f"support {len(names) + 1}")
        axes = _axes_of(reading, held)
        is_used = mesh.node_is_used[held.nodes]
        nodes = held.nodes[is_used]
        if not is_used.all():
            reading.told.leave_out(held.card, "nodes of no solid element")
        if not len(nodes):
            continue
        value = fitted(mesh.x[nodes], held.values[is_used])
        if value is None:
            reading.told.refuse(
                held.card, f"the values of {name!r} are not linear in the position."
            )
            continue
        on_faces = np.isin(nodes, mesh.nodes_of_faces(faces))
        if axes is not None:
            found = _in_axes(reading, entry, held, faces, name, axes, value)
            if found is not None:
                result += _by_planes(reading, found)
                if not on_faces.all() and not _is_whole_body(reading, nodes):
                    reading.told.refuse(
                        held.card, f"{name!r} has nodes beside its faces, held along local axes."
                    )
            continue
        if len(faces):
            result.append(HeldFaces(name, faces, held.component - 1, value, entry))
        # On the axis of a ring the radial displacement is zero anyhow.
        is_on_axis = reading.is_ring & (held.component == 1) & (mesh.x[nodes, 0] == 0.0)
        if not (on_faces | is_on_axis).all():
            points.append((entry, nodes[~on_faces & ~is_on_axis], held.component - 1))
    _check_points(reading, result, points)
    return result


def _needed(reading: DeckReading, held: Held, faces: np.ndarray) -> np.ndarray:
    """Return the faces of a whole body that are across the component that is held.

    All nodes of a plane problem that is meshed in space are held along its normal: the
    two planes across it are enough.
    """
    mesh = reading.mesh
    bodies = np.unique(mesh.bodies[mesh.cell_of_face[faces]])
    every = np.flatnonzero(mesh.outer)
    every = every[np.isin(mesh.bodies[mesh.cell_of_face[every]], bodies)]
    if len(faces) < len(every) or not len(faces):
        return faces
    axes = _axes_of(reading, held)
    directions = np.zeros((len(faces), mesh.d))
    directions[:, held.component - 1] = 1.0
    if axes is not None:
        directions = axes.at(mesh.centres(faces))[:, held.component - 1]
    across = abs(np.einsum("fi,fi->f", mesh.normals(faces), directions)) > 1 - FLAT
    covered = np.isin(mesh.corners(faces), mesh.corners(faces[across])).all()
    return faces[across] if covered else faces


def _is_whole_body(reading: DeckReading, nodes: np.ndarray) -> bool:
    """Tell whether nodes are all corners of the bodies on which they are."""
    mesh = reading.mesh
    body_of_node = mesh.body_of_node
    bodies = np.unique(body_of_node[nodes])
    corners = np.flatnonzero(mesh.corner_count)
    return bool(np.isin(corners[np.isin(body_of_node[corners], bodies)], nodes).all())


def _other_component(reading: DeckReading, held: Held) -> None:
    """Tell of a component that the points of a solid do not have."""
    if held.component == 11:
        reading.told.refuse(held.card, "component 11, a temperature: give *TEMPERATURE.")
    else:
        reading.told.leave_out(
            held.card, f"component {held.component}, which points of this body do not have"
        )


def _axes_of(reading: DeckReading, held: Held) -> Axes | None:
    """Return the local axes of nodes, None where they are of the coordinates."""
    for axes in reading.transforms:
        if np.isin(held.nodes, axes.nodes).any():
            return axes
    return None


def _in_axes(
    reading: DeckReading,
    entry: Entry,
    held: Held,
    faces: np.ndarray,
    name: str,
    axes: Axes,
    value: Affine,
) -> HeldFaces | None:
    """Return faces that are held along a local axis."""
    mesh = reading.mesh
    d = mesh.d
    every = [
        entry_beside.what
        for entry_beside in reading.steps.entries["held"]
        if np.array_equal(entry_beside.what.nodes, held.nodes)
    ]
    components = {beside.component for beside in every if not beside.values.any()}
    if components >= set(range(1, d + 1)) and len(faces):
        # What does not move at all does not move along any axis.
        return HeldFaces(name, faces, held.component - 1, Affine(0.0, (0.0,) * d), entry)
    number = held.component - 1
    zero = Affine(0.0, (0.0,) * d)
    if len(faces):
        directions = axes.at(mesh.centres(faces))[:, number]
        along = np.flatnonzero((abs(directions) > 1 - FLAT).all(axis=0))
        if len(along):
            # A local axis that is an axis of coordinates, perhaps the other way round.
            sign = float(np.sign(directions[0, along[0]]))
            return HeldFaces(name, faces, int(along[0]), value.times(sign), entry)
        cosines = np.einsum("fi,fi->f", mesh.normals(faces), directions)
        if not held.values.any() and (abs(cosines) > 1 - FLAT).all():
            return HeldFaces(name, faces, SYMMETRY, zero, entry)
        if not held.values.any() and axes.cylindrical and number == 0:
            return HeldFaces(name, faces, RADIAL, zero, entry, axes)
    reading.told.refuse(
        held.card,
        f"{name!r} is held along local axes of {axes.card.place}: planes across such an axis, "
        "cylinders along their radius, and sets that are held in all components are read.",
    )
    return None


def _by_planes(reading: DeckReading, held: HeldFaces) -> list[HeldFaces]:
    """Return faces on planes of symmetry plane by plane, other faces as they are."""
    if held.component != SYMMETRY:
        return [held]
    normals = np.round(reading.mesh.normals(held.faces), 4)
    planes, plane = np.unique(normals, axis=0, return_inverse=True)
    if len(planes) == 1:
        return [held]
    result = []
    for number in range(len(planes)):
        faces = held.faces[plane.ravel() == number]
        result.append(replace(held, name=f"{held.name} {number + 1}", faces=faces))
    return result


def _check_points(
    reading: DeckReading, result: list[HeldFaces], points: list[tuple[Entry, np.ndarray, int]]
) -> None:
    """Leave points out that faces hold, or that stop rigid motions alone."""
    mesh = reading.mesh
    left: list[tuple[Entry, np.ndarray, int]] = []
    for entry, nodes, component in points:
        on_faces = [
            mesh.nodes_of_faces(held.faces) for held in result if held.component == component
        ]
        covered = np.isin(nodes, np.concatenate([np.empty(0, dtype=np.int64), *on_faces]))
        free = nodes[~covered]
        if len(free) and _is_whole_body(reading, entry.what.nodes):
            reading.told.assume(
                entry.what.card,
                f"{entry.what.name!r} is held on its faces, not at its nodes inside the body",
            )
            free = np.intersect1d(free, mesh.nodes_of_faces(np.flatnonzero(mesh.outer)))
        if len(free):
            left.append((entry, free, component))
    if not left:
        return
    first: Held = left[0][0].what
    numbers = sorted({int(mesh.numbers[node]) for _, nodes, _ in left for node in nodes[:4]})
    shown = ", ".join(map(str, numbers[:8])) + (", ..." if len(numbers) > 8 else "")
    moved = any(entry.what.values.any() for entry, _, _ in left)
    found = None if moved else _points_of_bodies(reading, result, left)
    if found is None:
        reading.told.refuse(first.card, f"nodes {shown} {NO_FORCE}")
        return
    reading.points = found
    reading.told.assume(
        first.card,
        f"nodes {shown} stop rigid motions alone: they are left out, and displacements are up to "
        "such a motion",
    )


def _points_of_bodies(
    reading: DeckReading, result: list[HeldFaces], left: list[tuple[Entry, np.ndarray, int]]
) -> list[HeldPoints] | None:
    """Return the points of each body, with the rigid motions that faces leave free.

    It is None unless points hold each of these motions once: only then their reactions
    follow from balance.
    """
    found = []
    mesh = reading.mesh
    count = 3 if mesh.d == 2 else 6
    nodes = np.concatenate([points for _, points, _ in left])
    components = np.repeat([component for *_, component in left], [len(p) for _, p, _ in left])
    body_of_points = mesh.body_of_node[nodes]
    for body in np.unique(body_of_points):
        rows_of_faces = []
        for held in result:
            faces = held.faces[mesh.bodies[mesh.cell_of_face[held.faces]] == body]
            rows_of_faces += _rows_of_faces(reading, held, faces)
        of_faces = np.concatenate([np.empty((0, count)), *rows_of_faces])
        free = _null_space(of_faces, count)
        if reading.is_ring:
            free = free[:, abs(free[1]) > RANK]
        here = body_of_points == body
        of_points = np.zeros((here.sum(), count))
        for component in range(mesh.d):
            along = components[here] == component
            x = mesh.x[nodes[here][along]]
            of_points[along] = _rigid_rows(x, component, ring=reading.is_ring)
        acting = of_points @ free
        size = np.linalg.norm(acting, axis=1)
        if (size <= RANK * abs(of_points).max(initial=0.0)).any():
            return None  # it resists a strain alone
        # Points on a line across a plane problem say the same.
        distinct = np.unique(np.round(acting / size[:, None], DIGITS), axis=0)
        if len(distinct) > np.linalg.matrix_rank(distinct, tol=10.0**-DIGITS):
            return None
        card = left[0][0].what.card
        points = HeldPoints(int(body), nodes[here], components[here], free, acting, card)
        found.append(points)
    return found


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
