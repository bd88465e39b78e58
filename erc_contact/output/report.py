"""Write the report of a run as one page of HTML, and the run as plain data and as code.

The page holds all it shows, and links to nothing. The run is an adaptive one or a
loading history.
"""

from __future__ import annotations

import json
import struct
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from datetime import date
from html import escape
from itertools import permutations
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

from erc_contact.base.code import code_of, definitions, without_paths
from erc_contact.base.exceptions import InputError
from erc_contact.base.versions import machine, versions
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.runs import Run
from erc_contact.model.forces import Force
from erc_contact.output.gallery import Gallery
from erc_contact.output.view_page import in_frame
from erc_contact.scene.scene import Scene
from erc_contact.scene.words import in_words
from namedmesh import Domain
from namedmesh.base.html import table
from namedmesh.base.names import file_stem, printable
from namedmesh.for_solvers import shape_in_words
from namedmesh.keeping import rules_of, write_domain
from namedmesh.pictures import on_root

PAGE_STYLE = """
:root { color-scheme: light dark; --ink: #1a1a1a; --paper: white; --soft: #555; --line: #ddd;
  --code: #f5f5f5; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e4e4; --paper: #16181b; --soft: #aaa; --line: #3a3d42; --code: #22252a; }
  img { filter: brightness(0.88); } }
body { font: 16px/1.5 Georgia, serif; color: var(--ink); background: var(--paper);
  max-width: 62rem; margin: auto; padding: 0 1rem 3rem; overflow-wrap: break-word; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 1.5rem 0 0.3rem; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 0.5rem; }
img { max-width: 100%; max-height: 42rem; display: block; margin: 0.5rem auto; }
iframe { width: 100%; height: 34rem; max-height: 85vh; border: 1px solid var(--line);
  box-sizing: border-box; }
figure { margin: 1rem 0; }
.intervals { width: 100%; max-width: 30rem; font-size: 12px; fill: currentColor;
  stroke: currentColor; } .intervals text { stroke: none; }
.intervals .interval { stroke: #56b4e9; stroke-width: 8; }
.broad img { max-width: none; width: 100%; min-width: 34rem; }
figcaption { font-size: 0.9rem; color: var(--soft); } .wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.2rem 0.7rem 0.2rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--line); }
th { font-weight: normal; } thead th { color: var(--soft); }
.numbers td, .numbers thead th + th { text-align: right; }
.numbers td { white-space: nowrap; } .verdict th { font-weight: bold; min-width: 5rem; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(20rem, 1fr)); gap: 1rem; }
pre { background: var(--code); padding: 0.8rem; overflow-x: auto; font-size: 0.85rem;
  line-height: 1.35; }
@media print {
  body { max-width: none; padding: 0; font-size: 10.5pt; color: black; background: white; }
  h2 { break-after: avoid; } figure, tr { break-inside: avoid; } pre { white-space: pre-wrap; }
  .wide { overflow: visible; } .broad img { min-width: 0; } img { filter: none; } }
"""
DOMAIN_FILE = "domain.vtkhdf"
"""Name of the file of the first mesh beside a report."""
ERROR_NUMBERS = (
    "relative",
    "total",
    "absolute",
    "scale",
    "bulk_error",
    "contact_error",
    "geometry_error",
    "degree",
)
"""Numbers of the error in the data."""
BROAD = 1.3
"""Width over height of a picture that a narrow screen shows part by part [-]."""


class Reported(Protocol):
    """Represent what a report is of: a run, or a certificate."""

    @property
    def outcome(self) -> str:
        """Say why the run ended, or what is certified."""

    @property
    def error(self) -> Any:
        """Return the error."""


