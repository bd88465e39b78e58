"""Name the nearest argument where a user misspells a keyword.

Python does so from 3.13 on. Calls that succeed pass through one function more.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable
from dataclasses import is_dataclass
from difflib import get_close_matches
from functools import wraps
from inspect import isfunction, signature
from typing import Any

UNEXPECTED = re.compile(r"got an unexpected keyword argument '(\w+)'$")
"""How Python ends a message about a keyword that is not there."""


def name_nearest(module: str, names: Iterable[str]) -> None:
    """Let functions and dataclasses of a module name the nearest argument, in place.

    Args:
        module: Name of the module that has them.
        names: Their names.
    """
    if sys.version_info >= (3, 13):
        return
    public = vars(sys.modules[module])
    for name in names:
        value = public[name]
        if is_dataclass(value) and isinstance(value, type):
            type.__setattr__(value, "__init__", _naming(vars(value)["__init__"]))
        elif isfunction(value):
            # Where it is defined, too: by that name it is found again, as by pickle.
            public[name] = _naming(value)
            setattr(sys.modules[value.__module__], value.__name__, public[name])


def _naming(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function, whose errors name the nearest argument."""

    @wraps(function)
    def call(*positional: Any, **named: Any) -> Any:
        try:
            return function(*positional, **named)
        except TypeError as error:
            found = UNEXPECTED.search(str(error))
            # The error of a call inside is told as it is.
            if found is None or found[1] not in named or error.__traceback__.tb_next:  # type: ignore[union-attr]
                raise
            near = get_close_matches(found[1], signature(function).parameters, n=1)
            if not near:
                raise
            raise TypeError(f"{error}. Did you mean {near[0]!r}?") from None

    return call
