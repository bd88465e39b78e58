"""Periodic and cyclic sides: one copy of a body stands for all.

Properties: a laminate is exact, and its stiffness is the closed form, by strains and by
stresses; sigma^ has a mean stress that is given to round-off; a sector has the
displacement of the whole disc, and its error; u^ fits across the sides and the tractions
are opposite, to round-off; sides may meet on the axis; the intervals of the energy hold
the energies of finer meshes, and under a mean stress the intervals of numbers hold the
numbers; motions that copies leave free are free; a wavy surface has Westergaard's
contact; ranks, solvers and methods change nothing; what cannot be is told on all ranks.
"""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from domains import refused
from mpi4py import MPI
from scenes import AUGMENTED, certified

import erc_contact as ec
import namedmesh as nm
from erc_contact.admissible.across import FITS
from erc_contact.admissible.cells import values_on
from erc_contact.error.contact import contact_squares
from namedmesh.base.releases import cell_nodes
from namedmesh.partition import distribute

COMM = MPI.COMM_WORLD
SECTORS = 5
SIDES = [("left", "right"), ("bottom", "top"), ("front", "back")]
MODULI = {"soft": 1.0, "stiff": 7.0}
RATIOS = {"soft": 0.3, "stiff": 0.2}
CONTACT = ec.Contact(
    "outer", friction=ec.Tresca(0.02), bilateral=True, normal=lambda x: x / ufl.sqrt(ufl.dot(x, x))
)


def brick(cells, comm=COMM):
    """A unit brick, stiff where x > 1/2."""
    d = len(cells)
    make = ec.rectangle if d == 2 else ec.box
    whole = make((0.0,) * d, (1.0,) * d, cells=cells, comm=comm)
    return whole.named(regions={"soft": nm.where(x=(0.0, 0.5)), "stiff": nm.where(x=(0.5, 1.0))})


def periodic(d, strain=None):
    """The sides of a brick that is repeated along all axes."""
    return [ec.Periodic(*names, mean_strain=strain) for names in SIDES[:d]]


def sector(cells, copies=1, comm=COMM):
    """Some sectors of a ring, in one mesh, about the origin or the z axis."""
    d = len(cells)
    make = ec.rectangle if d == 2 else ec.box
    whole = make((0.0,) * d, (1.0, copies, *(1.0,) * (d - 2)), cells=cells, comm=comm)
    x = whole.mesh.geometry.x
    radius, angle = 1.0 + x[:, 0], 0.3 + 2 * np.pi / SECTORS * x[:, 1]
    x[:, :2] = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    low, cut = ("bottom", "top") if d == 2 else ("front", "back")
    names = {"left": "inner", "right": "outer", low: "low", cut: "cut"}
    named = {names.get(name, name): tag for name, tag in whole.names.items()}
    return nm.Domain(whole.mesh, whole.facet_tags, named)


def cyclic(d):
    axis = (0.0, 0.0) if d == 2 else ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    return ec.Cyclic("low", "cut", axis=axis, sectors=SECTORS)


def radial(x):
    """The first component of a force per volume that turns with the sectors."""
    return 0.001 * (x[0] - 2 * x[1])


def around(x):
    """Its second component."""
    return 0.001 * (x[1] + 2 * x[0])


def assert_fits(error):
    """The displacement fits across all sides, and their forces are opposite."""
    u = error.admissible.displacement.x.array
    size = COMM.allreduce(float(abs(u).max()), MPI.MAX)
    for contact in error.model.contacts:
        if not contact.is_periodic:
            continue
        trace = contact.trace
        given = 0.0 if contact.moved is None else trace.of(contact.moved.x.array)
        assert abs(trace.of(u) - given).max(initial=0.0) < 1e-14 * size
        here, there = (error.force(name).force for name in contact.side_names)
        scale = np.linalg.norm(here) + 1e-3
        assert abs(here + trace.seen(there)).max() < 1e-13 * scale
        # sigma^ has opposite tractions, moment by moment.
        moments = error.admissible.facet_moments
        on_here, on_there = (
            values_on(error.model.space, moments, side.facets) for side in (trace.here, trace.there)
        )
        left = abs(on_there + trace.on_there(on_here)).max(initial=0.0)
        assert left <= 1e-14 * COMM.allreduce(float(abs(moments).max(initial=0.0)), MPI.MAX)
    balance = error.reactions()["balance"]
    assert abs(balance.force).max() < 1e-12
    for traction in error.admissible.tractions:
        if traction.contact.is_periodic:
            parts = contact_squares(
                error.model.space, error.admissible.displacement, traction, 0.0
            ).parts
            assert abs(parts).max(initial=0.0) <= 1e-24 * error.scale**2


# -- layers
# ---------------------------------------------------------------------------------------------------


