"""Make the plan of a deck: put what it says on parts of the boundary and on regions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from erc_contact.decks.balance import reactions_of, works_of
from erc_contact.decks.claims import INNER, Claims
from erc_contact.decks.grips import (
    Gripped,
    claim_cuts,
    gripped_faces,
    plan_cuts,
    plan_grips,
    shared_forces,
)
from erc_contact.decks.heat import expansions_of, heat_of, temperatures_of
from erc_contact.decks.histories import Entry
from erc_contact.decks.inner_forces import forces_inside, spread
from erc_contact.decks.loads import LoadedFaces, loaded_faces, volumes_of
from erc_contact.decks.materials import (
    eigenstrains_of,
    hypothesis_of,
    material_of,
    thickness_of,
)
from erc_contact.decks.pads import bands_of, load_pads, pads_of
from erc_contact.decks.pairs import adjusted
from erc_contact.decks.plan import DeckPlan, HeldParts, Plane, PushedParts, Radial
from erc_contact.decks.points import (
    NO_FORCE,
    follow_from_balance,
    free_motions,
    points_of_bodies,
    reactions_as_loads,
)
from erc_contact.decks.reading import DeckReading, MaterialCards
from erc_contact.decks.regions import regions_of
from erc_contact.decks.sides import (
    Pair,
    claim_sides,
    faces_of_pairs,
    free_of_loads,
    free_of_supports,
    pairs_of,
    plan_pairs,
)
from erc_contact.decks.supports import RADIAL, SYMMETRY, HeldFaces, LonePoints, held_faces
from erc_contact.scene.material import AXISYMMETRIC

Members = dict[str, np.ndarray]
"""Name of each part -> its faces, or of each region -> its cells."""
NONE = np.empty(0, dtype=np.int64)
"""No faces."""
EVEN = 1e-9
"""Difference of unit normals that is none [-]."""


def plan_of(reading: DeckReading) -> tuple[DeckPlan, Members, Members]:
    """Make the plan of a deck; what cannot be taken is told as refused.

    Returns:
        The plan, the cells of each region, and the faces of each part.
    """
    told = reading.told
    reading.mesh = adjusted(reading)
    hypothesis = hypothesis_of(reading)
    reading.is_ring = hypothesis == AXISYMMETRIC
    thickness = thickness_of(reading, hypothesis)
    temperatures = temperatures_of(reading)
    regions, cards = regions_of(reading)
    plan = DeckPlan(reading.mesh.d, _materials(reading, cards, hypothesis, temperatures), thickness)
    plan.alphas = expansions_of(reading, cards, temperatures)
    plan.times = list(reading.steps.times)
    if told.refused:
        return plan, {}, {}
    plan.eigenstrains = eigenstrains_of(reading, regions, plan.material)
    pairs = pairs_of(reading)
    held, lone = held_faces(reading)
    grips = gripped_faces(reading)
    free_of_supports(reading, pairs, held)
    sides = faces_of_pairs(pairs)
    inside = forces_inside(reading)
    loads = loaded_faces(reading, held, sides, ring=reading.is_ring, thickness=thickness)
    loads += shared_forces(reading, grips, thickness)
    free_of_loads(reading, pairs, loads)
    volumes = volumes_of(reading, regions, cards)
    reactions, pads = _supported_points(reading, lone, held, pairs, loads, volumes, inside, regions)
    loads += reactions
    grips += pads
    load_pads(reading, grips, loads, thickness)
    if told.refused:
        return plan, {}, {}
    known = _known_sets(reading)
    claims = Claims({faces.tobytes(): name for name, faces in known.items()})
    of_held = [claims.add(support.set_name, support.faces) for support in held]
    of_loads = [claims.add(load.set_name, load.faces) for load in loads]
    of_grips = [claims.add(grip.name, faces) for grip, faces in grips]
    of_cuts = claim_cuts(reading, claims)
    claim_sides(claims, pairs)
    parts, names = claims.parts()
    _add_unclaimed(parts, known)
    _plan_supports(plan, reading, held, [names[i] for i in of_held], parts)
    _plan_loads(plan, loads, [names[i] for i in of_loads])
    plan_grips(plan, reading, grips, [names[i] for i in of_grips])
    plan_cuts(plan, reading, regions, [names[i] for i in of_cuts])
    plan_pairs(plan, reading, pairs, parts, names)
    _check_fixed(plan, reading, held, cards)
    plan.entries["volume"] = volumes
    plan.entries["inside"] = [spread(reading, entry, thickness) for entry in inside]
    if any(plan.alphas.values()):
        plan.entries["heat"] = heat_of(reading)
    return plan, regions, parts


def _supported_points(
    reading: DeckReading,
    lone: list[LonePoints],
    held: list[HeldFaces],
    pairs: list[Pair],
    loads: list[LoadedFaces],
    volumes: list[Entry],
    inside: list[Entry],
    regions: Members,
) -> tuple[list[LoadedFaces], Gripped]:
    """Return what stands for points that are held: their reactions, and rigid pads."""
    mesh = reading.mesh
    sides = np.concatenate([NONE, *(side.faces for pair in pairs for side in pair.sides)])
    taken = [sides, *(support.faces for support in held)]
    in_pairs = mesh.bodies[mesh.cell_of_face[sides]]
    every = np.concatenate(mesh.body.numbers)
    in_body = []
    for entry in volumes:
        region = entry.what.region
        in_body.append((entry, every if region is None else regions[region], entry.what.value))
    ring = reading.is_ring
    reactions = []
    pads: Gripped = []
    for points in points_of_bodies(reading, lone):
        free = free_motions(reading, held, points.body)
        rows = points.rows(mesh.x, ring=ring)
        acting = rows @ free
        if points.values.any() or not follow_from_balance(reading, held, points, acting, rows):
            if ring:
                held += bands_of(reading, points, held, sides)
            else:
                pads += pads_of(reading, points, np.concatenate(taken))
            continue
        # What a contact carries is not known before the solution.
        works = []
        if points.body not in in_pairs:
            works = works_of(reading, loads, in_body, inside, points.body, ring=ring)
        found = reactions_of(works, free, acting)
        if found is None:
            reading.told.refuse(points.card, f"{points.words()} {NO_FORCE}")
        else:
            reactions += reactions_as_loads(reading, held, points, found)
    return reactions, pads


def _known_sets(reading: DeckReading) -> Members:
    """Return the faces of surfaces and sets of nodes of the deck, surfaces last."""
    mesh = reading.mesh
    result = {}
    for space in mesh.spaces:
        for key, rows in space.node_sets.items():
            name = space.spelling.get(key, key)
            if key in space.listed and not INNER.match(name):
                result[name] = mesh.within(np.unique(np.asarray(rows, dtype=np.int64)))
    for name in [*mesh.tables.surfaces, *mesh.tables.node_surfaces]:
        faces = mesh.surface(name)
        if faces is not None and not INNER.match(name):
            result[name] = faces[mesh.outer[faces]]
    whole = int(mesh.outer.sum())
    return {name: faces for name, faces in result.items() if 0 < len(faces) < whole}


def _add_unclaimed(parts: Members, known: Members) -> None:
    """Add sets of faces of which no card speaks, as parts that results may name."""
    for name, faces in reversed(known.items()):
        taken = np.concatenate([np.empty(0, dtype=np.int64), *parts.values()])
        if name not in parts and not np.isin(faces, taken).any():
            parts[name] = faces


def _materials(
    reading: DeckReading,
    cards: dict[str, MaterialCards],
    hypothesis: str,
    temperatures: np.ndarray | None,
) -> dict[str, Any]:
    """Return the material of each region; regions of one material share it."""
    made: dict[int, Any] = {}
    result = {}
    for region, material in cards.items():
        if id(material) not in made:
            made[id(material)] = material_of(reading, material, hypothesis, temperatures)
        result[region] = made[id(material)]
    return result


def _plan_supports(
    plan: DeckPlan,
    reading: DeckReading,
    held: list[HeldFaces],
    names: list[tuple[str, ...]],
    faces: Members,
) -> None:
    """Add supports on parts to a plan."""
    entries = []
    for support, parts in zip(held, names, strict=True):
        if support.component == SYMMETRY:
            plan.planes += [_plane(reading, part, faces[part]) for part in parts]
        elif support.component == RADIAL and support.axes is not None:
            origin = tuple(map(float, support.axes.origin[: plan.d]))
            axis = tuple(map(float, support.axes.axes[2, : plan.d]))
            plan.radials += [Radial(part, origin, axis) for part in parts]
        else:
            is_fixed = support.entry.what.is_fixed
            what = HeldParts(parts, support.component, support.value, is_fixed)
            entries.append(replace(support.entry, what=what))
    plan.entries["held"] = entries


def _check_fixed(
    plan: DeckPlan,
    reading: DeckReading,
    held: list[HeldFaces],
    materials: dict[str, MaterialCards],
) -> None:
    """Refuse faces that stay where a step has left them, if that depends on its way."""
    rubs = any(joint.friction for joint in plan.joints)
    yields = any(material.plastic for material in materials.values())
    for support in held:
        if support.entry.what.is_fixed and (rubs or yields):
            reading.told.refuse(
                support.entry.what.card,
                "FIXED: with *FRICTION or *PLASTIC what a step reaches depends on its way; give "
                "the displacements in numbers.",
            )


def _plane(reading: DeckReading, part: str, faces: np.ndarray) -> Plane:
    """Return a part on a plane of symmetry; numbers of a deck may leave it uneven."""
    normals = reading.mesh.normals(faces)
    mean = normals.mean(axis=0)
    mean /= np.linalg.norm(mean)
    if abs(normals - mean).max() < EVEN:
        return Plane(part, None)
    return Plane(part, tuple(map(float, mean)))


def _plan_loads(plan: DeckPlan, loads: list[LoadedFaces], names: list[tuple[str, ...]]) -> None:
    """Add loads on parts to a plan."""
    for load, parts in zip(loads, names, strict=True):
        # On faces of several parts the traction itself stands for a shared force.
        if load.shared is not None and len(parts) == 1:
            shared = replace(load.entry, what=replace(load.shared, part=parts[0]))
            plan.entries.setdefault("shared", []).append(shared)
        else:
            what = PushedParts(parts, load.pressure, load.traction)
            plan.entries.setdefault("pushed", []).append(replace(load.entry, what=what))
