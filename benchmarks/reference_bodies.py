"""Reference cases of two bodies, and of two metals.

The first line of each docstring is the title of the case on the page, the rest its
geometry.
"""

from __future__ import annotations

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from reference_drawing import drawn  # isort: skip
from reference_fourier import Layer, approached, receding  # isort: skip
from reference_numbers import (  # isort: skip
    FOURIER,
    UP,
    Meshes,
    Other,
    Result,
    exactly,
    opening_ends,
    pressure_at,
    says,
)


def hertz_line(profile: np.ndarray) -> tuple[float, float]:
    """Return half-width and peak: p^2 is a straight line over x^2 in the inner part."""
    x, pressure = profile["x"], profile["pressure"]
    inner = pressure > 0.3 * pressure.max()
    slope, square = np.polyfit(x[inner] ** 2, pressure[inner] ** 2, 1)
    return float(np.sqrt(-square / slope)), float(np.sqrt(square))


def slipping_blocks() -> Result:
    """Slide a block on another one with a slip that varies.

    Squares |x| <= 1, 1 high, on each other: E = 1000, nu = 0.3 above, 250 and 0.2
    below, plane strain, mu = 0.3. In both sigma_yy = -10, sigma_xy = 3, sigma_xx = 0,
    so that all slips, by 0.02 - 0.0057 x. Top and bottom have the displacements of
    this state, u = (a x + g y + c, b y), the other sides its tractions.
    """
    numbers = {
        "upper": (0.0039, 0.0078, -0.0091, 0.02),
        "lower": (0.0096, 0.0288, -0.0384, 0.0),
    }
    supports = []
    for name, y in (("upper", 1.0), ("lower", -1.0)):
        a, g, b, c = numbers[name]
        along = lambda x, a=a, g=g, c=c, y=y: a * x[0] + g * y + c  # noqa: E731
        supports.append(ec.Displacement(f"{name} end", (along, b * y)))
    loads = [ec.Traction("right", (0.0, 3.0)), ec.Traction("left", (0.0, -3.0))]
    bricks = [("upper", -1.0, 0.0, 2.0, 1.0), ("lower", -1.0, -1.0, 2.0, 1.0)]
    parts = {
        "upper end": (-1, 1, 1, 1),
        "lower end": (-1, -1, 1, -1),
        "right": (1, -1, 1, 1),
        "left": (-1, -1, -1, 1),
    }
    material = ec.Elastic({"upper": 1000.0, "lower": 250.0}, {"upper": 0.3, "lower": 0.2})
    contact = ec.Contact("foot", friction=0.3, against="seat")
    domain = drawn(bricks, parts, 0.5).split({"foot": "upper", "seat": "lower"})
    meshes = Meshes(ec.Scene(material, supports, loads, [contact]), domain, 1e-3)
    normal = meshes.force("foot", UP, "force/length", "normal force")
    shear = meshes.force("foot", (1.0, 0.0), "force/length", "friction force")
    return meshes.result(exactly(normal, 20.0), exactly(shear, -6.0))


