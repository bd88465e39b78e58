r"""
Cyclic bodies: a disc with holes on a shaft
===========================================

A disc is shrunk on a hollow shaft and spins. Its twelve holes make it lighter and
softer: the fit presses less at rest, and the disc widens more with the speed, until it
no longer presses on the shaft. All of it is in one twelfth of the disc. With holes that
are not in the middle of the sector, or loads that push around, a sector has no planes
of symmetry, and ``ec.Cyclic("low", "cut", axis=..., sectors=12)`` takes their place:
the displacement of one side is the displacement of the other one, turned by 30 degrees.

Without holes it is Lame's press fit in plane strain: with the interference
:math:`\delta` at the radius b between the radii a and c, and
:math:`E' = E/(1 - \nu^2)`,

.. math:: p = \frac{E' \delta}{b} \bigg/ \left( \frac{c^2 + b^2}{c^2 - b^2} +
   \frac{b^2 + a^2}{b^2 - a^2} \right).
"""

from math import cos, pi, sin
from pathlib import Path

import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

FOLDER = Path("results/disc_sector")
SECTORS = 12
ANGLE = 2 * pi / SECTORS
INNER, FIT, OUTER = 25.0, 50.0, 200.0  # mm
PITCH, HOLE, ASIDE = 140.0, 18.0, 0.4 * ANGLE
E, NU, DENSITY = 210e3, 0.3, 7.85e-9  # MPa, -, t/mm^3
INTERFERENCE = 0.04  # mm

# %%
# gmsh gives both sides of the sector the same nodes by ``setPeriodic``. The shaft and
# the disc are meshed in one piece; ``split`` makes the two sides of the fit.


def place(radius, angle):
    """A point of the sector."""
    return gmsh.model.geo.addPoint(radius * cos(angle), radius * sin(angle), 0.0)


def sector(*, has_hole):
    """One twelfth of the shaft and the disc."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 18.0)
    geo = gmsh.model.geo
    centre = geo.addPoint(0.0, 0.0, 0.0)
    radii = (INNER, FIT, OUTER)
    low = [place(radius, 0.0) for radius in radii]
    cut = [place(radius, ANGLE) for radius in radii]
    arcs = [geo.addCircleArc(a, centre, b) for a, b in zip(low, cut, strict=True)]
    sides = [[geo.addLine(*ends[i : i + 2]) for i in range(2)] for ends in (low, cut)]
    loops = []
    for i in range(2):
        loops.append(
            [geo.addCurveLoop([sides[0][i], arcs[i + 1], -sides[1][i], -arcs[i]])]
        )
    hole = []
    if has_hole:
        x, y = PITCH * cos(ASIDE), PITCH * sin(ASIDE)
        middle = geo.addPoint(x, y, 0.0)
        rim = [
            geo.addPoint(x + HOLE * cos(t), y + HOLE * sin(t), 0.0)
            for t in (0, pi / 2, pi, -pi / 2)
        ]
        hole = [geo.addCircleArc(rim[i - 1], middle, rim[i]) for i in range(4)]
        loops[1].append(geo.addCurveLoop(hole))
    faces = [geo.addPlaneSurface(of_face) for of_face in loops]
    geo.synchronize()
    turn = np.eye(4)
    turn[:2, :2] = [[cos(ANGLE), -sin(ANGLE)], [sin(ANGLE), cos(ANGLE)]]
    gmsh.model.mesh.setPeriodic(1, sides[1], sides[0], turn.ravel())
    parts = {"inner": arcs[:1], "outer": arcs[2:], "low": sides[0], "cut": sides[1]}
    for name, curves in (parts | ({"hole": hole} if hole else {})).items():
        gmsh.model.addPhysicalGroup(1, curves, name=name)
    for name, face in zip(("shaft", "disc"), faces, strict=True):
        gmsh.model.addPhysicalGroup(2, [face], name=name)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain.split({"rim": "shaft", "bore": "disc"})


# %%
# The centrifugal force grows with the radius. Friction holds the disc on the shaft.
# Nothing holds both against turns about the axis, and no load turns them.


def spun(domain, turns_per_minute):
    """The run of a sector at a speed."""
    pull = DENSITY * (2 * pi / 60 * turns_per_minute) ** 2
    scene = ec.Scene(
        material=ec.Elastic(E, NU),
        supports=ec.Cyclic("low", "cut", axis=(0.0, 0.0), sectors=SECTORS),
        loads=ec.BodyForce((lambda x: pull * x[0], lambda x: pull * x[1]))
        if pull
        else [],
        contacts=ec.Contact("rim", against="bore", gap=-INTERFERENCE, friction=0.15),
        units="mm, N/mm, MPa",
    )
    return ec.adapt(scene, domain, accuracy=0.03, degree=2)


plain = spun(sector(has_hole=False), 0)
pressure = plain.contact_force("rim").mean_pressure.value
lame = E / (1 - NU**2) * INTERFERENCE / FIT
lame /= (OUTER**2 + FIT**2) / (OUTER**2 - FIT**2) + (FIT**2 + INNER**2) / (
    FIT**2 - INNER**2
)
print(f"without holes: {pressure:.2f} MPa, Lame {lame:.2f}")
assert abs(pressure / lame - 1) < 0.01

# %%
# With holes, at rest and at two speeds.

drilled = sector(has_hole=True)
pressures = []
for speed in (0, 3500, 7000):
    history = spun(drilled, speed)
    fit = history.contact_force("rim")
    pressures.append(fit.mean_pressure.value)
    print(f"{speed} turns per minute: {fit.mean_pressure} MPa")
    # All sectors together have no force.
    whole = ec.results.whole_force(history, "bore").force
    assert abs(whole).max() < 1e-9 * abs(history.force("bore").force).max()

# %%
# The stress around the holes of all sectors, at the greatest speed.

ec.output.draw_deformed(history, FOLDER / "deformed.png", whole=True)

# %%
# The speed takes pressure from the fit, with its square.

assert pressures[0] < lame
assert pressures[0] > pressures[1] > pressures[2] > 0
lost = np.array(pressures[0]) - np.array(pressures[1:])
assert abs(lost[1] / lost[0] / 4 - 1) < 0.02
