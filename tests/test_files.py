"""Mesh files of others come in: cells of any shape, sets by their names.

- A collection of files of every kind: volume, parts and regions are right to round-off.
"""

import pytest
from file_collection import CASES
from mpi4py import MPI

import erc_contact as ec

COMM = MPI.COMM_WORLD


def made(case, folder):
    """The path of the file of a case, which rank 0 or all ranks make."""
    path = case.make(folder) if case.collective or COMM.rank == 0 else None
    return COMM.bcast(path)


@pytest.mark.on_ranks("inp of hexahedron, sides by faces", "gmsh hexahedra in 2D, .med")
@pytest.mark.parametrize("name", CASES)
def test_a_file_comes_in_with_its_sets(name, shared_tmp_path, measures):
    case = CASES[name]
    path = made(case, shared_tmp_path)
    domain = ec.read_mesh(path)
    assert domain.dim == case.dim
    assert measures.region(domain) == pytest.approx(2.0, rel=1e-6)
    assert {part: measures.part(domain, part) for part in domain.names} == pytest.approx(
        case.parts, rel=1e-6
    )
    found = {region: measures.region(domain, region) for region in domain.regions}
    assert found == pytest.approx(case.regions, rel=1e-6)
