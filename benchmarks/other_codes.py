"""Compare two blocks in contact with GetFEM and CalculiX, where they are installed.

An upper block lies on a lower one that is three times as stiff, with friction. Its top
is pressed down and moved aside, as a given displacement; the strain is plane. All have
the mesh of one gmsh file, whose sides match, and displacements of degree 2. The table
tells force, energy, unknowns, processor seconds, and what each says about its error.
The last rows are adaptive runs of this package; the finest is the reference.

    apt-get install python3-getfem++ calculix-ccx
    OMP_NUM_THREADS=1 python benchmarks/other_codes.py
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

MODULI = {"upper": 1000.0, "lower": 3000.0}
NU, MU, SIZE = 0.3, 0.3, 0.1
MOVED = (0.01, -0.02)
PENALTY = 1000.0
"""Stiffness of CalculiX's contact over the modulus of the softer block [1/length]."""


@dataclass
class Row:
    """Hold a line of the table.

    Args:
        name: The program and its method.
        force: Force on the upper block [force].
        energy: Strain energy [force length].
        unknowns: Number of unknowns.
        seconds: Processor time, without starting Python.
        error: What it says about its error.
    """

    name: str
    force: np.ndarray
    energy: float
    unknowns: int
    seconds: float
    error: str


@dataclass
class Blocks:
    """Hold the corners of the mesh, with both blocks in one piece.

    Args:
        points: Places of the nodes, shape (n, 2).
        triangles: Nodes of the triangles, counter-clockwise, shape (t, 3).
        region: 0 for a triangle of the upper block, 1 for the lower, shape (t,).
    """

    points: np.ndarray
    triangles: np.ndarray
    region: np.ndarray


def write_mesh(path: Path) -> Blocks:
    """Mesh both blocks in one piece and write the gmsh file."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", SIZE)
    occ = gmsh.model.occ
    upper = (2, occ.addRectangle(-1, 0, 0, 2, 1))
    lower = (2, occ.addRectangle(-1, -1, 0, 2, 1))
    occ.fragment([upper], [lower])
    occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [upper[1]], name="upper")
    gmsh.model.addPhysicalGroup(2, [lower[1]], name="lower")
    for _, curve in gmsh.model.getEntities(1):
        y = occ.getCenterOfMass(1, curve)[1]
        if abs(y) > 0.9:
            gmsh.model.addPhysicalGroup(1, [curve], name="top" if y > 0 else "bottom")
    gmsh.model.mesh.generate(2)
    gmsh.write(str(path))
    tags, x, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=int)
    number[tags] = np.arange(len(tags))
    triangles, region = [], []
    for index, (_, face) in enumerate((upper, lower)):
        _, nodes = gmsh.model.mesh.getElementsByType(2, face)
        triangles.append(number[nodes].reshape(-1, 3))
        region.append(np.full(len(triangles[-1]), index))
    gmsh.finalize()
    return Blocks(x.reshape(-1, 3)[:, :2], np.concatenate(triangles), np.concatenate(region))


def scene() -> ec.Scene:
    return ec.Scene(
        material=ec.Elastic(MODULI, NU),
        supports=[ec.Displacement("top", MOVED), ec.Displacement("bottom", (0.0, 0.0))],
        contacts=[ec.Contact("foot", friction=MU, against="seat")],
    )


def ours(path: Path, accuracy: float, name: str) -> Row:
    """Solve with this package, to an accuracy; 1 is reached on the first mesh."""
    began = process_time()
    domain = ec.read_mesh(path).split({"foot": "upper", "seat": "lower"})
    evolution = ec.evolve(lambda _: scene(), domain, [1.0], accuracy=accuracy, degree=2)
    seconds = process_time() - began
    error, step = evolution.error, evolution.steps[-1]
    unknowns = error.model.d * error.model.node_count
    said = f"at most {error.relative:.2%}, of all and of each element"
    return Row(name, error.force("foot").force, step.stored, unknowns, seconds, said)


def getfem(folder: Path, blocks: Blocks) -> Row:
    """Solve with GetFEM, in the Python of the system, which Debian's package is for."""
    np.savez(
        folder / "blocks.npz",
        points=blocks.points,
        triangles=blocks.triangles,
        region=blocks.region,
        moduli=list(MODULI.values()),
        moves=[MOVED, (0.0, 0.0)],
        nu=NU,
        mu=MU,
    )
    python = shutil.which("python3", path=os.defpath)
    if python is None:
        raise FileNotFoundError("No Python of the system is found.")
    script = Path(__file__).with_name("other_codes_getfem.py")
    output = run([python, str(script), str(folder)], folder)
    told = json.loads(output.splitlines()[-1])
    force = np.array(told["force"])
    name = f"GetFEM, {told['iterations']} iterations"
    return Row(name, force, told["energy"], told["unknowns"], told["seconds"], "nothing")


