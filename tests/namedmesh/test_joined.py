"""Bodies that were meshed apart: put together, and brought into contact where they touch.

Properties: both sides have the same facets, also after refinement and on any number of
ranks; nothing of the bodies is lost; cells stay good; what does not fit is told on all
ranks.
"""

import json
from dataclasses import asdict
from itertools import product

import numpy as np
import pytest
from domains import partly_broad, refused
from mpi4py import MPI
from test_domain import assert_closed, close, near
from test_split import assert_paired, cells_of, tagged

import namedmesh as nm
from namedmesh.gmsh_session import session
from namedmesh.interface_map import Interface
from namedmesh.partition import patches_complete
from namedmesh.tables import describe_shape, geometry_of

COMM = MPI.COMM_WORLD
WIDER = 1.3
"""Half the width of the lower body where it is wider than the upper one."""


@pytest.mark.on_ranks("2-0.0-0.0002", "2-0.0-0.0")
@pytest.mark.parametrize(
    ("d", "height", "offset"),
    [*product((2, 3), (0.0,), (0.0, 1e-9, 1e-6, 2e-4, 0.01)), (2, 1e-4, 0.0), (3, 1e-4, 0.0)],
)
def test_corners_that_move_are_told(d, height, offset, caplog):
    """They are as near to corners of the other body as numbers in files are; else they stay."""
    make = nm.rectangle if d == 2 else nm.box
    low = (-offset, *(0.0,) * (d - 2), height)
    upper = make(low, (1.0,) * d, size=0.4)
    lower = make((*(0.0,) * (d - 1), -1.0), (*(1.0,) * (d - 1), 0.0), size=0.4)
    for sides in (("u bottom", "l top"), ("l top", "u bottom")):
        caplog.clear()
        domain = nm.assembly({"u": upper, "l": lower}).joined(*sides)
        x = domain.mesh.geometry.x
        least = COMM.allreduce(x[:, 0].min(initial=0.0), MPI.MIN)
        assert least == pytest.approx(-offset, abs=1e-12)
        told = [record.message for record in caplog.records if "the corner" in record.message]
        distance = max(offset, height)
        is_told = 1e-7 < distance < 1e-3 and COMM.rank == 0
        assert len(told) == is_told
        if is_told:
            assert f"moved by {distance:.3g}" in told[0]


# -- meshes
# ---------------------------------------------------------------------------------------------------


def box(low, high, cells):
    return lambda comm=COMM: (nm.rectangle if len(low) == 2 else nm.box)(
        low, high, cells=cells, comm=comm
    )


LOW2 = box((0, -1), (2, 0), (7, 3))
LOW3 = box((0, 0, -1), (1, 1, 0), (4, 4, 3))
CASES = {
    # the upper body, the lower one, and the measure of what they have in common
    "matching": (box((0, 0), (2, 1), (7, 2)), LOW2, 2.0),
    "overhang": (box((1, 0), (3, 1), (5, 2)), LOW2, 1.0),
    "within": (box((0.3, 0), (1.1, 1), (6, 2)), LOW2, 0.8),
    "beyond": (box((-1, 0), (3, 1), (5, 2)), LOW2, 2.0),
    "matching 3D": (box((0, 0.5, 0), (1.5, 2, 1), (6, 6, 2)), LOW3, 0.5),
    "equal outlines": (box((0, 0, 0), (1, 1, 1), (3, 3, 2)), LOW3, 1.0),
    "within 3D": (box((0.2, 0.3, 0), (0.8, 0.7, 0.5), (2, 2, 2)), LOW3, 0.24),
    "beyond 3D": (box((-1, -1, 0), (2, 2, 1), (4, 4, 2)), LOW3, 1.0),
    "overhang 3D": (box((0.4, 0.3, 0), (1.5, 1.4, 0.5), (3, 4, 2)), LOW3, 0.42),
    "across": (box((-0.5, 0.3, 0), (1.5, 0.8, 0.5), (6, 2, 2)), LOW3, 0.5),
}
BROADER = ["overhang", "beyond", "within 3D", "beyond 3D"]
ANGLES = {2: 7.0, 3: 9.0}
"""Least angles of triangles, and least dihedral ones of tetrahedra, of these meshes [degrees]."""


