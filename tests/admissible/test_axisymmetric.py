"""Axisymmetric bodies: closed forms, admissibility on rings, the axis, and what is refused.

- Proved intervals of the energy hold closed forms; forces are of the full ring.
- Pairs of random bodies are in equilibrium by an evaluation of their own, and e is at
  least the norm of both errors.
- e falls at the rate k, with the axis as without it; far from the axis all numbers are
  the numbers of plane strain.
- Methods, solvers and ranks agree.
- Conditions on the axis, moments and rotations are refused in words.
"""

import numpy as np
import pytest
from axisymmetric import compared, random_case
from axisymmetric_evaluation import UNBALANCED, own_imbalance
from mpi4py import MPI
from scenes import certified, pressed

import erc_contact as ec

COMM = MPI.COMM_WORLD
E, NU = 1000.0, 0.3
RINGS = ec.Elastic(E, NU, hypothesis="axisymmetric")
METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]


def tube(inner: float, cells: tuple[int, int], **loads) -> tuple[ec.Scene, ec.Domain]:
    """A ring of thickness 1 that is held along z at both ends."""
    domain = ec.rectangle((inner, 0.0), (inner + 1.0, 0.5), cells=cells)
    ends = [ec.Displacement(end, (None, 0.0)) for end in ("bottom", "top")]
    return ec.Scene(RINGS, ends, **loads), domain


def punched_ring(inner: float, cells: tuple[int, int], friction=0.3) -> tuple[ec.Scene, ec.Domain]:
    """A ring that a punch presses on a foundation."""
    domain = ec.rectangle((inner, 0.0), (inner + 1.0, 1.0), cells=cells)
    return pressed(RINGS, (0.0, -0.01), friction=friction), domain


@pytest.mark.parametrize("degree", [1, 2])
def test_thick_tube(degree):
    """Lame: inner pressure 1 on radii 1 and 2, u = (1 + nu)/E ((1 - 2 nu) r + 4/r)/3."""
    scene, domain = tube(1.0, (8, 4), loads=[ec.Traction("left", pressure=1.0)])
    error = certified(scene, domain, degree=degree)
    inside = (1 + NU) / (3 * E) * (1 - 2 * NU + 4)
    energy = -0.5 * inside * 2 * np.pi * 0.5
    bounds = ec.potential_energy(error)
    assert bounds.guaranteed
    assert bounds.low <= energy <= bounds.high
    values = error.at([(1.0, 0.25)])
    assert values.displacement[0, 0] == pytest.approx(inside, rel=0.01 if degree == 1 else 1e-4)
    assert values.stress[0, 2, 2] == pytest.approx(5 / 3, rel=0.1 if degree == 1 else 0.01)
    # The pressure of the full ring, and stresses that hold both ends: sigma_z A.
    assert error.force("left").force[0] == pytest.approx(np.pi, rel=1e-12)
    assert -error.force("top").force[1] == pytest.approx(-2 * NU / 3 * 3 * np.pi, rel=0.01)
    assert abs(error.reactions()["balance"].force).max() < 1e-12


def test_spinning_disc():
    """A radial body force is exact: the interval of the energy is proved and holds the closed form."""
    load = ec.BodyForce((lambda x: 2 * x[0], 0.0))
    scene, domain = tube(0.0, (8, 4), loads=[load])
    error = certified(scene, domain, degree=2)
    r = np.linspace(0.0, 1.0, 20_001)
    u = (1 + NU) * (1 - 2 * NU) / (4 * E * (1 - NU)) * r * (3 - 2 * NU - r**2)
    energy = -0.5 * np.trapezoid(2 * r * u * 2 * np.pi * r, r) * 0.5
    bounds = ec.potential_energy(error)
    assert bounds.guaranteed
    assert bounds.low - 1e-9 * abs(energy) <= energy <= bounds.high + 1e-9 * abs(energy)
    at_axis = error.at([(0.0, 0.25)]).stress[0]
    assert at_axis[0, 0] == pytest.approx(at_axis[2, 2], rel=0.01)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("number", [0, 2, 3, 4, 5, 6, 7])
def test_random_bodies(number):
    case = random_case(np.random.default_rng([7, number]), MPI.COMM_SELF)
    found = compared(case)
    assert found.own < UNBALANCED
    assert not found.apart
    assert found.index >= 0.99
    assert np.isnan(found.both) or found.both >= 0.97


