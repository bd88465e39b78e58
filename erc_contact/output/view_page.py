"""Write steps of a body as a page of HTML that turns it, and needs nothing else.

The page holds triangles, and some hundred lines that draw them in a browser with WebGL
2; it reads no library and asks no server. Each triangle has a colour of its own, the
value of its element or of its facet of a contact.
"""

from __future__ import annotations

import json
import zlib
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.output.gallery import Gallery

MOST_BYTES = 2_200_000
"""Size of the data of a view [bytes]; written as text it is a third larger."""
COMPRESSION = 6
"""Level of compression of the data."""
PLACES = 65535
"""Number of places along the longest side of the box of a view."""
LEVELS = 254
"""Number of colours; beside them is grey, for what has no value."""
LEAST_SHARE = 1e-4
"""Least share of the greatest error of an element that has a colour of its own [-]."""
VIEW_FILE = "view.html"
"""Name of the file of a view in the folder of a run."""
VIEW_WORDS = "The deformed body, to turn: its stress, its error and the pressure of its contacts."
"""What a view shows."""


@dataclass(frozen=True)
class View:
    """Hold a page of HTML that shows a body; a notebook shows it by itself.

    Attributes:
        page: The page; empty on all ranks but rank 0.

    Example:
        >>> view = error.show()
        >>> view.save("results/view.html")
    """

    page: str = field(repr=False)

    def _repr_html_(self) -> str:
        """Return the page in a frame of a notebook."""
        return in_frame(self.page, "A body in 3D", "width: 100%; height: 30rem; border: 0")

    def save(self, path: str | Path) -> None:
        """Write the page; every rank may call, rank 0 writes."""
        if self.page:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            Path(path).write_text(self.page)


def in_frame(page: str, title: str, style: str = "") -> str:
    """Return a page as a part of another page, which has it inside."""
    look = f' style="{style}"' if style else ""
    return f'<iframe title="{escape(title)}"{look} srcdoc="{escape(page)}"></iframe>'


def add_view(gallery: Gallery, error: Any, code: str) -> None:
    """Add the view of an error to a gallery; collective.

    Args:
        gallery: The gallery.
        error: The error.
        code: The error as a user writes it.
    """

    def write(path: Path) -> None:
        error.show().save(path)

    line = f'{code}.show().save("{VIEW_FILE}")'
    gallery.add(VIEW_FILE, VIEW_WORDS, line, write, is_body=True)


@dataclass(frozen=True, eq=False)
class Colours:
    """Hold the values that colour a body, for all its steps.

    Attributes:
        label: Their name and unit.
        logarithmic: Whether their scale is logarithmic.
        of_contacts: Whether they are of facets of contacts, and not of elements.
        most: Greatest value that has a colour of its own.
    """

    label: str
    logarithmic: bool = False
    of_contacts: bool = False
    most: float = np.inf

    def levels(self, steps: Sequence[np.ndarray]) -> tuple[list[np.ndarray], str, str]:
        """Return numbers of colours from 1 on, and the ends of the scale in words."""
        known = np.concatenate([values[np.isfinite(values)] for values in steps])
        greatest = float(known.max(initial=0.0))
        high = min(greatest, self.most)
        low = 0.0
        if self.logarithmic and high > 0:
            low = max(float(known.min()), LEAST_SHARE * high)
        numbers = []
        for values in steps:
            share = np.clip(values, low, high or 1.0)
            if self.logarithmic and 0 < low < high:
                share = np.log(share / low) / np.log(high / low)
            else:
                share = (share - low) / ((high - low) or 1.0)
            numbers.append(np.nan_to_num(1 + np.round(LEVELS * share)).astype(np.uint8))
        more = "≥ " if high < greatest else ""
        less = "≤ " if low > known.min(initial=low) else ""
        return numbers, f"{less}{low:.3g}", f"{more}{high:.3g}"


