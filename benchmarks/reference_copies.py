"""Reference cases of periodic and cyclic bodies, of which one copy is computed.

The first line of each docstring is the title of the case on the page, the rest its
geometry.
"""

from __future__ import annotations

from math import cos, pi, sin, tan
from typing import Any

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled
import numpy as np  # isort: skip
import ufl  # isort: skip
from reference_drawing import NEAR, opened  # isort: skip
from reference_numbers import (  # isort: skip
    Meshes,
    Number,
    Other,
    Result,
    exactly,
    pressure_at,
    says,
)

E, NU = 200.0, 0.3
UNIAXIAL = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
"""Modulus of a strip between sides that stay apart as they are, plane strain."""
HEIGHT, PRESSURE = 0.01, 8.0
STEEL, DENSITY = 210e3, 7.85e-9  # MPa, t/mm^3


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


def pressed_waves() -> Result:
    """Press a wavy surface on a plane that it touches along its crests, Westergaard.

    Rectangle (0, 1) x (0, 2), E = 200, nu = 0.3, plane strain, repeated along x. Below
    is a frictionless plane at the distance 0.01 (1 - cos(2 pi (x - 1/2))). Pressures
    p of 0.2, 0.5, 0.8 and 1.2 of the pressure p* = pi E' 0.01 that closes all act on
    the top. The contact is (2/pi) asin sqrt(p/p*) long, or closed, and on the crest the
    pressure is 2 sqrt(p p*), or p + p*. Cells and eps are of the last one.
    """
    flat = np.pi * E / (1 - NU**2) * HEIGHT
    numbers = []
    for share in (0.2, 0.5, 0.8, 1.2):
        sides: list[Any] = [ec.Periodic("left", "right")]
        scene = ec.Scene(
            ec.Elastic(E, NU),
            sides,
            [ec.Traction("top", (0.0, -share * flat))],
            [ec.Contact("bottom", gap=_crest_in_the_middle)],
        )
        probes = {
            f"contact at {share} p*": lambda error: error.contact_area("bottom").area.value,
            f"greatest pressure at {share} p*": pressure_at("bottom", 0.5, 0.05),
        }
        block = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(8, 16))
        meshes = Meshes(scene, block, 3e-3, probes)
        length, peak = (meshes.probe(name, unit) for name, unit in zip(probes, UNITS, strict=True))
        part = min(share, 1.0)
        crest = 2 * np.sqrt(share) if share < 1 else 1 + share
        says(length, Other("Westergaard", float(2 / pi * np.arcsin(np.sqrt(part)))))
        says(peak, Other("Westergaard", float(crest * flat)))
        numbers += [length, peak]
    return meshes.result(*numbers)


UNITS = ("length", "force/area")


