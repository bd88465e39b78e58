"""What the user declares: a body's material, supports, loads and contacts. Frozen data, no mesh.

A scene names the parts of the boundary; it is put on a mesh by :class:`erc_contact.model.model.Model`.
Values that vary in space are callables of x (UFL in, UFL out), so a scene survives every new mesh.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from numbers import Real
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.scene.law import Coulomb, Law
from erc_contact.scene.material import Elastic, Value

MATERIAL = ("parameters", "check", "stress", "compliance", "modulus")
"""What a material has."""
Vector = Sequence[Value] | Callable[[Any], Any]
"""d values, or a callable of x that returns a vector (UFL or a sequence)."""


def _check_name(what: str, name: Any) -> None:
    if not isinstance(name, str):
        raise InputError(f"{what} is for {name!r}; give the name of one boundary part, e.g. {what}('top', ...).")


def _check_value(what: str, value: Any, low: float = -float("inf"), unit: str = "") -> None:
    """Check a number (callables are checked on the mesh)."""
    if callable(value):
        return
    if not isinstance(value, Real) or not isfinite(value) or value < low:
        bound = f" >= {low:g}" if isfinite(low) else ""
        raise InputError(f"{what} is {value!r}; give a finite number{bound}{unit}, or a callable of x.")


def _check_vector(what: str, value: Any, *, free: bool = False) -> None:
    if callable(value):
        return
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)) or len(value) not in (2, 3):
        raise InputError(f"{what} is {value!r}; give one value for each dimension, e.g. (0.0, -1.0), or a callable.")
    for component in value:
        if not (free and component is None):
            _check_value(f"{what}: a component", component)


@dataclass(frozen=True)
class Displacement:
    """Prescribed displacement ``u = U`` on a part of the boundary, per component.

    Args:
        facets: Name of the boundary part.
        value: One number or callable of x for each dimension [length]; None leaves a component free (a roller).

    Raises:
        InputError: If the value is no such sequence, or fixes nothing.
    """

    facets: str
    value: Sequence[Value | None]

    def __post_init__(self) -> None:
        _check_name("Displacement", self.facets)
        what = f"Displacement({self.facets!r})"
        if callable(self.value):
            raise InputError(f"{what}: give one value or callable for each component, (ux, uy), not one callable.")
        _check_vector(what, self.value, free=True)
        object.__setattr__(self, "value", tuple(self.value))
        if all(component is None for component in self.value):
            raise InputError(f"{what} fixes no component; leave it out.")


@dataclass(frozen=True)
class Traction:
    """Given surface force on a part of the boundary: a vector F, or a pressure p with ``F = -p n``.

    Args:
        facets: Name of the boundary part.
        value: Vector [force/area]; or None with ``pressure``.
        pressure: Normal pressure [force/area], positive when it pushes on the body.

    Raises:
        InputError: If not exactly one of value and pressure is given, or it is no number or callable.
    """

    facets: str
    value: Vector | None = None
    pressure: Value | None = None

    def __post_init__(self) -> None:
        _check_name("Traction", self.facets)
        what = f"Traction({self.facets!r})"
        if (self.value is None) == (self.pressure is None):
            raise InputError(f"{what}: give either a vector or pressure=, not both and not none.")
        if self.pressure is not None:
            _check_value(f"{what}: pressure", self.pressure, unit=" [force/area]")
        elif self.value is not None:
            _check_vector(what, self.value)
            if not callable(self.value):
                object.__setattr__(self, "value", tuple(self.value))


@dataclass(frozen=True)
class BodyForce:
    """Given force per volume f in the whole body [force/volume].

    Args:
        value: Vector of numbers or callables, or one callable of x that returns a vector.
    """

    value: Vector

    def __post_init__(self) -> None:
        _check_vector("BodyForce", self.value)
        if not callable(self.value):
            object.__setattr__(self, "value", tuple(self.value))


@dataclass(frozen=True)
class Contact:
    """Contact with friction between a boundary part and a rigid foundation, unilateral unless said otherwise.

    Args:
        facets: Name of the boundary part that may touch the foundation.
        friction: Coulomb's friction coefficient mu >= 0 [-], number or callable of x (0 is frictionless); or a law,
            e.g. :class:`Tresca`, or a class of the user's own.
        gap: Initial gap g to the foundation along the normal [length], number or callable of x.
        normal: Unit normal of the foundation that points into it: d numbers, a callable of x, or "gap" for
            ``-grad g/|grad g|``, the normal of a foundation whose gap is its distance. One that varies is taken at the
            middle of each facet: the foundation becomes a polyhedron, as a curved body becomes its mesh. None takes
            the outward normal of the part, which must then be flat.
        bilateral: Whether the contact cannot open: ``u_n = g``. Needs a friction bound without pressure.

    Raises:
        InputError: If friction is negative, the normal is zero, or a bilateral contact has Coulomb friction.
    """

    facets: str
    friction: Value | Law = 0.0
    gap: Value = 0.0
    normal: Sequence[float] | Callable[[Any], Any] | str | None = None
    bilateral: bool = False

    def __post_init__(self) -> None:
        _check_name("Contact", self.facets)
        what = f"Contact({self.facets!r})"
        law: Any = self.friction
        if isinstance(law, type) or (
            hasattr(law, "bound") and not isinstance(getattr(law, "parameters", None), tuple | list)
        ):
            raise InputError(
                f"{what}: friction is {law!r}; give a number, a callable of x, or an object with parameters (a tuple "
                "of names) and bound, e.g. Tresca(0.1)."
            )
        if not hasattr(law, "bound"):
            _check_value(f"{what}: friction", law, 0.0)
        _check_value(f"{what}: gap", self.gap, unit=" [length]")
        if self.bilateral and isinstance(self.law, Coulomb):
            raise InputError(
                f"{what} is bilateral and has Coulomb friction: the tractions that it allows are no convex set, and no "
                "error can be certified. Give friction=Tresca(limit), or no friction."
            )
        if isinstance(self.normal, str) and self.normal != "gap":
            raise InputError(f'{what}: normal is {self.normal!r}; give numbers, a callable of x, "gap" or None.')
        if isinstance(self.normal, str) and not callable(self.gap):
            raise InputError(
                f'{what}: normal="gap" needs a gap that is a callable of x, the distance to the foundation.'
            )
        if self.normal is not None and not isinstance(self.normal, str) and not callable(self.normal):
            _check_vector(f"{what}: normal", self.normal)
            if any(callable(c) for c in self.normal):
                raise InputError(f"{what}: normal must be numbers, or one callable of x that returns a vector.")
            length = sum(float(c) ** 2 for c in self.normal) ** 0.5
            if not length > 0:
                raise InputError(f"{what}: normal is {self.normal}; its length must be > 0.")
            object.__setattr__(self, "normal", tuple(float(c) / length for c in self.normal))

    @property
    def law(self) -> Law | None:
        """The friction law; None without friction."""
        law: Any = self.friction if hasattr(self.friction, "bound") else Coulomb(self.friction)
        return None if isinstance(law, Coulomb) and law.friction == 0 else law


@dataclass(frozen=True)
class Scene:
    """An elastic body, what holds it, what loads it and what it may touch.

    Args:
        material: :class:`Elastic`, or a class of the user's with the same methods.
        supports: Prescribed displacements.
        loads: Tractions and body forces; several on one part add up.
        contacts: Contacts with rigid foundations.

    A single support, load or contact needs no list around it.

    Raises:
        InputError: If a boundary part is in two conditions that conflict, or an entry is of another type.
    """

    material: Elastic
    supports: Sequence[Displacement] = ()
    loads: Sequence[Traction | BodyForce] = ()
    contacts: Sequence[Contact] = ()

    def __post_init__(self) -> None:
        allowed = {"supports": (Displacement,), "loads": (Traction, BodyForce), "contacts": (Contact,)}
        missing = [member for member in MATERIAL if not hasattr(self.material, member)]
        if missing or isinstance(self.material, type):
            raise InputError(
                f"Scene: material is {self.material!r}; give an Elastic(E, nu), or an object of a class of your own "
                f"with {', '.join(MATERIAL)}."
            )
        for name, types in allowed.items():
            given: Any = getattr(self, name)
            if not isinstance(given, (*types, list, tuple)):
                raise InputError(
                    f"Scene: {name} is {given!r}; give a list of {' and '.join(t.__name__ for t in types)}."
                )
            entries = tuple(given) if isinstance(given, list | tuple) else (given,)
            for entry in entries:
                if not isinstance(entry, types):
                    raise InputError(
                        f"Scene: {name} holds {entry!r}; allowed are {' and '.join(t.__name__ for t in types)}."
                    )
            object.__setattr__(self, name, entries)
        self._check_conflicts()

    def _check_conflicts(self) -> None:
        fixed = [(s.facets, i) for s in self.supports for i, value in enumerate(s.value) if value is not None]
        for (facets, component), times in Counter(fixed).items():
            if times > 1:
                raise InputError(f"Component {component} of {facets!r} is fixed by {times} supports; keep one of them.")
        touching = Counter(c.facets for c in self.contacts)
        for facets, times in touching.items():
            if times > 1:
                raise InputError(f"{facets!r} is in {times} contacts; keep one of them.")
            others = [type(o).__name__ for o in (*self.supports, *self.loads) if getattr(o, "facets", None) == facets]
            if others:
                raise InputError(
                    f"{facets!r} is in a Contact and in a {others[0]}; a boundary part can be in one of them."
                )
        for load in self.tractions:
            free = {i for s in self.supports if s.facets == load.facets for i in range(len(s.value))}
            free -= {i for facets, i in fixed if facets == load.facets}
            held = any(s.facets == load.facets for s in self.supports)
            if held and not free:
                raise InputError(
                    f"{load.facets!r} has a Traction and a Displacement of all components; free a component (None) "
                    "or remove one of the two."
                )
            given = load.value if isinstance(load.value, tuple) else ()
            for i, value in enumerate(given):
                if (load.facets, i) in fixed and (callable(value) or value != 0):
                    raise InputError(
                        f"{load.facets!r} has a Traction and a Displacement in component {i}; make the Traction 0 "
                        "there, or free the Displacement (None)."
                    )
        lengths = [
            len(v)
            for v in (*(s.value for s in self.supports), *(c.normal for c in self.contacts))
            if isinstance(v, tuple)
        ]
        if any(a != b for a, b in pairwise(lengths)):
            raise InputError(f"The scene mixes vectors of {min(lengths)} and {max(lengths)} components.")

    @property
    def tractions(self) -> tuple[Traction, ...]:
        """The loads on the boundary."""
        return tuple(load for load in self.loads if isinstance(load, Traction))

    @property
    def body_forces(self) -> tuple[BodyForce, ...]:
        """The loads in the volume."""
        return tuple(load for load in self.loads if isinstance(load, BodyForce))
