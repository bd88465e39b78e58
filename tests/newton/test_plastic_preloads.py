"""Preloads of bodies with a potential: bolts that are tightened beyond yield.

- a potential of linear elasticity has the numbers of Elastic, by shift and by force;
- a bar has its force in closed form through a history of tightening, unloading and
  yielding again, given either; energies are in balance, and a kept run goes on;
- little hardening: the shift of a given force is found;
- energies of finer meshes lie in the bounds of random joints, and add up to e^2/2;
- a joint keeps its force, and loses some of it when it yields under a pull.
"""

import dataclasses

import numpy as np
import pytest
import ufl
from bolted import SEATS, SIDES, bolted_plates
from energies import energies_of_law
from laws import Quadratic
from mpi4py import MPI
from scenes import certified

import erc_contact as ec
from erc_contact.admissible.elastic import CellStrains, strains_of_body
from erc_contact.error.works import stress_work

E, NU, YIELD, H = 1000.0, 0.3, 3.0, 50.0
RINGS = ec.Plastic(E, NU, YIELD, H, hypothesis="axisymmetric")
AREA, LENGTH = np.pi, 2.0
CUT = ("upper bottom", "lower top")


def joint(law, friction=0.0, pull=0.0, **preload):
    """Half of two plates that a bolt holds together; the lower one is held, the upper one pulled."""
    held = [
        ec.Symmetry("symmetry x"),
        ec.Displacement("bottom", (None, 0.0)),
        ec.Displacement("outer", (0.0, None)),
    ]
    contacts = [ec.Contact(a, against=b, friction=friction) for a, b in SEATS]
    tie = ec.Preload(*SIDES, **preload)
    return ec.Scene(law, held, ec.Traction("top", (0.0, pull)), contacts, ties=tie)


def round_bar():
    """A bar of radius 1 and length 2 in two halves."""
    halves = {}
    for name, z in (("lower", 0.0), ("upper", 1.0)):
        halves[name] = ec.rectangle((0.0, z), (1.0, z + 1.0), cells=(2, 2))
    return ec.assembly(halves).joined(*CUT)


def yield_stresses(shank, plate):
    """Yield stresses of the joint: head and nut, which bend, are of a stronger steel."""

    def bolt(x):
        return ufl.conditional(abs(x[1] - 0.25) < 1.75, shank, 1e3)

    return {"above": bolt, "below": bolt, "upper": plate, "lower": plate}


def bar(law, move=0.0, **preload):
    """The bar between walls, of which the upper one moves."""
    walls = [ec.Displacement("lower bottom", (None, 0.0))]
    walls.append(ec.Displacement("upper top", (None, move)))
    return ec.Scene(law, walls, ties=ec.Preload(*CUT, **preload))


def stresses(strains, hardening=H):
    """The stress of the bar at the end of each strain, with isotropic hardening."""
    plastic = accumulated = 0.0
    found = []
    for strain in strains:
        beyond = E * (strain - plastic)
        limit = YIELD + hardening * accumulated
        flow = max(abs(beyond) - limit, 0.0) / (E + hardening)
        plastic += flow * np.sign(beyond)
        accumulated += flow
        found.append(E * (strain - plastic))
    return found


@pytest.mark.broad
@pytest.mark.parametrize("degree", [1, 2])
def test_a_potential_of_linear_elasticity_is_elastic(degree):
    """By shift and by force, with friction."""
    domain = bolted_plates(2, 2.0)
    for given in ({"force": 12.0}, {"shortening": 0.05}):
        numbers = []
        for law in (ec.Elastic(E, NU), Quadratic(E, NU)):
            scene = joint(law, 0.2, pull=0.5, **given)
            error = certified(scene, domain, degree=degree)
            solution = error.solution
            energy = ec.potential_energy(error)
            of_law = [solution.shortening(SIDES[0]), solution.bolt_force(SIDES[0]), energy.value]
            numbers.append([error.relative, *of_law, *error.force("joint").force])
        # Both integrals of e leave a thousandth of its square unknown at most.
        assert numbers[1] == pytest.approx(numbers[0], rel=1e-3)
        assert numbers[1][1:] == pytest.approx(numbers[0][1:], rel=1e-6)


