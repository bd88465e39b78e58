"""Give two curved sides in 3D the same facets, and mesh one body anew.

One side keeps its facets, the other one takes them. Where the outlines run together,
the points of the second one move to points of the first one. Where an outline lies amid
the other side, a band of triangles leads from it to the triangles that remain. gmsh
then fills the region behind with the triangles of its surface fixed.

Symbols: "kept" is the side whose facets stay, "taken" the one that gets them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.base.percent import enough
from namedmesh.closest import closest
from namedmesh.joining.behind import RemeshedRegion, regions_behind, surface, with_cells
from namedmesh.joining.filling import fill
from namedmesh.joining.loops import band, loops, outer_edges
from namedmesh.joining.outlines import cut_edges
from namedmesh.joining.side_contact import (
    NO_FIT,
    SAME,
    FacetSide,
    Outlines,
    SideContact,
    allowance,
    orient,
    outlines_on,
    side_contact,
)
from namedmesh.joining.thresholds import LEAST_ANGLE
from namedmesh.joining.triangles import (
    area_vectors,
    edges_of,
    kept_areas,
    least_angle,
)
from namedmesh.plain import PlainMesh
from namedmesh.rows import look_up, row_numbers
from namedmesh.simplex import determinants, measures

BESIDE = (0.6, 0.8, 0.4, 1.0)
"""Least distance of points that remain beside a new outline, by their edges [-].

The one is taken whose band has the greatest least angle.
"""
CRUSHED = 0.2
"""Least share of its measure that a triangle or cell keeps when points move [-].

It is lower than elsewhere, as facets of curved sides move farther.
"""


def imprint_curved(plain: PlainMesh, here: int, there: int, apart: float = 0.0) -> PlainMesh:
    """Return a mesh in 3D whose two sides have common facets.

    Args:
        plain: The mesh.
        here: Tag of side 1.
        there: Tag of side 2.
        apart: Greatest distance of both sides [length].

    Raises:
        InputError: If neither side lies on the other one, or the region behind cannot
            be meshed anew.
    """
    regions = regions_behind(plain, here, there)
    first, second = (_side(plain, region) for region in regions)
    # The second side takes the facets of the first one, if that lies within it.
    contacts = [side_contact(first, second, apart), side_contact(second, first, apart)]
    if contacts[0].beyond > 0 and contacts[1].beyond > 0:
        raise InputError(min(contacts, key=lambda contact: contact.beyond).message)
    reasons = []
    for contact, region in zip(contacts, regions[::-1], strict=True):
        if contact.beyond <= 0:
            try:
                return _take_facets(plain, contact, region, apart)
            except InputError as reason:
                reasons.append(reason)
    raise reasons[0]


def _side(plain: PlainMesh, region: RemeshedRegion) -> FacetSide:
    """Return the triangles of the side of a region, oriented."""
    triangles = orient(plain, plain.sides(region.side_tag))
    return FacetSide(plain.x, triangles, region.outline)


def _take_facets(
    plain: PlainMesh, contact: SideContact, behind: RemeshedRegion, apart: float
) -> PlainMesh:
    """Give a side the facets of another side, and mesh the region behind it anew."""
    x = plain.x
    taken = contact.taken
    outlines = outlines_on(x, contact)
    number = outlines.number
    removed, bands = _best_bands(x, contact, outlines, apart)
    remaining_facets = number[taken.triangles[~removed]]
    side = np.concatenate([contact.kept.triangles, bands, remaining_facets])
    whole = replace(plain, cells=number[plain.cells])
    region = _move_points(plain, behind, number)
    shell = surface(whole, region, number, outlines.inserted, side)
    _check_closed(shell[0])
    new_x, cells = fill(x, shell[0], optimize=True)
    moved = contact.allowed.max() * measures(x[taken.triangles]).sum()
    return with_cells(whole, region, new_x, cells, shell, moved).without_cells(region.cells)


def _best_bands(
    x: np.ndarray, contact: SideContact, outlines: Outlines, apart: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return triangles to remove, and triangles between outlines and what remains.

    Returns:
        Whether each triangle of the side that is taken is removed, and the bands.

    Raises:
        InputError: If the triangles between are splinters.
    """
    amid, to_outline = _places(x, contact, outlines, apart)
    taken = contact.taken
    reasons = []
    best = LEAST_ANGLE
    result = None
    for share in BESIDE:
        chosen = amid | (to_outline < share * taken.edge_lengths)
        removed = chosen[taken.triangles].any(axis=1)
        removed[contact.closest] = True
        try:
            bands = _bands(x, taken, outlines, removed)
        except InputError as reason:
            reasons.append(reason)
            continue
        angle = least_angle(x[bands])
        if angle > best:
            best = angle
            result = removed, bands
    if result is not None:
        return result
    if not reasons:
        reasons.append(
            InputError(
                "joined: the outline of one curved part nearly runs along facets of the other one, "
                f"with least angles below {LEAST_ANGLE} degrees between them. Mesh the parts with "
                "similar facets there."
            )
        )
    raise reasons[0]


