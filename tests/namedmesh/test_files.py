"""Mesh files of others come in: cells of any shape, sets by their names.

- A collection of files of every kind: volumes, parts and regions are right.

- Flaws of practice are left out and told, or refused in words; none ends the
  interpreter.
- A mesh of DOLFINx of other cells is split likewise, the same on any ranks.
"""

import logging
import sys

import basix.ufl
import file_collection as files
import numpy as np
import pytest
import ufl
from dolfinx import mesh as dmesh
from file_collection import CASES
from mpi4py import MPI

import namedmesh as nm

COMM = MPI.COMM_WORLD
EXACT = 1e-12
"""Round-off, relative to the measure."""


def made(case, folder):
    """The path of the file of a case, which rank 0 or all ranks make."""
    path = case.make(folder) if case.collective or COMM.rank == 0 else None
    return COMM.bcast(path)


def words_of(name):
    """The body and the form of a case: each of them is in a short run, not each pair."""
    body, _, form = name.partition(", ")
    return sys.intern(body), sys.intern(form)


BROADER = {name for name in CASES if name.endswith(".vtu") or name.startswith("exodus of")}
BROADER -= {"meshio hexahedron of order 2, .vtu", "exodus of hexahedron"}
"""Readers of VTK run in a process of their own; what they read takes one way from there."""


def case_of(name):
    """The parameters of a case, and whether it is left to the broad suite."""
    marks = [pytest.mark.broad] if name in BROADER else []
    return pytest.param(*words_of(name), marks=marks)


@pytest.mark.on_ranks("inp of hexahedron, sides by faces", "gmsh hexahedra in 2D, .med")
@pytest.mark.parametrize(("body", "form"), [case_of(name) for name in CASES], ids=list(CASES))
def test_a_file_comes_in_with_its_sets(body, form, shared_tmp_path, measures):
    case = CASES[f"{body}, {form}" if form else body]
    path = made(case, shared_tmp_path)
    domain = nm.read_mesh(path)
    assert domain.dim == case.dim
    # Files of 7 digits have more round-off.
    assert measures.region(domain) == pytest.approx(2.0, rel=1e-6)
    found = {part: measures.part(domain, part) for part in domain.names}
    assert found == pytest.approx(case.parts, rel=1e-6)
    found = {region: measures.region(domain, region) for region in domain.regions}
    assert found == pytest.approx(case.regions, rel=1e-6)


# -- splitting
# ---------------------------------------------------------------------------------


def collapsed(kind, cells):
    """Cells of a kind as hexahedra or quadrilaterals with corners that are there twice."""
    corners = {
        "wedge": [0, 1, 2, 2, 3, 4, 5, 5],
        "pyramid": [0, 1, 2, 3, 4, 4, 4, 4],
        "tetra": [0, 1, 2, 2, 3, 3, 3, 3],
        "triangle": [0, 1, 2, 2],
    }
    return cells[:, corners[kind]]


SPLIT = ["triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid"]
COLLAPSED = ["triangle", "tetra", "wedge", "pyramid"]


