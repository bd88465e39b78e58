"""Hold the sizes that a new mesh is to have, in the cells of the old mesh.

Symbols: h size [length], the edge of the simplex that is wanted at a point; d
dimension.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.exceptions import InputError
from namedmesh.base.releases import cell_nodes
from namedmesh.named import NamedMesh
from namedmesh.periodic import PeriodicPair
from namedmesh.simplex import barycentric, measures, rule

FILL = {2: 4 / np.sqrt(3), 3: 5.0}
"""Number of simplices of size 1 in a unit of area or volume, by dimension.

In 2D they are equilateral triangles. In 3D regular tetrahedra would give 8.5, but they
do not fill space: gmsh makes 4.7 on fine uniform meshes and 5.6 on graded meshes.
"""
SIZE_STEP = 1e-3
"""Step to which the logarithm of sizes is rounded before gmsh gets them [-].

Round-off must not change the mesh.
"""


@dataclass(frozen=True)
class Labels:
    """Hold the names of a mesh that is made.

    Attributes:
        names: Name of each boundary part -> its tag.
        regions: Name of each region -> its tag.
        curved: Whether the facets of curved sides are marked.
        periodic: Pairs of parts that are to be meshed alike.
    """

    names: Mapping[str, int]
    regions: Mapping[str, int]
    curved: bool
    periodic: tuple[PeriodicPair, ...] = ()


@dataclass(frozen=True, eq=False)
class SizeField:
    """Hold the sizes in the owned cells of this rank.

    Attributes:
        dim: Dimension.
        x: Corners of the cells [length], shape (n, d+1, 3).
        sizes: h at the corners [length], shape (n, d+1).
        regions: Tags of their regions, shape (n,).
    """

    dim: int
    x: np.ndarray
    sizes: np.ndarray
    regions: np.ndarray

    def in_regions(self, tags: Mapping[int, int]) -> SizeField:
        """Return the sizes in the cells of some regions, which get other tags.

        Args:
            tags: Tag of each of these regions -> its new tag.
        """
        cells = np.isin(self.regions, list(tags))
        old = self.regions[cells]
        regions = old.copy()
        for tag, new in tags.items():
            regions[old == tag] = new
        return SizeField(self.dim, self.x[cells], self.sizes[cells], regions)

    def count(self, comm: MPI.Comm) -> float:
        """Predict the number of cells of a mesh with these sizes; collective.

        It is ``int c / h^d`` with c of :data:`FILL`.
        """
        points, weights = rule(self.dim, 6)
        volume = measures(self.x[:, :, : self.dim])
        h = self.sizes @ barycentric(points).T
        integral = float(volume @ (h**-self.dim @ weights))
        return float(FILL[self.dim] * comm.allreduce(integral, MPI.SUM))


def labels_of(mesh: NamedMesh, curved_facets: dmesh.MeshTags | None) -> Labels:
    """Return the names of a mesh, and whether it has marks of curved facets."""
    return Labels(mesh.names, mesh.regions, curved_facets is not None)


def size_field(domain: NamedMesh, sizes: np.ndarray) -> SizeField:
    """Return sizes at the nodes of a mesh, rounded, as sizes in its owned cells.

    See :func:`at_corners`.
    """
    return at_corners(domain, np.exp(SIZE_STEP * np.round(np.log(sizes) / SIZE_STEP)))


def at_corners(domain: NamedMesh, sizes: np.ndarray) -> SizeField:
    """Return sizes at the nodes of a mesh as sizes in its owned cells.

    Args:
        domain: The domain on the mesh that carries the sizes.
        sizes: h at the nodes of this rank [length], shape (n,).
    """
    owned = domain.owned_cells
    x, corners = domain.points
    nodes = cell_nodes(domain.mesh.geometry)[:owned]
    regions = domain.region_tags[:owned]
    return SizeField(domain.dim, x[corners[:owned]], sizes[nodes], regions)


def sizes_at_nodes(sizes: npt.ArrayLike, count: int) -> np.ndarray:
    """Check sizes that a user gives, and return them at all nodes of this rank.

    Args:
        sizes: Sizes at the nodes, or one for all [length].
        count: Number of nodes.

    Raises:
        InputError: If they are not numbers, there is another number of sizes, or one is
            not > 0 and finite.
    """
    try:
        h = np.asarray(sizes, dtype=float)
    except (TypeError, ValueError) as reason:
        raise InputError(
            f"remeshed: the sizes are {sizes!r}; give a number, or one for each node."
        ) from reason
    if h.ndim == 0:
        h = np.full(count, h)
    if h.shape != (count,):
        raise InputError(
            f"The sizes have shape {h.shape}; give a number, or one for each node of this rank: "
            f"domain.mesh.geometry.x has {count}."
        )
    good = (h > 0) & np.isfinite(h)
    if not good.all():
        wrong = h[~good]
        raise InputError(
            f"{len(wrong)} sizes are not > 0 and finite, the first is {wrong[0]:g}; sizes are "
            "lengths."
        )
    return h
