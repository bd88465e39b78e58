"""Versions of the package and of what it stands on, and the kind of the machine."""

from __future__ import annotations

import os
import platform
from functools import cache
from importlib import metadata

import dolfinx
from petsc4py import PETSc

OTHER_PACKAGES = ("gmsh", "pyvista", "vtk", "matplotlib", "meshio", "h5py", "cffi", "numpy")
"""Packages whose versions count beside the versions of DOLFINx and PETSc."""


def versions() -> dict[str, str]:
    """Return the version of each package by its name.

    It is "unknown" where it is not installed as a package.
    """
    result = {
        "erc_contact": _version_of("erc-contact"),
        "DOLFINx": dolfinx.__version__,
        "PETSc": ".".join(map(str, PETSc.Sys.getVersion())),
        "Python": platform.python_version(),
    }
    for name in OTHER_PACKAGES:
        result[name] = _version_of(name)
    return result


def machine() -> dict[str, str]:
    """Return what a run time depends on, without a name of the machine."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processors": str(os.cpu_count()),
    }


@cache
def _version_of(name: str) -> str:
    """Return the version of an installed package, or "unknown"."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"
