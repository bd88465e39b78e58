"""Reference cases of periodic bodies: a laminate, and a wavy surface that is flattened.

The first line of each docstring is the title of the case on the page, the rest its
geometry.
"""

from __future__ import annotations

from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip
from reference_numbers import Meshes, Result, exactly  # isort: skip

E, NU = 200.0, 0.3
UNIAXIAL = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
"""Modulus of a strip between sides that stay apart as they are, plane strain."""
HEIGHT, PRESSURE = 0.01, 8.0


def layers_in_turn() -> Result:
    """Stretch and shear layers that are soft and stiff in turn.

    Unit cell, soft (E = 200) for x < 0.5, stiff (E = 2000) beyond, nu = 0.3, plane
    strain, repeated along x and y. The mean strain has the components xx = 0.001,
    yy = -0.0005 and xy = 0.0004. In each layer strain and stress are homogeneous, the
    tractions across the layers and the strain along them are common.
    """
    strain = np.array([[0.001, 0.0004], [0.0004, -0.0005]])
    cell = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)).named(
        regions={"soft": ec.where(x=(0.0, 0.5)), "stiff": ec.where(x=(0.5, 1.0))}
    )
    sides: list[Any] = []
    for names in (("left", "right"), ("bottom", "top")):
        sides.append(ec.Periodic(*names, mean_strain=strain.tolist()))
    scene = ec.Scene(ec.Elastic({"soft": E, "stiff": 10 * E}, NU), sides)
    meshes = Meshes(scene, cell, 1e-3)

    moduli = np.array([1.0, 10.0]) * UNIAXIAL
    share = NU / (1 - NU)
    across = (strain[0, 0] + share * strain[1, 1]) / np.mean(1 / moduli)
    along = share * across + np.mean(moduli) * (1 - share**2) * strain[1, 1]
    shear = 2 * strain[0, 1] / np.mean(2 * (1 + NU) / (np.array([1.0, 10.0]) * E))
    energy = across * strain[0, 0] + along * strain[1, 1] + 2 * shear * strain[0, 1]
    return meshes.result(exactly(meshes.energy("strain energy", "force"), energy / 2))


def flattened_wave() -> Result:
    """Press a wavy surface on a plane until it is flat.

    Rectangle (0, 1) x (0, 1), E = 200, nu = 0.3, plane strain, repeated along x. The
    pressure on the top is 8; below is a frictionless plane at the distance
    0.01 (1 - cos(2 pi x)). It is closed everywhere, so that the stress is the uniform
    one and an Airy stress function of one wave.
    """

    def gap(x: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
        return HEIGHT * (1 - ufl.cos(2 * np.pi * x[0]))

    sides: list[Any] = [ec.Periodic("left", "right")]
    scene = ec.Scene(
        ec.Elastic(E, NU),
        sides,
        [ec.Traction("top", (0.0, -PRESSURE))],
        [ec.Contact("bottom", gap=gap)],
    )
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    meshes = Meshes(scene, block, 1e-3)
    amplitude = HEIGHT * _pressure_of_wave()
    energy = -PRESSURE * HEIGHT - PRESSURE**2 / UNIAXIAL / 2 + amplitude * HEIGHT / 4
    return meshes.result(exactly(meshes.energy("potential energy", "force"), energy))


def _pressure_of_wave() -> float:
    """Return the pressure of a wave of height 1 on the lower side of a unit strip.

    With ``phi = f(y) cos(k x)`` of f in cosh, sinh, y cosh and y sinh of k y, the
    shear is zero on both sides and the traction on the upper one. The displacement
    along y follows from ``E' du_y/dy = sigma_yy - nu/(1 - nu) sigma_xx``.
    """
    k = 2 * np.pi
    share = NU / (1 - NU)

    def rows(y: float) -> np.ndarray:
        """Return f, f' and ``E' u_y`` of the four functions."""
        cosh, sinh = np.cosh(k * y), np.sinh(k * y)
        f = np.array([cosh, sinh, y * cosh, y * sinh])
        slope = np.array([k * sinh, k * cosh, cosh + k * y * sinh, sinh + k * y * cosh])
        # The integral of f over y.
        integral = np.array(
            [sinh / k, cosh / k, y * sinh / k - cosh / k**2, y * cosh / k - sinh / k**2]
        )
        return np.stack([f, slope, -(k**2) * integral - share * slope])

    lower, upper = rows(0.0), rows(1.0)
    matrix = np.stack([lower[1], upper[0], upper[1], lower[2]])
    plane = E / (1 - NU**2)
    f = np.linalg.solve(matrix, [0.0, 0.0, 0.0, plane])
    return float(k**2 * abs(lower[0] @ f))
