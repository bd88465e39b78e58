"""Check what a level file holds before anything is made of it.

The checksum of a file tells that it is what somebody wrote, not who. DOLFINx ends the
program where the numbers of a mesh have no sense, so they are checked here.

Symbols: d dimension, n number of nodes, c number of cells, N nodes of a cell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from math import comb
from numbers import Real
from typing import Any

import numpy as np

from erc_contact.run.step import Step
from erc_contact.run.time_row import TimeStep
from namedmesh.for_solvers import Interface
from namedmesh.simplex import determinants
from namedmesh.tables import geometry_of

ERROR_NUMBERS = (
    "absolute",
    "scale",
    "bulk_error",
    "contact_error",
    "geometry_error",
    "relative",
    "total",
    "degree",
)
"""Numbers of an error that are kept."""
MOST_TAGS = 2**31
"""Tags and numbers of entities are less."""
DIFFERENT_CORNERS = 1e-30
"""Volume of a cell that is none, by the largest cell [-]."""


def check_contents(about: Any, tables: Mapping[str, np.ndarray]) -> None:
    """Check the plain data and the tables of a level.

    Raises:
        ValueError: If something is not as it was written, or another error of Python's
            if it is not there.
    """
    _check_rows(about["rows"])
    error = about["error"]
    numbers = [about["accuracy"], *(error[name] for name in ERROR_NUMBERS)]
    _demand(all(_is_real(number) for number in numbers), "numbers of the error")
    _demand(isinstance(about["method"], str), "the method")
    _demand(isinstance(about.get("carried", {}), dict), "what is carried on")
    _demand(isinstance(about.get("shifts", {}), dict), "the shifts")
    _demand(about["degree"] in (1, 2), "the degree")
    _check_mesh(about, tables, about["degree"])
    _check_fields(about, tables)


def check_domain(about: Any, tables: Mapping[str, np.ndarray]) -> None:
    """Check what is told of a mesh alone, as :func:`check_contents`."""
    _check_mesh(about, tables, 1)


def _check_mesh(about: Any, tables: Mapping[str, np.ndarray], degree: int) -> None:
    """Check names, shape and tables of a mesh with the nodes of a degree."""
    for key in ("names", "regions"):
        _check_names(about[key])
    for plain in about["interfaces"]:
        _check_interface(Interface.of(plain))
    geometry_of(about["geometry"])
    _check_cells(about, tables, degree)


def _demand(condition: object, what: str) -> None:
    """Raise an error about a part of the contents if a condition is not met."""
    if not condition:
        raise ValueError(f"{what} make no sense")


def _is_real(number: Any) -> bool:
    """Tell whether something is a number of Python."""
    return isinstance(number, Real) and not isinstance(number, bool)


def _check_rows(rows: Any) -> None:
    """Check the rows of the run."""
    _demand(isinstance(rows, list) and rows, "the rows")
    for row in rows:
        if "time" in row:
            TimeStep(**row)
            continue
        Step(**row)
        for column in fields(Step):
            value = row.get(column.name, 0)
            expected = isinstance(value, str) if column.name == "method" else _is_real(value)
            _demand(expected, f"entries {column.name!r} of the rows")


def _check_names(names: Any) -> None:
    """Check names with their tags."""
    for name, tag in names.items():
        name.encode()
        _demand(type(tag) is int and abs(tag) < MOST_TAGS, f"the tag of {name!r}")


def _check_interface(interface: Interface) -> None:
    """Check where a mesh is split."""
    names = interface.names
    _demand(len(names) == 2 and all(isinstance(name, str) for name in names), "names of a pair")
    tags = [*interface.tags, *([] if interface.on is None else [interface.on])]
    for of_side in interface.regions:
        tags += of_side if isinstance(of_side, tuple) else [of_side]
    _demand(len(interface.tags) == 2 and all(type(tag) is int for tag in tags), "tags of a pair")


def _check_cells(about: Mapping[str, Any], tables: Mapping[str, np.ndarray], degree: int) -> None:
    """Check the tables of the mesh."""
    d = about["dim"]
    _demand(d in (2, 3), "the dimension")
    points = tables["VTKHDF/Points"]
    cells = tables["cells"]
    n, c = len(points), len(cells)
    _demand(c, "the cells")
    _check_floats(points, (n, 3), "the points")
    _check_numbers(cells, (c, comb(d + degree, d)), n, "the cells")
    corners = cells[:, : d + 1]
    _check_corners(corners, "the cells")
    volumes = abs(determinants(points[corners][..., :d]))
    _demand(volumes.min() > DIFFERENT_CORNERS * volumes.max(), "the cells")
    tags = about["tags"]
    shapes = {"facets": (c, d + 1), "curved": (c, d + 1), "regions": (c,)}
    for name in tags:
        if name in shapes:
            _check_tags(tables[name], shapes[name], name)
    _demand(("facets" in tags and "closed" not in tags) or "glued" in tags, "the tags")
    if "glued" in tags:
        _check_numbers(tables["glued"], (c, d + 1), c * (d + 1), "the joined cells")
        _check_corners(tables["glued"], "the joined cells")
    if "closed" in tags:
        _check_floats(tables["closed"], (c, (d + 1) * d), "the corners")


def _check_fields(about: Mapping[str, Any], tables: Mapping[str, np.ndarray]) -> None:
    """Check the tables of the solution on a mesh that was checked."""
    d = about["dim"]
    n = len(tables["VTKHDF/Points"])
    c = len(tables["cells"])
    _check_floats(tables["VTKHDF/CellData/eps_E"], (c,), "the shares of the error")
    count = about["multipliers"]
    _demand(type(count) is int and 0 <= count < c, "the multipliers")
    for name in ("u", *(f"multipliers/{number}" for number in range(count))):
        _check_floats(tables[name], (n, d), "the fields")


def _check_floats(table: np.ndarray, shape: tuple[int, ...], what: str) -> None:
    """Check that a table has finite numbers of a shape."""
    _demand(table.shape == shape and table.dtype.kind == "f", what)
    _demand(np.isfinite(table).all(), what)


def _check_numbers(table: np.ndarray, shape: tuple[int, ...], end: int, what: str) -> None:
    """Check that a table has whole numbers from 0 to less than an end."""
    _demand(table.shape == shape and table.dtype.kind in "iu", what)
    _demand(table.min() >= 0 and table.max() < end, what)


def _check_corners(corners: np.ndarray, what: str) -> None:
    """Check that the corners of each cell differ."""
    _demand((np.diff(np.sort(corners, axis=1), axis=1) > 0).all(), what)


def _check_tags(table: np.ndarray, shape: tuple[int, ...], what: str) -> None:
    """Check that a table has tags."""
    _demand(table.shape == shape and table.dtype.kind in "iu", what)
    _demand(abs(table).max() < MOST_TAGS, what)
