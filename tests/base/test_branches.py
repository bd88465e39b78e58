"""An axis of features does not spread over the packages unseen.

Decisions that ask for a feature, and the modules that have them, are at most as many
as `branches.txt` says. Whoever needs more, or adds an axis, changes its line there and
says why in the commit.
"""

from collections import Counter

import branches
import pytest

pytestmark = pytest.mark.serial
KEPT = branches.read(branches.KEPT.read_text())


@pytest.fixture(scope="module")
def today():
    return branches.counted()


def test_every_axis_has_its_line():
    axes = {(package, axis) for package in branches.PACKAGES for axis in branches.AXES}
    assert set(KEPT) == axes, "write branches.txt anew: python tests/base/branches.py"


def test_lines_of_axes_say_what_is_below_them():
    assert branches.written(KEPT) == branches.KEPT.read_text().rstrip("\n")


@pytest.mark.broad
@pytest.mark.parametrize(("package", "axis"), KEPT)
def test_no_axis_spreads(package, axis, today):
    before = KEPT[package, axis]
    after = today[package, axis]
    told = "\n".join(branches.grown(before, after))
    asks = f"{package} asks for {axis} in more places than tests/base/branches.txt allows:\n{told}"
    assert after.total() <= before.total(), asks
    assert len(after) <= len(before), asks


def test_the_patterns_match_what_they_are_for():
    """Counted in code that decides on three axes, each in its own kind of decision."""
    code = """
if space.axisymmetric:
    gap = 0.0 if contact.there is None else contact.against
while step.before:
    pass
names = [name for name in parts if name not in interfaces]
match comm.size:
    case 1:
        pass
"""
    counts = branches.decisions_of(code)
    assert counts == {"axisymmetry": 1, "two bodies": 2, "history": 1}


def test_a_module_that_is_new_is_named():
    before = Counter({"model/contact/trace.py": 2, "model/space.py": 1})
    after = Counter({"model/contact/trace.py": 3, "error/rings.py": 1})
    assert list(branches.grown(before, after)) == [
        "model/contact/trace.py: 2 -> 3",
        "error/rings.py: 1, new on this axis",
    ]
