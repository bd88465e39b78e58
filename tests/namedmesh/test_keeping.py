"""Domains in files: on any ranks, what was written is read; what is no such file is refused.

- Names, pairs and true shape come back, on the same ranks and on others.
- The rules that named a part are given again, and ask where the shape is meshed anew.
- Files that are damaged, of a newer version or make no sense are told apart, in words.
"""

import numpy as np
import pytest
from domains import COMM, two_halves
from mpi4py import MPI

import namedmesh as nm
from namedmesh.keeping import check_domain, pack, packed, unpack


@pytest.mark.on_ranks("split")
@pytest.mark.parametrize("kind", ["plain", "split"])
def test_domains_are_written_and_read(kind, shared_tmp_path):
    domain = two_halves(nm.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 8)))
    if kind == "split":
        domain = domain.split({"above": "upper", "below": "lower"})
    nm.write_domain(domain, shared_tmp_path / "domain.vtkhdf")
    read = nm.read_domain(shared_tmp_path / "domain.vtkhdf", domain.comm)
    assert read.cells == domain.cells
    assert read.pairs == domain.pairs
    assert dict(read.names) == dict(domain.names)
    assert read.geometry == domain.geometry
    assert str(read.parts()) == str(domain.parts())


@pytest.mark.serial
@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"erc_contact level, format 2\n"])
def test_other_files_are_refused(content, tmp_path):
    path = tmp_path / "domain.vtkhdf"
    path.write_bytes(content)
    with pytest.raises(nm.InputError, match="damaged"):
        nm.read_domain(path)
    with pytest.raises(nm.InputError, match="cannot be read"):
        nm.read_domain(tmp_path / "nothing")


@pytest.mark.ranks
def test_all_ranks_read_what_one_rank_wrote(shared_tmp_path):
    def whole(comm):
        halves = two_halves(nm.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 8), comm=comm))
        return halves.split({"above": "upper", "below": "lower"})

    path = shared_tmp_path / "domain.vtkhdf"
    if COMM.rank == 0:
        nm.write_domain(whole(MPI.COMM_SELF), path)
    COMM.barrier()
    read = nm.read_domain(path)
    assert str(read.parts()) == str(whole(COMM).parts())
    assert read.refined().cells == whole(COMM).refined().cells


def test_rules_are_given_again(shared_tmp_path):
    """The named part is on a new mesh if its rule is given."""
    rules = {"foot": nm.where(y=0.0)}
    domain = nm.rectangle((0.0, 0.0), (2.0, 1.0), size=0.5).named(rules)
    path = shared_tmp_path / "domain.vtkhdf"
    nm.write_domain(domain, path)
    read = nm.read_domain(path, rules=[(rules, {})])
    assert repr(read) == repr(domain)
    for like in (domain, read):
        area = like.remeshed(0.2).parts()
        assert area["area"][area.name.index("foot")] == pytest.approx(2.0, rel=1e-12)


@pytest.mark.serial
def test_a_newer_format_and_nonsense_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "domain.vtkhdf"
    nm.write_domain(nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)), path)
    contents = unpack(path.read_bytes(), check_domain, "file of a domain")
    monkeypatch.setattr(packed, "FORMAT", packed.FORMAT + 1)
    path.write_bytes(b"".join(pack(contents)))
    monkeypatch.undo()
    with pytest.raises(nm.InputError, match=r"domain.vtkhdf.*format 3.*knows format 2"):
        nm.read_domain(path)
    contents.tables["cells"] = np.zeros_like(contents.tables["cells"])
    path.write_bytes(b"".join(pack(contents)))
    with pytest.raises(nm.InputError, match=r"no file of a domain .*the cells make no sense"):
        nm.read_domain(path)
