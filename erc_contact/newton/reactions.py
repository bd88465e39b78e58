"""The multipliers of a contact problem from the reactions of its nodes, on each rank for its own nodes.

The reaction is what the elastic equations leave at the nodes of the contact. For degree
2, the equations of a multiplier use Bernstein coefficients of u and lambda instead of
nodal values. With ``c_e = 2 u_e - (u_a + u_b)/2`` for the edge e between the vertices a
and b, the force on c_e is half of the force on u_e, and a quarter of the force on u_e
is added to the force at each end.

It is the same map as in :mod:`erc_contact.newton.multipliers`, which is for dense
matrices on one rank.

Symbols: A free degrees of freedom of the contact nodes, a area of a node, d dimension,
m nodes of a facet.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
from dolfinx import la

from erc_contact.mesh.simplex import edges
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model


class Reactions:
    """The linear map from nodal forces at A to the multipliers of all contacts; its members are collective.

    Args:
        model: The scene on a mesh.

    Attributes:
        free: Which degrees of freedom of this rank, ghosts included, are in A, shape
            (nodes, d).
        area: Area of the nodes in the contact that their multiplier belongs to
            [length^(d-1)], elsewhere 1, (nodes,).
    """

    def __init__(self, model: Model) -> None:
        self._model, add_up = model, _Sums(model)
        self.free = np.zeros(model.fixed.shape, dtype=bool)
        self.area = np.ones(len(model.fixed))
        self._parts = []
        for contact in model.contacts:
            part = _Part(model, contact, self.free, add_up)
            new = part.nodes & ~self.free.any(axis=1)
            self.area[new] = part.area[new]
            self.free |= part.active
            self._parts.append(part)
        self._edges = _Edges(model, add_up) if model.degree > 1 else None

    def multipliers(self, force: np.ndarray) -> list[np.ndarray]:
        """The multipliers of all contacts [force/area], shape (nodes, d) each, Bernstein coefficients.

        The multiplier of a node belongs to the first contact that has the node. There
        ``a lambda`` is the force less the multipliers of later contacts. At the nodes
        of earlier contacts, and for components that a support fixes, it is the mean of
        its neighbours in the contact.

        Args:
            force: Forces at the nodes [force], right on their owners, shape (nodes, d);
                those not in A are not used.
        """
        force = np.where(self.free, force, 0.0)
        if self._edges is not None:
            force = np.where(self.free, self._edges.spread(force, 0.5, 0.25), 0.0)
        found: list[np.ndarray] = []
        for part in reversed(self._parts):
            values = part.completed(np.where(part.active, force / part.area[:, None], 0.0))
            force = force - np.where(part.active, 0.0, values * part.area[:, None])
            found.insert(0, values)
        return found

    def back(self, force: np.ndarray) -> np.ndarray:
        """Forces at the nodes from those on the Bernstein coefficients ``c = C u``: ``C^T`` times them, (nodes, d)."""
        return force if self._edges is None else self._edges.spread(force, 2.0, -0.5)

    def coefficients(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """C of the degrees of freedom in A, for degree 2: global rows, global columns and values that add up."""
        assert self._edges is not None
        edges, model, d = self._edges, self._model, self._model.d
        owned = model.V.dofmap.index_map.size_local
        node = np.flatnonzero(self.free[:owned].any(axis=1))
        row = np.concatenate([node, edges.edge])
        col = np.concatenate([node, edges.end])
        value = np.concatenate([np.where(edges.inside[node], 2.0, 1.0), -0.5 * edges.share[:, 0]])
        pair, component = np.nonzero(self.free[row] & self.free[col])
        rows, cols = (model.global_numbers(of[pair]) * d + component for of in (row, col))
        return rows, cols, value[pair]


class _Sums:
    """Sums of nodal values over the ranks that share a node; collective."""

    def __init__(self, model: Model) -> None:
        self._field, self._d = model.function(), model.d

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """The sum for all nodes of this rank, shape (nodes, c) with c at most d."""
        array = self._field.x.array.reshape(-1, self._d)
        array[:] = 0.0
        array[:, : values.shape[1]] = values
        self._field.x.scatter_reverse(la.InsertMode.add)
        self._field.x.scatter_forward()
        return array[:, : values.shape[1]].copy()

    def of_owners(self, values: np.ndarray) -> np.ndarray:
        """The values that the owners of the nodes have, shape (nodes, d)."""
        array = self._field.x.array.reshape(-1, self._d)
        array[:] = values
        self._field.x.scatter_forward()
        return array.copy()


class _Part:
    """One contact: its nodes, their areas, and which components have a multiplier of their own.

    Attributes:
        nodes: Which nodes it has, shape (nodes,).
        area: Area of its nodes [length^(d-1)], elsewhere 1, shape (nodes,).
        active: Components that no support fixes, at nodes of no earlier contact, shape
            (nodes, d).
    """

    def __init__(
        self, model: Model, contact: BoundContact, taken: np.ndarray, add_up: _Sums
    ) -> None:
        self._add_up = add_up
        side = contact.trace.here
        facets = side.nodes[side.owned]
        area = np.zeros((len(model.fixed), 1))
        np.add.at(area[:, 0], facets, side.areas[side.owned][:, None] / facets.shape[1])
        area = add_up(area)[:, 0]
        self.nodes = area > 0
        self.area = np.where(self.nodes, area, 1.0)
        earlier = taken.any(axis=1)
        self.active = self.nodes[:, None] & ~model.fixed & ~earlier[:, None]
        passive = self.nodes & ~self.active.all(axis=1)
        self._pairs = _pairs(model, facets, passive)
        i, j = self._pairs
        count = np.zeros(model.fixed.shape)
        np.add.at(count, i, self._from(j))
        self._count = np.maximum(add_up(count), 1.0)
        self._needed = bool(model.comm.allreduce(bool(passive.any())))

    def _from(self, j: np.ndarray) -> np.ndarray:
        return self.active[j].astype(float)

    def completed(self, values: np.ndarray) -> np.ndarray:
        """Values of the active components, with the means of active neighbours at the other ones, shape (nodes, d)."""
        values = self._add_up.of_owners(values)
        if not self._needed:
            return values
        i, j = self._pairs
        sums = np.zeros(values.shape)
        np.add.at(sums, i, values[j] * self._from(j))
        means = self._add_up(sums) / self._count
        return np.where(self.active, values, np.where(self.nodes[:, None], means, 0.0))


def _pairs(model: Model, facets: np.ndarray, passive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of neighbours on facets (f, m) whose first node is passive; each pair is on one rank; collective."""
    i, j = (
        facets[:, list(p)].ravel()
        for p in zip(*permutations(range(facets.shape[1]), 2), strict=True)
    )
    i, j = i[passive[i]], j[passive[i]]
    mine = model.global_numbers(np.column_stack([i, j]))
    parts = model.comm.allgather(mine)
    every = np.concatenate(parts)
    _, first = np.unique(every, axis=0, return_index=True)
    keep = np.zeros(len(every), dtype=bool)
    keep[first] = True
    begin = sum(len(part) for part in parts[: model.comm.rank])
    here = keep[begin : begin + len(mine)]
    return i[here], j[here]


