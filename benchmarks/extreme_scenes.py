"""Make scenes at the edge of what a contact solver meets.

Units, materials, friction, shapes, meshes, supports and loads are extreme.

Each is small (below 2000 cells) and says whether it has a solution at all.
`benchmarks/extremes.py` runs them.

Existence: with supports that hold the body, the discrete problem of static Coulomb
friction has a solution for any friction coefficient. A body that only contact holds has
one if the loads lie strictly inside what the friction cones can balance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import cos, pi, radians, sin
from typing import Any

import numpy as np

import erc_contact as ec

import basix.ufl  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip

from erc_contact.scene.material import Value

from dolfinx import mesh as dmesh  # isort: skip
from mpi4py import MPI  # isort: skip

Pair = tuple[ec.Scene, ec.Domain]


@dataclass(frozen=True)
class Extreme:
    """Hold a scene of the grid.

    Attributes:
        build: Makes the scene and its domain.
        solvable: The scene has a solution; else it must end in an error of the solver,
            never in a field.
        refusable: Its numbers are beyond double precision: InputError is a right answer
            too.
        parameters: Fields of the contact method that the scene sets; methods without
            them leave it out.
        levels: Uniform refinements of a reference solution for the effectivity; 0 for
            none (serial, 2D only).
        same_as: Name of the scene that this one is in other units or under a multiple
            of its load, so that eps and the Newton steps must be the same.
    """

    build: Callable[[], Pair]
    solvable: bool = True
    refusable: bool = False
    parameters: Mapping[str, float] = field(default_factory=dict)
    levels: int = 0
    same_as: str = ""


# -- domains
# ------------------------------------------------------------------------------------


def mapped(domain: ec.Domain, new: Callable[[np.ndarray], Sequence[Any]]) -> ec.Domain:
    """Move the vertices of a mesh to ``new(x)``, x of shape (d, vertices)."""
    x = domain.mesh.geometry.x
    x[:, : domain.dim] = np.column_stack(new(x[:, : domain.dim].T.copy()))
    return domain


def rotated(domain: ec.Domain, degrees: float) -> ec.Domain:
    c, s = cos(radians(degrees)), sin(radians(degrees))
    return mapped(domain, lambda x: (c * x[0] - s * x[1], s * x[0] + c * x[1]))


def with_part(
    domain: ec.Domain, name: str, of: str, where: Callable[[np.ndarray], Any]
) -> ec.Domain:
    """Give a name of their own to some facets of a boundary part.

    They are those whose middles x, shape (3, n), satisfy ``where``.
    """
    tags = domain.facet_tags
    middle = dmesh.compute_midpoints(domain.mesh, tags.dim, tags.indices).T
    own = (tags.values == domain.names[of]) & where(middle)
    number = max(domain.names.values()) + 1
    new = dmesh.meshtags(
        domain.mesh, tags.dim, tags.indices, np.where(own, number, tags.values).astype(np.int32)
    )
    return ec.Domain(domain.mesh, new, {**domain.names, name: number})


def halved(domain: ec.Domain, axis: int, at: float) -> ec.Domain:
    """Divide the cells of a domain into two regions, low and high."""
    cells = domain.mesh.topology.index_map(domain.dim)
    every = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    high = dmesh.compute_midpoints(domain.mesh, domain.dim, every)[:, axis] > at
    tags = dmesh.meshtags(domain.mesh, domain.dim, every, np.where(high, 2, 1).astype(np.int32))
    return ec.Domain(domain.mesh, domain.facet_tags, domain.names, tags, {"low": 1, "high": 2})


def from_occ(build: Callable[[Any], None]) -> ec.Domain:
    """Make a domain from a model of gmsh in a session of its own."""
    import gmsh  # noqa: PLC0415 - only these scenes need it

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        build(gmsh)
        return ec.from_gmsh(gmsh.model)
    finally:
        gmsh.finalize()


def square(nx: int = 8, ny: int = 8) -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(nx, ny))


def graded_tensor(nx: int, ny: int, least: float) -> ec.Domain:
    """Make the unit square with rows that are graded towards the contact.

    Their heights grow geometrically from ``least`` to 1.
    """
    return mapped(
        square(nx, ny),
        lambda x: (x[0], np.where(x[1] > 0, least ** (1 - (ny * x[1] - 1) / (ny - 1)), 0.0)),
    )


def graded_corner(least: float) -> ec.Domain:
    """Make the unit square with a mesh that is graded towards a corner.

    Triangles have the size ``least`` at a corner of the contact, and about 0.3 far from
    it.
    """

    def build(gmsh: Any) -> None:
        geo = gmsh.model.geo
        corners = [(0, 0, least), (1, 0, 0.3), (1, 1, 0.3), (0, 1, 0.3)]
        points = [geo.addPoint(x, y, 0, size) for x, y, size in corners]
        lines = [geo.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]
        geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()
        for line, name in zip(lines, ("bottom", "right", "top", "left"), strict=True):
            gmsh.model.addPhysicalGroup(1, [line], name=name)

    return from_occ(build)


def cap_row(n: int, angle: float) -> ec.Domain:
    """Make the unit square with flat triangles in the row at the contact.

    Their least angle is ``angle`` degrees.
    """
    height = np.tan(radians(angle))

    def new(x: np.ndarray) -> Sequence[Any]:
        first, inner = np.isclose(x[1], 1 / n), np.minimum(x[0], 1 - x[0]) > 1e-9
        return x[0] - np.where(first & inner, 0.5 / n, 0.0), np.where(first, height / n, x[1])

    return mapped(square(n, n), new)


def half_disc(radius: float, size: float) -> ec.Domain:
    """Make the lower half of a disc with its lowest point in 0, refined there.

    Its parts are top and arc.
    """

    def build(gmsh: Any) -> None:
        occ = gmsh.model.occ
        disc, box = (
            occ.addDisk(0, radius, 0, radius, radius),
            occ.addRectangle(-radius, 0, 0, 2 * radius, radius),
        )
        occ.intersect([(2, disc)], [(2, box)])
        occ.synchronize()
        curves = gmsh.model.getEntities(1)
        top = [tag for d, tag in curves if occ.getCenterOfMass(d, tag)[1] > radius * (1 - 1e-6)]
        gmsh.model.addPhysicalGroup(1, top, name="top")
        gmsh.model.addPhysicalGroup(1, [tag for _, tag in curves if tag not in top], name="arc")
        fields = gmsh.model.mesh.field
        fields.add("MathEval", 1)
        fields.setString(1, "F", f"{size} + 0.25 * sqrt(x * x + y * y)")
        fields.setAsBackgroundMesh(1)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)

    return from_occ(build)


# -- scenes
# ------------------------------------------------------------------------------------


def block(
    push: Sequence[float] = (0.1, -0.05),
    *,
    E: float = 1.0,
    nu: float = 0.3,
    friction: Value = 0.3,
    gap: Value = 0.0,
    size: float = 1.0,
    n: int = 4,
) -> Pair:
    """Make the scene of the 2 x 7 block of several contact codes, in chosen units.

    Its top is displaced, its right side pushed.
    """
    scene = ec.Scene(
        material=ec.Elastic(E, nu),
        supports=[ec.Displacement("top", tuple(size * p for p in push))],
        loads=[ec.Traction("right", (-0.0002 * E, 0.0))],
        contacts=[ec.Contact("bottom", friction=friction, gap=gap)],
    )
    return scene, ec.rectangle((0.0, 0.0), (2 * size, 7 * size), cells=(n, 7 * n // 2))


def pressed(domain: ec.Domain, push: Sequence[float] = (0.02, -0.05), **contact: Any) -> Pair:
    """Make a body with its top displaced, its bottom on a foundation."""
    contacts = [ec.Contact("bottom", **{"friction": 0.3, **contact})]
    return ec.Scene(
        ec.Elastic(1.0, 0.3), [ec.Displacement("top", tuple(push))], contacts=contacts
    ), domain


def layered(domain: ec.Domain, low: float, high: float) -> Pair:
    scene, _ = pressed(domain)
    return ec.Scene(
        ec.Elastic({"low": low, "high": high}, 0.3), scene.supports, contacts=scene.contacts
    ), domain


def greco(*, E: float = 130e3, size: float = 1.0, n: int = 8, friction: float = 1.0) -> Pair:
    """Make the compressed and pushed block (GRECO).

    Only the contact holds it vertically.
    """
    scene = ec.Scene(
        material=ec.Elastic(E, 0.2),
        supports=[ec.Displacement("right", (0.0, None))],
        loads=[ec.Traction("top", pressure=E / 2600), ec.Traction("left", pressure=3 * E / 2600)],
        contacts=[ec.Contact("bottom", friction=friction)],
    )
    return scene, ec.rectangle((0.0, 0.0), (40 * size, 40 * size), cells=(n, n))


def standing(
    push: Sequence[float], domain: ec.Domain | None = None, parts: Any = ("bottom",), **contact: Any
) -> Pair:
    """Make a body with nothing but contact to hold it, under a body force.

    The force is in thousandths of E.
    """
    contacts = [ec.Contact(part, **{"friction": 0.5, **contact}) for part in parts]
    weight = ec.BodyForce(tuple(1e-3 * p for p in push))
    return ec.Scene(ec.Elastic(1.0, 0.3), loads=[weight], contacts=contacts), domain or square()


def wedge(friction: float, weight: float = -1.0) -> Pair:
    """Make a wedge between two planes of slope 1:2 from the vertical.

    Its weight presses it in, or pulls it out.
    """
    domain = mapped(square(), lambda x: ((x[0] - 0.5) * (0.4 + x[1]), x[1]))
    return standing((0.0, weight), domain, ("left", "right"), friction=friction)


def in_a_corner() -> Pair:
    """Make a square pressed into a frictionless corner."""
    loads = [ec.Traction("top", pressure=0.02), ec.Traction("right", pressure=0.01)]
    contacts = [ec.Contact("left"), ec.Contact("bottom")]
    return ec.Scene(ec.Elastic(1.0, 0.3), loads=loads, contacts=contacts), square()


def in_a_channel() -> Pair:
    """Make a square pressed into a channel: three contacts with friction.

    It meets the walls as it expands.
    """
    contacts = [ec.Contact("bottom", friction=0.3)]
    contacts += [ec.Contact(side, friction=0.3, gap=0.002) for side in ("left", "right")]
    return ec.Scene(
        ec.Elastic(1.0, 0.3), loads=[ec.Traction("top", pressure=0.05)], contacts=contacts
    ), square()


def partly_clamped(clamped: Callable[[np.ndarray], Any], n: int = 8) -> Pair:
    """Make a square with a part of its bottom clamped, the rest in contact.

    It is pressed and sheared at its top.
    """
    scene, domain = pressed(with_part(square(n, n), "clamped", "bottom", clamped), (0.02, -0.02))
    supports = [ec.Displacement("clamped", (0.0, 0.0)), *scene.supports]
    return ec.Scene(scene.material, supports, contacts=scene.contacts), domain


def one_facet() -> Pair:
    """Make a square that touches with one facet in the middle of its bottom."""
    domain = with_part(square(9, 9), "foot", "bottom", lambda x: abs(x[0] - 0.5) < 0.05)
    scene, domain = pressed(domain)
    return ec.Scene(
        scene.material, scene.supports, contacts=[ec.Contact("foot", friction=0.3)]
    ), domain


def held_at_the_side() -> Pair:
    """Make a cantilever on a foundation.

    A corner of the contact is fixed by the support.
    """
    supports, loads = [ec.Displacement("left", (0.0, 0.0))], [ec.Traction("top", (0.002, -0.01))]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, loads, [ec.Contact("bottom", friction=0.3)])
    return scene, ec.rectangle((0.0, 0.0), (3.0, 1.0), cells=(18, 6))


def rod_on_its_side() -> Pair:
    """Make a rod 100 : 1 that lies on a foundation.

    It is pressed along its length and pulled at one end.
    """
    supports = [ec.Displacement("left", (0.0, 0.0))]
    loads = [ec.Traction("top", pressure=1e-3), ec.Traction("right", (5e-3, 0.0))]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, loads, [ec.Contact("bottom", friction=0.3)])
    return scene, ec.rectangle((0.0, 0.0), (100.0, 1.0), cells=(200, 2))


def continuum_of_solutions() -> Pair:
    """Make a triangle that slides along a branch of exact solutions.

    Its friction is 2, and each solution has e = 0.
    """
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.4, 0.3]])
    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))
    mesh = dmesh.create_mesh(MPI.COMM_SELF, np.array([[0, 1, 2]]), ufl.Mesh(element), x)
    mesh.topology.create_entities(1)
    mesh.topology.create_connectivity(1, 2)
    middle = dmesh.compute_midpoints(mesh, 1, np.arange(3, dtype=np.int32))
    names = {"bottom": 1, "right": 2, "left": 3}
    values = np.select([middle[:, 1] < 0.1, middle[:, 0] > 0.5], [1, 2], 3).astype(np.int32)
    scene = ec.Scene(
        material=ec.Elastic(1.2, 0.2),
        supports=[ec.Displacement("left", (lambda x: 0.1 + 1.6 / 3 * x[1], lambda x: -0.1 * x[1]))],
        loads=[ec.Traction("right", (0.1 * 5**0.5, 0.0))],
        contacts=[ec.Contact("bottom", friction=2.0)],
    )
    return scene, ec.Domain(
        mesh, dmesh.meshtags(mesh, 1, np.arange(3, dtype=np.int32), values), names
    )


def hertz(push: Sequence[float], friction: float) -> Pair:
    """Make a half disc of radius 1 on a plane."""
    contact = ec.Contact("arc", friction=friction, normal=(0.0, -1.0), gap=lambda x: x[1])
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), [ec.Displacement("top", tuple(push))], contacts=[contact]
    )
    return scene, half_disc(1.0, 0.01)


def on_a_cylinder(x: Any) -> Any:
    return 2.0 - ufl.sqrt(4.0 - (x[0] - 0.5) ** 2)


def on_a_sphere(x: Any) -> Any:
    return 2.0 - ufl.sqrt(4.0 - (x[0] - 0.5) ** 2 - (x[1] - 0.5) ** 2)


def on_a_sine(x: Any) -> Any:
    return 0.01 * (1 - ufl.cos(6 * pi * x[0]))


def cube(n: int = 4) -> ec.Domain:
    return ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(n, n, n))


def tower() -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (1.0, 4.0), cells=(6, 24))


def roller_pulled_off(friction: float) -> Pair:
    """Make a block on a roller that leaves it free to rise, pulled upwards."""
    supports, loads = [ec.Displacement("left", (0.0, None))], [ec.Traction("top", (0.0, 0.01))]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), supports, loads, [ec.Contact("bottom", friction=friction)]
    )
    return scene, square()


def _units() -> dict[str, Extreme]:
    """Make sweeps of Young's modulus and of the size of the body.

    They are of a held body and of one that contact holds.
    """
    scenes = {}
    for what, build in (("block", block), ("GRECO", greco)):
        for k in range(-9, 13, 3):
            scenes[f"{what} E 1e{k:+d}"] = Extreme(
                lambda b=build, v=10.0**k: b(E=v, n=8), same_as=f"{what} E 1e+0"
            )
        for k in range(-6, 4, 3):
            scenes[f"{what} size 1e{k:+d}"] = Extreme(
                lambda b=build, v=10.0**k: b(size=v, n=8), same_as=f"{what} E 1e+0"
            )
    return scenes


def _parameters() -> dict[str, Extreme]:
    """Make scenes of extreme Poisson's ratio, friction, and method parameters."""
    scenes = {}
    for v in (0.0, 0.3, 0.45, 0.49, 0.499, 0.4999):
        for n in (4, 8):
            scenes[f"nu {v:g}, {n} squares across"] = Extreme(lambda v=v, n=n: block(nu=v, n=n))
    for v in (0.0, 0.01, 0.3, 1.0, 2.0, 5.0, 20.0):
        scenes[f"mu {v:g}"] = Extreme(lambda v=v: block(friction=v), levels=3)
        scenes[f"mu {v:g} sheared hard"] = Extreme(
            lambda v=v: pressed(square(), (0.3, -0.05), friction=v)
        )
    scenes["mu from 0 to 2"] = Extreme(lambda: block(friction=lambda x: x[0]))
    for k in range(-2, 7):
        scenes[f"gamma 1e{k:+d}"] = Extreme(lambda: block(n=8), parameters={"gamma": 10.0**k})
    for theta in (-1, 0, 1):
        scenes[f"theta {theta}"] = Extreme(
            lambda: block(n=8), parameters={"theta": theta}, levels=2
        )
        scenes[f"theta {theta} mu 2"] = Extreme(
            lambda: block(n=8, friction=2.0), parameters={"theta": theta}
        )
    return scenes


