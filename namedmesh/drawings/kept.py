"""Keep the geometry of a gmsh model as text, from which it can be meshed again.

The text is no script: it may come from the file of a run of somebody else.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from namedmesh.base.exceptions import InputError
from namedmesh.drawings.entities import build_entities, check_table, table_of
from namedmesh.files.for_gmsh import check_xao

XAO = ".xao"
"""Form of shapes of OpenCASCADE: XML with the shape as BREP, and the groups."""
TABLE = ".json"
"""Form of shapes of gmsh's own kernel: a table of its entities."""
MARK_PREFIX = "namedmesh mark "
"""Beginning of the names of physical groups that keep marks."""
FLAT_TYPES = ("Line", "Plane")
"""gmsh's types of curves and surfaces that facets represent exactly."""

Kept = tuple[str, str, frozenset[int]]
"""Form and text, and the marks of curved curves or surfaces."""


def drawing_of(model: Any) -> Kept | None:
    """Return form, text and curved marks of gmsh's current model.

    They are the arguments of :class:`namedmesh.shape.Drawing`. It is None if the
    model has no geometry, as one from a mesh file, or mixes gmsh's two kernels or has
    NURBS of gmsh's own kernel, which no form can keep.
    """
    import gmsh  # noqa: PLC0415 - whoever has a model has gmsh

    entities = set(model.getEntities())
    occ_entities = set(model.occ.getEntities())
    discrete = any(model.getType(*entity).startswith("Discrete") for entity in entities)
    mixed = bool(occ_entities) and occ_entities != entities
    if discrete or mixed:
        return None
    suffix = XAO if occ_entities else ".geo_unrolled"
    facets = model.getEntities(model.getDimension() - 1)
    curved_tags = [tag for dim, tag in facets if model.getType(dim, tag) not in FLAT_TYPES]
    curved = frozenset(map(int, curved_tags))
    marks = facets if curved and occ_entities else []
    with _marked(model, marks), tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"body{suffix}"
        gmsh.write(str(path))
        text = path.read_text()
        if occ_entities:
            return XAO, text, curved
        table = table_of(model, text)
        return None if table is None else (TABLE, table, curved)


def check_kept(form: Any, text: Any) -> None:
    """Check a form and a text that come from a file.

    Raises:
        InputError: If they are no shape.
    """
    checks = {XAO: check_xao, TABLE: check_table}
    if form not in checks or not isinstance(text, str):
        raise InputError(
            f"it has a shape of the form {form!r}, and BREP (.xao) or a table (.json) are read: a "
            "script could do anything."
        )
    checks[form](text)


def build_kept(gmsh: Any, form: str, text: str) -> None:
    """Make geometry and physical groups of a text in gmsh's current model."""
    try:
        check_kept(form, text)
    except InputError as reason:
        raise InputError(f"The geometry cannot be used: {reason}") from reason
    if form == TABLE:
        build_entities(gmsh, text)
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"body{form}"
        path.write_text(text)
        gmsh.merge(str(path))


@contextmanager
def _marked(model: Any, facets: list[tuple[int, int]]) -> Iterator[None]:
    """Let physical groups carry the tags of facets inside the `with`.

    OpenCASCADE does not keep tags. Other groups are called by their tags meanwhile:
    gmsh writes their names into XML as they are, and "nut & bolt" is none. The groups
    keep their tags in the file, so nobody asks for the names there.
    """
    names = {group: model.getPhysicalName(*group) for group in model.getPhysicalGroups()}
    for name in names.values():
        model.removePhysicalName(name)
    marks = []
    try:
        for dim, tag in names:
            model.setPhysicalName(dim, tag, f"{dim} {tag}")
        for dim, tag in facets:
            marks.append((dim, model.addPhysicalGroup(dim, [tag], name=f"{MARK_PREFIX}{tag}")))
        yield
    finally:
        if marks:  # no groups would mean all
            model.removePhysicalGroups(marks)
        for (dim, tag), name in names.items():
            model.removePhysicalName(f"{dim} {tag}")
            if name:
                model.setPhysicalName(dim, tag, name)
