"""Histories of plastic bodies, and bodies of revolution with a potential.

- A bar that is pulled, pressed and pulled again, with both hardenings: its closed form.
- Works, stored energy and plastic work are in balance; nothing flows while a body unloads.
- Children of cells have the state of their parents; a new mesh tells what it moved.
- Ranks and folders give the same history.
- On rings a quadratic potential is linear elasticity, and J + J* = e^2/2.
- A thick sphere and a thick tube under pressure that is unloaded: their closed forms.
- What is refused: plane stress, no hardening, another law on the way.
"""

import dataclasses

import numpy as np
import pytest
from domains import refused
from energies import energies_of_law
from laws import Quadratic
from mpi4py import MPI
from scenes import certified
from scipy.optimize import brentq
from test_potential import INNER, OUTER, quarter_tube, tube_displacement

import erc_contact as ec
from erc_contact.error.load_work import load_work
from erc_contact.error.works import friction_work, stress_work
from erc_contact.model.carrying import carry_state
from erc_contact.model.law.point_law import Search
from erc_contact.model.model import Model
from erc_contact.newton.after import last_step

COMM = MPI.COMM_WORLD
STEEL = ec.Plastic(E=1000.0, nu=0.3, yield_stress=1.0, hardening=30.0, kinematic=70.0)
CURVED = ec.Plastic(1000.0, 0.3, hardening=ec.Voce(1.0, 0.5, 100.0), kinematic=20.0)
RINGS = dataclasses.replace(STEEL, hypothesis="axisymmetric")


# -- a bar that is pulled and pressed
# -------------------------------------------------------------------------------------

PULLS = {1.0: 1.6, 2.0: -1.9, 3.0: 0.5, 4.0: -2.2}


def stretches(law, pulls):
    """Stretch, plastic work so far and elastic energy, each per volume, after each pull."""
    plastic = accumulated = work = before = 0.0
    rows = []
    for pull in pulls:
        relative = pull - law.kinematic * plastic
        beyond = abs(relative) - law.yield_stress - law.hardening * accumulated
        flow = max(beyond, 0.0) / (law.hardening + law.kinematic)
        change = np.copysign(flow, relative)
        plastic += change
        accumulated += flow
        work += (pull + before) / 2 * change
        before = pull
        rows.append((pull / law.E + plastic, work, pull**2 / (2 * law.E)))
    return rows


@pytest.mark.broad
@pytest.mark.on_ranks("3-1", "rings-2")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("body", ["3", "rings"])
def test_a_bar_that_is_pulled_and_pressed(body, degree):
    """Stress and strain are uniform, so that meshes and steps in time are exact."""
    if body == "3":
        law, volume = STEEL, 1.0
        bar = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(1, 1, 1))
        supports = [ec.Symmetry(side) for side in ("left", "front", "bottom")]
    else:
        law, volume = RINGS, np.pi
        bar = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2))
        supports = [ec.Symmetry("bottom")]

    def scene_at(time):
        load = ec.Traction("top", (*[0.0] * (bar.dim - 1), PULLS[time]))
        return ec.Scene(law, supports, load)

    evolution = ec.evolve(scene_at, bar, sorted(PULLS), 0.01, degree=degree)
    assert evolution.reached
    end = np.ones((1, bar.dim))
    closed = stretches(law, PULLS.values())
    for error, row, (stretch, work, stored) in zip(
        evolution.errors, evolution.steps, closed, strict=True
    ):
        assert error.relative < 1e-6
        moved = error.solution.at(end).displacement[0]
        assert moved[-1] == pytest.approx(stretch, rel=1e-8)
        plastic = stretch - PULLS[row.time] / law.E
        across = -law.nu * PULLS[row.time] / law.E - plastic / 2
        assert moved[0] == pytest.approx(across, rel=1e-8)
        assert row.plastic_work == pytest.approx(volume * work, rel=1e-8)
        assert row.stored == pytest.approx(volume * stored, rel=1e-8)
        assert abs(row.imbalance) < 1e-8 * volume * work


# -- a body that is pressed and unloaded
# -------------------------------------------------------------------------------------

PRESS = {1.0: 0.5, 2.0: 1.0, 3.0: 0.9, 4.0: 0.5}


def pressed_at(law, friction=0.0):
    def scene_at(time):
        top = ec.Displacement("top", (0.0, -0.006 * PRESS[time]))
        contact = ec.Contact("bottom", friction=friction, gap=lambda x: 0.003 * x[0] ** 2)
        return ec.Scene(law, top, contacts=contact)

    return scene_at


