"""Meshing the true geometry again.

Names, measures, curved boundaries, counts, sessions, on any number of ranks.

Properties: names, tags and the measures of straight parts survive ten remeshings and
refinements in between; what a curved boundary changes of the area falls like h^4; the
sizes give the number of cells; a session of the user's survives; without a geometry,
the error says what to do.
"""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from test_domain import (
    BOX,
    BOX_SIDES,
    COMM,
    RECTANGLE,
    RECTANGLE_SIDES,
    assert_closed,
    assert_distributed_well,
    close,
    near,
    plate,
)

import namedmesh as nm
from namedmesh import remeshing
from namedmesh.base.releases import cell_nodes
from namedmesh.nodal import count_cells
from namedmesh.size_field import at_corners

MESHES = Path(__file__).parents[2] / "meshes"
BRICKS = {
    "rectangle": (lambda: nm.rectangle(*RECTANGLE, size=0.8), RECTANGLE_SIDES, 14.0),
    "rectangle of cells": (lambda: nm.rectangle(*RECTANGLE, cells=(3, 10)), RECTANGLE_SIDES, 14.0),
    "box": (lambda: nm.box(*BOX, cells=(2, 3, 4)), BOX_SIDES, 6.0),
    "block.geo": (
        lambda: nm.read_mesh(MESHES / "block.geo", scripts=True),
        dict.fromkeys(("left", "right"), 7.0),
        14.0,
    ),
    "dome.geo": (
        lambda: nm.read_mesh(MESHES / "dome.geo", scripts=True),
        {"bottom": 4.0, "left": 2.0, "back": 2.0},
        4.0,
    ),
}


def around(domain, point, low, slope):
    """Sizes that grow with the distance from a point."""
    x = domain.mesh.geometry.x[:, : domain.dim]
    return low + slope * np.linalg.norm(x - point, axis=1)


@pytest.mark.broad
@pytest.mark.on_ranks("box", "block.geo")
@pytest.mark.parametrize("brick", BRICKS)
def test_names_and_measures_survive_ten_remeshings(brick, measures):
    make, sides, volume = BRICKS[brick]
    domain = first = make()
    low, high = (
        domain.mesh.geometry.x.min(axis=0)[: domain.dim],
        domain.mesh.geometry.x.max(axis=0)[: domain.dim],
    )
    low, high = (COMM.bcast(v) for v in (low, high))
    for step in range(10):
        point = low + (high - low) * np.array([0.1 * step, 0.3, 0.9])[: domain.dim]
        before = domain
        domain = domain.remeshed(around(domain, point, 0.12, 0.3))
        assert (domain.names, domain.regions) == (first.names, first.regions)
        for name, area in sides.items():
            assert close(measures.part(domain, name), area)
        assert close(measures.region(domain), volume)
        assert_closed(domain)
        assert_distributed_well(domain)
        if step % 4 == 3:
            domain = domain.refined(near(domain, point, 0.3))
            assert domain.geometry is before.geometry


def test_two_regions_an_interface_and_a_hole(gmsh_session, measures):
    if gmsh_session:
        plate(gmsh_session)
    domain = nm.from_gmsh(gmsh_session.model if gmsh_session else None)
    missing = []
    for size in (0.1, 0.05, 0.025):
        domain = domain.remeshed(size)
        assert set(domain.names) == {"left", "right", "bottom", "top", "hole", "interface"}
        assert close(measures.region(domain, "strip"), 0.6)
        assert close(measures.part(domain, "left"), 1.0)
        missing.append(measures.region(domain, "body") - (1.4 - np.pi / 16))
    assert np.all(np.abs(np.log2(np.array(missing[:-1]) / missing[1:]) - 4) < 0.3), missing
    if gmsh_session:
        assert gmsh_session.model.getCurrent() == "user"
        assert len(gmsh_session.view.getTags()) == 0


