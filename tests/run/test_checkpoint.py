"""A run that ends before its time goes on as if nothing had happened, and never goes on from what is wrong.

- The same call goes on from the folder: same meshes, Newton steps of the new meshes,
  eps to 1e-8, on any ranks.
- Mesh, names, regions, true geometry, displacement and multipliers are those that were
  written.
- Another scene, mesh, method, strategy or a newer format is refused, and the message
  says what differs.
- Any byte that is changed or missing is found; the run goes on from the last good
  level.
- A disk that is full, a folder that is gone: a warning, and the result of the run.
- Real signals to real processes: SIGKILL, SIGTERM. ``benchmarks/survive.py`` has many
  more of them.
"""

import dataclasses
import itertools
import os
import resource
import shutil
import signal
import sys
from pathlib import Path
from time import sleep

import numpy as np
import pytest
import ufl
from bricks import NAMES, bricks
from mpi4py import MPI
from processes import output, started, told
from scenes import block, prototype_block, random_scene

import erc_contact as ec
from erc_contact.output.paraview import write_fields
from erc_contact.run.fingerprint import fingerprint
from erc_contact.run.levels import Folder, unpack_level
from erc_contact.run.states import level_of
from namedmesh.base.releases import cell_nodes
from namedmesh.keeping import BLOCK, Damaged, pack, packed
from namedmesh.tables import CellRows, describe_shape, geometry_of, tag_tables
from namedmesh.tags import NO_TAG

COMM = MPI.COMM_WORLD
MESHES = Path(__file__).parents[2] / "meshes"


def same(history, other, *, solved=0):
    """The same rows: cells, Newton steps, eps to 1e-8.

    Those that were not solved again to the last digit.
    """
    assert len(history.steps) == len(other.steps)
    for a, b in zip(history.steps, other.steps, strict=True):
        assert (a.cells, a.vertices, a.dofs, a.newton_steps, a.method) == (
            b.cells,
            b.vertices,
            b.dofs,
            b.newton_steps,
            b.method,
        )
        assert a.eps == pytest.approx(b.eps, rel=1e-8)
    assert history.best.total == pytest.approx(other.best.total, rel=1e-8)
    assert [d.cells for d, _ in history.meshes] == [d.cells for d, _ in other.meshes]
    assert history.steps[:solved] == other.steps[:solved]


def of_flat_body(comm=COMM):
    return prototype_block(), block(2, comm), {"method": ec.Nitsche()}


def of_regions(comm=COMM):
    """Degree 2 with multipliers and two regions, on a mesh of gmsh's."""
    return *random_scene(2, comm), {
        "degree": 2,
        "method": ec.AugmentedLagrangian(),
        "stop": "certified",
    }


def of_space(comm=COMM):
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.02, 0.01, -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    domain = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 2), comm=comm)
    return scene, domain, {"strategy": ec.Mark(0.2), "method": ec.Nitsche()}


def of_curves(comm=COMM):
    """Meshed again by gmsh from a drawing: the half disc."""
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.0, -0.02))],
        contacts=[ec.Contact("arc", friction=0.3, gap=lambda x: x[1], normal=(0.0, -1.0))],
    )
    return (
        scene,
        ec.read_mesh(MESHES / "half_disc.geo", comm, scripts=True),
        {"strategy": ec.SizeMap(), "method": ec.Nitsche()},
    )


def with_varying_gap(parts, ends):
    """Two bodies with a gap between them that varies."""
    supports = [ec.Displacement(ends[0], (0.02, -0.05)), ec.Displacement(ends[1], (0.0, 0.0))]
    contact = ec.Contact(parts[0], against=parts[1], friction=0.3, gap=lambda x: 0.02 * x[0] ** 2)
    return ec.Scene(ec.Elastic(1.0, 0.3), supports, [], contact)


def of_pair(comm=COMM):
    """Two bodies of one mesh, which is split again on each mesh."""
    domain = bricks(2, (4, 2), comm=comm)
    return with_varying_gap(NAMES, ("upper outer", "lower outer")), domain, {"method": ec.Nitsche()}


def of_joined(comm=COMM):
    """Two bodies that were meshed apart, each meshed again and joined."""
    upper = ec.rectangle((-0.5, 0.0), (1.0, 1.0), size=0.5, comm=comm)
    lower = ec.rectangle((-1.0, -1.0), (1.0, 0.0), size=0.7, comm=comm)
    parts = ("upper bottom", "lower top")
    domain = ec.assembly({"upper": upper, "lower": lower}).joined(*parts)
    scene = with_varying_gap(parts, ("upper top", "lower bottom"))
    return scene, domain, {"strategy": ec.SizeMap(leap=2.0), "method": ec.Nitsche()}


