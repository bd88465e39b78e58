"""Materials with a convex potential: plasticity with hardening, and laws of the user's own.

- A quadratic potential gives what :class:`Elastic` gives, to 1e-9.
- ``J(u^) + J*(sigma^) = e^2/2``, and e is never less than that.
- The exact energy lies in the interval of the energy: e bounds the errors of energy of u^ and of sigma^.
- A thick tube under pressure against its ordinary differential equation.
- Newton's method takes few steps, and converges quadratically at the end.
- Laws that are no pair of a convex function and its conjugate are refused; so is what needs a linear law.
"""

import dataclasses
from itertools import product

import gmsh
import numpy as np
import pytest
from domains import refused
from energies import energies_of_law
from laws import Fibres, Quadratic, TwoModuli
from mpi4py import MPI
from scenes import certified, pressed

import erc_contact as ec
from erc_contact.error.laws import UNKNOWN_SHARE
from erc_contact.error.load_work import load_work
from erc_contact.error.works import friction_work, stress_work
from erc_contact.model.law.point_law import Search

COMM = MPI.COMM_WORLD
STEEL = ec.Plastic(E=1.0, nu=0.3, yield_stress=0.01, hardening=0.05)


def slab(d, cells=None):
    """A slab (0, 2) x (0, 1), in 3D of depth 1."""
    if d == 2:
        return ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=cells or (6, 3))
    return ec.box((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), cells=cells or (3, 2, 2))


def vector(d, along, press):
    return (along, press) if d == 2 else (along, 0.5 * along, press)


def pushed_slab(material, d, friction=0.0, **entries):
    """A slab that is pressed on its foundation and pushed along it."""
    scene = pressed(material, vector(d, 0.004, -0.03), friction=friction)
    return dataclasses.replace(scene, **entries)


def misfits(solution):
    """The misfits of the steps of the law, as the solution tells them."""
    return [float(one) for one in solution.reason.split("misfits of the law: ")[1].split(", ")]


# -- linear elasticity through the door of potentials
# -------------------------------------------------------------------------------------


@pytest.mark.on_ranks("2-1-Nitsche", "3-1-AugmentedLagrangian")
@pytest.mark.pairs
@pytest.mark.parametrize("method", [ec.Nitsche, ec.AugmentedLagrangian])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_a_quadratic_potential_is_linear_elasticity(d, degree, method):
    errors = []
    for material in (ec.Elastic(1.0, 0.3), Quadratic(1.0, 0.3)):
        scene = pushed_slab(material, d, friction=0.3)
        errors.append(certified(scene, slab(d), method(), degree=degree))
    linear, convex = errors
    assert misfits(convex.solution)[0] < 1e-12
    assert convex.solution.newton_steps == linear.solution.newton_steps
    assert convex.relative == pytest.approx(linear.relative, rel=1e-9)
    assert convex.force("bottom").force == pytest.approx(linear.force("bottom").force, rel=1e-9)
    assert convex.maximum("von Mises").value == pytest.approx(
        linear.maximum("von Mises").value, rel=1e-9
    )
    energies = [ec.potential_energy(error) for error in errors]
    assert energies[1].value == pytest.approx(energies[0].value, rel=1e-8)
    assert energies[1].low == pytest.approx(energies[0].low, rel=1e-8)


@pytest.mark.broad
def test_a_quadratic_potential_that_varies_in_cells():
    """Moduli by a callable of x: the same numbers as by the linear law."""
    errors = []
    for kind in (ec.Elastic, Quadratic):
        scene = pushed_slab(kind(lambda x: 1.0 + x[0] * x[1], 0.3), 2)
        errors.append(certified(scene, slab(2)))
    # Each e^2 contains what its integral leaves unknown, up to this share of it.
    assert errors[1].relative == pytest.approx(errors[0].relative, rel=UNKNOWN_SHARE / 2)
    forces = [error.force("bottom").force for error in errors]
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)


