"""Make the rigid motions of the bodies of a mesh, and name those that nothing holds.

A mesh may have several bodies, which share no node. Each body has its own rigid
motions.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.model.motions.rigid_shapes import translations_and_rotations
from erc_contact.model.space import Space
from namedmesh.base.ranks import boxes, of_all
from namedmesh.for_solvers import components

FREE_SHARE = 1e-10
"""Share of the largest eigenvalue below which a motion counts as not held [-]."""


@dataclass(frozen=True, eq=False)
class BodyMotions:
    """Hold the m rigid motions of bodies.

    Rotations are about the centre of the body, and divided by its size.

    Attributes:
        values: The motions at the nodes, shape (nodes, d, m).
        names: Their names.
        centres: Centre of each body [length], shape (bodies, d).
        sizes: Size of each body [length], shape (bodies,).
    """

    values: np.ndarray
    names: list[str]
    centres: np.ndarray
    sizes: np.ndarray


@dataclass(frozen=True, eq=False)
class Group:
    """Hold bodies that contacts connect, and their common motions that nothing holds.

    Attributes:
        bodies: Their numbers, shape (b,).
        amounts: Orthonormal combinations of the m motions of the b bodies, shape (b, m,
            K).
        words: The motions, in words.
        places: The boundary parts of each body, in words; empty for the only body.
    """

    bodies: np.ndarray
    amounts: np.ndarray
    words: str
    places: list[str]


@dataclass(frozen=True, eq=False)
class Unheld:
    """Hold the motions of all bodies that nothing holds.

    Attributes:
        motions_of_bodies: The rigid motions of the bodies.
        groups: The groups of bodies that have such motions.
        functions: The motions q_k, Functions of V, in the order of the groups.
        anchors: Which components of nodes are anchored, shape (nodes, d).
        hint: What may have been meant to hold bodies, in words.
    """

    motions_of_bodies: BodyMotions
    groups: list[Group]
    functions: list[fem.Function]
    anchors: np.ndarray
    hint: str

    @property
    def words(self) -> str:
        """Return the motions in words; empty without any."""
        return "; ".join(group.words for group in self.groups)


def motions_together(motions: BodyMotions, numbers: np.ndarray, m: int) -> np.ndarray:
    """Return the motions of bodies as one body, in motions of each, shape (b, m, m)."""
    amounts = np.zeros((len(numbers), m, m))
    if m == 1:
        amounts[:] = 1.0
        return amounts
    places = motions.centres[numbers]
    shapes = translations_and_rotations(places - places.mean(axis=0))
    d = places.shape[1]
    amounts[:, :d] = shapes
    turns = range(d, m)
    amounts[:, turns, turns] = motions.sizes[numbers, None]
    # Rotations over the size of the greatest body, as motions of one body are.
    amounts[:, :, d:] /= motions.sizes[numbers].max()
    return amounts


def rigid_motions(space: Space) -> np.ndarray:
    """Return the rigid motions of all bodies at the nodes; collective.

    Returns:
        Shape (nodes, d, motions); a motion of a body is zero on the others.
    """
    body, count = bodies_of_nodes(space)
    motions = body_motions(space, body, count).values
    of_bodies = [(body == number)[:, None, None] * motions for number in range(count)]
    return np.concatenate(of_bodies, axis=2)


def nearest_motion(space: Space, motions: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the factors of the motions whose sum is nearest to values; collective.

    Args:
        space: The mesh.
        motions: The m motions, shape (nodes d, m).
        values: A displacement at the nodes [length], shape (nodes d,).
    """
    owned = space.V.dofmap.index_map.size_local * space.d
    total = np.zeros(motions.shape[1])
    # The second time gets the digits that products of motions lose.
    for _ in range(2):
        columns = np.column_stack([motions, values - motions @ total])[:owned]
        products = space.comm.allreduce(motions[:owned].T @ columns, MPI.SUM)
        total += np.linalg.lstsq(products[:, :-1], products[:, -1], rcond=FREE_SHARE)[0]
    return total


