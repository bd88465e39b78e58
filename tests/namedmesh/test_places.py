"""Bodies of files are where the file puts them, and what is not as in the file is told.

- Nodes in the coordinate systems of Abaqus and Nastran; what cannot be moved is refused.
- A file is read by what it holds, whatever its ending.
- Warped sides, sets of the whole boundary and sets that serve surfaces are told.
- A clearance that a message calls enough is enough; a rule finds the facets that are near.
"""

import logging
import re

import numpy as np
import pytest

import namedmesh as nm

pytestmark = pytest.mark.serial
CUBE = "1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n"
HEXAHEDRON = "*ELEMENT,TYPE=C3D8,ELSET=E\n1,1,2,3,4,5,6,7,8\n"
SECTOR = (
    "*NODE,SYSTEM=C\n1,1,0,0\n2,2,0,0\n3,2,90,0\n4,1,90,0\n5,1,0,1\n6,2,0,1\n7,2,90,1\n8,1,90,1\n"
)
EXACT = 1e-12
"""Round-off, relative to the size."""


def read(folder, name, text, **arguments):
    path = folder / name
    path.write_text(text)
    return nm.read_mesh(path, **arguments)


def box(domain):
    """Least and greatest coordinates."""
    x = domain.mesh.geometry.x
    return np.concatenate([x.min(axis=0), x.max(axis=0)])


# -- coordinate systems
# ---------------------------------------------------------------------------------

SYSTEMS = {
    "moved": ("*SYSTEM\n10,20,30\n", (10, 20, 30, 11, 21, 31)),
    "turned about z": ("*SYSTEM\n10,0,0,10,1,5\n", (9, 0, 0, 10, 1, 1)),
    "of three points": ("*SYSTEM\n10,0,0,10,0,1\n10,1,0\n", (9, 0, 0, 10, 1, 1)),
    "ended": ("*SYSTEM\n10,20,30\n*SYSTEM\n", (0, 0, 0, 1, 1, 1)),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_nodes_of_abaqus_in_a_system_of_their_own(name, tmp_path, measures):
    card, expected = SYSTEMS[name]
    domain = read(tmp_path, "cube.inp", f"{card}*NODE\n{CUBE}{HEXAHEDRON}")
    assert box(domain) == pytest.approx(expected, abs=30 * EXACT)
    assert measures.region(domain) == pytest.approx(1.0, rel=EXACT)


def test_nodes_of_abaqus_in_cylindrical_coordinates(tmp_path, measures):
    domain = read(tmp_path, "sector.inp", SECTOR + HEXAHEDRON)
    assert measures.region(domain) == pytest.approx(1.5, rel=EXACT)
    moved = read(tmp_path, "moved.inp", f"*SYSTEM\n0,0,5\n{SECTOR}{HEXAHEDRON}")
    assert box(moved) - box(domain) == pytest.approx([0, 0, 5, 0, 0, 5], abs=5 * EXACT)


def test_numbers_of_nodes_with_an_offset(tmp_path, measures):
    nodes = re.sub(r"(?m)^(\d)", r"10\1", CUBE)
    elements = HEXAHEDRON.replace("ELSET=E", "ELSET=E,OFFSET=100")
    domain = read(tmp_path, "offset.inp", f"*NODE\n{nodes}{elements}")
    assert measures.region(domain) == pytest.approx(1.0, rel=EXACT)


REFUSED = {
    "sphere.inp": (f"*NODE,SYSTEM=S\n{CUBE}{HEXAHEDRON}", "SYSTEM=S, and R and C are read"),
    "line.inp": (f"*SYSTEM\n0,0,0,1,0,0\n2,0,0\n*NODE\n{CUBE}{HEXAHEDRON}", "points in a line"),
    "symmetric.inp": (f"*NODE\n{CUBE}*SYMMETRIC MODEL GENERATION\n", "computes its mesh"),
    "none.bdf": ("BEGIN BULK\nGRID,1,7,0.,0.,0.\nENDDATA\n", "system 7.*is not in the file"),
    "other.bdf": (
        "BEGIN BULK\nCORD3G,7,1,2,3\nGRID,1,7,0.,0.,0.\nENDDATA\n",
        "system 7.*CORD3G, which is not read",
    ),
    "circle.bdf": (
        "BEGIN BULK\nCORD2R,7,7,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nGRID,1,7,0.,0.,0.\nENDDATA\n",
        "system 7.*is not in the file",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_nodes_that_cannot_be_moved_are_refused(name, tmp_path):
    text, words = REFUSED[name]
    with pytest.raises(nm.InputError, match=words):
        read(tmp_path, name, text)


PLACES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, 0.4, 1.2]])
CORD2 = "10.,0.,0.,10.,0.,1.\n,11.,0.,0.\n"
SHIFTED = PLACES - (10.0, 0.0, 0.0)
R, THETA = np.hypot(*SHIFTED[:, :2].T), np.degrees(np.arctan2(*SHIFTED[:, 1::-1].T))
RADIUS = np.linalg.norm(SHIFTED, axis=1)
FROM_AXIS = np.degrees(np.arccos(SHIFTED[:, 2] / RADIUS))
NASTRAN = {
    "CORD2R": (f"CORD2R,5,,{CORD2}", SHIFTED),
    "CORD2C": (f"CORD2C,5,,{CORD2}", np.column_stack([R, THETA, SHIFTED[:, 2]])),
    "CORD2S": (f"CORD2S,5,,{CORD2}", np.column_stack([RADIUS, FROM_AXIS, THETA])),
    "a system in a system": (
        "CORD2R,5,6,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n" + f"CORD2R,6,,{CORD2}",
        SHIFTED,
    ),
    "CORD1R": (
        "CORD1R,5,91,92,93\nGRID,91,,10.,0.,0.\nGRID,92,,10.,0.,1.\nGRID,93,,11.,0.,0.\n",
        SHIFTED,
    ),
}


