"""Bodies that nothing holds under balanced loads.

Properties: closed forms of thick tubes and uniform stress; e is above the true error;
where nodes are anchored changes nothing; u has no mean and no moment; loads out of
balance are refused with their resultant; small differences are taken up and told.
"""

import logging
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import ufl
from bricks import NAMES, glued, small_bricks
from dolfinx import fem
from domains import refused
from free_bodies import index, random_free
from mpi4py import MPI
from scenes import certified

import erc_contact as ec
from erc_contact.model import model as models
from erc_contact.model.motions.rigid_motions import Unheld

import gmsh  # isort: skip - after erc_contact, as in all tests

COMM = MPI.COMM_WORLD
UPPER, LOWER = NAMES
E, NU = 10.0, 0.3
INNER, OUTER = 1.0, 2.0
TWO = ec.Elastic(E={"upper": 1000.0, "lower": 300.0}, nu={"upper": 0.3, "lower": 0.25})


def integral(space, density):
    form = fem.form(space.on_meridian(density) * space.dx)
    return COMM.allreduce(fem.assemble_scalar(form), MPI.SUM)


def brick(d, n=3):
    if d == 2:
        return ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2 * n, n))
    return ec.box((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), cells=(n, 2, 2))


def pulled(d, pull=0.1):
    """A bar between two opposite forces."""
    rest = (0.0,) * (d - 1)
    loads = [ec.Traction("right", (pull, *rest)), ec.Traction("left", (-pull, *rest))]
    return ec.Scene(ec.Elastic(E, NU), loads=loads)


@cache
def ring(size=0.35):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    occ = gmsh.model.occ
    outer, inner = ([(2, occ.addDisk(0, 0, 0, r, r))] for r in (OUTER, INNER))
    occ.cut(outer, inner)
    occ.synchronize()
    parts = {
        "outside": lambda x: np.hypot(x[0], x[1]) > 0.99 * OUTER,
        "inside": lambda x: np.hypot(x[0], x[1]) < 1.01 * INNER,
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    return domain


def squeezed_pair(d, friction):
    rest = (0.0,) * (d - 1)
    loads = [ec.Traction("upper outer", (*rest, -3.0)), ec.Traction("lower outer", (*rest, 3.0))]
    return ec.Scene(TWO, [], loads, [ec.Contact(UPPER, against=LOWER, friction=friction)])


# -- closed forms
# -------------------------------------------------------------------------------------


@pytest.mark.pairs
@pytest.mark.on_ranks("2-1-direct", "3-2-iterative")
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_a_bar_between_two_forces(d, degree, solver):
    """The stress is uniform, and u is known with its mean and its rotation: zero."""
    error = certified(pulled(d), brick(d), degree=degree, solver=solver)
    assert error.relative < 1e-8
    strain = 0.1 * (1.0 - NU**2) / E if d == 2 else 0.1 / E
    assert ec.potential_energy(error).value == pytest.approx(-0.1 * strain, rel=1e-9)
    ends = error.solution.at([[2.0, *(0.5,) * (d - 1)], [0.0, *(0.5,) * (d - 1)]])
    assert ends.displacement[:, 0] == pytest.approx([strain, -strain], rel=1e-7)
    assert abs(ends.displacement[:, 1:]).max() < 1e-8 * strain


@pytest.mark.parametrize("load", ["pressure", "callable"])
@pytest.mark.parametrize(
    "strategy",
    [ec.Mark(), pytest.param(ec.SizeMap(), marks=pytest.mark.broad)],
    ids=["marks", "sizes"],
)
def test_a_ring_under_internal_pressure(strategy, load):
    """Lame's thick tube; a traction by a formula is not in balance on polygons."""
    p = 0.2
    of_load = {"pressure": p}
    if load == "callable":
        of_load = {"value": (lambda x: p * x[0] / INNER, lambda x: p * x[1] / INNER)}
    scene = ec.Scene(ec.Elastic(E, NU), loads=ec.Traction("inside", **of_load))
    run = ec.adapt(scene, ring(), accuracy=0.06, strategy=strategy)
    plane_E, plane_nu = E / (1 - NU**2), NU / (1 - NU)
    ratio = (OUTER**2 + INNER**2) / (OUTER**2 - INNER**2)
    exact = -np.pi * (p * INNER) ** 2 / plane_E * (ratio + plane_nu)
    energy = ec.potential_energy(run)
    assert energy.low < exact < energy.high
    assert run.error.admissible.imbalance < 1e-11
    r = 1.2
    share = INNER**2 / (OUTER**2 - INNER**2)
    moved = p / plane_E * share * ((1 - plane_nu) * r + (1 + plane_nu) * OUTER**2 / r)
    normals = np.array([[np.cos(t), np.sin(t)] for t in (0.4, 2.0, 4.5)])
    radial = (run.error.solution.at(r * normals).displacement * normals).sum(axis=1)
    assert radial == pytest.approx(moved, rel=0.02)


@pytest.mark.parametrize("degree", [1, 2])
def test_rings_are_free_along_their_axis(degree):
    rings = ec.Elastic(E, NU, hypothesis="axisymmetric")
    loads = [ec.Traction("top", (0.0, 0.3)), ec.Traction("bottom", (0.0, -0.3))]
    domain = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(3, 6))
    error = certified(ec.Scene(rings, loads=loads), domain, degree=degree)
    assert error.relative < 1e-8
    ends = error.solution.at([[0.5, 2.0], [0.5, 0.0]])
    assert ends.displacement[:, 1] == pytest.approx([0.3 / E, -0.3 / E], rel=1e-8)


