"""Put sides at which copies of a body follow each other on a mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.model.space import Space
from erc_contact.scene.contact import Contact
from namedmesh import Domain, PeriodicPair


def periodic_pairs(contacts: Sequence[Contact], domain: Domain) -> list[PeriodicPair]:
    """Return the pairs of sides of copies with their motions; collective.

    Args:
        contacts: What the scene declares.
        domain: The mesh with names.
    """
    pairs = [contact.pair_on(domain) for contact in contacts]
    return [pair for pair in pairs if pair is not None]


def placed(space: Space, contact: Contact) -> Contact:
    """Return a contact with what it gets from the mesh; collective.

    Sides of copies get the mean normal of the first one, and the jump of a mean strain.
    A traction of any direction is allowed there, so that their normals need not turn.

    Raises:
        InputError: If an axisymmetric body is not repeated along its axis.
    """
    pair = _pair_of(space, contact)
    if pair is None:
        return contact
    if space.axisymmetric and (pair.turns or pair.shift[0] != 0.0):
        raise InputError(
            f"{type(contact).__name__}({contact.facets!r}): an axisymmetric body is repeated along"
            " its axis alone; give sides with r the same, one above the other."
        )
    sides = space.domain.owned_facets(contact.facets)
    local = space.facet_areas(sides) @ space.outward_normals(sides)
    normal = space.comm.allreduce(local)
    return contact.placed(pair, normal / np.linalg.norm(normal))


def rotation_of(space: Space, contact: Contact) -> np.ndarray | None:
    """Return R, which turns the first side of a contact onto the second; or None."""
    pair = _pair_of(space, contact)
    return None if pair is None or not pair.turns else np.array(pair.rotation)


def _pair_of(space: Space, contact: Contact) -> PeriodicPair | None:
    """Return the pair of sides of copies that a contact is; None of other contacts."""
    return next((pair for pair in space.domain.periodic if pair.names == contact.sides), None)
