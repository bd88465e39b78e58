"""Give the friction bounds of a pair to a scene.

The difference-quotient bound is of a problem whose friction bound does not change with
the pressure (:mod:`erc_contact.error.goals.difference_quotient`). A scene with Coulomb
friction is solved there with the bound ``b(p^)`` of its pair: the pair is admissible
for that problem, too, with the same e.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import ufl

from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.friction import depends_on_pressure
from erc_contact.scene.contact import Contact


def contacts_with_given_bounds(pair: Admissible) -> list[Contact]:
    """Return the contacts of a scene with the friction bounds of its pair; collective.

    They are for solves on the mesh of the pair.

    Raises:
        InputError: If two facets of a contact with such a bound have a common cell.
    """
    contacts: list[Contact] = []
    for contact, traction in zip(pair.model.scene.contacts, pair.tractions, strict=True):
        friction = traction.contact.friction
        if friction is None or not depends_on_pressure(friction):
            contacts.append(contact)
            continue
        bound = _bound(pair, traction)
        law = friction.law
        shape = getattr(law, "axes", None), getattr(law, "ratio", 1.0)
        contacts.append(replace(contact, friction=_GivenBound(partial(_at_any, bound), *shape)))
    return contacts


@dataclass(frozen=True)
class _GivenBound:
    """Hold a friction law whose bound does not depend on the pressure.

    Attributes:
        limit: The bound [force/area], a callable of the position.
        axes: Axes of the law whose bound it is, None of an isotropic law.
        ratio: Ratio of its semi-axes [-].
    """

    limit: Callable[[Any], Ufl]
    axes: Any
    ratio: float
    parameters: ClassVar[tuple[str, ...]] = ("limit",)

    def friction_bound(self, pressure: Ufl, limit: Ufl) -> Ufl:
        """Return the bound [force/area]."""
        return limit


def _bound(pair: Admissible, traction: ContactTraction) -> Ufl:
    """Return the friction bound of r^ on its contact [force/area], UFL; collective."""
    contact = traction.contact
    assert contact.friction is not None
    # Forms integrate over this side, which the scene may name second.
    r = pair.traction_function(contact.side_names[0])
    pressure = ufl.max_value(-ufl.dot(r, contact.normal), 0.0)
    return contact.friction.bound(pressure)


def _at_any(bound: Ufl, _: Any) -> Ufl:
    """Return a bound as a callable of the position."""
    return bound
