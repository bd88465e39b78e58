"""Mesh a geometry with given sizes, by gmsh on rank 0.

Symbols: h size [length], the edge of the simplex that is wanted at a point; d
dimension.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from mpi4py import MPI

from namedmesh.base.exceptions import InputError
from namedmesh.curvature import follow_curves
from namedmesh.files.building import Built, build_simplices, spread_from
from namedmesh.files.of_gmsh import marked_entities, mesh_of_model
from namedmesh.gmsh_session import FIELD, add_sizes, session
from namedmesh.periodic import SAME_PLACE
from namedmesh.rows import in_space
from namedmesh.size_field import Labels, SizeField

GMSH_EXCESS = {2: 1.06, 3: 1.08}
"""Number of simplices that gmsh makes over the number from :data:`FILL`.

It was measured on small graded meshes, and is the first guess.
"""
COUNT_TOLERANCE = {2: 0.02, 3: 0.05}
"""Greatest share by which the number of cells may miss the count [-].

Beyond it the mesh is made again with scaled sizes.
"""
EXCESS_OF_SHAPE = 1.25
"""Excess of cells [-] above which the shape may be why there are so many.

It is if larger sizes take away less than a third of its logarithm. Still larger sizes
would coarsen the mesh only where few cells are too many.
"""
ABORT_QUIETLY = 1
"""Value of gmsh's option by which an error ends a mesh and is not thrown."""
SUBJECT = "The geometry, meshed again,"
"""Subject of what is told of it."""
ATTEMPTS = 4
"""Greatest number of meshes that are made to come near the count.

If the last one is not the best, the best one is made again.
"""

EDGES_OF_CIRCLE = 6
"""Least number of edges along a full circle, and around a curved surface.

Sizes of a user may be larger. An edge that turns by half a circle would cut the body in
two, see :func:`namedmesh.curvature.follow_curves`. With 6 edges gmsh makes hardly
more cells than without: along each circle it puts 7 in any case.
"""


def mesh_geometry(
    build: Callable[[Any], dict[int, int] | None],
    comm: MPI.Comm,
    sizes: SizeField,
    labels: Labels,
) -> dict[str, Any]:
    """Mesh a geometry with the sizes in the cells of a mesh; collective.

    See :meth:`namedmesh.domain.Domain.remeshed`.

    Args:
        build: Function that makes the geometry in gmsh's current model on rank 0, and
            returns gmsh's tag of each mark, or None.
        comm: Communicator.
        sizes: The sizes.
        labels: The names of the new mesh.

    Returns:
        The arguments of the domain on the new mesh, without its geometry.

    Raises:
        InputError: If gmsh fails.
    """
    dim = sizes.dim
    target = max(round(sizes.count(comm)), 1)
    region_of = {tag: name for name, tag in labels.regions.items()}
    parts = comm.gather((sizes.x, sizes.sizes))
    tags: dict[int, int] = {}

    def build_mesh(gmsh: Any) -> None:
        tags.update(build(gmsh) or {})
        mesh_alike(gmsh.model, labels)
        assert parts is not None
        corners = np.concatenate([x for x, _ in parts])
        corner_sizes = np.concatenate([values for _, values in parts])
        corners, corner_sizes = _sort(corners, corner_sizes)
        _mesh_to_sizes(gmsh, dim, corners, corner_sizes, target, region_of)

    with session(comm, build_mesh, SUBJECT) as model:

        def make() -> Built:
            marks = marked_entities(model, tags) if labels.curved else []
            return build_simplices(mesh_of_model(model), marks, numbered=False)

        new = spread_from(comm, 0, make, SUBJECT)
    new |= {"names": labels.names, "regions": labels.regions}
    if not labels.regions:
        # gmsh's tags stand for the group "body" then, which nobody asked for.
        new["cell_tags"] = None
    return new


def mesh_alike(model: Any, labels: Labels) -> None:
    """Let gmsh mesh the second part of periodic pairs as the image of the first part.

    Args:
        model: gmsh's current model.
        labels: The names of the new mesh, with the pairs.

    Raises:
        InputError: If the motion takes an entity of the first part onto none of the
            second part, or the shape has no such parts.
    """
    dim = model.getDimension()
    low, high = np.reshape(model.getBoundingBox(-1, -1), (2, 3))
    reach = SAME_PLACE * np.linalg.norm(high - low)
    for pair in labels.periodic:
        if not labels.names.keys() >= set(pair.names):
            raise InputError(
                f"{' and '.join(pair.names)} are no parts of the shape, but named by rules, so that"
                " gmsh cannot mesh them alike; refine by marking: strategy=ec.Mark(), or draw them"
                " as parts."
            )
        parts = []
        for name in pair.names:
            tags = model.getEntitiesForPhysicalGroup(dim - 1, labels.names[name])
            middles = [_mean_corner(model, dim - 1, int(tag)) for tag in tags]
            parts.append((tags, np.array(middles)))
        (first, x), (second, x_second) = parts
        image = in_space(pair.image(x[:, :dim]))
        away = np.linalg.norm(image[:, None] - x_second, axis=2)
        nearest = away.argmin(axis=1)
        if len(set(nearest)) < len(second) or away.min(axis=1).max() > reach:
            raise InputError(
                f"The curves or surfaces of {pair.names[0]!r} have no images in"
                f" {pair.names[1]!r}, so that gmsh cannot mesh them alike; refine by marking:"
                " strategy=ec.Mark()."
            )
        motion = np.eye(4)
        motion[:dim, :dim] = pair.rotation
        motion[:dim, 3] = pair.shift
        model.mesh.setPeriodic(dim - 1, second[nearest], first, motion.ravel())


