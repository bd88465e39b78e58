r"""
A bracket whose arm is left out
===============================

A bracket is bolted to a wall and carries a load at the end of a long arm. Of interest
is the foot: what the bolt bears, and where the foot touches the wall. The arm itself is
a beam, and cells there would be spent on nothing.

So the arm is cut off, and the cut gets the load from afar: ``ec.RemoteForce`` is the
force at its own point, with the moment that its distance makes. The cut shares both as
a traction that is linear along it, as a beam has it. It stays as soft as it is. With
``ec.Rigid`` it would be as stiff as a plate that is welded on.

The bolt is drawn as springs under its head, tightened by a pressure. Lengths are in mm,
stresses in MPa, forces in N/mm of width.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/bracket")
LOAD, END = 60.0, 600.0  # the load, and its distance from the wall
FOOT, HEIGHT, LOW, HIGH = 20.0, 200.0, 40.0, 100.0
HEAD = (150.0, 170.0)
TIGHTENED, STIFFNESS = 12.0, 40.0

# %%
# The foot stands along the wall, the arm leaves it in its middle.


def bracket(length):
    """A bracket with an arm up to a distance from the wall."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 15.0)
    occ = gmsh.model.occ
    foot = (2, occ.addRectangle(0, 0, 0, FOOT, HEIGHT))
    arm = (2, occ.addRectangle(FOOT, LOW, 0, length - FOOT, HIGH - LOW))
    head = (1, occ.addLine(*(occ.addPoint(FOOT, y, 0) for y in HEAD)))
    occ.fragment(occ.fuse([foot], [arm])[0], [head])
    occ.synchronize()
    parts = {
        "wall": ec.where(x=0.0),
        "cut": ec.where(x=length),
        "head": ec.where(x=FOOT, y=HEAD),
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    return domain


def loaded(length, *, load=(), held=()):
    """The bracket under a load on its cut, to a certified 3%."""
    tightened = ec.Traction("head", pressure=TIGHTENED)
    scene = ec.Scene(
        ec.Elastic(210e3, 0.3),
        held,
        [tightened, *load],
        ec.Contact("wall", friction=0.3),
        springs=ec.Spring("head", normal=STIFFNESS),
        units="mm, N/mm, MPa",
    )
    return ec.adapt(scene, bracket(length), accuracy=0.03, degree=2)


# %%
# The whole bracket, and two whose arm ends 120 mm from the wall, at a soft cut and at a
# stiff one.

ec.log_to_console()
force, point = (0.0, -LOAD), (END, (LOW + HIGH) / 2)
at_end = ec.Traction("cut", (0.0, -LOAD / (HIGH - LOW)))
shared = ec.RemoteForce("cut", force, at=point)
welded = ec.Rigid("cut", force=force, moment=0.0, about=point)
runs = {
    "whole arm": loaded(END, load=[at_end]),
    "arm left out": loaded(120.0, load=[shared]),
    "arm left out, stiff cut": loaded(120.0, held=welded),
}
short = runs["arm left out"]
short.save(FOLDER, pictures=True)

# %%
# The pressure on the wall. The arm bends the foot away from the wall: it touches with
# its lower end, and with its upper edge, which pries at the bolt.

profiles = {name: np.sort(run.profile("wall"), order="y") for name, run in runs.items()}
pressed = np.concatenate([p["y"][p["pressure"] > 0] for p in profiles.values()])
bolts = {name: abs(run.force("head").force[0]) for name, run in runs.items()}
cells = {name: run.error.domain.cells for name, run in runs.items()}
figure, axes = plt.subplots(1, 2, figsize=(8.4, 4.2), layout="constrained")
ec.output.draw_deformed(short, ax=axes[0])

if short.error.domain.comm.rank == 0:
    for name, bolt in bolts.items():
        print(f"{name}: {cells[name]} cells, the bolt bears {bolt:.2f} N/mm")
    lines = dict(zip(runs, ("k-", "C0--", "C1:"), strict=True))
    for name, profile in profiles.items():
        axes[1].plot(profile["pressure"], profile["y"], lines[name], lw=1.2, label=name)
    axes[1].set(xlabel="pressure on the wall [MPa]", ylabel="height [mm]", xlim=0)
    axes[1].legend(frameon=False)
    figure.savefig(FOLDER / "foot.png", dpi=150)

# %%
# What must hold: the wall carries the load; what the bolt bears is the same without the
# arm, and with a stiff cut, for fewer cells; the load adds to the bolt's tightening;
# the foot touches the wall at its ends alone.

assert all(run.reached for run in runs.values())
assert all(np.isclose(run.force("wall").force[1], LOAD) for run in runs.values())
assert all(abs(bolt / bolts["whole arm"] - 1) < 1e-3 for bolt in bolts.values())
assert bolts["whole arm"] > TIGHTENED * (HEAD[1] - HEAD[0]) + 20.0
assert cells["arm left out"] < 0.7 * cells["whole arm"]
assert pressed.min() < 1.0
assert pressed.max() > HEIGHT - 1.0
assert np.all((pressed < 30.0) | (pressed > HEIGHT - 5.0))
