"""List which parts of bodies lie against which, with areas and distances."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import combinations

import numpy as np
from mpi4py import MPI

from namedmesh.base.checks import is_number
from namedmesh.base.exceptions import InputError, together
from namedmesh.base.html import in_columns, table
from namedmesh.base.logs import log_of
from namedmesh.base.names import listed
from namedmesh.base.ranks import from_first
from namedmesh.bodies import Bodies
from namedmesh.closest import closest
from namedmesh.plain import PlainMesh
from namedmesh.rows import in_space
from namedmesh.simplex import measures, outward_normals
from namedmesh.transfer import gather_mesh

OPPOSED = -0.7
"""Greatest cosine of the angle of outward normals of facets that face each other."""
NEAR = 1e-3
"""Distance of faces that is no clearance, over the size of cells [-]."""
Key = tuple[int, int]
"""Tags of two parts."""


@dataclass(frozen=True)
class Touching:
    """Describe two parts that lie against each other.

    Unpacked it is the names of both parts.

    Attributes:
        facets: Name of the first part.
        against: Name of the part that it faces.
        regions: Names of the regions that they belong to.
        area: Area that faces the other part [length^(d-1)].
        distance: Least distance [length]; of parts that are a pair of the domain the
            greatest distance of facing vertices, 0 where both are in one place.
    """

    facets: str
    against: str
    regions: tuple[str, str]
    area: float
    distance: float = 0.0

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of both parts."""
        return iter((self.facets, self.against))


class Pairs(tuple[Touching, ...]):
    """Hold rows of :meth:`Domain.touching`, and print them as a table."""

    __slots__ = ()
    HEADER = ("part", "against", "area", "distance")

    def __str__(self) -> str:
        """Return the table as text."""
        return in_columns([self.HEADER, *self._rows()], numbers=(2, 3))

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        return table(self._rows(), self.HEADER)

    def _rows(self) -> list[tuple[str, str, str, str]]:
        """Return the entries as text."""
        return [(row.facets, row.against, f"{row.area:.4g}", f"{row.distance:.3g}") for row in self]


def touching(domain: Bodies, regions: Sequence[str], within: float) -> Pairs:
    """List which parts of a domain lie against which, see :meth:`Domain.touching`."""
    chosen = together(domain.comm, _choose_regions, domain, regions, within)
    rows = _pairs(domain)
    if within > 0:
        rows += _near(domain, within)
    return Pairs(row for row in rows if _is_chosen(row.regions, chosen))


def tell_gaps(domain: Bodies, size: float) -> None:
    """Tell which parts of a drawing nearly touch; collective.

    Args:
        domain: The mesh of the drawing.
        size: Size of its cells [length]: distances below a thousandth of it are told.
    """
    rows = _near(domain, NEAR * size)
    if rows:
        row = min(rows, key=lambda row: row.distance)
        log_of(domain.comm).warning(
            "%d pairs of faces are near and do not touch, the nearest %s of %s and %s of %s, "
            "%.3g apart: touching(within=%.2g) lists them, joined(..., apart=) makes pairs of "
            "them, heal=%.2g closes the gaps.",
            len(rows),
            row.facets,
            row.regions[0],
            row.against,
            row.regions[1],
            row.distance,
            NEAR * size,
            2 * row.distance,
        )


def _choose_regions(domain: Bodies, regions: Sequence[str], within: float) -> list[set[str]]:
    """Return the regions that each pattern means.

    Raises:
        InputError: If it is none, there are more than two, or the distance is no
            number >= 0.
    """
    if not is_number(within) or within < 0:
        raise InputError(f"touching: within is {within!r}; give a distance >= 0 [length].")
    if len(regions) > 2:
        raise InputError(f"touching: got {len(regions)} regions; give none, one or two.")
    chosen = []
    for pattern in regions:
        is_text = isinstance(pattern, str)
        matching = {name for name in domain.regions if is_text and fnmatchcase(name, pattern)}
        if not matching:
            raise InputError(
                f"touching: no cell region is called {pattern!r}; this domain has "
                f"{listed(domain.regions)}. Patterns such as 'nut *' name several."
            )
        chosen.append(matching)
    return chosen


def _is_chosen(regions: tuple[str, str], chosen: list[set[str]]) -> bool:
    """Tell whether a pair is between regions that were asked for."""
    here, there = regions
    if len(chosen) == 2:
        first, second = chosen
        return (here in first and there in second) or (there in first and here in second)
    return all(here in names or there in names for names in chosen)


