"""Forms that were compiled once are found again, on later meshes and in later runs, and stay at hand in the process.

A form is made anew on each mesh. FFCx then looks for it in the folder of compiled forms and reads the list of all files
there. With some thousand files this takes 10 to 15 ms a form, half of the time of a small solve. Here FFCx remembers
what it has loaded.

UFL sorts the factors of a product by the text of the numbers of its Constants, in which "9" comes after "10". So forms
would be others, and would be compiled again, on the mesh on which the number of Constants made so far passes a power of
ten. Here all these numbers have ten digits.

Half of the time that a form takes to be compiled is that of calling the compiler. Forms that are needed together are
therefore compiled together.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import Any

import ffcx
import numpy as np
import ufl
from dolfinx import jit as dolfinx_jit
from ffcx.codegeneration import jit

FIRST = 10**9
"""Number of the first Constant."""


def number_constants_alike() -> None:
    """Let the numbers of all new Constants have ten digits."""
    if ufl.Constant._counter is None or next(ufl.Constant._counter) < FIRST:
        ufl.Constant._counter = count(FIRST)


_made_together: dict[Any, tuple[list[Any], Any, Any]] = {}
"""What :func:`compile_together` has compiled: FFCx's result for each form alone."""


def remember_forms() -> None:
    """Let FFCx load each compiled form once in a process, and find what was compiled together."""
    load, compile_forms = jit.get_cached_module, jit.compile_forms
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

    def compiled(forms: list[ufl.Form], options: Any = None, **settings: Any) -> Any:
        found = _made_together.get(_key(forms[0], options, settings)) if len(forms) == 1 else None
        return found or compile_forms(forms, options, **settings)

    remembered.remembers = True  # type: ignore[attr-defined]
    jit.get_cached_module, jit.compile_forms = remembered, compiled  # type: ignore[assignment]


@dolfinx_jit.mpi_jit_decorator
def compile_together(forms: Sequence[ufl.Form]) -> None:
    """Compile forms in one module, which ``fem.form`` of each then finds; collective over the ranks given first."""
    options, settings = ffcx.get_options({"scalar_type": np.float64}), dolfinx_jit.get_options()
    keys = [_key(form, options, settings) for form in forms]
    if all(key in _made_together for key in keys):
        return
    objects, module, code = jit.compile_forms(list(forms), options=options, **settings)
    _made_together.update({key: ([one], module, code) for key, one in zip(keys, objects, strict=True)})


def _key(form: ufl.Form, options: Any, settings: Any) -> Any:
    return form.signature(), repr(sorted((options or {}).items(), key=str)), repr(sorted(settings.items(), key=str))
