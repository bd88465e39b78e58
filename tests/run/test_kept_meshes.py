"""Runs whose folders keep domains: rules, pairs and names come back, and other sides are another run."""

import os

import h5py
import numpy as np
import pytest
import ufl
from mpi4py import MPI
from test_domain import near
from test_drawings import middle, write
from test_named import area_of, close
from test_split import COMM, SIDES, assert_paired, layers

import erc_contact as ec
from namedmesh.base.releases import cell_nodes


@pytest.mark.serial
def test_root_of_a_coordinate_stays_finite_on_refined_meshes():
    """sqrt(y) on a side at y = 0."""
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.0, -0.01))],
        [ec.Traction("right", (lambda x: -1e-3 * ufl.sqrt(x[1]), 0.0))],
        [ec.Contact("bottom", friction=lambda x: 0.1 + ufl.sqrt(x[1]))],
    )
    history = ec.adapt(
        scene, ec.rectangle((0.0, 0.0), (1.7, 1.0), cells=(4, 3)), accuracy=1e-6, max_steps=3
    )
    assert len(history.steps) == 3, history.outcome


def test_checkpoints_keep_apart_what_touches_at_a_point(shared_tmp_path):
    def corner(occ):
        occ.addRectangle(0, 0, 0, 1, 1)
        occ.addRectangle(1, 1, 0, 1, 1)

    bodies = ec.read_mesh(write(shared_tmp_path / "corner.brep", corner), size=0.5)
    heights = {name: middle(bodies, name)[1] for name in bodies.names}
    low, high = (pick(heights, key=heights.get) for pick in (min, max))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), [ec.Displacement(name, (0.0, 0.0)) for name in (low, high)]
    )
    history = ec.adapt(scene, bodies, accuracy=0.5, checkpoint=shared_tmp_path / "run")
    again = ec.adapt(scene, bodies, accuracy=0.5, checkpoint=shared_tmp_path / "run")
    for run in (history, again):
        domain = run.best.domain
        first, second = (domain.region(name) for name in domain.regions)
        nodes = cell_nodes(domain.mesh.geometry)
        assert not np.isin(nodes[first], nodes[second]).any()


@pytest.mark.broad
@pytest.mark.serial
def test_a_run_writes_inside_its_folder_whatever_parts_are_called(tmp_path, monkeypatch):
    """Table, fields, report and pictures of contacts with names that act, escape or are too long."""
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1))
    called = {"bottom": "x/../../../up", "left": f"$\\frac{{{'a' * 300}", "right": '"\n\0)'}
    names = {called.get(name, name): tag for name, tag in block.names.items()}
    block = ec.Domain(block.mesh, block.facet_tags, names)
    contacts = [ec.Contact(name, friction=0.2) for name in called.values()]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.0, -0.02)), contacts=contacts)
    history = ec.adapt(scene, block, accuracy=0.9)
    folder = tmp_path / "inside"
    folder.mkdir()
    monkeypatch.chdir(folder)
    before = set(tmp_path.rglob("*"))
    history.save("saved", pictures=True)
    made = set(tmp_path.rglob("*")) - before
    assert all(path.parent == folder / "saved" for path in made - {folder / "saved"})
    assert all(len(os.fsencode(path.name)) < 100 for path in made)
    assert {path.suffix for path in made} >= {".csv", ".vtkhdf", ".png", ".html"}
    (file,) = (folder / "saved").glob("contact_x-up-*.vtkhdf")
    with h5py.File(file) as whole:
        assert whole["part"].asstr()[()] == called["bottom"]


@pytest.mark.broad
def test_a_kept_run_goes_on_with_its_rules(shared_tmp_path):
    def domain():
        return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)).named({"foot": ec.where(y=0.0)})

    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), [ec.Displacement("top", (0.02, -0.05))], contacts=ec.Contact("foot")
    )

    def run(steps):
        return ec.adapt(
            scene,
            domain(),
            1e-3,
            strategy=ec.SizeMap(),
            max_steps=steps,
            checkpoint=shared_tmp_path,
        )

    run(2)
    last = run(3)
    assert len(last.steps) == 3
    close(area_of(last.error.domain), foot=1.0)
    assert list(ec.read_history(shared_tmp_path).error.domain.names) == list(domain().names)


def two_layers(comm=COMM):
    """Two layers that do not feel each other yet, the lower one on a rigid foundation."""
    scene = ec.Scene(
        ec.Elastic({"upper": 1.0, "lower": 2.0}, 0.3),
        [ec.Displacement("top", (0.0, -0.05)), ec.Displacement("left", (0.0, None))],
        loads=[ec.Traction("block", (0.0, -0.1))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    return scene, layers(2, comm).split(SIDES)


def adapted(meshes, folder, comm=COMM):
    scene, domain = two_layers(comm)
    return ec.adapt(scene, domain, 0.01, max_steps=meshes, checkpoint=folder, method=ec.Nitsche())


@pytest.mark.broad
def test_a_checkpoint_keeps_a_split_domain(shared_tmp_path):
    folder = shared_tmp_path / "run"
    whole = adapted(3, None)
    if COMM.rank == 0:
        adapted(1, folder, MPI.COMM_SELF)
    COMM.barrier()
    adapted(2, folder)
    kept = ec.read_history(folder)
    again = adapted(3, folder)
    assert [step.cells for step in again.steps] == [step.cells for step in whole.steps]
    assert again.best.relative == pytest.approx(whole.best.relative, rel=1e-8)
    for history, reference in ((again, whole), (kept, whole)):
        for (domain, _), (other, _) in zip(history.meshes, reference.meshes, strict=False):
            assert domain.pairs == other.pairs
            assert repr(domain) == repr(other)
            assert domain.vertices == other.vertices
            assert domain.glued.vertices == other.glued.vertices
            assert_paired(domain)
            finer = domain.refined(near(domain, np.array((0.0, 0.5)), 0.4))
            expected = other.refined(near(other, np.array((0.0, 0.5)), 0.4))
            assert repr(finer) == repr(expected)


def test_a_checkpoint_of_the_same_sides_the_other_way_round_is_another_run(shared_tmp_path):
    scene, domain = two_layers()
    scene = ec.Scene(scene.material, scene.supports, contacts=scene.contacts)
    settings = {"max_steps": 1, "checkpoint": shared_tmp_path, "method": ec.Nitsche()}
    ec.adapt(scene, domain, 0.01, **settings)
    turned = domain.glued.split({"punch": "lower", "block": "upper"})
    with pytest.raises(ec.InputError, match="another run"):
        ec.adapt(scene, turned, 0.01, **settings)
