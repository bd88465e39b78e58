"""Make scenes at the edge of what a contact solver meets.

Units, materials, friction, shapes, meshes, supports and loads are extreme.

Each is small (below 2000 cells) and says whether it has a solution at all.
`benchmarks/extremes.py` runs them.

Existence: with supports that hold the body, the discrete problem of static Coulomb
friction has a solution for any friction coefficient. A body that only contact holds has
one if the loads lie strictly inside what the friction cones can balance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import cos, radians, sin

import numpy as np
from extreme_bodies import (
    Pair,
    block,
    continuum_of_solutions,
    greco,
    held_at_the_side,
    hertz,
    in_a_channel,
    in_a_corner,
    layered,
    on_a_cylinder,
    on_a_sine,
    on_a_sphere,
    one_facet,
    partly_clamped,
    pressed,
    rod_on_its_side,
    roller_pulled_off,
    standing,
    wedge,
)
from extreme_domains import (
    cap_row,
    cube,
    graded_corner,
    graded_tensor,
    halved,
    mapped,
    rotated,
    square,
    tower,
)

import erc_contact as ec


@dataclass(frozen=True)
class Extreme:
    """Hold a scene of the grid.

    Attributes:
        build: Makes the scene and its domain.
        solvable: The scene has a solution; else it must end in an error of the solver,
            never in a field.
        refusable: Its numbers are beyond double precision: InputError is a right answer
            too.
        parameters: Fields of the contact method that the scene sets; methods without
            them leave it out.
        levels: Uniform refinements of a reference solution for the effectivity; 0 for
            none (serial, 2D only).
        same_as: Name of the scene that this one is in other units or under a multiple
            of its load, so that eps and the Newton steps must be the same.
    """

    build: Callable[[], Pair]
    solvable: bool = True
    refusable: bool = False
    parameters: Mapping[str, float] = field(default_factory=dict)
    levels: int = 0
    same_as: str = ""


def _units() -> dict[str, Extreme]:
    """Make sweeps of Young's modulus and of the size of the body.

    They are of a held body and of one that contact holds.
    """
    scenes = {}
    for what, build in (("block", block), ("GRECO", greco)):
        for k in range(-9, 13, 3):
            scenes[f"{what} E 1e{k:+d}"] = Extreme(
                lambda b=build, v=10.0**k: b(E=v, n=8), same_as=f"{what} E 1e+0"
            )
        for k in range(-6, 4, 3):
            scenes[f"{what} size 1e{k:+d}"] = Extreme(
                lambda b=build, v=10.0**k: b(size=v, n=8), same_as=f"{what} E 1e+0"
            )
    return scenes


def _parameters() -> dict[str, Extreme]:
    """Make scenes of extreme Poisson's ratio, friction, and method parameters."""
    scenes = {}
    for v in (0.0, 0.3, 0.45, 0.49, 0.499, 0.4999):
        for n in (4, 8):
            scenes[f"nu {v:g}, {n} squares across"] = Extreme(lambda v=v, n=n: block(nu=v, n=n))
    for v in (0.0, 0.01, 0.3, 1.0, 2.0, 5.0, 20.0):
        scenes[f"mu {v:g}"] = Extreme(lambda v=v: block(friction=v), levels=3)
        scenes[f"mu {v:g} sheared hard"] = Extreme(
            lambda v=v: pressed(square(), (0.3, -0.05), friction=v)
        )
    scenes["mu from 0 to 2"] = Extreme(lambda: block(friction=lambda x: x[0]))
    for k in range(-2, 7):
        scenes[f"gamma 1e{k:+d}"] = Extreme(lambda: block(n=8), parameters={"gamma": 10.0**k})
    for theta in (-1, 0, 1):
        scenes[f"theta {theta}"] = Extreme(
            lambda: block(n=8), parameters={"theta": theta}, levels=2
        )
        scenes[f"theta {theta} mu 2"] = Extreme(
            lambda: block(n=8, friction=2.0), parameters={"theta": theta}
        )
    return scenes


