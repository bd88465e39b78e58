"""Each pair proves its equilibrium, and is refused where it is damaged.

- what a pair says of itself is round-off: of random scenes, in units far from 1, at
  rest, after large slides;
- each step of the reconstruction, damaged by a millionth in one place, ends in
  NotBalanced, with the place; what damages no equilibrium still ends in a pair that has
  one;
- on several ranks, also what one rank alone has wrong;
- an evaluation of sigma^ with numpy alone says the same, on scenes of a random family,
  and sees the damage;
- u = 0, translations and noise have pairs in equilibrium, and intervals that hold;
- what cancels in sigma^ is balanced for the size that is left;
- where round-off has eaten the strain, intervals have a width and hold.
"""

from collections.abc import Callable

import numpy as np
import pytest
from attack_pairs import outcome
from domains import partly_broad
from mpi4py import MPI
from pair_evaluation import UNBALANCED
from scenes import block, certified, prototype_block, random_scene

import erc_contact as ec
from erc_contact.admissible import bulk, contact, equilibrate, imbalance, reconstruction
from erc_contact.admissible.shift import Shift

COMM = MPI.COMM_WORLD
DAMAGE = 1e-6
ROUND_OFF = 1e-12


def solution(degree: int = 1, friction: float = 0.3) -> ec.Solution:
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.1, -0.05))],
        [ec.Traction("right", (-0.002, 0.001)), ec.BodyForce((0.001, -0.002))],
        [ec.Contact("bottom", friction=friction)],
    )
    return ec.solve(scene, block(4), degree=degree)


def after(monkeypatch: pytest.MonkeyPatch, name: str, change: Callable, module) -> None:
    """Change the result of a step of the reconstruction."""
    step = getattr(module, name)
    monkeypatch.setattr(module, name, lambda *given, **named: change(step(*given, **named)))


def in_one_place(values: np.ndarray, damage: float = DAMAGE) -> np.ndarray:
    """Values of which one is wrong, in the middle of the last rank's."""
    values = values.copy()
    if COMM.rank == COMM.size - 1:
        values[len(values) // 2].flat[0] += damage * abs(values).max()
    return values


def all_facets(moments: np.ndarray) -> np.ndarray:
    """Moments that are wrong on all facets, also on those between two ranks."""
    return moments * (1 + DAMAGE * np.arange(len(moments))[:, None, None])


def pulled(tractions):
    for traction in tractions:
        traction.values[:] *= -DAMAGE
    return tractions


FACETS = "(in a cell|on the boundary|between two ranks)"
DAMAGES = {
    "stress of a cell": (1, bulk, "macro_stress", in_one_place, "in a cell"),
    "bubbles": (2, bulk, "relax", in_one_place, "in a cell"),
    "facet tractions": (1, reconstruction, "equilibrated_moments", all_facets, FACETS),
    "tightening": (
        1,
        bulk,
        "tighten_moments",
        lambda done: (all_facets(done[0]), *done[1:]),
        FACETS,
    ),
    "tightening, degree 2": (
        2,
        bulk,
        "tighten_moments",
        lambda done: (all_facets(done[0]), *done[1:]),
        FACETS,
    ),
    "tractions": (1, equilibrate, "admissible_tractions", pulled, "in the law of Contact"),
    "no number": (1, bulk, "macro_stress", lambda stress: stress * np.nan, "in a cell"),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_step_is_refused(name, monkeypatch):
    degree, module, step, change, where = DAMAGES[name]
    solved = solution(degree)
    assert ec.equilibrate(solved).imbalance < ROUND_OFF
    after(monkeypatch, step, change, module)
    with pytest.raises(ec.NotBalanced, match=rf"certifies nothing: {where}.* near \("):
        ec.equilibrate(solved)


def test_the_rebalance_is_not_left_out(monkeypatch):
    """The stress of the contact solve is in equilibrium with other contact tractions."""
    solved = ec.certify(prototype_block(), block(4), lambda x: 0.01 * np.sin(x)).error.solution
    monkeypatch.setattr("erc_contact.admissible.rebalance.BALANCE_SOLVES", 0)
    with pytest.raises(ec.NotBalanced, match="in a cell near"):
        ec.equilibrate(solved)


def test_given_tractions_stay(monkeypatch):
    """Tightening that may move them leaves every cell in equilibrium."""
    step = bulk.tighten_moments

    def tighten_all(space, cells, moment, force, free, *others):
        return step(space, cells, moment, force, np.ones_like(free), *others)

    solved = solution()
    monkeypatch.setattr(bulk, "tighten_moments", tighten_all)
    with pytest.raises(ec.NotBalanced, match="on the boundary near"):
        ec.equilibrate(solved)


def test_a_damaged_shift_leaves_a_pair_that_is_proved(monkeypatch):
    """The shift moves r^ within what is allowed and balanced: it costs e, and no proof."""
    solved = solution()
    sound = ec.constitutive_error(ec.equilibrate(solved))
    shift = Shift.__call__
    monkeypatch.setattr(Shift, "__call__", lambda self, slope: 1e3 * shift(self, slope) + 1.0)
    pair = ec.equilibrate(solved)
    assert pair.imbalance < ROUND_OFF
    assert ec.constitutive_error(pair).absolute > 0.9 * sound.absolute
    after(monkeypatch, "balance", lambda done: ([r * np.nan for r in done[0]], *done[1:]), contact)
    free = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("left", (0.0, None))],
        ec.BodyForce((0.0, -0.01)),
        ec.Contact("bottom"),
    )
    with np.errstate(invalid="ignore"), pytest.raises(ec.ErcContactError):
        ec.equilibrate(ec.solve(free, block(4)))


