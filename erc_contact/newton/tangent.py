"""The tangent of the contact problem for all degrees of freedom, with preconditioner.

The tangent is ``K + e_u``; with a multiplier it is ``S K + e_u C + e_lambda lambda'
K``, with the symbols of :mod:`erc_contact.newton.full`. It is applied, not assembled:
only the terms of the contact are assembled anew.

The preconditioner is a cycle of the multigrid hierarchy of ``K + e_u``. With a
multiplier the hierarchy is that of K with springs (:mod:`erc_contact.newton.springs`).
"""

from __future__ import annotations

import numpy as np
from dolfinx.fem import petsc as fp
from petsc4py import PETSc

from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear.krylov import fgmres, set_up, shell
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.reactions import Reactions
from erc_contact.newton.springs import Springs

REGULARITY_TOLERANCE = 1e-4
"""Tolerance of the linear solve that shows whether the tangent has an inverse [-]."""
NO_INVERSE = 1e-9
"""Least singular value that counts as none [-].

Beside the branch of demos/many_solutions.py the value is 1e-4 to 1e-1, on it 1e-15 to
1e-10.
"""


class Tangent:
    """Apply the tangent at the state that the forms read; members are collective.

    It is scaled by ``length/force``.

    Args:
        forms: The equations of the method.
        elastic: The elastic equations.
        reactions: The map from reactions to multipliers; None for a method without
            multiplier.
        length: Size of the displacements [length].
        force: Size of the contact forces [force].

    Attributes:
        matrix: The tangent, as PETSc wants a matrix.
    """

    def __init__(
        self,
        forms: ContactForms,
        elastic: Multigrid,
        reactions: Reactions | None,
        length: float,
        force: float,
    ) -> None:
        self.model = elastic.model
        self.forms = forms
        self.elastic = elastic
        self.length = length
        self.force = force
        self._reactions = reactions
        self._springs: Springs | None = None
        self._bcs = self.model.bcs
        if reactions is not None:
            glue = elastic.glue.x.array
            self._springs = Springs(self.model, elastic.matrix, glue, reactions)
            # The rows of the multiplier's equations stay: they are not equilibrium.
            self._bcs = []
        self._terms = [fp.create_matrix(form) for form in forms.tangents]
        self._work = [elastic.matrix.createVecRight() for _ in range(2)]
        self.matrix = shell(self.mult, self._work[0])

    def assemble(self) -> None:
        """Assemble the terms of the contact."""
        for term, form in zip(self._terms, self.forms.tangents, strict=True):
            term.zeroEntries()
            fp.assemble_matrix(term, form, bcs=self._bcs, diag=0.0)
            term.assemble()
        if self._springs is not None:
            self._springs.update(self._terms)

    def mult(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the scaled tangent times x."""
        self.elastic.matrix.mult(x, y)
        if self._reactions is None:
            self._terms[0].multAdd(x, y, y)
        else:
            self._mult_equations(self._reactions, x, y)
        y.scale(self.length / self.force)

    def precondition(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to about the inverse of the scaled tangent times x."""
        if self._springs is None:
            self.elastic.cycle(x, y)
        else:
            right = self._work[0]
            right.array[:] = self._springs.right_side(x.array_r)
            self.elastic.cycle(right, y)
        y.scale(self.force / self.length)

    def prepare(self, ksp: PETSc.KSP) -> None:
        """Set a linear solver to FGMRES with the preconditioner."""
        set_up(ksp, self.precondition)

    def renew(self) -> None:
        """Set the hierarchy to that of the tangent."""
        change = self._terms[0] if self._springs is None else self._springs.matrix
        self.elastic.renew(change)

    def least_singular_value(self, u: PETSc.Vec) -> float:
        """Estimate the least singular value of the tangent [-]; zero if singular.

        The elastic diagonal scales it. It is the ratio of a force without structure to
        the displacement that this causes, as far as FGMRES solves for it. Without an
        inverse FGMRES does not converge, and the displacement grows to the inverse of
        round-off; where multigrid is only slow it does not.

        Args:
            u: A displacement that may be near [-], e.g. that of another tangent; it
                becomes the one of this tangent.
        """
        diagonal = self.elastic.matrix.getDiagonal()
        force = u.duplicate()
        fixed = self.model.fixed.ravel()[: self.elastic.owned]
        diagonal.sqrtabs()
        # A force without structure that does not depend on the number of ranks.
        force.array[:] = np.sin(1.0 + np.arange(*force.getOwnershipRange()) ** 2)
        force.array[fixed] = 0.0
        size = force.norm()
        force.pointwiseMult(force, diagonal)
        fgmres(self.mult, self.precondition, force, u, REGULARITY_TOLERANCE)
        diagonal.pointwiseMult(diagonal, u)
        diagonal.array[fixed] = 0.0
        length = diagonal.norm()
        diagonal.destroy()
        force.destroy()
        value = 1.0
        if length > 0:
            value = size / length * self.force / self.length
        return float(value) if value > NO_INVERSE else 0.0

    def free(self) -> None:
        """Free PETSc's objects; the matrix and this object know each other."""
        for petsc_object in (*self._terms, *self._work, self.matrix):
            petsc_object.destroy()
        if self._springs is not None:
            self._springs.free()

    def _mult_equations(self, reactions: Reactions, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Replace the rows of A in ``y = K x`` by those of the equations."""
        owned = self.elastic.owned
        u = self.model.function()
        u.x.array[:owned] = x.array_r
        u.x.scatter_forward()
        nodal = u.x.array.reshape(-1, self.model.d)
        self.model.to_coefficients(nodal, self.model.contacts)

        field, product = self._work
        by_u, *by_multipliers = self._terms
        field.array[:] = u.x.array[:owned]
        by_u.mult(field, product)
        total = product.array_r.copy()
        # The multipliers are linear in the reactions K x.
        for term, matrix in zip(by_multipliers, reactions.matrices, strict=True):
            matrix.mult(y, field)
            term.mult(field, product)
            total += product.array_r
        rows = reactions.free.ravel()
        y.array[rows] = total[rows]