@pytest.mark.parametrize("shift", [pytest.param(0.004, marks=pytest.mark.broad), 0.02])
def test_a_bar_has_its_force(shift):
    """Below yield and beyond it, F = A sigma(q/L), by shift and by force."""
    (stress,) = stresses([shift / LENGTH])
    domain = round_bar()
    for given in ({"shortening": shift}, {"force": AREA * stress}):
        error = certified(bar(RINGS, **given), domain)
        assert error.solution.bolt_force(CUT[0]) == pytest.approx(AREA * stress, rel=1e-8)
        assert error.solution.shortening(CUT[0]) == pytest.approx(shift, rel=1e-6)
        assert error.force("upper top").force[1] == pytest.approx(AREA * stress, rel=1e-8)
        assert error.relative < 1e-6
    # The work F q of the force counts in J.
    strain = shift / LENGTH
    plastic = strain - stress / E
    stored = stress**2 / (2 * E) + YIELD * plastic + H * plastic**2 / 2
    exact = AREA * LENGTH * (stored - stress * strain)
    assert ec.potential_energy(error).value == pytest.approx(exact, rel=1e-6)


MOVES = [0.0, -0.003, 0.01, -0.005]


def history_of_bar(t):
    """Tightened by a force, then locked while a wall moves."""
    given = {"force": 3.5 * AREA} if t == 0.0 else {"locked": True}
    return bar(RINGS, move=float(np.interp(t, range(4), MOVES)), **given)


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_a_bar_that_is_tightened_unloaded_and_yields_again(degree, shared_tmp_path):
    arguments = {"accuracy": 0.2, "degree": degree, "checkpoint": shared_tmp_path / str(degree)}
    domain = round_bar()
    history = ec.evolve(history_of_bar, domain, range(4), **arguments)
    shift = LENGTH * (YIELD / E + (3.5 - YIELD) * (E + H) / (E * H))
    wanted = stresses([(shift + move) / LENGTH for move in MOVES])
    # Unloading is elastic.
    assert wanted[1] == pytest.approx(wanted[0] - E * 0.003 / LENGTH)
    for error, stress in zip(history.errors, wanted, strict=True):
        assert error.solution.bolt_force(CUT[0]) == pytest.approx(AREA * stress, rel=1e-8)
        assert error.solution.shortening(CUT[0]) == pytest.approx(shift, rel=1e-8)
        assert error.relative < 1e-6
    # The works of preload, walls and yielding are the change of the energy.
    for step in history.steps:
        assert abs(step.imbalance) < 1e-9 * step.greatest_energy
    made = []
    kept = ec.evolve(history_of_bar, domain, range(4), callback=made.append, **arguments)
    assert not made
    forces = [error.solution.bolt_force(CUT[0]) for error in kept.errors]
    assert forces == pytest.approx(AREA * np.array(wanted), rel=1e-8)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("hardening", [10.0, 1.0, 0.1])
def test_the_shift_of_a_force_is_found_with_little_hardening(hardening):
    law = dataclasses.replace(RINGS, hardening=hardening)
    for stress in (2.9, 3.01, 3.02):
        plastic = max(stress - YIELD, 0.0) / hardening
        solution = ec.solve(bar(law, force=AREA * stress), round_bar())
        shift = LENGTH * (stress / E + plastic)
        assert solution.shortening(CUT[0]) == pytest.approx(shift, rel=1e-5)


def random_joint(seed):
    """A joint whose bolt, and perhaps plates, yield; smooth, or with Tresca friction."""
    random = np.random.default_rng(seed)
    bolt, plate = random.uniform(5.0, 15.0), random.uniform(5.0, 200.0)
    nu, hardening = float(random.uniform(0.0, 0.4)), float(random.uniform(10.0, 300.0))
    # Yield stresses that jump in cells would leave the integrals unknown.
    yields = {"above": bolt, "below": bolt, "upper": plate, "lower": plate}
    law = ec.Plastic(E, nu, yields, hardening)
    friction = ec.Tresca(float(random.uniform(0.1, 2.0))) if random.random() < 0.5 else 0.0
    if random.random() < 0.5:
        given = {"force": float(random.uniform(0.5, 1.3)) * bolt}
    else:
        given = {"shortening": float(random.uniform(0.05, 0.3))}
    return joint(law, friction, pull=float(random.uniform(0.0, 0.5)), **given)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("seed", range(6))
