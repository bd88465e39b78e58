"""Parts of the balance: other forces, weights, motions, facets with a uniform pressure.

Symbols: f facets, m number of coefficients of a facet, d dimension, K motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.cells import moments
from erc_contact.admissible.cones import Cones
from erc_contact.admissible.nearest import BalancePart
from erc_contact.admissible.shift import MOBILITY
from erc_contact.base.exceptions import NotHeldError
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.space import Space

SMALL_PRESSURE = 0.01
"""Traction of a facet that presses little, over the largest one of its contact [-]."""
SAME_MOTION = 1e-6
"""Jump of a motion that is round-off, over its largest one [-]."""
GIVE_OF_SIDES = 1e6
"""How much more than others the tractions between copies of a body change [-]."""
ACCEPTED_IMBALANCE = 1e-8
"""Imbalance that counts as none, over the forces [-].

1e-15 to 1e-11 remains where an allowed traction exists.
"""


@dataclass(frozen=True, eq=False)
class UnitJump:
    """Hold a jump of one contact alone, on which its tractions have a given work.

    Attributes:
        contact: The contact.
        direction: The jump, the same everywhere [-], shape (d,).
    """

    contact: ContactOnMesh
    direction: np.ndarray


type Motion = fem.Function | UnitJump
"""A motion of bodies, or a jump of one contact, on which tractions balance."""


def jump_of(contact: ContactOnMesh, motion: Motion) -> np.ndarray:
    """Return the jump of a motion at the nodes of a contact [-], shape (f, m, d)."""
    trace = contact.trace
    if isinstance(motion, fem.Function):
        return trace.of(motion.x.array)
    is_here = float(motion.contact.name == contact.name)
    return np.broadcast_to(is_here * motion.direction, (*trace.here.nodes.shape, trace.here.d))


@dataclass(frozen=True, eq=False)
class OtherForces:
    """Hold the forces that contact tractions have to balance.

    Attributes:
        motions: Rigid motions, Functions of V, and unit jumps of contacts.
        works: Work of the forces on them [force], shape (K,).
        stiffness: M, the stiffness of springs on them [force/length], shape (K, K).
        free: Combinations of the motions that no spring holds, shape (K, free).
        size: Sum of the sizes of the forces [force].
    """

    motions: list[Motion]
    works: np.ndarray
    stiffness: np.ndarray
    free: np.ndarray
    size: float


def weights_and_motions(
    space: Space, contact: ContactOnMesh, motions: Sequence[Motion]
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the weights of the nodes of a contact, and motions there.

    Returns:
        ``|F|/m`` of the facets that this rank owns, else 0, shape (f, 1), and the
        means of the motions at the nodes, shape (f, m, d, K), as :class:`BalancePart`
        has them.
    """
    trace = contact.trace
    area = trace.here.areas
    share = area / trace.here.nodes.shape[1]
    # A motion is linear: its values at the nodes are also its coefficients.
    by_motion = [moments(area, jump_of(contact, motion), space.degree) for motion in motions]
    weight = np.where(trace.here.owned, share, 0.0)[:, None]
    return weight, np.stack(by_motion, axis=-1) / share[:, None, None, None]


def spring_give(space: Space, contacts: list[ContactOnMesh], others: OtherForces) -> np.ndarray:
    """Compute D of :mod:`erc_contact.admissible.nearest` [area]; collective.

    The distance has the weight ``h/(kappa E)`` of :class:`Shift`, its mean here.

    Returns:
        Shape (K, K).
    """
    local = np.zeros(2)
    for contact in contacts:
        trace = contact.trace
        areas = trace.here.owned_areas
        local += (areas.sum(), areas @ trace.stiffness)
    area, force = space.comm.allreduce(local, MPI.SUM)
    return others.stiffness * (area / (MOBILITY * force))


def moduli(space: Space, contacts: list[ContactOnMesh]) -> list[np.ndarray]:
    """Return the moduli at the facets over their mean [-], shape (f,); collective."""
    local = np.zeros(2)
    for contact in contacts:
        areas = contact.trace.here.owned_areas
        local += (areas.sum(), areas @ contact.trace.modulus)
    area, total = space.comm.allreduce(local, MPI.SUM)
    # Between copies of a body the tractions are chosen anew: they take what they can.
    gives = [GIVE_OF_SIDES if contact.is_periodic else 1.0 for contact in contacts]
    return [
        contact.trace.modulus * (give * area / total)
        for contact, give in zip(contacts, gives, strict=True)
    ]


