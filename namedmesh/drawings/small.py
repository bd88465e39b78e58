"""Find tiny edges and narrow faces of a drawing, and remove them."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np

from namedmesh.base.percent import counted, place_words
from namedmesh.drawings.opened import Tell
from namedmesh.drawings.pieces import SHOWN, Entity

TINY = 1 / 50
"""Length of an edge or width of a face that is told, over the size of cells [-].

Cells grow from it to their size over dozens of layers, and the error is large there.
"""
NO_LENGTH = 1e-12
"""Length of an edge that is a point, over the extent of the drawing [-]."""
ROUND_OFF = 1e-6
"""Tolerance that heal=True stands for, over the extent of the drawing [-]."""


def heal(gmsh: Any, solids: list[tuple[str, Entity]], tolerance: float) -> list[tuple[str, Entity]]:
    """Remove edges and faces below a tolerance [length], and close gaps up to it.

    What lies closer than the tolerance to each other becomes one when the solids are
    put in one piece.
    """
    occ = gmsh.model.occ
    places = np.array([_place(occ, entity) for _, entity in solids])
    made = occ.healShapes([], tolerance, sewFaces=False, makeSolids=False)
    occ.synchronize()
    gmsh.option.setNumber("Geometry.ToleranceBoolean", tolerance)
    healed = []
    for entity in sorted(set(made)):
        if entity[0] == solids[0][1][0]:
            # gmsh does not say from which solid a healed one comes.
            nearest = np.linalg.norm(places - _place(occ, entity), axis=1).argmin()
            healed.append((solids[nearest][0], entity))
    return healed


def _place(occ: Any, entity: Entity) -> np.ndarray:
    """Return centre and size of a solid [length], shape (4,)."""
    return np.array([*occ.getCenterOfMass(*entity), occ.getMass(*entity) ** (1 / entity[0])])


def extent(gmsh: Any) -> float:
    """Return the diagonal of the bounding box of all [length]."""
    box = gmsh.model.getBoundingBox(-1, -1)
    return float(sum((high - low) ** 2 for low, high in zip(box[:3], box[3:], strict=True)) ** 0.5)


def defeature(
    gmsh: Any, solids: list[tuple[str, Entity]], width: float, tell: Tell
) -> list[tuple[str, Entity]]:
    """Remove faces that are narrower than a width, and edges that are shorter [length].

    The faces beside a removed one are prolonged: a fillet becomes an edge, a small hole
    is filled.
    """
    model = gmsh.model
    result = []
    removed: list[Entity] = []
    for name, entity in solids:
        narrow = []
        if entity[0] == 3:
            faces = model.getBoundary([entity], oriented=False)
            narrow = [face for face in faces if _width(model, face) < width]
        piece = entity
        if narrow:
            centre = place_words(model.occ.getCenterOfMass(*narrow[0]))
            try:
                made = model.occ.defeature([entity[1]], [tag for _, tag in narrow])
                (piece,) = [part for part in made if part[0] == 3]
                removed += narrow
            except Exception:  # gmsh's errors are of no other class
                tell(
                    "warning",
                    f"{name!r}: {counted(len(narrow), 'narrow face')} at {centre} stay, as "
                    "OpenCASCADE cannot remove them",
                )
        result.append((name, piece))
    model.occ.synchronize()
    short = [e for e in model.getEntities(1) if model.occ.getMass(*e) < width]
    if short:
        result = heal(gmsh, result, width)
        gmsh.option.setNumber("Geometry.ToleranceBoolean", 0.0)
    if removed or short:
        tell(
            "warning",
            f"defeature: {counted(len(removed), 'face')} and {counted(len(short), 'edge')} removed",
        )
    return result


def tell_tiny(gmsh: Any, dim: int, size: float, tell: Tell) -> None:
    """Tell places and sizes of the smallest edges and faces, and of thin solids.

    Edges and faces of thin solids are no features that could be removed.

    Args:
        gmsh: The module gmsh.
        dim: Dimension of the solids.
        size: Size of cells [length].
        tell: Function that tells it.
    """
    model = gmsh.model
    whole = extent(gmsh)
    found: dict[str, list[tuple[float, Entity]]] = defaultdict(list)
    thin = [solid for solid in model.getEntities(3) if _thickness(model, solid) < TINY * size]
    of_thin = set(thin)
    if thin:
        faces = model.getBoundary(thin, combined=False, oriented=False)
        of_thin |= {*faces, *model.getBoundary(faces, combined=False, oriented=False)}
        least = min(_thickness(model, solid) for solid in thin)
        tell(
            "warning",
            f"{counted(len(thin), 'solid')} thinner than {TINY * size:.3g}, a fiftieth of the "
            f"size, the thinnest {least:.3g}: the cells there are many or flat; a smaller size= "
            "fits them",
        )
    for edge in set(model.getEntities(1)) - of_thin:
        length = model.occ.getMass(*edge)
        # The pole of a sphere is an edge without length.
        if NO_LENGTH * whole < length < TINY * size:
            found["edge"].append((length, edge))
    for face in set(model.getEntities(2) if dim == 3 else []) - of_thin:
        width = _width(model, face)
        if width < TINY * size:
            found["narrow face"].append((width, face))
    for kind, list_of_kind in found.items():
        smallest = sorted(list_of_kind)[:SHOWN]
        places = [
            f"{measure:.3g} at {place_words(model.occ.getCenterOfMass(*entity)[:dim])}"
            for measure, entity in smallest
        ]
        tell(
            "warning",
            f"{counted(len(list_of_kind), kind)} below {TINY * size:.3g}, a fiftieth of the size: "
            f"{', '.join(places)}. The mesh is fine there, and its cells are many or flat; "
            f"defeature={1.2 * max(list_of_kind)[0]:.2g} removes them",
        )


def _width(model: Any, face: Entity) -> float:
    """Return the width of a face: twice its area over its circumference [length]."""
    edges = model.getBoundary([face], oriented=False)
    circumference = sum(model.occ.getMass(*edge) for edge in edges)
    return 2 * float(model.occ.getMass(*face)) / circumference if circumference else float("inf")


def _thickness(model: Any, solid: Entity) -> float:
    """Return the thickness of a solid as if it were a plate [length]."""
    faces = model.getBoundary([solid], oriented=False)
    area = sum(model.occ.getMass(*face) for face in faces)
    return 2 * float(model.occ.getMass(*solid)) / area if area else float("inf")
