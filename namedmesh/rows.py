"""Work with tables by rows: number them by their entries, look values up, pad them.

It needs numpy alone, as readers of files do in processes of their own.
"""

from __future__ import annotations

import numpy as np


def row_numbers(rows: np.ndarray, *others: np.ndarray) -> list[np.ndarray]:
    """Number rows so that rows with the same entries, in any order, have one number.

    Args:
        rows: Whole numbers, shape (n, k).
        others: More such tables, shape (., k) each.

    Returns:
        The numbers of the rows of each table.
    """
    tables = [rows, *others]
    every = np.sort(np.concatenate(tables), axis=1).astype(np.int64)
    size = int(every.max(initial=0)) + 1
    # One number for each row is sorted faster than several columns. As many columns as
    # 64 bits hold are put into it before they are numbered anew.
    keys = every[:, 0]
    greatest = size
    for column in every.T[1:]:
        if greatest * size >= np.iinfo(np.int64).max:
            _, keys = np.unique(keys, return_inverse=True)
            greatest = len(keys)
        keys = keys * size + column
        greatest *= size
    _, numbers = np.unique(keys, return_inverse=True)
    return np.split(numbers, np.cumsum([len(table) for table in tables])[:-1])


def places_of(known: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return where numbers stand among known numbers, -1 for numbers that do not.

    Args:
        known: Different numbers, in any order, shape (n,).
        wanted: Numbers of any shape.

    Returns:
        Places, in the shape of ``wanted``.
    """
    if not len(known):
        return np.full(np.shape(wanted), -1)
    order = np.argsort(known, kind="stable")
    ordered = known[order]
    at = np.minimum(np.searchsorted(ordered, wanted), len(known) - 1)
    return np.where(ordered[at] == wanted, order[at], -1)


def rows_within(known: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Return where known numbers lie in ranges, in order.

    Args:
        known: Numbers, shape (n,).
        ranges: First and last number of each range, shape (m, 2). They may be much
            longer than there are numbers.
    """
    order = np.argsort(known, kind="stable")
    ordered = known[order]
    begins = np.searchsorted(ordered, ranges[:, 0], side="left")
    ends = np.searchsorted(ordered, ranges[:, 1], side="right")
    # A range of k numbers adds 1 where it begins and takes it away where it ends.
    depth = np.bincount(begins, minlength=len(known) + 1)
    depth = depth - np.bincount(np.maximum(begins, ends), minlength=len(known) + 1)
    return np.sort(order[np.cumsum(depth)[:-1] > 0])


def look_up(
    rows: np.ndarray, values: np.ndarray, wanted: np.ndarray, missing: int = -1
) -> np.ndarray:
    """Return the values of the rows that have the entries of wanted rows, in any order.

    Args:
        rows: Whole numbers, shape (n, k).
        values: The whole number that belongs to each row, shape (n,).
        wanted: Rows whose values are wanted, shape (m, k).
        missing: Stands for the value where no row has the entries.

    Returns:
        Shape (m,).
    """
    # The numbers are as few as there are rows, so that a table of values is small.
    numbers, of_wanted = row_numbers(rows, wanted)
    count = 1 + max(numbers.max(initial=-1), of_wanted.max(initial=-1))
    table = np.full(count, missing)
    table[numbers] = values
    return table[of_wanted]


def equal_rows(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the pairs of rows of a table that are equal; k equal rows are k - 1 pairs.

    Returns:
        The earlier row of each pair and the later one, shape (m,) each.
    """
    # The sort is stable: of equal rows the earlier one comes first.
    order = np.lexsort(table.T)
    is_equal = np.all(table[order[1:]] == table[order[:-1]], axis=1)
    return order[:-1][is_equal], order[1:][is_equal]


def in_space(x: np.ndarray) -> np.ndarray:
    """Return points or vectors (n, d) with three components, shape (n, 3).

    gmsh, DOLFINx and VTK want them so.
    """
    return np.pad(x, ((0, 0), (0, 3 - x.shape[1])))


def count_up(counts: np.ndarray) -> np.ndarray:
    """Return 0, 1, ... up to each count, one after another, shape (sum of counts,)."""
    return np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
