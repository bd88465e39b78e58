"""The contact problem for all degrees of freedom of the body, in parallel: residual, status, multipliers.

With S the identity, for a method with multiplier without the rows of A, the problem is

    R(u) = S (K u - b) + e(C u, lambda(K u - b)) = 0.

Here e are the equations of the method and A the free degrees of freedom of the contact
nodes. C turns nodal values of degree 2 at the contact into Bernstein coefficients. The
reactions ``K u - b`` of the contact nodes give the multipliers lambda
(:mod:`erc_contact.newton.reactions`). Newton's iterates are those of the condensed
problem (:mod:`erc_contact.newton.condensed`), up to the tolerance of the linear solver.
The tangent and its preconditioner are in :mod:`erc_contact.newton.tangent`.
"""

from __future__ import annotations

from hashlib import sha256
from typing import Any

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.model.model import Model
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear.krylov import fgmres
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.methods import Method
from erc_contact.newton.reactions import Reactions
from erc_contact.newton.tangent import Tangent

TOLERANCE = 1e-10
"""Newton's method stops when the residual is below this fraction of the contact forces of the first guess [-]."""
ROUND_OFF = 1e-15
"""It stops, too, below this fraction of the forces that cancel in the elastic equations [-]."""
FAR = 1e-8
"""It never stops above this fraction of the contact forces of the first guess [-]."""
FORCING = 0.03
"""Tolerance of the first linear solves, which Eisenstat and Walker's rule lowers [-].

With 0.1 there are a tenth fewer cycles, but high friction may lead to another solution
than exact steps.
"""
PRESS = 1e-5
"""How far a state is pressed into the foundation for another tangent, over the size of the displacement [-]."""
ROUGH = 0.1
"""Tolerance of the linear solve that measures the distance to the solution [-]."""


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
        self,
        model: Model,
        method: Method,
        elastic: Multigrid,
        loads: PETSc.Vec,
        length: float,
        force: float,
    ) -> None:
        self.model, self.method, self.elastic, self.loads = model, method, elastic, loads
        self.length, self.force = length, force
        self.forms = ContactForms(model, method)
        self._equations = model.function()
        self._fixed = model.fixed.ravel()[: elastic.owned]
        self._reactions = Reactions(model) if method.multiplier else None
        self._rows = (
            ~self._fixed
            if self._reactions is None
            else self._reactions.free.ravel()[: elastic.owned]
        )
        self._tangent = Tangent(self.forms, elastic, self._reactions, length, force)
        self._rest = self.vector()
        self._at: PETSc.Vec | None = None

    # -- as SNES needs it
    # -----------------------------------------------------------------------------------

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
        snes.setJacobian(self._renewed, self._tangent.matrix)
        snes.setUseEW(True, version=2, rtol_0=FORCING, rtol_max=FORCING, alpha=1.3, threshold=0.01)
        snes.setMaxLinearSolveFailures(2)
        self._tangent.prepare(snes.getKSP())
        snes.getKSP().setTolerances(atol=0.3 * TOLERANCE)

    def round_off(self, x: PETSc.Vec) -> float:
        """The norm of the scaled residual that counts as solved [-].

        It is bounded: a body that nothing holds moves so far that any residual would be
        round-off of its forces.
        """
        diagonal = self.elastic.matrix.getDiagonal()
        diagonal.pointwiseMult(diagonal, x)
        diagonal.array[self._fixed] = 0.0
        forces = diagonal.norm() * self.length / self.force
        diagonal.destroy()
        return max(TOLERANCE, min(ROUND_OFF * forces, FAR))

    def accurate(self, x: PETSc.Vec, tolerance: float) -> bool:
        """Whether the energy norm of the distance to the solution is below a tolerance [sqrt(force length)].

        The estimate by one cycle is too small where the contact is closed. If it is
        below the tolerance, a rough solve without the contact decides, where a weak
        glue holds a loose body.
        """
        if self.distance(x) > tolerance:
            return False
        weak, force, u = self.elastic.weak_glue(), self.vector(), self.vector()
        product = self.vector()
        self.function(None, x, force)

        def held(of: PETSc.Vec, y: PETSc.Vec) -> None:
            self.elastic.matrix.mult(of, y)
            product.pointwiseMult(weak, of)
            y.axpy(1.0, product)

        fgmres(held, self.elastic.cycle, force, u, ROUGH)
        energy = force.dot(u) * self.force**2
        for made in (weak, force, u, product):
            made.destroy()
        return energy <= tolerance**2

    def distance(self, x: PETSc.Vec) -> float:
        """Estimate the energy norm of the distance to the solution, about ``sqrt(R.K^-1 R)`` [sqrt(force length)]."""
        force, u = self.vector(), self.vector()
        self.function(None, x, force)
        self.elastic.cycle(force, u)
        energy = force.dot(u)
        force.destroy()
        u.destroy()
        return float(np.sqrt(max(energy, 0.0))) * self.force

    def least_singular_value(self, x: PETSc.Vec) -> float:
        """Estimate the least singular value of the tangent, scaled by the elastic diagonal [-]; zero if singular.

        It is one without friction, where solutions are unique as far as the body is
        held. Otherwise it is the lesser one of two tangents: at x, and, if this changes
        the contact status, at x pressed into the foundation by a tiny length. At points
        that touch without pressure the equations have a kink.
        """
        if all(contact.friction is None for contact in self.model.contacts):
            return 1.0
        pressed, before = x.copy(), self.status(x)[0]
        normals = self.model.function()
        for contact in self.model.contacts:
            contact.trace.assign(normals.x.array, contact.direction[:, None, :])
        pressed.array[self._rows] += PRESS * normals.x.array[: len(self._rows)][self._rows]
        found, u = [], self.vector()
        for state in [x] if self.status(pressed)[0] == before else [x, pressed]:
            self._set(state)
            self._tangent.assemble()
            found.append(self._tangent.least_singular_value(u))
        pressed.destroy()
        u.destroy()
        return min(found)

    def status(self, x: PETSc.Vec) -> tuple[bytes, tuple[int, int, int]]:
        """A key of the contact status of all points, and the numbers of open, slipping and sticking points."""
        self._set(x)
        found, comm = self.forms.status(), self.model.comm
        key = b"".join(comm.allgather(sha256(found.tobytes()).digest()))
        open_, slip, stick = (
            int(n) for n in comm.allreduce(np.bincount(found, minlength=3), MPI.SUM)
        )
        return key, (open_, slip, stick)

    def _renewed(self, _: Any, x: PETSc.Vec, *__: PETSc.Mat) -> None:
        """Assemble the tangent at x, and renew its hierarchy."""
        self._set(x)
        self._tangent.assemble()
        self._tangent.renew()

    # -- states
    # ---------------------------------------------------------------------------------------------

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
        if self._reactions is not None:
            shape = model.fixed.shape
            model.to_coefficients(u.array.reshape(shape), model.contacts)
            force = np.zeros(shape)
            force.ravel()[: len(self._rows)] = rest.array_r
            for multiplier, values in zip(
                self.forms.multipliers, self._reactions.multipliers(force), strict=True
            ):
                multiplier.x.array[:] = values.ravel()
        if self._at is None:
            self._at = x.copy()
        else:
            x.copy(self._at)

    def free(self) -> None:
        """Free PETSc's objects, which know this one: without it neither would be freed."""
        self._tangent.free()
        self._rest.destroy()
