r"""
A block pressed and sheared
===========================

A block stands on a rigid foundation. Its top is pressed down and pushed to the right,
and a traction on its right side pushes back a little. We want the contact force, and we
want to know how wrong it is.

Three laws act at the contact. The block cannot enter the foundation: the gap :math:`g`
stays :math:`\ge 0`. The foundation can push and cannot pull: the pressure :math:`p` is
:math:`\ge 0`, and it is zero where the gap is open. And Coulomb's friction: the shear
:math:`q` is at most :math:`\mu p`. Where it is less, the point *sticks*; where a point
*slips*, the shear is :math:`\mu p` and against the slip.

Which points stick, slip or open is not known in advance. This makes contact nonlinear,
even for small strains. Where the status changes, and at the ends of the supports, the
stress is not smooth. A uniform mesh is then a waste: the error sits in a few places.
Here a loop measures the error of each element and refines where it is large, until the
error of the whole solution is certified to be below 1%.

The block has the size of the example of Coorevits, Hild and Hjiaj, 2 x 7, with friction
0.3 at its bottom. Run it with

.. code-block:: console

    python demos/block.py
    mpirun -n 2 python demos/block.py
"""

import numpy as np

import erc_contact as ec

ec.log_to_console()  # progress, rank 0 only

# %%
# The body is a mesh whose boundary parts have names: left, right, bottom, top.

block = ec.rectangle((0.0, 0.0), (2.0, 7.0), size=0.5)

# %%
# The scene says what the body is made of and what acts on it. It knows no mesh, so it
# serves all of them. Units are any consistent system; here lengths in metres, and
# stresses over Young's modulus.

scene = ec.Scene(
    material=ec.Elastic(E=1.0, nu=0.3),  # plane strain unless said otherwise
    supports=[ec.Displacement("top", (0.1, -0.05))],  # None leaves a component free
    loads=[ec.Traction("right", (-0.0002, 0.0))],
    contacts=[
        ec.Contact("bottom", friction=0.3)
    ],  # change the friction coefficient and look again
)

# %%
# Solve, measure, refine, until the relative error is 1%. The table has one row a mesh:
# N counts Newton's steps, eps is the error, bulk and contact are its two parts.

history = ec.adapt(scene, block, accuracy=0.01)

# %%
# The table, the error against run time, the meshes, the deformed body and the tractions
# on the contact are written to a folder, and files for ParaView with them. The bottom
# opens at the left, slips, sticks in the middle, and slips again at the right.

history.save("results/block", pictures=True)

# %%
# What must hold: the accuracy is reached, the certified traction obeys contact and
# friction, all forces balance, and the foundation has the force that several
# independent codes have on a fine mesh.

error = history.error
contact = error.profile(
    "bottom"
)  # position, gap, slip, pressure, shear, friction bound, status
force, balance = error.force("bottom").force, error.reactions()["balance"].force
assert history.reached
assert np.all(contact["pressure"] >= 0.0)
assert np.all(abs(contact["shear"]) <= contact["friction_bound"] * (1 + 1e-12))
assert np.allclose(balance, 0.0, atol=1e-12)
assert np.allclose(force, (-0.001346, 0.015993), rtol=5e-3)
