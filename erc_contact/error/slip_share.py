"""Estimate which share of the energy the slip of a contact has.

eps is over the energy of the whole body. Where a uniform stress has nearly all of it,
as around a crack in a large plate, eps is small although the slip is far off. A slip of
a mean square d^2 on a part of size L has about the energy ``(2/pi) E d^2 L^(d-2)``: in
the plane this is what a shear crack has. Let its share in ``|u|^2`` be s. The error of
the slip is of second order in the error of its field: on cracks in plates of 4 to 10
half lengths it was 0.4 times ``e^2`` over this energy, which is ``1.6 eps^2/s``. So
where s is below eps, the relative error of the slip may be greater than eps.
"""

from __future__ import annotations

from math import pi

import numpy as np
from mpi4py import MPI

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.status import CLOSED, SLIP


def small_slips(error: ConstitutiveError) -> dict[str, float]:
    """Find the contacts whose slip may have a greater error than eps; collective.

    Returns:
        The share of the energy that the slip of each of them has, by their names.
    """
    shares: dict[str, float] = {}
    if error.scale <= 0:
        return shares
    for contact in error.model.contacts:
        is_symmetry = contact.bilateral and contact.friction is None
        if is_symmetry or contact.is_compliant:
            continue
        share = _share(error, contact)
        if share is not None and share < error.relative:
            shares[contact.name] = share
    return shares


def _share(error: ConstitutiveError, contact: ContactOnMesh) -> float | None:
    """Estimate the share of the slip of a contact in the energy; collective.

    None where nothing slips.
    """
    table = error.profile(contact.name)
    if not np.any(np.isin(table["status"], (SLIP, CLOSED))):
        return None
    here = contact.trace.here
    local = np.array([here.owned_areas.sum(), here.owned_areas @ here.modulus])
    area, moduli = error.model.space.comm.allreduce(local, MPI.SUM)
    slip_2 = float(table["weight"] @ table["slip"] ** 2 / table["weight"].sum())
    d = error.model.space.d
    energy = 2 / pi * moduli / area * slip_2 * area ** ((d - 2) / (d - 1))
    return float(energy / (error.scale / 2) ** 2)