RUNS = [of_flat_body, of_regions, of_space, of_curves, of_joined]


def run(problem, meshes, folder=None, comm=COMM, **more):
    scene, domain, settings = problem(comm)
    return ec.adapt(scene, domain, 0.01, max_steps=meshes, checkpoint=folder, **settings, **more)


@pytest.mark.broad
@pytest.mark.on_ranks("of_space", "of_joined")
@pytest.mark.parametrize("problem", RUNS)
def test_the_same_call_goes_on(problem, shared_tmp_path):
    undisturbed = run(problem, 3)
    first = run(problem, 2, shared_tmp_path)
    again = run(problem, 3, shared_tmp_path)
    same(again, undisturbed)
    assert again.steps[:2] == first.steps  # not solved again: seconds, too
    assert np.all(np.diff(again.column("seconds")) > 0)
    ended = run(problem, 3, shared_tmp_path)
    assert ended.steps == again.steps
    assert ended.outcome == again.outcome
    assert ended.best.relative == pytest.approx(again.best.relative, rel=1e-8)


@pytest.mark.ranks
@pytest.mark.parametrize("problem", RUNS)
def test_other_ranks_go_on(problem, shared_tmp_path):
    """One rank goes on from what all have written, and all from what it has written."""
    undisturbed = run(problem, 3)
    run(problem, 1, shared_tmp_path)
    last = [run(problem, 2, shared_tmp_path, MPI.COMM_SELF).steps] if COMM.rank == 0 else []
    assert len(COMM.bcast(last)[0]) == min(2, len(undisturbed.steps))
    same(run(problem, 3, shared_tmp_path), undisturbed)


def test_a_domain_comes_back_from_its_tables(measures, shared_tmp_path):
    """Coordinates to the last digit; parts, regions and the true shape.

    Meshed again as the first one.
    """
    for problem in (of_regions, of_curves):
        domain = problem()[1].refined()
        x, cells = domain.mesh.geometry.x, cell_nodes(domain.mesh.geometry)[: domain.owned_cells]
        numbers = (
            domain.mesh.geometry.index_map().local_to_global(cells.ravel()).reshape(cells.shape)
        )
        own = x[: domain.mesh.geometry.index_map().size_local]
        tables = {"x": own, "cells": numbers} | tag_tables(domain)
        whole = {name: COMM.gather(table) for name, table in tables.items()}
        get = (
            {name: np.concatenate(parts) for name, parts in whole.items()}
            if COMM.rank == 0
            else dict.fromkeys(whole)
        )
        rows = CellRows(COMM, get["x"], get["cells"], domain.dim)
        tags = rows.cell_tags(get["regions"])
        curved = rows.facet_tags(get["curved"]) if "curved" in tables else None
        geometry = geometry_of(describe_shape(domain.geometry))
        back = ec.Domain(
            rows.mesh,
            rows.facet_tags(get["facets"]),
            domain.names,
            tags,
            domain.regions,
            geometry,
            curved,
        )
        assert (back.cells, back.vertices) == (domain.cells, domain.vertices)
        every = [
            np.concatenate(COMM.allgather(d.mesh.geometry.x[: len(c)]))
            for d, c in ((domain, own), (back, own))
        ]
        for part in domain.names:
            assert measures.part(back, part) == pytest.approx(
                measures.part(domain, part), rel=1e-14
            )
        for region in domain.regions:
            assert measures.region(back, region) == pytest.approx(
                measures.region(domain, region), rel=1e-14
            )
        if COMM.size == 1:
            order = [np.lexsort(x.T) for x in every]
            assert np.array_equal(*(x[o] for x, o in zip(every, order, strict=True)))
        if geometry is not None:
            assert back.refined().cells == domain.refined().cells
            assert back.remeshed(0.1).cells == domain.remeshed(0.1).cells
    assert NO_TAG < 0


# -- other runs are refused
# ------------------------------------------------------------------------------------------


