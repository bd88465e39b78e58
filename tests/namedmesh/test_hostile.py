"""Files of others run nothing, write nothing, and read nothing elsewhere.

- A script is read when it is asked for, and never under another ending.
- Options beside a file are not read.
- Files that a file names lie in its folder; they cannot include each other for ever.
- What a file declares and does not have is refused before memory is taken for it.
- Names come in without characters that a terminal obeys.
"""

import contextlib
import logging
import random
import re

import h5py
import meshio
import numpy as np
import pytest

import namedmesh as nm
from namedmesh.base.names import file_stem, in_picture

pytestmark = pytest.mark.serial
SQUARE = """
Point(1) = {0, 0, 0, .5}; Point(2) = {2, 0, 0, .5}; Point(3) = {2, 1, 0, .5}; Point(4) = {0, 1, 0, .5};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Physical Curve("foot", 1) = {1}; Physical Surface("body", 1) = {1};
"""
ACTS = 'SystemCall "touch acted"; Printf("x") > "acted too"; Save "acted.msh";\n'
TETRAHEDRON = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=A\n1,1,2,3,4\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder, in which nothing new may appear."""
    inside = tmp_path / "inside"
    inside.mkdir()
    monkeypatch.chdir(inside)
    return inside


def refused(path, words, **arguments):
    """A file is refused with words, and nothing is written by it."""
    before = set(path.parent.parent.rglob("*"))
    with pytest.raises(nm.InputError, match=words):
        nm.read_mesh(path, **arguments)
    assert set(path.parent.parent.rglob("*")) == before


@pytest.mark.parametrize(
    "ending", [".geo", ".geo_unrolled", ".msh", ".GEO", ".xao", ".step", ".ir3", ".opt", ".inp", ""]
)
def test_a_script_runs_under_no_ending(ending, folder):
    path = folder / f"script{ending}"
    path.write_text(f"//\n{ACTS}{SQUARE}")
    refused(path, "script|another format|does not begin so|size=", size=0.5)


def test_a_script_in_a_mesh_is_not_read(folder):
    path = folder / "body.msh"
    nodes = "$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n"
    cells = "$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n"
    path.write_text(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{nodes}{cells}{ACTS}")
    (folder / "body.msh.opt").write_text(ACTS)
    assert nm.read_mesh(path).cells == 1
    assert {file.name for file in folder.iterdir()} == {"body.msh", "body.msh.opt"}


def test_a_script_that_is_asked_for_is_read_without_options_beside_it(folder):
    path = folder / "square.geo"
    path.write_text(SQUARE)
    (folder / "square.geo.opt").write_text(ACTS)
    assert list(nm.read_mesh(path, scripts=True).names) == ["foot"]
    assert {file.name for file in folder.iterdir()} == {"square.geo", "square.geo.opt"}


# -- files that name files
# ---------------------------------------------------------------------------------


def test_includes_without_end(folder):
    (folder / "itself.inp").write_text("*INCLUDE, INPUT=itself.inp\n")
    refused(folder / "itself.inp", "without end")
    for number in range(15):
        twice = f"*INCLUDE, INPUT={number + 1}.inp\n" * 2
        (folder / f"{number}.inp").write_text(twice)
    (folder / "15.inp").write_text("** a leaf of a tree\n")
    refused(folder / "0.inp", "more than 1000 files")
    for number in range(15):
        twice = f"*KEYWORD\n*INCLUDE\n{number + 1}.k\n{number + 1}.k\n"
        (folder / f"{number}.k").write_text(twice)
    (folder / "15.k").write_text("*KEYWORD\n")
    refused(folder / "0.k", "more than 1000 files")


@pytest.mark.parametrize("name", ["../outside.inp", "{folder}/outside.inp", "link.inp"])
def test_includes_that_leave_the_folder(name, folder):
    outside = folder.parent / "outside.inp"
    outside.write_text(TETRAHEDRON)
    (folder / "link.inp").symlink_to(outside)
    path = folder / "deck.inp"
    for card in ("*INCLUDE, INPUT=", "*NODE, INPUT="):
        path.write_text(f"{card}{name.format(folder=folder.parent)}\n")
        refused(path, "not in the folder")


def test_pieces_and_numbers_that_leave_the_folder(folder):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    mesh = meshio.Mesh(points, [("triangle", [[0, 1, 2]])])
    mesh.write(folder.parent / "piece.vtu")
    path = folder / "whole.pvtu"
    head = '<VTKFile type="PUnstructuredGrid" version="0.1"><PUnstructuredGrid>'
    path.write_text(f'{head}<Piece Source="../piece.vtu"/></PUnstructuredGrid></VTKFile>')
    refused(path, "not in the folder")
    mesh.write(folder.parent / "mesh.xdmf")
    text = (folder.parent / "mesh.xdmf").read_text()
    path = folder / "mesh.xdmf"
    path.write_text(text.replace("mesh.h5", "../mesh.h5"))
    refused(path, "not in the folder")


# -- more than there is
# ---------------------------------------------------------------------------------


def bomb(file):
    """A table of a terabyte in a file without its numbers."""
    file.create_dataset("ENS_MAA/mesh/NOE/COO", (125, 10**9), "f8", chunks=(1, 10**6))


def elsewhere(file):
    """A link to another file."""
    file["ENS_MAA"] = h5py.ExternalLink("/etc/passwd", "/")


def raw(file):
    """Numbers that are the bytes of another file."""
    group = file.create_group("ENS_MAA")
    group.create_dataset("COO", (10,), "u1", external=[("/etc/passwd", 0, 10)])


@pytest.mark.parametrize(
    ("make", "words"),
    [(bomb, "made to fill"), (elsewhere, "in another file"), (raw, "lie in other files")],
)
@pytest.mark.parametrize("ending", [".med", ".vtkhdf"])
def test_tables_that_are_not_in_their_file(make, words, ending, folder):
    path = folder / f"body{ending}"
    with h5py.File(path, "w") as file:
        make(file)
    refused(path, words)


TETRAHEDRON_OF_ANSYS = (
    "/PREP7\nET,1,285\nNBLOCK,3\n(1i9,3e4.1)\n        1\n        2 1.0\n        3 0.0 1.0\n"
    "        4 0.0 0.0 1.0\n-1\nEBLOCK,19,SOLID\n(19i3)\n  1  1  1  1  0  0  0  0  4  0  1  1  2  3  4\n -1\n"
)
DECLARED = {
    "range.cdb": f"{TETRAHEDRON_OF_ANSYS}CMBLOCK,N,NODE,2\n(8i16)\n{1:16d}{-(10**14):16d}\n",
    "range.k": "*KEYWORD\n*NODE\n1,0.,0.,0.\n2,1.,0.,0.\n3,0.,1.,0.\n4,0.,0.,1.\n"
    "*ELEMENT_SOLID\n1,1,1,2,3,4,4,4,4,4\n*SET_NODE_LIST_GENERATE\n1\n1,99999999999999\n",
    "range.inp": f"{TETRAHEDRON}*NSET, NSET=N, GENERATE\n1,999999999999999,1\n",
    "numbers.mdpa": "Begin Nodes\n1 0 0 0\n2 1 0 0\n3 0 1 0\n999999999999999 0 0 1\nEnd Nodes\n"
    "Begin Elements Element3D4N\n1 0 1 2 3 999999999999999\nEnd Elements\n",
}


@pytest.mark.parametrize("name", DECLARED)
def test_numbers_that_are_far_from_each_other(name, folder):
    (folder / name).write_text(DECLARED[name])
    assert nm.read_mesh(folder / name).cells == 1


def test_an_element_of_xdmf_without_points(folder):
    path = folder / "mesh.xdmf"
    path.write_text(
        '<Xdmf><Domain><Grid><Geometry GeometryType="XYZ"><DataItem Dimensions="3 3">'
        "0 0 0 1 0 0 0 1 0</DataItem></Geometry>"
        '<Topology TopologyType="Mixed" NumberOfElements="1"><DataItem NumberType="Int">'
        "1 -2 4 0 1 2</DataItem></Topology></Grid></Domain></Xdmf>"
    )
    refused(path, "an element of -2 points")


def test_a_cell_of_getfem_of_a_degree_that_nobody_has(folder):
    path = folder / "cell.mesh"
    convex = "CONVEX 0 'GT_PK(3,9999)' 0 1 2 3"
    points = "POINT 0 0 0 0\nPOINT 1 1 0 0\nPOINT 2 0 1 0\nPOINT 3 0 0 1\n"
    path.write_text(f"% GETFEM MESH FILE\nBEGIN POINTS LIST\n{points}END POINTS LIST\n{convex}\n")
    refused(path, "no cells of a solid")


MESHES = {
    "deck.inp": TETRAHEDRON,
    "archive.cdb": DECLARED["range.cdb"],
    "deck.k": DECLARED["range.k"],
    "mesh.mail": "COOR_2D\nA 0. 0.\nB 1. 0.\nC 0. 1.\nFINSF\nTRIA3\nV A B C\nFINSF\nFIN\n",
    "mesh.msh": "!NODE\n1, 0\n2, 1\n3, 0, 1\n!ELEMENT, TYPE=231\n1, 1, 2, 3\n!SGROUP, SGRP=S\n1, 1\n!END\n",
    "model.mdpa": DECLARED["numbers.mdpa"],
    "grid.xdmf": '<Xdmf><Domain><Grid><Geometry GeometryType="XYZ"><DataItem Dimensions="3 3">'
    "0 0 0 1 0 0 0 1 0</DataItem></Geometry>"
    '<Topology TopologyType="Triangle" NumberOfElements="1"><DataItem NumberType="Int">'
    "0 1 2</DataItem></Topology></Grid></Domain></Xdmf>",
    "getfem.mesh": "% GETFEM MESH FILE\nBEGIN POINTS LIST\nPOINT 0 0 0\nPOINT 1 1 0\nPOINT 2 0 1\n"
    "END POINTS LIST\nBEGIN MESH STRUCTURE DESCRIPTION\nCONVEX 0 'GT_PK(2,1)' 0 1 2\nEND\n",
    "mfem.mesh": "MFEM mesh v1.0\ndimension\n2\nelements\n1\n1 2 0 1 2\nboundary\n0\n"
    "vertices\n3\n2\n0 0\n1 0\n0 1\n",
    "gid.mesh": 'MESH "a" dimension 2 ElemType Triangle Nnode 3\nCoordinates\n1 0 0\n2 1 0\n3 0 1\n'
    "End Coordinates\nElements\n1 1 2 3\nEnd Elements\n",
}  # fmt: skip


@pytest.mark.broad
@pytest.mark.parametrize("name", MESHES)
def test_changes_at_random_are_domains_or_refused(name, folder):
    """Each of 60 changes of numbers, letters, lines or the end; nothing else is raised, nothing written."""
    rng = random.Random(name)
    numbers = ("-1", "99999999999999999999", "nan", "1e308", "x", "")
    path = folder / name
    path.write_text(MESHES[name])
    nm.read_mesh(path)
    for _ in range(60):
        text = MESHES[name]
        place = rng.randrange(len(text))
        kind = rng.randrange(4)
        if kind == 0:
            match = rng.choice(list(re.finditer(r"\d+", text)))
            text = text[: match.start()] + rng.choice(numbers) + text[match.end() :]
        elif kind == 1:
            text = text[:place] + rng.choice("\0*$<{ é") + text[place + 1 :]
        elif kind == 2:
            text = text[:place]
        else:
            lines = text.splitlines()
            rng.shuffle(lines)
            text = "\n".join(lines)
        path.write_text(text)
        with contextlib.suppress(nm.InputError):
            nm.read_mesh(path)
    assert [file.name for file in folder.iterdir()] == [name]


# -- names
# ---------------------------------------------------------------------------------

NAMES = [
    "x/../../../up",
    "..",
    "",
    "a" * 300,
    "b\0c",
    "$(touch acted)",
    "rm -rf *",
    "-rf",
    "\x1b[2J",
    "Ä",
    "a b",
    "a-b",
    "a-b-7d6fd7ae",
    "$\\frac{",
]


def test_names_of_files_are_plain_and_different():
    stems = [file_stem(name) for name in NAMES]
    assert len(set(stems)) == len(NAMES)
    for stem in stems:
        assert set(stem) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")
        assert 0 < len(stem) < 80
    assert file_stem("left foot_2") != file_stem("left-foot_2") == "left-foot_2"
    assert in_picture("$x$") == "\\$x\\$"
    assert len(in_picture("a" * 10**6)) == 60


def test_a_name_that_no_file_can_have_is_refused():
    block = nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1))
    with pytest.raises(nm.InputError, match="can be written to a file"):
        nm.Domain(block.mesh, block.facet_tags, {"\ud800": 1})


def test_names_of_a_file_are_in_one_line(folder, caplog):
    path = folder / "named.inp"
    path.write_bytes(TETRAHEDRON.replace("ELSET=A", "ELSET=A\x1b[2J\0B").encode())
    with caplog.at_level(logging.WARNING):
        assert list(nm.read_mesh(path).regions) == ["A?[2J?B"]
    assert "A?[2J?B" in caplog.text
    assert "\x1b" not in caplog.text
