"""The elastic equations of a model: what every way to solve them begins with.

Symbols: K elastic stiffness with the supports [force/length]; D springs that glue the
contact nodes to the foundations, and bodies to each other
(:mod:`erc_contact.newton.linear.glue`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from functools import cached_property
from typing import Self

import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fp
from petsc4py import PETSc

from erc_contact.base.runtime import compiled
from erc_contact.base.sparse import as_entries, assembled
from erc_contact.model.model import Model
from erc_contact.newton.linear.changed import DIFFERENT, SUBSET
from erc_contact.newton.linear.glue import Glue


class ElasticEquations:
    """Represent the elastic equations of a model with its supports.

    Args:
        model: The scene on a mesh.

    Attributes:
        form: The compiled form of K.
        glue: D; without contact it has no entries.
        owned: Number of degrees of freedom of this rank.
        support_stiffness: Entry on the diagonal of K where a support fixes a component
            [force/length]. A factor does not mind its size.
    """

    def __init__(self, model: Model) -> None:
        space = model.space
        self.model = model
        u = ufl.TrialFunction(space.V)
        v = ufl.TestFunction(space.V)
        self.form = compiled.form(model.stiffness(u, v))
        self.glue = Glue(space, model.contacts, model.fixed)
        self.owned = space.V.dofmap.index_map.size_local * space.d
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

        They solve with the factor or hierarchy of these equations, which stays theirs:
        it must be in memory as long as the equations of the model solve.

        Args:
            model: A model on the same mesh, of the same bodies, contacts and springs.
                The same components are fixed.
        """
        self.make()
        others = copy(self)
        others.model = model
        for name in list(vars(self)):
            # Loads, values of supports and motions of faces follow from the model.
            if isinstance(getattr(type(self), name, None), cached_property):
                del others.__dict__[name]
        # Not being the outermost owner, they never free what belongs to these ones.
        others._owners = 1
        return others

    def hand_to(self, model: Model) -> Self:
        """Return the equations of a model that own the factor or hierarchy of these.

        Nobody may solve with these equations any more; see :meth:`of_model`.
        """
        others = self.of_model(model)
        others._owners = 0
        return others

    def load_vector(self) -> fem.Function:
        """Return the nodal forces of loads and given strains [force].

        They are not yet summed over ranks.
        """
        return self._loads.copy()

    @cached_property
    def _loads(self) -> fem.Function:
        """Assemble the nodal forces of loads and given strains [force]."""
        return self.model.load_forces(strains=True)

    def stiffness(self) -> PETSc.Mat:
        """Assemble K [force/length].

        Where supports fix a component its row and column have the diagonal entry alone.
        """
        return as_entries(self.stiffness_in_blocks(), self.model.space.mesh.comm)

    def stiffness_in_blocks(self) -> la.MatrixCSR:
        """Assemble K in blocks of nodes [force/length]."""
        return assembled(self.form, self.model.bcs, self.support_stiffness)

    @property
    def fixed(self) -> np.ndarray:
        """Tell which degrees of freedom of this rank supports fix, shape (owned,)."""
        return self.model.fixed.ravel()[: self.owned]

    def free_components(self) -> int:
        """Count the unknowns of all ranks that no support fixes; collective."""
        free = int(np.count_nonzero(~self.fixed))
        return self.model.space.comm.allreduce(free)

    def right_side(self, b: fem.Function, *, supports: bool, glued: bool = False) -> PETSc.Vec:
        """Return the right side for nodal forces, summed over ranks [force].

        Args:
            b: Nodal forces [force], whose ghost contributions are added up here.
            supports: Whether fixed components take the values of the supports, else
                zero.
            glued: Whether it is the right side of K + D: a body is also glued to nodes
                of other bodies that supports move.
        """
        model = self.model
        vector = fp.create_vector(model.space.V)
        with vector.localForm() as local:
            local.array[:] = b.x.array
        # Supports at rest, as most are, lift nothing.
        if supports and model.prescribed.x.array.any():
            fp.apply_lifting(vector, [self.form], bcs=[model.bcs])
        vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        if supports and glued and model.connections.any:
            vector.array[:] -= self.glue.times(model.prescribed).x.array[: self.owned]
        fixed = np.flatnonzero(self.fixed)
        vector.array[fixed] = 0.0
        if supports:
            prescribed = model.prescribed.x.array[fixed]
            vector.array[fixed] = self.support_stiffness * prescribed
        return vector

    def vector(self, values: fem.Function) -> PETSc.Vec:
        """Return the nodal values of a Function as a vector."""
        vector = fp.create_vector(self.model.space.V)
        vector.array[:] = values.x.array[: self.owned]
        return vector

    def function(self, x: PETSc.Vec) -> fem.Function:
        """Return a vector of nodal values as a Function."""
        values = self.model.space.function()
        values.x.array[: self.owned] = x.array_r
        values.x.scatter_forward()
        return values

    def add_glue(self, matrix: PETSc.Mat) -> None:
        """Add D to a matrix, in place."""
        glue = self.glue.matrix()
        # Bodies have no entries in common yet.
        is_between = self.model.connections.any
        matrix.axpy(1.0, glue, DIFFERENT if is_between else SUBSET)
        glue.destroy()
