"""Bodies near the load that tips them: the resultant lies near an edge of the contact.

Tractions of degree k on facets have their resultant at least a share of a facet inside.

- where facets are too large for any, `adapt` refines those that press until there is a pair;
- in 3D on an edge and on a corner, in stacks, by both strategies;
- `equilibrate` alone says that the mesh is to be refined there;
- pressures become uniform only where they still balance the loads.
"""

import numpy as np
import pytest

import erc_contact as ec
from erc_contact.admissible.balance_parts import TooCoarse

WEIGHT = 1e-3


def pushed(share, top="top", contacts=None, corner=False, d=2):
    """Push a body of width 1 by a share of the force that tips it."""
    force = share * WEIGHT * 0.5
    push = np.zeros(d)
    push[: 2 if corner else 1] = force
    return ec.Scene(
        ec.Elastic(1.0, 0.3),
        loads=[
            ec.BodyForce((*[0.0] * (d - 1), -WEIGHT)),
            ec.Traction(top, tuple(push)),
        ],
        contacts=contacts or ec.Contact("bottom", friction=0.8),
    )


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("strategy", [ec.Mark(), ec.SizeMap()], ids=["mark", "sizes"])
@pytest.mark.parametrize("degree", [1, 2])
def test_the_loop_refines_until_there_is_a_pair(degree, strategy):
    """The resultant is 0.6% of the width away from the edge."""
    block = ec.rectangle((0.0, 0.0), (1.0, 2.0), size=0.3)
    history = ec.adapt(pushed(0.9875), block, accuracy=0.2, degree=degree, strategy=strategy)
    assert history.reached
    force = history.force("bottom")
    assert force.force == pytest.approx([-0.9875e-3 / 2, 2e-3], rel=1e-8)


@pytest.mark.broad
@pytest.mark.parametrize("corner", [False, True], ids=["edge", "corner"])
def test_in_space(corner):
    """On an edge or on a corner."""
    block = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 2.0), cells=(2, 2, 2))
    scene = pushed(0.9, corner=corner, d=3)
    history = ec.adapt(scene, block, accuracy=0.5)
    wanted = [-0.45e-3, -0.45e-3 if corner else 0.0, 2e-3]
    assert history.force("bottom").force == pytest.approx(wanted, rel=1e-8, abs=1e-14)


@pytest.mark.broad
@pytest.mark.serial
def test_cells_that_press_are_named():
    """They lie at the edge over which the block is about to tip."""
    block = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(6, 12))
    solution = ec.solve(pushed(0.97), block)
    with pytest.raises(TooCoarse, match="refine the mesh at the contact") as failure:
        ec.equilibrate(solution)
    middles = solution.model.space.cell_corners()[failure.value.cells].mean(axis=1)
    assert len(middles) > 0
    assert (middles[:, 1] < 0.2).all()
    assert (middles[:, 0] > 0.6).all()


def pair_or_failure(scene, domain):
    try:
        return ec.equilibrate(ec.solve(scene, domain))
    except TooCoarse as coarse:
        return coarse


@pytest.mark.broad
@pytest.mark.serial
def test_the_message_says_how_to_go_on():
    """By a run, which refines there, or by hand; a run that may not says so."""
    block = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(6, 12))
    scene = pushed(0.97)
    found = pair_or_failure(scene, block)
    assert "adapt does so by itself" in str(found)
    while isinstance(found, TooCoarse):
        block = block.refined(found.cells)
        assert block.cells < 1000
        found = pair_or_failure(scene, block)
    first = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(6, 12))
    with pytest.raises(TooCoarse, match="more than max_cells = 145"):
        ec.adapt(scene, first, accuracy=0.5, max_cells=145)


@pytest.mark.broad
def test_stacks():
    """The upper of two blocks is near tipping, the lower one is pressed at its edge."""
    lower = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    upper = ec.rectangle((0.0, 1.0), (1.0, 2.0), cells=(4, 4))
    bodies = ec.assembly({"a": lower, "b": upper}).joined("b bottom", "a top")
    contacts = [
        ec.Contact("a bottom", friction=0.8),
        ec.Contact("b bottom", friction=0.8, against="a top"),
    ]
    history = ec.adapt(pushed(0.95, top="b top", contacts=contacts), bodies, accuracy=0.25)
    force = history.force("b bottom").force
    assert history.reached
    assert force == pytest.approx([-0.95e-3 / 2, 1e-3], rel=1e-8)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_pressures_that_would_be_uniform(degree):
    """On one facet a uniform pressure has its resultant in the middle: it is given up."""
    scene = ec.Scene(
        ec.Elastic(1e3, 0.3),
        ec.Displacement("top", (-0.06, None)),
        ec.BodyForce((0.0, -1.0)),
        ec.Contact("bottom", friction=lambda x: 0.2 + 0.8 * x[0] + x[0] ** 2),
    )
    block = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1))
    pair = ec.equilibrate(ec.solve(scene, block, degree=degree))
    assert ec.constitutive_error(pair).force("bottom").force[1] == pytest.approx(1.0, rel=1e-8)
