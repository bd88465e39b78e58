"""The certificate of Coulomb friction: every inequality of docs/coulomb.md as a number.

- the bound solves its inequality with equality, and has the closed form where the pair
  is aligned;
- W W = 0 makes the numerical radius half of the norm, and the sharpest pair of fields
  attains the bound;
- the norm of the map agrees with independent dense algebra, and has the published
  digits on the triangle;
- uniqueness is never claimed at the critical friction, where solutions are many;
- every term is above the truth of nested references; a flipped direction of slip is
  noticed;
- the bound is above the true error, and near e; it does not depend on units, on ranks
  only by round-off.
"""

import numpy as np
import pytest
from domains import partly_broad
from mpi4py import MPI
from reference import nested, true_errors
from scenes import (
    certified,
    greco,
    measured,
    patch_test,
    pressed,
    prototype_block,
    sliding_block,
)
from test_newton import Saturating

import erc_contact as ec
from erc_contact.error.coulomb.certificate import bound_of_both
from erc_contact.error.coulomb.coupling import coupling
from erc_contact.error.coulomb.other_mesh import body_on
from erc_contact.error.coulomb.slip_direction import LENGTHS, slip_fields
from erc_contact.error.coulomb.surface import pair_on_surface


def with_certificate(
    scene: ec.Scene, domain: ec.Domain, **options
) -> tuple[ec.ConstitutiveError, ec.CoulombCertificate]:
    error = measured(scene, domain, **options)
    return error, ec.coulomb_certificate(error)


def square(n: int, size: float = 40.0, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (size, size), cells=(n, n), comm=comm)


def sheared(friction: object, d: int = 2, E: object = 1.0, gap: object = 0.0) -> ec.Scene:
    """A compact body, pressed on its foundation and sheared."""
    push = (0.02, -0.05) if d == 2 else (0.02, 0.01, -0.05)
    return pressed(ec.Elastic(E, 0.3), push, friction=friction, gap=gap)


@pytest.mark.serial
def test_the_bound_solves_its_inequality():
    rng = np.random.default_rng(1)
    for _ in range(200):
        q, bulk, rest = (
            rng.uniform(0, 1.9),
            rng.uniform(0, 2),
            rng.uniform(0, 1) * rng.integers(0, 2),
        )
        e_t = bulk * rng.uniform(1, 1.5)
        x = bound_of_both(q, e_t, bulk, rest)
        s = np.sqrt(x * x / 2 - bulk**2 / 4)
        right = e_t**2 + q * (s + bulk / 2) ** 2 + 2 * rest * x
        assert abs(x * x - right) < 1e-9 * right
        assert x >= e_t
        if rest == 0 and q < 1:
            assert x <= e_t / np.sqrt(1 - q) * (1 + 1e-12)  # sharper than with |W v| <= q |v| alone
    for q in (0.0, 0.3, 1.0, 1.9):
        assert bound_of_both(q, 3.0, 3.0, 0.0) == pytest.approx(
            3 * np.sqrt(4 + q * q) / (2 - q), rel=1e-12
        )
    assert bound_of_both(2.0, 1.0, 1.0, 0.0) == np.inf
    assert bound_of_both(0.5, 0.0, 0.0, 0.0) == 0.0


