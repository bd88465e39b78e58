"""A fault of an interpreter that would keep every form, and with it every mesh and its communicators, for ever.

``functools.singledispatchmethod`` of Python 3.13.0 keeps a weak dictionary of objects whose values hold these objects:
nothing in it is ever freed. UFL differentiates with such methods, so each form stays, and after some 60 adaptive runs
MPI has no communicator left. Later releases of 3.13 have mended it, 3.12 does not have the dictionary.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from functools import singledispatchmethod
from typing import Any

from ufl.corealg.dag_traverser import DAGTraverser


def keeps_objects() -> bool:
    """Whether an object stays alive because one of its single-dispatch methods was called."""

    class Probe:
        @singledispatchmethod
        def method(self, argument: object) -> None:
            """Do nothing."""

    probe = Probe()
    probe.method(0)
    alive = weakref.ref(probe)
    del probe
    return alive() is not None


def free_forms() -> None:
    """Switch the dictionaries of UFL's methods off, where the interpreter has the fault.

    The methods themselves do without one: they set it to None for objects that cannot be referred to weakly.
    """
    if not keeps_objects():
        return
    for cls in _subclasses(DAGTraverser):
        for method in vars(cls).values():
            if isinstance(method, singledispatchmethod) and hasattr(method, "_method_cache"):
                method._method_cache = None


def _subclasses(cls: Any) -> Iterator[Any]:
    yield cls
    for child in cls.__subclasses__():
        yield from _subclasses(child)
