r"""
Two cylinders: Hertz for two elastic bodies
===========================================

Two long cylinders of radii :math:`R_1` and :math:`R_2` are pressed on each other by a
force :math:`P` per length. Hertz's contact has the half-width :math:`a` and pressure

.. math::

    a^2 = \frac{4 P R}{\pi E^*}, \quad
    p = p_0 \sqrt{1 - x^2/a^2}, \quad p_0 = \frac{2 P}{\pi a},

with

.. math::

    \frac1R = \frac1{R_1} + \frac1{R_2}, \quad
    \frac1{E^*} = \frac{1 - \nu_1^2}{E_1} + \frac{1 - \nu_2^2}{E_2} .

His theory takes the bodies for half-planes with the gap :math:`x^2/2R` between them. So
does this page: two blocks with flat sides, and the gap as a field on the contact. Two
circles could not be meshed in one piece, as they touch at one point only; and what the
parabola leaves out of a circle is :math:`(a/2R)^2`, less than a percent here.

Below the contact, at depth :math:`z` in the middle, the stresses are

.. math::

    \sigma_x = -p_0 \left( \frac{a^2 + 2 z^2}{a \sqrt{a^2 + z^2}} - \frac{2 z}{a}
    \right), \qquad \sigma_y = - \frac{p_0\, a}{\sqrt{a^2 + z^2}} .

Half their difference is greatest, :math:`0.300\, p_0`, at the depth :math:`0.786\, a`:
there a bearing begins to yield or tire, and not at its surface. Lengths are in mm,
stresses in MPa.

The blocks are 33 half-widths high. That they end adds one hundredth of :math:`p_0` to
the shear in the lower one, whose base does not bend; nearer bodies would add more.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/hertz_cylinders")
SIZE, FORCE = 40.0, 3200.0
RADIUS = 1 / (1 / 10 + 1 / 13)
MODULI = {"upper": 30000.0, "lower": 29120.0}
RATIOS = {"upper": 0.25, "lower": 0.3}

# %%
# Half of two blocks of 80 x 40. The force is a pressure on the upper one.


def blocks():
    """Half of two blocks on each other."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 8.0)
    occ = gmsh.model.occ
    upper = (2, occ.addRectangle(0, 0, 0, SIZE, SIZE))
    lower = (2, occ.addRectangle(0, -SIZE, 0, SIZE, SIZE))
    occ.fragment([upper], [lower])
    occ.synchronize()
    parts = {
        "top": ec.where(y=SIZE),
        "bottom": ec.where(y=-SIZE),
        "middle": ec.where(x=0.0),
    }
    regions = {"upper": ec.where(y=(0.0, None)), "lower": ec.where(y=(None, 0.0))}
    domain = ec.from_gmsh(gmsh.model, parts=parts, regions=regions)
    gmsh.finalize()
    return domain.split({"roller": "upper", "track": "lower"})


ec.log_to_console()
scene = ec.Scene(
    material=ec.Elastic(MODULI, RATIOS),
    supports=[
        ec.Displacement("bottom", (None, 0.0)),
        ec.Displacement("middle", (0.0, None)),
    ],
    loads=ec.Traction("top", pressure=FORCE / (2 * SIZE)),
    contacts=ec.Contact(
        "roller", gap=lambda x: x[0] ** 2 / (2 * RADIUS), against="track"
    ),
    units="mm, N/mm, MPa",
)
domain = blocks()
history = ec.adapt(scene, domain, accuracy=0.005, degree=2, strategy=ec.SizeMap())

# %%
# The square of the pressure is a straight line over the square of x. The line through
# the points of the inner part gives half-width and peak.

compliance = sum((1 - RATIOS[name] ** 2) / MODULI[name] for name in MODULI)
a = np.sqrt(4 * FORCE * RADIUS * compliance / np.pi)
p_0 = 2 * FORCE / (np.pi * a)

contact = history.profile("roller")
x, pressure = contact["x"], contact["pressure"]
inner = pressure > 0.3 * p_0
slope, square = np.polyfit(x[inner] ** 2, pressure[inner] ** 2, 1)
half_width, peak = np.sqrt(-square / slope), np.sqrt(square)

depths = np.linspace(0.05, 4.0, 80) * a
root = np.sqrt(a**2 + depths**2)
across = -p_0 * ((a**2 + 2 * depths**2) / (a * root) - 2 * depths / a)
along = -p_0 * a / root
stresses = {}
for name, sign in (("upper", 1.0), ("lower", -1.0)):
    points = np.column_stack([np.zeros_like(depths), sign * depths])
    stresses[name] = history.at(points).stress
shear = (across - along) / 2
found = {name: (s[:, 0, 0] - s[:, 1, 1]) / 2 for name, s in stresses.items()}

ec.output.draw_near(history.error, "roller", FOLDER / "near.png")
if domain.comm.rank == 0:
    print(f"half-width {half_width:.5f} for {a:.5f}: {half_width / a - 1:+.2%}")
    print(f"peak {peak:.2f} for {p_0:.2f}: {peak / p_0 - 1:+.2%}")
    for name, values in found.items():
        deepest = values.argmax()
        print(
            f"{name}: shear {values.max() / p_0:.4f} p0 at {depths[deepest] / a:.3f} a"
        )
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    left.plot(x / a, pressure / p_0, ".", ms=3, label="here, points of all facets")
    fine = np.linspace(0, 1, 201)
    left.plot(fine, np.sqrt(1 - fine**2), "k--", lw=1, label="Hertz")
    left.set(xlabel="$x/a$", ylabel="pressure $p/p_0$", xlim=(0, 1.5), ylim=(0, 1.1))
    right.plot(depths / a, shear / p_0, "k--", lw=1, label="Hertz")
    for name, values in found.items():
        right.plot(depths / a, values / p_0, lw=1, label=name)
    right.set(xlabel="depth $z/a$", ylabel=r"$(\sigma_x - \sigma_y) / 2 p_0$")
    left.legend(frameon=False)
    right.legend(frameon=False)
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure.savefig(FOLDER / "hertz.png", dpi=150)

# %%
# What must hold, by a certified 0.5%: half-width and peak within 1% of Hertz's; the
# stress below within 2% of the peak, in both bodies; its greatest shear at its depth;
# each body carries the force.

assert history.reached
assert abs(half_width / a - 1) < 0.01
assert abs(peak / p_0 - 1) < 0.01
assert np.allclose(history.force("roller").force[1], FORCE / 2, rtol=1e-9)
assert np.allclose(history.force("track").force[1], -FORCE / 2, rtol=1e-9)
for values in found.values():
    assert np.all(abs(values - shear) < 0.02 * p_0)
    assert abs(values.max() / p_0 - 0.300) < 0.015
assert np.all(contact["gap"][x < 0.9 * a] < 1e-6)
