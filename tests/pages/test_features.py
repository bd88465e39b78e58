"""The page of features has what small blocks of `benchmarks/features.py` do today."""

import re

import features
import pytest
from processes import ROOT

pytestmark = pytest.mark.serial
PAGE = (ROOT / "docs" / "inside" / "features.md").read_text()
WRITE = "write the page anew: python benchmarks/features.py > docs/inside/features.md"
SAID = {features.PROVED, features.ESTIMATE, features.ALTERNATIVES}
EVERY = 40
"""Of the cells that work so few are computed again; of each refusal one is."""


def rows():
    """The entries of each feature from its diagonal on: feature -> entries."""
    found = {}
    for number, name, entries in re.findall(
        r"^\| (\d+) \| ([^|]+) \| (.*) \|$", PAGE, re.MULTILINE
    ):
        found[name] = [entry.strip() for entry in entries.split("|")][int(number) - 1 :]
    return found


def refusals():
    """The words of refusals by their numbers."""
    return dict(re.findall(r"^(\d+)\. (.*)$", PAGE, re.MULTILINE))


def cells():
    """What the page says of each pair."""
    names = list(features.FEATURES)
    words = refusals()
    for row, (name, entries) in enumerate(rows().items()):
        for other, entry in zip(names[row:], entries, strict=True):
            yield (name, other), words.get(entry, entry)


def sample():
    """One cell of each refusal, and few of the others."""
    working = [(pair, said) for pair, said in cells() if said in SAID]
    refused = {said: (pair, said) for pair, said in cells() if said not in SAID}
    for pair, said in working[::EVERY] + list(refused.values()):
        yield pytest.param(pair, said, id=", ".join(pair))


def test_rows_and_columns_are_the_features():
    names = list(features.FEATURES)
    assert list(rows()) == names, WRITE
    assert [len(entries) for entries in rows().values()] == list(range(len(names), 0, -1)), WRITE


def test_numbers_are_the_refusals():
    entries = {entry for of_row in rows().values() for entry in of_row}
    assert entries - SAID == set(refusals()), WRITE


@pytest.mark.broad
@pytest.mark.parametrize(("pair", "said"), list(sample()))
def test_cells_are_true(pair, said):
    assert features.cell(*pair) == said, WRITE
