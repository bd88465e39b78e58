"""Intervals of forces and moments of contacts between bodies, and of several contacts.

Forces of a fine mesh lie in them, with their signs; both sides have opposite intervals;
moving the gap tells the same as moving all beyond the contact.
"""

from functools import cache

import numpy as np
import pytest
from domains import refused
from scenes import certified, measured
from test_moments import moment_about

import erc_contact as ec
from erc_contact.error.goals import contact_perturbations, goal_error, trials
from erc_contact.error.goals.difference_quotient import Ends
from erc_contact.error.goals.moved_pairs import moved_pairs
from erc_contact.error.goals.perturbations import perturbation_of
from erc_contact.error.goals.trials import Trials

pytestmark = pytest.mark.serial
MATERIAL = ec.Elastic({"upper": 1.0, "lower": 3.0}, 0.3)
ABOUT = (3.0, -1.0)


def bodies(cells: int) -> ec.Domain:
    upper = ec.rectangle((0.5, 1.0), (1.5, 2.0), cells=(cells, cells))
    lower = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2 * cells, cells))
    parts = ec.assembly({"upper": upper, "lower": lower})
    return parts.joined("upper bottom", "lower top")


def stack(friction: object = 0.0) -> ec.Scene:
    """A block that is pressed and pushed on another one, which lies in a corner."""
    loads = [ec.Traction("upper right", (0.0, 0.004)), ec.BodyForce((0.0, -0.002))]
    contacts = [
        ec.Contact("upper bottom", against="lower top", friction=friction),
        ec.Contact("lower bottom", friction=ec.Tresca(0.001)),
    ]
    supports = [ec.Displacement("upper top", (0.002, -0.01)), ec.Symmetry("lower left")]
    return ec.Scene(MATERIAL, supports, loads, contacts)


@cache
def errors(friction: float) -> tuple[ec.ConstitutiveError, ec.ConstitutiveError]:
    scene = stack(ec.Tresca(friction) if friction else 0.0)
    return measured(scene, bodies(4)), measured(scene, bodies(12))


@pytest.mark.broad
@pytest.mark.parametrize("friction", [0.0, 0.001])
def test_forces_and_moments_of_a_fine_mesh(friction):
    """The weight of a body is in the force below it, and not in that above it."""
    coarse, fine = errors(friction)
    for part in ("upper bottom", "lower bottom"):
        force = fine.force(part)
        up = ec.interval(coarse, ec.Resultant(part, (0.0, 1.0)))
        moment = ec.interval(coarse, ec.Moment(part, about=ABOUT))
        assert up.guaranteed
        assert up.low < force.force[1] < up.high
        assert moment.low < moment_about(force, ABOUT)[0] < moment.high
        assert max(up.relative, moment.relative) < 0.15


@pytest.mark.broad
def test_sides_have_opposite_intervals():
    coarse, _ = errors(0.001)
    for kind, argument in ((ec.Resultant, (1.0, 2.0)), (ec.Moment, ABOUT)):
        here, there = (
            ec.interval(coarse, kind(part, argument)) for part in ("upper bottom", "lower top")
        )
        assert there.low == pytest.approx(-here.high, rel=1e-6)
        assert there.high == pytest.approx(-here.low, rel=1e-6)


@pytest.mark.broad
@pytest.mark.parametrize("part", ["upper bottom", "lower top"])
def test_gap_tells_what_supports_tell(part, monkeypatch):
    coarse, _ = errors(0.0)
    asked = [ec.Resultant(part, (0.0, 1.0)), ec.Moment(part, about=ABOUT)]
    by_supports = [ec.interval(coarse, goal) for goal in asked]
    monkeypatch.setattr(contact_perturbations, "_of_set", lambda *arguments: None)
    for goal, bounds in zip(asked, by_supports, strict=True):
        by_gap = ec.interval(coarse, goal)
        assert by_gap.low == pytest.approx(bounds.low, rel=1e-6)
        assert by_gap.high == pytest.approx(bounds.high, rel=1e-6)
    along = ec.interval(coarse, ec.Resultant(part, (1.0, 0.0)))
    assert along.low == along.high == along.relative == 0.0


