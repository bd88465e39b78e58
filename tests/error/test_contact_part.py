"""The contact part of e^2 is integrated exactly although the length of the slip has kinks, or from above.

- in the plane: blocks whose slip changes its direction inside facets, both degrees,
  Coulomb and Tresca friction, against a composite rule that is cut at the zeros found by
  numpy;
- in 3D: a slip that is zero inside a facet, against a composite rule; the contact
  part is not below it.
"""

import numpy as np
import pytest

import erc_contact as ec
from erc_contact.error.contact import contact_squares
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.trace import split
from namedmesh.simplex import bernstein, rule

pytestmark = pytest.mark.serial


def pair_with_kinks(friction, degree, dim=2):
    """A coarse pair whose slip turns.

    The top of the block is stretched, so that the contact slips both ways.
    """
    if dim == 2:
        domain = ec.rectangle((0.0, 0.0), (1.0, 0.4), cells=(1, 1))
        top = ec.Displacement("top", (lambda x: 0.03 * (x[0] - 0.37), -0.02))
    else:
        domain = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 0.4), cells=(1, 1, 1))
        stretch = (lambda x: 0.03 * (x[0] - 0.4), lambda x: 0.02 * (x[1] - 0.45), -0.02)
        top = ec.Displacement("top", stretch)
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), [top], contacts=[ec.Contact("bottom", friction=friction)]
    )
    return ec.equilibrate(ec.solve(scene, domain, ec.AugmentedLagrangian(), degree=degree))


def works(pair, points):
    """The terms of the contact part at points of the facets without gap.

    Friction and the rest, shape (f, q) each.
    """
    traction, model = pair.tractions[0], pair.solution.model
    shape = bernstein(model.space.d - 1, model.space.degree, points)
    nodal = pair.displacement.x.array.reshape(-1, model.space.d)[traction.nodes]
    at_nodes = bernstein(model.space.d - 1, model.space.degree, model.space.facet_points)
    w = shape @ np.linalg.solve(at_nodes, nodal)
    r = shape @ traction.values
    normal = traction.contact.direction[:, None, :]
    _, slip, length = split(w, normal)
    parameters = friction_parameters(model.space, traction.contact, points)
    bound = traction.contact.friction_bound(-(r * normal).sum(axis=-1), parameters)
    return 2 * bound * length, 2 * (r * w).sum(axis=-1), slip


def has_kinks(slip):
    along = slip[..., 0]
    return int(((along.min(axis=1) < 0) & (along.max(axis=1) > 0)).sum())


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("friction", [0.1, ec.Tresca(0.002)], ids=["Coulomb", "Tresca"])
def test_exact_in_the_plane(friction, degree):
    pair = pair_with_kinks(friction, degree)
    t = (np.arange(20000) + 0.5) / 20000
    sliding, rest, slip = works(pair, t[:, None])
    assert has_kinks(slip) >= 1
    reference = pair.tractions[0].area @ (sliding + rest).mean(axis=1)
    part = contact_squares(
        pair.solution.model.space, pair.displacement, pair.tractions[0], 0.0
    ).parts.sum()
    scale = pair.tractions[0].area @ sliding.mean(axis=1)
    assert abs(part - reference) <= 1e-8 * scale  # the midpoint rule leaves (1/20000)^2


@pytest.mark.parametrize("degree", [1, 2])
def test_not_from_below_in_space(degree):
    pair = pair_with_kinks(0.1, degree, dim=3)
    points, weights = rule(2, 4)
    n = 60
    cells = [(i, j, up) for i in range(n) for j in range(n) for up in (0, 1) if i + j + up < n]
    corner = np.array([[i + up, j + up] for i, j, up in cells]) / n
    turn = np.array([1.0 - 2.0 * up for _, _, up in cells])
    fine = (corner[:, None, :] + turn[:, None, None] * points / n).reshape(-1, 2)
    sliding, rest, slip = works(pair, fine)
    assert np.linalg.norm(slip, axis=-1).min() < 0.05 * np.linalg.norm(slip, axis=-1).max()
    mean = (sliding + rest) @ np.tile(weights, len(cells)) / len(cells)
    reference = pair.tractions[0].area @ mean
    part = contact_squares(
        pair.solution.model.space, pair.displacement, pair.tractions[0], 0.0
    ).parts.sum()
    assert reference * (1 - 1e-5) <= part <= reference * (1 + 2e-3)
