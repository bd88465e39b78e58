"""The elastic equations solved iteratively, by conjugate gradients with multigrid.

It works on any number of ranks, see :mod:`erc_contact.newton.linear.hierarchy`.

Symbols: K and D as in :mod:`erc_contact.newton.linear.elastic`; C a matrix that is zero
away from the contact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.base.logs import log_of
from erc_contact.base.runtime.garbage import free_dropped
from erc_contact.base.sparse import as_entries, for_products
from erc_contact.model.data.over_ranks import product
from erc_contact.model.model import Model
from erc_contact.newton.linear.elastic import ElasticEquations
from erc_contact.newton.linear.factor_cost import cycles_of_factor
from erc_contact.newton.linear.hierarchy import Hierarchy, free_motions, hold, weak_share
from erc_contact.newton.linear.krylov import (
    CG_LIMIT,
    FACTOR_LIMIT,
    SLOW,
    TRIAL,
    conjugate_gradients,
    fgmres,
    preconditioner,
    shell,
)
from erc_contact.newton.linear.mumps import Factor, factorise
from erc_contact.newton.linear.traces import IterativeTraces

ROUGH, EXACT = 1e-4, 1e-12
"""Tolerances of linear solves: of first guesses, and of what must balance loads [-].

Corrections are as rough as first guesses. A first guess to 1e-2 costs four cycles less
and up to four Newton steps more.
"""
TRY_DIRECT = (
    'Take solver="direct": nearly incompressible bodies, slender ones and jumps of the moduli '
    "are hard for multigrid."
)
"""What a user can do where multigrid fails."""
DISTANCE_TOLERANCE = 0.1
"""Tolerance of the linear solve that measures the distance to the solution [-]."""
LATER = 1.5
"""Cycles of an elastic solve over the cycles that the first ones promise [-].

Later ones are slower: to 1e-12 they were 140, not 90, in an assembly of 18 solids.
"""
ENOUGH = 1e3
"""A residual of so many tolerances is enough; what is left is balanced again [-]."""


LEFT_BY_FACTOR = 1e-3
"""Residual that a factor may leave of the loads, of which no iteration takes more [-].

