"""Write two runs side by side as one page of HTML."""

from __future__ import annotations

from io import BytesIO
from math import nan
from pathlib import Path
from typing import cast

from erc_contact.base.code import code_of
from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.runs import AdaptiveRun, Run
from erc_contact.output.curves import plot_history
from erc_contact.output.gathered import letters_of
from erc_contact.output.report import figure_of, page_of_sections, paragraph, view_figure, wide
from erc_contact.scene.words import in_words
from namedmesh.base.html import table
from namedmesh.pictures import DPI, on_root


def compare(
    first: Run, second: Run, path: str | Path, names: tuple[str, str] = ("first", "second")
) -> None:
    """Write two runs side by side as one page of HTML; collective.

    It has what differs in scene and settings, the numbers of both with their
    differences, the curves of adaptive runs, and both bodies in 3D. The page needs
    nothing else.

    Args:
        first: A history or an evolution.
        second: Another one, on the same ranks.
        path: The file.
        names: What the page calls them.

    Raises:
        InputError: If one of them is no run with its results.

    Example:
        >>> ec.output.compare(coarse, fine, "results/two.html", ("coarse", "fine"))
    """
    runs = (first, second)
    for run in runs:
        if not isinstance(getattr(run, "error", None), ConstitutiveError):
            raise InputError(
                f"compare: {type(run).__name__} is no run with its results; give two histories or "
                "evolutions, as adapt() and evolve() return them."
            )
    comm = first.error.domain.comm
    numbers = [_numbers_of(run) for run in runs]
    views = [run.error.show() for run in runs]
    adaptive: dict[str, AdaptiveRun] = {}
    for name, run in zip(names, runs, strict=True):
        if hasattr(run, "slope"):
            adaptive[name] = cast("AdaptiveRun", run)
    axes = plot_history(adaptive) if adaptive else None

    def write() -> None:
        outcomes = [f"{name}: {run.outcome}" for name, run in zip(names, runs, strict=True)]
        sections = {"": "".join(paragraph(outcome) for outcome in outcomes)}
        different = _different(*map(_words_of, runs))
        same = paragraph("Scene and settings are the same.")
        found = wide(table(different, ("part or setting", *names)))
        sections["What differs"] = found if different else same
        rows = _side_by_side(*numbers)
        sections["Numbers"] = wide(table(rows, ("", *names, "difference")), "numbers")
        figures = ""
        for name, view in zip(names, views, strict=True):
            figures += view_figure(view.page, name)
        sections["Bodies"] = f'<div class="pair">{figures}</div>'
        if axes is not None:
            picture = BytesIO()
            axes[0].figure.savefig(picture, dpi=DPI, bbox_inches="tight")
            words = "Error against run time and against unknowns."
            sections["Errors"] = figure_of(picture.getvalue(), words)
        Path(path).write_text(page_of_sections(f"{names[0]} and {names[1]}", sections))

    on_root(comm, path, write)


def _numbers_of(run: Run) -> dict[str, float]:
    """Return the numbers of a run by their names; collective."""
    error = run.error
    space = error.model.space
    numbers = {
        "steps": len(run.steps),
        "cells": error.domain.cells,
        "unknowns": space.V.dofmap.index_map.size_global * space.d,
        "error [%]": 100 * error.total,
        "e [sqrt(force length)]": error.absolute,
        "seconds": run.steps[-1].seconds,
        "greatest displacement [length]": error.maximum("displacement").value,
        "greatest von Mises stress [force/area]": error.maximum("von Mises").value,
    }
    if error.model.contacts:
        numbers["greatest pressure [force/area]"] = error.maximum("pressure").value
    letters = letters_of(space)
    for cause, force in error.reactions().items():
        if cause != "balance":
            for letter, component in zip(letters, force.force, strict=False):
                numbers[f"force of {cause} along {letter} [force]"] = float(component)
    return {run.error.solution.scene.label(name): number for name, number in numbers.items()}


def _words_of(run: Run) -> dict[str, str]:
    """Return scene and settings of a run in words."""
    words: dict[str, str] = {}
    for part, about in in_words(run.error.solution.scene):
        words[part] = f"{words[part]}; {about}" if part in words else about
    settings = {"accuracy": run.accuracy, **run.settings}
    return words | {name: code_of(value) for name, value in settings.items()}


def _different(first: dict[str, str], second: dict[str, str]) -> list[tuple[str, str, str]]:
    """Return the entries that differ, with "-" where a run has none."""
    rows = [(name, first.get(name, "-"), second.get(name, "-")) for name in first | second]
    return [row for row in rows if row[1] != row[2]]


def _side_by_side(
    first: dict[str, float], second: dict[str, float]
) -> list[tuple[str, str, str, str]]:
    """Return the rows of numbers, with their differences over the first number.

    A number that a run does not have is nan.
    """
    rows = []
    for name in first | second:
        old, new = first.get(name, nan), second.get(name, nan)
        is_told = old != 0 and f"{old:.6g}" != f"{new:.6g}"
        difference = f"{100 * (new - old) / abs(old):+.3g}%" if is_told else ""
        rows.append((name, f"{old:.6g}", f"{new:.6g}", difference.replace("+nan%", "")))
    return rows
