r"""
A chain link, cut where it stays plane
======================================

A chain pulls, and each link bears on the round wire of the next one. A quarter of a
link is enough: it is symmetric about the plane through its crown, and about the plane
through the middle of its straight sides. Nobody knows what this second cut carries. It
has half of the pull and a bending moment, which bends the link open at the crown, and
follows from the way in which the whole link deforms.

The cut stays plane and does not turn, as both halves are alike; it has no shear, and
becomes thinner and goes inwards as it likes. ``ec.PlaneSection`` says just this: the
motion along the normal is rigid, and is given by a force or by a displacement, and
motions in the plane are free,

.. math:: u \cdot n = q, \qquad \sigma n = (n \cdot \sigma n)\, n.

A rigid face of which only the force is given, ``ec.Rigid``, is another body: it holds
the cut in place, by a force across that no link has. The moment is a certified number,
beside the theory of curved beams, in which the ring of mean radius R and the straight
side of half length L bend as one beam. Lengths are in mm, stresses in MPa, forces in
N/mm; the strain is plane.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact import output

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/chain_link")
INNER, OUTER, LENGTH, WIRE = 18.0, 26.0, 20.0, 17.0
E, NU, PULL = 210e3, 0.3, 800.0

# %%
# The link lies around the origin, its crown at the top. The wire of the next link is
# stiff and below the crown: a foundation, whose gap is the distance from it.


def quarter():
    """A quarter of the link: a straight side and half of the bend."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 4.0)
    occ = gmsh.model.occ
    side = (2, occ.addRectangle(INNER, 0, 0, OUTER - INNER, LENGTH))
    disc = (2, occ.addDisk(0, LENGTH, 0, OUTER, OUTER))
    hole = (2, occ.addDisk(0, LENGTH, 0, INNER, INNER))
    corner = (2, occ.addRectangle(0, LENGTH, 0, OUTER, OUTER))
    bend, _ = occ.intersect([disc], [corner])
    bend, _ = occ.cut(bend, [hole])
    occ.fuse(bend, [side])
    occ.synchronize()

    def inside_the_bend(x):
        return np.isclose(np.hypot(x[0], x[1] - LENGTH), INNER) & (x[1] > LENGTH - 1e-9)

    parts = {
        "crown": ec.where(x=0.0),
        "cut": ec.where(y=0.0),
        "bearing": inside_the_bend,
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    return domain


def distance(x):
    """Distance from the wire, which touches the crown."""
    height = x[1] - (LENGTH + INNER - WIRE)
    return (x[0] ** 2 + height**2) ** 0.5 - WIRE


def link(cut):
    """A quarter of the link that a support pulls down at its cut."""
    return ec.Scene(
        ec.Elastic(E, NU),
        supports=[cut, ec.Symmetry("crown")],
        contacts=ec.Contact("bearing", gap=distance, normal="gap"),
        units="mm, N/mm, MPa",
    )


HALF = (None, -PULL / 2)
section = ec.PlaneSection("cut", rotation=0.0, force=HALF)
face = ec.Rigid("cut", displacement=(0.0, None), rotation=0.0, force=HALF)

ec.log_to_console()
plane = ec.adapt(link(section), quarter(), accuracy=0.04, degree=2)
held = ec.adapt(link(face), quarter(), accuracy=0.04, degree=2)

# %%
# The moment about the middle of the cut is in an interval. In the theory of curved
# beams a force P/2 comes down the side, the wire is a point below the crown, and the
# moment is the one that keeps the cut from turning,
#
# .. math:: M = \frac{P}{2} R\, \frac{\pi/2 - 1}{\pi/2 + L/R}.

middle = (INNER + OUTER) / 2
moment = ec.interval(plane.error, ec.Moment("cut", about=(middle, 0.0)))
of_beam = PULL / 2 * middle * (np.pi / 2 - 1) / (np.pi / 2 + LENGTH / middle)
runs = {"plane section": plane, "rigid face": held}
across = {name: run.force("cut").force[0] for name, run in runs.items()}
sinks = {
    name: -run.solution.motion("cut").displacement[1] for name, run in runs.items()
}
lines = {
    name: run.along((INNER, 0.0), (OUTER, 0.0), count=81) for name, run in runs.items()
}

output.draw_deformed(plane.error, FOLDER / "deformed.png")
if plane.error.domain.comm.rank == 0:
    print(f"moment at the cut: {moment}")
    print(f"by the theory of curved beams: {of_beam:.0f} N/mm mm")
    for name in runs:
        print(f"{name}: {across[name]:.0f} N/mm across, sinks by {sinks[name]:.3f} mm")
    figure, axis = plt.subplots(figsize=(5.6, 3.8), layout="constrained")
    for color, (name, line) in enumerate(lines.items()):
        axis.plot(line["x"], line["s_yy"], f"C{color}", label=f"{name}, along the side")
        axis.plot(line["x"], line["s_xy"], f"C{color}:", label=f"{name}, shear")
    axis.set(xlabel="x [mm]", ylabel="stress on the cut [MPa]")
    axis.legend(frameon=False)
    figure.savefig(FOLDER / "cut.png", dpi=150)

# %%
# What must hold: the cut has half of the pull, and nothing across, to round-off; the
# moment is within 5% of the theory, which knows no thickness; a face that is held takes
# a third of the force across, and the link seems twice as stiff.

assert all(run.reached for run in runs.values())
assert np.isclose(plane.force("cut").force[1], -PULL / 2, rtol=1e-9)
assert abs(across["plane section"]) < 1e-9 * PULL
assert abs(moment.value / of_beam - 1) < 0.05
assert across["rigid face"] > 0.3 * PULL / 2
assert sinks["plane section"] > 2 * sinks["rigid face"]
