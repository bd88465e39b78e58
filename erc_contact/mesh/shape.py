"""The true shape of a body, kept as gmsh needs it to mesh the body again with other sizes.

A mesh alone has lost its circles. Domains that gmsh made, and rectangles and boxes, therefore keep a :class:`Brick` or
a :class:`Drawing`, on rank 0; refined and remeshed domains hand it on. Meshing runs on rank 0; curved boundaries are
sampled anew; physical groups keep their tags, so the names of parts and regions stay as they were. Facets of a body
with a curved boundary or interface carry the number of their curve or surface in the drawing, its mark.

Symbols: h size [length], the edge of the simplex that is wanted at a point; d dimension.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import graph
from dolfinx import mesh as dmesh
from dolfinx.io import gmsh as dgmsh
from dolfinx.io.utils import distribute_entity_data
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.partition import partitioner
from erc_contact.mesh.simplex import barycentric, measures, rule

SIDES = {
    2: (("left", "right"), ("bottom", "top")),
    3: (("left", "right"), ("front", "back"), ("bottom", "top")),
}
"""Names of the sides of a rectangle or box, by dimension: low and high end of x, y and z. The last axis is up."""
MARK = "erc_contact mark "
"""Beginning of the names of physical groups that keep marks."""
FLAT = ("Line", "Plane")
"""gmsh's types of curves and surfaces that facets represent exactly."""
SESSION = {"General.Terminal": 0, "Mesh.ElementOrder": 1, "Mesh.RecombineAll": 0}
"""gmsh's options during a session of ours; a user's own session gets its options back."""
FIELD = {
    "Mesh.MeshSizeMin": 0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.Algorithm": 6,
    "Mesh.Algorithm3D": 1,
}
"""gmsh's options when a size field says all there is to say of sizes; Frontal-Delaunay in 2D, Delaunay in 3D."""
FILL = {2: 4 / np.sqrt(3), 3: 5.0}
"""Simplices of size 1 that fill a unit of area or volume, by dimension: equilateral triangles; regular tetrahedra do
not fill space (they would be 8.5), gmsh makes 4.7 of size 1 on fine uniform meshes and 5.6 on graded ones."""
GMSH = {2: 1.06, 3: 1.08}
"""Simplices that gmsh makes for each that :data:`FILL` counts on small graded meshes, measured: the first guess."""
ROUND = 1e-3
"""Step of the logarithm of sizes that are given to gmsh [-]: the round-off of the ranks must not make another mesh."""
COUNT_TOLERANCE = {2: 0.02, 3: 0.05}
"""A mesh whose number of cells misses the count of its sizes by more is made again with scaled sizes [-]."""
ATTEMPTS = 4
"""Meshes made at most to come near the count."""


@dataclass(frozen=True)
class Brick:
    """A rectangle or a box.

    Args:
        low: Corner of least coordinates [length].
        high: Opposite corner [length].
    """

    low: tuple[float, ...]
    high: tuple[float, ...]

    def build(self, gmsh: Any) -> None:
        """Make geometry and physical groups in gmsh's current model, by the OpenCASCADE kernel."""
        dim = len(self.low)
        occ, extent = gmsh.model.occ, np.subtract(self.high, self.low)
        body = occ.addRectangle(*self.low, 0.0, *extent) if dim == 2 else occ.addBox(*self.low, *extent)
        occ.synchronize()
        gmsh.model.addPhysicalGroup(dim, [body], name="body")
        sides = gmsh.model.getBoundary([(dim, body)], oriented=False)
        centre = {tag: np.array(occ.getCenterOfMass(dim - 1, tag)[:dim]) for _, tag in sides}
        for number, (name, axis, at) in enumerate(self.sides(), start=1):
            distance = {tag: abs(x[axis] - at) for tag, x in centre.items()}
            gmsh.model.addPhysicalGroup(dim - 1, [min(distance, key=distance.__getitem__)], tag=number, name=name)

    def sides(self) -> Iterator[tuple[str, int, float]]:
        """Name, axis and coordinate of each side; its tag is its number, from 1."""
        for axis, pair in enumerate(SIDES[len(self.low)]):
            for name, at in zip(pair, (self.low[axis], self.high[axis]), strict=True):
                yield name, axis, at

    def exact(self, domain: Domain) -> Domain:
        """The domain, whose nodes on the sides are put there to the last digit: a side at y = 0 must not be at 1e-17.

        Args:
            domain: A mesh of this brick that was just made; no other object may have used it yet.
        """
        x = domain.mesh.geometry.x
        for _, axis, at in self.sides():
            x[abs(x[:, axis] - at) < 1e-12 * (self.high[axis] - self.low[axis]), axis] = at
        return domain

    def meshed(self, domain: Domain, sizes: np.ndarray) -> Domain:
        """See :meth:`Domain.remeshed`; collective."""
        return self.exact(_meshed(self, domain, sizes))

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """The points: the facets are the true surface."""
        return points


