"""Find why decks of CalculiX' suite differ from CalculiX most, on finer meshes.

    python benchmarks/deck_differences.py [FOLDER]

Each is the body of a deck of the suite on meshes of its own, solved by ``ccx`` and by
the package: a block that is pressed on another one (friction1), a disc that a point
holds (ax6), and a heated beam whose end is held along an edge (beamnlt). With the
folder of the suite, decks of it that hold points are solved by ``ccx`` once more, with
the pads that the package has in their place.
"""

import logging
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
from decks import INWARD, corners_of

import erc_contact as ec
from namedmesh.base.releases import cell_nodes
from namedmesh.files.displacements import displacement_of
from namedmesh.files.reading import read
from namedmesh.for_solvers import closest, read_deck_mesh
from namedmesh.simplex import of_facets

CORNERS = ((0, 0), (2, 0), (2, 2), (0, 2))
"""Corners of a square in halves of its sides."""
MIDDLES = ((1, 0), (2, 1), (1, 2), (0, 1))
"""Middles of its sides."""
STEEL = ["*MATERIAL, NAME=M", "*ELASTIC", "210000., .3", "*SOLID SECTION, ELSET=ALL, MATERIAL=M"]
"""Material of all decks."""
END = ["*NODE FILE", "U", "*END STEP"]
"""End of all decks."""
NEAR = 1e-6
"""Distance that is none [length]."""


def nodes_of_cell(d: int, degree: int) -> list[tuple[int, ...]]:
    """Return the places of the nodes of a cell, in the order of Abaqus."""
    if d == 2:
        return [*CORNERS, *MIDDLES]
    places: list[tuple[int, ...]] = [(*place, z) for z in (0, 2) for place in CORNERS]
    if degree == 2:
        places += [(*place, z) for z in (0, 2) for place in MIDDLES]
        places += [(*place, 1) for place in CORNERS]
    return places