@pytest.mark.pairs
@pytest.mark.on_ranks("2-1-N-direct", "2-2-A-iterative", "3-1-A-iterative")
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()], ids=["N", "A"])
@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_two_bodies_pressed_on_each_other(d, degree, method, solver):
    """Without friction all stress is uniform; they may slide along each other, too."""
    error = certified(squeezed_pair(d, 0.0), small_bricks(d), method, degree=degree, solver=solver)
    assert error.relative < 1e-7
    assert error.force(UPPER).force[-1] == pytest.approx(6.0 if d == 2 else 12.0, rel=1e-9)
    count = 4 if d == 2 else 9
    assert len(error.model.unheld.functions) == count
    rubbed = certified(squeezed_pair(d, 0.3), small_bricks(d), method, degree=degree, solver=solver)
    assert len(rubbed.model.unheld.functions) == (3 if d == 2 else 6)
    balance = rubbed.reactions()["balance"]
    assert max(abs(balance.force).max(), abs(np.asarray(balance.moment)).max()) < 1e-8


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("seed", range(12))
def test_e_is_above_both_true_errors(seed):
    """Random stresses in equilibrium pull on all sides; ``benchmarks/free_bodies.py`` has more."""
    assert index(random_free(np.random.default_rng(seed), seed)) > 1.0 - 1e-8


# -- what is known, and what is not
# -------------------------------------------------------------------------------------


def elsewhere(unheld: Unheld, space, fixed, contacts) -> np.ndarray:
    """Anchors at other vertices, that resist the motions as well."""
    values = np.stack([q.x.array.reshape(-1, space.d) for q in unheld.functions], axis=2)
    at_contact = [[]]
    for contact in contacts:
        at_contact.append(contact.trace.here.nodes.ravel())
        if contact.against is not None:
            at_contact.append(contact.trace.partners.ravel())
    vertices = np.setdiff1d(space.vertices, np.concatenate(at_contact))
    rng = np.random.default_rng(5)
    for _ in range(100):
        nodes = rng.choice(vertices, values.shape[2], replace=False)
        components = rng.integers(0, space.d, values.shape[2])
        anchors = np.zeros(fixed.shape, dtype=bool)
        anchors[nodes, components] = True
        if np.linalg.cond(values[nodes, components]) < 50 and not (anchors & fixed).any():
            return anchors
    raise AssertionError("no anchors")


