"""Declare orthotropic linear elasticity: wood, rolled sheets, plies of fibres.

In its three axes normal stresses and strains are a symmetric matrix of nine constants,

    eps_i = sigma_i/E_i - sum over j != i of nu_ij sigma_j/E_i,
    nu_ij/E_i = nu_ji/E_j,

and each shear strain is ``sigma_ij/(2 G_ij)``. A strain or stress is turned into the
axes, and the result is turned back.

Symbols: E_i Young's moduli [force/area], nu_ij contraction along j under a stress along
i over the strain along i [-], G_ij shear moduli [force/area], S compliance of normal
stresses [area/force], R axes, one in each row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from numbers import Real
from typing import Any, ClassVar

import numpy as np
import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl, Value
from erc_contact.scene.material import (
    AXISYMMETRIC,
    HYPOTHESES,
    PLANE_STRAIN,
    PLANE_STRESS,
    Elastic,
    check_numbers,
)

PAIRS = ((0, 1), (0, 2), (1, 2))
"""Pairs of axes in the order of nu and G: 12, 13, 23."""
ALIGNED = 1e-9
"""Greatest error of unit vectors that are axes [-]."""
IN_SPACE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""The axes of the mesh."""

Three = tuple[Value, Value, Value]
"""Values for three axes, or for the three pairs of them."""
Axes = Sequence[Sequence[float]]
"""Unit vectors, shape (3, 3), or (2, 2) in the plane."""


