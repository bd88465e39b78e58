"""Stress intensity factors of rings of cracks.

- The given strain does the work K on the exact stress of a penny crack, none on the
  other mode, and on uniform stresses what their tractions on the faces do, whatever
  direction, radius and material are.
- Proved intervals of penny cracks hold the closed forms: remote tension, pressure on
  the faces, pressure that grows with the radius; two degrees.
- A crack round a bar has the factor of Benthem and Koiter.
- A crack of a ring of large radius has the factor of plane strain.
- Ranks agree; a radius that reaches the axis or a bend is refused.
"""

from itertools import pairwise

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scenes import certified

import erc_contact as ec
from erc_contact.base.runtime import compiled
from erc_contact.error.goals.ring_strain import RingStrain, ring_coefficients
from erc_contact.error.goals.singular_strain import INNER_SHARE, cut_off
from erc_contact.error.goals.tip_series import Series, plane_field, ring_fields
from erc_contact.model.data.expressions import Everywhere
from namedmesh.gmsh_session import session

COMM = MPI.COMM_WORLD
E = 1000.0


def given_strain(mode: str, R: float, angle: float, radius: float, nu: float) -> RingStrain:
    c, s = np.cos(angle), np.sin(angle)
    coefficients = ring_coefficients(mode, nu, c, s)
    return RingStrain(mode, 1.0, R, 0.2, c, s, radius, 3 - 4 * nu, coefficients)


def work_on(given: RingStrain, stress) -> float:
    """The integral of stress (rr, rz, zz, hoop) of places (n, 2) and the strain."""
    mesh = ec.rectangle((0, 0), (1, 1), cells=(1, 1)).mesh
    values = {}
    for name in given.parameters:
        values[name] = compiled.constant(mesh, np.array(getattr(given, name)))
    G = Everywhere(given.strain(ufl.SpatialCoordinate(mesh), **values), mesh)
    places, weights = np.polynomial.legendre.leggauss(40)
    share, inner = (places + 1) / 2, INNER_SHARE * given.radius
    # Near the tip the strain is a series of half powers.
    rho = np.append(inner * share**2, inner + (given.radius - inner) * share)
    of_rho = np.append(inner * share * weights, (given.radius - inner) * weights / 2)
    r, theta = (grid.ravel() for grid in np.meshgrid(rho, np.pi * places, indexing="ij"))
    area = np.outer(of_rho * rho, np.pi * weights).ravel()
    turn = np.array([[given.cosine, -given.sine], [given.sine, given.cosine]])
    around = (r * np.array([np.cos(theta), np.sin(theta)])).T @ turn.T
    x = np.array([given.tip_x, given.tip_y]) + around
    strain = G(x[None], np.array([0]))[0]
    entries = strain[:, 0, 0], 2 * strain[:, 0, 1], strain[:, 1, 1], strain[:, 2, 2]
    products = sum(a * b for a, b in zip(stress(x), entries, strict=True))
    return float((2 * np.pi * x[:, 0] * area) @ products)


def penny(x: np.ndarray, a: float, nu: float) -> list[np.ndarray]:
    """Stress rr, rz, zz, hoop of a penny crack z = 0.2, r < a in tension 1 far away.

    Of the potential F with ``2 mu u = (1 - 2 nu) grad F + z grad F_z - (3 - 4 nu) ...``,
    Green and Zerna (1954), and complex distances from the ring.
    """
    r, height = x[:, 0], x[:, 1] - 0.2
    z = abs(height)
    s = z + 1j * a
    R = np.sqrt(r**2 + s**2)
    R = np.where(R.imag < 0, -R, R)
    L = np.log(s + R)
    L_r = r / R / (s + R)
    F_r = -(r**2 * L.imag + z * R.imag - a * R.real) / (2 * r)
    F_zz = L.imag - (a / R).real
    F_rz = z * L_r.imag - (r / R).imag
    F_rzz = L_r.imag + (a * r / R**3).real
    F_zzz = (1 / R).imag + (a * s / R**3).real
    e_r = (1 - 2 * nu) * (-F_zz - F_r / r) + z * (-F_zzz - F_rz / r)
    e_t = ((1 - 2 * nu) * F_r + z * F_rz) / r
    of_volume = -2 * nu * F_zz
    parts = of_volume + e_r, np.sign(height) * z * F_rzz, z * F_zzz - F_zz, of_volume + e_t
    far = (0.0, 0.0, 1.0, 0.0)
    return [2 / np.pi * part + more for part, more in zip(parts, far, strict=True)]


