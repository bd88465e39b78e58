"""Put rigid faces, coupled surfaces and cuts of bolts on faces of the body."""

from __future__ import annotations

import numpy as np

from erc_contact.decks.claims import Claims
from erc_contact.decks.loads import LoadedFaces, traction_of
from erc_contact.decks.pad_faces import pads_at
from erc_contact.decks.plan import DeckJoint, DeckPlan, RigidPart, Shared
from erc_contact.decks.reading import DeckReading, Grip
from erc_contact.scene.remote import moments_of

Gripped = list[tuple[Grip, np.ndarray]]
"""Couplings with their faces."""


def gripped_faces(reading: DeckReading) -> Gripped:
    """Return the faces of rigid bodies and couplings."""
    mesh = reading.mesh
    result = []
    for grip in reading.grips:
        faces = mesh.surface(grip.surface) if grip.surface else _faces_of_nodes(reading, grip)
        if faces is None or not len(faces):
            reading.told.refuse(grip.card, f"{grip.name!r} has no face of a solid.")
        elif not set(range(1, mesh.d + 1)) <= set(grip.components):
            reading.told.refuse(
                grip.card, "all displacements of the surface are coupled, or none: give 1, 3."
            )
        else:
            result.append((grip, faces))
    return result


def _faces_of_nodes(reading: DeckReading, grip: Grip) -> np.ndarray:
    """Return the faces of nodes, or a pad where they have no whole face."""
    mesh = reading.mesh
    faces = mesh.within(grip.nodes)
    nodes = grip.nodes[mesh.node_is_used[grip.nodes]]
    if len(faces) or not len(nodes):
        return faces
    pads = pads_at(mesh, nodes, np.flatnonzero(mesh.outer), np.zeros(mesh.d))
    if pads:
        reading.told.assume(
            grip.card,
            f"{grip.name!r} has nodes alone: the faces around them, of area "
            f"{mesh.measures(pads[0]).sum():.4g}, stand for them",
        )
        return pads[0]
    return faces


def shared_forces(reading: DeckReading, grips: Gripped, thickness: float) -> list[LoadedFaces]:
    """Return the tractions of forces on nodes that surfaces share."""
    mesh = reading.mesh
    result = []
    for grip, faces in grips:
        if grip.rigid:
            continue
        for entry in reading.steps.entries.get("grip", []):
            if entry.key[0] == grip.reference:
                reading.told.refuse(
                    grip.card, "a node of *DISTRIBUTING moves as its surface: load it alone."
                )
        for entry in reading.steps.entries.get("grip force", []):
            number, component = entry.key
            if number != grip.reference:
                continue
            force = np.zeros(3)
            moment = np.zeros(3)
            target = force if component <= 3 else moment
            target[(component - 1) % 3] = entry.what / thickness
            if moment.any() and grip.place is not None:
                reading.told.refuse(
                    grip.card, "nodes that share a force by weights take no moment: *COUPLING does."
                )
            force = force[: mesh.d]
            at = mesh.x[number] if grip.place is None else np.array(grip.place[: mesh.d])
            moment = moment if mesh.d == 3 else moment[2:]
            about_origin = moment + moments_of(at, force)
            traction = traction_of(reading, faces, force, about_origin, ring=reading.is_ring)
            numbers = [tuple(map(float, values)) for values in (force, moment, at)]
            shared = Shared(numbers[0], numbers[1], numbers[2])
            load = LoadedFaces(grip.name, faces, None, traction, entry, grip.name, shared)
            result.append(load)
            reading.told.assume(
                grip.card,
                "a shared force is a traction, linear on the face, of its force and moment",
            )
    return result


def plan_grips(
    plan: DeckPlan, reading: DeckReading, grips: Gripped, names: list[tuple[str, ...]]
) -> None:
    """Add rigid faces to a plan."""
    for (grip, _), parts in zip(grips, names, strict=True):
        if not grip.rigid:
            continue
        if len(parts) > 1:
            reading.told.refuse(
                grip.card,
                f"{grip.name!r} shares faces with other supports, loads or surfaces: "
                f"{', '.join(parts)}.",
            )
            continue
        about = tuple(float(value) for value in reading.mesh.x[grip.reference])
        plan.rigids.append(RigidPart(parts[0], grip.reference, grip.rotation, about))
    for kind in ("grip", "grip force", "locked"):
        plan.entries[kind] = reading.steps.entries.get(kind, [])


def claim_cuts(reading: DeckReading, claims: Claims) -> list[int]:
    """Claim the faces of cuts through bolts."""
    result = []
    for pretension in reading.pretensions:
        faces = reading.mesh.surface(pretension.surface)
        assert faces is not None  # regions were cut there
        result.append(claims.add(pretension.surface, faces))
    return result


def plan_cuts(
    plan: DeckPlan,
    reading: DeckReading,
    regions: dict[str, np.ndarray],
    names: list[tuple[str, ...]],
) -> None:
    """Add cuts through bolts to a plan."""
    mesh = reading.mesh
    region_of_cell = np.full(mesh.body.count, -1)
    for number, cells in enumerate(regions.values()):
        region_of_cell[cells] = number
    called = list(regions)
    for pretension, parts in zip(reading.pretensions, names, strict=True):
        inner = mesh.cells_of_surface(pretension.surface)
        faces = mesh.surface(pretension.surface)
        assert faces is not None
        outer = np.setdiff1d(mesh.cells_at(faces), inner)
        here = np.unique(region_of_cell[inner])
        there = np.unique(region_of_cell[outer])
        if len(here) != 1 or len(there) != 1 or len(parts) != 1:
            reading.told.refuse(
                pretension.card, "its cut is not between two pieces of one section each."
            )
            continue
        given = np.array((*pretension.normal, 0.0, 0.0, 0.0))[: mesh.d]
        outward = mesh.centres(faces) - mesh.middles[inner].mean(axis=0)
        normals = mesh.normals(faces)
        turned = np.sign(np.einsum("fi,fi->f", normals, outward))
        along = float((turned[:, None] * normals).sum(axis=0) @ given)
        sides = (f"{pretension.surface} side 1", f"{pretension.surface} side 2")
        plan.joints.append(
            DeckJoint(
                *sides,
                "preload",
                node=pretension.node,
                sign=-1 if along < 0 else 1,
                on=parts[0],
                regions=(called[int(here[0])], called[int(there[0])]),
            )
        )