def _states() -> dict[str, Extreme]:
    """Make scenes whose contacts open, close, slip and tip.

    In some of them only contact holds the body.
    """
    return {
        "opens altogether": Extreme(lambda: block((0.0, 0.05))),
        "closes from a gap": Extreme(lambda: block(gap=0.02), levels=3),
        "gap that stays open": Extreme(lambda: block(gap=0.2)),
        "just touches": Extreme(lambda: block((0.0, -0.02), gap=0.02)),
        "slips everywhere": Extreme(lambda: pressed(square(), (1.0, -0.05)), levels=3),
        "tips onto an edge": Extreme(lambda: pressed(tower(), (1.0, -0.02), friction=1.0)),
        "GRECO 16 x 16": Extreme(lambda: greco(n=16)),
        "GRECO mu 0.3": Extreme(lambda: greco(friction=0.3), levels=3),
        "stands": Extreme(lambda: standing((0.0, -1.0)), levels=3),
        "stands pushed": Extreme(lambda: standing((0.3, -1.0)), levels=3),
        "stands pushed to 98% of the limit": Extreme(lambda: standing((0.49, -1.0))),
        "stands pushed, mu 20": Extreme(lambda: standing((0.3, -1.0), friction=20.0)),
        "stands above a gap": Extreme(lambda: standing((0.3, -1.0), gap=0.01)),
        "tower leans": Extreme(lambda: standing((0.2, -1.0), tower(), friction=1.0)),
        "slope 15 degrees, mu 0.5": Extreme(
            lambda: standing((0.0, -1.0), rotated(square(), 15.0)), levels=3
        ),
        "slope 44 degrees, mu 1": Extreme(
            lambda: standing((0.0, -1.0), rotated(square(24, 24), 44.0), friction=1.0)
        ),
        "body tilted to the foundation": Extreme(
            lambda: pressed(
                square(), normal=(sin(0.05), -cos(0.05)), gap=lambda x: sin(0.05) * (1 - x[0])
            )
        ),
        "wedge mu 0": Extreme(lambda: wedge(0.0), levels=3),
        "wedge mu 0.2, below the slope": Extreme(lambda: wedge(0.2), levels=3),
        "wedge mu 1, above the slope": Extreme(lambda: wedge(1.0)),
        "corner without friction": Extreme(in_a_corner),
        "continuum of solutions": Extreme(continuum_of_solutions),
        "three contacts": Extreme(in_a_channel),
    }


