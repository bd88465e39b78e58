"""A block pressed and sheared on a rigid foundation, to an accuracy of 1%.

The block has the size of the example of Coorevits, Hild and Hjiaj, 2 x 7, with friction 0.3 at its bottom. It is
pressed down and pushed to the right at its top; a traction on its right side pushes back. At its bottom it opens at
the left, slips, sticks in the middle, and slips again at the right. Run it with

    python demos/block.py            or            mpirun -n 2 python demos/block.py

and look into results/block: the table, the error against run time, the meshes, the deformed body and the contact.
"""

import numpy as np

import erc_contact as ec

ec.log_to_console()

block = ec.rectangle((0.0, 0.0), (2.0, 7.0), size=0.5)  # boundary parts: left right bottom top

scene = ec.Scene(
    material=ec.Elastic(E=1.0, nu=0.3),  # plane strain unless said otherwise
    supports=[ec.Displacement("top", (0.1, -0.05))],  # None leaves a component free
    loads=[ec.Traction("right", (-0.0002, 0.0))],
    contacts=[ec.Contact("bottom", friction=0.3)],  # change the friction coefficient and look again
)

history = ec.adapt(scene, block, accuracy=0.01)
history.save("results/block")

# What must hold: the accuracy is reached, the certified traction obeys contact and friction, all forces balance, and
# the force of the foundation is that of several independent codes on a fine mesh.
error = history.error
contact = error.profile("bottom")  # position, gap, slip, pressure, shear, friction bound, status
force, balance = error.force("bottom").force, error.reactions()["balance"].force
assert history.reached
assert np.all(contact["pressure"] >= 0.0)
assert np.all(abs(contact["shear"]) <= contact["friction_bound"] * (1 + 1e-12))
assert np.allclose(balance, 0.0, atol=1e-12)
assert np.allclose(force, (-0.001346, 0.015993), rtol=5e-3)
