"""Bodies with a mesh whose boundary parts and cell regions have names.

A :class:`Domain` is a value. Refinement returns a new one, which has the same names and
is balanced over the ranks. On every rank it has all cells around the vertices of the
cells that the rank owns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.checks import description
from erc_contact.base.exceptions import InputError, raise_together, together
from erc_contact.base.html import table
from erc_contact.mesh.partition import check_mesh, partitioner, patches_complete, redistributed
from erc_contact.mesh.refinement import refine
from erc_contact.mesh.surface import offset, snap
from erc_contact.mesh.tags import shared


class Geometry(Protocol):
    """The true shape of a body: it can be meshed again, and it knows its surface."""

    def meshed(self, domain: Domain, sizes: np.ndarray) -> Domain:
        """See :meth:`Domain.remeshed`; collective."""

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Nearest points of the true surface, see :data:`erc_contact.mesh.surface.Nearest`; collective."""


@dataclass(frozen=True, eq=False)
class Domain:
    """A mesh whose parts have names.

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
    _inside: set[str] = field(init=False, repr=False, default_factory=set)
    _zeros: dict[tuple[str, int, tuple[int, ...]], fem.Function] = field(
        init=False, repr=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, dmesh.Mesh):
            raise InputError(
                f"Domain: mesh is {description(self.mesh)}; give a mesh of DOLFINx, or use read_mesh, rectangle, box."
            )
        for what, tags in (("names", self.names), ("regions", self.regions)):
            if not isinstance(tags, Mapping) or not all(
                isinstance(tag, Integral) for tag in tags.values()
            ):
                raise InputError(
                    f"Domain: {what} is {tags!r}; give a mapping from names to whole numbers, the tags."
                )
        check_mesh(self.mesh)
        tdim = self.mesh.topology.dim
        self.mesh.topology.create_connectivity(tdim - 1, tdim)
        self.mesh.topology.create_connectivity(tdim, tdim - 1)
        error: Exception | None = None
        if not self.names:
            error = InputError(
                "The mesh has no named boundary part; give facet tags and names, e.g. names={'bottom': 1} "
                "(in gmsh: physical groups of the boundary)."
            )
        elif self.facet_tags is None:
            error = InputError(
                f"The mesh has no tagged facet, but the names {_listed(self.names)}; tag their facets."
            )
        elif self.facet_tags.dim != tdim - 1:
            error = InputError(
                f"The facet tags have dimension {self.facet_tags.dim}; facets have {tdim - 1}."
            )
        elif self.regions and (self.cell_tags is None or self.cell_tags.dim != tdim):
            error = InputError(
                f"The regions {_listed(self.regions)} need cell tags of dimension {tdim}."
            )
        raise_together(self.mesh.comm, error)
        if self.mesh.comm.size > 1:
            self._complete()
        owned = self.mesh.topology.index_map(tdim - 1).size_local
        outer = dmesh.exterior_facet_indices(self.mesh.topology)
        for name, tag in self.names.items():
            here = self.facet_tags.find(tag)
            here = here[here < owned]
            counts = self.mesh.comm.allreduce(
                np.array([len(here), np.isin(here, outer).sum()]), MPI.SUM
            )
            if not counts[0]:
                raise InputError(
                    f"Boundary part {name!r} (tag {tag}) has no facet; remove it or tag its facets."
                )
            if counts[1] < counts[0]:
                self._inside.add(name)

    def _complete(self) -> None:
        """Give every rank complete vertex patches, and the tags of all facets and cells that it has; collective."""
        mesh, every = self.mesh, [shared(self.mesh, tags) for tags in self._every_tags]
        if not patches_complete(mesh):
            mesh, every = redistributed(mesh, *every)
        for name, value in zip(
            ("mesh", "facet_tags", "cell_tags", "curved_facets"), (mesh, *every), strict=True
        ):
            object.__setattr__(self, name, value)

    @property
    def _every_tags(self) -> tuple[Any, dmesh.MeshTags | None, dmesh.MeshTags | None]:
        return self.facet_tags, self.cell_tags, self.curved_facets

    def __repr__(self) -> str:
        """Tell what it is in a line; nothing is computed, so one rank alone may ask."""
        regions = f", regions {', '.join(self.regions)}" if self.regions else ""
        return f"<Domain in {self.dim}D: {self.cells} cells, boundary parts {', '.join(self.names)}{regions}>"

    def _repr_html_(self) -> str:
        """The domain in a notebook; nothing is computed, so one rank alone may ask."""
        rows = [
            ("cells", self.cells),
            ("vertices", self.vertices),
            ("boundary parts", ", ".join(self.names)),
        ]
        regions = [("regions", ", ".join(self.regions))] * bool(self.regions)
        return table(
            [*rows, *regions, ("shape", shape_in_words(self))], caption=f"Domain in {self.dim}D"
        )

    @property
    def dim(self) -> int:
        """Dimension of space, 2 or 3."""
        return self.mesh.topology.dim

    @property
    def cells(self) -> int:
        """Number of cells over all ranks."""
        return self.mesh.topology.index_map(self.dim).size_global

    @property
    def owned_cells(self) -> int:
        """Number of cells of this rank."""
        return self.mesh.topology.index_map(self.dim).size_local

    @property
    def vertices(self) -> int:
        """Number of vertices over all ranks."""
        return self.mesh.topology.index_map(0).size_global

    @cached_property
    def sides(self) -> np.ndarray:
        """Sides of the bounding box [length], shape (d,)."""
        x = self.mesh.geometry.x
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        self.mesh.comm.Allreduce(x.min(axis=0, initial=np.inf), low, MPI.MIN)
        self.mesh.comm.Allreduce(x.max(axis=0, initial=-np.inf), high, MPI.MAX)
        return (high - low)[: self.dim]

    @property
    def extent(self) -> float:
        """Length of the diagonal of the bounding box [length]."""
        return float(np.linalg.norm(self.sides))

    @property
    def outer(self) -> list[str]:
        """Names of the parts without facets inside the body, which a scene can use."""
        return [name for name in self.names if name not in self._inside]

    def function(self, family: str, degree: int, shape: tuple[int, ...] = ()) -> fem.Function:
        """A new Function on the mesh, zero everywhere; collective.

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
        """The vector from a facet to the true surface [length]; None if this is flat or not known; collective."""
        if self.curved_facets is None or self.geometry is None:
            return None
        return offset(self.mesh, self.curved_facets, self.geometry.nearest)

    def tag(self, name: str) -> int:
        """The tag of a boundary part, for measures of DOLFINx.

        Raises:
            InputError: If no part has this name, or it has facets inside the body.
        """
        if name not in self.names:
            raise InputError(
                f"No boundary part is called {name!r}; this domain has {_listed(self.names)}."
            )
        if name in self._inside:
            raise InputError(
                f"{name!r} has facets inside the body; only a part of the boundary can carry a condition."
            )
        return self.names[name]

    def facets(self, name: str) -> np.ndarray:
        """The facets of a boundary part as pairs (cell, local facet), ghosts included, shape (n, 2).

        Raises:
            InputError: If no part has this name, or it has facets inside the body.
        """
        facets = self.facet_tags.find(self.tag(name))
        topology = self.mesh.topology
        facet_to_cell = topology.connectivity(self.dim - 1, self.dim)
        cell = facet_to_cell.array[facet_to_cell.offsets[facets]]
        of_cell = topology.connectivity(self.dim, self.dim - 1).array.reshape(-1, self.dim + 1)[
            cell
        ]
        return np.column_stack([cell, np.argmax(of_cell == facets[:, None], axis=1)]).astype(
            np.int32
        )

    def region(self, name: str) -> np.ndarray:
        """The cells of a region, ghosts included.

        Raises:
            InputError: If no region has this name.
        """
        if self.cell_tags is None or name not in self.regions:
            raise InputError(
                f"No cell region is called {name!r}; this domain has {_listed(self.regions)}."
            )
        return self.cell_tags.find(self.regions[name])

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
        marked = together(self.mesh.comm, self._marked, marked)
        refinement = refine(self.mesh, marked, partitioner(self.mesh.comm))
        fine = refinement.mesh
        facet_tags, cell_tags, curved = (refinement.inherited(tags) for tags in self._every_tags)
        if curved is not None and self.geometry is not None:
            snap(fine, curved, self.geometry.nearest)
        return Domain(fine, facet_tags, self.names, cell_tags, self.regions, self.geometry, curved)

    def _marked(self, cells: npt.ArrayLike | None) -> np.ndarray:
        """The cells of this rank that are to be refined, after a check."""
        if cells is None:
            return np.arange(self.owned_cells, dtype=np.int32)
        numbers = np.asarray(cells)
        if numbers.size == 0:
            return np.empty(0, dtype=np.int32)
        if numbers.ndim != 1 or not np.issubdtype(numbers.dtype, np.integer):
            raise InputError(
                f"refined: the cells are {description(cells)}; give numbers of cells of this rank, "
                "e.g. np.flatnonzero(mask)."
            )
        if numbers.min() < 0 or numbers.max() >= self.owned_cells:
            raise InputError(
                f"refined: the cells go from {numbers.min()} to {numbers.max()}; this rank has 0 to "
                f"{self.owned_cells - 1}."
            )
        return numbers.astype(np.int32)

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
        h = together(self.mesh.comm, _numbers, sizes)
        if self.geometry is None:
            raise InputError(
                "The true geometry of this domain is not known, only its mesh; refine it by marking "
                "(strategy=Mark()), or make it by rectangle, box, from_gmsh, or read_mesh of a .geo file."
            )
        return self.geometry.meshed(self, h)


def shape_in_words(domain: Domain) -> str:
    """What is known of the true shape of a domain."""
    if domain.geometry is None:
        return "that of the mesh, with flat facets"
    corners = [getattr(domain.geometry, name, None) for name in ("low", "high")]
    if None not in corners:
        return f"{('rectangle', 'box')[domain.dim - 2]} from {corners[0]} to {corners[1]}"
    return (
        "curved, its geometry is known"
        if domain.curved_facets is not None
        else "flat sides, its geometry is known"
    )


def _numbers(sizes: npt.ArrayLike) -> np.ndarray:
    try:
        return np.asarray(sizes, dtype=float)
    except (TypeError, ValueError) as reason:
        raise InputError(
            f"remeshed: the sizes are {sizes!r}; give a number, or one for each node."
        ) from reason


def _listed(names: Mapping[str, int]) -> str:
    return ", ".join(sorted(names)) if names else "none"