@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("inner", [0.0, 1.0])
def test_rates(inner, degree):
    """A spinning disc, and a tube under pressure."""
    spin = ec.BodyForce((lambda x: 2 * x[0], 0.0))
    load = spin if inner == 0.0 else ec.Traction("left", pressure=1.0)
    sizes = []
    for cells in (4, 8, 16):
        scene, domain = tube(inner, (cells, cells // 2), loads=load)
        sizes.append(certified(scene, domain, degree=degree).absolute)
    assert -np.diff(np.log2(sizes)).min() > degree - 0.2


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_far_from_the_axis_it_is_plane_strain(degree):
    scene, domain = punched_ring(1000.0, (4, 4))
    ring = certified(scene, domain, degree=degree)
    plane = ec.Scene(ec.Elastic(E, NU), scene.supports, contacts=scene.contacts)
    flat = certified(plane, domain, degree=degree)
    around = ring.force("bottom").force[1] / (2 * np.pi * 1000.5)
    assert around == pytest.approx(flat.force("bottom").force[1], rel=1e-3)
    assert ring.relative == pytest.approx(flat.relative, rel=0.02)


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.on_ranks("0.3-0.0-1", "friction2-0.5-2")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("inner", [0.0, 0.5])
@pytest.mark.parametrize("friction", [0.0, 0.3, ec.Tresca(0.5)])
def test_methods_agree(friction, inner, degree):
    """Force, profile and status, of both methods and both solvers."""
    scene, domain = punched_ring(inner, (6, 6), friction)
    forces = []
    for method in METHODS:
        for solver in ("direct", "iterative"):
            error = certified(scene, domain, method, degree=degree, solver=solver)
            force = error.force("bottom").force[1]
            table = error.profile("bottom")
            assert table["pressure"] @ table["weight"] == pytest.approx(force, rel=1e-9)
            of_method = error.solution.profile("bottom")
            beyond = abs(of_method["pressure"] - table["pressure"]).max()
            assert beyond < 0.4 * table["pressure"].max()
            if COMM.size == 1:
                assert own_imbalance(error.admissible, np.random.default_rng(0)) < UNBALANCED
            forces.append(force)
    assert forces[0] == pytest.approx(forces[1], rel=1e-8)
    assert forces[2] == pytest.approx(forces[3], rel=1e-8)
    assert forces[0] == pytest.approx(forces[2], rel=0.01)


def test_constant_pressure_is_found_at_the_axis():
    """Between frictionless plates the stress is constant, also on the axis."""
    domain = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(3, 6))
    supports = ec.Displacement("top", (None, -0.02))
    for method in METHODS:
        scene = ec.Scene(RINGS, supports, contacts=ec.Contact("bottom"))
        error = certified(scene, domain, method)
        assert error.relative < 1e-8
        for table in (error.profile("bottom"), error.solution.profile("bottom")):
            assert table["pressure"] == pytest.approx(10.0, rel=1e-9)
        assert error.force("bottom").force[1] == pytest.approx(10.0 * np.pi, rel=1e-10)


def test_springs_and_foundations():
    """A rod on a bed of springs, and on a compliant foundation of the same stiffness."""
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    load = ec.Traction("top", (0.0, -1.0))
    stiffness = 50.0
    on_springs = ec.Scene(RINGS, loads=load, springs=ec.Spring("bottom", normal=stiffness))
    bed = ec.Contact("bottom", foundation=ec.Foundation(stiffness))
    on_bed = ec.Scene(RINGS, loads=load, contacts=bed)
    for scene in (on_springs, on_bed):
        error = certified(scene, domain)
        assert error.relative < 1e-9
        assert error.at([(0.5, 0.0)]).displacement[0, 1] == pytest.approx(-1 / stiffness)
        energy = ec.potential_energy(error).value
        assert energy == pytest.approx(-0.5 * np.pi * (1 / stiffness + 1 / E), rel=1e-9)


@pytest.mark.broad
@pytest.mark.serial
def test_a_table_may_begin_at_the_axis():
    """The gap of a table of two points is a line; its first kink is on the axis."""
    domain = ec.rectangle((0.0, 0.0), (1.5, 1.0), cells=(4, 3))
    support = ec.Displacement("top", (None, -0.02))
    found = []
    for gap in (ec.table([0.0, 1.5], [0.0, 0.03]), lambda x: 0.02 * x[0]):
        bed = ec.Foundation(300.0, tangential=100.0)
        contact = ec.Contact("bottom", friction=0.3, gap=gap, foundation=bed)
        found.append(certified(ec.Scene(RINGS, support, contacts=contact), domain).absolute)
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_springs_at_the_axis_take_one_solve(monkeypatch):
    """What springs pull at the axis is in the forces of the solver, and not in sigma^."""
    solves = []
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    springs = ec.Spring("top", normal=70 * E, tangential=E)
    scene = ec.Scene(
        RINGS,
        loads=ec.Traction("right", (1.0, -1.0)),
        springs=springs,
        contacts=ec.Contact("bottom"),
    )
    solution = ec.solve(scene, domain)
    kind = type(solution.stiffness)
    solve = kind.solve
    monkeypatch.setattr(kind, "solve", lambda *a, **k: solves.append(1) or solve(*a, **k))
    assert ec.equilibrate(solution).imbalance < 1e-12
    # One for each of the two pairs from which the better one is taken.
    assert len(solves) <= 2


def test_heat():
    """Free expansion has no stress; a ring on a cold foundation does not slip through."""
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    heat = ec.ThermalStrain(1e-3, 10.0)
    free = ec.Scene(RINGS, ec.Displacement("bottom", (None, 0.0)), strains=heat)
    error = certified(free, domain)
    assert error.relative == 0.0
    assert error.at([(1.0, 1.0)]).displacement[0] == pytest.approx([0.01, 0.01])
    tensor = ec.Eigenstrain(((1e-3, 0.0), (0.0, 0.0)))
    in_plane = ec.Scene(RINGS, free.supports, strains=tensor)
    with pytest.raises(ec.InputError, match="r, z and hoop"):
        certified(in_plane, domain)


def test_ties_and_bolts():
    """Rods that are tied are one; a level cut that is drawn together pulls."""
    whole = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(5, 5))
    halves = {"lower": ec.where(y=(0.0, 0.4)), "upper": ec.where(y=(0.4, 1.0))}
    cut = whole.named({}, regions=halves).split({"end": "lower", "start": "upper"})
    contact = ec.Contact("bottom", friction=0.3)
    punch = ec.Displacement("top", (0.0, -0.01))
    one = certified(ec.Scene(RINGS, punch, contacts=contact), whole)
    tied = certified(ec.Scene(RINGS, punch, contacts=contact, ties=ec.Tied("end", "start")), cut)
    assert tied.relative == pytest.approx(one.relative, rel=1e-8)
    assert tied.force("bottom").force == pytest.approx(one.force("bottom").force, rel=1e-9)
    ends = [ec.Displacement(end, (None, 0.0)) for end in ("bottom", "top")]
    bolt = ec.Scene(RINGS, ends, ties=ec.Preload("end", "start", force=3.0))
    error = certified(bolt, cut)
    # e is the root of what cancels: round-off is some 1e-8, and which depends on the cores.
    assert error.relative < 1e-8
    assert error.solution.shortening("end") == pytest.approx(3.0 / (np.pi * E), rel=1e-8)
    assert abs(error.force("top").force[1]) == pytest.approx(3.0, rel=1e-8)


