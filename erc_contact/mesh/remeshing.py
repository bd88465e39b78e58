"""Meshes of a geometry with given sizes, by gmsh on rank 0.

Symbols: h size [length], the edge of the simplex that is wanted at a point; d
dimension.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx.io import gmsh as dgmsh
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.mesh.domain import Domain, Geometry
from erc_contact.mesh.gmsh_model import FIELD, marked_facets, renumber, session
from erc_contact.mesh.partition import partitioner
from erc_contact.mesh.simplex import barycentric, measures, rule

FILL = {2: 4 / np.sqrt(3), 3: 5.0}
"""Number of simplices of size 1 in a unit of area or volume, by dimension. In 2D they
are equilateral triangles. In 3D regular tetrahedra would give 8.5, but they do not fill
space: gmsh makes 4.7 on fine uniform meshes and 5.6 on graded meshes."""
GMSH = {2: 1.06, 3: 1.08}
"""Number of simplices that gmsh makes over the number from :data:`FILL`, measured on
small graded meshes. It is the first guess."""
ROUND = 1e-3
"""Step to which the logarithm of sizes is rounded before gmsh gets them [-]: round-off must not change the mesh."""
COUNT_TOLERANCE = {2: 0.02, 3: 0.05}
"""A mesh is made again with scaled sizes if its number of cells misses the count by more than this share [-]."""
ATTEMPTS = 4
"""Greatest number of meshes that are made to come near the count. If the last one is
not the best, the best one is made again."""


def count(domain: Domain, sizes: np.ndarray) -> float:
    """The number of cells of a mesh with given sizes, ``int c / h^d`` with c of :data:`FILL`; collective.

    Args:
        domain: The mesh that carries the sizes.
        sizes: h at the nodes ``domain.mesh.geometry.x`` [length], shape (n,).
    """
    mesh, dim = domain.mesh, domain.dim
    points, weights = rule(dim, 6)
    nodes = mesh.geometry.dofmaps[0][: domain.owned_cells]
    volume = measures(mesh.geometry.x[nodes][:, :, :dim])
    h = sizes[nodes] @ barycentric(points).T
    return float(FILL[dim] * mesh.comm.allreduce(float(volume @ (h**-dim @ weights)), MPI.SUM))


def meshed(
    geometry: Geometry,
    build: Callable[[Any], dict[int, int] | None],
    domain: Domain,
    sizes: np.ndarray,
) -> Domain:
    """Mesh a geometry with the sizes at the nodes of a mesh, see :meth:`Domain.remeshed`; collective.

    Args:
        geometry: The geometry, which the new domain keeps.
        build: Function that makes the geometry in gmsh's current model on rank 0, and
            returns gmsh's tag of each mark, or None.
        domain: The domain on the mesh that carries the sizes.
        sizes: h at the nodes of this rank [length], shape (n,), or one number.

    Returns:
        The domain on the new mesh, with the same names.

    Raises:
        InputError: If a size is not > 0 and finite, the sizes have another shape, or
            gmsh fails.
    """
    mesh, comm, dim = domain.mesh, domain.mesh.comm, domain.dim
    error, h = None, np.asarray(sizes, dtype=float)
    if h.ndim == 0:
        h = np.full(len(mesh.geometry.x), h)
    if h.shape != (len(mesh.geometry.x),):
        error = InputError(
            f"The sizes have shape {h.shape}; give a number, or one for each node of this rank: domain.mesh.geometry.x "
            f"has {len(mesh.geometry.x)}."
        )
    elif not np.all((h > 0) & np.isfinite(h)):
        wrong = h[~((h > 0) & np.isfinite(h))]
        error = InputError(
            f"{len(wrong)} sizes are not > 0 and finite, the first is {wrong[0]:g}; sizes are lengths."
        )
    raise_together(comm, error)
    h = np.exp(ROUND * np.round(np.log(h) / ROUND))
    wanted = round(count(domain, h))
    nodes = mesh.geometry.dofmaps[0][: domain.owned_cells]
    parts = comm.gather((mesh.geometry.x[nodes], h[nodes]))

    tags: dict[int, int] = {}

    def model_of(gmsh: Any) -> None:
        tags.update(build(gmsh) or {})
        assert parts is not None
        x, values = (np.concatenate(part) for part in zip(*parts, strict=True))
        _mesh_to_sizes(gmsh, dim, *_sorted(x, values), wanted)
        renumber(gmsh.model, dim)

    with session(comm, model_of, "The geometry, meshed again,") as model:
        data = dgmsh.model_to_mesh(model, comm, 0, gdim=dim, partitioner=partitioner(comm))
        marks = (
            marked_facets(model, comm, 0, data.mesh, tags)
            if domain.curved_facets is not None
            else None
        )
    regions = data.cell_tags if domain.regions else None
    return Domain(
        data.mesh, data.facet_tags, domain.names, regions, domain.regions, geometry, marks
    )


def _sorted(x: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Simplices (n, d+1, 3) with sizes at their corners, in an order that does not depend on the ranks.

    gmsh takes the size at a point on an edge from the first simplex that holds it. So
    another order gives another mesh.
    """
    corners = np.lexsort(x.transpose(2, 0, 1)[::-1], axis=1)
    x, sizes = (
        np.take_along_axis(x, corners[..., None], axis=1),
        np.take_along_axis(sizes, corners, axis=1),
    )
    order = np.lexsort(x.reshape(len(x), -1).T[::-1])
    return x[order], sizes[order]


def _mesh_to_sizes(gmsh: Any, dim: int, x: np.ndarray, sizes: np.ndarray, wanted: int) -> None:
    """Mesh gmsh's current model with sizes at the corners x (n, d+1, 3) of simplices, and a wanted number of cells.

    The number of cells that gmsh makes depends on gradation and shape. If it misses the
    wanted number, all sizes are scaled and the mesh is made again; this is cheap beside
    a contact solve.
    """
    for name, value in FIELD.items():
        gmsh.option.setNumber(name, value)
    scale = GMSH[dim] ** (1 / dim)
    best = (np.inf, scale)
    for attempt in range(ATTEMPTS + 1):
        view = gmsh.view.add("sizes")
        rows = np.hstack([x.transpose(0, 2, 1).reshape(len(x), -1), scale * sizes])
        gmsh.view.addListData(view, ("ST", "SS")[dim - 2], len(rows), rows.ravel())
        background = gmsh.model.mesh.field.add("PostView")
        gmsh.model.mesh.field.setNumber(background, "ViewTag", view)
        gmsh.model.mesh.field.setAsBackgroundMesh(background)
        try:
            gmsh.model.mesh.clear()
            gmsh.model.mesh.generate(dim)
        finally:
            gmsh.model.mesh.field.remove(background)
            gmsh.view.remove(view)
        got = sum(len(tags) for tags in gmsh.model.mesh.getElements(dim)[1])
        if not got:
            raise InputError("gmsh made no cell of it.")
        miss = abs(got / wanted - 1)
        if (
            miss <= COUNT_TOLERANCE[dim]
            or attempt == ATTEMPTS
            or (attempt == ATTEMPTS - 1 and miss <= best[0])
        ):
            return
        best = min(best, (miss, scale))
        scale = best[1] if attempt == ATTEMPTS - 1 else scale * (got / wanted) ** (1 / dim)