def assert_same_error(one, every, copies, rtol=5 * FITS):
    """Facets on the sides are facets inside: e^2 of all copies is e^2 of the whole.

    The forces between copies fit to a small part, so that stresses do before they are
    tightened, and after as many iterations.
    """
    assert one.admissible.tightening == every.admissible.tightening
    assert np.isclose(np.sqrt(copies) * one.absolute, every.absolute, rtol=rtol, atol=0.0)


def laminate_energy(strain):
    """Energy of two layers across x in a unit cell, plane strain or 3D."""
    E, nu = (np.array(list(values.values())) for values in (MODULI, RATIOS))
    shear, first = E / 2 / (1 + nu), E * nu / (1 + nu) / (1 - 2 * nu)
    M = first + 2 * shear
    sides = np.trace(strain) - strain[0, 0]
    pull = (strain[0, 0] + sides * np.mean(first / M)) / np.mean(1 / M)
    along = (pull - first * sides) / M
    layers = 0.5 * first * (along + sides) ** 2 + shear * along**2
    layers = layers + shear * (strain[1:, 1:] ** 2).sum()
    shears = 2 * (strain[0, 1:] ** 2).sum() / np.mean(1 / shear)
    return float(np.mean(layers) + shears)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_a_laminate_is_exact(d, degree):
    strain = np.array([[0.01, 0.004, -0.003], [0.004, -0.006, 0.002], [-0.003, 0.002, 0.005]])[
        :d, :d
    ]
    scene = ec.Scene(ec.Elastic(MODULI, RATIOS), periodic(d, strain.tolist()))
    # Multipliers at nodes are continuous, and the traction of layers is not.
    error = certified(scene, brick((2, 2, 1)[:d]), ec.Nitsche(), degree)
    assert error.relative < 1e-9
    energy = ec.potential_energy(error)
    assert np.isclose(energy.value, laminate_energy(strain), rtol=1e-10)
    assert_fits(error)


def stressed(d, stress):
    """The sides of a brick whose copies have a mean stress."""
    return [ec.Periodic(*names, mean_stress=stress) for names in SIDES[:d]]


@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_a_mean_stress_gives_the_strain_that_has_it(d):
    """A part of it: the other components of the strain are given."""
    strain = np.array([[0.01, 0.004, -0.003], [0.004, 0.0, 0.0], [-0.003, 0.0, 0.005]])[:d, :d]
    laminate, domain = ec.Elastic(MODULI, RATIOS), brick((2, 2, 1)[:d])
    by_strain = certified(ec.Scene(laminate, periodic(d, strain.tolist())), domain, ec.Nitsche())
    sides = ["right", "top"] if d == 2 else ["right", "back", "top"]
    stress = np.array([by_strain.force(name).force for name in sides]).tolist()
    stress[1][1] = None
    by_stress = certified(ec.Scene(laminate, stressed(d, stress)), domain, ec.Nitsche())
    for name, column in zip(sides, strain, strict=True):
        assert np.allclose(by_stress.solution.mean_strain(name), column, rtol=0, atol=1e-9)
    assert by_stress.relative < 1e-7
    # The forces that are given do work on the strain.
    work = sum(s * e for s, e in zip(np.ravel(stress), np.ravel(strain), strict=True) if s)
    energies = [ec.potential_energy(error) for error in (by_strain, by_stress)]
    assert np.isclose(energies[1].value, energies[0].value - work, rtol=1e-9)
    assert energies[1].guaranteed
    assert_fits(by_stress)


def test_a_mean_stress_needs_independent_translations():
    """Two pairs with one translation would jump each in its own way."""
    halves = {"low": (0.0, 0.5), "high": (0.5, 1.0)}
    named = {
        f"{side} {half}": nm.where(x=x, y=y)
        for side, x in (("left", 0.0), ("right", 1.0))
        for half, y in halves.items()
    }
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)).named(named)
    stress = [[0.01, 0.0], [0.0, 0.0]]
    sides = [ec.Periodic(f"left {half}", f"right {half}", mean_stress=stress) for half in halves]
    with pytest.raises(ec.InputError, match="1 independent translation"):
        ec.solve(ec.Scene(ec.Elastic(1.0, 0.3), sides), domain)


# -- sectors
# ---------------------------------------------------------------------------------------------------


def closed_ring(cells):
    """All sectors in one ring, whose ends have common nodes."""
    ring = sector(cells, copies=SECTORS)
    x = ring.mesh.geometry.x[:, :2]
    _, first, number = np.unique(np.round(x, 9), axis=0, return_index=True, return_inverse=True)
    triangles = number.ravel()[cell_nodes(ring.mesh.geometry)]
    closed = nm.Domain(distribute(COMM, triangles.astype(np.int64), x[first]))
    radii = {"inner": 1.0, "outer": 2.0}
    return closed.named(
        {
            name: lambda x, radius=radius: np.isclose(np.hypot(*x[:2]), radius)
            for name, radius in radii.items()
        }
    )


