"""Attack adaptive runs of plates with a round hole: ranks, nested meshes, memory.

Each plate runs through `adapt` on 1, 2, 3 and 5 ranks, as many as there are:

- cells: runs whose numbers of cells differ from those on one rank; none may;
- eps: the largest relative difference of eps from one rank, over all meshes;
- energy: pairs of meshes of a run whose intervals of the potential energy do not
  intersect. None may where both are proved, as they are of a body that is known as a
  mesh with flat facets, under a linear gap. Estimates are counted apart: with a contact
  on the hole the foundation is another polyhedron on each mesh. With Coulomb friction
  the energy is another one on each mesh; such runs are left out;
- factor: meshes on which an exception inside ``with stiffness.in_memory()`` leaves the
  factor in memory; none may.

    OMP_NUM_THREADS=1 mpiexec -n 5 python benchmarks/attack_plates.py [seed] [count]
"""

from __future__ import annotations

import logging
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any

from mpi4py import MPI

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip
from attack_families import Sample, friction_along, random_modulus, scene_generator

from tasks import on_ranks, tell  # isort: skip

COUNTS = (1, 2, 3, 5)
"""Numbers of ranks."""
MESHES = 4
"""Meshes of a run."""
CELLS = 4000
"""Cells above which a run ends."""
SAME = 1e-8
"""Relative difference of eps that counts as none [-]."""
ROUND_OFF = 1e-10
"""Share of an energy by which intervals may miss each other."""


@dataclass(frozen=True)
class PlateRun:
    """Hold what is compared of a run.

    Attributes:
        cells: Numbers of cells of its meshes.
        eps: Relative errors.
        energies: Intervals of the potential energy [force length].
        held: Number of meshes whose factor an exception left in memory.
        ending: What ended the run.
    """

    cells: tuple[int, ...]
    eps: tuple[float, ...]
    energies: tuple[ec.Bounds, ...]
    held: int
    ending: str


def random_plate(rng: np.random.Generator, comm: MPI.Comm = MPI.COMM_WORLD) -> Sample:
    """Make a plate 1 high with a round hole, in contact on the hole or on a side.

    Size and place of the hole, modulus, friction, gap, loads and degree are random.
    Friction is none, Tresca's or Coulomb's, constant or varying.
    """
    width = float(rng.uniform(1.0, 2.0))
    radius = float(rng.uniform(0.12, 0.3))
    centre = (float(rng.uniform(0.4, 0.6)) * width, float(rng.uniform(0.45, 0.55)))
    size = float(rng.uniform(0.12, 0.3))
    law = str(rng.choice(["constant", "linear", "exponential", "jump"]))
    material = ec.Elastic(random_modulus(rng, law, width), float(rng.uniform(0.0, 0.45)))
    friction, kind = _random_friction(rng, width)
    degree = int(rng.integers(1, 3))
    part = str(rng.choice(["hole", "bottom"]))
    push, press = float(rng.uniform(-0.01, 0.01)), float(rng.uniform(0.005, 0.03))
    clearance = float(rng.choice([0.0, rng.uniform(-0.002, 0.004)]))
    shift = float(rng.uniform(0.0, 0.02))
    linear, polygon = (bool(choice) for choice in rng.integers(0, 2, 2))
    loads: list[Any]
    if part == "hole":
        # A pin in the hole that is a little smaller, and to one side of its centre.
        supports = [ec.Displacement("left", (0.0, 0.0))]
        loads = [ec.Traction("right", (press, push))]
        normal: Any = lambda x: (centre[0] - x[0], centre[1] - x[1])  # noqa: E731
    else:
        supports = [ec.Displacement("top", (push, -press))]
        loads = [ec.Traction("hole", pressure=0.2 * press)]
        normal = (0.0, -1.0)

    def gap(x: Any) -> Any:
        along = x[0] - centre[0]
        return clearance + shift * (along if linear else 1 - ufl.cos(3 * along))

    contact = ec.Contact(part, friction=friction, gap=gap, normal=normal)
    scene = ec.Scene(material, supports, loads, [contact])
    domain = plate(width, centre, radius, size, comm)
    if polygon:
        domain = ec.Domain(domain.mesh, domain.facet_tags, domain.names)
    shape = "polygon" if polygon else "circle"
    name = f"{shape}, contact on {part}, E {law}, friction {kind}, degree {degree}"
    return Sample(name, scene, domain, degree)


def _random_friction(rng: np.random.Generator, width: float) -> tuple[Any, str]:
    """Make friction: none, Tresca's or Coulomb's, and return its name with it."""
    kind = str(rng.choice(["none", "Tresca", "Coulomb"]))
    varying = friction_along(rng, width, 0.8)
    limit = float(rng.uniform(0.0, 0.005))
    return {"none": 0.0, "Tresca": ec.Tresca(limit), "Coulomb": varying}[kind], kind