@pytest.mark.pairs
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
@pytest.mark.parametrize("kind", ["bar", "pair", "block on a plane"])
def test_any_minimal_supports_give_the_same(kind, d, degree, monkeypatch):
    """u, stresses, energy, forces and e are the same to 1e-9, wherever nodes are held."""
    z = (0.0,) * (d - 2)
    bent = lambda x: 0.05 * (x[d - 1] - 0.5) ** 3  # noqa: E731
    if kind == "pair":
        scene, domain = squeezed_pair(d, 0.3), small_bricks(d)
    else:
        loads = [
            ec.Traction("right", (bent, *z, 0.0)),
            ec.Traction("left", (_minus(bent), *z, 0.0)),
        ]
        contacts = []
        if kind != "bar":
            loads.append(ec.Traction("top", (0.0, *z, -0.05)))
            contacts = [ec.Contact("bottom")]
        scene = ec.Scene(ec.Elastic(E, NU), [], loads, contacts)
        domain = brick(d)
    one = certified(scene, domain, degree=degree)
    find = models.find_unheld

    def find_elsewhere(space, bodies, motions, fixed, by_all, contacts):
        unheld = find(space, bodies, motions, fixed, by_all, contacts)
        return replace(unheld, anchors=elsewhere(unheld, space, fixed, contacts))

    monkeypatch.setattr(models, "find_unheld", find_elsewhere)
    other = certified(scene, domain, degree=degree)
    assert (one.model.unheld.anchors != other.model.unheld.anchors).any()
    u = one.solution.u.x.array
    assert abs(other.solution.u.x.array - u).max() < 1e-9 * abs(u).max()
    stress = one.admissible.stress
    assert abs(other.admissible.stress - stress).max() < 1e-9 * abs(stress).max()
    for number in ("absolute", "scale"):
        assert getattr(other, number) == pytest.approx(getattr(one, number), rel=1e-9)


def _minus(value):
    return lambda x: -value(x)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", ["pulled", "sheared pair"])
def test_u_has_no_mean_and_no_moment(kind, degree):
    scene, domain = pulled(2), brick(2)
    if kind != "pulled":
        scene, domain = squeezed_pair(2, 0.3), small_bricks(2)
    solution = ec.solve(scene, domain, degree=degree)
    model, u, x = solution.model, solution.u, ufl.SpatialCoordinate(domain.mesh)
    size = max(COMM.allgather(float(abs(u.x.array).max(initial=0.0))))
    for density in (u[0], u[1], x[0] * u[1] - x[1] * u[0]):
        assert abs(integral(model.space, density)) < 1e-12 * size * 10.0


@pytest.mark.broad
def test_a_history_of_two_free_bodies():
    """Pressed, then turned by shear: friction counts from the step before."""
    domain = small_bricks(2)

    def scene(t):
        base = squeezed_pair(2, 0.3)
        couple = [
            ec.Traction("upper outer", (0.4 * t, 0.0)),
            ec.Traction("lower outer", (-0.4 * t, 0.0)),
            *(ec.Traction(f"{body} right", (0.0, 0.4 * t)) for body in ("upper", "lower")),
            *(ec.Traction(f"{body} left", (0.0, -0.4 * t)) for body in ("upper", "lower")),
        ]
        return replace(base, loads=(*base.loads, *couple))

    last = None
    for t in (0.0, 0.5, 1.0, 0.2):
        solution = ec.solve(scene(t), domain, after=last)
        error = ec.constitutive_error(ec.equilibrate(solution))
        assert error.admissible.imbalance < 1e-11
        alone = ec.solve(scene(t), domain, ec.AugmentedLagrangian())
        size = max(COMM.allgather(float(abs(alone.u.x.array).max(initial=0.0))))
        last = solution
        model, u = solution.model, solution.u
        assert abs(integral(model.space, u[0])) + abs(integral(model.space, u[1])) < 1e-11 * size


