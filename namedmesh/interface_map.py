"""Describe how a split mesh relates to the glued mesh, and which facets face.

A side is a pair of a cell and one of its facets.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

Facing = Mapping[tuple[str, str], tuple[np.ndarray, np.ndarray]]
"""Names of two parts -> sides of the first, and sides of the second that face them."""


Regions = int | tuple[int, ...]
"""Tag of a region, or tags of several."""


@dataclass(frozen=True)
class Interface:
    """Say where a mesh is split, and how its two sides are called.

    Attributes:
        names: Names of the two new boundary parts.
        tags: Their tags.
        regions: Tag of the region on each side, or tags of several.
        on: Tag of the part whose facets are split; None takes all facets between the
            regions.
        tied: Whether the facets stay glued, of a joint that only keeps its names.
    """

    names: tuple[str, str]
    tags: tuple[int, int]
    regions: tuple[Regions, Regions]
    on: int | None
    tied: bool = False

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> Interface:
        """Make it from plain data, where pairs are lists."""
        here, there = plain["regions"]
        regions = (_tuple_of_list(here), _tuple_of_list(there))
        tied = plain.get("tied", False)
        return cls(tuple(plain["names"]), tuple(plain["tags"]), regions, plain["on"], tied)


@dataclass(frozen=True, eq=False)
class InterfaceMap:
    """Relate a split mesh to the glued mesh.

    Attributes:
        interfaces: The interfaces, in the order in which they were split.
        facing: The sides that face each other; each pair of parts in both orders.
        cells: Cell of the glued mesh on this rank of each cell, shape (n,).
        nodes: Node of the glued mesh of each node, shape (m,).
        counts: Number of facets of each interface over all ranks.
        distances: Greatest distance of facing vertices of each interface [length]; 0
            where both sides are in one place.
    """

    interfaces: tuple[Interface, ...]
    facing: Facing
    cells: np.ndarray
    nodes: np.ndarray
    counts: tuple[int, ...]
    distances: tuple[float, ...]

    def __str__(self) -> str:
        """Name the pairs of parts, and how many facets face each other."""
        words = []
        for interface, count in zip(self.interfaces, self.counts, strict=True):
            kind = " tied" if interface.tied else ""
            words.append(f"{'/'.join(interface.names)} of {count}{kind} facets")
        return ", ".join(words)

    def least(self, values: np.ndarray) -> np.ndarray:
        """Return the least of the values at the copies of each node of the glued mesh.

        Args:
            values: Values at the nodes on this rank, shape (m,).

        Returns:
            Values at the nodes of the glued mesh on this rank.
        """
        result = np.full(self.nodes.max(initial=-1) + 1, np.inf)
        np.minimum.at(result, self.nodes, values)
        return result


def _tuple_of_list(regions: Any) -> Regions:
    """Return a tag as it is, and tags of several regions as a tuple."""
    return tuple(regions) if isinstance(regions, list | tuple) else regions
