"""Compute gap, slip, tractions and status along a contact from an admissible pair.

Symbols: u^ admissible displacement, r^ admissible contact traction.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.admissible.pair import pair_of
from erc_contact.model.contact_area import ContactArea
from erc_contact.model.contact_force import ContactForce
from erc_contact.model.profile import contact_area as area_of_contact
from erc_contact.model.profile import contact_force as force_of_contact
from erc_contact.model.profile import profile_table


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
    traction = pair.traction(name)
    r, bound = pair.at_profile_points(traction)
    return profile_table(pair.model.space, traction.contact, pair.displacement, r, bound)


def contact_area(result: Any, name: str, *, relative_error: float = 0.0) -> ContactArea:
    """Find the area of a contact, and in the plane and of rings its ends; collective.

    The contact ends where its pressure is zero, which is inside a facet: see
    :mod:`erc_contact.model.contact_end`. All numbers have a margin of their error,
    which is estimated: of random contacts 99% are within it.

    Args:
        result: An admissible pair, an error, or a history.
        name: Name of the contact.
        relative_error: eps [-], which an error and a history tell by themselves as
            members. Its square is a share of the area that the margins contain.

    Raises:
        InputError: If no contact has this name.

    Example:
        >>> print(ec.results.contact_area(error, "bottom"))
        contact area 2
        from x = 0, y = 0 (+- 0) to x = 2, y = 0 (+- 0)
    """
    pair = pair_of(result)
    traction = pair.traction(name)
    r, bound = pair.at_profile_points(traction)
    return area_of_contact(
        pair.model.space,
        traction.contact,
        pair.displacement,
        r,
        bound,
        can_open=pair.model.can_open(traction.contact),
        relative_error=relative_error,
    )


def contact_force(result: Any, name: str, *, relative_error: float = 0.0) -> ContactForce:
    """Sum up normal and tangential force of a contact, and its pressure; collective.

    ``print`` writes them in a line. :func:`erc_contact.results.force` has the resultant
    with its moment, and :func:`erc_contact.resultant` intervals of its components.

    Args:
        result: An admissible pair, an error, or a history.
        name: Name of the contact; between two bodies the side on which the forces are.
        relative_error: eps [-], for the area of the mean pressure, see
            :func:`contact_area`.

    Raises:
        InputError: If no contact has this name.

    Example:
        >>> pressing = ec.results.contact_force(error, "bottom")
        >>> bool(pressing.mean_pressure.value < pressing.greatest_pressure.value)
        True
    """
    pair = pair_of(result)
    traction = pair.traction(name)
    r, _ = pair.at_profile_points(traction)
    area = contact_area(pair, name, relative_error=relative_error).area
    return force_of_contact(pair.model.space, traction.contact, r, area)


def contact_status(result: Any, name: str) -> np.ndarray:
    """Tell which facets of a contact are open, slip or stick; collective.

    This follows from u^ and r^:
    :func:`erc_contact.model.contact.status.facet_status`.

    Args:
        result: An admissible pair, an error, or a history.
        name: Name of the contact.

    Returns:
        OPEN, SLIP, STICK or CLOSED for each facet of the contact on this rank, ghosts
        included, shape (n,).

    Raises:
        InputError: If no contact has this name.

    Example:
        >>> ec.results.contact_status(error, "bottom")
        array([2, 2, 2, 2])
    """
    pair = pair_of(result)
    return pair.status(pair.traction(name))
