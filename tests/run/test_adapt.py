"""The adaptive loop: rates, marking, limits that end it with the best result.

- eps against cells has slope -1/2 (adaptive), and the slope that the clamped corner
  dictates (uniform: h^0.7112);
- Doerfler marking carries the fraction with the fewest elements;
- limits of cells and of steps, and a solve that fails late, end the loop with the best
  result and clear words;
- so does whatever else comes late: a scene that does not fit the next mesh, Ctrl-C
  (real signals to real processes), memory that ends, a callback that has enough; on the
  first mesh it is raised.
"""

import csv
import dataclasses
import os
import signal
from time import monotonic

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from processes import output, started, told
from scenes import block, certified, common_block, prototype_block

import erc_contact as ec
from erc_contact.base.runtime.interrupts import Interrupts
from erc_contact.error.strategy import TIE, largest
from erc_contact.error.strategy import refined as refined_if_allowed
from erc_contact.run.levels import Folder
from namedmesh.base.percent import percent

CORNER = 0.7112
"""Singular exponent of a clamped-free corner of 90 degrees, nu = 0.3."""


@pytest.mark.serial
def test_adaptive_rate():
    history = ec.adapt(prototype_block(), block(4), accuracy=0.01)
    assert history.reached
    assert history.best.relative <= 0.01
    print(f"slope {history.slope('cells', last=4):.3f}")
    assert history.slope("cells", last=4) == pytest.approx(-0.5, abs=0.05)


WITHOUT_NUMBER = {
    "no support": (ec.Resultant("left", (0.0, 1.0)), "part with a support or in contact"),
    "no contact": (ec.Slip("left"), "No contact is called 'left'"),
    "no bolt": (ec.BoltForce("top"), "a side of a preload"),
    "no face": (ec.Rotation("top"), "no rigid face"),
    "held": (ec.MeanDisplacement("top", (0.0, 1.0)), "a support or a contact"),
    "no load": (ec.Functional(ec.Traction("left", (0.0, 0.0))), "zero everywhere"),
    "no crack": (ec.StressIntensity((0.0, 0.0), (1.0, 0.0), radius=0.1), "comes as near as 0"),
    "a vector of space": (ec.Resultant("top", (0.0, 1.0, 0.0)), "give 2 finite numbers"),
}


@pytest.mark.parametrize("case", WITHOUT_NUMBER)
def test_a_goal_is_checked_before_a_solve(case):
    """The scene has no equilibrium: a solve would say that, and not what the goal lacks."""
    goal, words = WITHOUT_NUMBER[case]
    pulled = ec.Displacement("top", (0.0, None))
    load = ec.Traction("right", (0.0, 1.0))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), pulled, load, ec.Contact("bottom"))
    with pytest.raises(ec.InputError, match=words):
        ec.adapt(scene, block(2), accuracy=0.1, goal=goal)
    with pytest.raises((ec.NotConverged, ec.NotHeldError)):
        ec.adapt(scene, block(2), accuracy=0.1, goal=ec.Resultant("bottom", (0.0, 1.0)))


@pytest.mark.broad
@pytest.mark.serial
def test_uniform_rate_is_that_of_the_corner():
    history = ec.adapt(
        prototype_block(), block(8), accuracy=1e-6, strategy=ec.Uniform(), max_steps=4
    )
    slope = history.slope("cells", last=3)
    print(f"\nuniform slope {slope:.3f}, corner {-CORNER / 2:.3f}")
    assert slope == pytest.approx(-CORNER / 2, abs=0.02)


@pytest.mark.parametrize("fraction", [0.1, 0.5, 1.0])
def test_marking_carries_the_fraction_with_the_fewest(fraction):
    error = certified(prototype_block(), block(4))
    comm = error.domain.mesh.comm
    marked = ec.mark(error, fraction)
    carried = comm.allreduce(float(np.sum(error.indicators[marked] ** 2)), MPI.SUM)
    assert carried >= fraction * error.relative**2 * (1 - 1e-5)
    rest = np.delete(error.indicators, marked)
    least = comm.allreduce(float(error.indicators[marked].min(initial=np.inf)), MPI.MIN)
    assert comm.allreduce(float(rest.max(initial=0.0)), MPI.MAX) <= least * (1 + 1e-5)
    if fraction < 1:
        without = carried - least**2
        number = comm.allreduce(
            int(np.sum(abs(error.indicators[marked] - least) < 1e-5 * least)), MPI.SUM
        )
        assert without < fraction * error.relative**2 or number > 1  # ties are marked together


