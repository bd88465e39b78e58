"""Domains: names, exact measures, files, refinement, distribution.

Properties, each a number against a scale: the measure of every named part and region is
exact to round-off, from whatever source and through refinement; refined meshes are
conforming (every facet without a neighbour has a name); every rank holds all cells
around the vertices of its own cells; the load is balanced; the refined mesh does not
depend on the number of ranks; refined coordinates are exact, bit by bit: a side at y =
0 stays there; a gmsh session of the user's survives, ours is closed.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem, la
from dolfinx import mesh as dmesh
from domains import two_materials
from mpi4py import MPI

import namedmesh as nm
from namedmesh.base.releases import cell_nodes, coordinate_map
from namedmesh.partition import patches_complete

COMM = MPI.COMM_WORLD
EXACT = 1e-12
"""Round-off, relative to the measure."""

RECTANGLE = ((0.5, -1.0), (2.5, 6.0))
RECTANGLE_SIDES = {"left": 7.0, "right": 7.0, "bottom": 2.0, "top": 2.0}
BOX = ((0.0, -1.0, 0.5), (1.0, 1.0, 3.5))
BOX_SIDES = {"left": 6.0, "right": 6.0, "front": 3.0, "back": 3.0, "bottom": 2.0, "top": 2.0}
BRICKS = {
    "rectangle, size": (lambda **k: nm.rectangle(*RECTANGLE, size=0.8, **k), RECTANGLE_SIDES, 14.0),
    "rectangle, cells": (
        lambda **k: nm.rectangle(*RECTANGLE, cells=(3, 10), **k),
        RECTANGLE_SIDES,
        14.0,
    ),
    "box, size": (lambda **k: nm.box(*BOX, size=0.8, **k), BOX_SIDES, 6.0),
    "box, cells": (lambda **k: nm.box(*BOX, cells=(2, 3, 4), **k), BOX_SIDES, 6.0),
}
bricks = pytest.mark.parametrize("brick", BRICKS)


def close(value, exact):
    return value == pytest.approx(exact, rel=EXACT, abs=0)


def midpoints(domain):
    """Midpoints of this rank's cells, shape (cells, d)."""
    mesh = domain.mesh
    x = dmesh.compute_midpoints(mesh, domain.dim, np.arange(domain.owned_cells, dtype=np.int32))
    return x[:, : domain.dim]


def near(domain, point, radius):
    """This rank's cells near a point."""
    return np.flatnonzero(np.linalg.norm(midpoints(domain) - point, axis=1) < radius)


def assert_closed(domain):
    """Every facet without a neighbour has exactly one name.

    No hanging node, no hole, no part lost.
    """
    topology = domain.mesh.topology
    outer = np.sort(dmesh.exterior_facet_indices(topology))
    owned = topology.index_map(domain.dim - 1).size_local
    named = np.concatenate([domain.facet_tags.find(tag) for tag in domain.names.values()])
    assert np.array_equal(np.sort(named[named < owned]), outer)


def assert_distributed_well(domain):
    """All cells around the vertices of own cells are here, counted independently.

    No rank has too many cells.
    """
    topology = domain.mesh.topology
    topology.create_connectivity(domain.dim, 0)
    local = topology.connectivity(domain.dim, 0).array.reshape(-1, domain.dim + 1)
    vertices = topology.index_map(0).local_to_global(local.ravel()).reshape(local.shape)
    owned = vertices[: domain.owned_cells]
    everywhere = np.bincount(
        np.concatenate(COMM.allgather(owned.ravel())), minlength=domain.vertices
    )
    here = np.bincount(vertices.ravel(), minlength=domain.vertices)
    assert np.array_equal(here[owned], everywhere[owned])
    assert patches_complete(domain.mesh)
    assert COMM.allreduce(domain.owned_cells, MPI.MAX) <= 1.3 * domain.cells / COMM.size + 50


# -- sources
# -------------------------------------------------------------------------------------------------


