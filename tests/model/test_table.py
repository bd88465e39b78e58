"""Tables: numbers as numpy's, the same scene as by a formula, kinks that are not missed."""

import math

import numpy as np
import pytest
import ufl
from scenes import measured

import erc_contact as ec
from erc_contact.base.code import code_of
from erc_contact.run.fingerprint import fingerprint
from erc_contact.scene.words import in_words

POINTS = np.array([0.0, 0.3, 0.7, 1.0])
VALUES = np.array([0.0, 0.02, -0.01, 0.03])


def body(d, cells=4):
    if d == 2:
        return ec.rectangle((0.0, 0.0), (1.0, 0.5), cells=(cells, 2))
    return ec.box((0.0, 0.0, 0.0), (1.0, 0.5, 0.5), cells=(cells, 2, 2))


def push_of_top(d, down=-0.05):
    return ec.Displacement("top", (0.01, down) if d == 2 else (0.01, 0.0, down))


def test_numbers_are_those_of_numpy():
    places = np.linspace(-0.5, 1.5, 41)
    assert ec.table(POINTS, VALUES)(places) == pytest.approx(np.interp(places, POINTS, VALUES))
    grid = ec.table((POINTS, [0.0, 1.0]), np.stack([VALUES, 2 * VALUES], axis=1))
    assert grid(0.3, 0.5) == pytest.approx(0.03)
    assert grid(places, 9.0) == pytest.approx(2 * np.interp(places, POINTS, VALUES))


@pytest.mark.parametrize(
    ("x", "values", "said"),
    [
        ([0.0, 2.0, 1.0], [0.0, 1.0, 2.0], "sort the points"),
        ([0.0, 1.0, 1.0], [0.0, 1.0, 2.0], "sort the points"),
        ([0.0, 1.0], [0.0, 1.0, 2.0], "one value for each"),
        ([0.0, np.nan], [0.0, 1.0], "x is nan at 1"),
        ([0.0, 1.0], [0.0, np.inf], "values is inf at 1"),
        ([0.0], [0.0], "two points or more"),
        ("profile.csv", [0.0], "finite numbers"),
        (([0.0, 1.0], [0.0, 1.0]), [0.0, 1.0], "the points need (2, 2)"),
    ],
)
def test_bad_numbers_are_refused(x, values, said):
    with pytest.raises(ec.InputError) as refused:
        ec.table(x, values)
    assert said in str(refused.value)


def test_a_wrong_number_of_coordinates_is_refused():
    with pytest.raises(ec.InputError, match="called with 2"):
        ec.table(POINTS, VALUES)(0.1, 0.2)


def test_the_hint_for_numpy_names_it():
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        push_of_top(2),
        contacts=ec.Contact("bottom", gap=lambda x: np.interp(x[0], POINTS, VALUES)),
    )
    with pytest.raises(ec.InputError, match=r"ec\.table"):
        ec.solve(scene, body(2))


def line(of):
    """Two tables of a line from (0, 0.1) to (1, 0.3), of which one has many points, and its formula."""
    few = ec.table([0.0, 1.0], [0.1, 0.3])
    x = np.linspace(0.0, 1.0, 8)
    return {"formula": lambda x: 0.1 + 0.2 * x[0], "few": few, "many": ec.table(x, 0.1 + 0.2 * x)}[
        of
    ]


def scene_of(d, of):
    """Modulus, load, gap, friction and heat along a line."""
    value = line(of)
    load = (0.0, lambda x: 0.01 * value(x)) if d == 2 else (0.0, 0.0, lambda x: 0.01 * value(x))
    return ec.Scene(
        ec.Elastic(E=value, nu=0.3),
        push_of_top(d),
        loads=[ec.Traction("right", load), ec.BodyForce(load)],
        contacts=ec.Contact("bottom", friction=value, gap=lambda x: 0.1 * value(x)),
        strains=ec.ThermalStrain(0.01, value),
    )


@pytest.mark.broad
@pytest.mark.on_ranks("2-2-few-Nitsche")
@pytest.mark.parametrize(
    ("d", "degree", "of", "method"),
    [(2, 2, "few", ec.Nitsche()), (3, 1, "many", ec.AugmentedLagrangian())],
    ids=["2-2-few-Nitsche", "3-1-many-multiplier"],
)
def test_a_table_of_a_line_is_the_line(d, degree, of, method):
    """The number of points changes the formula of the table, which knows no d and no degree."""
    exact = measured(scene_of(d, "formula"), body(d), degree=degree, method=method)
    error = measured(scene_of(d, of), body(d), degree=degree, method=method)
    assert error.relative == pytest.approx(exact.relative, rel=2e-5)
    u = error.admissible.displacement.x.array - exact.admissible.displacement.x.array
    assert abs(u).max() < 2e-6