def _meshes() -> dict[str, Extreme]:
    """Make scenes of extreme meshes and shapes.

    Slender bodies, jumps of stiffness, graded meshes, slivers, few facets, curved
    foundations, 3D.
    """
    needle = 1 / np.tan(radians(1.0))
    return {
        "rod 100:1 on its side": Extreme(rod_on_its_side),
        "column 1:100": Extreme(
            lambda: pressed(ec.rectangle((0.0, 0.0), (1.0, 100.0), cells=(2, 200)), (0.5, -0.05))
        ),
        "soft at the contact 1:1e6": Extreme(lambda: layered(halved(square(), 1, 0.5), 1.0, 1e6)),
        "hard at the contact 1e6:1": Extreme(lambda: layered(halved(square(), 1, 0.5), 1e6, 1.0)),
        "soft and hard side by side": Extreme(lambda: layered(halved(square(), 0, 0.5), 1.0, 1e6)),
        "graded 1:1e5 in rows": Extreme(lambda: pressed(graded_tensor(16, 24, 1e-5))),
        "graded 1:1e5 at a corner": Extreme(lambda: pressed(graded_corner(3e-6))),
        "slivers along the contact": Extreme(lambda: pressed(square(4, round(4 * needle)))),
        "slivers across the contact": Extreme(lambda: pressed(square(round(4 * needle), 4))),
        "flat triangles on the contact": Extreme(lambda: pressed(cap_row(12, 1.0))),
        "sheared triangles": Extreme(
            lambda: pressed(mapped(square(12, 12), lambda x: (x[0] + 7 * x[1], x[1])), friction=1.0)
        ),
        "one square": Extreme(lambda: pressed(square(1, 1)), levels=4),
        "one contact facet": Extreme(one_facet),
        "contact next to a clamp": Extreme(lambda: partly_clamped(lambda x: x[0] < 0.5)),
        "one contact facet next to a clamp": Extreme(lambda: partly_clamped(lambda x: x[0] < 0.87)),
        "contact between two clamps": Extreme(
            lambda: partly_clamped(lambda x: abs(x[0] - 0.5) > 0.25)
        ),
        "end of the contact fixed": Extreme(held_at_the_side, levels=2),
        "Hertz": Extreme(lambda: hertz((0.0, -0.02), 0.0)),
        "Hertz mu 0.3, sheared": Extreme(lambda: hertz((0.01, -0.02), 0.3)),
        "cylinder": Extreme(lambda: pressed(square(16, 16), gap=on_a_cylinder), levels=2),
        "cylinder without friction": Extreme(
            lambda: pressed(square(16, 16), gap=on_a_cylinder, friction=0.0)
        ),
        "sine": Extreme(lambda: pressed(square(24, 24), gap=on_a_sine)),
        "3D cube": Extreme(lambda: pressed(cube(), (0.03, 0.01, -0.05))),
        "3D cube mu 2": Extreme(lambda: pressed(cube(), (0.1, 0.04, -0.05), friction=2.0)),
        "3D sphere": Extreme(lambda: pressed(cube(), (0.01, 0.005, -0.05), gap=on_a_sphere)),
        "3D stands": Extreme(lambda: standing((0.0, 0.0, -1.0), cube())),
        "3D stands pushed": Extreme(lambda: standing((0.2, 0.1, -1.0), cube())),
    }


