"""The contact problem for all degrees of freedom of the body, in parallel.

The equations e of a method are forces on what the contacts read, ``w = B u``
(:mod:`erc_contact.model.contact.groups`). Without a multiplier the problem is

    R(u) = K u - b + B^T e(w) = 0.

With one it is, with the projector P to the nodal forces ``B^T g``,

    R(u) = (I - P) (K u - b) + B^T e(w, lambda(K u - b)) = 0.

The reactions ``K u - b`` of the contact nodes give the multipliers lambda
(:mod:`erc_contact.newton.reactions`). At degree 2 these equations read Bernstein
coefficients of w. Newton's iterates are the iterates of the condensed problem
(:mod:`erc_contact.newton.condensed`), up to the tolerance of the linear solver. The
tangent and its preconditioner are in :mod:`erc_contact.newton.tangent`.
"""

from __future__ import annotations

from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.model.model import Model
from erc_contact.newton.contact_nodes import PRESSING, contact_normals
from erc_contact.newton.forms import ContactForms, Counts
from erc_contact.newton.interior_forms import InteriorForms
from erc_contact.newton.interior_point import CentralPath, follow
from erc_contact.newton.ladder import Attempt
from erc_contact.newton.linear.krylov import fgmres, set_up
from erc_contact.newton.linear.multigrid import ROUGH, Multigrid
from erc_contact.newton.reactions import Reactions
from erc_contact.newton.shared_laws import laws_of
from erc_contact.newton.snes import IMBALANCE, Outcome, PathEnd, Status, attempt
from erc_contact.newton.tangent import Tangent

SOLVED = 1e-10
"""Residual at which Newton's method stops, over the contact forces of the guess [-]."""
ELASTIC_ROUND_OFF = 1e-15
"""Residual at which it stops, too, over the forces that cancel in K u - b [-]."""
FAR_FROM_SOLVED = 1e-8
"""Residual above which it never stops, over the contact forces of the guess [-]."""
FORCING = 0.03
"""Tolerance of the first linear solves, which Eisenstat and Walker's rule lowers [-].

With 0.1 there are a tenth fewer cycles, but high friction may lead to another solution
than exact steps.
"""


