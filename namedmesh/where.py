"""Say which facets or cells of a mesh a name means, by where they are.

A rule is a function of points, as DOLFINx's ``locate_entities_boundary`` takes it, or a
:class:`where`, or a list of these. A facet is meant if the rule holds at all its
vertices.

Symbols: d dimension.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from namedmesh.base import checks
from namedmesh.base.exceptions import InputError

NEAR = 1e-6
"""Distance from a plane x = constant that counts as none, over the extent of the body
along x [-].
"""
EXAMPLE = 'named({"foot": lambda x: np.isclose(x[1], 0.0)}) or named({"foot": ec.where(y=0.0)})'
"""Example for messages."""

Range = float | tuple[float | None, float | None]
"""A coordinate [length], or its least and greatest value; None leaves an end open."""


@dataclass(frozen=True)
class where:
    """Say which facets of the boundary a part has, by where they are.

    All conditions that are given hold together. A list of several ``where`` means the
    facets of each of them.

    Args:
        rule: Function of points x, shape (3, n), that returns n truth values. It must
            hold at all vertices of a facet.
        x: First coordinate of all vertices [length]: a number for a plane, or a pair
            ``(low, high)`` with None where an end is open.
        y: Second coordinate, the same.
        z: Third coordinate, the same.
        normal: Outward normal of the facets, shape (d,); its length does not matter.
        angle: Greatest angle between ``normal`` and the normal of a facet [degrees].
        region: Name of the region behind the facets.
        against: Name of another region that lies against the facets: it shares them
            (they are inside then, for ``split(on=)``), or its boundary lies there.
        within: Greatest distance of that boundary from the middle of a facet [length],
            as of :meth:`Domain.touching`; by default a share of the facet's size.

    Raises:
        InputError: If an argument cannot be worked with.

    Example:
        >>> foot = ec.where(y=0.0, x=(None, 1.0))
        >>> named = block.named({"foot": foot, "wall": ec.where(normal=(1.0, 0.0))})
        >>> list(named.names)
        ['left', 'bottom', 'top', 'foot', 'wall']
    """

    rule: Callable[[np.ndarray], Any] | None = None
    x: Range | None = None
    y: Range | None = None
    z: Range | None = None
    normal: Sequence[float] | None = None
    angle: float = 5.0
    region: str | None = None
    against: str | None = None
    within: float | None = None

    def __post_init__(self) -> None:
        """Check the conditions."""
        if self.rule is not None and not callable(self.rule):
            raise InputError(
                f"where: the rule is {checks.description(self.rule)}; give a function of points x, "
                "e.g. lambda x: np.isclose(x[1], 0.0)."
            )
        for name in "xyz":
            _check_range(name, getattr(self, name))
        _check_normal(self.normal)
        checks.positive("where: angle", self.angle, "an angle > 0 in degrees")
        for name in ("region", "against"):
            region = getattr(self, name)
            if region is not None and not isinstance(region, str):
                raise InputError(f"where: {name} is {region!r}; give the name of a region.")
        if self.within is not None:
            checks.positive("where: within", self.within, "a distance > 0 [length]")
            if self.against is None:
                raise InputError(
                    "where: within is the distance of another region; give against=, its name."
                )
        # The angle has a default, so it is no condition; a normal alone uses it.
        given = (self.rule, self.x, self.y, self.z, self.normal, self.region, self.against)
        if all(value is None for value in given):
            raise InputError(
                "where: no condition is given; give a function, x=, y=, z=, normal=, region= or "
                "against=."
            )

    @property
    def is_of_points(self) -> bool:
        """Tell whether it is about places alone, which cells have, too."""
        return self.normal is None and self.region is None and self.against is None

    def at_points(self, x: np.ndarray, extents: np.ndarray) -> np.ndarray:
        """Return at which points the conditions on places hold, shape (n,).

        Args:
            x: Points [length], shape (3, n).
            extents: Extents of the body along its axes [length], shape (d,).

        Raises:
            InputError: If z is given, and the body is in the plane.
        """
        if self.z is not None and len(extents) == 2:
            raise InputError(
                f"where: z is {self.z!r}, and the mesh is in the plane; give x= and y= only."
            )
        holds = np.ones(x.shape[1], dtype=bool)
        for axis, name in enumerate("xyz"[: len(extents)]):
            low, high = _ends(getattr(self, name))
            near = NEAR * extents[axis]
            holds &= (x[axis] >= low - near) & (x[axis] <= high + near)
        if self.rule is not None:
            holds &= _truth(self.rule(x), x.shape[1])
        return holds

    def along_normal(self, normals: np.ndarray) -> np.ndarray:
        """Tell which facets with outward normals (n, d) have the wanted normal, (n,).

        Raises:
            InputError: If the wanted one has another number of components.
        """
        if self.normal is None:
            return np.ones(len(normals), dtype=bool)
        wanted = np.asarray(self.normal, dtype=float)
        d = normals.shape[1]
        if len(wanted) != d:
            raise InputError(f"where: normal is {self.normal}; in {d}D it has {d} components.")
        cosine = normals @ (wanted / np.linalg.norm(wanted))
        return cosine >= np.cos(np.radians(self.angle))


Rule = Callable[[np.ndarray], Any] | where | Sequence[Callable[[np.ndarray], Any] | where]
"""What says where a part is."""


def as_rules(name: str, rule: Any) -> list[where]:
    """Return a rule as a list, of which one entry must hold.

    Args:
        name: Name of the part or region, for a message.
        rule: What the user gave.

    Raises:
        InputError: If it is no rule.
    """
    entries = list(rule) if isinstance(rule, list | tuple) else [rule]
    result = []
    for entry in entries:
        if not isinstance(entry, where) and not callable(entry):
            raise InputError(
                f"named: the rule of {name!r} is {checks.description(entry)}; give a function of "
                f"points, or where(...), e.g. {EXAMPLE}."
            )
        result.append(entry if isinstance(entry, where) else where(entry))
    if not result:
        raise InputError(f"named: {name!r} has no rule; e.g. {EXAMPLE}.")
    return result


def _check_range(name: str, value: Any) -> None:
    """Raise an InputError if a value is no coordinate, and no pair of two."""
    if value is None or checks.is_number(value):
        return
    pair = list(value) if isinstance(value, Sequence | np.ndarray) else []
    good = len(pair) == 2 and all(end is None or checks.is_number(end) for end in pair)
    if not good or isinstance(value, str) or not np.diff(_ends(value)) >= 0:
        raise InputError(
            f"where: {name} is {checks.description(value)}; give a coordinate, or a pair (low, "
            "high) in which None leaves an end open."
        )


def _check_normal(normal: Any) -> None:
    """Raise an InputError if a value is no direction."""
    if normal is None:
        return
    try:
        components = np.asarray(normal, dtype=float)
    except (TypeError, ValueError):
        components = np.zeros(0)
    if components.shape not in ((2,), (3,)) or not 0 < np.linalg.norm(components) < np.inf:
        raise InputError(
            f"where: normal is {checks.description(normal)}; give a direction, e.g. (0.0, -1.0)."
        )


def _ends(value: Any) -> tuple[float, float]:
    """Return the least and the greatest coordinate that a range means."""
    if value is None:
        return -np.inf, np.inf
    if checks.is_number(value):
        return float(value), float(value)
    low, high = value
    return -np.inf if low is None else float(low), np.inf if high is None else float(high)


def _truth(values: Any, count: int) -> np.ndarray:
    """Return what a user's function returned, as one truth value for each point.

    Raises:
        InputError: If it is something else.
    """
    array = np.asarray(values)
    if array.dtype != bool or array.shape not in ((), (count,)):
        raise InputError(
            f"named: a rule returned {checks.description(values)}, of type {array.dtype} and shape "
            f"{array.shape}, for {count} points; return a truth value for each point, e.g. "
            "np.isclose(x[1], 0.0)."
        )
    return np.broadcast_to(array, (count,))
