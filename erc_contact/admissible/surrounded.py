"""Surround the cells of a rank by the cells of the next copies of the body.

Facets on the sides of copies are facets inside the body of all copies: beyond them are
cells at the other side, seen through the motion ``x -> R x + t`` between copies. The
traction is the image of the traction on the other side,

    t(R x + t) = -R t(x),

and a patch around a node on a side goes on in the next copies: in two of them, in the
four or eight that meet at a corner, and in all sectors around a node on their axis.

So a rank has images of cells as it has ghosts: all of them around the nodes of its own
cells. It has the cells themselves, because a node counts as its images when cells are
distributed (:mod:`namedmesh.periodic`). Patches are made of cells and images alike. Of
patches that are images of each other one is solved, and what it gives to images of
facets is added to the facets.

Symbols: n images, m moments of a facet, d dimension; a motion h has a number, the
identity 0. A relation is a row (v, w, h) of nodes v and w with ``x_v = h(x_w)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from erc_contact.admissible.cells import CellGeometry, shapes_of_cells
from erc_contact.admissible.images import CellImages, Centres, FacetImages, Images
from erc_contact.model.contact.periodic import pair_of
from erc_contact.model.contact.trace import Trace
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.for_solvers import components, count_up, row_numbers
from namedmesh.simplex import (
    facet_vertices,
    local_facet_nodes,
    node_between,
    node_vertices,
    of_facets,
)

SAME_MOTION = 1e-6
"""Difference of two motions that counts as none, over the extent of the body [-]."""


class _Pair(NamedTuple):
    """Hold a pair of sides: its contact, R and t [length]."""

    trace: Trace
    turn: np.ndarray
    shift: np.ndarray


class _Motions:
    """Number motions ``x -> R x + t``; few of them are different.

    Args:
        d: The dimension.
        extent: Size of the body [length].
    """

    def __init__(self, d: int, extent: float) -> None:
        self.turns = [np.eye(d)]
        self._shifts = [np.zeros(d)]
        self._extent = extent

    def number(self, turn: np.ndarray, shift: np.ndarray) -> int:
        """Return the number of a motion, which may be a new motion."""
        for number, (known, known_shift) in enumerate(zip(self.turns, self._shifts, strict=True)):
            away = max(abs(known - turn).max(), abs(known_shift - shift).max() / self._extent)
            if away < SAME_MOTION:
                return number
        self.turns.append(turn)
        self._shifts.append(shift)
        return len(self.turns) - 1

    def after(self, second: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Return the numbers of ``second(first(x))``, shape (n,)."""
        pairs, place = np.unique(np.column_stack([second, first]), axis=0, return_inverse=True)
        numbers = []
        for outer, inner in pairs:
            turn = self.turns[outer] @ self.turns[inner]
            shift = self.turns[outer] @ self._shifts[inner] + self._shifts[outer]
            numbers.append(self.number(turn, shift))
        return np.array(numbers, dtype=np.int64)[place.ravel()]

    def image(self, motion: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return where motions (n,) take points [length], shape (n, ..., d)."""
        turned = np.matmul(x, np.array(self.turns)[motion].swapaxes(1, 2))
        moved: np.ndarray = turned + np.array(self._shifts)[motion][:, None]
        return moved


def surrounded(model: Model, cells: CellGeometry) -> CellGeometry:
    """Return the cells with images of cells around them, where the body has copies.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
    """
    pairs = []
    for declared, contact in zip(model.scene.contacts, model.contacts, strict=True):
        pair = pair_of(model.space, declared)
        if pair is not None:
            pairs.append(_Pair(contact.trace, np.array(pair.rotation), np.array(pair.shift)))
    if not pairs:
        return cells
    motions = _Motions(cells.d, model.domain.extent)
    relations = _relations(pairs, motions)
    of_owned = np.unique(cells.vertices[: model.domain.owned_cells])
    source, motion = _images_at(cells, relations[np.isin(relations[:, 0], of_owned)])
    count = len(model.fixed)
    nodes = _nodes_of_images(cells.nodes[source], motion, relations, motions, count)
    # Nodes of images are sorted by their own numbers.
    order = np.argsort(nodes[:, : cells.d + 1], axis=1)
    ends = order[:, node_vertices(cells.d, cells.degree)]
    reordered = node_between(cells.d, cells.degree)[ends[..., 0], ends[..., 1]]
    corners = motions.image(motion, cells.corners[source])
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    images = CellImages(source, np.array(motions.turns)[motion], reordered)
    nodes = np.take_along_axis(nodes, reordered, axis=1).astype(cells.nodes.dtype)
    facets = _facets_of_images(cells, nodes[:, : cells.d + 1])
    side = _sides_with_images(cells, facets)
    more_nodes = max(int(nodes.max(initial=-1)) + 1 - count, 0)
    centres = _centres(model.space, cells, pairs, relations, count + more_nodes)
    counts = (len(cells.nodes), cells.side.shape[1])
    of_facets = _images_of_facets(cells, images, side[0, counts[1] :])
    facing = _facing(model.space, cells, pairs)
    shapes = zip((cells.J, cells.volume, cells.area), shapes_of_cells(corners), strict=True)
    J, volume, area = (np.concatenate(parts) for parts in shapes)
    return CellGeometry(
        degree=cells.degree,
        places=np.concatenate([cells.places, images.at_nodes(cells.places)]),
        nodes=np.concatenate([cells.nodes, nodes]),
        facets=np.concatenate([cells.facets, facets]),
        side=side,
        corners=np.concatenate([cells.corners, corners]),
        J=J,
        volume=volume,
        area=area,
        images=Images(counts, more_nodes, images, of_facets, *facing, centres),
    )


def _relations(pairs: Sequence[_Pair], motions: _Motions) -> np.ndarray:
    """Return all relations of the nodes of sides, shape (r, 3).

    Args:
        pairs: The pairs of sides.
        motions: Gets the motions.
    """
    single = []
    for trace, turn, shift in pairs:
        here, there = trace.here.nodes.ravel(), trace.partners.ravel()
        forth = np.full(len(here), motions.number(turn, shift))
        back = np.full(len(here), motions.number(turn.T, -turn.T @ shift))
        single += [np.column_stack([there, here, forth]), np.column_stack([here, there, back])]
    first = np.unique(np.concatenate(single), axis=0)
    every = newest = first
    while len(newest):
        row, after = _joined(newest[:, 1], first[:, 0])
        motion = motions.after(newest[row, 2], first[after, 2])
        further = np.unique(np.column_stack([newest[row, 0], first[after, 1], motion]), axis=0)
        is_itself = (further[:, 0] == further[:, 1]) & (further[:, 2] == 0)
        further = further[~is_itself]
        rows, times = np.unique(np.concatenate([every, every, further]), axis=0, return_counts=True)
        newest = rows[times == 1]
        every = np.concatenate([every, newest])
    return every


def _images_at(cells: CellGeometry, relations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the cells that have images at nodes, and the motions, shape (n,) each.

    Args:
        cells: Geometry.
        relations: All relations (v, w, h) of these nodes v, shape (r, 3).
    """
    vertices = cells.vertices.ravel()
    places = np.flatnonzero(np.isin(vertices, relations[:, 1]))
    row, place = _joined(relations[:, 1], vertices[places])
    pairs = np.column_stack([places[place] // (cells.d + 1), relations[row, 2]])
    source, motion = np.unique(pairs, axis=0).T
    return source, motion


def _nodes_of_images(
    nodes: np.ndarray, motion: np.ndarray, relations: np.ndarray, motions: _Motions, count: int
) -> np.ndarray:
    """Number the nodes of images: as nodes of the body where they are in one place.

    Args:
        nodes: The nodes of their cells, shape (n, N).
        motion: Their motions, shape (n,).
        relations: All relations, shape (r, 3).
        motions: The motions.
        count: Number of the nodes of the body on this rank.
    """
    pairs = np.column_stack([np.repeat(motion, nodes.shape[1]), nodes.ravel()])
    pairs, place = np.unique(pairs, axis=0, return_inverse=True)
    # The image of w by h is the image of v by h k, where w is the image of v by k.
    row, relation = _joined(pairs[:, 1], relations[:, 0])
    same = motions.after(pairs[row, 0], relations[relation, 2])
    row = np.append(np.arange(len(pairs)), row)
    name = np.concatenate([pairs, np.column_stack([same, relations[relation, 1]])])
    # The least name comes first: the identity, if there is a node of the body.
    order = np.lexsort([name[:, 1], name[:, 0], row])
    _, first = np.unique(row[order], return_index=True)
    least = name[order[first]]
    of_images, number = np.unique(least, axis=0, return_inverse=True)
    is_own = of_images[:, 0] == 0
    numbers = np.where(is_own, of_images[:, 1], count + np.cumsum(~is_own) - 1)
    return numbers[number.ravel()][place.ravel()].reshape(nodes.shape)


def _joined(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of all equal numbers of two arrays, shape (n,) each."""
    order = np.argsort(second, kind="stable")
    ordered = second[order]
    begin = np.searchsorted(ordered, first, side="left")
    counts = np.searchsorted(ordered, first, side="right") - begin
    row = np.repeat(np.arange(len(first)), counts)
    return row, order[begin[row] + count_up(counts)]


def _facets_of_images(cells: CellGeometry, vertices: np.ndarray) -> np.ndarray:
    """Number the facets of images: as facets of the body, and then new ones.

    Args:
        cells: Geometry of the body.
        vertices: Sorted vertices of the images, shape (n, d+1).

    Returns:
        The facet opposite to each vertex, shape (n, d+1).
    """
    d = cells.d
    of_body = cells.vertices_of_facets
    at_images = np.isin(of_body, vertices).all(axis=1) & (cells.side[0] >= 0)
    known = np.flatnonzero(at_images)
    opposite = np.tile(np.arange(d + 1), len(vertices))
    rows = of_facets(np.repeat(vertices, d + 1, axis=0), opposite)
    of_known, wanted = row_numbers(of_body[known], rows)
    table = np.full(max(of_known.max(initial=-1), wanted.max(initial=-1)) + 1, -1)
    table[of_known] = known
    is_new = table < 0
    table[is_new] = cells.side.shape[1] + np.arange(is_new.sum())
    return table[wanted].reshape(-1, d + 1).astype(cells.facets.dtype)


def _sides_with_images(cells: CellGeometry, facets: np.ndarray) -> np.ndarray:
    """Return both places of each facet, see :attr:`.CellGeometry.side`.

    Args:
        cells: Geometry of the body.
        facets: The facets of the images, shape (i, d+1).
    """
    count = cells.side.shape[1]
    flat = facets.ravel()
    places = cells.facets.size + np.arange(flat.size)
    side = np.full((2, max(count, int(flat.max(initial=-1)) + 1)), -1)
    side[:, :count] = cells.side
    # Of two places that write the same entry, the last one stays.
    is_new = flat >= count
    side[0, flat[is_new][::-1]] = places[is_new][::-1]
    side[1, flat] = places
    return side


def _images_of_facets(cells: CellGeometry, images: CellImages, place: np.ndarray) -> FacetImages:
    """Return of which facets of the body the facets of images alone are images.

    Args:
        cells: Geometry of the body.
        images: The cells that are images.
        place: The first place of each such facet.
    """
    d = cells.d
    of_facet = local_facet_nodes(d, cells.degree)
    image, i = np.divmod(place - cells.facets.size, d + 1)
    cell, i_there = images.source[image], images.order[image, i]
    source = cells.facets[cell, i_there]
    is_first = cells.side[0, source] == cell * (d + 1) + i_there
    sign = np.where(is_first, 1.0, -1.0)[:, None, None]
    nodes_there = images.order[image[:, None], of_facet[i]]
    order = _places_among(nodes_there, of_facet[i_there])
    return FacetImages(source, order, sign * images.turn[image])


def _facing(
    space: Space, cells: CellGeometry, pairs: Sequence[_Pair]
) -> tuple[FacetImages, FacetImages]:
    """Return first sides as images of second sides, and second sides of first sides.

    Args:
        space: The mesh.
        cells: Geometry of the body.
        pairs: The pairs of sides.
    """
    parts = []
    for trace, turn, _ in pairs:
        here, there = (space.facet_numbers(side.facets) for side in (trace.here, trace.there))
        of_here, of_there = (_nodes_of(cells, facets) for facets in (here, there))
        sorting = _places_among(of_here, trace.here.nodes)[..., 0]
        facing = np.take_along_axis(trace.partners, sorting, axis=1)
        forth = _places_among(of_there, facing)
        back = _places_among(facing, of_there)
        # Both are first sides of boundary facets: tractions are opposite.
        turns = np.broadcast_to(-turn, (len(here), *turn.shape))
        parts.append((here, there, forth, back, turns))
    here, there, forth, back, turns = (np.concatenate(part) for part in zip(*parts, strict=True))
    return FacetImages(there, back, turns.swapaxes(1, 2)), FacetImages(here, forth, turns)


def _centres(
    space: Space,
    cells: CellGeometry,
    pairs: Sequence[_Pair],
    relations: np.ndarray,
    count: int,
) -> Centres:
    """Choose the centres of patches that stand for their images, alike on all ranks.

    Of all images it is the centre with the least global numbers. They face each other
    on facets of the sides: a rank has all facets around its own nodes and their images.

    Args:
        space: The mesh.
        cells: Geometry of the body.
        pairs: The pairs of sides.
        relations: All relations, shape (r, 3).
        count: Number of the nodes, with nodes of images alone.
    """
    d = cells.d
    of_facet = facet_vertices(d - 1)
    of_sides = []
    for trace, *_ in pairs:
        for nodes in (trace.here.nodes[trace.facing], trace.partners):
            of_sides.append(nodes[:, of_facet].reshape(-1, d - 1))
    here, there = (np.concatenate(of_sides[side::2]) for side in range(2))
    turns_about = np.ones(count, dtype=np.int64)
    np.add.at(turns_about, relations[relations[:, 0] == relations[:, 1], 0], 1)
    centres = Centres(turns_about, here[:0, 0])
    rows, place = np.unique(
        np.sort(np.concatenate([here, there]), axis=1), axis=0, return_inverse=True
    )
    numbers = np.sort(space.global_numbers(rows), axis=1)
    by_number = np.lexsort(numbers.T[::-1])
    rank = np.argsort(by_number)[place.ravel()]
    least = components(len(rows), rank.reshape(2, -1).T)
    repeated = rows[by_number[least != np.arange(len(rows))]]
    return centres._replace(repeated=centres.key(repeated))


def _nodes_of(cells: CellGeometry, facets: np.ndarray) -> np.ndarray:
    """Return the sorted nodes of facets, shape (n, m)."""
    cell, i = np.divmod(cells.side[0, facets], cells.d + 1)
    nodes: np.ndarray = cells.nodes[cell[:, None], local_facet_nodes(cells.d, cells.degree)[i]]
    return nodes


def _places_among(wanted: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Return the place of each number of rows (n, m) in other rows, shape (n, m, 1)."""
    return (wanted[:, :, None] == among[:, None]).argmax(axis=2)[..., None]
