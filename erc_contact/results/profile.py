"""Compute gap, slip, tractions and status along a contact from an admissible pair.

Symbols: u^ admissible displacement, r^ admissible contact traction.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.admissible.cells import tractions_of
from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.admissible.sampled import MARGIN
from erc_contact.admissible.traction import ContactTraction
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.meridian import per_area
from erc_contact.model.profile import (
    STICK,
    facet_status,
    greatest_pressure,
    profile_points,
    profile_table,
)


def contact_of(pair: Admissible, name: str) -> ContactTraction:
    """Return the traction on the contact of a name.

    Raises:
        InputError: If no contact has this name.
    """
    model = pair.model
    contact = model.contact(name)
    if contact in model.ties:
        return traction_through(pair, contact)
    return pair.tractions[model.contacts.index(contact)]


def traction_through(pair: Admissible, tie: ContactOnMesh) -> ContactTraction:
    """Return the traction of sigma^ on the first side of a tied joint."""
    model = pair.model
    here = tie.trace.here
    cells = pair.cell_geometry
    first = cells.side[0][model.facet_numbers(here.facets)] // (model.d + 1)
    sign = np.where(first == here.facets[:, 0], 1.0, -1.0)
    values = sign[:, None, None] * tractions_of(model, pair.facet_moments, here.facets)
    # A tied joint carries any shear.
    bound = np.full(values.shape[:2], np.inf)
    return ContactTraction(tie, here.nodes, here.areas, values, bound)


def profile(result: Any, name: str) -> np.ndarray:
    """Compute gap, slip, tractions and status along a contact; collective.

    They are computed from u^ and r^, point by point.

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
    points = profile_points(model)
    corners = traction.contact.trace.here.corners
    # The greatest pressure of all ranks, so that the status does not depend on them.
    peak = greatest_pressure(model, -traction.normal_component)
    status = contact_status(traction, peak)
    r = per_area(model, corners, traction.values, points)
    if traction.contact in model.ties:
        bound = np.full(r.shape[:2], np.inf)
    else:
        bound = per_area(model, corners, traction.friction_bound, points)
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
    contact = traction.contact
    pressure, shear, bound = traction.in_law()
    if np.isinf(bound).all():
        return np.full(len(bound), STICK)
    largest = pressure.max(initial=0.0) if peak is None else peak
    return facet_status(contact, pressure, shear, bound, largest, MARGIN)
