"""Measure intervals for single numbers: do they hold, how wide, how fast they fall.

``plane``: random blocks (size, cells, Poisson's ratio, loads that open or press,
degree; without friction, with Tresca friction or Coulomb's), ``space``: the same in 3D.
The goals are the force on the top, the force on the contact below, and the mean
displacement of the right side. An interval is called false where it lies apart from the
interval of a mesh refined three times (in 3D once) with elements of degree 2. "half
width" is over the number, "narrower" the width of ``resultant`` over the width of
``interval``, and "order" the exponent of the width in e on a mesh refined once.

``forces``, ``moments``, ``rotations``, ``contacts`` and ``functionals``, and each of
them ``_in_space``, count the intervals of each kind of number
(:mod:`goal_families`): forces, mean displacements and energies of these blocks; moments
and rotations under a press that turns; forces between two bodies and on two contacts;
integrals with weights. The number is read off the stress and the displacement of a mesh
refined as often. ``aimed``: the same of runs that aim at forces, mean displacements and
energies. ``coulomb``: forces with Coulomb friction against forces of a fine mesh.

    OMP_NUM_THREADS=1 python benchmarks/goals.py [name|all] [seed] [count]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack import pushed_block  # isort: skip
from attack_families import Sample, scene_generator  # isort: skip
from attack_tables import quantile_table  # isort: skip
from goal_orders import orders as orders_of_blocks  # isort: skip
from goal_runs import cost as cost_of_runs, runs  # isort: skip
from goal_families import Wanted, pressed, random_block, rotating, stacked, turned, weighed  # isort: skip
from goal_tallies import Tally, kinds_table  # isort: skip
from tasks import run  # isort: skip

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
LEVELS = {2: 3, 3: 1}
"""Refinements of the reference, by dimension."""
AIMED = 0.03
"""Half width over the number that runs are asked for [-]."""


def goals(d: int) -> dict[str, Any]:
    """Return the goals by their names."""
    up = (*(0.0,) * (d - 1), 1.0)
    return {
        "top": ec.Resultant("top", up),
        "contact": ec.Resultant("bottom", up),
        "displacement": ec.MeanDisplacement("right", up),
    }


def measured(scene: ec.Scene, domain: ec.Domain, degree: int) -> ec.ConstitutiveError:
    """Solve, and measure the error."""
    return ec.constitutive_error(ec.equilibrate(ec.solve(scene, domain, degree=degree)))


def compare(seed: int, count: int, d: int) -> None:
    """Print the quantiles of the intervals of random scenes, and what is false."""
    columns: dict[str, list[float]] = {}
    false = []
    for number in range(count):
        law, sample = random_block(scene_generator(seed, number), d)
        try:
            coarse = measured(sample.scene, sample.domain, sample.degree)
            finer = sample.domain.refined()
            fine = measured(sample.scene, finer, sample.degree)
            for _ in range(LEVELS[d] - 1):
                finer = finer.refined()
            best = measured(sample.scene, finer, 2)
            for name, goal in goals(d).items():
                bounds, next_bounds, exact = (
                    ec.interval(error, goal) for error in (coarse, fine, best)
                )
                width = bounds.high - bounds.low
                if bounds.low > exact.high or bounds.high < exact.low:
                    false.append(f"scene {number} ({sample.name}), {name}: {bounds}, {exact}")
                label = f"{name}, {law}"
                columns.setdefault(f"half width, {label}", []).append(width / 2 / abs(exact.value))
                shrinks = np.log(width / (next_bounds.high - next_bounds.low))
                order = shrinks / np.log(coarse.absolute / fine.absolute)
                columns.setdefault(f"order, {label}", []).append(float(order))
                if name == "contact":
                    up = goal.direction
                    first = ec.resultant(coarse, "bottom", up)
                    columns.setdefault(f"narrower, {label}", []).append(
                        (first.high - first.low) / width
                    )
            columns.setdefault("eps", []).append(coarse.relative)
        except ec.ErcContactError as reason:
            print(f"scene {number} ({sample.name}): {type(reason).__name__} {reason}", flush=True)
    print(quantile_table(dict(sorted(columns.items())), QUANTILES, "{:.3f}"))
    print(*(false or ["no interval is false"]), sep="\n", flush=True)


def plane(seed: int = 0, count: int = 60) -> None:
    """Print the table of blocks in the plane."""
    compare(seed, count, 2)


def space(seed: int = 0, count: int = 8) -> None:
    """Print the table of blocks in 3D."""
    compare(seed, count, 3)


def coulomb(seed: int = 0, count: int = 24) -> None:
    """Compare forces with Coulomb friction to forces of a mesh refined three times.

    These forces know no interval, so that an interval that is wrong is seen.
    """
    off: list[float] = []
    narrower: list[float] = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        scene, domain, degree = pushed_block(rng)
        pushed = scene(float(rng.uniform(0.0, 1.0)))
        domain = domain.refined()
        solution = ec.solve(pushed, domain, degree=degree)
        error = ec.constitutive_error(ec.equilibrate(solution))
        fine = domain.refined().refined().refined()
        exact = ec.solve(pushed, fine, degree=2).force("bottom").force
        for direction in ((1.0, 0.0), (0.0, 1.0)):
            bounds = ec.interval(error, ec.Resultant("bottom", direction))
            first = ec.resultant(error, "bottom", direction)
            width = bounds.high - bounds.low
            off.append(2 * abs(bounds.value - exact @ np.array(direction)) / width)
            narrower.append((first.high - first.low) / width)
    columns = {"distance over half width": off, "narrower": narrower}
    print(quantile_table(columns, QUANTILES, "{:.3f}"), flush=True)


Family = Callable[[np.random.Generator, int], tuple[str, Sample, list[Wanted]]]
"""Type of what makes a random scene with goals."""
BoundsOf = Callable[[Sample, Any], ec.Bounds | None]
"""Type of what makes an interval in a scene."""


def references(sample: Sample, d: int) -> tuple[ec.ConstitutiveError, ec.ConstitutiveError]:
    """Return the errors on the last two of the meshes that a scene is held against."""
    finer = sample.domain
    for _ in range(LEVELS[d] - 1):
        finer = finer.refined()
    fine = measured(sample.scene, finer, 2)
    return fine, measured(sample.scene, finer.refined(), 2)


def of_mesh(sample: Sample, goal: Any) -> ec.Bounds | None:
    """Return the interval on the mesh of a scene."""
    return ec.interval(measured(sample.scene, sample.domain, sample.degree), goal)


def of_run(sample: Sample, goal: Any) -> ec.Bounds | None:
    """Return the interval of a run that aims at it."""
    options: dict[str, Any] = {"degree": sample.degree, "max_cells": 400}
    return ec.adapt(sample.scene, sample.domain, AIMED, goal=goal, **options).bounds


def against_fields(
    family: Family, seed: int, count: int, d: int, bounds_of: BoundsOf = of_mesh
) -> None:
    """Print how far numbers of a fine mesh are from the middle of their intervals.

    These numbers know no interval. They are called outside by more than they change
    from the last mesh but one.
    """
    tallies: dict[str, Tally] = {}
    columns: dict[str, list[float]] = {}
    outside: list[str] = []
    for number in range(count):
        law, sample, wanted = family(scene_generator(seed, number), d)
        left = [each.name for each in wanted]
        try:
            fine, best = references(sample, d)
            for each in wanted:
                bounds = bounds_of(sample, each.goal)
                if bounds is None:
                    continue
                exact = each.read(best)
                slack = abs(exact - each.read(fine)) + 1e-9 * abs(exact)
                half = (bounds.high - bounds.low) / 2
                distance = abs(exact - bounds.value)
                left.remove(each.name)
                tally = tallies.setdefault(each.name, Tally())
                tally.count += 1
                tally.proved += bounds.guaranteed
                if distance > half + slack:
                    tally.outside += 1
                    kind = "proved" if bounds.guaranteed else "estimate"
                    line = f"scene {number} ({sample.name}), {each.name}, {kind}"
                    outside.append(f"{line}: {bounds}, {exact}, slack {slack}")
                columns.setdefault(f"{each.name}, {law}", []).append(half / abs(exact))
                if half > 10 * slack:
                    tally.distances.append(distance / half)
        except ec.ErcContactError as reason:
            words = str(reason)[:200]
            print(f"scene {number} ({sample.name}): {type(reason).__name__} {words}", flush=True)
        for name in left:
            tallies.setdefault(name, Tally()).without += 1
    print("half width over the number")
    print(quantile_table(dict(sorted(columns.items())), QUANTILES, "{:.3f}"))
    print(kinds_table(tallies))
    print(*outside, sep="\n", flush=True)


def forces(seed: int = 0, count: int = 110) -> None:
    """Print the table of forces, mean displacements and energies in the plane."""
    against_fields(pressed, seed, count, 2)


def forces_in_space(seed: int = 0, count: int = 12) -> None:
    """Print the table of forces, mean displacements and energies in 3D."""
    against_fields(pressed, seed, count, 3)


def aimed(seed: int = 0, count: int = 100) -> None:
    """Print the table of runs that aim at their numbers, in the plane."""
    against_fields(pressed, seed, count, 2, of_run)


def rotations_in_space(seed: int = 0, count: int = 12) -> None:
    """Print the table of rotations of rigid faces in 3D."""
    against_fields(rotating, seed, count, 3)


def moments(seed: int = 0, count: int = 40) -> None:
    """Print the table of moments and rotations in the plane."""
    against_fields(turned, seed, count, 2)


def moments_in_space(seed: int = 0, count: int = 6) -> None:
    """Print the table of moments and rotations in 3D."""
    against_fields(turned, seed, count, 3)


def rotations(seed: int = 0, count: int = 100) -> None:
    """Print the table of rotations of rigid faces in the plane."""
    against_fields(rotating, seed, count, 2)


def contacts(seed: int = 0, count: int = 40) -> None:
    """Print the table of forces and moments between bodies in the plane."""
    against_fields(stacked, seed, count, 2)


def contacts_in_space(seed: int = 0, count: int = 6) -> None:
    """Print the table of forces and moments between bodies in 3D."""
    against_fields(stacked, seed, count, 3)


def functionals(seed: int = 0, count: int = 40) -> None:
    """Print the table of numbers that are linear in u, in the plane."""
    against_fields(weighed, seed, count, 2)


def functionals_in_space(seed: int = 0, count: int = 6) -> None:
    """Print the table of numbers that are linear in u, in 3D."""
    against_fields(weighed, seed, count, 3)


def cost(seed: int = 0, count: int = 40) -> None:
    """Print what runs in the plane cost."""
    cost_of_runs(random_block, goals, seed, count, 2)


def cost_in_space(seed: int = 0, count: int = 12) -> None:
    """Print what runs in 3D cost."""
    cost_of_runs(random_block, goals, seed, count, 3)


def orders(seed: int = 0, count: int = 8) -> None:
    """Print the orders of widths in the plane."""
    orders_of_blocks(seed, count, 2)


def orders_in_space(seed: int = 0, count: int = 6) -> None:
    """Print the orders of widths in 3D."""
    orders_of_blocks(seed, count, 3)


IN_PLANE = (plane, coulomb, forces, moments, rotations, contacts, functionals, aimed)
IN_SPACE = (
    space,
    forces_in_space,
    moments_in_space,
    rotations_in_space,
    contacts_in_space,
    functionals_in_space,
)
RUNS = (cost, cost_in_space, runs, orders, orders_in_space)
TASKS: dict[str, Callable[..., None]] = {task.__name__: task for task in IN_PLANE + IN_SPACE + RUNS}


if __name__ == "__main__":
    run(TASKS)
