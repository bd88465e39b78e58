"""Upper bounds of functions on facets: above the peak wherever it is, and near it.

- smooth functions, kinks, cusps (also steeper on one side) and jumps on segments at
  random places;
- kinks and cusps along a line in triangles;
- a displacement under a gap with a cusp stays below it at the cusp.
"""

import numpy as np
import pytest
from scenes import certified

import erc_contact as ec
from erc_contact.model.data import peaks
from erc_contact.model.data.peaks import upper_bounds
from erc_contact.model.data.quadrature import bisect, facet_pieces

pytestmark = pytest.mark.serial
COUNT = 300
PLACES = np.random.default_rng(3).uniform(0.0, 1.0, COUNT)
SEGMENTS = np.repeat(np.array([[[0.0, 0.0], [1.0, 0.0]]]), COUNT, axis=0)
EXACT = np.full(COUNT, 1e-14)


def on_segments(height):
    """The least and the greatest bound of a function of the distance from a random place, of which 0 is the peak."""

    def f(segment, at, x):
        return height(x[..., 0] - PLACES[segment][:, None])

    bounds = upper_bounds(f, SEGMENTS, facet_pieces(1), EXACT)
    return bounds.min(), bounds.max()


@pytest.mark.parametrize("power", [0.3, 0.5, 0.75, 1.0, 2.0, 4.0])
def test_peak_is_not_missed(power):
    least, greatest = on_segments(lambda s: -(abs(s) ** power))
    assert least >= 0.0
    assert greatest <= 2e-3


@pytest.mark.parametrize("power", [0.3, 0.5, 1.0])
def test_peak_that_is_steeper_on_one_side(power):
    least, greatest = on_segments(lambda s: -np.where(s > 0, 1.0, 3.0) * abs(s) ** power)
    assert least >= 0.0
    assert greatest <= 1e-2


@pytest.mark.parametrize("slope", [0.0, 0.1, -0.5])
def test_jump_costs_no_share_of_its_height(slope):
    least, greatest = on_segments(lambda s: np.where(s > 0, -1.0, -abs(slope * s)))
    assert least >= 0.0
    assert greatest <= 1e-3 * max(1.0, abs(slope))


@pytest.mark.parametrize("power", [0.3, 0.5, 1.0])
def test_cusp_beside_a_jump_is_not_missed(power):
    least, greatest = on_segments(lambda s: np.where(s > 0, -10.0, -(abs(s) ** power)))
    assert least >= 0.0
    assert greatest <= 1e-2


@pytest.mark.parametrize(
    ("power", "pieces", "most"),
    [(0.5, 4000, 0.3), (1.0, 4000, 1e-2), (2.0, 4000, 1e-3), (1.0, 400, 0.1)],
)
def test_line_of_peaks_in_triangles(power, pieces, most):
    """Bounds hold with any limit of the pieces, which makes them larger."""
    n = 4
    corners = [[[i, j], [i + 1, j], [i, j + 1]] for i in range(n) for j in range(n)]
    triangles = np.pad(np.array(corners) / n, ((0, 0), (0, 0), (0, 1)))

    def f(triangle, at, x):
        return -(abs(x[..., 0] - 0.43) ** power)

    exact = np.full(n * n, 1e-14)
    bounds = upper_bounds(f, triangles, facet_pieces(2), exact, most=pieces)
    x = triangles[..., 0]
    crossed = (x.min(axis=1) < 0.43) & (x.max(axis=1) > 0.43)
    peaks = np.where(crossed, 0.0, (-(abs(x - 0.43) ** power)).max(axis=1))
    ranges = np.ptp(-(abs(x - 0.43) ** power), axis=1)
    assert (bounds >= peaks - 1e-9).all()  # the samples are 1e-6 of a piece inside
    assert (bounds <= peaks + most * ranges).all()


def test_bound_does_not_depend_on_other_facets():
    """A rank has some of the facets.

    A line of cusps across all of them is bounded as in each facet alone.
    """
    n = 20
    corners = np.array([[[i, j], [i + 1, j], [i, j + 1]] for i in range(3) for j in range(n)]) / n
    triangles = np.pad(corners, ((0, 0), (0, 0), (0, 1)))

    def of_triangles(numbers):
        def f(triangle, at, x):
            return -(abs(x[..., 0] - 0.083) ** 0.5)

        exact = np.full(len(numbers), 1e-14)
        return upper_bounds(f, triangles[numbers], facet_pieces(2), exact)

    together = of_triangles(np.arange(len(triangles)))
    for some in (np.arange(n, 2 * n, 7), np.arange(0, 3 * n, 11)):
        assert np.array_equal(of_triangles(some), together[some])


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_displacement_is_below_a_cusp(degree):
    place = 0.4321
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("top", (0.01, -0.05))],
        contacts=[ec.Contact("bottom", gap=lambda x: 0.03 * abs(x[0] - place) ** 0.5)],
    )
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    error = certified(scene, block, degree=degree)
    assert error.guaranteed
    s = place + np.concatenate([[0.0], np.logspace(-12, -1, 100), -np.logspace(-12, -1, 100)])
    u = error.at(np.column_stack([s, np.zeros_like(s)])).displacement
    beyond = -u[:, 1] - 0.03 * abs(s - place) ** 0.5
    assert beyond.max() <= 1e-15


@pytest.mark.broad
def test_noise_of_coordinates_is_no_peak(monkeypatch):
    """A gap ``|x| - R`` is level on its circle, but for the round-off of the coordinates.

    It turns with a motion, which changes no gap either.
    """
    radius, turn = 10.0, 0.05
    belt = ec.rectangle((0.0, 0.0), (1.0, 0.02), cells=(150, 1))
    along, across, _ = belt.mesh.geometry.x.T.copy()
    belt.mesh.geometry.x[:, 0] = (radius + across) * np.sin(along)
    belt.mesh.geometry.x[:, 1] = (radius + across) * np.cos(along)
    drum = ec.Contact(
        "bottom",
        normal="gap",
        gap=lambda x: np.hypot(x[0], x[1]) - radius,
        motion=(lambda x: -turn * x[1], lambda x: turn * x[0]),
    )
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [ec.Displacement("left", (0.0, 0.0))], contacts=[drum])
    bisected = []
    monkeypatch.setattr(
        peaks,
        "bisect",
        lambda corners, vertices: bisected.extend(corners) or bisect(corners, vertices),
    )
    ec.equilibrate(ec.solve(scene, belt, degree=2))
    assert len(bisected) <= 200 * 150
