"""Small C libraries of the package, compiled once and kept beside DOLFINx's forms.

A library is a folder with C sources, its header ``kernels.h``, which Python reads, too,
and other headers. It is compiled for the processor of this machine by the C compiler
that DOLFINx's forms need anyway, and for one dimension: who works in the plane does not
compile for space. Where the folder of compiled forms cannot be written to, each process
compiles its own.
"""

from __future__ import annotations

import os
import platform
import re
import shlex
import subprocess
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from threading import Thread
from typing import Any

import cffi
import numpy as np
from dolfinx.jit import get_options

from erc_contact.base.exceptions import ErcContactError
from erc_contact.base.runtime.form_library import compile_once, compiler

LOOPS = ("-ftree-vectorize", "-fvect-cost-model=dynamic", "-fpeel-loops")
"""What the kernels gain from in -O3; all of it takes a third longer to compile."""
COMPILER_FLAGS = (
    *("-std=gnu11", "-O2", *LOOPS),
    *("-march=native", "-fno-math-errno", "-Wno-psabi", "-fPIC"),
)
"""Options of the compiler; none of them changes the order of operations."""
C_TYPES = {
    "float64": "double",
    "float32": "float",
    "int64": "long long",
    "int32": "int",
    "bool": "_Bool",
}
"""Names of numpy's types -> C's types."""
C_ARRAYS = {np.dtype(name): f"{c_type}[]" for name, c_type in C_TYPES.items()}
"""numpy's types -> C's names of arrays of them."""


class Library:
    """Call the functions of a C library with numpy arrays.

    Args:
        folder: Where its sources are.
        dimension: Their ``DIMENSION``.

    Raises:
        ErcContactError: If the C compiler fails.
    """

    def __init__(self, folder: Path, dimension: int) -> None:
        self._ffi = cffi.FFI()
        self._ffi.cdef((folder / "kernels.h").read_text())
        self._functions = self._ffi.dlopen(str(_find_or_compile(folder, dimension)))

    def __call__(self, name: str, *arguments: Any) -> Any:
        """Call a function with numbers and contiguous arrays; None is a null pointer.

        Raises:
            TypeError: If the type of an array is not the type of the argument.
            ValueError: If an array is not contiguous.
            MemoryError: If the function finds too little memory.
        """
        return self.bound(name, *arguments)()

    def bound(self, name: str, *first: Any) -> Callable[..., Any]:
        """Return a function with its first arguments; it is called with the others.

        So arguments that stay are converted once.
        """
        function = getattr(self._functions, name)
        passed = [self._as_cffi(argument) for argument in first]

        def call(*others: Any) -> Any:
            result = function(*passed, *(self._as_cffi(argument) for argument in others))
            if result == -1:
                raise MemoryError(f"{name} finds too little memory.")
            return result

        return call

    def _as_cffi(self, argument: Any) -> Any:
        """Return an argument as cffi wants it."""
        if argument is None:
            return self._ffi.NULL
        if isinstance(argument, np.ndarray):
            return self._ffi.from_buffer(C_ARRAYS[argument.dtype], argument)
        return argument


@cache
def library(folder: Path, dimension: int) -> Library:
    """Return the library of a folder, loaded once in a process."""
    return Library(folder, dimension)


def compile_ahead(folder: Path, dimension: int) -> None:
    """Compile the library of a folder beside what follows, if it is not there.

    :func:`library` waits for it.
    """
    path = _path(folder, dimension)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() and os.access(path.parent, os.W_OK):
        Thread(target=_compile_quietly, args=[folder, dimension]).start()


def _compile_quietly(folder: Path, dimension: int) -> None:
    """Compile a library if it is not there; who needs it will tell what fails."""
    # At the end of a process no pool begins: a RuntimeError.
    with suppress(ErcContactError, OSError, RuntimeError):
        _find_or_compile(folder, dimension)


def _path(folder: Path, dimension: int) -> Path:
    """Return where the compiled library is, or will be."""
    texts = [path.read_text() for path in sorted(folder.glob("*.[ch]"))]
    ingredients = [*texts, *_command(dimension), _processor()]
    key = sha256("\0".join(ingredients).encode()).hexdigest()[:20]
    name = f"liberc_contact_{dimension}d_{key}.so"
    return Path(get_options()["cache_dir"]).expanduser() / name


def _find_or_compile(folder: Path, dimension: int) -> Path:
    """Return the path of the compiled library; compile it if it is not there."""
    return compile_once(_path(folder, dimension), lambda path: _compile(folder, dimension, path))


def _compile(folder: Path, dimension: int, path: Path) -> None:
    """Compile all sources, each on its core, and link them.

    The library appears at its path when it is complete.

    Raises:
        ErcContactError: If the C compiler fails.
    """
    with tempfile.TemporaryDirectory(dir=path.parent) as temporary:

        def run(source: Path) -> subprocess.CompletedProcess[str]:
            compiled = f"{temporary}/{source.stem}.o"
            command = [*_command(dimension), "-c", str(source), "-o", compiled]
            return subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)

        # The longest ones come first, so that none of them begins when all others end.
        sources = sorted(folder.glob("*.c"), key=lambda source: -source.stat().st_size)
        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            runs = list(pool.map(run, sources))
        messages = "".join(run.stderr for run in runs)
        objects = [f"{temporary}/{source.stem}.o" for source in sources]
        linked = Path(temporary) / path.name
        link = [*compiler(), "-shared", *objects, "-lm", "-o", str(linked)]
        failed = any(run.returncode for run in runs)
        if failed or subprocess.run(link, check=False).returncode:
            raise ErcContactError(
                f"The C compiler {shlex.join(compiler())} failed:\n{messages}\nDOLFINx needs one, "
                "too; set the environment variable CC to a compiler that works, GCC or Clang."
            )
        linked.replace(path)


def _command(dimension: int) -> list[str]:
    """Return how a source is compiled."""
    return [*compiler(), *COMPILER_FLAGS, f"-DDIMENSION={dimension}"]


def _processor() -> str:
    """Return what the code depends on: the instructions of the processor."""
    table = Path("/proc/cpuinfo")
    flags = None
    if table.exists():
        flags = re.search(r"^(flags|Features).*", table.read_text(), re.MULTILINE)
    instructions = flags.group() if flags else platform.processor()
    return f"{platform.machine()} {instructions}"
