"""Evaluate fields at points of the body that a user gives.

Symbols: d dimension, k degree of the displacement, s = d(d+1)/2 Mandel components.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import fem, geometry
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.runtime import compiled
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.model.von_mises import von_mises
from erc_contact.scene.material import mandel_basis, strain
from namedmesh.base.releases import cell_nodes
from namedmesh.for_solvers import in_space
from namedmesh.simplex import barycentric

BORDER = 2e-13
"""Distance from the border of cells that counts as none, by the coordinates [-].

It is a thousand times the round-off of double precision.
"""
OUTSIDE = 1e-6
"""Distance outside the body that counts as none, by the height of the cell [-]."""


def at_points(
    space: Space, points: Any, values: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> np.ndarray:
    """Evaluate a field at points of the body, the same on all ranks; collective.

    At a point between several cells it is the mean of their values.

    Args:
        space: The mesh.
        points: Points, the same on all ranks [length], shape (n, d) or (d,).
        values: Gets owned cells (m,) and a point in each (m, d); returns values, shape
            (m, c). It is called once on every rank.

    Returns:
        Values, shape (n, c).

    Raises:
        InputError: If the points have another shape or are not finite, or one lies
            outside the mesh.
    """
    d, comm = space.d, space.comm
    x = np.atleast_2d(np.asarray(points, dtype=float))
    if x.ndim != 2 or x.shape[1] != d or not np.isfinite(x).all():
        raise InputError(
            f"The points have shape {np.shape(points)}; give finite numbers of shape (n, {d})."
        )
    point, cell = _places(space, x)
    in_cells = np.column_stack([np.ones(len(point)), values(cell, x[point])])
    local = np.zeros((len(x), in_cells.shape[1]))
    np.add.at(local, point, in_cells)
    sums = comm.allreduce(local, MPI.SUM)
    count = sums[:, :1]
    total = sums[:, 1:]
    outside = np.flatnonzero(count == 0)
    if len(outside):
        first = tuple(map(float, x[outside[0]]))
        raise InputError(
            f"{len(outside)} of the {len(x)} points lie outside the mesh, the first is {first};"
            " give points of the body (facets cut off a little of a curved one)."
        )
    return total / count


def _places(space: Space, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the cells that hold points: one, or several at their border; collective.

    DOLFINx takes a point that is 1e-6 away, whatever the unit of length, to be in a
    cell. So barycentric coordinates decide: a cell holds a point if the least of them
    is not below zero; a point outside the body, by round-off, is in the cell where it
    is greatest, of all ranks.

    Args:
        space: The mesh.
        x: Points, the same on all ranks [length], shape (n, d).

    Returns:
        Pairs of a point and an owned cell, two arrays of shape (m,). Points outside the
        mesh are in none.
    """
    d, comm, mesh = space.d, space.comm, space.mesh
    tree = geometry.bb_tree(mesh, d, padding=1e-10 * space.domain.extent)
    candidates = geometry.compute_collisions_points(tree, in_space(x))
    owned = candidates.array < space.domain.owned_cells
    point = np.repeat(np.arange(len(x)), np.diff(candidates.offsets))[owned]
    cell = candidates.array[owned]
    corners = mesh.geometry.x[cell_nodes(mesh.geometry)[cell], :d]
    edges = corners[:, 1:] - corners[:, :1]
    offset = x[point] - corners[:, 0]
    to_local = np.linalg.inv(edges)
    local = np.einsum("ni,nij->nj", offset, to_local)
    least = barycentric(local).min(axis=1)
    border = BORDER * abs(corners).max(axis=(1, 2)) * np.linalg.norm(to_local, axis=(1, 2))
    best = np.full(len(x), -np.inf)
    np.maximum.at(best, point, least)
    comm.Allreduce(MPI.IN_PLACE, best, MPI.MAX)
    # It is zero on facets and inside a cell more. Points outside have it below zero.
    level = np.minimum(best, 0.0)[point]
    holds = (least >= level - border) & (level >= -OUTSIDE)
    return point[holds], cell[holds]


