"""Draws meshed_apart.png: what ``joined`` changes in meshes that do not match.

python docs/figures/meshed_apart.py
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from PIL import Image

import erc_contact as ec
from namedmesh.base.releases import cell_nodes

plt.style.use("namedmesh.pictures.style")

HERE = Path(__file__).parent
COLOURS = {"upper": "#1f5a9c", "lower": "#b05a14"}


def draw_cells(axes: Axes, domain: ec.Domain) -> None:
    """Draw the edges of the cells of each body in its colour."""
    x = domain.mesh.geometry.x
    for body, colour in COLOURS.items():
        cells = domain.cell_tags.find(domain.regions[body])
        axes.triplot(
            x[:, 0], x[:, 1], cell_nodes(domain.mesh.geometry)[cells], color=colour, lw=0.8
        )


def draw_facets(axes: Axes, domain: ec.Domain, parts: dict[str, str]) -> None:
    """Draw the edges of the facets of parts that are seen from above."""
    x = domain.mesh.geometry.x
    nodes = cell_nodes(domain.mesh.geometry)
    for part, colour in parts.items():
        cell, local = domain.facets(part).T
        corners = np.array([np.delete(nodes[c], i) for c, i in zip(cell, local, strict=True)])
        axes.triplot(x[:, 0], x[:, 1], corners, color=colour, lw=0.8)


def in_the_plane(before: Axes, after: Axes) -> None:
    """Draw two rectangles beside their contact."""
    upper = ec.rectangle((-1.0, 0.0), (1.0, 2.0), size=0.4)
    lower = ec.rectangle((-2.0, -1.5), (2.0, 0.0), size=0.55)
    both = ec.assembly({"upper": upper, "lower": lower})
    blocks = both.joined("upper bottom", "lower top")
    for axes, domain, words in (
        (before, both, "in the plane: meshed apart"),
        (after, blocks, "joined: both sides have the vertices of both"),
    ):
        draw_cells(axes, domain)
        axes.set(title=words, xlim=(-1.6, 1.6), ylim=(-0.75, 0.75))


def in_space(before: Axes, after: Axes) -> None:
    """Draw the common plane of two boxes, seen from above."""
    upper = ec.box((0.3, 0.4, 1.0), (1.5, 1.3, 1.6), size=0.3)
    lower = ec.box((0.0, 0.0, 0.0), (2.0, 1.6, 1.0), size=0.4)
    both = ec.assembly({"upper": upper, "lower": lower})
    boxes = both.joined("upper bottom", "lower top")
    # The lower body has the facets of the upper body there, so either may be drawn.
    names = {"lower top outside": COLOURS["lower"], "upper bottom": COLOURS["upper"]}
    for axes, domain, parts, words in (
        (
            before,
            both,
            {"lower top": COLOURS["lower"], "upper bottom": COLOURS["upper"]},
            "in 3D: top of the lower box, foot of the upper one",
        ),
        (after, boxes, names, "joined: the foot is an imprint on the top"),
    ):
        draw_facets(axes, domain, parts)
        axes.set(title=words)


figure, panels = plt.subplots(2, 2, figsize=(9.0, 6.4), layout="constrained")
in_the_plane(*panels[0])
in_space(*panels[1])
for axes in panels.flat:
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.title.set_fontsize(10)
path = HERE / "meshed_apart.png"
figure.savefig(path, dpi=90)
Image.open(path).convert("RGB").quantize(12).save(path, optimize=True)
