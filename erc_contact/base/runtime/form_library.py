"""Compile forms and expressions together, as plain C libraries.

FFCx generates code for both at once, but its two doors to the C compiler take forms
only, or expressions only. And it has cffi write a Python module of its code. Two thirds
of what the C compiler then reads are cffi's own, the same in each module; setuptools,
which calls it, and cffi's reader of declarations take as long again. Here FFCx's code
is compiled as it is, with the linker in one call, and opened. DOLFINx gets the same
structs and functions.

What a scene needs is compiled together, and found one by one: beside the libraries
there is a note for each form, which says where it is. So a scene compiles only the
forms that no scene before it had, in this process or in another one.
"""

from __future__ import annotations

import ctypes
import os
import shlex
import shutil
import subprocess
import sysconfig
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fcntl import LOCK_EX, flock
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import cffi
import ffcx
import ufl
from dolfinx import jit as dolfinx_jit
from ffcx import naming
from ffcx.codegeneration import get_include_path, jit

FLAGS = ("-std=c17", "-fPIC", "-shared")
"""Options of the compiler beside those that DOLFINx is set to."""


@dataclass(frozen=True, eq=False)
class FormLibrary:
    """Represent a library as DOLFINx asks a module of cffi: it casts, and stays open.

    Attributes:
        functions: The library.
        ffi: Knows FFCx's structs.
    """

    functions: ctypes.CDLL
    ffi: cffi.FFI

    def objects(self, names: Sequence[str]) -> list[Any]:
        """Return the structs of forms and expressions by their names in C."""
        structs = []
        for name in names:
            kind = name.split("_", maxsplit=1)[0]
            address = ctypes.addressof(ctypes.c_byte.in_dll(self.functions, name))
            structs.append(self.ffi.cast(f"ufcx_{kind} *", address)[0])
        return structs


@dolfinx_jit.mpi_jit_decorator
def compile_objects(
    sources: list[Any], options: dict[str, Any], c_code: Callable[..., str]
) -> list[tuple[Any, FormLibrary]]:
    """Return FFCx's objects for forms and expressions, and their libraries; collective.

    The decorator adds the communicator as first argument of a call. Rank 0 compiles
    what is missing, in one library, and the others load what it has made.

    Args:
        sources: Forms, and pairs of an expression and its reference points.
        options: Options of FFCx.
        c_code: Writes the code, see :func:`namedmesh.base.releases.c_code`.

    Raises:
        RuntimeError: If the C compiler fails.
    """
    ffcx_options = ffcx.get_options(options)
    settings = dolfinx_jit.get_options()
    flags = list(settings["cffi_extra_compile_args"])
    flags += [f"-l{library}" for library in settings["cffi_libraries"] or ()]
    # The names know all that decides on the code.
    tag = jit._compute_option_signature(ffcx_options) + jit._compilation_signature(flags, False)
    signatures = [naming.compute_signature([source], tag) for source in sources]
    folder = Path(settings["cache_dir"])
    found = {signature: _find(folder, signature) for signature in signatures}
    # Contacts that are alike have the same expression, which C may define once only.
    missing: dict[str, Any] = {}
    for signature, source in zip(signatures, sources, strict=True):
        if found[signature] is None:
            missing[signature] = source
    if missing:
        found |= _compiled(missing, folder, flags, partial(c_code, options=ffcx_options))
    objects = []
    for signature in signatures:
        place = found[signature]
        assert place is not None
        objects.append((place.library.objects([place.name])[0], place.library))
    return objects


class _Place(NamedTuple):
    """Hold where a form or expression is.

    Attributes:
        library: The library, opened.
        name: The name of its struct in C.
    """

    library: FormLibrary
    name: str