@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_a_sector_is_the_whole_disc(degree):
    loads = [ec.Traction("inner", pressure=0.01), ec.BodyForce((radial, around))]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), loads=loads, contacts=CONTACT)
    with_sides = replace(scene, supports=[cyclic(2)])
    one = certified(with_sides, sector((3, 2)), AUGMENTED, degree)
    every = certified(scene, closed_ring((3, 2 * SECTORS)), AUGMENTED, degree)
    V = one.solution.u.function_space
    u = one.solution.u.x.array.reshape(-1, 2)
    of_whole = every.solution.at(V.tabulate_dof_coordinates()[:, :2]).displacement
    assert abs(of_whole - u).max() < 1e-12 * abs(u).max()
    energies = [ec.potential_energy(error).value for error in (one, every)]
    assert np.isclose(SECTORS * energies[0], energies[1], rtol=1e-12)
    assert_same_error(one, every, SECTORS)
    # All copies of a pressure have no force, and of a torque the whole.
    whole = ec.results.whole_force(one, "inner")
    assert abs(whole.force).max() < 1e-15
    pulled = ec.results.whole_force(one, "outer")
    assert np.isclose(pulled.moment[0], SECTORS * one.force("outer").moment[0], rtol=1e-12)
    assert_fits(one)


@pytest.mark.serial
def test_the_material_turns_with_the_sectors():
    """Patches across the sides have the turned material: as many steps tighten both."""
    width = 2 * np.pi / SECTORS

    def wood(number):
        c, s = np.cos(number * width), np.sin(number * width)
        axes = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
        moduli = {"E": (1.0, 3.0, 0.7), "nu": (0.2, 0.1, 0.25), "G": (0.4, 0.5, 0.6)}
        return ec.OrthotropicElastic(**moduli, axes=axes)

    def is_in(number):
        middle = 0.3 + (number + 0.5) * width

        def inside(x):
            away = (np.arctan2(x[1], x[0]) - middle + np.pi) % (2 * np.pi) - np.pi
            return abs(away) < width / 2 + 1e-6

        return inside

    whole = closed_ring((3, 2 * SECTORS))
    whole = whole.named(regions={f"{number}": is_in(number) for number in range(SECTORS)})
    held, pressed = ec.Displacement("inner", (0.0, 0.0)), ec.Traction("outer", pressure=0.01)
    one = certified(ec.Scene(wood(0), [cyclic(2), held], pressed), sector((3, 2)), AUGMENTED)
    woods = {f"{number}": wood(number) for number in range(SECTORS)}
    every = certified(ec.Scene(woods, [held], pressed), whole, AUGMENTED)
    energies = [ec.potential_energy(error).value for error in (one, every)]
    assert np.isclose(SECTORS * energies[0], energies[1], rtol=1e-12)
    assert_same_error(one, every, SECTORS)


