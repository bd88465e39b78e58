"""A body that nothing but friction holds along its contact.

Where all of the contact slips in a state of Newton's method, the tangent is singular.

- both methods solve scenes that are convex or nearly so, with both solvers, from rest
  and after a step; contact forces balance the loads;
- springs on the free motions hold a state where it is, and leave nothing behind;
- friction is lowered from more of it, and bodies that slide then are told as such;
- what slides away or tips has no solution, and is told so in few Newton steps: springs
  that pull for ever are given up, and so are attempts with a singular tangent.
"""

import itertools
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bricks import NAMES, bricks
from mpi4py import MPI
from petsc4py import PETSc
from scenes import certified

import erc_contact as ec
from erc_contact.model.promises import bind
from erc_contact.newton import ladder
from erc_contact.newton.condensed import Condensed
from erc_contact.newton.contact_solve import ContactSolve
from erc_contact.newton.direct import Direct
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.iterative import Iterative
from erc_contact.newton.ladder import NEWTON_STEPS, SOFTEST, Attempt
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.snes import (
    FARTHEST,
    IMBALANCE,
    PULL_FOR_EVER,
    SINGULAR_TANGENT,
    _StoppingTest,
)

METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]
PRESS = 0.02
"""Pressure on the block over its modulus [-]."""


@cache
def common_block() -> ec.Domain:
    """Make the block of these tests; collective."""
    return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 2))


def pushed(share: float, friction: object, height: float = 1.0) -> ec.Scene:
    """Press a block on its foundation, and push it by a share of the pressure."""
    return ec.Scene(
        ec.Elastic(1.0, 0.45),
        loads=[ec.Traction("top", (share * PRESS, -PRESS))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def on_body(friction: object) -> ec.Scene:
    """Press a block on a softer one that is nearly incompressible, and push it."""
    return ec.Scene(
        ec.Elastic({"upper": 1.0, "lower": 0.05}, {"upper": 0.3, "lower": 0.4999}),
        [ec.Displacement("lower outer", (0.0, 0.0))],
        [ec.Traction("upper outer", (0.002 * PRESS, -0.05 * PRESS))],
        [ec.Contact(NAMES[0], friction=friction, against=NAMES[1])],
    )


@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("method", METHODS, ids=["nitsche", "lagrangian"])
def test_given_friction_holds_a_block(method, solver):
    """All points slip at first; the problem is convex, so it has a solution."""
    friction = ec.Tresca(0.05 * PRESS)
    solution = ec.solve(pushed(0.02, friction), common_block(), method, solver=solver)
    assert "interior" in solution.reason
    force = solution.force("bottom").force
    assert force == pytest.approx([-0.02 * PRESS, PRESS], rel=1e-7)
    error = ec.constitutive_error(ec.equilibrate(solution))
    assert 0 < error.relative < 0.3


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.1, ec.Tresca(0.1 * 0.05 * PRESS)], ids=["mu", "given"])
@pytest.mark.parametrize("degree", [1, 2])
def test_friction_holds_a_block_on_a_soft_body(degree, friction):
    """The lower body swells under the block, which slips to both sides."""
    blocks = bricks(2, (5, 3), heights=(2.0, 1.0))
    solution = ec.solve(on_body(friction), blocks, degree=degree)
    force = solution.force(NAMES[0]).force
    width = 2.0
    loads = width * PRESS * np.array([0.002, -0.05])
    assert force == pytest.approx(-loads, rel=1e-7, abs=1e-9 * abs(loads).max())


@pytest.mark.serial
def test_a_history_goes_on_by_proximal_steps():
    """The push turns round: all of the contact slips back before some of it sticks."""
    friction = ec.Tresca(0.05 * PRESS)
    last = ec.solve(pushed(0.03, friction), common_block(), METHODS[1])
    for share in (-0.03, 0.04):
        last = ec.solve(pushed(share, friction), common_block(), METHODS[1], after=last)
        force = last.force("bottom").force
        assert force == pytest.approx([-share * PRESS, PRESS], rel=1e-7)


