"""Contact between two bodies: known solutions, action and reaction, admissible pairs, limits.

Properties: piecewise linear solutions are found and certified to round-off by every
method, solver and degree; the bodies' forces are opposite and in equilibrium; the pair
keeps the contact conditions between nodes, too; symmetric bodies are one body; a stiff
body is a foundation; neither units nor the order of the bodies matter.
"""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from bricks import NAMES, bricks, glued, lower_brick, small_bricks
from domains import partly_broad, refused
from mpi4py import MPI
from reference import _barycentric, _sigma
from scenes import certified

import erc_contact as ec
from erc_contact.admissible.pair import Admissible
from erc_contact.output.evolutions import moving_side, plot_loop, plot_zones
from erc_contact.scene.material import mandel_basis
from namedmesh.base.releases import cell_nodes

import gmsh  # isort: skip - after erc_contact, as in all tests

COMM = MPI.COMM_WORLD
UPPER, LOWER = NAMES
MATERIAL = ec.Elastic(E={"upper": 1000.0, "lower": 300.0}, nu={"upper": 0.3, "lower": 0.25})
POINTS = 40
"""Random points on each facet."""
METHODS = (ec.Nitsche(), ec.Nitsche(theta=1), ec.Nitsche(theta=-1), ec.AugmentedLagrangian())


def vector(d: int, x: object, y: object) -> tuple:
    """A vector with its first and last component; the one between them is zero."""
    return (x, *(0.0,) * (d - 2), y)


def contact(**options: object) -> ec.Contact:
    return ec.Contact(UPPER, against=LOWER, **options)


def fixed(d: int) -> ec.Displacement:
    return ec.Displacement("lower outer", (0.0,) * d)


def pressed_pair(d: int, **options: object) -> ec.Scene:
    """The upper body's top is moved down and a little along; the lower one is held."""
    down = ec.Displacement("upper outer", vector(d, 0.01, -0.05))
    return ec.Scene(MATERIAL, [down, fixed(d)], [], [contact(**options)])


# -- patches
# ---------------------------------------------------------------------------------------------------

PATCHES = {
    # a and g of upper and lower body, difference of c, sigma_xx of the lower body, sigma_xy
    "slip": (0.0039, 0.0096, 0.02, 0.0, 3.0),
    "stick": (0.0039, 0.0039, 0.0, -1.484375, 2.0),
    "smooth": (0.0039, 0.0096, 0.02, 0.0, 0.0),
}


def patch(name: str, d: int) -> tuple[ec.Scene, dict]:
    """Two bodies of E 1000, 250 and nu 0.3, 0.2 in homogeneous states of plane strain.

    Under the pressure 10 the contact slips by 0.02 - 0.0057 x, or sticks. Returns the
    scene, and u of each body as a function of positions (n, d).
    """
    a_upper, a_lower, c, sigma_xx, shear = PATCHES[name]
    E, nu = {"upper": 1000.0, "lower": 250.0}, {"upper": 0.3, "lower": 0.2}
    b_lower = -0.0384 if sigma_xx == 0 else -0.036975
    slope = {body: shear * 2 * (1 + nu[body]) / E[body] for body in E}
    numbers = {
        "upper": (a_upper, slope["upper"], c + 0.004, -0.0091),
        "lower": (a_lower, slope["lower"], 0.004, b_lower),
    }
    supports, loads = [], []
    for body, (a, g, move, b) in numbers.items():
        u = (
            lambda x, a=a, g=g, move=move: a * x[0] + g * x[d - 1] + move,
            lambda x, b=b: b * x[d - 1],
        )
        supports.append(ec.Displacement(f"{body} outer", vector(d, *u)))
        side = vector(d, sigma_xx if body == "lower" else 0.0, shear)
        loads.append(ec.Traction(f"{body} right", side))
        loads.append(ec.Traction(f"{body} left", tuple(-part for part in side)))
        if d == 3:
            supports += [
                ec.Displacement(f"{body} {n}", (None, 0.0, None)) for n in ("front", "back")
            ]
    friction = 0.0 if shear == 0 else 0.3
    scene = ec.Scene(ec.Elastic(E, nu), supports, loads, [contact(friction=friction)])

    def exact(body: str, x: np.ndarray) -> np.ndarray:
        a, g, move, b = numbers[body]
        u = np.zeros_like(x)
        u[:, 0] = a * x[:, 0] + g * x[:, -1] + move
        u[:, -1] = b * x[:, -1]
        return u

    return scene, exact