def least_angle(domain):
    """Least angle of a triangle, or least dihedral angle of a tetrahedron [degrees]."""
    d = domain.dim
    corners = domain.mesh.geometry.x[cells_of(domain)][..., :d]
    edges = corners[:, 1:] - corners[:, :1]
    gradients = np.swapaxes(np.linalg.inv(edges), 1, 2)
    gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    gradients /= np.linalg.norm(gradients, axis=2)[..., None]
    cosine = np.einsum("nik,njk->nij", gradients, gradients).clip(-1.0, 1.0)
    return COMM.allreduce(np.degrees(np.arccos(-cosine)).min(), MPI.MIN)


def joined(name, comm=COMM):
    upper, lower, _ = CASES[name]
    both = nm.assembly({"upper": upper(comm), "lower": lower(comm)})
    return both, both.joined("upper bottom", "lower top")


@pytest.mark.on_ranks("within", "overhang 3D", "across")
@pytest.mark.parametrize("name", partly_broad(CASES, BROADER))
def test_sides_face_each_other(name, measures):
    both, domain = joined(name)
    assert domain.pairs == (("upper bottom", "lower top"),)
    assert domain.regions == both.regions == {"upper": 1, "lower": 2}
    assert least_angle(domain) > ANGLES[domain.dim]
    for _ in range(2):
        assert assert_paired(domain, *domain.pairs[0]) > 0
        assert_closed(domain)
        assert patches_complete(domain.mesh)
        for side in domain.pairs[0]:
            whole = measures.part(both, side)
            part = measures.part(domain, side)
            outside = f"{side} outside"
            more = measures.part(domain, outside) if outside in domain.names else 0.0
            assert close(part, CASES[name][2])
            assert close(part + more, whole)
            assert (more > 0) == (whole > part + 1e-9)
        for part in sorted(set(both.names) - set(domain.pairs[0])):  # the same on all ranks
            assert close(measures.part(domain, part), measures.part(both, part))
        for region in both.regions:
            assert close(measures.region(domain, region), measures.region(both, region))
        corner = np.array((1.0, 0.0) if domain.dim == 2 else (0.8, 0.7, 0.0))
        domain = domain.refined(near(domain, corner, 0.4))


def test_a_strip_beside_another_region():
    """Its cells would have to be cut, too."""
    bodies = {
        "upper": nm.box((0, 0, 0), (1, 1, 0.5), cells=(3, 3, 2)),
        "beside": nm.box((1, 0, 0), (2, 1, 0.5), cells=(3, 3, 2)),
        "lower": nm.box((0, 0, -0.5), (1.004, 1, 0), cells=(4, 4, 2)),
    }
    both = nm.assembly(bodies).joined("upper right", "beside left", tied=True)
    refused(lambda: both.joined(*BOTTOM_TOP), "beside another region", "the same facets")


def test_outlines_that_enclose_small_angles():
    """No edge can be so short that a strip of no width at its ends is none."""

    def disc(low, high, size):
        def build(gmsh):
            gmsh.model.occ.addCylinder(0, 0, low, 0, 0, high - low, 1.0)
            gmsh.model.occ.synchronize()
            for _, side in gmsh.model.getEntities(2):
                height = gmsh.model.occ.getCenterOfMass(2, side)[2]
                name = {low: "bottom", high: "top"}.get(round(height, 9), "round")
                gmsh.model.addPhysicalGroup(2, [side], name=name)
            gmsh.option.setNumber("Mesh.MeshSizeMin", size)
            gmsh.option.setNumber("Mesh.MeshSizeMax", size)

        with session(COMM, build, "The test") as model:
            return nm.from_gmsh(model, COMM)

    both = pair(disc(0.0, 0.5, 0.4), disc(-0.5, 0.0, 0.31))
    refused(lambda: both.joined(*BOTTOM_TOP), "nearly run together", "the same vertices")


@pytest.mark.parametrize("name", ["matching", "matching 3D"])
def test_matching_sides_keep_their_cells(name):
    both, domain = joined(name)
    assert domain.cells == both.cells


@pytest.mark.ranks
@pytest.mark.parametrize("name", ["overhang", "overhang 3D"])
def test_ranks_make_the_same_mesh(name):
    meshes = []
    for comm, again in product((MPI.COMM_SELF, COMM), (False, True)):
        domain = joined(name, comm)[1]
        if again:
            domain = domain.remeshed(0.3)
        x = domain.mesh.geometry.x[cells_of(domain)[: domain.owned_cells]].mean(axis=1)
        x = np.concatenate(comm.allgather(x))
        meshes.append((x[np.lexsort(np.round(x, 9).T)], repr(domain)))
    for alone, shared in zip(meshes[:2], meshes[2:], strict=True):
        assert np.allclose(alone[0], shared[0], rtol=0, atol=1e-9)
        assert alone[1] == shared[1]


