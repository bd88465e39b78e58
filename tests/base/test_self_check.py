"""``erc-contact check``, or ``python -m erc_contact``.

It tells what is installed, and its check passes here and can fail.
"""

from importlib import metadata

import dolfinx
import pytest
from mpi4py import MPI

from erc_contact.__main__ import main
from erc_contact.command import check


def test_tells_versions_and_passes(capsys):
    assert main([]) == 0
    told = capsys.readouterr().out
    if MPI.COMM_WORLD.rank == 0:
        assert f"DOLFINx     {dolfinx.__version__}" in told
        assert metadata.version("numpy") in told
        assert "Self-check passed" in told
    else:
        assert not told


@pytest.mark.serial
def test_a_property_that_fails_is_told(capsys, monkeypatch):
    monkeypatch.setattr(check, "UNBALANCED_FORCE", 0.0)
    assert main(["check"]) == 1
    if MPI.COMM_WORLD.rank == 0:
        assert "FAILED: the forces are in balance" in capsys.readouterr().out
