"""Memory of PETSc's objects that several ranks share, and that nobody uses any more.

Ranks drop an object at different times, so petsc4py cannot free it then: it waits for a
call that all ranks make, once for each communicator. Each mesh has a communicator of
its own. Without these calls every factor and every hierarchy would stay for ever, and
after some hundred meshes MPI would have no communicator left.
"""

from __future__ import annotations

import weakref

from mpi4py import MPI
from petsc4py import PETSc

_owners: list[tuple[weakref.ref, PETSc.IS]] = []
"""What may own PETSc's objects, and an object that keeps their communicator valid."""


def register_owner(owner: object, comm: MPI.Comm) -> None:
    """Register an owner, so that :func:`free_dropped` frees what was made for it; collective.

    Args:
        owner: Whatever lives as long as these objects are in use, a domain. It is not
            kept alive.
        comm: Its communicator. One with a single rank needs none of this.
    """
    if comm.size > 1 and all(known() is not owner for known, _ in _owners):
        _owners.append((weakref.ref(owner), PETSc.IS().createGeneral([], comm=comm)))


def free_dropped(comm: MPI.Comm) -> None:
    """Free PETSc's objects that all ranks of a communicator have dropped, whatever mesh they are of; collective."""
    for entry in list(_owners):
        owner, anchor = entry
        if MPI.Comm.Compare(anchor.comm.tompi4py(), comm) not in (MPI.IDENT, MPI.CONGRUENT):
            continue
        gone = comm.allreduce(owner() is None, MPI.LAND)
        PETSc.garbage_cleanup(anchor.comm)
        if gone:
            anchor.destroy()
            _owners.remove(entry)
