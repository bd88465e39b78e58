"""Make a displacement fit exactly across the sides of copies of a body.

Where periodic sides face each other the jump of u^ is given: ``B u = J``, B of all
pairs of nodes (:mod:`erc_contact.model.contact.groups`). The least change is

    u - B^+ (B u - J).

At a corner of several pairs of sides all nodes of the group move together. Every rank
has all nodes of the groups of its own nodes; ghosts get the values of their owners.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.frames import frames_of
from erc_contact.model.contact.groups import Groups
from erc_contact.model.space import Space
from namedmesh.base.ranks import greatest

FITS = 1e-10
"""Jump that supports leave, over the greatest displacement, that is round-off [-]."""


class PeriodicFit:
    """Move the nodes of periodic sides so that their jumps are what is given.

    Args:
        space: The mesh.
        contacts: The contacts of periodic sides.
        free: Components that no support fixes, shape (nodes, d).
    """

    def __init__(self, space: Space, contacts: Sequence[ContactOnMesh], free: np.ndarray) -> None:
        self._space = space
        self._names = [contact.title for contact in contacts]
        pairs = []
        jumps = []
        for contact in contacts:
            trace = contact.trace
            pairs.append(np.column_stack([trace.here.nodes.ravel(), trace.partners.ravel()]))
            jumps.append(contact.given_jump.reshape(-1, space.d))
        rows, first = np.unique(np.concatenate(pairs), axis=0, return_index=True)
        numbers = np.unique(rows)
        frames = frames_of(pairs, [c.trace.rotation for c in contacts], numbers, space.d)
        self._groups = Groups(rows[:, 0], rows[:, 1], numbers, free[numbers], frames)
        self._given = np.concatenate(jumps)[first]
        of_rows = frames.at(np.searchsorted(numbers, rows[:, 0]))
        self._given = of_rows.inward(self._given)

    def __call__(self, values: np.ndarray) -> float:
        """Fit a displacement in place, and return the greatest change [length].

        Args:
            values: Nodal values, or coefficients, of u [length], shape (nodes, d).
        """
        groups = self._groups
        at = groups.group, slice(None), groups.slot
        change = np.matmul(groups.inverse, self._missing(values))[at][..., 0]
        change = groups.frames.outward(change)
        values[groups.numbers] -= change
        return float(abs(change).max(initial=0.0))

    def check(self, values: np.ndarray, excess: float) -> None:
        """Check that supports and contacts leave the jumps as given; collective.

        Args:
            values: Nodal values of u^ [length], shape (nodes, d).
            excess: What the fit and the limits of contacts leave of each other on this
                rank [length].

        Raises:
            InputError: If they hold both sides at places that do not fit.
        """
        comm = self._space.comm
        left = max(greatest(comm, self._missing(values)), greatest(comm, np.array(excess)))
        if left > FITS * greatest(comm, values):
            raise InputError(
                f"Supports or contacts hold both sides of {' or '.join(self._names)} at places that"
                f" differ by {left:.3g} [length] from their motion as copies; supports, gaps and"
                " normals must be the same on all copies."
            )

    def _missing(self, values: np.ndarray) -> np.ndarray:
        """Return ``B u - J`` of each group [length], shape (G, d, R, 1)."""
        groups = self._groups
        group, _, width = groups.is_free.shape
        u = np.zeros((group, values.shape[1], width, 1))
        u[groups.group, :, groups.slot, 0] = groups.frames.inward(values[groups.numbers])
        missing = np.matmul(groups.whole, u)
        missing[groups.group_of_row, :, groups.slot_of_row, 0] -= self._given
        return missing
