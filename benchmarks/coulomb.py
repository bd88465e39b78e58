"""Compare what is proved with Coulomb friction with the truth.

These are the numbers of docs/coulomb.md.

    python benchmarks/coulomb.py [triangles] [bounds] [random] [meshes] [cost]

- triangles: M, and what is claimed and found below, at and above the friction where
  solutions are many;
- bounds: the bound over e and over the true error (nested references) and the third
  term of the old bound;
- random: the same for random scenes, with the number of bounds that the truth exceeds;
- meshes: q under refinement;
- cost: processor time over the time of one linear solve.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from time import process_time
from typing import Any

import erc_contact as ec

import gmsh  # isort: skip
import numpy as np
import ufl
from true_errors import reference, true_errors

from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.linear.stiffness import Stiffness


def greco(friction: Any) -> ec.Scene:
    """Make the compressed and pushed block: N, mm."""
    return ec.Scene(
        ec.Elastic(E=130e3, nu=0.2),
        [ec.Displacement("right", (0.0, None))],
        [ec.Traction("top", pressure=50.0), ec.Traction("left", pressure=150.0)],
        [ec.Contact("bottom", friction=friction)],
    )


def pressed(friction: Any, push: tuple[float, ...] = (0.02, -0.05), **options: Any) -> ec.Scene:
    """Make a body that is pressed on its foundation at its top and sheared."""
    return ec.Scene(
        options.get("material", ec.Elastic(1.0, 0.3)),
        [ec.Displacement("top", push)],
        [],
        [ec.Contact("bottom", friction=friction, gap=options.get("gap", 0.0))],
    )


def square(n: int, x: float = 40.0, y: float = 40.0) -> ec.Domain:
    """Make a rectangle with n squares on its height."""
    return ec.rectangle((0.0, 0.0), (x, y), cells=(round(n * x / y), n))


def triangle(nu: float, friction: float, size: float) -> tuple[ec.Scene, ec.Domain]:
    """Make the triangle whose solutions are many at ``friction = 1``.

    Friction is in units of the critical friction.

    Source: P. Hild, Q. J. Mech. Appl. Math. 57 (2004).
    """
    E, ratio = 1.2, 2 * nu / (1 - 2 * nu)
    G, slope = E / 2 / (1 + nu), float(np.sqrt(ratio * (ratio + 2)))
    y = slope / (ratio + 1) / (ratio + 2)
    shear = 0.1 * slope / ratio * (ratio + 2)
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    geo = gmsh.model.geo
    points = [geo.addPoint(*x, 0.0, size) for x in ((0.0, 0.0), (1.0, 0.0), (slope * y, y))]
    sides = [geo.addLine(points[i], points[(i + 1) % 3]) for i in range(3)]
    surface = geo.addPlaneSurface([geo.addCurveLoop(sides)])
    geo.synchronize()
    for side, name in zip(sides, ("foot", "pulled", "held"), strict=True):
        gmsh.model.addPhysicalGroup(1, [side], name=name)
    gmsh.model.addPhysicalGroup(2, [surface], name="body")
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    sigma = G * np.array([[-0.1 * ratio, shear], [shear, -0.1 * (ratio + 2)]])
    force = sigma @ np.array([slope, ratio + 2]) / np.hypot(slope, ratio + 2)
    scene = ec.Scene(
        ec.Elastic(E, nu),
        [ec.Displacement("held", (lambda x: 0.1 + shear * x[1], lambda x: -0.1 * x[1]))],
        [ec.Traction("pulled", (float(force[0]), float(force[1])))],
        [ec.Contact("foot", friction=friction * slope / ratio)],
    )
    return scene, domain


def certified(
    scene: ec.Scene, domain: ec.Domain, **options: Any
) -> tuple[ec.ConstitutiveError, ec.CoulombCertificate]:
    """Compute error and certificate of a scene on a mesh."""
    error = ec.constitutive_error(ec.equilibrate(ec.solve(scene, domain, **options)))
    return error, ec.coulomb_certificate(error)


def triangles() -> None:
    """Print M, claims and other solutions on both triangles."""
    print(
        "| nu | size | mu / critical | M | q | unique | eps | eps of other solutions |\n|"
        + "---|" * 8
    )
    for nu in (0.2, 0.3):
        for size, share in (
            (0.2, 0.5),
            (0.1, 0.5),
            (0.05, 0.5),
            (0.02, 0.5),
            (0.02, 0.65),
            (0.02, 0.99),
            (0.05, 1.0),
        ):
            error, found = certified(*triangle(nu, share, size))
            others = ", ".join(f"{one.relative:.0e}" for one in ec.other_solutions(error.solution))
            print(
                f"| {nu} | {size} | {share} | {found.M:.4f} +- {found.M_change:.4f} "
                f"| {found.q:.3f} | {found.unique} "
                f"| {error.relative:.0e} | {others or 'none found'} |",
                flush=True,
            )


def row(name: str, scene: ec.Scene, domain: ec.Domain, levels: int, **options: Any) -> bool | None:
    """Print a line of the table of bounds.

    Returns whether the truth is below the bound, None if none is claimed.
    """
    error, found = certified(scene, domain, **options)
    true = true_errors(error.admissible, reference(error.solution, levels, **_solver(options)))
    e = error.absolute
    limit = 1 / np.sqrt(1 - found.q) if found.q < 1 else np.inf
    print(
        f"| {name} | {domain.cells} | {found.q:.3f} +- {found.q_change:.3f} "
        f"| {found.misaligned / e:.3f} "
        f"| {found.unbalanced / e:.3f} | {found.factor:.3f} | {found.factor / limit:.3f} "
        f"| {found.bound / true.of_both:.3f} | {true.friction / e**2:.1e} |",
        flush=True,
    )
    return None if found.bound == np.inf else bool(true.of_both <= found.bound)


def _solver(options: dict[str, Any]) -> dict[str, Any]:
    return {"solver": options["solver"]} if "solver" in options else {}


TABLE = (
    "| scene | cells | q | A/e | B/e | bound/e | bound/e sqrt(1 - q) "
    "| bound/true | third term/e^2 |\n|" + "---|" * 9
)


def bounds() -> None:
    """Print the bounds of ten scenes and more.

    References are four times finer than the cut mesh, two times in 3D.
    """
    print(TABLE)
    for mu in (0.1, 0.3, 0.6, 0.8):
        for n in (8, 16):
            row(f"GRECO {mu}", greco(mu), square(n), 3)
    row("GRECO 0.3, degree 2", greco(0.3), square(8), 2, degree=2)
    row("GRECO 0.6, degree 2", greco(0.6), square(8), 2, degree=2)
    for mu in (0.1, 0.3, 0.6):
        row(f"block 2 x 1, {mu}", pressed(mu), square(8, 2.0, 1.0), 3)
    row("flat punch 0.4", pressed(0.4, (0.0, -0.05)), square(8, 2.0, 1.0), 3)
    row("opens, 0.3", pressed(0.3, gap=lambda x: 0.03 * (x[0] - 0.4) ** 2), square(8, 1.0, 1.0), 3)
    row("friction 0.1 + 0.3 x", pressed(lambda x: 0.1 + 0.3 * x[0]), square(8, 1.0, 1.0), 3)
    stiff = ec.Elastic(E=lambda x: ufl.conditional(ufl.gt(x[1], 0.5), 10.0, 1.0), nu=0.3)
    row("two materials 0.3", pressed(0.3, material=stiff), square(8, 1.0, 1.0), 3)
    cube = ec.box((0.0,) * 3, (1.0,) * 3, cells=(4, 4, 4))
    row("cube 0.3", pressed(0.3, (0.02, 0.01, -0.05)), cube, 1)
    row("block 2 x 7, 0.3", pressed(0.3), square(28, 2.0, 7.0), 2)


def scenes(count: int) -> Iterator[tuple[str, ec.Scene, ec.Domain]]:
    """Make random blocks in the plane: size, load, friction, gap, materials.

    Some are open, some slip both ways.
    """
    rng = np.random.default_rng(15)
    for number in range(count):
        nu, mu = float(rng.uniform(0.0, 0.4)), float(rng.uniform(0.05, 0.7))
        size = float(10 ** rng.uniform(-3, 3))
        steep = float(rng.uniform(0.0, 0.5))
        push, press, tilt = (
            float(v) * size for v in rng.uniform((-0.05, 0.01, -0.03), (0.05, 0.08, 0.03))
        )
        wide, curve = float(rng.uniform(0.7, 3.0)) * size, float(rng.uniform(0.0, 0.04)) / size
        friction, gap, top = _fields(number, mu, steep / wide, curve, wide, press, tilt)
        scene = ec.Scene(
            ec.Elastic(E=float(10 ** rng.uniform(-3, 11)), nu=nu),
            [ec.Displacement("top", (push, top))],
            [],
            [ec.Contact("bottom", friction=friction, gap=gap)],
        )
        yield f"{number}", scene, square(4, wide, size)


def _fields(
    number: int, mu: float, steep: float, curve: float, wide: float, press: float, tilt: float
) -> tuple[Any, Any, Any]:
    """Make friction, gap and the vertical displacement of the top.

    They vary in some of the scenes.
    """

    def friction(x: Any) -> Any:
        return mu * (1 + steep * x[0])

    def gap(x: Any) -> Any:
        return curve * (x[0] - wide / 2) ** 2

    def top(x: Any) -> Any:
        return tilt / wide * x[0] - press

    return (mu if number % 2 else friction), (0.0 if number % 3 else gap), top


def random_scenes(count: int = 60) -> None:
    """Print the table of bounds of random scenes, and how many the truth exceeds."""
    print(TABLE)
    held = [row(name, scene, domain, 3) for name, scene, domain in scenes(count)]
    print(
        f"{count} scenes: {held.count(True)} bounds above the truth, "
        f"{held.count(False)} below, the rest not claimed"
    )


def meshes() -> None:
    """Print M on uniform meshes, each of half the size."""
    print("| scene | M |\n|---|---|")
    for name, scene, shape, start, degree in (
        ("GRECO 0.3", greco(0.3), (40.0, 40.0), 4, 1),
        ("GRECO 0.3, degree 2", greco(0.3), (40.0, 40.0), 4, 2),
        ("block 2 x 1, 0.3", pressed(0.3), (2.0, 1.0), 4, 1),
        ("block 2 x 7, 0.3", pressed(0.3), (2.0, 7.0), 14, 1),
    ):
        found = [certified(scene, square(start * 2**k, *shape), degree=degree)[1] for k in range(5)]
        print(
            f"| {name} | {', '.join(f'{one.M:.3f} +- {one.M_change:.3f}' for one in found)} |",
            flush=True,
        )


def cost() -> None:
    """Print processor time of the certificate over the time of one linear solve.

    Both include the set-up.
    """
    print(
        "| scene | cells | one linear solve, s | certificate | contact solve |\n"
        "|---|---|---|---|---|"
    )
    cube, push = ec.box((0.0,) * 3, (1.0,) * 3, cells=(26, 26, 26)), (0.02, 0.01, -0.05)
    for name, scene, domain, degree in (
        ("plane", greco(0.3), ec.rectangle((0.0, 0.0), (40.0, 40.0), size=0.5), 1),
        ("plane", greco(0.3), ec.rectangle((0.0, 0.0), (40.0, 40.0), size=0.25), 1),
        ("plane", greco(0.3), ec.rectangle((0.0, 0.0), (40.0, 40.0), size=0.15), 1),
        ("plane, degree 2", greco(0.3), ec.rectangle((0.0, 0.0), (40.0, 40.0), size=0.5), 2),
        ("space", pressed(0.3, push), cube, 1),
    ):
        t = [process_time()]
        solution = ec.solve(scene, domain, degree=degree)
        t.append(process_time())
        error = ec.constitutive_error(ec.equilibrate(solution))
        t.append(process_time())
        elastic = (Multigrid if solution.stiffness.iterative else Stiffness)(solution.model)
        elastic.solve(elastic.load_vector())
        t.append(process_time())
        ec.coulomb_certificate(error)
        t.append(process_time())
        contact, _, unit, own = np.diff(t)
        print(
            f"| {name} | {domain.cells} | {unit:.2f} | {own / unit:.2f} | {contact / unit:.2f} |",
            flush=True,
        )


PARTS = {
    "triangles": triangles,
    "bounds": bounds,
    "random": random_scenes,
    "meshes": meshes,
    "cost": cost,
}

if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        print(f"\n{part}\n")
        PARTS[part]()
