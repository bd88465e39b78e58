"""The reading path is what the scenes of `benchmarks/reading_path.py` run today."""

import json
import re
import subprocess
import sys

import pytest
import reading_path
from import_graph import MODULES
from processes import ROOT, environment

pytestmark = pytest.mark.serial
PAGE = ROOT / "docs" / "inside" / "path.md"
WRITE = "write the page anew: python benchmarks/reading_path.py > docs/inside/path.md"
BAND = 1.4
"""So much more of an unlisted module may run, or less of a listed one: what was compiled before matters a little."""
NAMES = {reading_path.short(module).strip("`"): module for module in MODULES}


def listed():
    """Modules in the tables of the page, in their order: section -> names."""
    found = {}
    for section in re.split(r"^## ", PAGE.read_text(), flags=re.MULTILINE)[1:]:
        title = section.splitlines()[0].removeprefix("+ ")
        paths = re.findall(r"^\| `([^`]*)` \|", section, re.MULTILINE)
        found[title] = [NAMES.get(path, f"{path}, which is gone") for path in paths]
    return found


@pytest.fixture(scope="module")
def shares():
    """Part of each module that runs, in a process where nothing has run before."""
    code = "import json, reading_path; print(json.dumps(reading_path.shares()))"
    variables = environment()
    variables["PYTHONPATH"] += f":{ROOT / 'benchmarks'}"
    run = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env=variables,
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout.splitlines()[-1])


@pytest.mark.broad
def test_page_has_the_modules_that_run(shares):
    on_page = listed()
    assert set(on_page) == set(shares), WRITE
    wrong = []
    for section, parts in shares.items():
        least = reading_path.SHARE if section == reading_path.BLOCK else reading_path.ADDED
        must = {module for module, part in parts.items() if part > BAND * least}
        may = {module for module, part in parts.items() if part > least / BAND}
        there = set(on_page[section])
        wrong += [f"+ {module} is missing in {section}" for module in must - there]
        wrong += [f"- {module} is too much in {section}" for module in there - may]
    assert sorted(wrong) == [], WRITE


def test_the_way_stands_in_the_order_of_imports():
    way = listed()[reading_path.BLOCK]
    assert len(way) > 50
    for number, module in enumerate(way):
        assert reading_path.imports()[module].isdisjoint(way[number + 1 :]), module
