"""Integrate Fenchel's gap of a potential over the cells of a body.

psi and psi* are no polynomials, so their integrals are adapted. But near the strain
eps_c in the middle of a cell the law is nearly the linear law

    sigma = S(eps) = psi'(eps_c) + C_c (eps - eps_c),    C_c = psi''(eps_c),

whose gap ``|sigma^ - S(eps(u^))|^2`` is a polynomial on each sub-simplex, and is
integrated exactly. Only the difference of both gaps is adapted. In an elastic cell it
is zero.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.elastic import CellStrains
from erc_contact.admissible.macro import macro_points, macro_values
from erc_contact.admissible.pair import Admissible
from erc_contact.error.laws import LawError
from erc_contact.mesh.quadrature import cell_pieces, integrate
from erc_contact.mesh.simplex import bernstein

UNKNOWN_SHARE = 1e-3
"""Share of e^2 that the integrals may leave unknown [-]; e^2 contains it."""
ROUND_OFF = 1e-15
"""Error of a gap, a difference of energies, over these energies [-]."""


def fenchel_error(admissible: Admissible) -> LawError:
    """Measure how far sigma^ and u^ are from the law of a potential; collective.

    ``gap`` is twice the integral of ``psi + psi* - sigma : eps``, with what that leaves
    unknown, and ``both`` of ``psi + psi* + sigma : eps``.
    """
    model = admissible.model
    comm = model.comm
    cells = admissible.cell_geometry
    owned = model.domain.owned_cells
    of_cells = model.owned_cells
    k = model.degree
    volume = cells.volume[:owned]
    strain = CellStrains.of(model, cells, admissible.displacement)
    near = _LinearLaws(admissible, strain)

    def difference(cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        sigma = macro_values(admissible.stress, k, cell, places)
        eps = strain.at(cell, places, x)
        of_law = model.constitution.squares(eps, sigma, x, of_cells[cell])
        return np.asarray(of_law - near.squares(cell, eps, sigma))

    shape, points, weights = macro_points(model.d, k)
    sigma = np.matmul(shape, admissible.stress).reshape(
        owned, len(points), admissible.stress.shape[-1]
    )
    eps = np.matmul(bernstein(model.d, k - 1, points), strain.in_plane[:owned])
    squares = near.squares(np.arange(owned), eps, sigma)
    of_linear = volume[:, None] * np.einsum("nqi,q->ni", squares, weights)
    # The round-off of both energies is known, and need not be resolved.
    size = comm.allreduce(of_linear.sum(axis=0), MPI.SUM)
    floor = UNKNOWN_SHARE * size + ROUND_OFF * size[1]
    corners = cells.corners[:owned]
    pieces = cell_pieces(model.d)
    total = integrate(comm, difference, corners, volume, pieces, share=UNKNOWN_SHARE, floor=floor)
    unknown = 0.0 if total.resolved.all() else float(total.rest.max(axis=1).sum())
    value = np.maximum(of_linear + total.value, 0.0)
    return LawError(value[:, 0] + total.rest[:, 0], value[:, 1], unknown)


class _LinearLaws:
    """Hold the linear law of each owned cell, about the strain in its middle.

    Args:
        admissible: The pair.
        strain: The strain of u^.
    """

    def __init__(self, admissible: Admissible, strain: CellStrains) -> None:
        model = admissible.model
        assert model.linearised is not None
        law = model.linearised.law
        owned = model.owned_cells
        x = admissible.cell_geometry.corners[: len(owned)].mean(axis=1, keepdims=True)
        middles = np.full((len(owned), 1, model.d + 1), 1 / (model.d + 1))
        self._strain = strain.at(owned, middles, x)
        self._stress = law.stress(self._strain, x, owned)
        self._tangent = law.tangent(self._strain, x, owned)[:, 0]
        self._metric = np.linalg.inv(self._tangent)

    def squares(self, cell: np.ndarray, eps: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return ``|sigma -+ S(eps)|^2`` in the metrics of cells, shape (n, q, 2)."""
        change = np.matmul(eps - self._strain[cell], self._tangent[cell])
        of_law = self._stress[cell] + change
        squares = []
        for tensor in (sigma - of_law, sigma + of_law):
            squares.append((np.matmul(tensor, self._metric[cell]) * tensor).sum(axis=-1))
        return np.stack(squares, axis=-1)
