"""Hold a deck as parts, regions and numbers, from which scenes are made at any time.

It is plain data, so that rank 0 can send it to all ranks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from erc_contact.decks.affine import Affine
from erc_contact.decks.distances import DrawnDistance
from erc_contact.decks.histories import Entry
from erc_contact.decks.nodal import NodalTable
from namedmesh.for_solvers import Card


@dataclass(frozen=True)
class HeldParts:
    """Hold parts of which a component of the displacement is prescribed.

    Attributes:
        parts: Their names.
        component: The component, from 0.
        value: The displacement [length].
        is_fixed: Whether it is what the step before has reached.
    """

    parts: tuple[str, ...]
    component: int
    value: Affine
    is_fixed: bool = False


@dataclass(frozen=True)
class PushedParts:
    """Hold parts with a pressure, or with a traction of d components."""

    parts: tuple[str, ...]
    pressure: Affine | None = None
    traction: tuple[Affine, ...] = ()


@dataclass(frozen=True)
class Shared:
    """Hold a force at a point that a part shares, with a moment about the point.

    Attributes:
        force: Resultant [force], d numbers.
        moment: Moment [force length], one number in the plane, else three.
        at: The point [length], d numbers.
        part: Name of the part.
    """

    force: tuple[float, ...]
    moment: tuple[float, ...]
    at: tuple[float, ...]
    part: str = ""


@dataclass(frozen=True)
class Volume:
    """Hold a force per volume in a region, or in the whole body; d components."""

    region: str | None
    value: tuple[Affine, ...]


@dataclass(frozen=True)
class Inside:
    """Hold a force per volume around nodes inside bodies; d components."""

    value: tuple[NodalTable, ...]


@dataclass(frozen=True)
class Heat:
    """Hold a change of the temperature in the whole body."""

    change: Affine | NodalTable


@dataclass(frozen=True)
class Plane:
    """Hold a part on a plane of symmetry, and its normal if it is not quite flat."""

    part: str
    normal: tuple[float, ...] | None


@dataclass(frozen=True)
class Radial:
    """Hold parts on a cylinder that do not move along its radius."""

    part: str
    origin: tuple[float, ...]
    axis: tuple[float, ...]


@dataclass(frozen=True)
class DeckJoint:
    """Hold two parts that are joined: a contact, a tied joint or a cut.

    Attributes:
        here: Name of the first part.
        there: Name of the second part.
        kind: "contact", "tied" or "preload".
        apart: Greatest distance of both parts [length].
        friction: Coulomb's coefficient [-].
        gap: Distance that the deck gives beside the drawn distance [length].
        drawn: The drawn distance, where the mesh may lose it.
        card: The card of the pair, for notes.
        normal: Stiffness of a layer [force/length^3], or None.
        tangential: The same along it.
        node: Reference node of a preload.
        sign: 1 if a positive force at this node draws both sides together, else -1.
        on: Name of the part inside that is the cut.
        regions: Names of the regions on both sides of a cut.
    """

    here: str
    there: str
    kind: str
    apart: float = 0.0
    friction: float = 0.0
    gap: float = 0.0
    drawn: DrawnDistance | None = None
    card: Card | None = None
    normal: float | None = None
    tangential: float | None = None
    node: int = 0
    sign: int = 1
    on: str = ""
    regions: tuple[str, str] = ("", "")


@dataclass(frozen=True)
class RigidPart:
    """Hold a part that moves as a rigid body with a reference node."""

    part: str
    reference: int
    rotation: int | None
    about: tuple[float, ...]


@dataclass
class DeckPlan:
    """Hold all that scenes of a deck are made of.

    Attributes:
        d: Dimension.
        material: Material of each region.
        thickness: Thickness by which forces are divided [length].
        alphas: Coefficient of expansion of each region [1/temperature], a number or a
            callable of x.
        eigenstrains: Strains of regions at the beginning, 3 rows of 3 [-].
        planes: Parts on planes of symmetry.
        radials: Parts held along the radius of a cylinder.
        joints: Contacts, tied joints and cuts.
        rigids: Rigid faces.
        entries: What is prescribed in time, by its kind.
        times: Ends of the steps.
    """

    d: int
    material: Mapping[str, Any]
    thickness: float = 1.0
    alphas: Mapping[str, Any] = field(default_factory=dict)
    eigenstrains: Mapping[str, Any] = field(default_factory=dict)
    planes: list[Plane] = field(default_factory=list)
    radials: list[Radial] = field(default_factory=list)
    joints: list[DeckJoint] = field(default_factory=list)
    rigids: list[RigidPart] = field(default_factory=list)
    entries: dict[str, list[Entry]] = field(default_factory=dict)
    times: list[float] = field(default_factory=list)

    def at(self, kind: str, t: float) -> list[Entry]:
        """Return the entries of a kind that are there at a time."""
        return [entry for entry in self.entries.get(kind, []) if entry.is_there(t)]
