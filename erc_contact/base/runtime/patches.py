"""Changes of other libraries, only while this package calls them itself.

The user may refuse them. There are five such changes:

- DOLFINx finds a form that it has compiled already
  (:mod:`erc_contact.base.runtime.compiled`),
- the Constants of the package have numbers of equally many digits (the same module),
- variables of an expression are numbered as they are met when it is signed (the same
  module),
- FFCx finds the nodes of an expression by their numbers (the same module),
- UFL's methods do not keep objects for ever, on Python 3.13.0
(:func:`method_caches_off`).

``functools.singledispatchmethod`` of Python 3.13.0 keeps a weak dictionary of objects
whose values hold these objects: nothing in it is ever freed. UFL differentiates with
such methods, so each form would stay, with its mesh and the communicators of this, and
after some 60 adaptive runs MPI would have no communicator left. Later releases of 3.13
have mended it, 3.12 does not have the dictionary.

With the environment variable ``ERC_CONTACT_PATCHES=0`` none of them is made. Results
are the same, small meshes take longer, and a Python with the fault keeps every form.
"""

from __future__ import annotations

import os
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, singledispatchmethod
from typing import Any

from ufl.corealg.dag_traverser import DAGTraverser

SWITCH = "ERC_CONTACT_PATCHES"
"""Environment variable that refuses all changes if it is 0, on all ranks alike."""


def refused() -> bool:
    """Tell whether the user refuses changes of other libraries."""
    return os.environ.get(SWITCH, "1").strip() == "0"


@contextmanager
def replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    """Give an attribute of another library a value within a context.

    Args:
        owner: Its module or class.
        name: Name of the attribute.
        value: What it is within the context.
    """
    usual = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, usual)


def keeps_objects() -> bool:
    """Tell whether calling a single-dispatch method of an object keeps it alive."""

    class Probe:
        @singledispatchmethod
        def method(self, argument: object) -> None:
            """Do nothing."""

    probe = Probe()
    probe.method(0)
    alive = weakref.ref(probe)
    del probe
    return alive() is not None


@contextmanager
def method_caches_off() -> Iterator[None]:
    """Switch the dictionaries of UFL's methods off within a context.

    It does nothing unless the interpreter has the fault. The methods themselves do
    without one: they set it to None for objects that cannot be referred to weakly. All
    that makes UFL differentiate stands in such a context.
    """
    methods = [] if refused() else _faulty_methods()
    dictionaries = [method._method_cache for method in methods]
    for method in methods:
        method._method_cache = None
    try:
        yield
    finally:
        for method, dictionary in zip(methods, dictionaries, strict=True):
            method._method_cache = dictionary


@cache
def _faulty_methods() -> list[Any]:
    """Find the methods of UFL that would keep objects, none without the fault."""
    if not keeps_objects():
        return []
    methods = []
    for cls in _subclasses(DAGTraverser):
        for method in vars(cls).values():
            if isinstance(method, singledispatchmethod) and hasattr(method, "_method_cache"):
                methods.append(method)
    return methods


def _subclasses(cls: Any) -> Iterator[Any]:
    """Generate a class and all classes derived from it."""
    yield cls
    for child in cls.__subclasses__():
        yield from _subclasses(child)
