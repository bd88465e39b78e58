"""Balance of contact tractions on free motions.

Convex sets, motions and loads at random, no mesh.

- loads that some allowed traction balances are balanced, to round-off of the forces, by
  allowed tractions, however near to the limit of the sets they are and however far slip
  and opening draw the tractions;
- of those that balance, the nearest ones are found: none that are known to balance lie
  nearer;
- loads that nothing balances leave an imbalance of the order of the forces;
- what springs take up is weighed against the distance: soft ones get what is left of
  the balance, stiff ones all of it.
"""

import numpy as np
import pytest
from mpi4py import MPI

from erc_contact.admissible.balance import balance
from erc_contact.admissible.cones import Cones
from erc_contact.admissible.nearest import BalancePart

pytestmark = pytest.mark.serial


def vectors(rng: np.random.Generator, n: np.ndarray, m: int) -> np.ndarray:
    """Tangential unit vectors (f, m, d), all in one direction or each in its own."""
    shape = (*n.shape[:1], m, n.shape[-1])
    t = (
        rng.standard_normal(shape)
        if rng.random() < 0.5
        else np.broadcast_to(rng.standard_normal(shape[-1]), shape)
    )
    t = t - (t * n).sum(axis=-1, keepdims=True) * n
    return t / np.linalg.norm(t, axis=-1, keepdims=True)


def problem(
    seed: int, d: int, inside: float, few: float
) -> tuple[BalancePart, np.ndarray, np.ndarray]:
    """A contact, loads, and tractions that balance them.

    On the surface of their sets but for a share ``inside``.
    """
    rng = np.random.default_rng([seed, d, int(1e6 * inside), int(10 * few)])
    f, m = int(rng.choice([2, 4, 16, 64])), int(rng.choice([d, 3 * (d - 1)]))
    scale = 10.0 ** rng.uniform(-9, 9)
    n = np.tile(-np.eye(d)[-1], (f, 1)) if rng.random() < 0.7 else rng.standard_normal((f, d))
    n = (n / np.linalg.norm(n, axis=1)[:, None])[:, None]
    x = rng.uniform(-0.5, 0.5, (f, m, d))
    x[..., -1] = 0.01 * x[..., -1] - 0.5
    pairs = [(i, j) for i in range(d) for j in range(i)]
    motions = np.zeros((f, m, d, d + len(pairs)))
    motions[..., range(d), range(d)] = 1.0
    for k, (i, j) in enumerate(pairs, start=d):
        motions[..., i, k], motions[..., j, k] = -x[..., j], x[..., i]
    motions = motions[
        ..., rng.permutation(motions.shape[-1])[: rng.integers(1, motions.shape[-1] + 1)]
    ]
    slope = np.full((f, m), rng.choice([0.0, 0.01, 0.3, 1.0, 2.0])) * (
        1 if rng.random() < 0.7 else rng.random((f, m))
    )
    offset = scale * rng.random((f, m)) * rng.choice([0.0, 1e-3, 1.0])
    cones = Cones(n, slope, offset, np.zeros((f, m), dtype=bool))
    weight = 0.1 + rng.random((f, 1))

    def allowed(shrink: float, share: float) -> np.ndarray:
        p = scale * rng.random((f, m)) * (rng.random((f, m)) < share)
        return shrink * (offset + slope * p)[..., None] * vectors(rng, n, m) - p[..., None] * n

    known = (1 - inside) * allowed(1.0, few) + inside * allowed(0.5, 1.0)
    loads = -np.einsum("f,fmi,fmik->k", weight[:, 0], known, motions)
    far = scale * 10.0 ** rng.uniform(-2, 6)
    slip = far * (vectors(rng, n, m) + 10.0 ** rng.uniform(-8, 0) * vectors(rng, n, m))
    opening = far * rng.random((f, m)) * (rng.random() < 0.5)
    pull = (slope * np.linalg.norm(slip, axis=-1) + opening)[..., None] * n - slip
    start = allowed(1.0, few) * (rng.random() < 0.8)
    return BalancePart(cones, start, pull, weight, motions, np.ones(len(start))), loads, known


