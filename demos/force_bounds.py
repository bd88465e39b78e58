r"""
A contact force between two bounds
==================================

Often one number is wanted: the force of a foundation. How wrong is it? The error of the
whole field says something of the field, and not of this number. But the same admissible
pair bounds the number, too.

Let :math:`\sigma` be the exact stress, and :math:`e` the error of the pair :math:`(\hat
u, \hat\sigma)`. By the theorem of Prager and Synge :math:`\sigma` lies in a ball. Its
centre is the mean of the two stresses of the pair. Its radius is :math:`e/2`, and a
little more where the contact has a part in the error. Take any displacement
:math:`\varphi` that moves the contact by one in a direction :math:`a` and is zero where
supports hold. The work of the exact stress in it is the contact force and the work of
the loads :math:`\ell(\varphi)`:

.. math:: F_a = \int r \cdot a \, ds = (\sigma, \varepsilon(\varphi)) - \ell(\varphi).

So :math:`F_a` lies in an interval around the mean of the two forces. Its half-width is
the radius times the energy norm of :math:`\varphi`. It is the narrowest for the
:math:`\varphi` of least energy, which takes one elastic solve. The interval is proved
without friction, and with Tresca friction (the shear is at most a given number). With
Coulomb's friction it is an estimate, and says so.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/force_bounds")
LIMIT = 0.002  # of the shear [force/area]

# %%
# A block, tilted and pushed: it opens on the left, and slips and sticks elsewhere. A
# callback gets the error on each mesh.

ec.log_to_console()
scene = ec.Scene(
    material=ec.Elastic(1.0, 0.3),
    supports=ec.Displacement("top", (0.1, lambda x: 0.02 - 0.04 * x[0])),
    contacts=ec.Contact("bottom", friction=ec.Tresca(LIMIT)),
)
block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))
errors, bounds = [], []


def bounded(error, step):
    """Keep the error of a mesh, and the bounds of the force and of the energy."""
    errors.append(error.relative)
    forces = [
        ec.resultant(error, "bottom", direction) for direction in ((1, 0), (0, 1))
    ]
    bounds.append((*forces, ec.potential_energy(error)))


history = ec.adapt(scene, block, accuracy=0.01, degree=2, callback=bounded)
history.save(FOLDER, pictures=True)

# %%
# With Coulomb's friction the same numbers are estimates, and say so. And a much better
# solution, to compare with.

coulomb = ec.Scene(
    scene.material, scene.supports, contacts=ec.Contact("bottom", friction=0.3)
)
estimate = ec.resultant(ec.adapt(coulomb, block, accuracy=0.05).error, "bottom", (0, 1))
fine = ec.adapt(scene, block, accuracy=0.003, degree=2)
exact = *fine.force("bottom").force, ec.potential_energy(fine.error).value

# %%
# The intervals against the error of the mesh.

names = "friction", "pressure", "potential energy"
if block.comm.rank == 0:
    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.8), layout="constrained")
    for axis, name, of_meshes, number in zip(
        axes, names, zip(*bounds, strict=True), exact, strict=True
    ):
        low, high = (
            np.array([getattr(b, end) for b in of_meshes]) for end in ("low", "high")
        )
        print(
            f"{name}: "
            + ", ".join(f"[{a:.5g}, {b:.5g}]" for a, b in zip(low, high, strict=True))
        )
        axis.fill_between(100 * np.array(errors), low, high, color="C0", alpha=0.3)
        axis.plot(100 * np.array(errors), (low + high) / 2, "o-", ms=3)
        axis.axhline(number, color="k", lw=1, ls="--")
        axis.set(xlabel="relative error of the field [%]", title=name)
        axis.invert_xaxis()
    axes[0].set_ylabel("certified interval")
    figure.savefig(FOLDER / "intervals.png", dpi=150)
    interval = f"[{estimate.low:.5g}, {estimate.high:.5g}]"
    print(f"Coulomb: {interval}, guaranteed: {estimate.guaranteed}")

# %%
# What must hold: each interval is proved, and holds the number of the better solution;
# intervals of forces shrink like the error, intervals of the energy like its square.
# Coulomb's is an estimate.

assert history.reached
for number, of_meshes in zip(exact, zip(*bounds, strict=True), strict=True):
    assert all(b.guaranteed and b.low <= number <= b.high for b in of_meshes)
width = np.array([[b.high - b.low for b in of_mesh] for of_mesh in bounds])
gain = errors[0] / errors[-1]
assert np.allclose(width[0, :2] / width[-1, :2], gain, rtol=0.1)
assert np.isclose(width[0, 2] / width[-1, 2], gain**2, rtol=0.1)
assert bounds[-1][1].low > 0.9 * exact[1] > 0.0
assert not estimate.guaranteed
