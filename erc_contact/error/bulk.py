"""The bulk part of the error, and the error by the flat facets of a curved body.

Source: Coorevits, Hild, Hjiaj, equations (16)-(18); the error of the geometry is ours.
"""

from __future__ import annotations

import numpy as np
import ufl
from mpi4py import MPI

from erc_contact.admissible.elastic import CellStrains, elastic_coefficients, macro_moduli
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.springs import spring_squares
from erc_contact.error.laws import LawError
from erc_contact.error.oscillation import DATA_ROUND_OFF, UNKNOWN_SHARE
from erc_contact.error.rings import is_rational, squares_of_rings
from erc_contact.model.data.quadrature import cell_pieces, integrate
from namedmesh.base.ranks import distinct_rows
from namedmesh.for_solvers import sides_of_facets, slivers, tag_table
from namedmesh.simplex import bernstein

SECOND_ORDER = {2: 36.0, 3: 14.0}
"""Factor of the energy that the kinks between facets release, by dimension [-].

A surface whose height varies with the wave length h is as if tractions acted on it. On
a half plane they have the energy ``4 pi w (o.n)^2 / h`` for each area, with the energy
density w at the surface. Densities of whole cells are taken for it, where w is mostly
less: the energy of rings changes by 16 times what they tell, the energy of spherical
shells by 6 to 8 times. The estimate is to err to the safe side.
"""


def body_error(admissible: Admissible) -> LawError:
    """Measure how far sigma^ and u^ are from Hooke's law on each cell; collective.

    ``gap`` is the square of ``sigma^ - C eps(u^)``, ``of_sum`` the square of ``sigma^ +
    C eps(u^)``; eps is the strain without the given strain. If the moduli or the given
    strain vary inside cells, the gap contains what its integral leaves unknown.
    """
    model = admissible.model
    space = model.space
    if model.constitution.varies_in_cells:
        return _adapted_squares(admissible)
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


def _adapted_squares(admissible: Admissible) -> LawError:
    """Compute the result of :func:`body_error` for data that vary; collective."""
    model = admissible.model
    space = model.space
    cells = admissible.cell_geometry
    owned = model.domain.owned_cells
    of_cells = space.owned_cells
    strain = CellStrains.of(space, cells, admissible.displacement)

    def squares(cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        sigma = admissible.stress_at(cell, places, x)
        return model.constitution.squares(strain.at(cell, places, x), sigma, x, of_cells[cell])

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
        share=UNKNOWN_SHARE,
        floor=floor,
    )
    unknown = 0.0 if total.resolved.all() else float(total.bound.max(axis=1).sum())
    value += total.value
    bound += total.bound
    return LawError(value[:, 0] + bound[:, 0], value[:, 1], unknown)


def geometry_squares(admissible: Admissible, of_sum: np.ndarray) -> np.ndarray:
    """Compute the share of each owned cell in the square of the geometry error.

    Where facets take the place of the true surface, o.n above them, the potential
    energy changes by

        - int (w - f.u) o.n - c int w (o.n)^2 / h,

    with ``w = |sigma|^2 / 2``, the body force f and the size h of the facets. The first
    term has both signs, and facets that keep the volume leave next to nothing of it: it
    is summed on each curve or surface of the drawing. The second term has one sign.
    Twice the sum of the absolute values is the square.

    Args:
        admissible: The pair.
        of_sum: ``|sigma^ + C eps(u^)|^2 = 4 |sigma_m|^2`` of each owned cell [force
            length].

    Returns:
        Shape (cells,) [force length].
    """
    space = admissible.model.space
    domain = space.domain
    cells = admissible.cell_geometry
    result = np.zeros(len(of_sum))
    if domain.offset is None or domain.curved_facets is None:
        return result
    energy = of_sum / (8 * cells.volume[: len(of_sum)])
    energies = domain.function("DG", 0, (2,))
    of_cells = energies.x.array.reshape(-1, 2)
    of_cells[: len(of_sum)] = np.column_stack([energy, energy - _work_of_body_force(admissible)])
    # A facet between two ranks needs the energies of the other one.
    energies.x.scatter_forward()

    # The cell beyond a facet is the cell itself on the boundary of the body.
    sides = sides_of_facets(space.mesh, domain.curved_facets.indices)
    sides = sides[space.owned(sides)]
    cell = sides[:, 0]
    numbers = space.facet_numbers(sides)
    both_cells = cells.side[:, numbers] // (space.d + 1)
    beyond = np.where(both_cells[0] == cell, both_cells[1], both_cells[0])
    inside = beyond != cell
    jumps = of_cells[cell] - np.where(inside[:, None], of_cells[beyond], 0.0)
    # A facet between two cells is a side of both.
    w, potential = (np.where(inside[:, None], 0.5, 1.0) * jumps).T

    between = slivers(domain.offset, sides)
    first = potential * between.volumes
    marks = tag_table(domain.curved_facets)[numbers]
    size = space.facet_areas(sides) ** (1 / (space.d - 1))
    second = SECOND_ORDER[space.d] * abs(w) * between.squares / size
    np.add.at(result, cell, 2 * (_left_over(space.comm, first, marks) + second))
    return result


def _work_of_body_force(admissible: Admissible) -> np.ndarray:
    """Return f.u in the middle of each owned cell [force/area], shape (cells,)."""
    model = admissible.model
    space = model.space
    if model.body_force is None:
        return np.zeros(len(space.owned_cells))
    work = ufl.inner(model.body_force, admissible.displacement)
    middles = space.cell_corners()[space.owned_cells].mean(axis=1)
    return space.section.times(space.at_middles(work, space.owned_cells), middles)


def _left_over(comm: MPI.Comm, works: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """Return what is left of works where both signs cancel on a surface; collective.

    Args:
        comm: The ranks.
        works: Work of each facet of this rank [force length], shape (n,).
        marks: Mark of the surface of each facet, shape (n,).

    Returns:
        The share of each facet, not below zero, shape (n,); the shares of a surface
        have the sum ``|sum of its works|``.
    """
    known = distinct_rows(comm, marks)
    surface = np.searchsorted(known, marks)
    local = [np.bincount(surface, values, len(known)) for values in (works, abs(works))]
    total, size = comm.allreduce(np.array(local), MPI.SUM)
    left = np.divide(abs(total), size, out=np.zeros(len(known)), where=size > 0)
    return abs(works) * left[surface]
