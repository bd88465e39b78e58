r"""
A material of your own
======================

A body with straight fibres is stiffer along them: transverse isotropy. With the unit
vector :math:`a` along the fibres, :math:`M = a a^T`, Lame's moduli :math:`\lambda` and
:math:`G`, and the extra stiffness :math:`k` of the fibres, in plane strain,

.. math::

    \sigma = \lambda \operatorname{tr}(\varepsilon) I + 2 G \varepsilon
    + k\, (M : \varepsilon)\, M.

The error needs the inverse, too: the strain of a stress. The last term has rank one. So
the compliance is :math:`S`, the compliance of the isotropic part, with the correction
of Sherman and Morrison:

.. math:: \varepsilon = S \sigma - \frac{k\, (S M : \sigma)}{1 + k\, M : S M}\, S M.

The names in ``parameters`` are numbers or callables of x; the package hands them to the
members by name, as UFL. It checks that the compliance inverts the stress, and that the
stiffness is symmetric and positive.

Pressed along its fibres, the block is a column of uniform stress. Fibres that lean are
levers: pressed down, they push the foundation aside, and friction has to hold them.
"""

import numpy as np
import ufl

import erc_contact as ec


class Fibres:
    """Lame's moduli lam and G, stiffness k and angle [rad] of the fibres."""

    parameters = ("lam", "G", "k", "angle")

    def __init__(self, lam, G, k, angle):
        self.lam, self.G, self.k, self.angle = lam, G, k, angle

    def check(self, name, low, high):
        """Refuse moduli that are not positive."""
        if name != "angle" and low <= 0:
            raise ec.InputError(
                f"Fibres: {name} is {low:g}; it must be > 0 [force/area]."
            )

    def stress(self, eps, lam, G, k, angle):
        """The stress of a strain [force/area]."""
        return (
            lam * ufl.tr(eps) * ufl.Identity(2)
            + 2 * G * eps
            + k * ufl.inner(along(angle), eps) * along(angle)
        )

    def compliance(self, sigma, lam, G, k, angle):
        """The strain of a stress [-]."""
        M = along(angle)
        S_sigma, SM = (
            (s - lam / (2 * (lam + G)) * ufl.tr(s) * ufl.Identity(2)) / (2 * G)
            for s in (sigma, M)
        )
        return S_sigma - k * ufl.inner(SM, sigma) / (1 + k * ufl.inner(M, SM)) * SM

    def modulus(self, lam, G, k, angle):
        """What contact parameters are scaled by [force/area]."""
        return lam + 2 * G + k


def along(angle):
    a = ufl.as_vector([ufl.cos(angle), ufl.sin(angle)])
    return ufl.outer(a, a)


# %%
# A square that is pressed, with fibres in three directions.


def pressed(angle, friction, *supports):
    scene = ec.Scene(
        Fibres(1.0, 1.0, 20.0, angle),
        supports,
        contacts=[ec.Contact("bottom", friction=friction)],
    )
    return ec.adapt(
        scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4)), accuracy=0.15
    )


upright = pressed(
    np.pi / 2,
    0.0,
    ec.Displacement("top", (None, -0.01)),
    ec.Displacement("left", (0.0, None)),
)
left, right = (
    pressed(angle, 0.5, ec.Displacement("top", (0.0, -0.01)))
    for angle in (np.pi / 3, 2 * np.pi / 3)
)
left.save("results/material", pictures=True)

# %%
# What must hold. Upright fibres and free sides: the modulus is :math:`C_{yy} -
# C_{xy}^2/C_{xx} = 23 - 1/3`. Fibres that lean push the foundation to the side of their
# feet.

upright, left, right = (
    history.force("bottom").force for history in (upright, left, right)
)
assert np.allclose(upright, (0.0, 0.01 * (23 - 1 / 3)), atol=1e-9)
assert min(left[0] / left[1], -right[0] / right[1]) > 0.1
