"""Integrate psi and psi* of an admissible pair by a rule of its own in all sub-simplices."""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.elastic import strains_of_body
from erc_contact.admissible.macro import macro_values
from erc_contact.model.data.quadrature import cell_pieces
from erc_contact.model.law.point_law import Search
from erc_contact.model.meridian import circumferences
from namedmesh.simplex import barycentric, rule

RULE = 8
"""Degree of the rule."""


def energies_of_law(error):
    """Return the integrals of psi of u^ and psi* of sigma^ [force length], on one rank.

    On rings sigma^ is times the circumference, and the integrals are of the full ring.
    """
    pair, model = error.admissible, error.model
    law, cells, of_cells = model.linearised.law, pair.cell_geometry, model.space.owned_cells
    points, weights = rule(model.space.d, RULE)
    measures = cells.volume[of_cells, None] * weights / (model.space.d + 1)
    strain = strains_of_body(model, cells, pair.displacement)
    psi, psi_star = 0.0, 0.0
    for sub in cell_pieces(model.space.d):
        shape = len(of_cells), len(points), model.space.d + 1
        places = np.broadcast_to(barycentric(points) @ sub, shape)
        x = np.matmul(places, cells.corners[of_cells])
        sigma = macro_values(pair.stress, model.space.degree, of_cells, places)
        around = circumferences(x) if model.space.axisymmetric else np.ones(x.shape[:2])
        sigma = model.hoop_load.plus(sigma, x, of_cells)
        eps = strain.at(of_cells, places, x)
        energy, stress = law.energy(eps, x, of_cells), law.whole_stress(eps, x, of_cells)
        of_law = sigma / around[..., None]
        complementary, _ = law.complementary(of_law, Search(stress[..., -1]), x, of_cells)
        psi += float((measures * around * energy).sum())
        psi_star += float((measures * around * complementary).sum())
    return psi, psi_star
