"""Reference cases of axisymmetric bodies: closed forms, layers, punches, press fits.

The first line of each docstring is the title of the case on the page, the rest its
geometry.
"""

from __future__ import annotations

from collections.abc import Mapping

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled
import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from reference_drawing import Box, add_part, drawn  # isort: skip
from reference_numbers import (  # isort: skip
    UP,
    Meshes,
    Number,
    Other,
    Probe,
    Result,
    exactly,
    opening_ends,
    pressure_at,
    says,
)

DOWN = (0.0, -1.0)
"""Direction along the axis [-]."""
OUTWARD = (1.0, 0.0)
"""Radial direction [-]."""
HANKEL = "Hankel integrals"
"""Source of numbers of infinite layers by dual integral equations, in words."""
FINE = "elements of degree 4 to 7"
"""Source of numbers of a second code with mesh lines on the rim of the contact."""


def turned(E: float, nu: float) -> ec.Elastic:
    """Return the material of a turned body."""
    return ec.Elastic(E, nu, hypothesis="axisymmetric")


STEEL, SOFT = turned(210e3, 0.3), turned(1000.0, 0.3)
STEEL_IN_ALUMINIUM = ec.Elastic(
    {"shaft": 210e3, "hub": 70e3}, {"shaft": 0.3, "hub": 0.33}, hypothesis="axisymmetric"
)


def between_plates(*parts: str) -> list[ec.Displacement]:
    """Hold parts along the axis."""
    return [ec.Displacement(part, (None, 0.0)) for part in parts]


def thick_tube() -> Result:
    """Put a thick tube under pressure from inside and outside, Lame.

    Tube, r from 20 to 40 mm and z from 0 to 10, E = 210 000 MPa, nu = 0.3, inner
    pressure 100 MPa, outer pressure 30. Both ends have u_z = 0.
    """
    loads = [ec.Traction("left", pressure=100.0), ec.Traction("right", pressure=30.0)]
    tube = ec.rectangle((20.0, 0.0), (40.0, 10.0), cells=(8, 4))
    meshes = Meshes(ec.Scene(STEEL, between_plates("bottom", "top"), loads), tube, 3e-4)
    energy = meshes.energy("strain energy", "N mm", -1.0)
    numbers = [exactly(energy, 512.3887751, "Lame")]
    for part, value in (("left", 0.01122539683), ("right", 0.005117460317)):
        goal = ec.MeanDisplacement(part, OUTWARD)
        name = "u_r inside" if part == "left" else "u_r outside"
        numbers.append(exactly(meshes.goal(goal, "mm", name), value, "Lame"))
    end = meshes.goal(ec.Resultant("bottom", UP), "N", "force of an end")
    return meshes.result(*numbers, exactly(end, 15079.64474, "Lame"))


def thick_shell() -> Result:
    """Put a thick spherical shell under pressure from inside and outside.

    Shell, radii 20 and 40 mm, E = 210 000 MPa, nu = 0.3, inner pressure 100 MPa, outer
    pressure 20. One half is computed, with u_z = 0 on z = 0. The mesh has flat facets.
    """
    discs = {"outer": 40.0, "inner": 20.0}
    shell = part_of_disc(discs, 4.0, {"equator": (20.0, 0.0, 40.0, 0.0)})
    loads = [ec.Traction("inner", pressure=100.0), ec.Traction("outer", pressure=20.0)]
    probes: dict[str, Probe] = {
        "u at radius 30": lambda error: float(error.at((30.0, 0.0)).displacement[0, 0])
    }
    meshes = Meshes(ec.Scene(STEEL, between_plates("equator"), loads), shell, 2e-3, probes)
    energy = meshes.energy("strain energy of a half", "N mm", -1.0)
    force = meshes.goal(ec.Resultant("equator", DOWN), "N", "force across the equator")
    moved = says(meshes.probe("u at radius 30", "mm"), Other("closed form", 0.002025699169))
    return meshes.result(
        says(energy, Other("closed form", 593.6114119)),
        says(force, Other("balance", 25132.74123)),
        moved,
    )


