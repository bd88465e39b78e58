"""Know the tip of a crack: its place, the given strain there, the weight of its faces.

What differs between a tip in the plane and a ring of tips is here.
"""

from __future__ import annotations

import numpy as np

from erc_contact.error.goals.ring_strain import RingStrain, ring_coefficients
from erc_contact.error.goals.singular_strain import SingularStrain
from erc_contact.error.goals.tip_series import plane_field, ring_fields
from erc_contact.model.space import Space
from erc_contact.scene.goal import StressIntensity

ON_LINE = 1e-6
"""Distance over the radius up to which facets are on the line of the crack [-]."""
Weight = list[tuple[float, np.ndarray]]
"""Type of ``sum c rho^p``: the powers p, and c in the frame of the mesh, shape (2,)."""


class Tip:
    """Know a tip of a crack in the plane.

    Args:
        goal: What is asked.

    Attributes:
        forward: Unit vector in which the crack points, shape (2,).
        aside: Unit vector at a right angle to the left of it, shape (2,).
        length: Length of the front of the crack; 1 in the plane [length].
        bounds: What bounds the body, in words.
    """

    bounds = "the boundary of the body"

    def __init__(self, goal: StressIntensity) -> None:
        self.goal = goal
        self.forward = np.array(goal.direction) / np.linalg.norm(goal.direction)
        self.aside = np.array([-self.forward[1], self.forward[0]])
        self.length = 1.0

    def at(self, x: np.ndarray) -> np.ndarray:
        """Return places along the direction and aside [length], shape (..., 2)."""
        to = x - np.array(self.goal.tip)
        return np.stack([to @ self.forward, to @ self.aside], axis=-1)

    def near(self, corners: np.ndarray) -> np.ndarray:
        """Tell which segments, shape (n, 2, 2), have points within the radius, (n,)."""
        return self.distances(corners) < self.goal.radius * (1 - ON_LINE)

    def distances(self, corners: np.ndarray) -> np.ndarray:
        """Return the distances of segments (n, 2, 2) from the tip [length], (n,)."""
        first = self.at(corners[:, 0])
        along = self.at(corners[:, 1]) - first
        share = -(first * along).sum(axis=1) / (along**2).sum(axis=1)
        return np.linalg.norm(first + np.clip(share, 0, 1)[:, None] * along, axis=1)

    def on_faces(self, corners: np.ndarray) -> np.ndarray:
        """Tell which segments are on the line behind the tip, shape (n,)."""
        places = self.at(corners)
        tolerance = ON_LINE * self.goal.radius
        on_line = abs(places[..., 1]) <= tolerance
        return np.asarray((on_line & (places[..., 0] <= tolerance)).all(axis=1))

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

    def weight_above(self, kappa: float) -> Weight:
        """Return what the factor has of tractions on the face above.

        It is ``- E'/2 u-`` of the faces, of which the face below has the opposite.
        Tractions of rings are times the circumference.
        """
        on_face = plane_field(self.goal.mode, kappa).on_face()[-0.5]
        # A complex number has its components along the crack and aside.
        plane = on_face.real * self.forward + on_face.imag * self.aside
        return [(-0.5, -2 / (kappa + 1) * plane)]


class RingTip(Tip):
    """Know a ring of tips of a body of revolution."""

    bounds = "the boundary of the body or its axis"

    def __init__(self, goal: StressIntensity) -> None:
        super().__init__(goal)
        self.length = 2 * np.pi * goal.tip[0]

    def kappa(self, compliance: np.ndarray) -> float:
        """Return Kolosov's constant of plane strain, see :meth:`.Tip.kappa`."""
        return float(3 + 4 * compliance[0, 1] / compliance[0, 0])

    def strain(self, kappa: float) -> SingularStrain:
        """Return the given strain G of rings."""
        coefficients = ring_coefficients(self.goal.mode, (3 - kappa) / 4, *self.forward.tolist())
        return RingStrain(**vars(super().strain(kappa)), coefficients=coefficients)

    def weight_above(self, kappa: float) -> Weight:
        """Return the weight with what the ring adds, see :meth:`.Tip.weight_above`."""
        R = self.goal.tip[0]
        radial = complex(self.forward[0], self.aside[0])
        fields = ring_fields(self.goal.mode, (3 - kappa) / 4, radial)
        weight = dict(super().weight_above(kappa))
        for unit, series in zip(np.eye(2), fields.w, strict=True):
            for p, amount in series.on_face().items():
                more = -2 / (kappa + 1) * amount.real * R ** (-0.5 - p) * unit
                weight[p] = weight.get(p, np.zeros(2)) + more
        return [(p, c / self.length) for p, c in weight.items()]


def tip_of(space: Space, goal: StressIntensity) -> Tip:
    """Return the tip of a goal."""
    return RingTip(goal) if space.axisymmetric else Tip(goal)
