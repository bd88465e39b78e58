"""Tests run in serial and under mpiexec: what both need.

Under mpiexec every rank runs every test. Rank 0 reports; the other ranks are silent
unless a test fails there, and then say so on stderr and end with an exit code of their
own, so that mpiexec fails. A test that ends on one rank and not on another aborts the
run. Tests marked ``serial`` are left out; on one rank those marked ``ranks`` are. Tests
marked ``broad`` are left out unless asked for by ``-m broad``: random families, long
runs and comparisons. So are cases of other tests whose values of parameters are all in
other cases. Of a test marked ``on_ranks`` only the named cases run, one for each way in
which ranks work together; the others differ in what no rank sees. Of a test marked ``pairs`` run so
many cases that any two values of two of its parameters meet in one of them; a case
that is asked for by its name runs always. The demos, marked ``gallery``, run only if
asked for, by ``-m gallery``.

Under pytest-xdist each worker is a process of one rank. Workers share the cache of
compiled forms: one may wait for a form that another compiles.

In the first run some hundred forms are compiled. How the C compiler is called for them
stands in ``form_libraries.py``. UFL makes millions of small objects; Python looks for
cycles among them less often here, which takes a twentieth less.
"""

import gc
import os
import shutil
import signal
import sys
import tempfile
from itertools import combinations_with_replacement
from pathlib import Path
from time import monotonic, sleep
from zlib import crc32

os.environ["MPLBACKEND"] = "Agg"

import bytecode  # noqa: F401, I001 - before all that takes long to import
import erc_contact as ec  # it orders MPI before the compiled modules, so it comes first

import numpy as np
import form_libraries
import pytest
from dolfinx import jit
from mpi4py import MPI

from namedmesh.base.releases import cell_nodes
from namedmesh.pictures import views

COMM = MPI.COMM_WORLD
gc.set_threshold(100_000, 20, 50)
jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"] = (
    30,
    "seconds that one process waits for a form that another compiles",
)
form_libraries.install()
form_libraries.repair()
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell starts a process in the background so, and all that the process starts.
    # Runs that tests interrupt would go on for ever.
    signal.signal(signal.SIGINT, signal.default_int_handler)


PATIENCE = 60.0
"""Once a rank has ended a test, the others have this long before all ranks are aborted [s]."""


class Ranks:
    """Under mpiexec.

    A rank says at once what failed on it, and no rank waits for ever for one that
    failed.
    """

    comm = COMM.Dup()

    def pytest_runtest_logreport(self, report):
        """Tell of a failure; after each test, wait for the other ranks."""
        if report.failed:
            self.tell(
                f"{report.nodeid} failed in {getattr(report, 'when', 'collection')}:\n{report.longreprtext}"
            )
        if getattr(report, "when", None) == "teardown":
            started, request = monotonic(), self.comm.Ibarrier()
            while not request.Test():
                if monotonic() - started > PATIENCE:
                    self.tell(
                        f"{report.nodeid} ended here, but another rank is still in it: deadlock, all ranks abort."
                    )
                    self.comm.Abort(1)
                sleep(1e-4)

    def pytest_collectreport(self, report):
        """Tell of a file that cannot be collected."""
        self.pytest_runtest_logreport(report)

    def tell(self, text):
        """Write to stderr."""
        sys.stderr.write(f"\n[rank {COMM.rank}] {text}\n")
        sys.stderr.flush()


def pytest_addoption(parser):
    parser.addoption(
        "--part", metavar="K/N", help="of the tests, those of the K-th of N parts, K from 0"
    )


@pytest.hookimpl(trylast=True)
def pytest_configure(config):
    if COMM.rank > 0:
        reporter = config.pluginmanager.getplugin("terminalreporter")
        reporter._tw._file = Path(os.devnull).open("w")  # noqa: SIM115 - open as long as the process
    if COMM.size > 1:
        config.pluginmanager.register(Ranks(), "ranks")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    out = set()
    if COMM.size > 1:
        out.update(cases_left_out(items))
    by_name = any("::" in argument for argument in config.args)
    if not by_name:
        raise_if_unknown(items)
        out.update(cases_beyond(items, pairs_of, "pairs"))
        shorter = [
            item for item in items if item not in out and not item.get_closest_marker("ranks")
        ]
        for item in cases_beyond(shorter, values_of):
            item.add_marker("broad")
    left_out = ["serial" if COMM.size > 1 else "ranks"]
    if "gallery" not in config.option.markexpr:
        left_out.append("gallery")
    if "broad" not in config.option.markexpr and not by_name:
        left_out.append("broad")
    out.update(item for item in items if any(item.get_closest_marker(mark) for mark in left_out))
    if config.option.part:
        number, count = map(int, config.option.part.split("/"))
        out.update(item for item in items if crc32(test_of(item).encode()) % count != number)
    config.hook.pytest_deselected(items=[item for item in items if item in out])
    items[:] = [item for item in items if item not in out]


