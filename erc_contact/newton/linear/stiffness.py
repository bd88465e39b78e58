"""The elastic stiffness, glued to the foundations, factorised and condensed.

Between two states of a contact only forces at the contact change. So the nonlinear
problem needs only the stiffness condensed on the contact, a small dense matrix. One
factorisation serves the whole contact solve and the rebalance after it.

Contacts read displacements in the row space of their B only
(:mod:`erc_contact.model.contact.groups`). So the unknowns L are amounts in an
orthonormal basis Q: first the displacements of groups of nodes that change a jump, then
the displacements that do not, and the displacements of the other nodes. Where no
contact is between bodies, Q is the identity. For a pair of nodes the first
displacements are ``(u_1 - u_2)/sqrt(2)``, and the second ones ``(u_1 + u_2)/sqrt(2)``.

Symbols: K elastic stiffness with the supports [force/length]; D the glue
(:mod:`erc_contact.newton.linear.glue`); L the free components of the nodes of contacts
and of their cells, in the basis Q; A the first ones of L (those that change jumps, or
all); S_A the Schur complement of K + D on A. Then S_A - D_A is the Schur complement of
K, and at the contact

    K u = b + (forces c at A)   <=>   (S_A - D_A) u_A = S_A u_0 + c,

    u = u_0 + (K + D)^-1 (D u_A + c)

with ``u_0 = (K + D)^-1 b``. K + D is positive definite even if only contacts hold the
body. MUMPS makes the Schur complement on L with the factor; the degrees of freedom of L
that are not in A are eliminated with dense algebra.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from dolfinx import fem
from petsc4py import PETSc
from scipy.linalg import lu_factor, lu_solve  # type: ignore[import-untyped]
from scipy.sparse import csr_array  # type: ignore[import-untyped]

from erc_contact.base.exceptions import InputError, together
from erc_contact.model.contact.trace import places_of
from erc_contact.model.data.over_ranks import marked_by_any
from erc_contact.model.model import Model
from erc_contact.newton.linear.changed import DIFFERENT, SUBSET
from erc_contact.newton.linear.elastic import ElasticEquations
from erc_contact.newton.linear.jump_basis import JumpBasis
from erc_contact.newton.linear.mumps import Factor, dense_factor, dense_solve, factorise
from erc_contact.newton.linear.substructures import Substructures
from erc_contact.newton.linear.traces import DenseTraces
from namedmesh.base.ranks import distinct_rows, from_first, gathered, of_all

DENSE = 1e6
"""Cube of the size of L over the number of unknowns from which S_L is only read.

