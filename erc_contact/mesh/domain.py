"""Bodies with a mesh whose boundary parts and cell regions have names.

A :class:`Domain` is a value: refinement returns a new one, with the names kept, the load balanced and
complete vertex patches on every rank. No integer tag leaves this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from typing import Any, Protocol

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import cpp, graph
from dolfinx import mesh as dmesh
from dolfinx.io.utils import distribute_entity_data
from mpi4py import MPI

from erc_contact.base.checks import told
from erc_contact.base.exceptions import InputError, raise_together, together
from erc_contact.mesh.partition import check_mesh, partitioner, patches_complete
from erc_contact.mesh.surface import snap


class Geometry(Protocol):
    """The true shape of a body, with what it takes to mesh it again."""

    def meshed(self, domain: Domain, sizes: np.ndarray) -> Domain:
        """See :meth:`Domain.remeshed`; collective."""

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Nearest points of the true surface, see :data:`erc_contact.mesh.surface.Nearest`; collective."""


@dataclass(frozen=True, eq=False)
class Domain:
    """A mesh whose parts have names.

    Args:
        mesh: Straight-sided triangles in 2D or tetrahedra in 3D. Under MPI a mesh without complete vertex
            patches is distributed anew: use ``domain.mesh`` afterwards, not the one given.
        facet_tags: Tags of boundary facets.
        names: Name of each boundary part -> its tag.
        cell_tags: Tags of cells, or None.
        regions: Name of each cell region -> its tag.
        geometry: The true shape, None where only the mesh is known: the body is then the mesh, with its flat facets.
        curved_facets: Where the true shape is curved, for each facet on its boundary or on an interface the number of
            its curve or surface in the geometry.

    Raises:
        InputError: If the mesh is not of straight-sided simplices, or no facet carries a name's tag. A part that
            has facets inside the body may exist (an interface, say); to use it in a scene is an error.
    """

    mesh: dmesh.Mesh
    facet_tags: dmesh.MeshTags
    names: Mapping[str, int]
    cell_tags: dmesh.MeshTags | None = None
    regions: Mapping[str, int] = field(default_factory=dict)
    geometry: Geometry | None = field(default=None, repr=False)
    curved_facets: dmesh.MeshTags | None = field(default=None, repr=False)
    _inside: set[str] = field(init=False, repr=False, default_factory=set)

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, dmesh.Mesh):
            raise InputError(
                f"Domain: mesh is {told(self.mesh)}; give a mesh of DOLFINx, or use read_mesh, rectangle, box."
            )
        for what, tags in (("names", self.names), ("regions", self.regions)):
            if not isinstance(tags, Mapping) or not all(isinstance(tag, Integral) for tag in tags.values()):
                raise InputError(f"Domain: {what} is {tags!r}; give a mapping from names to whole numbers, the tags.")
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
            error = InputError(f"The mesh has no tagged facet, but the names {_listed(self.names)}; tag their facets.")
        elif self.facet_tags.dim != tdim - 1:
            error = InputError(f"The facet tags have dimension {self.facet_tags.dim}; facets have {tdim - 1}.")
        elif self.regions and (self.cell_tags is None or self.cell_tags.dim != tdim):
            error = InputError(f"The regions {_listed(self.regions)} need cell tags of dimension {tdim}.")
        raise_together(self.mesh.comm, error)
        if self.mesh.comm.size > 1 and not patches_complete(self.mesh):
            mesh, moved = _redistributed(self.mesh, self.facet_tags, self.cell_tags, self.curved_facets)
            for name, value in zip(("mesh", "facet_tags", "cell_tags", "curved_facets"), (mesh, *moved), strict=True):
                object.__setattr__(self, name, value)
        owned = self.mesh.topology.index_map(tdim - 1).size_local
        outer = dmesh.exterior_facet_indices(self.mesh.topology)
        for name, tag in self.names.items():
            here = self.facet_tags.find(tag)
            here = here[here < owned]
            counts = self.mesh.comm.allreduce(np.array([len(here), np.isin(here, outer).sum()]), MPI.SUM)
            if not counts[0]:
                raise InputError(f"Boundary part {name!r} (tag {tag}) has no facet; remove it or tag its facets.")
            if counts[1] < counts[0]:
                self._inside.add(name)

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
    def extent(self) -> float:
        """Length of the diagonal of the bounding box [length]."""
        x = self.mesh.geometry.x
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        self.mesh.comm.Allreduce(x.min(axis=0, initial=np.inf), low, MPI.MIN)
        self.mesh.comm.Allreduce(x.max(axis=0, initial=-np.inf), high, MPI.MAX)
        return float(np.linalg.norm(high - low))

    @property
    def outer(self) -> list[str]:
        """Names of the parts that can carry conditions: those without facets inside the body."""
        return [name for name in self.names if name not in self._inside]

    def tag(self, name: str) -> int:
        """Tag of a boundary part, for measures inside the package.

        Raises:
            InputError: If no part has this name (the message lists the names), or it has facets inside the body.
        """
        if name not in self.names:
            raise InputError(f"No boundary part is called {name!r}; this domain has {_listed(self.names)}.")
        if name in self._inside:
            raise InputError(f"{name!r} has facets inside the body; only a part of the boundary can carry a condition.")
        return self.names[name]

    def facets(self, name: str) -> np.ndarray:
        """The facets of a boundary part as pairs (cell, local facet), ghosts included, shape (n, 2).

        Raises:
            InputError: If no part has this name.
        """
        facets = self.facet_tags.find(self.tag(name))
        topology = self.mesh.topology
        facet_to_cell = topology.connectivity(self.dim - 1, self.dim)
        cell = facet_to_cell.array[facet_to_cell.offsets[facets]]
        of_cell = topology.connectivity(self.dim, self.dim - 1).array.reshape(-1, self.dim + 1)[cell]
        return np.column_stack([cell, np.argmax(of_cell == facets[:, None], axis=1)]).astype(np.int32)

    def region(self, name: str) -> np.ndarray:
        """The cells of a region, ghosts included.

        Raises:
            InputError: If no region has this name.
        """
        if self.cell_tags is None or name not in self.regions:
            raise InputError(f"No cell region is called {name!r}; this domain has {_listed(self.regions)}.")
        return self.cell_tags.find(self.regions[name])

    def refined(self, marked: np.ndarray | None = None) -> Domain:
        """Refine by bisection of longest edges (DOLFINx), conforming; collective.

        Names are kept, the new mesh is balanced over the ranks, and every rank has complete vertex patches. Where the
        true shape is known and curved, new vertices of its boundary and interfaces are put on it.

        Args:
            marked: Cells of this rank to refine; None refines all.

        Returns:
            The refined domain.

        Note:
            Which edge of a triangle is the longest must not depend on the numbering of the vertices, or
            the mesh would depend on the number of ranks. Lengths are therefore compared after a slight
            shear that no two edges of a structured mesh survive with equal length. Coordinates do not pass
            through the shear and back: old vertices stay as they are and a new one is the exact mean of the
            ends of its edge, so that a side at y = 0 stays at y = 0.
        """
        mesh, tdim = self.mesh, self.dim
        cells = together(mesh.comm, self._marked, marked)
        mesh.topology.create_entities(1)
        mesh.topology.create_connectivity(tdim, 1)
        mesh.topology.create_connectivity(1, tdim)
        edges = dmesh.compute_incident_entities(mesh.topology, cells, tdim, 1)
        shear = np.eye(3) + 1e-5 * np.array([[0, 0.83, 0.31], [-0.57, 0.44, 0.71], [0.13, -0.92, 0.22]])
        if tdim == 2:
            shear[:2, 2] = shear[2, :2] = 0
        x = mesh.geometry.x.copy()
        try:
            mesh.geometry.x[:] = x @ shear
            fine, parent_cell, parent_facet = dmesh.refine(
                mesh, edges, None, dmesh.RefinementOption.parent_cell_and_facet
            )
        finally:
            mesh.geometry.x[:] = x
        fine.topology.create_entities(tdim - 1)
        fine.topology.create_connectivity(tdim, tdim - 1)
        fine.topology.create_connectivity(tdim - 1, tdim)
        start = fine.topology.index_map(tdim).local_range[0]
        original = fine.topology.original_cell_index - start
        parent_cell = parent_cell[original]
        ends = _parent_ends(mesh, fine, parent_cell, x @ shear)
        fine.geometry.x[:] = 0.5 * (x[ends[:, 0]] + x[ends[:, 1]])
        parent_facet = parent_facet.reshape(-1, tdim + 1)[original]
        child, local = np.nonzero(parent_facet >= 0)
        old = mesh.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)
        old = old[parent_cell[child], parent_facet[child, local]]
        new = fine.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)[child, local]

        def inherited(tags: dmesh.MeshTags | None, parents: np.ndarray, children: np.ndarray) -> Any:
            if tags is None:
                return None
            values = _dense(tags, mesh)[parents]
            return _tags(fine, tags.dim, children[values >= 0], values[values >= 0])

        cell_tags = inherited(self.cell_tags, parent_cell, np.arange(len(parent_cell)))
        facet_tags, curved = inherited(self.facet_tags, old, new), inherited(self.curved_facets, old, new)
        if mesh.comm.size > 1:
            fine, (facet_tags, cell_tags, curved) = _redistributed(fine, facet_tags, cell_tags, curved)
        if curved is not None and self.geometry is not None:
            snap(fine, curved, self.geometry.nearest)
        return Domain(fine, facet_tags, self.names, cell_tags, self.regions, self.geometry, curved)

    def _marked(self, cells: npt.ArrayLike | None) -> np.ndarray:
        """Cells of this rank to refine, checked."""
        if cells is None:
            return np.arange(self.owned_cells, dtype=np.int32)
        numbers = np.asarray(cells)
        if numbers.size == 0:
            return np.empty(0, dtype=np.int32)
        if numbers.ndim != 1 or not np.issubdtype(numbers.dtype, np.integer):
            raise InputError(
                f"refined: the cells are {told(cells)}; give numbers of cells of this rank, e.g. np.flatnonzero(mask)."
            )
        if numbers.min() < 0 or numbers.max() >= self.owned_cells:
            raise InputError(
                f"refined: the cells go from {numbers.min()} to {numbers.max()}; this rank has 0 to "
                f"{self.owned_cells - 1}."
            )
        return numbers.astype(np.int32)

    def remeshed(self, sizes: npt.ArrayLike) -> Domain:
        """Mesh the true geometry again with other sizes, by gmsh on rank 0; collective.

        Names are kept, curved boundaries are sampled anew. Where the sizes ask for it the new mesh is coarser.

        Args:
            sizes: Edge h of the simplex that is wanted at each node ``mesh.geometry.x`` of this rank
                [length], shape (n,), linear between them; or one number. The number of cells is
                ``int c / h^d``, c = 4/sqrt(3) in 2D and 5 in 3D, to within 2% or 5% where cells are small
                beside the body.

        Returns:
            The domain on the new mesh.

        Raises:
            InputError: If the geometry is not known, a size is not > 0 and finite, or gmsh fails.
        """
        h = together(self.mesh.comm, _numbers, sizes)
        if self.geometry is None:
            raise InputError(
                "The true geometry of this domain is not known, only its mesh; refine it by marking "
                "(strategy=Mark()), or make it by rectangle, box, from_gmsh, or read_mesh of a .geo file."
            )
        return self.geometry.meshed(self, h)


