"""Tell which fields of contact equations are sums of several unknowns."""

from __future__ import annotations

import numpy as np

from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.jump_sums import Sums
from erc_contact.newton.multiplier_map import MultiplierMap


def sums_of_displacements(
    model: Model, multiplier_map: MultiplierMap | None, dofs: np.ndarray
) -> Sums:
    """Return what the displacements that the forms read are sums of; collective.

    Args:
        model: The scene on a mesh.
        multiplier_map: That of a method with multiplier; None without.
        dofs: Their global degrees of freedom, ascending, shape (n,).

    Returns:
        The sums, by places in `dofs`.
    """
    row, column, factor = np.arange(len(dofs)), dofs, np.ones(len(dofs))
    if multiplier_map is not None and multiplier_map.on_foundations is not None:
        change = multiplier_map.on_foundations
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


def sums_of_jump(
    forms: ContactForms, multiplier_map: MultiplierMap | None, contact: BoundContact
) -> tuple[Sums, np.ndarray]:
    """Return what a jump is a sum of where it is no unknown; collective.

    With a multiplier it is that of its Bernstein coefficients.

    Args:
        forms: The equations of the method.
        multiplier_map: That of a method with multiplier; None without.
        contact: A contact between bodies.

    Returns:
        The sums, by places in the second array, and global degrees of freedom.
    """
    model = forms.model
    if multiplier_map is not None and multiplier_map.shared is not None:
        entries = multiplier_map.shared.jumps[model.contacts.index(contact)]
        rows = np.unique(entries.rows)
        return Sums(np.searchsorted(rows, entries.rows), entries.columns, entries.values), rows
    # J, with its diagonal, at the degrees of freedom where it is not the identity.
    sums = forms.jump_sums.of(contact)
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