def distance(solution: ec.Solution, exact) -> float:
    """Largest difference of u from the exact one of its body, over the largest u; collective."""
    space = solution.model.space
    x = space.V.tabulate_dof_coordinates()[:, : space.d]
    u = solution.u.x.array.reshape(-1, space.d)
    differences, sizes = [0.0], [0.0]
    for body in ("upper", "lower"):
        nodes = np.unique(space.nodes[space.domain.region(body)])
        wanted = exact(body, x[nodes])
        differences.append(abs(u[nodes] - wanted).max(initial=0.0))
        sizes.append(abs(wanted).max(initial=0.0))
    return COMM.allreduce(max(differences), MPI.MAX) / COMM.allreduce(max(sizes), MPI.MAX)


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.on_ranks("2-2-slip", "3-1-stick")
@pytest.mark.parametrize(
    ("d", "degree", "name"),
    [*product((2, 3), (1, 2), ("slip", "stick")), (2, 1, "smooth")],
)
def test_patch(d, degree, name):
    """Every method and solver finds the exact solution, and it has no error."""
    scene, exact = patch(name, d)
    # The variants of Nitsche's method differ by terms that know no ranks, d and degree.
    methods = METHODS if COMM.size == 1 and d == degree + 1 == 2 else METHODS[::3]
    for method, solver in product(methods, ("direct", "iterative")):
        solution = ec.solve(scene, small_bricks(d), method, degree=degree, solver=solver)
        case = f"{method}, {solver}"
        assert distance(solution, exact) < 1e-9, case
        if solver == "direct":
            error = ec.constitutive_error(ec.equilibrate(solution))
            assert error.relative < 1e-9, case


def test_dissipation_of_a_patch():
    """The slip 0.02 - 0.0057 x under the shear 3 turns 0.12 into heat."""
    error = certified(patch("slip", 2)[0], small_bricks(2))
    (traction,) = error.admissible.tractions
    trace = traction.contact.trace
    jump = trace.of(error.admissible.displacement.x.array)
    work = -(traction.values * jump).sum(axis=2).mean(axis=1) @ trace.here.owned_areas
    # The pressure does no work, and both fields are linear: a mean over nodes is exact
    # where one of them is constant.
    assert COMM.allreduce(float(work)) == pytest.approx(0.12, rel=1e-9)


# -- action and reaction, equilibrium, admissibility
# ---------------------------------------------------------------------------------------------------


def parabola(x):
    return 0.03 * x[0] ** 2


def loose(d: int, friction: object = 0.4) -> ec.Scene:
    """Contact alone holds the upper body, which a traction presses and pushes."""
    load = ec.Traction("upper outer", vector(d, 0.5, -3.0))
    return ec.Scene(MATERIAL, [fixed(d)], [load], [contact(friction=friction)])


def chain(d: int) -> ec.Scene:
    """Nothing holds the bodies but contact with each other, and with a foundation."""
    load = ec.Traction("upper outer", vector(d, 0.1, -3.0))
    floor = ec.Contact("lower outer", friction=0.5)
    return ec.Scene(MATERIAL, [], [load], [contact(friction=0.4), floor])


def corner(d: int) -> ec.Scene:
    """A wall touches both bodies beside their contact."""
    load = ec.Traction("upper outer", vector(d, -0.5, -3.0))
    walls = [ec.Contact("lower left"), ec.Contact("upper left")]
    return ec.Scene(MATERIAL, [fixed(d)], [load], [contact(friction=0.4), *walls])


def half_upper(d: int) -> ec.Scene:
    """A plane of symmetry holds the upper body alone at the rim of the contact."""
    symmetry = ec.Displacement("upper left", (0.0, *(None,) * (d - 1)))
    down = ec.Displacement("upper outer", (*(None,) * (d - 1), -0.05))
    return ec.Scene(MATERIAL, [fixed(d), symmetry, down], [], [contact(friction=0.2)])


def half_lower(d: int) -> ec.Scene:
    """A plane of symmetry holds the lower body alone at the rim of the contact."""
    symmetry = ec.Displacement("lower left", (0.0, *(None,) * (d - 1)))
    down = ec.Displacement("upper outer", vector(d, 0.0, -0.05))
    return ec.Scene(MATERIAL, [fixed(d), symmetry, down], [], [contact(friction=0.2)])


def half_both(d: int) -> ec.Scene:
    """A plane of symmetry holds both bodies at the rim of the contact."""
    free = (None,) * (d - 1)
    symmetry = [ec.Displacement(f"{body} left", (0.0, *free)) for body in ("lower", "upper")]
    down = ec.Displacement("upper outer", (*free, -0.05))
    return ec.Scene(MATERIAL, [fixed(d), *symmetry, down], [], [contact(friction=0.2)])


