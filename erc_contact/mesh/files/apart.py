"""Read a file in a process of its own, which a library that fails may end."""

from __future__ import annotations

import json
import pickle
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.files.file_mesh import FileMesh

PACKAGE = Path(__file__).resolve().parents[2]
"""Folder of the package."""
WITHOUT_MPI = """
import sys, types
package = types.ModuleType("erc_contact")
package.__path__ = [sys.argv.pop(1)]
sys.modules["erc_contact"] = package
"""
"""Beginning of the program of a process: the package's modules without what starts MPI.

Its first argument is the folder of the package.
"""
READ = """
import importlib, json, pickle
from pathlib import Path
module, function, path, target, options = sys.argv[1:]
reader = getattr(importlib.import_module(module), function)
try:
    answer = reader(Path(path), **json.loads(options))
except Exception as reason:
    answer = str(reason)
    kind = type(reason).__name__
    if isinstance(reason, ModuleNotFoundError):
        answer = f"reading it needs {reason.name}: pip install 'erc-contact[pictures]' brings it."
    elif kind != "InputError":
        words = answer.strip().rstrip(".")
        # gmsh's errors are of no class of their own.
        words = words if kind == "Exception" else f"{kind}: {words}"
        answer = (
            f"it is damaged, or of a form that the library does not read ({words}). "
            "Write the mesh in another format: .msh, .vtu, .med, .inp."
        )
Path(target).write_bytes(pickle.dumps(answer))
"""
"""Rest of the program, which reads a file."""
PATIENCE = 60.0
"""Time that reading may take [s], beside a second for each megabyte of the file."""


def read_apart(module: str, function: str, path: Path, **options: bool) -> FileMesh:
    """Read a file by a function of a module, in a process of its own.

    Args:
        module: Name of the module.
        function: Name of the function, which gets the path.
        path: The file.
        options: Options of the function.

    Raises:
        InputError: If the function raises, or the process ends without an answer.
    """
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "mesh"
        call = [sys.executable, "-c", WITHOUT_MPI + READ, str(PACKAGE), module, function]
        cause = "no answer"
        try:
            run = subprocess.run(
                [*call, str(path.resolve()), str(target), json.dumps(options)],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=PATIENCE + path.stat().st_size / 1e6,
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
