"""Show versions and solvers, and check the package: ``python -m erc_contact``.

The check takes about a second, and some ten more the first time, when its forms are
compiled.
"""

from __future__ import annotations

import sys
from time import perf_counter

from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.admissible.equilibrate import equilibrate
from erc_contact.base.exceptions import InputError
from erc_contact.base.versions import versions
from erc_contact.error.constitutive import constitutive_error
from erc_contact.newton.solve import solve
from erc_contact.run.adapt import adapt
from erc_contact.scene.contact import Contact
from erc_contact.scene.material import Elastic
from erc_contact.scene.scene import Scene
from erc_contact.scene.support import Displacement
from namedmesh import rectangle
from namedmesh.gmsh_session import has_netgen, session
from namedmesh.pictures import lack_of_window

SOLVER_PACKAGES = {
    "mumps": "MUMPS (direct solver)",
    "hypre": "hypre (another multigrid)",
    "ptscotch": "PT-Scotch (partitions)",
}
"""Packages that PETSc may have, and their use; its own multigrid is always there."""
UNBALANCED_FORCE = 1e-9
"""Unbalanced force over the contact force that passes [-]."""
SOLVER_DIFFERENCE = 1e-7
"""Relative difference of eps between the two solvers that passes [-]."""


def self_check() -> dict[str, bool]:
    """Solve a small scene with both solvers; collective.

    Returns:
        Each property in words, and whether it holds.
    """
    block = rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))
    scene = Scene(
        Elastic(E=1.0, nu=0.3),
        [Displacement("top", (0.02, -0.05))],
        contacts=[Contact("bottom", friction=0.3)],
    )
    direct = constitutive_error(equilibrate(solve(scene, block, solver="direct")))
    iterative = constitutive_error(equilibrate(solve(scene, block, solver="iterative")))
    difference = abs(direct.relative - iterative.relative)
    same = difference < SOLVER_DIFFERENCE * direct.relative
    forces = direct.reactions()
    unbalanced = abs(forces["balance"].force).max()
    pressed = abs(forces["bottom"].force).max()
    balanced = bool(unbalanced < UNBALANCED_FORCE * pressed)
    history = adapt(scene, block, accuracy=0.02)
    cells = history.steps[-1].cells
    return {
        f"both solvers find eps {direct.relative:.4%}": same,
        "the forces are in balance": balanced,
        f"2% are reached on {cells} triangles": history.reached,
    }


def _netgen() -> str:
    """Tell whether gmsh has Netgen, on rank 0."""
    words = []
    try:
        with session(MPI.COMM_SELF, lambda gmsh: words.append(has_netgen(gmsh)), "gmsh"):
            return "yes" if words[0] else "no; take the wheel of gmsh: pip install gmsh"
    except InputError as reason:
        return f"no; {reason}"


def _pictures() -> str:
    """Tell whether bodies in 3D can be drawn, on rank 0."""
    try:
        import pyvista  # noqa: F401, PLC0415

        lack = lack_of_window()
    except ImportError as reason:
        lack = f"{reason}; pip install 'erc-contact[pictures]'"
    return f"no, {lack}" if lack else "yes"


def main() -> int:
    """Print all on rank 0, and return 0 if every check passes, 1 otherwise."""
    comm = MPI.COMM_WORLD
    lines = [f"{name:<12}{version}" for name, version in versions().items()]
    lines.append(f"{'ranks':<12}{comm.size}")
    for name, use in SOLVER_PACKAGES.items():
        available = "yes" if PETSc.Sys.hasExternalPackage(name) else "no"
        lines.append(f"{use}: {available}")
    if comm.rank == 0:
        lines.append(f"Netgen in gmsh (bodies meshed apart, in 3D): {_netgen()}")
        lines.append(f"pictures of bodies in 3D: {_pictures()}")
        print(*lines, sep="\n", flush=True)
    start = perf_counter()
    checks = self_check()
    seconds = perf_counter() - start
    passed = all(checks.values())
    if comm.rank == 0:
        for words, holds in checks.items():
            print(f"{'passed' if holds else 'FAILED'}: {words}")
        print(f"Self-check {'passed' if passed else 'FAILED'} in {seconds:.1f} s.")
    return int(not passed)


if __name__ == "__main__":
    sys.exit(main())
