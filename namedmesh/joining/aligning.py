"""Give two sides in the plane the same vertices where they lie against each other.

Vertices of both sides that are close become one. The others are vertices of both sides
afterwards: the triangles at a side are cut where the other side has a vertex. All of
them lie on the facets of side 1, so side 2 of a curved contact moves by the height of
the facets over each other.

Across a clearance or an interference each side keeps its own place. Vertices that would
be one are then pairs of vertices along the mean of the normals of both sides, so that
mirror images face each other: the second vertex moves along the facets of side 2, and
new ones lie on them.

Symbols: 1 and 2 the sides. Lengths along the contact are places on a curve of side 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.base.percent import enough, place_words
from namedmesh.joining.curve import Curve, curves, direct_facets
from namedmesh.joining.cutting import cut
from namedmesh.joining.thresholds import CLOSE, CORNER, CRUSHED, FACING, SAME
from namedmesh.joining.triangles import edge_lengths, shortest_edges
from namedmesh.plain import PlainMesh
from namedmesh.simplex import determinants
from namedmesh.tags import NO_TAG

HEIGHTS = 1.5
"""Allowed distance of curved sides, by the height of their facets [-]."""
MEAN_ROUNDS = 30
"""Most times that the normal of side 2 is taken at the facing point.

Each time the facing point is nearer to its place by about distance over radius.
"""
SAME_DIRECTION = 1e-12
"""Change of the mean normals that ends these rounds [-]."""
NEAR = 0.2
"""Greatest distance of sides, by the shorter facet [-]."""


@dataclass(frozen=True, eq=False)
class _Facing:
    """Hold the facets of side 2 along a curve of side 1.

    Attributes:
        sides: Their sides (cell, local facet), shape (k, 2).
        points: First and last point, in the direction of the curve, shape (k, 2).
        places: Their places, rising, shape (k, 2).
        apart: Distances of the points from the curve [length], shape (k, 2).
    """

    sides: np.ndarray
    points: np.ndarray
    places: np.ndarray
    apart: np.ndarray


def align(
    plain: PlainMesh, here: int, there: int, apart: float = 0.0, *, keep: bool = False
) -> PlainMesh:
    """Return a mesh in the plane whose two sides have common vertices.

    Args:
        plain: The mesh.
        here: Tag of side 1.
        there: Tag of side 2.
        apart: Greatest distance of both sides [length].
        keep: Whether each side keeps its place: its vertices are then pairs of points
            of the glued mesh.

    Raises:
        InputError: If the sides are further apart, or cells would be crushed.
    """
    count = len(curves(plain.x, plain.cells, plain.sides(here)))
    for number in range(count):
        # Cells have other numbers once the curve before was cut.
        curve = curves(plain.x, plain.cells, plain.sides(here))[number]
        if keep:
            curve = _with_mean_normals(plain, curve, there, apart)
        facing = _facing(plain, curve, plain.sides(there), apart)
        if len(facing.sides):
            plain = _with_common_vertices(plain, curve, facing, keep)
    return plain


def _with_mean_normals(plain: PlainMesh, curve: Curve, there: int, apart: float) -> Curve:
    """Let a curve project along the mean of its normals and the normals of side 2.

    Beyond the ends of side 2 its normals there count, and in a hole of side 2 only the
    normals of the curve.
    """
    sides = plain.sides(there)
    normals2 = np.zeros(plain.x.shape)
    for facing_curve in curves(plain.x, plain.cells, sides):
        normals2[facing_curve.points] = facing_curve.normals
    mean = curve
    for _ in range(MEAN_ROUNDS):
        facing = _facing(plain, mean, sides, apart)
        if not len(facing.sides):
            break
        places = curve.places
        if not curve.closed:
            last = np.nextafter(facing.places.max(), -np.inf)
            places = np.clip(places, facing.places.min(), last)
        row = _facet_over(mean, facing, places)
        share = _shares(plain, mean, facing, np.arange(len(places)), row)
        start, end = np.moveaxis(normals2[facing.points[row]], 1, 0)
        of_second = start + share[:, None] * (end - start)
        total = curve.normals - of_second / np.linalg.norm(of_second, axis=1)[:, None]
        total /= np.linalg.norm(total, axis=1)[:, None]
        total = np.where(row[:, None] < 0, curve.normals, total)
        change = abs(total - mean.across).max()
        mean = replace(curve, given=total)
        if change < SAME_DIRECTION:
            break
    return mean


def _facing(plain: PlainMesh, curve: Curve, sides: np.ndarray, allowance: float) -> _Facing:
    """Find the facets of side 2 that lie against a curve.

    Raises:
        InputError: If some face it and are too far away.
    """
    start, end = direct_facets(plain.x, plain.cells, sides, left=False)
    points = np.column_stack([start, end])
    used, rows = np.unique(points, return_inverse=True)
    of_used, distance = curve.project(plain.x[used])
    places = of_used[rows]
    of_points = distance[rows]
    apart = of_points.max(axis=1)
    lengths = edge_lengths(plain.x, points)
    step = places[:, 1] - places[:, 0]
    if curve.closed:
        # A facet may go over the vertex where the places begin anew.
        step -= curve.length * np.round(step / curve.length)
        places[:, 1] = places[:, 0] + step
    middles = places.mean(axis=1)
    facet = curve.facet_at(middles % curve.length if curve.closed else middles)
    shorter = np.minimum(lengths, curve.lengths[facet])
    common = np.minimum(places[:, 1], curve.length) - np.maximum(places[:, 0], 0.0)
    against = step > FACING * lengths
    if not curve.closed:
        against &= common > SAME * shorter
    near = against & (apart <= _allowed_distance(curve, facet, lengths) + allowance)
    beyond = against & ~near & (apart < shorter + allowance)
    if beyond.any():
        worst = np.flatnonzero(beyond)[np.argmax(apart[beyond])]
        middle = place_words(plain.x[points[worst]].mean(axis=0))
        # What is allowed decides which facets face each other, too.
        excess = apart - _allowed_distance(curve, facet, lengths)
        needed = allowance
        while np.any(beyond):
            needed = float(excess[beyond].max())
            beyond = against & (excess > needed) & (apart < shorter + needed)
        clearance = enough(max(needed, apart[worst]))
        raise InputError(
            f"joined: the parts are {apart[worst]:.3g} apart near {middle}, where "
            f"facets have the length {shorter[worst]:.3g}. Give a clearance or an interference by "
            f"apart= ({clearance} is enough), and by gap= of the contact; take smaller facets if "
            "the sides are curved."
        )
    return _Facing(sides[near], points[near], places[near], of_points[near])


def _allowed_distance(curve: Curve, facet: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return the distance from the curve that facets of side 2 may have [length].

    Facets of length h on a curve of radius R are h^2 / (8 R) high. The curve turns by
    h / R at each vertex.
    """
    turn = _bends(curve)
    curve_lengths = curve.lengths[facet]
    curvature = np.maximum(turn[facet], turn[facet + 1]) / curve_lengths
    height = (curve_lengths**2 + lengths**2) * curvature / 8
    shorter = np.minimum(curve_lengths, lengths)
    return np.minimum(SAME * shorter + HEIGHTS * height, NEAR * shorter)


