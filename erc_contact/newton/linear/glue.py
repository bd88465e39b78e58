"""Springs that glue bodies at their contacts: to the foundations, and to each other.

Each contact has a diagonal stiffness ``D_c = 10 E k^2/h |F|/m`` at its nodes, summed
over its facets. The springs resist what contacts read of the displacement,

    D = sum_c B_c^T D_c B_c,

so that D is diagonal on foundations, and couples the two nodes of a pair.

Symbols: B_c as in :mod:`erc_contact.model.contact.groups`, k degree, m nodes of a
facet, h height of a cell over its facet F.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import fem, la
from petsc4py import PETSc

from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.side import Side
from erc_contact.model.contact.trace import dofs_of
from erc_contact.model.data.over_ranks import matrix_of_ranks, sum_over_ranks
from erc_contact.model.space import Space
from namedmesh.simplex import measures

GLUE_FACTOR = 10.0
"""gamma_0 of the glue [-]."""


class Glue:
    """Hold D of contacts; construction and members are collective.

    Args:
        space: The mesh.
        contacts: The contacts.
        fixed: Which components supports prescribe at each node, shape (nodes, d).

    Attributes:
        rows: Degrees of freedom of this rank of the entries of D, shape (n,). The
            entries of all ranks add up.
        columns: Their columns, shape (n,).
        values: The entries [force/length], shape (n,).
    """

    def __init__(self, space: Space, contacts: Sequence[ContactOnMesh], fixed: np.ndarray) -> None:
        self._space = space
        self._fixed = fixed.ravel()
        foundations = [contact.trace.here.only(contact.trace.on_foundation) for contact in contacts]
        on_nodes = nodal_glue(space, foundations).x.array
        on_nodes[self._fixed] = 0.0
        owned = space.V.dofmap.index_map.size_local * space.d
        rows = np.flatnonzero(on_nodes[:owned])
        parts = [(rows, rows, on_nodes[rows])]
        for contact in contacts:
            parts += _couple_sides(contact, space)
        self.rows, self.columns, self.values = (
            np.concatenate(part) for part in zip(*parts, strict=True)
        )

    def times(self, u: fem.Function) -> fem.Function:
        """Return the forces ``D u`` on free components [force], zero elsewhere."""
        forces = self._space.function()
        np.add.at(forces.x.array, self.rows, self.values * u.x.array[self.columns])
        forces.x.scatter_reverse(la.InsertMode.add)
        forces.x.array[self._fixed] = 0.0
        forces.x.scatter_forward()
        return forces

    @property
    def free(self) -> np.ndarray:
        """Tell which entries of this rank are between free components, shape (n,)."""
        free = ~self._fixed
        return free[self.rows] & free[self.columns]

    def matrix(self) -> PETSc.Mat:
        """Return D as a matrix, with zeros where supports fix components."""
        values = np.where(self.free, self.values, 0.0)
        rows, columns = (self._space.global_dofs(dofs) for dofs in (self.rows, self.columns))
        return matrix_of_ranks(self._space, rows, columns, values)

    def diagonal(self) -> np.ndarray:
        """Return the diagonal of D at the nodes of this rank [force/length].

        It is zero where supports fix components.
        """
        diagonal = self._space.function()
        used = self.free & (self.rows == self.columns)
        np.add.at(diagonal.x.array, self.rows[used], self.values[used])
        sum_over_ranks(diagonal)
        return diagonal.x.array


def nodal_glue(space: Space, sides: Sequence[Side]) -> fem.Function:
    """Sum up D_c of sides of contacts at their nodes [force/length]; collective."""
    glue = space.function()
    for side in sides:
        _add_of_facets(space, side, side.nodes, glue.x.array.reshape(-1, space.d))
    sum_over_ranks(glue)
    return glue


def _couple_sides(
    contact: ContactOnMesh, space: Space
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return ``B_c^T D_c B_c`` of the facets of this rank: rows, columns and values.

    They are the facets that face another body.
    """
    trace = contact.trace
    side = trace.here.only(trace.facing)
    pairs = np.column_stack([side.nodes.ravel(), trace.partners.ravel()])
    unique, place = np.unique(pairs, axis=0, return_inverse=True)
    glue = np.zeros((len(unique), space.d))
    _add_of_facets(space, side, place.reshape(side.nodes.shape), glue)
    here, there = (dofs_of(nodes, space.d) for nodes in unique.T)
    values = glue.ravel()
    # All components of a node have one stiffness, so that turns leave it as it is.
    seen = trace.seen(np.broadcast_to(np.eye(space.d), (len(unique), space.d, space.d)))
    pair, row, column = np.nonzero(seen)
    first = unique[pair, 1] * space.d + row
    second = unique[pair, 0] * space.d + column
    between = -glue[pair, column] * seen[pair, row, column]
    return [
        (here, here, values),
        (there, there, values),
        (second, first, between),
        (first, second, between),
    ]


def _add_of_facets(space: Space, side: Side, places: np.ndarray, glue: np.ndarray) -> None:
    """Add D_c of the owned facets of a side to the nodes at places (f, m), in place."""
    cells = space.cell_corners()[side.facets[:, 0]]
    height = space.d * measures(cells) / side.areas
    per_area = GLUE_FACTOR * space.degree**2 * side.modulus / height
    # The nodes of a facet have equal shares of it.
    share = per_area * side.owned_areas / side.nodes.shape[1]
    np.add.at(glue, places, share[:, None, None])
