"""Meshes that are split along the interface of two bodies: the sides match facet by facet.

Properties, on any number of ranks and through refinement: each facet of the interface
has its two sides, at the same place, of the same area, and both are on the rank of
either; nothing else opens; the rim is where the definition of a node's copies says; a
wrong call is told on all ranks.
"""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from test_domain import assert_closed, assert_distributed_well, close, near

import namedmesh as nm
from namedmesh.base.releases import cell_nodes
from namedmesh.gmsh_session import session
from namedmesh.partition import patches_complete
from namedmesh.tags import tags_of

COMM = MPI.COMM_WORLD
SIDES = {"punch": "upper", "block": "lower"}


def cells_of(domain):
    return cell_nodes(domain.mesh.geometry)


def tagged(domain, region_at, regions, inner=None, parts=()):
    """The same mesh with regions by midpoint, and inner parts by midpoint."""
    mesh, d = domain.mesh, domain.dim
    x = domain.mesh.geometry.x[cells_of(domain)].mean(axis=1)
    tags = tags_of(mesh, d, np.arange(len(x)), region_at(x).astype(np.int32))
    facet_tags = domain.facet_tags
    if inner is not None:
        count = (
            mesh.topology.index_map(d - 1).size_local + mesh.topology.index_map(d - 1).num_ghosts
        )
        mesh.topology.create_connectivity(d - 1, 0)
        middle = dmesh.compute_midpoints(mesh, d - 1, np.arange(count, dtype=np.int32))
        values = inner(middle).astype(np.int32)
        values[facet_tags.indices] = facet_tags.values
        facet_tags = tags_of(mesh, d - 1, np.arange(count), values)
    names = dict(domain.names) | dict(parts)
    return nm.Domain(mesh, facet_tags, names, tags, regions)


def layers(d, comm=COMM, inner=None, parts=()):
    """Two layers, structured: the upper one is above one half."""
    low, high, cells = (0.0,) * d, (2.0, 1.0, 1.0)[:d], (8, 4, 4)[:d]
    make = nm.rectangle if d == 2 else nm.box
    domain = make(low, high, cells=cells, comm=comm)
    return tagged(
        domain,
        lambda x: np.where(x[:, d - 1] > 0.5, 1, 2),
        {"upper": 1, "lower": 2},
        inner,
        parts,
    )


def overhang(d, comm=COMM, size=0.25):
    """A body that hangs over the side of another one, both by gmsh in one piece."""

    def build(gmsh):
        occ = gmsh.model.occ
        if d == 3:
            a = occ.addBox(0.2, 0.25, 1, 0.6, 0.9, 0.5)
            b = occ.addBox(0, 0, 0, 1, 1, 1)
        else:
            a = occ.addRectangle(0.3, 1, 0, 1.0, 0.5)
            b = occ.addRectangle(0, 0, 0, 1, 1)
        occ.fragment([(d, a)], [(d, b)])
        occ.synchronize()
        bodies = [tag for _, tag in gmsh.model.getEntities(d)]
        upper = [tag for tag in bodies if occ.getCenterOfMass(d, tag)[d - 1] > 1]
        lower = [tag for tag in bodies if tag not in upper]

        def boundary(tags):
            sides = gmsh.model.getBoundary([(d, tag) for tag in tags], oriented=False)
            return {tag for _, tag in sides}

        gmsh.model.addPhysicalGroup(d, upper, 1, name="upper")
        gmsh.model.addPhysicalGroup(d, lower, 2, name="lower")
        joint = boundary(upper) & boundary(lower)
        gmsh.model.addPhysicalGroup(d - 1, sorted(joint), 7, name="joint")
        outside = boundary(upper) ^ boundary(lower)
        gmsh.model.addPhysicalGroup(d - 1, sorted(outside), 8, name="outside")
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)

    with session(comm, build, "The test") as model:
        return nm.from_gmsh(model, comm)


BODIES = {
    "layers 2D": (lambda comm=COMM: layers(2, comm), None, (0.0, 0.5)),
    "layers 3D": (lambda comm=COMM: layers(3, comm), None, (0.0, 0.0, 0.5)),
    "overhang 2D": (lambda comm=COMM: overhang(2, comm), "joint", (0.3, 1.0)),
    "overhang 3D": (lambda comm=COMM: overhang(3, comm), "joint", (0.2, 0.25, 1.0)),
}
AREAS = {"layers 2D": 2.0, "layers 3D": 2.0, "overhang 2D": 0.7, "overhang 3D": 0.45}
bodies = pytest.mark.parametrize("name", BODIES)


