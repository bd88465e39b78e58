"""Join random boxes whose outlines run beside each other, and count what it costs.

Two boxes lie on each other. On each of their four sides one is longer than the other,
by a random share of an edge: 1 to 5% (``near``), 1e-4 to 0.2 by a uniform logarithm
(``any``), or 6 to 40%, where no strip is narrow (``wide``). Their sides have 18 to 50
facets. Quantiles are of the pairs that are joined.

    python benchmarks/strips.py [near | any | wide | all] [seed] [count]
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

import numpy as np
import tasks

import erc_contact as ec

QUANTILES = (0.0, 0.1, 0.5, 0.9, 1.0)
Shares = Callable[[np.random.Generator], np.ndarray]


def pair(random: np.random.Generator, shares: Shares) -> ec.Domain:
    """Put a box on a random one whose four sides end beside its own."""
    cells = random.integers(3, 6, size=2)
    edge = 1.0 / cells.max()
    beyond = edge * random.choice([-1.0, 1.0], 4) * shares(random)
    low, high = -beyond[:2], 1.0 + beyond[2:]
    upper = ec.box((0, 0, 0), (1, 1, 0.5), cells=(cells[0], cells[0], 2))
    lower = ec.box((*low, -0.5), (*high, 0.0), cells=(cells[1], cells[1], 2))
    return ec.assembly({"upper": upper, "lower": lower})


def dihedral_angles(domain: ec.Domain) -> np.ndarray:
    """Return the least dihedral angle of each tetrahedron [degrees]."""
    corners = domain.mesh.geometry.x[domain.mesh.geometry.dofmaps[0]]
    edges = corners[:, 1:] - corners[:, :1]
    gradients = np.swapaxes(np.linalg.inv(edges), 1, 2)
    gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    gradients /= np.linalg.norm(gradients, axis=2)[..., None]
    cosine = np.einsum("nik,njk->nij", gradients, gradients).clip(-1.0, 1.0)
    return np.degrees(np.arccos(-cosine)).min(axis=(1, 2))


def measure(shares: Shares, seed: int, count: int) -> None:
    """Join random pairs, and tell quantiles of cells, angles and seconds."""
    ratios = []
    angles = []
    seconds = []
    for number in range(count):
        both = pair(np.random.default_rng([seed, number]), shares)
        began = process_time()
        try:
            domain = both.joined("upper bottom", "lower top")
        except ec.InputError as reason:
            print(f"pair {number}: {reason}", flush=True)
            continue
        seconds.append(process_time() - began)
        ratios.append(domain.cells / both.cells)
        angles.append(dihedral_angles(domain).min())
    print(f"{len(ratios)} of {count} joined")
    print("quantiles    ", *(f"{share:8.0%}" for share in QUANTILES))
    for name, values in (("cells, ratio", ratios), ("least angle", angles), ("seconds", seconds)):
        told = (f"{value:8.3g}" for value in np.quantile(values, QUANTILES))
        print(f"{name:13}", *told)


def near(seed: int = 0, count: int = 40) -> None:
    measure(lambda random: random.uniform(0.01, 0.05, 4), seed, count)


def of_any_width(seed: int = 0, count: int = 60) -> None:
    measure(lambda random: 10.0 ** random.uniform(-4.0, np.log10(0.2), 4), seed, count)


def wide(seed: int = 0, count: int = 40) -> None:
    measure(lambda random: random.uniform(0.06, 0.4, 4), seed, count)


if __name__ == "__main__":
    tasks.run({"near": near, "any": of_any_width, "wide": wide})