@pytest.mark.broad
def test_goals():
    """The axial force has an interval, moments and rotations do not exist."""
    scene, domain = punched_ring(0.0, (6, 6), friction=0.0)
    error = certified(scene, domain, degree=2)
    force = ec.interval(error, ec.Resultant("bottom", (0.0, 1.0)))
    assert force.guaranteed
    fine = certified(*punched_ring(0.0, (24, 24), friction=0.0), degree=2)
    assert force.low <= fine.force("bottom").force[1] <= force.high
    bounds = ec.resultant(error, "bottom", (0.0, 1.0))
    assert bounds.guaranteed
    assert bounds.low <= fine.force("bottom").force[1] <= bounds.high
    mean = ec.interval(error, ec.MeanDisplacement("right", (1.0, 0.0)))
    points = [(1.0, z) for z in np.linspace(0.0, 1.0, 201)]
    exact = np.trapezoid(fine.at(points).displacement[:, 0], dx=1 / 200)
    assert mean.low <= exact <= mean.high
    for goal in (ec.Moment("bottom"), ec.Rotation("top")):
        with pytest.raises(ec.InputError, match="no moments"):
            ec.interval(error, goal)
    with pytest.raises(ec.InputError, match="meets the axis"):
        ec.interval(error, ec.Resultant("bottom", (1.0, 0.0)))