def _loads() -> dict[str, Extreme]:
    """Make scenes of no load, of extreme loads, and of loads that nothing balances."""
    scenes = {"zero load": Extreme(lambda: pressed(square(), (0.0, 0.0)))}
    for k in (-300, -150, -100, -50, 0, 50, 100, 150, 300):
        for what, build, force in (("displacement", pressed, 0.4), ("force", standing, 0.3)):
            scenes[f"{what} 1e{k:+d}"] = Extreme(
                lambda b=build, f=force, v=10.0**k: b(push=(f * v, -v), domain=square()),
                refusable=abs(k) >= 150,  # an energy of 1e-300 is lost in what is added to it
                same_as=f"{what} 1e+0",
            )
    unsolvable: dict[str, Callable[[], Pair]] = {
        "nothing holds it sideways": lambda: standing((0.0, -1.0), friction=0.0),
        "pulled off": lambda: standing((0.0, 1.0)),
        "pulled off and sideways": lambda: standing((0.3, 0.5)),
        "pulled off a roller": lambda: roller_pulled_off(0.0),
        "pulled off a roller, mu 0.5": lambda: roller_pulled_off(0.5),
        "pushed beyond the limit": lambda: standing((0.3, -1.0), friction=0.1),
        "pushed to 102% of the limit": lambda: standing((0.51, -1.0)),
        "pushed beyond the limit above a gap": lambda: standing((0.6, -1.0), gap=0.01),
        "slope 15 degrees, mu 0.2": lambda: standing(
            (0.0, -1.0), rotated(square(), 15.0), friction=0.2
        ),
        "tower tips over": lambda: standing((0.3, -1.0), tower(), friction=1.0),
        "wedge pulled out": lambda: wedge(0.2, 1.0),
        "3D pushed beyond the limit": lambda: standing((0.4, 0.4, -1.0), cube(3)),
        "3D pulled off": lambda: standing((0.1, 0.0, 1.0), cube(3)),
    }
    return scenes | {name: Extreme(build, solvable=False) for name, build in unsolvable.items()}


SCENES: dict[str, Extreme] = _units() | _parameters() | _states() | _meshes() | _loads()
"""The scenes by name."""
