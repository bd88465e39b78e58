"""Draw foundations in pictures of deformed bodies, and find their magnification.

A body is drawn at X + s u^ with a magnification s. A foundation is drawn as it is, at Y
= X + g n: a plane stays a plane below a curved body. For s > 1 it is moved with the
body, as a rigid one, to Y + (s - 1) rho(Y). The rigid motion rho has the normal part
that is nearest to the gap g where the contact is closed. So a plane below a flat side,
with a gap that is constant or linear, is met exactly where the contact is closed.
Elsewhere closed parts look open or entered by (s - 1) (u^_n - rho_n), and parts beside
them, too. The magnification that is chosen by default is so small that this is hardly
seen, and a coloured line shows what is closed. A compliant foundation is drawn without
its deflection.

Symbols: X position before the deformation, g gap, n normal of the foundation, u^
admissible displacement, v_n = v . n, d dimension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from erc_contact.model.contact.status import OPEN
from erc_contact.output.drawing import tangents
from erc_contact.output.gathered import WholeContact, mean_normal
from namedmesh.for_solvers import in_space
from namedmesh.pictures import DIVISIONS, sample, straight
from namedmesh.simplex import edges

FOUNDATION_REACH = 0.15
"""Share of the body's size below which a gap has its foundation drawn [-]."""
BAND_WIDTH = 0.03
"""Width of the band of a foundation in 2D, as a share of the body's size [-]."""
EXCESS = 0.06
"""Length by which a flat foundation extends beyond each end of its contact, as a share
of the body's size [-].
"""
FLATNESS = 1e-6
"""Distance from a plane of a flat foundation, as a share of the body's size [-]."""
CLOSED_COLOUR = "#D55E00"
"""Colour of lines that show what is closed."""
SYMMETRY_COLOUR = "#0072B2"
"""Colour of lines that show planes of symmetry."""
DISPLACEMENT_SHARE = 0.06
"""Share of the body's size with which the largest displacement is drawn [-]."""
STILL_SHARE = 1e-12
"""Share of the body's size below which a displacement is round-off [-]."""
LEAST_MAGNIFICATION = 1.2
"""Magnification below which a displacement is not magnified by default [-]."""
UNSEEN = 0.003
"""Share of the body's size by which a closed contact may look open or entered [-]."""
TURNING_WIDTH = 0.1
"""Least root mean square width of a closed part with which a foundation turns, as a
share of the contact [-]. A narrow part knows only the slope of what is below it.
"""


