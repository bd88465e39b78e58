"""Put the given strains of a scene on a mesh.

In 2D with plane strain a strain out of plane, ``eps_0zz``, cannot take place, and
presses the plane. With the stress out of plane of the material, ``sigma_zz = zeta :
sigma`` without given strain, the stress in plane is

    sigma = C (eps(u) - eps_0 - zeta eps_0zz),    sigma_zz = zeta : sigma - E_z eps_0zz,

by Maxwell's reciprocity of the stiffness between plane and normal. For isotropic
plane strain zeta is nu times the identity and E_z is E. So in 2D a given strain is a
tensor in plane, with its part out of plane for the stress there alone. Of an
axisymmetric body it is a tensor with the rows r, z and hoop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from erc_contact.base.exceptions import InputError
from erc_contact.base.traced import field_of
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.expressions import Everywhere
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.data.users import call_of_user
from erc_contact.model.data.values import (
    DATA_DEGREE,
    by_region,
    number,
    without_plain_numbers,
)
from erc_contact.model.space import Space
from erc_contact.scene.material import Material, mandel_basis, parameter
from erc_contact.scene.potential import FREE_STRAIN, has_potential
from erc_contact.scene.scene import Scene
from erc_contact.scene.strain import GivenStrain
from namedmesh.simplex import rule


class Strains:
    """Hold the sum of all given strains on a mesh; construction is collective.

    Args:
        tensor: The strain in plane, with what a strain out of plane adds [-], UFL,
            shape (d, d), or (3, 3) of an axisymmetric body.
        normal: The strain out of plane in 2D [-], UFL; zero of other bodies.
        mesh: Where they live.
        basis: Orthonormal basis of the tensors, shape (s, *shape of tensor).

    Attributes:
        varies_in_cells: Whether the strain varies inside cells.
        load_form: The compiled form of its nodal forces, once it is made.
    """

    def __init__(self, tensor: Ufl, normal: Ufl, mesh: dmesh.Mesh, basis: np.ndarray) -> None:
        self.tensor = tensor
        self.normal = normal
        self.load_form: fem.Form | None = None
        self.varies_in_cells = varies_in_cells(tensor)
        self._basis = basis
        self._at_points = Everywhere(tensor, mesh)

    def __call__(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate the tensor in Mandel components at points [-].

        Args:
            x: Points of each cell [length], shape (n, q, d).
            cells: The cells, shape (n,).

        Returns:
            Shape (n, q, s).
        """
        return np.tensordot(self._at_points(x, cells), self._basis, axes=((2, 3), (1, 2)))


def bind_strains(
    space: Space,
    strains: Sequence[GivenStrain],
    material: Material,
    parameters: Mapping[str, Ufl],
    of_preloads: Sequence[Ufl],
) -> Strains | None:
    """Put given strains on a mesh; None without any; collective.

    Args:
        space: The mesh.
        strains: The strains of the scene.
        material: Its material.
        parameters: Parameters of the material, UFL.
        of_preloads: The strains of its preloads, UFL, shape (d, d) each.

    Raises:
        InputError: If a strain is no scalar and no tensor of shape (d, d), is not
            finite, its region is unknown, or a scalar strain acts out of plane and the
            material does not tell its stress there.
    """
    if not strains and not of_preloads:
        return None
    basis, rows = space.section.basis, space.section.rows
    tensor = sum(of_preloads, start=ufl.zero((rows, rows)))
    normal = ufl.as_ufl(0.0)
    for strain in strains:
        for expression in _terms(space, strain):
            if expression.ufl_shape:
                tensor += ufl.sym(expression)
                continue
            tensor += expression * ufl.Identity(rows)
            if rows == 2:
                normal += expression
                tensor += expression * _out_of_plane(strain, material, parameters)
    _check_finite(space, tensor)
    return Strains(tensor, normal, space.mesh, basis)


def moved_by(space: Space, scene: Scene) -> dict[str, Ufl]:
    """Return the parameter by which given strains move a potential; collective."""
    if not scene.strains or not has_potential(scene.material):
        return {}
    return {FREE_STRAIN: free_strain(space, scene.strains)}


def free_strain(space: Space, strains: Sequence[GivenStrain]) -> Ufl:
    """Return the sum of given strains that are the same in all directions; collective.

    Args:
        space: The mesh.
        strains: The strains of the scene.

    Raises:
        InputError: If one is a tensor, or cannot be evaluated.
    """
    total = ufl.as_ufl(0.0)
    for strain in strains:
        for expression in _terms(space, strain):
            if expression.ufl_shape:
                raise InputError(
                    f"{type(strain).__name__} is a tensor, and a law with a potential takes strains"
                    " that are the same in all directions: give a number, as of heat."
                )
            total += expression
    _check_finite(space, total)
    return total


def _check_finite(space: Space, strain: Ufl) -> None:
    """Check that a given strain is finite in all cells; collective."""
    points, _ = rule(space.d, DATA_DEGREE)
    values = space.evaluate(strain, points, space.owned_cells)
    if not np.isfinite(space.extremes(values)).all():
        raise InputError("A given strain is not finite everywhere; look at its callables.")


def _terms(space: Space, strain: GivenStrain) -> list[Ufl]:
    """Return the terms of a given strain, UFL; collective.

    There is one, or one for each region of a mapping: a number and a tensor differ in
    the strain out of plane.

    Raises:
        InputError: If a region is unknown, or has two names in a mapping.
    """
    what = type(strain).__name__
    values = {name: parameter(strain, name) for name in strain.parameters}
    of_regions = values.get("value")
    if not isinstance(of_regions, Mapping):
        return [_in_region(space, strain.region, _expression(space, strain, what, values))]
    terms = []
    for region, value in of_regions.items():
        here = values | {"value": value}
        expression = _expression(space, strain, f"{what} in {region!r}", here)
        terms.append(_in_region(space, strain.region, _in_region(space, region, expression)))
    tags = [space.domain.regions[region] for region in of_regions]
    if len(set(tags)) < len(tags):
        raise InputError(
            f"{what}: cells are in two of {sorted(of_regions)}; name each region once."
        )
    return terms


def _expression(space: Space, strain: GivenStrain, what: str, values: Mapping[str, Any]) -> Ufl:
    """Return a given strain, a scalar or a tensor (d, d), UFL; collective.

    Args:
        space: The mesh.
        strain: The strain.
        what: It in words for messages.
        values: Its parameters.

    Raises:
        InputError: If it has another shape, or a value cannot be evaluated.
    """
    parameters = {}
    for name, value in values.items():
        what_value = what if name == "value" else f"{what}: {name}"
        if isinstance(value, Mapping):
            parameters[name] = by_region(space, what_value, value)
        elif isinstance(value, tuple):
            parameters[name] = _tensor(space, value, what_value)
        elif name == "value" and callable(value):
            parameters[name] = _of_callable(space, value, what_value)
        else:
            parameters[name] = number(space, value, what_value, of_material=True)

    def call() -> Ufl:
        return ufl.as_ufl(strain.strain(space.x, **parameters))

    returned = call_of_user(space.comm, what, call)
    expression = without_plain_numbers(returned, space.mesh, of_material=True)
    rows = space.section.rows
    if expression.ufl_shape not in ((), (rows, rows)):
        which = ", which acts in plane" if rows == 2 else space.section.tensor_words
        raise InputError(
            f"{what} has shape {expression.ufl_shape}; the mesh needs a scalar or the shape"
            f" {(rows, rows)}: a number is a strain in all directions of space, a tensor has"
            f" {rows} rows of {rows} components{which}."
        )
    return expression


def _tensor(space: Space, rows: Sequence[Sequence[Any]], what: str) -> Ufl:
    """Return rows of numbers and callables as a tensor, UFL; collective."""
    tensor = []
    for row in rows:
        tensor.append([number(space, entry, what, of_material=True) for entry in row])
    return ufl.as_tensor(tensor)


def _of_callable(space: Space, value: Callable[[Any], Any], what: str) -> Ufl:
    """Return what a callable of x returns, a scalar or rows, as UFL; collective."""

    def call() -> Ufl:
        returned = field_of(value, space.x)
        if isinstance(returned, Sequence | np.ndarray):
            return ufl.as_tensor([list(row) for row in returned])
        return ufl.as_ufl(returned)

    return call_of_user(space.comm, what, call)


def _in_region(space: Space, region: str | None, expression: Ufl) -> Ufl:
    """Return a given strain that is zero outside a region; collective."""
    if region is None:
        return expression
    return space.indicator(space.domain.region(region)) * expression


def _out_of_plane(strain: GivenStrain, material: Any, parameters: Mapping[str, Ufl]) -> Ufl:
    """Return zeta, the stress out of plane for stresses in plane [-], shape (2, 2).

    Raises:
        InputError: If the material does not tell it.
    """
    if not hasattr(material, "out_of_plane"):
        raise InputError(
            f"{type(strain).__name__} is a strain in all directions, and {type(material).__name__} "
            "does not tell the stress out of plane; give the material out_of_plane, or the strain "
            "as a tensor of 2 rows."
        )
    zeta = ufl.zero((2, 2))
    for basis_tensor in mandel_basis(2):
        tensor = ufl.as_matrix(basis_tensor.tolist())
        zeta += ufl.as_ufl(material.out_of_plane(tensor, **parameters)) * tensor
    return zeta
