"""Bound the forces of supports and contacts as narrowly as it can be done."""

from __future__ import annotations

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.error.bounds import resultant
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.interval import interval
from erc_contact.error.numbers import Bounds
from erc_contact.output.bounded_forces import BoundedForce, bounded_forces, contact_names
from erc_contact.scene.goal import Resultant


def narrowly_bounded(error: ConstitutiveError) -> list[BoundedForce]:
    """Bound the forces of supports and contacts, all that matter; collective.

    :func:`erc_contact.interval` solves the scene some more times for each component.
    """
    contacts = contact_names(error)
    supports = [support.facets for support in error.solution.scene.supports]

    def bounds_of(error: ConstitutiveError, name: str, direction: tuple[float, ...]) -> Bounds:
        try:
            return interval(error, Resultant(name, direction))
        except (InputError, NotConverged):
            # A contact has an interval of lower order, which needs no further solution.
            if name in contacts:
                return resultant(error, name, direction)
            raise

    return bounded_forces(error, [*supports, *contacts], bounds_of)
