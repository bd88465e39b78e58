"""One table says what cards mean: the reader's, and the page's."""

import pytest
from processes import ROOT

from erc_contact.decks.keywords import BY_NAME, FATES, KEYWORDS, TAKEN, as_page
from erc_contact.decks.readers import OF_THE_MESH, READERS

pytestmark = pytest.mark.serial
PAGE = ROOT / "docs" / "yours" / "decks.md"


def test_the_page_has_the_table():
    """Write it anew by ``print(as_page())`` of ``erc_contact.decks.keywords``."""
    assert as_page() in PAGE.read_text()


def test_what_is_taken_has_a_reader():
    taken = {keyword.name for keyword in KEYWORDS if keyword.fate == TAKEN}
    assert taken == set(READERS) | set(OF_THE_MESH)


def test_each_keyword_is_there_once_and_says_what_to_do():
    assert len(BY_NAME) == len(KEYWORDS)
    assert {keyword.fate for keyword in KEYWORDS} == set(FATES)
    assert all(keyword.meaning for keyword in KEYWORDS)
    said = [keyword.said for keyword in KEYWORDS if keyword.fate != FATES[1]]
    assert all(said)
