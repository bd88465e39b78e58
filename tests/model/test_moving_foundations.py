"""Foundations that move under a body: belts, discs, drums.

- What counts is the motion of the body against its foundation: a foundation that moves
  by d, and a body all of whose supports move by -d, have the same forces, slip, error,
  intervals, energies and histories.
- A disc that turns below a pad pulls at it with friction times pressure times radius.
- A motion that facets do not represent is told, and nothing is then called guaranteed.
- Bad input is refused in words.
"""

from dataclasses import replace

import numpy as np
import pytest
from scenes import certified, mostly_serial

import erc_contact as ec
from erc_contact.run.fingerprint import fingerprint

SUNK = 0.01
METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]


def meshed(d):
    if d == 2:
        return ec.rectangle((0.0, 0.0), (2.0, 1.0), size=0.3)
    return ec.box((0.0, 0.0, 0.0), (1.0, 0.8, 0.5), cells=(3, 2, 2))


def scene(moved, friction=0.3, *, by_foundation, foundation=None):
    """A block that is held at its top and pressed on a foundation; one of both moves."""
    back = np.zeros(len(moved)) if by_foundation else -np.array(moved)
    back[-1] -= SUNK
    motion = tuple(moved) if by_foundation else None
    foot = ec.Contact("bottom", friction=friction, foundation=foundation, motion=motion)
    return ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", tuple(back)), contacts=foot)


def assert_same(first, second, rtol=1e-9):
    assert first.relative == pytest.approx(second.relative, rel=rtol)
    force = second.force("bottom").force
    assert np.allclose(first.force("bottom").force, force, atol=rtol * abs(force).max())
    for name in ("pressure", "slip"):
        one = first.profile("bottom")[name]
        two = second.profile("bottom")[name]
        assert np.allclose(one, two, rtol=0, atol=rtol * abs(two).max())


@pytest.mark.pairs
@pytest.mark.on_ranks("2-tangential-1-method0-direct", "3-rising-1-method1-iterative")
@pytest.mark.parametrize("solver", mostly_serial(["direct", "iterative"], ["direct"]))
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1], [2]))
@pytest.mark.parametrize("way", ["tangential", "rising", "far"])
@pytest.mark.parametrize("d", [2, 3])
def test_what_counts_is_the_motion_against_the_foundation(d, way, degree, method, solver):
    moved = {"tangential": [0.004] * (d - 1) + [0.0], "rising": [0.004] * (d - 1) + [0.003]}
    far = [0.3] * (d - 1) + [0.0]  # all of it slips, and by much more than it is strained
    options = {"degree": degree, "method": method, "solver": solver}
    errors = []
    for by_foundation in (True, False):
        of_way = moved.get(way, far)
        errors.append(certified(scene(of_way, by_foundation=by_foundation), meshed(d), **options))
    assert_same(*errors, rtol=1e-9 if solver == "direct" else 1e-7)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.3, ec.Tresca(0.002)])
def test_numbers_have_the_same_intervals(friction):
    goals = [
        ec.Energy(),
        ec.Resultant("bottom", (1.0, 0.0)),
        ec.Resultant("top", (0.0, 1.0)),
        ec.MeanDisplacement("right", (0.0, 1.0)),
    ]
    errors = []
    for by_foundation in (True, False):
        errors.append(
            certified(scene([0.005, 0.0], friction, by_foundation=by_foundation), meshed(2))
        )
    for goal in goals:
        one, two = (ec.interval(error, goal) for error in errors)
        assert (one.low, one.high) == pytest.approx((two.low, two.high), rel=1e-8)
        assert one.guaranteed == two.guaranteed
    certificates = [ec.coulomb_certificate(error) for error in errors]
    assert str(certificates[0]) == str(certificates[1])


@pytest.mark.broad
@pytest.mark.serial
def test_a_foundation_that_gives_way_moves_too():
    bed = ec.Foundation(2.0)
    both = []
    for by_foundation in (True, False):
        moving = scene([0.004, 0.002], by_foundation=by_foundation, foundation=bed)
        both.append(certified(moving, meshed(2)))
    assert_same(*both)


