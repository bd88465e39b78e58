"""Take the text of Abaqus and CalculiX apart: keywords, parameters, lines of data."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from erc_contact.base.exceptions import InputError

DEEPEST = 20
"""Greatest number of files that include each other."""
FIRST_CARD = re.compile(r"\s*\*\s*(\*|[A-Za-z])")
"""How the first line that is not empty begins."""


@dataclass(frozen=True)
class Card:
    """Hold a keyword in capitals, its parameters, and its lines of data.

    Attributes:
        keyword: The keyword, "NODE" for instance.
        parameters: Values of the parameters by their names in capitals, "" without one.
        lines: Lines of data.
    """

    keyword: str
    parameters: dict[str, str]
    lines: list[str]

    def has(self, parameter: str) -> bool:
        """Tell whether a parameter is given."""
        return parameter in self.parameters

    def get(self, parameter: str) -> str:
        """Return the value of a parameter, "" if it is not given."""
        return self.parameters.get(parameter, "")

    @property
    def rows(self) -> list[list[str]]:
        """Return the words of each line that are separated by commas."""
        return [[word.strip() for word in line.split(",")] for line in self.lines]


def is_abaqus(path: Path) -> bool:
    """Tell whether a text file begins as files of Abaqus and CalculiX do.

    A file that ends with .inp may have words before its first card.
    """
    with path.open("rb") as file:
        lines = file.read(4000).decode("latin-1").splitlines()
    lines = [line for line in lines if line.strip()]
    if path.suffix.lower() != ".inp":
        lines = lines[:1]
    return any(FIRST_CARD.match(line) for line in lines)


def cards_of(path: Path, deep: int = 0) -> Iterator[Card]:
    """Iterate over the cards of a file and of the files that it includes.

    Raises:
        InputError: If an included file is missing, or files include each other.
    """
    if deep > DEEPEST:
        raise InputError(f"more than {DEEPEST} files include each other, last {path.name!r}.")
    card: Card | None = None
    keyword = ""
    for line in path.read_text("latin-1").splitlines():
        stripped = line.strip()
        if not stripped or stripped.startswith("**"):
            continue
        if keyword.endswith(","):  # the line of a keyword goes on
            keyword += stripped
        elif stripped.startswith("*"):
            if card is not None:
                yield from _with_included(card, path, deep)
            keyword = stripped
        else:
            keyword = ""
        if keyword:
            card = _card(keyword)
        elif card is not None:
            card.lines.append(stripped)
    if card is not None:
        yield from _with_included(card, path, deep)


def _card(line: str) -> Card:
    """Return the card of a line with a keyword."""
    words = [word.strip() for word in line.lstrip("* ").split(",")]
    parameters = {}
    for word in words[1:]:
        name, _, value = word.partition("=")
        if name.strip():
            parameters[name.strip().upper()] = value.strip().strip("\"'")
    return Card(" ".join(words[0].upper().split()), parameters, [])


def _with_included(card: Card, path: Path, deep: int) -> Iterator[Card]:
    """Return a card, or the cards of the file that it includes."""
    if card.keyword == "INCLUDE":
        yield from cards_of(_beside(path, card.get("INPUT")), deep + 1)
        return
    file = card.get("INPUT") or card.get("FILE")
    if card.keyword in ("NODE", "ELEMENT", "NSET", "ELSET") and file:
        for line in _beside(path, file).read_text("latin-1").splitlines():
            if line.strip() and not line.lstrip().startswith("*"):
                card.lines.append(line.strip())
    yield card


def _beside(path: Path, name: str) -> Path:
    """Return the path of a file that another file names.

    Raises:
        InputError: If there is none.
    """
    wanted = path.parent / name.replace("\\", "/")
    for candidate in (wanted, path.parent / wanted.name):
        if candidate.is_file():
            return candidate
    raise InputError(f"it includes {name!r}, which is not beside it; put that file there.")


def numbers_of(lines: list[str], width: int) -> np.ndarray:
    """Return the numbers in lines, shape (n, width); absent numbers are 0."""
    text = "\n".join(lines).replace(",", " ")
    try:
        flat = np.array(text.split(), dtype=float)
        if len(flat) == width * len(lines):
            return flat.reshape(-1, width)
    except ValueError:
        pass
    table = np.zeros((len(lines), width))
    for row, line in zip(table, lines, strict=True):
        words = [word.strip() for word in line.split(",")][:width]
        row[: len(words)] = [float(re.sub("[dD]", "e", word)) if word else 0.0 for word in words]
    return table


def integers_of(lines: list[str], width: int) -> np.ndarray:
    """Return whole numbers, shape (n, width), where a row may go on in the next line.

    What follows a whole row on its line is left out, as Abaqus and CalculiX do.

    Raises:
        InputError: If the last row is not whole.
    """
    words = " ".join(lines).replace(",", " ").split()
    if len(words) != width * len(lines):
        words = _whole_rows(lines, width)
    return np.array(words, dtype=np.float64).astype(np.int64).reshape(-1, width)


def _whole_rows(lines: list[str], width: int) -> list[str]:
    """Return the words of rows that end with a line."""
    words: list[str] = []
    row: list[str] = []
    for line in lines:
        row += line.replace(",", " ").split()
        if len(row) >= width:
            words += row[:width]
            row = []
    if row:
        raise InputError(
            f"element {row[0]} has {len(row) - 1} nodes and its type {width - 1}; look at its line."
        )
    return words
