"""Goals: single numbers of the solution that a certified interval is asked of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from erc_contact.scene.checks import check_name, check_vector


@dataclass(frozen=True)
class _PartInDirection:
    """Hold a boundary part and a direction, and check both."""

    part: str
    direction: Sequence[float]

    def __post_init__(self) -> None:
        """Check the arguments."""
        kind = type(self).__name__
        check_name(kind, self.part)
        check_vector(f"{kind}({self.part!r})", self.direction, free=False)
        object.__setattr__(self, "direction", tuple(self.direction))


@dataclass(frozen=True)
class Resultant(_PartInDirection):
    """Ask for the force on a support or on a contact in one direction.

    Args:
        part: Name of the boundary part, with a support or in contact.
        direction: d numbers, of any length: the force is taken along it, times its
            length.

    Raises:
        InputError: If the direction is no such sequence.

    Example:
        >>> ec.Resultant("top", (0.0, 1.0))
        Resultant(part='top', direction=(0.0, 1.0))
    """


@dataclass(frozen=True)
class MeanDisplacement(_PartInDirection):
    """Ask for the mean displacement of a boundary part in one direction.

    Args:
        part: Name of the boundary part, with or without loads.
        direction: d numbers, of any length.

    Raises:
        InputError: If the direction is no such sequence.

    Example:
        >>> ec.MeanDisplacement("right", (0.0, 1.0))
        MeanDisplacement(part='right', direction=(0.0, 1.0))
    """


type Goal = Resultant | MeanDisplacement
"""A number of the solution."""
