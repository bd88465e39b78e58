"""Bound the round-off of strains and of their energies."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.elastic import greatest_moduli, strain_digits
from erc_contact.admissible.pair import Admissible

RESOLUTION = 1e-12
"""Accuracy of the solver: error of a displacement over its size [-]."""


def strain_round_off(admissible: Admissible) -> np.ndarray:
    """Bound the round-off of ``C eps(u^)`` in the energy norm of each owned cell.

    Returns:
        The norms [sqrt(force length)], shape (owned,).
    """
    model = admissible.model
    cells = admissible.cell_geometry
    owned = model.domain.owned_cells
    digits = strain_digits(cells, admissible.displacement, owned)
    # The largest entry of the moduli bounds the energy of a strain, up to a constant.
    energies = greatest_moduli(model, cells, owned) * cells.volume[:owned]
    return np.asarray(digits * np.sqrt(energies))


def round_off(admissible: Admissible) -> tuple[float, bool]:
    """Estimate the accuracy of ``C eps(u)`` in the energy norm; collective.

    The accuracy of a displacement of size |u| is ``RESOLUTION |u|``, so the accuracy of
    its strain in a cell of size h is ``RESOLUTION |u|/h``.

    Returns:
        Its square [force length], and whether it underflows.
    """
    model = admissible.model
    cells = admissible.cell_geometry
    comm = model.space.comm
    owned = model.domain.owned_cells
    largest = float(abs(admissible.displacement.x.array).max(initial=0.0))
    size = comm.allreduce(largest, MPI.MAX)
    volume = cells.volume[:owned]
    local = np.sum(greatest_moduli(model, cells, owned) * volume ** (1 - 2 / model.space.d))
    floor = float((RESOLUTION * size) ** 2 * comm.allreduce(float(local), MPI.SUM))
    return floor, size > 0.0 and floor == 0.0
