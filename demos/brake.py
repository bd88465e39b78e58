r"""
A brake pad on a turning disc
=============================

A pad is pressed on a disc that turns below it. The disc is a foundation that moves:
``motion=`` is its displacement, here a small turn :math:`\varphi` about its axis, and
slip counts against it. The back plate of the pad is rigid. It is guided along the disc,
pressed by a force, and free to tilt. After a turn that is large beside the strains of
the pad all of it slips, so that the moment of the brake is

.. math:: M = \mu \int p \, r \, dA,

with the pressure p of the solution. Friction acts at the height h below the plate and
tilts it, so the pad is pressed harder at the end that meets the disc first. By balance
of moments about the plate the pressure has the moment :math:`\int p \, y \, dA = -F_y
h`, with the friction :math:`F_y \approx \mu N` along the pad. A linear pressure along
the pad of length l is then

.. math:: p = p_0 \Bigl(1 - 6 \mu \frac{h}{l} \frac{y}{l/2}\Bigr).
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/brake")
MU, P0, TURN = 0.35, 2.0, 0.01  # friction, pressure [MPa], turn [rad]
RADIUS, LENGTH, WIDTH, HEIGHT = 110.0, 60.0, 40.0, 12.0  # [mm]

# %%
# The axis of the disc is the z axis. A turn moves the point (x, y) by :math:`\varphi
# (-y, x)`: the pad lies at x = 110, where the disc moves along y.

pad = ec.box(
    (RADIUS - WIDTH / 2, -LENGTH / 2, 0.0),
    (RADIUS + WIDTH / 2, LENGTH / 2, HEIGHT),
    cells=(6, 9, 2),
)
disc = ec.Contact(
    "bottom",
    friction=MU,
    motion=(lambda x: -TURN * x[1], lambda x: TURN * x[0], 0.0),
)
scene = ec.Scene(
    ec.Elastic(1000.0, 0.3),
    ec.Rigid(
        "top",
        displacement=(0.0, 0.0, None),
        force=(None, None, -P0 * LENGTH * WIDTH),
        rotation=(None, None, 0.0),
        moment=(0.0, 0.0, None),
    ),
    contacts=disc,
    units="mm, N, MPa",
)
history = ec.adapt(scene, pad, accuracy=0.1, degree=2)

# %%
# Force and moment of the disc on the pad, and the pressure, its mean over the width.

force = history.force("bottom")
profile = history.profile("bottom")
pressed = profile["weight"] * profile["pressure"]
moment = MU * pressed @ np.hypot(profile["x"], profile["y"])
tilting = pressed @ profile["y"]
ec.output.draw_deformed(history.error, FOLDER / "deformed.png")
if pad.comm.rank == 0:
    FOLDER.mkdir(parents=True, exist_ok=True)
    print(f"normal force {force.force[2]:.1f} N for {P0 * LENGTH * WIDTH:.1f} N")
    print(f"moment {force.moment[2]:.0f} Nmm, mu int p r dA = {moment:.0f} Nmm")
    print(f"int p y dA {tilting:.1f} Nmm for {-force.force[1] * HEIGHT:.1f} Nmm")
    strips = np.linspace(-LENGTH / 2, LENGTH / 2, 16)
    mean = np.histogram(profile["y"], strips, weights=pressed)[0]
    mean /= np.histogram(profile["y"], strips, weights=profile["weight"])[0]
    linear = P0 * (1 - 6 * MU * HEIGHT / LENGTH * strips / strips[-1])
    figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
    axes.stairs(mean, strips, label="mean over the width", lw=1.5)
    axes.plot(strips, linear, "k--", lw=1, label="linear, by balance")
    axes.set(xlabel="y, along the motion of the disc [mm]", ylabel="pressure [MPa]")
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: forces and moments are balanced, and all of the pad slips.

assert history.reached
assert abs(force.force[2] / (P0 * LENGTH * WIDTH) - 1) < 1e-9
assert abs(force.moment[2] / moment - 1) < 2e-3
assert abs(tilting / (-force.force[1] * HEIGHT) - 1) < 1e-3
assert profile["slip"].min() > 0.5 * TURN * (RADIUS - WIDTH / 2)
