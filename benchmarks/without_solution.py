"""Solve random scenes in the plane whose loads are beyond what contacts can carry.

Blocks that are pushed, toppled and pulled off, that slide on slopes and float; stacks
of two or three blocks that slip or topple at any joint; wedges that are pressed out.
There statics prove that there is no solution. Blocks between jaws and lintels between
abutments may have any thrust by statics, but too little by elasticity. Loads, or
friction, are beyond their limit by 0.1 to 100%, log-uniform. The limits of all but
lintels are known in closed form; a lintel has at most half the friction at which it is
solved. The limit of jaws is a force in a solution, so they are beyond it by 1% or more.

For each scene it prints how it is refused. Then which are refused, and how far the
share or friction that the error tells is from the true one; seconds; and whether the
same scenes are solved with loads 0.3 to 50% below the limit, and for how many times the
seconds a scene is refused.

    OMP_NUM_THREADS=1 python benchmarks/without_solution.py [seed] [count]
"""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from time import process_time
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_families import scene_generator

ELASTIC = ec.Elastic(1.0, 0.3)
WEIGHT = 1e-3
"""Force per volume over the modulus [-]."""
QUANTILES = (50, 90, 100)
DEAREST = 3.0
"""How many times the seconds of the scene below the limit a refusal should take [-]."""


@dataclass(frozen=True)
class Family:
    """Hold a kind of scene, as a function of the load over the greatest load.

    Attributes:
        name: What it is, in words.
        domain: The mesh.
        scene: Makes the scene of a load over its limit [-].
        by_statics: Whether statics prove that there is no solution beyond the limit.
        by_share: Whether an error can tell the share of a load, not only friction.
    """

    name: str
    domain: ec.Domain
    scene: Callable[[float], ec.Scene]
    by_statics: bool = True
    by_share: bool = True


def pushed(rng: np.random.Generator, _: int) -> Family:
    """Push a stack of one to three blocks at its top or at its side."""
    count = int(rng.integers(1, 4))
    width = float(rng.uniform(0.5, 2.0))
    heights = rng.uniform(0.3, 1.5, count)
    ends = np.concatenate([[0.0], np.cumsum(heights)])
    domain = blocks(rng, width, ends)
    coefficients = rng.uniform(0.1, 0.9, count)
    at_top = bool(rng.random() < 0.5)
    place = ends[-1] if at_top else 0.5 * (ends[-2] + ends[-1])
    above = WEIGHT * width * (ends[-1] - ends[:-1])
    # Each joint slips, or the blocks above it tip.
    most = np.minimum(coefficients * above, above * width / 2 / (place - ends[:-1])).min()
    part, length = (f"b{count - 1} top", width) if at_top else (f"b{count - 1} left", heights[-1])
    contacts = joints(count, coefficients)

    def scene(share: float) -> ec.Scene:
        push = ec.Traction(part, (share * most / length, 0.0))
        return ec.Scene(ELASTIC, loads=[own_weight(), push], contacts=contacts)

    return Family(f"{count} pushed at the {part.split()[1]}", domain, scene)


def pulled(rng: np.random.Generator, _: int) -> Family:
    """Pull the upper block of a stack off."""
    count = int(rng.integers(1, 4))
    width = float(rng.uniform(0.5, 2.0))
    ends = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 1.5, count))])
    contacts = joints(count, rng.uniform(0.1, 0.9, count))
    pressure = WEIGHT * (ends[-1] - ends[-2])

    def scene(share: float) -> ec.Scene:
        pull = ec.Traction(f"b{count - 1} top", (0.0, share * pressure))
        return ec.Scene(ELASTIC, loads=[own_weight(), pull], contacts=contacts)

    return Family(f"{count} pulled off", blocks(rng, width, ends), scene)


def on_slope(rng: np.random.Generator, _: int) -> Family:
    """Put a stack on a slope; its weight makes it slide or tip."""
    count = int(rng.integers(1, 4))
    width = float(rng.uniform(0.5, 2.0))
    ends = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 0.8, count))])
    slope = float(rng.uniform(0.1, 0.8))
    coefficients = rng.uniform(1.0, 2.0, count)
    coefficients /= coefficients.min()
    tips = bool(slope * ends[-1] > 0.9 * width)
    steep = 0.9 * width / ends[-1] if tips else slope

    def scene(share: float) -> ec.Scene:
        contacts = joints(count, steep / share * coefficients)
        load = ec.BodyForce((steep * WEIGHT, -WEIGHT))
        return ec.Scene(ELASTIC, loads=[load], contacts=contacts)

    return Family(f"{count} on a slope", blocks(rng, width, ends), scene, by_share=False)


