"""Find the error of what is given, an error itself or a run; say what a run has.

The classes of runs and errors are above this module, so that it has no types of errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from erc_contact.base.exceptions import InputError
from namedmesh import Domain
from namedmesh.base import checks

MeshErrors = Sequence[tuple[Domain, np.ndarray]]
"""Type of domains and eps_E of their owned cells."""


class Run(Protocol):
    """Represent a run with a result, a ``History`` or an ``Evolution``."""

    @property
    def steps(self) -> Sequence[Any]:
        """Return the rows of its table."""

    @property
    def accuracy(self) -> float:
        """Return the prescribed relative error."""

    @property
    def reached(self) -> bool:
        """Tell whether it was reached."""

    @property
    def outcome(self) -> str:
        """Say why it ended."""

    @property
    def error(self) -> Any:
        """Return the error, the best of an adaptive run, the last of a history."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """Return the other arguments of the run by their names."""

    def column(self, name: str) -> np.ndarray:
        """Return one number of each row: "dofs", "eps", "seconds", "time", ..."""


class AdaptiveRun(Run, Protocol):
    """Represent a run on several meshes, a ``History``."""

    @property
    def meshes(self) -> MeshErrors:
        """Return the meshes of the run."""

    def slope(self, against: str) -> float:
        """Fit the slope of log(eps) against the logarithm of a column.

        It is nan if there are too few meshes for it.
        """


class LoadingHistory(Run, Protocol):
    """Represent a run in time, an ``Evolution``."""

    @property
    def errors(self) -> tuple[Any, ...]:
        """Return the error at the end of each step."""

    def force(self, contact: str) -> np.ndarray:
        """Return the resultant on a contact at the end of each step [force].

        Returns:
            Forces, shape (steps, d).
        """


def error_of[Error](measured: Error | Run) -> Error:
    """Return the error itself, or the error of a run.

    Raises:
        InputError: If it is neither.
    """
    error: Any = measured if _is_error(measured) else getattr(measured, "error", None)
    if not _is_error(error):
        raise InputError(
            f"The error is {checks.description(measured)}; give a history, or the error that "
            "constitutive_error() returns."
        )
    return error


def _is_error(value: Any) -> bool:
    """Tell whether a value is an error of an admissible pair."""
    return hasattr(value, "admissible") and hasattr(value, "bulk_error")
