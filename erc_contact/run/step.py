"""Hold and print a row of the table of an adaptive run."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from erc_contact.base.percent import percent


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
    "mesh",
    "cells",
    "unknowns",
    "Newton",
    "eps",
    "bulk",
    "contact",
    "geometry",
    "method",
    "seconds",
)
"""Columns of the table in notebooks and reports."""
HEADER = "  cells  verts    dofs  N     eps    bulk    cont solve equil error  mesh   time"
CURVED = "  cells  verts    dofs  N   total     eps    bulk    cont    geom solve equil   time"
"""The header for a body with curved parts, whose flat facets cost something.

The column "total" is eps with that: the number that a run lowers to its accuracy.
"""


def line(step: Step, *, curved: bool) -> str:
    """Write the row of a step below :data:`HEADER` or :data:`CURVED`."""
    counts = f"{step.cells:7d} {step.vertices:6d} {step.dofs:7d} {step.newton_steps:2d}"
    bulk = percent(step.eps_bulk, 3)
    contact = percent(step.eps_contact, 3)
    errors = f"{percent(step.eps, 3):>7} {bulk:>7} {contact:>7}"
    times = f"{step.solve_seconds:5.2f} {step.equilibrate_seconds:5.2f}"
    if curved:
        total = percent(step.total, 3)
        geometry = percent(step.eps_geometry, 3)
        return f"{counts} {total:>7} {errors} {geometry:>7} {times} {step.seconds:6.1f}"
    times += f" {step.error_seconds:5.2f} {step.mesh_seconds:5.2f}"
    return f"{counts} {errors} {times} {step.seconds:6.1f}"


def shown(number: int, step: Step) -> list[str]:
    """Return the entries of a step below :data:`SHOWN`."""
    counts = (number, step.cells, step.dofs, step.newton_steps)
    errors = (step.eps, step.eps_bulk, step.eps_contact, step.eps_geometry)
    row = [str(count) for count in counts]
    row += [percent(error, 3) for error in errors]
    return [*row, step.method, f"{step.seconds:.2f}"]
