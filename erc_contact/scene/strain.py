"""Declare given strains, which a body would have without any stress.

Heat, swelling and misfit are strains eps_0 that no stress causes. The stress comes from
what remains,

    sigma = C (eps(u) - eps_0).

A given strain of a new kind is a class with the members of :class:`GivenStrain`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl, Value
from erc_contact.scene.checks import check_region, check_value, round_off

Tensor = Value | Sequence[Sequence[Value]] | Callable[[Any], Any]
"""A number, d rows of d values, or a callable of x that returns either."""


class GivenStrain(Protocol):
    """Describe a given strain.

    Attributes:
        region: Name of the cell region that has it, or None for the whole body.
        parameters: Names of the attributes that are values in space: numbers, callables
            of x, or mappings from the names of all regions to either. One that is
            called "value" may also be d rows of d numbers or callables, and a mapping
            may leave out regions: there is no strain.

    Example:
        >>> strain: ec.GivenStrain = ec.ThermalStrain(1.2e-5, 80.0)
        >>> strain.region, strain.parameters
        (None, ('alpha', 'temperature'))
    """

    @property
    def region(self) -> str | None: ...  # noqa: D102

    @property
    def parameters(self) -> tuple[str, ...]: ...  # noqa: D102

    def strain(self, x: Ufl, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return the strain eps_0 [-], UFL.

        A scalar is a strain of that size in all directions of space, in 2D also out of
        plane. A tensor, shape (d, d), has the components in plane alone, and counts by
        its symmetric part.

        Args:
            x: Position [length], UFL, shape (d,).
            values: Not used; type checkers ask for it, so that a class may name its
                parameters.
            parameters: The parameters by their names, UFL.
        """


@dataclass(frozen=True)
class ThermalStrain:
    """Declare the strain of heat, ``alpha T`` in all directions.

    Args:
        alpha: Coefficient of thermal expansion [1/temperature]: a number, a callable of
            x, or a mapping from the names of all cell regions to either.
        temperature: Difference T of the temperature to that without strain
            [temperature]; likewise.
        region: Name of the cell region that has it; None for the whole body.

    Raises:
        InputError: If a value is no finite number, callable or mapping of these.

    Example:
        >>> heat = ec.ThermalStrain(1.2e-5, lambda x: 40.0 * x[1])
        >>> ec.Scene(scene.material, scene.supports, strains=heat).strains
        (ThermalStrain(alpha=1.2e-05, temperature=<function ...>, region=None),)
    """

    alpha: Value | Mapping[str, Value]
    temperature: Value | Mapping[str, Value]
    region: str | None = None

    parameters: ClassVar[tuple[str, ...]] = ("alpha", "temperature")

    def __post_init__(self) -> None:
        """Check the arguments."""
        check_region("ThermalStrain", self.region)
        for name in self.parameters:
            value = getattr(self, name)
            entries = value.values() if isinstance(value, Mapping) else [value]
            for entry in entries:
                check_value(f"ThermalStrain: {name}", entry)

    def strain(self, x: Ufl, alpha: Ufl, temperature: Ufl) -> Ufl:
        """Return ``alpha T`` [-], UFL."""
        return alpha * temperature


@dataclass(frozen=True)
class Eigenstrain:
    """Declare a strain that is given itself: swelling, a misfit, a transformation.

    Args:
        value: A number, which is a strain in all directions of space [-]; or d rows of
            d numbers or callables, a symmetric tensor that acts in plane in 2D; or a
            callable of x that returns either. A mapping from names of cell regions to
            these gives each its own; regions that it leaves out have no strain.
        region: Name of the cell region that has it; None for the whole body.

    Raises:
        InputError: If the value is none of these, a tensor of numbers is not symmetric
            up to round-off, or a mapping has a region beside it.

    Example:
        >>> ec.Eigenstrain(((0.001, 0.0), (0.0, -0.001)))
        Eigenstrain(value=((0.001, 0.0), (0.0, -0.001)), region=None)
        >>> ec.Eigenstrain({"steel": 1e-4, "glue": -0.002})
        Eigenstrain(value={'steel': 0.0001, 'glue': -0.002}, region=None)
    """

    value: Tensor | Mapping[str, Tensor]
    region: str | None = None

    parameters: ClassVar[tuple[str, ...]] = ("value",)

    def __post_init__(self) -> None:
        """Check the arguments."""
        check_region("Eigenstrain", self.region)
        if not isinstance(self.value, Mapping):
            object.__setattr__(self, "value", check_strain("Eigenstrain", self.value))
            return
        if self.region is not None or not self.value:
            raise InputError(
                f"Eigenstrain is {self.value!r} with the region {self.region!r}; give a mapping"
                ' from names of regions to their strains, {"core": 0.001}, or one strain with'
                " region=."
            )
        values = {}
        for region, value in self.value.items():
            check_region("Eigenstrain", region)
            values[region] = check_strain(f"Eigenstrain in {region!r}", value)
        object.__setattr__(self, "value", values)

    def strain(self, x: Ufl, value: Ufl) -> Ufl:
        """Return the strain [-], UFL, a scalar or of shape (d, d)."""
        return value


def check_strain(what: str, value: Any) -> Any:
    """Return a strain that is a number, a callable or a tensor, whose rows are tuples.

    Args:
        what: The strain, in words for messages.
        value: The value.

    Raises:
        InputError: If it is none of these, or not symmetric.
    """
    if callable(value) or not isinstance(value, Sequence | np.ndarray):
        check_value(what, value)
        return value
    rows = []
    for row in value:
        entries = row if isinstance(row, Sequence | np.ndarray) else (row,)
        rows.append(tuple(entries))
    d = len(rows)
    if d not in (2, 3) or any(len(row) != d for row in rows):
        raise InputError(
            f"{what} is {value!r}; give a number, or d rows of d values, e.g."
            " ((0.001, 0.0), (0.0, 0.0))."
        )
    for row in rows:
        for entry in row:
            check_value(f"{what}: a component", entry)
    tolerance = round_off(entry for row in rows for entry in row)
    for i in range(d):
        for j in range(i):
            below, above = rows[i][j], rows[j][i]
            if callable(below) or callable(above):
                continue
            if abs(below - above) > tolerance:
                raise InputError(
                    f"{what} has the components {above:g} and {below:g} at ({j}, {i})"
                    f" and ({i}, {j}); give a symmetric matrix, half the shear angle twice."
                )
    return tuple(rows)
