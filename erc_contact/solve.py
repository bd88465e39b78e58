"""One contact solve: PETSc SNES from a first guess to a :class:`Solution`, or :class:`NotConverged`.

The nonlinear solver works in scaled variables, displacements by the size of the first guess and forces by its
internal forces: the bisection line search has absolute tolerances inside and would depend on units.

Symbols: R residual, u displacement, K elastic stiffness.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fp
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.domain import Domain
from erc_contact.exceptions import NotConverged
from erc_contact.methods import Nitsche, glued
from erc_contact.model import Model
from erc_contact.scene import Scene

log = logging.getLogger("erc_contact")

PREFIX = "erc_contact_"
"""Prefix of PETSc options: a user's ``-erc_contact_snes_monitor`` and the like win over our settings."""
TOLERANCE = 1e-10
"""Newton stops when the residual is below this fraction of the internal forces [-]."""
STEPS = 40
"""Limit of Newton steps of one attempt."""
LAG, LARGE = 3, 20_000
"""From LARGE degrees of freedom on, the tangent is factorised anew every LAG Newton steps only; between, the old factor
preconditions GMRES.

Far from the solution a step need not be exact (Eisenstat, Walker): the common block at 115 842 degrees of freedom takes
11 steps either way, in 0.7 of the time of 11 factorisations. Small problems gain nothing and end at round-off.
"""
FRICTION_STEPS = (0.0, 0.3, 0.6, 0.8, 1.0)
"""Shares of the friction coefficient when friction is raised in steps."""


@dataclass(frozen=True, eq=False)
class Solution:
    """A converged displacement with all that it came from.

    Attributes:
        model: The scene on its domain, with forms.
        method: The contact method.
        u: Displacement [length], a continuous P1 Function.
        newton_steps: Newton steps of all attempts together; 0 for a scene without contact.
        reason: How the solver ended, and from which start.
        seconds: Wall time, the largest over the ranks [s].
    """

    model: Model
    method: Nitsche
    u: fem.Function
    newton_steps: int
    reason: str
    seconds: float

    @property
    def domain(self) -> Domain:
        """The mesh with names."""
        return self.model.domain

    @property
    def scene(self) -> Scene:
        """What the user declared."""
        return self.model.scene


def solve(scene: Scene, domain: Domain, method: Nitsche | None = None, *, start: Solution | None = None) -> Solution:
    """Solve a scene on a domain; collective.

    A scene without contact is one linear solve. Otherwise Newton starts from ``start`` if given, else from the linear
    problem with the contact glued; line search by bisection. Further attempts raise friction in steps and use
    the line search ``nleqerr``.

    Args:
        scene: The problem.
        domain: The mesh.
        method: Contact method; ``Nitsche()`` by default.
        start: A solution on another mesh of the same body, interpolated as first guess.

    Returns:
        The solution.

    Raises:
        InputError: If scene and domain do not fit.
        NotConverged: If no attempt converged.
    """
    began = perf_counter()
    method = method or Nitsche()
    model = Model(scene, domain)
    u = fem.Function(model.V, name="displacement")
    if model.contacts:
        steps, reason = _newton(model, method, u, start)
    else:
        stiffness = Stiffness(model)
        u.x.array[:] = stiffness.solve(stiffness.load_vector()).x.array
        stiffness.destroy()
        steps, reason = 0, "linear solve"
    seconds = model.comm.allreduce(perf_counter() - began, MPI.MAX)
    log.debug("solved %d cells: %s, %d Newton steps, %.2f s", domain.cells, reason, steps, seconds)
    return Solution(model, method, u, steps, reason, seconds)


def interpolate(source: Solution, V: fem.FunctionSpace) -> fem.Function:
    """Interpolate a displacement on another mesh of the same body, matching or not; collective."""
    target = fem.Function(V)
    owned = V.mesh.topology.index_map(V.mesh.topology.dim)
    cells = np.arange(owned.size_local + owned.num_ghosts, dtype=np.int32)
    padding = 1e-8 * source.domain.size
    data = fem.create_interpolation_data(V, source.u.function_space, cells, padding=padding)
    target.interpolate_nonmatching(source.u, cells, interpolation_data=data)
    target.x.scatter_forward()
    return target


