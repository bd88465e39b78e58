"""Tell what became of the cards of a deck: taken, assumed, left out, refused."""

from __future__ import annotations

from dataclasses import dataclass, field

from erc_contact.base.exceptions import InputError
from namedmesh.for_solvers import Card


@dataclass(frozen=True)
class Note:
    """Hold what a reader of a deck should know about a card.

    Attributes:
        card: The keyword with its star.
        place: Name of the file and number of the line.
        words: What became of it.
    """

    card: str
    place: str
    words: str

    def __str__(self) -> str:
        """Write the note in a line."""
        return f"{self.card} ({self.place}): {self.words}"


@dataclass
class Told:
    """Collect notes on the cards of a deck.

    Attributes:
        taken: Keywords that are taken, with the number of their cards.
        assumed: What is taken in another way than the deck says.
        left_out: What is left out, as it changes nothing or as the user has said so.
        refused: What cannot be taken.
    """

    taken: dict[str, int] = field(default_factory=dict)
    assumed: list[Note] = field(default_factory=list)
    left_out: list[Note] = field(default_factory=list)
    refused: list[Note] = field(default_factory=list)

    def take(self, card: Card) -> None:
        """Count a card that is taken."""
        name = f"*{card.keyword}"
        self.taken[name] = self.taken.get(name, 0) + 1

    def assume(self, card: Card, words: str) -> None:
        """Tell that a card is taken in another way, once for the same words."""
        _tell(self.assumed, card, words)

    def leave_out(self, card: Card, words: str) -> None:
        """Tell that a card is left out, once for the same words."""
        _tell(self.left_out, card, words)

    def refuse(self, card: Card, words: str) -> None:
        """Tell that a card cannot be taken."""
        _tell(self.refused, card, words)

    def raise_refused(self, subject: str) -> None:
        """Raise an error that lists all refused cards.

        Raises:
            InputError: If there are any.
        """
        if not self.refused:
            return
        lines = [f"  {note}" for note in self.refused]
        names = sorted({note.card for note in self.refused})
        raise InputError(
            f"{subject} has {len(lines)} cards that cannot be taken:\n"
            + "\n".join(lines)
            + f"\nMend them, or say that they are left out: without={names}."
        )


def _tell(notes: list[Note], card: Card, words: str) -> None:
    """Add a note to a list, unless a card has the same words there."""
    name = f"*{card.keyword}"
    if all(note.card != name or note.words != words for note in notes):
        notes.append(Note(name, card.place, words))


def number_of(card: Card, word: str) -> float:
    """Return the number in a word of a card; an empty word is 0.

    Raises:
        InputError: If it is no number.
    """
    try:
        return float(word.upper().replace("D", "E")) if word else 0.0
    except ValueError:
        raise InputError(
            f"*{card.keyword} ({card.place}) has {word!r} where a number stands; mend the line."
        ) from None


def numbers_in(card: Card, line: int = 0) -> list[float]:
    """Return the numbers of a line of data; none if the card has no such line.

    Raises:
        InputError: If a word is no number.
    """
    if line >= len(card.lines):
        return []
    words = [word.strip() for word in card.lines[line].split(",")]
    while words and not words[-1]:
        words.pop()
    return [number_of(card, word) for word in words]
