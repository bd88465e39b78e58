"""Cost of the stages, as multiples of one linear elastic solve of the same size.

The common block of several contact codes: (0, 2) x (0, 7), E = 1, nu = 0.3, friction 0.3, pressed and sheared at its
top, pushed at its right side, on n x 3.5 n squares cut in two (n = 128: 115 842 degrees of freedom).

The unit is a first linear elastic solve as plain DOLFINx does it: assembly of the stiffness, symbolic and numeric LU
factorisation by MUMPS, one solve. Everything is timed in one process; medians of several rounds.

    OMP_NUM_THREADS=1 python benchmarks/cost.py [n] [rounds]
"""

import sys
from time import perf_counter

import numpy as np

import erc_contact as ec

from dolfinx.fem import Function, petsc  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip
from erc_contact.model import Model  # isort: skip


def scene() -> ec.Scene:
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.1, -0.05))],
        loads=[ec.Traction("right", (-0.0002, 0.0))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )


def linear_solve(domain: ec.Domain) -> float:
    """Seconds of one linear elastic solve: assembly and MUMPS (LU), with the bottom held by nothing but stiffness."""
    model = Model(scene(), domain)
    u, v = ufl.TrialFunction(model.V), ufl.TestFunction(model.V)
    options = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}
    began = perf_counter()
    problem = petsc.LinearProblem(
        model.stiffness(u, v),
        model.loads(v),
        u=Function(model.V),
        bcs=model.bcs,
        petsc_options_prefix="linear_",
        petsc_options=options,
    )
    problem.solve()
    return perf_counter() - began


def main() -> None:
    n, rounds = (int(a) for a in (sys.argv[1:] + ["128", "5"][len(sys.argv) - 1 :]))
    domain = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(n, 7 * n // 2))
    rows = []
    for number in range(rounds + 1):
        linear = linear_solve(domain)
        solution = ec.solve(scene(), domain)
        admissible = ec.equilibrate(solution)
        error = ec.constitutive_error(admissible)
        if number > 0:  # the first round compiles forms
            rows.append((linear, solution.seconds, admissible.seconds, error.seconds))
    linear, *stages = np.median(rows, axis=0)
    print(f"{2 * domain.vertices} degrees of freedom, {domain.cells} cells, {solution.newton_steps} Newton steps,")
    print(f"eps = {error.relative:.3%}; medians of {rounds} rounds, one linear solve = {linear:.2f} s")
    print(f"{'stage':<28}{'seconds':>9}{'linear solves':>15}")
    for name, seconds in zip(("contact solve", "admissible pair", "error"), stages, strict=True):
        print(f"{name:<28}{seconds:9.2f}{seconds / linear:15.2f}")
    after = stages[1] + stages[2]
    print(f"{'all after the contact solve':<28}{after:9.2f}{after / linear:15.2f}")


if __name__ == "__main__":
    main()
