"""Measure indices against true errors, per-element correlation, and time.

For every scene, degree and mesh of a uniform and of an adaptive sequence, without and
with tightening:

    index     bulk part of e over |u - u^|, and e over |u - u^|
    both      e over sqrt(|u - u^|^2 + |sigma - sigma^|^2)
    third     2 int (b - b^)(|u_t| - |u^_t|) / e^2 where the friction bound b depends on
    the pressure rank u    Spearman's rank correlation of eps_E with the true error of
    u^ per element; "rank 2" with the error of both

True errors are against the augmented Lagrangian on a mesh cut at the barycentres and
then refined uniformly four times (3D: as often as memory allows), or against a known
solution; see ``true_errors.py``. The table goes to ``results/effectivity/table.csv``,
and one figure a scene, eps against run time, beside it.

    OMP_NUM_THREADS=1 python benchmarks/effectivity.py [table|figures|race|all] [part of
    a scene's name]
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from time import process_time
from typing import Any

import erc_contact as ec
from erc_contact.output import plot_history

from effectivity_scenes import CASES, block, blocks  # isort: skip - after erc_contact
from true_errors import rank_correlation, true_errors  # isort: skip

DEGREES = (1, 2)
"""Degrees of the displacement that are studied."""
TIGHTEN = (0, 10)
CORNER = 0.7112
"""Exponent of the clamped-free corners of the block at nu = 0.3.

