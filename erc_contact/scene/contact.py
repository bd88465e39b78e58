"""Contacts with rigid foundations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from erc_contact.base.exceptions import InputError
from erc_contact.scene.given import check_name, check_value, check_vector
from erc_contact.scene.law import Coulomb, Law
from erc_contact.scene.material import Value


@dataclass(frozen=True)
class Contact:
    """Contact with friction between a boundary part and a rigid foundation, unilateral unless said otherwise.

    Args:
        facets: Name of the boundary part that may touch the foundation.
        friction: Coulomb's friction coefficient mu >= 0 [-], number or callable of x (0
            is frictionless); or a law, e.g. :class:`Tresca`, or a class of the user's
            own.
        gap: Initial gap g to the foundation along the normal [length], number or
            callable of x.
        normal: Unit normal of the foundation that points into it: d numbers, a callable
            of x, or "gap" for ``-grad g/|grad g|``, the normal of a foundation whose
            gap is its distance. One that varies is taken at the middle of each facet:
            the foundation becomes a polyhedron, as a curved body becomes its mesh. None
            takes the outward normal of the part, which must then be flat.
        bilateral: Whether the contact cannot open: ``u_n = g``. Needs a friction bound
            without pressure.

    Raises:
        InputError: If friction is negative, the normal is zero, or a bilateral contact
            has Coulomb friction.

    Example:
        >>> ec.Contact("bottom", friction=0.3, gap=lambda x: 0.01 * x[0] ** 2)
        Contact(facets='bottom', friction=0.3, gap=<function ...>, normal=None, bilateral=False)
    """

    facets: str
    friction: Value | Law = 0.0
    gap: Value = 0.0
    normal: Sequence[float] | Callable[[Any], Any] | str | None = None
    bilateral: bool = False

    def __post_init__(self) -> None:
        check_name("Contact", self.facets)
        what = f"Contact({self.facets!r})"
        law: Any = self.friction
        if isinstance(law, type) or (
            hasattr(law, "friction_bound")
            and not isinstance(getattr(law, "parameters", None), tuple | list)
        ):
            raise InputError(
                f"{what}: friction is {law!r}; give a number, a callable of x, or an object with parameters (a tuple "
                "of names) and friction_bound, e.g. Tresca(0.1)."
            )
        if not hasattr(law, "friction_bound"):
            check_value(f"{what}: friction", law, 0.0)
        check_value(f"{what}: gap", self.gap, unit=" [length]")
        if self.bilateral and isinstance(self.law, Coulomb):
            raise InputError(
                f"{what} is bilateral and has Coulomb friction: the tractions that it allows are no convex set, and no "
                "error can be certified. Give friction=Tresca(limit), or no friction."
            )
        if isinstance(self.normal, str) and self.normal != "gap":
            raise InputError(
                f'{what}: normal is {self.normal!r}; give numbers, a callable of x, "gap" or None.'
            )
        if isinstance(self.normal, str) and not callable(self.gap):
            raise InputError(
                f'{what}: normal="gap" needs a gap that is a callable of x, the distance to the foundation.'
            )
        if (
            self.normal is not None
            and not isinstance(self.normal, str)
            and not callable(self.normal)
        ):
            check_vector(f"{what}: normal", self.normal)
            if any(callable(c) for c in self.normal):
                raise InputError(
                    f"{what}: normal must be numbers, or one callable of x that returns a vector."
                )
            length = sum(float(c) ** 2 for c in self.normal) ** 0.5
            if not length > 0:
                raise InputError(f"{what}: normal is {self.normal}; its length must be > 0.")
            object.__setattr__(self, "normal", tuple(float(c) / length for c in self.normal))

    @property
    def law(self) -> Law | None:
        """The friction law; None without friction."""
        law: Any = (
            self.friction if hasattr(self.friction, "friction_bound") else Coulomb(self.friction)
        )
        return None if isinstance(law, Coulomb) and law.friction == 0 else law
