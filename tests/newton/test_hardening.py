"""Hardening by curves.

- psi, psi* and the flow of a load step against a maximisation of their own, for random
  strains, states and curves; Fenchel's inequality, as an equality on the law, also where
  the stress out of plane is searched.
- A bar that is pulled, pressed and pulled: its closed form, at each point of the curve.
- A soft region with a curve beside an elastic one, and beside linear hardening.
- Functions: how far the curves are from them that stand for them.
- What is refused.
"""

import dataclasses

import numpy as np
import pytest
from domains import refused
from scenes import certified
from scipy.optimize import brentq

import erc_contact as ec
from erc_contact.model.law.point_law import Search
from erc_contact.model.model import Model
from erc_contact.scene.material import mandel_basis

CURVE = ec.HardeningCurve([0.0, 0.002, 0.004, 0.02], [1.0, 1.1, 1.3, 2.0])
STEEL = ec.Plastic(E=200.0, nu=0.3, hardening=CURVE, kinematic=3.0)


def reach(law):
    """Plastic strains of the points of the curve of a law, and k, also far beyond it."""
    curve = law.hardening.of_law()
    end = curve.plastic_strain[-1]

    def k(a):
        return curve(a) + curve.last_slope * np.maximum(a - end, 0.0)

    return np.array(curve.plastic_strain), k


def largest(law, beyond_elastic, c, before):
    """The flow D and max q D - c D^2/2 - int k, by bisection and Simpson's rule."""
    a, k = reach(law)

    def driving(flow):
        return beyond_elastic - c * flow - k(before + flow)

    flow = brentq(driving, 0.0, 900.0, xtol=1e-16) if driving(0.0) > 0.0 else 0.0
    inside = a[(a > before) & (a < before + flow)]
    points = np.concatenate([[before], inside, [before + flow]])
    middle = (points[1:] + points[:-1]) / 2
    work = np.diff(points) @ (k(points[1:]) + 4 * k(middle) + k(points[:-1])) / 6
    return flow, beyond_elastic * flow - c * flow**2 / 2 - work


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("curve", [CURVE, ec.Voce(1.0, 0.5, 100.0)], ids=["points", "Voce"])
def test_energies_of_a_load_step_are_the_largest(curve):
    law = dataclasses.replace(STEEL, hardening=curve, yield_stress=None)
    scene = ec.Scene(law, ec.Displacement("bottom", (0.0, 0.0, 0.0)))
    box = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(1, 1, 1))
    model = Model(scene, box, 1)
    rng = np.random.default_rng(2)
    count = 200
    basis = mandel_basis(3)

    def tensors(size):
        some = size * rng.normal(size=(count, 3, 3))
        return (some + some.transpose(0, 2, 1)) / 2

    def components(tensor):
        return np.einsum("nij,kij->nk", tensor, basis)

    def dev(tensor):
        return tensor - np.trace(tensor, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3

    plastic = dev(tensors(0.003))
    before = rng.uniform(-0.005, 0.03, count)  # beside its nodes a state may be below zero
    state = np.column_stack([components(plastic), before])[None]
    at_points = model.linearised.law.with_data(state)
    strain = tensors(10 ** rng.uniform(-4, -1, (count, 1, 1)))
    eps = components(strain)[None]
    x, cells = np.zeros((1, count, 3)), np.array([0])
    psi = at_points.energy(eps, x, cells)[0]
    stress = at_points.whole_stress(eps, x, cells)
    after = at_points.new_state(eps, x, cells)[0, :, -1]
    # The stress of another point is on no law with this one.
    other = np.roll(stress, 1, axis=1)
    near = Search(np.zeros((1, count)))
    psi_star = at_points.complementary(stress, near, x, cells)[0][0]
    of_other = at_points.complementary(other, near, x, cells)[0][0]

    G, K, kinematic = law.E / (2 * (1 + law.nu)), law.E / (3 * (1 - 2 * law.nu)), law.kinematic
    elastic = dev(strain) - plastic
    back = 2 / 3 * kinematic * plastic
    trial = np.sqrt(1.5 * ((2 * G * elastic - back) ** 2).sum(axis=(1, 2)))
    tensor = np.einsum("nk,kij->nij", other[0], basis)
    relative = np.sqrt(1.5 * ((dev(tensor) - back) ** 2).sum(axis=(1, 2)))
    of_energy = K / 2 * np.trace(strain, axis1=1, axis2=2) ** 2 + G * (elastic**2).sum(axis=(1, 2))
    trace = np.trace(tensor, axis1=1, axis2=2)
    of_dual = trace**2 / (18 * K) + (dev(tensor) ** 2).sum(axis=(1, 2)) / (4 * G)
    of_dual += (tensor * plastic).sum(axis=(1, 2))
    positive = np.maximum(before, 0.0)
    flows = []
    for i in range(count):
        flow, gain = largest(law, trial[i], 3 * G + kinematic, positive[i])
        flows.append(flow)
        of_energy[i] -= gain
        of_dual[i] += largest(law, relative[i], kinematic, positive[i])[1]
    assert (np.array(flows) > 0).mean() > 0.3
    assert after - positive == pytest.approx(flows, rel=1e-9, abs=1e-14)
    assert psi == pytest.approx(of_energy, rel=1e-10)
    assert of_other == pytest.approx(of_dual, rel=1e-10, abs=1e-12 * abs(of_dual).max())
    work = (stress * eps).sum(axis=-1)[0]
    assert psi + psi_star == pytest.approx(work, rel=1e-9, abs=1e-12 * abs(psi).max())
    assert (psi + of_other >= (other * eps).sum(axis=-1)[0]).all()


@pytest.mark.serial
def test_the_stress_out_of_plane_is_found_across_kinks_of_the_curve():
    """Newton's method alone goes to and fro between nearly flat and steep pieces."""
    strains = [0.0, 0.004, 0.005, 0.023, 0.027, 0.05]
    curve = ec.HardeningCurve(strains, [1.0, 1.006, 1.006, 1.41, 1.42, 1.97])
    law = ec.Plastic(E=100.0, nu=0.07, hardening=curve)
    scene = ec.Scene(law, ec.Displacement("bottom", (0.0, 0.0)))
    at_points = Model(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1)), 1).linearised.law
    rng = np.random.default_rng(3)
    eps = 10 ** rng.uniform(-2.5, -1.0, (1, 2000, 1)) * rng.normal(size=(1, 2000, 3))
    places = np.zeros((1, 2000, 2)), np.array([0])
    whole_stress = at_points.whole_stress(eps, *places)
    in_plane, out = whole_stress[..., :3], whole_stress[..., 3]
    near = out + 0.5 * rng.normal(size=out.shape)
    psi_star, found = at_points.complementary(in_plane, Search(near), *places)
    gap = at_points.energy(eps, *places) + psi_star - (in_plane * eps).sum(axis=-1)
    assert abs(gap).max() <= 1e-12 * psi_star.max()
    assert found == pytest.approx(out, abs=1e-6)


