"""Pair two sides of a body that is repeated: by a translation, or by a turn.

The body stands for all of its copies. The motion ``x -> R x + t`` takes the first side
of a :class:`PeriodicPair` onto the second one, facet onto facet, where the next copy
begins. The nodes of both sides stay apart.

Refinement by bisection keeps facets that match: an edge that is split on one side is
split on the other one, too (:func:`close_alike`). Under MPI every rank has all cells
around the vertices of its own cells, also around the places of these vertices on other
sides (:func:`across`).

Symbols: d dimension, n facets or points. A side is a pair of a cell and one of its
facets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from dolfinx import la
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.exceptions import InputError
from namedmesh.base.ranks import global_numbers, of_all
from namedmesh.base.releases import cell_nodes
from namedmesh.graphs import components
from namedmesh.named import NamedMesh
from namedmesh.partition import vertex_patch_partitioner
from namedmesh.sides import facets_of_cells
from namedmesh.simplex import of_facets

SAME_PLACE = 1e-8
"""Distance of a point from its image that counts as none, over the extent [-]."""
ROUND_OFF = 1e-15
"""Entry of a rotation that is round-off [-]."""
TWIST = 1e-5 * np.array([[0.44, 0.83, 0.31], [-0.57, 0.22, 0.71]])
"""Moves outward, along and around an axis, for each unit of radius and height [-]."""


@dataclass(frozen=True)
class PeriodicPair:
    """Pair two sides of a body by the motion ``x -> R x + t``.

    Attributes:
        names: Name of the first side, and of the side onto which the motion takes it.
        rotation: Rows of R [-].
        shift: t [length].
        axis: In 3D a point of the axis of R [length] and its direction; None in the
            plane, and for a translation.
    """

    names: tuple[str, str]
    rotation: tuple[tuple[float, ...], ...]
    shift: tuple[float, ...]
    axis: tuple[tuple[float, ...], ...] | None = None

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> PeriodicPair:
        """Make it from plain data, where rows are lists."""
        axis = plain["axis"] and tuple(map(tuple, plain["axis"]))
        rows = tuple(map(tuple, plain["rotation"]))
        return cls(tuple(plain["names"]), rows, tuple(plain["shift"]), axis)

    def is_near(self, second: PeriodicPair, extent: float) -> bool:
        """Tell whether another pair has the same sides and, up to round-off, motion.

        Args:
            second: A pair.
            extent: Size of the body [length].
        """
        turned = abs(np.array(self.rotation) - np.array(second.rotation)).max()
        shifted = abs(np.array(self.shift) - np.array(second.shift)).max() / extent
        return self.names == second.names and bool(max(turned, shifted) < SAME_PLACE)

    @property
    def turns(self) -> bool:
        """Tell whether the motion turns the body."""
        return any(row[i] != 1.0 for i, row in enumerate(self.rotation))

    def image(self, x: np.ndarray) -> np.ndarray:
        """Return where the motion takes points [length], shape (..., d)."""
        moved: np.ndarray = x @ np.array(self.rotation).T + np.array(self.shift)
        return moved


def translated(mesh: NamedMesh, here: str, there: str) -> PeriodicPair:
    """Pair two parts by the translation between their centres; collective.

    Args:
        mesh: The mesh.
        here: Name of a part of the boundary.
        there: Name of the part onto which the translation takes it.

    Example:
        >>> nm.translated(block, "left", "right").shift
        (2.0, 0.0)
    """
    shift = _centre(mesh, there) - _centre(mesh, here)
    shift[abs(shift) < SAME_PLACE * mesh.extent] = 0.0
    rows = tuple(map(tuple, np.eye(mesh.dim).tolist()))
    return PeriodicPair((here, there), rows, tuple(shift.tolist()))


def turned(
    mesh: NamedMesh, here: str, there: str, axis: Sequence[Sequence[float]], sectors: int
) -> PeriodicPair:
    """Pair two parts by a turn about an axis, a whole part of 360 degrees; collective.

    Args:
        mesh: The mesh.
        here: Name of a part of the boundary.
        there: Name of the part onto which the turn, in one sense or the other, takes
            it.
        axis: A point of the axis [length] and, in 3D, its direction.
        sectors: Number of turns that bring the body back, > 1.

    Example:
        >>> quarter = nm.turned(block, "left", "bottom", [(0.0, 0.0)], 4)
        >>> quarter.rotation
        ((0.0, 1.0), (-1.0, 0.0))
    """
    d = mesh.dim
    origin = np.array(axis[0], dtype=float)
    along = np.array(axis[1], dtype=float) if d == 3 else np.array([0.0, 0.0, 1.0])
    along /= np.linalg.norm(along)
    cross = np.cross(np.eye(3), along).T
    first, second = (_centre(mesh, name) for name in (here, there))
    turns = []
    for angle in (2 * np.pi / sectors, -2 * np.pi / sectors):
        rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        rotation = rotation[:d, :d]
        rotation[abs(rotation) < ROUND_OFF] = 0.0
        shift = origin - rotation @ origin
        away = np.linalg.norm(rotation @ first + shift - second)
        turns.append((float(away), rotation, shift))
    _, rotation, shift = min(turns, key=lambda turn: turn[0])
    rows = tuple(map(tuple, (rotation + 0.0).tolist()))
    placed = (tuple(origin.tolist()), tuple(along.tolist())) if d == 3 else None
    return PeriodicPair((here, there), rows, tuple((shift + 0.0).tolist()), placed)


Facing = tuple[np.ndarray, np.ndarray]
"""Sides of the first part of a pair, and the sides of the second part they face."""


def facing_sides(mesh: NamedMesh, pair: PeriodicPair) -> Facing:
    """Find which sides of both parts face each other on this rank; collective.

    Args:
        mesh: The mesh.
        pair: The pair.

    Raises:
        InputError: If a facet has no partner of its form.
    """
    sides = [mesh.facets(name) for name in pair.names]
    here, there = (_corners(mesh, of_part) for of_part in sides)
    reach = SAME_PLACE * mesh.extent
    partner = _nearest(pair.image(here.mean(axis=1)), there.mean(axis=1), reach)
    found = np.flatnonzero(partner >= 0)
    away = pair.image(here[found])[:, :, None] - there[partner[found], None]
    # Each corner of a facet has a corner of its partner at its image.
    fits = (np.linalg.norm(away, axis=-1).min(axis=2) <= reach).all(axis=1)
    first, second = found[fits], partner[found[fits]]
    counts = []
    for of_part, chosen in zip(sides, (first, second), strict=True):
        is_owned = of_part[:, 0] < mesh.owned_cells
        counts += [is_owned.sum(), is_owned[chosen].sum()]
    here_count, here_found, there_count, there_found = mesh.comm.allreduce(np.array(counts))
    if here_count > here_found or there_count > there_found:
        name, against = pair.names
        raise InputError(
            f"{name!r} and {against!r} do not match: {here_count - here_found} of {here_count}"
            f" facets of {name!r} and {there_count - there_found} of {there_count} facets of"
            f" {against!r} have no facet at their image. Mesh both sides alike: rectangle or box"
            " with cells=, or gmsh's setPeriodic for the curves or surfaces of both sides. Or cut"
            f" both at common points: domain.matched([nm.translated(domain, {name!r},"
            f" {against!r})]), or nm.turned. Refine joined bodies by marking, strategy=ec.Mark()."
            " And look whether the motion from one onto the other is meant."
        )
    return sides[0][first], sides[1][second]


def across(mesh: NamedMesh, pairs: Sequence[PeriodicPair], given: np.ndarray | None = None) -> Any:
    """Return a partitioner that takes a point for the same as its image; collective.

    Args:
        mesh: The mesh.
        pairs: Its periodic pairs.
        given: Numbers that its nodes on this rank have in what will be distributed; by
            default their global numbers.
    """
    if given is None:
        count = len(mesh.mesh.geometry.x)
        given = global_numbers(mesh.mesh.geometry.index_map(), np.arange(count))
    nodes = cell_nodes(mesh.mesh.geometry)
    links = []
    for pair in pairs:
        tables = []
        for name in pair.names:
            sides = mesh.owned_facets(name)
            local = np.unique(of_facets(nodes[sides[:, 0]], sides[:, 1]))
            x = mesh.mesh.geometry.x[local, : mesh.dim]
            numbers, x = of_all(mesh.comm, given[local], x)
            numbers, first = np.unique(numbers, return_index=True)
            tables.append((numbers, x[first]))
        (numbers, x), (images, x_there) = tables
        partner = _nearest(pair.image(x), x_there, SAME_PLACE * mesh.extent)
        found = partner >= 0
        links.append(np.column_stack([numbers[found], images[partner[found]]]))
    numbers, places = np.unique(np.concatenate(links), return_inverse=True)
    least = components(len(numbers), places.reshape(-1, 2))
    return partial(vertex_patch_partitioner, same=(numbers, numbers[least]))


def close_alike(
    mesh: dmesh.Mesh, edges: np.ndarray, lengths: np.ndarray, links: Sequence[np.ndarray]
) -> np.ndarray:
    """Return the edges that bisection splits, alike on both sides; collective.

    A triangle with an edge that is split has its longest edge split, as DOLFINx's
    bisection has it, and so has its image.

    Args:
        mesh: The mesh, with its edges.
        edges: Numbers of edges that are to be split, shape (n,).
        lengths: Lengths that decide on the longest edge, of all edges of this rank.
        links: Numbers of edges of this rank and of their images, shape (m, 2) each.
    """
    mesh.topology.create_entities(2)
    mesh.topology.create_connectivity(2, 1)
    triangles = mesh.topology.connectivity(2, 1).array.reshape(-1, 3)
    longest = triangles[np.arange(len(triangles)), lengths[triangles].argmax(axis=1)]
    split = la.vector(mesh.topology.index_map(1), dtype=np.float64)
    split.array[:] = 0.0
    split.array[edges] = 1.0
    while True:
        before = split.array.copy()
        split.array[longest[split.array[triangles].any(axis=1)]] = 1.0
        for link in links:
            split.array[link[split.array[link].any(axis=1)]] = 1.0
        # Other ranks know of other triangles and sides at these edges.
        split.scatter_reverse(la.InsertMode.add)
        split.array[:] = split.array > 0
        split.scatter_forward()
        changes = bool((split.array != before).any())
        if not lasting(mesh.comm).allreduce(changes, MPI.LOR):
            return np.flatnonzero(split.array).astype(np.int32)


def linked_edges(mesh: NamedMesh, pair: PeriodicPair, facing: Facing) -> np.ndarray:
    """Return the edges of facing sides, each with its image, shape (n, 2)."""
    d = mesh.dim
    mesh.mesh.topology.create_entities(1)
    mesh.mesh.topology.create_connectivity(d - 1, 1)
    mesh.mesh.topology.create_connectivity(1, d)
    x = mesh.mesh.geometry.x[:, :d]
    edges = []
    middles = []
    for sides in facing:
        facets = facets_of_cells(mesh.mesh)[sides[:, 0], sides[:, 1]]
        of_sides = facets[:, None]
        if d == 3:
            of_sides = mesh.mesh.topology.connectivity(2, 1).array.reshape(-1, 3)[facets]
        ends = dmesh.entities_to_geometry(mesh.mesh, 1, of_sides.ravel().astype(np.int32))
        edges.append(of_sides)
        middles.append(x[ends].mean(axis=1).reshape(*of_sides.shape, d))
    here, there = middles
    away = np.linalg.norm(pair.image(here)[:, :, None] - there[:, None], axis=-1)
    partner = np.take_along_axis(edges[1], away.argmin(axis=2), axis=1)
    return np.column_stack([edges[0].ravel(), partner.ravel()])


def twisted(x: np.ndarray, axis: tuple[tuple[float, ...], ...]) -> np.ndarray:
    """Return points moved a little, alike around an axis [length], shape (..., 3).

    No two edges of a structured mesh are then of one length, and an edge and its image
    still are.

    Args:
        x: Points [length], shape (..., 3).
        axis: A point of the axis [length], and its direction, a unit vector.
    """
    origin, along = (np.array(row) for row in axis)
    height = (x - origin) @ along
    from_axis = x - origin - height[..., None] * along
    radius = np.linalg.norm(from_axis, axis=-1)
    outward = from_axis / np.maximum(radius, np.finfo(float).tiny)[..., None]
    around = np.cross(along, outward)
    moves = np.stack([radius, height], axis=-1) @ TWIST
    return x + moves[..., :1] * outward + moves[..., 1:2] * along + moves[..., 2:] * around


def _centre(mesh: NamedMesh, name: str) -> np.ndarray:
    """Return the centre of a part [length], shape (d,); collective."""
    sides = mesh.owned_facets(name)
    areas = mesh.flat_areas(sides)
    local = np.append(areas @ _corners(mesh, sides).mean(axis=1), areas.sum())
    total: np.ndarray = mesh.comm.allreduce(local)
    return total[:-1] / total[-1]


def _corners(mesh: NamedMesh, sides: np.ndarray) -> np.ndarray:
    """Return the corners of sides [length], shape (n, d, d)."""
    nodes = of_facets(cell_nodes(mesh.mesh.geometry)[sides[:, 0]], sides[:, 1])
    corners: np.ndarray = mesh.mesh.geometry.x[nodes, : mesh.dim]
    return corners


def _nearest(x: np.ndarray, among: np.ndarray, reach: float) -> np.ndarray:
    """Return the number of the nearest point within reach of each point, -1 without."""
    from scipy.spatial import cKDTree  # type: ignore[import-untyped]  # noqa: PLC0415 - for pairs only

    if len(among) == 0:
        return np.full(len(x), -1)
    distance, number = cKDTree(among).query(x)
    return np.where(distance <= reach, number, -1)
