"""Make one piece of solids that touch, and tell where they touch at lines only."""

from __future__ import annotations

from collections import defaultdict
from itertools import combinations
from typing import Any

import numpy as np

from namedmesh.base.percent import place_words
from namedmesh.drawings.opened import Refused, Tell

Entity = tuple[int, int]
"""Dimension and tag of gmsh's."""
Solids = list[tuple[str, list[Entity]]]
"""Name and entities of each solid."""

SHOWN = 3
"""Number of places that a sentence shows."""


def in_one_piece(gmsh: Any, solids: list[tuple[str, Entity]], tell: Tell) -> Solids:
    """Give solids that touch common faces.

    Args:
        gmsh: The module gmsh, with the solids in its current model.
        solids: Name and entity of each.
        tell: Function that tells what is left out.

    Returns:
        The solids, without solids that are in the drawing twice.

    Raises:
        Refused: If two solids overlap.
    """
    if len(solids) == 1:
        return [(name, [entity]) for name, entity in solids]
    occ = gmsh.model.occ
    entities = [entity for _, entity in solids]
    names = [name for name, _ in solids]
    # gmsh ignores tolerances and lines that touch a face unless there are tools.
    _, made = occ.fragment(entities[:1], entities[1:])
    occ.synchronize()
    owners = defaultdict(list)
    for name, pieces in zip(names, made, strict=True):
        for piece in pieces:
            owners[piece].append(name)
    twice = set()
    of_name = dict(zip(names, map(set, made), strict=True))
    for sharing in owners.values():
        twice |= {name for name in sharing[1:] if of_name[name] == of_name[sharing[0]]}
    if twice:
        tell("warning", f"{', '.join(sorted(twice))} left out: at the same place as another solid")
    common: dict[tuple[str, ...], list[Entity]] = defaultdict(list)
    for piece, sharing in owners.items():
        kept = tuple(name for name in sharing if name not in twice)
        if len(kept) > 1:
            common[kept].append(piece)
    if common:
        raise Refused(_overlap_in_words(occ, common))
    left = [name for name in names if name not in twice]
    return [(name, sorted(of_name[name])) for name in left]


def _overlap_in_words(occ: Any, common: dict[tuple[str, ...], list[Entity]]) -> str:
    """Return which solids have which volume in common, and what to do."""
    words = []
    for sharing, pieces in list(common.items())[:SHOWN]:
        dim = pieces[0][0]
        measure = sum(occ.getMass(*piece) for piece in pieces)
        kind = "volume" if dim == 3 else "area"
        centre = place_words(occ.getCenterOfMass(*pieces[0])[:dim])
        words.append(f"{' and '.join(map(repr, sharing))} the {kind} {measure:.3g} at {centre}")
    more = len(common) - len(words)
    return (
        f"solids overlap: {'; '.join(words)}{f' and {more} more' if more else ''}. Cut one of them "
        "by the other in the drawing (an interference is given by gap= of the contact, not drawn), "
        "or close overlaps of the drawing's precision by heal=, a length"
    )


def tell_touches(gmsh: Any, solids: Solids, tell: Tell) -> None:
    """Tell which solids touch along lines or at points only.

    Args:
        gmsh: The module gmsh.
        solids: The solids in one piece.
        tell: Function that tells it.
    """
    model = gmsh.model
    dim = solids[0][1][0][0]
    parts = [_parts(model, entities) for _, entities in solids]
    for (here, of_here), (there, of_there) in combinations(enumerate(parts), 2):
        shared = of_here & of_there
        if any(entity[0] == dim - 1 for entity in shared):
            continue
        names = f"{solids[here][0]!r} and {solids[there][0]!r}"
        if shared:
            entity = max(shared)
            how = "along a line" if entity[0] == 1 else "at a point"
            box = np.reshape(model.getBoundingBox(*entity), (2, 3))
            centre = place_words(box.mean(axis=0)[:dim])
            tell("warning", f"{names} touch {how} only, at {centre}: they are kept apart")


def _parts(model: Any, entities: list[Entity]) -> set[Entity]:
    """Return faces, edges and vertices of a solid, and what is embedded in a face."""
    parts: set[Entity] = set()
    level = set(entities)
    while level:
        below: set[Entity] = set(model.getBoundary(list(level), combined=False, oriented=False))
        for dim, tag in level:
            below.update(model.mesh.getEmbedded(dim, tag))
        parts |= below
        level = {entity for entity in below if entity[0] > 0}
    return parts
