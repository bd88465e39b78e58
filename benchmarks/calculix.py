"""Compute the block of ``demos/other_code.py`` by CalculiX, and write its results.

CalculiX (``ccx`` from Debian's calculix-ccx) has contact by a penalty: it needs a
stiffness of the contact, and the block enters the foundation by pressure over
stiffness. The mesh and the results for three stiffnesses go to ``meshes/calculix``,
where the demo reads them, so that it runs without CalculiX.

    python benchmarks/calculix.py
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import gmsh
import meshio
import numpy as np

FOLDER = Path(__file__).resolve().parent.parent / "meshes" / "calculix"
SIZE = 0.2
STIFFNESSES = (10, 100, 1000)
"""Pressure over penetration, in units of E over the unit of length."""
STRIPS = 4
"""Elements of the foundation, whose nodes are all fixed."""


def meshed() -> tuple[np.ndarray, np.ndarray]:
    """Mesh the block, and write its mesh of degree 1.

    Returns:
        Nodes and triangles of degree 2, shapes (n, 2) and (t, 6).
    """
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", SIZE)
    gmsh.option.setNumber("Mesh.MeshSizeMax", SIZE)
    face = gmsh.model.occ.addRectangle(0, 0, 0, 2, 2)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [face], name="block")
    for name, curve in {"bottom": 1, "right": 2, "top": 3, "left": 4}.items():
        gmsh.model.addPhysicalGroup(1, [curve], name=name)
    gmsh.model.mesh.generate(2)
    gmsh.write(str(FOLDER / "block.msh"))
    gmsh.model.mesh.setOrder(2)
    tags, x, _ = gmsh.model.mesh.getNodes()
    _, nodes = gmsh.model.mesh.getElementsByType(9)
    gmsh.finalize()
    order = np.argsort(tags)
    triangles = np.searchsorted(tags[order], nodes).reshape(-1, 6)
    return x.reshape(-1, 3)[order, :2], triangles


def deck(x: np.ndarray, triangles: np.ndarray, stiffness: float) -> str:
    """Return the input of CalculiX; its numbers begin with 1."""
    first = len(x) + 1
    count = len(triangles)
    lines = ["*NODE, NSET=BODY"]
    lines += [f"{i},{p[0]:.16g},{p[1]:.16g},0." for i, p in enumerate(x, start=1)]
    lines += ["*NODE, NSET=BASE"]
    for row, y in enumerate((-0.5, 0.0)):
        for i, at in enumerate(np.linspace(-1.0, 3.0, STRIPS + 1)):
            lines.append(f"{first + row * (STRIPS + 1) + i},{at:.16g},{y:.16g},0.")
    lines += ["*ELEMENT, TYPE=CPE6, ELSET=BLOCK"]
    for i, nodes in enumerate(triangles + 1, start=1):
        lines.append(f"{i}," + ",".join(map(str, nodes)))
    lines += ["*ELEMENT, TYPE=CPE4, ELSET=GROUND"]
    for i in range(STRIPS):
        low, high = first + i, first + STRIPS + 1 + i
        lines.append(f"{count + 1 + i},{low},{low + 1},{high + 1},{high}")
    lines += ["*NSET, NSET=TOP"]
    lines += [f"{i}," for i in np.flatnonzero(abs(x[:, 1] - 2) < 1e-9) + 1]
    lines += ["*SURFACE, NAME=FOOT"]
    for side, ends in enumerate(((0, 1), (1, 2), (2, 0)), start=1):
        on_foot = (abs(x[triangles[:, ends], 1]) < 1e-9).all(axis=1)
        lines += [f"{i},S{side}" for i in np.flatnonzero(on_foot) + 1]
    lines += ["*SURFACE, NAME=FLOOR"]
    lines += [f"{count + 1 + i},S3" for i in range(STRIPS)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", "1.,0.3"]
    for elements in ("BLOCK", "GROUND"):
        lines += [f"*SOLID SECTION, ELSET={elements}, MATERIAL=M", "1."]
    lines += ["*SURFACE INTERACTION, NAME=I"]
    lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiffness:g},1e-4"]
    lines += ["*FRICTION", f"0.3,{stiffness / 10:g}"]
    lines += ["*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE", "FOOT,FLOOR"]
    lines += ["*BOUNDARY", "BASE,1,2,0.", "*STEP, INC=200", "*STATIC", "0.1,1.,1e-5,0.2"]
    lines += ["*BOUNDARY", "TOP,1,1,0.02", "TOP,2,2,-0.05"]
    lines += ["*NODE FILE, OUTPUT=2D", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def displacements(file: Path, count: int) -> np.ndarray:
    """Read the last displacements of the first nodes of a file, shape (count, 2)."""
    result = np.full((count, 2), np.nan)
    is_displacement = False
    for line in file.read_text().splitlines():
        if line.startswith((" -4", " -3")):
            is_displacement = line.startswith(" -4  DISP")
        if is_displacement and line.startswith(" -1") and int(line[3:13]) <= count:
            result[int(line[3:13]) - 1] = float(line[13:25]), float(line[25:37])
    return result


def main() -> None:
    if shutil.which("ccx") is None:
        sys.exit("CalculiX is not installed: there is no command ccx.")
    FOLDER.mkdir(parents=True, exist_ok=True)
    x, triangles = meshed()
    for stiffness in STIFFNESSES:
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "block.inp").write_text(deck(x, triangles, stiffness))
            subprocess.run(["ccx", "block"], cwd=folder, check=True, capture_output=True)
            u = displacements(Path(folder, "block.frd"), len(x))
        cells = [("triangle6", triangles)]
        points = np.column_stack([x, np.zeros(len(x))])
        result = meshio.Mesh(points, cells, point_data={"displacement": u})
        result.write(FOLDER / f"block_{stiffness}.vtu")
        print(stiffness, abs(u).max(axis=0))


if __name__ == "__main__":
    main()
