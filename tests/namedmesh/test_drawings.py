"""Drawings of CAD programs: solids are regions with their names, what touches is a pair.

Every file is written by gmsh in the test. Volumes, areas and distances are known from
the drawing; what is left out, nearly touches or is tiny is told; what cannot be meshed
is refused in a sentence on all ranks; nothing that gmsh does ends Python.
"""

import logging
import re

import numpy as np
import pytest
from domains import partly_broad
from mpi4py import MPI

import namedmesh as nm
from namedmesh.base.ranks import from_first
from namedmesh.base.releases import cell_nodes
from namedmesh.drawings import reading
from namedmesh.drawings.opened import different
from namedmesh.simplex import facet_vertices

import gmsh  # isort: skip - after namedmesh, as all that is compiled

COMM = MPI.COMM_WORLD


@pytest.fixture
def folder(tmp_path):
    """The folder of rank 0, on all ranks."""
    return from_first(COMM, tmp_path)


@pytest.fixture
def told(caplog):
    """What is told on rank 0."""
    caplog.set_level(logging.INFO, "namedmesh")
    return lambda: from_first(COMM, caplog.text)


def write(path, draw, names=(), unit=None):
    """Write a drawing on rank 0; ``draw(occ)`` draws, the solids give the names."""
    if COMM.rank == 0:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("drawn")
        draw(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
        gmsh.finalize()
        text = path.read_text(encoding="latin-1")
        for number, name in enumerate(names, start=1):
            part = "" if len(names) == 1 else rf"\.{number}"
            given = rf"'Open CASCADE STEP translator [\d.]+ \d+{part}'"
            assert re.search(given, text)
            text = re.sub(given, f"'{name}'", text)
        if unit:
            text = text.replace("SI_UNIT(.MILLI.,.METRE.)", unit)
        path.write_text(text, encoding="latin-1")
    COMM.barrier()
    return path


def volume(domain, region):
    cells = domain.region(region)
    cells = cells[cells < domain.owned_cells]
    x = domain.mesh.geometry.x[cell_nodes(domain.mesh.geometry)[cells]]
    edges = x[:, 1:] - x[:, :1]
    measure = abs(np.linalg.det(edges[:, :, :3])).sum() / 6 if domain.dim == 3 else 0.0
    return domain.comm.allreduce(float(measure), MPI.SUM)


def middle(domain, name):
    """The middle of the vertices of the facets of a part."""
    sides = domain.owned_facets(name)
    nodes = cell_nodes(domain.mesh.geometry)[sides[:, 0]]
    corners = facet_vertices(domain.dim)[sides[:, 1]]
    x = domain.mesh.geometry.x[np.take_along_axis(nodes, corners, axis=1)].reshape(-1, 3)
    total = domain.comm.allreduce(np.append(x.sum(axis=0), len(x)), MPI.SUM)
    return total[:3] / total[3]


def block_on_base(occ):
    occ.addBox(0, 0, 0, 4, 4, 1)
    occ.addBox(1, 1, 1, 2, 2, 1)


def test_solids_are_regions_and_what_touches_is_a_pair(folder):
    path = write(folder / "two.step", block_on_base, ["base", "nut & <bolt>"])
    bodies = nm.read_mesh(path, size=1.0)
    assert list(bodies.regions) == ["base", "nut & <bolt>"]
    assert abs(volume(bodies, "base") - 16.0) < 1e-12
    assert abs(volume(bodies, "nut & <bolt>") - 4.0) < 1e-12
    (pair,) = bodies.touching()
    assert tuple(pair) == ("base on nut & <bolt>", "nut & <bolt> on base")
    assert pair.regions == ("base", "nut & <bolt>")
    assert abs(pair.area - 4.0) < 1e-12
    assert pair.distance == 0.0
    # five faces of each are free, and the rest of the top of the base
    assert [name for name in bodies.names if name.isdigit()] == [str(n) for n in range(1, 12)]
    # the shape is known: the names survive a new mesh
    again = bodies.remeshed(0.8)
    assert again.names == bodies.names
    assert again.touching()[0].area == pytest.approx(4.0, rel=1e-12)


def test_what_is_told_of_pairs_reads_well(folder):
    bodies = nm.read_mesh(write(folder / "two.step", block_on_base, ["base", "nut"]), size=2.0)
    assert str(bodies.touching()).splitlines() == [
        "part         against      area  distance",
        "base on nut  nut on base     4         0",
    ]
    assert "<td>nut on base</td>" in bodies.touching()._repr_html_()


@pytest.mark.parametrize(
    "kind", ["touch", "distance", "negative", pytest.param("three", marks=pytest.mark.broad)]
)
def test_bad_questions_on_touching_are_told(kind, folder):
    bodies = nm.read_mesh(write(folder / "two.brep", block_on_base), size=2.0)
    call = {
        "touch": lambda: bodies.touching("nut"),
        "distance": lambda: bodies.touching(within="far"),
        "negative": lambda: bodies.touching(within=-1.0),
        "three": lambda: bodies.touching("solid 1", "solid 2", "solid 1"),
    }[kind]
    with pytest.raises(nm.InputError, match=r"^touching: "):
        call()


def test_names_of_several_solids_get_numbers():
    assert different(["nut", "bolt", "nut"], "solid") == ["nut 1", "bolt", "nut 2"]
    assert different(["nut", "nut 1", "nut"], "solid") == ["nut 2", "nut 1", "nut 3"]
    assert different(["", ""], "solid") == ["solid 1", "solid 2"]
    assert different([""], "solid") == ["body"]
    assert different(["bracket"], "solid") == ["bracket"]


@pytest.mark.broad
def test_gaps_of_a_drawing_are_told_listed_and_closed(folder, told):
    def apart(occ):
        occ.addBox(0, 0, 0, 4, 4, 1)
        occ.addBox(1, 1, 1 + 1e-5, 2, 2, 1)

    path = write(folder / "gap.step", apart, ["base", "block"])
    bodies = nm.read_mesh(path, size=1.0)
    assert not bodies.touching()
    assert "1e-05 apart" in told()
    (near,) = bodies.touching(within=1e-4)
    assert near.regions == ("base", "block")
    assert abs(near.distance - 1e-5) < 1e-9
    assert abs(near.area / 4.0 - 1) < 0.3  # the facets of the base do not end at the block
    assert not bodies.touching(within=1e-6)
    joined = bodies.joined(*near, apart=1e-4)
    assert joined.touching()[0].area == pytest.approx(4.0, rel=1e-9)
    closed = nm.read_mesh(path, size=1.0, heal=1e-4)
    assert closed.touching()[0].area == pytest.approx(4.0, rel=1e-3)


def test_solids_that_touch_along_a_line_are_kept_apart(folder, told):
    def wheel(occ):
        occ.addBox(-1, -1, -1, 2, 2, 1)
        occ.addCylinder(0, -0.5, 0.5, 0, 1, 0, 0.5)

    bodies = nm.read_mesh(write(folder / "wheel.step", wheel, ["base", "wheel"]), size=0.5)
    assert "touch along a line only" in told()
    assert bodies.pairs == ()
    for domain in (bodies, bodies.refined(), bodies.remeshed(0.45)):
        ends = [
            set(cell_nodes(domain.mesh.geometry)[domain.region(name)].ravel())
            for name in ("base", "wheel")
        ]
        assert not ends[0] & ends[1]
    assert "pairs" not in repr(bodies)


OVERLAPS = {
    "overlap": (lambda occ: (occ.addBox(0, 0, 0, 1, 1, 1), occ.addBox(0.5, 0, 0, 1, 1, 1)), 0.5),
    "inside": (lambda occ: (occ.addBox(0, 0, 0, 3, 3, 3), occ.addBox(1, 1, 1, 1, 1, 1)), 1),
}


@pytest.mark.parametrize("kind", OVERLAPS)
def test_solids_that_overlap_are_refused_with_the_volume(kind, folder):
    draw, measure = OVERLAPS[kind]
    path = write(folder / "overlap.step", draw, ["left", "right"])
    with pytest.raises(nm.InputError, match=rf"'left' and 'right' the volume {measure:g} at"):
        nm.read_mesh(path, size=1.0)


def test_what_is_no_solid_and_what_is_there_twice_is_left_out(folder, told):
    def mixed(occ):
        occ.addBox(0, 0, 0, 1, 1, 1)
        occ.addBox(0, 0, 0, 1, 1, 1)
        occ.addRectangle(3, 0, 0, 1, 1)
        occ.addLine(occ.addPoint(5, 0, 0), occ.addPoint(6, 0, 0))

    path = write(folder / "mixed.step", mixed, ["first", "second"])
    bodies = nm.read_mesh(path, size=1.0)
    assert list(bodies.regions) == ["first"]
    assert len(bodies.names) == 6
    assert "1 sheet and 1 curve beside the solids left out" in told()
    assert "second left out: at the same place" in told()


UNITS = {
    "mm": ("SI_UNIT(.MILLI.,.METRE.)", "mm"),
    "m": ("SI_UNIT($,.METRE.)", "m"),
    "cm": ("SI_UNIT(.CENTI.,.METRE.)", "cm"),
}


@pytest.mark.parametrize("unit", partly_broad(UNITS, ["m", "cm"]))
def test_lengths_are_in_the_unit_of_the_file(unit, folder, told):
    words, name = UNITS[unit]
    draw = lambda occ: occ.addBox(0, 0, 0, 4, 2, 1)  # noqa: E731
    bodies = nm.read_mesh(write(folder / "box.step", draw, unit=words), size=2.0)
    assert np.allclose(bodies.sides, (4.0, 2.0, 1.0), rtol=1e-12)
    assert f"lengths are in {name}, the unit of the file" in told()


@pytest.mark.parametrize("suffix", ["brep", "step"])
def test_each_kind_of_file_is_read(suffix, folder):
    draw = lambda occ: (occ.addBox(0, 0, 0, 2, 2, 1), occ.addSphere(1, 1, 3, 0.5))  # noqa: E731
    bodies = nm.read_mesh(write(folder / f"two.{suffix}", draw), size=1.0)
    assert list(bodies.regions) == ["solid 1", "solid 2"]
    assert abs(volume(bodies, "solid 1") - 4.0) < 1e-9
    assert 0.75 < volume(bodies, "solid 2") / (np.pi / 6) < 1.0
    assert bodies.curved_facets is not None


def test_faces_of_an_iges_file_become_solids(folder, told):
    """Gmsh writes faces only, as many programs do."""
    draw = lambda occ: (occ.addBox(0, 0, 0, 2, 2, 1), occ.addWedge(0.5, 0.5, 1, 1, 1, 1, ltx=0.5))  # noqa: E731
    bodies = nm.read_mesh(write(folder / "two.igs", draw), size=1.0)
    assert "2 solids made of them" in told()
    assert list(bodies.regions) == ["solid 1", "solid 2"]
    assert abs(volume(bodies, "solid 1") - 4.0) < 1e-9
    assert abs(volume(bodies, "solid 2") - 0.75) < 1e-9
    assert len(bodies.pairs) == 1


GEO = """
lc = 0.5;
Point(1) = {0, 0, 0, lc}; Point(2) = {2, 0, 0, lc}; Point(3) = {2, 1, 0, lc};
Point(4) = {0, 1, 0, lc};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
"""


def test_a_geo_file_without_groups_is_a_drawing(folder):
    path = folder / "plate.geo"
    path.write_text(GEO)
    COMM.barrier()
    plate = nm.read_mesh(path, scripts=True)
    assert list(plate.names) == ["1", "2", "3", "4"]
    assert list(plate.regions) == ["body"]
    finer = nm.read_mesh(path, size=0.1, names={3: "roof"}, scripts=True)
    assert finer.cells > 5 * plate.cells
    assert list(finer.names) == ["1", "2", "roof", "4"]
    assert finer.remeshed(0.5).cells < finer.cells


def test_surfaces_of_a_plane_drawing_are_regions(folder):
    draw = lambda occ: (occ.addRectangle(0, 0, 0, 2, 1), occ.addRectangle(0, 1, 0, 2, 1))  # noqa: E731
    bodies = nm.read_mesh(write(folder / "plane.step", draw), size=0.5)
    assert bodies.dim == 2
    assert list(bodies.regions) == ["surface 1", "surface 2"]
    assert bodies.touching()[0].area == pytest.approx(2.0, rel=1e-12)


@pytest.mark.broad
@pytest.mark.parametrize("kind", ["chamfer", "fillet"])
def test_tiny_faces_are_told_and_removed(kind, folder, told):
    def draw(occ):
        box = occ.addBox(0, 0, 0, 1, 1, 1)
        occ.synchronize()
        edges = gmsh.model.getEntities(1)
        boxes = {e: np.reshape(gmsh.model.getBoundingBox(1, e), (2, 3)) for _, e in edges}
        upright = [e for e, ends in boxes.items() if np.ptp(ends[:, 2]) > 0.5]
        if kind == "chamfer":
            beside = [gmsh.model.getAdjacencies(1, e)[0][0] for e in upright]
            occ.chamfer([box], upright, beside, [1e-3])
        else:
            occ.fillet([box], upright, [1e-3])

    path = write(folder / "tiny.step", draw)
    fine = nm.read_mesh(path, size=0.4)
    assert "4 narrow faces below 0.008" in told()
    assert "defeature=0.00" in told()
    plain = nm.read_mesh(path, size=0.4, defeature=0.01)
    assert "4 faces and 0 edges removed" in told()
    assert len(plain.names) == 6
    assert abs(volume(plain, "body") - 1.0) < 1e-9
    assert plain.cells < fine.cells


BAD = {
    "no size": ({}, "its extent is 6: give read_mesh(..., size=), a length, for instance size=0.6"),
    "negative size": ({"size": -1.0}, "read_mesh: size is -1.0"),
    "size in words": ({"size": "fine"}, "read_mesh: size is 'fine'"),
    "heal": ({"size": 1.0, "heal": -1.0}, "read_mesh: heal is -1.0"),
    "defeature": ({"size": 1.0, "defeature": True}, "read_mesh: defeature is True"),
    "tag": ({"size": 1.0, "names": {99: "foot"}}, "names has 99"),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_arguments_are_told(kind, folder):
    arguments, words = BAD[kind]
    path = write(folder / "two.step", block_on_base)
    with pytest.raises(nm.InputError, match=re.escape(words)):
        nm.read_mesh(path, **arguments)


FILES = {
    "missing.step": (None, "does not exist"),
    "broken.step": ("ISO-10303-21;\nnothing\n", "cannot be used"),
    "broken.brep": ("nothing", "cannot be used"),
    "broken.igs": ("nothing", "cannot be used"),
    "empty.geo": ("", "no solid, and no surface in the plane"),
    "wrong.geo": ("Point(1) = ;", "cannot be used"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_that_hold_nothing_are_told(name, folder):
    text, words = FILES[name]
    if text is not None:
        (folder / name).write_text(text)
    COMM.barrier()
    with pytest.raises(nm.InputError, match=words):
        nm.read_mesh(folder / name, size=1.0, scripts=True)


def test_script_after_a_script_with_an_error(folder):
    """The parser of gmsh keeps the text behind an error, and must not read it in the next script."""
    points = "Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {0, 1, 0}; "
    lines = "Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 1}; "
    surface = 'Curve Loop(1) = {1 : 3}; Plane Surface(1) = {1}; Physical Curve("foot") = {1};\n'
    (folder / "good.geo").write_text(points + lines + surface)
    (folder / "bad.geo").write_text("Line(7) = {1, 2}\n" + points + lines + surface)
    COMM.barrier()
    with pytest.raises(nm.InputError, match="line 2: syntax error"):
        nm.read_mesh(folder / "bad.geo", scripts=True)
    assert list(nm.read_mesh(folder / "good.geo", scripts=True).names) == ["foot"]


def test_sheets_that_enclose_nothing_are_refused(folder):
    draw = lambda occ: (occ.addRectangle(0, 0, 0, 1, 1), occ.addRectangle(0, 0, 1, 1, 1))  # noqa: E731
    with pytest.raises(nm.InputError, match="enclose no solid"):
        nm.read_mesh(write(folder / "sheets.step", draw), size=1.0)


def test_sizes_of_a_mesh_file_are_refused(folder):
    (folder / "some.msh").write_text("$MeshFormat\n")
    with pytest.raises(nm.InputError, match="mesh a drawing"):
        nm.read_mesh(folder / "some.msh", size=1.0)


def test_a_process_that_dies_ends_no_other(folder, monkeypatch):
    """As a fault of gmsh's does."""
    path = write(folder / "two.step", block_on_base)
    monkeypatch.setattr(reading, "START", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    with pytest.raises(nm.InputError, match="gmsh's process ended by signal 11"):
        nm.read_mesh(path, size=1.0)


def test_without_sides_split_makes_pairs_of_all_regions(folder):
    def row(occ):
        for x in range(3):
            occ.addBox(x, 0, 0, 1, 1, 1)

    bodies = nm.read_mesh(write(folder / "row.brep", row), size=1.0)
    glued = bodies.glued
    assert bodies.pairs == (
        ("solid 1 on solid 2", "solid 2 on solid 1"),
        ("solid 2 on solid 3", "solid 3 on solid 2"),
    )
    first = glued.split({"a": "solid 1", "b": "solid 2"})
    assert first.split().pairs == (("a", "b"), ("solid 2 on solid 3", "solid 3 on solid 2"))
    assert bodies.split() is bodies
    plain = nm.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(1, 1, 1))
    assert plain.split() is plain


def test_a_thin_solid_is_no_feature(folder, told):
    """No width is offered that would remove a body."""

    def plates(occ):
        occ.addBox(0, 0, 0, 4, 4, 1)
        occ.addBox(1, 1, 1, 1, 1, 0.004)

    nm.read_mesh(write(folder / "thin.step", plates), size=1.0)
    text = told()
    assert "1 solid thinner than 0.02" in text
    assert "defeature" not in text
