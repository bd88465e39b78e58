"""Rigid motions of the bodies of a mesh, and which of them are held by supports and contacts.

A mesh may have several bodies, which share no node. Each body has its own rigid
motions, and each must be held.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import NotHeldError
from erc_contact.model.foundation import BoundContact
from erc_contact.model.space import Space

SMALL = 1e-10
"""Share of the largest eigenvalue below which a motion counts as not held [-]."""


def free_motions(
    space: Space, fixed: np.ndarray, contacts: Sequence[BoundContact]
) -> list[fem.Function]:
    """Rigid motions that no support holds, Functions of V, each of one body; collective.

    The motions of a body are orthonormal combinations of its translations and of its
    rotations over its size.

    Args:
        space: The mesh.
        fixed: Which components supports prescribe at each node, shape (nodes, d).
        contacts: The contacts, which may hold a motion, too.

    Raises:
        NotHeldError: If contacts do not hold one of them either.
    """
    body, bodies = bodies_of_nodes(space)
    motions, names = _rigid_motions(space, body, bodies)
    owned = space.V.dofmap.index_map.size_local
    held = motions[:owned] * fixed[:owned, :, None]
    by_supports = _summed(space, body[:owned], bodies, held)
    by_all = by_supports
    for contact in contacts:
        nodes = contact.trace.here.nodes
        at = motions[nodes]
        along = np.einsum("fmdi,fd->fmi", at, contact.direction)[:, :, None, :]
        held = at if contact.friction is not None else along
        by_all = by_all + _summed(
            space, body[nodes.ravel()], bodies, held.reshape(nodes.size, *held.shape[2:])
        )
    loose = []
    for number, of_body in enumerate(by_all):
        kernel = _kernel(of_body)
        if kernel.shape[1]:
            which = ", ".join(names[i] for i in np.unique(abs(kernel).argmax(axis=0)))
            loose.append(
                which
                if bodies == 1
                else f"{which} of the body with {_parts(space, body == number)}"
            )
    if loose:
        raise NotHeldError(
            f"Nothing holds the body against: {'; '.join(loose)} (no support, and contact cannot hold it). "
            "Add a Displacement (None leaves a component free), or friction."
        )
    functions = []
    for number, of_body in enumerate(by_supports):
        for column in _kernel(of_body).T:
            motion = space.function()
            motion.x.array[:] = (motions @ column * (body == number)[:, None]).ravel()
            functions.append(motion)
    return functions


def rigid_motions(space: Space) -> np.ndarray:
    """The rigid motions of all bodies at the nodes, shape (nodes, d, motions); collective."""
    body, bodies = bodies_of_nodes(space)
    motions, _ = _rigid_motions(space, body, bodies)
    return np.concatenate([(body == b)[:, None, None] * motions for b in range(bodies)], axis=2)


def translations_and_rotations(x: np.ndarray) -> np.ndarray:
    """Return the rigid motions of the plane or of space about the origin.

    Args:
        x: Positions, shape (n, d).

    Returns:
        Displacements at the positions, shape (n, d, motions): one translation along
        each axis, then one rotation for each pair of axes.
    """
    d = x.shape[1]
    pairs = list(combinations(range(d), 2))
    motions = np.zeros((*x.shape, d + len(pairs)))
    motions[:, range(d), range(d)] = 1.0
    for k, (i, j) in enumerate(pairs, start=d):
        motions[:, i, k] = -x[:, j]
        motions[:, j, k] = x[:, i]
    return motions


def bodies_of_nodes(space: Space) -> tuple[np.ndarray, int]:
    """The body of each node of this rank, ghosts included, and the number of bodies of all ranks; collective.

    Each rank finds its bodies. Bodies of two ranks that have a node in common are one.
    """
    comm, cells = space.comm, space.nodes
    pairs = np.column_stack([np.repeat(cells[:, 0], cells.shape[1] - 1), cells[:, 1:].ravel()])
    here, label = np.unique(components(space.node_count, pairs), return_inverse=True)
    counts = comm.allgather(len(here))
    label += sum(counts[: comm.rank])
    at_owner = space.function()
    at_owner.x.array[:] = np.repeat(label, space.d)
    at_owner.x.scatter_forward()
    labels = np.column_stack([label, at_owner.x.array[:: space.d].astype(int)])
    seen = np.unique(labels[labels[:, 0] != labels[:, 1]], axis=0)
    joined = components(sum(counts), np.concatenate(comm.allgather(seen)))
    bodies, number = np.unique(joined, return_inverse=True)
    return number[label], len(bodies)


def components(number: int, pairs: np.ndarray) -> np.ndarray:
    """The least vertex of the connected component of each vertex of a graph.

    Args:
        number: Number of vertices.
        pairs: Edges, shape (n, 2).
    """
    label = np.arange(number)
    while True:
        ends = label[pairs]
        low, high = ends.min(axis=1, initial=number), ends.max(axis=1, initial=-1)
        if np.array_equal(low, high):
            return label
        np.minimum.at(label, high, low)
        while not np.array_equal(label, jumped := label[label]):
            label = jumped


def _summed(space: Space, body: np.ndarray, bodies: int, held: np.ndarray) -> np.ndarray:
    """Products of the held components of motions, summed over the nodes of each body; collective.

    Args:
        space: The mesh.
        body: Body of each node, shape (n,).
        bodies: Number of bodies.
        held: Held components of the m motions at the nodes, shape (n, components, m).

    Returns:
        The sums over all ranks, shape (bodies, m, m).
    """
    total = np.zeros((bodies, held.shape[2], held.shape[2]))
    for number in np.unique(body):
        some = held[body == number]
        total[number] = np.einsum("ndi,ndj->ij", some, some)
    return space.comm.allreduce(total, MPI.SUM)


def _kernel(squares: np.ndarray) -> np.ndarray:
    """The combinations of m motions that are not held, from a matrix of :func:`_summed` (m, m), shape (m, free)."""
    values, vectors = np.linalg.eigh(squares)
    return vectors[:, values <= SMALL * max(values[-1], 1.0)]


def _parts(space: Space, inside: np.ndarray) -> str:
    """The names of the boundary parts of a body, for a message; collective. ``inside`` tells its nodes."""
    nodes = {name: space.nodes[space.domain.facets(name)[:, 0]] for name in space.domain.outer}
    here = {name for name, some in nodes.items() if inside[some].any()}
    every = set().union(*space.comm.allgather(here))
    return ", ".join(map(repr, sorted(every))) if every else "no named boundary part"


def _rigid_motions(space: Space, body: np.ndarray, bodies: int) -> tuple[np.ndarray, list[str]]:
    """Rigid motions at the nodes, shape (nodes, d, m), and their names.

    Rotations are about the centre of the body, and divided by its size.
    """
    x = space.V.tabulate_dof_coordinates()[:, : space.d]
    owned = space.V.dofmap.index_map.size_local
    sums = np.zeros((bodies, space.d + 1))
    np.add.at(sums, body[:owned], np.column_stack([x[:owned], np.ones(owned)]))
    sums = space.comm.allreduce(sums, MPI.SUM)
    low, high = np.full((bodies, space.d), np.inf), np.full((bodies, space.d), -np.inf)
    np.minimum.at(low, body, x)
    np.maximum.at(high, body, x)
    space.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    space.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    x = (x - (sums[:, :-1] / sums[:, -1:])[body]) / np.linalg.norm(high - low, axis=1)[body, None]
    motions = translations_and_rotations(x)
    pairs = list(combinations(range(space.d), 2))
    axes = "xyz"
    names = [f"translation in {axes[i]}" for i in range(space.d)]
    names += [f"rotation in the plane {axes[i]}{axes[j]}" for i, j in pairs]
    return motions, names
