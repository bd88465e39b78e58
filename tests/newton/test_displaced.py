"""Statics in the displaced place: what small displacements leave out of balance.

- The moment is ``sum u x F`` over all nodal forces, in the plane and in 3D, for both degrees
  and with preloads; rigid translations add nothing.
- What contacts can take up is the closed form of a flat base, and of two feet.
- Ordinary bodies that only contacts hold say no word; tilting blocks, rolling discs, rockers,
  soft columns and pyramids of cylinders with too little friction do, in log, outcome and report.
- Bodies that supports, or planes of symmetry, hold are not asked; ranks agree.
"""

import logging

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from standing import DOUBTFUL, ORDINARY, pyramid, run, standing

import erc_contact as ec
from erc_contact.newton.displaced import MISSING, Imbalance, _least_sum, _moments, missing_moments
from erc_contact.output.verdict import verdict

COMM = MPI.COMM_WORLD
LAW = ec.Elastic(1.0, 0.3)


def missing(scene: ec.Scene, domain: ec.Domain) -> list[Imbalance]:
    solution = ec.solve(scene, domain)
    return missing_moments(solution.model, solution.u, solution.traction)


def nodal_moment(solution: ec.Solution) -> np.ndarray:
    """``sum u_i F_j - u_j F_i`` over nodal forces of supports, contacts and loads."""
    model = solution.model
    space = model.space
    d = space.d
    nodal = sum(solution._nodal_reactions().values())
    loads = model.loads(ufl.TestFunction(space.V))
    if loads is not None:
        from erc_contact.model.forces import _assemble

        nodal = nodal + _assemble(space, loads)
    owned = space.V.dofmap.index_map.size_local
    u = solution.u.x.array.reshape(-1, d)[:owned]
    product = np.einsum("ni,nj->ij", u, nodal[:owned])
    total = COMM.allreduce(product - product.T, MPI.SUM)
    return total[np.triu_indices(d, 1)]


def on_floor(d: int, tilt: float, **entries) -> tuple[ec.Scene, ec.Domain]:
    """A block that friction holds under a load that leans and is eccentric."""
    load = [0.1 * tilt] * (d - 1)
    top = ec.Traction("top", (*load, lambda x: -tilt * (1.0 + 0.5 * x[0])))
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.5), cells=(6, 9))
    if d == 3:
        domain = ec.box((0.0,) * 3, (1.0, 1.0, 1.5), cells=(3, 3, 4))
    return ec.Scene(LAW, loads=top, contacts=ec.Contact("bottom", friction=0.5), **entries), domain


@pytest.mark.on_ranks("2-1", "3-2")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_the_moment_is_that_of_the_forces(d, degree):
    """Exact for degree 1; for degree 2 the middle of a cell stands for it."""
    solution = ec.solve(*on_floor(d, 0.01), degree=degree)
    moments, sizes = _moments(solution.model, solution.u)
    expected = nodal_moment(solution)
    close = 1e-12 if degree == 1 else 2e-4
    assert moments[0] == pytest.approx(expected, abs=close * sizes[0])
    assert abs(expected).max() > 1e-3 * sizes[0]


@pytest.mark.serial
def test_what_contacts_take_up():
    """A uniform pressure on a base of width b: F b/4; two feet at a distance L: F L/2."""
    x = (np.arange(1000) + 0.5) / 1000
    force = np.full(1000, 3.0 / 1000)
    up = np.ones((1000, 1))
    assert _least_sum(force, x - 7.0, up) == pytest.approx(3.0 / 4, rel=1e-4)
    feet = np.where(x < 0.5, 0.0, 2.0)
    assert _least_sum(force, feet, up) == pytest.approx(3.0, rel=1e-4)
    # A round body: all normals go through its centre, about which it turns.
    angles = np.linspace(-1.0, 1.0, 50)
    normals = np.column_stack([np.sin(angles), -np.cos(angles)])
    about_bottom = -np.sin(angles)
    assert _least_sum(np.ones(50), about_bottom, normals) < 1e-9 * abs(about_bottom).sum()


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("name", ["block", "stack", "press_fit", "box", "table", *DOUBTFUL])
def test_words_are_of_bodies_that_may_not_stand(name, caplog):
    caplog.set_level(logging.WARNING, logger="erc_contact")
    family = {**ORDINARY, **DOUBTFUL}[name]
    worst, history = run(family(np.random.default_rng(0)))
    told = [record for record in caplog.records if "Statics of the displaced" in record.message]
    claims = [words for _, words in verdict(history.best) if "whether it stands" in words]
    if name in ORDINARY:
        assert worst < MISSING / 2
        assert not told
        assert not claims
        assert "stands" not in history.outcome
    else:
        assert worst > MISSING
        assert len(told) == 1
        assert "this model cannot say whether it stands" in history.outcome
        assert "of the moment is missing on the body" in str(history)
        assert len(claims) == 1


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(("share", "stands"), [(1.1, True), (0.9, False)])
def test_a_pyramid_of_cylinders(share, stands):
    """With enough friction no word; with 10% too little they turn until the gaps hold them."""
    _, history = run(pyramid(share))
    assert history.reached
    assert ("whether it stands" in history.outcome) != stands
    if not stands:
        assert "'A floor'" in history.outcome
        assert "'B floor'" in history.outcome


def test_bodies_that_are_held_are_not_asked():
    scene, domain = on_floor(2, 0.01)
    held = ec.Displacement("left", (0.0, None))
    contacts = scene.contacts
    for supports in ([held], [ec.Symmetry("left")]):
        loads = ec.Traction("top", (0.0, -0.01))
        assert missing(ec.Scene(LAW, supports, loads, contacts), domain) == []
    # A spring is a support, however soft.
    springs = ec.Spring("top", normal=1e-3)
    sprung = ec.Scene(LAW, (), scene.loads, contacts, springs=springs)
    assert missing(sprung, domain) == []
    assert len(missing(scene, domain)) == 1


@pytest.mark.broad
def test_a_history_tells_it_too():
    """A block that is tilted more and more."""

    def scene_at(t):
        return standing(1.0, 3.0, 0.2, (t * 8e-3 / 6, -8e-3), friction=5.0)[0]

    domain = standing(1.0, 3.0, 0.2, (0.0, 0.0))[1]
    evolution = ec.evolve(scene_at, domain, [0.1, 0.97], accuracy=0.2, degree=2)
    assert "this model cannot say whether it stands" in evolution.outcome


@pytest.mark.ranks
@pytest.mark.parametrize("d", [2, 3])
def test_ranks_agree(d):
    scene, domain = on_floor(d, 0.01)
    found = missing(scene, domain)[0]
    numbers = [found.share, found.of_contacts, found.doubt]
    cells = (6, 9) if d == 2 else (3, 3, 4)
    brick = ec.rectangle if d == 2 else ec.box
    alone = brick((0.0,) * d, (*(1.0,) * (d - 1), 1.5), cells=cells, comm=MPI.COMM_SELF)
    again = missing(scene, alone)[0]
    assert numbers == pytest.approx([again.share, again.of_contacts, again.doubt], rel=1e-6)