@pytest.mark.broad
def test_corner_and_symmetry():
    """Of two planes each has the load towards it; friction on both leaves it open."""
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    loads = [ec.Traction("right", (-0.02, 0.005)), ec.Traction("top", (0.0, -0.01))]

    def corner(left: ec.Contact, bottom: ec.Contact) -> ec.Scene:
        return ec.Scene(ec.Elastic(1.0, 0.3), [], loads, [left, bottom])

    scene = corner(ec.Contact("left"), ec.Contact("bottom"))
    coarse = measured(scene, block)
    below = ec.interval(coarse, ec.Resultant("bottom", (0.0, 2.0)))
    assert below.guaranteed
    assert below.low == pytest.approx(0.03, rel=1e-9)
    assert below.high == pytest.approx(0.03, rel=1e-9)
    fine = measured(scene, block.refined())
    for part in ("left", "bottom"):
        moment = ec.interval(coarse, ec.Moment(part, about=ABOUT))
        assert moment.low < moment_about(fine.force(part), ABOUT)[0] < moment.high
    rough = measured(
        corner(*(ec.Contact(p, friction=ec.Tresca(0.001)) for p in ("left", "bottom"))), block
    )
    refused(lambda: ec.interval(rough, ec.Resultant("left", (1.0, 0.0))), "friction", "share")
    pressed = ec.Displacement("top", (0.0, -0.01))
    half = ec.Scene(ec.Elastic(1.0, 0.3), [pressed, ec.Symmetry("left")], [], ec.Contact("bottom"))
    error = measured(half, block)
    refused(lambda: ec.interval(error, ec.Resultant("left", (1.0, 0.0))), "cannot move alone")
    force = ec.interval(error, ec.Resultant("bottom", (0.0, 1.0)))
    top = ec.interval(error, ec.Resultant("top", (0.0, 1.0)))
    assert force.low == pytest.approx(-top.high, rel=1e-6)


def test_intersection_with_the_lifting_bound(monkeypatch):
    """A force is also in the interval of ``resultant``; proved and estimate do not mix."""
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    pressed = ec.Displacement("top", (0.0, -0.01))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), pressed, [], ec.Contact("bottom"))
    error = measured(scene, block)
    goal = ec.Resultant("bottom", (0.0, 1.0))
    first = ec.resultant(error, "bottom", (0.0, 1.0))
    useless = Ends(-10.0, first.value, 1.0, 1.0, 0.0, 0 * error.indicators)
    monkeypatch.setattr(goal_error, "search", lambda trials, t, count: trials.tried.append(useless))
    both = ec.interval(error, goal)
    assert both.guaranteed
    assert (both.low, both.high) == pytest.approx((first.low, first.value), rel=1e-9)

    monkeypatch.undo()
    numbers = iter([np.nan, 1.0, 1.0, 1.0, 1.0, 1.0])
    monkeypatch.setattr(
        trials, "ends_of", lambda *pairs: Ends(-next(numbers), first.value, 1.0, 1.0, 0.0, 0.0)
    )
    # A scene that was moved so far that it overflows tells nothing.
    assert ec.interval(error, goal).low == pytest.approx(first.low, rel=1e-9)

    proved = ec.Bounds(1.0, 0.0, 2.0, guaranteed=True)
    estimate = ec.Bounds(2.5, 1.0, 4.0, guaranteed=False)
    assert proved.narrowed(estimate) == estimate.narrowed(proved) == proved
    narrow = ec.Bounds(1.5, 1.0, 2.0, guaranteed=False)
    assert proved.narrowed(narrow) == narrow
    overlap = narrow.narrowed(ec.Bounds(2.25, 1.5, 3.0, guaranteed=False))
    assert (overlap.low, overlap.high, overlap.guaranteed) == (1.5, 2.0, False)
    apart = ec.Bounds(5.0, 4.5, 5.5, guaranteed=True)
    assert proved.narrowed(apart) == apart


@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.0, ec.Tresca(0.001)])
def test_estimate_from_one_side(friction):
    """It is near the interval, whether the motion changes the contact set or not."""
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(16, 8))
    pressed = ec.Displacement("top", (0.0, -0.01))
    lift = ec.Traction("right", (0.0, 0.02))
    contact = ec.Contact("bottom", friction=friction)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), pressed, lift, contact)
    error = certified(scene, block, ec.Nitsche())
    perturbation = perturbation_of(error, ec.Resultant("top", (0.0, 1.0)))
    with moved_pairs(error, "auto", 50) as pair_of:
        tried = Trials(error, perturbation, pair_of)
        for factor, shares in ((1.0, (-0.1, 0.1)), (10.0, (0.5, 0.8))):
            t = factor * perturbation.step
            rough = tried.rough(t)
            ends = tried.attempt(t)
            assert shares[0] < ends.spread / ends.width < shares[1]
            assert 0.5 < rough.width / ends.width < 1.1
            assert ends.low < (rough.low + rough.high) / 2 < ends.high
