"""Time what users bring beside the cube: layers, belts, rings, plastic bodies, CAD.

The columns are processor seconds, the lesser of two runs: of one linear elastic solve
as plain DOLFINx does it (assembly, LU by MUMPS), of the contact solve from a cold
start, of the admissible pair and of the error. The linear solve of the CAD assembly is
left out, as it has no glue.

    OMP_NUM_THREADS=1 python benchmarks/brought.py [name ...]
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled
from cost import linear_solve  # isort: skip
from namedmesh.gmsh_session import session  # isort: skip
from mpi4py import MPI  # isort: skip

Pair = tuple[ec.Scene, ec.Domain]
PRESSED = ec.Contact("bottom", friction=0.3)
"""A foundation with friction."""
ASSEMBLY = Path(gmsh.__file__).parents[3] / "share/doc/gmsh/examples/boolean/as1-tu-203.stp"
"""A bracket with bolts, of gmsh's examples."""


def cube() -> Pair:
    """Press and shear a cube."""
    top = ec.Displacement("top", (0.02, 0.01, -0.05))
    domain = ec.box((0.0,) * 3, (1.0,) * 3, cells=(11, 11, 11))
    return ec.Scene(
        ec.Elastic(1.0, 0.3), [top], contacts=[ec.Contact("bottom", friction=0.3)]
    ), domain


def two_cubes() -> Pair:
    """Press and shear a cube on a cube."""
    lower = ec.box((0.0,) * 3, (1.0, 1.0, 0.5), cells=(11, 11, 6))
    upper = ec.box((0.0, 0.0, 0.5), (1.0,) * 3, cells=(11, 11, 6))
    domain = ec.assembly({"lower": lower, "upper": upper}).joined("upper bottom", "lower top")
    held = ec.Displacement("lower bottom", (0.0,) * 3)
    top = ec.Displacement("upper top", (0.02, 0.01, -0.05))
    contact = ec.Contact("upper bottom", against="lower top", friction=0.3)
    return ec.Scene(ec.Elastic(1.0, 0.3), [held, top], contacts=[contact]), domain


def layer() -> Pair:
    """Press a layer of 400 x 2 on a foundation."""
    domain = ec.rectangle((0.0, 0.0), (400.0, 2.0), cells=(800, 4))
    load = ec.Traction("top", (lambda x: 0.1 * np.exp(-((x[0] / 4) ** 2)), -0.1))
    held = ec.Displacement("left", (0.0, None))
    contact = ec.Contact("bottom", friction=0.3)
    return ec.Scene(ec.Elastic(1e3, 0.3), [held], [load], [contact]), domain


def belt() -> Pair:
    """Let a drum turn below half of a belt."""
    radius, thickness, turn = 10.0, 0.2, 0.05

    def draw(model: object) -> None:
        occ = gmsh.model.occ
        outer, inner = (occ.addDisk(0, 0, 0, r, r) for r in (radius + thickness, radius))
        below = occ.addRectangle(-20, -20, 0, 40, 20)
        occ.cut([(2, outer)], [(2, inner), (2, below)])
        occ.synchronize()
        names = {}
        for _, curve in gmsh.model.getEntities(1):
            x, y, _ = occ.getCenterOfMass(1, curve)
            if abs(y) < 1e-6:
                names["right" if x > 0 else "left"] = curve
            else:
                top = gmsh.model.getBoundingBox(1, curve)[4]
                names["inner" if top < radius + thickness / 2 else "outer"] = curve
        for name, curve in names.items():
            gmsh.model.addPhysicalGroup(1, [curve], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", thickness / 2)

    with session(MPI.COMM_SELF, draw, "The belt") as model:
        domain = ec.from_gmsh(model, MPI.COMM_SELF)
    pulled = [ec.Displacement(end, (None, -0.02)) for end in ("left", "right")]
    drum = ec.Contact(
        "inner",
        friction=0.3,
        gap=lambda x: np.hypot(x[0], x[1]) - radius,
        normal="gap",
        motion=(lambda x: -turn * x[1], lambda x: turn * x[0]),
    )
    return ec.Scene(ec.Elastic(1e3, 0.3, hypothesis="plane stress"), pulled, (), [drum]), domain


def rough() -> Pair:
    """Press a plate on a foundation with grooves that the mesh does not resolve."""
    domain = ec.box((0.0,) * 3, (3.0, 3.0, 1.0), cells=(14, 14, 4))
    top = ec.Displacement("top", (0.0, 0.0, -0.004))
    grooves = ec.Contact("bottom", friction=0.3, gap=lambda x: 1e-3 * abs(np.sin(37 * x[0])) + 1e-4)
    return ec.Scene(ec.Elastic(1.0, 0.3), [top], contacts=[grooves]), domain


def ring() -> Pair:
    """Press a ring on a foundation."""
    domain = ec.rectangle((1.0, 0.0), (3.0, 1.0), cells=(80, 40))
    material = ec.Elastic(1.0, 0.3, hypothesis="axisymmetric")
    top = ec.Displacement("top", (None, -0.01))
    return ec.Scene(material, [top], contacts=[PRESSED]), domain


def plastic(scene: ec.Scene, hypothesis: str = "plane strain") -> ec.Scene:
    """Let most of a body yield, with a hardening of 5%."""
    law = ec.Plastic(E=1.0, nu=0.3, yield_stress=0.004, hardening=0.05, hypothesis=hypothesis)
    return replace(scene, material=law)


def plane() -> Pair:
    """Press a rectangle on a foundation."""
    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(80, 40))
    top = ec.Displacement("top", (0.0, -0.01))
    return ec.Scene(
        ec.Elastic(1.0, 0.3), [top], contacts=[ec.Contact("bottom", friction=0.3)]
    ), domain


