"""Rigid motions of bodies, and groups of bodies with motions that nothing holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from erc_contact.model.rigid_shapes import translations_and_rotations


@dataclass(frozen=True, eq=False)
class BodyMotions:
    """Hold the m rigid motions of bodies.

    Rotations are about the centre of the body, and divided by its size.

    Attributes:
        values: The motions at the nodes, shape (nodes, d, m).
        names: Their names.
        centres: Centre of each body [length], shape (bodies, d).
        sizes: Size of each body [length], shape (bodies,).
    """

    values: np.ndarray
    names: list[str]
    centres: np.ndarray
    sizes: np.ndarray


@dataclass(frozen=True, eq=False)
class Group:
    """Hold bodies that contacts connect, and their common motions that nothing holds.

    Attributes:
        bodies: Their numbers, shape (b,).
        amounts: Orthonormal combinations of the m motions of the b bodies, shape (b, m,
            K).
        words: The motions, in words.
        places: The boundary parts of each body, in words; empty for the only body.
    """

    bodies: np.ndarray
    amounts: np.ndarray
    words: str
    places: list[str]


@dataclass(frozen=True, eq=False)
class Unheld:
    """Hold the motions of all bodies that nothing holds.

    Attributes:
        motions_of_bodies: The rigid motions of the bodies.
        groups: The groups of bodies that have such motions.
        functions: The motions q_k, Functions of V, in the order of the groups.
        anchors: Which components of nodes are anchored, shape (nodes, d).
        hint: What may have been meant to hold bodies, in words.
    """

    motions_of_bodies: BodyMotions
    groups: list[Group]
    functions: list[fem.Function]
    anchors: np.ndarray
    hint: str

    @property
    def words(self) -> str:
        """Return the motions in words; empty without any."""
        return "; ".join(group.words for group in self.groups)


def motions_together(motions: BodyMotions, numbers: np.ndarray, m: int) -> np.ndarray:
    """Return the motions of bodies as one body, in motions of each, shape (b, m, m)."""
    amounts = np.zeros((len(numbers), m, m))
    if m == 1:
        amounts[:] = 1.0
        return amounts
    places = motions.centres[numbers]
    shapes = translations_and_rotations(places - places.mean(axis=0))
    d = places.shape[1]
    amounts[:, :d] = shapes
    turns = range(d, m)
    amounts[:, turns, turns] = motions.sizes[numbers, None]
    # Rotations over the size of the greatest body, as motions of one body are.
    amounts[:, :, d:] /= motions.sizes[numbers].max()
    return amounts
