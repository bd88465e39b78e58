"""Forms that were compiled or loaded once stay at hand in the process.

FFCx looks for each form in its folder of compiled forms, every time it is made anew on another mesh, and reads the whole
list of files for it: 10 to 15 ms with some thousand files, half of the time of a small solve. What it has loaded once
is remembered here.
"""

from __future__ import annotations

from typing import Any

from ffcx.codegeneration import jit


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
