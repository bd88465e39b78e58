"""Bodies that hang on a point or an edge: what nothing holds is told with the place, and what is held is solved."""

import logging
import re

import numpy as np
import pytest
from scenes import certified
from test_hinges import CASES, COMM, bricks

import erc_contact as ec


@pytest.mark.parametrize("name", CASES)
def test_what_hangs_on_a_hinge_is_told(name):
    d, places = CASES[name]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        ec.Displacement("floor", (0.0,) * d),
        ec.Traction("roof", (0.01, *(0.0,) * (d - 1))),
    )
    domain = bricks(d, places)
    place = r"\(1, 1\)" if d == 2 else r"\(1, \d(\.\d)?, 1\)"
    for _ in range(2):
        with pytest.raises(ec.NotHeldError, match=rf"rotation.*'roof'.*touches.* at {place}"):
            ec.solve(scene, domain)
        with pytest.raises(ec.InputError, match=rf"share no facet.* touch at {place}.* alone"):
            domain.split({"here": "body 0", "there": "body 1"})
        domain = domain.refined()


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", CASES)
def test_what_is_held_besides_is_solved(name, degree):
    """As two bodies: each is in balance with its own support."""
    d, places = CASES[name]
    down = (*(0.0,) * (d - 1), -0.01)
    supports = [ec.Displacement("floor", (0.0,) * d), ec.Displacement("roof", (0.0,) * d)]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, ec.BodyForce(down))
    error = certified(scene, bricks(d, places), degree=degree)
    reactions = error.reactions()
    for part in ("floor", "roof"):
        assert reactions[part].force == pytest.approx(-np.array(down), abs=1e-12 * 0.01)
    assert error.admissible.imbalance < 1e-12
    alone = bricks(d, places[:1])
    floor = ec.Scene(ec.Elastic(1.0, 0.3), supports[0], ec.BodyForce(down))
    one = certified(floor, alone, degree=degree)
    if d == 2:
        # The upper body is the lower one, turned by half a turn, hanging.
        assert error.relative == pytest.approx(one.relative, rel=0.3)


def test_a_ring_that_touches_itself():
    """Eight bricks around a hole, one left out: two of them meet at a vertex of the same body."""
    ring = [(0, 0), (1, 0), (2, 0), (2, 1), (1, 2), (0, 2), (0, 1)]
    domain = bricks(2, ring)
    supports = ec.Displacement("floor", (0.0, 0.0))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, ec.Traction("roof", (0.001, -0.001)))
    error = certified(scene, domain)
    assert error.reactions()["floor"].force == pytest.approx([-0.002, 0.002], abs=1e-14)
    assert error.admissible.imbalance < 1e-12
    x = domain.mesh.geometry.x[:, :2]
    at_hinge = np.linalg.norm(x - np.array([2.0, 2.0]), axis=1) < 1e-9
    owned = domain.mesh.geometry.index_map().size_local
    assert COMM.allreduce(int(at_hinge[:owned].sum())) == 2


@pytest.mark.parametrize("d", [2, 3])
def test_pieces_that_lie_on_each_other_are_told_once(d, caplog):
    """Whether both are held, or one is loose; what shares its nodes says nothing."""
    caplog.set_level(logging.WARNING, logger="namedmesh")
    floor = ec.Displacement("floor", (0.0,) * d)
    roof = ec.Displacement("roof", (*(0.0,) * (d - 1), -0.02))
    places = [(0,) * d, (*(0,) * (d - 1), 1)]
    pieces = bricks(d, places, merged=False)
    facets = 2 if d == 2 else 8
    words = rf"{facets} facets of two bodies lie on each other .* middles \(.*, 1\)"
    held = ec.Scene(ec.Elastic(1.0, 0.3), [floor, roof])
    for domain, count in ((pieces, 1), (bricks(d, places), 0)):
        caplog.clear()
        ec.adapt(held, domain, accuracy=1e-9, max_steps=2, strategy=ec.Uniform())
        told = [record.getMessage() for record in caplog.records if "lie on" in record.getMessage()]
        assert len(told) == (count if COMM.rank == 0 else 0)
        if told:
            assert re.search(words, told[0])
    push = ec.Traction("roof", (*(0.0,) * (d - 1), -0.01))
    with pytest.raises(ec.NotHeldError, match=words):
        ec.solve(ec.Scene(ec.Elastic(1.0, 0.3), floor, push), pieces)