@bricks
def test_rectangle_and_box_have_exact_named_sides(brick, measures):
    make, sides, volume = BRICKS[brick]
    domain = make()
    assert set(domain.names) == set(sides)
    for name, area in sides.items():
        assert close(measures.part(domain, name), area)
    assert close(measures.region(domain), volume)
    corners = np.array(RECTANGLE if domain.dim == 2 else BOX)
    assert close(domain.extent, np.linalg.norm(corners[1] - corners[0]))
    assert_closed(domain)
    assert_distributed_well(domain)


@bricks
def test_forms_integrate_over_the_same_parts(brick):
    make, sides, _ = BRICKS[brick]
    domain = make()
    ds = ufl.Measure("ds", domain=domain.mesh, subdomain_data=domain.facet_tags)
    # One form with a weight for each part: a form for each would be compiled for each.
    weights = {name: fem.Constant(domain.mesh, 0.0) for name in sides}
    terms = [weight * ds(domain.tag(name)) for name, weight in weights.items()]
    form = fem.form(sum(terms[1:], start=terms[0]))
    for name, area in sides.items():
        weights[name].value = 1.0
        assert close(COMM.allreduce(fem.assemble_scalar(form)), area)
        weights[name].value = 0.0


def test_meshes_of_gmsh_need_no_forms_of_their_own():
    """Forms know the coordinate element, in Python and by a number in DOLFINx."""
    regular = nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)).mesh
    irregular = nm.rectangle((0.0, 0.0), (1.0, 1.0), size=0.5).mesh
    elements = [mesh.ufl_domain().ufl_coordinate_element() for mesh in (regular, irregular)]
    numbers = [coordinate_map(mesh.geometry).hash() for mesh in (regular, irregular)]
    assert elements[0] == elements[1]
    assert numbers[0] == numbers[1]


def test_size_is_the_size_of_cells():
    coarse, fine = nm.rectangle(*RECTANGLE, size=1.0), nm.rectangle(*RECTANGLE, size=0.25)
    assert fine.cells / coarse.cells == pytest.approx(16, rel=0.5)
    assert coarse.cells == pytest.approx(14.0 / (0.43 * 1.0**2), rel=0.5)


def plate(gmsh):
    """A plate (0, 2) x (0, 1) with a circular hole.

    Regions body and strip (x > 1.4), and their interface.
    """
    occ, model = gmsh.model.occ, gmsh.model
    whole, hole = occ.addRectangle(0, 0, 0, 2, 1), occ.addDisk(0.6, 0.5, 0, 0.25, 0.25)
    cut, _ = occ.cut([(2, whole)], [(2, hole)])
    surfaces, _ = occ.fragment(cut, [(2, occ.addRectangle(1.4, 0, 0, 0.6, 1))])
    occ.synchronize()
    outer = {tag for _, tag in model.getBoundary(surfaces, oriented=False)}
    where = {"left": (0, 0.0), "right": (0, 2.0), "bottom": (1, 0.0), "top": (1, 1.0)}
    groups = {name: [] for name in (*where, "hole", "interface")}
    for _, tag in model.getEntities(1):
        centre = occ.getCenterOfMass(1, tag)
        at = next(
            (name for name, (axis, value) in where.items() if abs(centre[axis] - value) < 1e-9),
            "hole",
        )
        groups[at if tag in outer else "interface"].append(tag)
    for name, tags in groups.items():
        model.addPhysicalGroup(1, tags, name=name)
    for _, tag in surfaces:
        model.addPhysicalGroup(
            2, [tag], name="strip" if occ.getCenterOfMass(2, tag)[0] > 1.4 else "body"
        )
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)


PLATE_SIDES = {"left": 1.0, "right": 1.0, "bottom": 2.0, "top": 2.0}


def polygon(gmsh):
    """Perimeter and area of the polygon that the mesh makes of the hole, on all ranks."""
    if gmsh is None:
        return COMM.bcast(None)
    model = gmsh.model
    group = next(
        tag for _, tag in model.getPhysicalGroups(1) if model.getPhysicalName(1, tag) == "hole"
    )
    x = model.mesh.getNodesForPhysicalGroup(1, group)[1].reshape(-1, 3)[:, :2] - (0.6, 0.5)
    x = x[np.argsort(np.arctan2(x[:, 1], x[:, 0]))]
    after = np.roll(x, -1, axis=0)
    perimeter = np.linalg.norm(after - x, axis=1).sum()
    area = 0.5 * abs(np.sum(x[:, 0] * after[:, 1] - x[:, 1] * after[:, 0]))
    return COMM.bcast((float(perimeter), float(area)))