@pytest.mark.broad
@pytest.mark.serial
def test_angles_of_random_ratios():
    """A side with facets up to three times smaller leaves no flat cell."""
    random = np.random.default_rng(3)
    angles = []
    for ratio in np.exp(random.uniform(-np.log(3), np.log(3), 12)):
        upper = nm.rectangle((-1, 0), (1, 0.5), size=0.2)
        lower = nm.rectangle((-2, -0.5), (2, 0), size=0.2 * ratio)
        both = nm.assembly({"upper": upper, "lower": lower})
        angles.append(least_angle(both.joined("upper bottom", "lower top")))
    assert min(angles) > 7.0, angles
    assert np.median(angles) > 12.0


def discs(inner, outer, sizes):
    """A disc in the bore of a ring, each with a mesh of its own."""

    def meshed(radii, size, name):
        def build(gmsh):
            occ = gmsh.model.occ
            discs = [(2, occ.addDisk(0, 0, 0, r, r)) for r in radii]
            if len(discs) == 2:
                occ.cut(discs[1:], discs[:1])
            occ.synchronize()
            curves = sorted(gmsh.model.getEntities(1), key=lambda curve: occ.getMass(*curve))
            gmsh.model.addPhysicalGroup(1, [curves[0][1]], name=name)
            if len(curves) == 2:
                gmsh.model.addPhysicalGroup(1, [curves[1][1]], name="outer")
            gmsh.option.setNumber("Mesh.MeshSizeMax", size)

        with session(COMM, build, "The test") as model:
            return nm.from_gmsh(model, COMM)

    return nm.assembly(
        {
            "pin": meshed([inner], sizes[0], "rim"),
            "ring": meshed([outer, 2 * inner], sizes[1], "bore"),
        }
    )


@pytest.mark.parametrize("sizes", [(0.12, 0.09), (0.09, 0.2)])
def test_circles_in_one_another(sizes):
    domain = discs(0.5, 0.5, sizes).joined("pin rim", "ring bore")
    assert assert_paired(domain, "pin rim", "ring bore") > 20
    assert not [name for name in domain.names if name.endswith("outside")]
    assert least_angle(domain) > 8


def test_other_bodies_and_pairs():
    """A third body, bodies in several regions, and assemblies of assemblies."""
    upper = tagged(
        nm.rectangle((0, 0), (2, 1), cells=(6, 2)),
        lambda x: np.where(x[:, 0] > 1, 1, 2),
        {"steel": 1, "rubber": 2},
    )
    bodies = {"upper": upper, "lower": nm.rectangle((0, -1), (3, 0), cells=(7, 2))}
    two = nm.assembly(bodies).joined("upper bottom", "lower top")
    assert list(two.regions) == ["upper steel", "upper rubber", "lower"]
    assert_paired(two, "upper bottom", "lower top")
    (interface,) = two.interface_map.interfaces
    assert Interface.of(json.loads(json.dumps(asdict(interface)))) == interface

    cap = nm.rectangle((0.5, 1), (2.5, 2), cells=(5, 2))
    three = nm.assembly({"two": two, "cap": cap}).joined("cap bottom", "two upper top")
    pairs = (("two upper bottom", "two lower top"), ("cap bottom", "two upper top"))
    assert three.pairs == pairs
    split = three.split({"a": "two upper steel", "b": "two upper rubber"})
    assert split.pairs == (*pairs, ("a", "b"))
    for domain in (three, split, split.refined()):
        for pair in domain.pairs:
            assert_paired(domain, *pair)
        assert_closed(domain)


def two_volumes():
    """A model that gmsh meshes without fragment; groups name the bodies and their sides."""

    def build(gmsh):
        occ = gmsh.model.occ
        upper = occ.addBox(0.2, 0.2, 0, 0.5, 0.5, 0.4)
        lower = occ.addBox(0, 0, -0.5, 1, 1, 0.5)
        occ.synchronize()
        for tag, name in ((upper, "upper"), (lower, "lower")):
            gmsh.model.addPhysicalGroup(3, [tag], name=name)
            sides = [side for _, side in gmsh.model.getBoundary([(3, tag)], oriented=False)]
            flat = [side for side in sides if abs(occ.getCenterOfMass(2, side)[2]) < 1e-9]
            gmsh.model.addPhysicalGroup(2, flat, name=f"{name} side")
            gmsh.model.addPhysicalGroup(2, list(set(sides) - set(flat)), name=f"{name} outer")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)

    with session(COMM, build, "The test") as model:
        return nm.from_gmsh(model, COMM)


