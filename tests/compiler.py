"""What makes forms compile faster in tests: options of the C compiler, and repairs.

Each module of compiled forms includes Python.h, and gcc takes two thirds of its time to
read it. Here it is read once: gcc keeps what it has read in a file beside the compiled
forms, a precompiled header. A compiler that has no such files reads the header as ever.
"""

from __future__ import annotations

import hashlib
import os
import shlex
import subprocess
import sys
import sysconfig
from functools import cache, singledispatchmethod
from pathlib import Path

import basix.ufl
import setuptools  # noqa: F401 - it brings distutils, which cffi calls
from mpi4py import MPI
from setuptools._distutils.ccompiler import new_compiler
from setuptools._distutils.sysconfig import customize_compiler

FAST = ["-O0", "-g0", "-w"]
"""On small meshes forms run nearly as fast as with -O2, and they compile faster.

To look for what deserves a warning takes a seventh of the time of the compiler.
"""
BARE = ["-nostartfiles", "-nodefaultlibs", "-Wl,--build-id=none"]
"""Options of the linker: a module finds what it needs of C in the process."""
STANDARD = "-std=c17"
"""Option that FFCx adds; a precompiled header is read only with its own options."""
HEADER = """\
#include <pyconfig.h>
#ifndef Py_LIMITED_API
#define Py_LIMITED_API
#endif
#include <Python.h>
#include <math.h>
#include <stdalign.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
"""
"""Beginning of all modules of cffi and FFCx."""


def repair() -> None:
    """Let UFL and Python make once what they make for each call."""
    import ufl

    cell = cache(ufl.Cell)
    basix.ufl._ElementBase.cell = property(lambda element: cell(element._cellname))
    if sys.version_info < (3, 13):  # later ones keep their wrappers
        singledispatchmethod.__get__ = _bound


def _bound(self: singledispatchmethod, obj: object, cls: type | None = None) -> object:
    """Bind a method that goes by the type of its argument, without a wrapper."""
    dispatch = self.dispatcher.dispatch
    if obj is None:
        return usual_get(self, obj, cls)
    return lambda first, *args, **kwargs: dispatch(first.__class__).__get__(obj, cls)(
        first, *args, **kwargs
    )


usual_get = singledispatchmethod.__get__
"""How Python binds such methods."""


@cache
def compiler_options() -> list[str]:
    """Return the options of the C compiler; collective in the first call."""
    from dolfinx import jit  # after MPI, which loads the library that DOLFINx expects

    folder = Path(jit.get_options()["cache_dir"])
    command = _command()
    key = repr((command, HEADER, sys.version)).encode()
    header = folder / f"tests_{hashlib.sha256(key).hexdigest()[:12]}.h"
    comm = MPI.COMM_WORLD
    useful = comm.bcast(_precompiled(command, header) if comm.rank == 0 else None)
    if useful:
        os.environ["LDSHARED"] = shlex.join([*_linker(), *BARE])
    return [*FAST, "-include", str(header)] if useful else FAST


def _command() -> list[str]:
    """Return how distutils calls the compiler, without files."""
    compiler = new_compiler()
    customize_compiler(compiler)
    include = sysconfig.get_path("include")
    return [*compiler.compiler_so, f"-I{include}", STANDARD, *FAST]


def _linker() -> list[str]:
    """Return how distutils links a module, without files."""
    compiler = new_compiler()
    customize_compiler(compiler)
    return list(compiler.linker_so)


def _precompiled(command: list[str], header: Path) -> bool:
    """Precompile the header unless it is there.

    Tell whether the compiler can use it.
    """
    ready = header.with_suffix(".h.gch")
    if ready.exists():
        return True
    header.parent.mkdir(parents=True, exist_ok=True)
    header.write_text(HEADER)
    made = header.with_suffix(f".{os.getpid()}.gch")
    empty = header.with_suffix(f".{os.getpid()}.c")
    empty.touch()
    use = ["-Winvalid-pch", "-Werror", "-include", str(header), "-fsyntax-only", str(empty)]
    try:
        _call([*command, "-x", "c-header", str(header), "-o", str(made)])
        made.replace(ready)  # at once, for processes that look for it at the same time
        _call([*command, *use])
    except (OSError, subprocess.CalledProcessError):
        ready.unlink(missing_ok=True)
        return False
    finally:
        empty.unlink()
    return True


def _call(command: list[str]) -> None:
    """Run a command without a word; raise if it fails."""
    subprocess.run(command, check=True, capture_output=True)
