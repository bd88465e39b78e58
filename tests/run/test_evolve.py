"""A loading history: adaptive steps, one after the other.

- Each step equals ``solve(after=...)``; all are the same on any number of ranks.
- Energy: work of loads and supports is what is stored and dissipated, up to the error
  of the meshes; what the steps in time cost goes down with their length. Friction never
  gives energy.
- No step after the first with a history compiles anything.
- A step that does not converge is halved; what ends a run leaves what it has; a folder
  goes on.
- What friction takes is of second order in the length of the steps, and the work of
  friction is below it.
- Steps in time are as short as the accuracy of the path, or of the dissipated energy,
  asks.
"""

import csv
import json
import os
import signal
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from domains import refused
from mpi4py import MPI
from scenes import moved_box
from test_report import Page, page_alone

import erc_contact as ec
from erc_contact.base.runtime import compiled
from erc_contact.error.contact import contact_squares
from erc_contact.error.works import friction_works
from erc_contact.run.energy import energies
from erc_contact.run.evolution import _slides
from erc_contact.run.walk import Walk
from namedmesh.base.percent import percent
from namedmesh.simplex import bernstein, lagrange, rule

COMM = MPI.COMM_WORLD
MESHES = Path(__file__).parents[2] / "meshes"
PRESS, MU = 0.05, 0.3
CYCLE = [0.0, *np.linspace(1.0, 2.0, 9)]


def scene_at(t, d=2, amplitude=0.03):
    """Pressed until t = 1, then a cycle of shear until t = 2."""
    shear = amplitude * np.sin(2 * np.pi * max(t - 1.0, 0.0))
    return moved_box(d, shear, PRESS * min(t, 1.0), MU)[0]


def box(d=2, comm=COMM):
    if d == 2:
        return ec.rectangle((0.0, 0.0), (1.0, 0.7), cells=(4, 3), comm=comm)
    return ec.box((0.0,) * 3, (1.0, 0.8, 0.7), cells=(2, 2, 2), comm=comm)


def cycle(accuracy=0.12, times=CYCLE, **options):
    return ec.evolve(scene_at, options.pop("domain", None) or box(), times, accuracy, **options)


@pytest.fixture(scope="module")
def whole():
    return cycle()


@pytest.mark.on_ranks("strategy0")
@pytest.mark.parametrize(
    "strategy", [ec.Mark(), pytest.param(ec.SizeMap(), marks=pytest.mark.broad)]
)
def test_a_curved_body_from_rest(strategy):
    """At rest every error is 100% on every mesh: there is nothing to refine for."""

    def scene_at(t):
        top = ec.Displacement("top", (0.004 * max(t - 1, 0), -0.02 * min(t, 1)))
        contact = ec.Contact("arc", friction=MU, gap=lambda x: x[1], normal=(0.0, -1.0))
        return ec.Scene(ec.Elastic(1.0, 0.3), top, contacts=contact)

    disc = ec.read_mesh(MESHES / "half_disc.geo", scripts=True)
    evolution = ec.evolve(scene_at, disc, [0.0, 1.0, 2.0], accuracy=0.3, strategy=strategy)
    assert evolution.reached
    assert evolution.steps[0].cells == disc.cells
    forces = evolution.force("arc")
    assert np.allclose(forces[0], 0.0, atol=1e-15)
    assert forces[1, 1] > 0
    assert -MU * forces[2, 1] < forces[2, 0] < 0
    assert evolution.steps[0].stored == 0.0
    for step in evolution.steps[1:]:  # from rest the rest is int (sigma^ - C eps(u^)) : eps(u^) / 2
        assert abs(step.imbalance) <= 2.5 * step.eps * step.stored
    rest = ec.adapt(scene_at(0.0), disc, accuracy=0.3, strategy=strategy)
    assert len(rest.steps) == 1
    assert "at rest" in rest.outcome


@pytest.mark.broad
@pytest.mark.serial
def test_steps_are_those_by_hand(whole):
    """Without refinement; these steps have the accuracy of the first mesh."""
    coarse = cycle(accuracy=0.9)
    assert coarse.reached
    solution = None
    for t, error in zip(CYCLE, coarse.errors, strict=True):
        solution = ec.solve(scene_at(t), box(), ec.AugmentedLagrangian(), after=solution)
        assert np.allclose(
            error.force("bottom").force,
            ec.constitutive_error(ec.equilibrate(solution)).force("bottom").force,
            rtol=0,
            atol=1e-12,
        )
    assert whole.column("cells")[-1] > coarse.column("cells")[-1]
    assert np.all(whole.column("eps") <= 0.12)
    assert np.array_equal(whole.column("time"), CYCLE)
    assert np.all(np.diff(whole.column("cells")) >= 0)
    assert whole.force("bottom").shape == (len(CYCLE), 2)
    assert whole.outcome in str(whole)


