"""Run gmsh on rank 0, in a session that leaves a user's session as it was."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
from mpi4py import MPI

from namedmesh.base.exceptions import InputError, raise_together

SESSION = {"General.Terminal": 0, "Mesh.ElementOrder": 1, "Mesh.RecombineAll": 0}
"""gmsh's options during our session; a user's own session gets its options back."""
FIELD = {
    "Mesh.MeshSizeMin": 0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.Algorithm": 6,
    "Mesh.Algorithm3D": 1,
}
"""gmsh's options where a size field alone gives the sizes.

The algorithms are Frontal-Delaunay in 2D and Delaunay in 3D.
"""


def has_netgen(gmsh: Any) -> bool:
    """Tell whether gmsh was built with Netgen; a session must be open."""
    options = gmsh.option.getString("General.BuildOptions").split()
    return any(option.partition("[")[0] == "Netgen" for option in options)


def as_input_error(reason: Exception, subject: str) -> InputError:
    """Return an error of gmsh's, or of ours, as an :class:`InputError`."""
    if isinstance(reason, InputError):
        return reason
    return InputError(f"{subject} cannot be used: {reason}")


@contextmanager
def session(comm: MPI.Comm, build: Callable[[Any], None], subject: str) -> Iterator[Any]:
    """Open a silent gmsh session on rank 0 with a new model; collective.

    Afterwards a user's session is as it was.

    Args:
        comm: Communicator.
        build: Function that makes the model, called with the module gmsh on rank 0.
        subject: Subject of the message if it raises.

    Yields:
        ``gmsh.model`` on rank 0, None on other ranks.

    Raises:
        InputError: On all ranks, if gmsh cannot be loaded or started, or ``build``
            raises.
    """
    if comm.rank != 0:
        # It meets one of the calls below, which rank 0 makes.
        raise_together(comm, None)
        yield None
        return
    with ExitStack() as opened:
        gmsh = None
        error: Exception | None = None
        try:
            gmsh = opened.enter_context(new_model())
            build(gmsh)
        except Exception as reason:  # every rank must learn of it
            error = as_input_error(reason, subject)
        raise_together(comm, error)
        assert gmsh is not None
        yield gmsh.model


@contextmanager
def new_model() -> Iterator[Any]:
    """Open gmsh with our options and a new model on this rank.

    Afterwards a user's session is as it was; without one gmsh is closed.

    Yields:
        The module gmsh.

    Raises:
        InputError: If gmsh cannot be loaded or started.
    """
    otherwise = "or give cells= or a Domain."
    try:
        import gmsh  # noqa: PLC0415 - only rank 0 needs it
    except (ImportError, OSError) as reason:  # OSError: a shared library that gmsh's wheel expects
        raise InputError(f"gmsh cannot be loaded: {reason}. Install it, {otherwise}") from reason
    with ExitStack() as afterwards:
        try:
            if gmsh.isInitialized():
                afterwards.callback(gmsh.model.setCurrent, gmsh.model.getCurrent())
                for name in (*SESSION, *FIELD):
                    value = gmsh.option.getNumber(name)
                    afterwards.callback(gmsh.option.setNumber, name, value)
            else:
                gmsh.initialize(readConfigFiles=False, interruptible=False)
                afterwards.callback(gmsh.finalize)
            for name, value in SESSION.items():
                gmsh.option.setNumber(name, value)
            gmsh.model.add("namedmesh")
            afterwards.callback(gmsh.model.remove)
        except Exception as reason:  # gmsh's own errors are of no other class
            raise InputError(
                f"gmsh cannot be started: {reason}. Install another version of it, {otherwise}"
            ) from reason
        yield gmsh


def add_sizes(gmsh: Any, x: np.ndarray, sizes: np.ndarray) -> tuple[int, int]:
    """Add a field of sizes to gmsh's model, which are linear on simplices.

    Args:
        gmsh: The module.
        x: Corners of triangles or tetrahedra [length], shape (n, 3 or 4, 3).
        sizes: Sizes at the corners [length], shape (n, 3 or 4).

    Returns:
        The tags of gmsh's view and of its field.
    """
    view = gmsh.view.add("sizes")
    rows = np.hstack([x.transpose(0, 2, 1).reshape(len(x), -1), sizes])
    # Scalar values on triangles or on tetrahedra.
    kind = "ST" if sizes.shape[1] == 3 else "SS"
    gmsh.view.addListData(view, kind, len(rows), rows.ravel())
    field = gmsh.model.mesh.field.add("PostView")
    gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
    return view, field
