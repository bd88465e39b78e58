"""Sides that are paired across a distance, and keep their own places.

- A constant stress passes a clearance and an interference, to round-off; the forces on
  both sides are opposite, and sigma^ of each body is in equilibrium with its own.
- Bodies keep their shapes: matched vertices stay where they are, and others are on the
  sides of their own body; refined, remeshed, assembled and read back, too.
- The gap is the distance of the bodies: a contact without ``gap=`` is the same as one
  of bodies in one place with it.
- Bodies apart have a common normal: mirror images have no shear, a stiff body keeps its
  normal, and the order of the sides changes nothing.
- What cannot be kept apart is told.
"""

import json

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from domains import refused
from mpi4py import MPI
from scenes import certified
from test_domain import assert_closed, near
from test_joined import COMM, discs, least_angle, pin_in_hole
from test_split import facet_corners
from test_two_bodies import METHODS

import erc_contact as ec
from erc_contact.admissible.below import excess_over_gap, gap_limits
from erc_contact.model.contact.side import Side
from erc_contact.model.contact.trace import Trace
from erc_contact.model.promises import bind
from erc_contact.output.gathered import whole_contacts
from erc_contact.output.verdict import of_gaps
from erc_contact.run.states import Restored, level_of
from namedmesh.partition import patches_complete
from namedmesh.simplex import bernstein
from namedmesh.tables import describe_shape, geometry_of

SIDES = ("upper bottom", "lower top")
GRADIENT = 1e-3 * np.array([[-10.0, 1.0, 0.0], [1.0, -12.0, 0.5], [0.0, 0.5, -9.0]])
"""Compression with a shear below the friction of 0.6."""


def bricks(d, distance, cells=((3, 2), (2, 3)), shift=0.0):
    """Two bricks of the same width, one above the other, some distance apart."""
    make = ec.rectangle if d == 2 else ec.box
    bodies = {}
    for name, low, (along, up), x in (
        ("upper", distance, cells[0], shift),
        ("lower", -1.0, cells[1], 0.0),
    ):
        corner = (x, *(0.0,) * (d - 2), low)
        opposite = (x + 2.0, *(1.0,) * (d - 2), low + 1.0)
        bodies[name] = make(corner, opposite, cells=(along, *(2,) * (d - 2), up))
    return ec.assembly(bodies)


def apart(d, distance, **options):
    """The bricks as a pair. In 3D their facets match."""
    cells = ((3, 2), (2, 3)) if d == 2 else ((2, 2), (2, 1))
    return bricks(d, distance, cells, **options).joined(*SIDES, apart=1.01 * abs(distance))


def assert_facing(domain, here, there):
    """Every owned facet of both parts has its partner here; return how many there are."""
    one, other = domain.facing(here, there)
    for sides, part in ((one, here), (other, there)):
        owned = sides[sides[:, 0] < domain.owned_cells]
        assert sorted(map(tuple, owned)) == sorted(map(tuple, domain.owned_facets(part)))
    assert patches_complete(domain.mesh)
    return COMM.allreduce(len(domain.owned_facets(here)), MPI.SUM)


def assert_on_circle(domain, part, radius):
    """The vertices of a part lie beside a circle of its own, where facets keep the area."""
    x = facet_corners(domain, domain.facets(part))[..., :2]
    height = np.linalg.norm(x, axis=2) - radius
    sagitta = (np.linalg.norm(x[:, 1] - x[:, 0], axis=1) ** 2 / (8 * radius)).max(initial=0.0)
    sagitta = COMM.allreduce(sagitta, MPI.MAX)
    assert -0.2 * sagitta < height.min(initial=0.0)
    assert height.max(initial=0.0) < 1.1 * sagitta


NOSE_RADIUS = 4.0