@pytest.mark.broad
@pytest.mark.serial
def test_energy(whole):
    """The energy residual on fixed meshes is below the square of the error of the pairs; see the formulas."""
    for times in (np.linspace(0.0, 2.0, 9), np.linspace(0.0, 2.0, 17)):
        history = cycle(
            accuracy=0.9, times=times, domain=ec.rectangle((0.0, 0.0), (1.0, 0.7), cells=(8, 6))
        )
        scale = (history.column("scale") * history.column("eps")).max() ** 2
        assert abs(history.column("imbalance")).max() <= scale
        if len(times) == 9:
            before = abs(history.column("in_time")[-1])
    assert abs(history.column("in_time")[-1]) < 0.4 * before
    assert history.steps[-1].dissipated > 0
    refined = whole.column("imbalance")
    assert abs(refined).max() <= 2 * (whole.column("scale") * whole.column("eps")).max() ** 2


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_dissipation_of_a_body_that_slides(d):
    """Between two states in which all of it slides the body only moves.

    Friction takes mu N times the way.

    In 3D the directions of slip get nearer to the direction of the way with each
    step.
    """
    times, tolerance = [1.0, 1.5, 2.0, 2.5, 3.0], {2: 1e-10, 3: 1e-6}[d]
    history = ec.evolve(lambda t: moved_box(d, 0.3 * t, PRESS, MU)[0], box(d), times, accuracy=0.9)
    way = 0.15 * np.hypot(1.0, 0.4 * (d == 3))
    taken, in_time = (np.diff(history.column(name))[-1] for name in ("dissipated", "in_time"))
    assert taken == pytest.approx(MU * history.force("bottom")[-1, -1] * way, rel=tolerance)
    assert abs(in_time) <= tolerance * taken


def lifted(t):
    """A block that slides faster and faster while its pressure and its coefficient of friction go down."""
    return moved_box(2, 0.1 + 0.3 * t**2, PRESS * (1.02 - t), MU * (2.0 - t))[0]


@pytest.mark.broad
@pytest.mark.serial
def test_dissipation_is_of_second_order_in_time():
    """Half as long steps have a quarter of the error."""
    taken, in_time = {}, {}
    for count in (4, 8, 24):
        history = ec.evolve(lifted, box(), np.linspace(0.0, 1.0, count + 1), 0.9)
        assert np.all(np.diff(history.column("dissipated")) >= 0)
        taken[count] = np.ptp(history.column("dissipated"))
        in_time[count] = np.diff(history.column("in_time"))
    assert abs(taken[4] - taken[24]) < 0.06 * taken[24]
    assert abs(taken[8] - taken[24]) < 0.3 * abs(taken[4] - taken[24])
    assert all(unknown.min() >= -1e-12 * taken[24] for unknown in in_time.values())
    header, *_, last, _ = str(history).splitlines()
    assert header.split()[8] == "in_time"
    assert last.split()[8] == f"{history.steps[-1].in_time:.1e}"


@pytest.mark.on_ranks("augmented")
@pytest.mark.parametrize(
    "method",
    [ec.AugmentedLagrangian(), pytest.param(ec.Nitsche(), marks=pytest.mark.broad)],
    ids=["augmented", "Nitsche"],
)
def test_work_and_dissipation_have_one_slip(method):
    """On one mesh the work of friction is never more than what it dissipates.

    u^ of the last step slips at nodes where its solution sticks, and the reverse.
    """

    def scene_at(t):
        force = (None, -0.02 * (1 + t * (2 - t)))
        plate = ec.Rigid("top", (0.01 * np.sin(3 * t), None), force=force, moment=0.0)
        return ec.Scene(ec.Elastic(1.0, 0.3), plate, contacts=ec.Contact("bottom", friction=MU))

    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    history = ec.evolve(scene_at, block, np.linspace(0.0, 0.5, 9)[1:], 0.9, method=method)
    apart = 0.0
    for last, error in pairwise(error.admissible for error in history.errors):
        (before,), (now,) = last.tractions, error.tractions
        slip = before.contact.trace.of(last.displacement.x.array) - now.contact.trace.slip_before
        apart = max(apart, float(abs(slip[..., 0]).max(initial=0.0)))
    assert COMM.allreduce(apart, MPI.MAX) > 1e-4
    in_time = np.diff(history.column("in_time"))
    assert in_time.min() >= -1e-12 * history.column("dissipated")[-1]
    parts = np.array([error.contact_error for error in history.errors[1:]]) ** 2 / 2
    assert np.all(in_time < 2 * parts)


