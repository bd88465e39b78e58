"""Run extreme scenes with every contact method.

Does it converge, how, and does the answer keep the contact conditions?

A pair (scene, method) runs through the solve, the admissible pair and its error. The
table has, from the method's own u and traction r at the quadrature points of the
contact:

- penetration: max (u_n - g)+ / max |u|;
- cone: the largest of r_n and |r_t| - b, over the largest stress, with b the friction
  bound;
- complementarity: int |r_n (u_n - g)| / a(u, u);
- friction: int |b |u_t| + r_t.u_t| / a(u, u), the imbalance of the power of friction;

and the effectivity, e over the errors of u^ and sigma^ together against a mesh
uniformly finer, where that is cheap.

    OMP_NUM_THREADS=1 python benchmarks/extremes.py [part of a scene's name]

writes results/extremes.csv too. Only errors of the package are caught: anything else is
a defect and shows.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from extreme_scenes import SCENES, Extreme

import erc_contact as ec

from dolfinx import fem  # isort: skip - after erc_contact, which loads MPI first
from true_errors import reference, true_errors  # isort: skip
from erc_contact.admissible.elastic import cell_stress
from erc_contact.model.contact.contact_values import friction_parameters

from erc_contact.admissible.cells import cell_geometry  # isort: skip
from erc_contact.model.contact.trace import split  # isort: skip
from namedmesh.simplex import lagrange, rule  # isort: skip

METHODS: tuple[Any, ...] = (ec.Nitsche(), ec.AugmentedLagrangian())
SAME = 1e-6
"""Relative difference of eps between systems of units that counts as none [-]."""


@dataclass(frozen=True)
class Row:
    """Hold the measures of one pair (scene, method).

    Numbers are nan where there are none.
    """

    scene: str
    method: str
    outcome: str
    expected: bool
    rung: str = ""
    steps: float = np.nan
    seconds: float = np.nan
    eps: float = np.nan
    effectivity: float = np.nan
    penetration: float = np.nan
    cone: float = np.nan
    complementarity: float = np.nan
    friction: float = np.nan
    message: str = ""

    def __str__(self) -> str:
        """Write the row of the table; a dash stands for a number that is missing."""
        violations = (self.penetration, self.cone, self.complementarity, self.friction)
        numbers = [
            f"{self.steps:5.0f}",
            f"{self.seconds:7.2f}",
            f"{self.eps:9.2e}",
            f"{self.effectivity:6.2f}",
            *(f"{violation:9.1e}" for violation in violations),
        ]
        entries = [f"{self.scene:<36}{self.method:<21}{self.outcome:<26}{self.rung:<42}"]
        for number in numbers:
            entries.append(f"{'-':>{len(number)}}" if "nan" in number else number)
        mark = "" if self.expected else "  <-"
        return " ".join(entries) + mark


HEADER = (
    f"{'scene':<36}{'method':<21}{'outcome':<26}{'rung':<42}"
    " steps seconds       eps effect. penetrat.      cone  complem.  friction"
)


def violations(solution: ec.Solution) -> tuple[float, float, float, float]:
    """Measure how far a solution violates the contact conditions (serial).

    Returns penetration, distance from the cone, complementarity and power of friction;
    see above.
    """
    model = solution.model
    space = model.space
    u = solution.u
    points, weights = rule(space.d - 1, space.contact_degree)
    shape = lagrange(space.d - 1, space.degree, points)
    values = u.x.array.reshape(-1, space.d)
    size = np.linalg.norm(values, axis=1).max() or 1.0
    tractions = [space.evaluate(solution.traction(c), points, c.facets) for c in model.contacts]
    # an open contact has round-off of the stress inside, so that this is a scale, too
    peaks = [abs(cell_stress(model, cell_geometry(space), u).in_plane).max()]
    peaks += [np.linalg.norm(traction, axis=-1).max() for traction in tractions]
    peak = max(peaks) or 1.0
    work = fem.assemble_scalar(fem.form(model.stiffness(u, u / (size * peak)))) or 1.0
    penetration = 0.0
    cone = 0.0
    complementarity = 0.0
    friction = 0.0
    for contact, traction in zip(model.contacts, tractions, strict=True):
        n = contact.direction[:, None, :]
        r = traction / peak
        w = np.einsum("qm,fmi->fqi", shape, values[space.facet_nodes(contact.facets)]) / size
        gap: float | np.ndarray = 0.0
        if contact.gap is not None:
            gap = space.evaluate(contact.gap, points, contact.facets) / size
        area = space.facet_areas(contact.facets)
        r_n, r_t, shear = split(r, n)
        w_n, w_t, slip = split(w, n)
        beyond = w_n - gap
        parameters = friction_parameters(space, contact, points)
        bound = contact.friction_bound(np.maximum(-r_n, 0.0) * peak, parameters) / peak
        penetration = max(penetration, beyond.max())
        cone = max(cone, r_n.max(), (shear - bound).max())
        complementarity += area @ (abs(r_n * beyond) @ weights) / work
        friction += area @ (abs(bound * slip + (r_t * w_t).sum(axis=-1)) @ weights) / work
    return penetration, cone, complementarity, friction


def effectivity(error: ec.ConstitutiveError, levels: int) -> float:
    """Compute e over the true errors of u^ and sigma^ together; or nan.

    The reference is on a mesh that is cut and refined ``levels`` times.
    """
    try:
        exact = reference(error.solution, levels)
    except ec.ErcContactError:
        return np.nan
    return error.absolute / true_errors(error.admissible, exact).of_both


def run(name: str, extreme: Extreme, method: Any) -> Row:
    """Solve and certify one pair."""
    label = type(method).__name__
    began = perf_counter()
    solution = None
    try:
        scene, domain = extreme.build()
        began = perf_counter()
        solution = ec.solve(scene, domain, method)
        error = ec.constitutive_error(ec.equilibrate(solution))
    except ec.ErcContactError as reason:
        seconds = perf_counter() - began
        outcome = type(reason).__name__
        if solution:
            outcome += " after the solve"
        if extreme.solvable:
            expected = extreme.refusable and isinstance(reason, ec.InputError)
        else:
            expected = not solution
        return Row(name, label, outcome, expected, seconds=seconds, message=str(reason))
    penetration, cone, complementarity, friction = violations(solution)
    return Row(
        scene=name,
        method=label,
        outcome="converged",
        expected=extreme.solvable,
        rung=solution.reason.split(":")[0],
        steps=solution.newton_steps,
        seconds=solution.seconds,
        eps=error.relative,
        effectivity=effectivity(error, extreme.levels) if extreme.levels else np.nan,
        penetration=penetration,
        cone=cone,
        complementarity=complementarity,
        friction=friction,
    )


def pairs(filter_by: str = "") -> Iterator[tuple[str, Extreme, Any]]:
    """Give every scene with every method that has the parameters it sets."""
    for name, extreme in SCENES.items():
        if filter_by not in name:
            continue
        for method in METHODS:
            parameters = {parameter.name for parameter in fields(method)}
            if set(extreme.parameters) <= parameters:
                yield name, extreme, replace(method, **extreme.parameters)


def difference(row: Row, rows: list[Row]) -> float:
    """Compute the relative difference of eps from that in other units.

    It is 0 if no other scene is the same in other units.
    """
    original = SCENES[row.scene].same_as
    for candidate in rows:
        if candidate.method == row.method and candidate.scene == original:
            return abs(row.eps / candidate.eps - 1)
    return 0.0


def unit_independence(rows: list[Row]) -> dict[tuple[str, str], tuple[list[float], float]]:
    """Collect Newton steps and differences of eps of scenes in several units.

    The greatest difference is nan where some failed. What was refused for being beyond
    double precision is left out.
    """
    sweeps: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        extreme = SCENES[row.scene]
        if extreme.same_as and not (extreme.refusable and row.outcome != "converged"):
            sweeps.setdefault((extreme.same_as, row.method), []).append(row)
    spreads = {}
    for key, sweep in sweeps.items():
        steps = [row.steps for row in sweep]
        differences = [difference(row, rows) for row in sweep]
        spreads[key] = (steps, float(np.max(differences)))
    return spreads


def summary(rows: list[Row]) -> Iterator[str]:
    """Give the lines below the table: units, what was unexpected, and each method."""
    for (scene, method), (steps, spread) in unit_independence(rows).items():
        independent = len(set(steps)) == 1 and spread <= SAME
        verdict = "independent of units" if independent else "DEPENDS ON UNITS"
        counts = " ".join(f"{n:g}" for n in steps)
        yield f"{scene}, {method}: {verdict}; steps {counts}; eps differs by {spread:.1e} at most"
    right = {
        id(row) for row in rows if row.outcome == "converged" and difference(row, rows) <= SAME
    }
    for row in rows:
        if not row.expected:
            yield f"unexpected: {row.scene}, {row.method}: {row.outcome} {row.message}"
        elif row.outcome == "converged" and id(row) not in right:
            yield f"unexpected: {row.scene}, {row.method}: a wrong field, eps {row.eps:.2e}"
    slowest = max(rows, key=lambda row: row.seconds)
    yield f"slowest: {slowest.scene}, {slowest.method}: {slowest.seconds:.1f} s"
    for method in dict.fromkeys(row.method for row in rows):
        solvable = []
        hopeless = []
        for row in rows:
            extreme = SCENES[row.scene]
            if row.method != method:
                continue
            if not extreme.solvable:
                hopeless.append(row)
            elif not extreme.refusable:
                solvable.append(row)
        solved = sum(id(row) in right for row in solvable)
        refused = sum(row.expected for row in hopeless)
        yield (
            f"{method}: {solved} of {len(solvable)} scenes that have a solution converged to it; "
            f"{refused} of {len(hopeless)} that have none were refused"
        )


def main() -> None:
    rows = []
    print(HEADER)
    for name, extreme, method in pairs(*sys.argv[1:2]):
        rows.append(run(name, extreme, method))
        print(rows[-1], flush=True)
    if not rows:
        print(f"no scene is called like {sys.argv[1]!r}")
        return
    print(*summary(rows), sep="\n")
    path = Path("results/extremes.csv")
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([column.name for column in fields(Row)])
        writer.writerows([getattr(row, column.name) for column in fields(Row)] for row in rows)


if __name__ == "__main__":
    main()
