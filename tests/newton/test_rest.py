"""Bodies that nothing loads or strains: rest is exact, certified, and told once.

- u, r^ and e are zero to the last bit, in the plane and in 3D, with both methods and
  solvers, with and without gap, held by a support or by contact alone.
- A run has one mesh. A history starts from rest, and comes back to it when the body is
  released: up to round-off of the history, in all units, and where a checkpoint restores it.
- Bodies that foundations or supports carry along as rigid bodies are at rest, too.
- A gap below zero, a load or a support that strains is no rest, nor is a wedge that jams.
"""

from pathlib import Path

import numpy as np
import pytest
from laws import Quadratic, TwoModuli
from scenes import mostly_serial

import erc_contact as ec

MESHES = Path(__file__).parents[2] / "meshes"
GAPS = {"closed": 0.0, "open": 0.1, "varying": lambda x: 0.01 + 0.1 * x[0]}


def body(d):
    if d == 2:
        return ec.rectangle((0.0, 0.0), (1.0, 0.7), cells=(4, 3))
    return ec.box((0.0,) * 3, (1.0, 0.8, 0.7), cells=(2, 2, 2))


def unloaded(d, gap=0.0, *, supported=False, load=0.0):
    zero = (0.0,) * d
    supports = [ec.Displacement("top", zero)] if supported else []
    loads = [ec.Traction("right", (load, *zero[1:])), ec.BodyForce(zero)]
    return ec.Scene(
        ec.Elastic(1.0, 0.3), supports, loads, [ec.Contact("bottom", friction=0.3, gap=gap)]
    )


@pytest.mark.pairs
@pytest.mark.on_ranks("2-varying-method0-direct", "3-closed-method0-direct")
@pytest.mark.parametrize("solver", mostly_serial(["direct", "iterative"], ["direct"]))
@pytest.mark.parametrize(
    "method", mostly_serial([ec.Nitsche(), ec.AugmentedLagrangian()], [ec.Nitsche()])
)
@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("d", [2, 3])
def test_rest_is_exact_and_told_once(d, gap, method, solver, caplog):
    for supported in (False, True):
        scene = unloaded(d, GAPS[gap], supported=supported)
        history = ec.adapt(scene, body(d), accuracy=0.1, method=method, solver=solver)
        assert history.reached
        assert len(history.steps) == 1
        assert "at rest" in history.outcome
        assert "at rest" in history.solution.reason
        assert history.solution.at_rest
        assert not history.solution.u.x.array.any()
        error = history.error
        assert (error.absolute, error.relative, error.scale) == (0.0, 0.0, 0.0)
        assert not error.force("bottom").force.any()
        assert not error.profile("bottom")["pressure"].any()
    assert not caplog.records  # no warning


@pytest.mark.broad
@pytest.mark.parametrize("friction", [0.0, 0.3, ec.Tresca(0.01)], ids=["none", "Coulomb", "Tresca"])
def test_bodies_that_a_foundation_carries_are_at_rest(friction):
    """Two plates and the block between them turn together: all that is left is round-off."""
    turn = 1e-3
    motion = (lambda x: -turn * x[1], lambda x: turn * x[0])
    plates = [ec.Contact(part, friction=friction, motion=motion) for part in ("bottom", "top")]
    solution = ec.solve(ec.Scene(ec.Elastic(1.0, 0.3), [], [], plates), body(2))
    assert solution.at_rest
    x, u = solution.u.function_space.tabulate_dof_coordinates(), solution.u.x.array.reshape(-1, 2)
    slopes = np.linalg.lstsq(np.column_stack([np.ones(len(u)), x[:, :2]]), u)[0][1:]
    assert abs(slopes + slopes.T).max() < 1e-12 * turn
    error = ec.constitutive_error(ec.equilibrate(solution))
    assert error.relative == 0.0
    assert error.absolute < 1e-6 * turn  # the root of round-off