def test_dissipation_on_another_mesh():
    """The bound at the begin of a step follows from the law and the traction then, wherever they were computed."""
    first = ec.solve(lifted(0.5), box(), ec.AugmentedLagrangian())
    last = ec.constitutive_error(ec.equilibrate(first))
    taken = []
    for domain in (box(), box().refined(), ec.rectangle((0.0, 0.0), (1.0, 0.7), cells=(5, 4))):
        second = ec.solve(lifted(0.75), domain, ec.AugmentedLagrangian(), after=first)
        taken.append(energies(ec.constitutive_error(ec.equilibrate(second)), last).dissipated)
    assert taken[1] == pytest.approx(taken[0], rel=0.03)
    assert taken[2] == pytest.approx(taken[0], rel=0.03)


def test_dissipation_where_a_contact_opens():
    """On a facet with an open and a sticking node the work of r^ gives energy, the dissipation does not.

    The two differ by no more than the contact part of e^2/2 of the facet.
    """

    def scene_at(t):
        top = ec.Displacement("top", (0.025 * np.sin(2.5 * t), -0.03 * min(1.0, 0.3 + t)))
        return ec.Scene(
            ec.Elastic(1.0, 0.14),
            top,
            contacts=ec.Contact("bottom", friction=0.5, gap=lambda x: 0.001 * x[0]),
        )

    history = ec.evolve(
        scene_at, ec.rectangle((0.0, 0.0), (1.5, 1.0), cells=(12, 8)), [0.0, 0.5], accuracy=0.9
    )
    pair = history.error.admissible
    (t,), model = pair.tractions, pair.solution.model
    points, weights = rule(1, 2)
    since = t.contact.trace.since(pair.displacement.x.array)
    product = (
        np.matmul(bernstein(1, 1, points), t.values)[..., 0]
        * np.matmul(lagrange(1, 1, points), since)[..., 0]
    )
    own = model.space.owned(t.contact.facets)
    work, most = (
        -(t.area * (product @ weights))[own],
        contact_squares(model.space, pair.displacement, t, 0.0).parts[own] / 2,
    )
    taken = friction_works(model.space, t, pair.displacement, 0.0).value[own, 0]
    assert COMM.allreduce(float(work.min(initial=0.0)), MPI.MIN) < -1e-9
    assert np.all(taken >= 0)
    assert np.all(taken >= work)
    assert np.all(taken - work <= most + 1e-15)


@pytest.mark.broad
@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_energy_of_loads(d):
    """Loads instead of supports, and a weight that changes in time."""

    def weighted(t):
        down = (0.0,) * (d - 1)
        loads = [
            ec.Traction("top", (0.004 * t, *down[1:], -0.02)),
            ec.BodyForce((*down, -0.02 * (1 + t))),
        ]
        sides = ec.Displacement("left", (None, *down[1:], None)) if d == 3 else []
        return ec.Scene(ec.Elastic(1.0, 0.3), sides, loads, [ec.Contact("bottom", friction=MU)])

    history = ec.evolve(weighted, box(d), [0.0, 0.5, 1.0], 0.9, strategy=ec.Uniform())
    row = history.steps[-1]
    assert row.work > 0
    assert abs(row.imbalance) <= (row.eps * row.scale) ** 2
    again = ec.evolve(weighted, box(d), [0.0, 1.0], 0.25 if d == 2 else 0.5, strategy=ec.Uniform())
    assert again.steps[-1].work == pytest.approx(row.work, rel=0.1)


@pytest.mark.serial
def test_nothing_is_compiled_after_the_first_steps():
    seen = []
    times = [0.0, *np.linspace(1.0, 1.5, 7)]
    history = cycle(times=times, callback=lambda *_: seen.append(len(compiled._known)))
    assert history.steps[-1].cells > history.steps[2].cells  # later meshes are new
    assert len(set(seen[2:])) == 1