@pytest.mark.parametrize(
    "family", ["random", "steps", "equal", "nearly equal", "zero", "tiny", "on the last rank"]
)
def test_marking_is_that_of_all_errors_in_one_place(family):
    """As if all errors were sorted on one rank, and the largest ones taken until they carry the fraction."""
    comm, random = MPI.COMM_WORLD, np.random.default_rng(len(family))
    for fraction in (1e-3, 0.25, 0.5, 0.75, 1.0):
        every = {
            "steps": np.round(4 * random.random(40)) / 4,
            "equal": np.full(24, 0.1),
            "nearly equal": np.repeat(random.random(9), 5) * (1 + 1e-9 * random.random(45)),
            "zero": np.zeros(7),
            "tiny": 10.0 ** random.uniform(-120, -100, 50),
        }.get(family, random.random(53))
        rank = (
            np.full(len(every), comm.size - 1)
            if family == "on the last rank"
            else np.arange(len(every)) % comm.size
        )
        mine = largest(comm, every[rank == comm.rank], fraction)
        sizes = np.sort(every)[::-1]
        last = np.searchsorted(np.cumsum(sizes**2), fraction * np.sum(sizes**2) * (1 - TIE))
        wanted = every >= sizes[min(int(last), len(sizes) - 1)] * (1 - TIE)
        assert np.array_equal(mine, np.flatnonzero(wanted[rank == comm.rank]))


@pytest.mark.serial
def test_limits_end_with_the_best_result():
    few = ec.adapt(common_block(), block(4), accuracy=1e-3, max_steps=2)
    assert not few.reached
    assert len(few.steps) == 2
    assert "max_steps = 2" in few.outcome
    assert few.best.relative == min(few.column("eps"))
    small = ec.adapt(common_block(), block(4), accuracy=1e-3, max_cells=400)
    assert "max_cells = 400" in small.outcome
    assert max(small.column("cells")) <= 400


@pytest.mark.parametrize("dim", [2, 3])
def test_a_mesh_with_too_many_cells_is_not_made(dim, monkeypatch):
    """Bisection makes 2^d cells or more of a marked one.

    Exactly as many where all are marked.
    """
    domain = block(4) if dim == 2 else ec.box((0.0,) * 3, (1.0, 1.0, 0.7), cells=(3, 3, 2))
    made, refined = [], ec.Domain.refined
    monkeypatch.setattr(ec.Domain, "refined", lambda *a: made.append(refined(*a)) or made[-1])
    whole = 2**domain.dim * domain.cells
    mine = np.arange(domain.owned_cells, dtype=np.int32)
    for marked in (mine, mine[::3], mine[::17]):
        every = domain.mesh.comm.allreduce(len(marked))
        least = domain.cells + (2**domain.dim - 1) * every
        assert refined_if_allowed(domain, marked, 10 * whole).cells >= least
        assert every < domain.cells or made[-1].cells == whole == least
        with pytest.raises(
            ec.InputError, match=f"at least {least} cells, more than max_cells = {least - 1}"
        ):
            refined_if_allowed(domain, marked, least - 1)
    assert len(made) == 3


def test_failure_on_a_later_mesh_keeps_what_there_is(monkeypatch):
    """A real failure: from the second mesh on, Newton may take no step."""
    from petsc4py import PETSc

    class Impatient:
        def next(self, error, accuracy, max_cells):
            PETSc.Options()["erc_contact_snes_max_it"] = 0
            return error.domain.refined()

    try:
        history = ec.adapt(common_block(), block(4), accuracy=1e-3, strategy=Impatient())
    finally:
        PETSc.Options().delValue("erc_contact_snes_max_it")
    assert len(history.steps) == 1
    assert "did not converge" in history.outcome
    assert history.best.relative == history.steps[0].eps


def ends_late(error, *words, on):
    """A run on two meshes whose second one fails: the history has the first.

    On the first mesh the error is raised.
    """
    scene, first, second = on

    class Next:
        def next(self, error, accuracy, max_cells):
            return second(error.domain)

    history = ec.adapt(scene, first, accuracy=1e-3, strategy=Next())
    assert len(history.steps) == 1
    assert not history.reached
    assert history.best.relative == history.steps[0].eps
    assert percent(history.best.total) in history.outcome
    missing = [word for word in words if word not in history.outcome]
    assert not missing, f"{missing} not in {history.outcome}"
    with pytest.raises(error):
        ec.adapt(scene, second(first), accuracy=1e-3, strategy=Next())


@pytest.mark.broad
def test_scene_that_does_not_fit_a_later_mesh():
    """Friction with a dip that only the second mesh sees."""

    def dip(x):
        return 0.3 - 0.4 * ufl.exp(-(((x[0] - 2 / 7) / 1e-3) ** 2))

    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=dip)],
    )
    first, second = (
        ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=cells) for cells in ((4, 14), (7, 24))
    )
    on = scene, first, lambda domain: second
    ends_late(ec.InputError, "'bottom'", "friction is -0.1", on=on)


