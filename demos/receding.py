r"""
Receding contact: two layers
============================

A layer lies on another one and is pressed in the middle. It bends, and its ends lift:
the contact is smaller than the layers are, and smaller than before the load came. Such
a contact is called *receding*.

Without friction and gap all laws of the problem are homogeneous: twice the load has
twice the displacement and twice the pressure, and the same contact. So the half-width
:math:`b` does not depend on the load. This is unlike Hertz's contact, where it grows
with the root of the load. The smallest load opens the ends.

The upper layer has the thickness 10, :math:`E = 1000`, :math:`\nu = 0.3`, the lower one
20, 4000 and 0.25. The lower one is bonded to a rigid base, and the load is a pressure
on the part :math:`|x| < 5` of the top. Half of it is computed, with a plane of symmetry
at :math:`x = 0`. The layers are long enough to be infinite.

Nothing is singular where the contact ends, as the sides part with a common tangent. The
pressure ends like a square root, the gap begins like the power 3/2 of the distance. So
its power 2/3 is a straight line at the end of the contact, and zero where it is.

The references are computed by Fourier integrals with the pressure as the unknown, on
infinite layers. Pressures are those under a load of 1.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

import gmsh  # isort: skip - after erc_contact, as all that is compiled

FOLDER = Path("results/receding")
LOADED, THICKNESS, LENGTH = 5.0, 10.0, 80.0
BED_THICKNESS, BED_LENGTH = 20.0, 200.0
B, P_MIDDLE, P_HALF, ENERGY = 11.1310204, 0.73269589, 0.47235273, 0.0458814424
B_RIGID, P_RIGID, ENERGY_RIGID = 10.077824, 0.78958816, 0.0361713861

# %%
# The layers in one piece, from gmsh; the loaded part of the top is a rectangle of its
# own. ``split`` makes the two sides of the contact. With a rigid base there is the
# upper layer alone.


def layers(bed=True):
    """Half of the layers, or of the upper one alone."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 5.0)
    occ = gmsh.model.occ
    upper = [
        (2, occ.addRectangle(0, 0, 0, LOADED, THICKNESS)),
        (2, occ.addRectangle(LOADED, 0, 0, LENGTH - LOADED, THICKNESS)),
    ]
    lower = []
    if bed:
        lower = [(2, occ.addRectangle(0, -BED_THICKNESS, 0, BED_LENGTH, BED_THICKNESS))]
    occ.fragment(upper, lower)
    occ.synchronize()
    parts = {
        "middle": ec.where(x=0.0),
        "load": ec.where(y=THICKNESS, x=(None, LOADED)),
        "base" if bed else "foot": ec.where(y=-BED_THICKNESS if bed else 0.0),
    }
    regions = {"upper": ec.where(y=(0.0, None))}
    if bed:
        regions["lower"] = ec.where(y=(None, 0.0))
    domain = ec.from_gmsh(gmsh.model, parts=parts, regions=regions)
    gmsh.finalize()
    return domain.split({"foot": "upper", "seat": "lower"}) if bed else domain


# %%
# Two loads, and the rigid base. Each run is certified to 1%. Without friction, on flat
# sides, this is proved.


def pressed(domain, load, bed=True):
    """The layers under a load."""
    supports = [ec.Displacement("middle", (0.0, None))]
    steel = ec.Elastic(1000.0, 0.3)
    contact = ec.Contact("foot")
    if bed:
        supports.append(ec.Displacement("base", (0.0, 0.0)))
        steel = ec.Elastic(
            {"upper": 1000.0, "lower": 4000.0}, {"upper": 0.3, "lower": 0.25}
        )
        contact = ec.Contact("foot", against="seat")
    scene = ec.Scene(steel, supports, [ec.Traction("load", pressure=load)], contact)
    return ec.adapt(scene, domain, accuracy=0.01, strategy=ec.SizeMap())