def _pairs(domain: Bodies) -> list[Touching]:
    """Return the pairs of a split domain that are not tied; collective."""
    name_of = {tag: name for name, tag in domain.regions.items()}
    rows = []
    for interface in domain.interfaces:
        if interface.tied:
            continue
        sides = []
        for side in interface.regions:
            tags = np.atleast_1d(side).tolist()
            sides.append(" and ".join(name_of[tag] for tag in tags))
        here, _ = domain.facing(*interface.names)
        area = float(domain.side_areas(here[here[:, 0] < domain.owned_cells]).sum())
        area = domain.comm.allreduce(area, MPI.SUM)
        distance = domain.distance(*interface.names)
        rows.append(Touching(*interface.names, (sides[0], sides[1]), area, distance))
    return rows


def _near(domain: Bodies, within: float) -> list[Touching]:
    """Return parts of two regions that are near each other and no pair; collective."""
    plain = gather_mesh(domain)
    rows: list[Touching] | None = None
    if domain.comm.rank == 0:
        paired = {domain.names[name] for pair in domain.pairs for name in pair}
        tags = {tag: name for name, tag in domain.names.items() if tag not in paired}
        regions = {tag: name for name, tag in domain.regions.items()}
        rows = []
        for here, there in combinations(_surfaces(plain, regions, tags), 2):
            found = here.near(there, within)
            for (first, second), (area, distance) in sorted(found.items()):
                names = (regions[here.region], regions[there.region])
                rows.append(Touching(tags[first], tags[second], names, area, distance))
    return list(from_first(domain.comm, rows))


@dataclass(frozen=True, eq=False)
class _RegionSurface:
    """Hold the named facets on the boundary of a region.

    Attributes:
        region: Tag of the region.
        corners: Corners of the facets [length], shape (n, d, 3).
        normals: Outward unit normals, shape (n, d).
        tags: Tags of the facets, shape (n,).
    """

    region: int
    corners: np.ndarray
    normals: np.ndarray
    tags: np.ndarray

    def near(self, there: _RegionSurface, within: float) -> dict[Key, tuple[float, float]]:
        """Return area and distance of the parts of two surfaces that are near."""
        result: dict[Key, tuple[float, float]] = {}
        back = {key[::-1]: found for key, found in there._near_facets(self, within).items()}
        for found in (self._near_facets(there, within), back):
            for key, (area, distance) in found.items():
                # The larger facets of one side may have no middle over the other one.
                known = result.get(key, (area, distance))
                result[key] = (min(area, known[0]), min(distance, known[1]))
        return result

    def _near_facets(self, there: _RegionSurface, within: float) -> dict[Key, tuple[float, float]]:
        """Return the same, by the facet nearest to the middle of each facet here."""
        middles = self.corners.mean(axis=1)
        low = there.corners.min(axis=(0, 1)) - within
        high = there.corners.max(axis=(0, 1)) + within
        rows = np.flatnonzero(np.all((middles >= low) & (middles <= high), axis=1))
        if not len(rows):
            return {}
        nearest, _, distance = closest(middles[rows], there.corners)
        area = measures(self.corners[rows])
        opposed = np.sum(self.normals[rows] * there.normals[nearest], axis=1) < OPPOSED
        sums: defaultdict[Key, list[float]] = defaultdict(lambda: [0.0, np.inf])
        for row in np.flatnonzero(opposed & (distance <= within)):
            entry = sums[int(self.tags[rows[row]]), int(there.tags[nearest[row]])]
            entry[0] += float(area[row])
            entry[1] = min(entry[1], float(distance[row]))
        return {key: (area, distance) for key, (area, distance) in sums.items()}


def _surfaces(
    plain: PlainMesh, regions: dict[int, str], tags: dict[int, str]
) -> Iterator[_RegionSurface]:
    """Iterate over the named surfaces of regions."""
    sides = np.argwhere(np.isin(plain.tags, list(tags)) & plain.is_outer)
    corners = in_space(plain.x)[plain.points_of(sides)]
    normals = outward_normals(plain.x[plain.cells[sides[:, 0]]], sides[:, 1])
    for region in regions:
        of_region = plain.regions[sides[:, 0]] == region
        if of_region.any():
            kept = sides[of_region]
            tags_of = plain.tags[tuple(kept.T)]
            yield _RegionSurface(region, corners[of_region], normals[of_region], tags_of)
