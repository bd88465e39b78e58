"""Contact that is a quadratic programme is solved in few steps on any mesh.

- slender leaves, with both methods and solvers, degrees 1 and 2, on any number of ranks;
- Tresca friction in the plane and in 3D;
- light bodies on few nodes, with Coulomb friction, too.
"""

import numpy as np
import pytest
from mpi4py import MPI

import erc_contact as ec
from erc_contact.model.promises import bind
from erc_contact.newton import ladder, snes
from erc_contact.newton.contact_solve import ContactSolve
from erc_contact.newton.direct import Direct

METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]
STEEL = 2.1e5
WEIGHT = 7.7e-5


def leaves(friction=0.0, along=30, comm=MPI.COMM_WORLD):
    """Clamp four leaves 1 : 30 at one end, and push the tip of the lowest one up."""
    length = 30.0
    bodies = {}
    for number in range(4):
        cells = along - 5 * number
        low = (0.0, float(number))
        high = (length * cells / along, number + 1.0)
        bodies[f"leaf{number}"] = ec.rectangle(low, high, cells=(cells, 1), comm=comm)
    stack = ec.assembly(bodies)
    for number in range(1, 4):
        stack = stack.joined(f"leaf{number} bottom", f"leaf{number - 1} top")
    supports = [ec.Displacement(f"leaf{number} left", (0.0, 0.0)) for number in range(4)]
    supports.append(ec.Displacement("leaf0 right", (None, 1.0)))
    contacts = []
    for number in range(1, 4):
        sides = f"leaf{number} bottom", f"leaf{number - 1} top"
        gap = lambda x: 1e-3 * (x[0] / length - 0.5) ** 2  # noqa: E731
        contacts.append(ec.Contact(sides[0], against=sides[1], friction=friction, gap=gap))
    return ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=contacts), stack


@pytest.mark.broad
@pytest.mark.on_ranks("lagrangian-iterative")
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("method", METHODS, ids=["nitsche", "lagrangian"])
def test_slender_leaves_take_few_steps(method, solver):
    scene, stack = leaves()
    solution = ec.solve(scene, stack, method, degree=2, solver=solver)
    assert solution.newton_steps <= 25
    assert "interior start" in solution.reason
    force = solution.force("leaf1 bottom").force
    wanted = ec.solve(*leaves(), method, degree=2, solver="direct").force("leaf1 bottom").force
    assert force == pytest.approx(wanted, rel=1e-6, abs=1e-6 * np.linalg.norm(wanted))


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS, ids=["nitsche", "lagrangian"])
def test_newton_alone_finds_the_same(method, monkeypatch):
    """It takes more steps, or another method."""
    scene, stack = leaves()
    solution = ec.solve(scene, stack, method, degree=2)
    monkeypatch.setattr(snes, "CRAWLING", ())
    monkeypatch.setattr(ladder, "_interior", lambda *_: iter(()))
    alone = ec.solve(scene, stack, method, degree=2)
    assert alone.newton_steps > solution.newton_steps
    difference = abs(alone.u.x.array - solution.u.x.array).max()
    assert difference <= 1e-8 * abs(alone.u.x.array).max()


@pytest.mark.broad
@pytest.mark.serial
def test_steps_of_a_users_method_are_not_ended_early():
    """No interior points find its states, so that its steps are all that it has."""

    class Own(ec.Nitsche):
        pass

    scene, stack = leaves(along=20)
    solve = ContactSolve(Direct(bind(scene, stack, 2, None)), Own())
    solve.solve(None)
    assert len(solve.rungs) == 1
    by_ours = ContactSolve(Direct(bind(scene, stack, 2, None)), METHODS[0])
    by_ours.solve(None)
    assert "states keep changing" in by_ours.rungs[0]


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.on_ranks("given-1-iterative", "soft-2-direct")
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(
    ("friction", "bed"),
    [(0.0, None), (ec.Tresca(1e-5), None), (ec.Tresca(1e-5), ec.Foundation(1.0, 0.01))],
    ids=["none", "given", "soft"],
)
def test_states_in_space_are_found(friction, bed, degree, solver, monkeypatch):
    """A plate sags on a bowl; Newton's method ends in few steps from interior points."""
    body = ec.box((0.0, 0.0, 0.0), (8.0, 2.0, 0.5), cells=(8, 2, 1))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        ec.Displacement("left", (0.0, 0.0, 0.0)),
        ec.BodyForce((0.0, 0.0, -1e-4)),
        ec.Contact(
            "bottom",
            friction=friction,
            foundation=bed,
            gap=lambda x: 2e-4 * (x[0] - 5) ** 2 + 3e-3 * (x[1] - 1) ** 2,
        ),
    )
    wanted = ec.solve(scene, body, degree=degree).force("bottom").force
    monkeypatch.setattr(snes, "CRAWLING", ((1, -1.0, -1.0, -1),))
    monkeypatch.setattr(snes, "EARLIEST", 2)
    solution = ec.solve(scene, body, degree=degree, solver=solver)
    assert "interior start" in solution.reason
    assert solution.newton_steps <= 35
    force = solution.force("bottom").force
    assert force == pytest.approx(wanted, rel=1e-6, abs=1e-6 * np.linalg.norm(wanted))


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.0, ec.Tresca(1e-4), 0.3], ids=["none", "given", "mu"])
def test_a_light_plate_rests_on_a_hump(friction):
    """It rests on a few nodes."""
    body = ec.rectangle((0.0, 0.0), (100.0, 1.0), cells=(50, 1))
    scene = ec.Scene(
        ec.Elastic(STEEL, 0.3),
        [] if friction else ec.Displacement("left", (0.0, None)),
        ec.BodyForce((0.0, -WEIGHT)),
        ec.Contact("bottom", friction=friction, gap=lambda x: 0.01 + 1e-5 * (x[0] - 40) ** 2),
    )
    solution = ec.solve(scene, body, ec.AugmentedLagrangian(), degree=2)
    assert "interior start" in solution.reason
    assert solution.force("bottom").force[1] == pytest.approx(100.0 * WEIGHT, rel=1e-6)
