"""List the forces of supports and contacts with their certified intervals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.interval import interval
from erc_contact.error.numbers import Bounds
from erc_contact.scene.goal import Resultant

NEGLIGIBLE = 1e-6
"""Component of a force over the greatest force that is not listed [-]."""


@dataclass(frozen=True)
class BoundedForce:
    """Hold a component of a force.

    Attributes:
        part: Name of the part on which it acts.
        axis: "x", "y" or "z"; of axisymmetric bodies "r" or "z".
        computed: The component that the displacement has by its nodal forces [force].
        bounds: The interval of the exact solution; None if there is none.
        why: Why there is none.
    """

    part: str
    axis: str
    computed: float
    bounds: Bounds | None
    why: str = ""

    @property
    def row(self) -> tuple[str, str, str, str]:
        """Return part, axis, component and interval in words."""
        words = self.why if self.bounds is None else _in_words(self.bounds)
        return self.part, self.axis, f"{self.computed:.5g}", words

    @property
    def is_outside(self) -> bool:
        """Tell whether the component is outside its interval."""
        bounds = self.bounds
        return bounds is not None and not bounds.low <= self.computed <= bounds.high


def bounded_forces(error: ConstitutiveError) -> list[BoundedForce]:
    """Bound the forces of supports and contacts, all that matter; collective."""
    scene = error.solution.scene
    names = [support.facets for support in scene.supports]
    names += [contact.sides[0] for contact in scene.contacts]
    forces = {name: error.solution.force(name).force for name in dict.fromkeys(names)}
    greatest = max((abs(force).max() for force in forces.values()), default=0.0)
    rows = []
    for name, force in forces.items():
        for axis in np.flatnonzero(abs(force) > NEGLIGIBLE * greatest):
            rows.append(_bounded(error, name, int(axis), float(force[axis])))
    return rows


def _bounded(error: ConstitutiveError, name: str, axis: int, computed: float) -> BoundedForce:
    """Bound a component of the force on a part; collective."""
    space = error.model.space
    letter = ("rz" if space.axisymmetric else "xyz")[axis]
    direction = tuple(np.eye(space.d)[axis].tolist())
    try:
        bounds = interval(error, Resultant(name, direction))
    except (InputError, NotConverged) as reason:
        return BoundedForce(name, letter, computed, None, f"no interval: {reason}")
    return BoundedForce(name, letter, computed, bounds)


def _in_words(bounds: Bounds) -> str:
    """Write an interval."""
    kind = "proved" if bounds.guaranteed else "estimated"
    return f"between {bounds.low:.5g} and {bounds.high:.5g} ({kind})"


def in_columns(rows: list[BoundedForce]) -> Iterator[str]:
    """Yield the lines of a table of forces."""
    cells = [row.row for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)][:-1]
    for *first, last in cells:
        columns = [word.ljust(width) for word, width in zip(first, widths, strict=True)]
        yield "  ".join([*columns, last])
