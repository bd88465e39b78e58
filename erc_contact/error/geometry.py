"""The error by the flat facets of a curved body, an estimate beside e.

Facets keep the volume, see :mod:`namedmesh.volume`. So what they change of the energy
is of a higher order than the height of the true surface over them.

Where facets take the place of the true surface, o.n above them, the potential energy
changes by

    - int (w - f.u + div(p u)) o.n - 1/2 int t.u_t,

with the fields of the true body. The first term has both signs, and facets that keep
the volume leave little of it. The second term is what the kinks between facets release.
The surface turns by its slope, so that a tension T along it, beyond the pressure on it,
acts as a traction ``t = T grad(o.n)``. On a half plane a traction that varies with the
wave length 2 pi l displaces the surface by ``u_t = 2 t l/E'``.

With the fields of the polygon the first term contains a part of the second, as energy
densities vary along facets as heights do. What kinks add to them has no mean on a
facet, and is symmetric to its middle. So of the heights over each facet the nearest
linear function is taken, which keeps what facets of different sizes, and at corners,
leave of the first term. With the means alone it has still less of the kinks, and less
of the first term: how far both are apart tells how well it is known.

Symbols: o offset from a facet to the true surface, n normal out of a cell, w energy
density, f body force, p = - n.sigma n pressure on the surface, s components of a
tensor, f facets, q points.
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

MOST_OF_FIRST = 1.7
"""Most that the first term may be, over its value with the fields of a mesh [-].

Meshes blur concentrations of stress. On coarse holes, fillets and balls the first term
with the fields of the true body is 1.2 to 1.8 times the first term of degree 2.
"""
LEAST_OF_KINKS = 0.6
"""Least that kinks may release, over what they release at most [-].