@pytest.mark.parametrize(
    "stiffness", [pytest.param(1e-8, marks=pytest.mark.broad), 1e-11], ids=["soft", "softer"]
)
def test_a_stiff_body_on_a_soft_foundation_is_no_rest(stiffness):
    """It moves as a rigid body to all digits, and presses the foundation all the same."""
    sunk = 1e-3
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.0, -sunk))],
        contacts=[ec.Contact("bottom", foundation=ec.Foundation(stiffness))],
    )
    solution = ec.solve(scene, body(2))
    assert not solution.at_rest
    force = ec.constitutive_error(ec.equilibrate(solution)).force("bottom").force
    assert force[1] == pytest.approx(stiffness * sunk, rel=1e-3)


@pytest.mark.ranks
def test_ranks_without_cells():
    """A body that is carried, a loose one, and two of them, on two cells each."""
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1))
    lifted = ec.Displacement("top", (0.0, 0.3))
    assert ec.solve(
        ec.Scene(ec.Elastic(1.0, 0.3), [lifted], [], [ec.Contact("bottom")]), block
    ).at_rest
    pressed = [ec.Traction("top", (0.0, -0.01))]
    loose = ec.Scene(ec.Elastic(1.0, 0.3), [], pressed, [ec.Contact("bottom", friction=0.3)])
    assert ec.solve(loose, block).force("bottom").force[1] == pytest.approx(0.01, rel=1e-9)
    lower = ec.rectangle((0.0, -1.0), (1.0, 0.0), cells=(1, 1))
    both = ec.assembly({"upper": block, "lower": lower}).joined("upper bottom", "lower top")
    pair = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("lower bottom", (0.0, 0.0))],
        [ec.Traction("upper top", (0.0, -0.01))],
        [ec.Contact("upper bottom", against="lower top", friction=0.3)],
    )
    force = ec.solve(pair, both).force("upper bottom").force
    assert force[1] == pytest.approx(0.01, rel=1e-9)


def test_a_support_that_carries_a_body_away_is_told(caplog):
    lifted = ec.Displacement("top", (0.0, 0.3))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), lifted, [], ec.Contact("bottom"))
    assert ec.solve(scene, body(2)).at_rest
    if body(2).comm.rank == 0:
        assert "Nothing touches the contact 'bottom'" in caplog.text


@pytest.mark.on_ranks("1")
@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_a_history_from_rest_and_back(degree, caplog):
    """Pressed, sheared, released, pressed again, held by contact alone."""

    def scene_at(t):
        pressure = np.interp(t, [1.0, 2.0, 3.0, 4.0, 5.0], [0.0, 0.005, 0.005, 0.0, 0.005])
        shear = np.interp(t, [2.0, 3.0, 4.0], [0.0, 0.0012, 0.0])
        load = ec.Traction("top", (float(shear), -float(pressure)))
        return ec.Scene(ec.Elastic(1.0, 0.3), [], [load], [ec.Contact("bottom", friction=0.3)])

    history = ec.evolve(scene_at, body(2), np.arange(6.0), accuracy=0.9, degree=degree)
    assert history.reached
    assert [error.solution.at_rest for error in history.errors] == [
        True,
        True,
        False,
        False,
        True,
        False,
    ]
    assert not history.column("eps")[[0, 1, 4]].any()
    assert not history.column("stored")[[0, 1]].any()
    assert history.column("stored")[4] <= 1e-12 * history.column("stored")[3]
    slip = history.errors[4].solution.u.x.array.reshape(-1, 2)
    assert np.ptp(slip, axis=0).max() == 0.0  # it stays where it slid
    assert slip[0, 1] == 0.0
    first, again = history.force("bottom")[[2, 5]]
    assert np.allclose(first, again, rtol=1e-8, atol=1e-10)
    assert not caplog.records


def test_data_that_vanish_at_the_time_zero_are_nothing():
    """UFL makes zero of ``t x`` at t = 0: loads, pressures and heat that begin there."""

    def at(t):
        return ec.Scene(
            ec.Elastic(1.0, 0.3),
            ec.Displacement("left", (0.0, 0.0)),
            [
                ec.Traction("top", lambda x: (t * x[0], 0.0)),
                ec.Traction("right", pressure=lambda x: t * x[1]),
                ec.BodyForce(lambda x: (0.0, t * x[0])),
            ],
            strains=ec.ThermalStrain(1.0, lambda x: t * x[0]),
        )

    body = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    evolution = ec.evolve(at, body, times=[0.0, 1e-3], accuracy=0.9)
    first, second = (error.solution for error in evolution.errors)
    assert not first.u.x.array.any()
    alone = ec.solve(at(1e-3), second.domain)
    assert np.allclose(alone.u.x.array, second.u.x.array, rtol=1e-10, atol=1e-16)