A plain factor then solves at less cost, as in leaves of one row of cells, of which L is
half.
"""


@dataclass(frozen=True, eq=False)
class Layer:
    """Number the free degrees of freedom L of the nodes of contacts and of their cells.

    Degrees of freedom of the contact nodes come first. Of two bodies in contact there
    are the cells of this side, and the contact nodes of both sides.

    Attributes:
        contact_size: Number of degrees of freedom at contact nodes.
        numbers: Global numbers of L in order, the same on all ranks, shape (L,).
        local: Degrees of freedom of this rank (with ghosts) that are in L, shape (n,).
        place: Their places in L, shape (n,).
    """

    contact_size: int
    numbers: np.ndarray
    local: np.ndarray
    place: np.ndarray


def contact_layer(model: Model) -> Layer:
    """Find the layer of all contacts of a model; collective."""
    space = model.space
    touching = np.zeros(space.node_count, dtype=bool)
    layer = np.zeros(space.node_count, dtype=bool)
    for contact in model.contacts:
        touching[contact.trace.here.nodes] = True
        layer[space.nodes[contact.facets[:, 0]]] = True
    if model.connections.any:
        touching |= model.connections.is_paired
        # A rank may have the cell of a contact facet without the cell that faces it.
        (layer,) = marked_by_any(space, layer | model.connections.is_paired)

    dofs = np.flatnonzero((layer[:, None] & ~model.fixed).ravel())
    at_contact = np.repeat(touching, space.d)[dofs]
    numbers = space.global_dofs(dofs)
    on_contact = distinct_rows(space.comm, numbers[at_contact])
    (others,) = of_all(space.comm, numbers[~at_contact])
    # A node may be at the contact by a facet of another rank only.
    off_contact = np.setdiff1d(others, on_contact)

    all_numbers = np.concatenate([on_contact, off_contact])
    return Layer(len(on_contact), all_numbers, dofs, places_of(numbers, all_numbers))


class Stiffness(ElasticEquations):
    """Solve the elastic equations of a model with a factor.

    Attributes:
        layer: The degrees of freedom whose displacements L are, without the basis.
        contact_size: Number of unknowns of L that change jumps; 0 without contact.
        schur: S_L on rank 0; None elsewhere and without contact.
        glued_by: D_A on rank 0; None elsewhere.
        basis: Q.
        motions: Rigid motions that no support holds, at L on rank 0.

    Raises:
        InputError: If the stiffness cannot be factorised.
    """

    iterative: ClassVar[bool] = False

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.contact_size = 0
        self.layer = contact_layer(model)
        self.schur: np.ndarray | None = None
        self._reduced: tuple[np.ndarray, np.ndarray] | None = None
        self._factor: Factor | Substructures | None = None
        self._matrix: PETSc.Mat | None = None
        self._unglued: tuple[np.ndarray, np.ndarray] | None = None
        if self.layer.contact_size:
            groups = model.connections.groups
            self.basis = JumpBasis(groups, self.layer.numbers, self.layer.contact_size)
            self.contact_size = self.basis.jump_count
            self._condense()

    def solve_glued(self, b: fem.Function, *, supports: bool = True) -> fem.Function:
        """Solve ``(K + D) u_0 = b`` for the displacement u_0 [length].

        For the arguments see :meth:`.solver.ElasticSolver.solve`.
        """
        return self._solve_by(self._solver(), self.right_side(b, supports=supports, glued=True))

    def _solve_by(self, solver: Factor | Substructures, right: PETSc.Vec) -> fem.Function:
        """Solve for the displacement [length], and destroy the right side."""
        x = right.duplicate()
        solver.solve(right, x)
        u = self.function(x)
        x.destroy()
        right.destroy()
        return u

    def solve(
        self, b: fem.Function, *, supports: bool = True, tolerance: float | None = None
    ) -> fem.Function:
        """Solve ``K u = b`` for u [length] under nodal forces b [force].

        For the arguments see :meth:`solve_glued`. The loads must do no work on rigid
        motions that no support holds. At the contact, u then has no part in these
        motions.
        """
        u_0 = self.solve_glued(b, supports=supports)
        if not self.contact_size:
            return u_0
        a = self.contact_size
        glued_A = self.gather(u_0)[:a]
        glue_forces = self.gather(self.glue.times(u_0))[:a]

        def unglue() -> np.ndarray | None:
            if self.schur is None:
                return None
            schur, _ = self.reduce(a)
            # What bodies are glued to may be moved by supports.
            by_supports = glue_forces - self.glued_by @ glued_A
            if self._unglued is None:
                self._unglued = lu_factor(self.definite(a), overwrite_a=True, check_finite=False)
            right = schur @ glued_A + by_supports
            return np.asarray(lu_solve(self._unglued, right, check_finite=False))

        u_A = together(self.model.space.comm, unglue)
        return self.expand(u_0, u_A, None)

    def solve_with_springs(
        self, springs: PETSc.Mat, b: fem.Function, near: fem.Function
    ) -> fem.Function:
        """Solve ``(K + C) u = b`` for u [length] by a factor made for it.

        See :class:`.solver.ElasticSolver`.
        """
        matrix = self.stiffness()
        matrix.axpy(1.0, springs, DIFFERENT if self.model.connections.any else SUBSET)
        factor = factorise(matrix)
        u = self._solve_under(b, factor)
        factor.destroy()
        matrix.destroy()
        return u

    def _solve_under(self, b: fem.Function, solver: Factor) -> fem.Function:
        """Return the displacement under nodal forces b by a solver [length]."""
        return self._solve_by(solver, self.right_side(b, supports=False))

    def traces(self, numbers: np.ndarray) -> DenseTraces:
        """Return the body as a surface sees it, see :class:`.solver.ElasticSolver`."""
        count = self.contact_size

        def matrices() -> tuple[np.ndarray, np.ndarray]:
            return self.unglue(count), np.linalg.inv(self.definite(count))

        return DenseTraces(self.model, numbers, self.basis, matrices)

    def expand(
        self, u_0: fem.Function, u_A: np.ndarray | None, force: np.ndarray | None
    ) -> fem.Function:
        """Return ``u = u_0 + (K + D)^-1 (D u_A + c)`` [length]; collective.

        Args:
            u_0: The glued displacement [length].
            u_A: Displacement at A [length], on rank 0.
            force: Contact forces c at A [force]; None on all ranks for zero.
        """
        # The glue reads what moves at the contact, and supports there.
        read = u_0.copy()
        at_contact = self.layer.local[self.layer.place < self.layer.contact_size]
        read.x.array[at_contact] = self.scatter(u_A).x.array[at_contact]
        forces = self.glue.times(read)
        if force is not None:
            forces.x.array[:] += self.scatter(force).x.array
        u = self._move_by(forces)
        u.x.array[:] += u_0.x.array
        return u

    def _move_by(self, forces: fem.Function) -> fem.Function:
        """Return the glued displacement of nodal forces, from their owners [length]."""
        return self._solve_by(self._solver(), self.vector(forces))

    def reduce(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return S_A (A, A) and the derivative of u_L by u_A (L, A), on rank 0.

        Args:
            count: Size of A, the first ones of L.
        """
        full = np.asarray(self.schur)
        a = self.contact_size
        if count == len(full):
            return full, np.eye(count)
        if self._reduced is None:
            inside = dense_factor(full[a:, a:], "cholesky")
            lift = np.vstack([np.eye(a), -dense_solve(inside, full[a:, :a])])
            inside.destroy()
            schur = full[:a, :a] + full[:a, a:] @ lift[a:]
            self._reduced = 0.5 * (schur + schur.T), lift
        return self._reduced

    def gather(self, u: fem.Function) -> np.ndarray:
        """Return the unknowns L of a displacement, or nodal forces on them; collective.

        They are on rank 0; elsewhere the array is empty.

        Args:
            u: The displacement or the forces, from the owners of nodes.
        """
        layer = self.layer
        owned = layer.local < self.owned
        of_rank = (layer.place[owned], u.x.array[layer.local[owned]])
        parts = gathered(self.model.space.comm, of_rank)
        if parts is None:
            return np.zeros(0)
        values = np.zeros(len(layer.numbers))
        for place, part in parts:
            values[place] = part
        return self.basis.unknowns(values)

    def scatter(self, values: np.ndarray | None) -> fem.Function:
        """Return the displacement of unknowns L, or their nodal forces; collective.

        It is zero away from the contact.

        Args:
            values: The values of L, or of the first ones of L, on rank 0.
        """
        nodal: np.ndarray | None = None
        if values is not None and self.schur is not None:
            nodal = self.basis.nodal(values)
        nodal = from_first(self.model.space.comm, nodal)
        u = self.model.space.function()
        u.x.array[self.layer.local] = nodal[self.layer.place]
        return u

    @property
    def factorised(self) -> bool:
        """Tell whether there is a factor to solve with."""
        return self._factor is not None

    def free(self) -> None:
        """Free the factor; a later solve makes it again."""
        for made in (self._factor, self._matrix):
            if made is not None:
                made.destroy()
        self._factor = self._matrix = self._unglued = None

    def make(self) -> None:
        """Make the factor, if there is none; collective."""
        self._solver()

    def definite(self, count: int) -> np.ndarray:
        """Return the stiffness of u_A with springs on free motions [force/length]."""
        return self.unglue(count) + self.springs(count)

    def springs(self, count: int) -> np.ndarray:
        """Return springs on free motions, as stiff as the body [force/length].

        The stiffness is a mean in which the softest body counts: springs as stiff as a
        body stiffer by orders would not let a soft one move.
        """
        kernel = self.kernel(count)
        diagonal = self.reduce(count)[0].diagonal()
        stiffness = 1.0 / np.sum(kernel**2 / diagonal[:, None], axis=0)
        return np.asarray(stiffness * kernel @ kernel.T)

    def kernel(self, count: int) -> np.ndarray:
        """Return orthonormal motions at A that no support holds, (A, K), on rank 0."""
        if not self.motions:
            return np.zeros((count, 0))
        return np.linalg.qr(np.column_stack(self.motions)[:count])[0]

    def unglue(self, count: int) -> np.ndarray:
        """Return ``S_A - D_A``, the stiffness of u_A [force/length], on rank 0.

        What is left of it on free motions is round-off of stiff bodies, and taken away.
        """
        matrix = self.reduce(count)[0].copy()
        a = self.contact_size
        assert self.glued_by is not None
        # Each entry stands once in D_A, as a subtraction in place needs it.
        rows = np.repeat(np.arange(a), np.diff(self.glued_by.indptr))
        matrix[:a, :a][rows, self.glued_by.indices] -= self.glued_by.data
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
        comm = self.model.space.comm
        solver = self._solver()
        self.glued_by = self._glue_of_jumps()
        self.motions = [self.gather(motion) for motion in self.model.free_motions]

        def condense() -> np.ndarray | None:
            return self._schur_complement(solver) if comm.rank == 0 else None

        self.schur = together(comm, condense)
        layer_size = len(self.layer.numbers)
        if isinstance(solver, Factor) and layer_size**3 > DENSE * self.free_components():
            # To solve, MUMPS would factorise S_L as a dense matrix.
            solver.destroy()
            self._factor = factorise(self._matrix)

    def _schur_complement(self, solver: Factor | Substructures) -> np.ndarray:
        """Return S_L [force/length], on rank 0."""
        if isinstance(solver, Substructures):
            assert solver.interface is not None
            order = np.searchsorted(solver.interface.numbers, self.layer.numbers)
            schur = solver.interface.schur[np.ix_(order, order)]
            schur = 0.5 * (schur + schur.T)
        else:
            schur = solver.schur_complement()
        if not np.isfinite(schur).all():
            raise InputError(
                "The elastic stiffness is not finite; look at the moduli and the mesh."
            )
        return self.basis.of_unknowns(schur)

    def _glue_of_jumps(self) -> csr_array | None:
        """Gather D_A; it is on rank 0, None elsewhere; collective."""
        glue, model = self.glue, self.model
        used = glue.free
        rows, columns = (model.space.global_dofs(dofs[used]) for dofs in (glue.rows, glue.columns))
        parts = gathered(model.space.comm, (rows, columns, glue.values[used]))
        if parts is None:
            return None
        return self.basis.of_jumps(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def _solver(self) -> Factor | Substructures:
        """Return the factor of K + D; make it if there is none."""
        if self._factor is not None:
            return self._factor
        # MUMPS makes no Schur complement on all rows: something must be left to
        # eliminate. On coarse meshes L is the whole body; a tree of one rank then
        # factorises densely.
        has_contact = self.contact_size > 0
        layer_is_body = has_contact and len(self.layer.numbers) == self.free_components()
        if self.model.space.comm.size > 1 or layer_is_body:
            self._factor = Substructures(self.model, self.form, self.glue, self.layer.local)
        else:
            self._matrix = self._assemble()
            # A later factor need not make the Schur complement again.
            first = has_contact and self.schur is None
            self._factor = factorise(self._matrix, self.layer.numbers if first else None)
        return self._factor
