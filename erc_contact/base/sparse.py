"""Sparse matrices from forms, or from places and values of their entries.

Matrices of all ranks are PETSc's, matrices of one rank are scipy's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import cpp, fem, la
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import coo_array, csr_array  # type: ignore[import-untyped]

from erc_contact.base.kernels import matrix_kernels


def assembled(form: fem.Form, bcs: Sequence[fem.DirichletBC], diagonal: float) -> la.MatrixCSR:
    """Assemble the square matrix of a form for displacements in blocks; collective.

    DOLFINx adds a block for two nodes to its own matrix as a whole. PETSc looks up each
    row of the block, which takes as long as to compute it.

    Args:
        form: The compiled form.
        bcs: Conditions; their rows and columns are zero but for the diagonal.
        diagonal: Entry on their diagonal.
    """
    blocks = fem.create_matrix(form)
    fem.assemble_matrix(blocks, form, bcs=bcs, diag=diagonal)
    blocks.scatter_reverse()
    return blocks


def pattern_of(forms: Sequence[fem.Form]) -> cpp.la.SparsityPattern:
    """Return the pattern of a matrix into which all of some forms are assembled."""
    pattern = fem.create_sparsity_pattern(forms[0])
    for form in forms[1:]:
        fem.build_sparsity_pattern(pattern, form)
    pattern.finalize()
    return pattern


def matrix_of(forms: Sequence[fem.Form]) -> PETSc.Mat:
    """Return a matrix into which all of some forms are assembled; collective."""
    return cpp.la.petsc.create_matrix(forms[0].mesh.comm, pattern_of(forms), None)


def as_entries(blocks: la.MatrixCSR, comm: MPI.Comm) -> PETSc.Mat:
    """Return a square matrix of blocks as a matrix of single entries; collective."""
    in_blocks = _as_blocks(blocks, comm)
    entries = in_blocks.convert("aij", PETSc.Mat())
    in_blocks.destroy()
    return entries


def for_products(blocks: la.MatrixCSR, comm: MPI.Comm) -> PETSc.Mat:
    """Return a symmetric matrix for products, and its diagonal; collective.

    On one rank it is :class:`_Half`. Ranks would send their parts of such a product
    besides, which takes as long: there PETSc multiplies its blocks.
    """
    if comm.size > 1:
        return _as_blocks(blocks, comm)
    half = _Half(blocks)
    matrix = PETSc.Mat().createPython((half.height, half.height), context=half, comm=comm)
    matrix.setUp()
    return matrix


def _as_blocks(blocks: la.MatrixCSR, comm: MPI.Comm) -> PETSc.Mat:
    """Return a square matrix of blocks as PETSc's, which does little but multiply it.

    Args:
        blocks: The matrix.
        comm: Communicator of its mesh: PETSc would never give back its copy of the
            communicator of an index map.
    """
    # Rows of other ranks come last; their entries have been sent there.
    index_map = blocks.index_map(0)
    height = index_map.size_local
    begin = blocks.indptr[: height + 1].astype(PETSc.IntType)
    count = begin[-1]
    columns = blocks.index_map(1).local_to_global(blocks.indices[:count])
    d = blocks.block_size[0]
    values = blocks.data[: count * d * d]
    size = (height * d, index_map.size_global * d)
    matrix = PETSc.Mat().createBAIJ(
        (size, size), d, csr=(begin, columns.astype(PETSc.IntType), values), comm=comm
    )
    matrix.assemble()
    return matrix


class _Half:
    """Multiply by a symmetric matrix of one rank, as PETSc asks a matrix of Python to.

    It keeps the blocks on and above the diagonal, half of the numbers to read. PETSc's
    product of as many numbers takes 2.2 to 2.6 times as long in 3D.

    Args:
        blocks: The matrix.

    Attributes:
        height: Number of its rows.
    """

    def __init__(self, blocks: la.MatrixCSR) -> None:
        d = blocks.block_size[0]
        count = len(blocks.indptr) - 1
        rows = np.repeat(np.arange(count, dtype=np.int32), np.diff(blocks.indptr))
        kept = blocks.indices >= rows
        values = blocks.data.reshape(-1, d, d)
        on_diagonal = values[blocks.indices == rows]
        self.height = count * d
        self._diagonal = np.diagonal(on_diagonal, axis1=1, axis2=2).ravel()
        start = np.searchsorted(rows[kept], np.arange(count + 1)).astype(np.int32)
        half = (start, blocks.indices[kept], values[kept])
        self._product = matrix_kernels(d).bound("half_product", count, *half)

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the matrix times x."""
        self._product(x.array_r, y.array)

    def getDiagonal(self, _: PETSc.Mat, diagonal: PETSc.Vec) -> None:
        """Set a vector to the diagonal."""
        diagonal.array[:] = self._diagonal


def local_matrix(
    shape: tuple[int, int], rows: np.ndarray, columns: np.ndarray, values: np.ndarray
) -> csr_array:
    """Make a sparse matrix of this rank; entries add up where they coincide."""
    return coo_array((values, (rows, columns)), shape).tocsr()


def sparse_like(like: PETSc.Mat, rows: np.ndarray, columns: np.ndarray) -> PETSc.Mat:
    """Make a matrix of the size of a given matrix, with entries at given places."""
    matrix = PETSc.Mat().create(comm=like.comm)
    matrix.setSizes(like.getSizes())
    matrix.setType("aij")
    matrix.setPreallocationCOO(rows.astype(PETSc.IntType), columns.astype(PETSc.IntType))
    return matrix


def summed(parts: Sequence[PETSc.Mat], total: PETSc.Mat | None) -> PETSc.Mat:
    """Add matrices; collective.

    Args:
        parts: The matrices.
        total: Their sum of an earlier call, whose places they have; None at first.

    Returns:
        The sum, at first a new matrix, later the given one.
    """
    structure = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
    if total is None:
        structure = PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
        total = parts[0].duplicate()
    total.zeroEntries()
    for part in parts:
        total.axpy(1.0, part, structure)
    return total


class Places:
    """Make sparse matrices of this rank with entries at the same places.

    Args:
        rows: Row of each entry, shape (n,).
        columns: Its column.
        shape: Numbers of rows and columns.

    Example:
        >>> places = Places(np.array([0, 1, 1]), np.array([0, 0, 0]), (2, 1))
        >>> places.of(np.array([1.0, 2.0, 3.0])).toarray()
        [[1.0], [5.0]]
    """

    def __init__(self, rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int]) -> None:
        height, width = shape
        # PETSc's rows have 32 bits, which the number of a place may exceed.
        places = rows.astype(np.int64) * width + columns
        numbers, self._entry = np.unique(places, return_inverse=True)
        begin = np.searchsorted(numbers, width * np.arange(height + 1))
        self._matrix = csr_array((np.zeros(len(numbers)), numbers % width, begin), shape=shape)

    def of(self, values: np.ndarray) -> csr_array:
        """Return the matrix of values, which add up where places coincide.

        The next call writes over it.
        """
        self._matrix.data = np.bincount(self._entry, values, self._matrix.nnz)
        return self._matrix