SCENES = {
    "pressed": lambda d: pressed_pair(d, friction=0.3),
    "gap": lambda d: pressed_pair(d, friction=0.2, gap=parabola),
    "Tresca": lambda d: pressed_pair(d, friction=ec.Tresca(0.5), gap=parabola),
    "bilateral": lambda d: pressed_pair(d, bilateral=True),
    "interference": lambda d: ec.Scene(
        MATERIAL,
        [ec.Displacement("upper outer", (0.0,) * d), fixed(d)],
        [],
        [contact(friction=0.3, gap=-0.02)],
    ),
    "loose": loose,
    "chain": chain,
    "corner": corner,
    "half upper": half_upper,
    "half lower": half_lower,
    "half both": half_both,
}
# The laws of a scene make its forms: in 3D and at degree 2 a few are enough.
CASES = [*product((2,), (1,), SCENES), *product((2,), (2,), ("gap", "corner"))]
CASES += product((3,), (1,), ("gap", "corner"))


BROADER = [*product((2,), (1,), ("pressed", "Tresca", "corner", "half upper", "half lower"))]
BROADER += [(2, 2, "gap"), (3, 1, "corner")]


@pytest.fixture(
    scope="module",
    params=partly_broad(CASES, BROADER),
    ids=lambda case: f"{case[0]}D-{case[1]}-{case[2]}",
)
def error(request):
    """The certified error of a scene."""
    d, degree, name = request.param
    return certified(SCENES[name](d), small_bricks(d), degree=degree)


@pytest.mark.on_ranks(
    "2D-1-interference", "2D-1-chain", "2D-2-corner", "3D-1-gap", "2D-1-half both"
)
def test_action_is_reaction(error):
    """The forces of both sides are opposite, with their moments, of u and of sigma^.

    Each body is in equilibrium: so are both together, and the reactions of the lower
    body's supports are the loads on the upper one.
    """
    for result in (error.solution, error):
        upper, lower = result.force(UPPER), result.force(LOWER)
        size = abs(upper.force).max()
        assert size > 0
        assert abs(upper.force + lower.force).max() < 1e-12 * size
        assert abs(upper.moment + lower.moment).max() < 1e-12 * size
        forces = dict(result.reactions())
        balance = forces.pop("balance")
        assert abs(balance.force).max() < 1e-9 * size
        assert abs(balance.moment).max() < 1e-9 * size
        for body in ("upper", "lower"):
            of_body = [force for part, force in forces.items() if part.startswith(body)]
            if body == "upper" and "tractions" in forces:
                of_body.append(forces["tractions"])
            assert abs(sum(part.force for part in of_body)).max() < 1e-9 * size
            assert abs(sum(part.moment for part in of_body)).max() < 1e-9 * size


@pytest.mark.parametrize("solver", ["direct", "iterative"])
def test_bodies_that_fit_tightly_move_together(solver):
    """Without the interference nothing is deformed: it alone is the scale of forces."""

    def held_at(way: tuple[float, float]) -> ec.Solution:
        ends = [ec.Displacement(f"{body} outer", way) for body in ("upper", "lower")]
        scene = ec.Scene(MATERIAL, ends, [], [contact(friction=0.3, gap=-0.02)])
        return ec.solve(scene, small_bricks(2), solver=solver)

    way = (0.3, -0.2)
    at_rest, moved = held_at((0.0, 0.0)), held_at(way)
    shift = moved.u.x.array.reshape(-1, 2) - at_rest.u.x.array.reshape(-1, 2)
    assert abs(shift - way).max(initial=0.0) < 1e-9
    force = at_rest.force(UPPER).force
    assert abs(moved.force(UPPER).force - force).max() < 1e-8 * abs(force).max()


@pytest.mark.serial
@pytest.mark.parametrize("length", [1e-6, pytest.param(1e3, marks=pytest.mark.broad)])
def test_a_fit_alone_is_solved_in_any_units(length):
    """No load and no support that moves tells how large forces are."""

    def pressure(unit: float) -> float:
        cells = (2, 2, 2)
        lower = ec.box((0.0, 0.0, 0.0), (unit, unit, unit), cells=cells)
        upper = ec.box((0.0, 0.0, unit), (0.7 * unit, unit, 2 * unit), cells=cells)
        joined = ec.assembly({"lower": lower, "upper": upper})
        joined = joined.joined("upper bottom", "lower top")
        ends = [ec.Displacement(part, (0.0,) * 3) for part in ("lower bottom", "upper top")]
        fit = ec.Contact(
            "upper bottom", against="lower top", gap=lambda x: 0.01 * (x[0] - 0.3 * unit)
        )
        scene = ec.Scene(ec.Elastic(1.0, 0.3), ends, [], [fit])
        solution = ec.solve(scene, joined, solver="direct")
        return float(solution.force("upper bottom").force[2] / unit**2)

    assert pressure(length) == pytest.approx(pressure(1.0), rel=1e-9)