def disc(d, sectors, copies=1, *, along=2, tilt=0.0, comm=COMM):
    """Some sectors of a disc, or of a cylinder about an axis of space; low meets cut there.

    A tilt turns the domain about the x axis.
    """
    radii, heights = 2, 2 if d == 3 else 1
    corners = [(i, j) for i in range(radii + 1) for j in range(i + 1)]
    places = np.array([(i / radii, j / max(i, 1)) for i, j in corners])
    triangles = []
    for i, j in corners[: -radii - 1]:
        at, above = corners.index((i, j)), corners.index((i + 1, j))
        triangles.append((at, above, above + 1))
        if j < i:
            triangles.append((at, above + 1, at + 1))
    cells, n = np.array(triangles), len(corners)
    if d == 3:
        # Prisms of three tetrahedra, cut by the order of the nodes.
        low, high = np.sort(cells), np.sort(cells) + n
        first = np.column_stack([low, high[:, 2]])
        second = np.column_stack([low[:, :2], high[:, 1:]])
        cells = np.concatenate([first, second, np.column_stack([low[:, :1], high])])
    x, all_cells = [], []
    for half in range(2 * copies):
        # Cells differ at both sides, as they may.
        inside = (0.5 * (places[:, 1] + half % 2)) ** 1.3
        angle = 2 * np.pi / sectors * (inside + half // 2)
        plane = places[:, :1] * np.column_stack([np.cos(angle), np.sin(angle)])
        for k in range(heights):
            layer = np.column_stack([plane, np.full(n, 0.5 * k)])
            x.append(np.roll(layer, along + 1, axis=1) if d == 3 else plane)
        all_cells.append(cells + half * n * heights)
    _, first, number = np.unique(
        np.round(np.concatenate(x), 9), axis=0, return_index=True, return_inverse=True
    )
    cells = number.ravel()[np.concatenate(all_cells)].astype(np.int64)
    here = cells if comm.rank == 0 else cells[:0]
    points = np.concatenate(x)[first]
    domain = nm.Domain(distribute(comm, here, points if comm.rank == 0 else points[:0]))
    across = [(along + 1) % 3, (along + 2) % 3] if d == 3 else [0, 1]
    names = {"outer": lambda x: np.isclose(np.hypot(*x[across]), 1.0)}
    if copies == 1:
        for name, angle in (("low", 0.0), ("cut", 2 * np.pi / sectors)):
            outward = np.array([np.cos(angle), np.sin(angle)])
            names[name] = lambda x, e=outward: np.isclose(e @ x[across], np.hypot(*x[across]))
    named = domain.named(names)
    if tilt:
        x = named.mesh.geometry.x
        c, s = np.cos(tilt), np.sin(tilt)
        x[:, 1:] = x[:, 1:] @ np.array([[c, s], [-s, c]])
    return named


def turning(d):
    """The axis of a disc or cylinder, and directions from it."""
    axis = (0.0, 0.0) if d == 2 else ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    flat = ufl.as_matrix(np.diag((1.0, 1.0, 0.0)[:d]))
    return axis, lambda x: flat * x / ufl.sqrt(ufl.dot(flat * x, x))


def assert_same(one, every):
    """A sector and the whole have one displacement, but for a motion along the axis."""
    x = one.u.function_space.tabulate_dof_coordinates()
    u = one.u.x.array.reshape(len(x), -1).copy()
    of_whole = every.at(x[:, : u.shape[1]]).displacement
    u[:, 2:] -= (u - of_whole)[:, 2:].mean(axis=0)
    assert abs(of_whole - u).max() < 1e-7 * abs(u).max()


@pytest.mark.serial
@pytest.mark.parametrize(
    ("d", "sectors", "degree"),
    [(2, 2, 1), (2, 5, 2), (3, 2, 1), pytest.param(3, 3, 2, marks=pytest.mark.broad)],
)
def test_sides_may_meet_on_the_axis(d, sectors, degree):
    """A sector of a full disc or cylinder: on the axis R u = u, and forces turn with R."""
    axis, normal = turning(d)
    force = (radial, around, lambda x: 0.0 * x[0])[:d]
    rim = ec.Contact("outer", friction=ec.Tresca(0.02), bilateral=True, normal=normal)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), loads=[ec.BodyForce(force)], contacts=rim)
    with_sides = replace(scene, supports=[ec.Cyclic("low", "cut", axis=axis, sectors=sectors)])
    one = certified(with_sides, disc(d, sectors), AUGMENTED, degree)
    every = certified(scene, disc(d, sectors, sectors), AUGMENTED, degree)
    assert_same(one.solution, every.solution)
    x = one.solution.u.function_space.tabulate_dof_coordinates()
    on_axis = np.hypot(x[:, 0], x[:, 1]) < 1e-12
    assert on_axis.any()
    u_hat = one.admissible.displacement.x.array.reshape(-1, d)
    assert abs(u_hat[on_axis, :2]).max() == 0.0
    energies = [ec.potential_energy(error) for error in (one, every)]
    assert np.isclose(sectors * energies[0].value, energies[1].value, rtol=1e-8)
    assert sectors * energies[0].low < energies[1].value
    # At nodes of the rim and of both sides the method has other multipliers of the rim.
    assert_same_error(one, every, sectors, rtol=1e-3)
    assert_fits(one)


@pytest.mark.serial
def test_a_contact_slips_at_the_sides_as_in_the_whole():
    """Nodes of a contact at both sides are one node, which slips or sticks."""
    axis, normal = turning(3)
    force = (lambda x: 0.001 * x[0], lambda x: 0.001 * x[1], 0.0)
    rim = ec.Contact("outer", friction=ec.Tresca(0.0002), gap=-0.003, normal=normal)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), loads=[ec.BodyForce(force)], contacts=rim)
    with_sides = replace(scene, supports=[ec.Cyclic("low", "cut", axis=axis, sectors=3)])
    one = ec.solve(with_sides, disc(3, 3), AUGMENTED)
    assert (one.profile("outer")["status"] == ec.results.SLIP).any()
    assert_same(one, ec.solve(scene, disc(3, 3, 3), AUGMENTED))


@pytest.mark.serial
@pytest.mark.parametrize(("d", "sectors", "degree"), [(2, 2, 1), (2, 5, 2), (3, 3, 1)])
def test_a_disc_under_pressure_is_exact(d, sectors, degree):
    """Its stress is constant, also on the axis, where a node has the traction of its own jump."""
    axis = (0.0, 0.0) if d == 2 else ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    sides = ec.Cyclic("low", "cut", axis=axis, sectors=sectors)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [sides], [ec.Traction("outer", pressure=0.01)])
    assert certified(scene, disc(d, sectors), AUGMENTED, degree).relative < 1e-12


