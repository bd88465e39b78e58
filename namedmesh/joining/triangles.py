"""Compute edges, areas and angles of triangles."""

from __future__ import annotations

import numpy as np


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Compute cross products of vectors in the plane, shape (..., 2) -> (...)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def edge_lengths(x: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Compute the lengths of edges [length], shape (k,).

    Args:
        x: Points [length], shape (n, d).
        edges: Both ends of each edge, shape (k, 2).
    """
    return np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)


def shortest_edges(x: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Compute the length of the shortest edge at each point [length], shape (n,).

    It is infinite at points of no edge. See :func:`edge_lengths`.
    """
    sizes = np.full(len(x), np.inf)
    np.minimum.at(sizes, edges, edge_lengths(x, edges)[:, None])
    return sizes


def side_lengths(corners: np.ndarray) -> np.ndarray:
    """Compute the lengths of the sides of triangles (m, 3, d) [length], (m, 3)."""
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)


def area_vectors(corners: np.ndarray) -> np.ndarray:
    """Return the normals of triangles, twice as long as their areas [length^2].

    Args:
        corners: Corners [length], shape (..., 3, 3).
    """
    first = corners[..., 1, :] - corners[..., 0, :]
    second = corners[..., 2, :] - corners[..., 0, :]
    return np.cross(first, second)


def kept_areas(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the share of its area that each triangle keeps when its corners move [-].

    A triangle that is turned over has a negative share.

    Args:
        before: Corners [length], shape (m, 3, 3).
        after: The same corners at their new places.
    """
    normals = area_vectors(before)
    kept = np.einsum("ij,ij->i", normals, area_vectors(after))
    return kept / np.einsum("ij,ij->i", normals, normals)


def least_angle(corners: np.ndarray) -> float:
    """Return the least angle of triangles [degrees].

    Args:
        corners: Corners [length], shape (m, 3, 3).
    """
    area = np.linalg.norm(area_vectors(corners), axis=-1)
    lengths = np.sort(side_lengths(corners), axis=1)
    # The least angle lies between the two longest edges.
    sine = area / (lengths[:, 1] * lengths[:, 2])
    return float(np.degrees(np.arcsin(np.clip(sine, 0.0, 1.0))).min(initial=60.0))


def edges_of(triangles: np.ndarray) -> np.ndarray:
    """Return the edges of triangles (m, 3) in their direction, shape (3 m, 2)."""
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