@pytest.mark.broad
@pytest.mark.parametrize("d", [2, 3])
def test_either_side_of_a_history(d):
    """Each accessor of a history takes either name; forces of both sides are opposite."""

    def scene_at(time: float) -> ec.Scene:
        down = ec.Displacement("upper outer", vector(d, 0.02 * time, -0.05))
        return ec.Scene(MATERIAL, [down, fixed(d)], [], [contact(friction=0.3)])

    history = ec.evolve(scene_at, small_bricks(d), [0.0, 1.0], 0.9)
    upper, lower = history.force(UPPER), history.force(LOWER)
    size = abs(upper).max()
    assert upper.shape == lower.shape == (2, d)
    assert abs(upper + lower).max() < 1e-12 * size
    for side in NAMES:
        of_steps = np.array([error.force(side).force for error in history.errors])
        assert abs(history.force(side) - of_steps).max() < 1e-12 * size
        assert abs(history.reactions()[side].force - of_steps).max() < 1e-12 * size
    for here, there in zip(history.profile(UPPER), history.profile(LOWER), strict=True):
        assert np.array_equal(here, there)
    for side, facing in zip(NAMES, NAMES[::-1], strict=True):
        axes = plot_loop(history, side)
        if COMM.rank == 0:
            assert axes.get_ylabel() == f"shear on {facing} [force]"
    refused(lambda: history.force("foot"), "'foot'", UPPER, LOWER)


@pytest.mark.serial
@pytest.mark.parametrize("driven", ["moved", pytest.param("loaded", marks=pytest.mark.broad)])
def test_a_loop_is_drawn_over_what_moves(driven):
    """The body below is clamped, and named first: its displacement is no abscissa."""

    def scene_at(time: float) -> ec.Scene:
        supports = [fixed(2)]
        loads = []
        if driven == "moved":
            supports.append(ec.Displacement("upper outer", vector(2, 0.02 * time, -0.05)))
        else:
            loads.append(ec.Traction("upper outer", vector(2, time, -10.0)))
        return ec.Scene(MATERIAL, supports, loads, [contact(friction=0.3)])

    history = ec.evolve(scene_at, small_bricks(2), [0.0, 1.0], 0.9)
    axes = plot_loop(history, UPPER)
    assert axes.get_xlabel() == "mean displacement of upper outer [length]"
    assert np.ptp(axes.lines[0].get_xdata()) > 1e-4
    clamped = plot_loop(history, UPPER, part="lower outer")
    assert clamped.get_xlabel() == "mean displacement of lower outer [length]"


@pytest.mark.serial
def test_a_loop_is_not_drawn_over_a_roller_and_zones_begin_with_the_history():
    """The roller on top follows what is pushed at the right."""

    def scene_at(time: float) -> ec.Scene:
        roller = ec.Displacement("top", (None, -0.03))
        push = ec.Traction("right", (6e-3 * float(np.sin(time)), 0.0))
        bottom = ec.Contact("bottom", friction=0.3)
        return ec.Scene(ec.Elastic(1.0, 0.3), roller, push, contacts=bottom)

    body = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(6, 3))
    history = ec.evolve(scene_at, body, [0.0, 1.5, 3.0], 0.9)
    axes = plot_loop(history, "bottom")
    assert axes.get_xlabel() == "mean displacement of right [length]"
    low, high = plot_zones(history, "bottom").get_xlim()
    assert (low, high) == (0.0, 3.0)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("first", [UPPER, LOWER])
def test_the_loop_of_a_report_is_that_of_the_side_that_moves(first):
    """Its area is the energy that friction takes, whichever side the scene names first."""
    pair = ec.Contact(first, against=LOWER if first == UPPER else UPPER, friction=0.3)

    def scene_at(time: float) -> ec.Scene:
        way = 0.05 * float(np.sin(0.5 * np.pi * time))
        down = ec.Displacement("upper outer", vector(2, way, -0.05))
        return ec.Scene(MATERIAL, [down, fixed(2)], [], [pair])

    history = ec.evolve(scene_at, small_bricks(2), np.arange(6.0), 0.9)
    side = moving_side(history, history.error.model.contact(first))
    assert side == UPPER
    way, shear = plot_loop(history, side).lines[0].get_data()
    assert np.trapezoid(shear, way) > 0.3 * history.column("dissipated")[-1]


