"""Reference cases of punches, curved bodies, histories and space.

The first line of each docstring is the title of the case on the page, the rest its
geometry.
"""

from __future__ import annotations

from pathlib import Path

import erc_contact as ec
from namedmesh.base.releases import cell_nodes

import gmsh  # isort: skip - after erc_contact, as all that is compiled
import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from reference_bodies import hertz_line  # isort: skip
from reference_drawing import add_part, drawn  # isort: skip
from reference_numbers import (  # isort: skip
    UP,
    Meshes,
    Number,
    Other,
    Result,
    exactly,
    pressure_at,
    says,
)

MESHES = Path(__file__).resolve().parents[1] / "meshes"


def flat_punch() -> Result:
    """Press a flat punch with sharp edges on a block, without friction.

    Half of the block, (0, 20) x (0, 20), E = 1, nu = 0.3, plane strain, u_x = 0 at
    x = 0; it stands on its head: the contact with the rigid plane below is |x| < 1, and
    the top has u_y = -0.01. The pressure grows like the root of the distance to the
    edge. A half-plane has p = P/(pi sqrt(1 - x^2)); P is of both halves.
    """
    bricks = [("block", 0.0, 0.0, 20.0, 20.0)]
    parts = {"middle": (0, 0, 0, 20), "top": (0, 20, 20, 20), "foot": (0, 0, 1, 0)}
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("middle", (0.0, None)), ec.Displacement("top", (None, -0.01))],
        contacts=[ec.Contact("foot")],
    )
    probes = {
        "p(0) pi/P": lambda error: (
            pressure_at("foot", 0.0, 0.2)(error) * np.pi / (2 * error.force("foot").force[1])
        )
    }
    domain = drawn(bricks, parts, 5.0, points=[(1.0, 0.0)])
    meshes = Meshes(scene, domain, 4e-4, probes)
    energy = meshes.energy("strain energy", "force", 2.0)
    force = meshes.goal(ec.Resultant("foot", UP), "force/length", "force P", 2.0)
    peak = says(meshes.probe("p(0) pi/P", "-"), Other("half-plane", 1.0, approximate=True))
    return meshes.result(energy, force, peak)


def rounded_punch() -> Result:
    """Press a rounded punch on a block, without friction.

    Half of the block, (0, 10) x (0, 10), E = 1, nu = 0.3, plane strain, u_x = 0 at
    x = 0; it stands on its head: below is a rigid parabola with the gap x^2/20, and the
    top has u_y = -0.05. Hertz's half-width is for a half-plane and this P, the force on
    both halves.
    """
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("left", (0.0, None)), ec.Displacement("top", (None, -0.05))],
        contacts=[ec.Contact("bottom", gap=lambda x: x[0] ** 2 / 20)],
    )
    probes = {"half-width": lambda error: hertz_line(error.profile("bottom"))[0]}
    block = ec.rectangle((0.0, 0.0), (10.0, 10.0), cells=(8, 8))
    meshes = Meshes(scene, block, 2e-4, probes)
    energy = meshes.energy("strain energy", "force", 2.0)
    force = meshes.goal(ec.Resultant("bottom", UP), "force/length", "force P", 2.0)
    hertz = float(np.sqrt(4 * force.value * 10 * (1 - 0.3**2) / np.pi))
    width = says(
        meshes.probe("half-width", "length"), Other("Hertz, half-plane", hertz, approximate=True)
    )
    return meshes.result(energy, force, width)


def half_disc() -> Result:
    """Press a half disc on a plane, Hertz.

    Lower half of a disc of radius 1, E = 1, nu = 0.3, plane strain, no friction. Its
    diameter moves down by 0.01. Hertz's numbers are for a half-plane and this force.
    """
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.0, -0.01))],
        contacts=[ec.Contact("arc", gap=lambda x: x[1], normal=(0.0, -1.0))],
    )
    probes = {
        "half-width": lambda error: hertz_line(error.profile("arc"))[0],
        "greatest pressure": lambda error: hertz_line(error.profile("arc"))[1],
    }
    disc = ec.read_mesh(MESHES / "half_disc.geo", scripts=True)
    meshes = Meshes(scene, disc, 0.001, probes)
    force = meshes.goal(ec.Resultant("top", (0.0, -1.0)), "force/length", "force P")
    hertz = float(np.sqrt(4 * force.value * (1 - 0.3**2) / np.pi))
    width, peak = (
        meshes.probe("half-width", "length"),
        meshes.probe("greatest pressure", "force/area"),
    )
    says(width, Other("Hertz, half-plane", hertz, approximate=True))
    says(peak, Other("Hertz, half-plane", 2 * force.value / (np.pi * hertz), approximate=True))
    return meshes.result(meshes.energy("strain energy", "force"), force, width, peak)


