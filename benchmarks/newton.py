"""Measure the contact solve as multiples of a linear elastic solve.

For both methods, the whole solve and one Newton step.

The common block of several contact codes: (0, 2) x (0, 7), E = 1, nu = 0.3, friction
0.3, pressed and sheared at its top, pushed at its right side, on n x 3.5 n squares cut
in two (n = 128: 115 842 degrees of freedom).

The units are what plain DOLFINx does: a first linear elastic solve (assembly, symbolic
and numeric LU factorisation by MUMPS, one solve), and a second one on the same pattern
(assembly, numeric factorisation, solve), which is what a Newton step of the whole body
costs. A Newton step here is the whole contact solve over its steps. Everything is timed
in one process; medians of several rounds. The forces and the numbers of open, sticking
and slipping nodes are counted in the solution.

    OMP_NUM_THREADS=1 python benchmarks/newton.py [n] [rounds]
"""

import sys
from time import perf_counter

import numpy as np

import erc_contact as ec

from cost import problem  # isort: skip - after erc_contact, which loads MPI first
from dolfinx import fem  # isort: skip
from dolfinx.fem import petsc  # isort: skip
from petsc4py import PETSc  # isort: skip
import ufl  # isort: skip
from erc_contact.model.model import Model  # isort: skip


def linear_solves(scene: ec.Scene, domain: ec.Domain) -> tuple[float, float]:
    """Measure a first linear elastic solve, and a second one on its pattern [s]."""
    model = Model(scene, domain)
    space = model.space
    began = perf_counter()
    form = fem.form(model.stiffness(ufl.TrialFunction(space.V), ufl.TestFunction(space.V)))
    matrix = petsc.create_matrix(form)
    ksp = PETSc.KSP().create(space.comm)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    ksp.getPC().setType("lu")
    ksp.getPC().setFactorSolverType("mumps")
    seconds = []
    for _ in range(2):
        matrix.zeroEntries()
        petsc.assemble_matrix(matrix, form, bcs=model.bcs)
        matrix.assemble()
        b, x = matrix.createVecs()
        b.set(1.0)
        ksp.setOperators(matrix)
        ksp.solve(b, x)
        seconds.append(perf_counter() - began)
        began = perf_counter()
    ksp.destroy()
    matrix.destroy()
    return seconds[0], seconds[1]


def forces(solution: ec.Solution) -> tuple[np.ndarray, list[int]]:
    """Compute the resultant of the method's traction, and the status of the nodes.

    They are the numbers of nodes that are open, stick and slip.
    """
    contact = solution.model.contacts[0]
    traction, ds = solution.traction(contact), contact.ds(metadata={"quadrature_degree": 4})
    force = np.array([fem.assemble_scalar(fem.form(traction[i] * ds)) for i in range(2)])
    nodal = ec.equilibrate(solution).tractions[0]
    nodes = nodal.nodes.ravel()
    pressure = np.bincount(nodes, -nodal.normal_component.ravel())[np.unique(nodes)]
    shear = abs(np.bincount(nodes, nodal.tangential_part[..., 0].ravel()))[np.unique(nodes)]
    is_open = pressure <= 1e-9 * pressure.max()
    slips = ~is_open & (shear >= 0.3 * pressure * (1 - 1e-6))
    return force, [int(is_open.sum()), int((~is_open & ~slips).sum()), int(slips.sum())]


def main() -> None:
    n, rounds = (int(a) for a in (sys.argv[1:] + ["128", "5"][len(sys.argv) - 1 :]))
    scene, domain = problem(2, n)
    methods = (ec.Nitsche(), ec.AugmentedLagrangian())
    rows = []
    for number in range(rounds + 1):
        linear = linear_solves(scene, domain)
        solutions = [ec.solve(scene, domain, method) for method in methods]
        if number > 0:  # the first round compiles forms
            rows.append((*linear, *(solution.seconds for solution in solutions)))
    first, again, *seconds = np.median(rows, axis=0)
    print(f"{2 * domain.vertices} degrees of freedom; medians of {rounds} rounds")
    print(f"linear elastic solve: first {first:.2f} s, again on the same pattern {again:.2f} s")
    print(
        f"{'method':<42}{'seconds':>8}{'first solves':>14}{'steps':>7}{'step / again':>14}"
        "  force, open/stick/slip"
    )
    for method, solution, time in zip(methods, solutions, seconds, strict=True):
        force, zones = forces(solution)
        step = time / solution.newton_steps / again
        print(
            f"{method!s:<42}{time:8.2f}{time / first:14.2f}{solution.newton_steps:7d}{step:14.2f}  "
            f"({force[0]:.6f}, {force[1]:.6f}), {'/'.join(map(str, zones))}"
        )


if __name__ == "__main__":
    main()