@dataclass(frozen=True, eq=False)
class MovingFoundation:
    """Hold a foundation and its rigid motion rho.

    Attributes:
        surface: The contact.
        centre: Centre of the closed part of the foundation [length], shape (d,).
        shift: rho at the centre [length], shape (d,).
        turn: Its skew gradient [-], shape (d, d).
    """

    surface: WholeContact
    centre: np.ndarray
    shift: np.ndarray
    turn: np.ndarray

    def motion(self, x: np.ndarray) -> np.ndarray:
        """Compute rho at points [length], shape (..., d)."""
        return self.shift + (x - self.centre) @ self.turn.T

    @property
    def moves(self) -> bool:
        """Tell whether rho is not zero."""
        return bool(self.shift.any() or self.turn.any())

    def entry(self, factor: float) -> float:
        """Compute by how much a closed contact looks open or entered [length].

        Args:
            factor: Magnification of the displacement [-].
        """
        normal_motion, missing, closed = self._normal_parts()
        entered = (factor * missing - normal_motion).max(initial=0.0)
        opened = ((1 - factor) * missing[closed]).max(initial=0.0)
        return float(max(entered, opened))

    def greatest_factor(self, allowed: float) -> float:
        """Find the greatest magnification with an allowed :meth:`entry` [-].

        It is at least 1.
        """
        normal_motion, missing, closed = self._normal_parts()
        enters = missing > 0
        limits = (allowed + normal_motion[enters]) / missing[enters]
        opens = closed & (missing < 0)
        limits = np.append(limits, 1 - allowed / missing[opens])
        return max(1.0, float(limits.min(initial=np.inf)))

    def _normal_parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compute g - rho_n and u^_n - rho_n at the nodes of the contact [length].

        The third array tells which of the nodes are of closed facets.
        """
        surface = self.surface
        n = surface.traction.contact.direction[:, None]
        left = surface.gap - (self.motion(position(surface)) * n).sum(axis=-1)
        # The gap that is left is g - u^_n.
        missing = left - surface.gap_left
        closed = np.repeat(surface.status != OPEN, left.shape[1])
        return left.ravel(), missing.ravel(), closed


def position(surface: WholeContact) -> np.ndarray:
    """Compute the points X + g n of a foundation at the nodes of its contact [length].

    Their shape is (n, m, d).
    """
    return surface.place + surface.gap[..., None] * surface.traction.contact.direction[:, None]


def nearest_nodes(surface: WholeContact) -> np.ndarray:
    """Find the nodes of closed facets, shape (n, m).

    Where all are open, they are those with the least gap left.
    """
    closed = surface.status != OPEN
    if not closed.any():
        return surface.gap_left <= surface.gap_left.min()
    return np.broadcast_to(closed[:, None], surface.gap.shape)


def foundation_of(surface: WholeContact) -> MovingFoundation:
    """Fit the rigid motion of a foundation to the gap where its contact is closed.

    The fit is by least squares. Of all motions with the same normal part it is the
    smallest. A compliant foundation is entered there, and moves with the body.
    """
    d = surface.d
    target = surface.gap
    if surface.traction.contact.stiffness is not None and np.any(surface.status != OPEN):
        target = surface.gap - surface.gap_left
    nearest = nearest_nodes(surface)
    root_of_area = np.sqrt(surface.traction.area)[:, None]
    weight = np.broadcast_to(root_of_area, nearest.shape)[nearest]
    direction = surface.traction.contact.direction[:, None]
    n = np.broadcast_to(direction, (*nearest.shape, d))[nearest]
    positions = position(surface)
    y = positions[nearest]
    gap = target[nearest]
    centre = np.average(y, axis=0, weights=weight**2)
    # Turns are relative to the size, so that their columns are as long as the columns
    # of shifts.
    size = np.linalg.norm(np.ptp(positions.reshape(-1, d), axis=0))
    planes = [np.outer(i, j) - np.outer(j, i) for i, j in combinations(np.eye(d), 2)]
    turns = np.array(planes) / size
    turned = np.einsum("kij,pj,pi->pk", turns, y - centre, n)
    normal_parts = weight[:, None] * np.column_stack([n, turned])
    # The cut-off keeps a narrow closed part from turning the whole foundation.
    parts = np.linalg.lstsq(normal_parts, weight * gap, rcond=TURNING_WIDTH)[0]
    return MovingFoundation(surface, centre, parts[:d], np.tensordot(parts[d:], turns, axes=1))


def greatest_factor(foundations: Sequence[MovingFoundation], largest: float, size: float) -> float:
    """Find the greatest magnification of a picture by default [-].

    It is infinite if nothing moves.

    Args:
        foundations: The foundations of a body.
        largest: Its largest displacement [length].
        size: Its size [length].
    """
    if largest <= STILL_SHARE * size:
        return np.inf
    limits = [foundation.greatest_factor(UNSEEN * size) for foundation in foundations]
    return min([DISPLACEMENT_SHARE * size / largest, *limits])


def round_factor(factor: float) -> float:
    """Round a magnification to two digits; 1 where it is near to 1, or infinite."""
    return float(f"{factor:.2g}") if LEAST_MAGNIFICATION < factor < np.inf else 1.0


def drawn_foundation(foundation: MovingFoundation, factor: float, size: float) -> Any:
    """Draw the part of a foundation that is near the body, moved with the body.

    A plane is drawn somewhat larger than the contact. Other foundations end with the
    contact.

    Args:
        foundation: The foundation.
        factor: Magnification of the displacement [-].
        size: Size of the body [length].

    Returns:
        Straight lines in 2D or triangles in 3D for pyvista. At their points the data
        ``normal`` is the normal of the foundation.
    """
    surface = foundation.surface
    d = surface.d
    direction = surface.traction.contact.direction
    n = mean_normal(surface)
    points, parts = sample(position(surface), d - 1, DIVISIONS)
    gap = sample(surface.gap[..., None], d - 1, DIVISIONS)[0][:, 0]
    normal = np.repeat(direction, len(points) // len(direction), axis=0)
    near = gap < FOUNDATION_REACH * size
    is_plane = n.any() and np.ptp(points @ n) <= FLATNESS * size
    is_flat = is_plane and np.ptp(direction, axis=0).max() <= FLATNESS
    if is_flat and near.any():
        points, parts = _rectangle(points[near], n, EXCESS * size)
        normal = normal[: len(points)]
        gap = np.zeros(len(points))
    moved = points + (factor - 1) * foundation.motion(points)
    drawn = straight(in_space(moved), parts)
    drawn.point_data.update({"gap": gap, "normal": in_space(normal)})
    return drawn.clip_scalar(scalars="gap", value=FOUNDATION_REACH * size)


def _rectangle(points: np.ndarray, n: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Find the part of a plane with the normal n around points in it, and some more.

    Returns:
        Its corners [length], shape (2^(d-1), d), and the numbers of the corners of its
        straight parts.
    """
    plane = tangents(n)
    along = points @ plane.T
    ends = np.array([along.min(axis=0) - margin, along.max(axis=0) + margin])
    grid = np.meshgrid(*ends.T, indexing="ij")
    corners = np.stack(grid, axis=-1).reshape(-1, len(plane))
    parts = [[0, 1]] if len(plane) == 1 else [[0, 1, 2], [1, 2, 3]]
    height = float((points @ n).mean())
    return corners @ plane + height * n, np.array(parts)


