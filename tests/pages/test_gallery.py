"""The gallery: every demo runs as a user runs it, alone and on several ranks, and draws what it says.

The asserts on the physics are in the demos. The examples of how the package is extended
are short, and use public names only.
"""

import ast
import importlib.util
import json
from pathlib import Path
from zipfile import ZipFile

import pytest
from mpi4py import MPI
from processes import ROOT, run_as_user

DEMOS = sorted((ROOT / "demos").glob("*.py"))
EXAMPLES = sorted((ROOT / "demos" / "extend").glob("*.py"))
MOST = 30
"""Statements that an example may have. They do not depend on the width of the page, as lines do."""


def stem(path):
    return path.stem


@pytest.mark.gallery
@pytest.mark.parametrize("demo", [*DEMOS, *EXAMPLES], ids=stem)
def test_demo(demo, shared_tmp_path, monkeypatch):
    run_as_user(demo, shared_tmp_path, monkeypatch)
    MPI.COMM_WORLD.barrier()
    written = {path.name for path in (shared_tmp_path / "results" / demo.stem).iterdir()}
    assert [name for name in written if name.endswith(".png")]
    if "history.save" in demo.read_text():
        assert {"history.csv", "error_map.png", "deformed.png", "body.vtkhdf"} <= written
    left = {path.name for path in shared_tmp_path.iterdir()} | {
        path.name for path in (shared_tmp_path / "results").iterdir()
    }
    assert left <= {"results", "dolfinx_jit_options.json", demo.stem}


@pytest.mark.serial
@pytest.mark.parametrize("demo", [*DEMOS, *EXAMPLES], ids=stem)
def test_demo_is_a_page(demo):
    """It begins with a title, has text between its code, and ends in asserts."""
    tree = ast.parse(demo.read_text())
    title, line, *text = ast.get_docstring(tree).splitlines()
    assert line == "=" * len(title)
    assert len(" ".join(text).split()) > 80
    assert demo.read_text().count("\n# %%\n") >= 2
    assert isinstance(tree.body[-1], ast.Assert)


def of_site(name):
    """A module beside the pages of the site."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def downloads():
    """The module that packs the downloads of the site."""
    return of_site("downloads")


@pytest.mark.serial
def test_each_demo_has_a_subject():
    assert sorted(of_site("subjects").DEMOS) == [stem(demo) for demo in DEMOS]


@pytest.mark.serial
def test_downloads_have_the_files_that_demos_read(tmp_path):
    """What a script names above its own folder is in its archive, and nothing is missing."""
    with_files = set()
    for demo in DEMOS:
        archive = tmp_path / f"{demo.stem}.zip"
        downloads().pack(demo, archive)
        with ZipFile(archive) as packed:
            names = packed.namelist()
        assert names[0] == f"demos/{demo.name}"
        named = demo.read_text().count("parents[1]")
        assert (len(names) > 1) == (named > 0)
        assert all((ROOT / name).is_file() for name in names)
        with_files |= {demo.stem} if named else set()
    assert {"sphere", "greco", "hertz", "part", "clamp", "other_code"} <= with_files


@pytest.mark.gallery
def test_a_download_runs_where_it_is_unpacked(shared_tmp_path, monkeypatch):
    folder = shared_tmp_path / "download"
    if MPI.COMM_WORLD.rank == 0:
        downloads().pack(ROOT / "demos" / "hertz.py", shared_tmp_path / "hertz.zip")
        ZipFile(shared_tmp_path / "hertz.zip").extractall(folder)
    MPI.COMM_WORLD.barrier()
    run_as_user(folder / "demos" / "hertz.py", shared_tmp_path, monkeypatch)


@pytest.mark.gallery
@pytest.mark.serial
def test_a_notebook_runs_where_it_is_unpacked(tmp_path, monkeypatch):
    """Cell after cell, with the first cell of the site, from the folder of the notebook."""
    gallery = pytest.importorskip("sphinx_gallery.gen_gallery", reason="no tools for the site")
    from sphinx_gallery.notebook import jupyter_notebook, save_notebook
    from sphinx_gallery.py_source_parser import split_code_and_text_blocks

    settings = {**gallery.DEFAULT_GALLERY_CONF, "src_dir": str(tmp_path)}
    settings["first_notebook_cell"] = of_site("subjects").FIRST_CELL
    demo = ROOT / "demos" / "hertz.py"
    blocks = split_code_and_text_blocks(str(demo))[1]
    save_notebook(jupyter_notebook(blocks, settings, tmp_path), tmp_path / "hertz.ipynb")
    downloads().pack(demo, tmp_path / "hertz.zip", tmp_path / "hertz.ipynb")
    ZipFile(tmp_path / "hertz.zip").extractall(tmp_path / "unpacked")
    monkeypatch.chdir(tmp_path / "unpacked" / "demos")
    names = {"__name__": "__main__"}
    cells = json.loads(Path("hertz.ipynb").read_text())["cells"]
    codes = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    for code in codes:
        exec(code, names)
    assert Path("results/hertz/pressure.png").is_file()


def without_docstrings(tree):
    """The nodes of a script, without its docstrings."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if (
            isinstance(body, list)
            and isinstance(body[0], ast.Expr)
            and isinstance(body[0].value, ast.Constant)
        ):
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
    assert {script.stem for script in EXAMPLES} == {
        "gap",
        "law",
        "load",
        "material",
        "method",
        "strategy",
        "woven",
    }


@pytest.mark.serial
@pytest.mark.parametrize("example", EXAMPLES, ids=stem)
def test_example_is_short_and_public(example):
    tree = ast.parse(example.read_text())
    imported = [
        ast.unparse(node)
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    own = {name for name in imported if "erc_contact" in name}
    assert own <= {"import erc_contact as ec", "from erc_contact.output import plot_history"}
    statements = [node for node in without_docstrings(tree) if isinstance(node, ast.stmt)]
    assert len(statements) <= MOST, f"{example.name} has {len(statements)} statements"


@pytest.mark.serial
def test_penalty_takes_twelve_lines():
    tree = ast.parse((ROOT / "demos" / "extend" / "method.py").read_text())
    (penalty,) = (node for node in tree.body if isinstance(node, ast.ClassDef))
    decorators = {node.lineno for node in penalty.decorator_list}
    assert len(code_lines(ast.Module([penalty], [])) | decorators) <= 12
