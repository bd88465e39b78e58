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

from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

import ffcx
import numpy as np
import ufl
from dolfinx import jit as dolfinx_jit
from ffcx import naming
from ffcx.codegeneration import jit

FIRST = 10**9
"""Number of the first Constant."""


def number_constants_alike() -> None:
    """Let the numbers of all new Constants have ten digits."""
    if ufl.Constant._counter is None or next(ufl.Constant._counter) < FIRST:
        ufl.Constant._counter = count(FIRST)


_known: dict[Any, tuple[list[Any], Any, Any]] = {}
"""FFCx's result for each form and each expression that this process has compiled or loaded."""


def remember_forms() -> None:
    """Let FFCx compile or load each form and each expression once in a process."""
    if not getattr(jit.compile_forms, "remembers", False):
        jit.compile_forms, jit.compile_expressions = map(_remembering, (jit.compile_forms, jit.compile_expressions))


def _remembering(compile_all: Callable[..., Any]) -> Callable[..., Any]:
    def compiled(objects: list[Any], options: Any = None, **settings: Any) -> Any:
        key = _key(objects[0], options, settings) if len(objects) == 1 else None
        if key in _known:
            return _known[key]
        result = compile_all(objects, options or {}, **settings)
        if key is not None:
            _known[key] = *result[:2], (None, None)
        return result

    compiled.remembers = True  # type: ignore[attr-defined]
    return compiled


@dolfinx_jit.mpi_jit_decorator
def compile_together(forms: Sequence[ufl.Form]) -> None:
    """Compile forms in one module, which ``fem.form`` of each then finds; collective over the ranks given first."""
    options, settings = ffcx.get_options({"scalar_type": np.float64}), dolfinx_jit.get_options()
    keys = [_key(form, options, settings) for form in forms]
    if all(key in _known for key in keys):
        return
    made, module, _ = jit.compile_forms(list(forms), options=options, **settings)
    _known.update({key: ([one], module, (None, None)) for key, one in zip(keys, made, strict=True)})


def _key(one: Any, options: Any, settings: Any) -> Any:
    signature = one.signature() if isinstance(one, ufl.Form) else naming.compute_signature([one], "")
    return signature, repr(options), repr(settings)
