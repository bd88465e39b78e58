"""Read a file in a process of its own, which a library that fails may end."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from namedmesh.base.exceptions import InputError
from namedmesh.files.file_mesh import FileMesh

PACKAGE = Path(__file__).resolve().parents[1]
"""Folder of the package."""
WITHOUT_MPI = """
import sys, types
package = types.ModuleType("namedmesh")
package.__path__ = [sys.argv.pop(1)]
sys.modules["namedmesh"] = package
"""
"""Beginning of the program of a process: the package's modules without what starts MPI.

Its first argument is the folder of the package.
"""
READ = """
import contextlib, importlib, json, pickle, resource
from pathlib import Path
module, function, path, target, memory, options = sys.argv[1:]
_, most = resource.getrlimit(resource.RLIMIT_AS)
with contextlib.suppress(ValueError, OSError):  # not all systems bound addresses
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), most))
reader = getattr(importlib.import_module(module), function)
try:
    answer = reader(Path(path), **json.loads(options))
except Exception as reason:
    from namedmesh.base.exceptions import InputError, words_of
    answer = words_of(reason) + "."
    if not isinstance(reason, InputError):
        answer += " Write the mesh in another format: .msh, .vtu, .med, .inp."
Path(target).write_bytes(pickle.dumps(answer))
"""
"""Rest of the program, which reads a file."""
ALONE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Environment of the process: threads take addresses, and reading uses none."""
MEMORY = 6e9
"""Memory that reading may take [bytes], beside a hundred for each byte of the file.

It is of addresses, of which libraries and threads take a part.
"""
PATIENCE = 60.0
"""Time that reading may take [s], beside a second for each megabyte of the file."""


def read_apart(module: str, function: str, path: Path, **options: bool | str | None) -> FileMesh:
    """Read a file by a function of a module, in a process of its own.

    The process has bounds of time and memory, as a damaged file may ask for any. The
    answer comes through a file in a folder that nobody else may write to.

    Args:
        module: Name of the module in this package.
        function: Name of the function, which gets the path.
        path: The file.
        options: Options of the function.

    Raises:
        InputError: If the function raises, or the process ends without an answer.
    """
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "mesh"
        size = path.stat().st_size
        program = [sys.executable, "-c", WITHOUT_MPI + READ, str(PACKAGE)]
        call = [f"{__package__}.{module}", function, str(path.resolve()), str(target)]
        bounds = str(int(MEMORY + 100 * size))
        cause = "no answer"
        try:
            run = subprocess.run(
                [*program, *call, bounds, json.dumps(options)],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                env=os.environ | ALONE,
                timeout=PATIENCE + size / 1e6,
                check=False,
            )
            code = run.returncode
            cause = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        except subprocess.TimeoutExpired:
            pass  # it was killed
        if not target.is_file():
            raise InputError(
                f"the library that reads it has ended with {cause}; the file is damaged, or of "
                "another format."
            )
        answer = pickle.loads(target.read_bytes())
    if isinstance(answer, str):
        raise InputError(answer)
    return answer
