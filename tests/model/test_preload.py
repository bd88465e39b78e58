"""Preloads: cuts whose sides are drawn together by a force or a shift.

- A bar has q = F L/(E A), with both solvers, in the plane and in 3D; its jump is q d.
- Two springs in parallel: what the bolt feels of a pull before and after the joint opens.
- A bolted joint is in balance to round-off, and sigma^ has the force of the bolt; solvers,
  methods, sides, refined meshes, ranks and checkpoints agree.
- e over the true errors is at least 1, of the body with the shift and with the force.
- Several bolts; bad input is told.
"""

import dataclasses

import numpy as np
import pytest
from bolted import SEATS, SIDES, bolted_plates
from bricks import NAMES, bricks
from domains import refused
from mpi4py import MPI
from reference import true_errors
from scenes import certified
from test_split import tagged

import erc_contact as ec
from erc_contact.admissible import equilibrate as stage
from erc_contact.admissible.balance_parts import TooCoarse

COMM = MPI.COMM_WORLD
SMOOTH = ec.Elastic(100.0, 0.0)
FORCE = 12.0
METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]


def bar(d, **preload):
    """A bar of height 2 and width 2 that is held at both ends and cut in the middle."""
    along = [None] * (d - 1)
    held = [ec.Displacement("upper outer", (*along, 0.0))]
    held.append(ec.Displacement("lower outer", (0.0,) * d))
    return ec.Scene(SMOOTH, held, ties=ec.Preload(*NAMES, **preload))


def joint(d, friction=0.2, pull=0.0, sides=SIDES, **preload):
    """Two plates that a bolt holds together; the lower one is held, the upper one pulled."""
    planes = [ec.Symmetry(f"symmetry {axis}") for axis in "xy"[: d - 1]]
    held = [ec.Displacement("bottom", (*[None] * (d - 1), 0.0))]
    if d == 2:
        held.append(ec.Displacement("outer", (0.0, None)))
    load = ec.Traction("top", (*[0.0] * (d - 1), pull))
    contacts = [ec.Contact(a, against=b, friction=friction) for a, b in SEATS]
    material = ec.Elastic({"above": 1e3, "below": 1e3, "upper": 500.0, "lower": 800.0}, 0.3)
    return ec.Scene(material, [*planes, *held], load, contacts, ties=ec.Preload(*sides, **preload))


@pytest.mark.on_ranks("1-2", "1-3")
@pytest.mark.parametrize(
    ("degree", "d"), [(1, 2), (2, 2), (1, 3), pytest.param(2, 3, marks=pytest.mark.broad)]
)
def test_bar(degree, d):
    """Its force and its shift, given either; nothing is left of e."""
    domain = bricks(d, (4, 2) if d == 2 else (2, 2, 1))
    area = 2.0 ** (d - 1)
    shift = FORCE * 2.0 / (100.0 * area)
    solvers = ("direct", "iterative")
    for solver, given in zip(solvers, ({"force": FORCE}, {"shortening": shift}), strict=True):
        error = certified(bar(d, **given), domain, degree=degree, solver=solver)
        assert error.solution.shortening(NAMES[1]) == pytest.approx(shift, rel=1e-9)
        assert error.force(NAMES[0]).force[-1] == pytest.approx(-FORCE, rel=1e-9)
        assert error.force(NAMES[1]).force[-1] == pytest.approx(FORCE, rel=1e-9)
        assert error.relative < 1e-9
        middle = [0.1] * (d - 1)
        points = [(*middle, -0.01), (*middle, 0.01), (*middle, 1.0)]
        for result in (error, error.solution):
            below, above, _ = result.at(points).displacement[:, -1]
            stretch = 0.01 * shift / 2.0
            assert below == pytest.approx(shift / 2.0 - stretch, rel=1e-7)
            assert above == pytest.approx(-shift / 2.0 + stretch, rel=1e-7)


def test_a_bar_that_presses_across_a_gap():
    """Its force is zero until the shift has closed the gap: the slack bolt is stretched."""
    gap = 0.05
    scene = bar(2, force=-FORCE)
    contact = ec.Contact("lower outer", gap=gap)
    roller = ec.Displacement("lower left", (0.0, None))
    held = [ec.Displacement("upper outer", (0.0, 0.0)), roller]
    pressed = dataclasses.replace(scene, supports=held, contacts=[contact])
    solution = ec.solve(pressed, bricks(2, (4, 2)))
    assert solution.shortening(NAMES[0]) == pytest.approx(-gap - FORCE * 2.0 / 200.0, rel=1e-8)
    assert solution.force("lower outer").force[1] == pytest.approx(FORCE, rel=1e-8)


