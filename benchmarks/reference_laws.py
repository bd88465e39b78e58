"""Reference cases of bodies that yield, orthotropic bodies, and forces at a distance.

The first line of each docstring is the title of the case on the page, the rest its
geometry. What a tube does that yields is integrated along its radius, by a solver of
two-point problems.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip
from reference_drawing import part_of_disc  # isort: skip
from reference_numbers import Meshes, Other, Result, Told, beside  # isort: skip
from reference_numbers import exactly, moved, run, says  # isort: skip
from reference_turned import OUTWARD, between_plates  # isort: skip
from scipy.integrate import solve_ivp  # type: ignore[import-untyped]  # isort: skip
from scipy.optimize import OptimizeResult, brentq  # type: ignore[import-untyped]  # isort: skip

INNER, OUTER, HEIGHT = 20.0, 40.0, 10.0
"""Radii and height of the tubes [mm]."""
RADIAL = "integration along the radius"
"""Source of numbers of the tubes, in words."""

Heat = Callable[[float], float]
"""Type of a strain of heat at a radius [-]."""


@dataclass(frozen=True)
class Tube:
    """Hold a tube that yields.

    Attributes:
        inner: Its inner radius [length].
        outer: Its outer radius [length].
        modulus: Young's modulus [force/area].
        ratio: Poisson's ratio [-].
        strains: Plastic strains of the points of its curve of hardening [-].
        stresses: Yield stresses of the points [force/area].
    """

    inner: float
    outer: float
    modulus: float
    ratio: float
    strains: tuple[float, ...]
    stresses: tuple[float, ...]

    @property
    def shear(self) -> float:
        """Return its shear modulus [force/area]."""
        return self.modulus / (2 * (1 + self.ratio))

    @property
    def bulk(self) -> float:
        """Return its bulk modulus [force/area]."""
        return self.modulus / (3 * (1 - 2 * self.ratio))


STEEL = Tube(INNER, OUTER, 206e3, 0.3, (0.0, 0.002, 0.01, 0.05), (355.0, 400.0, 450.0, 520.0))
"""The tube of steel [mm, MPa]."""


def tube_mesh() -> ec.Domain:
    """Return the first mesh of the tubes."""
    return ec.rectangle((INNER, 0.0), (OUTER, HEIGHT), cells=(8, 4))


def plastic_stress(tube: Tube, radial: float, hoop: float, heat: float) -> np.ndarray:
    """Return the stresses (radial, hoop) of a point of a tube without axial strain.

    Args:
        tube: The tube.
        radial: The radial strain of the point [-].
        hoop: Its hoop strain [-].
        heat: Its strain of heat [-].
    """
    strain = np.array([radial, hoop, 0.0])
    volume = strain.sum() / 3
    deviator = 2 * tube.shear * (strain - volume)
    trial = np.sqrt(1.5) * np.linalg.norm(deviator)
    share = 1.0
    if trial > tube.stresses[0]:
        stiffness = 3 * tube.shear

        def beyond(plastic: float) -> float:
            allowed = np.interp(plastic, tube.strains, tube.stresses)
            return float(trial - stiffness * plastic - allowed)

        share = 1 - stiffness * brentq(beyond, 0.0, trial / stiffness, xtol=1e-16) / trial
    return (share * deviator + 3 * tube.bulk * (volume - heat))[:2]


def radial_strain(tube: Tube, stress: float, hoop: float, heat: float) -> float:
    """Return the radial strain of a point whose radial stress is given [-]."""

    def beyond(radial: float) -> float:
        return float(plastic_stress(tube, radial, hoop, heat)[0] - stress)

    return float(brentq(beyond, -1.0, 1.0, xtol=1e-16))


def yielding(tube: Tube, pressure: float, heat: Heat) -> tuple[Callable[[float], float], float]:
    """Solve a tube that yields, as two equations of the first order along the radius.

    They are ``u' = eps_r(sigma_r, u/r)`` and ``sigma_r' = (sigma_h - sigma_r)/r``, with
    the pressure inside, and the displacement there with which the outside is free.

    Args:
        tube: The tube.
        pressure: Inner pressure [force/area].
        heat: Strain of heat at a radius [-].

    Returns:
        Radial displacement of a radius [length], and force on an end [force].
    """

    def slopes(r: float, state: np.ndarray) -> tuple[float, float, float]:
        u, stress, _ = state
        warm = heat(r)
        radial = radial_strain(tube, stress, u / r, warm)
        both = plastic_stress(tube, radial, u / r, warm)
        # The trace of the stress is elastic.
        axial = 3 * tube.bulk * (radial + u / r - 3 * warm) - both.sum()
        return radial, (both[1] - stress) / r, -2 * np.pi * r * axial

    def integrated(u_inner: float) -> OptimizeResult:
        start = (u_inner, -pressure, 0.0)
        radii = (tube.inner, tube.outer)
        return solve_ivp(slopes, radii, start, rtol=1e-9, atol=1e-12, dense_output=True)

    def outer_stress(u_inner: float) -> float:
        return float(integrated(u_inner).y[1, -1])

    found = integrated(brentq(outer_stress, 0.0, 0.03 * tube.inner, xtol=1e-12))
    return lambda radius: float(found.sol(radius)[0]), float(found.y[2, -1])


def yielding_case(pressure: float, heat: Heat, strains: list[ec.GivenStrain]) -> Result:
    """Run a tube that yields beside its integration."""
    law = ec.Plastic(
        STEEL.modulus,
        STEEL.ratio,
        hardening=ec.HardeningCurve(STEEL.strains, STEEL.stresses),
        hypothesis="axisymmetric",
    )
    loads = [ec.Traction("left", pressure=pressure)] if pressure else []
    u, force = yielding(STEEL, pressure, heat)
    told = {f"u at radius {r:g}": moved((r, 5.0), 0, u(r)) for r in (20.0, 30.0, 40.0)}
    scene = ec.Scene(law, between_plates("bottom", "top"), loads, strains=strains)
    told["force of an end"] = Told(lambda error: error.force("bottom").force[1], "N", force)
    meshes = run(scene, tube_mesh(), 4e-4, told)
    return meshes.result(*beside(meshes, told, RADIAL))


def yielding_tube() -> Result:
    """Put a thick tube that yields by a curve under pressure from inside.

    Tube, r from 20 to 40 mm and z from 0 to 10, E = 206 000 MPa, nu = 0.3, yield
    stresses 355, 400, 450, 520 MPa at plastic strains of 0, 0.2, 1, 5%, linear between
    them. Inner pressure 260 MPa, in one step. Both ends have u_z = 0.
    """
    return yielding_case(260.0, lambda _: 0.0, [])


def heated_tube() -> Result:
    """Heat a thick tube from inside until it yields.

    The tube of `yielding_tube` without pressure. The strain of heat is 0.006 inside and
    zero outside, with the logarithm of the radius.
    """
    slope = 6e-3 / np.log(OUTER / INNER)

    def heat(r: float) -> float:
        return float(slope * np.log(OUTER / r))

    def temperature(x: ufl.SpatialCoordinate) -> ufl.core.expr.Expr:
        return slope * ufl.ln(OUTER / x[0])

    return yielding_case(0.0, heat, [ec.ThermalStrain(1.0, temperature)])


def plastic_cylinder() -> Result:
    """Put a thin tube that yields as a whole under pressure from inside, as COMET does.

    Quarter of a ring, radii 1 and 1.3, plane strain, E = 70 000, nu = 0.3, yield stress
    250, linear isotropic hardening with the tangent modulus E/100. The pressure inside
    is sqrt(1.1) times the limit load 2/sqrt(3) 250 ln 1.3 without hardening, in one
    step. The other code is the demo of a von Mises material of Numerical Tours of
    Computational Mechanics with FEniCSx, run by us with one increment: triangles of
    degree 2 of the size 0.2, which is its own, 0.05 and 0.02, with straight sides.
    """
    modulus = 70e3
    slope = modulus / 99
    tube = Tube(1.0, 1.3, modulus, 0.3, (0.0, 1.0), (250.0, 250.0 + slope))
    limit = 2 / np.sqrt(3) * tube.stresses[0] * np.log(tube.outer / tube.inner)
    pressure = float(np.sqrt(1.1) * limit)
    u, _ = yielding(tube, pressure, lambda _: 0.0)
    sides = {"bottom": (1.0, 0.0, 1.3, 0.0), "left": (0.0, 1.0, 0.0, 1.3)}
    domain = part_of_disc({"inner": 1.0, "outer": 1.3}, 0.1, sides)
    law = ec.Plastic(modulus, 0.3, 250.0, hardening=slope, hypothesis="plane strain")
    supports = [
        ec.Displacement("bottom", (None, 0.0)),
        ec.Displacement("left", (0.0, None)),
    ]
    scene = ec.Scene(law, supports, [ec.Traction("inner", pressure=pressure)])
    told = {f"u at radius {r:g}": moved((r, 0.0), 0, u(r)) for r in (1.0, 1.3)}
    meshes = run(scene, domain, 2e-3, told)
    inside, outside = beside(meshes, told, RADIAL)
    for size, displacement in ((0.2, 0.021493), (0.05, 0.023874), (0.02, 0.023983)):
        says(inside, Other(f"COMET, size {size:g}", displacement, rounding=5e-7))
    return meshes.result(inside, outside)


def orthotropic_tube() -> Result:
    """Put a thick tube wound of fibres under pressure from inside, Lekhnitskii.

    Tube, r from 20 to 40 mm and z from 0 to 10. Moduli (r, z, hoop) 10 000, 10 000 and
    140 000 MPa, nu_rz = 0.4, nu_rh = nu_zh = 0.02, all shear moduli 5 000 MPa. Inner
    pressure 50 MPa. Both ends have u_z = 0. With the compliances of plane strain b the
    radial stress is ``A r^(k-1) + B r^(-k-1)``, where k^2 = b_rr/b_hh.
    """
    moduli, nu_rz, nu_rh, pressure = (10e3, 10e3, 140e3), 0.4, 0.02, 50.0
    law = ec.OrthotropicElastic(
        moduli, (nu_rz, nu_rh, nu_rh), (5e3, 5e3, 5e3), hypothesis="axisymmetric"
    )
    of_r, of_z, of_hoop = moduli
    b_rr = 1 / of_r - nu_rz**2 / of_r**2 * of_z
    b_hh = 1 / of_hoop - (nu_rh / of_z) ** 2 * of_z
    b_rh = -nu_rh / of_r - nu_rz / of_r * nu_rh / of_z * of_z
    k = np.sqrt(b_rr / b_hh)
    powers = np.array([[r ** (k - 1), r ** (-k - 1)] for r in (INNER, OUTER)])
    rising, falling = np.linalg.solve(powers, (-pressure, 0.0))

    def u(r: float) -> float:
        radial = rising * r ** (k - 1) + falling * r ** (-k - 1)
        hoop = k * (rising * r ** (k - 1) - falling * r ** (-k - 1))
        return float(r * (b_rh * radial + b_hh * hoop))

    loads = [ec.Traction("left", pressure=pressure)]
    scene = ec.Scene(law, between_plates("bottom", "top"), loads)
    meshes = Meshes(scene, tube_mesh(), 3e-4)
    energy = meshes.energy("strain energy", "N mm", -1.0)
    work = np.pi * INNER * HEIGHT * pressure * u(INNER)
    numbers = [exactly(energy, work, "Lekhnitskii")]
    for part, radius in (("left", INNER), ("right", OUTER)):
        goal = ec.MeanDisplacement(part, OUTWARD)
        moved_by = meshes.goal(goal, "mm", f"u_r at {radius:g}")
        numbers.append(exactly(moved_by, u(radius), "Lekhnitskii"))
    return meshes.result(*numbers)


def bars_pulled_from_beside() -> Result:
    """Pull bars by forces beside their axes, in the plane and in 3D.

    A bar (0, 100) x (0, 20) in mm, in 3D (0, 100) x (0, 30) x (0, 20), E = 210 000 MPa,
    nu = 0.3, in plane stress. Forces of 900 N, in the plane 30 N/mm, pull its ends
    apart at the height 35, in 3D at y = 40, too. Each end shares its force. Nothing
    else holds the bar. The stress is linear in the section.
    """
    modulus, length, height, width, force = 210e3, 100.0, 20.0, 30.0, 900.0
    low, high = (0.0, 0.0), (length, height)
    flat = ec.rectangle(low, high, cells=(5, 2))
    material = ec.Elastic(modulus, 0.3, hypothesis="plane stress")
    pulls = [
        ec.RemoteForce("right", (force / width, 0.0), at=(150.0, 35.0)),
        ec.RemoteForce("left", (-force / width, 0.0), at=(-50.0, 35.0)),
    ]
    in_plane = Meshes(ec.Scene(material, loads=pulls), flat, 1e-3)
    square = force**2 * length / (2 * modulus)
    stretch = square / (width * height)
    bend = square * 25.0**2 * 12 / (width * height**3)
    energy = in_plane.energy("strain energy in the plane", "N", -1.0)
    in_3d = ec.box((0.0, 0.0, 0.0), (length, width, height), cells=(3, 2, 2))
    pulls = [
        ec.RemoteForce("right", (force, 0.0, 0.0), at=(150.0, 40.0, 35.0)),
        ec.RemoteForce("left", (-force, 0.0, 0.0), at=(-50.0, 40.0, 35.0)),
    ]
    meshes = Meshes(ec.Scene(ec.Elastic(modulus, 0.3), loads=pulls), in_3d, 1e-3)
    aside = square * 25.0**2 * 12 / (height * width**3)
    return meshes.result(
        exactly(energy, (stretch + bend) / width, "beam"),
        exactly(meshes.energy("strain energy in 3D", "N mm", -1.0), stretch + bend + aside, "beam"),
    )
