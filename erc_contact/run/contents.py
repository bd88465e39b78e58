"""Check what a level file holds before anything is made of it.

The rows of the run and the fields are checked here, the mesh by
:func:`namedmesh.keeping.domain_file.check_domain`.

Symbols: d dimension, n number of nodes, c number of cells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from numbers import Real
from typing import Any

import numpy as np

from erc_contact.run.step import Step
from erc_contact.run.time_row import TimeStep
from namedmesh.keeping import check_domain, check_floats, demand

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


def check_contents(about: Any, tables: Mapping[str, np.ndarray]) -> None:
    """Check the plain data and the tables of a level.

    Raises:
        ValueError: If something is not as it was written, or another error of Python's
            if it is not there.
    """
    _check_rows(about["rows"])
    error = about["error"]
    numbers = [about["accuracy"], *(error[name] for name in ERROR_NUMBERS)]
    demand(all(_is_real(number) for number in numbers), "numbers of the error")
    demand(isinstance(about["method"], str), "the method")
    demand(isinstance(about.get("carried", {}), dict), "what is carried on")
    demand(isinstance(about.get("shifts", {}), dict), "the shifts")
    demand(about["degree"] in (1, 2), "the degree")
    check_domain(about, tables, about["degree"])
    _check_fields(about, tables)


def _is_real(number: Any) -> bool:
    """Tell whether something is a number of Python."""
    return isinstance(number, Real) and not isinstance(number, bool)


def _check_rows(rows: Any) -> None:
    """Check the rows of the run."""
    demand(isinstance(rows, list) and rows, "the rows")
    for row in rows:
        if "time" in row:
            TimeStep(**row)
            continue
        Step(**row)
        for column in fields(Step):
            value = row.get(column.name, 0)
            expected = isinstance(value, str) if column.name == "method" else _is_real(value)
            demand(expected, f"entries {column.name!r} of the rows")


def _check_fields(about: Mapping[str, Any], tables: Mapping[str, np.ndarray]) -> None:
    """Check the tables of the solution on a mesh that was checked."""
    d = about["dim"]
    n = len(tables["VTKHDF/Points"])
    c = len(tables["cells"])
    check_floats(tables["VTKHDF/CellData/eps_E"], (c,), "the shares of the error")
    count = about["multipliers"]
    demand(type(count) is int and 0 <= count < c, "the multipliers")
    for name in ("u", *(f"multipliers/{number}" for number in range(count))):
        check_floats(tables[name], (n, d), "the fields")
