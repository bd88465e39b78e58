r"""
An o-ring in its groove
=======================

A rubber ring lies on the bottom of a groove, and the lid presses it flat. How large is
the force, and how wide the contact that seals?

The ring has the mean radius 10 and a cord of radius 1. It is a turned body: the mesh is
the disc of the cord in the half plane of radius and axis, away from the axis. Nothing
holds it but two contacts, with the bottom and with the lid; their gaps are below zero
when the lid is down. Across the axis hoop stresses hold a ring, and along it the
contacts do. The rubber has :math:`E = 5` and :math:`\nu = 0.49`; lengths are in mm,
stresses in MPa.

For dry rings without friction P. B. Lindley (Journal of the Institution of the Rubber
Industry 1, 1967) fits measured forces by

.. math:: F = \pi D d E\, (1.25\, C^{3/2} + 50\, C^6)

with the mean diameter D, the diameter d of the cord and the squeeze C over d. The power
3/2 is contact of a cord, where Hertz has nearly the power 1. Displacements are small
here: squeezes are up to 10%, where rotations come to 0.1 and the package warns.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact.output import draw_revolved

import gmsh  # isort: skip - after erc_contact, as all that is compiled

FOLDER = Path("results/o_ring")
MIDDLE, CORD, E, NU = 10.0, 1.0, 5.0, 0.49
SQUEEZES = np.array([0.025, 0.05, 0.1])

# %%
# The lower and the upper half of the circle may touch. The true circle is known, and
# new nodes go to it. The gap is measured along the axis.


def cord():
    """Section of the ring."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.35)
    gmsh.model.occ.addDisk(MIDDLE, 0, 0, CORD, CORD)
    gmsh.model.occ.synchronize()
    parts = {"foot": ec.where(y=(None, 0.0)), "head": ec.where(y=(0.0, None))}
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    return domain


def pressed(squeeze, friction):
    """The ring between bottom and lid, which come nearer by a share of the cord."""
    height = CORD * (1 - squeeze)
    below, above = (lambda x: height + x[1]), (lambda x: height - x[1])
    bottom = ec.Contact("foot", gap=below, normal=(0.0, -1.0), friction=friction)
    lid = ec.Contact("head", gap=above, normal=(0.0, 1.0), friction=friction)
    rubber = ec.Elastic(E, NU, hypothesis="axisymmetric")
    scene = ec.Scene(rubber, [], contacts=[bottom, lid])
    return ec.adapt(scene, cord(), accuracy=0.03, degree=2)


ec.log_to_console()
smooth = [pressed(squeeze, 0.0) for squeeze in SQUEEZES]
rough = [pressed(squeeze, 0.2) for squeeze in SQUEEZES]
smooth[-1].save(FOLDER, pictures=True)
draw_revolved(smooth[-1].error, FOLDER / "revolved.png")

# %%
# Force by force, and the pressure that seals.


def lindley(squeeze):
    """Force of the fit."""
    share = 1.25 * squeeze**1.5 + 50 * squeeze**6
    return np.pi * 2 * MIDDLE * 2 * CORD * E * share


force, force_rough = (
    np.array([run.force("foot").force[1] for run in runs]) for runs in (smooth, rough)
)
heads = np.array([run.force("head").force[1] for run in smooth])

if smooth[0].error.domain.comm.rank == 0:
    for squeeze, found, with_friction in zip(SQUEEZES, force, force_rough, strict=True):
        fit = lindley(squeeze)
        print(f"squeezed by {squeeze:.1%}: {found:.3f}, Lindley {fit:.3f}", end=" ")
        print(f"({found / fit - 1:+.1%}), with friction {with_friction:.3f}")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    fine = np.linspace(0, 0.11, 100)
    left.plot(100 * fine, lindley(fine), "k--", lw=1, label="Lindley's fit")
    left.plot(100 * SQUEEZES, force, "C0o", label="no friction")
    left.plot(100 * SQUEEZES, force_rough, "C1s", ms=5, label="friction 0.2")
    left.set(xlabel="squeeze [%]", ylabel="force [N]")
    for squeeze, run in zip(SQUEEZES, smooth, strict=True):
        foot = run.profile("foot")
        order = np.argsort(foot["x"])
        r, pressure = foot["x"][order], foot["pressure"][order]
        right.plot(r, pressure, lw=1, label=f"{squeeze:.1%}")
    right.set(xlabel="$r$ [mm]", ylabel="pressure [MPa]", xlim=(9.4, 10.6))
    left.legend(frameon=False)
    right.legend(frameon=False)
    figure.savefig(FOLDER / "force.png", dpi=150)

# %%
# What must hold: the forces of bottom and lid are opposite; they are within a tenth of
# the fit; friction makes the ring stiffer.

assert all(run.reached for run in smooth + rough)
assert np.allclose(heads, -force, rtol=1e-8)
assert np.all(abs(force / lindley(SQUEEZES) - 1) < 0.1)
assert np.all(force_rough > force)
