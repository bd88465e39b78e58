"""Every demo runs as a user would run it, and leaves the files that it says; under mpiexec those that say so too."""

import subprocess
import sys
from pathlib import Path

import pytest
from processes import ROOT, environment

pytestmark = pytest.mark.serial
DEMOS = sorted((ROOT / "demos").glob("*.py"))
RUNS = [(1, demo) for demo in DEMOS] + [(2, demo) for demo in DEMOS if "mpirun -n 2" in demo.read_text()]


@pytest.mark.parametrize(("ranks", "demo"), RUNS, ids=lambda run: getattr(run, "stem", run))
def test_demo(ranks, demo, tmp_path):
    launch = [] if ranks == 1 else [str(Path(sys.executable).parent / "mpiexec"), "-n", str(ranks)]
    run = subprocess.run(
        [*launch, sys.executable, str(demo)],
        cwd=tmp_path,
        env=environment(),
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