@pytest.mark.serial
def test_a_map_whose_square_is_zero():
    """``(tau, W x) <= q/2 (|x + tau|/2 + |x - tau|/2)^2``, attained."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        basis, _ = np.linalg.qr(rng.standard_normal((9, 9)))
        W = np.zeros((9, 9))
        W[5:, :5] = rng.standard_normal((4, 5))
        W = basis @ W @ basis.T
        assert abs(W @ W).max() < 1e-12
        q = np.linalg.norm(W, 2)
        for x, tau in rng.standard_normal((20, 2, 9)):
            s, beta = np.linalg.norm(x + tau) / 2, np.linalg.norm(x - tau)
            assert tau @ W @ x <= q / 2 * (s + beta / 2) ** 2
        left, _, right = np.linalg.svd(W)
        x = left[:, 0] + right[0]
        assert x @ W @ x == pytest.approx(q / 2 * (x @ x))


def triangle(
    nu: float, friction: float, size: float, comm: MPI.Comm = MPI.COMM_WORLD
) -> tuple[ec.Scene, ec.Domain]:
    """The triangle whose solutions are many at friction ``sqrt((l + 2)/l)``, l = 2 nu/(1 - 2 nu)."""
    import gmsh

    E = 1.2
    G, ratio = E / 2 / (1 + nu), 2 * nu / (1 - 2 * nu)
    slope = np.sqrt(ratio * (ratio + 2))
    critical = slope / ratio
    y = slope / (ratio + 1) / (ratio + 2)
    shear = 0.1 * critical * (ratio + 2)
    if comm.rank == 0:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        geo = gmsh.model.geo
        points = [geo.addPoint(*x, 0.0, size) for x in ((0.0, 0.0), (1.0, 0.0), (slope * y, y))]
        sides = [geo.addLine(points[i], points[(i + 1) % 3]) for i in range(3)]
        surface = geo.addPlaneSurface([geo.addCurveLoop(sides)])
        geo.synchronize()
        for side, name in zip(sides, ("foot", "pulled", "held"), strict=True):
            gmsh.model.addPhysicalGroup(1, [side], name=name)
        gmsh.model.addPhysicalGroup(2, [surface], name="body")
    domain = ec.from_gmsh(gmsh.model if comm.rank == 0 else None, comm=comm)
    if comm.rank == 0:
        gmsh.finalize()
    sigma = G * np.array([[-0.1 * ratio, shear], [shear, -0.1 * (ratio + 2)]])
    n = np.array([slope, ratio + 2]) / np.hypot(slope, ratio + 2)
    scene = ec.Scene(
        ec.Elastic(E, nu),
        [ec.Displacement("held", (lambda x: 0.1 + shear * x[1], lambda x: -0.1 * x[1]))],
        [ec.Traction("pulled", tuple(float(f) for f in sigma @ n))],
        [ec.Contact("foot", friction=friction * critical)],
    )
    return scene, domain


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(("nu", "M"), [(0.2, 1.634), (0.3, 1.888)])
def test_uniqueness_ends_below_many_solutions(nu, M):
    scene, domain = triangle(nu, 0.5, 0.05)
    _, found = with_certificate(scene, domain)
    assert pytest.approx(M, abs=2e-3) == found.M
    assert found.unique
    assert found.q < 2
    many, _ = triangle(nu, 1.0, 0.05)
    error, found = with_certificate(many, domain, method=ec.Nitsche())
    assert error.solution.singular
    assert error.relative < 1e-10  # exact, and one of many
    assert pytest.approx(M, abs=2e-3) == found.M
    assert not found.unique
    assert found.bound == np.inf
    assert "Nothing is proved" in str(found)
    others = ec.other_solutions(error.solution, most=2)
    assert len(others) >= 2
    states = [error.solution.u.x.array, *(other.solution.u.x.array for other in others)]
    comm = domain.mesh.comm
    for i, one in enumerate(states):
        for other in states[:i]:
            assert comm.allreduce(float(abs(one - other).max(initial=0.0)), MPI.MAX) > 1e-4
    assert all(other.relative < 1e-9 for other in others)
    assert ec.other_solutions(ec.solve(scene, domain)) == []


CASES = {
    "GRECO 0.3": (greco(0.3), square(8), 2, {}),
    "GRECO 0.8": (greco(0.8), square(8), 2, {}),
    "block": (sheared(0.3), ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4)), 2, {}),
    "friction that varies": (sheared(lambda x: 0.1 + 0.2 * x[0]), square(4, 1.0), 2, {}),
    "gap": (sheared(0.3, gap=lambda x: 0.03 * (x[0] - 0.4) ** 2), square(4, 1.0), 2, {}),
    "degree 2": (greco(0.3), square(4), 1, {"degree": 2}),
}


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("name", CASES)
def test_every_term_is_above_the_truth(name):
    scene, domain, levels, options = CASES[name]
    error, found = with_certificate(scene, domain, **options)
    pair = error.admissible
    fine = ec.solve(
        scene, nested(domain, levels), ec.AugmentedLagrangian(), start=pair.solution, **options
    )
    true, e, bulk = true_errors(pair, fine), error.absolute, error.bulk_error
    q = found.q + found.q_change
    print(
        f"\n{name}: q {q:.3f}, bound/e {found.factor:.3f}, bound/true {found.bound / true.both:.3f}"
    )
    assert true.both <= found.bound
    assert true.displacement <= found.bound
    aligned = np.sqrt(4 + q**2) / (2 - q)
    assert found.bound <= 1.15 * aligned * e + 3 * np.hypot(found.misaligned, found.unbalanced)
    s = np.sqrt(max(true.both**2 / 2 - bulk**2 / 4, 0.0))
    rest = 2 * (found.misaligned * true.stress + found.unbalanced * true.displacement)
    assert true.both**2 <= 1.1 * e**2 + q * (s + bulk / 2) ** 2 + rest
    assert np.hypot(found.misaligned, found.unbalanced) < 0.2 * e


@pytest.mark.serial
def test_a_step_of_a_history():
    """The slip turns.

    T is along the slip since the last step, against the one from the start.
    """

    def at(push):
        return ec.Scene(
            ec.Elastic(1.0, 0.3),
            [ec.Displacement("top", (push, -0.05))],
            [],
            [ec.Contact("bottom", friction=0.3)],
        )

    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    first = ec.solve(at(0.1), domain)
    error = certified(at(-0.02), domain, after=first)
    found, pair = ec.coulomb_certificate(error), error.admissible
    fine = ec.solve(at(-0.02), nested(domain, 2), ec.AugmentedLagrangian(), after=first)
    assert (
        pair.displacement.x.array.reshape(-1, 2)[pair.tractions[0].nodes, 0].min() > 0
    )  # it has not come back
    assert slip_fields(pair_on_surface(pair))[0][:, 0].max() < 0  # but it slips back
    assert np.hypot(found.misaligned, found.unbalanced) < 0.2 * error.absolute
    assert true_errors(pair, fine).both <= found.bound < 2.5 * error.absolute


def test_bad_input(block):
    solution = ec.solve(sheared(0.3), block)
    for wrong in (0, -1, 1.5, "many"):
        with pytest.raises(ec.InputError, match="other_solutions: most"):
            ec.other_solutions(solution, wrong)
    assert ec.other_solutions(ec.solve(sheared(0.0), block)) == []


def test_a_slipping_body_leaves_nothing(block):
    """On the patch test slip and traction are opposite everywhere.

    The opposite field leaves twice the friction.
    """
    scene, _ = patch_test(0.3, 0.25)
    error, found = with_certificate(scene, block)
    assert max(found.misaligned, found.unbalanced) < 1e-6 * error.scale
    assert found.unique
    pair = pair_on_surface(error.admissible)
    t = slip_fields(pair)[0]
    forces, _ = pair.unbalanced(t)
    opposite, _ = pair.unbalanced(-t)
    friction = np.einsum("fqi->i", pair.traction)
    assert abs(forces).max() < 1e-9 * abs(opposite).max()
    assert opposite.sum(axis=0)[0] * friction[0] > 0
    assert pair.unaligned(t).max() < 1e-9 * pair.unaligned(-t).max()


@pytest.mark.parametrize("degree", [1, 2])
def test_the_work_of_what_the_field_misses(degree):
    """``e^2 - 2 int rho.w^_t = beta^2 + 2 int r^_n (w^_n - g) + 2 int |r^_n| (mu |w^_t| - t.w^_t)``, above beta^2."""
    scene = sheared(0.4)
    error = certified(scene, square(6, 1.0), degree=degree)
    pair = pair_on_surface(error.admissible)
    for t in slip_fields(pair):
        _, work = pair.unbalanced(t)
        assert error.absolute**2 - 2 * work >= error.bulk_error**2 * (1 - 1e-9)
    still = np.zeros_like(t)
    forces, work = pair.unbalanced(still)
    assert np.allclose(forces.sum(axis=0)[0], error.force("bottom").force[0], rtol=1e-9)
    assert work < 0  # friction dissipates


REFINED = {
    "strong friction": (0.76, 3.0, (10, 4), 1),
    "coarse": (0.48, 0.87, (4, 5), 1),
    "degree 2": (0.23, 1.7, (9, 5), 2),
}


@pytest.mark.on_ranks("coarse")
@pytest.mark.parametrize("name", partly_broad(REFINED, ["strong friction", "degree 2"]))
def test_the_change_of_q_holds_on_the_refined_mesh(name):
    """For the same field t; and what was claimed is not withdrawn."""
    mu, width, cells, degree = REFINED[name]
    push = -0.037 if name == "coarse" else 0.02
    scene = ec.Scene(
        ec.Elastic(lambda x: 1.2 + 0.24 * x[0] / width + 0.79 * x[1], 0.33),
        [ec.Displacement("top", (push, lambda x: 0.01 * x[0] - 0.03))],
        [ec.Traction("right", (push, 0.0))],
        [ec.Contact("bottom", friction=mu)],
    )
    domain = ec.rectangle((0.0, 0.0), (width, 1.0), cells=cells)
    error, found = with_certificate(scene, domain, degree=degree)
    surface = pair_on_surface(error.admissible)
    t = slip_fields(surface)[LENGTHS.index(found.smoothing)]
    finer = body_on(error.solution.model, domain.refined())
    q, _ = finer.norm(surface.surface, t)
    _, again = with_certificate(scene, domain.refined(), degree=degree)
    print(
        f"\n{name}: q {found.q:.4f} +- {found.q_change:.4f}, on the refined mesh {q:.4f}, factor {found.factor:.2f}"
    )
    assert q <= found.q + found.q_change
    assert again.bound < np.inf
    assert again.unique


@pytest.mark.parametrize("d", [2, 3])
def test_both_solvers_see_the_same_body(d):
    domain = square(6, 1.0) if d == 2 else ec.box((0.0,) * 3, (1.0,) * 3, cells=(3, 3, 3))
    found, norms = [], []
    for solver in ("direct", "iterative"):
        error = ec.constitutive_error(
            ec.equilibrate(ec.solve(sheared(0.3, d), domain, solver=solver))
        )
        pair = pair_on_surface(error.admissible)
        traces = error.solution.stiffness.traces(pair.surface.numbers)
        y = pair.surface.normal * (1 + pair.surface.positions()[:, :1])
        f = y[:, ::-1] * pair.surface.positions()[:, :1]
        t = np.zeros_like(y)
        t[:, 0] = 0.3
        found.append([traces.lift(y), traces.move(f)])
        norms.append(coupling(pair.surface.normal, traces, t, pair.surface.positions()).q)
        if traces.cheap:
            exact = _norm_by_columns(pair.surface, traces, t)
    for one, other in zip(*found, strict=True):
        assert np.linalg.norm(one - other) < 0.02 * np.linalg.norm(one)
    assert norms[0] == pytest.approx(exact, rel=1e-5)
    assert norms[1] == pytest.approx(exact, rel=0.03)


def _norm_by_columns(surface, traces, t):
    """The norm of W from whole matrices, column by column."""
    n, unit = surface.normal, np.eye(len(t))
    N = np.array([(traces.lift(column[:, None] * n) * n).sum(axis=1) for column in unit])
    F = np.array([(traces.move(column[:, None] * t) * t).sum(axis=1) for column in unit])
    return np.sqrt(np.linalg.eigvals(F @ N).real.max())


@pytest.mark.serial
def test_units_change_nothing():
    _, one = with_certificate(sheared(0.4), square(6, 1.0))
    _, other = with_certificate(sheared(0.4, E=210e9), square(6, 1.0))
    assert other.q == pytest.approx(one.q, rel=1e-6)
    assert other.factor == pytest.approx(one.factor, rel=1e-6)
    assert other.bound == pytest.approx(one.bound * np.sqrt(210e9), rel=1e-6)


def test_a_slender_body_that_slips_gets_no_bound():
    """Pushed far, the block slips to one side.

    Pushed little it sticks, and a smooth field has a bound of many e.
    """
    error, sticks = with_certificate(prototype_block(), block_of(8))
    pair = pair_on_surface(error.admissible)
    t = np.zeros_like(pair.surface.normal)
    t[:, 0] = 0.3
    traces = error.solution.stiffness.traces(pair.surface.numbers)
    q = coupling(pair.surface.normal, traces, t, pair.surface.positions()).q
    assert q == pytest.approx(0.3 * 7.053, rel=1e-3)  # of a body that slips to one side
    assert sticks.smoothing == 0.3
    assert 5 < sticks.factor < 20
    far = ec.Scene(
        error.solution.scene.material,
        [ec.Displacement("top", (1.0, -0.05))],
        [],
        [ec.Contact("bottom", friction=0.3)],
    )
    slips = with_certificate(far, block_of(8))[1]
    assert slips.q == pytest.approx(2.2, abs=slips.q_change)
    assert slips.q > 2
    assert not slips.unique
    assert slips.bound == np.inf
    assert slips.smoothing == 0


@pytest.mark.broad
@pytest.mark.serial
def test_round_off_is_no_work_on_a_roller():
    """A body that may move up.

    The forces of rho are tangential, and round-off along the normal is not one of them.
    """
    scene = ec.Scene(
        ec.Elastic(1.0, 0.37),
        [ec.Displacement("left", (0.0, None))],
        [ec.Traction("top", (0.0, -0.042))],
        [ec.Contact("bottom", friction=0.26, gap=lambda x: 0.013 * (x[0] - 1.65) ** 2)],
    )
    domain = ec.rectangle((0.0, 0.0), (2.913369516582126, 1.0), cells=(15, 5)).refined()
    error, found = with_certificate(scene, domain, degree=2)
    assert error.relative < 0.05
    assert found.bound < 3 * error.absolute
    assert found.unbalanced < error.absolute


def block_of(n: int) -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(n, 7 * n // 2))


def test_bodies_that_only_contact_holds_vertically():
    """GRECO can move up, which costs nothing.

    A block in 3D can also tip about its top, and slides along then.
    """
    _, held = with_certificate(greco(0.3), square(8))
    assert held.q == pytest.approx(0.3 * 1.0172, rel=1e-3)
    _, loose = with_certificate(*sliding_block(0.01, 3))
    assert loose.q == np.inf
    assert not loose.unique
    assert loose.bound == np.inf
    assert "rigidly" in str(loose)


@pytest.mark.parametrize("amount", [1e-6, 1.0, 1e6])
def test_a_body_that_can_move_up_has_its_norm_from_any_start(amount):
    """A motion off the contact costs nothing, and must not grow from step to step."""
    error = certified(greco(0.3), square(8), degree=2)
    pair = pair_on_surface(error.admissible)
    elastic = error.solution.stiffness
    with elastic.in_memory():
        traces = elastic.traces(pair.surface.numbers)
        t = slip_fields(pair)[0]
        x = pair.surface.positions()
        start = np.sin(7 * x[:, 0])
        norms = [
            coupling(pair.surface.normal, traces, t, x, start + extra).q for extra in (0.0, amount)
        ]
    assert norms[1] == pytest.approx(norms[0], rel=1e-5)


def test_other_laws():
    def scene(law):
        return ec.Scene(
            ec.Elastic(1.0, 0.3),
            [ec.Displacement("top", (0.02, -0.05))],
            [],
            [ec.Contact("bottom", friction=law)],
        )

    for law in (0.0, ec.Tresca(0.01)):
        error, found = with_certificate(scene(law), square(4, 1.0))
        assert found.q == 0
        assert found.bound == error.absolute
        assert found.unique
    _, found = with_certificate(scene(Saturating(0.3, 0.01)), square(4, 1.0))
    assert found.q == np.inf
    assert not found.unique
    assert found.bound == np.inf


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("d", "solver"),
    [(2, "direct"), pytest.param(3, "direct", marks=pytest.mark.broad), (3, "iterative")],
)
def test_ranks_change_nothing(d, solver):
    found = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        domain = (
            square(6, 1.0, comm)
            if d == 2
            else ec.box((0.0,) * 3, (1.0,) * 3, cells=(3, 3, 3), comm=comm)
        )
        found.append(with_certificate(sheared(0.3, d), domain, solver=solver)[1])
    assert found[0].q == pytest.approx(found[1].q, rel=1e-6)
    assert found[0].bound == pytest.approx(found[1].bound, rel=1e-6)


@pytest.mark.ranks
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.broad)])
def test_ranks_change_nothing_where_data_vary(seed):
    """A body that is held at a side, with moduli, friction and gap that vary.

    Its map has several norms near q.
    """
    rng = np.random.default_rng(seed)
    size, (nu, least, more, stiffer, gap) = rng.uniform(0.5, 2.0, 3), rng.uniform(0.05, 0.4, 5)
    scene = ec.Scene(
        ec.Elastic(lambda x: 1 + 10 * stiffer * x[0], nu),
        [ec.Displacement("left", (0.0, 0.0, 0.0))],
        [ec.Traction("top", (0.01, 0.0, -0.05))],
        [
            ec.Contact(
                "bottom",
                friction=lambda x: least + more * x[0] / size[0],
                gap=lambda x: 0.1 * gap * (x[0] - 0.3) ** 2,
            )
        ],
    )
    found = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        domain = ec.box((0.0,) * 3, size, cells=(4, 3, 3), comm=comm)
        found.append(with_certificate(scene, domain, solver="iterative"))
    (error, one), (alone, other) = found
    assert error.absolute == pytest.approx(alone.absolute, rel=1e-8)
    assert one.q == pytest.approx(other.q, rel=1e-6)
    assert one.bound == pytest.approx(other.bound, rel=2e-6)


def test_both_solvers_lift_jumps_below_a_loose_face():
    """The body on top is one cell high, so that its face and its contact share cells."""
    lower = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(8, 4))
    upper = ec.rectangle((0.0, 1.0), (2.0, 1.25), cells=(8, 1))
    bodies = ec.assembly({"lower": lower, "upper": upper}).joined("lower top", "upper bottom")
    plate = ec.Rigid("upper top", (0.0, None), rotation=0.0, force=(None, -0.02))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("lower bottom", (0.0, 0.0)), plate],
        contacts=ec.Contact("upper bottom", against="lower top", friction=0.3),
    )
    found = []
    for solver in ("direct", "iterative"):
        error = certified(scene, bodies, solver=solver)
        surface = pair_on_surface(error.admissible).surface
        traces = error.solution.stiffness.traces(surface.numbers)
        x = surface.positions()[:, :1]
        order = np.argsort(x[:, 0])
        forces = traces.lift(surface.normal * np.cos(3 * x))
        found.append(forces[order])
    assert np.linalg.norm(found[0] - found[1]) < 1e-4 * np.linalg.norm(found[0])
