"""Measure how seconds and memory of each stage grow with the mesh and the ranks.

The scene is the scene of benchmarks/cost.py: a cube (or a block in the plane) pressed
and sheared at its top, friction 0.3. Each size runs in processes of its own, a small
mesh first, which loads the compiled forms. The unit U is one elastic solve of the same
body, the contact glued, by conjugate gradients with multigrid to 1e-8, assembly and
set-up included. Seconds are processor time, the largest over the ranks, so that other
work of the machine changes them less; ranks that wait count, too. Memory is the sum of
the peaks of the ranks, mesh included. The exponents are slopes of a straight line
through the logarithms of seconds and unknowns.

    OMP_NUM_THREADS=1 python benchmarks/scaling.py [--dim 3] [--sizes 11 18 26 36 52]
    [--ranks 1 2] [--solver auto]
        [--degree 1] [--method Nitsche]

writes results/scaling.csv and results/scaling.png, and the last fields to
results/scaling.
"""

from __future__ import annotations

import argparse
import csv
import json
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from cost import problem

import erc_contact as ec

from erc_contact.model.model import Model  # isort: skip - after erc_contact, which loads MPI first
from erc_contact.newton.linear.multigrid import Multigrid  # isort: skip
from erc_contact.output.paraview import write_fields  # isort: skip

STAGES = ("unit", "contact solve", "admissible pair", "error", "files")
RESULTS = Path(__file__).parent / "results"


def unit(scene: ec.Scene, domain: ec.Domain, degree: int) -> None:
    """Measure one elastic solve by conjugate gradients with multigrid to 1e-8."""
    elastic = Multigrid(Model(scene, domain, degree))
    elastic.solve_glued(elastic.load_vector(), tolerance=1e-8)
    elastic.free()


def measure(options: argparse.Namespace) -> dict[str, Any] | None:
    """Run one size on the ranks of this program; the numbers on rank 0."""
    measured_stages(problem(options.dim, 4), options)  # loads the compiled forms
    seconds, error = measured_stages(problem(options.dim, options.n), options)
    solution, domain = error.solution, error.domain
    comm = domain.mesh.comm
    memory = comm.reduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    if comm.rank > 0:
        return None
    return {
        "ranks": comm.size,
        "unknowns": solution.model.space.V.dofmap.index_map.size_global * domain.dim,
        "cells": domain.cells,
        "newton": solution.newton_steps,
        "eps": error.relative,
        **dict(zip(STAGES, seconds, strict=True)),
        "megabytes": memory,
    }


def measured_stages(
    pair: tuple[ec.Scene, ec.Domain], options: argparse.Namespace
) -> tuple[list[float], ec.ConstitutiveError]:
    """Return processor seconds of all stages, and the error."""
    (scene, domain), comm, seconds = pair, pair[1].mesh.comm, []
    method = getattr(ec, options.method)()

    def timed(stage: Callable[[], Any]) -> Any:
        comm.barrier()
        began = process_time()
        result = stage()
        comm.barrier()
        seconds.append(max(comm.allgather(process_time() - began)))
        return result

    timed(lambda: unit(scene, domain, options.degree))
    solution = timed(
        lambda: ec.solve(scene, domain, method, degree=options.degree, solver=options.solver)
    )
    admissible = timed(lambda: ec.equilibrate(solution))
    error = timed(lambda: ec.constitutive_error(admissible))
    timed(lambda: write_fields(error, RESULTS / "scaling"))
    return seconds, error


def show(rows: list[dict[str, Any]], path: Path) -> None:
    """Print seconds in units and growth exponents, and draw seconds."""
    print(
        f"{'ranks':>5}{'unknowns':>10}{'unit s':>8}"
        + "".join(f"{s + ' U':>18}" for s in STAGES[1:])
        + "   kB a cell"
    )
    for row in rows:
        units = "".join(f"{row[stage] / row['unit']:18.2f}" for stage in STAGES[1:])
        print(
            f"{row['ranks']:5d}{row['unknowns']:10d}{row['unit']:8.2f}{units}"
            f"{row['megabytes'] * 1e3 / row['cells']:12.1f}"
        )
    figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
    for ranks in sorted({row["ranks"] for row in rows}):
        of = [row for row in rows if row["ranks"] == ranks]
        x = [row["unknowns"] for row in of]
        for number, stage in enumerate(STAGES):
            y = [row[stage] for row in of]
            label = f"{stage}, {ranks} rank{'s' * (ranks > 1)}"
            if len(of) > 1:
                exponent = np.polyfit(np.log(x), np.log(y), 1)[0]
                print(f"{label}: seconds grow with unknowns to the {exponent:.2f}")
            axes.loglog(x, y, "o-" if ranks == 1 else "s--", color=f"C{number}", label=label)
    axes.set(xlabel="unknowns", ylabel="seconds")
    axes.legend(fontsize="small")
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--dim", type=int, default=3)
    parser.add_argument("--degree", type=int, default=1)
    parser.add_argument("--sizes", type=int, nargs="+", default=[11, 18, 26, 36, 52])
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--method", default="Nitsche")
    parser.add_argument("--n", type=int, help="measure one size on the ranks of this program")
    options = parser.parse_args()
    if options.n is not None:
        found = measure(options)
        if found is not None:
            print(json.dumps(found))
        return
    rows = []
    for ranks in options.ranks:
        for n in options.sizes:
            command = ["mpiexec", "-n", str(ranks), sys.executable, __file__, "--n", str(n)]
            for name in ("dim", "degree", "solver", "method"):
                command += [f"--{name}", str(getattr(options, name))]
            said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
            rows.append(json.loads(said.splitlines()[-1]))
            print(rows[-1], flush=True)
    RESULTS.mkdir(exist_ok=True)
    with (RESULTS / "scaling.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    show(rows, RESULTS / "scaling.png")


if __name__ == "__main__":
    main()
