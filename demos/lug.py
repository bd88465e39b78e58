r"""
A soft pin in a hard lug
========================

A lug is pulled over a pin. Both are of steel, with the same stiffness, but the pin is
soft: it yields at 130 and hardens by 1% of Young's modulus. The lug is quenched and
yields at 900 only. The hole is wider than the pin by a clearance of 0.05 of the radii.
Lengths are in mm, stresses in MPa, forces in N/mm; half of the scene is computed.

The mean pressure on the pin, the pull over its diameter, is 3.5 times its yield stress.
A test bar of this steel would flow away at a third of it. The pin cannot: the hole
confines it, and the strain is plane. So nearly all of its section yields, by half a
percent, and then spreads in the hole as a liquid would. The contact becomes wider, and
the pressure falls evenly from its middle, where it was flat there and steep at its end.
The lug hardly notices.

Yield stress and hardening are numbers or mappings from regions, as moduli are. The
error is certified for both bodies and their contact together.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/lug")
R, CLEARANCE = 10.0, 0.05
BACK, END, HALF_WIDTH = 60.0, 25.0, 22.0
PULL = 9000.0
YIELD = {"pin": 130.0, "lug": 900.0}

# %%
# The pin lies in the hole where it will be pressed, so both are meshed in one place;
# the clearance is the gap of the contact.


def lug():
    """Half of the pin in half of the lug."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 12.0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 36)
    occ = gmsh.model.occ
    plate = [(2, occ.addRectangle(-BACK, 0, 0, BACK + END, HALF_WIDTH))]
    pin = [(2, occ.addDisk(0, 0, 0, R, R))]
    occ.fragment(plate, occ.intersect(pin, plate, removeTool=False)[0])
    occ.synchronize()
    parts = {"symmetry": ec.where(y=0.0), "held": ec.where(x=-BACK)}
    regions = {
        "pin": lambda x: np.hypot(x[0], x[1]) < 1.001 * R,
        "lug": lambda x: np.hypot(x[0], x[1]) > 0.999 * R,
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts, regions=regions)
    gmsh.finalize()
    return domain.split({"rim": "pin", "hole": "lug"})


# %%
# What the pin bears comes along its axis and is sheared through its section. In the
# plane it is a force per volume, a parabola over the radius. Nothing but the contact
# holds the pin.


def through_pin(x):
    """Force per volume, PULL in total."""
    share = np.maximum(1 - (x[0] ** 2 + x[1] ** 2) / R**2, 0)
    return 2 * PULL / (np.pi * R**2) * share, 0.0


def pulled(domain, material):
    """The lug under the pull, to a certified 5%."""

    def gap(x):
        return CLEARANCE * (1 - x[0] / R)

    supports = [ec.Symmetry("symmetry"), ec.Displacement("held", (0.0, None))]
    contact = ec.Contact("rim", gap=gap, against="hole")
    load = ec.BodyForce(through_pin)
    scene = ec.Scene(
        material, supports, loads=load, contacts=contact, units="mm, N/mm, MPa"
    )
    return ec.adapt(scene, domain, accuracy=0.05, degree=2, strategy=ec.SizeMap())


ec.log_to_console()
domain = lug()
plastic = pulled(domain, ec.Plastic(210e3, 0.3, YIELD, hardening=2100.0))
elastic = pulled(domain, ec.Elastic(210e3, 0.3))
plastic.save(FOLDER, pictures=True)

# %%
# The pressure over the angle is taken as the mean of each facet. The share of each body
# that has yielded follows from the accumulated plastic strain of its cells.


def over_angle(run):
    """Angles of the middles of facets [degrees], in order, and their mean pressures."""
    facets = run.profile("rim").reshape(-1, 5)  # five points on each
    theta = np.degrees(np.arctan2(facets["y"][:, 2], facets["x"][:, 2]))
    weight = facets["weight"]
    mean = (facets["pressure"] * weight).sum(axis=1) / weight.sum(axis=1)
    order = theta.argsort()
    return theta[order], mean[order]


def yielded(run, name):
    """Share of the area of a body that has yielded."""
    domain = run.error.domain
    cells = domain.cell_tags.find(domain.regions[name])
    cells = cells[cells < domain.owned_cells]
    area = run.error.admissible.cell_geometry.volume[cells]
    yields = ec.results.state(run, "accumulated")[cells] > 0
    comm = domain.comm
    return comm.allreduce(area @ yields) / comm.allreduce(area.sum())


runs = {"elastic": elastic, "plastic": plastic}
pulls = {name: 2 * abs(run.force("rim").force[0]) for name, run in runs.items()}
pressure = {name: over_angle(run) for name, run in runs.items()}
peak = {name: mean.max() for name, (_, mean) in pressure.items()}
angle = {
    name: theta[mean > 0.02 * mean.max()].max()
    for name, (theta, mean) in pressure.items()
}
shares = {name: yielded(plastic, name) for name in YIELD}
moved = {
    name: float(run.at((0.0, 0.0)).displacement[..., 0].squeeze())
    for name, run in runs.items()
}
axes = ec.output.draw_state(plastic, "accumulated")

if domain.comm.rank == 0:
    for name in runs:
        print(f"{name}: pressure up to {peak[name]:.0f} MPa,", end=" ")
        print(f"to {angle[name]:.0f} degrees, moved by {moved[name]:.4f} mm")
    print(f"yielded: pin {shares['pin']:.0%}, lug {shares['lug']:.1%}")
    around = np.linspace(0, np.pi, 100)
    axes.plot(R * np.cos(around), R * np.sin(around), "w", lw=0.8)
    axes.set(xlim=(-20, 20), ylim=(0, HALF_WIDTH))
    axes.figure.savefig(FOLDER / "plastic_zone.png", dpi=150)
    figure, axis = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    for name, (theta, mean) in pressure.items():
        axis.plot(theta, mean, "o-", ms=3, lw=1, label=name)
    axis.axhline(
        YIELD["pin"], color="k", lw=0.8, ls=":", label="yield stress of the pin"
    )
    axis.set(xlabel="angle [degrees]", ylabel="pressure, means of facets [MPa]")
    axis.set(xlim=(0, 100), ylim=0)
    axis.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: both runs carry the pull (the facets of the pin are flat); yielding
# makes the contact wider, the pressure lower at 40 degrees and the joint softer, and
# does not raise the pressure; the pin has yielded nearly everywhere, the lug hardly.

at_forty = {name: np.interp(40.0, *pressure[name]) for name in runs}
assert all(run.reached for run in runs.values())
assert all(abs(pull / PULL - 1) < 1e-3 for pull in pulls.values())
assert angle["plastic"] > angle["elastic"] + 10.0
assert at_forty["plastic"] < 0.95 * at_forty["elastic"]
assert peak["plastic"] < 1.02 * peak["elastic"]
assert moved["plastic"] > 1.05 * moved["elastic"]
assert shares["pin"] > 0.8
assert shares["lug"] < 0.02
