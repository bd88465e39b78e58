"""Direct solvers: MUMPS' factors of symmetric matrices, and their Schur complements.

MUMPS has an absolute threshold: a Schur complement of a matrix whose entries are below
about 1e-16 is wrong by a tenth. So each matrix K is factorised as D K D, with powers of
two on the diagonal of D that bring the diagonal of D K D between 1/2 and 2. No digit
changes.

petsc4py has no names for Schur complements and for the symbolic analysis alone, so
PETSc's own functions are called through ctypes.
"""

from __future__ import annotations

import ctypes
from contextlib import nullcontext
from typing import Any

import numpy as np
from petsc4py import PETSc

from erc_contact.base.exceptions import InputError
from erc_contact.base.runtime.sigterm import sigterm_blocked

WORKSPACES = (80, 1000)
"""Workspace of MUMPS beyond its estimate, in a first and a second attempt [%].

Its default of 20 was too small for 322 tetrahedra on three ranks. Where a Schur
complement leaves only a few equations to eliminate, as of a body of one row of 29 cells
on its contact, MUMPS estimates too little.
"""
TOO_LITTLE_WORKSPACE = (-8, -9, -14)
"""MUMPS' codes of workspaces that are too small, INFOG(1)."""
AMD, AMF = 0, 2
"""MUMPS' numbers of the orderings by approximate minimum degree and minimum fill.

MUMPS would take METIS where it can, and METIS takes SIGTERM for an error of its own: it
jumps out of the signal's handler and leaves a broken heap. With these no signal does
harm. With a Schur complement MUMPS has AMD and METIS only. AMD is faster by 10 to 50%
in the plane, with 20% more memory; in 3D a contact solve takes the same time up to
13 000 tetrahedra, and 1.3 times as long at 37 000, where multigrid is faster than both.
Plain factors by AMF take 0.9 of the time of AMD in the plane on two ranks, and 0.6 at
37 000 tetrahedra.
"""
COMPRESSED_FROM = 100_000
"""Number of equations from which on blocks of the factor are compressed (BLR) [-].

What is left out is below round-off, :data:`DROPPED` of the diagonal, so that the
solution is the same. A factor of 1 011 042 equations of a rectangle then takes
4.3 s instead of 8.3 s and 84% of the memory, one of 406 802 takes 1.5 s instead of 2.3
s. Half of this comes from other kernels: MUMPS' usual ones call gemmt, which OpenBLAS
does column by column. MUMPS groups the equations by METIS here, so SIGTERM is held
back; where it cannot be, nothing is compressed.
"""
DROPPED = 1e-16
"""What compression may leave out of a matrix whose diagonal is near 1 [-]."""
NOT_FACTORISED = (
    "The elastic stiffness cannot be factorised: its numbers are too far apart for double "
    "precision. Choose units in which moduli and lengths are nearer to 1; look for degenerate "
    "cells."
)
NOT_DEFINITE = 81
"""PETSc's code of a matrix without a Cholesky factor."""
ZERO_PIVOT = 71
"""PETSc's code of a matrix that cannot be factorised, PETSC_ERR_MAT_LU_ZRPVT."""
LIBRARY = 76
"""PETSc's code of a failure in a library, such as LAPACK."""


class Factor:
    """Solve symmetric equations by a factor of MUMPS; members are collective.

    Args:
        ksp: Solves ``D K D y = c`` by the factor.
        scaling: The diagonal of D.
        schur_on: Rows on which MUMPS has made a Schur complement; None without any.
    """

    def __init__(self, ksp: PETSc.KSP, scaling: PETSc.Vec, schur_on: np.ndarray | None) -> None:
        self._ksp = ksp
        self._scaling = scaling
        self._schur_on = schur_on
        self._scaled = scaling.duplicate()

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve ``K x = b``.

        Raises:
            InputError: If the Schur complement cannot be factorised.
        """
        self._scaled.pointwiseMult(self._scaling, b)
        try:
            self._ksp.solve(self._scaled, x)
        except PETSc.Error as failure:
            if failure.ierr == NOT_DEFINITE:
                raise InputError(NOT_FACTORISED) from failure
            raise
        x.pointwiseMult(self._scaling, x)

    def schur_complement(self) -> np.ndarray:
        """Return the Schur complement that MUMPS made with a factor on one rank."""
        assert self._schur_on is not None
        scaling = self._scaling.array_r[self._schur_on]
        schur = _schur_complement(self.mumps, len(scaling))
        # A large matrix is written over: new memory takes longer than the division.
        schur /= scaling[:, None]
        schur /= scaling
        return schur

    def interior_only(self) -> None:
        """Set the factor to solve ``K_II u_I = b_I``.

        I are the rows that the Schur complement is not on; elsewhere u is zero.
        """
        self.mumps.setMumpsIcntl(26, 0)

    @property
    def mumps(self) -> PETSc.Mat:
        """Return the factor with its settings."""
        return self._ksp.getPC().getFactorMatrix()

    def destroy(self) -> None:
        """Free PETSc's objects."""
        for made in (self._ksp, self._scaling, self._scaled):
            made.destroy()


