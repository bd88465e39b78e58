"""Attack intervals of stress intensity factors with random cracks.

A crack of random length and direction is at a side of a plate or inside it, straight or
with up to three bends. The plate is pulled, sheared and turned, and its crack is open,
under pressure, or closed without friction; the strain or the stress is plane, or the
plate is the section of a ring of radius 1.2 to 100, Poisson's ratio from 0 to 0.49.
Each factor is asked on a coarse and on a fine mesh, with both degrees and two radii,
and in plates with a third one, beyond the bends: all proved intervals have to share a
number.

- width: half of the interval over the largest factor of the scene, on the coarse mesh;
- error: the middle of the interval less the middle on the fine mesh, over its half;
- apart: scenes with intervals that do not meet; none may.

    OMP_NUM_THREADS=1 python benchmarks/crack_factors.py [seed] [count]
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from itertools import chain, pairwise, product
from typing import Any

from mpi4py import MPI

import erc_contact as ec
from namedmesh.gmsh_session import session

import numpy as np  # isort: skip - after erc_contact, which loads MPI first

RADII = (0.9, 0.5)
"""Radii around the tip over what there is room for before a bend [-]."""
BEYOND_BENDS = 0.9
"""Likewise, over what there is room for with the bends [-]."""
LEAST_PIECE = 0.08
"""Least length of the pieces of a crack [length]."""
SIZES = (0.2, 0.08)
"""Sizes of elements of both meshes, over the plate and, at a crack, over it [-]."""


@dataclass(frozen=True)
class Crack:
    """Hold a random crack in the square from -1 to 1.

    Attributes:
        places: Where it begins, bends and ends, shape (2 to 5, 2).
        radii: Radii around the tip.
        middle: Radius of the middle of the square, 0 of plates.
    """

    places: np.ndarray
    radii: list[float]
    middle: float = 0.0

    @property
    def tip(self) -> np.ndarray:
        """Return the tip."""
        return self.places[-1] + (self.middle, 0.0)

    @property
    def way(self) -> np.ndarray:
        """Return the vector along the last piece to the tip."""
        return self.places[-1] - self.places[-2]


def random_crack(rng: np.random.Generator) -> Crack:
    """Return a crack at the left side, or inside."""
    length = rng.uniform(0.4, 1.0)
    angle = rng.uniform(-0.7, 0.7)
    is_inside = rng.random() < 0.5
    root = np.array([rng.uniform(-0.5, -0.1) if is_inside else -1.0, rng.uniform(-0.3, 0.3)])
    tip = root + length * np.array([np.cos(angle), np.sin(angle)])
    places = np.array([root, tip])
    if rng.random() < 0.6:
        places = bent(rng, root, tip)
    straight, whole = np.linalg.norm(tip - places[[-2, 0]], axis=1)
    to_side = (1 - abs(tip)).min()
    radii = [float(share * min(straight, to_side)) for share in RADII]
    middle = float(np.exp(rng.uniform(0.2, 4.6))) if rng.random() < 0.5 else 0.0
    if not middle:
        radii.append(float(BEYOND_BENDS * min(whole, to_side)))
    return Crack(places, radii, middle)


def bent(rng: np.random.Generator, root: np.ndarray, tip: np.ndarray) -> np.ndarray:
    """Return the places of a crack with bends that goes on away from its tip."""
    way = tip - root
    aside = np.array([-way[1], way[0]])
    while True:
        shares = np.sort(rng.uniform(0.1, 0.9, rng.integers(1, 4)))[:, None]
        bends = root + shares * way + rng.uniform(-0.15, 0.15, shares.shape) * aside
        places = np.array([root, *bends, tip])
        pieces = np.diff(places, axis=0)
        to_tip = tip - places[1:]
        nears_tip = (pieces * to_tip).sum(axis=1)[:-1] > 0
        if nears_tip.all() and np.linalg.norm(pieces, axis=1).min() > LEAST_PIECE:
            return places


def plate(crack: Crack, size: float) -> ec.Domain:
    """Return the plate, split along its crack."""

    def build(gmsh: Any) -> None:
        occ = gmsh.model.occ
        square = occ.addRectangle(crack.middle - 1, -1, 0, 2, 2)
        beyond = 20 * (crack.places[-1] - crack.places[0])
        first, last = crack.places[0] - beyond, crack.places[-1] + beyond
        line = np.vstack([first, crack.places, last])
        line[:, 0] += crack.middle
        points = [occ.addPoint(*place, 0) for place in line]
        lines = [(1, occ.addLine(*ends)) for ends in pairwise(points)]
        _, parts = occ.fragment([(2, square)], lines)
        on_crack = list(chain.from_iterable(parts[2:-1]))
        occ.synchronize()
        for _, tag in parts[0]:
            x, y, _ = occ.getCenterOfMass(2, tag)
            above = y > np.interp(x, *line.T)
            gmsh.model.addPhysicalGroup(2, [tag], name="up" if above else "down")
        gmsh.model.addPhysicalGroup(1, [tag for _, tag in on_crack], name="crack")
        for name, (axis, sign) in {"top": (1, 1), "bottom": (1, -1), "right": (0, 1)}.items():
            tags = []
            for _, tag in gmsh.model.getEntities(1):
                place = occ.getCenterOfMass(1, tag)[axis] - (crack.middle, 0.0)[axis]
                if np.isclose(place, sign):
                    tags.append(tag)
            gmsh.model.addPhysicalGroup(1, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 2 * size)
        ends = gmsh.model.getBoundary(on_crack, combined=False, oriented=False)
        gmsh.model.mesh.setSize(ends, size * np.linalg.norm(crack.way))

    with session(MPI.COMM_WORLD, build, "The plate") as model:
        whole = ec.from_gmsh(model, MPI.COMM_WORLD)
    return whole.split({"upper lip": "up", "lower lip": "down"}, on="crack")


def random_scene(rng: np.random.Generator, crack: Crack) -> ec.Scene:
    """Return loads and a material for the plate or the ring."""
    hypothesis = str(rng.choice(["plane strain", "plane stress"]))
    if crack.middle:
        hypothesis = "axisymmetric"
    material = ec.Elastic(1000.0, rng.uniform(0.0, 0.49), hypothesis=hypothesis)
    supports = [ec.Displacement("bottom", (0.0, 0.0))]
    pull = rng.normal(size=2)
    kind = rng.choice(["open", "pressure", "closed"])
    pull[1] = -abs(pull[1]) if kind == "closed" else abs(pull[1])
    # Meshes of degree 1 do not represent the moment of a ring.
    turn = 0.0 if crack.middle else rng.normal()
    loads = [ec.Traction("top", (pull[0], lambda x: pull[1] + turn * x[0]))]
    if kind == "pressure":
        loads += [ec.Traction(lip, pressure=1.0) for lip in ("upper lip", "lower lip")]
    contacts = [] if kind == "pressure" else [ec.Contact("upper lip", against="lower lip")]
    return ec.Scene(material, supports, loads, contacts)


def main(seed: int = 0, count: int = 20) -> None:
    """Print what random cracks gave."""
    widths, errors = [], []
    endings: Counter[str] = Counter()
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        crack = random_crack(rng)
        scene = random_scene(rng, crack)
        tip, way = crack.tip.tolist(), crack.way.tolist()
        found: dict[str, list[ec.Bounds]] = {"I": [], "II": []}
        for size in SIZES:
            domain = plate(crack, size)
            for degree in (1, 2):
                solution = ec.solve(scene, domain, degree=degree)
                error = ec.constitutive_error(ec.equilibrate(solution))
                for mode, radius in product(found, crack.radii):
                    goal = ec.StressIntensity(tip, way, radius, mode)
                    found[mode].append(ec.interval(error, goal))
        largest = max(abs(bounds[-1].value) for bounds in found.values())
        for mode, bounds in found.items():
            proved = [one for one in bounds if one.guaranteed]
            endings["proved"] += len(proved)
            endings["estimated"] += len(bounds) - len(proved)
            if proved and max(b.low for b in proved) > min(b.high for b in proved):
                endings["apart"] += 1
                print(f"{number}, K_{mode}: apart: {[str(one) for one in bounds]}")
            for one in bounds[: len(bounds) // 2]:
                half = (one.high - one.low) / 2
                widths.append(half / largest)
                errors.append(abs(one.value - bounds[-1].value) / half)
    print(f"seed {seed}, {count} cracks: {dict(endings)}")
    for name, values in (("width", widths), ("error", errors)):
        quantiles = np.quantile(values, [0.0, 0.05, 0.5, 0.95, 1.0])
        print(f"{name}: least, 5%, median, 95%, most", quantiles.round(4))


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
