"""Compare a contact scene with GetFEM and CalculiX, where they are installed.

- ``blocks``: an upper block lies on a lower one that is three times as stiff, with
  friction. Its top is pressed down and moved aside, as a given displacement; the strain
  is plane, or the blocks are in 3D, with ``--dim 3``. All have the mesh of one gmsh
  file, whose sides match. The finest run of this package is the reference.
- ``ball``: a bonded layer is moved towards a ball, both turned bodies; GetFEM has the
  weight of the rings by hand, CalculiX its elements CAX6. The reference is an integral
  equation.

Displacements are of degree 2 in all. The table tells force, energy, unknowns, processor
seconds, the least of three runs, and what each says about its error. The last rows are
adaptive runs of this package.

    apt-get install python3-getfem++ calculix-ccx
    OMP_NUM_THREADS=1 python benchmarks/other_codes.py [blocks | ball] [--dim 3]
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import other_codes_ball as ball
import other_codes_blocks as blocks
from other_codes_programs import Row

SCENES = {"blocks": blocks, "ball": ball}
TIMES = 3
"""How often each row is made; its seconds are the least ones."""


def measure(makers: list[Callable[[], Row]]) -> list[Row]:
    """Make each row some times in turn, and keep the row with the least seconds."""
    best: dict[int, Row] = {}
    for _ in range(TIMES):
        for number, make in enumerate(makers):
            try:
                row = make()
            except (FileNotFoundError, RuntimeError) as failure:
                print(f"A program is left out: {failure}")
                continue
            if number not in best or row.seconds < best[number].seconds:
                best[number] = row
    return [best[number] for number in sorted(best)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scene", nargs="?", choices=SCENES, default="blocks")
    parser.add_argument("--dim", type=int, choices=(2, 3), default=2)
    asked = parser.parse_args()
    scene, dim = SCENES[asked.scene], asked.dim
    if dim not in scene.FORCES:
        parser.error(f"{asked.scene} is not in 3D")
    with tempfile.TemporaryDirectory() as folder:
        found = measure(list(scene.rows(Path(folder), dim)))
    best = scene.REFERENCE or (found[-1].force, found[-1].energy)
    components = scene.FORCES[dim]
    wanted = [*(np.ravel(best[0])[i] for i in components.values()), best[1]]
    unit = found[0].seconds
    print(f"Seconds of the first row: {unit:.2f}")
    forces = " | ".join(components)
    print(f"| program | {forces} | energy | unknowns | seconds, ratio | its error |")
    print("|---" * (len(wanted) + 4) + "|")
    for row in found:
        cells = []
        numbers = [*(np.ravel(row.force)[i] for i in components.values()), row.energy]
        for value, reference in zip(numbers, wanted, strict=True):
            cells.append(f"{value:.7g} ({value / reference - 1:+.3%})")
        cells += [str(row.unknowns), f"{row.seconds / unit:.1f}", row.error]
        print("|", " | ".join([row.name, *cells]), "|")


if __name__ == "__main__":
    main()