@dataclass(frozen=True)
class Drawing:
    """The geometry of a gmsh model as text: that of a file of gmsh's.

    Args:
        suffix: ".xao" (OpenCASCADE's shapes) or ".geo_unrolled" (gmsh's own), both with the physical groups.
        text: Contents of the file on rank 0, empty elsewhere.
        curved: Marks of the curves (in 2D) or surfaces (in 3D) that are curved, the same on all ranks.
    """

    suffix: str
    text: str = field(repr=False)
    curved: frozenset[int] = frozenset()

    def build(self, gmsh: Any) -> dict[int, int]:
        """Make geometry and physical groups in gmsh's current model; returns gmsh's tag there of each mark.

        A shape of OpenCASCADE gets new tags each time it is read, so its marks are kept as physical groups.
        """
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"body{self.suffix}"
            path.write_text(self.text)
            gmsh.merge(str(path))
        model, tags = gmsh.model, {}
        for dim, group in model.getPhysicalGroups():
            name = model.getPhysicalName(dim, group)
            if name.startswith(MARK):
                tags[int(name.removeprefix(MARK))] = int(model.getEntitiesForPhysicalGroup(dim, group)[0])
                model.removePhysicalGroups([(dim, group)])
        return tags or {int(tag): int(tag) for _, tag in model.getEntities(model.getDimension() - 1)}

    def meshed(self, domain: Domain, sizes: np.ndarray) -> Domain:
        """See :meth:`Domain.remeshed`; collective."""
        return _meshed(self, domain, sizes)

    def nearest(self, comm: MPI.Comm, points: np.ndarray, marks: np.ndarray) -> np.ndarray:
        """Nearest points of the true surface, see :data:`erc_contact.mesh.surface.Nearest`; collective."""
        bent = np.isin(marks, list(self.curved)).any(axis=1)
        parts = comm.gather((points[bent], marks[bent]))
        found: list[np.ndarray] = []

        def build(gmsh: Any) -> None:
            tags = self.build(gmsh)
            found.extend(_nearest(gmsh.model, tags, x, of) for x, of in parts or ())

        with session(comm, build, "The geometry"):
            result = points.copy()
            result[bent] = comm.scatter(found if comm.rank == 0 else None)
        return result


def drawing_of(model: Any) -> tuple[str, str, frozenset[int]] | None:
    """Suffix, text and curved marks of the geometry of gmsh's current model; None if it has none.

    A model read from a mesh file has no geometry, and one that mixes gmsh's two kernels is kept by neither format.
    """
    import gmsh  # noqa: PLC0415 - whoever has a model has gmsh

    entities, drawn = set(model.getEntities()), set(model.occ.getEntities())
    discrete = any(model.getType(*entity).startswith("Discrete") for entity in entities)
    if discrete or (drawn and drawn != entities):
        return None
    suffix = ".xao" if drawn else ".geo_unrolled"
    facets = model.getEntities(model.getDimension() - 1)
    curved = frozenset(int(tag) for dim, tag in facets if model.getType(dim, tag) not in FLAT)
    marks = facets if curved and drawn else ()
    groups = [(dim, model.addPhysicalGroup(dim, [tag], name=f"{MARK}{tag}")) for dim, tag in marks]
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"body{suffix}"
            gmsh.write(str(path))
            return suffix, path.read_text(), curved
    finally:
        if groups:  # no groups would mean all
            model.removePhysicalGroups(groups)