def nose(d, name, cells):
    """A block whose end, at y = 0 (z = 0) on the axis, is round; "lower" lies below it."""
    half = 0.0 if d == "ring" else -1.0
    dim = 3 if d == 3 else 2
    low = [half] * (dim - 1) + [0.0]
    make = dmesh.create_box if dim == 3 else dmesh.create_rectangle
    mesh = make(COMM, [low, [1.0] * dim], cells)
    x = mesh.geometry.x
    height = x[:, dim - 1].copy()
    sag = (x[:, : dim - 1] ** 2).sum(axis=1) / (2 * NOSE_RADIUS)
    side = 1.0 if name == "upper" else -1.0
    # Mirror images of each other, cell by cell.
    x[:, dim - 1] = side * (sag + (1.0 - sag) * height)

    def is_nose(points):
        r2 = (points[: dim - 1] ** 2).sum(axis=0)
        return np.isclose(points[dim - 1], side * r2 / (2 * NOSE_RADIUS))

    def is_flat(points):
        return np.isclose(points[dim - 1], side)

    return ec.Domain(mesh).named({"nose": is_nose, "flat": is_flat})


def noses(d, cells, *, order=("upper", "lower")):
    """Two blocks whose round ends face each other."""
    bodies = {name: nose(d, name, cells[name]) for name in ("upper", "lower")}
    first, second = (f"{name} nose" for name in order)
    return ec.assembly(bodies).joined(first, second, apart=0.26 if d != 3 else 0.51)


def pressed_noses(d, domain, *, stiff=1.0, push=0.0, friction=0.2, method=METHODS[-1], **options):
    """The upper one is pressed on the lower one, which is so many times as stiff."""
    dim = 3 if d == 3 else 2
    hypothesis = "axisymmetric" if d == "ring" else "plane strain"
    material = ec.Elastic({"upper": 1.0, "lower": stiff}, 0.3, hypothesis=hypothesis)
    across = [push] + [0.0] * (dim - 2)
    held = [
        ec.Displacement("upper flat", (*across, -0.02)),
        ec.Displacement("lower flat", (*[0.0] * (dim - 1), 0.02)),
    ]
    contact = ec.Contact("upper nose", against="lower nose", friction=friction)
    scene = ec.Scene(material, held, contacts=contact)
    return certified(scene, domain, method=method, **options)


@pytest.mark.broad
@pytest.mark.on_ranks("ring-2", "3-1")
@pytest.mark.parametrize(("d", "degree"), [(2, 1), (2, 2), ("ring", 1), ("ring", 2), (3, 1)])
def test_mirror_images_have_no_shear(d, degree):
    """Both sides turn, the common normal does not: to round-off, whatever the mesh."""
    n = (4, 4, 2) if d == 3 else (9, 4)
    error = pressed_noses(d, noses(d, {"upper": n, "lower": n}), degree=degree)
    profile = error.profile("upper nose")
    assert profile["pressure"].max() > 0.01
    assert abs(profile["shear"]).max() < 1e-12 * profile["pressure"].max()


@pytest.mark.broad
@pytest.mark.parametrize("method", METHODS[::3], ids=["Nitsche", "multiplier"])
def test_a_stiff_body_keeps_its_normal(method):
    """Without friction its force on the soft body is along the normals of the stiff one."""
    cells = {"upper": (10, 4), "lower": (7, 3)}
    error = pressed_noses(2, noses(2, cells), stiff=1e4, method=method)
    trace = error.solution.model.contacts[0].trace
    x = trace.here.corners[..., 0]
    normal = trace.normals_at_vertices
    # Out of the upper body. Its own nose would have the slope +x/R, the mean of both none.
    slope = normal[..., 0] / abs(normal[..., 1])
    assert abs(slope + x / NOSE_RADIUS).max(initial=0.0) < 0.04


