"""Compare the cells that a run foresees with those that it needs.

A run foresees the number of cells for its accuracy from its last two meshes, with a
size map from the cells of the optimal mesh, too (`erc_contact/run/foreseen.py`). What
it needs is where its own curve of the error over cells crosses the accuracy, between
its last two meshes.

    OMP_NUM_THREADS=1 python benchmarks/foreseen.py [plane] [space]

A row a run: cells foreseen over cells needed, of each mesh that foresees.
"""

import sys
from collections.abc import Callable, Sequence
from math import log

import erc_contact as ec
from erc_contact.error.strategy import Strategy
from erc_contact.run.foreseen import foresee_by_sizes, foresee_cells
from erc_contact.run.step import Step

STEEL = ec.Elastic(E=1.0, nu=0.3)
STRATEGIES: dict[str, Strategy] = {"marking": ec.Mark(), "size map": ec.SizeMap()}
Problem = tuple[ec.Scene, ec.Domain, dict[int, float]]
"""Scene, first mesh, and the accuracy of each degree."""


def block() -> Problem:
    scene = ec.Scene(
        STEEL, [ec.Displacement("top", (0.1, -0.05))], [], [ec.Contact("bottom", friction=0.3)]
    )
    return scene, ec.rectangle((0.0, 0.0), (2.0, 7.0), size=0.5), {1: 0.012, 2: 0.002}


def bent_bar() -> Problem:
    scene = ec.Scene(
        STEEL,
        [ec.Displacement("left", (0.0, 0.0))],
        [ec.Traction("top", (0.0, -0.002))],
        [ec.Contact("bottom", friction=0.3, gap=0.01)],
    )
    return scene, ec.rectangle((0.0, 0.0), (4.0, 1.0), size=0.3), {1: 0.025, 2: 0.005}


def wedge() -> Problem:
    """Return a flat block on a foundation that is curved, so that it opens."""
    scene = ec.Scene(
        STEEL,
        [ec.Displacement("top", (0.01, -0.03))],
        [],
        [ec.Contact("bottom", friction=0.5, gap=lambda x: 0.05 * (x[0] - 0.4) ** 2)],
    )
    return scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), size=0.3), {1: 0.02, 2: 0.004}


def cube() -> Problem:
    scene = ec.Scene(
        STEEL,
        [ec.Displacement("top", (0.02, 0.01, -0.05))],
        [],
        [ec.Contact("bottom", friction=0.3)],
    )
    return scene, ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), size=0.3), {1: 0.06, 2: 0.025}


def beam() -> Problem:
    scene = ec.Scene(
        STEEL,
        [ec.Displacement("left", (0.0, 0.0, 0.0))],
        [ec.Traction("top", (0.0, 0.0, -0.002))],
        [ec.Contact("bottom", friction=0.3, gap=0.02)],
    )
    return scene, ec.box((0.0, 0.0, 0.0), (3.0, 1.0, 1.0), size=0.5), {1: 0.1, 2: 0.03}


def plate() -> Problem:
    """Return a plate that is pressed on a ball, and touches it at its middle."""
    scene = ec.Scene(
        STEEL,
        [ec.Displacement("top", (0.0, 0.0, -0.02))],
        [],
        [ec.Contact("bottom", friction=0.2, gap=lambda x: 0.1 * (x[0] ** 2 + x[1] ** 2))],
    )
    return scene, ec.box((-1.0, -1.0, 0.0), (1.0, 1.0, 0.6), size=0.4), {1: 0.12, 2: 0.05}


PROBLEMS = {"plane": (block, bent_bar, wedge), "space": (cube, beam, plate)}


def needed_cells(steps: Sequence[Step], accuracy: float) -> float:
    """Interpolate the cells with which a run crosses its accuracy."""
    before, last = steps[-2:]
    power = log(last.cells / before.cells) / log(before.total / last.total)
    return float(before.cells * (before.total / accuracy) ** power)


def run_and_foresee(
    scene: ec.Scene, domain: ec.Domain, accuracy: float, degree: int, strategy: Strategy
) -> tuple[ec.History, list[float]]:
    """Run, and return cells foreseen over needed of each mesh but the last."""
    rows: list[Step] = []
    numbers = []

    def foresee(error: ec.ConstitutiveError, step: Step) -> None:
        rows.append(step)
        if isinstance(strategy, ec.SizeMap):
            numbers.append(foresee_by_sizes(rows, error, accuracy))
        else:
            numbers.append(foresee_cells(rows, accuracy, degree / domain.dim))

    history = ec.adapt(scene, domain, accuracy, degree=degree, strategy=strategy, callback=foresee)
    if len(rows) < 3 or not history.reached:
        return history, []
    needed = needed_cells(rows, accuracy)
    return history, [number / needed for number in numbers[:-1] if number is not None]


def print_rows(problem: Callable[[], Problem]) -> list[float]:
    """Run a problem with both strategies and degrees, a row each."""
    scene, domain, accuracies = problem()
    ratios = []
    for degree, accuracy in accuracies.items():
        for name, strategy in STRATEGIES.items():
            history, row = run_and_foresee(scene, domain, accuracy, degree, strategy)
            ratios += row
            told = ", ".join(f"{ratio:.2f}" for ratio in row) or "nothing foreseen"
            counts = f"{len(history.steps)} meshes, {history.steps[-1].cells} cells"
            print(f"| {problem.__name__} | {degree} | {name} | {counts} | {told} |", flush=True)
    return ratios


def main() -> None:
    ratios = []
    print("| scene | degree | strategy | run | foreseen over needed cells |")
    print("|---|---|---|---|---|")
    for place in sys.argv[1:] or PROBLEMS:
        for problem in PROBLEMS[place]:
            ratios += print_rows(problem)
    within = sum(abs(log(ratio)) <= log(1.2) for ratio in ratios)
    print(f"\n{within} of {len(ratios)} within 20%, {min(ratios):.2f} to {max(ratios):.2f}")


if __name__ == "__main__":
    main()
