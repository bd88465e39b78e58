"""Draw the picture of README: two meshes of its run, and the contact at the end.

It is written as block.png beside this script.

python docs/figures/block.py
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import erc_contact as ec
from namedmesh.base.releases import cell_nodes

plt.style.use("namedmesh.pictures.style")

block = ec.rectangle((0.0, 0.0), (2.0, 7.0), size=0.5)
scene = ec.Scene(
    material=ec.Elastic(E=1.0, nu=0.3),
    supports=[ec.Displacement("top", (0.1, -0.05))],
    loads=[ec.Traction("right", (-0.0002, 0.0))],
    contacts=[ec.Contact("bottom", friction=0.3)],
)
history = ec.adapt(scene, block, accuracy=0.01)
contact = history.profile("bottom")

fig = plt.figure(figsize=(8, 3.9), layout="constrained")
*bodies, side = fig.subplots(1, 3, width_ratios=[1, 1, 2.6])
for ax, number in zip(bodies, (0, 3), strict=True):
    domain, eps = history.meshes[number]
    x, cells = domain.mesh.geometry.x, cell_nodes(domain.mesh.geometry)
    ax.tripcolor(x[:, 0], x[:, 1], cells, np.log10(eps), cmap="viridis", edgecolors="k", lw=0.2)
    ax.set(
        aspect="equal",
        title=f"{domain.cells} elements\nerror {100 * history.steps[number].eps:.2g}%",
    )
    ax.axis("off")
side.plot(contact["x"], contact["pressure"], label="pressure", color="C0")
side.plot(contact["x"], contact["shear"], label="shear", color="C3")
side.plot(
    contact["x"], contact["friction_bound"], "--", color="gray", lw=0.8, label="friction bound"
)
side.plot(contact["x"], -contact["friction_bound"], "--", color="gray", lw=0.8)
elements = history.error.domain.cells
percent = 100 * history.error.relative
side.set(
    xlabel="x along the contact",
    title=f"contact traction, {elements} elements, error {percent:.2g}%",
)
side.legend()
path = Path(__file__).with_suffix(".png")
fig.savefig(path, dpi=110)
Image.open(path).convert("RGB").quantize(96).save(path, optimize=True)
