"""Hold and print a row of the table of an adaptive run."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from erc_contact.run.columns import Column
from namedmesh.base.percent import percent

CONTACT = "a contact"
CURVED = "curved parts"
FLAT = "flat parts alone"
"""What columns need."""


@dataclass(frozen=True)
class Step:
    """Hold the numbers of one mesh of an adaptive run.

    Times are wall times, the largest over the ranks [s].

    Attributes:
        cells: Number of elements.
        vertices: Number of vertices.
        dofs: Degrees of freedom.
        newton_steps: Newton steps.
        method: Name of the contact method whose solution it is.
        eps: Relative error (17).
        eps_bulk: Bulk part of eps.
        eps_contact: Contact part of eps.
        eps_geometry: What flat facets of a curved body cost beside eps.
        solve_seconds: Seconds of the contact solve.
        equilibrate_seconds: Seconds of the admissible pair.
        error_seconds: Seconds of the error.
        mesh_seconds: Seconds of making this mesh.
        seconds: Seconds from the start of the run to this error, all stages of all
            meshes.
        peak_stress: Greatest von Mises stress of the mean of sigma^ in a cell
            [force/area].
        peak_stress_size: Size of that cell [length].
        peak_pressure: Greatest pressure of r^ [force/area]; nan without a contact.
        peak_pressure_size: Size of its facet [length].
        peak_shear: Greatest shear of r^ [force/area]; nan without a contact.
        peak_shear_size: Size of its facet [length].

    Example:
        >>> step = history.steps[0]
        >>> f"{step.cells} cells, eps = {step.eps:.1%}, {step.method}"
        '16 cells, eps = 12.3%, Nitsche'
    """

    cells: int
    vertices: int
    dofs: int
    newton_steps: int
    method: str
    eps: float
    eps_bulk: float
    eps_contact: float
    eps_geometry: float
    solve_seconds: float
    equilibrate_seconds: float
    error_seconds: float
    mesh_seconds: float
    seconds: float
    peak_stress: float = np.nan
    peak_stress_size: float = np.nan
    peak_pressure: float = np.nan
    peak_pressure_size: float = np.nan
    peak_shear: float = np.nan
    peak_shear_size: float = np.nan

    @property
    def total(self) -> float:
        """Compute eps with the estimate of the geometry [-], which a run lowers."""
        return float(np.hypot(self.eps, self.eps_geometry))


COLUMNS = tuple(column.name for column in fields(Step))
"""Names of the columns in the CSV file, in order."""
SHOWN = (
    Column("cells", "cells", 6, lambda step: str(step.cells)),
    Column("verts", "", 6, lambda step: str(step.vertices)),
    Column("dofs", "unknowns", 7, lambda step: str(step.dofs)),
    Column("N", "Newton", 2, lambda step: str(step.newton_steps)),
    Column("total", "total", 7, lambda step: percent(step.total, 3), CURVED),
    Column("eps", "eps", 7, lambda step: percent(step.eps, 3)),
    Column("bulk", "bulk", 7, lambda step: percent(step.eps_bulk, 3), CONTACT),
    Column("cont", "contact", 7, lambda step: percent(step.eps_contact, 3), CONTACT),
    Column("geom", "geometry", 7, lambda step: percent(step.eps_geometry, 3), CURVED),
    Column("", "method", 0, lambda step: step.method),
    Column("s_sol", "", 5, lambda step: f"{step.solve_seconds:.2f}"),
    Column("s_equ", "", 5, lambda step: f"{step.equilibrate_seconds:.2f}"),
    Column("s_err", "", 5, lambda step: f"{step.error_seconds:.2f}", FLAT),
    Column("s_mes", "", 5, lambda step: f"{step.mesh_seconds:.2f}", FLAT),
    Column("seconds", "seconds", 7, lambda step: f"{step.seconds:.2f}"),
)
"""Columns of the table.

"total" is eps with what the flat facets of a curved body cost: the number that a run
lowers to its accuracy. "bulk" and "cont" are parts of eps, which without a contact has
one. Columns s_... are seconds of the stages.
"""


def columns_of(*, curved: bool, has_contact: bool) -> list[Column]:
    """Return the columns that mean something.

    Args:
        curved: Whether the body has curved parts, so that its flat facets cost
            something.
        has_contact: Whether the scene has a contact.
    """
    has = {"": True, CURVED: curved, FLAT: not curved, CONTACT: has_contact}
    return [column for column in SHOWN if has[column.needs]]
