"""Split the forces of unknowns that several contacts act on among these contacts.

Where three bodies meet at a point, or two of them on a foundation, the jump of a
contact is a sum of unknowns, ``w_c = M_c x``. With the nodal forces g_c of all contacts
on their jumps the reaction of the unknowns is

    r = sum_c M_c^T g_c.

Three bodies have two jumps and may have three contacts, so that the reaction does not
tell all g_c. There is an estimate g0_c besides: the force of a multiplier that is the
mean of its neighbours in the contact. Of all forces that fit the reaction the nearest
to these are taken, in the sense of ``sum_c |g_c - g0_c|^2 / k_c`` with the stiffness
k_c of the bodies at the contact, so that a soft body gets no force that stiff ones
leave:

    g_c = g0_c + Q_c (r - sum_b M_b^T g0_b),    Q_c = k_c M_c (sum_b M_b^T k_b M_b)^-1.

A constant stress has so its own tractions. Where the reaction tells all forces, as in a
chain of bodies, they do not depend on g0. The order of the contacts does not matter.

The unknowns have the equations ``sum_c M_c^T e_c = 0``: the reaction of an unknown is
what the tractions of all laws together leave there. The displacement of a joint has no
such equation without a foundation, and keeps its equilibrium.

Symbols: M_c the identity but for rows of shared nodes, e_c the equations of a
multiplier, :mod:`erc_contact.newton.reactions`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.model.joints import components
from erc_contact.newton.contact_nodes import Entries


@dataclass(frozen=True, eq=False)
class SharedNodes:
    """Hold the nodes whose forces are shared, the same on all ranks.

    Attributes:
        numbers: Global numbers of the nodes, ascending, shape (n,).
        jumps: For each contact the rows of M_c at these nodes, of free unknowns.
        has_equation: Which of their unknowns do work on a contact, shape (n, d).
    """

    numbers: np.ndarray
    jumps: list[Entries]
    has_equation: np.ndarray


def shares(jumps: list[Entries], springs: list[np.ndarray]) -> list[Entries]:
    """Return Q_c of each contact.

    Unknowns that no contact has in common are told apart, so that the inverse is that
    of small blocks.

    Args:
        jumps: The rows of M_c of each contact.
        springs: Stiffness k_c at the node of each entry of these [force/length].
    """
    lengths = [len(entries.rows) for entries in jumps]
    contact = np.repeat(np.arange(len(jumps)), lengths)
    all_rows = np.concatenate([entries.rows for entries in jumps])
    of_jumps = np.column_stack([contact, all_rows])
    jump_of, row = np.unique(of_jumps, axis=0, return_inverse=True)
    row = row.ravel()
    unknown, column = np.unique(
        np.concatenate([entries.columns for entries in jumps]), return_inverse=True
    )
    value = np.concatenate([entries.values for entries in jumps])
    spring = np.ones(len(jump_of))
    spring[row] = np.concatenate(springs)

    # Rows and columns are joined by entries; each connected part is a block.
    edges = np.column_stack([row, len(jump_of) + column])
    part = components(len(jump_of) + len(unknown), edges)
    _, block = np.unique(part, return_inverse=True)
    block_of_row, row_place = block[: len(jump_of)], _numbers_in(block[: len(jump_of)])
    block_of_column = block[len(jump_of) :]
    column_place = _numbers_in(block_of_column)
    shape = (block.max() + 1, row_place.max() + 1, column_place.max() + 1)
    m = np.zeros(shape)
    m[block_of_row[row], row_place[row], column_place[column]] = value
    weighted = m.copy()
    weighted[block_of_row, row_place] *= spring[:, None]
    gram = np.matmul(m.transpose(0, 2, 1), weighted)
    # Blocks have different sizes: the rest of a block is the identity.
    filled = np.zeros((shape[0], shape[2]), dtype=bool)
    filled[block_of_column, column_place] = True
    empty_block, empty_place = np.nonzero(~filled)
    gram[empty_block, empty_place, empty_place] = 1.0
    q = np.matmul(weighted, np.linalg.inv(gram))

    number_of = np.full((shape[0], shape[2]), -1)
    number_of[block_of_column, column_place] = np.arange(len(unknown))
    of_row = q[block_of_row, row_place]
    columns_of_row = number_of[block_of_row]
    used_row, used_place = np.nonzero((of_row != 0) & (columns_of_row >= 0))
    result = []
    for k in range(len(jumps)):
        here = jump_of[used_row, 0] == k
        rows = jump_of[used_row[here], 1]
        columns = unknown[columns_of_row[used_row[here], used_place[here]]]
        result.append(Entries(rows, columns, of_row[used_row[here], used_place[here]]))
    return result


def _numbers_in(group: np.ndarray) -> np.ndarray:
    """Return the number of each member among those of its group, shape (n,)."""
    order = np.argsort(group, kind="stable")
    ascending = group[order]
    numbers = np.empty(len(group), dtype=np.int64)
    numbers[order] = np.arange(len(group)) - np.searchsorted(ascending, ascending)
    return numbers
