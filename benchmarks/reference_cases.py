"""Reference cases of one body: strips with closed forms, blocks, layers, punches.

The first line of each docstring is the title of the case on the page, the rest its
geometry.
"""

from __future__ import annotations

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from reference_drawing import drawn  # isort: skip
from reference_fourier import Layer, receding  # isort: skip
from reference_numbers import (  # isort: skip
    FOURIER,
    UP,
    Meshes,
    Other,
    Probe,
    Result,
    exactly,
    opening_ends,
    pressure_at,
    says,
)

E, NU = 200.0, 0.3
PLANE = E / (1 - NU**2)
"""Modulus of a strip with free sides in plane strain [force/area]."""


def strip() -> ec.Domain:
    """Make a strip of 1 x 2."""
    return ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(2, 4))


def bar_on_a_plate() -> Result:
    """Press a bar on a plate that it does not touch at first.

    Rectangle (0, 1) x (0, 2), E = 200, nu = 0.3, plane strain. The left side has
    u_x = 0, the right one is free, the top has u_y = -0.02. Below is a frictionless
    plate at the distance 0.005. The stress is homogeneous, E' = E/(1 - nu^2).
    """
    rollers = [ec.Displacement("left", (0.0, None)), ec.Displacement("top", (None, -0.02))]
    contact = ec.Contact("bottom", gap=0.005)
    meshes = Meshes(ec.Scene(ec.Elastic(E, NU), rollers, contacts=[contact]), strip(), 1e-3)
    force = meshes.goal(ec.Resultant("bottom", UP), "force/length", "force of the plate")
    return meshes.result(
        exactly(meshes.energy("strain energy", "force"), PLANE * 0.015**2 / 4),
        exactly(force, PLANE * 0.015 / 2, "E' (0.02 - 0.005)/2"),
    )


def plate_with_given_force() -> Result:
    """Press a strip by a rigid plate with a given force.

    Rectangle (0, 1) x (0, 2), E = 200, nu = 0.3, plane strain. Both sides have
    u_x = 0. The top is a rigid plate that does not turn and carries the force -3; below
    is a frictionless plane at the distance 0.01. The strain is uniaxial with the
    modulus M = E (1 - nu)/((1 + nu)(1 - 2 nu)).
    """
    walls = [ec.Displacement(side, (0.0, None)) for side in ("left", "right")]
    plate = ec.Rigid("top", (0.0, None), rotation=0.0, force=(None, -3.0))
    scene = ec.Scene(ec.Elastic(E, NU), [*walls, plate], contacts=[ec.Contact("bottom", gap=0.01)])
    meshes = Meshes(scene, strip(), 1e-3)
    modulus = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    moved = meshes.goal(ec.MeanDisplacement("top", UP), "length", "motion of the plate")
    force = meshes.force("bottom", UP, "force/length", "force of the plane")
    return meshes.result(exactly(moved, -3 * 2 / modulus - 0.01), exactly(force, 3.0, "balance"))


def bar_on_springs() -> Result:
    """Press a bar that hangs on springs against a plate.

    Rectangle (0, 1) x (0, 2), E = 200, nu = 0.3, plane strain. The left side has
    u_x = 0. Springs of 50 on the top resist a pressure of 4 there; below is a
    frictionless plate at the distance 0.02. The springs take what the plate does not.
    """
    scene = ec.Scene(
        ec.Elastic(E, NU),
        [ec.Displacement("left", (0.0, None))],
        [ec.Traction("top", pressure=4.0)],
        [ec.Contact("bottom", gap=0.02)],
        springs=[ec.Spring("top", normal=50.0)],
    )
    meshes = Meshes(scene, strip(), 1e-3)
    moved = -(4 + PLANE * 0.02 / 2) / (50 + PLANE / 2)
    motion = meshes.goal(ec.MeanDisplacement("top", UP), "length", "u_y of the top")
    force = meshes.force("bottom", UP, "force/length", "force of the plate")
    return meshes.result(
        exactly(motion, moved, "-(p + E' g/2)/(k + E'/2)"), exactly(force, 4 + 50 * moved)
    )


