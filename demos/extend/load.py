r"""
A load of your own
==================

Two loads that depend on where they act: the pressure of water on a wall, and the
centrifugal force of a rotation,

.. math:: t = -w \max(L - y, 0)\, n, \qquad f = \rho \omega^2 x\, e_x.

A load has a density: a force per area if it names a part of the boundary, a force per
volume if ``facets`` is None. The names in ``parameters`` are numbers, vectors or
callables of x; ``density`` gets them by name, as UFL.

*A dam* holds the water by its weight and by friction. The water pushes by :math:`w
L^2/2` and tips it about its foot by :math:`w L^3/6`. It slides unless :math:`\mu` times
its weight is more, and tips unless the weight's moment is more. On the water's side the
pressure falls to nothing; there it would open, and water creep in.

*A blade* between x = 1 and 2 turns in a drum. The drum holds it by the mean pressure
:math:`\rho \omega^2 (2^2 - 1^2)/2`.
"""

from dataclasses import dataclass

import numpy as np
import ufl

import erc_contact as ec


@dataclass(frozen=True)
class Water:
    """The pressure of water of a specific weight [force/volume] below its level."""

    facets: str
    weight: float
    level: float
    parameters = ("weight", "level")

    def density(self, x, n, weight, level):
        """The force per area: the pressure, against the outward normal n."""
        return -weight * ufl.max_value(level - x[len(n) - 1], 0) * n


@dataclass(frozen=True)
class Centrifugal:
    """The force of a rotation about x = 0; `strength` is rho omega^2."""

    strength: float
    facets = None
    parameters = ("strength",)

    def density(self, x, n, strength):
        """The force per volume; n is None."""
        return strength * x[0], 0.0


def solved(domain, loads, contact, *supports):
    """A body that is loaded, to 25%."""
    return ec.adapt(
        ec.Scene(ec.Elastic(1e4, 0.0), supports, loads, contact), domain, accuracy=0.25
    )


# %%
# The dam: what the water does, and what the foundation does.

wall, weight = (
    ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(4, 8)),
    ec.BodyForce((0.0, -2.4)),
)
dam = solved(
    wall, [Water("left", 1.0, 1.5), weight], ec.Contact("bottom", friction=0.7)
)
dam.save("results/load", pictures=True)
assert dam.reached
assert np.allclose(
    [*dam.force("left").force, *dam.force("left").moment],
    (1.5**2 / 2, 0.0, -(1.5**3) / 6),
)
assert np.allclose(dam.force("bottom").force, (-(1.5**2) / 2, 4.8))

# %%
# The blade: what the drum does.

bar, roller = (
    ec.rectangle((1.0, 0.0), (2.0, 0.5), cells=(8, 4)),
    ec.Displacement("bottom", (None, 0.0)),
)
blade = solved(bar, Centrifugal(2.0), ec.Contact("right"), roller)
assert np.allclose(blade.force("right").force, (-2.0 * (2.0**2 - 1) / 2 * 0.5, 0.0))
