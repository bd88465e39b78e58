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

For a long cylinder of radius a between two plates Hertz's theory gives

.. math:: \delta = \frac{2 P}{\pi E^*} \left( 2 \ln \frac{4 a}{b} - 1 \right), \qquad
    b^2 = \frac{4 P a}{\pi E^*},

where the plates come nearer by :math:`\delta` under the force P per length, and 2b is
the width of the contact. In plane strain :math:`E^* = E/(1 - \nu^2)`. A ring is softer,
as it is free to grow: its hoop stresses have no resultant. In plane stress
:math:`E^* = E`, and the ring must lie between both. With friction bottom and lid keep
it from growing, as in plane strain. Displacements are small here: squeezes are up to
10%, where rotations come to 0.1 and the package warns.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec
from erc_contact.output import draw_revolved

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

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
    scene = ec.Scene(rubber, [], contacts=[bottom, lid], units="mm, N, MPa")
    return ec.adapt(scene, cord(), accuracy=0.02, degree=2)


ec.log_to_console()
smooth = [pressed(squeeze, 0.0) for squeeze in SQUEEZES]
rough = [pressed(squeeze, 0.2) for squeeze in SQUEEZES]
smooth[-1].save(FOLDER, pictures=True)
draw_revolved(smooth[-1].error, FOLDER / "revolved.png")

# %%
# Force by force, and the pressure that seals. The formula tells the approach for a
# force, and is turned round by interpolation.


def hertz(squeeze, modulus):
    """Force of the ring by the formula for a long cylinder."""
    P = np.linspace(1e-4, 1.0, 2000) * CORD * modulus
    b = np.sqrt(4 * P * CORD / (np.pi * modulus))
    approach = 2 * P / (np.pi * modulus) * (2 * np.log(4 * CORD / b) - 1)
    return 2 * np.pi * MIDDLE * np.interp(2 * CORD * squeeze, approach, P)


strain, stress = hertz(SQUEEZES, E / (1 - NU**2)), hertz(SQUEEZES, E)
force, force_rough = (
    np.array([run.force("foot").force[1] for run in runs]) for runs in (smooth, rough)
)
heads = np.array([run.force("head").force[1] for run in smooth])

if smooth[0].error.domain.comm.rank == 0:
    rows = zip(SQUEEZES, force, stress, strain, force_rough, strict=True)
    for squeeze, found, low, high, with_friction in rows:
        print(
            f"squeezed by {squeeze:.1%}: {found:.3f} between {low:.3f} and {high:.3f};"
        )
        print(f"with friction {with_friction:.3f}")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    fine = np.linspace(0, 0.11, 100)
    bounds = hertz(fine, E), hertz(fine, E / (1 - NU**2))
    left.fill_between(100 * fine, *bounds, color="0.85", label="Hertz, long cylinder")
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
# What must hold: the forces of bottom and lid are opposite; they lie between Hertz's in
# plane stress and in plane strain; with friction they are near to plane strain.

assert all(run.reached for run in smooth + rough)
assert np.allclose(heads, -force, rtol=1e-8)
assert np.all((force > stress) & (force < strain))
assert np.all(abs(force_rough / strain - 1) < 0.02)
