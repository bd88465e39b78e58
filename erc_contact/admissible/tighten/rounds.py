"""Tighten the stress of a body with a potential in rounds, each about the last stress.

The bulk part of e^2 is Fenchel's gap ``2 int psi(eps(u^)) + psi*(sigma) - sigma :
eps(u^)`` of the stress sigma. Tightening minimises a quadratic form in its place: the
gap of a linear law. The first round takes the law about eps(u^). Where sigma is far
from it, as in coarse cells of bodies with little hardening, the law about the strain of
sigma itself is nearer to the truth:

    S(eps) = sigma + C (eps - eps_1),    eps_1 = psi*'(sigma),

with C = psi''(eps_1). The gap of S has the slope and the curvature of Fenchel's gap at
sigma, so that each further round is a step of Newton's method. Fenchel's gap is convex
in sigma: where it does not fall along the whole step, it falls along a share of it. A
mean of C in each cell would not do: where a cell yields in part, rounds with it go too
far, and e of a body whose hardening falls is up to twice as large.

Symbols: n cells, Q points in the sub-simplices of a cell, s components of a tensor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

import numpy as np
from dolfinx import la
from mpi4py import MPI

from erc_contact.admissible.elastic import chunks_of_cells, strains_of_body
from erc_contact.admissible.macro import MacroPoints, law_points, macro_points
from erc_contact.admissible.reconstruction import Reconstruction
from erc_contact.admissible.tighten import iteration
from erc_contact.admissible.tighten.iteration import Ending
from erc_contact.model.data.expressions import definite_inverses
from erc_contact.model.law.point_law import Search
from erc_contact.model.space import Space
from namedmesh.simplex import barycentric

ROUNDS = 8
"""Limit of the rounds after the first."""
SHARES = 3
"""Shares of a round that are tried at most."""
ENOUGH = 0.5
"""A share that lowers the gap by this share of what is expected is enough [-]."""
LINEAR = 0.01
"""Rounds end where the gap is the gap of the linear law to this [-]."""
HIDDEN = 0.12
"""More rounds, with more points, where the gap at these points differs by this [-].

On coarse meshes of bodies with little hardening, a stress that is tightened exceeds the
yield stress between few points: e may be 1.6 times as large as it need be.
"""
GAIN = 0.05
"""A round that lowers the gap by less than this share is the last [-]."""
FINER_REMAINDER = 0.06
"""What :data:`.iteration.REMAINDER` is in further rounds [-].