@pytest.mark.parametrize("method", METHODS, ids=["nitsche", "lagrangian"])
def test_springs_hold_a_state(method):
    """At the state that they keep they change no force, elsewhere only motions'."""
    domain = common_block()
    model = bind(pushed(0.02, ec.Tresca(0.05 * PRESS)), domain, 1, None)
    stiffness = Stiffness(model)
    guess = stiffness.solve_glued(stiffness.load_vector())
    problem = Condensed(model, ContactForms(model, method), stiffness, guess)
    at_contact = stiffness.gather(guess)[: stiffness.contact_size]

    def residuals() -> tuple[np.ndarray, ...]:
        state = problem.from_contact(at_contact)
        moved = state + problem.length * np.cos(np.arange(problem.size))
        free = problem.residual(moved), problem.tangent(moved)
        at_state = problem.residual(state)
        problem.hold(0.3, state)
        held_at_state = problem.residual(state)
        tangent = problem.tangent(moved)
        slope = problem.residual(moved + 1e-7 * state) - problem.residual(moved - 1e-7 * state)
        problem.hold(0.0, state)
        again = problem.residual(moved), problem.tangent(moved)
        return at_state, held_at_state, *free, *again, tangent @ state * 2e-7 - slope

    at_state, held, residual, tangent, residual_after, tangent_after, of_slope = problem.run(
        residuals
    )
    scale = abs(residual).max()
    assert held == pytest.approx(at_state, abs=1e-12 * scale)
    np.testing.assert_array_equal(residual, residual_after)
    np.testing.assert_array_equal(tangent, tangent_after)
    assert abs(of_slope).max() < 1e-12 * scale


@pytest.mark.serial
@pytest.mark.parametrize("height", [1.0, 4.0], ids=["slides", "tips"])
def test_what_nothing_holds_is_told_in_few_steps(height):
    """Pushed by more than friction carries, or over its edge: no attempt goes on.

    Statics refuse these scenes before; here their attempts are made all the same.
    """
    domain = ec.rectangle((0.0, 0.0), (1.0, height), cells=(4, 4))
    friction = 0.1 if height == 1.0 else 0.5
    with pytest.raises(ec.NotConverged) as failure:
        ContactSolve(Direct(bind(pushed(0.2, friction), domain)), None).solve(None)
    assert any("proximal" in rung for rung in failure.value.rungs)
    stays = [rung for rung in failure.value.rungs if f" {NEWTON_STEPS} steps" in rung]
    assert not stays


@pytest.mark.parametrize(
    ("height", "friction", "words"),
    [
        (1.0, 0.1, r"move the body at .* along \(1, 0.1\) with 0.00199 too much"),
        (4.0, 0.5, r"turn a body about \(1, 0\) with a moment of 0.006 too much"),
    ],
    ids=["slides", "tips"],
)
def test_statics_refuse_what_nothing_holds(height, friction, words):
    """No attempt is made; the loads are told that are too much."""
    domain = ec.rectangle((0.0, 0.0), (1.0, height), cells=(4, 4))
    with pytest.raises(ec.NotConverged, match=words) as failure:
        ec.solve(pushed(0.2, friction), domain)
    assert failure.value.rungs == ()


@pytest.mark.serial
def test_statics_refuse_a_body_in_space():
    """A column is pushed over its edge by 10% more than its weight holds."""
    column = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 2.0), cells=(1, 1, 2))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        loads=[ec.BodyForce((0.0, 0.0, -1e-3)), ec.Traction("top", (0.55e-3, 0.0, 0.0))],
        contacts=ec.Contact("bottom", friction=0.8),
    )
    words = r"about \(1, \S+, 0\) with a moment of 0.0001 too much"
    with pytest.raises(ec.NotConverged, match=words):
        ec.solve(scene, column)


@pytest.mark.serial
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("cells", [(1, 2), (4, 1)])
def test_no_body_slides_until_round_off_holds_it(cells, solver):
    """Pushed by a third more than friction carries."""
    domain = ec.rectangle((-1.0, 0.0), (1.0, 1.9), cells=cells)
    with pytest.raises(ec.NotConverged):
        ec.solve(pushed(0.04, 0.03), domain, solver=solver)


