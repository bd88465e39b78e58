"""Collect what the cards of a deck declare, before it is put on faces and regions."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from erc_contact.decks.histories import Amplitude, Steps
from erc_contact.decks.told import Told
from erc_contact.scene.orthotropic import OrthotropicElastic
from namedmesh.for_solvers import Card, DeckMesh, DeckSpace

TINY = 1e-300
"""Radius of a point on the axis [length]."""
Parent = TypeVar("Parent")
"""Type of what cards belong to."""
Tensor = tuple[tuple[float, ...], ...]
"""Components of a tensor, rows of rows."""
PLASTIC_STRAIN = "PLASTIC STRAIN"
"""Type of initial conditions that are given strains."""


@dataclass
class MaterialCards:
    """Hold a material as its cards say it.

    Attributes:
        name: Its name.
        card: The card *MATERIAL.
        elastic: Rows E, nu and temperature.
        expansion: Rows alpha and temperature.
        zero: Temperature from which alpha is a mean.
        density: Mass per volume; None if it has none.
        plastic: Rows yield stress, plastic strain and temperature.
        kinematic: Whether the hardening is kinematic.
        orthotropic: Its law if its moduli are orthotropic.
    """

    name: str
    card: Card
    elastic: list[list[float]] = field(default_factory=list)
    expansion: list[list[float]] = field(default_factory=list)
    zero: float = 0.0
    density: float | None = None
    plastic: list[list[float]] = field(default_factory=list)
    kinematic: bool = False
    orthotropic: OrthotropicElastic | None = None


@dataclass(frozen=True)
class SolidSection:
    """Hold a *SOLID SECTION.

    Attributes:
        elset: Name of the set of elements.
        cells: Its cells.
        material: Name of the material in capitals.
        thickness: Thickness of plane elements [length].
        card: The card.
        orientation: Name of its axes in capitals, "" for the axes of the mesh.
    """

    elset: str
    cells: np.ndarray
    material: str
    thickness: float
    card: Card
    orientation: str = ""


@dataclass
class Interaction:
    """Hold a *SURFACE INTERACTION.

    Attributes:
        card: The card.
        behavior: Value of PRESSURE-OVERCLOSURE, "HARD" without it.
        stiffness: Slope of the pressure over the overclosure [force/length^3].
        friction: Coulomb's coefficient [-].
        stick: Slope of the shear over the slip before it [force/length^3].
    """

    card: Card
    behavior: str = "HARD"
    stiffness: float | None = None
    friction: float = 0.0
    stick: float | None = None


@dataclass(frozen=True)
class Facing:
    """Hold two surfaces that a *CONTACT PAIR or a *TIE relates.

    Attributes:
        slave: Name of the dependent surface.
        master: Name of the independent surface.
        interaction: Name of the interaction in capitals; "" of a tie.
        adjust: Distance up to which slave nodes are moved to the master surface
            [length]; None if they are not.
        moved: The points that may be moved so; None for all of the slave surface.
        tied: Whether it is a tie.
        card: The card.
    """

    slave: str
    master: str
    interaction: str
    adjust: float | None
    moved: np.ndarray | None
    tied: bool
    card: Card


@dataclass(frozen=True)
class Grip:
    """Hold nodes that move as a rigid body, or that share a force, with a node.

    Attributes:
        name: Name of the surface or set.
        nodes: Their points; empty if a surface is meant.
        surface: Name of the surface, "" if nodes are meant.
        reference: The reference node, a point of the mesh.
        rotation: The point whose displacements are rotations; None if the reference
            node has degrees of freedom 4 to 6.
        rigid: Whether the nodes move rigidly, else they share forces.
        components: Degrees of freedom of the coupling.
        card: The card.
        place: Where the shared force acts [length], shape (3,); None at the reference
            node.
    """

    name: str
    nodes: np.ndarray
    surface: str
    reference: int
    rotation: int | None
    rigid: bool
    components: tuple[int, ...]
    card: Card
    place: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Pretension:
    """Hold a *PRE-TENSION SECTION.

    Attributes:
        surface: Name of the surface that is the cut.
        node: The point of its force.
        normal: Direction along which the force acts; empty for the outward normal of
            the elements of the surface.
        card: The card.
    """

    surface: str
    node: int
    normal: tuple[float, ...]
    card: Card


@dataclass(frozen=True)
class Axes:
    """Hold a *TRANSFORM: local axes of nodes.

    Attributes:
        nodes: The points.
        origin: A point of the axis, of cylindrical coordinates [length], shape (3,).
        axes: Local axes as rows; of cylindrical coordinates the axis is the last.
        cylindrical: Whether they are cylindrical.
        card: The card.
    """

    nodes: np.ndarray
    origin: np.ndarray
    axes: np.ndarray
    cylindrical: bool
    card: Card

    def at(self, x: np.ndarray) -> np.ndarray:
        """Return the local axes at points (n, d), shape (n, 3, d)."""
        n, d = x.shape
        if not self.cylindrical:
            return np.broadcast_to(self.axes[:, :d], (n, 3, d))
        axis = self.axes[2]
        places = np.zeros((n, 3))
        places[:, :d] = x
        arms = places - self.origin
        radii = arms - np.outer(arms @ axis, axis)
        radii /= np.maximum(np.linalg.norm(radii, axis=1), TINY)[:, None]
        around = np.cross(axis, radii)
        along = np.broadcast_to(axis, (n, 3))
        return np.stack([radii, around, along], axis=1)[:, :, :d]


@dataclass
class DeckReading:
    """Hold what has been read of a deck.

    Attributes:
        mesh: Its mesh.
        told: What became of its cards.
        penalty: "hard" or "kept": what a pressure over an overclosure is.
        steps: Its steps, with what they prescribe.
        is_ring: Whether the body is axisymmetric.
        tensors: The stress [force/area] or the plastic strain [-] of a cell at the
            beginning, and its card, which says what of both it is.
        shares: Thickness of each cell over the thickness of the body, else 1 [-].
        current: What the cards belong to that come next: a material, an interaction, a
            coupling.
    """

    mesh: DeckMesh
    told: Told
    penalty: str
    steps: Steps = field(default_factory=Steps)
    is_ring: bool = False
    shares: np.ndarray = field(default_factory=lambda: np.empty(0))
    current: Any = None
    materials: dict[str, MaterialCards] = field(default_factory=dict)
    sections: list[SolidSection] = field(default_factory=list)
    orientations: dict[str, Card] = field(default_factory=dict)
    amplitudes: dict[str, Amplitude] = field(default_factory=dict)
    interactions: dict[str, Interaction] = field(default_factory=dict)
    facings: list[Facing] = field(default_factory=list)
    clearances: dict[tuple[str, str], float] = field(default_factory=dict)
    grips: list[Grip] = field(default_factory=list)
    pretensions: list[Pretension] = field(default_factory=list)
    transforms: list[Axes] = field(default_factory=list)
    initial: dict[int, float] = field(default_factory=dict)
    tensors: dict[int, tuple[Tensor, Card]] = field(default_factory=dict)

    def below(self, card: Card, kind: type[Parent], keyword: str) -> Parent | None:
        """Return what a card belongs to; refuse a card that stands below no keyword."""
        if isinstance(self.current, kind):
            return self.current
        self.told.refuse(card, f"it stands below no *{keyword}; put it there.")
        return None

    def amplitude(self, card: Card) -> Amplitude | None:
        """Return the amplitude that a card names, None if it names no amplitude."""
        name = card.get("AMPLITUDE")
        if not name:
            return None
        found = self.amplitudes.get(name.upper())
        if found is None:
            self.told.refuse(card, f"no *AMPLITUDE is called {name!r}; mend the name.")
            return None
        delay = float(card.get("TIMEDELAY") or 0.0)
        return replace(found, times=tuple(time + delay for time in found.times))

    def references(self) -> set[int]:
        """Return the points that stand for faces or cuts."""
        points: set[int] = set()
        for grip in self.grips:
            points |= {grip.reference}
            if grip.rotation is not None:
                points |= {grip.rotation}
        return points | {pretension.node for pretension in self.pretensions}

    def point(self, card: Card, parameter: str, space: DeckSpace) -> int | None:
        """Return the point that a parameter names by number or set; refuse others."""
        points = self.mesh.nodes(card.get(parameter), space)
        if len(points) == 1:
            return int(points[0])
        self.told.refuse(card, f"{parameter}={card.get(parameter)} is no node; mend it.")
        return None