def write_report(
    run: Reported,
    path: str | Path,
    title: str,
    tables: Mapping[str, str],
    gallery: Gallery | None,
    *,
    results: str = "",
    claims: Sequence[tuple[str, str]] = (),
    unknown: Sequence[str] = (),
    forces: Mapping[str, Force] | None = None,
    code: str = "",
    note: str = "",
) -> None:
    """Write the report of a run; collective.

    It begins with the name of the folder and the date, has forces with their intervals
    on top, says what is proved and what is estimated, shows the run and its pictures,
    and ends in what is not known. It has neither the name of the machine nor a path.

    Args:
        run: The run, or a certificate.
        path: The file, in the folder of the pictures.
        title: Its heading behind the name of the folder.
        tables: Tables of its rows in HTML, by their headings.
        gallery: The pictures in the folder, or None.
        results: Forces with their intervals, as a table in HTML, which stands on top.
        claims: What the error proves and what it estimates, each with its kind, see
            :func:`erc_contact.output.verdict.parted`.
        unknown: What is not known.
        forces: Forces on the body by their cause, see
            :func:`erc_contact.results.reactions`; the same on all ranks.
        code: The run as code, see :func:`run_as_code`.
        note: What else has to be said of it, below the heading.
    """
    file = Path(path)
    comm = run.error.domain.comm
    # An error that is read from a folder has no scene.
    scene = run.error.solution.scene if isinstance(run.error, ConstitutiveError) else None

    def write() -> None:
        label = scene.label if scene is not None else str
        name = file.resolve().parent.name
        introduction = [str(date.today()), without_paths(run.outcome), note]
        sections = {"": "".join(paragraph(text) for text in introduction if text)}
        if results:
            sections["Forces and their intervals"] = wide(label(results))
        if claims:
            sections["What the number means"] = wide(label(table(claims)), "verdict")
        if scene is not None:
            words = in_words(scene)
            sections["Scene"] = wide(table(words, ("part", "what holds there")))
        for heading, rows in tables.items():
            sections[heading] = wide(rows, "numbers")
        if gallery is not None and (gallery.drawn or gallery.missing):
            sections["Pictures"] = _pictures(gallery)
        if forces:
            rows = _forces(forces, _facing(run.error), on_rings=_is_of_rings(run.error))
            sections["Forces on the body"] = label(rows)
        if unknown:
            sections["What is not known"] = "".join(paragraph(label(words)) for words in unknown)
        if code:
            sections["How to reproduce it"] = f"<pre>{escape(code)}</pre>"
        software = {**versions(), **machine(), "ranks": str(comm.size)}
        sections["Software and machine"] = wide(table(software.items()))
        file.write_text(page_of_sections(f"{name}: {title}", sections))

    on_root(comm, path, write)


def page_of_sections(title: str, sections: Mapping[str, str]) -> str:
    """Return the page; sections are HTML by their headings."""
    body = ""
    for name, text in sections.items():
        body += f"<h2>{escape(name)}</h2>{text}" if name else text
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{PAGE_STYLE}</style></head>\n"
        f"<body><h1>{escape(title)}</h1>{body}</body></html>\n"
    )


def paragraph(text: str) -> str:
    """Return text as a paragraph of HTML."""
    return f"<p>{escape(text)}</p>"


def wide(text: str, kind: str = "") -> str:
    """Return HTML that scrolls by itself where the screen is narrow."""
    return f'<div class="wide {kind}">{text}</div>'


def _pictures(gallery: Gallery) -> str:
    """Return pictures, and the code of pictures for which there was no time."""
    text = ""
    for name, words in gallery.drawn.items():
        text += _of_file(gallery.folder / name, words)
    if gallery.missing:
        text += paragraph(
            f"Not drawn are {', '.join(gallery.missing)}: saving takes at most "
            f"{gallery.allowed:.1f} s, a second and a fifth of the run. "
            "save(folder, pictures=True) draws all, and each of these lines draws one:"
        )
        lines = "\n".join(gallery.missing.values())
        text += f"<pre>{escape(lines)}</pre>"
    return text


def _of_file(file: Path, words: str) -> str:
    """Return a picture or a view that a file has, inside the page."""
    if file.suffix == ".html":
        return view_figure(file.read_text(), words)
    return figure_of(file.read_bytes(), words)


