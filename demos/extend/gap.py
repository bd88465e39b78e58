r"""
A foundation of your own
========================

A rigid foundation is its gap: the distance :math:`g(x)` of a point to it. Its normal is
then the direction in which the distance falls,

.. math:: n = -\frac{\nabla g}{|\nabla g|}.

Here the foundation has waves, :math:`y = A (\cos 2 \pi m x - 1)`. The height above
them, divided by the length of its gradient, is the distance to first order, which is
enough where the body is near.

The normal is taken facet by facet, as the facets of the mesh are flat. So where a body
slides along a curved foundation the pressure jumps from one facet to the next. The
error counts this; the resultant is much better.

A block without friction is pressed on the waves and moved aside. It touches the crests
only. A crest that is touched on its flank pushes along its normal, and so aside: the
waves hold the block without friction, as cobbles hold a shoe. A flat foundation does
not.
"""

from dataclasses import dataclass

import numpy as np
import ufl

import erc_contact as ec


@dataclass(frozen=True)
class Waves:
    """The distance to y = a (cos(2 pi m x) - 1) [length], with crests at 0, 1/m, ..."""

    a: float
    m: float

    def __call__(self, x):
        """The gap at a position, UFL."""
        k = 2 * np.pi * self.m
        slope = -self.a * k * ufl.sin(k * x[0])
        return (x[1] - self.a * (ufl.cos(k * x[0]) - 1)) / ufl.sqrt(1 + slope**2)


# %%
# ``normal="gap"`` takes the normal from the gap, facet by facet.


def pressed(gap, aside):
    """A block pressed down and moved aside: the run, the force, where it is closed."""
    top = ec.Displacement("top", (aside, -0.02))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), top, contacts=ec.Contact("bottom", gap=gap, normal="gap")
    )
    history = ec.adapt(
        scene,
        ec.rectangle((-0.5, 0.0), (1.5, 1.0), cells=(16, 8)),
        accuracy=0.1,
        degree=2,
    )
    assert history.reached
    profile = history.profile("bottom")
    return history, history.force("bottom").force, profile["x"][profile["pressure"] > 0]


history, force, closed = pressed(Waves(a=0.05, m=1.0), aside=0.003)
history.save("results/gap", pictures=True)

# %%
# What must hold: closed about the crests, open in the valleys, held aside. And on a
# foundation without waves closed all along, harder pressed, not held.

assert np.all(abs(closed - closed.round()) < 0.4)
assert set(closed.round()) == {0.0, 1.0}
assert force[0] < -0.01 * force[1] < 0

_, flat, closed = pressed(Waves(a=0.0, m=1.0), aside=0.003)
assert abs(flat[0]) < 1e-9 < force[1] < flat[1]
assert (closed.min(), closed.max()) == (-0.5, 1.5)