@pytest.mark.broad
def test_the_order_of_sides_changes_nothing():
    """Equal bodies on meshes that do not match: forces agree within e."""
    forces = []
    for order in (("upper", "lower"), ("lower", "upper")):
        domain = noses(2, {"upper": (14, 6), "lower": (11, 5)}, order=order)
        error = pressed_noses(2, domain, degree=2, push=0.002)
        assert error.relative < 0.12
        forces.append(error.force("upper nose").force)
    assert np.linalg.norm(forces[0] - forces[1]) < 0.03 * np.linalg.norm(forces[0])


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(("d", "degree"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_distances_are_bounded_without_a_search(d, degree):
    """Polynomials below the distance, and the excess of a jump: both against dense samples."""
    n = {"upper": (3, 3, 2), "lower": (3, 3, 2)} if d == 3 else {"upper": (8, 3), "lower": (6, 3)}
    solution = pressed_noses(d, noses(d, n), degree=degree, push=0.01).solution
    contact = solution.model.contacts[0]
    facets = contact.facets
    places = np.random.default_rng(1).dirichlet(np.ones(d), 400)
    x = places @ contact.trace.here.corners
    gap = solution.model.space.everywhere(contact.gap)(x, facets).reshape(len(facets), -1)
    shape = bernstein(d - 1, degree, places[:, 1:])
    below = gap_limits(solution.model, contact, solution.u.x.array.reshape(-1, d)) @ shape.T
    scale = abs(gap).max()
    assert (below - gap).max() < 1e-14 * scale
    assert (gap - below).max() < (0.05 if degree == 1 else 0.01) * scale

    of_w = contact.trace.coefficients(contact.trace.of(solution.u.x.array))
    w_n = ((shape @ of_w) * contact.trace.normals_at_places(places)).sum(axis=-1)
    excess = np.maximum((w_n - gap).max(axis=1), 0.0)
    bound = excess_over_gap(solution.model.space, contact, of_w)
    assert np.all(bound >= excess - 1e-14 * scale)
    assert (bound - excess).max() < 0.01 * scale


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_gap_of_round_bodies_is_the_distance_of_their_surfaces(degree):
    """A pin in a bore, not the polygons of their meshes, whose gap is up to 2e-3 off."""
    domain = discs(0.5, 0.8, (0.2, 0.2)).joined("pin rim", "ring bore", apart=0.35)
    supports = [ec.Displacement("ring outer", (0.0, 0.0))]
    contact = ec.Contact("pin rim", against="ring bore", friction=0.1)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=contact)
    model = bind(scene, domain, degree)
    (contact,) = model.contacts
    points = np.linspace(0.0, 1.0, 7)[:, None]
    gap = model.space.evaluate(contact.gap, points, contact.facets)
    assert abs(gap - 0.3).max(initial=0.0) < 1e-4


# -- patches
# ---------------------------------------------------------------------------------------------------


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.on_ranks("2-1-0.3-Nitsche", "3-2--0.02-Nitsche")
@pytest.mark.parametrize("method", METHODS[::3], ids=["Nitsche", "multiplier"])
@pytest.mark.parametrize("distance", [0.3, -0.02])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_constant_stress_passes_a_distance(d, degree, distance, method):
    """The jump that closes it is a displacement of the upper body; it sticks everywhere."""
    domain = apart(d, distance)
    fine = domain.refined(near(domain, np.zeros(d), 0.8))
    assert assert_facing(fine, *SIDES) > assert_facing(domain, *SIDES)
    G = GRADIENT[:d, :d]

    def prescribed(up):
        closes = (0.0,) * (d - 1) + (-up,)

        def component(i):
            return lambda x: sum(G[i, j] * (x[j] + closes[j]) for j in range(d)) + closes[i]

        return tuple(component(i) for i in range(d))

    supports = []
    for part in fine.outer:
        if part not in SIDES:
            up = distance if part.startswith("upper") else 0.0
            supports.append(ec.Displacement(part, prescribed(up)))
    contact = ec.Contact(*SIDES, friction=0.6)
    scene = ec.Scene(ec.Elastic(1000.0, 0.3), supports, contacts=contact)
    error = certified(scene, fine, method, degree=degree)
    assert error.relative < 1e-9
    force, opposite = (error.force(side) for side in SIDES)
    assert abs(force.force + opposite.force).max() < 1e-12 * abs(force.force).max()
    # The tractions act at two places: their moment is shear times distance.
    shear = force.force[0] * distance
    moment = (force.moment + opposite.moment)[0 if d == 2 else 1]
    assert moment == pytest.approx(-shear if d == 2 else shear, rel=1e-9)


def test_pressure_of_a_pin_in_a_smaller_hole():
    """Polygons of equal angles: the interference of their sides, level pressure, Lame's value."""
    domain = pin_in_hole(2, 0.5, 0.49, 0.1).joined("pin side", "ring side", apart=0.011)
    contact = ec.Contact("pin side", against="ring side", friction=0.1)
    held = ec.Spring("ring others", 1e-6, 1e-6)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), contacts=contact, springs=held)
    error = certified(scene, domain)
    profile = error.profile("pin side")
    # Lame's pressure of a solid shaft 0.5 in a ring of 0.49 and 1, plane strain.
    stiff, nu = 1 / (1 - 0.3**2), 0.3 / 0.7
    ratio = (1 + 0.49**2) / (1 - 0.49**2)
    lame = 0.01 / (0.49 / stiff * (ratio + nu) + 0.5 / stiff * (1 - nu))
    assert profile["pressure"].mean() == pytest.approx(lame, rel=0.03)
    assert np.ptp(profile["pressure"]) < 0.1 * lame


