"""Foundations, and layers between bodies, that are tangentially compliant.

- a block that is pressed and sheared on one has the closed form of springs in a row
  while it sticks, and slips at its friction bound, by all methods and both solvers, in
  the plane and in 3D;
- with a bound that nothing reaches it is a bed of springs, in the plane, on rings and
  between bodies;
- the error in its law is zero for the law and for nothing else, and tends to the term
  of a rigid foundation;
- e bounds true errors, and the energy of a fine mesh lies in the interval of a coarse
  one;
- histories give back what springs store and dissipate on the slip alone, and go on from
  a checkpoint; ranks agree; what is wrong is refused in words.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from domains import refused, two_halves
from plates import METHODS, by_ranks_and_solvers, plate
from reference import true_errors
from scenes import flat_block, measured, mostly_serial, pressed

import erc_contact as ec
from erc_contact.error.contact_term import law_error, slider_of

E, G = 1000.0, 500.0
MU, K_N, K_T = 0.4, 800.0, 300.0
PRESS = 0.02
PRESSURE = PRESS / (1 / K_N + 1 / E)
STICKS = MU * PRESSURE * (1 / K_T + 1 / G)
"""Greatest push at which the block sticks."""
BED = ec.Foundation(K_N, K_T)
TWO_METHODS = METHODS[::3]
"""All variants of Nitsche's method find how a block sticks and slips, in the first test."""


def halves(domain: ec.Domain) -> ec.Domain:
    """A domain cut in two bodies at half of its height."""
    two = two_halves(domain, domain.dim - 1)
    return two.split({"punch": "upper", "base": "lower"})


def sheared(push, shear, *, between=False) -> ec.Scene:
    """A block pressed and pushed at its top, with the shear of its sides: its stress is uniform."""
    d = len(push) + 1
    loads = []
    for sides, component in zip((("left", "right"), ("front", "back")), shear, strict=False):
        for side, sign in zip(sides, (-1.0, 1.0), strict=True):
            loads.append(ec.Traction(side, (*(0.0,) * (d - 1), sign * component)))
    material = ec.Elastic(E, 0.0, "plane stress") if d == 2 else ec.Elastic(E, 0.0)
    supports = [ec.Displacement("top", (*push, -PRESS))]
    sides = ("bottom", None)
    if between:
        sides = ("punch", "base")
        supports.append(ec.Displacement("bottom", (0.0,) * d))
    return ec.Scene(material, supports, loads, ec.Contact(*sides, friction=MU, foundation=BED))


def uniform(
    amount: float, d: int = 2, slipped: float = 0.0, *, between: bool = False
) -> tuple[ec.Scene, float, float]:
    """The scene of a push, its shear, and its slip so far, from a slip before."""
    shear = (amount - slipped) / (1 / K_T + 1 / G)
    shear = float(np.clip(shear, -MU * PRESSURE, MU * PRESSURE))
    slip = amount - shear * (1 / K_T + 1 / G)
    along = np.array([1.0] if d == 2 else [0.8, 0.6])
    return sheared(tuple(amount * along), shear * along, between=between), shear, slip


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.parametrize("amount", [0.6, 2.5])
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [2]))
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("d", mostly_serial([2, 3], [2]))
@pytest.mark.parametrize("between", [False, True])
def test_a_block_sticks_and_slips_on_springs(between, d, solver, method, degree, amount):
    scene, shear, slip = uniform(amount * STICKS, d, between=between)
    assert (slip > 1e-3 * STICKS) == (amount > 1)
    domain = halves(flat_block(d, 2)) if between else flat_block(d, 2)
    error = measured(scene, domain, degree=degree, method=method, solver=solver)
    assert error.relative < 1e-9
    table = error.profile("punch" if between else "bottom")
    assert table["pressure"] == pytest.approx(PRESSURE, rel=1e-8)
    assert abs(table["shear"]) == pytest.approx(shear, rel=1e-8)
    assert abs(table["slip"]) == pytest.approx(slip, abs=1e-8 * STICKS)
    assert np.all(table["status"] == (2 if amount < 1 else 1))
    if between:
        jump = table["u_x"] - table["other_u_x"]
        assert abs(jump) == pytest.approx(0.8 ** (d - 2) * (slip + shear / K_T), rel=1e-8)
    else:
        moved = error.at(np.full(d, 0.5) * (1.0, *(0.0,) * (d - 1))).displacement[0]
        assert np.linalg.norm(moved[:-1]) == pytest.approx(slip + shear / K_T, rel=1e-8)
    # Two springs in a row, and the body between them; friction takes b on the slip.
    stored = PRESSURE**2 * (1 / K_N + 1 / E) / 2 + shear**2 * (1 / K_T + 1 / G) / 2
    # The shear of the sides does work on what the block sinks by: none together.
    energy = ec.potential_energy(error)
    assert energy.value == pytest.approx(2.0 * (stored + MU * PRESSURE * slip), rel=1e-8)


