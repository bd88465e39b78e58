"""Measure how long it takes to save a run, against the run itself.

    OMP_NUM_THREADS=1 python benchmarks/saving.py [scene]

Scenes: short block, block (demos/block.py), cubes (in 3D), history and history in
3D (a block pushed to and fro), and the scenes of benchmarks/foreseen.py, of degrees
1 and 2. Without a scene each has a process of its own, so that the first save imports
matplotlib and pyvista. A short run is made twice: the second one compiles nothing.
"allowed" is a second and a fifth of the run, and what is drawn in that time is in the
column of pictures: in the first save, in another after all libraries are loaded, of
all. Seconds are processor time, here also for the clock of saving, which does not
depend much on what else the machine does.
"""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any
from unittest.mock import patch

import numpy as np

import erc_contact as ec

from foreseen import PROBLEMS  # isort: skip

from erc_contact.output import gallery

STEEL = ec.Elastic(E=1.0, nu=0.3)


def block(accuracy: float) -> ec.History:
    scene = ec.Scene(
        STEEL,
        [ec.Displacement("top", (0.1, -0.05))],
        [ec.Traction("right", (-0.0002, 0.0))],
        [ec.Contact("bottom", friction=0.3)],
    )
    return ec.adapt(scene, ec.rectangle((0.0, 0.0), (2.0, 7.0), size=0.5), accuracy)


def cube_to(accuracy: float) -> ec.History:
    """Return the run of a cube to an accuracy."""
    scene = ec.Scene(
        STEEL,
        [ec.Displacement("top", (0.02, 0.01, -0.05))],
        [],
        [ec.Contact("bottom", friction=0.3)],
    )
    return ec.adapt(scene, ec.box((0.0,) * 3, (1.0,) * 3, cells=(4, 4, 4)), accuracy)


def history_in(d: int) -> ec.Evolution:
    """Return the history of a block in the plane or in 3D."""

    def scene_at(t: float) -> ec.Scene:
        push = (0.01 * np.sin(t), *[0.0] * (d - 2), -0.02)
        contacts = [ec.Contact("bottom", friction=0.3)]
        return ec.Scene(STEEL, [ec.Displacement("top", push)], [], contacts)

    if d == 2:
        domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
        return ec.evolve(scene_at, domain, list(np.linspace(0.0, 6.0, 9)), 0.05)
    domain = ec.box((0.0,) * 3, (1.0,) * 3, cells=(3, 3, 3))
    return ec.evolve(scene_at, domain, list(np.linspace(0.0, 6.0, 5)), 0.25)


def problem_of(place: str, name: str, degree: int) -> Callable[[], ec.History]:
    """Return the run of a scene that another benchmark has."""
    problems = {problem.__name__: problem for problem in PROBLEMS[place]}
    scene, domain, accuracies = problems[name]()
    return lambda: ec.adapt(scene, domain, accuracies[degree], degree=degree)


RUNS: dict[str, Callable[[], ec.History | ec.Evolution]] = {
    "short block": lambda: block(0.05),
    "block": lambda: block(0.01),
    "block of some seconds": lambda: block(0.0045),
    "cube": lambda: cube_to(0.15),
    "cube of some seconds": lambda: cube_to(0.042),
    "large cube": lambda: cube_to(0.028),
    "history": lambda: history_in(2),
    "history in 3D": lambda: history_in(3),
    "wedge": problem_of("plane", "wedge", 1),
    "wedge, degree 2": problem_of("plane", "wedge", 2),
    "bent bar, degree 2": problem_of("plane", "bent_bar", 2),
    "beam": problem_of("space", "beam", 1),
    "beam, degree 2": problem_of("space", "beam", 2),
    "plate": problem_of("space", "plate", 1),
    "plate, degree 2": problem_of("space", "plate", 2),
}
LONG = (
    "block of some seconds",
    "cube of some seconds",
    "large cube",
    "beam",
    "beam, degree 2",
    "plate",
    "plate, degree 2",
)
"""Runs that are made once: what they compile is little of them."""


def seconds_of(action: Callable[[], object]) -> float:
    """Measure the processor time of an action."""
    started = process_time()
    action()
    return process_time() - started


def pictures_in(folder: str) -> int:
    """Count the pictures of a folder."""
    return len(list(Path(folder).glob("*.png")))


def measure(name: str) -> None:
    """Print the row of a scene."""
    run = RUNS[name]
    if name not in LONG:
        run()
    results: list[Any] = []
    of_run = seconds_of(lambda: results.append(run()))
    # saving compares its clock with the time of the run
    *steps, last = results[0].steps
    result = replace(results[0], steps=(*steps, replace(last, seconds=of_run)))
    with TemporaryDirectory() as folder, patch.object(gallery, "perf_counter", process_time):
        first = seconds_of(lambda: result.save(f"{folder}/first"))
        seconds_of(lambda: result.save(f"{folder}/all", pictures=True))
        second = seconds_of(lambda: result.save(f"{folder}/second"))
        every = seconds_of(lambda: result.save(f"{folder}/all", pictures=True))
        files = seconds_of(lambda: result.save(f"{folder}/files", pictures=False))
        counts = [pictures_in(f"{folder}/{part}") for part in ("first", "second", "all")]
    cells = result.error.domain.cells
    allowed = 1 + of_run / 5
    numbers = (of_run, allowed, first, second, every, files)
    columns = " | ".join(f"{number:.2f}" for number in numbers)
    print(f"| {name} | {cells} | {columns} | {', '.join(map(str, counts))} |")


def main() -> None:
    if len(sys.argv) > 1:
        measure(sys.argv[1])
        return
    print(
        "| run | cells | run | allowed | first save | another | with all pictures | without | "
        "pictures |\n" + "|---" * 9 + "|"
    )
    sys.stdout.flush()
    for name in RUNS:
        subprocess.run([sys.executable, __file__, name], check=True)


if __name__ == "__main__":
    main()
