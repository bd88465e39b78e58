"""Squares of the contact part of the error and of the oscillations, over all ranks."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError
from erc_contact.error.contact import contact_squares
from erc_contact.error.oscillation import of_history, of_loads, of_supports
from erc_contact.model.over_ranks import sums_of_cells


def contact_and_oscillations(
    admissible: Admissible, cells_2: np.ndarray, moduli_2: float, floor: float
) -> tuple[float, np.ndarray]:
    """Measure the contact part of e and the oscillations; collective.

    The contact part is added to the squares of the cells, in place.

    Args:
        admissible: The pair.
        cells_2: Squares of the owned cells [force length].
        moduli_2: Square of the oscillation of the moduli on this rank [force length].
        floor: What integrals on contacts may leave unknown [force length].

    Returns:
        The squares of the contact part, and of the :class:`Oscillations`, shape (6,).
    """
    model = admissible.model
    loads_2 = of_loads(model, admissible.cell_geometry, admissible.cell_forces)
    supports_2 = of_supports(model)
    history_2 = of_history(model)
    contact_2 = 0.0
    gaps_2 = 0.0
    friction_2 = 0.0
    for traction in admissible.tractions:
        facets_2, of_gap, of_friction = contact_squares(
            model, admissible.displacement, traction, floor
        )
        facets_2 = np.maximum(facets_2, 0.0)  # negative by round-off only
        trace = traction.contact.trace
        of_cells = trace.share(facets_2)
        if trace.there is None:
            cells_2 += of_cells[: len(cells_2)]
        else:
            cells_2 += sums_of_cells(model, of_cells)
        contact_2 += float(facets_2.sum())
        gaps_2 += of_gap
        friction_2 += of_friction
    # One sum over the ranks for all of them.
    squares = np.array([contact_2, loads_2, supports_2, moduli_2, gaps_2, friction_2, history_2])
    total = model.comm.allreduce(squares, MPI.SUM)
    return total[0], total[1:]


def raise_if_no_number(lost: bool, squares: np.ndarray) -> None:
    """Raise an error if an energy overflows or underflows.

    Args:
        lost: Whether the round-off underflows.
        squares: Squares of norms [force length].
    """
    if lost or not np.isfinite(squares).all():
        raise InputError(
            "The energy of this scene is no number of double precision; loads or moduli are too "
            "large or too small. Choose units in which they are nearer to 1."
        )