@pytest.mark.serial
def test_resultants_of_round_off_are_seen():
    """K u has none on free motions, until the body is 1e13 lengths away."""
    model = bind(pushed(0.02, 0.1), common_block(), 1, None)
    stiffness = Stiffness(model)
    guess = stiffness.solve_glued(stiffness.load_vector())
    problem = Condensed(model, ContactForms(model, METHODS[0]), stiffness, guess)
    at_contact = stiffness.gather(guess)[: stiffness.contact_size]
    state = problem.run(lambda: problem.from_contact(at_contact))
    motion = stiffness.kernel(problem.size)[:, 0]

    elastic = Multigrid(model)
    unknowns = elastic.matrix.createVecRight()
    unknowns.array[:] = elastic.start(guess)
    loads = elastic.right_side(elastic.load_vector(), supports=True)
    for far, is_wrong in ((0.0, False), (1e3, False), (1e14, True)):
        moved = state + far * problem.length * motion
        assert (problem.imbalance(moved) > IMBALANCE) == is_wrong
        x = unknowns.copy()
        x.array[:] += far * problem.length * model.free_motions[0].x.array
        others = loads.copy()
        others.scale(-1.0)
        assert (elastic.imbalance(x, others, 1e-300) > IMBALANCE) == is_wrong


@pytest.mark.serial
@pytest.mark.parametrize("solver", ["direct", pytest.param("iterative", marks=pytest.mark.broad)])
def test_springs_that_pull_for_ever_are_given_up(solver):
    """The block slides away; springs are softened once to the end."""
    kind = Direct if solver == "direct" else Iterative
    model = bind(pushed(0.2, 0.1), common_block())
    with pytest.raises(ec.NotConverged) as failure:
        ContactSolve(kind(model), None).solve(None)
    proximal = [rung for rung in failure.value.rungs if "proximal" in rung]
    assert proximal
    for rung in proximal:
        # The last problem that was solved had springs: it does not solve the scene.
        assert PULL_FOR_EVER in rung
        (steps,) = re.findall(r" (\d+) steps \(", rung)
        assert int(steps) < 100


@pytest.mark.serial
@pytest.mark.parametrize("solver", ["direct", pytest.param("iterative", marks=pytest.mark.broad)])
@pytest.mark.parametrize("modulus", [1e-6, 1.0, 1e6])
def test_a_singular_tangent_is_seen_by_its_step(solver, modulus):
    """All of a block slips, so nothing holds it: the first attempt ends in a few steps.

    Its state has lost no digits. The size of displacements does not matter.
    """
    scene = replace(pushed(0.2, 0.1), material=ec.Elastic(modulus, 0.45))
    kind = Direct if solver == "direct" else Iterative
    with pytest.raises(ec.NotConverged) as failure:
        ContactSolve(kind(bind(scene, common_block())), METHODS[1]).solve(None)
    first = failure.value.rungs[0]
    assert SINGULAR_TANGENT in first
    (residual,) = re.findall(r"residual (\S+),", first)
    assert float(residual) < 1e3


@pytest.mark.serial
@pytest.mark.parametrize("far", [0.5, 2.0])
def test_only_a_step_that_is_too_long_ends_an_attempt(far):
    x = PETSc.Vec().createWithArray(np.array([3.0, 4.0]), comm=MPI.COMM_SELF)
    y = PETSc.Vec().createWithArray(np.array([0.0, 5.0 * far * FARTHEST]), comm=MPI.COMM_SELF)
    test = _StoppingTest(None, None, hurried=False)
    assert test.look_ahead(x, y) == (far > 1.0)
    assert y.norm() == (0.0 if far > 1.0 else 5.0 * far * FARTHEST)
    assert test.reason == (SINGULAR_TANGENT if far > 1.0 else "")


def following(problems, pull):
    """Next problem of a sequence, None at its end."""
    try:
        return problems.send(pull)
    except StopIteration:
        return None


