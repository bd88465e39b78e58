r"""
A pin in a wide hole
====================

The hole of a lug is a fifth wider than its pin. They touch along a line, as two
cylinders do, and under a pull on a narrow strip. Each body is drawn and meshed where it
is, and keeps its shape: pin and hole are circles of 10 and 12 mm. The gap between them
is their distance, and is written nowhere.

A strip that is narrow beside the radii follows Hertz. With :math:`1/R^* = 1/10 - 1/12`,
:math:`E^* = E/(2(1 - \nu^2))` and the pull :math:`Q` per thickness, its half width and
greatest pressure are

.. math::

    a = \sqrt{\frac{4 Q R^*}{\pi E^*}}, \qquad p_0 = \sqrt{\frac{Q E^*}{\pi R^*}} .

Each mesh follows the true circle of its own body. Lengths are in mm, stresses in MPa.
"""

from pathlib import Path

import numpy as np

import erc_contact as ec
from erc_contact import output

import gmsh  # isort: skip - after erc_contact, as all that is compiled

FOLDER = Path("results/wide_hole")
PIN, HOLE, CORE = 10.0, 12.0, 3.0
BACK, END, HALF_WIDTH = 120.0, 60.0, 80.0
E, NU, MOVED = 210e3, 0.3, 0.05
FACING = 50.0
"""Angle from the touching point up to which the bodies may touch [degrees]."""

# %%
# Half of each body, drawn on its own. The pin touches the hole at (10, 0).


def body(centre, radius, outline, names, size):
    """A body with half a circle from (10, 0), cut at the angle FACING.

    The points of the outline follow, each with a straight line to it.
    """
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 48)
    occ = gmsh.model.occ
    middle = occ.addPoint(centre, 0, 0)
    ends = []
    for angle in np.radians([0.0, FACING, 180.0]):
        x, y = centre + radius * np.cos(angle), radius * np.sin(angle)
        ends.append(occ.addPoint(x, y, 0))
    others = [occ.addPoint(x, y, 0) for x, y in outline]
    lines = [occ.addCircleArc(ends[i], middle, ends[i + 1]) for i in range(2)]
    corners = [ends[2], *others, ends[0]]
    lines += [occ.addLine(*corners[i : i + 2]) for i in range(len(corners) - 1)]
    occ.addPlaneSurface([occ.addCurveLoop(lines)])
    occ.synchronize()
    for name, numbers in names.items():
        gmsh.model.addPhysicalGroup(1, [lines[number] for number in numbers], name=name)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain


def lug():
    """Both bodies, and the pair of the sides that may touch."""
    core = [(-CORE, 0.0), (-CORE, CORE), (CORE, CORE), (CORE, 0.0)]
    sides = {"rim": [0], "symmetry": [2, 6], "core": [3, 4, 5]}
    pin = body(0.0, PIN, core, sides, 2.0)
    plate = [(-BACK, 0.0), (-BACK, HALF_WIDTH), (END, HALF_WIDTH), (END, 0.0)]
    sides = {"hole": [0], "symmetry": [2, 6], "pulled": [3]}
    plate = body(PIN - HOLE, HOLE, plate, sides, 15.0)
    both = ec.assembly({"pin": pin, "lug": plate})
    return both.joined("pin rim", "lug hole", apart=2.0)


domain = lug()
print(domain.touching())

# %%
# The far end of the lug is moved, and the pull is what it takes.

supports = [
    ec.Displacement("pin core", (0.0, 0.0)),
    ec.Displacement("pin symmetry", (None, 0.0)),
    ec.Displacement("lug symmetry", (None, 0.0)),
    ec.Displacement("lug pulled", (-MOVED, None)),
]
contact = ec.Contact("pin rim", against="lug hole")
scene = ec.Scene(ec.Elastic(E, NU), supports, contacts=contact, units="mm, N/mm, MPa")
ec.log_to_console()
run = ec.adapt(scene, domain, accuracy=0.01, degree=2)

pull = 2 * abs(run.force("pin rim").force[0])
contact_modulus = E / (2 * (1 - NU**2))
radius = 1 / (1 / PIN - 1 / HOLE)
half_width = np.sqrt(4 * pull * radius / (np.pi * contact_modulus))
greatest = np.sqrt(pull * contact_modulus / (np.pi * radius))

# Means of facets: five points on each.
facets = run.profile("pin rim").reshape(-1, 5)
weight = facets["weight"]
pressure = (facets["pressure"] * weight).sum(axis=1) / weight.sum(axis=1)
y = facets["y"][:, 2]
inner = y < half_width / 2
expected = greatest * np.sqrt(1 - (y[inner] / half_width) ** 2)
deviation = run.gap_deviation("pin rim")
axes = output.draw_deformed(run.best, factor=1)

if domain.comm.rank == 0:
    FOLDER.mkdir(parents=True, exist_ok=True)
    axes.set(xlim=(-20, 20), ylim=(-3, 25))
    axes.figure.savefig(FOLDER / "deformed.png", dpi=150)
    print(f"pull {pull:.0f} per mm, half width {half_width:.3f} by Hertz")
    ratio = pressure[inner].mean() / expected.mean()
    print(f"pressure inside over Hertz: {ratio:.4f}")
    print(f"linearised gap: {deviation:.1e} from the distance of the deformed bodies")

# %%
# What must hold: the pressure inside within 2% of Hertz, both sides carry the pull, and
# linear kinematics cost little of the approach.

assert run.reached
assert abs(pressure[inner].mean() / expected.mean() - 1) < 0.02
assert np.allclose(run.force("pin rim").force, -run.force("lug hole").force)
assert deviation < 0.02 * MOVED