def renumber(model: Any, dim: int) -> None:
    """Number the nodes of a model's mesh from 1, those of no cell last.

    The centre of an arc may have a node that is in no cell. DOLFINx takes the numbers of the others to be below theirs;
    where one was not, it sent to a rank that does not exist and ended the process.
    """
    every = model.mesh.getNodes()[0]
    used = np.isin(every, np.concatenate(model.mesh.getElements(dim)[2]))
    every = np.concatenate([np.sort(every[used]), np.sort(every[~used])])
    if np.any(np.diff(every.astype(np.int64)) != 1) or every[0] != 1:
        model.mesh.renumberNodes(every, np.arange(1, len(every) + 1))


def marked_facets(
    model: Any, comm: MPI.Comm, rank: int, mesh: dmesh.Mesh, tags: Mapping[int, int] | None
) -> dmesh.MeshTags:
    """Marks of the facets that lie on curves (2D) or surfaces (3D) of a meshed model; collective.

    Args:
        model: gmsh's current model on ``rank``.
        comm: Communicator.
        rank: Rank that holds the model.
        mesh: The mesh made of it.
        tags: gmsh's tag of each mark on ``rank``; None where the marks are the tags.
    """
    d = mesh.topology.dim
    nodes, values = np.empty((0, d), dtype=np.int64), np.empty(0, dtype=np.int32)
    if comm.rank == rank:
        tags = tags or {int(tag): int(tag) for _, tag in model.getEntities(d - 1)}
        found = {m: np.concatenate([[], *model.mesh.getElements(d - 1, tag)[2]]) for m, tag in tags.items()}
        nodes = np.concatenate(list(found.values())).astype(np.int64).reshape(-1, d) - 1
        values = np.repeat(list(found), [len(of) // d for of in found.values()]).astype(np.int32)
    mesh.topology.create_connectivity(d - 1, 0)
    mesh.topology.create_connectivity(d - 1, d)
    found_nodes, found_values = distribute_entity_data(mesh, d - 1, nodes, values)
    return dmesh.meshtags_from_entities(mesh, d - 1, graph.adjacencylist(found_nodes), found_values)


def _nearest(model: Any, tags: Mapping[int, int], x: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """Nearest points (n, d) on the curves or surfaces of the marks (n, 2), on their common edge where there are two."""
    d, result = x.shape[1], x.copy()
    for pair in np.unique(marks, axis=0):
        here = np.all(marks == pair, axis=1)
        places = [(d - 1, tags[pair[0]])]
        if pair[1] >= 0:
            below = [set(map(int, model.getAdjacencies(d - 1, tags[m])[1])) for m in pair]
            places = [(d - 2, tag) for tag in below[0] & below[1]]
        flat = np.pad(x[here], ((0, 0), (0, 3 - d))).ravel()
        found = np.array([np.reshape(model.getClosestPoint(*place, flat)[0], (-1, 3))[:, :d] for place in places])
        if len(found):
            best = np.linalg.norm(found - x[here], axis=2).argmin(axis=0)
            result[here] = found[best, np.arange(len(best))]
    return result


def count(domain: Domain, sizes: np.ndarray) -> float:
    """Number of cells that a mesh of these sizes has: ``int c / h^d``, c of :data:`FILL`; collective.

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


def _meshed(geometry: Brick | Drawing, domain: Domain, sizes: np.ndarray) -> Domain:
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
        error = InputError(f"{len(wrong)} sizes are not > 0 and finite, the first is {wrong[0]:g}; sizes are lengths.")
    raise_together(comm, error)
    h = np.exp(ROUND * np.round(np.log(h) / ROUND))
    wanted = round(count(domain, h))
    nodes = mesh.geometry.dofmaps[0][: domain.owned_cells]
    parts = comm.gather((mesh.geometry.x[nodes], h[nodes]))

    tags: dict[int, int] = {}

    def build(gmsh: Any) -> None:
        tags.update(geometry.build(gmsh) or {})
        assert parts is not None
        x, values = (np.concatenate(part) for part in zip(*parts, strict=True))
        _mesh_to_sizes(gmsh, dim, *_sorted(x, values), wanted)
        renumber(gmsh.model, dim)

    with session(comm, build, "The geometry, meshed again,") as model:
        data = dgmsh.model_to_mesh(model, comm, 0, gdim=dim, partitioner=partitioner(comm))
        marks = marked_facets(model, comm, 0, data.mesh, tags) if domain.curved_facets is not None else None
    regions = data.cell_tags if domain.regions else None
    return Domain(data.mesh, data.facet_tags, domain.names, regions, domain.regions, geometry, marks)


def _sorted(x: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Simplices (n, d+1, 3) with sizes at their corners, in an order that does not depend on the ranks.

    gmsh finds the size at a point on an edge in the first simplex that holds it, so another order is another mesh.
    """
    corners = np.lexsort(x.transpose(2, 0, 1)[::-1], axis=1)
    x, sizes = np.take_along_axis(x, corners[..., None], axis=1), np.take_along_axis(sizes, corners, axis=1)
    order = np.lexsort(x.reshape(len(x), -1).T[::-1])
    return x[order], sizes[order]


def _mesh_to_sizes(gmsh: Any, dim: int, x: np.ndarray, sizes: np.ndarray, wanted: int) -> None:
    """Mesh gmsh's current model with the sizes of simplices (corners x, shape (n, d+1, 3)), to the count wanted.

    How many cells gmsh makes of a size depends on gradation and shape. A mesh is cheap beside a contact solve, so one
    that misses the count is made again with all sizes scaled.
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
        if miss <= COUNT_TOLERANCE[dim] or attempt == ATTEMPTS or (attempt == ATTEMPTS - 1 and miss <= best[0]):
            return
        best = min(best, (miss, scale))
        scale = best[1] if attempt == ATTEMPTS - 1 else scale * (got / wanted) ** (1 / dim)


def as_input_error(reason: Exception, what: str) -> InputError:
    """An error of gmsh's, or of ours, as an :class:`InputError`."""
    return reason if isinstance(reason, InputError) else InputError(f"{what} cannot be used: {reason}")


@contextmanager
def session(comm: MPI.Comm, build: Callable[[Any], None], what: str) -> Iterator[Any]:
    """A silent gmsh session on rank 0 with a model of its own; None on the other ranks; collective."""
    error: Exception | None = None
    if comm.rank != 0:
        raise_together(comm, None)
        yield None
        return
    try:
        import gmsh  # noqa: PLC0415 - only rank 0 needs it
    except (ImportError, OSError) as reason:  # OSError: a shared library that gmsh's wheel expects
        raise_together(comm, InputError(f"gmsh cannot be loaded: {reason}. Install it, or give cells= or a Domain."))

    started_here = not gmsh.isInitialized()
    if started_here:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    before = None if started_here else gmsh.model.getCurrent()
    options = {name: gmsh.option.getNumber(name) for name in (*SESSION, *FIELD)}
    for name, value in SESSION.items():
        gmsh.option.setNumber(name, value)
    gmsh.model.add("erc_contact")
    try:
        build(gmsh)
    except Exception as reason:  # every rank must learn of it
        error = as_input_error(reason, what)
    try:
        raise_together(comm, error)
        yield gmsh.model
    finally:
        if started_here:
            gmsh.finalize()
        else:
            gmsh.model.remove()
            gmsh.model.setCurrent(before)
            for name, value in options.items():
                gmsh.option.setNumber(name, value)
