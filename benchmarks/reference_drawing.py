"""Draw rectangles that share sides by gmsh, for benchmarks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

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
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    occ = gmsh.model.occ
    faces = [(2, occ.addRectangle(x, y, 0, width, height)) for _, x, y, width, height in bricks]
    faces += [(0, occ.addPoint(x, y, 0)) for x, y in points]
    if len(faces) > 1:
        occ.fragment(faces[:1], faces[1:])
    occ.synchronize()
    regions: dict[str, list[int]] = {}
    for (region, *_), (_, face) in zip(bricks, faces, strict=False):
        regions.setdefault(region, []).append(face)
    for region, members in regions.items():
        gmsh.model.addPhysicalGroup(2, members, name=region)
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
