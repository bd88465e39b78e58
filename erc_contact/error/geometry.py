"""The error by the flat facets of a curved body, an estimate beside e.

Facets keep the volume, see :mod:`namedmesh.volume`. So what they change of the energy
is of a higher order than the height of the true surface over them.

Symbols: o offset from a facet to the true surface, n normal out of a cell, w energy
density, f body force, p = - n.sigma n pressure on the surface, h size of a facet, s
components of a tensor, f facets, q points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.elastic import CellStrains
from erc_contact.admissible.pair import Admissible
from erc_contact.error.numbers import ROUND_OFF
from erc_contact.model.data.expressions import function_at
from erc_contact.model.model import Model
from namedmesh.base.ranks import distinct_rows
from namedmesh.for_solvers import Slivers, sides_of_facets, slivers, tag_table
from namedmesh.simplex import inverses

FIRST_ORDER = 1.2
"""Factor of the signed term, to err to the safe side [-]."""
SECOND_ORDER = {2: 16.0, 3: 6.5}
"""Factor of the energy that the kinks between facets release, by dimension [-].

A surface whose height varies with the wave length h turns the normal by its slope o'.
So a tension T along the surface, beyond the pressure on it, acts as a traction T o'.
On a half plane its energy is ``4 pi T^2/(2 E') o^2/h`` for each area. Parabolas over
facets have 1.11 times as much, ``12.7 T^2/(2 E) o^2/h`` with nu = 0.3. Triangles are
longer than the root h of their area, and on tubes heights do not vary along the axis:
there the factor is 4 to 6. The factors here are to err to the safe side.
"""
OF_MEAN = 0.3
"""Factor of the square of the mean height of a facet, over the factor of the rest [-].

A mean height is left at corners, and where a facet is alone on its surface. A single
parabola of the length h has the energy ``4.8 T^2/(2 E') o^2/h``, of which the mean has
.21 times what it would have in a wave.
"""


def geometry_squares(admissible: Admissible, of_sum: np.ndarray) -> np.ndarray:
    """Compute the share of each owned cell in the square of the geometry error.

    Where facets take the place of the true surface, o.n above them, the potential
    energy changes by

        - int (w - f.u + div(p u)) o.n - c int T^2/(2 E) (o.n)^2/h,

    with the part T of the stress along the surface, less the pressure p there. The
    first term has both signs, and facets that keep the volume leave little of it. It is
    summed on each curve or surface of the drawing. The second term has one sign. Where
    both signs meet on a surface, the greater term counts. Twice the sum is the square.

    Args:
        admissible: The pair.
        of_sum: ``|sigma^ + C eps(u^)|^2 = 4 |sigma_m|^2`` of each owned cell [force
            length].

    Returns:
        Shape (cells,) [force length].
    """
    space = admissible.model.space
    domain = space.domain
    result = np.zeros(len(of_sum))
    if domain.offset is None or domain.curved_facets is None:
        return result
    energies = domain.function("DG", 0)
    volumes = admissible.cell_geometry.volume[: len(of_sum)]
    energies.x.array[: len(of_sum)] = of_sum / (8 * volumes)
    # A facet between two ranks needs the energies of the other one.
    energies.x.scatter_forward()

    sides = sides_of_facets(space.mesh, domain.curved_facets.indices)
    sides = sides[space.owned(sides)]
    # What is flat is left out: facets on the axis of rings are.
    depths = slivers(domain.offset, sides).depths
    sides = sides[depths > ROUND_OFF * domain.extent]
    surface = _Surface(admissible, slivers(domain.offset, sides))
    marks = tag_table(domain.curved_facets)[surface.numbers]
    first = surface.first_order(energies.x.array)
    shares = _released(space.comm, first, surface.second_order(), marks)
    np.add.at(result, sides[:, 0], 2 * shares)
    return result


@dataclass(frozen=True, eq=False)
class _OneSide:
    """Hold fields at points of facets, on one side of them.

    Attributes:
        stress: Tensors C eps(u^), times the weights of points, shape (f, q, s, s).
        volume: Trace of eps(u^) [-], shape (f, q).
        load_work: f.u^ there, shape (f, q).
    """

    stress: np.ndarray
    volume: np.ndarray
    load_work: np.ndarray


class _Surface:
    """Evaluate what facets change of the energy.

    Args:
        admissible: The pair.
        between: What lies between the facets and the true surface.

    Attributes:
        numbers: Numbers of the facets, shape (f,).
    """

    def __init__(self, admissible: Admissible, between: Slivers) -> None:
        self._pair = admissible
        self._model: Model = admissible.model
        self._between = between
        space = self._model.space
        sides = between.sides
        self.numbers = space.facet_numbers(sides)
        # The cell beyond a facet is the cell itself on the boundary of the body.
        both_cells = admissible.cell_geometry.side[:, self.numbers] // (space.d + 1)
        cell = sides[:, 0]
        beyond = np.where(both_cells[0] == cell, both_cells[1], both_cells[0])
        self._cells = cell, beyond
        self._inside = beyond != cell
        # A facet between two cells is a side of both.
        self._share = np.where(self._inside, 0.5, 1.0)
        self._x = between.points
        size = len(space.section.basis[0])
        self._normals = np.zeros((len(sides), size))
        self._normals[:, : space.d] = space.outward_normals(sides)
        strain = CellStrains.of(space, admissible.cell_geometry, admissible.displacement)
        here, there = (self._on_side(strain, cells) for cells in self._cells)
        self._here, self._there = here, there

    def _on_side(self, strain: CellStrains, cell: np.ndarray) -> _OneSide:
        """Evaluate fields at the points in cells beside the facets, shape (f,)."""
        model, x = self._model, self._x
        corners = self._pair.cell_geometry.corners[cell]
        places = np.matmul(x - corners[:, :1], inverses(corners[:, 1:] - corners[:, :1]))
        places = np.concatenate([1 - places.sum(axis=-1, keepdims=True), places], axis=-1)
        eps = strain.at(cell, places, x)
        basis = model.space.section.basis
        stress = np.einsum("fqs,sij->fqij", model.constitution.stress(eps, x, cell), basis)
        volume = eps @ np.trace(basis, axis1=1, axis2=2)
        load_work = np.zeros(volume.shape)
        if model.body_force is not None:
            force = model.space.everywhere(model.body_force)(x, cell)
            u = function_at(self._pair.displacement, x, cell).reshape(x.shape)
            load_work = (force * u).sum(axis=-1)
        return _OneSide(stress, volume, load_work)

    def first_order(self, energies: np.ndarray) -> np.ndarray:
        """Return ``c int (w - f.u + div(p u)) o.n`` of each facet, shape (f,).

        Args:
            energies: w of each cell, times the weights of points.
        """
        densities = []
        for cell, side in zip(self._cells, (self._here, self._there), strict=True):
            pressure = -self._normal_stress(side.stress)
            densities.append(energies[cell][:, None] - side.load_work + pressure * side.volume)
        here, there = densities
        density = here - np.where(self._inside[:, None], there, 0.0) + self._change_of_loads()
        lifted = self._between.weights * self._between.heights
        return FIRST_ORDER * self._share * (lifted * density).sum(axis=1)

    def _normal_stress(self, stress: np.ndarray) -> np.ndarray:
        """Return n.sigma n of tensors, shape (f, q)."""
        return np.einsum("fqij,fi,fj->fq", stress, self._normals, self._normals)

    def _change_of_loads(self) -> np.ndarray:
        """Return ``grad p . u`` of loads, shape (f, q); collective."""
        model = self._model
        space = model.space
        result = np.zeros(self._x.shape[:2])
        for load in model.surface_loads:
            density = space.everywhere(load.density)
            on_load = space.facet_numbers(model.domain.facets(load.facets))
            on = np.flatnonzero(np.isin(self.numbers, on_load))
            if not len(on):
                continue
            x, sides = self._x[on], self._between.sides[on]
            u = function_at(self._pair.displacement, x, sides[:, 0]).reshape(x.shape)
            # The difference along u, over as much as the heights of the same facet: the
            # facets of other ranks do not matter.
            heights = abs(self._between.heights[on]).max(axis=1)
            most = abs(u).max(axis=(1, 2))
            step = np.divide(heights, most, out=heights.copy(), where=most > 0)[:, None, None]
            places = x, x + step * u
            before, after = (space.section.over(density(at, sides), at) for at in places)
            change = space.section.times(after - before, x) / step
            result[on] -= np.einsum("fqi,fi->fq", change, self._normals[on, : space.d])
        return result

    def second_order(self) -> np.ndarray:
        """Return ``c int T^2/(2 E) (o.n)^2/h`` of each facet, not below zero, (f,)."""
        space = self._model.space
        section = space.section
        stress = self._here.stress - np.where(
            self._inside[:, None, None, None], self._there.stress, 0.0
        )
        # Kinks are in the half plane of rings: the hoop stress feels none of them.
        n = self._normals
        along = np.eye(n.shape[1]) - n[:, :, None] * n[:, None, :]
        along[:, space.d :] = 0.0
        pressed = self._normal_stress(stress)[..., None, None] * np.eye(n.shape[1])
        tension = along[:, None] @ (stress - pressed) @ along[:, None].swapaxes(-1, -2)
        # Where the displacement is given, the stress across the facet counts, too.
        is_held = np.isin(self.numbers, self._held_facets())
        tension = np.where(is_held[:, None, None, None], stress, tension)
        squares = (section.over(tension, self._x) ** 2).sum(axis=(2, 3))

        cell = self._between.sides[:, 0]
        middles = space.cell_corners()[cell].mean(axis=1)
        modulus = section.over(self._model.cell_modulus.x.array[cell], middles)
        density = section.times(squares / (2 * modulus[:, None]), self._x)

        areas = self._between.weights.sum(axis=1)
        mean = (self._between.volumes / areas)[:, None]
        heights = (self._between.heights - mean) ** 2 + OF_MEAN * mean**2
        size = areas ** (1 / (space.d - 1))
        energy = (self._between.weights * density * heights).sum(axis=1) / size
        return np.asarray(SECOND_ORDER[space.d] * self._share * energy)

    def _held_facets(self) -> np.ndarray:
        """Return the numbers of facets with supports or contacts."""
        model = self._model
        held = [facets for facets, _ in model.fixed_facets]
        for contact in model.contacts:
            held += [contact.trace.here.facets, contact.trace.there.facets]
        return np.concatenate([np.zeros(0, int), *map(model.space.facet_numbers, held)])


def _released(
    comm: MPI.Comm, first: np.ndarray, second: np.ndarray, marks: np.ndarray
) -> np.ndarray:
    """Return what facets change of the energy of each surface; collective.

    Args:
        comm: The ranks.
        first: The first term of each facet of this rank [force length], shape (n,).
        second: The second term, not below zero.
        marks: Mark of the surface of each facet, shape (n,).

    Returns:
        The share of each facet, not below zero, shape (n,).
    """
    known = distinct_rows(comm, marks)
    surface = np.searchsorted(known, marks)
    local = [np.bincount(surface, of, len(known)) for of in (first, abs(first), second)]
    total, size, kinks = comm.allreduce(np.array(local), MPI.SUM)
    # Where the first term has the other sign, the greater of both counts.
    outweighs = -total > kinks
    counted = np.where(outweighs, -total, np.maximum(total, 0.0))
    of_first = np.divide(counted, size, out=np.zeros(len(known)), where=size > 0)
    shares = abs(first) * of_first[surface]
    return np.asarray(shares + np.where(outweighs[surface], 0.0, second))