def polygon_of(domain):
    """Perimeter and area of the hole of a mesh, whose facets go once around its middle."""
    facets = domain.facets("hole")
    own = facets[facets[:, 0] < domain.owned_cells]
    ends = np.array([[1, 2], [0, 2], [0, 1]])[own[:, 1]]
    x = domain.mesh.geometry.x[
        np.take_along_axis(cell_nodes(domain.mesh.geometry)[own[:, 0]], ends, axis=1)
    ]
    chord = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    first, second = np.moveaxis(x[..., :2] - (0.6, 0.5), 1, 0)
    double = abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    angle = np.arctan2(double, (first * second).sum(axis=1))
    perimeter, area, whole = (COMM.allreduce(float(v.sum())) for v in (chord, 0.5 * double, angle))
    assert whole == pytest.approx(2 * np.pi, rel=1e-9)
    return perimeter, area


def assert_plate(domain, hole, measures, named=True):
    perimeter, area = hole
    assert set(domain.names) == {*PLATE_SIDES, "hole", "interface"}
    assert set(domain.regions) == {"body", "strip"}
    for name, length in PLATE_SIDES.items():
        assert close(measures.part(domain, name), length)
    assert close(measures.part(domain, "hole"), perimeter)
    assert close(measures.region(domain, "strip"), 0.6)
    assert close(measures.region(domain, "body"), 1.4 - area)
    assert close(measures.region(domain), 2.0 - area)


def test_gmsh_model_with_a_hole_and_two_regions(gmsh_session, measures):
    if gmsh_session:
        plate(gmsh_session)
    domain = nm.from_gmsh(gmsh_session.model if gmsh_session else None)
    hole = polygon_of(domain)
    assert hole == pytest.approx((2 * np.pi * 0.25, np.pi * 0.25**2), rel=0.03)
    assert_plate(domain, hole, measures)
    for step in range(5):
        domain = domain.refined(near(domain, (0.85, 0.5), 0.3 / 1.5**step))
        assert_plate(domain, polygon_of(domain), measures)
        assert_distributed_well(domain)
    assert domain.cells < 5000


