"""Forces on the body with their moments: of supports, contacts and loads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.pair import Admissible
from erc_contact.mesh.simplex import bernstein, coefficients, facet_vertices, mass, nodes
from erc_contact.model.model import Model


@dataclass(frozen=True, eq=False)
class Force:
    """A force on the body with its moment.

    Attributes:
        force: Resultant [force], shape (d,).
        moment: Moment about the origin [force length], shape (1,) in 2D, (3,) in 3D.
    """

    force: np.ndarray
    moment: np.ndarray

    def __add__(self, other: Force) -> Force:
        return Force(self.force + other.force, self.moment + other.moment)


def force(pair: Admissible, part: str) -> Force:
    """Resultant and moment of the tractions sigma^ n on a part of the boundary; collective.

    On a contact it is what the foundation exerts on the body, on a support the reaction with the loads on the
    components that it leaves free, elsewhere the load.

    Args:
        pair: An admissible pair.
        part: Name of a boundary part.

    Raises:
        InputError: If no boundary part has this name.
    """
    model = pair.solution.model
    sides = model.domain.facets(part)
    sides = sides[model.owned(sides)]
    return _force(pair, sides)


def reactions(pair: Admissible) -> dict[str, Force]:
    """The forces on the body by their cause; collective.

    Args:
        pair: An admissible pair.

    Returns:
        The forces of all supports and contacts by the names of their parts, of all tractions on parts without support
        as "tractions" and of the body force as "body force" where the scene has them; as "balance" the sum of all, zero
        up to round-off.
    """
    scene = pair.solution.scene
    held = dict.fromkeys([s.facets for s in scene.supports] + [c.facets for c in scene.contacts])
    result = {name: force(pair, name) for name in held}
    loaded = dict.fromkeys(t.facets for t in pair.solution.model.surface_loads if t.facets not in held)
    if loaded:
        forces = [force(pair, name) for name in loaded]
        result["tractions"] = sum(forces[1:], start=forces[0])
    if pair.cell_forces is not None:
        result["body force"] = _body_force(pair)
    parts = list(result.values())
    result["balance"] = sum(parts[1:], start=parts[0])
    return result


def _force(pair: Admissible, sides: np.ndarray) -> Force:
    """Of facets of owned cells on the boundary, (n, 2)."""
    model, cells = pair.solution.model, pair.cell_geometry
    d, k = model.d, model.degree
    facets = model.facet_numbers(sides)
    cell, i = np.divmod(cells.side[0][facets], d + 1)
    corners = np.take_along_axis(cells.vertices[cell], facet_vertices(d)[i], axis=1)
    linear = bernstein(d - 1, 1, nodes(d - 1, k)).T @ coefficients(d - 1, k).T
    return _summed(model, corners, np.matmul(linear, pair.facet_moments[facets]))


def _body_force(pair: Admissible) -> Force:
    """Of the body force in all cells."""
    model, cells, owned = pair.solution.model, pair.cell_geometry, pair.solution.domain.owned_cells
    assert pair.cell_forces is not None
    moment = np.matmul(mass(model.d, 1, model.degree - 1), pair.cell_forces[:owned])
    return _summed(model, cells.vertices[:owned], moment)


def _summed(model: Model, corners: np.ndarray, forces: np.ndarray) -> Force:
    """Sum over all ranks of forces (n, v, d) at nodes (n, v)."""
    x = model.V.tabulate_dof_coordinates()[corners]
    f = np.pad(forces, ((0, 0), (0, 0), (0, 3 - model.d)))
    moment = np.cross(x, f).sum(axis=(0, 1))
    local = np.concatenate([forces.sum(axis=(0, 1)), moment[[2]] if model.d == 2 else moment])
    total = model.comm.allreduce(local, MPI.SUM)
    return Force(total[: model.d], total[model.d :])