def yoke():
    """A bolt of width 1 and a sleeve of width 2 below a stiff yoke, on a foundation."""

    def region(x):
        of_bolt = np.where(x[:, 1] > 0.5, 1, 2)
        return np.where(x[:, 1] > 1.0, 4, np.where(x[:, 0] < 1.0, of_bolt, 3))

    regions = {"above": 1, "below": 2, "sleeve": 3, "yoke": 4}
    whole = ec.rectangle((0.0, 0.0), (3.0, 1.5), cells=(6, 6))
    whole = tagged(whole, region, regions)
    whole = whole.named(
        {
            "foot": ec.where(y=0.0, x=(None, 1.0)),
            "seat": ec.where(y=0.0, x=(1.0, None)),
            "sides": [ec.where(x=0.0), ec.where(x=3.0, y=(1.0, None))],
        }
    )
    whole = whole.split({"upper end": "above", "lower end": "below"})
    whole = whole.split({"shank above": "above", "bore above": "sleeve"})
    return whole.split({"shank below": "below", "bore below": "sleeve"})


@pytest.mark.broad
def test_bolt_and_sleeve_in_parallel():
    """The bolt feels k_b/(k_b + k_s) of a pull until the sleeve is free, then all of it."""
    E = {"above": 100.0, "below": 100.0, "sleeve": 150.0, "yoke": 1e9}  # gives by 4e-6
    bolt, sleeve = 100.0, 300.0
    held = [ec.Displacement("foot", (None, 0.0)), ec.Displacement("sides", (0.0, None))]
    domain = yoke()
    pulls = np.array([0.0, 4.0, 10.0, 18.0, 4.0])

    def at(t):
        pull = ec.Traction("top", (0.0, float(np.interp(t, range(5), pulls)) / 3.0))
        given = {"force": FORCE} if t == 0 else {"locked": True}
        tie = ec.Preload("upper end", "lower end", **given)
        return ec.Scene(ec.Elastic(E, 0.0), held, pull, [ec.Contact("seat")], ties=tie)

    evolution = ec.evolve(at, domain, range(5), accuracy=1e-3)
    shift = FORCE / bolt + FORCE / sleeve
    shifts = [error.solution.shortening("upper end") for error in evolution.errors]
    assert shifts == pytest.approx([shift] * 5, rel=1e-5)
    opens = FORCE * (bolt + sleeve) / sleeve
    closed = FORCE + pulls * bolt / (bolt + sleeve)
    expected = np.where(pulls < opens, closed, pulls)
    assert -evolution.force("upper end")[:, 1] == pytest.approx(expected, rel=1e-5)
    of_seat = expected - pulls
    assert evolution.force("seat")[:, 1] == pytest.approx(of_seat, rel=1e-5, abs=1e-5)


@pytest.mark.broad
@pytest.mark.on_ranks("2-method0", "3-method1")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("d", [2, 3])
def test_joint_is_in_balance(d, method):
    """Also sigma^ has the force to round-off; solvers and orders of sides agree."""
    domain = bolted_plates(d, 1.0)
    shifts = []
    for sides, solver in ((SIDES, "iterative"), (SIDES[::-1], "direct" if d == 2 else "iterative")):
        scene = joint(d, pull=0.3, sides=sides, force=FORCE)
        error = certified(scene, domain, method=method, solver=solver)
        solution = error.solution
        shifts.append(solution.shortening(SIDES[0]))
        force = -error.force(SIDES[0]).force[-1]
        assert force == pytest.approx(FORCE, rel=1e-9)
        assert -solution.force(SIDES[0]).force[-1] == pytest.approx(FORCE, rel=1e-7)
        assert error.force("head").force[-1] == pytest.approx(FORCE, rel=1e-9)
        load = error.reactions()["tractions"].force[-1]
        assert error.force("joint").force[-1] == pytest.approx(FORCE - load, rel=1e-9)
        assert abs(error.reactions()["balance"].force).max() < 1e-9 * FORCE
        assert error.admissible.imbalance < 1e-9
    assert shifts[0] == pytest.approx(shifts[1], rel=1e-6)


