"""Read mesh files of GiD (.msh), whose meshes with names and materials are the sets."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.file_mesh import SHAPES, Block, ElementSet, FileMesh, by_tags

HEAD = re.compile(
    r"\s*mesh\s*(?:\"(?P<quoted>[^\"]*)\"|(?!dimension)(?P<bare>\S+))?\s*dimension\s*=?\s*(?P<dim>\d)\s+"
    r"elemtype\s*=?\s*(?P<kind>\w+)\s+nnode\s*=?\s*(?P<nodes>\d+)",
    re.IGNORECASE,
)
"""Line that begins a mesh: its name, dimension, kind of elements and nodes of each."""
SHAPE_OF_KIND = {
    "linear": "line",
    "triangle": "triangle",
    "quadrilateral": "quadrilateral",
    "tetrahedra": "tetrahedron",
    "hexahedra": "hexahedron",
    "prism": "prism",
    "pyramid": "pyramid",
}
"""Shape by GiD's name of a kind."""


def mesh_of_gid(path: Path) -> FileMesh:
    """Read a mesh file of GiD.

    Raises:
        InputError: If it has no points, or a row of elements has too few nodes.
    """
    section = ""
    points: dict[int, list[float]] = {}
    meshes: list[tuple[re.Match[str], list[list[str]]]] = []
    for line in path.read_text("latin-1").splitlines():
        text = line.partition("#")[0].strip()
        head = HEAD.match(text)
        if head:
            meshes.append((head, []))
        elif text.lower() in ("coordinates", "elements"):
            section = text.lower()
        elif text.lower().startswith("end "):
            section = ""
        elif text and section == "coordinates":
            number, *place = text.split()
            points[int(number)] = [float(value) for value in place]
        elif text and section == "elements":
            meshes[-1][1].append(text.split())
    if not points:
        raise InputError("it has no points (Coordinates).")
    rows = {number: row for row, number in enumerate(points)}
    blocks: list[Block] = []
    materials: list[np.ndarray] = []
    named: dict[str, dict[int, np.ndarray]] = {}
    left_out: Counter[str] = Counter()
    for head, elements in meshes:
        shape = SHAPE_OF_KIND.get(head["kind"].lower())
        width = int(head["nodes"])
        if shape is None or width < SHAPES[shape].corners:
            left_out[head["kind"]] += len(elements)
            continue
        nodes = [[rows.get(int(word), -1) for word in words[1 : width + 1]] for words in elements]
        blocks.append(Block(shape, np.array(nodes, dtype=np.int64).reshape(-1, width)))
        # Elements without a material are in no set.
        materials.append(np.array([int((words[width + 1 :] or ["0"])[0]) for words in elements]))
        name = head["quoted"] or head["bare"]
        if name:
            named.setdefault(name, {})[len(blocks) - 1] = np.arange(len(elements))
    sets = [ElementSet(name, members) for name, members in named.items()]
    if len(sets) < len(meshes):
        sets += [found for found in by_tags(tuple(blocks), materials, {}) if found.tag]
    x = np.array([[*place, *[0.0] * (3 - len(place))] for place in points.values()])
    return FileMesh(x, tuple(blocks), tuple(sets), left_out=left_out)
