r"""
A bolt that is tightened beyond its yield point
===============================================

Friction below the head makes the force of a torque wrench uncertain by a quarter. A
bolt that is tightened by the *angle*, until it yields, has a force that hardly depends
on anything but its own steel: the curve of force over angle is flat there, as the
shank flows. Engines and wind turbines are bolted so.

The angle is the shortening of the bolt: so much shorter it would be without a force.
``ec.Preload`` draws the two sides of a cut through the shank together by it, step by
step, and the shank yields as a tensile specimen does. Then nobody turns the nut any
more, the preload is *locked*, and the plates are pulled apart and let go. Two things
happen: the bolt takes a small part of the pull only, because the plates are stiffer;
and even this part makes the shank flow a little more, so that the bolt keeps a little
less force afterwards.

Bolt and plates are bodies of revolution, the half plane of radius and axis, without
friction. The bolt is of class 8.8 with a curve of hardening, the plates do not yield.
Lengths are in mm, stresses in MPa, forces in N, of the full ring.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact import output

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/yielding_bolt")
SHANK, HOLE, HEAD, PLATE = 5.0, 5.5, 9.0, 24.0
LOWER, CUT, UPPER, HEIGHT = -16.0, 6.0, 16.0, 8.0
YIELD = 640.0
CURVE = ec.HardeningCurve(
    plastic_strain=[0.0, 0.01, 0.05], stress=[YIELD, 700.0, 800.0]
)
STEEL = ec.Elastic(210e3, 0.3, hypothesis="axisymmetric")
GRADE = ec.Plastic(210e3, 0.3, hardening=CURVE, hypothesis="axisymmetric")
BOLT = ("above", "below")

# %%
# The bolt is two parts, above and below the cut, and lies between two plates.


def joint(size):
    """Half plane of the bolt and of two plates."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    occ = gmsh.model.occ

    def ring(inner, outer, low, high):
        return [(2, occ.addRectangle(inner, low, 0, outer - inner, high - low))]

    top, foot = UPPER + HEIGHT, LOWER - HEIGHT
    above, _ = occ.fuse(ring(0, SHANK, CUT, top), ring(0, HEAD, UPPER, top))
    below, _ = occ.fuse(ring(0, SHANK, foot, CUT), ring(0, HEAD, foot, LOWER))
    plates = ring(HOLE, PLATE, 0, UPPER) + ring(HOLE, PLATE, LOWER, 0)
    _, pieces = occ.fragment(above, below + plates)
    occ.synchronize()
    names = (*BOLT, "upper", "lower")
    for name, piece in zip(names, pieces, strict=True):
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in piece], name=name)
    parts = {
        "top": ec.where(x=(HEAD, None), y=UPPER),
        "bottom": ec.where(x=(HEAD, None), y=LOWER),
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    domain = domain.split({"upper end": "above", "lower end": "below"})
    domain = domain.split({"head": "above", "seat": "upper"})
    domain = domain.split({"nut": "below", "seat of nut": "lower"})
    return domain.split({"joint": "upper", "joint below": "lower"})


# %%
# Four steps tighten the bolt. In two more the plates are pulled by 25 kN and let go.

TIGHT = 4
SHORTENING, PULL = 0.28, 25e3
PULLS = [0.0] * TIGHT + [PULL, 0.0]


def scene_at(t):
    """The joint in step t: tightened, then locked and pulled."""
    contacts = [
        ec.Contact("head", against="seat"),
        ec.Contact("nut", against="seat of nut"),
        ec.Contact("joint", against="joint below"),
    ]
    area = np.pi * (PLATE**2 - HEAD**2)
    pull = ec.Traction("top", (0.0, PULLS[int(t)] / area))
    shift = SHORTENING * (t + 1) / TIGHT
    given = {"shortening": shift} if t < TIGHT else {"locked": True}
    tie = ec.Preload("upper end", against="lower end", **given)
    material = dict.fromkeys(BOLT, GRADE) | dict.fromkeys(("upper", "lower"), STEEL)
    held = ec.Displacement("bottom", (None, 0.0))
    return ec.Scene(material, held, pull, contacts, ties=tie, units="mm, N, MPa")


ec.log_to_console()
steps = np.arange(len(PULLS), dtype=float)
history = ec.evolve(scene_at, joint(4.0), steps, accuracy=0.25)

# %%
# The force is of the bolt on its upper part, in tension > 0. A test bar of the section
# of the shank yields at ``A y``; the straight line is the bolt that does not yield.

section = np.pi * SHANK**2
of_bolt = -history.force("upper end")[:, 1]
of_joint = history.force("joint")[:, 1]
shifts = np.array([error.solution.shortening("upper end") for error in history.errors])
shares = [ec.results.plastic_share(error) for error in history.errors]
stiffness = of_bolt[0] / shifts[0]

output.draw_state(history.errors[TIGHT - 1], "accumulated", FOLDER / "yielded.png")
if history.error.domain.comm.rank == 0:
    rows = zip(shifts, of_bolt, of_joint, shares, strict=True)
    for shift, bolt, plates, share in rows:
        print(f"shorter by {shift:.2f} mm: bolt {bolt / 1e3:.1f} kN,", end=" ")
        print(f"joint {plates / 1e3:.1f} kN, {share:.1%} of all has yielded")
    figure, axis = plt.subplots(figsize=(5.6, 3.8), layout="constrained")
    way, force = np.append(0.0, shifts), np.append(0.0, of_bolt) / 1e3
    last = TIGHT + 1
    axis.plot(way[:last], force[:last], "C0o-", label="tightened")
    axis.plot(way[TIGHT:], force[TIGHT:], "C1.-", label="pulled, and let go")
    elastic = [0.0, 1.2 * section * YIELD / stiffness]
    axis.plot(elastic, [stiffness * q / 1e3 for q in elastic], "k:", label="elastic")
    axis.axhline(
        section * YIELD / 1e3, color="0.6", lw=0.8, label="$A$ times yield stress"
    )
    axis.set(xlabel="shortening [mm]", ylabel="force of the bolt [kN]", ylim=0)
    axis.legend(frameon=False)
    figure.savefig(FOLDER / "force.png", dpi=150)

# %%
# What must hold: the force grows with the shortening, and hardly beyond the force at
# which a bar of this section yields; the shift stays after it is locked; bolt, joint
# and pull are in balance, to round-off. The bolt feels less than a fifth of the pull,
# and keeps less force than it had.

tight, pulled, released = of_bolt[TIGHT - 1 :]
assert history.reached
assert np.isclose(of_bolt[1], 2 * of_bolt[0], rtol=0.05)
assert section * YIELD < tight < 1.1 * section * YIELD
assert tight < 0.8 * stiffness * SHORTENING
assert np.allclose(shifts[TIGHT:], SHORTENING, rtol=1e-12)
assert np.allclose(of_bolt - of_joint, PULLS, atol=1e-8 * tight)
assert pulled - released < 0.2 * PULL
assert 0.9 * tight < released < tight
assert shares[0] < 1e-3 < shares[-1]
