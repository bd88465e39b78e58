"""Forms that were compiled once are found again, on later meshes and in later runs, and stay at hand in the process.

A form is made anew on each mesh. FFCx then looks for it in the folder of compiled forms and reads the list of all files
there. With some thousand files this takes 10 to 15 ms a form, half of the time of a small solve. Here FFCx remembers
what it has loaded.

UFL sorts the factors of a product by the text of the numbers of its Constants, in which "9" comes after "10". So forms
would be others, and would be compiled again, on the mesh on which the number of Constants made so far passes a power of
ten. Here all these numbers have ten digits.
"""

from __future__ import annotations

from itertools import count
from typing import Any

import ufl
from ffcx.codegeneration import jit

FIRST = 10**9
"""Number of the first Constant."""


def number_constants_alike() -> None:
    """Let the numbers of all new Constants have ten digits."""
    if ufl.Constant._counter is None or next(ufl.Constant._counter) < FIRST:
        ufl.Constant._counter = count(FIRST)


def remember_forms() -> None:
    """Let FFCx load each compiled form once in a process."""
    load = jit.get_cached_module
    if getattr(load, "remembers", False):
        return
    known: dict[tuple[str, tuple[str, ...], str], Any] = {}

    def remembered(module_name: str, object_names: Any, cache_dir: Any, timeout: Any) -> Any:
        key = module_name, tuple(object_names), str(cache_dir)
        if key not in known:
            found = load(module_name, object_names, cache_dir, timeout)
            if found[1] is None:  # to be compiled now
                return found
            known[key] = found
        return known[key]

    remembered.remembers = True  # type: ignore[attr-defined]
    jit.get_cached_module = remembered