def tube_in_hub(size: float, core: float, outer: float, length: float) -> ec.Domain:
    """Mesh a shaft of radius 40 in a hub, in one piece."""
    bricks = [
        ("shaft", core, 0.0, 40.0 - core, length),
        ("hub", 40.0, 0.0, outer - 40.0, length),
    ]
    parts = {"bottom": (core, 0.0, outer, 0.0), "top": (core, length, outer, length)}
    return drawn(bricks, parts, size).split({"rim": "shaft", "bore": "hub"})


def fit_in_plane_strain(accuracy: float = 3e-4) -> Result:
    """Press a hollow shaft into a hub between two plates, Lame.

    Steel shaft, r from 20 to 40 mm, in an aluminium hub to 70, both 20 long; E =
    210 000 and 70 000 MPa, nu = 0.3 and 0.33. The radial interference is 0.05, without
    friction; both ends have u_z = 0. The force is the sum around the ring.
    """
    fit = ec.Contact("rim", against="bore", gap=-0.05)
    scene = ec.Scene(STEEL_IN_ALUMINIUM, between_plates("bottom", "top"), contacts=[fit])
    meshes = Meshes(scene, tube_in_hub(10.0, 20.0, 70.0, 20.0), accuracy)
    energy = exactly(meshes.energy("strain energy", "N mm"), 4279.012115, "Lame")
    force = meshes.goal(ec.Resultant("rim", (-1.0, 0.0)), "N", "radial force")
    return meshes.result(energy, exactly(force, 171160.4846, "Lame"))


def cylinder_between_platens() -> Result:
    """Press a cylinder between frictionless platens.

    Cylinder of radius 10 and height 20, E = 1000, nu = 0.3, shortened by 0.2. The
    stress is uniform.
    """
    contact = ec.Contact("top", gap=-0.2)
    scene = ec.Scene(SOFT, between_plates("bottom"), contacts=[contact])
    body = ec.rectangle((0.0, 0.0), (10.0, 20.0), cells=(2, 4))
    meshes = Meshes(scene, body, 1e-3)
    energy = exactly(meshes.energy("strain energy", "force length"), np.pi * 100)
    force = exactly(meshes.goal(ec.Resultant("top", DOWN), "force", "force"), np.pi * 1000)
    moved = meshes.goal(ec.MeanDisplacement("right", OUTWARD), "length", "u_r of the side")
    return meshes.result(energy, force, exactly(moved, 0.03))


def spinning_cylinder() -> Result:
    """Spin a cylinder between two plates.

    Cylinder of radius 50 mm, z from 0 to 10, E = 210 000 MPa, nu = 0.3, body force
    0.01 r N/mm^3. Both ends have u_z = 0.
    """
    force = ec.BodyForce((lambda x: 0.01 * x[0], 0.0))
    scene = ec.Scene(STEEL, between_plates("bottom", "top"), [force])
    body = ec.rectangle((0.0, 0.0), (50.0, 10.0), cells=(10, 2))
    meshes = Meshes(scene, body, 1e-3)
    energy = exactly(meshes.energy("strain energy", "N mm", -1.0), 9.405632767)
    moved = meshes.goal(ec.MeanDisplacement("right", OUTWARD), "mm", "u_r of the rim")
    end = meshes.goal(ec.Resultant("top", UP), "N", "force of an end")
    return meshes.result(energy, exactly(moved, 0.0007738095238), exactly(end, 29452.43113))


