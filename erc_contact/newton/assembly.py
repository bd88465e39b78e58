"""Assembly of the contact equations on all ranks for the condensed problem on rank 0.

Each rank assembles the terms of its own facets, and rank 0 adds them up. Symbols: u_A
and z as in :mod:`erc_contact.newton.condensed`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem, la

from erc_contact.base.ranks import gathered
from erc_contact.base.sparse import pattern_of
from erc_contact.newton.forms import ContactForms, Pass


class Assembly:
    """Assemble the equations of a method in the numbering of the condensed problem.

    All methods are collective. What they return is on rank 0, None on other ranks.

    Args:
        forms: The equations of the method.
        passes: The assemblies of the equations whose sum they are.
        columns: For each field that the forms are derived by, the place in z of each
            degree of freedom of this rank, -1 where it has none.
        size: Number of unknowns u_A.

    Attributes:
        readers: For each field its degrees of freedom that are in z, and their places.
        positions: Rows in u_A and columns in z of the entries of the tangent, on rank
            0; None elsewhere.
    """

    def __init__(
        self,
        forms: ContactForms,
        passes: list[Pass],
        columns: list[np.ndarray],
        size: int,
    ) -> None:
        self._forms = forms
        self._comm = forms.model.comm
        self._size = size
        self._residual = forms.model.function()
        self._matrices = [la.matrix_csr(pattern_of(tangents)) for tangents in forms.tangents]

        self.readers: list[tuple[np.ndarray, np.ndarray]] = []
        for column in columns:
            dofs = np.flatnonzero(column >= 0)
            self.readers.append((dofs, column[dofs]))

        self._passes = passes
        all_rows = gathered(self._comm, np.concatenate([p.places for p in self._passes]))
        self._all_rows = np.zeros(0, dtype=np.int64)
        if all_rows is not None:
            self._all_rows = np.concatenate(all_rows)

        self._picks: list[np.ndarray] = []
        self._factors: list[np.ndarray] = []
        entry_rows = []
        entry_cols = []
        for one_pass in self._passes:
            for matrix, column in zip(self._matrices, columns, strict=True):
                entry_dofs, col = _entries(matrix)
                row = one_pass.row_of[entry_dofs]
                col = column[col]
                pick = np.flatnonzero((row >= 0) & (col >= 0))
                self._picks.append(pick)
                self._factors.append(one_pass.factor_of[entry_dofs[pick]])
                entry_rows.append(row[pick])
                entry_cols.append(col[pick])
        parts = gathered(self._comm, (np.concatenate(entry_rows), np.concatenate(entry_cols)))
        self.positions: tuple[np.ndarray, np.ndarray] | None = None
        if parts is not None:
            all_entry_rows, all_entry_cols = zip(*parts, strict=True)
            self.positions = np.concatenate(all_entry_rows), np.concatenate(all_entry_cols)

    def set_fields(self, z: np.ndarray) -> None:
        """Set the fields that the forms read to z."""
        fields = (*self._forms.displacements, *self._forms.multipliers)
        for field, (dofs, places) in zip(fields, self.readers, strict=True):
            field.x.array[dofs] = z[places]

    def residual(self) -> np.ndarray | None:
        """Assemble the equations at the fields [force], shape (A,)."""
        vector = self._residual.x.array
        values = []
        tested = None
        for one_pass in self._passes:
            # Passes that test the same jumps read the same forces.
            if one_pass.tested != tested:
                tested = one_pass.tested
                self._forms.test(tested)
                vector[:] = 0.0
                self._forms.assemble(vector)
            values.append(one_pass.factors * vector[one_pass.rows])
        parts = gathered(self._comm, np.concatenate(values))
        if parts is None:
            return None
        return np.bincount(self._all_rows, np.concatenate(parts), self._size)

    def tangent(self) -> np.ndarray | None:
        """Assemble the entries of the tangent, in the order of `positions`."""
        values = []
        picks = zip(self._picks, self._factors, strict=True)
        tested = None
        for one_pass in self._passes:
            is_new = one_pass.tested != tested
            tested = one_pass.tested
            self._forms.test(tested)
            for matrix, tangents in zip(self._matrices, self._forms.tangents, strict=True):
                if is_new:
                    matrix.set_value(0.0)
                    for tangent in tangents:
                        fem.assemble_matrix(matrix, tangent)
                pick, factor = next(picks)
                values.append(factor * matrix.data[pick])
        parts = gathered(self._comm, np.concatenate(values))
        return None if parts is None else np.concatenate(parts)

    def status(self) -> np.ndarray | None:
        """Return the status open (0), slip (1) or stick (2) at points of all facets."""
        parts = gathered(self._comm, self._forms.status())
        return None if parts is None else np.concatenate(parts)

    def set_shares(self, friction: float, gap: float) -> None:
        """Set the shares of friction and gaps [-]."""
        self._forms.set_shares(friction, gap)


def _entries(matrix: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return local rows and columns of the entries of a block matrix."""
    b = matrix.block_size[0]
    row = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
    col = matrix.indices[: len(row)]
    rows = row[:, None, None] * b + np.arange(b)[:, None] + np.zeros((1, b), int)
    cols = col[:, None, None] * b + np.arange(b) + np.zeros((b, 1), int)
    return rows.ravel(), cols.ravel()
