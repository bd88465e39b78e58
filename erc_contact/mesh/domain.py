"""Represent bodies by a mesh whose boundary parts and cell regions have names.

A :class:`Domain` is a value. Refinement returns a new one, which has the same names and
is balanced over the ranks. On every rank it has all cells around the vertices of the
cells that the rank owns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError, together
from erc_contact.base.html import table
from erc_contact.mesh import partition, parts
from erc_contact.mesh.refinement import refine
from erc_contact.mesh.splitting import Interface, Seams, split
from erc_contact.mesh.surface import offset, snap
from erc_contact.mesh.tags import shared


class Geometry(Protocol):
    """Represent the true shape of a body: its surface, and how to mesh it again."""

    def meshed(self, domain: Domain, sizes: np.ndarray) -> Domain:
        """Mesh the shape with other sizes, see :meth:`Domain.remeshed`; collective."""

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Return the nearest points of the true surface [length]; collective.

        See :data:`erc_contact.mesh.surface.Nearest`.
        """


@dataclass(frozen=True, eq=False)
class Domain:
    """Hold a mesh whose parts have names.

    Args:
        mesh: Straight-sided triangles in 2D or tetrahedra in 3D. Under MPI a mesh
            without complete vertex patches is distributed anew: use ``domain.mesh``
            afterwards, not the mesh that you gave.
        facet_tags: Tags of boundary facets.
        names: Name of each boundary part -> its tag.
        cell_tags: Tags of cells, or None.
        regions: Name of each cell region -> its tag.
        geometry: The true shape of the body. It is None if only the mesh is known. The
            body is then the mesh with its flat facets.
        curved_facets: Tags of the facets on the boundary and on interfaces of a curved
            body: the number of the curve or surface of the geometry on which a facet
            lies. None if the body is not curved, or not known.

    Raises:
        InputError: If the mesh is not of straight-sided simplices, names and tags do
            not fit, or no facet has the tag of a name. A part may have facets inside
            the body, as an interface has, but a scene cannot use it.

    Example:
        >>> block
        <Domain in 2D: 16 cells, boundary parts left, right, bottom, top>
        >>> block.refined(np.array([0], dtype=np.int32)).cells
        20
    """

    mesh: dmesh.Mesh
    facet_tags: dmesh.MeshTags
    names: Mapping[str, int]
    cell_tags: dmesh.MeshTags | None = None
    regions: Mapping[str, int] = field(default_factory=dict)
    geometry: Geometry | None = field(default=None, repr=False)
    curved_facets: dmesh.MeshTags | None = field(default=None, repr=False)
    glued: Domain | None = field(default=None, repr=False)
    seams: Seams | None = field(default=None, repr=False)
    _inside: set[str] = field(init=False, repr=False, default_factory=set)
    _zeros: dict[tuple[str, int, tuple[int, ...]], fem.Function] = field(
        init=False, repr=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, dmesh.Mesh):
            raise InputError(
                f"Domain: mesh is {checks.description(self.mesh)}; give a mesh of DOLFINx, or use "
                "read_mesh, rectangle, box."
            )
        parts.check_names(self.names, self.regions)
        partition.check_mesh(self.mesh)
        tdim = self.mesh.topology.dim
        self.mesh.topology.create_connectivity(tdim - 1, tdim)
        self.mesh.topology.create_connectivity(tdim, tdim - 1)
        parts.check_tags(self.mesh, self.facet_tags, self.names, self.cell_tags, self.regions)
        if self.mesh.comm.size > 1:
            self._complete()
        self._inside.update(parts.parts_inside(self.mesh, self.facet_tags, self.names))

    def _complete(self) -> None:
        """Give every rank complete vertex patches with all their tags; collective."""
        mesh = self.mesh
        tag_names = ("facet_tags", "cell_tags", "curved_facets")
        tag_sets = [shared(mesh, getattr(self, name)) for name in tag_names]
        if self.seams is None and not partition.patches_complete(mesh):
            mesh, tag_sets = partition.redistributed(mesh, *tag_sets)
        # A frozen dataclass sets its own members by this detour.
        object.__setattr__(self, "mesh", mesh)
        for name, tags in zip(tag_names, tag_sets, strict=True):
            object.__setattr__(self, name, tags)

    def __repr__(self) -> str:
        """Describe the domain in a line; one rank alone may do so."""
        names = ", ".join(self.names)
        if self.regions:
            names += f", regions {', '.join(self.regions)}"
        return f"<Domain in {self.dim}D: {self.cells} cells, boundary parts {names}>"

    def _repr_html_(self) -> str:
        """Describe the domain in a notebook; one rank alone may do so."""
        rows: list[tuple[str, object]] = [("cells", self.cells), ("vertices", self.vertices)]
        rows.append(("boundary parts", ", ".join(self.names)))
        if self.regions:
            rows.append(("regions", ", ".join(self.regions)))
        curved = self.curved_facets is not None
        rows.append(("shape", parts.shape_in_words(self.geometry, self.dim, curved=curved)))
        return table(rows, caption=f"Domain in {self.dim}D")

    @property
    def dim(self) -> int:
        """Return the dimension of space, 2 or 3."""
        return self.mesh.topology.dim

    @property
    def cells(self) -> int:
        """Return the number of cells over all ranks."""
        return self.mesh.topology.index_map(self.dim).size_global

    @property
    def owned_cells(self) -> int:
        """Return the number of cells of this rank."""
        return self.mesh.topology.index_map(self.dim).size_local

    @property
    def vertices(self) -> int:
        """Return the number of vertices over all ranks."""
        return self.mesh.topology.index_map(0).size_global

    @cached_property
    def sides(self) -> np.ndarray:
        """Return the sides of the bounding box [length], shape (d,); collective."""
        return parts.box_sides(self.mesh)[: self.dim]

    @property
    def extent(self) -> float:
        """Return the diagonal of the bounding box [length]; collective."""
        return float(np.linalg.norm(self.sides))

    @property
    def outer(self) -> list[str]:
        """Return the names of the parts without facets inside the body.

        A scene can use these parts.
        """
        return [name for name in self.names if name not in self._inside]

    def function(self, family: str, degree: int, shape: tuple[int, ...] = ()) -> fem.Function:
        """Return a new Function on the mesh, zero everywhere; collective.

        All Functions of a kind have the same space, and the same communicators of MPI.
        A process has some 2000 of these, and a loading history keeps several Functions
        for each step.

        Args:
            family: Family of the elements, "Lagrange" or "DG".
            degree: Degree of the elements.
            shape: Shape of the values.
        """
        kind = (family, degree, shape)
        if kind not in self._zeros:
            self._zeros[kind] = fem.Function(fem.functionspace(self.mesh, kind))
        return self._zeros[kind].copy()

    @cached_property
    def offset(self) -> fem.Function | None:
        """Return the vector from a facet to the true surface [length]; collective.

        It is None if the surface is flat or not known.
        """
        if self.curved_facets is None or self.geometry is None:
            return None
        return offset(self.mesh, self.curved_facets, self.geometry.nearest)

    def tag(self, name: str) -> int:
        """Return the tag of a boundary part, for measures of DOLFINx.

        Raises:
            InputError: If no part has this name, or it has facets inside the body.
        """
        if name not in self.names:
            raise InputError(
                f"No boundary part is called {name!r}; this domain has {parts.listed(self.names)}."
            )
        if name in self._inside:
            raise InputError(
                f"{name!r} has facets inside the body; only a part of the boundary can carry "
                "a condition."
            )
        return self.names[name]

    def facets(self, name: str) -> np.ndarray:
        """Return the facets of a boundary part as pairs (cell, local facet).

        Ghosts are included; shape (n, 2).

        Raises:
            InputError: If no part has this name, or it has facets inside the body.
        """
        facets = self.facet_tags.find(self.tag(name))
        cell, local_facet = partition.boundary_sides(self.mesh, facets)
        return np.column_stack([cell, local_facet]).astype(np.int32)

    def owned_facets(self, name: str) -> np.ndarray:
        """Return the facets of a boundary part in owned cells, shape (n, 2).

        They are pairs (cell, local facet). All ranks together have each facet once.

        Raises:
            InputError: If no part has this name, or it has facets inside the body.
        """
        facets = self.facets(name)
        return facets[facets[:, 0] < self.owned_cells]

    def region(self, name: str) -> np.ndarray:
        """Return the cells of a region, ghosts included.

        Raises:
            InputError: If no region has this name.
        """
        if self.cell_tags is None or name not in self.regions:
            raise InputError(
                f"No cell region is called {name!r}; this domain has {parts.listed(self.regions)}."
            )
        return self.cell_tags.find(self.regions[name])

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Return the names of the boundary parts that face each other."""
        return () if self.seams is None else tuple(i.names for i in self.seams.interfaces)

    def facing(self, here: str, there: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the facets of two parts that face each other on this rank.

        Returns:
            Pairs (cell, local facet) of each part, ghosts included, shape (n, 2). Row i
            of the first faces row i of the second.
        """
        return self.seams.facing[here, there]

    def split(self, sides: Mapping[str, str], *, on: str | None = None) -> Domain:
        """Split the nodes along the facets between two regions; collective."""
        glued = self if self.glued is None else self.glued
        before = () if self.seams is None else self.seams.interfaces
        tags = [*self.names.values(), *glued.names.values(), *glued.facet_tags.values]
        tag = self.mesh.comm.allreduce(int(max(tags)), MPI.MAX) + 1
        interface = Interface(tuple(sides), tuple(sides.values()), on, (tag, tag + 1))
        return glued._split((*before, interface))

    def _split(self, interfaces: tuple[Interface, ...]) -> Domain:
        """Split the nodes along interfaces; collective."""
        new = split(self, interfaces)
        return Domain(
            new.mesh,
            new.facet_tags,
            new.names,
            new.cell_tags,
            self.regions,
            self.geometry,
            new.curved_facets,
            self,
            new.seams,
        )

    def refined(self, marked: np.ndarray | None = None) -> Domain:
        """Refine by bisection of longest edges (DOLFINx), conforming; collective.

        The names stay, the new mesh is balanced over the ranks, and every rank has
        complete vertex patches. If the true shape is known and curved, new vertices on
        its boundary and on interfaces are moved onto it.

        Args:
            marked: Numbers of cells of this rank, shape (n,); None refines all cells.

        Returns:
            The refined domain.

        Raises:
            InputError: If ``marked`` are not numbers of cells of this rank.
        """
        cells = together(self.mesh.comm, checks.cells_to_refine, marked, self.owned_cells)
        if self.glued is not None and self.seams is not None:
            fine_glued = self.glued.refined(self.seams.cells[cells])
            return fine_glued._split(self.seams.interfaces)
        refinement = refine(self.mesh, cells, partition.partitioner(self.mesh.comm))
        fine = refinement.mesh
        facet_tags = refinement.inherited(self.facet_tags)
        cell_tags = refinement.inherited(self.cell_tags)
        curved = refinement.inherited(self.curved_facets)
        if curved is not None and self.geometry is not None:
            snap(fine, curved, self.geometry.nearest)
        return Domain(fine, facet_tags, self.names, cell_tags, self.regions, self.geometry, curved)

    def remeshed(self, sizes: npt.ArrayLike) -> Domain:
        """Mesh the true geometry again with other sizes, by gmsh on rank 0; collective.

        The names stay, and curved boundaries get new vertices. Where the sizes are
        larger, the new mesh is coarser.

        Args:
            sizes: Edge h of the simplices that are wanted [length]: one number, or a
                value at each node ``mesh.geometry.x`` of this rank, shape (n,), with h
                linear between the nodes. The number of cells is ``int c / h^d`` with c
                = 4/sqrt(3) in 2D and 5 in 3D. gmsh meets it to within 2% in 2D and 5%
                in 3D if cells are small beside the body.

        Returns:
            The domain on the new mesh.

        Raises:
            InputError: If the geometry is not known, a size is not > 0 and finite, or
                gmsh fails.
        """
        h = together(self.mesh.comm, parts.checked_sizes, sizes)
        if self.geometry is None:
            raise InputError(
                "The true geometry of this domain is not known, only its mesh; refine it by "
                "marking (strategy=Mark()), or make it by rectangle, box, from_gmsh, or "
                "read_mesh of a .geo file."
            )
        if self.glued is not None and self.seams is not None:
            at_glued = together(self.mesh.comm, self.seams.least, h)
            return self.glued.remeshed(at_glued)._split(self.seams.interfaces)
        return self.geometry.meshed(self, h)
