"""Say what a run asks of the object that follows its goal."""

from __future__ import annotations

from typing import Protocol

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.numbers import Bounds


class Aiming(Protocol):
    """Follow the goal of a run; collective.

    See :class:`erc_contact.error.goals.controller.GoalController`.

    Attributes:
        before: What was carried to the last mesh.
    """

    before: dict[str, float]

    @property
    def bounds(self) -> Bounds | None: ...  # noqa: D102

    @property
    def reached(self) -> bool: ...  # noqa: D102

    @property
    def words(self) -> str: ...  # noqa: D102

    def measure(self, error: ConstitutiveError, carried: dict[str, float] | None) -> None:
        """Measure the interval on a mesh, or estimate it."""

    def finish(self, error: ConstitutiveError) -> None:
        """Measure the interval on the last mesh of a run."""

    def marked(self, error: ConstitutiveError) -> ConstitutiveError:
        """Return an error whose cells count by their share in the interval."""