def changed(**changes):
    """The scene of a run that knows all kinds of data, with changes."""
    scene = ec.Scene(
        ec.Elastic(lambda x: 1.0 + 0.1 * x[0], 0.3),
        [ec.Displacement("top", (0.02, lambda x: -0.05 - 0.01 * x[0] ** 2))],
        [
            ec.Traction("right", lambda x: ufl.as_vector([0.0, 1e-3 * ufl.sin(x[1])])),
            ec.BodyForce((0.0, -1e-3)),
        ],
        [ec.Contact("bottom", friction=lambda x: 0.3 + 0.1 * x[0], gap=lambda x: 0.01 * x[0] ** 2)],
    )
    return dataclasses.replace(scene, **changes)


class Steeper:
    """A friction law of the user's."""

    parameters = ("limit",)

    def __init__(self, limit, factor):
        self.limit, self.friction_bound = (
            limit,
            lambda pressure, limit: factor * limit + 0.0 * pressure,
        )


OTHER = {
    "modulus": {"material": ec.Elastic(lambda x: 1.0 + 0.2 * x[0], 0.3)},
    "hypothesis": {"material": ec.Elastic(lambda x: 1.0 + 0.1 * x[0], 0.3, "plane stress")},
    "support": {"supports": [ec.Displacement("top", (0.02, lambda x: -0.05 - 0.01 * x[0] ** 3))]},
    "side": {"supports": [ec.Displacement("left", (0.02, lambda x: -0.05 - 0.01 * x[0] ** 2))]},
    "loads": {"loads": [ec.BodyForce((0.0, -1e-3))]},
    "friction": {
        "contacts": [
            ec.Contact(
                "bottom", friction=lambda x: 0.3 + 0.1 * x[0], gap=lambda x: 0.010000001 * x[0] ** 2
            )
        ]
    },
    "law": {
        "contacts": [
            ec.Contact(
                "bottom",
                friction=ec.Tresca(lambda x: 0.3 + 0.1 * x[0]),
                gap=lambda x: 0.01 * x[0] ** 2,
            )
        ]
    },
    "rows": {"strains": ec.Eigenstrain(lambda x: ((0.01 * x[0], 0.0), (0.0, 0.0)))},
    "other rows": {"strains": ec.Eigenstrain(lambda x: ((0.02 * x[0], 0.0), (0.0, 0.0)))},
    "region": {"strains": ec.Eigenstrain({"a": lambda x: ((0.01 * x[0], 0.0), (0.0, 0.0))})},
    "other region": {"strains": ec.Eigenstrain({"a": lambda x: ((0.02 * x[0], 0.0), (0.0, 0.0))})},
}


def test_runs_go_on_where_iterations_let_round_off_grow(shared_tmp_path):
    """A block that is nearly incompressible takes 248 iterations: eps differs by 6e-6."""
    scene = ec.Scene(
        ec.Elastic(1.0, 0.4999),
        [ec.Displacement("bottom", (0.0, 0.0, 0.0))],
        [ec.Traction("top", lambda x: (0.001 * x[0], 0.0, -0.01))],
    )
    box = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(3, 3, 3))
    arguments = {"accuracy": 0.3, "checkpoint": shared_tmp_path / "run"}
    first = ec.adapt(scene, box, **arguments)
    again = ec.adapt(scene, box, **arguments)
    assert first.best.admissible.tightening > 100
    assert [step.eps for step in again.steps] == [step.eps for step in first.steps]
    assert again.best.relative == pytest.approx(first.best.relative, rel=1e-3)


@pytest.mark.serial
def test_fingerprint_does_not_know_how_many_constants_there_were(monkeypatch):
    """UFL sorts factors by the text of their numbers, in which "1000" comes before "999"."""
    prints = []
    for first in (5, 99, 998, 999):
        monkeypatch.setattr(ufl.Constant, "_counter", itertools.count(first))
        prints.append(fingerprint(changed(), block(2), {}))
    assert all(found == prints[0] for found in prints)


def test_fingerprint_knows_what_decides():
    """Made twice it is the same; each change changes it.

    Numbers in formulas of classes of the user's, too.
    """
    first = fingerprint(changed(), block(2), {"strategy": ec.Mark(0.5)})
    assert first == fingerprint(changed(), block(2), {"strategy": ec.Mark(0.5)})
    others = [
        (changed(**change), block(2), {"strategy": ec.Mark(0.5)}) for change in OTHER.values()
    ]
    others += [
        (changed(), block(3), {"strategy": ec.Mark(0.5)}),
        (changed(), block(2), {"strategy": ec.Mark(0.4)}),
    ]
    laws = [Steeper(0.1, 1.0), Steeper(0.1, 1.1), Steeper(0.2, 1.0)]
    others += [
        (changed(contacts=[ec.Contact("bottom", friction=law)]), block(2), {}) for law in laws
    ]
    found = [COMM.bcast(fingerprint(*other)) for other in others]
    assert all(a != b for i, a in enumerate([first, *found]) for b in found[i:])


