"""What the flat facets of a curved body cost: the estimate errs to the safe side.

The energy of a ring under pressure inside is known; with the estimate its interval has it, at both
degrees and whatever the mesh.
"""

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
