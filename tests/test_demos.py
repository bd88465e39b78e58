"""Every demo runs as a user would run it, and leaves the files that it says; under mpiexec those that say so too."""

import pytest
from processes import ROOT, launched, output

pytestmark = pytest.mark.serial
DEMOS = sorted((ROOT / "demos").glob("*.py"))
RUNS = [(1, demo) for demo in DEMOS] + [(2, demo) for demo in DEMOS if "mpirun -n 2" in demo.read_text()]


@pytest.mark.parametrize(("ranks", "demo"), RUNS, ids=lambda run: getattr(run, "stem", run))
def test_demo(ranks, demo, tmp_path):
    output(launched(demo, ranks, tmp_path), 300)
    if "history.save" not in demo.read_text():
        return
    written = {path.name for path in (tmp_path / "results" / demo.stem).iterdir()}
    assert {"history.csv", "error.png", "meshes.png", "error_map.png", "deformed.png"} <= written
