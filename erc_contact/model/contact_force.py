"""Sum up the tractions of a contact: forces, their ratio, mean and greatest pressure.

Symbols: p pressure, r_t shear, d dimension, n points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.model.contact_end import Estimate
from erc_contact.model.maximum import Maximum, greatest_of
from erc_contact.model.space import Space


@dataclass(frozen=True, eq=False)
class ContactForce:
    """Hold normal and tangential force of a contact, and its pressure.

    Attributes:
        normal: ``int p dA`` [force], in the plane per thickness, of rings of the full
            ring. On a curved contact it is more than the resultant.
        tangential: ``int r_t dA`` on the side that was asked for [force], shape (d,).
            Of rings the first component is the sum of radial forces around the ring.
        mean_pressure: The normal force over the area of the contact [force/area], with
            the margin of this area; nan where nothing presses.
        greatest_pressure: The greatest pressure at the points of the profile
            [force/area], and its place.

    Example:
        >>> pressing = error.contact_force("bottom")
        >>> bool(abs(pressing.normal - error.force("bottom").force[1]) < 1e-9)
        True
        >>> pressing.ratio < 0.3
        True
    """

    normal: float
    tangential: np.ndarray
    mean_pressure: Estimate
    greatest_pressure: Maximum

    @property
    def ratio(self) -> float:
        """Return the tangential over the normal force [-]; nan without either."""
        length = float(np.linalg.norm(self.tangential))
        return length / self.normal if self.normal > 0 else np.nan

    def __str__(self) -> str:
        """Write all of it in a line."""
        length = float(np.linalg.norm(self.tangential))
        return (
            f"normal force {self.normal:.5g}, tangential force {length:.5g}, ratio "
            f"{self.ratio:.4g}, mean pressure {self.mean_pressure}, greatest pressure "
            f"{self.greatest_pressure}"
        )


def force_of_points(
    space: Space,
    pressures: np.ndarray,
    shears: np.ndarray,
    weights: np.ndarray,
    x: np.ndarray,
    area: Estimate,
) -> ContactForce:
    """Sum up the tractions at points of a contact; collective, the same on all ranks.

    Args:
        space: The mesh.
        pressures: Pressures at points of this rank, without ghosts [force/area], (n,).
        shears: r_t there [force/area], shape (n, d).
        weights: Parts of the contact that they stand for [area], shape (n,).
        x: Their places [length], shape (n, d).
        area: Area of the contact.
    """
    local = np.append(weights @ shears, weights @ pressures)
    *tangential, normal = space.comm.allreduce(local, MPI.SUM)
    mean = Estimate(np.nan, 0.0)
    if area.value > 0:
        # The force is known better: the least area has the greatest mean.
        middle = normal / area.value
        most = normal / area.low if area.low > 0 else np.inf
        mean = Estimate(float(middle), float(most - middle))
    greatest = greatest_of(space, pressures, x)
    return ContactForce(float(normal), np.array(tangential), mean, greatest)
