"""Statics in the displaced place: what small displacements leave out of balance.

In the place where it was drawn a body is in equilibrium, ``sum F = 0`` and ``sum x x F
= 0`` over all forces on it. At x + u the moment ``sum u x F`` is left. With the
gradient G of u, ``G_ij = d u_i/d x_j``, and the stress sigma that balances the forces
it is

    M_ij = sum u_i F_j - u_j F_i = int (G sigma)_ij - (G sigma)_ji.

A rigid translation adds nothing, and neither does a strain of an isotropic body, whose
axes sigma has: M is about the rotation times the moment ``V = int |sigma|`` of all
forces. Supports take it up. A body that they do not hold against a rotation needs its
contacts for it: pressures p along normals n move within their zones. The most that they
take up with their resultant unchanged is, by duality of linear programmes,

    C = min over translations t of  int p |n . (w + t)|,

w the rotation. On a flat base it is the width of the zone times the force; where a
cylinder rolls it is next to nothing. Friction is left out: what sticks is limited by
other bodies, as in a pyramid of cylinders, where it would hide all that is missing.

M over ``C + TURNED V`` tells whether the model can say that a body stands. In
``benchmarks/standing.py 0 25``, runs to eps = 10%, it was at most 0.0066 in 200
ordinary scenes: blocks under eccentric loads, discs between plates and in grooves,
stacks, press fits, columns between plates, boxes in 3D, tables. In 100 others it was
at least 0.13: soft blocks near the load that tips them, discs that roll, rockers, soft
columns under their load. In a pyramid of cylinders it is 0.007 with enough friction,
0.08 with 2% and 0.49 with 10% too little.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.model import Model
from erc_contact.model.motions.rigid_shapes import translations_and_rotations
from erc_contact.newton.distortion import gradients_of
from erc_contact.scene.material import mandel_basis
from namedmesh.base.ranks import of_all
from namedmesh.simplex import barycentric, measures, rule

MISSING = 0.1
"""Moment that is missing beyond which a model cannot say whether a body stands [-].

It is over what the contacts can take up and a share of all moments.
"""
TURNED = 0.02
"""Share of all moments that may be missing whatever the contacts can take up [-]."""
FACETS = 4.0
"""The same, over the width of the facets that carry a body beside its size [-].

On a mesh that is too coarse for its contacts a round body is a polygon, which turns
until it lies on a facet.
"""
ITERATIONS = 30
"""Number of weighted least squares that find a least sum of absolute values."""
SMALLEST = 1e-6
"""Distance that counts as zero in their weights, over the greatest [-]."""
NO_STRAIN = 1e-9
"""Strain over the gradient of the displacement that counts as none [-]."""
NO_ROTATION = 1e-9
"""Rotation of a unit motion that counts as none [-]."""


@dataclass(frozen=True)
class Imbalance:
    """Hold the moment that is missing on a body in its displaced place.

    Attributes:
        body: Number of the body.
        share: M over V, the moment of all forces [-].
        of_contacts: M over C, what the contacts can take up [-].
        doubt: M over ``C + TURNED V`` [-].
    """

    body: int
    share: float
    of_contacts: float
    doubt: float


@dataclass(frozen=True, eq=False)
class _Pressures:
    """Hold forces of pressures at points of contacts, each on a body.

    Attributes:
        body: Number of the body, shape (n,).
        x: Places [length], shape (n, d).
        normals: Unit normals [-], shape (n, d).
        forces: Their sizes [force], shape (n,).
        widths: Widths of the facets [length], shape (n,).
    """

    body: np.ndarray
    x: np.ndarray
    normals: np.ndarray
    forces: np.ndarray
    widths: np.ndarray


def missing_moments(
    model: Model, u: fem.Function, traction: Callable[[ContactOnMesh], Ufl]
) -> list[Imbalance]:
    """Tell what is out of balance on bodies that supports let turn; collective.

    Of several rotations of a body the worst counts.

    Args:
        model: The scene on a mesh.
        u: Displacement [length].
        traction: The traction of the method on a contact [force/area], UFL, shape (d,).
    """
    space = model.space
    turning = [number for number, amounts in enumerate(model.loose) if _turns(amounts, space.d)]
    if not turning:
        return []
    moments, sizes = _moments(model, u)
    pressures = _pressures(model, traction)
    result = []
    for number in turning:
        if sizes[number] == np.inf:
            continue
        of_body = pressures.body == number
        x = (pressures.x[of_body] - model.centres[number]) / model.body_sizes[number]
        shapes = translations_and_rotations(x)
        normals = pressures.normals[of_body]
        forces = pressures.forces[of_body]
        known = _resolution(forces, pressures.widths[of_body]) / model.body_sizes[number]
        allowed = max(TURNED, FACETS * known)
        worst = Imbalance(number, 0.0, 0.0, 0.0)
        for turn, translations in _rotations(model.loose[number], space.d):
            # Motions turn by angles times the size of the body.
            moment = abs(turn[space.d :] @ moments[number]) / model.body_sizes[number]
            along = np.einsum("nik,ni->nk", shapes, normals)
            capacity = _least_sum(forces, along @ turn, along @ translations)
            whole = sizes[number] / model.body_sizes[number]
            if moment > worst.doubt * (capacity + allowed * whole):
                worst = Imbalance(
                    number,
                    share=moment / whole,
                    of_contacts=moment / capacity if capacity > 0 else np.inf,
                    doubt=moment / (capacity + allowed * whole),
                )
        result.append(worst)
    return result


def _turns(amounts: np.ndarray, d: int) -> bool:
    """Tell whether motions of a body, shape (m, K), are not translations alone."""
    return bool(np.linalg.norm(amounts[d:]) > NO_ROTATION)


def _rotations(amounts: np.ndarray, d: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return unit rotations among motions of a body, and its translations.

    Args:
        amounts: Combinations of the m motions of a body, shape (m, K).
        d: Dimension.

    Returns:
        Of each rotation its amounts, shape (m,), and the translations (m, k).
    """
    _, sizes, rows = np.linalg.svd(amounts[d:])
    count = int((sizes > NO_ROTATION).sum())
    translations = amounts @ rows[count:].T
    turns = amounts @ (rows[:count].T / sizes[:count])
    return [(turn, translations) for turn in turns.T]


