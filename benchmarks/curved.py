"""What the flat facets of curved bodies change of the energy, and what is estimated.

The facets' own energy is the energy of the mesh as a polygon, whose cells are refined
where its error is, until its interval is narrow beside what the facets change. Kinks
are resolved slowly: on cells of one size the energy of a polyhedron of 35 000 cells may
be off by as much as the change. The energy of the true shape is a closed form, or the
energy on a very fine mesh.

    python benchmarks/curved.py          # rates, with vertices on the surface and moved
    python benchmarks/curved.py 100 0    # random bodies: how many, and the seed
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator, default_rng

import erc_contact as ec
from namedmesh.gmsh_session import session

E, NU, PRESSURE = 1.0, 0.3, 1e-3
POLYGON_CELLS = {2: 4000, 3: 5000}
"""Cells from which a polygon or polyhedron is refined no more."""
NARROW = 0.3
"""Width of the interval of its energy that is narrow, over the change [-]."""
SHARE = (0.2, 0.9)
"""Least and greatest share of that interval that the energy at its end is too great."""
FINE = 0.02
"""Size of the mesh that stands for the true shape [length]."""
SLACK = 1e-6
"""Relative error of its energy, which is too great [-]."""


def drawn(build: Callable[[Any], dict[str, list[int]]], size: float, dim: int = 2) -> ec.Domain:
    """Mesh a drawing of gmsh, whose parts a function names."""
    from mpi4py import MPI  # noqa: PLC0415

    def draw(gmsh: Any) -> None:
        parts = build(gmsh)
        for name, tags in parts.items():
            gmsh.model.addPhysicalGroup(dim - 1, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)

    with session(MPI.COMM_SELF, draw, "The body") as model:
        return ec.from_gmsh(model, MPI.COMM_SELF)


def ring(inner: float, outer: float, size: float, facets: int | None = None) -> ec.Domain:
    """Mesh a quarter of a ring."""

    def build(gmsh: Any) -> dict[str, list[int]]:
        geo = gmsh.model.geo
        middle = geo.addPoint(0, 0, 0)
        low, left = ([geo.addPoint(*p, 0) for p in ends] for ends in _ends(inner, outer))
        bore, rim = (geo.addCircleArc(a, middle, b) for a, b in zip(low, left, strict=True))
        y, x = geo.addLine(*low), geo.addLine(*left)
        geo.addPlaneSurface([geo.addCurveLoop([y, rim, -x, -bore])])
        geo.synchronize()
        if facets:
            for arc in (bore, rim):
                gmsh.model.mesh.setTransfiniteCurve(arc, facets + 1)
        return {"bore": [bore], "rim": [rim], "x": [x], "y": [y]}

    return drawn(build, size)


def _ends(inner: float, outer: float) -> tuple[list[tuple[float, float]], ...]:
    """Return the ends of both arcs of a quarter of a ring, on both axes."""
    return [(inner, 0.0), (outer, 0.0)], [(0.0, inner), (0.0, outer)]


def disc(size: float) -> ec.Domain:
    """Mesh a quarter of a disc of radius 1."""

    def build(gmsh: Any) -> dict[str, list[int]]:
        geo = gmsh.model.geo
        middle, low, left = (geo.addPoint(*p, 0) for p in ((0, 0), (1, 0), (0, 1)))
        rim = geo.addCircleArc(low, middle, left)
        y, x = geo.addLine(middle, low), geo.addLine(left, middle)
        geo.addPlaneSurface([geo.addCurveLoop([y, rim, x])])
        geo.synchronize()
        return {"rim": [rim], "x": [x], "y": [y]}

    return drawn(build, size)


def plate(radius: float, size: float) -> ec.Domain:
    """Mesh a quarter of a square with a hole."""

    def build(gmsh: Any) -> dict[str, list[int]]:
        occ = gmsh.model.occ
        square, hole = occ.addRectangle(0, 0, 0, 1, 1), occ.addDisk(0, 0, 0, radius, radius)
        occ.cut([(2, square)], [(2, hole)])
        occ.synchronize()
        parts: dict[str, list[int]] = {}
        for _, curve in gmsh.model.getEntities(1):
            x, y, _ = occ.getCenterOfMass(1, curve)
            sides = {"x": x, "y": y, "right": x - 1, "top": y - 1}
            at = [name for name, distance in sides.items() if abs(distance) < 1e-9]
            parts.setdefault(at[0] if at else "hole", []).append(curve)
        return parts

    return drawn(build, size)


def fillet(radius: float, size: float) -> ec.Domain:
    """Mesh a bracket whose inner corner is round."""

    def build(gmsh: Any) -> dict[str, list[int]]:
        geo = gmsh.model.geo
        b = 0.8 + radius
        outline = [(0, 0), (2, 0), (2, 0.8), (b, 0.8), (0.8, b), (0.8, 2), (0, 2)]
        points = [geo.addPoint(*p, 0) for p in outline]
        arc = geo.addCircleArc(points[3], geo.addPoint(b, b, 0), points[4])
        ends = list(zip(points, [*points[1:], points[0]], strict=True))
        sides = [arc if i == 3 else geo.addLine(*pair) for i, pair in enumerate(ends)]
        geo.addPlaneSurface([geo.addCurveLoop(sides)])
        geo.synchronize()
        return {"y": sides[:1], "right": sides[1:2], "fillet": [arc], "x": sides[6:]}

    return drawn(build, size)


def shell(size: float) -> ec.Domain:
    """Mesh an eighth of a spherical shell of radii 1 and 2."""

    def build(gmsh: Any) -> dict[str, list[int]]:
        occ = gmsh.model.occ
        body, _ = occ.cut([(3, occ.addSphere(0, 0, 0, 2))], [(3, occ.addSphere(0, 0, 0, 1))])
        occ.intersect(body, [(3, occ.addBox(0, 0, 0, 3, 3, 3))])
        occ.synchronize()
        parts: dict[str, list[int]] = {}
        for _, face in gmsh.model.getEntities(2):
            _, _, _, *high = gmsh.model.getBoundingBox(2, face)
            flat = [name for name, end in zip("xyz", high, strict=True) if end < 1e-3]
            parts.setdefault(flat[0] if flat else "in" if max(high) < 1.1 else "out", []).append(
                face
            )
        return parts

    return drawn(build, size, dim=3)


def scene(load: Any, *, planes: str = "xy", axisymmetric: bool = False) -> ec.Scene:
    """Return a scene on planes of symmetry."""
    hypothesis = "axisymmetric" if axisymmetric else "plane strain"
    held: list[Any] = [ec.Symmetry(n) for n in planes if not axisymmetric or n != "x"]
    return ec.Scene(ec.Elastic(E, NU, hypothesis=hypothesis), held, loads=load)


def solved(scene: ec.Scene, domain: ec.Domain) -> ec.ConstitutiveError:
    """Return the error of degree 2."""
    return ec.constitutive_error(ec.equilibrate(ec.solve(scene, domain, degree=2)))


def energy_of(scene: ec.Scene, domain: ec.Domain) -> float:
    """Return the energy of a mesh of degree 2: minus half the work of the loads."""
    solution = ec.solve(scene, domain, degree=2)
    forces = solution.model.load_forces(strains=False)
    return -0.5 * float(forces.x.array @ solution.u.x.array)


def of_facets(scene: ec.Scene, domain: ec.Domain, true: float) -> float:
    """Return the energy of the mesh as a polygon.

    It is in the interval of each of its meshes. The end of the interval and its width
    fall alike, so the energy is where the end will be at the width zero.

    Args:
        scene: The scene.
        domain: The mesh.
        true: The energy of the true shape.
    """
    cells = replace(domain, geometry=None, curved_facets=None)
    share, last = 0.5, None
    while True:
        error = solved(scene, cells)
        bounds = ec.potential_energy(error)
        width = bounds.high - bounds.low
        if last is not None:
            narrower = last.high - last.low - width
            share = float(np.clip((last.high - bounds.high) / narrower, *SHARE))
        energy = bounds.high - share * width
        is_narrow = last is not None and width < NARROW * abs(energy - true)
        if is_narrow or cells.cells > POLYGON_CELLS[domain.dim]:
            return energy
        last = bounds
        cells = cells.refined(ec.mark(error, 0.8))


def on_surface(domain: ec.Domain) -> ec.Domain:
    """Return a mesh whose vertices are put back on the true surface, in place."""
    domain.mesh.geometry.x[:] = domain.drawn_points[0]
    return domain


def print_rates() -> None:
    """Print what facets change of the energy, with vertices on the surface or moved."""
    bulk, shear = E / (3 * (1 - 2 * NU)), E / (2 * (1 + NU))
    lame = E * NU / ((1 + NU) * (1 - 2 * NU))
    # u = A r + B / r of a ring, and A r + B / r^2 of a shell, both of radii 1 and 2.
    of_ring = [[2 * (lame + shear), -2 * shear / r**2] for r in (1.0, 2.0)]
    of_shell = [[3 * bulk, -4 * shear / r**3] for r in (1.0, 2.0)]
    pressure = ec.Traction("bore", pressure=PRESSURE)
    moved = np.linalg.solve(of_ring, [-PRESSURE, 0.0]).sum()
    true = -PRESSURE * moved * np.pi / 4
    print("| ring, facets a quarter | vertices on the circle | area kept | estimate |")
    for facets in (2, 4, 8, 16):
        size = np.pi / 4 * 3 / (2 * facets)
        _print_row(facets, scene(pressure), partial(ring, 1, 2, size, facets), true)
    pressure = ec.Traction("in", pressure=PRESSURE)
    moved = np.linalg.solve(of_shell, [-PRESSURE, 0.0]).sum()
    true = -PRESSURE * moved * np.pi / 4
    print("| shell, size of cells | vertices on the sphere | volume kept | estimate |")
    for size in (0.8, 0.5):
        _print_row(size, scene(pressure, planes="xyz"), partial(shell, size), true)


def _print_row(size: float, scene: ec.Scene, make: Callable[[], ec.Domain], true: float) -> None:
    """Print the relative changes of an energy."""
    inscribed = of_facets(scene, on_surface(make()), true) / true - 1
    domain = make()
    error = solved(scene, domain)
    estimate = error.geometry_error**2 / 2 / abs(true)
    change = of_facets(scene, domain, true) / true - 1
    print(f"| {size:g} | {inscribed:.2g} | {change:.2g} | {estimate:.2g} |", flush=True)


def random_case(random: Generator, number: int) -> tuple[str, ec.Scene, Callable[[float], Any]]:
    """Return the name of a random body, its scene, and its mesh of a size."""
    a = random.uniform(0.2, 0.9)
    axisymmetric = bool(random.integers(2))
    inside = ec.Traction("bore", pressure=PRESSURE)
    outside = ec.Traction("rim", pressure=PRESSURE)
    spun = ec.BodyForce(lambda x: (PRESSURE * x[0], 0.0 * x[1]))
    weight = ec.BodyForce(lambda x: (0.0 * x[0], -PRESSURE * x[1]))
    pulled = ec.Traction("top" if axisymmetric else "right", pressure=-PRESSURE)
    in_hole = ec.Traction("hole", pressure=PRESSURE)
    level = ec.Traction("rim", pressure=lambda x: PRESSURE * x[1] ** 2)
    bent = ec.Traction("right", pressure=-PRESSURE)
    in_fillet = ec.Traction("fillet", pressure=PRESSURE)
    cases: list[tuple[str, Any, Callable[[float], ec.Domain]]] = [
        ("ring, pressed inside", inside, lambda h: ring(a, 1, h)),
        ("ring, pressed outside", outside, lambda h: ring(a, 1, h)),
        ("plate, pulled", pulled, lambda h: plate(0.8 * a, h)),
        ("plate, pressed in its hole", in_hole, lambda h: plate(0.8 * a, h)),
        ("fillet, pulled", bent, lambda h: fillet(0.8 * a, h)),
        ("fillet, pressed", in_fillet, lambda h: fillet(0.8 * a, h)),
        ("disc, its own force", weight if axisymmetric else spun, disc),
        ("disc, pressed", level, disc),
    ]
    name, load, make = cases[number % len(cases)]
    axisymmetric &= not name.startswith("fillet")
    return name, scene(load, axisymmetric=axisymmetric), make


def print_family(count: int, seed: int) -> None:
    """Print how many intervals hold the energy, and the estimates over the changes."""
    random = default_rng(seed)
    found = []
    for number in range(count):
        name, case, make = random_case(random, number)
        domain = make(random.uniform(0.08, 0.5))
        found.append(compare(name, case, domain, energy_of(case, make(FINE))))
    print_summary(found)


def compare(name: str, scene: ec.Scene, domain: ec.Domain, true: float) -> tuple[bool, float]:
    """Return whether an interval holds the energy, and the estimate over the change."""
    error = solved(scene, domain)
    bounds = ec.potential_energy(error)
    change = abs(of_facets(scene, domain, true) - true)
    ratio = error.geometry_error**2 / 2 / change
    slack = SLACK * abs(true)
    is_held = bounds.low <= true + slack and true - slack <= bounds.high
    words = "" if is_held else ", not in the interval"
    print(f"{name}: {domain.cells} cells, estimate {ratio:.2f} times{words}", flush=True)
    return is_held, ratio


def print_summary(found: list[tuple[bool, float]]) -> None:
    """Print how many intervals hold the energy, and quantiles of the estimates."""
    held, ratios = np.array(found).T
    low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.9])
    print(f"{held.sum():.0f} of {len(found)} energies in their intervals")
    print(f"estimate over change: 5% {low:.2f}, median {middle:.2f}, 90% {high:.2f}")
    safe, near = np.mean(ratios >= 1), np.mean(ratios <= 3)
    print(f"at least the change in {safe:.0%}, at most 3 times in {near:.0%}")


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    if len(sys.argv) > 1:
        print_family(int(sys.argv[1]), int(sys.argv[2]))
    else:
        print_rates()
