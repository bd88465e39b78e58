"""Tell which tests are about a module, and which modules a test is about.

    python benchmarks/tests_of_modules.py erc_contact/admissible/limits.py
    python benchmarks/tests_of_modules.py tests/error/test_goal.py
    python benchmarks/tests_of_modules.py  # all modules

A test is about the modules that it imports, and about those whose public names it
takes, as `ec.interval`. A module that no test names is reached through modules that
import it; of these the nearest that tests name are told. No test is run: what members
and methods reach is not seen.
"""

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from import_graph import MODULES, ROOT, imports

ALIASES = {"ec": "erc_contact", "nm": "namedmesh"}
"""Names by which tests call the packages."""
TESTS = sorted((ROOT / "tests").rglob("test_*.py"))


@cache
def public_names(package: str) -> dict[str, str]:
    """Return the names that a package takes from modules, at once or when asked for."""
    found = {}
    for node in ast.walk(ast.parse(MODULES[package].read_text())):
        if isinstance(node, ast.ImportFrom) and node.module in MODULES:
            for alias in node.names:
                found[alias.asname or alias.name] = node.module
    return found


def module_with(dotted: str) -> str | None:
    """Return the module that has a dotted name, None if it is of no package."""
    package, _, name = dotted.rpartition(".")
    if dotted in MODULES:
        return dotted
    if package not in MODULES:
        return None
    of_package = public_names(package).get(name)
    return module_with(f"{of_package}.{name}") if of_package else package


def dotted_names(tree: ast.AST) -> Iterator[str]:
    """Yield the names of the packages that code imports or takes as attributes."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Attribute):
            first, *members = ast.unparse(node).split(".")
            yield ".".join([ALIASES.get(first, first), *members])


@cache
def modules_of(test: Path) -> set[str]:
    """Return the modules that a test names."""
    found = {module_with(name) for name in dotted_names(ast.parse(test.read_text()))}
    return {module for module in found if module is not None} - {"erc_contact", "namedmesh"}


@cache
def tests_by_module() -> dict[str, list[Path]]:
    """Return the tests that name each module."""
    found: dict[str, list[Path]] = {module: [] for module in MODULES}
    for test in TESTS:
        for module in modules_of(test):
            found[module].append(test)
    return found


def reaching(module: str) -> dict[str, list[Path]]:
    """Return the tests of a module, else of the nearest modules that import it.

    Returns:
        Modules that tests name, and these tests, those that name fewest modules first.
    """
    level = {module}
    seen: set[str] = set()
    while level:
        found = {}
        for near in sorted(level):
            tests = tests_by_module()[near]
            if tests:
                found[near] = sorted(tests, key=lambda test: len(modules_of(test)))
        if found:
            return found
        seen |= level
        level = {other for other in MODULES if imports()[other] & level} - seen
    return {}


def told(module: str) -> Iterator[str]:
    """Yield a line for a module, or for each module through which tests reach it."""
    for near, tests in reaching(module).items():
        through = "" if near == module else f", through {near}"
        names = " ".join(test.relative_to(ROOT / "tests").as_posix() for test in tests)
        yield f"{module}{through}: {names}"


def main(paths: list[str]) -> None:
    """Print the tests of modules, and the modules of tests."""
    by_path = {path: module for module, path in MODULES.items()}
    for path in map(Path, paths):
        if path.resolve() in by_path:
            print("\n".join(told(by_path[path.resolve()])))
        else:
            print(f"{path}:", *sorted(modules_of(path)))
    if not paths:
        for module, path in MODULES.items():
            if path.name != "__init__.py":
                print("\n".join(told(module) if reaching(module) else [f"{module}: no test"]))


if __name__ == "__main__":
    main(sys.argv[1:])
