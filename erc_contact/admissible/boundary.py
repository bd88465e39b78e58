"""Moments of facet tractions that loads give, and where supports leave them free."""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.cells import CellGeometry, add_moments
from erc_contact.admissible.loads import traction_moments
from erc_contact.admissible.springs import stiff_components
from erc_contact.model.model import Model


def load_moments(model: Model, cells: CellGeometry) -> np.ndarray:
    """Compute the moments of the loads on facets, projected on degree k; collective.

    Returns:
        Moments [force], shape (facets, m, d).
    """
    result = np.zeros((cells.side.shape[1], len(model.facet_points), cells.d))
    for load in model.surface_loads:
        facets = model.domain.facets(load.facets)
        add_moments(model, result, facets, traction_moments(model, facets, load.density))
    return result


def supported_components(model: Model, cells: CellGeometry) -> np.ndarray:
    """Tell which components of a facet may have any traction, shape (facets, d).

    A support, or a stiff spring, holds them.
    """
    fixed = np.zeros((cells.side.shape[1], cells.d), dtype=bool)
    for facets, components in model.fixed_facets:
        fixed[model.facet_numbers(facets)] |= components
    for spring in model.springs:
        fixed[model.facet_numbers(spring.side.facets)] |= stiff_components(spring)
    return fixed
