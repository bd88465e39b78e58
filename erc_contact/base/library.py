"""Small C libraries of the package: compiled once, kept beside DOLFINx's compiled forms.

A library is a folder with C sources, its header ``kernels.h``, which Python reads, too,
and other headers. It is compiled for the processor of this machine by the C compiler
that DOLFINx's forms need anyway. Where the folder of compiled forms cannot be written
to, each process compiles its own.
"""

from __future__ import annotations

import os
import platform
import re
import shlex
import shutil
import subprocess
import sysconfig
import tempfile
from fcntl import LOCK_EX, flock
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import cffi
import numpy as np
from dolfinx.jit import get_options

from erc_contact.base.exceptions import ErcContactError

FLAGS = ("-std=gnu11", "-O3", "-march=native", "-fno-math-errno", "-Wno-psabi", "-fPIC")
"""Options of the compiler; none of them changes the order of operations."""
TYPES = {
    "float64": "double",
    "float32": "float",
    "int64": "long long",
    "int32": "int",
    "bool": "_Bool",
}
ARRAYS = {np.dtype(name): f"{known}[]" for name, known in TYPES.items()}
"""C's names of arrays of numpy's types."""


class Library:
    """The functions of a C library for numpy arrays.

    Args:
        folder: Where its sources are.

    Raises:
        ErcContactError: If the C compiler fails.
    """

    def __init__(self, folder: Path) -> None:
        self._ffi = cffi.FFI()
        self._ffi.cdef((folder / "kernels.h").read_text())
        self._functions = self._ffi.dlopen(str(_compiled(folder)))

    def __call__(self, name: str, *arguments: Any) -> Any:
        """Call a function with numbers and contiguous arrays; None is a null pointer.

        Raises:
            TypeError: If the type of an array is not that of the argument.
            ValueError: If an array is not contiguous.
            MemoryError: If the function finds too little memory.
        """
        result = getattr(self._functions, name)(*(self._passed(a) for a in arguments))
        if result == -1:
            raise MemoryError(f"{name} finds too little memory.")
        return result

    def _passed(self, argument: Any) -> Any:
        if argument is None:
            return self._ffi.NULL
        if isinstance(argument, np.ndarray):
            return self._ffi.from_buffer(ARRAYS[argument.dtype], argument)
        return argument


@cache
def library(folder: Path) -> Library:
    """The library of a folder, loaded once in a process."""
    return Library(folder)


def _compiled(folder: Path) -> Path:
    """Path of the compiled library."""
    texts = [path.read_text() for path in sorted(folder.glob("*.[ch]"))]
    key = sha256("\0".join([*texts, *_compiler(), *FLAGS, _processor()]).encode()).hexdigest()[:20]
    name = f"liberc_contact_{key}.so"
    cache_folder = Path(get_options()["cache_dir"]).expanduser()
    if (cache_folder / name).exists():
        return cache_folder / name
    try:
        cache_folder.mkdir(parents=True, exist_ok=True)
        lock = (cache_folder / f"{name}.lock").open("w")
    except OSError:
        return _compile(folder, Path(tempfile.mkdtemp(prefix="erc_contact_")) / name)
    with lock:
        flock(lock, LOCK_EX)  # the others wait, and find it
        return (
            cache_folder / name
            if (cache_folder / name).exists()
            else _compile(folder, cache_folder / name)
        )


def _compile(folder: Path, path: Path) -> Path:
    """Compile all sources at the same time; the library appears at its path when it is complete."""
    with tempfile.TemporaryDirectory(dir=path.parent) as made:
        runs = [
            subprocess.Popen(
                [*_compiler(), *FLAGS, "-c", str(source), "-o", f"{made}/{source.stem}.o"],
                stderr=subprocess.PIPE,
                text=True,
            )
            for source in sorted(folder.glob("*.c"))
        ]
        said = "".join(run.communicate()[1] for run in runs)
        part, objects = (
            Path(made) / path.name,
            [f"{made}/{source.stem}.o" for source in folder.glob("*.c")],
        )
        link = [*_compiler(), "-shared", *objects, "-lm", "-o", str(part)]
        if any(run.returncode for run in runs) or subprocess.run(link, check=False).returncode:
            raise ErcContactError(
                f"The C compiler {shlex.join(_compiler())} failed:\n{said}\nDOLFINx needs one, too; set the "
                "environment variable CC to a compiler that works, GCC or Clang."
            )
        part.replace(path)
    return path


def _compiler() -> list[str]:
    """The C compiler: that of the environment, that of Python, or cc."""
    command = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    return command if shutil.which(command[0]) else ["cc"]


def _processor() -> str:
    """What the compiled library depends on: the instructions of the processor."""
    known = Path("/proc/cpuinfo")
    flags = (
        re.search(r"^(flags|Features).*", known.read_text(), re.MULTILINE)
        if known.exists()
        else None
    )
    return f"{platform.machine()} {flags.group() if flags else platform.processor()}"