def test_two_volumes_of_one_model():
    domain = two_volumes().joined("upper side", "lower side")
    assert assert_paired(domain, "upper side", "lower side") > 0
    assert_closed(domain)


def test_curved_sides_in_space_that_match():
    """What was split is joined again: a ball in a block, not one node less or more."""

    def build(gmsh):
        occ = gmsh.model.occ
        ball = occ.addSphere(0, 0, 0, 0.5)
        block = occ.addBox(-1, -1, -1, 2, 2, 2)
        occ.fragment([(3, ball)], [(3, block)])
        occ.synchronize()
        volumes = [tag for _, tag in gmsh.model.getEntities(3)]
        for name, tag in zip(
            ("ball", "block"), sorted(volumes, key=lambda t: occ.getMass(3, t)), strict=True
        ):
            gmsh.model.addPhysicalGroup(3, [tag], name=name)
        outer = gmsh.model.getBoundary([(3, tag) for tag in volumes], oriented=False)
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in outer], name="outer")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)

    with session(COMM, build, "The test") as model:
        whole = nm.from_gmsh(model, COMM).split({"rim": "ball", "bore": "block"})
    apart = nm.Domain(whole.mesh, whole.facet_tags, whole.names, whole.cell_tags, whole.regions)
    again = apart.joined("rim", "bore")
    assert again.glued.vertices == whole.glued.vertices
    assert again.pairs == whole.pairs
    assert assert_paired(again, "rim", "bore") == assert_paired(whole, "rim", "bore")


def pin_in_hole(d, radius, hole, size=0.3):
    """A pin in a ring of another radius, whose facets are equal by gmsh's setPeriodic."""

    def build(gmsh):
        occ = gmsh.model.occ
        discs = [occ.addDisk(0, 0, 0, r, r) for r in (radius, hole, 1.0)]
        occ.cut([(2, discs[2])], [(2, discs[1])])
        if d == 3:
            for disc in (discs[0], discs[2]):
                occ.extrude([(2, disc)], 0, 0, 0.2)
        occ.synchronize()
        bodies = sorted(gmsh.model.getEntities(d), key=lambda body: occ.getMass(*body))
        sides = {}
        for name, body in zip(("pin", "ring"), bodies, strict=True):
            gmsh.model.addPhysicalGroup(d, [body[1]], name=name)
            bounds = gmsh.model.getBoundary([body], oriented=False)
            round_sides = [b for b in bounds if gmsh.model.getType(*b) not in ("Plane", "Line")]
            round_sides.sort(key=lambda side: occ.getMass(*side))
            sides[name] = round_sides[0][1]
            gmsh.model.addPhysicalGroup(d - 1, [sides[name]], name=f"{name} side")
            others = [tag for _, tag in bounds if tag != sides[name]]
            if others:
                gmsh.model.addPhysicalGroup(d - 1, others, name=f"{name} others")
        scale = np.diag([hole / radius, hole / radius, 1.0, 1.0]).ravel().tolist()
        gmsh.model.mesh.setPeriodic(d - 1, [sides["ring"]], [sides["pin"]], scale)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)

    with session(COMM, build, "The test") as model:
        return nm.from_gmsh(model, COMM)


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_pin_of_another_radius_glued_in_a_hole(d):
    """Clearance and interference: the ring moves onto the pin, and all facets are one."""
    for hole in (0.52, 0.49):
        model = pin_in_hole(d, 0.5, hole, 0.2)
        distance = 1.01 * abs(hole - 0.5)
        domain = model.joined("pin side", "ring side", tied=True, apart=distance)
        assert not [name for name in domain.names if name.endswith("outside")]
        assert least_angle(domain) > 0.5 * least_angle(model)
        pair = domain.split({"pin rim": "pin", "ring bore": "ring"})
        assert assert_paired(pair, "pin rim", "ring bore") > 8


