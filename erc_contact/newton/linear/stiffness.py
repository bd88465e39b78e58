"""The elastic stiffness, glued to the foundations, factorised once and condensed on the contact.

Between two states of a contact only forces at the contact change. So the nonlinear
problem needs only the stiffness condensed on the contact, a small dense matrix. One
factorisation serves the whole contact solve and the rebalance after it.

Symbols: K elastic stiffness with the supports [force/length]; D diagonal stiffness that
glues the contact nodes to the foundations, ``D_i = 10 E k^2/h |F|/m`` summed over
facets; L the free degrees of freedom of the cells at the contact, those of the contact
nodes first; A the first ones of L (the contact nodes, or all); S_A the Schur complement
of K + D on A. Then S_A - D_A is the Schur complement of K, and at the contact

    K u = b + (forces c at A)   <=>   (S_A - D_A) u_A = S_A w_A + c,    u = w + (K +
    D)^-1 (D u_A + c)

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
from erc_contact.mesh.simplex import local_facet_nodes
from erc_contact.model.model import Model
from erc_contact.newton.linear.elastic import Elastic
from erc_contact.newton.linear.mumps import factorised, schur_complement
from erc_contact.newton.linear.substructures import Substructures
from erc_contact.newton.linear.traces import DenseTraces


class Stiffness(Elastic):
    """The elastic stiffness of a model with its supports.

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
        self.contact_size, self.local = 0, np.zeros(0, dtype=np.int64)
        self.schur: np.ndarray | None = None
        self._reduced: tuple[np.ndarray, np.ndarray] | None = None
        self._factor: PETSc.KSP | Substructures | None = None
        self._matrix: PETSc.Mat | None = None
        if model.contacts:
            self.local, self.place, self.numbers = self._layer()
        if self.contact_size:
            self._condense()

    def glued(self, b: fem.Function, *, supports: bool = True) -> fem.Function:
        """``w = (K + D)^-1 b`` [length] under nodal forces b [force], whose ghost contributions are added up here.

        Args:
            b: Nodal forces.
            supports: Whether fixed components take the values of the supports, else
                zero.
        """
        vector = self.right_side(b, supports=supports)
        x = vector.duplicate()
        self._solver().solve(vector, x)
        u = self.displacement(x)
        x.destroy()
        vector.destroy()
        return u

    def solve(
        self, b: fem.Function, *, supports: bool = True, tolerance: float | None = None
    ) -> fem.Function:
        """Displacement u of ``K u = b`` [length] under nodal forces b [force]; see :meth:`glued`.

        The loads must do no work on rigid motions that no support holds. At the
        contact, u then has no part in these motions.
        """
        w = self.glued(b, supports=supports)
        if not self.contact_size:
            return w
        a = self.contact_size
        w_A = self.gather(w)[:a]
        u_A = together(self.model.comm, lambda: None if self.schur is None else self._freed(a, w_A))
        return self.expand(w, u_A, None)

    def solve_with_springs(
        self, springs: PETSc.Mat, b: fem.Function, near: fem.Function
    ) -> fem.Function:
        """Return the displacement u of ``(K + C) u = b`` [length] by a factor made for it.

        See :class:`.solver.ElasticSolver`.
        """
        matrix = self.stiffness()
        matrix.axpy(1.0, springs, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        ksp, vector = factorised(matrix), self.right_side(b, supports=False)
        x = vector.duplicate()
        ksp.solve(vector, x)
        u = self.displacement(x)
        for made in (ksp, matrix, vector, x):
            made.destroy()
        return u

    def traces(self, numbers: np.ndarray) -> DenseTraces:
        """Return the body as a surface sees it, see :class:`.solver.ElasticSolver`."""
        count = self.contact_size
        return DenseTraces(
            self.model,
            numbers,
            self.numbers[:count],
            lambda: (self.unglued(count), np.linalg.inv(self.definite(count))),
        )

    def _freed(self, a: int, w_A: np.ndarray) -> np.ndarray:
        """Displacement of the contact nodes without the glue, from that with it, on rank 0."""
        return np.linalg.solve(self.definite(a), self.reduced(a)[0] @ w_A)

    def expand(
        self, w: fem.Function, u_A: np.ndarray | None, force: np.ndarray | None
    ) -> fem.Function:
        """``u = w + (K + D)^-1 (D u_A + c)`` from u_A and the contact forces c at A, both on rank 0 (c may be None)."""
        added = None
        if u_A is not None and self.schur is not None:
            added = self.glued_by[: len(u_A)] * u_A + (0.0 if force is None else force)
        b = self.model.function()
        self.scatter(added, b)
        b.x.array[self.owned :] = 0.0  # the owner has the whole force
        u = self.glued(b, supports=False)
        u.x.array[:] += w.x.array
        return u

    def reduced(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """S_A for the first ``count`` of L, shape (A, A), and the derivative of u_L by u_A, shape (L, A), on rank 0."""
        full = np.asarray(self.schur)
        if count == len(full):
            return full, np.eye(count)
        if self._reduced is None:
            a = self.contact_size
            lift = np.vstack([np.eye(a), -np.linalg.solve(full[a:, a:], full[a:, :a])])
            schur = full[:a, :a] + full[:a, a:] @ lift[a:]
            self._reduced = 0.5 * (schur + schur.T), lift
        return self._reduced

    def gather(self, u: fem.Function) -> np.ndarray:
        """Values at L on rank 0 (elsewhere an empty array), from the owners of the nodes; collective."""
        own = self.local < self.model.V.dofmap.index_map.size_local * self.model.d
        parts = gathered(self.model.comm, (self.place[own], u.x.array[self.local[own]]))
        values = np.zeros(len(self.numbers) if parts else 0)
        for place, part in parts or ():
            values[place] = part
        return values

    def scatter(self, values: np.ndarray | None, u: fem.Function) -> None:
        """Set u at L, or at the first ones of L, to the values on rank 0, and to zero elsewhere; collective."""
        values = from_first(self.model.comm, values)
        known = self.place < len(values)
        u.x.array[:] = 0.0
        u.x.array[self.local[known]] = values[self.place[known]]

    @property
    def factorised(self) -> bool:
        """Whether there is a factor to solve with."""
        return self._factor is not None

    def free(self) -> None:
        """Free the factor; a later solve makes it again."""
        if self._factor is not None:
            self._factor.destroy()
            self._factor = None
        if self._matrix is not None:
            self._matrix.destroy()
            self._matrix = None

    def definite(self, count: int) -> np.ndarray:
        """The stiffness of u_A, see :meth:`unglued`, made definite on rigid motions that no support holds."""
        matrix = self.unglued(count)
        if self.motions:
            kernel, _ = np.linalg.qr(np.column_stack(self.motions)[:count])
            matrix += np.mean(self.reduced(count)[0].diagonal()) * kernel @ kernel.T
        return matrix

    def unglued(self, count: int) -> np.ndarray:
        """``S_A - D_A`` for the first ``count`` of L, the stiffness of u_A, on rank 0."""
        matrix = self.reduced(count)[0].copy()
        matrix.flat[:: count + 1] -= self.glued_by[:count]
        return matrix

    def _layer(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Local degrees of freedom in L, their places, and the global numbers of L in order."""
        model, d = self.model, self.model.d
        facets = np.vstack([c.facets for c in model.contacts])
        touching = np.zeros(len(model.fixed), dtype=bool)
        on_facet = local_facet_nodes(d, model.degree)[facets[:, 1]]
        touching[np.take_along_axis(model.nodes[facets[:, 0]], on_facet, axis=1)] = True
        layer = np.zeros(len(model.fixed), dtype=bool)
        layer[model.nodes[facets[:, 0]]] = True
        dofs = np.flatnonzero((layer[:, None] & ~model.fixed).ravel())
        at_contact = np.repeat(touching, d)[dofs]
        numbers = model.global_dofs(dofs)
        contact = np.unique(np.concatenate(model.comm.allgather(numbers[at_contact])))
        rest = np.setdiff1d(np.concatenate(model.comm.allgather(numbers[~at_contact])), contact)
        every = np.concatenate([contact, rest])
        self.contact_size = len(contact)
        order = np.argsort(every)
        return dofs, order[np.searchsorted(every, numbers, sorter=order)], every

    def _free_components(self) -> int:
        """The number of degrees of freedom of all ranks that no support fixes; collective."""
        fixed = self.model.fixed.ravel()[: self.owned]
        free = int(np.count_nonzero(~fixed))
        return self.model.comm.allreduce(free)

    def _assemble(self) -> PETSc.Mat:
        matrix = self.stiffness()
        if self.contact_size:
            self.add_glue(matrix)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        return matrix

    def _condense(self) -> None:
        """Factorise with the Schur complement on L."""
        comm, solver = self.model.comm, self._solver()
        self.glued_by = self.gather(self.glue)
        self.motions = [self.gather(motion) for motion in self.model.free_motions]
        self.schur = together(
            comm, lambda: self._schur_complement(solver) if comm.rank == 0 else None
        )

    def _schur_complement(self, solver: PETSc.KSP | Substructures) -> np.ndarray:
        """S_L, on rank 0."""
        if isinstance(solver, Substructures):
            assert solver.interface is not None
            order = np.searchsorted(solver.interface.numbers, self.numbers)
            schur = solver.interface.schur[np.ix_(order, order)]
            schur = 0.5 * (schur + schur.T)
        else:
            schur = schur_complement(solver, len(self.numbers))
        if not np.isfinite(schur).all():
            raise InputError(
                "The elastic stiffness is not finite; look at the moduli and the mesh."
            )
        return schur

    def _solver(self) -> PETSc.KSP | Substructures:
        if self._factor is None:
            # MUMPS makes no Schur complement on all rows: something must be left to
            # eliminate. On coarse meshes L is the whole body; a tree of one rank then
            # factorises densely.
            layer_is_body = self.contact_size > 0 and len(self.numbers) == self._free_components()
            if self.model.comm.size > 1 or layer_is_body:
                self._factor = Substructures(self.model, self.form, self.glue, self.local)
            else:
                self._matrix = self._assemble()
                wanted = self.contact_size > 0 and self.schur is None
                self._factor = factorised(self._matrix, self.numbers if wanted else None)
        return self._factor