def test_scenes_of_a_history_name_the_sides_alike():
    """The slip of the last step is the slip of the side named first."""
    scene = pressed_pair(2, friction=0.3)
    last = ec.solve(scene, small_bricks(2))
    turned = replace(scene, contacts=[ec.Contact(LOWER, against=UPPER, friction=0.3)])
    refused(lambda: ec.solve(turned, small_bricks(2), after=last), "another order", "alike")


@pytest.mark.on_ranks("2-half upper", "3-half lower")
@pytest.mark.parametrize("name", ["half upper", "half lower", "half both"])
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_action_is_reaction_of_multipliers(d, name):
    """Also at the rim, where a support holds one body alone."""
    solution = ec.solve(SCENES[name](d), small_bricks(d), ec.AugmentedLagrangian())
    upper, lower = solution.force(UPPER), solution.force(LOWER)
    size = abs(upper.force).max()
    assert abs(upper.force + lower.force).max() < 1e-12 * size
    assert abs(upper.moment + lower.moment).max() < 1e-12 * size
    # The forces of each body's supports and contact balance.
    forces = solution.reactions()
    for body in ("upper", "lower"):
        of_body = [force for part, force in forces.items() if part.startswith(body)]
        assert abs(sum(part.force for part in of_body)).max() < 1e-9 * size


def corners_of(domain: ec.Domain, facets: np.ndarray) -> np.ndarray:
    """Positions of the corners of pairs (cell, local facet), shape (f, d, d)."""
    d = domain.dim
    geometry = domain.mesh.geometry
    corner = np.array([np.delete(np.arange(d + 1), local) for _, local in facets], dtype=int)
    nodes = np.take_along_axis(cell_nodes(geometry)[facets[:, 0]], corner.reshape(-1, d), axis=1)
    return geometry.x[nodes][..., :d]


def displacement_in(pair: Admissible, cells: np.ndarray, x: np.ndarray) -> np.ndarray:
    """u^ at points (f, q, d) of cells (f,), as the field of a body, shape (f q, d)."""
    d = x.shape[2]
    three = np.pad(x.reshape(-1, d), ((0, 0), (0, 3 - d)))
    return pair.displacement.eval(three, np.repeat(cells, x.shape[1])).reshape(-1, d)


def traction_in(pair: Admissible, cells: np.ndarray, x: np.ndarray) -> np.ndarray:
    """sigma^ n of owned cells at points, n from the upper body into the lower one."""
    d = x.shape[2]
    of_points = np.repeat(cells, x.shape[1])
    mandel = _sigma(pair, of_points, _barycentric(pair, of_points, x.reshape(-1, d)))
    return -np.einsum("ns,si->ni", mandel, mandel_basis(d)[:, :, -1])


@pytest.mark.on_ranks(
    "2D-1-interference", "2D-1-chain", "2D-2-corner", "3D-1-gap", "2D-1-half both"
)
def test_pair_keeps_the_conditions(error):
    """The jump of u^ does not enter the gap, r^ is in the cone, and sigma^ n is opposite.

    At random points of the facets, of the fields of both bodies.
    """
    pair = error.admissible
    domain = pair.domain
    here, there = domain.facing(UPPER, LOWER)
    owned = here[:, 0] < domain.owned_cells
    corners = corners_of(domain, here[owned])
    x = np.matmul(np.random.default_rng(COMM.rank).dirichlet(np.ones(domain.dim), POINTS), corners)
    upper, lower = (displacement_in(pair, cells[owned, 0], x) for cells in (here, there))
    jump = -(upper - lower)[:, -1]
    (law,) = [c for c in pair.solution.scene.contacts if c.facets == UPPER]
    gap = law.gap(x.reshape(-1, x.shape[2]).T) if callable(law.gap) else law.gap
    size = COMM.allreduce(abs(pair.displacement.x.array).max(initial=0.0), MPI.MAX)
    excess = abs(jump - gap) if law.bilateral else jump - gap
    assert excess.max(initial=0.0) < 1e-12 * size

    traction = traction_in(pair, here[owned, 0], x)
    peak = COMM.allreduce(abs(pair.stress).max(initial=0.0), MPI.MAX)
    pressure = traction[:, -1]
    if not law.bilateral:
        assert pressure.min(initial=0.0) > -1e-12 * peak
    shear = np.linalg.norm(traction[:, :-1], axis=1)
    limit = law.friction.limit if isinstance(law.friction, ec.Tresca) else law.friction * pressure
    assert (shear - limit).max(initial=0.0) < 1e-12 * peak
    # sigma^ is known in the cells of a rank alone: each gets all points of all ranks.
    table = zip(*COMM.allgather((corners.mean(axis=1), x, traction.reshape(x.shape))), strict=True)
    middles, x, traction = (np.concatenate(column) for column in table)
    there = there[there[:, 0] < domain.owned_cells]
    facing = corners_of(domain, there).mean(axis=1)
    match = np.linalg.norm(facing[:, None] - middles, axis=2).argmin(axis=1)
    opposite = traction_in(pair, there[:, 0], x[match]) - traction[match].reshape(-1, x.shape[2])
    assert abs(opposite).max(initial=0.0) < 1e-11 * peak
    assert COMM.allreduce(len(there)) == len(middles) > 0


