"""Read which modules of the two packages import which, without importing them."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGES = ("erc_contact", "namedmesh")
MESHES = ROOT / "namedmesh"
ORDER = [
    "namedmesh",
    "base",
    "scene",
    "model",
    "newton",
    "admissible",
    "results",
    "error",
    "output",
    "run",
    "decks",
    "command",
    "__main__",
    "",
]
"""The way of the data; the last one is the package itself."""


def module_of(path: Path) -> str:
    """Return the name of the module in a file."""
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    return name.removesuffix(".__init__")


MODULES = {
    module_of(path): path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))
}


def imported(path: Path) -> Iterator[str]:
    """Yield the modules of the packages that a file imports, wherever in the file."""
    for node in ast.walk(ast.parse(path.read_text())):
        is_door = isinstance(node, ast.ImportFrom) and node.module == "namedmesh"
        if is_door and not path.is_relative_to(MESHES):
            yield "namedmesh"
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PACKAGES:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (name if name in MODULES else str(node.module) for name in names)
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
            yield from (name for name in names if name.split(".")[0] in PACKAGES)


@cache
def imports() -> dict[str, set[str]]:
    """Return what each module imports; all modules are read, which takes seconds."""
    return {module: set(imported(path)) - {module} for module, path in MODULES.items()}


def stage(module: str) -> str:
    """Return the package that a module is in; all of namedmesh is the first."""
    root, *inside = module.split(".")
    return root if root == "namedmesh" else [*inside, ""][0]
