"""Two new loads: the pressure of water on a wall, and the centrifugal force of a rotation.

A load has a density: a force per area if it names a part of the boundary, a force per volume if `facets` is None. The
names in `parameters` are numbers, vectors or callables of x; `density` gets them by name, as UFL.
"""

from dataclasses import dataclass

import numpy as np
import ufl

import erc_contact as ec


@dataclass(frozen=True)
class Water:
    """The pressure of water of a specific weight [force/volume] below its level [length]."""

    facets: str
    weight: float
    level: float
    parameters = ("weight", "level")

    def density(self, x, n, weight, level):
        """The force per area: the pressure, against the outward normal n."""
        return -weight * ufl.max_value(level - x[len(n) - 1], 0) * n


@dataclass(frozen=True)
class Centrifugal:
    """The centrifugal force of a rotation about the axis x = 0.

    `strength` is the mass per volume times the square of the angular velocity [force/volume/length].
    """

    strength: float
    facets = None
    parameters = ("strength",)

    def density(self, x, n, strength):
        """The force per volume; n is None."""
        return strength * x[0], 0.0


def solved(domain, loads, contact, *supports):
    """The error of a body that is loaded, to 25%."""
    history = ec.adapt(ec.Scene(ec.Elastic(1e4, 0.0), supports, loads, contact), domain, accuracy=0.25)
    assert history.reached
    return history.error


# A dam holds the water by its weight and friction. The water pushes by w L^2/2 and tips about the origin by w L^3/6.
wall, weight = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(4, 8)), ec.BodyForce((0.0, -2.4))
dam = solved(wall, [Water("left", 1.0, 1.5), weight], ec.Contact("bottom", 0.7))
assert np.allclose([*dam.force("left").force, *dam.force("left").moment], (1.5**2 / 2, 0.0, -(1.5**3) / 6))
assert np.allclose(dam.force("bottom").force, (-(1.5**2) / 2, 4.8))

# A blade between x = 1 and 2 turns in a drum. The drum holds it by a pressure, strength (2^2 - 1^2)/2 on the mean.
bar, roller = ec.rectangle((1.0, 0.0), (2.0, 0.5), cells=(8, 4)), ec.Displacement("bottom", (None, 0.0))
blade = solved(bar, Centrifugal(2.0), ec.Contact("right"), roller)
assert np.allclose(blade.force("right").force, (-2.0 * (2.0**2 - 1) / 2 * 0.5, 0.0))
