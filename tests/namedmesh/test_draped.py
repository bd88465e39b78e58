"""Curved sides in 3D that do not match: one side takes the facets of the other one.

Properties: all facets of the smaller side are paired, whether outlines run together,
lie amid the other side, or both; the bodies are as they were up to the height of their
facets; refined, meshed again and on ranks it stays so.
"""

import json

import numpy as np
import pytest
from domains import refused
from mpi4py import MPI
from test_domain import assert_closed, near
from test_joined import least_angle
from test_split import assert_paired

import namedmesh as nm
from namedmesh.gmsh_session import session
from namedmesh.tables import describe_shape, geometry_of

COMM = MPI.COMM_WORLD
RADIUS = 0.5


def body(make, size, comm=COMM):
    """A body whose curved surfaces are the part "side", the others "plane"."""

    def build(gmsh):
        volume = make(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        sides = gmsh.model.getBoundary([(3, volume)], oriented=False)
        kinds = {"side": [], "plane": []}
        for side in sides:
            kinds["plane" if gmsh.model.getType(*side) == "Plane" else "side"].append(side[1])
        for name, tags in kinds.items():
            if tags:
                gmsh.model.addPhysicalGroup(2, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)

    with session(comm, build, "The test") as model:
        return nm.from_gmsh(model, comm)


def without(occ, whole, hole):
    return occ.cut([(3, whole)], [(3, hole)])[0][0][1]


def half_ball(occ):
    return without(occ, occ.addSphere(0, 0, 0, RADIUS), occ.addBox(-1, -1, 0, 2, 2, 1))


def socket(occ):
    box = occ.addBox(-0.8, -0.8, -0.8, 1.6, 1.6, 0.8)
    return without(occ, box, occ.addSphere(0, 0, 0, RADIUS))


def lug(occ):
    box = occ.addBox(-0.8, -0.8, 0, 1.6, 1.6, 0.4)
    return without(occ, box, occ.addCylinder(0, 0, 0, 0, 0, 0.4, RADIUS))


def hub(occ):
    box = occ.addBox(-0.8, -0.8, 0.5, 1.6, 1.6, 0.8)
    return without(occ, box, occ.addCylinder(0, 0, 0.5, 0, 0, 0.8, RADIUS))


def quarter_hub(occ):
    box = occ.addBox(0, 0, 0.5, 1, 1, 0.8)
    return without(occ, box, occ.addCylinder(0, 0, 0.5, 0, 0, 0.8, RADIUS))


def turned_pin(occ):
    """A quarter of a pin, whose outline crosses the outline of a quarter of a hub at a point."""
    pin = quarter_pin(occ)
    occ.rotate([(3, pin)], 0, 0, 0, 0, 0, 1, -0.5)
    return pin


def thin_pin(occ):
    return occ.addCylinder(0, 0, -0.4, 0, 0, 1.2, RADIUS - 0.02)


def quarter_pin(occ):
    return occ.addCylinder(0, 0, 0, 0, 0, 0.9, RADIUS, angle=np.pi / 2)


def quarter_lug(occ):
    return without(occ, occ.addBox(0, 0, 0, 1, 1, 0.4), occ.addCylinder(0, 0, 0, 0, 0, 0.4, RADIUS))


def ball(occ):
    return occ.addSphere(0, 0, 0, RADIUS)


CASES = {
    # both bodies with their sizes, the greatest distance, and what remains of the sides
    "half ball in a socket": (half_ball, 0.2, socket, 0.3, 0.0, ()),
    "ball in a half socket": (ball, 0.3, socket, 0.25, 0.0, ("one",)),
    "pin with a clearance": (thin_pin, 0.2, lug, 0.25, 0.021, ("one",)),
    "quarter of a pin": (quarter_pin, 0.2, quarter_lug, 0.15, 0.0, ("one",)),
    "pin in half a hub": (thin_pin, 0.12, hub, 0.12, 0.021, ("one", "two")),
    "quarter of a pin in half a hub": (quarter_pin, 0.2, quarter_hub, 0.25, 0.0, ("one", "two")),
}
COMMON = {"pin in half a hub": 2 * np.pi * 0.3, "quarter of a pin in half a hub": np.pi / 2 * 0.4}
"""Common area of sides of which each one ends amid the other, by the radius [length]."""
SIDES = ("one side", "two side")


def beside(name, comm=COMM):
    one, size1, two, size2, _, _ = CASES[name]
    return nm.assembly({"one": body(one, size1, comm), "two": body(two, size2, comm)})


def joined(name, comm=COMM, sides=SIDES, **options):
    return beside(name, comm).joined(*sides, apart=CASES[name][4], **options)


def shaft(depth):
    """A shaft that is pushed into the hub by some depth."""
    return lambda occ: occ.addCylinder(0, 0, 0, 0, 0, 0.5 + depth, RADIUS)


@pytest.mark.broad
def test_outlines_that_nearly_run_together():
    """A depth less than the facets is refused in words, two facets are enough."""
    whole = body(hub, 0.25)
    shallow = nm.assembly({"one": body(shaft(0.15), 0.25), "two": whole})
    for sides in (SIDES, SIDES[::-1]):
        refused(
            lambda sides=sides: shallow.joined(*sides), "nearly run together", "0.15 apart", "half"
        )
    finer = {"one": body(shaft(0.15), 0.1), "two": body(hub, 0.1)}
    assert_paired(nm.assembly(finer).joined(*SIDES), *SIDES)


@pytest.mark.broad
@pytest.mark.on_ranks("ball in a half socket")
@pytest.mark.parametrize("name", CASES)
def test_curved_sides_get_common_facets(name, measures):
    before = beside(name)
    domain = joined(name)
    remains = CASES[name][5]
    assert least_angle(domain) > 8
    assert sorted(n for n in domain.names if "outside" in n) == [
        f"{n} side outside" for n in remains
    ]
    less = min(measures.part(before, side) for side in SIDES)
    if name in COMMON:
        less = COMMON[name] * RADIUS
    assert measures.part(domain, "one side") == pytest.approx(less, rel=0.05)
    for part in ("one plane", "two plane"):
        if part in before.names:
            assert measures.part(domain, part) == pytest.approx(
                measures.part(before, part), rel=0.02
            )
    heights = 0.3**2 / (6 * RADIUS) + CASES[name][4]
    for region in ("one", "two"):
        change = measures.region(domain, region) - measures.region(before, region)
        assert abs(change) < heights * less
    pairs = assert_paired(domain, *SIDES)
    assert_closed(domain)
    middle = np.array((0.35, 0.35, 0.6 if name in COMMON else 0.0))
    fine = domain.refined(near(domain, middle, 0.3))
    assert assert_paired(fine, *SIDES) > pairs
    assert_closed(fine)


@pytest.mark.on_ranks("pin with a clearance")
@pytest.mark.parametrize("name", ["pin with a clearance"])
def test_curved_bodies_are_meshed_again(name, measures):
    """By their true shapes, which a checkpoint keeps."""
    domain = joined(name)
    kept = json.loads(json.dumps(describe_shape(domain.geometry)))
    assert geometry_of(kept) == domain.geometry
    finer = domain.refined().remeshed(0.15)
    assert finer.interface_map.interfaces == domain.interface_map.interfaces
    assert dict(finer.names) == dict(domain.names)
    assert_closed(finer)
    assert assert_paired(finer, *SIDES) > assert_paired(domain, *SIDES)
    exact = 2 * np.pi * RADIUS * 0.4
    off = [abs(exact - measures.part(mesh, "two side")) for mesh in (domain, finer)]
    assert off[1] < 0.5 * off[0]


@pytest.mark.ranks
def test_ranks_make_the_same_curved_mesh():
    counts = set()
    for comm in (MPI.COMM_SELF, COMM):
        domain = joined("quarter of a pin", comm)
        counts.add((domain.cells, domain.vertices, repr(domain)))
    assert len(counts) == 1


@pytest.mark.broad
@pytest.mark.parametrize(
    ("one", "two", "sizes", "words"),
    [
        (thin_pin, socket, (0.2, 0.3), "apart near"),
        (turned_pin, quarter_hub, (0.12, 0.2), "outlines of the curved parts"),
    ],
)
def test_curved_parts_that_do_not_lie_on_each_other(one, two, sizes, words):
    """The message names the parts."""
    both = nm.assembly({"one": body(one, sizes[0]), "two": body(two, sizes[1])})
    refused(lambda: both.joined(*SIDES), "'one side'", "'two side'", words)