class Stiffness:
    """The elastic stiffness with the supports, factorised once (Cholesky by MUMPS).

    Rigid motions that no support holds are pinned at single degrees of freedom; a load that balances on them
    gives the right stress, whatever the pin. :meth:`destroy` frees the factor.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        u, v = ufl.TrialFunction(model.V), ufl.TestFunction(model.V)
        self.form = fem.form(model.stiffness(u, v))
        self.bcs = [*model.bcs, *_pins(model)]
        self.matrix = fp.assemble_matrix(self.form, bcs=self.bcs)
        self.matrix.assemble()
        self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        self.ksp = PETSc.KSP().create(model.comm)
        self.ksp.setOperators(self.matrix)
        self.ksp.setType("preonly")
        self.ksp.getPC().setType("cholesky")
        self.ksp.getPC().setFactorSolverType("mumps")

    def load_vector(self) -> fem.Function:
        """Assemble the loads of the scene as a Function of nodal forces (not yet summed over ranks)."""
        b = fem.Function(self.model.V)
        loads = self.model.loads(ufl.TestFunction(self.model.V))
        if loads is not None:
            fem.assemble_vector(b.x.array, fem.form(loads))
        return b

    def solve(self, b: fem.Function) -> fem.Function:
        """Displacement under nodal forces b [force], whose ghost contributions are added up here."""
        model = self.model
        vector = fp.create_vector(model.V)
        with vector.localForm() as local:
            local.array[:] = b.x.array
        fp.apply_lifting(vector, [self.form], bcs=[self.bcs])
        vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        fp.set_bc(vector, self.bcs)
        u = fem.Function(model.V)
        x = vector.duplicate()
        self.ksp.solve(vector, x)
        u.x.array[: len(x.array)] = x.array
        u.x.scatter_forward()
        x.destroy()
        vector.destroy()
        return u

    def destroy(self) -> None:
        """Free the matrix and its factor."""
        self.ksp.destroy()
        self.matrix.destroy()


def _pins(model: Model) -> list[Any]:
    """Dirichlet conditions at single degrees of freedom, one for each free rigid motion, chosen by pivoting."""
    if not model.free_motions:
        return []
    owned = model.V.dofmap.index_map.size_local * model.d
    rows = np.column_stack([m.x.array[:owned] for m in model.free_motions])
    rows[model.fixed.ravel()[:owned]] = 0.0
    offset = model.V.dofmap.index_map.local_range[0] * model.d
    chosen: list[int] = []
    for _ in range(rows.shape[1]):
        size = np.linalg.norm(rows, axis=1)
        best = int(size.argmax()) if len(size) else -1
        candidates = model.comm.allgather(
            (float(size[best]), rows[best], offset + best) if best >= 0 else (0.0, None, 0)
        )
        _, row, dof = max(candidates, key=lambda c: c[0])
        chosen.append(dof)
        unit = row / np.linalg.norm(row)
        rows -= np.outer(rows @ unit, unit)
    pins = []
    for component in range(model.d):
        scalar, to_vector = model.V.sub(component).collapse()
        to_vector = np.asarray(to_vector).ravel()
        blocks = model.V.dofmap.index_map.local_to_global((to_vector // model.d).astype(np.int32))
        at = np.flatnonzero(np.isin(blocks * model.d + component, chosen)).astype(np.int32)
        zero = fem.Function(scalar)
        pins.append(fem.dirichletbc(zero, [to_vector[at].astype(np.int32), at], model.V.sub(component)))
    return pins


class _Newton:
    """Residual and tangent in scaled variables for SNES, and the glued linear problem on the same matrix."""

    def __init__(self, model: Model, method: Nitsche, u: fem.Function) -> None:
        self.model, self.u = model, u
        v, du = ufl.TestFunction(model.V), ufl.TrialFunction(model.V)
        residual = method.equations(model, u, v)
        held = method.equations(model, u, v, law=glued)
        self.residual = fem.form(residual)
        self.tangent = fem.form(ufl.derivative(residual, u, du))
        self.held = fem.form(held)
        self.held_tangent = fem.form(ufl.derivative(held, u, du))
        self.internal = fem.form(model.stiffness(u, v))
        self.matrix = fp.create_matrix(self.tangent)
        self.vector = fp.create_vector(model.V)
        self.length = self.force = 1.0
        owned = model.V.dofmap.index_map.size_local
        self.fixed = np.flatnonzero(model.fixed[:owned])

    def assemble(self, form: fem.Form, vector: PETSc.Vec) -> None:
        with vector.localForm() as local:
            local.set(0.0)
        fp.assemble_vector(vector, form)
        vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)

    def function(self, _: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        self.update(x)
        self.assemble(self.residual, f)
        f.array[self.fixed] = 0.0
        f.scale(1.0 / self.force)

    def jacobian(self, _: PETSc.SNES, x: PETSc.Vec, __: PETSc.Mat, matrix: PETSc.Mat) -> None:
        self.update(x)
        matrix.zeroEntries()
        fp.assemble_matrix(matrix, self.tangent, bcs=self.model.bcs)
        matrix.assemble()
        matrix.scale(self.length / self.force)

    def update(self, x: PETSc.Vec) -> None:
        values = x.array_r
        self.u.x.array[: len(values)] = self.length * values
        self.u.x.scatter_forward()

    def prescribe(self) -> None:
        """Give u the prescribed values of the supports."""
        fixed = self.model.fixed.ravel()
        self.u.x.array[fixed] = self.model.prescribed.x.array[fixed]

    def glue(self, ksp: PETSc.KSP) -> None:
        """Solve the linear problem with the contact glued from the present u."""
        self.assemble(self.held, self.vector)
        self.vector.array[self.fixed] = 0.0
        self.matrix.zeroEntries()
        fp.assemble_matrix(self.matrix, self.held_tangent, bcs=self.model.bcs)
        self.matrix.assemble()
        ksp.setOperators(self.matrix)
        step = self.vector.duplicate()
        ksp.solve(self.vector, step)
        self.u.x.array[: len(step.array)] -= step.array
        self.u.x.scatter_forward()
        step.destroy()

    def rescale(self) -> None:
        """Scale displacements by the present u, forces by its internal forces."""
        local = float(abs(self.u.x.array).max(initial=0.0))
        self.length = self.model.comm.allreduce(local, MPI.MAX) or 1.0
        self.assemble(self.internal, self.vector)
        self.force = self.vector.norm() or 1.0

    def destroy(self) -> None:
        self.matrix.destroy()
        self.vector.destroy()


def _set_from_options(snes: PETSc.SNES, lag: int) -> None:
    """Let the user's PETSc options win; the lag has no setter, so ours passes through the database and leaves it."""
    options, key = PETSc.Options(PREFIX), "snes_lag_preconditioner"
    ours = not options.hasName(key)
    if ours:
        options[key] = lag
    snes.setFromOptions()
    if ours:
        options.delValue(key)


