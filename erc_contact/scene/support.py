"""Declare supports: prescribed displacements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from erc_contact.base.exceptions import InputError
from erc_contact.scene.checks import check_name, check_vector
from erc_contact.scene.material import Value


@dataclass(frozen=True)
class Displacement:
    """Declare a prescribed displacement ``u = U`` on a boundary part, per component.

    Args:
        facets: Name of the boundary part.
        value: One number or callable of x for each dimension [length]; None leaves a
            component free (a roller).

    Raises:
        InputError: If the value is no such sequence, or fixes nothing.

    Example:
        >>> ec.Displacement("left", (0.0, None))  # symmetry: free along y
        Displacement(facets='left', value=(0.0, None))
    """

    facets: str
    value: Sequence[Value | None]

    def __post_init__(self) -> None:
        """Check the arguments."""
        check_name("Displacement", self.facets)
        what = f"Displacement({self.facets!r})"
        if callable(self.value):
            raise InputError(
                f"{what}: give one value or callable for each component, (ux, uy),"
                " not one callable."
            )
        check_vector(what, self.value, free=True)
        object.__setattr__(self, "value", tuple(self.value))
        if all(component is None for component in self.value):
            raise InputError(f"{what} fixes no component; leave it out.")

    @property
    def is_moved(self) -> bool:
        """Tell whether a displacement is prescribed that is not zero."""
        return any(callable(component) or component for component in self.value)
