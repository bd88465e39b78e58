"""Declare contacts with foundations and between bodies, and planes of symmetry."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Value
from erc_contact.scene.checks import check_name, check_value, check_vector
from erc_contact.scene.law import Coulomb, Law
from erc_contact.scene.words import names_of_sides

if TYPE_CHECKING:
    import numpy as np

    from namedmesh import Domain, PeriodicPair


@dataclass(frozen=True, init=False)
class Foundation:
    """Declare a compliant (Winkler) foundation under a contact.

    Where the pressure is p its deflection is p/k_n: the body may move by ``g + p/k_n``
    along the normal. Where the shear is t its surface moves by t/k_t, and slip is what
    the body moves beyond. It is a mat, a soil, a thin soft layer on a stiff ground, or
    the asperities of rough surfaces. Between two bodies it is a compliant layer without
    thickness.

    Args:
        normal: k_n, pressure over settlement [force/length^3], number or callable of x
            (e.g. a table); for a thin layer it is its modulus over its thickness. None
            is rigid.
        tangential: k_t, shear over displacement [force/length^3], likewise; for a thin
            layer it is its shear modulus over its thickness. It needs friction.
        stiffness: Another name of ``normal``.

    Raises:
        InputError: If a stiffness is no finite number > 0 nor a callable, or if both
            are None.

    Example:
        >>> ec.Contact("bottom", foundation=ec.Foundation(50.0)).foundation
        Foundation(normal=50.0, tangential=None)
    """

    normal: Value | None
    tangential: Value | None

    def __init__(
        self,
        normal: Value | None = None,
        tangential: Value | None = None,
        *,
        stiffness: Value | None = None,
    ) -> None:
        """Check the stiffnesses."""
        if stiffness is not None and normal is not None:
            raise InputError("Foundation: stiffness is another name of normal; give one.")
        # The class is frozen: only here its attributes are set.
        object.__setattr__(self, "normal", stiffness if normal is None else normal)
        object.__setattr__(self, "tangential", tangential)
        if self.normal is None and self.tangential is None:
            raise InputError(
                "Foundation has no stiffness; give normal, tangential or both. A rigid foundation"
                " has none: leave foundation out."
            )
        for name in ("normal", "tangential"):
            value: Any = getattr(self, name)
            if value is None:
                continue
            check_value(f"Foundation: {name}", value, unit=" > 0 [force/length^3]")
            is_number = not callable(value)
            if is_number and (isinstance(value, bool) or not value > 0):
                raise InputError(
                    f"Foundation: {name} is {value!r}; give a number > 0 [force/length^3], or a"
                    " callable of x. What is rigid has none: leave it out."
                )

    @property
    def stiffness(self) -> Value | None:
        """Return ``normal``, of which it is another name."""
        return self.normal


@dataclass(frozen=True)
class Contact:
    """Declare a contact of a boundary part with a foundation or another body.

    It may have friction, and it is unilateral unless said otherwise. Between two bodies
    all that is said of u is said of the jump: the displacement of the part less the
    displacement of the facing points.

    Args:
        facets: Name of the boundary part that may touch the foundation or other body.
        against: Name of the boundary part of another body that the part faces, see
            :meth:`Domain.split`; None for a foundation. ``Contact(*pair)`` takes a row
            of :meth:`Domain.touching`.
        friction: Coulomb's friction coefficient mu >= 0 [-], number or callable of x (0
            is frictionless); or a law, e.g. :class:`Tresca`, or a class of the user's
            own.
        gap: Initial gap g to the foundation or the other body along the normal
            [length], number or callable of x. Of bodies that are modelled apart, it
            adds to their distance.
        normal: Unit normal that points into the foundation or the other body: d
            numbers, a callable of x, or "gap" for ``-grad g/|grad g|``, the normal of a
            foundation whose gap is its distance. One that varies is taken at the middle
            of each facet: the foundation becomes a polyhedron, as a curved body becomes
            its mesh. None takes the outward normal of the part, which must then be flat
            on a foundation.
        bilateral: Whether the contact cannot open: ``u_n = g``. Needs a friction bound
            without pressure.
        foundation: A compliant foundation, :class:`Foundation`, or a layer between two
            bodies that is compliant alike; None for a rigid foundation, and where two
            bodies touch each other without a layer.
        motion: Displacement of the foundation [length]: one number or callable of x for
            each dimension, at the points of the part. It changes the gap by its normal
            component, and slip counts against it. A disc below a brake pad turns by
            ``motion=(lambda x: -a * x[1], lambda x: a * x[0], 0.0)``. In a history it
            is counted from the start, as a :class:`Displacement` is.

    Raises:
        InputError: If friction is negative, the normal is zero, a bilateral contact has
            Coulomb friction or a normal compliance, a contact with a tangential
            compliance has no friction, a part is against itself, or a contact with
            another body has a motion.

    Example:
        >>> ec.Contact("bottom", friction=0.3, gap=lambda x: 0.01 * x[0] ** 2)
        Contact(facets='bottom', against=None, friction=0.3, gap=<function ...>,
                normal=None, bilateral=False, foundation=None, motion=None)
    """

    facets: str
    against: str | None = None
    friction: Value | Law = 0.0
    gap: Value = 0.0
    normal: Sequence[float] | Callable[[Any], Any] | str | None = None
    bilateral: bool = False
    foundation: Foundation | None = None
    motion: Sequence[Value] | None = None

    is_symmetry: ClassVar[bool] = False
    """Whether it stands for the rest of a body, and may be among the supports."""

    def __post_init__(self) -> None:
        """Check the arguments, and make a normal in numbers a unit vector."""
        check_name("Contact", self.facets)
        what = f"Contact({self.facets!r})"
        if self.against is not None:
            if not isinstance(self.against, str):
                raise InputError(
                    f"{what}: against is {self.against!r}; give the facing part of another body, "
                    "or None. Friction is given by its name, friction=0.3."
                )
            check_name(f"{what}: against", self.against)
            if self.against == self.facets:
                raise InputError(
                    f"{what} is against itself; give the facing part of another body, or None"
                    " for a rigid foundation."
                )
        self._check_friction(what)
        self._check_foundation(what)
        self._check_motion(what)
        check_value(f"{what}: gap", self.gap, unit=" [length]")
        if self.bilateral and isinstance(self.law, Coulomb):
            raise InputError(
                f"{what} is bilateral and has Coulomb friction: the tractions that it allows are"
                " no convex set, and no error can be certified. Give friction=Tresca(limit), or"
                " no friction."
            )
        if isinstance(self.normal, str):
            self._check_normal_by_name(what)
        elif self.normal is not None and not callable(self.normal):
            # The class is frozen: only here an attribute may change.
            object.__setattr__(self, "normal", _unit_normal(what, self.normal))

    def _check_friction(self, what: str) -> None:
        """Check that friction is a number, a callable, or a law."""
        law: Any = self.friction
        if not isinstance(law, type):
            if isinstance(law, float) and law == inf:
                raise InputError(
                    f"{what}: friction is infinite; give a number >= 0. What cannot slide is tied: "
                    "give Tied(part, other part) of two bodies, or a Displacement where a "
                    "foundation holds the body."
                )
            if not hasattr(law, "friction_bound"):
                check_value(f"{what}: friction", law, 0.0)
                return
            if isinstance(getattr(law, "parameters", None), tuple | list):
                return
        raise InputError(
            f"{what}: friction is {law!r}; give a number, a callable of x, or an object with"
            " parameters (a tuple of names) and friction_bound, e.g. Tresca(0.1)."
        )

    def _check_foundation(self, what: str) -> None:
        """Check the type of a compliant foundation, and what a spring would be."""
        if self.foundation is None:
            return
        if not isinstance(self.foundation, Foundation):
            raise InputError(
                f"{what}: foundation is {self.foundation!r}; give Foundation(stiffness), or None"
                " where nothing is compliant."
            )
        if self.bilateral and self.foundation.normal is not None:
            raise InputError(
                f"{what} is bilateral and has a compliant foundation: such a part never lifts"
                f" off. Give Spring({self.facets!r}, normal=k) instead."
            )
        if self.foundation.tangential is not None and self.law is None:
            raise InputError(
                f"{what} is tangentially compliant and has no friction, so that no shear acts."
                " Give friction, or leave tangential out."
            )

    def _check_motion(self, what: str) -> None:
        """Check that the motion of a foundation is a vector."""
        if self.motion is None:
            return
        if self.against is not None:
            raise InputError(
                f"{what} is against another body and has a motion; a body is moved by a "
                "Displacement, and only a foundation has a motion."
            )
        if callable(self.motion):
            raise InputError(
                f"{what}: give one value or callable for each component of the motion, (ux, uy),"
                " not one callable."
            )
        check_vector(f"{what}: motion", self.motion)
        object.__setattr__(self, "motion", tuple(self.motion))

    def _check_normal_by_name(self, what: str) -> None:
        """Check that a normal in words is "gap", the normal of the gap."""
        if self.normal != "gap":
            raise InputError(
                f'{what}: normal is {self.normal!r}; give numbers, a callable of x, "gap" or None.'
            )
        if not callable(self.gap):
            raise InputError(
                f'{what}: normal="gap" needs a gap that is a callable of x, the distance to the'
                " foundation."
            )

    def pair_on(self, domain: Domain) -> PeriodicPair | None:
        """Return the motion between its sides, if they are sides of copies, else None.

        Args:
            domain: The mesh with names.
        """
        return None

    def placed(self, pair: PeriodicPair, area: np.ndarray) -> Contact:
        """Return the contact with what its sides have on a mesh; sides of copies do.

        Args:
            pair: The sides with the motion between them.
            area: Area vector out of the first side [area].
        """
        return self

    @property
    def sides(self) -> tuple[str, ...]:
        """Return the names of its one or two boundary parts."""
        return names_of_sides(self.facets, self.against)

    @property
    def law(self) -> Law | None:
        """Return the friction law; None without friction."""
        law: Any = self.friction
        if not hasattr(law, "friction_bound"):
            law = Coulomb(law)
        if isinstance(law, Coulomb) and law.friction == 0:
            return None
        return law


@dataclass(frozen=True)
class Symmetry(Contact):
    """Declare that a flat boundary part lies on a plane of symmetry.

    The normal displacement and the shear are zero there. It is a contact that cannot
    open and has no friction, so that the plane needs no direction of coordinates. It
    stands among the supports or the contacts of a scene, which has it among its
    contacts. Forces and energies belong to the part of the body that is computed;
    :func:`erc_contact.results.whole_force` gives the forces of the whole body.

    Args:
        facets: Name of the boundary part.

    Example:
        >>> half = ec.Scene(scene.material, [ec.Symmetry("left"), *scene.supports])
        >>> half.contacts
        (Symmetry(facets='left'),)
    """

    is_symmetry: ClassVar[bool] = True
    against: str | None = field(default=None, init=False, repr=False)
    friction: Value | Law = field(default=0.0, init=False, repr=False)
    gap: Value = field(default=0.0, init=False, repr=False)
    normal: Sequence[float] | Callable[[Any], Any] | str | None = field(
        default=None, init=False, repr=False
    )
    bilateral: bool = field(default=True, init=False, repr=False)
    foundation: Foundation | None = field(default=None, init=False, repr=False)
    motion: Sequence[Value] | None = field(default=None, init=False, repr=False)


def _unit_normal(what: str, normal: Any) -> tuple[float, ...]:
    """Return a unit vector from a normal in numbers of any length."""
    check_vector(f"{what}: normal", normal)
    if any(callable(component) for component in normal):
        raise InputError(
            f"{what}: normal must be numbers, or one callable of x that returns a vector."
        )
    length = sum(float(component) ** 2 for component in normal) ** 0.5
    if not length > 0:
        raise InputError(f"{what}: normal is {normal}; its length must be > 0.")
    return tuple(float(component) / length for component in normal)
