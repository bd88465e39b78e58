"""Every demo runs as a user would run it, in serial and under mpiexec, and leaves the files that it says."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial
ROOT = Path(__file__).parent.parent
DEMOS = sorted((ROOT / "demos").glob("*.py"))


@pytest.mark.parametrize("demo", DEMOS, ids=lambda path: path.stem)
@pytest.mark.parametrize("ranks", [1, 2])
def test_demo(demo, ranks, tmp_path):
    launch = [] if ranks == 1 else [str(Path(sys.executable).parent / "mpiexec"), "-n", str(ranks)]
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PMI", "MPI"))}
    run = subprocess.run(
        [*launch, sys.executable, str(demo)],
        cwd=tmp_path,
        env=environment | {"OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    if "history.save" not in demo.read_text():
        return
    written = {path.name for path in (tmp_path / "results" / demo.stem).iterdir()}
    assert {"history.csv", "error.png", "meshes.png", "error_map.png", "deformed.png"} <= written
