"""Count the intervals of each kind of number, and write the table of them."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Tally:
    """Count the intervals of a kind of goal.

    Attributes:
        distances: Distances of the numbers from the middle over the half width [-],
            where that is far above what the reference leaves unknown.
        proved: Number of intervals that are proved.
        count: Number of intervals, one for each scene.
        outside: Number of intervals that are false.
        without: Number of scenes that are not solved, or have no interval.
    """

    distances: list[float] = field(default_factory=list)
    proved: int = 0
    count: int = 0
    outside: int = 0
    without: int = 0


def kinds_table(tallies: dict[str, Tally]) -> str:
    """Write the counts of each kind of goal as a table in Markdown."""
    head = "| | scenes | proved | false | greatest distance | no interval |"
    lines = [f"{head}\n{'|---' * 6}|"]
    for name, tally in tallies.items():
        far = max(tally.distances, default=float("nan"))
        counts = f"{tally.count} | {tally.proved} | {tally.outside}"
        lines.append(f"| {name} | {counts} | {far:.2f} | {tally.without} |")
    return "\n".join(lines)
