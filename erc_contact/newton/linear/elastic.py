"""The elastic equations of a model: what every way to solve them begins with.

Symbols: K elastic stiffness with the supports [force/length]; D diagonal stiffness that
glues the contact nodes to the foundations, ``D_i = 10 E k^2/h |F|/m`` summed over
facets.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fp
from petsc4py import PETSc

from erc_contact.base.runtime import compiled
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
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        u = ufl.TrialFunction(model.V)
        v = ufl.TestFunction(model.V)
        self.form = compiled.form(model.stiffness(u, v))
        self.glue = _glue(model)
        self.owned = model.V.dofmap.index_map.size_local * model.d
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

    def load_vector(self) -> fem.Function:
        """Return the nodal forces of the loads [force], not yet summed over ranks."""
        return self._loads.copy()

    @cached_property
    def _loads(self) -> fem.Function:
        """Assemble the nodal forces of the loads [force]."""
        b = self.model.function()
        loads = self.model.loads(ufl.TestFunction(self.model.V))
        if loads is not None:
            fem.assemble_vector(b.x.array, compiled.form(loads))
        return b

    def stiffness(self) -> PETSc.Mat:
        """Assemble K [force/length].

        Where supports fix a component it has the row and column of the identity.
        """
        matrix = fp.assemble_matrix(self.form, bcs=self.model.bcs)
        matrix.assemble()
        return matrix

    def right_side(self, b: fem.Function, *, supports: bool) -> PETSc.Vec:
        """Return the right side for nodal forces, summed over ranks [force].

        Args:
            b: Nodal forces [force], whose ghost contributions are added up here.
            supports: Whether fixed components take the values of the supports, else
                zero.
        """
        model = self.model
        vector = fp.create_vector(model.V)
        with vector.localForm() as local:
            local.array[:] = b.x.array
        if supports:
            fp.apply_lifting(vector, [self.form], bcs=[model.bcs])
        vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        fixed = np.flatnonzero(model.fixed.ravel()[: self.owned])
        vector.array[fixed] = model.prescribed.x.array[fixed] if supports else 0.0
        return vector

    def displacement(self, x: PETSc.Vec) -> fem.Function:
        """Return a vector of nodal values as a Function."""
        u = self.model.function()
        u.x.array[: self.owned] = x.array_r
        u.x.scatter_forward()
        return u

    def add_glue(self, matrix: PETSc.Mat) -> None:
        """Add D to the diagonal of a matrix, in place."""
        add_diagonal(matrix, self.glue.x.array[: self.owned])


def add_diagonal(matrix: PETSc.Mat, values: np.ndarray) -> None:
    """Add values to the diagonal of a matrix, in place.

    Args:
        matrix: The matrix; its pattern has the diagonal.
        values: Those of the rows of this rank.
    """
    diagonal = matrix.createVecRight()
    diagonal.array[:] = values
    matrix.setDiagonal(diagonal, addv=PETSc.InsertMode.ADD)
    diagonal.destroy()


def _glue(model: Model) -> fem.Function:
    """Assemble D [force/length]."""
    glue = model.function()
    if not model.contacts:
        return glue
    ones = ufl.as_vector([1.0] * model.d)
    v = ufl.TestFunction(model.V)
    gamma = model.stiffness_per_area(compiled.constant(model.mesh, GLUE_FACTOR), model.cell_modulus)
    terms = []
    for contact in model.contacts:
        terms.append(gamma * ufl.inner(ones, v) * contact.ds(metadata=model.nodal_rule))
    fem.assemble_vector(glue.x.array, compiled.form(sum(terms[1:], start=terms[0])))
    glue.x.scatter_reverse(la.InsertMode.add)
    glue.x.scatter_forward()
    glue.x.array[model.fixed.ravel()] = 0.0
    return glue