def given(rng: np.random.Generator, _: int) -> Family:
    """Push a block that friction of a given bound holds, on a stiff or soft bed."""
    width = float(rng.uniform(0.5, 2.0))
    height = float(rng.uniform(0.3, 1.0)) * width
    bound = float(rng.uniform(0.1, 0.5)) * WEIGHT * height
    bed = ec.Foundation(float(10 ** rng.uniform(-1.0, 2.0))) if rng.random() < 0.5 else None
    contact = ec.Contact("b0 bottom", friction=ec.Tresca(bound), foundation=bed)

    def scene(share: float) -> ec.Scene:
        push = ec.Traction("b0 left", (share * bound * width / height, 0.0))
        return ec.Scene(ELASTIC, loads=[own_weight(), push], contacts=[contact])

    return Family("Tresca friction", blocks(rng, width, np.array([0.0, height])), scene)


def wedge(rng: np.random.Generator, _: int) -> Family:
    """Press a wedge out from under a block that slides up and down."""
    angle = float(rng.uniform(0.1, 0.7))
    cells = int(rng.integers(2, 8)), int(rng.integers(1, 5))
    bodies = {}
    for number, name in enumerate(("wedge", "upper")):
        brick = ec.rectangle((0.0, float(number)), (1.0, number + 1.0), cells=cells)
        x = brick.mesh.geometry.x
        share = x[:, 1] if number == 0 else 2.0 - x[:, 1]
        x[:, 1] += share * np.tan(angle) * x[:, 0]
        bodies[name] = ec.Domain(brick.mesh, brick.facet_tags, brick.names)
    domain = ec.assembly(bodies).joined("upper bottom", "wedge top")

    def scene(share: float) -> ec.Scene:
        friction = np.tan(angle / 2) / share
        contacts = [
            ec.Contact("upper bottom", against="wedge top", friction=friction),
            ec.Contact("wedge bottom", friction=friction),
        ]
        guide = ec.Displacement("upper left", (0.0, None))
        press = ec.Traction("upper top", (0.0, -WEIGHT))
        return ec.Scene(ELASTIC, [guide], [press], contacts)

    return Family("wedge", domain, scene, by_share=False)


def jaws(rng: np.random.Generator, degree: int) -> Family:
    """Hold a block between two jaws by friction; its pressure is given by their way."""
    height = float(rng.uniform(0.5, 1.5))
    width = float(rng.uniform(0.5, 2.0))
    domain = blocks(rng, width, np.array([0.0, 0.5, 0.5 + height, 1.0 + height]))
    friction = float(rng.uniform(0.1, 0.4))
    way = float(10 ** rng.uniform(-3.0, -2.0))
    supports = [
        ec.Displacement("b0 bottom", (0.0, 0.0)),
        ec.Displacement("b2 top", (0.0, -way)),
    ]

    def scene(share: float, coefficient: float = friction) -> ec.Scene:
        pull = ec.BodyForce((share * most, 0.0))
        contacts = joints(3, [coefficient] * 3)[1:]
        return ec.Scene(ELASTIC, supports, [pull], contacts)

    # Where all slips, tangential tractions have no part in the force across.
    most = 0.0
    smooth = scene(0.0, 0.0)
    across = abs(ec.solve(smooth, domain, degree=degree).force("b1 top").force[1])
    most = 2 * friction * across / (width * height)
    return Family("jaws", domain, scene, by_statics=False)


def lintel(rng: np.random.Generator, _: int) -> Family:
    """Hold stones between abutments by friction under the thrust of their weight."""
    count = int(rng.integers(2, 6))
    size = 0.5 / int(rng.integers(2, 4))
    names = ["left", *(f"s{number}" for number in range(count)), "right"]
    ends = np.concatenate([[-0.5], 0.4 * np.arange(count + 1), [0.4 * count + 0.5]])
    bodies = {}
    for name, low, high in zip(names, ends, ends[1:], strict=False):
        bodies[name] = ec.rectangle((low, 0.0), (high, 0.5), size=size)
    domain = ec.assembly(bodies)
    for before, after in pairwise(names):
        domain = domain.joined(f"{before} right", f"{after} left")
    supports = [ec.Displacement(f"{name} {name}", (0.0, 0.0)) for name in ("left", "right")]

    def scene(share: float) -> ec.Scene:
        contacts = []
        for before, after in pairwise(names):
            sides = f"{before} right", f"{after} left"
            contacts.append(ec.Contact(sides[0], against=sides[1], friction=1.5 / share))
        return ec.Scene(ELASTIC, supports, [own_weight()], contacts)

    return Family(f"lintel of {count}", domain, scene, by_statics=False)