def _mean_corner(model: Any, dim: int, tag: int) -> np.ndarray:
    """Return the mean of the corners of a curve or surface [length], shape (3,)."""
    corners = model.getBoundary([(dim, tag)], oriented=False, recursive=True)
    return np.mean([model.getValue(0, point, []) for _, point in corners], axis=0)


def _sort(x: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sort simplices and their corners, so that the ranks do not matter.

    gmsh takes the size at a point on an edge from the first simplex that holds it. So
    another order gives another mesh.

    Args:
        x: Corners [length], shape (n, d+1, 3).
        sizes: Sizes at the corners [length], shape (n, d+1).
    """
    corners = np.lexsort(x.transpose(2, 0, 1)[::-1], axis=1)
    x = np.take_along_axis(x, corners[..., None], axis=1)
    sizes = np.take_along_axis(sizes, corners, axis=1)
    order = np.lexsort(x.reshape(len(x), -1).T[::-1])
    return x[order], sizes[order]


def _mesh_to_sizes(
    gmsh: Any,
    dim: int,
    x: np.ndarray,
    sizes: np.ndarray,
    target: int,
    region_of: Mapping[int, str],
) -> None:
    """Mesh gmsh's current model with sizes at the corners of simplices.

    The number of cells that gmsh makes depends on gradation and shape. If it misses the
    target, all sizes are scaled and the mesh is made again; this is cheap beside a
    contact solve.

    Args:
        gmsh: The module gmsh.
        dim: Dimension.
        x: Corners [length], shape (n, d+1, 3).
        sizes: Sizes at the corners [length], shape (n, d+1).
        target: Number of cells.
        region_of: Tag of each region -> its name.

    Raises:
        InputError: If gmsh cannot mesh it with the sizes as they are.
    """
    for name, value in FIELD.items():
        gmsh.option.setNumber(name, value)
    follow_curves(gmsh, EDGES_OF_CIRCLE, float(sizes.min()), float(sizes.max()))
    scale = GMSH_EXCESS[dim] ** (1 / dim)
    best = (np.inf, scale)
    made = np.nan
    problem = ""
    excess_before = np.inf
    for _ in range(ATTEMPTS):
        cells, problem = _mesh_once(gmsh, dim, x, scale * sizes, region_of)
        if problem:
            break
        made = scale
        miss = abs(cells / target - 1)
        best = min(best, (miss, scale))
        if miss <= COUNT_TOLERANCE[dim]:
            return
        excess = cells / target
        if excess > max(EXCESS_OF_SHAPE, excess_before ** (2 / 3)):
            break
        excess_before = excess
        scale *= excess ** (1 / dim)
    if np.isinf(best[0]):
        raise InputError(
            f"{SUBJECT} cannot be used: {problem}. Ask for smaller sizes, as facets that are "
            "large for their curves may meet each other; or refine the mesh that there is: "
            "domain.refined(cells), or strategy=ec.Mark()."
        )
    if problem or made != best[1]:
        _mesh_once(gmsh, dim, x, best[1] * sizes, region_of)


def _mesh_once(
    gmsh: Any, dim: int, x: np.ndarray, sizes: np.ndarray, region_of: Mapping[int, str]
) -> tuple[int, str]:
    """Mesh gmsh's current model with sizes, see :func:`_mesh_to_sizes`.

    Returns:
        The number of cells, and what gmsh could not do, mostly nothing.
    """
    view, background = add_sizes(gmsh, x, sizes)
    gmsh.model.mesh.field.setAsBackgroundMesh(background)
    option = "General.AbortOnError"
    before = gmsh.option.getNumber(option)
    # An error that is thrown leaves gmsh locked: it would mesh nothing in this session.
    gmsh.option.setNumber(option, ABORT_QUIETLY)
    try:
        gmsh.model.mesh.clear()
        gmsh.model.mesh.generate(dim)
        problem = gmsh.logger.getLastError()
    finally:
        gmsh.option.setNumber(option, before)
        gmsh.model.mesh.field.remove(background)
        gmsh.view.remove(view)
    cells = 0
    for entity in gmsh.model.getEntities(dim):
        of_entity = sum(len(tags) for tags in gmsh.model.mesh.getElements(*entity)[1])
        cells += of_entity
        if not of_entity and not problem:
            # gmsh only warns of it.
            groups = gmsh.model.getPhysicalGroupsForEntity(*entity)
            body = next((repr(region_of[tag]) for tag in groups if tag in region_of), "it")
            problem = f"gmsh made no cell of {body}"
    return cells, problem