def test_released_curved_body_makes_no_meshes():
    """Its facets do not represent the gap, and all of its error would be relative to nothing."""

    def scene_at(t):
        load = ec.Traction(
            "top", (0.0, -0.01 * float(np.interp(t, [0.0, 1.0, 2.0], [0.0, 1.0, 0.0])))
        )
        foot = ec.Contact("arc", friction=0.3, gap=lambda x: x[1], normal=(0.0, -1.0))
        return ec.Scene(ec.Elastic(1.0, 0.3), [], [load], [foot])

    history = ec.evolve(
        scene_at,
        ec.read_mesh(MESHES / "half_disc.geo", scripts=True),
        [0.0, 1.0, 2.0],
        accuracy=0.9,
    )
    assert history.reached
    assert history.column("meshes").tolist() == [1, 1, 1]
    assert history.column("eps")[1] > 0.01
    assert not history.column("eps")[[0, 2]].any()


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_what_is_no_rest(d):
    zero = (0.0,) * (d - 1)
    held, pressed = ec.Displacement("top", (0.0, *zero)), ec.Displacement("top", (*zero, -1e-9))
    foot = ec.Contact("bottom", friction=0.3)
    scenes = [
        unloaded(d, load=1e-12, supported=True),
        unloaded(d, -1e-3, supported=True),
        ec.Scene(ec.Elastic(1.0, 0.3), [pressed], [], [foot]),
        ec.Scene(
            ec.Elastic(1.0, 0.3), [held], [], [ec.Contact("bottom", gap=1e-3, bilateral=True)]
        ),
    ]
    for scene in scenes:
        solution = ec.solve(scene, body(d), ec.AugmentedLagrangian())
        assert not solution.at_rest
        assert solution.u.x.array.any()


UNITS = {"one": (1.0, 1.0), "steel in mm": (2e11, 1e-3), "soft and large": (1e-6, 1e6)}


def back_to_rest(kind, modulus, length):
    """Return a scene at each time in 0, 1/2, 1: at rest, loaded, and free of stress again."""
    material = ec.Elastic(modulus, 0.3)
    roller = ec.Displacement("left", (0.0, None))

    def scene_at(t):
        part = float(np.sin(np.pi * t))  # 1e-16 at the end
        if kind == "pressed":
            load = ec.Traction("top", (0.0, -1e-3 * modulus * (1.0 - abs(1.0 - 2 * t))))
            return ec.Scene(material, roller, load, ec.Contact("bottom", friction=0.3))
        if kind == "moved":
            way = ec.Displacement("top", (1e-3 * length * part, -1e-3 * length * part))
            return ec.Scene(material, way, contacts=ec.Contact("bottom", friction=0.3))
        wall = ec.Contact("right", friction=0.2, gap=1e-3 * length)
        clamp = ec.Displacement("left", (0.0, 0.0))
        heat = ec.ThermalStrain(1e-5, 100.0 * part)
        return ec.Scene(material, clamp, contacts=wall, strains=heat)

    return scene_at


@pytest.mark.pairs
@pytest.mark.on_ranks("pressed-one-1-method0", "heated-steel in mm-2-method1")
@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("kind", ["pressed", "moved", "heated"])
def test_a_body_back_at_rest_has_no_stress(kind, units, degree, method):
    modulus, length = UNITS[units]
    body = ec.rectangle((0.0, 0.0), (2.0 * length, length), size=0.4 * length)
    scene_at = back_to_rest(kind, modulus, length)
    history = ec.evolve(scene_at, body, [0.0, 0.5, 1.0], 0.5, degree=degree, method=method)
    assert history.reached
    assert [error.solution.at_rest for error in history.errors] == [True, False, True]
    assert history.column("meshes")[-1] == 1
    error = history.error
    assert (error.relative, error.scale) == (0.0, 0.0)
    assert error.absolute < 1e-12 * history.errors[1].absolute
    assert "no stress" in repr(error)
    name = error.model.contacts[0].name
    assert not error.force(name).force.any()
    for quantity in ("von Mises", "displacement"):
        greatest = history.errors[1].maximum(quantity).value
        assert error.maximum(quantity).value <= 1e-9 * greatest


