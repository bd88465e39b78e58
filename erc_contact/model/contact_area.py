"""Find the area of a contact, and the strips of a contact in the plane or of rings.

Their ends lie inside facets, see :mod:`erc_contact.model.contact_end`.

Symbols: k degree, f facets, q points of a facet, c facets of a curve.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.contact_end import FACETS, Estimate, end_of
from erc_contact.model.section import Section
from erc_contact.model.space import Space
from namedmesh.base.ranks import of_all

TOUCH = 1e-9
"""Distance of facets that are neighbours, over the extent of the body [-]."""
Run = tuple[int, int, Estimate, Estimate]
"""Type of a run of closed facets: its first and last facet, how far the contact goes on
before the first, and how far after the last facet."""
KNOWN = Estimate(0.0, 0.0)
"""An end at the end of the facets."""


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


def area_of_facets(
    comm: MPI.Comm,
    vertices: np.ndarray,
    areas: np.ndarray,
    forces: np.ndarray,
    is_closed: np.ndarray,
    degree: int,
    share: float,
) -> ContactArea:
    """Find the area of a contact in 3D; collective, the same on all ranks.

    Args:
        comm: Communicator of the mesh.
        vertices: Global numbers of the vertices of the facets of this rank, without
            ghosts, shape (f, 3).
        areas: Their areas [area], shape (f,).
        forces: Normal forces on them [force], shape (f,).
        is_closed: Whether each is closed, shape (f,).
        degree: Degree k of the displacement.
        share: Part of the area that the margin contains beside what the mesh leaves
            unknown at the border.
    """
    vertices, areas, forces, is_closed = of_all(comm, vertices, areas, forces, is_closed)
    total = float(areas[is_closed].sum())
    if is_closed.all() or not is_closed.any():
        return ContactArea(Estimate(total, 0.0), (), axisymmetric=False)
    count = FACETS[degree]
    layers = _layers(vertices, is_closed, count + 1)
    sizes, pressed = (np.array([x[layer].sum() for layer in layers]) for x in (areas, forces))
    nothing = np.zeros(0)
    end = end_of(sizes, pressed, nothing, nothing, count, degree)
    end = Estimate(end.value, end.margin + share * total)
    end = _up_to(end, float(areas[~is_closed].sum()))
    return ContactArea(Estimate(total + end.value, end.margin), (), axisymmetric=False)


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


def area_of_strips(
    space: Space, table: np.ndarray, is_closed: np.ndarray, share: float, *, can_open: bool
) -> ContactArea:
    """Find the strips of a contact in the plane or of rings, from its profile.

    Strips whose margins meet are one.

    Args:
        space: The mesh.
        table: The profile, the same on all ranks.
        is_closed: Whether each facet is closed, in its order, shape (f,).
        share: Part of the length of a strip that the margins of both ends contain
            beside what the mesh leaves unknown there.
        can_open: Whether the contact may open; if not, it ends with its part.
    """
    strips = []
    for curve in _curves(table, is_closed, TOUCH * space.domain.extent):
        found: list[Run] = []
        for first, last in curve.runs():
            ends = curve.ends(first, last, space.degree, share) if can_open else (KNOWN, KNOWN)
            run = (first, last, *ends)
            if found and curve.meet(found[-1], run):
                # Whether anything is open between them is not known.
                start, _, before, _ = found.pop()
                run = (start, last, before, run[3])
            found.append(run)
        strips += [curve.strip(space.section, *run) for run in found]
    area = sum(strip.area.value for strip in strips)
    margin = sum(strip.area.margin for strip in strips)
    return ContactArea(Estimate(area, margin), tuple(strips), space.section.axisymmetric)


@dataclass(frozen=True, eq=False)
class _Curve:
    """Hold the facets of a contact in 2D that follow each other.

    A closed curve begins and ends with the same open facets, if it has any.

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

    def ends(self, first: int, last: int, degree: int, share: float) -> tuple[Estimate, Estimate]:
        """Estimate both ends of a run of closed facets, outwards from its facets.

        Args:
            first: The first facet of the run.
            last: The last facet.
            degree: Degree k of the displacement.
            share: Part of the length of the run that both margins contain.
        """
        count = last - first + 1
        extra = share * float(self.lengths[first : last + 1].sum()) / 2
        ends = []
        for curve, outermost in ((self.mirrored(), len(self.areas) - 1 - first), (self, last)):
            end = curve.end(outermost, count, degree)
            end = Estimate(end.value, end.margin + extra)
            is_last = outermost == len(self.areas) - 1
            ends.append(_up_to(end, 0.0) if is_last else end)
        return ends[0], ends[1]

    def meet(self, run: Run, after: Run) -> bool:
        """Tell whether the margins of two runs of closed facets meet between them.

        Args:
            run: A run.
            after: The run after it.
        """
        between = self.starts[after[0]] - self.starts[run[1] + 1]
        return bool(run[3].high + after[2].high >= between)

    def strip(
        self, section: Section, first: int, last: int, before: Estimate, after: Estimate
    ) -> Strip:
        """Return the strip between two closed facets.

        Args:
            section: The body of which the mesh is a section.
            first: The first facet.
            last: The last facet.
            before: How far the strip begins before the first facet [length].
            after: How far it ends after the last one.
        """
        start = Estimate(self.starts[first] - before.value, before.margin)
        stop = Estimate(self.starts[last + 1] + after.value, after.margin)
        area = self.area_up_to(section, stop.value) - self.area_up_to(section, start.value)
        most = self.area_up_to(section, stop.high) - self.area_up_to(section, start.low)
        return Strip(
            np.stack([self.point(start.value), self.point(stop.value)]),
            np.array([start.margin, stop.margin]),
            Estimate(float(stop.value - start.value), float(start.margin + stop.margin)),
            Estimate(area, most - area),
        )

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


def _curves(table: np.ndarray, is_closed: np.ndarray, touch: float) -> Iterator[_Curve]:
    """Yield the curves of a contact in 2D.

    Args:
        table: The profile of the contact.
        is_closed: Whether each facet is closed, shape (f,).
        touch: Distance of facets that are neighbours [length].
    """
    q = len(table) // max(len(is_closed), 1)
    x = np.stack([table["x"], table["y"]], axis=1).reshape(-1, q, 2)
    weights = table["weight"].reshape(-1, q)
    areas = weights.sum(axis=1)
    pressures = (weights * table["pressure"].reshape(-1, q)).sum(axis=1) / areas
    facets = _Curve(x, pressures, table["gap"].reshape(-1, q), areas, is_closed)
    is_break = np.linalg.norm(x[1:, 0] - x[:-1, -1], axis=1) > touch
    for part in np.split(np.arange(len(x)), np.flatnonzero(is_break) + 1):
        curve = facets.taken(part)
        is_loop = np.linalg.norm(curve.x[-1, -1] - curve.x[0, 0]) <= touch
        if is_loop and not curve.is_closed.all():
            # What is open follows the last run of closed facets once more.
            order = np.roll(np.arange(len(part)), -int(curve.is_closed.argmin()))
            opened = order[np.logical_and.accumulate(~curve.is_closed[order])]
            curve = curve.taken(np.append(order, opened))
        yield curve