def _places(
    x: np.ndarray, contact: SideContact, outlines: Outlines, apart: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find which points of a side lie on the other side, how far from its outline.

    Returns:
        Whether each point does, and its distance from the outline amid its side, shape
        (n,) each. For other points the distance is infinite.

    Raises:
        InputError: If a point that faces the other side is too far away.
    """
    kept = contact.kept
    taken = contact.taken
    points = np.unique(taken.triangles)
    facet, _, distance = closest(x[points], x[kept.triangles])
    to_outline = np.full(len(x), np.inf)
    to_outline[points] = closest(x[points], x[outlines.inner]).distance
    none = SAME * min(kept.shortest, taken.shortest)
    # Points beside the other side are nearest to its outline.
    on_kept = distance < to_outline[points] - none
    allowed = apart + allowance(taken, points, kept, facet)
    far = on_kept & (distance > allowed)
    if far.any():
        needed = apart + float((distance - allowed)[far].max())
        raise InputError(
            f"joined: the parts are {distance[far].max():.3g} apart where they face each other, "
            "and a part is curved. Name the parts where the bodies touch, and give a clearance or "
            f"an interference by apart= ({enough(needed)} is enough), and by gap= of the contact."
        )
    amid = np.zeros(len(x), dtype=bool)
    amid[points] = on_kept
    return amid, to_outline


def _bands(x: np.ndarray, taken: FacetSide, outlines: Outlines, removed: np.ndarray) -> np.ndarray:
    """Return triangles between the outlines and the triangles that remain.

    Raises:
        InputError: If the triangles that are removed have other outlines, or a triangle
            between is turned over.
    """
    holes = _holes(x, taken, outlines, removed)
    if len(holes) != len(outlines.loops):
        raise InputError(
            "joined: the outlines of the curved parts cross each other. Let one part lie within "
            "the other one, or let both end at the same place."
        )
    bands = [np.empty((0, 3), dtype=np.int64)]
    for loop in outlines.loops:
        distances = [np.linalg.norm(x[hole] - x[loop[0]], axis=1).min() for hole in holes]
        hole = holes.pop(int(np.argmin(distances)))
        # The side that is kept is on the left of its loop, as seen from its own body.
        bands.append(band(x, loop, hole[::-1]))
    triangles = np.concatenate(bands)
    # Where both outlines run together, there is nothing between them.
    triangles = triangles[~_is_collapsed(triangles)]
    normals = taken.point_normals[triangles].sum(axis=1)
    upright = np.einsum("ij,ij->i", area_vectors(x[triangles]), normals)
    if np.any(upright <= 0):
        raise InputError(NO_FIT)
    return triangles


def _holes(
    x: np.ndarray, taken: FacetSide, outlines: Outlines, removed: np.ndarray
) -> list[np.ndarray]:
    """Return the loops around the triangles that are removed, with merged points."""
    edges = outer_edges(taken.triangles[removed])
    inserted = outlines.inserted.copy()
    cut_outline = taken.outline[inserted[:, 0]]
    inserted[:, 0] = look_up(edges, np.arange(len(edges)), cut_outline)
    if np.any(inserted[:, 0] < 0):
        raise InputError(NO_FIT)
    edges = outlines.number[edges]
    different = edges[:, 0] != edges[:, 1]
    inserted[:, 0] = (np.cumsum(different) - 1)[inserted[:, 0]]
    return loops(x, cut_edges(x, edges[different], inserted))


def _move_points(plain: PlainMesh, region: RemeshedRegion, number: np.ndarray) -> RemeshedRegion:
    """Return a region without the triangles that vanish where points merge.

    Raises:
        InputError: If triangles or cells beside would be crushed.
    """
    x = plain.x
    triangles = number[region.triangles]
    share = kept_areas(x[region.triangles], x[triangles])
    vanishes = _is_collapsed(triangles)
    cells = plain.without_cells(region.cells).cells
    shares = determinants(x[number[cells]]) / determinants(x[cells])
    crushed = np.any(share[~vanishes] < CRUSHED) or np.any(region.inner & vanishes)
    if crushed or np.any(shares < CRUSHED):
        raise InputError(
            "joined: the outline of a curved part cannot move to the facing part's outline, the "
            "facets beside it are too flat. Mesh the parts with similar facets along their "
            "outlines."
        )
    stays = ~vanishes
    return replace(
        region,
        triangles=region.triangles[stays],
        tags=region.tags[stays],
        inner=region.inner[stays],
    )


def _is_collapsed(triangles: np.ndarray) -> np.ndarray:
    """Tell which triangles (n, 3) have a point twice, shape (n,)."""
    points = np.sort(triangles, axis=1)
    return np.any(points[:, 1:] == points[:, :-1], axis=1)


def _check_closed(triangles: np.ndarray) -> None:
    """Check that a surface is closed.

    Raises:
        InputError: If an edge does not have two triangles.
    """
    counts = np.bincount(row_numbers(edges_of(triangles))[0])
    if np.any(counts != 2):
        raise InputError(NO_FIT)