def column_in_a_tube() -> Result:
    """Let a column in a rigid tube stand under its weight.

    Cylinder of radius 10 and height 40, E = 1000, nu = 0.3, body force -0.05 along z,
    u_r = 0 at r = 10, on a frictionless plane.
    """
    scene = ec.Scene(
        SOFT,
        [ec.Displacement("right", (0.0, None))],
        [ec.BodyForce((0.0, -0.05))],
        [ec.Contact("bottom")],
    )
    body = ec.rectangle((0.0, 0.0), (10.0, 40.0), cells=(2, 8))
    meshes = Meshes(scene, body, 1e-3)
    energy = exactly(meshes.energy("strain energy", "force length", -1.0), 6.223345447)
    base = exactly(meshes.force("bottom", UP, "force", "force of the plane"), np.pi * 200)
    wall = meshes.goal(ec.Resultant("right", (-1.0, 0.0)), "force", "radial force of the tube")
    moved = meshes.goal(ec.MeanDisplacement("top", UP), "length", "u_z of the top")
    return meshes.result(energy, base, exactly(wall, 1077.117481), exactly(moved, -0.02971428571))


def shrink_fit(accuracy: float = 3e-4) -> Result:
    """Heat a shaft in a cold ring between two plates.

    Steel shaft of radius 40 mm, heated so that it would grow by 1.2e-3, in a cold steel
    ring to 80, both 20 long; E = 210 000 MPa, nu = 0.3, no gap before, no friction;
    both ends have u_z = 0. The force is the sum around the ring.
    """
    scene = ec.Scene(
        STEEL,
        between_plates("bottom", "top"),
        contacts=[ec.Contact("rim", against="bore")],
        strains=[ec.ThermalStrain({"shaft": 12e-6, "hub": 0.0}, 100.0)],
    )
    meshes = Meshes(scene, tube_in_hub(10.0, 0.0, 80.0, 20.0), accuracy)
    energy = exactly(meshes.energy("elastic energy", "N mm"), 36372.10311)
    force = meshes.goal(ec.Resultant("rim", (-1.0, 0.0)), "N", "radial force")
    return meshes.result(energy, exactly(force, 678584.0132))


def on_the_ball(friction: float, accuracy: float, probes: Mapping[str, Probe]) -> Meshes:
    """Press a layer of thickness 10 on a rigid paraboloid."""
    contact = ec.Contact("bottom", gap=lambda x: x[0] ** 2 / 1000, friction=friction)
    scene = ec.Scene(SOFT, [ec.Displacement("top", (0.0, -0.1))], contacts=[contact])
    layer = ec.rectangle((0.0, 0.0), (100.0, 10.0), cells=(40, 4))
    return Meshes(scene, layer, accuracy, probes)


def ball_on_a_layer() -> Result:
    """Press a large ball on a bonded layer.

    Layer, r from 0 to 100, thickness 10, E = 1000, nu = 0.3; its far face is moved by
    0.1 towards a rigid frictionless paraboloid with the gap r^2/1000. The references
    are Hankel integrals of an infinite layer.
    """
    a, references = 8.646255987, (14.76424456, 14.23484669, 12.57812149, 9.431096427)
    probes = {"contact radius a": opening_ends("bottom")}
    names = ("p(0)", "p(a/4)", "p(a/2)", "p(3a/4)")
    for place, name in enumerate(names):
        probes[name] = pressure_at("bottom", a * place / 4, 1.0)
    meshes = on_the_ball(0.0, 5e-4, probes)
    energy = meshes.energy("strain energy", "force length")
    force = meshes.goal(ec.Resultant("bottom", UP), "force", "force")
    numbers = [exactly(energy, 79.38378369, HANKEL), exactly(force, 2255.374380, HANKEL)]
    numbers.append(says(meshes.probe("contact radius a", "length"), Other(HANKEL, a)))
    for name, value in zip(names, references, strict=True):
        numbers.append(says(meshes.probe(name, "force/area"), Other(HANKEL, value)))
    return meshes.result(*numbers)


def end_of_stick(contact: str, axis: str = "x") -> Probe:
    """Read where the last facet that sticks ends."""

    def read(error: ec.ConstitutiveError) -> float:
        profile = error.profile(contact)
        stick = profile["status"] == ec.results.STICK
        return float(profile[axis][stick].max(initial=0.0))

    return read


def axial(contact: str, direction: float = 1.0) -> Probe:
    """Read the axial force of a contact."""
    return lambda error: float(direction * error.force(contact).force[1])


