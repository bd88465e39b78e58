"""Measure the stages as multiples of one linear elastic solve of the same size.

In 2D the common block of several contact codes: (0, 2) x (0, 7), E = 1, nu = 0.3,
friction 0.3, pressed and sheared at its top, pushed at its right side, on n x 3.5 n
squares cut in two (n = 128: 115 842 degrees of freedom of degree 1). In 3D a cube
pressed and sheared at its top, with friction at its bottom, on n x n x n cubes cut in
six.

The unit is a first linear elastic solve as plain DOLFINx does it: assembly of the
stiffness, symbolic and numeric LU factorisation by MUMPS, one solve. Everything is
timed in one process; medians of several rounds. The memory is what a stage adds at its
peak to what the process has, beside what MUMPS says of its factor.

With ``--bodies 2`` the body is cut at half of its height: the same friction acts
between the two halves, and the bottom is held. It has as many contact nodes. The
multigrid cycles are summed over all linear solves of the contact solve.

    OMP_NUM_THREADS=1 python benchmarks/cost.py [--dim 2] [--n 128] [--degree 1]
    [--tighten 10] [--rounds 5] [--bodies 1] [--solver auto]
"""

import argparse
import resource
from time import perf_counter
from typing import Any

import numpy as np

import erc_contact as ec
from namedmesh.base.releases import cell_nodes

from dolfinx.fem import Function, petsc  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip
from petsc4py import PETSc  # isort: skip
from namedmesh.tags import tags_of  # isort: skip
from erc_contact.model.model import Model  # isort: skip
from erc_contact.newton import snes  # isort: skip
from erc_contact.newton.linear import krylov  # isort: skip


def problem(dim: int, n: int) -> tuple[ec.Scene, ec.Domain]:
    if dim == 3:
        scene = ec.Scene(
            material=ec.Elastic(E=1.0, nu=0.3),
            supports=[ec.Displacement("top", (0.02, 0.01, -0.05))],
            contacts=[ec.Contact("bottom", friction=0.3)],
        )
        return scene, ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(n, n, n))
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.1, -0.05))],
        loads=[ec.Traction("right", (-0.0002, 0.0))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    return scene, ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(n, 7 * n // 2))


def cut(scene: ec.Scene, domain: ec.Domain) -> tuple[ec.Scene, ec.Domain]:
    """Cut a body at about half of its height, with the contact there."""
    heights = domain.mesh.geometry.x[:, domain.dim - 1]
    # Vertices lie there, also where the number of layers is odd.
    cut_at = heights[abs(heights - 0.5 * domain.sides[-1]).argmin()]
    height = heights[cell_nodes(domain.mesh.geometry)].mean(axis=1)
    regions = np.where(height > cut_at, 1, 2).astype(np.int32)
    tags = tags_of(domain.mesh, domain.dim, np.arange(len(height)), regions)
    names = {"upper": 1, "lower": 2}
    whole = ec.Domain(domain.mesh, domain.facet_tags, domain.names, tags, names)
    supports = [*scene.supports, ec.Displacement("bottom", (0.0,) * domain.dim)]
    contact = ec.Contact("punch", against="block", friction=0.3)
    pair = ec.Scene(scene.material, supports, scene.loads, [contact])
    return pair, whole.split({"punch": "upper", "block": "lower"})


class Cycles:
    """Count the iterations of the linear solvers with multigrid."""

    def __init__(self) -> None:
        """Count from now on, in the modules that make these solvers."""
        self.count = 0
        counter = self

        class LinearSolver(PETSc.KSP):
            def destroy(self) -> Any:
                counter.count += self.getIterationNumber()
                return super().destroy()

        class NewtonSolver(PETSc.SNES):
            def destroy(self) -> Any:
                counter.count += self.getLinearSolveIterations()
                return super().destroy()

        class Counted:
            KSP = LinearSolver
            SNES = NewtonSolver

            def __getattr__(self, name: str) -> Any:
                return getattr(PETSc, name)

        krylov.PETSc = Counted()
        snes.PETSc = Counted()


def linear_solve(scene: ec.Scene, domain: ec.Domain, degree: int) -> tuple[float, float]:
    """Measure one linear elastic solve: seconds, and megabytes of the factor.

    The seconds are spent in assembly and MUMPS (LU).

    The contact is held by nothing but the stiffness.
    """
    model = Model(scene, domain, degree)
    space = model.space
    u, v = ufl.TrialFunction(space.V), ufl.TestFunction(space.V)
    loads = model.loads(v)
    if loads is None:
        loads = ufl.inner(Function(space.V), v) * ufl.dx
    options = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}
    began = perf_counter()
    linear = petsc.LinearProblem(
        model.stiffness(u, v),
        loads,
        u=Function(space.V),
        bcs=model.bcs,
        petsc_options_prefix="linear_",
        petsc_options=options,
    )
    linear.solve()
    seconds = perf_counter() - began
    return seconds, float(linear.solver.getPC().getFactorMatrix().getMumpsInfog(22))


def peak() -> float:
    """Return the largest memory of the process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser()
    for name, value in (("dim", 2), ("n", 128), ("degree", 1), ("tighten", 10), ("rounds", 5)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--bodies", type=int, default=1, choices=(1, 2))
    parser.add_argument("--solver", default="auto")
    options = parser.parse_args()
    scene, domain = problem(options.dim, options.n)
    if options.bodies == 2:
        scene, domain = cut(scene, domain)
    cycles = Cycles()
    rows = []
    for number in range(options.rounds + 1):
        linear, factor = linear_solve(scene, domain, options.degree)
        how = {"degree": options.degree, "solver": options.solver}
        loose = ec.equilibrate(ec.solve(scene, domain, **how), tighten=0)
        cycles.count = 0
        solution = ec.solve(scene, domain, **how)
        counted = cycles.count
        admissible = ec.equilibrate(
            solution, tighten=options.tighten
        )  # each with the factor that its solve made
        error = ec.constitutive_error(admissible)
        if number > 0:  # the first round compiles forms
            rows.append(
                (linear, solution.seconds, loose.seconds, admissible.seconds, error.seconds)
            )
    linear, *stages = np.median(rows, axis=0)
    unknowns = solution.model.space.V.dofmap.index_map.size_global * domain.dim
    print(
        f"{unknowns} degrees of freedom, {domain.cells} cells, "
        f"{solution.newton_steps} Newton steps, {counted} multigrid cycles,"
    )
    print(f"eps = {error.relative:.3%} after {admissible.tightening} steps of tightening;")
    print(
        f"medians of {options.rounds} rounds, one linear solve = {linear:.2f} s; "
        f"its factor {factor:.0f} MB"
    )
    names = ("contact solve", "admissible pair, loose", "admissible pair, tightened", "error")
    print(f"{'stage':<28}{'seconds':>9}{'linear solves':>15}{'microseconds a cell':>21}")
    for name, seconds in zip(names, stages, strict=True):
        print(
            f"{name:<28}{seconds:9.2f}{seconds / linear:15.2f}{seconds / domain.cells * 1e6:21.1f}"
        )
    after = stages[2] + stages[3]
    print(
        f"{'tightened pair and error':<28}{after:9.2f}{after / linear:15.2f}"
        f"{after / domain.cells * 1e6:21.1f}"
    )


if __name__ == "__main__":
    main()
