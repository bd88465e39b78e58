"""Hold a deck as a domain and its scenes, and read it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.decks.nodal import NodalTable
from erc_contact.decks.plan import DeckJoint, DeckPlan
from erc_contact.decks.planning import plan_of
from erc_contact.decks.reached import tables_on
from erc_contact.decks.readers import read_cards
from erc_contact.decks.scenes import scene_of
from erc_contact.decks.told import Note, Told
from erc_contact.newton.solution import Solution
from erc_contact.newton.solve import solve
from erc_contact.scene.scene import Scene
from erc_contact.scene.words import in_words
from namedmesh import Domain
from namedmesh.base.exceptions import on_rank
from namedmesh.base.html import in_columns, table
from namedmesh.for_solvers import FileMesh, domain_of, read_deck_mesh

PENALTIES = ("hard", "kept")
"""What a pressure over an overclosure may become."""


@dataclass(frozen=True, eq=False, repr=False)
class Deck:
    """Hold what a deck of CalculiX or Abaqus says, as a domain and its scenes.

    It prints as a table.

    Attributes:
        path: The file.
        domain: The bodies, with their parts, regions and pairs.
        scene: The scene at the end of the last step.
        times: Ends of the steps, from which ``ec.evolve(deck.scene_at, deck.domain,
            deck.times, accuracy)`` goes.
        assumed: What is taken in another way than the deck says.
        left_out: What is left out.
        taken: Keywords that are taken, with the number of their cards.

    Example:
        >>> deck = ec.read_deck("press.inp")
        >>> history = ec.adapt(deck.scene, deck.domain, accuracy=0.1)
    """

    path: Path
    domain: Domain
    plan: DeckPlan
    told: Told

    @property
    def scene(self) -> Scene:
        """Return the scene at the end of the last step."""
        return self.scene_at(self.times[-1] if self.times else 0.0)

    def scene_at(self, t: float) -> Scene:
        """Return the scene at a time, which is counted from the beginning.

        Raises:
            InputError: If a scene refuses what the deck says.
        """
        return scene_of(self.plan, t, self._reached)

    def _reached(self, t: float, part: str) -> tuple[NodalTable, ...]:
        """Return the displacement that is reached on a part at a time; collective."""
        if t not in self._solutions:
            self._solutions[t] = solve(self.scene_at(t), self.domain, degree=2)
        return tables_on(self._solutions[t], part)

    @cached_property
    def _solutions(self) -> dict[float, Solution]:
        """Return the solutions at ends of steps that later steps need."""
        return {}

    @property
    def times(self) -> list[float]:
        """Return the ends of the steps."""
        return self.plan.times

    @property
    def assumed(self) -> list[Note]:
        """Return what is taken in another way than the deck says."""
        return self.told.assumed

    @property
    def left_out(self) -> list[Note]:
        """Return what is left out."""
        return self.told.left_out

    @property
    def taken(self) -> dict[str, int]:
        """Return the keywords that are taken, with the number of their cards."""
        return self.told.taken

    def __repr__(self) -> str:
        """Write the deck as a table."""
        return in_columns(self._rows())

    def _repr_html_(self) -> str:
        """Return the table in HTML, for notebooks."""
        return table(self._rows(), caption=f"Deck {self.path.name}")

    def _rows(self) -> list[tuple[str, str]]:
        """Return the rows of the table."""
        regions = ", ".join(self.domain.regions)
        parts = ", ".join(self.domain.names)
        cards = ", ".join(f"{name} {count}" for name, count in self.taken.items())
        ends = ", ".join(f"{time:g}" for time in self.times)
        rows = [
            ("deck", f"{self.path.name}, {self.domain.cells} cells in {self.plan.d}D"),
            ("regions", regions),
            ("parts", parts),
            *in_words(self.scene),
            ("steps", f"{len(self.times)}, to t = {ends}"),
            ("cards", cards),
        ]
        rows += [("assumed", str(note)) for note in self.assumed]
        rows += [("left out", str(note)) for note in self.left_out]
        return rows


def read_deck(
    path: str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    without: Sequence[str] = (),
    penalty: str = "hard",
) -> Deck:
    """Read a deck of CalculiX or Abaqus as a whole model; collective.

    Mesh, names, materials, supports, loads, contact pairs, ties and steps become a
    domain and its scenes. Each card is taken, or harmless (output, controls of the
    solver), or assumed, which is told, or refused.

    Args:
        path: The file.
        comm: Communicator that shares the mesh.
        without: Cards that are left out, ``["*EQUATION"]``, or by a parameter
            ``["*ELEMENT, TYPE=S4"]``.
        penalty: What a pressure over an overclosure (LINEAR, EXPONENTIAL) and a stick
            slope are: "hard" takes them as penalties for hard contact, "kept" as a
            layer that gives way.

    Returns:
        The deck, which prints as a table.

    Raises:
        InputError: If the file cannot be read, or has cards that cannot be taken; the
            message lists all of them with their lines.

    Example:
        >>> deck = ec.read_deck("press.inp")
        >>> deck.domain
        <Domain in 2D: 16 cells, ...pairs Bottom/Top of 2 facets>
    """
    if not isinstance(path, str | Path):
        raise InputError(f"read_deck: the path is {path!r}; give the name of a file.")
    if penalty not in PENALTIES:
        raise InputError(f"read_deck: penalty is {penalty!r}; give one of {PENALTIES}.")
    wanted = [without] if isinstance(without, str) else list(without)
    path = Path(path)
    subject = f"The deck {str(path)!r}"
    # Only rank 0 need have the file.
    made = on_rank(comm, 0, _read, path, wanted, penalty, subject)
    plan, told = comm.bcast(made[:2] if made else None)
    domain = domain_of(comm, made[2] if made else None, subject)
    joints = []
    for joint in plan.joints:
        domain, joined = _joined(domain, joint)
        joints.append(_with_gap(domain, joined, told))
    return Deck(path, domain, replace(plan, joints=joints), told)


def _read(
    path: Path, wanted: Sequence[str], penalty: str, subject: str
) -> tuple[DeckPlan, Told, FileMesh]:
    """Read a deck on this rank.

    Raises:
        InputError: If the file is missing, or has cards that cannot be taken.
    """
    if not path.is_file():
        raise InputError(f"{subject} does not exist; look at the path and the working folder.")
    mesh = read_deck_mesh(path)
    reading = read_cards(mesh, wanted, penalty)
    reading.told.raise_refused(subject)
    plan, regions, parts = plan_of(reading)
    reading.told.raise_refused(subject)
    return plan, reading.told, reading.mesh.named(regions, parts)


def _joined(domain: Domain, joint: DeckJoint) -> tuple[Domain, DeckJoint]:
    """Join or split a domain at a joint, and return the joint of its parts."""
    if joint.kind == "preload":
        sides = dict(zip((joint.here, joint.there), joint.regions, strict=True))
        return domain.split(sides, on=joint.on), joint
    here = _remaining(domain, joint.here)
    there = _remaining(domain, joint.there)
    joined = domain.joined(here, there, apart=joint.apart)
    return joined, replace(joint, here=here, there=there)


def _with_gap(domain: Domain, joint: DeckJoint, told: Told) -> DeckJoint:
    """Return a joint with its drawn distance as a gap only if the mesh has lost it."""
    if joint.drawn is None or joint.card is None:
        return joint
    pair = {joint.here, joint.there}
    away = [row.distance for row in domain.touching() if set(row) == pair]
    if max(away, default=0.0) > 0.0:
        return replace(joint, drawn=None)
    told.assume(
        joint.card,
        f"the faces of {joint.here!r} and {joint.there!r} do not match: one side moves onto the "
        f"other, by up to {joint.apart:.3g}, and their drawn distance is the gap",
    )
    return joint


def _remaining(domain: Domain, name: str) -> str:
    """Return the name of what earlier joints have left of a part."""
    while any(name in pair for pair in domain.pairs):
        name = f"{name} outside"
    return name