At most it is ``l |t|^2/E``, with the length ``l = |o.n|/|grad(o.n)|`` of each facet, by
the interpolation of norms for nu = 0. A row of parabolas of equal length releases .82
of that with nu = 0.3, and the first term has up to a quarter of it already.
"""


def geometry_squares(admissible: Admissible) -> np.ndarray:
    """Compute the share of each owned cell in the square of the geometry error.

    Both terms are summed on each curve or surface of the drawing, with their least and
    their greatest value, and then over all of them: what cancels is no error. The
    change that is farthest from zero counts. Twice the sum is the square.

    Args:
        admissible: The pair.

    Returns:
        Shape (cells,) [force length].
    """
    space = admissible.model.space
    domain = space.domain
    result = np.zeros(domain.owned_cells)
    if domain.offset is None or domain.curved_facets is None:
        return result
    sides = sides_of_facets(space.mesh, domain.curved_facets.indices)
    sides = sides[space.owned(sides)]
    # What is flat is left out: facets on the axis of rings are.
    depths = slivers(domain.offset, sides).depths
    sides = sides[depths > ROUND_OFF * domain.extent]
    surface = _Surface(admissible, slivers(domain.offset, sides))
    marks = tag_table(domain.curved_facets)[surface.numbers]
    shares = _shares(space.comm, surface.first_order(), *surface.of_kinks(), marks)
    np.add.at(result, sides[:, 0], 2 * shares)
    return result


@dataclass(frozen=True, eq=False)
class _OneSide:
    """Hold fields at points of facets, on one side of them.

    Attributes:
        stress: Tensors C eps(u^), times the weights of points, shape (f, q, s, s).
        energy: Their energy density, times the weights, shape (f, q).
        volume: Trace of eps(u^) [-], shape (f, q).
        load_work: f.u^ there, shape (f, q).
    """

    stress: np.ndarray
    energy: np.ndarray
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
        components = model.constitution.stress(eps, x, cell)
        energy = model.constitution.energy(eps, components, x, cell)
        stress = np.einsum("fqs,sij->fqij", components, basis)
        volume = eps @ np.trace(basis, axis1=1, axis2=2)
        load_work = np.zeros(volume.shape)
        if model.body_force is not None:
            force = model.space.everywhere(model.body_force)(x, cell)
            u = function_at(self._pair.displacement, x, cell).reshape(x.shape)
            load_work = (force * u).sum(axis=-1)
        return _OneSide(stress, energy, volume, load_work)

    def first_order(self) -> np.ndarray:
        """Return ``int (w - f.u + div(p u)) o.n`` of each facet, shape (2, f).

        Of the heights o.n it has the nearest linear functions, and the means.
        """
        densities = []
        for side in (self._here, self._there):
            pressure = -self._normal_stress(side.stress)
            densities.append(side.energy - side.load_work + pressure * side.volume)
        here, there = densities
        density = here - np.where(self._inside[:, None], there, 0.0) + self._change_of_loads()
        weights, linear = self._between.weights, self._between.linear
        means = (weights * linear).sum(axis=1, keepdims=True) / weights.sum(axis=1, keepdims=True)
        lifted = weights * np.array([linear, np.broadcast_to(means, linear.shape)])
        return np.asarray(self._share * (lifted * density).sum(axis=2))

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

    def of_kinks(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the most that kinks of facets release, shape (f,)."""
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
        slopes = self._between.slopes
        traction = section.over(tension, self._x)[..., : space.d] @ slopes[..., None]
        squares = (traction**2).sum(axis=(2, 3))
        # Where the displacement is given, the stress across the facet counts, too.
        is_held = np.isin(self.numbers, self._held_facets())
        all_stress = (section.over(stress, self._x) ** 2).sum(axis=(2, 3))
        steepness = (slopes**2).sum(axis=2)
        squares = np.where(is_held[:, None], all_stress * steepness, squares)

        cell = self._between.sides[:, 0]
        middles = space.cell_corners()[cell].mean(axis=1)
        modulus = section.over(self._model.cell_modulus.x.array[cell], middles)
        density = section.times(squares / modulus[:, None], self._x)
        weights = self._between.weights
        heights_2 = (weights * self._between.heights**2).sum(axis=1)
        length = np.sqrt(heights_2 / (weights * steepness).sum(axis=1))
        most = self._share * length * (weights * density).sum(axis=1)
        # What holds a surface stores energy where a free surface releases it.
        return np.where(is_held, -most, LEAST_OF_KINKS * most), most

    def _held_facets(self) -> np.ndarray:
        """Return the numbers of facets with supports or contacts."""
        model = self._model
        held = [facets for facets, _ in model.fixed_facets]
        for contact in model.contacts:
            held += [contact.trace.here.facets, contact.trace.there.facets]
        return np.concatenate([np.zeros(0, int), *map(model.space.facet_numbers, held)])


def _shares(
    comm: MPI.Comm, first: np.ndarray, least: np.ndarray, most: np.ndarray, marks: np.ndarray
) -> np.ndarray:
    """Share out to facets the greatest likely change of the energy; collective.

    Args:
        comm: The ranks.
        first: The first term of each facet of this rank, evaluated in two ways [force
            length], shape (2, n).
        least: The least that kinks release.
        most: The most, not below zero.
        marks: Mark of the surface of each facet, shape (n,).

    Returns:
        The share of each facet, not below zero, shape (n,).
    """
    known = distinct_rows(comm, marks)
    surface = np.searchsorted(known, marks)
    # They share out the sums of a surface: what cancels on it is not shared out.
    amounts = abs(first).sum(axis=0)
    local = [np.bincount(surface, of, len(known)) for of in (*first, amounts, least, most)]
    *sums, amount_sums, least_sums, most_sums = comm.allreduce(np.array(local), MPI.SUM)
    likely = np.array([*sums, *(MOST_OF_FIRST * value for value in sums)])
    high = float((likely.max(axis=0) + most_sums).sum())
    low = float((likely.min(axis=0) + least_sums).sum())
    size = abs(likely).max(axis=0)
    of_amount = np.divide(size, amount_sums, out=np.zeros(len(known)), where=amount_sums > 0)
    parts = amounts * of_amount[surface] + most
    whole = float((size + most_sums).sum())
    return np.asarray(parts * (max(high, -low) / whole if whole > 0 else 0.0))
