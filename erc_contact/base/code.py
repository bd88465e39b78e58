"""Values as the Python code that makes them, as far as it can be known."""

from __future__ import annotations

import ast
import inspect
import linecache
import re
import textwrap
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np

IMPORTED = ("import ufl as ufl", "import erc_contact as ec")
"""What code of ours imports anyhow."""
UNKNOWN = "callable"
"""Told of a callable whose source cannot be had."""
PATH = re.compile(r"""(["'])(?:/|~|[A-Za-z]:\\)[^"'\n]*\1""")
"""A text in quotes that is the path of a file."""


def code_of(value: Any) -> str:
    """A value as code: ``ec.Elastic(E=1.0, nu=0.3)``.

    Arguments that have their default are left out. Of a lambda it is the source, in
    which numbers from around it are defaults. Of another function it is the name, whose
    :func:`definitions` belong in front of the code. Where a source cannot be had, it is
    the word "callable". It never fails.
    """
    words = literal(value)
    if words is not None:
        return without_paths(words)
    if isinstance(value, tuple | list | np.ndarray):
        inside = ", ".join(code_of(one) for one in value)
        return f"({inside}{',' * (len(value) == 1)})" if isinstance(value, tuple) else f"[{inside}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key!r}: {code_of(one)}' for key, one in value.items())}}}"
    given = {} if inspect.isroutine(value) else arguments(value)
    if callable(value) and not given:
        return _code_of_function(value)
    return f"{_name(value)}({', '.join(f'{name}={code_of(one)}' for name, one in given.items())})"


def literal(value: Any) -> str | None:
    """Return None, a bool, a text or a number as a literal; None for other values.

    Numbers of numpy are those of Python.
    """
    if value is None or isinstance(value, bool | str):
        return repr(value)
    if isinstance(value, Integral):
        return repr(int(value))
    if isinstance(value, Real):
        return repr(float(value))
    return None


def definitions(value: Any, outer: tuple[Any, ...] = ()) -> list[str]:
    """What the code of a value needs in front of it: imports, sources of named functions, and what these take.

    A function takes numbers, parts of scenes and other functions from around it.

    Args:
        value: The value.
        outer: Functions whose definitions are under way.
    """
    if isinstance(value, Mapping | tuple | list):
        inside = list(value.values() if isinstance(value, Mapping) else value)
        return list(dict.fromkeys(source for one in inside for source in definitions(one, outer)))
    if not inspect.isfunction(value):
        return definitions(list(arguments(value).values()), outer)
    if value in outer:
        return []
    text, taken = _source(value)
    found = [
        f"import {one.__name__} as {name}" for name, one in taken.items() if inspect.ismodule(one)
    ]
    found = [line for line in found if line not in IMPORTED]
    if text[:4] != "def ":
        return found
    outer = (*outer, value)
    for name, one in taken.items():
        if inspect.isfunction(one) and one.__module__ == value.__module__:
            found += definitions(one, outer)
        elif isinstance(one, Real) or type(one).__module__.startswith("erc_contact.scene."):
            found += [*definitions(one, outer), f"{name} = {code_of(one)}"]
    return list(dict.fromkeys([*found, text]))


def arguments(value: Any) -> dict[str, Any]:
    """What makes an object: fields of a dataclass that have not their default, or the public attributes."""
    if not is_dataclass(value):
        return {
            name: one
            for name, one in getattr(value, "__dict__", {}).items()
            if not name.startswith("_")
        }
    given = {}
    for field in fields(value):
        one = getattr(value, field.name)
        plain = isinstance(one, tuple | str | Real | None)
        if field.init and not (plain and field.default is not MISSING and one == field.default):
            given[field.name] = one
    return given


def _code_of_function(function: Any) -> str:
    text, taken = _source(function)
    if text.startswith("lambda "):
        defaults = "".join(
            f", {name}={code_of(one)}" for name, one in taken.items() if isinstance(one, Real)
        )
        return text.replace(":", f"{defaults}:", 1)
    return getattr(function, "__name__", UNKNOWN) if text else UNKNOWN


def _source(function: Any) -> tuple[str, dict[str, Any]]:
    """The source of a function without paths of files, and what it takes from around it; empty if unknown.

    A report must not fail for want of a source.
    """
    try:
        code = function.__code__
        whole = "".join(linecache.getlines(code.co_filename))
        text = textwrap.dedent(
            ast.get_source_segment(whole, _node(ast.parse(whole), code), padded=True) or ""
        ).strip()
        around = inspect.getclosurevars(function)
    except Exception:
        return "", {}
    return without_paths(text), {**around.globals, **around.nonlocals}


def without_paths(text: str) -> str:
    """A text without the paths of files that it quotes."""
    return PATH.sub(r"\1...\1", text)


def _node(tree: ast.AST, code: Any) -> Any:
    """The function or lambda in a module that has this code."""
    ends = {place[2:] for place in code.co_positions() if None not in place}
    found = []
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.FunctionDef)
            and node.name == code.co_name
            and _first_line(node) == code.co_firstlineno
        ):
            return node
        if (
            isinstance(node, ast.Lambda)
            and node.lineno == code.co_firstlineno
            and code.co_name == "<lambda>"
        ):
            found.append(node)
    return next(
        n for n in found if len(found) == 1 or (n.body.col_offset, n.body.end_col_offset) in ends
    )


def _first_line(node: ast.FunctionDef) -> int:
    return min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])


def _name(value: Any) -> str:
    kind = type(value)
    return (
        f"ec.{kind.__name__}" if kind.__module__.split(".")[0] == "erc_contact" else kind.__name__
    )
