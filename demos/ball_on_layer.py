r"""
A ball on a layer
=================

A large ball is pressed on a layer that is bonded to a rigid plate. The layer is hardly
thicker than the contact, so Hertz's formulas for half-spaces are wrong: the plate makes
the contact stiffer.

Ball and layer are turned bodies. With ``hypothesis="axisymmetric"`` the mesh is one
half of their cut: ``x[0]`` is the radius :math:`r` and ``x[1]`` the axis :math:`z`, and
all forces and energies are the ones of the full ring. The edge on :math:`r = 0` is no
boundary and needs no name.

The layer has the thickness 10, :math:`E = 1000` and :math:`\nu = 0.3`, the ball is
rigid, of radius :math:`R = 500`, and is pressed in by 0.1. Here the scene stands on its
head: the layer hangs below a plate that moves down by 0.1, on a foundation with the
gap :math:`r^2/2R`. Lengths are in mm, stresses in MPa.

Without friction the layer is one of infinite radius whose pressure obeys a pair of dual
integral equations of Hankel transforms, solved to ten digits. With the friction 0.2,
all in one step, a disc sticks in the middle and the rest slips inward. These references
are from finite elements of degree 6 with a node on the rim of the contact and another
one on the rim of the stick zone.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/ball_on_layer")
THICK, RADIUS, R, DOWN = 10.0, 100.0, 500.0, 0.1
FORCE, A, ENERGY = 2255.374380, 8.646255987, 79.38378369
P = np.array([14.76424456, 14.23484669, 12.57812149, 9.431096427])
FORCE_2, A_2, C_2 = 2267.920, 8.58717, 5.35332
P_2 = np.array([15.304, 14.7660, 13.071, 9.4851])

# %%
# The mesh is a rectangle in the half plane. All that differs from a plane scene is one
# word at the material.


def gap(x):
    """The distance of the ball."""
    return x[0] ** 2 / (2 * R)


def pressed(friction):
    """The layer after the ball has come, to a certified 0.3%."""
    layer = ec.Elastic(1000.0, 0.3, hypothesis="axisymmetric")
    plate = ec.Displacement("top", (0.0, -DOWN))  # u_r, u_z
    ball = ec.Contact("bottom", gap=gap, friction=friction)
    domain = ec.rectangle((0.0, 0.0), (RADIUS, THICK), size=3.0)
    scene = ec.Scene(layer, plate, contacts=ball, units="mm, N, MPa")
    return ec.adapt(scene, domain, accuracy=0.003, degree=2)


ec.log_to_console()
history = pressed(0.0)
history.save(FOLDER, pictures=True)
rough = pressed(0.2)

# %%
# Numbers of the contact. The gap opens like the power 3/2 of the distance to the rim,
# so its power 2/3 is a straight line that is zero at the rim; so is the slip's at the
# rim of the stick zone.


def rim(contact, opening, inside, reach):
    """Radius where the power 2/3 of an opening is zero."""
    r = contact["x"]
    last = r[inside].max()
    near = (r > last) & (r < last + reach) & (opening > 0)
    slope, at_zero = np.polyfit(r[near], opening[near] ** (2 / 3), 1)
    return -at_zero / slope


def pressure_at(contact, r):
    """The pressure, by a parabola through the points near r."""
    near = abs(contact["x"] - r) < 1.0
    return np.polyfit(contact["x"][near] - r, contact["pressure"][near], 2)[-1]


def numbers(run, a):
    """Radius of the contact, and pressures at 0, a/4, a/2, 3a/4."""
    contact = run.profile("bottom")
    radius = rim(contact, contact["gap"], contact["pressure"] > 0, 2.0)
    return radius, np.array([pressure_at(contact, r) for r in a * np.arange(4) / 4])


radius, pressures = numbers(history, A)
radius_2, pressures_2 = numbers(rough, A_2)
force, force_2 = (run.force("bottom").force[1] for run in (history, rough))
energy = ec.potential_energy(history)
axial = ec.interval(history, ec.Resultant("bottom", (0.0, 1.0)))
contact, contact_2 = history.profile("bottom"), rough.profile("bottom")
stick = contact_2["x"][contact_2["status"] == ec.results.STICK].max()

# %%
# Hertz's pressure for the same force, and what friction changes: the layer cannot
# follow the ball outward, so the middle is pressed more.

if history.error.domain.comm.rank == 0:
    print(f"force {force:.3f} for {FORCE:.3f}: {force / FORCE - 1:+.3%}, {axial}")
    print(f"radius {radius:.4f} for {A:.4f}: {radius / A - 1:+.2%}")
    print(f"pressures {pressures / P - 1}, energy {energy} for {ENERGY:.6f}")
    off = force_2 / FORCE_2 - 1, radius_2 / A_2 - 1
    print(f"friction: force {off[0]:+.3%}, radius {off[1]:+.2%}")
    print(f"stick up to {stick:.3f} for {C_2}, pressures {pressures_2 / P_2 - 1}")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    modulus = 1000.0 / (1 - 0.3**2)
    a_hertz = (3 * FORCE * R / (4 * modulus)) ** (1 / 3)
    fine = np.linspace(0, a_hertz, 400)
    ellipse = np.sqrt(1 - (fine / a_hertz) ** 2)
    ellipse *= 3 * FORCE / (2 * np.pi * a_hertz**2)
    places = np.arange(4) / 4
    looks = ((contact, "C0", "no friction", A, P), (contact_2, "C1", "0.2", A_2, P_2))
    for profile, colour, label, a, reference in looks:
        left.plot(profile["x"], profile["pressure"], colour, lw=1, label=label)
        left.plot(a * places, reference, f"{colour}o", ms=4)
    left.plot(fine, ellipse, "k--", lw=1, label="Hertz, same force")
    left.set(xlabel="$r$ [mm]", ylabel="pressure [MPa]", xlim=(0, 12), ylim=(0, 17))
    left.set_title("dots: references", fontsize=10)
    right.plot(contact_2["x"], abs(contact_2["shear"]), "C1", lw=1, label="shear")
    bound = 0.2 * contact_2["pressure"]
    right.plot(contact_2["x"], bound, "k--", lw=1, label=r"0.2 $\times$ pressure")
    right.axvline(C_2, color="0.7", lw=0.8, zorder=0)
    right.set(xlabel="$r$ [mm]", ylabel="shear [MPa]", xlim=(0, 12), ylim=(0, 3.5))
    left.legend(frameon=False)
    right.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: forces within 0.05%, radii within 0.5%, pressures within 1%; the
# energy lies in the interval that is proved, and so does the force; a stick zone ends
# within 3%.

assert history.reached
assert rough.reached
assert abs(force / FORCE - 1) < 5e-4
assert abs(force_2 / FORCE_2 - 1) < 5e-4
assert abs(radius / A - 1) < 5e-3
assert abs(radius_2 / A_2 - 1) < 5e-3
assert np.all(abs(pressures / P - 1) < 0.01)
assert np.all(abs(pressures_2 / P_2 - 1) < 0.01)
assert energy.guaranteed
assert energy.low < ENERGY < energy.high
assert axial.guaranteed
assert axial.low < FORCE < axial.high
assert abs(stick / C_2 - 1) < 0.03
