"""Hold a mesh as files have it: points, cells of several shapes, sets with names.

Corners of a shape have the order of VTK, gmsh, Abaqus and Exodus. Cells of
higher order list their corners first. The orientation of a whole cell has no meaning,
but the faces of a cell all turn the same way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

BODY = "body"
"""Name of the region of a body without sets of cells."""


@dataclass(frozen=True)
class Shape:
    """Describe a shape of cells.

    Attributes:
        dim: Dimension of the cell.
        faces: Corners of each face. In the plane they are the edges.
    """

    dim: int
    faces: tuple[tuple[int, ...], ...]

    @property
    def corners(self) -> int:
        """Return the number of corners."""
        return 1 + max((corner for face in self.faces for corner in face), default=0)

    @property
    def face_table(self) -> np.ndarray:
        """Return the corners of the faces, shape (faces, 2) in the plane, else (., 4).

        A triangle has its last corner twice.
        """
        width = 2 * (self.dim - 1)
        return np.array([face + face[-1:] * (width - len(face)) for face in self.faces])


SHAPES = {
    "vertex": Shape(0, ((0,),)),
    "line": Shape(1, ((0,), (1,))),
    "triangle": Shape(2, ((0, 1), (1, 2), (2, 0))),
    "quadrilateral": Shape(2, ((0, 1), (1, 2), (2, 3), (3, 0))),
    "tetrahedron": Shape(3, ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))),
    "hexahedron": Shape(
        3,
        ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    ),
    "prism": Shape(3, ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))),
    "pyramid": Shape(3, ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))),
}
"""The shapes by name."""
NODES: dict[int, dict[str, tuple[int, ...]]] = {
    1: {"line": (2, 3)},
    2: {"triangle": (3, 6), "quadrilateral": (4, 8, 9)},
    3: {
        "tetrahedron": (4, 10),
        "pyramid": (5, 13),
        "prism": (6, 15),
        "hexahedron": (8, 20, 27),
    },
}
"""Numbers of nodes of the elements that programs have, by dimension and shape."""


def shape_with(dim: int, nodes: int) -> str | None:
    """Return the shape of a dimension that has a number of nodes, None if none has."""
    for shape, counts in NODES.get(dim, {}).items():
        if nodes in counts:
            return shape
    return None


@dataclass(frozen=True, eq=False)
class Block:
    """Hold elements of one shape.

    Attributes:
        shape: Name of the shape.
        nodes: Rows of their points, corners first, shape (n, k). Points beyond the
            corners lie on curved edges and faces.
    """

    shape: str
    nodes: np.ndarray

    @property
    def dim(self) -> int:
        """Return the dimension of the elements."""
        return SHAPES[self.shape].dim

    @property
    def corners(self) -> np.ndarray:
        """Return the rows of the corners, shape (n, corners)."""
        return self.nodes[:, : SHAPES[self.shape].corners]


@dataclass(frozen=True, eq=False)
class ElementSet:
    """Hold elements that have a name in the file.

    Attributes:
        name: The name, or the tag in digits.
        members: Number of a block -> numbers of elements in it.
        tag: Number by which the file calls the set, or None.
        weak: Whether other sets go before it, as a user has not listed its elements.
    """

    name: str
    members: Mapping[int, np.ndarray]
    tag: int | None = None
    weak: bool = False


@dataclass(frozen=True, eq=False)
class FacetSet:
    """Hold sides of cells that have a name in the file.

    Attributes:
        name: The name, or the tag in digits.
        corners: Rows of their corners, shape (n, 2) in the plane, (n, 4) in 3D; a
            triangle has its last corner twice.
        tag: Number by which the file calls the set, or None.
        outer: Whether only sides on the boundary of the body are meant.
        weak: Whether other sets go before it, as a user has not listed its sides.
    """

    name: str
    corners: np.ndarray
    tag: int | None = None
    outer: bool = False
    weak: bool = False


@dataclass(frozen=True, eq=False)
class NodeSet:
    """Hold nodes that have a name in the file.

    Attributes:
        name: The name, or the tag in digits.
        nodes: Rows of points.
        tag: Number by which the file calls the set, or None.
        weak: Whether other sets go before it, as a user has not listed its nodes.
    """

    name: str
    nodes: np.ndarray
    tag: int | None = None
    weak: bool = False


@dataclass(frozen=True, eq=False)
class FileMesh:
    """Hold the mesh of a file.

    Attributes:
        points: Points [length], shape (n, 3).
        blocks: The elements, of any dimension.
        element_sets: Sets of elements. Sets of the body become regions, sets of its
            sides become parts of the boundary.
        facet_sets: Sets of sides of cells.
        node_sets: Sets of nodes. The sides all of whose corners are in a set become a
            part.
        left_out: Kind of elements that are no solids -> their number.
        values: Name of a vector at the points -> its values, shape (n, 3).
        notes: What reading has changed, in words.
        time: Time of the values [time]; None if the file does not tell it.
    """

    points: np.ndarray
    blocks: tuple[Block, ...]
    element_sets: tuple[ElementSet, ...] = ()
    facet_sets: tuple[FacetSet, ...] = ()
    node_sets: tuple[NodeSet, ...] = ()
    left_out: Mapping[str, int] = field(default_factory=dict)
    values: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    time: float | None = None

    @property
    def dim(self) -> int:
        """Return the dimension of its body, the greatest of its elements."""
        return max((block.dim for block in self.blocks if len(block.nodes)), default=0)


def pad(corners: np.ndarray) -> np.ndarray:
    """Return corners of facets in 3D with four columns, of edges as they are.

    A triangle has its last corner twice.
    """
    missing = 1 if corners.shape[1] == 3 else 0
    return np.hstack([corners, np.repeat(corners[:, -1:], missing, axis=1)])


def members_of(names: Sequence[np.ndarray], wanted: np.ndarray) -> dict[int, np.ndarray]:
    """Return the members of a set of elements, numbers of a block -> numbers in it.

    Args:
        names: Number or name of each element of each block.
        wanted: Numbers or names of the members; what no element has is left out.
    """
    members = {}
    for block, of_block in enumerate(names):
        found = np.flatnonzero(np.isin(of_block, wanted))
        if len(found):
            members[block] = found
    return members


def by_tags(
    blocks: tuple[Block, ...], tags: list[np.ndarray], names: Mapping[tuple[int, int], str]
) -> tuple[ElementSet, ...]:
    """Return the set of elements of each dimension and tag, in this order.

    Args:
        blocks: The elements.
        tags: Tag of each element of each block. The sign of a tag tells an orientation,
            which plays no role.
        names: Name of each pair (dimension, tag). A set without a name is called by its
            tag.
    """
    found: dict[tuple[int, int], dict[int, np.ndarray]] = {}
    for number, (block, signed) in enumerate(zip(blocks, tags, strict=True)):
        block_tags = abs(np.asarray(signed))
        for tag in np.unique(block_tags):
            members = np.flatnonzero(block_tags == tag)
            found.setdefault((block.dim, int(tag)), {})[number] = members
    sets = []
    for (dim, tag), members_of in sorted(found.items(), key=lambda item: item[0]):
        sets.append(ElementSet(names.get((dim, tag), str(tag)), members_of, tag))
    return tuple(sets)
