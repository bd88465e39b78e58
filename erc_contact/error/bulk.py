"""The bulk part of the error in the constitutive relation, and the error by the flat facets of a curved body.

Source: Coorevits, Hild, Hjiaj, equations (16)-(18); the error of the geometry is ours.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cells import sorted_corners
from erc_contact.admissible.elastic import act, elastic_stress, macro_moduli, strains
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.macro import macro_points, macro_values
from erc_contact.admissible.pair import Admissible
from erc_contact.error.oscillation import EXACT, UNKNOWN
from erc_contact.mesh.quadrature import cell_pieces, integrate, polynomials
from erc_contact.mesh.surface import pairs, swept


def bulk_squares(admissible: Admissible) -> tuple[np.ndarray, np.ndarray, float]:
    """``|sigma^ - C eps(u^)|^2`` and ``|sigma^ + C eps(u^)|^2`` of each owned cell; collective.

    If the moduli vary inside cells, the first result contains what its integral leaves
    unknown. The third result is the sum of this over the cells of the rank if it is
    more than the tolerance, else 0.
    """
    model, cells = admissible.model, admissible.cell_geometry
    owned, k = model.domain.owned_cells, model.degree
    shape, _, weights = macro_points(model.d, k)
    compliance = macro_moduli(model, cells, owned, inverse=True)
    elastic = elastic_stress(model, cells, admissible.displacement, owned)
    difference, both = np.empty((2, owned))
    kernels()(
        "stress_squares",
        *(
            owned,
            elastic.shape[2],
            *admissible.stress.shape[1:3],
            len(shape),
            shape,
            weights,
            cells.volume,
        ),
        *(admissible.stress, elastic.shape[1], np.ascontiguousarray(elastic)),
        *(
            len(compliance) > 1,
            compliance.shape[1],
            np.ascontiguousarray(compliance),
            difference,
            both,
        ),
    )
    if not model.elasticity.varies_in_cells:
        return difference, both, 0.0
    of_cells = model.owned_cells
    strain = strains(cells, admissible.displacement)[:owned]

    def squares(of: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        S = model.compliance(x, of_cells[of])
        elastic = act(
            model.elasticity(x, of_cells[of]), np.matmul(polynomials(k - 1, at), strain[of])
        )
        sigma = macro_values(admissible.stress, k, of, at)
        return np.stack(
            [(act(S, tau) * tau).sum(axis=-1) for tau in (sigma - elastic, sigma + elastic)],
            axis=-1,
        )

    corners = sorted_corners(model, cells)[:owned]
    floor = np.array([EXACT**2 * model.comm.allreduce(float(both.sum()), MPI.SUM), 0.0])
    total = integrate(
        model.comm,
        squares,
        corners,
        cells.volume[:owned],
        cell_pieces(model.d),
        share=UNKNOWN,
        floor=floor,
    )
    unknown = 0.0 if total.resolved.all() else float(total.rest.max(axis=1).sum())
    return total.value[:, 0] + total.rest[:, 0], total.value[:, 1], unknown


def geometry_squares(admissible: Admissible, both: np.ndarray) -> np.ndarray:
    """The share of each owned cell in the square of ``ConstitutiveError.geometry_error`` [force length].

    A facet on the boundary of the body counts for its cell. A facet between two cells
    counts half for each.

    Args:
        admissible: The pair.
        both: ``|sigma^ + C eps(u^)|^2 = 4 |sigma_m|^2`` of each owned cell [force
            length].
    """
    model, cells = admissible.model, admissible.cell_geometry
    result = np.zeros(len(both))
    if model.domain.offset is None or model.domain.curved_facets is None:
        return result
    density = model.domain.function("DG", 0)
    density.x.array[: len(both)] = both / (4 * cells.volume[: len(both)])
    density.x.scatter_forward()
    sides = pairs(model.mesh, model.domain.curved_facets.indices)
    sides = sides[model.owned(sides)]
    facets = model.facet_numbers(sides)
    beyond = cells.side[:, facets] // (model.d + 1)
    beyond = np.where(beyond[0] == sides[:, 0], beyond[1], beyond[0])
    inside = beyond != sides[:, 0]
    jump = density.x.array[sides[:, 0]] - np.where(inside, density.x.array[beyond], 0.0)
    cost = abs(jump) * swept(model.domain.offset, sides, model.facet_areas(sides))
    np.add.at(result, sides[:, 0], np.where(inside, 0.5, 1.0) * cost)
    return result