def _states() -> dict[str, Extreme]:
    """Make scenes whose contacts open, close, slip and tip.

    In some of them only contact holds the body.
    """
    return {
        "opens altogether": Extreme(lambda: block((0.0, 0.05))),
        "closes from a gap": Extreme(lambda: block(gap=0.02), levels=3),
        "gap that stays open": Extreme(lambda: block(gap=0.2)),
        "just touches": Extreme(lambda: block((0.0, -0.02), gap=0.02)),
        "slips everywhere": Extreme(lambda: pressed(square(), (1.0, -0.05)), levels=3),
        "tips onto an edge": Extreme(lambda: pressed(tower(), (1.0, -0.02), friction=1.0)),
        "GRECO 16 x 16": Extreme(lambda: greco(n=16)),
        "GRECO mu 0.3": Extreme(lambda: greco(friction=0.3), levels=3),
        "stands": Extreme(lambda: standing((0.0, -1.0)), levels=3),
        "stands pushed": Extreme(lambda: standing((0.3, -1.0)), levels=3),
        "stands pushed to 98% of the limit": Extreme(lambda: standing((0.49, -1.0))),
        "stands pushed, mu 20": Extreme(lambda: standing((0.3, -1.0), friction=20.0)),
        "stands above a gap": Extreme(lambda: standing((0.3, -1.0), gap=0.01)),
        "tower leans": Extreme(lambda: standing((0.2, -1.0), tower(), friction=1.0)),
        "slope 15 degrees, mu 0.5": Extreme(
            lambda: standing((0.0, -1.0), rotated(square(), 15.0)), levels=3
        ),
        "slope 44 degrees, mu 1": Extreme(
            lambda: standing((0.0, -1.0), rotated(square(24, 24), 44.0), friction=1.0)
        ),
        "body tilted to the foundation": Extreme(
            lambda: pressed(
                square(), normal=(sin(0.05), -cos(0.05)), gap=lambda x: sin(0.05) * (1 - x[0])
            )
        ),
        "wedge mu 0": Extreme(lambda: wedge(0.0), levels=3),
        "wedge mu 0.2, below the slope": Extreme(lambda: wedge(0.2), levels=3),
        "wedge mu 1, above the slope": Extreme(lambda: wedge(1.0)),
        "corner without friction": Extreme(in_a_corner),
        "continuum of solutions": Extreme(continuum_of_solutions),
        "three contacts": Extreme(in_a_channel),
    }


