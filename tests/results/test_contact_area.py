"""Where a contact ends, what it carries, and what is along a line.

Properties: of pressures like xi^(1/2) and gaps like xi^(3/2) the end is found inside a
facet, within its margin; on a coarse mesh it is within its margin of the end on a fine
one, in the plane, of rings and in 3D, also mirrored, and on a curve that is closed; a contact that is closed all over
has the area of its part, exactly, as a bilateral one has; mean pressure times area is
the normal force, which balances the load; a line has the values at its points; the
stiffness of a block in uniaxial strain is its modulus over its height, and an interval
holds it; a von Mises stress at a re-entrant corner and at a clamped end says so.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from domains import refused
from mpi4py import MPI
from scenes import flat_block, measured

import erc_contact as ec
from erc_contact.model.contact_area import area_of_strips
from erc_contact.model.contact_end import end_of
from erc_contact.model.section import Section
from namedmesh.gmsh_session import session

COMM = MPI.COMM_WORLD
MATERIAL = {
    "plane": ec.Elastic(1.0, 0.3),
    "rings": ec.Elastic(1.0, 0.3, hypothesis="axisymmetric"),
    "space": ec.Elastic(1.0, 0.3),
}


def on_parabola(kind, cells, degree=1, middle=0.0, push=-0.02):
    """A block that is pressed on a parabola, or a paraboloid."""
    d = 3 if kind == "space" else 2
    domain = flat_block(d, cells)
    supports = [ec.Displacement("top", (None,) * (d - 1) + (push,))]
    if kind != "rings":
        supports += [ec.Displacement("left", (0.0,) + (None,) * (d - 1))]
    if d == 3:
        supports += [ec.Displacement("front", (None, 0.0, None))]

    def gap(x):
        away = x[1] if d == 3 else 0.0
        return 0.1 * ((x[0] - middle) ** 2 + away**2)

    scene = ec.Scene(MATERIAL[kind], supports, contacts=ec.Contact("bottom", gap=gap))
    return measured(scene, domain, degree=degree)


@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_the_end_of_a_smooth_contact_lies_inside_a_facet(degree):
    rng = np.random.default_rng(degree)
    for _ in range(200):
        sizes = rng.uniform(0.7, 1.3, 4)
        end, curved, factor = rng.uniform(-0.5, 0.3), rng.uniform(-0.02, 0.02), rng.uniform(0.1, 9)
        edges = np.maximum(end + np.append(0.0, np.cumsum(sizes)), 0.0)
        beyond = np.linspace(0.0, 4.0, 4 * degree + 1)
        forces = np.diff(edges**1.5 * (1 + curved * edges))
        xi = np.maximum(beyond - end, 0.0)
        gaps = factor * xi**1.5 * (1 - curved * xi)
        found = end_of(sizes, forces, beyond, gaps, 3, degree)
        assert abs(found.value - end) < min(found.margin, 0.25)


@pytest.mark.on_ranks("plane-2")
@pytest.mark.parametrize(
    ("kind", "degree"),
    [pytest.param("plane", 1, marks=pytest.mark.broad), ("plane", 2), ("rings", 1)],
)
def test_a_coarse_mesh_finds_the_end_of_a_fine_one(kind, degree):
    coarse, fine = (on_parabola(kind, cells, degree) for cells in (6, 24))
    for result in (coarse, coarse.solution):
        area, true = result.contact_area("bottom"), fine.contact_area("bottom")
        (strip,), (exact,) = area.strips, true.strips
        assert strip.margins[0] == 0.0
        assert np.array_equal(strip.ends[0], (0.0, 0.0))
        assert abs(strip.ends[1, 0] - exact.ends[1, 0]) <= strip.margins[1] + exact.margins[1]
        assert exact.margins[1] < strip.margins[1] < 0.4
        assert abs(area.area.value - true.area.value) <= area.area.margin + true.area.margin
        assert np.isclose(strip.length.value, strip.ends[1, 0])
        if kind == "rings":
            assert area.radius.value == strip.ends[1, 0]
            assert np.isclose(area.area.value, np.pi * area.radius.value**2)
            assert area.radius.margin == strip.margins[1]
    text = str(area)
    assert text == COMM.bcast(text)
    assert "+-" in text


@pytest.mark.broad
def test_a_coarse_mesh_finds_the_area_of_a_fine_one_in_space():
    coarse, fine = (on_parabola("space", cells).contact_area("bottom") for cells in (5, 12))
    assert coarse.strips == ()
    assert fine.area.margin < 0.5 * coarse.area.margin
    assert abs(coarse.area.value - fine.area.value) <= coarse.area.margin + fine.area.margin
    assert coarse.area.value == COMM.bcast(coarse.area.value)
    refused(lambda: coarse.half_width, "0 strips", "area")
    refused(lambda: coarse.radius, "rings")


def test_a_strip_has_two_ends_that_mirror_each_other():
    error = on_parabola("plane", 8, middle=1.0, push=-0.01)
    area = error.contact_area("bottom")
    (strip,) = area.strips
    assert abs(strip.ends[:, 0].mean() - 1.0) < strip.margins.min()
    assert np.isclose(area.half_width.value, np.ptp(strip.ends[:, 0]) / 2)
    assert np.isclose(area.half_width.margin, strip.margins.mean())


@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_a_contact_that_is_closed_has_the_area_of_its_part(d):
    push = (0.002,) + (None,) * (d - 2) + (-0.01,)
    for bilateral in (False, True):
        contact = ec.Contact("bottom", friction=0.3 * (not bilateral), bilateral=bilateral)
        scene = ec.Scene(MATERIAL["plane"], ec.Displacement("top", push), contacts=contact)
        error = measured(scene, flat_block(d, 2))
        area = error.contact_area("bottom").area
        assert np.isclose(area.value, 2.0)
        assert area.margin == 0.0
        pressing = error.contact_force("bottom")
        force = error.force("bottom").force
        assert np.isclose(pressing.normal, force[-1])
        assert np.allclose(pressing.tangential[:-1], force[:-1])
        assert pressing.tangential[-1] == 0.0
        assert np.isclose(pressing.mean_pressure.value * 2.0, pressing.normal)
        assert pressing.mean_pressure.margin == 0.0
        assert pressing.ratio <= 0.3 * (1 + 1e-9)
        assert pressing.greatest_pressure.value >= pressing.mean_pressure.value
        assert "ratio" in str(pressing)


def around_disc(turn, opened=()):
    """The contact of a disc in a hole, over an angle of 0.52 on each side of a direction.

    Some facets without pressure are in it, by their numbers from its middle.
    """
    angle = np.linspace(-np.pi, np.pi, 121)
    x = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    table = np.zeros(240, dtype=[(name, float) for name in ("x", "y", "weight", "pressure", "gap")])
    ends = np.stack([x[:-1], x[1:]], axis=1).reshape(-1, 2)
    table["x"], table["y"] = ends.T
    table["weight"] = np.repeat(np.linalg.norm(np.diff(x, axis=0), axis=1), 2) / 2
    away = 0.52 - abs(np.angle(np.exp(1j * (np.arctan2(ends[:, 1], ends[:, 0]) - turn))))
    table["pressure"] = np.sqrt(np.maximum(away, 0.0))
    table["gap"] = np.maximum(-away, 0.0) ** 1.5
    pressure = table["pressure"].reshape(-1, 2)
    pressure[pressure.mean(axis=1).argmax() + np.array(opened, dtype=int)] = 0.0
    domain = SimpleNamespace(extent=2.0)
    space = SimpleNamespace(domain=domain, section=Section(None, 2, 1, 2.0), degree=1)
    return area_of_strips(space, table, pressure.max(axis=1) > 0, 0.0, can_open=True)


@pytest.mark.serial
@pytest.mark.parametrize("turn", [0.0, 1.6, 3.1, 4.8])
def test_a_closed_curve_has_its_strip_wherever_it_begins(turn):
    """The profile of a closed curve begins at its lowest x, which may be in contact."""
    area = around_disc(turn)
    (strip,) = area.strips
    assert abs(area.area.value - 1.04) < area.area.margin < 0.1
    assert np.all(strip.margins > 0)


@pytest.mark.serial
def test_strips_whose_margins_meet_are_one():
    assert len(around_disc(1.6, opened=[0]).strips) == 1
    apart = around_disc(1.6, opened=[-4, -3, -2, -1, 0, 1, 2, 3, 4])
    assert len(apart.strips) == 2
    refused(lambda: apart.half_width, "2 strips")


@pytest.mark.parametrize(
    ("margin", "words"),
    [(0.0, "0.11"), (0.02, "0.110 +- 0.020"), (np.inf, "0.11 +- inf"), (1e-20, "0.11 +- 1e-20")],
)
def test_any_margin_is_written(margin, words):
    """A mean pressure has no limit where the least area is zero."""
    assert str(ec.results.Estimate(0.11, margin)) == words


def test_an_open_contact_has_no_area():
    scene = ec.Scene(
        MATERIAL["plane"],
        ec.Displacement("top", (0.0, 0.0)),
        contacts=ec.Contact("bottom", gap=0.1),
    )
    solution = ec.solve(scene, flat_block(2, 2))
    area = solution.contact_area("bottom")
    assert area.area.value == 0.0
    assert area.strips == ()
    pressing = solution.contact_force("bottom")
    assert pressing.normal == 0.0
    assert np.isnan(pressing.ratio)
    assert np.isnan(pressing.mean_pressure.value)


@pytest.mark.parametrize("kind", ["plane", "rings", "space"])
def test_a_line_has_the_values_at_its_points(kind):
    error = on_parabola(kind, 3)
    d = error.domain.dim
    start, stop = (0.9, 0.1, 0.2)[:d], (0.3, 0.8, 0.7)[:d]
    for result in (error, error.solution):
        line = result.along(start, stop, 5)
        points = np.stack([line[axis] for axis in "xyz"[:d]], axis=1)
        values = result.at(points)
        stress = values.stress if result is error else values.elastic_stress
        assert np.allclose(points[[0, -1]], [start, stop])
        assert np.allclose(line["u_y"], values.displacement[:, 1])
        first, mixed = ("s_rr", "s_rz") if kind == "rings" else ("s_xx", "s_xy")
        assert np.allclose(line[first], stress[:, 0, 0])
        assert np.allclose(line[mixed], stress[:, 0, 1])
        hoop = line["s_hoop"] if kind == "rings" else line["s_zz"]
        out_of_plane = 0.3 * (stress[:, 0, 0] + stress[:, 1, 1])
        assert np.allclose(hoop, out_of_plane if kind == "plane" else stress[:, 2, 2])
        assert np.all(line["von_mises"] > 0)
        assert np.isclose(line["s"][-1], np.linalg.norm(points[-1] - points[0]))
    refused(lambda: error.along((0.1,), stop), "numbers")
    refused(lambda: error.along(start, np.array(stop) + 9.0), "outside the mesh")


def test_the_stiffness_of_a_block_is_its_modulus_over_its_height():
    def scene_at(t):
        walls = [ec.Displacement("left", (0.0, None)), ec.Displacement("right", (0.0, None))]
        top = ec.Displacement("top", (None, -0.01 * t))
        return ec.Scene(MATERIAL["plane"], [top, *walls], contacts=ec.Contact("bottom"))

    evolution = ec.evolve(scene_at, flat_block(2, 2), [1.0, 3.0], accuracy=0.1)
    stiffness = evolution.stiffness("bottom", "top", (0.0, 1.0))
    modulus = 0.7 / (1.3 * 0.4)
    assert np.isclose(stiffness.value, 2.0 * modulus, rtol=1e-9)
    assert stiffness.low <= 2.0 * modulus * (1 + 1e-9)
    assert stiffness.high >= 2.0 * modulus * (1 - 1e-9)
    assert stiffness.guaranteed
    assert stiffness.relative < 1e-6
    refused(lambda: evolution.stiffness("bottom", "top", (1.0, 0.0)), "does not move")
    refused(lambda: evolution.stiffness("bottom", "top", (0.0, 0.0)), "not all 0")


def angle_iron():
    """A square of side 2 without its upper right quarter."""

    def build(gmsh):
        occ = gmsh.model.occ
        square, quarter = occ.addRectangle(0, 0, 0, 2, 2), occ.addRectangle(1, 1, 0, 1, 1)
        occ.cut([(2, square)], [(2, quarter)])
        occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.2)

    with session(COMM, build, "The test") as model:
        parts = {"bottom": ec.where(y=0.0), "top": ec.where(y=2.0), "left": ec.where(x=0.0)}
        return ec.from_gmsh(model, parts=parts)


def test_a_greatest_stress_at_a_singular_place_says_so():
    pulled = ec.Traction("top", (0.1, 0.0))
    held = ec.Displacement("bottom", (0.0, 0.0))
    bent = ec.solve(ec.Scene(MATERIAL["plane"], held, pulled), angle_iron())
    peak = bent.maximum("von Mises")
    assert peak.beside == "a re-entrant corner of 270 degrees"
    assert peak.beside in repr(peak)
    assert "infinite" in repr(peak)
    assert bent.maximum("displacement").beside == ""

    for d in (2, 3):
        push = (0.0,) * (d - 1) + (-0.01,)
        clamped = ec.Scene(
            MATERIAL["plane"], ec.Displacement("top", push), contacts=ec.Contact("bottom")
        )
        peak = ec.solve(clamped, flat_block(d, 4)).maximum("von Mises")
        assert peak.beside == "the end of the support 'top'"
        roller = ec.Displacement("top", (None,) * (d - 1) + push[-1:])
        walls = [ec.Displacement(name, (0.0,) + (None,) * (d - 1)) for name in ("left", "right")]
        even = ec.Scene(MATERIAL["plane"], [roller, *walls], contacts=ec.Contact("bottom"))
        even = ec.solve(even, flat_block(d, 2)).maximum("von Mises")
        assert even.beside == ""
        assert "infinite" not in repr(even)
