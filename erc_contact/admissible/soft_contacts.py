"""Contacts that something soft holds: their tractions keep resultant and moments.

The traction r^ is near the contact forces of the method, but its resultant and moments
on a contact differ a little. What holds the body takes up the difference s: a support,
a spring, a soft part of the body, a slender body in bending. The softer this is, the
more it adds to the bulk part of e^2: ``s.c`` with the rigid part c of the displacement
w that s causes. Where this is a large part of e^2, r^ is made again so that it has the
resultants of the method, as far as the law allows. They are weighed against the
distance, see :mod:`erc_contact.admissible.nearest`, with the stiffness ``s.c/c^2``.

Symbols: r^ contact traction on the body, K rigid motions of a contact, d dimension.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.balance_parts import OtherForces, weights_and_motions
from erc_contact.admissible.rebalance import Rebalanced
from erc_contact.admissible.traction import ContactTraction
from erc_contact.model.model import Model
from erc_contact.model.motions.rigid_motions import block_diagonal
from erc_contact.model.motions.rigid_shapes import translations_and_rotations
from erc_contact.model.space import Space
from namedmesh.base.ranks import box

SOFT_SHARE = 0.15
"""Share of the bulk part of e^2 from which resultants are kept [-].

Below it the energies say that they lower e by 8% at most.
"""


def with_soft_contacts(
    model: Model,
    others: OtherForces,
    tractions: list[ContactTraction],
    balanced: Rebalanced,
    bulk: float,
) -> OtherForces | None:
    """Add the motions of softly held contacts to what r^ balances; collective.

    Args:
        model: The scene on a mesh.
        others: What r^ has balanced so far.
        tractions: r^ so far.
        balanced: The stress in equilibrium with them.
        bulk: Bound of the bulk part of e^2 so far [force length].

    Returns:
        What r^ has to balance, or None where nothing soft holds a contact.
    """
    if balanced.missing is None or balanced.change is None:
        return None
    comm = model.space.comm
    local_work = float(balanced.missing.x.array @ balanced.change.x.array)
    if comm.allreduce(local_work, MPI.SUM) <= SOFT_SHARE * bulk:
        return None
    motions: list[fem.Function] = []
    missing: list[np.ndarray] = []
    blocks = [others.stiffness]
    for traction in tractions:
        of_contact = _motions_of(model, traction)
        if not of_contact:
            continue
        local = [balanced.missing.x.array @ motion.x.array for motion in of_contact]
        left = comm.allreduce(np.array(local), MPI.SUM)
        moved = _rigid_part(model.space, traction, of_contact, balanced.change)
        energy = float(left @ moved)
        if energy > SOFT_SHARE * bulk:
            motions += of_contact
            missing.append(left)
            blocks.append(energy / float(moved @ moved) * np.eye(len(of_contact)))
    if not motions:
        return None
    # What is missing is the work of r^ and of all other forces together.
    works = np.concatenate(missing) - _works_of(model.space, tractions, motions)
    free = np.zeros((len(others.motions) + len(motions), others.free.shape[1]))
    free[: len(others.motions)] = others.free
    return OtherForces(
        [*others.motions, *motions],
        np.concatenate([others.works, works]),
        block_diagonal(blocks),
        free,
        others.size,
    )


def _motions_of(model: Model, traction: ContactTraction) -> list[fem.Function]:
    """Make rigid motions of the nodes of facets with traction; collective.

    They are zero elsewhere, so r^ stays zero where nothing is transmitted, and on
    components that supports fix. Rotations are about the middle of the nodes, and
    divided by their extent. A contact that is open everywhere has none.
    """
    space = model.space
    comm, d = space.comm, space.d
    acts = traction.values.any(axis=(1, 2))
    nodes = np.unique(traction.nodes[acts])
    x = space.V.tabulate_dof_coordinates()[nodes, :d]
    low, high = box(comm, x)
    if not np.isfinite(low).all():
        return []  # nothing is transmitted
    size = float(np.linalg.norm(high - low))
    shapes = translations_and_rotations((x - (low + high) / 2) / size)
    free = ~model.fixed[nodes]
    motions = []
    for number in range(shapes.shape[2]):
        motion = space.function()
        motion.x.array.reshape(-1, d)[nodes] = free * shapes[:, :, number]
        # A rank may not have all facets of a node that is another one's.
        motion.x.scatter_forward()
        motions.append(motion)
    return motions


def _rigid_part(
    space: Space, traction: ContactTraction, motions: list[fem.Function], w: fem.Function
) -> np.ndarray:
    """Fit rigid motions to the displacement of a contact [length]; collective.

    The fit is by least squares, with the tractions as weights: where nothing is
    transmitted, another part of the body may move otherwise. Shape (K,).
    """
    trace = traction.contact.trace
    owned = trace.here.owned
    weight = (traction.area[:, None] * np.linalg.norm(traction.values, axis=2))[owned]
    jump = trace.of(w.x.array)[owned]
    shapes = np.stack([trace.of(motion.x.array)[owned] for motion in motions])
    weighted = weight[..., None] * shapes
    products = np.einsum("kfmi,lfmi->kl", weighted, shapes)
    right = np.einsum("kfmi,fmi->k", weighted, jump)
    total = space.comm.allreduce(np.column_stack([products, right]), MPI.SUM)
    return np.linalg.lstsq(total[:, :-1], total[:, -1], rcond=None)[0]


def _works_of(
    space: Space, tractions: list[ContactTraction], motions: list[fem.Function]
) -> np.ndarray:
    """Compute the works of tractions on motions [force], shape (K,); collective."""
    total = np.zeros(len(motions))
    for traction in tractions:
        weight, shapes = weights_and_motions(space, traction.contact, motions)
        forces = weight[..., None] * traction.values
        total += np.einsum("fmi,fmik->k", forces, shapes)
    return space.comm.allreduce(total, MPI.SUM)
