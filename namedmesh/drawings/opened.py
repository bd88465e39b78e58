"""Open a drawing in gmsh, and name its solids.

The dimension d of a drawing is 3 if it has solids. A drawing in the plane has surfaces
in place of solids, and curves in place of faces.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from namedmesh.base.percent import counted
from namedmesh.files.for_gmsh import called, check_xao, merge_script

Tell = Callable[[str, str], None]
"""Function that tells the user a sentence, as "info" or as "warning"."""

CAD = (".step", ".stp", ".iges", ".igs", ".brep", ".brp")
"""Endings of the files that OpenCASCADE reads."""
OF_OCC = ("step", "iges", "brep")
"""Their formats."""
SAME = 1e-6
"""Distance of places that are one, over the extent of the drawing [-]."""
NO_NAME = "Open CASCADE"
"""Beginning of the names that a kernel gives to solids without a name."""
SI_PREFIXES = {"MILLI": "MM", "CENTI": "CM", "KILO": "KM", "MICRO": "UM", "$": "M"}
"""Prefix of the metre in a STEP file -> name of the unit."""
FACTORS = {"INCH": "INCH", "IN": "INCH", "FOOT": "FT", "FT": "FT", "MILE": "MI"}
"""Name of a converted unit in a file -> name of the unit for OpenCASCADE."""
UNITS = ("MM", "CM", "M", "KM", "UM", "INCH", "FT", "MI", "MIL", "UIN")
"""Units that OpenCASCADE knows."""


class Refused(Exception):
    """Report that a drawing cannot be meshed, in a sentence for the user."""


def open_drawing(gmsh: Any, path: Path, kind: str, tell: Tell) -> list[tuple[str, tuple[int, int]]]:
    """Open a drawing in gmsh's current model.

    Sheets and wires beside solids are left out and counted.

    Args:
        gmsh: The module.
        path: The file.
        kind: Its format, one of :data:`namedmesh.files.formats.DRAWINGS`.
        tell: Function that tells what is left out.

    Returns:
        Name and entity of each solid, in the order of the file; the names differ.

    Raises:
        Refused: If the drawing has no solids, nor surfaces in the plane.
    """
    if kind in OF_OCC:
        _import(gmsh, path, kind, tell)
    elif kind == "xao":
        check_xao(path.read_text(encoding="utf-8", errors="replace"))
        with called(path, ".xao") as link:
            gmsh.merge(str(link))
    elif path.read_text(encoding="latin-1").strip():
        merge_script(gmsh, path)
        gmsh.model.mesh.clear()
    model = gmsh.model
    dim = int(model.getDimension())
    if dim == 2 and not _in_plane(model):
        _solids_of_faces(gmsh, tell)
        dim = 3
    if dim < 2:
        raise Refused("it has no solid, and no surface in the plane (x, y)")
    if model.occ.getEntities():
        _leave_out(gmsh, dim, tell)
    entities = model.getEntities(dim)
    names = [_last_name(model.getEntityName(*entity)) for entity in entities]
    return list(zip(different(names, "solid" if dim == 3 else "surface"), entities, strict=True))


def _import(gmsh: Any, path: Path, kind: str, tell: Tell) -> None:
    """Import shapes by OpenCASCADE, in the unit of the file."""
    unit = _unit_of(path, kind)
    if unit:
        if kind == "iges":
            # OpenCASCADE takes a unit only after it has read a first file of this kind.
            gmsh.model.add("first")
            gmsh.model.occ.importShapes(str(path), format=kind)
            gmsh.model.remove()
        gmsh.option.setString("Geometry.OCCTargetUnit", unit)
    gmsh.model.add("drawing")
    gmsh.model.occ.importShapes(str(path), highestDimOnly=False, format=kind)
    gmsh.model.occ.synchronize()
    if unit:
        tell("info", f"lengths are in {unit.lower()}, the unit of the file")


def _unit_of(path: Path, kind: str) -> str | None:
    """Return the unit of length in a file, "MM" if it has several; None for BREP."""
    if kind == "brep":
        return None
    text = path.read_text(encoding="latin-1")
    units = _units_of_step(text) if kind == "step" else _units_of_iges(text)
    return units.pop() if len(units) == 1 else "MM"


def _units_of_step(text: str) -> set[str]:
    """Return the units of length in which a STEP file gives coordinates."""
    statements = dict(re.findall(r"#(\d+)\s*=\s*\(([^;]*LENGTH_UNIT[^;]*)\)\s*;", text))
    contexts = re.findall(r"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)", text)
    units = set()
    for number in re.findall(r"#(\d+)", " ".join(contexts)):
        statement = statements.get(number, "")
        metre = re.search(r"SI_UNIT\s*\(\s*(\$|\.\w+\.)\s*,\s*\.METRE\.", statement)
        converted = re.search(r"CONVERSION_BASED_UNIT\s*\(\s*'(\w+)'", statement)
        if converted:
            units.add(FACTORS.get(converted[1].upper(), "MM"))
        elif metre:
            units.add(SI_PREFIXES.get(metre[1].strip("."), "MM"))
    return units


def _units_of_iges(text: str) -> set[str]:
    """Return the unit in the global section of an IGES file, its 15th entry."""
    rows = [line[:72] for line in text.splitlines() if line[72:73] == "G"]
    found = re.search(r",\d+,\d+H(\w+),\d+,[\d.]", "".join(rows))
    unit = found[1].upper() if found else "MM"
    unit = FACTORS.get(unit, unit)
    return {unit if unit in UNITS else "MM"}


def _in_plane(model: Any) -> bool:
    """Tell whether all is in a plane z = constant."""
    low_x, low_y, low_z, high_x, high_y, high_z = model.getBoundingBox(-1, -1)
    # OpenCASCADE's boxes are 1e-7 larger than what is in them.
    return bool(high_z - low_z <= SAME * max(high_x - low_x, high_y - low_y) + 1e-6)


def _leave_out(gmsh: Any, dim: int, tell: Tell) -> None:
    """Remove what is neither a solid nor a part of a solid, and count it."""
    model = gmsh.model
    counts = []
    for lower, kind in ((2, "sheet"), (1, "curve"), (0, "point")):
        alone = []
        if lower < dim:
            entities = model.getEntities(lower)
            alone = [entity for entity in entities if not len(model.getAdjacencies(*entity)[0])]
        if alone:
            model.occ.remove(alone, recursive=True)
            model.occ.synchronize()
            counts.append(counted(len(alone), kind))
    if counts:
        beside = "solids" if dim == 3 else "surfaces"
        tell("warning", f"{' and '.join(counts)} beside the {beside} left out")


def _solids_of_faces(gmsh: Any, tell: Tell) -> None:
    """Make solids of faces whose edges lie on each other, as IGES files have them.

    Raises:
        Refused: If no faces close a solid.
    """
    model = gmsh.model
    shells = _closed_shells(model)
    if not shells:
        raise Refused(
            "it has surfaces in 3D that enclose no solid (sheets); draw solids, or a drawing "
            "in the plane (x, y)"
        )
    for faces in shells:
        loop = model.occ.addSurfaceLoop(faces, sewing=True)
        model.occ.addVolume([loop])
    model.occ.synchronize()
    tell(
        "warning", f"the file has faces and no solids: {counted(len(shells), 'solid')} made of them"
    )


def _closed_shells(model: Any) -> list[list[int]]:
    """Return groups of faces, of which each edge lies on one edge of another face."""
    box = np.reshape(model.getBoundingBox(-1, -1), (2, 3))
    grid = SAME * float(np.linalg.norm(box[1] - box[0]))
    faces_at: defaultdict[tuple[int, ...], list[int]] = defaultdict(list)
    for _, face in model.getEntities(2):
        for _, edge in model.getBoundary([(2, face)], oriented=False):
            length = model.occ.getMass(1, edge)
            if length < grid:  # the pole of a sphere
                continue
            place = [*model.occ.getCenterOfMass(1, edge), length]
            faces_at[tuple(np.round(np.array(place) / grid / 10).astype(int))].append(face)
    group = {face: face for _, face in model.getEntities(2)}
    for faces in faces_at.values():
        merged = {group[face] for face in faces}
        group = {face: min(merged) if g in merged else g for face, g in group.items()}
    wrong = {group[f] for faces in faces_at.values() if len(faces) != 2 for f in faces}
    shells = defaultdict(list)
    for face, number in group.items():
        if number not in wrong:
            shells[number].append(face)
    return list(shells.values())


def _last_name(label: str) -> str:
    """Return the name of a solid from its path in the tree of the assembly.

    gmsh appends names of layers, "nut & & 256", and a kernel names what has no name.
    """
    name = re.sub(r" & & \S+$", "", label.rsplit("/", maxsplit=1)[-1]).strip()
    return "" if name.startswith(NO_NAME) else name


def different(names: list[str], kind: str) -> list[str]:
    """Return names that differ: names that several solids have get numbers.

    Args:
        names: Name of each solid, "" for none.
        kind: Word for a solid without a name.
    """
    if len(names) == 1:
        return [names[0] or "body"]
    given = [name or kind for name in names]
    times = Counter(given)
    numbers: Counter[str] = Counter()
    result: list[str] = []
    for name in given:
        chosen = name
        if times[name] > 1:
            numbers[name] += 1
            chosen = f"{name} {numbers[name]}"
            while chosen in times:
                numbers[name] += 1
                chosen = f"{name} {numbers[name]}"
        result.append(chosen)
    return result