@pytest.mark.ranks
def test_ranks_have_the_same_history(shared_tmp_path):
    times = CYCLE[:5]  # until the shear ends its first half
    alone = cycle(times=times, domain=box(comm=MPI.COMM_SELF))
    together = cycle(times=times, checkpoint=shared_tmp_path / "run")
    again = cycle(times=times, checkpoint=shared_tmp_path / "run")
    assert alone.steps[-1].cells > alone.steps[0].cells, alone.outcome
    for other in (together, again):
        assert len(alone.steps) == len(other.steps)
        for a, b in zip(alone.steps, other.steps, strict=True):
            assert (a.time, a.cells, a.newton_steps) == (b.time, b.cells, b.newton_steps)
            assert a.eps == pytest.approx(b.eps, rel=1e-8)
            assert np.allclose(a.force["bottom"], b.force["bottom"], rtol=0, atol=1e-10)
            for energy in ("work", "contact_work", "friction_work", "dissipated", "stored"):
                assert getattr(a, energy) == pytest.approx(getattr(b, energy), rel=1e-8, abs=1e-14)


@pytest.mark.parametrize("where", ["in a step", "between steps"])
def test_an_interrupt_ends_a_history_with_whole_steps(where):
    """A signal to one rank: the step that it hits is given up."""

    def interrupt(*_):
        if COMM.rank == COMM.size - 1:
            os.kill(os.getpid(), signal.SIGTERM)

    def at(t):
        if where == "in a step" and t > 1.2:
            interrupt()
        return scene_at(t)

    between = {"callback": interrupt} if where == "between steps" else {}
    history = ec.evolve(at, box(), CYCLE[:4], 0.12, **between)
    assert not history.reached
    assert "Interrupted" in history.outcome
    assert all(row.reached for row in history.steps)
    assert len(history.steps) == (1 if where == "between steps" else 3)
    assert history.column("time")[-1] == CYCLE[len(history.steps) - 1]


