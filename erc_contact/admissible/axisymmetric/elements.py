"""Stresses of the pieces of a cell of the half plane, and their complementary energy.

The in-plane stress ``S = c sigma`` is a stress of the Alfeld split as in the plane
(:mod:`erc_contact.admissible.macro`), of degree k on each piece and with continuous
tractions. Its body force is ``(-tau, c f_z)``: the hoop force tau is a polynomial of
degree k-1 on each piece, and does not depend on its neighbours. So tau balances any
radial force and moment of the tractions of a cell, and what is left of it, with the
bubbles of S, takes the amounts of least energy: at k = 1 one number, at k = 2 ten. One
condition is left for the tractions, the balance of axial forces.

Components of a stress are ``S_rr, S_zz, sqrt(2) S_rz`` and ``c sigma_tt = r tau``, a
polynomial of degree k, too. A radial body force is no part of them
(:mod:`erc_contact.model.meridian`).

At a node on the axis S has to vanish. It does so at a vertex where the tractions on all
facets vanish: in a piece then ``S n = 0`` on its facet, so that ``S = a t t``, and two
such pieces have the same traction on their common facet only if a is zero. In the
middle of an edge on the axis, at k = 2, S_zz = 0 is a condition of its own.

Symbols: n cells, m nodes of a facet, b of a polynomial of degree k-1, N_k of degree k,
x forces of facets ``|F| t`` by coefficients, y free inner amounts, c circumference, h
size of a cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from erc_contact.admissible.cells import CellGeometry, sorted_corners
from erc_contact.admissible.elastic import macro_moduli
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.reference import bubbles, reference_map
from erc_contact.mesh.quadrature import cell_pieces
from erc_contact.mesh.simplex import (
    bernstein,
    facet_vertices,
    local_facet_nodes,
    mass,
    node_vertices,
    nodes,
)
from erc_contact.model.meridian import ON_AXIS
from erc_contact.model.model import Model
from erc_contact.scene.material import mandel_basis

CHUNK = 1024
"""Number of cells whose maps are worked on at once: they stay in the cache."""
VERTICES = 3
"""Vertices, facets and pieces of a cell."""


class Maps(NamedTuple):
    """Hold the stresses of n cells as linear functions of forces and inner amounts.

    All are coefficients on the pieces, in components, shape (n, 3, N_k, 4, number).

    Attributes:
        of_facets: From x, (3, m, 2) in one.
        of_inner: From y.
        of_body: From the axial body force times volume, b coefficients.
    """

    of_facets: np.ndarray
    of_inner: np.ndarray
    of_body: np.ndarray


@dataclass(frozen=True, eq=False)
class Energies:
    """Hold the complementary energies of cells, quadratic forms of the facet forces.

    The energy ``|S - S_0|^2`` of a cell, with the least amounts y, is ``x.A x + 2 g.x +
    e``. Here S_0 is a given stress.

    Attributes:
        matrix: A, shape (n, 6 m, 6 m).
        slope: g of the owned cells, shape (owned, 6 m).
        least: e of the owned cells, shape (owned,).
        inner_of_facets: What the least amounts y of cells have of x: they are
            ``-inner_of_facets x - inner``, shape (n, amounts, 6 m).
        inner: Shape (owned, amounts).
    """

    matrix: np.ndarray
    slope: np.ndarray
    least: np.ndarray
    inner_of_facets: np.ndarray
    inner: np.ndarray


class Elements:
    """Map facet forces of cells to stresses.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        force: Body force times volume of each cell [force], of which the axial part
            counts, shape (n, b, 2), or None.
    """

    def __init__(self, model: Model, cells: CellGeometry, force: np.ndarray | None) -> None:
        self.model = model
        self.cells = cells
        self.corners = sorted_corners(model, cells)
        radius = self.corners[..., 0]
        self.on_axis = abs(radius) <= ON_AXIS * model.domain.extent
        b = len(nodes(2, cells.degree - 1))
        self._inverse = cells.inverse
        self.force = np.zeros((len(radius), b)) if force is None else force[..., 1]

    def energies(self, elastic: np.ndarray) -> Energies:
        """Compute the energies of cells.

        Args:
            elastic: S_0 of the owned cells at the points of
                :func:`.macro.macro_points`, shape (owned, q, 4).
        """
        count = len(self.corners)
        parts = []
        compliance = macro_moduli(self.model, self.cells, count, inverse=True)
        for chunk in self._chunks(count):
            maps = self._maps(chunk)
            of_owned = slice(chunk.start, min(chunk.stop, len(elastic)))
            parts.append(self._parts(chunk, maps, compliance[chunk], elastic[of_owned]))
        return Energies(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def stresses(self, x: np.ndarray, energies: Energies) -> np.ndarray:
        """Return the stresses of the owned cells with the least energies.

        Args:
            x: Facet forces of the owned cells [force], shape (owned, 3, m, 2).
            energies: The energies.

        Returns:
            Coefficients, shape (owned, 3, N_k, 4).
        """
        owned = len(x)
        forces = x.reshape(owned, -1, 1)
        inner = energies.inner_of_facets[:owned]
        y = -np.matmul(inner, forces) - energies.inner[..., None]
        body = self.force[:owned, :, None]
        sigma = np.empty((owned, VERTICES, len(nodes(2, self.cells.degree)), 4))
        for chunk in self._chunks(owned):
            sigma[chunk] = 0.0
            for of, amounts in zip(self._maps(chunk), (forces, y, body), strict=True):
                sigma[chunk] += _times(of, amounts[chunk])[..., 0]
        return sigma

    @staticmethod
    def _chunks(count: int) -> Iterator[slice]:
        """Return slices of some cells each."""
        for start in range(0, count, CHUNK):
            yield slice(start, min(start + CHUNK, count))

    def _parts(
        self, chunk: slice, maps: Maps, compliance: np.ndarray, elastic: np.ndarray
    ) -> _Parts:
        """Eliminate the inner amounts of cells.

        Args:
            chunk: The cells, of which the first ones are owned.
            maps: Their stresses.
            compliance: C^-1 at the points, shape (n, q, 4, 4).
            elastic: S_0 of the owned cells, shape (owned, q, 4).
        """
        k = self.cells.degree
        near, _, weights = macro_points(2, k)
        volume = self.cells.volume[chunk]
        metric = compliance * (volume[:, None] * weights)[..., None, None]
        n, owned = len(volume), len(elastic)
        both = np.concatenate([maps.of_facets, maps.of_inner], axis=-1)
        at_points = _values(near, both).reshape(n, len(weights), 4, -1)
        weighted = np.matmul(metric, at_points)
        size = at_points.shape[-1]
        products = np.matmul(
            at_points.reshape(n, -1, size).swapaxes(1, 2), weighted.reshape(n, -1, size)
        )
        x = maps.of_facets.shape[-1]
        of_facets, of_inner = products[:, :x, :x], products[:, x:, x:]
        mixed = products[:, x:, :x]
        # An amount that a cell does not have stays zero.
        diagonal = np.einsum("nyy->ny", of_inner)
        diagonal[diagonal == 0.0] = 1.0
        given = _times(maps.of_body[:owned], self.force[chunk][:owned, :, None])
        offset = _values(near, given).reshape(owned, len(weights), 4) - elastic
        row = offset.reshape(owned, 1, -1)
        slopes = np.matmul(row, weighted[:owned].reshape(owned, -1, size))[:, 0]
        least = (np.matmul(metric[:owned], offset[..., None])[..., 0] * offset).sum(axis=(1, 2))
        slope_x, slope_y = slopes[:, :x], slopes[:, x:]
        inner = np.linalg.solve(of_inner[:owned], slope_y[..., None])[..., 0]
        inner_of_facets = np.linalg.solve(of_inner, mixed)
        return _Parts(
            matrix=of_facets - np.matmul(mixed.swapaxes(1, 2), inner_of_facets),
            slope=slope_x - np.einsum("nyx,ny->nx", mixed[:owned], inner),
            least=least - (slope_y * inner).sum(axis=1),
            inner_of_facets=inner_of_facets,
            inner=inner,
        )

    def _maps(self, chunk: slice) -> Maps:
        """Return the stresses of some cells by forces and inner amounts."""
        cells = self.cells
        k = cells.degree
        m, b = len(nodes(1, k)), len(nodes(2, k - 1))
        n = len(cells.volume[chunk])
        table = reference_map(2, k, on_pieces=True)
        bubble = bubbles(2, k)
        J = cells.J[chunk]
        piola = _piola(J)
        N = table.shape[1]
        inputs = table.shape[3]
        # The Piola transform maps a stress from the reference cell, and forces to it.
        of_vectors = np.matmul(table.reshape(-1, 2), self._inverse[chunk])
        of_nodes = of_vectors.reshape(n, VERTICES * N, 3, 2 * inputs)
        from_forces = np.matmul(piola[:, None], of_nodes)
        from_forces = from_forces.reshape(n, VERTICES, N, 3, inputs, 2)
        of_bubbles = np.matmul(piola[:, None, None], bubble)
        of_facets = np.zeros((n, VERTICES, N, 4, 6 * m))
        of_facets[..., :3, :] = from_forces[..., : 3 * m, :].reshape(n, VERTICES, N, 3, 6 * m)
        # The radial body force is -tau, with tau |T| by its coefficients.
        hoop = -from_forces[..., 3 * m :, 0]
        of_inner = np.zeros((n, VERTICES, N, 4, 3 * b + bubble.shape[-1]))
        of_inner[..., :3, : 3 * b] = hoop
        of_inner[..., :3, 3 * b :] = of_bubbles
        of_inner[..., 3, : 3 * b] = self._hoop_stress(chunk)
        axial = from_forces[..., 3 * m :, 1].reshape(n, VERTICES, N, 3, 3, b)
        of_body = np.zeros((n, VERTICES, N, 4, b))
        of_body[..., :3, :] = np.matmul(
            axial.reshape(*axial.shape[:4], 3 * b), on_pieces(k).reshape(3 * b, b)
        )
        return self._balanced(chunk, of_facets, of_inner, of_body)

    def _hoop_stress(self, chunk: slice) -> np.ndarray:
        """Return the coefficients of ``r tau`` from ``tau |T|``, (n, 3, N_k, 3 b)."""
        k = self.cells.degree
        radius = self.corners[chunk, :, 0]
        volume = self.cells.volume[chunk]
        n, b = len(volume), len(nodes(2, k - 1))
        of_pieces = np.matmul(cell_pieces(2), radius[:, None, :, None])[..., 0]
        of_pieces /= volume[:, None, None]
        table = times_linear(k)
        products = np.tensordot(of_pieces, table, axes=(2, 1))
        result = np.zeros((n, VERTICES, products.shape[2], VERTICES, b))
        for piece in range(VERTICES):
            result[:, piece, :, piece] = products[:, piece]
        return result.reshape(n, VERTICES, products.shape[2], VERTICES * b)

    def _balanced(
        self, chunk: slice, of_facets: np.ndarray, of_inner: np.ndarray, of_body: np.ndarray
    ) -> Maps:
        """Choose inner amounts that balance radial force and moment of cells.

        Args:
            chunk: The cells.
            of_facets: Stresses by x.
            of_inner: Stresses by ``tau |T|`` and bubbles, not yet balanced.
            of_body: Stresses by the axial body force.
        """
        by_facets, by_inner, by_body = self._conditions(chunk, of_inner.shape[-1])
        # Cells with an edge on the axis have a condition more from degree 2 on.
        on_edge = self.on_axis[chunk].sum(axis=1) == 2
        has_more = on_edge & (self.cells.degree > 1)
        # The amounts that are left are as many for all cells: those that S_zz takes
        # from a cell at the axis are zero there.
        amounts = of_inner.shape[-1] - by_inner.shape[1]
        n = len(of_facets)
        particular_x = np.empty((n, of_inner.shape[-1], of_facets.shape[-1]))
        particular_b = np.empty((n, of_inner.shape[-1], of_body.shape[-1]))
        kernel = np.zeros((n, of_inner.shape[-1], amounts))
        for chosen in (~has_more, has_more):
            if not chosen.any():
                continue
            rows = [by_inner[chosen], by_facets[chosen], by_body[chosen]]
            if has_more[chosen].any():
                of_axis = self._on_axis_edges(chunk, chosen, (of_inner, of_facets, of_body))
                rows = [np.concatenate(pair, axis=1) for pair in zip(rows, of_axis, strict=True)]
            count = rows[0].shape[1]
            q, r = np.linalg.qr(rows[0].swapaxes(1, 2), mode="complete")
            # rows w = -data: w = -Q_1 R^-T data
            to_amounts = -np.linalg.solve(
                r[:, :count].swapaxes(1, 2), np.concatenate(rows[1:], axis=2)
            )
            particular = np.matmul(q[:, :, :count], to_amounts)
            particular_x[chosen] = particular[..., : of_facets.shape[-1]]
            particular_b[chosen] = particular[..., of_facets.shape[-1] :]
            kernel[chosen, :, : q.shape[2] - count] = q[:, :, count:]
        return Maps(
            of_facets + _times(of_inner, particular_x),
            _times(of_inner, kernel),
            of_body + _times(of_inner, particular_b),
        )

    def _conditions(self, chunk: slice, amounts: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the balance of radial force and of moment over the size of each cell.

        Returns:
            Rows for x, for the inner amounts, and for the axial body force, shapes (n,
            2, number).
        """
        k = self.cells.degree
        m, b = len(nodes(1, k)), len(nodes(2, k - 1))
        corners = self.corners[chunk]
        about = corners - corners[:, :1]
        about = about - about.mean(axis=1, keepdims=True)
        about = about / abs(about).max(axis=(1, 2), keepdims=True)
        n = len(about)
        by_facets = np.zeros((n, 2, 3, m, 2))
        by_facets[:, 0, :, :, 0] = 1 / m
        on_facets = np.einsum("am,nfai->nfmi", mass(1, 1, k), about[:, facet_vertices(2)])
        by_facets[:, 1, :, :, 0] = -on_facets[..., 1]
        by_facets[:, 1, :, :, 1] = on_facets[..., 0]
        by_inner = np.zeros((n, 2, amounts))
        by_inner[:, 0, : 3 * b] = -1 / (3 * b)
        of_pieces = np.einsum("piv,nv->npi", cell_pieces(2), about[..., 1])
        by_inner[:, 1, : 3 * b] = (of_pieces @ mass(2, 1, k - 1)).reshape(n, -1) / 3
        by_body = np.zeros((n, 2, b))
        by_body[:, 1] = about[..., 0] @ mass(2, 1, k - 1)
        return by_facets.reshape(n, 2, -1), by_inner, by_body

    def _on_axis_edges(
        self, chunk: slice, chosen: np.ndarray, maps: tuple[np.ndarray, ...]
    ) -> list[np.ndarray]:
        """Return S_zz amid the edge on the axis of cells, shapes (n, 1, s)."""
        facet = self.on_axis[chunk][chosen].argmin(axis=1)
        middle = local_facet_nodes(2, self.cells.degree)[facet, -1]
        rows = []
        for stresses in maps:
            of_edges = stresses[chosen][np.arange(len(facet)), facet, middle, 1]
            scale = abs(maps[0][chosen][np.arange(len(facet)), facet, middle, 1]).max(axis=1)
            rows.append((of_edges / scale[:, None])[:, None])
        return rows


