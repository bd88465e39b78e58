"""What the flat facets of a curved body cost: the estimate errs to the safe side.

The energy of a ring under pressure inside is known; with the estimate its interval has it, at both
degrees and whatever the mesh.
"""

from dataclasses import replace

import numpy as np
import pytest
from scenes import certified

import erc_contact as ec

pytestmark = pytest.mark.serial
E, NU, PRESSURE = 1.0, 0.3, 0.001


def quarter_ring(inner, outer, size):
    """A quarter of a ring, with its true shape: sides x, y, bore and rim."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        geo = gmsh.model.geo
        middle = geo.addPoint(0.0, 0.0, 0.0)
        at_x = [geo.addPoint(r, 0.0, 0.0, size) for r in (inner, outer)]
        at_y = [geo.addPoint(0.0, r, 0.0, size) for r in (inner, outer)]
        bore, rim = (geo.addCircleArc(x, middle, y) for x, y in zip(at_x, at_y, strict=True))
        low = geo.addLine(*at_x)
        left = geo.addLine(*at_y)
        body = geo.addPlaneSurface([geo.addCurveLoop([low, rim, -left, -bore])])
        geo.synchronize()
        for name, curve in {"bore": bore, "rim": rim, "y": low, "x": left}.items():
            gmsh.model.addPhysicalGroup(1, [curve], name=name)
        gmsh.model.addPhysicalGroup(2, [body], name="ring")
        return ec.from_gmsh(gmsh.model)
    finally:
        gmsh.finalize()


def drawn(draw, size):
    """A body that a function draws with gmsh; it returns the named sides by dimension."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        parts, inside = draw(gmsh)
        for name, entities in parts.items():
            gmsh.model.addPhysicalGroup(*entities, name=name)
        gmsh.model.addPhysicalGroup(*inside, name="body")
        return ec.from_gmsh(gmsh.model)
    finally:
        gmsh.finalize()


def plate(radius, size):
    """A quarter of a square with a hole of a radius, by gmsh's own kernel."""

    def draw(gmsh):
        geo = gmsh.model.geo
        middle = geo.addPoint(0.0, 0.0, 0.0)
        places = [(radius, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, radius)]
        points = [geo.addPoint(*place, 0.0) for place in places]
        names = {"y": (0, 1), "right": (1, 2), "top": (2, 3), "x": (3, 4)}
        lines = {name: geo.addLine(points[a], points[b]) for name, (a, b) in names.items()}
        hole = geo.addCircleArc(points[4], middle, points[0])
        body = geo.addPlaneSurface([geo.addCurveLoop([*lines.values(), hole])])
        geo.synchronize()
        sides = lines | {"hole": hole}
        return {name: (1, [curve]) for name, curve in sides.items()}, (2, [body])

    return drawn(draw, size)


def wall(inner, outer, facets, height):
    """A quarter of a ring of one cell across, in the plane or raised by one layer."""

    def draw(gmsh):
        geo = gmsh.model.geo
        middle = geo.addPoint(0.0, 0.0, 0.0)
        at_x = [geo.addPoint(r, 0.0, 0.0) for r in (inner, outer)]
        at_y = [geo.addPoint(0.0, r, 0.0) for r in (inner, outer)]
        bore, rim = (geo.addCircleArc(x, middle, y) for x, y in zip(at_x, at_y, strict=True))
        low, left = geo.addLine(*at_x), geo.addLine(*at_y)
        body = geo.addPlaneSurface([geo.addCurveLoop([low, rim, -left, -bore])])
        curves = {"y": low, "rim": rim, "x": left, "bore": bore}
        for name, curve in curves.items():
            geo.mesh.setTransfiniteCurve(curve, 3 if name in ("x", "y") else facets + 1)
        geo.mesh.setTransfiniteSurface(body)
        if not height:
            geo.synchronize()
            return {name: (1, [curve]) for name, curve in curves.items()}, (2, [body])
        (_, top), (_, volume), *sides = geo.extrude([(2, body)], 0, 0, height, numElements=[1])
        geo.synchronize()
        # The sides come in the order of the curve loop.
        parts = {name: (2, [tag]) for name, (_, tag) in zip(curves, sides, strict=True)}
        return parts | {"low": (2, [body]), "high": (2, [top])}, (3, [volume])

    return drawn(draw, 1.0)


