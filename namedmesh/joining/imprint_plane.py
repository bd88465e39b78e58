"""Give two plane sides in 3D the same facets, and mesh the regions behind anew.

The outlines of both sides get common points, and gmsh meshes the plane between them:
the common part once for both bodies, and what only one side has. If one side lies
within the other one and its outline stays as it is, the other one takes its facets, and
only the region behind that one is meshed anew. A region is filled by gmsh with the
triangles of its surface fixed.

Symbols: 1 and 2 the sides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.base.percent import enough
from namedmesh.joining.behind import (
    RemeshedRegion,
    at_other_parts,
    regions_behind,
    surface,
    with_cells,
    with_surface,
)
from namedmesh.joining.filling import fill, triangulate
from namedmesh.joining.outlines import (
    Alignment,
    common_points,
    cut_edges,
    directions,
    inside,
)
from namedmesh.joining.strips import CutSurface, with_short_edges
from namedmesh.joining.thresholds import CLOSE, CRUSHED, LEAST_ANGLE, SAME
from namedmesh.joining.triangles import edge_lengths, kept_areas, least_angle, side_lengths
from namedmesh.plain import PlainMesh
from namedmesh.simplex import measures, outward_normals

FLAT = 1e-3
"""Distance from the plane that counts as none, by the shortest edge [-]."""
OPPOSITE = 0.999
"""Least cosine between normals of one side and reversed normals of the other [-]."""
DIGITS = 6
"""Digits of the normal that decide about the axes of a plane."""


@dataclass(frozen=True, eq=False)
class _Plane:
    """Hold a plane by a point and two axes of it, shape (3, 2)."""

    origin: np.ndarray
    axes: np.ndarray

    def coordinates(self, x: np.ndarray) -> np.ndarray:
        """Return the coordinates of points in the plane [length], shape (n, 2)."""
        return (x - self.origin) @ self.axes

    def points(self, y: np.ndarray) -> np.ndarray:
        """Return the points in 3D of coordinates [length], shape (n, 3)."""
        return self.origin + y @ self.axes.T


def imprint_plane(plain: PlainMesh, here: int, there: int, apart: float = 0.0) -> PlainMesh:
    """Return a mesh in 3D whose two plane sides have common facets.

    Args:
        plain: The mesh.
        here: Tag of side 1.
        there: Tag of side 2.
        apart: Greatest distance of both planes [length].

    Raises:
        InputError: If the sides are not plane or are further apart, or the regions
            behind them cannot be meshed anew.
    """
    plane, shortest = _common_plane(plain, here, there, apart)
    sides = np.concatenate([plain.sides(here), plain.sides(there)])
    on_plane = np.unique(plain.points_of(sides))
    x = plain.x.copy()
    x[on_plane] = plane.points(plane.coordinates(x[on_plane]))
    plain = replace(plain, x=x)
    whole = regions_behind(plain, here, there)
    tolerance = SAME * _shortest(plane.coordinates(x), whole)
    x, (first, second) = _with_short_edges(x, whole, plane, tolerance)
    plain = replace(plain, x=x)
    y = plane.coordinates(x)
    fixed = at_other_parts(first, len(x)) | at_other_parts(second, len(x))
    for close in CLOSE:
        alignment = common_points(y, first.outline, second.outline, fixed, close, tolerance)
        count = len(x)
        new_x = x.copy()
        moved = np.flatnonzero(np.any(alignment.y[:count] != y, axis=1))
        new_x[moved] = plane.points(alignment.y[moved])
        triangles = np.vstack([first.triangles, second.triangles])
        shares = kept_areas(x[triangles], new_x[alignment.number[triangles]])
        if np.all(shares > CRUSHED):
            break
    else:
        raise InputError(
            "joined: the triangles beside the outline of the contact are too flat, their vertices "
            "cannot move. Mesh the parts with similar facets."
        )
    still = np.linalg.norm(alignment.y[:count] - y, axis=1) <= FLAT * shortest
    moved_mesh = replace(plain, x=new_x, cells=alignment.number[plain.cells])
    return _with_common_facets(moved_mesh, (first, second), whole, alignment, still, plane)


def _with_short_edges(
    x: np.ndarray, regions: tuple[RemeshedRegion, RemeshedRegion], plane: _Plane, tolerance: float
) -> tuple[np.ndarray, tuple[RemeshedRegion, RemeshedRegion]]:
    """Cut the edges of both outlines where they run beside each other."""
    y = plane.coordinates(x)
    edges = np.concatenate([region.outline for region in regions])
    fixed = at_other_parts(regions[0], len(x)) | at_other_parts(regions[1], len(x))
    corners = ~directions(y, edges, fixed).any(axis=1)
    whole = []
    for region in regions:
        triangles = np.concatenate([region.triangles, region.side])
        whole.append(CutSurface.of(triangles, region.outline))
    x, cut = with_short_edges(x, (whole[0], whole[1]), plane.coordinates, corners, tolerance)
    result = []
    for region, shell in zip(regions, cut, strict=True):
        result.append(with_surface(region, shell.triangles, shell.parents, shell.outline))
    return x, (result[0], result[1])


def _shortest(y: np.ndarray, regions: tuple[RemeshedRegion, RemeshedRegion]) -> float:
    """Return the length of the shortest edge of two outlines [length]."""
    edges = np.concatenate([region.outline for region in regions])
    return float(edge_lengths(y, edges).min())


def _common_plane(plain: PlainMesh, here: int, there: int, apart: float) -> tuple[_Plane, float]:
    """Return the plane in which both sides lie, and their shortest edge [length].

    Raises:
        InputError: If they do not lie in one plane with opposite normals.
    """
    points = []
    mean = []
    shortest = np.inf
    for tag in (here, there):
        corners = plain.x[plain.points_of(plain.sides(tag))]
        shortest = min(shortest, side_lengths(corners).min())
        points.append(corners.reshape(-1, 3))
        mean.append(_mean_normal(plain, tag))
    if mean[0] @ mean[1] > -OPPOSITE:
        raise InputError(
            "joined: the parts do not face each other; the cosine between their outward normals "
            f"is {mean[0] @ mean[1]:.3g}, it must be -1. Turn the bodies, or give other parts."
        )
    normal = mean[0] / np.linalg.norm(mean[0])
    origin = points[0].mean(axis=0)
    flat = FLAT * shortest
    heights = [(x - origin) @ normal for x in points]
    distance = heights[1].mean()
    highest = abs(heights[1]).max() - apart
    if abs(heights[0]).max() > 2 * flat:
        raise InputError(
            f"joined: the first part is plane to {abs(heights[0]).max():.3g} only, where edges "
            f"have the length {shortest:.3g}. Name facets in one plane, or mesh the body anew."
        )
    if abs(distance) > flat + apart or highest > 2 * flat:
        raise InputError(
            f"joined: the parts are {abs(distance):.3g} apart, where edges have the length "
            f"{shortest:.3g}. Give a clearance or an interference by apart= "
            f"({enough(abs(heights[1]).max())} is enough), and by gap= of "
            "the contact."
        )
    # The first axis is the axis of space nearest to the plane; round-off must not turn
    # it.
    nearest = np.eye(3)[np.argmin(np.round(abs(normal), DIGITS))]
    first = nearest - (nearest @ normal) * normal
    first /= np.linalg.norm(first)
    axes = np.column_stack([first, np.cross(normal, first)])
    return _Plane(origin, axes), shortest


def plane_sides(plain: PlainMesh, here: int, there: int) -> bool:
    """Check whether two sides in 3D are plane."""
    means = [_mean_normal(plain, tag) for tag in (here, there)]
    return bool(min(map(np.linalg.norm, means)) > OPPOSITE)


def _mean_normal(plain: PlainMesh, tag: int) -> np.ndarray:
    """Return the mean outward normal of a side, shorter than 1 if it is curved."""
    sides = plain.sides(tag)
    areas = measures(plain.x[plain.points_of(sides)])
    normals = outward_normals(plain.x[plain.cells[sides[:, 0]]], sides[:, 1])
    return np.asarray(areas @ normals / areas.sum())


def _with_common_facets(
    plain: PlainMesh,
    regions: tuple[RemeshedRegion, RemeshedRegion],
    whole: tuple[RemeshedRegion, RemeshedRegion],
    alignment: Alignment,
    still: np.ndarray,
    plane: _Plane,
) -> PlainMesh:
    """Mesh the plane of both sides, and the regions behind them.

    Args:
        plain: The mesh with moved and merged points.
        regions: The regions behind both sides, before points were merged.
        whole: The same regions before their surfaces were cut along narrow strips.
        alignment: The common points of both outlines.
        still: Whether each point did not move.
        plane: The plane.
    """
    inserted = (alignment.inserted1, alignment.inserted2)
    sides = [alignment.number[region.side] for region in regions]
    is_cut = [region is not before for region, before in zip(regions, whole, strict=True)]
    outlines = []
    sizes = []
    for region, before, points in zip(regions, whole, inserted, strict=True):
        edges = alignment.number[region.outline]
        outlines.append(cut_edges(alignment.y, edges, points))
        corners = alignment.y[alignment.number[before.side]]
        lengths = side_lengths(corners).mean(axis=1)
        sizes.append((corners, np.repeat(lengths[:, None], 3, axis=1)))
    edges = np.unique(np.sort(np.concatenate(outlines), axis=1), axis=0)
    y, triangles = triangulate(alignment.y, edges, sizes, graded=any(is_cut))
    middles = y[triangles].mean(axis=1)
    within = [inside(y, middles, outline) for outline in outlines]
    in_both = within[0] & within[1]
    if not in_both.any():
        return plain
    x = np.concatenate([plain.x, plane.points(y[len(plain.x) :])])
    _check_angles(plane.points(y)[triangles[within[0] | within[1]]])
    common = triangles[in_both]
    keeps = []
    for i, region in enumerate(regions):
        covered = not np.any(within[i] & ~within[1 - i])
        unmoved = bool(still[region.outline].all()) and not is_cut[i]
        keeps.append(covered and unmoved and not len(inserted[i]))
    kept = keeps.index(True) if any(keeps) else None
    if kept is not None:
        common = sides[kept]
    result = replace(plain, x=x)
    for i in range(2):
        if i != kept:
            own_facets = triangles[within[i] & ~in_both]
            side = np.concatenate([common, own_facets])
            closed = surface(result, regions[i], alignment.number, inserted[i], side)
            x, cells = fill(result.x, closed[0], optimize=is_cut[i])
            moved = 2 * alignment.tolerance * _area_beside(x, regions[i])
            result = with_cells(result, regions[i], x, cells, closed, moved)
    refilled = [regions[i].cells for i in range(2) if i != kept]
    return result.without_cells(np.concatenate(refilled))


def _area_beside(x: np.ndarray, region: RemeshedRegion) -> float:
    """Return the area of the triangles beside an outline [length^2]."""
    beside = np.isin(region.triangles, region.outline).any(axis=1)
    return float(measures(x[region.triangles[beside]]).sum())


def _check_angles(corners: np.ndarray) -> None:
    """Check that no triangle of the plane is a splinter.

    Raises:
        InputError: If one is, as where two outlines nearly run together.
    """
    angle = least_angle(corners)
    if angle < LEAST_ANGLE:
        raise InputError(
            "joined: the outlines of the parts nearly run together, with a least angle of "
            f"{angle:.2g} degrees between them. Mesh curved outlines with "
            "the same vertices, or let the outlines keep away from each other."
        )