def ball_on_a_rough_layer() -> Result:
    """Press a large ball on a bonded layer with friction.

    As above, with Coulomb friction, mu = 0.2, in one step. The middle sticks up to the
    radius c, the rest slips inward. The references have nodes at both radii.
    """
    probes = {
        "force": axial("bottom"),
        "contact radius a": opening_ends("bottom"),
        "stick radius c": end_of_stick("bottom"),
    }
    meshes = on_the_ball(0.2, 5e-4, probes)
    values = {"force": 2267.920, "contact radius a": 8.58717, "stick radius c": 5.35332}
    return meshes.result(*probed(meshes, values, "force"))


def probed(meshes: Meshes, values: Mapping[str, float], unit: str) -> list[Number]:
    """Return numbers of probes beside the numbers of a second code."""
    numbers = []
    for name, value in values.items():
        of_name = unit if "force" in name else "length"
        numbers.append(says(meshes.probe(name, of_name), Other(FINE, value)))
    return numbers


def receding_disc() -> Result:
    """Press a disc on a rigid base, from which its rim recedes.

    Disc of radius 60 and height 10, E = 1000, nu = 0.3. A pressure of 1 acts on the top
    where r < 5; below is a frictionless plane. An infinite layer has b = 12.13363 and
    the energy 0.2085435.
    """
    bricks = [("disc", 0.0, 0.0, 5.0, 10.0), ("disc", 5.0, 0.0, 55.0, 10.0)]
    parts: dict[str, Box] = {"load": (0, 10, 5, 10), "foot": (0, 0, 60, 0)}
    scene = ec.Scene(SOFT, [], [ec.Traction("load", pressure=1.0)], [ec.Contact("foot")])
    probes = {"contact radius b": opening_ends("foot"), "p(0)": pressure_at("foot", 0.0, 1.0)}
    meshes = Meshes(scene, drawn(bricks, parts, 2.5), 1e-3, probes)
    energy = meshes.energy("strain energy", "force length", -1.0)
    force = exactly(meshes.force("foot", UP, "force", "force"), np.pi * 25, "balance")
    radius = says(meshes.probe("contact radius b", "length"), Other(FINE, 12.09151))
    peak = says(meshes.probe("p(0)", "force/area"), Other(FINE, 0.48207))
    return meshes.result(says(energy, Other(FINE, 0.20888209, rounding=5e-9)), force, radius, peak)


def punch_on_a_layer() -> Result:
    """Press a flat circular punch on a bonded layer.

    Layer, r from 0 to 100, thickness 10, E = 1000, nu = 0.3; its far face is moved by
    0.05 towards a rigid frictionless punch of radius 5 with sharp edges. The references
    are Hankel integrals of an infinite layer.
    """
    bricks = [("layer", 0.0, 0.0, 5.0, 10.0), ("layer", 5.0, 0.0, 95.0, 10.0)]
    parts: dict[str, Box] = {"top": (0, 10, 100, 10), "foot": (0, 0, 5, 0)}
    scene = ec.Scene(SOFT, [ec.Displacement("top", (0.0, -0.05))], contacts=[ec.Contact("foot")])
    probes = {"p(0)": pressure_at("foot", 0.0, 1.0)}
    meshes = Meshes(scene, drawn(bricks, parts, 5.0), 1e-3, probes)
    energy = exactly(meshes.energy("strain energy", "force length"), 22.3080414, HANKEL)
    force = meshes.goal(ec.Resultant("foot", UP), "force", "force")
    peak = says(meshes.probe("p(0)", "force/area"), Other(HANKEL, 6.2350092))
    return meshes.result(energy, exactly(force, 892.321656, HANKEL), peak)


