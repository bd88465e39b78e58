"""Measure indices against true errors, per-element correlation, and time.

For every scene, degree and mesh of a uniform and of an adaptive sequence, without and
with tightening:

    index     bulk part of e over |u - u^|, and e over |u - u^|
    both      e over sqrt(|u - u^|^2 + |sigma - sigma^|^2)
    third     2 int (b - b^)(|u_t| - |u^_t|) / e^2 where the friction bound b depends on
    the pressure rank u    Spearman's rank correlation of eps_E with the true error of
    u^ per element; "rank 2" with that of both

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
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from time import process_time
from typing import Any

import erc_contact as ec

import ufl  # isort: skip - after erc_contact, which loads MPI first
from erc_contact.output import plot_history  # isort: skip
from true_errors import Reference, known, rank_correlation, reference, true_errors  # isort: skip

DEGREES = (1, 2)
"""Degrees of the displacement that are studied."""
TIGHTEN = (0, 10)
MAX_FINE = 1_600_000
"""Cells of a reference at most: about 3 GB in 2D."""
CORNER = 0.7112
"""Exponent of the clamped-free corners of the block at nu = 0.3.

On uniform meshes eps ~ h^CORNER.
"""
LINE = 0.01
"""Eps that the figures mark [-]."""
FOLDER = Path("results/effectivity")


@dataclass(frozen=True)
class Case:
    """Hold a scene with its meshes.

    Attributes:
        scene: The scene, or a function of the degree that gives it.
        meshes: The uniform sequence, coarse to fine; the adaptive one starts from its
            first.
        levels: Uniform refinements of the reference beyond the cut at the barycentres.
        exact: Known displacement, a function of the degree that gives a callable of x;
            or None.
        max_cells: Cells at most in a figure of error against run time.
        max_fine: Cells of a reference at most.
    """

    scene: Any
    meshes: tuple[Callable[[], ec.Domain], ...]
    levels: int = 4
    exact: Any = None
    max_cells: int = 120_000
    max_fine: int = MAX_FINE

    def of_degree(self, degree: int) -> ec.Scene:
        """Make the scene whose data the degree carries exactly."""
        return self.scene if isinstance(self.scene, ec.Scene) else self.scene(degree)

    def truth(self, solution: ec.Solution, degree: int) -> Reference:
        """Return what counts as exact on the mesh of a solution."""
        return (
            known(solution, self.exact(degree)) if self.exact else reference(solution, self.levels)
        )

    def affordable(self, cells: int, d: int, degree: int) -> bool:
        """Tell whether the reference of a mesh fits into memory."""
        return (
            bool(self.exact)
            or cells * (d + 1) * 2 ** (d * self.levels) * degree**d <= self.max_fine
        )


# -- scenes
# ------------------------------------------------------------------------------------


def block(friction: Any, nu: float = 0.3) -> ec.Scene:
    """Make the scene of the pressed and sheared block, (0, 2) x (0, 7)."""
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=nu),
        supports=[ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def opening(friction: Any) -> ec.Scene:
    """Make the scene of the block that is tilted and pushed.

    Its contact opens on the left, and with friction slips where it is closed.
    """
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.1, lambda x: 0.02 - 0.04 * x[0]))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def greco() -> ec.Scene:
    """Make the scene of the compressed and pushed block (GRECO): N, mm."""
    return ec.Scene(
        material=ec.Elastic(E=130e3, nu=0.2),
        supports=[ec.Displacement("right", (0.0, None))],
        loads=[ec.Traction("top", pressure=50.0), ec.Traction("left", pressure=150.0)],
        contacts=[ec.Contact("bottom", friction=1.0)],
    )


def cube(friction: float) -> ec.Scene:
    """Make the scene of a pressed cube with its top held."""
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, 0.01, -0.05))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def smooth(degree: int) -> Callable[[Any], Any]:
    """Make a displacement of degree k + 1 on the unit square.

    It keeps frictionless contact at y = 0, closed all over.

    u_y = 0 and sigma_xy = 0 at y = 0, u_x = 0 at x = 0; elements of degree k carry all
    its data.
    """
    return lambda x: ufl.as_vector(
        [
            0.02 * x[0] + 0.03 * x[0] ** (degree + 1),
            -0.1 * x[1] - 0.02 * x[0] ** degree * x[1] + 0.03 * x[1] ** (degree + 1),
        ]
    )


def manufactured(degree: int) -> ec.Scene:
    """Make the scene that :func:`smooth` solves.

    It has contact below, a roller on the left, tractions on the other sides.
    """
    material, exact, k = ec.Elastic(E=1.0, nu=0.3), smooth(degree), degree
    shear = 1 / 2.6
    lame = 2 * shear * 0.3 / 0.4

    def stress(x: Any) -> Any:
        eps = ufl.sym(ufl.grad(exact(x)))
        return material.stress(eps, E=material.E, nu=material.nu)

    return ec.Scene(
        material=material,
        supports=[ec.Displacement("left", (0.0, None))],
        loads=[
            ec.Traction("left", (0.0, lambda x: -stress(x)[0, 1])),
            ec.Traction("right", lambda x: stress(x)[:, 0]),
            ec.Traction("top", lambda x: stress(x)[:, 1]),
            ec.BodyForce(
                (
                    lambda x: (
                        -k
                        * (0.03 * (k + 1) * (lame + 2 * shear) - 0.02 * (lame + shear))
                        * x[0] ** (k - 1)
                    ),
                    lambda x: (
                        -k
                        * (
                            0.03 * (k + 1) * (lame + 2 * shear) * x[1] ** (k - 1)
                            - 0.02 * (k - 1) * shear * x[0] ** max(k - 2, 0) * x[1]
                        )
                    ),
                )
            ),
        ],
        contacts=[ec.Contact("bottom")],
    )


def blocks(*n: int) -> tuple[Callable[[], ec.Domain], ...]:
    return tuple(lambda n=n: ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(n, 7 * n // 2)) for n in n)


def squares(side: float, *n: int) -> tuple[Callable[[], ec.Domain], ...]:
    return tuple(lambda n=n: ec.rectangle((0.0, 0.0), (side, side), cells=(n, n)) for n in n)


def cubes(*n: int) -> tuple[Callable[[], ec.Domain], ...]:
    return tuple(lambda n=n: ec.box((0.0,) * 3, (1.0,) * 3, cells=(n,) * 3) for n in n)


CASES = {
    "block, friction 0.3": Case(block(0.3), blocks(4, 8, 16)),
    "block, frictionless": Case(block(0.0), blocks(4, 8, 16)),
    "block, given friction": Case(block(ec.Tresca(0.0015)), blocks(4, 8, 16)),
    "opening block, frictionless": Case(opening(0.0), blocks(4, 8, 16)),
    "opening block, given friction": Case(opening(ec.Tresca(0.0015)), blocks(4, 8, 16)),
    "block, nu 0.49": Case(block(0.3, 0.49), blocks(8, 16)),
    "block, frictionless, nu 0.49": Case(block(0.0, 0.49), blocks(8, 16)),
    "GRECO": Case(greco(), squares(40.0, 8, 16, 32)),
    "manufactured": Case(manufactured, squares(1.0, 4, 8, 16, 32), exact=smooth),
    "cube, friction 0.3": Case(cube(0.3), cubes(2, 4), levels=3, max_cells=50_000),
    "cube, frictionless": Case(cube(0.0), cubes(2, 4), levels=3, max_cells=50_000),
}


# -- the table
# ------------------------------------------------------------------------------------


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

    First come those of the uniform sequence, then those of the adaptive one from the
    same first mesh.
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
    accuracy, as if it were known in advance. Seconds are those of the processor, of one
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
