"""The displacement of a contact, and everything that is made of it: values on facets, forces back, matrix, stiffness.

A contact reads of a displacement u only w, its value at the contact. On a rigid
foundation w is u itself; between two bodies it is the jump, u on this side less u at
the facing points of the other side. In a history friction counts the tangential part of
w from the end of the last step. All modules that need w, its Bernstein coefficients, or
the forces that do work on it, ask the contact's :class:`Trace`, so that they need not
know which kind of contact it is.

The map from nodal values to w on facets is linear. It has one entry of 1 in each row
for this side, and one of -1 for the other side. Its transpose takes forces on facets to
nodal forces, opposite on the two sides.

Symbols: f facets of this side on this rank, m nodes of a facet, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from dolfinx import fem

from erc_contact.mesh.simplex import coefficients, measures, node_vertices


def split(z: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Split vectors (..., d) by unit normals n.

    Returns:
        The normal component (...), the tangential part (..., d), and the length of this
        part (...).
    """
    z_n = (z * n).sum(axis=-1)
    z_t = z - z_n[..., None] * n
    return z_n, z_t, np.linalg.norm(z_t, axis=-1)


@dataclass(frozen=True, eq=False)
class Side:
    """The facets of one body at a contact; ``Space.side`` makes it.

    Attributes:
        facets: Pairs (cell, local facet), ghosts included, shape (f, 2).
        nodes: Nodes of each facet, in the order of the reference facet, shape (f, m).
        corners: Vertices of each facet [length], shape (f, d, d).
        owned: Which facets this rank owns, shape (f,).
        modulus: The modulus of the material in the middle of their cells [force/area],
            shape (f,).
        degree: Degree of the displacement.
        node_count: Number of nodes of this rank, ghosts included.
        cell_count: Number of cells that this rank owns.
    """

    facets: np.ndarray
    nodes: np.ndarray
    corners: np.ndarray
    owned: np.ndarray
    modulus: np.ndarray
    degree: int
    node_count: int
    cell_count: int

    @property
    def d(self) -> int:
        """Dimension of space."""
        return self.corners.shape[2]

    @cached_property
    def areas(self) -> np.ndarray:
        """Areas of the facets [length^(d-1)], shape (f,)."""
        return measures(self.corners)

    @cached_property
    def owned_areas(self) -> np.ndarray:
        """Areas of the facets that this rank owns, zero for the others [length^(d-1)], shape (f,)."""
        return np.where(self.owned, self.areas, 0.0)

    @cached_property
    def stiffness(self) -> np.ndarray:
        """The approximate stiffness of the body at each facet, ``E/h`` with its diameter h [force/length^3], (f,)."""
        diameters = self.areas ** (1 / (self.d - 1))
        return self.modulus / diameters

    @property
    def places(self) -> np.ndarray:
        """Positions of the nodes of each facet [length], shape (f, m, d)."""
        return self.corners[:, node_vertices(self.d - 1, self.degree)].mean(axis=2)


