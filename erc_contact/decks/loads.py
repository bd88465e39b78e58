"""Put the loads of a deck on faces and regions of the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from erc_contact.decks.affine import Affine, constant, fitted, linear_traction
from erc_contact.decks.conditions import FaceTraction, Gravity, NodalForces, Pressure, Spin
from erc_contact.decks.histories import Entry
from erc_contact.decks.plan import Shared, Volume
from erc_contact.decks.reading import Axes, DeckReading, MaterialCards
from erc_contact.decks.supports import HeldFaces
from erc_contact.scene.remote import moments_of
from namedmesh.for_solvers import components


@dataclass
class LoadedFaces:
    """Hold faces with a pressure or a traction.

    Attributes:
        name: Name of their set.
        faces: The faces.
        pressure: The pressure [force/area], or None.
        traction: The force per area, d values, without a pressure.
        entry: Its entry, with its history.
        set_name: Name of the set in the deck, "" where it has none.
        shared: The force that the faces share, where the traction stands for one.
    """

    name: str
    faces: np.ndarray
    pressure: Affine | None
    traction: tuple[Affine, ...]
    entry: Entry
    set_name: str
    shared: Shared | None = None


def loaded_faces(
    reading: DeckReading, held: list[HeldFaces], sides: np.ndarray, *, ring: bool, thickness: float
) -> list[LoadedFaces]:
    """Return the faces that the deck loads.

    Args:
        reading: The deck.
        held: Faces that it holds.
        sides: Faces of contacts and ties, which take no forces of nodes.
        ring: Whether the body is axisymmetric.
        thickness: Thickness of a plane body [length].
    """
    result = []
    names: dict[Any, str] = {}
    for entry in reading.steps.entries.get("pressure", []):
        load = entry.what
        name = load.name
        if not name:
            name = names.setdefault(load.faces.tobytes(), f"load {len(names) + 1}")
        if not reading.mesh.outer[load.faces].all():
            reading.told.refuse(load.card, f"{name!r} has faces inside the body.")
            continue
        of_faces = reading.shares[reading.mesh.cell_of_face[load.faces]]
        for share in np.unique(of_faces):
            there = of_faces == share
            result += _with_share(reading, entry, name, there, float(share))
    for entry in reading.steps.entries.get("forces", []):
        load = replace(entry, what=replace(entry.what, forces=entry.what.forces / thickness))
        result += forces_on_faces(reading, load, held, sides, names, ring=ring)
    return result


def _with_share(
    reading: DeckReading, entry: Entry, name: str, there: np.ndarray, share: float
) -> list[LoadedFaces]:
    """Return those faces of a load whose cells have a share of the thickness."""
    load: FaceTraction | Pressure = entry.what
    faces = load.faces[there]
    if isinstance(load, FaceTraction):
        traction = tuple(constant(value * share, reading.mesh.d) for value in load.value)
        return [LoadedFaces(name, faces, None, traction, entry, load.name)]
    pressure = fitted(reading.mesh.centres(faces), load.values[there] * share)
    if pressure is None:
        reading.told.refuse(load.card, f"the pressures of {name!r} are not linear in the position.")
        return []
    return [LoadedFaces(name, faces, pressure, (), entry, load.name)]


def forces_on_faces(
    reading: DeckReading,
    entry: Entry,
    held: list[HeldFaces],
    sides: np.ndarray,
    names: dict[Any, str],
    *,
    ring: bool,
) -> list[LoadedFaces]:
    """Return faces with the tractions that have the resultants of forces on nodes.

    Args:
        reading: The deck.
        entry: The forces [force/thickness of a plane body].
        held: Faces that the deck holds, which take no forces along what they hold.
        sides: Faces of contacts and ties, which take no forces.
        names: Names of nameless loads so far.
        ring: Whether the body is axisymmetric.
    """
    mesh = reading.mesh
    load: NodalForces = entry.what
    x = reading.mesh.mesh.points[load.nodes, : reading.mesh.d]
    every = in_coordinates(reading.transforms, load.nodes, x, load.forces)
    acting = abs(every).max(axis=1) > 0
    nodes = load.nodes[acting]
    forces = every[acting]
    if not len(nodes):
        return []
    used = mesh.node_is_used[nodes]
    if not used.all():
        number = mesh.numbers[nodes[~used][0]]
        reading.told.refuse(load.card, f"node {number} belongs to no solid element.")
        return []
    if ring:
        # The axis is no boundary.
        outer = np.flatnonzero(mesh.outer)
        on_axis = (mesh.x[mesh.corners(outer), 0] == 0.0).all(axis=1)
        sides = np.union1d(sides, outer[on_axis])
    free = np.setdiff1d(mesh.within(_with_middles(reading, nodes)), sides)
    # What is held later only takes forces till then.
    held = [support for support in held if support.entry.begin <= entry.begin]
    free = _free_faces(held, free, forces)
    result = []
    left = np.ones(len(nodes), dtype=bool)
    for faces in _connected(reading, free):
        on = np.isin(nodes, mesh.nodes_of_faces(faces)) & left
        left &= ~on
        if on.any():
            result.append((faces, on))
    for i in np.flatnonzero(left):
        around = np.setdiff1d(mesh.around(mesh.corners_near(nodes[i : i + 1])), sides)
        # The moment of a traction may have components that the force has not.
        whole = _free_faces(held, around, np.ones((1, mesh.d)))
        around = whole if len(whole) else _free_faces(held, around, forces[i : i + 1])
        if not len(around):
            reading.told.refuse(
                load.card,
                f"the force at node {mesh.numbers[nodes[i]]} has no free face beside it.",
            )
            continue
        on = np.zeros(len(nodes), dtype=bool)
        on[i] = True
        area = mesh.measures(around).sum()
        reading.told.assume(
            load.card, f"a force at a node acts on the faces around it, of area {area:.4g}"
        )
        result.append((around, on))
    loads = []
    for faces, on in result:
        there = mesh.mesh.points[nodes[on], : mesh.d]
        moment = moments_of(there, forces[on]).sum(axis=0)
        traction = traction_of(reading, faces, forces[on].sum(axis=0), moment, ring=ring)
        key = (load.name, faces.tobytes())
        name = load.name or names.setdefault(key, f"load {len(names) + 1}")
        loads.append(LoadedFaces(name, faces, None, traction, entry, load.name))
    reading.told.assume(
        load.card, "forces on nodes are a traction, linear on the face, of their force and moment"
    )
    return loads


def in_coordinates(
    transforms: Sequence[Axes], nodes: np.ndarray, x: np.ndarray, forces: np.ndarray
) -> np.ndarray:
    """Return forces on nodes by components of the coordinates, shape (n, d).

    Args:
        transforms: Local axes of some nodes.
        nodes: The nodes, shape (n,).
        x: Their places [length], shape (n, d).
        forces: Components along their axes [force], shape (n, 3).
    """
    result = forces[:, : x.shape[1]].copy()
    for axes in transforms:
        rows = np.isin(nodes, axes.nodes)
        result[rows] = np.einsum("nk,nki->ni", forces[rows], axes.at(x[rows]))
    return result


def _with_middles(reading: DeckReading, nodes: np.ndarray) -> np.ndarray:
    """Return nodes with the corners between which they lie.

    Consistent forces of elements of second order may leave corners out.
    """
    return np.union1d(nodes, reading.mesh.corners_near(nodes))


def _free_faces(held: list[HeldFaces], faces: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the faces among some that no support holds along forces."""
    for support in held:
        if support.component < 0 or abs(forces[:, support.component]).max() > 0:
            faces = np.setdiff1d(faces, support.faces)
    return faces


