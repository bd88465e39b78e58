"""Mesh a region behind a contact anew, with other facets at the contact.

The triangles of its surface are fixed, but those at the contact, and those beside the
outline of the contact where that gets points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.graphs import components
from namedmesh.joining.cutting import cut
from namedmesh.joining.loops import outer_edges
from namedmesh.plain import PlainMesh
from namedmesh.rows import look_up
from namedmesh.simplex import facet_vertices, measures
from namedmesh.tags import NO_TAG

SAME_VOLUME = 1e-6
"""Greatest relative difference of the volume of a region meshed anew [-]."""


@dataclass(frozen=True, eq=False)
class RemeshedRegion:
    """Hold the cells of a region behind a side, and its surface.

    Attributes:
        cells: Its cells, a connected part of a region, shape (m,).
        triangles: The triangles of its surface without the side, shape (k, 3).
        tags: Their tags, shape (k,).
        inner: Whether each lies between two regions, shape (k,).
        side: The triangles of the side, shape (l, 3).
        side_tag: Its tag.
        outline: The edges of the outline of the side, shape (o, 2).
    """

    cells: np.ndarray
    triangles: np.ndarray
    tags: np.ndarray
    inner: np.ndarray
    side: np.ndarray
    side_tag: int
    outline: np.ndarray


def regions_behind(
    plain: PlainMesh, here: int, there: int
) -> tuple[RemeshedRegion, RemeshedRegion]:
    """Return the regions behind both sides.

    Raises:
        InputError: If there are several behind a side, or one behind both, or one has a
            part inside.
    """
    count = len(plain.cells)
    facet = plain.facet_numbers
    order = np.argsort(facet.ravel(), kind="stable")
    double = np.flatnonzero(np.diff(facet.ravel()[order]) == 0)
    beside = np.column_stack([order[double], order[double + 1]]) // 4
    same = plain.regions[beside[:, 0]] == plain.regions[beside[:, 1]]
    body = components(count, beside[same])
    between = np.bincount(facet.ravel()) == 2
    found = []
    for tag in (here, there):
        behind = np.unique(body[plain.sides(tag)[:, 0]])
        if len(behind) > 1:
            raise InputError(
                "joined: the facets of the parts do not match, and there are several regions "
                f"behind one of them ({len(behind)} connected ones). Name the part of each region, "
                "and join them one by one."
            )
        found.append(behind[0])
    if found[0] == found[1]:
        raise InputError(
            "joined: the facets of the parts do not match, and they belong to the same connected "
            "region. Mesh them with the same facets."
        )
    first = _region(plain, np.flatnonzero(body == found[0]), between, here)
    second = _region(plain, np.flatnonzero(body == found[1]), between, there)
    return first, second


def _region(plain: PlainMesh, cells: np.ndarray, between: np.ndarray, tag: int) -> RemeshedRegion:
    """Return the surface of cells.

    Raises:
        InputError: If a part is inside.
    """
    facet = plain.facet_numbers
    count = np.bincount(facet[cells].ravel(), minlength=len(between))
    inside_cells = count[facet[cells]] == 2
    if np.any(inside_cells & (plain.tags[cells] != NO_TAG)):
        raise InputError(
            "joined: a region behind the contact is meshed anew, and has a part inside, which "
            "would be lost. Mesh both sides with the same facets, or leave out the part."
        )
    row, local = np.nonzero(~inside_cells)
    surface = np.column_stack([cells[row], local])
    triangles = plain.points_of(surface)
    tags = plain.tags[tuple(surface.T)]
    on_side = tags == tag
    side = triangles[on_side]
    inner = between[facet[tuple(surface[~on_side].T)]]
    outline = outer_edges(side)
    return RemeshedRegion(cells, triangles[~on_side], tags[~on_side], inner, side, tag, outline)


def with_surface(
    region: RemeshedRegion, triangles: np.ndarray, parents: np.ndarray, outline: np.ndarray
) -> RemeshedRegion:
    """Return a region whose surface was cut; the same one if it was not.

    Args:
        region: The region.
        triangles: The triangles of its surface, shape (m, 3).
        parents: In which of its triangles, the side last, each lies, shape (m,).
        outline: The edges of the outline of the side, shape (o, 2).

    Raises:
        InputError: If a triangle between two regions was cut.
    """
    if len(outline) == len(region.outline):
        return region
    others = parents < len(region.triangles)
    inner = region.inner[parents[others]]
    if inner.sum() > region.inner.sum():
        raise InputError(
            "joined: the outlines of the parts nearly run together beside another region, whose "
            "cells would have to be cut. Mesh both sides with the same facets."
        )
    return replace(
        region,
        triangles=triangles[others],
        tags=region.tags[parents[others]],
        inner=inner,
        side=triangles[~others],
        outline=outline,
    )


def at_other_parts(region: RemeshedRegion, count: int) -> np.ndarray:
    """Check which points are between different parts of the surface beside a side."""
    kind = 2 * region.tags + region.inner
    pairs = np.column_stack([region.triangles.ravel(), np.repeat(kind, 3)])
    points = np.unique(pairs, axis=0)[:, 0]
    return np.bincount(points, minlength=count) > 1


def surface(
    plain: PlainMesh,
    region: RemeshedRegion,
    number: np.ndarray,
    inserted: np.ndarray,
    side: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the new surface of a region, cut where its outline at the contact is.

    Args:
        plain: The mesh with merged points.
        region: The region, before points were merged.
        number: The point that each point has become.
        inserted: Edge of the outline and the point that cuts it, shape (k, 2).
        side: The new triangles at the contact.

    Returns:
        Its triangles and their tags.

    Raises:
        InputError: If a triangle between two regions would be cut.
    """
    triangles = number[region.triangles]
    tags = region.tags
    if len(inserted):
        triangles, parents = _cut_beside(plain, region, number, inserted)
        tags = tags[parents]
    side_tags = np.full(len(side), region.side_tag)
    return np.concatenate([triangles, side]), np.concatenate([tags, side_tags])