def facet_corners(domain, sides):
    """Corners of facets, given as (cell, local facet), sorted, shape (n, d, d)."""
    d = domain.dim
    nodes = cells_of(domain)[sides[:, 0]]
    others = np.array([[j for j in range(d + 1) if j != i] for i in range(d + 1)])
    x = domain.mesh.geometry.x[np.take_along_axis(nodes, others[sides[:, 1]], axis=1)][..., :d]
    order = np.lexsort(np.moveaxis(x, 2, 0))
    return np.take_along_axis(x, order[..., None], axis=1)


def between(domain, one, other):
    """Number of facets of a mesh between two regions, counted by their two cells."""
    mesh, d = domain.mesh, domain.dim
    cells = mesh.topology.connectivity(d - 1, d)
    region = np.zeros(len(cells_of(domain)), dtype=int)
    region[domain.region(one)] = 1
    region[domain.region(other)] = 2
    count = 0
    for facet in range(mesh.topology.index_map(d - 1).size_local):
        count += sorted(region[cells.links(facet)]) == [1, 2]
    return COMM.allreduce(count, MPI.SUM)


def assert_paired(domain, here="punch", there="block"):
    """Every owned facet of both parts has its partner here, at the same place."""
    one, other = domain.facing(here, there)
    assert one.dtype == other.dtype == np.int32
    assert np.array_equal(facet_corners(domain, one), facet_corners(domain, other))
    for sides, part in ((one, here), (other, there)):
        owned = sides[sides[:, 0] < domain.owned_cells]
        expected = domain.owned_facets(part)
        assert sorted(map(tuple, owned)) == sorted(map(tuple, expected))
        assert len(np.unique(sides, axis=0)) == len(sides)
    back, forth = domain.facing(there, here)
    assert np.array_equal(back, other)
    assert np.array_equal(forth, one)
    return COMM.allreduce(len(domain.owned_facets(here)), MPI.SUM)


@pytest.mark.on_ranks("layers 3D", "overhang 2D")
@bodies
def test_each_facet_faces_another_one(name, measures):
    make, on, corner = BODIES[name]
    base = make()
    domain = base.split(SIDES, on=on)
    assert domain.pairs == (("punch", "block"),)
    assert base.pairs == ()
    for _ in range(3 if domain.dim == 2 else 2):
        assert assert_paired(domain) == between(domain.glued, "upper", "lower") > 0
        assert between(domain, "upper", "lower") == 0
        assert domain.cells == domain.glued.cells
        assert domain.regions == base.regions
        assert patches_complete(domain.mesh)
        assert_closed(domain)
        assert_distributed_well(domain)
        for part in ("punch", "block"):
            assert close(measures.part(domain, part), AREAS[name])
            assert part in domain.outer
        for part in sorted(set(base.names) - {"joint"}):  # the same order on all ranks
            assert close(measures.part(domain, part), measures.part(base, part))
        for region in base.regions:
            assert close(measures.region(domain, region), measures.region(base, region))
        assert "joint" not in domain.names
        region = np.isin(domain.facing("punch", "block")[0][:, 0], domain.region("upper"))
        assert region.all()
        coarse = domain
        domain = coarse.refined(near(coarse, np.array(corner), 0.4))
        glued = coarse.glued.refined(near(coarse.glued, np.array(corner), 0.4))
        assert (domain.cells, domain.glued.vertices) == (glued.cells, glued.vertices)
        assert domain.cells > coarse.cells


@pytest.mark.ranks
@bodies
def test_ranks_make_the_same_mesh(name):
    make, on, corner = BODIES[name]
    meshes = []
    for comm in (MPI.COMM_SELF, COMM):
        domain = make(comm).split(SIDES, on=on)
        for _ in range(2):
            domain = domain.refined(near(domain, np.array(corner), 0.4))
        x = domain.mesh.geometry.x[cells_of(domain)[: domain.owned_cells]].mean(axis=1)
        x = np.concatenate(comm.allgather(x))
        meshes.append((x[np.lexsort(np.round(x, 9).T)], domain.vertices, repr(domain)))
    assert np.allclose(meshes[0][0], meshes[1][0], rtol=0, atol=1e-9)
    assert meshes[0][1:] == meshes[1][1:]


def copies(domain):
    """Places of the vertices of owned cells, and how many vertices are there."""
    x = domain.mesh.geometry.x
    places, count = np.unique(x, axis=0, return_counts=True)
    owned = np.unique(x[cells_of(domain)[: domain.owned_cells].ravel()], axis=0)
    keys = {tuple(place): n for place, n in zip(places, count, strict=True)}
    return owned, np.array([keys[tuple(place)] for place in owned])


