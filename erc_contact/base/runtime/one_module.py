"""Compile forms and expressions in one module.

FFCx generates code for both at once, but its two doors to the C compiler take forms
only, or expressions only. This does what they do, step by step.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ffcx
import numpy as np
import ufl
from dolfinx import jit as dolfinx_jit
from ffcx import naming
from ffcx.codegeneration import jit

DECLARATIONS = jit.UFC_INTEGRAL_DECL + jit.UFC_FORM_DECL + jit.UFC_EXPRESSION_DECL
"""What C must know of the objects of a module."""


@dolfinx_jit.mpi_jit_decorator
def one_module(sources: list[Any], options: dict[str, Any]) -> tuple[list[Any], Any]:
    """Return FFCx's objects for forms and expressions, and their module; collective.

    The decorator adds the communicator as first argument of a call. Rank 0 compiles,
    and the others load what it has made.

    Args:
        sources: Forms, and pairs of an expression and its reference points.
        options: Options of FFCx.
    """
    ffcx_options = ffcx.get_options(options)
    settings = dolfinx_jit.get_options()
    flags = settings["cffi_extra_compile_args"]
    debug = settings["cffi_debug"]
    folder = Path(settings["cache_dir"])
    # The name knows all that decides on the code, and so do those of the objects.
    tag = jit._compute_option_signature(ffcx_options) + jit._compilation_signature(flags, debug)
    module_name = "libffcx_forms_" + naming.compute_signature(sources, tag)
    declarations = jit.UFC_HEADER_DECL.format(np.dtype(options["scalar_type"]).name)
    declarations += DECLARATIONS
    # Contacts that are alike have the same expression, which C may define once only.
    different: dict[str, Any] = {}
    order = []
    for number, source in enumerate(sources):
        is_form = isinstance(source, ufl.Form)
        if is_form:
            name = naming.form_name(source, number, module_name)
        else:
            name = naming.expression_name(source, module_name)
        if name not in different:
            kind = "form" if is_form else "expression"
            declarations += f"extern ufcx_{kind} {name};\n"
        different[name] = source
        order.append(name)
    names = list(different)
    objects, module = jit.get_cached_module(module_name, names, folder, settings["timeout"])
    if objects is None:
        try:
            jit._compile_objects(
                declarations,
                list(different.values()),
                names,
                module_name,
                ffcx_options,
                folder,
                flags,
                settings["cffi_verbose"],
                debug,
                settings["cffi_libraries"],
            )
        except Exception:
            # Who compiles it next must not wait for this one.
            code = folder / f"{module_name}.c"
            code.replace(code.with_suffix(".c.failed"))
            raise
        objects, module = jit._load_objects(folder, module_name, names)
    of_name = dict(zip(names, objects, strict=True))
    return [of_name[name] for name in order], module