def pytest_collection_finish(session):
    """Let Python look no more for cycles among modules and tests, which all stay."""
    gc.collect()
    gc.freeze()


def test_of(item):
    """Return the name of the test of which this is a case."""
    return item.nodeid.split("[")[0]


def cases_left_out(items):
    """Return the cases that a mark ``on_ranks`` does not name."""
    for item in items:
        mark = item.get_closest_marker("on_ranks")
        if mark is not None and item.callspec.id not in mark.args:
            yield item


def cases_beyond(items, tuples_of, mark=None):
    """Return the cases whose tuples of values other cases of the same test have.

    With a mark, of tests with this mark.
    """
    functions = {}
    for item in items:
        if hasattr(item, "callspec") and (mark is None or item.get_closest_marker(mark)):
            functions.setdefault(test_of(item), []).append(item)
    for cases in functions.values():
        yield from set(cases) - set(covering(cases, tuples_of))


def covering(cases, tuples_of):
    """Return cases that have all tuples of values: named ones, then those with most new ones."""
    tuples = {case: tuples_of(case.callspec.params) for case in cases}
    missing = set().union(*tuples.values())
    kept = []

    def keep(case):
        kept.append(case)
        missing.difference_update(tuples[case])

    for case in cases:
        mark = case.get_closest_marker("on_ranks")
        if mark is not None and case.callspec.id in mark.args:
            keep(case)
    while missing:
        keep(max(cases, key=lambda case: len(tuples[case] & missing)))
    return kept


def pairs_of(values):
    """Return all pairs of the values of parameters, which are known by their identity."""
    return set(combinations_with_replacement(sorted(values_of(values)), 2))


def values_of(values):
    """Return the values of parameters, which are known by their identity."""
    return {(name, id(value)) for name, value in values.items()}


def raise_if_unknown(items):
    """Raise if a mark ``on_ranks`` names a case that its test does not have."""
    unknown = set()
    names = set()
    for item in items:
        mark = item.get_closest_marker("on_ranks")
        if mark is not None:
            function = test_of(item)
            names.add((function, item.callspec.id))
            unknown.update((function, case) for case in mark.args)
    unknown -= names
    if unknown:
        raise pytest.UsageError(f"no such cases: {sorted(unknown)}")


@pytest.fixture
def shared_tmp_path():
    """A new folder that all ranks see, removed afterwards."""
    path = COMM.bcast(tempfile.mkdtemp(prefix="erc_contact_") if COMM.rank == 0 else None)
    yield Path(path)
    COMM.barrier()
    if COMM.rank == 0:
        shutil.rmtree(path)


@pytest.fixture
def gmsh_session():
    """The gmsh module with a session and an empty model of the user's on rank 0.

    None on the other ranks.
    """
    if COMM.rank > 0:
        yield None
        return
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("user")
    yield gmsh
    if gmsh.isInitialized():
        gmsh.finalize()


class Measures:
    """Lengths, areas and volumes of the parts of a domain, from vertex coordinates alone (no form)."""

    @staticmethod
    def simplices(x):
        """Volumes of simplices with vertices x of shape (n, k+1, gdim)."""
        edges = x[:, 1:] - x[:, :1]
        k = edges.shape[1]
        factorial = (1, 1, 2, 6)[k]
        return np.sqrt(np.linalg.det(edges @ edges.transpose(0, 2, 1))) / factorial

    @staticmethod
    def vertices(domain):
        """Vertex coordinates of each local cell, shape (cells, d+1, d)."""
        return domain.mesh.geometry.x[cell_nodes(domain.mesh.geometry), : domain.dim]

    def part(self, domain, name):
        """Measure of a boundary part over all ranks."""
        d = domain.dim
        facets = domain.facets(name)
        facets = facets[facets[:, 0] < domain.owned_cells]
        opposite = np.array([[j for j in range(d + 1) if j != i] for i in range(d + 1)])
        x = np.take_along_axis(
            self.vertices(domain)[facets[:, 0]], opposite[facets[:, 1]][..., None], axis=1
        )
        return domain.mesh.comm.allreduce(self.simplices(x).sum())

    def region(self, domain, name=None):
        """Measure of a cell region, or of the whole body, over all ranks."""
        cells = np.arange(domain.owned_cells) if name is None else domain.region(name)
        cells = cells[cells < domain.owned_cells]
        return domain.mesh.comm.allreduce(self.simplices(self.vertices(domain)[cells]).sum())


@pytest.fixture(autouse=True)
def few_pixels(monkeypatch):
    """Bodies are drawn with a quarter of the pixels on a side.

    VTK takes half a second for each view otherwise.
    """
    monkeypatch.setattr(views, "PIXELS", views.PIXELS // 4)


@pytest.fixture(scope="session")
def measures():
    return Measures()


@pytest.fixture(scope="session")
def block():
    """The unit square on 2 x 4 x 4 triangles, on all ranks."""
    return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
