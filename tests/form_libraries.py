"""Forms that tests give to DOLFINx themselves are plain C libraries, as the package's are.

They then compile as fast. Scripts that tests start as processes of their own leave
DOLFINx and FFCx as they are.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import cache, singledispatchmethod
from pathlib import Path
from typing import Any

import basix.ufl
import numpy as np
from dolfinx import jit as dolfinx_jit
from ffcx.codegeneration import jit
from ffcx.ir import elementtables
from ffcx.ir.analysis.valuenumbering import ValueNumberer
from processes import OPTIONS

from erc_contact.base.runtime.form_library import FormLibrary, form_library
from namedmesh.base.releases import c_code


def install() -> None:
    """Let FFCx compile and load forms so, in this process."""
    dolfinx_jit._load_options = lambda: ({}, {})  # options of the user count no more
    dolfinx_jit.DOLFINX_DEFAULT_JIT_OPTIONS["cffi_extra_compile_args"] = (OPTIONS, "options of C")
    jit.get_cached_module = lambda *_: (None, None)
    jit._compile_objects = compiled
    jit._load_objects = loaded


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
) -> None:
    """Do what FFCx's ``_compile_objects`` does."""

    def code() -> str:
        return c_code(list(sources), library, options)

    form_library(_path(folder, library), flags, code)


def loaded(folder: Path, library: str, names: Sequence[str]) -> tuple[list[Any], FormLibrary]:
    """Do what FFCx's ``_load_objects`` does."""
    opened = form_library(_path(folder, library), (), str)
    return opened.objects(names), opened


def _path(folder: Path, library: str) -> Path:
    """Return the path of a library, and not of a module of cffi, which scripts make."""
    return Path(folder) / f"tests_{library}.so"


def repair() -> None:
    """Let UFL, FFCx and Python do once what they do for each call."""
    import ufl

    cell = cache(ufl.Cell)
    basix.ufl._ElementBase.cell = property(lambda element: cell(element._cellname))
    # It looks through all nodes for each one.
    ValueNumberer.get_node_symbols = lambda self, node: self.V_symbols[self.G.e2i[node]]
    for name in ("analyse_table_type", "equal_tables", "is_permuted_table"):
        setattr(elementtables, name, _once(getattr(elementtables, name)))
    if sys.version_info < (3, 13):  # later ones keep their wrappers
        singledispatchmethod.__get__ = _bound


def _once(question: Callable[..., Any]) -> Callable[..., Any]:
    """Answer a question on tables of elements once: forms share elements and rules.

    FFCx compares each table of each form with zeros, ones, its own rows and other tables.
    """
    answers: dict[Any, Any] = {}

    def answer(*tables: Any, **tolerances: float) -> Any:
        arrays = [np.asarray(table) for table in tables]
        key = (*((array.shape, array.tobytes()) for array in arrays), *tolerances.values())
        if key not in answers:
            answers[key] = question(*tables, **tolerances)
        return answers[key]

    return answer


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