def rigid(loads: np.ndarray) -> np.ndarray:
    """Return D without springs."""
    return np.zeros((len(loads), len(loads)))


@pytest.mark.pairs
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("inside", [1.0, 1e-2, 1e-4])
@pytest.mark.parametrize("few", [1.0, 0.2])
def test_loads_that_can_be_balanced_are(d, inside, few):
    for seed in range(6):
        part, loads, _ = problem(seed, d, inside, few)
        (r,), rest, forces = balance(MPI.COMM_SELF, [part], loads, rigid(loads))
        missing = np.einsum("f,fmi,fmik->k", part.weight[:, 0], r, part.motions) + loads
        assert np.linalg.norm(missing) <= 1e-10 * forces, seed
        assert np.linalg.norm(missing - rest) <= 1e-12 * forces
        assert abs(part.cones.nearest(r) - r).max() <= 1e-13 * abs(r).max()


@pytest.mark.parametrize("d", [2, 3])
def test_nearest_of_those_that_balance(d):
    for seed in range(12):
        part, loads, known = problem(seed, d, 0.1, 1.0)
        near = 10 * abs(known).max() / max(abs(part.shift).max(), 1e-300)
        part = BalancePart(
            part.cones,
            part.start,
            min(near, 1.0) * part.shift,
            part.weight,
            part.motions,
            part.modulus,
        )
        (r,), _, _ = balance(MPI.COMM_SELF, [part], loads, rigid(loads))

        def distance(t: np.ndarray, part: BalancePart = part) -> float:
            return float((part.weight * ((t - part.start - part.shift) ** 2).sum(axis=-1)).sum())

        assert distance(r) <= distance(known) * (1 + 1e-9)
        for share in (1e-3, 1e-1):  # convex: no better one on the way to the known one
            assert distance(r) <= distance(r + share * (known - r)) * (1 + 1e-9)


@pytest.mark.parametrize("d", [2, 3])
def test_loads_that_nothing_balances(d):
    for seed in range(4):
        part, _, _ = problem(seed, d, 1.0, 1.0)
        away = np.zeros(part.motions.shape[:3])
        away += part.cones.n  # a motion into the foundation; the load draws out of it
        part = BalancePart(
            part.cones, part.start, part.shift, part.weight, away[..., None], part.modulus
        )
        load = np.array([abs(part.start).max() + 1.0])
        for pulls in (load, -load):
            _, rest, forces = balance(MPI.COMM_SELF, [part], pulls, rigid(pulls))
            assert (np.linalg.norm(rest) > 0.1 * forces) == (pulls[0] < 0)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("stiffness", [1e-3, 1.0, 1e3])
def test_springs_take_up_an_imbalance(d, stiffness):
    for seed in range(8):
        part, loads, known = problem(seed, d, 0.1, 1.0)
        scale = abs(known).max()
        near = min(10 * scale / max(abs(part.shift).max(), 1e-300), 1.0)
        part = BalancePart(
            part.cones, part.start, near * part.shift, part.weight, part.motions, part.modulus
        )
        loads = loads + scale * np.random.default_rng(seed).standard_normal(loads.shape)
        roots = np.random.default_rng([seed, d]).standard_normal((len(loads), len(loads)))
        give = stiffness * (roots @ roots.T + 0.1 * np.eye(len(loads)))
        (r,), rest, forces = balance(MPI.COMM_SELF, [part], loads, give)
        assert np.linalg.norm(rest) <= 1e-10 * forces

        def total(t: np.ndarray, part=part, loads=loads, give=give) -> float:
            distance = (part.weight * ((t - part.start - part.shift) ** 2).sum(axis=-1)).sum()
            left = np.einsum("f,fmi,fmik->k", part.weight[:, 0], t, part.motions) + loads
            return float(distance + left @ np.linalg.solve(give, left))

        # The sum of both is convex, and least at r among all allowed tractions.
        for other in (known, part.start, part.cones.nearest(2.0 * r), 0.0 * r):
            for share in (1e-3, 1e-1, 1.0):
                assert total(r) <= total(r + share * (other - r)) * (1 + 1e-9)