CURVED = {
    "half_disc.geo": (np.pi / 2, {"arc": np.pi, "top": 2.0}, 0.2),
    "punch.geo": (20 * 15 - 2 * 9 * (1 - np.pi / 4), {"foot": 14 + 3 * np.pi, "top": 20.0}, 1.0),
    "bracket.geo": (
        2800 + 144 * (1 - np.pi / 4) - 50 * np.pi,
        {"foot": 80.0, "wall": 80.0, "holes": 20 * np.pi},
        5.0,
    ),
}


@pytest.mark.broad
@pytest.mark.on_ranks("half_disc.geo")
@pytest.mark.parametrize("name", CURVED)
def test_curved_boundaries_are_sampled_anew(name, measures):
    """The area of the mesh tends to the area of the true shape like h^4, whether it is made anew or refined."""
    area, sides, size = CURVED[name]
    domain = nm.read_mesh(MESHES / name, scripts=True)
    polygon = measures.region(domain)
    assert abs(measures.region(domain.refined()) - area) < abs(polygon - area) / 8
    errors = []
    for step in range(4):
        domain = domain.remeshed(size / 2**step)
        errors.append(abs(measures.region(domain) - area))
    print(f"\n{name}: area errors {errors}")
    assert np.polyfit(np.arange(4), np.log2(errors), 1)[0] == pytest.approx(-4, abs=0.6)
    for part, length in sides.items():
        assert measures.part(domain, part) == pytest.approx(length, rel=2e-3)


@pytest.mark.broad
def test_ball_in_space(shared_tmp_path, measures):
    path = shared_tmp_path / "ball.geo"
    if COMM.rank == 0:
        path.write_text(
            'SetFactory("OpenCASCADE"); Sphere(1) = {0, 0, 0, 1}; Box(2) = {-1, -1, 0, 2, 2, 2};\n'
            "BooleanIntersection(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };\n"
            'Physical Surface("sphere") = {1}; Physical Surface(7) = {2}; Mesh.MeshSizeMax = 0.5;\n'
        )
    COMM.barrier()
    domain = nm.read_mesh(path, scripts=True)
    errors = []
    for size in (0.4, 0.2, 0.1):
        domain = domain.remeshed(size)
        errors.append(2 * np.pi / 3 - measures.region(domain))
    assert set(domain.names) == {"sphere", "7"}  # a group without a name is called by its number
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 4), errors


@pytest.mark.broad
@pytest.mark.on_ranks("2-0.05")
@pytest.mark.parametrize(("dim", "tolerance"), [(2, 0.05), (3, 0.15)])
def test_number_of_cells_is_that_of_the_sizes(dim, tolerance):
    domain = nm.rectangle(*RECTANGLE, size=0.5) if dim == 2 else nm.box(*BOX, size=0.5)
    corner = np.array((RECTANGLE if dim == 2 else BOX)[1])
    for low, slope in ((0.2, 0.0), (0.05, 0.15), (0.05, 0.25)):
        sizes = around(domain, corner, low, slope)
        assert domain.remeshed(sizes).cells == pytest.approx(
            count_cells(domain, sizes), rel=tolerance
        )


@pytest.mark.serial
def test_coarser():
    domain = nm.rectangle(*RECTANGLE, cells=(20, 70))
    assert domain.remeshed(0.5).cells < domain.cells / 10


def test_mesh_without_geometry():
    shared = nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    bare = nm.Domain(shared.mesh, shared.facet_tags, shared.names)
    for domain in (bare, bare.refined(), nm.read_mesh(MESHES / "block.msh")):
        with pytest.raises(nm.InputError, match=r"geometry .* not known.*Mark\(\).*\.geo"):
            domain.remeshed(0.1)


def test_user_session_keeps_its_options(gmsh_session):
    names = (
        "Mesh.MeshSizeMax",
        "Mesh.MeshSizeExtendFromBoundary",
        "Mesh.Algorithm",
        "Mesh.MeshSizeFactor",
    )
    if gmsh_session:
        gmsh_session.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh_session.option.setNumber("Mesh.Algorithm", 5)
    before = [gmsh_session.option.getNumber(name) for name in names] if gmsh_session else None
    nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)).remeshed(0.2)
    if gmsh_session:
        assert [gmsh_session.option.getNumber(name) for name in names] == before
        assert gmsh_session.model.list() == ["", "user"]


