r"""
A closed crack that slips
=========================

A large plate is pressed from its sides. In its middle a crack of half length a leans by
45 degrees; its lips press on each other and slip with friction. The stress :math:`p`
far away presses the lips together by :math:`p \sin^2\psi` and shears them by :math:`p
\sin\psi\cos\psi`, of which friction takes a share. In an infinite plate in plane
strain the lips slip by

.. math::

    \delta(s) = \frac{4 (1 - \nu^2)}{E} \, p \sin\psi (\cos\psi - \mu \sin\psi)
                \sqrt{a^2 - s^2}.

The contact ends inside the body: at the tips both lips are one point. Only the facets
of the crack are split; the line that it lies on goes on through the plate, so that the
mesh has two regions, and stays whole there.
"""

from pathlib import Path

import gmsh
import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/crack")
E, NU, MU, P, LEAN = 1000.0, 0.3, 0.3, 1.0, np.pi / 4
WIDTH = 40.0  # half the width of the plate, in half lengths of the crack

# %%
# The plate in gmsh: a square, cut by the line of the crack.

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
square = occ.addRectangle(-WIDTH, -WIDTH, 0, 2 * WIDTH, 2 * WIDTH)
ends = (-3 * WIDTH, -1.0, 1.0, 3 * WIDTH)
points = [occ.addPoint(s * np.cos(LEAN), s * np.sin(LEAN), 0) for s in ends]
lines = [occ.addLine(*points[i : i + 2]) for i in range(3)]
_, parts = occ.fragment([(2, square)], [(1, line) for line in lines])
occ.synchronize()
crack = [tag for _, tag in parts[2]]
tips = gmsh.model.getBoundary([(1, tag) for tag in crack], False, False)
for _, tag in parts[0]:
    x, y, _ = occ.getCenterOfMass(2, tag)
    gmsh.model.addPhysicalGroup(2, [tag], name="above" if y > x else "below")
gmsh.model.addPhysicalGroup(1, crack, name="crack")
gmsh.option.setNumber("Mesh.MeshSizeMax", 8.0)
gmsh.model.mesh.setSize(tips, 0.15)
sides = {
    "left": ec.where(x=-WIDTH),
    "right": ec.where(x=WIDTH),
    "foot": ec.where(y=-WIDTH),
}
plate = ec.from_gmsh(gmsh.model, parts=sides)
gmsh.finalize()
plate = plate.split({"upper lip": "above", "lower lip": "below"}, on="crack")

# %%
# Nearly all of the energy is in the uniform stress, so a small error is asked for:
# around the crack it is a larger one.

scene = ec.Scene(
    ec.Elastic(E, NU),
    [ec.Displacement("left", (0.0, None)), ec.Displacement("foot", (None, 0.0))],
    loads=ec.Traction("right", (-P, 0.0)),
    contacts=ec.Contact("upper lip", against="lower lip", friction=MU),
)
history = ec.adapt(scene, plate, accuracy=0.0003, degree=2)

# %%
# The mesh around the crack, the slip along the crack, and the closed form.

figure, axes = plt.subplots(figsize=(6.0, 5.0), layout="constrained")
ec.output.draw_error(history.error, ax=axes)
axes.plot([-np.cos(LEAN), np.cos(LEAN)], [-np.sin(LEAN), np.sin(LEAN)], "k-", lw=1.5)
axes.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4))
if plate.comm.rank == 0:
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure.savefig(FOLDER / "near.png", dpi=150, bbox_inches="tight")

lip = history.profile("upper lip")
s = lip["x"] * np.cos(LEAN) + lip["y"] * np.sin(LEAN)
order = np.argsort(s)
shear = P * np.sin(LEAN) * (np.cos(LEAN) - MU * np.sin(LEAN))
exact = 4 * (1 - NU**2) / E * shear * np.sqrt(np.maximum(1 - s**2, 0.0))
slip = abs(lip["slip"])
if plate.comm.rank == 0:
    FOLDER.mkdir(parents=True, exist_ok=True)
    print(f"greatest slip {slip.max():.6f}, closed form {exact.max():.6f}")
    figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
    axes.plot(s[order], 1e3 * slip[order], ".", ms=4, label="computed")
    axes.plot(s[order], 1e3 * exact[order], "k-", lw=1, label="closed form")
    axes.set(xlabel="place along the crack, over a", ylabel=r"slip, $10^{-3}$ a")
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "slip.png", dpi=150)

# %%
# A run that aims at the mean slip itself knows it to 2% on fewer elements. With Coulomb
# friction its interval is an estimate.

aimed = ec.adapt(scene, plate, accuracy=0.02, degree=2, goal=ec.Slip("upper lip"))
mean_slip = np.pi * (1 - NU**2) / E * shear
if plate.comm.rank == 0:
    print(f"mean slip {aimed.bounds}, closed form {mean_slip:.6f}")

# %%
# Closed cracks are driven by the shear beyond friction, so the stress intensity factor
# K_II is its product with the root of pi a. Friction on the faces makes it an estimate.

tip = (np.cos(LEAN), np.sin(LEAN))
sliding = ec.StressIntensity(tip, direction=tip, radius=0.8, mode="II")
factor = ec.interval(history, sliding)
exact_factor = shear * np.sqrt(np.pi)
if plate.comm.rank == 0:
    print(f"K_II {factor}, closed form {exact_factor:.4f}")

# %%
# What must hold: slip and pressure of the closed form, and friction at its bound.

assert history.reached
assert abs(slip.max() / exact.max() - 1) < 4e-3
mean_pressure = lip["weight"] @ lip["pressure"] / lip["weight"].sum()
assert abs(mean_pressure / (P * np.sin(LEAN) ** 2) - 1) < 2e-3
assert np.all(abs(lip["shear"]) <= MU * lip["pressure"] + 1e-12)
assert aimed.reached
assert abs(aimed.bounds.value / mean_slip - 1) < 0.02
assert abs(abs(factor.value) / exact_factor - 1) < 0.02
assert aimed.best.domain.cells < history.best.domain.cells