def quarter_of_fit() -> ec.Domain:
    """Mesh a quarter of a shaft of radius 40 in a hub of radius 80."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 10.0)
    occ = gmsh.model.occ
    square = [(2, occ.addRectangle(0, 0, 0, 80.0, 80.0))]
    discs = [[(2, occ.addDisk(0, 0, 0, r, r))] for r in (40.0, 80.0)]
    shaft, _ = occ.intersect(discs[0], square, removeTool=False)
    hub, _ = occ.intersect(discs[1], square)
    occ.fragment(shaft, hub)
    occ.synchronize()
    by_area = sorted(gmsh.model.getEntities(2), key=lambda face: occ.getMass(*face))
    for name, (_, face) in zip(("shaft", "hub"), by_area, strict=True):
        gmsh.model.addPhysicalGroup(2, [face], name=name)
    boxes = {
        "shaft y=0": (0, 0, 40, 0),
        "hub y=0": (40, 0, 80, 0),
        "shaft x=0": (0, 0, 0, 40),
        "hub x=0": (0, 40, 0, 80),
    }
    for name, box in boxes.items():
        add_part(name, box)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain.split({"rim": "shaft", "bore": "hub"})


def press_fit() -> Result:
    """Press a shaft into a hub that is too narrow, Lame.

    Quarter of a shaft of radius 40 mm in a hub of radius 80, E = 210 000 MPa,
    nu = 0.3, plane strain, interference 0.04, no friction, both planes of symmetry on
    rollers. The energy belongs to the whole ring, the force acts between two quarters
    of the shaft. The mesh has flat facets; what they cost is estimated.
    """
    rollers = []
    for body in ("shaft", "hub"):
        rollers.append(ec.Displacement(f"{body} y=0", (None, 0.0)))
        rollers.append(ec.Displacement(f"{body} x=0", (0.0, None)))
    contact = ec.Contact("rim", against="bore", gap=-0.04)
    scene = ec.Scene(ec.Elastic(210e3, 0.3), rollers, contacts=[contact])
    modulus = 210e3 / (1 - 0.3**2)
    ratio = (80**2 + 40**2) / (80**2 - 40**2)
    pressure = 0.04 * modulus / 40 / (ratio + 1)

    def mean(error: ec.ConstitutiveError) -> float:
        profile = error.profile("rim")
        return float(np.average(profile["pressure"], weights=profile["weight"]))

    probes = {"mean pressure": mean}
    meshes = Meshes(scene, quarter_of_fit(), 1.5e-3, probes)
    energy = exactly(meshes.energy("strain energy", "N", 4.0), np.pi * 40 * pressure * 0.04)
    force = meshes.goal(ec.Resultant("shaft y=0", UP), "N/mm", "force across the shaft's half")
    number = says(meshes.probe("mean pressure", "MPa"), Other("Lame", pressure))
    return meshes.result(energy, exactly(force, 40 * pressure, "Lame"), number)


def tilted_plate() -> Result:
    """Press a block by a rigid plate with a force beside the middle.

    Rectangle (0, 2) x (0, 1), E = 1, nu = 0.3, plane strain, on a frictionless plane.
    The top is a rigid plate without motion along x. It carries the force -0.01 and, at
    its middle, the moment -0.006, so the contact opens at the left.
    """
    plate = ec.Rigid("top", (0.0, None), force=(None, -0.01), moment=-0.006)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [plate], contacts=[ec.Contact("bottom")])
    probes = {"rotation": lambda error: error.solution.motion("top").rotation[0]}
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    meshes = Meshes(scene, block, 2e-4, probes)
    moved = meshes.goal(ec.MeanDisplacement("top", UP), "length", "motion of the middle")
    work = meshes.energy("work of the loads", "force", -2.0)
    return meshes.result(work, moved, meshes.probe("rotation", "rad"))


def block_in_space() -> Result:
    """Press a block in 3D on a plane with a gap.

    Box (0, 2) x (0, 1) x (0, 1), E = 1, nu = 0.3, no friction, on a foundation with the
    gap 0.004 x^2 along z. The top has u_z = -0.01, the side x = 0 u_x = 0, the side
    y = 0 u_y = 0, the others are free. The contact ends where x is about 1.6.
    """
    supports = [
        ec.Displacement("left", (0.0, None, None)),
        ec.Displacement("front", (None, 0.0, None)),
        ec.Displacement("top", (None, None, -0.01)),
    ]
    contact = ec.Contact("bottom", gap=lambda x: 0.004 * x[0] ** 2)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=[contact])
    block = ec.box((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), cells=(4, 2, 2))
    meshes = Meshes(scene, block, 0.002)
    force = meshes.goal(ec.Resultant("bottom", (0.0, 0.0, 1.0)), "force", "force of the plane")
    return meshes.result(meshes.energy("strain energy", "force length"), force)


def cattaneo_mindlin() -> Result:
    """Shear a pressed body to and fro, Cattaneo and Mindlin.

    Square (-10, 10) x (0, 20), E = 1, nu = 0.4999, plane strain; below is a rigid
    cylinder, gap x^2/20. The top moves down by 0.05 without friction, then aside to
    0.032, to -0.032 and to 0.032 again with mu = 0.3. Numbers are over the closed
    forms of a half-plane for the forces of each step. Low and high are from runs of
    steps certified to 2% and to 1%; more steps would change the dissipated energy.
    """
    loose, fine = (sheared(accuracy) for accuracy in (0.02, 0.01))
    numbers = []
    for index, name in enumerate(("stick half-width", "greatest pressure", "energy of a cycle")):
        ends = sorted((loose[1][index], fine[1][index]))
        number = Number(
            f"{name}, ratio", "-", fine[1][index], ends[0], ends[1], "estimate", "two runs"
        )
        numbers.append(says(number, Other("half-plane", 1.0, approximate=True)))
    error = fine[0].error
    unknowns = error.model.space.d * error.model.space.node_count
    return Result(error.domain.cells, unknowns, error.total, numbers)


def sheared(accuracy: float) -> tuple[ec.Evolution, list[float]]:
    """Return the history, and its numbers over the numbers of the closed form."""
    radius, mu = 10.0, 0.3

    def scene_at(t: float) -> ec.Scene:
        push = 0.032 * float(np.interp(t, [0.0, 1.0, 3.0, 5.0], [0.0, 1.0, -1.0, 1.0]))
        law = mu if t > 0 else 0.0
        contact = ec.Contact("bottom", friction=law, gap=lambda x: x[0] ** 2 / (2 * radius))
        supports = [ec.Displacement("top", (push, -0.05))]
        return ec.Scene(ec.Elastic(1.0, 0.4999), supports, contacts=[contact])

    body = ec.rectangle((-10.0, 0.0), (10.0, 20.0), cells=(10, 10))
    size = 2.0
    while size > 0.02:
        corners = cell_nodes(body.mesh.geometry)[: body.owned_cells]
        x = body.mesh.geometry.x[corners].mean(axis=1)
        near = (abs(x[:, 0]) < max(0.55, 3 * size)) & (x[:, 1] < 3 * size)
        body = body.refined(np.flatnonzero(near).astype(np.int32))
        size /= 2
    times = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0]
    history = ec.evolve(scene_at, body, times, accuracy=accuracy, degree=2)
    step, profile = history.steps[2], history.profile("bottom")[2]
    shear, pressed = -step.force["bottom"][0], step.force["bottom"][1]
    a = np.sqrt(4 * pressed * radius * (1 - 0.4999**2) / np.pi)
    peak = 2 * pressed / (np.pi * a)
    c = a * np.sqrt(1 - shear / (mu * pressed))
    x = np.linspace(c, a, 2001)
    slip = (x * np.sqrt(x**2 - c**2) - c**2 * np.arccosh(x / c)) / 2
    density = peak * np.sqrt(np.maximum(1 - (x / a) ** 2, 0.0)) * slip
    cycle = 8 * mu**2 / radius * float(np.trapezoid(density, x))
    taken = np.diff(history.column("dissipated"))[2:].sum()
    centre = step.moment["bottom"][0] / pressed
    width = stick_half_width(profile, centre, a)
    return history, [width / c, float(profile["pressure"].max()) / peak, float(taken / cycle)]


def stick_half_width(profile: np.ndarray, centre: float, a: float) -> float:
    """Return half the length of the stick zone; beside it slip^(2/3) is a line."""
    ends = []
    for y in (profile["x"] - centre, centre - profile["x"]):
        outermost = y[profile["status"] == ec.results.STICK].max()
        near = (y > outermost + 0.03 * a) & (y < outermost + 0.1 * a)
        slope, at_zero = np.polyfit(y[near], abs(profile["slip"][near]) ** (2 / 3), 1)
        ends.append(-at_zero / slope)
    return float(sum(ends) / 2)