def at_places(series: Series, z: np.ndarray, theta: float) -> np.ndarray:
    terms = series.terms.items()
    return sum(c * z ** (a + b) * np.exp(1j * (a - b) * theta) for (a, b), c in terms)


@pytest.mark.serial
@pytest.mark.parametrize("number", range(4))
def test_work_on_the_stress_of_a_penny_crack(number):
    rng = np.random.default_rng(number)
    a, nu = rng.uniform(0.1, 20), rng.uniform(0.0, 0.49)
    radius = a * rng.uniform(0.05, 0.95)
    opening, sliding = (given_strain(mode, a, 0.0, radius, nu) for mode in ("I", "II"))
    exact = 2 * np.sqrt(a / np.pi)
    assert work_on(opening, lambda x: penny(x, a, nu)) == pytest.approx(exact, rel=1e-9)
    assert abs(work_on(sliding, lambda x: penny(x, a, nu))) < 1e-9 * exact


@pytest.mark.serial
@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("mode", ["I", "II"])
def test_work_on_uniform_stresses(mode, number):
    """Their factor is zero: the work is what tractions do on the faces."""
    rng = np.random.default_rng(number)
    R, nu, angle = rng.uniform(0.5, 3), rng.uniform(0.0, 0.45), rng.uniform(-3, 3)
    radius = R * rng.uniform(0.1, 0.9)
    given = given_strain(mode, R, angle, radius, nu)
    fields = ring_fields(mode, nu, complex(given.cosine, -given.sine))
    places, weights = np.polynomial.legendre.leggauss(40)
    # rho = radius s^2, in two parts of s: eta varies in the outer one.
    cut = np.sqrt(INNER_SHARE)
    s = np.append(cut * (places + 1) / 2, cut + (1 - cut) * (places + 1) / 2)
    of_s = np.append(cut * weights, (1 - cut) * weights) / 2
    rho = radius * s**2
    eta, _, _ = cut_off(np.maximum(rho, INNER_SHARE * radius), radius)
    turned = plane_field(mode, 3 - 4 * nu)
    forward = complex(given.cosine, given.sine)
    radial, axial = rng.normal(size=2)
    faces = 0.0
    for theta, sign in ((np.pi, -1.0), (-np.pi, 1.0)):
        w = at_places(turned, rho / R, theta) * forward
        w_r = w.real + at_places(fields.w[0], rho / R, theta).real
        w_z = w.imag + at_places(fields.w[1], rho / R, theta).real
        t_r, t_z = -sign * given.sine * radial, sign * given.cosine * axial
        density = (t_r * w_r + t_z * w_z) / np.sqrt(R) * (R - given.cosine * rho) * eta
        faces += float((2 * radius * s * of_s) @ density)
    expected = faces / (2 * (1 - nu) * R)

    def uniform(x):
        ones = np.ones(len(x))
        return radial * ones, 0 * ones, axial * ones, radial * ones

    assert work_on(given, uniform) == pytest.approx(expected, abs=1e-9)


