"""List the parts of a mesh in a table: how large they are, where, and what is behind.

Symbols: d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.exceptions import InputError
from namedmesh.base.html import in_columns, table
from namedmesh.base.percent import place_words
from namedmesh.named import NamedMesh
from namedmesh.sides import boundary_sides
from namedmesh.simplex import of_facets, outward_normals
from namedmesh.tags import tag_table

NAMELESS = "(no name)"
"""Stands for the facets of the boundary that have no name."""
ROUND_OFF = 1e-9
"""Component of a mean normal that is shown as 0 [-]."""


@dataclass(frozen=True, eq=False, repr=False)
class Parts:
    """Hold a table of the parts of a domain; it prints, and has columns.

    The last row, "(no name)", has all facets of the boundary without a name, if
    there are any.

    Attributes:
        name: Names of the parts.
        facets: Number of facets of each, shape (n,).
        area: Area [length^(d-1)], shape (n,).
        centre: Centre of the area [length], shape (n, d).
        normal: Mean outward normal, weighted by area, shape (n, d). Its length is 1
            if the part is flat, and less if it is curved; NaN for a part inside.
        regions: Names of the regions behind each.

    Example:
        >>> parts = block.parts()
        >>> parts["area"]
        array([1., 1., 2., 2.])
        >>> print(parts)
        part    facets  area  centre    mean normal
        left         2     1  (0, 0.5)  (-1, 0)
        right        2     1  (2, 0.5)  (1, 0)
        bottom       4     2  (1, 0)    (0, -1)
        top          4     2  (1, 1)    (0, 1)
    """

    name: list[str]
    facets: np.ndarray
    area: np.ndarray
    centre: np.ndarray
    normal: np.ndarray
    regions: list[tuple[str, ...]]

    def __getitem__(self, column: str) -> Any:
        """Return a column by its name.

        Raises:
            InputError: If there is none of this name.
        """
        columns = [entry.name for entry in fields(self)]
        if column not in columns:
            raise InputError(
                f"parts: there is no column {column!r}; there are {', '.join(columns)}."
            )
        return getattr(self, column)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.name)

    def __repr__(self) -> str:
        """Write the table in columns."""
        return in_columns([self._header(), *self._rows()], numbers=(1, 2))

    def _repr_html_(self) -> str:
        """Return the table in HTML, for notebooks."""
        return table(self._rows(), self._header())

    def _header(self) -> list[str]:
        """Return the names of the columns that are shown."""
        header = ["part", "facets", "area", "centre", "mean normal"]
        return [*header, "regions behind"] if any(self.regions) else header

    def _rows(self) -> list[list[str]]:
        """Return the rows that are shown, as text."""
        d = self.centre.shape[1]
        size = float(np.append(abs(self.centre), self.area ** (1 / (d - 1))).max(initial=0.0))
        rows = []
        for i, name in enumerate(self.name):
            normal = "inside"
            if not np.isnan(self.normal[i]).any():
                normal = _vector(self.normal[i], ROUND_OFF)
            centre = _vector(self.centre[i], ROUND_OFF * size)
            row = [name, str(self.facets[i]), f"{self.area[i]:.4g}", centre, normal]
            rows.append([*row, ", ".join(self.regions[i])] if any(self.regions) else row)
        return rows


def facets_of_parts(mesh: NamedMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the owned facets that are on the boundary or have a name.

    Returns:
        Their numbers, and the number of the part of each in the order of the names; a
        facet without a name has the number of names. Shape (n,) each.
    """
    topology = mesh.mesh.topology
    owned = topology.index_map(mesh.dim - 1).size_local
    tags = tag_table(mesh.facet_tags)[:owned]
    part = np.full(owned, -1)
    part[dmesh.exterior_facet_indices(topology)] = len(mesh.names)
    for number, tag in enumerate(mesh.names.values()):
        part[tags == tag] = number
    facets = np.flatnonzero(part >= 0)
    return facets, part[facets]


def parts_of(mesh: NamedMesh) -> Parts:
    """List the parts of a mesh; collective."""
    d = mesh.dim
    facets, part = facets_of_parts(mesh)
    cell, local = boundary_sides(mesh.mesh, facets)
    x, points_of = mesh.points
    of_cells = x[points_of[cell], :d]
    corners = of_facets(of_cells, local)
    area = mesh.side_areas(np.column_stack([cell, local]))
    outer = np.isin(facets, dmesh.exterior_facet_indices(mesh.mesh.topology))
    # The sums of these columns over the facets of each part make the table.
    columns = [np.ones(len(facets)), outer, area]
    columns += list((area[:, None] * corners.mean(axis=1)).T)
    columns += list((area[:, None] * outward_normals(of_cells, local)).T)
    columns += list(_behind(mesh, facets).T)
    sums = np.zeros((len(mesh.names) + 1, len(columns)))
    np.add.at(sums, part, np.column_stack(columns))
    total = np.empty_like(sums)
    mesh.comm.Allreduce(sums, total, MPI.SUM)
    rows = np.flatnonzero(total[:, 0])
    total = total[rows]
    size = total[:, 2:3]
    normal = total[:, 3 + d : 3 + 2 * d] / size
    normal[total[:, 1] < total[:, 0]] = np.nan
    region_names = np.array(list(mesh.regions), dtype=object)
    regions = [tuple(region_names[counts > 0]) for counts in total[:, 3 + 2 * d :]]
    names = [*mesh.names, NAMELESS]
    return Parts(
        [names[row] for row in rows],
        total[:, 0].astype(int),
        total[:, 2],
        total[:, 3 : 3 + d] / size,
        normal,
        regions,
    )


def _behind(mesh: NamedMesh, facets: np.ndarray) -> np.ndarray:
    """Count the cells of each region beside each facet, shape (facets, regions)."""
    counts = np.zeros((len(facets), len(mesh.regions)))
    if mesh.cell_tags is None:
        return counts
    region = tag_table(mesh.cell_tags)
    d = mesh.dim
    facet_to_cell = mesh.mesh.topology.connectivity(d - 1, d)
    first = facet_to_cell.offsets[facets]
    last = facet_to_cell.offsets[facets + 1] - 1
    for number, tag in enumerate(mesh.regions.values()):
        # A facet of the boundary has one cell, the first and the last.
        for place in (first, last):
            counts[:, number] += region[facet_to_cell.array[place]] == tag
    return counts


def _vector(components: np.ndarray, round_off: float) -> str:
    """Write components with few digits; what is round-off is 0."""
    shown = np.where(abs(components) <= round_off, 0.0, components)
    return place_words(shown)
