"""Compare strategies: error against run time and against elements.

Uniform refinement, marking and the optimal mesh, on five scenes.

    OMP_NUM_THREADS=1 python benchmarks/strategies.py [scene] [variant: 0, 1 or 2]

Scenes: block (the paper's shape, clamped top), greco (SSNV128), hertz (half disc),
bracket (an L with a fillet and bolt holes on a foundation), dome (a block in 3D on a
spherical foundation). Writes a table, and figures to results/strategies. All runs start
from the same mesh. Seconds are wall time, cpu the processor time of this process, which
does not depend on what else the machine does.
"""

import sys
from pathlib import Path
from time import process_time
from typing import Any

import effectivity_scenes

import erc_contact as ec
from erc_contact.output import plot_history

MESHES = Path(__file__).parents[1] / "meshes"
STRATEGIES: dict[str, Any] = {
    "Uniform": ec.Uniform(),
    "Mark(0.5)": ec.Mark(0.5),
    "Mark(0.8)": ec.Mark(0.8),
    "SizeMap": ec.SizeMap(),
}


class Hybrid:
    """Make the optimal mesh up to twice the accuracy, then mark.

    Whether it wins is what this benchmark asks.
    """

    def next(self, error: ec.ConstitutiveError, accuracy: float, max_cells: int) -> ec.Domain:
        """Make the optimal mesh, or the marked one."""
        strategy = ec.SizeMap() if error.relative > 2 * accuracy else ec.Mark(0.5)
        return strategy.next(
            error, max(accuracy, min(error.relative / 2, 1.5 * accuracy)), max_cells
        )


STRATEGIES["Hybrid"] = Hybrid()


def block() -> tuple[ec.Scene, ec.Domain, float]:
    return effectivity_scenes.block(0.3), ec.read_mesh(MESHES / "block.geo", scripts=True), 0.01


def greco() -> tuple[ec.Scene, ec.Domain, float]:
    return effectivity_scenes.greco(), ec.read_mesh(MESHES / "greco.geo", scripts=True), 0.005


def hertz() -> tuple[ec.Scene, ec.Domain, float]:
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.01, -0.05))],
        contacts=[ec.Contact("arc", friction=0.3, gap=lambda x: x[1], normal=(0.0, -1.0))],
    )
    return scene, ec.read_mesh(MESHES / "half_disc.geo", scripts=True), 0.02


def bracket() -> tuple[ec.Scene, ec.Domain, float]:
    scene = ec.Scene(
        material=ec.Elastic(E=210e3, nu=0.3),
        supports=[ec.Displacement("wall", (0.0, None))],
        loads=[ec.Traction("holes", (0.0, -5.0))],
        contacts=[ec.Contact("foot", friction=0.2)],
    )
    return scene, ec.read_mesh(MESHES / "bracket.geo", scripts=True), 0.02


def dome() -> tuple[ec.Scene, ec.Domain, float]:
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.01, 0.0, -0.05))],
        contacts=[
            ec.Contact(
                "bottom",
                friction=0.3,
                gap=lambda x: (x[0] ** 2 + x[1] ** 2) / 6,
                normal=(0.0, 0.0, -1.0),
            )
        ],
    )
    return scene, ec.read_mesh(MESHES / "dome.geo", scripts=True), 0.10


SCENES = {f.__name__: f for f in (block, greco, hertz, bracket, dome)}
VARIANTS = [(1, 0), (1, 10), (2, 10)]
"""Degree, and iterations of tightening."""
LIMIT = {2: 400_000, 3: 150_000}
"""Largest mesh, by dimension: minutes and some gigabytes."""


def main() -> None:
    names = [sys.argv[1]] if len(sys.argv) > 1 else list(SCENES)
    variants = [VARIANTS[int(sys.argv[2])]] if len(sys.argv) > 2 else VARIANTS
    folder = Path("results/strategies")
    folder.mkdir(parents=True, exist_ok=True)
    print(
        f"{'scene':<9}{'k':>2}{'tighten':>8}{'strategy':>12}{'meshes':>8}{'cells':>9}{'eps':>9}{'seconds':>9}{'cpu':>8}"
    )
    for name in names:
        for degree, tighten in variants:
            options: dict[str, Any] = {
                "degree": degree,
                "tighten": tighten,
                "max_cells": LIMIT[SCENES[name]()[1].dim],
            }
            scene, domain, accuracy = SCENES[name]()
            if domain.dim == 3 and not tighten:
                accuracy *= (
                    5  # the untightened error of this scene needs millions of elements to 10%
                )
            ec.adapt(
                scene, domain, accuracy, strategy=ec.SizeMap(), max_steps=2, **options
            )  # compiles forms
            histories = {}
            for label, strategy in STRATEGIES.items():
                began = process_time()
                history = ec.adapt(scene, domain, accuracy, strategy=strategy, **options)
                cpu, histories[label], last = process_time() - began, history, history.steps[-1]
                print(
                    f"{name:<9}{degree:2d}{tighten:8d}{label:>12}{len(history.steps):8d}{last.cells:9d}{last.eps:9.3%}"
                    f"{last.seconds:9.2f}{cpu:8.2f}  "
                    f"{'' if history.reached else 'not '}{accuracy:.1%}",
                    flush=True,
                )
            plot_history(histories, folder / f"{name}_{degree}_{tighten}.png")


if __name__ == "__main__":
    main()
