"""An orthonormal basis of displacements, whose first vectors change jumps.

The dense algebra of the direct solver needs only these vectors. See
:mod:`erc_contact.newton.linear.stiffness`, with whose symbols L, A and Q.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array  # type: ignore[import-untyped]

from erc_contact.base.sparse import local_matrix
from erc_contact.model.contact.groups import Groups
from erc_contact.model.contact.trace import dofs_of


class JumpBasis:
    """Hold Q of the free degrees of freedom of a layer; members know one rank.

    Args:
        groups: B of all contacts at connected nodes.
        numbers: Global numbers of the degrees of freedom of the layer, contact nodes
            first, shape (L,).
        contact_size: How many of them are at contact nodes.

    Attributes:
        jump_count: Number of unknowns A that change jumps.
    """

    def __init__(self, groups: Groups, numbers: np.ndarray, contact_size: int) -> None:
        self._numbers = numbers
        self._order = np.argsort(numbers)
        self._matrix: csr_array | None = None
        self.jump_count = contact_size
        if len(groups.numbers) == 0:
            return
        d = groups.jumps.shape[1]
        in_groups = np.isin(numbers, dofs_of(groups.numbers, d))
        at_contact = np.arange(len(in_groups)) < contact_size
        alone = np.flatnonzero(at_contact & ~in_groups)
        vectors, is_jump, is_alike = groups.bases
        self.jump_count = len(alone) + int(is_jump.sum())
        column_of = np.full(is_jump.shape, -1)
        column_of[is_jump] = np.arange(len(alone), self.jump_count)
        column_of[is_alike] = np.arange(self.jump_count, contact_size)
        used = (column_of >= 0)[:, :, None] & groups.is_free[..., None]
        dofs, columns, values = groups.columns_of(vectors, used, column_of)

        off_contact = np.arange(contact_size, len(in_groups))
        identity = np.ones(len(alone) + len(off_contact))
        self._matrix = local_matrix(
            (len(in_groups), len(in_groups)),
            np.concatenate([self.places(dofs), alone, off_contact]),
            np.concatenate([columns, np.arange(len(alone)), off_contact]),
            np.concatenate([values, identity]),
        )

    def places(self, dofs: np.ndarray) -> np.ndarray:
        """Return the places of global degrees of freedom in the layer, -1 off it."""
        nearest = np.searchsorted(self._numbers, dofs, sorter=self._order)
        place = self._order[np.minimum(nearest, len(self._order) - 1)]
        return np.where(self._numbers[place] == dofs, place, -1)

    def unknowns(self, nodal: np.ndarray) -> np.ndarray:
        """Return ``Q^T u`` of nodal values of the layer, shape (L,)."""
        return nodal if self._matrix is None else np.asarray(self._matrix.T @ nodal)

    def nodal(self, unknowns: np.ndarray) -> np.ndarray:
        """Return the nodal values ``Q x`` of the layer.

        Args:
            unknowns: Values x of L, or of its first ones, where the others are zero,
                shape (n,) or (n, k).
        """
        missing = len(self._numbers) - len(unknowns)
        x = np.concatenate([unknowns, np.zeros((missing, *unknowns.shape[1:]))])
        return x if self._matrix is None else np.asarray(self._matrix @ x)

    def of_unknowns(self, matrix: np.ndarray) -> np.ndarray:
        """Return ``Q^T M Q`` of a dense symmetric matrix M, shape (L, L)."""
        if self._matrix is None:
            return matrix
        product = np.asarray(self._matrix.T @ (self._matrix.T @ matrix).T)
        product += product.T
        product *= 0.5
        return product

    def of_jumps(self, rows: np.ndarray, columns: np.ndarray, values: np.ndarray) -> csr_array:
        """Return ``Q^T M Q`` on A of a sparse matrix M.

        Args:
            rows: Rows of its entries, global degrees of freedom at contacts.
            columns: Their columns.
            values: The entries, which add up where they coincide.
        """
        size = len(self._numbers)
        matrix = local_matrix((size, size), self.places(rows), self.places(columns), values)
        if self._matrix is not None:
            matrix = self._matrix.T @ matrix @ self._matrix
        return matrix[: self.jump_count, : self.jump_count]

    def read(
        self, height: int, rows: np.ndarray, columns: np.ndarray, values: np.ndarray
    ) -> csr_array:
        """Return ``M Q`` of a sparse matrix M.

        Args:
            height: Number of rows of M.
            rows: Rows of its entries.
            columns: Their columns, global degrees of freedom; columns that are not
                in the layer do not count.
            values: The entries, which add up where they coincide.
        """
        place = self.places(columns)
        used = place >= 0
        width = len(self._numbers)
        matrix = local_matrix((height, width), rows[used], place[used], values[used])
        return matrix if self._matrix is None else matrix @ self._matrix
