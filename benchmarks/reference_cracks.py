"""Reference cases of cracks.

The first line of each docstring is the title of the case on the page, the rest its
geometry.
"""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import erc_contact as ec
from namedmesh.gmsh_session import session

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from reference_numbers import Meshes, Other, Result, exactly, says  # isort: skip
from reference_turned import STEEL  # isort: skip


E, NU = 210e3, 0.3
MPA_ROOT = "MPa sqrt(mm)"
"""Unit of stress intensity factors."""


def with_crack(
    low: tuple[float, float], high: tuple[float, float], draw: Any, h: float, at_tip: float
) -> ec.Domain:
    """Return a rectangle with a crack, split along it.

    Args:
        low: Lower left corner [length].
        high: Upper right corner [length].
        draw: Draws a line through the body; of gmsh's ``occ`` it returns the lines on
            the crack and beyond it.
        h: Greatest size of elements [length].
        at_tip: Size of elements at the tips [length].
    """

    def build(gmsh: Any) -> None:
        model, occ = gmsh.model, gmsh.model.occ
        section = occ.addRectangle(*low, 0, high[0] - low[0], high[1] - low[1])
        on_crack, beyond = draw(occ)
        lines = [(1, line) for line in on_crack + beyond]
        _, parts = occ.fragment([(2, section)], lines)
        crack = [part for pieces in parts[1 : 1 + len(on_crack)] for part in pieces]
        occ.synchronize()
        for _, tag in parts[0]:
            above = occ.getCenterOfMass(2, tag)[1] > 0
            model.addPhysicalGroup(2, [tag], name="up" if above else "down")
        model.addPhysicalGroup(1, [tag for _, tag in crack], name="crack")
        gmsh.option.setNumber("Mesh.MeshSizeMax", h)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 24)
        ends = model.getBoundary(crack, combined=False, oriented=False)
        model.mesh.setSize(ends, at_tip)

    with session(MPI.COMM_WORLD, build, "The section") as model:
        whole = ec.from_gmsh(model, MPI.COMM_WORLD)
    return whole.split({"upper lip": "up", "lower lip": "down"}, on="crack")


def straight(*places: float) -> Any:
    """Return what draws the line y = 0, with a crack between the first two places."""

    def draw(occ: Any) -> tuple[list[int], list[int]]:
        points = [occ.addPoint(x, 0, 0) for x in places]
        crack, beyond = (occ.addLine(*points[i : i + 2]) for i in range(2))
        return [crack], [beyond]

    return draw


def under_pressure(pressure: float, material: ec.Elastic) -> ec.Scene:
    """Return a body that nothing holds, with a pressure on the faces of its crack."""
    loads = [ec.Traction(lip, pressure=pressure) for lip in ("upper lip", "lower lip")]
    return ec.Scene(material, loads=loads)


def penny_crack() -> Result:
    """Put a penny-shaped crack under pressure from inside, Sneddon.

    Crack of radius a = 10 mm in the middle of a cylinder of radius 400 and length 800,
    E = 210 000 MPa, nu = 0.3, pressure p = 100 MPa on its faces. The closed form 2 p
    sqrt(a/pi) is of an infinite body.
    """
    a, p = 10.0, 100.0
    size = 40 * a
    domain = with_crack((0, -size), (size, size), straight(0, a, size), size / 8, a / 5)
    meshes = Meshes(under_pressure(p, STEEL), domain, 0.02)
    goal = ec.StressIntensity((a, 0.0), (1.0, 0.0), radius=0.9 * a)
    factor = meshes.goal(goal, MPA_ROOT, "stress intensity factor K_I")
    return meshes.result(exactly(factor, 2 * p * np.sqrt(a / np.pi)))


def crack_in_a_tube() -> Result:
    """Put a crack around the bore of a tube under pressure from inside.

    Tube, r from 10 to 20 mm and z from -20 to 20, with free ends and sides; a crack
    with the radius r < 14 in its middle, E = 210 000 MPa, nu = 0.3, pressure 100 MPa on
    its faces. Beside it the release of energy between cracks to r = 13.84 and 14.16,
    ``K_I^2 = E'/(2 pi r) dJ/dr``, with the proved energies of both.
    """
    bore, rim, tip, step = 10.0, 20.0, 14.0, 0.16

    def tube(reach: float) -> ec.Domain:
        return with_crack((bore, -20.0), (rim, 20.0), straight(bore, reach, rim), 3.0, 0.1)

    scene = under_pressure(100.0, STEEL)
    energies = []
    for reach in (tip - step, tip + step):
        neighbour = Meshes(scene, tube(reach), 4e-3)
        energies.append(neighbour.energy("energy", "N mm"))
    fallen = (energies[0].value - energies[1].value) / (2 * step)
    release = fallen / (2 * np.pi * tip) * E / (1 - NU**2)
    unknown = sum((energy.high - energy.low) / 2 for energy in energies)
    share = unknown / (2 * step) / fallen / 2

    meshes = Meshes(scene, tube(tip), 4e-3)
    goal = ec.StressIntensity((tip, 0.0), (1.0, 0.0), radius=3.6)
    factor = meshes.goal(goal, MPA_ROOT, "stress intensity factor K_I")
    value = float(np.sqrt(release))
    return meshes.result(says(factor, Other("release of energy", value, rounding=share * value)))


def crack_along_an_arc() -> Result:
    """Put a crack along an arc under pressure from inside.

    A quarter of a circle of radius R = 10 mm, in the middle of a square of 1200 mm,
    E = 210 000 MPa, nu = 0.3, plane strain, pressure p = 100 MPa on the faces. With
    ``q = sin^2(pi/8)`` Muskhelishvili's closed forms for an infinite body are
    ``p sqrt(pi R sin(pi/4))/(1 + q)`` times cos(pi/8) and sin(pi/8).
    """
    R, p, half = 10.0, 100.0, np.pi / 4
    s, c = R * np.sin(half), R * np.cos(half)
    size = 60 * R

    def draw(occ: Any) -> tuple[list[int], list[int]]:
        places = (
            (s, c),
            (0.0, R),
            (-s, c),
            (s + 2 * size, c - 2 * size),
            (-s - 2 * size, c - 2 * size),
        )
        right, top, left, *far = (occ.addPoint(*place, 0) for place in places)
        centre = occ.addPoint(0, 0, 0)
        arcs = [occ.addCircleArc(*ends) for ends in ((right, centre, top), (top, centre, left))]
        return arcs, [occ.addLine(far[0], right), occ.addLine(left, far[1])]

    domain = with_crack((-size, -size), (size, size), draw, size / 4, R / 20)
    material = ec.Elastic(E, NU)
    meshes = Meshes(under_pressure(p, material), domain, 0.02)
    scale = p * np.sqrt(np.pi * s) / (1 + np.sin(half / 2) ** 2)
    numbers = []
    for mode, share in (("I", np.cos(half / 2)), ("II", -np.sin(half / 2))):
        goal = ec.StressIntensity((s, c), (1.0, -1.0), radius=0.8 * R, mode=mode)
        factor = meshes.goal(goal, MPA_ROOT, f"stress intensity factor K_{mode}")
        numbers.append(exactly(factor, scale * share, "closed form"))
    return meshes.result(*numbers)
