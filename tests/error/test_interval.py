"""Intervals from three admissible pairs: they hold, are nested, and shrink faster than e.

Properties: a number that equilibrium or a homogeneous state dictates is met; intervals
of a coarse and of a fine mesh overlap, in 2D and 3D, without friction, with Tresca's,
between two bodies and under springs; the order in e; what has no interval is told.
"""

import logging

import numpy as np
import pytest
import ufl
from domains import refused
from mpi4py import MPI
from scenes import certified, flat_block
from test_two_bodies import pressed_pair, small_bricks

import erc_contact as ec
from erc_contact.base.logs import log_of
from erc_contact.error.goals.controller import GoalController
from erc_contact.error.goals.trials import GoalError
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.solve import Nearby

COMM = MPI.COMM_WORLD
DEPTH = 0.01
RIGHT = ec.Traction("right", (-0.02, 0.0))
PRESSED = ec.Traction("right", pressure=2.0)


def opening(d: int, friction: object = 0.0, **options: object) -> ec.Scene:
    """A block whose right half is lifted from the foundation."""
    rollers = [ec.Displacement("left", (0.0, *(None,) * (d - 1)))]
    rollers.append(ec.Displacement("top", (*(None,) * (d - 1), -DEPTH)))
    if d == 3:
        rollers.append(ec.Displacement("front", (None, 0.0, None)))
    lift = ec.Traction("right", (*(0.0,) * (d - 1), 2 * DEPTH))
    contact = ec.Contact("bottom", friction=friction)
    return ec.Scene(ec.Elastic(1.0, 0.3), rollers, lift, contact, **options)


def up(d: int) -> tuple[float, ...]:
    return (*(0.0,) * (d - 1), 1.0)


def goals(d: int) -> list:
    return [
        ec.Resultant("top", up(d)),
        ec.Resultant("bottom", up(d)),
        ec.MeanDisplacement("right", up(d)),
    ]


@pytest.mark.broad
@pytest.mark.parametrize(
    ("d", "degree", "friction", "cells"),
    [
        (2, 1, 0.0, (4, 12)),
        pytest.param(2, 2, ec.Tresca(0.002), (2, 6), marks=pytest.mark.serial),
        pytest.param(3, 1, 0.0, (2, 4), marks=pytest.mark.serial),
    ],
)
def test_coarse_and_fine_intervals(d, degree, friction, cells):
    """They overlap, are proved, and shrink faster than e; ``resultant`` holds both."""
    scene = opening(d, friction)
    coarse, fine = (certified(scene, flat_block(d, n), degree=degree) for n in cells)
    for goal in goals(d):
        one, other = (ec.interval(error, goal) for error in (coarse, fine))
        assert one.guaranteed
        assert other.guaranteed
        assert one.low <= other.high
        assert other.low <= one.high
        order = np.log((one.high - one.low) / (other.high - other.low))
        order /= np.log(coarse.absolute / fine.absolute)
        assert order > 1.2, goal
    force = ec.interval(fine, goals(d)[1])
    first = ec.resultant(fine, "bottom", up(d))
    assert first.low <= force.low <= force.high <= first.high


def test_numbers_that_are_known():
    """A column under its own number: force and displacement of a homogeneous state."""
    held = [ec.Displacement("left", (0.0, None))]
    scene = ec.Scene(ec.Elastic(1.0, 0.0), held, RIGHT, ec.Contact("bottom"))
    error = certified(scene, flat_block(2, 2))
    shortening = ec.interval(error, ec.MeanDisplacement("right", (1.0, 0.0)))
    force = ec.interval(error, ec.Resultant("left", (2.0, 0.0)))
    for bounds, exact in ((shortening, -0.04), (force, 0.04)):
        assert bounds.low - 1e-12 <= exact <= bounds.high + 1e-12
        assert bounds.high - bounds.low < 1e-9


def test_functionals_of_a_homogeneous_state():
    """``u_x = -0.02 x``: integrals with weights over a side and over the body."""
    held = [ec.Displacement("left", (0.0, None))]
    scene = ec.Scene(ec.Elastic(1.0, 0.0), held, RIGHT, ec.Contact("bottom"))
    error = certified(scene, flat_block(2, 2))
    by_height = ec.Traction("right", (lambda x: 3.0 * x[1], 0.0))
    loads = {-0.06: by_height, -0.04: ec.BodyForce((1.0, 0.0)), 0.08: PRESSED}
    for exact, load in loads.items():
        bounds = ec.interval(error, ec.Functional(load))
        assert bounds.guaranteed
        assert bounds.low - 1e-12 <= exact <= bounds.high + 1e-12
        assert bounds.high - bounds.low < 1e-8
    # No polynomial: the mesh does not represent it.
    curved = ec.Traction("right", (lambda x: ufl.exp(x[1]), 0.0))
    assert not ec.interval(error, ec.Functional(curved)).guaranteed
    refused(lambda: ec.interval(error, ec.Functional(ec.Traction("bottom", (0, 1)))), "'bottom'")
    refused(lambda: ec.Functional("right"), "'right'", "Traction")


