"""Certify random bodies with a potential, and test e against the exact energy.

A scene is a body in the plane, of revolution or in 3D, or two bodies in the plane,
pressed and pushed by displacements and loads on a foundation, without friction or with
Tresca friction, of degree 1 or 2, by Nitsche's method or the augmented Lagrangian. Its
law is plasticity with isotropic, kinematic or both hardenings, 1% to 100% of E, or by
a curve with convex parts and flat ones or a function, alone or with kinematic
hardening, and loads from below yielding to ten times as much; or two moduli in tension
and compression; or fibres that carry tension only. A reference is three uniform
refinements finer (two in 3D), of degree 2: the exact energy J(u) is in its interval.
Told are

    violations   e^2/2 < J(u^) - J(u), or e^2/2 < J*(sigma^) - J*(sigma), for each J(u)
                 of the interval: none is allowed
    index u      e / sqrt(2 (J(u^) - J(u))), at least 1
    index sigma  e / sqrt(2 (J*(sigma^) - J*(sigma))), likewise; the inverse squares of
                 both add up to 1
    law steps    linear contact problems of the solve

A history loads, unloads and loads again, each time in another way. Its last step is
tested against a reference that begins with the same state.

    OMP_NUM_THREADS=1 python benchmarks/potentials.py
        [scenes|histories|preloads|rates] [seed] [count]
        [curves|curve_histories|functions|function_histories] [seed] [count]

Of ``curves`` and ``curve_histories`` all laws harden by curves through points, of
``functions`` and ``function_histories`` by Voce's or Swift's function. Of ``preloads``
two halves of each body are pushed apart or drawn together, by a shift or by a force.

``rates`` prints eps against unknowns with ``Mark`` for a plastic layer. With it seed
and count mean nothing.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_families import scene_generator  # isort: skip
from laws import Fibres, TwoModuli  # isort: skip

E = 1.0
YIELD = 0.01
WIDTH = 2.0
PLANE, RINGS, SPACE = "plane", "rings", "space"
HYPOTHESES = {PLANE: "plane strain", RINGS: "axisymmetric", SPACE: "plane strain"}
LEVELS = {PLANE: 3, RINGS: 3, SPACE: 2}
"""Refinements to the reference."""
ROUND_OFF = 1e-10
"""Share of the energy below which two energies are the same [-]."""
SETTLED = 0.3
"""Greatest width of the interval of a reference that settles an index [-]."""


@dataclass(frozen=True)
class Body:
    """Hold what is random in a scene but its loads.

    Attributes:
        kind: Kind of the mesh.
        law: The material.
        words: The law in words.
        domain: The mesh.
        degree: Degree of the displacement.
        method: The contact method.
        friction: Friction of the contacts.
        curvature: Of the foundation [1/length].
        is_double: Whether there are two bodies.
    """

    kind: str
    law: Any
    words: str
    domain: ec.Domain
    degree: int
    method: ec.Method
    friction: Any
    curvature: float
    is_double: bool

    @property
    def name(self) -> str:
        """Tell what the body is."""
        of_friction = "Tresca friction" if self.friction else "smooth"
        bodies = "two bodies, " if self.is_double else ""
        return (
            f"{self.kind}, {bodies}{self.words}, degree {self.degree}, {of_friction}, "
            f"{type(self.method).__name__}"
        )


@dataclass(frozen=True)
class Row:
    """Hold what is measured of a scene.

    Attributes:
        eps: Relative error [-].
        plastic: Share of the volume that has yielded [-].
        index_u: See the head of the file; NaN where the reference does not settle it.
        index_sigma: Likewise.
        violations: Number of claims that do not hold, of two.
        law_steps: Of the scene and of its reference.
        seconds: Of the scene alone [s].
    """

    eps: float
    plastic: float
    index_u: float
    index_sigma: float
    violations: int
    law_steps: tuple[int, int]
    seconds: float


MakesLaw = Callable[[np.random.Generator, str], tuple[Any, str]]
"""Makes a random law of a kind of mesh, and tells it in words."""


def random_law(rng: np.random.Generator, kind: str) -> tuple[Any, str]:
    """Make a law, and tell it in words."""
    hypothesis = HYPOTHESES[kind]
    names = ["isotropic", "kinematic", "both", "two moduli", "fibres"]
    name = str(rng.choice(names, p=[0.25, 0.25, 0.2, 0.15, 0.15]))
    if name == "two moduli":
        share = float(10 ** rng.uniform(-2, 0))
        return TwoModuli(1.0, 0.4, share, hypothesis), f"two moduli {share:.2g}"
    if name == "fibres":
        fibre = float(10 ** rng.uniform(-1, 1))
        return Fibres(1.0, fibre, hypothesis), f"fibres {fibre:.2g}"
    slope = float(10 ** rng.uniform(-2, 0))
    share = {"isotropic": 1.0, "kinematic": 0.0, "both": rng.uniform()}[name]
    nu = float(rng.uniform(0.0, 0.45))
    law = ec.Plastic(E, nu, YIELD, share * slope, (1 - share) * slope, hypothesis)
    return law, f"{name} {slope:.1%}"


def random_curve(rng: np.random.Generator, kind: str) -> tuple[Any, str]:
    """Make a law that hardens by a curve, and tell it in words."""
    count = int(rng.integers(2, 9))
    steps = YIELD * 10 ** rng.uniform(-1, 0.5, count)
    slopes = E * 10 ** rng.uniform(-2, 0, count) * (rng.random(count) > 0.2)
    strain = np.append(0.0, np.cumsum(steps))
    stress = YIELD + np.append(0.0, np.cumsum(slopes * steps))
    curve = ec.HardeningCurve(strain.tolist(), stress.tolist())
    kinematic = float(rng.choice([0.0, 0.05]))
    nu = float(rng.uniform(0.0, 0.45))
    law = ec.Plastic(E, nu, None, curve, kinematic, HYPOTHESES[kind])
    return law, f"curve of {count + 1} points, kinematic {kinematic:.0%}"


def random_function(rng: np.random.Generator, kind: str) -> tuple[Any, str]:
    """Make a law that hardens by Voce's or Swift's function, and tell it in words."""
    if rng.random() < 0.6:
        rate = float(10 ** rng.uniform(0.5, 3))
        saturation = YIELD * float(10 ** rng.uniform(-1, 0.7))
        function: Any = ec.Voce(YIELD, saturation, rate, float(rng.choice([0.0, 0.02])))
        words = f"Voce +{saturation / YIELD:.1f} by {rate:.3g}"
    else:
        offset, exponent = float(10 ** rng.uniform(-3, -1)), float(rng.uniform(0.1, 0.8))
        function = ec.Swift(YIELD / offset**exponent, offset, exponent)
        words = f"Swift {offset:.2g} to the {exponent:.2f}"
    kinematic = float(rng.choice([0.0, 0.05]))
    nu = float(rng.uniform(0.0, 0.45))
    law = ec.Plastic(E, nu, None, function, kinematic, HYPOTHESES[kind])
    return law, f"{words}, kinematic {kinematic:.0%}"


MAKERS: dict[str, MakesLaw] = {"curve": random_curve, "funct": random_function}
"""What makes the laws of a kind of scenes, by its first letters."""


def random_body(rng: np.random.Generator, make: MakesLaw = random_law) -> Body:
    """Make a body with its contacts."""
    kind = str(rng.choice([PLANE, RINGS, SPACE], p=[0.55, 0.25, 0.2]))
    law, words = make(rng, kind)
    is_double = kind == PLANE and rng.random() < 0.3
    if kind == SPACE:
        domain = ec.box((0.0, 0.0, 0.0), (WIDTH, 1.0, 1.0), cells=(2, 1, 1))
    elif is_double:
        parts = {
            "upper": ec.rectangle((0.0, 1.0), (WIDTH, 2.0), cells=(4, 2)),
            "lower": ec.rectangle((0.0, 0.0), (WIDTH, 1.0), cells=(4, 2)),
        }
        domain = ec.assembly(parts).joined("upper bottom", "lower top")
    else:
        inner = float(rng.choice([0.0, 0.5])) if kind == RINGS else 0.0
        domain = ec.rectangle((inner, 0.0), (inner + WIDTH, 1.0), cells=(4, 2))
    degree = int(rng.integers(1, 3))
    if kind == SPACE:
        degree = 1 if rng.random() < 0.7 else 2
    method = ec.AugmentedLagrangian() if rng.random() < 0.5 else ec.Nitsche()
    friction: Any = 0.0
    if rng.random() < 0.5:
        friction = ec.Tresca(float(10 ** rng.uniform(-4, -2)))
    curvature = float(rng.choice([0.0, rng.uniform(0.0, 0.02)]))
    return Body(kind, law, words, domain, degree, method, friction, curvature, is_double)


def random_loads(rng: np.random.Generator, body: Body) -> ec.Scene:
    """Make the scene of a body with the loads of a step."""
    size = float(10 ** rng.uniform(-0.4, 1.1)) * YIELD
    along = float(rng.uniform(-0.5, 0.5)) * size
    press = -float(rng.uniform(0.2, 1.0)) * size
    motion = {PLANE: (along, press), RINGS: (None, press), SPACE: (along, 0.5 * along, press)}
    top, right, bottom = "top", "right", "bottom"
    if body.is_double:
        top, right, bottom = "upper top", "upper right", "lower bottom"
    loads = []
    if rng.random() < 0.4:
        strength = 0.3 * YIELD * min(size / YIELD, 1.5)
        density = strength * rng.normal(size=body.domain.dim)
        loads.append(ec.Traction(right, tuple(float(one) for one in density)))
    curvature = body.curvature
    gap = (lambda x: curvature * x[0] ** 2) if curvature else 0.0
    contacts = [ec.Contact(bottom, friction=body.friction, gap=gap)]
    if body.is_double:
        against = "lower top"
        contacts.append(ec.Contact("upper bottom", against=against, friction=body.friction))
    held = [ec.Displacement(top, motion[body.kind])]
    return ec.Scene(body.law, held, loads, contacts)


def random_preload(rng: np.random.Generator, body: Body) -> tuple[Body, ec.Scene]:
    """Make a body of two halves with a preload between them, and its scene."""
    make, depth = (ec.box, (0.0,)) if body.kind == SPACE else (ec.rectangle, ())
    cells = (2, 1, 1) if body.kind == SPACE else (4, 2)
    halves = {}
    for name, low in (("lower", 0.0), ("upper", 1.0)):
        top = (WIDTH, *(1.0 for _ in depth), low + 1.0)
        halves[name] = make((0.0, *depth, low), top, cells=cells)
    domain = ec.assembly(halves).joined("upper bottom", "lower top")
    body = replace(body, domain=domain, is_double=True)
    scene = random_loads(rng, body)
    if rng.random() < 0.5:
        shift = float(rng.uniform(-8.0, 4.0)) * YIELD
        tie = ec.Preload("upper bottom", "lower top", shortening=shift)
    else:
        area = np.pi * WIDTH**2 if body.kind == RINGS else WIDTH
        pushing = float(rng.uniform(0.3, 1.6)) * YIELD * area
        tie = ec.Preload("upper bottom", "lower top", force=-pushing)
    return body, replace(scene, contacts=scene.contacts[:1], ties=[tie])


def certified(solution: ec.Solution) -> ec.ConstitutiveError:
    """Certify a solution."""
    return ec.constitutive_error(ec.equilibrate(solution))


def law_steps(solution: ec.Solution) -> int:
    """Count the linear contact problems of a solve, which its reason tells."""
    return len(solution.reason.split("misfits of the law: ")[1].split(", "))


def measured(body: Body, scene: ec.Scene, after: ec.Solution | None = None) -> Row:
    """Certify a scene, or a step after another one, and its reference."""
    began = process_time()
    solution = ec.solve(scene, body.domain, body.method, degree=body.degree, after=after)
    error = certified(solution)
    seconds = process_time() - began
    fine = body.domain
    for _ in range(LEVELS[body.kind]):
        fine = fine.refined()
    finer = ec.solve(scene, fine, body.method, degree=2, after=after)
    return compared(error, certified(finer), seconds)


def compared(error: ec.ConstitutiveError, finer: ec.ConstitutiveError, seconds: float) -> Row:
    """Compare an error with the interval of the energy of a reference."""
    bounds, exact = ec.potential_energy(error), ec.potential_energy(finer)
    half = error.absolute**2 / 2
    round_off = ROUND_OFF * error.scale**2
    violations = int(bounds.low > exact.high + round_off)
    violations += int(bounds.high < exact.low - round_off)
    # The middle of the interval of the reference stands for J(u).
    middle = (exact.low + exact.high) / 2
    of_u, of_sigma = bounds.high - middle, middle - bounds.low
    width = exact.high - exact.low
    plastic = 0.0
    if isinstance(error.solution.scene.material, ec.Plastic):
        plastic = ec.results.plastic_share(error)
    return Row(
        error.relative,
        plastic,
        _index(half, of_u, width),
        _index(half, of_sigma, width),
        violations,
        (law_steps(error.solution), law_steps(finer.solution)),
        seconds,
    )


def _index(half: float, error: float, width: float) -> float:
    """Return the index of an energy, NaN where the reference is too coarse for it."""
    return float(np.sqrt(half / error)) if width < SETTLED * error else float("nan")


def run_history(rng: np.random.Generator, body: Body) -> Row:
    """Load, unload and load again; measure the last step."""
    first = random_loads(rng, body)
    solution = ec.solve(first, body.domain, body.method, degree=body.degree)
    support = first.supports[0]
    back = tuple(0.3 * one if isinstance(one, float) else None for one in support.value)
    held = [ec.Displacement(support.facets, back)]
    unloaded = ec.Scene(body.law, held, contacts=first.contacts)
    solution = ec.solve(unloaded, body.domain, body.method, degree=body.degree, after=solution)
    again = random_loads(rng, body)
    return measured(body, again, solution)


def study(kind: str, seed: int, count: int) -> None:
    """Measure scenes or histories of a seed, and print their distribution."""
    rows: list[Row] = []
    names: list[str] = []
    failed = 0
    for number in range(count):
        rng = scene_generator(seed, number)
        body = random_body(rng, MAKERS.get(kind[:5], random_law))
        try:
            if kind.endswith("histories"):
                row = run_history(rng, body)
            elif kind == "preloads":
                row = measured(*random_preload(rng, body))
            else:
                row = measured(body, random_loads(rng, body))
        except ec.ErcContactError as reason:
            failed += 1
            print(f"{number}: {body.name}: {type(reason).__name__}: {reason}", flush=True)
            continue
        rows.append(row)
        names.append(f"{number}: {body.name}")
        print(
            f"{names[-1]}: eps {row.eps:.2%}, plastic {row.plastic:.0%}, index u {row.index_u:.2f},"
            f" sigma {row.index_sigma:.2f}, law steps {row.law_steps[0]} and {row.law_steps[1]}, "
            f"{row.seconds:.1f} s{', VIOLATED' * (row.violations > 0)}",
            flush=True,
        )
    print(f"{count} {kind}, {failed} failed, {sum(row.violations for row in rows)} violations")
    for title, values in (
        ("index u", [row.index_u for row in rows]),
        ("index sigma", [row.index_sigma for row in rows]),
        ("law steps", [max(row.law_steps) for row in rows]),
        ("seconds", [row.seconds for row in rows]),
        ("eps", [row.eps for row in rows]),
        ("plastic share", [row.plastic for row in rows]),
    ):
        known = np.array(values, dtype=float)
        order = np.where(np.isfinite(known), known, -1.0)
        known = known[np.isfinite(known)]
        least, half, most, worst = np.quantile(known, [0.0, 0.5, 0.9, 1.0])
        print(
            f"{title:<14}{len(known):4d} known: least {least:.3g}, median {half:.3g}, "
            f"90% {most:.3g}, greatest {worst:.3g} ({names[int(order.argmax())]})"
        )


def rates() -> None:
    """Print eps against unknowns with ``Mark`` for a plastic layer under a wheel."""
    law = ec.Plastic(E, 0.3, YIELD, 0.02)
    scene = ec.Scene(
        law,
        [ec.Displacement("left", (0.0, None)), ec.Displacement("top", (None, -0.015))],
        contacts=[ec.Contact("bottom", gap=lambda x: x[0] ** 2 / 20)],
    )
    for degree, most in ((1, 40_000), (2, 12_000)):
        layer = ec.rectangle((0.0, 0.0), (WIDTH, 1.0), cells=(6, 3))
        history = ec.adapt(
            scene, layer, 1e-4, degree=degree, strategy=ec.Mark(), max_cells=most, max_steps=30
        )
        unknowns = 2 * np.array([_nodes(step.cells, degree) for step in history.steps])
        eps = history.column("eps")
        print(f"degree {degree}: plastic {ec.results.plastic_share(history):.0%}")
        for count, one in zip(unknowns, eps, strict=True):
            print(f"{count:9d} unknowns, eps {one:.4%}")
        last = len(eps) // 2
        slope = np.polyfit(np.log(unknowns[last:]), np.log(eps[last:]), 1)[0]
        print(f"degree {degree}: eps ~ unknowns^{slope:.2f} on the last half of the meshes")


def _nodes(cells: int, degree: int) -> float:
    """Return about how many nodes a mesh of triangles has."""
    return cells * degree**2 // 2


def main(kind: str = "scenes", seed: str = "0", count: str = "") -> None:
    """Run what is asked for."""
    if kind == "rates":
        rates()
    else:
        study(kind, int(seed), int(count or (20 if kind.endswith("histories") else 100)))


if __name__ == "__main__":
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    main(*sys.argv[1:])
