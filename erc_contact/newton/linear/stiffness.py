"""The elastic stiffness, glued to the foundations, factorised and condensed.

Between two states of a contact only forces at the contact change. So the nonlinear
problem needs only the stiffness condensed on the contact, a small dense matrix. One
factorisation serves the whole contact solve and the rebalance after it.

Symbols: K elastic stiffness with the supports [force/length]; D diagonal stiffness that
glues the contact nodes to the foundations, ``D_i = 10 E k^2/h |F|/m`` summed over
facets; L the free degrees of freedom of the cells at the contact, those of the contact
nodes first; A the first ones of L (the contact nodes, or all); S_A the Schur complement
of K + D on A. Then S_A - D_A is the Schur complement of K, and at the contact

    K u = b + (forces c at A)   <=>   (S_A - D_A) u_A = S_A w_A + c,

    u = w + (K + D)^-1 (D u_A + c)

with ``w = (K + D)^-1 b``. K + D is positive definite even if only contacts hold the
body. MUMPS makes the Schur complement on L with the factor; the degrees of freedom of L
that are not in A are eliminated with dense algebra.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from erc_contact.base.exceptions import InputError, together
from erc_contact.base.ranks import from_first, gathered
from erc_contact.model.model import Model
from erc_contact.newton.linear.elastic import Elastic
from erc_contact.newton.linear.layer import contact_layer
from erc_contact.newton.linear.mumps import Factor, factorised
from erc_contact.newton.linear.substructures import Substructures
from erc_contact.newton.linear.traces import DenseTraces


class Stiffness(Elastic):
    """Solve the elastic equations of a model with a factor.

    Attributes:
        local: Degrees of freedom of this rank (with ghosts) that are in L.
        place: Their places in L.
        numbers: Global numbers of L in order.
        contact_size: Number of degrees of freedom of L at contact nodes; 0 without
            contact.
        schur: S_L on rank 0; None elsewhere and without contact.
        glued_by: D_L on rank 0.
        motions: Rigid motions that no support holds, at L on rank 0.

    Raises:
        InputError: If the stiffness cannot be factorised.
    """

    iterative: ClassVar[bool] = False

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.contact_size = 0
        self.local = np.zeros(0, dtype=np.int64)
        self.schur: np.ndarray | None = None
        self._reduced: tuple[np.ndarray, np.ndarray] | None = None
        self._factor: Factor | Substructures | None = None
        self._matrix: PETSc.Mat | None = None
        if model.contacts:
            layer = contact_layer(model)
            self.contact_size = layer.contact_size
            self.numbers = layer.numbers
            self.local = layer.local
            self.place = layer.place
        if self.contact_size:
            self._condense()

    def glued(self, b: fem.Function, *, supports: bool = True) -> fem.Function:
        """Solve ``(K + D) w = b`` for the displacement w [length].

        The arguments are those of :meth:`.solver.ElasticSolver.solve`.
        """
        return self._solved_by(self._solver(), self.right_side(b, supports=supports))

    def _solved_by(self, solver: Factor | Substructures, right: PETSc.Vec) -> fem.Function:
        """Return the displacement of a right side [length], and destroy that."""
        x = right.duplicate()
        solver.solve(right, x)
        u = self.displacement(x)
        x.destroy()
        right.destroy()
        return u

    def solve(
        self, b: fem.Function, *, supports: bool = True, tolerance: float | None = None
    ) -> fem.Function:
        """Solve ``K u = b`` for u [length] under nodal forces b [force].

        The arguments are those of :meth:`glued`. The loads must do no work on rigid
        motions that no support holds. At the contact, u then has no part in these
        motions.
        """
        w = self.glued(b, supports=supports)
        if not self.contact_size:
            return w
        a = self.contact_size
        w_A = self.gather(w)[:a]

        def unglue() -> np.ndarray | None:
            if self.schur is None:
                return None
            schur, _ = self.reduced(a)
            return np.linalg.solve(self.definite(a), schur @ w_A)

        u_A = together(self.model.comm, unglue)
        return self.expand(w, u_A, None)

    def solve_with_springs(
        self, springs: PETSc.Mat, b: fem.Function, near: fem.Function
    ) -> fem.Function:
        """Solve ``(K + C) u = b`` for u [length] by a factor made for it.

        See :class:`.solver.ElasticSolver`.
        """
        matrix = self.stiffness()
        matrix.axpy(1.0, springs, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        factor = factorised(matrix)
        u = self._under(b, factor)
        factor.destroy()
        matrix.destroy()
        return u

    def _under(self, b: fem.Function, solver: Factor) -> fem.Function:
        """Return the displacement under nodal forces b by a solver [length]."""
        return self._solved_by(solver, self.right_side(b, supports=False))

    def traces(self, numbers: np.ndarray) -> DenseTraces:
        """Return the body as a surface sees it, see :class:`.solver.ElasticSolver`."""
        count = self.contact_size

        def matrices() -> tuple[np.ndarray, np.ndarray]:
            return self.unglued(count), np.linalg.inv(self.definite(count))

        return DenseTraces(self.model, numbers, self.numbers[:count], matrices)

    def expand(
        self, w: fem.Function, u_A: np.ndarray | None, force: np.ndarray | None
    ) -> fem.Function:
        """Return ``u = w + (K + D)^-1 (D u_A + c)`` [length]; collective.

        Args:
            w: The glued displacement [length].
            u_A: Displacement at A [length], on rank 0.
            force: Contact forces c at A [force], on rank 0; None for zero.
        """
        added = None
        if u_A is not None and self.schur is not None:
            added = self.glued_by[: len(u_A)] * u_A + (0.0 if force is None else force)
        forces = self.model.function()
        self.scatter(added, forces)
        u = self._moved_by(forces)
        u.x.array[:] += w.x.array
        return u

    def _moved_by(self, forces: fem.Function) -> fem.Function:
        """Return the glued displacement of forces on x, from their owners [length]."""
        return self._solved_by(self._solver(), self.vector(forces))

    def reduced(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return S_A (A, A) and the derivative of u_L by u_A (L, A), on rank 0.

        Args:
            count: Size of A, the first ones of L.
        """
        full = np.asarray(self.schur)
        a = self.contact_size
        if count == len(full):
            return full, np.eye(count)
        if self._reduced is None:
            lift = np.vstack([np.eye(a), -np.linalg.solve(full[a:, a:], full[a:, :a])])
            schur = full[:a, :a] + full[:a, a:] @ lift[a:]
            self._reduced = 0.5 * (schur + schur.T), lift
        return self._reduced

    def gather(self, u: fem.Function) -> np.ndarray:
        """Return the unknowns at L of a displacement, from their owners; collective.

        They are on rank 0; elsewhere the array is empty.
        """
        return self.gather_x(self.model.coordinates.to_x(u))

    def gather_x(self, u: fem.Function) -> np.ndarray:
        """Return values at L, as :meth:`gather` does, of a Function of unknowns."""
        owned = self.local < self.model.V.dofmap.index_map.size_local * self.model.d
        parts = gathered(self.model.comm, (self.place[owned], u.x.array[self.local[owned]]))
        values = np.zeros(len(self.numbers) if parts else 0)
        for place, part in parts or ():
            values[place] = part
        return values

    def scatter(self, values: np.ndarray | None, u: fem.Function) -> None:
        """Set u at L, or at the first ones of L, and to zero elsewhere; collective.

        Args:
            values: The values, on rank 0.
            u: A Function of unknowns, in place.
        """
        values = from_first(self.model.comm, values)
        inside = self.place < len(values)
        u.x.array[:] = 0.0
        u.x.array[self.local[inside]] = values[self.place[inside]]

    @property
    def factorised(self) -> bool:
        """Tell whether there is a factor to solve with."""
        return self._factor is not None

    def free(self) -> None:
        """Free the factor; a later solve makes it again."""
        for made in (self._factor, self._matrix):
            if made is not None:
                made.destroy()
        self._factor = self._matrix = None

    def make(self) -> None:
        """Make the factor, if there is none; collective."""
        self._solver()

    def definite(self, count: int) -> np.ndarray:
        """Return the stiffness of u_A with springs on free motions [force/length]."""
        return self.unglued(count) + self.springs(count)

    def springs(self, count: int) -> np.ndarray:
        """Return springs on free motions, as stiff as the body [force/length].

        The stiffness is a mean in which the softest body counts, as in
        :mod:`.motion_springs`.
        """
        kernel = self.kernel(count)
        diagonal = self.reduced(count)[0].diagonal()
        stiffness = 1.0 / np.sum(kernel**2 / diagonal[:, None], axis=0)
        return np.asarray(stiffness * kernel @ kernel.T)

    def kernel(self, count: int) -> np.ndarray:
        """Return orthonormal motions at A that no support holds, (A, K), on rank 0."""
        if not self.motions:
            return np.zeros((count, 0))
        return np.linalg.qr(np.column_stack(self.motions)[:count])[0]

    def unglued(self, count: int) -> np.ndarray:
        """Return ``S_A - D_A``, the stiffness of u_A [force/length], on rank 0.

        What is left of it on free motions is round-off of stiff bodies, and taken away.
        """
        matrix = self.reduced(count)[0].copy()
        matrix.flat[:: count + 1] -= self.glued_by[:count]
        if self.motions:
            kernel = self.kernel(count)
            matrix -= kernel @ (kernel.T @ matrix)
            matrix -= (matrix @ kernel) @ kernel.T
        return matrix

    def _assemble(self) -> PETSc.Mat:
        """Assemble K + D [force/length]."""
        matrix = self.stiffness()
        if self.contact_size:
            self.add_glue(matrix)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        return matrix

    def _condense(self) -> None:
        """Factorise with the Schur complement on L."""
        comm = self.model.comm
        solver = self._solver()
        self.glued_by = self.gather_x(self.glue)
        self.motions = [self.gather(motion) for motion in self.model.free_motions]

        def condense() -> np.ndarray | None:
            return self._schur_complement(solver) if comm.rank == 0 else None

        self.schur = together(comm, condense)

    def _schur_complement(self, solver: Factor | Substructures) -> np.ndarray:
        """Return S_L [force/length], on rank 0."""
        if isinstance(solver, Substructures):
            assert solver.interface is not None
            order = np.searchsorted(solver.interface.numbers, self.numbers)
            schur = solver.interface.schur[np.ix_(order, order)]
            schur = 0.5 * (schur + schur.T)
        else:
            schur = solver.schur_complement()
        if not np.isfinite(schur).all():
            raise InputError(
                "The elastic stiffness is not finite; look at the moduli and the mesh."
            )
        return schur

    def _solver(self) -> Factor | Substructures:
        """Return the factor of K + D; make it if there is none."""
        if self._factor is not None:
            return self._factor
        # MUMPS makes no Schur complement on all rows: something must be left to
        # eliminate. On coarse meshes L is the whole body; a tree of one rank then
        # factorises densely.
        has_contact = self.contact_size > 0
        layer_is_body = has_contact and len(self.numbers) == self.free_components()
        if self.model.comm.size > 1 or layer_is_body:
            self._factor = Substructures(self.model, self.form, self.glue, self.local)
        else:
            self._matrix = self._assemble()
            # A later factor need not make the Schur complement again.
            first = has_contact and self.schur is None
            self._factor = factorised(self._matrix, self.numbers if first else None)
        return self._factor