def test_gmsh_model_on_another_rank(measures):
    import gmsh

    holder = COMM.size - 1
    if COMM.rank == holder:
        gmsh.initialize(interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("user")
        plate(gmsh)
    domain = nm.from_gmsh(gmsh.model if COMM.rank == holder else None, rank=holder)
    if COMM.rank == holder:
        gmsh.finalize()
    assert close(measures.region(domain, "strip"), 0.6)


def test_gmsh_model_without_regions_is_one_region(gmsh_session, measures):
    if gmsh_session:
        gmsh_session.model.occ.addBox(0, 0, 0, 1, 2, 3)
        gmsh_session.model.occ.synchronize()
        gmsh_session.model.addPhysicalGroup(2, [1], name="left")
        gmsh_session.option.setNumber("Mesh.MeshSizeMin", 1.0)
    domain = nm.from_gmsh(gmsh_session.model if gmsh_session else None)
    assert list(domain.regions) == ["body"]
    assert close(measures.region(domain, "body"), 6.0)
    assert close(measures.part(domain, "left"), 6.0)


def test_cells_and_facets_may_share_a_name_and_need_none(gmsh_session, measures):
    if gmsh_session:
        model = gmsh_session.model
        model.occ.addRectangle(0, 0, 0, 2, 1)
        model.occ.synchronize()
        model.addPhysicalGroup(2, [1], name="steel")
        model.addPhysicalGroup(1, [1], name="steel")
        model.addPhysicalGroup(1, [2], tag=17)
    domain = nm.from_gmsh(gmsh_session.model if gmsh_session else None)
    assert close(measures.region(domain, "steel"), 2.0)
    assert close(measures.part(domain, "steel"), 2.0)
    assert close(measures.part(domain, "17"), 1.0)


# -- files
# ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [pytest.param(2.2, marks=pytest.mark.broad), 4.1])
@pytest.mark.parametrize("binary", [0, 1])
def test_msh_file(version, binary, gmsh_session, shared_tmp_path, measures):
    path = shared_tmp_path / "plate.msh"
    if gmsh_session:
        plate(gmsh_session)
        gmsh_session.model.mesh.generate(2)
        gmsh_session.option.setNumber("Mesh.MshFileVersion", version)
        gmsh_session.option.setNumber("Mesh.Binary", binary)
        gmsh_session.write(str(path))
    hole = polygon(gmsh_session)
    if gmsh_session:
        gmsh_session.finalize()
    COMM.barrier()
    assert_plate(nm.read_mesh(path), hole, measures)
    assert_plate(nm.read_mesh(str(path)), hole, measures)


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_msh_file_in_space(version, gmsh_session, shared_tmp_path, measures):
    path = shared_tmp_path / "box.msh"
    if gmsh_session:
        model = gmsh_session.model
        model.occ.addBox(0, 0, 0, 1, 2, 3)
        model.occ.synchronize()
        model.addPhysicalGroup(3, [1], name="body")
        model.addPhysicalGroup(2, [1], name="left")
        model.addPhysicalGroup(2, [2, 3, 4, 5, 6], name="rest")
        gmsh_session.option.setNumber("Mesh.MeshSizeMin", 1.0)
        model.mesh.generate(3)
        gmsh_session.option.setNumber("Mesh.MshFileVersion", version)
        gmsh_session.write(str(path))
    COMM.barrier()
    domain = nm.read_mesh(path)
    assert close(measures.part(domain, "left"), 6.0)
    assert close(measures.part(domain, "rest"), 16.0)
    assert close(measures.region(domain, "body"), 6.0)
    assert_closed(domain)


def test_msh_file_with_gaps_in_the_numbers_of_nodes(shared_tmp_path, measures):
    path = shared_tmp_path / "gaps.msh"
    if COMM.rank == 0:
        path.write_text(
            '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n1 1 "bottom"\n$EndPhysicalNames\n'
            "$Nodes\n5\n10 0 0 0\n20 2 0 0\n30 2 1 0\n40 0 1 0\n50 9 9 0\n$EndNodes\n"
            "$Elements\n3\n1 1 2 1 1 10 20\n2 2 2 3 1 10 20 30\n3 2 2 3 1 10 30 40\n$EndElements\n"
        )
    COMM.barrier()
    domain = nm.read_mesh(path)
    assert close(measures.part(domain, "bottom"), 2.0)
    assert close(measures.region(domain, "3"), 2.0)
    assert (domain.cells, domain.vertices) == (2, 4)


def test_geo_file(shared_tmp_path, measures):
    path = shared_tmp_path / "triangle.geo"
    if COMM.rank == 0:
        path.write_text(
            "Point(1) = {0, 0, 0, 0.4}; Point(2) = {3, 0, 0, 0.4}; Point(3) = {0, 4, 0, 0.4};\n"
            "Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 1};\n"
            'Curve Loop(1) = {1, 2, 3}; Plane Surface(1) = {1};\nPhysical Curve("slope") = {2};\n'
            'Physical Curve("foot") = {1};\n'
        )
    COMM.barrier()
    domain = nm.read_mesh(path, scripts=True)
    assert close(measures.part(domain, "slope"), 5.0)
    assert close(measures.part(domain, "foot"), 3.0)
    assert close(measures.region(domain), 6.0)


def tagged_block(gmsh, dim):
    """A rectangle 2 x 1 or a box 2 x 1 x 1 with named sides, meshed.

    The names of gmsh's groups by measure.
    """
    occ, model = gmsh.model.occ, gmsh.model
    _ = occ.addRectangle(0, 0, 0, 2, 1) if dim == 2 else occ.addBox(0, 0, 0, 2, 1, 1)
    occ.synchronize()
    model.addPhysicalGroup(dim, [1], tag=9, name="body")
    for _, tag in model.getEntities(dim - 1):
        centre = occ.getCenterOfMass(dim - 1, tag)
        model.addPhysicalGroup(
            dim - 1, [tag], tag=tag, name=f"low{tag}" if centre[0] < 1e-9 else f"other{tag}"
        )
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    model.mesh.generate(dim)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    "suffix", [".vtu", pytest.param(".vtk", marks=pytest.mark.broad), ".inp", ".mesh", ".su2"]
)
def test_other_formats(suffix, dim, gmsh_session, shared_tmp_path, measures):
    path = shared_tmp_path / f"block{suffix}"
    if gmsh_session:
        tagged_block(gmsh_session, dim)
        if suffix in (".vtu", ".vtk"):  # by meshio, from the .msh file
            import meshio

            gmsh_session.write(str(shared_tmp_path / "block.msh"))
            read = meshio.read(shared_tmp_path / "block.msh")
            meshio.Mesh(
                read.points, read.cells, cell_data={"part": read.cell_data["gmsh:physical"]}
            ).write(path)
        else:
            gmsh_session.write(str(path))
    COMM.barrier()
    domain = nm.read_mesh(path)
    assert close(measures.region(domain), 2.0)
    lengths = sorted(measures.part(domain, name) for name in domain.names)
    assert lengths == pytest.approx(
        [1.0, 1.0, 2.0, 2.0] if dim == 2 else [1.0, 1.0, 2.0, 2.0, 2.0, 2.0], rel=1e-6
    )
    assert_closed(domain)
    if suffix != ".inp":  # numbers become names
        assert set(domain.names) == {str(number) for number in range(1, 2 * dim + 1)}
    if suffix in (".vtu", ".vtk"):
        assert set(domain.regions) == {"9"}