def _crest_in_the_middle(x: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
    return HEIGHT * (1 - ufl.cos(2 * np.pi * (x[0] - 0.5)))


def slipping_sector() -> Result:
    """Turn a hub on a shaft on which it is pressed, until it slips, Lame.

    One of twelve sectors of a shaft of the radii 20 and 40 mm in a hub to 80 mm, E =
    210 000 MPa, nu = 0.3, plane strain, interference 0.03, Coulomb friction 0.2. Shaft
    and hub are held inside and outside, where the hub is turned by 0.002. So the fit
    slips, and the torque of all sectors is 2 pi 40^2 mu p. The mesh has flat facets.
    """
    turn = 0.002
    held = ec.Displacement("inner", (0.0, 0.0))
    turned = ec.Displacement("outer", (lambda x: -turn * x[1], lambda x: turn * x[0]))
    sides = ec.Cyclic("low", "cut", axis=(0.0, 0.0), sectors=12)
    contact = ec.Contact("rim", against="bore", gap=-0.03, friction=0.2)
    scene = ec.Scene(ec.Elastic(STEEL, NU), [held, turned], contacts=[contact, sides])

    def mean(error: ec.ConstitutiveError) -> float:
        return error.contact_force("rim").mean_pressure.value

    def torque(error: ec.ConstitutiveError) -> float:
        return 1e-3 * float(ec.results.whole_force(error, "outer").moment[0])

    probes = {"mean pressure": mean, "torque of all sectors": torque}
    meshes = Meshes(scene, sector_of_fit(20.0, 40.0, 80.0), 3e-3, probes)
    # u_r = A r + B/r between its values 0 at one radius and d at 40.
    shear, bulk = STEEL / (2 * (1 + NU)), STEEL / (2 * (1 + NU) * (1 - 2 * NU))
    stiffness = []
    for still in (20.0, 80.0):
        a, b = np.linalg.solve([[still, 1 / still], [40.0, 1 / 40.0]], [0.0, 1.0])
        stiffness.append(abs(2 * bulk * a - 2 * shear * b / 40.0**2))
    pressure = 0.03 / sum(1 / each for each in stiffness)
    of_torque = meshes.probe("torque of all sectors", "N m/mm")
    return meshes.result(
        says(meshes.probe("mean pressure", "MPa"), Other("Lame", pressure)),
        says(of_torque, Other("2 pi b^2 mu p", 2e-3 * pi * 40.0**2 * 0.2 * pressure)),
    )


def holes_in_a_square() -> Result:
    """Stretch a plate with holes in a square pattern.

    Unit cell with a hole of radius 0.25 in the middle, E = 200, nu = 0.3, plane strain,
    repeated along x and y. The bulk modulus K in the plane, of the mean stress over
    twice the mean strain, follows from the energies 2 K e^2 under the mean strain e I
    and -s^2/(2 K) under the mean stress s I: one is above, the other one below its
    value. Hashin and Shtrikman have a bound from above.
    """
    strain, stress = 1e-3, 0.5
    pairs = (("left", "right"), ("bottom", "top"))
    numbers = []
    for name, size in (("mean_strain", strain), ("mean_stress", stress)):
        given = ((size, 0.0), (0.0, size))
        mean: dict[str, Any] = {name: given}
        sides: list[Any] = [ec.Periodic(*names, **mean) for names in pairs]
        meshes = Meshes(ec.Scene(ec.Elastic(E, NU), sides), perforated_cell(), 5e-3)
        numbers.append(meshes.energy(f"bulk modulus by a {name.replace('_', ' ')}", "force/area"))
    by_strain, of_stress = numbers
    by_strain = _scaled(by_strain, lambda J: J / (2 * strain**2))
    by_stress = _scaled(of_stress, lambda J: -(stress**2) / (2 * J))
    shear = E / (2 * (1 + NU))
    bulk = shear / (1 - 2 * NU)
    void = pi * 0.25**2
    upper = 1 / ((1 - void) / (bulk + shear) + void / shear) - shear
    says(by_strain, Other("Hashin, Shtrikman, from above", upper, approximate=True))
    rounding = 0.5 * (by_strain.high - by_strain.low)
    says(by_stress, Other("the interval by a mean strain", by_strain.value, rounding=rounding))
    return meshes.result(by_strain, by_stress)


def _scaled(number: Number, of_energy: Any) -> Number:
    """Return a number that follows from an energy, in its interval."""
    low, high = sorted((of_energy(number.low), of_energy(number.high)))
    middle = (low + high) / 2
    return Number(number.quantity, number.unit, middle, low, high, number.kind, number.how)


def spinning_blades() -> Result:
    """Spin a disc with blades.

    One of eight sectors of a disc of the radii 20 and 60 mm with blades 10 mm wide to
    the radius 85, E = 210 000 MPa, nu = 0.3, plane strain, 7850 kg/m^3, at 12 000 turns
    a minute. The energy is the energy of all sectors. The whole disc on a mesh of its
    own, symmetric to nothing, has an interval, too.
    """
    speed = 2 * pi / 60 * 12e3
    pull = DENSITY * speed**2
    force = ec.BodyForce((lambda x: pull * x[0], lambda x: pull * x[1]))
    sides = ec.Cyclic("low", "cut", axis=(0.0, 0.0), sectors=8)
    material = ec.Elastic(STEEL, NU)
    whole = Meshes(ec.Scene(material, loads=[force]), bladed(8, 8), 1.5e-2)
    every = whole.energy("energy", "N", -1.0)
    meshes = Meshes(ec.Scene(material, loads=[force], contacts=[sides]), bladed(1, 8), 1e-2)
    energy = meshes.energy("strain energy of all sectors", "N", -8.0)
    rounding = 0.5 * (every.high - every.low)
    return meshes.result(says(energy, Other("the whole disc", every.value, rounding=rounding)))


def bladed(copies: int, sectors: int) -> ec.Domain:
    """Mesh one sector of a disc with blades, or all sectors in one mesh."""
    occ = opened(6.0)
    angle = 2 * pi / sectors
    disc = [(2, occ.addDisk(0, 0, 0, 60, 60))]
    blades = []
    for number in range(copies):
        blade = [(2, occ.addRectangle(50, -5, 0, 35, 10))]
        occ.rotate(blade, 0, 0, 0, 0, 0, 1, number * angle)
        blades += blade
    if copies == 1:
        height = 90 * tan(angle / 2)
        corners = ((0, 0), (90, -height), (90, height))
        points = [occ.addPoint(x, y, 0) for x, y in corners]
        lines = [occ.addLine(points[i - 1], points[i]) for i in range(3)]
        wedge = [(2, occ.addPlaneSurface([occ.addCurveLoop(lines)]))]
        disc, _ = occ.intersect(disc, wedge)
    body, _ = occ.fuse(disc, blades)
    bore = [(2, occ.addDisk(0, 0, 0, 20, 20))]
    body, _ = occ.cut(body, bore)
    occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [face for _, face in body], name="body")
    if copies == 1:
        _name_sides({"low": -angle / 2, "cut": angle / 2}, angle)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain


