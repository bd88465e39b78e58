"""Find rigid motions that no support holds, and what holds them.

A mesh may have several bodies, which share no node. Each body has its own rigid
motions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.motions.rigid_faces import RigidFace
from erc_contact.model.motions.rigid_motions import kernel, sum_products
from erc_contact.model.space import Space
from erc_contact.model.springs import BoundSpring
from namedmesh.simplex import barycentric, lagrange, nodes


def resisted_by_all(
    space: Space,
    bodies: tuple[np.ndarray, int],
    motions: np.ndarray,
    held: np.ndarray,
    contacts: Sequence[ContactOnMesh],
) -> np.ndarray:
    """Sum up products of the m motions of bodies that anything resists; collective.

    Args:
        space: The mesh.
        bodies: Body of each node, and number of bodies.
        motions: The motions at the nodes, shape (nodes, d, m).
        held: Products of :func:`held_products`.
        contacts: The contacts. They resist motions along their normals, with friction
            all motions.

    Returns:
        The sums over all ranks, shape (bodies m, bodies m), body by body.
    """
    body, count = bodies
    every = np.arange(count)
    m = motions.shape[2]
    of_bodies = np.zeros((count, m, count, m))
    of_bodies[every, :, every] = held
    by_all = of_bodies.reshape(count * m, count * m)
    for contact in contacts:
        by_all += _by_contact(space, body, count, motions, contact)
    return by_all


def loose_motions(
    space: Space,
    bodies: tuple[np.ndarray, int],
    motions: np.ndarray,
    held: np.ndarray,
    contacts: Sequence[ContactOnMesh],
) -> list[np.ndarray]:
    """Return the motions of each body that contacts alone hold, one way; collective.

    The arguments are the arguments of :func:`resisted_by_all`. Contacts that cannot
    open hold bodies as supports do.

    Returns:
        Combinations of the m motions of each body, shape (m, K).
    """
    _, count = bodies
    every = np.arange(count)
    m = motions.shape[2]
    bilateral = [contact for contact in contacts if contact.bilateral]
    by_all = resisted_by_all(space, bodies, motions, held, bilateral)
    of_bodies = by_all.reshape(count, m, count, m)[every, :, every]
    return [kernel(products) for products in of_bodies]


def held_products(
    space: Space,
    bodies: tuple[np.ndarray, int],
    motions: np.ndarray,
    fixed: np.ndarray,
    springs: Sequence[BoundSpring] = (),
    faces: Sequence[RigidFace] = (),
) -> np.ndarray:
    """Sum up products of the m motions that supports and springs resist; collective.

    Args:
        space: The mesh.
        bodies: Body of each node, and number of bodies.
        motions: The motions at the nodes, shape (nodes, d, m).
        fixed: Which components are held at a value at each node, shape (nodes, d).
        springs: The springs; springs that are left out hold nothing.
        faces: The loose rigid faces, which resist their given motions.

    Returns:
        The sums over all ranks, shape (bodies, m, m).
    """
    body, count = bodies
    owned = space.V.dofmap.index_map.size_local
    by_supports = motions[:owned] * fixed[:owned, :, None]
    held = sum_products(space, body[:owned], count, by_supports)
    for face in faces:
        number = face.body(body)
        of_face = (face.motion(motions) * face.sizes[:, None])[~face.free]
        held[number] += of_face.T @ of_face
    for spring in springs:
        nodes, by_spring = spring.resist(motions)
        held += sum_products(space, body[nodes], count, by_spring)
    return held


def _by_contact(
    space: Space, body: np.ndarray, count: int, motions: np.ndarray, contact: ContactOnMesh
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
    # The bodies of each node of the facets, and their motions as jumps. The foundation
    # is the last body, which has no motions.
    bodies = np.stack([body[here], np.full(here.shape, count)], axis=-1)
    bodies[trace.facing, :, 1] = body[trace.partners]
    jumps = np.zeros((*here.shape, trace.here.d, 2, m))
    jumps[..., 0, :] = motions[here]
    of_partners = trace.seen(motions[trace.partners].swapaxes(-1, -2)).swapaxes(-1, -2)
    jumps[trace.facing, ..., 1, :] = -of_partners
    resisted = jumps.reshape(*here.shape, trace.here.d, 2 * m)
    if contact.friction is None:
        normals = trace.normals
        if contact.given_normal is not None:
            # On vertices beside the true surface, normals that a scene gives resist
            # between the nodes what they let pass at the nodes.
            between = nodes(trace.here.d - 1, 2 * trace.here.degree)
            shape = lagrange(trace.here.d - 1, trace.here.degree, between)
            resisted = np.einsum("qn,fndi->fqdi", shape, resisted)
            normals = trace.normals_at_places(barycentric(between))
            bodies = np.repeat(bodies[:, :1], len(between), axis=1)
        normals = np.broadcast_to(normals, resisted.shape[:-1])
        normal_part = np.einsum("fndi,fnd->fni", resisted, normals)
        resisted = normal_part[:, :, None]
    groups = bodies.reshape(-1, 2)
    at_nodes = resisted.reshape(-1, *resisted.shape[2:])
    total = np.zeros((count + 1, m, count + 1, m))
    for group in np.unique(groups, axis=0):
        of_group = at_nodes[(groups == group).all(axis=1)]
        products = np.einsum("ndi,ndj->ij", of_group, of_group)
        blocks = products.reshape(2, m, 2, m)
        for i, row_body in enumerate(group):
            for j, column_body in enumerate(group):
                total[row_body, :, column_body] += blocks[i, :, j]
    of_bodies = total[:count, :, :count].reshape(count * m, count * m)
    return space.comm.allreduce(of_bodies, MPI.SUM)
