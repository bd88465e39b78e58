"""Strategies that refine the mesh: all elements, or those that carry most of the error.

A strategy is any object with ``next``; write your own in the same few lines.

Source: Doerfler, SIAM J. Numer. Anal. 33 (1996), for marking.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.runs import Run, error_of
from namedmesh import Domain
from namedmesh.base import checks

TIE = 1e-6
"""Fraction by which errors of elements differ that are marked together.

So round-off does not choose between them.
"""


class Strategy(Protocol):
    """Choose the next mesh from an error.

    Example: ``demos/extend/strategy.py``.

    Example:
        >>> strategy: ec.Strategy = ec.Uniform()
        >>> strategy.next(error, accuracy=0.1, max_cells=1000).cells
        64
    """

    def next(self, error: ConstitutiveError, accuracy: float, max_cells: int) -> Domain:
        """Return the next domain; collective.

        It is called on all ranks, and all must come to the same decision.

        ``error.domain.refined(marked)`` refines cells of each rank, given by their
        numbers. ``error.domain.remeshed(h)`` makes a mesh with sizes h. A domain equal
        to the last one is not refused: the run goes on until ``max_steps``.

        Args:
            error: The error of the last mesh, above the accuracy.
                ``error.total_indicators`` has the errors of the cells that this rank
                owns: a rank may have none. Greatest values and sums are to be reduced
                over all ranks, by ``error.domain.comm``.
            accuracy: Prescribed relative error of the run.
            max_cells: Greatest number of cells of a mesh that will be solved. A domain
                with more cells ends the run.

        Raises:
            InputError: If there is no next domain; the run then ends with its best
                result and the words given here.
        """


@dataclass(frozen=True)
class Mark:
    """Refine the fewest elements that carry a fraction of the squared error.

    This is Doerfler marking.

    Args:
        fraction: Share of eps^2 that the marked elements carry, in (0, 1].

    Raises:
        InputError: If the fraction is outside (0, 1].

    Example:
        >>> ec.Mark(fraction=0.5).next(error, accuracy=0.1, max_cells=1000).cells
        38
    """

    fraction: float = 0.5

    def __post_init__(self) -> None:
        checks.fraction("Mark: fraction", self.fraction)

    def next(self, error: ConstitutiveError, accuracy: float, max_cells: int) -> Domain:
        """Return the domain with the marked elements refined; collective."""
        return refined(error.domain, mark(error, self.fraction), max_cells)


@dataclass(frozen=True)
class Uniform:
    """Refine all elements, for comparison.

    Example:
        >>> ec.Uniform().next(error, accuracy=0.1, max_cells=1000).cells
        64
    """

    def next(self, error: ConstitutiveError, accuracy: float, max_cells: int) -> Domain:
        """Return the domain with all elements refined; collective."""
        every_cell = np.arange(error.domain.owned_cells, dtype=np.int32)
        return refined(error.domain, every_cell, max_cells)


def refined(domain: Domain, marked: np.ndarray, max_cells: int) -> Domain:
    """Refine marked cells of this rank; collective.

    It does not if the mesh would surely have too many cells. Of a marked cell bisection
    makes 2^d at least. So a mesh that no run would solve is mostly not made.

    Raises:
        InputError: If more than ``max_cells`` cells would come.
    """
    count = domain.comm.allreduce(len(marked), MPI.SUM)
    least = domain.cells + (2**domain.dim - 1) * count
    if least > max_cells:
        raise InputError(
            f"the next mesh has at least {least} cells, more than max_cells = {max_cells}."
        )
    return domain.refined(marked)


def mark(error: ConstitutiveError | Run, fraction: float = 0.5) -> np.ndarray:
    """Mark the fewest elements that carry a fraction of the squared error; collective.

    This is Doerfler marking over all ranks. Elements whose errors differ by less than
    1e-6 from the error of the last marked element are marked, too.

    Args:
        error: The error, whose ``total_indicators`` are compared over all ranks, or a
            history, whose error is taken.
        fraction: Share of the sum of their squares, in (0, 1].

    Returns:
        Marked cells of this rank.

    Example:
        >>> ec.mark(error, fraction=0.5)
        array([ 0,  5, 10, 15], dtype=int32)
    """
    error = error_of(error)
    comm = error.domain.comm
    fraction = checks.fraction("mark: fraction", fraction)
    raise_together(comm, None)
    return largest(comm, error.total_indicators, fraction)


def largest(comm: MPI.Comm, values: np.ndarray, fraction: float) -> np.ndarray:
    """Find the fewest values with a fraction of the sum of all squares; collective.

    Args:
        comm: Communicator.
        values: Numbers >= 0 of this rank, shape (n,).
        fraction: In (0, 1].

    Returns:
        Their places on this rank; values that differ by less than TIE from the least of
        them are among them.
    """
    # Equal errors are marked together, so that round-off does not choose.
    threshold = _threshold(comm, values, fraction)
    return np.flatnonzero(values >= threshold * (1 - TIE)).astype(np.int32)


def _threshold(comm: MPI.Comm, values: np.ndarray, fraction: float) -> float:
    """Find the least of the values that :func:`largest` returns; collective.

    From it on the values of all ranks carry the fraction of their squares. It is one of
    the values, which are >= 0. Bisection finds it among all numbers of double
    precision, as these have the order of their binary digits; each step adds up one
    number over the ranks.
    """
    ascending = np.sort(values)
    # At each place the sum of the squares from there on.
    carried = np.append(np.cumsum(ascending[::-1] ** 2)[::-1], 0.0)
    enough = fraction * comm.allreduce(float(carried[0]), MPI.SUM) * (1 - TIE)

    def carries(digits: int) -> bool:
        """Tell whether the values from these binary digits on carry enough."""
        first = np.searchsorted(ascending, np.int64(digits).view(np.float64))
        return comm.allreduce(float(carried[first]), MPI.SUM) >= enough

    greatest = comm.allreduce(float(ascending.max(initial=0.0)), MPI.MAX)
    low = 0
    high = int(np.float64(greatest).view(np.int64))
    while low < high:
        middle = (low + high + 1) // 2
        if carries(middle):
            low = middle
        else:
            high = middle - 1
    return float(np.int64(low).view(np.float64))
