"""Find the part of a body in the plane that a picture shows."""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.status import OPEN
from erc_contact.results.states import ACCUMULATED, state, states_of
from namedmesh.base.ranks import gather_rows, greatest
from namedmesh.pictures import body_mesh

BESIDE = 0.75
"""What is shown beside a zone, over its longest side [-]."""
SMALL = 0.5
"""Share of the longest side below which a window shows more than the whole [-]."""
YIELDED = 0.01
"""Share of the greatest plastic strain from which a cell counts as yielded [-]."""


def window_around(points: np.ndarray, body: np.ndarray, whole: np.ndarray) -> np.ndarray | None:
    """Return low and high corner of a window around a zone [length], shape (2, 2).

    Args:
        points: Points of the zone [length], shape (n, 2 or 3).
        body: Points of the body, which the window does not leave [length].
        whole: Points of what the zone is a part of [length].

    Returns:
        None where the zone is empty, or the window no small part of the whole.
    """
    if len(points) == 0:
        return None
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    beside = BESIDE * float((high - low).max())
    window = np.array([low - beside, high + beside])
    window = np.clip(window, body[:, :2].min(axis=0), body[:, :2].max(axis=0))
    sides = np.ptp(window, axis=0)
    is_small = sides.max() < SMALL * np.ptp(whole[:, :2], axis=0).max()
    return window if is_small and sides.min() > 0 else None


def near_window(result: Any, contact: str) -> np.ndarray | None:
    """Find what a picture near a contact shows, before the deformation; collective.

    Args:
        result: An admissible pair, an error, or a history.
        contact: Name of a contact.

    Returns:
        Low and high corner [length], shape (2, 2); None in 3D, and where nothing is
        closed or has yielded, or no small part of the body.

    Raises:
        InputError: If no contact has this name.
    """
    admissible = pair_of(result)
    model = admissible.model
    name = model.contact(contact).name
    if model.space.d == 3:
        return None
    zone, whole = contact_zone(admissible, name)
    body = gather_rows(model.space.comm, **body_mesh(admissible.domain))
    window = window_around(zone, body["points"], whole) if body else None
    return model.space.comm.bcast(window)


def window_near(what: str, result: Any, contact: str | None) -> np.ndarray | None:
    """Return the window of a picture near a contact, or None; collective.

    Args:
        what: The picture, for messages.
        result: An admissible pair, an error, or a history.
        contact: Name of the contact, or None for the whole body.

    Raises:
        InputError: If no contact has this name, or it has no small part of a body in
            the plane near it.
    """
    if contact is None:
        return None
    window = near_window(result, contact)
    if window is None:
        raise InputError(
            f"{what}: {contact!r} has no small part of a body in the plane near it that is "
            "closed or has yielded; draw the whole."
        )
    return window


def contact_zone(admissible: Admissible, contact: str) -> tuple[np.ndarray, np.ndarray]:
    """Gather the corners of facets of a contact that show something; collective.

    They are closed, or facets of cells that have yielded.

    Returns:
        Their corners and the corners of all facets [length], shape (n, d) each; none on
        ranks but rank 0.
    """
    space = admissible.model.space
    traction = admissible.traction(contact)
    here = traction.contact.trace.here
    shown = admissible.status(traction) != OPEN
    if ACCUMULATED in states_of(admissible):
        strain = np.zeros(here.cell_count)
        owned = state(admissible, ACCUMULATED)
        strain[: len(owned)] = owned
        shown |= strain[here.facets[:, 0]] > YIELDED * greatest(space.comm, owned)
    owned_corners = here.corners[here.owned]
    table = gather_rows(space.comm, corners=owned_corners, shown=shown[here.owned])
    if not table:
        return np.zeros((0, space.d)), np.zeros((0, space.d))
    zone = table["corners"][table["shown"]]
    return zone.reshape(-1, space.d), table["corners"].reshape(-1, space.d)
