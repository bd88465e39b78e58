"""A process that solves often stays as it is.

What a run made is freed when nobody has it any more.

After a run the number of live meshes and compiled forms is what it was, on every
interpreter; each of them holds MPI communicators, of which there are some thousand. On
several ranks PETSc's objects that nobody has any more are freed, too, whether or not a
solution was used: each mesh would keep a communicator and a factor or a hierarchy.
"""

import gc

import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

import erc_contact as ec


def live():
    """Meshes and forms that are alive."""
    gc.collect()
    return sum(
        isinstance(thing, dmesh.Mesh | fem.Form | fem.FunctionSpace) for thing in gc.get_objects()
    )


@pytest.fixture(scope="module", autouse=True)
def what_earlier_tests_left():
    """Keep it out of all collections: they are many here, and it takes 0.2 s in each."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.broad
@pytest.mark.serial
def test_runs_leave_nothing_behind():
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3, gap=lambda x: 0.01 * x[0] ** 2)],
    )
    counts = []
    for _ in range(3):
        ec.adapt(
            scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3)), accuracy=1e-6, max_steps=2
        )
        counts.append(live())
    assert counts[2] == counts[1], counts


MOST, FEW = 5000, 300
"""Communicators that are looked for, and that a test here has."""


def new_communicators():
    """Return all communicators that MPI can still make on this rank."""
    made = []
    try:
        while len(made) < MOST:
            made.append(MPI.COMM_SELF.Dup())
    except MPI.Exception:
        pass
    return made


def free(made):
    """Give communicators back."""
    for comm in made:
        comm.Free()


def communicators():
    """Count the communicators that MPI can still make on this rank."""
    made = new_communicators()
    free(made)
    return len(made)


@pytest.fixture(scope="module", autouse=True)
def few_communicators():
    """Leave few communicators to the tests here: counting thousands takes 0.5 s."""
    made = new_communicators()
    free(made[-FEW:])
    reserve = made[:-FEW]
    if len(made) == MOST:  # there is no limit that a test could meet
        free(reserve)
        reserve = []
    yield
    free(reserve)


@pytest.mark.on_ranks("False-iterative", "True-direct")
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("used", [False, True])
def test_solutions_that_are_dropped_are_freed_on_all_ranks(solver, used):
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    left = []
    for _ in range(5):
        solution = ec.solve(
            scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3)), solver=solver
        )
        if used:
            ec.equilibrate(solution)
        del solution
        gc.collect()
        left.append(communicators())
    assert np.ptp(left[1:]) <= 1, left  # the last mesh waits for the next solve


@pytest.mark.broad
@pytest.mark.on_ranks("method0")
@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()])
def test_steps_of_a_history_share_communicators(method):
    """All steps are kept; those on one mesh need no communicator of their own."""

    def scene_at(t):
        top = ec.Displacement("top", (0.02 * np.sin(t), -0.05))
        return ec.Scene(
            ec.Elastic(lambda x: 1.0 + x[0], 0.3), top, contacts=ec.Contact("bottom", friction=0.3)
        )

    def count(error, row):
        gc.collect()
        left.append(communicators())

    left = []
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3))
    ec.evolve(scene_at, domain, range(6), accuracy=1.0, method=method, callback=count)
    assert len(left) == 6
    assert np.ptp(left[1:]) <= 1, left