@pytest.mark.parametrize("degree", [1, 2])
def test_a_spike_between_all_samples_is_not_entered(degree):
    spike = ec.table([0.0, 0.61230, 0.61231, 0.61232, 1.0], [0.0, 0.0, -0.01, 0.0, 0.0])
    contact = ec.Contact("bottom", gap=lambda x: 0.01 + spike(x[0]))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), push_of_top(2, -0.03), contacts=contact)
    error = measured(scene, body(2, cells=1), degree=degree)
    at = ec.results.at(error, [[0.61231, 0.0]])
    assert -at.displacement[0, 1] <= 1e-12
    assert error.oscillations.gaps == 0.0


def test_a_table_of_a_radius_gives_gap_and_normal():
    r = np.linspace(0.0, 3.0, 200)
    distance = ec.table(r, r - 2.0)
    radius = {
        "formula": lambda x: ufl.sqrt(x[0] ** 2 + (x[1] + 2.0) ** 2) - 2.0,
        "table": lambda x: distance(ufl.sqrt(x[0] ** 2 + (x[1] + 2.0) ** 2)),
    }
    errors = []
    for gap in radius.values():
        contact = ec.Contact("bottom", gap=gap, normal="gap")
        scene = ec.Scene(ec.Elastic(1.0, 0.3), push_of_top(2), contacts=contact)
        errors.append(measured(scene, body(2), degree=1).relative)
    assert errors[1] == pytest.approx(errors[0], rel=2e-3)


def test_a_grid_in_space():
    grid = ec.table(([0.0, 1.0], [0.0, 0.2, 0.5]), [[0.0, 0.002, 0.005], [0.01, 0.012, 0.015]])
    gaps = [grid, lambda x: 0.01 * x[0] + 0.01 * x[1]]
    errors = []
    for gap in gaps:
        scene = ec.Scene(
            ec.Elastic(1.0, 0.3),
            push_of_top(3),
            contacts=ec.Contact("bottom", friction=0.3, gap=gap),
        )
        errors.append(measured(scene, body(3, cells=2), degree=1).relative)
    assert errors[0] == pytest.approx(errors[1], rel=1e-4)


class OfPressure:
    """A friction bound that was measured for some pressures."""

    parameters = ()

    def __init__(self, bound):
        self.bound = bound

    def friction_bound(self, pressure):
        return self.bound(pressure)


def rubbed(law):
    contact = ec.Contact("bottom", friction=law)
    return ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.2, -0.01)), contacts=contact)


def test_a_friction_law_may_be_a_table_of_the_pressure():
    bound = ec.table([0.0, 0.01, 0.04], [0.0, 0.004, 0.007])
    error = measured(rubbed(OfPressure(bound)), body(2))
    # All slides: the shear of the solver is the bound of its pressure.
    profile = error.profile("bottom")
    assert np.ptp(profile["pressure"]) > 0.01
    limit = np.interp(profile["pressure"], bound.x, bound.values)
    assert abs(profile["shear"]) == pytest.approx(limit, rel=1e-2)
    assert error.contact_error < 0.05 * error.absolute


@pytest.mark.parametrize(
    ("bound", "said"),
    [
        (lambda p: np.interp(p, [0.0, 1.0], [0.0, 0.3]), "ec.table.* instead of np.interp"),
        (lambda p: 0.1 * math.sqrt(p), "write ufl.sin"),
        (ec.table(np.linspace(0.0, 1.0, 60), np.sqrt(np.linspace(0.0, 1.0, 60))), "at most 50"),
        (ec.table([0.0, 0.1, 0.2], [0.0, 0.01, 0.1]), "not concave"),
    ],
)
def test_laws_that_cannot_be_worked_with_are_refused(bound, said):
    """Numpy's functions would take the number of a constant for the pressure."""
    with pytest.raises(ec.InputError, match=said):
        ec.solve(rubbed(OfPressure(bound)), body(2))


def test_other_numbers_are_another_scene():
    prints = []
    for height in (0.01, 0.02):
        gap = ec.table([0.0, 1.0], [0.0, height])
        contact = ec.Contact("bottom", gap=lambda x, gap=gap: 2 * gap(x[0]))
        scene = ec.Scene(ec.Elastic(1.0, 0.3), push_of_top(2), contacts=contact)
        prints.append(fingerprint(scene, body(2), {}))
    changed = [name for name in prints[0] if prints[0][name] != prints[1][name]]
    assert changed == ["contacts[0].gap"]


@pytest.mark.serial
def test_a_run_with_kinks_refines_and_says_its_numbers():
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        push_of_top(2),
        contacts=ec.Contact("bottom", friction=0.3, gap=ec.table(POINTS, VALUES)),
    )
    history = ec.adapt(scene, body(2), accuracy=0.2)
    assert history.error.relative <= 0.2
    assert history.error.oscillations.gaps == 0.0


def test_a_report_counts_the_points_and_a_script_has_them():
    contact = ec.Contact("bottom", gap=ec.table(POINTS, VALUES))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), push_of_top(2), contacts=contact)
    assert ("bottom", "contact, no friction, gap <table of 4 points>") in in_words(scene)
    again = eval(code_of(contact.gap), {"ec": ec})
    assert again(0.15) == pytest.approx(contact.gap(0.15))