def greatest_of_bodies(
    comm: MPI.Comm, bodies: tuple[np.ndarray, int], nodes: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """Return the greatest value of each body, zero without any; collective.

    Args:
        comm: The ranks.
        bodies: Body of each node, and number of bodies.
        nodes: A node of the body of each row of values, shape (n,).
        values: Values >= 0, or no numbers, which stay, shape (n, ...).

    Returns:
        Shape (bodies,).
    """
    body, count = bodies
    greatest = np.zeros(count)
    with np.errstate(invalid="ignore"):
        if count == 1:
            greatest[0] = values.max(initial=0.0)
        else:
            of_rows = values.max(axis=tuple(range(1, values.ndim)), initial=0.0)
            np.maximum.at(greatest, body[nodes], of_rows)
    return greatest if comm.size == 1 else np.max(comm.allgather(greatest), axis=0)


def bodies_of_nodes(space: Space, cut: np.ndarray | None = None) -> tuple[np.ndarray, int]:
    """Number the bodies of the mesh, from 0 over all ranks; collective.

    Args:
        space: The mesh.
        cut: Which nodes connect nothing, as at a cut, shape (nodes,); each of them
            counts as a body. None for none.

    Returns:
        The body of each node of this rank, ghosts included, and the number of bodies.
    """
    comm = space.comm
    cells = space.nodes
    # Each rank joins the nodes of its cells, and numbers its bodies after the bodies of
    # the ranks before it.
    if cut is not None:
        # The first node of each cell is one that connects, if any does.
        cells = np.take_along_axis(cells, np.argsort(cut[cells], axis=1, kind="stable"), axis=1)
    first = np.repeat(cells[:, 0], cells.shape[1] - 1)
    edges = np.column_stack([first, cells[:, 1:].ravel()])
    if cut is not None:
        edges = edges[~cut[edges].any(axis=1)]
    bodies_here, label = np.unique(components(space.node_count, edges), return_inverse=True)
    counts = comm.allgather(len(bodies_here))
    label += sum(counts[: comm.rank])
    # Bodies of two ranks that have a node in common are one.
    at_owner = space.function()
    at_owner.x.array[:] = np.repeat(label, space.d)
    at_owner.x.scatter_forward()
    labels = np.column_stack([label, at_owner.x.array[:: space.d].astype(int)])
    shared = np.unique(labels[labels[:, 0] != labels[:, 1]], axis=0)
    joined = components(sum(counts), *of_all(comm, shared))
    bodies, number = np.unique(joined, return_inverse=True)
    return number[label], len(bodies)


def motions_not_held(
    space: Space, body: np.ndarray, motions: np.ndarray, held: np.ndarray
) -> list[fem.Function]:
    """Return the motions of each body that nothing resists, as Functions of V.

    Args:
        space: The mesh.
        body: Body of each node.
        motions: The m motions at the nodes, shape (nodes, d, m).
        held: Products of the resisted motions of each body, shape (bodies, m, m).
    """
    functions = []
    for number, products in enumerate(held):
        for combination in kernel(products).T:
            motion = space.function()
            of_body = (body == number)[:, None]
            motion.x.array[:] = (motions @ combination * of_body).ravel()
            functions.append(motion)
    return functions


def sum_products(space: Space, body: np.ndarray, count: int, resisted: np.ndarray) -> np.ndarray:
    """Sum up products of resisted components over each body; collective.

    Args:
        space: The mesh.
        body: Body of each node, shape (n,).
        count: Number of bodies.
        resisted: Resisted components of the m motions at the nodes, shape
            (n, components, m).

    Returns:
        The sums over all ranks, shape (bodies, m, m).
    """
    total = np.zeros((count, resisted.shape[2], resisted.shape[2]))
    for number in np.unique(body):
        of_body = resisted[body == number]
        total[number] = np.einsum("ndi,ndj->ij", of_body, of_body)
    return space.comm.allreduce(total, MPI.SUM)


def kernel(products: np.ndarray) -> np.ndarray:
    """Find the combinations of m motions that nothing resists, shape (m, free).

    Args:
        products: A matrix of :func:`sum_products`, shape (m, m).
    """
    values, vectors = np.linalg.eigh(products)
    return vectors[:, values <= FREE_SHARE * max(values[-1], 1.0)]


def body_motions(space: Space, body: np.ndarray, count: int) -> BodyMotions:
    """Compute the rigid motions of bodies; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        count: Number of bodies.
    """
    d = space.d
    x = space.V.tabulate_dof_coordinates()[:, :d]
    owned = space.V.dofmap.index_map.size_local
    sums = np.zeros((count, d + 1))
    np.add.at(sums, body[:owned], np.column_stack([x[:owned], np.ones(owned)]))
    sums = space.comm.allreduce(sums, MPI.SUM)
    centres = sums[:, :-1] / sums[:, -1:]
    low, high = boxes(space.comm, x, body, count)
    sizes = np.linalg.norm(high - low, axis=1)
    motions = translations_and_rotations((x - centres[body]) / sizes[body, None])
    section = space.section
    return BodyMotions(motions[:, :, section.motions], section.motion_names, centres, sizes)


def block_diagonal(blocks: Iterable[np.ndarray]) -> np.ndarray:
    """Return the matrix with square blocks on its diagonal."""
    blocks = list(blocks)
    count = sum(len(block) for block in blocks)
    matrix = np.zeros((count, count))
    first = 0
    for block in blocks:
        last = first + len(block)
        matrix[first:last, first:last] = block
        first = last
    return matrix
