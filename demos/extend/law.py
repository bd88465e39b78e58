r"""
A friction law of your own
==========================

Coulomb's friction :math:`\mu p` grows with the pressure :math:`p` without end. In metal
forming the pressure is so high that the softer surface yields first: the shear cannot
exceed its yield stress :math:`s`,

.. math:: b(p) = \min(\mu p, s).

A law is a small class: the names of its parameters, and its friction bound :math:`b` in
UFL. The parameters are numbers or callables of x, so none of them is compiled into a
form. This bound never decreases and is concave in p. So the tractions that it allows
are a convex set, and the error is certified as for Coulomb's law. The package checks
both.

A block is pressed and dragged until all of its bottom slips. At its rear end the
pressure is low, and friction is Coulomb's. Elsewhere the shear stays at the limit, also
under the peak of the pressure at the front, and the friction force is less than
Coulomb's.
"""

import numpy as np
import ufl

import erc_contact as ec


class Limited:
    """Friction coefficient mu [-] and limit s of the shear traction [force/area]."""

    parameters = ("mu", "s")

    def __init__(self, mu, s):
        self.mu, self.s = mu, s

    def friction_bound(self, pressure, mu, s):
        """The most that the shear traction may be [force/area]."""
        return ufl.min_value(mu * pressure, s)


# %%
# A contact takes the law as it takes a coefficient.


def dragged(friction):
    """A block that is pressed down and dragged until all of its bottom slips."""
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.1, -0.02))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )
    return ec.adapt(
        scene, ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4)), accuracy=0.05
    )


limited, coulomb = dragged(Limited(mu=0.3, s=0.006)), dragged(0.3)
limited.save("results/law", pictures=True)

# %%
# What must hold: the shear is at its bound, which is the limit where the pressure is
# high; the force is less than the limit times the length 2 of the contact, and
# Coulomb's is more.

contact = limited.profile("bottom")
high = contact["pressure"] > 0.006 / 0.3
assert limited.reached
assert np.all(
    abs(contact["shear"]) <= np.minimum(0.3 * contact["pressure"], 0.006) * (1 + 1e-9)
)
assert np.all(contact["status"] == 1)
assert 0 < np.count_nonzero(high) < len(high)
assert (
    abs(limited.force("bottom").force[0])
    < 2.0 * 0.006
    < abs(coulomb.force("bottom").force[0])
)
