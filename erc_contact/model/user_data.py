"""Prepare UFL of the user's for the forms of a mesh: numbers and tables in it."""

from __future__ import annotations

import ufl
from dolfinx import mesh as dmesh
from ufl.corealg.traversal import traverse_unique_terminals

from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.expressions import at_cells
from erc_contact.model.tables import on_mesh


def without_plain_numbers(expression: Ufl, mesh: dmesh.Mesh, *, of_material: bool = False) -> Ufl:
    """Replace the plain numbers of a UFL expression by Constants; collective.

    Expressions that differ only in these numbers are then compiled once. Tables become
    Functions on the mesh, see :func:`erc_contact.model.tables.on_mesh`.
    """
    expression = on_mesh(expression, mesh, at_cells, of_material=of_material)
    constants = {}
    for terminal in traverse_unique_terminals(expression):
        if isinstance(terminal, ufl.classes.FloatValue):
            constants[terminal] = compiled.constant(mesh, float(terminal))
    return ufl.replace(expression, constants)
