"""Rounds of tightening for bodies with a potential.

- The gap of the linear law about a stress has the slope and curvature of Fenchel's gap.
- Rounds lower e, most where little hardening is on coarse cells in 3D. With a curve of
  hardening whose slope falls, they come near the least e.
- A linear body is tightened once. Ranks find the same stress.
"""

import dataclasses

import numpy as np
import pytest
from laws import Fibres, TwoModuli
from mpi4py import MPI

import erc_contact as ec
from erc_contact.admissible.cells import cell_geometry
from erc_contact.admissible.macro import law_points, macro_points
from erc_contact.admissible.tighten import rounds
from erc_contact.admissible.tighten.rounds import CellLaw, Tight, _AtPoints
from erc_contact.model.meridian import circumferences
from namedmesh.simplex import barycentric

COMM = MPI.COMM_WORLD
STEEL = ec.Plastic(E=1.0, nu=0.3, yield_stress=0.01, hardening=0.02)


def body(kind, law, cells, comm=COMM, degree=1):
    """A body that is pressed into a foundation, and its solution."""
    if kind == "3":
        domain = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(cells,) * 3, comm=comm)
    else:
        domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2 * cells, cells), comm=comm)
    if kind == "rings":
        law = dataclasses.replace(law, hypothesis="axisymmetric")
    down = ec.Displacement("top", (*[0.0] * (domain.dim - 1), -0.03))
    floor = ec.Contact("bottom", gap=lambda x: 0.02 * sum(x[:-1] ** 2))
    return ec.solve(ec.Scene(law, down, contacts=floor), domain, degree=degree)


@dataclasses.dataclass
class Given:
    """What a stress is reconstructed from, as far as it is asked."""

    model: object
    cells: object
    displacement: object


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", ["2", "3", "rings"])
@pytest.mark.parametrize("law", [STEEL, TwoModuli(1.0, 0.4, 0.2), Fibres(1.0, 5.0)])
@pytest.mark.parametrize("points_of", [macro_points, law_points])
def test_slope_and_curvature_are_of_fenchels_gap(kind, law, degree, points_of):
    solution = body(kind, law, 2, degree=degree)
    pair = ec.equilibrate(solution)
    model, cells = solution.model, cell_geometry(solution.model.space)
    rule = points_of(model.space.d, degree)
    at = _AtPoints(Given(model, cells, pair.displacement), rule)

    def measured(stress):
        return at.measured(Tight(np.empty(0), np.empty(0), stress))

    given = measured(pair.stress)
    of_law, square = at.law_about(given)
    assert isinstance(of_law, CellLaw)
    change = 1e-5 * np.random.default_rng(1).standard_normal(pair.stress.shape)
    # On the axis stresses times the circumference vanish.
    change[pair.stress == 0.0] = 0.0
    more, less = (measured(pair.stress + sign * change).gap for sign in (1, -1))
    slope, curvature = (more - less) / 2, more + less - 2 * given.gap
    # The same of the quadratic form |sigma - S|^2.
    shape, points, weights = rule
    values = [
        np.matmul(shape, stress).reshape(len(cells.nodes), len(points), -1)
        for stress in (pair.stress, change)
    ]
    weights = cells.volume[:, None] * weights
    if kind == "rings":
        weights = weights / circumferences(np.matmul(barycentric(points), cells.corners))
    beyond = values[0] - of_law.elastic

    def form(one, other):
        density = np.einsum("nqi,nqij,nqj->nq", one, of_law.compliance, other)
        return (weights * density).sum()

    near = 1e-6 * given.gap
    assert 2 * form(beyond, values[1]) == pytest.approx(slope, rel=1e-4, abs=near)
    assert 2 * form(values[1], values[1]) == pytest.approx(curvature, rel=0.02, abs=near)
    assert square == pytest.approx(form(beyond, beyond), rel=1e-10)


