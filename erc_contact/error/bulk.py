"""The bulk part of the error.

Source: Coorevits, Hild, Hjiaj, equations (16)-(18).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.elastic import CellStrains, elastic_coefficients, macro_moduli
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.springs import spring_squares
from erc_contact.error.laws import UNKNOWN_SHARE, LawError
from erc_contact.error.oscillation import DATA_ROUND_OFF
from erc_contact.error.rings import is_rational, squares_of_rings
from erc_contact.model.data.quadrature import Integral, Integrand, cell_pieces, integrate
from erc_contact.model.model import Model
from namedmesh.simplex import bernstein


def body_error(admissible: Admissible, share: float = UNKNOWN_SHARE) -> LawError:
    """Measure how far sigma^ and u^ are from Hooke's law on each cell; collective.

    ``gap`` is the square of ``sigma^ - C eps(u^)``, ``of_sum`` the square of ``sigma^ +
    C eps(u^)``; eps is the strain without the given strain. If the moduli or the given
    strain vary inside cells, the gap contains what its integral leaves unknown.

    Args:
        admissible: The pair.
        share: Share of the gap that may stay unknown [-].
    """
    model = admissible.model
    space = model.space
    if model.constitution.varies_in_cells:
        return _adapted_squares(admissible, share)
    cells = admissible.cell_geometry
    owned = model.domain.owned_cells
    shape, points, weights = macro_points(space.d, space.degree)
    compliance = macro_moduli(model, cells, owned, inverse=True)
    elastic = elastic_coefficients(model, cells, admissible.displacement, owned)
    stress = admissible.stress
    sizes = (owned, *stress.shape[1:3], len(shape))
    rule = (shape, weights, cells.volume)
    of_elastic = np.ascontiguousarray(bernstein(space.d, space.degree - 1, points))
    stresses = (stress, elastic.shape[1], of_elastic, np.ascontiguousarray(elastic))
    material = (len(compliance) > 1, compliance.shape[1], np.ascontiguousarray(compliance))
    difference, of_sum = np.empty((2, owned))
    kernels(space.d)("stress_squares", *sizes, *rule, *stresses, *material, difference, of_sum)
    return LawError(difference, of_sum)


def spring_error(admissible: Admissible) -> LawError:
    """Measure how far t^ and u^ are from the law of springs, cell by cell."""
    tractions = admissible.spring_tractions
    gap, of_sum = spring_squares(admissible.model, admissible.displacement, tractions)
    return LawError(gap, of_sum)


def is_adapted(model: Model) -> bool:
    """Tell whether the squares of a body are integrals that are adapted to its data."""
    return model.constitution.varies_in_cells and not is_rational(model)


def adapted_gaps(
    pairs: Sequence[Admissible],
    combined: Callable[..., np.ndarray],
    share: float,
    floor: np.ndarray,
) -> Integral:
    """Integrate functions of the gaps of pairs over owned cells; collective.

    The pairs have one mesh, and are combined point by point: what they have in common
    cancels before it is integrated.

    Args:
        pairs: The pairs.
        combined: Returns the i functions, shape (n, q, i), of the densities of the gaps
            of all pairs, shape (n, q) each.
        share: Share of an integral that may stay unknown [-].
        floor: Amounts that may always stay unknown [force length], shape (i,).
    """
    squares = [_squares(pair, _strains(pair)) for pair in pairs]
    space = pairs[0].model.space
    cells = pairs[0].cell_geometry
    owned = space.domain.owned_cells

    def densities(cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return combined(*(of_pair(cell, places, x)[..., 0] for of_pair in squares))

    geometry = (cells.corners[:owned], cells.volume[:owned], cell_pieces(space.d))
    most = space.points_of_numbers
    return integrate(space.comm, densities, *geometry, share=share, floor=floor, most=most)


def _strains(admissible: Admissible) -> CellStrains:
    """Return the strains of u^."""
    space = admissible.model.space
    return CellStrains.of(space, admissible.cell_geometry, admissible.displacement)


def _squares(admissible: Admissible, strain: CellStrains) -> Integrand:
    """Return the densities of gap and sum of a pair, as :func:`body_error` has them."""
    law = admissible.model.constitution
    of_cells = admissible.model.space.owned_cells

    def squares(cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        sigma = admissible.stress_at(cell, places, x)
        return law.squares(strain.at(cell, places, x), sigma, x, of_cells[cell])

    return squares


def _adapted_squares(admissible: Admissible, share: float) -> LawError:
    """Compute the result of :func:`body_error` for data that vary; collective."""
    model = admissible.model
    space = model.space
    cells = admissible.cell_geometry
    owned = model.domain.owned_cells
    strain = _strains(admissible)
    squares = _squares(admissible, strain)
    corners = cells.corners[:owned]
    volume = cells.volume[:owned]
    value, bound = np.zeros((2, owned, 2))
    is_done = np.zeros(owned, dtype=bool)
    if is_rational(model):
        value, bound, is_done = squares_of_rings(model, cells, admissible.stress, strain)
    left = np.flatnonzero(~is_done)
    middles = np.full((len(left), 1, space.d + 1), 1 / (space.d + 1))
    in_middles = squares(left, middles, corners[left].mean(axis=1, keepdims=True))
    size = float(value[:, 1].sum() + volume[left] @ in_middles[:, 0, 1])
    # An error that is round-off of the stresses need not be resolved.
    floor = np.array([DATA_ROUND_OFF**2 * space.comm.allreduce(size, MPI.SUM), 0.0])
    total = integrate(
        space.comm,
        squares,
        corners,
        np.where(is_done, 0.0, volume),
        cell_pieces(space.d),
        share=share,
        floor=floor,
        most=space.points_in_cells,
    )
    unknown = 0.0 if total.resolved.all() else float(total.bound.max(axis=1).sum())
    value += total.value
    bound += total.bound
    return LawError(value[:, 0] + bound[:, 0], value[:, 1], unknown)