@pytest.mark.serial
def test_direction_turns_the_interval():
    """The opposite direction has the opposite interval, a longer one a wider interval."""
    error = certified(opening(2), flat_block(2, 4))
    for part, kind in (("top", ec.Resultant), ("right", ec.MeanDisplacement)):
        bounds = ec.interval(error, kind(part, (0.0, 1.0)))
        turned = ec.interval(error, kind(part, (0.0, -3.0)))
        assert turned.low == pytest.approx(-3 * bounds.high, rel=1e-6)
        assert turned.high == pytest.approx(-3 * bounds.low, rel=1e-6)


@pytest.mark.broad
@pytest.mark.serial
def test_bodies_springs_and_coulomb():
    """Two bodies, a body on springs; with Coulomb's friction it is an estimate."""
    coarse = certified(pressed_pair(2), small_bricks(2))
    fine = certified(pressed_pair(2), small_bricks(2).refined().refined(), degree=2)
    for goal in (ec.Resultant("upper outer", (0.0, 1.0)), ec.Resultant("lower outer", (0.0, 1.0))):
        one, other = ec.interval(coarse, goal), ec.interval(fine, goal)
        assert one.guaranteed
        assert one.low <= other.low <= other.high <= one.high
    on_springs = opening(2, springs=ec.Spring("right", normal=0.5))
    one, other = (
        ec.interval(certified(on_springs, flat_block(2, n)), goals(2)[0]) for n in (4, 16)
    )
    assert one.low <= other.low <= other.high <= one.high


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_estimates_with_coulomb_friction(friction):
    """The forces of elements on a fine mesh lie in them, which do not know them."""

    def tall(cells):
        return ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(cells, 3 * cells))

    pressed_pair = ec.Displacement("top", (0.1, -0.05))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), pressed_pair, (), ec.Contact("bottom", friction=friction)
    )
    exact = ec.solve(scene, tall(20), degree=2).force("bottom").force
    error = certified(scene, tall(4), degree=2)
    for direction, force in zip(np.eye(2), exact, strict=True):
        estimate = ec.interval(error, ec.Resultant("bottom", direction))
        assert not estimate.guaranteed
        assert estimate.low < force < estimate.high
        assert estimate.high - estimate.low < 0.05 * exact[1]


@pytest.mark.broad
@pytest.mark.serial
def test_order_of_names_changes_no_estimate():
    """Forms integrate over the softer side, which the scene may name second."""
    upper = ec.rectangle((0.0, 1.0), (2.0, 2.0), cells=(6, 3))
    lower = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    bodies = ec.assembly({"upper": upper, "lower": lower}).joined("upper bottom", "lower top")
    supports = [
        ec.Displacement("upper top", (0.01, -0.02)),
        ec.Displacement("lower bottom", (0.0, 0.0)),
    ]
    bounds = []
    for first, second in (("upper bottom", "lower top"), ("lower top", "upper bottom")):
        contact = ec.Contact(first, against=second, friction=0.3)
        scene = ec.Scene(ec.Elastic({"upper": 1.0, "lower": 3.0}, 0.3), supports, (), contact)
        interval = ec.interval(certified(scene, bodies), ec.Resultant("upper top", (1.0, 0.0)))
        bounds.append([interval.low, interval.high])
    assert bounds[1] == pytest.approx(bounds[0], rel=1e-6)


@pytest.mark.broad
@pytest.mark.serial
def test_runs_that_aim_at_a_number(tmp_path):
    """A force that is a hundredth of the pressure, to 1%, where e alone tells nothing of it.

    A run that was ended goes on from its folder.
    """
    block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(2, 7))
    pressed_pair = ec.Displacement("top", (0.1, -0.05))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), pressed_pair, (), ec.Contact("bottom", friction=0.01))
    goal = ec.Resultant("bottom", (1.0, 0.0))
    options = {"goal": goal, "degree": 2}
    history = ec.adapt(scene, block, 0.01, **options)
    assert history.reached
    assert history.bounds.relative <= 0.01
    force = history.force("bottom").force[0]
    assert force == pytest.approx(history.bounds.value, rel=0.01)
    by_energy = ec.resultant(history, "bottom", goal.direction)
    assert by_energy.relative > 10 * history.bounds.relative
    folder = COMM.bcast(str(tmp_path) if COMM.rank == 0 else None)
    ec.adapt(scene, block, 0.01, max_steps=2, checkpoint=folder, **options)
    again = ec.adapt(scene, block, 0.01, checkpoint=folder, **options)
    assert [step.cells for step in again.steps] == [step.cells for step in history.steps]
    assert again.bounds.value == pytest.approx(history.bounds.value, rel=1e-3)
    refused(lambda: ec.adapt(scene, block, 0.01, goal="force"), "goal is 'force'", "Resultant")