def test_free_bodies_beside_others():
    """The bar beside a held body is as it is alone, and is named."""
    held = ec.Displacement("lower outer", (0.0, 0.0))
    loads = [ec.Traction("upper left", (-0.7, 0.0)), ec.Traction("upper right", (0.7, 0.0))]
    scene = ec.Scene(TWO, held, [*loads, ec.Traction("lower right", (0.1, 0.0))])
    error = certified(scene, glued(2, (4, 2)).split({UPPER: "upper", LOWER: "lower"}))
    unheld = error.model.unheld
    assert len(unheld.functions) == 3
    assert "'upper outer'" in unheld.words
    assert "'lower outer'" not in unheld.words
    assert error.admissible.imbalance < 1e-12


def test_swelling_bodies_and_self_stress():
    """A strain that is curved leaves a stress of its own; a free expansion leaves none."""
    swollen = ec.Scene(ec.Elastic(E, NU), strains=ec.Eigenstrain(0.01))
    assert certified(swollen, brick(2)).scale == 0.0
    curved = ec.Scene(ec.Elastic(E, NU), strains=ec.Eigenstrain(lambda x: 0.01 * x[1] ** 2))
    coarse, fine = (ec.adapt(curved, brick(2), accuracy=a, degree=2) for a in (0.2, 0.05))
    assert fine.error.absolute < coarse.error.absolute
    assert fine.error.admissible.imbalance < 1e-11


# -- balance
# -------------------------------------------------------------------------------------


def test_loads_out_of_balance_are_told_with_their_resultant():
    loads = [ec.Traction("right", (0.1, 0.0)), ec.Traction("top", (-0.1, 0.0))]
    words = ("rotation in the plane xy", "force of (-0.1, 0)", "moment of 0.1 about (1, 0.5)")
    scene = ec.Scene(ec.Elastic(E, NU), loads=loads)
    refused(lambda: ec.solve(scene, brick(2)), *words, error=ec.NotHeldError)
    loads = [ec.Traction("right", (0.0, 0.0, 0.2)), ec.Traction("left", (0.0, 0.0, -0.2))]
    scene = ec.Scene(ec.Elastic(E, NU), loads=loads)
    words = ("force of (0, 0, 0)", "moment of (0, -0.4, 0) about (1, 0.5, 0.5)")
    refused(lambda: ec.solve(scene, brick(3)), *words, error=ec.NotHeldError)
    pushed = squeezed_pair(2, 0.0)
    more = ec.Traction("upper right", (0.5, 0.0))
    pushed = replace(pushed, loads=(*pushed.loads, more))
    words = ("1 motion along each other", "force of (0.5, 0)")
    refused(lambda: ec.solve(pushed, small_bricks(2)), *words, error=ec.NotHeldError)


def test_forces_along_a_joint_without_friction_are_told_by_body():
    """They have no resultant, but nothing holds the bodies along each other."""
    scene = squeezed_pair(2, 0.0)
    couple = [ec.Traction("upper left", (0.2, 0.0)), ec.Traction("lower left", (-0.2, 0.0))]
    arms = [ec.Traction("upper right", (0.0, 0.1)), ec.Traction("upper left", (0.0, -0.1))]
    scene = replace(scene, loads=(*scene.loads, *couple, *arms))
    domain = small_bricks(2)
    model = ec.solve(squeezed_pair(2, 0.0), domain).model
    assert len(model.unheld.functions) == 4
    words = (
        "not in balance",
        "on the body with 'upper contact'",
        "on the body with 'lower contact'",
    )
    refused(lambda: ec.solve(scene, domain), *words, error=ec.NotHeldError)


@pytest.mark.parametrize("size", [1.0, 7.0, 3e-3])
def test_round_off_along_a_contact_without_friction_is_balance(size):
    """A couple on the upper side has tractions up and down, and 1e-19 of them sideways."""
    block = ec.rectangle((0.0, 0.0), (size, size), cells=(3, 3))
    force = 5e-3 * size
    pressed = ec.RemoteForce("top", (0.0, -force), moment=0.05 * force * size)
    scene = ec.Scene(ec.Elastic(1.0, 0.14), loads=pressed, contacts=ec.Contact("bottom"))
    solution = ec.solve(scene, block, degree=2)
    assert np.allclose(solution.force("bottom").force, (0.0, force), rtol=1e-9, atol=1e-12 * force)


