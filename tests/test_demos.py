"""Every demo runs as a user would run it, and leaves the files that it says; under mpiexec those that say so."""

import runpy
from pathlib import Path

from mpi4py import MPI
from processes import ROOT, run_as_user

DEMOS = sorted((ROOT / "demos").glob("*.py"))
CHOSEN = [demo for demo in DEMOS if MPI.COMM_WORLD.size == 1 or "mpirun -n 2" in demo.read_text()]


def test_demos(shared_tmp_path, monkeypatch):
    """All in one process of each rank, which is this file as a script."""
    assert CHOSEN
    run_as_user(Path(__file__), shared_tmp_path, monkeypatch)
    MPI.COMM_WORLD.barrier()
    for demo in CHOSEN:
        if "history.save" in demo.read_text():
            written = {path.name for path in (shared_tmp_path / "results" / demo.stem).iterdir()}
            assert {"history.csv", "error.png", "meshes.png", "error_map.png", "deformed.png"} <= written


if __name__ == "__main__":
    for each in CHOSEN:
        runpy.run_path(str(each), run_name="__main__")
