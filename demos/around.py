r"""
Around a circle: friction follows the velocity
==============================================

A pressed box is moved around a circle. Coulomb's law is about rates: the friction on a
body that slides is against its velocity :math:`v`,

.. math:: q = -\mu p\, \frac{v}{|v|}.

Around a circle this is along the tangent. A law of the displacement, as one static step
has it, gives a friction towards the centre. Both have the size :math:`\mu P`; only the
direction tells them apart. And only the first one costs energy: after the whole way
round the body is back where it began, its strain energy is what it was, and friction
has taken :math:`\mu P` times the circumference, but for what the box bends.

The way is cut into steps. In each of them friction acts on the displacement since the
step before (backward Euler), which is the velocity times the time, up to the length of
the step.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/around")
MU, RADIUS = 0.3, 0.2
ANGLES = 2 * np.pi * np.arange(17) / 16


def scene_at(t):
    """Pressed and moved to the circle at t = 0, then once around it."""
    x, y = RADIUS * np.cos(t), RADIUS * np.sin(t)
    return ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=ec.Displacement("top", (x, y, -0.03)),
        contacts=ec.Contact("bottom", friction=MU),
    )


# %%
# ``evolve`` takes the scene as a function of time, and the times.

ec.log_to_console()
box = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 0.5), cells=(3, 3, 2))
evolution = ec.evolve(scene_at, box, ANGLES, accuracy=0.3)
root = evolution.error.domain.comm.rank == 0
ec.output.draw_deformed(evolution.error, FOLDER / "deformed.png")

# %%
# The direction of each step, the friction along it, and the energy that friction takes.

force = evolution.force("bottom")
middle = (ANGLES[1:] + ANGLES[:-1]) / 2  # the direction of a step
against = np.column_stack([np.sin(middle), -np.cos(middle)])
along = (force[1:, :2] * against).sum(axis=1) / np.linalg.norm(force[1:, :2], axis=1)
ratio = np.linalg.norm(force[1:, :2], axis=1) / force[1:, 2]
taken, path = (
    evolution.steps[-1].dissipated - evolution.steps[0].dissipated,
    16 * 2 * RADIUS * np.sin(np.pi / 16),
)
static = ec.solve(scene_at(ANGLES[-1]), box)  # one step from rest to the same place
towards = static.force("bottom").force[:2]
if root:
    print(f"friction over mu P {ratio[-1] / MU:.4f}")
    print(f"cosine of friction and velocity {-along[4:].min():.4f}")
    print(f"taken {taken:.4e}, mu P times the path {MU * force[-1, 2] * path:.4e}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(5.0, 5.0), layout="constrained")
    place = RADIUS * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
    axes.plot(*place.T, "k-o", lw=0.8, ms=3, label="way of the box")
    axes.quiver(
        *place[1:].T, *force[1:, :2].T, color="C0", width=0.006, label="friction on it"
    )
    axes.quiver(
        *place[-1], *towards, color="C3", width=0.006, label="of one static step"
    )
    axes.set(
        xlabel="$x$",
        ylabel="$y$",
        aspect="equal",
        xlim=(-0.32, 0.32),
        ylim=(-0.32, 0.36),
    )
    axes.legend(frameon=False, ncols=2, loc="upper center")
    figure.savefig(FOLDER / "friction.png", dpi=150)

# %%
# What must hold: friction at its limit, against the velocity (the box lags behind by
# what it bends); the energy; and the static step has its friction along the
# displacement.

assert evolution.reached
assert np.all(along[4:] > 0.97)
assert np.allclose(ratio[4:], MU, rtol=1e-3)
assert abs(taken / (MU * force[-1, 2] * path) - 1) < 0.1
assert towards[0] < 0.0 < -force[-1, 1]
assert abs(towards[0]) > 10 * abs(towards[1])
assert abs(force[-1, 1]) > 2 * abs(force[-1, 0])