def _name_sides(sides: dict[str, float], angle: float) -> None:
    """Name the straight curves on rays of two angles, and mesh them alike."""
    curves = {}
    for name, ray in sides.items():
        found = []
        for dim, tag in gmsh.model.getEntities(1):
            x, y, _ = gmsh.model.occ.getCenterOfMass(dim, tag)
            is_line = gmsh.model.getType(dim, tag) == "Line"
            if is_line and abs(np.arctan2(y, x) - ray) < NEAR:
                found.append((np.hypot(x, y), tag))
        curves[name] = [tag for _, tag in sorted(found)]
        gmsh.model.addPhysicalGroup(1, curves[name], name=name)
    turn = np.eye(4)
    turn[:2, :2] = [[cos(angle), -sin(angle)], [sin(angle), cos(angle)]]
    low, cut = curves.values()
    gmsh.model.mesh.setPeriodic(1, cut, low, turn.ravel())


def sector_of_fit(inner: float, fit: float, outer: float) -> ec.Domain:
    """Mesh a twelfth of a shaft in a hub, and split them."""
    occ = opened(6.0)
    angle = pi / 6
    centre = occ.addPoint(0, 0, 0)
    rays = []
    for ray in (0.0, angle):
        rays.append([occ.addPoint(r * cos(ray), r * sin(ray), 0) for r in (inner, fit, outer)])
    arcs = [occ.addCircleArc(a, centre, b) for a, b in zip(*rays, strict=True)]
    lines = [[occ.addLine(*ray[i : i + 2]) for i in range(2)] for ray in rays]
    faces = []
    for i in range(2):
        loop = occ.addCurveLoop([lines[0][i], arcs[i + 1], lines[1][i], arcs[i]])
        faces.append(occ.addPlaneSurface([loop]))
    occ.synchronize()
    _name_sides({"low": 0.0, "cut": angle}, angle)
    for name, arc in (("inner", arcs[0]), ("outer", arcs[2])):
        gmsh.model.addPhysicalGroup(1, [arc], name=name)
    for name, face in zip(("shaft", "hub"), faces, strict=True):
        gmsh.model.addPhysicalGroup(2, [face], name=name)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain.split({"rim": "shaft", "bore": "hub"})


def perforated_cell(radius: float = 0.25, size: float = 0.2) -> ec.Domain:
    """Mesh a unit cell with a hole in the middle."""
    occ = opened(size)
    square = [(2, occ.addRectangle(0, 0, 0, 1, 1))]
    hole = [(2, occ.addDisk(0.5, 0.5, 0, radius, radius))]
    cell, _ = occ.cut(square, hole)
    occ.synchronize()
    places = {"left": (0, 0.5), "right": (1, 0.5), "bottom": (0.5, 0), "top": (0.5, 1)}
    curves = {}
    for dim, curve in gmsh.model.getEntities(1):
        middle = occ.getCenterOfMass(dim, curve)[:2]
        for name, place in places.items():
            if np.allclose(middle, place):
                gmsh.model.addPhysicalGroup(1, [curve], name=name)
                curves[name] = curve
    for one, other, axis in (("right", "left", 0), ("top", "bottom", 1)):
        motion = np.eye(4)
        motion[axis, 3] = 1.0
        gmsh.model.mesh.setPeriodic(1, [curves[one]], [curves[other]], motion.ravel())
    gmsh.model.addPhysicalGroup(2, [face for _, face in cell], name="body")
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain
