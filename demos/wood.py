r"""
A steel roller on spruce
========================

Spruce is thirty times as stiff along its fibres as across them. A roller of steel with
a radius of 40 mm is pressed into a board: upright boards, whose fibres stand on end as
in a chopping block, bear it well, and boards that lie flat give way. Between both the
fibres lean, and pull the contact to a side. Lengths are in mm, stresses in MPa, forces
in N/mm; the board is in plane strain along the roller.

The roller is so much stiffer that it is a rigid curve, the gap of the contact. Moduli
are of clear spruce: along the fibres (L), across the rings (R) and along them (T), the
third axis being the axis of the roller. A steel plate below the board, elastic and
isotropic, stands in the same scene.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

plt.style.use("namedmesh.pictures.style")

FOLDER = Path("results/wood")
R, WIDTH, THICK, PLATE = 40.0, 60.0, 20.0, 5.0
DEPTH = 0.2
MODULI = {
    "E": (11e3, 800.0, 450.0),
    "nu": (0.38, 0.42, 0.47),
    "G": (700.0, 650.0, 40.0),
}

# %%
# The board hangs from its plate, which presses it on the roller below.


def pressed(angle):
    """Pressed by a depth, with fibres at an angle to the board."""
    c, s = np.cos(angle), np.sin(angle)
    spruce = ec.OrthotropicElastic(**MODULI, axes=((c, s), (-s, c)))
    layers = {"board": ec.where(y=(None, THICK)), "plate": ec.where(y=(THICK, None))}
    body = ec.rectangle((-WIDTH / 2, 0.0), (WIDTH / 2, THICK + PLATE), cells=(24, 10))
    scene = ec.Scene(
        {"board": spruce, "plate": ec.Elastic(210e3, 0.3)},
        ec.Displacement("top", (0.0, -DEPTH)),
        contacts=ec.Contact("bottom", friction=0.3, gap=lambda x: x[0] ** 2 / (2 * R)),
        units="mm, N/mm, MPa",
    )
    return ec.adapt(scene, body.named(regions=layers), accuracy=0.1, degree=2)


ANGLES = {"lying": 0.0, "leaning": np.pi / 4, "upright": np.pi / 2}
runs = {name: pressed(angle) for name, angle in ANGLES.items()}
forces = {name: run.force("bottom").force for name, run in runs.items()}
profiles = {name: run.profile("bottom") for name, run in runs.items()}

# %%
# The board with leaning fibres, and the pressure of the roller in all three.

ec.output.draw_deformed(runs["leaning"].error, FOLDER / "deformed.png")
if runs["lying"].error.domain.comm.rank == 0:
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    for name, profile in profiles.items():
        axes.plot(profile["x"], profile["pressure"], label=f"{name} fibres")
        print(f"{name} fibres: {forces[name][1]:.0f} N/mm")
    axes.set(xlabel="$x$ [mm]", ylabel="pressure [MPa]", xlim=(-6, 6), ylim=0)
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "pressure.png", dpi=150)

# %%
# What must hold: all are certified; upright fibres bear most; fibres along the board or
# across it push to no side, and fibres that lean do.

for run in runs.values():
    assert run.reached
assert forces["lying"][1] < forces["leaning"][1] < forces["upright"][1]
for name in ("lying", "upright"):
    assert abs(forces[name][0]) < 0.02 * forces[name][1]
assert abs(forces["leaning"][0]) > 0.02 * forces["leaning"][1]
