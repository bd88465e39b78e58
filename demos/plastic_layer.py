r"""
A cylinder pressed into a plastic layer
=======================================

A rigid cylinder of radius 100 is pressed into a steel layer of thickness 10 that is
bonded to a plate. The steel yields at 235, and hardens by 1% of Young's modulus.
Lengths are in mm, stresses in MPa, forces in N/mm.

The law is the derivative of a convex energy density
(:class:`erc_contact.Plastic`), so the error is certified as in linear elasticity: e is
Fenchel's inequality of the energy and its conjugate. Here the scene stands on its head:
the layer hangs below a plate that moves down, on a foundation with the gap
:math:`x^2/2R`.

Yielding begins below the surface, where Hertz's shear is greatest, and the pressure
becomes flat where it would be a half circle.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

from dolfinx.mesh import compute_midpoints  # isort: skip - MPI first

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/plastic_layer")
THICK, WIDTH, R, DOWN = 10.0, 30.0, 100.0, 0.05
YIELD = 235.0

# %%
# The same scene for both materials: half of it, by symmetry.


def pressed(material):
    """The layer under the cylinder, to a certified 2%."""
    scene = ec.Scene(
        material,
        [ec.Symmetry("left"), ec.Displacement("top", (0.0, -DOWN))],
        contacts=ec.Contact("bottom", gap=lambda x: x[0] ** 2 / (2 * R)),
        units="mm, N/mm, MPa",
    )
    layer = ec.rectangle((0.0, 0.0), (WIDTH, THICK), size=2.5)
    return ec.adapt(scene, layer, accuracy=0.02, degree=2)


ec.log_to_console()
elastic = pressed(ec.Elastic(210e3, 0.3))
plastic = pressed(ec.Plastic(210e3, 0.3, yield_stress=YIELD, hardening=2100.0))
plastic.save(FOLDER)
forces = {
    name: history.force("bottom").force[1]
    for name, history in (("elastic", elastic), ("plastic", plastic))
}
energy = ec.potential_energy(plastic)

# %%
# The stress of von Mises in each cell, with the stress out of plane, tells where the
# layer yields.

stress = ec.results.von_mises(ec.results.mean_stress(plastic))
domain = plastic.error.domain
cells = np.arange(domain.owned_cells, dtype=np.int32)
middles = compute_midpoints(domain.mesh, 2, cells)
yields = stress > YIELD
greatest = plastic.error.maximum("von Mises")
first = elastic.error.maximum("von Mises")
contacts = {
    name: h.profile("bottom")
    for name, h in (("elastic", elastic), ("plastic", plastic))
}

if domain.comm.rank == 0:
    print(
        f"force elastic {forces['elastic']:.1f}, plastic {forces['plastic']:.1f} N/mm"
    )
    print(f"energy {energy}")
    print(f"von Mises up to {greatest.value:.1f}, elastic {first.value:.1f} MPa")
    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    for name, contact in contacts.items():
        axes.plot(contact["x"], contact["pressure"], label=name)
    axes.axhline(YIELD, color="k", lw=0.8, ls=":", label="yield stress")
    axes.set(xlabel="$x$ [mm]", ylabel="pressure [MPa]", xlim=(0, 8))
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: a plastic layer is softer, its pressure is lower, its contact wider;
# it yields below the contact and not far from it; and hardening lets the stress beyond
# the yield stress by little.

width = {
    name: contact["x"][contact["pressure"] > 0].max()
    for name, contact in contacts.items()
}
peak = {name: contact["pressure"].max() for name, contact in contacts.items()}
assert elastic.reached
assert plastic.reached
assert energy.guaranteed
assert forces["plastic"] < 0.8 * forces["elastic"]
assert peak["plastic"] < 0.6 * peak["elastic"]
assert YIELD < greatest.value < 1.5 * YIELD
assert first.value > 2 * YIELD
assert first.place[1] > 0.5
assert np.all(middles[yields][:, 0] < WIDTH / 2)
