r"""
A pin in a lug, and its clearance
=================================

A pin holds a lug that is pulled. The hole is wider than the pin by the clearance
:math:`c` of the radii. If this is large the pin touches little of the hole, as two
cylinders do; if it is small, or the pull great, the contact goes nearly half-way
around. Such a contact is called *conforming*, and Hertz's theory is not for it: the
contact is as wide as the bodies are curved.

Only one number counts, :math:`c E' / Q` with :math:`E' = E/(1 - \nu^2)` and the pull
:math:`Q` per thickness. For a plate without end and a pin of the same material A.
Persson (1964) found the half of the angle of contact :math:`\varepsilon`, with
:math:`b = \tan \varepsilon/2`, and the pressure in its middle:

.. math::

    \frac{c E'}{Q} = \frac{2 - \ln(1 + b^2) - 2 b^4}{\pi b^2 (1 + b^2)}, \quad
    \frac{p_0 R}{Q} = \frac{2 b}{\pi \sqrt{1 + b^2}} + \frac{1}{2 \pi b^2 (1 + b^2)}
    \ln \frac{\sqrt{1 + b^2} + b}{\sqrt{1 + b^2} - b} .

Without clearance the angle is 84.8 degrees, under any pull. The lug here is large, with
20 times the width of the pin, so that his formulas hold. There is no friction, and the
pin is held at its core. Lengths are in mm, stresses in MPa.

The hole slides along the pin as it takes its oval shape. The facets of both are flat,
but the normals of the contact turn along them as on the circle, so nothing catches.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact import output

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/pin_in_lug")
R, CORE = 10.0, 2.0
BACK, END, HALF_WIDTH = 400.0, 200.0, 200.0
E, NU, MOVED = 210e3, 0.3, 0.04
STRAIN_MODULUS = E / (1 - NU**2)
CLEARANCES = [0.0, 0.02, 0.2]

# %%
# Half of the lug, with its hole on the pin: both sides of the contact are meshed in one
# place, whatever the clearance is.


def lug():
    """Half of the pin in half of the lug."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 60.0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 40)
    occ = gmsh.model.occ
    plate = [(2, occ.addRectangle(-BACK, 0, 0, BACK + END, HALF_WIDTH))]
    pin = [(2, occ.addDisk(0, 0, 0, R, R))]
    core = [(2, occ.addDisk(0, 0, 0, CORE, CORE))]
    pin, _ = occ.intersect(pin, plate, removeTool=False)
    pin, _ = occ.cut(pin, core, removeTool=False)
    plate, _ = occ.cut(plate, core)
    occ.fragment(plate, pin)
    occ.synchronize()
    parts = {
        "symmetry": ec.where(y=0.0),
        "pulled": ec.where(x=-BACK),
        "core": lambda x: np.hypot(x[0], x[1]) < 1.01 * CORE,
    }
    regions = {
        "pin": lambda x: np.hypot(x[0], x[1]) < 1.001 * R,
        "lug": lambda x: np.hypot(x[0], x[1]) > 0.999 * R,
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts, regions=regions)
    gmsh.finalize()
    return domain.split({"rim": "pin", "hole": "lug"})


# %%
# At first the pin lies in the hole where it will be pressed. The gap is then
# :math:`c (1 - \cos\theta)`, data of the contact. The far end of the lug is moved, and
# the pull is what it takes.


def pulled(domain, clearance):
    """The lug after its end has moved, to a certified 1%."""

    def gap(x):
        return clearance * (1 - x[0] / R)

    supports = [
        ec.Displacement("core", (0.0, 0.0)),
        ec.Displacement("symmetry", (None, 0.0)),
        ec.Displacement("pulled", (-MOVED, None)),
    ]
    contact = ec.Contact("rim", gap=gap, against="hole")
    scene = ec.Scene(
        ec.Elastic(E, NU), supports, contacts=contact, units="mm, N/mm, MPa"
    )
    return ec.adapt(scene, domain, accuracy=0.01, degree=2, strategy=ec.SizeMap())


ec.log_to_console()
domain = lug()
runs = [pulled(domain, clearance) for clearance in CLEARANCES]

# %%
# Persson's angle is found by bisection, as the load falls with it. The angle of a run
# is known to half of a facet.


def persson(load):
    """Half of the angle [radian] for a value of c E'/Q, by bisection."""
    low, high = 1e-3, 1.0
    for _ in range(60):
        b = (low + high) / 2
        value = 2 - np.log(1 + b**2) - 2 * b**4
        if value / (np.pi * b**2 * (1 + b**2)) > load:
            low = b
        else:
            high = b
    return 2 * np.arctan(low)