@pytest.mark.skipif(COMM.size == 1, reason="of several ranks")
def test_what_one_rank_has_wrong_is_refused_on_all(monkeypatch):
    """Its moments are in equilibrium with its cells, and not opposite to the moments of others."""
    solved = solution()
    between = imbalance._between_ranks

    def wrong(model, cells, moment):
        return between(model, cells, moment * (1 + DAMAGE * (COMM.rank == 1)))

    monkeypatch.setattr(imbalance, "_between_ranks", wrong)
    with pytest.raises(ec.NotBalanced, match="between two ranks"):
        ec.equilibrate(solved)


@pytest.mark.broad
@pytest.mark.on_ranks("2-1", "3-1")
@pytest.mark.parametrize(("seed", "degree"), [(2, 1), (3, 1), (2, 2), (3, 2)])
def test_pairs_of_random_scenes(seed, degree):
    assert ec.equilibrate(ec.solve(*random_scene(seed), degree=degree)).imbalance < ROUND_OFF


@pytest.mark.broad
@pytest.mark.on_ranks("0", "3")
@pytest.mark.parametrize("number", range(8))
def test_an_own_evaluation_says_the_same(number, monkeypatch):
    """Of the family of benchmarks/attack_pairs.py."""
    found = outcome(5, number, COMM)
    assert found.ending == "pair"
    assert found.own < 0.01 * UNBALANCED
    monkeypatch.setattr(imbalance, "UNBALANCED", np.inf)
    after(monkeypatch, "macro_stress", lambda stress: in_one_place(stress, 1e-3), bulk)
    damaged = outcome(5, number, COMM)
    assert damaged.own > UNBALANCED
    assert 0.03 < damaged.own / damaged.said < 30


