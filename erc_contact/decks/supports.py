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
from erc_contact.decks.reading import Axes, DeckReading

FLAT = 1e-6
"""Sine of an angle that is none [-]."""
LonePoints = tuple[Entry, np.ndarray, int]
"""An entry, points of its nodes that no face holds, and a component from 0."""


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


def held_faces(reading: DeckReading) -> tuple[list[HeldFaces], list[LonePoints]]:
    """Return the faces that the deck holds, and points that it holds beside them."""
    mesh = reading.mesh
    result: list[HeldFaces] = []
    points: list[LonePoints] = []
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
        # What does not move at all does not move along any axis.
        axes = None if _is_fixed(reading, held) else _axes_of(reading, held)
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
        if held.is_fixed and (axes is not None or not on_faces.all()):
            reading.told.refuse(
                held.card,
                f"FIXED: {name!r} has nodes beside its faces, or local axes: give their "
                "displacements in numbers.",
            )
            continue
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
    return result, _alone(reading, result, points)


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


def _is_fixed(reading: DeckReading, held: Held) -> bool:
    """Tell whether nodes are held at 0 in all components."""
    components = set()
    for entry in reading.steps.entries["held"]:
        beside: Held = entry.what
        if np.array_equal(beside.nodes, held.nodes) and not beside.values.any():
            components.add(beside.component)
    return components >= set(range(1, reading.mesh.d + 1))


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
    number = held.component - 1
    zero = Affine(0.0, (0.0,) * mesh.d)
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


def _alone(
    reading: DeckReading, result: list[HeldFaces], points: list[LonePoints]
) -> list[LonePoints]:
    """Return points that no face holds."""
    mesh = reading.mesh
    left: list[LonePoints] = []
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
    return left
