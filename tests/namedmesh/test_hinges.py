"""Bodies that meet at a vertex or an edge alone.

In elasticity such a hinge transmits no force. So the cells there have nodes of their
own, on any number of ranks and after refinement; what is then not held is refused, with
the place, and what is held is solved and in balance.
"""

import logging
import re

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import certified

import erc_contact as ec
from namedmesh.base.releases import cell_nodes
from namedmesh.copies import is_pinched
from namedmesh.partition import distribute

COMM = MPI.COMM_WORLD


def bricks(d: int, places: list[tuple[int, ...]], *, merged: bool = True) -> ec.Domain:
    """Unit bricks in one mesh, whose lower corners are at places; each is a region.

    Without ``merged`` each has nodes of its own.
    """
    brick = ec.rectangle if d == 2 else ec.box
    unit = brick((0.0,) * d, (1.0,) * d, cells=(2,) * d, comm=MPI.COMM_SELF)
    x = unit.mesh.geometry.x[:, :d]
    cells = cell_nodes(unit.mesh.geometry)
    points = np.concatenate([x + np.array(place) for place in places])
    all_cells = np.concatenate([cells + len(x) * i for i in range(len(places))])
    if merged:
        points, number = np.unique(points.round(6), axis=0, return_inverse=True)
        all_cells = number.ravel()[all_cells]
    if COMM.rank > 0:
        points, all_cells = points[:0], all_cells[:0]
    mesh = distribute(COMM, all_cells.astype(np.int64), points)
    mesh.topology.create_connectivity(d - 1, d)
    facets = dmesh.exterior_facet_indices(mesh.topology)
    middles = dmesh.compute_midpoints(mesh, d - 1, facets)
    low = np.array([min(place[-1] for place in places)])
    high = np.array([max(place[-1] for place in places) + 1])
    tags = np.where(abs(middles[:, d - 1] - low) < 1e-9, 1, 0)
    tags[abs(middles[:, d - 1] - high) < 1e-9] = 2
    tagged = dmesh.meshtags(mesh, d - 1, facets[tags > 0], tags[tags > 0].astype(np.int32))
    index_map = mesh.topology.index_map(d)
    numbers = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    centres = dmesh.compute_midpoints(mesh, d, numbers)[:, :d]
    place_of = [np.abs(centres - np.array(place) - 0.5).max(axis=1) < 0.5 for place in places]
    regions = dmesh.meshtags(mesh, d, numbers, np.argmax(place_of, axis=0).astype(np.int32) + 1)
    names = {f"body {i}": i + 1 for i in range(len(places))}
    return ec.Domain(mesh, tagged, {"floor": 1, "roof": 2}, regions, names)


CASES = {
    "vertex": (2, [(0, 0), (1, 1)]),
    "edge": (3, [(0, 0, 0), (1, 0, 1)]),
    "vertex in 3D": (3, [(0, 0, 0), (1, 1, 1)]),
}


@pytest.mark.parametrize("name", CASES)
def test_what_hangs_on_a_hinge_is_told(name):
    d, places = CASES[name]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        ec.Displacement("floor", (0.0,) * d),
        ec.Traction("roof", (0.01, *(0.0,) * (d - 1))),
    )
    domain = bricks(d, places)
    place = r"\(1, 1\)" if d == 2 else r"\(1, \d(\.\d)?, 1\)"
    for _ in range(2):
        with pytest.raises(ec.NotHeldError, match=rf"rotation.*'roof'.*touches.* at {place}"):
            ec.solve(scene, domain)
        with pytest.raises(ec.InputError, match=rf"share no facet.* touch at {place}.* alone"):
            domain.split({"here": "body 0", "there": "body 1"})
        domain = domain.refined()


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", CASES)
def test_what_is_held_besides_is_solved(name, degree):
    """As two bodies: each is in balance with its own support."""
    d, places = CASES[name]
    down = (*(0.0,) * (d - 1), -0.01)
    supports = [ec.Displacement("floor", (0.0,) * d), ec.Displacement("roof", (0.0,) * d)]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, ec.BodyForce(down))
    error = certified(scene, bricks(d, places), degree=degree)
    reactions = error.reactions()
    for part in ("floor", "roof"):
        assert reactions[part].force == pytest.approx(-np.array(down), abs=1e-12 * 0.01)
    assert error.admissible.imbalance < 1e-12
    alone = bricks(d, places[:1])
    floor = ec.Scene(ec.Elastic(1.0, 0.3), supports[0], ec.BodyForce(down))
    one = certified(floor, alone, degree=degree)
    if d == 2:
        # The upper body is the lower one, turned by half a turn, hanging.
        assert error.relative == pytest.approx(one.relative, rel=0.3)


@pytest.mark.parametrize("name", CASES)
def test_a_torn_mesh_stays_torn(name):
    """Refined meshes are not searched for hinges again: there are none."""
    d, places = CASES[name]
    domain = bricks(d, places)
    rng = np.random.default_rng(5)
    for _ in range(3):
        marked = np.flatnonzero(rng.random(domain.owned_cells) < 0.3).astype(np.int32)
        domain = domain.refined(marked)
        assert not is_pinched(domain.mesh)


def test_a_ring_that_touches_itself():
    """Eight bricks around a hole, one left out: two of them meet at a vertex of the same body."""
    ring = [(0, 0), (1, 0), (2, 0), (2, 1), (1, 2), (0, 2), (0, 1)]
    domain = bricks(2, ring)
    supports = ec.Displacement("floor", (0.0, 0.0))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, ec.Traction("roof", (0.001, -0.001)))
    error = certified(scene, domain)
    assert error.reactions()["floor"].force == pytest.approx([-0.002, 0.002], abs=1e-14)
    assert error.admissible.imbalance < 1e-12
    x = domain.mesh.geometry.x[:, :2]
    at_hinge = np.linalg.norm(x - np.array([2.0, 2.0]), axis=1) < 1e-9
    owned = domain.mesh.geometry.index_map().size_local
    assert COMM.allreduce(int(at_hinge[:owned].sum())) == 2


@pytest.mark.parametrize("d", [2, 3])
def test_pieces_that_lie_on_each_other_are_told_once(d, caplog):
    """Whether both are held, or one is loose; what shares its nodes says nothing."""
    caplog.set_level(logging.WARNING, logger="namedmesh")
    floor = ec.Displacement("floor", (0.0,) * d)
    roof = ec.Displacement("roof", (*(0.0,) * (d - 1), -0.02))
    places = [(0,) * d, (*(0,) * (d - 1), 1)]
    pieces = bricks(d, places, merged=False)
    facets = 2 if d == 2 else 8
    words = rf"{facets} facets of two bodies lie on each other .* middles \(.*, 1\)"
    held = ec.Scene(ec.Elastic(1.0, 0.3), [floor, roof])
    for domain, count in ((pieces, 1), (bricks(d, places), 0)):
        caplog.clear()
        ec.adapt(held, domain, accuracy=1e-9, max_steps=2, strategy=ec.Uniform())
        told = [record.getMessage() for record in caplog.records if "lie on" in record.getMessage()]
        assert len(told) == (count if COMM.rank == 0 else 0)
        if told:
            assert re.search(words, told[0])
    push = ec.Traction("roof", (*(0.0,) * (d - 1), -0.01))
    with pytest.raises(ec.NotHeldError, match=words):
        ec.solve(ec.Scene(ec.Elastic(1.0, 0.3), floor, push), pieces)