@pytest.mark.broad
def test_tightened_locked_pulled_and_kept(shared_tmp_path):
    """The shift stays through a history, also where the run goes on from its folder."""
    domain = bolted_plates(2, 2.0)

    def at(t):
        given = {"force": FORCE} if t == 0.0 else {"locked": True}
        return joint(2, pull=8.0 * t, **given)

    options = {"accuracy": 0.2, "degree": 2}
    whole = ec.evolve(at, domain, [0.0, 0.4, 1.0], **options)
    for last in (2, 3):
        times = [0.0, 0.4, 1.0]
        stop = None if last == 3 else _stop_after(2)
        kept = ec.evolve(at, domain, times, checkpoint=shared_tmp_path, callback=stop, **options)
    for evolution in (whole, kept):
        shifts = [error.solution.shortening(SIDES[0]) for error in evolution.errors]
        assert shifts == pytest.approx([shifts[0]] * 3, rel=1e-12)
        of_bolt = -evolution.force(SIDES[0])[:, 1]
        assert of_bolt[0] == pytest.approx(FORCE, rel=1e-9)
        assert of_bolt[1] < 1.1 * FORCE
        # The joint is open: the bolt carries all of the pull.
        assert of_bolt[2] == pytest.approx(24.0, rel=1e-9)
        # The work of tightening is stored and dissipated.
        assert abs(evolution.column("imbalance")[0]) < 0.1 * evolution.column("eps")[0] ** 2
    assert kept.force(SIDES[0]) == pytest.approx(whole.force(SIDES[0]), rel=1e-8)


def _stop_after(count):
    rows = []

    def callback(_, row):
        rows.append(row)
        if len(rows) == count:
            raise StopIteration

    return callback


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("strategy", [ec.Mark(), ec.SizeMap()])
def test_meshes_of_a_run(strategy):
    """The force is the given one on each; the shift comes nearer."""
    scene = joint(2, force=FORCE)
    domain = bolted_plates(2, 2.0)
    run = ec.adapt(scene, domain, 0.08, degree=2, strategy=strategy)
    assert run.reached
    assert -run.force(SIDES[0]).force[1] == pytest.approx(FORCE, rel=1e-9)
    fine = ec.solve(scene, domain.refined().refined(), degree=2).shortening(SIDES[0])
    coarse = ec.solve(scene, domain, degree=2).shortening(SIDES[0])
    shift = run.solution.shortening(SIDES[0])
    assert abs(shift - fine) < 0.2 * abs(coarse - fine)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("friction", [0.0, ec.Tresca(0.4)])
def test_error_is_a_bound_for_shift_and_force(degree, friction):
    domain = bolted_plates(2, 2.0)
    fine = domain.refined().refined()
    scene = joint(2, friction, pull=1.0, force=FORCE)
    error = certified(scene, domain, degree=degree)
    shift = error.solution.shortening(SIDES[0])
    for reference in (scene, joint(2, friction, pull=1.0, shortening=shift)):
        exact = ec.solve(reference, fine, ec.AugmentedLagrangian(), degree=2)
        true = true_errors(error.admissible, exact)
        assert 1.0 <= error.absolute / true.both < 1.3


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.serial
def test_energies_of_a_given_force_meet():
    """Each mesh has another shift, of one problem: J has the work of the force."""
    plates = bolted_plates(2, 0.5)
    intervals = []
    shifts = []
    for degree, domain in ((1, plates), (2, plates), (2, plates.refined())):
        error = certified(joint(2, friction=0.0, force=FORCE), domain, degree=degree)
        intervals.append(ec.potential_energy(error))
        shifts.append(error.solution.shortening(SIDES[0]))
    assert max(shifts) > 1.01 * min(shifts)
    assert all(bounds.guaranteed for bounds in intervals)
    assert max(bounds.low for bounds in intervals) <= min(bounds.high for bounds in intervals)
    # Pressed together from rest, J is half of the work -F q.
    assert intervals[-1].low <= -FORCE * shifts[-1] / 2 * (1 - 1e-9) <= intervals[-1].high


@pytest.mark.broad
def test_a_force_that_cannot_be_kept_is_left_out(monkeypatch):
    """sigma^ then has another force in the bolt, and is in equilibrium all the same."""
    solution = ec.solve(joint(2, force=FORCE), bolted_plates(2, 2.0))
    original = stage.admissible_tractions
    balanced = []

    def failing(model, solved, others):
        balanced.append(len(others.motions))
        if len(balanced) == 1:
            raise TooCoarse("no traction", np.empty(0, dtype=np.int32))
        return original(model, solved, others)

    monkeypatch.setattr(stage, "admissible_tractions", failing)
    assert ec.equilibrate(solution).imbalance < 1e-11
    assert balanced[1] < balanced[0]