@pytest.mark.broad
@pytest.mark.serial
def test_run_to_a_displacement():
    """The interval of the run is proved, and holds the interval of a fine mesh."""
    aimed = ec.adapt(opening(2), flat_block(2, 2), 0.04, goal=goals(2)[2])
    assert aimed.reached
    assert aimed.bounds.guaranteed
    fine = ec.interval(certified(opening(2), flat_block(2, 16), degree=2), goals(2)[2])
    assert aimed.bounds.low <= fine.low <= fine.high <= aimed.bounds.high


@pytest.mark.broad
@pytest.mark.serial
def test_what_runs_cost(monkeypatch, caplog):
    """Far meshes take one further solve, none a second factor or second forms.

    The further solves are silent.

    A run that ends for want of meshes still measures its interval.
    """
    moved: list[int] = []
    factors: list[int] = []
    forms: list[int] = []
    init = ContactForms.__init__
    solve, condense = Nearby.solve, Stiffness._condense

    def seen_solve(nearby, scene):
        moved.append(nearby._near.domain.cells)
        log_of(COMM).warning("of a moved scene")
        return solve(nearby, scene)

    def seen_condense(stiffness):
        factors.append(stiffness.model.domain.cells)
        condense(stiffness)

    def seen_forms(of_contacts, model, method):
        forms.append(model.domain.cells)
        init(of_contacts, model, method)

    monkeypatch.setattr(ContactForms, "__init__", seen_forms)
    monkeypatch.setattr(Nearby, "solve", seen_solve)
    monkeypatch.setattr(Stiffness, "_condense", seen_condense)
    with caplog.at_level(logging.INFO, "erc_contact"):
        aimed = ec.adapt(opening(2), flat_block(2, 2), 0.02, goal=goals(2)[2])
    cells = [step.cells for step in aimed.steps]
    assert aimed.reached
    assert factors == cells
    assert forms == cells
    assert moved.count(cells[0]) == moved.count(cells[2]) == 1
    assert len(moved) < 2 * len(cells)
    assert "of a moved scene" not in caplog.text
    log_of(COMM).warning("of the user")
    assert "of the user" in caplog.text
    stopped = ec.adapt(opening(2), flat_block(2, 2), 0.02, goal=goals(2)[2], max_steps=3)
    assert moved[-1] == cells[2]
    assert not stopped.reached
    assert stopped.bounds.guaranteed
    assert stopped.bounds.low <= aimed.bounds.low <= aimed.bounds.high <= stopped.bounds.high


def test_intervals_of_several_meshes():
    """Proved ones are intersected; an estimate stays what it is."""
    aim = GoalController(goals(2)[0], 0.01, "auto", 50)

    def after(low, high, guaranteed):
        bounds = ec.Bounds((low + high) / 2, low, high, guaranteed)
        return aim._with_proved(GoalError(bounds, np.zeros(0))).bounds

    assert after(0.0, 4.0, True).high == 4.0
    assert after(1.5, 3.0, False).high == 3.0
    narrow = after(1.0, 5.0, True)
    assert (narrow.low, narrow.value, narrow.high) == (1.0, 2.5, 4.0)


def test_run_to_an_energy():
    """It ends where the interval is narrow, long before eps is; a fine mesh agrees."""
    aimed = ec.adapt(opening(2), flat_block(2, 2), 0.02, goal=ec.Energy())
    assert aimed.reached
    assert aimed.bounds.guaranteed
    assert aimed.bounds.relative <= 0.02 < aimed.error.relative
    assert len(aimed.steps) > 1
    own = ec.potential_energy(aimed.error)
    assert (aimed.bounds.low, aimed.bounds.high) == (own.low, own.high)
    fine = ec.interval(certified(opening(2), flat_block(2, 16), degree=2), ec.Energy())
    assert aimed.bounds.low < fine.low < fine.value < fine.high < aimed.bounds.high


def test_what_has_no_interval():
    error = certified(opening(2), flat_block(2, 4))
    refused(lambda: ec.interval(error, ec.Resultant("right", (0.0, 1.0))), "'right'", "bottom")
    refused(lambda: ec.interval(error, ec.Resultant("top", (0.0, 1.0, 0.0))), "2 finite numbers")
    refused(lambda: ec.interval(error, ec.MeanDisplacement("top", (0.0, 1.0))), "Resultant")
    refused(lambda: ec.interval(error, ec.MeanDisplacement("tpo", (0.0, 1.0))), "'tpo'")
    refused(lambda: ec.Resultant("top", "up"), "Resultant('top')")