def plate(
    width: float, centre: tuple[float, float], radius: float, size: float, comm: MPI.Comm
) -> ec.Domain:
    """Make a plate with a round hole by gmsh, whose true shape the meshes follow.

    Its parts are left, right, bottom, top and hole.
    """
    import gmsh  # noqa: PLC0415 - only these scenes need it

    if comm.rank == 0:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        whole = occ.addRectangle(0, 0, 0, width, 1)
        occ.cut([(2, whole)], [(2, occ.addDisk(*centre, 0, radius, radius))])
        occ.synchronize()
        for _, curve in gmsh.model.getEntities(1):
            x, y, _ = occ.getCenterOfMass(1, curve)
            sides = {"left": x, "right": width - x, "bottom": y, "top": 1 - y}
            name = next((side for side, far in sides.items() if abs(far) < 1e-9), "hole")
            gmsh.model.addPhysicalGroup(1, [curve], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    domain = ec.from_gmsh(gmsh.model if comm.rank == 0 else None, comm)
    if comm.rank == 0:
        gmsh.finalize()
    return domain


def run_of(seed: int, number: int, comm: MPI.Comm) -> PlateRun:
    """Run a plate on the ranks of a communicator; collective there."""
    sample = random_plate(scene_generator(seed, number), comm)
    energies = []
    held = 0

    def look(error: ec.ConstitutiveError, _step: ec.Step) -> None:
        nonlocal held
        energies.append(ec.potential_energy(error))
        held += factor_is_held(error.solution)

    run = partial(ec.adapt, sample.scene, sample.domain, 1e-6, degree=sample.degree)
    try:
        history = run(max_steps=MESHES, max_cells=CELLS, callback=look)
    except ec.ErcContactError as reason:
        return PlateRun((), (), (), held, type(reason).__name__)
    steps = history.steps
    cells = tuple(step.cells for step in steps)
    return PlateRun(
        cells, tuple(step.eps for step in steps), tuple(energies), held, history.outcome
    )


def factor_is_held(solution: ec.Solution) -> bool:
    """Tell whether an exception leaves the factor in memory; collective."""
    elastic = solution.stiffness
    try:
        with elastic.in_memory():
            elastic.solve(elastic.load_vector())
            if not elastic.factorised:
                return True
            raise KeyError("of a user")
    except KeyError:
        return elastic.factorised


def disjoint(energies: Iterable[ec.Bounds]) -> int:
    """Count the pairs of intervals that do not intersect."""
    count = 0
    for one, other in combinations(energies, 2):
        room = ROUND_OFF * max(abs(one.high), abs(other.high))
        count += max(one.low, other.low) > min(one.high, other.high) + room
    return count


def is_coulomb(sample: Sample) -> bool:
    """Tell whether the friction bound of a sample depends on the pressure."""
    law = sample.scene.contacts[0].law
    return law is not None and not isinstance(law, ec.Tresca)


def plates(seed: int = 0, count: int = 6) -> None:
    """Print what differs between ranks, and what else is violated; collective."""
    counts = [ranks for ranks in COUNTS if ranks <= MPI.COMM_WORLD.size]
    totals: Counter[str] = Counter()
    most = 0.0
    for number in range(count):
        runs = on_ranks(counts, partial(run_of, seed, number))
        sample = random_plate(scene_generator(seed, number), MPI.COMM_SELF)
        found: Counter[str] = Counter(held=sum(run.held for run in runs))
        for run in runs[1:]:
            same = (run.cells, run.ending[:7]) == (runs[0].cells, runs[0].ending[:7])
            found["other cells"] += not same
            if same and run.eps:
                off = float(np.abs(np.divide(run.eps, runs[0].eps) - 1).max())
                found["other eps"] += off > SAME
                most = max(most, off)
        if not is_coulomb(sample):
            energies = runs[0].energies
            proved = [energy for energy in energies if energy.guaranteed]
            found["proved"] = len(proved)
            found["proved apart"] = disjoint(proved)
            found["estimates apart"] = disjoint(energies) - found["proved apart"]
        found["meshes"] = len(runs[0].cells)
        totals.update(found)
        tell(f"{number}: {sample.name}: {runs[0].cells}, {dict(+found)}, {runs[0].ending}")
    tell(f"{counts} ranks: {dict(totals)}; eps differs by {most:.1e} at most")


if __name__ == "__main__":
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    plates(*(int(argument) for argument in sys.argv[1:]))
