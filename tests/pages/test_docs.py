"""The pages that users read.

Their code runs, their pictures have scripts, and every public name is on a page.
Docstrings and comments repeat the noun.
"""

import re
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from processes import ROOT, run_as_user

import erc_contact as ec

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
CODE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```(?:python|console)\n(.*?)^```", re.MULTILINE | re.DOTALL)
WIDTH = 88
"""Greatest number of characters of a line of code on a page."""
PACKAGES = sorted(
    {
        module.parent
        for package in ("namedmesh", "erc_contact")
        for module in (ROOT / package).rglob("*.py")
    }
)
PRONOUNS = 0.2
"""Greatest number of "that of" and "those of" in 1000 words."""
pytestmark = pytest.mark.serial


def code(page):
    """The code of a page: each block goes on where the last one ended."""
    return "\n".join(CODE.findall(page.read_text()))


@pytest.mark.gallery
def test_code_of_pages_runs(shared_tmp_path, monkeypatch):
    """All in one process, which is this file as a script.

    What they write stays in its folder.
    """
    assert sum(bool(code(page)) for page in PAGES) >= 10
    run_as_user(Path(__file__), shared_tmp_path, monkeypatch)
    first = shared_tmp_path / "results" / "first"
    for name in ("report.html", "error_map.png", "deformed.png", "contact_bottom.png"):
        assert (first / name).is_file()


def test_one_number_prints_what_its_page_says():
    """Blocks of text are what the code before them prints."""
    page = (ROOT / "docs" / "one_number.md").read_text()
    said = "".join(re.findall(r"^```text\n(.*?)^```", page, re.MULTILINE | re.DOTALL))
    printed = StringIO()
    with redirect_stdout(printed):
        exec(compile("\n".join(CODE.findall(page)), "one_number.md", "exec"), {})
    assert printed.getvalue() == said


def test_figures_have_scripts():
    """A script draws the picture of its name, or all pictures of a folder of its name."""
    folder = ROOT / "docs" / "figures"
    figures = [path for path in folder.rglob("*") if path.suffix in (".png", ".svg", ".webp")]
    assert figures
    names = {path.relative_to(folder).parts[0].split(".")[0] for path in figures}
    assert all((folder / f"{name}.py").is_file() for name in names)
    assert sum(path.stat().st_size for path in figures) < 300_000


def test_public_names_are_on_a_page():
    api = "".join(page.read_text() for page in (ROOT / "docs" / "api").glob("*.md"))
    shown = set(re.findall(r":: erc_contact\.([\w.]+)$", api, re.MULTILINE))
    assert set(ec.__all__) <= shown
    assert {f"results.{name}" for name in ec.results.__all__} <= shown
    assert "output" in shown
    summary = re.findall(
        r"^   ([\w.]+)$", (ROOT / "docs" / "api" / "index.md").read_text(), re.MULTILINE
    )
    assert set(ec.__all__) - {"output", "results"} <= set(summary)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_code_of_pages_fits_the_page(page):
    """At a width of 1280 pixels the site cuts longer lines."""
    long = [
        line
        for block in BLOCK.findall(page.read_text())
        for line in block.splitlines()
        if len(line) > WIDTH
    ]
    assert long == []


@pytest.mark.parametrize("demo", sorted((ROOT / "demos").rglob("*.py")), ids=lambda demo: demo.stem)
def test_demos_fit_the_page(demo):
    assert [line for line in demo.read_text().splitlines() if len(line) > WIDTH] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_pages_load_mpi_first(page):
    """In the wheels of DOLFINx, mpi4py finds the library of MPI, and the compiled modules find it there."""
    lines = code(page).splitlines()
    loads = [
        number
        for number, line in enumerate(lines)
        if re.match(r"(import|from) (dolfinx|petsc4py)", line)
    ]
    first = [
        number
        for number, line in enumerate(lines)
        if re.match(r"from mpi4py|import erc_contact", line)
    ]
    assert not loads or min(first, default=len(lines)) < min(loads)


@pytest.mark.broad
@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_docstrings_and_comments_repeat_the_noun(package):
    """A reader has to resolve "that of"; "the stiffness of the foundation" is read."""
    import voice

    figures = voice.Figures()
    for module in package.glob("*.py"):
        figures += voice.figures_of(module)
    assert figures.pronoun_rate <= PRONOUNS


if __name__ == "__main__":
    for each in PAGES:
        exec(compile(code(each), str(each), "exec"), {})


PART = re.compile(r"\s*([-+*]|\d+[.)]) |#|\s*\||\s*$")
"""Beginning of a line that begins a block of Markdown: an item, a heading, a row, nothing."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_no_line_cuts_a_formula(page):
    """A line of a formula that begins with + begins a list, and both halves are text.

    ``docs/rendered.py`` looks at the pages themselves when the site is built.
    """
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"\$\$.*?\$\$|`[^`]*`", "", text, flags=re.DOTALL)
    blocks = [""]
    for line in text.splitlines():
        if PART.match(line):
            blocks.append("")
        blocks[-1] += line + "\n"
    assert [block for block in blocks if block.count("$") % 2] == []
