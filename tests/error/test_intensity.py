"""Stress intensity factors as goals: a given strain at the tip of a crack.

- The strain does the work 1 on the stress of its mode, and none on the other mode and
  on uniform stresses, whatever tip, direction, radius and material are.
- Proved intervals of an edge crack hold the value of tables; so they do in plane
  stress, and intervals of different radii and meshes meet.
- A pressure on the faces has the factor of the same tension far away.
- A closed crack in shear: K_II as the closed form without friction, proved, and with
  friction, estimated.
- Runs reach the accuracy that is asked of the factor; ranks agree.
- What has no factor is refused in words.
"""

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scenes import certified
from test_cracks import LEAN, cracked, plate

import erc_contact as ec
from erc_contact.base.runtime import compiled
from erc_contact.error.goals.singular_strain import INNER_SHARE, SingularStrain
from erc_contact.model.data.expressions import Everywhere
from namedmesh.gmsh_session import session

COMM = MPI.COMM_WORLD
E, NU = 1000.0, 0.3
A = 0.5
TIP = (A, 0.0)
OF_TABLES = 2.8246 * np.sqrt(np.pi * A)
"""K_I of an edge crack over half of a long strip of width 1 in tension 1: Kaya and Erdogan (1987)."""


def singular(mode: str, r: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Stresses (xx, xy, yy) of a mode with the factor 1, of textbooks."""
    size = 1 / np.sqrt(2 * np.pi * r)
    s, c = np.sin(theta / 2), np.cos(theta / 2)
    s_3, c_3 = np.sin(1.5 * theta), np.cos(1.5 * theta)
    if mode == "I":
        return size * np.array([c * (1 - s * s_3), s * c * c_3, c * (1 + s * s_3)])
    return size * np.array([-s * (2 + c * c_3), c * (1 - s * s_3), s * c * c_3])


@pytest.mark.serial
@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("mode", ["I", "II"])
def test_work_on_singular_stresses(mode, number):
    rng = np.random.default_rng(number)
    angle, radius, kappa = rng.uniform(-3, 3), rng.uniform(0.01, 50), rng.uniform(1.0, 3.0)
    tip = rng.uniform(-2, 2, 2)
    c, s = np.cos(angle), np.sin(angle)
    given = SingularStrain(mode, 1.0, *tip, c, s, radius, kappa)
    mesh = ec.rectangle((0, 0), (1, 1), cells=(1, 1)).mesh
    values = {name: compiled.constant(mesh, getattr(given, name)) for name in given.parameters}
    G = Everywhere(given.strain(ufl.SpatialCoordinate(mesh), **values), mesh)
    points, weights = np.polynomial.legendre.leggauss(20)
    rays = radius * (INNER_SHARE + (1 - INNER_SHARE) * (points + 1) / 2)
    r, theta = (grid.ravel() for grid in np.meshgrid(rays, np.pi * points, indexing="ij"))
    area = np.outer(rays * weights * radius * (1 - INNER_SHARE) / 2, np.pi * weights).ravel()
    turn = np.array([[c, -s], [s, c]])
    x = tip + (r * np.array([np.cos(theta), np.sin(theta)])).T @ turn.T
    local = turn.T @ G(x[None], np.array([0]))[0] @ turn
    entries = np.stack([local[:, 0, 0], 2 * local[:, 0, 1], local[:, 1, 1]])
    work = {name: area @ (entries * singular(name, r, theta)).sum(axis=0) for name in ("I", "II")}
    # A stress along the faces leaves them free.
    work["uniform"] = area @ entries[0] / np.sqrt(2 * np.pi * radius)
    expected = {"I": 0.0, "II": 0.0, "uniform": 0.0, mode: 1.0}
    assert work == pytest.approx(expected, abs=1e-9)


def strip(size: float, height: float = 3.0, comm: MPI.Comm = COMM) -> ec.Domain:
    """A strip of width 1 with an edge crack in the middle of its height."""

    def build(gmsh):
        model, occ = gmsh.model, gmsh.model.occ
        body = occ.addRectangle(0, -height, 0, 1, 2 * height)
        ends = [occ.addPoint(x, 0, 0) for x in (0, A, 1)]
        lines = [occ.addLine(*ends[i : i + 2]) for i in range(2)]
        _, parts = occ.fragment([(2, body)], [(1, line) for line in lines])
        occ.synchronize()
        for _, tag in parts[0]:
            above = occ.getCenterOfMass(2, tag)[1] > 0
            model.addPhysicalGroup(2, [tag], name="up" if above else "down")
        model.addPhysicalGroup(1, [tag for _, tag in parts[1]], name="crack")
        for name, y in (("top", height), ("bottom", -height)):
            tags = []
            for _, tag in model.getEntities(1):
                if np.isclose(occ.getCenterOfMass(1, tag)[1], y):
                    tags.append(tag)
            model.addPhysicalGroup(1, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)

    with session(comm, build, "The strip") as model:
        whole = ec.from_gmsh(model, comm)
    return whole.split({"upper lip": "up", "lower lip": "down"}, on="crack")


def pulled(
    hypothesis: str = "plane strain", contacts: tuple = (), pressure: float = 0.0
) -> ec.Scene:
    """The strip in tension 1, or with a pressure on the faces of its crack."""
    loads = [ec.Traction("top", (0.0, 1.0))]
    if pressure:
        loads = [ec.Traction(lip, pressure=pressure) for lip in ("upper lip", "lower lip")]
    held = [ec.Displacement("bottom", (0.0, 0.0))]
    return ec.Scene(ec.Elastic(E, NU, hypothesis=hypothesis), held, loads, contacts)


def factor(radius: float, mode: str = "I") -> ec.StressIntensity:
    return ec.StressIntensity(TIP, (1.0, 0.0), radius=radius, mode=mode)


@pytest.mark.broad
@pytest.mark.serial
def test_edge_crack():
    history = ec.adapt(pulled(), strip(0.5), accuracy=0.007, degree=2)
    found = ec.interval(history, factor(0.4))
    assert found.guaranteed
    assert found.low < OF_TABLES < found.high
    assert found.value == pytest.approx(OF_TABLES, rel=1e-3)
    assert found.high - found.low < 2e-3 * found.value


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_intervals_meet(degree):
    """Plane stress, a contact that stays open, two radii, two meshes: one number."""
    crack = ec.Contact("upper lip", against="lower lip", friction=0.3)
    found = []
    for contacts, size, radius in (((), 0.5, 0.45), ((), 0.35, 0.3), ((crack,), 0.5, 0.45)):
        error = certified(pulled("plane stress", contacts), strip(size), degree=degree)
        found.append(ec.interval(error, factor(radius)))
        assert found[-1].guaranteed or contacts
    assert max(bounds.low for bounds in found) < min(bounds.high for bounds in found)
    assert all(bounds.low < OF_TABLES < bounds.high for bounds in found)


@pytest.mark.broad
@pytest.mark.serial
def test_pressure_on_the_faces():
    """Tension far away and a pressure on the faces differ by a uniform stress."""
    domain = strip(0.5, height=3.0)
    far, near = (certified(pulled(pressure=p), domain, degree=2) for p in (0.0, 1.0))
    of_far, of_near = (ec.interval(error, factor(0.3)) for error in (far, near))
    assert of_near.guaranteed
    assert max(of_far.low, of_near.low) < min(of_far.high, of_near.high)
    assert of_near.value == pytest.approx(of_far.value, rel=1e-2)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(("friction", "off"), [(0.0, 2e-3), (0.3, 2e-2)])
def test_closed_crack(friction, off):
    """In a large plate K_II is the shear beyond friction times the root of pi a."""
    domain = plate(40.0, 8.0, 0.15)
    history = ec.adapt(cracked(friction), domain, accuracy=1e-3, degree=2)
    c, s = np.cos(LEAN), np.sin(LEAN)
    found = ec.interval(history, ec.StressIntensity((c, s), (c, s), radius=0.8, mode="II"))
    exact = s * (c - friction * s) * np.sqrt(np.pi)
    assert abs(found.value) == pytest.approx(exact, rel=off)
    assert found.guaranteed == (friction == 0.0)
    if found.guaranteed:
        assert found.low < np.sign(found.value) * exact < found.high


@pytest.mark.broad
@pytest.mark.serial
def test_runs_reach_their_accuracy():
    history = ec.adapt(pulled(), strip(0.5), accuracy=0.05, degree=2, goal=factor(0.4))
    assert history.reached
    found = ec.interval(history, factor(0.4))
    assert found.low < OF_TABLES < found.high


def loose() -> ec.Scene:
    """The strip between two tensions, which nothing holds."""
    ends = [ec.Traction("top", (0.0, 1.0)), ec.Traction("bottom", (0.0, -1.0))]
    return ec.Scene(ec.Elastic(E, NU), loads=ends)


@pytest.mark.broad
@pytest.mark.serial
def test_a_strip_that_nothing_holds():
    """Rigid motions change no factor: psi of them is round-off of a sum over the mesh."""
    history = ec.adapt(loose(), strip(0.3), accuracy=0.05, degree=2, goal=factor(0.4))
    assert history.reached, history.outcome
    assert history.bounds.guaranteed
    assert history.bounds.low < OF_TABLES < history.bounds.high


@pytest.mark.broad
@pytest.mark.serial
def test_what_integrals_leave_unknown_is_no_motion():
    """A load in balance that jumps inside cells, whose integral is known to 1e-4."""
    up = 0.037

    def balanced(x):
        return (0.0, ufl.conditional(ufl.gt(x[1], up), 1.0, -(3 - up) / (3 + up)))

    error = certified(loose(), strip(0.3))
    found = ec.interval(error, ec.Functional(ec.BodyForce(balanced)))
    assert found.low < found.value < found.high
    with pytest.raises(ec.InputError, match="change the number"):
        ec.interval(error, ec.Functional(ec.BodyForce((0.0, 1.0))))


@pytest.mark.ranks
@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_ranks_agree(degree):
    crack = ec.Contact("upper lip", against="lower lip")
    scene = pulled(contacts=(crack,))
    found = []
    for comm in (COMM, MPI.COMM_SELF):
        error = certified(scene, strip(0.7, comm=comm), degree=degree)
        bounds = ec.interval(error, factor(0.4))
        found.append([bounds.low, bounds.high])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_what_has_no_factor():
    error = certified(pulled(), strip(0.5), degree=1)
    with pytest.raises(ec.InputError, match=r"comes as near as 0\.5"):
        ec.interval(error, factor(0.6))
    with pytest.raises(ec.InputError, match="direction in which the crack points"):
        ec.interval(error, ec.StressIntensity(TIP, (-1.0, 0.0), radius=0.3))
    for x, radius in ((0.7, 0.1), (0.7, 0.25), (0.3, 0.1)):
        with pytest.raises(ec.InputError, match="crack"):
            ec.interval(error, ec.StressIntensity((x, 0.0), (1.0, 0.0), radius=radius))
    heavy = ec.Scene(ec.Elastic(E, NU), pulled().supports, ec.BodyForce((0.0, -1.0)))
    with pytest.raises(ec.InputError, match="body forces"):
        ec.interval(certified(heavy, strip(0.5)), factor(0.3))
    of_regions = ec.Elastic({"up": E, "down": 2 * E}, NU)
    two = ec.Scene(of_regions, pulled().supports, pulled().loads)
    with pytest.raises(ec.InputError, match="isotropic"):
        ec.interval(certified(two, strip(0.5)), factor(0.3))
    with pytest.raises(ec.InputError, match='give "I" or "II"'):
        factor(0.3, "III")
    with pytest.raises(ec.InputError, match="radius > 0"):
        factor(-1.0)
