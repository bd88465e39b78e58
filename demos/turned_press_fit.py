r"""
A press fit of finite length
============================

A hollow steel shaft is pressed into an aluminium hub that is as long as the shaft.
Textbooks take the pressure as the same everywhere, by Lame's formulas. So it is if
there is no friction: both bodies are in plane stress, shaft and hub change their
lengths by different amounts, and slide along each other. Friction is against that. It
pulls at the shaft and pushes the hub, from the ends to the middle, where nothing moves.

The shaft has the radii 20 and 40, the hub 40 and 70, both are 40 long; steel has
:math:`E = 210\,000` and :math:`\nu = 0.3`, aluminium 70 000 and 0.33. The interference
is 0.05 of the radius, the friction 0.2, all in one step. The middle, :math:`z = 0`, is
a plane of symmetry. Lengths are in mm, stresses in MPa.

Without friction Lame's formulas in plane stress are exact. With it, the fit sticks for
:math:`z < c` and slips beyond. The references are from elements of degree 5 with a node
at :math:`c`, and a second code agrees.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/turned_press_fit")
BORE, R, OUTER, LENGTH, DELTA = 20.0, 40.0, 70.0, 20.0, 0.05
PRESSURE, FORCE, ENERGY = 31.75752465, 159630.7298, 3990.768246
FORCE_2, C_2, U_HUB, U_BORE = 161079.87, 10.192, 0.0304366, -0.00841626

# %%
# The half plane has two rectangles side by side. gmsh draws them in one piece, and
# ``split`` makes the two sides of the fit of the line that they share.


def fit():
    """Upper half of shaft and hub, in the half plane."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 5.0)
    occ = gmsh.model.occ
    shaft = (2, occ.addRectangle(BORE, 0, 0, R - BORE, LENGTH))
    hub = (2, occ.addRectangle(R, 0, 0, OUTER - R, LENGTH))
    occ.fragment([shaft], [hub])
    occ.synchronize()
    regions = {"shaft": ec.where(x=(None, R)), "hub": ec.where(x=(R, None))}
    parts = {"middle": ec.where(y=0.0)}
    domain = ec.from_gmsh(gmsh.model, parts=parts, regions=regions)
    gmsh.finalize()
    return domain.split({"rim": "shaft", "bore": "hub"})


def pressed(friction, accuracy):
    """Shaft and hub after the fit."""
    steel = ec.Elastic(210e3, 0.3, hypothesis="axisymmetric")
    aluminium = ec.Elastic(70e3, 0.33, hypothesis="axisymmetric")
    rollers = ec.Displacement("middle", (None, 0.0))
    joint = ec.Contact("rim", against="bore", gap=-DELTA, friction=friction)
    scene = ec.Scene(
        {"shaft": steel, "hub": aluminium}, rollers, contacts=joint, units="mm, N, MPa"
    )
    return ec.adapt(scene, fit(), accuracy=accuracy, degree=2)


ec.log_to_console()
history = pressed(0.2, accuracy=0.0005)
smooth = pressed(0.0, accuracy=0.005)
history.save(FOLDER, pictures=True)

# %%
# The radial component of the force of a turned contact is the sum around the ring,
# :math:`\int p\,\mathrm dA`. (As vectors these forces are in balance: each turned body
# is.)

bore = history.profile("bore")
force = history.force("bore").force[0]
force_smooth = smooth.force("bore").force[0]
pressure = force_smooth / (2 * np.pi * R * LENGTH)
energy = ec.potential_energy(smooth)
sticks = bore["y"][bore["status"] == ec.results.STICK].max()
u_hub, u_bore = history.at([(OUTER, 0.0), (BORE, 0.0)]).displacement[:, 0]
hoop = smooth.at([(R + 1e-6, 10.0)]).stress[0, 2, 2]
ratio = OUTER**2 + R**2, OUTER**2 - R**2

# %%
# What friction moves: the shear along the fit, and the pressure that it changes by a
# few percent.

if history.error.domain.comm.rank == 0:
    print(f"no friction: force {force_smooth:.3f} for {FORCE}, energy {energy}")
    print(f"friction 0.2: force {force:.2f} for {FORCE_2}: {force / FORCE_2 - 1:+.4%}")
    print(f"sticks up to {sticks:.3f} for {C_2}; u_r {u_hub:.7f}, {u_bore:.8f}")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    order = np.argsort(bore["y"])
    z, p, q = (bore[name][order] for name in ("y", "pressure", "shear"))
    left.plot(z, p, "C0", lw=1, label="friction 0.2")
    left.axhline(PRESSURE, color="k", ls="--", lw=1, label="no friction, Lame")
    left.plot([0, 5], [32.878, 32.899], "ko", ms=4, label="reference")
    left.set(xlabel="$z$ [mm]", ylabel="pressure [MPa]", ylim=(20, 36))
    right.plot(z, abs(q), "C0", lw=1, label="shear")
    right.plot(z, 0.2 * p, "k--", lw=1, label=r"0.2 $\times$ pressure")
    right.plot([5], [2.1255], "ko", ms=4, label="reference")
    right.axvline(C_2, color="0.7", lw=0.8, zorder=0)
    right.set(xlabel="$z$ [mm]", ylabel="shear [MPa]", ylim=(0, 8))
    left.legend(frameon=False)
    right.legend(frameon=False)
    figure.savefig(FOLDER / "fit.png", dpi=150)

# %%
# What must hold: Lame's numbers without friction, with the energy in its proved
# interval; with friction the force within 0.05% and the stick zone within 3%.

assert history.reached
assert smooth.reached
assert abs(force_smooth / FORCE - 1) < 1e-4
assert abs(pressure / PRESSURE - 1) < 1e-4
assert abs(hoop / (PRESSURE * ratio[0] / ratio[1]) - 1) < 5e-3
assert energy.guaranteed
assert energy.low * (1 - 1e-9) <= ENERGY <= energy.high * (1 + 1e-9)
assert abs(force / FORCE_2 - 1) < 5e-4
assert abs(sticks / C_2 - 1) < 0.03
assert abs(u_hub / U_HUB - 1) < 1e-3
assert abs(u_bore / U_BORE - 1) < 1e-3
