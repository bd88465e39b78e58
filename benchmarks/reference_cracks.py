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
from reference_numbers import Meshes, Result, exactly  # isort: skip
from reference_turned import STEEL  # isort: skip


def half_plane_with_crack(a: float, size: float, at_tip: float) -> ec.Domain:
    """Return the section of a cylinder with a penny crack in its middle.

    Args:
        a: Radius of the crack [length].
        size: Radius and half of the length of the cylinder [length].
        at_tip: Size of elements at the tip [length].
    """

    def build(gmsh: Any) -> None:
        model, occ = gmsh.model, gmsh.model.occ
        section = occ.addRectangle(0, -size, 0, size, 2 * size)
        places = [occ.addPoint(r, 0, 0) for r in (0, a, size)]
        lines = [(1, occ.addLine(*places[i : i + 2])) for i in range(2)]
        _, parts = occ.fragment([(2, section)], lines)
        occ.synchronize()
        for _, tag in parts[0]:
            above = occ.getCenterOfMass(2, tag)[1] > 0
            model.addPhysicalGroup(2, [tag], name="up" if above else "down")
        model.addPhysicalGroup(1, [tag for _, tag in parts[1]], name="crack")
        gmsh.option.setNumber("Mesh.MeshSizeMax", size / 8)
        ends = model.getBoundary(parts[1], combined=False, oriented=False)
        model.mesh.setSize(ends, at_tip)

    with session(MPI.COMM_WORLD, build, "The section") as model:
        whole = ec.from_gmsh(model, MPI.COMM_WORLD)
    return whole.split({"upper lip": "up", "lower lip": "down"}, on="crack")


def penny_crack() -> Result:
    """Put a penny-shaped crack under pressure from inside, Sneddon.

    Crack of radius a = 10 mm in the middle of a cylinder of radius 400 and length 800,
    E = 210 000 MPa, nu = 0.3, pressure p = 100 MPa on its faces. The closed form 2 p
    sqrt(a/pi) is of an infinite body.
    """
    a, p = 10.0, 100.0
    loads = [ec.Traction(lip, pressure=p) for lip in ("upper lip", "lower lip")]
    meshes = Meshes(ec.Scene(STEEL, loads=loads), half_plane_with_crack(a, 40 * a, a / 5), 0.02)
    goal = ec.StressIntensity((a, 0.0), (1.0, 0.0), radius=0.9 * a)
    factor = meshes.goal(goal, "MPa sqrt(mm)", "stress intensity factor K_I")
    return meshes.result(exactly(factor, 2 * p * np.sqrt(a / np.pi)))
