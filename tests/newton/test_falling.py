"""Bodies that fall through a clearance are carried to their contacts first.

- a light body has the forces and the error that it has without clearance, in as many
  Newton steps, with both methods and solvers, on planes and on other bodies;
- the rigid motion that carries bodies rests on their contacts, and friction holds it;
- a history goes on from bodies that were carried.
"""

import numpy as np
import pytest
from domains import partly_broad
from mpi4py import MPI
from scenes import certified

import erc_contact as ec
from erc_contact.model.promises import bind
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.statics import motion_at_rest

STEEL = 2.1e5
WEIGHT = 7.7e-5
METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]


def plate(gap, friction=0.3, method=None, solver="auto", comm=None):
    """Drop a steel plate of 100 x 1 [mm] by a clearance under its weight [N]."""
    comm = MPI.COMM_WORLD if comm is None else comm
    body = ec.rectangle((0.0, 0.0), (100.0, 1.0), cells=(30, 1), comm=comm)
    scene = ec.Scene(
        ec.Elastic(STEEL, 0.3),
        loads=ec.BodyForce((0.0, -WEIGHT)),
        contacts=ec.Contact("bottom", friction=friction, gap=gap),
    )
    return ec.solve(scene, body, method, solver=solver)


@pytest.mark.parametrize("solver", ["direct", pytest.param("iterative", marks=pytest.mark.broad)])
@pytest.mark.parametrize("method", METHODS, ids=["nitsche", "lagrangian"])
def test_a_clearance_changes_nothing(method, solver):
    """The plate falls by 5e6 times what it is compressed."""
    at_rest = plate(0.0, method=method, solver=solver)
    fallen = plate(0.125, method=method, solver=solver)
    assert fallen.newton_steps <= at_rest.newton_steps
    force = fallen.force("bottom").force
    assert force == pytest.approx([0.0, 100.0 * WEIGHT], rel=1e-7, abs=1e-7 * WEIGHT)
    wanted = ec.constitutive_error(ec.equilibrate(at_rest)).relative
    error = ec.constitutive_error(ec.equilibrate(fallen))
    assert error.relative == pytest.approx(wanted, rel=1e-3)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.0, 0.3], ids=["none", "mu"])
def test_a_plate_falls_onto_a_bowl(friction):
    """It rests on a few nodes: the forces that cancel in it are 1e6 times its weight."""
    body = ec.rectangle((0.0, 0.0), (100.0, 1.0), cells=(50, 1))
    scene = ec.Scene(
        ec.Elastic(STEEL, 0.3),
        [] if friction else ec.Displacement("left", (0.0, None)),
        ec.BodyForce((0.0, -WEIGHT)),
        ec.Contact("bottom", friction=friction, gap=lambda x: 0.01 + 1e-5 * (x[0] - 40) ** 2),
    )
    solution = ec.solve(scene, body, degree=2)
    force = ec.constitutive_error(ec.equilibrate(solution)).force("bottom").force
    assert force[1] == pytest.approx(100.0 * WEIGHT, rel=1e-7)
    assert solution.force("bottom").force[1] == pytest.approx(100.0 * WEIGHT, rel=1e-5)


def bricks_apart(gaps, comm=None, moduli=(1.0, 1.0)):
    """Stack two bricks with clearances under their weight."""
    comm = MPI.COMM_WORLD if comm is None else comm
    lower = ec.rectangle((0.0, 0.0), (4.0, 1.0), cells=(8, 2), comm=comm)
    upper = ec.rectangle((1.0, 1.0), (3.0, 2.0), cells=(4, 2), comm=comm)
    bodies = ec.assembly({"lower": lower, "upper": upper}).joined("upper bottom", "lower top")
    scene = ec.Scene(
        ec.Elastic({"lower": moduli[0], "upper": moduli[1]}, 0.3),
        loads=ec.BodyForce((0.0, -1e-8)),
        contacts=[
            ec.Contact("lower bottom", friction=0.3, gap=gaps[0]),
            ec.Contact("upper bottom", friction=0.3, against="lower top", gap=gaps[1]),
        ],
    )
    return scene, bodies


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("moduli", [(1.0, 1.0), (1.0, 1e6)], ids=["alike", "stiff on soft"])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_stack_falls(degree, moduli):
    """Each brick falls by its own clearance and those below."""
    scene, bodies = bricks_apart((0.01, 0.02), moduli=moduli)
    at_rest, _ = bricks_apart((0.0, 0.0), moduli=moduli)
    fallen = ec.solve(scene, bodies, degree=degree)
    error = ec.constitutive_error(ec.equilibrate(fallen))
    wanted = certified(at_rest, bodies, degree=degree)
    assert error.relative == pytest.approx(wanted.relative, rel=1e-4)
    assert error.force("upper bottom").force == pytest.approx([0, 2e-8], rel=1e-9, abs=1e-16)
    u = fallen.at([(2.0, 0.5), (2.0, 1.5)]).displacement[:, 1]
    assert u == pytest.approx([-0.01, -0.03], abs=1e-6)


