"""namedmesh without erc_contact: meshes with names, on ranks, where nothing else can be imported.

- Rectangles, boxes, files and assemblies become domains; they are named, split, joined, refined
  and meshed again, and their measures stay.
- They are written, read and drawn.
- Its tests run where erc_contact cannot be imported.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from processes import ROOT, environment

pytestmark = pytest.mark.serial
SCRIPT = """
import sys
sys.modules["erc_contact"] = None  # an import of it fails
import numpy as np
import namedmesh as nm
from mpi4py import MPI

comm = MPI.COMM_WORLD
block = nm.rectangle((0.0, 0.0), (2.0, 1.0), size=0.5)
named = block.named({"foot": nm.where(y=0.0)})
fine = named.refined()
assert "foot" in fine.names
counts = [comm.allreduce(len(domain.owned_facets("foot"))) for domain in (named, fine)]
assert counts[1] == 2 * counts[0]
bodies = {"upper": nm.rectangle((0.0, 1.0), (2.0, 2.0), cells=(3, 2)), "lower": block}
both = nm.assembly(bodies).joined("upper bottom", "lower top")
assert both.pairs == (("upper bottom", "lower top"),)
again = both.remeshed(0.3)
assert again.pairs == both.pairs
read = nm.read_mesh(sys.argv[1], scripts=True)
assert len(read.names) > 1
assert nm.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 2)).refined().dim == 3
nm.write_domain(both, "both.vtkhdf")
kept = nm.read_domain("both.vtkhdf")
assert repr(kept) == repr(both)
for domain, picture in ((kept, "flat.png"), (nm.box((0.0,) * 3, (1.0,) * 3, cells=(1, 1, 1)), "box.png")):
    axes = nm.draw_parts(domain, picture)
    assert (axes is None) == (comm.rank > 0)
try:
    block.tag("nowhere")
except nm.NamedMeshError as reason:
    assert "nowhere" in str(reason)
else:
    raise AssertionError
loaded = [name for name in sys.modules if name.split(".")[0] == "erc_contact"]
assert loaded == ["erc_contact"], loaded
print("done")
"""


@pytest.mark.broad
@pytest.mark.parametrize("ranks", [1, 2])
def test_all_of_it_works_alone(ranks, tmp_path):
    script = tmp_path / "alone.py"
    script.write_text(SCRIPT)
    mesh = ROOT / "meshes" / "half_disc.geo"
    mpiexec = Path(sys.executable).parent / "mpiexec"
    start = [str(mpiexec), "-n", str(ranks)] if ranks > 1 else []
    run = subprocess.run(
        [*start, sys.executable, str(script), str(mesh)],
        capture_output=True,
        text=True,
        timeout=120,
        env=environment(),
        cwd=tmp_path,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("done") == ranks
    for name in ("flat.png", "box.png"):
        assert (tmp_path / name).read_bytes()[:4] == b"\x89PNG"


COLLECT = """
import sys
sys.modules["erc_contact"] = None
import pytest
sys.exit(pytest.main(["--noconftest", "--collect-only", "-p", "no:cacheprovider", sys.argv[1]]))
"""


def test_its_tests_import_nothing_else():
    """In the tests, too, no import of erc_contact works, see conftest.py."""
    run = subprocess.run(
        [sys.executable, "-c", COLLECT, str(ROOT / "tests" / "namedmesh")],
        capture_output=True,
        text=True,
        timeout=120,
        env=environment(),
        cwd=ROOT,
        check=False,
    )
    assert run.returncode == 0, run.stdout
