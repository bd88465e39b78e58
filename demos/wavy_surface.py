r"""
Periodic bodies: a wavy surface
===============================

Rough surfaces touch at their crests. The plainest one is a wave of the length
:math:`\lambda` and the height :math:`2\Delta`, on a rigid plane. The higher the mean
pressure :math:`\bar p`, the wider the contact at each crest, until at

.. math:: p^* = \frac{\pi E' \Delta}{\lambda}, \qquad E' = \frac{E}{1 - \nu^2},

the wave is flat. Westergaard (1939) found the half-width of a contact,

.. math:: \sin \frac{\pi a}{\lambda} = \sqrt{\bar p / p^*},

and its pressure. One wave stands for all, between two sides that are copies of each
other, ``ec.Periodic("left", "right")``: displacement and stress are the same there. A
smooth plane would be a plane of symmetry, too. Here the crest is not in the middle, so
that no side is one.

A second example is a plate with a pattern of holes. Its stiffness is the energy of one
cell under a *mean strain*: two-sided bounds of an effective modulus.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import ufl
from mpi4py import MPI

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

import gmsh  # isort: skip - after erc_contact, as all that is compiled

FOLDER = Path("results/wavy_surface")
LENGTH, HEIGHT, CREST = 1.0, 0.002, 0.4
E, NU = 100.0, 0.3
STIFFNESS = E / (1 - NU**2)
FLAT = np.pi * STIFFNESS * HEIGHT / LENGTH

# %%
# The block is as deep as one and a half waves: below, the wave is felt by less than a
# thousandth. Its top carries the mean pressure. Translations of an endless body stay
# free along the plane, as nothing holds the block there.


def gap(x):
    """The distance of the wave from the plane [length]."""
    return HEIGHT * (1 - ufl.cos(2 * np.pi * (x[0] - CREST) / LENGTH))


def pressed(share, accuracy=0.01):
    """The run of a block under a share of the pressure that flattens the wave."""
    scene = ec.Scene(
        material=ec.Elastic(E, NU),
        supports=ec.Periodic("left", "right"),
        loads=ec.Traction("top", (0.0, -share * FLAT)),
        contacts=ec.Contact("bottom", gap=gap),
    )
    block = ec.rectangle((0.0, 0.0), (LENGTH, 1.5 * LENGTH), cells=(8, 12))
    return ec.adapt(scene, block, accuracy=accuracy, degree=2)


SHARES = (0.1, 0.4, 0.8)
histories = [pressed(share) for share in SHARES]
for share, history in zip(SHARES, histories, strict=True):
    width = history.contact_area("bottom").half_width
    exact = LENGTH / np.pi * np.arcsin(np.sqrt(share))
    print(f"{share} p*: half-width {width}, Westergaard {exact:.4f}")
    assert abs(width.value - exact) < width.margin + 0.002

# %%
# Westergaard's pressure is :math:`2 \bar p \cos\xi \sqrt{\sin^2\alpha - \sin^2\xi} /
# \sin^2\alpha`, with :math:`\xi = \pi x/\lambda` from the crest and :math:`\alpha = \pi
# a/\lambda`.


def westergaard(x, share):
    """The pressure over p* at places x from the crest."""
    inside = np.maximum(share - np.sin(np.pi * x / LENGTH) ** 2, 0.0)
    return 2 * np.cos(np.pi * x / LENGTH) * np.sqrt(inside)


figure, axes = plt.subplots(figsize=(6.3, 3.4), layout="constrained")
for number, (share, history) in enumerate(zip(SHARES, histories, strict=True)):
    profile = history.profile("bottom")
    x = (profile["x"] - CREST + 0.5 * LENGTH) % LENGTH - 0.5 * LENGTH
    order = np.argsort(x)
    color = f"C{number}"
    axes.plot(x[order], profile["pressure"][order] / FLAT, ".", ms=3, color=color)
    line = np.linspace(-0.5, 0.5, 400)
    axes.plot(
        line, westergaard(line, share), color=color, label=rf"$\bar p = {share}\,p^*$"
    )
    exact = westergaard(x, share)
    area = profile["weight"]
    mean_error = (area * abs(profile["pressure"] / FLAT - exact)).sum() / (
        area * exact
    ).sum()
    assert mean_error < 0.04
axes.set(xlabel=r"place from the crest, $x/\lambda$", ylabel="pressure over $p^*$")
axes.legend(title="lines: Westergaard")
if MPI.COMM_WORLD.rank == 0:
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure.savefig(FOLDER / "pressure.png")

# %%
# A plate with a square pattern of holes has the stiffness of a solid plate :math:`C^*`.
# The energy of one cell under the mean strain :math:`\bar\varepsilon` is
# :math:`\frac12 \bar\varepsilon : C^* : \bar\varepsilon`. It is in an interval: u^ has
# more energy than the exact displacement, and the error says by how much at most.
# Under :math:`\bar\varepsilon = 0.001 I` it tells the bulk modulus in the plane, which
# no pattern of holes can make greater than Hashin and Shtrikman's bound.

RADIUS = 0.25
STRAIN = 1e-3


def perforated():
    """A unit cell with a hole in the middle."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.2)
    occ = gmsh.model.occ
    square, hole = (
        (2, occ.addRectangle(0, 0, 0, 1, 1)),
        (2, occ.addDisk(0.5, 0.5, 0, RADIUS, RADIUS)),
    )
    occ.cut([square], [hole])
    occ.synchronize()
    sides = {
        "left": (0.0, 0.5),
        "right": (1.0, 0.5),
        "bottom": (0.5, 0.0),
        "top": (0.5, 1.0),
    }
    curves = {}
    for _, curve in gmsh.model.getEntities(1):
        middle = occ.getCenterOfMass(1, curve)[:2]
        name = next(
            (side for side, place in sides.items() if np.allclose(middle, place)),
            "hole",
        )
        gmsh.model.addPhysicalGroup(1, [curve], name=name)
        curves[name] = curve
    for one, other, shift in (("right", "left", (1, 0)), ("top", "bottom", (0, 1))):
        motion = [1, 0, 0, shift[0], 0, 1, 0, shift[1], 0, 0, 1, 0, 0, 0, 0, 1]
        gmsh.model.mesh.setPeriodic(1, [curves[one]], [curves[other]], motion)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain


strain = ((STRAIN, 0.0), (0.0, STRAIN))
sides = [
    ec.Periodic(*names, mean_strain=strain)
    for names in (("left", "right"), ("bottom", "top"))
]
cell = ec.adapt(
    ec.Scene(ec.Elastic(E, NU), sides), perforated(), accuracy=0.03, degree=2
)
energy = ec.potential_energy(cell)
low, high = (bound / (2 * STRAIN**2) for bound in (energy.low, energy.high))
shear = E / 2 / (1 + NU)
bulk = shear + E * NU / (1 + NU) / (1 - 2 * NU)
void = np.pi * RADIUS**2
hashin_shtrikman = 1 / ((1 - void) / (bulk + shear) + void / shear) - shear
print(f"bulk modulus between {low:.3f} and {high:.3f}, solid {bulk:.3f}")
print(f"Hashin and Shtrikman: at most {hashin_shtrikman:.3f}")
assert 0.97 * hashin_shtrikman < low < high < 1.01 * hashin_shtrikman
assert low < hashin_shtrikman

# %%
# The force on a side is the mean stress, opposite on both sides.

pull = cell.force("right").force
assert np.isclose(pull[0], 2 * STRAIN * low, rtol=0.01)
assert np.allclose(cell.force("left").force, -pull)
