"""Details of CAD models that are a thousandth of the body: cells with tiny edges.

- a chamfer or a fillet changes eps little, at both degrees;
- where the iteration does not suffice, a warning says where the edges are.
"""

import logging
import re
from functools import cache

import gmsh
import numpy as np
import pytest

import erc_contact as ec

pytestmark = pytest.mark.serial


@cache
def cube(kind, radius):
    """Mesh a unit cube whose vertical edges have a chamfer, a fillet, or neither."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        body = occ.addBox(0, 0, 0, 1, 1, 1)
        occ.synchronize()
        edges = []
        for _, edge in gmsh.model.getEntities(1):
            corners = np.array(gmsh.model.getBoundingBox(1, edge)).reshape(2, 3)
            if np.ptp(corners, axis=0)[2] > 0.5:
                edges.append(edge)
        if kind == "chamfer":
            sides = [gmsh.model.getAdjacencies(1, edge)[0][0] for edge in edges]
            occ.chamfer([body], edges, sides, [radius])
        elif kind == "fillet":
            occ.fillet([body], edges, [radius])
        occ.synchronize()
        for name, low in (("bottom", True), ("top", False)):
            faces = []
            for _, face in gmsh.model.getEntities(2):
                height = occ.getCenterOfMass(2, face)[2]
                if (height < 1e-6) if low else (height > 1 - 1e-6):
                    faces.append(face)
            gmsh.model.addPhysicalGroup(2, faces, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        return ec.from_gmsh(gmsh.model)
    finally:
        gmsh.finalize()


def relative_error(kind, radius, degree):
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        ec.Displacement("top", (0.0, 0.0, -0.01)),
        contacts=ec.Contact("bottom", friction=0.3),
    )
    solution = ec.solve(scene, cube(kind, radius), degree=degree)
    return ec.constitutive_error(ec.equilibrate(solution)).relative


@pytest.mark.broad
@pytest.mark.parametrize(("degree", "kind"), [(1, "chamfer"), (1, "fillet"), (2, "chamfer")])
def test_a_tiny_detail_changes_eps_little(degree, kind):
    """Edges of 1.4e-3 or less lie beside edges of 0.5."""
    assert relative_error(kind, 1e-3, degree) < 2 * relative_error("sharp", 0.0, degree)


def test_the_place_of_tiny_edges_is_told(caplog):
    """At a chamfer of 1e-5 sigma^ stays poor."""
    with caplog.at_level(logging.WARNING):
        relative_error("chamfer", 1e-5, 1)
    (words,) = [r.message for r in caplog.records if "edges from" in r.message]
    least, x, y = re.search(r"from (\S+) to .* near \((\S+), (\S+),", words).groups()
    assert 0.5e-5 < float(least) < 2e-5
    for coordinate in (x, y):
        assert min(float(coordinate), 1 - float(coordinate)) < 0.3
