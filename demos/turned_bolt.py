r"""
A bolt with a washer
====================

A bolt with a washer below its head clamps two steel plates, and then the plates are
pulled apart. Bolt, nut and washer are turned bodies, and so are the plates if one takes
a round piece of them, as large as the half of the distance to the next bolt. So the
mesh is the half plane of radius and axis, and eps is 5% where one quarter in 3D has
25% (:ref:`the bolt in 3D <sphx_glr_gallery_bolt.py>`).

A torque wrench gives the *force* of the bolt. The shank is cut by a plane, and
``ec.Preload`` draws the two sides of the cut together by the shift that this force
takes. Afterwards nobody turns the nut: the preload is *locked*, and the force changes
with the load.

Why a washer? It takes the force of the head from a ring of 9 mm to a ring of 11 mm. The
pressure on the plate is less, and it does not end at the edge of the head: it falls to
zero at the edge of the washer, which bends.

Friction is 0.15 in all contacts. Lengths are in mm, stresses in MPa; forces are of the
full ring.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact.output import draw_revolved

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/turned_bolt")
SHANK, HOLE, HEAD, WASHER, PLATE = 5.0, 5.5, 9.0, 11.0, 24.0
LOWER, CUT, UPPER, SEAT, TOP = -8.0, 4.0, 16.0, 18.0, 24.0
E, NU, MU, FORCE, PULL = 210e3, 0.3, 0.15, 20e3, 32e3

# %%
# The half plane is drawn in one piece. The bolt is two parts, above and below the cut:
# a shank with a head, and a shank with a nut.


def joint(size):
    """Half plane of the bolt, its washer and two plates."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    occ = gmsh.model.occ

    def ring(inner, outer, low, high):
        return [(2, occ.addRectangle(inner, low, 0, outer - inner, high - low))]

    above, _ = occ.fuse(ring(0, SHANK, CUT, TOP), ring(0, HEAD, SEAT, TOP))
    nut = ring(0, HEAD, LOWER - 6, LOWER)
    below, _ = occ.fuse(ring(0, SHANK, LOWER - 6, CUT), nut)
    rest = ring(HOLE, WASHER, UPPER, SEAT)
    rest += ring(HOLE, PLATE, 0, UPPER) + ring(HOLE, PLATE, LOWER, 0)
    _, pieces = occ.fragment(above, below + rest)
    occ.synchronize()
    names = ("above", "below", "washer", "upper", "lower")
    for name, piece in zip(names, pieces, strict=True):
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in piece], name=name)
    parts = {
        "top": ec.where(x=(WASHER, None), y=UPPER),
        "bottom": ec.where(x=(HEAD, None), y=LOWER),
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    domain = domain.split({"upper end": "above", "lower end": "below"})
    domain = domain.split({"head": "above", "washer top": "washer"})
    domain = domain.split({"washer foot": "washer", "seat": "upper"})
    domain = domain.split({"nut": "below", "seat of nut": "lower"})
    return domain.split({"joint": "upper", "joint below": "lower"})


# %%
# The bolt is tightened at :math:`t = 0`. Then the plates are pulled apart, by up to 1.6
# times the force of the bolt. The axis needs no condition.


def scene_at(t):
    """The bolt under its force, then locked under the part t of the pull."""
    contacts = [
        ec.Contact("head", against="washer top", friction=MU),
        ec.Contact("washer foot", against="seat", friction=MU),
        ec.Contact("nut", against="seat of nut", friction=MU),
        ec.Contact("joint", against="joint below", friction=MU),
    ]
    area = np.pi * (PLATE**2 - WASHER**2)
    pull = ec.Traction("top", (0.0, t * PULL / area))
    if t == 0:
        bolt = ec.Preload("upper end", against="lower end", force=FORCE)
    else:
        bolt = ec.Preload("upper end", against="lower end", locked=True)
    steel = ec.Elastic(E, NU, hypothesis="axisymmetric")
    held = ec.Displacement("bottom", (None, 0.0))
    return ec.Scene(steel, held, pull, contacts, ties=bolt, units="mm, N, MPa")


ec.log_to_console()
times = np.linspace(0.0, 1.0, 5)
evolution = ec.evolve(scene_at, joint(3.0), times, accuracy=0.03, degree=2)

# %%
# Forces along the axis. ``force`` is what the part that is named second exerts on the
# part that is named first.

of_bolt = -evolution.force("upper end")[:, 1]
of_head = evolution.force("head")[:, 1]
of_washer = evolution.force("washer foot")[:, 1]
of_joint = evolution.force("joint")[:, 1]
pull = np.array([error.reactions()["tractions"].force[1] for error in evolution.errors])
shifts = [error.solution.shortening("upper end") for error in evolution.errors]
gaps = [profile["gap"].min() for profile in evolution.profile("joint")]
tightened = {
    name: evolution.errors[0].profile(name) for name in ("head", "washer foot")
}

draw_revolved(evolution.errors[0], FOLDER / "tightened.png", angle=240.0)
if evolution.error.domain.comm.rank == 0:
    print(f"the bolt is shortened by {1e3 * shifts[0]:.2f} micrometres")
    for row in zip(pull, of_bolt, of_joint, gaps, strict=True):
        print(
            "pull {:.0f} N: bolt {:.0f} N, joint {:.0f} N, gap {:.1e} mm".format(*row)
        )
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    left.plot(pull / 1e3, of_bolt / 1e3, "C0o-", label="bolt")
    left.plot(pull / 1e3, of_joint / 1e3, "C1o-", label="joint")
    left.plot(pull / 1e3, pull / 1e3, "0.6", lw=0.8, label="pull")
    left.set(xlabel="pull [kN]", ylabel="force [kN]")
    labels = {"head": "head on washer", "washer foot": "washer on plate"}
    for name, label in labels.items():
        order = np.argsort(tightened[name]["x"])
        r, pressure = (tightened[name][column][order] for column in ("x", "pressure"))
        right.plot(r, pressure, lw=1, label=label)
    right.set(xlabel="$r$ [mm]", ylabel="pressure [MPa]", ylim=(0, 250))
    left.legend(frameon=False)
    right.legend(frameon=False)
    figure.savefig(FOLDER / "forces.png", dpi=150)

# %%
# What must hold: the force is the given one, and the shift stays. Bolt, head, washer,
# joint and pull are in balance, to round-off. The bolt feels little of the pull as long
# as the joint is closed, and all of it when it is open.

assert evolution.reached
assert np.isclose(of_bolt[0], FORCE, rtol=1e-9)
assert np.allclose(shifts, shifts[0], rtol=1e-12)
assert np.allclose(of_head, of_bolt, rtol=1e-8)
assert np.allclose(of_washer, of_bolt, rtol=1e-8)
assert np.allclose(of_bolt - of_joint, pull, atol=1e-8 * FORCE)
assert abs(of_bolt[1] - FORCE) < 0.05 * FORCE
assert np.isclose(of_bolt[-1], pull[-1], rtol=1e-8)
assert gaps[0] < 1e-3 * shifts[0] < gaps[-1]
