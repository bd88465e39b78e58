"""Assembly of the contact equations on all ranks for the condensed problem on rank 0.

Each rank assembles the terms of its own facets, for each reader of the forms in a
vector and in matrices of its own. Rank 0 adds them up, and takes the forces on what
contacts read to forces on the unknowns. Symbols: A, u_A and z as in
:mod:`erc_contact.newton.condensed`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem, la

from erc_contact.base.sparse import pattern_of
from erc_contact.newton.contact_nodes import Reading
from erc_contact.newton.forms import ContactForms, Counts
from namedmesh.base.ranks import gathered


class Assembly:
    """Assemble the equations of a method in the numbering of the condensed problem.

    All methods are collective. What they return is on rank 0, None on other ranks.

    Args:
        forms: The equations of the method.
        readings: What the forces of each reader are.
        columns: For each field that the forms are derived by, the place in z of each
            degree of freedom of this rank, -1 where it has none.
        size: Number of unknowns u_A.
        path: The central path of interior point steps, see :mod:`.interior_point`; None
            where there is none.

    Attributes:
        fields: For each field its degrees of freedom that are in z, and their places.
        positions: Rows in u_A and columns in z of the entries of the tangent, on rank
            0; None elsewhere.
    """

    def __init__(
        self,
        forms: ContactForms,
        readings: list[Reading],
        columns: list[np.ndarray],
        size: int,
        path: Any,
    ) -> None:
        self._forms = forms
        self._path = path
        self._comm = forms.model.space.comm
        self._size = size
        self._residual = forms.model.space.function()
        self.fields: list[tuple[np.ndarray, np.ndarray]] = []
        for column in columns:
            dofs = np.flatnonzero(column >= 0)
            self.fields.append((dofs, column[dofs]))

        self._rows = [np.flatnonzero(reading.row_of >= 0) for reading in readings]
        self._matrices = []
        self._picks: list[np.ndarray] = []
        row_parts = []
        entry_parts = []
        for number, (reader, reading) in enumerate(zip(forms.readers, readings, strict=True)):
            row_parts.append(_of_reader(number, reading.row_of[self._rows[number]]))
            for column, tangents in zip(columns, reader.tangents, strict=True):
                if not tangents:
                    continue
                matrix = la.matrix_csr(pattern_of(tangents))
                row, col = _entries(matrix)
                row, col = reading.row_of[row], column[col]
                pick = np.flatnonzero((row >= 0) & (col >= 0))
                self._matrices.append((matrix, tangents))
                self._picks.append(pick)
                entry_parts.append(_of_reader(number, row[pick], col[pick]))
        rows = gathered(self._comm, np.concatenate(row_parts, axis=1))
        entries = gathered(self._comm, np.concatenate(entry_parts, axis=1))
        self.positions: tuple[np.ndarray, np.ndarray] | None = None
        if rows is not None and entries is not None:
            self._of_rows = _Spread(readings, np.concatenate(rows, axis=1))
            self._of_entries = _Spread(readings, np.concatenate(entries, axis=1))
            self.positions = self._of_entries.rows, self._of_entries.columns

    def set_fields(self, z: np.ndarray) -> None:
        """Set the fields that the forms read to z."""
        for field, (dofs, places) in zip(self._forms.fields, self.fields, strict=True):
            field.x.array[dofs] = z[places]

    def residual(self) -> np.ndarray | None:
        """Assemble the equations at the fields [force], shape (A,)."""
        vector = self._residual.x.array
        values = []
        for reader, rows in zip(self._forms.readers, self._rows, strict=True):
            vector[:] = 0.0
            reader.assemble(vector)
            values.append(vector[rows])
        parts = gathered(self._comm, np.concatenate(values))
        if parts is None:
            return None
        spread = self._of_rows
        return np.bincount(spread.rows, spread.values(np.concatenate(parts)), self._size)

    def tangent(self) -> np.ndarray | None:
        """Assemble the entries of the tangent, in the order of `positions`."""
        values = []
        for (matrix, tangents), pick in zip(self._matrices, self._picks, strict=True):
            matrix.set_value(0.0)
            for tangent in tangents:
                fem.assemble_matrix(matrix, tangent)
            values.append(matrix.data[pick])
        parts = gathered(self._comm, np.concatenate(values))
        return None if parts is None else self._of_entries.values(np.concatenate(parts))

    def status(self) -> np.ndarray | None:
        """Return the status open (0), slip (1) or stick (2) at points of all facets."""
        parts = gathered(self._comm, self._forms.status())
        return None if parts is None else np.concatenate(parts)

    def counts(self) -> tuple[Counts, ...]:
        """Count the open, slipping and sticking points of each contact."""
        return self._forms.counts()

    def along_path(self, name: str) -> Any:
        """Call a method of the central path of interior point steps by its name."""
        return getattr(self._path, name)()

    def set_shares(self, friction: float, gap: float) -> None:
        """Set the shares of friction and gaps [-]."""
        self._forms.set_shares(friction, gap)


class _Spread:
    """Take forces on what contacts read to the unknowns that it depends on.

    Args:
        readings: What the forces of each reader are, with their matrices.
        places: Number of the reader, row, and maybe column of each entry, shape (2, n)
            or (3, n).

    Attributes:
        rows: Rows in u_A, shape (m,).
        columns: The columns given, or the rows.
    """

    def __init__(self, readings: list[Reading], places: np.ndarray) -> None:
        rows, factors, sources = [], [], []
        for number, reading in enumerate(readings):
            assert reading.matrix is not None
            begin, unknowns = reading.matrix.indptr, reading.matrix.indices
            of_reader = np.flatnonzero(places[0] == number)
            row = places[1, of_reader]
            count = np.diff(begin)[row]
            first = np.repeat(begin[row] - (np.cumsum(count) - count), count)
            entry = first + np.arange(len(first))
            rows.append(unknowns[entry])
            factors.append(reading.matrix.data[entry])
            sources.append(np.repeat(of_reader, count))
        self.rows = np.concatenate(rows)
        self._factors = np.concatenate(factors)
        self._sources = np.concatenate(sources)
        self.columns = places[-1, self._sources]

    def values(self, entries: np.ndarray) -> np.ndarray:
        """Return the values at the rows of given entries, shape (m,)."""
        return self._factors * entries[self._sources]


def _of_reader(number: int, *places: np.ndarray) -> np.ndarray:
    """Return places of entries with the number of their reader, shape (k, n)."""
    return np.stack([np.full(len(places[0]), number), *places])


def _entries(matrix: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return local rows and columns of the entries of a block matrix."""
    b = matrix.block_size[0]
    row = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
    col = matrix.indices[: len(row)]
    rows = row[:, None, None] * b + np.arange(b)[:, None] + np.zeros((1, b), int)
    cols = col[:, None, None] * b + np.arange(b) + np.zeros((b, 1), int)
    return rows.ravel(), cols.ravel()
