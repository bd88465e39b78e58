"""Scripts in processes of their own, alone or under mpiexec.

For demos, signals, deadlocks, whole lives.
"""

from __future__ import annotations

import gc
import json
import logging
import os
import runpy
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from mpi4py import MPI

ROOT = Path(__file__).parent.parent
OPTIONS = ["-O0", "-g0", "-w"]
"""On small meshes forms run nearly as fast as with -O2, and they compile faster.

To look for what deserves a warning takes a seventh of the time of the compiler.
"""


def environment() -> dict[str, str]:
    """Variables of a process of its own.

    None of a running mpiexec, one thread, and the package beside the tests.
    """
    own = {
        "OMP_NUM_THREADS": "1",
        "MPIR_CVAR_CH4_PROGRESS_THROTTLE": "1",
        "PYTHONHASHSEED": "7",  # another than in the tests, on all ranks
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")]),
    }
    return {k: v for k, v in os.environ.items() if not k.startswith(("PMI", "MPI"))} | own


@contextmanager
def started(script: str, ranks: int, folder: Path) -> Iterator[subprocess.Popen]:
    """A running script; what it writes comes through a pipe, errors with the rest.

    At the end nothing of it is left.

    Args:
        script: Python source.
        ranks: Number of processes, 1 without mpiexec.
        folder: Where it runs, and nothing else does.
    """
    path = folder / "script.py"
    path.write_text(script)
    with launched(path, ranks, folder) as process:
        yield process


@contextmanager
def launched(path: Path, ranks: int, folder: Path) -> Iterator[subprocess.Popen]:
    """The same for a script that is a file already.

    DOLFINx finds the options of the C compiler in the folder.
    """
    (folder / "dolfinx_jit_options.json").write_text(
        json.dumps({"cffi_extra_compile_args": OPTIONS})
    )
    launch = [] if ranks == 1 else [str(Path(sys.executable).parent / "mpiexec"), "-n", str(ranks)]
    with subprocess.Popen(
        [*launch, sys.executable, "-u", str(path)],
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            kill_all_in(folder)


def kill_all_in(folder: Path) -> None:
    """Kill the processes that run in a folder.

    Mpiexec gives each rank a group of its own, MPICH's a session, too.
    """
    for cwd in Path("/proc").glob("[0-9]*/cwd"):
        with suppress(OSError):  # it has ended meanwhile, or belongs to another user
            if cwd.readlink() == folder.resolve() and int(cwd.parent.name) != os.getpid():
                os.kill(int(cwd.parent.name), signal.SIGKILL)


def run_as_user(path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a script in a folder.

    On one rank as a process of its own, on several by all ranks of this one.

    Its handlers of log messages are removed afterwards.
    """
    if MPI.COMM_WORLD.size == 1:
        with launched(path, 1, folder) as process:
            output(process, 300)
        return
    log = logging.getLogger("erc_contact")
    monkeypatch.setattr(log, "handlers", [])
    monkeypatch.setattr(log, "propagate", True)
    level = log.level
    monkeypatch.chdir(folder)
    runpy.run_path(str(path), run_name="__main__")
    log.setLevel(level)
    gc.collect()  # all demos in one process: what one leaves in cycles holds communicators


def told(process: subprocess.Popen, word: str) -> list[str]:
    """The other words of the next line that begins with this one.

    What mpiexec itself writes is passed over.
    """
    lines = []
    for line in iter(process.stdout.readline, ""):
        lines.append(line)
        if line.split()[:1] == [word]:
            return line.split()[1:]
    raise AssertionError(f"it ended without a word of {word!r}:\n{''.join(lines)}")


def output(process: subprocess.Popen, seconds: float) -> str:
    """All that a process writes from here to its end.

    It must end by itself in so many seconds, with code 0.
    """
    try:
        text, _ = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.terminate()  # mpiexec ends its ranks with it
        text, _ = process.communicate(timeout=20)
        raise AssertionError(f"it did not end in {seconds:g} s: a deadlock?\n{text}") from None
    assert process.returncode == 0, text
    return text
