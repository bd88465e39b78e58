"""Declare sides at which copies of a body follow each other: periodic and cyclic.

The body is one of many copies. A motion ``x -> R x + t`` takes one side of it onto the
other one, where the next copy begins. So displacement and traction are

    u(R x + t) = R u(x) + E t,    r(R x + t) = -R r(x)

with the mean strain E, which only translations have. That is the law of a contact
between both sides that sticks and cannot open, whatever the traction, whose other side
is seen through the motion. So both sides are a contact of the scene: its multiplier is
the traction, its admissible tractions are all that are opposite, and it adds nothing to
e. No other stage knows copies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any, ClassVar

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl, Value
from erc_contact.scene.checks import check_name
from erc_contact.scene.contact import Contact, Foundation
from erc_contact.scene.law import Law
from erc_contact.scene.strain import check_strain
from namedmesh import Domain, PeriodicPair, translated, turned

Numbers = Sequence[float]
"""Components of a vector."""


class HeldTogether:
    """Declare that a contact sticks, whatever its traction."""

    parameters: ClassVar[tuple[str, ...]] = ()
    LIMIT = 1e100
    """Friction bound beyond the reach of any traction [force/area]."""

    def friction_bound(self, pressure: Ufl) -> float:
        """Return a bound that no traction reaches [force/area]."""
        return self.LIMIT


HELD = HeldTogether()
"""The law between copies of a body."""


@dataclass(frozen=True)
class PeriodicSides(Contact):
    """Declare two sides of a body that a motion takes onto each other.

    See :class:`Periodic` and :class:`Cyclic`.

    Args:
        facets: Name of the first side.
        against: Name of the side onto which the motion takes it.
    """

    is_symmetry: ClassVar[bool] = True
    against: str
    friction: Value | Law = field(default=HELD, init=False, repr=False)
    gap: Value = field(default=0.0, init=False, repr=False)
    normal: Numbers | Callable[[Any], Any] | str | None = field(
        default=None, init=False, repr=False
    )
    bilateral: bool = field(default=True, init=False, repr=False)
    foundation: Foundation | None = field(default=None, init=False, repr=False)
    motion: Sequence[Value] | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the names."""
        check_name(f"{type(self).__name__}({self.facets!r}): against", self.against)
        super().__post_init__()

    def pair_on(self, domain: Domain) -> PeriodicPair:
        """Return the sides with the motion between them; collective."""
        raise NotImplementedError

    def jump_of(self, pair: PeriodicPair) -> np.ndarray | None:
        """Return ``E t``, by how much more the next copy moves [length], or None."""
        return None

    def placed(self, pair: PeriodicPair, normal: np.ndarray) -> Contact:
        """Return the contact with what its sides have on a mesh.

        Args:
            pair: The sides with the motion between them.
            normal: Mean normal out of the first side [-].
        """
        contact = copy(self)
        jump = self.jump_of(pair)
        # The class is frozen, and a contact between bodies has no motion: only here.
        object.__setattr__(contact, "normal", tuple(normal.tolist()))
        if jump is not None:
            object.__setattr__(contact, "motion", tuple((-jump).tolist()))
        return contact


