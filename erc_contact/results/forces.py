"""Compute the forces of an admissible pair on the body, with their moments.

Supports, contacts and loads exert them. Of a part of a symmetric body they are
multiplied to forces on the whole body (:mod:`erc_contact.model.copies`).
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from erc_contact.admissible.fields import sides_of
from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.base.exceptions import InputError
from erc_contact.model.copies import closed_copies
from erc_contact.model.forces import Force, by_cause, total_force
from namedmesh.for_solvers import in_space
from namedmesh.simplex import bernstein, coefficients, mass, nodes, of_facets


def force(result: Any, part: str) -> Force:
    """Compute resultant and moment of sigma^ n on a boundary part; collective.

    On a contact it is the force of the foundation on the body. On a support it is the
    reaction, together with the loads on the components that the support leaves free. On
    a part of a tied joint it is the force of the other body, on other parts the load.

    Args:
        result: An admissible pair, an error, or a history.
        part: Name of a boundary part.

    Raises:
        InputError: If no boundary part has this name.
    """
    pair = pair_of(result)
    model = pair.model
    space = model.space
    cells = pair.cell_geometry
    d = space.d
    k = space.degree
    sides = sides_of(model, part)
    facets = space.facet_numbers(sides)
    cell, local = np.divmod(cells.side[0][facets], d + 1)
    # Inside the body, the tractions are those on the first cell of a facet.
    sign = np.where(cell == sides[:, 0], 1.0, -1.0)
    corners = of_facets(cells.vertices[cell], local)
    # The moments against hat functions are forces at the corners, with the resultant
    # and the moment of the tractions. They follow from those against Bernstein
    # polynomials.
    hats = bernstein(d - 1, 1, nodes(d - 1, k)).T @ coefficients(d - 1, k).T
    forces = np.matmul(hats, sign[:, None, None] * pair.facet_moments[facets])
    return total_force(model, corners.ravel(), forces.reshape(-1, d))


def reactions(result: Any) -> dict[str, Force]:
    """Compute the forces on the body by their cause; collective.

    See :func:`erc_contact.model.forces.by_cause`.
    """
    pair = pair_of(result)
    return by_cause(pair.model, partial(force, pair), partial(_body_force, pair))


def _body_force(pair: Admissible) -> Force:
    """Compute resultant and moment of the loads in the body; collective."""
    assert pair.cell_forces is not None
    space = pair.model.space
    owned = space.domain.owned_cells
    vertices = pair.cell_geometry.vertices[:owned]
    # Means of the load times the hat functions are forces at the vertices.
    forces = np.matmul(mass(space.d, 1, space.degree - 1), pair.cell_forces[:owned])
    return total_force(pair.model, vertices.ravel(), forces.reshape(-1, space.d))


def whole_force(result: Any, part: str) -> Force:
    """Compute the force on all copies of a boundary part; collective.

    The copies are those by the planes of :class:`erc_contact.Symmetry`, not of rollers,
    and the sectors of :class:`erc_contact.Cyclic`.

    Args:
        result: An admissible pair, an error, or a history.
        part: Name of a boundary part.

    Raises:
        InputError: If the scene has none of them, or they do not close a body.
    """
    model = pair_of(result).model
    copies = closed_copies(model, "whole_force")
    if len(copies) == 1:
        raise InputError(
            "whole_force: this scene has no Symmetry and no Cyclic; force() has the force."
        )
    of_part = force(result, part)
    d = model.space.d
    whole = np.zeros(d)
    moment = np.zeros(3)
    own_moment = np.zeros(3)
    own_moment[-len(of_part.moment) :] = of_part.moment
    for linear, shift in copies:
        pulled = linear @ of_part.force
        turned = np.eye(3)
        turned[:d, :d] = linear
        whole += pulled
        # A reflection changes the sign of a moment, which is a cross product.
        moment += np.linalg.det(linear) * (turned @ own_moment)
        moment += np.cross(*in_space(np.array([shift, pulled])))
    return Force(whole, moment[-len(of_part.moment) :], of_part.units)
