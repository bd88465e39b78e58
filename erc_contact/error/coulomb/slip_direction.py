"""Fields t on a contact surface: mu times a direction of slip.

They are continuous, at various smoothness. Where the body slips t should be mu times
the direction of slip, where it sticks ``-r^_t/|r^_n|``; the two are one where slip and
traction are opposite, as the law wants. At each node t0 is the mean of both, with the
squares of the pressure p and of ``E |slip|/h`` as weights: a slip that is less than ``p
h/E`` is an error of the mesh. Where slip or traction change from node to node, a
smoother t makes the coupling smaller, at the price of terms that measure by how much t
misses. A smoother t minimises

    sum_i c_i |t_i - t0_i|^2 A_i + l^2 int |grad t|^2

on the surface, with A_i the area of a node, l a length, and c_i its p and ``E
|slip|/h``, not above the mean pressure, over the mean pressure.
"""

from __future__ import annotations

import numpy as np

from erc_contact.error.coulomb.surface import CoulombSurface, PairOnSurface
from erc_contact.model.contact.trace import split

LENGTHS = (0.0, 0.01, 0.03, 0.1, 0.3)
"""Lengths l over the size of the surface [-]."""
SMALLEST = 1e-6
"""Least weight c_i [-]."""
ACCURACY = 1e-6
"""Relative accuracy of the smooth field [-]."""
SMOOTHING_STEPS = 500
"""Greatest number of conjugate gradients that make a field smooth."""


def slip_fields(pair: PairOnSurface) -> list[np.ndarray]:
    """Return fields t at the nodes, |t| <= mu, from rough to smooth.

    They are linear between the nodes. Each has the shape (n, d).
    """
    surface = pair.surface
    rough, weight = _rough(pair)
    size = float(np.ptp(surface.corners.reshape(-1, rough.shape[1]), axis=0).max())
    fields = []
    for length in LENGTHS:
        smooth = _smooth(surface, rough, weight, length * size)
        fields.append(_limit(pair, smooth))
    return fields


def _rough(pair: PairOnSurface) -> tuple[np.ndarray, np.ndarray]:
    """Return the field t0 at the nodes, and the weights c_i A_i.

    Their shapes are (n, d) and (n,).
    """
    s = pair.surface
    area, hats, pressures, shears = pair.at_points(s.degree + 1)
    shape = len(s.pieces), hats.shape[1]

    def moments(values: np.ndarray) -> np.ndarray:
        """Integrate values against the hat functions of the nodes."""
        of_pieces = np.einsum("fcq...,qm->fcm...", values, hats)
        return s.sum_up(of_pieces.reshape(*shape, *values.shape[3:]), s.pieces)

    shear = moments(area[..., None] * shears)
    pressure = moments(area * pressures)
    node_area = moments(area)
    pressure /= node_area

    # E slip/h has the unit of the pressure, which makes the two comparable.
    w_t = split(pair.displacement, s.normals).tangential
    share = np.broadcast_to(s.area[:, None], s.facets.shape)
    pull = s.sum_up(share[..., None] * pair.stiffness[:, None, None] * w_t, s.facets)
    pull /= s.sum_up(share, s.facets)[:, None]
    length = np.linalg.norm(pull, axis=1)

    by_traction = -shear / _or_one(pressure * node_area, pressure > 0)[:, None]
    by_slip = pair.least_friction()[:, None] * pull / _or_one(length, length > 0)[:, None]
    largest = max(float(pressure.max()), float(length.max())) or 1.0
    square = (np.stack([pressure, length]) / largest) ** 2
    square_sum = square.sum(axis=0)
    weighted = square[0][:, None] * by_traction + square[1][:, None] * by_slip
    rough = weighted / _or_one(square_sum, square_sum > 0)[:, None]
    mean = float(node_area @ pressure / node_area.sum()) or largest
    c = (pressure + np.minimum(length, mean)) / mean
    return _limit(pair, rough), (c + SMALLEST) * node_area


def _or_one(values: np.ndarray, positive: np.ndarray) -> np.ndarray:
    """Replace values by 1 where they are not positive, so that they divide."""
    return np.where(positive, values, 1.0)


def _smooth(
    surface: CoulombSurface, rough: np.ndarray, weight: np.ndarray, length: float
) -> np.ndarray:
    """Compute the smooth field by conjugate gradients, zero at blocked nodes."""
    free = ~surface.blocked[:, None]
    if length == 0:
        return rough * free
    stiffness = _piece_stiffness(surface, length)
    pieces = surface.pieces
    diagonal = weight + surface.sum_up(np.diagonal(stiffness, axis1=1, axis2=2), pieces)
    inverse = 1 / diagonal[:, None]

    def operator(t: np.ndarray) -> np.ndarray:
        """Apply the matrix of the minimisation, without the blocked nodes."""
        return free * (weight[:, None] * t + surface.sum_up(stiffness @ t[pieces], pieces))

    t = rough * free
    residual = free * weight[:, None] * rough - operator(t)
    step = inverse * residual
    square = first = float(np.sum(residual * step))
    for _ in range(SMOOTHING_STEPS):
        if square <= ACCURACY**2 * first:
            break
        image = operator(step)
        share = square / float(np.sum(step * image))
        t = t + share * step
        residual = residual - share * image
        before = square
        square = float(np.sum(residual * inverse * residual))
        step = inverse * residual + square / before * step
    return t


def _piece_stiffness(surface: CoulombSurface, length: float) -> np.ndarray:
    """Return the matrices of ``l^2 int grad . grad`` on the pieces, shape (P, d, d)."""
    x = surface.positions()
    pieces = surface.pieces
    edges = (x[pieces[:, 1:]] - x[pieces[:, :1]]).transpose(0, 2, 1)
    # The gradients along the surface are the rows of the pseudo-inverse.
    along = np.linalg.pinv(edges)
    gradients = np.concatenate([-along.sum(axis=1, keepdims=True), along], axis=1)
    count = len(surface.facets)
    area = np.repeat(surface.area, len(pieces) // count) * count / len(pieces)
    return (length**2 * area)[:, None, None] * (gradients @ gradients.transpose(0, 2, 1))


def _limit(pair: PairOnSurface, t: np.ndarray) -> np.ndarray:
    """Return the nearest tangential field with |t| <= mu, zero at blocked nodes."""
    _, tangential, size = split(t, pair.surface.normal)
    share = np.minimum(1.0, pair.least_friction() / np.where(size > 0, size, 1.0))
    return np.where(pair.surface.blocked[:, None], 0.0, share[:, None] * tangential)