RADIUS, LENGTH = 1.0, 30.0


def rod(gmsh):
    """A rod whose surface is drawn as two halves, as CAD programs do."""
    gmsh.model.add("rod")
    occ = gmsh.model.occ
    low, centre, high = (occ.addPoint(0.0, y, 0.0) for y in (-RADIUS, 0.0, RADIUS))
    arcs = [occ.addCircleArc(low, centre, high), occ.addCircleArc(high, centre, low)]
    disc = occ.addPlaneSurface([occ.addCurveLoop(arcs)])
    occ.extrude([(2, disc)], 0.0, 0.0, LENGTH)
    occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="rod")
    gmsh.model.addPhysicalGroup(2, [disc], name="end")
    others = [tag for _, tag in gmsh.model.getEntities(2) if tag != disc]
    gmsh.model.addPhysicalGroup(2, others, name="others")
    gmsh.option.setNumber("Mesh.MeshSizeMax", RADIUS)
    return nm.from_gmsh(gmsh.model, MPI.COMM_SELF)


@pytest.mark.serial
@pytest.mark.parametrize("size", [1.5, 3.0, 10.0])
def test_sizes_beyond_half_of_a_circle_keep_the_body(size, gmsh_session, measures):
    """Facets from a side of a rod to the opposite side would be its axis."""
    domain = rod(gmsh_session).remeshed(size)
    volume = np.pi * RADIUS**2 * LENGTH
    assert measures.region(domain) == pytest.approx(volume, rel=0.01)
    # Six edges around, as long along the rod, and no more cells than it takes.
    assert domain.cells < 5.5 * volume / (RADIUS * np.pi / 3) ** 3 * 2


@pytest.mark.serial
@pytest.mark.parametrize(("size", "reason"), [(3.0, "no cell of 'rod'"), (10.0, "overlapping")])
def test_what_gmsh_cannot_mesh_is_told_and_leaves_the_session(
    size, reason, gmsh_session, monkeypatch
):
    domain = rod(gmsh_session)
    monkeypatch.setattr(remeshing, "EDGES_OF_CIRCLE", 0)
    with pytest.raises(nm.InputError, match=rf"{reason}.*smaller sizes.*Mark\(\)"):
        domain.remeshed(size)
    gmsh_session.model.mesh.clear()
    gmsh_session.model.mesh.generate(3)
    assert len(gmsh_session.model.mesh.getElements(3)[1]) == 1


def test_cells_beside_other_bodies_are_counted():
    """Facets of two bodies match, so the finer one says how fine the other one is there."""
    lower = nm.box((0.0, 0.0, 0.0), (2.0, 2.0, 1.0), cells=(4, 4, 2))
    upper = nm.box((0.0, 0.0, 1.0), (2.0, 2.0, 2.0), cells=(4, 4, 2))
    domain = nm.assembly({"lower": lower, "upper": upper}).joined("lower top", "upper bottom")
    z = domain.mesh.geometry.x[:, 2]
    is_upper = np.zeros(len(z), dtype=bool)
    is_upper[np.unique(cell_nodes(domain.mesh.geometry)[domain.region("upper")])] = True
    apart = np.where(is_upper, 0.15, 0.6)
    together = np.where(is_upper | (z >= 1.0), 0.15, 0.6)
    assert count_cells(domain, apart) == pytest.approx(count_cells(domain, together))
    assert at_corners(domain, apart).count(COMM) < 0.95 * count_cells(domain, apart)
    made = domain.remeshed(apart).cells
    assert made == pytest.approx(count_cells(domain, apart), rel=0.15)


@pytest.mark.ranks
def test_remeshed_meshes_do_not_depend_on_the_number_of_ranks():
    cells = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        domain = nm.rectangle(*RECTANGLE, size=0.5, comm=comm)
        for step in range(3):
            domain = domain.remeshed(around(domain, (0.5, float(step)), 0.05, 0.2))
        cells.append((domain.cells, domain.vertices))
    assert cells[0][0] == pytest.approx(
        cells[1][0], rel=0.02
    )  # gmsh's search for sizes may end in other triangles