def factorise(matrix: PETSc.Mat, schur_on: np.ndarray | None = None) -> Factor:
    """Factorise a symmetric matrix with MUMPS; collective.

    Args:
        matrix: Assembled.
        schur_on: Rows on which MUMPS makes a Schur complement, of a matrix on one rank;
            None for a plain factor.

    Raises:
        InputError: If the matrix cannot be factorised.
        MemoryError: If there is too little memory for it.
    """
    scaling = _scaling(matrix)
    matrix.diagonalScale(scaling, scaling)
    for workspace in WORKSPACES:
        ksp = _with_workspace(matrix, schur_on, workspace)
        factor = ksp.getPC().getFactorMatrix()
        if factor.getMumpsInfog(1) not in TOO_LITTLE_WORKSPACE:
            break
    # The factor knows nothing of the matrix any more, which is the caller's.
    ksp.getPC().setReusePreconditioner(True)
    inverse = scaling.duplicate()
    inverse.array[:] = 1.0 / scaling.array_r
    matrix.diagonalScale(inverse, inverse)
    inverse.destroy()
    reasons = PETSc.PC.FailedReason
    failed = ksp.getPC().getFailedReason()
    if failed == reasons.FACTOR_OUTMEMORY:
        raise MemoryError(f"the factor of {matrix.getSize()[0]} elastic equations")
    if failed != reasons.NOERROR:
        raise InputError(NOT_FACTORISED)
    return Factor(ksp, scaling, schur_on)


def operations(matrix: PETSc.Mat) -> float:
    """Predict the operations of a Cholesky factor of a matrix; collective.

    MUMPS' symbolic analysis tells them from the places of the entries alone. It takes a
    tenth of the time of a small factor and a hundredth of the time of a large one.
    """
    pc = _cholesky(matrix)
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(7, AMF)
    _call("MatCholeskyFactorSymbolic", factor.handle, matrix.handle, None, None)
    count = factor.getMumpsRinfog(1)
    pc.destroy()
    return float(count)


def _cholesky(matrix: PETSc.Mat) -> PETSc.PC:
    """Return a preconditioner by MUMPS' Cholesky factor, which is not yet made."""
    pc = PETSc.PC().create(matrix.comm)
    pc.setOperators(matrix)
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    return pc


