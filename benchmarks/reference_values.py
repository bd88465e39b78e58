"""Make the page of reference values, and a JSON that other codes can read.

Each case that is finished is kept in ``results/reference_values``; the next call goes
on with the rest. Remove a file there to compute its case again.

    OMP_NUM_THREADS=1 python benchmarks/reference_values.py [name ...]

With names only these cases are computed, and the page is made of all that are kept.
"""

from __future__ import annotations

import inspect
import json
import logging
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from time import process_time
from typing import Any

import erc_contact  # noqa: F401 - before numpy, it loads MPI

import reference_bodies as bodies  # isort: skip
import reference_cases as cases  # isort: skip
import reference_copies as copies  # isort: skip
import reference_cracks as cracks  # isort: skip
import reference_laws as laws  # isort: skip
import reference_punches as punches  # isort: skip
import reference_turned as turned  # isort: skip
import reference_turned_contacts as edges  # isort: skip
from reference_numbers import Number, Other, Result  # isort: skip
from reference_page import page  # isort: skip

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "results" / "reference_values"
PAGE = ROOT / "docs" / "reference_values.md"
CASES: dict[str, Callable[[], Result]] = {
    case.__name__: case
    for case in (
        cases.bar_on_a_plate,
        cases.plate_with_given_force,
        cases.bar_on_springs,
        cases.heated_bar,
        bodies.slipping_blocks,
        cases.block_of_eight_codes,
        cases.block_without_friction,
        cases.block_with_given_friction,
        cases.greco,
        cases.paper,
        cases.receding_layer,
        bodies.receding_layers,
        bodies.layers_with_a_gap,
        bodies.two_blocks,
        bodies.hertz_cylinders,
        punches.half_disc,
        punches.rounded_punch,
        punches.flat_punch,
        punches.tilted_plate,
        punches.press_fit,
        bodies.bimetal_strip,
        copies.layers_in_turn,
        copies.flattened_wave,
        copies.pressed_waves,
        copies.slipping_sector,
        copies.holes_in_a_square,
        copies.spinning_blades,
        bodies.bar_between_sections,
        punches.block_in_space,
        punches.cattaneo_mindlin,
        turned.cylinder_between_platens,
        turned.thick_tube,
        turned.thick_shell,
        turned.spinning_cylinder,
        turned.column_in_a_tube,
        turned.column_on_a_plane,
        turned.fit_in_plane_strain,
        turned.spinning_fit,
        turned.shrink_fit,
        edges.ball_on_a_layer,
        edges.ball_on_a_rough_layer,
        edges.two_layers,
        edges.punch_on_a_layer,
        edges.receding_disc,
        edges.receding_discs,
        edges.ball_on_a_cylinder,
        edges.rough_platens,
        edges.bonded_platens,
        edges.rough_fit,
        edges.two_hemispheres,
        edges.ball_under_a_force,
        edges.balls_between_pads,
        cracks.penny_crack,
        cracks.crack_in_a_tube,
        cracks.crack_along_an_arc,
        laws.yielding_tube,
        laws.heated_tube,
        laws.plastic_cylinder,
        laws.orthotropic_tube,
        laws.bars_pulled_from_beside,
    )
}


def finished(name: str) -> Path:
    """Return the file that keeps a case."""
    return KEPT / f"{name}.json"


def compute(name: str) -> None:
    """Compute a case and keep it."""
    began = process_time()
    result = CASES[name]()
    result.seconds = process_time() - began
    text = json.dumps(asdict(result), indent=1, default=float)
    path = finished(name)
    # A run that is ended here leaves no half of a file.
    partial = path.with_suffix(".partial")
    partial.write_text(text + "\n")
    partial.rename(path)
    print(f"{name}: {result.cells} cells, {result.seconds:.0f} s", flush=True)


def read(name: str) -> Result:
    """Read a case that is kept."""
    data = json.loads(finished(name).read_text())
    numbers = []
    for entry in data.pop("numbers"):
        others = [Other(**other) for other in entry.pop("others")]
        numbers.append(Number(**entry, others=others))
    return Result(**data, numbers=numbers)


def described(name: str) -> tuple[str, str]:
    """Return title and geometry of a case."""
    title, _, geometry = (inspect.getdoc(CASES[name]) or "").partition("\n")
    return title.rstrip("."), geometry.strip()


def write(results: dict[str, Result]) -> None:
    """Write the page and the JSON."""
    titles = {name: described(name) for name in results}
    PAGE.write_text(page(results, titles))
    entries = []
    for name, result in results.items():
        title, geometry = titles[name]
        entry: dict[str, Any] = {"case": name, "title": title, "geometry": geometry}
        entries.append({**entry, **asdict(result)})
    PAGE.with_suffix(".json").write_text(json.dumps(entries, indent=1) + "\n")


def main() -> None:
    """Compute what is missing, and write."""
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    KEPT.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or CASES:
        if not finished(name).exists():
            compute(name)
    write({name: read(name) for name in CASES if finished(name).exists()})


if __name__ == "__main__":
    main()
