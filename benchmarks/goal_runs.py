"""Measure runs that aim at a number: what they cost, and what they save.

``cost``: random blocks in the plane and in 3D (:mod:`goals`), one goal each.
"seconds" is the time of the run over the time of a run that solves and measures e on
the same meshes, and "width" the width of its last interval over the narrowest of
several t on the last mesh (``interval``). ``runs``: forces to 1%, against runs by eps
that stop as soon as ``resultant`` or ``interval`` knows them as well. Times are of the
processor, with all forms compiled.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import process_time
from typing import Any

import erc_contact as ec

import gmsh  # isort: skip
from attack_families import scene_generator  # isort: skip
from attack_tables import quantile_table  # isort: skip

QUANTILES = (0.0, 0.25, 0.5, 0.75, 0.95, 1.0)
ACCURACY = {2: 0.01, 3: 0.05}
"""Half width over the number that is asked for, by dimension [-]."""
SHOWN = 0.01
"""The same of the runs that are shown [-]."""
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


# -- two runs that are shown
# ----------------------------------------------------------------------------


def readme_block() -> tuple[ec.Scene, ec.Domain, Any]:
    """Return the block of the README with mu = 0.01, and its friction force."""
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("top", (0.1, -0.05))],
        loads=[ec.Traction("right", (-0.0002, 0.0))],
        contacts=[ec.Contact("bottom", friction=0.01)],
    )
    domain = ec.rectangle((0.0, 0.0), (2.0, 7.0), size=1.0)
    return scene, domain, ec.Resultant("bottom", (1.0, 0.0))


def notched_part() -> tuple[ec.Scene, ec.Domain, Any]:
    """Return a part with a sharp notch in its side, and its vertical reaction."""
    outline = [(0, 0), (2, 0), (2, 1), (1, 1.2), (2, 1.4), (2, 3), (0, 3)]
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    points = [occ.addPoint(float(x), float(y), 0.0) for x, y in outline]
    lines = []
    for here, there in zip(points, points[1:] + points[:1], strict=True):
        lines.append(occ.addLine(here, there))
    occ.addPlaneSurface([occ.addCurveLoop(lines)])
    occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [1], name="body")
    for name, number in (("bottom", 0), ("top", 5)):
        gmsh.model.addPhysicalGroup(1, [lines[number]], name=name)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.7)
    gmsh.model.mesh.generate(2)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    press = [ec.Displacement("top", (0.02, -0.03))]
    contacts = [ec.Contact("bottom", friction=ec.Tresca(0.002))]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), press, (), contacts)
    return scene, domain, ec.Resultant("bottom", (0.0, 1.0))


class Known(Exception):
    """End a run because its number is known."""


def by_eps(
    scene: ec.Scene, domain: ec.Domain, degree: int, goal: Any, number_of: Any
) -> tuple[int, float, float, bool]:
    """Run by eps until a number is known to 1%.

    Args:
        scene: The scene.
        domain: The first mesh.
        degree: Degree of the displacement.
        goal: The number.
        number_of: Returns its interval on a mesh.

    Returns:
        Number of elements, time [s] with the last interval alone, half width over the
        number, and whether that is 1%.
    """
    last: list[Any] = []
    spent = [0.0]

    def look(error: ec.ConstitutiveError, _: ec.Step) -> None:
        began = process_time()
        bounds = number_of(error, goal)
        seconds = process_time() - began
        spent[0] += seconds
        last[:] = [error.domain.cells, bounds.relative, seconds]
        if bounds.relative <= SHOWN:
            raise Known

    began = process_time()
    options: dict[str, Any] = {"degree": degree, "max_cells": 100_000, "max_steps": 40}
    try:
        ec.adapt(scene, domain, 1e-6, callback=look, **options)
        is_known = False
    except Known:
        is_known = True
    seconds = process_time() - began - spent[0] + last[2]
    return last[0], seconds, last[1], is_known


def runs(_: int = 0) -> None:
    """Print elements and seconds of runs to 1%, with the goal and by eps."""
    # There is nothing random here, so that the seed of other tasks does not matter.
    print("| run | degree | elements | s | half width | meshes |\n|---|---|---|---|---|---|")
    for name, make in (("friction force", readme_block), ("notched part", notched_part)):
        for degree in (1, 2):
            scene, domain, goal = make()
            options: dict[str, Any] = {"goal": goal, "degree": degree, "max_cells": 40_000}
            ec.adapt(scene, domain, SHOWN, **options)
            history, seconds = timed_run(scene, domain, SHOWN, **options)
            assert history.bounds is not None
            cells = history.steps[-1].cells
            half = history.bounds.relative
            row = f"{degree} | {cells} | {seconds:.2f} | {half:.2%} | {len(history.steps)}"
            print(f"| {name}, goal | {row} |", flush=True)
            for kind, number_of in (("interval", ec.interval), ("resultant", _resultant)):
                by_eps(scene, domain, degree, goal, number_of)
                cells, seconds, half, is_known = by_eps(scene, domain, degree, goal, number_of)
                row = f"{degree} | {cells} | {seconds:.2f} | {half:.2%} | {is_known}"
                print(f"| {name}, eps, {kind} | {row} |", flush=True)


def _resultant(error: ec.ConstitutiveError, goal: Any) -> ec.Bounds:
    """Return the lifting bound."""
    return ec.resultant(error, goal.part, goal.direction)
