"""Name the parts of a gmsh model, and prepare it as DOLFINx needs it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import cpp, fem, graph
from dolfinx import mesh as dmesh
from dolfinx.io import gmsh as dgmsh
from dolfinx.io.utils import distribute_entity_data
from mpi4py import MPI

from erc_contact.base.checks import description
from erc_contact.base.exceptions import InputError
from erc_contact.base.releases import cell_nodes, geometry_element
from erc_contact.mesh.partition import coordinate_element, partitioner


def distributed_model(model: Any, comm: MPI.Comm, rank: int, dim: int) -> dgmsh.MeshData:
    """Give each rank its part of the mesh of a model; collective.

    Args:
        model: gmsh's model on ``rank``, prepared; other ranks need none.
        comm: Communicator.
        rank: The one that has the model.
        dim: Dimension of the cells.
    """
    data = dgmsh.model_to_mesh(model, comm, rank, gdim=dim, partitioner=partitioner(comm))
    return dgmsh.MeshData(_with_usual_element(data.mesh), *data[1:])


def _with_usual_element(mesh: dmesh.Mesh) -> dmesh.Mesh:
    """Return a mesh with the coordinate element that DOLFINx's own meshes have.

    DOLFINx reads gmsh's meshes with equispaced nodes. At degree 1 this is the same
    element under another name, and each form would be compiled once for either name.
    """
    element = coordinate_element(mesh.geometry.dim)
    geometry = dmesh.create_geometry(
        mesh.geometry.index_map(),
        cell_nodes(mesh.geometry),
        geometry_element(fem.coordinate_element(element.basix_element)),
        mesh.geometry.x[:, : mesh.geometry.dim].copy(),
        mesh.geometry.input_global_indices,
    )
    # The tags of facets and cells belong to the topology, which stays.
    same = cpp.mesh.Mesh_float64(mesh.comm, mesh.topology._cpp_object, geometry._cpp_object)
    return dmesh.Mesh(same, ufl.Mesh(element))


def name_groups(model: Any, names: Mapping[int | tuple[int, int], str]) -> None:
    """Give names to the physical groups of a model.

    Args:
        model: gmsh's model.
        names: Names by the tags of the groups, or by pairs (dimension, tag).

    Raises:
        InputError: If the names are no mapping to texts, no group or two groups have a
            tag, or two groups of the same dimension get the same name.
    """
    is_mapping = isinstance(names, Mapping)
    if not is_mapping or not all(isinstance(name, str) and name for name in names.values()):
        example = "names={1: 'bottom', 2: 'top'}"
        raise InputError(
            f"names is {description(names)}; give names of parts by their tags, e.g. {example}."
        )
    dim = int(model.getDimension())
    groups = [group for group in model.getPhysicalGroups() if group[0] >= dim - 1]
    group_names: dict[tuple[int, int], str] = {}
    for key, name in names.items():
        group_names[_group_of(key, groups)] = name
    # Other groups keep their names, or are called by their tags.
    for group in groups:
        group_names.setdefault(group, model.getPhysicalName(*group) or str(group[1]))
    for group, name in group_names.items():
        same_tags = []
        for (other_dim, tag), other_name in group_names.items():
            if other_dim == group[0] and other_name == name:
                same_tags.append(tag)
        if len(same_tags) > 1:
            raise InputError(
                f"The name {name!r} is that of the tags {same_tags[0]} and {same_tags[1]}; take "
                "another one."
            )
        model.removePhysicalName(name)
    for group, name in group_names.items():
        model.setPhysicalName(*group, name)


def _group_of(key: int | tuple[int, int], groups: list[tuple[int, int]]) -> tuple[int, int]:
    """Find the physical group (dimension, tag) that a key of names means.

    Raises:
        InputError: If no group or two groups have this tag.
    """
    matching = [group for group in groups if key in (group, group[1])]
    if not matching:
        tags = ", ".join(str(tag) for _, tag in groups)
        raise InputError(
            f"names has {key!r}, and no part of the mesh has this tag; the mesh has {tags}."
        )
    if len(matching) > 1:
        both = " and ".join(map(str, matching))
        raise InputError(
            f"names has {key!r}, which is a boundary part and a region; give one of {both}."
        )
    return matching[0]


def renumber(model: Any, dim: int) -> None:
    """Number the nodes of a model's mesh from 1, with those that are in no cell last.

    The centre of an arc may have a node that is in no cell. DOLFINx expects that all
    other nodes have lower numbers. Otherwise it sends to a rank that does not exist,
    and the process ends.
    """
    nodes = model.mesh.getNodes()[0]
    in_cell = np.isin(nodes, np.concatenate(model.mesh.getElements(dim)[2]))
    nodes = np.concatenate([np.sort(nodes[in_cell]), np.sort(nodes[~in_cell])])
    if np.any(np.diff(nodes.astype(np.int64)) != 1) or nodes[0] != 1:
        model.mesh.renumberNodes(nodes, np.arange(1, len(nodes) + 1))


def marked_facets(
    model: Any, comm: MPI.Comm, rank: int, mesh: dmesh.Mesh, tags: Mapping[int, int] | None
) -> dmesh.MeshTags:
    """Mark the facets on curves (2D) or surfaces (3D) of a meshed model; collective.

    Args:
        model: gmsh's current model on ``rank``.
        comm: Communicator.
        rank: Rank that holds the model.
        mesh: The mesh of DOLFINx that was made from it.
        tags: gmsh's tag of each mark on ``rank``; None where the marks are the tags.
    """
    d = mesh.topology.dim
    nodes = np.empty((0, d), dtype=np.int64)
    values = np.empty(0, dtype=np.int32)
    if comm.rank == rank:
        if not tags:
            tags = {int(tag): int(tag) for _, tag in model.getEntities(d - 1)}
        mark_nodes = []
        mark_values = []
        for mark, tag in tags.items():
            entity_nodes = np.concatenate([[], *model.mesh.getElements(d - 1, tag)[2]])
            mark_nodes.append(entity_nodes)
            mark_values.append(np.full(len(entity_nodes) // d, mark, dtype=np.int32))
        # gmsh numbers the nodes from 1, see renumber.
        nodes = np.concatenate(mark_nodes).astype(np.int64).reshape(-1, d) - 1
        values = np.concatenate(mark_values)
    mesh.topology.create_connectivity(d - 1, 0)
    mesh.topology.create_connectivity(d - 1, d)
    local_nodes, local_values = distribute_entity_data(mesh, d - 1, nodes, values)
    facets = graph.adjacencylist(local_nodes)
    return dmesh.meshtags_from_entities(mesh, d - 1, facets, local_values)


def prepare(model: Any, *, has_rules: bool) -> tuple[int, dict[str, int], dict[str, int]]:
    """Mesh a model if needed, check it, and number its nodes as DOLFINx expects.

    Args:
        model: gmsh's model.
        has_rules: Whether rules name parts, which then need no physical group.

    Returns:
        Its dimension, and the tags of boundary parts and of regions by name.

    Raises:
        InputError: If the mesh or its physical groups cannot be used.
    """
    dim = int(model.getDimension())
    if dim < 2:
        raise InputError(
            f"The gmsh model has dimension {max(dim, 0)}; give a surface in the plane or a volume."
        )
    if not len(model.mesh.getElements(dim)[0]):
        model.mesh.generate(dim)
    _check_cells(model, dim)
    groups = {d: model.getPhysicalGroups(d) for d in (dim - 1, dim)}
    if not groups[dim - 1] and not has_rules:
        kind = "Curve" if dim == 2 else "Surface"
        raise InputError(
            "The mesh has no groups of facets: name the parts of the boundary by physical groups "
            f'of dimension {dim - 1} in gmsh, e.g. Physical {kind}("bottom") = {{1}}; or by '
            'rules: parts={"bottom": ec.where(y=0.0)}.'
        )
    if not groups[dim]:
        model.addPhysicalGroup(dim, [tag for _, tag in model.getEntities(dim)], name="body")
        groups[dim] = model.getPhysicalGroups(dim)
    _members(model, groups[dim - 1], "boundary part")
    in_regions = _members(model, groups[dim], "region")
    ungrouped = [tag for _, tag in model.getEntities(dim) if tag not in in_regions]
    if ungrouped:
        raise InputError(
            f"Entity {ungrouped[0]} of dimension {dim} is in no physical group, others are; put "
            "all in one, or none."
        )
    renumber(model, dim)
    return dim, _names(model, groups[dim - 1]), _names(model, groups[dim])


def _check_cells(model: Any, dim: int) -> None:
    """Check that the cells are straight-sided simplices, in 2D in a plane z = constant.

    Raises:
        InputError: If they are not.
    """
    kinds, _, cell_nodes = model.mesh.getElements(dim)
    names = {model.mesh.getElementProperties(kind)[0] for kind in kinds}
    wrong = [name for name in sorted(names) if name not in ("Triangle 3", "Tetrahedron 4")]
    if wrong:
        raise InputError(
            f"The mesh has cells of type {', '.join(wrong)}; allowed are straight-sided triangles "
            "and tetrahedra. In gmsh: no recombination, Mesh.ElementOrder = 1."
        )
    nodes, x, _ = model.mesh.getNodes()
    # Only nodes of cells count: the centre of an arc may lie anywhere.
    in_cell = np.isin(nodes, np.concatenate(cell_nodes))
    x = x.reshape(-1, 3)[in_cell]
    if dim == 2 and np.ptp(x[:, 2]) > 1e-9 * np.ptp(x, axis=0).max():
        raise InputError(
            "The mesh is a surface in space; allowed are a surface in the plane (x, y) or a volume."
        )


def _members(model: Any, groups: Sequence[tuple[int, int]], kind: str) -> set[int]:
    """Return the entities in physical groups of one dimension.

    Raises:
        InputError: If an entity is in two groups.
    """
    memberships: Counter[int] = Counter()
    for dim, tag in groups:
        memberships.update(int(entity) for entity in model.getEntitiesForPhysicalGroup(dim, tag))
    for entity, times in memberships.items():
        if times > 1:
            raise InputError(
                f"Entity {entity} of dimension {groups[0][0]} is in two physical groups; each "
                f"can be in one {kind} only."
            )
    return set(memberships)


def _names(model: Any, groups: Sequence[tuple[int, int]]) -> dict[str, int]:
    """Return tags of physical groups by name; a group without is called by its tag."""
    return {model.getPhysicalName(dim, tag) or str(tag): int(tag) for dim, tag in groups}
