"""Memory of PETSc's objects that several ranks have dropped.

Ranks drop an object at different times, so petsc4py cannot free it then: it waits for a
call that all ranks make, once for each communicator. Each mesh has a communicator of
its own. Without these calls every factor and every hierarchy would stay for ever, and
after some hundred meshes MPI would have no communicator left.
"""

from __future__ import annotations

import weakref

from mpi4py import MPI
from petsc4py import PETSc

_tracked: list[tuple[weakref.ref, PETSc.IS]] = []
"""Users of a communicator, and for each an object of PETSc that keeps it valid."""


def track_communicator(user: object, comm: MPI.Comm) -> None:
    """Remember a communicator, so that :func:`free_dropped` cleans it; collective.

    Args:
        user: An object that lives as long as PETSc's objects on this communicator are
            in use, a domain. It is not kept alive.
        comm: Its communicator. One with a single rank needs none of this.
    """
    if comm.size == 1:
        return
    for reference, _ in _tracked:
        if reference() is user:
            return
    anchor = PETSc.IS().createGeneral([], comm=comm)
    _tracked.append((weakref.ref(user), anchor))


def free_dropped(comm: MPI.Comm) -> None:
    """Free PETSc's objects that all ranks have dropped, of any mesh; collective.

    Args:
        comm: Communicator of a run. The communicators of all its meshes have its ranks.
    """
    for entry in list(_tracked):
        user, anchor = entry
        if MPI.Comm.Compare(anchor.comm.tompi4py(), comm) not in (MPI.IDENT, MPI.CONGRUENT):
            continue
        gone = comm.allreduce(user() is None, MPI.LAND)
        PETSc.garbage_cleanup(anchor.comm)
        if gone:
            # Nothing of this communicator is left to clean.
            anchor.destroy()
            _tracked.remove(entry)
