"""Tighten the stress of a body with a potential in rounds, each about the last stress.

The bulk part of e^2 is Fenchel's gap ``2 int psi(eps(u^)) + psi*(sigma) - sigma :
eps(u^)`` of the stress sigma. Tightening minimises a quadratic form in its place: the
gap of a linear law. The first round takes the law about eps(u^). Where sigma is far
from it, as in coarse cells of bodies with little hardening, the law about the strain of
sigma itself is nearer to the truth:

    S(eps) = sigma + C (eps - eps_1),    eps_1 = psi*'(sigma),

where C^-1 is the mean of psi''(eps_1)^-1 in a cell. The gap of S has the slope of
Fenchel's gap at sigma, so that each further round is a step of a quasi-Newton method.
Fenchel's gap decides whether it was a gain. Ranks sort the vertices of a ghost cell
differently, so that they could not tell each other C at points.

Symbols: n cells, Q points in the sub-simplices of a cell, s components of a tensor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from dolfinx import la
from mpi4py import MPI

from erc_contact.admissible.elastic import CellStrains, macro_places
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.reconstruction import Reconstruction
from erc_contact.admissible.tighten import iteration
from erc_contact.admissible.tighten.iteration import Ending
from erc_contact.model.space import Space, circumferences

ROUNDS = 4
"""Limit of the rounds after the first."""
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
        square: Its gap with the linear law [force length]; None without tightening.
    """

    moment: np.ndarray
    forces: np.ndarray
    stress: np.ndarray
    iterations: int = 0
    square: float | None = None


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
    if given.model.linearised is None or best.square is None:
        return best
    if _is_linear(given, best.stress):
        return best
    about = _AboutStress(given)
    again, gap = about(best.stress)
    for _ in range(ROUNDS):
        ending = Ending(given.tighten, FINER_REMAINDER, best.iterations)
        new = tighten(best.moment.copy(), again, ending)
        before, (again, gap) = gap, about(new.stress)
        if not gap < before:
            break
        best = replace(new, iterations=best.iterations + new.iterations)
        is_linear = new.square is not None and abs(gap - new.square) <= LINEAR * gap
        if is_linear or gap > (1 - GAIN) * before:
            break
    return best


def _is_linear(given: Reconstruction, stress: np.ndarray) -> bool:
    """Tell whether the gap of the linear law about eps(u^) is Fenchel's; collective.

    Both are taken of the mean stress of each cell, in its middle: bodies that do not
    yield pay for no more.
    """
    model, cells = given.model, given.cells
    owned = model.domain.owned_cells
    assert model.linearised is not None
    law = model.linearised.law
    middle = np.full((1, model.d), 1 / (model.d + 1))
    x = cells.corners[:owned].mean(axis=1, keepdims=True)
    places = x, model.owned_cells
    strain = CellStrains.of(model, cells, given.displacement).at_points(slice(owned), middle, x)
    around = circumferences(x) if model.axisymmetric else np.ones((owned, 1))
    # The mean of a polynomial is the mean of its Bernstein coefficients.
    sigma = stress.mean(axis=(1, 2))[:, None]
    if model.hoop_load is not None:
        sigma[..., -1] += model.hoop_load(*places)
    sigma = sigma / around[..., None]
    at_strain = law.whole_stress(strain, *places)
    beside = law.energy(strain, *places) - np.einsum("nqi,nqi->nq", sigma, strain)
    energy, _ = law.complementary(sigma, at_strain[..., -1], *places, beside, strain)
    beyond = sigma - at_strain[..., : sigma.shape[-1]]
    of_beyond = np.linalg.solve(law.tangent(strain, *places), beyond[..., None])[..., 0]
    square = np.einsum("nqi,nqi->nq", beyond, of_beyond)
    gap = 2 * (beside + energy)
    weights = cells.volume[:owned, None] * around
    sums = np.array([(weights * gap).sum(), (weights * abs(gap - square)).sum()])
    of_body, of_difference = model.comm.allreduce(sums, MPI.SUM)
    return bool(of_difference <= LINEAR * of_body)


class _AboutStress:
    """Linearise the law of a potential about the strain of a stress.

    Args:
        given: What the stress is reconstructed from.
    """

    def __init__(self, given: Reconstruction) -> None:
        model, cells = given.model, given.cells
        owned = model.domain.owned_cells
        assert model.linearised is not None
        self._model = model
        self._law = model.linearised.law
        self._shape, points, weights = macro_points(model.d, model.degree)
        self._places = macro_places(model, cells, owned), model.owned_cells
        strain = CellStrains.of(model, cells, given.displacement)
        self._strain = strain.at_points(slice(owned), points, self._places[0])
        self._around = np.ones((owned, len(points)))
        if model.axisymmetric:
            self._around = circumferences(self._places[0])
        self._weights = cells.volume[:owned, None] * weights * self._around
        # Where the search for the stress out of plane starts.
        self._out = self._law.whole_stress(self._strain, *self._places)[..., -1]

    def __call__(self, stress: np.ndarray) -> tuple[CellLaw, float]:
        """Return the linear law, and Fenchel's gap of a stress; collective.

        Args:
            stress: Coefficients, see :class:`Tight`.
        """
        model, law, places = self._model, self._law, self._places
        owned, points, size = self._strain.shape
        around = self._around[..., None]
        sigma = np.matmul(self._shape, stress).reshape(owned, points, size)
        load = None
        if model.hoop_load is not None:
            load = model.hoop_load(*places)
            sigma[..., -1] += load
        sigma = sigma / around
        work = np.einsum("nqi,nqi->nq", sigma, self._strain)
        beside = law.energy(self._strain, *places) - work
        energy, strain = law.dual(sigma, self._out, *places, beside, self._strain)
        gap = beside + energy
        total = model.comm.allreduce(float(2 * (self._weights * gap).sum()), MPI.SUM)
        compliance = np.linalg.inv(law.tangent(strain, *places)).mean(axis=1)
        beyond = np.matmul(self._strain - strain, np.linalg.inv(compliance))
        elastic = around * (sigma + beyond)
        if load is not None:
            elastic[..., -1] -= load
        return CellLaw(elastic, _with_ghosts(model, compliance)[:, None]), total


def _with_ghosts(space: Space, of_owned: np.ndarray) -> np.ndarray:
    """Add the matrices of ghost cells to matrices of the owned cells; collective.

    Args:
        space: The mesh.
        of_owned: Shape (owned, s, s); a rank may own no cells.

    Returns:
        Shape (n, s, s).
    """
    if space.comm.size == 1:
        return of_owned
    s = of_owned.shape[1]
    cells = la.vector(space.mesh.topology.index_map(space.d), s * s)
    cells.array[: of_owned.size] = of_owned.ravel()
    cells.scatter_forward()
    return np.array(cells.array.reshape(-1, s, s))
