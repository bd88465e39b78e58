"""Columns of the tables that runs print, and show in notebooks and reports."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Column:
    """Hold a column of a table.

    Attributes:
        name: Its name in printed tables; empty where these leave it out.
        title: Its name in notebooks and reports; empty where these leave it out.
        width: Its width in printed tables.
        text: Gives its entry in a row.
        needs: What a scene must have for the column to mean something; empty for all
            scenes.
    """

    name: str
    title: str
    width: int
    text: Callable[[Any], str]
    needs: str = ""


def header(columns: Iterable[Column]) -> str:
    """Write the header of a printed table."""
    return " ".join(f"{column.name:>{column.width}}" for column in columns if column.name)


def line(columns: Iterable[Column], row: Any) -> str:
    """Write a row of a printed table."""
    entries = []
    for column in columns:
        if column.name:
            entries.append(f"{column.text(row):>{column.width}}")
    return " ".join(entries)


def page_rows(columns: Iterable[Column], rows: Sequence[Any]) -> tuple[list[str], list[list[str]]]:
    """Return the titles and the rows of a table in notebooks and reports."""
    shown = [column for column in columns if column.title]
    titles = [column.title for column in shown]
    return titles, [[column.text(row) for column in shown] for row in rows]
