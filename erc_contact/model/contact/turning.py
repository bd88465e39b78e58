"""Tractions on facets whose normals turn, from tractions on flat facets.

Let m be the normal in the middle of a facet, and N its linear field of normals. The
matrix

    R(N) = (m.N) I + N m^T - m N^T

turns m to N: ``R m = N``, and it takes a vector that is orthogonal to m to one that is
orthogonal to N, of at most the length |N|. So if z = -p m + tau lies in the cone of
friction about m, then ``r = R z`` has the pressure ``p |N|`` and friction of at most
``|tau| |N|``: it lies in the cone about N, at every point. R is linear in N. So a
polynomial z of degree k-1 gives an r of degree k, and whatever is done to z by convex
sets about one normal, holds for r about the normals that turn. Without friction r is a
pressure of degree k-1 along N; there is no other polynomial of degree k along N.

Symbols: k degree of r, f facets, m number of coefficients of r on a facet, l number of
coefficients of z, d dimension, q points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from erc_contact.model.contact.trace import Trace
from namedmesh.simplex import averages, barycentric, bernstein, node_vertices, rule


@dataclass(frozen=True, eq=False)
class Turning:
    """Turn tractions z about one normal of each facet to the normals at each point.

    Attributes:
        trace: The trace of a contact whose normals turn.
    """

    trace: Trace

    @property
    def degree(self) -> int:
        """Return the degree of z."""
        return self.trace.here.degree - 1

    @cached_property
    def _at_vertices(self) -> np.ndarray:
        """Return R at the vertices of the facets, shape (f, d, d, d)."""
        normals = self.trace.normals_at_vertices
        middle = self.trace.direction
        along = np.einsum("fi,fvi->fv", middle, normals)
        dyad = normals[..., :, None] * middle[:, None, None, :]
        return along[..., None, None] * np.eye(middle.shape[1]) + dyad - dyad.swapaxes(-1, -2)

    def tractions(self, z: np.ndarray) -> np.ndarray:
        """Return the coefficients of ``r = R z`` [force/area], shape (f, m, d).

        Args:
            z: Coefficients of z [force/area], shape (f, l, d).
        """
        first, second = node_vertices(self.trace.here.d - 1, self.degree + 1).T
        turns = self._at_vertices
        if self.degree == 0:
            return np.matmul(turns, z[..., None])[..., 0]
        # The product of the linear fields R and z, as a Bernstein polynomial.
        crossed = np.einsum("fmij,fmj->fmi", turns[:, first], z[:, second])
        crossed += np.einsum("fmij,fmj->fmi", turns[:, second], z[:, first])
        return crossed / 2

    def nearest(
        self, r: np.ndarray, points: np.ndarray, weights: np.ndarray, to_coefficients: np.ndarray
    ) -> np.ndarray:
        """Find z whose ``R z`` is near to tractions, and has their force on each facet.

        Args:
            r: Tractions at the points of a rule [force/area], shape (f, q, d).
            points: Its points, shape (q, d-1).
            weights: Its weights, of sum 1.
            to_coefficients: Matrix from values at the points to coefficients of the
                degree of z, shape (l, q).

        Returns:
            Coefficients of z [force/area], shape (f, l, d).
        """
        z = np.matmul(to_coefficients, self.back(r, points))
        # All Bernstein polynomials have the same integral.
        missing = weights @ r - self.tractions(z).mean(axis=1)
        mean_turn = self._at_vertices.mean(axis=1)
        return z + np.linalg.solve(mean_turn, missing[..., None])[:, None, :, 0]

    def back(self, r: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Turn vectors at points back, so that a normal becomes the middle normal.

        Args:
            r: Vectors, shape (f, q, d).
            points: Reference points of the facets, shape (q, d-1).

        Returns:
            ``R^T r / |N|^2``, the inverse in the plane. Shape (f, q, d).
        """
        places = barycentric(points)
        length = np.linalg.norm(np.matmul(places, self.trace.normals_at_vertices), axis=2)
        return self._transpose(r, places) / length[..., None] ** 2

    def means(self, motion: np.ndarray) -> np.ndarray:
        """Return the vectors on which z does the work that r does on a motion v.

        They are ``int R^T v B / int B`` for each Bernstein polynomial B of z.

        Args:
            motion: Coefficients of v, shape (f, m, d).

        Returns:
            Shape (f, l, d).
        """
        d = self.trace.here.d
        points, weights = rule(d - 1, 2 * self.degree + 2)
        average = averages(d - 1, self.degree, points, weights)
        at_points = np.matmul(bernstein(d - 1, self.degree + 1, points), motion)
        return np.matmul(average, self._transpose(at_points, barycentric(points)))

    def _transpose(self, values: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return ``R^T v`` at points in barycentric coordinates, shape (f, q, d)."""
        at_points = np.einsum("qv,fvij->fqij", places, self._at_vertices)
        return np.einsum("fqij,fqi->fqj", at_points, values)


def turning_of(trace: Trace) -> Turning | None:
    """Return how tractions turn on a contact, None where its normals do not turn."""
    return None if trace.corner_normals is None else Turning(trace)