# -- identities and bounds
# -------------------------------------------------------------------------------------


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(
    ("d", "degree", "friction"),
    # In 3D friction adds a term to what a smooth contact has.
    [*product((2,), (1, 2), (0.0, ec.Tresca(0.002))), (3, 1, ec.Tresca(0.002))],
)
def test_energies_add_up_to_the_error(d, degree, friction):
    """By one rule in all sub-simplices for psi and psi*, and by the integrals of the package."""
    load = ec.Traction("right", vector(d, 0.003, 0.001))
    error = certified(pushed_slab(STEEL, d, friction, loads=load), slab(d), degree=degree)
    pair, model = error.admissible, error.model
    psi, psi_star = energies_of_law(error)
    loads = load_work(model, pair.displacement).value
    unknown = 1e-3 * error.contact_error**2
    of_friction = sum(
        friction_work(model.space, t, pair.displacement, unknown / 100).value
        for t in pair.tractions
    )
    supports = float(error.force("top").force @ np.array(vector(d, 0.004, -0.03)))
    J, J_star = psi - loads + of_friction, psi_star - supports
    gap = psi + psi_star - stress_work(pair, pair.displacement).value
    half = gap + error.contact_error**2 / 2
    # Of the contact part, too, a little is unknown.
    assert abs(J + J_star - half) < 1e-12 * (abs(J) + abs(J_star)) + unknown
    # The integrals of the package add to e^2 what they leave unknown.
    assert half < error.absolute**2 / 2 < 1.0011 * half
    assert ec.potential_energy(error).value == pytest.approx(J, abs=1e-3 * half)
    assert 2 * (psi + psi_star + psi + psi_star - gap) == pytest.approx(error.scale**2, rel=1e-3)


SEEDS = [0, 1, 3, 4, 5, 6, 7, 9, 10, 14, 18]
"""Each law in the plane with each degree; the first slab is in 3D."""


def random_scene(seed):
    """A slab of a random law, hardening 1% to 100%, smooth or with Tresca friction, with or without gap and load."""
    rng = np.random.default_rng(seed)
    d = 2 if seed % 8 else 3
    degree = 1 + seed % 2 if d == 2 else 1
    laws = [
        ec.Plastic(1.0, rng.uniform(0.0, 0.45), 0.01, 10 ** rng.uniform(-2, 0)),
        TwoModuli(1.0, 0.4, 10 ** rng.uniform(-2, 0)),
        Fibres(1.0, 10 ** rng.uniform(-1, 1)),
    ]
    law = laws[max(0, seed % 5 - 2)] if d == 2 else laws[0]
    curvature = rng.uniform(0.0, 0.01) * (seed % 3)
    contact = ec.Contact(
        "bottom",
        friction=ec.Tresca(10 ** rng.uniform(-4, -2)) if seed % 2 else 0.0,
        gap=(lambda x: curvature * x[0] ** 2) if curvature else 0.0,
    )
    top = ec.Displacement("top", vector(d, rng.uniform(-0.02, 0.02), -rng.uniform(0.005, 0.04)))
    loads = [ec.Traction("right", tuple(0.003 * rng.normal(size=d)))] if seed % 3 == 1 else []
    return ec.Scene(law, top, loads, contact), d, degree


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("seed", SEEDS)
def test_the_exact_energy_lies_in_the_interval(seed):
    """So e^2/2 is above the errors of energy of u^ and of sigma^, hence e above both Bregman distances."""
    scene, d, degree = random_scene(seed)
    domain = slab(d, (4, 2) if d == 2 else (2, 1, 1))
    error = certified(scene, domain, degree=degree)
    # In 3D, degree 2 on the same cells tells enough.
    reference = certified(scene, domain.refined().refined() if d == 2 else domain, degree=2)
    assert reference.absolute < error.absolute
    bounds, exact = ec.potential_energy(error), ec.potential_energy(reference)
    # The exact energy is between both ends of the reference.
    assert bounds.low <= exact.high
    assert exact.low <= bounds.high
    # Without a reference: the finer displacement has less energy, the finer stress more.
    assert exact.high <= bounds.high
    for solution in (error.solution, reference.solution):
        assert len(misfits(solution)) <= 12


