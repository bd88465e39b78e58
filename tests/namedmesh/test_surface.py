"""Curved bodies, whose true surface is known.

Refinement puts new vertices of curved boundaries, edges and interfaces on the true
surface, on any number of ranks, and turns no cell over. What flat facets cost is in
tests/error/test_curved_bodies.py.
"""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import namedmesh as nm
from namedmesh.base.releases import cell_nodes
from namedmesh.simplex import facet_vertices

COMM = MPI.COMM_WORLD
MESHES = Path(__file__).parents[2] / "meshes"


def from_script(text, folder, name):
    """A domain of a .geo script that all ranks can read."""
    path = folder / f"{name}.geo"
    if COMM.rank == 0:
        path.write_text(text)
    COMM.barrier()
    return nm.read_mesh(path, scripts=True)


BALL = (
    'SetFactory("OpenCASCADE"); Sphere(1) = {0, 0, 0, 1}; Box(2) = {-1, -1, -1, 2, 2, 1};\n'
    "BooleanIntersection(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; }; s() = Surface In BoundingBox "
    "{-2, -2, -2, 2, 2, -1e-3}; e = 1e-3; t() = Surface In BoundingBox {-2, -2, -e, 2, 2, e};\n"
    "b() = Boundary { Volume{3}; }; b() -= {t(), -t()};\n"
    'Physical Surface("sphere") = b(); Physical Surface("top") = t();\n'
    "Mesh.MeshSizeMax = 0.7;\n"
)
INCLUSION = (
    'SetFactory("OpenCASCADE"); Box(1) = {-1, -1, -1, 2, 2, 2}; Sphere(2) = {0, 0, 0, 0.5};\n'
    'BooleanFragments { Volume{1}; Delete; }{ Volume{2}; Delete; } Physical Volume("ball") = {2};\n'
    'Physical Volume("rest") = {3}; s() = Surface In BoundingBox {-2, -2, -1.1, 2, 2, -0.9};\n'
    'Physical Surface("bottom") = s(); Mesh.MeshSizeMax = 1;\n'
)

# Pin, sleeve and plate meet along one circle, and each two of them along a surface that ends there.
PIN_IN_SLEEVE = (
    'SetFactory("OpenCASCADE"); Box(1) = {-2, -2, -1, 4, 4, 1}; Box(2) = {-2, -2, 0, 4, 4, 1};\n'
    "Cylinder(3) = {0, 0, 0, 0, 0, 1, 1};\n"
    "BooleanFragments { Volume{1, 2}; Delete; }{ Volume{3}; Delete; } e = 1e-3;\n"
    "pin() = Volume In BoundingBox {-1 - e, -1 - e, -e, 1 + e, 1 + e, 1 + e};\n"
    "plate() = Volume In BoundingBox {-2 - e, -2 - e, -1 - e, 2 + e, 2 + e, e};\n"
    "sleeve() = Volume{:}; sleeve() -= {pin(), plate()};\n"
    'Physical Volume("pin") = pin(); Physical Volume("plate") = plate();\n'
    'Physical Volume("sleeve") = sleeve();\n'
    "under() = Surface In BoundingBox {-2 - e, -2 - e, -1 - e, 2 + e, 2 + e, -1 + e};\n"
    'Physical Surface("under") = under(); Mesh.MeshSizeMax = 2;\n'
)


def off_surface(domain, part, centre):
    """Greatest distance of the vertices of a part from the circle or sphere of radius 1, over all ranks."""
    sides = domain.facets(part)
    nodes = np.unique(
        cell_nodes(domain.mesh.geometry)[sides[:, :1], facet_vertices(domain.dim)[sides[:, 1]]]
    )
    distance = np.linalg.norm(domain.mesh.geometry.x[nodes] - centre, axis=1) - 1
    return COMM.allreduce(float(abs(distance).max(initial=0.0)), MPI.MAX)


