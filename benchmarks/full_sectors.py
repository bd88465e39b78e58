"""Mesh sectors of full discs and cylinders, whose sides meet on the axis."""

from __future__ import annotations

from math import cos, pi, sin

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled
import numpy as np  # isort: skip
from mpi4py import MPI  # isort: skip
from reference_drawing import opened  # isort: skip
from scipy.spatial import cKDTree  # type: ignore[import-untyped]  # isort: skip

import namedmesh as nm
from namedmesh.base.releases import cell_nodes
from namedmesh.partition import distribute

HEIGHT = 0.5
"""Height of a cylinder of the radius 1."""
SAME_PLACE = 1e-7
"""Distance of points of two sectors that are one."""
ON_RIM = 1 - 1e-7
"""Radius of points on the rim."""


def full_sector(d: int, sectors: int, size: float) -> nm.Domain:
    """Mesh a sector of a disc or cylinder, with the parts rim, low and cut.

    For the package it is a polygon, so that finer meshes are of the same body.

    Args:
        d: The dimension.
        sectors: Number of sectors, > 1.
        size: Size of the cells.
    """
    angle = 2 * pi / sectors
    occ = opened(size)
    centre = occ.addPoint(0, 0, 0)
    ends = [occ.addPoint(cos(t), sin(t), 0) for t in (0, angle / 2, angle)]
    low, cut = occ.addLine(centre, ends[0]), occ.addLine(centre, ends[2])
    arcs = [occ.addCircleArc(ends[i], centre, ends[i + 1]) for i in range(2)]
    body = [(2, occ.addPlaneSurface([occ.addCurveLoop([low, *arcs, -cut])]))]
    parts = {"low": [low], "rim": arcs, "cut": [cut]}
    if d == 3:
        made = occ.extrude(body, 0, 0, HEIGHT)
        body = made[1:2]
        first, *rim, last = (tag for _, tag in made[2:])
        parts = {"low": [first], "rim": rim, "cut": [last]}
    occ.synchronize()
    turn = np.eye(4)
    turn[:2, :2] = [[cos(angle), -sin(angle)], [sin(angle), cos(angle)]]
    gmsh.model.mesh.setPeriodic(d - 1, parts["cut"], parts["low"], turn.ravel())
    for name, tags in parts.items():
        gmsh.model.addPhysicalGroup(d - 1, tags, name=name)
    gmsh.model.addPhysicalGroup(d, [tag for _, tag in body], name="body")
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return nm.Domain(domain.mesh, domain.facet_tags, domain.names)


def all_sectors(sector: nm.Domain, sectors: int) -> nm.Domain:
    """Make one mesh of the copies of a sector on one rank, with the part rim.

    Args:
        sector: The sector, about the origin or the z axis.
        sectors: Number of its copies.
    """
    x, cells = sector.mesh.geometry.x, cell_nodes(sector.mesh.geometry)
    points, all_cells = [], []
    for number in range(sectors):
        angle = 2 * pi * number / sectors
        turn = np.array([[cos(angle), sin(angle)], [-sin(angle), cos(angle)]])
        points.append(np.column_stack([x[:, :2] @ turn, x[:, 2:]])[:, : sector.dim])
        all_cells.append(cells + number * len(x))
    places = np.concatenate(points)
    near = cKDTree(places).query_ball_point(places, SAME_PLACE)
    used, number_of = np.unique([min(same) for same in near], return_inverse=True)
    cells_of_all = number_of[np.concatenate(all_cells)].astype(np.int64)
    domain = nm.Domain(distribute(MPI.COMM_SELF, cells_of_all, places[used]))
    return domain.named({"rim": lambda x: np.hypot(x[0], x[1]) > ON_RIM})