def on_springs(d: int, *, rings: bool = False) -> list[ec.Scene]:
    """A block on springs, and pressed on a foundation of their stiffness."""
    material = ec.Elastic(E, 0.3, "axisymmetric") if rings else ec.Elastic(E, 0.3)
    top = ec.Displacement("top", (0.0 if rings else 0.01, *(0.005,) * (d - 2), -0.02))
    strain = ec.ThermalStrain(1.0, lambda x: 0.01 * x[0])
    soft = ec.Contact("bottom", friction=ec.Tresca(1e9), foundation=BED)
    springs = ec.Spring("bottom", normal=K_N, tangential=K_T)
    return [
        ec.Scene(material, top, springs=springs, strains=strain),
        ec.Scene(material, top, contacts=soft, strains=strain),
    ]


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.parametrize("kind", ["plane", "space", "rings"])
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1]))
@pytest.mark.parametrize("method", TWO_METHODS)
def test_what_only_sticks_is_on_springs(method, degree, kind):
    d = 3 if kind == "space" else 2
    springs, soft = on_springs(d, rings=kind == "rings")
    domain = flat_block(3, 2) if d == 3 else plate(4)
    on_bed = measured(springs, domain, degree=degree)
    error = measured(soft, domain, degree=degree, method=method)
    assert error.relative == pytest.approx(on_bed.relative, rel=0.05)
    assert error.scale == pytest.approx(on_bed.scale, rel=1e-2)
    u, v = (e.at(np.full(d, 0.7)).displacement[0] for e in (error, on_bed))
    assert u == pytest.approx(v, abs=0.05 * error.relative * abs(v).max())
    bounds = [ec.potential_energy(e) for e in (error, on_bed)]
    assert bounds[0].value == pytest.approx(bounds[1].value, rel=2e-3)
    # On rings a given bound is sampled, and nearly zero beside the axis.
    table = error.profile("bottom")
    assert np.all(table["status"][table["x"] > (0.25 if kind == "rings" else -1.0)] == 2)


def test_error_in_the_law():
    rng = np.random.default_rng(1)
    k = rng.uniform(0.5, 2.0, (40, 30))
    b = rng.uniform(0.0, 1.0, k.shape)
    slide = rng.uniform(-2.0, 2.0, (*k.shape, 2))
    r_t = rng.uniform(-1.0, 1.0, slide.shape)
    r_t *= (b * rng.uniform(0.0, 1.0, k.shape) / np.linalg.norm(r_t, axis=-1))[..., None]
    law = slider_of(slide, r_t, b, k)
    value = law_error(law)
    # Fenchel's inequality as it stands, with Huber's function.
    length = np.linalg.norm(slide, axis=-1)
    stored = np.where(k * length <= b, k * length**2 / 2, b * length - b**2 / (2 * k))
    other = (r_t**2).sum(axis=-1) / (2 * k)
    assert value == pytest.approx(stored + other + (r_t * slide).sum(axis=-1), abs=1e-13)
    beyond = ((r_t + law.allowed) ** 2).sum(axis=-1)
    assert np.all(value >= beyond / (2 * k) - 1e-15)
    assert np.all(law_error(slider_of(slide, -law.allowed, b, k)) < 1e-15)
    # A stiff one has the term of a rigid foundation.
    rigid = b * length + (r_t * slide).sum(axis=-1)
    assert law_error(slider_of(slide, r_t, b, 1e9 * k)) == pytest.approx(rigid, abs=1e-8)


def on_bed(k, friction=0.3, k_n=None, moved=(0.01, -0.02)) -> ec.Scene:
    """A plate pressed and pushed on a foundation of tangential stiffness k."""
    bed = None if k is None else ec.Foundation(k_n, tangential=k)
    return pressed(ec.Elastic(E, 0.3), moved, friction=friction, foundation=bed)