def pressure_by(theta, half_angle):
    """Persson's pressure over Q/R."""
    b, y = np.tan(half_angle / 2), np.tan(theta / 2)
    root = np.sqrt(np.maximum(b**2 - y**2, 0))
    end = np.sqrt(1 + b**2)
    logarithm = np.log((end + root) / (end - root))
    first = 2 * root / (np.pi * end * (1 + y**2))
    return first + logarithm / (2 * np.pi * b**2 * (1 + b**2))


def facet_means(run, pull):
    """Angles of the middles of facets, in order, and their mean pressures over Q/R."""
    facets = run.profile("rim").reshape(-1, 5)  # five points on each
    theta = np.arctan2(facets["y"][:, 2], facets["x"][:, 2])
    weight = facets["weight"]
    mean = (facets["pressure"] * weight).sum(axis=1) / weight.sum(axis=1)
    order = theta.argsort()
    return theta[order], mean[order] * R / pull


def half_angle(theta, pressure):
    """Between the last facet that is pressed and the next, and their distance."""
    last = np.flatnonzero(pressure > 0.02 * pressure.max()).max()
    ends = theta[last : last + 2]
    return ends.mean(), np.ptp(ends)


pulls = np.array([2 * abs(run.force("rim").force[0]) for run in runs])
loads = np.array(CLEARANCES) * STRAIN_MODULUS / pulls
exact = np.array([persson(load) for load in loads])
means = [facet_means(run, pull) for run, pull in zip(runs, pulls, strict=True)]
angles, facets = np.array([half_angle(*mean) for mean in means]).T

# The pressure in the inner third, as a mean of all its facets.
computed, expected = [], []
for (theta, pressure), angle in zip(means, exact, strict=True):
    inner = theta < angle / 3
    computed.append(pressure[inner].mean())
    expected.append(pressure_by(theta[inner], angle).mean())

# The part near the pin. Gap and displacement are magnified alike, the small one, too.
axes = output.draw_deformed(runs[1].error, factor=100)

if domain.comm.rank == 0:
    FOLDER.mkdir(parents=True, exist_ok=True)
    axes.set(xlim=(-35, 35), ylim=(-5, 35))
    axes.figure.savefig(FOLDER / "deformed.png", dpi=150)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    many = np.geomspace(1e-2, 30, 100)
    right.semilogx(many, [np.degrees(persson(load)) for load in many], "k", lw=1)
    for i, clearance in enumerate(CLEARANCES):
        found, wanted = np.degrees([angles[i], exact[i]])
        print(f"c = {clearance}, pull {pulls[i]:.0f}:", end=" ")
        print(f"half-angle {found:.1f} for {wanted:.1f} degrees,", end=" ")
        print(f"pressure inside {computed[i]:.3f} for {expected[i]:.3f} Q/R")
        theta, pressure = means[i]
        left.plot(np.degrees(theta), pressure, f"C{i}o", ms=3, label=f"c = {clearance}")
        fine = np.linspace(0, exact[i], 200)
        left.plot(np.degrees(fine), pressure_by(fine, exact[i]), f"C{i}", lw=1)
        # Zero is not on a logarithmic axis; it is drawn at its left end.
        right.plot(max(loads[i], 1e-2), found, f"C{i}o")
    left.set(xlabel="angle [degrees]", ylabel="pressure, means of facets, over $Q/R$")
    left.set(xlim=(0, 100), ylim=(0, 2.2), title="lines: Persson")
    right.set(xlabel="$c E'/Q$", ylabel="half of the angle of contact", ylim=(0, 90))
    left.legend(frameon=False)
    figure.savefig(FOLDER / "persson.png", dpi=150)

# %%
# What must hold, by a certified 1%: the angle is Persson's up to a facet, the pressure
# inside within 2%; both sides carry the pull; the smaller the clearance the wider the
# contact.

assert all(run.reached for run in runs)
assert np.all(abs(angles - exact) < facets)
assert np.all(facets < 0.12 * exact)
assert np.all(abs(np.array(computed) / expected - 1) < 0.02)
assert np.all(np.diff(angles) < 0.0)
moved = [2 * run.reactions()["pulled"].force[0] for run in runs]
of_hole = [2 * run.force("hole").force[0] for run in runs]
assert np.allclose(moved, -pulls, rtol=1e-8)
assert np.allclose(of_hole, pulls, rtol=1e-8)
