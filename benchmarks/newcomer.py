"""Measure what the first scripts of a new user cost, whose forms are not compiled yet.

Ten scripts of ten kinds run one after another, each in a process of its own, on one
empty cache of compiled forms, and once more when all is compiled. Each runs alone on
an empty cache, too. Told are seconds of processor, of the script and of the compiler
that it calls, and how many forms are compiled:

    alone    on an empty cache
    in turn  on what the scripts before have compiled
    again    with all forms compiled

``again`` compiles nothing, and ``in turn`` only what no script before needed.

    OMP_NUM_THREADS=1 python benchmarks/newcomer.py
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import process_time
from typing import NamedTuple

import erc_contact as ec

STEEL = ec.Elastic(1.0, 0.3)
PRESSED = ec.Displacement("top", (0.01, -0.02))
FOOT = ec.Contact("bottom", friction=0.3)


def block() -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))


def plane() -> None:
    """Press a block on a foundation, to 10%."""
    ec.adapt(ec.Scene(STEEL, [PRESSED], [], [FOOT]), block(), accuracy=0.1)


def degree_2() -> None:
    """Press it with quadratic elements, to 1%."""
    ec.adapt(ec.Scene(STEEL, [PRESSED], [], [FOOT]), block(), accuracy=0.01, degree=2)


def loaded() -> None:
    """Load it by a pressure and its weight, with a gap."""
    loads: list[ec.Load] = [ec.Traction("top", pressure=0.01), ec.BodyForce((0.0, -0.001))]
    foot = ec.Contact("bottom", friction=0.3, gap=lambda x: 1e-3 * x[0])
    ec.adapt(ec.Scene(STEEL, [], loads, [foot]), block(), accuracy=0.1)


def ring() -> None:
    """Press a ring."""
    law = ec.Elastic(1.0, 0.3, hypothesis="axisymmetric")
    scene = ec.Scene(law, [ec.Displacement("top", (None, -0.02))], [], [FOOT])
    ec.adapt(scene, block(), accuracy=0.1)


def in_space() -> None:
    """Press a box."""
    box = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(3, 3, 3))
    scene = ec.Scene(STEEL, [ec.Displacement("top", (0.01, 0.0, -0.02))], [], [FOOT])
    ec.adapt(scene, box, accuracy=0.2)


def two_bodies() -> None:
    """Press a block on another one."""
    lower = ec.rectangle((0.0, -1.0), (2.0, 0.0), cells=(6, 3))
    both = ec.assembly({"upper": block(), "lower": lower}).joined("upper bottom", "lower top")
    moved, held = (0.0, -0.02), (0.0, 0.0)
    supports = [ec.Displacement("upper top", moved), ec.Displacement("lower bottom", held)]
    joint = ec.Contact("upper bottom", against="lower top", friction=0.3)
    ec.adapt(ec.Scene(STEEL, supports, [], [joint]), both, accuracy=0.1)


def plastic() -> None:
    """Press a block until it yields."""
    law = ec.Plastic(1.0, 0.3, yield_stress=0.01, hardening=0.05)
    ec.adapt(ec.Scene(law, [PRESSED], [], [FOOT]), block(), accuracy=0.3)


def history() -> None:
    """Press a block, push it and pull it back."""

    def scene_at(t: float) -> ec.Scene:
        push = 0.005 * min(t, 4.0 - t)
        return ec.Scene(STEEL, [ec.Displacement("top", (push, -0.02))], [], [FOOT])

    ec.evolve(scene_at, block(), [0.0, 1.0, 2.0, 3.0], accuracy=0.2)


def goal() -> None:
    """Bound the force that pushes a block without friction."""
    scene = ec.Scene(STEEL, [PRESSED], [], [ec.Contact("bottom")])
    ec.adapt(scene, block(), goal=ec.Resultant("top", (0.0, 1.0)), accuracy=0.05)


def pictures() -> None:
    """Save a report with its pictures."""
    with tempfile.TemporaryDirectory() as folder:
        history = ec.adapt(ec.Scene(STEEL, [PRESSED], [], [FOOT]), block(), accuracy=0.1)
        history.save(folder, pictures=True)


SCRIPTS: dict[str, Callable[[], object]] = {
    script.__name__: script
    for script in (
        plane,
        degree_2,
        loaded,
        ring,
        in_space,
        two_bodies,
        plastic,
        history,
        goal,
        pictures,
    )
}


class Cost(NamedTuple):
    """Hold what a script has cost.

    Attributes:
        seconds: Seconds of processor, of it and of the compiler.
        of_compiler: Seconds of the compiler.
        forms: Number of forms and expressions that it has compiled.
    """

    seconds: float
    of_compiler: float
    forms: int


def measured(script: str, cache: Path) -> Cost:
    """Run a script in a process of its own, on a cache of compiled forms."""
    before = compiled_forms(cache)
    command = [sys.executable, __file__, script]
    environment = dict(os.environ, XDG_CACHE_HOME=str(cache))
    told = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    own, of_compiler = (float(word) for word in told.stdout.split()[-2:])
    return Cost(own + of_compiler, of_compiler, compiled_forms(cache) - before)


def compiled_forms(cache: Path) -> int:
    """Count the forms and expressions in a cache: there is a note for each."""
    return len(list(cache.rglob("*.form")))


def run(script: str) -> None:
    """Run a script, and print its seconds and the seconds of the compiler."""
    SCRIPTS[script]()
    of_compiler = getrusage(RUSAGE_CHILDREN)
    print(process_time(), of_compiler.ru_utime + of_compiler.ru_stime)


def main() -> None:
    """Run all scripts, and print a line for each."""
    print("              alone: seconds, of compiler, forms; in turn; again")
    with tempfile.TemporaryDirectory() as shared:
        for script in SCRIPTS:
            with tempfile.TemporaryDirectory() as empty:
                costs = [measured(script, Path(empty))]
            costs += [measured(script, Path(shared)) for _ in range(2)]
            cells = ["{:6.1f} {:6.1f} {:5d}".format(*cost) for cost in costs]
            print(f"{script:<14}" + "      ".join(cells), flush=True)


if __name__ == "__main__":
    if sys.argv[1:]:
        run(sys.argv[1])
    else:
        main()
