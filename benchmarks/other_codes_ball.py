"""The scene of a bonded layer on a ball for other_codes.py, and its decks.

All of it is turned: the mesh is the half plane of radius and axis, forces and energies
are of the full ring.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
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

E, NU, OUTER, HEIGHT, DEPTH, RADIUS = 1000.0, 0.3, 100.0, 10.0, 0.1, 500.0
SIZE = 1.25
FORCES = {2: {"F_z": -1}}
"""The component of the force on the layer."""
REFERENCE = ((2255.374380,), 79.38378369)
"""Force and energy by dual integral equations of an infinite layer."""
PENALTY = 1000.0
"""Stiffness of CalculiX's contact over the modulus [1/length]."""
WEDGES = 180
"""Number of the wedges of two degrees that CalculiX makes of turned bodies."""
STRIPS = 24
"""Elements of the ball, whose nodes are all fixed, in CalculiX."""
REACH = 30.0
"""Their greatest radius [length]."""


def write_mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Mesh the layer and write the gmsh file of degree 1.

    Returns:
        Nodes and triangles of degree 2, shapes (n, 2) and (t, 6).
    """
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", SIZE)
    face = gmsh.model.occ.addRectangle(0, 0, 0, OUTER, HEIGHT)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [face], name="layer")
    for name, curve in {"bottom": 1, "top": 3}.items():
        gmsh.model.addPhysicalGroup(1, [curve], name=name)
    gmsh.model.mesh.generate(2)
    gmsh.write(str(path))
    gmsh.model.mesh.setOrder(2)
    tags, x, _ = gmsh.model.mesh.getNodes()
    _, nodes = gmsh.model.mesh.getElementsByType(9)
    gmsh.finalize()
    order = np.argsort(tags)
    triangles = np.searchsorted(tags[order], nodes).reshape(-1, 6)
    return x.reshape(-1, 3)[order, :2], triangles


def scene() -> ec.Scene:
    return ec.Scene(
        material=ec.Elastic(E, NU, hypothesis="axisymmetric"),
        supports=[ec.Displacement("top", (0.0, -DEPTH))],
        contacts=[ec.Contact("bottom", gap=lambda x: x[0] ** 2 / (2 * RADIUS))],
    )


def deck(x: np.ndarray, triangles: np.ndarray) -> tuple[str, int]:
    """Write the input of CalculiX, with a penalty at the contact, in one increment.

    The ball is a strip of curved elements that are held at all nodes.

    Returns:
        The text, and the number of unknowns of the layer.
    """
    r = np.linspace(0.0, REACH, 2 * STRIPS + 1)
    top = np.column_stack([r, -(r**2) / (2 * RADIUS)])
    ball = np.concatenate([top, top - (0.0, 2.0), (top - (0.0, 1.0))[::2]])
    places = np.concatenate([x, ball])
    lines = ["*NODE, NSET=ALL", numbered(np.column_stack([places, np.zeros(len(places))]))]
    lines += ["*ELEMENT, TYPE=CAX6, ELSET=BODIES", numbered(triangles + 1)]
    lines += ["*ELEMENT, TYPE=CAX8, ELSET=BALL"]
    low, side = len(top), 2 * len(top)
    for strip in range(STRIPS):
        a, middle, b = 2 * strip, 2 * strip + 1, 2 * strip + 2
        corners = [low + a, low + b, b, a]
        middles = [low + middle, side + strip + 1, middle, side + strip]
        nodes = np.array(corners + middles) + len(x) + 1
        lines.append(", ".join(map(str, [len(triangles) + 1 + strip, *nodes])))
    lines += ["*MATERIAL, NAME=SOFT", "*ELASTIC", f"{E}, {NU}"]
    for name in ("BODIES", "BALL"):
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=SOFT", ""]
    lines += ["*SURFACE, NAME=FOOT, TYPE=ELEMENT", *sides_at(x, triangles, 0.0)]
    lines += ["*SURFACE, NAME=SEAT, TYPE=ELEMENT"]
    lines += [f"{len(triangles) + 1 + strip}, S3" for strip in range(STRIPS)]
    sets = {"TOP": x[:, 1] > HEIGHT - 1e-9, "AXIS": x[:, 0] < 1e-9}
    for name, chosen in sets.items():
        lines += [f"*NSET, NSET={name}", members(np.flatnonzero(chosen))]
    lines += ["*NSET, NSET=HELD", members(np.arange(len(x), len(places)))]
    lines += pressed("FOOT", "SEAT", PENALTY * E)
    lines += stepped(["HELD, 1, 2", "AXIS, 1, 1", "TOP, 1, 1", f"TOP, 2, 2, {-DEPTH}"])
    return "\n".join(lines), 2 * len(x)


def rows(folder: Path, dim: int) -> Iterator[Callable[[], Row]]:
    """Yield what makes each row, after all forms are compiled."""
    path = folder / "layer.msh"
    x, triangles = write_mesh(path)

    def own(accuracy: float) -> Row:
        return ours(scene(), ec.read_mesh(path), "bottom", accuracy)

    own(1.0)
    yield lambda: own(1.0)
    data = {
        "points": x,
        "triangles": triangles[:, :3],
        "sizes": (OUTER, HEIGHT, DEPTH, RADIUS),
        "moduli": (E, NU),
    }
    yield lambda: getfem(folder, "other_codes_getfem_ball.py", data)
    yield lambda: calculix(folder, *deck(x, triangles), dim, WEDGES)
    yield lambda: own(0.01)
    yield lambda: own(0.001)