It is 1e-12 mostly. In a slender body that nothing holds the forces that cancel are
greater than the loads by orders: 2e-7 is left of a layer of 190 x 2.
"""


class Way(NamedTuple):
    """Hold a preconditioner of conjugate gradients.

    Attributes:
        name: Its name in words.
        pc: The preconditioner.
        matrix: The matrix that it is for.
        limit: Number of iterations that it may take.
        round_off: Residual over the right side that is round-off [-].
        slow: Fall of the residual in an iteration with which it is given up early [-].
    """

    name: str
    pc: PETSc.PC
    matrix: PETSc.Mat
    limit: int
    round_off: float = 0.0
    slow: float = np.inf


class Multigrid(ElasticEquations):
    """Solve the elastic equations of a model with multigrid.

    Args:
        model: The scene on a mesh.
        hurried: Whether :meth:`solve_glued` gives up early where multigrid is slow.

    Attributes:
        contact_size: Number of free degrees of freedom at contact nodes, over all
            ranks; 0 without contact.
    """

    iterative: ClassVar[bool] = True

    def __init__(self, model: Model, *, hurried: bool = False) -> None:
        super().__init__(model)
        # In units that do not fit the body, smoothers and norms see either the supports
        # or the body.
        self.support_stiffness = model.stiffest() * model.domain.extent ** (model.space.d - 2)
        glued = int(np.count_nonzero(self._stiffness_of_glue))
        self.contact_size = int(model.space.comm.allreduce(glued, MPI.SUM))
        self._hurried = hurried
        self._hierarchy: Hierarchy | None = None
        self._factor: tuple[Factor, PETSc.PC] | None = None
        self._factor_cost: float | None = None
        """Cycles that may take the place of a factor of K; None before a solve."""
        self._matrix: PETSc.Mat | None = None
        self._operator: PETSc.Mat | None = None

    @property
    def matrix(self) -> PETSc.Mat:
        """Return K; the first call assembles it."""
        if self._matrix is None:
            self._assemble()
        return self._matrix

    @property
    def operator(self) -> PETSc.Mat:
        """Return K as it is multiplied, at degree 2 in dense blocks of nodes."""
        if self._operator is None:
            self._assemble()
        return self._operator

    @cached_property
    def _stiffness_of_glue(self) -> np.ndarray:
        """Return the diagonal of D at the nodes of this rank [force/length]."""
        return self.glue.diagonal()[: self.owned]

    @property
    def at_contacts(self) -> np.ndarray:
        """Tell which components of this rank are at contacts, shape (owned,)."""
        return self._stiffness_of_glue > 0

    @property
    def hierarchy(self) -> Hierarchy:
        """Return the hierarchy; the first call makes it."""
        if self._hierarchy is None:
            self._hierarchy = Hierarchy(
                self.model,
                self.matrix,
                self.operator,
                self.glue.matrix(),
                weak_share(self.model),
                support_stiffness=self.support_stiffness,
                has_contact=self.contact_size > 0,
            )
        return self._hierarchy

    def solve_glued(
        self, b: fem.Function, *, supports: bool = True, tolerance: float = ROUGH
    ) -> fem.Function:
        """Solve ``(K + D) u_0 = b`` for the displacement u_0 [length].

        Args:
            b: Nodal forces [force], whose ghost contributions are added up here.
            supports: Whether fixed components take the values of the supports, else
                zero.
            tolerance: Residual over the right side [-].
        """
        self.hierarchy.set_share(1.0)
        right = self.right_side(b, supports=supports, glued=True)
        right.scale(self.hierarchy.scale)
        return self._solve_for(
            self.hierarchy.matrix,
            right,
            tolerance,
            ways=[self._first] if self.contact_size else [self._first, self._factor_of_sum],
        )

    def solve(
        self, b: fem.Function, *, supports: bool = True, tolerance: float | None = None
    ) -> fem.Function:
        """Solve ``K u = b`` for the displacement u [length].

        The loads must do no work on rigid motions that no support holds; u has no part
        in these motions. Without supports it is a correction, of which four digits are
        right by default. A factor of K solves where it costs less than the cycles, as
        in the plane; slender bodies and flat cells would take hundreds of them.

        Args:
            b: Nodal forces [force], whose ghost contributions are added up here.
            supports: Whether fixed components take the values of the supports, else
                zero.
            tolerance: Residual over the right side [-].
        """
        exactly = tolerance or (EXACT if supports else ROUGH)
        ways = self._ways_of_stiffness(exactly)
        if len(ways) > 1:
            self.hierarchy.set_share(weak_share(self.model))
        right = self.right_side(b, supports=supports)
        if self.model.free_motions:
            motions = free_motions(self.model, self.matrix)
            self.operator.setNullSpace(motions)
            motions.remove(right)  # its part in the motions is round-off
        return self._solve_for(self.operator, right, exactly, ways=ways)

    def solve_with_springs(
        self, springs: PETSc.Mat, b: fem.Function, near: fem.Function
    ) -> fem.Function:
        """Solve ``(K + C) u = b`` [length], see :class:`.solver.ElasticSolver`."""
        self.renew(springs)
        right = self.right_side(b, supports=False)
        right.scale(self.hierarchy.scale)
        return self._solve_for(self.hierarchy.matrix, right, EXACT, near)

    def lift(self, y: fem.Function, tolerance: float) -> fem.Function:
        """Return the forces that hold the contact nodes at displacements y [force].

        The other nodes are free of forces. At contacts between bodies y is a jump, and
        the force acts on the jump.

        Args:
            y: Displacement, or jump, at the nodes of this side that this rank owns
                [length], zero where supports fix it.
            tolerance: Of the displacement between them [-].
        """
        self.hierarchy.set_share(1.0)
        connections = self.model.connections
        held = self.at_contacts
        fixed = np.flatnonzero(self.fixed)
        y = connections.least_displacement(y)

        # Solve for what moves between them, where no jump changes, and add y.
        u, b, forces, free, left = (self.matrix.createVecRight() for _ in range(5))
        u.array[:] = y.x.array[: self.owned]
        self.times(u, forces)
        forces.scale(-1.0)
        connections.let_go(forces, b, held)
        b.array[fixed] = 0.0
        diagonal = float(self.glue.diagonal().max(initial=0.0))

        def inside(x: PETSc.Vec, result: PETSc.Vec) -> None:
            connections.let_go(x, free, held)
            self.operator.mult(free, left)
            connections.let_go(left, result, held)
            # What is held has a stiffness of its own.
            free.aypx(-1.0, x)
            result.axpy(diagonal, free)

        operator = shell(inside, b)
        between = self._solve_for(operator, b, tolerance, held=held)
        u.array[:] += between.x.array[: self.owned]

        self.times(u, forces)
        forces.array[fixed] = 0.0
        nodal_forces = self.function(forces)
        for done in (operator, u, forces, free, left):
            done.destroy()
        if connections.any:
            return product(self.model.space, connections.projection, nodal_forces, transpose=True)
        return nodal_forces

    def traces(self, numbers: np.ndarray) -> IterativeTraces:
        """Return the body as a surface sees it, see :class:`.solver.ElasticSolver`."""
        return IterativeTraces(self.model, numbers, self.solve, self.lift)

    def times(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the forces K x [force]."""
        self.operator.mult(x, y)

    def start(self, u: fem.Function) -> np.ndarray:
        """Return the nodal values of this rank [length] from which Newton starts."""
        return u.x.array[: self.owned]

    def follow(self, u: fem.Function) -> None:
        """Let loose faces follow a displacement under the loads [length], in place."""

    def renew(self, change: PETSc.Mat) -> None:
        """Renew the hierarchy for K plus a change C [force/length]."""
        if self._hierarchy is None:
            self.hierarchy.set_share(1.0)
        self.hierarchy.renew(change)

    def cycle(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the hierarchy's approximation of the inverse times x."""
        self.hierarchy.pc.apply(x, y)
        y.scale(self.hierarchy.scale)

    @property
    def factorised(self) -> bool:
        """Tell whether a hierarchy or a factor is in memory."""
        return self._hierarchy is not None or self._factor is not None

    def make(self) -> None:
        """Make what solves, a hierarchy and maybe a factor; collective."""
        self.hierarchy.set_share(1.0)
        if self._factor_of_stiffness == self._ways_of_stiffness(EXACT)[0]:
            self._factor_of_stiffness()

    def free(self) -> None:
        """Free K and the hierarchy; a later solve makes them again."""
        if self._hierarchy is not None:
            self._hierarchy.free()
            self._hierarchy = None
        if self._factor is not None:
            for made in self._factor:
                made.destroy()
            self._factor = None
        for matrix in (self._matrix, self._operator):
            if matrix is not None:
                matrix.destroy()
        self._matrix = self._operator = None
        free_dropped(self.model.space.comm)

    def rough_energy(self, force: PETSc.Vec) -> float:
        """Estimate ``R.K^-1 R`` of forces R, where a weak glue holds a loose body."""
        weak = self.glue.matrix()
        weak.scale(weak_share(self.model))
        u = force.duplicate()
        glue_force = force.duplicate()

        def weakly_glued(y: PETSc.Vec, result: PETSc.Vec) -> None:
            self.times(y, result)
            weak.mult(y, glue_force)
            result.axpy(1.0, glue_force)

        fgmres(weakly_glued, self.cycle, force, u, DISTANCE_TOLERANCE)
        energy = float(force.dot(u))
        for done in (weak, u, glue_force):
            done.destroy()
        return energy

    def imbalance(self, x: PETSc.Vec, other_forces: PETSc.Vec, least: float) -> float:
        """Return the resultant of K x on free motions over the contact forces [-].

        It is round-off.

        Args:
            x: The unknowns of a model with free motions, in any scale.
            other_forces: What the contact forces are beside K x, in the same scale;
                they become the contact forces, in place.
            least: Contact forces of round-off, below which they do not count less.
        """
        forces = self.matrix.createVecRight()
        self.times(x, forces)
        motions = free_motions(self.model, self.matrix)
        resultants = [motion.dot(forces) for motion in motions.getVecs()]
        other_forces.axpy(1.0, forces)
        other_forces.array[self.fixed] = 0.0
        size = max(other_forces.norm(), least)
        forces.destroy()
        for motion in motions.getVecs():
            motion.destroy()
        motions.destroy()
        return float(np.linalg.norm(resultants)) / size

    def _solve_for(
        self,
        matrix: PETSc.Mat,
        b: PETSc.Vec,
        tolerance: float,
        near: fem.Function | None = None,
        *,
        held: np.ndarray | None = None,
        ways: Sequence[Callable[[], Way]] | None = None,
    ) -> fem.Function:
        """Solve for a right side, which is destroyed.

        Args:
            matrix: The matrix [force/length].
            b: Right side [force].
            tolerance: Residual over the right side [-].
            near: A displacement that may be near [length].
            held: Which unknowns of this rank contacts read, if no jump moves in this
                problem, shape (owned,).
            ways: Make the preconditioners that are tried in turn; None for a cycle, and
                for a factor where cycles fail.

        Raises:
            InputError: If the loads are no numbers.
            NotConverged: If too much of the loads is left.
        """
        size = b.norm(PETSc.NormType.NORM_INFINITY)
        if not np.isfinite(size):
            raise InputError(
                "The loads overflow double precision. Choose units in which they are nearer to 1."
            )
        x = b.duplicate()
        if size > 0:
            # The squares in norms overflow earlier than the numbers do.
            b.scale(1 / size)
            if near is not None:
                x.array[:] = near.x.array[: self.owned] / size
            for make in ways or (self._cycle, self._factor_of_sum):
                way = make()
                left = self._iterate(matrix, way, b, x, tolerance, held)
                if left <= max(ENOUGH * tolerance, way.round_off):
                    break
                failed = f"left {left:.0e} of the loads"
                if not np.isfinite(left):
                    failed = "are slow, or break down"
                log = log_of(self.model.space.comm)
                log.info("Conjugate gradients by %s %s.", way.name, failed)
            else:
                failed = f"Conjugate gradients with multigrid {failed}."
                raise NotConverged(f"{failed} {TRY_DIRECT}", ())
            x.scale(size)
        u = self.function(x)
        x.destroy()
        b.destroy()
        return u

    def _iterate(
        self,
        matrix: PETSc.Mat,
        way: Way,
        b: PETSc.Vec,
        x: PETSc.Vec,
        tolerance: float,
        held: np.ndarray | None,
    ) -> float:
        """Return what conjugate gradients leave of b [-], see :meth:`_solve_for`."""
        return conjugate_gradients(
            matrix, way.pc, way.matrix, b, x, tolerance, limit=way.limit, slow=way.slow
        )

    def _ways_of_stiffness(self, tolerance: float, /) -> list[Callable[[], Way]]:
        """Return what makes the preconditioners for K, in the order of trying.

        Cycles may take as long as a factor. Where the first ones show that they would
        take longer, the factor goes on, and solves alone from then on.

        Args:
            tolerance: Residual over the right side [-].
        """
        if self._factor_cost is None:
            self._factor_cost = cycles_of_factor(self.matrix, self.matrix)
        if self._factor_cost < TRIAL:
            return [self._factor_of_stiffness]
        slow = tolerance ** (LATER / self._factor_cost)
        return [lambda: self._cycle()._replace(slow=slow), self._factor_of_stiffness]

    def _first(self) -> Way:
        """Return a cycle for the first guess, which may be given up early."""
        return self._cycle()._replace(slow=SLOW if self._hurried else np.inf)

    def _cycle(self) -> Way:
        """Return a cycle of the hierarchy as a preconditioner."""
        return Way("multigrid", self.hierarchy.pc, self.hierarchy.matrix, CG_LIMIT)

    def _factor_of_sum(self) -> Way:
        """Return a factor of the matrix of the hierarchy as a preconditioner."""
        self.hierarchy.factorise()
        return self._cycle()._replace(name="a factor")

    def _factor_of_stiffness(self) -> Way:
        """Return a factor of K as a preconditioner; the first call makes it.

        A spring holds the body at one component for each motion that no support holds.
        Under loads that do no work on these motions no spring carries a force, so that
        the factor solves exactly. The glue of a slender body would be stiffer than its
        bending.
        """
        if self._factor is None:
            held = self.matrix.copy()
            hold(held, free_motions(self.model, self.matrix).getVecs())
            factor = factorise(held)
            held.destroy()
            self._factor = factor, preconditioner(factor.solve, self.matrix)
            self._factor_cost = 0.0  # later solves try no cycles
        return Way("a factor", self._factor[1], self.matrix, FACTOR_LIMIT, LEFT_BY_FACTOR)

    def _assemble(self) -> None:
        """Assemble K in both forms."""
        if self.model.space.degree == 1:
            self._matrix = self._operator = self.stiffness()
        else:
            blocks = self.stiffness_in_blocks()
            comm = self.model.space.mesh.comm
            self._matrix = as_entries(blocks, comm)
            self._operator = for_products(blocks, comm)
