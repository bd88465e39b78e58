"""Reference cases of axisymmetric bodies whose contact has an edge that is not known.

Balls, punches, discs whose rims recede, and fits with friction. The first line of each
docstring is the title of the case on the page, the rest its geometry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import erc_contact as ec
from erc_contact.base.ufl_types import Ufl

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip
from reference_drawing import Box, Brick, drawn, meshed, opened, part_of_disc  # isort: skip
from reference_numbers import (  # isort: skip
    FINE,
    UP,
    Meshes,
    Other,
    Probe,
    Result,
    Told,
    beside,
    exactly,
    moved,
    opening_ends,
    pressure_at,
    run,
    says,
)
from reference_turned import (  # isort: skip
    DOWN,
    SOFT,
    STEEL_IN_ALUMINIUM,
    between_plates,
    tube_in_hub,
    turned,
)

HANKEL = "Hankel integrals"
"""Source of numbers of infinite layers by dual integral equations, in words."""
QUARTERS = ("0", "{}/4", "{}/2", "3{}/4")
"""Places of the pressures that are compared, of a contact with a given radius."""
Faces = list[tuple[int, int]]
"""Type of faces of gmsh, with their dimension."""
NEAR = 0.06
"""Share of the contact radius within which points give the pressure at a place [-]."""

BELOW = 1e-6
"""Distance below a contact at which the lower body is asked [length]."""


def pressures(
    contact: str, radius: float, values: Sequence[float], name: str = "a", of: str = ""
) -> dict[str, Told]:
    """Tell pressures at the middle of a contact and at quarters of its radius."""
    told = {}
    for quarter, (place, value) in enumerate(zip(QUARTERS, values, strict=False)):
        probe = pressure_at(contact, radius * quarter / 4, NEAR * radius)
        told[f"p({place.format(name)}){of}"] = Told(probe, "force/area", value)
    return told


def contact_radius(contact: str, value: float, name: str = "a") -> dict[str, Told]:
    """Tell where a contact ends."""
    return {f"contact radius {name}": Told(opening_ends(contact), "length", value)}


def stick_radius(contact: str, value: float, axis: str = "x") -> Told:
    """Tell where the last facet that sticks ends."""

    def read(error: ec.ConstitutiveError) -> float:
        profile = error.profile(contact)
        stick = profile["status"] == ec.results.STICK
        return float(profile[axis][stick].max(initial=0.0))

    return Told(read, "length", value)


def force_of(contact: str, value: float, component: int = 1) -> Told:
    """Tell the size of a component of the force of a contact."""
    return Told(lambda error: float(abs(error.force(contact).force[component])), "force", value)


def together(results: Mapping[str, Result]) -> Result:
    """Return several runs as one case: all numbers, the largest mesh and error."""
    numbers = []
    for name, result in results.items():
        for number in result.numbers:
            numbers.append(replace(number, quantity=f"{number.quantity}, {name}"))
    runs = results.values()
    return Result(
        max(result.cells for result in runs),
        max(result.unknowns for result in runs),
        max(result.eps for result in runs),
        numbers,
    )


def on_the_ball(friction: float, accuracy: float, told: Mapping[str, Told]) -> Meshes:
    """Press a layer of thickness 10 on a rigid paraboloid."""
    contact = ec.Contact("bottom", gap=lambda x: x[0] ** 2 / 1000, friction=friction)
    scene = ec.Scene(SOFT, [ec.Displacement("top", (0.0, -0.1))], contacts=[contact])
    layer = ec.rectangle((0.0, 0.0), (100.0, 10.0), cells=(40, 4))
    return run(scene, layer, accuracy, told)


def ball_on_a_layer() -> Result:
    """Press a large ball on a bonded layer.

    Layer, r from 0 to 100, thickness 10, E = 1000, nu = 0.3; its far face is moved by
    0.1 towards a rigid frictionless paraboloid with the gap r^2/1000. The references
    are Hankel integrals of an infinite layer.
    """
    a, values = 8.646255987, (14.76424456, 14.23484669, 12.57812149, 9.431096427)
    told = contact_radius("bottom", a) | pressures("bottom", a, values)
    meshes = on_the_ball(0.0, 5e-4, told)
    energy = meshes.energy("strain energy", "force length")
    force = meshes.goal(ec.Resultant("bottom", UP), "force", "force")
    numbers = [exactly(energy, 79.38378369, HANKEL), exactly(force, 2255.374380, HANKEL)]
    return meshes.result(*numbers, *beside(meshes, told, HANKEL))


def ball_on_a_rough_layer() -> Result:
    """Press a large ball on a bonded layer with friction.

    As above, with Coulomb friction, mu = 0.1, 0.2 and 0.3, each in one step. The middle
    sticks up to the radius c, the rest slips inward. The references have nodes at both
    radii.
    """
    references = {
        0.1: (2262.173, 8.61339, 2.66503, (15.344, 14.8004, 12.7770, 9.4286)),
        0.2: (2267.920, 8.58717, 5.35332, (15.304, 14.7660, 13.071, 9.4851)),
        0.3: (2271.683, 8.56957, 6.5555, (15.29, 14.753, 13.066, 9.8263)),
    }
    results = {}
    for friction, (force, a, c, values) in references.items():
        told = {"force": force_of("bottom", force), **contact_radius("bottom", a)}
        told["stick radius c"] = stick_radius("bottom", c)
        told |= pressures("bottom", a, values)
        meshes = on_the_ball(friction, 5e-4, told)
        results[f"mu = {friction:g}"] = meshes.result(*beside(meshes, told, FINE))
    return together(results)


def two_layers() -> Result:
    """Press two bonded layers on each other over a parabolic gap.

    Layers, r from 0 to 120, without friction, gap r^2/1000 as a field on flat sides.
    Upper: 10 high, E = 1000, nu = 0.3, its top moved by (0, -0.15); lower: 20 high, 250
    and 0.4, fixed below. The references are Hankel integrals of infinite layers; at the
    radius of 120 the force is 1.0e-5 lower and the energy 8e-6, as a second code finds.
    """
    bricks = [("upper", 0.0, 0.0, 120.0, 10.0), ("lower", 0.0, -20.0, 120.0, 20.0)]
    parts: dict[str, Box] = {"top": (0, 10, 120, 10), "base": (0, -20, 120, -20)}
    material = ec.Elastic(
        {"upper": 1000.0, "lower": 250.0},
        {"upper": 0.3, "lower": 0.4},
        hypothesis="axisymmetric",
    )
    supports = [ec.Displacement("top", (0.0, -0.15)), ec.Displacement("base", (0.0, 0.0))]
    contact = ec.Contact("foot", against="seat", gap=lambda x: x[0] ** 2 / 1000)
    domain = drawn(bricks, parts, 5.0).split({"foot": "upper", "seat": "lower"})
    a, values = 10.23269445, (3.4064092, 3.29144048, 2.92660939, 2.21532322)
    told = contact_radius("foot", a) | pressures("foot", a, values)
    told["u_z of the seat at r = 0"] = moved((0.0, -BELOW), 1, -0.1255188)
    meshes = run(ec.Scene(material, supports, contacts=[contact]), domain, 5e-4, told)
    energy = meshes.energy("strain energy", "force length")
    force = meshes.goal(ec.Resultant("base", UP), "force", "force")
    says(energy, Other(HANKEL, 39.97625001, approximate=True))
    says(force, Other(HANKEL, 738.1166395, approximate=True))
    return meshes.result(energy, force, *beside(meshes, told, HANKEL))


def pushed_disc(
    bricks: Sequence[Brick],
    scene: ec.Scene,
    told: Mapping[str, Told],
    energy: float,
    split: Mapping[str, str] | None = None,
) -> Result:
    """Push a disc of radius 60 on what is below; the rim of the disc recedes."""
    disc = [("disc", 0.0, 0.0, 5.0, 10.0), ("disc", 5.0, 0.0, 55.0, 10.0)]
    parts: dict[str, Box] = {"load": (0, 10, 5, 10), "base": (0, -20, 60, -20)}
    if split is None:
        parts["foot"] = (0, 0, 60, 0)
        del parts["base"]
    domain = drawn([*disc, *bricks], parts, 2.5)
    if split is not None:
        domain = domain.split(split)
    scene = replace(scene, loads=[ec.Traction("load", pressure=1.0)])
    meshes = run(scene, domain, 5e-4, told)
    stored = says(
        meshes.energy("strain energy", "force length", -1.0),
        Other(FINE, energy, rounding=5e-9),
    )
    force = exactly(meshes.force("foot", UP, "force", "force"), np.pi * 25, "balance")
    return meshes.result(stored, force, *beside(meshes, told, FINE))


def receding_disc() -> Result:
    """Press a disc on a rigid base, from which its rim recedes.

    Disc of radius 60 and height 10, E = 1000, nu = 0.3. A pressure of 1 acts on the top
    where r < 5; below is a frictionless plane. An infinite layer has b = 12.13363 and
    the energy 0.2085435.
    """
    b, values = 12.09151, (0.48207, 0.412334, 0.256848, 0.114449)
    told = contact_radius("foot", b, "b") | pressures("foot", b, values, "b")
    told["u_z of the top at r = 0"] = moved((0.0, 10.0), 1, -0.00660890)
    told["lift of the rim"] = moved((60.0, 0.0), 1, 0.00187619)
    scene = ec.Scene(SOFT, [], contacts=[ec.Contact("foot")])
    return pushed_disc([], scene, told, 0.20888209)


def receding_discs() -> Result:
    """Press a disc on a bonded layer, from which its rim recedes.

    Disc as above, on a layer of the same radius, 20 high, E = 500 and nu = 0.25, which
    is fixed below; no friction. An infinite layer has b = 19.99308 and the energy
    0.3664975.
    """
    b, values = 19.71495, (0.24706, 0.184071, 0.088678, 0.036953)
    told = contact_radius("foot", b, "b") | pressures("foot", b, values, "b")
    told["u_z of the top at r = 0"] = moved((0.0, 10.0), 1, -0.01090773)
    told["u_z of the seat at r = 0"] = moved((0.0, -BELOW), 1, -0.00529261)
    told["lift of the rim"] = moved((60.0, BELOW), 1, 0.00369193)
    material = ec.Elastic(
        {"disc": 1000.0, "layer": 500.0}, {"disc": 0.3, "layer": 0.25}, hypothesis="axisymmetric"
    )
    base = ec.Displacement("base", (0.0, 0.0))
    scene = ec.Scene(material, [base], contacts=[ec.Contact("foot", against="seat")])
    layer = ("layer", 0.0, -20.0, 60.0, 20.0)
    return pushed_disc([layer], scene, told, 0.36761073, {"foot": "disc", "seat": "layer"})


def punch_on_a_layer() -> Result:
    """Press a flat circular punch on a bonded layer.

    Layer, r from 0 to 100, thickness 10, E = 1000, nu = 0.3; its far face is moved by
    0.05 towards a rigid frictionless punch of radius 5 with sharp edges. The references
    are Hankel integrals of an infinite layer.
    """
    bricks = [("layer", 0.0, 0.0, 5.0, 10.0), ("layer", 5.0, 0.0, 95.0, 10.0)]
    parts: dict[str, Box] = {"top": (0, 10, 100, 10), "foot": (0, 0, 5, 0)}
    scene = ec.Scene(SOFT, [ec.Displacement("top", (0.0, -0.05))], contacts=[ec.Contact("foot")])
    # E delta / a is 10.
    told = pressures("foot", 5.0, (6.2350092, 6.38015906, 6.9410181, 8.69665358))
    meshes = run(scene, drawn(bricks, parts, 5.0), 1e-3, told)
    energy = exactly(meshes.energy("strain energy", "force length"), 22.3080414, HANKEL)
    force = meshes.goal(ec.Resultant("foot", UP), "force", "force")
    exactly(force, 892.321656, HANKEL)
    return meshes.result(energy, force, *beside(meshes, told, HANKEL))


def ball_on_a_cylinder() -> Result:
    """Press a ball on a small cylinder, whose base is clamped or slides.

    Cylinder of radius and height 20, E = 1000, nu = 0.3; its far face is moved by 0.01
    towards a rigid frictionless paraboloid with the gap r^2/200. Hertz's half-space has
    for this approach a = 1, the force 14.65201 and p(0) = 6.995822.
    """
    references = {
        "base that slides": (None, 1.01069, 15.12739, (7.07088, 6.84632, 6.1236), 0.0601845),
        "clamped base": (0.0, 1.01360, 15.2594, (7.0916,), 0.0606197),
    }
    results = {}
    for name, (held, a, value, values, stored) in references.items():
        contact = ec.Contact("bottom", gap=lambda x: x[0] ** 2 / 200)
        scene = ec.Scene(SOFT, [ec.Displacement("top", (held, -0.01))], contacts=[contact])
        cylinder = ec.rectangle((0.0, 0.0), (20.0, 20.0), cells=(20, 20))
        told = contact_radius("bottom", a) | pressures("bottom", a, values)
        meshes = run(scene, cylinder, 5e-4, told)
        energy = says(meshes.energy("strain energy", "force length"), Other(FINE, stored))
        force = says(meshes.goal(ec.Resultant("bottom", UP), "force", "force"), Other(FINE, value))
        results[name] = meshes.result(energy, force, *beside(meshes, told, FINE))
    return together(results)


def rough_platens() -> Result:
    """Press a cylinder between rough platens.

    Cylinder of radius 1 and height 2, E = 1, nu = 0.3, shortened by 1%; the upper half,
    with u_z = 0 on z = 0. Coulomb friction, mu = 0.1 and 0.3, each in one step. The
    ends stick up to the radius c, the rim slips outward.
    """
    references = {
        0.1: (0.032071136, 0.061496, (0.009077, 0.0095224, 0.0097247, 0.009981), 0.00307857),
        0.3: (0.033114698, 0.87052, (0.009217, 0.0092142, 0.0092476, 0.009600), 0.00319495),
    }
    results = {}
    for friction, (force, c, values, bulge) in references.items():
        contact = ec.Contact("top", gap=-0.01, friction=friction)
        scene = ec.Scene(turned(1.0, 0.3), between_plates("bottom"), contacts=[contact])
        told = {"force": force_of("top", force), "stick radius c": stick_radius("top", c)}
        told |= pressures("top", 1.0, values, "R")
        told["u_r of the middle"] = moved((1.0, 0.0), 0, bulge)
        body = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(8, 8))
        meshes = run(scene, body, 5e-4, told)
        results[f"mu = {friction:g}"] = meshes.result(*beside(meshes, told, FINE))
    return together(results)


def bonded_platens() -> Result:
    """Press a cylinder between platens to which it is bonded.

    As above, with u_r = 0 at the ends, whose pressure is singular at the rim. The
    apparent modulus is 1.0543029 E.
    """
    supports = [*between_plates("bottom"), ec.Displacement("top", (0.0, -0.01))]
    told = {"u_r of the middle": moved((1.0, 0.0), 0, 0.00319543)}
    body = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(8, 8))
    meshes = run(ec.Scene(turned(1.0, 0.3), supports), body, 1e-3, told)
    energy = meshes.energy("strain energy of a half", "force length")
    force = meshes.goal(ec.Resultant("top", DOWN), "force", "force")
    says(energy, Other(FINE, 1.6560952e-4, rounding=5e-12))
    says(force, Other(FINE, 0.033121903, rounding=5e-10))
    return meshes.result(energy, force, *beside(meshes, told, FINE))


def rough_fit() -> Result:
    """Press a hollow shaft into a hub with free ends and friction.

    Shaft and hub as above, z = 0 is a plane of symmetry, z = 20 free; mu = 0.1 and 0.2,
    each in one step. The fit sticks for z < c. The force is the sum around the ring.
    """
    references = {
        0.1: (160470.90, 1.634, (32.831, 32.372), (0.0305806, -0.00828057)),
        0.2: (161079.87, 10.192, (32.878, 32.899), (0.0304366, -0.00841626)),
    }
    results = {}
    for friction, (force, c, values, sides) in references.items():
        fit = ec.Contact("rim", against="bore", gap=-0.05, friction=friction)
        scene = ec.Scene(STEEL_IN_ALUMINIUM, between_plates("bottom"), contacts=[fit])
        told = {
            "radial force": force_of("bore", force, 0),
            "stick length c": stick_radius("rim", c, "y"),
        }
        for z, value in zip((0.0, 5.0), values, strict=True):
            told[f"p(z = {z:g})"] = Told(pressure_at("rim", z, 0.6, "y"), "MPa", value)
        for name, r, value in zip(("outside", "inside"), (70.0, 20.0), sides, strict=True):
            told[f"u_r {name}, z = 0"] = moved((r, 0.0), 0, value)
        meshes = run(scene, tube_in_hub(5.0, 20.0, 70.0, 20.0), 1e-4, told)
        results[f"mu = {friction:g}"] = meshes.result(*beside(meshes, told, FINE))
    return together(results)


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
    a, values = 10.35854, (2910.40, 2821.67, 2533.85)
    told = {"force": force_of("ball", 659773.2)}
    told["contact radius a"] = Told(last_pressed("ball"), "length", a)
    told |= pressures("ball", a, values)
    meshes = run(scene, ball, 4e-3, told)
    numbers = beside(meshes, told, FINE)
    hertz = {"force": 586081.0, "contact radius a": 10.0, "p(0)": 2798.33}
    for number in numbers:
        if number.quantity in hertz:
            says(number, Other("Hertz", hertz[number.quantity], approximate=True))
    return meshes.result(*numbers)


def ball_under_a_force() -> Result:
    """Press a ball on a plane by a force, Ansys VM63.

    Radius 8, E = 1000, nu = 0.3, no friction. Half of the ball is pressed by the force
    60 pi on its equator, a plane section that widens freely.
    """
    force = 60 * np.pi
    ball = part_of_disc({"ball": 8.0}, 1.5, {"equator": (0.0, 0.0, 8.0, 0.0)})
    # The contact ends beside the section, whose rim it does not touch.
    ball = ball.named({"foot": lambda x: np.isclose(np.hypot(x[0], x[1]), 8.0) & (x[0] < 5.0)})
    contact = ec.Contact("foot", gap=lambda x: 8.0 - x[1], normal=UP)
    equator = ec.PlaneSection("equator", force=(None, force))
    scene = ec.Scene(turned(1000.0, 0.3), [equator], contacts=[contact])
    radius = np.cbrt(3 * force * 8.0 * (1 - 0.3**2) / 4000)
    probes: dict[str, Probe] = {
        "contact radius": lambda error: float(error.contact_area("foot").radius.value),
        "greatest pressure": pressure_at("foot", 0.0, NEAR * radius),
        "force of the plane": lambda error: float(error.force("foot").force[1]),
    }
    meshes = Meshes(scene, ball, 4e-3, probes)
    touched = meshes.probe("contact radius", "length")
    says(touched, Other("Hertz, half-space", radius, approximate=True))
    says(touched, Other("Ansys VM63, target", 1.010, rounding=5e-4))
    peak = meshes.probe("greatest pressure", "force/area")
    says(peak, Other("Hertz, half-space", 1.5 * force / (np.pi * radius**2), approximate=True))
    carried = meshes.probe("force of the plane", "force")
    return meshes.result(touched, peak, exactly(carried, -force, "balance"))


def balls_between_pads() -> Result:
    """Press two balls between pads, code_aster SSNA102.

    Four bodies on the axis, E = 200 000, nu = 0.3, no friction: a pad r < 20, z from 0
    to 4, whose rim is fixed, balls of radius 10 and 5, and a pad r < 10, 2 high, whose
    top is moved by 2. Gaps are along z at the same r, as fields: where they touch the
    balls have flat ends, 1.3 times as wide as the contact. The published force is
    17 229.58 per radian, in a run of its own 17 496.6.
    """
    radii = {"cap": 1.51012, "small": 1.34726, "large": 2.04963}
    seats = {"cap": "small", "small": "large", "large": "pad"}
    peaks = {"cap": 22649.0, "small": 28487.0, "large": 12265.0}
    of_small, of_large = under_a_ball(5.0), under_a_ball(10.0)
    gaps = {"cap": of_small, "small": lambda x: of_small(x) + of_large(x), "large": of_large}
    domain = drawn_balls({name: 1.3 * radius for name, radius in radii.items()})
    contacts = []
    told = {"force": force_of("foot of large", 109477.2)}
    for body, radius in radii.items():
        foot, seat = f"foot of {body}", f"seat of {body}"
        domain = domain.split({foot: body, seat: seats[body]})
        contacts.append(ec.Contact(foot, against=seat, gap=gaps[body]))
        told |= contact_radius(foot, radius, f"of {body}")
        told |= pressures(foot, radius, [peaks[body]], of=f" of {body}")
    for z, value in {0.0: -0.843426, 14.0: -1.11071, 29.0: -1.62134}.items():
        told[f"u_z at z = {z:g}"] = moved((0.0, z), 1, value)
    supports = [ec.Displacement("rim", (0.0, 0.0)), ec.Displacement("top", (None, -2.0))]
    scene = ec.Scene(turned(200e3, 0.3), supports, contacts=contacts)
    meshes = run(scene, domain, 3e-3, told)
    numbers = beside(meshes, told, FINE)
    says(numbers[0], Other("published", 2 * np.pi * 17229.58, approximate=True))
    return meshes.result(*numbers)


def under_a_ball(radius: float) -> Callable[[Ufl], Ufl]:
    """Return the height of a ball over the plane on which it lies, UFL of x."""
    return lambda x: radius - ufl.sqrt(radius**2 - x[0] ** 2)


def drawn_balls(ends: Mapping[str, float]) -> ec.Domain:
    """Mesh two balls between two pads, with flat ends of these radii."""
    occ = opened(1.0)

    def ball(middle: float, radius: float, feet: Mapping[float, float]) -> Faces:
        body = [(2, occ.addRectangle(0, middle - radius, 0, radius, 2 * radius))]
        body, _ = occ.intersect(body, [(2, occ.addDisk(0, middle, 0, radius, radius))])
        for way, end in feet.items():
            height = 2 * (radius - np.sqrt(radius**2 - end**2))
            low = min(way * radius, way * radius - way * height)
            flat = occ.addRectangle(0, middle + low, 0, end, height)
            body, _ = occ.fuse(body, [(2, flat)])
        return body

    pad = [(2, occ.addRectangle(0, 0, 0, 20, 4))]
    large = ball(14.0, 10.0, {-1.0: ends["large"], 1.0: ends["small"]})
    small = ball(29.0, 5.0, {-1.0: ends["small"], 1.0: ends["cap"]})
    cap = [(2, occ.addRectangle(0, 34, 0, 10, 2))]
    _, pieces = occ.fragment(pad, [*large, *small, *cap])
    occ.synchronize()
    names = ("pad", "large", "small", "cap")
    regions = {}
    for name, faces in zip(names, pieces, strict=True):
        regions[name] = [face for _, face in faces]
    return meshed(regions, {"rim": (20, 0, 20, 4), "top": (0, 36, 10, 36)})


def last_pressed(contact: str) -> Probe:
    """Read the largest radius with a pressure."""

    def read(error: ec.ConstitutiveError) -> float:
        profile = error.profile(contact)
        return float(profile["x"][profile["pressure"] > 0].max())

    return read