def _scaling(matrix: PETSc.Mat) -> PETSc.Vec:
    """Return the powers of two that bring the diagonal of a matrix near 1.

    They are 1 where it has no positive entry, and MUMPS finds no factor.
    """
    scaling = matrix.getDiagonal()
    _, exponents = np.frexp(scaling.array_r)
    powers = np.ldexp(1.0, -(exponents // 2))
    scaling.array[:] = np.where(scaling.array_r > 0, powers, 1.0)
    return scaling


def _with_workspace(matrix: PETSc.Mat, schur_on: np.ndarray | None, workspace: int) -> PETSc.KSP:
    """Try to factorise as :func:`factorise` does, with a workspace [%]; collective."""
    comm = matrix.comm.tompi4py()
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    pc = _cholesky(matrix)
    ksp.setPC(pc)
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, workspace)
    factor.setMumpsIcntl(7, AMF if schur_on is None else AMD)
    if schur_on is not None:
        indices = PETSc.IS().createGeneral(schur_on.astype(PETSc.IntType), comm=comm)
        try:
            _call("MatFactorSetSchurIS", factor.handle, indices.handle)
        except RuntimeError:
            raise MemoryError(f"the dense stiffness of {len(schur_on)} unknowns") from None
        indices.destroy()

    # Compression calls METIS, which no signal may interrupt.
    large = comm.size == 1 and matrix.getSize()[0] >= COMPRESSED_FROM
    with sigterm_blocked() if large else nullcontext(False) as blocked:
        if blocked:
            factor.setMumpsIcntl(35, 2)  # block low-rank, in solves, too
            # Blocks are compressed after they have served, so no error is amplified.
            factor.setMumpsIcntl(36, 1)
            factor.setMumpsCntl(7, DROPPED)
        ksp.setUp()
    return ksp


_LIBRARY = ctypes.CDLL(PETSc.__file__)
"""PETSc itself: petsc4py has no names for Schur complements and symbolic factors."""
_HANDLE, _ADDRESS, _ENUM = ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int
"""C's types of a PETSc object, of the address of a result, and of an enumeration."""
_ARGUMENTS = {
    "MatCholeskyFactorSymbolic": (_HANDLE, _HANDLE, _HANDLE, _HANDLE),
    "MatFactorSetSchurIS": (_HANDLE, _HANDLE),
    "MatFactorGetSchurComplement": (_HANDLE, _ADDRESS, _ADDRESS),
    "MatFactorRestoreSchurComplement": (_HANDLE, _ADDRESS, _ENUM),
    "MatDenseGetArrayRead": (_HANDLE, _ADDRESS),
    "MatDenseRestoreArrayRead": (_HANDLE, _ADDRESS),
}
"""PETSc's functions that are called here -> C's types of their arguments.

Each returns an error code, an int.
"""


def _call(name: str, *arguments: Any) -> None:
    """Call a function of PETSc.

    Raises:
        RuntimeError: If it fails.
    """
    function = getattr(_LIBRARY, name)
    function.argtypes = _ARGUMENTS[name]
    function.restype = ctypes.c_int
    if function(*arguments) != 0:
        raise RuntimeError(f"PETSc: {name} failed.")


def _schur_complement(factor: PETSc.Mat, size: int) -> np.ndarray:
    """Return the Schur complement of a factor of MUMPS, shape (size, size)."""
    schur, status = _HANDLE(), _ENUM()
    data = ctypes.POINTER(ctypes.c_double)()
    handle = factor.handle
    _call("MatFactorGetSchurComplement", handle, ctypes.addressof(schur), ctypes.addressof(status))
    _call("MatDenseGetArrayRead", schur, ctypes.addressof(data))
    # Of MUMPS' array only the upper triangle is the Schur complement.
    values = np.ctypeslib.as_array(data, (size, size))
    symmetric = np.where(np.tri(size, k=-1, dtype=bool), values.T, values)
    _call("MatDenseRestoreArrayRead", schur, ctypes.addressof(data))
    _call("MatFactorRestoreSchurComplement", handle, ctypes.addressof(schur), status)
    return symmetric


def dense_factor(values: np.ndarray, kind: str) -> PETSc.KSP:
    """Factorise a dense matrix of this rank.

    Args:
        values: The matrix.
        kind: "cholesky" for a positive definite one, whose factor is made here, or
            "lu", made when it is needed.

    Returns:
        A solver with the factor.

    Raises:
        InputError: If the matrix is not positive definite.
    """
    matrix = PETSc.Mat().createDense(
        values.shape, array=np.asfortranarray(values), comm=PETSc.COMM_SELF
    )
    matrix.setOption(PETSc.Mat.Option.SPD, kind == "cholesky")
    matrix.assemble()
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    ksp.getPC().setType(kind)
    try:
        if kind == "cholesky":
            ksp.setUp()
    except PETSc.Error as failure:
        if failure.ierr == NOT_DEFINITE:
            raise InputError(NOT_FACTORISED) from failure
        raise
    return ksp


def dense_solve(factor: PETSc.KSP, b: np.ndarray) -> np.ndarray:
    """Solve dense equations for a right side (n,) or several (n, m)."""
    if b.size == 0:
        return np.zeros_like(b)
    right = PETSc.Mat().createDense(
        (len(b), b.size // len(b)), array=np.asfortranarray(b), comm=PETSc.COMM_SELF
    )
    right.assemble()
    x = right.duplicate()
    factor.matSolve(right, x)
    return x.getDenseArray().reshape(b.shape, order="F").copy()