def receding_layers() -> Result:
    """Press a layer on a bonded one, from which its ends recede.

    Half of two layers. Upper: (0, 80) x (0, 10) mm, E = 1000 MPa, nu = 0.3; lower:
    (0, 200) x (-20, 0), 4000 and 0.25, fixed below; plane strain, no friction; u_x = 0
    at x = 0. A pressure of 1 MPa acts on the top where |x| < 5. The energy belongs to
    both halves. Earlier Fourier integrals of ours had the energy 0.0458814466.
    """
    bricks = [
        ("upper", 0.0, 0.0, 5.0, 10.0),
        ("upper", 5.0, 0.0, 75.0, 10.0),
        ("lower", 0.0, -20.0, 200.0, 20.0),
    ]
    parts = {"middle": (0, -20, 0, 10), "load": (0, 10, 5, 10), "base": (0, -20, 200, -20)}
    scene = ec.Scene(
        ec.Elastic({"upper": 1000.0, "lower": 4000.0}, {"upper": 0.3, "lower": 0.25}),
        [ec.Displacement("middle", (0.0, None)), ec.Displacement("base", (0.0, 0.0))],
        [ec.Traction("load", pressure=1.0)],
        [ec.Contact("foot", against="seat")],
    )
    domain = drawn(bricks, parts, 5.0).split({"foot": "upper", "seat": "lower"})
    probes = {
        "half-width b": opening_ends("foot"),
        "p(0)": pressure_at("foot", 0.0, 1.0),
        "p(b/2)": pressure_at("foot", 11.1310204 / 2, 1.0),
    }
    meshes = Meshes(scene, domain, 2e-4, probes)
    energy = meshes.energy("strain energy", "N", -2.0)
    layers = (Layer(10.0, 1000.0, 0.3), Layer(20.0, 4000.0, 0.25))
    fourier = receding(*layers, 5.0)
    says(energy, Other(FOURIER, fourier.energy, exact=True, rounding=1e-11))
    says(energy, Other("earlier Fourier integrals", 0.0458814466, rounding=5e-11))
    width = says(meshes.probe("half-width b", "mm"), Other(FOURIER, fourier.half_width))
    peak = says(meshes.probe("p(0)", "MPa"), Other(FOURIER, fourier.peak))
    half = says(meshes.probe("p(b/2)", "MPa"), Other(FOURIER, 0.47235273, rounding=5e-9))
    return meshes.result(energy, width, peak, half)


def layers_with_a_gap() -> Result:
    """Move a layer down on another one over a parabolic gap.

    Half of two layers of 320 mm. Upper: 10 high, E = 200 000 MPa, nu = 0.3, its top
    moved by (0, -0.1); lower: 20 high, 1000 and 0.45, fixed below; plane strain, no
    friction, gap x^2/1000 as a field on flat sides; u_x = 0 at x = 0. Energy and force
    belong to both halves. Fourier integrals are of infinite layers: half-lengths of 160
    mm have an energy that is 2e-6 smaller, which the interval shows.
    """
    bricks = [("upper", 0.0, 0.0, 320.0, 10.0), ("lower", 0.0, -20.0, 320.0, 20.0)]
    parts = {"middle": (0, -20, 0, 10), "top": (0, 10, 320, 10), "base": (0, -20, 320, -20)}
    scene = ec.Scene(
        ec.Elastic({"upper": 200e3, "lower": 1000.0}, {"upper": 0.3, "lower": 0.45}),
        [
            ec.Displacement("top", (0.0, -0.1)),
            ec.Displacement("base", (0.0, 0.0)),
            ec.Displacement("middle", (0.0, None)),
        ],
        contacts=[ec.Contact("foot", against="seat", gap=lambda x: x[0] ** 2 / 1000)],
    )
    domain = drawn(bricks, parts, 5.0).split({"foot": "upper", "seat": "lower"})
    probes = {"half-width b": opening_ends("foot"), "p(0)": pressure_at("foot", 0.0, 1.0)}
    meshes = Meshes(scene, domain, 3e-4, probes)
    energy = meshes.energy("strain energy", "N", 2.0)
    layers = (Layer(10.0, 200e3, 0.3), Layer(20.0, 1000.0, 0.45))
    fourier = approached(*layers, 0.1, 500.0)
    exactly(energy, fourier.energy, FOURIER)
    force = meshes.goal(ec.Resultant("base", UP), "N/mm", "force", 2.0)
    exactly(force, fourier.force, FOURIER)
    width = says(meshes.probe("half-width b", "mm"), Other(FOURIER, fourier.half_width))
    peak = says(meshes.probe("p(0)", "MPa"), Other(FOURIER, fourier.peak))
    return meshes.result(energy, force, width, peak)


