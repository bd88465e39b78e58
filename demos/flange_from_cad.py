r"""
An assembly from CAD: a bolted flange
=====================================

A STEP file holds ten solids: two pipe flanges, four bolts and four nuts. The bolts are
tightened, by a strain of their own of :math:`-10^{-3}` along their axes, and then the
pipe is pulled by 20 MPa. How much force is left in the joint?

The threads tie the nuts to the bolts. Heads, nuts and flanges are in contact with
friction, in nine pairs that the file itself tells: ``touching()`` lists the faces that
lie on each other, and each pair becomes a contact or a tied joint. Lengths are in mm,
stresses in MPa.
"""

from pathlib import Path

import numpy as np

import erc_contact as ec
from erc_contact import output

FOLDER = Path("results/flange_from_cad")
PULL = 20.0
PATH = Path(__file__).resolve().parents[1] / "meshes" / "bolted_flange.step"

# %%
# From the file to a certified force.

ec.log_to_console()
ends = {"held": ec.where(z=-40.0), "pulled": ec.where(z=40.0)}
flange = ec.read_mesh(PATH, size=12.0, parts=ends)
threads = flange.touching("bolt *", "nut *")
faces = [pair for pair in flange.touching() if pair not in threads]
shortened = np.diag([0.0, 0.0, -1e-3])
scene = ec.Scene(
    ec.Elastic(210e3, 0.3),
    ec.Displacement("held", (0.0, 0.0, 0.0)),
    loads=ec.Traction("pulled", pressure=-PULL),
    strains=ec.Eigenstrain({f"bolt {i}": shortened for i in (1, 2, 3, 4)}),
    ties=[ec.Tied(*pair) for pair in threads],
    contacts=[ec.Contact(*pair, friction=0.15) for pair in faces],
    units="mm, N, MPa",
)
error = ec.constitutive_error(ec.equilibrate(ec.solve(scene, flange)))

# %%
# The joint keeps what the bolts do not give to the pull. At degree 1 the error is some
# 40%, and at degree 2 half of it, in four times the time.

parts = flange.parts()
area = parts["area"][list(parts["name"]).index("pulled")]
pull = PULL * float(area)
bolts = sum(error.force(f"bolt {i} on upper flange").force for i in (1, 2, 3, 4))
joint = error.force("upper flange on lower flange").force
output.draw_deformed(error, FOLDER / "deformed.png")
if flange.comm.rank == 0:
    print(f"bolts {bolts[2]:.0f} N, pull {pull:.0f} N, joint {joint[2]:.0f} N")
    print(f"error {error.relative:.0%}")

# %%
# Bolts hold the pull and the joint, whose force is less than their own and not lost.

assert abs(bolts[2] - joint[2] - pull) < 1e-6 * pull
assert 0.3 * bolts[2] < joint[2] < bolts[2]
assert error.relative < 0.5
