"""Put values of a scene on a mesh: numbers become Constants, callables UFL.

Plain numbers in the results of callables become Constants, too. So a form is not
compiled anew if a number changes.
"""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI
from ufl.corealg.traversal import traverse_unique_terminals

from erc_contact.base.exceptions import InputError
from erc_contact.base.runtime import compiled
from erc_contact.base.traced import field_of
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.expressions import at_cells
from erc_contact.model.data.tables import on_mesh
from erc_contact.model.data.users import call_of_user, scalar, vector
from erc_contact.model.space import Space
from erc_contact.scene.material import Material, values_in_space
from erc_contact.scene.potential import Potential
from namedmesh.base.checks import description
from namedmesh.simplex import lattice

DATA_DEGREE = 4
"""Quadrature degree for moduli and loads that vary in space.

The solver and the reconstruction of stresses share it.
"""


def without_plain_numbers(expression: Ufl, mesh: dmesh.Mesh, *, of_material: bool = False) -> Ufl:
    """Replace the plain numbers of a UFL expression by Constants; collective.

    Expressions that differ only in these numbers are then compiled once. Tables become
    Functions on the mesh, see :func:`erc_contact.model.data.tables.on_mesh`. What UFL
    has found to be zero, as ``t * x`` at the time zero, is a Constant, too: a form of
    it would have no integral.
    """
    expression = on_mesh(expression, mesh, at_cells, of_material=of_material)
    constants = {}
    for terminal in traverse_unique_terminals(expression):
        if isinstance(terminal, ufl.classes.FloatValue):
            constants[terminal] = compiled.constant(mesh, float(terminal))
    if isinstance(expression, ufl.classes.Zero):
        return compiled.constant(mesh, np.zeros(expression.ufl_shape))
    return ufl.replace(expression, constants)


def number(space: Space, value: Any, what: str, x: Ufl = None, *, of_material: bool = False) -> Ufl:
    """Return a number as a Constant, or a callable as UFL of the position; collective.

    The callable gets the position on the mesh, unless another x is given. Tables of a
    material have their values at the points of quadrature.

    Raises:
        InputError: If the callable fails or returns no scalar.
    """
    if not callable(value):
        if not isinstance(value, Real):
            raise InputError(f"{what} is {description(value)}; give a number, or a callable of x.")
        return compiled.constant(space.mesh, float(value))
    place = space.x if x is None else x
    expression = call_of_user(space.comm, what, lambda: scalar(what, field_of(value, place)))
    return without_plain_numbers(expression, space.mesh, of_material=of_material)


def components(space: Space, value: Any, what: str, x: Ufl = None) -> Ufl:
    """Return a vector as UFL, from d values or one callable; collective.

    See :func:`number`.

    Raises:
        InputError: If the vector does not have d components.
    """
    if not callable(value):
        expression = ufl.as_vector([number(space, component, what) for component in value])
    else:
        place = space.x if x is None else x
        returned = call_of_user(space.comm, what, lambda: vector(field_of(value, place)))
        expression = without_plain_numbers(returned, space.mesh)
    shape = expression.ufl_shape
    if shape != (space.d,):
        raise InputError(f"{what} has shape {shape}; the mesh needs ({space.d},).")
    return expression


def value_of(space: Space, value: Any, what: str) -> Ufl:
    """Return a number, a vector, or a callable that returns either, as UFL; collective.

    Raises:
        InputError: If the value is none of these.
    """
    if not callable(value):
        if isinstance(value, tuple):
            return components(space, value, what)
        return number(space, value, what)

    def attempt() -> Ufl:
        returned = field_of(value, space.x)
        if isinstance(returned, ufl.core.expr.Expr):
            shape = returned.ufl_shape
        else:
            shape = np.shape(returned)
        return vector(returned) if shape else scalar(what, returned)

    return without_plain_numbers(call_of_user(space.comm, what, attempt), space.mesh)


def moduli(space: Space, material: Material | Potential) -> dict[str, Ufl]:
    """Return the parameters of a material as UFL; collective.

    Raises:
        InputError: If the material refuses their range, or a mapping does not cover the
            cells once.
    """
    parameters = {}
    for name, value in values_in_space(material).items():
        what = f"Material parameter {name}"
        if isinstance(value, Mapping):
            parameters[name] = by_region(space, what, value)
        else:
            parameters[name] = number(space, value, what, of_material=True)
        if isinstance(value, Mapping) or callable(value):
            points = lattice(space.d, DATA_DEGREE)
            values = space.evaluate(parameters[name], points, space.owned_cells)
            low, high = space.extremes(values)
            call_of_user(space.comm, what, material.check, name, low, high)
    return parameters


def by_region(space: Space, what: str, value: Mapping[str, Any]) -> Ufl:
    """Return a parameter that is given region by region as UFL; collective.

    All numbers are values of one function that is constant in cells.

    Args:
        space: The mesh.
        what: The parameter, in words for messages.
        value: Number or callable of each region.

    Raises:
        InputError: If a cell is in no region of the mapping, or in two.
    """
    numbers = space.domain.function("DG", 0)
    terms = []
    covered = np.zeros(len(numbers.x.array), dtype=int)
    for region, entry in value.items():
        cells = space.domain.region(region)
        covered[cells] += 1
        if callable(entry):
            # A callable counts in its region only.
            of_region = number(space, entry, f"{what} in {region!r}", of_material=True)
            terms.append(space.indicator(cells) * of_region)
        else:
            numbers.x.array[cells] = float(entry)
    # Each cell must be in one region. Ghosts are counted by their owners.
    wrong = int(np.count_nonzero(covered[: space.domain.owned_cells] != 1))
    wrong = space.comm.allreduce(wrong, MPI.SUM)
    if wrong:
        raise InputError(
            f"{what}: {wrong} cells are in no region or in two of"
            f" {sorted(value)}; this domain has {sorted(space.domain.regions)}."
        )
    return sum(terms, start=numbers)