def figure_of(content: bytes, words: str) -> str:
    """Return a picture inside the page, of the content of its png file.

    A picture that is broad scrolls where the screen is narrow.
    """
    # The header of a png file has the size at a fixed place.
    width, height = struct.unpack(">II", content[16:24])
    data = b64encode(content).decode()
    image = f'<img src="data:image/png;base64,{data}" alt="{escape(words)}">'
    frame = wide(image, "broad" if width > BROAD * height else "")
    return f"<figure>{frame}<figcaption>{escape(words)}</figcaption></figure>"


def view_figure(page: str, words: str) -> str:
    """Return a view inside the page, which is a page of its own."""
    return f"<figure>{in_frame(page, words)}<figcaption>{escape(words)}</figcaption></figure>"


def _facing(error: Any) -> dict[str, str]:
    """Return the part of another body that each part of a pair is in contact with.

    An error that is read from a folder knows of none.
    """
    facing: dict[str, str] = {}
    if isinstance(error, ConstitutiveError):
        scene = error.solution.scene
        for contact in scene.contacts:
            facing.update(permutations(contact.sides, 2))
        for tie in scene.ties:
            facing.update(permutations(tie.sides, 2))
    return facing


def _is_of_rings(error: Any) -> bool:
    """Tell whether an error is of axisymmetric bodies; a folder does not tell."""
    return isinstance(error, ConstitutiveError) and error.model.space.axisymmetric


def _forces(forces: Mapping[str, Force], facing: Mapping[str, str], *, on_rings: bool) -> str:
    """Return the table of forces by their cause.

    Args:
        forces: The forces by their cause.
        facing: The other side of each side of a pair.
        on_rings: Whether they act on axisymmetric bodies, which have no moments.
    """
    if on_rings:
        header = ["cause", "Fr", "Fz"]
        words = (
            "Axial resultants Fz [force] of the admissible stress on full rings, and sums Fr "
            "[force] of radial forces around them. The balance is zero up to round-off."
        )
    else:
        first = next(iter(forces.values()))
        header = ["cause"]
        header += [f"F{axis}" for axis in "xyz"[: len(first.force)]]
        # In the plane the moment is that about z.
        header += [f"M{axis}" for axis in "xyz"[-len(first.moment) :]]
        words = (
            "Resultants [force] and moments [force length] about the origin of the admissible "
            "stress. The balance is zero up to round-off."
        )
    rows = []
    for cause, force in forces.items():
        components = (*force.force, *force.moment)[: len(header) - 1]
        name = f"{cause} (internal, from {facing[cause]})" if cause in facing else cause
        rows.append([name, *(f"{component:.6g}" for component in components)])
    if facing:
        words += " Two bodies exert internal forces on each other, which are opposite."
    return paragraph(words) + wide(table(rows, header), "numbers")


def write_record(run: Run, path: str | Path, forces: Mapping[str, Force]) -> None:
    """Write the data of a run as JSON; collective.

    They are its rows, its error, forces on the body, settings and software.

    Args:
        run: The run.
        path: The file.
        forces: Forces on the body by their cause; the same on all ranks.
    """

    def write() -> None:
        Path(path).write_text(json.dumps(_record(run, forces), indent=1, allow_nan=False))

    on_root(run.error.domain.comm, path, write)


def _record(run: Run, forces: Mapping[str, Force]) -> dict[str, Any]:
    """Return the data of a run; numbers that are none are None."""
    error = {name: getattr(run.error, name) for name in ERROR_NUMBERS}
    # An error that is read from a folder has no more.
    if isinstance(run.error, ConstitutiveError):
        error["oscillations"] = asdict(run.error.oscillations)
    force_lists = {}
    for cause, force in forces.items():
        force_lists[cause] = {"force": force.force.tolist(), "moment": force.moment.tolist()}
    record = {
        "outcome": run.outcome,
        "reached": run.reached,
        "accuracy": run.accuracy,
        "error": error,
        "forces": force_lists,
        "parts of files": {file_stem(name): name for name in run.error.domain.names},
        "steps": [asdict(step) for step in run.steps],
        "settings": {name: code_of(value) for name, value in run.settings.items()},
        "versions": versions(),
        "machine": {**machine(), "ranks": run.error.domain.comm.size},
    }
    return _plain(record)


