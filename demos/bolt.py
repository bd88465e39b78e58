r"""
A bolt that is tightened by a force
===================================

Two steel plates are held together by a bolt, and pulled apart. A torque wrench gives
the *force* of the bolt; how far it turns, and so how much shorter the bolt becomes,
follows from the stiffness of all that it clamps. Afterwards nobody turns the nut: the
shortening stays, and the force changes with the load.

``ec.Preload`` says both. The shank is cut by a plane, and the two sides of the cut move
by a common shift :math:`q` along the axis:

.. math:: u_1 - u_2 = q\,d, \qquad \sigma n \text{ equal on both sides.}

In the first step the force :math:`F` is given, and the shift is found. In the steps
after it the preload is *locked*. The cut is no contact: stresses go through it, and it
adds nothing to the error, which is the error of the body with this shift, and with
this force.

One quarter is computed, from CAD, with friction :math:`\mu = 0.15` below head and nut
and in the joint. The upper plate is twice as thick as the lower one, so nothing is
symmetric about the joint. Lengths are in mm, stresses in MPa.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact import output

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/bolt")
SHANK, HOLE, HEAD, HEIGHT, PLATE = 5.0, 5.5, 9.0, 6.0, 24.0
UPPER, LOWER, CUT = 16.0, -8.0, 4.0
E, NU, MU, FORCE, PULL = 210e3, 0.3, 0.15, 20e3, 32e3

# %%
# The bolt is two solids, above and below the cut. ``fragment`` makes one piece of all
# parts, with common faces where they touch. The cut and the three contacts are then
# pairs of sides.


def joint(size):
    """A quarter of two round plates with a bolt through their middle."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
    occ = gmsh.model.occ

    def quarter(low, high, radius):
        cylinder = occ.addCylinder(0, 0, low, 0, 0, high - low, radius, angle=np.pi / 2)
        return 3, cylinder

    above, _ = occ.fuse(
        [quarter(CUT, UPPER, SHANK)], [quarter(UPPER, UPPER + HEIGHT, HEAD)]
    )
    below, _ = occ.fuse(
        [quarter(LOWER, CUT, SHANK)], [quarter(LOWER - HEIGHT, LOWER, HEAD)]
    )
    upper, _ = occ.cut([quarter(0, UPPER, PLATE)], [quarter(0, UPPER, HOLE)])
    lower, _ = occ.cut([quarter(LOWER, 0, PLATE)], [quarter(LOWER, 0, HOLE)])
    _, pieces = occ.fragment(above, [*below, *upper, *lower])
    occ.synchronize()
    for name, piece in zip(("above", "below", "upper", "lower"), pieces, strict=True):
        tags = [tag for _, tag in piece]
        gmsh.model.addPhysicalGroup(3, tags, name=name)

    def ring(height):
        def is_there(x):
            radius = np.hypot(x[0], x[1])
            return np.isclose(x[2], height) & (radius > HEAD - 1e-6)

        return is_there

    parts = {
        "symmetry x": ec.where(x=0.0),
        "symmetry y": ec.where(y=0.0),
        "top": ring(UPPER),
        "bottom": ring(LOWER),
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    domain = domain.split({"upper end": "above", "lower end": "below"})
    domain = domain.split({"head": "above", "seat of head": "upper"})
    domain = domain.split({"nut": "below", "seat of nut": "lower"})
    return domain.split({"joint": "upper", "joint below": "lower"})


# %%
# The bolt is tightened at :math:`t = 0`. Then the plates are pulled apart, by up to 1.6
# times the force of the bolt.


def scene_at(t):
    """The bolt under its force, then locked under the part t of the pull."""
    supports = [
        ec.Symmetry("symmetry x"),
        ec.Symmetry("symmetry y"),
        ec.Displacement("bottom", (None, None, 0.0)),
    ]
    contacts = [
        ec.Contact("head", against="seat of head", friction=MU),
        ec.Contact("nut", against="seat of nut", friction=MU),
        ec.Contact("joint", against="joint below", friction=MU),
    ]
    area = np.pi * (PLATE**2 - HEAD**2)
    pull = ec.Traction("top", (0.0, 0.0, t * PULL / area))
    if t == 0:
        bolt = ec.Preload("upper end", against="lower end", force=FORCE / 4)
    else:
        bolt = ec.Preload("upper end", against="lower end", locked=True)
    return ec.Scene(
        ec.Elastic(E, NU), supports, pull, contacts, ties=bolt, units="mm, N, MPa"
    )


ec.log_to_console()
times = np.linspace(0.0, 1.0, 5)
evolution = ec.evolve(scene_at, joint(6.0), times, accuracy=0.25, degree=2)

# %%
# Forces of the whole bolt, which is four quarters. ``force`` is what the lower half of
# the bolt exerts on the upper one.

of_bolt = -4 * evolution.force("upper end")[:, 2]
of_joint = 4 * evolution.force("joint")[:, 2]
pull = 4 * np.array(
    [error.reactions()["tractions"].force[2] for error in evolution.errors]
)
shifts = [error.solution.shortening("upper end") for error in evolution.errors]
gaps = [profile["gap"].min() for profile in evolution.profile("joint")]

output.draw_deformed(evolution.errors[0], FOLDER / "tightened.png")
output.draw_deformed(evolution.error, FOLDER / "pulled.png")
if evolution.error.domain.comm.rank == 0:
    print(f"the bolt is shortened by {1e3 * shifts[0]:.2f} micrometres")
    for row in zip(pull, of_bolt, of_joint, gaps, strict=True):
        print(
            "pull {:.0f} N: bolt {:.0f} N, joint {:.0f} N, gap {:.1e} mm".format(*row)
        )
    figure, axes = plt.subplots(figsize=(5.6, 3.8), layout="constrained")
    axes.plot(pull / 1e3, of_bolt / 1e3, "C0o-", label="bolt")
    axes.plot(pull / 1e3, of_joint / 1e3, "C1o-", label="joint")
    axes.plot(pull / 1e3, pull / 1e3, "0.6", lw=0.8, label="pull")
    axes.set(xlabel="pull [kN]", ylabel="force [kN]")
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "forces.png", dpi=150)

# %%
# What must hold: the force is the given one, and the shift stays. Bolt, joint and pull
# are in balance, to round-off. The bolt feels little of the pull as long as the joint
# is closed, and all of it when it is open.

assert evolution.reached
assert np.isclose(of_bolt[0], FORCE, rtol=1e-9)
assert np.allclose(shifts, shifts[0], rtol=1e-12)
assert np.allclose(of_bolt - of_joint, pull, atol=1e-9 * FORCE)
assert abs(of_bolt[1] - FORCE) < 0.05 * FORCE
assert np.isclose(of_bolt[-1], pull[-1], rtol=1e-9)
assert gaps[0] < 1e-3 * shifts[0] < gaps[-1]