# -- symmetry and limits
# ---------------------------------------------------------------------------------------------------


def pressed_from_both_ends(d: int, contacts: list, bodies: tuple[str, ...]) -> ec.Scene:
    """Bodies whose outer ends move to the joint, and whose right sides are pulled."""
    ends = [
        ec.Displacement(f"{body} outer", vector(d, 0.0, -0.04 if body == "upper" else 0.04))
        for body in bodies
    ]
    pulled = [ec.Traction(f"{body} right", vector(d, 1.0, 0.0)) for body in bodies]
    return ec.Scene(ec.Elastic(1000.0, 0.3), ends, pulled, contacts)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("d", "degree"), [(2, 1), pytest.param(2, 2, marks=pytest.mark.broad), (3, 1)]
)
@pytest.mark.parametrize("method", METHODS[::3], ids=["Nitsche", "multiplier"])
def test_two_bricks_are_one(d, degree, method):
    """Two equal bricks are twice one on a plane, and one of twice the height.

    The joint is a plane of symmetry: it neither shears nor opens. A multiplier keeps
    this at each node, as the brick of twice the height does.
    """
    cells = (4, 2) if d == 2 else (2, 2, 1)
    bodies = ("lower", "upper")
    two = certified(
        pressed_from_both_ends(d, [contact()], bodies), small_bricks(d), method, degree=degree
    )
    plane = certified(
        pressed_from_both_ends(d, [ec.Contact(LOWER)], bodies[:1]),
        lower_brick(d, cells),
        method,
        degree=degree,
    )
    # Nitsche's trial traction has one body's stress, and the jump is twice u.
    same = 1e-9 if method.multiplier else 0.05
    assert two.absolute**2 == pytest.approx(2 * plane.absolute**2, rel=2 * same)
    assert two.relative == pytest.approx(plane.relative, rel=same)
    size = np.linalg.norm(plane.force(LOWER).force)
    assert two.force(LOWER).force == pytest.approx(plane.force(LOWER).force, abs=same * size)
    assert two.force(LOWER).moment == pytest.approx(plane.force(LOWER).moment, abs=same * size)
    if method.multiplier:
        one = ec.solve(pressed_from_both_ends(d, [], bodies), glued(d, cells), degree=degree)
        for body in bodies:
            reaction = two.solution.force(f"{body} outer")
            wanted = one.force(f"{body} outer")
            assert reaction.force == pytest.approx(wanted.force, rel=1e-9, abs=1e-9)
            assert reaction.moment == pytest.approx(wanted.moment, rel=1e-9, abs=1e-9)


@pytest.mark.pairs
@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.0, 0.3, ec.Tresca(0.5)], ids=["none", "Coulomb", "Tresca"])
@pytest.mark.parametrize("lower", [300.0, 900.0, 1000.0])
@pytest.mark.parametrize(
    ("degree", "method"),
    [(1, METHODS[0]), (1, METHODS[3]), pytest.param(2, METHODS[0], marks=pytest.mark.broad)],
)
def test_order_of_the_bodies(friction, lower, degree, method):
    """Which body is named first changes nothing, where both are as stiff, too."""
    domain = order_domain()
    scene = pressed_pair(2, friction=friction, gap=parabola)
    material = ec.Elastic(E={"upper": 1000.0, "lower": lower}, nu=MATERIAL.nu)
    other = ec.Contact(LOWER, against=UPPER, friction=friction, gap=parabola)
    one, two = (
        certified(ec.Scene(material, scene.supports, [], [entry]), domain, method, degree=degree)
        for entry in (*scene.contacts, other)
    )
    assert two.relative == pytest.approx(one.relative, rel=1e-9)
    for name in NAMES:
        wanted = one.force(name).force
        difference = np.linalg.norm(wanted - two.force(name).force) / np.linalg.norm(wanted)
        assert difference < 1e-9


