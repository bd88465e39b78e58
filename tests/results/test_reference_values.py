"""The table of reference values, as another code's test suite would read it.

It has its form, closed forms lie in proved intervals, and the cheapest case computed
again gives what is kept.
"""

import json

import pytest
import reference_values as script
from processes import ROOT
from reference_numbers import Number, Other, is_inside

pytestmark = pytest.mark.serial
TABLE = json.loads((ROOT / "docs" / "reference_values.json").read_text())


def numbers(case):
    """The numbers of a case."""
    for entry in case["numbers"]:
        others = [Other(**other) for other in entry["others"]]
        yield Number(**{**entry, "others": others})


def test_form_and_closed_forms():
    assert [case["case"] for case in TABLE] == list(script.CASES)
    assert len(TABLE) >= 15
    exact = 0
    for case in TABLE:
        assert case["title"]
        assert case["geometry"]
        assert len(case["geometry"].splitlines()) <= 10
        assert case["cells"] > 0
        assert case["unknowns"] > 0
        assert case["seconds"] > 0
        for number in numbers(case):
            what = f"{case['case']}: {number.quantity}"
            assert number.kind in ("proved", "estimate"), what
            assert number.low <= number.value <= number.high, what
            for other in number.others:
                exact += other.exact
                assert is_inside(number, other) or not other.exact, f"{what}, {other}"
    assert exact >= 10


def test_page_is_of_the_table():
    """The script gives title and geometry, and the page has all numbers."""
    page = (ROOT / "docs" / "reference_values.md").read_text()
    for case in TABLE:
        assert (case["title"], case["geometry"]) == script.described(case["case"])
        assert f"## {case['title']}\n\n{case['geometry']}\n" in page
        for number in numbers(case):
            assert f"| {number.quantity}" in page


def test_cheapest_case_again():
    """Two sliding blocks: the numbers that are kept, and the closed form."""
    again = script.CASES["slipping_blocks"]()
    kept = next(case for case in TABLE if case["case"] == "slipping_blocks")
    for one, other in zip(again.numbers, numbers(kept), strict=True):
        assert one.kind == other.kind
        assert one.value == pytest.approx(other.value, rel=1e-9)
        assert is_inside(one, one.others[0])