def _bends(curve: Curve) -> np.ndarray:
    """Return the angle by which a curve turns at each vertex, zero at corners."""
    turns = abs(curve.turns)
    return np.where(turns < CORNER, turns, 0.0)


def _with_common_vertices(plain: PlainMesh, curve: Curve, facing: _Facing, keep: bool) -> PlainMesh:
    """Give a curve and the facets that face it common vertices.

    Raises:
        InputError: If cells would be crushed.
    """
    for close in CLOSE:
        common = _common(plain, curve, facing, close, keep)
        if keep:
            moved, points = _keep_apart(plain, curve, facing, common)
        else:
            moved, points = _in_one_place(plain, common)
        # A cell that is turned over has a negative share of its area.
        before = determinants(plain.x[plain.cells])
        after = determinants(moved.x[moved.cells])
        if np.all(after / before > CRUSHED):
            sides = np.concatenate([common.free_sides, common.alone_sides])
            parts = cut(moved.x, moved.cells, moved.tags, sides, points)
            regions = plain.regions[parts.parents]
            glued = moved.with_points(parts.x[len(moved.x) :]).glued
            marks = None
            if moved.marks is not None:
                marks = cut(moved.x, moved.cells, moved.marks, sides, points).tags
            return PlainMesh(parts.x, parts.triangles, regions, parts.tags, glued, marks)
    middle = plain.x[plain.cells[np.argmin(after / before)]].mean(axis=0)
    raise InputError(
        "joined: the vertices of the second part cannot move to the first one near "
        f"{place_words(middle)}, the cells there are too flat. Mesh the parts with similar facets."
    )


