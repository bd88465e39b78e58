"""Give the motions that make the whole of the part of a body that is computed.

The planes of symmetry of a scene make copies of the body by reflections, which form a
group: of one plane 2, of two planes at a right angle 4, of two planes at 30 degrees 12.
Cyclic sides make copies by turns, one for each sector, and periodic sides copies along
their translation, without end, which differ by the mean strain.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.periodic import area_vector, pair_of
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.scene.contact import Contact, Symmetry
from erc_contact.scene.periodic import Periodic, translated_sides
from namedmesh.base.names import known_names

MOST_COPIES = 400
"""Number of copies beyond which the planes are taken not to close a body."""
SAME_MOTION = 1e-6
"""Difference of motions that counts as none, over the extent of the body [-]."""
NEIGHBOURS = (0, -1, 1)
"""Multiples of a translation that pictures show."""

Motion = tuple[np.ndarray, np.ndarray]
"""R [-] and t [length] of ``x -> R x + t``."""


def closed_copies(model: Model, what: str) -> list[Motion]:
    """Return the motions of the copies that close a body; collective.

    The first one is the identity, which a scene without planes of symmetry and sectors
    has alone.

    Args:
        model: The scene on a mesh.
        what: Who asks, in words for messages.

    Raises:
        InputError: If the copies do not close a body.
    """
    names = [entry.facets for entry in model.scene.contacts if isinstance(entry, Symmetry)]
    steps = [_reflection(model, name) for name in names]
    for pair in model.domain.periodic:
        if pair.turns:
            steps.append((np.array(pair.rotation), np.array(pair.shift)))
    d = model.space.d
    motions = [(np.eye(d), np.zeros(d))]
    newest = motions
    while newest:
        further: list[Motion] = []
        for linear, shift in newest:
            for step, offset in steps:
                motion = step @ linear, step @ shift + offset
                if not any(_same(model.space, motion, known) for known in motions + further):
                    further.append(motion)
        motions = motions + further
        newest = further
        if len(motions) > MOST_COPIES:
            raise InputError(
                f"{what}: the planes of symmetry do not close a body: the angle between two of"
                " them is no whole fraction of 180 degrees, or they are parallel, or beside Cyclic"
                " sides."
            )
    return motions


def shown_copies(model: Model, what: str) -> list[tuple[Motion, np.ndarray]]:
    """Return the motions of the copies that pictures show; collective.

    They are all that close a body, and of periodic sides the next ones on both sides.

    Args:
        model: The scene on a mesh.
        what: Who asks, in words for messages.

    Returns:
        The motions in space, R of shape (3, 3) and t of shape (3,), the identity first,
        and by how much more each copy is displaced, ``E t`` [length], shape (3,).

    Raises:
        InputError: If the scene has no copies, or they do not close a body.
    """
    d = model.space.d
    translations = []
    for entry in translated_sides(model.scene.contacts):
        translations.append(jump_of(model.space, entry))
    copies = []
    for linear, offset in closed_copies(model, what):
        for multiples in product(NEIGHBOURS, repeat=len(translations)):
            in_space = np.eye(3)
            in_space[:d, :d] = linear
            moved = np.zeros((2, 3))
            moved[0, :d] = offset
            for multiple, (shift, jump) in zip(multiples, translations, strict=True):
                moved[:, :d] += multiple * np.stack([shift, jump])
            copies.append(((in_space, moved[0]), moved[1]))
    if len(copies) == 1:
        raise InputError(
            f"{what}: this scene has no Symmetry, no Cyclic and no Periodic, so that the body is"
            " the whole."
        )
    return copies


def jump_of(space: Space, entry: Periodic) -> tuple[np.ndarray, np.ndarray]:
    """Return the translation t of periodic sides and ``E t`` [length]; collective.

    Args:
        space: The mesh.
        entry: What the scene declares, with what was found for a mean stress.
    """
    pair = pair_of(space, entry)
    assert pair is not None
    jump = entry.jump_of(pair, area_vector(space, entry.facets))
    shift = np.array(pair.shift)
    return shift, np.zeros(len(shift)) if jump is None else jump


def mean_strain(space: Space, contacts: Sequence[Contact], part: str) -> np.ndarray:
    """Return ``E t/|t|`` of the translation t between periodic sides [-]; collective.

    Args:
        space: The mesh.
        contacts: What the scene declares.
        part: Name of either side.

    Raises:
        InputError: If no periodic sides have this part.
    """
    periodic = translated_sides(contacts)
    for entry in periodic:
        if part in entry.sides:
            shift, jump = jump_of(space, entry)
            return np.asarray(jump / np.linalg.norm(shift))
    known = known_names(part, [name for entry in periodic for name in entry.sides])
    raise InputError(f"No Periodic has the part {part!r}; this scene has {known}")


def _reflection(model: Model, name: str) -> Motion:
    """Return the linear part and the shift of a reflection; collective."""
    trace = model.contact(name).trace
    normals = model.space.comm.allgather(trace.direction[:1])
    n = np.concatenate(normals)[0]
    points = model.space.comm.allgather(trace.here.corners[:1, 0] @ n)
    distance = np.concatenate(points)[0]
    return np.eye(model.space.d) - 2 * np.outer(n, n), 2 * distance * n


def _same(space: Space, first: tuple[Any, Any], second: tuple[Any, Any]) -> bool:
    """Tell whether two motions are the same."""
    turned = abs(first[0] - second[0]).max()
    shifted = abs(first[1] - second[1]).max() / space.domain.extent
    return bool(max(turned, shifted) < SAME_MOTION)
