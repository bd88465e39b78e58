"""The error by the flat facets of a curved body, an estimate beside e.

Facets keep the volume, see :mod:`namedmesh.volume`. So what they change of the energy
is of a higher order than the height of the true surface over them.

Symbols: o offset from a facet to the true surface, n normal out of a cell, w energy
density, h size of a facet.
"""

from __future__ import annotations

import numpy as np
import ufl
from mpi4py import MPI

from erc_contact.admissible.pair import Admissible
from namedmesh.base.ranks import distinct_rows
from namedmesh.for_solvers import sides_of_facets, slivers, tag_table

SECOND_ORDER = {2: 36.0, 3: 14.0}
"""Factor of the energy that the kinks between facets release, by dimension [-].

A surface whose height varies with the wave length h is as if tractions acted on it. On
a half plane they have the energy ``4 pi w (o.n)^2 / h`` for each area, with the energy
density w at the surface. Densities of whole cells are taken for it, where w is mostly
less: the energy of rings changes by 16 times what they tell, the energy of spherical
shells by 6 to 8 times. The estimate is to err to the safe side.
"""


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
