"""Check what the file of a mesh holds before anything is made of it.

The checksum of a file tells that it is what somebody wrote, not who. DOLFINx ends the
program where the numbers of a mesh have no sense, so they are checked here.

Symbols: d dimension, n number of nodes, c number of cells, N nodes of a cell.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import comb
from typing import Any

import numpy as np

from namedmesh.interface_map import Interface
from namedmesh.simplex import determinants

MOST_TAGS = 2**31
"""Tags and numbers of entities are less."""
DIFFERENT_CORNERS = 1e-30
"""Volume of a cell that is none, by the largest cell [-]."""


def check_mesh(about: Any, tables: Mapping[str, np.ndarray], degree: int) -> None:
    """Check names, interfaces and tables of a mesh with the nodes of a degree."""
    for key in ("names", "regions"):
        _check_names(about[key])
    for plain in about["interfaces"]:
        _check_interface(Interface.of(plain))
    _check_cells(about, tables, degree)


def demand(condition: object, what: str) -> None:
    """Raise an error about a part of the contents if a condition is not met."""
    if not condition:
        raise ValueError(f"{what} make no sense")


def _check_names(names: Any) -> None:
    """Check names with their tags."""
    for name, tag in names.items():
        name.encode()
        demand(type(tag) is int and abs(tag) < MOST_TAGS, f"the tag of {name!r}")


def _check_interface(interface: Interface) -> None:
    """Check where a mesh is split."""
    names = interface.names
    demand(len(names) == 2 and all(isinstance(name, str) for name in names), "names of a pair")
    tags = [*interface.tags, *([] if interface.on is None else [interface.on])]
    for of_side in interface.regions:
        tags += of_side if isinstance(of_side, tuple) else [of_side]
    demand(len(interface.tags) == 2 and all(type(tag) is int for tag in tags), "tags of a pair")


def _check_cells(about: Mapping[str, Any], tables: Mapping[str, np.ndarray], degree: int) -> None:
    """Check the tables of the mesh."""
    d = about["dim"]
    demand(d in (2, 3), "the dimension")
    points = tables["VTKHDF/Points"]
    cells = tables["cells"]
    n, c = len(points), len(cells)
    demand(c, "the cells")
    check_floats(points, (n, 3), "the points")
    _check_numbers(cells, (c, comb(d + degree, d)), n, "the cells")
    corners = cells[:, : d + 1]
    _check_corners(corners, "the cells")
    volumes = abs(determinants(points[corners][..., :d]))
    demand(volumes.min() > DIFFERENT_CORNERS * volumes.max(), "the cells")
    tags = about["tags"]
    shapes = {"facets": (c, d + 1), "curved": (c, d + 1), "regions": (c,)}
    for name in tags:
        if name in shapes:
            _check_tags(tables[name], shapes[name], name)
    demand(("facets" in tags and "closed" not in tags) or "glued" in tags, "the tags")
    if "glued" in tags:
        _check_numbers(tables["glued"], (c, d + 1), c * (d + 1), "the joined cells")
        _check_corners(tables["glued"], "the joined cells")
    if "closed" in tags:
        check_floats(tables["closed"], (c, (d + 1) * d), "the corners")


def check_floats(table: np.ndarray, shape: tuple[int, ...], what: str) -> None:
    """Check that a table has finite numbers of a shape."""
    demand(table.shape == shape and table.dtype.kind == "f", what)
    demand(np.isfinite(table).all(), what)


def _check_numbers(table: np.ndarray, shape: tuple[int, ...], end: int, what: str) -> None:
    """Check that a table has whole numbers from 0 to less than an end."""
    demand(table.shape == shape and table.dtype.kind in "iu", what)
    demand(table.min() >= 0 and table.max() < end, what)


def _check_corners(corners: np.ndarray, what: str) -> None:
    """Check that the corners of each cell differ."""
    demand((np.diff(np.sort(corners, axis=1), axis=1) > 0).all(), what)


def _check_tags(table: np.ndarray, shape: tuple[int, ...], what: str) -> None:
    """Check that a table has tags."""
    demand(table.shape == shape and table.dtype.kind in "iu", what)
    demand(abs(table).max() < MOST_TAGS, what)