PULLS = {1.0: 1.2, 2.0: 1.6, 3.0: -1.9, 4.0: 2.4}


@pytest.mark.broad
def test_a_bar_that_is_pulled_and_pressed():
    """Stress and strain are uniform, so that meshes and steps in time are exact."""
    bar = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(1, 1, 1))
    supports = [ec.Symmetry(side) for side in ("left", "front", "bottom")]

    def scene_at(time):
        return ec.Scene(STEEL, supports, ec.Traction("top", (0.0, 0.0, PULLS[time])))

    evolution = ec.evolve(scene_at, bar, sorted(PULLS), 0.01)
    points, yield_stress = reach(STEEL)
    a = np.append(points, 1e3)
    k = yield_stress(a)
    plastic = accumulated = 0.0
    for error, (time, pull) in zip(evolution.errors, PULLS.items(), strict=True):
        relative = pull - STEEL.kinematic * plastic
        # k(b) + H_k (b - a) is the stress that the bar bears after the flow b - a.
        bears = k + STEEL.kinematic * (a - accumulated)
        flow = max(np.interp(abs(relative), bears, a) - accumulated, 0.0)
        plastic += np.copysign(flow, relative)
        accumulated += flow
        assert error.relative < 1e-6
        moved = error.solution.at([[1.0, 1.0, 1.0]]).displacement[0, 2]
        assert moved == pytest.approx(pull / STEEL.E + plastic, rel=1e-8), time
    assert accumulated > CURVE.plastic_strain[2]
    assert ec.results.state(evolution, "accumulated") == pytest.approx(accumulated, rel=1e-8)


@pytest.mark.serial
def test_plastic_strain_beyond_the_curve_is_told(caplog):
    """A body in the plane, pulled to a plastic strain of 4%, by a curve to 2% and to 10%."""
    body = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1))
    supports = [ec.Symmetry("left"), ec.Symmetry("bottom"), ec.Displacement("top", (None, 0.04))]
    longer = ec.HardeningCurve([*CURVE.plastic_strain[:-1], 0.1], CURVE.stress)
    told = []
    for curve in (CURVE, longer):
        caplog.clear()
        ec.solve(ec.Scene(ec.Plastic(200.0, 0.3, hardening=curve), supports), body)
        told.append("beyond the last point of the hardening curve, 0.02" in caplog.text)
    assert told == [True, False]


