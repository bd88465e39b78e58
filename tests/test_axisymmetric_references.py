"""Reference values of axisymmetric bodies, computed again for the fastest cases.

Proved intervals hold the closed forms; without friction numbers are within 0.1% of
them, forces with friction within 0.05%, stick zones within 3%.
"""

from functools import partial

import pytest
import reference_turned as cases
from reference_numbers import is_inside

pytestmark = pytest.mark.serial
CLOSED_FORMS = [
    cases.cylinder_between_platens,
    cases.spinning_cylinder,
    partial(cases.fit_in_plane_strain, 2e-3),
    partial(cases.shrink_fit, 2e-3),
]
WITH_FRICTION = [cases.rough_platens, cases.rough_fit]


@pytest.mark.parametrize("case", CLOSED_FORMS)
def test_intervals_hold_closed_forms(case):
    for number in case().numbers:
        (other,) = number.others
        assert number.kind == "proved", number.quantity
        assert is_inside(number, other), number
        assert number.value == pytest.approx(other.value, rel=1e-3), number


@pytest.mark.parametrize("case", WITH_FRICTION)
def test_numbers_with_friction(case):
    for number in case().numbers:
        (other,) = number.others
        tolerance = 5e-4 if "force" in number.quantity else 0.03
        assert number.value == pytest.approx(other.value, rel=tolerance), number