On uniform meshes eps ~ h^CORNER.
"""
LINE = 0.01
"""Eps that the figures mark [-]."""
FOLDER = Path("results/effectivity")


@dataclass(frozen=True)
class Row:
    """Hold the measures of one mesh and one number of iterations of tightening.

    See the head of the file.
    """

    scene: str
    degree: int
    sequence: str
    cells: int
    tighten: int
    iterations: int
    eps: float
    bulk_index: float
    index: float
    both: float
    third: float
    rank_u: float
    rank_both: float
    fine_cells: int

    def __str__(self) -> str:
        return (
            f"{self.scene:<30}{self.degree} {self.sequence:<9}{self.cells:6d}"
            f"{self.tighten:4d}{self.iterations:4d}"
            f"{self.eps:9.3%}{self.bulk_index:8.3f}{self.index:8.3f}"
            f"{self.both - 1:+11.1e}{self.third:+10.1e}"
            f"{self.rank_u:8.3f}{self.rank_both:8.3f}{self.fine_cells:9d}"
        )


HEADER = (
    f"{'scene':<30}k sequence  cells max its      eps  bulk/u     e/u   both - 1     third"
    "  rank u  rank 2  fine cells"
)


def measured(
    name: str, degree: int, sequence: str, domain: ec.Domain
) -> tuple[list[Row], ec.ConstitutiveError]:
    """Return the rows of one mesh, and the tightest error."""
    case = CASES[name]
    solution = ec.solve(case.of_degree(degree), domain, degree=degree)
    exact = case.truth(solution, degree)
    rows = []
    for tighten in TIGHTEN:
        pair = ec.equilibrate(solution, tighten=tighten)
        error = ec.constitutive_error(pair)
        true = true_errors(pair, exact)
        rows.append(
            Row(
                name,
                degree,
                sequence,
                domain.cells,
                tighten,
                pair.tightening,
                error.relative,
                error.bulk_error / true.of_u,
                error.absolute / true.of_u,
                error.absolute / true.of_both,
                true.friction / error.absolute**2,
                rank_correlation(error.indicators, true.displacement),
                rank_correlation(error.indicators, true.both),
                exact.model.domain.cells,
            )
        )
    return rows, error


def table(name: str, degree: int) -> Iterator[Row]:
    """Return all rows of a scene.

    First come the rows of the uniform sequence, then the rows of the adaptive sequence
    from the same first mesh.
    """
    case = CASES[name]
    for make in case.meshes:
        domain = make()
        if case.affordable(domain.cells, domain.dim, degree):
            yield from measured(name, degree, "uniform", domain)[0]
    domain, last = case.meshes[0](), case.meshes[-1]().cells
    while domain.cells <= last and case.affordable(domain.cells, domain.dim, degree):
        rows, error = measured(name, degree, "adaptive", domain)
        yield from rows
        domain = domain.refined(ec.mark(error))


def summary(rows: list[Row]) -> Iterator[str]:
    """Give the least and greatest of each measure, scene by scene."""
    for name, degree, tighten in dict.fromkeys((r.scene, r.degree, r.tighten) for r in rows):
        own = [r for r in rows if (r.scene, r.degree, r.tighten) == (name, degree, tighten)]
        ranges = ", ".join(
            f"{what} {min(getattr(row, key) for row in own):.3f}"
            f" to {max(getattr(row, key) for row in own):.3f}"
            for what, key in (
                ("bulk/u", "bulk_index"),
                ("rank u", "rank_u"),
                ("rank 2", "rank_both"),
            )
        )
        both = (
            f"both - 1 {min(r.both for r in own) - 1:+.1e} to {max(r.both for r in own) - 1:+.1e}"
        )
        third = max(abs(r.third) for r in own)
        yield f"{name}, k = {degree}, tighten {tighten}: {ranges}, {both}, third {third:.1e}"


def write(rows: list[Row]) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    with (FOLDER / "table.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([column.name for column in fields(Row)])
        writer.writerows([getattr(row, column.name) for column in fields(Row)] for row in rows)


# -- error against run time
# ------------------------------------------------------------------------------------


def figure(name: str) -> None:
    """Draw eps against run time and degrees of freedom.

    Tightening is off and on, refinement uniform and adaptive, for all degrees.
    """
    case, histories = CASES[name], {}
    for degree in DEGREES:
        scene, start = case.of_degree(degree), case.meshes[0]()
        for tighten in TIGHTEN:
            warm_up(scene, start, degree, tighten)
            for strategy in (ec.Uniform(), ec.Mark()):
                sequence = "uniform" if strategy == ec.Uniform() else "adaptive"
                label = f"k = {degree}, {sequence}, tighten {tighten}"
                options: dict[str, Any] = {
                    "strategy": strategy,
                    "tighten": tighten,
                    "max_cells": case.max_cells,
                }
                history = ec.adapt(scene, start, 1e-6, degree=degree, **options)
                histories[label] = replace(history, accuracy=LINE, meshes=())
                print(
                    f"{name}: {label}: {history.steps[-1].eps:.3%} "
                    f"after {history.steps[-1].seconds:.1f} s",
                    flush=True,
                )
                history.to_csv(
                    FOLDER / f"{label.replace(' ', '').replace(',', '_')}_{file_name(name)}.csv"
                )
    plot_history(histories, FOLDER / f"{file_name(name)}.png")


def file_name(name: str) -> str:
    return name.replace(",", "").replace(" ", "_")


def warm_up(scene: ec.Scene, start: ec.Domain, degree: int, tighten: int) -> None:
    """Compile the forms: the first row is no measure of the compiler."""
    ec.constitutive_error(ec.equilibrate(ec.solve(scene, start, degree=degree), tighten=tighten))


def race(accuracy: float = 0.01) -> None:
    """Measure the time to a certified accuracy on the block.

    Adaptive runs are compared with uniform P1 with the loose error.

    The uniform side runs twice: refining all cells from the same first mesh, as one
    does who knows nothing; and on the one structured mesh that just reaches the
    accuracy, as if it were known in advance. Seconds are processor seconds, of one
    thread: they do not depend on what else the machine does.
    """
    scene, start = block(0.3), blocks(4)[0]()
    times = {}
    for degree in DEGREES:
        for tighten in TIGHTEN:
            for fraction in (0.5, 0.8):
                warm_up(scene, start, degree, tighten)
                began = process_time()
                options: dict[str, Any] = {
                    "tighten": tighten,
                    "stop": "certified",
                    "strategy": ec.Mark(fraction),
                }
                last = ec.adapt(scene, start, accuracy, degree=degree, **options).steps[-1]
                label = f"adaptive, k = {degree}, tighten {tighten}, marking {fraction}"
                times[label] = process_time() - began
                print(
                    f"{label}: {last.cells} cells, {last.eps:.3%}, {times[label]:.2f} s", flush=True
                )
    began = process_time()
    history = ec.adapt(
        scene, start, accuracy, strategy=ec.Uniform(), tighten=0, max_cells=2_000_000
    )
    refining = process_time() - began
    print(
        f"uniform, tighten 0, refining: {history.steps[-1].cells} cells, "
        f"{history.steps[-1].eps:.3%}, {refining:.2f} s"
    )
    n, reached = 256, False
    while not reached:
        eps, alone = one_mesh(scene, n)
        reached = eps <= accuracy
        n = 2 * round(n * max((eps / accuracy) ** (1 / CORNER), 1.01) / 2)
    for label, seconds in times.items():
        print(
            f"{label}: {refining / seconds:.1f} times faster than refining, "
            f"{alone / seconds:.1f} than that mesh alone"
        )


def one_mesh(scene: ec.Scene, n: int) -> tuple[float, float]:
    """Measure eps with the loose error, and seconds, of one uniform mesh.

    It has n squares across, each cut by one diagonal.
    """
    began = process_time()
    error = ec.constitutive_error(ec.equilibrate(ec.solve(scene, blocks(n)[0]()), tighten=0))
    seconds = process_time() - began
    cells = error.domain.cells
    print(
        f"uniform, tighten 0, n = {n} alone: {cells} cells, {error.relative:.3%}, {seconds:.2f} s",
        flush=True,
    )
    return error.relative, seconds


def main() -> None:
    what, part = [*sys.argv[1:], *("all", "")[len(sys.argv) - 1 :]]
    names = [name for name in CASES if part in name]
    if not names:
        sys.exit(f"No scene has {part!r} in its name; there are {', '.join(CASES)}.")
    FOLDER.mkdir(parents=True, exist_ok=True)
    if what in ("table", "all"):
        print(HEADER)
        rows = []
        for name in names:
            for degree in DEGREES:
                for row in table(name, degree):
                    rows.append(row)
                    print(row, flush=True)
        print(*summary(rows), sep="\n", flush=True)
        write(rows)
    if what in ("figures", "all"):
        for name in names:
            figure(name)
    if what in ("race", "all"):
        race()


if __name__ == "__main__":
    main()
