"""Scripts in processes of their own, alone or under mpiexec: for demos, signals, deadlocks, whole lives."""

from __future__ import annotations

import gc
import json
import logging
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI

ROOT = Path(__file__).parent.parent
COMPILER = ["-O1", "-g0"]
"""Options of the C compiler in tests: forms run as fast as with -O2, and compile in three quarters of its time."""


def environment() -> dict[str, str]:
    """Variables of a process of its own: none of a running mpiexec, one thread, and the package beside the tests."""
    own = {"OMP_NUM_THREADS": "1", "MPIR_CVAR_CH4_PROGRESS_THROTTLE": "1", "PYTHONPATH": str(ROOT)}
    return {k: v for k, v in os.environ.items() if not k.startswith(("PMI", "MPI"))} | own


def started(script: str, ranks: int, folder: Path) -> subprocess.Popen:
    """Start a script; what it writes comes through pipes, errors with the rest.

    Args:
        script: Python source.
        ranks: Number of processes, 1 without mpiexec.
        folder: Where it runs.
    """
    path = folder / "script.py"
    path.write_text(script)
    return launched(path, ranks, folder)


def launched(path: Path, ranks: int, folder: Path) -> subprocess.Popen:
    """The same for a script that is a file already; DOLFINx finds the options of the C compiler in the folder."""
    (folder / "dolfinx_jit_options.json").write_text(json.dumps({"cffi_extra_compile_args": COMPILER}))
    launch = [] if ranks == 1 else [str(Path(sys.executable).parent / "mpiexec"), "-n", str(ranks)]
    return subprocess.Popen(
        [*launch, sys.executable, "-u", str(path)],
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def run_as_user(path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a script in a folder: on one rank as a process of its own, on several by all ranks of this one.

    Its handlers of log messages are removed afterwards.
    """
    if MPI.COMM_WORLD.size == 1:
        output(launched(path, 1, folder), 300)
        return
    log = logging.getLogger("erc_contact")
    monkeypatch.setattr(log, "handlers", [])
    monkeypatch.setattr(log, "propagate", True)
    level = log.level
    monkeypatch.chdir(folder)
    runpy.run_path(str(path), run_name="__main__")
    log.setLevel(level)
    gc.collect()  # all demos in one process: what one leaves in cycles holds communicators


def output(process: subprocess.Popen, seconds: float) -> str:
    """All that a process writes from here to its end; it must end by itself in so many seconds, with code 0."""
    try:
        text, _ = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.terminate()  # mpiexec ends its ranks with it
        text, _ = process.communicate(timeout=20)
        raise AssertionError(f"it did not end in {seconds:g} s: a deadlock?\n{text}") from None
    assert process.returncode == 0, text
    return text