@pytest.mark.parametrize("degree", [1, 2])
def test_what_files_round_is_taken_up_and_told_once(degree, caplog):
    caplog.set_level(logging.WARNING, logger="erc_contact")
    scene = pulled(2)
    rounded = [scene.loads[0], ec.Traction("left", (-0.1000001, 0.0))]
    run = ec.adapt(
        replace(scene, loads=rounded),
        brick(2),
        accuracy=1e-12,
        degree=degree,
        max_steps=2,
        strategy=ec.Uniform(),
    )
    assert run.error.admissible.imbalance < 1e-11
    told = [record.getMessage() for record in caplog.records if "holds" in record.getMessage()]
    assert len(told) == (1 if COMM.rank == 0 else 0)
    for words in told:
        assert "force of (-1e-07, 0)" in words
        assert "(5e-07 of them)" in words
    exact = ec.solve(scene, run.error.solution.domain, degree=degree)
    change = run.error.solution.u.x.array - exact.u.x.array
    assert abs(change).max(initial=0.0) < 1e-5 * 0.01
    worse = [scene.loads[0], ec.Traction("left", (-0.10001, 0.0))]
    refused(
        lambda: ec.solve(replace(scene, loads=worse), brick(2)),
        "force of (-1e-05, 0)",
        error=ec.NotHeldError,
    )


@pytest.mark.parametrize("degree", [1, 2])
def test_body_forces_that_vary_are_balanced_by_their_projections(degree):
    """At degree 1 a cell represents its mean, whose moment is another one."""
    scene = ec.Scene(ec.Elastic(E, NU), loads=ec.BodyForce((lambda x: (x[0] - 1.0) ** 3, 0.0)))
    coarse, fine = (certified(scene, brick(2, n), degree=degree) for n in (3, 12))
    assert max(coarse.admissible.imbalance, fine.admissible.imbalance) < 1e-11
    energies = [ec.potential_energy(error) for error in (coarse, fine)]
    assert energies[0].low < energies[1].low < energies[1].high < energies[0].high
    if degree == 1:
        assert fine.oscillation < 0.1 * coarse.oscillation


def test_goals_that_depend_on_the_motion_are_refused():
    error = certified(pulled(2), brick(2))
    for goal in (
        ec.MeanDisplacement("right", (1.0, 0.0)),
        ec.Functional(ec.Traction("right", (1.0, 0.0))),
    ):
        refused(lambda: ec.interval(error, goal), "nothing holds", "in balance")  # noqa: B023
    known = ec.Functional(ec.BodyForce((lambda x: x[0] - 1.0, 0.0)))
    number = ec.interval(error, known)
    # int (x - 1)^2 strain over the bar
    assert number.value == pytest.approx(0.1 * (1.0 - NU**2) / E * 2 / 3, rel=1e-3)
    pair = certified(squeezed_pair(2, 0.3), small_bricks(2))
    assert ec.interval(pair, ec.Resultant(UPPER, (0.0, 1.0))).value == pytest.approx(6.0)


def test_a_given_displacement_of_a_free_body_is_taken_as_it_is():
    scene, domain = pulled(2), brick(2)
    u = ec.solve(scene, domain).u
    moved = u.copy()
    moved.x.array.reshape(-1, 2)[:] += [3.0, -1.0]
    for given in (u, moved):
        assert ec.certify(scene, domain, given).error.relative < 1e-8


def test_ranks_raise_what_loads_lack_together():
    scene = ec.Scene(ec.Elastic(E, NU), loads=ec.Traction("right", (0.1, 0.0)))
    refused(
        lambda: ec.adapt(scene, brick(2), accuracy=0.1), "not in balance", error=ec.NotHeldError
    )
