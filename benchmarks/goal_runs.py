"""Measure runs that aim at a number: what they cost, and what they save.

``cost``: random blocks in the plane and in space (:mod:`goals`), one goal each.
"seconds" is the time of the run over that of one that solves and measures e on the same
meshes, and "width" that of its last interval over the narrowest of several t on the
last mesh (``interval``). ``runs``: forces to 1%, against runs by eps that stop as soon
as ``resultant`` or ``interval`` knows them as well. Times are of the processor, with
all forms compiled.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import process_time
from typing import Any

import erc_contact as ec

from attack_families import scene_generator  # isort: skip
from attack_tables import quantile_table  # isort: skip

QUANTILES = (0.0, 0.25, 0.5, 0.75, 0.95, 1.0)
ACCURACY = {2: 0.01, 3: 0.05}
"""Half width over the number that is asked for, by dimension [-]."""
MOST_CELLS = {2: 6000, 3: 5000}


class Replay:
    """Give the meshes of another run, one after the other."""

    def __init__(self, domains: Sequence[ec.Domain]) -> None:
        self._domains = iter(domains)

    def next(self, *_: Any) -> ec.Domain:
        """Return the next mesh."""
        return next(self._domains)

    __call__ = next


def timed_run(*arguments: Any, **options: Any) -> tuple[ec.History, float]:
    """Return a run, and the time of the processor that it takes [s]."""
    began = process_time()
    history = ec.adapt(*arguments, **options)
    return history, process_time() - began


def replayed(scene: ec.Scene, history: ec.History, degree: int) -> float:
    """Return the time without the goal on the meshes of a run [s]."""
    domains = [domain for domain, _ in history.meshes]
    options: dict[str, Any] = {"degree": degree, "max_steps": len(domains), "max_cells": 10**7}
    _, seconds = timed_run(scene, domains[0], 1e-9, strategy=Replay(domains[1:]), **options)
    return seconds


def cost_of(label: str, scene: ec.Scene, goal: Any, domain: ec.Domain, degree: int) -> list[float]:
    """Return the ratios of time and width of a run, see above."""
    d = domain.dim
    options: dict[str, Any] = {"goal": goal, "degree": degree, "max_cells": MOST_CELLS[d]}
    ec.adapt(scene, domain, ACCURACY[d], **options)
    history, seconds = timed_run(scene, domain, ACCURACY[d], **options)
    replayed(scene, history, degree)
    ratio = seconds / replayed(scene, history, degree)
    narrowest = ec.interval(history.error, goal)
    bounds = history.bounds
    assert bounds is not None
    width = (bounds.high - bounds.low) / max(narrowest.high - narrowest.low, 1e-300)
    print(
        f"{label}: {[step.cells for step in history.steps]}, {ratio:.2f}, {width:.3f}", flush=True
    )
    return [ratio, width, float(history.reached)]


def cost(sample_of: Any, goals_of: Any, seed: int, count: int, d: int) -> None:
    """Print quantiles of the cost of runs in random scenes.

    Args:
        sample_of: Makes a random scene.
        goals_of: Returns the goals by their names.
        seed: Seed of the scenes.
        count: Number of scenes.
        d: Dimension.
    """
    columns: dict[str, list[float]] = {}
    reached = 0.0
    for number in range(count):
        rng = scene_generator(seed, number)
        law, sample = sample_of(rng, d)
        name, goal = list(goals_of(d).items())[int(rng.integers(3))]
        label = f"scene {number} ({sample.name}), {name}"
        try:
            row = cost_of(label, sample.scene, goal, sample.domain, sample.degree)
        except ec.ErcContactError as reason:
            print(f"{label}: {type(reason).__name__} {str(reason)[:200]}", flush=True)
            continue
        reached += row[2]
        for case in ("all", law, f"degree {sample.degree}"):
            columns.setdefault(f"seconds, {case}", []).append(row[0])
        columns.setdefault("width", []).append(row[1])
    print(quantile_table(dict(sorted(columns.items())), QUANTILES, "{:.2f}"))
    print(f"{reached:.0f} runs reached their goal", flush=True)
