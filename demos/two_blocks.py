r"""
Two blocks pressed and sheared
==============================

A block stands on another one, which is wider and stiffer and held at its bottom. The
top of the upper block is pressed down and pushed to the right. Both bend, and where
they touch the laws of contact and friction hold between them: they cannot enter each
other, they can push and not pull, and the shear is at most :math:`\mu p`.

These laws speak of the *jump*, how far the surface of one body has moved less how far
the other has: along the normal it closes or opens the gap, across it is slip. What the
upper block feels, the lower one feels the other way round.

The block is narrower than what it stands on. Its corners press into the flat surface,
and the stress is not smooth there. The shear presses the right corner more and lifts
the left one. So the loop refines at the corners, on both sides of the contact alike,
as their facets match once the blocks are joined.
"""

import numpy as np

import erc_contact as ec

MU, E_UPPER, E_LOWER = 0.5, 1.0, 3.0
FORCE = (-0.02113, 0.04892)  # of a run to 0.1%

# %%
# Each block has a mesh of its own, and the upper mesh is finer: their vertices do not
# match. ``assembly`` puts both in one mesh, where their names stand before the names of
# their parts. ``joined`` makes a pair of the sides that lie against each other.
# Vertices that are close become one, and the triangles beside the contact are cut where
# the other side has a vertex. What remains of the lower block's top is "lower top
# outside".

upper = ec.rectangle((-1.0, 0.0), (1.0, 2.0), size=0.4)
lower = ec.rectangle((-2.0, -1.5), (2.0, 0.0), size=0.55)
blocks = ec.assembly({"upper": upper, "lower": lower})
domain = blocks.joined("upper bottom", "lower top")

# %%
# From here on each facet of the contact faces one of the other block, corner to corner,
# on all meshes of the run.

ec.log_to_console()
scene = ec.Scene(
    material=ec.Elastic(E={"upper": E_UPPER, "lower": E_LOWER}, nu=0.3),
    supports=[
        ec.Displacement("upper top", (0.1, -0.05)),
        ec.Displacement("lower bottom", (0.0, 0.0)),
    ],
    contacts=[ec.Contact("upper bottom", against="lower top", friction=MU)],
)
history = ec.adapt(scene, domain, accuracy=0.01, degree=2)
history.save("results/two_blocks", pictures=True)

# %%
# Each side has its force, and they are opposite. The profile belongs to the pair: its
# gap and its slip are of one body against the other.

error = history.error
contact = error.profile("upper bottom")
of_upper, of_lower = error.force("upper bottom"), error.force("lower top")
supports = error.reactions()
status = contact["status"]
shares = {
    name: contact["weight"][status == value].sum() / contact["weight"].sum()
    for name, value in (
        ("open", ec.results.OPEN),
        ("slip", ec.results.SLIP),
        ("stick", ec.results.STICK),
    )
}
if domain.comm.rank == 0:
    print(
        f"force on the upper block {of_upper.force}, on the lower one {of_lower.force}"
    )
    print(", ".join(f"{name} {share:.1%}" for name, share in shares.items()))

# %%
# What must hold: action and reaction are opposite, in force and moment; each block is
# in equilibrium with its support; the certified traction obeys contact and friction;
# the force agrees with a run to 0.1%; the contact opens at the left, slips, and sticks.

scale = abs(of_upper.force).max()
assert history.reached
assert np.allclose(of_upper.force, -of_lower.force, atol=1e-10 * scale)
assert np.allclose(of_upper.moment, -of_lower.moment, atol=1e-10 * scale)
assert np.allclose(of_upper.force, -supports["upper top"].force, atol=1e-10 * scale)
assert np.allclose(of_lower.force, -supports["lower bottom"].force, atol=1e-10 * scale)
assert np.all(contact["pressure"] >= 0.0)
assert np.all(abs(contact["shear"]) <= contact["friction_bound"] * (1 + 1e-12))
assert np.all(contact["gap"] >= -1e-12)
assert np.allclose(of_upper.force, FORCE, rtol=5e-3)
assert min(shares.values()) > 0.03
assert contact["x"][status == ec.results.OPEN].max() < -0.8
