"""Reference cases of axisymmetric bodies with closed forms.

The first line of each docstring is the title of the case on the page, the rest its
geometry.
"""

from __future__ import annotations

from collections.abc import Mapping

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip
from reference_drawing import drawn, part_of_disc  # isort: skip
from reference_numbers import (  # isort: skip
    FINE,
    UP,
    Meshes,
    Other,
    Result,
    Told,
    beside,
    exactly,
    moved,
    pressure_at,
    run,
    says,
)

DOWN = (0.0, -1.0)
"""Direction along the axis [-]."""
OUTWARD = (1.0, 0.0)
"""Radial direction [-]."""


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
    references = {20: 0.005333333333, 30: 0.002025699169, 40: 0.0007619047619}
    told = {f"u at radius {r}": moved((r, 0.0), 0, value) for r, value in references.items()}
    meshes = run(ec.Scene(STEEL, between_plates("equator"), loads), shell, 2e-3, told)
    energy = meshes.energy("strain energy of a half", "N mm", -1.0)
    force = meshes.goal(ec.Resultant("equator", DOWN), "N", "force across the equator")
    says(energy, Other("closed form", 593.6114119))
    says(force, Other("balance", 25132.74123))
    return meshes.result(energy, force, *beside(meshes, told))


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
    told = {
        "pressure": Told(pressure_at("rim", 10.0, 2.0, "y"), "MPa", 34.05129648),
        "u_r outside": moved((70.0, 10.0), 0, 0.02942362211),
        "u_r inside": moved((20.0, 10.0), 0, -0.007869632965),
    }
    return spun_fit(0.0, accuracy, 4279.012115, 171160.4846, told)


def spinning_fit(accuracy: float = 3e-4) -> Result:
    """Spin a press fit between two plates.

    Shaft and hub as above, with densities of 7.85e-9 and 2.7e-9 t/mm^3, at 1000 rad/s.
    The fit is lost at 3047.5326 rad/s: the pressure falls with the square of the speed.
    """
    told = {
        "pressure": Told(pressure_at("rim", 10.0, 2.0, "y"), "MPa", 30.38492107),
        "u_r outside": moved((70.0, 10.0), 0, 0.03111234572),
        "u_r inside": moved((20.0, 10.0), 0, -0.006050388108),
    }
    # Half of what the interference gives goes into the bodies, without half of the
    # work of the body force: N delta - U.
    return spun_fit(1000.0, accuracy, 3315.706715, 152731.2717, told)


def spun_fit(
    speed: float, accuracy: float, energy: float, force: float, told: Mapping[str, Told]
) -> Result:
    """Press a shaft into a hub between plates, and spin both [rad/s]."""
    meshes = run(fit_at(speed), tube_in_hub(10.0, 20.0, 70.0, 20.0), accuracy, told)
    potential = meshes.energy("potential energy" if speed else "strain energy", "N mm")
    says(potential, Other("Lame", energy, exact=True, rounding=5e-6))
    radial = meshes.goal(ec.Resultant("rim", (-1.0, 0.0)), "N", "radial force")
    exactly(radial, force, "Lame")
    return meshes.result(potential, radial, *beside(meshes, told, "Lame"))


def fit_at(speed: float) -> ec.Scene:
    """Return the press fit between plates that spins [rad/s]."""
    fit = ec.Contact("rim", against="bore", gap=-0.05)
    steel, aluminium = 7.85e-9 * speed**2, 2.7e-9 * speed**2
    pull = ec.BodyForce((lambda x: ufl.conditional(x[0] < 40, steel, aluminium) * x[0], 0.0))
    loads = [pull] if speed else []
    return ec.Scene(STEEL_IN_ALUMINIUM, between_plates("bottom", "top"), loads, [fit])


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


def column_on_a_plane() -> Result:
    """Let a column stand on a plane under its weight.

    Column as above, without the tube. Pressure is not level: a level one would bend the
    base.
    """
    scene = ec.Scene(SOFT, [], [ec.BodyForce((0.0, -0.05))], [ec.Contact("bottom")])
    body = ec.rectangle((0.0, 0.0), (10.0, 40.0), cells=(2, 8))
    told = {"p(0)": Told(pressure_at("bottom", 0.0, 0.5), "force/area", 2.05789)}
    told["p(5)"] = Told(pressure_at("bottom", 5.0, 0.5), "force/area", 2.03608)
    told["u_z of the top at r = 0"] = moved((0.0, 40.0), 1, -0.0403750195)
    told["u_z of the top at r = 10"] = moved((10.0, 40.0), 1, -0.0396249946)
    told["u_r of the foot"] = moved((10.0, 0.0), 0, 0.005781179)
    meshes = run(scene, body, 5e-4, told)
    energy = meshes.energy("strain energy", "force length", -1.0)
    says(energy, Other(FINE, 8.3761705, rounding=5e-8))
    base = exactly(meshes.force("bottom", UP, "force", "force of the plane"), np.pi * 200)
    return meshes.result(energy, base, *beside(meshes, told, FINE))


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
