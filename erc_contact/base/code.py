"""Values as the Python code that makes them, as far as it can be known."""

from __future__ import annotations

import ast
import inspect
import linecache
import re
import sys
import textwrap
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np

IMPORTED = ("import ufl as ufl", "import erc_contact as ec")
"""Imports of code that the package writes."""
LIBRARIES = ("builtins", "erc_contact", "namedmesh", "numpy", "ufl", "dolfinx", "mpi4py")
"""Packages whose classes are imported."""
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

    These are imports, sources of named functions and of classes, and what these take
    from around them: plain values, arrays, parts of scenes, functions and classes.

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
    if value in outer:
        return []
    if inspect.isfunction(value):
        text, surroundings = _source(value)
    elif inspect.isclass(value):
        text, surroundings = _source_of_class(value)
    else:
        of_class = definitions(type(value), outer)
        of_arguments = definitions(list(arguments(value).values()), outer)
        return _without_repetitions([*of_class, *of_arguments])
    outer = (*outer, value)
    is_lambda = text.startswith("lambda ")
    needed = []
    for name, neighbour in surroundings.items():
        # Numbers around a lambda are its defaults.
        if not (is_lambda and isinstance(neighbour, Real)):
            needed += _neighbour(name, neighbour, value.__module__, outer)
    return _without_repetitions(needed if is_lambda or not text else [*needed, text])


def _neighbour(name: str, value: Any, module: str, outer: tuple[Any, ...]) -> list[str]:
    """Return the code that gives a name its value; none where it cannot be known.

    Args:
        name: The name.
        value: The value.
        module: Module of the code that needs it.
        outer: Functions whose definitions are under way.
    """
    if inspect.ismodule(value):
        line = f"import {value.__name__} as {name}"
        return [] if line in IMPORTED else [line]
    home = getattr(value, "__module__", None)
    if isinstance(home, str) and isinstance(getattr(value, "__name__", None), str):
        if home == module:
            return definitions(value, outer)
        is_there = getattr(sys.modules.get(home), value.__name__, None) is value
        return [f"from {home} import {value.__name__} as {name}"] if is_there else []
    is_part = type(value).__module__.startswith("erc_contact.scene.")
    if isinstance(value, np.ndarray):
        return ["import numpy as np", f"{name} = np.array({code_of(value.tolist())})"]
    if is_part or isinstance(value, Real | str | tuple | list | Mapping):
        return [*definitions(value, outer), f"{name} = {code_of(value)}"]
    return []


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
        nonlocals = inspect.getclosurevars(function).nonlocals
        around = _used(node, {**function.__globals__, **nonlocals})
    except Exception:
        return "", {}
    return without_paths(textwrap.dedent(text).strip()), around


def _source_of_class(kind: type) -> tuple[str, dict[str, Any]]:
    """Return the source of a user's class, and what it takes from around it.

    Both are empty for a class of a library, and if the source is unknown.
    """
    if kind.__module__.split(".")[0] in LIBRARIES:
        return "", {}
    try:
        text = textwrap.dedent(inspect.getsource(kind)).strip()
        tree = ast.parse(text)
        around = _used(tree, vars(sys.modules[kind.__module__]))
    except Exception:
        return "", {}
    return without_paths(text), around


def _used(tree: ast.AST, around: Mapping[str, Any]) -> dict[str, Any]:
    """Return what code takes by name from around it, functions inside it, too."""
    inside = {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    read = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            if isinstance(node.ctx, ast.Load):
                read.append(node.id)
            else:
                inside.add(node.id)
    return {name: around[name] for name in read if name in around and name not in inside}


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
    root, *inside = kind.__module__.split(".")
    if root not in ("erc_contact", "namedmesh"):
        return kind.__name__
    # What is not public stands in its module.
    is_public = hasattr(sys.modules["erc_contact"], kind.__name__)
    return ".".join(["ec", *([] if is_public else inside), kind.__name__])