def test_newton_converges_quadratically():
    error = certified(pushed_slab(STEEL, 2), slab(2, (12, 6)))
    *_, before, last, end = misfits(error.solution)
    assert last < 100 * before**2
    assert end < 1e-10


def test_a_step_that_goes_too_far_is_shortened():
    """Little hardening and large strains: full steps alone would go back and forth."""
    soft = dataclasses.replace(STEEL, hardening=1e-4)
    scene = ec.Scene(soft, ec.Displacement("top", (0.3, -0.2)), contacts=ec.Contact("bottom"))
    solution = ec.solve(scene, slab(2))
    assert misfits(solution)[-1] < 1e-8


# -- a thick tube
# -------------------------------------------------------------------------------------

INNER, OUTER = 1.0, 2.0
CURVE = ec.HardeningCurve([0.0, 0.003, 0.01, 0.03], [0.01, 0.0104, 0.0106, 0.0112])
"""Two convex parts between concave ones, which the wall of the tube goes through."""


def points_of_hardening(law):
    """Plastic strains and yield stresses of a law, also far beyond its curve."""
    if isinstance(law.hardening, ec.HardeningCurve):
        a, k = (np.array(row) for row in (law.hardening.plastic_strain, law.hardening.stress))
        return np.append(a, 10.0), np.append(k, k[-1] + 0.1 * k[0] * (10.0 - a[-1]))
    return np.array([0.0, 10.0]), law.yield_stress + law.hardening * np.array([0.0, 10.0])


def principal_law(strain, law):
    """Stress and tangent for principal strains (n, 3), by the return to the yield surface."""
    G, K = law.E / (2 * (1 + law.nu)), law.E / (3 * (1 - 2 * law.nu))
    deviator = strain - strain.mean(axis=1, keepdims=True)
    size = np.linalg.norm(deviator, axis=1)
    trial = np.sqrt(6) * G * size
    # The plastic strain a at which the trial stress 3 G a + k(a) is reached, by its table.
    a, k = points_of_hardening(law)
    plastic = np.interp(trial, 3 * G * a + k, a)
    slope = np.append(np.diff(k) / np.diff(a), 0.0)[np.searchsorted(a, plastic, side="right") - 1]
    share = 3 * G * plastic / np.maximum(trial, law.yield_stress)
    stress = 3 * K * strain.mean(axis=1, keepdims=True) + 2 * G * (1 - share)[:, None] * deviator
    projector = np.eye(3) - 1 / 3
    n = deviator / np.maximum(size, 1e-300)[:, None]
    drop = np.where(plastic > 0, 6 * G**2 / (3 * G + slope) - 2 * G * share, 0.0)
    tangent = K * np.ones((3, 3)) + (2 * G * (1 - share))[:, None, None] * projector
    return stress, tangent - drop[:, None, None] * n[:, :, None] * n[:, None, :]


def tube_displacement(law, pressure, count=2000):
    """Radial displacement of both walls: ``(r s_r)' = s_t``, by quadratic elements along r."""
    points, weights = np.polynomial.legendre.leggauss(3)
    nodes = np.linspace(INNER, OUTER, 2 * count + 1)
    h = (OUTER - INNER) / count
    dofs = 2 * np.arange(count)[:, None] + np.arange(3)
    N = np.stack([points * (points - 1) / 2, 1 - points**2, points * (points + 1) / 2], axis=1)
    dN = np.stack([points - 0.5, -2 * points, points + 0.5], axis=1) * 2 / h
    r = nodes[dofs] @ N.T
    B = np.zeros((count, 3, 3, 3))  # element, point, component, node
    B[:, :, 0] = dN
    B[:, :, 1] = N / r[..., None]
    w = r * weights * h / 2
    u = np.zeros(len(nodes))
    load = np.zeros(len(nodes))
    load[0] = pressure * INNER
    for _ in range(50):
        strain = np.einsum("eqci,ei->eqc", B, u[dofs]).reshape(-1, 3)
        stress, tangent = (a.reshape(count, 3, *a.shape[1:]) for a in principal_law(strain, law))
        force = np.zeros(len(nodes))
        np.add.at(force, dofs, np.einsum("eqci,eqc,eq->ei", B, stress, w))
        if np.abs(load - force).max() < 1e-13 * pressure:
            break
        of_elements = np.einsum("eqci,eqcd,eqdj,eq->eij", B, tangent, B, w)
        band = np.zeros((5, len(nodes)))
        for i in range(3):
            for j in range(3):
                np.add.at(band[2 + i - j], dofs[:, j], of_elements[:, i, j])
        from scipy.linalg import solve_banded

        u += solve_banded((2, 2), band, load - force)
    return u[0], u[-1]


