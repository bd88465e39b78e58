"""Tractions of springs, and the error in their law.

The error of a traction t^ in the law ``t = -K u`` of springs is

    int (t^ + K u^) . K^-1 (t^ + K u^).

It belongs to the bulk part of e^2, as the energy of the springs belongs to the energy
of the body. Let u_r be the displacement that balances all other tractions. Soft springs
have ``t^ = -K u_r``, a polynomial of degree k on each facet, without error where u^ is
u_r. A stiff spring is nearly a support: any traction costs little there, and the one
that is best for sigma^ is chosen as on supports.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.cells import CellGeometry, add_moments, moments, tractions_of
from erc_contact.model.model import Model
from erc_contact.model.motions.rigid_motions import kernel
from erc_contact.model.springs import BoundSpring
from namedmesh.simplex import bernstein, coefficients, rule

AXIS = 1e-9
"""Difference of a component of a normal to 0 or 1 that counts as none [-]."""
STIFF = 1.0
"""Least stiffness of a stiff spring over the stiffness of its cell, ``K h/E`` [-].

On a block on 16 x 8 squares, held at its base and by springs at a side, this lowered
eps from 8.8% to 8.0% where the ratio is 1.25, and from 16.3% to the 10.2% of a rigid
support where it is 1e5. With 0.2 eps of degree 2 was 8% larger at a ratio of 0.4.
"""


def spring_tractions(model: Model, u: fem.Function) -> list[np.ndarray]:
    """Return ``-K u`` on each part with springs [force/area], shapes (f, m, d).

    They are Bernstein coefficients.
    """
    return [-spring.pull(u.x.array) for spring in model.springs]


def stiff_components(spring: BoundSpring) -> np.ndarray:
    """Tell which components of the tractions of springs are chosen as on supports.

    A component of a facet across an axis is normal or tangential; on other facets it is
    both.

    Returns:
        Booleans, shape (f, d).
    """
    side = spring.side
    of_cell = STIFF * side.stiffness
    is_normal = abs(spring.direction) > 1 - AXIS
    is_tangential = abs(spring.direction) < AXIS
    normal_stiff = spring.is_stiffer(spring.normal, of_cell)[:, None]
    tangential_stiff = spring.is_stiffer(spring.tangential, of_cell)[:, None]
    return (normal_stiff | is_tangential) & (tangential_stiff | is_normal)


def chosen_tractions(
    model: Model, loads: np.ndarray, facet_moments: np.ndarray
) -> list[np.ndarray]:
    """Return t^ on each part with springs from the moments of sigma^ n [force/area].

    Args:
        model: The scene on a mesh.
        loads: Moments of the loads on all facets [force], shape (facets, m, d).
        facet_moments: Moments of all tractions [force], likewise.

    Returns:
        Bernstein coefficients, shape (f, m, d) each.
    """
    of_springs = facet_moments - loads
    return [tractions_of(model.space, of_springs, spring.side.facets) for spring in model.springs]


def spring_moments(model: Model, tractions: list[np.ndarray]) -> np.ndarray:
    """Compute the moments of tractions of springs on all facets [force].

    Returns:
        Shape (facets, m, d).
    """
    space = model.space
    total = np.zeros((space.facet_count, len(space.facet_points), space.d))
    for spring, t in zip(model.springs, tractions, strict=True):
        moment = moments(spring.side.areas, t, space.degree)
        add_moments(space, total, spring.side.facets, moment)
    return total


def spring_stiffness(model: Model, motions: list[fem.Function]) -> np.ndarray:
    """Compute ``int K m_k . m_l`` for K motions [force/length]; collective.

    Returns:
        Shape (K, K), zero without springs.
    """
    total = np.zeros((len(motions), len(motions)))
    if not model.springs or not motions:
        return total
    for spring in model.springs:
        side = spring.side
        owned = side.owned
        pulls = [moments(side.areas, spring.pull(m.x.array), model.space.degree) for m in motions]
        # A motion is linear: its values at the nodes of a facet are its coefficients.
        values = [m.x.array.reshape(-1, model.space.d)[side.nodes] for m in motions]
        by_facets = np.stack(pulls)[:, owned]
        of_motions = np.stack(values)[:, owned]
        total += np.einsum("kfmi,lfmi->kl", by_facets, of_motions)
    return model.space.comm.allreduce(total, MPI.SUM)


def motions_off_springs(model: Model, motions: list[fem.Function]) -> np.ndarray:
    """Find combinations of K motions that springs do not resist; collective.

    Returns:
        Shape (K, combinations).
    """
    if not model.springs or not motions:
        return np.eye(len(motions))
    total = np.zeros((len(motions), len(motions)))
    at_nodes = np.stack([m.x.array.reshape(-1, model.space.d) for m in motions], axis=-1)
    for spring in model.springs:
        _, resisted = spring.resist(at_nodes)
        total += np.einsum("ndk,ndl->kl", resisted, resisted)
    return kernel(model.space.comm.allreduce(total, MPI.SUM))


def spring_squares(
    model: Model, u: fem.Function, tractions: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the squares of difference and sum of both tractions of springs.

    These are ``t^ + K u^`` and ``t^ - K u^``.

    Args:
        model: The scene on a mesh.
        u: u^ [length].
        tractions: t^ on each part with springs.

    Returns:
        The squares on each owned cell [force length].
    """
    space = model.space
    result = np.zeros((2, model.domain.owned_cells))
    points, weights = rule(space.d - 1, space.section.rule_degree(2 * space.degree))
    shape = bernstein(space.d - 1, space.degree, points)
    for spring, t in zip(model.springs, tractions, strict=True):
        owned = spring.side.owned
        cells = spring.side.facets[owned, 0]
        pull = spring.pull_at(u.x.array, points)
        at_points = np.matmul(shape, t)
        for total, traction in zip(result, (at_points + pull, at_points - pull), strict=True):
            means = spring.squares(traction, points) @ weights
            np.add.at(total, cells, (means * spring.side.areas)[owned])
    return result[0], result[1]


def spring_work(model: Model, v: fem.Function, tractions: list[np.ndarray]) -> float:
    """Compute the work ``-int t^ . v`` on the springs of this rank [force length].

    Args:
        model: The scene on a mesh.
        v: A displacement [length].
        tractions: t^ on each part with springs.
    """
    space = model.space
    work = 0.0
    for spring, t in zip(model.springs, tractions, strict=True):
        side = spring.side
        nodal = v.x.array.reshape(-1, space.d)[side.nodes]
        of_v = np.matmul(coefficients(space.d - 1, space.degree), nodal)
        of_facets = (moments(side.areas, t, space.degree) * of_v).sum(axis=(1, 2))
        work -= float(of_facets[side.owned].sum())
    return work


def supported_components(model: Model, cells: CellGeometry) -> np.ndarray:
    """Tell which components of a facet may have any traction, shape (facets, d).

    A support, or a stiff spring, holds them.
    """
    fixed = np.zeros((cells.side.shape[1], cells.d), dtype=bool)
    for facets, components in model.fixed_facets:
        fixed[model.space.facet_numbers(facets)] |= components
    for spring in model.springs:
        fixed[model.space.facet_numbers(spring.side.facets)] |= stiff_components(spring)
    return fixed