class _Parts(NamedTuple):
    """Hold the :class:`Energies` of some cells."""

    matrix: np.ndarray
    slope: np.ndarray
    least: np.ndarray
    inner_of_facets: np.ndarray
    inner: np.ndarray


def _values(near: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Evaluate coefficients (n, 3, N_k, ...) at points of pieces (n, 3, q, ...)."""
    n, pieces, N = coefficients.shape[:3]
    flat = coefficients.reshape(n * pieces, N, -1)
    return np.matmul(near, flat).reshape(n, pieces, len(near), *coefficients.shape[3:])


def _times(maps: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Multiply maps (n, 3, N_k, 4, a) and matrices (n, a, z)."""
    n, *shape, a = maps.shape
    return np.matmul(maps.reshape(n, -1, a), matrix).reshape(n, *shape, matrix.shape[2])


def _piola(J: np.ndarray) -> np.ndarray:
    """Return the Piola transform of symmetric tensors, Mandel components (n, 3, 3)."""
    basis = mandel_basis(2)
    images = np.matmul(np.matmul(J[:, None], basis), J.swapaxes(1, 2)[:, None])
    determinant = abs(np.linalg.det(J))
    components = np.matmul(basis.reshape(3, 4), images.reshape(-1, 3, 4).swapaxes(1, 2))
    return np.asarray(components / determinant[:, None, None])


@cache
def on_pieces(k: int) -> np.ndarray:
    """Return a polynomial of degree k-1 of the cell on its pieces, shape (3, b, b)."""
    tables = []
    for piece in cell_pieces(2):
        places = np.column_stack([1 - nodes(2, k - 1).sum(axis=1), nodes(2, k - 1)]) @ piece
        # Degree k-1 is at most 1: values are coefficients.
        tables.append(bernstein(2, k - 1, places[:, 1:]))
    return np.array(tables)


@cache
def times_linear(k: int) -> np.ndarray:
    """Return the product of a linear function and a polynomial of degree k-1.

    Returns:
        Shape (N_k, 3, b): coefficient of degree k, vertex, coefficient of degree k-1.
    """
    table = np.zeros((len(nodes(2, k)), 3, len(nodes(2, k - 1))))
    for node, (a, b) in enumerate(node_vertices(2, k)):
        if k == 1:
            table[node, a, 0] = 1.0
        else:
            table[node, a, b] += 0.5
            table[node, b, a] += 0.5
    return table