@pytest.fixture
def tagged_file(shared_tmp_path):
    """A unit square as a vtu file of two triangles, without nodes inside.

    Sides 1 to 4, body 3.
    """
    path = shared_tmp_path / "square.vtu"
    if COMM.rank == 0:
        import meshio

        x = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
        cells = [
            ("line", np.array([[0, 1], [1, 2], [2, 3], [3, 0]])),
            ("triangle", np.array([[0, 1, 2], [0, 2, 3]])),
        ]
        tags = [np.array([1, 2, 3, 4]), np.array([3, 3])]
        meshio.Mesh(x, cells, cell_data={"part": tags}).write(path)
    COMM.barrier()
    return path


def test_parts_of_a_file_get_names(tagged_file, measures):
    """A vtu file has tags only."""
    names = {1: "bottom", (1, 3): "top", (2, 3): "steel"}
    domain = nm.read_mesh(tagged_file, names=names)
    assert set(domain.names) == {"bottom", "2", "top", "4"}
    assert set(domain.regions) == {"steel"}
    assert close(measures.part(domain, "bottom"), 1.0)
    x = domain.mesh.geometry.x[
        dmesh.entities_to_geometry(domain.mesh, 1, domain.facet_tags.find(domain.tag("top")))
    ]
    assert np.all(x[..., 1] == 1.0)


@pytest.mark.broad
def test_names_of_parts_that_cannot_be_given(tagged_file):
    for names, words in (
        ({7: "bottom"}, "no part of the mesh has this tag; the mesh has 1, 2, 3, 4, 3"),
        ({3: "top"}, r"a boundary part and a region; give one of \(1, 3\) and \(2, 3\)"),
        ({1: "side", 2: "side"}, "tags 1 and 2 would have the name 'side'"),
        ({1: "2"}, "tags 1 and 2 would have the name '2'"),
        ({"bottom": 1}, "names of parts by their tags"),
        (["bottom"], "names of parts by their tags"),
    ):
        with pytest.raises(nm.InputError, match=words):
            nm.read_mesh(tagged_file, names=names)


# -- meshes of the user's
# ------------------------------------------------------------------------------------


