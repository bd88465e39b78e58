"""What tests of domains share: no erc_contact is imported here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

import namedmesh as nm

COMM = MPI.COMM_WORLD


def refused(call, *words, error=nm.InputError):
    """Every rank raises ``error`` with all words in its message; collective."""
    try:
        call()
        got = None
    except Exception as reason:
        got = reason
    kinds = COMM.allgather(type(got).__name__)
    assert len(set(kinds)) == 1, f"ranks ended differently: {kinds}"
    assert isinstance(got, error), f"{got!r}"
    missing = [word for word in words if word not in str(got)]
    assert not missing, f"{missing} not in: {got}"


def partly_broad(cases: Iterable, broad: Sequence) -> list:
    """Parameters of a test, some of them left to the broad suite."""
    return [
        pytest.param(case, marks=pytest.mark.broad) if case in broad else case for case in cases
    ]


def two_materials(extent: np.ndarray, size: float, comm: MPI.Comm) -> nm.Domain:
    """A brick whose lower and upper halves are two regions, meshed by gmsh."""
    make = nm.rectangle if len(extent) == 2 else nm.box
    return two_halves(
        make((0.0,) * len(extent), tuple(extent), size=size, comm=comm),
        len(extent) - 1,
        extent[-1] / 2,
    )


def two_halves(domain: nm.Domain, axis: int = 1, at: float = 0.5) -> nm.Domain:
    """The same domain with its cells in two regions, lower and upper."""
    mesh, d = domain.mesh, domain.dim
    cells = mesh.topology.index_map(d)
    every = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    upper = dmesh.compute_midpoints(mesh, d, every)[:, axis] > at
    tags = dmesh.meshtags(mesh, d, every, np.where(upper, 2, 1).astype(np.int32))
    return nm.Domain(mesh, domain.facet_tags, domain.names, tags, {"lower": 1, "upper": 2})