def two_blocks() -> Result:
    """Press and push a block on a stiffer one, as GetFEM and CalculiX do.

    Rectangles of 2 x 1 on each other, E = 1000 above, 3000 below, nu = 0.3, plane
    strain, mu = 0.3. The lower one is held below, the top of the upper one is moved by
    (0.01, -0.02). The other codes have 970 triangles of degree 2; what they differ by
    is given to 0.01%.
    """
    bricks = [("upper", -1.0, 0.0, 2.0, 1.0), ("lower", -1.0, -1.0, 2.0, 1.0)]
    parts = {"top": (-1, 1, 1, 1), "bottom": (-1, -1, 1, -1)}
    scene = ec.Scene(
        ec.Elastic({"upper": 1000.0, "lower": 3000.0}, 0.3),
        [ec.Displacement("top", (0.01, -0.02)), ec.Displacement("bottom", (0.0, 0.0))],
        contacts=[ec.Contact("foot", friction=0.3, against="seat")],
    )
    domain = drawn(bricks, parts, 0.5).split({"foot": "upper", "seat": "lower"})
    meshes = Meshes(scene, domain, 3e-4)
    normal = meshes.force("foot", UP, "force/length", "normal force")
    along = meshes.force("foot", (-1.0, 0.0), "force/length", "friction force")
    for number, force, getfem, calculix in (
        (normal, 35.03, 3e-4, -6e-4),
        (along, 4.105, 7e-4, -17e-4),
    ):
        rounding = 2e-4 * force
        says(number, Other("GetFEM", force * (1 + getfem), rounding=rounding))
        says(number, Other("CalculiX, penalty", force * (1 + calculix), rounding=rounding))
    return meshes.result(normal, along)


def hertz_cylinders() -> Result:
    """Press two cylinders on each other, Ansys VM191, as blocks with Hertz's gap.

    Half of two blocks of 80 x 40 mm, E = 30 000 MPa, nu = 0.25 above, 29 120 and 0.3
    below, plane strain, no friction; gap x^2/2R with 1/R = 1/10 + 1/13, as Hertz has
    it. The force is 3200 N/mm, as a pressure on the top; u_y = 0 below, u_x = 0 at
    x = 0. Ansys has quarters of discs, in plane stress; its target for the half-width
    is computed in plane strain (plane stress has 1.248).
    """
    radius = 1 / (1 / 10 + 1 / 13)
    moduli, ratios = {"upper": 30000.0, "lower": 29120.0}, {"upper": 0.25, "lower": 0.3}
    bricks = [("upper", 0.0, 0.0, 40.0, 40.0), ("lower", 0.0, -40.0, 40.0, 40.0)]
    parts = {"middle": (0, -40, 0, 40), "top": (0, 40, 40, 40), "bottom": (0, -40, 40, -40)}
    scene = ec.Scene(
        ec.Elastic(moduli, ratios),
        [ec.Displacement("bottom", (None, 0.0)), ec.Displacement("middle", (0.0, None))],
        [ec.Traction("top", pressure=3200.0 / 80)],
        [ec.Contact("roller", gap=lambda x: x[0] ** 2 / (2 * radius), against="track")],
    )
    domain = drawn(bricks, parts, 8.0).split({"roller": "upper", "track": "lower"})
    probes = {
        "half-width": lambda error: hertz_line(error.profile("roller"))[0],
        "greatest pressure": lambda error: hertz_line(error.profile("roller"))[1],
    }
    meshes = Meshes(scene, domain, 3e-4, probes)
    width, peak = meshes.probe("half-width", "mm"), meshes.probe("greatest pressure", "MPa")
    says(width, Other("Hertz, half-planes", 1.19971, rounding=5e-6, approximate=True))
    says(width, Other("Ansys VM191, target", 1.20, rounding=5e-3))
    says(width, Other("Ansys VM191, PLANE182", 1.1609, rounding=5e-5))
    says(peak, Other("Hertz, half-planes", 1698.06, rounding=5e-3, approximate=True))
    energy = meshes.energy("potential energy of a half", "N")
    return meshes.result(energy, width, peak)