@dataclass(frozen=True, eq=False)
class _Common:
    """Hold which vertices of two sides become common, and which vertices they lack.

    Attributes:
        x: Points [length], with the vertices of side 1 that move to corners of side 2,
            shape (n, 2).
        merged: Vertices of side 2 that become one with a vertex of side 1, shape (m,).
        partners: These vertices of side 1.
        slides: Which of the merged vertices are not at the place of their partner, and
            may move, shape (m,).
        free: Vertices of side 2 that side 1 lacks, shape (k,).
        free_sides: Sides (cell, local facet) of side 1 on which they are.
        on_first: Their places on side 1 [length], shape (k, 2).
        alone: Vertices of side 1 that side 2 lacks, shape (l,).
        alone_sides: Sides of side 2 on which they are.
    """

    x: np.ndarray
    merged: np.ndarray
    partners: np.ndarray
    slides: np.ndarray
    free: np.ndarray
    free_sides: np.ndarray
    on_first: np.ndarray
    alone: np.ndarray
    alone_sides: np.ndarray


def _common(plain: PlainMesh, curve: Curve, facing: _Facing, close: float, keep: bool) -> _Common:
    """Find the vertices that two sides are to have in common."""
    x = plain.x.copy()
    corners = np.arange(len(curve.points) - curve.closed)
    points1 = curve.points[corners]
    points2, first = np.unique(facing.points, return_index=True)
    place2 = facing.places.ravel()[first]
    if curve.closed:
        place2 %= curve.length
    facets1 = np.column_stack([curve.points[:-1], curve.points[1:]])
    size1 = shortest_edges(plain.x, facets1)[points1]
    size2 = shortest_edges(plain.x, facing.points)[points2]
    fixed = _find_fixed(plain, curve, facing)

    # The nearest vertex of side 1; the end of a closed curve is its beginning.
    after = np.clip(np.searchsorted(curve.places, place2), 1, len(curve.places) - 1)
    before_is_nearer = place2 - curve.places[after - 1] < curve.places[after] - place2
    nearest = after - before_is_nearer
    distance = abs(place2 - curve.places[nearest])
    partner = points1[nearest % len(points1)]
    size = np.minimum(size1[nearest % len(points1)], size2)
    same = SAME * size
    if keep:
        # What faces a corner is known as well as the normal there: to a turn of facets,
        # and to the angle between both sides.
        tilt = 2 * np.linalg.norm(curve.across - curve.normals, axis=1)
        blur = (_turns_beside(curve) + tilt)[nearest] * facing.apart.ravel()[first]
        same = np.minimum(same + blur, close * size)
    may_move = ~(fixed[partner] & fixed[points2])
    merged = distance < np.where(may_move, close * size, same)
    # A corner of side 2 stays, and the vertex of side 1 moves along its facets.
    to_second = merged & fixed[points2] & ~fixed[partner]
    x[partner[to_second]] = curve.at(place2[to_second])

    free = ~merged & (place2 > 0) & (place2 < curve.length)
    sides1 = curve.sides[curve.facet_at(place2[free])]
    # Vertices of side 1 that became none of side 2 are inserted where its facets are.
    alone = ~np.isin(points1, partner[merged])
    row = _facet_over(curve, facing, curve.places[corners[alone]])
    return _Common(
        x,
        points2[merged],
        partner[merged],
        (~fixed[points2] & (distance > SAME * size))[merged],
        points2[free],
        sides1,
        curve.at(place2[free]),
        points1[alone][row >= 0],
        facing.sides[row[row >= 0]],
    )


def _turns_beside(curve: Curve) -> np.ndarray:
    """Return the greatest angle by which a curve turns at each vertex or beside it.

    Corners do not count. Shape (k+1,).
    """
    turns = _bends(curve)
    before, after = turns[-2:-1], turns[1:2]
    if not curve.closed:
        before = after = np.zeros(1)
    padded = np.concatenate([before, turns, after])
    return np.max([padded[:-2], padded[1:-1], padded[2:]], axis=0)


def _in_one_place(plain: PlainMesh, common: _Common) -> tuple[PlainMesh, np.ndarray]:
    """Move side 2 onto side 1.

    Returns:
        The mesh, and the points to insert on the sides that lack them.
    """
    x = common.x
    x[common.free] = common.on_first
    x[common.merged] = x[common.partners]
    number = np.arange(len(x))
    number[common.merged] = common.partners
    moved = replace(plain, x=x, cells=number[plain.cells])
    if plain.glued is not None:
        moved = moved.with_pairs(common.merged, common.partners)
    return moved, np.concatenate([common.free, common.alone])