@pytest.mark.broad
def test_interval_of_an_exact_pair():
    """A column in a tube: nothing of its stress works on what moves the tube."""
    column = ec.rectangle((0.0, 0.0), (10.0, 40.0), cells=(2, 8))
    tube = ec.Displacement("right", (0.0, None))
    top, foot = ec.Traction("top", pressure=1.0), ec.Contact("bottom")
    error = certified(ec.Scene(RINGS, tube, top, foot), column, degree=2)
    force = ec.interval(error, ec.Resultant("right", (-1.0, 0.0)))
    assert force.guaranteed
    assert force.value == pytest.approx(800 * np.pi * NU / (1 - NU), rel=1e-9)
    assert force.high - force.low < 1e-9 * force.value


@pytest.mark.parametrize("held", [(0.0, None), None])
def test_rigid_faces_move_along_the_axis(held):
    _, domain = punched_ring(0.0, (4, 4))
    face = ec.Rigid("top", displacement=held, force=(None, -10.0))
    scene = ec.Scene(RINGS, face, contacts=ec.Contact("bottom", friction=0.2))
    error = certified(scene, domain)
    assert error.force("top").force[1] == pytest.approx(-10.0, rel=1e-10)
    assert error.force("bottom").force[1] == pytest.approx(10.0, rel=1e-10)
    u = error.at([(1.0, 1.0)]).displacement[0]
    assert (abs(u[0]) <= 1e-12 * abs(u[1])) == (held is not None)


def test_a_rigid_face_slides_along_r():
    """A column of height 1 in uniaxial stress: it widens freely, and nothing is left of e."""
    area = np.pi
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3))
    bottom = ec.Contact("bottom")
    for top in (ec.Rigid("top", force=(None, -10.0)), ec.Rigid("top", (None, -10.0 / (E * area)))):
        for method in METHODS:
            error = certified(ec.Scene(RINGS, top, contacts=bottom), domain, method, degree=2)
            assert error.relative < 1e-9
            assert error.force("top").force == pytest.approx([0.0, -10.0], rel=1e-9, abs=1e-9)
            moved = error.solution.motion("top")
            assert moved.displacement == pytest.approx([0.0, -10.0 / (E * area)], rel=1e-9)
            assert error.at([(1.0, 0.5)]).displacement[0, 0] == pytest.approx(NU * 10 / (E * area))
    goal = ec.interval(
        certified(ec.Scene(RINGS, ec.Rigid("top", force=(None, -10.0)), contacts=bottom), domain),
        ec.MeanDisplacement("top", (0.0, 1.0)),
    )
    assert goal.value == pytest.approx(-10.0 / (E * area), rel=1e-8)


@pytest.mark.serial
def test_what_rigid_faces_of_rings_refuse():
    for given in (
        {"displacement": (0.0, None), "force": (None, -10.0), "moment": 0.0},
        {"displacement": (0.1, None), "force": (None, -10.0)},
        {"force": (0.0, -10.0)},
        {"rotation": 0.1, "force": (None, -10.0)},
    ):
        with pytest.raises(ec.InputError, match="along the axis only"):
            ec.Scene(RINGS, ec.Rigid("top", **given))
    with pytest.raises(ec.InputError, match="neither of displacement in x"):
        ec.Scene(ec.Elastic(E, NU), ec.Rigid("top", force=(None, -10.0)))


def test_what_the_axis_refuses():
    scene, domain = punched_ring(0.0, (4, 4))
    with pytest.raises(ec.InputError, match="on the axis"):
        certified(ec.Scene(RINGS, ec.Displacement("left", (0.0, 0.0))), domain)
    with pytest.raises(ec.InputError, match="or the axis"):
        certified(ec.Scene(RINGS, ec.Displacement("top", (0.1, 0.0))), domain)
    with pytest.raises(ec.InputError, match=r"x\[0\] = -1 < 0"):
        certified(scene, ec.rectangle((-1.0, 0.0), (1.0, 1.0), cells=(2, 2)))
    with pytest.raises(ec.NotHeldError, match="along the axis z"):
        certified(ec.Scene(RINGS, loads=ec.Traction("top", pressure=1.0)), domain)
    cube = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(1, 1, 1))
    with pytest.raises(ec.InputError, match="half plane"):
        certified(ec.Scene(RINGS, ec.Displacement("top", (0.0, 0.0, 0.0))), cube)


