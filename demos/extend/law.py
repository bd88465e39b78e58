"""A new friction law: Coulomb's friction with a limit, b(p) = min(mu p, s), as in metal forming.

The shear traction cannot exceed the yield stress s of the softer surface, however large the pressure p is. The bound
never decreases and is concave in p. So the tractions that it allows are a convex set, and the error is certified.
"""

import numpy as np
import ufl

import erc_contact as ec


class Limited:
    """Friction coefficient mu [-] and limit s of the shear traction [force/area], numbers or callables of x."""

    parameters = ("mu", "s")

    def __init__(self, mu, s):
        self.mu, self.s = mu, s

    def friction_bound(self, pressure, mu, s):
        """The most that the shear traction may be [force/area]."""
        return ufl.min_value(mu * pressure, s)


def pushed(friction):
    """A block that is pressed down and dragged until all of its bottom slips: force and profile of the contact."""
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.1, -0.02))],
        contacts=[ec.Contact("bottom", friction)],
    )
    history = ec.adapt(scene, ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4)), accuracy=0.1)
    assert history.reached
    return history.error.force("bottom").force, history.error.profile("bottom")


force, contact = pushed(Limited(mu=0.3, s=0.006))
coulomb, _ = pushed(0.3)
high = contact["pressure"] > 0.006 / 0.3
assert np.all(abs(contact["shear"]) <= np.minimum(0.3 * contact["pressure"], 0.006) * (1 + 1e-9))
assert np.all(contact["status"] == 1)
assert 0 < np.count_nonzero(high) < len(high)
assert abs(force[0]) < 2.0 * 0.006 < abs(coulomb[0])
