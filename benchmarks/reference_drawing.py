"""Draw rectangles that share sides, and parts of discs, by gmsh, for benchmarks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled
import numpy as np  # isort: skip

NEAR = 1e-3
"""Distance from a box within which a curve lies in it [length]."""

Brick = tuple[str, float, float, float, float]
"""Type of a rectangle: its region, lower left corner, width and height."""
Box = tuple[float, float, float, float]
"""Type of the box around a boundary part: least x and y, greatest x and y."""


def drawn(
    bricks: Sequence[Brick],
    parts: Mapping[str, Box],
    size: float,
    points: Sequence[tuple[float, float]] = (),
) -> ec.Domain:
    """Mesh rectangles in one piece; a part is all curves in its box.

    The points split the curves that they lie on.
    """
    occ = opened(size)
    faces = [(2, occ.addRectangle(x, y, 0, width, height)) for _, x, y, width, height in bricks]
    faces += [(0, occ.addPoint(x, y, 0)) for x, y in points]
    if len(faces) > 1:
        occ.fragment(faces[:1], faces[1:])
    occ.synchronize()
    regions: dict[str, list[int]] = {}
    for (region, *_), (_, face) in zip(bricks, faces, strict=False):
        regions.setdefault(region, []).append(face)
    return meshed(regions, parts)


def opened(size: float) -> Any:
    """Open a model of gmsh for cells of this size, and return its geometry."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    return gmsh.model.occ


def meshed(regions: Mapping[str, Sequence[int]], parts: Mapping[str, Box]) -> ec.Domain:
    """Mesh the open model with regions, by their faces, and parts; close it."""
    for region, faces in regions.items():
        gmsh.model.addPhysicalGroup(2, faces, name=region)
    for name, box in parts.items():
        add_part(name, box)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain


def add_part(name: str, box: Box) -> None:
    """Make a boundary part of all curves in a box of the current model."""
    left, low, right, high = box
    corners = (left - NEAR, low - NEAR, -NEAR, right + NEAR, high + NEAR, NEAR)
    curves = gmsh.model.getEntitiesInBoundingBox(*corners, dim=1)
    gmsh.model.addPhysicalGroup(1, [curve for _, curve in curves], name=name)


def part_of_disc(radii: Mapping[str, float], size: float, parts: Mapping[str, Box]) -> ec.Domain:
    """Mesh a quarter of a disc or of a ring; its arcs have the names of the radii."""
    occ = opened(size)
    largest = max(radii.values())
    square = [(2, occ.addRectangle(0, 0, 0, largest, largest))]
    quarter = square
    for radius in sorted(radii.values(), reverse=True):
        disc = [(2, occ.addDisk(0, 0, 0, radius, radius))]
        cut = occ.intersect if radius == largest else occ.cut
        quarter, _ = cut(quarter, disc)
    occ.synchronize()
    for name, radius in radii.items():
        arcs = []
        for curve in gmsh.model.getEntities(1):
            if abs(occ.getMass(*curve) - np.pi * radius / 2) < 1e-6:
                arcs.append(curve[1])
        gmsh.model.addPhysicalGroup(1, arcs, name=name)
    return meshed({"body": [face for _, face in quarter]}, parts)
