"""Declare joints of bodies: parts that are glued, and the preloads of bolts."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any

from erc_contact.base.exceptions import InputError
from erc_contact.scene.checks import check_name
from namedmesh.base.checks import is_number


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


@dataclass(frozen=True)
class Preload(Tied):
    """Declare that the sides of a cut through a body are drawn together.

    The sides move by a shift q along the axis d of the cut, its mean normal out of the
    first side, and are one beyond it:

        u_1 - u_2 = q d,    sigma n equal on both sides.

    So a bolt whose shank is cut is shortened by q, and carries the force F along d.
    Exactly one of F, q and ``locked`` is given. The parts are a pair of
    :meth:`Domain.split` or :meth:`Domain.joined` that goes through the whole section.
    The cells of the first side that touch the cut must be free of contacts with
    friction, and of supports and springs that hold them along d.

    Args:
        facets: Name of the first side of the cut.
        against: Name of the other side.
        force: F [force], in tension > 0.
        shortening: q [length]; > 0 draws the sides together. If it is not given, it is
            found, to eight digits of F on each mesh. The scene of the solution has it.
        locked: Whether q is the shift of the last step of a history, as in a bolt that
            is tightened.

    Raises:
        InputError: If not exactly one of force, shortening and locked tells the shift,
            a number is not finite, or these are no two names.

    Source: the jump q d is a given strain in the cells of the first side beside the
    cut. So e (16) is the error of the body with this shift, as with any given strain. A
    law with a potential has the jump in its strain, and may yield there. Where sigma^
    has the resultant F it bounds the error of the body with this force, too: then ``(F
    - F^) (q* - q)``, which would be added with its shift q*, is zero.

    Example:
        >>> ec.Preload("upper bottom", "lower top", force=20e3)
        Preload(facets='upper bottom', against='lower top', force=20000.0, ...)
    """

    force: float | None = None
    shortening: float | None = None
    locked: bool = False

    def __post_init__(self) -> None:
        """Check the arguments."""
        super().__post_init__()
        if not isinstance(self.locked, bool):
            raise InputError(f"{self._what}: locked is {self.locked!r}; give True or False.")
        self._check_told()
        for name in ("force", "shortening"):
            self._check_number(name, getattr(self, name))

    def found(self, shortening: float, *, locked: bool) -> Preload:
        """Return the preload with the shift that was found for it, beside its force.

        Args:
            shortening: The shift [length].
            locked: Whether it is the shift of an earlier step, found for a force there.
        """
        preload = copy(self)
        # The class is frozen, and its arguments tell one thing: only here they may not.
        object.__setattr__(preload, "shortening", shortening)
        object.__setattr__(preload, "locked", locked)
        return preload

    def _check_told(self) -> None:
        """Check that a single argument tells the shift."""
        told = {
            "force": self.force is not None,
            "shortening": self.shortening is not None,
            "locked": self.locked,
        }
        names = [f"{name}={getattr(self, name)!r}" for name, given in told.items() if given]
        if len(names) != 1:
            raise InputError(
                f"{self._what} has {' and '.join(names) or 'nothing that tells its shift'}; give"
                " one of force= and shortening=, or in a step of a history after another one"
                " locked=True."
            )

    @property
    def _what(self) -> str:
        """Return the preload in words for messages."""
        return f"Preload({self.facets!r})"

    def _check_number(self, name: str, value: Any) -> None:
        """Check that an argument is a finite number, or None."""
        if value is None:
            return
        if not is_number(value):
            raise InputError(
                f"{self._what}: {name} is {value!r}; give a finite number. In a history the scene"
                " is a function of time, and so is it."
            )
