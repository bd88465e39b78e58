r"""
A curved gap between flat layers
================================

A stiff layer is slightly curved below and is moved down onto a soft one. Before they
touch, the gap between them is :math:`x^2 / 2R` with :math:`R = 500`, and it is small
against the layers. So nobody needs to draw it: both bodies are meshed with flat sides
in one place, and the gap is a field on the contact. New elements then never have to
follow a shape, and what the curve means for the contact is integrated as it is.

Unlike a *receding* contact (the gallery has one, too) this one grows with the load. The
soft layer is hardly thicker than twice the half-width :math:`b` and nearly
incompressible, so Hertz's formulas for half-spaces are not for it.

The upper layer has the thickness 10, :math:`E = 200\,000` and :math:`\nu = 0.3`, the
lower one 20, 1000 and 0.45. The lower one is bonded to a rigid base, and the top of the
upper one moves down by 0.1 and not aside. There is no friction, and the strain is
plane. Half of it is computed, with a plane of symmetry at :math:`x = 0`. Lengths are in
mm, stresses in MPa.

The pressure ends like a square root at :math:`b`, and the gap begins there like the
power 3/2 of the distance. So its power 2/3 is a straight line, and zero at :math:`b`.
The references are computed by Fourier integrals with the pressure as the unknown.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/parabolic_layers")
LENGTH, UPPER, LOWER = 160.0, 10.0, 20.0
R, DOWN = 500.0, 0.1
B, FORCE, P_MIDDLE, P_HALF, ENERGY = (
    8.10960313,
    147.60873,
    11.628843,
    10.03447,
    6.1712295,
)

# %%
# Two rectangles that share a side, in one piece from gmsh. ``split`` makes the two
# sides of the contact of it.


def layers():
    """Half of both layers."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 5.0)
    occ = gmsh.model.occ
    upper = (2, occ.addRectangle(0, 0, 0, LENGTH, UPPER))
    lower = (2, occ.addRectangle(0, -LOWER, 0, LENGTH, LOWER))
    occ.fragment([upper], [lower])
    occ.synchronize()
    parts = {
        "top": ec.where(y=UPPER),
        "base": ec.where(y=-LOWER),
        "middle": ec.where(x=0.0),
    }
    regions = {"upper": ec.where(y=(0.0, None)), "lower": ec.where(y=(None, 0.0))}
    domain = ec.from_gmsh(gmsh.model, parts=parts, regions=regions)
    gmsh.finalize()
    return domain.split({"foot": "upper", "seat": "lower"})


# %%
# The gap is a function of the place on the mesh. Either side may be called first: the
# second run has the names the other way round, which must not change anything.


def gap(x):
    """The distance of the sides before they move."""
    return x[0] ** 2 / (2 * R)


def pressed(domain, contact):
    """The layers after the upper one has come down, to a certified 1%."""
    material = ec.Elastic({"upper": 200e3, "lower": 1e3}, {"upper": 0.3, "lower": 0.45})
    supports = [
        ec.Displacement("top", (0.0, -DOWN)),
        ec.Displacement("base", (0.0, 0.0)),
        ec.Displacement("middle", (0.0, None)),
    ]
    scene = ec.Scene(material, supports, contacts=contact, units="mm, N/mm, MPa")
    return ec.adapt(scene, domain, accuracy=0.01, strategy=ec.SizeMap())


ec.log_to_console()
domain = layers()
history = pressed(domain, ec.Contact("foot", against="seat", gap=gap))
swapped = pressed(domain, ec.Contact("seat", against="foot", gap=gap))
history.save(FOLDER, pictures=True)

# %%
# The five numbers. Pressures are read from parabolas through the points near the place.


def pressure_at(contact, x):
    """The pressure, by a parabola through the points near x."""
    near = abs(contact["x"] - x) < 2.0
    return np.polyfit(contact["x"][near] - x, contact["pressure"][near], 2)[-1]


def numbers(run):
    """Half-width, force, two pressures and energy of both halves together."""
    contact = run.profile("foot")
    force = 2 * run.force("foot").force[1]
    pressures = [pressure_at(contact, x) for x in (0.0, B / 2)]
    energy = 2 * ec.potential_energy(run).value
    # The contact of half of the layers begins in their middle.
    (strip,) = run.contact_area("foot").strips
    return np.array([strip.length.value, force, *pressures, energy])


found, other = numbers(history), numbers(swapped)
exact = np.array([B, FORCE, P_MIDDLE, P_HALF, ENERGY])
bounds = ec.potential_energy(history)
contact = history.profile("foot")

# %%
# The pressure, and Hertz's for the same force on a soft half-space. The rigid base
# below makes the layer stiffer: the contact is smaller and the pressure higher.

reduced = 1 / ((1 - 0.3**2) / 200e3 + (1 - 0.45**2) / 1e3)
b_hertz = np.sqrt(4 * FORCE * R / (np.pi * reduced))
p_hertz = 2 * FORCE / (np.pi * b_hertz)

if domain.comm.rank == 0:
    names = ("half-width", "force", "p(0)", "p(b/2)", "energy")
    for name, value, wanted in zip(names, found, exact, strict=True):
        print(f"{name} {value:.6g} for {wanted:.6g}: {value / wanted - 1:+.3%}")
    print(f"energy between {2 * bounds.low:.6f} and {2 * bounds.high:.6f}, proved")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    ends = contact.reshape(-1, 2)  # both ends of each facet
    ends = ends[np.argsort(ends["x"].mean(axis=1))]
    x, mean = ends["x"].mean(axis=1), ends["pressure"].mean(axis=1)
    left.plot(x, mean, "C0", label="here, means of facets")
    left.plot([0, B / 2, B], [P_MIDDLE, P_HALF, 0], "ko", ms=4, label="reference")
    fine = np.linspace(0, b_hertz, 400)
    ellipse = p_hertz * np.sqrt(1 - (fine / b_hertz) ** 2)
    left.plot(fine, ellipse, "k--", lw=1, label="Hertz, same force")
    left.set(xlabel="$x$ [mm]", ylabel="pressure [MPa]", xlim=(0, 16), ylim=(0, 12.5))
    x = ends["x"].ravel()
    right.plot(x, gap(ends["x"].ravel().reshape(1, -1)), "k--", lw=1, label="before")
    right.plot(x, ends["gap"].ravel(), "C0", label="under the load")
    right.set(xlabel="$x$ [mm]", ylabel="gap [mm]", xlim=(0, 16), ylim=(-0.005, 0.26))
    left.legend(frameon=False)
    right.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: half-width within 0.5%, force, pressures and energy within 0.2%, by a
# certified 1%; the energy in the interval that is proved; the order of the names makes
# no difference; in the contact the sides touch.

assert history.reached
assert swapped.reached
assert np.all(abs(found / exact - 1) < [5e-3, 2e-3, 2e-3, 2e-3, 2e-3])
assert bounds.guaranteed
assert 2 * bounds.low < ENERGY < 2 * bounds.high
assert np.allclose(other, found, rtol=1e-6)
of_foot, of_seat = history.force("foot").force, history.force("seat").force
assert np.allclose(of_foot + of_seat, 0, atol=1e-9 * FORCE)
inside = contact["x"] < 0.95 * B
assert np.all(abs(contact["gap"][inside]) < 1e-3 * DOWN)
assert np.all(contact["pressure"][contact["x"] > 1.05 * B] == 0)