def heated_bar() -> Result:
    """Heat a bar until it fills a gap and presses on both walls.

    Rectangle (0, 2) x (0, 1), E = 200 000, nu = 0.3, plane strain, coefficient of heat
    12e-6, heated by 100. The left side has u_x = 0, the lower one u_y = 0; right of it
    is a frictionless wall at the distance 0.002.
    """
    scene = ec.Scene(
        ec.Elastic(1000 * E, NU),
        [ec.Displacement("left", (0.0, None)), ec.Displacement("bottom", (None, 0.0))],
        contacts=[ec.Contact("right", gap=0.002)],
        strains=[ec.ThermalStrain(12e-6, 100.0)],
    )
    meshes = Meshes(scene, ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2)), 1e-3)
    force = meshes.goal(ec.Resultant("right", (-1.0, 0.0)), "N/mm", "force on the wall")
    strain = (1 + NU) * 12e-4 - 0.002 / 2
    return meshes.result(exactly(force, 1000 * PLANE * strain, "E' ((1 + nu) alpha T - g/L)"))


def tall_block(friction: object) -> ec.Scene:
    """Press and push a block of 2 x 7 that is held at its top."""
    return ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.1, -0.05))],
        [ec.Traction("right", (-0.0002, 0.0))],
        [ec.Contact("bottom", friction=friction)],  # type: ignore[arg-type]
    )


def meshes_of_tall_block(friction: object, accuracy: float) -> Meshes:
    """Run the block to an accuracy."""
    block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(2, 7))
    return Meshes(tall_block(friction), block, accuracy)


def block_of_eight_codes() -> Result:
    """Push the block on which eight codes agree.

    Rectangle (0, 2) x (0, 7), E = 1, nu = 0.3, plane strain. The top has
    u = (0.1, -0.05), the right side the traction (-0.0002, 0), the left one is free;
    below is a plane with Coulomb friction, mu = 0.3. It opens at the left corner,
    slips, sticks in the middle and slips again. The codes are plain DOLFINx,
    asimov-contact, GetFEM (Nitsche, two augmented Lagrangians), scikit-fem, NGSolve,
    FreeFEM and CalculiX, on one mesh of 64 x 224 squares of degree 2, cut in two.
    """
    meshes = meshes_of_tall_block(0.3, 2e-4)
    normal = meshes.force("bottom", UP, "force/length", "normal force")
    along = meshes.force("bottom", (1.0, 0.0), "force/length", "tangential force")
    who = "eight codes, 64 x 224 squares"
    says(normal, Other(who, 0.015993, rounding=5e-7))
    says(along, Other(who, -0.001346, rounding=5e-7))
    return meshes.result(normal, along)


def block_without_friction() -> Result:
    """Push the same block on a frictionless plane.

    As above, with mu = 0.
    """
    meshes = meshes_of_tall_block(0.0, 2e-4)
    normal = meshes.goal(ec.Resultant("bottom", UP), "force/length", "normal force")
    return meshes.result(meshes.energy("potential energy", "force"), normal)


def block_with_given_friction() -> Result:
    """Push the same block with a given bound of friction.

    As above, with Tresca's law: the shear is at most 0.001.
    """
    meshes = meshes_of_tall_block(ec.Tresca(0.001), 2e-4)
    numbers = [meshes.energy("potential energy", "force")]
    for name, direction in (("normal force", UP), ("tangential force", (1.0, 0.0))):
        numbers.append(meshes.goal(ec.Resultant("bottom", direction), "force/length", name))
    return meshes.result(*numbers)