def bimetal_strip() -> Result:
    """Heat a strip of two metals until its tip presses on a stop.

    Steel (0, 40) x (0, 1.5) mm, E = 200 000 MPa, heat 12e-6; brass on it, 1 high,
    100 000 and 19e-6; nu = 0.3, plane stress, 1 mm thick, clamped at x = 0. Heated by
    150, the last 4 mm of the lower side meet a flat frictionless stop at the distance
    0.25. The beam is Timoshenko's of 1925, with the force at the end of the tip.
    """
    bricks = [
        ("brass", 0.0, 1.5, 40.0, 1.0),
        ("steel", 0.0, 0.0, 36.0, 1.5),
        ("steel", 36.0, 0.0, 4.0, 1.5),
    ]
    parts = {"clamp": (0, 0, 0, 2.5), "tip": (36, 0, 40, 0)}
    scene = ec.Scene(
        ec.Elastic({"brass": 100e3, "steel": 200e3}, 0.3, hypothesis="plane stress"),
        [ec.Displacement("clamp", (0.0, 0.0))],
        contacts=[ec.Contact("tip", gap=0.25)],
        strains=[ec.ThermalStrain({"brass": 19e-6, "steel": 12e-6}, 150.0)],
    )
    meshes = Meshes(scene, drawn(bricks, parts, 1.0), 4e-4)
    force = meshes.goal(ec.Resultant("tip", UP), "N", "force of the stop")
    m, n, h = 1.0 / 1.5, 0.5, 2.5
    both = 3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))
    curvature = 6 * 7e-6 * 150 * (1 + m) ** 2 / (h * both)
    axis = (200e3 * 1.5 * 0.75 + 100e3 * 2.0) / (200e3 * 1.5 + 100e3)
    bending = 200e3 * (1.5**3 / 12 + 1.5 * (0.75 - axis) ** 2)
    bending += 100e3 * (1 / 12 + (2.0 - axis) ** 2)
    beam = 3 * bending / 40**3 * (curvature * 40**2 / 2 - 0.25)
    return meshes.result(says(force, Other("beam", float(beam), approximate=True)))


def bar_between_sections() -> Result:
    """Pull and bend a bar of two layers between plane sections.

    Rectangle (0, 4) x (0, 1), nu = 0.3, plane strain; E = 100 below y = 0.5, 300 above.
    Its ends stay plane and slide in themselves. The left one does not move along x and
    does not turn, the right one carries the force 2 and, about its middle, the moment
    0.5. A layer has the stress E' (q - theta y')/4 with E' = E/(1 - nu^2) and y' from
    the middle.
    """
    bricks = [("soft", 0.0, 0.0, 4.0, 0.5), ("stiff", 0.0, 0.5, 4.0, 0.5)]
    parts = {"left": (0, 0, 0, 1), "right": (4, 0, 4, 1)}
    ends = [
        ec.PlaneSection("left", (0.0, None), rotation=0.0),
        ec.PlaneSection("right", force=(2.0, None), moment=0.5),
    ]
    scene = ec.Scene(ec.Elastic({"soft": 100.0, "stiff": 300.0}, 0.3), ends)
    meshes = Meshes(scene, drawn(bricks, parts, 0.5), 1e-3)
    # Integrals of E', E' y' and E' y'^2 over the section.
    area, first, second = np.array([400 / 2, 200 / 8, 400 / 24]) / (1 - 0.3**2)
    q, theta = 4 * np.linalg.solve([[area, -first], [-first, second]], [2.0, 0.5])
    moved = meshes.goal(ec.MeanDisplacement("right", (1.0, 0.0)), "length", "motion of the middle")
    turned = meshes.goal(ec.Rotation("right"), "rad", "rotation")
    work = meshes.energy("work of the loads", "force", -2.0)
    return meshes.result(
        exactly(work, 2.0 * q + 0.5 * theta), exactly(moved, q), exactly(turned, theta)
    )
