"""Find the error of what is given: an error itself, or a run."""

from __future__ import annotations

from typing import Any, Protocol

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError


class Run(Protocol):
    """Represent a run with a result, a History or an Evolution."""

    @property
    def error(self) -> Any:
        """Return the error: the best of an adaptive run, the last of a history."""


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
