r"""
A cylinder between rough platens
================================

The standard test of a material: a cylinder is pressed between two platens. Poisson's
ratio makes it wider, the platens hold its ends by friction, so it bulges, and the
modulus that force and shortening tell is too high. By how much?

The cylinder has radius 1, height 2, :math:`E = 1` and :math:`\nu = 0.3`, and is
shortened by 1%. It is computed as a turned body, in the half plane :math:`(r, z)`, and
one half of it: :math:`u_z = 0` at mid-height. Nothing is said of the axis.

Without friction the stress is :math:`\sigma_z = -E/100` everywhere, and the force
:math:`\pi/100`. With friction, all in one step, the middle of the ends sticks up to the
radius :math:`c`, and the rest slips outward. Bonded ends are the limit. The references
are computed by elements of degree 5 to 7 with a node at :math:`c`:

============  ==============  ==========
friction      force           c
============  ==============  ==========
0             0.0314159265    none
0.1           0.032071136     0.061496
0.3           0.033114698     0.87052
bonded        0.033121903     1
============  ==============  ==========
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact.output import draw_revolved

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/platens")
DOWN = 0.01
FRICTIONS = [0.0, 0.1, 0.3, "bonded"]
FORCE = np.array([np.pi / 100, 0.032071136, 0.033114698, 0.033121903])
C = 0.87052
# Energy of the whole cylinder, of bonded ends.
ENERGY = 2 * 1.6560952e-4

# %%
# The platen is a foundation that comes down: a gap below zero. Bonded ends are a
# support.


def pressed(friction, accuracy=0.001):
    """The upper half between the platens."""
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), size=0.25)
    rollers = ec.Displacement("bottom", (None, 0.0))
    material = ec.Elastic(1.0, 0.3, hypothesis="axisymmetric")
    if friction == "bonded":
        scene = ec.Scene(material, [rollers, ec.Displacement("top", (0.0, -DOWN))])
    else:
        platen = ec.Contact("top", gap=-DOWN, friction=friction)
        scene = ec.Scene(material, rollers, contacts=platen)
    return ec.adapt(scene, domain, accuracy=accuracy, degree=2)


ec.log_to_console()
runs = [pressed(friction) for friction in FRICTIONS]
rough, bonded = runs[2], runs[3]
rough.save(FOLDER, pictures=True)

# %%
# The body turned by three quarters.

draw_revolved(rough.error, FOLDER / "revolved.png")

# %%
# The force is the reaction at mid-height. Where it sticks is in the profile.

force = np.array([run.reactions()["bottom"].force[1] for run in runs])
profiles = [run.profile("top") for run in runs[:3]]
sticks = profiles[2]["status"] == ec.results.STICK
stick = profiles[2]["x"][sticks].max()
slips = profiles[2]["x"][profiles[2]["status"] == ec.results.SLIP].min()
energy = ec.potential_energy(bonded)

if rough.error.domain.comm.rank == 0:
    for friction, found, wanted in zip(FRICTIONS, force, FORCE, strict=True):
        print(
            f"friction {friction}: force {found:.7f}, {found / wanted - 1:+.4%};",
            end=" ",
        )
        print(f"modulus {found / FORCE[0]:.4f} E")
    print(f"friction 0.3 sticks up to {stick:.4f} to {slips:.4f} for {C}")
    print(
        f"bonded: energy of both halves {2 * energy.low} to {2 * energy.high}, proved"
    )
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    for friction, profile in zip(FRICTIONS, profiles, strict=False):
        order = np.argsort(profile["x"])
        r, pressure = profile["x"][order], profile["pressure"][order]
        left.plot(r, pressure / DOWN, lw=1, label=f"friction {friction}")
    left.set(xlabel="$r$", ylabel="pressure over $E/100$", ylim=(0.85, 1.2))
    shear = abs(profiles[2]["shear"]) / DOWN
    order = np.argsort(profiles[2]["x"])
    right.plot(profiles[2]["x"][order], shear[order], "C2", lw=1, label="shear")
    bound = 0.3 * profiles[2]["pressure"][order] / DOWN
    right.plot(
        profiles[2]["x"][order], bound, "k--", lw=1, label=r"0.3 $\times$ pressure"
    )
    right.axvline(C, color="0.7", lw=0.8, zorder=0)
    right.set(xlabel="$r$", ylabel="shear over $E/100$", ylim=(0, 0.4))
    left.legend(frameon=False)
    right.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: forces within 0.05%, without friction to round-off; the stick zone
# within 3%; the energy of bonded ends in its interval, which is proved.

assert all(run.reached for run in runs)
assert np.all(abs(force / FORCE - 1) < 5e-4)
assert abs(force[0] / FORCE[0] - 1) < 1e-9
assert abs(stick / C - 1) < 0.03
assert energy.guaranteed
assert 2 * energy.low < ENERGY < 2 * energy.high