def block() -> Pair:
    """Press a box on a foundation."""
    domain = ec.box((0.0,) * 3, (1.0,) * 3, cells=(7, 7, 7))
    top = ec.Displacement("top", (0.0, 0.0, -0.01))
    return ec.Scene(
        ec.Elastic(1.0, 0.3), [top], contacts=[ec.Contact("bottom", friction=0.3)]
    ), domain


def assembly() -> Pair:
    """Tighten the bolts and the rod of a bracket by heat."""
    base = {"base": ec.where(z=0.0, region="plate")}
    domain = ec.read_mesh(ASSEMBLY, size=50.0, parts=base)
    pressed = [("nut *", "plate"), ("nut *", "l-*"), ("bolt *", "l-*"), ("l-*", "plate")]
    pairs = [pair for names in pressed for pair in domain.touching(*names)]
    contacts = [ec.Contact(pair.facets, against=pair.against, friction=0.15) for pair in pairs]
    tight = {name: -5e-4 for name in domain.regions if name[:2] in ("bo", "ro")}
    ties = [ec.Tied(*pair) for pair in domain.touching("nut *", "[br]o*")]
    scene = ec.Scene(
        ec.Elastic(210e3, 0.3),
        [ec.Displacement("base", (0.0, 0.0, 0.0))],
        strains=[ec.Eigenstrain(tight)],
        ties=ties,
        contacts=contacts,
    )
    return scene, domain


BODIES: dict[str, Callable[[], Pair]] = {
    "cube": cube,
    "cube on cube": two_cubes,
    "layer of 400 x 2": layer,
    "belt on a drum": belt,
    "grooves in 3D": rough,
    "rectangle": plane,
    "rectangle, plastic": lambda: (plastic(plane()[0]), plane()[1]),
    "ring": ring,
    "ring, plastic": lambda: (plastic(ring()[0], "axisymmetric"), ring()[1]),
    "box": block,
    "box, plastic": lambda: (plastic(block()[0]), block()[1]),
    "CAD assembly": assembly,
}
"""Bodies in the order of the table, all of degree 2."""


def stages(scene: ec.Scene, domain: ec.Domain) -> tuple[np.ndarray, ec.ConstitutiveError]:
    """Time contact solve, pair and error [processor s]."""
    times = [process_time()]
    solution = ec.solve(scene, domain, degree=2)
    times.append(process_time())
    pair = ec.equilibrate(solution)
    times.append(process_time())
    error = ec.constitutive_error(pair)
    times.append(process_time())
    return np.diff(times), error


def main() -> None:
    """Print the table."""
    logging.disable(logging.CRITICAL)
    chosen = sys.argv[1:] or list(BODIES)
    print("| body, degree 2 | unknowns | linear solve | contact solve | pair | error | eps |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for name in chosen:
        scene, domain = BODIES[name]()
        # The first run compiles.
        stages(scene, domain)
        runs = [stages(scene, domain) for _ in range(2)]
        solve, pair, error_time = np.min([times for times, _ in runs], axis=0)
        error = runs[-1][1]
        space = error.model.space
        unknowns = space.V.dofmap.index_map.size_global * space.d
        linear = ""
        if BODIES[name] is not assembly:
            linear = f"{min(linear_solve(scene, domain, 2)[0] for _ in range(2)):.2f} s"
        times = " | ".join(f"{value:.2f} s" for value in (solve, pair, error_time))
        print(
            f"| {name} | {unknowns} | {linear} | {times} | {error.relative:.1%} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
