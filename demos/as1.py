r"""
An assembly from CAD: 18 solids
===============================

``as1-tu-203.stp`` is a test of CAD programs that ships with gmsh: a plate, two brackets
that six bolts hold on it, and a rod between the brackets. It has 32 places of touch.
Bolts and rod are tightened, here by a strain of :math:`-5 \cdot 10^{-4}`; their threads
are tied. With which force does the nut of the rod press its bracket, and
what reaches the plate?

The file tells which solids there are and which of them touch. The scene says what the
places of touch do: some press, with friction, and others hold for good. All of it is
solved together, on one mesh, and the error says how far the forces may be trusted.

Lengths are in mm, the unit of the file, and stresses in MPa.
"""

import sys
from pathlib import Path

import gmsh
import numpy as np

import erc_contact as ec
from erc_contact import output

FOLDER = Path("results/as1")
PATH = Path(gmsh.__file__).parents[3] / "share/doc/gmsh/examples/boolean/as1-tu-203.stp"
if not PATH.is_file():
    sys.exit(f"{PATH} is not there: it comes with gmsh's wheel, pip install gmsh.")

# %%
# From the file to a certified force: the underside of the plate gets a name by a rule,
# threads are tied, and what presses is a contact. Shanks in their holes are modelled
# without play; tightened they are thinner than the holes, and their pairs are left out.

ec.log_to_console()
base = {"base": ec.where(z=0.0, region="plate")}
assembly = ec.read_mesh(PATH, size=50.0, parts=base)
pressed = [("nut *", "plate"), ("nut *", "l-*"), ("bolt *", "l-*"), ("l-*", "plate")]
faces = [pair for names in pressed for pair in assembly.touching(*names)]
places = assembly.touching()
scene = ec.Scene(
    ec.Elastic(210e3, 0.3),
    ec.Displacement("base", (0.0, 0.0, 0.0)),
    strains=ec.Eigenstrain(
        {r: -5e-4 for r in assembly.regions if r[:2] in ("bo", "ro")}
    ),
    ties=[ec.Tied(*pair) for pair in assembly.touching("nut *", "[br]o*")],
    contacts=[ec.Contact(*pair, friction=0.15) for pair in faces],
    units="mm, N, MPa",
)
error = ec.constitutive_error(ec.equilibrate(ec.solve(scene, assembly)))

# %%
# The forces of the joints. At degree 1 and with one cell across a shank the error is
# large: it says that these forces are a first guess. Degree 2 or ``ec.adapt`` makes it
# smaller.

rod = error.force("nut 1 on l-bracket 2").force
brackets = [error.force(f"l-bracket {i} on plate").force for i in (1, 2)]
bolts = sum(
    error.force(pair.facets).force for pair in assembly.touching("bolt *", "l-*")
)
output.draw_deformed(error, FOLDER / "deformed.png")
if assembly.comm.rank == 0:
    print(places)
    print(f"{abs(rod[0]):.0f} N from nut to bracket; error {error.relative:.0%}")

# %%
# The nuts at both ends of the rod press alike, and what the bolts press on the brackets
# is what the brackets press on the plate.

other = error.force("nut 2 on l-bracket 1").force
assert np.allclose(rod, -other, atol=1e-6 * abs(rod[0]))
assert np.isclose(abs(bolts[2]), abs(sum(brackets)[2]), rtol=1e-6)
assert error.relative < 0.7
