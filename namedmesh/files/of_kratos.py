"""Read files of Kratos (.mdpa), whose submodel parts are the sets."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.file_mesh import Block, ElementSet, FileMesh, NodeSet, shape_with
from namedmesh.rows import places_of

WIDTH = re.compile(r"(\d)D(\d+)(?:N|$)")
"""End of the names of elements: dimension of space and number of nodes."""
SURFACES = re.compile(r"Shell|Membrane|Plate|Surface|Face|Condition|Quadrilateral|Triangle")
"""Names of elements that are no solids in 3D."""
LINES = re.compile(r"Truss|Cable|Beam|Line|Spring")
"""Names of elements along lines."""
SETS = ("Nodes", "Elements", "Conditions", "Geometries")
"""What a submodel part or a mesh of an old file lists."""


@dataclass
class _ElementBlock:
    """Hold elements or conditions of one kind: numbers, properties and nodes."""

    kind: str
    shape: str | None
    table: np.ndarray


@dataclass
class _Part:
    """Hold a submodel part: its name, and the numbers that it lists by their kind."""

    name: str
    numbers: dict[str, list[int]] = field(default_factory=dict)


def mesh_of_kratos(path: Path) -> FileMesh:
    """Read a file of Kratos.

    Raises:
        InputError: If it has no nodes.
    """
    tables = [np.empty((0, 4))]
    groups: dict[str, list[_ElementBlock]] = {"Elements": [], "Conditions": [], "Geometries": []}
    parts = []
    stack: list[_Part] = []
    words: list[str] = []
    lines: list[str] = []
    for line in path.read_text("latin-1").splitlines():
        text = line.split("//")[0].strip()
        if text.startswith("Begin "):
            words = text.split()[1:]
            lines = []
            if words[0] in ("SubModelPart", "Mesh"):
                stack.append(_Part(".".join([*(part.name for part in stack[-1:]), *words[1:2]])))
                parts.append(stack[-1])
        elif text.startswith("End "):
            ended = text.split()[1]
            if ended in ("SubModelPart", "Mesh") and stack:
                stack.pop()
            elif ended == "Nodes":
                tables.append(np.array(" ".join(lines).split(), dtype=float).reshape(-1, 4))
            elif ended in groups and len(words) > 1 and lines:
                groups[ended].append(_elements(words[1], lines, ended))
            elif stack:
                kind = ended.removeprefix("SubModelPart").removeprefix("Mesh")
                if kind in SETS:
                    numbers = [int(word) for word in " ".join(lines).split()]
                    stack[-1].numbers.setdefault(kind, []).extend(numbers)
        elif text:
            lines.append(text)
    nodes = np.concatenate(tables)
    if not len(nodes):
        raise InputError("it has no block of nodes ('Begin Nodes').")
    return _file_mesh(nodes, groups, parts)


def _elements(kind: str, lines: list[str], group: str) -> _ElementBlock:
    """Return the elements of a block."""
    match = WIDTH.search(kind)
    shape = None
    if match:
        d, nodes = map(int, match.groups())
        # Conditions are sides of solids.
        is_side = group == "Conditions" or (d == 3 and SURFACES.search(kind))
        shape = shape_with(d - 1 if is_side else d, nodes)
        if LINES.search(kind) and group == "Elements":
            shape = None
    rows = [line.split() for line in lines]
    # Geometries have no properties.
    first = 1 if group == "Geometries" else 2
    width = int(match.group(2)) if match else len(rows[0]) - first
    table = np.zeros((len(rows), width + 2), dtype=np.int64)
    for row, line in zip(table, rows, strict=True):
        row[0] = int(line[0])
        row[1] = int(line[1]) if first == 2 else 0
        row[2 : 2 + len(line) - first] = [int(word) for word in line[first:]]
    return _ElementBlock(kind, shape, table)


def _file_mesh(
    nodes: np.ndarray, groups: dict[str, list[_ElementBlock]], parts: list[_Part]
) -> FileMesh:
    """Return the mesh of what was found in a file."""
    numbers = nodes[:, 0].astype(np.int64)
    blocks: list[Block] = []
    left_out: Counter[str] = Counter()
    places: dict[str, dict[int, tuple[int, int]]] = {}
    properties: dict[int, dict[int, np.ndarray]] = {}
    for group, members in groups.items():
        for elements in members:
            if elements.shape is None:
                left_out[elements.kind] += len(elements.table)
                continue
            block = len(blocks)
            blocks.append(Block(elements.shape, places_of(numbers, elements.table[:, 2:])))
            for place, number in enumerate(elements.table[:, 0].tolist()):
                places.setdefault(group, {})[number] = (block, place)
            if group == "Elements":
                for tag in np.unique(elements.table[:, 1]):
                    found = np.flatnonzero(elements.table[:, 1] == tag)
                    properties.setdefault(int(tag), {})[block] = found
    element_sets, node_sets = _sets(parts, places, numbers)
    if not any(part.numbers.get("Elements") for part in parts) and len(properties) > 1:
        for tag, members_by_block in properties.items():
            element_sets.append(ElementSet(str(tag), members_by_block, tag))
    return FileMesh(
        nodes[:, 1:],
        tuple(blocks),
        tuple(element_sets),
        node_sets=tuple(node_sets),
        left_out=left_out,
    )


def _sets(
    parts: list[_Part], places: dict[str, dict[int, tuple[int, int]]], numbers: np.ndarray
) -> tuple[list[ElementSet], list[NodeSet]]:
    """Return the sets of submodel parts; nodes count only where nothing else is listed.

    Args:
        parts: The submodel parts.
        places: For each kind of elements, block and place there by the number.
        numbers: Number of each point.
    """
    element_sets = []
    node_sets = []
    for part in parts:
        members: dict[int, list[int]] = {}
        for group, known in places.items():
            for number in part.numbers.get(group, []):
                if number in known:
                    block, place = known[number]
                    members.setdefault(block, []).append(place)
        if members:
            found = {block: np.array(rows) for block, rows in members.items()}
            element_sets.append(ElementSet(part.name, found))
        elif "Nodes" in part.numbers:
            wanted = np.array(part.numbers["Nodes"], dtype=np.int64)
            node_sets.append(NodeSet(part.name, places_of(numbers, wanted)))
    return element_sets, node_sets
