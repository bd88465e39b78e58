"""Fields t on a contact surface: mu times a direction of slip, continuous, at various smoothness.

Where the body slips t should be mu times the direction of slip, where it sticks
``-r^_t/|r^_n|``; the two are one where slip and traction are opposite, as the law
wants. At each node t0 is the mean of both, with the squares of the pressure p and of
``E |slip|/h`` as weights: a slip that is less than ``p h/E`` is an error of the mesh.
Where slip or traction change from node to node, a smoother t makes the coupling
smaller, at the price of terms that measure by how much t misses. A smoother t minimises

    sum_i c_i |t_i - t0_i|^2 A_i + l^2 int |grad t|^2

on the surface, with A_i the area of a node, l a length, and c_i its p and ``E
|slip|/h``, not above the mean pressure, over the mean pressure.
"""

from __future__ import annotations

import numpy as np

from erc_contact.error.surface import PairOnSurface, Surface
from erc_contact.model.trace import split

LENGTHS = (0.0, 0.01, 0.03, 0.1, 0.3)
"""Lengths l over the size of the surface [-]."""
SMALLEST = 1e-6
"""Least weight c_i [-]."""
ACCURACY = 1e-6
"""Relative accuracy of the smooth field [-]."""
STEPS = 500
"""Greatest number of conjugate gradients that make a field smooth."""


def slip_fields(pair: PairOnSurface) -> list[np.ndarray]:
    """Fields t at the nodes, |t| <= mu, linear between them, from rough to smooth; each of shape (M, d)."""
    surface, (rough, weight) = pair.surface, _rough(pair)
    size = float(np.ptp(surface.corners.reshape(-1, rough.shape[1]), axis=0).max())
    return [_limited(pair, _smooth(surface, rough, weight, length * size)) for length in LENGTHS]


def _rough(pair: PairOnSurface) -> tuple[np.ndarray, np.ndarray]:
    """The field t0 at the nodes, shape (M, d), and the weights c_i A_i, shape (M,)."""
    s = pair.surface
    area, hats, pressures, shears = pair.at_points(s.degree + 1)
    shape = len(s.pieces), hats.shape[1]

    def moments(values: np.ndarray) -> np.ndarray:
        return s.summed(
            np.einsum("fcq...,qm->fcm...", values, hats).reshape(*shape, *values.shape[3:]),
            s.pieces,
        )

    shear, pressure, of_nodes = (
        moments(area[..., None] * shears),
        moments(area * pressures),
        moments(area),
    )
    pressure /= of_nodes
    _, w_t, _ = split(pair.displacement, s.direction[:, None, :])
    share = np.broadcast_to(s.area[:, None], s.facets.shape)
    pull = s.summed(share[..., None] * pair.stiffness[:, None, None] * w_t, s.facets)
    pull /= s.summed(share, s.facets)[:, None]
    length = np.linalg.norm(pull, axis=1)
    by_traction = -shear / np.where(pressure > 0, pressure * of_nodes, 1.0)[:, None]
    by_slip = pair.least_friction()[:, None] * pull / np.where(length > 0, length, 1.0)[:, None]
    largest = max(float(pressure.max()), float(length.max())) or 1.0
    square = (np.stack([pressure, length]) / largest) ** 2
    both = square.sum(axis=0)
    rough = (square[0][:, None] * by_traction + square[1][:, None] * by_slip) / np.where(
        both > 0, both, 1.0
    )[:, None]
    mean = float(of_nodes @ pressure / of_nodes.sum()) or largest
    c = (pressure + np.minimum(length, mean)) / mean
    return _limited(pair, rough), (c + SMALLEST) * of_nodes


def _smooth(surface: Surface, rough: np.ndarray, weight: np.ndarray, length: float) -> np.ndarray:
    """The smooth field, zero at blocked nodes, by conjugate gradients."""
    free = ~surface.blocked[:, None]
    if length == 0:
        return rough * free
    x, pieces = surface.positions(), surface.pieces
    edges = (x[pieces[:, 1:]] - x[pieces[:, :1]]).transpose(0, 2, 1)
    along = np.linalg.pinv(edges)
    gradients = np.concatenate([-along.sum(axis=1, keepdims=True), along], axis=1)
    area = (
        np.repeat(surface.area, len(pieces) // len(surface.facets))
        * len(surface.facets)
        / len(pieces)
    )
    stiffness = (length**2 * area)[:, None, None] * (gradients @ gradients.transpose(0, 2, 1))
    inverse = (
        1 / (weight + surface.summed(np.diagonal(stiffness, axis1=1, axis2=2), pieces))[:, None]
    )

    def operator(t: np.ndarray) -> np.ndarray:
        return free * (weight[:, None] * t + surface.summed(stiffness @ t[pieces], pieces))

    t = rough * free
    rest = free * weight[:, None] * rough - operator(t)
    step = inverse * rest
    square = first = float(np.sum(rest * step))
    for _ in range(STEPS):
        if square <= ACCURACY**2 * first:
            break
        image = operator(step)
        share = square / float(np.sum(step * image))
        t, rest = t + share * step, rest - share * image
        before, square = square, float(np.sum(rest * inverse * rest))
        step = inverse * rest + square / before * step
    return t


def _limited(pair: PairOnSurface, t: np.ndarray) -> np.ndarray:
    """The nearest tangential field with |t| <= mu, zero at blocked nodes."""
    _, tangential, size = split(t, pair.surface.normal)
    share = np.minimum(1.0, pair.least_friction() / np.where(size > 0, size, 1.0))
    return np.where(pair.surface.blocked[:, None], 0.0, share[:, None] * tangential)
