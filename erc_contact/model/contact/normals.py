"""Put the normals of a contact on a mesh: a field that turns along curved facets.

N is linear on each facet, with a unit normal at each vertex. The unit normal of the
contact is n = N/|N|. With one normal a facet, two facets would forbid a motion along
two directions at their common vertex, and what slides along a curved side would catch
like teeth. A point x on a chord of a circle or sphere about the origin is R N, so there
w.N = 0 for a rotation w = a x x: nothing catches, however coarse the mesh is.

Between bodies a gap g that the scene gives is g |M| on their flat facets. M is linear,
too, along N at the vertices, and as long there as makes the mean of |M| on the facets
about 1. So ``w = g M`` closes the gap exactly, as the facets of polygons in two circles
do, and the mean gap is g.

In UFL the field is a discontinuous linear Function of the cells at the contact. A cell
whose facets lie on both sides of a sharp edge has two such Functions, and the facet's
own normal tells which of them a facet takes.

Symbols: f facets, d dimension.
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.side import Side
from erc_contact.model.space import Space
from namedmesh.base.ranks import greatest
from namedmesh.for_solvers import spread, vertex_normals
from namedmesh.simplex import barycentric, rule

SAME_NORMAL = 1e-9
"""Difference of two unit normals that counts as none [-]."""
LEAST_COSINE = 0.2
"""Least cosine of the angle between the normals at two vertices of a facet [-]."""
LENGTH_DEGREE = 8
"""Quadrature degree of the mean of |N| on a facet."""


def normals_of_side(space: Space, facets: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Find the unit normals of a side at the vertices of its facets; collective.

    They are normals of the true surface where that is known; they are a little shorter
    where vertices lie beside it, see :func:`_of_moved_vertices`.

    Args:
        space: The mesh.
        facets: Facets (cell, local facet), ghosts included, shape (f, 2).
        corners: Their vertices [length], shape (f, d, d).

    Returns:
        Shape (f, d, d): facet, vertex, component. Normals of ghosts may be normals of a
        smaller side.
    """
    flat = space.outward_normals(facets)
    estimated = np.repeat(flat[:, None], space.d, axis=1)
    if spread(space.comm, flat) > SAME_NORMAL:
        vertices = space.facet_nodes(facets)[:, : space.d]
        estimated = vertex_normals(space.comm, corners, vertices, flat)
    if not space.comm.allreduce(bool(space.domain.are_curved(facets).any()), MPI.LOR):
        return estimated
    places = space.true_places(facets)[:, : space.d]
    true = space.domain.true_normals(facets, space.local_vertices(facets))
    outward = np.where(np.einsum("fid,fd->fi", true, flat) < 0, -1.0, 1.0)[..., None] * true
    result = np.where(np.isnan(outward), estimated, outward)
    return _of_moved_vertices(space, facets, corners - places, places, result)


def _of_moved_vertices(
    space: Space,
    facets: np.ndarray,
    moves: np.ndarray,
    places: np.ndarray,
    normals: np.ndarray,
) -> np.ndarray:
    """Scale normals as vertices lie beside the true surface; collective.

    On a circle, a cylinder or a sphere vertices at the distance rho from the axis or
    the middle have the normal N = rho n, over the greatest rho. Then the field N is
    parallel to the radius on each facet, and a pressure along it has no moment: what
    slides does not catch. Elsewhere rho is ``1 + kappa a``, with the height a of the
    vertex over the surface, and the curvature kappa by which normals of the vertices of
    its facets turn.

    Args:
        space: The mesh.
        facets: Facets (cell, local facet), ghosts included, shape (f, 2).
        moves: Vectors from the true surface to their vertices [length], shape (f, d,
            d).
        places: The places of the vertices on the true surface [length], shape (f, d,
            d).
        normals: Unit normals there, shape (f, d, d).

    Returns:
        Normals of at most the length 1, shape (f, d, d).
    """
    d = space.d
    height = (moves * normals).sum(axis=-1)
    first, second = np.triu_indices(d, 1)
    turn = normals[:, second] - normals[:, first]
    along = ((places[:, second] - places[:, first]) * turn).sum(axis=-1)
    sums = np.zeros((2, space.node_count))
    vertices = space.facet_nodes(facets)[:, :d]
    for total, values in zip(sums, ((turn**2).sum(axis=-1), along), strict=True):
        for ends in (first, second):
            np.add.at(total, vertices[:, ends], values)
    curvature = np.divide(sums[0], sums[1], out=np.zeros_like(sums[0]), where=sums[0] > 0)
    rho = 1 + curvature[vertices] * height
    owned = rho[space.owned(facets)]
    most = space.comm.allreduce(float(owned.max(initial=1.0)), MPI.MAX)
    return normals * (rho / most)[..., None]


def turns(comm: MPI.Comm, of_corners: np.ndarray) -> bool:
    """Tell whether normals at vertices turn along any facet; collective."""
    return greatest(comm, of_corners - of_corners[:, :1]) > SAME_NORMAL


def normal_field(
    space: Space, facets: np.ndarray, of_corners: np.ndarray
) -> tuple[Ufl, np.ndarray]:
    """Make the field of normals of a contact; collective.

    Args:
        space: The mesh.
        facets: Facets (cell, local facet), ghosts included, shape (f, 2).
        of_corners: Unit normals at their vertices, shape (f, d, d), of which the
            normals of facets that this rank owns count.

    Returns:
        The field N as UFL, and the normals at the vertices of all facets.
    """
    owned = space.owned(facets)
    slot = _slots(space, facets, of_corners)
    count = space.comm.allreduce(int(slot[owned].max(initial=0)) + 1, MPI.MAX)
    fields = []
    for number in range(count):
        field = space.domain.function("DG", 1, (space.d,))
        chosen = owned & (slot == number)
        field.x.array.reshape(-1, space.d)[_dofs(space, field, facets[chosen])] = of_corners[chosen]
        field.x.scatter_forward()
        fields.append(field)
    selectors = [_selector(space, facets, owned, slot, number) for number in range(count - 1)]
    result = fields[-1]
    for field, selector in zip(fields[-2::-1], selectors[::-1], strict=True):
        result = ufl.conditional(ufl.ge(ufl.dot(space.n, selector), 0), field, result)
    return result, _of_all_facets(space, facets, fields, selectors)