def energy(inner, outer):
    """The strain energy of a quarter, by Lame's solution u = A r + B/r in plane strain."""
    first = E * NU / ((1 + NU) * (1 - 2 * NU))
    shear = E / (2 * (1 + NU))
    rows = [[2 * (first + shear), -2 * shear / r**2] for r in (inner, outer)]
    a, b = np.linalg.solve(rows, [-PRESSURE, 0.0])
    return 0.5 * PRESSURE * (np.pi / 2) * inner * (a * inner + b / inner)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(
    ("inner", "outer", "size"),
    [(1.0, 2.0, 0.5), (1.0, 2.0, 0.2), (0.3, 2.0, 0.2), (1.0, 1.3, 0.1), (1.0, 6.0, 0.8)],
)
def test_energy_of_a_ring_is_in_its_interval(inner, outer, size, degree):
    """It is an estimate, and at most three times as wide as what the facets change."""
    held = [ec.Displacement("x", (0.0, None)), ec.Displacement("y", (None, 0.0))]
    scene = ec.Scene(ec.Elastic(E, NU), held, ec.Traction("bore", pressure=PRESSURE))
    error = certified(scene, quarter_ring(inner, outer, size), degree=degree)
    bounds = ec.potential_energy(error)
    assert not bounds.guaranteed
    true = -energy(inner, outer)
    assert bounds.low <= true <= bounds.high
    if degree == 2:
        # Little is left of e, and the facets lower the energy of the polygon.
        changed = abs(bounds.value - error.absolute**2 / 4 - true)
        assert error.geometry_error**2 / 2 < 3 * changed


def test_what_cancels_is_no_error():
    """A plate that is pulled: what its hole lacks and what kinks release nearly cancel.

    The kinks alone release 2.4 times the change.
    """
    held = [ec.Displacement("x", (0.0, None)), ec.Displacement("y", (None, 0.0))]
    scene = ec.Scene(ec.Elastic(E, NU), held, ec.Traction("right", pressure=-PRESSURE))
    fine = ec.potential_energy(certified(scene, plate(0.5, 0.02), degree=2))
    domain = plate(0.5, 0.15)
    error = certified(scene, domain, degree=2)
    bounds = ec.potential_energy(error)
    assert bounds.low <= fine.value <= bounds.high
    polygon = replace(domain, geometry=None, curved_facets=None)
    for _ in range(4):
        finer = certified(scene, polygon, degree=2)
        polygon = polygon.refined(ec.mark(finer, 0.8))
    of_polygon = ec.potential_energy(finer)
    changed = abs((of_polygon.low + of_polygon.high) / 2 - fine.value)
    assert of_polygon.high - of_polygon.low < 0.5 * changed
    assert changed < error.geometry_error**2 / 2 < 3 * changed


@pytest.mark.parametrize("facets", [3, 6])
def test_a_wall_has_the_same_estimate_in_the_plane_and_in_space(facets):
    """The kinks of a wall in plane strain do not know that its facets are triangles."""
    height = 0.4
    shares = []
    for raised in (0.0, height):
        domain = wall(1.0, 1.6, facets, raised)
        planes = ["x", "y"] + ["low", "high"] * (raised > 0)
        held = [ec.Symmetry(name) for name in planes]
        scene = ec.Scene(ec.Elastic(E, NU), held, ec.Traction("bore", pressure=PRESSURE))
        error = certified(scene, domain, degree=2)
        shares.append(error.geometry_error**2 / error.scale**2)
    # Tetrahedra blur stresses a little less than triangles.
    assert shares[1] == pytest.approx(shares[0], rel=0.2)


def test_a_pressure_on_all_sides_bends_nothing():
    """Without tension along the surface beyond the pressure kinks release no energy."""
    held = [ec.Displacement("x", (0.0, None)), ec.Displacement("y", (None, 0.0))]
    domain = quarter_ring(1.0, 2.0, 0.4)
    inside, outside = (ec.Traction(part, pressure=PRESSURE) for part in ("bore", "rim"))
    shares = []
    for loads in ([inside], [inside, outside]):
        error = certified(ec.Scene(ec.Elastic(E, NU), held, loads), domain, degree=2)
        shares.append(error.geometry_error**2 / error.scale**2)
    # What is left is the volume that facets do not keep.
    assert shares[1] < 5e-3 * shares[0]


@pytest.mark.broad
@pytest.mark.parametrize("hypothesis", ["plane strain", "axisymmetric"])
def test_a_body_that_does_not_yield_has_the_estimate_of_an_elastic_body(hypothesis):
    """Its energy density is its potential; of an elastic body it is half the work."""
    held = [ec.Displacement("y", (None, 0.0))]
    held += [ec.Displacement("x", (0.0, None))] * (hypothesis == "plane strain")
    domain = quarter_ring(1.0, 2.0, 0.5)
    load = ec.Traction("bore", pressure=PRESSURE)
    elastic = ec.Elastic(E, NU, hypothesis=hypothesis)
    plastic = ec.Plastic(E=E, nu=NU, yield_stress=1.0, hardening=0.1, hypothesis=hypothesis)
    found = [certified(ec.Scene(law, held, load), domain) for law in (elastic, plastic)]
    first, second = (error.geometry_error for error in found)
    assert first > 0
    assert second == pytest.approx(first, rel=1e-8)