@pytest.mark.broad
def test_pressure_of_a_cylinder_in_a_smaller_hole():
    """In 3D: the mean pressure of a short press fit, whose bodies keep their shapes."""
    domain = pin_in_hole(3, 0.5, 0.49, 0.2).joined("pin side", "ring side", apart=0.011)
    contact = ec.Contact("pin side", against="ring side", friction=0.1)
    # Springs that are nearly nothing hold the rigid motions.
    springs = [ec.Spring(name, 1e-6, 1e-6) for name in ("pin others", "ring others")]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), contacts=contact, springs=springs)
    profile = ec.solve(scene, domain, degree=2).profile("pin side")
    pressure = (profile["weight"] * profile["pressure"]).sum() / profile["weight"].sum()
    assert pressure == pytest.approx(0.0077, rel=0.05)


@pytest.mark.broad
@pytest.mark.parametrize("degree", [1, 2])
def test_distance_is_the_gap_of_bodies_in_one_place(degree):
    """The same numbers as with ``gap=`` on sides that lie on each other, and a further gap adds."""

    def solved(domain, up, gap):
        supports = [
            ec.Displacement("upper top", (0.001, -0.35 + 0.01)),
            ec.Displacement("lower bottom", (0.0, 0.0)),
        ]
        contact = ec.Contact(*SIDES, friction=0.3, gap=gap)
        material = ec.Elastic({"upper": 1.0, "lower": 2.0}, 0.3)
        return certified(ec.Scene(material, supports, contacts=contact), domain, degree=degree)

    cells = ((4, 2), (4, 3))
    away = solved(bricks(2, 0.3, cells).joined(*SIDES, apart=0.31), 0.3, 0.02)
    touching = solved(bricks(2, 0.0, cells).joined(*SIDES), 0.0, 0.32)
    assert away.relative == pytest.approx(touching.relative, rel=1e-7)
    assert away.force(SIDES[0]).force == pytest.approx(touching.force(SIDES[0]).force, rel=1e-8)
    with pytest.raises(AssertionError):
        assert away.force(SIDES[0]).force[1] == pytest.approx(0.0, abs=1e-3)


def test_names_may_be_exchanged():
    """Neither the order in a contact nor the order of joining changes a number."""
    errors = []
    for sides in (SIDES, SIDES[::-1]):
        domain = bricks(2, 0.1).joined(*SIDES, apart=0.11)
        supports = [
            ec.Displacement("upper top", (0.002, -0.11)),
            ec.Displacement("lower bottom", (0.0, 0.0)),
        ]
        contact = ec.Contact(sides[0], against=sides[1], friction=0.3)
        material = ec.Elastic({"upper": 1.0, "lower": 2.0}, 0.3)
        errors.append(certified(ec.Scene(material, supports, contacts=contact), domain))
    assert errors[0].relative == pytest.approx(errors[1].relative, rel=1e-9)
    for side in SIDES:
        forces = [error.force(side).force for error in errors]
        assert forces[0] == pytest.approx(forces[1], rel=1e-9)


