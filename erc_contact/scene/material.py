"""Declare linear elastic materials: strain, stress, compliance (UFL, no mesh).

Symbols: u displacement [length], eps strain [-], sigma stress [force/area], E Young's
modulus [force/area], nu Poisson's ratio [-], G shear modulus, d the dimension.

Isotropic elasticity scales the deviator and the sphere of a tensor: with
``a = 2G`` and ``b = 2G + d lambda``

    sigma = a dev(eps) + b sph(eps),        eps = dev(sigma)/a + sph(sigma)/b,

so the compliance stays bounded as nu -> 1/2 (b -> infinity) and no digit is lost there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from math import sqrt
from numbers import Real
from typing import Any, ClassVar, Protocol

import numpy as np
import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl, Value

PLANE_STRAIN, PLANE_STRESS, AXISYMMETRIC = "plane strain", "plane stress", "axisymmetric"
HYPOTHESES = (PLANE_STRAIN, PLANE_STRESS, AXISYMMETRIC)

HOOP_ROWS = (0, 1, 3, 2)
"""Components of ``mandel_basis(3)`` that an axisymmetric tensor (r, z, hoop) has.

They are rr, zz and rz, as in the plane, and the hoop component.
"""


@cache
def mandel_basis(d: int) -> np.ndarray:
    """Return an orthonormal basis of the symmetric (d, d) matrices.

    Shape (s, d, d) with s = d(d+1)/2.
    """
    basis = [np.outer(e, e) for e in np.eye(d)]
    for i in range(d):
        for j in range(i + 1, d):
            # Twice the square of 1/sqrt(2) is 1: the matrix has unit norm.
            shear = np.zeros((d, d))
            shear[i, j] = 1 / sqrt(2)
            shear[j, i] = 1 / sqrt(2)
            basis.append(shear)
    return np.array(basis)


def is_axisymmetric(material: Any) -> bool:
    """Tell whether a material is of axisymmetric bodies."""
    return getattr(material, "hypothesis", PLANE_STRAIN) == AXISYMMETRIC


def ring_basis() -> np.ndarray:
    """Return the orthonormal basis of the tensors of axisymmetric bodies, (4, 3, 3).

    They are tensors of space with the rows r, z and hoop, without shear out of the half
    plane (r, z).
    """
    return mandel_basis(3)[list(HOOP_ROWS)]


def tensor_basis(material: Any, d: int) -> np.ndarray:
    """Return the orthonormal basis of the tensors that a material gets, (s, n, n)."""
    return ring_basis() if is_axisymmetric(material) else mandel_basis(d)


def mandel_matrix(act: Callable[..., Ufl], tensors: np.ndarray, **parameters: Ufl) -> Ufl:
    """Return a linear map of symmetric tensors in Mandel components, UFL (s, s).

    Args:
        act: The map, stress or compliance.
        tensors: The basis, from :func:`tensor_basis`, shape (s, n, n).
        parameters: Its parameters, UFL.
    """
    basis = [ufl.as_tensor(tensor.tolist()) for tensor in tensors]
    images = [act(tensor, **parameters) for tensor in basis]
    rows = []
    for tensor in basis:
        rows.append([ufl.inner(tensor, image) for image in images])
    return ufl.as_matrix(rows)


def in_tensor(components: Sequence[Ufl]) -> Ufl:
    """Return the tensor (3, 3) of six Mandel components, UFL."""
    basis = [ufl.as_tensor(tensor.tolist()) for tensor in mandel_basis(3)]
    return sum(components[i] * tensor for i, tensor in enumerate(basis))


def strain(u: Ufl) -> Ufl:
    """Return the strain ``eps(u) = (grad u + grad u^T)/2`` [-], shape (d, d)."""
    return ufl.sym(ufl.grad(u))


def scale_parts(tensor: Ufl, deviator: Ufl, sphere: Ufl) -> Ufl:
    """Return ``deviator * dev + sphere * sph`` of a (d, d) tensor."""
    d = tensor.ufl_shape[0]
    sph = ufl.tr(tensor) / d * ufl.Identity(d)
    return deviator * (tensor - sph) + sphere * sph


def of_regions(materials: Mapping[str, Any]) -> Any:
    """Return materials of regions as one material, whose parameters differ by region.

    Args:
        materials: Name of each region -> its material. Elastic regions become regions
            of the class of the others, if it has ``of_elastic``.

    Raises:
        InputError: If these are not materials of one class that differ in their
            parameters only.
    """
    materials = _with_elastic_regions(materials)
    example = '{"upper": ec.Elastic(210e3, 0.3), "lower": ec.Elastic(70e3, 0.33)}'
    kinds = {type(material) for material in materials.values()}
    first = next(iter(materials.values()), None)
    is_one_kind = len(kinds) == 1 and is_dataclass(first) and not isinstance(first, type)
    if not is_one_kind or not hasattr(first, "parameters"):
        raise InputError(
            f"Scene: material is {materials!r}; give a material for each region, all of one class, "
            f"e.g. {example}. Elastic regions may stand beside a class with a method of_elastic, "
            "as ec.Plastic has it."
        )
    known: Any = first
    values: dict[str, dict[str, Any]] = {name: {} for name in known.parameters}
    for region, material in materials.items():
        for entry in fields(material):
            value = getattr(material, entry.name)
            if entry.name not in values:
                if value != getattr(known, entry.name):
                    raise InputError(
                        f"Scene: {entry.name} of the material of {region!r} is {value!r}, but in "
                        f"another region {getattr(known, entry.name)!r}; it must be the same."
                    )
            elif isinstance(value, Mapping):
                raise InputError(
                    f"Scene: {entry.name} of the material of {region!r} is a mapping; give "
                    "a number or a callable, as the region is known."
                )
            else:
                values[entry.name][region] = value
    return replace(known, **values)


def _with_elastic_regions(materials: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return materials with elastic regions in the class of the other regions."""
    others = [material for material in materials.values() if type(material) is not Elastic]
    convert = getattr(others[0], "of_elastic", None) if others else None
    if convert is None:
        return materials
    result = {}
    for region, material in materials.items():
        result[region] = convert(material) if type(material) is Elastic else material
    return result