def test_another_run_is_refused_with_what_differs(shared_tmp_path):
    ec.adapt(changed(), block(2), 0.5, checkpoint=shared_tmp_path)
    with pytest.raises(
        ec.InputError, match=r"gap is 0.010000001 \* .*in the folder 0.01 \* .*another folder"
    ):
        ec.adapt(changed(**OTHER["friction"]), block(2), 0.5, checkpoint=shared_tmp_path)
    with pytest.raises(ec.InputError, match=r"degree is 2, in the folder 1"):
        ec.adapt(changed(), block(2), 0.5, degree=2, checkpoint=shared_tmp_path)
    with pytest.raises(ec.InputError, match=r"first mesh is .*in the folder 28 cells"):
        ec.adapt(changed(), block(3), 0.5, checkpoint=shared_tmp_path)


def test_geometry_of_the_users_is_refused_before_anything_is_solved(shared_tmp_path):
    class Sphere:
        pass

    domain = block(2)
    own = ec.Domain(domain.mesh, domain.facet_tags, domain.names, geometry=Sphere())
    with pytest.raises(ec.InputError, match=r"cannot keep .* type Sphere"):
        ec.adapt(prototype_block(), own, 0.5, checkpoint=shared_tmp_path / "kept")
    assert not (shared_tmp_path / "kept").exists()
    with pytest.raises(ec.InputError, match="name of a folder"):
        ec.adapt(prototype_block(), domain, 0.5, checkpoint=3)


def test_a_folder_is_that_of_one_run_at_a_time(shared_tmp_path):
    def again(error, step):
        run(of_flat_body, 1, shared_tmp_path)

    assert (
        "belongs to a run that is going on"
        in run(of_flat_body, 1, shared_tmp_path, callback=again).outcome
    )
    again(None, None)


# -- damage
# ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run of three meshes, and its history."""
    folder = tmp_path_factory.mktemp("kept")
    return folder, run(of_flat_body, 3, folder)


@pytest.mark.serial
def test_every_changed_byte_is_found(whole):
    """All bytes of the block in front and 300 others, each with one bit changed.

    Lengths that are missing.
    """
    good = Folder(whole[0]).file(1).read_bytes()
    rng = np.random.default_rng(0)
    assert unpack_level(good).about["dim"] == 2
    for place in [*range(BLOCK), *rng.integers(BLOCK, len(good), 300)]:
        wrong = bytearray(good)
        wrong[place] ^= 1 << int(rng.integers(8))
        with pytest.raises(Damaged):
            unpack_level(bytes(wrong))
    for length in [0, 1, BLOCK, *rng.integers(0, len(good), 100)]:
        with pytest.raises(Damaged):
            unpack_level(good[:length])
    with pytest.raises(Damaged):
        unpack_level(good + b"\0")


@pytest.mark.serial
@pytest.mark.parametrize("number", [1, 2, pytest.param(3, marks=pytest.mark.broad)])
@pytest.mark.parametrize("damage", ["truncated", "emptied", "removed", "one byte"])
def test_a_damaged_run_goes_on_from_its_last_good_level(number, damage, whole, tmp_path, caplog):
    folder = shutil.copytree(whole[0], tmp_path / "kept")
    path = Folder(folder).file(number)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    text = {"truncated": content[:-9], "emptied": b"", "one byte": content}
    path.unlink() if damage == "removed" else path.write_bytes(text[damage])
    again = run(of_flat_body, 3, folder)
    assert [s.cells for s in again.steps] == [s.cells for s in whole[1].steps]
    assert again.column("eps") == pytest.approx(whole[1].column("eps"), rel=1e-8)
    told = [record.getMessage() for record in caplog.records if "left out" in record.getMessage()]
    assert [str(path) in text for text in told] == ([] if damage == "removed" else [True])
    assert path.with_name(path.name + ".damaged").exists() == (number == 3 and damage != "removed")
    assert Folder(folder).read(3).about["rows"][:2] == Folder(whole[0]).read(3).about["rows"][:2]


