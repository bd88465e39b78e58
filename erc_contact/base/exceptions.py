"""Errors of the package: one root, few children, every message says what to do.

A message names what was got, what is allowed and what to change. Errors of meshes and
files come from :mod:`namedmesh`, which knows no scene; their root is the root of all.
"""

from __future__ import annotations

from namedmesh.base.exceptions import (
    InputError,
    NamedMeshError,
    on_rank,
    raise_together,
    together,
    words_of,
)

__all__ = [
    "ErcContactError",
    "InputError",
    "NotBalanced",
    "NotConverged",
    "NotHeldError",
    "on_rank",
    "raise_together",
    "together",
    "words_of",
]

ErcContactError = NamedMeshError
"""The root of all errors that both packages raise on purpose."""


class NotHeldError(InputError):
    """Tell that loads are not in balance on a rigid motion that nothing holds.

    Example:
        >>> ec.solve(ec.Scene(scene.material, loads=[ec.BodyForce((0.0, -1.0))]), block)
        Traceback (most recent call last):
        erc_contact.base.exceptions.NotHeldError: ...
    """


class NotBalanced(InputError):
    """Tell that a reconstructed stress is not in equilibrium: it certifies nothing.

    It says where, and which force is missing.

    Example:
        >>> issubclass(ec.NotBalanced, ec.InputError)
        True
    """


class NotConverged(ErcContactError, RuntimeError):
    """Tell that the contact solve ended without a solution.

    Attributes:
        rungs: One line for each attempt: start, line search, Newton steps, PETSc's
            reason, last residual.

    Example:
        >>> attempts = ("from rest: 50 Newton steps",)
        >>> failure = ec.NotConverged("No solution.", rungs=attempts)
        >>> print(failure, *failure.rungs, sep="; ")
        No solution.; from rest: 50 Newton steps
    """

    def __init__(self, message: str, rungs: tuple[str, ...]) -> None:
        super().__init__(message)
        self.rungs = rungs

    def __reduce__(self) -> tuple[type[NotConverged], tuple[str, tuple[str, ...]]]:
        """Return how it travels to other ranks."""
        return type(self), (str(self), self.rungs)
