"""Compiled forms as plain C libraries, without a Python module around each.

FFCx has cffi write a Python module of its code. Of what the C compiler then reads, two
thirds are cffi's own, the same in each module; setuptools, which calls it, and cffi's
reader of declarations take as long again. Here FFCx's code is compiled as it is, with
the linker in one call, and cffi opens the library, as ``erc_contact.base.library``
does. DOLFINx gets the same structs and functions at the same place, an address.

Scripts that tests start as processes of their own go the usual way.
"""

from __future__ import annotations

import ctypes
import os
import shlex
import subprocess
import sysconfig
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import cffi
import ffcx.compiler
from dolfinx import jit as dolfinx_jit
from ffcx.codegeneration import get_include_path, jit

SHARED = ["-std=c17", "-O0", "-g0", "-w", "-fPIC", "-shared", "-nostartfiles", "-nodefaultlibs"]
"""On small meshes forms run nearly as fast as with -O2, and they compile faster.

To look for what deserves a warning takes a seventh of the time of the compiler. The
options are in the names of libraries: no module of cffi has the same.
"""
STRUCTS = cffi.FFI()
"""FFCx's structs, read once."""
STRUCTS.cdef(
    jit.UFC_HEADER_DECL.format("float64")
    + jit.UFC_INTEGRAL_DECL
    + jit.UFC_FORM_DECL
    + jit.UFC_EXPRESSION_DECL
)


@dataclass(frozen=True, eq=False)
class FormLibrary:
    """What is asked of a module of cffi: how it casts, and that it stays loaded."""

    functions: ctypes.CDLL
    ffi: cffi.FFI = STRUCTS

    def object(self, name: str) -> Any:
        """Return the struct of a form or an expression, by its name in C."""
        kind = name.split("_", maxsplit=1)[0]
        address = ctypes.addressof(ctypes.c_byte.in_dll(self.functions, name))
        return self.ffi.cast(f"ufcx_{kind} *", address)[0]


def install() -> None:
    """Let FFCx compile and load forms so, in this process.

    Files with other options, of the user or for scripts, count no more.
    """
    dolfinx_jit._load_options = lambda: ({}, {})
    dolfinx_jit.DOLFINX_DEFAULT_JIT_OPTIONS["cffi_extra_compile_args"] = (SHARED, "options of C")
    jit._compile_objects = compiled
    jit._load_objects = loaded
    jit.get_cached_module = found


def compiled(
    declarations: str,
    sources: Sequence[Any],
    names: Sequence[str],
    library: str,
    options: dict[str, Any],
    folder: Path,
    flags: Sequence[str],
    *_: Any,
    **__: Any,
) -> str:
    """Do what FFCx's ``_compile_objects`` does; return the C code."""
    texts, _ = ffcx.compiler.compile_ufl_objects(sources, options=options, namespace=library)
    code = texts[1]  # the first one is the header
    source = Path(folder) / f"{library}.c"
    source.write_text(code)
    made = source.with_suffix(".part")
    compiler = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    command = [*shlex.split(compiler), *flags, f"-I{get_include_path()}", str(source)]
    subprocess.run([*command, "-lm", "-o", str(made)], check=True, capture_output=True)
    made.replace(_ready(source))  # at once, for processes that wait for it
    return code


def loaded(folder: Path, library: str, names: Sequence[str]) -> tuple[list[Any], FormLibrary]:
    """Do what FFCx's ``_load_objects`` does."""
    opened = FormLibrary(ctypes.CDLL(str(_ready(Path(folder) / f"{library}.c"))))
    return [opened.object(name) for name in names], opened


def found(library: str, names: Sequence[str], folder: Path, timeout: float) -> Any:
    """Do what FFCx's ``get_cached_module`` does.

    Who asks first gets nothing, and has to compile it.
    """
    source = Path(folder) / f"{library}.c"
    source.parent.mkdir(parents=True, exist_ok=True)
    try:
        source.touch(exist_ok=False)
    except FileExistsError:
        end = monotonic() + timeout
        while not _ready(source).exists():
            if monotonic() > end:
                raise TimeoutError(f"nobody has compiled {source} in {timeout:g} s") from None
            sleep(0.01)
        return loaded(folder, library, names)
    return None, None


def _ready(source: Path) -> Path:
    """Return the path of the library that a source becomes."""
    return source.with_suffix(".so")