def closed_part(surface: WholeContact, nodes: np.ndarray, x: np.ndarray) -> Any:
    """Draw the closed part of a contact in 2D, or its border in 3D.

    Args:
        surface: The contact.
        nodes: Numbers of the nodes of its facets, on one of its sides, shape (f, m);
            (0, m) on the side of a foundation.
        x: Positions at which the nodes of the body are drawn [length], shape (n, 3).

    Returns:
        Straight lines for pyvista; None if the contact is open, or its closed part has
        no border.
    """
    closed = surface.status != OPEN
    if not closed.any():
        return None
    nodes = nodes[closed[: len(nodes)]]
    if surface.d == 3:
        nodes = _border(nodes)
    if len(nodes) == 0:
        return None
    points, parts = sample(x[nodes], 1, DIVISIONS)
    return straight(points, parts)


def _border(nodes: np.ndarray) -> np.ndarray:
    """Find the edges that belong to one facet only, of facets with nodes (f, m).

    Returns:
        Nodes of these edges, their two ends first, shape (e, 2) or (e, 3).
    """
    ends = nodes[:, edges(2)]
    curves = ends
    if nodes.shape[1] > 3:
        # The node in the middle of an edge follows its two ends.
        curves = np.concatenate([ends, nodes[:, 3:, None]], axis=2)
    keys = np.sort(ends, axis=2).reshape(-1, 2)
    _, first, count = np.unique(keys, axis=0, return_index=True, return_counts=True)
    return curves.reshape(-1, curves.shape[2])[first[count == 1]]


def ground(surface: Any, size: float) -> list[tuple[Any, dict[str, Any]]]:
    """Give the parts of a :func:`drawn_foundation` their options.

    ``size`` is the size of the body [length]. In 2D the foundation is a line with a
    band beyond it, in 3D a grey surface. Nothing is drawn of an empty one.
    """
    import pyvista  # noqa: PLC0415

    if surface.n_cells == 0:
        return []
    if surface.n_lines == 0:
        return [(surface, {"color": "#b8b8b8"})]
    parts = surface.lines.reshape(-1, 3)[:, 1:]
    beyond = surface.points + BAND_WIDTH * size * surface.point_data["normal"]
    quads = np.column_stack([parts, len(beyond) + parts[:, ::-1]])
    band = pyvista.PolyData.from_regular_faces(np.concatenate([surface.points, beyond]), quads)
    return [(band, {"color": "#c8c8c8"}), (surface, {"color": "#505050", "line_width": 3.0})]