def blocks(rng: np.random.Generator, width: float, ends: np.ndarray) -> ec.Domain:
    """Make blocks b0, b1, ... on each other between heights."""
    bodies = {}
    for number, (low, high) in enumerate(pairwise(ends.tolist())):
        cells = int(rng.integers(1, 9)), int(rng.integers(1, 6))
        bodies[f"b{number}"] = ec.rectangle((0.0, low), (width, high), cells=cells)
    domain = ec.assembly(bodies)
    for number in range(1, len(bodies)):
        domain = domain.joined(f"b{number} bottom", f"b{number - 1} top")
    return domain


def joints(count: int, coefficients: Any) -> list[ec.Contact]:
    """Return the contacts below blocks, of the lowest block first."""
    contacts = [ec.Contact("b0 bottom", friction=float(coefficients[0]))]
    for number in range(1, count):
        sides = f"b{number} bottom", f"b{number - 1} top"
        friction = float(coefficients[number])
        contacts.append(ec.Contact(sides[0], against=sides[1], friction=friction))
    return contacts


def own_weight() -> ec.BodyForce:
    """Return the weight of all bodies."""
    return ec.BodyForce((0.0, -WEIGHT))


KINDS = (pushed, pushed, pulled, on_slope, given, wedge, jaws, lintel)


def seconds_of(family: Family, share: float, degree: int) -> tuple[float, str]:
    """Solve a scene; return processor seconds, and the words of its error or ""."""
    scene = family.scene(share)
    began = process_time()
    try:
        ec.solve(scene, family.domain, degree=degree)
        words = ""
    except ec.ErcContactError as reason:
        words = f"{type(reason).__name__}: {reason}"
    return process_time() - began, words


def told(family: Family, share: float, words: str) -> float | None:
    """Return how far what an error tells is from the true limit, None without."""
    pattern = r"at most (\S+)% of" if family.by_share else r"at least (\S+) times"
    found = re.search(pattern, words)
    if found is None:
        return None
    number = float(found[1])
    return number / 100 * share - 1 if family.by_share else number / share - 1


def main(seed: int = 0, count: int = 100) -> None:
    """Solve the scenes of a seed beyond and below their limits."""
    seconds: dict[bool, list[float]] = {True: [], False: []}
    ratios: dict[bool, list[float]] = {True: [], False: []}
    errors = []
    wrong = 0
    unsolved = 0
    for number in range(count):
        rng = scene_generator(seed, number)
        degree = int(rng.integers(1, 3))
        family = KINDS[rng.integers(len(KINDS))](rng, degree)
        beyond = 1.0 + float(10 ** rng.uniform(-3.0, 0.0))
        below = 1.0 - float(10 ** rng.uniform(-2.5, -0.3))
        if family.name.startswith("lintel"):
            beyond, below = 2.0 * beyond, 1.0
        elif not family.by_statics:
            # The mesh has a limit of its own.
            beyond = max(beyond, 1.01)
        solved_for, trouble = seconds_of(family, below, degree)
        refused_for, words = seconds_of(family, beyond, degree)
        error = told(family, beyond, words)
        proved = "There is no solution" in words
        head = f"{number}: {family.name}, degree {degree}, {beyond:.4g} of the limit"
        if not words or proved != family.by_statics:
            wrong += 1
            head = f"WRONG {head}"
        seconds[family.by_statics].append(refused_for)
        if error is not None and family.by_statics:
            errors.append(abs(error))
        if trouble:
            unsolved += 1
            head += f"; NOT SOLVED at {below:.4g}: {trouble[:200]}"
        ratio = refused_for / solved_for
        ratios[family.by_statics].append(ratio)
        head += f"; {ratio:.1f} times"
        print(f"{head}; {refused_for:.2f} s: {words[:400]}", flush=True)
    print(f"{count} scenes, {wrong} not refused as they should, {unsolved} not solved below")
    for name, proved in (("by statics", True), ("else", False)):
        median, most, worst = np.percentile(seconds[proved] or [0.0], QUANTILES)
        print(f"seconds, {name}: median {median:.2f}, 90% {most:.2f}, {worst:.2f}")
        median, most, worst = np.percentile(ratios[proved] or [0.0], QUANTILES)
        few = sum(ratio <= DEAREST for ratio in ratios[proved])
        print(f"refused over solved below, {name}: median {median:.1f}, 90% {most:.1f}, ", end="")
        print(f"{worst:.1f}; {few} of {len(ratios[proved])} at most {DEAREST:g}")
    print(f"limit told in {len(errors)}, off by {max(errors, default=0.0):.1e} at most")


if __name__ == "__main__":
    logging.getLogger("erc_contact").setLevel(logging.CRITICAL)
    main(*(int(argument) for argument in sys.argv[1:]))