@pytest.mark.broad
def test_a_damaged_step_is_made_again(shared_tmp_path):
    """All steps after it, too: they depend on it."""
    folder = shared_tmp_path / "run"
    times = CYCLE[:4]
    first = cycle(accuracy=0.9, times=times, checkpoint=folder)
    if COMM.rank == 0:
        damaged = sorted(path for path in folder.iterdir() if path.suffix == ".vtkhdf")[1]
        content = bytearray(damaged.read_bytes())
        content[len(content) // 2] ^= 1
        damaged.write_bytes(content)
    COMM.barrier()
    made = []
    for expected in (3, 0):
        made.clear()
        again = cycle(
            accuracy=0.9, times=times, checkpoint=folder, callback=lambda *_: made.append(1)
        )
        assert len(made) == expected
        assert np.array_equal(again.column("eps"), first.column("eps")) or np.allclose(
            again.column("eps"), first.column("eps"), rtol=1e-8, atol=0
        )


@pytest.mark.broad
@pytest.mark.serial
def test_a_folder_goes_on(whole, shared_tmp_path, monkeypatch):
    """The same call after an end in the middle.

    No step is solved again, and the rest is the same.
    """

    def end(error, row):
        if row.time > 1.3:
            raise StopIteration("enough")

    folder = shared_tmp_path / "run"
    first = cycle(checkpoint=folder, callback=end)
    assert not first.reached
    assert "enough" in first.outcome
    solved = []
    usual = Walk._step
    monkeypatch.setattr(Walk, "_step", lambda *a: solved.append(1) or usual(*a))
    rest = cycle(checkpoint=folder)
    assert len(solved) == len(whole.steps) - len(first.steps)
    assert len({error.domain for error in rest.errors}) == len(
        {error.domain for error in whole.errors}
    )
    for a, b in zip(rest.steps, whole.steps, strict=True):
        assert (a.time, a.cells, a.newton_steps) == (b.time, b.cells, b.newton_steps)
        assert a.eps == pytest.approx(b.eps, rel=1e-8)
        for energy in ("dissipated", "friction_work"):
            assert getattr(a, energy) == pytest.approx(getattr(b, energy), rel=1e-8, abs=1e-15)
    refused(lambda: cycle(checkpoint=folder, times=[0.0, 1.0]), "times", "another run")
    refused(lambda: ec.read_history(folder), "loading history", "evolve")


@pytest.mark.parametrize("longest", [0.3, 1e-9])
def test_steps_that_do_not_converge_are_halved(monkeypatch, longest):
    usual = Walk._step

    def step(self, to, last):
        if last is not None and to - (self.times[0] if not self.rows else self.time) > longest:
            raise ec.NotConverged("too long", ())
        return usual(self, to, last)

    monkeypatch.setattr(Walk, "_step", step)
    history = cycle(accuracy=0.9, times=[0.0, 1.0])
    if longest > 0.1:
        assert history.reached
        assert history.steps[-1].time == 1.0
        assert np.diff(history.column("time")).max() <= longest
    else:
        assert not history.reached
        assert len(history.steps) == 1
        assert "halved" in history.outcome
        assert "t = 0" in history.outcome


@pytest.mark.broad
@pytest.mark.serial
def test_steps_as_short_as_the_path_asks():
    """Pressed and sheared in proportion is a straight path without gap.

    One step and its half. Cycles are not.
    """
    straight = ec.evolve(
        lambda t: moved_box(2, 0.02 * t, PRESS * t)[0], box(), [0.0, 1.0], 0.9, path=1e-6
    )
    rough, fine = (cycle(accuracy=0.9, times=[1.0, 1.5], path=path) for path in (0.1, 0.02))
    assert len(rough.steps) == 3
    assert len(fine.steps) >= 2 * len(rough.steps) - 1
    assert rough.reached
    assert fine.reached
    assert fine.column("time")[-1] == 1.5
    assert straight.column("time").tolist() == [0.0, 0.5, 1.0]


@pytest.mark.broad
@pytest.mark.serial
def test_steps_as_short_as_the_accuracy_of_the_energy_asks():
    """Each step leaves no more of its energy unknown than asked, or less than the mesh; turns end the halving."""
    accuracies, times = (0.2, 0.02), [0.0, 1.0, 1.25, 1.75]
    rough, fine = (cycle(accuracy=0.9, times=times, accuracy_in_time=share) for share in accuracies)
    assert len(fine.steps) > len(rough.steps) >= len(times)
    for history, share in zip((rough, fine), accuracies, strict=True):
        assert history.reached
        assert history.settings["accuracy_in_time"] == share
        for before, row in pairwise(history.steps):
            unknown, of_mesh = row.in_time - before.in_time, (row.eps_contact * row.scale) ** 2
            assert unknown <= max(share * (row.dissipated - before.dissipated), of_mesh)


@pytest.mark.broad
@pytest.mark.serial
def test_what_is_written(whole, shared_tmp_path):
    whole.save(shared_tmp_path, pictures=True)
    forces = whole.error.reactions()
    if COMM.rank > 0:
        return
    page = page_alone(shared_tmp_path / "report.html", 4)
    lines = page.words.splitlines()
    for step in whole.steps:
        assert {str(step.cells), percent(step.eps, 3), f"{step.dissipated:.4g}"} <= set(lines)
    assert whole.outcome in lines
    assert f"{forces['bottom'].force[1]:.6g}" in lines
    for code in (
        "def scene_at(t, d=2, amplitude=0.03):",
        "PRESS = 0.05",
        "strategy=ec.Mark()",
        "times=[0.0, ",
    ):
        assert code in page.words
    assert f"the first mesh has {box(comm=MPI.COMM_SELF).cells} cells" in page.words
    assert "given the slip of the steps before" in page.words
    told = json.loads((shared_tmp_path / "evolution.json").read_text())
    assert [row["time"] for row in told["steps"]] == json.loads(told["settings"]["times"]) == CYCLE
    assert told["steps"][-1]["force"] == whole.steps[-1].force
    assert told["error"]["relative"] == whole.steps[-1].eps
    assert told["forces"]["balance"]["force"] == forces["balance"].force.tolist()
    notebook = Page(whole._repr_html_())
    assert notebook.depth == []
    assert whole.outcome in notebook.words
    assert percent(whole.steps[-1].eps, 3) in notebook.words
    rows = list(csv.DictReader((shared_tmp_path / "evolution.csv").read_text().splitlines()))
    assert [float(row["time"]) for row in rows] == CYCLE
    assert float(rows[-1]["force_bottom_y"]) == whole.steps[-1].force["bottom"][1]
    for name in ("energies.png", "loop_bottom.png", "zones_bottom.png"):
        assert (shared_tmp_path / name).stat().st_size > 5000
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(shared_tmp_path / "body.vtkhdf"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == len(whole.steps)
    for number, step in enumerate(whole.steps):
        reader.SetStep(number)
        reader.Update()
        assert reader.GetOutput().GetNumberOfCells() == step.cells
        assert reader.GetTimeValue() == step.time
        assert reader.GetOutput().GetCellData().GetArray("eps_E").GetRange()[1] <= step.eps


def test_force_of_a_support_is_the_force_of_each_step(whole):
    """As ``history.force``: of supports, too."""
    reactions = whole.reactions()
    assert np.array_equal(whole.force("top"), reactions["top"].force)
    assert whole.force("bottom") == pytest.approx(reactions["bottom"].force, rel=1e-12)
    balance = whole.force("top") + whole.force("bottom")
    assert abs(balance).max() <= 1e-10 * abs(whole.force("top")).max()
    with pytest.raises(ec.InputError, match="nowhere"):
        whole.force("nowhere")


@pytest.mark.serial
@pytest.mark.parametrize(("turn", "friction"), [(0.0, 1.5), (np.pi / 4, 0.3), (np.pi / 3, 1.5)])
def test_shear_over_pressure_is_along_the_contact(turn, friction):
    """A block that slides on an inclined plane has mu, whatever its direction is."""
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    flat = ec.rectangle((0.0, 0.0), (2.0, 0.5), cells=(8, 2))
    flat.mesh.geometry.x[:, :2] = flat.mesh.geometry.x[:, :2] @ rotation.T
    domain = ec.Domain(flat.mesh, flat.facet_tags, flat.names)

    def scene_at(t):
        way = rotation @ (2.0 * t, -0.02)
        contact = ec.Contact("bottom", friction=friction)
        return ec.Scene(ec.Elastic(1.0, 0.0), ec.Displacement("top", tuple(way)), contacts=contact)

    history = ec.evolve(scene_at, domain, [0.5, 1.0], accuracy=0.9)
    assert history.column("shear") == pytest.approx(friction, rel=1e-6)


@pytest.mark.serial
def test_columns_that_mean_nothing_are_left_out():
    """Shear and dissipation need friction; their header comes when friction does."""

    def scene_at(t):
        contact = ec.Contact("bottom", friction=0.3 if t > 1 else 0.0)
        return ec.Scene(
            ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.02 * t, -0.01)), contacts=contact
        )

    of_friction = {"shear", "dissipated", "in_time"}
    without = ec.evolve(scene_at, box(), [0.0, 1.0], accuracy=0.9)
    assert of_friction.isdisjoint(str(without).split("\n", 1)[0].split())
    later = ec.evolve(scene_at, box(), [0.0, 1.0, 2.0], accuracy=0.9)
    names = str(later).split("\n", 1)[0].split()
    assert of_friction <= set(names)
    assert names.count("seconds") == 1
    assert "total" not in names
    for row in str(later).splitlines()[1:-1]:
        assert len(row.split()) == len(names)
    assert "<th>shear</th>" not in without._repr_html_()
    assert "<th>shear</th>" in later._repr_html_()


