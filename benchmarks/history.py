"""Measure true errors and costs of loading histories.

``errors``: a step that turns the shear back, after a step that has sheared the pressed
body. e is compared with the true error of the step. Its reference has the same history:
the last step of the coarse mesh, which the nested mesh of the reference carries
exactly. "both" is e over ``sqrt(|u - u^|^2 + |sigma - sigma^|^2)``, "third" the third
term over e^2.

``cost``: a cycle of 20 steps of the block, certified 2%, against 20 single steps on the
mesh of its end, each with solve, admissible pair and error; processor time.

``steps``: proportional loading in 1, 5 and 20 steps: what differs at the end.

    OMP_NUM_THREADS=1 python benchmarks/history.py [errors|cost|steps|all]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from time import process_time

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from true_errors import reference, true_errors  # isort: skip

METHODS = ec.AugmentedLagrangian(), ec.Nitsche()
TIMES = [0.0, *np.linspace(1.0, 2.0, 21)[1:]]


def block(press: float, shear: float) -> ec.Scene:
    """Make the scene of the pressed and sheared block."""
    support = ec.Displacement("top", (shear, -0.05 * press))
    return ec.Scene(ec.Elastic(1.0, 0.3), [support], contacts=[ec.Contact("bottom", friction=0.3)])


def pushed(press: float, shear: float) -> ec.Scene:
    """Make a block under loads, held by a wall."""
    loads = [ec.Traction("top", pressure=0.05 * press), ec.Traction("left", (10 * shear, 0.0))]
    contact = ec.Contact("bottom", friction=0.3)
    return ec.Scene(ec.Elastic(1.0, 0.2), [ec.Displacement("right", (0.0, None))], loads, [contact])


def cylinder(press: float, shear: float) -> ec.Scene:
    """Make a block pressed on a cylinder: contact, slip and stick are small."""
    support = ec.Displacement("top", (0.3 * shear, -0.05 * press))
    contact = ec.Contact("bottom", friction=0.3, gap=lambda x: (x[0] - 1.0) ** 2 / 4)
    return ec.Scene(ec.Elastic(1.0, 0.3), [support], contacts=[contact])


CASES: dict[str, tuple[Callable[[float, float], ec.Scene], float]] = {
    "block": (block, 0.03),
    "pushed": (pushed, 0.012),
    "cylinder": (cylinder, 0.03),
}


def square() -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (2.0, 2.0), cells=(8, 8))


def errors() -> None:
    """Print the table of true errors of steps given their history."""
    print(f"{'scene':10} {'method':20} degree    eps    both   third   open slip stick")
    for name, (scene, size) in CASES.items():
        for method in METHODS:
            for degree in (1, 2):
                domain, last = square(), None
                for press, shear in ((1.0, 0.0), (1.0, size)):
                    last = ec.solve(scene(press, shear), domain, method, degree=degree, after=last)
                back = ec.solve(scene(1.0, 0.2 * size), domain, method, degree=degree, after=last)
                error = ec.constitutive_error(ec.equilibrate(back))
                true = true_errors(error.admissible, reference(back, 3, after=last))
                status = np.bincount(error.profile("bottom")["status"], minlength=3)
                both, third = error.absolute / true.of_both, true.friction / error.absolute**2
                kind = type(method).__name__
                print(
                    f"{name:10} {kind:20} {degree:6d} {error.relative:6.2%} {both:7.4f} "
                    f"{third:7.0e}   {status}"
                )


def cost() -> None:
    """Print the cost of a history against the cost of single steps."""

    def scene_at(t: float) -> ec.Scene:
        return block(min(t, 1.0), 0.04 * np.sin(2 * np.pi * max(t - 1.0, 0.0)))

    ec.evolve(scene_at, square(), TIMES[:4], accuracy=0.02)  # compiles
    began = process_time()
    history = ec.evolve(scene_at, square(), TIMES, accuracy=0.02)
    whole, cells = process_time() - began, history.column("cells")
    began, last = process_time(), None
    for t in TIMES:
        last = ec.solve(scene_at(t), history.error.domain, ec.AugmentedLagrangian(), after=last)
        ec.constitutive_error(ec.equilibrate(last))
    single = process_time() - began
    ratio = f"{whole:.2f} s against {single:.2f} s, ratio {whole / single:.2f}"
    print(f"{ratio}; {cells[1]} to {cells[-1]} cells")
    print(history)


def steps() -> None:
    """Print proportional loading in several steps against one step."""
    domain = square()
    for method in METHODS:
        static = ec.solve(block(1.0, 0.03), domain, method)
        for count in (5, 20):
            last: ec.Solution | None = None
            for t in np.linspace(0.0, 1.0, count + 1)[1:]:
                last = ec.solve(block(t, 0.03 * t), domain, method, after=last)
            assert last is not None
            u = abs(last.u.x.array - static.u.x.array).max() / abs(static.u.x.array).max()
            force = last.force("bottom").force
            same = static.force("bottom").force
            zones = np.count_nonzero(
                last.profile("bottom")["status"] != static.profile("bottom")["status"]
            )
            deviation = abs(force - same).max() / abs(same).max()
            print(
                f"{method}: {count} steps, u {u:.1e}, force {deviation:.1e}, "
                f"{zones} points in other zones"
            )


if __name__ == "__main__":
    wanted = sys.argv[1] if len(sys.argv) > 1 else "all"
    for task in (errors, cost, steps):
        if wanted in (task.__name__, "all"):
            task()
