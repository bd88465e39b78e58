"""A new foundation: one with waves, whose normal turns.

A foundation is its gap, a callable of the position x. With normal="gap" its normal is -grad g/|grad g|, facet by facet.
The gap is measured along this normal. So it is the height above the waves, divided by the length of the gradient of
this height.
"""

from dataclasses import dataclass

import numpy as np
import ufl

import erc_contact as ec


@dataclass(frozen=True)
class Waves:
    """The distance to the surface y = a (cos(2 pi m x) - 1), with crests at x = 0, 1/m, 2/m and so on [length]."""

    a: float
    m: float

    def __call__(self, x):
        """The gap at a position, UFL."""
        k = 2 * np.pi * self.m
        slope = -self.a * k * ufl.sin(k * x[0])
        return (x[1] - self.a * (ufl.cos(k * x[0]) - 1)) / ufl.sqrt(1 + slope**2)


def pressed(gap, aside):
    """A block without friction, pressed down and moved aside: the force of the foundation, and where it is closed."""
    top = ec.Displacement("top", (aside, -0.02))
    contact = ec.Contact("bottom", gap=gap, normal="gap")
    scene = ec.Scene(ec.Elastic(1.0, 0.3), top, contacts=contact)
    history = ec.adapt(scene, ec.rectangle((-0.5, 0.0), (1.5, 1.0), cells=(16, 8)), accuracy=0.2)
    assert history.reached
    profile = history.error.profile("bottom")
    return history.error.force("bottom").force, profile["x"][profile["pressure"] > 0]


force, closed = pressed(Waves(a=0.05, m=1.0), aside=0.01)
assert np.all(abs(closed - closed.round()) < 0.4)  # closed about the crests, open in the valleys
assert set(closed.round()) == {0.0, 1.0}
assert force[0] < -0.01 * force[1] < 0  # the waves hold the block without friction

flat, closed = pressed(Waves(a=0.0, m=1.0), aside=0.01)
assert abs(flat[0]) < 1e-9 < flat[1]
assert flat[1] > force[1]
assert (closed.min(), closed.max()) == (-0.5, 1.5)
