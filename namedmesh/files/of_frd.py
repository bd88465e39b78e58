"""Read results of CalculiX (.frd): the mesh, and vectors of the last step."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.file_mesh import Block, FileMesh
from namedmesh.rows import places_of

TYPES = {
    1: ("hexahedron", 8),
    2: ("prism", 6),
    3: ("tetrahedron", 4),
    4: ("hexahedron", 20),
    5: ("prism", 15),
    6: ("tetrahedron", 10),
    7: ("triangle", 3),
    8: ("triangle", 6),
    9: ("quadrilateral", 4),
    10: ("quadrilateral", 8),
    11: ("line", 2),
    12: ("line", 3),
}
"""Shape and number of nodes of the numbers of types of elements."""
VECTORS = ("DISP", "FORC")
"""Names of displacements and of forces on nodes."""
LONG = 1
"""Format of files whose numbers of nodes have ten digits; 0 stands for five."""
WIDTH = 12
"""Characters of a value."""
TIME = slice(12, 24)
"""Characters of the time in the head of a result."""


def mesh_of_frd(path: Path) -> FileMesh:
    """Read results of CalculiX.

    Raises:
        InputError: If the file is binary, or has no nodes.
    """
    lines = path.read_text("latin-1").splitlines()
    numbers = np.empty(0, dtype=np.int64)
    points = np.empty((0, 3))
    elements: dict[int, list[list[int]]] = {}
    values: dict[str, np.ndarray] = {}
    time = None
    at = 0
    while at < len(lines):
        words = lines[at].split()
        head = words[0] if words else ""
        if head == "2C":
            numbers, points = _table(lines, at, 3)
        elif head == "3C":
            elements = _elements(lines, at)
        elif head == "-4" and words[1] in VECTORS:
            result_numbers, table = _table(lines, _first_row(lines, at) - 1, 3, _digits(lines, at))
            rows = places_of(numbers, result_numbers)
            values[words[1]] = np.zeros(points.shape)
            values[words[1]][rows[rows >= 0]] = table[rows >= 0]
            words_of_time = lines[_head(lines, at)][TIME].strip()
            time = float(words_of_time) if words_of_time else None
        at += 1
    if not len(points):
        raise InputError("it has no block of nodes (2C), as results of CalculiX have.")
    blocks = []
    left_out = {}
    for kind, rows_of in elements.items():
        if kind not in TYPES:
            left_out[f"frd {kind}"] = len(rows_of)
            continue
        shape, width = TYPES[kind]
        table = np.array([row[:width] for row in rows_of])
        blocks.append(Block(shape, places_of(numbers, table)))
    return FileMesh(points, tuple(blocks), left_out=left_out, values=values, time=time)


def _format(line: str) -> int:
    """Return the format of a block, the last number of its first line.

    Raises:
        InputError: If it is binary.
    """
    kind = int(line.rsplit(maxsplit=1)[-1])
    if kind > LONG:
        raise InputError(
            "it is binary; let CalculiX write text: *NODE FILE instead of *NODE OUTPUT."
        )
    return kind


def _digits(lines: list[str], at: int) -> int:
    """Return the digits of the numbers of nodes of a result that begins above."""
    return 10 if _format(lines[_head(lines, at)]) == LONG else 5


def _head(lines: list[str], at: int) -> int:
    """Return the line above at which a result begins."""
    while not lines[at].lstrip().startswith("100C"):
        at -= 1
    return at


def _first_row(lines: list[str], at: int) -> int:
    """Return the first line of data below a line."""
    at += 1
    while not lines[at].startswith(" -1"):
        at += 1
    return at


def _table(
    lines: list[str], at: int, columns: int, digits: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of nodes below a line in order, and the values at them."""
    if digits is None:
        digits = 10 if _format(lines[at]) == LONG else 5
    begin = 3 + digits
    numbers = []
    rows = []
    for line in lines[at + 1 :]:
        if not line.startswith(" -1"):
            break
        numbers.append(int(line[3:begin]))
        ends = range(begin, begin + WIDTH * columns, WIDTH)
        rows.append([float(line[end : end + WIDTH] or 0.0) for end in ends])
    order = np.argsort(numbers)
    return np.array(numbers, dtype=np.int64)[order], np.array(rows).reshape(-1, columns)[order]


def _elements(lines: list[str], at: int) -> dict[int, list[list[int]]]:
    """Return the nodes of the elements below a line by the number of their type."""
    digits = 10 if _format(lines[at]) == LONG else 5
    found: dict[int, list[list[int]]] = {}
    for line in lines[at + 1 :]:
        if line.startswith(" -1"):
            kind = int(line[3 + digits : 3 + digits + 5])
            found.setdefault(kind, []).append([])
        elif line.startswith(" -2"):
            text = line[3:]
            words = [text[i : i + digits] for i in range(0, len(text), digits)]
            found[kind][-1] += [int(word) for word in words if word.strip()]
        else:
            break
    return found