@dataclass(frozen=True, eq=False)
class ShownStep:
    """Hold a body as it is drawn at one time; on rank 0.

    Attributes:
        x: Corners of all triangles as they are drawn [length], shape (n, 3).
        triangles: Numbers of their corners, shape (m, 3): the triangles of the body,
            and behind them those of contacts.
        body: Number of the triangles of the body.
        values: Values of all triangles by their names; nan where there is none.
        words: Words about the step.
    """

    x: np.ndarray
    triangles: np.ndarray
    body: int
    values: dict[str, np.ndarray]
    words: str

    def bytes_after(self, before: ShownStep | None) -> int:
        """Return the size of its data after another step, which may have its mesh."""
        has_mesh = before is not None and np.array_equal(self.triangles, before.triangles)
        mesh = 0 if has_mesh else 4 * self.triangles.size
        return mesh + 2 * self.x.size + len(self.values) * len(self.triangles)


def that_fit(steps: Sequence[ShownStep]) -> list[ShownStep]:
    """Choose the steps of a view by their size: evenly, and with the last step.

    Raises:
        InputError: If not even the last step fits.
    """
    for stride in range(1, len(steps) + 1):
        chosen = list(reversed(steps[::-stride]))
        before = [None, *chosen[:-1]]
        size = sum(step.bytes_after(last) for step, last in zip(chosen, before, strict=True))
        if size <= MOST_BYTES:
            return chosen
    raise InputError(
        f"A view of {len(steps[-1].triangles)} triangles is too large for a page: its data have "
        f"{size / 1e6:.1f} MB of {MOST_BYTES / 1e6:.1f} MB. draw_deformed and ParaView show it."
    )


def page_of(
    steps: Sequence[ShownStep], colours: Mapping[str, Colours], axes: np.ndarray, words: str
) -> str:
    """Return the page of steps.

    Args:
        steps: The steps.
        colours: Kinds of their values, by their names.
        axes: Rows that point to the right, upward, and towards the eye, shape (3, 3).
        words: Words below the body.
    """
    lows = np.min([step.x.min(axis=0) for step in steps], axis=0)
    sides = np.max([step.x.max(axis=0) for step in steps], axis=0) - lows
    meshes: list[ShownStep] = []
    places = []
    for step in steps:
        if not meshes or not np.array_equal(step.triangles, meshes[-1].triangles):
            meshes.append(step)
        places.append(len(meshes) - 1)
    packed = [step.triangles.astype("<u4") for step in meshes]
    packed += [np.round(PLACES * (step.x - lows) / sides.max()).astype("<u2") for step in steps]
    fields = []
    numbers = []
    for name, colour in colours.items():
        of_steps, low, high = colour.levels([step.values[name] for step in steps])
        label = f"{colour.label}, log scale" if colour.logarithmic else colour.label
        fields.append({"label": label, "contacts": colour.of_contacts, "low": low, "high": high})
        numbers.append(of_steps)
    # The colours of a step stand together, field by field.
    packed += [levels for of_step in zip(*numbers, strict=True) for levels in of_step]
    data = zlib.compress(b"".join(array.tobytes() for array in packed), COMPRESSION)
    # The body fits in a ball of radius 1.
    unit = 2 / float(np.linalg.norm(sides))
    head = {
        "view": axes.tolist(),
        "words": words,
        "unit": unit * float(sides.max()) / PLACES,
        "middle": (0.5 * unit * sides).tolist(),
        "meshes": [{"triangles": len(step.triangles), "body": step.body} for step in meshes],
        "frames": [
            {"mesh": mesh, "points": len(step.x), "words": step.words}
            for mesh, step in zip(places, steps, strict=True)
        ],
        "fields": fields,
        "packed": b64encode(data).decode(),
    }
    template = resources.files("erc_contact.output").joinpath("view.html").read_text()
    page = template.replace("TITLE", VIEW_WORDS)
    # Of all text only this could end the element that holds the data.
    return page.replace("DATA", json.dumps(head).replace("</", "<\\/"))
