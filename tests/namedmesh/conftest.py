"""Tests of namedmesh are its own: they run as if erc_contact were not installed."""

import sys

import pytest


@pytest.fixture(autouse=True)
def without_erc_contact(monkeypatch):
    """No import of erc_contact works in a test, nor in the code that it runs."""
    loaded = [name for name in sys.modules if name.split(".")[0] == "erc_contact"]
    for name in {"erc_contact", *loaded}:
        monkeypatch.setitem(sys.modules, name, None)
