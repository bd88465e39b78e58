"""Name parts and regions of a mesh by rules, also on each mesh that gmsh makes anew.

A facet has one name. So a part that is named by a rule takes its facets from the parts
that had them, and these keep what remains. Sides of pairs are not taken.

The true shape of a body does not know the names. Each mesh of it gets them from the
rules (:class:`NamedShape`). A part is the same part of the surface only if the shape
has an edge where it ends: so its area is compared, and the volume of a region.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base import checks
from namedmesh.base.exceptions import InputError, raise_together, together
from namedmesh.base.names import known_names
from namedmesh.base.percent import place_words
from namedmesh.interface_map import Interface
from namedmesh.lying import Facets, lying_against
from namedmesh.named import NamedMesh
from namedmesh.sides import boundary_sides, inner_facets, local_facets
from namedmesh.simplex import measures, of_facets, outward_normals
from namedmesh.size_field import Labels, SizeField
from namedmesh.tags import NO_TAG, tag_table, tags_of
from namedmesh.where import EXAMPLE, as_rules, where

BOUNDARY = -2
"""Stands for the region across a facet of the boundary, where there is none."""
SAME = 1e-6
"""Relative difference of areas or volumes on two meshes that is round-off [-]."""
SAME_CURVED = 0.1
"""The same on curved bodies, where other chords have other lengths [-]."""


@dataclass(frozen=True)
class Rules:
    """Hold rules by the names that they give.

    Attributes:
        parts: Name of each part -> what says where it is; one entry must hold.
        regions: Name of each region -> the same.
    """

    parts: Mapping[str, list[where]]
    regions: Mapping[str, list[where]]

    @classmethod
    def of(cls, parts: Any, regions: Any) -> Rules:
        """Make them of what a user gave.

        Raises:
            InputError: If these are no mappings from names to rules, or there is none.
        """
        rules = cls(_by_name("parts", parts), _by_name("regions", regions))
        if not rules.parts and not rules.regions:
            raise InputError(f"named: no rule is given; e.g. {EXAMPLE}.")
        for name, entries in rules.regions.items():
            if not all(entry.is_of_points for entry in entries):
                raise InputError(
                    f"named: the region {name!r} has a rule about facets; a region is told by a "
                    "function of points, or by x=, y=, z=."
                )
        return rules

    def check_before(self, interfaces: Sequence[Interface]) -> None:
        """Check that no region is named after a domain was split.

        Raises:
            InputError: If one is.
        """
        if interfaces and self.regions:
            pairs = ", ".join("/".join(interface.names) for interface in interfaces)
            raise InputError(
                f"named: the domain is split already ({pairs}), between the regions that it has; "
                "name regions first, and split the result."
            )


def _by_name(argument: str, rules: Any) -> dict[str, list[where]]:
    """Return lists of rules by name.

    Raises:
        InputError: If it is no mapping from names to rules.
    """
    if rules is None:
        return {}
    is_mapping = isinstance(rules, Mapping)
    if not is_mapping or not all(isinstance(name, str) and name.strip() for name in rules):
        raise InputError(
            f"named: {argument} are {checks.description(rules)}; give a mapping from names to "
            f"rules, e.g. {EXAMPLE}."
        )
    return {name: as_rules(name, rule) for name, rule in rules.items()}


def name_regions(
    mesh: NamedMesh, rules: Mapping[str, list[where]]
) -> tuple[dmesh.MeshTags | None, dict[str, int]]:
    """Return the tags of cells and the regions of a mesh after rules; collective.

    Args:
        mesh: The mesh.
        rules: Rules by the names of regions.

    Raises:
        InputError: If a rule holds in no cell, or two hold in the same one.
    """
    if not rules:
        return mesh.cell_tags, dict(mesh.regions)
    comm = mesh.comm
    x, nodes = mesh.drawn_points
    middles = x[nodes].mean(axis=1)
    owned = np.arange(len(nodes)) < mesh.owned_cells
    table = mesh.region_tags
    holds = {}
    for name, entries in rules.items():
        holds[name] = np.zeros(len(nodes), dtype=bool)
        for entry in entries:
            at_corners = _at_points(mesh, entry, x)[nodes].all(axis=1)
            # All corners of a cell beside a curved side may lie on it, on either side.
            holds[name] |= at_corners & _at_points(mesh, entry, middles)
    _check_claims(mesh, holds, owned, "cell")
    used = [int(table.max(initial=0)), *mesh.regions.values()]
    last_tag = comm.allreduce(max(used), MPI.MAX)
    table, regions = _paint(comm, table, mesh.regions, holds, last_tag)
    return tags_of(mesh.mesh, mesh.dim, np.arange(len(table)), table), regions


def name_parts(
    mesh: NamedMesh, rules: Mapping[str, list[where]], taken: np.ndarray, last_tag: int
) -> tuple[dmesh.MeshTags, dict[str, int]]:
    """Return the tags of facets and the names of a mesh after rules; collective.

    Args:
        mesh: The mesh, whose regions have their names.
        rules: Rules by the names of parts.
        taken: Whether a facet of this rank is the side of a pair, shape (facets,).
        last_tag: The greatest tag that is used.

    Raises:
        InputError: If a rule holds on no facet, or two hold on the same one.
    """
    sides = _sides(mesh, taken)
    table = tag_table(mesh.facet_tags)
    owned = mesh.mesh.topology.index_map(mesh.dim - 1).size_local
    # The ranks that own facets name them, and share the names later.
    table[owned:] = NO_TAG
    holds = {}
    for name, entries in rules.items():
        holds[name] = np.zeros(len(table), dtype=bool)
        for entry in entries:
            holds[name][sides.facet[_on_sides(mesh, sides, entry)]] = True
    _check_claims(mesh, holds, np.arange(len(table)) < owned, "facet")
    table, names = _paint(mesh.comm, table, mesh.names, holds, last_tag)
    return tags_of(mesh.mesh, mesh.dim - 1, np.arange(len(table)), table), names


@dataclass(frozen=True, eq=False)
class _Sides:
    """Hold the sides on this rank that may get a name.

    Attributes:
        facet: Number of the facet, shape (n,).
        x: Points of the bodies [length], shape (p, 3).
        nodes: Its points, shape (n, d).
        normal: Its normal out of the cell, shape (n, d).
        region: Tag of the region of the cell, shape (n,).
        across: Tag of the region of the cell beyond; :data:`BOUNDARY` for none.
    """

    facet: np.ndarray
    x: np.ndarray
    nodes: np.ndarray
    normal: np.ndarray
    region: np.ndarray
    across: np.ndarray


def _sides(mesh: NamedMesh, taken: np.ndarray) -> _Sides:
    """Return the sides of owned facets: on the boundary, and between two regions."""
    topology = mesh.mesh.topology
    d = mesh.dim
    owned = topology.index_map(d - 1).size_local
    x, of_cells = mesh.drawn_points
    region_of = mesh.region_tags
    outer = dmesh.exterior_facet_indices(topology)
    outer = outer[~taken[outer]]
    cell, _ = boundary_sides(mesh.mesh, outer)
    inner, beside = inner_facets(mesh.mesh)
    between = (region_of[beside[:, 0]] != region_of[beside[:, 1]]) & (inner < owned)
    between &= ~taken[inner]
    inner = inner[between]
    beside = beside[between]
    # Each of the others has two sides: the cells beside it, in both orders.
    facet = np.concatenate([outer, inner, inner])
    cell = np.concatenate([cell, *beside.T])
    across = np.concatenate([np.full(len(outer), BOUNDARY), *region_of[beside[:, ::-1]].T])
    local = local_facets(mesh.mesh, facet, cell)
    corners = of_cells[cell]
    normals = outward_normals(x[corners, :d], local)
    return _Sides(facet, x, of_facets(corners, local), normals, region_of[cell], across)


def _at_points(mesh: NamedMesh, rule: where, points: np.ndarray) -> np.ndarray:
    """Return at which of some points (n, 3) a rule about places holds; collective."""
    return together(mesh.comm, rule.at_points, points.T, mesh.sides)


def _on_sides(mesh: NamedMesh, sides: _Sides, rule: where) -> np.ndarray:
    """Return on which sides a rule holds, shape (n,); collective.

    Raises:
        InputError: If the rule cannot be worked with.
    """
    comm = mesh.comm
    holds = _at_points(mesh, rule, sides.x)[sides.nodes].all(axis=1)
    holds &= together(comm, rule.along_normal, sides.normal)
    if rule.region is not None:
        holds &= sides.region == together(comm, _region_tag, mesh, rule.region)
    on_boundary = sides.across == BOUNDARY
    if rule.against is None:
        return holds & on_boundary
    tag_against = together(comm, _region_tag, mesh, rule.against)
    shared = holds & (sides.across == tag_against)
    corners = sides.x[sides.nodes][..., : mesh.dim]
    every = Facets(corners, sides.normal)
    here = np.flatnonzero(holds & on_boundary & (sides.region != tag_against))
    there = on_boundary & (sides.region == tag_against)
    lies = lying_against(comm, every.take(here), every.take(there), rule.within)
    shared[here[lies]] = True
    return shared


def _region_tag(mesh: NamedMesh, name: str) -> int:
    """Return the tag of a region.

    Raises:
        InputError: If there is none of this name.
    """
    if name not in mesh.regions:
        raise InputError(
            f"named: no cell region is called {name!r}; this domain has "
            f"{known_names(name, mesh.regions)}"
        )
    return mesh.regions[name]


def _check_claims(
    mesh: NamedMesh, holds: Mapping[str, np.ndarray], owned: np.ndarray, kind: str
) -> None:
    """Check that each rule holds somewhere, and no two at one place; collective.

    Args:
        mesh: The mesh.
        holds: By name, which entities of this rank are meant.
        owned: Which of them this rank owns.
        kind: "facet" or "cell".

    Raises:
        InputError: If it is not so.
    """
    names = list(holds)
    claims = np.array([holds[name] & owned for name in names])
    shared = (claims[:, None] & claims[None]).sum(axis=2)
    counts = mesh.comm.allreduce(shared, MPI.SUM)
    low, high = mesh.corners
    error = None
    for i, name in enumerate(names):
        if not counts[i, i]:
            error = InputError(
                f"named: the rule of {name!r} holds on no {kind}; it must hold at all vertices of "
                f"a {kind}. The mesh goes from {place_words(low)} to {place_words(high)}"
                + (", and sides of pairs are not taken." if kind == "facet" else ".")
            )
        for j in range(i):
            if counts[i, j] and counts[i, i]:
                error = InputError(
                    f"named: {names[j]!r} and {name!r} have {counts[i, j]} {kind}s in common; each "
                    "can have one name only, so make the rules exclude each other."
                )
    raise_together(mesh.comm, error)


def _paint(
    comm: MPI.Comm,
    table: np.ndarray,
    names: Mapping[str, int],
    holds: Mapping[str, np.ndarray],
    last_tag: int,
) -> tuple[np.ndarray, dict[str, int]]:
    """Return tags and names after new names have taken their facets; collective.

    Args:
        comm: Communicator.
        table: The tag of each facet or cell of this rank.
        names: The names and their tags.
        holds: By new name, which are meant.
        last_tag: The greatest tag that is used.
    """
    table = table.copy()
    result = dict(names)
    for name in holds:
        if name in result:
            table[table == result.pop(name)] = NO_TAG
    for number, (name, which) in enumerate(holds.items(), start=last_tag + 1):
        result[name] = number
        table[which] = number
    # What has lost all its facets or cells is no longer there.
    here = np.isin(list(result.values()), table).astype(int)
    remains = comm.allreduce(here, MPI.SUM)
    left = {name: tag for (name, tag), n in zip(result.items(), remains, strict=True) if n}
    return table, left


@dataclass(frozen=True)
class NamedShape:
    """Represent a true shape, and the rules that name parts of each of its meshes.

    Args:
        shape: The shape.
        labels: The names that its meshes have without the rules.
        rules: The rules.
        last_tag: The tag above which the parts have theirs, on all meshes.
        measures: Area of each part that has a rule [length^(d-1)], and volume of each
            such region [length^d], by "part" or "region" and its name.
    """

    shape: Any
    labels: Labels = field(repr=False)
    rules: Rules
    last_tag: int
    measures: Mapping[tuple[str, str], float] = field(repr=False)

    @property
    def curved(self) -> Any:
        """Tell whether the shape is curved, as it does itself."""
        return getattr(self.shape, "curved", False)

    @property
    def low(self) -> Any:
        """Return the corner of least coordinates of a rectangle or box, else None."""
        return getattr(self.shape, "low", None)

    @property
    def high(self) -> Any:
        """Return the opposite corner, or None."""
        return getattr(self.shape, "high", None)

    def meshed_by(self, like: Any, sizes: SizeField, labels: Labels) -> Any:
        """Mesh the shape with sizes in the cells of a mesh, and name it; collective.

        Args:
            like: A domain on the same communicator.
            sizes: The sizes.
            labels: Its periodic pairs are used: the shape has its own names, and the
                rules give others.

        Raises:
            InputError: If a part or a region has another size now.
        """
        own_labels = replace(self.labels, periodic=labels.periodic)
        plain = self.shape.meshed_by(like, sizes, own_labels)
        result = plain.renamed(self.rules, self.last_tag)
        allowed = SAME_CURVED if self.curved else SAME
        for (kind, name), value in part_measures(result, self.rules).items():
            before = self.measures[kind, name]
            if abs(value - before) > allowed * before:
                raise InputError(
                    f"remeshed: the {kind} {name!r}, which is named by a rule, had the size "
                    f"{before:.6g} and has {value:.6g} on the new mesh, as the shape has no edge "
                    "where it ends. Refine by marking (strategy=ec.Mark()), which keeps it, or "
                    "draw this edge in gmsh (occ.fragment)."
                )
        return result

    def with_joint(self, glued: Any, joint: tuple[str, str, int, bool, float]) -> Any:
        """Return the shape of its bodies with a joint between two of them."""
        return self.shape.with_joint(glued, joint)

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return the nearest points of the true surface [length]; collective."""
        return np.asarray(self.shape.nearest(comm, points, marks))

    def are_curved(self, marks: np.ndarray) -> np.ndarray:
        """Tell which marks are marks of curved curves or surfaces, of their shape."""
        return np.asarray(self.shape.are_curved(marks))

    def normals(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return unit normals of the true surface, nan where not known; collective."""
        return np.asarray(self.shape.normals(comm, points, marks))


def part_measures(domain: Any, rules: Rules) -> dict[tuple[str, str], float]:
    """Return areas of parts and volumes of regions of a domain; collective.

    See :class:`NamedShape`. Areas are areas of facets, which tell as well as the true
    shape whether a part is the same. The facets against which another region lies may
    reach beyond it, so their area depends on the mesh, and is left out.
    """
    result = {}
    owned = domain.mesh.topology.index_map(domain.dim - 1).size_local
    for name, entries in rules.parts.items():
        if all(entry.against is None for entry in entries):
            facets = domain.facet_tags.find(domain.names[name])
            sides = np.column_stack(boundary_sides(domain.mesh, facets[facets < owned]))
            area = float(domain.flat_areas(sides).sum())
            result["part", name] = domain.comm.allreduce(area, MPI.SUM)
    for name in rules.regions:
        cells = domain.region(name)
        cells = cells[cells < domain.owned_cells]
        x, corners = domain.points
        volume = float(measures(x[corners[cells], : domain.dim]).sum())
        result["region", name] = domain.comm.allreduce(volume, MPI.SUM)
    return result
