r"""
A set of tractions of your own
==============================

A woven strap carries more shear across its threads than along them, and never more
than the weave does: whatever the pressure, the shear lies in an ellipse,

.. math:: \left(\frac{r_1}{s}\right)^2 + \left(\frac{r_2}{q s}\right)^2 \le 1.

A friction law with the attributes ``axes`` and ``ratio`` has such a set: its bound
holds along the axis, and ``ratio`` times as much across it. The set is convex, so the
error is certified. With a bound that does not depend on the pressure e bounds the
error of the displacement, and intervals are proved.

A pad is pressed on the strap and pulled at 45 degrees to its threads. The shear is not
opposite to the slip: friction takes the greatest work of all shears in the ellipse, so
it turns towards the stronger direction.
"""

import numpy as np

import erc_contact as ec


class Woven:
    """Shear s along the threads [force/area], and more across them."""

    parameters = ("s",)

    def __init__(self, s, axes, ratio):
        self.s, self.axes, self.ratio = s, axes, ratio

    def friction_bound(self, pressure, s):
        """The most that the shear may be along the threads [force/area]."""
        return s


# %%
# All of the pad slides.

s, ratio = 0.0005, 3.0
strap = Woven(s, axes=(1.0, 0.0, 0.0), ratio=ratio)
scene = ec.Scene(
    material=ec.Elastic(E=1.0, nu=0.3),
    supports=[ec.Displacement("top", (0.2, 0.2, -0.02))],
    contacts=[ec.Contact("bottom", friction=strap)],
)
pad = ec.box((0.0, 0.0, 0.0), (2.0, 2.0, 1.0), cells=(4, 4, 2))
history = ec.adapt(scene, pad, accuracy=0.25)
history.save("results/woven", pictures=True)

# %%
# What must hold: the shear is on the ellipse, at the point whose normal is opposite to
# a slip of 45 degrees, ``-s (1, q^2)/sqrt(1 + q^2)`` on an area of 4; and the interval
# of the energy is proved.

force = history.force("bottom").force
expected = -4.0 * s * np.array([1.0, ratio**2]) / np.sqrt(1.0 + ratio**2)
assert history.reached
assert np.allclose(force[:2], expected, rtol=0.05)
assert ec.potential_energy(history).guaranteed
