"""Tell which fields of contact equations are sums of several unknowns."""

from __future__ import annotations

import numpy as np

from erc_contact.model.model import Model
from erc_contact.newton.contact_nodes import Entries
from erc_contact.newton.jump_sums import Sums


def sums_of_displacements(model: Model, change: Entries | None, dofs: np.ndarray) -> Sums:
    """Return what the displacements that the forms read are sums of; collective.

    Args:
        model: The scene on a mesh.
        change: The change to Bernstein coefficients on foundations; None without.
        dofs: Their global degrees of freedom, ascending, shape (n,).

    Returns:
        The sums, by places in `dofs`.
    """
    row, column, factor = np.arange(len(dofs)), dofs, np.ones(len(dofs))
    if change is not None:
        used = np.isin(change.rows, dofs)
        row = np.searchsorted(dofs, change.rows[used])
        column, factor = change.columns[used], change.values[used]
    # T of all ranks, by the rows that are not those of the identity.
    entries = model.coordinates.entries
    of_rank = [model.global_dofs(entries.rows), entries.columns, entries.own, entries.other]
    table = np.concatenate(model.comm.allgather(np.column_stack(of_rank)))
    _, first = np.unique(table[:, 0], return_index=True)
    table = table[first]
    place = np.minimum(np.searchsorted(table[:, 0], column), len(table) - 1)
    in_table = table[place, 0] == column
    own = np.where(in_table, table[place, 2], 1.0)
    other = np.where(in_table, table[place, 3], 0.0)
    partner = np.where(in_table, table[place, 1], column)
    columns = np.concatenate([column, partner])
    return Sums(np.tile(row, 2), columns, np.concatenate([factor * own, factor * other]))


def sums_of_jump(model: Model, sums: Sums) -> tuple[Sums, np.ndarray]:
    """Return what a jump is a sum of where it is no unknown; collective.

    Args:
        model: The scene on a mesh.
        sums: D of its contact.

    Returns:
        The sums, by places in the second array, and global degrees of freedom.
    """
    # J, with its diagonal, at the degrees of freedom where it is not the identity.
    of_rank = [model.global_dofs(sums.rows), sums.columns, sums.values]
    table = np.concatenate(model.comm.allgather(np.column_stack(of_rank)))
    table = np.unique(table, axis=0)
    rows = np.unique(table[:, 0])
    all_sums = Sums(
        np.concatenate([np.searchsorted(rows, table[:, 0]), np.arange(len(rows))]),
        np.concatenate([table[:, 1], rows]),
        np.concatenate([table[:, 2], np.ones(len(rows))]),
    )
    return all_sums, rows