def fitted(ring):
    """A shaft in a hub, which meet at the radius 1.5."""

    def inside(x):
        return np.hypot(x[0], x[1]) < 1.5 + 1e-9

    def outside(x):
        return np.hypot(x[0], x[1]) > 1.5 - 1e-9

    return ring.named(regions={"shaft": inside, "hub": outside}).split(
        {"rim": "shaft", "bore": "hub"}
    )


@pytest.mark.serial
def test_a_sector_of_a_press_fit_carries_its_part_of_the_torque():
    """A contact of two bodies with friction ends on the sides; less than the torque that slips."""
    twist = (lambda x: -3e-5 * x[1], lambda x: 3e-5 * x[0])
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("inner", (0.0, 0.0))],
        [ec.Traction("outer", twist)],
        [ec.Contact("rim", against="bore", gap=-0.01, friction=0.3)],
    )
    with_sides = replace(scene, supports=[*scene.supports, cyclic(2)])
    one = certified(with_sides, fitted(sector((4, 8))), AUGMENTED)
    every = certified(scene, fitted(closed_ring((4, 8 * SECTORS))), AUGMENTED)
    x = np.array([[r * np.cos(a), r * np.sin(a)] for r in (1.2, 1.8) for a in (0.4, 0.9, 1.5)])
    u, of_whole = (error.solution.at(x).displacement for error in (one, every))
    assert abs(u - of_whole).max() < 1e-11 * abs(of_whole).max()
    torques = [error.force("inner").moment[0] for error in (one, every)]
    assert np.isclose(SECTORS * torques[0], torques[1], rtol=1e-10)
    assert_fits(one)


@pytest.mark.parametrize(
    "method",
    [AUGMENTED, pytest.param(ec.Nitsche(), marks=pytest.mark.broad)],
    ids=["augmented", "nitsche"],
)
@pytest.mark.parametrize("d", [2, 3])
def test_solvers_agree(d, method):
    loads = [ec.Traction("inner", pressure=0.01)]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [cyclic(d)], loads)
    domain = sector((2, 2, 1)[:d])
    first, second = (
        certified(scene, domain, method, solver=solver) for solver in ("direct", "iterative")
    )
    assert np.isclose(first.absolute, second.absolute, rtol=1e-8)
    assert_fits(first)
    assert_fits(second)


# -- contacts
# ---------------------------------------------------------------------------------------------------


def wavy(ratio, *, moved=0.0, friction=0.0, cells=(8, 12), comm=COMM):
    """A wavy surface of height 0.02 on a plane, under a share of the pressure that flattens it."""
    full = np.pi * 0.01 / (1 - 0.3**2)
    gap = lambda x: 0.01 * (1 + ufl.cos(2 * np.pi * (x[0] - moved)))  # noqa: E731
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Periodic("left", "right")],
        [ec.Traction("top", (0.0, -ratio * full))],
        ec.Contact("bottom", gap=gap, friction=friction),
    )
    return scene, ec.rectangle((0.0, 0.0), (1.0, 1.5), cells=cells, comm=comm)


@pytest.mark.serial
@pytest.mark.parametrize(
    "moved", [0.0, pytest.param(0.5, marks=pytest.mark.broad)], ids=["middle", "sides"]
)
def test_a_wavy_surface_has_the_contact_of_westergaard(moved):
    """The half width is (L/pi) asin(sqrt(p/p*)), wherever the crest is."""
    scene, domain = wavy(0.4, moved=moved)
    history = ec.adapt(scene, domain, accuracy=0.06, method=AUGMENTED)
    area = history.contact_area("bottom").area
    assert abs(area.value - 2 / np.pi * np.arcsin(np.sqrt(0.4))) < area.margin + 0.02
    assert_fits(history.error)


# -- energies
# ---------------------------------------------------------------------------------------------------


def random_scene(rng):
    """A random frictionless scene of copies: a mean strain or stress, a load, or a wavy contact."""
    kind = rng.integers(3)
    if kind == 0:
        mean = rng.normal(size=(2, 2)) * 0.01
        wave = rng.uniform(0.2, 0.9)
        modulus = lambda x: 1 + wave * ufl.sin(2 * np.pi * (x[0] + x[1]))  # noqa: E731
        sides = (periodic, stressed)[rng.integers(2)](2, (mean + mean.T).tolist())
        return ec.Scene(ec.Elastic(modulus, 0.3), sides), brick((3, 3))
    if kind == 1:
        return wavy(rng.uniform(0.1, 1.2), moved=rng.uniform(), cells=(4, 6))
    loads = [
        ec.Traction("inner", pressure=rng.uniform(0.01, 0.02)),
        ec.BodyForce((lambda x: 0.001 * x[0], lambda x: 0.001 * x[1])),
    ]
    return ec.Scene(ec.Elastic(1.0, rng.uniform(0.1, 0.4)), [cyclic(2)], loads), sector((2, 2))


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("seed", range(8))
def test_bounds_of_the_energy_hold(seed):
    scene, domain = random_scene(np.random.default_rng(seed))
    coarse = ec.potential_energy(certified(scene, domain, AUGMENTED))
    finer = certified(scene, domain.refined().refined(), AUGMENTED, degree=2)
    fine = ec.potential_energy(finer)
    assert coarse.low <= fine.value + 1e-12 * abs(fine.value)
    assert fine.low <= coarse.value
    assert fine.value <= coarse.value + 1e-12 * abs(coarse.value)
    assert_fits(finer)


