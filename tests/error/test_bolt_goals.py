"""The force and the shift of a bolt in intervals.

- a bar, also on rings and under its weight, and a bolt beside a sleeve, have the closed
  form in them, to round-off where the pair has no error;
- of a bolted joint the interval of a coarse mesh contains the number, and the interval,
  of much finer ones, with either given;
- runs aim at them; ranks agree; with friction they are estimates; what is given is
  refused in words.
"""

import dataclasses

import numpy as np
import pytest
from bolted import SIDES, bolted_plates
from bricks import NAMES, bricks
from domains import refused
from mpi4py import MPI
from scenes import certified, mostly_serial
from test_preload import FORCE, bar, joint, yoke

import erc_contact as ec

SHIFT = 0.03


@pytest.mark.broad
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1]))
def test_a_bar(degree, d):
    domain = bricks(d, (4, 2) if d == 2 else (2, 2, 1))
    shift = FORCE * 2.0 / (100.0 * 2.0 ** (d - 1))
    for given, goal, value in (
        ({"force": FORCE}, ec.Shortening, shift),
        ({"shortening": shift}, ec.BoltForce, FORCE),
    ):
        error = certified(bar(d, **given), domain, degree=degree)
        for name in NAMES:
            bounds = ec.interval(error, goal(name))
            assert bounds.low - 1e-12 * value <= value <= bounds.high + 1e-12 * value
            assert bounds.high - bounds.low < 4e-9 * value
            assert bounds.guaranteed


@pytest.mark.broad
def test_a_ring_shaped_bar():
    shift = 0.02
    steel = ec.Elastic(100.0, 0.0, "axisymmetric")
    upper = ec.rectangle((0.0, 1.0), (1.0, 2.0), cells=(2, 2))
    lower = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2))
    domain = ec.assembly({"a": upper, "b": lower}).joined("a bottom", "b top")
    held = [ec.Displacement("a top", (None, 0.0)), ec.Displacement("b bottom", (None, 0.0))]
    tie = ec.Preload("a bottom", "b top", shortening=shift)
    error = certified(ec.Scene(steel, held, ties=tie), domain)
    force = 100.0 * np.pi * shift / 2.0
    assert ec.interval(error, ec.BoltForce("a bottom")).value == pytest.approx(force, rel=1e-9)
    tie = ec.Preload("a bottom", "b top", force=force)
    error = certified(ec.Scene(steel, held, ties=tie), domain)
    assert ec.interval(error, ec.Shortening("a bottom")).value == pytest.approx(shift, rel=1e-9)


@pytest.mark.broad
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1]))
def test_weight_acts_on_the_cells_beside_the_cut(degree):
    """Ends that are held alike bear the weight alike, and it leaves the force as it is."""
    shift = 0.12
    domain = bricks(2, (4, 4))
    for weight in (0.0, -8.0):
        scene = bar(2, shortening=shift)
        scene = dataclasses.replace(scene, loads=[ec.BodyForce((0.0, weight))])
        error = certified(scene, domain, degree=degree)
        bounds = ec.interval(error, ec.BoltForce(NAMES[0]))
        assert bounds.guaranteed
        assert bounds.low - 1e-8 <= 12.0 <= bounds.high + 1e-8
        # A quarter of the weight on the cells of the cut would be outside.
        assert bounds.high - bounds.low < 0.1 * 8.0 * 2.0


@pytest.mark.broad
@pytest.mark.serial
def test_a_bolt_beside_a_sleeve():
    E = {"above": 100.0, "below": 100.0, "sleeve": 150.0, "yoke": 1e9}
    held = [ec.Displacement("foot", (None, 0.0)), ec.Displacement("sides", (0.0, None))]
    shift = FORCE / 100.0 + FORCE / 300.0
    for given, goal, value in (
        ({"force": FORCE}, ec.Shortening, shift),
        ({"shortening": shift}, ec.BoltForce, FORCE),
    ):
        tie = ec.Preload("upper end", "lower end", **given)
        scene = ec.Scene(ec.Elastic(E, 0.0), held, contacts=[ec.Contact("seat")], ties=tie)
        bounds = ec.interval(certified(scene, yoke()), goal("lower end"))
        assert bounds.value == pytest.approx(value, rel=2e-5)
        assert bounds.high - bounds.low < 1e-4 * value


@pytest.mark.broad
@pytest.mark.serial
def test_coarse_intervals_contain_fine_ones():
    """The pull bends the plates, whose contact opens in part."""
    scene = joint(2, friction=0.0, pull=0.3, shortening=SHIFT)
    intervals = []
    for degree in (1, 2):
        error = certified(scene, bolted_plates(2, 1.0), degree=degree)
        intervals.append(ec.interval(error, ec.BoltForce(SIDES[0])))
    assert all(bounds.guaranteed for bounds in intervals)
    coarse, fine = intervals
    assert coarse.low <= fine.low
    assert fine.high <= coarse.high
    assert fine.high - fine.low < 0.3 * (coarse.high - coarse.low)


FINE = (0.2566, 0.261)
"""What finer meshes leave of the interval of the shift that gives the force."""


@pytest.mark.broad
@pytest.mark.serial
def test_a_shift_of_a_coarse_mesh():
    error = certified(joint(2, friction=0.0, pull=0.3, force=FORCE), bolted_plates(2, 1.0))
    bounds = ec.interval(error, ec.Shortening(SIDES[0]))
    assert bounds.guaranteed
    assert bounds.low < FINE[0] < FINE[1] < bounds.high
    assert bounds.high - bounds.low < 0.35 * bounds.value


@pytest.mark.broad
def test_ranks_and_solvers():
    scene = joint(2, friction=0.0, pull=0.3, shortening=SHIFT)
    ends = []
    for comm, solver in ((MPI.COMM_SELF, "direct"), (MPI.COMM_WORLD, "iterative")):
        error = certified(scene, bolted_plates(2, 1.0, comm=comm), solver=solver)
        bounds = ec.interval(error, ec.BoltForce(SIDES[0]))
        ends.append((bounds.low, bounds.high))
    assert ends[0] == pytest.approx(ends[1], rel=1e-5)


@pytest.mark.broad
@pytest.mark.serial
def test_a_run_aims_at_a_shift():
    scene = joint(2, friction=0.0, pull=0.3, force=FORCE)
    history = ec.adapt(
        scene, bolted_plates(2, 1.0), accuracy=0.2, degree=2, goal=ec.Shortening(SIDES[1])
    )
    assert history.reached
    assert history.bounds.low < FINE[0] < FINE[1] < history.bounds.high


@pytest.mark.broad
def test_with_friction_it_is_an_estimate():
    error = certified(joint(2, shortening=SHIFT), bolted_plates(2, 1.0))
    bounds = ec.interval(error, ec.BoltForce(SIDES[0]))
    assert not bounds.guaranteed
    assert bounds.low <= error.solution.bolt_force(SIDES[0]) <= bounds.high


def test_what_is_given_is_refused():
    domain = bricks(2, (4, 2))
    by_force = certified(bar(2, force=FORCE), domain)
    by_shift = certified(bar(2, shortening=0.1), domain)
    refused(lambda: ec.interval(by_force, ec.BoltForce(NAMES[0])), "is given, 12; ask for the Sho")
    refused(lambda: ec.interval(by_shift, ec.Shortening(NAMES[0])), "is given, 0.1; ask for the B")
    refused(lambda: ec.interval(by_shift, ec.BoltForce("foot")), "give a side of a preload")
    refused(lambda: ec.Shortening(3), "Shortening")
