"""Sum up the tractions of a contact: forces, their ratio, mean and greatest pressure.

Symbols: r contact traction, p pressure, r_t shear, d dimension, f facets, q points of a
facet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import split
from erc_contact.model.contact_area import ContactArea
from erc_contact.model.contact_end import Estimate
from erc_contact.model.maximum import Maximum, greatest_of
from erc_contact.model.profile import named_traction, named_weights, profile_places, profile_points
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


def contact_force(
    space: Space, contact: ContactOnMesh, r: np.ndarray, area: ContactArea
) -> ContactForce:
    """Sum up the tractions of a contact; collective, the same on all ranks.

    Args:
        space: The mesh.
        contact: One of its contacts.
        r: Contact traction at the points of profiles [force/area], shape (f, q, d).
        area: Its area.
    """
    normals = contact.sign * contact.trace.normals_at(profile_points(space))
    r_n, r_t, _ = split(named_traction(space, contact, r), normals)
    owned = contact.trace.here.owned
    pressure, weights = -r_n[owned], named_weights(space, contact)[owned]
    local = [float((weights * pressure).sum()), *(weights[..., None] * r_t[owned]).sum(axis=(0, 1))]
    normal, *tangential = space.comm.allreduce(np.array(local), MPI.SUM)
    mean = Estimate(np.nan, 0.0)
    if area.area.value > 0:
        mean = Estimate(normal / area.area.value, 0.0)
        # The force is what it is, so that a smaller area has a greater mean.
        most = normal / area.area.low if area.area.low > 0 else np.inf
        mean = Estimate(mean.value, most - mean.value)
    x = np.stack(list(profile_places(space, contact).values()), axis=-1)[owned]
    greatest = greatest_of(space, pressure.ravel(), x.reshape(-1, space.d))
    return ContactForce(float(normal), np.array(tangential), mean, greatest)
