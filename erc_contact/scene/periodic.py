"""Declare sides at which copies of a body follow each other: periodic and cyclic.

The body is one of many copies. A motion ``x -> R x + t`` takes one side of it onto the
other one, where the next copy begins. So displacement and traction are

    u(R x + t) = R u(x) + E t,    r(R x + t) = -R r(x)

with the mean strain E, which only translations have. That is the law of a contact
between both sides that sticks and cannot open, whatever the traction, whose other side
is seen through the motion. So both sides are a contact of the scene for the solver. The
admissible stress knows no sides: their facets are facets inside the body of all copies
(:mod:`erc_contact.admissible.surrounded`), and add nothing to e.

Where the mean stress S is given, components of the jump ``E t`` are unknown. They are
shifts that are found for a force, as the shifts of preloads are: the side with the area
vector a carries ``S a``.
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


ACROSS = 1e-8
"""Component of a unit vector that counts as none [-]."""
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

    def jump_of(self, pair: PeriodicPair, area: np.ndarray) -> np.ndarray | None:
        """Return ``E t``, by how much more the next copy moves [length], or None."""
        return None

    def placed(self, pair: PeriodicPair, area: np.ndarray) -> Contact:
        """Return the contact with what its sides have on a mesh.

        Args:
            pair: The sides with the motion between them.
            area: Area vector out of the first side [area].
        """
        contact = copy(self)
        jump = self.jump_of(pair, area)
        normal = area / np.linalg.norm(area)
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
    make them, and gmsh with ``setPeriodic``. Refinement keeps that, and gmsh meshes
    both sides alike where a mesh is made anew. Energies and e belong to one copy.

    Args:
        facets: Name of a side.
        against: Name of the opposite side.
        mean_strain: E, rows of a symmetric matrix [-]; only ``E t`` counts. None is no
            strain.
        mean_stress: S, rows of a symmetric matrix [force/area], positive in tension; an
            entry None leaves the strain as it is given. A side carries ``S a``, where a
            is the vector of its area: without holes in the sides S is the mean stress
            of the copy. Strain components are found then, to eight digits of the force
            on each mesh. Give all pairs of a scene the same S: forces that turn the
            body are in no balance.

    Raises:
        InputError: If these are no two names, E or S is no symmetric matrix of numbers,
            or E is given where S is.

    Source: sigma^ has the forces ``S a``. So e (16) bounds the error of the body with
    this mean stress and the error of the body with the strain that is found; see
    :class:`Preload`, whose shift is found likewise.

    Example:
        >>> ec.Periodic("left", "right", mean_strain=((0.001, 0.0), (0.0, 0.0)))
        Periodic(facets='left', ..., mean_strain=((0.001, 0.0), (0.0, 0.0)), ...)
        >>> ec.Periodic("left", "right", mean_stress=((5.0, None), (None, None)))
        Periodic(facets='left', ..., mean_stress=((5.0, None), (None, None)))
    """

    mean_strain: Sequence[Numbers] | None = None
    mean_stress: Sequence[Sequence[float | None]] | None = None
    # The jump that was found for the mean stress [length].
    found: tuple[float, ...] | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the arguments."""
        super().__post_init__()
        for name in ("mean_strain", "mean_stress"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, self._checked(name))
        if self.mean_stress is None or self.mean_strain is None:
            return
        strain, stress = np.array(self.mean_strain), np.array(self.mean_stress, dtype=float)
        if strain.shape != stress.shape or (strain[~np.isnan(stress)] != 0.0).any():
            raise InputError(
                f"{self._what}: mean_strain is {self.mean_strain} and mean_stress"
                f" {self.mean_stress}; give each component one of them: None in mean_stress where"
                " the strain is given, and 0.0 in mean_strain where the stress is."
            )

    @property
    def _what(self) -> str:
        """Return the sides in words for messages."""
        return f"Periodic({self.facets!r})"

    def _checked(self, name: str) -> tuple[tuple[float | None, ...], ...]:
        """Return the rows of a symmetric matrix; a stress may have None in it.

        Raises:
            InputError: If it is none.
        """
        value = getattr(self, name)
        what = f"{self._what}: {name}"
        zeros = _with_zeros(value) if name == "mean_stress" else value
        rows: Any = check_strain(what, zeros)
        if not isinstance(rows, tuple) or any(callable(entry) for row in rows for entry in row):
            raise InputError(
                f"{what} is {value!r}; give d rows of d numbers, e.g. ((0.001, 0.0), (0.0, 0.0))."
                " In a history the scene is a function of time."
            )
        given = np.array(value, dtype=float)
        if (np.isnan(given) != np.isnan(given.T)).any():
            raise InputError(f"{what} is {value!r}; give None on both sides of the diagonal.")
        return tuple(tuple(row) for row in value)

    def pair_on(self, domain: Domain) -> PeriodicPair:
        """Return the sides with the translation between their centres; collective."""
        return translated(domain, self.facets, self.against)

    def with_jump(self, jump: Numbers) -> Periodic:
        """Return the sides with the jump that was found for S [length]."""
        sides = copy(self)
        object.__setattr__(sides, "found", tuple(map(float, jump)))
        return sides

    def is_free(self, pair: PeriodicPair, area: np.ndarray) -> np.ndarray:
        """Tell which components of the jump are found for a mean stress, shape (d,).

        Args:
            pair: The sides with the translation between them.
            area: Area vector of a side [area].

        Raises:
            InputError: If a component depends on strains and on stresses that are
                given, or S has not the dimension of the mesh.
        """
        d = len(area)
        stress = np.full((d, d), np.nan)
        if self.mean_stress is not None:
            stress = np.array(self.mean_stress, dtype=float)
        self._check_rows("mean_stress", len(stress), d)
        counts = abs(np.array(pair.shift)) > ACROSS * np.linalg.norm(pair.shift)
        counts |= abs(area) > ACROSS * np.linalg.norm(area)
        is_given = ~np.isnan(stress[:, counts])
        is_free: np.ndarray = is_given.all(axis=1)
        if (is_given.any(axis=1) & ~is_free).any():
            raise InputError(
                f"{self._what}: mean_stress is {self.mean_stress}, and the sides are across no"
                " axis, so that components mix; give all components of the mean stress."
            )
        return is_free

    def jump_of(self, pair: PeriodicPair, area: np.ndarray) -> np.ndarray | None:
        """Return ``E t`` [length], with what was found; None without a mean strain.

        Raises:
            InputError: If E or S has not the dimension of the mesh.
        """
        jump = None
        if self.mean_strain is not None:
            self._check_rows("mean_strain", len(self.mean_strain), len(area))
            jump = np.array(self.mean_strain, dtype=float) @ np.array(pair.shift)
        if self.found is None:
            return jump
        given = np.zeros(len(area)) if jump is None else jump
        return np.where(self.is_free(pair, area), self.found, given)

    def _check_rows(self, name: str, rows: int, d: int) -> None:
        """Check that a matrix has the dimension of the mesh."""
        if rows != d:
            raise InputError(
                f"{self._what}: {name} has {rows} rows, but the mesh is {d}D: give {d}."
            )


def translated_sides(contacts: Sequence[Contact]) -> list[Periodic]:
    """Return the periodic sides among contacts."""
    return [entry for entry in contacts if isinstance(entry, Periodic)]


def _with_zeros(value: Any) -> Any:
    """Return rows with zeros in place of None, and anything else itself."""
    if not isinstance(value, Sequence | np.ndarray):
        return value
    rows = []
    for row in value:
        entries = row if isinstance(row, Sequence | np.ndarray) else (row,)
        rows.append([0.0 if entry is None else entry for entry in entries])
    return rows


@dataclass(frozen=True)
class Cyclic(PeriodicSides):
    """Declare that a body is a sector, and n equal sectors about an axis are the whole.

    The turn by 360/n degrees takes the side ``facets`` onto the side ``against``; loads
    and contacts turn with it. The displacement of one side is the turned displacement
    of the other one. It stands among the supports or the contacts of a scene. Turns
    about the axis stay free, and in 3D translations along it. The sides may meet on the
    axis, in 3D on an axis along x, y or z, where u stays in place or moves along it.

    The facets of both sides must match, as gmsh makes them with ``setPeriodic``.
    Refinement keeps that, and gmsh meshes both sides alike where a mesh is made anew.
    Forces and energies belong to one sector;
    :func:`erc_contact.results.whole_force` gives the forces on all sectors.

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
