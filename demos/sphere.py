r"""
A block on a sphere
===================

A block of 2 x 2 x 1 is pressed on a rigid sphere below the middle of its lower face,
and moved aside. In 3D Hertz's contact is a disc of radius :math:`a`, the pressure is
a half ellipsoid:

.. math::

    a^3 = \frac{3 P R}{4 E^*}, \qquad
    p = p_0 \sqrt{1 - r^2/a^2}, \qquad
    p_0 = \frac{3 P}{2 \pi a^2}, \qquad E^* = \frac{E}{1 - \nu^2}.

A shear force :math:`Q < \mu P` does not move the contact as a whole. At the edge the
pressure goes to zero and the shear would not, so there the contact slips, whatever
:math:`\mu` is; a part in the middle sticks. Friction acts while the block is pressed,
too. Points of the block that come to rest on the sphere would go on moving along it a
little; friction holds them, and this raises the pressure in the middle by some 5% over
Hertz's, which is without friction.

The formulas are for a half-space. The block is four contact radii high, so they hold up
to some percent. In 3D the number of elements grows fast with the accuracy: some
thousand tetrahedra of degree 2 reach 10% here. The error counts all of the stress
field; forces and the size of the contact are much better than that.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/sphere")
E, NU, R, MU = 1.0, 0.3, 1.0, 0.3

# %%
# The gap is the distance to the sphere along z, for points of the plane z = 0.

ec.log_to_console()
block = ec.read_mesh(
    Path(__file__).resolve().parents[1] / "meshes" / "dome.geo", scripts=True
)
scene = ec.Scene(
    material=ec.Elastic(E, NU),
    supports=ec.Displacement("top", (0.01, 0.0, -0.05)),
    contacts=ec.Contact(
        "bottom", friction=MU, gap=lambda x: (x[0] ** 2 + x[1] ** 2) / (2 * R)
    ),
)
history = ec.adapt(scene, block, accuracy=0.1, degree=2, strategy=ec.SizeMap())
history.save(FOLDER, pictures=True)

# %%
# The closed form for the forces that were found.

force, contact, peak = (
    history.force("bottom").force,
    history.profile("bottom"),
    history.maximum("pressure"),
)
P, Q = force[2], np.hypot(force[0], force[1])
a = (3 * P * R * (1 - NU**2) / (4 * E)) ** (1 / 3)
p0 = 3 * P / (2 * np.pi * a**2)
r, p, q = np.hypot(contact["x"], contact["y"]), contact["pressure"], contact["shear"]

# %%
# Hertz says that the square of the pressure is a straight line over the square of r.
# The line through all points of the inner part gives radius and peak with less noise
# than single points.

inner = p > 0.2 * p0
slope, square = np.polyfit(r[inner] ** 2, p[inner] ** 2, 1)
radius, middle = np.sqrt(-square / slope), np.sqrt(square)
share = q[inner] / contact["friction_bound"][inner]
of_edge, of_middle = (
    share[near].mean() for near in (r[inner] > 0.85 * a, r[inner] < 0.5 * a)
)
if block.comm.rank == 0:
    print(f"P = {P:.5f}, Q/(mu P) = {Q / (MU * P):.3f}")
    print(f"radius {radius:.4f} for a = {a:.4f}")
    print(f"pressure in the middle {middle:.4f} for p0 = {p0:.4f}")
    print(f"greatest pressure {peak.value:.4f} at {peak.place}")
    print(f"shear over mu p: {of_edge:.2f} at the edge, {of_middle:.2f} in the middle")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
    left.plot(r / a, p / p0, ".", ms=2, label="here, points of all facets")
    fine = np.linspace(0, 1, 201)
    left.plot(fine, np.sqrt(1 - fine**2), "k--", lw=1, label="Hertz, half-space")
    left.set(xlabel="$r/a$", ylabel="pressure $p/p_0$", xlim=(0, 1.5), ylim=(0, 1.3))
    right.plot(r[inner] / a, share, ".", ms=2)
    right.set(
        xlabel="$r/a$",
        ylabel=r"shear over friction bound $|q|/\mu p$",
        xlim=(0, 1.5),
        ylim=(0, 1.05),
    )
    left.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: radius and pressure near Hertz's, the pressure somewhat above;
# friction against the push and not across it, below its limit as a whole; the peak in
# the middle; friction at its limit at the edge, and below it in the middle.

assert history.reached
assert abs(radius / a - 1) < 0.05
assert 1.0 < middle / p0 < 1.1
assert np.hypot(*peak.place[:2]) < 0.3 * a
assert force[0] < 0.0
assert abs(force[1]) < 0.02 * Q < 0.02 * MU * P
assert of_edge > 0.95
assert of_middle < 0.75
