r"""
Two blocks pressed and sheared
==============================

A block stands on another one, which is wider and stiffer and held at its bottom. The
top of the upper block is pressed down and pushed to the right. Both bend, and where
they touch the laws of contact and friction hold between them: they cannot enter each
other, they can push and not pull, and the shear is at most :math:`\mu p`.

These laws speak of the *jump*, how far the surface of one body has moved less that of
the other: along the normal it closes or opens the gap, across it is slip. What the
upper block feels, the lower one feels the other way round.

The block is narrower than what it stands on. Its corners press into the flat surface,
and the stress is not smooth there. The shear presses the right corner more and lifts
the left one. So the loop refines at the corners, on both sides of the contact alike,
as their facets match.
"""

import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

MU, E_UPPER, E_LOWER = 0.5, 1.0, 3.0
FORCE = (-0.02113, 0.04892)  # of a run to 0.1%

# %%
# Both blocks are meshed in one piece: ``fragment`` makes the common part of their sides
# one line. The physical groups of surfaces are the regions, those of lines the parts.


def blocks():
    """An upper block of 2 x 2 on a lower one of 4 x 1.5."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    upper = (2, gmsh.model.occ.addRectangle(-1.0, 0.0, 0.0, 2.0, 2.0))
    lower = (2, gmsh.model.occ.addRectangle(-2.0, -1.5, 0.0, 4.0, 1.5))
    gmsh.model.occ.fragment([upper], [lower])
    gmsh.model.occ.synchronize()
    heights = {
        curve: gmsh.model.occ.getCenterOfMass(1, curve)[1]
        for _, curve in gmsh.model.getEntities(1)
    }
    gmsh.model.addPhysicalGroup(2, [upper[1]], name="upper")
    gmsh.model.addPhysicalGroup(2, [lower[1]], name="lower")
    for name, pick in (("top", max), ("bottom", min)):
        curve = pick(heights, key=heights.__getitem__)
        gmsh.model.addPhysicalGroup(1, [curve], name=name)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain


# %%
# ``split`` makes two boundary parts of the line between the regions, "foot" of the
# upper block and "seat" of the lower one. Their facets go on to match.

ec.log_to_console()
domain = blocks().split({"foot": "upper", "seat": "lower"})
scene = ec.Scene(
    material=ec.Elastic(E={"upper": E_UPPER, "lower": E_LOWER}, nu=0.3),
    supports=[
        ec.Displacement("top", (0.1, -0.05)),
        ec.Displacement("bottom", (0.0, 0.0)),
    ],
    contacts=[ec.Contact("foot", against="seat", friction=MU)],
)
history = ec.adapt(scene, domain, accuracy=0.01, degree=2)
history.save("results/two_blocks")

# %%
# Each side has its force, and they are opposite. The profile is that of the pair: its
# gap and its slip are of one body against the other.

error = history.error
contact = error.profile("foot")
of_foot, of_seat = error.force("foot"), error.force("seat")
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
if domain.mesh.comm.rank == 0:
    print(f"force on the upper block {of_foot.force}, on the lower one {of_seat.force}")
    print(", ".join(f"{name} {share:.1%}" for name, share in shares.items()))

# %%
# What must hold: action and reaction are opposite, in force and moment; each block is
# in equilibrium with its support; the certified traction obeys contact and friction;
# the force is that of a run to 0.1%; the contact opens at the left, slips, and sticks.

scale = abs(of_foot.force).max()
assert history.reached
assert np.allclose(of_foot.force, -of_seat.force, atol=1e-10 * scale)
assert np.allclose(of_foot.moment, -of_seat.moment, atol=1e-10 * scale)
assert np.allclose(of_foot.force, -supports["top"].force, atol=1e-10 * scale)
assert np.allclose(of_seat.force, -supports["bottom"].force, atol=1e-10 * scale)
assert np.all(contact["pressure"] >= 0.0)
assert np.all(abs(contact["shear"]) <= contact["friction_bound"] * (1 + 1e-12))
assert np.all(contact["gap"] >= -1e-12)
assert np.allclose(of_foot.force, FORCE, rtol=5e-3)
assert min(shares.values()) > 0.03
assert contact["x"][status == ec.results.OPEN].max() < -0.8