def greco() -> Result:
    """Compress and push the block of the GRECO group, code_aster SSNV128.

    Square (0, 40)^2 mm, E = 130 000 MPa, nu = 0.2, plane strain. The right side has
    u_x = 0 (symmetry). A pressure of 50 MPa acts on the top, 150 MPa on the left side.
    Below is a plane with Coulomb friction, mu = 1. The published displacements are
    means of several codes, which differ by 5%; code_aster has 32 x 10 squares of degree
    2. "Extrapolated" is an independent solver on up to 256 x 256 squares.
    """
    x = np.array([0.0, 1.25, 5.0, 7.5, 11.25])
    tables = {
        "published mean of several codes, spread 5%": (2.86, 2.72, 2.28, 1.98, 1.50),
        "code_aster": (2.859850, 2.720764, 2.282686, 1.979165, 1.540640),
        "extrapolated": (2.8603, 2.7226, 2.2868, 1.9807, 1.5414),
    }
    roundings = (5e-3, 5e-7, 5e-5)
    scene = ec.Scene(
        ec.Elastic(130e3, 0.2),
        [ec.Displacement("right", (0.0, None))],
        [ec.Traction("top", pressure=50.0), ec.Traction("left", pressure=150.0)],
        [ec.Contact("bottom", friction=1.0)],
    )

    def along(place: float) -> Probe:
        return lambda error: float(100 * error.at((place, 0.0)).displacement[0, 0])

    places = {f"u_x at x = {place:g}": along(float(place)) for place in x}
    probes = {**places, "friction force": lambda error: error.force("bottom").force[0]}
    square = ec.rectangle((0.0, 0.0), (40.0, 40.0), cells=(8, 8))
    meshes = Meshes(scene, square, 2e-4, probes)
    numbers = []
    for index, name in enumerate(places):
        number = meshes.probe(name, "0.01 mm")
        for (source, values), rounding in zip(tables.items(), roundings, strict=True):
            says(number, Other(source, values[index], rounding=rounding))
        numbers.append(number)
    friction = meshes.probe("friction force", "N/mm")
    numbers.append(says(friction, Other("extrapolated", -1405.4, rounding=0.05)))
    pressed = meshes.force("bottom", UP, "N/mm", "normal force")
    return meshes.result(*numbers, exactly(pressed, 2000.0, "balance"))


def paper() -> Result:
    """Press the block of the paper's experiment, with loads of ours.

    Rectangle (0, 2) x (0, 7), E = 1, nu = 0.3, plane strain. The left side is held,
    the top has the traction (0.02, -0.02 (2.5 - x)); below is a plane with Coulomb
    friction, mu = 0.3. The loads of Coorevits, Hild and Hjiaj are in a figure that is
    lost. Theirs are 490 triangles of degree 1 with eps = 28.90%, and 2964 with 11.78%.
    """
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("left", (0.0, 0.0))],
        [ec.Traction("top", (0.02, lambda x: -0.02 * (2.5 - x[0])))],
        [ec.Contact("bottom", friction=0.3)],
    )
    probes: dict[str, Probe] = {
        "normal force": lambda error: error.force("bottom").force[1],
        "tangential force": lambda error: error.force("bottom").force[0],
    }
    block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(2, 7))
    meshes = Meshes(scene, block, 5e-4, probes)
    numbers = [meshes.probe(name, "force/length") for name in probes]
    return meshes.result(meshes.energy("potential energy", "force"), *numbers)


def receding_layer() -> Result:
    """Press a layer on a rigid base, from which its ends recede.

    Half of a layer, rectangle (0, 80) x (0, 10) mm, E = 1000 MPa, nu = 0.3, plane
    strain; u_x = 0 at x = 0. A pressure of 1 MPa acts on the top where |x| < 5; below
    is a frictionless plane. The energy belongs to both halves. The references are
    Fourier integrals of an infinite layer with the pressure as the unknown, in
    reference_fourier.py; earlier ones of ours had the energy 0.0361713887.
    """
    bricks = [("layer", 0.0, 0.0, 5.0, 10.0), ("layer", 5.0, 0.0, 75.0, 10.0)]
    parts = {"middle": (0, 0, 0, 10), "load": (0, 10, 5, 10), "foot": (0, 0, 80, 0)}
    rollers = ec.Displacement("middle", (0.0, None))
    pressure = ec.Traction("load", pressure=1.0)
    scene = ec.Scene(ec.Elastic(1000.0, 0.3), [rollers], [pressure], [ec.Contact("foot")])
    probes = {"half-width b": opening_ends("foot"), "p(0)": pressure_at("foot", 0.0, 1.0)}
    meshes = Meshes(scene, drawn(bricks, parts, 5.0), 2e-4, probes)
    energy = meshes.energy("strain energy", "N", -2.0)
    fourier = receding(Layer(10.0, 1000.0, 0.3), None, 5.0)
    says(energy, Other(FOURIER, fourier.energy, exact=True, rounding=1e-11))
    says(energy, Other("earlier Fourier integrals", 0.0361713887, rounding=5e-11))
    width = says(meshes.probe("half-width b", "mm"), Other(FOURIER, fourier.half_width))
    peak = says(meshes.probe("p(0)", "MPa"), Other(FOURIER, fourier.peak))
    return meshes.result(energy, width, peak)
