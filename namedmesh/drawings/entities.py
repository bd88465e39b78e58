"""Keep shapes of gmsh's own kernel as a table of numbers.

gmsh keeps them as a script, and a script from a file of somebody else could do
anything. A table can only name points, curves, surfaces and volumes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

from namedmesh.base.exceptions import InputError

NUMBER = r"[-+\w.]+"
ENTITY = re.compile(rf"(\w[\w ]*)\((\d+)\) = {{({NUMBER}(?:, *{NUMBER})*)}}")
"""Statement that makes an entity: kind, tag and numbers."""
INSIDE = re.compile(r"(\w+) {(\d+)} In (\w+) {(\d+)}")
"""Statement that puts an entity into another one."""
DIMENSIONS = {"Point": 0, "Line": 1, "Curve": 1, "Surface": 2, "Volume": 3}
"""Dimension by the kind of an entity that lies in another one."""


def _makers(geo: Any) -> dict[str, Callable[[list[Any], int], Any]]:
    """Return the function that makes each kind of entity of its numbers and tag."""
    return {
        "Point": lambda x, tag: geo.addPoint(*x[:3], tag=tag),
        "Line": lambda ends, tag: geo.addLine(*ends, tag=tag),
        "Circle": lambda points, tag: geo.addCircleArc(*points, tag=tag),
        "Ellipse": lambda points, tag: geo.addEllipseArc(*points, tag=tag),
        "Spline": lambda points, tag: geo.addSpline(points, tag=tag),
        "BSpline": lambda points, tag: geo.addBSpline(points, tag=tag),
        "Bezier": lambda points, tag: geo.addBezier(points, tag=tag),
        "Curve Loop": lambda curves, tag: geo.addCurveLoop(curves, tag=tag),
        "Plane Surface": lambda loops, tag: geo.addPlaneSurface(loops, tag=tag),
        "Surface": lambda loops, tag: geo.addSurfaceFilling(loops, tag=tag),
        "Surface Loop": lambda faces, tag: geo.addSurfaceLoop(faces, tag=tag),
        "Volume": lambda loops, tag: geo.addVolume(loops, tag=tag),
    }


def table_of(model: Any, script: str) -> str | None:
    """Return the table of a model of gmsh's own kernel, None if it has other entities.

    Args:
        model: The model, whose physical groups are kept, too.
        script: The script that gmsh writes of it. Sizes and rules of the mesh in it are
            left out: whoever meshes a kept shape gives the sizes.
    """
    entities: list[tuple[str, int, list[float] | list[int]]] = []
    inside = []
    for statement in script.split(";"):
        words = " ".join(statement.split())
        made = ENTITY.fullmatch(words)
        put = INSIDE.fullmatch(words)
        if made and made[1] in _makers(None):
            kind = made[1]
            flat = [word.strip() for word in made[3].split(",")]
            x = [float(word) for word in flat[:3]] if kind == "Point" else [*map(int, flat)]
            entities.append((kind, int(made[2]), x))
        elif put:
            inside.append([DIMENSIONS[put[1]], int(put[2]), DIMENSIONS[put[3]], int(put[4])])
    groups = []
    for dim, tag in model.getPhysicalGroups():
        members = [int(entity) for entity in model.getEntitiesForPhysicalGroup(dim, tag)]
        groups.append([int(dim), int(tag), members])
    found = sum(not kind.endswith("Loop") for kind, _, _ in entities)
    if found < len(model.getEntities()):
        return None
    return json.dumps({"entities": entities, "inside": inside, "groups": groups})


def build_entities(gmsh: Any, text: str) -> None:
    """Make the entities and groups of a table in gmsh's current model."""
    table = json.loads(text)
    model = gmsh.model
    makers = _makers(model.geo)
    for kind, tag, numbers in table["entities"]:
        makers[kind](numbers, tag)
    model.geo.synchronize()
    for dim, tag, in_dim, in_tag in table["inside"]:
        model.mesh.embed(dim, [tag], in_dim, in_tag)
    for dim, tag, members in table["groups"]:
        model.addPhysicalGroup(dim, members, tag)


def check_table(text: str) -> None:
    """Check a table that comes from a file.

    Raises:
        InputError: If it is no table of entities.
    """
    try:
        table = json.loads(text)
        good = set(table) == {"entities", "inside", "groups"}
        for kind, tag, numbers in table["entities"]:
            is_place = kind == "Point" and len(numbers) == 3 and _are_finite(numbers)
            good &= is_place or (kind != "Point" and len(numbers) > 0 and _are_tags(numbers))
            good &= kind in _makers(None) and _are_tags([tag])
        for row in table["inside"]:
            good &= len(row) == 4 and _are_tags(row)
        for dim, tag, members in table["groups"]:
            good &= _are_tags([dim, tag, *members])
    except (KeyError, TypeError, ValueError, RecursionError):
        good = False
    if not good:
        raise InputError("its shape is no table of points, curves, surfaces and volumes.")


def _are_tags(numbers: list[Any]) -> bool:
    """Tell whether all are whole numbers that a tag may have."""
    return all(type(number) is int and abs(number) < 2**31 for number in numbers)


def _are_finite(numbers: list[Any]) -> bool:
    """Tell whether all are numbers that a coordinate may have."""
    return all(type(number) in (int, float) and abs(number) < 1e300 for number in numbers)
