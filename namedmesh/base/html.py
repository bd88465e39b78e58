"""Tables: in HTML for notebooks and reports, as text for terminals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def table(
    rows: Iterable[Sequence[object]], header: Sequence[object] = (), caption: str = ""
) -> str:
    """Return a table; all entries are text, and the first one of a row names it.

    Args:
        rows: Its rows.
        header: Names of the columns.
        caption: Text above it.
    """
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    head = ""
    if header:
        names = "".join(f"<th>{escape(str(name))}</th>" for name in header)
        head = f"<thead><tr>{names}</tr></thead>"
    body = ""
    for name, *entries in rows:
        cells = "".join(f"<td>{escape(str(entry))}</td>" for entry in entries)
        body += f"<tr><th>{escape(str(name))}</th>{cells}</tr>"
    return f"<table>{title}{head}<tbody>{body}</tbody></table>"


def in_columns(rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """Write a table as text.

    Args:
        rows: Its rows, the header first.
        numbers: Columns that end at the right, as numbers do.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = []
        for column, (cell, width) in enumerate(zip(row, widths, strict=True)):
            cells.append(cell.rjust(width) if column in numbers else cell.ljust(width))
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
