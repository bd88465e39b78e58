"""Express the jumps of contacts by the solver's unknowns where they are sums.

At a point where three bodies A, B, C meet, the jumps of two contacts are unknowns, x_A
and x_B against the base C, and that of the third one is ``x_A - x_B``. So the jump of a
contact is ``w = J x``, where J is the identity but for the rows of such nodes,

    J = I + D.

Its transpose takes forces on w to those on x: ``D^T`` adds to the assembled forces of a
contact what they leave to other unknowns. So the forces of contacts with a common node
of side 1 are told apart: contacts get *colours*, and those of one colour have no such
node in common.

A foundation reads ``u = T x``, so that ``D = T - I`` there. A method without multiplier
tests u of all foundations at once (:attr:`.forms.ContactForms.test_alike`), and needs
no D for them; the equations of a multiplier do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.model.node_pairs import pairs_of
from erc_contact.model.over_ranks import marked_by_any, matrix_of_ranks
from erc_contact.model.trace import dofs_of
from erc_contact.newton.contact_nodes import Entries
from erc_contact.newton.shared_forces import SharedNodes


@dataclass(frozen=True, eq=False)
class Sums:
    """Hold the entries of D of one contact; those that coincide add up.

    Attributes:
        rows: Degrees of freedom of this rank, shape (n,).
        columns: Global degrees of freedom, shape (n,).
        values: Shape (n,).
    """

    rows: np.ndarray
    columns: np.ndarray
    values: np.ndarray


class JumpSums:
    """Hold D of all contacts, and their colours; construction is collective.

    Args:
        model: The scene on a mesh.
        with_foundations: Whether D of foundations is wanted, as a multiplier needs it.

    Attributes:
        colours: The colour of each contact.
        count: Number of colours, 1 where D is zero for all contacts.
        any: Whether D of a contact has entries, on all ranks.
    """

    def __init__(self, model: Model, *, with_foundations: bool = False) -> None:
        self._model = model
        self._sums: dict[str, Sums] = {}
        for contact in model.contacts:
            if contact.trace.there is not None:
                self._sums[contact.name] = _sums(model, contact)
            else:
                self._sums[contact.name] = _sums_of_foundation(model, contact, with_foundations)
        self.any = False
        if not model.coordinates.is_identity:
            here = any(len(sums.rows) > 0 for sums in self._sums.values())
            self.any = model.comm.allreduce(here, MPI.LOR)
        self.colours = [0] * len(model.contacts)
        if self.any:
            self.colours = _colours(model, self._sums, with_foundations)
        self.count = 1 + max(self.colours, default=0)

    def of(self, contact: BoundContact) -> Sums:
        """Return D of a contact."""
        return self._sums[contact.name]

    def of_colour(self, colour: int) -> Sums:
        """Return D of all contacts of a colour."""
        parts = []
        for sums, of_contact in zip(self._sums.values(), self.colours, strict=True):
            if of_contact == colour:
                parts.append(sums)
        rows = np.concatenate([part.rows for part in parts])
        columns = np.concatenate([part.columns for part in parts])
        return Sums(rows, columns, np.concatenate([part.values for part in parts]))

    def of_foundations(self) -> Sums:
        """Return D of u on all foundations, each entry once."""
        parts = []
        for contact in self._model.contacts:
            if contact.trace.there is None:
                parts.append(self.of(contact))
        if not parts:
            return _no_sums()
        rows = np.concatenate([part.rows for part in parts])
        columns = np.concatenate([part.columns for part in parts])
        values = np.concatenate([part.values for part in parts])
        # Foundations with a common node read the same displacement there.
        _, first = np.unique(np.column_stack([rows, columns]), axis=0, return_index=True)
        return Sums(rows[first], columns[first], values[first])

    def matrix(self, sums: Sums, identity: float) -> PETSc.Mat:
        """Return D and a multiple of the identity as a matrix of all ranks; collective.

        Args:
            sums: The entries of D.
            identity: The factor of the identity, 1 for J and 0 for D.
        """
        model = self._model
        index_map = model.V.dofmap.index_map
        size = index_map.size_local * model.d
        dofs = index_map.local_range[0] * model.d + np.arange(size)
        owned = sums.rows < size
        rows = np.concatenate([dofs, model.global_dofs(sums.rows[owned])])
        columns = np.concatenate([dofs, sums.columns[owned]])
        values = np.concatenate([np.full(size, identity), sums.values[owned]])
        return matrix_of_ranks(model, rows, columns, values)


def shared_nodes(model: Model, sums: JumpSums) -> SharedNodes | None:
    """Find the nodes whose forces contacts share; collective.

    Args:
        model: The scene on a mesh.
        sums: The jumps that are sums of unknowns, with those of foundations.

    Returns:
        The nodes; None where there are none on any rank.
    """
    if not sums.any:
        return None
    comm, d = model.comm, model.d
    is_shared = np.zeros(model.node_count, dtype=bool)
    index_map = model.V.dofmap.index_map
    for contact in model.contacts:
        of_contact = sums.of(contact)
        is_shared[of_contact.rows // d] = True
        columns = index_map.global_to_local(of_contact.columns // d)
        is_shared[columns[columns >= 0]] = True
    (is_shared,) = marked_by_any(model, is_shared)

    nodes = np.flatnonzero(is_shared)
    of_rank = np.column_stack([model.global_numbers(nodes), ~model.coordinates.fixed[nodes]])
    table = np.unique(np.concatenate(comm.allgather(of_rank)), axis=0)
    numbers = table[:, 0]
    free = table[:, 1:] > 0
    free_dofs = dofs_of(numbers, d)[free.ravel()]
    jumps = []
    for contact in model.contacts:
        here = np.unique(contact.trace.here.nodes)
        own = model.global_dofs(dofs_of(here[is_shared[here]], d))
        own = np.unique(np.concatenate(comm.allgather(own)))
        of_contact = sums.of(contact)
        rows = model.global_dofs(of_contact.rows)
        entries = np.column_stack([rows, of_contact.columns, of_contact.values])
        entries = np.unique(np.concatenate(comm.allgather(entries)), axis=0)
        jumps.append(_with_identity(own, entries, free_dofs))
    columns = np.concatenate([of_contact.columns for of_contact in jumps])
    has_equation = np.isin(dofs_of(numbers, d), columns).reshape(-1, d)
    return SharedNodes(numbers, jumps, has_equation)


def _with_identity(own: np.ndarray, entries: np.ndarray, free_dofs: np.ndarray) -> Entries:
    """Return the entries of ``I + D`` at free unknowns.

    Args:
        own: Rows of the identity, shape (n,).
        entries: Rows, columns and values of D, shape (m, 3).
        free_dofs: The unknowns that no support fixes.
    """
    places = np.concatenate([np.column_stack([own, own]), entries[:, :2].astype(own.dtype)])
    values = np.concatenate([np.ones(len(own)), entries[:, 2]])
    unique, which = np.unique(places, axis=0, return_inverse=True)
    total = np.bincount(which.ravel(), values, len(unique))
    used = (total != 0) & np.isin(unique[:, 1], free_dofs)
    rows, columns = unique[used].T
    return Entries(rows, columns, total[used])


def _sums(model: Model, contact: BoundContact) -> Sums:
    """Return the entries of D of a contact between bodies."""
    trace = contact.trace
    coordinates = model.coordinates
    if not coordinates.is_joint.any():
        return _no_sums()
    d = model.d
    pairs = pairs_of(trace)
    here, there = pairs[coordinates.is_joint[pairs[:, 0]]].T
    rows = dofs_of(here, d)
    parts = [(model.global_dofs(rows), -np.ones(len(rows)))]
    # The jump is the difference of two rows of T.
    for sign, nodes in ((1.0, here), (-1.0, there)):
        dofs = dofs_of(nodes, d)
        entries = coordinates.entries
        place = np.searchsorted(entries.rows, dofs)
        parts.append((model.global_dofs(dofs), sign * entries.own[place]))
        parts.append((entries.columns[place], sign * entries.other[place]))
    columns, values = zip(*parts, strict=True)
    return _added_up(
        model, np.tile(rows, len(parts)), np.concatenate(columns), np.concatenate(values)
    )


def _added_up(model: Model, rows: np.ndarray, columns: np.ndarray, values: np.ndarray) -> Sums:
    """Return entries that differ from zero, each place once."""
    size = model.V.dofmap.index_map.size_global * model.d
    keys, places = np.unique(rows * size + columns, return_inverse=True)
    sums = np.bincount(places, values, len(keys))
    used = sums != 0
    row, column = np.divmod(keys[used], size)
    return Sums(row, column, sums[used])


def _sums_of_foundation(model: Model, contact: BoundContact, wanted: bool) -> Sums:
    """Return the entries of D of a contact with a foundation, ``T - I``."""
    coordinates = model.coordinates
    if not wanted or coordinates.is_identity:
        return _no_sums()
    on_foundation = np.zeros(model.node_count, dtype=bool)
    on_foundation[contact.trace.here.nodes] = True
    entries = coordinates.entries
    here = np.flatnonzero(on_foundation[entries.rows // model.d])
    rows = entries.rows[here]
    columns = np.concatenate([model.global_dofs(rows), entries.columns[here]])
    values = np.concatenate([entries.own[here] - 1.0, entries.other[here]])
    return _added_up(model, np.tile(rows, 2), columns, values)


def _no_sums() -> Sums:
    """Return D without entries."""
    nothing = np.zeros(0, dtype=np.int64)
    return Sums(nothing, nothing, np.zeros(0))


def _colours(model: Model, sums: dict[str, Sums], with_foundations: bool) -> list[int]:
    """Choose the lowest free colour of each contact in turn; collective.

    Contacts of one colour have no node of side 1 in common whose jumps are sums.
    """
    contacts = model.contacts
    count = len(contacts)
    is_sum = model.coordinates.is_joint.copy()
    for of_contact in sums.values():
        is_sum[of_contact.rows // model.d] = True
        if with_foundations:
            # All nodes whose forces contacts share, see below.
            columns = model.V.dofmap.index_map.global_to_local(of_contact.columns // model.d)
            is_sum[columns[columns >= 0]] = True
    nodes_of = []
    for contact in contacts:
        nodes = np.unique(contact.trace.here.nodes)
        counts = with_foundations or contact.trace.there is not None
        nodes_of.append(nodes[is_sum[nodes] & counts])
    meet = np.zeros((count, count), dtype=np.int8)
    for i in range(count):
        for j in range(i):
            meet[i, j] = len(np.intersect1d(nodes_of[i], nodes_of[j])) > 0
    meet = model.comm.allreduce(meet, MPI.SUM)
    colours: list[int] = []
    for i in range(count):
        taken = {colours[j] for j in range(i) if meet[i, j]}
        colours.append(next(colour for colour in range(count) if colour not in taken))
    return colours