@pytest.mark.serial
def test_faces_are_cut_alike_from_both_sides():
    """Hexahedra, prisms and tetrahedra together: each inner face has two tetrahedra."""
    from namedmesh.files.building import build_simplices
    from namedmesh.files.file_mesh import Block, FileMesh

    x, cubes = files.grid(2, 3)
    order = np.random.default_rng(1).permutation(len(x))
    points = np.empty_like(x)
    points[order] = x
    cubes = order[cubes]
    # Columns of prisms stand beside columns of hexahedra.
    prisms = np.arange(len(cubes)) // 2 % 2 == 1
    blocks = (Block("hexahedron", cubes[~prisms]), Block("prism", files.prisms(cubes[prisms])))
    made_of = build_simplices(FileMesh(points, blocks))
    cells = made_of.plain.cells
    sides = np.sort(cells[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    corners, count = np.unique(sides, axis=0, return_counts=True)
    assert count.max() == 2
    outer = made_of.plain.x[corners[count == 1]]
    edges = np.cross(outer[:, 1] - outer[:, 0], outer[:, 2] - outer[:, 0])
    assert 0.5 * np.linalg.norm(edges, axis=1).sum() == pytest.approx(10.0, rel=EXACT)


# -- meshes of DOLFINx
# ---------------------------------------------------------------------------------


def of_dolfinx(kind, comm):
    cell = dmesh.CellType[kind]
    if kind == "quadrilateral":
        mesh = dmesh.create_unit_square(comm, 3, 3, cell)
    else:
        mesh = dmesh.create_unit_cube(comm, 3, 3, 3, cell)
    d = mesh.topology.dim
    found = [
        dmesh.locate_entities_boundary(mesh, d - 1, lambda x, at=at: abs(x[d - 1] - at) < 1e-9)
        for at in (0.0, 1.0)
    ]
    facets = np.concatenate(found)
    tags = np.repeat([4, 9], [len(part) for part in found]).astype(np.int32)
    order = np.argsort(facets)
    facet_tags = dmesh.meshtags(mesh, d - 1, facets[order], tags[order])
    index_map = mesh.topology.index_map(d)
    cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    middle = dmesh.compute_midpoints(mesh, d, cells)
    cell_tags = dmesh.meshtags(mesh, d, cells, np.where(middle[:, 0] < 0.5, 3, 5).astype(np.int32))
    return nm.Domain(mesh, facet_tags, {"foot": 4, "roof": 9}, cell_tags, {"left": 3, "right": 5})


@pytest.mark.parametrize("kind", ["quadrilateral", "hexahedron"])
def test_a_mesh_of_dolfinx_is_split(kind, measures):
    domain = of_dolfinx(kind, COMM)
    assert domain.mesh.topology.cell_type.name in ("triangle", "tetrahedron")
    assert measures.part(domain, "foot") == pytest.approx(1.0, rel=EXACT)
    assert measures.part(domain, "roof") == pytest.approx(1.0, rel=EXACT)
    assert measures.region(domain) == pytest.approx(1.0, rel=EXACT)
    assert measures.region(domain, "left") == pytest.approx(1 / 3, rel=EXACT)


def test_of_second_order_the_corners_are_taken(caplog, measures):
    x = np.array([[0, 0], [1, 0], [0, 1], [0.6, 0.6], [0, 0.5], [0.5, 0]], dtype=float)
    element = basix.ufl.element("Lagrange", "triangle", 2, shape=(2,))
    here = COMM.rank == 0
    cells = np.arange(6, dtype=np.int64)[None] if here else np.empty((0, 6), dtype=np.int64)
    mesh = dmesh.create_mesh(COMM, cells, ufl.Mesh(element), x if here else x[:0])
    with caplog.at_level(logging.WARNING, logger="namedmesh"):
        domain = nm.Domain(mesh).named({"foot": nm.where(y=0.0)})
    assert measures.region(domain) == pytest.approx(0.5, rel=EXACT)
    if here:
        assert "curved sides" in caplog.text
        assert "up to 0.141" in caplog.text


# -- names and groups
# ---------------------------------------------------------------------------------


def read_text(folder, name, text):
    """The domain of a file with a text."""
    path = folder / name
    if COMM.rank == 0:
        path.write_text(text)
    COMM.barrier()
    return nm.read_mesh(path)


SQUARES = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
4
1 1 "foot"
1 2 "roof"
2 3 "steel"
2 4 "rubber"
$EndPhysicalNames
$Nodes
6
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 1 2 0
6 0 2 0
$EndNodes
$Elements
4
1 1 2 1 1 1 2
2 1 2 2 1 5 6
3 3 2 3 1 1 2 3 4
4 3 2 4 1 4 3 5 6
$EndElements
"""


def test_groups_of_elements_in_one_entity(shared_tmp_path, measures):
    """In files of version 2 that gmsh has not written all elements may have entity 1."""
    domain = read_text(shared_tmp_path, "squares.msh", SQUARES)
    assert measures.part(domain, "foot") == pytest.approx(1.0, rel=EXACT)
    assert measures.part(domain, "roof") == pytest.approx(1.0, rel=EXACT)
    assert measures.region(domain, "rubber") == pytest.approx(1.0, rel=EXACT)


FIRST_VERSION = """$NOD
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$ENDNOD
$ELM
4
1 1 1 1 2 1 2
2 1 2 2 2 3 4
3 2 9 1 3 1 2 3
4 2 9 1 3 1 3 4
$ENDELM
"""


def test_a_file_of_the_first_version_of_gmsh(shared_tmp_path):
    domain = read_text(shared_tmp_path, "old.msh", FIRST_VERSION)
    assert list(domain.names) == ["1", "2"]
    assert list(domain.regions) == ["9"]


def test_without_groups_surfaces_have_numbers_and_rules_name_them(shared_tmp_path, gmsh_session):
    path = shared_tmp_path / "box.msh"
    if gmsh_session:
        gmsh_session.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh_session.model.occ.synchronize()
        gmsh_session.option.setNumber("Mesh.MeshSizeMin", 0.5)
        gmsh_session.model.mesh.generate(3)
        gmsh_session.write(str(path))
    COMM.barrier()
    assert set(nm.read_mesh(path).names) == {str(number) for number in range(1, 7)}
    named = nm.read_mesh(path, parts={"foot": nm.where(z=0.0)})
    assert list(named.names) == ["foot"]
    model = gmsh_session.model if gmsh_session else None
    assert set(nm.from_gmsh(model).names) == {str(number) for number in range(1, 7)}
    if gmsh_session:
        assert not gmsh_session.model.getPhysicalGroups()


# -- flaws
# ---------------------------------------------------------------------------------

X = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
CUBE = np.arange(8)[None]
FOOT = np.array([[0, 1, 2, 3]])


def cube_with(**changes):
    """Points and blocks of a cube with its foot, and what is added or changed."""
    points = np.array(X, dtype=float)
    blocks = [("quad", FOOT), ("hexahedron", CUBE)]
    tags = [np.array([1]), np.array([9])]
    if "more" in changes:
        kind, rows, tag = changes["more"]
        blocks.append((kind, np.array(rows)))
        tags.append(np.full(len(rows), tag))
    if "points" in changes:
        points = np.vstack([points, changes["points"]])
    for row, value in changes.get("moved", {}).items():
        points[row] = value
    return points, blocks, tags


TOLD = {
    "a cell twice": (
        {"more": ("hexahedron", [[0, 1, 2, 3, 4, 5, 6, 7]], 9)},
        "cells that are there twice",
    ),
    "a flat cell": ({"more": ("tetra", [[0, 0, 1, 2]], 9)}, "cells that have a point twice"),
    "a rigid plate": (
        {
            "more": ("quad", [[8, 9, 10, 11]], 5),
            "points": [[0, 0, 5], [1, 0, 5], [1, 1, 5], [0, 1, 5]],
        },
        "1 facets of no cell",
    ),
    "a point of no cell": ({"points": [[np.nan, 0, 0]]}, ""),
    "a curve": ({"more": ("line", [[0, 1]], 5)}, ""),
}


@pytest.mark.parametrize("case", TOLD)
def test_what_cannot_be_meant_is_left_out_and_told(case, shared_tmp_path, measures, caplog):
    changes, words = TOLD[case]
    path = shared_tmp_path / "cube.vtu"
    if COMM.rank == 0:
        import meshio

        points, blocks, tags = cube_with(**changes)
        meshio.Mesh(points, blocks, cell_data={"tag": tags}).write(path)
    COMM.barrier()
    with caplog.at_level(logging.WARNING, logger="namedmesh"):
        domain = nm.read_mesh(path)
    assert measures.region(domain) == pytest.approx(1.0, rel=EXACT)
    assert measures.part(domain, "1") == pytest.approx(1.0, rel=EXACT)
    assert list(domain.names) == ["1"]
    if COMM.rank == 0:
        assert words in caplog.text


REFUSED = {
    "not a number": ({"moved": {6: [np.nan, 1, 1]}}, "coordinates that are no numbers"),
    "three cells at a face": (
        {
            "more": ("pyramid", [[4, 5, 6, 7, 8], [4, 5, 6, 7, 9]], 9),
            "points": [[0.5, 0.5, 2], [0.4, 0.5, 2]],
        },
        "belong to three cells",
    ),
    "folded": ({"moved": {6: [-1, -1, -1]}}, "cells are folded.*: 1 hexahedron"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_worked_with_is_refused_by_its_place(case, shared_tmp_path):
    changes, words = REFUSED[case]
    path = shared_tmp_path / "cube.vtu"
    if COMM.rank == 0:
        import meshio

        points, blocks, tags = cube_with(**changes)
        meshio.Mesh(points, blocks, cell_data={"tag": tags}).write(path)
    COMM.barrier()
    with pytest.raises(nm.InputError, match=words):
        nm.read_mesh(path)


UNREADABLE = {
    "nurbs.mesh": ("MFEM NURBS mesh v1.0\n\ndimension\n2\n", "MFEM NURBS mesh.*PrintVTU"),
    "body.cgns": ("no CGNS", "damaged, or of a form.*another format"),
    "table.dat": ("1 2 3\n", "of a form that the reader.*another format"),
    "body.meshb": ("no mesh", "another format"),
    "short.inp": (
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n*ELEMENT,TYPE=C3D4\n1,1,2,3\n",
        "element 1 has 3 nodes and its type 4",
    ),
}


@pytest.mark.parametrize("name", UNREADABLE)
def test_what_cannot_be_read_is_told_with_a_way(name, shared_tmp_path):
    text, words = UNREADABLE[name]
    with pytest.raises(nm.InputError, match=words):
        read_text(shared_tmp_path, name, text)


def test_an_image_is_no_mesh(shared_tmp_path):
    path = shared_tmp_path / "image.vti"
    if COMM.rank == 0:
        import pyvista

        pyvista.ImageData(dimensions=(101, 101, 101)).save(path)
    COMM.barrier()
    with pytest.raises(nm.InputError, match="image of 1000000 voxels"):
        nm.read_mesh(path)


def test_axisymmetric_cells_are_told(shared_tmp_path, caplog):
    text = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT,TYPE=CAX4,ELSET=E\n1,1,2,3,4\n"
    with caplog.at_level(logging.WARNING, logger="namedmesh"):
        read_text(shared_tmp_path, "round.inp", text)
    if COMM.rank == 0:
        assert (
            "type CAX4 are axisymmetric: give the material hypothesis='axisymmetric'" in caplog.text
        )


def test_a_plane_mesh_in_another_plane_is_told_how_to_swap(shared_tmp_path):
    path = shared_tmp_path / "upright.vtu"
    if COMM.rank == 0:
        import meshio

        x = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]])
        meshio.Mesh(x, [("quad", [[0, 1, 2, 3]])]).write(path)
    COMM.barrier()
    with pytest.raises(nm.InputError, match=r"plane \(x, z\).*mesh.points\[:, \[0, 2, 1\]\]"):
        nm.read_mesh(path)


def test_shells_alone_are_no_solids(shared_tmp_path):
    text = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n*ELEMENT,TYPE=S4,ELSET=E\n1,1,2,3,4\n"
    with pytest.raises(nm.InputError, match=r"no cells of a solid.*1 of type S4"):
        read_text(shared_tmp_path, "shell.inp", text)


def stray(gmsh, kind):
    """A body with a named curve or surface that is no side of it."""
    occ, model = gmsh.model.occ, gmsh.model
    if kind == "curve":
        occ.addRectangle(0, 0, 0, 1, 1)
        occ.addLine(occ.addPoint(2, 0, 0), occ.addPoint(2, 1, 0))
    elif kind == "curved":
        occ.addCylinder(0, 0, 0, 0, 0, 1, 0.5)
        occ.addRectangle(3, 0, 0, 1, 1)
    else:
        occ.addBox(0, 0, 0, 1, 1, 1)
        occ.addRectangle(3, 0, 1.5, 1, 1)
    occ.synchronize()
    d = 2 if kind == "curve" else 3
    model.addPhysicalGroup(d, [1], name="body")
    of_body = [tag for _, tag in model.getBoundary([(d, 1)], oriented=False)]
    alone = [tag for _, tag in model.getEntities(d - 1) if tag not in of_body]
    model.addPhysicalGroup(d - 1, of_body[:1], name="foot")
    model.addPhysicalGroup(d - 1, alone, name="stray")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)


@pytest.mark.parametrize("kind", ["curve", "curved", "plate"])
def test_what_lies_off_the_body_does_not_end_the_program(kind, gmsh_session, shared_tmp_path):
    if gmsh_session:
        stray(gmsh_session, kind)
    domain = nm.from_gmsh(gmsh_session.model if gmsh_session else None)
    assert list(domain.names) == ["foot"]
    finer = domain.remeshed(0.3)
    assert list(finer.names) == ["foot"]
    path = shared_tmp_path / "body.msh"
    if gmsh_session:
        gmsh_session.write(str(path))
    COMM.barrier()
    assert list(nm.read_mesh(path).names) == ["foot"]


# -- formats of solvers
# ---------------------------------------------------------------------------------


@pytest.mark.serial
@pytest.mark.parametrize("kind", ["triangle", "quad", "tetra", "wedge", "pyramid", "hexahedron"])
@pytest.mark.parametrize("maker", [files.by_ansys, files.by_hecmw, files.by_aster])
def test_nodes_beyond_the_corners_are_amid_all_edges(maker, kind, tmp_path):
    """Also where a cell has collapsed in the slots of a hexahedron."""
    from namedmesh.files.cleaning import edges_of
    from namedmesh.files.reading import kind_of, read

    path = maker(kind, 2)(tmp_path)
    mesh = read(path, kind_of(path), numbered=True)
    blocks = [block for block in mesh.blocks if block.dim == mesh.dim]
    assert len(blocks) == 1
    for block in blocks:
        amid = mesh.points[block.corners[:, edges_of(block.shape)]].mean(axis=2)
        nodes = mesh.points[block.nodes[:, block.corners.shape[1] :]]
        assert nodes.shape == amid.shape
        gaps = np.linalg.norm(nodes[:, :, None] - amid[:, None], axis=3)
        assert gaps.min(axis=1).max() < EXACT
        assert gaps.min(axis=2).max() < EXACT


@pytest.mark.serial
def test_a_node_that_is_missing_amid_an_edge(tmp_path, measures, caplog):
    """ANSYS writes 0 in its place."""
    path = files.by_ansys("hexahedron", 2)(tmp_path)
    text = path.read_text()
    last = text[: text.index("      -1")].rstrip()[-8:]
    path.write_text(text.replace(last, f"{0:8d}"))
    with caplog.at_level(logging.WARNING, logger="namedmesh"):
        domain = nm.read_mesh(path)
    assert "curved" not in caplog.text
    assert measures.region(domain) == pytest.approx(2.0, rel=1e-6)


CONTACT = """/PREP7
ET,1,185
ET,2,170
ET,3,174
ET,4,188
NBLOCK,3
(1i3,3e4.1)
  1
  2 1.0
  3 1.0 1.0
  4 0.0 1.0
  5 0.0 0.0 1.0
  6 1.0 0.0 1.0
  7 1.0 1.0 1.0
  8 0.0 1.0 1.0
N,R5.3,LOC,-1
EBLOCK,19,SOLID
(19i3)
  1  1  1  1  0  0  0  0  8  0  1  1  2  3  4  5  6  7  8
  3  2  5  1  0  0  0  0  4  0  2  1  2  3  4
  3  3  5  1  0  0  0  0  3  0  3  5  6  7
  3  3  5  1  0  0  0  0  3  0  4  5  7  8
  3  2  5  1  0  0  0  0  1  0  5  1
  1  4  1  1  0  0  0  0  2  0  6  1  2
 -1
"""


@pytest.mark.serial
def test_elements_on_the_sides_of_a_contact_of_ansys_are_parts(tmp_path, measures, caplog):
    with caplog.at_level(logging.WARNING, logger="namedmesh"):
        domain = read_text(tmp_path, "contact.cdb", CONTACT)
    assert list(domain.regions) == ["1"]
    assert measures.part(domain, "TARGE170 5") == pytest.approx(1.0, rel=EXACT)
    assert "1 elements of type 188" in caplog.text
    assert "1 elements of type 170" in caplog.text


@pytest.mark.serial
def test_med_is_read_under_any_ending(tmp_path, measures):
    path = CASES["meshio hexahedron, .med"].make(tmp_path).rename(tmp_path / "body.mmed")
    assert measures.part(nm.read_mesh(path), "foot") == pytest.approx(2.0, rel=EXACT)


SETS_OF_DYNA = """$ sets of LS-DYNA
*NODE
       1             0.0             0.0             0.0
       2             1.0             0.0             0.0
       3             1.0             1.0             0.0
       4             0.0             1.0             0.0
       5             0.0             0.0             1.0
       6             1.0             0.0             1.0
       7             1.0             1.0             1.0
       8             0.0             1.0             1.0
       9             0.0             0.0             2.0
      10             1.0             0.0             2.0
      11             1.0             1.0             2.0
      12             0.0             1.0             2.0
*ELEMENT_SOLID
       1       1
       1       2       3       4       5       6       7       8       0       0
       2       2       5       6       7       8       9      10      11      12
*PART
steel

         1
*PART_INERTIA
steel
         2
         0         0
*SET_NODE_LIST_GENERATE
         1
         1         4
*SET_SEGMENT
         1
         9        10        11        12
*SET_SEGMENT_GENERAL
         3
"""


@pytest.mark.serial
def test_sets_and_parts_of_dyna(tmp_path, measures, caplog):
    text = SETS_OF_DYNA.replace("steel\n\n", "steel\n")
    with caplog.at_level(logging.WARNING, logger="namedmesh"):
        domain = read_text(tmp_path, "sets.k", text)
    assert list(domain.regions) == ["steel 1", "steel 2"]
    assert measures.region(domain, "steel 2") == pytest.approx(1.0, rel=EXACT)
    assert measures.part(domain, "node set 1") == pytest.approx(1.0, rel=EXACT)
    assert measures.part(domain, "segment set 1") == pytest.approx(1.0, rel=EXACT)
    assert "*SET_SEGMENT_GENERAL, which is not read" in caplog.text


@pytest.mark.serial
def test_a_displacement_of_exodus_comes_with_its_nodes(tmp_path):
    """VTK reads it, without netCDF4."""
    import pyvista
    from vtkmodules.vtkIOExodus import vtkExodusIIWriter

    from namedmesh.for_solvers import from_file

    x, cells = files.arrays("hexahedron")
    grid = pyvista.UnstructuredGrid({pyvista.CellType.HEXAHEDRON: cells["hexahedron"][0]}, x)
    grid.point_data["disp"] = x @ np.diag([0.1, 0.2, 0.3])
    writer = vtkExodusIIWriter()
    writer.SetFileName(str(tmp_path / "result.e"))
    writer.SetInputData(grid)
    writer.WriteAllTimeStepsOn()
    writer.Write()
    field = from_file(MPI.COMM_SELF, tmp_path / "result.e")
    assert np.allclose(field.values, field.x @ np.diag([0.1, 0.2, 0.3]), atol=EXACT)
