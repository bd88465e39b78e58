"""Measure the dissipated energy of a cycle against the length of the steps.

A punch stands on a plane by friction. A vertical load presses it, and a horizontal load
rocks it back and forth. The energy of one cycle is told in three ways, which are the
same for steps that are short enough: the dissipation function of the friction law,
minus the work of the contact, and the area of the loop of the horizontal load over the
mean displacement of the loaded side.

``steps``: prescribed steps, each half as long as the one before. ``chosen``: steps that
`evolve` chooses for an accuracy of the dissipated energy.

    OMP_NUM_THREADS=1 python benchmarks/dissipation.py [steps|chosen|all]
"""

from __future__ import annotations

import sys
from time import perf_counter

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, which loads MPI first
import numpy as np  # isort: skip

WIDTH, HEIGHT, RADIUS = 10.0, 8.0, 2.0
PRESSURE = 100.0
TIMES = (0.0, 1.0, 1.5, 2.5, 3.5, 4.5)
HORIZONTAL_LOADS = (0.0, 0.0, 300.0, -300.0, 300.0, -300.0)
CYCLE = (1.5, 3.5)
LENGTHS = (0.25, 0.125, 0.0625)
ACCURACIES = (0.1, 0.02)
HEADER = (
    "| steps | of them in the cycle | dissipated | -contact_work | loop area | in_time | cells "
    "| seconds |"
)


def punch() -> ec.Domain:
    """Make a rectangle whose lower corners are rounded; its parts are foot and top."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1.5)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
    occ = gmsh.model.occ
    rounded = occ.addRectangle(-WIDTH / 2, 0.0, 0.0, WIDTH, HEIGHT + RADIUS, roundedRadius=RADIUS)
    below = occ.addRectangle(-WIDTH / 2, 0.0, 0.0, WIDTH, HEIGHT)
    occ.intersect([(2, rounded)], [(2, below)])
    occ.synchronize()
    heights = {curve: occ.getCenterOfMass(1, curve)[1] for _, curve in gmsh.model.getEntities(1)}
    foot = [curve for curve, height in heights.items() if height < RADIUS]
    top = [curve for curve, height in heights.items() if height > HEIGHT - 1e-6]
    gmsh.model.addPhysicalGroup(1, foot, name="foot")
    gmsh.model.addPhysicalGroup(1, top, name="top")
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain


def horizontal_load(t: float) -> float:
    """Return the horizontal force on the top at a time [force]."""
    return float(np.interp(t, TIMES, HORIZONTAL_LOADS))


def scene_at(t: float) -> ec.Scene:
    """Make the scene of the pressed and rocked punch at a time."""
    load = ec.Traction("top", (horizontal_load(t) / WIDTH, -PRESSURE))
    foot = ec.Contact("foot", friction=0.5, gap=lambda x: x[1], normal=(0.0, -1.0))
    return ec.Scene(ec.Elastic(210e3, 0.3), [], [load], [foot])


def displacement_of_top(error: ec.ConstitutiveError) -> float:
    """Compute the mean horizontal displacement of the top of u^ [length]."""
    across = (np.arange(100) + 0.5) / 100 - 0.5
    points = np.column_stack([WIDTH * across, np.full(100, HEIGHT)])
    return float(error.at(points).displacement[:, 0].mean())


def row(name: str, times: np.ndarray, accuracy_in_time: float | None = None) -> None:
    """Solve the history and print its row."""
    began = perf_counter()
    history = ec.evolve(
        scene_at, punch(), times.tolist(), 0.03, degree=2, accuracy_in_time=accuracy_in_time
    )
    seconds = perf_counter() - began
    time = history.column("time")
    in_cycle = np.flatnonzero((time >= CYCLE[0]) & (time <= CYCLE[1]))
    first, last = in_cycle[[0, -1]]
    energies = {}
    for energy in ("dissipated", "contact_work", "in_time"):
        values = history.column(energy)
        energies[energy] = values[last] - values[first]
    moved = np.array([displacement_of_top(history.errors[step]) for step in in_cycle])
    load = np.array([horizontal_load(t) for t in time[in_cycle]])
    area = float(np.sum((load[1:] + load[:-1]) / 2 * np.diff(moved)))
    numbers = (energies["dissipated"], -energies["contact_work"], area, energies["in_time"])
    columns = " | ".join(f"{number:.4f}" for number in numbers)
    cells = history.column("cells")[-1]
    print(f"| {name} | {len(in_cycle) - 1} | {columns} | {cells} | {seconds:.0f} |", flush=True)


def steps() -> None:
    """Print the rows of prescribed steps."""
    for length in LENGTHS:
        count = round((CYCLE[1] - TIMES[1]) / length)
        loaded = np.linspace(TIMES[1], CYCLE[1], count + 1)
        row(f"{length}", np.append(TIMES[0], loaded))


def chosen() -> None:
    """Print the rows of steps that the accuracy of the dissipated energy chooses."""
    for accuracy in ACCURACIES:
        row(f"{accuracy:.0%}", np.array(TIMES[:5]), accuracy)


if __name__ == "__main__":
    wanted = sys.argv[1] if len(sys.argv) > 1 else "all"
    print(HEADER + "\n|" + "---|" * (HEADER.count("|") - 1))
    for task in (steps, chosen):
        if wanted in (task.__name__, "all"):
            task()
