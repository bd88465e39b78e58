"""Solve random bodies with both solvers: how far from the faster one is "auto"?

Layers, compact bodies, sheets, bars, two bodies along a whole side and rings, of both
degrees, with random lengths, cells, loads and friction. What is timed is the contact
solve and the pair, in processor seconds, the lesser of two runs.

    OMP_NUM_THREADS=1 python benchmarks/solver_choice.py [--bodies 100] [--seed 7]

prints a line a body, and the quantiles of the time of the choice over the time of the
faster solver.
"""

from __future__ import annotations

import argparse
import logging
from time import process_time

import numpy as np

import erc_contact as ec
from erc_contact.model.promises import bind
from erc_contact.newton.linear.choice import layer_size, multigrid_is_faster

MOST_DIRECT = 4_000
"""Size of the layer beyond which the direct solver is not tried: it takes a minute."""
Pair = tuple[ec.Scene, ec.Domain]


def layer(rng: np.random.Generator) -> Pair:
    """Make a layer on a foundation, pressed in its middle."""
    length = float(rng.uniform(10, 200))
    rows = int(rng.integers(2, 7))
    domain = ec.rectangle((0.0, 0.0), (length, 2.0), cells=(int(length * rows / 2), rows))
    load = ec.Traction("top", (lambda x: 0.1 * np.exp(-((x[0] / 4) ** 2)), -0.1))
    contact = ec.Contact("bottom", friction=float(rng.uniform(0, 0.6)))
    return ec.Scene(
        ec.Elastic(1e3, 0.3), [ec.Displacement("left", (0.0, None))], [load], [contact]
    ), domain


def compact(rng: np.random.Generator) -> Pair:
    """Make a rectangle that is pressed and sheared."""
    rows = int(rng.integers(8, 90))
    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2 * rows, rows))
    top = ec.Displacement("top", (float(rng.uniform(0, 0.02)), -0.02))
    contact = ec.Contact("bottom", friction=float(rng.uniform(0, 0.6)))
    return ec.Scene(ec.Elastic(1e3, 0.3), [top], contacts=[contact]), domain


def ring(rng: np.random.Generator) -> Pair:
    """Make a flat ring that is pressed on a foundation."""
    width = float(rng.uniform(1, 100))
    rows = int(rng.integers(3, 9))
    domain = ec.rectangle((1.0, 0.0), (1.0 + width, 1.0), cells=(int(width * rows) + 1, rows))
    material = ec.Elastic(1e3, 0.3, hypothesis="axisymmetric")
    contact = ec.Contact("bottom", friction=float(rng.uniform(0, 0.6)))
    return ec.Scene(material, [ec.Displacement("top", (None, -0.01))], contacts=[contact]), domain


def two_bodies(rng: np.random.Generator) -> Pair:
    """Make two strips that touch along their whole length."""
    length = float(rng.uniform(2, 100))
    rows = int(rng.integers(2, 6))
    cells = (int(length * rows) + 1, rows)
    strips = {
        "lower": ec.rectangle((0.0, 0.0), (length, 1.0), cells=cells),
        "upper": ec.rectangle((0.0, 1.0), (length, 2.0), cells=cells),
    }
    domain = ec.assembly(strips).joined("upper bottom", "lower top")
    held = ec.Displacement("lower bottom", (0.0, 0.0))
    pushed = ec.Displacement("upper top", (0.002, lambda x: -0.002 * (1 + 0.3 * np.cos(x[0] / 7))))
    friction = float(rng.uniform(0, 0.6))
    contact = ec.Contact("upper bottom", against="lower top", friction=friction)
    return ec.Scene(ec.Elastic(1e3, 0.3), [held, pushed], contacts=[contact]), domain


def in_3d(rng: np.random.Generator) -> Pair:
    """Make a box between a sheet, a bar and a cube, pressed and sheared."""
    sides = np.sort(10 ** rng.uniform(0, 1, 2))[::-1]
    count = 10 ** rng.uniform(2, 3.2)
    size = (sides.prod() / count) ** (1 / 3)
    cells = tuple(max(1, round(side / size)) for side in (*sides, 1.0))
    domain = ec.box((0.0, 0.0, 0.0), (*sides, 1.0), cells=cells)
    top = ec.Displacement("top", (0.01, 0.0, -0.02))
    contact = ec.Contact("bottom", friction=float(rng.uniform(0, 0.6)))
    return ec.Scene(ec.Elastic(1e3, 0.3), [top], contacts=[contact]), domain


def seconds(scene: ec.Scene, domain: ec.Domain, degree: int, solver: str) -> float:
    """Time a contact solve with its pair, the lesser of two runs [processor s]."""
    found = []
    for _ in range(2):
        began = process_time()
        ec.equilibrate(ec.solve(scene, domain, degree=degree, solver=solver))
        found.append(process_time() - began)
    return min(found)


def main() -> None:
    """Run the family."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bodies", type=int, default=100)
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    kinds = (layer, compact, ring, two_bodies, in_3d)
    ratios = []
    for number in range(arguments.bodies):
        rng = np.random.default_rng([arguments.seed, number])
        kind = kinds[number % len(kinds)]
        degree = int(rng.integers(1, 3))
        scene, domain = kind(rng)
        model = bind(scene, domain, degree)
        layer_of_body = layer_size(model)
        chosen = "iterative" if multigrid_is_faster(model) else "direct"
        times = {"iterative": seconds(scene, domain, degree, "iterative")}
        if layer_of_body <= MOST_DIRECT:
            times["direct"] = seconds(scene, domain, degree, "direct")
        if chosen not in times:
            times[chosen] = seconds(scene, domain, degree, chosen)
        ratios.append(times[chosen] / min(times.values()))
        unknowns = model.space.V.dofmap.index_map.size_global * model.space.d
        told = ", ".join(f"{solver} {took:.2f}" for solver, took in times.items())
        print(
            f"{number:3d} {kind.__name__:10s} degree {degree}, {unknowns:6d} unknowns, "
            f"{layer_of_body:5d} in the layer: {told} s; {chosen} {ratios[-1]:.2f}",
            flush=True,
        )
    median, most, greatest = np.quantile(ratios, [0.5, 0.95, 1.0])
    print(f"chosen over faster: median {median:.2f}, 95% {most:.2f}, greatest {greatest:.2f}")


if __name__ == "__main__":
    main()
