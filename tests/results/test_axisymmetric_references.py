"""Reference values of axisymmetric bodies, computed again for the fastest cases.

Proved intervals hold the closed forms; numbers without friction are within 0.1% of
them; forces with friction are within 0.05%, stick zones within 3%, pressures within 1%. A press fit that spins is lost at its closed speed.
"""

from functools import partial

import pytest
import reference_turned as cases
import reference_turned_contacts as contacts
from reference_numbers import is_inside

import erc_contact as ec

pytestmark = pytest.mark.serial
CLOSED_FORMS = [
    cases.cylinder_between_platens,
    cases.spinning_cylinder,
    partial(cases.fit_in_plane_strain, 2e-3),
    partial(cases.spinning_fit, 2e-3),
    partial(cases.shrink_fit, 2e-3),
]
OTHERS = [cases.column_on_a_plane, contacts.rough_platens, contacts.bonded_platens]
LOST = 3047.5326


@pytest.mark.broad
@pytest.mark.parametrize("case", CLOSED_FORMS)
def test_intervals_hold_closed_forms(case):
    for number in case().numbers:
        (other,) = number.others
        if other.exact:
            assert number.kind == "proved", number.quantity
            assert is_inside(number, other), number
        tolerance = 0.01 if number.quantity == "pressure" else 1e-3
        assert number.value == pytest.approx(other.value, rel=tolerance), number


@pytest.mark.broad
@pytest.mark.parametrize("case", OTHERS)
def test_numbers_of_a_second_code(case):
    for number in case().numbers:
        (other,) = number.others
        if number.kind == "proved":
            assert is_inside(number, other), number
        tolerance = 5e-4
        if number.quantity.startswith("stick"):
            tolerance = 0.03
        elif number.quantity.startswith(("p(", "u_")):
            tolerance = 0.01
        assert number.value == pytest.approx(other.value, rel=tolerance), number


@pytest.mark.parametrize(("share", "closed"), [(0.999, True), (1.001, False)])
def test_spinning_fit_is_lost(share, closed):
    domain = cases.tube_in_hub(10.0, 20.0, 70.0, 20.0)
    solution = ec.solve(cases.fit_at(share * LOST), domain, degree=2)
    error = ec.constitutive_error(ec.equilibrate(solution))
    assert (error.force("bore").force[0] > 0) == closed