def test_energies_of_finer_meshes_lie_in_the_bounds(seed):
    scene = random_joint(seed)
    plates = bolted_plates(2, 2.0)
    coarse = certified(scene, plates)
    fine = certified(scene, plates, degree=2)
    assert fine.absolute < coarse.absolute
    bounds, exact = ec.potential_energy(coarse), ec.potential_energy(fine)
    assert bounds.guaranteed
    assert bounds.low <= exact.high
    assert exact.low <= bounds.high
    assert exact.high <= bounds.high


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("given", [{"force": 7.2}, {"shortening": 0.2}])
def test_energies_add_up_to_the_error(given):
    """By a rule of its own for psi, psi* and the work of sigma^ on the jump."""
    yields = {"above": 6.0, "below": 6.0, "upper": 1e3, "lower": 1e3}
    law = ec.Plastic(E, NU, yields, hardening=200.0)
    scene = joint(law, ec.Tresca(0.5), pull=0.2, **given)
    error = certified(scene, bolted_plates(2, 2.0), degree=2)
    assert ec.results.plastic_share(error) > 0.01
    pair, model = error.admissible, error.model
    psi, psi_star = energies_of_law(error)
    cells, owned = pair.cell_geometry, model.space.owned_cells
    whole = strains_of_body(model, cells, pair.displacement).in_plane
    jump = (whole - CellStrains.of(model.space, cells, pair.displacement).in_plane)[:, 0]
    # The mean of a polynomial is the mean of its Bernstein coefficients.
    means = pair.stress.mean(axis=(1, 2))
    on_jump = float(cells.volume[owned] @ (means * jump[owned]).sum(axis=1))
    work = stress_work(pair, pair.displacement).value + on_jump
    half = psi + psi_star - work + error.contact_error**2 / 2
    assert half < error.absolute**2 / 2 * (1 + 1e-9) < 1.0011 * half * (1 + 1e-6)
    # The jump of the strain is the shift over the height of the cells at the cut.
    force = error.solution.bolt_force(SIDES[0])
    assert on_jump == pytest.approx(force * error.solution.shortening(SIDES[0]), rel=0.05)


@pytest.mark.broad
def test_a_joint_keeps_its_force_and_loses_some_where_a_pull_lets_it_yield():
    """The steps are on one mesh, as a shift is the shift of its mesh."""
    law = ec.Plastic(E, NU, yield_stresses(6.0, 1e3), hardening=20.0)
    domain = bolted_plates(2, 1.0)
    force = 7.2  # the shank of half width 1 yields at 2/sqrt(3) y in plane strain
    steps = [joint(law, force=force)]
    steps += [joint(law, pull=pull, locked=True) for pull in (0.0, 2.0, 0.0)]
    solution = None
    forces = []
    for scene in steps:
        solution = ec.solve(scene, domain, ec.AugmentedLagrangian(), after=solution)
        error = ec.constitutive_error(ec.equilibrate(solution))
        forces.append(solution.bolt_force(SIDES[0]))
        assert -error.force(SIDES[0]).force[1] == pytest.approx(forces[-1], rel=1e-9)
        assert abs(error.reactions()["balance"].force).max() < 1e-9 * force
    tightened, locked, pulled, released = forces
    assert tightened == pytest.approx(force, rel=1e-7)
    # Cells across the end of the shank yield in part: their state is a mean.
    assert locked == pytest.approx(force, rel=0.01)
    assert pulled > locked
    # Longer by what it has yielded, the bolt holds less than before.
    assert released < 0.95 * locked


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("yield_stress", [6.0, 8.0])
def test_a_step_without_change_changes_nothing(yield_stress):
    """Stresses begin it on the yield surface, and sigma^ is in equilibrium all the same."""
    law = ec.Plastic(E, NU, yield_stress, hardening=20.0)
    domain = bolted_plates(2, 1.0)
    tightened = ec.solve(joint(law, force=7.2), domain, ec.AugmentedLagrangian())
    locked = ec.solve(joint(law, locked=True), domain, ec.AugmentedLagrangian(), after=tightened)
    moved = abs(locked.u.x.array - tightened.u.x.array).max()
    assert moved < 1e-9 * abs(tightened.u.x.array).max()
    assert ec.equilibrate(locked).imbalance < 1e-9


@pytest.mark.ranks
def test_ranks_agree():
    numbers = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        error = certified(random_joint(0), bolted_plates(2, 1.0, comm))
        solution = error.solution
        numbers.append(
            [error.relative, solution.shortening(SIDES[0]), error.force("joint").force[1]]
        )
    assert numbers[1] == pytest.approx(numbers[0], rel=1e-6)
