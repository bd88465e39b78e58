"""Move bodies apart in pictures, as far as they are apart; on rank 0.

Two bodies that face each other may have their meshes at the same place, and a gap g
between them is data. Their pictures show it, and magnify it as the displacement is:
points are drawn at X + s u^ + a, where the shifts a of facing points differ by s g
along the normal. So facing points are drawn s (g - w^_n) apart: a closed contact looks
closed and no body enters another one, whatever s is. Where bodies are drawn apart, the
shifts give what their distance lacks of s g.

The side with the name of the contact is moved, with all that is behind it, as a rigid
body. The shift is the one of a foundation with this gap
(:mod:`erc_contact.output.foundations`). What a rigid motion cannot do, because the gap
varies, or a support holds the body at rest, is a recess in this side: it fades out
inside the body, and no element is turned inside out by it.

Symbols: X position before the deformation, s magnification, u^ admissible displacement,
w^ its jump, w^_n = w^ . n, n normal from this side into the other, d dimension.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from erc_contact.output.gathered import WholeContact, is_symmetry, mean_normal
from namedmesh.for_solvers import closest, components, in_space

FADING = 3.0
"""Depth in which a recess fades out, over its greatest depth at the surface [-]."""
STILL = 1e-3
"""Share of a rigid motion that counts as none [-]."""
SAME_NORMALS = 0.01
"""Share of the squares of normals at a node below which they are one normal [-].

Two normals with an angle of 0.2 between them have this share.
"""


def pairs_of(contacts: Sequence[WholeContact]) -> list[WholeContact]:
    """Return the contacts that are between two bodies, which are no copies."""
    pairs = [contact for contact in contacts if len(contact.partners) > 0]
    return [pair for pair in pairs if not is_symmetry(pair)]


def bodies_of(body: Mapping[str, np.ndarray]) -> np.ndarray:
    """Number the bodies that cells connect, at each node, shape (n,)."""
    return components(len(body["points"]), _links(body["cells"]))


def greatest_gap(contacts: Sequence[WholeContact]) -> float:
    """Return the greatest absolute gap between two bodies that is data [length]."""
    return max((float(abs(pair.gap).max()) for pair in pairs_of(contacts)), default=0.0)


def greatest_share(body: Mapping[str, np.ndarray], pairs: Sequence[WholeContact]) -> float:
    """Compute the greatest of what is magnified over the size of its body [-].

    A small body must stay what it is beside a large one. So the deformation of each
    body counts, without its rigid motion, and gap and jump between two of them.

    Args:
        body: The mesh, with u^ at its nodes in "u", shape (n, 3).
        pairs: Contacts between two bodies.
    """
    points = body["points"]
    label = bodies_of(body)
    size = np.zeros(len(points))
    shares = []
    for number in np.unique(label):
        here = label == number
        size[here] = np.linalg.norm(np.ptp(points[here], axis=0))
        deformed = _without_rigid_motion(points[here], body["u"][here])
        shares.append(float(np.linalg.norm(deformed, axis=1).max() / size[here].max()))
    for pair in pairs:
        nodes = pair.traction.nodes
        jump = np.linalg.norm(body["u"][nodes] - body["u"][pair.partners], axis=-1)
        smaller = np.minimum(size[nodes], size[pair.partners])
        shares.append(float((np.maximum(jump, abs(pair.gap)) / smaller).max()))
    return max(shares)


def _without_rigid_motion(points: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Take the nearest rigid motion from the displacement of a body (n, 3) [length]."""
    arms = points - points.mean(axis=0)
    # Turns are those about the three axes; in the plane two of them do nothing to x, y.
    motions = [np.broadcast_to(axis, arms.shape) for axis in np.eye(3)]
    motions += [np.cross(axis, arms) for axis in np.eye(3)]
    columns = np.stack([motion.ravel() for motion in motions], axis=1)
    parts = np.linalg.lstsq(columns, u.ravel())[0]
    return u - (columns @ parts).reshape(u.shape)


def shifts(
    body: Mapping[str, np.ndarray],
    pairs: Sequence[WholeContact],
    motions: Sequence[Callable[[np.ndarray], np.ndarray]],
    factor: float,
    pull: float,
) -> np.ndarray:
    """Compute the shifts of the nodes with which bodies are drawn apart [length].

    Args:
        body: The mesh, from :func:`erc_contact.output.gathered.body_nodes`, and in
            "still" which components supports hold at zero, shape (n, 3).
        pairs: Contacts between two bodies.
        motions: The rigid motion of each that makes room for its gap, see
            :meth:`erc_contact.output.foundations.MovingFoundation.motion`.
        factor: Magnification of the displacement and of gaps [-].
        pull: Distance by which the bodies of each pair are pulled apart beside, as
            rigid ones [length].

    Returns:
        The shifts, shape (n, 3).
    """
    points = body["points"]
    shift = np.zeros_like(points)
    pulled = np.zeros_like(points)
    for pair, motion in zip(pairs, motions, strict=True):
        behind = _behind(body, pair, pairs)
        pulled[behind] -= pull * in_space(mean_normal(pair)[None])
        if pair.gap.any():
            away = in_space(motion(points[behind, : pair.d]))
            # A symmetry plane that turned would be no picture of the body. The least
            # clearance is no deformation: body and supports are that far away. An
            # interference deforms a body between supports.
            if not _keeps_still(away, body["still"][behind]):
                away = max(pair.gap.min(), 0.0) * in_space(mean_normal(pair)[None])
            shift[behind] -= factor * away
    for pair in pairs:
        if pair.gap.any():
            shift += _recess(body, pairs, pair, _depth(pair, shift, factor))
    return shift + pulled