def quarter_tube(size):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    occ = gmsh.model.occ
    outer, inner = ([(2, occ.addDisk(0, 0, 0, r, r))] for r in (OUTER, INNER))
    whole, _ = occ.cut(outer, inner)
    occ.intersect(whole, [(2, occ.addRectangle(0, 0, 0, OUTER, OUTER))])
    occ.synchronize()
    parts = {
        "outside": lambda x: np.hypot(x[0], x[1]) > 0.99 * OUTER,
        "inside": lambda x: np.hypot(x[0], x[1]) < 1.01 * INNER,
        "left": lambda x: x[0] < 1e-9,
        "bottom": lambda x: x[1] < 1e-9,
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    return domain


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("hardening", [0.05, CURVE], ids=["linear", "curve"])
def test_a_thick_tube_under_pressure(hardening):
    """Half of the wall is plastic; the walls move as the differential equation says."""
    yield_stress = None if hardening is CURVE else 0.01
    law = ec.Plastic(E=1.0, nu=0.3, yield_stress=yield_stress, hardening=hardening)
    pressure = 0.008
    inner, outer = tube_displacement(law, pressure)
    assert tube_displacement(law, pressure, 1000)[0] == pytest.approx(inner, rel=1e-7)
    elastic = ec.Plastic(E=1.0, nu=0.3, yield_stress=1.0, hardening=0.05)
    assert inner > 1.3 * tube_displacement(elastic, pressure)[0], "a good part is plastic"
    scene = ec.Scene(
        law,
        [ec.Symmetry("left"), ec.Symmetry("bottom")],
        ec.Traction("inside", pressure=pressure),
    )
    history = ec.adapt(scene, quarter_tube(0.15), accuracy=0.01, degree=2)
    assert history.reached
    moved = history.solution.at([[INNER, 0.0], [OUTER, 0.0]]).displacement[:, 0]
    assert moved == pytest.approx([inner, outer], rel=1e-3)


# -- two bodies, ranks, what a run keeps
# -------------------------------------------------------------------------------------


def history(comm, degree, method=None):
    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2), comm=comm)
    contact = ec.Contact("bottom", friction=0.3, gap=lambda x: 0.005 * x[0] ** 2)
    scene = ec.Scene(STEEL, ec.Displacement("top", (0.001, -0.02)), contacts=contact)
    return ec.adapt(scene, domain, 1e-6, degree=degree, method=method, max_steps=3)


def two_regions(first, second):
    """A slab in two halves, each of a material of its own, pressed."""
    halves = {"left": ec.where(x=(None, 1.0)), "right": ec.where(x=(1.0, None))}
    scene = pushed_slab({"left": first, "right": second}, 2, friction=0.2)
    return scene, slab(2).named(regions=halves)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("plastic_first", [True, False])
def test_an_elastic_region_is_a_law_with_no_yield(plastic_first):
    """As with a yield stress far above all stresses, to round-off."""
    soft = ec.Plastic(1.0, 0.3, yield_stress=0.005, hardening=0.05)
    never = ec.Plastic(2.0, 0.2, yield_stress=1e3, hardening=1e3)
    found = []
    for elastic in (ec.Elastic(2.0, 0.2), never):
        pair = (soft, elastic) if plastic_first else (elastic, soft)
        error = certified(*two_regions(*pair))
        energy = ec.potential_energy(error)
        found.append([error.absolute, energy.low, energy.high, error.displacement_error])
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    refused(lambda: two_regions(soft, Quadratic(1.0, 0.3)), "all of one class", "of_elastic")
    refused(lambda: two_regions(soft, ec.Elastic(1.0, 0.3, hypothesis="plane stress")), "plane")


