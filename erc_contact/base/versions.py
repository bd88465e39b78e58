"""Versions of the package and of what it stands on, and what is known of the machine."""

from __future__ import annotations

import os
import platform
from importlib import metadata

import dolfinx
from petsc4py import PETSc

KNOWN = ("gmsh", "pyvista", "matplotlib", "meshio", "h5py", "numpy")
"""Packages whose versions are told beside those of DOLFINx and PETSc."""


def versions() -> dict[str, str]:
    """The version of each package by its name; "unknown" where it is not installed as one."""
    told = {"erc_contact": _installed("erc-contact"), "DOLFINx": dolfinx.__version__}
    told["PETSc"] = ".".join(map(str, PETSc.Sys.getVersion()))
    told["Python"] = platform.python_version()
    return told | {name: _installed(name) for name in KNOWN}


def machine() -> dict[str, str]:
    """What a run time depends on, without a name of the machine."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processors": str(os.cpu_count()),
    }


def _installed(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"