@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.0, 0.8, ec.Tresca(1.0)], ids=["none", "mu", "given"])
def test_the_motion_rests_on_a_tilted_plane(friction):
    """Friction keeps a cube from sliding down while it turns onto the plane."""
    cube = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 2))
    supports = [] if friction else [ec.Displacement("back", (None, 0.0, None))]
    supports += [] if friction else [ec.Displacement("left", (0.0, None, None))]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        supports,
        ec.BodyForce((1e-3 if friction else 0.0, 0.0, -1e-2)),
        ec.Contact("bottom", friction=friction, gap=lambda x: 0.01 + 0.005 * x[0] * bool(friction)),
    )
    model = bind(scene, cube)
    motion = motion_at_rest(model, Stiffness(model).load_vector())
    (contact,) = model.contacts
    jump = contact.trace.of(motion.x.array)
    places = contact.trace.here.places
    tilt = 0.005 if friction else 0.0
    assert -jump[..., 2] == pytest.approx(0.01 + tilt * places[..., 0], abs=1e-14)
    assert jump[..., :2] == pytest.approx(0.0, abs=1e-14)


@pytest.mark.serial
def test_no_forces_of_contacts_have_no_motion():
    """Pushed by more than friction holds, a block has no place of rest."""
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2))
    for push, rests in ((0.29, True), (0.31, False)):
        scene = ec.Scene(
            ec.Elastic(1.0, 0.3),
            loads=ec.BodyForce((push, -1.0)),
            contacts=ec.Contact("bottom", friction=0.3, gap=0.1),
        )
        model = bind(scene, block)
        motion = motion_at_rest(model, Stiffness(model).load_vector())
        assert (motion is not None) == rests


@pytest.mark.serial
@pytest.mark.parametrize(
    "method", partly_broad(METHODS, METHODS[:1]), ids=["nitsche", "lagrangian"]
)
def test_a_history_goes_on_from_a_fallen_body(method):
    """Friction counts the slip since the body was carried, not the way of the fall."""
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))

    def scene(gap, push):
        return ec.Scene(
            ec.Elastic(1e3, 0.3),
            loads=[ec.BodyForce((0.0, -1e-4)), ec.Traction("left", (push, 0.0))],
            contacts=ec.Contact("bottom", friction=0.5, gap=gap),
        )

    profiles = []
    for gap in (0.0, 0.25):
        last = ec.solve(scene(gap, 0.0), block, method)
        for push in (4e-5, -4e-5):
            last = ec.solve(scene(gap, push), block, method, after=last)
        profiles.append(last.profile("bottom"))
    without, fallen = profiles
    for name in ("slip", "pressure", "shear"):
        size = abs(without[name]).max()
        assert fallen[name] == pytest.approx(without[name], abs=1e-6 * size), name


@pytest.mark.ranks
@pytest.mark.parametrize("solver", ["direct", "iterative"])
def test_bodies_fall_on_ranks(solver):
    """The stack has the solution of one rank."""
    scene, alone = bricks_apart((0.01, 0.02), comm=MPI.COMM_SELF)
    _, bodies = bricks_apart((0.01, 0.02))
    wanted = ec.solve(scene, alone, solver=solver)
    solution = ec.solve(scene, bodies, solver=solver)
    found = np.array(solution.force("upper bottom").force)
    assert found == pytest.approx(wanted.force("upper bottom").force, rel=1e-7, abs=1e-15)
    pressure = solution.profile("upper bottom")["pressure"]
    assert np.sort(pressure) == pytest.approx(
        np.sort(wanted.profile("upper bottom")["pressure"]), rel=1e-5, abs=1e-12
    )


@pytest.mark.parametrize("ratio", [1e10, pytest.param(1e12, marks=pytest.mark.broad)])
def test_a_stiff_body_sinks_into_a_soft_one(ratio):
    """The round-off of its stiffness on its free motion is no force."""
    upper = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    lower = ec.rectangle((0.0, -1.0), (1.0, 0.0), cells=(4, 4))
    bodies = ec.assembly({"u": upper, "l": lower}).joined("u bottom", "l top")
    scene = ec.Scene(
        ec.Elastic({"u": ratio, "l": 1.0}, 0.3),
        [ec.Displacement("l bottom", (0.0, 0.0)), ec.Displacement("u left", (0.0, None))],
        ec.Traction("u top", (0.0, -1e-3)),
        ec.Contact("u bottom", against="l top"),
    )
    solution = ec.solve(scene, bodies)
    error = ec.constitutive_error(ec.equilibrate(solution))
    assert error.force("u bottom").force[1] == pytest.approx(1e-3, rel=1e-9)
    assert error.relative == pytest.approx(0.0696, abs=2e-4)
