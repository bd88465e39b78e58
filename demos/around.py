"""A pressed box in space that is moved around a circle: friction follows the velocity, not the displacement.

Coulomb's law is about rates: the friction on a body that slides is against its velocity. Where a body slides around a
circle, this is along the tangent. A law of the displacement, as one static step has it, gives a friction towards the
centre. After the whole way round the body is back where it began, and friction has taken mu P times the circumference,
but for what the box bends.
"""

import numpy as np

import erc_contact as ec

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


ec.log_to_console()
box = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 0.5), cells=(3, 3, 2))
evolution = ec.evolve(scene_at, box, ANGLES, accuracy=0.3)
root = evolution.error.domain.mesh.comm.rank == 0

force = evolution.force("bottom")
middle = (ANGLES[1:] + ANGLES[:-1]) / 2  # the direction of a step
against = np.column_stack([np.sin(middle), -np.cos(middle)])
along = (force[1:, :2] * against).sum(axis=1) / np.linalg.norm(force[1:, :2], axis=1)
ratio = np.linalg.norm(force[1:, :2], axis=1) / force[1:, 2]
taken, path = evolution.steps[-1].dissipated - evolution.steps[0].dissipated, 16 * 2 * RADIUS * np.sin(np.pi / 16)
if root:
    print(f"friction over mu P {ratio[-1] / MU:.4f}, cosine with the velocity {-along[4:].min():.4f}")
    print(f"taken {taken:.4e}, mu P times the path {MU * force[-1, 2] * path:.4e}")
assert evolution.reached
assert np.all(along[4:] > 0.97)  # the box lags behind by what it bends
assert np.allclose(ratio[4:], MU, rtol=1e-3)
assert abs(taken / (MU * force[-1, 2] * path) - 1) < 0.1

static = ec.solve(scene_at(ANGLES[-1]), box)  # one step from rest to the same place
towards = static.force("bottom").force[:2]
assert abs(towards[0]) > 10 * abs(towards[1])  # along the displacement, not along the way
assert abs(force[-1, 1]) > 2 * abs(force[-1, 0])
