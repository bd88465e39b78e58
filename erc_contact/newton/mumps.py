"""Direct solvers: MUMPS' factors of symmetric matrices, and the Schur complements that it makes with them.

petsc4py has no names for Schur complements, so PETSc's own functions are called through ctypes.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from petsc4py import PETSc

from erc_contact.base.exceptions import InputError

WORKSPACE = 80
"""Workspace of MUMPS beyond its estimate [%]; its default of 20 was too small for 322 tetrahedra on three ranks."""
AMD, AMF = 0, 2
"""MUMPS' numbers of the orderings by approximate minimum degree and minimum fill.

MUMPS would take METIS where it can, and METIS takes SIGTERM for an error of its own: it jumps out of the signal's
handler and leaves a broken heap. With these no signal does harm. With a Schur complement MUMPS has AMD and METIS only.
AMD is faster by 10 to 50% in the plane, with 20% more memory; in space a contact solve takes the same time up to 13 000
tetrahedra, and 1.3 times as long at 37 000, where multigrid is faster than both. Plain factors by AMF take 0.9 of the
time of AMD in the plane on two ranks, and 0.6 at 37 000 tetrahedra.
"""


def factorised(matrix: PETSc.Mat, schur_on: np.ndarray | None = None) -> PETSc.KSP:
    """A solver with MUMPS' factor of a symmetric matrix; collective.

    Args:
        matrix: Assembled.
        schur_on: Global degrees of freedom on which MUMPS makes a Schur complement, None for a plain factor.

    Raises:
        InputError: If the matrix cannot be factorised.
        MemoryError: If there is too little memory for it.
    """
    comm = matrix.comm.tompi4py()
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    pc = ksp.getPC()
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    pc.getFactorMatrix().setMumpsIcntl(14, WORKSPACE)
    pc.getFactorMatrix().setMumpsIcntl(7, AMF if schur_on is None else AMD)
    if schur_on is not None:
        mine = schur_on if comm.rank == 0 else schur_on[:0]
        indices = PETSc.IS().createGeneral(mine.astype(PETSc.IntType), comm=comm)
        _call("MatFactorSetSchurIS", pc.getFactorMatrix().handle, indices.handle)
        indices.destroy()
    ksp.setUp()
    reasons, failed = PETSc.PC.FailedReason, pc.getFailedReason()
    if failed == reasons.FACTOR_OUTMEMORY:
        raise MemoryError(f"the factor of {matrix.getSize()[0]} elastic equations")
    if failed != reasons.NOERROR:
        raise InputError(
            "The elastic stiffness cannot be factorised: its numbers are too far apart for double precision. "
            "Choose units in which moduli and lengths are nearer to 1; look for degenerate cells."
        )
    return ksp


_LIBRARY = ctypes.CDLL(PETSc.__file__)
"""PETSc itself: petsc4py has no names for its Schur complements."""


def _call(name: str, *arguments: Any) -> None:
    function = getattr(_LIBRARY, name)
    function.argtypes = [ctypes.c_void_p] * len(arguments)
    if function(*arguments) != 0:
        raise RuntimeError(f"PETSc: {name} failed.")


def schur_complement(ksp: PETSc.KSP, size: int) -> np.ndarray:
    """The Schur complement that MUMPS made with a factor, on rank 0.

    MUMPS gives one triangle of it, on several ranks the other one than on one, with stray entries beside it.
    """
    schur, status = ctypes.c_void_p(), ctypes.c_int()
    data = ctypes.POINTER(ctypes.c_double)()
    factor = ksp.getPC().getFactorMatrix().handle
    _call("MatFactorGetSchurComplement", factor, ctypes.addressof(schur), ctypes.addressof(status))
    _call("MatDenseGetArrayRead", schur.value, ctypes.addressof(data))
    values = np.ctypeslib.as_array(data, (size, size)).copy()
    _call("MatDenseRestoreArrayRead", schur.value, ctypes.addressof(data))
    _call("MatFactorRestoreSchurComplement", factor, ctypes.addressof(schur), status.value)
    triangle = np.triu(values) if ksp.comm.size == 1 else np.tril(values)
    return triangle + triangle.T - np.diag(values.diagonal())
