"""Draw the parts of a domain with their names.

In the plane each part is a line of its own colour, drawn a little inside its body, so
that both sides of a pair can be seen. In 3D each part is a surface, and its name
stands on a facet that nothing hides.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from namedmesh.base.checks import description
from namedmesh.base.exceptions import InputError
from namedmesh.base.names import in_picture
from namedmesh.base.ranks import gather_rows
from namedmesh.base.releases import cell_nodes
from namedmesh.domain import Domain
from namedmesh.parts_table import NAMELESS, facets_of_parts
from namedmesh.pictures.figures import COLOUR_CYCLE, draw_figure, new_figure, only_in_2d
from namedmesh.pictures.grids import body_mesh
from namedmesh.pictures.skin import skin_of, straight
from namedmesh.pictures.views import SPACE, ShownPart, corners_seen, show, views_of
from namedmesh.rows import in_space
from namedmesh.sides import boundary_sides
from namedmesh.simplex import of_facets, outward_normals

INSIDE = 0.004
"""Distance of a line of a part from its side, over the size of the body [-]."""
BESIDE = 0.02
"""Distance of a name from its side, over the size of the body [-]."""
MARGIN = 0.07
"""Place for names around a body in the plane, over the size of the body [-]."""
CANDIDATES = 30
"""Number of facets of a part, about, that are looked at as a place for its name."""
FEW_FACETS = 4000
"""Greatest number of facets in 3D whose edges are shown."""
GREY = "#d0d4d8"
"""Colour of facets without a name."""


def draw_parts(domain: Domain, path: str | Path | None = None, *, ax: Any = None) -> Any:
    """Draw the parts of a domain with their names; collective.

    Args:
        domain: The domain.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, in 2D; by default axes of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks; in 3D an array of two.

    Raises:
        InputError: If this is no domain, or axes are given in 3D.

    Example:
        >>> nm.draw_parts(block, "results/parts.png")
        <Axes: ...>
    """
    if not isinstance(domain, Domain):
        raise InputError(f"draw_parts: {description(domain)} is no domain; give one.")
    comm = domain.comm
    d = domain.dim
    facets, part = facets_of_parts(domain)
    cell, local = boundary_sides(domain.mesh, facets)
    of_cells = domain.mesh.geometry.x[cell_nodes(domain.mesh.geometry)[cell], :d]
    corners = of_facets(of_cells, local)
    table = gather_rows(comm, part=part, corners=corners, normals=outward_normals(of_cells, local))
    body = gather_rows(comm, **body_mesh(domain))
    size = domain.extent
    names = [*domain.names, NAMELESS]
    in_pairs = {name for pair in domain.pairs for name in pair}

    def draw(ax: Any) -> Any:
        only_in_2d("draw_parts", ax, d)
        shown = _Shown(names, table["part"], table["corners"], table["normals"], size)
        return _draw_flat(ax, body, shown, in_pairs) if d == 2 else _draw_in_space(shown)

    return draw_figure(comm, path, ax, draw)


class _Shown:
    """Hold the facets of all ranks by parts; on rank 0.

    Args:
        names: Names of the parts; the last name stands for facets without a name.
        part: Number of the part of each facet, shape (n,).
        corners: Corners of the facets [length], shape (n, d, d).
        normals: Their outward normals, shape (n, d).
        size: Size of the body [length].
    """

    def __init__(
        self,
        names: Sequence[str],
        part: np.ndarray,
        corners: np.ndarray,
        normals: np.ndarray,
        size: float,
    ) -> None:
        self.names = names
        self.part = part
        d = normals.shape[1]
        self.corners = in_space(corners.reshape(-1, d)).reshape(-1, d, 3)
        self.normals = in_space(normals)
        self.size = size
        self.middles = self.corners.mean(axis=1)

    @property
    def colours(self) -> list[Any]:
        """Return the colour of each part, grey for the facets without a name."""
        from matplotlib import colormaps  # noqa: PLC0415

        count = len(self.names) - 1
        # Black, the last colour of the cycle, hides words.
        few = COLOUR_CYCLE[:-1]
        many = colormaps["tab20"].colors
        cycle = few if count <= len(few) else many
        return [*(cycle[i % len(cycle)] for i in range(count)), GREY]

    def surface(self, number: int, shift: float, **look: Any) -> ShownPart:
        """Return the facets of a part, moved outward by ``shift`` [length]."""
        chosen = self.part == number
        moved = self.corners[chosen] + shift * self.normals[chosen][:, None]
        points = moved.reshape(-1, 3)
        return straight(points, np.arange(len(points)).reshape(moved.shape[:2])), look

    def central(self, number: int, towards: np.ndarray | None = None) -> np.ndarray:
        """Return facets of a part, the facets near its middle first.

        Args:
            number: Number of the part.
            towards: Direction to the eye, shape (3,): only what it sees from in front.
        """
        chosen = self.part == number
        if towards is not None:
            chosen &= self.normals @ towards > 0.1
        facets = np.flatnonzero(chosen)
        middle = self.middles[facets].mean(axis=0) if len(facets) else np.zeros(3)
        distance = np.linalg.norm(self.middles[facets] - middle, axis=1)
        return facets[np.argsort(distance, kind="stable")]


def _draw_flat(ax: Any, body: dict[str, np.ndarray], shown: _Shown, in_pairs: set[str]) -> Any:
    """Draw parts of a body in the plane."""
    skin = skin_of(**body, d=2)
    parts = [skin.faces(skin.points, color="#eef2f6")]
    parts.append(skin.edges(skin.points, color="#9aa4ae", line_width=0.8))
    for number, colour in enumerate(shown.colours):
        if np.any(shown.part == number):
            look = {"color": colour, "line_width": 8.0}
            parts.append(shown.surface(number, -INSIDE * shown.size, **look))
    view = np.eye(3)
    if ax is None:
        width, height = np.ptp(corners_seen(parts, view), axis=0)[:2]
        scale = min(7.0 / width, 6.0 / height)
        figure = new_figure(scale * width + 2.0, scale * height + 1.2, "compressed")
        ax = figure.subplots()
    show([ax], [(parts, view)])
    for number, name in enumerate(shown.names[:-1]):
        facets = shown.central(number)
        normal = shown.normals[facets[0]]
        # Outside of the body, but between two bodies inside.
        direction = -normal if name in in_pairs else normal
        place = shown.middles[facets[0]] + BESIDE * shown.size * direction
        sideways = int(np.sign(round(direction[0], 1)))
        upward = int(np.sign(round(direction[1], 1)))
        words = {
            "ha": ("center", "left", "right")[sideways],
            "va": ("center", "bottom", "top")[0 if abs(direction[0]) > 0.9 else upward],
        }
        _write(ax, name, place[:2], **words)
    # Names below the body would else stand on the ticks.
    low, high = corners_seen(parts, view)
    margin = MARGIN * shown.size
    ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    return ax


def _draw_in_space(shown: _Shown) -> Any:
    """Draw parts of a body in 3D, from both sides."""
    from matplotlib.patches import Patch  # noqa: PLC0415

    used = np.unique(shown.part)
    colours = shown.colours
    parts = [shown.surface(number, 0.0, color=colours[number]) for number in used]
    if len(shown.part) <= FEW_FACETS:
        edges = np.concatenate([shown.corners[:, [i, (i + 1) % 3]] for i in range(3)])
        points = edges.reshape(-1, 3)
        lines = straight(points, np.arange(len(points)).reshape(-1, 2))
        parts.append((lines, {"color": "#404040", "opacity": 0.35, "line_width": 0.8}))
    views = views_of(3, np.eye(3)[2])
    sizes = np.array([np.ptp(corners_seen(parts, view), axis=0)[:2] for view in views.values()])
    scale = 1.6 * SPACE / sizes[:, 0].sum()
    height = scale * sizes[:, 1].max()
    rows = -(-len(used) // 5)
    figure = new_figure(1.6 * SPACE + 2.2, height + 0.8 + 0.25 * rows, "compressed")
    panels = figure.subplots(1, len(views))
    show(panels, [(parts, view) for view in views.values()])
    labelled = set()
    for panel, (title, view) in zip(panels, views.items(), strict=True):
        panel.set_title(title, fontsize=11)
        for number, name in enumerate(shown.names[:-1]):
            place = _visible(shown, shown.central(number, view[2]), view)
            if place is not None:
                labelled.add(name)
                _write(panel, name, place, ha="center", va="center")
    handles = []
    for number in used:
        name = shown.names[number]
        hidden = "" if name in labelled or name == NAMELESS else " (hidden)"
        handles.append(Patch(color=colours[number], label=f"{in_picture(name)}{hidden}"))
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return panels


def _visible(shown: _Shown, facets: np.ndarray, view: np.ndarray) -> np.ndarray | None:
    """Return the place in a view of the first of some facets that nothing hides.

    Args:
        shown: All facets.
        facets: Numbers of those that are looked at, the best ones first.
        view: Axes of the view, shape (3, 3).

    Returns:
        The place, shape (2,), or None if all are hidden.
    """
    step = max(1, len(facets) // CANDIDATES)
    triangles = shown.corners @ view.T
    first, second, third = triangles.transpose(1, 0, 2)
    for facet in facets[::step]:
        point = shown.middles[facet] @ view.T
        # A triangle is before the point if it contains it in the plane of the picture.
        a = _cross(second - first, point - first)
        b = _cross(third - second, point - second)
        c = _cross(first - third, point - third)
        total = a + b + c
        contains = (np.sign(a) == np.sign(b)) & (np.sign(b) == np.sign(c)) & (total != 0)
        weights = np.stack([b, c, a], axis=1)[contains] / total[contains, None]
        depth = (weights * triangles[contains, :, 2]).sum(axis=1)
        if not np.any(depth > point[2] + 1e-6 * shown.size):
            return np.asarray(point[:2])
    return None


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross product of vectors in the plane of the picture."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _write(axes: Any, name: str, place: np.ndarray, **words: Any) -> None:
    """Write a name with a white rim, so that it can be read on any colour."""
    from matplotlib.patheffects import withStroke  # noqa: PLC0415

    rim = [withStroke(linewidth=2.5, foreground="white")]
    axes.text(
        *place, in_picture(name), fontsize=10, color="black", path_effects=rim, zorder=10, **words
    )