@pytest.mark.serial
@pytest.mark.parametrize("fall", [1.0, 0.8], ids=["for ever", "less and less"])
def test_proximal_problems_end_without_springs(fall):
    """The scene is tried from the softest springs, but only if they pull less."""
    problems = Attempt(METHODS[1], "glued", proximal=True).problems()
    weights = [next(problems).springs]
    while weights[-1] > 2 * SOFTEST:
        weights.append(following(problems, fall ** len(weights)).springs)
    assert weights[-1] == pytest.approx(SOFTEST)
    without = following(problems, fall ** len(weights))
    if fall == 1.0:
        assert without is None
    else:
        assert without.springs == 0.0
        assert following(problems, None).springs > SOFTEST


@pytest.mark.serial
@pytest.mark.parametrize("limit", [0.5, 0.99, 1.0, 1.001, 1.3, 4.0, 9.0])
@pytest.mark.parametrize("reach", [1.03, 1.5, 100.0])
def test_friction_is_lowered_to_its_limit(limit, reach):
    """A problem is solved above the limit, from a start whose friction is within reach."""
    problems = Attempt(METHODS[1], "glued", lowers=True).problems()
    share = next(problems).friction
    solved = np.inf
    count = 0
    while share is not None:
        count += 1
        is_solved = share >= limit and (solved == np.inf or solved <= reach * share)
        solved = share if is_solved else solved
        shares = following(problems, 0.0 if is_solved else None)
        share = None if shares is None else shares.friction
    if limit <= 1.0:
        assert solved == 1.0
    elif limit > ladder.MUCH_FRICTION:
        assert count == 1
    else:
        assert limit <= solved <= ladder.NEAR**2 * limit
    if reach > ladder.MUCH_FRICTION:
        assert count <= 10


@pytest.mark.ranks
@pytest.mark.parametrize("rung", ["interior", "proximal"])
def test_rungs_on_ranks(rung, monkeypatch):
    """The solution is the same as on one rank, with both solvers, also without interior points."""
    scene = pushed(0.02, ec.Tresca(0.05 * PRESS))
    alone = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 2), comm=MPI.COMM_SELF)
    wanted = ec.solve(scene, alone).profile("bottom")["slip"]
    if rung == "proximal":
        monkeypatch.setattr(ladder, "_interior", lambda *_: iter(()))
    for solver in ("direct", "iterative"):
        solution = ec.solve(scene, common_block(), solver=solver)
        assert rung in solution.reason
        found = solution.profile("bottom")["slip"]
        assert found == pytest.approx(wanted, abs=1e-7 * abs(wanted).max())


def test_multigrid_tells_round_off_of_a_stiff_body():
    """No attempt follows, as none finds digits that a body stiffer by 1e9 has lost."""
    upper = ec.rectangle((0.0, 1.0), (1.0, 2.0), cells=(3, 3))
    lower = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 2))
    bodies = ec.assembly({"u": upper, "l": lower}).joined("u bottom", "l top")
    scene = ec.Scene(
        ec.Elastic({"u": 1e9, "l": 1.0}, 0.44),
        loads=ec.Traction("u top", (0.0, -3e-3)),
        contacts=[
            ec.Contact("u bottom", against="l top", friction=0.4),
            ec.Contact("l bottom", friction=0.4),
        ],
    )
    lost = "round-off of the stiffest body"
    with pytest.raises(ec.NotConverged, match=rf"{lost}.*direct") as failure:
        ec.solve(scene, bodies, solver="iterative")
    assert not any(lost in attempt for attempt in failure.value.rungs[:-1])
    error = certified(scene, bodies, solver="direct")
    assert error.force("u bottom").force[1] == pytest.approx(3e-3, rel=1e-9)


