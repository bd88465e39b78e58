"""List the forces of supports and contacts with their certified intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.numbers import Bounds
from namedmesh.base.html import in_columns, table

type BoundsOf = Callable[[ConstitutiveError, str, tuple[float, ...]], Bounds]

NEGLIGIBLE = 1e-6
"""Component of a force over the greatest force that is not listed [-]."""
ROUND_OFF = 1e-5
"""Distance to an interval over its ends that is none: files have six digits [-]."""


@dataclass(frozen=True)
class BoundedForce:
    """Hold a component of a force.

    Attributes:
        part: Name of the part on which it acts.
        axis: "x", "y" or "z"; of axisymmetric bodies "r" or "z"; "bolt" along a bolt.
        computed: The component that the displacement, or the other code, has by its
            nodal forces [force]; None if these are not known.
        bounds: The interval of the exact solution; None if there is none.
        why: Why there is none.
    """

    part: str
    axis: str
    computed: float | None
    bounds: Bounds | None
    why: str = ""

    @property
    def row(self) -> tuple[str, str, str, str]:
        """Return part, axis, component and interval in words."""
        words = "no interval" if self.bounds is None else _in_words(self.bounds)
        number = "" if self.computed is None else f"{self.computed:.5g}"
        return self.part, self.axis, number, words

    @property
    def is_outside(self) -> bool:
        """Tell whether the component is outside its interval."""
        if self.bounds is None or self.computed is None:
            return False
        low, high = self.bounds.low, self.bounds.high
        room = ROUND_OFF * max(abs(low), abs(high))
        return not low - room <= self.computed <= high + room


def contact_names(error: ConstitutiveError) -> list[str]:
    """Return the first side of each contact."""
    return [contact.sides[0] for contact in error.solution.scene.contacts]


def axes_of(error: ConstitutiveError) -> str:
    """Return a letter for each axis of a body."""
    return "rz" if error.model.space.axisymmetric else "xyz"


def bounded_forces(
    error: ConstitutiveError, names: Sequence[str], bounds_of: BoundsOf
) -> list[BoundedForce]:
    """Bound the components of the forces on parts that matter; collective.

    Args:
        error: The error.
        names: The parts.
        bounds_of: Bounds the component of the force on a part in a direction, as
            :func:`erc_contact.resultant` does. Where it raises there is no interval.
    """
    forces = {name: error.solution.force(name).force for name in dict.fromkeys(names)}
    greatest = max((abs(force).max() for force in forces.values()), default=0.0)
    letters = axes_of(error)
    rows = []
    for name, force in forces.items():
        for axis in np.flatnonzero(abs(force) > NEGLIGIBLE * greatest):
            direction = tuple(np.eye(len(force))[axis].tolist())
            bounds, why = None, ""
            try:
                bounds = bounds_of(error, name, direction)
            except (InputError, NotConverged) as reason:
                why = str(reason)
            rows.append(BoundedForce(name, letters[axis], float(force[axis]), bounds, why))
    return rows


def _in_words(bounds: Bounds) -> str:
    """Write an interval."""
    kind = "proved" if bounds.guaranteed else "estimated"
    return f"between {bounds.low:.5g} and {bounds.high:.5g} ({kind})"


def forces_in_columns(rows: Sequence[BoundedForce]) -> str:
    """Write a table of forces, and below it why some have no interval."""
    reasons = dict.fromkeys(row.why for row in rows if row.why)
    return "\n".join([in_columns([row.row for row in rows]), *reasons])


def forces_in_html(rows: Sequence[BoundedForce]) -> str:
    """Return a table of forces for a report; empty if there are none."""
    header = ("part", "axis", "computed [force]", "exact solution [force]")
    return table([row.row for row in rows], header) if rows else ""