def test_refined_half_disc_is_on_the_circle(measures):
    domain, missing = nm.read_mesh(MESHES / "half_disc.geo", scripts=True), []
    for step in range(4):
        assert off_surface(domain, "arc", (0.0, 1.0, 0.0)) < 1e-12
        missing.append(np.pi / 2 - measures.region(domain))
        low = (
            domain.mesh.geometry.x[cell_nodes(domain.mesh.geometry)[: domain.owned_cells], 1].min(
                axis=1
            )
            < 0.5
        )
        domain = domain.refined(np.flatnonzero(low) if step == 2 else None)
    assert missing[1] / missing[0] == pytest.approx(0.25, rel=0.02)
    assert missing[2] / missing[1] == pytest.approx(0.25, rel=0.01)


@pytest.mark.broad
def test_refined_ball_is_on_sphere_and_rim(shared_tmp_path, measures):
    """The rim lies on sphere and plane: its new vertices go to the common circle."""
    domain = from_script(BALL, shared_tmp_path, "ball")
    missing = []
    for _ in range(3 if COMM.size == 1 else 2):  # one rank tells the rate
        assert off_surface(domain, "sphere", (0.0, 0.0, 0.0)) < 1e-12
        assert COMM.allreduce(float(domain.mesh.geometry.x[:, 2].max()), MPI.MAX) <= 1e-12
        missing.append(2 * np.pi / 3 - measures.region(domain))
        domain = domain.refined()
    if COMM.size == 1:
        assert missing[2] / missing[1] == pytest.approx(0.25, rel=0.15)


@pytest.mark.broad
def test_rim_where_three_surfaces_meet_is_round(shared_tmp_path):
    """New vertices of the foot of a pin go to the circle, as all vertices above them do."""
    bodies = from_script(PIN_IN_SLEEVE, shared_tmp_path, "pin").split(
        {"foot": "pin", "seat": "plate"}
    )
    bodies = bodies.split({"side": "pin", "bore": "sleeve"})
    for _ in range(2):
        bodies = bodies.refined()
        for part in ("side", "bore"):
            sides = bodies.facets(part)
            local = facet_vertices(3)[sides[:, 1]]
            nodes = np.unique(cell_nodes(bodies.mesh.geometry)[sides[:, :1], local])
            x = bodies.mesh.geometry.x[nodes]
            radius = np.linalg.norm(x[:, :2], axis=1)
            assert np.allclose(radius, 1.0, rtol=1e-9)
        at_foot = COMM.allreduce(int((abs(x[:, 2]) < 1e-9).sum()))
        assert at_foot > 0


def test_coarse_inclusion_turns_no_cell_over(shared_tmp_path, measures):
    """The ball in a box has 60 facets.

    Some new vertices of the interface must wait, no cell may be crushed.
    """
    domain = from_script(INCLUSION, shared_tmp_path, "inclusion")
    before = abs(measures.region(domain, "ball") - np.pi / 6)
    for _ in range(2):
        domain = domain.refined()
        assert measures.region(domain) == pytest.approx(
            8.0, rel=1e-12
        )  # cells of negative volume would add to it
    assert abs(measures.region(domain, "ball") - np.pi / 6) < 0.4 * before


PUNCH = (
    'SetFactory("OpenCASCADE"); Point(1) = {0, 0, 0}; Point(2) = {0.7, 0, 0}; Point(3) = {1, 0.3, 0}; Point(4) = '
    "{1, 1, 0}; Point(5) = {0, 1, 0}; Point(6) = {0.7, 0.3, 0}; Line(1) = {1, 2}; Circle(2) = {2, 6, 3}; Line(3) = "
    "{3, 4}; Line(4) = {4, 5}; Line(5) = {5, 1}; Curve Loop(1) = {1 : 5}; Plane Surface(1) = {1};\n"
    'Physical Curve("foot") = {1, 2}; Physical Curve("top") = {4}; Physical Curve("left") = {5};\n'
    "Mesh.MeshSizeMax = 0.4;\n"
)


def test_centre_of_an_arc_is_no_node_of_the_mesh(shared_tmp_path):
    """A sector whose mesh has no inner node.

    The number of the unused centre was above those in use, which aborted.
    """
    script = PUNCH.replace("0.4", "2")
    assert from_script(script, shared_tmp_path, "coarse").remeshed(1.0).cells > 0