def _connected(reading: DeckReading, faces: np.ndarray) -> list[np.ndarray]:
    """Return faces in groups that are connected by common points."""
    corners = reading.mesh.corners(faces)
    node = corners.ravel()
    face = np.repeat(np.arange(len(faces)), corners.shape[1])
    order = np.argsort(node, kind="stable")
    is_same = np.diff(node[order]) == 0
    links = np.column_stack([face[order][:-1][is_same], face[order][1:][is_same]])
    group = components(len(faces), links)
    return [faces[group == number] for number in np.unique(group)]


def traction_of(
    reading: DeckReading, faces: np.ndarray, force: np.ndarray, moment: np.ndarray, *, ring: bool
) -> tuple[Affine, ...]:
    """Return the linear traction on faces of a force, and a moment about the origin."""
    mesh = reading.mesh
    points = mesh.x[mesh.simplices(faces)]
    measures = mesh.measures(faces)
    if ring:
        around = 2 * np.pi * points[:, :, 0].mean(axis=1)
        area = float((around * measures).sum())
        return tuple(constant(value / area, mesh.d) for value in force)
    return tuple(linear_traction(force, moment, points, measures))


# --- loads in the body


def volumes_of(
    reading: DeckReading,
    regions: Mapping[str, np.ndarray],
    materials: Mapping[str, MaterialCards],
) -> list[Entry]:
    """Return the forces per volume."""
    result = []
    for entry in reading.steps.entries.get("body", []):
        load = entry.what
        values = {}
        for region, cells in regions.items():
            inside = np.isin(cells, load.cells)
            density = materials[region].density
            if inside.all() and density is None:
                reading.told.refuse(load.card, f"{materials[region].name!r} has no *DENSITY.")
                return []
            if inside.any() and not inside.all():
                reading.told.refuse(load.card, f"it acts on a part of the region {region!r}.")
                return []
            values[region] = (density or 0.0) * float(inside.all())
        force = _force_per_mass(load, reading.mesh.d)
        whole = len(set(values.values())) == 1
        for region, density in values.items():
            value = tuple(component.times(density) for component in force)
            if density:
                result.append(replace(entry, what=Volume(None if whole else region, value)))
            if whole:
                break
    return result


def _force_per_mass(load: Gravity | Spin, d: int) -> tuple[Affine, ...]:
    """Return the force per mass of gravity or of a rotation."""
    if isinstance(load, Gravity):
        return tuple(constant(value, d) for value in load.acceleration)
    direction = np.array(load.direction)
    length = np.linalg.norm(direction)
    direction = direction / (length if length else 1.0)
    across = np.eye(3) - np.outer(direction, direction)
    slopes = load.square * across
    origin = -slopes @ np.array(load.point)
    result = []
    for i in range(d):
        result.append(Affine(float(origin[i]), tuple(float(value) for value in slopes[i, :d])))
    return tuple(result)