def cracked(
    low: tuple, high: tuple, places: list, sizes: tuple, comm: MPI.Comm = COMM
) -> ec.Domain:
    """A rectangle of (r, z) with a crack; sizes of elements, and at the ends of the crack.

    The crack begins at the first place, may bend, and has its tip at the last place.
    """
    line = np.array(places)
    size = 5 * np.linalg.norm(np.subtract(high, low))
    first, last = (way / np.linalg.norm(way) for way in np.diff(line, axis=0)[[0, -1]])
    line = np.vstack([line[0] - size * first, line, line[-1] + size * last])
    # The line goes on through the body, so that the mesh has two regions.
    line = line[np.argsort(line[:, 0])]

    def build(gmsh):
        model, occ = gmsh.model, gmsh.model.occ
        body = occ.addRectangle(*low, 0, *np.subtract(high, low))
        ends = [occ.addPoint(*x, 0) for x in line]
        lines = [(1, occ.addLine(*pair)) for pair in pairwise(ends)]
        _, parts = occ.fragment([(2, body)], lines)
        on_crack = [part for pieces in parts[2:-1] for part in pieces]
        occ.synchronize()
        for _, tag in parts[0]:
            x, y, _ = occ.getCenterOfMass(2, tag)
            above = y > np.interp(x, *line.T)
            model.addPhysicalGroup(2, [tag], name="up" if above else "down")
        model.addPhysicalGroup(1, [tag for _, tag in on_crack], name="crack")
        for name, z in (("top", high[1]), ("bottom", low[1])):
            tags = []
            for _, tag in model.getEntities(1):
                if np.isclose(occ.getCenterOfMass(1, tag)[1], z):
                    tags.append(tag)
            model.addPhysicalGroup(1, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", sizes[0])
        at_ends = model.getBoundary(on_crack, combined=False, oriented=False)
        model.mesh.setSize(at_ends, sizes[1])

    with session(comm, build, "The section") as model:
        whole = ec.from_gmsh(model, comm)
    return whole.split({"upper lip": "up", "lower lip": "down"}, on="crack")


def of_lips(nu: float, pressure: object, hypothesis: str = "axisymmetric") -> ec.Scene:
    """A body that nothing holds, with a pressure on the faces of its crack."""
    loads = [ec.Traction(lip, pressure=pressure) for lip in ("upper lip", "lower lip")]
    return ec.Scene(ec.Elastic(E, nu, hypothesis=hypothesis), loads=loads)


def pulled(nu: float) -> ec.Scene:
    loads = [ec.Traction("top", (0.0, 1.0)), ec.Traction("bottom", (0.0, -1.0))]
    return ec.Scene(ec.Elastic(E, nu, hypothesis="axisymmetric"), loads=loads)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("number", range(4))
def test_penny_cracks(number):
    """In a body 20 times as large the factor is off by 1/20^3, far less than the width."""
    rng = np.random.default_rng(number)
    a, nu = rng.uniform(0.2, 5), rng.uniform(0.0, 0.45)
    degree = 2 - number % 2
    size = 20 * a
    sizes = size / 10, a * rng.uniform(0.03, 0.1)
    domain = cracked((0.0, -size), (size, size), [(0.0, 0.0), (a, 0.0)], sizes)
    scenes = [
        (pulled(nu), 2 * np.sqrt(a / np.pi)),
        (of_lips(nu, 1.0), 2 * np.sqrt(a / np.pi)),
        (of_lips(nu, lambda x: x[0] / a), np.sqrt(np.pi * a) / 2),
    ]
    # The mesh represents a pressure that grows as r does from degree 2 on.
    scene, exact = scenes[(2, 0, 1, 1)[number]]
    goal = ec.StressIntensity((a, 0.0), (1.0, 0.0), radius=a * rng.uniform(0.4, 0.95))
    found = ec.interval(certified(scene, domain, degree=degree), goal)
    assert found.guaranteed
    assert found.low < exact < found.high


def around_a_bar(share: float) -> float:
    """K of a crack round a bar of radius 1 in tension 1, uncracked to a share: Tada, Paris, Irwin.

    Benthem and Koiter's formula, off by 1% at most.
    """
    x = share
    series = 0.5 * (1 + x / 2 + 3 * x**2 / 8 - 0.363 * x**3 + 0.731 * x**4)
    return np.sqrt(np.pi * x * (1 - x)) * series / x**2


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("share", [0.4, 0.7])
def test_crack_around_a_bar(share):
    """The crack points to the axis."""
    domain = cracked((0.0, -3.0), (1.0, 3.0), [(1.0, 0.0), (share, 0.0)], (0.4, 0.02))
    goal = ec.StressIntensity((share, 0.0), (-1.0, 0.0), radius=0.9 * min(share, 1 - share))
    found = ec.interval(certified(pulled(0.3), domain, degree=2), goal)
    exact = around_a_bar(share)
    assert found.guaranteed
    assert found.low < 1.01 * exact
    assert 0.99 * exact < found.high
    assert found.high - found.low < 0.5 * exact


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("mode", ["I", "II"])
def test_large_rings_are_in_plane_strain(mode):
    found = []
    for R, hypothesis in ((0.0, "plane strain"), (1e4, "axisymmetric")):
        low, high, root, tip = ((R + x, y) for x, y in ((-1, -1), (1, 1), (-0.3, -0.2), (0.3, 0.2)))
        domain = cracked(low, high, [root, tip], (0.3, 0.04))
        goal = ec.StressIntensity(tip, (3.0, 2.0), radius=0.5, mode=mode)
        scene = of_lips(0.3, 1.0, hypothesis)
        found.append(ec.interval(certified(scene, domain, degree=2), goal))
    plane, ring = found
    assert plane.guaranteed
    assert ring.guaranteed
    near = 0.1 * (plane.high - plane.low)
    assert ring.low == pytest.approx(plane.low, abs=near)
    assert ring.high == pytest.approx(plane.high, abs=near)


def penny_of(size: float, comm: MPI.Comm = COMM) -> ec.Domain:
    return cracked((0.0, -3.0), (3.0, 3.0), [(0.0, 0.0), (1.0, 0.0)], (1.0, size), comm)


@pytest.mark.ranks
def test_ranks_agree():
    goal = ec.StressIntensity((1.0, 0.0), (1.0, 0.0), radius=0.8)
    found = []
    for comm in (COMM, MPI.COMM_SELF):
        bounds = ec.interval(certified(of_lips(0.3, 1.0), penny_of(0.3, comm)), goal)
        found.append([bounds.low, bounds.high])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


@pytest.mark.serial
def test_a_penny_crack():
    """Between faces that touch nothing; the radius ends at the axis."""
    error = certified(of_lips(0.3, 1.0), penny_of(0.15))
    goal = ec.StressIntensity((1.0, 0.0), (1.0, 0.0), radius=0.9)
    found = ec.interval(error, goal)
    assert found.guaranteed
    # In a body three times as large the factor is greater by 2%.
    assert found.low < 2 / np.sqrt(np.pi) < found.high
    with pytest.raises(ec.InputError, match="or its axis comes as near as 1"):
        ec.interval(error, ec.StressIntensity((1.0, 0.0), (1.0, 0.0), radius=1.1))


@pytest.mark.broad
def test_a_ring_with_a_bend():
    """On a cone, whose crack bends; the radius ends at the bend."""
    places = [(0.3, -0.3), (0.6, 0.0), (1.0, 0.0)]
    domain = cracked((0.0, -2.0), (2.0, 2.0), places, (0.5, 0.1))
    error = certified(of_lips(0.3, 1.0), domain)
    near, far = (ec.StressIntensity((1.0, 0.0), (1.0, 0.01), radius=r) for r in (0.35, 0.5))
    assert ec.interval(error, near).guaranteed
    with pytest.raises(ec.InputError, match=r"as near as 0\.4 .* that bends is straight"):
        ec.interval(error, far)