def _meshes() -> dict[str, Extreme]:
    """Make scenes of extreme meshes and shapes.

    Slender bodies, jumps of stiffness, graded meshes, slivers, few facets, curved
    foundations, 3D.
    """
    needle = 1 / np.tan(radians(1.0))
    return {
        "rod 100:1 on its side": Extreme(rod_on_its_side),
        "column 1:100": Extreme(
            lambda: pressed(ec.rectangle((0.0, 0.0), (1.0, 100.0), cells=(2, 200)), (0.5, -0.05))
        ),
        "soft at the contact 1:1e6": Extreme(lambda: layered(halved(square(), 1, 0.5), 1.0, 1e6)),
        "hard at the contact 1e6:1": Extreme(lambda: layered(halved(square(), 1, 0.5), 1e6, 1.0)),
        "soft and hard side by side": Extreme(lambda: layered(halved(square(), 0, 0.5), 1.0, 1e6)),
        "graded 1:1e5 in rows": Extreme(lambda: pressed(graded_tensor(16, 24, 1e-5))),
        "graded 1:1e5 at a corner": Extreme(lambda: pressed(graded_corner(3e-6))),
        "slivers along the contact": Extreme(lambda: pressed(square(4, round(4 * needle)))),
        "slivers across the contact": Extreme(lambda: pressed(square(round(4 * needle), 4))),
        "flat triangles on the contact": Extreme(lambda: pressed(cap_row(12, 1.0))),
        "sheared triangles": Extreme(
            lambda: pressed(mapped(square(12, 12), lambda x: (x[0] + 7 * x[1], x[1])), friction=1.0)
        ),
        "one square": Extreme(lambda: pressed(square(1, 1)), levels=4),
        "one contact facet": Extreme(one_facet),
        "contact next to a clamp": Extreme(lambda: partly_clamped(lambda x: x[0] < 0.5)),
        "one contact facet next to a clamp": Extreme(lambda: partly_clamped(lambda x: x[0] < 0.87)),
        "contact between two clamps": Extreme(
            lambda: partly_clamped(lambda x: abs(x[0] - 0.5) > 0.25)
        ),
        "end of the contact fixed": Extreme(held_at_the_side, levels=2),
        "Hertz": Extreme(lambda: hertz((0.0, -0.02), 0.0)),
        "Hertz mu 0.3, sheared": Extreme(lambda: hertz((0.01, -0.02), 0.3)),
        "cylinder": Extreme(lambda: pressed(square(16, 16), gap=on_a_cylinder), levels=2),
        "cylinder without friction": Extreme(
            lambda: pressed(square(16, 16), gap=on_a_cylinder, friction=0.0)
        ),
        "sine": Extreme(lambda: pressed(square(24, 24), gap=on_a_sine)),
        "3D cube": Extreme(lambda: pressed(cube(), (0.03, 0.01, -0.05))),
        "3D cube mu 2": Extreme(lambda: pressed(cube(), (0.1, 0.04, -0.05), friction=2.0)),
        "3D sphere": Extreme(lambda: pressed(cube(), (0.01, 0.005, -0.05), gap=on_a_sphere)),
        "3D stands": Extreme(lambda: standing((0.0, 0.0, -1.0), cube())),
        "3D stands pushed": Extreme(lambda: standing((0.2, 0.1, -1.0), cube())),
    }


def _loads() -> dict[str, Extreme]:
    """Make scenes of no load, of extreme loads, and of loads that nothing balances."""
    scenes = {
        "zero load": Extreme(lambda: pressed(square(), (0.0, 0.0))),
        "free sideways": Extreme(lambda: standing((0.0, -1.0), friction=0.0)),
    }
    for k in (-300, -150, -100, -50, 0, 50, 100, 150, 300):
        for what, build, force in (("displacement", pressed, 0.4), ("force", standing, 0.3)):
            scenes[f"{what} 1e{k:+d}"] = Extreme(
                lambda b=build, f=force, v=10.0**k: b(push=(f * v, -v), domain=square()),
                refusable=abs(k) >= 150,  # an energy of 1e-300 is lost in what is added to it
                same_as=f"{what} 1e+0",
            )
    unsolvable: dict[str, Callable[[], Pair]] = {
        "nothing holds it sideways": lambda: standing((0.1, -1.0), friction=0.0),
        "pulled off": lambda: standing((0.0, 1.0)),
        "pulled off and sideways": lambda: standing((0.3, 0.5)),
        "pulled off a roller": lambda: roller_pulled_off(0.0),
        "pulled off a roller, mu 0.5": lambda: roller_pulled_off(0.5),
        "pushed beyond the limit": lambda: standing((0.3, -1.0), friction=0.1),
        "pushed to 102% of the limit": lambda: standing((0.51, -1.0)),
        "pushed beyond the limit above a gap": lambda: standing((0.6, -1.0), gap=0.01),
        "slope 15 degrees, mu 0.2": lambda: standing(
            (0.0, -1.0), rotated(square(), 15.0), friction=0.2
        ),
        "tower tips over": lambda: standing((0.3, -1.0), tower(), friction=1.0),
        "wedge pulled out": lambda: wedge(0.2, 1.0),
        "3D pushed beyond the limit": lambda: standing((0.4, 0.4, -1.0), cube(3)),
        "3D pulled off": lambda: standing((0.1, 0.0, 1.0), cube(3)),
    }
    return scenes | {name: Extreme(build, solvable=False) for name, build in unsolvable.items()}


SCENES: dict[str, Extreme] = _units() | _parameters() | _states() | _meshes() | _loads()
"""The scenes by name."""
