"""Values of a scene on a mesh: a number becomes a Constant, a callable becomes UFL of the position.

Plain numbers in the results of callables become Constants, too. So a form is not
compiled anew if a number changes.
"""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from erc_contact.base.checks import description
from erc_contact.base.exceptions import InputError
from erc_contact.base.runtime import compiled
from erc_contact.mesh.simplex import lattice
from erc_contact.model.expressions import evaluate, without_plain_numbers
from erc_contact.model.space import Space
from erc_contact.model.users import call_of_user, scalar, vector
from erc_contact.scene.material import Material

DATA_DEGREE = 4
"""Quadrature degree for moduli and loads that vary in space. The solver and the reconstruction of stresses share it."""


def parameter(owner: Any, name: str) -> Any:
    """The value of a parameter of a material, law or load.

    Raises:
        InputError: If there is no attribute of this name.
    """
    if not hasattr(owner, name):
        raise InputError(
            f"{type(owner).__name__} has {name!r} among its parameters and no such attribute; add it, or mend the name."
        )
    return getattr(owner, name)


def number(space: Space, value: Any, what: str, x: Any = None) -> Any:
    """A number as a Constant, or a callable as UFL of the position; collective.

    The position is that of the mesh, unless another x is given.

    Raises:
        InputError: If the callable fails or returns no scalar.
    """
    if not callable(value):
        if not isinstance(value, Real):
            raise InputError(f"{what} is {description(value)}; give a number, or a callable of x.")
        return compiled.constant(space.mesh, float(value))
    found = call_of_user(space.comm, what, lambda: scalar(what, value(space.x if x is None else x)))
    return without_plain_numbers(found, space.mesh)


def components(space: Space, value: Any, what: str, x: Any = None) -> Any:
    """A vector as UFL, from a sequence of d values or one callable; collective. See :func:`number`.

    Raises:
        InputError: If the vector does not have d components.
    """
    if not callable(value):
        bound = ufl.as_vector([number(space, component, what) for component in value])
    else:
        found = call_of_user(space.comm, what, lambda: vector(value(space.x if x is None else x)))
        bound = without_plain_numbers(found, space.mesh)
    if bound.ufl_shape != (space.d,):
        raise InputError(f"{what} has shape {bound.ufl_shape}; the mesh needs ({space.d},).")
    return bound


def value_of(space: Space, value: Any, what: str) -> Any:
    """A number, a vector of d values, or a callable that returns one of the two, as UFL; collective.

    Raises:
        InputError: If the value is none of these.
    """
    if not callable(value):
        return (
            components(space, value, what)
            if isinstance(value, tuple)
            else number(space, value, what)
        )

    def attempt() -> Any:
        found = value(space.x)
        shape = found.ufl_shape if isinstance(found, ufl.core.expr.Expr) else np.shape(found)
        return vector(found) if shape else scalar(what, found)

    return without_plain_numbers(call_of_user(space.comm, what, attempt), space.mesh)


def moduli(space: Space, material: Material) -> dict[str, Any]:
    """The parameters of a material as UFL; collective.

    Raises:
        InputError: If the material refuses their range, or a mapping does not cover the
            cells once.
    """
    bound = {}
    for name in material.parameters:
        value, what = parameter(material, name), f"Material parameter {name}"
        varies = isinstance(value, Mapping) or callable(value)
        bound[name] = (
            _by_region(space, name, value)
            if isinstance(value, Mapping)
            else number(space, value, what)
        )
        if varies:
            values = evaluate(
                bound[name], space.mesh, lattice(space.d, DATA_DEGREE), space.owned_cells
            )
            call_of_user(space.comm, what, material.check, name, *space.extremes(values))
    return bound


def _by_region(space: Space, name: str, value: Mapping[str, Any]) -> Any:
    """A parameter that is given region by region, as UFL; collective.

    All numbers are values of one function that is constant in cells.

    Raises:
        InputError: If a cell is in no region of the mapping, or in two.
    """
    numbers, terms = space.domain.function("DG", 0), []
    covered = np.zeros(len(numbers.x.array), dtype=int)
    for region, entry in value.items():
        cells = space.domain.region(region)
        covered[cells] += 1
        if callable(entry):
            indicator = space.domain.function("DG", 0)
            indicator.x.array[cells] = 1.0
            terms.append(
                indicator * number(space, entry, f"Material parameter {name} in {region!r}")
            )
        else:
            numbers.x.array[cells] = float(entry)
    missing = space.comm.allreduce(
        int(np.count_nonzero(covered[: space.domain.owned_cells] != 1)), MPI.SUM
    )
    if missing:
        raise InputError(
            f"Material parameter {name}: {missing} cells are in no region or in two of {sorted(value)}; "
            f"this domain has {sorted(space.domain.regions)}."
        )
    return sum(terms, start=numbers)