@pytest.mark.ranks
@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()])
@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_ranks(degree, method):
    alone, together = (history(comm, degree, method) for comm in (MPI.COMM_SELF, COMM))
    for a, b in zip(alone.steps, together.steps, strict=True):
        assert (a.cells, a.newton_steps) == (b.cells, b.newton_steps)
        assert a.eps == pytest.approx(b.eps, rel=1e-8)
    energies = [ec.potential_energy(run) for run in (alone, together)]
    assert energies[0].value == pytest.approx(energies[1].value, rel=1e-9)


@pytest.mark.ranks
@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_ranks_without_cells(degree):
    """Two cells on any number of ranks: some ranks have nothing to integrate."""
    eps = []
    for comm in (MPI.COMM_SELF, COMM):
        domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1), comm=comm)
        eps.append(certified(pushed_slab(STEEL, 2), domain, degree=degree).relative)
    assert eps[0] == pytest.approx(eps[1], rel=1e-8)


@pytest.mark.broad
def test_multigrid_finds_the_same():
    direct, iterative = (
        certified(pushed_slab(STEEL, 3), slab(3), solver=solver)
        for solver in ("direct", "iterative")
    )
    assert iterative.relative == pytest.approx(direct.relative, rel=1e-7)


def test_a_run_goes_on_from_what_it_keeps(tmp_path):
    folder = COMM.bcast(str(tmp_path / "run"))
    scene = pushed_slab(STEEL, 2)
    options = {"max_steps": 2, "checkpoint": folder}
    first = ec.adapt(scene, slab(2), 1e-6, **options)
    again = ec.adapt(scene, slab(2), 1e-6, **options)
    assert again.error.relative == pytest.approx(first.error.relative, rel=1e-9)
    other = pushed_slab(dataclasses.replace(STEEL, hardening=0.06), 2)
    refused(lambda: ec.adapt(other, slab(2), 1e-6, **options), "hardening is 0.06")


def test_the_stress_out_of_plane_is_that_of_the_law():
    """sigma_zz makes psi* least: for a stress on the law it is the derivative of psi."""
    solution = ec.solve(pushed_slab(STEEL, 2), slab(2))
    law = solution.model.linearised.law
    strains = 0.03 * np.random.default_rng(0).normal(size=(50, 1, 3))
    places = np.zeros((50, 1, 2)), np.zeros(50, dtype=np.int32)
    psi, stress = law.energy(strains, *places), law.whole_stress(strains, *places)
    in_plane = stress[..., :3]
    psi_star, out = law.complementary(in_plane, Search(np.zeros((50, 1))), *places)
    assert out == pytest.approx(stress[..., 3], abs=1e-9)
    assert psi + psi_star == pytest.approx((in_plane * strains).sum(axis=-1), rel=1e-12)


# -- what is refused
# -------------------------------------------------------------------------------------


class Wrong(Quadratic):
    """Linear elasticity with a wrong potential or conjugate."""

    def __init__(self, change, of="potential"):
        super().__init__(1.0, 0.3)
        object.__setattr__(self, "change", change)
        object.__setattr__(self, "of", of)

    def potential(self, strain, E, nu):
        psi = super().potential(strain, E, nu)
        return self.change(psi, strain) if self.of == "potential" else psi

    def conjugate(self, stress, E, nu):
        psi = super().conjugate(stress, E, nu)
        return self.change(psi, stress) if self.of == "conjugate" else psi


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (Wrong(lambda psi, eps: psi + 0.01 * eps[0, 0]), "not zero without strain"),
        pytest.param(
            Wrong(lambda psi, eps: psi + 0.01), "not zero without strain", marks=pytest.mark.broad
        ),
        (Wrong(lambda psi, eps: psi - 5 * eps[0, 1] ** 2), "not convex"),
        (Wrong(lambda psi, eps: psi**0.5), "not finite"),
        (Wrong(lambda psi, s: 1.01 * psi, "conjugate"), "does not belong to the potential"),
        pytest.param(
            Wrong(lambda psi, s: 0.99 * psi, "conjugate"),
            "does not belong to the potential",
            marks=pytest.mark.broad,
        ),
        (Wrong(lambda psi, s: s, "conjugate"), "no scalar"),
    ],
)
def test_laws_that_are_no_pair(material, words):
    refused(lambda: ec.solve(pushed_slab(material, 2), slab(2)), "Wrong", words)


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"hardening": 0.0}, "Without hardening psi* is infinite"),
        ({"hardening": -1.0}, "hardening is -1"),
        ({"yield_stress": 0.0}, "yield stress is 0"),
        ({"nu": 0.5}, "nu is 0.5"),
        ({"E": "soft"}, "E is 'soft'"),
    ],
)
def test_numbers_of_plasticity(numbers, words):
    refused(lambda: dataclasses.replace(STEEL, **numbers), words)


