"""The examples of how the package is extended: short, of public names only, right on one rank and on two."""

import ast
import runpy
from pathlib import Path

import pytest
from processes import ROOT, run_as_user

FOLDER = ROOT / "demos" / "extend"
SCRIPTS = sorted(FOLDER.glob("*.py"))
MOST = 30
"""Lines of code that a script may have."""


def without_docstrings(tree):
    """The nodes of a script, without its docstrings."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            del body[0]
    return ast.walk(tree)


def code_lines(tree):
    """Numbers of the lines with code."""
    lines = set()
    for node in without_docstrings(tree):
        if hasattr(node, "lineno"):
            last = node.lineno if hasattr(node, "body") else node.end_lineno
            lines.update(range(node.lineno, last + 1))
    return lines


@pytest.mark.serial
def test_an_example_for_each_kind():
    assert {script.stem for script in SCRIPTS} == {"gap", "law", "load", "material", "method", "strategy"}


@pytest.mark.serial
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_example_is_short_and_public(script):
    lines = code_lines(ast.parse(script.read_text()))
    assert len(lines) <= MOST, f"{script.name} has {len(lines)} lines of code"
    imported = [
        node for node in ast.walk(ast.parse(script.read_text())) if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    own = [ast.unparse(node) for node in imported if "erc_contact" in ast.unparse(node)]
    assert own == ["import erc_contact as ec"]


def test_examples_run(shared_tmp_path, monkeypatch):
    """All in one process of each rank, which is this file as a script."""
    run_as_user(Path(__file__), shared_tmp_path, monkeypatch)
    assert not [path.name for path in shared_tmp_path.iterdir() if path.name != "dolfinx_jit_options.json"]


if __name__ == "__main__":
    for each in SCRIPTS:
        runpy.run_path(str(each), run_name="__main__")
