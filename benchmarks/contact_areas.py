"""Attack the ends of contacts with random contacts whose ends are known.

- plane: a half plane under a random punch. ``sqrt(1 - s^2) sum b_n U_n(s)`` presses on
  a polynomial of degree n + 2. The displacements of this closed form are prescribed on
  the other sides of a rectangle, so that its contact is the same.
- rings: a half space under a random punch of revolution, likewise. By disks at complex
  depths its pressure is ``- int_r^1 q'(t)/sqrt(t^2 - r^2) dt``.
- ellipses: Hertz in 3D, likewise, by quadrature of Boussinesq's point forces.
- layers: a layer on a rigid base, from which it lifts off; by Fourier integrals.
- punches: a block on a wider block, whose contact ends with the block.
- imprints: a ball on a plastic layer; its radius is taken from a finer mesh.

On all meshes of adaptive loops: quantiles of the error over the size h of the facet at
the end, share of the errors within their margin, and median of margin over error. In 3D
the error is the error of the area, and h the area of the facets at the border.

    OMP_NUM_THREADS=1 python benchmarks/contact_areas.py [seed] [count] [family ...]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from numpy.polynomial import Chebyshev, Polynomial, legendre  # isort: skip
from reference_drawing import drawn  # isort: skip
from reference_fourier import Layer, receding  # isort: skip

MOST_CELLS = {2: 6000, 3: 20000}
"""Number of cells with which a loop ends, by dimension."""
LEAST_ERROR = 0.015
"""eps with which a loop ends [-]."""
SCALE = 0.01
"""Pressure over Young's modulus, about [-]."""
ROUND_OFF = 1e-9
"""Error of a place that counts as none [length]."""
POINTS = 6001
"""Number of points of a table along a side."""


@dataclass(frozen=True)
class Problem:
    """Hold a scene with one contact, its first mesh, and where the contact ends.

    Attributes:
        scene: The scene.
        domain: The first mesh.
        contact: Name of the contact.
        ends: True x of both ends; None for an end at a plane of symmetry. In 3D ().
        area: True area in 3D.
    """

    scene: ec.Scene
    domain: ec.Domain
    contact: str
    ends: tuple[float | None, ...] = ()
    area: float = 0.0


def along_side(points: np.ndarray, values: Any, axis: int) -> tuple[Any, ...]:
    """Return displacements along a side as tables of one coordinate."""
    tables = [ec.table(points, component) for component in values]
    return tuple(lambda x, table=table: table(x[axis]) for table in tables)


def on_face(grid: Any, values: Any, axes: tuple[int, int]) -> tuple[Any, ...]:
    """Return displacements on a face as tables of two coordinates."""
    tables = [ec.table(grid, component) for component in values]
    return tuple(lambda x, table=table: table(x[axes[0]], x[axes[1]]) for table in tables)


def polynomial(coefficients: Any) -> Callable[[Any], Any]:
    """Return a polynomial that takes UFL."""
    numbers = [float(number) for number in coefficients]

    def value(s: Any) -> Any:
        result = 0.0
        for number in reversed(numbers):
            result = result * s + number
        return result

    return value