@pytest.mark.serial
def test_a_newer_format_is_refused(whole, tmp_path, monkeypatch):
    folder = shutil.copytree(whole[0], tmp_path / "kept")
    level = Folder(folder).read(2)
    monkeypatch.setattr(packed, "FORMAT", packed.FORMAT + 1)
    Folder(folder).file(2).write_bytes(b"".join(pack(level)))
    monkeypatch.undo()
    for call in (lambda: run(of_flat_body, 3, folder), lambda: ec.read_history(folder)):
        with pytest.raises(ec.InputError, match=r"level_0002.*format 3.*knows format 2"):
            call()


# -- what ends a run, and what stops it from being kept
# --------------------------------------------------------------


@pytest.mark.broad
def test_every_third_mesh_and_the_last_one(shared_tmp_path):
    history = run(of_flat_body, 5, shared_tmp_path, every=3)
    assert Folder(shared_tmp_path).numbers() == [1, 4, 5]
    again = run(of_flat_body, 6, shared_tmp_path, every=3)
    assert again.steps[:5] == history.steps
    assert len(again.meshes) == 4


@pytest.mark.broad
@pytest.mark.on_ranks("folder removed")
@pytest.mark.parametrize("fault", ["full disk", "folder removed"])
def test_a_run_that_cannot_be_kept_returns_its_result(fault, shared_tmp_path, caplog):
    folder, before = shared_tmp_path / "kept", resource.getrlimit(resource.RLIMIT_FSIZE)

    def happens(error, step):
        if step.cells > 28 and COMM.rank == 0:
            if fault == "full disk":
                resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
            else:
                shutil.rmtree(folder, ignore_errors=True)

    try:
        history = run(of_flat_body, 4, folder, callback=happens)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    same(history, run(of_flat_body, 4))
    told = [
        record.getMessage() for record in caplog.records if "is not kept" in record.getMessage()
    ]
    assert len(told) == (2 if COMM.rank == 0 else 0)
    if fault == "full disk":
        assert Folder(folder).numbers() == [1, 2]
        assert not list(folder.glob("*.part"))
        same(run(of_flat_body, 4, folder), history)


def test_folder_that_cannot_be_written_is_refused_at_once(shared_tmp_path):
    """A file stands where a folder is to be made: no mesh is solved."""
    (shared_tmp_path / "file").touch()
    solved = []
    with pytest.raises(ec.InputError, match="nothing can be written to the folder"):
        run(
            of_flat_body,
            4,
            shared_tmp_path / "file" / "kept",
            callback=lambda error, step: solved.append(step),
        )
    assert not solved


KEPT = """
import sys; sys.path[:0] = {paths!r}
import os
import test_checkpoint as t
from mpi4py import MPI

def tell(error, step):
    pids = MPI.COMM_WORLD.gather(os.getpid())
    if pids:
        print("mesh", *pids, flush=True)

known = t.fingerprint(t.changed(), t.block(2), {{"strategy": t.ec.Mark(0.5)}})
if MPI.COMM_WORLD.rank == 0:
    print("fingerprint", known, flush=True)
t.run(t.{problem}, 40, "kept", callback=tell)
"""


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(("problem", "ranks"), [(of_flat_body, 1), (of_pair, 2)])
def test_killed_runs_go_on(problem, ranks, tmp_path):
    """Kill a run at some moment.

    On one rank it goes on, with other hashes of strings.
    """
    script = KEPT.format(paths=sys.path, problem=problem.__name__)
    with started(script, ranks, tmp_path) as process:
        elsewhere = told(process, "fingerprint")
        pids = [told(process, "mesh") for _ in range(2 + ranks)][-1]
        sleep(float(np.random.default_rng(ranks).uniform(0.0, 0.1)))
        for pid in pids:
            os.kill(int(pid), signal.SIGKILL)
        process.communicate(timeout=20)
    here = fingerprint(changed(), block(2), {"strategy": ec.Mark(0.5)})
    assert elsewhere == str(here).split()
    there = len(Folder(tmp_path / "kept").numbers())
    assert there >= 2 + ranks
    same(run(problem, there + 2, tmp_path / "kept"), run(problem, there + 2))


