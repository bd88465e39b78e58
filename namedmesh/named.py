"""Give the parts of a mesh names: parts of its boundary, and regions of its cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import basix
import basix.ufl
import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.exceptions import InputError
from namedmesh.base.names import known_names
from namedmesh.base.ranks import box
from namedmesh.base.releases import cell_nodes
from namedmesh.rows import in_space
from namedmesh.sides import boundary_sides
from namedmesh.simplex import measures, of_facets
from namedmesh.tags import NO_TAG, tag_table

INSIDE_CELLS = "DG inside cells"
"""Family of polynomials in each cell whose nodes are inside it.

So each node belongs to one cell of any mesh that this mesh refines.
"""


@dataclass(frozen=True, eq=False)
class NamedMesh:
    """Hold a mesh and the names of its parts; see :class:`Domain`, which checks them.

    Attributes:
        mesh: Straight-sided triangles in 2D or tetrahedra in 3D.
        facet_tags: Tags of facets.
        names: Name of each boundary part -> its tag.
        cell_tags: Tags of cells, or None.
        regions: Name of each cell region -> its tag.
        places: Places of the corners of the cells of this rank [length], shape (cells,
            d+1, d), of a glued mesh whose bodies keep their shapes; None where they are
            the nodes. See :mod:`namedmesh.closing`.
        marks: Marks of the true curves or surfaces of the sides of these cells, shape
            (cells, d+1), where such bodies are curved; None where they are not.
    """

    mesh: dmesh.Mesh
    facet_tags: dmesh.MeshTags = None
    names: Mapping[str, int] = field(default_factory=dict)
    cell_tags: dmesh.MeshTags | None = None
    regions: Mapping[str, int] = field(default_factory=dict)
    places: np.ndarray | None = field(default=None, repr=False, kw_only=True)
    marks: np.ndarray | None = field(default=None, repr=False, kw_only=True)
    _inside: set[str] = field(init=False, repr=False, default_factory=set)
    _zeros: dict[tuple[str, int, tuple[int, ...]], fem.Function] = field(
        init=False, repr=False, default_factory=dict
    )

    @property
    def comm(self) -> MPI.Comm:
        """Return the communicator of its ranks, which outlives the mesh; collective."""
        return lasting(self.mesh.comm)

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

    @property
    def marks_of_sides(self) -> np.ndarray | None:
        """Return the mark of each side of a cell, shape (cells, d+1), or None."""
        return self.marks

    @property
    def region_tags(self) -> np.ndarray:
        """Return the tag of the region of each cell, shape (cells,).

        It is ``NO_TAG`` of ``namedmesh.tags`` where there is none.
        """
        if self.cell_tags is not None:
            return tag_table(self.cell_tags)
        cells = self.mesh.topology.index_map(self.dim)
        return np.full(cells.size_local + cells.num_ghosts, NO_TAG, dtype=np.int32)

    @cached_property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the points of the bodies, and which of them each cell has.

        They are the nodes of the mesh. In a glued mesh whose bodies keep their shapes a
        node has a point at each of its places.

        Returns:
            Points [length], shape (n, 3), and their numbers, shape (cells, d+1).
        """
        nodes = cell_nodes(self.mesh.geometry)
        if self.places is None:
            return self.mesh.geometry.x, nodes
        rows = np.column_stack([nodes.ravel(), self.places.reshape(-1, self.dim)])
        different, numbers = np.unique(rows, axis=0, return_inverse=True)
        return in_space(different[:, 1:]), numbers.reshape(nodes.shape)

    @property
    def drawn_points(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the points where the shape was drawn, see :attr:`points`; collective.

        Vertices of facets that keep the volume lie beside a curved surface; here they
        are on it.
        """
        return self.points

    def side_areas(self, sides: np.ndarray) -> np.ndarray:
        """Return areas of sides, see :meth:`flat_areas`; collective."""
        return self.flat_areas(sides)

    def flat_areas(self, sides: np.ndarray) -> np.ndarray:
        """Return areas of the facets of sides [length^(d-1)], shape (n,).

        Args:
            sides: Sides (cell, local facet), shape (n, 2).
        """
        x, points_of = self.points
        corners = x[points_of[sides[:, 0]], : self.dim]
        return measures(of_facets(corners, sides[:, 1]))

    @cached_property
    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Return two corners of the bounding box [length], shape (d,) each; collective.

        They are the corners of least and of greatest coordinates.
        """
        return box(self.comm, self.points[0][:, : self.dim])

    @property
    def sides(self) -> np.ndarray:
        """Return the sides of the bounding box [length], shape (d,); collective."""
        low, high = self.corners
        return high - low

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
            family: Family of the elements: "Lagrange", "DG", or :data:`INSIDE_CELLS`.
            degree: Degree of the elements.
            shape: Shape of the values.
        """
        kind = (family, degree, shape)
        if kind not in self._zeros:
            element = _inside_cells(self.mesh, degree, shape) if family == INSIDE_CELLS else kind
            self._zeros[kind] = fem.Function(fem.functionspace(self.mesh, element))
        return self._zeros[kind].copy()

    def tag(self, name: str) -> int:
        """Return the tag of a boundary part, for measures of DOLFINx.

        Raises:
            InputError: If no part has this name, or it has facets inside the body.
        """
        if name not in self.names:
            raise InputError(
                f"No boundary part is called {name!r}; this domain has "
                f"{known_names(name, self.names)}"
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
        cell, local_facet = boundary_sides(self.mesh, facets)
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
                f"No cell region is called {name!r}; this domain has "
                f"{known_names(name, self.regions)}"
            )
        return self.cell_tags.find(self.regions[name])


def _inside_cells(mesh: dmesh.Mesh, degree: int, shape: tuple[int, ...]) -> Any:
    """Return an element of the family :data:`INSIDE_CELLS`."""
    variants = basix.LagrangeVariant
    variant = variants.gl_isaac if degree else variants.unset
    cell = mesh.basix_cell()
    return basix.ufl.element("DG", cell, degree, variant, shape=shape, discontinuous=True)
