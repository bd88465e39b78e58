"""Take the text of Abaqus and CalculiX apart: keywords, parameters, lines of data.

Meshes of FrontISTR have the same cards, with other marks.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.beside import beside

DEEPEST = 20
"""Greatest number of files that include each other."""
EMPTY_FIELD = re.compile(r",\s*(?:,|\n|$)")
"""Where a line has nothing between commas, or after the last comma."""
MOST_FILES = 1000
"""Greatest number of files that are read for one."""
COMMENTS = {"*": ("**",), "!": ("!!", "#")}
"""Beginnings of lines of comment by the mark of a keyword."""
WITH_FILE = ("NODE", "ELEMENT", "NSET", "ELSET", "NGROUP", "EGROUP", "SGROUP")
"""Keywords whose lines of data may be in a file of their own."""


@dataclass(frozen=True)
class Card:
    """Hold a keyword in capitals, its parameters, and its lines of data.

    Attributes:
        keyword: The keyword, "NODE" for instance.
        parameters: Values of the parameters by their names in capitals and without
            blanks, "" without one.
        lines: Lines of data.
        place: Name of the file and number of the line of the keyword, "job.inp:12".
    """

    keyword: str
    parameters: dict[str, str]
    lines: list[str]
    place: str = ""

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


def cards_of(path: Path, mark: str = "*") -> Iterator[Card]:
    """Iterate over the cards of a file and of the files that it includes.

    Args:
        path: The file.
        mark: What a line with a keyword begins with, "*" or "!".

    Raises:
        InputError: If an included file is missing or lies elsewhere, or files include
            each other.
    """
    return Included(path.resolve().parent, mark).cards(path, ())


class Included:
    """Read a file with the files that it includes.

    Args:
        top: The folder in which all of them must be.
        mark: What a line with a keyword begins with.
    """

    def __init__(self, top: Path, mark: str = "*") -> None:
        self.top = top
        self.mark = mark
        self.count = 0

    def cards(self, path: Path, above: tuple[Path, ...]) -> Iterator[Card]:
        """Iterate over the cards of a file.

        Args:
            path: The file.
            above: The files that include it, the first file first.
        """
        card: Card | None = None
        keyword = ""
        place = ""
        for number, line in enumerate(self.lines(path, above), start=1):
            stripped = line.strip()
            if not stripped or stripped.startswith(COMMENTS[self.mark]):
                continue
            if stripped.startswith(self.mark):
                if card is not None:
                    yield from self.with_included(card, path, above)
                keyword = stripped
                place = f"{path.name}:{number}"
            elif keyword.endswith(",") and stripped[0].isalpha():  # its line goes on
                keyword += stripped
            else:
                keyword = ""
            if keyword:
                card = _card(keyword, place)
            elif card is not None:
                card.lines.append(stripped)
        if card is not None:
            yield from self.with_included(card, path, above)

    def lines(self, path: Path, above: tuple[Path, ...]) -> list[str]:
        """Return the lines of a file.

        Raises:
            InputError: If files include each other, or are too many.
        """
        self.count += 1
        if path in above or len(above) > DEEPEST:
            raise InputError(f"files include each other without end, last {path.name!r}.")
        if self.count > MOST_FILES:
            raise InputError(f"it includes more than {MOST_FILES} files, last {path.name!r}.")
        return text_of(path).splitlines()

    def with_included(self, card: Card, path: Path, above: tuple[Path, ...]) -> Iterator[Card]:
        """Return a card, or the cards of the file that it includes."""
        if card.keyword == "INCLUDE":
            file = beside(path, card.get("INPUT"), self.top)
            yield from self.cards(file, (*above, path))
            return
        name = card.get("INPUT") or card.get("FILE")
        if card.keyword in WITH_FILE and name:
            for line in self.lines(beside(path, name, self.top), above):
                if line.strip() and not line.lstrip().startswith(self.mark):
                    card.lines.append(line.strip())
        yield card


def text_of(path: Path) -> str:
    """Return the text of a file, which programs write in several encodings."""
    data = path.read_bytes()
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", "replace")
    with suppress(UnicodeDecodeError):
        return data.decode("utf-8-sig")
    return data.decode("latin-1")


def _card(line: str, place: str) -> Card:
    """Return the card of a line with a keyword."""
    words = [word.strip() for word in line.lstrip("*! ").split(",")]
    parameters = {}
    for word in words[1:]:
        name, _, value = word.partition("=")
        if name.strip():
            # CalculiX reads REFNODE and REF NODE alike.
            parameters["".join(name.upper().split())] = value.strip().strip("\"'")
    return Card(" ".join(words[0].upper().split()), parameters, [], place)


def numbers_of(lines: list[str], width: int) -> np.ndarray:
    """Return the numbers in lines, shape (n, width); absent numbers are 0."""
    text = "\n".join(lines)
    alike = len({line.count(",") for line in lines}) == 1
    if alike and not EMPTY_FIELD.search(text):
        with suppress(ValueError):
            flat = np.array(text.replace(",", " ").split(), dtype=float)
            if len(flat) == width * len(lines):
                return flat.reshape(-1, width)
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