@cache
def order_domain() -> ec.Domain:
    return bricks(2, (8, 4))


@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS[::3], ids=["Nitsche", "multiplier"])
@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_stiff_body_is_a_foundation(degree, method):
    """As the lower body gets stiffer the upper one's force tends to that on a foundation.

    The difference falls as one over the stiffness.
    """
    down = ec.Displacement("upper outer", (0.01, -0.05))
    domain = small_bricks(2)
    stiff = ec.Displacement("lower outer", (0.0, 0.0))
    rigid = ec.Scene(MATERIAL, [down, stiff], [], [ec.Contact(UPPER, friction=0.3, gap=parabola)])
    wanted = certified(rigid, domain, method, degree=degree)
    force = wanted.force(UPPER).force
    differences = []
    for ratio in (1e3, 1e6):
        material = ec.Elastic(E={"upper": 1000.0, "lower": 1000.0 * ratio}, nu=MATERIAL.nu)
        # The stiff body may come first, too.
        first = ec.Contact(LOWER, against=UPPER, friction=0.3, gap=parabola)
        law = first if ratio > 1e4 else contact(friction=0.3, gap=parabola)
        found = certified(
            ec.Scene(material, [down, stiff], [], [law]), domain, method, degree=degree
        )
        differences.append(np.linalg.norm(found.force(UPPER).force - force) / np.linalg.norm(force))
        assert found.relative == pytest.approx(wanted.relative, rel=10 / ratio)
    assert differences[0] < 3e-3
    assert 500 < differences[0] / differences[1] < 2000


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("method", METHODS[::3], ids=["Nitsche", "multiplier"])
def test_units(d, solver, method):
    """Lengths and moduli times 1e-9 and 1e9 give the same numbers, scaled."""
    results = []
    for size, modulus in ((1.0, 1.0), (1e-9, 1e9), (1e9, 1e-9), (1e-9, 1e-9), (1e9, 1e9)):
        cells = (4, 2) if d == 2 else (2, 2, 1)
        domain = bricks(d, cells, size=size)
        E = {"upper": 1000.0 * modulus, "lower": 300.0 * modulus}
        material = ec.Elastic(E=E, nu=MATERIAL.nu)
        held = ec.Displacement("lower outer", (0.0,) * d)
        load = ec.Traction("upper outer", vector(d, 0.5 * modulus, -3.0 * modulus))
        law = contact(friction=0.4, gap=lambda x, size=size: 0.003 / size * x[0] ** 2)
        scene = ec.Scene(material, [held], [load], [law])
        error = certified(scene, domain, method, solver=solver)
        force = error.force(UPPER)
        unit = modulus * size ** (d - 1)
        results.append([error.relative, *force.force / unit, *force.moment / (unit * size)])
    for result in results[1:]:
        assert result == pytest.approx(results[0], rel=1e-9, abs=1e-9)


# -- input
# ---------------------------------------------------------------------------------------------------