@dataclass(frozen=True)
class OrthotropicElastic:
    """Declare orthotropic linear elasticity.

    In the plane and of bodies of revolution the third axis is out of the plane. Beside
    it in a mapping of regions an :class:`Elastic` is orthotropic with equal axes.

    Args:
        E: Young's moduli ``(E_1, E_2, E_3)`` [force/area], > 0: numbers, callables of
            x, or a mapping from the names of cell regions to such three.
        nu: Poisson's ratios ``(nu_12, nu_13, nu_23)`` [-]; nu_12 is of the contraction
            along 2 under a stress along 1. Likewise.
        G: Shear moduli ``(G_12, G_13, G_23)`` [force/area], > 0; likewise.
        axes: Unit vectors along 1, 2 and 3, one in each row, shape (3, 3); in the plane
            those along 1 and 2, shape (2, 2). A mapping from regions to axes, too.
        hypothesis: As of :class:`Elastic`. A body of revolution has the rows r, z and
            hoop.

    Raises:
        InputError: If a number is outside its range, the energy is not positive, the
            axes are not orthonormal, or the hypothesis is unknown.

    Reference:
        Jones (1999), Mechanics of Composite Materials, section 2.4, with (2.45) to
        (2.51) for the constants whose energy is positive.

    Example:
        >>> spruce = ec.OrthotropicElastic(
        ...     E=(11e3, 900.0, 500.0), nu=(0.4, 0.4, 0.5), G=(700.0, 650.0, 40.0)
        ... )
        >>> spruce.axes[0]
        (1.0, 0.0, 0.0)
    """

    E: Three | Mapping[str, Three]
    nu: Three | Mapping[str, Three]
    G: Three | Mapping[str, Three]
    axes: Axes | Mapping[str, Axes] = IN_SPACE
    hypothesis: str = PLANE_STRAIN

    parameters: ClassVar[tuple[str, ...]] = ("E", "nu", "G", "axes")

    def __post_init__(self) -> None:
        """Check the numbers, region by region."""
        if self.hypothesis not in HYPOTHESES:
            raise InputError(
                f"OrthotropicElastic: hypothesis is {self.hypothesis!r}; allowed are "
                f"{', '.join(HYPOTHESES)}."
            )
        for name in ("E", "nu", "G"):
            _by_region(getattr(self, name), partial(_check_three, name))
        axes = _by_region(self.axes, _orthonormal)
        object.__setattr__(self, "axes", axes)
        check_numbers(self)
        _check_energies(self.E, self.nu)

    @classmethod
    def of_elastic(cls, elastic: Elastic) -> OrthotropicElastic:
        """Return an isotropic material as a material whose axes are alike."""
        E, nu = elastic.E, elastic.nu
        if isinstance(E, Mapping) or isinstance(nu, Mapping):
            raise InputError(
                "Scene: E and nu of an elastic region beside an orthotropic region are "
                f"{E!r} and {nu!r}; give numbers or callables, as the region is known."
            )
        shear = _shear_modulus(E, nu)
        return cls((E,) * 3, (nu,) * 3, (shear,) * 3, hypothesis=elastic.hypothesis)

    def values_in_space(self) -> dict[str, Any]:
        """Return the twelve constants and the components of the axes by their names."""
        result: dict[str, Any] = {}
        for i in range(3):
            first, second = PAIRS[i]
            pair = f"{first + 1}{second + 1}"
            result[f"E{i + 1}"] = _entry(self.E, i)
            result[f"nu{pair}"] = _entry(self.nu, i)
            result[f"G{pair}"] = _entry(self.G, i)
        for i in range(3):
            for j in range(3):
                result[f"axis{i + 1}{j + 1}"] = _entry(self.axes, i, j)
        return result

    @staticmethod
    def check(name: str, low: float, high: float) -> None:
        """Check the range ``[low, high]`` that a parameter takes in the body.

        Raises:
            InputError: If a modulus is not positive and finite.
        """
        if name[0] in "EG" and not 0.0 < low <= high < float("inf"):
            raise InputError(
                f"OrthotropicElastic: {name} is {low:g}; it must be > 0 and finite [force/area]."
            )
        if not -float("inf") < low <= high < float("inf"):
            raise InputError(f"OrthotropicElastic: {name} is {low:g}; it must be finite.")

    def stress(self, eps: Ufl, **values: Ufl) -> Ufl:
        """Return ``sigma = C eps`` [force/area], of the shape of eps."""
        S = self._compliance_of_normals(eps.ufl_shape[0], values)
        shear = _shear_moduli(values)
        return _in_axes(eps, values, ufl.inv(S), {pair: 2 * G for pair, G in shear.items()})

    def compliance(self, sigma: Ufl, **values: Ufl) -> Ufl:
        """Return ``eps = C^-1 sigma`` [-], of the shape of sigma."""
        S = self._compliance_of_normals(sigma.ufl_shape[0], values)
        shear = _shear_moduli(values)
        return _in_axes(sigma, values, S, {pair: 1 / (2 * G) for pair, G in shear.items()})

    def out_of_plane(self, sigma: Ufl, **values: Ufl) -> Ufl:
        """Return the stress along 3 of a plane tensor (2, 2) [force/area]."""
        if self.hypothesis == PLANE_STRESS:
            return ufl.as_ufl(0.0)
        R = _axes(values, 2)
        turned = R * sigma * R.T
        S = _compliance(values)
        return -(S[2, 0] * turned[0, 0] + S[2, 1] * turned[1, 1]) / S[2, 2]

    def out_of_plane_modulus(self, E3: Ufl, **others: Ufl) -> Ufl:
        """Return ``-sigma_33/eps_033`` without stress in plane [force/area]."""
        return 0.0 if self.hypothesis == PLANE_STRESS else E3

    def modulus(self, E1: Ufl, E2: Ufl, E3: Ufl, **others: Ufl) -> Ufl:
        """Return the greatest Young's modulus, which scales contact parameters."""
        return ufl.max_value(E1, ufl.max_value(E2, E3))

    def _compliance_of_normals(self, d: int, values: Mapping[str, Ufl]) -> Ufl:
        """Return S of the normal components that a tensor (d, d) has.

        In plane strain the stress along 3 is such that nothing stretches along 3.

        Raises:
            InputError: If the third axis is in the plane.
        """
        S = _compliance(values)
        if d == 3:
            if self.hypothesis == AXISYMMETRIC:
                self._check_third_axis("hoop")
            return S
        self._check_third_axis("out of the plane")
        if self.hypothesis == PLANE_STRESS:
            return ufl.as_matrix([[S[i, j] for j in range(2)] for i in range(2)])
        rows = [[S[i, j] - S[i, 2] * S[2, j] / S[2, 2] for j in range(2)] for i in range(2)]
        return ufl.as_matrix(rows)

    def _check_third_axis(self, where: str) -> None:
        """Check that the third axis is the third axis of the mesh."""
        every = self.axes.values() if isinstance(self.axes, Mapping) else [self.axes]
        for axes in every:
            if abs(abs(axes[2][2]) - 1.0) > ALIGNED:
                raise InputError(
                    f"OrthotropicElastic: the third axis is {axes[2]}; on this mesh it must be "
                    f"{where}, (0, 0, 1). Name the axes anew, or take a mesh in 3D."
                )


def _by_region(value: Any, act: Callable[[Any], Any]) -> Any:
    """Return what a function makes of a value, or of the values of all regions."""
    if isinstance(value, Mapping):
        return {region: act(entry) for region, entry in value.items()}
    return act(value)


def _entry(value: Any, *place: int) -> Any:
    """Return an entry of a value, or of the values of all regions."""

    def of(row: Any) -> Any:
        for index in place:
            row = row[index]
        return row

    return _by_region(value, of)


