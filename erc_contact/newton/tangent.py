"""The tangent of the contact problem for all degrees of freedom, with preconditioner.

The tangent is ``K + e_u``; with a multiplier it is ``S K + e_u C + e_lambda lambda'
K``, with the symbols of :mod:`erc_contact.newton.full`. It is applied, not assembled:
only the terms of the contact are assembled anew.

The preconditioner is a cycle of the multigrid hierarchy of ``K + e_u``. With a
multiplier the hierarchy is that of K with springs (:mod:`erc_contact.newton.springs`).
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fp
from petsc4py import PETSc

from erc_contact.base.sparse import matrix_of
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear.krylov import set_up
from erc_contact.newton.linear.motion_springs import MotionSprings
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.linear.shells import shell
from erc_contact.newton.moved_forces import moved_forces
from erc_contact.newton.reactions import Reactions
from erc_contact.newton.singular_values import least_singular_value
from erc_contact.newton.springs import Springs


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
        moved: What is added to assembled forces, see :func:`.moved_forces`.
        held: Springs on motions that no support holds; None without.
    """

    def __init__(
        self,
        forms: ContactForms,
        elastic: Multigrid,
        reactions: Reactions | None,
        length: float,
        force: float,
    ) -> None:
        self.model = forms.model
        self.forms = forms
        self.elastic = elastic
        self.length = length
        self.force = force
        self._reactions = reactions
        self.held: MotionSprings | None = None
        self._springs: Springs | None = None
        self._is_identity = self.model.coordinates.is_identity
        self.moved = moved_forces(forms)
        self._of_fields = {} if reactions is not None else self._maps_of_fields()
        self._moved_of_terms: list[PETSc.Mat] = []
        """For each term what its equations leave to other unknowns; () without."""
        if reactions is not None and forms.jump_sums.any:
            self._moved_of_terms = self._moves_of_terms()
        self._fixed: np.ndarray | None = None
        """Rows and columns that are zero, or None."""

        if self._is_identity and reactions is None:
            # DOLFINx would set their diagonal, which has no place off the contact.
            first, _ = elastic.matrix.getOwnershipRange()
            rows = first + np.flatnonzero(elastic.fixed)
            self._fixed = rows.astype(PETSc.IntType)
        if reactions is not None:
            # The rows of the multiplier's equations stay: they are not equilibrium.
            glue = elastic.glue.x.array
            contacts = self._contacts_of_terms()
            self._springs = Springs(self.model, elastic.matrix, glue, reactions, contacts)
        self._terms = [matrix_of(tangents) for tangents in forms.tangents]
        for term in self._terms:
            term.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self._change: PETSc.Mat | None = None
        self._work = [elastic.matrix.createVecRight() for _ in range(2)]
        self.matrix = shell(self.mult, self._work[0])

    def assemble(self) -> None:
        """Assemble the terms of the contact."""
        self._assemble_terms(self.forms.all_jumps)
        if self._springs is not None:
            count = len(self.forms.displacements)
            self._springs.update(self._terms[:count], self._terms[count:])
            self._change = self._springs.matrix
        elif self._is_identity:
            self._change = self._terms[0]
        else:
            if self._change is not None:
                self._change.destroy()
            self._change = self._change_of_unknowns()

    def _assemble_terms(self, tested: tuple[float, ...]) -> None:
        """Assemble the derivatives of the equations, for factors of tested jumps."""
        self.forms.test(tested)
        for term, tangents in zip(self._terms, self.forms.tangents, strict=True):
            term.zeroEntries()
            for tangent in tangents:
                fp.assemble_matrix(term, tangent)
            term.assemble()
            if self._fixed is not None:
                term.zeroRowsColumns(self._fixed, diag=0.0)

    def _change_of_unknowns(self) -> PETSc.Mat:
        """Return the terms of the contact as a matrix for the unknowns, a new one.

        The unknowns are jumps at contacts between bodies, and tested jumps are those of
        one unknown alone.
        """
        change = self._by_unknowns()
        for tested, on_others in self.moved:
            self._assemble_terms(tested)
            of_tested = self._by_unknowns()
            moved = on_others.matMult(of_tested)
            change.axpy(1.0, moved, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
            of_tested.destroy()
            moved.destroy()
        change.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        first, _ = change.getOwnershipRange()
        fixed = first + np.flatnonzero(self.elastic.fixed)
        change.zeroRowsColumns(fixed.astype(PETSc.IntType), diag=0.0)
        return change

    def _by_unknowns(self) -> PETSc.Mat:
        """Return the derivative of the equations by the unknowns, a new matrix."""
        total: PETSc.Mat | None = None
        for field, term in zip(self.forms.displacements, self._terms, strict=True):
            by_unknowns = self._of_fields[field]
            # Jumps are unknowns themselves, at the nodes of this side.
            part = term.copy() if by_unknowns is None else term.matMult(by_unknowns)
            if total is None:
                total = part
            else:
                total.axpy(1.0, part, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
                part.destroy()
        assert total is not None
        return total

    def _maps_of_fields(self) -> dict[fem.Function, PETSc.Mat | None]:
        """Return the maps from unknowns to the fields of the forms, None for I."""
        model = self.model
        maps: dict[fem.Function, PETSc.Mat | None] = {self.forms.u: None}
        if not self._is_identity:
            maps[self.forms.u] = model.coordinates.matrix
        for jump, contact in self.forms.jumps.items():
            maps[jump] = None
            if self.forms.jump_sums.any:
                maps[jump] = self.forms.jump_sums.matrix(self.forms.jump_sums.of(contact), 1.0)
        return maps

    def _contacts_of_terms(self) -> list[list[int]]:
        """Return the numbers of the contacts of each term; u has all foundations."""
        contacts = self.model.contacts
        foundations = [k for k, contact in enumerate(contacts) if contact.trace.there is None]
        numbers = []
        for field in self.forms.displacements:
            if field in self.forms.jumps:
                numbers.append([contacts.index(self.forms.jumps[field])])
            else:
                numbers.append(foundations)
        return [*numbers, *([k] for k in range(len(contacts)))]

    def _moves_of_terms(self) -> list[PETSc.Mat]:
        """Return ``D^T`` of the contact that each term belongs to, with a multiplier.

        That of u belongs to all foundations.
        """
        forms = self.forms
        sums = forms.jump_sums
        parts = []
        for field in forms.displacements:
            on_foundations = field not in forms.jumps
            part = sums.of_foundations() if on_foundations else sums.of(forms.jumps[field])
            parts.append(part)
        for contact in self.model.contacts:
            parts.append(sums.of(contact))
        return [sums.matrix(part, 0.0).transpose() for part in parts]

    def mult(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the scaled tangent times x."""
        self.elastic.times(x, y)
        if self.held is not None:
            self.held.add_tangent(x, y)
        if self._reactions is None:
            assert self._change is not None
            self._change.multAdd(x, y, y)
        else:
            self._mult_equations(self._reactions, x, y)
        y.scale(self.length / self.force)

    def hold(self, weight: float, x: PETSc.Vec) -> None:
        """Hold the motions that no support holds where they are at x.

        Args:
            weight: Weight of the springs [-]; 0 for none.
            x: The unknowns whose motions the springs keep.
        """
        if self.held is not None:
            self.held.free()
        self.held = None
        if weight > 0.0:
            self.held = MotionSprings(self.model, self.elastic.matrix, weight, x)

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
        assert self._change is not None
        self.elastic.renew(self._change)

    def least_singular_value(self, u: PETSc.Vec) -> float:
        """Estimate the least singular value [-], see :mod:`.singular_values`."""
        return least_singular_value(
            self.mult,
            self.precondition,
            u,
            stiffness=self.elastic.matrix,
            fixed=self.elastic.fixed,
            scale=self.force / self.length,
        )

    def free(self) -> None:
        """Free PETSc's objects; the matrix and this object know each other."""
        if self._change is not None and self._springs is None:
            self._change.destroy()
        for petsc_object in (*self._terms, *self._work, self.matrix):
            petsc_object.destroy()
        if self._springs is not None:
            self._springs.free()
        for _, matrix in self.moved:
            matrix.destroy()
        for matrix in self._moved_of_terms:
            matrix.destroy()

    def _mult_equations(self, reactions: Reactions, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Replace the rows of A in ``y = K x`` by those of the equations."""
        forms = self.forms
        owned = self.elastic.owned
        of_fields = forms.read(self.elastic.displacement(x))

        field, product = self._work
        total = np.zeros(owned)
        count = len(forms.displacements)
        for number, values in enumerate(of_fields):
            field.array[:] = values[:owned]
            total += self._product(number, field, product)
        # The multipliers are linear in the reactions K x.
        for number, matrix in enumerate(reactions.matrices, count):
            matrix.mult(y, field)
            total += self._product(number, field, product)
        rows = reactions.free.ravel()
        y.array[rows] = total[rows]

    def _product(self, number: int, field: PETSc.Vec, product: PETSc.Vec) -> np.ndarray:
        """Return a term times a field, as equations of the unknowns.

        Args:
            number: Number of the term.
            field: The field; it is overwritten.
            product: Work space.
        """
        self._terms[number].mult(field, product)
        if not self._moved_of_terms:
            return product.array_r
        self._moved_of_terms[number].mult(product, field)
        return product.array_r + field.array_r