@pytest.mark.broad
@pytest.mark.on_ranks("2-2", "1-3")
@pytest.mark.parametrize("kind", ["2", "3", "rings"])
@pytest.mark.parametrize("degree", [1, 2])
def test_rounds_lower_e(kind, degree, monkeypatch):
    solution = body(kind, STEEL, 3 if kind == "3" else 4, degree=degree)
    in_rounds = ec.constitutive_error(ec.equilibrate(solution))
    monkeypatch.setattr(rounds, "ROUNDS", 0)
    once = ec.constitutive_error(ec.equilibrate(solution))
    assert in_rounds.admissible.tightening > once.admissible.tightening
    assert in_rounds.relative < {"2": 0.97, "3": 0.9, "rings": 0.98}[kind] * once.relative


@pytest.mark.parametrize(
    ("kind", "hardening", "near"),
    [
        ("2", ec.Voce(0.004, 0.004, 20.0), 1.1),
        pytest.param("3", ec.Voce(0.004, 0.001, 200.0), 1.1, marks=pytest.mark.broad),
        ("rings", ec.Voce(0.004, 0.001, 200.0), 1.2),
        ("rings", ec.HardeningCurve([0.0, 1.0], [0.004, 0.0044]), 1.4),
    ],
)
def test_rounds_come_near_the_least_e(kind, hardening, near, monkeypatch):
    """As fifty rounds with all their iterations find it.

    Where a curve of hardening falls, or a body hardly hardens, whole steps go too far.
    """
    law = ec.Plastic(E=1.0, nu=0.3, hardening=hardening)
    solution = body(kind, law, 3 if kind == "3" else 8, degree=2)
    few = ec.constitutive_error(ec.equilibrate(solution))
    for name, value in (("ROUNDS", 50), ("LINEAR", 0.0), ("GAIN", 0.0), ("FINER_REMAINDER", 1e-3)):
        monkeypatch.setattr(rounds, name, value)
    many = ec.constitutive_error(ec.equilibrate(solution, tighten=3000))
    assert few.relative < near * many.relative


HARDLY = {"yield_stress": 2e-3, "hardening": 1e-3}
CURVE = ec.HardeningCurve([0.0, 0.002, 0.01, 0.05], 4.4e-4 * np.array([1.0, 1.05, 1.2, 1.5]))


@pytest.mark.parametrize(
    ("hypothesis", "cells", "hardening", "press", "most"),
    [
        # eps is 75, 62 and 59% where only means of cells are compared with the law.
        ("plane strain", 4, {"hardening": CURVE}, 1.9e-4, 0.2),
        ("plane strain", 2, HARDLY, 1e-3, 0.45),
        ("axisymmetric", 3, HARDLY, 8e-4, 0.25),
    ],
)
def test_what_begins_to_yield_inside_cells_is_seen(hypothesis, cells, hardening, press, most):
    """There sigma^ exceeds the yield stress at some points, and its means do not."""
    law = ec.Plastic(E=1.0, nu=0.3, hypothesis=hypothesis, **hardening)
    domain = ec.rectangle((0.0, 0.0), (1.5, 0.5), cells=(cells, cells))
    floor = ec.Contact("bottom", friction=0.6)
    scene = ec.Scene(law, ec.Displacement("top", (0.0, -press)), contacts=floor)
    pair = ec.equilibrate(ec.solve(scene, domain, degree=2))
    assert ec.constitutive_error(pair).relative < most


def test_a_linear_body_is_tightened_once(monkeypatch):
    """So is a body that does not yield."""
    strong = dataclasses.replace(STEEL, yield_stress=10.0)
    monkeypatch.setattr(rounds, "ROUNDS", None)
    ec.equilibrate(body("2", strong, 4))


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("kind", "degree"),
    [("2", 1), ("3", 1), pytest.param("3", 2, marks=pytest.mark.broad), ("rings", 2)],
)
def test_ranks_find_the_same_stress(kind, degree):
    values = []
    for comm in (MPI.COMM_SELF, COMM):
        law = dataclasses.replace(STEEL, hardening=0.05)
        solution = body(kind, law, 2 if kind == "3" else 3, comm, degree)
        error = ec.constitutive_error(ec.equilibrate(solution))
        values.append(error.relative)
    # Iterations of a nearly incompressible body let round-off grow, and end differently.
    is_grown = kind == "3"
    assert values[1] == pytest.approx(values[0], rel=1e-3 if is_grown else 1e-7)