def with_base(scene: ec.Scene) -> ec.Scene:
    """The scene of the upper half, with its contact on the lower one."""
    contact = replace(scene.contacts[0], facets="punch", against="base")
    held = ec.Displacement("bottom", (0.0, 0.0))
    return replace(scene, supports=[*scene.supports, held], contacts=contact)


@pytest.mark.parametrize("method", TWO_METHODS)
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1], [2]))
def test_limits_of_soft_and_stiff_foundations(degree, method):
    options = {"degree": degree, "method": method}
    rigid = measured(on_bed(None), plate(), **options)
    force = rigid.force("bottom").force
    distances = []
    for k, same in ((1e3 * E, 2e-3), (1e6 * E, 1e-4)):
        stiff = measured(on_bed(k), plate(), **options)
        assert stiff.relative == pytest.approx(rigid.relative, rel=same)
        distances.append(abs(stiff.force("bottom").force - force).max())
    assert distances[1] < 2e-3 * distances[0] < 2e-3 * 0.02 * abs(force).max()
    soft = measured(on_bed(1e-6 * E), plate(), **options)
    smooth = measured(on_bed(None, friction=0.0), plate(), **options)
    assert soft.relative == pytest.approx(smooth.relative, rel=1e-3)
    assert abs(soft.profile("bottom")["shear"]).max() < 1e-6 * abs(force).max()


@pytest.mark.parametrize("method", [None, ec.AugmentedLagrangian()])
@pytest.mark.parametrize(("degree", "eps"), [(1, 0.045), (2, 0.02)])
@pytest.mark.parametrize("k", [10.0, 300.0])
def test_springs_alone_hold_a_block(k, degree, eps, method):
    """Its traction balances the loads; the deflection of the springs is no slip."""
    load = ec.Traction("top", (lambda x: 0.5 + 0.15 * x[0], -5.0))
    bed = ec.Contact("bottom", friction=0.3, foundation=ec.Foundation(tangential=k))
    scene = ec.Scene(ec.Elastic(E, 0.3), loads=load, contacts=bed)
    error = measured(scene, plate(4), degree=degree, method=method)
    assert error.relative < eps
    assert error.force("bottom").force == pytest.approx([-1.3, 10.0], rel=1e-9)


@cache
def references(k, k_n, *, between) -> tuple[ec.Scene, ec.Solution, ec.ConstitutiveError]:
    """A scene with its solution, and the error, on fine meshes of degree 2."""
    stiffness = ec.table([0.0, 0.7, 2.0], [k, 2 * k, k])
    bound = (2.5 if k_n is None else 3.7) if between else 3.0
    scene = on_bed(stiffness, ec.Tresca(bound), k_n)
    if between:
        scene = with_base(scene)
    fine, less_fine = cut(48, between=between), cut(16, between=between)
    return scene, ec.solve(scene, fine, degree=2), measured(scene, less_fine, degree=2)


def cut(n: int, *, between: bool) -> ec.Domain:
    return halves(plate(n)) if between else plate(n)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("between", [False, True])
@pytest.mark.parametrize(("k", "k_n"), [(500.0, None), (2e4, 3e3)])
def test_e_bounds_true_errors(k, k_n, between, degree):
    scene, reference, finest = references(k, k_n, between=between)
    part = "punch" if between else "bottom"
    energy = ec.potential_energy(finest).value
    force = finest.force(part).force[0]
    for n in (2, 4):
        domain = cut(n, between=between)
        error = measured(scene, domain, degree=degree)
        states = set(error.profile(part)["status"])
        assert states == {1, 2} or n == 2
        assert error.oscillation < 1e-12 * error.scale
        true = true_errors(error.admissible, reference)
        assert true.both <= 1.02 * error.absolute
        assert error.absolute < 1.3 * true.both
        bounds = ec.potential_energy(error)
        assert bounds.guaranteed
        assert bounds.low <= energy <= bounds.high
        resultant = ec.resultant(error, part, (1.0, 0.0))
        assert resultant.guaranteed
        assert resultant.low <= force <= resultant.high
        certificate = ec.certify(scene, domain, lambda x: 0.9 * x, degree=degree)
        assert certificate.error.absolute > error.absolute


PUSHES = {0.5: 0.6, 1.0: 2.5, 1.5: 1.0, 2.0: -1.0}
"""Pushes over the greatest one that sticks: it sticks, slips, goes back, and slips back."""