def heated_bar(temperature):
    """A bar of revolution between two walls, which is free along its radius."""
    law = ec.Plastic(1000.0, 0.3, yield_stress=3.0, hardening=50.0, hypothesis="axisymmetric")
    walls = [ec.Displacement("bottom", (None, 0.0)), ec.Displacement("top", (None, 0.0))]
    return ec.Scene(law, walls, strains=ec.ThermalStrain(1e-3, temperature))


@pytest.mark.broad
def test_a_bar_that_is_heated_and_cooled_between_walls():
    """0 = sigma/E + e_T + p, and it yields at y + H |p|: a tension is left."""
    bar = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(1, 2))
    history = ec.evolve(lambda t: heated_bar(5.0 * min(t, 2 - t)), bar, [1.0, 2.0], accuracy=0.1)
    yielded = (0.005 - 3.0 / 1000.0) / (1 + 50.0 / 1000.0)
    hot, cold = (error.force("top").force[1] / np.pi for error in history.errors)
    assert hot == pytest.approx(-(3.0 + 50.0 * yielded), rel=1e-6)
    assert cold == pytest.approx(1000.0 * yielded, rel=1e-6)
    # The works of the heat, of yielding and of the walls are the change of the energy.
    for step in history.steps:
        assert abs(step.imbalance) < 1e-9 * step.greatest_energy


@pytest.mark.broad
def test_a_temperature_that_varies():
    """The energy of a finer mesh lies in the interval, and a free body bends without stress."""

    def heated(n):
        heat = ec.ThermalStrain(1e-3, lambda x: 30.0 * x[1] ** 2)
        scene = ec.Scene(STEEL, ec.Displacement("left", (0.0, 0.0)), strains=heat)
        return ec.potential_energy(certified(scene, slab(2, (2 * n, n))))

    coarse, fine = heated(2), heated(4)
    assert coarse.low <= fine.low <= fine.high <= coarse.high
    turned = ec.Eigenstrain(((0.1, 0.0), (0.0, 0.0)))
    refused(
        lambda: ec.solve(ec.Scene(STEEL, strains=turned), slab(2)), "the same in all directions"
    )
    of_user = ec.ThermalStrain(1e-5, 10.0)
    refused(lambda: ec.Scene(Quadratic(1.0, 0.3), strains=of_user), "needs a linear law")


@pytest.fixture(scope="module")
def error():
    return certified(pushed_slab(STEEL, 2, friction=0.3), slab(2))


@pytest.mark.parametrize(
    "call",
    [
        lambda error: ec.resultant(error, "bottom", (0.0, 1.0)),
        ec.work_of_loads,
        ec.coulomb_certificate,
        lambda error: ec.other_solutions(error.solution),
        lambda error: ec.interval(error, ec.Resultant("bottom", (0.0, 1.0))),
        lambda error: ec.certify(error.solution.scene, error.domain, error.solution.u),
        lambda error: error.best_stress_error,
        lambda error: ec.adapt(
            error.solution.scene, error.domain, 0.1, goal=ec.Resultant("bottom", (0.0, 1.0))
        ),
    ],
)
def test_what_needs_a_linear_law_is_refused(call, error):
    refused(lambda: call(error), "needs a linear law", "Plastic")
