"""Data of a law that vary inside cells, between the points of quadrature.

- The error of random plastic bodies with narrow dips, jumps and tables is at least the integral
  of Fenchel's gap by a rule of its own, a thousand points in a cell.
- Proved energies of two meshes meet.
- Where no range is known, as of a function that only the compiler knows, nothing counts as
  elastic that is not sampled.
"""

import numpy as np
import pytest
import ufl
from scenes import certified

import erc_contact as ec
from erc_contact.admissible.elastic import CellStrains
from erc_contact.admissible.macro import macro_values
from erc_contact.error.fenchel import fenchel_error
from erc_contact.model.data.quadrature import cell_pieces

pytestmark = pytest.mark.serial
PARTS = 32
"""Parts of an edge of a sub-simplex in the rule of this test."""
FINE_PARTS = 384
"""The same for narrow places; 32 parts give half too much of some of them."""


def composite_rule(parts):
    """Barycentric points in the middle of all triangles of a cut triangle."""
    i, j = np.meshgrid(np.arange(parts), np.arange(parts))
    upright = np.stack([i + 1 / 3, j + 1 / 3], axis=-1)[i + j < parts]
    turned = np.stack([i + 2 / 3, j + 2 / 3], axis=-1)[i + j < parts - 1]
    points = np.vstack([upright, turned]) / parts
    return np.column_stack([1 - points.sum(axis=1), points])


def own_integral(pair, parts=PARTS):
    """Twice the integral of Fenchel's gap of a pair in the plane."""
    model = pair.model
    space = model.space
    law = model.linearised.law
    cells = pair.cell_geometry
    strain = CellStrains.of(space, cells, pair.displacement)
    cell = np.arange(model.domain.owned_cells)
    total = 0.0
    for piece in cell_pieces(space.d):
        rule = composite_rule(parts) @ piece
        places = np.broadcast_to(rule, (len(cell), *rule.shape))
        x = places @ cells.corners[cell]
        sigma = macro_values(pair.stress, space.degree, cell, places)
        eps = strain.at(cell, places, x)
        near = np.zeros(sigma.shape[:2])
        gap = model.constitution.fenchel(law, eps, sigma, near, x, space.owned_cells[cell])
        total += cells.volume[cell] @ gap[..., 0].mean(axis=1) / 3
    return total


def weak(kind, random):
    """A factor of 1 almost everywhere, and less in a narrow place."""
    width = 10 ** random.uniform(-2.0, -1.0)
    centre = random.uniform(0.1, 0.9, 2)
    angle = random.uniform(0.0, np.pi)
    depth = random.uniform(0.5, 0.9)
    ends = [0.0, centre[0] - width, centre[0], centre[0] + width, 1.0]
    if min(np.diff(ends)) <= 0:
        ends = [0.0, 0.4, 0.4 + width, 0.4 + 2 * width, 1.0]
    profile = ec.table(ends, [1.0, 1.0, 1.0 - depth, 1.0, 1.0])

    def factor(x):
        along = (x[0] - centre[0]) * np.cos(angle) + (x[1] - centre[1]) * np.sin(angle)
        if kind == "dip":
            return 1 - depth * ufl.exp(-((along / width) ** 2))
        if kind == "jump":
            return ufl.conditional(ufl.lt(abs(along), width), 1 - depth, 1.0)
        return profile(x[0])

    return factor


def squeezed(material, down):
    """A square that is pressed and free to widen."""
    held = [
        ec.Displacement("bottom", (None, 0.0)),
        ec.Displacement("left", (0.0, None)),
        ec.Displacement("top", (None, -down)),
    ]
    return ec.Scene(material, held)


@pytest.mark.broad
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", ["dip", "jump", "table"])
@pytest.mark.parametrize("seed", range(3))
def test_error_holds_what_is_between_points(seed, kind, degree):
    """On two cells, which narrow weak places cross."""
    random = np.random.default_rng([seed, degree])
    factor = weak(kind, random)
    material = ec.Plastic(1.0, 0.3, lambda x: 0.02 * factor(x), 0.02)
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1))
    down = random.uniform(0.006, 0.02)
    error = certified(squeezed(material, down), domain, degree=degree)
    own = own_integral(error.admissible, FINE_PARTS)
    # The rule of this test misses parts of a jump.
    assert fenchel_error(error.admissible).gap.sum() >= 0.97 * own - 1e-14 * error.scale**2


def weld(x):
    """A soft layer that lies between the points of quadrature of coarse cells."""
    return 0.02 - 0.018 * ufl.exp(-(((x[1] - 0.25) / 0.05) ** 2))


@pytest.mark.broad
def test_energies_with_a_narrow_layer_meet():
    """Proved on four coarse cells and on many fine ones."""
    scene = squeezed(ec.Plastic(1.0, 0.3, weld, 0.02), 0.008)
    bounds = []
    for degree, cells in ((1, 2), (2, 16)):
        domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(cells, cells))
        bounds.append(ec.potential_energy(certified(scene, domain, degree=degree)))
    assert all(energy.guaranteed for energy in bounds)
    assert max(energy.low for energy in bounds) <= min(energy.high for energy in bounds)


@pytest.mark.broad
def test_unknown_ranges_are_sampled():
    """Only the compiler knows erf: no cell is elastic by its corners."""
    layer = lambda x: 0.011 + 0.009 * ufl.erf((x[1] - 0.25) / 0.05)  # noqa: E731
    scene = squeezed(ec.Plastic(1.0, 0.3, layer, 0.02), 0.008)
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2))
    error = certified(scene, domain)
    assert fenchel_error(error.admissible).gap.sum() >= 0.99 * own_integral(error.admissible)