A solve with a potential is a sequence of contact problems, so that iterations cost less
beside it. Plastic bodies are nearly incompressible: the iterations gain slowly.
"""


class CellLaw(NamedTuple):
    """Hold a linear law in cells, as tightening needs it.

    Attributes:
        elastic: ``S(eps(u^))`` of the owned cells [force/area], see
            :func:`.elastic.elastic_coefficients`; on rings less the hoop load.
        compliance: The inverse of its stiffness [area/force], shape (n or 1, Q or 1, s,
            s); on rings without the circumference.
    """

    elastic: np.ndarray
    compliance: np.ndarray


@dataclass(frozen=True, eq=False)
class Tight:
    """Hold a stress in equilibrium, and how far it was tightened.

    Attributes:
        moment: Forces of all facets that it balances [force], on rings coefficients of
            ``|F| t``.
        forces: Coefficients of ``|F| t`` on the facets of the owned cells [force].
        stress: Coefficients of the owned cells [force/area], shape (owned, d+1, N_k,
            s).
        iterations: Number of iterations.
        square: Bound of its gap with the linear law [force length], after rounds with
            the potential. Tightening makes it sharp; without, the gap is not computed,
            and the bound is infinite.
    """

    moment: np.ndarray
    forces: np.ndarray
    stress: np.ndarray
    iterations: int = 0
    square: float = inf


Tighten = Callable[[np.ndarray, CellLaw, Ending], Tight]
"""Tightens forces of facets with a linear law; the result may take their place."""


def tightened_in_rounds(
    given: Reconstruction, first: np.ndarray, law: CellLaw, tighten: Tighten
) -> Tight:
    """Tighten a stress; bodies with a potential in rounds; collective.

    Args:
        given: What it is reconstructed from.
        first: Forces of the facets [force].
        law: The linear law of the body; of a potential about eps(u^).
        tighten: A round.
    """
    best = tighten(first, law, Ending(given.tighten, iteration.REMAINDER))
    if given.model.linearised is None:
        return best
    space = given.model.space
    usual, finer = macro_points(space.d, space.degree), law_points(space.d, space.degree)
    closely = _AtPoints(given, finer)
    start = closely.measured(best)
    # Bodies that do not yield pay for no more.
    if start.square_holds(LINEAR):
        return best
    if finer is not usual:
        roughly = _AtPoints(given, usual)
        start = closely.measured(_rounds(given, roughly, roughly.measured(best), tighten))
        if start.square_holds(HIDDEN):
            return start.tight
    return _rounds(given, closely, start, tighten)


class _Measured(NamedTuple):
    """Hold a stress and its difference from the law.

    Attributes:
        tight: The stress.
        gap: Fenchel's gap [force length].
        strain: ``psi*'`` of it at points of the owned cells [-], shape (owned, q, s).
    """

    tight: Tight
    gap: float
    strain: np.ndarray

    def square_holds(self, accuracy: float) -> bool:
        """Tell whether the gap is the square of the stress, to an accuracy [-]."""
        return abs(self.gap - self.tight.square) <= accuracy * self.gap


def _rounds(given: Reconstruction, at: _AtPoints, best: _Measured, tighten: Tighten) -> Tight:
    """Tighten a stress in rounds; collective.

    Args:
        given: What it is reconstructed from.
        at: Compares stresses with the law.
        best: The stress.
        tighten: A round.
    """
    for _ in range(ROUNDS):
        before = best
        law, square = at.law_about(before)
        # A round may overwrite its moments, and the best moments are kept for the end.
        begun = before.tight.iterations
        ending = Ending(given.tighten, FINER_REMAINDER, begun)
        new = tighten(before.tight.moment.copy(), law, ending)
        new = replace(new, iterations=begun + new.iterations)
        best = _least_between(at, before, new, square - new.square)
        if best.gap > (1 - GAIN) * before.gap or best.square_holds(LINEAR):
            break
    return replace(best.tight, square=best.gap)


def _least_between(at: _AtPoints, start: _Measured, end: Tight, fall: float) -> _Measured:
    """Return a stress of small gap on the way of a round; collective.

    The gap of the linear law falls along the way as a parabola, to its vertex at the
    end. If Fenchel's gap at a share of the way is above this parabola, the next share
    is the vertex of the parabola with the same slope at the start and that gap.

    Args:
        at: Compares stresses with the law.
        start: The stress at the start.
        end: The stress at the end of the round.
        fall: How far the gap of the linear law falls along the whole way.
    """
    least, share = start, 1.0
    for _ in range(SHARES):
        tried = at.measured(end if share == 1.0 else _stress_between(start.tight, end, share))
        if tried.gap < least.gap:
            least = tried
        fallen = start.gap - tried.gap
        expected = (2 * share - share**2) * fall
        if fallen >= ENOUGH * expected or fall <= 0.0:
            break
        share *= fall * share / (2 * fall * share - fallen)
    return least


def _stress_between(start: Tight, end: Tight, share: float) -> Tight:
    """Return the stress at a share of the way from a stress to another stress.

    It has the iterations of the end, and no bound of its gap.
    """

    def moved(before: np.ndarray, after: np.ndarray) -> np.ndarray:
        return np.asarray(before + share * (after - before))

    return Tight(
        moment=moved(start.moment, end.moment),
        forces=moved(start.forces, end.forces),
        stress=moved(start.stress, end.stress),
        iterations=end.iterations,
    )


class _AtPoints:
    """Compare stresses with eps(u^) at the same points of the owned cells.

    Args:
        given: What stresses are reconstructed from.
        rule: The points, one of :func:`.macro.rule_of`.
    """

    def __init__(self, given: Reconstruction, rule: MacroPoints) -> None:
        model, cells = given.model, given.cells
        owned = model.space.owned_cells
        assert model.linearised is not None
        self._space = model.space
        self._hoop_load = model.hoop_load
        self._law = model.linearised.law
        self._shape = rule.shape
        x = np.matmul(barycentric(rule.points), cells.corners[: len(owned)])
        self._x, self._owned = x, owned
        strains = strains_of_body(model, cells, given.displacement)
        self._strain = strains.at_points(slice(len(owned)), rule.points, x)
        self._energy, self._out = np.empty(x.shape[:2]), np.empty(x.shape[:2])
        for chunk in chunks_of_cells(len(owned)):
            places = self._strain[chunk], x[chunk], owned[chunk]
            self._energy[chunk] = self._law.energy(*places)
            # The search for a stress out of plane starts there.
            self._out[chunk] = self._law.whole_stress(*places)[..., -1]
        self._around = np.broadcast_to(model.space.section.weight(x), (*x.shape[:2], 1))
        self._weights = cells.volume[: len(owned), None] * rule.weights * self._around[..., 0]

    def measured(self, tight: Tight) -> _Measured:
        """Measure the difference of a stress from the law; collective."""
        total = 0.0
        strains = np.empty_like(self._strain)
        for chunk, sigma in self._in_chunks(tight.stress):
            # psi(eps) - sigma : eps, and psi*(sigma) by a search: half the gap.
            strain = self._strain[chunk]
            beside = self._energy[chunk] - (sigma * strain).sum(axis=-1)
            search = Search(self._out[chunk], beside, strain)
            at = self._x[chunk], self._owned[chunk]
            energy, strains[chunk] = self._law.dual(sigma, search, *at)
            total += 2 * (self._weights[chunk] * (beside + energy)).sum()
        return _Measured(tight, self._total(total), strains)

    def law_about(self, stress: _Measured) -> tuple[CellLaw, float]:
        """Return the linear law about the strain of a stress; collective.

        Returns:
            The law, and the gap of the stress with it [force length].
        """
        count, places, size = self._strain.shape
        compliance = np.empty((count, places, size, size))
        elastic = np.empty(self._strain.shape)
        total = 0.0
        for chunk, sigma in self._in_chunks(stress.tight.stress):
            at = self._x[chunk], self._owned[chunk]
            tangent = self._law.tangent(stress.strain[chunk], *at)
            # S(eps(u^)) = sigma + C (eps(u^) - eps_1), on rings as the moments have it.
            change = self._strain[chunk] - stress.strain[chunk]
            beyond = np.matmul(tangent, change[..., None])[..., 0]
            total += (self._weights[chunk] * (change * beyond).sum(axis=-1)).sum()
            of_law = self._around[chunk] * (sigma + beyond)
            elastic[chunk] = self._hoop_load.minus(of_law, *at)
            compliance[chunk] = definite_inverses(tangent)
        return CellLaw(elastic, _with_ghosts(self._space, compliance)), self._total(total)

    def _in_chunks(self, stress: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
        """Yield chunks of the owned cells, and the stress at their points.

        Args:
            stress: Coefficients, see :class:`Tight`.
        """
        for chunk in chunks_of_cells(len(self._strain)):
            strain = self._strain[chunk]
            values = np.matmul(self._shape, stress[chunk]).reshape(strain.shape)
            of_section = self._hoop_load.plus(values, self._x[chunk], self._owned[chunk])
            yield chunk, of_section / self._around[chunk]

    def _total(self, of_rank: float) -> float:
        """Sum over the ranks; collective."""
        return float(self._space.comm.allreduce(of_rank, MPI.SUM))


def _with_ghosts(space: Space, of_owned: np.ndarray) -> np.ndarray:
    """Add the matrices of ghost cells to matrices of the owned cells; collective.

    Ranks sort the vertices of a ghost cell differently, so they cannot tell each other
    the matrices at its points. Only their mean is asked of it, for the patches.

    Args:
        space: The mesh.
        of_owned: Shape (owned, Q, s, s); a rank may own no cells.

    Returns:
        Shape (n, Q, s, s).
    """
    if space.comm.size == 1:
        return of_owned
    owned, points, s, _ = of_owned.shape
    cells = la.vector(space.mesh.topology.index_map(space.d), s * s)
    cells.array[: owned * s * s] = of_owned.mean(axis=1).ravel()
    cells.scatter_forward()
    means = cells.array.reshape(-1, 1, s, s)[owned:]
    return np.concatenate([of_owned, np.repeat(means, points, axis=1)])
