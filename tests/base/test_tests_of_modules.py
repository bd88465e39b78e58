"""The tests of a module are found from what tests name."""

import pytest
from tests_of_modules import ROOT, modules_of, reaching

pytestmark = pytest.mark.serial
TESTS = ROOT / "tests"


@pytest.mark.broad
def test_a_module_that_tests_name():
    assert (
        TESTS / "model" / "test_trace.py"
        in reaching("erc_contact.model.contact.trace")["erc_contact.model.contact.trace"]
    )


@pytest.mark.broad
def test_a_module_that_no_test_names_is_reached_through_modules_that_import_it():
    reached = reaching("erc_contact.admissible.limits")
    assert "erc_contact.admissible.limits" not in reached
    assert reached["erc_contact.admissible.displacement"]


def test_public_names_are_of_the_modules_that_define_them():
    named = modules_of(TESTS / "error" / "test_goal.py")
    assert "erc_contact.newton.solve" in named  # ec.solve
    assert "namedmesh.sources" in named  # ec.rectangle, which namedmesh has
    assert "erc_contact" not in named
