r"""
A ball pressed into a plastic layer and unloaded
================================================

A rigid ball of radius 100 is pressed into a steel layer of thickness 10 that is bonded
to a plate. It is unloaded, pressed to the same depth again, and unloaded. The steel
yields at 235 and hardens by 1% of Young's modulus. Lengths are in mm, stresses in MPa.

Here the scene stands on its head, as all contacts of the package: the layer hangs below
a plate that moves down, on a foundation with the gap :math:`r^2/2R`. Both are
axisymmetric, and the forces are of the full ring.

The plastic strain goes from step to step and from mesh to mesh, and each step is
certified for the state it began with (:func:`erc_contact.evolve`). Three things are
known of such a test. The mean pressure comes near to three times the yield stress
(Tabor). What the layer gives back is elastic: the second press runs along the first
release, and takes hardly more plastic work. And an imprint stays, shallower than the
ball was deep.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/imprint")
THICK, WIDTH, R = 10.0, 20.0, 100.0
DEPTH, FREE = 0.06, 0.04
YIELD = 235.0
TURNS = [0.0, 1.0, 2.0, 3.0, 4.0]
TIMES = [0.25, 0.5, 0.75, *np.arange(1.0, 4.1, 0.2)]


# %%
# The plate moves. At a depth of ``FREE`` the layer has left the ball, and only residual
# stresses are in it. ``Mark`` refines cells, which inherit their plastic strain without
# loss; a mesh made anew moves it by what it does not represent.


def depth(t):
    """Depth of the plate at times."""
    return np.interp(t, TURNS, [0.0, DEPTH, FREE, DEPTH, FREE])


def scene_at(t):
    """The layer on the ball."""
    return ec.Scene(
        ec.Plastic(210e3, 0.3, YIELD, hardening=2100.0, hypothesis="axisymmetric"),
        ec.Displacement("top", (0.0, -depth(t))),
        contacts=ec.Contact("bottom", gap=lambda x: x[0] ** 2 / (2 * R)),
        units="mm, N, MPa",
    )


ec.log_to_console()
layer = ec.rectangle((0.0, 0.0), (WIDTH, THICK), size=2.5)
evolution = ec.evolve(
    scene_at, layer, TIMES, accuracy=0.06, degree=2, strategy=ec.Mark()
)
evolution.save(FOLDER, pictures=True)

# %%
# The gap of the profile is :math:`u_y + r^2/2R` on the admissible displacement. So it
# has the surface, from which the motion of the plate is taken away.


def surface(step):
    """Radius, and height of the surface seen from the ball; the plate is its zero."""
    contact = evolution.profile("bottom")[step]
    moved = contact["gap"] - contact["x"] ** 2 / (2 * R)
    return contact["x"], -moved - depth(evolution.steps[step].time)


time = evolution.column("time")
force = evolution.force("bottom")[:, 1]
plastic = evolution.column("plastic_work")
stored = evolution.column("stored")
given = evolution.column("work") + evolution.column("contact_work")
pressed, released, again, last = (
    int(abs(time - turn).argmin()) for turn in (1, 2, 3, 4)
)
deepest, imprint, second_imprint = surface(pressed), surface(released), surface(last)
radius = evolution.errors[pressed].contact_area("bottom").radius
mean_pressure = evolution.errors[pressed].contact_force("bottom").mean_pressure.value
share = ec.results.plastic_share(evolution.errors[pressed])
# Both sides of the axis, the part near the imprint.
axes = ec.output.draw_state(evolution.errors[last], "accumulated", mirrored=True)

if layer.comm.rank == 0:
    axes.set(xlim=(-10, 10), ylim=(0, THICK))
    axes.figure.savefig(FOLDER / "plastic_zone.png", dpi=150)
    print(
        f"force {force[pressed]:.0f} N, mean pressure {mean_pressure / YIELD:.2f} yield"
    )
    print(
        f"imprint {-imprint[1].min():.4f} mm deep, {share:.1%} of the layer has yielded"
    )
    print(f"radius of the contact {radius} mm")
    print(f"work {given[last]:.1f}", end=", ")
    print(f"stored {stored[last]:.1f}, plastic {plastic[last]:.1f} N mm")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    shown = {
        "press": ("C0o-", slice(0, pressed + 2)),
        "release": ("C1o-", slice(pressed + 1, released + 2)),
        "again": ("kx", slice(released + 1, None)),
    }
    path, taken = 1e3 * depth(np.append(0.0, time)), np.append(0.0, force) / 1e3
    for name, (line, part) in shown.items():
        left.plot(path[part], taken[part], line, ms=4, lw=1, label=name)
    left.set(xlabel=r"depth of the plate [$\mu$m]", ylabel="force [kN]", xlim=0, ylim=0)
    for name, (r, height) in (("pressed", deepest), ("unloaded", imprint)):
        right.plot(r, 1e3 * height, label=name)
    right.set(xlabel="$r$ [mm]", ylabel=r"surface [$\mu$m]", xlim=(0, 8))
    left.legend(frameon=False)
    right.legend(frameon=False)
    figure.savefig(FOLDER / "imprint.png", dpi=150)

# %%
# What must hold: each step is as accurate as asked for; the balance of energy closes up
# to the error of the meshes; the mean pressure is near Tabor's; the ball leaves an
# imprint with a rim that has risen, and no force.

assert evolution.reached
assert np.all(abs(evolution.column("imbalance")) < 0.02 * given.max())
assert np.all(np.diff(plastic) > -1e-9 * plastic[-1])
assert 2.4 < mean_pressure / YIELD < 3.0
assert force[released] < 1e-9 * force[pressed]
assert 0.6 * DEPTH < -imprint[1].min() < 0.9 * DEPTH
assert 0.0 < imprint[1].max() < 0.1 * DEPTH
assert imprint[0][imprint[1].argmax()] > radius.high

# %%
# The second press is nearly elastic: it comes to the same force, takes no more than 1%
# of the plastic work of the first press, and changes the imprint by less than 1%.

assert abs(force[again] / force[pressed] - 1) < 0.01
assert plastic[last] - plastic[released] < 0.01 * plastic[released]
assert abs(second_imprint[1].min() / imprint[1].min() - 1) < 0.01
assert stored[last] > 0.05 * given[last]