def layer(comm=COMM, cells=(4, 2)):
    return ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=cells, comm=comm)


@pytest.mark.broad
@pytest.mark.parametrize(("law", "degree"), [(STEEL, 1), (STEEL, 2), (RINGS, 2)])
@pytest.mark.serial
def test_energies_of_a_body_that_is_pressed_and_unloaded(law, degree):
    accuracy = 0.1
    evolution = ec.evolve(
        pressed_at(law), layer(), sorted(PRESS), accuracy, degree=degree, strategy=ec.Mark()
    )
    assert evolution.reached
    half, full, less, least = evolution.steps
    for row in evolution.steps:
        assert abs(row.imbalance) < accuracy * row.greatest_energy / 2
    assert 0 < half.plastic_work < full.plastic_work
    # All unloads at first, and yields again nowhere.
    assert less.plastic_work == pytest.approx(full.plastic_work, rel=2e-3)
    assert least.stored < less.stored < full.stored
    # What flowed is not given back: less force than a body that never yielded would have.
    assert least.force["bottom"][-1] < half.force["bottom"][-1]
    share = [ec.results.plastic_share(error) for error in evolution.errors]
    assert 0 < share[0] < share[1]
    plastic = ec.results.state(evolution, "plastic_strain")
    assert abs(np.trace(plastic, axis1=1, axis2=2)).max() < 1e-12
    # From rest the plastic strain of a point grows along a straight line.
    plastic = ec.results.state(evolution.errors[0], "plastic_strain")
    accumulated = ec.results.state(evolution.errors[0], "accumulated")
    size = np.sqrt(2 / 3 * (plastic**2).sum(axis=(1, 2)))
    assert (size <= accumulated * (1 + 1e-9)).all()
    if degree == 1:
        assert size == pytest.approx(accumulated, rel=1e-9)


# -- the state on another mesh
# -------------------------------------------------------------------------------------


@pytest.mark.broad
@pytest.mark.on_ranks("2", "1")
@pytest.mark.parametrize("degree", [1, 2])
def test_children_have_the_state_of_their_parents(degree):
    """At points of a mesh that refines the last one the state is what it was."""
    scene_at = pressed_at(STEEL)
    solution = ec.solve(scene_at(2.0), layer(), degree=degree)
    after = solution.model.linearised.state_at_end(solution.u)
    marked = np.arange(0, solution.domain.owned_cells, 3)
    fine = Model(scene_at(2.0), solution.domain.refined(marked), degree)
    children = carry_state(after, fine.space)
    assert children.moved < 1e-14
    assert fine.domain.cells > solution.domain.cells
    # Integrals of polynomials over both meshes, by the nodes of a linear function.
    assert _moments(after, solution.model) == pytest.approx(_moments(children, fine), rel=1e-12)
    assert carry_state(after, solution.model.space) is after


