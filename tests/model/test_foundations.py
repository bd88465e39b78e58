"""Compliant foundations under contacts.

- a column on one sinks by p/k and lifts off, with the closed form to round-off, by all
  methods and both solvers; with a flipped sign it would not;
- the error in its law is zero for the law and for nothing else;
- soft foundations tend to a free boundary and stiff ones to the rigid one, with its
  error, at first order in the compliance;
- e bounds true errors, energies and forces of a fine mesh lie in the intervals of a
  coarse one;
- histories balance and go on from a checkpoint; ranks agree; what is wrong is refused
  in words.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from domains import refused
from plates import METHODS, by_ranks_and_solvers, plate
from reference import true_errors
from scenes import measured, mostly_serial, pressed

import erc_contact as ec
from erc_contact.error.contact_term import law_error, spring_of

E, NU = 1000.0, 0.3


def on_bed(k, friction=0.3, gap=0.0, moved=(0.01, -0.02)) -> ec.Scene:
    """A plate pressed on a foundation of stiffness k, a rigid one for None."""
    bed = None if k is None else ec.Foundation(k)
    return pressed(ec.Elastic(E, NU), moved, friction=friction, gap=gap, foundation=bed)


def column(k, gap, **pushed) -> ec.Scene:
    """A column that slides at its left side, pushed at its top."""
    contact = ec.Contact("bottom", gap=gap, foundation=ec.Foundation(k))
    supports = [ec.Displacement("left", (0.0, None)), *pushed.get("supports", ())]
    material = ec.Elastic(E, NU, "plane stress")
    return ec.Scene(material, supports, pushed.get("loads", ()), contact)


@pytest.mark.pairs
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1], [2]))
@pytest.mark.parametrize("k", [0.1, 50.0, 1e9])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("solver", ["direct", "iterative"])
def test_a_column_sinks_by_p_over_k(solver, method, k, degree):
    p, gap = 5.0, 0.02
    scene = column(k, gap, loads=[ec.Traction("top", (0.0, -p))])
    error = measured(scene, plate(), degree=degree, method=method, solver=solver)
    assert error.relative < 1e-10
    sunk = error.at((1.0, 1.0)).displacement[0, 1]
    assert sunk == pytest.approx(-(gap + p / k + p / E), rel=1e-9)
    assert error.profile("bottom")["gap"] == pytest.approx(-p / k, abs=1e-9 * abs(sunk))
    assert error.force("bottom").force == pytest.approx([0.0, 2 * p], abs=1e-9)
    # Half of the work of the load beyond the gap is stored, in body and foundation.
    stored = p * p / (2 * k) + p * p / (2 * E)
    energy = ec.potential_energy(error)
    assert energy.value == pytest.approx(2.0 * (stored - p * -sunk), rel=1e-9)


def test_a_column_lifts_off():
    """The foundation pushes and never pulls, and only where the gap is used up."""
    gap = 0.02
    for moved, force in ((-0.05, 0.03 / (1 / 50.0 + 1 / E)), (-0.01, 0.0), (0.05, 0.0)):
        scene = column(50.0, gap, supports=[ec.Displacement("top", (None, moved))])
        error = measured(scene, plate())
        assert error.relative < 1e-11
        assert error.force("bottom").force[1] == pytest.approx(2 * force, abs=1e-10)


def test_error_in_the_law():
    entry, pressure = np.meshgrid(np.linspace(-1.0, 1.0, 41), np.linspace(0.0, 3.0, 31))
    k = np.full(entry.shape, 2.0)
    value = law_error(spring_of(entry, pressure, k))
    beyond = abs(pressure - k * np.maximum(entry, 0.0))
    assert np.all(value[beyond < 1e-12] < 1e-15)
    # It is at least the least convex one: the square of what the law is missed by.
    assert np.all(value >= beyond**2 / (2 * k) - 1e-15)
    # Fenchel's inequality as it stands.
    energies = 0.5 * k * np.maximum(entry, 0.0) ** 2 + pressure**2 / (2 * k)
    assert value == pytest.approx(energies - pressure * entry, abs=1e-14)


@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1], [2]))
def test_limits_of_soft_and_stiff_foundations(degree):
    def gap(x):
        return 0.02 * (x[0] - 1.0) ** 2

    rigid = measured(on_bed(None, gap=gap), plate(), degree=degree)
    force = rigid.force("bottom").force
    distances = []
    for k in (1e3 * E, 1e6 * E):
        stiff = measured(on_bed(k, gap=gap), plate(), degree=degree)
        assert stiff.relative == pytest.approx(rigid.relative, rel=0.02)
        distances.append(abs(stiff.force("bottom").force - force).max())
    assert distances[1] < 2e-3 * distances[0] < 2e-3 * 0.02 * abs(force).max()
    soft = measured(on_bed(1e-6 * E, gap=gap), plate(), degree=degree)
    assert abs(soft.force("bottom").force).max() < 1e-6 * abs(force).max()


@cache
def references(k) -> tuple[ec.Scene, ec.Solution, ec.ConstitutiveError]:
    """A scene with its solution, and the error, on fine meshes of degree 2."""
    scene = on_bed(ec.table([0.0, 0.7, 2.0], [k, 2 * k, k]), friction=ec.Tresca(1.0))
    return scene, ec.solve(scene, plate(48), degree=2), measured(scene, plate(16), degree=2)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("k", [500.0, 2e4])
def test_e_bounds_true_errors(k, degree):
    scene, reference, finest = references(k)
    energy = ec.potential_energy(finest).value
    force = finest.force("bottom").force[1]
    for n in (2, 4):
        error = measured(scene, plate(n), degree=degree)
        assert error.oscillation < 1e-12 * error.scale
        true = true_errors(error.admissible, reference)
        assert true.both <= 1.02 * error.absolute
        assert error.absolute < 1.3 * true.both
        bounds = ec.potential_energy(error)
        assert bounds.guaranteed
        assert bounds.low <= energy <= bounds.high
        resultant = ec.resultant(error, "bottom", (0.0, 1.0))
        assert resultant.guaranteed
        assert resultant.low <= force <= resultant.high
        certificate = ec.certify(scene, plate(n), lambda x: 0.9 * x, degree=degree)
        assert certificate.error.absolute > error.absolute
        assert certificate.penetration == 0.0


def test_history_balances_and_goes_on_from_its_checkpoint(shared_tmp_path):
    def scene_at(t):
        return on_bed(3e3, moved=(0.01 * np.sin(t), -0.02 * t))

    def run(callback=None):
        return ec.evolve(
            scene_at,
            plate(4),
            [0.5, 1.0, 2.0],
            accuracy=0.3,
            degree=2,
            checkpoint=shared_tmp_path,
            callback=callback,
        )

    def stop(error, row):
        if row.time == 1.0:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(stop)
    whole = run()
    imbalance = np.array([abs(step.imbalance) for step in whole.steps])
    e_2 = [error.absolute**2 for error in whole.errors]
    assert np.all(imbalance < 5 * np.cumsum(e_2))
    # What the foundation stores is work of the contact on the body.
    p = whole.errors[-1].profile("bottom")
    stored = np.sum(p["weight"] * p["pressure"] ** 2) / (2 * 3e3)
    normal = whole.steps[-1].contact_work - whole.steps[-1].friction_work
    assert normal == pytest.approx(-stored, rel=0.02)


def test_ranks_and_solvers():
    scene = on_bed(lambda x: 2e3 + 1e3 * x[0] ** 2)
    first, errors = by_ranks_and_solvers(
        lambda comm, solver: measured(scene, plate(4, comm), solver=solver)
    )
    for error in errors:
        assert error.scale == pytest.approx(first.scale, rel=1e-9)


class WithoutGamma(ec.Nitsche):
    """A method of the user's that knows rigid foundations only."""

    def traction(self, model, contact, u, multiplier=None):
        return contact.project(-model.modulus * contact.jump(u))