WRONG = {
    "a part that is not there": (
        lambda: ec.Contact("punch", against=LOWER),
        ("'punch'", UPPER),
    ),
    "a partner that is not there": (
        lambda: ec.Contact(UPPER, against="block"),
        ("'block'", UPPER, LOWER),
    ),
    "parts that are no pair": (
        lambda: ec.Contact(UPPER, against="lower right"),
        ("'lower right'", UPPER, LOWER),
    ),
    "a part against itself": (
        lambda: ec.Contact(UPPER, against=UPPER),
        (UPPER, "itself"),
    ),
    "a partner that is no name": (lambda: ec.Contact(UPPER, against=3), ("against", "3")),
    "both names, each with a contact": (
        lambda: [contact(), ec.Contact(LOWER, against=UPPER)],
        (UPPER, "2 contacts"),
    ),
    "a side that has a foundation, too": (
        lambda: [contact(), ec.Contact(LOWER)],
        (LOWER, "2 contacts"),
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input(name):
    make, words = WRONG[name]
    support = ec.Displacement("lower outer", (0.0, 0.0))
    refused(lambda: ec.solve(ec.Scene(MATERIAL, support, (), make()), small_bricks(2)), *words)


def test_one_body_has_no_pairs():
    scene = pressed_pair(2)
    whole = glued(2, (4, 2))
    refused(lambda: ec.solve(scene, whole), UPPER)


@pytest.mark.parametrize("side", NAMES)
def test_sides_of_a_contact_carry_nothing_else(side):
    for entry in (ec.Displacement(side, (0.0, 0.0)), ec.Traction(side, (0.0, 1.0))):
        kind = "supports" if isinstance(entry, ec.Displacement) else "loads"
        refused(lambda: ec.Scene(MATERIAL, contacts=contact(), **{kind: entry}), side, "Contact")  # noqa: B023


@pytest.mark.serial
def test_body_that_nothing_holds():
    """Without friction the upper body slides away, which is told by its motion."""
    load = ec.Traction("upper outer", (0.5, -3.0))
    scene = ec.Scene(MATERIAL, [fixed(2)], [load], [contact()])
    refused(lambda: ec.solve(scene, small_bricks(2)), "translation in x", error=ec.NotHeldError)
    away = ec.Traction("upper outer", (0.0, 3.0))
    scene = ec.Scene(MATERIAL, [fixed(2)], [away], [contact(friction=0.3)])
    refused(lambda: certified(scene, small_bricks(2)), error=ec.ErcContactError)


def lug_on_pin(facets: int) -> ec.Domain:
    """Half of a lug, and of the pin in its hole, with so many facets all around."""
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 8.0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", facets)
    occ = gmsh.model.occ
    plate = [(2, occ.addRectangle(-8.0, 0.0, 0.0, 12.0, 4.0))]
    pin = [(2, occ.addDisk(0.0, 0.0, 0.0, 1.0, 1.0))]
    core = [(2, occ.addDisk(0.0, 0.0, 0.0, 0.4, 0.4))]
    pin, _ = occ.intersect(pin, plate, removeTool=False)
    pin, _ = occ.cut(pin, core, removeTool=False)
    plate, _ = occ.cut(plate, core)
    occ.fragment(plate, pin)
    occ.synchronize()
    by_area = sorted(gmsh.model.getEntities(2), key=lambda face: occ.getMass(*face))
    for name, (_, face) in zip(("pin", "lug"), by_area, strict=True):
        gmsh.model.addPhysicalGroup(2, [face], name=name)
    parts = {"symmetry": [], "pulled": [], "core": []}
    for _, curve in gmsh.model.getEntities(1):
        left, _, _, right, high, _ = gmsh.model.getBoundingBox(1, curve)
        if high < 1e-3:
            parts["symmetry"].append(curve)
        elif right < -8.0 + 1e-3:
            parts["pulled"].append(curve)
        elif -0.41 < left < right < 0.41:
            parts["core"].append(curve)
    for name, curves in parts.items():
        gmsh.model.addPhysicalGroup(1, curves, name=name)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain.split({"rim": "pin", "hole": "lug"})


@pytest.mark.broad
@pytest.mark.serial
def test_curved_sides_that_slide_converge_with_every_method():
    """The hole becomes oval and slides along the pin, a polygon along a polygon.

    At degree 1 Nitsche's traction then lies at one end of each facet; its resultant
    on the facet is right, and must not be lost where it is limited to pressures.
    """
    pull = ec.Traction("pulled", (-1.0, 0.0))
    supports = [ec.Displacement("core", (0.0, 0.0)), ec.Displacement("symmetry", (None, 0.0))]
    contact = ec.Contact("rim", against="hole")
    scene = ec.Scene(ec.Elastic(1000.0, 0.3), supports, pull, contacts=contact)
    for method in (ec.Nitsche(), ec.AugmentedLagrangian()):
        eps = []
        domain = lug_on_pin(24)
        for _ in range(3):
            eps.append(certified(scene, domain, method).relative)
            domain = domain.refined()
        assert eps[1] < 0.72 * eps[0]
        assert eps[2] < 0.72 * eps[1]


@pytest.mark.serial
def test_a_body_that_a_contact_with_a_large_gap_holds():
    """The lug is pulled against the pin and touches it in one line at first.

    With the gap closed all around, as in the glued start, all of it is in tension.
    """
    supports = [ec.Displacement("core", (0.0, 0.0)), ec.Displacement("symmetry", (None, 0.0))]
    pull = ec.Traction("pulled", (-1.0, 0.0))
    domain = lug_on_pin(24)
    angles = []
    for clearance in (0.0, 0.02, 0.1):
        contact = ec.Contact("rim", against="hole", gap=lambda x, c=clearance: c * (1 - x[0]))
        scene = ec.Scene(ec.Elastic(1000.0, 0.3), supports, pull, contacts=contact)
        error = certified(scene, domain, ec.AugmentedLagrangian())
        assert error.force("hole").force[0] == pytest.approx(4.0, rel=1e-9)
        profile = error.profile("rim")
        angles.append(np.arctan2(profile["y"], profile["x"])[profile["pressure"] > 0].max())
    assert angles[0] > 1.2 * angles[1] > 1.2 * angles[2] > 0
