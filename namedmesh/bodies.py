"""Describe meshes of bodies: names, true shape, and the pairs of facets that face."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, Self, cast, runtime_checkable

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh import parts
from namedmesh.base.exceptions import InputError
from namedmesh.base.html import in_columns, table
from namedmesh.base.names import first_names
from namedmesh.base.releases import cell_nodes
from namedmesh.interface_map import Interface, InterfaceMap
from namedmesh.named import NamedMesh
from namedmesh.periodic import Facing, PeriodicPair, facing_sides
from namedmesh.sides import facets_of_cells
from namedmesh.simplex import facet_vertices
from namedmesh.surface import area_ratio, offset, on_surface, sides_of_facets
from namedmesh.tags import tag_table


@runtime_checkable
class Geometry(Protocol):
    """Represent the true shape of a body: its surface, and how to mesh it again."""

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return the nearest points of the true surface [length]; collective.

        See :data:`namedmesh.surface.Nearest`.
        """

    def are_curved(self, marks: np.ndarray) -> np.ndarray:
        """Tell which marks are marks of curved curves or surfaces, of their shape."""

    def normals(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return unit normals of the true surface, nan where not known; collective.

        Args:
            comm: The ranks.
            points: Points near the surface [length], shape (n, d).
            marks: The mark of the curve or surface of each point, shape (n,).

        Returns:
            Shape (n, d); their signs are open.
        """

    def meshed_by(self, like: Any, sizes: Any, labels: Any) -> Any:
        """Mesh it with sizes in the cells of a mesh; collective.

        Args:
            like: A domain on the same communicator.
            sizes: The sizes, see :mod:`namedmesh.size_field`.
            labels: The names of the new mesh, if the shape knows none of its own.
        """

    def with_joint(self, glued: Any, joint: tuple[str, str, int, bool, float]) -> Any:
        """Return the shape with one joint more.

        Args:
            glued: The mesh before it is joined.
            joint: Names of both sides, tag of the facets where they meet, whether the
                bodies stay glued there, and greatest distance of the sides [length].
        """


@dataclass(frozen=True, eq=False)
class Bodies(NamedMesh):
    """Hold a mesh with names, and what is known of its shape and its pairs.

    See :class:`Domain`, which makes it and checks it.

    Attributes:
        geometry: The true shape, or None.
        curved_facets: Tags of the facets of curved bodies, or None.
        glued: The mesh from which this one was split, or None.
        interface_map: What relates the nodes and cells of both, or None.
        periodic: Pairs of sides at which copies of the bodies follow each other.
    """

    geometry: Geometry | None = field(default=None, repr=False)
    curved_facets: dmesh.MeshTags | None = field(default=None, repr=False)
    glued: Bodies | None = field(default=None, repr=False)
    interface_map: InterfaceMap | None = field(default=None, repr=False)
    periodic: tuple[PeriodicPair, ...] = field(default=(), repr=False, kw_only=True)

    def __repr__(self) -> str:
        """Describe the domain in a line; one rank alone may do so."""
        names = ", ".join(self.names)
        if self.regions:
            names += f", regions {', '.join(self.regions)}"
        if self.pairs:
            names += f", pairs {self.interface_map}"
        return f"<Domain in {self.dim}D: {self.cells} cells, boundary parts {names}>"

    def __str__(self) -> str:
        """Describe the domain in some lines; one rank alone may do so."""
        return in_columns([("domain", f"in {self.dim}D"), *self._in_words()])

    def _repr_html_(self) -> str:
        """Describe the domain in a notebook; one rank alone may do so."""
        return table(self._in_words(), caption=f"Domain in {self.dim}D")

    def _in_words(self) -> list[tuple[str, str]]:
        """Return what the domain is made of, and of many parts the first parts."""
        rows = [("cells", str(self.cells)), ("vertices", str(self.vertices))]
        rows.append(("boundary parts", first_names(self.names)))
        if self.regions:
            rows.append(("regions", first_names(self.regions)))
        if self.pairs:
            rows.append(("pairs", first_names(str(self.interface_map).split(", "))))
        curved = self.curved_facets is not None
        rows.append(("shape", parts.shape_in_words(self.geometry, self.dim, curved=curved)))
        return rows

    @cached_property
    def offset(self) -> fem.Function | None:
        """Return the vector from a facet to the true surface [length]; collective.

        It is None if the surface is flat or not known.
        """
        if self.curved_facets is None or self.geometry is None:
            return None
        return offset(self.mesh, self.curved_facets, self.geometry.nearest)

    def side_areas(self, sides: np.ndarray) -> np.ndarray:
        """Return areas of sides, of curved sides on the true surface; collective.

        Args:
            sides: Sides (cell, local facet), shape (n, 2).

        Returns:
            Areas [length^(d-1)], shape (n,).
        """
        ratio = self.area_ratio(sides)
        flat = self.flat_areas(sides)
        return flat if ratio is None else ratio * flat

    def area_ratio(self, sides: np.ndarray) -> np.ndarray | None:
        """Return the area of the true surface over the area of sides; collective.

        Args:
            sides: Sides (cell, local facet) of all ranks, shape (n, 2).

        Returns:
            Ratios [-], shape (n,); None where no side is curved on any rank.
        """
        is_curved = self.are_curved(sides)
        if not self.comm.allreduce(bool(is_curved.any()), MPI.LOR):
            return None
        ratio = np.ones(len(sides))
        assert self.offset is not None
        ratio[is_curved] = area_ratio(self.offset, sides[is_curved])
        return ratio

    def are_curved(self, sides: np.ndarray) -> np.ndarray:
        """Tell which sides (cell, local facet) lie on curved surfaces that are known.

        Args:
            sides: The sides, shape (n, 2).
        """
        if self.curved_facets is None or self.geometry is None:
            return np.zeros(len(sides), dtype=bool)
        return self.geometry.are_curved(self._marks_of(sides))

    def _marks_of(self, sides: np.ndarray) -> np.ndarray:
        """Return the marks of sides (cell, local facet), shape (n,)."""
        assert self.curved_facets is not None
        numbers = facets_of_cells(self.mesh)[sides[:, 0], sides[:, 1]]
        return np.asarray(tag_table(self.curved_facets)[numbers])

    def true_normals(self, facets: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """Return normals of the true surface at vertices of facets [-]; collective.

        Args:
            facets: Facets (cell, local facet), shape (n, 2).
            vertices: Their vertices in their cells, 0 to d, shape (n, d).

        Returns:
            Unit normals, their signs open, nan where they are not known, (n, d, d).
        """
        d = self.dim
        result = np.full((*vertices.shape, d), np.nan)
        sides, normals = self._true_normals
        if len(sides):
            numbers, wanted = (of @ (d + 1, 1) for of in (sides, facets))
            row = np.minimum(np.searchsorted(numbers, wanted), len(numbers) - 1)
            found = numbers[row] == wanted
            result[found] = normals[row[found, None], vertices[found]]
        return result

    @cached_property
    def _true_normals(self) -> tuple[np.ndarray, np.ndarray]:
        """Find the normals of all curved sides at their vertices; collective.

        gmsh is asked once for all of them: it reads the drawing each time. It is asked
        at the places of the vertices on the true surface, because from a rim that lies
        beside it, it finds no way back.

        Returns:
            The sides (cell, local facet) in increasing order, shape (n, 2), and unit
            normals at the vertices of their cells, nan opposite the side, shape (n,
            d+1, d).
        """
        d = self.dim
        if self.offset is None or self.curved_facets is None or self.geometry is None:
            return np.empty((0, 2), dtype=np.int64), np.empty((0, d + 1, d))
        sides = sides_of_facets(self.mesh, self.curved_facets.indices)
        sides = sides[self.are_curved(sides)]
        cells, local = sides.T
        vertices = facet_vertices(d)[local]
        nodes = cell_nodes(self.mesh.geometry)[cells[:, None], vertices]
        nodes_of_offset = self.offset.function_space.dofmap.list[cells[:, None], vertices]
        moves = self.offset.x.array.reshape(-1, d)[nodes_of_offset]
        places = self.mesh.geometry.x[nodes, :d] + moves
        # Most vertices are vertices of several sides of the same surface.
        pairs = np.column_stack([nodes.ravel(), np.repeat(self._marks_of(sides), d)])
        pairs, first, pair = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
        found = self.geometry.normals(self.comm, places.reshape(-1, d)[first], pairs[:, 1])
        normals = np.full((len(sides), d + 1, d), np.nan)
        normals[np.arange(len(sides))[:, None], vertices] = found[pair.reshape(nodes.shape)]
        return sides, normals

    @property
    def marks_of_sides(self) -> np.ndarray | None:
        """Return the mark of each side of a cell, shape (cells, d+1), or None."""
        if self.curved_facets is None:
            return self.marks
        return tag_table(self.curved_facets)[facets_of_cells(self.mesh)]

    @property
    def drawn_points(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the points on the true surface where it is known; collective.

        They are right at the corners of owned cells: a rank has all cells around these,
        and so all curved sides.
        """
        x, cells = self.points
        marks = self.marks_of_sides
        if marks is None or self.geometry is None:
            return x, cells
        return on_surface(self.comm, x, cells, marks, self.geometry.nearest), cells

    @property
    def knows_shape(self) -> bool:
        """Tell whether the true shape is known, with the facets on curved sides."""
        curved = bool(getattr(self.geometry, "curved", False))
        return self.geometry is not None and (not curved or self.curved_facets is not None)

    @property
    def whole(self) -> Self:
        """Return the glued mesh of a split domain, and an unsplit domain itself."""
        return self if self.glued is None else cast("Self", self.glued)

    @property
    def interfaces(self) -> tuple[Interface, ...]:
        """Return the interfaces along which the mesh is split, none if it is not."""
        return () if self.interface_map is None else self.interface_map.interfaces

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Return the names of the boundary parts that face each other, see split."""
        return tuple(interface.names for interface in self.interfaces)

    def distance(self, here: str, there: str | None) -> float:
        """Return the greatest distance of facing vertices of two parts [length].

        It is zero where both sides of a pair are in one place, and of other parts.
        """
        distances = () if self.interface_map is None else self.interface_map.distances
        for interface, distance in zip(self.interfaces, distances, strict=True):
            if set(interface.names) == {here, there}:
                return distance
        return 0.0

    @property
    def paired_sides(self) -> list[np.ndarray]:
        """Return the sides (cell, local facet) of all pairs, shape (n, 2) each.

        Pairs of tied joints are among them, which are no parts of the boundary.
        """
        return [sides for pair in self.pairs for sides in self.facing(*pair)]

    @property
    def tied_sides(self) -> list[np.ndarray]:
        """Return the sides (cell, local facet) of tied joints, shape (n, 2) each."""
        result: list[np.ndarray] = []
        for interface in self.interfaces:
            if interface.tied:
                result += self.facing(*interface.names)
        return result

    @cached_property
    def _facing_periodic(self) -> Mapping[tuple[str, str], Facing]:
        """Find the sides of periodic pairs that face each other; collective."""
        facing = {}
        for pair in self.periodic:
            here, there = facing_sides(self, pair)
            facing[pair.names] = (here, there)
            facing[pair.names[::-1]] = (there, here)
        return facing

    def facing(self, here: str, there: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the facets of two parts that face each other on this rank.

        Ghosts are included if their partner is on this rank, too. The partner of a
        facet in an owned cell always is.

        Args:
            here: Name of a part.
            there: Name of the part that it faces.

        Returns:
            Pairs (cell, local facet) of ``here`` and of ``there``, shape (n, 2) each.
            Row i of the first faces row i of the second.

        Raises:
            InputError: If the parts are no pair.
        """
        if self.interface_map is not None and (here, there) in self.interface_map.facing:
            return self.interface_map.facing[here, there]
        if (here, there) in self._facing_periodic:
            return self._facing_periodic[here, there]
        for name in (here, there):
            self.tag(name)
        known = ", ".join(" and ".join(map(repr, pair)) for pair in self.pairs)
        raise InputError(
            f"facing: {here!r} and {there!r} do not face each other facet by facet; this domain "
            f"has {'the pairs ' + known if known else 'no pairs'}. If they lie against each other, "
            f"whether their facets match or not, domain = domain.joined({here!r}, {there!r}) makes "
            "a pair of them; split makes one of two regions with common nodes."
        )
