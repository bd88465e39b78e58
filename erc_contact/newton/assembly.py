"""Assembly of the contact equations on all ranks for the condensed problem on rank 0.

Each rank assembles the terms of its own facets, and rank 0 adds them up. Symbols: u_A
and z as in :mod:`erc_contact.newton.condensed`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem

from erc_contact.base.ranks import gathered
from erc_contact.newton.forms import ContactForms


class Assembly:
    """Assemble the equations of a method in the numbering of the condensed problem.

    All methods are collective. What they return is on rank 0, None on other ranks.

    Args:
        forms: The equations of the method.
        columns: For each field that the forms read, the displacement and then the
            multipliers, the place in z of each degree of freedom of this rank, -1 where
            it has none.
        size: Number of unknowns u_A, which are the first ones of z.

    Attributes:
        readers: For each field its degrees of freedom that are in z, and their places.
        positions: Rows in u_A and columns in z of the entries of the tangent, on rank
            0; None elsewhere.
    """

    def __init__(self, forms: ContactForms, columns: list[np.ndarray], size: int) -> None:
        self._forms = forms
        self._comm = forms.model.comm
        self._size = size
        self._residual = forms.model.function()
        self._matrices = [fem.create_matrix(form) for form in forms.tangents]

        self.readers: list[tuple[np.ndarray, np.ndarray]] = []
        for column in columns:
            dofs = np.flatnonzero(column >= 0)
            self.readers.append((dofs, column[dofs]))

        # The equations of degrees of freedom that are not in A are not needed: the
        # lift of u_A fulfils them.
        row_of = np.where(columns[0] < size, columns[0], -1)
        self._rows = np.flatnonzero(row_of >= 0)
        all_rows = gathered(self._comm, row_of[self._rows])
        self._all_rows = np.zeros(0, dtype=np.int64)
        if all_rows is not None:
            self._all_rows = np.concatenate(all_rows)

        self._picks: list[np.ndarray] = []
        rows = []
        cols = []
        for matrix, column in zip(self._matrices, columns, strict=True):
            row, col = _entries(matrix)
            row = row_of[row]
            col = column[col]
            pick = np.flatnonzero((row >= 0) & (col >= 0))
            self._picks.append(pick)
            rows.append(row[pick])
            cols.append(col[pick])
        parts = gathered(self._comm, (np.concatenate(rows), np.concatenate(cols)))
        self.positions: tuple[np.ndarray, np.ndarray] | None = None
        if parts is not None:
            all_entry_rows, all_entry_cols = zip(*parts, strict=True)
            self.positions = np.concatenate(all_entry_rows), np.concatenate(all_entry_cols)

    def set_fields(self, z: np.ndarray) -> None:
        """Set the fields that the forms read to z."""
        fields = (self._forms.u, *self._forms.multipliers)
        for field, (dofs, places) in zip(fields, self.readers, strict=True):
            field.x.array[dofs] = z[places]

    def residual(self) -> np.ndarray | None:
        """Assemble the equations at the fields [force], shape (A,)."""
        vector = self._residual.x.array
        vector[:] = 0.0
        fem.assemble_vector(vector, self._forms.residual)
        parts = gathered(self._comm, vector[self._rows])
        if parts is None:
            return None
        return np.bincount(self._all_rows, np.concatenate(parts), self._size)

    def tangent(self) -> np.ndarray | None:
        """Assemble the entries of the tangent, in the order of `positions`."""
        values = []
        for matrix, form, pick in zip(
            self._matrices, self._forms.tangents, self._picks, strict=True
        ):
            matrix.set_value(0.0)
            fem.assemble_matrix(matrix, form)
            values.append(matrix.data[pick])
        parts = gathered(self._comm, np.concatenate(values))
        return None if parts is None else np.concatenate(parts)

    def status(self) -> np.ndarray | None:
        """Return the status open (0), slip (1) or stick (2) at points of all facets."""
        parts = gathered(self._comm, self._forms.status())
        return None if parts is None else np.concatenate(parts)

    def set_share(self, share: float) -> None:
        """Set the share of the friction bound."""
        self._forms.share.value = share


def _entries(matrix: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return local rows and columns of the entries of a block matrix."""
    b = matrix.block_size[0]
    row = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
    col = matrix.indices[: len(row)]
    rows = row[:, None, None] * b + np.arange(b)[:, None] + np.zeros((1, b), int)
    cols = col[:, None, None] * b + np.arange(b) + np.zeros((b, 1), int)
    return rows.ravel(), cols.ravel()