@pytest.mark.parametrize(
    "kind", [Direct, pytest.param(Iterative, marks=pytest.mark.broad)], ids=["direct", "iterative"]
)
def test_springs_are_as_soft_as_the_body_that_they_hold(kind):
    """A soft body between stiff ones slides at both: it needs few proximal steps."""
    bricks = {}
    for number, cells in enumerate([(4, 2), (1, 3), (3, 3)]):
        low, high = (0.0, float(number)), (1.0, number + 1.0)
        bricks[f"b{number}"] = ec.rectangle(low, high, cells=cells)
    bodies = ec.assembly(bricks).joined("b1 bottom", "b0 top").joined("b2 bottom", "b1 top")
    scene = ec.Scene(
        ec.Elastic({"b0": 1e9, "b1": 1.0, "b2": 1e5}, 0.4),
        [
            ec.Displacement("b0 bottom", (0.0, 0.0)),
            ec.Displacement("b2 top", (-0.0005, -0.01)),
        ],
        contacts=[
            ec.Contact("b1 bottom", against="b0 top", friction=ec.Tresca(1e-3)),
            ec.Contact("b2 bottom", against="b1 top", friction=ec.Tresca(1e-3)),
        ],
    )
    solver = kind(bind(scene, bodies, 1, None))
    attempt = Attempt(METHODS[0], "glued", proximal=True)
    outcome, _, _ = solver.attempt(attempt, solver.glued_state())
    assert outcome.converged
    assert outcome.steps <= 50
    solver.destroy()


def lintel(
    friction: float, stones: int = 5, cells: tuple[int, int] = (3, 4)
) -> tuple[ec.Scene, ec.Domain]:
    """Hold stones between two abutments by the thrust of their weight."""
    width, height = 0.4, 0.5
    bodies = {}
    names = ["left", *(f"s{number}" for number in range(stones)), "right"]
    for number, name in enumerate(names):
        low = ((number - 1) * width, 0.0)
        bodies[name] = ec.rectangle(low, (low[0] + width, height), cells=cells)
    domain = ec.assembly(bodies)
    contacts = []
    for here, there in itertools.pairwise(names):
        domain = domain.joined(f"{here} right", f"{there} left")
        contacts.append(ec.Contact(f"{here} right", against=f"{there} left", friction=friction))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.2),
        [ec.Displacement("left left", (0.0, 0.0)), ec.Displacement("right right", (0.0, 0.0))],
        ec.BodyForce((0.0, -4e-6)),
        contacts,
    )
    return scene, domain


@pytest.mark.broad
@pytest.mark.serial
def test_a_lintel_slides_between_its_abutments():
    """Statics allow any thrust; elasticity gives one, and with it the least friction."""
    scene, domain = lintel(1.2)
    force = ec.solve(scene, domain, METHODS[1]).force("left right").force
    needed = abs(force[1] / force[0])
    scene, domain = lintel(0.9 * needed)
    with pytest.raises(ec.NotConverged, match="followed it to less friction") as failure:
        ec.solve(scene, domain, METHODS[1])
    told = re.search(
        r"with (\S+) times the friction \(a coefficient of (\S+)\)", str(failure.value)
    )
    assert told is not None
    assert 1.11 <= float(told[1]) <= 1.14
    assert needed <= float(told[2]) <= 1.025 * needed
    assert "slide in part" in str(failure.value)
    assert len(failure.value.rungs) <= 4


@pytest.mark.broad
def test_friction_is_lowered_from_interior_points():
    """With much friction Newton's method finds no solution from the glued contact."""
    scene, domain = lintel(0.6, stones=3, cells=(1, 2))
    with pytest.raises(ec.NotConverged, match="followed it to less friction") as failure:
        ec.solve(scene, domain)
    assert "interior start" in failure.value.rungs[-1]


def test_friction_is_lowered_to_that_of_the_scene():
    """Two hundredths above the least friction the descent finds the solution."""
    scene, domain = lintel(1.2)
    force = ec.solve(scene, domain, METHODS[1]).force("left right").force
    scene, domain = lintel(1.02 * abs(force[1] / force[0]))
    solver = Direct(bind(scene, domain, 1, None))
    attempt = Attempt(METHODS[1], "glued", lowers=True)
    outcome, _, solution = solver.attempt(attempt, solver.glued_state())
    assert outcome.friction == 1.0
    assert solution is not None
    assert outcome.steps <= 40
    solver.destroy()