def history(d: int = 2) -> tuple[dict[float, ec.Scene], list[tuple[float, float]]]:
    scenes, states = {}, []
    slip = 0.0
    for t, amount in PUSHES.items():
        scene, shear, slip = uniform(amount * STICKS, d, slip)
        scenes[t] = scene
        states.append((shear, slip))
    return scenes, states


@pytest.mark.parametrize("method", TWO_METHODS)
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [2], [1]))
@pytest.mark.parametrize("d", mostly_serial([2, 3], [2]))
def test_a_history_gives_back_what_springs_store(d, degree, method):
    if d == 3 and degree == 2:
        return
    scenes, states = history(d)
    # The foundation alone is loaded and unloaded; the block follows.
    assert abs(states[2][0]) < MU * PRESSURE
    assert states[3][1] < states[2][1]
    after = None
    slipped = 0.0
    for scene, (shear, slip) in zip(scenes.values(), states, strict=True):
        after = ec.solve(scene, flat_block(d, 2), degree=degree, method=method, after=after)
        error = ec.constitutive_error(ec.equilibrate(after))
        assert error.relative < 1e-8
        table = error.profile("bottom")
        assert abs(table["shear"]) == pytest.approx(abs(shear), rel=1e-7)
        assert abs(table["slip"]) == pytest.approx(abs(slip - slipped), abs=1e-7 * STICKS)
        slipped = slip


def test_dissipation_is_of_slip_alone_and_a_history_goes_on(shared_tmp_path):
    scenes, states = history()

    def run(callback=None):
        return ec.evolve(
            lambda t: scenes[t],
            flat_block(2, 2),
            list(PUSHES),
            accuracy=0.5,
            checkpoint=shared_tmp_path,
            callback=callback,
        )

    def stop(error, row):
        if row.time == 1.0:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(stop)
    whole = run()
    slips = np.array([0.0, *(slip for _, slip in states)])
    dissipated = 2.0 * MU * PRESSURE * abs(np.diff(slips))
    taken = np.array([step.dissipated for step in whole.steps])
    assert taken[1:] == pytest.approx(np.cumsum(dissipated)[1:], rel=1e-7)


@pytest.mark.broad
@pytest.mark.parametrize("between", [False, True])
def test_ranks_and_solvers(between):
    def moved_to(x, y):
        scene = on_bed(lambda x: 2e3 + 1e3 * x[0] ** 2, k_n=3e3, moved=(x, y))
        return with_base(scene) if between else scene

    part = "punch" if between else "bottom"

    def measure(comm, solver):
        domain = halves(plate(4, comm)) if between else plate(4, comm)
        after = ec.solve(moved_to(0.01, -0.02), domain, solver=solver)
        back = moved_to(-0.002, -0.02)
        return measured(back, domain, method=None, solver=solver, after=after)

    first, errors = by_ranks_and_solvers(measure)
    for error in errors:
        assert error.scale == pytest.approx(first.scale, rel=1e-9)
        shear = [e.force(part).force[0] for e in (error, first)]
        assert shear[0] == pytest.approx(shear[1], rel=1e-6)


BAD = {
    "zero": (lambda: ec.Foundation(tangential=0.0), "tangential is 0.0; give a number > 0"),
    "none": (ec.Foundation, "no stiffness"),
    "two": (lambda: ec.Foundation(1.0, stiffness=1.0), "another name of normal"),
    "smooth": (
        lambda: ec.Contact("a", foundation=ec.Foundation(tangential=1.0)),
        "has no friction",
    ),
    "negative somewhere": (
        lambda: ec.solve(on_bed(lambda x: x[0] - 1.0), plate()),
        "tangential stiffness of the foundation is -1 somewhere",
    ),
    "interval": (
        lambda: ec.interval(
            measured(on_bed(1.0, ec.Tresca(1.0)), plate()), ec.Resultant("bottom", (0.0, 1.0))
        ),
        "take ec.resultant",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_foundations_are_refused_in_words(case):
    refused(*BAD[case])


def test_what_a_scene_and_a_certificate_say():
    scene = on_bed(50.0, k_n=20.0)
    words = "foundation of normal stiffness 20.0 and tangential stiffness 50.0"
    assert words in scene._repr_html_()
    assert ec.Foundation(stiffness=20.0) == ec.Foundation(20.0)
    certificate = ec.coulomb_certificate(measured(scene, plate()))
    assert not certificate.unique
    assert "no isotropic multiple" in str(certificate)