def half_plane(
    b: np.ndarray, nu: float, shear: float, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the displacement of a half plane y > 0 under the pressure at |x| < 1.

    With ``w = z - sqrt(z^2 - 1)``, ``f = i sum b_n w^(n+1)`` and F' = f it is

        2 G u_x = -(1 - 2 nu) Re F + y Im f,  2 G u_y = -2 (1 - nu) Im F + y Re f.
    """
    z = x + 1j * (y + 1e-300)
    w = z - np.sqrt(z - 1) * np.sqrt(z + 1)
    f, integral = np.zeros_like(z), np.zeros_like(z)
    for n, factor in enumerate(b):
        f += factor * 1j * w ** (n + 1)
        below = np.log(w) if n == 0 else w**n / n
        integral += factor * 0.5j * (w ** (n + 2) / (n + 2) - below)
    u_x = -(1 - 2 * nu) * integral.real + y * f.imag
    u_y = -2 * (1 - nu) * integral.imag + y * f.real
    return u_x / (2 * shear), u_y / (2 * shear)


def plane(rng: np.random.Generator) -> Problem:
    """Press a half plane on a random punch at |x - shift| < 1."""
    nu = rng.uniform(0.0, 0.45)
    shear = 0.5 / (1 + nu)
    width, height = rng.uniform(1.6, 5.0), rng.uniform(1.5, 6.0)
    b = SCALE * np.append(1.0, rng.uniform(-0.4, 0.4, rng.integers(0, 5)))
    s = np.linspace(-1, 1, 401)
    angle = np.arccos(s[1:-1])
    factor = sum(b_n * np.sin((n + 1) * angle) / np.sin(angle) for n, b_n in enumerate(b))
    punch = Polynomial([0.0])
    for n, b_n in enumerate(b):
        before = Chebyshev.basis(n) / n if n else Chebyshev([0.0])
        along = (Chebyshev.basis(n + 2) / (n + 2) - before).convert(kind=Polynomial)
        punch += (1 - nu) / shear * b_n / 2 * along
    beside = np.append(np.linspace(-width, -1.05, 400), np.linspace(1.05, width, 400))
    left = punch(beside) + half_plane(b, nu, shear, beside, 0 * beside)[1]
    if np.min(factor) < 0.15 * SCALE or left.min() < 1e-4 * SCALE:
        return plane(rng)  # it would be open somewhere, or closed elsewhere
    shift = rng.uniform(-0.3, 0.3)
    x, y = np.linspace(-width, width, POINTS), np.linspace(0.0, height, POINTS)
    top = half_plane(b, nu, shear, x, np.full_like(x, height))
    supports = [ec.Displacement("top", along_side(x + shift, top, 0))]
    for name, place in (("left", -width), ("right", width)):
        at_side = half_plane(b, nu, shear, np.full_like(y, place), y)
        supports.append(ec.Displacement(name, along_side(y, at_side, 1)))
    gap = polynomial(punch.coef)
    contact = ec.Contact("bottom", gap=lambda x: gap(x[0] - shift))
    domain = ec.rectangle(
        (-width + shift, 0.0), (width + shift, height), size=rng.uniform(0.25, 0.6)
    )
    scene = ec.Scene(ec.Elastic(1.0, nu), supports, contacts=[contact])
    return Problem(scene, domain, "bottom", (shift - 1, shift + 1))


def half_space(
    q: np.ndarray, nu: float, shear: float, r: np.ndarray, z: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the displacement of a half space z > 0 under disks of weight q.

    ``2 G u_r = (1 - 2 nu) phi_r + z phi_rz``,
    ``2 G u_z = -2 (1 - nu) phi_z + z phi_zz``, where
    ``phi_z = - int_0^1 q(t) Re 1/R dt`` with ``R^2 = r^2 + (z + i t)^2``.

    Args:
        q: Coefficients of ``q(t) = sum q_k (1 - t^2)^(k+1)``.
        nu: Poisson's ratio.
        shear: Modulus G.
        r: Radii, shape (n,).
        z: Depths, shape (n,).
    """
    t, weights = legendre.leggauss(60)
    t, weights = (t + 1) / 2, weights / 2
    weights = weights * sum(q_k * (1 - t**2) ** (k + 1) for k, q_k in enumerate(q))
    r, z = r[:, None], z[:, None]
    depth = z + 1j * t
    root = np.sqrt(r**2 + depth**2)
    root = np.where(root.real < 0, -root, root)
    radius = np.where(r > 0, r, np.inf)  # on the axis phi_r is zero
    phi_r = -((1 - depth / root).real / radius) @ weights
    phi_z = -(1 / root).real @ weights
    phi_rz, phi_zz = (r / root**3).real @ weights, (depth / root**3).real @ weights
    u_r = (1 - 2 * nu) * phi_r + z[:, 0] * phi_rz
    u_z = -2 * (1 - nu) * phi_z + z[:, 0] * phi_zz
    return u_r / (2 * shear), u_z / (2 * shear)


def rings(rng: np.random.Generator) -> Problem:
    """Press a half space on a random punch of revolution at r < 1."""
    nu = rng.uniform(0.0, 0.45)
    shear = 0.5 / (1 + nu)
    width, height = rng.uniform(1.6, 4.0), rng.uniform(1.5, 5.0)
    q = SCALE * np.append(1.0, rng.uniform(-0.4, 0.6, rng.integers(0, 3)))
    t = np.linspace(0, 1, 200)
    density = sum(q_k * (1 - t**2) ** (k + 1) for k, q_k in enumerate(q))
    # In the contact u_z = (1 - nu)/G int_0^(pi/2) q(r sin a) da, a polynomial of r^2.
    angle, weights = legendre.leggauss(20)
    angle, weights = (angle + 1) * np.pi / 4, weights * np.pi / 4
    inside = (t[:, None] * np.sin(angle)) ** 2
    down = sum(q_k * (1 - inside) ** (k + 1) for k, q_k in enumerate(q)) @ weights
    punch = Polynomial.fit(t**2, -(1 - nu) / shear * down, len(q)).convert()
    beside = np.linspace(1.05, width, 400)
    left = punch(beside**2) + half_space(q, nu, shear, beside, 0 * beside)[1]
    if np.any(np.diff(density) > 0) or left.min() < 1e-4 * SCALE:
        return rings(rng)
    r, z = np.linspace(0.0, width, POINTS), np.linspace(0.0, height, POINTS)
    top = half_space(q, nu, shear, r, np.full_like(r, height))
    side = half_space(q, nu, shear, np.full_like(z, width), z)
    supports = [
        ec.Displacement("top", along_side(r, top, 0)),
        ec.Displacement("right", along_side(z, side, 1)),
    ]
    gap = polynomial(punch.coef)
    contact = ec.Contact("bottom", gap=lambda x: gap(x[0] ** 2))
    domain = ec.rectangle((0.0, 0.0), (width, height), size=rng.uniform(0.25, 0.5))
    material = ec.Elastic(1.0, nu, hypothesis="axisymmetric")
    scene = ec.Scene(material, supports, contacts=[contact])
    return Problem(scene, domain, "bottom", (None, 1.0))


def under_ellipse(b: float, nu: float, shear: float, x: np.ndarray) -> np.ndarray:
    """Compute the displacement of a half space under Hertz' pressure, (3, n).

    Args:
        b: Half axis along y; it is 1 along x.
        nu: Poisson's ratio.
        shear: Modulus G.
        x: Points, shape (n, 3), away from the contact.
    """
    angle, weights = legendre.leggauss(24)
    angle, weights = (angle + 1) * np.pi / 4, weights * np.pi / 4
    around = np.arange(48) * np.pi / 24
    force = np.sin(angle) * np.cos(angle) ** 2 * weights * np.pi / 24 * b * SCALE
    places = np.stack(
        [
            np.outer(np.sin(angle), np.cos(around)).ravel(),
            b * np.outer(np.sin(angle), np.sin(around)).ravel(),
        ]
    )
    strength = np.repeat(force, 48) / (4 * np.pi * shear)
    parts = []
    for chunk in np.array_split(x, 1 + len(x) // 2000):
        d_x, d_y = chunk[:, :2].T[:, :, None] - places[:, None]
        z = chunk[:, 2:]
        distance = np.sqrt(d_x**2 + d_y**2 + z**2)
        outwards = z / distance**3 - (1 - 2 * nu) / (distance * (distance + z))
        down = z**2 / distance**3 + 2 * (1 - nu) / distance
        parts.append(np.stack([outwards * d_x, outwards * d_y, down]) @ strength)
    return np.concatenate(parts, axis=1)


def ellipses(rng: np.random.Generator) -> Problem:
    """Press a half space on a paraboloid; the contact has the half axes 1 and b."""
    nu, b = rng.uniform(0.0, 0.45), rng.uniform(0.4, 1.0)
    shear = 0.5 / (1 + nu)
    low = np.array([-rng.uniform(1.5, 2.5), -b - rng.uniform(0.5, 1.3), 0.0])
    high = np.array([*-low[:2], rng.uniform(1.2, 2.5)])
    middle = np.append(rng.uniform(-0.1, 0.1, 2), 0.0)

    # Integrals over t = tan(angle) of 2/sqrt((1 + t^2) (b^2 + t^2)), and of that over
    # 1 + t^2 and b^2 + t^2.
    angle, weights = legendre.leggauss(100)
    angle, weights = (angle + 1) * np.pi / 4, weights * np.pi / 4
    sine, cosine = np.sin(angle), np.cos(angle)
    density = 2 * weights / np.hypot(b * cosine, sine)
    level, curved_x = density.sum(), density @ cosine**2
    curved_y = density @ (cosine**2 / (b**2 * cosine**2 + sine**2))
    factor = SCALE * b * (1 - nu) / (4 * shear)
    k_x, k_y, down = factor * curved_x, factor * curved_y, factor * level
    supports = []
    faces = {"top": (2, high), "left": (0, low), "right": (0, high)}
    faces |= {"front": (1, low), "back": (1, high)}
    for name, (axis, corner) in faces.items():
        i, j = (other for other in range(3) if other != axis)
        grid = (np.linspace(low[i], high[i], 50), np.linspace(low[j], high[j], 50))
        points = np.empty((50, 50, 3))
        points[..., i], points[..., j] = np.meshgrid(*grid, indexing="ij")
        points[..., axis] = corner[axis]
        u = under_ellipse(b, nu, shear, points.reshape(-1, 3) - middle)
        supports.append(ec.Displacement(name, on_face(grid, u.reshape(3, 50, 50), (i, j))))
    x_0, y_0 = float(middle[0]), float(middle[1])
    contact = ec.Contact(
        "bottom", gap=lambda x: k_x * (x[0] - x_0) ** 2 + k_y * (x[1] - y_0) ** 2 - down
    )
    domain = ec.box(tuple(low), tuple(high), size=rng.uniform(0.35, 0.6))
    scene = ec.Scene(ec.Elastic(1.0, nu), supports, contacts=[contact])
    return Problem(scene, domain, "bottom", area=np.pi * b)


def layers(rng: np.random.Generator) -> Problem:
    """Press half of a layer on a rigid base, from which its ends lift off."""
    nu, thick = rng.uniform(0.0, 0.45), rng.uniform(0.7, 1.5)
    # Wider loads have several roots in reach of the secant method.
    loaded = thick * rng.uniform(0.4, 0.75)
    # The waves of the integrals are those that a thickness of 10 needs.
    true = receding(Layer(10.0, 1.0, nu), None, 10.0 * loaded / thick).half_width * thick / 10
    parts = {
        "middle": (0, 0, 0, thick),
        "pad": (0, thick, loaded, thick),
        "foot": (0, 0, 10, 0),
    }
    point = [(loaded, thick)]
    domain = drawn([("layer", 0.0, 0.0, 10.0, thick)], parts, rng.uniform(0.3, 0.6), point)
    scene = ec.Scene(
        ec.Elastic(1.0, nu),
        [ec.Displacement("middle", (0.0, None))],
        [ec.Traction("pad", pressure=SCALE)],
        [ec.Contact("foot")],
    )
    return Problem(scene, domain, "foot", (None, true))


def punches(rng: np.random.Generator) -> Problem:
    """Press a block on a wider block, with friction or without."""
    half, wide = rng.uniform(0.5, 1.5), rng.uniform(2.5, 4.0)
    high, deep = rng.uniform(0.5, 1.5), rng.uniform(1.0, 3.0)
    bricks = [("upper", -half, 0.0, 2 * half, high), ("lower", -wide, -deep, 2 * wide, deep)]
    parts = {"top": (-half, high, half, high), "base": (-wide, -deep, wide, -deep)}
    domain = drawn(bricks, parts, rng.uniform(0.3, 0.6)).split({"foot": "upper", "seat": "lower"})
    scene = ec.Scene(
        ec.Elastic({"upper": rng.uniform(1.0, 10.0), "lower": 1.0}, 0.3),
        [ec.Displacement("top", (0.0, -SCALE)), ec.Displacement("base", (0.0, 0.0))],
        contacts=[ec.Contact("foot", friction=0.3 * int(rng.integers(2)), against="seat")],
    )
    return Problem(scene, domain, "foot", (-half, half))


def imprints(rng: np.random.Generator) -> Problem:
    """Press a ball into a plastic layer."""
    radius, depth = rng.uniform(10.0, 20.0), rng.uniform(0.01, 0.03)
    strength = rng.uniform(0.001, 0.003)
    hardening = rng.uniform(0.01, 0.1)
    layer = ec.Plastic(1.0, 0.3, strength, hardening=hardening, hypothesis="axisymmetric")
    scene = ec.Scene(
        layer,
        [ec.Displacement("top", (0.0, -depth))],
        contacts=[ec.Contact("bottom", gap=lambda x: x[0] ** 2 / (2 * radius))],
    )
    domain = ec.rectangle((0.0, 0.0), (3.0, 1.5), size=rng.uniform(0.25, 0.4))
    fine = domain
    for _ in range(7):
        error = ec.constitutive_error(ec.equilibrate(ec.solve(scene, fine, degree=2)))
        fine = fine.refined(ec.mark(error))
    true = error.contact_area("bottom").radius.value
    return Problem(scene, domain, "bottom", (None, true))


def compared(problem: Problem, error: ec.ConstitutiveError) -> Iterator[tuple[float, ...]]:
    """Yield error, margin and h of each number of a mesh."""
    found = error.contact_area(problem.contact)
    profile = error.profile(problem.contact)
    q = {(2, 1): 2, (2, 2): 5, (3, 1): 3, (3, 2): 15}[error.domain.dim, error.degree]
    if not problem.ends:
        facets = profile["weight"].reshape(-1, q).sum(axis=1)
        closed = profile["status"].reshape(-1, q)[:, 0] != ec.results.OPEN
        # A border of length 2 sqrt(pi A), as wide as a facet is.
        size = 2 * np.sqrt(np.pi * problem.area * facets[closed].mean())
        yield found.area.value - problem.area, found.area.margin, size
        return
    sizes = np.ptp(profile["x"].reshape(-1, q), axis=1)
    middles = profile["x"].reshape(-1, q).mean(axis=1)
    if len(found.strips) != 1:
        yield 1.0, 0.0, 1.0  # it is one, and two are wrong
        return
    (strip,) = found.strips
    for true, end, margin in zip(problem.ends, strip.ends, strip.margins, strict=True):
        if true is not None:
            h = sizes[abs(middles - true).argmin()]
            yield end[0] - true, margin, h


FAMILIES = {f.__name__: f for f in (plane, rings, ellipses, layers, punches, imprints)}
PER_FAMILY = {"ellipses": 0.1, "imprints": 0.2, "layers": 0.5, "punches": 0.3}
"""Number of scenes of a family over the count [-]."""


def attack(family: str, degree: int, rng: np.random.Generator) -> list[tuple[float, ...]]:
    """Return error, margin and h of the contact of a random scene, on all meshes."""
    problem = FAMILIES[family](rng)
    domain = problem.domain
    rows: list[tuple[float, ...]] = []
    while True:
        solution = ec.solve(problem.scene, domain, degree=degree)
        error = ec.constitutive_error(ec.equilibrate(solution))
        if error.relative < 0.3:
            rows += compared(problem, error)
        if error.relative < LEAST_ERROR or domain.cells > MOST_CELLS[domain.dim] / degree:
            return rows
        if family == "imprints" and domain.cells > 500:
            return rows
        domain = domain.refined(ec.mark(error))


def row(found: list[tuple[float, ...]]) -> tuple[str, np.ndarray]:
    """Return the numbers of a row of the table, and which errors are within margins."""
    errors, margins, sizes = np.abs(np.array(found)).T
    holds = errors <= margins + ROUND_OFF
    quantiles = " | ".join(f"{x:.3f}" for x in np.quantile(errors / sizes, (0.5, 0.9, 0.99)))
    known = errors > ROUND_OFF
    ratio = f"{np.median(margins[known] / errors[known]):.1f}" if known.any() else "exact"
    return f"{len(holds)} | {quantiles} | {holds.mean():.1%} | {ratio}", holds


def main(seed: int, count: int, families: list[str]) -> None:
    """Print a table of families."""
    every = []
    on_root = MPI.COMM_WORLD.rank == 0
    if on_root:
        print("| contacts | degree | numbers | error/h: 50% | 90% | 99% | within | +-/error |")
        print("|---|---|---|---|---|---|---|---|")
    for family in families:
        rng = np.random.default_rng([seed, *family.encode()])
        number = max(1, round(PER_FAMILY.get(family, 1.0) * count / 2))
        for degree in (1, 2):
            found = [entry for _ in range(number) for entry in attack(family, degree, rng)]
            numbers, holds = row(found)
            every.append(holds)
            if on_root:
                print(f"| {family} | {degree} | {numbers} |", flush=True)
    if on_root:
        all_holds = np.concatenate(every)
        print(f"\nwithin the margin: {all_holds.sum()} of {len(all_holds)}")


if __name__ == "__main__":
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    main(seed, count, sys.argv[3:] or list(FAMILIES))
