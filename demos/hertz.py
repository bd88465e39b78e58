r"""
Hertz: a half disc against the closed form
==========================================

A disc that is pressed on a plane touches it in a strip. Hertz found in 1882 how wide
the strip is and how the pressure is distributed. The radius is :math:`R`, the force per
length :math:`P`, there is no friction, and the strip is narrow:

.. math::

    a = \sqrt{\frac{4 P R}{\pi E^*}}, \qquad
    p(x) = p_0 \sqrt{1 - x^2/a^2}, \qquad
    p_0 = \frac{2 P}{\pi a}, \qquad E^* = \frac{E}{1 - \nu^2}.

The half-width grows with the root of the force: contact is nonlinear although the
strains are small. The pressure is an ellipse that starts vertically at the edges. Away
from the strip the stress decays like :math:`1/r`, so elements have to be small at the
contact and may be large elsewhere.

Where is the edge of the contact in a solution by finite elements? The last facet that
carries pressure tells it up to its length only. The zero of the pressure knows it
better: with the distance :math:`\xi` from the edge the pressure is like
:math:`\xi^{1/2}` and the gap like :math:`\xi^{3/2}`, and ``contact_area`` goes along
both. It tells how far it may be off. The second moment of the pressure knows the
half-width, too, but of an ellipse alone: :math:`\int p x^2 dx = P a^2/4`, so

.. math:: a = 2 \sqrt{\int p x^2 dx \Big/ \int p\, dx}.

Source: K. L. Johnson, "Contact Mechanics", section 4.2.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/hertz")
E, NU, R = 1.0, 0.3, 1.0

# %%
# The foundation is the plane y = 0, and the gap of a point of the disc is its height. A
# ``.geo`` file keeps the true circle: each new mesh has its nodes there, gap and normal
# are taken there, and what the flat facets still cost is estimated and counted (the
# column geom).

ec.log_to_console()
half_disc = ec.read_mesh(
    Path(__file__).resolve().parents[1] / "meshes" / "half_disc.geo", scripts=True
)
scene = ec.Scene(
    material=ec.Elastic(E, NU),
    supports=ec.Displacement("top", (0.0, -0.01)),
    contacts=ec.Contact("arc", gap=lambda x: x[1], normal=(0.0, -1.0)),
)
history = ec.adapt(scene, half_disc, accuracy=0.015, degree=2, strategy=ec.SizeMap())
history.save(FOLDER, pictures=True)

# %%
# The closed form for the force that was found, and what the certified traction has
# instead.

P = history.force("arc").force[1]
a = np.sqrt(4 * P * R * (1 - NU**2) / (np.pi * E))
p0 = 2 * P / (np.pi * a)
contact = history.profile("arc")
x, p = contact["x"], contact["pressure"]
by_moment = 2 * np.sqrt(np.trapezoid(p * x**2, x) / np.trapezoid(p, x))
half_width = history.contact_area("arc").half_width
pressing = history.contact_force("arc")
peak = history.maximum("pressure").value

if half_disc.comm.rank == 0:
    cells = history.steps[-1].cells
    print(f"half-width {half_width} for {a:.5f}, {cells} elements")
    print(f"by the second moment {by_moment:.5f}")
    print(pressing)
    print(f"peak {peak:.5f} for {p0:.5f}")
    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    near = abs(x) < 1.6 * a
    fine = np.linspace(-a, a, 401)
    axes.plot(
        x[near] / a,
        p[near] / p0,
        "C0",
        lw=1.5,
        label=f"here, certified {history.error.total:.1%}",
    )
    axes.plot(fine / a, np.sqrt(1 - (fine / a) ** 2), "k--", lw=1, label="Hertz")
    axes.set(xlabel="$x/a$", ylabel="pressure $p/p_0$", ylim=(0, 1.25))
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: the half-width is within its margin; by the second moment it is within
# 1%, as the peak is, by a certified 1.5% and far fewer than 5000 elements; pressure
# ends where the closed form says, up to a facet; the disc is symmetric.

assert history.reached
assert history.steps[-1].cells < 5000
assert abs(half_width.value - a) < half_width.margin < 0.1 * a
assert abs(by_moment / a - 1) < 0.01
assert np.isclose(pressing.mean_pressure.value, np.pi / 4 * p0, rtol=0.03)
assert abs(peak / p0 - 1) < 0.01
distances = np.unique(abs(x[abs(x) < 1.2 * a]).round(9))
facet = 2 * np.diff(distances)[-2:].max()
assert abs(abs(x[p > 0.01 * p0]).max() - a) < facet < 0.15 * a
assert abs(np.trapezoid(p * x, x) / (P * a)) < 0.01