def ray_part(
    rays: np.ndarray,
    start: np.ndarray,
    weight: np.ndarray,
    motions: np.ndarray,
    modulus: np.ndarray,
) -> BalancePart:
    """Make the part of facets that have multiples >= 0 of given tractions.

    All nodes of a facet are one long vector. A cone without friction whose normal is
    opposite to this vector contains just its multiples.
    """
    f, m, d = rays.shape
    long = rays.reshape(f, 1, m * d)
    size = np.linalg.norm(long, axis=2, keepdims=True)
    unit = np.divide(-long, size, out=np.zeros_like(long), where=size > 0)
    none = np.zeros((f, 1))
    cones = Cones(unit, none, none, none > 0)
    start = start.reshape(f, 1, m * d)
    motions = motions.reshape(f, 1, m * d, motions.shape[-1])
    return BalancePart(cones, start, np.zeros_like(start), weight, motions, modulus)


class TooCoarse(NotHeldError):
    """Tell that facets are too large for a traction that balances the loads.

    The resultant of the contact forces is nearer to an edge of the contact than a
    traction on the facets there can have it.

    Attributes:
        cells: Cells of this rank at these facets, on both sides.
    """

    def __init__(self, message: str, cells: np.ndarray) -> None:
        super().__init__(message)
        self.cells = cells

    def __reduce__(self) -> tuple[type[TooCoarse], tuple[str, np.ndarray]]:
        """Return how it travels to other ranks."""
        return type(self), (str(self), self.cells)


def check_balance(
    space: Space,
    tractions: list[tuple[ContactOnMesh, np.ndarray]],
    others: OtherForces,
    imbalance: np.ndarray,
    forces: float,
) -> None:
    """Check that tractions balance the loads; collective.

    Args:
        space: The mesh.
        tractions: Each contact with its tractions (f, m, d) [force/area].
        others: The other forces.
        imbalance: Work on the motions that is left [force], shape (K,).
        forces: Size of the forces [force].

    Raises:
        TooCoarse: If they do not, on all ranks.
    """
    left = others.free @ (others.free.T @ imbalance)
    size = np.linalg.norm(left)
    if size <= ACCEPTED_IMBALANCE * forces:
        return
    raise TooCoarse(
        "No contact traction that the law allows, a polynomial on each facet, balances the "
        f"loads on a rigid motion that no support holds (imbalance {size / forces:.1e} of "
        "the forces). Look at the direction of the loads, add a Displacement or friction, or "
        "refine the mesh at the contact: adapt does so by itself and goes on, and by hand "
        "domain.refined(error.cells) refines the cells that press.",
        _cells_that_press(space, tractions, others.motions, left),
    )


def _cells_that_press(
    space: Space,
    tractions: list[tuple[ContactOnMesh, np.ndarray]],
    motions: Sequence[Motion],
    left: np.ndarray,
) -> np.ndarray:
    """Return the cells at facets that press unbalanced bodies; collective.

    Args:
        space: The mesh.
        tractions: As in :func:`too_coarse`.
        motions: The motions.
        left: Work on them that is left [force], shape (K,).
    """
    cells = []
    for contact, values in tractions:
        trace = contact.trace
        jumps = np.stack([jump_of(contact, motion) for motion in motions], axis=-1)
        jump = abs(jumps @ left).max(axis=(1, 2), initial=0.0)
        farthest = space.comm.allreduce(jump.max(initial=0.0), MPI.MAX)
        size = abs(values).max(axis=(1, 2), initial=0.0)
        most = space.comm.allreduce(size.max(initial=0.0), MPI.MAX)
        presses = (size > SMALL_PRESSURE * most) & (jump > SAME_MOTION * farthest)
        cells.append(trace.here.facets[presses, 0])
        cells.append(trace.there.facets[presses[trace.facing], 0])
    found = np.unique(np.concatenate(cells))
    return found[found < space.domain.owned_cells]