@pytest.mark.broad
@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_all_vertices_of_an_overhang_have_two_nodes(d):
    """Also those on its rim: both bodies go on beyond it."""
    domain = overhang(d).split(SIDES)
    for _ in range(2):
        x, count = copies(domain)
        touched = x[:, d - 1] == 1
        touched &= (x[:, 0] >= (0.3 if d == 2 else 0.2)) & (x[:, 0] <= (1 if d == 2 else 0.8))
        if d == 3:
            touched &= (x[:, 1] >= 0.25) & (x[:, 1] <= 1)
        assert np.array_equal(count, np.where(touched, 2, 1))
        domain = domain.refined()


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_an_interface_can_end_inside(d, measures):
    """Half of it is split: its rim has one node, which both bodies share."""

    def joint(x):
        return np.where((x[:, d - 1] == 0.5) & (x[:, 0] < 1), 9, -1)

    base = layers(d, inner=joint, parts={"joint": 9})
    assert "joint" not in base.outer
    domain = base.split(SIDES, on="joint")
    for _ in range(2):
        x, count = copies(domain)
        split = (x[:, d - 1] == 0.5) & (x[:, 0] < 1)
        assert np.array_equal(count, np.where(split, 2, 1))
        assert close(measures.part(domain, "punch"), 1.0)
        assert assert_paired(domain) == between(domain.glued, "upper", "lower") - between(
            domain, "upper", "lower"
        )
        domain = domain.refined(near(domain, np.array((1.0, 0.5, 0.5)[:d]), 0.4))
    rest = base.split(SIDES, on="joint").split({"p": "upper", "b": "lower"})
    assert assert_paired(rest) + assert_paired(rest, "p", "b") == between(
        rest.glued, "upper", "lower"
    )


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_a_part_keeps_the_facets_that_are_not_split(d):
    """It runs along the interface and on into a body."""

    def sheet(x):
        along = (x[:, d - 1] == 0.5) & (x[:, 0] < 1)
        return np.where(along | ((x[:, 0] == 1) & (x[:, d - 1] < 0.5)), 9, -1)

    base = layers(d, inner=sheet, parts={"sheet": 9})
    for on in (None, "sheet"):
        domain = base.split(SIDES, on=on).refined()
        facets = domain.facet_tags.find(domain.names["sheet"])
        x = dmesh.compute_midpoints(domain.mesh, d - 1, facets)
        assert np.all(x[:, 0] == 1)


@pytest.mark.parametrize("d", [2, 3])
def test_three_bodies_meet(d):
    """A vertex has as many nodes as there are bodies that no facet connects."""
    box = nm.rectangle((0, 0), (2, 1), cells=(4, 4)) if d == 2 else None
    if d == 3:
        box = nm.box((0, 0, 0), (2, 1, 1), cells=(4, 2, 4))
    base = tagged(
        box,
        lambda x: np.where(x[:, d - 1] < 0.5, 3, np.where(x[:, 0] < 1, 1, 2)),
        {"left one": 1, "right one": 2, "lower": 3},
    )
    two = base.split({"a": "left one", "b": "lower"}).split({"c": "right one", "e": "lower"})
    three = two.split({"f": "left one", "g": "right one"})
    assert two.pairs == (("a", "b"), ("c", "e"))
    assert three.pairs == (("a", "b"), ("c", "e"), ("f", "g"))
    for domain in (two, three, three.refined(near(three, np.array((1, 0.5, 0.5)[:d]), 0.4))):
        x, count = copies(domain)
        flat = x[:, d - 1] == 0.5
        upright = (x[:, 0] == 1) & (x[:, d - 1] >= 0.5)
        if domain is two:
            upright[:] = False
        assert np.array_equal(count, 1 + flat + upright)
        for pair in domain.pairs:
            assert_paired(domain, *pair)
        assert_closed(domain)


def test_meshed_again():
    """The least size at the copies of a node counts; names and pairs stay."""
    domain = overhang(2).split(SIDES, on="joint")
    finer = domain.remeshed(0.1)
    assert finer.pairs == domain.pairs
    assert finer.names == domain.names
    assert finer.glued.cells == domain.glued.remeshed(0.1).cells
    assert assert_paired(finer) == between(finer.glued, "upper", "lower")
    for region in ("upper", "lower"):
        at_nodes = np.full(len(domain.mesh.geometry.x), 0.2)
        at_nodes[cells_of(domain)[domain.region(region)].ravel()] = 0.05
        graded = domain.remeshed(at_nodes)
        at_glued = np.full(len(domain.glued.mesh.geometry.x), 0.2)
        at_glued[cells_of(domain.glued)[domain.glued.region(region)].ravel()] = 0.05
        assert graded.cells == domain.glued.remeshed(at_glued).cells
        assert_paired(graded.refined())
    with pytest.raises(nm.InputError, match="give a number, or one for each node"):
        domain.remeshed(at_nodes[:-1])
    with pytest.raises(nm.InputError, match="not > 0 and finite"):
        domain.remeshed(-at_nodes)
    with pytest.raises(nm.InputError, match="geometry of this domain is not known"):
        layers(2).split(SIDES).remeshed(0.1)