def own_mesh(mesh):
    """Tags of the left and right sides and of two halves of a unit square or cube."""
    tdim = mesh.topology.dim
    found = [
        dmesh.locate_entities_boundary(mesh, tdim - 1, lambda x, v=v: abs(x[0] - v) < 1e-9)
        for v in (0.0, 1.0)
    ]
    values = np.repeat([3, 7], [len(f) for f in found]).astype(np.int32)
    order = np.argsort(np.concatenate(found))
    facet_tags = dmesh.meshtags(mesh, tdim - 1, np.concatenate(found)[order], values[order])
    index_map = mesh.topology.index_map(tdim)
    cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    upper = dmesh.compute_midpoints(mesh, tdim, cells)[:, 1] > 0.5
    return facet_tags, dmesh.meshtags(mesh, tdim, cells, np.where(upper, 2, 1).astype(np.int32))


@pytest.mark.parametrize("ghosts", [dmesh.GhostMode.none, dmesh.GhostMode.shared_facet])
@pytest.mark.parametrize("dim", [2, 3])
def test_mesh_of_the_user(dim, ghosts, measures):
    if dim == 2:
        mesh = dmesh.create_unit_square(COMM, 8, 8, ghost_mode=ghosts)
    else:
        mesh = dmesh.create_unit_cube(COMM, 4, 4, 4, ghost_mode=ghosts)
    facet_tags, cell_tags = own_mesh(mesh)
    domain = nm.Domain(
        mesh, facet_tags, {"left": 3, "right": 7}, cell_tags, {"lower": 1, "upper": 2}
    )
    for _ in range(2):
        assert close(measures.part(domain, "left"), 1.0)
        assert close(measures.part(domain, "right"), 1.0)
        assert close(measures.region(domain, "lower"), 0.5)
        assert close(measures.region(domain, "upper"), 0.5)
        assert_distributed_well(domain)
        domain = domain.refined(near(domain, np.full(dim, 0.5), 0.3))
    assert COMM.size > 1 or nm.Domain(mesh, facet_tags, {"left": 3}).mesh is mesh


def known(domain, tags, dim):
    """The tags of all entities of this rank, ghosts included, by the places of their middles."""
    domain.mesh.topology.create_connectivity(dim, domain.dim)
    middle = dmesh.compute_midpoints(domain.mesh, dim, tags.indices)
    return {tuple(np.round(x, 9)): tag for x, tag in zip(middle, tags.values, strict=True)}


@pytest.mark.parametrize("side", ["owners", "others"])
@pytest.mark.parametrize("dim", [2, 3])
def test_tags_that_one_rank_gives_are_known_to_all_that_have_the_facet(dim, side):
    """DOLFINx locates facets on the rank that owns them.

    Nodes of the contact were missing where ranks meet.
    """
    whole = two_materials(np.full(dim, 1.0), 0.2, MPI.COMM_WORLD)
    cut = []
    for tags in (whole.facet_tags, whole.cell_tags):
        index_map = whole.mesh.topology.index_map(tags.dim)
        here = tags.indices < index_map.size_local
        if side == "others":
            ghosts = la.vector(index_map)
            ghosts.array[index_map.size_local :] = 1.0
            ghosts.scatter_reverse(la.InsertMode.add)
            here = ~here | (ghosts.array[tags.indices] == 0)
        cut.append(dmesh.meshtags(whole.mesh, tags.dim, tags.indices[here], tags.values[here]))
    domain = nm.Domain(whole.mesh, cut[0], whole.names, cut[1], whole.regions)
    assert known(domain, domain.facet_tags, dim - 1) == known(whole, whole.facet_tags, dim - 1)
    assert known(domain, domain.cell_tags, dim) == known(whole, whole.cell_tags, dim)


# -- refinement
# ----------------------------------------------------------------------------------------------


