"""Sum up the derivatives of contact equations at the nodes, in one assembly.

The equations of a contact between bodies are forces on its jump ``w = B u``, and are
derived by jumps and by u. With the derivative T, nodal forces are derived by nodal
displacements as ``B^T T B`` or ``B^T T``. B has entries 1 and -1 only, or between
sectors I and a turn. So each entry of T goes to few places, with a factor, and all
contacts are one assembly of entries at places that stay.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from dolfinx import fem, la

from erc_contact.base.sparse import pattern_of
from erc_contact.model.contact.trace import NOBODY
from erc_contact.model.data.over_ranks import matrix_of_ranks
from erc_contact.model.model import Model
from erc_contact.newton.contact_nodes import contact_nodes
from erc_contact.newton.forms import ContactForms
from namedmesh.for_solvers import count_up


class NodeSum:
    """Hold the derivative of nodal forces by the displacement, of all contacts.

    Construction and members are collective.

    Args:
        forms: The equations of a method without multiplier.
    """

    def __init__(self, forms: ContactForms) -> None:
        model = forms.model
        self._tangents: list[tuple[list[fem.Form], la.MatrixCSR]] = []
        places = []
        for reader in forms.readers:
            rows_read = _nodes_read(model, reader.contact)
            for field, tangents in zip(forms.displacements, reader.tangents, strict=True):
                if not tangents:
                    continue
                contact = forms.jumps.get(field)
                number = None if contact is None else model.contacts.index(contact)
                columns_read = rows_read
                if number != reader.contact:
                    columns_read = _nodes_read(model, number)
                term = la.matrix_csr(pattern_of(tangents))
                self._tangents.append((tangents, term))
                places.append(_places(term, rows_read, columns_read))
        self._entries = [of_term.entry for of_term in places]
        self._factors = np.concatenate([of_term.factor for of_term in places])
        rows = np.concatenate([of_term.row for of_term in places])
        columns = np.concatenate([of_term.column for of_term in places])
        self.matrix = matrix_of_ranks(model.space, rows, columns, np.zeros(len(rows)))

    def assemble(self) -> None:
        """Set the matrix to the derivative at the fields of the forms."""
        values = []
        for (tangents, term), entry in zip(self._tangents, self._entries, strict=True):
            term.set_value(0.0)
            for tangent in tangents:
                fem.assemble_matrix(term, tangent)
            values.append(term.data[entry])
        self.matrix.setValuesCOO(self._factors * np.concatenate(values))

    def free(self) -> None:
        """Free the matrix."""
        self.matrix.destroy()


class _Places(NamedTuple):
    """Tell where the entries of a derivative go, each once or more often.

    Attributes:
        entry: Number of the entry on this rank, shape (n,).
        factor: Its factor there, shape (n,).
        row: Global degree of freedom of the force, shape (n,).
        column: Global degree of freedom of the displacement, shape (n,).
    """

    entry: np.ndarray
    factor: np.ndarray
    row: np.ndarray
    column: np.ndarray


class _Read(NamedTuple):
    """Hold the nodes at which a contact has a jump.

    Attributes:
        here: Their global numbers, ascending, shape (n,).
        there: The nodes of the other body, or ``NOBODY``, shape (n,).
        turns: ``R^T``, by which the jump sees the other node, shape (n, d, d).
    """

    here: np.ndarray
    there: np.ndarray
    turns: np.ndarray


def _nodes_read(model: Model, number: int | None) -> _Read | None:
    """Gather the nodes at which a contact has a jump; collective.

    Args:
        model: The scene on a mesh.
        number: Number of the contact; None for displacements, which are at all nodes.

    Returns:
        The nodes; None for displacements.
    """
    if number is None:
        return None
    here = contact_nodes(model.space, model.contacts[number]).here
    there = np.full(len(here), NOBODY)
    pairs = model.connections.pairs[number]
    there[np.searchsorted(here, pairs[:, 0])] = pairs[:, 1]
    return _Read(here, there, model.connections.turns(np.column_stack([here, there])))


def _places(term: la.MatrixCSR, rows_read: _Read | None, columns_read: _Read | None) -> _Places:
    """Find where the entries of a derivative go.

    Args:
        term: The derivative, in blocks of nodes.
        rows_read: The nodes of its rows, as :func:`_nodes_read` returns them.
        columns_read: The nodes of its columns.
    """
    d, _ = term.block_size
    row_map, column_map = term.index_map(0), term.index_map(1)
    # Rows of ghosts are sent to their owners with all other entries.
    local_rows = np.repeat(np.arange(len(term.indptr) - 1), np.diff(term.indptr))
    rows = row_map.local_to_global(local_rows.astype(np.int32))
    columns = column_map.local_to_global(term.indices)
    block, row_sign, rows, row_turns = _at_bodies(rows, d, rows_read)
    columns = columns[block]
    of_columns, column_sign, columns, column_turns = _at_bodies(columns, d, columns_read)
    block, rows = block[of_columns], rows[of_columns]
    sign = row_sign[of_columns] * column_sign
    # B^T T B of blocks: each entry of T counts where the turns of both sides take it.
    of_left, a, i = np.nonzero(row_turns[of_columns])
    of_right, b, j = np.nonzero(column_turns)
    counts = np.bincount(of_right, minlength=len(block))
    left = np.repeat(np.arange(len(of_left)), counts[of_left])
    of_both = of_left[left]
    right = (np.cumsum(counts) - counts)[of_both] + count_up(counts[of_left])
    a, i, b, j = a[left], i[left], b[right], j[right]
    factors = row_turns[of_columns[of_both], a, i] * column_turns[of_both, b, j]
    return _Places(
        block[of_both] * d**2 + a * d + b,
        sign[of_both] * factors,
        rows[of_both] * d + i,
        columns[of_both] * d + j,
    )


def _at_bodies(
    nodes: np.ndarray, d: int, read: _Read | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Replace jumps by the displacements of both sides.

    Away from the contact no form of the jump has entries but round-off.

    Args:
        nodes: Global numbers of the nodes of jumps, shape (n,).
        d: The dimension.
        read: The nodes of the contact, as :func:`_nodes_read` returns them.

    Returns:
        For each displacement the number of its jump, the sign, its node, and the turn
        by which the jump sees it, shape (m, d, d).
    """
    identity = np.broadcast_to(np.eye(d), (len(nodes), d, d))
    if read is None:
        return np.arange(len(nodes)), np.ones(len(nodes)), nodes, identity
    here, there, turns_there = read
    place = np.minimum(np.searchsorted(here, nodes), len(here) - 1)
    on_this_side = np.flatnonzero(here[place] == nodes)
    partners = there[place[on_this_side]]
    faces = partners != NOBODY
    on_other_side = on_this_side[faces]
    number = np.concatenate([on_this_side, on_other_side])
    sign = np.repeat([1.0, -1.0], [len(on_this_side), len(on_other_side)])
    turns = np.concatenate([identity[on_this_side], turns_there[place[on_other_side]]])
    return number, sign, np.concatenate([nodes[on_this_side], partners[faces]]), turns