@pytest.mark.serial
def test_a_loop_is_drawn_where_something_slides_with_friction(whole):
    """Without friction it would be one of round-off."""
    profiles = whole.profile("bottom")
    assert any(_slides(profile) for profile in profiles)
    scene = replace(whole.scene_at(whole.steps[-1].time), contacts=ec.Contact("bottom"))
    without = ec.solve(scene, whole.error.domain)
    assert not _slides(without.profile("bottom"))


@pytest.mark.broad
def test_a_weight_alone_is_written(shared_tmp_path):
    """No part of the boundary has a support or a load."""

    def weighted(t):
        return ec.Scene(
            ec.Elastic(1.0, 0.3),
            [],
            [ec.BodyForce((0.002 * t, -0.02))],
            [ec.Contact("bottom", friction=MU)],
        )

    ec.evolve(weighted, box(), [0.0, 1.0], 0.9).save(shared_tmp_path, pictures=True)
    assert (shared_tmp_path / "report.html").is_file()


@pytest.mark.serial
def test_animation(whole, tmp_path):
    from PIL import Image

    short = replace(whole, steps=whole.steps[2:4], errors=whole.errors[2:4])
    short.animate(tmp_path / "cycle.gif")
    with Image.open(tmp_path / "cycle.gif") as image:
        assert image.n_frames == 2