@pytest.mark.broad
def test_a_ring_about_the_axis():
    """Axisymmetric: a disc presses a block below it, across a clearance; the force of rings."""
    domain = apart(2, 0.2)
    supports = [
        ec.Displacement("upper top", (None, -0.21)),
        ec.Displacement("lower bottom", (None, 0.0)),
    ]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3, hypothesis="axisymmetric"), supports, contacts=ec.Contact(*SIDES)
    )
    error = certified(scene, domain)
    assert error.relative < 1e-8
    force = [error.force(side).force[1] for side in SIDES]
    # Two equal discs of height 1: strain 0.005, area 4 pi.
    assert force[0] == pytest.approx(0.005 * 4 * np.pi, rel=1e-9)
    assert force[1] == pytest.approx(-force[0], rel=1e-12)


@pytest.mark.on_ranks("sides1")
@pytest.mark.parametrize(
    "sides",
    [
        pytest.param(("shaft right", "hub left"), marks=pytest.mark.broad),
        ("hub left", "shaft right"),
    ],
)
def test_rings_of_other_radii(sides):
    """Axisymmetric: Lame's pressures of a press fit, each per area of the side named first."""
    a, b, c = 0.5, 0.4, 1.0
    bodies = {
        "shaft": ec.rectangle((0.0, 0.0), (a, 0.5), cells=(6, 4)),
        "hub": ec.rectangle((b, 0.0), (c, 0.5), cells=(8, 5)),
    }
    domain = ec.assembly(bodies).joined(*sides, apart=0.11)
    held = [f"{body} {end}" for body in bodies for end in ("bottom", "top")]
    supports = [ec.Displacement(part, (None, 0.0)) for part in held]
    contact = ec.Contact(sides[0], against=sides[1])
    material = ec.Elastic(1.0, 0.3, hypothesis="axisymmetric")
    error = certified(ec.Scene(material, supports, contacts=contact), domain, degree=2)
    assert error.relative < 0.004
    # In plane strain. The force p a of the shaft is the force of the hub.
    stiff, nu = 1 / (1 - 0.3**2), 0.3 / 0.7
    ratio = (c**2 + b**2) / (c**2 - b**2)
    force = (a - b) * stiff / (ratio + nu + 1 - nu)
    for part, sign in (("shaft right", -1.0), ("hub left", 1.0)):
        radial = error.force(part).force[0]
        assert radial == pytest.approx(sign * force * np.pi, rel=3e-4)
    r = a if sides[0].startswith("shaft") else b
    for profile in (error.profile(sides[0]), error.admissible.solution.profile(sides[1])):
        assert profile["x"] == pytest.approx(r)
        assert profile["weight"].sum() == pytest.approx(np.pi * r)
        normal = (profile["weight"] * profile["pressure"]).sum()
        assert normal == pytest.approx(force * np.pi, rel=3e-4)
    surfaces = whole_contacts(error.admissible)
    for surface in surfaces:
        assert surface.place[..., 0] == pytest.approx(r)
        pressure = -surface.traction.normal_component
        assert pressure == pytest.approx(force / r, rel=0.05)
    assert COMM.allreduce(len(surfaces)) == 1


@pytest.mark.broad
@pytest.mark.on_ranks("2-1", "3-2")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_deviation_of_the_linear_gap(d, degree):
    """A joint that turns by phi: a point slides by phi times the distance, off its partner.

    The lower side turns into the line along (1 + e, phi), and points of the upper side
    slide along x by -phi D.
    """
    distance, phi, e = 0.3, 0.1, -0.01
    G = e * np.eye(d)
    G[0, -1], G[-1, 0] = -phi, phi

    def prescribed(down):
        def component(i):
            offset = -down * (1 + G[i, i]) if i == d - 1 else 0.0
            return lambda x: sum(G[i, j] * x[j] for j in range(d)) + offset

        return tuple(component(i) for i in range(d))

    domain = apart(d, distance)
    supports = []
    for part in domain.outer:
        if part not in SIDES:
            down = distance if part.startswith("upper") else 0.0
            supports.append(ec.Displacement(part, prescribed(down)))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=ec.Contact(*SIDES))
    error = certified(scene, domain, degree=degree)
    assert error.relative < 1e-8
    exact = phi**2 * distance * (1 + e) / ((1 + e) ** 2 + phi**2)
    for side in SIDES:
        assert error.gap_deviation(side) == pytest.approx(exact, rel=1e-8)
    refused(lambda: error.gap_deviation("upper top"), "No contact is called")
    claims = dict(of_gaps(error))
    (words,) = claims.values()
    assert f"{exact:.2g}" in words
    assert "0.3 apart" in words


