r"""
A bolted flange whose joint opens
=================================

A wall is bolted to a base by a flange, and is pulled up. The bolt is beside the wall,
so the pull bends the flange: the joint opens below the wall, and behind the bolt the
flange presses on the base. This is a segment of a ring flange with one bolt, from CAD,
in steel with :math:`\mu = 0.15` in the joint; one half of it is computed.

A bolt is tightened before anything pulls. While the joint is closed, more pull relieves
the joint and the bolt feels next to nothing of it. This is what preload is for: a bolt
that does not feel the load does not tire. When the joint opens, the bolt takes all of
the pull that is added, and more by the lever.

Two contacts make the model. The joint has friction and may open. The bolt is cut, and
its two ends are drawn together by a *bilateral* contact: its jump is the tightening
:math:`\delta`, whatever the force. The bolt force is the force of this contact. The
head of the bolt and the flange, and the bolt and the base into which it is screwed, are
in one piece. Lengths are in mm, stresses in MPa.

The corners of head and thread are singular, and friction at the joint is Coulomb's. A
certified 20% of all of the stress field is what a coarse mesh of 1603 elements of
degree 2 reaches. Forces are much better than that.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact import output

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/flange")
LENGTH, WIDTH, PLATE, BASE = 60.0, 20.0, 15.0, 20.0
WALL, TOP = 8.0, 50.0
BOLT_X, BOLT, HOLE, HEAD, HEAD_HEIGHT, CUT = 34.0, 6.0, 7.0, 10.0, 8.0, 8.0
E, NU, MU, TIGHTENED, PULL = 210e3, 0.3, 0.15, 0.03, 30.0

# %%
# The flange is a plate with a wall and a hole, the bolt stands free in the hole. All is
# cut by the plane of symmetry, and ``fragment`` makes one piece of it. Two interfaces
# are then split: the joint, and the cut through the bolt.


def flange(size):
    """Half of a segment: base, flange, and a bolt in two pieces."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
    occ = gmsh.model.occ
    base = (3, occ.addBox(0, 0, -BASE, LENGTH, WIDTH, BASE))
    plate = (3, occ.addBox(0, 0, 0, LENGTH, WIDTH, PLATE))
    wall = (3, occ.addBox(0, 0, PLATE, WALL, WIDTH, TOP - PLATE))
    hole = (3, occ.addCylinder(BOLT_X, 0, 0, 0, 0, PLATE, HOLE))
    angle, _ = occ.fuse([plate], [wall])
    angle, _ = occ.cut(angle, [hole])
    lower = [(3, occ.addCylinder(BOLT_X, 0, 0, 0, 0, CUT, BOLT))]
    shank = (3, occ.addCylinder(BOLT_X, 0, CUT, 0, 0, PLATE - CUT, BOLT))
    head = (3, occ.addCylinder(BOLT_X, 0, PLATE, 0, 0, HEAD_HEIGHT, HEAD))
    upper, _ = occ.fuse([shank], [head])
    half = [(3, occ.addBox(0, 0, 0, LENGTH, WIDTH, TOP))]
    lower, _ = occ.intersect(lower, half, removeTool=False)
    upper, _ = occ.intersect(upper, half)
    _, pieces = occ.fragment([base], [*angle, *lower, *upper])
    occ.synchronize()
    names = ("base", "flange", "bolt below", "bolt above")
    for name, ((_, body),) in zip(names, pieces, strict=True):
        gmsh.model.addPhysicalGroup(3, [body], name=name)
    parts = {
        "symmetry": [ec.where(y=0.0), ec.where(y=WIDTH)],
        "bottom": ec.where(z=-BASE),
        "top": ec.where(z=TOP),
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    domain = domain.split({"foot": "flange", "seat": "base"})
    return domain.split({"upper end": "bolt above", "lower end": "bolt below"})


# %%
# First the bolt is tightened, then the wall is pulled in three steps. The bilateral
# contact has a gap above zero, by which the upper end comes down on the lower one.


def scene_at(t):
    """The tightened flange under the part t of the pull."""
    supports = [
        ec.Displacement("bottom", (0.0, 0.0, 0.0)),
        ec.Displacement("symmetry", (None, 0.0, None)),
    ]
    joint = ec.Contact("foot", friction=MU, against="seat")
    bolt = ec.Contact("upper end", gap=TIGHTENED, bilateral=True, against="lower end")
    pull = ec.Traction("top", (0.0, 0.0, t * PULL))
    return ec.Scene(
        ec.Elastic(E, NU), supports, pull, contacts=[joint, bolt], units="mm, N, MPa"
    )


ec.log_to_console()
times = np.linspace(0.0, 1.0, 4)
domain = flange(12.0)
evolution = ec.evolve(scene_at, domain, times, accuracy=0.2, degree=2, solver="direct")

# %%
# Forces of the whole bolt, which is two halves. The opening is taken at the joint along
# the side, half-way to the next bolt.

pull = 2 * times * PULL * WALL * WIDTH
of_bolt = -2 * evolution.force("upper end")[:, 2]
of_joint = 2 * evolution.force("foot")[:, 2]
share = np.diff(of_bolt) / np.diff(pull)  # of the added pull
joints = evolution.profile("foot")
opened = [
    joint["weight"][joint["status"] == ec.results.OPEN].sum() / joint["weight"].sum()
    for joint in joints
]
sides = [np.sort(joint[joint["y"] > WIDTH - 1e-6], order="x") for joint in joints]

for name, error in (
    ("tightened", evolution.errors[0]),
    ("pulled", evolution.errors[-1]),
):
    output.plot_contact(error.admissible, "foot", FOLDER / f"joint_{name}.png")
output.draw_deformed(evolution.error, FOLDER / "deformed.png")

if domain.comm.rank == 0:
    for row in zip(pull, of_bolt, of_joint, opened, strict=True):
        print("pull {:.0f} N: bolt {:.0f} N, joint {:.0f} N, {:.0%} open".format(*row))
    print("the bolt takes of the added pull", np.round(share, 3))
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    left.plot(pull / 1e3, of_bolt / 1e3, "C0o-", label="bolt")
    left.plot(pull / 1e3, of_joint / 1e3, "C1o-", label="joint")
    left.set(xlabel="pull [kN]", ylabel="force [kN]", ylim=(0, 30))
    left.legend(frameon=False)
    for force, side in zip(pull, sides, strict=True):
        right.plot(side["x"], 1e3 * side["gap"], label=f"{force / 1e3:.1f} kN")
    right.axvline(BOLT_X, color="0.7", lw=0.8, zorder=0)
    right.set(xlabel="$x$ [mm], line: bolt", ylabel="1000 opening of the joint [mm]")
    right.legend(frameon=False)
    figure.savefig(FOLDER / "bolt.png", dpi=150)

# %%
# What must hold: joint and bolt are in balance with the pull, to round-off; the bolt
# feels less than a tenth of the first third of the pull, and nearly all of the last;
# the joint opens from the wall to the bolt, not behind it.

assert evolution.reached
assert np.allclose(of_bolt - of_joint, pull, atol=1e-8 * of_bolt.max())
assert 0.0 < share[0] < 0.1
assert share[2] > 0.9
assert np.all(np.diff(opened) > 0.0)
for side in sides[1:]:
    below_wall, behind = side["x"] < 10.0, side["x"] > 50.0
    assert side["gap"][below_wall].min() > 0.0
    assert side["gap"][behind].max() < 1e-3
assert np.all(sides[-1]["pressure"][sides[-1]["x"] < BOLT_X] == 0.0)