def _moments(state, model):
    """Integrals of all components times 1, x and y, over all ranks."""
    space = model.space
    corners = space.cell_corners()[space.owned_cells]
    points = np.array([[4.0, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6
    x = np.matmul(points, corners)
    values = state.at(x, space.owned_cells)
    volume = abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    weights = np.concatenate([np.ones_like(x[..., :1]), x], axis=-1)
    local = np.einsum("n,nqi,nqj->ij", volume, values, weights)
    return space.comm.allreduce(local, MPI.SUM).ravel()


@pytest.mark.serial
def test_the_law_is_convex_where_the_polynomial_of_the_state_is_below_zero():
    """Beside its nodes the state of a cell that yielded in part is, and y + H a with it."""
    hard = ec.Plastic(1.0, 0.3, 0.01, 0.8)
    contact = ec.Contact("bottom", gap=lambda x: 0.2 * (x[0] - 1.0) ** 2)
    scene = ec.Scene(hard, ec.Displacement("top", (0.06, -0.12)), contacts=contact)
    first = ec.solve(scene, layer(), ec.AugmentedLagrangian(), degree=2)
    law = Model(scene, first.domain, 2, last=last_step(first)).linearised.law
    cells = first.model.space.owned_cells
    x = first.model.space.cell_corners()[cells]
    limit = hard.yield_stress + hard.hardening * law.state.at(x, cells)[..., -1]
    assert limit.min() < -0.5 * hard.yield_stress
    strain = 0.02 * np.random.default_rng(0).normal(size=(*x.shape[:2], 3))
    psi, stress = law.energy(strain, x, cells), law.whole_stress(strain, x, cells)
    psi_star, _ = law.complementary(stress[..., :3], Search(stress[..., 3]), x, cells)
    assert psi + psi_star == pytest.approx((stress[..., :3] * strain).sum(axis=-1), rel=1e-9)
    assert np.linalg.eigvalsh(law.tangent(strain, x, cells)).min() > 0
    after = law.new_state(strain, x, cells)[..., -1]
    assert after.min() >= 0


@pytest.mark.broad
@pytest.mark.on_ranks("mark")
@pytest.mark.parametrize("strategy", [ec.Mark(), ec.SizeMap()], ids=["mark", "size"])
def test_a_history_tells_what_new_meshes_moved(strategy):
    press = {1.0: 0.1, 2.0: 1.0}

    def scene_at(time):
        top = ec.Displacement("top", (0.0, -0.02 * press[time]))
        return ec.Scene(STEEL, top, contacts=ec.Contact("bottom", gap=lambda x: 0.005 * x[0] ** 2))

    body = ec.rectangle((0.0, 0.0), (2.0, 1.0), size=0.5)
    evolution = ec.evolve(scene_at, body, sorted(press), 0.04, degree=2, strategy=strategy)
    first, last = evolution.errors
    assert last.domain.cells > first.domain.cells
    moved = last.model.linearised.law.state.moved
    if isinstance(strategy, ec.Mark):
        assert moved < 1e-14
    else:
        assert 1e-3 < moved < 0.5


@pytest.mark.ranks
@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_ranks_move_a_state_alike(degree):
    """To a mesh that does not refine the last one, whose cells are on other ranks."""
    moved = []
    for comm in (MPI.COMM_SELF, COMM):
        scene = pressed_at(STEEL)(2.0)
        solution = ec.solve(scene, layer(comm), degree=degree)
        after = solution.model.linearised.state_at_end(solution.u)
        other = Model(scene, layer(comm, (5, 3)), degree)
        state = carry_state(after, other.space)
        assert 1e-3 < state.moved < 1.0
        moved.append([state.moved, *_moments(state, other)])
    assert moved[1] == pytest.approx(moved[0], rel=1e-8, abs=1e-12)


# -- ranks, and what a folder keeps
# -------------------------------------------------------------------------------------


def history(comm=COMM, degree=1, law=STEEL, **options):
    scene_at = pressed_at(law, friction=0.3)
    return ec.evolve(
        scene_at, layer(comm), sorted(PRESS), 0.2, degree=degree, strategy=ec.Mark(), **options
    )


def compared(first, second):
    for a, b in zip(first.steps, second.steps, strict=True):
        assert (a.time, a.cells) == (b.time, b.cells)
        assert a.eps == pytest.approx(b.eps, rel=1e-7)
        assert a.force["bottom"] == pytest.approx(b.force["bottom"], rel=1e-8, abs=1e-10)
        assert a.plastic_work == pytest.approx(b.plastic_work, rel=1e-8)
        assert a.stored == pytest.approx(b.stored, rel=1e-8)


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("law", "degree"), [(STEEL, 2), (RINGS, 1), pytest.param(CURVED, 1, marks=pytest.mark.broad)]
)
def test_ranks_have_the_same_history(law, degree):
    compared(*(history(comm, degree, law) for comm in (MPI.COMM_SELF, COMM)))


@pytest.mark.broad
def test_a_folder_goes_on(shared_tmp_path):
    """A run that ends after its second step and goes on has the same state."""

    def end(error, row):
        if row.time == 2.0:
            raise StopIteration("enough")

    folder = shared_tmp_path / "run"
    first = history(degree=2, checkpoint=folder, callback=end)
    assert len(first.steps) == 2
    compared(history(degree=2), history(degree=2, checkpoint=folder))


# -- rings
# -------------------------------------------------------------------------------------


def on_rings(law, inner, friction):
    body = ec.rectangle((inner, 0.0), (inner + 1.0, 1.0), cells=(4, 4))
    top = ec.Displacement("top", (None, -0.01))
    load = ec.Traction("right", pressure=0.5)
    return ec.Scene(law, top, load, ec.Contact("bottom", friction=friction)), body


@pytest.mark.broad
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("inner", [0.0, 1.0])
def test_a_quadratic_potential_is_linear_elasticity_on_rings(inner, degree):
    errors = []
    for law in (ec.Elastic(1000.0, 0.3, "axisymmetric"), Quadratic(1000.0, 0.3, "axisymmetric")):
        scene, body = on_rings(law, inner, 0.3)
        errors.append(certified(scene, body, degree=degree))
    linear, convex = errors
    assert convex.force("bottom").force == pytest.approx(linear.force("bottom").force, rel=1e-9)
    # Both integrals of e leave a thousandth of its square unknown at most.
    assert convex.relative == pytest.approx(linear.relative, rel=1e-3)
    assert ec.potential_energy(convex).value == pytest.approx(
        ec.potential_energy(linear).value, rel=1e-6
    )


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(
    ("degree", "friction"), [(1, ec.Tresca(0.3)), (2, 0.0), (2, ec.Tresca(0.3))]
)
def test_energies_add_up_to_the_error_on_rings(degree, friction):
    scene, body = on_rings(RINGS, 1.0, friction)
    error = certified(scene, body, degree=degree)
    assert ec.results.plastic_share(error) > 0.2
    pair, model = error.admissible, error.model
    psi, psi_star = energies_of_law(error)
    loads = load_work(model, pair.displacement).value
    of_friction = sum(
        friction_work(model.space, t, pair.displacement, 0.0).value for t in pair.tractions
    )
    J = psi - loads + of_friction
    J_star = psi_star - error.force("top").force[1] * -0.01
    half = psi + psi_star - stress_work(pair, pair.displacement).value + error.contact_error**2 / 2
    unknown = 1e-3 * error.absolute**2
    assert abs(J + J_star - half) < 1e-9 * (abs(J) + abs(J_star)) + unknown
    assert half < error.absolute**2 / 2 * (1 + 1e-9)
    assert error.absolute**2 / 2 < 1.0011 * half


# -- thick walls under pressure
# -------------------------------------------------------------------------------------


class Sphere:
    """A thick sphere under inner pressure, by the difference q of hoop and radial stress.

    With ``M = 1/(2 G) + 2/(3 K)`` and the accumulated plastic strain a, equilibrium and
    the law of volume give ``M q + 3/2 a = c/r^3`` with one number c at all radii.
    """

    def __init__(self, law, c):
        self.law, self.c = law, c
        G, self.K = law.E / (2 * (1 + law.nu)), law.E / (3 * (1 - 2 * law.nu))
        self.M = 1 / (2 * G) + 2 / (3 * self.K)
        self.slope = law.hardening + law.kinematic
        self.yielded = np.clip(np.cbrt(c / (self.M * law.yield_stress)), INNER, OUTER)

    def difference(self, r):
        """The stress q at a radius [force/area]."""
        if r >= self.yielded:
            return self.c / (self.M * r**3)
        ratio = 1.5 / self.slope
        return (self.c / r**3 + ratio * self.law.yield_stress) / (self.M + ratio)

    @property
    def pressure(self):
        """The integral of ``2 q/r`` over the wall."""
        edge = self.yielded
        outside = 2 * self.c / (3 * self.M) * (edge**-3 - OUTER**-3)
        ratio = 1.5 / self.slope
        inside = self.c / 3 * (INNER**-3 - edge**-3)
        inside += ratio * self.law.yield_stress * np.log(edge / INNER)
        return outside + 2 * inside / (self.M + ratio)

    @property
    def bore(self):
        """Radial displacement of the inner wall."""
        return INNER / 3 * (self.c / INNER**3 - self.pressure / self.K)


def thick_sphere(law, pressure):
    """The sphere of this law that bears a pressure."""
    return Sphere(law, brentq(lambda c: Sphere(law, c).pressure - pressure, 0.0, 1.0, xtol=1e-15))


WALL = ec.Plastic(E=1.0, nu=0.3, yield_stress=0.01, hardening=0.05, hypothesis="axisymmetric")
MOVING = dataclasses.replace(WALL, hardening=0.01, kinematic=0.04)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("law", [WALL, MOVING], ids=["isotropic", "both"])
def test_a_thick_sphere_under_pressure_that_is_unloaded(law):
    pressure = 0.0115
    exact = thick_sphere(law, pressure)
    assert INNER * 1.2 < exact.yielded < 0.95 * OUTER
    elastic = thick_sphere(dataclasses.replace(law, yield_stress=1.0), pressure)
    left = exact.difference(INNER) - elastic.difference(INNER)
    plastic = (exact.difference(INNER) - law.yield_stress) / exact.slope
    # It unloads without yielding again.
    assert abs(left - law.kinematic * plastic) < law.yield_stress + law.hardening * plastic
    loads = {1.0: 0.009, 2.0: pressure, 3.0: 0.0}

    def scene_at(time):
        load = ec.Traction("inside", pressure=loads[time])
        return ec.Scene(law, ec.Symmetry("bottom"), load)

    # A stress at a corner needs a finer mesh than the energy: with 0.01 it is 1.6% off.
    evolution = ec.evolve(scene_at, quarter_tube(0.4), sorted(loads), 0.003, degree=2)
    assert evolution.reached
    bore = [[INNER, 0.0]]
    moved = [error.solution.at(bore).displacement[0, 0] for error in evolution.errors]
    closed = [thick_sphere(law, 0.009).bore, exact.bore, exact.bore - elastic.bore]
    assert moved == pytest.approx(closed, rel=1e-3)
    free = evolution.errors[-1]
    assert free.at(bore).stress[0, 2, 2] == pytest.approx(left, rel=0.01)
    flowed = ec.results.state(evolution, "accumulated").max()
    assert flowed == pytest.approx(plastic, rel=0.2)


@pytest.mark.broad
@pytest.mark.serial
def test_a_thick_tube_on_rings_that_is_unloaded():
    """Held at its ends it is in plane strain, whose displacements the differential equation has."""
    pressure = 0.008
    inner, outer = tube_displacement(WALL, pressure)
    elastic = tube_displacement(dataclasses.replace(WALL, yield_stress=1.0), pressure)
    loads = {1.0: pressure, 2.0: 0.0}

    def scene_at(time):
        ends = [ec.Symmetry(end) for end in ("bottom", "top")]
        return ec.Scene(WALL, ends, ec.Traction("left", pressure=loads[time]))

    wall = ec.rectangle((INNER, 0.0), (OUTER, 0.25), cells=(8, 2))
    evolution = ec.evolve(scene_at, wall, [1.0, 2.0], 0.01, degree=2)
    assert evolution.reached
    walls = [[INNER, 0.0], [OUTER, 0.0]]
    loaded, free = (error.solution.at(walls).displacement[:, 0] for error in evolution.errors)
    assert loaded == pytest.approx([inner, outer], rel=1e-3)
    assert free == pytest.approx([inner - elastic[0], outer - elastic[1]], rel=4e-3)


# -- what is refused
# -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"hypothesis": "plane stress"}, "plane stress does not exist"),
        ({"hypothesis": "thin"}, "hypothesis is 'thin'"),
        ({"hardening": 0.0, "kinematic": 0.0}, "hardening is 0"),
        ({"kinematic": -1.0}, "kinematic is -1"),
        ({"kinematic": {"plate": 0.0}, "hardening": 0.0}, "must be > 0"),
    ],
)
def test_numbers_that_are_no_plasticity(numbers, words):
    refused(lambda: dataclasses.replace(STEEL, **numbers), words)


@pytest.mark.broad
def test_another_law_on_the_way():
    """What remembers nothing cannot follow on what remembers, nor the other way round."""
    words = "All scenes of a history have the same law"
    for laws in [(STEEL, ec.Elastic(1000.0, 0.3)), (Quadratic(1000.0, 0.3), STEEL)]:
        first, second = (pressed_at(law)(1.0) for law in laws)
        solution = ec.solve(first, layer(), ec.AugmentedLagrangian())
        domain = solution.domain
        refused(lambda s=second, d=domain, a=solution: ec.solve(s, d, after=a), words)
        evolution = ec.evolve(
            lambda time, pair=(first, second): pair[int(time) - 1], layer(), [1.0, 2.0], 0.3
        )
        assert len(evolution.steps) == 1
        assert words in evolution.outcome


def test_a_state_of_no_name():
    error = certified(pressed_at(STEEL)(1.0), layer())
    refused(lambda: ec.results.state(error, "damage"), "no state 'damage'", "plastic_strain")
    linear = certified(pressed_at(ec.Elastic(1000.0, 0.3))(1.0), layer())
    refused(lambda: ec.results.plastic_share(linear), "Elastic has no state")
