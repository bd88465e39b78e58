"""``python -m erc_contact``: versions, the solvers that PETSc has, and a check that the package works here.

The check takes about a second, and some ten more the first time, when its forms are
compiled.
"""

from __future__ import annotations

import sys
from time import perf_counter

from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.admissible.pair import equilibrate
from erc_contact.base.versions import versions
from erc_contact.error.constitutive import constitutive_error
from erc_contact.mesh.sources import rectangle
from erc_contact.newton.solve import solve
from erc_contact.run.adapt import adapt
from erc_contact.scene.contact import Contact
from erc_contact.scene.material import Elastic
from erc_contact.scene.scene import Scene
from erc_contact.scene.support import Displacement

SOLVERS = {
    "mumps": "MUMPS (direct solver)",
    "hypre": "hypre (another multigrid)",
    "ptscotch": "PT-Scotch (partitions)",
}
"""Packages that PETSc may have, and what they are for; its own multigrid, GAMG, is always there."""
BALANCE, SAME = 1e-9, 1e-7
"""Unbalanced force over the contact force, and difference of eps between the two solvers, that pass [-]."""


def self_check() -> dict[str, bool]:
    """Solve a small scene with both solvers; collective. Each property by its name, and whether it holds."""
    material, moved = Elastic(E=1.0, nu=0.3), Displacement("top", (0.02, -0.05))
    scene = Scene(material, [moved], contacts=[Contact("bottom", friction=0.3)])
    block = rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))
    found = {}
    for solver in ("direct", "iterative"):
        solution = solve(scene, block, solver=solver)
        found[solver] = constitutive_error(equilibrate(solution))
    error, other = found.values()
    forces = error.reactions()
    rest, pressed = abs(forces["balance"].force).max(), abs(forces["bottom"].force).max()
    history = adapt(scene, block, accuracy=0.02)
    return {
        f"both solvers find eps {error.relative:.4%}": abs(error.relative - other.relative)
        < SAME * error.relative,
        "the forces are in balance": bool(rest < BALANCE * pressed),
        f"2% are reached on {history.steps[-1].cells} triangles": history.reached,
    }


def main() -> int:
    """Print all, on rank 0. Returns 0 if every check passes, 1 otherwise."""
    comm = MPI.COMM_WORLD
    lines = [f"{name:<12}{version}" for name, version in versions().items()]
    lines += [f"{'ranks':<12}{comm.size}"]
    lines += [
        f"{what}: {'yes' if PETSc.Sys.hasExternalPackage(name) else 'no'}"
        for name, what in SOLVERS.items()
    ]
    if comm.rank == 0:
        print(*lines, sep="\n", flush=True)
    began = perf_counter()
    checks = self_check()
    if comm.rank == 0:
        print(
            *(f"{'passed' if good else 'FAILED'}: {what}" for what, good in checks.items()),
            sep="\n",
        )
        print(
            f"Self-check {'passed' if all(checks.values()) else 'FAILED'} in {perf_counter() - began:.1f} s."
        )
    return int(not all(checks.values()))


if __name__ == "__main__":
    sys.exit(main())