@pytest.mark.serial
@pytest.mark.parametrize("length", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("force", [1e-25, 1.0, 1e12])
def test_units_do_not_matter(force, length):
    stress = force / length**2
    upper = ec.rectangle((0.0, 0.0), (length, length), cells=(3, 3))
    lower = ec.rectangle((0.0, -length), (length, 0.0), cells=(4, 3))
    bodies = ec.assembly({"u": upper, "l": lower}).joined("u bottom", "l top")
    scene = ec.Scene(
        ec.Elastic({"u": stress, "l": 2 * stress}, 0.3),
        ec.Displacement("l bottom", (0.0, 0.0)),
        ec.Traction("u top", (0.001 * stress, -0.01 * stress)),
        ec.Contact("u bottom", against="l top", friction=0.3),
    )
    error = certified(scene, bodies)
    assert error.relative == pytest.approx(0.1312127, rel=1e-6)
    assert error.admissible.imbalance < ROUND_OFF


@pytest.mark.parametrize("solver", ["direct", "iterative"])
def test_pressures_that_oscillate_are_balanced_for_what_is_left(solver):
    """Heat in nearly incompressible rings: sigma^ is a thousandth of what u has.

    Forces are balanced for a hundredth of the pressure, ten times sigma^.
    """
    body = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2))
    rings = ec.Elastic(1000.0, 0.499999, hypothesis="axisymmetric")
    left = []
    for expansion in (1e-5, 2e-5, 1e-4, 3e-4, 1e-3, 1e-2):
        heat = ec.ThermalStrain(expansion, lambda x: 1 + x[0])
        scene = ec.Scene(rings, ec.Displacement("bottom", (None, 0.0)), strains=[heat])
        left.append(ec.equilibrate(ec.solve(scene, body, solver=solver)).imbalance)
    assert max(left) < 10 * ROUND_OFF


@pytest.mark.parametrize(
    "moved",
    partly_broad([(0.0, 0.0), (0.0, -0.25), (0.1, -0.25), (1e3, 1e3)], [(0.0, 0.0), (0.0, -0.25)]),
)
def test_displacements_without_strain(moved):
    """Nothing but the loads tells the size of the stress."""
    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(6, 3))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        ec.Displacement("left", (0.0, None)),
        ec.Traction("top", (0.002, -0.01)),
        ec.Contact("bottom"),
    )
    fine = certified(scene, domain.refined(), degree=2)
    energy = ec.interval(fine, ec.Energy())

    def u(x):
        return np.array([0.0 * x[0] + moved[0], 0.0 * x[0] + moved[1]])

    given = ec.certify(scene, domain, u)
    bounds = ec.interval(given.error, ec.Energy())
    assert bounds.low <= energy.high
    assert bounds.high >= energy.low
    reactions = given.error.reactions()
    assert abs(reactions["balance"].force).max() < 1e-12 * 0.02
    if moved == (0.0, 0.0):
        # |u - 0|^2 + |sigma - sigma^|^2 <= e^2
        assert given.error.absolute**2 >= -2 * energy.high


@pytest.mark.serial
@pytest.mark.parametrize("value", [1e101, 1e200, np.inf, np.nan])
def test_displacements_without_energy_are_refused(value):
    with pytest.raises(ec.InputError, match="certify: the displacement is"):
        ec.certify(prototype_block(), block(4), lambda x: value * np.ones_like(x))


@pytest.mark.serial
@pytest.mark.parametrize("ratio", [1e9, 1e12, 1e13, 1e14, 1e15])
def test_round_off_of_strains_belongs_to_the_bound(ratio):
    """A plate that is pulled by a length, its supports moved by a multiple of it."""
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    stretch = 2.0**-6

    def energy(far: float) -> ec.Bounds:
        supports = [
            ec.Displacement("left", (far, 0.0)),
            ec.Displacement("right", (far + stretch, 0)),
        ]
        scene = ec.Scene(ec.Elastic(1.0, 0.3), supports)
        return ec.interval(certified(scene, domain), ec.Energy())

    near = energy(0.0)
    far = energy(2.0 ** np.round(np.log2(ratio * stretch)))
    assert near.low < near.high
    assert far.low <= near.high
    assert far.high >= near.low
    assert far.high - far.low >= near.high - near.low