class FullSpace:
    """Represent a contact problem as SNES solves it; members are collective.

    Args:
        model: The scene on a mesh.
        forms: The equations of a method.
        elastic: Its elastic equations.
        loads: Their right side b, with the lifted supports [force].
        length: Size of the displacements, which scales the unknowns [length].
        force: Size of the contact forces, which scales the residual [force].
        rough: Whether its solution is on the way to another one.
    """

    def __init__(
        self,
        model: Model,
        forms: ContactForms,
        elastic: Multigrid,
        loads: PETSc.Vec,
        length: float,
        force: float,
        *,
        rough: bool = False,
    ) -> None:
        self.model = model
        self._rough = rough
        self.elastic = elastic
        self.loads = loads
        self.length = length
        self.force = force
        self.forms = forms
        self._equations = model.space.function(), model.space.function()
        self._fixed = elastic.fixed
        self._reactions: Reactions | None = None
        self._rows = ~self._fixed
        """Degrees of freedom of this rank whose row has contact terms."""
        if forms.method.multiplier:
            self._reactions = Reactions(model)
            self._rows = self._reactions.is_read
        self._tangent = Tangent(self.forms, elastic, self._reactions, length, force)
        self._elastic_residual = self.vector()
        self._last_x: PETSc.Vec | None = None

    # -- as SNES needs it

    def vector(self) -> PETSc.Vec:
        """Return a new vector of unknowns ``u / length``."""
        return self.elastic.matrix.createVecRight()

    def function(self, _: Any, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Set f to the scaled residual."""
        self._set(x)
        if self._reactions is None:
            self._elastic_residual.copy(f)
        else:
            # The equations of the multiplier stand in place of the equilibrium.
            self.model.connections.let_go(self._elastic_residual, f, self._rows)
        f.array[self._rows] += self._contact_forces()[self._rows]
        # Supports hold as exactly as numbers can: the rest of them is no force.
        is_held = self._fixed & (abs(f.array) <= ELASTIC_ROUND_OFF * abs(self.loads.array_r))
        f.array[is_held] = 0.0
        f.scale(1 / self.force)

    def _contact_forces(self) -> np.ndarray:
        """Assemble the nodal forces of the equations of this rank [force]."""
        d = self.model.space.d
        of_reader, total = self._equations
        total.x.array[:] = 0.0
        for reader in self.forms.readers:
            of_reader.x.array[:] = 0.0
            reader.assemble(of_reader.x.array)
            total.x.array[:] += of_reader.x.array
            if reader.contact is not None:
                here, there = self._pairs[reader.contact].T
                trace = self.model.contacts[reader.contact].trace
                reaction = trace.sent(of_reader.x.array.reshape(-1, d)[here])
                np.subtract.at(total.x.array.reshape(-1, d), there, reaction)
        total.x.scatter_reverse(la.InsertMode.add)
        return total.x.array[: self.elastic.owned]

    @cached_property
    def _pairs(self) -> list[np.ndarray]:
        """Return the pairs of nodes of this rank of each contact, shape (p, 2)."""
        pairs = []
        for contact in self.model.contacts:
            trace = contact.trace
            here = trace.here.nodes[trace.facing]
            pairs.append(np.unique(np.column_stack([here.ravel(), trace.partners.ravel()]), axis=0))
        return pairs

    def prepare(self, snes: PETSc.SNES) -> None:
        """Give SNES the tangent and FGMRES with multigrid."""
        snes.setJacobian(self._renew, self._tangent.matrix)
        snes.setUseEW(True, version=2, rtol_0=FORCING, rtol_max=FORCING, alpha=1.3, threshold=0.01)
        snes.setMaxLinearSolveFailures(2)
        set_up(snes.getKSP(), self._tangent.precondition)
        # With 0.1 eps of a layer of 60 x 1 that nothing holds has eight digits, with
        # 0.3 it has seven.
        snes.getKSP().setTolerances(atol=0.1 * SOLVED)

    def round_off(self, x: PETSc.Vec) -> tuple[float, float]:
        """Return norms of the scaled residual: what counts as solved, round-off [-].

        The first is bounded: a body that nothing holds moves so far that any residual
        would be round-off of its forces. So would it be of a body that is stiffer by
        orders than the bodies that hold it.
        """
        diagonal = self.elastic.matrix.getDiagonal()
        diagonal.pointwiseMult(diagonal, x)
        diagonal.array[self._fixed] = 0.0
        forces = diagonal.norm() * self.length / self.force
        diagonal.destroy()
        round_off = ELASTIC_ROUND_OFF * forces
        return max(SOLVED, min(round_off, FAR_FROM_SOLVED)), round_off

    def balances(self, x: PETSc.Vec) -> bool:
        """Tell whether K x has no resultant on motions that no support holds."""
        if not self.model.free_motions:
            return True
        contact_forces = self.loads.copy()
        contact_forces.scale(-1.0 / self.length)
        # Contacts that nothing presses have forces of round-off.
        least = SOLVED / IMBALANCE * self.force / self.length
        part = self.elastic.imbalance(x, contact_forces, least)
        contact_forces.destroy()
        return part <= IMBALANCE

    def accurate(self, x: PETSc.Vec, tolerance: float) -> bool:
        """Tell whether the distance to the solution is below a tolerance.

        It is measured in the energy norm [sqrt(force length)]. The estimate by one
        cycle is too small where the contact is closed. If it is below the tolerance, a
        rough solve without the contact decides, where a weak glue holds a loose body.
        On the way to another solution the estimate is enough.
        """
        if self.distance(x) > tolerance:
            return False
        if self._rough:
            return True
        force = self.vector()
        self.function(None, x, force)
        energy = self.elastic.rough_energy(force) * self.force**2
        force.destroy()
        return energy <= tolerance**2

    def distance(self, x: PETSc.Vec) -> float:
        """Estimate the energy norm of the distance [sqrt(force length)].

        It is about ``sqrt(R.K^-1 R)``, with one cycle for the inverse.
        """
        force = self.vector()
        u = self.vector()
        self.function(None, x, force)
        self.elastic.cycle(force, u)
        energy = force.dot(u)
        force.destroy()
        u.destroy()
        return float(np.sqrt(max(energy, 0.0))) * self.force

    def least_singular_value(self, x: PETSc.Vec) -> float:
        """Estimate the least singular value of the tangent [-]; zero if singular.

        The elastic diagonal scales it. It is one without friction, where solutions are
        unique as far as the body is held. Otherwise it is the lesser one of two
        tangents: at x, and, if this changes the contact status, at x pressed into the
        foundation (:data:`.contact_nodes.PRESSING`).
        """
        if all(contact.friction is None for contact in self.model.contacts):
            return 1.0
        status = self.status(x).key
        pressed = x.copy()
        rows = self._rows
        normals = contact_normals(self.model).x.array[: len(rows)]
        pressed.array[rows] += PRESSING * normals[rows]
        pressed_status = self.status(pressed).key
        states = [x]
        if pressed_status != status:
            states.append(pressed)
        values = []
        u = self.vector()
        for state in states:
            self._set(state)
            self._tangent.assemble()
            values.append(self._tangent.least_singular_value(u))
        pressed.destroy()
        u.destroy()
        return min(values)

    def status(self, x: PETSc.Vec) -> Status:
        """Return the contact status of all points."""
        self._set(x)
        comm = self.model.space.comm
        status = self.forms.status()
        digests = comm.allgather(sha256(status.tobytes()).digest())
        counts = comm.allreduce(np.bincount(status, minlength=3), MPI.SUM)
        open_, slip, stick = (int(count) for count in counts)
        return Status(b"".join(digests), (open_, slip, stick), status)

    def _renew(self, _: Any, x: PETSc.Vec, *__: PETSc.Mat) -> None:
        """Assemble the tangent at x, and renew its hierarchy."""
        self._set(x)
        self._tangent.assemble()
        self._tangent.renew()

    # -- states, the unknowns of this rank

    def solve(
        self, state: np.ndarray, step: Attempt, tolerance: float | None
    ) -> tuple[np.ndarray, Outcome]:
        """Make one attempt; return the last state and how the attempt ended.

        Args:
            state: The state where Newton's method starts.
            step: The attempt.
            tolerance: As :func:`.snes.attempt` has it.
        """
        x = self.at(state)
        outcome = attempt(self, x, step, tolerance)
        last = x.array_r.copy()
        x.destroy()
        return last, outcome

    def at(self, state: np.ndarray) -> PETSc.Vec:
        """Return a new vector of the unknowns of a state."""
        x = self.vector()
        x.array[:] = state
        return x

    def set_shares(self, friction: float, gap: float) -> None:
        """Set the shares of friction and gaps [-]."""
        self.forms.set_shares(friction, gap)

    def counts(self, state: np.ndarray) -> tuple[Counts, ...]:
        """Count the points of each contact by their status."""
        x = self.at(state)
        self._set(x)
        x.destroy()
        return self.forms.counts()

    def follow_path(self, x: np.ndarray, friction: float) -> PathEnd:
        """Make interior point steps from a state x.

        Args:
            x: The unknowns.
            friction: Share of the friction bounds [-].
        """
        assert isinstance(self.forms, InteriorForms)
        path = CentralPath(self.forms, friction)
        state, residual, change = self.vector(), self.vector(), self.vector()

        def solve(u: np.ndarray, *, renew: bool) -> np.ndarray:
            state.array[:] = u
            if renew:
                self._renew(None, state)
                change.set(0.0)
            self.function(None, state, residual)
            fgmres(self._tangent.mult, self._tangent.precondition, residual, change, ROUGH)
            state.axpy(-1.0, change)
            self._set(state)
            return state.array_r.copy()

        result = follow(lambda name: getattr(path, name)(), solve, x, corrects=False)
        for vector in (state, residual, change):
            vector.destroy()
        return result

    def hold(self, weight: float, state: np.ndarray) -> None:
        """Hold free motions at a state, see :meth:`.tangent.Tangent.hold`."""
        x = self.at(state)
        self._tangent.hold(weight, x)
        x.destroy()
        if self._last_x is not None:
            # The multipliers are reactions, of the springs, too.
            self._last_x.set(np.nan)

    def fields(self, x: PETSc.Vec) -> tuple[fem.Function, tuple[fem.Function, ...]]:
        """Return displacement and multipliers at x, new Functions of nodal values."""
        self._set(x)
        u = self.elastic.function(x)
        u.x.array[:] *= self.length
        self.elastic.follow(u)
        if self._reactions is None:
            return u, ()
        return u, self.forms.nodal_multipliers(laws_of(self.forms, self._reactions.map))

    def _set(self, x: PETSc.Vec) -> None:
        """Set the fields of the forms to x, and with them ``K u - b`` [force]."""
        if self._last_x is not None and self._last_x.equal(x):
            return
        residual = self._elastic_residual
        owned = self.elastic.owned
        u = self.elastic.function(x)
        u.x.array[:] *= self.length
        self.forms.set_displacement(u)
        self.elastic.times(x, residual)
        if self._tangent.held is not None:
            self._tangent.held.add_forces(x, residual)
        residual.scale(self.length)
        residual.axpy(-1.0, self.loads)
        if self._reactions is not None:
            work = self.vector()
            for multiplier, matrix in zip(
                self.forms.multipliers, self._reactions.matrices, strict=True
            ):
                matrix.mult(residual, work)
                multiplier.x.array[:owned] = work.array_r
                multiplier.x.scatter_forward()
            work.destroy()
        if self._last_x is None:
            self._last_x = x.copy()
        else:
            x.copy(self._last_x)

    def free(self) -> None:
        """Free PETSc's objects; they know this object, so that nobody else would."""
        self._tangent.free()
        if self._reactions is not None:
            self._reactions.destroy()
        self._elastic_residual.destroy()
