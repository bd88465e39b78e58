"""Measure the scenes of a family one after the other, and write tables of quantiles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_families import Sample, scene_generator


def measure_scenes[Row](
    seed: int,
    count: int,
    family: Callable[[np.random.Generator], Sample],
    measure: Callable[[Sample], Row],
) -> list[Row]:
    """Measure the first scenes of a seed, a row for each that has a solution.

    Args:
        seed: Seed of the family.
        count: Number of scenes.
        family: Makes a scene from a random generator.
        measure: Measures a scene.
    """
    rows = []
    for number in range(count):
        sample = family(scene_generator(seed, number))
        try:
            rows.append(measure(sample))
        except ec.ErcContactError as reason:
            ending = type(reason).__name__
            print(f"scene {number} of seed {seed} ({sample.name}) ends in {ending}", flush=True)
    return rows


def quantile_table(
    columns: Mapping[str, Sequence[float] | np.ndarray],
    quantiles: Sequence[float],
    form: str = "{:.2f}",
    *,
    counts: bool = True,
) -> str:
    """Write the quantiles of several quantities as a table in Markdown.

    Args:
        columns: The numbers of each quantity by its name; without numbers its quantiles
            are nan.
        quantiles: Shares of the numbers below the quantiles [-].
        form: Format of a quantile.
        counts: Whether a column has how many numbers there are.
    """
    shares = " | ".join(f"{share:.0%}" for share in quantiles)
    width = len(quantiles) + (2 if counts else 1)
    lines = [f"| | scenes | {shares} |" if counts else f"| | {shares} |", "|---" * width + "|"]
    for name, numbers in columns.items():
        values = np.full(len(quantiles), np.nan)
        if len(numbers) > 0:
            values = np.quantile(numbers, quantiles)
        entries = [name, str(len(numbers))] if counts else [name]
        entries += [form.format(value) for value in values]
        lines.append(f"| {' | '.join(entries)} |")
    return "\n".join(lines)