@pytest.mark.broad
@pytest.mark.parametrize("strategy", [ec.Mark(), ec.SizeMap()])
def test_runs_reach_their_accuracy(strategy):
    """A layer on a ball: the force of an integral equation, 2 255.374."""
    layer = ec.rectangle((0.0, 0.0), (100.0, 10.0), size=3.0)
    ball = ec.Contact("bottom", gap=lambda x: x[0] ** 2 / 1000)
    scene = ec.Scene(RINGS, ec.Displacement("top", (0.0, -0.1)), contacts=ball)
    history = ec.adapt(scene, layer, accuracy=0.01, degree=2, strategy=strategy)
    assert history.error.relative <= 0.01
    assert history.force("bottom").force[1] == pytest.approx(2255.374380, rel=5e-4)
    bounds = ec.resultant(history, "bottom", (0.0, 1.0))
    assert bounds.low <= 2255.374380 <= bounds.high
    energy = ec.potential_energy(history)
    assert energy.low <= 79.38378369 <= energy.high


@pytest.mark.broad
def test_press_fit_of_two_tubes():
    """Lame: 1 to 2 in 2 to 3, interference 0.01, strain plane along z."""
    inner = ec.rectangle((1.0, 0.0), (3.0, 1.0), cells=(8, 4))
    inner = inner.named(
        {}, regions={"shaft": ec.where(x=(1.0, 2.0)), "hub": ec.where(x=(2.0, 3.0))}
    )
    domain = inner.split({"rim": "shaft", "bore": "hub"})
    ends = [ec.Displacement(end, (None, 0.0)) for end in ("bottom", "top")]
    fit = ec.Contact("rim", against="bore", gap=-0.01, friction=0.2)
    error = certified(ec.Scene(RINGS, ends, contacts=fit), domain, degree=2)
    of_shaft = -4 / 3 * ((1 - 2 * NU) * 2 + 1 / 2)
    of_hub = 4 / 5 * ((1 - 2 * NU) * 2 + 9 / 2)
    pressure = 0.01 * E / (1 + NU) / (of_hub - of_shaft)
    assert -error.force("rim").force[0] == pytest.approx(4 * np.pi * pressure, rel=2e-3)
    assert error.force("rim").force == pytest.approx(-error.force("bore").force)


@pytest.mark.broad
def test_a_run_goes_on_from_its_folder(shared_tmp_path):
    scene, domain = punched_ring(0.0, (4, 4))
    whole = ec.adapt(scene, domain, 0.02, max_steps=4)
    ec.adapt(scene, domain, 0.02, max_steps=2, checkpoint=shared_tmp_path)
    again = ec.adapt(scene, domain, 0.02, max_steps=4, checkpoint=shared_tmp_path)
    assert again.error.relative == pytest.approx(whole.error.relative, rel=1e-10)
    assert again.force("bottom").force == pytest.approx(whole.force("bottom").force, rel=1e-10)
    plane = ec.Scene(ec.Elastic(E, NU), scene.supports, contacts=scene.contacts)
    with pytest.raises(ec.InputError, match=r"another run: material\.hypothesis"):
        ec.adapt(plane, domain, 0.02, checkpoint=shared_tmp_path)


@pytest.mark.ranks
@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_ranks_agree(degree):
    """A scene with springs, loads of all kinds and a gap, on any number of ranks."""

    def scene_on(comm) -> ec.ConstitutiveError:
        domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(5, 5), comm=comm)
        scene = ec.Scene(
            RINGS,
            springs=ec.Spring("top", normal=500.0, tangential=100.0),
            loads=[ec.Traction("top", (0.0, -10.0)), ec.BodyForce((lambda x: 3 * x[0], -1.0))],
            contacts=ec.Contact("bottom", friction=0.3, gap=lambda x: 0.001 * x[0] ** 2),
        )
        return certified(scene, domain, degree=degree)

    here, alone = scene_on(COMM), scene_on(MPI.COMM_SELF)
    assert here.relative == pytest.approx(alone.relative, rel=1e-8)
    assert here.force("bottom").force == pytest.approx(alone.force("bottom").force, rel=1e-9)
    table, whole = here.profile("bottom"), alone.profile("bottom")
    assert table["pressure"] == pytest.approx(whole["pressure"], rel=1e-7, abs=1e-9)
