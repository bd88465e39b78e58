"""Find rigid motions of the bodies of a mesh that no support and no contact holds.

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
from erc_contact.mesh.graphs import components
from erc_contact.model.foundation import BoundContact
from erc_contact.model.rigid_faces import RigidFace
from erc_contact.model.rigid_shapes import translations_and_rotations
from erc_contact.model.space import Space
from erc_contact.model.springs import BoundSpring

FREE_SHARE = 1e-10
"""Share of the largest eigenvalue below which a motion counts as not held [-]."""


def free_motions(
    space: Space,
    fixed: np.ndarray,
    springs: Sequence[BoundSpring],
    contacts: Sequence[BoundContact],
    faces: Sequence[RigidFace] = (),
) -> list[fem.Function]:
    """Find the rigid motions that no support or spring holds; collective.

    Each is of one body. The motions of a body are orthonormal combinations of its
    translations and of its rotations over its size.

    Args:
        space: The mesh.
        fixed: Which components supports hold at a value at each node, shape (nodes, d).
        springs: The springs.
        contacts: The contacts, which may hold a motion, too.
        faces: The loose rigid faces, which resist their given motions.

    Returns:
        Functions of V.

    Raises:
        NotHeldError: If contacts do not hold one of them either.
    """
    body, count = bodies_of_nodes(space)
    motions, names = _rigid_motions(space, body, count)
    owned = space.V.dofmap.index_map.size_local
    resisted = motions[:owned] * fixed[:owned, :, None]
    by_supports = _summed(space, body[:owned], count, resisted)
    for spring in springs:
        nodes, resisted = spring.resisted(motions)
        by_supports = by_supports + _summed(space, body[nodes], count, resisted)
    for face in faces:
        number = face.body(body)
        of_face = (face.motion(motions) * face.sizes[:, None])[~face.free]
        by_supports[number] += of_face.T @ of_face
    by_all = _block_diagonal(by_supports)
    for contact in contacts:
        by_all = by_all + _by_contact(space, body, count, motions, contact)
    _check_all_held(space, body, count, by_all, names)
    functions = []
    for number, products in enumerate(by_supports):
        for combination in _kernel(products).T:
            motion = space.function()
            of_body = (body == number)[:, None]
            motion.x.array[:] = (motions @ combination * of_body).ravel()
            functions.append(motion)
    return functions


def rigid_motions(space: Space) -> np.ndarray:
    """Return the rigid motions of all bodies at the nodes; collective.

    Returns:
        Shape (nodes, d, motions); a motion of a body is zero on the others.
    """
    body, count = bodies_of_nodes(space)
    motions, _ = _rigid_motions(space, body, count)
    of_bodies = [(body == number)[:, None, None] * motions for number in range(count)]
    return np.concatenate(of_bodies, axis=2)


def bodies_of_nodes(space: Space) -> tuple[np.ndarray, int]:
    """Number the bodies of the mesh, from 0 over all ranks; collective.

    Returns:
        The body of each node of this rank, ghosts included, and the number of bodies.
    """
    comm = space.comm
    cells = space.nodes
    # Each rank joins the nodes of its cells, and numbers its bodies after those of the
    # ranks before it.
    first = np.repeat(cells[:, 0], cells.shape[1] - 1)
    edges = np.column_stack([first, cells[:, 1:].ravel()])
    bodies_here, label = np.unique(components(space.node_count, edges), return_inverse=True)
    counts = comm.allgather(len(bodies_here))
    label += sum(counts[: comm.rank])
    # Bodies of two ranks that have a node in common are one.
    at_owner = space.function()
    at_owner.x.array[:] = np.repeat(label, space.d)
    at_owner.x.scatter_forward()
    labels = np.column_stack([label, at_owner.x.array[:: space.d].astype(int)])
    shared = np.unique(labels[labels[:, 0] != labels[:, 1]], axis=0)
    joined = components(sum(counts), np.concatenate(comm.allgather(shared)))
    bodies, number = np.unique(joined, return_inverse=True)
    return number[label], len(bodies)


def _by_contact(
    space: Space, body: np.ndarray, count: int, motions: np.ndarray, contact: BoundContact
) -> np.ndarray:
    """Sum up the products of motions of all bodies that a contact resists; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        count: Number of bodies.
        motions: The m motions at the nodes, shape (nodes, d, m).
        contact: The contact. It resists jumps along its normal, with friction all.

    Returns:
        Sums over all ranks, shape (bodies m, bodies m), body by body.
    """
    trace = contact.trace
    m = motions.shape[2]
    here = trace.here.nodes
    # The bodies of each node of the facets, and their motions as jumps.
    bodies = [body[here]]
    jumps = [motions[here]]
    if trace.there is not None:
        bodies.append(body[trace.partners])
        jumps.append(-motions[trace.partners])
    resisted = np.concatenate(jumps, axis=-1)
    if contact.friction is None:
        normal_part = np.einsum("fndi,fd->fni", resisted, contact.direction)
        resisted = normal_part[:, :, None]
    groups = np.stack(bodies, axis=-1).reshape(here.size, len(bodies))
    at_nodes = resisted.reshape(here.size, *resisted.shape[2:])
    total = np.zeros((count, m, count, m))
    for group in np.unique(groups, axis=0):
        of_group = at_nodes[(groups == group).all(axis=1)]
        products = np.einsum("ndi,ndj->ij", of_group, of_group)
        blocks = products.reshape(len(group), m, len(group), m)
        for i, one in enumerate(group):
            for j, other in enumerate(group):
                total[one, :, other] += blocks[i, :, j]
    return space.comm.allreduce(total.reshape(count * m, count * m), MPI.SUM)


def _block_diagonal(blocks: np.ndarray) -> np.ndarray:
    """Return a matrix of blocks (n, m, m) on its diagonal, shape (n m, n m)."""
    n, m, _ = blocks.shape
    matrix = np.zeros((n, m, n, m))
    matrix[range(n), :, range(n)] = blocks
    return matrix.reshape(n * m, n * m)


def _summed(space: Space, body: np.ndarray, count: int, resisted: np.ndarray) -> np.ndarray:
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


def _kernel(products: np.ndarray) -> np.ndarray:
    """Find the combinations of m motions that nothing resists, shape (m, free).

    Args:
        products: A matrix of :func:`_summed`, shape (m, m).
    """
    values, vectors = np.linalg.eigh(products)
    return vectors[:, values <= FREE_SHARE * max(values[-1], 1.0)]


def _check_all_held(
    space: Space, body: np.ndarray, count: int, by_all: np.ndarray, names: list[str]
) -> None:
    """Check that supports and contacts together resist all motions; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        count: Number of bodies.
        by_all: Products of the resisted motions of all bodies, shape (bodies m, bodies
            m).
        names: Names of the m motions.

    Raises:
        NotHeldError: If a motion is free.
    """
    kernel = _kernel(by_all)
    if kernel.shape[1] == 0:
        return
    # As many motions are told as are free: those with the greatest shares in them.
    shares = (kernel**2).sum(axis=1)
    greatest = np.sort(np.argsort(-shares, kind="stable")[: kernel.shape[1]])
    loose = []
    for number in np.unique(greatest // len(names)):
        of_body = greatest[greatest // len(names) == number] % len(names)
        message = ", ".join(names[i] for i in of_body)
        if count > 1:
            message += f" of the body with {_boundary_parts(space, body == number)}"
        loose.append(message)
    raise NotHeldError(
        f"Nothing holds the body against: {'; '.join(loose)} (no support, and contact"
        " cannot hold it). Add a Displacement (None leaves a component free), or friction."
    )


def _boundary_parts(space: Space, inside: np.ndarray) -> str:
    """List the boundary parts of a body for a message; collective.

    Args:
        space: The mesh.
        inside: Which nodes of this rank are of the body.
    """
    here = set()
    for name in space.domain.outer:
        cells = space.domain.facets(name)[:, 0]
        if inside[space.nodes[cells]].any():
            here.add(name)
    names = set().union(*space.comm.allgather(here))
    return ", ".join(map(repr, sorted(names))) if names else "no named boundary part"


def _rigid_motions(space: Space, body: np.ndarray, count: int) -> tuple[np.ndarray, list[str]]:
    """Compute rigid motions (nodes, d, m) at the nodes, and their names; collective.

    Rotations are about the centre of the body, and divided by its size.

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
    centre = sums[:, :-1] / sums[:, -1:]
    low = np.full((count, d), np.inf)
    high = np.full((count, d), -np.inf)
    np.minimum.at(low, body, x)
    np.maximum.at(high, body, x)
    space.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    space.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    size = np.linalg.norm(high - low, axis=1)
    motions = translations_and_rotations((x - centre[body]) / size[body, None])
    axes = "xyz"
    names = [f"translation in {axes[i]}" for i in range(d)]
    names += [f"rotation in the plane {axes[i]}{axes[j]}" for i, j in combinations(range(d), 2)]
    return motions, names
