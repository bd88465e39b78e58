"""Sessions of gmsh on rank 0, and nodes and facets of a meshed model as DOLFINx needs them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from dolfinx import graph
from dolfinx import mesh as dmesh
from dolfinx.io.utils import distribute_entity_data
from mpi4py import MPI

from erc_contact.base.checks import description
from erc_contact.base.exceptions import InputError, raise_together

SESSION = {"General.Terminal": 0, "Mesh.ElementOrder": 1, "Mesh.RecombineAll": 0}
"""gmsh's options during a session of ours; a user's own session gets its options back."""
FIELD = {
    "Mesh.MeshSizeMin": 0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.Algorithm": 6,
    "Mesh.Algorithm3D": 1,
}
"""gmsh's options where a size field alone gives the sizes: Frontal-Delaunay in 2D, Delaunay in 3D."""


def as_input_error(reason: Exception, what: str) -> InputError:
    """An error of gmsh's, or of ours, as an :class:`InputError`."""
    return (
        reason if isinstance(reason, InputError) else InputError(f"{what} cannot be used: {reason}")
    )


@contextmanager
def session(comm: MPI.Comm, build: Callable[[Any], None], what: str) -> Iterator[Any]:
    """A silent gmsh session on rank 0 with a new model; collective. Afterwards a user's session is as it was.

    Args:
        comm: Communicator.
        build: Function that makes the model, called with the module gmsh on rank 0.
        what: Subject of the message if it raises.

    Yields:
        ``gmsh.model`` on rank 0, None on other ranks.

    Raises:
        InputError: On all ranks, if gmsh cannot be loaded or ``build`` raises.
    """
    error: Exception | None = None
    if comm.rank != 0:
        raise_together(comm, None)
        yield None
        return
    try:
        import gmsh  # noqa: PLC0415 - only rank 0 needs it
    except (ImportError, OSError) as reason:  # OSError: a shared library that gmsh's wheel expects
        raise_together(
            comm,
            InputError(f"gmsh cannot be loaded: {reason}. Install it, or give cells= or a Domain."),
        )

    started_here = not gmsh.isInitialized()
    if started_here:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    before = None if started_here else gmsh.model.getCurrent()
    options = {name: gmsh.option.getNumber(name) for name in (*SESSION, *FIELD)}
    for name, value in SESSION.items():
        gmsh.option.setNumber(name, value)
    gmsh.model.add("erc_contact")
    try:
        build(gmsh)
    except Exception as reason:  # every rank must learn of it
        error = as_input_error(reason, what)
    try:
        raise_together(comm, error)
        yield gmsh.model
    finally:
        if started_here:
            gmsh.finalize()
        else:
            gmsh.model.remove()
            gmsh.model.setCurrent(before)
            for name, value in options.items():
                gmsh.option.setNumber(name, value)


def name_groups(model: Any, names: Mapping[int | tuple[int, int], str]) -> None:
    """Give names to the physical groups of a model.

    Args:
        model: gmsh's model.
        names: Names by the tags of the groups, or by pairs (dimension, tag).

    Raises:
        InputError: If the names are no mapping to texts, no group or two groups have a
            tag, or two groups of the same dimension get the same name.
    """
    if not isinstance(names, Mapping) or not all(
        isinstance(name, str) and name for name in names.values()
    ):
        example = "names={1: 'bottom', 2: 'top'}"
        raise InputError(
            f"names is {description(names)}; give names of parts by their tags, e.g. {example}."
        )
    dim = int(model.getDimension())
    groups = [group for group in model.getPhysicalGroups() if group[0] >= dim - 1]
    named: dict[tuple[int, int], str] = {}
    for key, name in names.items():
        meant = [group for group in groups if key in (group, group[1])]
        if not meant:
            tags = ", ".join(str(tag) for _, tag in groups)
            raise InputError(
                f"names has {key!r}, and no part of the mesh has this tag; the mesh has {tags}."
            )
        if len(meant) > 1:
            both = " and ".join(map(str, meant))
            raise InputError(
                f"names has {key!r}, which is a boundary part and a region; give one of {both}."
            )
        named[meant[0]] = name
    for group in groups:
        named.setdefault(group, model.getPhysicalName(*group) or str(group[1]))
    for group, name in named.items():
        same = [other for other in named if other[0] == group[0] and named[other] == name]
        if len(same) > 1:
            raise InputError(
                f"The name {name!r} is that of the tags {same[0][1]} and {same[1][1]}; take another one."
            )
        model.removePhysicalName(name)
    for group, name in named.items():
        model.setPhysicalName(*group, name)


def renumber(model: Any, dim: int) -> None:
    """Number the nodes of a model's mesh from 1, with those that are in no cell last.

    The centre of an arc may have a node that is in no cell. DOLFINx expects that all
    other nodes have lower numbers. Otherwise it sends to a rank that does not exist,
    and the process ends.
    """
    every = model.mesh.getNodes()[0]
    used = np.isin(every, np.concatenate(model.mesh.getElements(dim)[2]))
    every = np.concatenate([np.sort(every[used]), np.sort(every[~used])])
    if np.any(np.diff(every.astype(np.int64)) != 1) or every[0] != 1:
        model.mesh.renumberNodes(every, np.arange(1, len(every) + 1))


def marked_facets(
    model: Any, comm: MPI.Comm, rank: int, mesh: dmesh.Mesh, tags: Mapping[int, int] | None
) -> dmesh.MeshTags:
    """Marks of the facets that lie on curves (2D) or surfaces (3D) of a meshed model; collective.

    Args:
        model: gmsh's current model on ``rank``.
        comm: Communicator.
        rank: Rank that holds the model.
        mesh: The mesh of DOLFINx that was made from it.
        tags: gmsh's tag of each mark on ``rank``; None where the marks are the tags.
    """
    d = mesh.topology.dim
    nodes, values = np.empty((0, d), dtype=np.int64), np.empty(0, dtype=np.int32)
    if comm.rank == rank:
        tags = tags or {int(tag): int(tag) for _, tag in model.getEntities(d - 1)}
        found = {
            m: np.concatenate([[], *model.mesh.getElements(d - 1, tag)[2]])
            for m, tag in tags.items()
        }
        nodes = np.concatenate(list(found.values())).astype(np.int64).reshape(-1, d) - 1
        values = np.repeat(list(found), [len(of) // d for of in found.values()]).astype(np.int32)
    mesh.topology.create_connectivity(d - 1, 0)
    mesh.topology.create_connectivity(d - 1, d)
    found_nodes, found_values = distribute_entity_data(mesh, d - 1, nodes, values)
    return dmesh.meshtags_from_entities(mesh, d - 1, graph.adjacencylist(found_nodes), found_values)
