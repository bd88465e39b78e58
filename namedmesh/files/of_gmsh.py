"""Read the mesh of a gmsh model, with its groups or numbers of entities."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from namedmesh.base.exceptions import InputError, words_of
from namedmesh.files.file_mesh import (
    BODY,
    Block,
    ElementSet,
    FacetSet,
    FileMesh,
    pad,
)
from namedmesh.files.for_gmsh import called
from namedmesh.files.of_meshio import mesh_of_meshio
from namedmesh.rows import places_of

SHAPE_NAMES = {
    "Line": "line",
    "Triangle": "triangle",
    "Quadrilateral": "quadrilateral",
    "Tetrahedron": "tetrahedron",
    "Hexahedron": "hexahedron",
    "Prism": "prism",
    "Pyramid": "pyramid",
}
"""The shape of elements by the first word of gmsh's name of their type."""


def mesh_of_gmsh(
    path: Path,
    *,
    numbered: bool,
    ending: str,
    moved: Mapping[int, np.ndarray] | None = None,
) -> FileMesh:
    """Read a file by gmsh, in a process of its own; see :func:`grouped`.

    Args:
        path: The file.
        numbered: As in :func:`grouped`.
        ending: The ending of the format.
        moved: Places of nodes by their numbers [length], shape (3,) each, that gmsh
            does not know.
    """
    import gmsh  # noqa: PLC0415 - paid for only by those who read such files

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    with called(path, ending) as its_link:
        try:
            gmsh.merge(str(its_link))
        except Exception as reason:  # gmsh's errors are of no class of their own
            words = words_of(reason).replace(str(its_link), path.name)
            raise InputError(
                f"gmsh cannot read it ({words}). Write the mesh in another format: .msh, .vtu, "
                ".med, .inp."
            ) from reason
    for node in map(int, gmsh.model.mesh.getNodes()[0] if moved else ()):
        if moved and node in moved:
            gmsh.model.mesh.setNode(node, moved[node], [])
    with grouped(gmsh.model, numbered=numbered):
        # In version 2 each element has groups; gmsh gives them to whole entities.
        if in_two_groups(gmsh.model) and _is_of_second_version(path):
            return mesh_of_meshio(path, kind="gmsh")
        return mesh_of_model(gmsh.model)


def _is_of_second_version(path: Path) -> bool:
    """Tell whether a file of gmsh is of version 2."""
    with path.open("rb") as file:
        return file.read(40).split()[:2] in ([b"$MeshFormat", b"2.2"], [b"$MeshFormat", b"2"])


def mesh_of_model(model: Any) -> FileMesh:
    """Return the mesh of a gmsh model, whose sets are its physical groups.

    Elements of other shapes are left out and counted.
    """
    dim = int(model.getDimension())
    numbers_of_nodes, points = _points(model)
    blocks: dict[str, list[np.ndarray]] = {}
    places: dict[tuple[int, int], list[tuple[str, int, int]]] = {}
    left_out: Counter[str] = Counter()
    for d, tag in model.getEntities():
        if d < dim - 1:
            continue
        for kind, elements, flat in zip(*model.mesh.getElements(d, tag), strict=True):
            name, _, _, nodes_each, _, _ = model.mesh.getElementProperties(kind)
            shape = SHAPE_NAMES.get(name.split()[0])
            if shape is None or not nodes_each:
                left_out[name] += len(elements)
                continue
            nodes = places_of(numbers_of_nodes, flat.astype(np.int64)).reshape(-1, nodes_each)
            key = f"{shape} {nodes_each}"
            begin = sum(map(len, blocks.setdefault(key, [])))
            blocks[key].append(nodes)
            places.setdefault((d, tag), []).append((key, begin, begin + len(nodes)))
    numbers = {key: number for number, key in enumerate(blocks)}
    sets = []
    for d in (dim - 1, dim):
        for name, tag, entities in _groups(model, d):
            members: dict[int, list[np.ndarray]] = {}
            for entity in entities:
                for key, begin, end in places.get((d, entity), ()):
                    members.setdefault(numbers[key], []).append(np.arange(begin, end))
            found = {number: np.concatenate(ranges) for number, ranges in members.items()}
            sets.append(ElementSet(name, found, tag))
    tables = [Block(key.split()[0], np.concatenate(parts)) for key, parts in blocks.items()]
    return FileMesh(points, tuple(tables), tuple(sets), left_out=left_out)


def _points(model: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return gmsh's numbers of the nodes in order, and the points."""
    nodes, x, _ = model.mesh.getNodes()
    order = np.argsort(nodes)
    return nodes[order].astype(np.int64), x.reshape(-1, 3)[order]


@contextmanager
def grouped(model: Any, *, numbered: bool) -> Iterator[None]:
    """Mesh a model if it is not yet, and give it groups of facets and cells while used.

    Afterwards the model has the physical groups that it had.

    Args:
        model: The model.
        numbered: Whether each entity of a dimension without groups becomes a group that
            is called by its number. A body of one entity is called :data:`BODY`, and
            all of it otherwise.

    Raises:
        InputError: If it has no surface and no volume.
    """
    dim = int(model.getDimension())
    if dim < 2:
        raise InputError(
            f"The gmsh model has dimension {max(dim, 0)}; give a surface in the plane or a volume."
        )
    if not len(model.mesh.getElements(dim)[0]):
        model.mesh.generate(dim)
    added = []
    for d in (dim - 1, dim):
        if model.getPhysicalGroups(d):
            continue
        tags = [int(tag) for _, tag in model.getEntities(d)]
        if not numbered:
            if d == dim:
                added.append((d, model.addPhysicalGroup(d, tags, name=BODY)))
            continue
        beside_cells = [tag for tag in tags if len(model.getAdjacencies(d, tag)[0])]
        # The entities of some files do not know each other.
        tags = beside_cells if d < dim and beside_cells else tags
        for tag in tags:
            name = BODY if d == dim and len(tags) == 1 else str(tag)
            added.append((d, model.addPhysicalGroup(d, [tag], tag, name)))
    try:
        yield
    finally:
        if added:  # none would mean all
            model.removePhysicalGroups(added)


def in_two_groups(model: Any) -> bool:
    """Tell whether an entity is in two physical groups."""
    owned = []
    for d, tag in model.getPhysicalGroups():
        owned += [(d, int(entity)) for entity in model.getEntitiesForPhysicalGroup(d, tag)]
    return len(set(owned)) < len(owned)


def _groups(model: Any, d: int) -> list[tuple[str, int, list[int]]]:
    """Return name, tag and entities of each physical group of a dimension."""
    groups = []
    for _, tag in model.getPhysicalGroups(d):
        entities = [int(entity) for entity in model.getEntitiesForPhysicalGroup(d, tag)]
        groups.append((model.getPhysicalName(d, tag).strip() or str(tag), int(tag), entities))
    return groups


def marked_entities(model: Any, tags: dict[int, int]) -> list[FacetSet]:
    """Return the facets on curves (2D) or surfaces (3D) of a model, with marks.

    Args:
        model: The model, whose body has one dimension more.
        tags: gmsh's tag of each mark.
    """
    d = int(model.getDimension()) - 1
    numbers, _ = _points(model)
    result = []
    for mark, tag in tags.items():
        for kind, _, flat in zip(*model.mesh.getElements(d, tag), strict=True):
            _, _, _, nodes_each, _, corners_each = model.mesh.getElementProperties(kind)
            nodes = places_of(numbers, flat.astype(np.int64)).reshape(-1, nodes_each)
            corners = nodes[:, :corners_each]
            result.append(FacetSet(str(mark), pad(corners), mark))
    return result
