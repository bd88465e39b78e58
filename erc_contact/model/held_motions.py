"""Find rigid motions that no support holds, and refuse motions that nothing holds.

A mesh may have several bodies, which share no node. Each body has its own rigid
motions, and each must be held.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.exceptions import NotHeldError
from erc_contact.base.releases import cell_nodes
from erc_contact.mesh.hinges import told, touching
from erc_contact.mesh.sides import boundary_sides
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.motions import block_diagonal, body_motions, kernel, motions_not_held, summed
from erc_contact.model.rigid_faces import RigidFace
from erc_contact.model.space import Space
from erc_contact.model.springs import BoundSpring

COINCIDENT = 2.0**-30
"""Distance of middles of facets that counts as none, over the extent [-]."""


def free_motions(
    space: Space,
    bodies: tuple[np.ndarray, int],
    fixed: np.ndarray,
    springs: Sequence[BoundSpring],
    contacts: Sequence[ContactOnMesh],
    faces: Sequence[RigidFace] = (),
) -> list[fem.Function]:
    """Find the rigid motions that no support or spring holds; collective.

    Each is of one body. The motions of a body are orthonormal combinations of its
    translations and of its rotations over its size.

    Args:
        space: The mesh.
        bodies: Body of each node, and number of bodies.
        fixed: Which components supports hold at a value at each node, shape (nodes, d).
        springs: The springs.
        contacts: The contacts, which may hold a motion, too.
        faces: The loose rigid faces, which resist their given motions.

    Returns:
        Functions of V.

    Raises:
        NotHeldError: If contacts do not hold one of them either.
    """
    body, count = bodies
    motions, names = body_motions(space, body, count)
    held = _held_by_supports(space, body, count, motions, fixed, faces)
    for spring in springs:
        nodes, resisted = spring.resisted(motions)
        held = held + summed(space, body[nodes], count, resisted)
    by_all = block_diagonal(held)
    for contact in contacts:
        by_all = by_all + _by_contact(space, body, count, motions, contact)
    _check_all_held(space, body, count, by_all, names)
    return motions_not_held(space, body, motions, held)


def unsupported_motions(
    space: Space,
    bodies: tuple[np.ndarray, int],
    fixed: np.ndarray,
    faces: Sequence[RigidFace] = (),
) -> list[fem.Function]:
    """Find the rigid motions that no support holds, but springs may; collective.

    See :func:`free_motions` for the motions and the arguments.
    """
    body, count = bodies
    motions, _ = body_motions(space, body, count)
    held = _held_by_supports(space, body, count, motions, fixed, faces)
    return motions_not_held(space, body, motions, held)


def _held_by_supports(
    space: Space,
    body: np.ndarray,
    count: int,
    motions: np.ndarray,
    fixed: np.ndarray,
    faces: Sequence[RigidFace],
) -> np.ndarray:
    """Sum up products of the motions that supports resist; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        count: Number of bodies.
        motions: The m motions at the nodes, shape (nodes, d, m).
        fixed: Which components supports hold at each node, shape (nodes, d).
        faces: The loose rigid faces.

    Returns:
        The sums over all ranks, shape (bodies, m, m).
    """
    owned = space.V.dofmap.index_map.size_local
    resisted = motions[:owned] * fixed[:owned, :, None]
    total = summed(space, body[:owned], count, resisted)
    for face in faces:
        number = face.body(body)
        of_face = (face.motion(motions) * face.sizes[:, None])[~face.free]
        total[number] += of_face.T @ of_face
    return total


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
    # The bodies of each node of the facets, and their motions as jumps.
    bodies = [body[here]]
    jumps = [motions[here]]
    if trace.there is not None:
        bodies.append(body[trace.partners])
        jumps.append(-motions[trace.partners])
    resisted = np.concatenate(jumps, axis=-1)
    if contact.friction is None:
        normals = np.broadcast_to(trace.normals, (*here.shape, trace.here.d))
        normal_part = np.einsum("fndi,fnd->fni", resisted, normals)
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
    free = kernel(by_all)
    if free.shape[1] == 0:
        return
    # As many motions are told as are free: those with the greatest shares in them.
    shares = (free**2).sum(axis=1)
    greatest = np.sort(np.argsort(-shares, kind="stable")[: free.shape[1]])
    loose = []
    for number in np.unique(greatest // len(names)):
        of_body = greatest[greatest // len(names) == number] % len(names)
        message = ", ".join(names[i] for i in of_body)
        if count > 1:
            message += f" of the body with {_boundary_parts(space, body == number)}"
        loose.append(message)
    message = (
        f"Nothing holds the body against: {'; '.join(loose)} (no support, and contact"
        " cannot hold it). Add a Displacement (None leaves a component free), or friction."
    )
    lying = lying_words(space, body, count)
    touching_words = f" {lying}" if lying else ""
    if not lying:
        touching_words = _hinges(space, body, np.unique(greatest // len(names)))
    raise NotHeldError(message + touching_words)


def lying_words(space: Space, body: np.ndarray, count: int) -> str:
    """Say where facets of two bodies coincide that are no pair; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        count: Number of bodies.

    Returns:
        Words with the number of facets and their middles; empty if there are none.
    """
    if count == 1:
        return ""
    middles, of_facet = _facets_near_other_bodies(space, body, count)
    # Files give equal points with the digits that they have.
    grain = COINCIDENT * space.domain.extent
    points, _ = touching(space.comm, np.round(middles / grain) * grain, of_facet)
    if len(points) == 0:
        return ""
    number = len(np.unique(points, axis=0))
    return (
        f"{number} facets of two bodies lie on each other without common nodes, with middles"
        f" {told(points, space.domain.extent)}: nothing passes from one body to the other there."
        " Merge the nodes where the mesh is made. For a contact, or a joint, give both bodies"
        " regions of their own, and make a pair of the two sides by domain.joined, for a Contact"
        " or Tied."
    )


def _facets_near_other_bodies(
    space: Space, body: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return middles of facets in the boxes around other bodies; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        count: Number of bodies.

    Returns:
        Middles [length], shape (n, d), and bodies, shape (n,), of facets of the
        boundary that this rank owns and that belong to no pair.
    """
    domain = space.domain
    paired = np.zeros(space.facet_count, dtype=bool)
    for sides in domain.paired_sides:
        paired[space.facet_numbers(sides)] = True
    facets = dmesh.exterior_facet_indices(space.mesh.topology)
    cells, local = boundary_sides(space.mesh, facets[~paired[facets]])
    middles = space.facet_corners(np.column_stack([cells, local])).mean(axis=1)
    of_facet = body[space.nodes[cells, 0]]
    low = np.full((count, space.d), np.inf)
    high = np.full((count, space.d), -np.inf)
    np.minimum.at(low, of_facet, middles)
    np.maximum.at(high, of_facet, middles)
    space.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    space.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    margin = 2.0 * COINCIDENT * domain.extent
    near = np.zeros(len(middles), dtype=bool)
    for number in range(count):
        inside = (middles >= low[number] - margin) & (middles <= high[number] + margin)
        near |= inside.all(axis=1) & (of_facet != number)
    return middles[near], of_facet[near]