def _numbers(sizes: npt.ArrayLike) -> np.ndarray:
    try:
        return np.asarray(sizes, dtype=float)
    except (TypeError, ValueError) as reason:
        raise InputError(f"remeshed: the sizes are {sizes!r}; give a number, or one for each node.") from reason


def _listed(names: Mapping[str, int]) -> str:
    return ", ".join(sorted(names)) if names else "none"


def _tags(mesh: dmesh.Mesh, dim: int, entities: np.ndarray, values: np.ndarray) -> dmesh.MeshTags:
    """Mesh tags from unsorted entities."""
    entities, first = np.unique(entities, return_index=True)
    return dmesh.meshtags(mesh, dim, entities.astype(np.int32), values[first].astype(np.int32))


def _dense(tags: dmesh.MeshTags, mesh: dmesh.Mesh) -> np.ndarray:
    """The tag of each local entity, -1 where there is none."""
    index_map = mesh.topology.index_map(tags.dim)
    dense = np.full(index_map.size_local + index_map.num_ghosts, -1, dtype=np.int32)
    dense[tags.indices] = tags.values
    return dense


def _parent_ends(mesh: dmesh.Mesh, fine: dmesh.Mesh, parent_cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The two old nodes between which each node of a refined mesh lies half way; twice the same for an old node.

    Args:
        mesh: The old mesh.
        fine: The refined mesh, in the coordinates of ``x``.
        parent_cell: Old cell of each cell of ``fine``.
        x: Coordinates of the old nodes at the refinement [length], shape (old nodes, 3).

    Returns:
        Old nodes of this rank, shape (nodes of fine, 2).
    """
    nodes = fine.geometry.dofmaps[0]
    _, first = np.unique(nodes, return_index=True)
    old = mesh.geometry.dofmaps[0][parent_cell[first // nodes.shape[1]]]
    candidates = np.stack([old[:, i] for i in np.array(np.triu_indices(nodes.shape[1])).T], axis=1)
    middle = 0.5 * (x[candidates[..., 0]] + x[candidates[..., 1]])
    nearest = np.linalg.norm(middle - fine.geometry.x[:, None], axis=2).argmin(axis=1)
    return np.take_along_axis(candidates, nearest[:, None, None], axis=1)[:, 0]


def _redistributed(mesh: dmesh.Mesh, *every: dmesh.MeshTags | None) -> tuple[dmesh.Mesh, list[Any]]:
    """The same mesh with its tags, balanced anew over the ranks and with complete vertex patches; collective."""
    tdim = mesh.topology.dim
    nodes = mesh.geometry.index_map()
    x = mesh.geometry.x[: nodes.size_local, : mesh.geometry.dim]
    owned = mesh.topology.index_map(tdim).size_local
    cells = nodes.local_to_global(mesh.geometry.dofmaps[0][:owned].ravel()).reshape(owned, tdim + 1)
    element = basix.ufl.element("Lagrange", mesh.basix_cell(), 1, shape=(mesh.geometry.dim,))
    new = dmesh.create_mesh(mesh.comm, cells, ufl.Mesh(element), x, partitioner(mesh.comm))

    def moved(tags: dmesh.MeshTags | None) -> Any:
        if tags is None:
            return None
        dim = tags.dim
        keep = tags.indices < mesh.topology.index_map(dim).size_local
        mesh.topology.create_connectivity(dim, tdim)
        entities = cpp.mesh.entities_to_geometry(mesh._cpp_object, dim, tags.indices[keep], False)
        entities = nodes.local_to_global(entities.ravel()).reshape(-1, dim + 1)
        new.topology.create_connectivity(dim, 0)
        new.topology.create_connectivity(dim, tdim)
        found, values = distribute_entity_data(new, dim, entities, tags.values[keep])
        return dmesh.meshtags_from_entities(new, dim, graph.adjacencylist(found), values)

    return new, [moved(tags) for tags in every]
