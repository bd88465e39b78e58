"""Measure how far an admissible pair is from each law of a scene.

A law is the pair of a convex energy psi, of a strain or of the displacement of a side,
and its conjugate psi*, of the stress or traction. Fenchel's inequality

    psi(u^) + psi*(sigma^) - u^ sigma^  >=  0

is an equality only where the law holds. Twice the integral of its left side is the
*gap* of the law, and e^2 (16) is the sum of the gaps of the body, of its springs, and
of its contacts. The square of the scale (17) is the sum of ``|sigma^ + C eps(u^)|^2``
over the laws that store energy: the body, springs, compliant foundations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.springs import spring_squares
from erc_contact.error.bulk import bulk_squares
from erc_contact.error.contact import contact_squares
from erc_contact.model.over_ranks import sums_of_cells


class LawError(NamedTuple):
    """Hold how far a pair is from a law, on the cells that this rank owns.

    Attributes:
        gap: Twice the integral of Fenchel's gap [force length], shape (owned,).
        both: Square of the energy norm of the sum of both stresses or tractions [force
            length], shape (owned,).
        moduli: Square of the oscillation of the moduli on this rank [force length].
        gaps: Likewise, of the gaps of contacts.
        friction: Likewise, of the friction bounds.
    """

    gap: np.ndarray
    both: np.ndarray
    moduli: float = 0.0
    gaps: float = 0.0
    friction: float = 0.0


def body_error(pair: Admissible) -> LawError:
    """Measure the error in Hooke's law, ``|sigma^ - C eps(u^)|^2``; collective."""
    gap, both, moduli = bulk_squares(pair)
    return LawError(gap, both, moduli)


def spring_error(pair: Admissible) -> LawError:
    """Measure the error in the law of springs, for the cells that they hold."""
    gap, both = spring_squares(pair.model, pair.displacement, pair.spring_tractions)
    return LawError(gap, both)


def contact_law_error(pair: Admissible, floor: float) -> LawError:
    """Measure the error in the laws of all contacts; collective.

    Args:
        pair: The pair.
        floor: What the integral over each contact may leave unknown [force length].
    """
    model = pair.model
    gap, both = np.zeros((2, model.domain.owned_cells))
    gaps = 0.0
    friction = 0.0
    for traction in pair.tractions:
        squares = contact_squares(model, pair.displacement, traction, floor)
        trace = traction.contact.trace
        of_cells = trace.share(np.maximum(squares.parts, 0.0))  # below 0 by round-off only
        if trace.there is None:
            gap += of_cells[: len(gap)]
        else:
            gap += sums_of_cells(model, of_cells)
        both += trace.share(squares.both)[: len(both)]
        gaps += squares.gaps
        friction += squares.friction
    return LawError(gap, both, gaps=gaps, friction=friction)