def _moments(model: Model, u: fem.Function) -> tuple[np.ndarray, np.ndarray]:
    """Return M of each pair of axes, shape (bodies, pairs), and V; collective.

    V is infinite of a body without strain.
    """
    d = model.space.d
    _, count = model.bodies
    found = gradients_of(model, u)
    basis = mandel_basis(d)
    strain = np.einsum("bij,nij->nb", basis, found.elastic)
    x = found.corners.mean(axis=1)
    stress = model.constitution.stress(strain[:, None], x[:, None], model.space.owned_cells)[:, 0]
    volume = measures(found.corners)
    forces = np.einsum("nb,bij->nij", stress, basis) * volume[:, None, None]
    product = np.einsum("nji,njk->nik", found.whole, forces)
    first, second = np.triu_indices(d, 1)
    moments = product[:, first, second] - product[:, second, first]
    tensors = (forces, found.whole * volume[:, None, None], strain * volume[:, None])
    sizes = [np.sqrt((tensor**2).sum(axis=tuple(range(1, tensor.ndim)))) for tensor in tensors]
    total = np.zeros((count, len(first) + 3))
    np.add.at(total, found.bodies, np.column_stack([moments, *sizes]))
    total = model.space.comm.allreduce(total, MPI.SUM)
    whole, gradient, strains = total[:, len(first) :].T
    # A body that nothing touches turns without strain, and its forces are round-off.
    return total[:, : len(first)], np.where(strains > NO_STRAIN * gradient, whole, np.inf)


def _pressures(model: Model, traction: Callable[[ContactOnMesh], Ufl]) -> _Pressures:
    """Return the pressures of all contacts on the bodies of both sides; collective."""
    space = model.space
    d = space.d
    body, _ = model.bodies
    points, weights = rule(d - 1, space.contact_degree)
    rows = [np.zeros((0, 2 * d + 3))]
    for contact in model.contacts:
        trace = contact.trace
        owned = trace.here.owned
        facets = contact.facets[owned]
        r = space.evaluate(traction(contact), points, facets)
        normals = np.broadcast_to(trace.normals_at(points)[owned], r.shape)
        pressure = np.maximum(-(r * normals).sum(axis=-1), 0.0)
        forces = pressure * space.facet_weights(facets, points, weights)
        x = np.matmul(barycentric(points), space.facet_corners(facets))
        widths = trace.here.areas[owned, None] ** (1 / (d - 1))
        of_points = np.stack([forces, np.broadcast_to(widths, forces.shape)], axis=-1)
        table = np.concatenate([x, normals, of_points], axis=-1)
        for nodes in (trace.here.nodes[owned], trace.partners[owned[trace.facing]]):
            of_side = table[: len(nodes)]
            of_facets = np.broadcast_to(body[nodes[:, :1], None], (*of_side.shape[:2], 1))
            rows.append(np.concatenate([of_facets, of_side], axis=-1).reshape(-1, 2 * d + 3))
    (every,) = of_all(space.comm, np.concatenate(rows))
    return _Pressures(
        body=every[:, 0].astype(int),
        x=every[:, 1 : d + 1],
        normals=every[:, d + 1 : -2],
        forces=every[:, -2],
        widths=every[:, -1],
    )


def _resolution(forces: np.ndarray, widths: np.ndarray) -> float:
    """Return the mean width of the facets that carry forces [length].

    It is the greatest of all where a method has no pressure at the points.
    """
    total = float(forces.sum())
    return float(forces @ widths) / total if total > 0 else float(widths.max(initial=0.0))


def _least_sum(weights: np.ndarray, values: np.ndarray, columns: np.ndarray) -> float:
    """Return the least ``sum w |a + B t|`` over t, by weighted least squares.

    Args:
        weights: w >= 0, shape (n,).
        values: a, shape (n,).
        columns: B, shape (n, k).
    """
    left = values
    least = float(weights @ abs(left))
    smallest = SMALLEST * abs(values).max(initial=0.0)
    if smallest == 0.0 or not columns.shape[1]:
        return least
    for _ in range(ITERATIONS):
        roots = np.sqrt(weights / np.maximum(abs(left), smallest))
        t = np.linalg.lstsq(roots[:, None] * columns, -roots * values, rcond=None)[0]
        left = values + columns @ t
        least = min(least, float(weights @ abs(left)))
    return least
