"""Bridge what differs between releases of DOLFINx and of what comes with them.

The package works with DOLFINx 0.10 and 0.11. Each function here says what it bridges,
and can go with the older release.
"""

from __future__ import annotations

from typing import Any

import cffi
import dolfinx
import ffcx.compiler
import numpy as np
from dolfinx import mesh as dmesh
from petsc4py import PETSc

OLDEST = (0, 10)
"""The oldest release of DOLFINx that is known to work."""
OLDEST_CFFI = (2, 0)
"""The oldest release of cffi that reads the complex numbers in FFCx's declarations."""
WHEEL = "pip install 'dolfinx-solver-real>=0.11,<0.12'"
"""What brings a DOLFINx that works."""


def numbers(version: str) -> tuple[int, int]:
    """Return the first two numbers of a version, "0.11.0.dev0" for instance."""
    first, second = version.split(".")[:2]
    return int(first), int(second)


def check_releases(dolfinx_version: str, cffi_version: str) -> None:
    """Check that DOLFINx and cffi are new enough.

    Raises:
        ImportError: If they are not.
    """
    if numbers(dolfinx_version) < OLDEST:
        raise ImportError(
            f"namedmesh needs DOLFINx 0.10 or newer, and this is {dolfinx_version}; the wheel "
            f"has 0.11, in an environment of its own: {WHEEL} (Linux with glibc 2.34, Python 3.12 "
            "or newer)."
        )
    if numbers(cffi_version) < OLDEST_CFFI:
        raise ImportError(
            f"namedmesh needs cffi 2.0 or newer, and this is {cffi_version}, which cannot read "
            "what FFCx declares: pip install 'cffi>=2.0'."
        )


check_releases(dolfinx.__version__, cffi.__version__)

IS_0_10 = numbers(dolfinx.__version__) == (0, 10)
"""Whether this is DOLFINx 0.10."""


def cell_nodes(geometry: dmesh.Geometry) -> np.ndarray:
    """Return the nodes of the cells of this rank; 0.10 knows one type of cell only."""
    return geometry.dofmap if IS_0_10 else geometry.dofmaps[0]


def coordinate_map(geometry: dmesh.Geometry) -> Any:
    """Return the coordinate element of a mesh; 0.10 knows one type of cell only."""
    return geometry.cmap if IS_0_10 else geometry.cmaps[0]


def c_code(sources: list[Any], name: str, options: dict[str, Any]) -> str:
    """Return the C code of forms and expressions.

    FFCx 0.10 returns header and body, 0.11 both in a list, and suffixes of files.

    Args:
        sources: The forms and expressions.
        name: Beginning of the names in the code.
        options: FFCx's options.
    """
    compiled: Any = ffcx.compiler.compile_ufl_objects
    if IS_0_10:
        _, body = compiled(sources, prefix=name, options=options)
    else:
        (_, body), _ = compiled(sources, namespace=name, options=options)
    return str(body)


def other_domains(integral: Any) -> dict[Any, str]:
    """Return the kinds of an integral on other meshes, new in UFL 2026.1."""
    if not hasattr(integral, "extra_domain_integral_type_map"):
        return {}
    return dict(integral.extra_domain_integral_type_map())


def not_a_number() -> PETSc.SNES.ConvergedReason:
    """Return PETSc's reason for a residual that is no number, renamed in PETSc 3.25."""
    reasons = PETSc.SNES.ConvergedReason
    name = "DIVERGED_FUNCTION_NANORINF"
    return getattr(reasons, name if hasattr(reasons, name) else "DIVERGED_FNORM_NAN")


def cell_partitioner() -> Any:
    """Return DOLFINx's partitioner without ghosts; 0.12 will have another interface."""
    return dmesh.create_cell_partitioner(dmesh.GhostMode.none, 2)