def run(command: list[str], folder: Path) -> str:
    """Run a program and return what it prints."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{command[0]} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def quadratic(blocks: Blocks) -> tuple[np.ndarray, np.ndarray]:
    """Split the interface and add nodes in the middles of the sides.

    Returns:
        Places of the nodes, shape (n, 2), and the six nodes of each triangle, in the
        order of CalculiX: corners, then the middles of sides 1-2, 2-3 and 3-1.
    """
    # A corner is known by its block and its number, a middle by its two corners.
    corners = blocks.triangles + blocks.region[:, None] * len(blocks.points)
    sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1), axis=-1)
    used, numbers = np.unique(corners, return_inverse=True)
    pairs, middles = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    x = blocks.points[used % len(blocks.points)]
    doubled = np.concatenate([blocks.points, blocks.points])
    places = np.concatenate([x, doubled[pairs].mean(axis=1)])
    elements = [numbers.reshape(-1, 3), len(x) + middles.reshape(-1, 3)]
    return places, np.concatenate(elements, axis=1)


def numbered(rows: np.ndarray) -> str:
    """Write rows of numbers, each with its own number, from 1 on."""
    lines = []
    for number, row in enumerate(rows, start=1):
        lines.append(", ".join([str(number), *(f"{value:.12g}" for value in row)]))
    return "\n".join(lines)


def deck(blocks: Blocks) -> tuple[str, int]:
    """Write the input of CalculiX, with a penalty at the contact, in 10 increments.

    Returns:
        The text, and the number of unknowns in the plane.
    """
    x, elements = quadratic(blocks)
    lines = ["*NODE, NSET=ALL", numbered(np.column_stack([x, np.zeros(len(x))]))]
    lines += ["*ELEMENT, TYPE=CPE6, ELSET=BODIES", numbered(elements + 1)]
    for index, (name, modulus) in enumerate(MODULI.items()):
        members = np.flatnonzero(blocks.region == index) + 1
        lines += [f"*ELSET, ELSET={name}", ",\n".join(map(str, members))]
        lines += [f"*MATERIAL, NAME=OF_{name}", "*ELASTIC", f"{modulus}, {NU}"]
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=OF_{name}", "1."]
        # Side k of a triangle has its corners k and k + 1.
        corners = x[elements[:, :3], 1]
        lines.append(f"*SURFACE, NAME=SIDE_{name}, TYPE=ELEMENT")
        for k in range(3):
            flat = (abs(corners[:, k]) < 1e-9) & (abs(corners[:, (k + 1) % 3]) < 1e-9)
            flat &= blocks.region == index
            lines += [f"{number + 1}, S{k + 1}" for number in np.flatnonzero(flat)]
    for name, y in (("TOP", 1.0), ("BOTTOM", -1.0)):
        members = np.flatnonzero(abs(x[:, 1] - y) < 1e-9) + 1
        lines += [f"*NSET, NSET={name}", ",\n".join(map(str, members))]
    stiffness = PENALTY * min(MODULI.values())
    lines += ["*SURFACE INTERACTION, NAME=JOINT"]
    lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiffness}"]
    lines += ["*FRICTION", f"{MU}, {stiffness / 10}"]
    lines += ["*CONTACT PAIR, INTERACTION=JOINT, TYPE=SURFACE TO SURFACE"]
    lines += ["SIDE_upper, SIDE_lower"]
    lines += ["*STEP", "*STATIC", "0.1, 1., 1e-5, 0.1"]
    lines += ["*BOUNDARY", "BOTTOM, 1, 2", f"TOP, 1, 1, {MOVED[0]}", f"TOP, 2, 2, {MOVED[1]}"]
    lines += ["*NODE PRINT, NSET=TOP, TOTALS=ONLY", "RF"]
    lines += ["*EL PRINT, ELSET=BODIES, TOTALS=ONLY", "ELSE"]
    lines += ["*EL FILE", "S, ERR", "*END STEP", ""]
    return "\n".join(lines), 2 * len(x)


def calculix(folder: Path, blocks: Blocks) -> Row:
    """Solve with CalculiX."""
    program = shutil.which("ccx")
    if program is None:
        raise FileNotFoundError("No ccx is found.")
    text, unknowns = deck(blocks)
    (folder / "blocks.inp").write_text(text)
    before = os.times()
    run([program, "blocks"], folder)
    after = os.times()
    seconds = after.children_user - before.children_user
    seconds += after.children_system - before.children_system
    printed = (folder / "blocks.dat").read_text().split("\n")
    totals = {}
    # Each increment prints a title, and the totals two lines below it.
    for title, values in zip(printed, printed[2:], strict=False):
        for word in ("total force", "total internal energy"):
            if word in title:
                totals[word] = np.array(values.split(), dtype=float)
    force = -totals["total force"][:2]
    energy = float(totals["total internal energy"][0])
    said = "jumps of the stress at nodes, no bound"
    return Row("CalculiX, penalty", force, energy, unknowns, seconds, said)


def main() -> None:
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "blocks.msh"
        blocks = write_mesh(path)
        # Once before it is timed, so that all forms are compiled.
        ours(path, 1.0, "")
        rows.append(ours(path, 1.0, "erc_contact, that mesh"))
        others: tuple[Callable[[Path, Blocks], Row], ...] = (getfem, calculix)
        for other in others:
            try:
                rows.append(other(folder, blocks))
            except (FileNotFoundError, RuntimeError) as failure:
                print(f"{other.__name__} is left out: {failure}")
        rows.append(ours(path, 0.01, "erc_contact, to 1%"))
        rows.append(ours(path, 0.002, "erc_contact, to 0.2%"))
    best = rows[-1]
    unit = rows[0].seconds
    print(f"{len(blocks.triangles)} triangles; seconds of the first row: {unit:.2f}")
    print("| program | F_x | F_y | energy | unknowns | seconds, ratio | its error |")
    print("|---|---|---|---|---|---|---|")
    for row in rows:
        numbers = [*row.force, row.energy]
        wanted = [*best.force, best.energy]
        cells = []
        for value, reference in zip(numbers, wanted, strict=True):
            cells.append(f"{value:.5g} ({value / reference - 1:+.2%})")
        cells += [str(row.unknowns), f"{row.seconds / unit:.1f}", row.error]
        print("|", " | ".join([row.name, *cells]), "|")


if __name__ == "__main__":
    main()
