"""Stress intensity factors of cracks that bend within the radius.

- The horn holds the crack, and cells know their side of it, for random lines.
- Where the line turns back, is too steep or ends, it is followed no farther.
- Proved intervals with radii up to a bend and beyond it meet, of both modes, open and
  under pressure; a larger radius has a narrower interval.
- The direction of an arc is taken from the mesh, and its factors are the closed form.
- Ranks agree.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import certified
from test_ring_intensity import cracked, of_lips

import erc_contact as ec
from erc_contact.error.goals.crack_line import CrackLine, _chain
from namedmesh.gmsh_session import session

COMM = MPI.COMM_WORLD
BENT = [(-0.5, -0.2), (-0.1, 0.0), (0.3, 0.0)]
TIP = BENT[-1]


def random_line(rng: np.random.Generator) -> CrackLine:
    """A crack that goes back by steps, each turned by up to half a radian."""
    straight = rng.uniform(0.02, 0.5)
    angles = rng.uniform(-0.6, 0.6, 6)
    steps = rng.uniform(0.02, 0.3, 6)[:, None] * np.column_stack([-np.cos(angles), np.sin(angles)])
    start = np.array([[-straight, 0.0]])
    return CrackLine(np.vstack([start, start + np.cumsum(steps, axis=0)]), radius=1.0)


@pytest.mark.serial
@pytest.mark.parametrize("number", range(20))
def test_the_horn_holds_the_crack(number):
    rng = np.random.default_rng(number)
    line = random_line(rng)
    opening, widening = line.horn
    x = -np.linspace(line.straight, -line.places[-1, 0], 2000)
    y = np.interp(-x, -line.places[:, 0], line.places[:, 1])
    xi = -x - line.straight
    assert (abs(y) <= xi * (opening + widening * xi) + 1e-15).all()
    # Small cells that stand on the crack or hang at it.
    at = np.column_stack([x, y])[1:]
    corners = at[:, None] + 1e-6 * np.array([[0.0, 0.1], [-0.1, 1.0], [0.1, 1.0]])
    assert (line.sides(corners) == 1.0).all()
    assert (line.sides(corners * [1, -1] + 2 * at[:, None] * [0, 1]) == -1.0).all()
    ahead = np.array([[[0.0, 0.0], [1.0, -1.0], [1.0, 1.0]]])
    assert line.sides(ahead) == 1.0


@pytest.mark.serial
def test_sides_of_large_cells():
    """They reach beyond the radius, where the crack goes on, and stand on the crack."""
    line = CrackLine(np.array([[-0.1, 0.0], [-0.5, -0.2], [-0.9, -0.6]]), radius=1.0)
    above = [[-0.5, -0.2], [-0.9, -0.6], [-2.0, -1.5]], [[-0.1, 0.0], [-0.5, -0.2], [-3.0, -1.0]]
    below = [[-0.5, -0.2], [-0.9, -0.6], [-1.0, -1.0]], [[-0.1, 0.0], [0.0, 0.0], [1.0, -5.0]]
    assert (line.sides(np.array(above)) == 1.0).all()
    assert (line.sides(np.array(below)) == -1.0).all()


@pytest.mark.serial
def test_how_far_a_line_is_followed():
    places = np.array([[-0.1, 0.0], [-0.3, 0.1], [-0.4, 0.0], [-0.6, 0.2]])
    facets = np.stack([places[:-1], places[1:]], axis=1)
    assert _chain(places[0], facets, 1e-9) == pytest.approx(places)
    # Facets of another line, steep ones, and ones that turn back.
    assert len(_chain(places[0], facets + 0.01, 1e-9)) == 1
    assert len(_chain(places[0], facets * [1.0, 9.0], 1e-9)) == 1
    back = np.array([[[-0.1, 0.0], [-0.2, 0.19]], [[-0.2, 0.19], [-0.21, 0.0]]])
    assert len(_chain(places[0], back, 1e-9)) == 2


def factors(scene: ec.Scene, radii: tuple, degree: int = 1, mode: str = "I") -> list[ec.Bounds]:
    error = certified(scene, cracked((-1.0, -1.0), (1.0, 1.0), BENT, (0.3, 0.03)), degree=degree)
    goals = [ec.StressIntensity(TIP, (1.0, 0.0), radius=r, mode=mode) for r in radii]
    return [ec.interval(error, goal) for goal in goals]


@pytest.mark.broad
def test_beyond_a_bend():
    """Faces under pressure, on both sides of the bend."""
    found = factors(of_lips(0.3, 1.0, "plane strain"), (0.2, 0.4, 0.6))
    assert all(bounds.guaranteed for bounds in found)
    assert max(bounds.low for bounds in found) < min(bounds.high for bounds in found)
    near, _, far = (bounds.high - bounds.low for bounds in found)
    assert far < 0.5 * near
    with pytest.raises(ec.InputError, match=r"as near as 0\.7 .* goes on away from its tip"):
        factors(of_lips(0.3, 1.0, "plane strain"), (0.8,))


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("mode", ["I", "II"])
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
def test_pulled_beyond_a_bend(hypothesis, mode):
    held = ec.Displacement("bottom", (0.0, 0.0))
    pull = ec.Traction("top", (0.3, 1.0))
    scene = ec.Scene(ec.Elastic(1000.0, 0.3, hypothesis=hypothesis), held, pull)
    found = factors(scene, (0.3, 0.5, 0.69), degree=2, mode=mode)
    assert all(bounds.guaranteed for bounds in found)
    assert max(bounds.low for bounds in found) < min(bounds.high for bounds in found)


@pytest.mark.ranks
def test_ranks_agree():
    found = []
    for comm in (COMM, MPI.COMM_SELF):
        domain = cracked((-1.0, -1.0), (1.0, 1.0), BENT, (0.5, 0.1), comm)
        error = certified(of_lips(0.3, 1.0, "plane strain"), domain)
        bounds = ec.interval(error, ec.StressIntensity(TIP, (1.0, 0.0), radius=0.6))
        found.append([bounds.low, bounds.high])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def arc(alpha: float, size: float) -> ec.Domain:
    """A square of half width 30 with a crack along an arc of radius 1, from -alpha to alpha."""

    def build(gmsh):
        model, occ = gmsh.model, gmsh.model.occ
        body = occ.addRectangle(-30, -30, 0, 60, 60)
        s, c = np.sin(alpha), np.cos(alpha)
        places = (s, c), (0.0, 1.0), (-s, c), (s + 90 * c, c - 90 * s), (-s - 90 * c, c - 90 * s)
        right, top, left, *far = (occ.addPoint(*place, 0) for place in places)
        centre = occ.addPoint(0, 0, 0)
        arcs = [occ.addCircleArc(*ends) for ends in ((right, centre, top), (top, centre, left))]
        beyond = [occ.addLine(far[0], right), occ.addLine(left, far[1])]
        _, parts = occ.fragment([(2, body)], [(1, tag) for tag in (*beyond, *arcs)])
        on_crack = [part for pieces in parts[3:] for part in pieces]
        occ.synchronize()
        for _, tag in parts[0]:
            above = occ.getCenterOfMass(2, tag)[1] > 0
            model.addPhysicalGroup(2, [tag], name="up" if above else "down")
        model.addPhysicalGroup(1, [tag for _, tag in on_crack], name="crack")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 8)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 24)
        ends = model.getBoundary(on_crack, combined=False, oriented=False)
        model.mesh.setSize(ends, size)

    with session(COMM, build, "The plate") as model:
        whole = ec.from_gmsh(model, COMM)
    return whole.split({"upper lip": "up", "lower lip": "down"}, on="crack")


@pytest.mark.broad
@pytest.mark.serial
def test_a_crack_along_an_arc():
    """Under pressure: Muskhelishvili's factors, in a body that is large and not infinite."""
    alpha = np.pi / 4
    half = np.sin(alpha / 2)
    size = np.sqrt(np.pi * np.sin(alpha)) / (1 + half**2)
    tip, forward = (np.sin(alpha), np.cos(alpha)), (np.cos(alpha), -np.sin(alpha))
    opening = ec.StressIntensity(tip, forward, radius=0.7)
    scene = of_lips(0.3, 1.0, "plane strain")
    history = ec.adapt(scene, arc(alpha, 0.05), 0.05, degree=2, goal=opening)
    assert history.reached
    assert history.bounds.value == pytest.approx(size * np.cos(alpha / 2), rel=5e-3)
    sliding = ec.StressIntensity(tip, forward, radius=0.7, mode="II")
    found = ec.interval(history, sliding)
    assert not found.guaranteed  # flat facets along a curve
    assert abs(found.value) == pytest.approx(size * half, rel=2e-2)