@dataclass(frozen=True, eq=False)
class Trace:
    """The displacement w of a contact.

    Attributes:
        here: The side whose body the contact traction acts on.
        direction: Unit normal of the contact on each facet, from this side into the
            other, shape (f, d).
        before: Displacement at the end of the last step of a history [length], a
            Function; None without one.
        there: The other side, facet i of it facing facet i of this side; None for a
            rigid foundation.
    """

    here: Side
    direction: np.ndarray
    before: fem.Function | None = None
    there: Side | None = None

    def of(self, u: np.ndarray) -> np.ndarray:
        """Give w at the nodes of the facets [length], shape (f, m, d).

        Args:
            u: Displacement at all nodes of this rank [length], shape (nodes d,) as the
                array of a Function has it, or (nodes, d).
        """
        nodal = u.reshape(-1, self.here.d)
        w = nodal[self.here.nodes]
        return w if self.there is None else w - nodal[self.partners]

    @cached_property
    def slip_before(self) -> np.ndarray:
        """The tangential part s of w at the end of the last step, zero without one [length], shape (f, m, d)."""
        if self.before is None:
            return np.zeros((*self.here.nodes.shape, self.here.d))
        return split(self.of(self.before.x.array), self.direction[:, None, :])[1]

    def since(self, u: np.ndarray) -> np.ndarray:
        """Give w with its tangential part counted from the last step, ``w - s`` [length], shape (f, m, d).

        Args:
            u: As in :meth:`of`.
        """
        return self.of(u) - self.slip_before

    def coefficients(self, values: np.ndarray) -> np.ndarray:
        """Give Bernstein coefficients of polynomials on the facets.

        Args:
            values: Values at the nodes of the facets, shape (f, m, ...), such as
                :meth:`of`, :meth:`since`, or the gap.
        """
        matrix = coefficients(self.here.d - 1, self.here.degree)
        components = int(np.prod(values.shape[2:]))
        long = values.reshape(*values.shape[:2], components)
        return np.matmul(matrix, long).reshape(values.shape)

    def assign(self, u: np.ndarray, w: np.ndarray) -> None:
        """Set the displacement of this side so that :meth:`of` gives w where the other side is at rest, in place.

        Args:
            u: Displacement at all nodes, as in :meth:`of`.
            w: Values at the nodes of the facets, or one for each facet, shape (f, m, d)
                or (f, 1, d).
        """
        u.reshape(-1, self.here.d)[self.here.nodes] = w

    def back(self, forces: np.ndarray) -> np.ndarray:
        """Add up the nodal forces that do the work of forces on w, the transpose of :meth:`of`.

        Args:
            forces: Forces on w at the nodes of the facets [force], shape (f, m, d).

        Returns:
            Nodal forces [force], shape (nodes, d); at ghost nodes they are not
            complete.
        """
        nodal = np.zeros((self.here.node_count, self.here.d))
        np.add.at(nodal, self.here.nodes, forces)
        if self.there is not None:
            np.subtract.at(nodal, self.partners, forces)
        return nodal

    def matrix(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Give :meth:`of` as a sparse matrix from degrees of freedom of this rank to the components of w.

        Returns:
            Rows, in the order of w raveled, columns and values of its entries.
        """
        d = self.here.d
        columns = (self.here.nodes[..., None] * d + np.arange(d)).ravel()
        rows = np.arange(columns.size)
        values = np.ones(columns.size)
        if self.there is None:
            return rows, columns, values
        other = (self.partners[..., None] * d + np.arange(d)).ravel()
        return np.tile(rows, 2), np.concatenate([columns, other]), np.concatenate([values, -values])

    @cached_property
    def stiffness(self) -> np.ndarray:
        """The approximate stiffness of the bodies at each facet, ``E/h`` [force/length^3], shape (f,).

        That of two bodies is that of two springs in a row.
        """
        if self.there is None:
            return self.here.stiffness
        return (
            self.here.stiffness
            * self.there.stiffness
            / (self.here.stiffness + self.there.stiffness)
        )

    def share(self, values: np.ndarray) -> np.ndarray:
        """Give values of facets to their cells; two bodies get shares in proportion to their compliances.

        Args:
            values: A value of each facet, shape (f,).

        Returns:
            Sums for the cells that this rank owns, shape (cells,).
        """
        cells = np.zeros(self.here.cell_count)
        share = np.ones(len(values))
        if self.there is not None:
            share = self.stiffness / self.here.stiffness
            _add_to_owned(cells, self.there, (1 - share) * values)
        _add_to_owned(cells, self.here, share * values)
        return cells

    @cached_property
    def partners(self) -> np.ndarray:
        """The nodes of the other side that face those of this side, shape (f, m)."""
        if self.there is None:
            raise TypeError("A contact with a rigid foundation has no other side.")
        here = _about_middle(self.here.places)
        there = _about_middle(self.there.places)
        # The sides may be apart by a gap, and the vertices of facing facets are in any
        # order.
        distance = np.linalg.norm(here[:, :, None] - there[:, None], axis=-1)
        return np.take_along_axis(self.there.nodes, distance.argmin(axis=2), axis=1)


def _about_middle(x: np.ndarray) -> np.ndarray:
    """Positions of the nodes of facets (f, m, d) from the mean of each facet."""
    return x - x.mean(axis=1, keepdims=True)


def _add_to_owned(cells: np.ndarray, side: Side, values: np.ndarray) -> None:
    """Add values of the facets of a side (f,) to those of the cells of this rank, in place."""
    np.add.at(cells, side.facets[side.owned, 0], values[side.owned])