def _hinges(space: Space, body: np.ndarray, loose: np.ndarray) -> str:
    """Say at which points loose bodies touch others without a facet; collective.

    Args:
        space: The mesh.
        body: Body of each node.
        loose: Numbers of the loose bodies.
    """
    domain = space.domain
    facing = np.zeros(len(body), dtype=bool)
    for sides in domain.paired_sides:
        facing[space.facet_nodes(sides)] = True
    nodes = space.vertices[: domain.owned_cells]
    alone = ~facing[nodes]
    geometry = space.mesh.geometry
    x = geometry.x[cell_nodes(geometry)[: domain.owned_cells][alone], : space.d]
    points, bodies = touching(space.comm, x, body[nodes[alone]])
    points = points[np.isin(bodies, loose)]
    if len(points) == 0:
        return ""
    return (
        f" It touches another body at {told(points, domain.extent)}: bodies that meet at vertices"
        " or edges alone, or without a Contact, transmit no force. Let them share facets (in gmsh:"
        " let them overlap, then fragment), or give them a Contact."
    )


def _boundary_parts(space: Space, inside: np.ndarray) -> str:
    """List the boundary parts of a body for a message; collective.

    Args:
        space: The mesh.
        inside: Which nodes of this rank are of the body.
    """
    domain = space.domain
    cells = {name: domain.facets(name)[:, 0] for name in domain.outer}
    parts = _on_body(space, inside, cells)
    if parts:
        return ", ".join(map(repr, parts))
    regions = _on_body(space, inside, {name: domain.region(name) for name in domain.regions})
    if regions:
        return f"the region {', '.join(map(repr, regions))}"
    return "no named boundary part"


def _on_body(space: Space, inside: np.ndarray, cells: dict[str, np.ndarray]) -> list[str]:
    """List the names whose cells have a node of a body; collective.

    Args:
        space: The mesh.
        inside: Which nodes of this rank are of the body.
        cells: Cells of each name.
    """
    here = {name for name, of_name in cells.items() if inside[space.nodes[of_name]].any()}
    return sorted(set().union(*space.comm.allgather(here)))