def test_body_that_nothing_holds_on_a_later_mesh():
    """The contact has moved to the side: nothing holds the body vertically any more."""

    def turned(domain):
        names = (
            dict(zip(domain.names, [4, 2, 1, 3], strict=True))
            if domain.names["bottom"] == 3
            else domain.names
        )
        return ec.Domain(domain.mesh, domain.facet_tags, names)

    roller = ec.Displacement("right", (0.0, None))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), [roller], [ec.Traction("top", pressure=lambda x: 0.01 * x[0])]
    )
    scene = dataclasses.replace(scene, contacts=[ec.Contact("bottom")])
    on = scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3)), turned
    ends_late(ec.NotHeldError, "Nothing holds the body", "translation in y", on=on)


@pytest.mark.parametrize("rank", [0, MPI.COMM_WORLD.size - 1])
def test_memory_that_ends_on_one_rank(rank):
    """What a strategy of the user's raises on one rank comes to all.

    A MemoryError ends the run with what it has.
    """

    class Greedy:
        def next(self, error, accuracy, max_cells):
            if MPI.COMM_WORLD.rank == rank:
                np.ones((1 << 40, 1 << 12))
            return error.domain.refined()

    history = ec.adapt(common_block(), block(4), accuracy=1e-3, strategy=Greedy())
    assert len(history.steps) == 1
    assert "memory" in history.outcome


MEMORY = """
import resource
import erc_contact as ec
from namedmesh.base.percent import percent
from mpi4py import MPI

scene = ec.Scene(
    ec.Elastic(1.0, 0.3), [ec.Displacement("top", (0.02, -0.05))], contacts=[ec.Contact("bottom", friction=0.3)]
)

def limit(error, step):
    if step.cells > 200:
        used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + 40_000_000, -1))

history = ec.adapt(
    scene, ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14)), 1e-9, strategy=ec.Uniform(), callback=limit
)
resource.setrlimit(resource.RLIMIT_AS, (-1, -1))
if MPI.COMM_WORLD.rank == 0:
    print(len(history.steps), history.outcome)
    history.to_csv("history.csv")
"""


@pytest.mark.broad
@pytest.mark.serial
def test_memory_that_really_ends(tmp_path):
    with started(MEMORY, 1, tmp_path) as process:
        text = output(process, 60)
    assert "memory does not suffice" in text
    rows = (tmp_path / "history.csv").read_text().splitlines()
    assert 3 <= len(rows) <= 8


def test_callback_sees_every_mesh_and_may_end_the_run():
    seen = []

    def callback(error, step):
        seen.append((error.relative, step))
        if len(seen) == 3:
            raise StopIteration("seen enough")

    history = ec.adapt(common_block(), block(4), accuracy=1e-3, callback=callback)
    assert [step for _, step in seen] == list(history.steps)
    assert [eps for eps, _ in seen] == [step.eps for step in history.steps]
    assert len(history.steps) == 3
    assert "seen enough" in history.outcome


@pytest.mark.parametrize("rank", [0, MPI.COMM_WORLD.size - 1])
def test_error_of_a_callback_comes_to_all_ranks_and_carries_the_history(rank):
    def callback(error, step):
        if MPI.COMM_WORLD.rank == rank and step.cells > 200:
            raise ZeroDivisionError("of the user's")

    with pytest.raises(ZeroDivisionError, match="of the user's") as caught:
        ec.adapt(common_block(), block(4), accuracy=1e-3, strategy=ec.Uniform(), callback=callback)
    assert len(caught.value.history.steps) == 2
    assert "ZeroDivisionError" in caught.value.history.outcome


