"""Give two sides of a body that is repeated facets that match.

Two copies of the body lie against each other as two bodies do, and are joined as these
are: side 1 of the body and side 2 of the copy before it. So side 1 gets what it needs
of side 2. Then side 2 lies against side 1 of the next copy, whose facets stay, and gets
the same ones.

Symbols: 1 and 2 the sides. The motion of the pair takes side 1 onto side 2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from namedmesh.base.exceptions import InputError, raise_together
from namedmesh.bodies import Bodies
from namedmesh.periodic import SAME_PLACE, PeriodicPair
from namedmesh.plain import PlainMesh
from namedmesh.tags import NO_TAG
from namedmesh.transfer import gather_mesh

Glue = Callable[[PlainMesh, tuple[int, int], int], tuple[PlainMesh, Any]]
"""Glues the sides of two tags and gives their facets a third one, as
:func:`namedmesh.joining.joint.glue_sides` does."""


def with_matching_sides(bodies: Bodies, pairs: tuple[PeriodicPair, ...], glue: Glue) -> PlainMesh:
    """Return the mesh of bodies whose paired sides match, on rank 0; collective.

    Args:
        bodies: The glued mesh.
        pairs: The pairs.
        glue: Joins two bodies.

    Raises:
        InputError: If sides of a pair do not lie on each other as copies, or bodies
            were joined that are apart.
    """
    plain = before = gather_mesh(bodies)
    error: Exception | None = None
    if bodies.comm.rank == 0:
        try:
            for pair in pairs:
                here, there = (bodies.names[name] for name in pair.names)
                plain = _matched(plain, here, there, pair, glue)
            if plain.marks is None and before.marks is not None:
                plain = replace(plain, marks=_marks_of(plain, before, before.marks))
        except InputError as reason:
            names = " and ".join(pair.names)
            error = InputError(
                f"matched: {names} do not become alike. {reason} Copies have no distance that could"
                " be given: mesh both sides alike, or with smaller facets."
            )
    raise_together(bodies.comm, error)
    return plain


def _matched(plain: PlainMesh, here: int, there: int, pair: PeriodicPair, glue: Glue) -> PlainMesh:
    """Return a mesh whose sides of these tags match."""
    if plain.glued is not None:
        raise InputError("Bodies that were joined with apart= keep their places there.")
    rotation = np.array(pair.rotation)
    before = replace(plain, x=(plain.x - np.array(pair.shift)) @ rotation)
    first = _joined(plain, before, here, there, glue)[0]
    following = replace(first, x=pair.image(first.x))
    return _joined(following, first, here, there, glue)[1]


def _joined(
    first: PlainMesh, second: PlainMesh, here: int, there: int, glue: Glue
) -> tuple[PlainMesh, PlainMesh]:
    """Join side 1 of a body to side 2 of another body, and return both bodies.

    Args:
        first: The body of side 1.
        second: The body of side 2.
        here: Tag of side 1.
        there: Tag of side 2.
        glue: Joins two bodies.
    """
    # The second body has tags of its own.
    beyond = 1 + max(int(plain.tags.max()) for plain in (first, second))
    last_region = max(int(plain.regions.max()) for plain in (first, second))
    regions = last_region + 1 - NO_TAG
    marked = replace(
        second,
        tags=np.where(second.tags == NO_TAG, NO_TAG, second.tags + beyond),
        regions=second.regions + regions,
    )
    bodies_apart = PlainMesh.beside_each_other([first, marked])
    meeting = 2 * beyond
    glued, _ = glue(bodies_apart, (here, there + beyond), meeting)
    is_second = glued.regions > last_region
    bodies = []
    for others, tag, offset in ((is_second, here, 0), (~is_second, there, beyond)):
        body = _without(glued, others)
        tags = np.where(body.tags == meeting, tag + offset, body.tags)
        body = replace(
            body,
            tags=np.where(tags == NO_TAG, NO_TAG, tags - offset),
            regions=body.regions - (regions if offset else 0),
        )
        bodies.append(body.without_unused_points())
    return bodies[0], bodies[1]


def _without(plain: PlainMesh, cells: np.ndarray) -> PlainMesh:
    """Return a mesh without some cells, with its marks."""
    marks = None if plain.marks is None else plain.marks[~cells]
    return replace(plain.without_cells(cells), marks=marks)


def _marks_of(plain: PlainMesh, before: PlainMesh, marks: np.ndarray) -> np.ndarray:
    """Return the marks of sides of a mesh of which some regions were meshed anew.

    Facets that stay keep their marks. Others have the mark of the nearest facet of
    their part.

    Args:
        plain: The mesh.
        before: The mesh before.
        marks: Marks of its sides, shape (m, d+1).
    """
    from scipy.spatial import cKDTree  # type: ignore[import-untyped]  # noqa: PLC0415 - for pairs only

    found = np.full_like(plain.tags, NO_TAG)
    drawn, sides = np.argwhere(marks != NO_TAG), np.argwhere(np.ones_like(plain.tags, dtype=bool))
    distance, nearest = cKDTree(_middles(before, drawn)).query(_middles(plain, sides))
    stays = distance <= SAME_PLACE * np.ptp(plain.x, axis=0).max()
    found[tuple(sides[stays].T)] = marks[tuple(drawn[nearest[stays]].T)]
    is_new = plain.is_outer & (found == NO_TAG)
    tags = before.tags[tuple(drawn.T)]
    for tag in np.unique(tags):
        of_part = drawn[tags == tag]
        new = np.argwhere(is_new & (plain.tags == tag))
        nearest = cKDTree(_middles(before, of_part)).query(_middles(plain, new))[1]
        found[tuple(new.T)] = marks[tuple(of_part[nearest].T)]
    return found


def _middles(plain: PlainMesh, sides: np.ndarray) -> np.ndarray:
    """Return the middles of sides [length], shape (n, d)."""
    middles: np.ndarray = plain.x[plain.points_of(sides)].mean(axis=1)
    return middles
