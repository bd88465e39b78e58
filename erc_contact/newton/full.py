"""The contact problem for all degrees of freedom of the body, in parallel: residual, tangent, status, multipliers.

With S the identity, for a method with multiplier without the rows of A, the problem is

    R(u) = S (K u - b) + e(C u, lambda(K u - b)) = 0.

Here e are the equations of the method and A the free degrees of freedom of the contact nodes; C turns nodal values of
degree 2 at the contact into Bernstein coefficients; lambda are the multipliers, which the reactions ``K u - b`` of the
contact nodes give (:mod:`erc_contact.newton.reactions`). The tangent ``S K + e_u C + e_lambda lambda' K`` is applied,
not assembled: only the terms of the contact are assembled anew. Newton's iterates are those of the condensed problem
(:mod:`erc_contact.newton.condensed`), up to the tolerance of the linear solver.

The linear solver is FGMRES with the multigrid hierarchy of ``K + e_u``. With a multiplier it is that of K + G. G are
springs at the nodes: e_u after the equations are solved for the reaction, with some compliance where they do not
determine it,

    G = C^T H e_u C,    H = (e_lambda/a + D^-1 e_u)^-1 at each node, a the area.

So nodes that stick get the glue D, and open ones nothing.
"""

from __future__ import annotations

from hashlib import sha256
from typing import Any

import numpy as np
from dolfinx import fem, la
from dolfinx.fem import petsc as fp
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.model.model import Model
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.methods import Method
from erc_contact.newton.multigrid import Multigrid
from erc_contact.newton.reactions import Reactions

TOLERANCE = 1e-10
"""Newton's method stops when the residual is below this fraction of the contact forces of the first guess [-]."""
ROUND_OFF = 1e-15
"""It stops, too, below this fraction of the forces that cancel in the elastic equations [-]."""
FAR = 1e-8
"""It never stops above this fraction of the contact forces of the first guess [-]."""
FORCING = 0.1
"""Tolerance of the first linear solves, which Eisenstat and Walker's rule lowers [-]."""
REGULAR = 1e-5
"""Tolerance of the linear solve that shows whether the tangent has an inverse [-]."""
LIMIT, RESTART = 200, 50
"""Limit of the cycles of one linear solve, and vectors that it keeps."""
FRESH = 0.35
"""Contraction of the residual by one cycle that a hierarchy of the tangent at hand is expected to have [-]."""
RENEWAL = 14.0
"""Number of cycles that cost as much as a new hierarchy."""


