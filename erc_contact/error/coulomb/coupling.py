"""The norm of the map from tangential to normal displacements of a contact surface.

It is computed by Lanczos' method. For a tangential field t on the surface, W v is the
displacement of least energy in the body that equals (t.v) n on the contacts: its
tangential part is zero there. In energy norms, over displacements v that vanish on the
supports,

    q = sup |W v| / |v|,        q^2 = largest eigenvalue of  F N,

with N the stiffness of normal displacements of the surface whose tangential part is
held, and F the tangential displacements, times t, under tangential forces t p of
densities p. Both are symmetric. Lanczos' method works in the inner product of N, and
needs one lifting and one displacement a step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from erc_contact.newton.linear.solver import Traces

LANCZOS_STEPS = 60
"""Greatest number of Lanczos steps; 8 to 20 are usual."""
WAVES = 20
"""Number of waves in the first vector.

It is also their greatest wave number times the size of the surface, more or less.
"""
LANCZOS_NOISE = 1e-6
"""Size of a next vector, over the eigenvalue, below which it is round-off [-]."""
NO_MOTION = 1e-6
"""Share of a rigid motion that is round-off [-]."""
RIGID_FORCE = 1e-6
"""Force of W v below which a rigid motion v is lifted to a rigid motion [-].

It is over the sum of the stiffnesses.
"""


class Coupling(NamedTuple):
    """Hold the norm of the map W.

    Attributes:
        q: The norm [-].
        raised: By how much the last step has raised it [-].
        displacement: Normal displacements that W makes of a v with this ratio, shape
            (n,).
    """

    q: float
    raised: float
    displacement: np.ndarray


def coupling(
    n: np.ndarray, traces: Traces, t: np.ndarray, x: np.ndarray, start: np.ndarray | None = None
) -> Coupling:
    """Compute the norm q for a field t at the nodes; collective.

    q is infinite if the body can move rigidly along the contact, and W does not make a
    rigid motion of that.

    Args:
        n: Normals at the nodes of the surface, shape (n, d).
        traces: The body as they see it.
        t: The field, shape (n, d).
        x: Positions of the nodes [length], shape (n, d).
        start: Normal displacements to start from, shape (n,); waves of all lengths by
            default.
    """
    if not np.any(t):
        return Coupling(0.0, 0.0, np.zeros(len(n)))
    resisted = _resisted_motion(n, traces, t, x)
    if resisted is not None:
        return Coupling(np.inf, 0.0, resisted)
    # N does not see them. They would grow from step to step, till round-off is all.
    unseen = _normal_motions(n, traces.motions)
    phi = _waves(x) if start is None else start
    basis: list[np.ndarray] = []
    forces: list[np.ndarray] = []
    diagonal: list[float] = []
    beside: list[float] = []
    q = before = 0.0
    for _ in range(min(LANCZOS_STEPS, len(n))):
        phi = phi - unseen @ (phi @ unseen)
        p = _normal_forces(n, traces, phi)
        square = float(phi @ p)
        # The space is exhausted: the next vector is round-off.
        if square <= (LANCZOS_NOISE * max(diagonal, default=0.0)) ** 2:
            break
        size = np.sqrt(square)
        if basis:
            beside.append(size)
        basis.append(phi / size)
        forces.append(p / size)
        phi = (traces.move(forces[-1][:, None] * t) * t).sum(axis=1)
        diagonal.append(float(phi @ forces[-1]))
        # Orthogonal to all before, twice because of round-off.
        for _ in range(2):
            for vector, force in zip(basis, forces, strict=True):
                phi = phi - (phi @ force) * vector
        tridiagonal = np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1)
        values, vectors = np.linalg.eigh(tridiagonal)
        before = q
        q = float(np.sqrt(max(values[-1], 0.0)))
        if q - before <= traces.tolerance * q:
            break
    if basis:
        phi = vectors[:, -1] @ basis[: len(vectors)]
    return Coupling(q, q - before, phi)


def _normal_motions(n: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """Return the free rigid motions that are normal to the contacts everywhere.

    So is a translation off a flat foundation.

    Args:
        n: Normals, shape (n, d).
        motions: The free motions at the nodes, shape (K, n, d).

    Returns:
        Orthonormal normal displacements, shape (n, r).
    """
    if not len(motions):
        return np.zeros((len(n), 0))
    along = np.einsum("kmi,mi->km", motions, n)
    beside = (motions - along[:, :, None] * n).reshape(len(motions), -1)
    rows, sizes, _ = np.linalg.svd(beside, full_matrices=False)
    least = NO_MOTION * np.linalg.norm(motions)
    is_normal = sizes <= least
    vectors, amounts, _ = np.linalg.svd(along.T @ rows[:, is_normal], full_matrices=False)
    return np.asarray(vectors[:, amounts > least])


def _normal_forces(n: np.ndarray, traces: Traces, phi: np.ndarray) -> np.ndarray:
    """Compute the normal forces of normal displacements phi (n,), N phi; collective."""
    return (traces.lift(phi[:, None] * n) * n).sum(axis=1)


def _resisted_motion(
    n: np.ndarray, traces: Traces, t: np.ndarray, x: np.ndarray
) -> np.ndarray | None:
    """Find a rigid motion that W does not make a rigid motion of; collective.

    Returns:
        Its image as normal displacements, shape (n,), or None if there is none.
    """
    if not len(traces.motions):
        return None
    waves = _waves(x)
    stiffness = np.linalg.norm(_normal_forces(n, traces, waves)) / np.linalg.norm(waves)
    for motion in traces.motions:
        phi = (t * motion).sum(axis=1)
        size = np.linalg.norm(phi)
        if size <= RIGID_FORCE * np.linalg.norm(t):
            continue
        if np.linalg.norm(_normal_forces(n, traces, phi)) > RIGID_FORCE * stiffness * size:
            return phi
    return None


def _waves(x: np.ndarray) -> np.ndarray:
    """Return a field (n,) that is orthogonal to nothing.

    It is the same for any order of the nodes x (n, d).
    """
    size = np.ptp(x, axis=0).max(initial=0.0) or 1.0
    centre = x.mean(axis=0)
    rng = np.random.default_rng(0)
    numbers = WAVES * rng.standard_normal((WAVES, x.shape[1]))
    phases = rng.uniform(0, 2 * np.pi, WAVES)
    return np.cos((x - centre) / size @ numbers.T + phases).sum(axis=1)
