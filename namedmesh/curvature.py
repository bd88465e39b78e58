"""Keep the edges of gmsh's meshes short beside the radii of curves and surfaces."""

from __future__ import annotations

from typing import Any

SMALLEST = 1 / 10
"""Least edge that curvature asks for, over the greatest size of cells [-].

A fillet of a thousandth of the size would get millions of cells.
"""


def follow_curves(gmsh: Any, edges: int, least: float, greatest: float) -> None:
    """Let gmsh make edges so short that they follow curves and curved surfaces.

    Long edges do not only miss the shape: facets that go straight from a line of a
    cylinder to the opposite line are the same for both halves of its surface, and the
    cylinder has no cells then.

    Args:
        gmsh: The module.
        edges: Least number of edges along a circle, and around a curved surface.
        least: Least size that is wanted elsewhere [length].
        greatest: Greatest size that is wanted [length].
    """
    gmsh.option.setNumber("Mesh.MeshSizeMin", min(least, SMALLEST * greatest))
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", edges)
