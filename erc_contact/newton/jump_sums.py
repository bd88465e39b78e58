"""Express the jumps of contacts by the solver's unknowns where they are sums.

At a point where three bodies A, B, C meet, the jumps of two contacts are unknowns, x_A
and x_B against the base C, and that of the third one is ``x_A - x_B``. So the jump of a
contact is ``w = J x``, where J is the identity but for the rows of such nodes,

    J = I + D.

Its transpose takes forces on w to those on x: ``D^T`` adds to the assembled forces of a
contact what they leave to other unknowns. So the forces of contacts with a common node
of side 1 are told apart: contacts get *colours*, and those of one colour have no such
node in common.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.base.exceptions import InputError
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.model.node_pairs import pairs_of
from erc_contact.model.over_ranks import matrix_of_ranks
from erc_contact.model.trace import dofs_of


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

    Attributes:
        colours: The colour of each contact.
        count: Number of colours, 1 where D is zero for all contacts.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._sums = {contact.name: _sums(model, contact) for contact in model.contacts}
        self.colours = [0] * len(model.contacts)
        if model.coordinates.has_joints:
            self.colours = _colours(model)
        self.count = 1 + max(self.colours, default=0)

    def of(self, contact: BoundContact) -> Sums:
        """Return D of a contact; it has no entries on a foundation."""
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


def _sums(model: Model, contact: BoundContact) -> Sums:
    """Return the entries of D of a contact."""
    trace = contact.trace
    coordinates = model.coordinates
    nothing = np.zeros(0, dtype=np.int64)
    if trace.there is None or not coordinates.is_joint.any():
        return Sums(nothing, nothing, np.zeros(0))
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


def _colours(model: Model) -> list[int]:
    """Choose the lowest free colour of each contact in turn; collective.

    Contacts of one colour have no node of side 1 in common whose jumps are sums.
    """
    contacts = model.contacts
    count = len(contacts)
    joints_of = []
    for contact in contacts:
        nodes = np.unique(contact.trace.here.nodes)
        between = contact.trace.there is not None
        joints_of.append(nodes[model.coordinates.is_joint[nodes] & between])
    meet = np.zeros((count, count), dtype=np.int8)
    for i in range(count):
        for j in range(i):
            meet[i, j] = len(np.intersect1d(joints_of[i], joints_of[j])) > 0
    meet = model.comm.allreduce(meet, MPI.SUM)
    colours: list[int] = []
    for i in range(count):
        taken = {colours[j] for j in range(i) if meet[i, j]}
        colours.append(next(colour for colour in range(count) if colour not in taken))
    return colours


def raise_at_joints(model: Model) -> None:
    """Raise an error where bodies have more contacts at a point than jumps.

    Raises:
        InputError: If three or more bodies meet at a point.
    """
    if model.coordinates.has_joints:
        raise InputError(
            "Three or more bodies meet at a point, or two contacts of the same bodies name them in "
            "another order: the nodal forces there do not tell the tractions of all contacts, as a "
            "multiplier needs it. Take method=ec.Nitsche(), or name the same body first in both."
        )
