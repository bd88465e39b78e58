"""Know the tip of a crack: its place, the given strain there, the weight of its faces.

What differs between a tip in the plane and a ring of tips is here.
"""

from __future__ import annotations

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.error.goals.ring_strain import RingStrain, ring_coefficients
from erc_contact.error.goals.singular_strain import SingularStrain
from erc_contact.error.goals.tip_series import Series, plane_field, ring_fields
from erc_contact.model.space import Space
from erc_contact.scene.goal import StressIntensity
from namedmesh.base.ranks import of_all
from namedmesh.for_solvers import boundary_sides

ON_LINE = 1e-6
"""Distance over the radius up to which facets are on the line of the crack [-]."""
LARGEST_TURN = 0.2
"""Greatest angle between the given direction and the last facet of a crack."""
Weight = tuple[Series, Series]
"""Type of a vector in the frame of the mesh: series of places in the frame of a tip."""


class Tip:
    """Know a tip of a crack in the plane.

    Args:
        goal: What is asked.
        direction: Direction in which the crack points, shape (2,).

    Attributes:
        forward: Unit vector in which the crack points, shape (2,).
        aside: Unit vector at a right angle to the left of it, shape (2,).
        length: Length of the front of the crack; 1 in the plane [length].
        bounds: What bounds the body, in words.
        may_bend: Whether the crack may bend within the radius.
        bending: How far it may bend, in words.
    """

    bounds = "the boundary of the body"
    may_bend = True
    bending = "within which a crack that bends goes on away from its tip"

    def __init__(self, goal: StressIntensity, direction: np.ndarray) -> None:
        self.goal = goal
        self.forward = direction / np.linalg.norm(direction)
        self.aside = np.array([-self.forward[1], self.forward[0]])
        self.length = 1.0

    def at(self, x: np.ndarray) -> np.ndarray:
        """Return places along the direction and aside [length], shape (..., 2)."""
        to = x - np.array(self.goal.tip)
        return np.stack([to @ self.forward, to @ self.aside], axis=-1)

    def near(self, corners: np.ndarray) -> np.ndarray:
        """Tell which segments, shape (n, 2, 2), have points within the radius, (n,)."""
        return distances(self.at(corners)) < self.goal.radius * (1 - ON_LINE)

    def kappa(self, compliance: np.ndarray) -> float:
        """Return Kolosov's constant of C^-1 of an isotropic material, shape (s, s)."""
        # C^-1 has (kappa + 1)/(8 mu) first.
        return float(4 * compliance[0, 0] / (compliance[0, 0] - compliance[0, 1]) - 1)

    def strain(self, kappa: float) -> SingularStrain:
        """Return the given strain G."""
        goal = self.goal
        tip_x, tip_y = goal.tip
        c, s = self.forward.tolist()
        return SingularStrain(goal.mode, 1.0, tip_x, tip_y, c, s, goal.radius, kappa)

    def weight(self, kappa: float) -> Weight:
        """Return what the factor has of tractions on the faces, ``- E'/2 u-``.

        Tractions of rings are times the circumference.
        """
        w = -2 / (kappa + 1) * plane_field(self.goal.mode, kappa)
        # A complex number has its components along the crack and aside.
        forward = complex(*self.forward)
        return (forward * w).real(), (-1j * forward * w).real()


class RingTip(Tip):
    """Know a ring of tips of a body of revolution."""

    bounds = "the boundary of the body or its axis"
    may_bend = False
    bending = "within which a crack that bends is straight"

    def __init__(self, goal: StressIntensity, direction: np.ndarray) -> None:
        super().__init__(goal, direction)
        self.length = 2 * np.pi * goal.tip[0]

    def kappa(self, compliance: np.ndarray) -> float:
        """Return Kolosov's constant of plane strain, see :meth:`.Tip.kappa`."""
        return float(3 + 4 * compliance[0, 1] / compliance[0, 0])

    def strain(self, kappa: float) -> SingularStrain:
        """Return the given strain G of rings."""
        coefficients = ring_coefficients(self.goal.mode, (3 - kappa) / 4, *self.forward.tolist())
        return RingStrain(**vars(super().strain(kappa)), coefficients=coefficients)

    def weight(self, kappa: float) -> Weight:
        """Return the weight with what the ring adds, see :meth:`.Tip.weight`."""
        R = self.goal.tip[0]
        radial = complex(self.forward[0], self.aside[0])
        fields = ring_fields(self.goal.mode, (3 - kappa) / 4, radial)
        weights = []
        for plane, of_ring in zip(super().weight(kappa), fields.w, strict=True):
            in_lengths = {
                powers: c * R ** (-0.5 - sum(powers)) for powers, c in of_ring.terms.items()
            }
            whole = plane + -2 / (kappa + 1) * Series(in_lengths)
            weights.append(1 / self.length * whole)
        return weights[0], weights[1]


def distances(ends: np.ndarray) -> np.ndarray:
    """Return the distances of segments (n, 2, 2) from the tip in its frame [length]."""
    first = ends[:, 0]
    along = ends[:, 1] - first
    share = -(first * along).sum(axis=1) / (along**2).sum(axis=1)
    return np.asarray(np.linalg.norm(first + np.clip(share, 0, 1)[:, None] * along, axis=1))


def tip_of(space: Space, goal: StressIntensity) -> Tip:
    """Return the tip of a goal; collective."""
    kind = RingTip if space.axisymmetric else Tip
    return kind(goal, _direction(space, goal))


def boundary_ends(space: Space) -> np.ndarray:
    """Return the ends of facets of the boundary of this rank [length], (n, 2, 2)."""
    facets = dmesh.exterior_facet_indices(space.mesh.topology)
    return space.facet_corners(np.column_stack(boundary_sides(space.mesh, facets)))


def _direction(space: Space, goal: StressIntensity) -> np.ndarray:
    """Return the direction of the facets at a tip, or what is given; collective.

    It is theirs if it is nearly the given direction: along a curve the last facet has a
    direction of its own on each mesh.
    """
    given = np.array(goal.direction) / np.linalg.norm(goal.direction)
    ends = boundary_ends(space) - np.array(goal.tip)
    is_tip = np.linalg.norm(ends, axis=2) <= ON_LINE * goal.radius
    at_tip = np.concatenate([-ends[is_tip[:, 0], 1], -ends[is_tip[:, 1], 0]])
    (ways,) = of_all(space.comm, at_tip)
    ways = ways / np.linalg.norm(ways, axis=1)[:, None]
    turns = np.linalg.norm(ways - given, axis=1)
    if turns.min(initial=np.inf) > LARGEST_TURN:
        return given
    return ways[turns.argmin()]