@bricks
def test_five_local_refinements(brick, measures):
    make, sides, volume = BRICKS[brick]
    domain = make()
    corner = np.array((RECTANGLE if domain.dim == 2 else BOX)[1])
    for step in range(5):
        coarse = domain.cells
        domain = domain.refined(near(domain, corner, 1.5 / 2**step))
        assert domain.cells > coarse
        assert dict(domain.names).keys() == sides.keys()
        for name, area in sides.items():
            assert close(measures.part(domain, name), area)
        assert close(measures.region(domain), volume)
        assert_closed(domain)
        assert_distributed_well(domain)
    assert domain.cells < 5000


@bricks
def test_uniform_refinement_cuts_every_cell_in_2_to_the_d(brick, measures):
    make, sides, volume = BRICKS[brick]
    domain = make()
    fine = domain.refined()
    assert fine.cells == 2**domain.dim * domain.cells
    assert close(measures.region(fine), volume)
    for name, area in sides.items():
        assert close(measures.part(fine, name), area)
    assert_distributed_well(fine)


def test_refinement_leaves_the_coarse_domain_as_it_was(block):
    before = block.mesh.geometry.x.copy()
    block.refined(near(block, (0.0, 0.0), 0.5))
    assert np.array_equal(block.mesh.geometry.x, before)
    assert block.cells == 32


def nodes_of_all(domain):
    """Coordinates of the nodes of all ranks, each once, shape (nodes, 3)."""
    return np.unique(np.concatenate(domain.mesh.comm.allgather(domain.mesh.geometry.x)), axis=0)


@pytest.mark.on_ranks("2-0.001", "3-1000.0")
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("dim", [2, 3])
def test_refined_coordinates_are_exact(dim, scale):
    """Old nodes stay as they are.

    A new one is the mean of two old ones: one of the means of the old edges.
    """
    low, high = scale * np.array([[-0.7, 0.0, 0.1], [1.1, 0.9, 1.3]])[:, :dim]
    make = nm.rectangle if dim == 2 else nm.box
    domain = make(low, high, cells=(3, 2, 2)[:dim])
    for step in range(4):
        x, cells = domain.mesh.geometry.x, cell_nodes(domain.mesh.geometry)
        i, j = np.triu_indices(dim + 1)
        means = 0.5 * (x[cells[:, i].ravel()] + x[cells[:, j].ravel()])
        means = {row.tobytes() for row in np.concatenate(COMM.allgather(means)) + 0.0}
        before = domain
        domain = domain.refined(near(domain, high, scale / 2**step) if step else None)
        after = {row.tobytes() for row in nodes_of_all(domain) + 0.0}
        assert {row.tobytes() for row in nodes_of_all(before) + 0.0} < after <= means
    assert_sides_exact(domain)


def assert_sides_exact(domain):
    """The nodes on the sides of a rectangle or box have the side's coordinate, bit by bit."""
    sides = np.array([[j for j in range(domain.dim + 1) if j != i] for i in range(domain.dim + 1)])
    for name, axis, at in domain.geometry.sides():
        facets = domain.facets(name)
        nodes = np.take_along_axis(
            cell_nodes(domain.mesh.geometry)[facets[:, 0]], sides[facets[:, 1]], axis=1
        )
        assert set(domain.mesh.geometry.x[nodes.ravel(), axis]) <= {at}, name


@pytest.mark.on_ranks("2-1.0-remeshed", "2-0.001-size", "3-1.0-cells", "3-1000.0-remeshed")
@pytest.mark.parametrize("kind", ["cells", "size", "remeshed"])
@pytest.mark.parametrize(("dim", "scale"), [(2, 1.0), (2, 1e-3), (3, 1.0), (3, 1e3)])
def test_sides_of_bricks_are_exact(dim, scale, kind):
    for low, high in (((-0.7, 0.0, 0.1), (1.1, 0.9, 1.3)), ((0.1, 0.2, 0.3), (0.7, 0.9, 1.1))):
        make = nm.rectangle if dim == 2 else nm.box
        corners = scale * np.array([low, high])[:, :dim]
        domain = make(
            *corners, **({"cells": (3, 3, 7)[:dim]} if kind == "cells" else {"size": 0.6 * scale})
        )
        assert_sides_exact(domain.remeshed(0.4 * scale) if kind == "remeshed" else domain)