def _plain(value: Any) -> Any:
    """Return data without nan and infinity, which JSON does not know."""
    if isinstance(value, dict):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value


def run_as_code(
    scene: Scene, domain: Domain, domain_code: str, arguments: Mapping[str, Any]
) -> str:
    """Return the code of an adaptive run.

    Args:
        scene: Its scene.
        domain: Its first mesh, which is told in words.
        domain_code: The code that makes or reads it.
        arguments: The other arguments of :func:`erc_contact.adapt` by their names.
    """
    lines = [f"    material={code_of(scene.material)},"]
    for name in ("supports", "loads", "contacts", "strains", "springs", "ties"):
        entries = [f"        {code_of(entry)}," for entry in getattr(scene, name)]
        if entries:
            lines += [f"    {name}=[", *entries, "    ],"]
    if scene.units:
        lines.append(f"    units={scene.units!r},")
    scene_lines = ["scene = ec.Scene(", *lines, ")", *_domain_lines(domain, domain_code)]
    return _script(definitions(scene), scene_lines, "history = ec.adapt(\n    scene", arguments)


def evolution_as_code(
    scene_at: Callable[[float], Scene],
    domain: Domain,
    domain_code: str,
    arguments: Mapping[str, Any],
) -> str:
    """Return the code of a loading history.

    Args:
        scene_at: The scene of each time.
        domain: Its first mesh, which is told in words.
        domain_code: The code that makes or reads it.
        arguments: The other arguments of :func:`erc_contact.evolve` by their names.
    """
    call = f"evolution = ec.evolve(\n    {code_of(scene_at)}"
    return _script(definitions([scene_at]), _domain_lines(domain, domain_code), call, arguments)


def keep_domain(domain: Domain, folder: Path) -> str:
    """Write the first mesh of a run beside its report; collective.

    Returns:
        The code that reads it, or a comment that says why there is none.
    """
    try:
        write_domain(domain, folder / DOMAIN_FILE)
    except InputError:
        return "# domain = ...: its true shape is of a class of your own, make it as before"
    needed = []
    named = []
    for rules in rules_of(domain.whole.geometry):
        needed += definitions([rules.parts, rules.regions])
        named.append(f"({code_of(rules.parts)}, {code_of(rules.regions)})")
    more = f", rules=[{', '.join(named)}]" if named else ""
    return "\n".join([*needed, f'domain = ec.read_domain("{DOMAIN_FILE}"{more})'])


def _domain_lines(domain: Domain, code: str) -> list[str]:
    """Return the code of a domain below its words."""
    shape = shape_in_words(domain.geometry, domain.dim, curved=domain.curved_facets is not None)
    parts = ", ".join(map(printable, domain.names))
    facts = f"{domain.cells} cells and {domain.vertices} vertices; parts {parts}"
    return [f"# {shape}; the first mesh has {facts}", code]


def _script(
    needed: Sequence[str], lines: Sequence[str], call: str, arguments: Mapping[str, Any]
) -> str:
    """Return the code of a run.

    Args:
        needed: Imports and definitions that it needs.
        lines: The lines that make its scene and its domain.
        call: The beginning of its call.
        arguments: The arguments of the call by their names.
    """
    imports = [line for line in needed if line.startswith(("import ", "from "))]
    made = [text for text in needed if text not in imports]
    script = [*sorted(imports), "import ufl\n", "import erc_contact as ec\n"]
    for text in made:
        script.append(f"\n{text}\n" if "\n" in text else text)
    script += [*lines, f"{call},", "    domain,"]
    script += [f"    {name}={code_of(argument)}," for name, argument in arguments.items()]
    return "\n".join([*script, ")"])
