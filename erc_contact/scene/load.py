"""Declare loads: forces on a part of the boundary or in the body.

A load of a new kind is a class with the members of :class:`Load`. Its form, its moments
on facets and cells, what the mesh does not represent of it and its checks follow from
its density.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl, Value
from erc_contact.scene.checks import (
    Vector,
    check_name,
    check_region,
    check_value,
    check_vector,
)

LOAD_MEMBERS = ("facets", "parameters", "density")
"""Names of the members of a load."""


class Load(Protocol):
    """Describe a load.

    Example: ``demos/extend/load.py``. A load whose density depends on the area of its
    part has a method ``on_part(moments)``, too, which returns arrays that ``density``
    gets by their names; :class:`RemoteForce` has one.

    Attributes:
        facets: Name of the boundary part that it acts on, or None for a load in the
            whole body.
        parameters: Names of the attributes that are values in space: numbers, vectors,
            or callables of x that return either. A vector is a tuple of d numbers or
            callables of x; a list or an array is not taken.

    Example:
        >>> load: ec.Load = ec.Traction("left", pressure=2.0)
        >>> load.facets, load.parameters
        ('left', ('pressure',))
    """

    @property
    def facets(self) -> str | None: ...  # noqa: D102

    @property
    def parameters(self) -> tuple[str, ...]: ...  # noqa: D102

    def density(self, x: Ufl, n: Ufl, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return the force per area [force/area] or per volume [force/volume].

        It is UFL, or a sequence of d components.

        Args:
            x: Position [length], UFL, shape (d,).
            n: Outward unit normal on the boundary, UFL, shape (d,); None for a load in
                the body.
            values: Not used; type checkers ask for it, so that a class may name its
                parameters.
            parameters: The parameters by their names, UFL.
        """


@dataclass(frozen=True)
class Traction:
    """Declare a surface force F, or a pressure p with ``F = -p n``, on a boundary part.

    Args:
        facets: Name of the boundary part.
        value: Vector [force/area]; or None with ``pressure``.
        pressure: Normal pressure [force/area], positive when it pushes on the body.

    Raises:
        InputError: If not exactly one of value and pressure is given, or it is no
            number or callable.

    Example:
        >>> ec.Traction("right", (0.0, lambda x: 2.0 * x[1]))
        Traction(facets='right', value=(0.0, <function ...>), pressure=None)
    """

    facets: str
    value: Vector | None = None
    pressure: Value | None = None

    def __post_init__(self) -> None:
        """Check the arguments."""
        check_name("Traction", self.facets)
        what = f"Traction({self.facets!r})"
        if (self.value is None) == (self.pressure is None):
            raise InputError(f"{what}: give either a vector or pressure=, not both and not none.")
        if self.pressure is not None:
            check_value(f"{what}: pressure", self.pressure, unit=" [force/area]")
        elif self.value is not None:
            check_vector(what, self.value)
            if not callable(self.value):
                object.__setattr__(self, "value", tuple(self.value))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Return the name of the argument that is not None."""
        return ("value",) if self.pressure is None else ("pressure",)

    def density(self, x: Ufl, n: Ufl, value: Ufl = None, pressure: Ufl = None) -> Ufl:
        """Return ``F`` or ``-p n`` [force/area], UFL, shape (d,)."""
        return value if pressure is None else -pressure * n


@dataclass(frozen=True)
class BodyForce:
    """Declare a force per volume f in the body [force/volume].

    Args:
        value: Vector of numbers or callables, or one callable of x that returns a
            vector.
        region: Name of the cell region that has it; None for the whole body.

    Example:
        >>> weight = ec.BodyForce((0.0, -78.5e-6))
        >>> steel = ec.Elastic(E=210e3, nu=0.3)
        >>> ec.Scene(steel, supports=scene.supports, loads=[weight])
        Scene(...loads=(BodyForce(value=(0.0, -7.85e-05), region=None),)...)
    """

    value: Vector
    region: str | None = None
    facets: ClassVar[None] = None
    parameters: ClassVar[tuple[str, ...]] = ("value",)

    def __post_init__(self) -> None:
        """Check the vector."""
        check_region("BodyForce", self.region)
        check_vector("BodyForce", self.value)
        if not callable(self.value):
            object.__setattr__(self, "value", tuple(self.value))

    def density(self, x: Ufl, n: Ufl, value: Ufl) -> Ufl:
        """Return ``f`` [force/volume], UFL, shape (d,)."""
        return value


@dataclass(frozen=True)
class Drive:
    """Represent a force on a side of a contact, beside the traction of the contact.

    Goals drive slip or opening by it. It is the only load that may act on a contact.

    Attributes:
        facets: Name of the side.
        factor: Its size [force/area].
        along: Its direction by the unit normal out of the body, UFL in, UFL out.
        normal: This normal, UFL; None for the normal of the facets.
    """

    facets: str
    factor: float
    along: Callable[[Ufl], Ufl]
    normal: Ufl | None = None
    parameters: ClassVar[tuple[str, ...]] = ()

    def density(self, x: Ufl, n: Ufl) -> Ufl:
        """Return the force per area [force/area], UFL, shape (d,)."""
        return self.factor * self.along(n if self.normal is None else self.normal)