def test_what_is_no_history():
    domain = box()

    def run(at=scene_at, times=(0.0, 1.0), accuracy=0.9, **options):
        return lambda: ec.evolve(at, domain, times, accuracy, **options)

    refused(run(times=[0.0, 1.0, 0.5]), "times", "0.5", "after 1")
    refused(run(times=[0.0, 0.0]), "times", "increase")
    refused(run(times=[]), "times")
    refused(run(times=[0.0, np.nan]), "times")
    refused(run(at=scene_at(1.0)), "scene_at", "function of the time")
    refused(run(at=lambda t: "scene"), "scene is 'scene'")
    refused(run(path=0.0), "path")
    refused(run(accuracy_in_time=-0.1), "accuracy_in_time")
    refused(run(accuracy=-1.0), "accuracy")

    def other(t):
        contact = ec.Contact("bottom" if t < 0.5 else "right", friction=MU, normal=None)
        return ec.Scene(
            ec.Elastic(1.0, 0.3), [ec.Displacement("top", (0.0, -0.01 * t))], [], [contact]
        )

    history = run(at=other)()
    assert not history.reached
    assert "same contacts" in history.outcome
    assert len(history.steps) == 1
    tiny = 1.0 + 2 * np.finfo(float).eps
    short = ec.evolve(scene_at, domain, [0.0, 1.0, tiny], 0.9, path=1e-12)
    assert short.steps[-1].time >= 1.0  # a step that cannot be halved: told, or made

    def fails(t):
        if t > 0.5:
            raise ZeroDivisionError("of the user")
        return scene_at(t)

    with pytest.raises(ZeroDivisionError) as failure:
        run(at=fails)()
    assert len(failure.value.history.steps) == 1


@pytest.mark.broad
@pytest.mark.on_ranks("method0")
@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()])
def test_the_contact_part_of_e_follows_from_what_is_returned(method):
    """Friction counts from ``slip_before``; with Nitsche's method that is not u of the last step."""
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    solution = None
    differences = []
    for turn in np.linspace(0.0, 2.0, 9):
        way = 0.03 * float(np.sin(np.pi * turn))
        support = ec.Displacement("top", (way, -0.05))
        scene = ec.Scene(ec.Elastic(1.0, 0.3), support, contacts=ec.Contact("bottom", friction=0.3))
        last = solution
        solution = ec.solve(scene, block, method, after=last)
        error = ec.constitutive_error(ec.equilibrate(solution))
        table = error.profile("bottom")
        assert np.all(np.diff(table["x"]) >= 0)
        points = np.column_stack([table["x"], table["y"]])
        s = solution.slip_before("bottom")
        assert s.shape == points.shape
        assert not s[:, 1].any()  # the normal is along y
        w = error.at(points).displacement
        square = contact_square(table, w, s[:, 0])
        assert square == pytest.approx(error.contact_error**2, rel=1e-3, abs=1e-12 * error.scale**2)
        if last is not None:
            of_last = last.at(points).displacement[:, 0]
            differences.append(abs(of_last - s[:, 0]).max() / abs(of_last).max())
    # a multiplier keeps sticking points to round-off
    if method.multiplier:
        assert max(differences) <= 1e-9
    else:
        assert max(differences) > 1e-3


@cache
def many_points():
    """Gauss's rule on (-1, 1) with so many points that a kink does not matter."""
    return np.polynomial.legendre.leggauss(2000)


def contact_square(table, w, s):
    """Compute the contact part of e^2 on a bottom without gap; degree 1, friction 0.3."""
    places, weights = many_points()
    shape = np.column_stack([1.0 - places, 1.0 + places]) / 2

    def on_facets(values):
        return values.reshape(-1, 2) @ shape.T

    pressure, shear = on_facets(table["pressure"]), on_facets(table["shear"])
    slip, opening = on_facets(w[:, 0] - s), on_facets(-w[:, 1])
    density = 0.3 * pressure * abs(slip) + shear * slip - pressure * opening
    lengths = np.diff(table["x"].reshape(-1, 2))[:, 0]
    return float(2 * lengths @ (density @ weights / 2))
