"""Every demo runs as a user would run it, and leaves the files that it says; under mpiexec those that say so."""

import pytest
from mpi4py import MPI
from processes import ROOT, run_as_user
from scenes import mostly_serial

DEMOS = sorted((ROOT / "demos").glob("*.py"))
ON_RANKS = [demo for demo in DEMOS if "mpirun -n 2" in demo.read_text()]


@pytest.mark.parametrize("demo", mostly_serial(DEMOS, ON_RANKS), ids=lambda demo: demo.stem)
def test_demo(demo, shared_tmp_path, monkeypatch):
    run_as_user(demo, shared_tmp_path, monkeypatch)
    MPI.COMM_WORLD.barrier()
    if "history.save" not in demo.read_text():
        return
    written = {path.name for path in (shared_tmp_path / "results" / demo.stem).iterdir()}
    assert {"history.csv", "error.png", "meshes.png", "error_map.png", "deformed.png"} <= written
