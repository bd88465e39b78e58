"""Linear elastic materials: strain, stress, compliance (UFL, no mesh).

Symbols: u displacement [length], eps strain [-], sigma stress [force/area], E Young's
modulus [force/area], nu Poisson's ratio [-], G shear modulus, d the dimension.

Isotropic elasticity scales the deviator and the sphere of a tensor: with
``a = 2G`` and ``b = 2G + d lambda``

    sigma = a dev(eps) + b sph(eps),        eps = dev(sigma)/a + sph(sigma)/b,

so the compliance stays bounded as nu -> 1/2 (b -> infinity) and no digit is lost there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from math import sqrt
from numbers import Real
from typing import Any, ClassVar, Protocol

import numpy as np
import ufl

from erc_contact.base.exceptions import InputError

Value = float | Callable[[Any], Any]
"""A number, or a callable of the position x that returns a number or a UFL expression of x."""

HYPOTHESES = PLANE_STRAIN, PLANE_STRESS = ("plane strain", "plane stress")


@cache
def mandel_basis(d: int) -> np.ndarray:
    """Orthonormal basis of the symmetric (d, d) matrices, shape (s, d, d) with s = d(d+1)/2."""
    basis = [np.outer(e, e) for e in np.eye(d)]
    for i in range(d):
        for j in range(i + 1, d):
            b = np.zeros((d, d))
            b[i, j] = b[j, i] = 1 / sqrt(2)
            basis.append(b)
    return np.array(basis)


def mandel_matrix(act: Callable[..., Any], d: int, **parameters: Any) -> Any:
    """The matrix of a linear map of symmetric tensors, stress or compliance, in Mandel components, UFL (s, s)."""
    basis = [ufl.as_tensor(b.tolist()) for b in mandel_basis(d)]
    images = [act(b, **parameters) for b in basis]
    return ufl.as_matrix([[ufl.inner(b, image) for image in images] for b in basis])


def strain(u: Any) -> Any:
    """Linearised strain ``eps(u) = (grad u + grad u^T)/2`` [-], shape (d, d)."""
    return ufl.sym(ufl.grad(u))


def scale_parts(tensor: Any, deviator: Any, sphere: Any) -> Any:
    """Scale the deviator and the sphere of a (d, d) tensor: ``deviator * dev + sphere * sph``."""
    d = tensor.ufl_shape[0]
    sph = ufl.tr(tensor) / d * ufl.Identity(d)
    return deviator * (tensor - sph) + sphere * sph


class Material(Protocol):
    """A linear elastic material.

    Stress, compliance and modulus get the parameters by their names, as UFL: a class
    with the parameters ("lam", "G") has ``stress(self, eps, lam, G)``; ``*values`` is
    here for type checkers only. In 2D strain and stress are the parts in plane.

    In 2D it may have ``out_of_plane(sigma, **parameters)``, its stress out of plane
    [force/area]. Without that only the von Mises stress of the part in plane is known.

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
        """Refuse the range ``[low, high]`` that a parameter takes in the body, by an InputError.

        It is called for callables and mappings, when the scene meets its mesh. It is
        not called for numbers: a class checks these itself when it is made.
        """

    def stress(self, eps: Any, *values: Any, **parameters: Any) -> Any:
        """``C eps`` [force/area], UFL, shape (d, d).

        It is linear in eps, a (d, d) tensor [-]; ``a : C b = b : C a``, and ``a : C a >
        0`` unless a is zero.
        """

    def compliance(self, sigma: Any, *values: Any, **parameters: Any) -> Any:
        """``C^-1 sigma`` [-], UFL, shape (d, d): the inverse of stress to 8 digits."""

    def modulus(self, *values: Any, **parameters: Any) -> Any:
        """A modulus > 0 that scales contact parameters [force/area], UFL."""


@dataclass(frozen=True)
class Elastic:
    """Isotropic linear elasticity.

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
        hypothesis: "plane strain" or "plane stress"; leave it out in 3D.

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
        """Tell the hypothesis only if it is not the usual one: in space there is none."""
        hypothesis = "" if self.hypothesis == PLANE_STRAIN else f", hypothesis={self.hypothesis!r}"
        return f"{type(self).__name__}(E={self.E!r}, nu={self.nu!r}{hypothesis})"

    def __post_init__(self) -> None:
        if self.hypothesis not in HYPOTHESES:
            raise InputError(
                f"Elastic: hypothesis is {self.hypothesis!r}; allowed are {' and '.join(HYPOTHESES)}."
            )
        for name in self.parameters:
            value = getattr(self, name)
            for number in value.values() if isinstance(value, Mapping) else (value,):
                if callable(number):
                    continue
                if not isinstance(number, Real):
                    raise InputError(
                        f"Elastic: {name} is {number!r}; give a number, a callable of x, or a mapping of regions."
                    )
                self.check(name, float(number), float(number))

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
                f"Elastic: Poisson's ratio nu is {wrong:g}; it must lie in the open interval (-1, 1/2)."
            )

    def moduli(self, d: int, E: Any, nu: Any) -> tuple[Any, Any]:
        """The factors (a, b) of deviator and sphere [force/area]: ``a = 2G``, ``b = 2G + d lambda``."""
        shear = E / (1 + nu)
        if d == 3:
            return shear, E / (1 - 2 * nu)
        return shear, E / (1 - nu) if self.hypothesis == "plane stress" else shear / (1 - 2 * nu)

    def stress(self, eps: Any, E: Any, nu: Any) -> Any:
        """``sigma = C eps`` [force/area], shape (d, d)."""
        return scale_parts(eps, *self.moduli(eps.ufl_shape[0], E, nu))

    def compliance(self, sigma: Any, E: Any, nu: Any) -> Any:
        """``eps = C^-1 sigma`` [-], shape (d, d)."""
        a, b = self.moduli(sigma.ufl_shape[0], E, nu)
        return scale_parts(sigma, 1 / a, 1 / b)

    def out_of_plane(self, sigma: Any, E: Any, nu: Any) -> Any:
        """The stress ``sigma_zz`` of a plane stress tensor (2, 2) [force/area]."""
        return 0.0 if self.hypothesis == "plane stress" else nu * ufl.tr(sigma)

    def modulus(self, E: Any, nu: Any) -> Any:
        """The modulus that scales contact parameters [force/area]: Young's."""
        return E
