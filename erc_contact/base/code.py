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
"""Imports of code that the package writes."""
UNKNOWN = "callable"
"""Word for a callable whose source cannot be had."""
PATH = re.compile(r"""(["'])(?:/|~|[A-Za-z]:\\)[^"'\n]*\1""")
"""A text in quotes that is the path of a file."""


def code_of(value: Any) -> str:
    """Return a value as code: ``ec.Elastic(E=1.0, nu=0.3)``.

    Arguments that have their default are left out. Of a lambda it is the source, in
    which numbers from around it are defaults. Of another function it is the name, whose
    :func:`definitions` belong in front of the code. Where a source cannot be had, it is
    the word "callable". It never fails.
    """
    words = literal(value)
    if words is not None:
        return without_paths(words)
    if isinstance(value, tuple | list | np.ndarray):
        return _code_of_sequence(value)
    if isinstance(value, Mapping):
        items = [f"{key!r}: {code_of(entry)}" for key, entry in value.items()]
        return f"{{{', '.join(items)}}}"
    keywords = {} if inspect.isroutine(value) else arguments(value)
    if callable(value) and not keywords:
        return _code_of_function(value)
    inside = [f"{name}={code_of(argument)}" for name, argument in keywords.items()]
    return f"{_name(value)}({', '.join(inside)})"


def literal(value: Any) -> str | None:
    """Return None, a bool, a text or a number as a literal; None for other values.

    Numbers of numpy are written as numbers of Python.
    """
    if value is None or isinstance(value, bool | str):
        return repr(value)
    if isinstance(value, Integral):
        return repr(int(value))
    if isinstance(value, Real):
        return repr(float(value))
    return None


def definitions(value: Any, outer: tuple[Any, ...] = ()) -> list[str]:
    """Return what the code of a value needs in front of it.

    These are imports, sources of named functions, and what these take from around
    them: numbers, parts of scenes and other functions.

    Args:
        value: The value.
        outer: Functions whose definitions are under way.
    """
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, tuple | list):
        needed: list[str] = []
        for entry in value:
            needed += definitions(entry, outer)
        return _without_repetitions(needed)
    if not inspect.isfunction(value):
        return definitions(list(arguments(value).values()), outer)
    if value in outer:
        return []
    text, surroundings = _source(value)
    needed = []
    for name, neighbour in surroundings.items():
        if inspect.ismodule(neighbour):
            line = f"import {neighbour.__name__} as {name}"
            if line not in IMPORTED:
                needed.append(line)
    if not text.startswith("def "):
        return needed
    outer = (*outer, value)
    for name, neighbour in surroundings.items():
        is_part = type(neighbour).__module__.startswith("erc_contact.scene.")
        if inspect.isfunction(neighbour) and neighbour.__module__ == value.__module__:
            needed += definitions(neighbour, outer)
        elif isinstance(neighbour, Real) or is_part:
            needed += definitions(neighbour, outer)
            needed.append(f"{name} = {code_of(neighbour)}")
    return _without_repetitions([*needed, text])


def arguments(value: Any) -> dict[str, Any]:
    """Return the arguments that make an object.

    They are the fields of a dataclass that have not their default, or the public
    attributes of another object.
    """
    result = {}
    if not is_dataclass(value):
        for name, attribute in getattr(value, "__dict__", {}).items():
            if not name.startswith("_"):
                result[name] = attribute
        return result
    for field in fields(value):
        attribute = getattr(value, field.name)
        # Only plain values are compared: arrays and expressions have no truth value.
        is_plain = isinstance(attribute, tuple | str | Real | None)
        is_default = is_plain and field.default is not MISSING and attribute == field.default
        if field.init and not is_default:
            result[field.name] = attribute
    return result


def without_paths(text: str) -> str:
    """Return a text without the paths of files that it quotes."""
    return PATH.sub(r"\1...\1", text)


def _without_repetitions(lines: list[str]) -> list[str]:
    """Return lines in order, each of them once."""
    return list(dict.fromkeys(lines))


def _code_of_sequence(values: Any) -> str:
    """Return a tuple, a list or an array as code."""
    inside = ", ".join(code_of(entry) for entry in values)
    if not isinstance(values, tuple):
        return f"[{inside}]"
    comma = "," if len(values) == 1 else ""
    return f"({inside}{comma})"


def _code_of_function(function: Any) -> str:
    """Return the source of a lambda, or the name of another function."""
    text, surroundings = _source(function)
    if text.startswith("lambda "):
        defaults = ""
        for name, neighbour in surroundings.items():
            if isinstance(neighbour, Real):
                defaults += f", {name}={code_of(neighbour)}"
        return text.replace(":", f"{defaults}:", 1)
    return getattr(function, "__name__", UNKNOWN) if text else UNKNOWN


def _source(function: Any) -> tuple[str, dict[str, Any]]:
    """Return the source of a function without paths, and what it takes from around it.

    Both are empty if the source is unknown: a report must not fail for want of it.
    """
    try:
        code = function.__code__
        module = "".join(linecache.getlines(code.co_filename))
        node = _node(ast.parse(module), code)
        text = ast.get_source_segment(module, node, padded=True) or ""
        around = inspect.getclosurevars(function)
    except Exception:
        return "", {}
    plain = textwrap.dedent(text).strip()
    return without_paths(plain), {**around.globals, **around.nonlocals}


def _node(tree: ast.AST, code: Any) -> Any:
    """Find the function or lambda in a module that has this code.

    Raises:
        StopIteration: If there is none.
    """
    lambdas = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            if node.name == code.co_name and _first_line(node) == code.co_firstlineno:
                return node
            continue
        if not isinstance(node, ast.Lambda) or code.co_name != "<lambda>":
            continue
        if node.lineno == code.co_firstlineno:
            lambdas.append(node)
    if len(lambdas) == 1:
        return lambdas[0]
    # Several lambdas on a line: the one whose body ends where the code ends.
    ends = {position[2:] for position in code.co_positions() if None not in position}
    return next(n for n in lambdas if (n.body.col_offset, n.body.end_col_offset) in ends)


def _first_line(node: ast.FunctionDef) -> int:
    """Return the line where a function with its decorators begins."""
    return min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])


def _name(value: Any) -> str:
    """Return the name of the type of a value in code."""
    kind = type(value)
    is_ours = kind.__module__.split(".")[0] == "erc_contact"
    return f"ec.{kind.__name__}" if is_ours else kind.__name__
