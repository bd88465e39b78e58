r"""
A shrink fit whose hub yields
=============================

A hub is bored a little too small for its shaft. Heated, it widens and slips over the
shaft; as it cools, it shrinks and presses on it. The more it is too small, the higher
is the pressure, until the steel of the hub yields at its bore. From there on a smaller
bore brings little, and the fit is not what it was after it is heated once more: a hub
that has flowed comes off at a lower temperature than it was put on.

Heat is a strain that causes no stress by itself: ``ec.ThermalStrain`` of the hub, in a
history of steps. The hub is ``ec.Plastic`` and remembers what has flowed. Shaft and hub
are bodies of revolution, the half plane of radius and axis, without friction. Lengths
are in mm, stresses in MPa, temperatures in K.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact import output

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/shrink_fit")
R, OUTER, LENGTH = 30.0, 55.0, 12.0
E, NU, ALPHA = 210e3, 0.3, 12e-6
OVERLAP = 0.11  # of the radii, at room temperature
CURVE = ec.HardeningCurve([0.0, 0.005, 0.03], [300.0, 330.0, 400.0])
SHAFT = ec.Elastic(E, NU, hypothesis="axisymmetric")
YIELDS = ec.Plastic(E, NU, hardening=CURVE, hypothesis="axisymmetric")

# %%
# At the beginning the hub is as hot as it must be to be put on. It cools in three
# steps, and is heated again until it is loose.

HOT = OVERLAP / (ALPHA * R)
TEMPERATURES = [HOT + 1, 0.6 * HOT, 0.3 * HOT, 0.0, 0.6 * HOT, 0.75 * HOT]
COLD = TEMPERATURES.index(0.0)


def fit():
    """Upper half of shaft and hub, in the half plane."""
    shaft = ec.rectangle((0.0, 0.0), (R, LENGTH), cells=(6, 3))
    hub = ec.rectangle((R, 0.0), (OUTER, LENGTH), cells=(6, 3))
    return ec.assembly({"shaft": shaft, "hub": hub}).joined("shaft right", "hub left")


def scene_at(t, hub=YIELDS):
    """Shaft and hub at the temperature of a step."""
    middle = [
        ec.Displacement(f"{body} bottom", (None, 0.0)) for body in ("shaft", "hub")
    ]
    seat = ec.Contact("shaft right", against="hub left", gap=-OVERLAP)
    heat = ec.ThermalStrain(ALPHA, TEMPERATURES[int(t)], region="hub")
    return ec.Scene(
        {"shaft": SHAFT, "hub": hub},
        middle,
        contacts=seat,
        strains=heat,
        units="mm, N, MPa",
    )


ec.log_to_console()
steps = np.arange(len(TEMPERATURES), dtype=float)
history = ec.evolve(scene_at, fit(), steps, accuracy=0.05, degree=2)

# %%
# Beside it the same fit of a hub that does not yield, and Lame's pressure of it.

elastic = ec.adapt(scene_at(COLD, SHAFT), fit(), accuracy=0.01, degree=2)
area = 2 * np.pi * R * LENGTH
pressures = history.force("hub left")[:, 0] / area
of_elastic = elastic.force("hub left").force[0] / area
ratio = (OUTER / R) ** 2
lame = E * OVERLAP / R / ((ratio + 1) / (ratio - 1) + 1)
share = [ec.results.plastic_share(error) for error in history.errors]

output.draw_state(history.errors[COLD], "accumulated", FOLDER / "yielded.png")
if history.error.domain.comm.rank == 0:
    for temperature, pressure, yielded in zip(
        TEMPERATURES, pressures, share, strict=True
    ):
        print(f"{temperature:4.0f} K: {pressure:6.1f} MPa, {yielded:.0%} has yielded")
    print(f"a hub that does not yield: {of_elastic:.1f} MPa, Lame {lame:.1f} MPa")
    figure, axis = plt.subplots(figsize=(5.6, 3.8), layout="constrained")
    last = COLD + 1
    axis.plot(TEMPERATURES[:last], pressures[:last], "C0o-", label="cooled")
    axis.plot(TEMPERATURES[COLD:], pressures[COLD:], "C1.-", label="heated again")
    axis.plot([HOT, 0.0], [0.0, lame], "k:", label="elastic")
    axis.set(xlabel="temperature of the hub [K]", ylabel="mean pressure [MPa]", ylim=0)
    axis.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: the hot hub is loose; a hub that does not yield has Lame's pressure,
# and up to its yield point the other one, too; then it has less. Heated again it is
# loose at a temperature at which it would still press if it had not flowed.

assert history.reached
assert pressures[0] == 0.0
assert np.isclose(of_elastic, lame, rtol=0.05)
assert np.isclose(pressures[1], 0.4 * lame, rtol=0.05)
assert 0.5 * lame < pressures[COLD] < 0.8 * lame
assert share[1] < 1e-3 < share[COLD]
assert 0.0 < pressures[-2] < 0.5 * pressures[1]
assert abs(pressures[-1]) < 1e-9 * lame
