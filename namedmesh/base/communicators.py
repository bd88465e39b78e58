"""Communicators that outlive the meshes whose ranks they have.

An object that all ranks reduce, as in ``comm.allreduce(1.0)``, makes mpi4py attach a
lock to the communicator. DOLFINx frees the communicator of a mesh together with the
mesh. Where this happens while Python raises an exception, mpi4py leaves a lock of its
own closed, and the process waits for it for ever. A mesh made inside a call with a
misspelled argument is dropped just so. Here the ranks have one communicator, which is
not freed.
"""

from __future__ import annotations

from mpi4py import MPI

_lasting: list[MPI.Comm] = []
"""The communicators, one for each group of ranks that had a mesh."""


def lasting(comm: MPI.Comm) -> MPI.Comm:
    """Return the lasting communicator of the ranks of a communicator; collective.

    It is for objects that mpi4py sends. All ranks of ``comm`` have it, in their order.
    """
    for known in _lasting:
        if MPI.Comm.Compare(known, comm) in (MPI.IDENT, MPI.CONGRUENT):
            return known
    new = comm.Dup()
    _lasting.append(new)
    return new
