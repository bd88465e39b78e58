"""Measure contact between two bodies: true errors of random scenes, and extreme scenes.

``plane``, ``space``: two bricks, one on the other, with random sizes, moduli (ratio
1e-3 to 1e3), Poisson's ratios, gaps (none, a parabola, an interference, both), loads,
degrees, contact methods and order of the bodies; without friction, with Tresca's or
with Coulomb's (0 to 1). "both" is e over ``sqrt(|u - u^|^2 + |sigma - sigma^|^2)``,
which the theorem says is at least 1 but for Coulomb's friction; "index" is e over ``|u
- u^|``; "third" is the third term of the theorem over e^2. The reference is the
augmented Lagrangian of degree 2 on a mesh that cuts the cells as sigma^ does and
refines them three times, in 3D once.

``apart``: half a cylinder in a groove, or two bricks, in the plane. Both bodies keep
their shapes across a clearance or an interference, and have facets of other sizes.

``three``: three random bodies that meet at a point, in the plane, by both methods. A
multiplier keeps no condition exactly at such a point, so the reference is Nitsche's,
whose own error counts.

``extreme``, ``extreme_space``: which share of a grid of extreme scenes is solved and
certified, in the plane and in 3D: friction 0 to 2, nu to 0.4999, ratios of moduli
1e-6 to 1e6, slender bodies and flat cells, gaps and interference, both methods, both
orders. What fails is told in words.

    OMP_NUM_THREADS=1 python benchmarks/two_bodies.py [name|all] [seed] [count]
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from typing import Any

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, which loads MPI first
import numpy as np  # isort: skip
from attack_families import scene_generator  # isort: skip
from attack_tables import quantile_table  # isort: skip
from bricks import NAMES, PAIRS, bricks, joint  # isort: skip
from tasks import run  # isort: skip
from true_errors import reference, true_errors  # isort: skip

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
LEVELS = {2: 3, 3: 1}
"""Refinements of the reference beyond the cut at the barycentres, by dimension."""
METHODS: tuple[Any, ...] = (ec.Nitsche(), ec.AugmentedLagrangian())
BELOW = 1e-6
"""Share of e by which true errors may exceed it as round-off [-]."""


@dataclass(frozen=True)
class Case:
    """Hold a scene of two bodies.

    Attributes:
        name: What is special in the scene, in a few words.
        law: Kind of friction.
        scene: The scene.
        domain: The mesh.
        degree: Degree of the displacement.
        method: The contact method.
    """

    name: str
    law: str
    scene: ec.Scene
    domain: ec.Domain
    degree: int
    method: Any


def vector(d: int, along: float, down: float) -> tuple[float, ...]:
    """Return a vector along the first axis and down the last one."""
    return (along, *(0.0,) * (d - 2), -down)


def random_case(rng: np.random.Generator, d: int) -> Case:
    """Make two bricks, pressed on each other and pushed."""
    columns = int(rng.integers(2, 7)) if d == 2 else int(rng.integers(1, 4))
    rows = int(rng.integers(1, 5)) if d == 2 else int(rng.integers(1, 3))
    upper, lower = (float(height) for height in np.exp(rng.uniform(-1.0, 1.0, 2)))
    heights = (upper, lower)
    cells = (*(columns,) * (d - 1), rows)
    E = {"upper": 1.0, "lower": float(10 ** rng.uniform(-3.0, 3.0))}
    nu = {body: float(rng.uniform(-0.3, 0.49)) for body in E}
    # Strains are about as large as under this pressure on the softer body.
    press = float(rng.uniform(0.005, 0.03))
    push = float(rng.uniform(-0.5, 0.5)) * press
    soft = min(E.values())
    held = ec.Displacement("lower outer", (0.0,) * d)
    law = str(rng.choice(["none", "Tresca", "Coulomb"]))
    friction: Any = {
        "none": 0.0,
        "Tresca": ec.Tresca(float(rng.uniform(0.05, 0.5)) * press * soft),
        "Coulomb": float(rng.uniform(0.0, 1.0)),
    }[law]
    way = str(rng.choice(["moved", "loaded"] if law == "Coulomb" else ["moved"]))
    supports = [held]
    loads = []
    if way == "moved":
        depth = press * sum(heights)
        supports.append(ec.Displacement("upper outer", vector(d, push * sum(heights), depth)))
    else:
        # Friction holds it: the push is below the friction of the pressure.
        push = 0.8 * min(abs(push / press), float(friction)) * press
        loads.append(ec.Traction("upper outer", vector(d, push * soft, press * soft)))
    kind = str(rng.choice(["none", "parabola", "interference", "both"]))
    depth = press * min(heights)
    middle = float(rng.uniform(-0.5, 0.5))
    curvature = float(rng.uniform(0.2, 1.0)) * depth
    below = float(rng.uniform(0.1, 0.5)) * depth
    gap: Any = {
        "none": 0.0,
        "parabola": lambda x: curvature * (x[0] - middle) ** 2,
        "interference": -below,
        "both": lambda x: curvature * (x[0] - middle) ** 2 - below,
    }[kind]
    first, second = NAMES if rng.random() < 0.5 else NAMES[::-1]
    degree = int(rng.integers(1, 3)) if d == 2 else 1
    method = METHODS[int(rng.integers(len(METHODS)))]
    contact = ec.Contact(first, against=second, friction=friction, gap=gap)
    scene = ec.Scene(ec.Elastic(E, nu), supports, loads, [contact])
    name = (
        f"{cells} cells, heights {heights[0]:.2f}, {heights[1]:.2f}, E {E['lower']:.2g}, nu "
        f"{nu['upper']:.2f}, {nu['lower']:.2f}, {law}, gap {kind}, {way}, {first} first, degree "
        f"{degree}, {type(method).__name__}"
    )
    return Case(name, law, scene, bricks(d, cells, heights=heights), degree, method)


def random_joint(rng: np.random.Generator, method: Any = METHODS[0]) -> Case:
    """Make three bodies that meet at a point, pressed and pushed."""
    cells = 2 * int(rng.integers(1, 4))
    E = {body: float(10 ** rng.uniform(-2.0, 2.0)) for body in "abc"}
    nu = {body: float(rng.uniform(-0.3, 0.45)) for body in E}
    law = str(rng.choice(["none", "Tresca", "Coulomb"]))
    press = float(rng.uniform(0.005, 0.03))
    supports: list[Any] = [ec.Displacement("bottom", (0.0, 0.0))]
    loads: list[Any] = []
    # Body a is to the left of b, and must not be pushed into it.
    pushes = np.sort(rng.uniform(-0.5, 0.5, 2)) * press
    for name, push in zip(("top of a", "top"), pushes, strict=True):
        supports.append(
            ec.Displacement(name, (float(push), -2 * press * float(rng.uniform(0.3, 1.0))))
        )
    side = press * min(E.values()) * float(rng.uniform(0.0, 1.0))
    loads.append(ec.Traction("left", (side, 0.0)))
    loads.append(ec.Traction("right", (-side, 0.0)))
    contacts = []
    for first, second in PAIRS[3]:
        friction: Any = {
            "none": 0.0,
            "Tresca": ec.Tresca(float(rng.uniform(0.05, 0.5)) * press * min(E.values())),
            "Coulomb": float(rng.uniform(0.0, 1.0)),
        }[law]
        one, other = first + second, second + first
        if rng.random() < 0.5:
            one, other = other, one
        contacts.append(ec.Contact(one, against=other, friction=friction))
    degree = int(rng.integers(1, 3))
    scene = ec.Scene(ec.Elastic(E, nu), supports, loads, contacts)
    moduli = ", ".join(f"{value:.2g}" for value in E.values())
    name = f"{cells} x {cells} cells, E {moduli}, {law}, degree {degree}"
    return Case(name, law, scene, joint(2, 3, cells), degree, method)


def random_apart(rng: np.random.Generator, _: int) -> Case:
    """Make two bodies that keep their shapes, pressed on each other and pushed."""
    kind = str(rng.choice(["bricks", "groove"]))
    sizes = tuple(float(size) for size in rng.uniform(0.25, 0.8, 2))
    distance = float(rng.uniform(-0.02, 0.1))
    E = {"upper": 1.0, "lower": float(10 ** rng.uniform(-2.0, 2.0))}
    nu = {body: float(rng.uniform(-0.3, 0.45)) for body in E}
    press = float(rng.uniform(0.005, 0.03))
    law = str(rng.choice(["none", "Tresca", "Coulomb"]))
    friction: Any = {
        "none": 0.0,
        "Tresca": ec.Tresca(float(rng.uniform(0.05, 0.5)) * press * min(E.values())),
        "Coulomb": float(rng.uniform(0.0, 1.0)),
    }[law]
    radius = 1.0 + float(rng.uniform(0.01, 0.1))
    domain = drawn_apart(kind, sizes, distance, radius)
    push = float(rng.uniform(-0.3, 0.3)) * press
    supports = [
        ec.Displacement("upper top", (push, -press - max(distance, 0.0))),
        ec.Displacement("lower bottom", (0.0, 0.0)),
    ]
    first, second = ("upper side", "lower side")[:: int(rng.choice([-1, 1]))]
    # Normals that turn would be others on the finer mesh of the reference.
    normal = (0.0, -1.0 if first == "upper side" else 1.0)
    contact = ec.Contact(first, against=second, friction=friction, normal=normal)
    scene = ec.Scene(ec.Elastic(E, nu), supports, [], [contact])
    degree = int(rng.integers(1, 3))
    method = METHODS[int(rng.integers(len(METHODS)))]
    name = (
        f"{kind}, facets {sizes[0]:.2f}, {sizes[1]:.2f}, {distance:.3f} apart, radius "
        f"{radius:.3f}, E {E['lower']:.2g}, nu {nu['upper']:.2f}, {nu['lower']:.2f}, {law}, "
        f"{first} first, degree {degree}, {type(method).__name__}"
    )
    return Case(name, law, scene, domain, degree, method)


def drawn_apart(kind: str, sizes: tuple[float, ...], distance: float, radius: float) -> ec.Domain:
    """Make bricks, or half a cylinder of radius 1 above a groove, a distance apart."""
    bodies = {}
    heights = {"upper": (distance - 1.0, distance), "lower": (-2.5, -1.0)}
    middles = {"upper": distance, "lower": radius - 1.0}
    if kind == "groove":
        heights["lower"] = (-2.5, -0.5)
    for name, size in zip(heights, sizes, strict=True):
        low, high = heights[name]
        width = 1.0 if name == "upper" else 2.0
        r = 1.0 if name == "upper" else radius
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        body = [(2, occ.addRectangle(-width, low, 0.0, 2 * width, high - low))]
        if kind == "groove":
            disc = [(2, occ.addDisk(0.0, middles[name], 0.0, r, r))]
            body = (occ.intersect if name == "upper" else occ.cut)(body, disc)[0]
        occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        facing = low if name == "upper" else high
        side: Any = ec.where(y=facing)
        if kind == "groove":
            side = partial(_on_circle, middles[name], r)
        other = ("top", ec.where(y=high)) if name == "upper" else ("bottom", ec.where(y=low))
        bodies[name] = ec.from_gmsh(gmsh.model, parts=dict([("side", side), other]))
        gmsh.finalize()
    greatest = 1.2 * (abs(distance) + radius - 1.0) + 0.02
    return ec.assembly(bodies).joined("upper side", "lower side", apart=greatest)


def _on_circle(middle: float, radius: float, x: np.ndarray) -> np.ndarray:
    """Tell which points lie on a circle about a point of the second axis."""
    return np.isclose(np.hypot(x[0], x[1] - middle), radius)


def apart(seed: int = 0, count: int = 40) -> None:
    """Print the same for bodies that keep their shapes."""
    compare(seed, count, 2, random_apart)


def three(seed: int = 0, count: int = 50) -> None:
    """Print the same for three bodies that meet at a point."""
    for method in METHODS:
        make = partial(_joint_by, method)
        compare(seed, count, 2, make, method=ec.Nitsche())


def _joint_by(method: Any, rng: np.random.Generator, _: int) -> Case:
    """Make three bodies for a contact method."""
    return random_joint(rng, method)


def plane(seed: int = 0, count: int = 100) -> None:
    """Print quantiles of e over true errors, in the plane."""
    compare(seed, count, 2)


def space(seed: int = 0, count: int = 10) -> None:
    """Print the same in 3D."""
    compare(seed, count, 3)


def compare(
    seed: int,
    count: int,
    d: int,
    make: Callable[[np.random.Generator, int], Case] = random_case,
    **options: Any,
) -> None:
    """Print the quantiles of e over true errors of random scenes, and violations.

    Args:
        seed: Seed of the family.
        count: Number of scenes.
        d: Dimension.
        make: Maker of a scene.
        options: What the reference is solved with.
    """
    columns: dict[str, list[float]] = {}
    violations: list[str] = []
    for number in range(count):
        case = make(scene_generator(seed, number), d)
        try:
            solution = ec.solve(case.scene, case.domain, case.method, degree=case.degree)
            error = ec.constitutive_error(ec.equilibrate(solution))
            exact = reference(solution, LEVELS[d], degree=2, **options)
        except ec.ErcContactError as reason:
            print(f"scene {number} ({case.name}): {type(reason).__name__} {reason}", flush=True)
            continue
        true = true_errors(error.admissible, exact)
        both = error.absolute / true.of_both
        for kind in (case.law, type(case.method).__name__):
            columns.setdefault(f"both, {kind}", []).append(both)
        columns.setdefault(f"index, degree {case.degree}", []).append(error.absolute / true.of_u)
        if error.relative < 0.2:
            columns.setdefault("index, eps < 20%", []).append(error.absolute / true.of_u)
        if case.law == "Coulomb":
            columns.setdefault("third", []).append(true.friction / error.absolute**2)
        if both < 1 - BELOW:
            violations.append(
                f"scene {number}: both {both:.6f}, eps {error.relative:.1%}, third term "
                f"{true.friction / error.absolute**2:.4f} of e^2 ({case.name})"
            )
    print(quantile_table(dict(sorted(columns.items())), QUANTILES, "{:.4f}"))
    print(*(violations or ["no true error is above e"]), sep="\n", flush=True)


SHAPES: dict[str, tuple[tuple[int, int], tuple[int, int, int], tuple[float, float]]] = {
    "cubes": ((4, 2), (2, 2, 1), (1.0, 1.0)),
    "slender 1:50": ((2, 12), (1, 1, 6), (50.0, 50.0)),
    "flat cells 1:100": ((4, 4), (2, 2, 2), (0.02, 0.02)),
}
"""Cells in the plane and in 3D, and heights of bricks of width 2."""


def extreme(_seed: int = 0, _count: int = 0) -> None:
    """Print which share of extreme scenes in the plane is solved, and what fails."""
    solve_extremes(2)


def extreme_space(_seed: int = 0, _count: int = 0) -> None:
    """Print the same in 3D."""
    solve_extremes(3)


def solve_extremes(d: int) -> None:
    """Solve the grid of extreme scenes of a dimension, and print what fails."""
    grid = product(SHAPES, (0.0, 0.5, 2.0), (0.3, 0.4999), (1e-6, 1.0, 1e6), GAPS, (1, 2))
    solved: Counter[str] = Counter()
    tried: Counter[str] = Counter()
    for shape, mu, nu, ratio, gap, degree in grid:
        for first, method in product(("softer", "stiffer"), METHODS):
            if ratio == 1.0 and first == "stiffer":
                continue
            scene, domain = extreme_scene(d, shape, mu, nu, ratio, gap, first)
            label = f"{type(method).__name__}, {first} first"
            tried[label] += 1
            what = f"{shape}, mu {mu:g}, nu {nu:g}, ratio {ratio:g}, {gap}, degree {degree}"
            try:
                error = ec.constitutive_error(
                    ec.equilibrate(ec.solve(scene, domain, method, degree=degree))
                )
            except ec.ErcContactError as reason:
                print(f"{label}: {what}: {type(reason).__name__} {str(reason)[:200]}", flush=True)
                continue
            if error.relative < 1.0:
                solved[label] += 1
            else:
                print(f"{label}: {what}: eps {error.relative:.1%}", flush=True)
    for label, number in tried.items():
        print(f"{label}: {solved[label]} of {number} scenes are solved and certified below 100%")


GAPS = ("no gap", "parabola", "interference")


def extreme_scene(
    d: int, shape: str, mu: float, nu: float, ratio: float, gap: str, first: str
) -> tuple[ec.Scene, ec.Domain]:
    """Make an extreme scene and its mesh.

    Args:
        d: Dimension.
        shape: One of :data:`SHAPES`.
        mu: Friction coefficient [-].
        nu: Poisson's ratio of both bodies [-].
        ratio: Modulus of the lower body over the modulus of the upper body [-].
        gap: One of :data:`GAPS`.
        first: Which body is named first, "softer" or "stiffer".
    """
    in_plane, in_space, heights = SHAPES[shape]
    domain = extreme_bricks(d, in_plane if d == 2 else in_space, heights)
    depth = 0.01 * sum(heights)
    down = ec.Displacement("upper outer", vector(d, 0.3 * depth, depth))
    held = ec.Displacement("lower outer", (0.0,) * d)
    gaps: dict[str, Any] = {
        "no gap": 0.0,
        "parabola": lambda x: 0.5 * depth * x[0] ** 2,
        "interference": -0.5 * depth,
    }
    upper_first = (ratio >= 1.0) == (first == "softer")
    one, other = NAMES if upper_first else NAMES[::-1]
    contact = ec.Contact(one, against=other, friction=mu, gap=gaps[gap])
    material = ec.Elastic({"upper": 1.0, "lower": ratio}, nu)
    return ec.Scene(material, [down, held], [], [contact]), domain


@cache
def extreme_bricks(d: int, cells: tuple[int, ...], heights: tuple[float, float]) -> ec.Domain:
    """Make the bricks of a shape, once."""
    return bricks(d, cells, heights=heights)


TASKS: dict[str, Callable[..., None]] = {
    task.__name__: task for task in (plane, space, apart, three, extreme, extreme_space)
}


if __name__ == "__main__":
    run(TASKS)