# -- shapes
# ---------------------------------------------------------------------------------------------------


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_matching_sides_keep_all_vertices(d, measures):
    """Facets of two circles or cylinders that are equal but for the radius."""
    for hole in (0.6, 0.49):
        model = pin_in_hole(d, 0.5, hole, 0.2)
        domain = model.joined("pin side", "ring side", apart=1.01 * abs(hole - 0.5))
        assert assert_facing(domain, "pin side", "ring side") > 8
        assert not [name for name in domain.names if name.endswith("outside")]
        here, there = domain.facing("pin side", "ring side")
        x, y = facet_corners(domain, here), facet_corners(domain, there)
        scaled = x * np.array([hole / 0.5] * 2 + [1.0] * (d - 2))
        assert abs(y - scaled).max(initial=0.0) < 1e-5
        (row,) = domain.touching()
        # Vertices are farther apart than the circles, and middles of chords are nearer.
        assert row.distance == pytest.approx(abs(hole - 0.5), rel=0.02)
        for again in (domain, domain.refined(near(domain, np.zeros(d), 0.3))):
            for side, radius in (("pin side", 0.5), ("ring side", hole)):
                assert_on_circle(again, side, radius)
            assert least_angle(again) > 0.5 * least_angle(model)
        for region in ("pin", "ring"):
            same = measures.region(model, region)
            assert measures.region(domain, region) == pytest.approx(same, rel=1e-12)


@pytest.mark.on_ranks("pin rim")
@pytest.mark.parametrize("first", ["pin rim", pytest.param("ring bore", marks=pytest.mark.broad)])
def test_each_body_follows_its_own_circle(first, measures):
    """Discs with facets of other sizes: each vertex that is made lies on its own true side."""
    before = discs(0.5, 0.6, (0.12, 0.2))
    second = {"pin rim": "ring bore", "ring bore": "pin rim"}[first]
    domain = before.joined(first, second, apart=0.12)
    assert assert_facing(domain, first, second) > 30
    assert least_angle(domain) > 8
    assert domain.knows_shape
    fine = domain.refined()
    finer = fine.refined(near(fine, np.array([0.5, 0.0]), 0.2))
    assert assert_facing(finer, first, second) > 60
    assert least_angle(finer) > 0.4 * least_angle(domain)
    areas = {"pin": 0.25 * np.pi, "ring": np.pi * (1.0 - 0.36)}
    for one in (domain, fine, finer):
        assert_on_circle(one, "pin rim", 0.5)
        assert_on_circle(one, "ring bore", 0.6)
    for region, area in areas.items():
        errors = [abs(measures.region(one, region) / area - 1) for one in (domain, fine)]
        assert errors[1] < 0.3 * errors[0]
    # Bodies that are joined in one place keep flat facets: both have the same ones.
    assert not discs(0.5, 0.5, (0.12, 0.2)).joined(first, second).knows_shape


def test_partners_face_each_other_along_the_normal():
    """On two concentric polygons of any facets they lie on one ray."""
    domain = discs(0.5, 0.6, (0.12, 0.2)).joined("pin rim", "ring bore", apart=0.12)
    held = ec.Displacement("ring outer", (0.0, 0.0))
    spring = ec.Contact("pin rim", against="ring bore", friction=0.1)
    model = bind(ec.Scene(ec.Elastic(1.0, 0.3), held, contacts=spring), domain)
    (contact,) = model.contacts
    x, away = contact.trace.here.corners, contact.between
    sine = x[..., 0] * away[..., 1] - x[..., 1] * away[..., 0]
    sine /= np.linalg.norm(x, axis=2) * np.linalg.norm(away, axis=2)
    # The mean normal of two facets of other lengths is not the ray.
    assert abs(sine[contact.trace.here.owned]).max(initial=0.0) < 0.05