def grids(x, form):
    """Cards of nodes in the system 5, as Nastran writes them in a form."""
    lines = []
    for number, (a, b, c) in enumerate(x, start=1):
        if form == "free":
            lines.append(f"GRID,{number},5,{a!r},{b!r},{c!r}")
        else:
            lines.append(f"GRID*   {number:16d}{5:16d}{a:16.9e}{b:16.9e}*A\n*A      {c:16.9e}")
    return "\n".join(lines)


@pytest.mark.parametrize("form", ["free", "large"])
@pytest.mark.parametrize("name", NASTRAN)
def test_nodes_of_nastran_in_systems_of_the_deck(name, form, tmp_path):
    cards, x = NASTRAN[name]
    deck = f"SOL 101\nCEND\nBEGIN BULK\n$ a comment\n{cards}{grids(x.tolist(), form)}\nCTETRA,1,1,1,2,3,4\nENDDATA\n"
    domain = read(tmp_path, "deck.bdf", deck)
    assert np.sort(domain.mesh.geometry.x, axis=0) == pytest.approx(
        np.sort(PLACES, axis=0), abs=1e-7
    )


def test_the_system_of_all_nodes_of_nastran(tmp_path):
    fixed = "".join(f"GRID    {n:8d}        {x:8.1f}{y:8.1f}{z:8.1f}\n" for n, x, y, z in [
        (1, 0, 0, 0), (2, 1, 0, 0), (3, 0, 1, 0), (4, 0, 0, 1)])  # fmt: skip
    deck = f"BEGIN BULK\nGRDSET,,5\nCORD2R,5,,{CORD2}{fixed}CTETRA,1,1,1,2,3,4\nENDDATA\n"
    assert box(read(tmp_path, "deck.nas", deck)) == pytest.approx([10, 0, 0, 11, 1, 1])


# -- formats by content
# ---------------------------------------------------------------------------------

