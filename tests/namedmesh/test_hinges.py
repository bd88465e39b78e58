"""Bodies that meet at a vertex or an edge alone.

In elasticity such a hinge transmits no force. So the cells there have nodes of their
own, on any number of ranks and after refinement. What hangs on them under loads is in
tests/model/test_hinged_bodies.py.
"""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

import namedmesh as nm
from namedmesh.base.releases import cell_nodes
from namedmesh.copies import is_pinched
from namedmesh.partition import distribute

COMM = MPI.COMM_WORLD


def bricks(d: int, places: list[tuple[int, ...]], *, merged: bool = True) -> nm.Domain:
    """Unit bricks in one mesh, whose lower corners are at places; each is a region.

    Without ``merged`` each has nodes of its own.
    """
    brick = nm.rectangle if d == 2 else nm.box
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
    return nm.Domain(mesh, tagged, {"floor": 1, "roof": 2}, regions, names)


CASES = {
    "vertex": (2, [(0, 0), (1, 1)]),
    "edge": (3, [(0, 0, 0), (1, 0, 1)]),
    "vertex in 3D": (3, [(0, 0, 0), (1, 1, 1)]),
}


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