@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_nodes_of_facets_that_are_turned_against_each_other(degree):
    """By 75 degrees: vertices face vertices, and middles middles."""

    def side(start, end, nodes):
        corners = np.array([[start, end]])
        numbers = np.array([nodes[: degree + 1]])
        one = np.ones(1)
        return Side(np.zeros((1, 2), int), numbers, corners, one > 0, one, degree, 6, 2)

    turned = (0.1 + np.cos(np.radians(75)), 1.0 + np.sin(np.radians(75)))
    here, there = side((0.0, 0.0), (1.0, 0.0), [0, 1, 2]), side(turned, (0.1, 1.0), [3, 4, 5])
    trace = Trace(here, there, np.array([[0.0, 1.0]]))
    assert trace.partners.tolist() == [[4, 3, 5][: degree + 1]]
    assert trace.to_partners[0] == pytest.approx(
        np.array([(0.1, 1.0), np.subtract(turned, (1, 0))])
    )


def test_bodies_beside_each_other_follow_their_curves():
    """An assembly keeps the curves of its bodies before they are joined, too."""
    domain = discs(0.5, 0.6, (0.12, 0.2))
    assert domain.knows_shape
    fine = domain.refined()
    assert_on_circle(fine, "pin rim", 0.5)
    assert_on_circle(fine, "ring bore", 0.6)


def test_bodies_that_keep_their_shapes_are_meshed_again(measures):
    domain = discs(0.5, 0.6, (0.12, 0.2)).joined("pin rim", "ring bore", apart=0.12)
    again = domain.refined().remeshed(0.05)
    assert assert_facing(again, "pin rim", "ring bore") > 60
    areas = {"pin": 0.25 * np.pi, "ring": np.pi * (1.0 - 0.36)}
    for region, area in areas.items():
        before = abs(measures.region(domain, region) - area)
        assert abs(measures.region(again, region) - area) < 0.3 * before
    kept = json.loads(json.dumps(describe_shape(domain.geometry)))
    assert geometry_of(kept) == domain.geometry


def test_a_third_body_and_an_assembly():
    """Sides that are apart stay so when other bodies are joined, before or after."""
    three = {
        "high": ec.rectangle((0.0, 1.35), (2.0, 2.0), cells=(5, 2)),
        "upper": ec.rectangle((0.0, 0.2), (2.0, 1.2), cells=(3, 2)),
        "lower": ec.rectangle((0.0, -1.0), (2.0, 0.0), cells=(4, 2)),
    }
    both = ec.assembly(three).joined(*SIDES, apart=0.21)
    domain = both.joined("high bottom", "upper top", apart=0.16)
    two = {name: three[name] for name in ("upper", "lower")}
    within = ec.assembly(
        {"two": ec.assembly(two).joined(*SIDES, apart=0.21), "high": three["high"]}
    )
    within = within.joined("high bottom", "two upper top", apart=0.16)
    for whole, prefix in ((domain, ""), (within, "two ")):
        distances = {row.facets: row.distance for row in whole.refined().touching()}
        assert distances == pytest.approx({f"{prefix}upper bottom": 0.2, "high bottom": 0.15})
        parts = whole.parts()
        heights = dict(zip(parts["name"], parts["centre"][:, 1], strict=True))
        assert heights[f"{prefix}lower top"] == pytest.approx(0.0, abs=1e-12)
        assert heights[f"{prefix}upper top"] == pytest.approx(1.2)
        assert heights["high bottom"] == pytest.approx(1.35)
        assert_closed(whole)


def test_rules_name_parts_where_the_bodies_are():
    """Not where they are in the glued mesh."""
    domain = apart(2, 0.5)
    named = domain.named({"right end": ec.where(x=2.0, y=(0.9, None)), "foot": ec.where(y=-1.0)})
    parts = named.parts()
    row = parts["name"].index("right end")
    assert parts["centre"][row] == pytest.approx((2.0, 1.25))
    assert "lower bottom" not in named.names


