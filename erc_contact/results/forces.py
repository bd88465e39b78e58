"""Forces of supports, contacts and loads on the body, with their moments, from an admissible pair."""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.mesh.simplex import bernstein, coefficients, facet_vertices, mass, nodes
from erc_contact.model.forces import Force, by_cause, total_force


def force(result: Any, part: str) -> Force:
    """Resultant and moment of the tractions sigma^ n on a part of the boundary; collective.

    On a contact it is the force of the foundation on the body. On a support it is the
    reaction, together with the loads on the components that the support leaves free. On
    other parts it is the load.

    Args:
        result: An admissible pair, an error, or a history.
        part: Name of a boundary part.

    Raises:
        InputError: If no boundary part has this name.
    """
    pair = pair_of(result)
    model, cells = pair.model, pair.cell_geometry
    facets = model.facet_numbers(model.domain.owned_facets(part))
    d, k = model.d, model.degree
    cell, i = np.divmod(cells.side[0][facets], d + 1)
    corners = np.take_along_axis(cells.vertices[cell], facet_vertices(d)[i], axis=1)
    linear = bernstein(d - 1, 1, nodes(d - 1, k)).T @ coefficients(d - 1, k).T
    return total_force(
        model, corners.ravel(), np.matmul(linear, pair.facet_moments[facets]).reshape(-1, d)
    )


def reactions(result: Any) -> dict[str, Force]:
    """The forces on the body by their cause, see :func:`erc_contact.model.forces.by_cause`; collective."""
    pair = pair_of(result)
    return by_cause(pair.model, lambda part: force(pair, part), lambda: _body_force(pair))


def _body_force(pair: Admissible) -> Force:
    """Resultant and moment of the loads in the body; collective."""
    model, cells, owned = pair.model, pair.cell_geometry, pair.domain.owned_cells
    assert pair.cell_forces is not None
    forces = np.matmul(mass(model.d, 1, model.degree - 1), pair.cell_forces[:owned])
    return total_force(model, cells.vertices[:owned].ravel(), forces.reshape(-1, model.d))
