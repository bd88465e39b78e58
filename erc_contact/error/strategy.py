"""How the next mesh follows from an error: uniform refinement, marking, or the optimal mesh.

A strategy is any object with ``next``; write your own in the same few lines.

Source: Doerfler, SIAM J. Numer. Anal. 33 (1996), for marking; Coorevits, Hild, Hjiaj for the optimal mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log
from typing import Protocol

import numpy as np
from mpi4py import MPI

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.base.percent import percent
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.sizes import size_map
from erc_contact.mesh.domain import Domain

CLOSE = 1.2
"""If the error is below this multiple of the accuracy, marked elements are refined instead. A new mesh of nearly the
same sizes might miss the accuracy again and again, because the prediction is right to 5 or 10% only."""
KNOWN = 0.25
"""Relative error below which a mesh can predict the number of cells for an accuracy. For a half disc pressed on a plane
a first mesh with an error of 79% predicted 7 million cells where 2200 were enough. A mesh with 11% predicted twice as
many as needed."""
DOUBT = 4.0
"""Factor by which such a prediction may be too large [-]. A run ends if it exceeds ``max_cells`` by more."""
TIE = 1e-6
"""Elements whose errors differ by less than this fraction are marked together, so that round-off does not choose."""


class Strategy(Protocol):
    """A way to choose the next mesh from an error.

    Example: ``demos/extend/strategy.py``.
    """

    def next(self, error: ConstitutiveError, accuracy: float, max_cells: int) -> Domain:
        """The next domain; collective: it is called on all ranks, and all must come to the same decision.

        ``error.domain.refined(marked)`` refines cells of each rank, given by their numbers.
        ``error.domain.remeshed(h)`` makes a mesh with sizes h. A domain equal to the last one is not refused: the run
        goes on until ``max_steps``.

        Args:
            error: The error of the last mesh, above the accuracy. ``error.total_indicators`` has the errors of
                the cells that this rank owns: a rank may have none. Greatest values and sums are to be reduced over all
                ranks, by ``error.domain.mesh.comm``.
            accuracy: Prescribed relative error of the run.
            max_cells: Greatest number of cells of a mesh that will be solved. A domain with more cells ends the run.

        Raises:
            InputError: If there is no next domain; the run then ends with its best result and the words given here.
        """


@dataclass(frozen=True)
class Mark:
    """Refine the fewest elements that carry a fraction of the squared error (Doerfler marking).

    Args:
        fraction: Share of eps^2 that the marked elements carry, in (0, 1].

    Raises:
        InputError: If the fraction is outside (0, 1].
    """

    fraction: float = 0.5

    def __post_init__(self) -> None:
        checks.fraction("Mark: fraction", self.fraction)

    def next(self, error: ConstitutiveError, accuracy: float, max_cells: int) -> Domain:
        """The domain with the marked elements refined; collective."""
        return error.domain.refined(mark(error, self.fraction))


@dataclass(frozen=True)
class Uniform:
    """Refine all elements, for comparison."""

    def next(self, error: ConstitutiveError, accuracy: float, max_cells: int) -> Domain:
        """The domain with all elements refined; collective."""
        return error.domain.refined()


@dataclass(frozen=True)
class SizeMap:
    """Mesh the true geometry again with the optimal sizes, which may be larger than before.

    Args:
        aim: Factor of the accuracy for which the sizes are optimal. It is below 1, because a mesh that just misses the
            accuracy costs another mesh. A mesh that is 5% below the accuracy costs only 10% more elements (degree 1,
            2D).
        leap: Greatest factor by which the error is to fall from one mesh to the next. A larger fall takes several equal
            steps, because a coarse mesh predicts the sizes of a much finer one badly.

    Raises:
        InputError: If aim is outside (0, 1], or leap is not > 1.
    """

    aim: float = 0.95
    leap: float = 4.0

    def __post_init__(self) -> None:
        checks.fraction("SizeMap: aim", self.aim)
        if checks.positive("SizeMap: leap", self.leap, "> 1") <= 1:
            raise InputError(f"SizeMap: leap is {self.leap!r}; it must be > 1.")

    def next(self, error: ConstitutiveError, accuracy: float, max_cells: int) -> Domain:
        """The domain meshed again, or marked elements refined where the error is near the accuracy; collective.

        Raises:
            InputError: If the accuracy takes more cells than allowed, as far as this mesh can predict, or the geometry
                is not known or cannot be meshed.
        """
        aim, domain = self.aim * accuracy, error.domain
        if error.total <= CLOSE * accuracy:
            gain = 1 - 4.0**-error.solution.model.degree  # of the square, where an element is halved
            return domain.refined(mark(error, min((1 - (aim / error.total) ** 2) / gain, 1.0)))
        end, way = size_map(error, aim), error.total / aim
        leaps = ceil(log(way) / log(self.leap))
        sizes = end if leaps == 1 else size_map(error, error.total / way ** (1 / leaps))
        while sizes.predicted_cells > max_cells and way ** (1 / leaps) > CLOSE:  # a smaller leap may know better
            leaps += 1
            sizes = size_map(error, error.total / way ** (1 / leaps))
        if sizes.predicted_cells > max_cells or (error.total <= KNOWN and end.predicted_cells > DOUBT * max_cells):
            raise InputError(
                f"{percent(accuracy)} takes about {end.predicted_cells:.0f} cells, more than max_cells = {max_cells}; "
                "allow more, or a larger error."
            )
        return domain.remeshed(sizes)


def mark(error: ConstitutiveError, fraction: float = 0.5) -> np.ndarray:
    """Doerfler marking: the fewest elements over all ranks that carry a fraction of the squared error; collective.

    Elements whose errors differ by less than 1e-6 from that of the last marked element are marked, too.

    Args:
        error: The error, whose ``total_indicators`` are compared over all ranks.
        fraction: Share of the sum of their squares, in (0, 1].

    Returns:
        Marked cells of this rank.
    """
    fraction, comm = checks.fraction("mark: fraction", fraction), error.domain.mesh.comm
    raise_together(comm, None)
    threshold = _threshold(comm, error.total_indicators, fraction)
    return np.flatnonzero(error.total_indicators >= threshold * (1 - TIE)).astype(np.int32)


def _threshold(comm: MPI.Comm, values: np.ndarray, fraction: float) -> float:
    """The greatest number such that the values of all ranks from it on carry a fraction of their squares; collective.

    It is one of the values, which are >= 0. Bisection finds it among all numbers of double precision, as these have the
    order of their binary digits; each step adds up one number over the ranks.
    """
    ascending = np.sort(values)
    carried = np.append(np.cumsum(ascending[::-1] ** 2)[::-1], 0.0)
    enough = fraction * comm.allreduce(float(carried[0]), MPI.SUM) * (1 - TIE)

    def carries(digits: int) -> bool:
        first = np.searchsorted(ascending, np.int64(digits).view(np.float64))
        return comm.allreduce(float(carried[first]), MPI.SUM) >= enough

    low, high = 0, int(np.float64(comm.allreduce(float(ascending.max(initial=0.0)), MPI.MAX)).view(np.int64))
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if carries(middle) else (low, middle - 1)
    return float(np.int64(low).view(np.float64))