def test_checkpoints_keep_both_places():
    domain = apart(2, 0.3).refined()
    supports = [
        ec.Displacement("upper top", (0.0, -0.31)),
        ec.Displacement("lower bottom", (0.0, 0.0)),
    ]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=ec.Contact(*SIDES))
    error = certified(scene, domain)
    level = level_of(error, [])
    restored = Restored(COMM, level)
    assert restored.domain.interface_map.distances == domain.interface_map.distances
    for one in (restored.domain, restored.domain.refined()):
        assert assert_facing(one, *SIDES) > 0
    again = certified(scene, restored.domain)
    assert again.relative == pytest.approx(error.relative, rel=1e-9)


@pytest.mark.parametrize(("closing", "told"), [(0.09, False), (0.11, True)])
def test_a_pair_without_contact_goes_into_each_other(closing, told, caplog):
    """Only beyond the distance at which it is drawn."""
    domain = apart(2, 0.1)
    supports = [
        ec.Displacement("upper top", (0.0, -closing)),
        ec.Displacement("lower bottom", (0.0, 0.0)),
    ]
    ec.solve(ec.Scene(ec.Elastic(1.0, 0.3), supports), domain)
    if COMM.rank == 0:
        assert ("go into each other by 0.01:" in caplog.text) == told


# -- input
# ---------------------------------------------------------------------------------------------------


def test_what_cannot_be_kept_apart():
    domain = apart(2, 0.3)
    tied = ec.Scene(
        ec.Elastic(1.0, 0.3), ec.Displacement("lower bottom", (0.0, 0.0)), ties=ec.Tied(*SIDES)
    )
    refused(lambda: ec.solve(tied, domain), "0.3 apart", "tied=True")
    refused(lambda: bricks(2, 0.3).joined(*SIDES, apart=0.2), "0.3 apart", "apart=")
    glued = bricks(2, 0.02).joined(*SIDES, apart=0.021, tied=True)
    assert glued.places is None
    assert "upper bottom/lower top" in glued.names


def test_space_moves_sides_that_do_not_match(caplog):
    """And says so; other pairs that keep their places come last."""
    bodies = {
        "upper": ec.box((0, 0, 0.02), (1, 1, 1), cells=(2, 2, 1)),
        "lower": ec.box((0, 0, -1), (1, 1, 0), cells=(3, 3, 1)),
    }
    both = ec.assembly(bodies)
    domain = both.joined(*SIDES, apart=0.021)
    assert domain.glued.places is None
    if COMM.rank == 0:
        assert "Give the distance by gap=" in caplog.text
    high = ec.assembly({"two": both, "high": ec.box((0, 0, 1.1), (1, 1, 2), cells=(2, 2, 1))})
    kept = high.joined("two upper top", "high bottom", apart=0.11)
    refused(
        lambda: kept.joined("two upper bottom", "two lower top", apart=0.021), "do not match first"
    )


@pytest.mark.broad
def test_pictures_measure_the_gap_that_is_drawn():
    domain = apart(2, 0.3)
    supports = [
        ec.Displacement("upper top", (0.0, -0.31)),
        ec.Displacement("lower bottom", (0.0, 0.0)),
    ]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=ec.Contact(*SIDES, gap=0.001))
    for surface in whole_contacts(certified(scene, domain).admissible):
        assert surface.gap == pytest.approx(0.301)
        assert surface.drawn == pytest.approx(0.3)
        assert surface.missing(1.0).gap == pytest.approx(0.001)
        assert surface.missing(2.0).gap == pytest.approx(0.151)
    circles = pin_in_hole(3, 0.5, 0.49, 0.3).joined("pin side", "ring side", apart=0.011)
    contact = ec.Contact("pin side", against="ring side", friction=0.1)
    held = [ec.Spring(f"{body} others", 0.1, 0.1) for body in ("pin", "ring")]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), contacts=contact, springs=held)
    # An interference of turning normals is drawn to round-off.
    for surface in whole_contacts(ec.equilibrate(ec.solve(scene, circles, degree=2))):
        assert not surface.missing(1.0).gap.any()
