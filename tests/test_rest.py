"""Bodies that nothing loads or moves: rest is exact, certified, and told once.

- u, r^ and e are zero to the last bit, in the plane and in space, with both methods and
  solvers, with and without gap, held by a support or by contact alone.
- A run has one mesh. A history starts from rest, and comes back to it when the body is
  released.
- A gap below zero, a load or a support that moves is no rest.
"""

from pathlib import Path

import numpy as np
import pytest
from scenes import mostly_serial

import erc_contact as ec

MESHES = Path(__file__).parent.parent / "meshes"
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


@pytest.mark.on_ranks("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_a_history_from_rest_and_back(degree, caplog):
    """Pressed, sheared, released, pressed again, held by contact alone."""

    def scene_at(t):
        pressure = np.interp(t, [1.0, 2.0, 3.0, 4.0, 5.0], [0.0, 0.05, 0.05, 0.0, 0.05])
        shear = np.interp(t, [2.0, 3.0, 4.0], [0.0, 0.012, 0.0])
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


def test_released_curved_body_makes_no_meshes():
    """Its facets do not carry the gap, and all of its error would be relative to nothing."""

    def scene_at(t):
        load = ec.Traction(
            "top", (0.0, -0.01 * float(np.interp(t, [0.0, 1.0, 2.0], [0.0, 1.0, 0.0])))
        )
        foot = ec.Contact("arc", friction=0.3, gap=lambda x: x[1], normal=(0.0, -1.0))
        return ec.Scene(ec.Elastic(1.0, 0.3), [], [load], [foot])

    history = ec.evolve(
        scene_at, ec.read_mesh(MESHES / "half_disc.geo"), [0.0, 1.0, 2.0], accuracy=0.9
    )
    assert history.reached
    assert history.column("meshes").tolist() == [1, 1, 1]
    assert history.column("eps")[1] > 0.01
    assert not history.column("eps")[[0, 2]].any()


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_what_is_no_rest(d):
    zero = (0.0,) * (d - 1)
    held, lifted = ec.Displacement("top", (0.0, *zero)), ec.Displacement("top", (*zero, 1e-9))
    foot = ec.Contact("bottom", friction=0.3)
    scenes = [
        unloaded(d, load=1e-12, supported=True),
        unloaded(d, -1e-3, supported=True),
        ec.Scene(ec.Elastic(1.0, 0.3), [lifted], [], [foot]),
        ec.Scene(
            ec.Elastic(1.0, 0.3), [held], [], [ec.Contact("bottom", gap=1e-3, bilateral=True)]
        ),
    ]
    for scene in scenes:
        solution = ec.solve(scene, body(d), ec.AugmentedLagrangian())
        assert not solution.at_rest
        assert solution.u.x.array.any()