class Material(Protocol):
    """Describe a linear elastic material.

    Stress, compliance and modulus get the parameters by their names, as UFL: a class
    with the parameters ("lam", "G") has ``stress(self, eps, lam, G)``; ``*values`` is
    here for type checkers only. In 2D strain and stress are the parts in plane. Where
    its ``hypothesis`` is "axisymmetric", they are tensors (3, 3) with the rows r, z and
    hoop.

    In a plane it may have ``out_of_plane(sigma, **parameters)``, its stress out of
    plane [force/area]. Without that only the von Mises stress in plane is known.
    With given strains it needs ``out_of_plane_modulus(**parameters)``, too, the stress
    out of plane for a strain there where the stress in plane is zero [force/area].

    Example: ``demos/extend/material.py``.

    Attributes:
        parameters: Names of the attributes that are values in space: numbers, callables
            of x, or mappings from the names of regions to either.

    Example:
        >>> material: ec.Material = ec.Elastic(E=1000.0, nu=0.3)
        >>> material.parameters, material.modulus(E=1000.0, nu=0.3)
        (('E', 'nu'), 1000.0)
    """

    @property
    def parameters(self) -> tuple[str, ...]: ...  # noqa: D102

    def check(self, name: str, low: float, high: float) -> None:
        """Check the range ``[low, high]`` that a parameter takes in the body.

        A wrong one is refused by an InputError. The method is called for callables and
        mappings, when the scene meets its mesh. It is not called for numbers: a class
        checks these itself when it is made.
        """

    def stress(self, eps: Ufl, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return ``C eps`` [force/area], UFL, shape (d, d).

        It is linear in eps, a (d, d) tensor [-]; ``a : C b = b : C a``, and ``a : C a >
        0`` unless a is zero.
        """

    def compliance(self, sigma: Ufl, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return ``C^-1 sigma`` [-], UFL, shape (d, d).

        It inverts the stress to 8 digits.
        """

    def modulus(self, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return a modulus > 0 that scales contact parameters [force/area], UFL."""


def values_in_space(material: Any) -> dict[str, Any]:
    """Return the parameters of a material by their names.

    A law whose attributes are no numbers tells them by a method of this name.

    Raises:
        InputError: If there is no attribute of a name.
    """
    if hasattr(material, "values_in_space"):
        return dict(material.values_in_space())
    return {name: parameter(material, name) for name in material.parameters}


def parameter(owner: Any, name: str) -> Any:
    """Return the value of a parameter of a material, law or load.

    Raises:
        InputError: If there is no attribute of this name.
    """
    if not hasattr(owner, name):
        raise InputError(
            f"{type(owner).__name__} has {name!r} among its parameters and no such attribute;"
            " add it, or mend the name."
        )
    return getattr(owner, name)


def check_numbers(material: Any) -> None:
    """Check the parameters of a material that are numbers by its own ``check``.

    Raises:
        InputError: If one is neither a number nor a callable, or is not allowed.
    """
    for name, value in values_in_space(material).items():
        numbers = value.values() if isinstance(value, Mapping) else [value]
        for number in numbers:
            if callable(number):
                # Its values are checked on the mesh.
                continue
            if not isinstance(number, Real):
                raise InputError(
                    f"{type(material).__name__}: {name} is {number!r}; give a number, a callable"
                    " of x, or a mapping of regions."
                )
            material.check(name, float(number), float(number))


@dataclass(frozen=True)
class Elastic:
    """Declare isotropic linear elasticity.

    A material of the user's own is a class with the same members: ``parameters`` (names
    of the attributes that are values in space), ``check``, ``stress`` (symmetric and
    positive), ``compliance`` (its inverse, to 8 digits), and ``modulus`` (> 0); this is
    checked when the scene meets its mesh. In 2D it may tell its stress out of plane by
    ``out_of_plane``; without that only the von Mises stress of the part in plane is
    shown.

    Args:
        E: Young's modulus [force/area], > 0: a number, a callable of x, or a mapping
            from the names of cell regions to either.
        nu: Poisson's ratio [-], in (-1, 1/2); number, callable or mapping.
        hypothesis: "plane strain", "plane stress", or "axisymmetric" for a body of
            revolution that is given by its half plane, x[0] the radius and x[1] the
            axis; leave it out in 3D.

    Raises:
        InputError: If a number is outside its range or the hypothesis is unknown.

    Example:
        >>> material = ec.Elastic(E=lambda x: 1000.0 + 10.0 * x[1], nu=0.3)
        >>> material.hypothesis
        'plane strain'
    """

    E: Value | Mapping[str, Value]
    nu: Value | Mapping[str, Value]
    hypothesis: str = "plane strain"

    parameters: ClassVar[tuple[str, ...]] = ("E", "nu")

    def __repr__(self) -> str:
        """Return the material in words.

        The hypothesis is named only if it is not the usual one: in 3D there is none.
        """
        hypothesis = ""
        if self.hypothesis != PLANE_STRAIN:
            hypothesis = f", hypothesis={self.hypothesis!r}"
        return f"{type(self).__name__}(E={self.E!r}, nu={self.nu!r}{hypothesis})"

    def __post_init__(self) -> None:
        """Check the hypothesis and the numbers."""
        if self.hypothesis not in HYPOTHESES:
            raise InputError(
                f"Elastic: hypothesis is {self.hypothesis!r}; allowed are {', '.join(HYPOTHESES)}."
            )
        check_numbers(self)

    @staticmethod
    def check(name: str, low: float, high: float) -> None:
        """Check the range ``[low, high]`` that a parameter takes in the body.

        Raises:
            InputError: If E is not positive and finite, or nu not in (-1, 1/2).
        """
        if name == "E" and not 0.0 < low <= high < float("inf"):
            raise InputError(
                f"Elastic: Young's modulus E is {low:g}; it must be > 0 and finite [force/area]."
            )
        if name == "nu" and not -1.0 < low <= high < 0.5:
            wrong = low if not low > -1.0 else high
            raise InputError(
                f"Elastic: Poisson's ratio nu is {wrong:g}; it must lie in the open interval"
                " (-1, 1/2)."
            )

    def moduli(self, d: int, E: Ufl, nu: Ufl) -> tuple[Ufl, Ufl]:
        """Return the factors a and b of deviator and sphere [force/area].

        They are ``a = 2G`` and ``b = 2G + d lambda``.
        """
        shear = E / (1 + nu)
        if d == 3:
            return shear, E / (1 - 2 * nu)
        # In 2D the sphere is that in plane, b = 2 (lambda + G); plane stress has a
        # lambda of its own.
        if self.hypothesis == PLANE_STRESS:
            return shear, E / (1 - nu)
        return shear, shear / (1 - 2 * nu)

    def stress(self, eps: Ufl, E: Ufl, nu: Ufl) -> Ufl:
        """Return ``sigma = C eps`` [force/area], shape (d, d)."""
        a, b = self.moduli(eps.ufl_shape[0], E, nu)
        return scale_parts(eps, a, b)

    def compliance(self, sigma: Ufl, E: Ufl, nu: Ufl) -> Ufl:
        """Return ``eps = C^-1 sigma`` [-], shape (d, d)."""
        a, b = self.moduli(sigma.ufl_shape[0], E, nu)
        return scale_parts(sigma, 1 / a, 1 / b)

    def out_of_plane(self, sigma: Ufl, E: Ufl, nu: Ufl) -> Ufl:
        """Return the stress ``sigma_zz`` of a plane tensor (2, 2) [force/area]."""
        return 0.0 if self.hypothesis == PLANE_STRESS else nu * ufl.tr(sigma)

    def out_of_plane_modulus(self, E: Ufl, nu: Ufl) -> Ufl:
        """Return ``-sigma_zz/eps_0zz`` without stress in plane [force/area]."""
        return 0.0 if self.hypothesis == PLANE_STRESS else E

    def modulus(self, E: Ufl, nu: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area]: Young's."""
        return E