def _cut_beside(
    plain: PlainMesh, region: RemeshedRegion, number: np.ndarray, inserted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cut triangles beside the contact, and tell in which triangles the pieces lie."""
    triangles = number[region.triangles]
    # Side i of a triangle is opposite to its corner i.
    edges = triangles[:, facet_vertices(2)].reshape(-1, 2)
    cut_outline = number[region.outline[inserted[:, 0]]]
    row = look_up(edges, np.arange(len(edges)), cut_outline)
    sides = np.column_stack([row // 3, row % 3])
    if region.inner[sides[:, 0]].any():
        raise InputError(
            "joined: the outline of the contact runs along another region, whose cells would have "
            "to be cut. Mesh both sides with the same facets."
        )
    no_tags = np.full(triangles.shape, NO_TAG)
    pieces = cut(plain.x, triangles, no_tags, sides, inserted[:, 1])
    if len(pieces.x) > len(plain.x):
        raise InputError(
            "joined: a triangle beside the contact has two edges on its outline. Mesh the body "
            "with smaller cells there."
        )
    return pieces.triangles, pieces.parents


def with_cells(
    plain: PlainMesh,
    region: RemeshedRegion,
    x: np.ndarray,
    cells: np.ndarray,
    surface: tuple[np.ndarray, np.ndarray],
    moved: float = 0.0,
) -> PlainMesh:
    """Append the new cells of a region; its old ones stay.

    Args:
        plain: The mesh.
        region: The region.
        x: Points [length], the points of the mesh first, shape (n, 3).
        cells: The cells, shape (m, 4).
        surface: Triangles and tags of the surface of the region.
        moved: Greatest volume between the old surface and the new one [length^3].

    Raises:
        InputError: If the cells do not fill the region.
    """
    old = region.cells
    triangles, tags = surface
    volumes = measures(x[plain.cells[old]]).sum(), measures(x[cells]).sum()
    if abs(volumes[1] - volumes[0]) > SAME_VOLUME * volumes[0] + moved:
        raise InputError(
            f"joined: gmsh fills {volumes[1] / volumes[0]:.6g} times the volume of a region behind "
            "the contact. Mesh both sides with the same facets."
        )
    facets = cells[:, facet_vertices(3)].reshape(-1, 3)
    cell_tags = look_up(triangles, tags, facets, NO_TAG).reshape(-1, 4)
    regions = np.full(len(cells), plain.regions[old[0]], dtype=plain.regions.dtype)
    return PlainMesh(
        x,
        np.concatenate([plain.cells, cells]),
        np.concatenate([plain.regions, regions]),
        np.concatenate([plain.tags, cell_tags.astype(plain.tags.dtype)]),
    )
