"""Hold the set of tangential tractions that friction allows: a disc, or an ellipse.

A friction law allows the tractions with ``gauge(r_t) <= b(p)``. Its slip adds ``b(p)
support(w_t) + r_t.w_t >= 0`` to the contact part of e^2, where ``support(w)`` is the
greatest work ``w.t`` of all t of gauge 1. The term is zero where r_t has the gauge b(p)
and is opposite to ``opposing(w_t)``. For a disc gauge and support are lengths, and
``opposing(w)`` is w.

An ellipse is a disc in other coordinates. Let S stretch vectors along the second axis c
by ``1/ratio``. Then ``S r`` and ``S^-1 w`` have the work of r and w, and the law of a
disc: ``gauge(r) = |S r|``, ``support(w) = |S^-1 w|``, and ``opposing(w)`` is along
``S^-2 w``. So algorithms that project tractions in coordinates in which the set is a
disc need not know of ellipses. Nothing in the theorem needs a disc: the set must be
convex, so its gauge must be, and ``|S r|`` is convex for any map S.

Symbols: n unit normal of the contact, a first axis of an ellipse and c second axis,
both unit vectors in the tangent plane; r traction, w slip; f facets, q points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.trace import ALL, Facets, lengths, tangents


class Disc:
    """Hold the disc ``|r_t| <= b`` of isotropic friction.

    Members get vectors at points of facets (n, q, d), unit normals there (n, q or 1, d)
    and the numbers of the facets in the contact, all of them by default. Normal parts
    of vectors stay as they are.

    Example:
        >>> law = solution.model.contacts[0].friction_set
        >>> law.gauge(np.array([[[3.0, 0.0, 4.0]]]), np.array([[[0.0, 1.0, 0.0]]]))
        array([[5.]])
    """

    is_disc = True
    """Whether friction is isotropic."""
    longest = 1.0
    """Longest semi-axis of the set of bound 1 [-]."""
    is_of_mesh = False
    """Whether another mesh has another set."""

    def to_disc(self, r: np.ndarray, n: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return ``S r``: tractions in coordinates in which the set is a disc."""
        return r

    def from_disc(self, r: np.ndarray, n: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return ``S^-1 r``, which takes slips to these coordinates, too."""
        return r

    def gauge(self, r_t: np.ndarray, n: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return the friction bound that tangential tractions need, shape (n, q)."""
        return lengths(self.to_disc(r_t, n, facet))

    def support(self, w_t: np.ndarray, n: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return the work on slips of the set of bound 1, shape (n, q)."""
        return lengths(self.from_disc(w_t, n, facet))

    def opposing(self, w: np.ndarray, n: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return vectors opposite to the friction of slips [length], (n, q, d)."""
        return w

    def semi_axes(self, n: np.ndarray, facet: Facets = ALL) -> list[np.ndarray]:
        """Return d - 1 tangential vectors, the semi-axes of the set of bound 1."""
        return [self.from_disc(tangent, n, facet) for tangent in self.tangents(n, facet)]

    def dual_axes(self, n: np.ndarray, facet: Facets = ALL) -> list[np.ndarray]:
        """Return d - 1 tangential vectors; ``S r`` has their products with r."""
        return [self.to_disc(tangent, n, facet) for tangent in self.tangents(n, facet)]

    def tangents(self, n: np.ndarray, facet: Facets = ALL) -> list[np.ndarray]:
        """Return d - 1 orthonormal tangents along the axes of the set."""
        return tangents(n)

    def gauge_in_ufl(self, r_t: Ufl, n: Ufl) -> Ufl:
        """Return :meth:`gauge`, UFL."""
        return ufl.sqrt(ufl.dot(r_t, r_t))

    def opposing_in_ufl(self, w: Ufl, n: Ufl) -> Ufl:
        """Return :meth:`opposing`, UFL."""
        return w


@dataclass(frozen=True, eq=False)
class Ellipse(Disc):
    """Hold the ellipse ``(r_t.a)^2 + (r_t.c/ratio)^2 <= b^2`` of orthotropic friction.

    Its axis a is the tangential part of a direction that the scene gives. numpy has one
    axis on each facet, which turns with normals that turn on it, as tractions do
    (:mod:`erc_contact.model.contact.turning`).

    Attributes:
        direction: The direction, UFL, shape (3,), of any length.
        normals: Unit normals in the middle of the facets, shape (f, 3).
        second_axes: The axes c there, shape (f, 3).
        ratio: Semi-axis along c over semi-axis along a [-], > 0.
        ratio_in_ufl: The same, UFL.
        is_of_mesh: Whether the direction varies, so that facets of another mesh have
            another one.
    """

    direction: Ufl
    normals: np.ndarray
    second_axes: np.ndarray
    ratio: float
    ratio_in_ufl: Ufl
    is_of_mesh: bool = False

    is_disc = False

    @property
    def longest(self) -> float:  # type: ignore[override]
        """Return the longest semi-axis of the set of bound 1 [-]."""
        return max(1.0, self.ratio)

    def to_disc(self, r: np.ndarray, n: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return ``S r``: tractions in coordinates in which the set is a disc."""
        return _stretched(r, self._second_axis(n, facet), 1 / self.ratio)

    def from_disc(self, r: np.ndarray, n: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return ``S^-1 r``, which takes slips to these coordinates, too."""
        return _stretched(r, self._second_axis(n, facet), self.ratio)

    def opposing(self, w: np.ndarray, n: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return vectors opposite to the friction of slips [length], (n, q, d).

        They do not depend on which of both axes the scene names first.
        """
        first, second = self.tangents(n, facet)
        return _stretched(_stretched(w, second, self.ratio), first, 1 / self.ratio)

    def tangents(self, n: np.ndarray, facet: Facets = ALL) -> list[np.ndarray]:
        """Return the axes a and c."""
        second = self._second_axis(n, facet)
        return [np.cross(second, n), second]

    def gauge_in_ufl(self, r_t: Ufl, n: Ufl) -> Ufl:
        """Return :meth:`gauge`, UFL."""
        stretched = _stretched_in_ufl(r_t, ufl.cross(n, self.direction), 1 / self.ratio_in_ufl)
        return ufl.sqrt(ufl.dot(stretched, stretched))

    def opposing_in_ufl(self, w: Ufl, n: Ufl) -> Ufl:
        """Return :meth:`opposing`, UFL."""
        second = ufl.cross(n, self.direction)
        stretched = _stretched_in_ufl(w, second, self.ratio_in_ufl)
        return _stretched_in_ufl(stretched, ufl.cross(second, n), 1 / self.ratio_in_ufl)

    def _second_axis(self, n: np.ndarray, facet: Facets) -> np.ndarray:
        """Return c, of the shape of n: turned as the middle normal is turned to n."""
        middle = self.normals[facet][:, None, :]
        axis = self.second_axes[facet][:, None, :]
        lean = (axis * n).sum(axis=-1, keepdims=True)
        share = lean / (1 + (middle * n).sum(axis=-1, keepdims=True))
        return axis - share * (middle + n)


class Whole(Disc):
    """Hold the set of all tangential tractions, whose slip is zero.

    A bound beyond reach stands for none. Work on the slip is zero, as the slip is.
    """

    def support(self, w_t: np.ndarray, n: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return zeros, shape (n, q)."""
        return np.zeros(w_t.shape[:-1])


DISC = Disc()
"""The set of isotropic friction, and of a contact without friction."""
WHOLE = Whole()
"""The set between copies of a body, which nothing draws apart."""


def _stretched(vectors: np.ndarray, axis: np.ndarray, factor: float) -> np.ndarray:
    """Stretch vectors (n, q, d) along unit vectors by a factor."""
    along = (vectors * axis).sum(axis=-1, keepdims=True)
    return vectors + (factor - 1) * along * axis


def _stretched_in_ufl(vector: Ufl, axis: Ufl, factor: Ufl) -> Ufl:
    """Stretch a vector along an axis of any length by a factor, UFL."""
    along = ufl.dot(vector, axis) / ufl.dot(axis, axis)
    return vector + (factor - 1) * along * axis