def box(size: Sequence[float], counts: Sequence[int], degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points of a box, and the nodes of its cells."""
    places = nodes_of_cell(len(size), degree)
    known: dict[tuple[int, ...], int] = {}
    cells = []
    for cell in product(*map(range, counts)):
        nodes = [tuple(2 * k + p for k, p in zip(cell, place, strict=True)) for place in places]
        cells.append([known.setdefault(node, len(known)) for node in nodes])
    return np.array(list(known)) * np.array(size) / (2 * np.array(counts)), np.array(cells)


def lines(numbers: np.ndarray) -> list[str]:
    """Write numbers in lines."""
    words = [str(number) for number in numbers]
    return [", ".join(words[i : i + 10]) + "," for i in range(0, len(words), 10)]


def mesh_text(x: np.ndarray, cells: np.ndarray, kind: str) -> list[str]:
    """Write a mesh."""
    text = ["*NODE, NSET=NALL"]
    text += [", ".join([str(i), *map(str, place)]) for i, place in enumerate(x.tolist(), 1)]
    text += [f"*ELEMENT, TYPE={kind}, ELSET=ALL"]
    for i, row in enumerate(cells + 1, 1):
        rows = lines(np.array([i, *row]))
        text += [*rows[:-1], rows[-1].rstrip(",")]
    return text


def node_set(name: str, is_in: np.ndarray) -> list[str]:
    """Write a set of nodes."""
    return [f"*NSET, NSET={name}", *lines(np.flatnonzero(is_in) + 1)]


def both(text: list[str], other: list[str] | None = None) -> tuple[np.ndarray, ...]:
    """Return corners, and displacements there of CalculiX and of the package.

    Args:
        text: The deck.
        other: The deck that CalculiX solves, if it is another one.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "job.inp"
        path.write_text("\n".join(other or text))
        subprocess.run(["ccx", "job"], cwd=folder, capture_output=True, check=True)
        field = displacement_of(read(path.with_suffix(".frd"), "frd", numbered=False))
        path.write_text("\n".join(text))
        deck = ec.read_deck(path, penalty="kept")
    solution = ec.solve(deck.scene, deck.domain, degree=2)
    corners, inward = corners_of(field)
    d = deck.plan.d
    x = field.x[corners]
    inside = (x + INWARD * inward)[:, :d]
    ours = np.array([np.reshape(solution.at(place).displacement, (-1, d))[0] for place in inside])
    return x[:, :d], field.values[corners, :d], ours


def block(n: int) -> str:
    """Compare a block of n^3 hexahedra that is pressed on another one."""
    lower, of_lower = box((1.0, 1.0, 1.0), (n, n, n), 1)
    upper, of_upper = box((0.5, 0.5, 0.5), (n, n, n), 1)
    x = np.vstack([lower, upper + np.array([0.25, 0.25, 1.0])])
    cells = np.vstack([of_lower, of_upper + len(lower)])
    z = x[cells][..., 2]
    is_upper = np.arange(len(cells)) >= len(of_lower)
    text = mesh_text(x, cells, "C3D8")
    text += [*node_set("FOOT", x[:, 2] == 0.0), *node_set("TOP", x[:, 2] == 1.5)]
    for name, of_body, level, face in (
        ("MASTER", ~is_upper, z[:, 4], 2),
        ("SLAVE", is_upper, z[:, 0], 1),
    ):
        text += [f"*SURFACE, NAME={name}"]
        text += [f"{i + 1}, S{face}" for i in np.flatnonzero(of_body & (level == 1.0))]
    text += [*STEEL, "*SURFACE INTERACTION, NAME=I"]
    text += [
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        "1.E7, 3.",
        "*FRICTION",
        "0.2, 47000.",
    ]
    text += ["*CONTACT PAIR, INTERACTION=I, TYPE=NODE TO SURFACE", "SLAVE, MASTER"]
    text += ["*BOUNDARY", "FOOT, 1, 3", "TOP, 1, 2", "*STEP", "*STATIC", "*DLOAD"]
    text += [f"{i + 1}, P2, 100." for i in np.flatnonzero(z[:, 4] == 1.5)]
    x, theirs, ours = both([*text, *END])
    (middle,) = np.flatnonzero((abs(x - (0.5, 0.5, 1.5)) < NEAR).all(axis=1))
    apart = abs(ours - theirs).max() / abs(theirs).max()
    sinks = [f"{-u[middle, 2]:.4g}" for u in (theirs, ours)]
    return f"{len(of_lower)} | {apart:.1%} | {sinks[0]} | {sinks[1]}"


def disc(n: int) -> str:
    """Compare a disc of cells of size 1/n that a point in its middle holds."""
    x, cells = box((8.0, 1.0), (8 * n, 2 * n), 2)

    def number(r: float, z: float) -> int:
        return 1 + int(np.flatnonzero((abs(x - (r, z)) < NEAR).all(axis=1))[0])

    text = [*mesh_text(x, cells, "CAX8"), *STEEL]
    text += ["*BOUNDARY", f"{number(0, 0)}, 1, 2", f"{number(0, 1)}, 1"]
    text += ["*STEP", "*STATIC", "*CLOAD", f"{number(8, 0)}, 2, 1."]
    x, theirs, ours = both([*text, *END])

    def bent(u: np.ndarray, r: float, s: float) -> float:
        at = [(abs(x - place) < NEAR).all(axis=1) for place in ((r, 0.0), (s, 0.0))]
        return float(u[at[0], 1][0] - u[at[1], 1][0])

    outside = [bent(u, 7.0, 4.0) for u in (theirs, ours)]
    return (
        f"{1 / n:g} | {outside[0]:.4g} | {outside[1] / outside[0] - 1:+.1%} | "
        f"{bent(theirs, 7.0, 0.0):.3g}"
    )


def beam(n: int, *, padded: bool) -> str:
    """Compare a heated beam that is held along an edge, as it is or by the same pad."""
    x, cells = box((1.0, 1.0, 8.0), (n, n, 4 * n), 2)
    is_edge = (x[:, 2] == 8.0) & (x[:, 1] == 1.0)
    is_around = (x[:, 2] == 8.0) & (x[:, 1] >= 1.0 - 1.0 / n - NEAR)
    with_points = np.vstack([x, [(0.5, 1.0, 8.0)] * 2])
    sets = [
        *node_set("FOOT", x[:, 2] == 0.0),
        *node_set("EDGE", is_edge),
        *node_set("PAD", is_around),
    ]
    heat = ["*EXPANSION", "12.E-6"]
    start = ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NALL, 0."]
    ends = ["*STEP", "*STATIC", "*TEMPERATURE", "NALL, 100.", *END]
    before = [*mesh_text(with_points, cells, "C3D20R"), *sets, *STEEL[:3], *heat, STEEL[3], *start]
    edge = [*before, "*BOUNDARY", "FOOT, 1, 3", "EDGE, 1, 3", *ends]
    first = len(x) + 1
    rigid = [f"*RIGID BODY, NSET=PAD, REF NODE={first}, ROT NODE={first + 1}", "*BOUNDARY"]
    rigid += ["FOOT, 1, 3", f"{first}, 1, 3", f"{first + 1}, 2, 3"]
    places, theirs, ours = both(edge, [*before, *rigid, *ends] if padded else None)
    is_amid = abs(places[:, 2] - 4.0) < NEAR
    amid = abs(ours - theirs)[is_amid].max() / abs(theirs[is_amid]).max()
    return f"{len(cells)} | {'the pad' if padded else 'the edge'} | {amid:.1%}"


WITH_PADS = ("achteld", "beamnlt", "beamp1rotate", "segment2")
"""Decks of the suite that hold points."""
HOLDING = re.compile(r"^\*(BOUNDARY|TRANSFORM)\b[^*]*", re.IGNORECASE | re.MULTILINE)
"""Cards that hold nodes, with their lines."""


def with_pads(path: Path, deck: ec.Deck) -> list[str]:
    """Write a deck of the suite with the supports of its scene, pads among them."""
    mesh = read_deck_mesh(path)
    used = np.flatnonzero(mesh.node_is_used)
    space = deck.domain
    points = space.mesh.geometry.x[:, : space.dim]
    first = int(mesh.numbers.max()) + 1
    text: list[str] = []
    for support in deck.scene.supports:
        facets = space.facets(support.facets)
        corners = points[corners_of_facets(space, facets)]
        near = closest(mesh.x[used], corners).distance < NEAR
        text += [f"*NSET, NSET=S{first}", *lines(mesh.numbers[used[near]])]
        if not isinstance(support, ec.Rigid):
            text += ["*BOUNDARY"]
            held = [(i, value) for i, value in enumerate(support.value, 1) if value is not None]
            text += [f"S{first}, {i}, {i}, {value}" for i, value in held]
            first += 1
            continue
        place = ", ".join(map(str, support.about or ()))
        text += ["*NODE", f"{first}, {place}", f"{first + 1}, {place}"]
        text += [f"*RIGID BODY, NSET=S{first}, REF NODE={first}, ROT NODE={first + 1}"]
        text += ["*BOUNDARY"]
        for k, motion in enumerate(support.motions):
            if motion is not None:
                text += [f"{first + k // 3}, {k % 3 + 1}, {k % 3 + 1}, {motion}"]
        first += 2
    loose = HOLDING.sub("", path.read_text())
    before, after = re.split(r"(?m)^(?=\*STEP)", loose, maxsplit=1)
    ended = after.replace("*END STEP", "*NODE FILE\nU\n*END STEP")
    return [before.rstrip(), *text, ended]


def corners_of_facets(domain: ec.Domain, facets: np.ndarray) -> np.ndarray:
    """Return the points at the corners of facets (cell, local facet), shape (f, d)."""
    return of_facets(cell_nodes(domain.mesh.geometry)[facets[:, 0]], facets[:, 1])


def held_alike(path: Path) -> str:
    """Compare a deck that holds points, and with pads in both."""
    text = path.read_text().replace("*END STEP", "*NODE FILE\nU\n*END STEP").splitlines()
    deck = ec.read_deck(path, penalty="kept")
    words = []
    for other in (None, with_pads(path, deck)):
        _, theirs, ours = both(text, other)
        words.append(f"{abs(ours - theirs).max() / abs(theirs).max():.1%}")
    return f"`{path.stem}` | {' | '.join(words)}"


def main() -> None:
    """Print the tables."""
    logging.disable(logging.WARNING)
    print("| hexahedra of a block | greatest difference | the top sinks: CalculiX | here |")
    for n in (4, 8):
        print("|", block(n), "|", flush=True)
    print("| cells of the disc | w(7) - w(4): CalculiX | here | w(7) - w(0): CalculiX |")
    for n in (1, 2, 4):
        print("|", disc(n), "|", flush=True)
    print("| cells of the beam | CalculiX holds | difference in its middle |")
    for n, padded in ((2, False), (2, True), (4, False), (4, True)):
        print("|", beam(n, padded=padded), "|", flush=True)
    if len(sys.argv) > 1:
        print("| deck | CalculiX holds the points | the pads |")
        for name in WITH_PADS:
            print("|", held_alike(Path(sys.argv[1]) / f"{name}.inp"), "|", flush=True)


if __name__ == "__main__":
    main()