@pytest.mark.broad
@pytest.mark.serial
def test_two_bolts():
    """Two bars with forces of their own below a yoke that a contact presses down."""
    left, right = (ec.rectangle((x, 0.0), (x + 1.0, 1.0), cells=(2, 2)) for x in (0.0, 2.0))
    feet = [ec.rectangle((x, -1.0), (x + 1.0, 0.0), cells=(2, 2)) for x in (0.0, 2.0)]
    top = ec.rectangle((0.0, 1.0), (3.0, 2.0), cells=(6, 2))
    bodies = {"left": left, "right": right, "a": feet[0], "b": feet[1], "top": top}
    whole = ec.assembly(bodies).joined("left bottom", "a top").joined("right bottom", "b top")
    whole = whole.joined("left top", "top bottom", tied=True)
    whole = whole.joined("right top", "top bottom outside", tied=True)
    held = [ec.Displacement("a bottom", (0.0, 0.0)), ec.Displacement("b bottom", (0.0, 0.0))]
    contact = ec.Contact("top top", friction=0.0)
    stop = ec.Displacement("top left", (0.0, None))
    ties = [
        ec.Preload("left bottom", "a top", force=-5.0),
        ec.Preload("right bottom", "b top", force=-3.0),
    ]
    names = [("left top", "top bottom"), ("right top", "top bottom outside")]
    ties += [ec.Tied(*pair) for pair in names if set(pair) <= set(whole.names)]
    scene = ec.Scene(ec.Elastic(100.0, 0.2), [*held, stop], contacts=contact, ties=ties)
    error = certified(scene, whole)
    assert error.force("left bottom").force[1] == pytest.approx(5.0, rel=1e-6)
    assert error.force("right bottom").force[1] == pytest.approx(3.0, rel=1e-6)
    assert error.force("top top").force[1] == pytest.approx(-8.0, rel=1e-6)


def test_bad_input():
    pair = NAMES
    refused(lambda: ec.Preload(*pair), "nothing that tells its shift", "force=")
    refused(lambda: ec.Preload(*pair, force=1.0, locked=True), "force=1.0 and locked=True")
    refused(lambda: ec.Preload(*pair, force=1.0, shortening=0.1), "force=1.0 and shortening=0.1")
    refused(lambda: ec.Preload(*pair, shortening=0.1, locked=True), "shortening=0.1 and locked")
    refused(lambda: ec.Preload(*pair, force=float("nan")), "finite")
    refused(lambda: ec.Preload(*pair, shortening="0.1"), "finite")
    refused(lambda: ec.Preload(*pair, locked=1), "True or False")
    refused(lambda: ec.Preload("a", "a", force=1.0), "itself")
    domain = bricks(2, (4, 2))
    refused(lambda: ec.solve(bar(2, locked=True), domain), "none before it")
    last = ec.solve(dataclasses.replace(bar(2, force=1.0), ties=ec.Tied(*NAMES)), domain)
    refused(lambda: ec.solve(bar(2, locked=True), domain, after=last), "was Tied")
    refused(lambda: last.shortening(NAMES[0]), "No preload")
    held = bar(2, force=1.0)
    side = ec.Displacement("upper left", (0.0, 0.0))
    beside = dataclasses.replace(held, supports=[*held.supports, side])
    refused(lambda: ec.solve(beside, domain), "upper left", "where the body is free")
    ec.solve(dataclasses.replace(beside, ties=ec.Preload(*NAMES[::-1], force=1.0)), domain)
    rough = dataclasses.replace(held, contacts=ec.Contact("upper left", friction=0.1))
    refused(lambda: ec.solve(rough, domain), "upper left")
    ec.solve(dataclasses.replace(rough, contacts=ec.Contact("upper left")), domain)
    refused(lambda: ec.work_of_loads(certified(held, domain)), "preload")


def test_a_cut_that_ends_inside_is_refused():
    domain = yoke()
    held = ec.Displacement("foot", (0.0, 0.0))
    tie = ec.Preload("shank above", "bore above", shortening=0.1)
    scene = ec.Scene(SMOOTH, held, ties=tie)
    refused(lambda: ec.solve(scene, domain), "ends inside the body", "whole section")


def test_a_pull_above_the_force_is_told():
    """A bolt has at least the force of what pulls at it, however far it is let apart."""
    scene = joint(2, pull=8.0, force=FORCE)
    refused(
        lambda: ec.solve(scene, bolted_plates(2, 2.0)),
        "No shift gives",
        "stays at 24",
        error=ec.NotConverged,
    )


@pytest.mark.ranks
def test_ranks_agree():
    scene = joint(2, pull=1.0, force=FORCE)
    error = certified(scene, bolted_plates(2, 1.0), degree=2)
    numbers = [error.relative, error.solution.shortening(SIDES[0])]
    assert len({tuple(np.round(found, 10)) for found in COMM.allgather(numbers)}) == 1
    alone = certified(scene, bolted_plates(2, 1.0, MPI.COMM_SELF), degree=2)
    assert error.relative == pytest.approx(alone.relative, rel=1e-7)
    assert numbers[1] == pytest.approx(alone.solution.shortening(SIDES[0]), rel=1e-7)
