"""Run families of bodies that contacts alone hold, and count words on statics.

``python benchmarks/standing.py [seed] [count]`` runs each family so often with random
numbers, to eps = 10%, and prints the doubt of :mod:`erc_contact.newton.displaced` and
how many runs say that the model cannot tell whether a body stands. Ordinary families
should say nothing; bodies of the others tilt, roll or sway so far that their moments
change.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

import erc_contact as ec
from erc_contact.newton.displaced import MISSING, missing_moments
from namedmesh.gmsh_session import session

LAW = ec.Elastic(1.0, 0.3)
Case = tuple[ec.Scene, ec.Domain]
"""A scene and its first mesh."""
Family = Callable[[np.random.Generator], Case]
"""Makes a random case."""


def disc(size: float, parts: dict[str, Any], centre: tuple[float, float] = (0.0, 0.0)) -> ec.Domain:
    """Return a disc of radius 1 whose parts have rules.

    It has vertices at its four ends, where plates touch it first.
    """
    comm = MPI.COMM_WORLD

    def build(gmsh: Any) -> None:
        occ = gmsh.model.occ
        x, y = centre
        middle = occ.addPoint(x, y, 0)
        ends = [occ.addPoint(*end, 0) for end in ((x + 1, y), (x, y + 1), (x - 1, y), (x, y - 1))]
        quarters = [occ.addCircleArc(a, middle, b) for a, b in pairwise([*ends, ends[0]])]
        occ.addPlaneSurface([occ.addCurveLoop(quarters)])
        occ.remove([(0, middle)])
        occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)

    with session(comm, build, "The disc") as model:
        return ec.from_gmsh(model, comm, parts=parts)


def towards(normal: tuple[float, float], wide: float = 0.35) -> Callable[[np.ndarray], np.ndarray]:
    """Return a rule for the arc of a disc about the origin in a direction."""
    return lambda x: x[0] * normal[0] + x[1] * normal[1] > np.cos(wide)


def round_gap(normal: tuple[float, float]) -> Callable[[Any], Any]:
    """Return the distance of a disc about the origin from its tangent plane."""
    return lambda x: 1.0 - ufl.sqrt(1.0 - (x[0] * normal[1] - x[1] * normal[0]) ** 2)


def touching(part: str, normal: tuple[float, float], friction: float, **more: Any) -> ec.Contact:
    """Return the contact of a disc with its tangent plane."""
    return ec.Contact(part, friction=friction, gap=round_gap(normal), normal=normal, **more)


def standing(width: float, height: float, size: float, load: tuple[Any, ...], **floor: Any) -> Case:
    """Return a block on a floor, with a traction on its top."""
    domain = ec.rectangle((-width / 2, 0.0), (width / 2, height), size=size)
    contact = ec.Contact("bottom", **{"friction": 0.6, **floor})
    return ec.Scene(LAW, loads=[ec.Traction("top", load)], contacts=[contact]), domain


def pressed(p: float, lean: float) -> Callable[[Any], Any]:
    """Return a pressure that changes along x, as a component of a traction."""
    return lambda x: -p * (1.0 + lean * x[0])


def block(rng: np.random.Generator) -> Case:
    """A block under an eccentric load that leans."""
    width, ratio, p = rng.uniform(0.5, 2), rng.uniform(0.5, 2), 10 ** rng.uniform(-5, -2.3)
    shear = rng.uniform(-0.2, 0.2) * p * min(1.0, 0.5 / ratio)
    load = (shear, pressed(p, rng.uniform(-1.8, 1.8) / width))
    return standing(width, ratio * width, width / 6, load)


def between_plates(rng: np.random.Generator, along: float = 0.0) -> Case:
    """A disc between two plates, of which one moves."""
    domain = disc(rng.uniform(0.12, 0.25), {"low": towards((0, -1)), "up": towards((0, 1))})
    down = 10 ** rng.uniform(-4, -2)
    low = touching("low", (0.0, -1.0), rng.uniform(0.2, 0.6))
    up = touching("up", (0.0, 1.0), 0.5, motion=(along, -down))
    return ec.Scene(LAW, contacts=[low, up]), domain


def stack(rng: np.random.Generator) -> Case:
    """Two to four blocks on each other, each a little beside the block below."""
    count = int(rng.integers(2, 5))
    moduli: dict[str, Any] = {}
    parts = {}
    left = 0.0
    for i in range(count):
        left += rng.uniform(-0.1, 0.1)
        width = rng.uniform(0.8, 1.2)
        parts[f"b{i}"] = ec.rectangle((left, i), (left + width, i + 1.0), size=0.3)
        moduli[f"b{i}"] = 10 ** rng.uniform(0, 1)
    domain = ec.assembly(parts)
    contacts = [ec.Contact("b0 bottom", friction=0.5)]
    for i in range(count - 1):
        pair = (f"b{i} top", f"b{i + 1} bottom")
        domain = domain.joined(*pair)
        contacts.append(ec.Contact(*pair, friction=rng.uniform(0.2, 0.6)))
    load = ec.Traction(f"b{count - 1} top", (0.0, -(10 ** rng.uniform(-5, -2.5))))
    return ec.Scene(ec.Elastic(moduli, 0.3), loads=[load], contacts=contacts), domain


def groove(rng: np.random.Generator) -> Case:
    """A disc in a groove, under its weight."""
    angle = rng.uniform(0.5, 1.0)
    normals = {side: (sign * np.sin(angle), -np.cos(angle)) for side, sign in SIDES.items()}
    domain = disc(rng.uniform(0.12, 0.2), {side: towards(n) for side, n in normals.items()})
    mu = float(rng.choice([0.0, 0.2, 0.5]))
    contacts = [touching(side, n, mu) for side, n in normals.items()]
    weight = ec.BodyForce((0.0, -(10 ** rng.uniform(-5, -2.7))))
    return ec.Scene(LAW, loads=[weight], contacts=contacts), domain


SIDES = {"right": 1.0, "left": -1.0}
"""Sides of a groove, and the signs of their normals along x."""


def press_fit(rng: np.random.Generator) -> Case:
    """A block that two others clamp."""
    high = rng.uniform(0.5, 1.5)
    middle = ec.rectangle((0.0, 0.1 * high), (1.0, 0.8 * high), size=0.2)
    sides = [ec.rectangle((x, 0.0), (x + 1.0, high), size=0.25) for x in (-1.0, 1.0)]
    domain = ec.assembly({"l": sides[0], "m": middle, "r": sides[1]})
    domain = domain.joined("l right", "m left").joined("m right", "r left")
    gap = -(10 ** rng.uniform(-4, -2))
    supports = [ec.Displacement("l left", (0.0, 0.0)), ec.Displacement("r right", (0.0, 0.0))]
    weight = ec.BodyForce((0.0, 0.3 * gap * rng.uniform(0, 1)))
    contacts = [
        ec.Contact("l right", "m left", 0.4, gap=gap),
        ec.Contact("m right", "r left", 0.4, gap=gap * rng.uniform(0.5, 1)),
    ]
    return ec.Scene(LAW, supports, [weight], contacts), domain


def strut(rng: np.random.Generator) -> Case:
    """A column between two plates, of which one moves."""
    height = rng.uniform(3, 8)
    domain = ec.rectangle((0.0, 0.0), (1.0, height), size=0.25)
    down = 10 ** rng.uniform(-4, -2.3) * height
    up = ec.Contact("top", friction=0.4, motion=(rng.uniform(-0.1, 0.1) * down, -down))
    return ec.Scene(LAW, contacts=[ec.Contact("bottom", friction=0.4), up]), domain


def box(rng: np.random.Generator) -> Case:
    """A box in 3D under an eccentric load that leans."""
    domain = ec.box((0.0,) * 3, (1.0, *rng.uniform(0.7, 1.5, 2)), cells=(3, 3, 3))
    p = 10 ** rng.uniform(-5, -2.5)
    load = ec.Traction("top", (0.05 * p, 0.03 * p, pressed(p, rng.uniform(-0.6, 0.6))))
    return ec.Scene(LAW, loads=[load], contacts=[ec.Contact("bottom", friction=0.4)]), domain


def table(rng: np.random.Generator) -> Case:
    """A block on two small feet."""
    domain = ec.rectangle((-1.0, 0.0), (1.0, rng.uniform(0.5, 1.5)), cells=(20, 10))
    feet = {"one": ec.where(y=0.0, x=(0.6, 0.8)), "two": ec.where(y=0.0, x=(-0.8, -0.6))}
    p = 10 ** rng.uniform(-5, -3)
    load = ec.Traction("top", (0.1 * p, pressed(p, rng.uniform(-0.7, 0.7))))
    contacts = [ec.Contact(foot, friction=0.4) for foot in feet]
    return ec.Scene(LAW, loads=[load], contacts=contacts), domain.named(feet)


def tilting(rng: np.random.Generator) -> Case:
    """A soft block at 93 to 99% of the shear that tips it."""
    height, p, share = rng.uniform(1.5, 4), 10 ** rng.uniform(-3, -1.9), rng.uniform(0.93, 0.99)
    return standing(1.0, height, 0.15, (share * p * 0.5 / height, -p), friction=5.0)


def rolling(rng: np.random.Generator) -> Case:
    """A disc that rolls between two plates by 0.5 to 5% of its radius."""
    return between_plates(rng, along=rng.uniform(0.01, 0.1))


def rocker(rng: np.random.Generator) -> Case:
    """A block with a round base under an eccentric load."""
    radius, p, lean = rng.uniform(1, 3), 10 ** rng.uniform(-5, -3), 3 * rng.uniform(0.05, 0.2)
    gap = partial(_parabola, radius)
    return standing(2.0, 1.0, 0.12, (0.0, pressed(p, lean)), gap=gap)


def _parabola(radius: float, x: Any) -> Any:
    """Return the gap of a round base."""
    return x[0] ** 2 / (2 * radius)


def column(rng: np.random.Generator) -> Case:
    """A soft column under an eccentric load that stays vertical."""
    height = rng.uniform(5, 8)
    p = rng.uniform(0.004, 0.01) * (6 / height) ** 2
    return standing(1.0, height, 0.2, (0.0, pressed(p, 1.6)))


def pyramid(share: float) -> Case:
    """Return a cylinder on two others, with a share of the friction that it takes."""
    half, wide = 1.05, np.radians(16)
    slope = float(np.arccos(half / 2))
    places = {"A": (-half, 0.0), "B": (half, 0.0), "C": (0.0, 2 * np.sin(slope))}
    down = -np.pi / 2
    arcs = {
        "A": {"floor": down, "side": slope},
        "B": {"floor": down, "side": np.pi - slope},
        "C": {"left": np.pi + slope, "right": -slope},
    }
    bodies = {}
    for name, place in places.items():
        parts = {part: partial(_on_arc, place, angle, wide) for part, angle in arcs[name].items()}
        bodies[name] = disc(0.12, parts, place)
    domain = ec.assembly(bodies)
    mu = share * np.tan((np.pi / 2 - slope) / 2)
    contacts = []
    for name, upper in (("A", "C left"), ("B", "C right")):
        domain = domain.joined(f"{name} side", upper, apart=0.1)
        angle = arcs[name]["side"]
        n = (float(np.cos(angle)), float(np.sin(angle)))
        on_floor = ec.Contact(
            f"{name} floor", friction=0.3, gap=lambda x: x[1] + 1.0, normal=(0.0, -1.0)
        )
        gap = partial(_of_cylinders, places[name], n)
        contacts += [on_floor, ec.Contact(f"{name} side", upper, mu, gap, normal=n)]
    weight = ec.BodyForce((0.0, -1.0))
    return ec.Scene(ec.Elastic(1e4, 0.3), loads=[weight], contacts=contacts), domain


def _on_arc(place: tuple[float, float], angle: float, wide: float, x: np.ndarray) -> np.ndarray:
    """Tell which points are on an arc of a disc."""
    along = (x[0] - place[0]) * np.cos(angle) + (x[1] - place[1]) * np.sin(angle)
    return np.asarray(along > np.cos(wide))


def _of_cylinders(place: tuple[float, float], n: tuple[float, float], x: Any) -> Any:
    """Return the distance of two equal cylinders along the line of their centres."""
    across = (x[0] - place[0]) * -n[1] + (x[1] - place[1]) * n[0]
    return 2.0 * (1.0 - ufl.sqrt(1.0 - across**2))


ORDINARY: dict[str, Family] = {
    family.__name__: family
    for family in (block, between_plates, stack, groove, press_fit, strut, box, table)
}
"""Families that stand."""
DOUBTFUL: dict[str, Family] = {
    family.__name__: family for family in (tilting, rolling, rocker, column)
}
"""Families of which small displacements cannot say it."""


def run(case: Case, accuracy: float = 0.1) -> tuple[float, ec.History]:
    """Return the doubt at the end of a run, and the run."""
    scene, domain = case
    degree = 1 if domain.dim == 3 else 2
    history = ec.adapt(scene, domain, accuracy, degree=degree, max_cells=5000)
    found = missing_moments(history.solution.model, history.solution.u, history.solution.traction)
    return max((missing.doubt for missing in found), default=0.0), history


def main() -> None:
    """Print the doubts of all families."""
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 25
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    for name, family in {**ORDINARY, **DOUBTFUL}.items():
        found = []
        refused = 0
        for number in range(seed, seed + count):
            try:
                found.append(run(family(np.random.default_rng(number)))[0])
            except ec.ErcContactError:
                refused += 1
        words = sum(doubt > MISSING for doubt in found)
        line = f"{min(found):.2g} to {max(found):.2g}, {words} of {len(found)} say it"
        print(f"{name:16} {line}, {refused} refused", flush=True)
    for share in (1.3, 1.05, 0.98, 0.9, 0.6):
        doubt, _ = run(pyramid(share), 0.05)
        print(f"pyramid with {share:4} of the friction: {doubt:.2g}", flush=True)


if __name__ == "__main__":
    main()