def test_sides_that_are_too_far_apart():
    model = pin_in_hole(3, 0.5, 0.2)
    refused(
        lambda: model.joined("pin side", "ring side", tied=True, apart=0.4), "as large as the cells"
    )
    refused(lambda: model.joined("pin side", "ring side", apart=-1.0), "apart is -1")


def test_files_read_back(shared_tmp_path):
    """Two mesh files, one body on the other."""
    for name, low, size in (("upper", 0.0, 0.3), ("lower", -1.0, 0.22)):

        def build(gmsh, name=name, low=low, size=size):
            square = gmsh.model.occ.addRectangle(0, low, 0, 1, 1)
            gmsh.model.occ.synchronize()
            gmsh.model.addPhysicalGroup(2, [square], name="steel")
            for curve, part in zip((1, 3), ("bottom", "top"), strict=True):
                gmsh.model.addPhysicalGroup(1, [curve], name=part)
            gmsh.option.setNumber("Mesh.MeshSizeMax", size)
            gmsh.model.mesh.generate(2)
            gmsh.write(str(shared_tmp_path / f"{name}.msh"))

        with session(COMM, build, "The test"):
            pass
    bodies = {name: nm.read_mesh(shared_tmp_path / f"{name}.msh") for name in ("upper", "lower")}
    domain = nm.assembly(bodies).joined("upper bottom", "lower top")
    assert domain.regions == {"upper": 1, "lower": 2}
    assert assert_paired(domain, "upper bottom", "lower top") > 0


# -- new sizes
# ---------------------------------------------------------------------------------------------------


def tower():
    """An assembly of an assembly, with a tied joint, a contact, and a region in regions."""
    bodies = {
        "base": nm.rectangle((0, -1), (3, 0), size=0.4),
        "cap": nm.rectangle((0.5, 1), (2, 2), size=0.5),
    }
    two = nm.assembly({"post": nm.rectangle((0, 0), (2, 1), size=0.4), "base": bodies["base"]})
    two = two.joined("post bottom", "base top", tied=True)
    three = nm.assembly({"two": two, "cap": bodies["cap"]})
    return three.joined("cap bottom", "two post top")


APART = {
    "overhang": (lambda: joined("overhang")[1], 0.15),
    "overhang 3D": (lambda: joined("overhang 3D")[1], 0.3),
    "discs": (lambda: discs(0.5, 0.5, (0.12, 0.2)).joined("pin rim", "ring bore"), 0.06),
    "one model": (lambda: two_volumes().joined("upper side", "lower side"), 0.2),
    "tower": (tower, 0.15),
}


@pytest.mark.on_ranks("overhang 3D", "tower")
@pytest.mark.parametrize("name", partly_broad(APART, ("one model", "discs")))
def test_bodies_are_meshed_again_and_joined(name, measures):
    """Also from the shape that a checkpoint keeps; names, tags, pairs and measures stay."""
    make, size = APART[name]
    domain = make()
    kept = json.loads(json.dumps(describe_shape(domain.geometry)))
    assert geometry_of(kept) == domain.geometry
    finer = domain.refined().remeshed(size)
    back = finer.remeshed(2 * size)
    assert finer.cells > 1.5 * back.cells
    for again in (finer, back):
        assert again.interface_map.interfaces == domain.interface_map.interfaces
        assert dict(again.names) == dict(domain.names)
        assert_paired(again, *again.pairs[0])
        if name != "tower":  # where a tied joint is a part inside
            assert_closed(again)
        assert patches_complete(again.mesh)
        accuracy = 0.02 if name == "discs" else 1e-9
        for region in domain.regions:
            same = measures.region(domain, region)
            assert measures.region(again, region) == pytest.approx(same, rel=accuracy)
        for part in domain.outer:
            same = measures.part(domain, part)
            assert measures.part(again, part) == pytest.approx(same, rel=accuracy)
    assert domain.knows_shape == (name != "discs")
    if name == "discs":
        # Finer facets are nearer to the circle.
        off = [abs(measures.region(again, "pin") - 0.25 * np.pi) for again in (back, finer)]
        assert off[1] < 0.5 * off[0]


def test_bodies_that_cannot_be_joined_again():
    """A distance that is no height of the new facets: the message names both parts."""
    domain = discs(0.5, 0.53, (0.2, 0.2)).joined("pin rim", "ring bore", apart=0.02)
    refused(lambda: domain.remeshed(0.03), "remeshed", "'pin rim'", "'ring bore'")


