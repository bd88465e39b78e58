"""Declare tied joints: parts of two bodies that are glued to each other."""

from __future__ import annotations

from dataclasses import dataclass

from erc_contact.base.exceptions import InputError
from erc_contact.scene.checks import check_name


@dataclass(frozen=True)
class Tied:
    """Declare that two parts which face each other are glued.

    The jump of the displacement is zero there, and the joint carries any traction. The
    parts are a pair of :meth:`Domain.split` or :meth:`Domain.joined`. The scene is
    solved on the mesh whose nodes are one there, so the error is the error of one body;
    the names of both parts stay, for forces and profiles.

    Args:
        facets: Name of a boundary part.
        against: Name of the part of the other body, which faces it.

    Raises:
        InputError: If these are no two names.

    Example:
        >>> ec.Tied("upper bottom", "lower top")
        Tied(facets='upper bottom', against='lower top')
    """

    facets: str
    against: str

    def __post_init__(self) -> None:
        """Check the names."""
        kind = type(self).__name__
        check_name(kind, self.facets)
        check_name(f"{kind}({self.facets!r}): against", self.against)
        if self.facets == self.against:
            raise InputError(
                f"{kind}({self.facets!r}) is against itself; give the facing part of another body."
            )

    @property
    def sides(self) -> tuple[str, str]:
        """Return the names of both parts."""
        return (self.facets, self.against)
