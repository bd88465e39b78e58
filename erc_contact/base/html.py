"""Tables in HTML, for notebooks and reports."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def table(
    rows: Iterable[Sequence[object]], header: Sequence[object] = (), caption: str = ""
) -> str:
    """A table; all entries are text, and the first one of a row names it.

    Args:
        rows: Its rows.
        header: Names of the columns.
        caption: What is above it.
    """
    head = (
        f"<thead><tr>{''.join(f'<th>{escape(str(name))}</th>' for name in header)}</tr></thead>"
        if header
        else ""
    )
    lines = "".join(
        f"<tr><th>{escape(str(first))}</th>{''.join(f'<td>{escape(str(entry))}</td>' for entry in rest)}</tr>"
        for first, *rest in rows
    )
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{title}{head}<tbody>{lines}</tbody></table>"
