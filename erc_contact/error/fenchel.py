"""Integrate Fenchel's gap of a potential over the cells of a body.

psi and psi* are no polynomials, so their integrals are adapted. But near the strain
eps_c in the middle of a cell the law is nearly the linear law

    sigma = S(eps) = psi'(eps_c) + C_c (eps - eps_c),    C_c = psi''(eps_c),

whose gap ``|sigma^ - S(eps(u^))|^2`` is a polynomial on each sub-simplex, and is
integrated exactly. Only the difference of both gaps is adapted. In an elastic cell it
is zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.elastic import CellStrains, strains_of_body
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.error.hidden import hidden_by_data
from erc_contact.error.laws import UNKNOWN_SHARE, LawError
from erc_contact.model.data.expressions import definite_inverses
from erc_contact.model.data.quadrature import INSET, cell_pieces, integrate
from erc_contact.model.law.point_law import PointLaw
from erc_contact.model.law.potential import ConvexConstitution
from namedmesh.simplex import barycentric, nodes

ROUND_OFF = 1e-15
"""Error of a gap, a difference of energies, over these energies [-]."""
SAME = 1e-13
"""Difference of the gaps of two laws that is round-off, over the energies [-]."""
LAW_STEPS = 2
"""Number of linear problems that take as long as a solve with such a law, or less."""
CHUNK = 2048
"""Number of cells that are worked on at once."""


def fenchel_error(admissible: Admissible) -> LawError:
    """Measure how far sigma^ and u^ are from the law of a potential; collective.

    ``gap`` is twice the integral of ``psi + psi* - sigma : eps``, with what that leaves
    unknown, and ``both`` of ``psi + psi* + sigma : (eps - 2 eps_r)`` with the strain
    eps_r without stress in the middle of each cell, which a plastic strain leaves.
    """
    model = admissible.model
    space = model.space
    comm = space.comm
    cells = admissible.cell_geometry
    owned = model.domain.owned_cells
    of_cells = space.owned_cells
    k = space.degree
    volume = cells.volume[:owned]
    strain = strains_of_body(model, cells, admissible.displacement)
    near = _LinearLaws(admissible, strain)

    constitution = model.constitution
    assert model.linearised is not None
    assert isinstance(constitution, ConvexConstitution)
    law = model.linearised.law
    is_constant = k == 1 and not space.section.varies and not law.varies_in_cells

    def beyond(
        law: PointLaw, cell: np.ndarray, sigma: np.ndarray, places: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        eps = near.strain_of(cell) if is_constant else strain.at(cell, places, x)
        out_of_plane = near.out_of_plane(cell, sigma)
        of_law = constitution.fenchel(law, eps, sigma, out_of_plane, x, of_cells[cell])
        of_law[..., 1] -= 4 * near.work_at_rest(cell, sigma)
        return of_law - near.squares(cell, eps, sigma) if near.taken else of_law

    def of_law(law: PointLaw, cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return beyond(law, cell, admissible.stress_at(cell, places, x), places, x)

    def difference(cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return of_law(law, cell, places, x)

    of_linear = near.integrals(volume)
    # The round-off of both energies is known, and need not be resolved.
    size = comm.allreduce(of_linear.sum(axis=0), MPI.SUM)
    floor = UNKNOWN_SHARE * size + ROUND_OFF * size[1]
    corners = cells.corners[:owned]
    pieces = cell_pieces(space.d)
    left = volume
    if near.taken:
        left = np.where(_is_linear(beyond, law, near, admissible), 0.0, volume)
    total = integrate(
        comm,
        difference,
        corners,
        left,
        pieces,
        share=UNKNOWN_SHARE,
        floor=floor,
        hidden=hidden_by_data(law, of_cells, of_law),
        most=LAW_STEPS * space.points_in_cells,
    )
    unknown = 0.0 if total.resolved.all() else float(total.bound.max(axis=1).sum())
    value = np.maximum(near.taken * of_linear + total.value, 0.0)
    return LawError(value[:, 0] + total.bound[:, 0], value[:, 1], unknown)


def _is_linear(
    beyond: Callable[..., np.ndarray],
    law: PointLaw,
    near: _LinearLaws,
    admissible: Admissible,
) -> np.ndarray:
    """Tell in which owned cells the law is its linear law, for all coefficients.

    So it is in elastic cells of plastic bodies: stresses below the yield stress are a
    convex set, of stresses and yield stresses together. A polynomial stays in the
    convex hull of its Bernstein coefficients, a strain, of less degree, in the hull of
    its values at the nodes, and a number of the law that varies in its range. Where a
    range is not known, no cell is linear.

    Args:
        beyond: Gets a law, cells, stresses, places and points, and returns the gaps of
            the law less the gaps of the linear law.
        law: The law.
        near: The linear laws.
        admissible: The pair.
    """
    cells, stress = admissible.cell_geometry, admissible.stress
    of_cells = admissible.model.space.owned_cells
    d = cells.d
    if law.varies_in_cells and not law.knows_ranges:
        return np.zeros(len(stress), dtype=bool)
    of_piece = barycentric(nodes(d, cells.degree))
    # They do not lie on the boundary, as data may jump there.
    of_piece = (1 - INSET) * of_piece + INSET / (d + 1)
    result = np.ones(len(stress), dtype=bool)
    for start in range(0, len(stress), CHUNK):
        cell = np.arange(start, min(start + CHUNK, len(stress)))
        allowed = SAME * near.energies(cell)
        for number, piece in enumerate(cell_pieces(d)):
            places = np.broadcast_to(of_piece @ piece, (len(cell), *of_piece.shape))
            x = np.matmul(places, cells.corners[cell])
            for changed in _laws_in_range(
                law, np.matmul(piece, cells.corners[cell]), x, of_cells[cell]
            ):
                left = abs(beyond(changed, cell, stress[cell, number], places, x)).max(axis=(1, 2))
                result[cell] &= left <= allowed
    return result


def _laws_in_range(
    law: PointLaw, corners: np.ndarray, x: np.ndarray, cells: np.ndarray
) -> Iterator[PointLaw]:
    """Yield a law, and with each of its numbers at the ends of its range in pieces.

    Args:
        law: The law.
        corners: Vertices of the pieces [length], shape (n, d+1, d).
        x: Points of the pieces [length], shape (n, q, d).
        cells: Their cells, shape (n,).
    """
    yield law
    if not law.varies_in_cells:
        return
    ranges = law.data_ranges(corners, cells)
    data = law.data_at(x, cells)
    for number in np.flatnonzero((ranges[0] < ranges[1]).any(axis=0)):
        for end in ranges:
            changed = data.copy()
            changed[..., number] = end[:, None, number]
            yield law.with_data(changed)


class _LinearLaws:
    """Hold the linear law of each owned cell, about the strain in its middle.

    Args:
        admissible: The pair.
        strain: The strain of u^.

    Attributes:
        taken: Whether its gap is taken from the gap of the law: on rings it is no
            polynomial, and only tells the size of the integrals.
    """

    def __init__(self, admissible: Admissible, strain: CellStrains) -> None:
        model = admissible.model
        space = model.space
        assert model.linearised is not None
        law = model.linearised.law
        owned = space.owned_cells
        size = len(law.rows)
        x = admissible.cell_geometry.corners[: len(owned)].mean(axis=1, keepdims=True)
        middles = np.full((len(owned), 1, space.d + 1), 1 / (space.d + 1))
        self._pair = admissible
        self._of_displacement = strain
        self.taken = not space.section.varies
        self._strain = strain.at(owned, middles, x)
        whole_stress = law.whole_stress(self._strain, x, owned)
        whole_tangent = law.whole_tangent(self._strain, x, owned)[:, 0]
        self._stress = whole_stress[..., :size]
        self._tangent = whole_tangent[:, :size, :size]
        self._metric = definite_inverses(self._tangent)
        self._rest = law.strain_at_rest(x, owned)
        if law.is_plane:
            self._normal = whole_stress[:, 0, -1:]
            self._slope = np.matmul(self._metric, whole_tangent[:, :size, size:])

    def strain_of(self, cell: np.ndarray) -> np.ndarray:
        """Return the strain in the middle of cells, shape (n, 1, s)."""
        return np.asarray(self._strain[cell])

    def energies(self, cell: np.ndarray) -> np.ndarray:
        """Return the size of the energies in the middle of cells [force/area], (n,)."""
        stress, strain = self._stress[cell, 0], self._strain[cell, 0]
        works = np.einsum("ni,ni->n", abs(stress), abs(strain) + abs(self._rest[cell, 0]))
        of_stress = np.einsum("ni,nij,nj->n", stress, self._metric[cell], stress)
        return np.asarray(works + of_stress)

    def work_at_rest(self, cell: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the work of stresses (n, q, s) on the strain at rest, (n, q)."""
        return np.einsum("nqi,ni->nq", sigma, self._rest[cell, 0])

    def out_of_plane(self, cell: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the stress out of plane that goes with stresses (n, q, s), (n, q)."""
        if sigma.shape[-1] != 3:
            return np.zeros(sigma.shape[:2])
        change = np.matmul(sigma - self._stress[cell], self._slope[cell])[..., 0]
        return np.asarray(self._normal[cell] + change)

    def squares(
        self,
        cell: np.ndarray,
        eps: np.ndarray,
        sigma: np.ndarray,
        around: np.ndarray | float = 1.0,
    ) -> np.ndarray:
        """Return ``|sigma -+ S(eps)|^2`` in the metrics of cells, shape (n, q, 2).

        ``around`` are the circumferences of rings [length], shape (n, q, 1).
        """
        change = np.matmul(eps - self._strain[cell], self._tangent[cell])
        of_law = around * (self._stress[cell] + change)
        squares = []
        for tensor in (sigma - of_law, sigma + of_law):
            strain = np.matmul(tensor, self._metric[cell])
            squares.append(np.einsum("nqi,nqi->nq", strain, tensor))
        return np.stack(squares, axis=-1) / around

    def integrals(self, volume: np.ndarray) -> np.ndarray:
        """Integrate :meth:`squares` by the rule of the sub-simplices, (owned, 2)."""
        pair = self._pair
        model = pair.model
        _, points, weights = macro_points(model.space.d, model.space.degree)
        owned = len(volume)
        x = np.matmul(barycentric(points), pair.cell_geometry.corners[:owned])
        eps = self._of_displacement.at_points(slice(owned), points, x)
        sigma = pair.stress_at_macro_points(x)
        squares = self.squares(np.arange(owned), eps, sigma, model.space.section.weight(x))
        return np.asarray(volume[:, None] * np.einsum("nqi,q->ni", squares, weights))
