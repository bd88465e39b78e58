"""Small scenes at the edge of what a contact solver meets, for ``test_extremes.py`` (serial).

``benchmarks/extreme_bodies.py`` has the bodies. Which scenes have a solution is said in
``benchmarks/extreme_scenes.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import radians, tan

from extreme_bodies import (
    Pair,
    block,
    greco,
    hertz,
    in_a_channel,
    layered,
    partly_clamped,
    pressed,
    roller_pulled_off,
    standing,
    wedge,
)
from extreme_domains import cube, graded_tensor, halved, rotated, square, tower

import erc_contact as ec

SLIVERS = round(4 / tan(radians(1.0)))
SOLVABLE: dict[str, Callable[[], Pair]] = {
    **{
        f"nu {nu}, {n} squares": partial(block, nu=nu, n=n)
        for nu in (0.0, 0.49, 0.4999)
        for n in (4, 8)
    },
    **{
        f"mu {mu} sheared hard": lambda mu=mu: pressed(square(), (0.3, -0.05), friction=mu)
        for mu in (0.0, 1.0, 20.0)
    },
    "opens altogether": lambda: block((0.0, 0.05)),
    "just touches": lambda: block((0.0, -0.02), gap=0.02),
    "slips everywhere": lambda: pressed(square(), (1.0, -0.05)),
    "tips onto an edge": lambda: pressed(tower(), (1.0, -0.02), friction=1.0),
    "stands pushed": lambda: standing((0.3, -1.0)),
    "stands pushed to 98% of the limit": lambda: standing((0.49, -1.0)),
    "stands pushed, mu 20": lambda: standing((0.3, -1.0), friction=20.0),
    "stands above a gap": lambda: standing((0.3, -1.0), gap=0.01),
    "stands pushed in 3D": lambda: standing((0.2, 0.1, -1.0), cube(3)),
    "tower leans": lambda: standing((0.2, -1.0), tower(), friction=1.0),
    "slope 15 degrees, mu 0.5": lambda: standing((0.0, -1.0), rotated(square(), 15.0)),
    "slope 44 degrees, mu 1": lambda: standing(
        (0.0, -1.0), rotated(square(24, 24), 44.0), friction=1.0
    ),
    "wedge mu 0": lambda: wedge(0.0),
    "wedge mu 0.2, below the slope": lambda: wedge(0.2),
    "wedge mu 1, above the slope": lambda: wedge(1.0),
    "three contacts": in_a_channel,
    "column 1:100": lambda: pressed(
        ec.rectangle((0.0, 0.0), (1.0, 100.0), cells=(2, 200)), (0.5, -0.05)
    ),
    "soft at the contact": lambda: layered(halved(square(), 1, 0.5), 1.0, 1e6),
    "hard at the contact": lambda: layered(halved(square(), 1, 0.5), 1e6, 1.0),
    "graded 1:1e5 in rows": lambda: pressed(graded_tensor(16, 24, 1e-5)),
    "slivers along the contact": lambda: pressed(square(4, SLIVERS)),
    "slivers across the contact": lambda: pressed(square(SLIVERS, 4)),
    "one square": lambda: pressed(square(1, 1)),
    "contact next to a clamp": lambda: partly_clamped(lambda x: x[0] < 0.5),
    "one contact facet next to a clamp": lambda: partly_clamped(lambda x: x[0] < 0.87),
    "contact between two clamps": lambda: partly_clamped(lambda x: abs(x[0] - 0.5) > 0.25),
    "Hertz mu 0.3, sheared": lambda: hertz((0.01, -0.02), 0.3, size=0.05),
    "zero load": lambda: pressed(square(), (0.0, 0.0)),
    "free sideways": lambda: standing((0.0, -1.0), friction=0.0),
}
"""Scenes that have a solution."""

UNSOLVABLE: dict[str, Callable[[], Pair]] = {
    "nothing holds it sideways": lambda: standing((0.1, -1.0), friction=0.0),
    "pulled off": lambda: standing((0.0, 1.0)),
    "pulled off and sideways": lambda: standing((0.3, 0.5)),
    "pulled off a roller": lambda: roller_pulled_off(0.0),
    "pulled off a roller, mu 0.5": lambda: roller_pulled_off(0.5),
    "pushed beyond the limit": lambda: standing((0.3, -1.0), square(4, 4), friction=0.1),
    "pushed to 102% of the limit": lambda: standing((0.51, -1.0), square(4, 4)),
    "pushed beyond the limit above a gap": lambda: standing((0.6, -1.0), square(4, 4), gap=0.01),
    "slope 15 degrees, mu 0.2": lambda: standing(
        (0.0, -1.0), rotated(square(), 15.0), friction=0.2
    ),
    "tower tips over": lambda: standing((0.3, -1.0), tower(), friction=1.0),
    "wedge pulled out": lambda: wedge(0.2, 1.0),
    "beyond the limit in 3D": lambda: standing((0.4, 0.4, -1.0), cube(3)),
    "pulled off in 3D": lambda: standing((0.1, 0.0, 1.0), cube(3)),
}
"""Scenes that have none."""


def loaded(build: Callable[..., Pair], sideways: float, value: float) -> Pair:
    return build(push=(sideways * value, -value), domain=square())


UNITS: dict[str, list[Callable[[], Pair]]] = {
    "block": [
        partial(block, E=10.0**k, size=10.0**m, n=8)
        for k, m in ((0, 0), (-9, 0), (12, 0), (0, -6), (3, 3))
    ],
    "GRECO": [
        partial(greco, E=10.0**k, size=10.0**m)
        for k, m in ((0, 0), (-9, 0), (12, 0), (0, -6), (3, 3))
    ],
    "displacement": [partial(loaded, pressed, 0.4, 10.0**k) for k in (0, -100, -50, 50, 100)],
    "force": [partial(loaded, standing, 0.3, 10.0**k) for k in (0, -100, -50, 50, 100)],
}
"""Scenes that are the same in other units or, where no gap has a size, under a multiple of the load."""

BEYOND: dict[str, Callable[[], Pair]] = {
    f"{what} 1e{k:+d}": partial(loaded, build, sideways, 10.0**k)
    for what, build, sideways in (("displacement", pressed, 0.4), ("force", standing, 0.3))
    for k in (-300, -150, 150, 300)
}
"""Loads whose energies are beyond double precision: solved, or refused by an InputError."""