def gap_vectors(space: Space, side: Side, of_corners: np.ndarray) -> np.ndarray:
    """Return M at the vertices of facets, shape (f, d, d) [-].

    The factor of a normal is the mean of the factors of the facets around the vertex.
    It is right on facets that this rank owns.
    """
    points, weights = rule(space.d - 1, LENGTH_DEGREE)
    lengths = np.linalg.norm(np.matmul(barycentric(points), of_corners), axis=-1) @ weights
    area = np.zeros((2, space.node_count))
    vertices = side.nodes[:, : space.d]
    for total, factor in zip(area, (1.0, 1 / lengths), strict=True):
        np.add.at(total, vertices, (side.areas * factor)[:, None])
    factors = np.divide(area[1], area[0], out=np.ones(space.node_count), where=area[0] > 0)
    return factors[vertices][..., None] * of_corners


def _dofs(space: Space, field: fem.Function, facets: np.ndarray) -> np.ndarray:
    """Return the block degrees of freedom of a DG1 Function at vertices, (f, d)."""
    of_cells = field.function_space.dofmap.list[facets[:, 0]]
    return np.take_along_axis(of_cells, space.local_vertices(facets), axis=1)


def _slots(space: Space, facets: np.ndarray, of_corners: np.ndarray) -> np.ndarray:
    """Number the Function that each facet takes in its cell, shape (f,).

    Facets of a cell share a Function unless they have different normals at a vertex.
    """
    d = space.d
    slot = np.zeros(len(facets), dtype=int)
    order = np.argsort(facets[:, 0], kind="stable")
    cells, first, counts = np.unique(facets[order, 0], return_index=True, return_counts=True)
    vertices = space.local_vertices(facets)
    # Normals that are taken so far: Function, cell, vertex, component.
    taken = np.full((d + 1, len(cells), d + 1, d), np.nan)
    for turn in range(int(counts.max(initial=0))):
        row = np.flatnonzero(counts > turn)
        facet = order[first[row] + turn]
        at = (row[:, None], vertices[facet])
        differs = []
        for of_slot in taken:
            # nan, a vertex that is free, differs from nothing.
            differs.append((abs(of_slot[at] - of_corners[facet]) > SAME_NORMAL).any(axis=(1, 2)))
        slot[facet] = np.argmin(differs, axis=0)
        taken[slot[facet][:, None], *at] = of_corners[facet]
    return slot


def _selector(
    space: Space, facets: np.ndarray, owned: np.ndarray, slot: np.ndarray, number: int
) -> fem.Function:
    """Make a vector of each cell that tells which Function a facet takes.

    Its product with the normal of a facet is negative on facets that take a later
    Function than ``number``. It is zero in cells that have none of them.
    """
    d = space.d
    sums = np.zeros((2, len(space.nodes), d))
    counts = np.zeros((2, len(space.nodes), 1))
    flat = space.outward_normals(facets)
    for place, chosen in enumerate((owned & (slot <= number), owned & (slot > number))):
        np.add.at(sums[place], facets[chosen, 0], flat[chosen])
        np.add.at(counts[place], facets[chosen, 0], 1.0)
    here, later = sums / np.maximum(counts, 1.0)
    selector = space.domain.function("DG", 0, (d,))
    on_both = (counts > 0).all(axis=0)
    selector.x.array.reshape(-1, d)[:] = np.where(on_both, here - later, 0.0)
    selector.x.scatter_forward()
    return selector


def _of_all_facets(
    space: Space, facets: np.ndarray, fields: list[fem.Function], selectors: list[fem.Function]
) -> np.ndarray:
    """Return the normals at the vertices of all facets, ghosts included, (f, d, d)."""
    d = space.d
    flat = space.outward_normals(facets)
    slot = np.zeros(len(facets), dtype=int)
    for number, selector in enumerate(selectors):
        along = np.einsum("fd,fd->f", flat, selector.x.array.reshape(-1, d)[facets[:, 0]])
        slot = np.where((slot == number) & (along < 0), number + 1, slot)
    dofs = _dofs(space, fields[0], facets)
    values = np.array([field.x.array.reshape(-1, d)[dofs] for field in fields])
    return values[slot, np.arange(len(facets))]


def check_turning(comm: MPI.Comm, what: str, of_corners: np.ndarray) -> None:
    """Check that normals turn by less than a right angle along facets; collective.

    Args:
        comm: The ranks.
        what: The contact, in words.
        of_corners: Normals at the vertices of each facet, shape (f, d, d).

    Raises:
        InputError: If they turn by more.
    """
    unit = of_corners / np.linalg.norm(of_corners, axis=2, keepdims=True)
    cosine = 1.0 - greatest(comm, 1.0 - np.einsum("fid,fjd->fij", unit, unit))
    if cosine < LEAST_COSINE:
        found, allowed = np.degrees(np.arccos([cosine, LEAST_COSINE]))
        raise InputError(
            f"{what}: its normal turns by {found:.0f} degrees along a facet, as where four facets"
            f" stand for a circle. Mesh the part finer, so that it turns by {allowed:.0f} at most."
        )