@dataclass(frozen=True)
class Periodic(PeriodicSides):
    """Declare that copies of a body follow each other along a vector, without end.

    The translation t takes the side ``facets`` onto the side ``against``. The stress is
    the same in all copies, and the displacement differs by ``E t`` of the mean strain
    E. A layer, a fibre in its cell, a wavy surface are such bodies. It stands among the
    supports or the contacts of a scene; several pairs, as left and right, bottom and
    top, make a body that is repeated in several directions. Translations of the body
    stay free.

    The facets of both sides must match, as ``rectangle`` and ``box`` with ``cells=``
    make them, and gmsh with ``setPeriodic``. Refinement keeps that; meshes that are
    made anew are refused. Energies and e belong to one copy.

    Args:
        facets: Name of a side.
        against: Name of the opposite side.
        mean_strain: E, rows of a symmetric matrix [-]; only ``E t`` counts. None is no
            strain.

    Raises:
        InputError: If these are no two names, or E is no symmetric matrix of numbers.

    Example:
        >>> ec.Periodic("left", "right", mean_strain=((0.001, 0.0), (0.0, 0.0)))
        Periodic(facets='left', against='right', mean_strain=((0.001, 0.0), (0.0, 0.0)))
    """

    mean_strain: Sequence[Numbers] | None = None

    def __post_init__(self) -> None:
        """Check the arguments."""
        super().__post_init__()
        if self.mean_strain is None:
            return
        what = f"Periodic({self.facets!r}): mean_strain"
        rows: Any = check_strain(what, self.mean_strain)
        if not isinstance(rows, tuple) or any(callable(entry) for row in rows for entry in row):
            raise InputError(
                f"{what} is {self.mean_strain!r}; give d rows of d numbers, e.g."
                " ((0.001, 0.0), (0.0, 0.0)). In a history the scene is a function of time."
            )
        object.__setattr__(self, "mean_strain", rows)

    def pair_on(self, domain: Domain) -> PeriodicPair:
        """Return the sides with the translation between their centres; collective."""
        return translated(domain, self.facets, self.against)

    def jump_of(self, pair: PeriodicPair) -> np.ndarray | None:
        """Return ``E t`` [length], or None without a mean strain.

        Raises:
            InputError: If E has not the dimension of the mesh.
        """
        if self.mean_strain is None:
            return None
        if len(self.mean_strain) != len(pair.shift):
            raise InputError(
                f"Periodic({self.facets!r}): mean_strain has {len(self.mean_strain)} rows, but the"
                f" mesh is {len(pair.shift)}D: give {len(pair.shift)}."
            )
        jump: np.ndarray = np.array(self.mean_strain, dtype=float) @ np.array(pair.shift)
        return jump


@dataclass(frozen=True)
class Cyclic(PeriodicSides):
    """Declare that a body is a sector, and n equal sectors about an axis are the whole.

    The turn by 360/n degrees takes the side ``facets`` onto the side ``against``; loads
    and contacts turn with it. The displacement of one side is the turned displacement
    of the other one. It stands among the supports or the contacts of a scene. Turns
    about the axis stay free, and in 3D translations along it.

    The facets of both sides must match, as gmsh makes them with ``setPeriodic``.
    Refinement keeps that; meshes that are made anew are refused. Forces and energies
    belong to one sector; :func:`erc_contact.results.whole_force` gives the forces on
    all sectors.

    Args:
        facets: Name of a side.
        against: Name of the other side.
        axis: In the plane a point of the axis, (x, y) [length]; in 3D two rows, a point
            and the direction.
        sectors: n, a whole number > 1.

    Raises:
        InputError: If these are no two names, the axis is no point (and direction), or
            n is no whole number > 1.

    Example:
        >>> ec.Cyclic("low", "cut", axis=(0.0, 0.0), sectors=12)
        Cyclic(facets='low', against='cut', axis=((0.0, 0.0),), sectors=12)
    """

    axis: Sequence[Any] = field(kw_only=True)
    sectors: int = field(kw_only=True)

    def __post_init__(self) -> None:
        """Check the arguments."""
        super().__post_init__()
        what = f"Cyclic({self.facets!r})"
        try:
            rows = np.atleast_2d(np.array(self.axis, dtype=float))
        except (TypeError, ValueError):
            rows = np.empty((0, 0))
        right = rows.shape in ((1, 2), (2, 3)) and bool(np.isfinite(rows).all())
        if not right or (len(rows) == 2 and not rows[1].any()):
            raise InputError(
                f"{what}: axis is {self.axis!r}; give a point (x, y) in the plane, and in 3D a"
                " point and a direction, ((x, y, z), (0.0, 0.0, 1.0))."
            )
        object.__setattr__(self, "axis", tuple(map(tuple, rows.tolist())))
        n: Any = self.sectors
        if isinstance(n, bool) or not isinstance(n, Integral) or n < 2:
            raise InputError(f"{what}: sectors is {n!r}; give a whole number > 1.")

    def pair_on(self, domain: Domain) -> PeriodicPair:
        """Return the sides with the turn of the first onto the second side; collective.

        Raises:
            InputError: If the axis has not the dimension of the mesh.
        """
        if len(self.axis[0]) != domain.dim:
            raise InputError(
                f"Cyclic({self.facets!r}): axis is {self.axis}, and the mesh is {domain.dim}D; in"
                " the plane give a point, in 3D a point and a direction."
            )
        return turned(domain, self.facets, self.against, self.axis, self.sectors)
