"""Choose among the fields at the cells of a file the field that holds tags of sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from namedmesh.files.file_mesh import Block, ElementSet, by_tags

TAG_KEYS = (
    "gmsh:physical",
    "medit:ref",
    "cell_tags",
    "mat_id",
    "MaterialIDs",
    "CellEntityIds",
    "material",
    "region",
    "subdomain",
)
"""Names of fields that hold tags, the preferred name first."""
CAD_ENTITIES = "gmsh:geometrical"
"""Name of gmsh's numbers of curves and surfaces of a drawing, which are no sets."""
CELL_NUMBERS = (
    "vtkOriginalCellIds",
    "vtkGhostType",
    "GlobalElementId",
    "ElementId",
    "GlobalCellId",
)
"""Names of fields that number cells and name nothing."""
MOST_TAGS = 2000
"""Number of different tags beyond which a field is none of tags."""


def tagged_sets(
    blocks: Sequence[Block],
    fields: Mapping[str, list[np.ndarray]],
    names: Mapping[tuple[int, int], str],
) -> tuple[ElementSet, ...]:
    """Return the sets of elements that a field of tags gives; none if no field does.

    Tag 0 stands for no part, and for cells that no other tag has.

    Args:
        blocks: The elements.
        fields: Name of each field -> its values for each block.
        names: Pairs (dimension, tag) -> names.
    """
    tags = _choose_field(fields)
    if tags is None:
        return ()
    dim = max((block.dim for block in blocks), default=0)
    sets = by_tags(tuple(blocks), tags, names)
    named = []
    for found in sets:
        of_body = any(blocks[number].dim == dim for number in found.members)
        if found.tag != 0 or of_body:
            named.append(found)
    return tuple(named)


def _choose_field(fields: Mapping[str, list[np.ndarray]]) -> list[np.ndarray] | None:
    """Return the tags of a field, None if no field has tags.

    Fields that are stored as integers come before fields of whole floats. Of several
    such fields the first name of :data:`TAG_KEYS` is taken, else the first field.
    """
    integers: dict[str, list[np.ndarray]] = {}
    floats: dict[str, list[np.ndarray]] = {}
    for name, blocks in fields.items():
        if name in CELL_NUMBERS or name == CAD_ENTITIES:
            continue
        flat = [_flat(values) for values in blocks]
        if any(values is None for values in flat):
            continue
        tags = [values for values in flat if values is not None]
        if not _are_tags(np.concatenate([np.empty(0), *tags])):
            continue
        whole = all(values.dtype.kind in "iub" for values in blocks)
        (integers if whole else floats)[name] = [values.astype(np.int64) for values in tags]
    for found in (integers, floats):
        for name in (*TAG_KEYS, *found):
            if name in found:
                return found[name]
    return None


def _flat(values: np.ndarray) -> np.ndarray | None:
    """Return one number for each element, or None if there are several or texts."""
    values = np.asarray(values)
    if values.dtype.kind not in "iubf":
        return None
    if values.ndim == 2 and values.shape[1] == 1:
        return values[:, 0]
    return values if values.ndim == 1 else None


def _are_tags(values: np.ndarray) -> bool:
    """Tell whether numbers may be tags: whole, not too many different, no numbering."""
    if not len(values) or not np.isfinite(values).all() or (values != np.rint(values)).any():
        return False
    different = np.unique(values)
    if len(different) > MOST_TAGS:
        return False
    numbering = len(different) == len(values) > 8 and np.ptp(different) == len(values) - 1
    return not numbering and bool(abs(different).max() < np.iinfo(np.int32).max)