def _compiled(
    sources: dict[str, Any], folder: Path, flags: Sequence[str], c_code: Callable[..., str]
) -> dict[str, _Place]:
    """Compile forms and expressions in one library, and note where each is.

    Args:
        sources: Forms and expressions by their signatures.
        folder: The folder of compiled forms.
        flags: Options of the compiler.
        c_code: Writes the code of sources, with a beginning of the names.
    """
    name = "liberc_contact_forms_" + sha256("".join(sources).encode()).hexdigest()[:40]

    def compile_to(path: Path) -> None:
        _compile(c_code(list(sources.values()), name), path, flags)

    path = compile_once(folder / f"{name}.so", compile_to)
    places = {}
    for number, (signature, source) in enumerate(sources.items()):
        if isinstance(source, ufl.Form):
            name_in_c = naming.form_name(source, number, name)
        else:
            name_in_c = naming.expression_name(source, name)
        places[signature] = _Place(opened(path), name_in_c)
        # A temporary folder of this process alone needs no notes.
        if path.parent == folder:
            note = _note(folder, signature)
            written = note.with_suffix(f".{os.getpid()}")
            written.write_text(f"{path.name} {name_in_c}")
            written.replace(note)
    return places


def _find(folder: Path, signature: str) -> _Place | None:
    """Find a compiled form or expression by its signature, None if it is not there."""
    note = _note(folder, signature)
    if not note.exists():
        return None
    library, name_in_c = note.read_text().split()
    path = folder / library
    return _Place(opened(path), name_in_c) if path.exists() else None


def _note(folder: Path, signature: str) -> Path:
    """Return the path of the note that says where a form or expression is."""
    return folder / f"erc_contact_{signature}.form"


@cache
def opened(path: Path) -> FormLibrary:
    """Open a library once in a process."""
    return FormLibrary(ctypes.CDLL(str(path)), _structs())


def form_library(path: Path, flags: Sequence[str], code: Callable[[], str]) -> FormLibrary:
    """Open a library; compile it if it is not there.

    Args:
        path: Where it is, or will be, see :func:`compile_once`.
        flags: Options of the compiler.
        code: Returns the C code.

    Raises:
        RuntimeError: If the C compiler fails.
    """
    return opened(compile_once(path, lambda path: _compile(code(), path, flags)))


def compile_once(path: Path, compile_to: Callable[[Path], None]) -> Path:
    """Return where a library is; compile it if it is not there.

    Args:
        path: Where it is, or will be. Where this folder cannot be written to, each
            process compiles its own.
        compile_to: Compiles it to a path.
    """
    if path.exists():
        return path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = path.with_suffix(".lock").open("w")
    except OSError:
        path = Path(tempfile.mkdtemp(prefix="erc_contact_")) / path.name
        lock = path.with_suffix(".lock").open("w")
    with lock:
        # Other ranks and processes wait here, and then find it.
        flock(lock, LOCK_EX)
        if not path.exists():
            compile_to(path)
    return path


def _compile(code: str, path: Path, flags: Sequence[str]) -> None:
    """Compile C code; the library appears at its path when it is complete."""
    source = path.with_suffix(".c")
    source.write_text(code)
    made = path.with_suffix(f".{os.getpid()}")
    command = [*compiler(), *FLAGS, f"-I{get_include_path()}", str(source), *flags, "-lm"]
    run = subprocess.run([*command, "-o", str(made)], capture_output=True, text=True, check=False)
    if run.returncode:
        raise RuntimeError(
            f"The C compiler failed on {source}:\n{run.stderr}\nLook at its options in "
            "DOLFINx's cffi_extra_compile_args, or set the environment variable CC to a compiler "
            "that works, GCC or Clang."
        )
    made.replace(path)


def compiler() -> list[str]:
    """Return the C compiler that the environment names, or Python, or else cc."""
    command = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    return command if shutil.which(command[0]) else ["cc"]


@cache
def _structs() -> cffi.FFI:
    """Read FFCx's structs."""
    ffi = cffi.FFI()
    ffi.cdef(
        jit.UFC_HEADER_DECL.format("float64")
        + jit.UFC_INTEGRAL_DECL
        + jit.UFC_FORM_DECL
        + jit.UFC_EXPRESSION_DECL
    )
    return ffi