@pytest.mark.broad
@pytest.mark.on_ranks("SizeMap", "Mark")
@pytest.mark.parametrize("strategy", [ec.Mark(), ec.SizeMap()], ids=["Mark", "SizeMap"])
def test_a_belt_that_goes_and_comes(strategy):
    """Each step counts from where the last one left the body on the belt."""
    times = [0.0, 1.0, 2.0, 3.0, 4.0]
    histories = []
    for by_foundation in (True, False):

        def at(t, by_foundation=by_foundation):
            return scene([0.02 * np.sin(t), 0.0], by_foundation=by_foundation)

        histories.append(ec.evolve(at, meshed(2), times, accuracy=0.05, strategy=strategy))
    belt, body = histories
    assert belt.column("cells").tolist() == body.column("cells").tolist()
    assert belt.column("meshes").max() > 1
    for name in ("eps", "dissipated", "stored"):
        size = abs(body.column(name)).max()
        assert np.allclose(belt.column(name), body.column(name), atol=1e-8 * size)
    assert np.allclose(belt.force("bottom"), body.force("bottom"), atol=1e-9)


@pytest.mark.broad
@pytest.mark.on_ranks("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_a_turning_disc_pulls_with_its_moment(degree):
    """Without lateral strain the pressure of the pad is the same everywhere."""
    pad = ec.box((1.0, -0.4, 0.0), (1.8, 0.4, 0.5), cells=(4, 4, 2))
    a, friction = 0.5, 0.2
    turn = (lambda x: -a * x[1], lambda x: a * x[0], 0.0)
    foot = ec.Contact("bottom", friction=friction, motion=turn)
    press = ec.Displacement("top", (0.0, 0.0, -SUNK))
    stiff = ec.Scene(ec.Elastic(1.0, 0.0), press, contacts=foot)
    error = certified(stiff, pad, degree=degree)
    force = error.force("bottom")
    profile = error.profile("bottom")
    radius = np.hypot(profile["x"], profile["y"])
    moment = friction * float(profile["weight"] @ (profile["pressure"] * radius))
    assert abs(force.moment[2]) == pytest.approx(moment, rel=2e-3)
    assert force.moment[2] > 0  # the pad is taken along with the disc


@pytest.mark.on_ranks("9")
@pytest.mark.parametrize("waves", [pytest.param(0, marks=pytest.mark.broad), 9])
def test_a_motion_that_facets_do_not_represent_is_told(waves):
    wavy = (lambda x: 0.004 * np.cos(waves * x[0]), 0.0)
    foot = ec.Contact("bottom", friction=ec.Tresca(0.002), motion=wavy)
    press = ec.Displacement("top", (0.0, -SUNK))
    error = certified(ec.Scene(ec.Elastic(1.0, 0.3), press, contacts=foot), meshed(2))
    assert (error.oscillations.history > 0) == (waves > 0)
    assert error.guaranteed == (waves == 0)


def test_bad_motions_are_refused():
    with pytest.raises(ec.InputError, match="a body is moved by a Displacement"):
        ec.Contact("a", against="b", motion=(1.0, 0.0))
    with pytest.raises(ec.InputError, match="for each component of the motion"):
        ec.Contact("bottom", motion=lambda x: x)
    with pytest.raises(ec.InputError, match="motion"):
        ec.Contact("bottom", motion=(1.0,))
    in_space = ec.Contact("bottom", motion=(0.0, 0.0, 0.0))
    with pytest.raises(ec.InputError, match="of 3 components, but the mesh is 2D"):
        ec.solve(replace(scene([0.0, 0.0], by_foundation=True), contacts=in_space), meshed(2))
    infinite = ec.Contact("bottom", motion=(lambda x: 1.0 / (x[0] - x[0]), 0.0))
    with pytest.raises(ec.InputError, match="motion"):
        ec.solve(replace(scene([0.0, 0.0], by_foundation=True), contacts=infinite), meshed(2))


@pytest.mark.serial
def test_a_checkpoint_knows_another_motion():
    prints = [
        fingerprint(scene([moved, 0.0], by_foundation=True), meshed(2), {}) for moved in (0.1, 0.2)
    ]
    assert prints[0] != prints[1]
