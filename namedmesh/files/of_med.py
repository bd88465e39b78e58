"""Read files of MED, of Salome and code_aster, with their groups of cells and nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.file_mesh import Block, ElementSet, FileMesh, NodeSet
from namedmesh.rows import in_space

NAME = 80
"""Letters of the name of a group."""
SHAPE_NAMES = {
    "PO": "vertex",
    "SE": "line",
    "TR": "triangle",
    "QU": "quadrilateral",
    "TE": "tetrahedron",
    "T1": "tetrahedron",
    "HE": "hexahedron",
    "H2": "hexahedron",
    "PE": "prism",
    "P15": "prism",
    "P18": "prism",
    "PY": "pyramid",
    "P13": "pyramid",
}
"""Shape by the beginning of MED's names of types."""


def mesh_of_med(path: Path) -> FileMesh:
    """Read the first mesh of a file of MED, whose sets are its groups."""
    import h5py  # noqa: PLC0415 - paid for only by those who read such files

    with h5py.File(path, "r") as file:
        name, mesh = _first_mesh(file)
        # Files of version 2.3 have no dimension of space, and families in the mesh.
        attributes = file["ENS_MAA"][name].attrs
        dim = int(attributes["ESP" if "ESP" in attributes else "DIM"])
        if int(attributes.get("REP", 0)):
            raise InputError(
                "its points are in cylindrical or spherical coordinates; let Salome write the mesh "
                "in Cartesian ones."
            )
        families = _families(mesh["FAS"] if "FAS" in mesh else file.get(f"FAS/{name}", {}))
        coordinates = mesh["NOE"]["COO"][()].reshape(dim, -1).T
        blocks = []
        tags = []
        left_out = {}
        for kind, group in mesh["MAI"].items():
            shape = SHAPE_NAMES.get(kind[:3], SHAPE_NAMES.get(kind[:2]))
            if "NOD" not in group:
                continue
            count = int(group["NOD"].attrs["NBR"])
            if shape is None:
                left_out[kind] = count
                continue
            # The first nodes of all elements come first, then their second nodes.
            nodes = group["NOD"][()].reshape(-1, count).T.astype(np.int64) - 1
            blocks.append(Block(shape, nodes))
            tags.append(group["FAM"][()] if "FAM" in group else np.zeros(count, dtype=int))
        node_tags = mesh["NOE"]["FAM"][()] if "FAM" in mesh["NOE"] else None
        values = _displacements(file, len(coordinates))
    return FileMesh(
        in_space(coordinates),
        tuple(blocks),
        _element_sets(tags, families.get("ELEME", {})),
        node_sets=_node_sets(node_tags, families.get("NOEUD", {})),
        left_out=left_out,
        values=values,
    )


def _first_mesh(file: Any) -> tuple[str, Any]:
    """Return name and group of the first mesh that has points and cells.

    Of a mesh of several time steps it is the first one, the body at rest.

    Raises:
        InputError: If there is none.
    """
    for name, mesh in file.get("ENS_MAA", {}).items():
        steps = [mesh]
        if "NOE" not in mesh:
            steps = [mesh[key] for key in sorted(mesh) if "NDT" in mesh[key].attrs]
            steps.sort(key=lambda step: int(step.attrs["NDT"]))
        for step in steps:
            if "COO" in step.get("NOE", {}) and any("NOD" in cells for cells in _kinds(step)):
                return name, step
    raise InputError(
        "it has no mesh of points and cells (in ENS_MAA, as files of MED have from version 2.2 "
        "on), but results, groups or a grid by rule alone; let Salome write the mesh as cells."
    )


def _kinds(mesh: Any) -> list[Any]:
    """Return the groups of cells of a mesh."""
    return list(mesh["MAI"].values()) if "MAI" in mesh else []


def _families(kinds: Any) -> dict[str, dict[str, list[int]]]:
    """Return the numbers of families by group, for elements and for nodes."""
    found: dict[str, dict[str, list[int]]] = {}
    for kind, families in kinds.items():
        if kind not in ("ELEME", "NOEUD"):
            continue
        groups = found.setdefault(kind, {})
        for family in families.values():
            if "GRO" not in family:
                continue
            letters = np.asarray(family["GRO"]["NOM"][()]).tobytes()
            end = min(NAME * int(family["GRO"].attrs["NBR"]), len(letters))
            for begin in range(0, end, NAME):
                name = letters[begin : begin + NAME].split(b"\0")[0].decode("latin-1").strip()
                groups.setdefault(name, []).append(int(family.attrs["NUM"]))
    return found


def _element_sets(tags: list[np.ndarray], groups: dict[str, list[int]]) -> tuple[ElementSet, ...]:
    """Return the groups of elements, from their tags and the tags of each group."""
    sets = []
    for name, numbers in groups.items():
        members = {}
        for block, block_tags in enumerate(tags):
            found = np.flatnonzero(np.isin(block_tags, numbers))
            if len(found):
                members[block] = found
        sets.append(ElementSet(name, members))
    return tuple(sets)


def _node_sets(tags: np.ndarray | None, groups: dict[str, list[int]]) -> tuple[NodeSet, ...]:
    """Return the groups of nodes, from their tags and the tags of each group."""
    if tags is None:
        return ()
    sets = []
    for name, numbers in groups.items():
        sets.append(NodeSet(name, np.flatnonzero(np.isin(tags, numbers))))
    return tuple(sets)


def _displacements(file: Any, count: int) -> dict[str, np.ndarray]:
    """Return the vectors at all nodes, of the last step, shape (n, 3) each."""
    found = {}
    for name, field in file.get("CHA", {}).items():
        step = field[sorted(field)[-1]]
        components = int(field.attrs["NCO"])
        if "NOE" not in step or components < 2:
            continue
        for profile in step["NOE"].values():
            values = profile["CO"][()].reshape(components, -1).T[:, :3] if "CO" in profile else None
            if values is not None and len(values) == count:
                found[name] = in_space(values)
    return found
