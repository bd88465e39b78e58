"""A form that is known is not compiled again, and the folder of compiled forms is not read again for it."""

import os

import ufl
from dolfinx import fem
from scenes import block

import erc_contact as ec
from erc_contact.base.compiled import FIRST


def area(domain: ec.Domain) -> fem.Form:
    return fem.form(fem.Constant(domain.mesh, 2.0) * ufl.dx(domain.mesh))


def test_known_forms_are_not_searched(monkeypatch):
    """On another mesh the same form is the same compiled module, found without a look at the disk."""
    first = area(block(2))
    monkeypatch.setattr(os, "listdir", lambda *_: (_ for _ in ()).throw(AssertionError("searched on the disk")))
    again = area(block(3))
    assert again.module is first.module
    assert fem.assemble_scalar(again) > 0


def test_numbers_of_constants_have_as_many_digits():
    """UFL sorts factors by the text of these numbers: "10" comes before "9", but "11" after "10"."""
    mesh = block(2).mesh
    assert FIRST < fem.Constant(mesh, 1.0).count() < 10 * FIRST
