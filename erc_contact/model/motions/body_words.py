"""Say in words which bodies are meant, and where bodies touch that nothing connects."""

from __future__ import annotations

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.model.space import Space
from namedmesh.base.ranks import boxes, union
from namedmesh.base.releases import cell_nodes
from namedmesh.for_solvers import boundary_sides, points_in_words, shared_points

COINCIDENT = 2.0**-30
"""Distance of middles of facets that counts as none, over the extent [-]."""


def lying_words(space: Space, body: np.ndarray, count: int) -> str:
    """Say where facets of two bodies coincide that are no pair; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        count: Number of bodies.

    Returns:
        Words with the number of facets and their middles; empty if there are none.
    """
    if count == 1:
        return ""
    middles, of_facet = _facets_near_other_bodies(space, body, count)
    # Files give equal points with the digits that they have.
    grain = COINCIDENT * space.domain.extent
    points, _ = shared_points(space.comm, np.round(middles / grain) * grain, of_facet)
    if len(points) == 0:
        return ""
    number = len(np.unique(points, axis=0))
    places = points_in_words(points, space.domain.extent)
    return (
        f"{number} facets of two bodies lie on each other without common nodes, with middles"
        f" {places}: nothing passes from one body to the other there."
        " Merge the nodes where the mesh is made. For a contact, or a joint, give both bodies"
        " regions of their own, and make a pair of the two sides by domain.joined, for a Contact"
        " or Tied."
    )


def _facets_near_other_bodies(
    space: Space, body: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return middles of facets in the boxes around other bodies; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        count: Number of bodies.

    Returns:
        Middles [length], shape (n, d), and bodies, shape (n,), of facets of the
        boundary that this rank owns and that belong to no pair.
    """
    domain = space.domain
    paired = np.zeros(space.facet_count, dtype=bool)
    for sides in domain.paired_sides:
        paired[space.facet_numbers(sides)] = True
    facets = dmesh.exterior_facet_indices(space.mesh.topology)
    cells, local = boundary_sides(space.mesh, facets[~paired[facets]])
    middles = space.facet_corners(np.column_stack([cells, local])).mean(axis=1)
    of_facet = body[space.nodes[cells, 0]]
    low, high = boxes(space.comm, middles, of_facet, count)
    margin = 2.0 * COINCIDENT * domain.extent
    near = np.zeros(len(middles), dtype=bool)
    for number in range(count):
        inside = (middles >= low[number] - margin) & (middles <= high[number] + margin)
        near |= inside.all(axis=1) & (of_facet != number)
    return middles[near], of_facet[near]


def hinge_words(space: Space, body: np.ndarray, loose: np.ndarray) -> str:
    """Say at which points loose bodies touch others without a facet; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        loose: Numbers of the loose bodies.
    """
    domain = space.domain
    facing = np.zeros(len(body), dtype=bool)
    for sides in domain.paired_sides:
        facing[space.facet_nodes(sides)] = True
    nodes = space.vertices[: domain.owned_cells]
    alone = ~facing[nodes]
    geometry = space.mesh.geometry
    x = geometry.x[cell_nodes(geometry)[: domain.owned_cells][alone], : space.d]
    points, bodies = shared_points(space.comm, x, body[nodes[alone]])
    points = points[np.isin(bodies, loose)]
    if len(points) == 0:
        return ""
    places = points_in_words(points, domain.extent)
    return (
        f" It touches another body at {places}: bodies that meet at vertices"
        " or edges alone, or without a Contact, transmit no force. Let them share facets (in gmsh:"
        " let them overlap, then fragment), or give them a Contact."
    )


def boundary_parts(space: Space, inside: np.ndarray) -> str:
    """List the boundary parts of a body for a message; collective.

    Args:
        space: The mesh.
        inside: Which nodes of this rank are of the body.
    """
    domain = space.domain
    cells = {name: domain.facets(name)[:, 0] for name in domain.outer}
    parts = _on_body(space, inside, cells)
    if parts:
        return ", ".join(map(repr, parts))
    regions = _on_body(space, inside, {name: domain.region(name) for name in domain.regions})
    if regions:
        return f"the region {', '.join(map(repr, regions))}"
    return "no named boundary part"


def _on_body(space: Space, inside: np.ndarray, cells: dict[str, np.ndarray]) -> list[str]:
    """List the names whose cells have a node of a body; collective.

    Args:
        space: The mesh.
        inside: Which nodes of this rank are of the body.
        cells: Cells of each name.
    """
    here = {name for name, of_name in cells.items() if inside[space.nodes[of_name]].any()}
    return sorted(union(space.comm, here))
