r"""
A brake pad: rounded corners, two materials
===========================================

A pad of a soft lining on a back of steel is pressed on a disc, here a plane, and
dragged along it. Its lower corners are round. Two things can be learnt.

*Corners.* Under a sharp rigid corner the pressure of an elastic contact is infinite. A
round corner leaves the foundation gradually: the contact ends somewhere on the arc, and
there the pressure is zero. Its peak, near the end of the flat part, is finite.

*The leading edge.* The pad is 15 high. It is pressed by :math:`P` and pushed by
:math:`Q` at its top, friction holds it at its foot, and the couple :math:`Q h` has to
be carried, too. It is carried by the pressure, which moves to the leading side: its
centre is at

.. math:: x_c = \frac{1}{P} \int p\, x\, ds = \frac{Q h}{P},

whatever the materials are. With :math:`Q/P = 0.2` this is 3 mm, almost half-way to the
end of the flat part at 7 mm. This is why brake pads wear unevenly. Here the trailing
end of the flat part has even begun to lift. As :math:`Q < \mu P`, the pad sticks as a
whole, and slips only near its edges. The lining is squeezed out under the leading edge,
so the shear changes its sign there.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/punch")
HEIGHT, FLAT, P, Q = 15.0, 7.0, 10.0 * 20.0, 2.0 * 20.0  # mm, mm, N/mm, N/mm

# %%
# A geometry of your own: any model of gmsh, its boundary parts and regions named by
# where they are. On several ranks each makes the model, and the model of rank 0 counts.
# A boundary without a name is free.


def brake_pad():
    """20 x 15, corners of radius 3 below; the lower 5 are the region lining."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 3.0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
    occ = gmsh.model.occ
    rounded = occ.addRectangle(-10.0, 0.0, 0.0, 20.0, 15.0, roundedRadius=3.0)
    (lining,), _ = occ.intersect(
        [(2, rounded)], [(2, occ.addRectangle(-10.0, 0.0, 0.0, 20.0, 5.0))]
    )
    occ.fragment([lining], [(2, occ.addRectangle(-10.0, 5.0, 0.0, 20.0, 10.0))])
    occ.synchronize()
    parts = {"foot": ec.where(y=(None, 3.0)), "top": ec.where(y=HEIGHT)}
    regions = {"lining": ec.where(y=(None, 5.0)), "back": ec.where(y=(5.0, None))}
    domain = ec.from_gmsh(gmsh.model, parts=parts, regions=regions)
    gmsh.finalize()
    return domain


# %%
# Moduli by region. The gap is the height above the plane, also on the arcs.

ec.log_to_console()
pad = brake_pad()
scene = ec.Scene(
    material=ec.Elastic(E={"lining": 1000.0, "back": 210e3}, nu=0.3),
    loads=ec.Traction("top", (Q / 20.0, -P / 20.0)),
    contacts=ec.Contact("foot", friction=0.4, gap=lambda x: x[1], normal=(0.0, -1.0)),
    units="mm, N/mm, MPa",
)
history = ec.adapt(scene, pad, accuracy=0.02, degree=2, strategy=ec.SizeMap())
history.save(FOLDER, pictures=True)

# %%
# The centre of pressure is the moment of the foundation's force about the origin, over
# the force.

foot, contact = history.force("foot"), history.profile("foot")
x, p, q = contact["x"], contact["pressure"], contact["shear"]
centre = foot.moment[0] / foot.force[1]
(strip,) = history.contact_area("foot").strips
left, right = strip.ends[:, 0]
if pad.comm.rank == 0:
    print(f"force {foot.force} N/mm, centre {centre:.4f} mm")
    print(f"contact {left:.2f} to {right:.2f} mm, peak {p.max():.1f} MPa")
    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    axes.plot(x, p, label="pressure $p$")
    axes.plot(x, -q, label="shear against the push $-q$")
    axes.plot(x, 0.4 * p, "k:", lw=1, label=r"$\pm \mu p$")
    axes.plot(x, -0.4 * p, "k:", lw=1)
    axes.axvspan(-FLAT, FLAT, color="0.95", label="flat part")
    axes.set(xlabel="$x$ [mm]", ylabel="traction [MPa]", xlim=(-10, 10))
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "traction.png", dpi=150)

# %%
# What must hold: the forces and their couple, exactly; a contact that ends on the
# leading arc, where the pressure has its peak, and before the trailing one; a pad that
# sticks in the middle, slips at its edges, and is squeezed out in front.

assert history.reached
assert np.allclose(foot.force, (-Q, P), rtol=1e-6)
assert abs(centre - Q * HEIGHT / P) < 1e-6 * HEIGHT
assert -FLAT < left < -FLAT + 1
assert FLAT < right < 8.0
assert abs(x[p.argmax()] - FLAT) < 0.3
assert p[x > 0].max() > 3 * p[x < 0].max()
sticks, slips = (x[contact["status"] == status] for status in (2, 1))
assert abs(sticks).min() < 1.0
assert slips.min() < sticks.min() < sticks.max() < slips.max()
assert q[abs(x) < 5].max() < 0.0 < q[x > FLAT].max()