def pin(comm=COMM):
    """A disc in the hole of a plate."""

    def build(gmsh):
        occ = gmsh.model.occ
        disc = occ.addDisk(0, 0, 0, 0.5, 0.5)
        plate = occ.addRectangle(-1, -1, 0, 2, 2)
        occ.fragment([(2, disc)], [(2, plate)])
        occ.synchronize()
        small = min((tag for _, tag in gmsh.model.getEntities(2)), key=lambda t: occ.getMass(2, t))
        large = [tag for _, tag in gmsh.model.getEntities(2) if tag != small]
        circle = {tag for _, tag in gmsh.model.getBoundary([(2, small)], oriented=False)}
        every = {tag for _, tag in gmsh.model.getEntities(1)}
        gmsh.model.addPhysicalGroup(2, [small], 1, name="upper")
        gmsh.model.addPhysicalGroup(2, large, 2, name="lower")
        gmsh.model.addPhysicalGroup(1, sorted(every - circle), 3, name="outside")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)

    with session(comm, build, "The test") as model:
        return nm.from_gmsh(model, comm)


def test_curved_sides_stay_on_each_other(measures):
    """Vertices of both sides keep the area of the disc; both have its marks."""
    coarse = pin().split(SIDES)
    fine = coarse.remeshed(0.15)
    for domain in (coarse.refined(), fine, fine.refined()):
        assert_paired(domain)
        assert measures.region(domain, "upper") == pytest.approx(np.pi * 0.5**2, rel=1e-3)
        one, other = domain.facing("punch", "block")
        facets = domain.mesh.topology.connectivity(2, 1).array.reshape(-1, 3)
        table = np.full(facets.max() + 1, -1)
        table[domain.curved_facets.indices] = domain.curved_facets.values
        marks = [table[facets[tuple(sides.T)]] for sides in (one, other)]
        assert np.array_equal(*marks)
        assert np.all(marks[0] >= 0)
        assert domain.offset is not None


def test_it_tells_its_pairs():
    domain = layers(2).split(SIDES)
    assert "pairs punch/block of 8 facets" in repr(domain)
    assert "punch/block of 8 facets" in domain._repr_html_()
    assert "pairs" not in repr(domain.glued)
    assert "pairs" not in domain.glued._repr_html_()


@pytest.mark.parametrize(
    ("sides", "on", "words"),
    [
        ({"a": "upper", "b": "middle"}, None, "no cell region is called 'middle'.* lower, upper"),
        (SIDES, "seam", "no part is called 'seam'.* bottom, joint, left"),
        ({"a": "upper"}, None, "give two"),
        ({"a": "upper", "b": "lower", "c": "lower"}, None, "give two"),
        ([("a", "upper"), ("b", "lower")], None, "give two"),
        ({"a": "upper", 3: "lower"}, None, "give two"),
        ({"a": "upper", "b": ["lower"]}, None, "no cell region"),
        ({"top": "upper", "b": "lower"}, None, "has a part 'top' already"),
        ({"a": "upper", "b": "upper"}, None, "both sides are in the region 'upper'"),
        (SIDES, "bottom", "share no facet of the part on="),
        (SIDES, 9, "no part is called 9"),
    ],
)
def test_a_wrong_call_says_what_to_do(sides, on, words):
    base = layers(2, inner=lambda x: np.where(x[:, 1] == 0.5, 9, -1), parts={"joint": 9})
    with pytest.raises(nm.InputError, match=words):
        base.split(sides, on=on)


def test_what_cannot_be_split_says_why():
    plain = nm.rectangle((0, 0), (1, 1), cells=(2, 2))
    with pytest.raises(nm.InputError, match="has no regions"):
        plain.split(SIDES)
    with pytest.raises(nm.InputError, match="has no pairs"):
        plain.facing("left", "right")
    with pytest.raises(nm.InputError, match="not split already"):
        layers(2).split(SIDES).split({"a": "upper", "b": "lower"})
    domain = layers(2).split(SIDES)
    with pytest.raises(nm.InputError, match="has a part 'punch' already"):
        domain.split({"punch": "upper", "b": "lower"})
    with pytest.raises(nm.InputError, match="the pairs 'punch' and 'block'"):
        domain.facing("punch", "top")
    with pytest.raises(nm.InputError):
        domain.refined(np.array([domain.owned_cells]))


def test_a_name_on_one_rank_only_is_refused_on_all():
    sides = SIDES if COMM.rank == 0 else {"a": "upper", "b": "nowhere"}
    if COMM.size == 1:
        sides = {"a": "upper", "b": "nowhere"}
    with pytest.raises(nm.InputError, match="nowhere"):
        layers(2).split(sides)
