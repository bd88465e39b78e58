r"""
A part from CAD: a bracket on its bolt
======================================

A bracket of steel comes as a STEP file, the common language of CAD programs. A bolt
presses it on a rigid foundation, and a rod pulls at its eye, up and to the left. Will
the joint hold?

The foundation can carry pressure and friction only. Take the bolt's force :math:`B`, on
its seat at :math:`x_B = 40`, and the pull :math:`(H, 0, V)` at the eye, :math:`x_E =
5`, :math:`z_E = 40` (N and mm). Equilibrium says what the foundation has to carry, and
where:

.. math:: N = B - V, \qquad Q = -H, \qquad x_c = \frac{B x_B + H z_E - V x_E}{N}.

The joint does not slip as a whole if :math:`|Q| < \mu N`, and does not tip if
:math:`x_c` is under the plate. This is as far as statics goes. *How* the pressure is
distributed is a contact problem. Under the head of the bolt the plate is pressed, and
the load spreads in a cone through its thickness. Away from it the plate gapes, and
where it gapes nothing holds it against slip. A designer asks that the plate stays
closed around the bore.
"""

from pathlib import Path

import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

FOLDER = Path("results/part")
BOLT, PULL, MU = 10_000.0, np.array([-500.0, 0.0, 1000.0]), 0.2  # N, N, -
SEAT, EYE = np.pi * (11.0**2 - 6.0**2), 2 * np.pi * 8.0 * 10.0  # areas [mm^2]

# %%
# gmsh reads the file, and faces get names by where they are. ``meshes/hinge.py`` has
# made the file; any other will do.


def read_step(path):
    """The bracket on all ranks; parts foot, seat and eye."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 10.0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 16)
    gmsh.model.occ.importShapes(str(path))
    gmsh.model.occ.synchronize()
    parts = {
        "foot": ec.where(z=0.0),
        "seat": ec.where(lambda x: np.hypot(x[0] - 40.0, x[1] - 20.0) < 11.1, z=8.0),
        "eye": lambda x: np.hypot(x[1] - 20.0, x[2] - 40.0) < 8.1,
    }
    domain = ec.from_gmsh(gmsh.model, parts=parts)
    gmsh.finalize()
    return domain


ec.log_to_console()
bracket = read_step(Path(__file__).resolve().parents[1] / "meshes" / "hinge.step")
scene = ec.Scene(
    material=ec.Elastic(E=210e3, nu=0.3),
    loads=[
        ec.Traction("seat", (0.0, 0.0, -BOLT / SEAT)),
        ec.Traction("eye", tuple(PULL / EYE)),
    ],
    contacts=ec.Contact("foot", friction=MU),
    units="mm, N, MPa",
)
history = ec.adapt(scene, bracket, accuracy=0.15, degree=2)
history.save(FOLDER, pictures=True)

# %%
# The facets of the mesh are flat, so its seat and its eye are a little smaller than in
# the part, and so are the forces on them. ``eps`` is the error for this mesh; ``geom``
# is what the flat facets cost. Statics takes the forces as they are.

foot, seat, eye = (history.force(part).force for part in ("foot", "seat", "eye"))
moment, contact, peak = (
    history.force("foot").moment,
    history.profile("foot"),
    history.maximum("von Mises"),
)
B, (H, _, V) = -seat[2], eye
N, Q = foot[2], foot[0]
centre = np.array([-moment[1], moment[0]]) / N
statics = (B * 40.0 + H * 40.0 - V * 5.0) / (B - V)
pressed = contact["pressure"] > 0.05 * contact["pressure"].max()
least, most = contact["x"][pressed].min(), contact["x"][pressed].max()
if bracket.comm.rank == 0:
    print(f"bolt {B:.0f} N, pull {H:.0f} and {V:.0f} N")
    print(f"foundation {N:.0f} N, friction {Q:.0f} N of {MU * N:.0f} N")
    print(f"centre of pressure {centre.round(2)} mm, x by statics {statics:.2f}")
    print(f"pressed {least:.1f} to {most:.1f} mm")
    print(f"most stressed: {peak.value:.0f} MPa at {peak.place.round(1)}")
    print(f"heel lifts by {contact['gap'].max():.4f} mm")

# %%
# What must hold: forces and centre by statics; the joint holds; the heel below the eye
# lifts, and the plate is closed on both sides of the bore.

assert history.reached
assert abs(N / (B - V) - 1) < 1e-6
assert abs(Q + H) < 1e-6 * N
assert abs(Q) < MU * N
assert abs(centre[0] / statics - 1) < 0.01
assert abs(centre[1] / 20.0 - 1) < 0.01
assert 15.0 < least < 34.0
assert 46.0 < most <= 60.0
assert contact["gap"][contact["x"] < 5.0].min() > 0.0
