"""Write decks of boxes for CalculiX, and certify what it computes.

- One box 2 x 1 x 1 of 16 hexahedra is pressed and sheared between two plates.
- Two boxes in contact with friction, whose meshes do not match; the roof of the upper
  one is pressed down and moved aside.

    apt-get install calculix-ccx
    python benchmarks/calculix_boxes.py
"""

import subprocess
import tempfile
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

import erc_contact as ec

HEXAHEDRON = (
    *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
TETRAHEDRON = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
"""Ends of the edges, in the order of CalculiX's nodes in their middles."""
EDGES = {"C3D20": HEXAHEDRON, "C3D20R": HEXAHEDRON, "C3D10": TETRAHEDRON}
CORNERS = np.array(list(product((0, 1), repeat=3)))[[0, 4, 6, 2, 1, 5, 7, 3]]
PIECES = ((0, 1, 3, 7), (0, 4, 1, 7), (1, 2, 3, 7), (1, 6, 2, 7), (1, 4, 5, 7), (1, 5, 6, 7))
LOW, HIGH, BETWEEN = 0.0, 1.0, 0.5
"""Heights of the foot, the roof and the contact."""


KINDS = ("C3D8", "C3D20", "C3D20R", "C3D10")
"""Elements of CalculiX that are compared."""


def box(
    kind: str, low: tuple[float, ...], high: tuple[float, ...], counts: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and elements of a box."""
    lines = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True)]
    x = np.array(list(product(*lines)))
    number = np.arange(len(x)).reshape([n + 1 for n in counts])
    first = np.array(list(product(*map(range, counts))))[:, None]
    cells = number[tuple(np.moveaxis(first + CORNERS, -1, 0))]
    if kind == "C3D10":
        cells = np.concatenate([cells[:, piece] for piece in PIECES])
        edges = x[cells[:, 1:]] - x[cells[:, :1]]
        turned = np.linalg.det(edges) < 0
        cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    if kind in EDGES:
        ends = np.sort(cells[:, EDGES[kind]], axis=2)
        pairs, middles = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
        cells = np.hstack([cells, len(x) + middles.reshape(len(cells), -1)])
        x = np.vstack([x, x[pairs].mean(axis=1)])
    return x, cells


def rows(first: int, cells: np.ndarray) -> Iterator[str]:
    """Write elements in lines, of which CalculiX reads sixteen numbers each."""
    for number, cell in enumerate(cells, start=first):
        words = [str(number), *map(str, cell + 1)]
        yield ", ".join(words[:10]) + ("," if len(words) > 10 else "")
        for begin in range(10, len(words), 10):
            yield ", ".join(words[begin : begin + 10])


FACES = {8: ((0, 1, 2, 3), (4, 7, 6, 5)), 4: ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))}
"""Corners of the faces S1, S2, ... that may lie on the contact."""


def sides(first: int, x: np.ndarray, cells: np.ndarray, kind: str) -> Iterator[str]:
    """Write the faces of elements at the height of the contact."""
    faces = FACES[4 if kind == "C3D10" else 8]
    for which, face in enumerate(faces, start=1):
        at = abs(x[cells[:, face], 2] - BETWEEN).max(axis=1) < 1e-9
        yield from (f"{first + number}, S{which}" for number in np.flatnonzero(at))


def nodes(x: np.ndarray) -> list[str]:
    """Write nodes, and the sets of the foot and of the roof."""
    lines = ["*NODE"]
    lines += [", ".join([str(i), *map(str, point)]) for i, point in enumerate(x.tolist(), start=1)]
    for name, height in (("FOOT", LOW), ("ROOF", HIGH)):
        at = np.flatnonzero(abs(x[:, 2] - height) < 1e-9) + 1
        lines += [f"*NSET, NSET={name}", *(f"{number}," for number in at)]
    return lines


def pressed(across: float, down: float) -> list[str]:
    """Write the step: the foot is held, the roof is moved."""
    lines = ["*STEP", "*STATIC", "*BOUNDARY", "FOOT, 1, 3", f"ROOF, 1, 1, {across}", "ROOF, 2, 2"]
    return [*lines, f"ROOF, 3, 3, {-down}", "*NODE FILE", "U, RF", "*END STEP", ""]


def one_box(kind: str) -> str:
    """Return the deck of one box with elements of a kind."""
    x, cells = box(kind, (0.0, 0.0, LOW), (2.0, 1.0, HIGH), (4, 2, 2))
    lines = [*nodes(x), f"*ELEMENT, TYPE={kind}, ELSET=BOX", *rows(1, cells)]
    lines += ["*MATERIAL, NAME=SOFT", "*ELASTIC", "1., 0.3"]
    lines += ["*SOLID SECTION, ELSET=BOX, MATERIAL=SOFT", *pressed(0.02, 0.05)]
    return "\n".join(lines)


def two_boxes(
    kind: str, lower: tuple[int, ...] = (2, 2, 1), upper: tuple[int, ...] = (1, 1, 1)
) -> str:
    """Return the deck of two boxes with elements of a kind."""
    x_low, low = box(kind, (0.0, 0.0, LOW), (1.0, 1.0, BETWEEN), lower)
    x_up, up = box(kind, (0.1, 0.1, BETWEEN), (0.9, 0.9, HIGH), upper)
    x = np.vstack([x_low, x_up])
    up = up + len(x_low)
    lines = [*nodes(x), f"*ELEMENT, TYPE={kind}, ELSET=LOWER", *rows(1, low)]
    lines += [f"*ELEMENT, TYPE={kind}, ELSET=UPPER", *rows(1001, up)]
    lines += ["*SURFACE, NAME=SLAVE, TYPE=ELEMENT", *sides(1001, x, up, kind)]
    lines += ["*SURFACE, NAME=MASTER, TYPE=ELEMENT", *sides(1, x, low, kind)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "1000., 0.3"]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("LOWER", "UPPER")]
    lines += ["*SURFACE INTERACTION, NAME=DRY"]
    lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "1.E6", "*FRICTION", "0.2, 1.E5"]
    lines += ["*CONTACT PAIR, INTERACTION=DRY, TYPE=SURFACE TO SURFACE", "SLAVE, MASTER"]
    return "\n".join([*lines, *pressed(0.002, 0.02)])


def main() -> None:
    """Print what the transfer costs."""
    print("| boxes, elements | eps in its own cells | interpolated | transfer | simplices |")
    print("| --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for write in (one_box, two_boxes):
            for kind in KINDS:
                (Path(folder) / "job.inp").write_text(write(kind))
                subprocess.run(["ccx", "job"], cwd=folder, check=True, capture_output=True)
                deck = ec.read_deck(Path(folder) / "job.inp")
                found = ec.certify(deck.scene, deck.domain, Path(folder) / "job.frd")
                shares = (found.relative, found.error.relative, found.share(found.transfer))
                words = [f"{write.__name__.split('_')[0]}, {kind}", *(f"{s:.2%}" for s in shares)]
                cells = f"{deck.domain.cells}, {found.error.domain.cells}"
                print("|", " | ".join([*words, cells]), "|", flush=True)


if __name__ == "__main__":
    main()