FACTORS = """
import erc_contact as ec
import os, signal
from petsc4py import PETSc
from erc_contact.base.runtime.sigterm import sigterm_blocked
from erc_contact.model.promises import bind
from erc_contact.newton.linear.mumps import COMPRESSED_FROM, factorise
from erc_contact.newton.linear.stiffness import Stiffness

def glued(domain):
    down = (0.0,) * (domain.dim - 1) + (-0.1,)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", down), contacts=ec.Contact("bottom", friction=0.3))
    elastic = Stiffness(bind(scene, domain, 1))
    matrix = elastic.stiffness()
    elastic.add_glue(matrix)
    return elastic, matrix

small, of_small = glued(ec.box((0.0,) * 3, (1.0,) * 3, cells=(8, 8, 8)))
large, of_large = glued(ec.rectangle((0.0,) * 2, (1.0,) * 2, cells=(230, 230)))
of_large.setOption(PETSc.Mat.Option.SPD, True)
with sigterm_blocked() as held:
    assert held and of_large.getSize()[0] > COMPRESSED_FROM
told = []
signal.signal(signal.SIGTERM, lambda *_: told.append(1))
print("ready", flush=True)
while len(told) < 200:
    for schur_on in (small.layer.numbers, None):
        factorise(of_small, schur_on).destroy()
print("small", flush=True)
before = len(told)
for _ in range(4):
    factor = factorise(of_large, large.layer.numbers)
    schur = factor.schur_complement()
    assert abs(schur - large.schur).max() < 1e-13 * abs(schur).max()
    factor.destroy()
assert len(told) >= before + 4
print("ended", flush=True)
os._exit(0)  # at the usual end PETSc takes the handler away
"""


@pytest.mark.broad
@pytest.mark.serial
def test_signals_do_no_harm_to_a_factorisation(tmp_path):
    """SIGTERM comes at any moment of it, at most 5 ms after the last.

    An ordering by METIS would jump out of the middle of its work; of a large factor
    METIS groups the equations for the compression.
    """
    with started(FACTORS, 1, tmp_path) as process:
        told(process, "ready")
        moments = np.random.default_rng(0)
        while process.poll() is None:
            process.send_signal(signal.SIGTERM)
            sleep(float(moments.uniform(0.0, 0.005)))
        words = output(process, 20).split()
    assert words == ["small", "ended"]


# -- the history without a solve
# -------------------------------------------------------------------------------------


def test_former_names_of_a_solution_are_those_in_its_file():
    """Folders of former versions are read, and scripts that use the names still run."""
    solution = ec.solve(prototype_block(), block(2), ec.Nitsche())
    written = level_of(ec.constitutive_error(ec.equilibrate(solution)), []).about["solution"]
    assert list(written) == ["newton_steps", "reason", "remaining", "regularity", "seconds"]
    assert written["remaining"] == solution.remaining == solution.distance
    assert written["regularity"] == solution.regularity == solution.least_singular_value > 0


def test_history_is_read_without_the_scene(shared_tmp_path):
    history = run(of_regions, 2, shared_tmp_path / "kept")
    read = ec.read_history(shared_tmp_path / "kept")
    assert read.steps == history.steps
    assert str(read).splitlines()[:-1] == str(history).splitlines()[:-1]
    assert (read.error.relative, read.accuracy, read.reached) == (
        history.error.relative,
        0.01,
        False,
    )
    total = COMM.allreduce(float(np.sum(read.error.indicators**2)), MPI.SUM)
    assert total == pytest.approx(history.error.relative**2, rel=1e-12)
    assert [d.cells for d, _ in read.meshes] == [d.cells for d, _ in history.meshes]
    with pytest.raises(ec.InputError, match=r"'force' .*needs the scene: call adapt"):
        read.force("bottom")
    read.save(shared_tmp_path / "read")
    write_fields(history.best, shared_tmp_path / "saved")
    COMM.barrier()
    if COMM.rank == 0:
        import pyvista

        names = {path.name for path in (shared_tmp_path / "read").iterdir()}
        files = {
            "report.html",
            "history.csv",
            "history.json",
            "body.vtkhdf",
            "meshes.vtkhdf",
        }
        assert names == files
        a, b = (pyvista.read(shared_tmp_path / name / "body.vtkhdf") for name in ("read", "saved"))
        assert np.allclose(a.points, b.points, rtol=0, atol=1e-15)
        for name, values in [*b.point_data.items(), *b.cell_data.items()]:
            assert np.allclose({**a.point_data, **a.cell_data}[name], values, rtol=1e-6, atol=0), (
                name
            )
        assert np.array_equal(a.cell_connectivity, b.cell_connectivity)
    with pytest.raises(ec.InputError, match="no folder"):
        ec.read_history(shared_tmp_path / "nowhere")
    with pytest.raises(ec.InputError, match="no mesh of a run"):
        ec.read_history(shared_tmp_path / "read")