# -- ranks, histories, what is refused
# ---------------------------------------------------------------------------------------------------


@pytest.mark.ranks
@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_ranks_change_nothing(degree):
    numbers = []
    for comm in (MPI.COMM_SELF, COMM):
        scene, domain = wavy(0.4, moved=0.3, friction=0.2, cells=(4, 6), comm=comm)
        error = ec.adapt(scene, domain, accuracy=1e-3, degree=degree, max_steps=2).error
        numbers.append(error.absolute)
    assert np.isclose(*numbers, rtol=1e-8)


@pytest.mark.ranks
def test_ranks_without_sides_of_copies():
    """The sides of a long strip are on one rank, and another rank has none of them."""

    def of_strip(comm):
        strip = ec.rectangle((0.0, 0.0), (12.0, 1.0), cells=(36, 3), comm=comm)
        pressed = ec.Traction("top", pressure=lambda x: 0.01 + 0.002 * ufl.cos(np.pi * x[0] / 6))
        contact = ec.Contact("bottom", friction=ec.Tresca(0.001))
        sides = ec.Periodic("left", "right", mean_stress=((0.001, None), (None, None)))
        return certified(ec.Scene(ec.Elastic(1.0, 0.3), sides, pressed, contact), strip)

    error = of_strip(COMM)
    counts = COMM.allgather(len(error.domain.facets("left")))
    assert COMM.size < 3 or min(counts) == 0
    assert error.force("right").force[0] == pytest.approx(0.001, rel=1e-12)
    assert error.relative == pytest.approx(of_strip(MPI.COMM_SELF).relative, rel=1e-8)


@pytest.mark.ranks
def test_ranks_change_nothing_in_space():
    numbers = []
    for comm in (MPI.COMM_SELF, COMM):
        strain = ((0.01, 0.002, 0.0), (0.002, 0.0, 0.0), (0.0, 0.0, -0.003))
        modulus = lambda x: 1 + 0.5 * ufl.sin(2 * np.pi * x[1])  # noqa: E731
        layers = ec.Scene(ec.Elastic(modulus, 0.3), periodic(3, strain))
        cube = certified(layers, brick((2, 2, 1), comm), AUGMENTED)
        turned = ec.Scene(ec.Elastic(1.0, 0.3), [cyclic(3)], ec.Traction("inner", pressure=0.01))
        ring = certified(turned, sector((2, 2, 1), comm=comm).refined(), AUGMENTED)
        sides = ec.Cyclic("low", "cut", axis=((0.0,) * 3, (0.0, 1.0, 0.0)), sectors=3)
        spun = ec.BodyForce((lambda x: 0.01 * x[0], 0.0, lambda x: 0.01 * x[2]))
        pressed = ec.Traction("outer", pressure=0.01)
        cylinder = disc(3, 3, along=1, comm=comm)
        full = ec.Scene(ec.Elastic(1.0, 0.3), [sides], [spun, pressed])
        wedge = certified(full, cylinder.refined(), AUGMENTED)
        assert len(wedge.model.unheld.functions) == 2
        assert_fits(wedge)
        numbers.append([cube.absolute, ring.absolute, wedge.absolute])
    assert np.allclose(*numbers, rtol=1e-8)


def test_a_mean_stress_may_act_on_some_sides_alone():
    scene = ec.Scene(ec.Elastic(1.0, 0.3), stressed(2, [[0.01, None], [None, None]]))
    error = certified(scene, brick((2, 2)), AUGMENTED)
    uniaxial = (1 - 0.3) / ((1 + 0.3) * (1 - 2 * 0.3))
    assert np.isclose(error.solution.mean_strain("left")[0], 0.01 / uniaxial, rtol=1e-8)
    assert error.solution.mean_strain("top")[1] == 0.0
    assert_fits(error)


@pytest.mark.broad
@pytest.mark.serial
def test_numbers_under_a_mean_stress_have_intervals():
    """The mean strain is found in each of the moved scenes; an interval holds finer ones."""
    scene, domain = wavy(0.4, cells=(4, 6))
    sides = [ec.Periodic("left", "right", mean_stress=((0.01, None), (None, None)))]
    scene = replace(scene, contacts=scene.contacts[:1], supports=sides)
    goal = ec.MeanDisplacement("top", (0.0, 1.0))
    coarse = ec.adapt(scene, domain, goal=goal, accuracy=0.01, max_steps=1, method=AUGMENTED)
    wide = ec.interval(coarse.error, goal)
    finer = certified(scene, domain.refined(), AUGMENTED, degree=2)
    narrow = ec.interval(finer, goal)
    assert wide.guaranteed
    assert wide.low < narrow.low < narrow.value < narrow.high < wide.high


