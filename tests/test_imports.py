"""The package can be read from top to bottom, and costs nothing that is not asked for.

- Packages stand in the order of the data; a module imports only from its own package and from those above.
- No circle between modules. Imports inside functions and those for types alone count, too.
- The longest chain of modules that import each other stays short.
- ``import erc_contact`` loads no plotting or file-format package.
"""

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import erc_contact as ec

PACKAGE = Path(ec.__file__).parent
ORDER = ["base", "scene", "mesh", "model", "newton", "admissible", "results", "error", "output", "run", "__main__", ""]
"""The way of the data; the last one is the package itself."""
FLOORS = 18
"""Modules in the longest chain of imports."""


def module_of(path):
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


MODULES = {module_of(path): path for path in PACKAGE.rglob("*.py")}


def imported(path):
    """Modules of the package that a file imports, wherever in the file."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "erc_contact":
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (name if name in MODULES else node.module for name in names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] == "erc_contact")


IMPORTS = {module: set(imported(path)) - {module} for module, path in MODULES.items()}


def stage(module):
    """The package that a module is in."""
    return [*module.split("."), ""][1]


@pytest.mark.parametrize("module", sorted(MODULES))
def test_modules_import_from_above_only(module):
    assert stage(module) in ORDER, f"{module}: give its package a place in ORDER"
    below = {other for other in IMPORTS[module] if ORDER.index(stage(other)) > ORDER.index(stage(module))}
    assert not below, f"{module} imports {below} from stages that come later"


def test_no_circles_and_no_long_chains():
    height = {}
    for module in TopologicalSorter(IMPORTS).static_order():  # raises CycleError
        height[module] = 1 + max((height[other] for other in IMPORTS[module]), default=0)
    assert max(height.values()) <= FLOORS, max(height, key=height.get)


@pytest.mark.serial
def test_import_loads_no_optional_package():
    code = "import sys, erc_contact; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert "erc_contact" in run.stdout.split()
    assert not {"pyvista", "vtkmodules", "matplotlib", "meshio", "gmsh", "rich"} & set(run.stdout.split())
