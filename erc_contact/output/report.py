"""The report of a run: one page of HTML that holds all it shows, and links to nothing; and the run as plain data."""

from __future__ import annotations

import struct
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from html import escape
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

from erc_contact.base.code import code_of, definitions, without_paths
from erc_contact.base.html import table
from erc_contact.base.percent import percent
from erc_contact.base.versions import machine, versions
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.domain import Domain, shape_in_words
from erc_contact.model.forces import Force
from erc_contact.output.files import on_root
from erc_contact.scene.scene import Scene
from erc_contact.scene.words import in_words

STYLE = """
body { font: 16px/1.5 Georgia, serif; color: #1a1a1a; background: white; max-width: 62rem; margin: auto;
  padding: 0 1rem 3rem; overflow-wrap: break-word; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 1.5rem 0 0.3rem; } h2 { font-size: 1.25rem; margin: 2.2rem 0 0.5rem; }
img { max-width: 100%; max-height: 42rem; display: block; margin: 0.5rem auto; } figure { margin: 1rem 0; }
.broad img { max-width: none; width: 100%; min-width: 34rem; }
figcaption { font-size: 0.9rem; color: #444; } .wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.2rem 0.7rem 0.2rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid #ddd; }
th { font-weight: normal; } thead th { color: #555; } .numbers td, .numbers thead th + th { text-align: right; }
.numbers td { white-space: nowrap; } .verdict th { font-weight: bold; min-width: 5rem; }
pre { background: #f5f5f5; padding: 0.8rem; overflow-x: auto; font-size: 0.85rem; line-height: 1.35; }
"""
COLUMNS = ("mesh", "cells", "unknowns", "Newton", "eps", "bulk", "contact", "geometry", "method", "seconds")
"""Columns of the table of meshes."""
NUMBERS = ("relative", "total", "absolute", "scale", "bulk_error", "contact_error", "geometry_error", "degree")
"""Numbers of the best error in the data."""
BROAD = 1.3
"""Width over height of a picture that a narrow screen shows part by part [-]."""


