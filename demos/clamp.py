r"""
An assembly from CAD: a screw clamp
===================================

A STEP file holds three solids: the frame of a clamp, its screw, and the block that the
screw presses on the frame. The frame is held at its back, and 20 MPa press on the head
of the screw. How much of this force :math:`Q` reaches the block?

The thread ties the screw to the upper arm of the frame, so a part of :math:`Q` goes
back through the arm, which bends. The block touches the screw and the frame only: their
forces on it are opposite, and pass through one line. Lengths are in mm, stresses in
MPa.
"""

from pathlib import Path

import numpy as np

import erc_contact as ec
from erc_contact import output

FOLDER = Path("results/clamp")
PRESSURE = 20.0

# %%
# The solids become regions by their names, and what touches becomes pairs of parts.
# Faces that touch nothing are parts with numbers; the table says where they are.

ec.log_to_console()
path = Path(__file__).resolve().parents[1] / "meshes" / "clamp.step"
clamp = ec.read_mesh(path, size=8.0)
parts = clamp.parts()
pairs = clamp.touching()
if clamp.comm.rank == 0:
    print(parts)
    print(pairs)

# %%
# From the file to a certified force: the thread is tied, the other faces are contacts.

thread, *faces = pairs
scene = ec.Scene(
    ec.Elastic(210e3, 0.3),
    ec.Displacement("1", (0.0, 0.0, 0.0)),
    loads=ec.Traction("13", pressure=PRESSURE),
    ties=ec.Tied(*thread),
    contacts=[ec.Contact(*pair, friction=0.15) for pair in faces],
    units="mm, N, MPa",
)
history = ec.adapt(scene, clamp, accuracy=0.15, degree=2, strategy=ec.Mark())
force = history.force("screw on block").force

# %%
# The body under load, and what is found.

head = float(parts["area"][list(parts["name"]).index("13")])
applied = PRESSURE * head
opposite = history.force("frame on block").force
output.draw_deformed(history.error, FOLDER / "deformed.png")
if clamp.comm.rank == 0:
    print(f"{force[2]:.0f} N of {applied:.0f} N press the block")

# %%
# What must hold, by a certified 15%: the block is in balance, and a part of the force
# presses it.

assert history.reached
assert np.allclose(force + opposite, 0.0, atol=1e-6 * applied)
assert 0.2 * applied < force[2] < applied
