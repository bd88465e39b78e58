"""Values of nodes and cells that ranks have in common, and matrices of all ranks."""

from __future__ import annotations

import numpy as np
from dolfinx import fem, la
from petsc4py import PETSc

from erc_contact.model.space import Space


def sum_over_ranks(values: fem.Function) -> None:
    """Add up what all ranks have at common nodes, in place; collective."""
    values.x.scatter_reverse(la.InsertMode.add)
    values.x.scatter_forward()


def marked_by_any(space: Space, *marks: np.ndarray) -> list[np.ndarray]:
    """Return which nodes any rank marks; collective.

    Args:
        space: The mesh.
        marks: Nodes of this rank that it marks, at most d times, shape (nodes,).
    """
    shared = space.function()
    columns = shared.x.array.reshape(-1, space.d)
    for column, of_rank in zip(columns.T, marks, strict=False):
        column[:] = of_rank
    sum_over_ranks(shared)
    return [columns[:, i] > 0 for i in range(len(marks))]


def sums_of_cells(space: Space, values: np.ndarray) -> np.ndarray:
    """Add up the values that all ranks have for the owned cells; collective.

    Args:
        space: The mesh.
        values: Values of the cells of this rank, ghosts included, shape (cells,).

    Returns:
        The sums, shape (owned,).
    """
    if space.comm.size > 1:
        of_cells = space.domain.function("DG", 0)
        place = of_cells.function_space.dofmap.list[:, 0]
        of_cells.x.array[place] = values
        of_cells.x.scatter_reverse(la.InsertMode.add)
        values = of_cells.x.array[place]
    return values[: space.domain.owned_cells]


def product(
    space: Space, matrix: PETSc.Mat, u: fem.Function, *, transpose: bool = False
) -> fem.Function:
    """Return the product of a matrix of all ranks, or its transpose, and a Function."""
    x, y = matrix.createVecs()
    x.array[:] = u.x.array[: len(x.array_r)]
    (matrix.multTranspose if transpose else matrix.mult)(x, y)
    result = space.function()
    result.x.array[: len(y.array_r)] = y.array_r
    result.x.scatter_forward()
    x.destroy()
    y.destroy()
    return result


def matrix_of_ranks(
    space: Space, rows: np.ndarray, columns: np.ndarray, values: np.ndarray
) -> PETSc.Mat:
    """Make a sparse matrix for degrees of freedom; collective.

    Args:
        space: The mesh.
        rows: Global degrees of freedom of this rank, shape (n,).
        columns: Global degrees of freedom, shape (n,).
        values: The entries, which add up where they coincide, shape (n,).
    """
    index_map = space.V.dofmap.index_map
    size = (index_map.size_local * space.d, index_map.size_global * space.d)
    matrix = PETSc.Mat().create(comm=space.mesh.comm)
    matrix.setSizes((size, size), bsize=space.d)
    matrix.setType("aij")
    matrix.setPreallocationCOO(rows.astype(PETSc.IntType), columns.astype(PETSc.IntType))
    matrix.setValuesCOO(values)
    return matrix


def matrix_of_common_entries(
    space: Space,
    entries: tuple[np.ndarray, np.ndarray, np.ndarray],
    replaced: np.ndarray | None = None,
) -> PETSc.Mat:
    """Make a sparse matrix from entries that all ranks have; collective.

    Args:
        space: The mesh.
        entries: Global degrees of freedom of rows and of columns, and values.
        replaced: Degrees of freedom whose rows are not rows of the identity; None if no
            row is a row of the identity.
    """
    first, last = (number * space.d for number in space.V.dofmap.index_map.local_range)
    rows, columns, values = entries
    owned = (rows >= first) & (rows < last)
    rows, columns, values = rows[owned], columns[owned], values[owned]
    if replaced is not None:
        others = np.setdiff1d(np.arange(first, last), replaced)
        rows, columns = (np.concatenate([places, others]) for places in (rows, columns))
        values = np.concatenate([values, np.ones(len(others))])
    return matrix_of_ranks(space, rows, columns, values)


def marks_of_owners(space: Space, marks: np.ndarray) -> np.ndarray:
    """Return marks (nodes, d) as the owners of the nodes have them; collective."""
    of_ranks = space.function()
    of_ranks.x.array[:] = marks.ravel()
    of_ranks.x.scatter_forward()
    return of_ranks.x.array.reshape(-1, space.d) > 0.5