class FullSpace:
    """A contact problem of a model and a method, as SNES solves it; members are collective.

    Args:
        model: The scene on a mesh.
        method: The contact method.
        elastic: Its elastic equations.
        loads: Their right side b, with the lifted supports [force].
        length: Size of the displacements, which scales the unknowns [length].
        force: Size of the contact forces, which scales the residual [force].
    """

    def __init__(
        self, model: Model, method: Method, elastic: Multigrid, loads: PETSc.Vec, length: float, force: float
    ) -> None:
        self.model, self.method, self.elastic, self.loads = model, method, elastic, loads
        self.length, self.force = length, force
        self.forms = ContactForms(model, method)
        self._equations = fem.Function(model.V)
        own = elastic.owned
        bcs = [] if method.multiplier else model.bcs
        self._bcs = bcs
        self._tangents = [fp.create_matrix(form) for form in self.forms.tangents]
        self._fixed = model.fixed.ravel()[:own]
        if method.multiplier:
            self._reactions = Reactions(model)
            self._rows = self._reactions.free.ravel()[:own]
            self._springs = _Springs(model, elastic, self._reactions)
        else:
            self._rows = ~self._fixed
        self._work = [self.vector() for _ in range(2)]
        self._rest = self.vector()
        self._at: PETSc.Vec | None = None
        local, everywhere = elastic.matrix.getSizes()[0]
        shape = ((local, everywhere), (local, everywhere))
        self._tangent = PETSc.Mat().createPython(shape, context=_Tangent(self), comm=elastic.matrix.comm)
        self._tangent.setUp()
        self._last = (0, 1.0)  # cycles of the last linear solve, and its reduction of the residual
        self._excess = 0.0

    # -- as SNES needs it -----------------------------------------------------------------------------------

    def vector(self) -> PETSc.Vec:
        """A new vector of unknowns ``u / length``."""
        return self.elastic.matrix.createVecRight()

    def function(self, _: Any, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Set f to the scaled residual."""
        self._set(x)
        self._rest.copy(f)
        values = self._equations.x.array
        values[:] = 0.0
        fem.assemble_vector(values, self.forms.residual)
        self._equations.x.scatter_reverse(la.InsertMode.add)
        if self.forms.multipliers:
            f.array[self._rows] = 0.0
        f.array[self._rows] += values[: len(self._rows)][self._rows]
        f.scale(1 / self.force)

    def prepare(self, snes: PETSc.SNES) -> None:
        """Give SNES the tangent and FGMRES with multigrid."""
        snes.setJacobian(self._renewed, self._tangent)
        snes.setUseEW(True, version=2, rtol_0=FORCING, rtol_max=FORCING, alpha=1.3, threshold=0.01)
        snes.setMaxLinearSolveFailures(2)
        ksp = snes.getKSP()
        ksp.setType("fgmres")
        ksp.setGMRESRestart(RESTART)
        ksp.setTolerances(atol=0.3 * TOLERANCE, max_it=LIMIT)
        ksp.setMonitor(self._watch)
        pc = ksp.getPC()
        pc.setType("python")
        pc.setPythonContext(_Cycle(self))
        self._last, self._excess = (0, 1.0), 0.0

    def round_off(self, x: PETSc.Vec) -> float:
        """The norm of the scaled residual that counts as solved [-].

        It is bounded: a body that nothing holds moves so far that any residual would be round-off of its forces.
        """
        diagonal = self.elastic.matrix.getDiagonal()
        diagonal.pointwiseMult(diagonal, x)
        diagonal.array[self._fixed] = 0.0
        forces = diagonal.norm() * self.length / self.force
        diagonal.destroy()
        return max(TOLERANCE, min(ROUND_OFF * forces, FAR))

    def remaining(self, x: PETSc.Vec) -> float:
        """Energy norm of the distance to the solution, about ``sqrt(R.K^-1 R)`` [sqrt(force length)]."""
        force, u = self.vector(), self.vector()
        self.function(None, x, force)
        self.elastic.cycle(force, u)
        energy = force.dot(u) * self.force**2
        force.destroy()
        u.destroy()
        return float(np.sqrt(max(energy, 0.0)))

    def regularity(self, x: PETSc.Vec) -> float:
        """About the least eigenvalue of the tangent at x, scaled by the elastic diagonal [-]; zero without an inverse.

        It is the ratio of a force to the displacement that it causes, after one step of inverse iteration. It is one
        without friction, where solutions are unique as far as the body is held.
        """
        if all(contact.friction is None for contact in self.model.contacts):
            return 1.0
        diagonal, force, u = self.elastic.matrix.getDiagonal(), self.vector(), self.vector()
        diagonal.sqrtabs()
        first, _ = force.getOwnershipRange()
        force.array[:] = np.sin(1.0 + np.arange(first, first + len(self._rows)) ** 2)
        force.array[self._fixed] = 0.0
        size = force.norm()
        force.pointwiseMult(force, diagonal)
        self._renewed(None, x)
        ksp = PETSc.KSP().create(force.comm)
        ksp.setOperators(self._tangent)
        ksp.setType("fgmres")
        ksp.setTolerances(rtol=REGULAR, max_it=LIMIT)
        ksp.setGMRESRestart(RESTART)
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(_Cycle(self))
        ksp.solve(force, u)
        u.pointwiseMult(u, diagonal)
        u.array[self._fixed] = 0.0
        found = size / u.norm() * self.force / self.length if u.norm() > 0 else 1.0
        for made in (ksp, diagonal, force, u):
            made.destroy()
        return float(found)

    def status(self, x: PETSc.Vec) -> tuple[bytes, tuple[int, int, int]]:
        """A key of the contact status of all points, and the numbers of open, slipping and sticking points."""
        self._set(x)
        found, comm = self.forms.status(), self.model.comm
        key = b"".join(comm.allgather(sha256(found.tobytes()).digest()))
        open_, slip, stick = (int(n) for n in comm.allreduce(np.bincount(found, minlength=3), MPI.SUM))
        return key, (open_, slip, stick)

    # -- the tangent ----------------------------------------------------------------------------------------

    def mult(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the scaled tangent times x."""
        self.elastic.matrix.mult(x, y)
        if self.forms.multipliers:
            self._mult_equations(x, y)
        else:
            self._tangents[0].multAdd(x, y, y)
        y.scale(self.length / self.force)

    def precondition(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to about the inverse of the scaled tangent times x."""
        if self.forms.multipliers:
            right, _ = self._work
            right.array[:] = self._springs.right_side(x.array_r)
            self.elastic.cycle(right, y)
        else:
            self.elastic.cycle(x, y)
        y.scale(self.force / self.length)

    def _mult_equations(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Replace the rows of A in ``y = K x`` by those of the equations."""
        model, (given, found) = self.model, self._work
        shape = model.fixed.shape
        force, u = np.zeros(shape), fem.Function(model.V)
        force.ravel()[: len(self._rows)] = y.array_r
        u.x.array[: len(self._rows)] = x.array_r
        u.x.scatter_forward()
        model.to_coefficients(u.x.array.reshape(shape), model.contacts)
        total = np.zeros(len(self._rows))
        for tangent, values in zip(self._tangents, (u.x.array, *self._reactions.multipliers(force)), strict=True):
            given.array[:] = values.ravel()[: len(self._rows)]
            tangent.mult(given, found)
            total += found.array_r
        y.array[self._rows] = total[self._rows]

    def _renewed(self, _: Any, x: PETSc.Vec, *__: PETSc.Mat) -> None:
        """Assemble the terms of the contact in the tangent at x, and renew the hierarchy where that pays."""
        self._set(x)
        for tangent, form in zip(self._tangents, self.forms.tangents, strict=True):
            tangent.zeroEntries()
            fp.assemble_matrix(tangent, form, bcs=self._bcs, diag=0.0)
            tangent.assemble()
        if self.forms.multipliers:
            self._springs.update(self._tangents)
        cycles, reduction = self._last
        if cycles:
            self._excess += cycles - np.log(reduction) / np.log(FRESH)
        if self._excess > RENEWAL:
            self.elastic.renew(self._springs.matrix if self.forms.multipliers else self._tangents[0])
            self._excess = 0.0

    def _watch(self, _: PETSc.KSP, cycle: int, norm: float) -> None:
        """Remember the cycles of a linear solve and its reduction of the residual."""
        if cycle == 0:
            self._first = norm
        self._last = cycle, max(norm / self._first, 1e-16) if self._first > 0 else 1.0

    # -- states ---------------------------------------------------------------------------------------------

    def raise_friction(self, share: float) -> None:
        """Set the share of friction."""
        self.forms.share.value = share

    def found(self, x: PETSc.Vec) -> tuple[fem.Function, tuple[fem.Function, ...]]:
        """Displacement and multipliers at x, new Functions of nodal values."""
        self._set(x)
        u = self.elastic.displacement(x)
        u.x.array[:] *= self.length
        return u, self.forms.found_multipliers()

    def _set(self, x: PETSc.Vec) -> None:
        """Set the fields of the forms to x, and with them ``K u - b`` [force]."""
        if self._at is not None and self._at.equal(x):
            return
        model, u, rest = self.model, self.forms.u.x, self._rest
        u.array[: len(self._rows)] = x.array_r * self.length
        u.scatter_forward()
        self.elastic.matrix.mult(x, rest)
        rest.scale(self.length)
        rest.axpy(-1.0, self.loads)
        if self.forms.multipliers:
            shape = model.fixed.shape
            model.to_coefficients(u.array.reshape(shape), model.contacts)
            force = np.zeros(shape)
            force.ravel()[: len(self._rows)] = rest.array_r
            for multiplier, values in zip(self.forms.multipliers, self._reactions.multipliers(force), strict=True):
                multiplier.x.array[:] = values.ravel()
        if self._at is None:
            self._at = x.copy()
        else:
            x.copy(self._at)

    def free(self) -> None:
        """Free PETSc's objects, which know this one: without it neither would be freed."""
        for made in (*self._tangents, *self._work, self._rest, self._tangent):
            made.destroy()
        if self.forms.multipliers:
            self._springs.matrix.destroy()


class _Tangent:
    """The tangent of a problem, for PETSc."""

    def __init__(self, problem: FullSpace) -> None:
        self.problem = problem

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the tangent times x."""
        self.problem.mult(x, y)


class _Cycle:
    """The preconditioner of a problem, for PETSc."""

    def __init__(self, problem: FullSpace) -> None:
        self.problem = problem

    def apply(self, _: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the preconditioned x."""
        self.problem.precondition(x, y)


class _Springs:
    """G and H of a method with multiplier, at the contact nodes of this rank.

    Attributes:
        matrix: G [force/length].
    """

    def __init__(self, model: Model, elastic: Multigrid, reactions: Reactions) -> None:
        d, count = model.d, elastic.owned // model.d
        self.model, self.reactions, self.shape = model, reactions, model.fixed.shape
        self.free = reactions.free[:count]
        self.nodes = np.flatnonzero(self.free.any(axis=1))
        self.free = self.free[self.nodes]
        self.area = reactions.area[self.nodes]
        self.glue = elastic.glue.x.array.reshape(-1, d)[self.nodes].max(axis=1, initial=0.0)
        dofs = model.global_numbers(self.nodes)[:, None] * d + np.arange(d)
        rows, cols = (np.broadcast_to(one, (len(dofs), d, d)).ravel() for one in (dofs[:, :, None], dofs[:, None, :]))
        self._nodal = _sparse(elastic.matrix, rows, cols)
        self._first = elastic.matrix.getOwnershipRange()[0]
        self._coefficients: PETSc.Mat | None = None
        if model.degree > 1:
            row, col, value = reactions.coefficients()
            self._coefficients = _sparse(elastic.matrix, row, col)
            self._coefficients.setValuesCOO(value)
        self.matrix = self._nodal

    def update(self, tangents: list[PETSc.Mat]) -> None:
        """Set G and H from the derivatives of e by u and by the multipliers."""
        by_u, *by_multipliers = (self._blocks(tangent) for tangent in tangents)
        fixed = ~self.free
        inverse = sum(by_multipliers) / self.area[:, None, None] + by_u / self.glue[:, None, None]
        inverse[fixed] = 0.0
        inverse.transpose(0, 2, 1)[fixed] = 0.0
        node, i = np.nonzero(fixed)
        inverse[node, i, i] = 1.0
        self.h = np.linalg.inv(inverse)
        springs = np.matmul(self.h, by_u)
        springs[fixed] = 0.0
        springs.transpose(0, 2, 1)[fixed] = 0.0
        self._nodal.setValuesCOO(springs.ravel())
        if self._coefficients is not None:
            known = None if self.matrix is self._nodal else self.matrix
            self.matrix = self._nodal.ptap(self._coefficients, result=known)

    def right_side(self, x: np.ndarray) -> np.ndarray:
        """Nodal forces from the residual x of the equations: ``C^T H x`` at A and x elsewhere."""
        force, at_contact = np.zeros(self.shape), np.zeros(self.shape)
        force.ravel()[: len(x)] = x
        values = np.matmul(self.h, np.where(self.free, force[self.nodes], 0.0)[..., None])[..., 0]
        at_contact[self.nodes] = values
        force[self.nodes] = np.where(self.free, 0.0, force[self.nodes])
        force += np.where(self.reactions.free, self.reactions.back(at_contact), 0.0)
        return force.ravel()[: len(x)]

    def _blocks(self, tangent: PETSc.Mat) -> np.ndarray:
        """The block of each node in a matrix, shape (nodes, d, d)."""
        d = self.shape[1]
        begin, column, value = tangent.getValuesCSR()
        row = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
        column = column - self._first
        own = row // d == column // d
        place = row[own] * d + column[own] % d
        blocks = np.bincount(place, value[own], (len(begin) - 1) * d).reshape(-1, d, d)
        return blocks[self.nodes]


def _sparse(like: PETSc.Mat, rows: np.ndarray, cols: np.ndarray) -> PETSc.Mat:
    """A matrix of the size of another one, with entries at the given places."""
    matrix = PETSc.Mat().create(comm=like.comm)
    matrix.setSizes(like.getSizes())
    matrix.setType("aij")
    matrix.setPreallocationCOO(rows.astype(PETSc.IntType), cols.astype(PETSc.IntType))
    return matrix
