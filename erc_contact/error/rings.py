"""The bulk part of the error of axisymmetric bodies, far from the axis.

The squares of how far a stress S and a strain are from the law are polynomials of
degree 2k over the radius r there, if moduli are constant in each cell and nothing else
is given. Rules integrate them with an error that is bounded.
"""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.axisymmetric.elements import law_of_cells, strides
from erc_contact.admissible.axisymmetric.kernels import ring_kernels
from erc_contact.admissible.elastic import CellStrains
from erc_contact.admissible.pair import Admissible
from erc_contact.error.oscillation import UNKNOWN_SHARE
from erc_contact.mesh.quadrature import cell_pieces
from erc_contact.mesh.simplex import barycentric, bernstein, rule
from erc_contact.model.model import Model
from erc_contact.model.symbolic import varies_in_cells

SERIES = (1, 2, 4, 8, 16, 32)
"""Degrees of the series of 1/r beyond which rules are not exact."""
SERIES_SHARE = 0.1
"""What the series may leave of what integrals may leave unknown [-]."""


def is_rational(model: Model) -> bool:
    """Tell whether the squares of rings are polynomials of degree 2k over r."""
    of_material = any(varies_in_cells(value) for value in model.parameters.values())
    nothing_given = model.strains is None and model.hoop_load is None
    return model.axisymmetric and nothing_given and not of_material


def far_from_axis(
    admissible: Admissible, strain: CellStrains, corners: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrate squares of rings over cells far from the axis by rules.

    A rule of degree ``2k + p`` is exact for a polynomial of degree 2k times p + 1 terms
    of the geometric series of 1/r about the middle of a cell. What the series leaves is
    at most ``rho^(p+1)/r``, with rho the greatest distance from the middle over its
    radius. As squares and weights are not negative, the error is at most twice
    ``rho^(p+1)`` of the integral.

    Args:
        admissible: The pair.
        strain: Strain of u^.
        corners: Vertices of the owned cells [length], shape (n, 3, 2).

    Returns:
        The integrals of ``|S - C eps|^2`` and ``|S + C eps|^2`` [force length] and
        bounds of their errors, shape (n, 2) each, and which cells are done, shape (n,).
    """
    model = admissible.model
    k = model.degree
    law = model.constitution
    middle_point = np.full((1, 2), 1 / 3)
    stiffness = law_of_cells(law.stiffness, corners, middle_point)
    compliance = law_of_cells(law.metric, corners, middle_point)
    assert strain.radial is not None
    fields = (admissible.stress, strain.in_plane, np.ascontiguousarray(strain.radial))
    volume = admissible.cell_geometry.volume
    middle = corners[..., 0].mean(axis=1)
    rho = abs(corners[..., 0] - middle[:, None]).max(axis=1) / middle
    value, rest = np.zeros((2, len(corners), 2))
    done = np.zeros(len(corners), dtype=bool)
    for more in SERIES:
        left = 2 * rho ** (more + 1)
        near = np.flatnonzero(~done & (left <= SERIES_SHARE * UNKNOWN_SHARE))
        points, weights = rule(2, 2 * k + more)
        places = np.concatenate(barycentric(points) @ cell_pieces(2))
        on_cell = places[:, 1:]
        squares = np.empty((len(near), 2))
        ring_kernels()(
            "ring_squares",
            *(k, len(near), near, corners, volume, len(points), places),
            np.tile(weights / len(cell_pieces(2)), len(cell_pieces(2))),
            *(
                np.ascontiguousarray(bernstein(2, degree, at))
                for degree, at in ((k, points), (k - 1, on_cell), (k, on_cell))
            ),
            *(strides(stiffness)[0], stiffness, compliance, *fields, squares),
        )
        value[near] = squares
        rest[near] = left[near, None] * squares
        done[near] = True
    return value, rest, done
