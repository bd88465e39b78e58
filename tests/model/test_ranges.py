"""Ranges of data in pieces of cells, by interval arithmetic.

- The values of random expressions at random points lie in their ranges.
- A function of one direction has its exact range, and a table, too.
- What the arithmetic does not know is told.
"""

import numpy as np
import pytest
import ufl

import erc_contact as ec
from erc_contact.model.data.array_code import UnknownOperatorError
from erc_contact.model.data.expressions import Everywhere
from erc_contact.model.data.ranges import Ranges, ranges_of
from namedmesh.base.releases import cell_nodes

pytestmark = pytest.mark.serial
DOMAIN = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 3))
X = ufl.SpatialCoordinate(DOMAIN.mesh)
DIP = ec.table([0.0, 0.3, 0.35, 0.4, 2.0], [1.0, 1.0, 0.1, 1.0, 2.0])
GRID = ec.table(
    ([0.0, 0.5, 1.2, 2.0], [0.0, 0.3, 0.6, 1.0]), np.random.default_rng(1).random((4, 4))
)


def field(degree):
    """A random function of the mesh."""
    function = DOMAIN.function("P", degree)
    function.x.array[:] = np.random.default_rng(degree).random(len(function.x.array))
    return function


SHARP = {
    "dip": 1 - 0.9 * ufl.exp(-(((X[0] - 0.3) / 0.05) ** 2)),
    "turned dip": ufl.exp(-(((0.6 * X[0] + 0.8 * X[1] - 0.5) / 0.1) ** 2)),
    "table": DIP(X[0]),
    "jump": ufl.conditional(ufl.lt(abs(X[0] - 0.5), 0.1), 1.0, 2.0),
    "odd power": (X[0] - 1) ** 3,
    "negative power": (X[0] + 1) ** -2,
    "linear field": field(1),
}
WIDE = {
    "ring": ufl.exp(-((X[0] - 0.4) ** 2 + (X[1] - 0.4) ** 2) / 0.01),
    "waves": ufl.sin(20 * X[0]) * ufl.cos(3 * X[1]),
    "tangent": ufl.tan(1.4 * X[0] * X[1]),
    "square of itself": ufl.sqrt(X[0] * X[0] + X[1]),
    "power": (X[0] + 0.1) ** X[1],
    "ratio": 1 / (X[0] * X[1] - 0.3),
    "extremes": ufl.max_value(X[0], 0.5) - ufl.min_value(X[1], 0.3),
    "conditions": ufl.conditional(
        ufl.And(ufl.gt(X[0], 0.5), ufl.Or(ufl.Not(ufl.ge(X[1], 0.5)), ufl.le(X[0], 1.0))), 2.0, X[1]
    ),
    "angles": ufl.atan(X[0] - X[1]) + ufl.acos(X[1] / 2) * ufl.cosh(X[0] - 1) - abs(X[0] - 1),
    "table of a radius": DIP(ufl.sqrt(X[0] ** 2 + X[1] ** 2)),
    "grid": GRID(X[0], X[1]),
    "field": field(2) * ufl.ln(1 + X[0]),
}


def ranges_and_samples(expression):
    """Ranges in random pieces of cells, and values at random points in them."""
    random = np.random.default_rng(0)
    n = 300
    cells = random.integers(0, DOMAIN.cells, n).astype(np.int32)
    geometry = DOMAIN.mesh.geometry
    corners = geometry.x[cell_nodes(geometry)[cells], :2]
    # Pieces of all sizes: whole cells, and parts down to a thousandth.
    pieces = random.dirichlet([1.0] * 3, size=(n, 3))
    share = 10.0 ** -random.uniform(0.0, 3.0, (n, 1, 1))
    places = np.where(share > 0.5, np.eye(3), pieces[:, :1] + share * (pieces - pieces[:, :1]))
    vertices = places @ corners
    x = random.dirichlet([0.3] * 3, size=(n, 400)) @ vertices
    values = Everywhere(ufl.as_ufl(expression), DOMAIN.mesh)(x, cells).reshape(n, 400)
    low, high = Ranges(ufl.as_ufl(expression), DOMAIN.mesh)(vertices, cells)
    return low, high, values


@pytest.mark.parametrize("name", [*SHARP, *WIDE])
def test_values_lie_in_ranges(name):
    """Of all operations, at all points."""
    low, high, values = ranges_and_samples((SHARP | WIDE)[name])
    round_off = 1e-12 * (1 + abs(values).max(axis=1))
    assert np.all(values.min(axis=1) >= low - round_off)
    assert np.all(values.max(axis=1) <= high + round_off)


@pytest.mark.parametrize("name", SHARP)
def test_functions_of_one_direction_have_exact_ranges(name):
    """The samples nearly reach both ends."""
    low, high, values = ranges_and_samples(SHARP[name])
    width = values.max(axis=1) - values.min(axis=1)
    assert np.median((high - low)[width > 0] / width[width > 0]) < 1.02


def test_unknown_operations_are_told():
    """A slope of a table, and a function that only the compiler knows."""
    for unknown in (ufl.erf(X[0]), DIP(X[0]).dx(0)):
        with pytest.raises(UnknownOperatorError):
            Ranges(unknown, DOMAIN.mesh)
        assert ranges_of(unknown, DOMAIN.mesh) is None