def test_refining_nothing_keeps_the_mesh(block):
    same = block.refined(np.empty(0, dtype=np.int32))
    assert (same.cells, same.vertices) == (block.cells, block.vertices)
    assert set(same.names) == set(block.names)


def test_refinement_near_a_point_does_not_spread(block):
    domain = block
    for _ in range(5):
        domain = domain.refined(near(domain, (1.0, 1.0), 0.1))
    assert domain.cells < 5 * block.cells


def sorted_midpoints(domain):
    """Midpoints of all cells in an order that does not depend on the numbering, on all ranks."""
    x = np.concatenate(domain.mesh.comm.allgather(midpoints(domain)))
    return x[np.argsort(x @ np.sqrt([2.0, 3.0, 5.0][: domain.dim]))]


@pytest.mark.ranks
@bricks
def test_refined_meshes_do_not_depend_on_the_number_of_ranks(brick):
    make, _, _ = BRICKS[brick]
    shared, alone = make(), make(comm=MPI.COMM_SELF)
    corner = np.array((RECTANGLE if shared.dim == 2 else BOX)[1])
    for step in range(5):
        shared, alone = (d.refined(near(d, corner, 1.5 / 2**step)) for d in (shared, alone))
        assert shared.cells == alone.cells
        assert shared.vertices == alone.vertices
        assert abs(sorted_midpoints(shared) - sorted_midpoints(alone)).max() < 1e-12 * shared.extent


# -- distribution
# --------------------------------------------------------------------------------------------


def test_domain_on_a_part_of_the_ranks(measures):
    comm = COMM.Split(color=min(COMM.rank, 1))
    domain = nm.rectangle(*RECTANGLE, size=1.0, comm=comm).refined()
    assert domain.mesh.comm.size == comm.size
    for name, area in RECTANGLE_SIDES.items():
        assert close(measures.part(domain, name), area)
    comm.Free()


def test_fewer_cells_than_ranks(measures):
    domain = nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1))
    for _ in range(3):
        assert close(measures.region(domain), 1.0)
        assert close(measures.part(domain, "top"), 1.0)
        assert_closed(domain)
        domain = domain.refined()


# -- gmsh's session
# ------------------------------------------------------------------------------------------


def test_our_gmsh_session_is_closed(shared_tmp_path):
    import gmsh

    nm.rectangle((0.0, 0.0), (1.0, 1.0), size=0.5)
    assert not gmsh.isInitialized()
    with pytest.raises(nm.InputError):
        nm.read_mesh(shared_tmp_path / "missing.msh")
    assert not gmsh.isInitialized()


def test_a_gmsh_session_of_the_user_survives(gmsh_session, shared_tmp_path):
    path = shared_tmp_path / "plate.msh"
    names = (
        "Mesh.MeshSizeMin",
        "Mesh.MeshSizeMax",
        "Mesh.ElementOrder",
        "Mesh.RecombineAll",
        "General.Terminal",
    )

    def state():
        gmsh, model = gmsh_session, gmsh_session.model
        return (
            sorted(model.list()),
            model.getCurrent(),
            model.getEntities(),
            model.getPhysicalGroups(),
            model.mesh.getNodes()[1].tolist(),
            [gmsh.option.getNumber(name) for name in names],
        )

    before = None
    if gmsh_session:
        plate(gmsh_session)
        gmsh_session.model.mesh.generate(2)
        gmsh_session.write(str(path))
        gmsh_session.model.add("another")
        gmsh_session.model.setCurrent("user")
        gmsh_session.option.setNumber("Mesh.ElementOrder", 2)
        gmsh_session.option.setNumber("Mesh.RecombineAll", 1)
        before = state()
    COMM.barrier()
    assert nm.rectangle((0.0, 0.0), (1.0, 1.0), size=0.5).cells > 4
    nm.read_mesh(path)
    with pytest.raises(nm.InputError):
        nm.read_mesh(shared_tmp_path / "missing.msh")
    if gmsh_session:
        assert gmsh_session.isInitialized()
        assert state() == before