INTERRUPTED = """
import os
import signal
import erc_contact as ec
from mpi4py import MPI

scene = ec.Scene(
    ec.Elastic(1.0, 0.3), [ec.Displacement("top", (0.02, -0.05))], contacts=[ec.Contact("bottom", friction=0.3)]
)
comm = MPI.COMM_WORLD
HANDLERS = signal.SIG_DFL, signal.default_int_handler

def tell(error, step):
    if comm.rank == comm.size - 1:
        print("mesh", os.getpid(), flush=True)

for folder in (None, "kept", None):
    domain = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))
    history = ec.adapt(scene, domain, 1e-9, max_cells=10**9, callback=tell, checkpoint=folder)
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)) == HANDLERS
    every = comm.allgather((len(history.steps), history.outcome))
    assert len(set(every)) == 1, every
    if comm.rank == 0:
        history.to_csv("history.csv")
        print("ended", *every[0], flush=True)
"""


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("ranks", [1, 2])
def test_interrupted_runs_keep_their_histories(ranks, tmp_path):
    """Send real signals to three runs of a process: to one rank, and to mpiexec.

    The latter is what Ctrl-C does. SIGTERM comes as a batch system sends it, and each
    level of its run is in the folder.
    """
    with started(INTERRUPTED, ranks, tmp_path) as process:
        for number in (signal.SIGINT, signal.SIGTERM, "Ctrl-C"):
            if number == "Ctrl-C" and ranks == 2 and "Open MPI" in MPI.Get_library_version():
                break  # mpiexec of Open MPI 6 kills its ranks at once
            pid = [int(told(process, "mesh")[0]) for _ in range(2)][-1]
            began = monotonic()
            if number == "Ctrl-C":
                os.kill(process.pid, signal.SIGINT)
            else:
                os.kill(pid, number)
            steps, *outcome = told(process, "ended")
            assert number != signal.SIGTERM or monotonic() - began < 5.0
            assert "Interrupted at" in " ".join(outcome)
            assert int(steps) >= 2
            rows = (tmp_path / "history.csv").read_text().splitlines()
            assert len(rows) == int(steps) + 1
            if number == signal.SIGTERM:
                assert len(Folder(tmp_path / "kept").numbers()) == int(steps)
        else:
            assert "ended" not in output(process, 60)  # it ends by itself, on all ranks


@pytest.mark.parametrize("usual", [signal.default_int_handler, signal.SIG_DFL])
def test_interrupt_before_there_is_anything_to_keep_is_raised(usual):
    """Also while gmsh is in use, which leaves the signal to the system."""
    signal.signal(signal.SIGINT, usual)
    sent = []

    def impatient(x):
        is_running = signal.getsignal(signal.SIGINT) is not usual
        # A second signal would have its usual effect at once.
        if is_running and not sent:
            sent.append(os.kill(os.getpid(), signal.SIGINT))
        return 0.3

    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.0, -0.1))],
        contacts=[ec.Contact("bottom", friction=impatient)],
    )
    with pytest.raises(KeyboardInterrupt):
        ec.adapt(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)), accuracy=1e-3)
    assert len(sent) == 1
    assert signal.getsignal(signal.SIGINT) is usual
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize("stage", ["direct", "iterative", "tightening"])
def test_long_stages_end_within_an_iteration(stage):
    """One rank gets the signal, and no stage goes on to its end on any.

    Outside of a run nothing is asked.
    """
    comm, domain = MPI.COMM_WORLD, block(4)
    solver = "iterative" if stage == "iterative" else "direct"
    solution = ec.solve(common_block(), domain, solver=solver)

    def work():
        return (
            ec.equilibrate(solution)
            if stage == "tightening"
            else ec.solve(common_block(), domain, solver=solver)
        )

    with Interrupts(comm):
        if comm.rank == comm.size - 1:
            os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            work()
    work()


def test_history_rows_and_csv(shared_tmp_path):
    history = ec.adapt(common_block(), block(4), accuracy=0.2)
    assert np.all(np.diff(history.column("seconds")) > 0)
    assert np.allclose(
        history.column("eps") ** 2,
        history.column("eps_bulk") ** 2 + history.column("eps_contact") ** 2,
    )
    history.to_csv(shared_tmp_path / "history.csv")
    MPI.COMM_WORLD.barrier()
    with (shared_tmp_path / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["cells"]) for row in rows] == [step.cells for step in history.steps]
    assert [float(row["eps"]) for row in rows] == [step.eps for step in history.steps]
    assert len(str(history).splitlines()) == len(history.steps) + 2
    assert max(map(len, str(history).splitlines())) <= 80


@pytest.mark.serial
def test_columns_of_a_scene_without_contact():
    """Error eps has one part there, and a column of seconds is not called error."""
    supports = [ec.Displacement("top", (0.0, -0.01)), ec.Displacement("bottom", (0.0, 0.0))]
    history = ec.adapt(ec.Scene(ec.Elastic(1.0, 0.3), supports), block(2), accuracy=0.5)
    header = str(history).splitlines()[0].split()
    assert " ".join(header) == "cells verts dofs N eps s_sol s_equ s_err s_mes seconds"
    assert "contact" not in history._repr_html_()
    assert "geometry" not in history._repr_html_()


@pytest.mark.serial
@pytest.mark.parametrize("accuracy", [0.0, -1.0, float("nan"), float("inf")])
def test_accuracy_must_be_positive(accuracy):
    with pytest.raises(ec.InputError, match="accuracy"):
        ec.adapt(common_block(), block(2), accuracy=accuracy)


def test_a_warning_is_told_once(caplog):
    """By rank 0, whether progress is shown or not."""
    ec.adapt(common_block(), block(4), 1e-3, max_steps=1)
    assert len(caplog.records) == (1 if MPI.COMM_WORLD.rank == 0 else 0)