@dataclass(frozen=True)
class _Rung:
    """One attempt: where Newton starts (None: from the glued contact), its line search, the steps of friction."""

    start: Solution | None
    line_search: str
    friction_shares: tuple[float, ...] = (1.0,)

    def __str__(self) -> str:
        text = f"{'glued start' if self.start is None else 'previous solution'}, {self.line_search}"
        return text if len(self.friction_shares) == 1 else f"{text}, friction in {len(self.friction_shares)} steps"


def _ladder(start: Solution | None, friction: bool) -> list[_Rung]:
    """The attempts, cheapest first.

    Without a gap the problem is positively homogeneous, so steps of the load are all the same problem; friction
    is raised in steps instead.
    """
    rungs = [] if start is None else [_Rung(start, "bisection")]
    rungs.append(_Rung(None, "bisection"))
    if friction:
        rungs.append(_Rung(None, "bisection", FRICTION_STEPS))
    return [*rungs, _Rung(None, "nleqerr")]


def _newton(model: Model, method: Nitsche, u: fem.Function, start: Solution | None) -> tuple[int, str]:
    """Try the rungs of the ladder one after the other; u holds the solution of the first that converges."""
    problem = _Newton(model, method, u)
    snes = PETSc.SNES().create(model.comm)
    snes.setOptionsPrefix(PREFIX)
    value = problem.vector.duplicate()
    snes.setFunction(problem.function, value)
    snes.setJacobian(problem.jacobian, problem.matrix)
    snes.setType("newtonls")
    snes.setTolerances(rtol=0.0, atol=TOLERANCE, stol=0.0, max_it=STEPS)
    snes.setUseEW(True, rtol_0=0.1, rtol_max=0.1)
    ksp = snes.getKSP()
    ksp.setType("gmres")
    ksp.getPC().setType("lu")
    ksp.getPC().setFactorSolverType("mumps")

    tried: list[str] = []
    steps = 0
    try:
        for rung in _ladder(start, any(c.friction is not None for c in model.contacts)):
            u.x.array[:] = 0.0 if rung.start is None else interpolate(rung.start, model.V).x.array
            problem.prescribe()
            if rung.start is None:
                problem.glue(ksp)
            problem.rescale()
            snes.getLineSearch().setType(rung.line_search)
            _set_from_options(snes, LAG if problem.vector.getSize() > LARGE else 1)
            for share in rung.friction_shares:
                model.friction_share.value = share
                x = problem.vector.duplicate()
                x.array[:] = u.x.array[: x.getLocalSize()] / problem.length
                snes.solve(None, x)
                problem.update(x)
                x.destroy()
                steps += snes.getIterationNumber()
                reason, norm = snes.getConvergedReason(), snes.getFunctionNorm()
                if reason <= 0 or not np.isfinite(norm):
                    break
            tried.append(f"{rung}: {PETSC_REASONS.get(reason, reason)}, residual {norm:.1e}, {steps} steps in all")
            log.debug(tried[-1])
            if reason > 0 and np.isfinite(norm):
                return steps, f"{rung}: {PETSC_REASONS.get(reason, reason)}"
    finally:
        model.friction_share.value = 1.0
        for resource in (snes, value, problem):
            resource.destroy()
    raise NotConverged(
        f"The contact solve did not converge on {model.domain.cells} cells with {method}. Tried: {'; '.join(tried)}. "
        "Try another theta or gamma (1 to 1000), a finer mesh at the contact, or less friction; look whether the "
        "loads let the contact hold the body.",
        tuple(tried),
    )


PETSC_REASONS = {
    value: name.lower() for name, value in vars(PETSc.SNES.ConvergedReason).items() if isinstance(value, int)
}
"""Names of PETSc's reasons."""
