"""The package can be read from top to bottom, and costs nothing that is not asked for.

Properties: a module imports only from modules above it (at module level; functions may import optional packages and
output); every module is in that order; ``import erc_contact`` loads no plotting or file-format package.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import erc_contact as ec

pytestmark = pytest.mark.serial

PACKAGE = Path(ec.__file__).parent
ORDER = [
    [
        "interpreter",
        "percent",
        "exceptions",
        "logs",
        "checks",
        "interrupts",
        "material",
        "law",
        "simplex",
        "quadrature",
        "partition",
    ],
    ["surface", "domain", "geometry", "meshing", "scene"],
    ["expressions", "users", "foundation", "promises", "motions", "model"],
    ["methods", "stiffness", "condensed", "newton", "start", "ladder", "solve"],
    [
        f"admissible.{name}"
        for name in ("geometry", "loads", "macro", "facets", "cones", "balance", "allowed", "contact", "displacement")
    ],
    [f"admissible.{name}" for name in ("energy", "patches", "blocks", "tighten")],
    ["admissible", "oscillation", "results", "error", "works", "goal", "sizes", "strategy", "history", "adapt"],
    ["files", "fields", "drawing", "plots", "bodies", "pictures", "output"],
]
ORDER = [module for part in ORDER for module in part]


def module_of(path):
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


def imported(path):
    """Modules of the package that a file imports at module level; ``from erc_contact import x`` counts as x."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "erc_contact":
            yield from [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            yield from [alias.name for alias in node.names if alias.name.split(".")[0] == "erc_contact"]


FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


@pytest.mark.parametrize("path", FILES, ids=module_of)
def test_modules_import_from_above_only(path):
    module = module_of(path)
    assert module in ORDER, f"{module}: give the module its place in ORDER"
    above = ORDER[: ORDER.index(module)]
    for full_name in imported(path):
        name = full_name.removeprefix("erc_contact").removeprefix(".")
        assert any(name == m or name.startswith(f"{m}.") for m in above), f"{module} imports {name}, not above it"


@pytest.mark.serial
def test_import_loads_no_optional_package():
    code = "import sys, erc_contact; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert "erc_contact" in run.stdout.split()
    assert not {"pyvista", "vtkmodules", "matplotlib", "meshio", "gmsh", "rich"} & set(run.stdout.split())
