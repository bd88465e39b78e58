"""The scene of two blocks with friction for other_codes.py, and its decks.

It is in the plane or in 3D, where both blocks have the depth 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import erc_contact as ec
from namedmesh.rows import in_space

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
NU, MU = 0.3, 0.3
SIZE = {2: 0.1, 3: 0.26}
"""Size of the cells by the dimension [length]."""
MOVED = {2: (0.01, -0.02), 3: (0.01, 0.0, -0.02)}
FORCES = {2: {"F_x": 0, "F_y": 1}, 3: {"F_x": 0, "F_z": 2}}
"""Components of the force on the upper block that the table has."""
REFERENCE = None
"""Forces and energy of the reference; None for the last row."""
ACCURACIES = {2: (0.01, 0.002), 3: (0.03, 0.01)}
"""Accuracies of the adaptive runs."""
PENALTY = 1000.0
"""Stiffness of CalculiX's contact over the modulus of the softer block [1/length]."""
SIMPLEX = {2: 2, 3: 4}
"""gmsh's numbers of triangles and tetrahedra."""
ELEMENTS = {2: "CPE6", 3: "C3D10"}
"""CalculiX's elements."""
THICKNESS = {2: ("1.",), 3: ()}
"""Second line of a section."""
EDGES = {2: ((0, 1), (1, 2), (2, 0)), 3: ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))}
"""Corners of the edges of its elements, in the order of the nodes in their middles."""


@dataclass
class Blocks:
    """Hold the corners of the mesh, with both blocks in one piece.

    Args:
        points: Places of the nodes, shape (n, d).
        cells: Nodes of the triangles or tetrahedra, shape (t, d + 1).
        region: 0 for a cell of the upper block, 1 for the lower, shape (t,).
    """

    points: np.ndarray
    cells: np.ndarray
    region: np.ndarray


def write_mesh(path: Path, dim: int) -> Blocks:
    """Mesh both blocks in one piece and write the gmsh file."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", SIZE[dim])
    occ = gmsh.model.occ
    bodies = []
    for low in (0, -1):
        if dim == 2:
            bodies.append((2, occ.addRectangle(-1, low, 0, 2, 1)))
        else:
            bodies.append((3, occ.addBox(-1, -1, low, 2, 2, 1)))
    occ.fragment(bodies[:1], bodies[1:])
    occ.synchronize()
    for name, (_, body) in zip(MODULI, bodies, strict=True):
        gmsh.model.addPhysicalGroup(dim, [body], name=name)
    for _, side in gmsh.model.getEntities(dim - 1):
        height = occ.getCenterOfMass(dim - 1, side)[dim - 1]
        if abs(height) > 0.9:
            gmsh.model.addPhysicalGroup(dim - 1, [side], name="top" if height > 0 else "bottom")
    gmsh.model.mesh.generate(dim)
    gmsh.write(str(path))
    tags, x, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=int)
    number[tags] = np.arange(len(tags))
    cells, region = [], []
    for index, body in enumerate(bodies):
        _, nodes = gmsh.model.mesh.getElementsByType(SIMPLEX[dim], body[1])
        cells.append(number[nodes].reshape(-1, dim + 1))
        region.append(np.full(len(cells[-1]), index))
    gmsh.finalize()
    return Blocks(x.reshape(-1, 3)[:, :dim], np.concatenate(cells), np.concatenate(region))


def scene(dim: int) -> ec.Scene:
    return ec.Scene(
        material=ec.Elastic(MODULI, NU),
        supports=[ec.Displacement("top", MOVED[dim]), ec.Displacement("bottom", (0.0,) * dim)],
        contacts=[ec.Contact("foot", friction=MU, against="seat")],
    )


def quadratic(blocks: Blocks) -> tuple[np.ndarray, np.ndarray]:
    """Split the interface and add nodes in the middles of the edges.

    Returns:
        Places of the nodes, shape (n, d), and the six or ten nodes of each cell, in the
        order of CalculiX: corners, then the middles.
    """
    # A corner is known by its block and its number, a middle by its two corners.
    corners = blocks.cells + blocks.region[:, None] * len(blocks.points)
    d = blocks.points.shape[1]
    edges = np.sort(corners[:, np.array(EDGES[d])], axis=-1)
    used, numbers = np.unique(corners, return_inverse=True)
    pairs, middles = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    x = blocks.points[used % len(blocks.points)]
    doubled = np.concatenate([blocks.points, blocks.points])
    places = np.concatenate([x, doubled[pairs].mean(axis=1)])
    elements = [numbers.reshape(corners.shape), len(x) + middles.reshape(len(corners), -1)]
    return places, np.concatenate(elements, axis=1)


def deck(blocks: Blocks) -> tuple[str, int]:
    """Write the input of CalculiX, with a penalty at the contact, in one increment.

    Returns:
        The text, and the number of unknowns; in the plane these are of one layer.
    """
    x, elements = quadratic(blocks)
    d = x.shape[1]
    lines = ["*NODE, NSET=ALL", numbered(in_space(x))]
    lines += [f"*ELEMENT, TYPE={ELEMENTS[d]}, ELSET=BODIES", numbered(elements + 1)]
    for index, (name, modulus) in enumerate(MODULI.items()):
        block = blocks.region == index
        lines += [f"*ELSET, ELSET={name}", members(np.flatnonzero(block))]
        lines += [f"*MATERIAL, NAME=OF_{name}", "*ELASTIC", f"{modulus}, {NU}"]
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=OF_{name}", *THICKNESS[d]]
        lines.append(f"*SURFACE, NAME=SIDE_{name}, TYPE=ELEMENT")
        lines += sides_at(x, elements, 0.0, block)
    for name, height in (("TOP", 1.0), ("BOTTOM", -1.0)):
        lines += [f"*NSET, NSET={name}", members(np.flatnonzero(abs(x[:, -1] - height) < 1e-9))]
    lines += pressed("SIDE_upper", "SIDE_lower", PENALTY * min(MODULI.values()), MU)
    moved = [f"TOP, {i}, {i}, {value}" for i, value in enumerate(MOVED[d], start=1)]
    lines += stepped([f"BOTTOM, 1, {d}", *moved])
    return "\n".join(lines), d * len(x)


def rows(folder: Path, dim: int) -> Iterator[Callable[[], Row]]:
    """Yield what makes each row, after all forms are compiled."""
    path = folder / "blocks.msh"
    blocks = write_mesh(path, dim)

    def own(accuracy: float) -> Row:
        domain = ec.read_mesh(path).split({"foot": "upper", "seat": "lower"})
        return ours(scene(dim), domain, "foot", accuracy)

    own(1.0)
    yield lambda: own(1.0)
    data = {
        "points": blocks.points,
        "cells": blocks.cells,
        "region": blocks.region,
        "moduli": list(MODULI.values()),
        "moves": [MOVED[dim], (0.0,) * dim],
        "nu": NU,
        "mu": MU,
    }
    yield lambda: getfem(folder, "other_codes_getfem_blocks.py", data)
    yield lambda: calculix(folder, *deck(blocks), dim)
    for accuracy in ACCURACIES[dim]:
        yield partial(own, accuracy)