def test_a_displacement_under_a_mean_stress_has_a_certificate():
    """Its mean strain is the one of the displacement, right or wrong."""
    scene = ec.Scene(ec.Elastic(1.0, 0.3), stressed(2, [[0.01, 0.002], [0.002, -0.003]]))
    domain = brick((2, 2))
    solution = ec.solve(scene, domain, AUGMENTED)
    assert ec.certify(scene, solution.domain, solution.u).relative < 1e-6
    wrong = solution.u.copy()
    wrong.x.array[:] *= 1.1
    certificate = ec.certify(scene, solution.domain, wrong)
    assert certificate.relative == pytest.approx(0.1 / 2.1, rel=1e-6)
    strain = certificate.error.solution.mean_strain("left")
    assert np.allclose(strain, 1.1 * solution.mean_strain("left"), rtol=1e-6)
    exact = ec.potential_energy(ec.constitutive_error(ec.equilibrate(solution))).value
    bounds = ec.potential_energy(certificate.error)
    assert bounds.low < exact < bounds.high


def test_a_shear_of_round_off_is_no_scale():
    """Sides that are drawn apart along the normal, and along each other by round-off."""
    strain = ((0.01, 1e-17), (1e-17, -0.004))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), periodic(2, strain))
    error = certified(scene, brick((2, 2)), AUGMENTED)
    assert error.relative < 1e-9
    assert_fits(error)


def test_a_mean_strain_has_a_history():
    """Each step has its own jump, also where friction remembers."""
    strains = (0.002, 0.005)
    last = None
    for strain in strains:
        scene, domain = wavy(0.4, friction=0.3, cells=(4, 6))
        sides = [ec.Periodic("left", "right", mean_strain=((strain, 0.0), (0.0, 0.0)))]
        scene = replace(scene, contacts=scene.contacts[:1], supports=sides)
        last = ec.solve(scene, domain, AUGMENTED, after=last)
        error = ec.constitutive_error(ec.equilibrate(last))
        u = error.profile("left")
        assert np.allclose(u["other_u_x"] - u["u_x"], strain, rtol=0, atol=1e-15)
        assert_fits(error)


def test_a_run_goes_on(shared_tmp_path):
    """A folder keeps the sides and their jump: a run that is ended goes on from its last mesh."""
    scene, domain = wavy(0.4, moved=0.3, cells=(4, 6))
    sides = [ec.Periodic("left", "right", mean_stress=((0.001, None), (None, None)))]
    scene = replace(scene, contacts=scene.contacts[:1], supports=sides)
    options = {"method": AUGMENTED, "checkpoint": shared_tmp_path / "run"}
    ended = ec.adapt(scene, domain, accuracy=0.01, max_steps=2, **options)
    again = ec.adapt(scene, domain, accuracy=0.01, max_steps=2, **options)
    assert np.isclose(again.error.relative, ended.error.relative, rtol=1e-8)
    assert_fits(again.error)


def test_a_long_tube_is_a_ring_of_it():
    """Rings that are repeated along the axis have the stress of a long tube, Lame's."""
    tube = ec.rectangle((1.0, 0.0), (2.0, 0.25), cells=(8, 2))
    nu, strain, pressure = 0.3, 0.001, 0.01
    rings = ec.Elastic(1.0, nu, hypothesis="axisymmetric")
    sides = ec.Periodic("bottom", "top", mean_strain=((0.0, 0.0), (0.0, strain)))
    scene = ec.Scene(rings, [sides], [ec.Traction("left", pressure=pressure)])
    error = certified(scene, tube, AUGMENTED, degree=2)
    sideways = ec.Periodic("left", "right")
    axial = 2 * nu * pressure / 3 + strain
    assert np.isclose(error.force("top").force[1], 3 * np.pi * axial, rtol=1e-3)
    assert_fits(error)
    open_ended = ec.Periodic("bottom", "top", mean_stress=((None, None), (None, 0.0)))
    error = certified(replace(scene, supports=[open_ended], contacts=[]), tube, AUGMENTED, degree=2)
    shortened = error.solution.mean_strain("top")[1]
    assert np.isclose(shortened, -2 * nu * pressure / 3, rtol=1e-3)
    assert abs(error.force("top").force[1]) < 1e-15
    refused(
        lambda: ec.solve(replace(scene, supports=[], loads=[], contacts=sideways), tube),
        "along its axis alone",
    )


