"""Keep the geometry of a gmsh model as text, from which it can be meshed again."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

MARK_PREFIX = "erc_contact mark "
"""Beginning of the names of physical groups that keep marks."""
FLAT_TYPES = ("Line", "Plane")
"""gmsh's types of curves and surfaces that facets represent exactly."""

Kept = tuple[str, str, frozenset[int]]
"""Suffix and text of a file of gmsh's, and the marks of curved curves or surfaces."""


def drawing_of(model: Any) -> Kept | None:
    """Return suffix, text and curved marks of gmsh's current model.

    They are the arguments of :class:`erc_contact.mesh.shape.Drawing`. It is None if the
    model has no geometry, as one from a mesh file, or mixes gmsh's two kernels, which
    no format can keep.
    """
    import gmsh  # noqa: PLC0415 - whoever has a model has gmsh

    entities = set(model.getEntities())
    occ_entities = set(model.occ.getEntities())
    discrete = any(model.getType(*entity).startswith("Discrete") for entity in entities)
    mixed = bool(occ_entities) and occ_entities != entities
    if discrete or mixed:
        return None
    suffix = ".xao" if occ_entities else ".geo_unrolled"
    facets = model.getEntities(model.getDimension() - 1)
    curved_tags = [tag for dim, tag in facets if model.getType(dim, tag) not in FLAT_TYPES]
    curved = frozenset(map(int, curved_tags))
    marks = facets if curved and occ_entities else []
    with _marked(model, marks), tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"body{suffix}"
        gmsh.write(str(path))
        return suffix, path.read_text(), curved


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
