"""Compute gap, slip, tractions and status along a contact from an admissible pair.

Symbols: u^ admissible displacement, r^ admissible contact traction.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.admissible.sampled import MARGIN
from erc_contact.admissible.traction import ContactTraction
from erc_contact.mesh.simplex import bernstein
from erc_contact.model.profile import facet_status, greatest_pressure, profile_points, profile_table


def contact_of(pair: Admissible, name: str) -> ContactTraction:
    """Return the traction on the contact of a name.

    Raises:
        InputError: If no contact has this name.
    """
    model = pair.model
    return pair.tractions[model.contacts.index(model.contact(name))]


def profile(result: Any, name: str) -> np.ndarray:
    """Compute gap, slip, tractions and status along a contact; collective.

    They are those of u^ and r^, point by point.

    Args:
        result: An admissible pair, an error, or a history.
        name: Name of the contact.

    Returns:
        The table of :func:`erc_contact.model.profile.profile_table`.

    Raises:
        InputError: If no contact has this name.
    """
    pair = pair_of(result)
    model = pair.model
    traction = contact_of(pair, name)
    shape = bernstein(model.d - 1, model.degree, profile_points(model))
    # The greatest pressure of all ranks, so that the status does not depend on them.
    peak = greatest_pressure(model, -traction.normal_component)
    status = contact_status(traction, peak)
    r = np.matmul(shape, traction.values)
    bound = traction.friction_bound @ shape.T
    return profile_table(model, traction.contact, pair.displacement, r, bound, status)


def contact_status(traction: ContactTraction, peak: float | None = None) -> np.ndarray:
    """Tell which facets of a contact are open, slip or stick.

    This follows from the coefficients of r^ on each facet, see
    :func:`erc_contact.model.profile.facet_status`. If the friction bound must be
    sampled on a facet, the friction of r^ is lowered there, so that r^ is allowed
    between the nodes, too. A facet with friction that is lower by this amount still
    counts as slipping.

    Args:
        traction: r^ on a contact.
        peak: Greatest pressure of the contact, which tells pressure from round-off
            [force/area]. By default it is the greatest pressure of the facets of
            ``traction``.

    Returns:
        OPEN, SLIP or STICK for each facet of ``traction.contact.facets``, shape (n,).
    """
    pressure = -traction.normal_component
    shear = np.linalg.norm(traction.tangential_part, axis=-1)
    largest = pressure.max(initial=0.0) if peak is None else peak
    return facet_status(traction.contact, pressure, shear, traction.friction_bound, largest, MARGIN)