def _keeps_still(motion: np.ndarray, still: np.ndarray) -> bool:
    """Tell whether a rigid motion leaves components at rest that supports hold there.

    Args:
        motion: The motion at nodes [length], shape (n, 3).
        still: Which components supports hold at zero, shape (n, 3).
    """
    moved = abs(motion[still]).max(initial=0.0)
    return bool(moved <= STILL * abs(motion).max(initial=0.0))


def _behind(
    body: Mapping[str, np.ndarray], pair: WholeContact, pairs: Sequence[WholeContact]
) -> np.ndarray:
    """Tell which nodes move with this side of a pair, shape (n,).

    They are the nodes of its bodies and of all bodies that touch these elsewhere. There
    are none if the other side would move, too.
    """
    links = [_links(body["cells"])]
    for contact in pairs:
        if contact is not pair:
            facing = [contact.traction.nodes.ravel(), contact.partners.ravel()]
            links.append(np.column_stack(facing))
    label = components(len(body["points"]), np.concatenate(links))
    here = np.isin(label, label[pair.traction.nodes])
    if here[pair.partners].any():
        return np.zeros_like(here)
    return here


def _links(cells: np.ndarray) -> np.ndarray:
    """Link the first node of each cell to all its nodes, shape (cells N, 2)."""
    first = np.repeat(cells[:, 0], cells.shape[1])
    return np.column_stack([first, cells.ravel()])


def _depth(pair: WholeContact, shift: np.ndarray, factor: float) -> np.ndarray:
    """Compute what shifts leave of the gap at the nodes of this side [length].

    Its shape is (f, m).
    """
    n = in_space(pair.traction.contact.direction)[:, None]
    apart = shift[pair.partners] - shift[pair.traction.nodes]
    return factor * pair.gap - (apart * n).sum(axis=-1)


def _recess(
    body: Mapping[str, np.ndarray],
    pairs: Sequence[WholeContact],
    pair: WholeContact,
    depth: np.ndarray,
) -> np.ndarray:
    """Compute the shifts of a recess in this side of a pair [length], shape (n, 3).

    Args:
        body: The mesh.
        pairs: All pairs. The other nodes of their contacts stay where they are.
        pair: The pair.
        depth: Depth of the recess at the nodes of its facets [length], shape (f, m).
    """
    points = body["points"]
    nodes = pair.traction.nodes
    recess = _at_nodes(pair, depth, len(points))
    # Inside the body a recess is the less deep the farther its surface is.
    reach = FADING * float(np.linalg.norm(recess, axis=1).max())
    label = bodies_of(body)
    inside = np.isin(label, label[nodes])
    for contact in pairs:
        inside[contact.traction.nodes] = False
        inside[contact.partners] = False
    corners = pair.x[:, : pair.d, : pair.d]
    low = corners.min(axis=(0, 1)) - reach
    high = corners.max(axis=(0, 1)) + reach
    x = points[:, : pair.d]
    inside &= ((x > low) & (x < high)).all(axis=1)
    facet, local, distance = closest(x[inside], corners)
    feet = np.einsum("nv,nvi->ni", local, corners[facet])
    # Parts of a body beyond the other side are not behind the contact.
    direction = pair.traction.contact.direction[facet]
    is_behind = ((x[inside] - feet) * direction).sum(axis=1) < 0
    share = np.where(is_behind & (distance < reach), 1 - distance / (reach or 1.0), 0.0)
    at_feet = np.einsum("nv,nvi->ni", local, recess[nodes[facet, : pair.d]])
    recess[inside] = share[:, None] * at_feet
    return recess


def _at_nodes(pair: WholeContact, depth: np.ndarray, count: int) -> np.ndarray:
    """Find the shifts of nodes that have a depth along the normals of their facets.

    At a corner they have the depth along the normals of all its facets, or nearly so
    where these are many.

    Args:
        pair: The pair.
        depth: Depth at the nodes of each facet [length], shape (f, m).
        count: Number of nodes of the mesh.

    Returns:
        Shifts [length], shape (count, 3), zero at other nodes.
    """
    nodes, place = np.unique(pair.traction.nodes, return_inverse=True)
    place = place.reshape(depth.shape)
    n = np.broadcast_to(in_space(pair.traction.contact.direction)[:, None], (*depth.shape, 3))
    normals = np.zeros((len(nodes), 3, 3))
    np.add.at(normals, place, n[..., :, None] * n[..., None, :])
    depths = np.zeros((len(nodes), 3))
    np.add.at(depths, place, depth[..., None] * n)
    # Normals that differ little are one: a small depth must not move a node far.
    inverse = np.linalg.pinv(normals, rcond=SAME_NORMALS, hermitian=True)
    shift = np.zeros((count, 3))
    shift[nodes] = -np.einsum("nij,nj->ni", inverse, depths)
    return shift