def _keep_apart(
    plain: PlainMesh, curve: Curve, facing: _Facing, common: _Common
) -> tuple[PlainMesh, np.ndarray]:
    """Let both sides keep their places, as :func:`_in_one_place` moves side 2."""
    slides = common.slides
    targets = np.concatenate([common.partners[slides], common.alone])
    on_second, is_over = _facing_points(plain, curve, facing, targets)
    count = int(slides.sum())
    x = common.x
    x[common.merged[slides][is_over[:count]]] = on_second[:count][is_over[:count]]
    new = np.concatenate([common.on_first, on_second[count:]])
    points = len(x) + np.arange(len(new))
    moved = replace(plain, x=x).with_points(new)
    here = np.concatenate([common.partners, points[: len(common.free)], common.alone])
    there = np.concatenate([common.merged, common.free, points[len(common.free) :]])
    return moved.with_pairs(here, there), points


def _facing_points(
    plain: PlainMesh, curve: Curve, facing: _Facing, vertices: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find where the directions of projection at vertices of side 1 meet side 2.

    Args:
        plain: The mesh.
        curve: Side 1.
        facing: Side 2.
        vertices: Numbers of vertices of the curve, shape (n,).

    Returns:
        Points [length], shape (n, 2), and which of the vertices have a facet of side 2
        over them, shape (n,).
    """
    points = curve.points[: len(curve.points) - curve.closed]
    order = np.argsort(points)
    at = order[np.searchsorted(points, vertices, sorter=order)]
    row = _facet_over(curve, facing, curve.places[at])
    share = _shares(plain, curve, facing, at, row)
    start, end = np.moveaxis(plain.x[facing.points[row]], 1, 0)
    return start + share[:, None] * (end - start), row >= 0


def _shares(
    plain: PlainMesh, curve: Curve, facing: _Facing, at: np.ndarray, row: np.ndarray
) -> np.ndarray:
    """Find where the directions of projection at vertices meet facets of side 2.

    Args:
        plain: The mesh.
        curve: Side 1.
        facing: Side 2.
        at: Places of the vertices in the curve, shape (n,).
        row: The facets of side 2, shape (n,).

    Returns:
        The share of each facet before that point, between 0 and 1, shape (n,).
    """
    start, end = np.moveaxis(plain.x[facing.points[row]], 1, 0)
    direction = curve.across[at]
    level = np.column_stack([-direction[:, 1], direction[:, 0]])
    height = ((curve.x[at] - start) * level).sum(axis=1)
    return np.clip(height / ((end - start) * level).sum(axis=1), 0.0, 1.0)


def _facet_over(curve: Curve, facing: _Facing, places: np.ndarray) -> np.ndarray:
    """Return the facet of side 2 at each place of side 1, or -1."""
    shifts = np.array([-1, 0, 1]) * curve.length if curve.closed else np.zeros(1)
    low = (facing.places[:, 0] + shifts[:, None]).ravel()
    high = (facing.places[:, 1] + shifts[:, None]).ravel()
    facet = np.tile(np.arange(len(facing.sides)), len(shifts))
    order = np.argsort(low)
    at = np.searchsorted(low[order], places, side="right") - 1
    row = order[np.maximum(at, 0)]
    return np.where((at >= 0) & (places < high[row]), facet[row], -1)


def _find_fixed(plain: PlainMesh, curve: Curve, facing: _Facing) -> np.ndarray:
    """Check which points must stay: at corners, at other parts and between regions."""
    fixed = np.zeros(len(plain.x), dtype=bool)
    for region in np.unique(plain.regions):
        cells = plain.cells[plain.regions == region]
        others = plain.cells[plain.regions != region]
        fixed[np.intersect1d(cells, others)] = True
    own_tag = plain.tags[tuple(curve.sides[0])]
    other_tag = plain.tags[tuple(facing.sides[0])]
    tagged = np.argwhere(~np.isin(plain.tags, [NO_TAG, own_tag, other_tag]))
    fixed[plain.points_of(tagged)] = True
    fixed[curve.points[abs(curve.turns) > CORNER]] = True
    if not curve.closed:
        fixed[curve.points[[0, -1]]] = True
    # Side 2 ends where it has one facet only, and has a corner where it turns.
    start, end = direct_facets(plain.x, plain.cells, plain.sides(other_tag), left=False)
    direction = plain.x[end] - plain.x[start]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    arriving = np.full((len(plain.x), 2), np.nan)
    leaving = np.full((len(plain.x), 2), np.nan)
    arriving[end] = direction
    leaving[start] = direction
    cosine = np.einsum("ij,ij->i", arriving, leaving)
    ends = np.unique([start, end])
    fixed[ends] |= ~(cosine[ends] > np.cos(CORNER))
    return fixed
