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

UNKNOWN_SHARE = 1e-3
"""Share of a gap that its integral may leave unknown [-]; e^2 contains it."""


class LawError(NamedTuple):
    """Hold how far a pair is from a law, on the cells that this rank owns.

    Attributes:
        gap: Twice the integral of Fenchel's gap [force length], shape (owned,).
        of_sum: Square of the energy norm of the sum of both stresses or tractions
            [force length], shape (owned,).
        moduli: Square of the oscillation of the moduli on this rank [force length].
        gaps: Likewise, of the gaps of contacts.
        friction: Likewise, of the friction bounds.

    Example:
        >>> from erc_contact.error.bulk import body_error
        >>> body = body_error(admissible)
        >>> f"{body.gap.sum() ** 0.5:.4f}"  # e, as no contact adds to it here
        '0.1241'
        >>> f"{body.of_sum.sum() ** 0.5:.4f}"  # the scale, so that eps is 0.1234
        '1.0055'
    """

    gap: np.ndarray
    of_sum: np.ndarray
    moduli: float = 0.0
    gaps: float = 0.0
    friction: float = 0.0
