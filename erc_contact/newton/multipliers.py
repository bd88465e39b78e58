"""The multipliers of a condensed contact problem as affine functions of its unknowns u_A.

For degree 2, the equations of a multiplier use Bernstein coefficients of u and lambda
instead of nodal values. With ``c_e = 2 u_e - (u_a + u_b)/2`` for the edge e between the
vertices a and b, the force on c_e is half of the force on u_e, and a quarter of the
force on u_e is added to the force at each end.

Symbols: A, u_A, L and lambda as in :mod:`erc_contact.newton.condensed`, a area of a
node, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.mesh.simplex import edges
from erc_contact.model.model import Model


class Places:
    """Places in A of global degrees of freedom."""

    def __init__(self, numbers: np.ndarray, d: int) -> None:
        self.order = np.argsort(numbers)
        self.sorted, self.d = numbers[self.order], d

    def of(self, nodes: np.ndarray) -> np.ndarray:
        """Places of all components of global nodes, -1 for those not in A, shape (n, d)."""
        dofs = nodes[:, None] * self.d + np.arange(self.d)
        at = np.minimum(np.searchsorted(self.sorted, dofs), len(self.sorted) - 1)
        return np.where(self.sorted[at] == dofs, self.order[at], -1)


@dataclass(frozen=True, eq=False)
class Edges:
    """Degrees of freedom of A at edges of the contact, which turn nodal values of degree 2 into Bernstein coefficients.

    Attributes:
        edge: Their places in A, shape (e,).
        of_end: Place of an edge for each pair of an edge and an end of it that is in A,
            too, shape (p,).
        end: Place of this end, shape (p,).
    """

    edge: np.ndarray
    of_end: np.ndarray
    end: np.ndarray

    def coefficients(self, u: np.ndarray) -> np.ndarray:
        """Bernstein coefficients from nodal values of displacements, shape (L, ...)."""
        result = u.copy()
        result[self.edge] *= 2.0
        np.subtract.at(result, self.of_end, 0.5 * u[self.end])
        return result

    def forces(self, force: np.ndarray) -> np.ndarray:
        """Forces on the coefficients from forces at the nodes, shape (A, ...)."""
        result = force.copy()
        result[self.edge] *= 0.5
        np.add.at(result, self.end, 0.25 * force[self.of_end])
        return result


def contact_edges(model: Model, numbers: np.ndarray) -> Edges | None:
    """The edges of all contacts in A, whose global degrees of freedom are given; None for degree 1; collective."""
    d = model.d
    if model.degree == 1:
        return None
    nodes = np.concatenate([c.trace.here.nodes[c.trace.here.owned] for c in model.contacts])
    ends = nodes[:, edges(d - 1)]
    triples = np.concatenate([nodes[:, d:, None], ends], axis=2).reshape(-1, 3)
    triples = np.unique(np.concatenate(model.comm.allgather(model.global_numbers(triples))), axis=0)
    places = Places(numbers, d)
    edge, first, second = (places.of(column) for column in triples.T)
    of_end, end = np.concatenate([edge, edge]), np.concatenate([first, second])
    both = (of_end >= 0) & (end >= 0)
    return Edges(edge[edge >= 0], of_end[both], end[both])


def multiplier_rows(
    contacts: list[tuple[np.ndarray, np.ndarray, np.ndarray]], places: Places, reaction: np.ndarray
) -> list[np.ndarray]:
    """The multipliers of all contacts as affine functions of u_A, computed from the last contact to the first.

    The multiplier of a node belongs to the first contact that has the node. There ``a
    lambda`` is the reaction less the multipliers of later contacts. At the nodes of
    earlier contacts, and for components that a support fixes, the multiplier is the
    mean of its neighbours in the contact.

    Args:
        contacts: For each contact its nodes (n,), its facets as places in them (f, m),
            and the areas of nodes (n,).
        places: Where the components of nodes are in A.
        reaction: Reactions at A as affine functions of u_A, shape (A, A+1).

    Returns:
        For each contact, shape (n d, A+1).
    """
    done: list[np.ndarray] = []
    for k in reversed(range(len(contacts))):
        nodes, facets, area = contacts[k]
        at = places.of(nodes)
        earlier = (
            np.isin(nodes, np.concatenate([c[0] for c in contacts[:k]]))
            if k
            else np.zeros(len(nodes), bool)
        )
        active = (at >= 0) & ~earlier[:, None]
        rows = np.zeros((*at.shape, reaction.shape[1]))
        rows[active] = reaction[at[active]]
        for (others, _, of_others), known in zip(contacts[k + 1 :], done, strict=True):
            _, here, there = np.intersect1d(nodes, others, return_indices=True)
            rows[here] -= active[here][:, :, None] * (of_others[there, None, None] * known[there])
        rows[active] /= np.broadcast_to(area[:, None], active.shape)[active][:, None]

        _set_to_means(rows, active, facets)
        done.insert(0, rows)
    return [rows.reshape(-1, rows.shape[2]) for rows in done]


def _set_to_means(rows: np.ndarray, active: np.ndarray, facets: np.ndarray) -> None:
    """Set the components of nodes that are not active to the means of those of their active neighbours, in place.

    Args:
        rows: Affine functions of the components of nodes, zero where they are not
            active, shape (n, d, A+1).
        active: Shape (n, d).
        facets: Nodes of the facets, which are neighbours of each other, shape (f, m).
    """
    m = range(facets.shape[1])
    i, j = (
        facets[:, p].ravel() for p in zip(*[(p, q) for p in m for q in m if p != q], strict=True)
    )
    neighbours = np.unique(np.column_stack([i, j]), axis=0)
    pair, component = np.nonzero(~active[neighbours[:, 0]] & active[neighbours[:, 1]])
    target = neighbours[pair, 0], component
    count = np.zeros(active.shape)
    np.add.at(count, target, 1.0)
    np.add.at(rows, target, rows[neighbours[pair, 1], component])
    rows /= np.maximum(count, 1.0)[:, :, None]
