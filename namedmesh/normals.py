"""Find the normals of a curved side at the vertices of its flat facets.

Each facet of a mesh has one normal, but the surface between the vertices turns. Where
the true surface is not known, it is estimated from the vertices. If all of them lie on
one quadric (a circle, a sphere, a cylinder, a cone ...), its normals are taken.
Otherwise a vertex has the mean of the normals of the facets around it. Facets that meet
at a sharp edge have a mean of their own on each side of the edge.

Symbols: f facets, d dimension, R radius of curvature, h size of a facet.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from namedmesh.base.ranks import box, distinct_rows, of_all
from namedmesh.graphs import components
from namedmesh.rows import equal_rows
from namedmesh.simplex import facet_vertices

SHARP = np.cos(np.radians(40.0))
"""Cosine of the angle between two facets beyond which their common edge is sharp."""
ON_QUADRIC = 1e-10
"""Distance of vertices from a quadric that counts as none, over the extent [-]."""
AMONG = 32
"""Corners of facets among which vertices are counted, over the number wanted [-]."""
UNIQUE_QUADRIC = 1e-5
"""Least distance of the vertices from any second quadric, over the extent [-]."""


def spread(comm: MPI.Comm, normals: np.ndarray) -> float:
    """Return by how much components of unit normals differ, at most; collective.

    Args:
        comm: The ranks.
        normals: Normals of this rank, shape (n, d).
    """
    low, high = box(comm, normals)
    return float((high - low).max())


def vertex_normals(
    comm: MPI.Comm, corners: np.ndarray, vertices: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Estimate the unit normals of a side at the vertices of its facets; collective.

    A facet is complete on a rank that has all facets around its vertices. Normals of
    other facets may be normals of a smaller side.

    Args:
        comm: The ranks.
        corners: Vertices of each facet [length], shape (f, d, d).
        vertices: Their numbers on this rank, shape (f, d).
        normals: Unit normals of the facets, out of the body, shape (f, d).

    Returns:
        Shape (f, d, d): facet, vertex, component.
    """
    means = _means(corners, vertices, normals)
    of_quadric = _quadric_normals(comm, corners)
    if of_quadric is None:
        return means
    # A quadric has two sides, and no normal where two of its planes cross.
    cosine = np.einsum("fid,fd->fi", of_quadric, normals)
    is_normal = abs(cosine) > SHARP
    outward = np.copysign(1.0, cosine)[..., None] * of_quadric
    return np.where(is_normal[..., None], outward, means)


def _means(corners: np.ndarray, vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return weighted means of facet normals at the vertices of facets, (f, d, d).

    In the plane the weight is one over the length of a facet, which is exact on a
    circle with facets of any lengths. In 3D it is the angle of a facet at the
    vertex, which does not depend on how a flat piece is cut into triangles.
    """
    f, d = normals.shape
    if f == 0:
        return np.zeros((0, d, d))
    cluster = components(f * d, _smooth_links(vertices, normals))
    weighted = (_weights(corners)[..., None] * normals[:, None]).reshape(f * d, d)
    total = np.zeros((f * d, d))
    np.add.at(total, cluster, weighted)
    means = total / np.maximum(np.linalg.norm(total, axis=1), np.finfo(float).tiny)[:, None]
    result = means[cluster].reshape(f, d, d)
    if d == 2:
        # At the end of a curve the normal turns on as before: on a circle exactly.
        size = np.bincount(cluster, minlength=f * d)[cluster].reshape(f, d)
        other_end = result[:, ::-1]
        along = np.einsum("fid,fd->fi", other_end, normals)
        mirrored = 2 * along[..., None] * normals[:, None] - other_end
        result = np.where((size == 1)[..., None], mirrored, result)
    return result


def _smooth_links(vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the pairs of facet corners that lie at one vertex of a smooth surface.

    Corner i of facet f has the number ``f d + i``. Two facets that meet at an edge (in
    the plane at a vertex) which is not sharp link their corners there. Shape (n, 2).
    """
    f, d = vertices.shape
    edges = facet_vertices(d - 1)
    numbers = vertices[:, edges]
    order = np.argsort(numbers, axis=2)
    numbers = np.take_along_axis(numbers, order, axis=2).reshape(f * d, d - 1)
    of_facets = np.take_along_axis(np.broadcast_to(edges, order.shape), order, axis=2)
    corner = (of_facets + d * np.arange(f)[:, None, None]).reshape(f * d, d - 1)
    facet = np.repeat(np.arange(f), d)
    first, second = equal_rows(numbers)
    cosine = np.einsum("nd,nd->n", normals[facet[first]], normals[facet[second]])
    smooth = cosine > SHARP
    links = np.stack([corner[first[smooth]], corner[second[smooth]]], axis=-1)
    return links.reshape(-1, 2)


def _weights(corners: np.ndarray) -> np.ndarray:
    """Return the weight of each facet at each of its vertices, shape (f, d)."""
    to_next = np.roll(corners, -1, axis=1) - corners
    length = np.linalg.norm(to_next, axis=2)
    if corners.shape[2] == 2:
        return 1 / length
    from_last = np.roll(to_next, 1, axis=1)
    cosine = -np.einsum("fid,fid->fi", from_last, to_next) / (np.roll(length, 1, axis=1) * length)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _quadric_normals(comm: MPI.Comm, corners: np.ndarray) -> np.ndarray | None:
    """Return unit normals of the quadric through all vertices, or None; collective.

    The quadric is ``y.A y + b.y + c = 0`` in coordinates y of the unit box. It is the
    last singular vector of the monomials at the vertices; each rank reduces its rows to
    a triangle first. The sign of the normals is open. Shape (f, d, d).
    """
    d = corners.shape[2]
    points = corners.reshape(-1, d)
    low, high = box(comm, points)
    scale = float((high - low).max()) / 2
    y = (points - (low + high) / 2) / scale
    first, second = np.triu_indices(d)
    rows = np.column_stack([y[:, first] * y[:, second], y, np.ones(len(y))])
    # Few vertices lie on a quadric by chance.
    enough = 2 * rows.shape[1]
    some = np.unique(rows[: AMONG * enough], axis=0)[:enough]
    if len(distinct_rows(comm, some)) < enough:
        return None
    (triangles,) = of_all(comm, np.linalg.qr(rows, mode="r"))
    _, sizes, vectors = np.linalg.svd(triangles)
    is_unique = sizes[-2] > UNIQUE_QUADRIC * sizes[0]
    if not is_unique or sizes[-1] > ON_QUADRIC * sizes[-2]:
        return None
    quadric = vectors[-1]
    matrix = np.zeros((d, d))
    matrix[first, second] = quadric[: len(first)]
    gradient = y @ (matrix + matrix.T) + quadric[len(first) : len(first) + d]
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    unit = np.divide(gradient, length, out=np.zeros_like(gradient), where=length > 0)
    return unit.reshape(corners.shape)