def test_motions_that_copies_leave_free_must_be_balanced():
    loads = [ec.Traction("inner", pressure=0.01)]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [cyclic(2)], loads)
    assert len(ec.solve(scene, sector((2, 2)), AUGMENTED).model.unheld.functions) == 1
    torque = [ec.BodyForce((lambda x: -x[1], lambda x: x[0]))]
    refused(
        lambda: ec.solve(replace(scene, loads=torque), sector((2, 2))),
        "rotation",
        "not in balance",
        error=ec.NotHeldError,
    )
    pulled = ec.Scene(ec.Elastic(1.0, 0.3), periodic(2), ec.BodyForce((0.1, 0.0)))
    refused(lambda: ec.solve(pulled, brick((2, 2))), "translation", error=ec.NotHeldError)


def test_a_mean_stress_that_nothing_balances_is_told():
    elastic = ec.Elastic(1.0, 0.3)
    shear = [[-0.01, 0.002], [0.002, 0.01]]
    strip = ec.Scene(elastic, stressed(1, [[0.01, 0.002], [0.002, None]]))
    unlike = [*stressed(1, shear), ec.Periodic(*SIDES[1], mean_stress=[[-0.01, 0.0], [0.0, 0.01]])]
    layers = brick((2, 2)).split({"this": "soft", "that": "stiff"})
    slides = ec.Contact("this", against="that", friction=0.1)
    for scene, domain, names in [
        (strip, brick((2, 2)), "left y"),
        (ec.Scene(elastic, unlike), brick((2, 2)), "left y"),
        (ec.Scene(elastic, stressed(2, shear), contacts=slides), layers, "left y"),
    ]:
        refused(lambda: ec.solve(scene, domain), names, "mean_strain=", error=ec.NotHeldError)  # noqa: B023
    holds = replace(slides, friction=0.5)
    sheared = ec.solve(ec.Scene(elastic, stressed(2, shear), contacts=holds), layers, AUGMENTED)
    assert sheared.mean_strain("left")[1] == pytest.approx(0.002 * 1.3, rel=1e-7)


def test_what_cannot_be_is_told():
    elastic = ec.Elastic(1.0, 0.3)
    tilted = ((0.0, 0.0, 0.0), (0.0, -np.sin(0.3), np.cos(0.3)))
    skew = ec.Cyclic("low", "cut", axis=tilted, sectors=3)
    for call, *words in [
        (lambda: ec.Periodic("left", "left"), "against itself"),
        (lambda: ec.Periodic("left", None), "against"),
        (lambda: ec.Periodic("left", "right", mean_strain=0.1), "rows"),
        (lambda: ec.Periodic("left", "right", mean_strain=((0.0, 0.1), (0.0, 0.0))), "symmetric"),
        (lambda: ec.Periodic("left", "right", mean_stress=((1.0, None), (0.0, 1.0))), "both sides"),
        (lambda: ec.Periodic("a", "b", np.eye(2).tolist(), np.eye(2).tolist()), "one of them"),
        (
            lambda: ec.solve(
                ec.Scene(elastic, stressed(1, [[None, None], [None, 1.0]])), brick((2, 2))
            ),
            "acts on them",
        ),
        (
            lambda: ec.solve(
                ec.Scene(elastic, stressed(2, np.zeros((3, 3)).tolist())), brick((2, 2))
            ),
            "3 rows",
        ),
        (lambda: ec.Cyclic("low", "cut", axis=(0.0,), sectors=3), "axis"),
        (lambda: ec.Cyclic("low", "cut", axis=(0.0, 0.0), sectors=1), "sectors"),
        (lambda: ec.solve(ec.Scene(elastic, cyclic(3)), sector((2, 2))), "2D"),
        (lambda: ec.solve(ec.Scene(elastic, skew), disc(3, 3, tilt=0.3)), "none of x, y and z"),
        (
            lambda: ec.solve(
                ec.Scene(elastic, periodic(2, np.zeros((3, 3)).tolist())), brick((2, 2))
            ),
            "3 rows",
        ),
        (
            lambda: ec.solve(ec.Scene(elastic, ec.Periodic("left", "top")), brick((2, 1))),
            "do not match",
        ),
        (
            lambda: ec.solve(
                ec.Scene(elastic, [*periodic(2), ec.Displacement("left", (0.0, None))]),
                brick((2, 2)),
            ),
            "'left' is in a Contact",
        ),
    ]:
        refused(call, *words, error=ec.InputError)
    # A foundation that the next copy does not have.
    slope = ec.Contact("bottom", gap=lambda x: 0.001 * x[0], bilateral=True)
    pressed = ec.Traction("top", (0.0, -0.01))
    on_slope = ec.Scene(elastic, periodic(1), pressed, slope)
    refused(lambda: certified(on_slope, brick((2, 2)), AUGMENTED), "the same on all copies")
    assert "Periodic: mean_strain" in str(ec.Scene(elastic, periodic(2, np.eye(2).tolist())))
