r"""
A thermostat: heat bends a strip until it closes a contact
==========================================================

Two metals are bonded to a strip. Heated by :math:`T`, the upper one, brass, wants to
grow more than the steel below, so the strip bends down, until its tip meets a contact.
With more heat the tip presses on it.

Timoshenko (1925) has the curvature of the free strip. With :math:`m = t_1/t_2` the
ratio of the thicknesses, :math:`n = E_1/E_2` the ratio of the moduli, :math:`h` the
thickness of both together, in plane stress

.. math::

    \kappa = \frac{6\,(\alpha_1 - \alpha_2)\, T\, (1 + m)^2}
    {h \left( 3 (1 + m)^2 + (1 + m n) \left( m^2 + \frac{1}{m n} \right) \right)} .

At the distance :math:`a` from its clamp the strip goes down by :math:`\kappa a^2/2`. A
contact that is nearer than that pushes it back by :math:`P a^3/3 B` with the bending
stiffness :math:`B` of both layers.

Heat is a *given strain*: the stress comes from the remaining strain, :math:`\sigma = C
(\varepsilon(u) - \alpha T I)`. The error in the constitutive relation measures this
law, and bounds what it always bounds. Lengths are in mm, stresses in MPa.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/thermostat")
LENGTH, BRASS, STEEL, TIP = 40.0, 1.0, 1.5, 4.0
GAP, RADIUS = 0.25, 20.0
E_BRASS, E_STEEL, NU = 100e3, 200e3, 0.3
ALPHA_BRASS, ALPHA_STEEL = 19e-6, 12e-6

# %%
# The strip in one piece, so that the layers are bonded. A short part of its lower side
# at the tip may meet the contact, which is round; at the left it is clamped.


def strip():
    """Both layers, regions of one body."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1.0)
    occ = gmsh.model.occ
    brass = (2, occ.addRectangle(0, STEEL, 0, LENGTH, BRASS))
    inner = (2, occ.addRectangle(0, 0, 0, LENGTH - TIP, STEEL))
    tip = (2, occ.addRectangle(LENGTH - TIP, 0, 0, TIP, STEEL))
    occ.fragment([brass], [inner, tip])
    occ.synchronize()
    parts = {
        "clamp": ec.where(x=0.0),
        "tip": ec.where(y=0.0, x=(LENGTH - TIP, None)),
    }
    layers = {"brass": ec.where(y=(STEEL, None)), "steel": ec.where(y=(None, STEEL))}
    domain = ec.from_gmsh(gmsh.model, parts=parts, regions=layers)
    gmsh.finalize()
    return domain


# %%
# ``ThermalStrain`` has a coefficient for each region. The heat comes in steps, and each
# of them is certified to 3%.

metals = ec.Elastic(
    E={"brass": E_BRASS, "steel": E_STEEL}, nu=NU, hypothesis="plane stress"
)
alpha = {"brass": ALPHA_BRASS, "steel": ALPHA_STEEL}


def gap(x):
    """Distance to the round contact."""
    return GAP + (x[0] - LENGTH + TIP / 2) ** 2 / (2 * RADIUS)


def heated(T):
    """The clamped strip above its contact, heated by T."""
    return ec.Scene(
        material=metals,
        supports=[ec.Displacement("clamp", (0.0, 0.0))],
        contacts=[ec.Contact("tip", friction=0.2, gap=gap)],
        strains=[ec.ThermalStrain(alpha, T)],
        units="mm, N/mm, MPa",
    )


ec.log_to_console()
domain = strip()
temperatures = np.array([50.0, 150.0, 250.0, 350.0])
evolution = ec.evolve(heated, domain, temperatures, accuracy=0.03, degree=2)
evolution.save(FOLDER, pictures=True)

# %%
# The closed form. The curvature of the free strip is that between two sections away
# from the clamp. The force is compared at the place where it acts, which is its moment
# over the force.

m, n, h = BRASS / STEEL, E_BRASS / E_STEEL, BRASS + STEEL
both = 3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))
per_degree = 6 * (ALPHA_BRASS - ALPHA_STEEL) * (1 + m) ** 2 / (h * both)
layers = [(E_STEEL, STEEL, STEEL / 2), (E_BRASS, BRASS, STEEL + BRASS / 2)]
axis = sum(E * t * y for E, t, y in layers) / sum(E * t for E, t, _ in layers)
bending = sum(E * (t**3 / 12 + t * (y - axis) ** 2) for E, t, y in layers)

sections = np.array([[10.0, 0.0], [10.0, h], [30.0, 0.0], [30.0, h]])
along = evolution.at(sections).displacement[0, :, 0]
turned = (along[[0, 2]] - along[[1, 3]]) / h  # angle of each section
curvature = (turned[1] - turned[0]) / 20.0
exact_curvature = -per_degree * temperatures[0]

tip = evolution.reactions()["tip"]
force = tip.force[:, 1]
place = tip.moment[:, 0] / np.maximum(force, 1e-9)


def beam(T, a):
    """Force that a contact at the distance a takes, zero before it is met."""
    beyond = per_degree * T * a**2 / 2 - gap([a])
    return 3 * bending / a**3 * np.maximum(beyond, 0.0)


exact_force = beam(temperatures, np.where(force > 0, place, LENGTH))

if domain.comm.rank == 0:
    print(f"curvature {curvature:.6g} for {exact_curvature:.6g}")
    for T, P, exact in zip(temperatures, force, exact_force, strict=True):
        print(f"{T:.0f} degrees: force {P:.3f} for {exact:.3f}")
    figure, axes = plt.subplots(figsize=(4.8, 3.6), layout="constrained")
    heat = np.linspace(0.0, temperatures[-1], 100)
    axes.plot(heat, beam(heat, place[-1]), "k--", lw=1, label="beam")
    axes.plot(temperatures, force, "C0o", label="computed")
    axes.set(xlabel="heat [K]", ylabel="force on the contact [N/mm]")
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "force.png", dpi=150)

# %%
# What must hold: Timoshenko's curvature within 0.1%; no force before the strip meets
# the contact; then the force of the beam within 3% of the greatest: the friction, and
# the clamp, which hinders the heat, are not in its formula.

assert evolution.reached
assert abs(curvature / exact_curvature - 1) < 1e-3
assert force[0] == 0
assert np.all(abs(force[1:] - exact_force[1:]) < 0.03 * exact_force[-1])
