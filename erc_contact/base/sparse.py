"""Sparse matrices of PETSc from places and values of their entries."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc


def sparse(
    height: int, width: int, rows: np.ndarray, columns: np.ndarray, values: list[np.ndarray]
) -> PETSc.Mat:
    """Make a sparse matrix of this rank; entries add up where they coincide."""
    matrix = PETSc.Mat().createAIJ((height, width), comm=PETSc.COMM_SELF)
    matrix.setPreallocationCOO(rows.astype(PETSc.IntType), columns.astype(PETSc.IntType))
    matrix.setValuesCOO(np.concatenate(values))
    return matrix


def sparse_like(like: PETSc.Mat, rows: np.ndarray, columns: np.ndarray) -> PETSc.Mat:
    """Make a matrix of the size of another one, with entries at the given places."""
    matrix = PETSc.Mat().create(comm=like.comm)
    matrix.setSizes(like.getSizes())
    matrix.setType("aij")
    matrix.setPreallocationCOO(rows.astype(PETSc.IntType), columns.astype(PETSc.IntType))
    return matrix


def times(matrix: PETSc.Mat, dense: np.ndarray) -> np.ndarray:
    """Return the product of a sparse matrix of this rank and a dense one (n, k)."""
    right = PETSc.Mat().createDense(
        dense.shape, array=np.asfortranarray(dense), comm=PETSc.COMM_SELF
    )
    right.assemble()
    product = matrix.matMult(right)
    result = product.getDenseArray().copy()
    product.destroy()
    right.destroy()
    return result


def diagonal(values: np.ndarray) -> PETSc.Mat:
    """Make a diagonal matrix of this rank."""
    place = np.arange(len(values))
    return sparse(len(values), len(values), place, place, [values])


def add_diagonal(matrix: PETSc.Mat, values: np.ndarray) -> None:
    """Add values to the diagonal of a matrix, in place.

    Args:
        matrix: The matrix; its pattern has the diagonal.
        values: Those of the rows of this rank.
    """
    diagonal = matrix.createVecRight()
    diagonal.array[:] = values
    matrix.setDiagonal(diagonal, addv=PETSc.InsertMode.ADD)
    diagonal.destroy()