class _Edges:
    """The edges of all contacts: nodes between two vertices.

    Attributes:
        inside: Which nodes are on an edge, shape (nodes,).
        edge: Edge of each pair of an edge and its end, from the facets of this rank,
            shape (p,).
        end: The end, shape (p,).
        share: One over the number of facets with the edge, shape (p, 1).
    """

    def __init__(self, model: Model, add_up: _Sums) -> None:
        self._add_up, d = add_up, model.d
        sides = [c.trace.here for c in model.contacts]
        nodes = np.concatenate([side.nodes[side.owned] for side in sides])
        count = np.zeros((len(model.fixed), 1))
        np.add.at(count[:, 0], nodes[:, d:], 1.0)
        count = add_up(count)[:, 0]
        self.inside = count > 0
        self.edge = np.repeat(nodes[:, d:].ravel(), 2)
        self.end = nodes[:, edges(d - 1)].reshape(-1)
        self.share = 1 / count[self.edge][:, None]

    def spread(self, force: np.ndarray, of_edge: float, to_end: float) -> np.ndarray:
        """Forces with those at edges times one factor, and times another one added at both ends, shape (nodes, d)."""
        force = self._add_up.of_owners(force)
        added = np.zeros(force.shape)
        np.add.at(added, self.end, to_end * self.share * force[self.edge])
        return force * np.where(self.inside, of_edge, 1.0)[:, None] + self._add_up(added)
