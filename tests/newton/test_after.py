"""One step of a loading history.

Friction counts the tangential displacement from where the last step ended.

- Proportional loading from rest ends in the static solution, in any number of steps.
- A sign: a body that is moved back gets friction in the other direction, and a load
  that is taken away leaves shear.
- The order of loads matters, and the order is the same on any number of ranks.
- A refined mesh represents the last step to round-off; another mesh says what it loses.
- e is above the true error of the step given its history, both on the same history.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from dolfinx import fem
from domains import refused
from mpi4py import MPI
from reference import nested, true_errors
from scenes import moved_box

import erc_contact as ec
from erc_contact.model.contact.trace import Trace
from erc_contact.model.promises import bind
from erc_contact.model.space import Space
from erc_contact.newton.after import last_step
from erc_contact.run.energy import energies

E, MU, PRESS = 1.0, 0.3, 0.05
AUGMENTED, NITSCHE = ec.AugmentedLagrangian(), ec.Nitsche()
KINDS = pytest.mark.parametrize(
    ("d", "degree", "solver"),
    [(2, 1, "direct"), (2, 2, "direct"), (2, 1, "iterative"), (3, 1, "iterative")],
)


def scene(push, press, d=2, friction=MU):
    """A box on a foundation, its top moved along it by ``push`` and towards it by ``press``."""
    return moved_box(d, push, press, friction)[0]


@cache
def box(d=2, alone=False):
    comm = MPI.COMM_SELF if alone else MPI.COMM_WORLD
    return (
        ec.rectangle((0.0, 0.0), (1.0, 0.7), cells=(6, 4), comm=comm)
        if d == 2
        else moved_box(3, 0.0, 0.0)[1]
    )


def run(path, domain=None, method=AUGMENTED, degree=1, solver="direct", friction=MU):
    """The solutions of steps whose ``(push, press)`` is given."""
    domain = domain or box()
    solutions = [None]
    for push, press in path:
        one = scene(push, press, domain.dim, friction)
        after = solutions[-1]
        solutions.append(ec.solve(one, domain, method, degree=degree, solver=solver, after=after))
    return solutions[1:]


def shear(solution):
    """Resultant of the shear on the contact in the direction of the push, over the resultant of the pressure."""
    force = solution.force("bottom").force
    return force[0] / force[-1]


@pytest.mark.broad
@pytest.mark.on_ranks("2-2-direct", "3-1-iterative")
@KINDS
def test_proportional_loading_ends_in_the_static_solution(d, degree, solver):
    """Stick and slip both.

    The problem without gap is homogeneous, so every step is a multiple of the static
    one.
    """
    tolerance = 1e-8 if solver == "iterative" else 1e-11
    domain, end = box(d), (0.03 if degree == 2 else 0.016, PRESS)
    friction = MU if d == 2 else 0.4
    static = run([end], domain, degree=degree, solver=solver, friction=friction)[0]
    status = static.profile("bottom")["status"]
    assert {1, 2} <= set(status.tolist())
    steps = 5 if d == 2 else 2
    last = run(
        [(t * end[0], t * end[1]) for t in np.linspace(0, 1, steps + 1)[1:]],
        domain,
        AUGMENTED,
        degree,
        solver,
        friction,
    )[-1]
    size = abs(static.u.x.array).max()
    assert abs(last.u.x.array - static.u.x.array).max() <= tolerance * size
    # Of a facet at the border the step sees the slip of a step alone.
    assert np.all(last.profile("bottom")["status"][status == 2] == 2)
    assert np.allclose(
        last.force("bottom").force, static.force("bottom").force, rtol=0, atol=tolerance * E * size
    )
    # e of the step counts slip from the last step; e of the static problem, of the same
    # fields, from rest
    at_once = replace(last, model=bind(last.scene, domain, degree))
    assert np.array_equal(at_once.profile("bottom")["status"], status)
    eps = [ec.constitutive_error(ec.equilibrate(one)).relative for one in (at_once, static)]
    assert eps[0] == pytest.approx(eps[1], rel=1e-8)


@pytest.mark.on_ranks("method0")
@pytest.mark.parametrize("method", [AUGMENTED, pytest.param(NITSCHE, marks=pytest.mark.broad)])
def test_sliding_forward_and_back(method):
    """All slides: the friction is mu times the pressure, against the motion since the last step."""
    there, further, back, held = run(
        [(0.3, PRESS), (0.4, PRESS), (0.2, PRESS), (0.2, PRESS)], method=method
    )
    assert shear(there) == pytest.approx(-MU, rel=1e-3)
    assert shear(further) == pytest.approx(-MU, rel=1e-3)
    assert shear(back) == pytest.approx(MU, rel=1e-3)
    assert shear(held) == pytest.approx(MU, rel=1e-3 if method.multiplier else 1e-2)
    assert shear(run([(0.2, PRESS)], method=method)[0]) == pytest.approx(-MU, rel=1e-3)  # from rest
    slips = [one.profile("bottom")["slip"] for one in (further, back)]
    assert slips[0].min() > 0.05
    assert slips[1].max() < -0.05
    assert max(abs(held.profile("bottom")["slip"])) < (1e-12 if method.multiplier else 1e-3)


def test_nothing_moves_while_the_loads_are_held():
    for degree in (1, 2):
        last, *held = run([(0.016, PRESS)] * 3, degree=degree)
        for one in held:
            assert abs(one.u.x.array - last.u.x.array).max() <= 1e-12 * PRESS
            assert one.newton_steps <= 2


@pytest.mark.parametrize("scale", [1e-14, pytest.param(1e9, marks=pytest.mark.broad)])
def test_shear_that_stays_without_any_load(scale):
    """The top goes away and comes back.

    The foundation, bilateral with Tresca friction, keeps the body sheared.
    """
    limit = 0.004 * scale
    domain, law = box(), ec.Tresca(limit)

    def step(push, after):
        support = ec.Displacement("top", (push, 0.0))
        contact = ec.Contact("bottom", friction=law, bilateral=True)
        return ec.solve(
            ec.Scene(ec.Elastic(scale, 0.3), [support], [], [contact]),
            domain,
            AUGMENTED,
            after=after,
        )

    away = step(0.05, None)
    home = step(0.0, away)
    assert away.force("bottom").force[0] == pytest.approx(-limit, rel=1e-10)  # all slides
    assert home.force("bottom").force[0] == pytest.approx(limit, rel=1e-10)  # and back
    near = step(0.045, away)
    assert 0 < abs(near.force("bottom").force[0]) < 0.5 * limit
    error = ec.constitutive_error(ec.equilibrate(home))
    assert 0 < error.relative < 0.3
    slip = home.profile("bottom")["slip"]
    works = -error.force("bottom").force[0] * np.mean(slip)
    assert works > 0  # dissipated: the slip of this step is against the traction


def ends(alone, steps=10):
    """Ends of ways to the same loads, one of them in equal steps.

    With little friction the pressed block slips outwards at its edges.
    """
    domain, push = box(2, alone), 0.004
    ways = {
        "press, shear": [(0.0, PRESS), (push, PRESS)],
        "shear, press": [(push, 0.0), (push, PRESS)],
        "both": [(push, PRESS)],
        "both in steps": [(t * push, t * PRESS) for t in np.linspace(1 / steps, 1, steps)],
    }
    return {name: shear(run(path, domain, friction=0.1)[-1]) for name, path in ways.items()}


@pytest.mark.broad
@pytest.mark.serial
def test_the_order_of_loads_matters():
    found = ends(alone=False)
    assert found["both in steps"] == pytest.approx(found["both"], rel=1e-9)
    assert abs(found["shear, press"]) < 0.5 * abs(found["both"])
    assert abs(found["press, shear"] - found["both"]) > 0.01 * abs(found["both"])


@pytest.mark.ranks
def test_the_order_of_loads_is_the_same_on_ranks():
    alone, together = ends(alone=True, steps=3), ends(alone=False, steps=3)
    for name, value in alone.items():
        assert together[name] == pytest.approx(value, rel=1e-9)


def trace_of(space, facets):
    """The trace of a flat contact on facets below a body."""
    side = space.side(facets, fem.Constant(space.mesh, 1.0))
    return Trace(side, side.only(slice(0)), np.tile(-np.eye(space.d)[-1], (len(facets), 1)))


@pytest.mark.parametrize(
    ("d", "degree"), [(2, 1), (2, 2), (3, 1), pytest.param(3, 2, marks=pytest.mark.broad)]
)
def test_a_refined_mesh_represents_the_last_step(d, degree):
    """At every node of the refined contact.

    A new mesh loses something, less on a finer one.
    """
    solution = run([(0.2, PRESS)], box(d), degree=degree)[0]
    last = last_step(solution)
    space = Space(solution.domain.refined(), degree)
    facets = space.domain.facets("bottom")
    before, lost = last.on(space, "bottom", trace_of(space, facets))
    nodes = np.unique(space.facet_nodes(space.domain.facets("bottom")))
    x = space.V.tabulate_dof_coordinates()[nodes, :d]
    every = np.concatenate(space.comm.allgather(x))
    given = np.concatenate(space.comm.allgather(before.x.array.reshape(-1, d)[nodes]))
    assert abs(given - solution.at(every).displacement).max() <= 1e-14 * abs(given).max()
    assert lost is None
    rates = []
    for n in (5, 10):
        other = ec.rectangle((0.0, 0.0), (1.0, 0.7), cells=(n, 3)) if d == 2 else None
        if other is None:
            return
        other = Space(other, degree)
        facets = other.domain.facets("bottom")
        rest = last.on(other, "bottom", trace_of(other, facets))[1]
        own = other.owned(facets)
        rates.append(np.sqrt(other.comm.allreduce(float(rest[own].sum()))))
    assert rates[1] < rates[0] < 1e-3 * 0.2


def test_steps_on_refined_and_new_meshes():
    """A step that holds the loads on a refined mesh moves the body by about the error; what is lost is told."""
    solution = run([(0.016, PRESS)])[0]
    error = ec.constitutive_error(ec.equilibrate(solution))
    refined = ec.solve(scene(0.016, PRESS), solution.domain.refined(), after=solution)
    fine = ec.constitutive_error(ec.equilibrate(refined))
    assert isinstance(refined.method, ec.AugmentedLagrangian)
    assert fine.oscillations.history == 0.0
    assert fine.relative < 0.75 * error.relative
    new = ec.solve(
        scene(0.016, PRESS),
        ec.rectangle((0.0, 0.0), (1.0, 0.7), cells=(5, 4)),
        AUGMENTED,
        after=solution,
    )
    other = ec.constitutive_error(ec.equilibrate(new))
    assert 0.0 < other.oscillations.history < 0.05 * other.absolute
    assert shear(new) == pytest.approx(shear(solution), rel=0.05)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(("method", "degree"), [(AUGMENTED, 1), (AUGMENTED, 2), (NITSCHE, 1)])
def test_e_is_above_the_true_error_of_the_step(method, degree):
    """The reference has the same history.

    The last step of the coarse mesh, which its mesh represents exactly.
    """
    path = [(0.0, PRESS), (0.02, PRESS), (0.012, PRESS)]
    _, sheared, _ = run(path, method=method, degree=degree)
    for friction in (MU, ec.Tresca(0.01)):
        one = scene(*path[-1], friction=friction)
        back = ec.solve(one, box(), method, degree=degree, after=sheared)
        error = ec.constitutive_error(ec.equilibrate(back))
        fine = ec.solve(
            one, nested(box(), 2 if degree == 1 else 1), AUGMENTED, degree=degree, after=sheared
        )
        true = true_errors(error.admissible, fine)
        assert true.both**2 + true.friction <= (1 + 1e-6) * error.absolute**2
        assert 0.98 <= error.absolute / true.both <= 1.3


def test_the_energy_of_a_step_has_bounds():
    """With Tresca friction the step minimises J with the friction since the last step."""
    law = ec.Tresca(0.004)
    (sheared,) = run([(0.05, PRESS)], friction=law)
    low, high, meshes = [], [], [box()]
    for _ in range(2):
        meshes.append(meshes[-1].refined())
    for domain in meshes:
        solution = ec.solve(scene(0.03, PRESS, friction=law), domain, AUGMENTED, after=sheared)
        error = ec.constitutive_error(ec.equilibrate(solution))
        bounds, energy = ec.potential_energy(error), energies(error, None)
        assert bounds.value == pytest.approx(energy.stored + energy.dissipated, rel=1e-3)
        assert bounds.guaranteed
        low.append(bounds.low)
        high.append(bounds.high)
    assert max(low) <= min(high) <= high[0]
    assert max(high) - min(high) < high[0] - low[0]


def test_what_cannot_be_a_last_step():
    last, domain, contact = run([(0.0, PRESS)])[0], box(), ec.Contact("bottom", friction=MU)
    one = scene(0.01, PRESS)

    def step(given=one, on=domain, after=last):
        return lambda: ec.solve(given, on, after=after)

    refused(step(after="yesterday"), "after is 'yesterday'", "Solution")
    refused(step(scene(0.0, PRESS, 3), box(3)), "2D", "3D")
    sides = ec.Scene(
        one.material, one.supports, [], [contact, ec.Contact("left", normal=(-1.0, 0.0))]
    )
    refused(step(sides), "'left'", "same contacts")
    refused(step(on=ec.rectangle((5.0, 0.0), (6.0, 0.7), cells=(6, 4))), "'bottom'", "another body")
    refused(step(on=ec.rectangle((0.0, 0.0), (0.5, 0.7), cells=(6, 4))), "'bottom'", "another body")
    if MPI.COMM_WORLD.size > 1:
        refused(step(on=box(2, True)), "ranks")


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_sliding_back_where_friction_varies(degree):
    """The pressure of a facet is levelled along the slip of the step.

    The way back is as accurate as one from rest.
    """
    back, rest = (
        ec.constitutive_error(
            ec.equilibrate(run(path, degree=degree, friction=lambda x: 0.2 + 0.2 * x[0])[-1])
        ).relative
        for path in ([(0.3, 1e-5), (0.1, 1e-5)], [(-0.2, 1e-5)])
    )
    assert back == pytest.approx(rest, rel=0.05)
