"""List the forces of supports and contacts with their certified intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from erc_contact.admissible.fields import sides_of
from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.error.bounds import resultant
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.interval import interval
from erc_contact.error.numbers import Bounds
from erc_contact.scene.goal import BoltForce, Resultant
from erc_contact.scene.load import BodyForce
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload
from namedmesh.base.ranks import of_all
from namedmesh.for_solvers import SAME_PLACE, FileField, closest
from namedmesh.simplex import of_facets

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
        computed: The component that the other code has by its nodal forces [force];
            None if these are not known.
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


def bounded_forces(error: ConstitutiveError) -> list[BoundedForce]:
    """Bound the forces of supports and contacts, all that matter; collective."""
    scene = error.solution.scene
    contacts = [contact.sides[0] for contact in scene.contacts]
    names = [*(support.facets for support in scene.supports), *contacts]
    forces = {name: error.solution.force(name).force for name in dict.fromkeys(names)}
    greatest = max((abs(force).max() for force in forces.values()), default=0.0)
    letters = "rz" if error.model.space.axisymmetric else "xyz"
    rows = []
    for name, force in forces.items():
        for axis in np.flatnonzero(abs(force) > NEGLIGIBLE * greatest):
            direction = tuple(np.eye(len(force))[axis].tolist())
            bounds, why = _bounds_of(error, name, direction, is_contact=name in contacts)
            rows.append(BoundedForce(name, letters[axis], float(force[axis]), bounds, why))
    return rows


def bolt_forces(error: ConstitutiveError, scene: Scene) -> list[BoundedForce]:
    """Bound the forces of bolts with the shifts of a result; collective.

    Args:
        error: The error of the result, whose scene has the shifts.
        scene: The scene that prescribes the forces of some bolts.
    """
    rows = []
    for tie in scene.ties:
        if isinstance(tie, Preload) and tie.force is not None:
            try:
                bounds, why = interval(error, BoltForce(tie.facets)), ""
            except (InputError, NotConverged) as reason:
                bounds, why = None, str(reason)
            rows.append(BoundedForce(tie.facets, "bolt", tie.force, bounds, why))
    return rows


def with_forces_of(
    rows: Sequence[BoundedForce], error: ConstitutiveError, field: FileField
) -> list[BoundedForce]:
    """Return forces with the components that a file has; collective.

    A file lists reactions and loads of nodes together. Where a node of a support has a
    load, too, or any other node has a force, the force of a part is not known.
    """
    known = _forces_in_file(error, field)
    result = []
    for row in rows:
        force = known.get(row.part)
        computed = None if force is None else float(force["xyz".index(row.axis)])
        result.append(replace(row, computed=computed))
    return result


def _forces_in_file(error: ConstitutiveError, field: FileField) -> dict[str, np.ndarray]:
    """Sum the forces on the nodes of supports that a file in 3D has; collective."""
    scene = error.solution.scene
    has_body_force = any(isinstance(load, BodyForce) for load in scene.loads)
    if field.forces is None or error.domain.dim < 3 or has_body_force:
        return {}
    supports = {support.facets for support in scene.supports}
    loads = {load.facets for load in scene.loads if load.facets is not None}
    x = field.x[: len(field.forces)]
    on = {name: _is_on_part(error, name, x) for name in sorted(supports | loads)}
    count = np.zeros(len(x), dtype=np.int64)
    for is_on in on.values():
        count += is_on
    size = abs(field.forces).max(axis=1)
    has_force = size > ROUND_OFF * size.max(initial=0.0)
    if (has_force & (count == 0)).any():
        return {}
    forces = {}
    for name in supports:
        if (count[on[name]] == 1).all():
            forces[name] = field.forces[on[name]].sum(axis=0)
    return forces


def _is_on_part(error: ConstitutiveError, name: str, x: np.ndarray) -> np.ndarray:
    """Tell which points (n, 3) lie on a part, the same on all ranks; collective."""
    space = error.model.space
    sides = sides_of(error.model, name)
    corners = of_facets(space.cell_corners()[sides[:, 0]], sides[:, 1])
    (every,) = of_all(space.comm, corners)
    return np.asarray(closest(x, every).distance <= SAME_PLACE * error.domain.extent)


def _bounds_of(
    error: ConstitutiveError, name: str, direction: tuple[float, ...], *, is_contact: bool
) -> tuple[Bounds | None, str]:
    """Bound a component of the force on a part; collective.

    Returns:
        The interval, or None and why there is none.
    """
    try:
        return interval(error, Resultant(name, direction)), ""
    except (InputError, NotConverged) as reason:
        # A contact has an interval of lower order, which needs no further solution.
        return (resultant(error, name, direction), "") if is_contact else (None, str(reason))


def _in_words(bounds: Bounds) -> str:
    """Write an interval."""
    kind = "proved" if bounds.guaranteed else "estimated"
    return f"between {bounds.low:.5g} and {bounds.high:.5g} ({kind})"


def in_columns(rows: list[BoundedForce]) -> str:
    """Write a table of forces, and below it why some have no interval."""
    cells = [row.row for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = []
    for row in cells:
        columns = [word.ljust(width) for word, width in zip(row, widths, strict=True)]
        lines.append("  ".join(columns).rstrip())
    reasons = dict.fromkeys(row.why for row in rows if row.why)
    return "\n".join([*lines, *reasons])
