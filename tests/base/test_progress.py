"""What a run tells while it goes on.

- Without ``log_to_console`` the package is silent.
- In a file there are the rows as they are in the table, without escape codes and
  without line breaks of its own.
- On a terminal a line tells mesh, stage and iteration, is gone at the end, and the rows
  stay as they are.
- A file that was silent for long gets a line with mesh, stage and iteration, also while
  a run is saved.
- All is told once, by rank 0.
"""

import io
import logging
import re
import sys
from dataclasses import replace

import pytest
from mpi4py import MPI
from scenes import block, prototype_block

import erc_contact as ec
from erc_contact.base import progress
from erc_contact.run.foreseen import duration, mesh_under_way
from namedmesh.base.percent import percent

COMM = MPI.COMM_WORLD
CONTROL = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")


class Terminal(io.StringIO):
    """A terminal that keeps what it gets."""

    def isatty(self):
        return True


@pytest.fixture
def console(monkeypatch):
    """Starts telling to a stream, and ends it."""
    log = logging.getLogger("erc_contact")
    before = log.level, log.propagate, list(log.handlers)

    def start(stream, **options):
        monkeypatch.setattr(sys, "stdout", stream)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv("COLUMNS", "100")
        ec.log_to_console(**options)
        return stream

    yield start
    progress.show_on(None)
    log.setLevel(before[0])
    log.propagate, log.handlers[:] = before[1:]


def run():
    return ec.adapt(prototype_block(), block(2), accuracy=0.01, max_steps=3)


def test_silent_as_a_library(capfd):
    history = ec.adapt(prototype_block(), block(2), accuracy=0.9)
    assert history.reached
    assert capfd.readouterr() == ("", "")


def test_plain_lines_in_a_file(console):
    stream = console(io.StringIO())
    console(stream)  # a second call does not double the lines
    history = run()
    assert stream.getvalue() == (f"{history}\n" if COMM.rank == 0 else "")


@pytest.mark.broad
def test_lines_of_a_long_mesh_in_a_file(console, monkeypatch, shared_tmp_path):
    monkeypatch.setattr(progress, "SELDOM", 0.0)
    monkeypatch.setattr(progress, "OFTEN", 0.0)
    stream = console(io.StringIO())
    history = run()
    history.save(shared_tmp_path, pictures=False)
    lines = stream.getvalue().splitlines()
    told = [line for line in lines if line.startswith("... ")]
    assert [line for line in lines if line not in told] == (
        str(history).splitlines() if COMM.rank == 0 else []
    )
    if COMM.rank == 0:
        error = percent(history.column("eps")[0], 2)
        mesh = f"... mesh 2, {history.column('cells')[1]} cells, {error} -> 1%: "
        assert f"{mesh}solving with the direct solver" in told
        assert f"{mesh}equilibrium, tightening 1 of at most 600" in told
        assert "... saving, fields" in told


def test_a_line_on_a_terminal(console):
    text = console(Terminal())
    history = run()
    told = text.getvalue()
    assert progress._line.stages == []
    if COMM.rank > 0:
        assert told == ""
        return
    for cells in history.column("cells"):
        assert re.search(f", {cells} cells[^:]*: solving with the direct solver", told)
    assert "mesh 2" in told
    assert "making mesh 3" in told
    assert "equilibrium" in told
    shown = [line.rstrip() for line in CONTROL.sub("", told.replace("\r", "\n")).splitlines()]
    rows = str(history).splitlines()
    assert [line for line in shown if line in rows] == rows  # each once
    assert told.count("\x1b[?25l") == told.count("\x1b[?25h") > 0  # the cursor is there again
    assert shown[-1] == rows[-1]


def test_what_fails_leaves_no_line(console):
    """A stage ends however it ends, and the next run starts with a clean line."""
    console(Terminal())

    def fail(error, step):
        raise ValueError("mine")

    with pytest.raises(ValueError, match="mine"):
        ec.adapt(prototype_block(), block(2), accuracy=0.01, callback=fail)
    assert progress._line.stages == []


@pytest.mark.serial
def test_iterations_are_told(console, monkeypatch):
    monkeypatch.setattr(progress, "OFTEN", 0.0)
    text = console(Terminal())
    run()
    told = text.getvalue()
    assert "solving with the direct solver, Newton step 1" in told
    assert "equilibrium, tightening 1 of at most 600" in told


@pytest.mark.serial
def test_time_of_a_mesh_follows_from_the_last_mesh():
    """Its time grows with its cells; short times are not told."""
    history = ec.adapt(prototype_block(), block(2), accuracy=0.9)
    step = replace(
        history.steps[0],
        cells=1000,
        eps=0.12,
        solve_seconds=1.0,
        equilibrate_seconds=0.5,
        error_seconds=0.24,
    )
    said = "mesh 2, 23 000 cells, 12% -> 5%, about 40 s"
    assert mesh_under_way([step], 23_000, 0.05) == said
    assert mesh_under_way([step], 100, None) == "mesh 2, 100 cells"
    assert mesh_under_way([], 148, 0.05) == "mesh 1, 148 cells"
    assert [duration(seconds) for seconds in (1.0, 80.0, 130.0, 6000.0)] == [
        "",
        ", about 80 s",
        ", about 2 min",
        ", about 2 h",
    ]
