"""Errors of the package: one root, few children, every message says what to do.

A message names what was got, what is allowed and what to change. Under MPI an
error that one rank finds is raised on all of them (:func:`raise_together`), so
that no rank waits for ever in a collective call.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from mpi4py import MPI


class NamedMeshError(Exception):
    """Stand for all errors that the package raises on purpose.

    Example:
        >>> issubclass(nm.InputError, nm.NamedMeshError)
        True
    """


class InputError(NamedMeshError, ValueError):
    """Tell that a mesh, a file or an argument cannot be worked with.

    Example:
        >>> nm.rectangle((0.0, 0.0), (2.0, 7.0), size=-0.5)
        Traceback (most recent call last):
        namedmesh.base.exceptions.InputError: ...
    """


def raise_together(comm: MPI.Comm, error: BaseException | None) -> None:
    """Raise on every rank of ``comm`` if any rank has an error; collective.

    Public collective functions begin with it: an error of a rank whose user's code
    failed, before it came there, meets the other ranks at this place. One that came
    this way is already known to all ranks and is raised as it is.

    Args:
        comm: Communicator; every rank must call.
        error: What this rank found, or None.

    Raises:
        Exception: This rank's own error, or the first other rank's.
    """
    if error is not None and getattr(error, "known_to_all", False):
        raise error
    portable = None if error is None else _portable(error)
    errors = [found for found in comm.allgather(portable) if found is not None]
    if not errors:
        return
    raised: Any = errors[0] if error is None else error
    raised.known_to_all = True
    raise raised


def together[T](comm: MPI.Comm, call: Callable[..., T], *arguments: Any) -> T:
    """Call on every rank what may fail on a single rank only; collective.

    A user's code may do so.

    Raises:
        Exception: On all ranks, what failed on one.
    """
    result = None
    error = None
    try:
        result = call(*arguments)
    except Exception as reason:
        error = reason
    raise_together(comm, error)
    return cast("T", result)


def on_rank[T](comm: MPI.Comm, rank: int, call: Callable[..., T], *arguments: Any) -> T | None:
    """Call on one rank what may fail, and raise there and elsewhere; collective.

    Returns:
        What the call returns, None on the other ranks.

    Raises:
        Exception: On all ranks, what failed.
    """

    def call_there() -> T | None:
        return call(*arguments) if comm.rank == rank else None

    return together(comm, call_there)


def words_of(reason: Exception) -> str:
    """Return what an error that a file has caused tells a user.

    gmsh's errors are of no class of their own and say what is wrong. Errors of Python's
    classes say where a reader has stumbled.
    """
    if isinstance(reason, InputError) or type(reason) is Exception:
        return str(reason).strip().rstrip(".")
    if isinstance(reason, ModuleNotFoundError):
        return f"reading it needs {reason.name}: pip install 'erc-contact[pictures]' brings it"
    if isinstance(reason, OSError) and reason.strerror:
        return f"it cannot be opened ({reason.strerror})"
    if isinstance(reason, MemoryError):
        return "the memory is too small for what it declares; it is damaged, or too large"
    return "it is damaged, or of a form that is not read"


def _portable(error: BaseException) -> BaseException:
    """Return the error, or an error with its words if it cannot be sent to ranks."""
    try:
        copy = pickle.loads(pickle.dumps(error))
        return error if isinstance(copy, BaseException) else RuntimeError(repr(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