def _check_three(name: str, values: Any) -> None:
    """Check that there are three values."""
    if not isinstance(values, tuple | list) or len(values) != 3:
        raise InputError(
            f"OrthotropicElastic: {name} is {values!r}; give three values, for the axes 1, 2 and 3 "
            "of E, and for the pairs 12, 13 and 23 of nu and G."
        )


def _orthonormal(axes: Any) -> tuple[tuple[float, ...], ...]:
    """Return axes of shape (3, 3).

    Raises:
        InputError: If they are not orthonormal.
    """
    try:
        rows = np.array(axes, dtype=float)
    except (TypeError, ValueError):
        rows = np.zeros(0)
    if rows.shape == (2, 2):
        rows = np.block([[rows, np.zeros((2, 1))], [np.zeros((1, 2)), np.ones((1, 1))]])
    if rows.shape != (3, 3) or abs(rows @ rows.T - np.eye(3)).max() > ALIGNED:
        raise InputError(
            f"OrthotropicElastic: axes are {axes!r}; give unit vectors at right angles, one in "
            "each row: three of three components, or two of two in the plane."
        )
    return tuple(tuple(row) for row in rows.tolist())


def _check_energies(E: Any, nu: Any) -> None:
    """Check that numbers have a positive energy; callables are checked on the mesh."""
    regions = next((list(value) for value in (E, nu) if isinstance(value, Mapping)), [None])
    for region in regions:
        of_region = [value[region] if isinstance(value, Mapping) else value for value in (E, nu)]
        moduli, ratios = of_region
        if not all(isinstance(number, Real) for number in (*moduli, *ratios)):
            continue
        # S times sqrt(E_i E_j) has the same signs of its eigenvalues, and no units.
        scaled = np.eye(3)
        for (i, j), ratio in zip(PAIRS, ratios, strict=True):
            scaled[i, j] = scaled[j, i] = -ratio * np.sqrt(moduli[j] / moduli[i])
        if np.linalg.eigvalsh(scaled)[0] <= ALIGNED:
            where = f" in {region!r}" if region is not None else ""
            raise InputError(
                f"OrthotropicElastic: E {tuple(moduli)} and nu {tuple(ratios)}{where} have no "
                "positive energy: some stress would do work on the body for nothing. Each "
                "|nu_ij| must be below sqrt(E_i/E_j), and all together not too large. Is nu_21 "
                "= nu_12 E_2/E_1 given in the place of nu_12?"
            )


def _shear_modulus(E: Value, nu: Value) -> Value:
    """Return G of an isotropic material."""
    if not callable(E) and not callable(nu):
        return E / (2 * (1 + nu))

    def at(value: Value, x: Any) -> Any:
        return value(x) if callable(value) else value

    return lambda x: at(E, x) / (2 * (1 + at(nu, x)))


def _compliance(values: Mapping[str, Ufl]) -> Ufl:
    """Return S of all three axes, UFL (3, 3)."""
    rows: list[list[Ufl]] = [[ufl.as_ufl(0.0)] * 3 for _ in range(3)]
    for i in range(3):
        rows[i][i] = 1 / values[f"E{i + 1}"]
    for i, j in PAIRS:
        rows[i][j] = rows[j][i] = -values[f"nu{i + 1}{j + 1}"] / values[f"E{i + 1}"]
    return ufl.as_matrix(rows)


def _shear_moduli(values: Mapping[str, Ufl]) -> dict[tuple[int, int], Ufl]:
    """Return the shear modulus of each pair of axes."""
    return {(i, j): values[f"G{i + 1}{j + 1}"] for i, j in PAIRS}


def _axes(values: Mapping[str, Ufl], d: int) -> Ufl:
    """Return the axes that a tensor (d, d) has, UFL (d, d)."""
    rows = [[values[f"axis{i + 1}{j + 1}"] for j in range(d)] for i in range(d)]
    return ufl.as_matrix(rows)


def _in_axes(
    tensor: Ufl, values: Mapping[str, Ufl], normal: Ufl, shear: Mapping[tuple[int, int], Ufl]
) -> Ufl:
    """Turn a tensor into the axes, multiply its components, and turn it back.

    Args:
        tensor: Shape (d, d).
        values: The parameters.
        normal: What the normal components are multiplied by, shape (d, d).
        shear: What the shear components are multiplied by.
    """
    d = tensor.ufl_shape[0]
    R = _axes(values, d)
    turned = R * tensor * R.T
    rows: list[list[Ufl]] = [[ufl.as_ufl(0.0)] * d for _ in range(d)]
    for i in range(d):
        rows[i][i] = sum(normal[i, j] * turned[j, j] for j in range(d))
        for j in range(i + 1, d):
            rows[i][j] = rows[j][i] = shear[i, j] * turned[i, j]
    return R.T * ufl.as_matrix(rows) * R
