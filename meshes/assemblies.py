"""Draws two assemblies, as CAD would write them: python meshes/assemblies.py.

``clamp.step`` is a C-clamp with a workpiece (3 solids), ``bolted_flange.step`` two pipe
flanges with four bolts and nuts (10 solids). Lengths are in mm, and solids have names.
"""

import re
from pathlib import Path

import gmsh

HERE = Path(__file__).parent
PRODUCT = r"'Open CASCADE STEP translator [\d.]+ \d+\.{number}'"
"""Name that OpenCASCADE gives to a solid."""


def write(name, solids):
    """Write solids with names; gmsh's writer has none."""
    path = HERE / name
    gmsh.model.occ.synchronize()
    gmsh.write(str(path))
    gmsh.clear()
    text = path.read_text()
    for number, solid in enumerate(solids, start=1):
        text = re.sub(PRODUCT.replace("{number}", str(number)), f"'{solid}'", text)
    path.write_text(re.sub(r"(FILE_NAME\('[^']*',')[^']*", r"\g<1>2026-01-01T00:00:00", text))


def clamp():
    """A frame of 60 x 20 x 60 like a C; a screw presses a block on its lower jaw."""
    occ = gmsh.model.occ
    frame = occ.addBox(0, 0, 0, 60, 20, 60)
    mouth = occ.addBox(15, 0, 12, 45, 20, 33)
    thread = occ.addCylinder(45, 10, 45, 0, 0, 15, 5)
    occ.cut([(3, frame)], [(3, mouth), (3, thread)])
    screw = occ.addCylinder(45, 10, 32, 0, 0, 38, 5)
    block = occ.addBox(30, 2, 12, 30, 16, 20)
    write("clamp.step", {"frame": frame, "screw": screw, "block": block})


def bolted_flange():
    """Flanges of 120 mm about a pipe of 60 mm, each 12 mm thick."""
    occ = gmsh.model.occ
    solids = {}
    places = [(42, 0), (0, 42), (-42, 0), (0, -42)]
    for name, floor, pipe in (("lower flange", -12, -40), ("upper flange", 0, 12)):
        disc = occ.addCylinder(0, 0, floor, 0, 0, 12, 60)
        wall = occ.addCylinder(0, 0, pipe, 0, 0, 28, 30)
        bore = occ.addCylinder(0, 0, -40, 0, 0, 80, 22)
        holes = [occ.addCylinder(x, y, floor, 0, 0, 12, 6) for x, y in places]
        ((_, body),), _ = occ.fuse([(3, disc)], [(3, wall)])
        cut, _ = occ.cut([(3, body)], [(3, tool) for tool in (bore, *holes)])
        solids[name] = cut[0][1]
    for number, (x, y) in enumerate(places, start=1):
        shank = occ.addCylinder(x, y, -20, 0, 0, 32, 5)
        head = occ.addCylinder(x, y, 12, 0, 0, 7, 9)
        bolt, _ = occ.fuse([(3, shank)], [(3, head)])
        nut = occ.addCylinder(x, y, -20, 0, 0, 8, 9)
        thread = occ.addCylinder(x, y, -20, 0, 0, 8, 5)
        occ.cut([(3, nut)], [(3, thread)])
        solids[f"bolt {number}"] = bolt[0][1]
        solids[f"nut {number}"] = nut
    # gmsh writes solids in the order of their tags.
    write("bolted_flange.step", sorted(solids, key=solids.__getitem__))


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
clamp()
bolted_flange()
gmsh.finalize()
