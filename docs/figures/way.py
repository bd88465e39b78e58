"""Draw the way of the data, from scene and domain to the next domain.

It is written as way.svg beside this script.

python docs/figures/way.py
"""

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

FILL, LINE = "#e8f0f8", "#1f4e79"
HEIGHT, STEP = 0.78, 1.5
VALUES = [
    ("Solution", "displacement $u_h$, contact traction $r_h$ of the method"),
    (
        "Admissible",
        r"$\hat u$ does not penetrate; $\hat\sigma$, $\hat r$ balance; $\hat r$ obeys friction",
    ),
    (
        "ConstitutiveError",
        r"$e$, $\epsilon$; $\epsilon_E$ of each element; forces, profiles, maxima",
    ),
    ("History", "one row a mesh, the best result, tables, pictures, files"),
]
STAGES = [
    ("solve", "Newton's method on the contact"),
    ("equilibrate", "one elastic solve, then patches of elements"),
    ("constitutive_error", "integrals over elements and contact facets"),
    (r"$\epsilon\,\leq$ accuracy", "or a limit: the run ends"),
]


def value(ax, x, y, width, name, text):
    """A box for a value: its class, and what it holds."""
    ax.add_patch(FancyBboxPatch((x, y), width, HEIGHT, boxstyle="round,pad=0.05", fc=FILL, ec=LINE))
    ax.text(
        x + width / 2,
        y + 0.54,
        name,
        ha="center",
        va="center",
        family="monospace",
        weight="bold",
        size=11,
    )
    ax.text(x + width / 2, y + 0.18, text, ha="center", va="center", size=8)


def arrow(ax, start, end, **style):
    """An arrow of the way."""
    ax.annotate(
        "",
        end,
        start,
        arrowprops={"arrowstyle": "-|>", "color": LINE, "shrinkA": 0, "shrinkB": 0} | style,
    )


def stage(ax, x, y, name, text):
    """The words beside an arrow: a function, and what it does."""
    ax.text(x, y + 0.14, name, va="center", family="monospace", size=10, color=LINE)
    ax.text(x, y - 0.14, text, va="center", size=8, style="italic")


def beside(ax, x, name):
    """The functions of the way back, written upwards beside it."""
    ax.text(
        x,
        4.2,
        name,
        rotation=90,
        ha="center",
        va="center",
        family="monospace",
        size=10,
        color=LINE,
    )


plt.rcParams["svg.hashsalt"] = "way"  # the same file each time
plt.rcParams["svg.fonttype"] = "none"  # letters stay text: a fifth of the size
fig, ax = plt.subplots(figsize=(5.9, 5.9))
value(ax, 0.0, 6.0, 3.05, "Scene", "material, supports, contacts")
value(ax, 3.55, 6.0, 2.85, "Domain", "a mesh with named parts")
for number, ((name, text), words) in enumerate(zip(VALUES, STAGES, strict=True)):
    y = 6.0 - STEP * (number + 1)
    value(ax, 0.0, y, 6.4, name, text)
    arrow(ax, (1.2, y + STEP - 0.06), (1.2, y + HEIGHT + 0.06))
    stage(ax, 1.4, y + (STEP + HEIGHT) / 2, *words)
arrow(ax, (5.0, 5.94), (5.0, 6.0 - STEP + HEIGHT + 0.06))

# The way back, from the error to the next domain.
error = 6.0 - 3 * STEP + HEIGHT / 2
ax.plot([6.46, 6.85], [error, error], color=LINE, lw=1)
ax.plot([6.85, 6.85], [error, 6.0 + HEIGHT / 2], color=LINE, lw=1)
arrow(ax, (6.85, 6.0 + HEIGHT / 2), (6.46, 6.0 + HEIGHT / 2))
beside(ax, 7.08, "mark, refined")
beside(ax, 7.45, "size_map, remeshed")

ax.set(xlim=(-0.1, 7.65), ylim=(-0.1, 6.9))
ax.axis("off")
fig.savefig(Path(__file__).with_suffix(".svg"), bbox_inches="tight", metadata={"Date": None})