def rough_platens() -> Result:
    """Press a cylinder between rough platens.

    Cylinder of radius 1 and height 2, E = 1, nu = 0.3, shortened by 1%; the upper half,
    with u_z = 0 on z = 0. Coulomb friction, mu = 0.3, in one step. The ends stick up to
    the radius c, the rim slips outward.
    """
    contact = ec.Contact("top", gap=-0.01, friction=0.3)
    scene = ec.Scene(turned(1.0, 0.3), between_plates("bottom"), contacts=[contact])
    probes = {"force": axial("top", -1.0), "stick radius c": end_of_stick("top")}
    body = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(8, 8))
    meshes = Meshes(scene, body, 5e-4, probes)
    values = {"force": 0.033114698, "stick radius c": 0.87052}
    return meshes.result(*probed(meshes, values, "force"))


def rough_fit() -> Result:
    """Press a hollow shaft into a hub with free ends and friction.

    Shaft and hub as above, z = 0 is a plane of symmetry, z = 20 free; mu = 0.2, in one
    step. The fit sticks for z < c. The force is the sum around the ring.
    """
    fit = ec.Contact("rim", against="bore", gap=-0.05, friction=0.2)
    scene = ec.Scene(STEEL_IN_ALUMINIUM, between_plates("bottom"), contacts=[fit])
    probes: dict[str, Probe] = {
        "radial force": lambda error: float(error.force("bore").force[0]),
        "stick length c": end_of_stick("rim", "y"),
    }
    meshes = Meshes(scene, tube_in_hub(5.0, 20.0, 70.0, 20.0), 5e-4, probes)
    values = {"radial force": 161079.87, "stick length c": 10.192}
    return meshes.result(*probed(meshes, values, "N"))


def two_hemispheres() -> Result:
    """Press two hemispheres on each other, code_aster SSNV104.

    Radius 50, E = 20 000, nu = 0.3, no friction. The flat faces come nearer by 4, with
    u_r free: one hemisphere on a rigid plane, of which its face comes nearer by 2. The
    published force is of Hertz's half-spaces; the hemispheres are stiffer, as a second
    code finds, too.
    """
    ball = part_of_disc({"ball": 50.0}, 8.0, {"face": (0.0, 0.0, 50.0, 0.0)})
    contact = ec.Contact("ball", gap=lambda x: 50.0 - x[1], normal=UP)
    scene = ec.Scene(turned(20e3, 0.3), [ec.Displacement("face", (None, 2.0))], contacts=[contact])
    probes = {
        "force": axial("ball", -1.0),
        "contact radius a": lambda error: float(
            error.profile("ball")["x"][error.profile("ball")["pressure"] > 0].max()
        ),
        "p(0)": pressure_at("ball", 0.0, 1.5),
    }
    meshes = Meshes(scene, ball, 4e-3, probes)
    force, radius, peak = (
        meshes.probe("force", "force"),
        meshes.probe("contact radius a", "length"),
        meshes.probe("p(0)", "force/area"),
    )
    says(force, Other(FINE, 659773.2), Other("published, Hertz", 586081.0, approximate=True))
    says(radius, Other(FINE, 10.35854), Other("Hertz", 10.0, approximate=True))
    says(peak, Other(FINE, 2910.40), Other("Hertz", 2798.33, approximate=True))
    return meshes.result(force, radius, peak)


def part_of_disc(radii: Mapping[str, float], size: float, parts: Mapping[str, Box]) -> ec.Domain:
    """Mesh a quarter of a disc or of a ring; its arcs have the names of the radii."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    occ = gmsh.model.occ
    largest = max(radii.values())
    square = [(2, occ.addRectangle(0, 0, 0, largest, largest))]
    quarter = square
    for radius in sorted(radii.values(), reverse=True):
        disc = [(2, occ.addDisk(0, 0, 0, radius, radius))]
        cut = occ.intersect if radius == largest else occ.cut
        quarter, _ = cut(quarter, disc)
    occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [face for _, face in quarter], name="body")
    for name, radius in radii.items():
        arcs = []
        for curve in gmsh.model.getEntities(1):
            if abs(occ.getMass(*curve) - np.pi * radius / 2) < 1e-6:
                arcs.append(curve[1])
        gmsh.model.addPhysicalGroup(1, arcs, name=name)
    for name, box in parts.items():
        add_part(name, box)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain
