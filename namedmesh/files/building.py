"""Make simplices with parts and regions of the mesh of a file, and a domain of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from namedmesh.base.exceptions import InputError, on_rank, words_of
from namedmesh.base.logs import log_of
from namedmesh.base.percent import place_words
from namedmesh.files.cleaning import Body, body_of
from namedmesh.files.curved import note_of_curves, note_of_warped
from namedmesh.files.faces import Faces, distinct, faces_of
from namedmesh.files.file_mesh import BODY, FacetSet, FileMesh, pad
from namedmesh.files.renaming import with_printable_names
from namedmesh.files.sets import Named, disjoint, list_names
from namedmesh.files.simplices import Simplices, split
from namedmesh.plain import PlainMesh
from namedmesh.rows import look_up
from namedmesh.simplex import facet_vertices, measures
from namedmesh.tags import NO_TAG
from namedmesh.transfer import spread

BOUNDARY = "boundary"
"""Name of the part of a file without sets of facets: all of the outer facets."""
SAME_PLACE = 1e-9
"""Distance of two points that is none, as a share of the extent [-]."""
OFFSET = 0.2718
"""Place of the lattice of boxes that finds such points, in boxes [-]."""
UNNAMED = "unnamed"
"""Name of the region of cells in no set, where other cells are in sets."""


@dataclass(frozen=True, eq=False)
class Built:
    """Hold a mesh of simplices made of a file.

    Attributes:
        plain: The mesh, with tags of regions and sides, and marks of sides if any.
        names: Name of each part -> its tag.
        regions: Name of each region -> its tag.
        nodes: The point of the file at each point of the mesh, -1 where it is new.
        notes: What was left out or changed, in words.
    """

    plain: PlainMesh
    names: dict[str, int]
    regions: dict[str, int]
    nodes: np.ndarray
    notes: tuple[str, ...]


def build_simplices(
    mesh: FileMesh, marks: Sequence[FacetSet] = (), *, numbered: bool = True
) -> Built:
    """Make simplices with parts and regions of the mesh of a file.

    Args:
        mesh: The mesh.
        marks: Sets of facets with marks as their tags, which name nothing.
        numbered: Whether a mesh without parts gets one, :data:`BOUNDARY`.

    Raises:
        InputError: If it has no body, or its cells cannot be worked with.
    """
    mesh, renamed = with_printable_names(mesh)
    body = body_of(mesh)
    faces = faces_of(body.cells, body.x)
    simplices = split(body, faces)
    notes = [*renamed, *body.notes, *note_of_curves(mesh, body)]
    volume = float(measures(simplices.x[simplices.cells]).sum())
    notes += note_of_warped(body, faces, volume)

    cell_sets = []
    for element_set in mesh.element_sets:
        members = _cells_in(body, mesh, element_set.members)
        cell_sets.append(Named(element_set.name, element_set.tag, members, element_set.weak))
    cell_tags, regions, said = disjoint(cell_sets, body.count, "region")
    notes += said
    of_simplices = cell_tags[simplices.parents]
    regions = _with_all_cells(of_simplices, regions)

    found, said = _parts(mesh, body, faces)
    notes += said
    if numbered and not found:
        found = [Named(BOUNDARY, None, np.unique(faces.number[faces.outer]))]
    face_tags, names, said = disjoint(found, len(faces.count), "part")
    notes += said
    tags = _side_tags(simplices, faces, face_tags)
    side_marks = None
    if marks:
        face_marks = np.full(len(faces.count), NO_TAG)
        for marked in marks:
            face_marks[faces_at(body, faces, marked.corners)] = marked.tag
        side_marks = _side_tags(simplices, faces, face_marks)

    used, cells = np.unique(simplices.cells, return_inverse=True)
    nodes = np.where(used < len(body.x), used, -1)
    plain = PlainMesh(simplices.x[used], cells, of_simplices, tags, marks=side_marks)
    notes += _note_unconnected(plain, regions)
    return Built(plain, names, regions, nodes, tuple(notes))


def _note_unconnected(plain: PlainMesh, regions: Mapping[str, int]) -> list[str]:
    """Tell of points of a region that lie at one place and are not connected."""
    extent = np.ptp(plain.x, axis=0).max()
    boxes = np.floor(plain.x / (SAME_PLACE * extent) + OFFSET)
    _, place, count = np.unique(boxes, axis=0, return_inverse=True, return_counts=True)
    place = place.ravel()
    twins = np.flatnonzero(count[place] > 1)
    if not len(twins):
        return []
    notes = []
    for name, tag in regions.items():
        of_region = np.zeros(len(plain.x), dtype=bool)
        of_region[plain.cells[plain.regions == tag]] = True
        here = twins[of_region[twins]]
        _, first, here_count = np.unique(place[here], return_index=True, return_counts=True)
        if (here_count > 1).any():
            at = plain.x[here[first[here_count > 1][0]]]
            notes.append(
                f"region {name!r} has {int((here_count > 1).sum())} places with several points, as "
                f"{place_words(at, 6)}: its pieces are not connected there; merge the points if it "
                "is one body, or give the pieces regions of their own"
            )
    return notes


def _cells_in(body: Body, mesh: FileMesh, members: Mapping[int, np.ndarray]) -> np.ndarray:
    """Return the numbers of the cells of the body that are members of a set."""
    sizes = [len(mesh.blocks[number].nodes) for number in body.blocks]
    begins = np.cumsum([0, *sizes])
    cells = [np.empty(0, dtype=np.int64)]
    for number, begin in zip(body.blocks, begins, strict=False):
        if number in members:
            cells.append(begin + members[number])
    kept = np.concatenate(body.numbers)
    return np.intersect1d(np.concatenate(cells), kept)


def _with_all_cells(tags: np.ndarray, regions: dict[str, int]) -> dict[str, int]:
    """Give cells in no set a region, in place; return all regions by name."""
    without = tags == NO_TAG
    if not without.any():
        return {name: tag for name, tag in regions.items() if (tags == tag).any()}
    tag = max(regions.values(), default=0) + 1
    tags[without] = tag
    name = UNNAMED if regions else BODY
    while name in regions:
        name += " "
    return {**regions, name: tag}


def _parts(mesh: FileMesh, body: Body, faces: Faces) -> tuple[list[Named], list[str]]:
    """Return the faces of each set of facets or nodes, and what was left out."""
    found = []
    lost = 0
    for facet_set in [*_sides_of_elements(mesh), *mesh.facet_sets]:
        members = faces_at(body, faces, facet_set.corners)
        lost += int((members < 0).sum())
        members = np.unique(members[members >= 0])
        if facet_set.outer:
            members = members[faces.count[members] == 1]
        found.append(Named(facet_set.name, facet_set.tag, members, facet_set.weak))
    for node_set in mesh.node_sets:
        members = faces_within(body, faces, node_set.nodes)
        found.append(Named(node_set.name, node_set.tag, members, node_set.weak))
    notes = []
    if lost:
        notes.append(f"{lost} facets of no cell")
    empty = [repr(named.name) for named in found if not len(named.members)]
    if empty:
        shown = ", ".join(empty[:6]) + (", ..." if len(empty) > 6 else "")
        notes.append(f"{len(empty)} sets without a facet of the body: {shown}")
    found = [named for named in found if len(named.members)]
    kept = _without_all(found, np.unique(faces.number[faces.outer]))
    whole = [named.name for named in found if named not in kept]
    if whole:
        notes.append(f"sets of the whole boundary are no parts: {list_names(whole)}")
    return kept, notes


def _without_all(sets: list[Named], outer: np.ndarray) -> list[Named]:
    """Leave out sets that have all outer faces, if other sets have some of them."""
    shared = [len(np.intersect1d(outer, named.members)) for named in sets]
    if any(0 < count < len(outer) for count in shared):
        return [named for named, count in zip(sets, shared, strict=True) if count < len(outer)]
    # The first of several sets that have all of them is as good as any.
    first = shared.index(len(outer)) if len(outer) in shared else -1
    return [
        named
        for number, (named, count) in enumerate(zip(sets, shared, strict=True))
        if count < len(outer) or number == first
    ]


def _sides_of_elements(mesh: FileMesh) -> list[FacetSet]:
    """Return sets of elements that are sides of cells, by their corners."""
    result = []
    for element_set in mesh.element_sets:
        tables = []
        for number, members in element_set.members.items():
            block = mesh.blocks[number]
            if block.dim == mesh.dim - 1:
                tables.append(pad(block.corners[members]))
        if tables:
            corners = np.concatenate(tables)
            weak = element_set.weak
            result.append(FacetSet(element_set.name, corners, element_set.tag, weak=weak))
    return result


def faces_at(body: Body, faces: Faces, corners: np.ndarray) -> np.ndarray:
    """Return the numbers of faces with given corners, shape (n,); -1 for none."""
    known = (corners >= 0).all(axis=1) & (corners < len(body.same)).all(axis=1)
    wanted = body.same[np.where(known[:, None], corners, 0)]
    near = np.zeros(len(body.same), dtype=bool)
    near[wanted] = True
    candidates = np.flatnonzero(near[faces.corners].all(axis=1) & (faces.number >= 0))
    there = distinct(faces.corners[candidates])
    return np.where(known, look_up(there, faces.number[candidates], distinct(wanted)), -1)


def faces_within(body: Body, faces: Faces, nodes: np.ndarray) -> np.ndarray:
    """Return the outer faces all of whose corners are in a set of nodes.

    If there is none, the set may be an interface inside: then all faces count.
    """
    chosen = np.zeros(len(body.same), dtype=bool)
    chosen[body.same[nodes[(nodes >= 0) & (nodes < len(chosen))]]] = True
    within = chosen[faces.corners].all(axis=1)
    outer = within & faces.outer
    return np.unique(faces.number[outer if outer.any() else within & (faces.number >= 0)])


def _side_tags(simplices: Simplices, faces: Faces, tag_of_face: np.ndarray) -> np.ndarray:
    """Give the sides of simplices the tags of the faces of cells on which they lie.

    Returns:
        Tags, shape (m, d+1).
    """
    d = simplices.x.shape[1]
    tags = np.full(simplices.cells.shape, NO_TAG)
    tagged = np.flatnonzero((faces.number >= 0) & (tag_of_face[faces.number] != NO_TAG))
    _, first = np.unique(faces.number[tagged], return_index=True)
    one_of_each = tagged[first]
    values = tag_of_face[faces.number[one_of_each]]
    facets = faces.corners[one_of_each]
    if d == 3:
        triangles = faces.triangles(one_of_each)
        whole = (np.diff(np.sort(triangles, axis=2), axis=2) > 0).all(axis=2)
        values = np.repeat(values[:, None], 2, axis=1)[whole]
        facets = triangles[whole]
    near = np.zeros(len(simplices.x), dtype=bool)
    near[facets] = True
    sides = simplices.cells[:, facet_vertices(d)]
    cell, side = np.nonzero(near[sides].all(axis=2))
    tags[cell, side] = look_up(facets, values, sides[cell, side], NO_TAG)
    return tags


def spread_from(
    comm: MPI.Comm, rank: int, make: Callable[[], Built], subject: str
) -> dict[str, Any]:
    """Make a mesh on a rank and spread it over all; collective.

    What was left out is told once.

    Args:
        comm: Communicator.
        rank: The rank that makes the mesh.
        make: Function that makes it, called there.
        subject: Subject of messages.

    Returns:
        The arguments of a domain: "names", "regions", and what comes from
        :func:`namedmesh.transfer.spread`.

    Raises:
        InputError: On all ranks, what ``make`` raises.
    """

    def make_there() -> Built:
        try:
            return make()
        except InputError as reason:
            words = str(reason)
            raise InputError(words if subject in words else f"{subject}: {words}") from reason
        except Exception as reason:  # libraries raise errors of any class
            raise InputError(f"{subject} cannot be used: {words_of(reason)}.") from reason

    made = on_rank(comm, rank, make_there)
    head = None
    if made is not None:
        head = (made.plain.dim, made.names, made.regions, made.notes)
    dim, names, regions, notes = comm.bcast(head, root=rank)
    if notes:
        log_of(comm).warning("%s: left out or changed: %s.", subject, "; ".join(notes))
    empty = np.empty((0, dim + 1), dtype=np.int64)
    plain = PlainMesh(np.empty((0, dim)), empty, empty[:, 0], empty)
    if made is not None:
        plain = made.plain
    return {"names": names, "regions": regions, **spread(comm, plain, rank)}
