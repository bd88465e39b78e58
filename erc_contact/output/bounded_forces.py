"""List the forces of supports and contacts with their certified intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.numbers import Bounds
from namedmesh.base.html import in_columns, table

type BoundsOf = Callable[[ConstitutiveError, str, tuple[float, ...]], Bounds]

NEGLIGIBLE = 1e-6
"""Component of a force over the greatest force that is not listed [-]."""
DRAWN_WIDTH = 360
"""Width of the drawing of intervals [pixels]."""
NAME_WIDTH = 140
"""Width of the names in it [pixels]."""
ROW_HEIGHT = 22
"""Height of a component in it [pixels]."""
INSIDE = 0.8
"""Share of its width that the widest interval takes [-]."""
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
    return table([row.row for row in rows], header) + _drawn(rows) if rows else ""


def _drawn(rows: Sequence[BoundedForce]) -> str:
    """Draw how far each component of the exact solution may be from what is computed.

    The drawing is SVG in the colour of the text; empty if no row has an interval.
    """
    drawn = []
    for row in rows:
        if row.bounds is not None and np.isfinite([row.bounds.low, row.bounds.high]).all():
            zero = row.bounds.value if row.computed is None else row.computed
            drawn.append((f"{row.part} {row.axis}", row.bounds.low - zero, row.bounds.high - zero))
    reach = max((max(abs(low), abs(high)) for _, low, high in drawn), default=0.0)
    if reach == 0.0:
        return ""
    half = (DRAWN_WIDTH - NAME_WIDTH) / 2
    middle = NAME_WIDTH + half

    def place(change: float) -> str:
        return f"{middle + INSIDE * half * change / reach:.1f}"

    lines = []
    for number, (name, low, high) in enumerate(drawn):
        y = ROW_HEIGHT * number + ROW_HEIGHT // 2
        ends = f'x1="{place(low)}" x2="{place(high)}" y1="{y}" y2="{y}"'
        lines.append(f'<text x="0" y="{y + 4}">{escape(name)}</text>')
        lines.append(f'<line {ends} class="interval"/>')
        lines.append(f'<circle cx="{place(0.0)}" cy="{y}" r="3"/>')
    axis = ROW_HEIGHT * len(drawn)
    lines.append(f'<line x1="{NAME_WIDTH}" x2="{DRAWN_WIDTH}" y1="{axis}" y2="{axis}"/>')
    for change in (-reach, 0.0, reach):
        x = place(change)
        words = f"{change:+.3g}" if change else "0"
        lines.append(f'<line x1="{x}" x2="{x}" y1="{axis}" y2="{axis + 4}"/>')
        lines.append(f'<text x="{x}" y="{axis + 17}" text-anchor="middle">{words}</text>')
    words = "Exact solution less computed component [force]"
    height = axis + ROW_HEIGHT
    return (
        f'<figure><svg class="intervals" viewBox="0 0 {DRAWN_WIDTH} {height}" role="img" '
        f'aria-label="{words}">{"".join(lines)}</svg><figcaption>{words}.</figcaption></figure>'
    )
