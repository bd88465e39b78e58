"""The tangent of the contact problem for all degrees of freedom, with preconditioner.

The tangent is ``K + B^T e_w B``; with a multiplier it is ``(I - P) K + B^T (e_w B +
e_lambda lambda' K)``, with the symbols of :mod:`erc_contact.newton.full`. It is
applied, not assembled: only the terms of the contact are assembled anew.

The preconditioner is a cycle of the multigrid hierarchy of ``K + B^T e_w B``. With a
multiplier the hierarchy is made of K with springs (:mod:`erc_contact.newton.springs`).

Other springs may hold rigid motions that no support holds. With q an orthonormal free
motion and D the diagonal of K, springs of weight w that keep the motions of a
displacement v add ``w k q q^T (x - v)`` to the forces K x. The stiffness is ``k =
1/(q^T D^-1 q)``, a mean in which the softest body counts: springs as stiff as a body
stiffer by orders would not let a soft one move.
"""

from __future__ import annotations

import numpy as np
from dolfinx.fem import petsc as fp
from petsc4py import PETSc

from erc_contact.base.sparse import matrix_of, summed
from erc_contact.model.model import Model
from erc_contact.newton.forms import ContactForms, Reader
from erc_contact.newton.linear.hierarchy import free_motions
from erc_contact.newton.linear.krylov import fgmres, shell
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.node_sum import NodeSum
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
        self._sum = NodeSum(forms) if reactions is None else None
        self._terms: list[_Terms] = []
        self._springs: list[Springs] = []
        if reactions is not None:
            for reader in forms.readers:
                self._terms.append(_Terms(forms, reader))
                self._springs.append(Springs(self.model, reader, reactions, elastic.matrix))
        # DOLFINx would set their diagonal, which has no place off the contact.
        first, _ = elastic.matrix.getOwnershipRange()
        self._fixed = (first + np.flatnonzero(elastic.fixed)).astype(PETSc.IntType)
        self._change: PETSc.Mat | None = None
        self._work = [elastic.matrix.createVecRight() for _ in range(3)]
        self.matrix = shell(self.mult, self._work[0])

    def assemble(self) -> None:
        """Assemble the terms of the contact."""
        if self._sum is not None:
            self._sum.assemble()
            self._change = self._sum.matrix
        else:
            for terms, springs in zip(self._terms, self._springs, strict=True):
                terms.assemble()
                springs.update(terms.by_displacements, terms.by_multipliers)
            self._change = summed([springs.by_nodes() for springs in self._springs], self._change)
        self._change.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self._change.zeroRowsColumns(self._fixed, diag=0.0)

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
        if self._reactions is None:
            self.elastic.cycle(x, y)
        else:
            right = self._work[2]
            self.model.connections.let_go(x, right, self._reactions.is_read)
            for springs in self._springs:
                springs.add_forces(x, right)
            self.elastic.cycle(right, y)
        y.scale(self.force / self.length)

    def renew(self) -> None:
        """Renew the hierarchy for the tangent."""
        assert self._change is not None
        self.elastic.renew(self._change)

    def least_singular_value(self, u: PETSc.Vec) -> float:
        """Estimate the least singular value [-]; zero if singular; collective.

        The elastic diagonal scales it. It is the ratio of a force without structure to
        the displacement that this causes, as far as FGMRES solves for it. Without an
        inverse FGMRES does not converge, and the displacement grows to the inverse of
        round-off; where multigrid is only slow it does not.

        Args:
            u: A displacement that may be near [-], e.g. from another tangent; it
                becomes the displacement of this tangent.
        """
        fixed = self.elastic.fixed
        diagonal = self.elastic.matrix.getDiagonal()
        force = u.duplicate()
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
            value = size / length * (self.force / self.length)
        return float(value) if value > NO_INVERSE else 0.0

    def free(self) -> None:
        """Free PETSc's objects; the matrix and this object know each other."""
        for petsc_object in (*self._work, self.matrix):
            petsc_object.destroy()
        if self._change is not None:
            self._change.destroy()
        if self._sum is not None:
            self._sum.free()
        for terms in self._terms:
            terms.free()
        for springs in self._springs:
            springs.free()

    def _mult_equations(self, reactions: Reactions, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Replace in ``y = K x`` what changes jumps by the equations."""
        forms = self.forms
        owned = self.elastic.owned
        field, product, changed = self._work
        fields = forms.read(self.elastic.function(x))
        # The multipliers are linear in the reactions K x.
        for matrix in reactions.matrices:
            matrix.mult(y, field)
            fields.append(field.array_r.copy())
        self.model.connections.let_go(y, changed, reactions.is_read)
        for terms in self._terms:
            total = np.zeros(owned)
            for number, term in terms.by_fields.items():
                field.array[:] = fields[number][:owned]
                term.mult(field, product)
                total += product.array_r
            product.array[:] = total
            terms.add_to_nodes(product, changed)
        changed.array[self.elastic.fixed] = y.array_r[self.elastic.fixed]
        changed.copy(y)


class _Terms:
    """Hold the derivatives of the equations of one reader; members are collective.

    Args:
        forms: The equations of the method.
        reader: The reader.

    Attributes:
        by_fields: Number of each field in these equations -> the derivative by it.
    """

    def __init__(self, forms: ContactForms, reader: Reader) -> None:
        self._forms = forms
        self._reader = reader
        self._connections = forms.model.connections
        self.by_fields: dict[int, PETSc.Mat] = {}
        for number, tangents in enumerate(reader.tangents):
            if tangents:
                self.by_fields[number] = matrix_of(tangents)

    @property
    def by_displacements(self) -> list[PETSc.Mat]:
        """Return the derivatives by u and by jumps."""
        count = len(self._forms.displacements)
        return [term for number, term in self.by_fields.items() if number < count]

    @property
    def by_multipliers(self) -> list[PETSc.Mat]:
        """Return the derivatives by the multipliers."""
        count = len(self._forms.displacements)
        return [term for number, term in self.by_fields.items() if number >= count]

    def assemble(self) -> None:
        """Assemble the derivatives at the fields of the forms."""
        for number, term in self.by_fields.items():
            term.zeroEntries()
            for tangent in self._reader.tangents[number]:
                fp.assemble_matrix(term, tangent)
            term.assemble()

    def add_to_nodes(self, forces: PETSc.Vec, nodal: PETSc.Vec) -> None:
        """Add forces on what is read to nodal forces, in place."""
        if self._reader.contact is None:
            nodal.axpy(1.0, forces)
        else:
            jump = self._connections.jump(self._reader.contact)
            jump.multTransposeAdd(forces, nodal, nodal)

    def free(self) -> None:
        """Free PETSc's objects."""
        for term in self.by_fields.values():
            term.destroy()


class MotionSprings:
    """Keep the free motions of a displacement by springs; members are collective.

    Args:
        model: The scene on a mesh; supports leave a body rigid motions.
        matrix: K [force/length].
        weight: Weight of the springs [-].
        x: The unknowns whose motions they keep, in any scale.
    """

    def __init__(self, model: Model, matrix: PETSc.Mat, weight: float, x: PETSc.Vec) -> None:
        self._space = free_motions(model, matrix)
        self._motions = self._space.getVecs()
        diagonal = matrix.getDiagonal()
        softness = matrix.createVecRight()
        self._stiffness = []
        for motion in self._motions:
            softness.pointwiseDivide(motion, diagonal)
            self._stiffness.append(weight / motion.dot(softness))
        softness.destroy()
        diagonal.destroy()
        self._kept = [motion.dot(x) for motion in self._motions]

    def add_tangent(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the forces of the springs for a change x to y, in place."""
        amounts = [motion.dot(x) for motion in self._motions]
        self._add(amounts, y)

    def add_forces(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the forces of the springs at x to y, in place."""
        amounts = []
        for motion, kept in zip(self._motions, self._kept, strict=True):
            amounts.append(motion.dot(x) - kept)
        self._add(amounts, y)

    def free(self) -> None:
        """Free PETSc's objects."""
        for motion in self._motions:
            motion.destroy()
        self._space.destroy()

    def _add(self, amounts: list[float], y: PETSc.Vec) -> None:
        """Add the forces of springs that are stretched by amounts, in place."""
        for motion, stiffness, amount in zip(self._motions, self._stiffness, amounts, strict=True):
            y.axpy(stiffness * amount, motion)
