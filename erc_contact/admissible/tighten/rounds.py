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

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

import numpy as np
from dolfinx import la
from mpi4py import MPI

from erc_contact.admissible.elastic import chunks_of_cells, strains_of_body
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.reconstruction import Reconstruction
from erc_contact.admissible.tighten import iteration
from erc_contact.admissible.tighten.iteration import Ending
from erc_contact.model.data.expressions import definite_inverses
from erc_contact.model.law.point_law import Search
from erc_contact.model.space import Space
from namedmesh.simplex import barycentric

ROUNDS = 8
"""Limit of the rounds after the first."""
SHARES = (1.0, 0.3, 0.1)
"""Shares of a round that are tried until the gap falls [-]."""
LINEAR = 0.01
"""Rounds end where the gap is the gap of the linear law to this [-]."""
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
    if _is_linear(given, best.stress):
        return best
    about = _AboutStress(given)
    again, gap = about(best.stress)
    for _ in range(ROUNDS):
        # A round may overwrite its moments, and the best moments are kept for the end.
        ending = Ending(given.tighten, FINER_REMAINDER, best.iterations)
        new = tighten(best.moment.copy(), again, ending)
        new = replace(new, iterations=best.iterations + new.iterations)
        before = gap
        for share in SHARES:
            tried = new if share == 1.0 else _stress_between(best, new, share)
            again, gap = about(tried.stress)
            if gap < before:
                break
        else:
            gap = before
            break
        best = tried
        is_linear = abs(gap - best.square) <= LINEAR * gap
        if is_linear or gap > (1 - GAIN) * before:
            break
    return replace(best, square=gap)


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


def _is_linear(given: Reconstruction, stress: np.ndarray) -> bool:
    """Tell whether the gap of the linear law about eps(u^) is Fenchel's; collective.

    Both are taken of the mean stress of each cell, in its middle: bodies that do not
    yield pay for no more.
    """
    d = given.model.space.d
    at = _AtPoints(given, np.full((1, d), 1 / (d + 1)), np.ones(1))
    # The mean of a polynomial is the mean of its Bernstein coefficients.
    sigma = at.stress(stress.mean(axis=(1, 2))[:, None])
    gap, _ = at.gap(sigma)
    beyond = sigma - at.of_strain[..., : sigma.shape[-1]]
    # The gap of a linear law is |sigma - S(eps(u^))|^2 in the norm of its compliance.
    tangent = at.law.tangent(at.strain, *at.places)
    square = (beyond * np.linalg.solve(tangent, beyond[..., None])[..., 0]).sum(axis=-1)
    return bool(at.total(abs(gap - square)) <= LINEAR * at.total(gap))


class _AtPoints:
    """Compare stresses with eps(u^) at the same points of the owned cells.

    Args:
        given: What stresses are reconstructed from.
        points: Reference points, shape (q, d).
        weights: Their weights, with sum 1, shape (q,).

    Attributes:
        law: The law of the body.
        places: The points [length], shape (owned, q, d), and the cells.
        strain: eps(u^) [-], shape (owned, q, s).
        of_strain: psi' of it [force/area], see :meth:`.PointLaw.whole_stress`.
        around: Weights of the section, shape (owned, q, 1) or (1, 1, 1).
        hoop_load: The body force that is a hoop stress.
    """

    def __init__(self, given: Reconstruction, points: np.ndarray, weights: np.ndarray) -> None:
        model, cells = given.model, given.cells
        owned = model.space.owned_cells
        assert model.linearised is not None
        self.law = model.linearised.law
        x = np.matmul(barycentric(points), cells.corners[: len(owned)])
        self.places = x, owned
        strain = strains_of_body(model, cells, given.displacement)
        self.strain = strain.at_points(slice(len(owned)), points, x)
        self.of_strain = self.law.whole_stress(self.strain, *self.places)
        self.around = model.space.section.weight(x)
        self.hoop_load = model.hoop_load
        self._comm = model.space.comm
        self._weights = cells.volume[: len(owned), None] * weights * self.around[..., 0]

    def stress(self, values: np.ndarray) -> np.ndarray:
        """Return the stress of values of sigma^ at the points [force/area].

        Args:
            values: Shape (owned, q, s), on rings times the circumference and less the
                hoop load. They are overwritten.
        """
        return self.hoop_load.plus(values, *self.places) / self.around

    def gap(self, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return Fenchel's gap of a stress [force/area], and the strain ``psi*'``."""
        # psi(eps) - sigma : eps, and psi*(sigma) by a search: half the gap.
        work = (sigma * self.strain).sum(axis=-1)
        beside = self.law.energy(self.strain, *self.places) - work
        search = Search(self.of_strain[..., -1], beside, self.strain)
        energy, strain = self.law.dual(sigma, search, *self.places)
        return 2 * (beside + energy), strain

    def chunk(self, cells: slice) -> _AtPoints:
        """Return the same for some cells only."""
        part = copy(self)
        x, owned = self.places
        part.places = x[cells], owned[cells]
        part.strain = self.strain[cells]
        part.of_strain = self.of_strain[cells]
        part.around = self.around[cells] if len(self.around) > 1 else self.around
        part._weights = self._weights[cells]
        return part

    def integral(self, density: np.ndarray) -> float:
        """Integrate a density over the cells."""
        return float((self._weights * density).sum())

    def total(self, density: np.ndarray) -> float:
        """Integrate a density over the bodies; collective."""
        return self._comm.allreduce(self.integral(density), MPI.SUM)


class _AboutStress:
    """Linearise the law of a potential about the strain of a stress.

    Args:
        given: What the stress is reconstructed from.
    """

    def __init__(self, given: Reconstruction) -> None:
        self._space = given.model
        self._shape, points, weights = macro_points(given.model.space.d, given.model.space.degree)
        self._at = _AtPoints(given, points, weights)

    def __call__(self, stress: np.ndarray) -> tuple[CellLaw, float]:
        """Return the linear law, and Fenchel's gap of a stress; collective.

        Args:
            stress: Coefficients, see :class:`Tight`.
        """
        count, places, size = self._at.strain.shape
        compliance = np.empty((count, places, size, size))
        elastic = np.empty(self._at.strain.shape)
        total = 0.0
        for cells in chunks_of_cells(count):
            at = self._at.chunk(cells)
            sigma = at.stress(np.matmul(self._shape, stress[cells]).reshape(at.strain.shape))
            gap, strain = at.gap(sigma)
            total += at.integral(gap)
            tangent = at.law.tangent(strain, *at.places)
            # S(eps(u^)) = sigma + C (eps(u^) - eps_1), on rings as the moments have it.
            beyond = np.matmul(tangent, (at.strain - strain)[..., None])[..., 0]
            elastic[cells] = at.hoop_load.minus(at.around * (sigma + beyond), *at.places)
            compliance[cells] = definite_inverses(tangent)
        law = CellLaw(elastic, _with_ghosts(self._space.space, compliance))
        return law, self._space.space.comm.allreduce(total, MPI.SUM)


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
