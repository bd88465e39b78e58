r"""
A gun barrel of mild steel, stretched on purpose
================================================

A thick tube is loaded by so much pressure that its inner half yields, and unloaded. The
outer half wants to go back, and presses the inner half together: the bore is left with
a compressive hoop stress, which any later pressure must first take away. This is
autofrettage. Lengths are in mm, stresses in MPa; the ends are held, in plane strain.

The steel has a measured curve: it flows without hardening up to a plastic strain of 2%,
the Lueders plateau, and hardens then along a curve that gets flatter. The straight line
from the yield stress to the end of the curve is what a linear law takes in its place.
It is above the plateau, so that it lets the bore widen less than it will.

The yield stress is the first value of the curve. The error is certified as with linear
hardening. Where the curve is flat, the body takes a slope of a tenth of the yield
stress per unit of plastic strain: 0.2% of it along the whole plateau.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/autofrettage")
INNER, OUTER = 20.0, 40.0
PRESSURE = 280.0
E, NU = 206e3, 0.3

# %%
# Both laws. A linear law has numbers, a curve has points.

curve = ec.HardeningCurve(
    plastic_strain=[0.0, 0.02, 0.03, 0.05, 0.10, 0.20],
    stress=[355.0, 355.0, 400.0, 455.0, 520.0, 570.0],
)
slope = (curve.stress[-1] - curve.stress[0]) / curve.plastic_strain[-1]
LAWS = {
    "measured curve": ec.Plastic(E, NU, hardening=curve, hypothesis="axisymmetric"),
    "straight line": ec.Plastic(
        E, NU, curve.stress[0], slope, hypothesis="axisymmetric"
    ),
}

# %%
# A slice of the tube, from its bore to its outer wall.


def treated(law):
    """Pressed and unloaded."""
    tube = ec.rectangle((INNER, 0.0), (OUTER, 2.5), cells=(8, 1))
    ends = [ec.Symmetry(end) for end in ("bottom", "top")]

    def scene_at(time):
        load = ec.Traction("left", pressure=PRESSURE * min(time, 2.0 - time))
        return ec.Scene(law, ends, load, units="mm, N, MPa")

    return ec.evolve(scene_at, tube, [0.8, 1.0, 2.0], accuracy=0.03, degree=2)


radius = np.linspace(INNER, OUTER, 81)
line = np.column_stack([radius, np.full_like(radius, 1.25)])
hoop = {}
moved = {}
for name, law in LAWS.items():
    evolution = treated(law)
    assert evolution.reached
    hoop[name] = evolution.errors[-1].at(line).stress[:, 2, 2]
    pressed = int(abs(evolution.column("time") - 1.0).argmin())
    ends = [evolution.errors[step].solution.at(line[:1]) for step in (pressed, -1)]
    moved[name] = [float(values.displacement[0, 0]) for values in ends]

# %%
# The stress that is left in the body, and its hoop component.

ec.output.draw_deformed(evolution.error, FOLDER / "deformed.png")
if evolution.errors[-1].domain.comm.rank == 0:
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    left.plot(curve.plastic_strain, curve.stress, "C0o-", ms=4, label="measured curve")
    ends = [curve.plastic_strain[0], curve.plastic_strain[-1]]
    straight = [curve.stress[0], curve.stress[-1]]
    left.plot(ends, straight, "C1--", label="straight line")
    left.set(xlabel="plastic strain", ylabel="yield stress [MPa]", ylim=0)
    for name, stress in hoop.items():
        right.plot(radius, stress, label=name)
        print(f"{name}: {stress[0]:.0f} MPa left at the bore")
        print(f"    the bore is wider by {1e3 * moved[name][-1]:.1f} micrometres")
    right.axhline(0.0, color="0.6", lw=0.8)
    right.set(xlabel="radius [mm]", ylabel="hoop stress left [MPa]")
    left.legend(frameon=False)
    right.legend(frameon=False)
    figure.savefig(FOLDER / "hoop_stress.png", dpi=150)

# %%
# What must hold: no pressure is left, so hoop stresses over the wall have no resultant;
# the bore is compressed; and the unloading is elastic, so that the bore returns by
# Lame's displacement, in plane strain.

for name, stress in hoop.items():
    resultant = np.trapezoid(stress, radius)
    assert abs(resultant) < 0.01 * np.trapezoid(abs(stress), radius)
    assert stress[0] < -100.0
    ratio = (INNER / OUTER) ** 2
    lame = (1 + NU) * PRESSURE * INNER / E * (1 + (1 - 2 * NU) * ratio) / (1 - ratio)
    returned = moved[name][0] - moved[name][1]
    assert abs(returned - lame) < 5e-3 * lame
assert moved["measured curve"][1] > 1.05 * moved["straight line"][1]
