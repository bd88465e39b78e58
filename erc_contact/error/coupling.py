"""The norm of the map from tangential to normal displacements of a contact surface, by Lanczos' method.

For a tangential field t on the surface, W v is the displacement of least energy in the
body that equals (t.v) n on the contacts: its tangential part is zero there. In energy
norms, over displacements v that vanish on the supports,

    q = sup |W v| / |v|,        q^2 = largest eigenvalue of  F N,

with N the stiffness of normal displacements of the surface whose tangential part is
held, and F the tangential displacements, times t, under tangential forces t p of
densities p. Both are symmetric. Lanczos' method works in the inner product of N, and
needs one lifting and one displacement a step.
"""

from __future__ import annotations

import numpy as np

from erc_contact.newton.linear.solver import Traces

STEPS = 60
"""Greatest number of Lanczos steps; 8 to 20 are usual."""
WAVES = 20
"""Number of waves in the first vector, and their greatest wave number times the size of the surface, more or less."""
NOISE = 1e-6
"""Size of a next vector, over the eigenvalue, below which it is round-off [-]."""
RIGID = 1e-6
"""Force of W v over the sum of the stiffnesses, below which a rigid motion v is lifted to a rigid motion [-]."""


def coupling(
    n: np.ndarray, traces: Traces, t: np.ndarray, x: np.ndarray, start: np.ndarray | None = None
) -> tuple[float, float, np.ndarray]:
    """The norm q for a field t at the nodes, and normal displacements that W makes of a v with this ratio; collective.

    q is infinite if the body can move rigidly along the contact, and W does not make a
    rigid motion of that.

    Args:
        n: Normals at the nodes of the surface, shape (M, d).
        traces: The body as they see it.
        t: The field, shape (M, d).
        x: Positions of the nodes [length], shape (M, d).
        start: Normal displacements to start from, shape (M,); waves of all lengths by
            default.

    Returns:
        q [-], by how much the last step has raised it, and normal displacements, shape
        (M,).
    """

    def stiffness(phi: np.ndarray) -> np.ndarray:
        return (traces.lifted(phi[:, None] * n) * n).sum(axis=1)

    if not np.any(t):
        return 0.0, 0.0, np.zeros(len(n))
    if len(traces.motions):
        scale = _waves(x)
        stiff = np.linalg.norm(stiffness(scale)) / np.linalg.norm(scale)
        for motion in traces.motions:
            phi = (t * motion).sum(axis=1)
            size = np.linalg.norm(phi)
            if (
                size > RIGID * np.linalg.norm(t)
                and np.linalg.norm(stiffness(phi)) > RIGID * stiff * size
            ):
                return np.inf, 0.0, phi
    phi = _waves(x) if start is None else start
    basis: list[np.ndarray] = []
    forces: list[np.ndarray] = []
    diagonal: list[float] = []
    beside: list[float] = []
    found = before = 0.0
    for _ in range(min(STEPS, len(n))):
        p = stiffness(phi)
        square = float(phi @ p)
        if square <= (NOISE * max(diagonal, default=0.0)) ** 2:
            break
        size = np.sqrt(square)
        if basis:
            beside.append(size)
        basis.append(phi / size)
        forces.append(p / size)
        phi = (traces.moved(forces[-1][:, None] * t) * t).sum(axis=1)
        diagonal.append(float(phi @ forces[-1]))
        for _ in range(2):
            for one, force in zip(basis, forces, strict=True):
                phi = phi - (phi @ force) * one
        values, vectors = np.linalg.eigh(
            np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1)
        )
        before, found = found, float(np.sqrt(max(values[-1], 0.0)))
        if found - before <= traces.tolerance * found:
            break
    return found, found - before, (vectors[:, -1] @ basis[: len(vectors)] if basis else phi)


def _waves(x: np.ndarray) -> np.ndarray:
    """A field (M,) that is orthogonal to nothing, the same for any order of the nodes x (M, d)."""
    size, centre = np.ptp(x, axis=0).max(initial=0.0) or 1.0, x.mean(axis=0)
    rng = np.random.default_rng(0)
    numbers, phases = (
        WAVES * rng.standard_normal((WAVES, x.shape[1])),
        rng.uniform(0, 2 * np.pi, WAVES),
    )
    return np.cos((x - centre) / size @ numbers.T + phases).sum(axis=1)
