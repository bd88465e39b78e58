"""Make random scenes of one to three bodies, for ``attack_pairs.py``.

Moduli have ratios up to 1e12, units of force are 1e-25 to 1e12 and units of length 1e-9
to 1e9. Bodies are stacked, a contact alone holds the lowest of them, two of them meet
at a vertex or an edge, one lies in a round bowl, or a body is one cell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from mpi4py import MPI

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from dolfinx import mesh as dmesh

from namedmesh.base.releases import cell_nodes
from namedmesh.partition import distribute

KINDS = ("stack", "stack", "loose", "hinged", "one cell", "bowl")


@dataclass(frozen=True)
class Case:
    """Hold a scene, and what its stress is to be in equilibrium with.

    Attributes:
        name: What it is, in a few words.
        scene: The scene.
        domain: Its mesh.
        degree: Degree of the elements.
        solver: Kind of linear solver.
        given: Displacement that is certified; None where the scene is solved.
        force: Body force [force/volume], shape (d,).
        pressed: Traction on ``top`` [force/area], shape (d,).
        top: Name of the loaded part, "" without one.
        sides: Names of both sides of each contact, the second None on a foundation.
        held: Names of the parts that supports hold.
        round: Whether contacts are round about the second axis, in the plane about a
            point, so that normals turn along their facets.
    """

    name: str
    scene: ec.Scene
    domain: ec.Domain
    degree: int
    solver: str
    given: Any
    force: np.ndarray
    pressed: np.ndarray
    top: str
    sides: list[tuple[str, str | None]]
    held: tuple[str, ...]
    round: bool


@dataclass(frozen=True)
class Bodies:
    """Hold bodies before they have conditions.

    Attributes:
        names: Names of their regions.
        domain: The mesh.
        top: Name of the part that is loaded or moved.
        base: Name of the part that a support may hold.
        sides: Names of both sides of each contact, the second None on a foundation.
        lefts: Names of parts across each axis along the contacts.
    """

    names: list[str]
    domain: ec.Domain
    top: str
    base: str
    sides: list[tuple[str, str | None]]
    lefts: list[tuple[int, str]]


def random_case(rng: np.random.Generator, comm: MPI.Comm) -> Case:
    """Make a random scene, the same for any communicator."""
    d = int(rng.choice([2, 2, 2, 3]))
    length = float(10.0 ** rng.uniform(-9, 9))
    stress = float(10.0 ** rng.uniform(-25, 12)) / length**2
    kind = str(rng.choice(KINDS))
    bodies = random_bodies(rng, kind, d, length, comm)
    ratios = 10.0 ** (rng.uniform(0, 12, 3) * rng.choice([0.0, 0.25, 1.0]))
    moduli = {
        name: stress * float(ratio) for name, ratio in zip(bodies.names, ratios, strict=False)
    }
    soft = min(moduli.values())
    laws = (0.0, 0.4, ec.Tresca(0.001 * soft))
    friction = laws[int(rng.integers(kind == "loose", 3))]
    weight = bool(rng.integers(0, 2)) or kind in ("hinged", "one cell")
    # Without friction nothing holds a body that may turn in its bowl.
    may_be_loaded = kind == "stack" or (kind == "bowl" and friction != 0.0)
    loaded = kind == "loose" or (may_be_loaded and bool(rng.integers(0, 2)))
    aside = 0.1 * rng.uniform(-1, 1, d - 1) * (0.2 if loaded else float(friction != 0.0))
    down = np.array([*aside, -1.0])

    moved = None if loaded or kind == "one cell" else 0.01 * length * down
    loads: list[ec.Traction | ec.BodyForce] = []
    pressed = 0.003 * soft * down * loaded
    if loaded:
        loads.append(ec.Traction(bodies.top, numbers(pressed)))
    force = 0.002 * soft / length * np.array([*(0.0,) * (d - 1), -1.0]) * weight
    if weight:
        loads.append(ec.BodyForce(numbers(force)))
    supports = supports_of(bodies, kind, d, moved, along=friction == 0.0 and kind == "stack")
    contacts = [ec.Contact(here, against=there, friction=friction) for here, there in bodies.sides]
    E = moduli if len(moduli) > 1 else stress
    scene = ec.Scene(ec.Elastic(E, float(rng.uniform(0.0, 0.45))), supports, loads, contacts)
    degree = int(rng.integers(1, 3))
    solver = str(rng.choice(["direct", "direct", "direct", "iterative"]))
    given = random_displacement(rng, d, length) if rng.uniform() < 0.4 else None
    what = "solve" if given is None else "certify"
    name = f"{d}D {kind} of {len(moduli)}, {what}, degree {degree}, {solver}, friction {friction}"
    return Case(
        name,
        scene,
        bodies.domain,
        degree,
        solver,
        given,
        force,
        pressed,
        bodies.top if loaded else "",
        bodies.sides,
        tuple(support.facets for support in supports),
        kind == "bowl",
    )


def numbers(vector: np.ndarray) -> tuple[float, ...]:
    """Return a vector as a tuple of numbers."""
    return tuple(float(component) for component in vector)


def random_bodies(
    rng: np.random.Generator, kind: str, d: int, length: float, comm: MPI.Comm
) -> Bodies:
    """Make the bodies of a kind of scene."""
    count = int(rng.integers(1, 4))
    cells = [tuple(int(n) for n in rng.integers(1, 7 - d, d)) for _ in range(3)]
    if kind == "one cell":
        return Bodies(["body"], one_cell(d, length, comm), "left", "left", [("bottom", None)], [])
    if kind == "hinged":
        return Bodies(["body 0", "body 1"], hinged(d, length, comm), "roof", "floor", [], [])
    if kind == "bowl":
        count = 2
    make = in_a_bowl if kind == "bowl" else stacked
    names, domain = make(d, length, cells[:count], comm)
    prefixes = [f"{name} " for name in names] if count > 1 else [""]
    sides: list[tuple[str, str | None]] = []
    for lower, upper in pairwise(prefixes):
        sides.append((f"{upper}bottom", f"{lower}top"))
    if count == 1 or kind == "loose":
        sides.append((f"{prefixes[0]}bottom", None))
    across = ("left",) if d == 2 else ("left", "front")
    lefts = [(axis, f"{prefix}{side}") for prefix in prefixes for axis, side in enumerate(across)]
    return Bodies(names, domain, f"{prefixes[-1]}top", f"{prefixes[0]}bottom", sides, lefts)


def supports_of(
    bodies: Bodies, kind: str, d: int, moved: np.ndarray | None, *, along: bool
) -> list[ec.Displacement]:
    """Hold the base where no foundation does, and move the top; maybe hold all sides.

    ``along`` holds each body along its contacts, as no friction does.
    """
    supports = []
    if all(there is not None for _, there in bodies.sides) or kind == "one cell":
        supports.append(ec.Displacement(bodies.base, (0.0,) * d))
    if moved is not None:
        supports.append(ec.Displacement(bodies.top, numbers(moved)))
    for axis, side in bodies.lefts if along else []:
        supports.append(ec.Displacement(side, tuple(0.0 if i == axis else None for i in range(d))))
    return supports


def random_displacement(
    rng: np.random.Generator, d: int, length: float
) -> Callable[[np.ndarray], np.ndarray]:
    """Make zeros, a translation, a rotation or noise [length]."""
    kind = int(rng.integers(0, 4))
    size = float(10.0 ** rng.uniform(-6, 3)) * length
    way = rng.uniform(-1, 1, d)
    turn = rng.uniform(-1, 1, (d, d))
    wave = rng.uniform(20, 60, (d, d)) / length

    def u(x: np.ndarray) -> np.ndarray:
        values = np.zeros((d, x.shape[1]))
        if kind == 1:
            values += size * way[:, None]
        if kind == 2:
            values += size / length * (turn - turn.T) @ x[:d]
        if kind == 3:
            values += size * np.sin(wave @ x[:d])
        return values

    return u


def stacked(
    d: int, length: float, cells: list[tuple[int, ...]], comm: MPI.Comm
) -> tuple[list[str], ec.Domain]:
    """Make bricks on each other, whose facets need not match."""
    make = ec.rectangle if d == 2 else ec.box
    bodies = {}
    for number, of_body in enumerate(cells):
        low = (*(0.0,) * (d - 1), number * length)
        high = (*(length,) * (d - 1), (number + 1) * length)
        bodies[f"b{number}"] = make(low, high, cells=of_body, comm=comm)
    if len(bodies) == 1:
        return ["body"], bodies["b0"]
    domain = ec.assembly(bodies)
    for number in range(len(cells) - 1):
        domain = domain.joined(f"b{number + 1} bottom", f"b{number} top")
    return list(bodies), domain


def in_a_bowl(
    d: int, length: float, cells: list[tuple[int, ...]], comm: MPI.Comm
) -> tuple[list[str], ec.Domain]:
    """Make half a ring in half a ring, tubes in 3D, with the same facets.

    A side has 21 vertices at least, enough for the quadric that gives its normals.
    """
    make = ec.rectangle if d == 2 else ec.box
    around = 5 + cells[0][0]
    along = tuple(1 + n for n in cells[0][1:-1])
    bodies = {}
    for number, of_body in enumerate(cells):
        low = (*(0.0,) * (d - 1), float(number))
        high = (*(1.0,) * (d - 1), number + 1.0)
        divisions = (around, *along, of_body[-1])
        brick = make(low, high, cells=divisions, comm=comm)
        x = brick.mesh.geometry.x
        radius, angle = 3.0 - x[:, d - 1], np.pi * (1.0 + x[:, 0])
        x[:, 0], x[:, d - 1] = radius * np.cos(angle), radius * np.sin(angle)
        x *= length
        bodies[f"b{number}"] = ec.Domain(brick.mesh, brick.facet_tags, brick.names)
    return list(bodies), ec.assembly(bodies).joined("b1 bottom", "b0 top")


def one_cell(d: int, length: float, comm: MPI.Comm) -> ec.Domain:
    """Make a simplex: at its bottom a contact, held at its left."""
    points = np.vstack([np.zeros(d), np.eye(d)]) * length
    return domain_of(points, np.arange(d + 1)[None], {"bottom": d - 1, "left": 0}, length, comm)


def hinged(d: int, length: float, comm: MPI.Comm) -> ec.Domain:
    """Make two bricks in one mesh that have one vertex in common, or an edge."""
    brick = ec.rectangle if d == 2 else ec.box
    unit = brick((0.0,) * d, (1.0,) * d, cells=(2,) * d, comm=MPI.COMM_SELF).mesh
    x, cells = unit.geometry.x[:, :d], cell_nodes(unit.geometry)
    beside = np.array([1.0] + [0.0] * (d - 2) + [1.0])
    points, number = np.unique(np.vstack([x, x + beside]).round(9), axis=0, return_inverse=True)
    all_cells = number.ravel()[np.vstack([cells, cells + len(x)])]
    names = {"floor": d - 1, "roof": d - 1 + d}
    return domain_of(points * length, all_cells, names, length, comm, regions=2)


def domain_of(
    points: np.ndarray,
    cells: np.ndarray,
    names: dict[str, int],
    length: float,
    comm: MPI.Comm,
    regions: int = 1,
) -> ec.Domain:
    """Make a domain of points and cells.

    A part is where coordinate ``number`` is least, or, for ``number + d``, greatest;
    region i + 1 is where the last coordinate is between i and i + 1.
    """
    d = points.shape[1]
    low, high = points.min(axis=0), points.max(axis=0)
    if comm.rank > 0:
        points, cells = points[:0], cells[:0]
    mesh = distribute(comm, cells.astype(np.int64), np.ascontiguousarray(points))
    mesh.topology.create_connectivity(d - 1, d)
    facets = dmesh.exterior_facet_indices(mesh.topology)
    middles = dmesh.compute_midpoints(mesh, d - 1, facets)
    tags = np.zeros(len(facets), dtype=np.int32)
    for tag, number in enumerate(names.values(), start=1):
        value = low[number] if number < d else high[number - d]
        tags[abs(middles[:, number % d] - value) < 1e-6 * length] = tag
    tagged = dmesh.meshtags(mesh, d - 1, facets[tags > 0], tags[tags > 0])
    index_map = mesh.topology.index_map(d)
    numbers = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    centres = dmesh.compute_midpoints(mesh, d, numbers)[:, d - 1]
    of_cells = np.floor(centres / length).astype(np.int32) + 1
    parts = {name: tag for tag, name in enumerate(names, start=1)}
    if regions == 1:
        return ec.Domain(mesh, tagged, parts)
    names_of_regions = {f"body {i}": i + 1 for i in range(regions)}
    return ec.Domain(
        mesh, tagged, parts, dmesh.meshtags(mesh, d, numbers, of_cells), names_of_regions
    )
