"""Make two bricks on each other whose facets at the contact face each other."""

from __future__ import annotations

from functools import cache
from typing import Any

import erc_contact as ec
from namedmesh.base.releases import cell_nodes

import basix.ufl  # isort: skip - after erc_contact, which loads MPI first
import numpy as np
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.partition import partitioner
from namedmesh.tags import tags_of

SIDES = {0: ("left", "right"), 1: ("front", "back")}
"""Names of the sides across the first axes, at -1 and at 1."""
NAMES = ("upper contact", "lower contact")


def bricks(d: int, cells: tuple[int, ...], **shape: Any) -> ec.Domain:
    """Make two bricks of width 2 that touch at height zero; collective.

    The two sides of the contact are boundary parts. See :func:`glued` for the
    arguments.
    """
    return glued(d, cells, **shape).split(dict(zip(NAMES, ("upper", "lower"), strict=True)))


@cache
def small_bricks(d: int) -> ec.Domain:
    """Make the bricks of most tests: 32 triangles or 48 tetrahedra; collective."""
    return bricks(d, (4, 2) if d == 2 else (2, 2, 1))


def glued(
    d: int,
    cells: tuple[int, ...],
    *,
    heights: tuple[float, float] = (1.0, 1.0),
    size: float = 1.0,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> ec.Domain:
    """Make the same bricks before they are split, two regions of a body; collective.

    The mesh is irregular. In the upper brick it mirrors the mesh of the lower brick, so
    with equal heights the bodies are equal. The boundary parts are "upper left", ...,
    "upper outer" (its top) and "lower outer" (its bottom).

    Args:
        d: Dimension.
        cells: Number of cuboids of one brick along each axis.
        heights: Heights of the upper and of the lower brick.
        size: Unit of length.
        comm: Communicator that shares the mesh.
    """
    x = np.zeros((0, d))
    simplices = np.zeros((0, d + 1), dtype=np.int64)
    if comm.rank == 0:
        x, simplices = _mirrored(*_lower(d, cells))
        x[:, -1] *= np.where(x[:, -1] > 0, *heights)
        x *= size
    return _named(d, x, simplices, comm, size)


PAIRS = {
    3: (("a", "b"), ("a", "c"), ("b", "c")),
    4: (("a", "b"), ("a", "c"), ("b", "d"), ("c", "d")),
}
"""Which bodies touch where three or four of them meet."""


def joint(d: int, count: int = 3, cells: int = 4) -> ec.Domain:
    """Make two bodies a and b side by side, on one body c, or on c and d; collective.

    They meet at x = 1, at half of the height 2. The side of body a at its contact with
    b is called "ab", the other one "ba".

    Args:
        d: Dimension.
        count: Number of bodies, 3 or 4.
        cells: Number of cuboids along the width and the height, an even one.
    """
    make = ec.rectangle if d == 2 else ec.box
    high = (2.0, 2.0) if d == 2 else (2.0, 0.5, 2.0)
    block = make((0.0,) * d, high, cells=(cells, cells) if d == 2 else (cells, 1, cells))
    tags = block.facet_tags
    middle = dmesh.compute_midpoints(block.mesh, d - 1, tags.indices)
    names = {**block.names, "top of a": 1 + max(block.names.values())}
    is_top_of_a = (tags.values == names["top"]) & (middle[:, 0] < 1)
    values = np.where(is_top_of_a, names["top of a"], tags.values).astype(np.int32)

    numbers = _every(block.mesh, d)
    x = dmesh.compute_midpoints(block.mesh, d, numbers)
    upper = np.where(x[:, 0] < 1, 1, 2)
    lower = np.where(x[:, 0] < 1, 3, count)
    body = np.where(x[:, d - 1] > 1, upper, lower).astype(np.int32)
    bodies = ec.Domain(
        block.mesh,
        tags_of(block.mesh, d - 1, tags.indices, values),
        names,
        tags_of(block.mesh, d, numbers, body),
        dict(zip("abcd", range(1, count + 1), strict=False)),
    )
    for both in PAIRS[count]:
        one, other = both[0], both[1]
        bodies = bodies.split({one + other: one, other + one: other})
    return bodies


def lower_brick(d: int, cells: tuple[int, ...], comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    """Make the lower brick; its part at height zero is "lower contact"; collective."""
    x = np.zeros((0, d))
    simplices = np.zeros((0, d + 1), dtype=np.int64)
    if comm.rank == 0:
        x, simplices = _lower(d, cells)
    return _named(d, x, simplices, comm, 1.0)


def _lower(d: int, cells: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return points and simplices of the lower brick, its inner nodes moved."""
    make = ec.rectangle if d == 2 else ec.box
    low, high = [-1.0] * d, [1.0] * (d - 1) + [0.0]
    mesh = make(low, high, cells=cells, comm=MPI.COMM_SELF).mesh
    x = mesh.geometry.x[:, :d].copy()
    step = (np.array(high) - low) / cells
    inside = (x > np.array(low) + 1e-9) & (x < np.array(high) - 1e-9)
    move = np.random.default_rng(5).uniform(-0.2, 0.2, x.shape)
    return x + np.where(inside, move * step, 0.0), cell_nodes(mesh.geometry).astype(np.int64)


def _mirrored(x: np.ndarray, simplices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add the mirror image at height zero, where both share the points."""
    at_mirror = abs(x[:, -1]) < 1e-9
    number = np.where(at_mirror, np.arange(len(x)), len(x) + np.cumsum(~at_mirror) - 1)
    image = x[~at_mirror] * np.append(np.ones(x.shape[1] - 1), -1.0)
    return np.vstack([x, image]), np.vstack([simplices, number[simplices]])


def _named(d: int, x: np.ndarray, simplices: np.ndarray, comm: MPI.Comm, size: float) -> ec.Domain:
    """Make a domain from points and simplices on rank 0, with names by positions."""
    shape = ("triangle", "tetrahedron")[d - 2]
    element = ufl.Mesh(basix.ufl.element("Lagrange", shape, 1, shape=(d,)))
    mesh = dmesh.create_mesh(comm, simplices, element, x, partitioner(comm))
    mesh.topology.create_connectivity(d - 1, d)
    facets = _every(mesh, d - 1)
    middle = dmesh.compute_midpoints(mesh, d - 1, facets)[:, :d] / size
    height = middle[:, -1]
    outer = np.zeros(len(facets), dtype=bool)
    outer[dmesh.exterior_facet_indices(mesh.topology)] = True
    top = comm.allreduce(height.max(initial=-9.0), MPI.MAX)
    bottom = comm.allreduce(height.min(initial=9.0), MPI.MIN)
    tags = np.zeros(len(facets), dtype=np.int32)
    names: dict[str, int] = {}
    for body, sign, end in (("lower", -1, bottom), ("upper", 1, top)):
        of_body = sign * height > 1e-9
        for axis in range(d - 1):
            for name, at in zip(SIDES[axis], (-1.0, 1.0), strict=True):
                names[f"{body} {name}"] = len(names) + 1
                tags[of_body & (abs(middle[:, axis] - at) < 1e-9)] = len(names)
        names[f"{body} outer"] = len(names) + 1
        tags[of_body & (abs(height - end) < 1e-9)] = len(names)
    names["lower contact"] = len(names) + 1
    tags[outer & (abs(height) < 1e-9)] = len(names)
    counts = {name: comm.allreduce(int((tags == tag).sum())) for name, tag in names.items()}
    names = {name: tag for name, tag in names.items() if counts[name]}
    cells = _every(mesh, d)
    upper = dmesh.compute_midpoints(mesh, d, cells)[:, d - 1] > 0
    regions = {"lower": 1, "upper": 2} if top > 1e-9 else {"lower": 1}
    return ec.Domain(
        mesh,
        tags_of(mesh, d - 1, facets[tags > 0], tags[tags > 0]),
        names,
        tags_of(mesh, d, cells, np.where(upper, 2, 1).astype(np.int32)),
        regions,
    )


def _every(mesh: dmesh.Mesh, dim: int) -> np.ndarray:
    """Return all entities of a dimension on this rank."""
    mesh.topology.create_entities(dim)
    index_map = mesh.topology.index_map(dim)
    return np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
