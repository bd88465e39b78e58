"""Forms that were compiled or loaded once stay at hand in the process.

A form is made anew on each mesh. FFCx then looks for it in the folder of compiled forms and reads the list of all files
there. With some thousand files this takes 10 to 15 ms a form, half of the time of a small solve. Here FFCx remembers
what it has loaded.
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
