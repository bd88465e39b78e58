"""Find the area of a contact, and the strips of a contact in the plane or of rings.

Their ends lie inside facets, see :mod:`erc_contact.model.contact_end`.

Symbols: u displacement, r contact traction, d dimension, k degree, f facets, q points
of a facet, c facets of a curve.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.status import OPEN, facet_status
from erc_contact.model.contact.trace import split
from erc_contact.model.contact_end import FACETS, Estimate, end_of
from erc_contact.model.profile import profile_points, profile_table, profile_weights
from erc_contact.model.section import Section
from erc_contact.model.space import Space
from namedmesh.base.ranks import of_all
from namedmesh.simplex import measures

TOUCH = 1e-9
"""Distance of facets that are neighbours, over the extent of the body [-]."""


@dataclass(frozen=True, eq=False)
class Strip:
    """Hold a strip of a contact in the plane or of rings.

    Attributes:
        ends: Its two ends, in the order of a profile [length], shape (2, 2).
        margins: How far each may be off along the contact [length], shape (2,); 0 where
            the strip ends with the part of the contact.
        length: The length between the ends, along the contact [length].
        area: Of rings their area [area], in the plane the length.
    """

    ends: np.ndarray
    margins: np.ndarray
    length: Estimate
    area: Estimate


@dataclass(frozen=True, eq=False)
class ContactArea:
    """Hold the area of a contact, and where its strips end.

    Attributes:
        area: The area under pressure: in 3D and of rings an area [area], in the plane
            the length of all strips [length].
        strips: The strips of a contact in the plane or of rings; () in 3D.
        axisymmetric: Whether it is a contact of rings.

    Example:
        >>> contact = error.contact_area("bottom")
        >>> print(contact.half_width)
        1
        >>> contact.strips[0].ends.tolist()
        [[0.0, 0.0], [2.0, 0.0]]
    """

    area: Estimate
    strips: tuple[Strip, ...]
    axisymmetric: bool

    def __str__(self) -> str:
        """Write the area, and a line for each strip."""
        lines = [f"contact area {self.area}"]
        x, y = "rz" if self.axisymmetric else "xy"
        for strip in self.strips:
            start, stop = (
                f"{x} = {end[0]:.5g}, {y} = {end[1]:.5g} (+- {margin:.2g})"
                for end, margin in zip(strip.ends, strip.margins, strict=True)
            )
            lines.append(f"from {start} to {stop}")
        return "\n".join(lines)

    @property
    def half_width(self) -> Estimate:
        """Return half of the length of the only strip [length].

        If a plane of symmetry cuts the contact in half, ``strips[0].length`` is the
        half width of the whole.

        Raises:
            InputError: If the contact has no strip, or several.
        """
        if len(self.strips) != 1:
            raise InputError(
                f"half_width: this contact has {len(self.strips)} strips, it needs one; .strips"
                " has all of a contact in the plane or of rings, and .area is of all contacts."
            )
        length = self.strips[0].length
        return Estimate(length.value / 2, length.margin / 2)

    @property
    def radius(self) -> Estimate:
        """Return the greatest radius of a contact of rings [length].

        Raises:
            InputError: If it is no contact of rings, or all open.
        """
        if not self.axisymmetric or not self.strips:
            raise InputError(
                "radius: it is of rings that are in contact somewhere; .area is of all contacts."
            )
        ends = np.concatenate([strip.ends for strip in self.strips])
        margins = np.concatenate([strip.margins for strip in self.strips])
        outermost = int(ends[:, 0].argmax())
        return Estimate(float(ends[outermost, 0]), float(margins[outermost]))


def contact_area(
    space: Space,
    contact: ContactOnMesh,
    u: fem.Function,
    r: np.ndarray,
    bound: np.ndarray,
    *,
    can_open: bool,
    relative_error: float = 0.0,
) -> ContactArea:
    """Find where a contact ends; collective, the same on all ranks.

    Args:
        space: The mesh.
        contact: One of its contacts.
        u: Displacement [length].
        r: Contact traction at the points of profiles [force/area], shape (f, q, d).
        bound: Friction bound there [force/area], shape (f, q).
        can_open: Whether the contact may open; if not, its area is the area of its
            part.
        relative_error: eps of the solution [-]. An energy that is off by eps^2 moves
            the ends by a like part of their distance, which the margins contain.
    """
    share = relative_error**2
    if space.d == 2:
        table = profile_table(space, contact, u, r, bound)
        strips = tuple(_strips(space, table, share, can_open=can_open))
        total = sum(strip.area.value for strip in strips)
        margin = sum(strip.area.margin for strip in strips)
        return ContactArea(Estimate(total, margin), strips, space.section.axisymmetric)
    points, weights = profile_points(space), profile_weights(space)
    pressure = -split(r, contact.trace.normals_at(points)).normal @ weights
    status = facet_status(space, contact, u, r, bound, points, weights)
    here = contact.trace.here
    columns = [
        space.global_numbers(here.nodes[:, : space.d]),
        measures(contact.named_corners),
        pressure * measures(here.corners),
        status != OPEN,
    ]
    vertices, area, force, is_closed = of_all(space.comm, *(x[here.owned] for x in columns))
    total = float(area[is_closed].sum())
    if not can_open or is_closed.all() or not is_closed.any():
        return ContactArea(Estimate(total, 0.0), (), axisymmetric=False)
    count = FACETS[space.degree]
    layers = _layers(vertices, is_closed, count + 1)
    sizes, forces = (np.array([x[layer].sum() for layer in layers]) for x in (area, force))
    nothing = np.zeros(0)
    end = end_of(sizes, forces, nothing, nothing, count, space.degree)
    margin = end.margin + share * total
    beyond = _up_to(Estimate(end.value, margin), float(area[~is_closed].sum()))
    return ContactArea(Estimate(total + beyond.value, beyond.margin), (), axisymmetric=False)


def _layers(vertices: np.ndarray, is_closed: np.ndarray, count: int) -> list[np.ndarray]:
    """Return the outermost layers of the closed facets of a contact in 3D.

    A layer has the closed facets with a vertex in common with the layer before it; the
    first layer has such vertices in common with open facets.

    Args:
        vertices: Vertices of the facets, shape (f, 3).
        is_closed: Whether each is closed, shape (f,); at least one is, and not all.
        count: Most layers.

    Returns:
        Which facets are in each layer, at least one layer, shape (f,). It is all closed
        facets where no open facet touches them.
    """
    _, numbers = np.unique(vertices, return_inverse=True)
    numbers = numbers.reshape(vertices.shape)
    is_reached = np.zeros(numbers.max() + 1, dtype=bool)
    is_reached[numbers[~is_closed]] = True
    is_inside = is_closed.copy()
    layers = []
    for _ in range(count):
        layer = is_inside & is_reached[numbers].any(axis=1)
        if not layer.any():
            break
        layers.append(layer)
        is_reached[numbers[layer]] = True
        is_inside &= ~layer
    return layers or [is_closed]


def _up_to(end: Estimate, limit: float) -> Estimate:
    """Cut an estimate where a contact must end, with its part."""
    low, high = min(end.low, limit), min(end.high, limit)
    return Estimate((low + high) / 2, (high - low) / 2)


def _strips(space: Space, table: np.ndarray, share: float, *, can_open: bool) -> Iterator[Strip]:
    """Yield the strips of a contact in the plane or of rings, as a profile has them.

    Args:
        space: The mesh.
        table: The profile of the contact.
        share: Part of the length of a strip by which its ends may move.
        can_open: Whether the contact may open.
    """
    for curve in _curves(space, table):
        backwards = curve.mirrored()
        for first, last in curve.runs():
            length = curve.lengths[first : last + 1].sum()
            ends = []
            for way, outermost in ((backwards, len(curve.lengths) - 1 - first), (curve, last)):
                end = Estimate(0.0, 0.0)
                if can_open:
                    end = way.end(outermost, last - first + 1, space.degree)
                    end = Estimate(end.value, end.margin + share * length / 2)
                    if outermost == len(curve.lengths) - 1:
                        end = _up_to(end, 0.0)
                ends.append(end)
            before, after = ends
            start = Estimate(curve.starts[first] - before.value, before.margin)
            stop = Estimate(curve.starts[last + 1] + after.value, after.margin)
            sizes = []
            for sign in (0, 1):
                low = curve.area_up_to(space.section, start.value - sign * start.margin)
                high = curve.area_up_to(space.section, stop.value + sign * stop.margin)
                sizes.append(high - low)
            yield Strip(
                np.stack([curve.point(start.value), curve.point(stop.value)]),
                np.array([start.margin, stop.margin]),
                Estimate(float(stop.value - start.value), float(start.margin + stop.margin)),
                Estimate(float(sizes[0]), float(sizes[1] - sizes[0])),
            )


@dataclass(frozen=True, eq=False)
class _Curve:
    """Hold the facets of a contact in 2D that follow each other.

    A closed curve begins with an open facet, if it has one.

    Attributes:
        x: Places of the points of the facets [length], shape (c, q, 2).
        pressures: Mean pressures [force/area], shape (c,).
        gaps: Gap that is left at the points [length], shape (c, q).
        areas: Areas of the facets, of rings around the axis, shape (c,).
        is_closed: Whether the facets are closed, shape (c,).
    """

    x: np.ndarray
    pressures: np.ndarray
    gaps: np.ndarray
    areas: np.ndarray
    is_closed: np.ndarray

    @property
    def lengths(self) -> np.ndarray:
        """Return the lengths of the facets [length], shape (c,)."""
        return np.linalg.norm(self.x[:, -1] - self.x[:, 0], axis=1)

    @property
    def starts(self) -> np.ndarray:
        """Return the arc length at the ends of facets [length], shape (c+1,)."""
        return np.pad(np.cumsum(self.lengths), (1, 0))

    def taken(self, order: np.ndarray) -> _Curve:
        """Return facets of the curve in an order."""
        columns = (self.x, self.pressures, self.gaps, self.areas, self.is_closed)
        return _Curve(*(column[order] for column in columns))

    def mirrored(self) -> _Curve:
        """Return the curve in the opposite direction."""
        backwards = self.taken(np.arange(len(self.areas))[::-1])
        return _Curve(
            backwards.x[:, ::-1],
            backwards.pressures,
            backwards.gaps[:, ::-1],
            backwards.areas,
            backwards.is_closed,
        )

    def runs(self) -> list[tuple[int, int]]:
        """Return the first and the last facet of each run of closed facets."""
        changes = np.diff(np.pad(self.is_closed.astype(int), 1))
        firsts, lasts = np.flatnonzero(changes > 0), np.flatnonzero(changes < 0) - 1
        return list(zip(firsts.tolist(), lasts.tolist(), strict=True))

    def end(self, last: int, count: int, degree: int) -> Estimate:
        """Estimate the end of a run of closed facets, from the end of its last facet.

        Args:
            last: The last facet.
            count: Number of facets of the run.
            degree: Degree of the displacement.
        """
        # Half of the facets belong to the other end.
        of_line = min(FACETS[degree], max(count // 2, 1))
        inside = last - np.arange(min(of_line + 1, count))
        outside = np.arange(last + 1, min(last + 2 + of_line, len(self.areas)))
        outside = outside[np.logical_and.accumulate(~self.is_closed[outside])]
        lengths = self.lengths
        step = (self.x.shape[1] - 1) // degree
        distances, gaps = np.zeros(0), np.zeros(0)
        if len(outside):
            # The first node is the end of the closed facets itself.
            starts = self.starts[outside] - self.starts[last + 1]
            parts = np.arange(1, degree + 1) / degree
            nodes = starts[:, None] + lengths[outside, None] * parts
            distances = np.append(0.0, nodes)
            gaps = np.append(self.gaps[last, -1], self.gaps[outside, step::step])
        forces = lengths * self.pressures
        return end_of(lengths[inside], forces[inside], distances, gaps, of_line, degree)

    def _place(self, s: float) -> tuple[int, float]:
        """Return the facet at an arc length, and the share of the facet before it."""
        facet = int(np.searchsorted(self.starts[1:-1], s, side="right"))
        share = (s - self.starts[facet]) / self.lengths[facet]
        return facet, float(np.clip(share, 0.0, 1.0))

    def point(self, s: float) -> np.ndarray:
        """Return the place at an arc length [length], shape (2,)."""
        facet, share = self._place(s)
        start, stop = self.x[facet, 0], self.x[facet, -1]
        return np.asarray(start + share * (stop - start))

    def area_up_to(self, section: Section, s: float) -> float:
        """Return the area between the start of the curve and an arc length."""
        facet, share = self._place(s)
        # Of rings the area of a part of a straight facet has its middle as radius.
        middle = (self.x[facet, 0] + self.point(s)) / 2
        part = section.times(share * self.lengths[facet : facet + 1], middle[None])
        return float(self.areas[:facet].sum() + part[0])


def _curves(space: Space, table: np.ndarray) -> Iterator[_Curve]:
    """Yield the curves of a contact in 2D, from its profile."""
    q = len(profile_points(space))
    x = np.stack([table["x"], table["y"]], axis=1).reshape(-1, q, 2)
    weights = table["weight"].reshape(-1, q)
    areas = weights.sum(axis=1)
    pressures = (weights * table["pressure"].reshape(-1, q)).sum(axis=1) / areas
    gaps = table["gap"].reshape(-1, q)
    facets = _Curve(x, pressures, gaps, areas, table["status"].reshape(-1, q)[:, 0] != OPEN)
    touch = TOUCH * space.domain.extent
    is_break = np.linalg.norm(x[1:, 0] - x[:-1, -1], axis=1) > touch
    for part in np.split(np.arange(len(x)), np.flatnonzero(is_break) + 1):
        curve = facets.taken(part)
        is_loop = np.linalg.norm(curve.x[-1, -1] - curve.x[0, 0]) <= touch
        if is_loop and not curve.is_closed.all():
            curve = curve.taken(np.roll(np.arange(len(part)), -int(curve.is_closed.argmin())))
        yield curve
