"""Attack bodies of several kinds with random scenes, and evaluate them anew (serial).

Scenes are those of ``potentials.py``: a body in the plane, of revolution or in 3D, or
two bodies in the plane, pressed and pushed on a foundation, without friction or with
Tresca friction, of degree 1 or 2, by both methods. Of the kind

    orthotropic  moduli differ by up to 30 times and axes are turned; of two bodies the
                 lower one is elastic in half of the scenes
    heated       bodies yield and harden linearly or by a curve; strains of heat up to
                 three yield strains, constant or varying
    remote       a force and a moment at a point away from a side
    sections     the top is a section that stays plane, by a force or a motion, and a
                 moment or a rotation

A reference is finer by two uniform refinements (in 3D one), of degree 2. Told are

    violations   ends of the interval of the energy on the wrong side of the interval of
                 the reference: none is allowed
    index        e over ``sqrt(2 (J(u^) - J(u)))``, at least 1
    law          e^2 with its law part by ``own_energies.py`` over e^2, less 1: where
                 data vary, e^2 may have a thousandth more that integrals leave unknown
    resultants   what is missing in the force and the moment of sigma^ on the boundary,
                 and on a part for which they are given, over the sum of all forces

    OMP_NUM_THREADS=1 python benchmarks/families.py [kind|all] [seed] [count]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_families import scene_generator  # isort: skip
from attack_tables import quantile_table  # isort: skip
from pair_evaluation import areas, gathered, gauss, on_sides  # isort: skip
from own_energies import (
    PAIRS,
    PLANE,
    RINGS,
    SPACE,
    Field,
    Yielding,
    compliance_of,
    law_part,
    linear,
)  # isort: skip

from potentials import HYPOTHESES, ROUND_OFF, SETTLED, YIELD  # isort: skip
from potentials import Body, certified, random_body, random_curve, random_loads  # isort: skip
from tasks import run, tell  # isort: skip

from erc_contact.error.contact import contact_squares  # isort: skip

QUANTILES = (0.0, 0.1, 0.5, 0.9, 1.0)
"""Quantiles of the table."""
SLOPE = 0.05
"""Least slope of linear hardening [-]."""
LEVELS = {PLANE: 2, RINGS: 2, SPACE: 1}
"""Refinements to the reference."""
OWN = 2e-3
"""e^2 of this file beyond e^2 of the package that is told: kinks of the law [-]."""
LEFT = 2e-3
"""Likewise the other way round."""
BALANCED = 1e-8
"""Missing resultant that is told [-]."""
LEAST_FORCE = 1e-6 * YIELD
"""Sum of forces below which they are round-off: the body does not touch [force]."""


def cold(x: np.ndarray) -> Any:
    """Return no strain of heat [-]."""
    return 0.0 * x[0]


@dataclass(frozen=True)
class Given:
    """Hold the resultants of a part: numbers, NaN where none is given.

    Attributes:
        part: Its name.
        force: Force [force], shape (d,).
        moment: Moment [force length], shape (1,) or (3,); None for no moment.
        about: The point of the moment [length], shape (d,).
    """

    part: str
    force: np.ndarray
    moment: np.ndarray | None = None
    about: np.ndarray | None = None


@dataclass(frozen=True)
class Sample:
    """Hold a scene of a kind, with what its own evaluation needs.

    Attributes:
        body: The body.
        scene: Its scene.
        law_of: Makes its own law, see :func:`own_energies.law_part`.
        heat: Its strain of heat.
        given: Force and moment of a part.
    """

    body: Body
    scene: ec.Scene
    law_of: Callable[[bool], Any]
    heat: Field = cold
    given: Given | None = None


def random_axes(rng: np.random.Generator, kind: str) -> np.ndarray:
    """Return axes at random; the third one is out of the plane."""
    if kind == SPACE:
        Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        return np.asarray(Q)
    c, s = np.cos(angle := rng.uniform(0.0, np.pi)), np.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def random_orthotropic(rng: np.random.Generator, kind: str) -> tuple[Any, str]:
    """Make an orthotropic law of positive energy, and tell it in words."""
    moduli = 10 ** rng.uniform(-1.5, 0.0, 3)
    roots = np.sqrt(moduli)
    hypothesis = HYPOTHESES[kind]
    if kind == PLANE and rng.random() < 0.3:
        hypothesis = "plane stress"
    # With shares below 1/2 the matrix of normal stresses is diagonally dominant.
    shares = rng.uniform(-0.3, 0.49, 3)
    nu: Any = tuple(float(shares[n] * roots[i] / roots[j]) for n, (i, j) in enumerate(PAIRS))
    shear = 10 ** rng.uniform(-1.5, 0.0, 3) / 2
    law = ec.OrthotropicElastic(
        tuple(moduli.tolist()),
        nu,
        tuple(shear.tolist()),
        random_axes(rng, kind).tolist(),
        hypothesis,
    )
    return law, f"orthotropic, {hypothesis}"


def random_elastic(rng: np.random.Generator, kind: str) -> tuple[Any, str]:
    """Make an elastic law, and tell it in words."""
    nu = float(rng.uniform(0.0, 0.45))
    return ec.Elastic(1.0, nu, hypothesis=HYPOTHESES[kind]), f"nu {nu:.2f}"


def random_plastic(rng: np.random.Generator, kind: str) -> tuple[Any, str]:
    """Make a law that yields, and tell it in words."""
    if rng.random() < 0.5:
        return random_curve(rng, kind)
    slope = float(10 ** rng.uniform(np.log10(SLOPE), 0.0))
    share = float(rng.choice([0.0, 1.0, rng.uniform()]))
    nu = float(rng.uniform(0.0, 0.45))
    law = ec.Plastic(1.0, nu, YIELD, share * slope, (1 - share) * slope, HYPOTHESES[kind])
    return law, f"slope {slope:.1%}"


def own_law(law: Any, kind: str) -> Any:
    """Return a linear law as this benchmark knows it."""
    in_plane_stress = law.hypothesis == "plane stress"
    if isinstance(law, ec.OrthotropicElastic):
        S = compliance_of(law.E, law.nu, law.G, law.axes)
    else:
        shear = law.E / (2 * (1 + law.nu))
        S = compliance_of((law.E,) * 3, (law.nu,) * 3, (shear,) * 3, np.eye(3))
    return linear(S, kind, in_plane_stress=in_plane_stress)


def orthotropic(rng: np.random.Generator) -> Sample:
    """Make an orthotropic body, or one on an elastic body."""
    body = random_body(rng, random_orthotropic)
    laws = {True: body.law, False: body.law}
    if body.is_double and rng.random() < 0.5:
        laws[False] = ec.Elastic(0.5, 0.3, hypothesis=body.law.hypothesis)
        body = replace(body, law={"upper": laws[True], "lower": laws[False]})
    owns = {above: own_law(law, body.kind) for above, law in laws.items()}
    if not body.is_double:
        owns[True] = owns[False]
    return Sample(body, random_loads(rng, body), owns.__getitem__)


def heated(rng: np.random.Generator) -> Sample:
    """Make a body that yields under loads and heat."""
    body = random_body(rng, random_plastic)
    size, slope, rate = rng.uniform((-3 * YIELD, -YIELD, 1.0), (3 * YIELD, YIELD, 4.0)).tolist()
    fields: list[Field] = [
        lambda x: size + 0 * x[0],
        lambda x: size + slope * x[0],
        lambda x: size * np.sin(rate * x[0]) * np.exp(-x[1]),
    ]
    heat = fields[int(rng.integers(3))]
    scene = replace(random_loads(rng, body), strains=[ec.ThermalStrain(1.0, heat)])
    own = Yielding(body.law, body.kind)
    return Sample(body, scene, lambda above: own, heat)


def remote(rng: np.random.Generator) -> Sample:
    """Make a body with a force at a point away from a side."""
    body = random_body(rng, random_elastic)
    d = body.domain.dim
    part = "upper right" if body.is_double else "right"
    force = 0.5 * YIELD * rng.normal(size=d)
    if body.kind == RINGS:
        force[0] = 0.0
        given = Given(part, force)
        load = ec.RemoteForce(part, force.tolist())
    else:
        moment = 0.5 * YIELD * rng.normal(size=1 if d == 2 else 3)
        at = 3.0 * rng.normal(size=d)
        given = Given(part, force, moment, at)
        load = ec.RemoteForce(part, force.tolist(), moment=moment.tolist(), at=at.tolist())
    scene = replace(random_loads(rng, body), loads=[load])
    own = own_law(body.law, body.kind)
    return Sample(body, scene, lambda above: own, given=given)


def sections(rng: np.random.Generator) -> Sample:
    """Make a body between rollers under a section that stays plane."""
    # Nitsche's method refuses a cell between a contact and a section that moves.
    body = replace(random_body(rng, random_elastic), method=ec.AugmentedLagrangian())
    scene = random_loads(rng, body)
    held: Any = scene.supports[0]
    top, along = held.facets, [None] * (body.domain.dim - 1)
    sink = float(held.value[-1])
    slopes = float(rng.uniform(-0.2, 0.2)) * sink * np.array([1.0, 0.3])
    about = {SPACE: (1.0, 0.5, 1.0), RINGS: (0.0, 1.0), PLANE: (1.0, 1.0 + body.is_double)}
    turns: Any = {SPACE: (*slopes.tolist(), None), RINGS: None, PLANE: float(slopes[0])}
    at, turn = about[body.kind], turns[body.kind]
    if rng.random() < 0.5:
        # The full ring is some ten times as large as the other bodies.
        force = (*along, sink * (10.0 if body.kind == RINGS else 1.0))
        section = ec.PlaneSection(top, force=force, moment=turn, about=at)
        given = Given(top, numbers(force), None if turn is None else numbers(turn), np.array(at))
    else:
        section = ec.PlaneSection(top, (*along, sink), turn, about=at)
        given = None
    own = own_law(body.law, body.kind)
    scene = replace(scene, supports=[*rollers(body), section], loads=[])
    return Sample(body, scene, lambda above: own, given=given)


def numbers(value: Any) -> np.ndarray:
    """Return numbers as an array, NaN for None."""
    return np.atleast_1d(np.array(value, dtype=float))


def rollers(body: Body) -> list[ec.Displacement]:
    """Return rollers that hold a body on its contact."""
    if body.is_double:
        return [ec.Displacement(f"{name} left", (0.0, None)) for name in ("upper", "lower")]
    if body.kind == SPACE:
        aside = ec.Displacement("front", (None, 0.0, None))
        return [ec.Displacement("left", (0.0, None, None)), aside]
    return [ec.Displacement("left", (0.0, None))] if body.kind == PLANE else []


# -- what is measured
# ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """Hold what is measured of a scene, see the head of the file."""

    violations: int
    index: float
    law: float
    resultants: float
    eps: float


def measured(sample: Sample) -> Row:
    """Certify a scene and its reference, and evaluate the pair anew."""
    body, scene = sample.body, sample.scene
    error = certified(ec.solve(scene, body.domain, body.method, degree=body.degree))
    fine = body.domain
    for _ in range(LEVELS[body.kind]):
        fine = fine.refined()
    finer = certified(ec.solve(scene, fine, body.method, degree=2))
    bounds, exact = ec.potential_energy(error), ec.potential_energy(finer)
    round_off = ROUND_OFF * error.scale**2
    violations = int(bounds.low > exact.high + round_off)
    violations += int(bounds.high < exact.low - round_off)
    of_u = bounds.high - (exact.low + exact.high) / 2
    is_settled = exact.high - exact.low < SETTLED * of_u
    index = error.absolute / np.sqrt(2 * of_u) if is_settled else np.nan
    of_contacts = 0.0
    for traction in error.admissible.tractions:
        parts = contact_squares(
            error.model.space, error.admissible.displacement, traction, 0.0
        ).parts
        of_contacts += float(parts.sum())
    own = law_part(error, body.kind, sample.law_of, sample.heat)
    is_known = error.relative > ROUND_OFF
    law = (own + of_contacts) / error.absolute**2 - 1 if is_known else np.nan
    return Row(violations, index, law, own_imbalance(error, sample.given), error.relative)


def own_imbalance(error: ec.ConstitutiveError, given: Given | None) -> float:
    """Return what is missing in forces and moments over the greatest of them [-].

    They are of the whole boundary, and of a part for which they are given.
    """
    it = gathered(error.admissible)
    d = it.x.shape[2]
    is_ring = error.model.space.axisymmetric
    weights, points = gauss(d)
    cell, keys, _, t, places = on_sides(it, points)
    _, number, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    outer = count[number.ravel()] == 1
    x = np.einsum("fqv,fvi->fqi", places, it.x[cell])
    forces = weights[:, None] * t * areas(it.x[cell], places)[:, None, None]
    # Around the axis the other components of forces and moments cancel.
    kept = [1] if is_ring else list(range(d))

    def missing(sides: np.ndarray, force: Any, moment: Any, about: Any) -> float:
        left = [forces[sides].sum(axis=(0, 1))[kept] - np.array(force, dtype=float)[kept]]
        if moment is not None and not is_ring:
            moments = moments_of(x[sides] - about, forces[sides])
            left.append(moments.sum(axis=(0, 1)) - moment)
        return float(np.nanmax(abs(np.concatenate(left))))

    zeros = np.zeros(3)
    worst = missing(outer, zeros[:d], zeros[: 1 if d == 2 else 3], zeros[:d])
    if given is not None:
        facets = it.parts[given.part]
        of_part = [tuple(key) in facets for key in keys.tolist()]
        worst = max(worst, missing(np.array(of_part), given.force, given.moment, given.about))
    whole = float(abs(forces[outer]).sum(axis=(0, 1)).max())
    return worst / max(whole, LEAST_FORCE)


def moments_of(arms: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the moments of forces at arms (..., d), shape (..., 1) or (..., 3)."""
    if arms.shape[-1] == 3:
        return np.cross(arms, forces)
    return arms[..., :1] * forces[..., 1:] - arms[..., 1:] * forces[..., :1]


def study(make: Callable[[np.random.Generator], Sample], seed: int = 0, count: int = 40) -> None:
    """Measure the scenes of a kind, and print their distribution."""
    rows: list[Row] = []
    for number in range(count):
        sample = make(scene_generator(seed, number))
        try:
            row = measured(sample)
        except ec.ErcContactError as reason:
            tell(f"{number}: {sample.body.name}: {type(reason).__name__}: {reason}")
            continue
        rows.append(row)
        is_other = row.law > OWN or row.law < -LEFT
        if row.violations or is_other or row.resultants > BALANCED:
            tell(f"{number}: {sample.body.name}: {row}")
    tell(f"{len(rows)} of {count} solved, {sum(row.violations for row in rows)} violations")
    columns = {
        "index": [row.index for row in rows if np.isfinite(row.index)],
        "law": [row.law for row in rows if np.isfinite(row.law)],
        "resultants": [row.resultants for row in rows],
        "eps": [row.eps for row in rows],
    }
    tell(quantile_table(columns, QUANTILES, "{:.3g}"))


KINDS = (orthotropic, heated, remote, sections)

if __name__ == "__main__":
    run({kind.__name__: partial(study, kind) for kind in KINDS})
