"""The scene of two blocks with friction for other_codes.py, and its decks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled
from other_codes_programs import (
    Row,
    calculix,
    getfem,
    members,
    numbered,
    ours,
    pressed,
    sides_at,
    stepped,
)

MODULI = {"upper": 1000.0, "lower": 3000.0}
NU, MU, SIZE = 0.3, 0.3, 0.1
MOVED = (0.01, -0.02)
FORCES = ("F_x", "F_y")
"""Names of the components of the force on the upper block."""
REFERENCE = None
"""Forces and energy of the reference; None for the last row."""
PENALTY = 1000.0
"""Stiffness of CalculiX's contact over the modulus of the softer block [1/length]."""


@dataclass
class Blocks:
    """Hold the corners of the mesh, with both blocks in one piece.

    Args:
        points: Places of the nodes, shape (n, 2).
        triangles: Nodes of the triangles, counter-clockwise, shape (t, 3).
        region: 0 for a triangle of the upper block, 1 for the lower, shape (t,).
    """

    points: np.ndarray
    triangles: np.ndarray
    region: np.ndarray


def write_mesh(path: Path) -> Blocks:
    """Mesh both blocks in one piece and write the gmsh file."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", SIZE)
    occ = gmsh.model.occ
    upper = (2, occ.addRectangle(-1, 0, 0, 2, 1))
    lower = (2, occ.addRectangle(-1, -1, 0, 2, 1))
    occ.fragment([upper], [lower])
    occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [upper[1]], name="upper")
    gmsh.model.addPhysicalGroup(2, [lower[1]], name="lower")
    for _, curve in gmsh.model.getEntities(1):
        y = occ.getCenterOfMass(1, curve)[1]
        if abs(y) > 0.9:
            gmsh.model.addPhysicalGroup(1, [curve], name="top" if y > 0 else "bottom")
    gmsh.model.mesh.generate(2)
    gmsh.write(str(path))
    tags, x, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=int)
    number[tags] = np.arange(len(tags))
    triangles, region = [], []
    for index, (_, face) in enumerate((upper, lower)):
        _, nodes = gmsh.model.mesh.getElementsByType(2, face)
        triangles.append(number[nodes].reshape(-1, 3))
        region.append(np.full(len(triangles[-1]), index))
    gmsh.finalize()
    return Blocks(x.reshape(-1, 3)[:, :2], np.concatenate(triangles), np.concatenate(region))


def scene() -> ec.Scene:
    return ec.Scene(
        material=ec.Elastic(MODULI, NU),
        supports=[ec.Displacement("top", MOVED), ec.Displacement("bottom", (0.0, 0.0))],
        contacts=[ec.Contact("foot", friction=MU, against="seat")],
    )


def quadratic(blocks: Blocks) -> tuple[np.ndarray, np.ndarray]:
    """Split the interface and add nodes in the middles of the sides.

    Returns:
        Places of the nodes, shape (n, 2), and the six nodes of each triangle, in the
        order of CalculiX: corners, then the middles of sides 1-2, 2-3 and 3-1.
    """
    # A corner is known by its block and its number, a middle by its two corners.
    corners = blocks.triangles + blocks.region[:, None] * len(blocks.points)
    sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1), axis=-1)
    used, numbers = np.unique(corners, return_inverse=True)
    pairs, middles = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    x = blocks.points[used % len(blocks.points)]
    doubled = np.concatenate([blocks.points, blocks.points])
    places = np.concatenate([x, doubled[pairs].mean(axis=1)])
    elements = [numbers.reshape(-1, 3), len(x) + middles.reshape(-1, 3)]
    return places, np.concatenate(elements, axis=1)


def deck(blocks: Blocks) -> tuple[str, int]:
    """Write the input of CalculiX, with a penalty at the contact, in 10 increments.

    Returns:
        The text, and the number of unknowns in the plane.
    """
    x, elements = quadratic(blocks)
    lines = ["*NODE, NSET=ALL", numbered(np.column_stack([x, np.zeros(len(x))]))]
    lines += ["*ELEMENT, TYPE=CPE6, ELSET=BODIES", numbered(elements + 1)]
    for index, (name, modulus) in enumerate(MODULI.items()):
        block = blocks.region == index
        lines += [f"*ELSET, ELSET={name}", members(np.flatnonzero(block))]
        lines += [f"*MATERIAL, NAME=OF_{name}", "*ELASTIC", f"{modulus}, {NU}"]
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=OF_{name}", "1."]
        lines.append(f"*SURFACE, NAME=SIDE_{name}, TYPE=ELEMENT")
        lines += sides_at(x, elements, 0.0, block)
    for name, y in (("TOP", 1.0), ("BOTTOM", -1.0)):
        lines += [f"*NSET, NSET={name}", members(np.flatnonzero(abs(x[:, 1] - y) < 1e-9))]
    lines += pressed("SIDE_upper", "SIDE_lower", PENALTY * min(MODULI.values()), MU)
    lines += stepped(["BOTTOM, 1, 2", f"TOP, 1, 1, {MOVED[0]}", f"TOP, 2, 2, {MOVED[1]}"])
    return "\n".join(lines), 2 * len(x)


def rows(folder: Path) -> Iterator[Callable[[], Row]]:
    """Yield what makes each row, after all forms are compiled."""
    path = folder / "blocks.msh"
    blocks = write_mesh(path)

    def own(accuracy: float) -> Row:
        domain = ec.read_mesh(path).split({"foot": "upper", "seat": "lower"})
        return ours(scene(), domain, "foot", accuracy)

    own(1.0)
    yield lambda: own(1.0)
    data = {
        "points": blocks.points,
        "triangles": blocks.triangles,
        "region": blocks.region,
        "moduli": list(MODULI.values()),
        "moves": [MOVED, (0.0, 0.0)],
        "nu": NU,
        "mu": MU,
    }
    yield lambda: getfem(folder, "other_codes_getfem_blocks.py", data)
    yield lambda: calculix(folder, *deck(blocks))
    yield lambda: own(0.01)
    yield lambda: own(0.002)