def solved(scene, **options):
    return lambda: ec.solve(scene, plate(), **options)


BAD = {
    "zero": (lambda: ec.Foundation(0.0), "a number > 0"),
    "negative": (lambda: ec.Foundation(-1.0), "a number > 0"),
    "infinite": (lambda: ec.Foundation(np.inf), "a finite number"),
    "words": (lambda: ec.Foundation("soft"), "a finite number"),
    "number": (lambda: ec.Contact("bottom", foundation=3.0), "give Foundation(stiffness)"),
    "bilateral": (
        lambda: ec.Contact("a", bilateral=True, foundation=ec.Foundation(1.0)),
        "Spring('a', normal=k)",
    ),
    "negative somewhere": (solved(on_bed(lambda x: x[0] - 1.0)), "is -1 somewhere"),
    "not finite": (solved(on_bed(lambda x: 1 / x[0])), "must be > 0 and finite"),
    "method": (solved(on_bed(1.0), method=WithoutGamma()), "contact.project(z, gamma)"),
    "interval": (
        lambda: ec.interval(
            measured(on_bed(1.0, friction=0.0), plate()), ec.Resultant("bottom", (0.0, 1.0))
        ),
        "take ec.resultant",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_foundations_are_refused_in_words(case):
    refused(*BAD[case])


def test_a_scene_says_its_foundation():
    scene = on_bed(50.0)
    assert "foundation of normal stiffness 50" in scene._repr_html_()
    assert replace(scene.contacts[0], foundation=None) == on_bed(None).contacts[0]
