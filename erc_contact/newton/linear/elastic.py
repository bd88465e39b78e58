"""The elastic equations of a model: what every way to solve them begins with.

Their unknowns x are those of :mod:`erc_contact.model.coordinates`: the displacement u,
but jumps at contacts between bodies. Displacements and nodal forces come and go as
those of the body; matrices and vectors are those of x.

Symbols: K elastic stiffness of x with the supports [force/length]; D diagonal stiffness
that glues the contact nodes to the foundations, and bodies to each other, ``D_i = 10 E
k^2/h |F|/m`` summed over facets.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from functools import cached_property
from typing import Any, Self

import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fp
from petsc4py import PETSc

from erc_contact.base.runtime import compiled
from erc_contact.base.sparse import add_diagonal, as_blocks, as_entries, assembled
from erc_contact.mesh.simplex import measures
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model

GLUE_FACTOR = 10.0
"""gamma_0 of the glue [-]."""


class Elastic:
    """Represent the elastic equations of a model with its supports.

    Args:
        model: The scene on a mesh.

    Attributes:
        form: The compiled form of K.
        glue: D at the free degrees of freedom of the contact nodes, zero elsewhere
            [force/length], a Function of V; without contact it is zero.
        owned: Number of degrees of freedom of this rank.
        support_stiffness: Entry on the diagonal of K where a support fixes a component
            [force/length]. A factor does not mind its size.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        u = ufl.TrialFunction(model.V)
        v = ufl.TestFunction(model.V)
        self.form = compiled.form(model.stiffness(u, v))
        self.glue = _glue(model)
        self.owned = model.V.dofmap.index_map.size_local * model.d
        self.support_stiffness = 1.0
        self._owners = 0

    @contextmanager
    def in_memory(self) -> Iterator[None]:
        """Own the factor or hierarchy inside the `with`, free it on exit; collective.

        What the contact solve has left in memory is used. Blocks may be nested: the
        outermost one is the owner.
        """
        self._owners += 1
        try:
            yield
        finally:
            self._owners -= 1
            if self._owners == 0:
                self.free()

    def free(self) -> None:
        """Free the factor or hierarchy; a later solve makes it again."""

    def make(self) -> None:
        """Make the factor or hierarchy, if there is none; collective."""

    def of_model(self, model: Model) -> Self:
        """Return the equations of a model with other loads and values; collective.

        They solve with the factor or hierarchy of these ones, which stays theirs: it
        must be in memory as long as those of the model solve.

        Args:
            model: A model on the same mesh, of the same bodies, contacts and springs.
                The same components are fixed.
        """
        self.make()
        others = copy(self)
        others.model = model
        for name in list(vars(self)):
            # Loads, values of supports and motions of faces are those of the model.
            if isinstance(getattr(type(self), name, None), cached_property):
                del others.__dict__[name]
        # Not being the outermost owner, they never free what belongs to these ones.
        others._owners = 1
        return others

    def load_vector(self) -> fem.Function:
        """Return the nodal forces of loads and given strains [force].

        They are not yet summed over ranks.
        """
        return self._loads.copy()

    @cached_property
    def _loads(self) -> fem.Function:
        """Assemble the nodal forces of loads and given strains [force]."""
        b = self.model.function()
        loads = self.model.right_side(ufl.TestFunction(self.model.V))
        if loads is not None:
            fem.assemble_vector(b.x.array, compiled.form(loads))
        if self.model.face_forces is not None:
            b.x.array[:] += self.model.face_forces.x.array
        return b

    def stiffness(self) -> PETSc.Mat:
        """Assemble K [force/length].

        Where supports fix a component its row and column have the diagonal entry alone.
        """
        model = self.model
        blocks = self.stiffness_of_bodies()
        of_bodies = as_entries(blocks)
        blocks.destroy()
        if model.coordinates.is_identity:
            return of_bodies
        matrix = of_bodies.ptap(model.coordinates.matrix)
        of_bodies.destroy()
        first, _ = matrix.getOwnershipRange()
        fixed = first + np.flatnonzero(self.fixed)
        matrix.zeroRowsColumns(fixed.astype(PETSc.IntType), diag=self.support_stiffness)
        return matrix

    def stiffness_of_bodies(self) -> PETSc.Mat:
        """Assemble the stiffness of displacements in blocks [force/length].

        It is K where they are the unknowns, else it has no supports.
        """
        if self.model.coordinates.is_identity:
            return assembled(self.form, self.model.bcs, self.support_stiffness)
        return assembled(self.form, [], 0.0)

    @property
    def fixed(self) -> np.ndarray:
        """Tell which degrees of freedom of this rank supports fix, shape (owned,)."""
        return self.model.coordinates.fixed.ravel()[: self.owned]

    def free_components(self) -> int:
        """Count the unknowns of all ranks that no support fixes; collective."""
        free = int(np.count_nonzero(~self.fixed))
        return self.model.comm.allreduce(free)

    def right_side(self, b: fem.Function, *, supports: bool) -> PETSc.Vec:
        """Return the right side for nodal forces, summed over ranks [force].

        It is that of x.

        Args:
            b: Nodal forces [force], whose ghost contributions are added up here.
            supports: Whether fixed components take the values of the supports, else
                zero.
        """
        model = self.model
        coordinates = model.coordinates
        vector = fp.create_vector(model.V)
        with vector.localForm() as local:
            local.array[:] = b.x.array
        if supports:
            fp.apply_lifting(vector, [self.form], bcs=[self._prescribed_conditions])
        vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        coordinates.forces(vector)
        fixed = np.flatnonzero(self.fixed)
        vector.array[fixed] = 0.0
        if supports:
            prescribed = coordinates.prescribed.x.array[fixed]
            vector.array[fixed] = self.support_stiffness * prescribed
        return vector

    @cached_property
    def _prescribed_conditions(self) -> list[Any]:
        """Return the Dirichlet conditions that supports alone would set.

        Where a support fixes one side of a contact between bodies and the jump is zero,
        the other side moves with it.
        """
        model = self.model
        if model.coordinates.is_identity:
            return model.bcs
        u = model.coordinates.to_u(model.coordinates.prescribed)
        dofs = np.flatnonzero(u.x.array).astype(np.int32)
        return [fem.dirichletbc(u, [dofs, dofs], model.V)]

    def vector(self, values: fem.Function) -> PETSc.Vec:
        """Return values of the unknowns of this rank as a vector."""
        vector = fp.create_vector(self.model.V)
        vector.array[:] = values.x.array[: self.owned]
        return vector

    def displacement(self, x: PETSc.Vec) -> fem.Function:
        """Return the displacement of unknowns x as a Function."""
        return self.model.coordinates.to_u(self.unknowns(x))

    def unknowns(self, x: PETSc.Vec) -> fem.Function:
        """Return a vector of values of the unknowns as a Function."""
        values = self.model.function()
        values.x.array[: self.owned] = x.array_r
        values.x.scatter_forward()
        return values

    def add_glue(self, matrix: PETSc.Mat) -> None:
        """Add D to the diagonal of a matrix, in place."""
        add_diagonal(matrix, self.glue.x.array[: self.owned])