MSH = (
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
    "$Elements\n1\n1 4 2 1 1 1 2 3 4\n$EndElements\n"
)
BULK = "BEGIN BULK\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\n"
TEXTS = {
    "gmsh.mesh": MSH,
    "gmsh.geo2": f"\n\n{MSH}",
    "nastran.dat": f"$ comment\n{BULK}CTETRA,1,1,1,2,3,4\nENDDATA\n",
    "avs.ucd": "4 1 0 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n1 1 tet 1 2 3 4\n",
    "deck.txt": "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=E\n1,1,2,3,4\n",
    "nodes_twice.mdpa": "Begin Nodes // a\n1 0 0 0\n2 1 0 0\nEnd Nodes\nBegin Nodes\n3 0 1 0\n4 0 0 1\n"
    "End Nodes\nBegin Elements Element3D4N\n1 0 1 2 3 4\nEnd Elements\n",
    "beam.inp": "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=E\n1,1,2,3,4\n"
    "*ELEMENT,TYPE=B32,ELSET=B\n2,2,4\n",
    "mesh.inc": "*NODE\n$ a comment\n       1             0.0             0.0\n       2             1.0\n"
    "       3             0.0             1.0\n       4             0.0             0.0             1.0\n"
    "*ELEMENT_SOLID\n       1       1       1       2       3       4       4       4       4       4\n",
    "archive.txt": "*IF,_CDRDOFF,EQ,1,THEN\n*ENDIF\nET,1,285\nNBLOCK,3\n(1i9,3e20.9e3)\n        4"
    "     0.000000000E+00     0.000000000E+00     1.000000000E+00\n        1\n        2"
    "     1.000000000E+00\n        3     0.000000000E+00     1.000000000E+00\n-1\nEBLOCK,19,SOLID\n"
    "(19i3)\n  1  1  1  1  0  0  0  0  4  0  1  1  2  3  4\n -1\n",
    "aster.txt": "% a comment\nCOOR_3D\nA 0. 0. 0.\nB 1. 0. 0.\nC 0. 1. 0.\nD 0. 0. 1.\nFINSF\nTETRA4\n"
    "V = A B C D\nFINSF\nFIN\n",
    "hecmw.txt": "!! a comment\n!NODE\n1, 0\n2, 1\n3, 0, 1\n4, 0, 0, 1\n!ELEMENT, TYPE=341\n1, 1, 2, 3, 4\n!END\n",
}


@pytest.mark.parametrize("name", TEXTS)
def test_a_file_is_read_by_what_it_holds(name, tmp_path, measures):
    assert measures.region(read(tmp_path, name, TEXTS[name])) == pytest.approx(1 / 6, rel=EXACT)


UNKNOWN = {
    "parameter.k": ("*KEYWORD\n*NODE\n       1            &x_1\n", "the parameter '&x_1'"),
    "moved.k": ("*KEYWORD\n*INCLUDE_TRANSFORM\nmesh.k\n", "moves nodes by .INCLUDE_TRANSFORM"),
    "no_nodes.k": ("*KEYWORD\n*END\n", "no .NODE"),
    "no_nodes.cdb": ("/COM,ANSYS RELEASE 19\n", "no block of nodes"),
    "no_format.cdb": ("/PREP7\nNBLOCK,3\n", "line 3 is no format"),
    "short.cdb": (
        "/PREP7\nET,1,285\nEBLOCK,19,SOLID\n(19i3)\n  1  1  1  1  0  0  0  0  4  0  9  1  2\n",
        "element 9 has 2 nodes of 4",
    ),
    "no_nodes.msh": ("!HEADER\n!END\n", "no .NODE"),
    "sides.msh": ("!NODE\n1, 0\n!SGROUP, SGRP=S\n1, 2, 3\n", "group of sides 'S'.*3 numbers"),
    "no_nodes.mail": ("TITRE\nFINSF\nFIN\n", "no points"),
    "row.mail": ("COOR_3D\nN1 0 0\nFINSF\n", "below COOR_3D are 3 words"),
    "pointer.mmed": ("version https://git-lfs.github.com/spec/v1\n", "pointer of Git LFS"),
    "none.xyz": ("1 2 3\n", "tells a format of meshes"),
    "broken.avs": ("4 1 0 0 0\n1 0 0 0\n2 1", "does not know|not read"),
}


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_is_not_read_is_told_in_our_words(name, tmp_path):
    text, words = UNKNOWN[name]
    with pytest.raises(nm.InputError, match=words) as told:
        read(tmp_path, name, text)
    assert not re.search(r"Error|unpack|index|codec", str(told.value))


