"""Say whether a cell lies where the stress of linear elasticity may be infinite.

That is at re-entrant corners and edges of a body, and where a support, a contact or a
joint ends on its boundary. The greatest stress there tells the mesh and not the part.
The mesh tells these places: by the angle that all cells around a corner fill, and by
the parts that meet there.

Symbols: d dimension. A ridge is what two facets share, a vertex in the plane and an
edge in 3D; it has d-1 vertices.

Source: M. L. Williams, Stress singularities resulting from various boundary conditions
in angular corners of plates in extension, 1952.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.model.space import Space
from namedmesh.base.ranks import distinct_rows, of_all
from namedmesh.for_solvers import boundary_sides
from namedmesh.simplex import of_facets

RE_ENTRANT = 200.0
"""Angle of a body from which a corner of flat facets is re-entrant [degrees]."""
Part = tuple[str, str, float]
"""Type of a part of the boundary that may end: its name, in words what its end is, and
up to which angle of the body there the stress is finite [degrees]."""
SAME_PLACE = 1e-9
"""Distance over the extent of the body that counts as none [-]."""


def singular_place(space: Space, place: np.ndarray, parts: Sequence[Part]) -> str:
    """Say at what the cell with its middle at a place lies, in words; collective.

    Args:
        space: The mesh.
        place: The middle of a cell [length], shape (d,).
        parts: The parts of the boundary that may end at a singular place.

    Returns:
        A re-entrant corner, as "a re-entrant corner of 270 degrees", or the words of a
        part that ends there; empty where the cell touches neither.
    """
    d = space.d
    cells = space.owned_cells
    corners = space.cell_corners()[cells]
    vertices = space.global_numbers(space.V.dofmap.list[cells, : d + 1])
    distance = np.linalg.norm(corners.mean(axis=1) - place, axis=1)
    is_here = distance <= SAME_PLACE * space.domain.extent
    near = distinct_rows(space.comm, vertices[is_here].ravel())

    topology = space.mesh.topology
    outer = dmesh.exterior_facet_indices(topology)
    curved = space.domain.curved_facets
    if curved is not None:
        # Flat facets of a smooth surface meet at angles, too.
        outer = np.setdiff1d(outer, curved.indices)
    sides = np.column_stack(boundary_sides(space.mesh, outer))
    outer_vertices = of_facets(vertices[sides[:, 0]], sides[:, 1])

    def ridges_of(facets: np.ndarray) -> set[tuple[int, ...]]:
        """Return the ridges of facets that touch the cell, of all ranks."""
        return set(map(tuple, distinct_rows(space.comm, _ridges_at(near, facets)).tolist()))

    # Inside a body, where no facet of the boundary is, cells fill the whole angle.
    outer_ridges = ridges_of(outer_vertices)
    angles = _angles(space, corners, vertices, near)
    greatest = max((angles[ridge] for ridge in outer_ridges), default=0.0)
    if greatest > RE_ENTRANT:
        kind = "corner" if d == 2 else "edge"
        return f"a re-entrant {kind} of {greatest:.0f} degrees"
    for name, words, limit in parts:
        of_part = space.domain.owned_facets(name)
        held = ridges_of(of_facets(vertices[of_part[:, 0]], of_part[:, 1]))
        is_other = ~np.isin(space.facet_numbers(sides), space.facet_numbers(of_part))
        ends = held & ridges_of(outer_vertices[is_other])
        if any(angles[ridge] > limit for ridge in ends):
            return words
    return ""


def _ridges_at(near: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return the ridges of facets with a near vertex, each sorted, shape (n, d-1).

    Args:
        near: Numbers of the near vertices.
        vertices: Vertices of the facets, shape (f, d).
    """
    d = vertices.shape[1]
    choices = [vertices[:, list(choice)] for choice in combinations(range(d), d - 1)]
    ridges = np.sort(np.concatenate(choices), axis=1)
    return ridges[np.isin(ridges, near).any(axis=1)]


def _angles(
    space: Space, corners: np.ndarray, vertices: np.ndarray, near: np.ndarray
) -> dict[tuple[int, ...], float]:
    """Return the angles that cells fill around ridges with a near vertex; collective.

    Args:
        space: The mesh.
        corners: Vertices of owned cells [length], shape (n, d+1, d).
        vertices: Their global numbers, shape (n, d+1).
        near: Numbers of the near vertices.

    Returns:
        Angles [degrees] by the sorted numbers of the vertices of the ridges.
    """
    d = space.d
    touching = np.isin(vertices, near).any(axis=1)
    x, numbers = corners[touching], vertices[touching]
    ridges, angles = [], []
    for ridge in map(list, combinations(range(d + 1), d - 1)):
        first, second = (x[:, i] - x[:, ridge[0]] for i in range(d + 1) if i not in ridge)
        if d == 3:
            along = x[:, ridge[1]] - x[:, ridge[0]]
            along /= np.linalg.norm(along, axis=1, keepdims=True)
            first = first - (first * along).sum(axis=1, keepdims=True) * along
            second = second - (second * along).sum(axis=1, keepdims=True) * along
        lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        cosine = np.clip((first * second).sum(axis=1) / lengths, -1.0, 1.0)
        ridges.append(np.sort(numbers[:, ridge], axis=1))
        angles.append(np.degrees(np.arccos(cosine)))
    every_ridge, every_angle = of_all(space.comm, np.concatenate(ridges), np.concatenate(angles))
    different, place = np.unique(every_ridge, axis=0, return_inverse=True)
    total = np.zeros(len(different))
    np.add.at(total, place.ravel(), every_angle)
    return dict(zip(map(tuple, different.tolist()), total.tolist(), strict=True))