@pytest.mark.on_ranks("strategy0")
@pytest.mark.parametrize(
    "strategy", [ec.SizeMap(), pytest.param(ec.Mark(), marks=pytest.mark.broad)]
)
def test_a_body_back_at_rest_keeps_the_mesh_of_its_load(strategy):
    """The step to rest begins with a slip that the refined or new mesh has taken over."""
    scene_at = back_to_rest("pressed", 1.0, 1.0)
    body = ec.rectangle((0.0, 0.0), (2.0, 1.0), size=0.3)
    history = ec.evolve(scene_at, body, [0.0, 0.5, 1.0], accuracy=0.02, strategy=strategy)
    cells = history.column("cells")
    assert cells[1] > cells[0]
    assert cells[2] == cells[1]
    assert history.column("meshes").tolist()[::2] == [1, 1]
    assert history.error.solution.at_rest
    assert history.error.scale == 0.0


@pytest.mark.serial
def test_a_step_to_rest_is_read_from_a_checkpoint(tmp_path):
    scene_at = back_to_rest("pressed", 1.0, 1.0)
    for _ in range(2):
        body = ec.rectangle((0.0, 0.0), (2.0, 1.0), size=0.4)
        history = ec.evolve(scene_at, body, [0.0, 0.5, 1.0], accuracy=0.5, checkpoint=tmp_path)
        assert history.reached
        assert history.error.solution.at_rest
        assert history.error.scale == 0.0


@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.05, 0.3])
def test_a_wedge_jams_or_comes_back_to_rest(friction):
    """Its wall leans by 5 degrees: it jams with a friction above tan 5 = 0.087."""
    lean = np.radians(5.0)
    body = ec.rectangle((0.0, 0.0), (4.0, 4.0), size=1.0)

    def scene_at(t):
        load = ec.Traction("top", (0.0, -41.0 * (1.0 - abs(1.0 - t))))
        symmetric = ec.Displacement("left", (0.0, None))
        wall = ec.Contact("right", friction=friction, normal=(np.cos(lean), -np.sin(lean)))
        return ec.Scene(ec.Elastic(1e5, 0.3), symmetric, load, wall)

    history = ec.evolve(scene_at, body, [0.0, 1.0, 1.75, 2.0], accuracy=0.1)
    assert history.reached
    scale = history.column("scale")
    if friction == 0.05:
        assert history.error.solution.at_rest
        assert scale[-1] == 0.0
    else:
        assert scale[-1] > 0.1 * scale[1]


def test_the_balance_of_a_free_expansion_is_no_number():
    bar = ec.rectangle((0.0, 0.0), (3.0, 1.0), size=0.5)

    def scene_at(t):
        supports = [ec.Displacement("left", (0.0, None)), ec.Displacement("bottom", (None, 0.0))]
        heat = ec.ThermalStrain(12.5e-6, 50.0 * t)
        return ec.Scene(ec.Elastic(10.5e6, 0.3), supports, strains=heat)

    history = ec.evolve(scene_at, bar, [0.0, 1.0], accuracy=0.05)
    assert not history.column("eps").any()
    assert str(history).splitlines()[2].split()[-2] == "-"


@pytest.mark.broad
@pytest.mark.parametrize("law", [Quadratic(1e3, 0.3), TwoModuli(1e3, 800.0, 0.3)], ids=repr)
def test_a_potential_that_is_let_go_is_at_rest(law):
    """It is linearised about the last step, which leaves round-off of its stress as a load."""

    def scene_at(t):
        down = ec.Displacement("top", (None, -0.01 * t))
        gap = ec.Contact("bottom", gap=lambda x: x[0] ** 2 / 1000)
        return ec.Scene(law, [ec.Symmetry("left"), down], contacts=gap)

    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), size=0.25)
    pressed = ec.solve(scene_at(1.0), domain)
    free = ec.solve(scene_at(0.0), domain, after=pressed)
    assert np.all(free.u.x.array == 0.0)
    assert ec.constitutive_error(ec.equilibrate(free)).relative == 0.0
