r"""
A soft pin in a hard lug
========================

A lug is pulled over a pin that is held at its core. Both are of steel, with the same
stiffness. The pin yields at 235 and hardens by 1% of Young's modulus; the lug is
quenched and yields at 900 only. The hole is wider than the pin by a clearance of 0.05
of the radii. Lengths are in mm, stresses in MPa, forces in N/mm; half of the scene is
computed.

In elasticity the pressure is greatest in the middle of the contact, and becomes greater
with the pull. The pin of soft steel cannot bear that: it yields, first below the
surface and then around its core, the lug sinks into it, the contact becomes wider and
its pressure flat. The lug stays elastic nearly everywhere, so it could be taken off
again; the pin could not be used twice.

Yield stress and hardening are mappings from regions, as moduli are. The error is
certified for both bodies and their contact together.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

FOLDER = Path("results/lug")
R, CORE, CLEARANCE = 10.0, 3.0, 0.05
BACK, END, HALF_WIDTH = 60.0, 25.0, 22.0
PULL = 10e3
YIELD = {"pin": 235.0, "lug": 900.0}

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
    core = [(2, occ.addDisk(0, 0, 0, CORE, CORE))]
    pin, _ = occ.intersect(pin, plate, removeTool=False)
    pin, _ = occ.cut(pin, core, removeTool=False)
    plate, _ = occ.cut(plate, core)
    occ.fragment(plate, pin)
    occ.synchronize()
    parts = {
        "symmetry": ec.where(y=0.0),
        "pulled": ec.where(x=-BACK),
        "core": lambda x: np.hypot(x[0], x[1]) < 1.01 * CORE,
    }
    regions = {
        "pin": lambda x: np.hypot(x[0], x[1]) < 1.001 * R,
        "lug": lambda x: np.hypot(x[0], x[1]) > 0.999 * R,
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts, regions=regions)
    gmsh.finalize()
    return domain.split({"rim": "pin", "hole": "lug"})


def pulled(domain, material):
    """The lug under the pull, to a certified 5%."""

    def gap(x):
        return CLEARANCE * (1 - x[0] / R)

    supports = [
        ec.Displacement("core", (0.0, 0.0)),
        ec.Displacement("symmetry", (None, 0.0)),
    ]
    pull = ec.Traction("pulled", (-PULL / (2 * HALF_WIDTH), 0.0))
    contact = ec.Contact("rim", gap=gap, against="hole")
    scene = ec.Scene(material, supports, loads=pull, contacts=contact)
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
moved = {name: -run.at((-BACK, 0.0)).displacement[0] for name, run in runs.items()}
axes = ec.output.draw_state(plastic, "accumulated")

if domain.comm.rank == 0:
    for name in runs:
        print(f"{name}: pressure up to {peak[name]:.0f} MPa,", end=" ")
        print(f"to {angle[name]:.0f} degrees, moved by {moved[name]:.4f} mm")
    print(f"yielded: pin {shares['pin']:.0%}, lug {shares['lug']:.1%}")
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
# What must hold: both runs carry the pull; yielding makes the pressure lower, the
# contact wider and the joint softer; the pin yields, not through its whole section, and
# the lug hardly. A pressure beyond the yield stress is no error: the pin is confined.

assert all(run.reached for run in runs.values())
assert all(abs(pull / PULL - 1) < 1e-8 for pull in pulls.values())
assert YIELD["pin"] < peak["plastic"] < 0.9 * peak["elastic"]
assert angle["plastic"] > angle["elastic"]
assert moved["plastic"] > 1.1 * moved["elastic"]
assert 0.2 < shares["pin"] < 0.9
assert shares["lug"] < 0.02