# -- input
# ---------------------------------------------------------------------------------------------------


def pair(upper, lower):
    return nm.assembly({"upper": upper, "lower": lower})


def square(x=0.0, y=0.0):
    return nm.rectangle((x, y), (x + 1, y + 1), cells=(3, 3))


def cube(x=0.0, z=0.0, n=2):
    return nm.box((x, 0.0, z), (x + 1.0, 1.0, z + 1.0), cells=(n, n, n))


def ball(radius, size):
    """A ball, all of its surface a part."""

    def build(gmsh):
        gmsh.model.occ.addSphere(0, 0, 0, radius)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="top")
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)

    with session(COMM, build, "The test") as model:
        return nm.from_gmsh(model, COMM)


BOTTOM_TOP = ("upper bottom", "lower top")
WRONG = {
    "no part": (lambda: pair(square(), square(0, -1)).joined("up", "lower top"), ("'up'",)),
    "one part twice": (
        lambda: pair(square(), square(0, -1)).joined("lower top", "lower top"),
        ("'lower top'", "itself"),
    ),
    "a side of a pair": (
        lambda: pair(square(), square(0, -1)).joined(*BOTTOM_TOP).joined(*BOTTOM_TOP),
        ("'upper bottom'", "pair already"),
    ),
    "a part inside": (
        lambda: (
            pair(square(), square(0, -1))
            .joined(*BOTTOM_TOP, tied=True)
            .joined("upper bottom/lower top", "lower left")
        ),
        ("inside the body",),
    ),
    "one body": (lambda: square().joined("left", "right"), ("nothing in common",)),
    "one region": (lambda: slit().joined("left", "right"), ("no region of their own",)),
    "far apart": (lambda: pair(square(), square(0, -3)).joined(*BOTTOM_TOP), ("distance", "2.")),
    "apart": (
        lambda: pair(square(), square(0.1, -1.1)).joined(*BOTTOM_TOP),
        ("0.1 apart", "gap="),
    ),
    "beside": (lambda: pair(square(), square(2, -1)).joined(*BOTTOM_TOP), ("nothing in common",)),
    "the same side": (
        lambda: pair(square(), square(0.2, 0)).joined("upper bottom", "lower bottom"),
        ("nothing in common", "opposite"),
    ),
    "apart in 3D": (lambda: pair(cube(), cube(0.3, -1.1)).joined(*BOTTOM_TOP), ("0.1 apart",)),
    "turned in 3D": (
        lambda: pair(cube(), cube(1, 0, 3)).joined("upper right", "lower right"),
        ("cosine", "is 1"),
    ),
    "beside in 3D": (
        lambda: pair(cube(), cube(3, -1, 3)).joined(*BOTTOM_TOP),
        ("nothing in common",),
    ),
    "curved in 3D": (
        lambda: pair(cube(-0.5, 0.5), ball(0.5, 0.4)).joined(*BOTTOM_TOP),
        ("'upper bottom'", "'lower top'"),
    ),
    "no body": (lambda: nm.assembly({}), ("names and domains",)),
    "no names": (lambda: nm.assembly([square()]), ("names and domains",)),
    "an empty name": (lambda: nm.assembly({"": square()}), ("name of a body",)),
    "a name twice": (
        lambda: nm.assembly({"a": pair(square(), square(2)), "a upper": square(4)}),
        ("'a upper'", "another name"),
    ),
    "no domain": (lambda: nm.assembly({"upper": square().mesh}), ("'upper'", "Domain")),
    "two dimensions": (lambda: pair(square(), cube()), ("'lower' is in 3D", "2D")),
}


def slit():
    """Two squares beside each other in one region, not connected."""
    both = pair(square(), square(1.0))
    names = {"left": both.names["upper right"], "right": both.names["lower left"]}
    return nm.Domain(both.mesh, both.facet_tags, names)


def test_tied_bodies_need_no_regions():
    """Two squares become one mesh, whose vertices on the joint are one."""
    glued = slit().joined("left", "right", tied=True)
    assert glued.vertices == slit().vertices - 4
    assert glued.outer == []


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input(name):
    call, words = WRONG[name]
    refused(call, *words)


@pytest.mark.ranks
def test_other_communicator():
    own = nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2), comm=MPI.COMM_SELF)
    refused(lambda: pair(square(), own), "'lower'", "communicator")