def pressure_at(contact, x, load):
    """The pressure under a load of 1, by a parabola through the points near x."""
    near = abs(contact["x"] - x) < 2.0
    pressure = contact["pressure"][near] / load
    return np.polyfit(contact["x"][near] - x, pressure, 2)[-1]


ec.log_to_console()
both = layers()
light, heavy = pressed(both, 1.0), pressed(both, 7.0)
rigid = pressed(layers(bed=False), 1.0, bed=False)
light.save(FOLDER, pictures=True)

runs = {"load 1": (light, 1.0), "load 7": (heavy, 7.0), "rigid base": (rigid, 1.0)}
profiles = {name: run.profile("foot") for name, (run, _) in runs.items()}
found = {}
for name, (run, load) in runs.items():
    contact = profiles[name]
    places = (0.0, B / 2)
    pressures = [pressure_at(contact, x, load) for x in places]
    energy = ec.work_of_loads(run).value / load**2
    # The contact of half of the layers begins in their middle.
    (strip,) = run.contact_area("foot").strips
    found[name] = np.array([strip.length.value, *pressures, energy])
bounds = ec.work_of_loads(light)

# %%
# The pressure against that on a rigid base. The softer bed is compliant, so the
# pressure spreads: its peak is lower, and the contact is wider.

if both.comm.rank == 0:
    for name, values in found.items():
        print(
            name, "b {:.4f}, p(0) {:.5f}, p(b/2) {:.5f}, energy {:.8f}".format(*values)
        )
    print(f"reference b {B:.4f}, p(0) {P_MIDDLE:.5f}, p(b/2) {P_HALF:.5f}", ENERGY)
    print(f"energy between {bounds.low:.8f} and {bounds.high:.8f}, proved")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
    for name, style in (("load 1", "C0"), ("load 7", "C1--"), ("rigid base", "0.5")):
        load = runs[name][1]
        ends = profiles[name].reshape(-1, 2)  # both ends of each facet
        ends = ends[np.argsort(ends["x"].mean(axis=1))]
        x, mean = ends["x"].mean(axis=1), ends["pressure"].mean(axis=1)
        left.plot(x, mean / load, style, label=name)
        right.plot(ends["x"].ravel(), 1000 * ends["gap"].ravel() / load, style)
    left.plot(
        [0, B / 2, B],
        [P_MIDDLE, P_HALF, 0],
        "ko",
        ms=4,
        clip_on=False,
        label="reference",
    )
    left.plot([0, B_RIGID], [P_RIGID, 0], "o", color="0.5", ms=4, clip_on=False)
    left.set(
        xlabel="$x$, pressures are means of facets",
        ylabel="pressure over load",
        xlim=(0, 14),
        ylim=(0, 0.85),
    )
    right.set(xlabel="$x$", ylabel="1000 gap over load", xlim=(0, 20), ylim=(0, 3.2))
    left.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: half-width within 0.5%, pressures within 0.5%, energy within 0.1%, and
# in the proved interval; both loads have the same contact; the layers carry all of the
# load, the one as the other; on a rigid base the contact is smaller by what is known.

assert all(run.reached for run, _ in runs.values())
exact = np.array([B, P_MIDDLE, P_HALF, ENERGY])
assert np.all(abs(found["load 1"] / exact - 1) < [5e-3, 5e-3, 5e-3, 1e-3])
assert bounds.guaranteed
assert bounds.low < ENERGY < bounds.high
assert np.allclose(found["load 7"], found["load 1"], rtol=1e-6)
for run, load in runs.values():
    assert np.allclose(run.force("foot").force, (0, load * LOADED), atol=1e-9 * load)
assert np.allclose(light.force("seat").force, (0, -LOADED), atol=1e-9)
b, p_middle, _, energy = found["rigid base"]
assert abs(b / B_RIGID - 1) < 5e-3
assert abs(p_middle / P_RIGID - 1) < 5e-3
assert abs(energy / ENERGY_RIGID - 1) < 1e-3
