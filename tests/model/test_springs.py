"""Springs on boundary parts.

- a bar on springs has the displacement, forces and energy of a closed form, to
  round-off;
- a body that springs alone hold is in balance; a motion that they do not hold is told;
- soft springs tend to a free boundary and stiff ones to a support, with its error;
- e bounds true errors with both methods, energies and forces of a fine mesh lie in the intervals of a
  coarse one, beside a contact;
- in a history the energies balance, with the energies of the springs;
- both solvers, ranks, very stiff springs; what is wrong is refused in words.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from domains import refused
from plates import by_ranks_and_solvers, plate
from reference import true_errors
from scenes import certified, mostly_serial

import erc_contact as ec

MESHES = Path(__file__).parents[2] / "meshes"
E, NU = 1000.0, 0.3


def sprung(*springs, friction=0.3) -> ec.Scene:
    """Pressed on a foundation, with springs."""
    return ec.Scene(
        ec.Elastic(E, NU),
        loads=ec.Traction("top", (0.5, -5.0)),
        contacts=ec.Contact("bottom", friction=friction),
        springs=springs,
    )


def held(*springs, supports=()) -> ec.Scene:
    return ec.Scene(
        ec.Elastic(E, NU),
        [ec.Displacement("bottom", (0.0, 0.0)), *supports],
        [ec.Traction("top", (1.0, -5.0))],
        springs=springs,
    )


@pytest.mark.parametrize("degree", mostly_serial([1, 2], [2], [1]))
def test_bar_on_springs(degree):
    pull, k = 10.0, 50.0
    scene = ec.Scene(
        ec.Elastic(E, NU, "plane stress"),
        [ec.Displacement("bottom", (None, 0.0))],
        [ec.Traction("right", (pull, 0.0)), ec.Traction("left", (2.0, 0.0))],
        springs=ec.Spring("left", normal=k),
    )
    error = certified(scene, plate(), degree=degree)
    assert error.relative < 1e-12
    # The load on the springs' own part does not strain the bar.
    moved = (pull + 2.0) / k + 2.0 * pull / E
    assert error.at((2.0, 0.5)).displacement[0, 0] == pytest.approx(moved, rel=1e-12)
    for result in (error, error.solution):
        assert result.force("left").force == pytest.approx([-pull, 0.0], abs=1e-10)
        assert abs(result.reactions()["balance"].force).max() < 1e-10
    work = pull * moved + 2.0 * (pull + 2.0) / k
    assert ec.potential_energy(error).value == pytest.approx(-work / 2, rel=1e-12)
    assert ec.work_of_loads(error).value == pytest.approx(work, rel=1e-12)


def test_springs_on_a_circle_have_its_length():
    """Half of a stiff disc moves by its weight over the springs around it; facets are shorter."""
    pytest.importorskip("gmsh")
    domain = ec.read_mesh(MESHES / "half_disc.geo", scripts=True)
    weight, k = 3.0, 50.0
    stiff = ec.Elastic(1e9, NU)
    springs = ec.Spring("arc", k, k)
    error = certified(ec.Scene(stiff, loads=ec.BodyForce((0.0, -weight)), springs=springs), domain)
    moved = error.solution.at([[0.0, 0.5]]).displacement[0, 1]
    assert moved == pytest.approx(-weight * np.pi / 2 / (k * np.pi), rel=1e-4)


def test_springs_alone_hold_a_body():
    springs = [ec.Spring("left", 50.0, 20.0)]
    scene = ec.Scene(ec.Elastic(E, NU), loads=ec.Traction("right", (0.3, -0.1)), springs=springs)
    for solver in ("direct", "iterative"):
        balance = certified(scene, plate(), solver=solver).reactions()["balance"]
        assert abs(balance.force).max() < 1e-9
        assert abs(balance.moment).max() < 1e-9
    slides = replace(scene, springs=[ec.Spring("left", 50.0)])
    with pytest.raises(ec.NotHeldError):
        ec.solve(slides, plate())


@pytest.mark.parametrize("degree", [1, 2])
def test_limits_of_soft_and_stiff_springs(degree):
    free = certified(held(), plate(), degree=degree)
    rigid = certified(held(supports=[ec.Displacement("left", (0.0, 0.0))]), plate(), degree=degree)
    distances = []
    for k in (1e6 * E, 1e3 * E):
        stiff = certified(held(ec.Spring("left", k, k)), plate(), degree=degree)
        assert stiff.relative == pytest.approx(rigid.relative, rel=0.02)
        distances.append(abs(stiff.force("left").force - rigid.force("left").force).max())
    # The distance to the limit is of first order in the compliance.
    assert distances[0] < 2e-3 * distances[1] < 2e-3 * abs(rigid.force("left").force).max()
    soft = certified(held(ec.Spring("left", 1e-6 * E, 1e-6 * E)), plate(), degree=degree)
    assert soft.relative == pytest.approx(free.relative, rel=1e-3)
    assert abs(soft.force("left").force).max() < 1e-4


@cache
def sprung_by(k):
    """Return a scene on springs, and on fine meshes its solution and its error."""
    scene = sprung(ec.Spring("left", k, 0.3 * k), friction=ec.Tresca(1.0))
    scene = replace(scene, loads=[*scene.loads, ec.Traction("left", (0.4, 0.0))])
    return scene, ec.solve(scene, plate(24), degree=2), certified(scene, plate(16), degree=2)


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.serial
@pytest.mark.parametrize("k", [20.0, 2e4])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()])
def test_e_bounds_true_errors(degree, k, method):
    scene, reference, finest = sprung_by(k)
    energy = ec.potential_energy(finest).value
    force = finest.force("bottom").force[1]
    for n in (2, 4):
        error = certified(scene, plate(n), degree=degree, method=method)
        true = true_errors(error.admissible, reference)
        assert true.both <= 1.02 * error.absolute
        # e contains the error of the springs, too, which these true errors do not. A
        # traction with another moment than the contact forces would cost them more.
        assert error.absolute < 1.9 * true.both
        bounds = ec.potential_energy(error)
        assert bounds.low <= energy <= bounds.high
        pressure = ec.resultant(error, "bottom", (0.0, 1.0))
        assert pressure.low <= force <= pressure.high
        certificate = ec.certify(scene, plate(n), lambda x: 0.0 * x, degree=degree)
        assert certificate.error.absolute > error.absolute


@pytest.mark.parametrize("on_springs", [False, True])
def test_energies_of_a_history_balance(on_springs):
    """The springs store energy and do no work, also where a load acts on their part."""

    def scene_at(t):
        loads = [ec.Traction("top", (0.5 * np.sin(t), -5.0 * t))]
        if on_springs:
            loads.append(ec.Traction("left", (-2.0 * t, 0.0)))
        spring = ec.Spring("left", 40.0, 10.0)
        return replace(sprung(spring, friction=0.0 if on_springs else 0.3), loads=loads)

    evolution = ec.evolve(scene_at, plate(4), [0.5, 1.0, 2.0], accuracy=0.5, degree=2)
    left = [abs(step.imbalance) for step in evolution.steps]
    e_2 = [error.absolute**2 for error in evolution.errors]
    assert np.all(np.array(left) < 5 * np.cumsum(e_2))


def test_ranks_solvers_and_very_stiff_springs():
    scene = sprung(ec.Spring("left", 1e8 * E, 1e8 * E), ec.Spring("right", 5.0))
    first, errors = by_ranks_and_solvers(
        lambda comm, solver: certified(scene, plate(4, comm), solver=solver)
    )
    for error in errors:
        assert error.force("left").force == pytest.approx(first.force("left").force, rel=1e-6)


BAD = {
    "negative": (lambda: ec.Spring("left", -1.0), "a number >= 0"),
    "callable": (lambda: ec.Spring("left", lambda x: x[0]), "several boundary parts"),
    "nothing": (lambda: ec.Spring("left"), "no stiffness"),
    "twice": (lambda: sprung(ec.Spring("left", 1.0), ec.Spring("left", 2.0)), "2 springs"),
    "contact": (lambda: sprung(ec.Spring("bottom", 1.0)), "in a Contact and in a Spring"),
    "support": (lambda: held(ec.Spring("bottom", 1.0)), "a Spring and a Displacement"),
    "face": (
        lambda: held(ec.Spring("left", 1.0), supports=[ec.Rigid("left", (0.0, 0.0), 0.0)]),
        "a Spring and a Rigid",
    ),
    "part": (lambda: ec.solve(held(ec.Spring("wall", 1.0)), plate()), "'wall'"),
    "no spring": (lambda: replace(held(), springs=3.0), "springs is 3.0"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_springs_are_refused_in_words(case):
    refused(*BAD[case])