# -- what is told
# ---------------------------------------------------------------------------------


def test_the_volume_that_warped_sides_change_is_told(tmp_path, measures, caplog):
    """The trilinear map of the corners has the volume 1.125."""
    text = f"*NODE\n{CUBE}{HEXAHEDRON}"
    with caplog.at_level(logging.WARNING):
        read(tmp_path, "cube.inp", text)
        assert "warped" not in caplog.text
        domain = read(tmp_path, "warped.inp", text.replace("7,1,1,1\n", "7,1,1,1.5\n"))
    change = float(re.search(r"the volume by ([-+][\d.]+)%", caplog.text)[1]) / 100
    assert measures.region(domain) / 1.125 - 1 == pytest.approx(change, abs=1e-4)


def test_sets_that_are_no_parts_or_regions_are_told(tmp_path, caplog):
    surfaces = (
        "*ELSET,ELSET=Lower\n1\n*SURFACE,NAME=foot\nLower,S1\n*NSET,NSET=whole,GENERATE\n1,8\n"
    )
    with caplog.at_level(logging.WARNING):
        domain = read(tmp_path, "cube.inp", f"*NODE\n{CUBE}{HEXAHEDRON}{surfaces}")
    assert list(domain.names) == ["foot"]
    assert "sets of the whole boundary are no parts: 'whole'" in caplog.text
    assert "sets of elements that surfaces have are no regions: 'Lower'" in caplog.text


def ball_on_block(gmsh_session):
    """A ball 0.02 above a block, with parts that are whole sides."""
    occ = gmsh_session.model.occ
    occ.addBox(-2, -2, -1, 4, 4, 1)
    occ.addSphere(0, 0, 1.02, 1.0)
    occ.synchronize()
    gmsh_session.option.setNumber("Mesh.MeshSizeMax", 0.5)
    parts = {"top": nm.where(z=0.0), "ball": nm.where(lambda x: x[2] > 0.01)}
    regions = {"block": lambda x: x[2] <= 0.001, "sphere": lambda x: x[2] >= 0.01}
    return nm.from_gmsh(gmsh_session.model, parts=parts, regions=regions)


def test_sides_that_face_away_are_told_with_a_way(gmsh_session):
    """No clearance makes the upper half of a ball face the block; a rule finds the lower facets."""
    bodies = ball_on_block(gmsh_session)
    with pytest.raises(nm.InputError, match=r"do not face each other everywhere.*within"):
        bodies.joined("ball", "top", apart=0.1)
    (near,) = bodies.touching(within=0.2)
    named = bodies.named({"under": nm.where(region="sphere", against="block", within=0.2)})
    assert near.facets == "top"
    table = named.parts()
    areas = dict(zip(table["name"], table["area"], strict=True))
    assert areas["under"] == pytest.approx(near.area, rel=0.5)


@pytest.mark.parametrize("distance", [0.0, -1.0, True, "near"])
def test_a_distance_of_a_rule_that_is_none(distance):
    with pytest.raises(nm.InputError, match="where: within"):
        nm.where(against="block", within=distance)


def test_a_distance_of_a_rule_needs_a_region():
    with pytest.raises(nm.InputError, match="give against="):
        nm.where(y=0.0, within=0.1)