def along_line(
    space: Space,
    ends: tuple[Any, Any],
    count: int,
    values: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> np.ndarray:
    """Tabulate displacement and stress along a straight line; collective.

    Args:
        space: The mesh.
        ends: The points where it starts and ends [length], shape (d,) each.
        count: Number of points, evenly distributed, at least 2.
        values: Gets owned cells (m,) and a point in each (m, d); returns rows of the
            displacement [length] and of the stress tensor in 3D [force/area], shape (m,
            d + 9).

    Returns:
        A structured array for numpy and pandas, the same on all ranks, with the columns

        - ``s``: distance from the start [length]; ``x``, ``y``, in 3D ``z``: the point,
        - ``u_x``, ``u_y``, in 3D ``u_z``: displacement [length],
        - ``s_xx``, ``s_yy``, ``s_zz``, ``s_xy``, in 3D ``s_yz`` and ``s_xz``: stress
          [force/area]; of rings ``s_rr``, ``s_zz``, ``s_hoop`` and ``s_rz``. In the
          plane s_zz is the stress out of plane, nan where the material has none,
        - ``von_mises`` [force/area].

    Raises:
        InputError: If an end has another shape, or a point lies outside the mesh.
    """
    d = space.d
    start, stop = (np.asarray(end, dtype=float) for end in ends)
    if start.shape != (d,) or stop.shape != (d,) or count < 2:
        raise InputError(
            f"along: the line goes from {ends[0]} to {ends[1]} with {count} points; give points of"
            f" {d} numbers, and 2 points or more."
        )
    shares = np.linspace(0.0, 1.0, count)
    points = start + shares[:, None] * (stop - start)

    u, stress = np.split(at_points(space, points, values), [d], axis=1)
    tensors = stress.reshape(-1, 3, 3)
    columns = {"s": shares * np.linalg.norm(stop - start)}
    columns |= dict(zip("xyz", points.T, strict=False))
    columns |= {f"u_{axis}": u[:, i] for i, axis in enumerate("xyz"[:d])}
    is_turned = space.section.axisymmetric
    names = {"rr": (0, 0), "zz": (1, 1), "hoop": (2, 2), "rz": (0, 1)}
    if not is_turned:
        names = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1)}
    if d == 3:
        names |= {"yz": (1, 2), "xz": (0, 2)}
    columns |= {f"s_{name}": tensors[:, i, j] for name, (i, j) in names.items()}
    columns["von_mises"] = von_mises(tensors)
    table = np.empty(count, dtype=[(name, float) for name in columns])
    for name, column in columns.items():
        table[name] = column
    return table


def elastic_stress_at(model: Model, u: fem.Function, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Evaluate the stress of a displacement at points of cells; collective.

    It is ``C (eps(u) - eps_0)`` [force/area].

    Args:
        model: The scene on a mesh.
        u: Displacement [length].
        cell: An owned cell of each point, shape (n,).
        x: Points, shape (n, d).

    Returns:
        Mandel components, shape (n, s), of an axisymmetric body with the hoop stress.
    """
    space = model.space
    d = space.d
    W = fem.functionspace(space.mesh, ("DG", space.degree - 1, (d, d)))
    eps = fem.Function(W)
    eps.interpolate(compiled.expression(strain(u), W.element.interpolation_points, space.comm))
    strains = np.zeros((len(x), d, d))
    if len(x):
        strains = eps.eval(in_space(x), cell.astype(np.int32)).reshape(len(x), d, d)
    basis = mandel_basis(d)
    mandel_strains = np.einsum("bij,nij->nb", basis, strains)

    def displacement() -> np.ndarray:
        if not len(x):
            return np.zeros((0, d))
        return u.eval(in_space(x), cell.astype(np.int32)).reshape(len(x), d)

    section = space.section
    mandel_strains = section.strain_at(mandel_strains, displacement, x)
    x_beside = section.beside_axis(x, space.domain.extent)
    stress = model.constitution.stress(mandel_strains[:, None], x_beside[:, None], cell)[:, 0]
    return section.over(stress, x_beside)


def tensors_of_points(model: Model, stress: np.ndarray) -> np.ndarray:
    """Return Mandel components (n, s) as tensors (n, d, d), or (n, 3, 3) of rings."""
    return np.tensordot(stress, model.space.section.basis, axes=1)
