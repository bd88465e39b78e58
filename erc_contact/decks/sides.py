"""Take the surfaces of contact pairs and ties apart from what else is said of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from erc_contact.decks.claims import Claims
from erc_contact.decks.distances import DrawnDistance, outward_triangles
from erc_contact.decks.loads import LoadedFaces
from erc_contact.decks.pairs import distance_between, surfaces_of
from erc_contact.decks.plan import DeckJoint, DeckPlan
from erc_contact.decks.reading import DeckReading, Facing, Interaction
from erc_contact.decks.supports import HeldFaces

NEAR = 0.5
"""Distance over the size of a face below which it may touch [-]."""


@dataclass
class PairSide:
    """Hold a surface of a pair.

    Attributes:
        name: Its name.
        faces: Its faces that may touch.
        acting: Faces among them that face the other surface.
        claim: Number of its claim.
    """

    name: str
    faces: np.ndarray
    acting: np.ndarray
    claim: int = -1


@dataclass
class Pair:
    """Hold the two sides of a pair, slave first."""

    facing: Facing
    sides: tuple[PairSide, PairSide]


def pairs_of(reading: DeckReading) -> list[Pair]:
    """Return the pairs of a deck with the faces of their sides."""
    result = []
    for facing in reading.facings:
        found = surfaces_of(reading, facing)
        if found is None:
            continue
        slave, master = found
        here = distance_between(reading.mesh, slave, master).faces
        there = distance_between(reading.mesh, master, slave).faces
        if not len(here) or not len(there):
            reading.told.refuse(
                facing.card, f"{facing.slave!r} and {facing.master!r} do not face each other."
            )
            continue
        sides = (PairSide(facing.slave, slave, here), PairSide(facing.master, master, there))
        result.append(Pair(facing, sides))
    return result


def faces_of_pairs(pairs: list[Pair]) -> np.ndarray:
    """Return the faces that face another surface."""
    acting = [side.acting for pair in pairs for side in pair.sides]
    return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *acting]))


def free_of_supports(reading: DeckReading, pairs: list[Pair], held: list[HeldFaces]) -> None:
    """Take supports from faces of pairs where their nodes are held beside them.

    Other faces with a support leave the pair.
    """
    acting = faces_of_pairs(pairs)
    corners = reading.mesh.corners
    for support in held:
        shared = np.intersect1d(support.faces, acting)
        if not len(shared):
            continue
        beside = np.setdiff1d(support.faces, acting)
        held_nodes = [
            corners(np.setdiff1d(known.faces, acting)).ravel()
            for known in held
            if known.component == support.component
        ]
        is_held = np.isin(corners(shared), np.concatenate(held_nodes)).all()
        if is_held and support.component >= 0:
            support.faces = beside
            reading.told.assume(
                support.entry.what.card,
                f"{support.name!r} holds no faces of a contact or tie, as their nodes are held "
                "beside it",
            )
    held[:] = [support for support in held if len(support.faces)]
    for support in held:
        _leave(reading, pairs, support.name, support.faces)


def free_of_loads(reading: DeckReading, pairs: list[Pair], loads: list[LoadedFaces]) -> None:
    """Take loaded faces out of pairs."""
    for load in loads:
        _leave(reading, pairs, load.name, load.faces)


def _leave(reading: DeckReading, pairs: list[Pair], name: str, faces: np.ndarray) -> None:
    """Take faces out of pairs; refuse those that are near the other surface."""
    mesh = reading.mesh
    for pair in pairs:
        slave, master = pair.sides
        for side, facing_side in ((slave, master), (master, slave)):
            shared = np.intersect1d(side.acting, faces)
            if len(shared):
                away = distance_between(mesh, shared, facing_side.faces).greatest
                size = (
                    np.sqrt(mesh.measures(shared).max())
                    if mesh.d == 3
                    else mesh.measures(shared).max()
                )
                words = f"{len(shared)} faces of {side.name!r} are in {name!r}, too"
                if away < NEAR * size:
                    reading.told.refuse(
                        pair.facing.card,
                        f"{words}: a face that may touch can be in the pair alone.",
                    )
                else:
                    reading.told.assume(pair.facing.card, f"{words}, and not in the pair")
            side.acting = np.setdiff1d(side.acting, faces)
            side.faces = np.setdiff1d(side.faces, faces)


def claim_sides(claims: Claims, pairs: list[Pair]) -> None:
    """Claim the faces of the sides of pairs."""
    for pair in pairs:
        for side in pair.sides:
            side.claim = claims.add(side.name, side.faces)


def plan_pairs(
    plan: DeckPlan,
    reading: DeckReading,
    pairs: list[Pair],
    parts: dict[str, np.ndarray],
    names: list[tuple[str, ...]],
) -> None:
    """Add contacts and tied joints of parts to a plan."""
    mesh = reading.mesh
    for pair in pairs:
        facing = pair.facing
        bodies = [mesh.bodies[mesh.cell_of_face[side.faces]] for side in pair.sides]
        if np.intersect1d(*bodies).size:
            reading.told.refuse(
                facing.card,
                f"{facing.slave!r} and {facing.master!r} are on one connected body: contact of a "
                "body with itself is not read.",
            )
            continue
        slave, master = pair.sides
        for here in names[slave.claim]:
            for there in names[master.claim]:
                found = distance_between(mesh, parts[here], parts[there])
                if len(found.faces):
                    joint = _joint(reading, facing, here, there, found.greatest)
                    if joint.apart and mesh.d == 3:
                        sides = [outward_triangles(mesh, parts[name]) for name in (here, there)]
                        joint = replace(joint, drawn=DrawnDistance(sides[0], sides[1], joint.gap))
                    plan.joints.append(joint)


def _joint(reading: DeckReading, facing: Facing, here: str, there: str, apart: float) -> DeckJoint:
    """Return the contact or the tied joint of two parts."""
    if facing.tied:
        return DeckJoint(here, there, "tied")
    interaction = reading.interactions.get(facing.interaction)
    if interaction is None:
        reading.told.refuse(
            facing.card, f"no *SURFACE INTERACTION is called {facing.interaction!r}."
        )
        interaction = Interaction(facing.card)
    if interaction.behavior == "TIED":
        return DeckJoint(here, there, "tied")
    gap = reading.clearances.get((facing.slave.upper(), facing.master.upper()), 0.0)
    if gap and apart:
        reading.told.assume(
            facing.card, f"its *CLEARANCE adds to the distance of up to {apart:.3g} that is drawn"
        )
    is_kept = reading.penalty == "kept"
    return DeckJoint(
        here,
        there,
        "contact",
        apart,
        interaction.friction,
        gap,
        None,
        facing.card,
        interaction.stiffness if is_kept else None,
        interaction.stick if is_kept else None,
    )
