r"""
Hysteresis: shakedown and sliding
=================================

A pressed block is sheared back and forth by its top. Friction remembers: the force on
the way back is not that on the way there, and the loop of force against displacement
encloses the energy that friction takes,

.. math:: D = \oint Q\, dU.

*Small amplitudes:* only the edges slip. In the first cycle they slip to where they can
stay. Then they stick: the block shakes down, and further cycles cost nothing. The loop
closes to a line.

*Large amplitudes:* the whole block slides back and forth. The force is then :math:`\mu
P`, whatever the motion, and each half of a cycle costs :math:`\mu P` times the path of
slip, again and again.

So the same joint is a spring in a weak vibration, and a damper in a strong one.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/hysteresis")
MU = 0.3
TURNS = [1.0, 1.5, 2.5, 3.5, 4.5]

# %%
# The scene at a time: pressed until t = 1, then two cycles. Each step is solved to
# 2.5%.


def cycles(amplitude):
    """Two cycles after the press, which ends at t = 1."""

    def scene_at(t):
        push = amplitude * np.interp(t, TURNS, [0.0, 1.0, -1.0, 1.0, -1.0])
        support = ec.Displacement("top", (push, -0.05 * min(t, 1.0)))
        return ec.Scene(
            ec.Elastic(1.0, 0.3), support, contacts=ec.Contact("bottom", friction=MU)
        )

    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    return ec.evolve(
        scene_at, block, [0.0, 1.0, *np.arange(1.25, 4.6, 0.25)], accuracy=0.025
    )


def halves(evolution):
    """Energy that friction takes from one turn to the next."""
    return np.diff(
        np.interp(TURNS[1:], evolution.column("time"), evolution.column("dissipated"))
    )


# %%
# ``save`` writes the loop of force against displacement, the zones of slip in time, the
# energies, one file for ParaView with all times, and a report that has it all on one
# page.

ec.log_to_console()
small, large = cycles(0.03), cycles(0.15)
large.save(FOLDER, pictures=True)
root = small.error.domain.comm.rank == 0
runs = {"small": (small, 0.03), "large": (large, 0.15)}
if root:
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
    for axis, (name, (evolution, amplitude)) in zip(axes, runs.items(), strict=True):
        moved = amplitude * np.interp(
            evolution.column("time"), TURNS, [0.0, 1.0, -1.0, 1.0, -1.0]
        )
        force = evolution.force("bottom")
        axis.plot(moved, -force[:, 0] / (MU * force[:, 1].max()), "o-", ms=3, lw=1)
        axis.set(
            xlabel="displacement of the top $U$",
            title=f"{name} amplitude",
            ylim=(-1.1, 1.1),
        )
    axes[0].set_ylabel(r"force $Q/\mu P$")
    figure.savefig(FOLDER / "loops.png", dpi=150)

# %%
# What must hold, of both: each step is as accurate as asked for, friction never gives
# energy back, and the energies balance up to the error of the meshes.

for name, (evolution, _) in runs.items():
    taken, left = (
        halves(evolution),
        abs(evolution.column("imbalance")).max() / evolution.column("stored").max(),
    )
    if root:
        shares = ", ".join(f"{energy:.3e}" for energy in taken)
        print(f"{name}: {shares} in halves of cycles; energy residual {left:.1e}")
    assert evolution.reached
    assert np.all(
        np.diff(evolution.column("dissipated"))
        >= -1e-12 * evolution.column("stored").max()
    )
    assert left < 0.025**2 + 0.01 * (name == "large")

# %%
# The small cycles shake down; in the large ones friction takes its limit times the path
# of slip, in each half alike.

first, *_, last = halves(small)
assert last < 0.02 * first

back, forth, again = halves(large)
assert abs(again / forth - 1) < 0.01
assert abs(again / back - 1) < 0.01
force = large.force("bottom")
moved = [
    profile["slip"].mean() for profile in large.profile("bottom")[-4:]
]  # in the last half of a cycle
P, path = force[-1, 1], abs(np.sum(moved))
if root:
    print(f"slides {path:.4f}: takes {again:.4e} for {MU * P * path:.4e}")
assert (
    abs(force[-1, 0] / (MU * P) - 1) < 1e-3
)  # pushed to the left at the end: friction to the right
assert abs(again / (MU * P * path) - 1) < 0.05