class Run(Protocol):
    """An adaptive run, as far as it is reported. A ``History`` has these members."""

    @property
    def steps(self) -> Sequence[Any]:
        """The rows of its table."""

    @property
    def accuracy(self) -> float:
        """The prescribed relative error."""

    @property
    def reached(self) -> bool:
        """Whether it was reached."""

    @property
    def outcome(self) -> str:
        """Why it ended."""

    @property
    def best(self) -> ConstitutiveError:
        """The best result."""

    @property
    def meshes(self) -> tuple[tuple[Domain, Any], ...]:
        """Domain and eps_E of its meshes."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """The arguments of the run by their names."""


def write_report(
    run: Run,
    path: str | Path,
    claims: Sequence[tuple[str, str]],
    forces: Mapping[str, Force],
    pictures: Mapping[str, str],
) -> None:
    """Write the report of a run; collective.

    It says what was asked, what is proved and what is not, and shows the pictures. It has neither the name of the
    machine nor a path.

    Args:
        run: The run.
        path: The file, in the folder of the pictures.
        claims: What the error proves and what not, see :func:`erc_contact.output.verdict.verdict`.
        forces: Forces on the body by their cause, see :func:`erc_contact.results.reactions`; the same on all ranks.
        pictures: Names of the picture files in the folder, and what they show.
    """
    file = Path(path)

    def write() -> None:
        shown = "".join(_figure(file.parent / name, words) for name, words in pictures.items())
        file.write_text(_page(run, claims, forces, shown))

    on_root(run.best.domain.mesh.comm, path, write)


def _page(run: Run, claims: Sequence[tuple[str, str]], forces: Mapping[str, Force], pictures: str) -> str:
    """The page; ``pictures`` is HTML."""
    title = f"Relative error {percent(run.best.total)}, asked for {percent(run.accuracy)}"
    sections = {"": _paragraph(without_paths(run.outcome))}
    scene = run.best.solution.scene if isinstance(run.best, ConstitutiveError) else None  # one that is read has none
    if claims:
        sections["What the number means"] = _wide(table(claims), "verdict")
    if scene:
        sections["Scene"] = _wide(table(in_words(scene), ("part", "what holds there")))
    sections["Meshes"] = _wide(table(map(_row, enumerate(run.steps, start=1)), COLUMNS), "numbers")
    sections["Pictures"] = pictures
    if forces:
        sections["Forces on the body"] = _forces(forces)
    if scene:
        sections["How to reproduce it"] = f"<pre>{escape(_script(run, scene))}</pre>"
    made = {**versions(), **machine(), "ranks": str(run.best.domain.mesh.comm.size)}
    sections["Software and machine"] = _wide(table(made.items()))
    body = "".join(f"<h2>{escape(name)}</h2>{text}" if name else text for name, text in sections.items())
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n"
        f"<body><h1>{escape(title)}</h1>{body}</body></html>\n"
    )


def _paragraph(text: str) -> str:
    return f"<p>{escape(text)}</p>"


def _wide(text: str, kind: str = "") -> str:
    """Something that scrolls by itself where the screen is narrow."""
    return f'<div class="wide {kind}">{text}</div>'


def _row(numbered: tuple[int, Any]) -> list[str]:
    """A row of the table of meshes."""
    number, step = numbered
    errors = [percent(one, 3) for one in (step.eps, step.eps_bulk, step.eps_contact, step.eps_geometry)]
    counts = [str(one) for one in (number, step.cells, step.dofs, step.newton_steps)]
    return [*counts, *errors, step.method, f"{step.seconds:.2f}"]


def _figure(file: Path, words: str) -> str:
    """A picture inside the page; one that is broad scrolls where the screen is narrow."""
    content = file.read_bytes()
    width, height = struct.unpack(">II", content[16:24])  # of a png file
    image = f'<img src="data:image/png;base64,{b64encode(content).decode()}" alt="{escape(words)}">'
    shown = _wide(image, "broad" if width > BROAD * height else "")
    return f"<figure>{shown}<figcaption>{escape(words)}</figcaption></figure>"


def _forces(forces: Mapping[str, Force]) -> str:
    first = next(iter(forces.values()))
    header = ["cause", *(f"F{axis}" for axis in "xyz"[: len(first.force)])]
    header += [f"M{axis}" for axis in "xyz"[-len(first.moment) :]]
    rows = [[name, *(f"{c:.6g}" for c in (*of.force, *of.moment))] for name, of in forces.items()]
    words = "Resultants and moments about the origin of the admissible stress. The balance is zero up to round-off."
    return _paragraph(words) + _wide(table(rows, header), "numbers")


def _script(run: Run, scene: Scene) -> str:
    """The scene and the run as code."""
    lists = [f"    material={code_of(scene.material)},"]
    for name in ("supports", "loads", "contacts"):
        entries = "".join(f"        {code_of(one)},\n" for one in getattr(scene, name))
        lists += [f"    {name}=[\n{entries}    ],"] if entries else []
    domain, given = run.meshes[0][0], "".join(f"    {name}={code_of(one)},\n" for name, one in run.settings.items())
    facts = f"{domain.cells} cells and {domain.vertices} vertices; parts {', '.join(domain.names)}"
    return "\n".join(
        [
            "import ufl\n\nimport erc_contact as ec\n",
            *definitions(scene),
            "scene = ec.Scene(",
            *lists,
            ")",
            f"# domain: {shape_in_words(domain)}; the first mesh has {facts}",
            f"history = ec.adapt(\n    scene,\n    domain,\n    accuracy={run.accuracy!r},\n{given})",
        ]
    )


def record(run: Run, forces: Mapping[str, Force]) -> dict[str, Any]:
    """The rows of a run, its best error, forces on the body, settings and software; numbers that are none are None."""
    error = {name: getattr(run.best, name) for name in NUMBERS}
    if isinstance(run.best, ConstitutiveError):  # one that is read from a folder has no more
        error["oscillations"] = asdict(run.best.oscillations)
    return _plain(
        {
            "outcome": run.outcome,
            "reached": run.reached,
            "accuracy": run.accuracy,
            "error": error,
            "forces": {name: {"force": of.force.tolist(), "moment": of.moment.tolist()} for name, of in forces.items()},
            "steps": [asdict(step) for step in run.steps],
            "settings": {name: code_of(one) for name, one in run.settings.items()},
            "versions": versions(),
            "machine": {**machine(), "ranks": run.best.domain.mesh.comm.size},
        }
    )


def _plain(value: Any) -> Any:
    """Data without nan and infinity, which JSON does not know."""
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not isfinite(value) else value