class AssembledElastic(Elastic):
    """Represent elastic equations that keep K, once they have assembled it.

    Args:
        model: The scene on a mesh.
    """

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self._matrix: PETSc.Mat | None = None
        self._operator: PETSc.Mat | None = None

    @property
    def matrix(self) -> PETSc.Mat:
        """Return K, see :meth:`Elastic.stiffness`; the first call assembles it."""
        if self._matrix is None:
            self._assemble()
        return self._matrix

    @property
    def operator(self) -> PETSc.Mat:
        """Return K as it is multiplied, at degree 2 in dense blocks of nodes."""
        if self._operator is None:
            self._assemble()
        return self._operator

    def free_stiffness(self) -> None:
        """Free K; it is assembled again when it is asked for."""
        for matrix in (self._matrix, self._operator):
            if matrix is not None:
                matrix.destroy()
        self._matrix = self._operator = None

    def _assemble(self) -> None:
        """Assemble K in both forms."""
        if self.model.degree == 1:
            self._matrix = self._operator = self.stiffness()
        elif self.model.coordinates.is_identity:
            self._operator = self.stiffness_of_bodies()
            self._matrix = as_entries(self._operator)
        else:
            self._matrix = self.stiffness()
            self._operator = as_blocks(self._matrix, self.model.d)


def _glue(model: Model) -> fem.Function:
    """Sum up D of x [force/length]."""
    coordinates = model.coordinates
    between = [contact for contact in model.contacts if contact.trace.there is not None]
    on_foundations = [contact for contact in model.contacts if contact.trace.there is None]
    glue = _summed_glue(model, on_foundations)
    if between:
        # A foundation resists both the jump and the displacement of the other side.
        coordinates.add_to_partners(glue)
        glue.x.array[:] += _summed_glue(model, between).x.array
    glue.x.array[coordinates.fixed.ravel()] = 0.0
    return glue


def _summed_glue(model: Model, contacts: Sequence[BoundContact]) -> fem.Function:
    """Sum the glue of some contacts at the nodes of this side [force/length]."""
    glue = model.function()
    of_nodes = glue.x.array.reshape(-1, model.d)
    for contact in contacts:
        side = contact.trace.here
        cells = model.cell_corners()[side.facets[:, 0]]
        height = model.d * measures(cells) / side.areas
        per_area = GLUE_FACTOR * model.degree**2 * side.modulus / height
        # The nodes of a facet have equal shares of it.
        share = per_area * side.owned_areas / side.nodes.shape[1]
        np.add.at(of_nodes, side.nodes, share[:, None, None])
    glue.x.scatter_reverse(la.InsertMode.add)
    glue.x.scatter_forward()
    return glue