@pytest.mark.broad
@pytest.mark.parametrize("hard", [ec.Elastic(1000.0, 0.3), ec.Plastic(1000.0, 0.3, 0.4, 20.0)])
def test_regions_harden_in_their_own_way(hard):
    """In two layers under a pressure, each as if it stood alone: its stress is the same."""
    soft = ec.Plastic(200.0, 0.3, hardening=CURVE)
    regions = {"soft": ec.where(y=(None, 1.0)), "hard": ec.where(y=(1.0, None))}
    layers = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(1, 2)).named(regions=regions)
    sides = [ec.Symmetry("left"), ec.Symmetry("right"), ec.Symmetry("bottom")]
    load = ec.Traction("top", pressure=4.0)
    both = certified(ec.Scene({"soft": soft, "hard": hard}, sides, load), layers)
    for law, y in ((soft, 0.3), (hard, 1.6)):
        alone = certified(ec.Scene(law, sides, load), layers)
        assert both.at((0.4, y)).stress == pytest.approx(alone.at((0.4, y)).stress, rel=1e-7)
    assert ec.results.plastic_share(both) > 0.0


@pytest.mark.serial
@pytest.mark.parametrize(
    ("function", "pieces"),
    [
        (ec.Voce(200.0, 150.0, 20.0), 9),
        (ec.Voce(200.0, 600.0, 500.0, slope=50.0), 14),
        (ec.Swift(500.0, 0.01, 0.2), 11),
        (ec.Swift(500.0, 0.001, 0.5), 18),
        # Kinks, and parts that are convex or flat.
        (lambda a: np.interp(a, [0.0, 0.01, 0.02, 0.3], [200.0, 210.0, 400.0, 400.0]), 12),
    ],
)
def test_a_curve_is_near_its_function(function, pieces):
    curve = ec.HardeningCurve.through(function)
    strain = np.append(0.0, np.geomspace(1e-9, 1.0, 50_001))
    exact = function(strain)
    assert curve(0.0) == pytest.approx(function(0.0), rel=1e-15)
    assert curve(strain) == pytest.approx(exact, rel=2.1e-3)
    assert len(curve.stress) <= pieces + 1
    taken = curve.of_law()
    assert CURVE.of_law() == CURVE
    assert taken.plastic_strain == curve.plastic_strain
    assert (np.diff(taken(strain)) >= 0.0999 * exact[0] * np.diff(strain)).all()


@pytest.mark.serial
@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ec.HardeningCurve([0.0, 0.1], [2.0, 1.0]), "falls from 2 to 1"),
        (lambda: ec.HardeningCurve([0.1, 0.2], [1.0, 2.0]), "must begin with 0"),
        (lambda: ec.HardeningCurve([0.0, 0.0], [1.0, 2.0]), "increase"),
        (lambda: ec.HardeningCurve([0.0, 0.1], [0.0, 2.0]), "must be > 0"),
        (lambda: ec.HardeningCurve([0.0, 0.1], [1.0]), "2 plastic strains and 1 stresses"),
        (lambda: ec.HardeningCurve([0.0], [1.0]), "give 2 to 60"),
        (lambda: ec.HardeningCurve([0.0, 0.1], 1.0), "give a row"),
        (lambda: ec.HardeningCurve([0.0, 0.1], [1.0, 1.4], [0.2]), "beyond a quarter"),
        (lambda: ec.HardeningCurve([0.0, 0.1], [1.0, 1.4], [0.0] * 2), "each of the 1 pieces"),
        (lambda: ec.HardeningCurve(lambda a: a, [1.0]), "HardeningCurve.through(k)"),
        (lambda: ec.HardeningCurve.through(lambda a: 1.0), "a finite stress for each"),
        (lambda: ec.HardeningCurve.through(lambda a: 1.0 - a), "falls"),
        (lambda: ec.HardeningCurve.through(lambda a: 1.0 + a, up_to=0.0), "up_to is 0"),
        (lambda: ec.Voce(200.0, -1.0, 20.0), "saturation is -1"),
        (lambda: ec.Voce(200.0, 1.0, 0.0), "rate is 0"),
        (lambda: ec.Swift(200.0, 0.1, 2.0), "exponent is 2"),
        (lambda: ec.Plastic(1.0, 0.3, hardening=0.1), "yield_stress is left out"),
        (lambda: ec.Plastic(1.0, 0.3, 0.5, CURVE), "begins with 1"),
        (
            lambda: ec.Plastic(1.0, 0.3, {"b": lambda x: x[0]}, {"a": CURVE, "b": 1.0}),
            "beside a curve, yield_stress in 'b'",
        ),
        (
            lambda: ec.Plastic(1.0, 0.3, {"b": 1.0}, {"a": CURVE, "b": 0.0}),
            "hardening in 'b' is 0",
        ),
    ],
)
def test_what_is_no_curve(make, words):
    refused(make, words)
