"""The reactions of a contact problem, and the multipliers that follow from them.

Each rank has the rows of its own nodes of :class:`.multiplier_map.MultiplierMap`.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from erc_contact.base.sparse import sparse_like
from erc_contact.model.model import Model
from erc_contact.newton.contact_nodes import Entries
from erc_contact.newton.multiplier_map import MultiplierMap


class Reactions:
    """Map nodal forces to multipliers, each rank for its own nodes.

    Construction and products are collective.

    Args:
        model: The scene on a mesh.
        like: A matrix for the degrees of freedom of the model.

    Attributes:
        free: Which degrees of freedom of the nodes that this rank owns are in A, shape
            (nodes, d).
        area: Area of these nodes in the contact that their multiplier belongs to
            [length^(d-1)], elsewhere 1, shape (nodes,).
        matrices: For each contact the matrix from nodal forces [force] to the Bernstein
            coefficients of the multiplier [force/area].
        coefficients: C at A; None for degree 1.
        shared: What contacts share at nodes of several bodies; None without.
    """

    def __init__(self, model: Model, like: PETSc.Mat) -> None:
        multiplier_map = MultiplierMap(model)
        low, high = model.V.dofmap.index_map.local_range
        owned = (multiplier_map.numbers >= low) & (multiplier_map.numbers < high)
        nodes = multiplier_map.numbers[owned] - low
        self.free = np.zeros((high - low, model.d), dtype=bool)
        self.free[nodes] = multiplier_map.free[owned]
        self.area = np.ones(high - low)
        self.area[nodes] = multiplier_map.area[owned]
        self.matrices = [_distributed(like, entries) for entries in multiplier_map.multipliers]
        self.shared = multiplier_map.shared
        self.coefficients: PETSc.Mat | None = None
        if multiplier_map.coefficients is not None:
            self.coefficients = _distributed(like, multiplier_map.coefficients)

    def destroy(self) -> None:
        """Free PETSc's objects."""
        for matrix in self.matrices:
            matrix.destroy()
        if self.coefficients is not None:
            self.coefficients.destroy()


def _distributed(like: PETSc.Mat, entries: Entries) -> PETSc.Mat:
    """Make a matrix of all ranks from entries that all of them have; collective."""
    low, high = like.getOwnershipRange()
    owned = (entries.rows >= low) & (entries.rows < high)
    matrix = sparse_like(like, entries.rows[owned], entries.columns[owned])
    matrix.setValuesCOO(entries.values[owned])
    return matrix
