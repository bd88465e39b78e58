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

Symbols: n cells, P points, m nodes of a facet, b of a polynomial of degree k-1, N_k of
degree k, x forces of facets ``|F| t`` by coefficients, y free inner amounts, c
circumference. The inputs of a cell are inner amounts (hoop forces ``tau |T|`` of the
pieces, then bubbles), the forces of its facets, and its axial body force.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from erc_contact.admissible.axisymmetric.kernels import BLOCK, ring_kernels
from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.macro import rule_of
from erc_contact.admissible.reference import bubbles, reference_map
from erc_contact.model.data.quadrature import cell_pieces
from erc_contact.model.law.constitution import ElasticMatrix
from erc_contact.model.meridian import ON_AXIS
from erc_contact.model.space import Space
from namedmesh.simplex import (
    barycentric,
    bernstein,
    local_facet_nodes,
    node_vertices,
    nodes,
)

VERTICES = 3
"""Vertices, facets and pieces of a cell."""


@dataclass(frozen=True, eq=False)
class CellEnergies:
    """Hold the complementary energies of cells, quadratic forms of the facet forces.

    The energy ``|S - S_0|^2`` of a cell, with the least amounts y, is ``x.A x + 2 g.x +
    e``. Here S_0 is a given stress.

    Attributes:
        matrix: A, by blocks between facets f >= g, row by row of them, shape
            (n, 6, 2 m, 2 m).
        slope: g of the owned cells, shape (owned, 6 m).
        least: e of the owned cells, shape (owned,).
        upper: What the least amounts of the owned cells have of the amounts behind
            them, of x, and of 1, shape (owned, amounts, inner amounts + 6 m + 1).
    """

    matrix: np.ndarray
    slope: np.ndarray
    least: np.ndarray
    upper: np.ndarray


class Elements:
    """Map facet forces of cells to stresses.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        force: Body force times volume of each cell [force], of which the axial part
            counts, shape (n, b, 2), or None.
    """

    def __init__(self, space: Space, cells: CellGeometry, force: np.ndarray | None) -> None:
        self.cells = cells
        self.corners = cells.corners
        self.on_axis = abs(self.corners[..., 0]) <= ON_AXIS * space.domain.extent
        b = len(nodes(2, cells.degree - 1))
        axial = np.zeros((len(self.corners), b)) if force is None else force[..., 1]
        self.force = np.ascontiguousarray(axial)

    def energies(self, elastic: np.ndarray, compliance: np.ndarray) -> CellEnergies:
        """Compute the energies of cells.

        Args:
            elastic: S_0 of the owned cells at the P points of a rule, see
                :func:`.macro.rule_of`, shape (owned, P, 4).
            compliance: C^-1 without circumference at these points [area/force], shape
                (n or 1, P or 1, 4, 4).
        """
        k = self.cells.degree
        count, owned = len(self.corners), len(elastic)
        tables = _tables(k)
        of_facet = 2 * len(nodes(1, k))
        forces = VERTICES * of_facet
        inner = _inner(k)
        matrix = np.empty((count, 6, of_facet, of_facet))
        slope = np.empty((owned, forces))
        least = np.empty(owned)
        # Radial force and moment take two amounts.
        upper = np.empty((owned, inner - 2, inner + forces + 1))
        _, points, weights = rule_of(2, k, elastic.shape[1])
        at_points, of_points = _at_points(k, len(points))
        ring_kernels()(
            "ring_energies",
            *(k, count, owned, self.corners, self.on_axis, tables.at_middles),
            *(len(points), at_points, barycentric(points), weights, of_points),
            *(*strides(compliance), compliance, self.force, np.ascontiguousarray(elastic)),
            *(matrix, slope, least, upper),
        )
        return CellEnergies(matrix, slope, least, upper)

    def stresses(self, x: np.ndarray, energies: CellEnergies) -> np.ndarray:
        """Return the stresses of the owned cells with the least energies.

        Args:
            x: Facet forces of the owned cells [force], shape (owned, 3, m, 2).
            energies: The energies.

        Returns:
            Coefficients, shape (owned, 3, N_k, 4).
        """
        k = self.cells.degree
        tables = _tables(k)
        stress = np.empty((len(x), VERTICES, len(nodes(2, k)), 4))
        ring_kernels()(
            "ring_stresses",
            *(k, len(x), self.corners, self.on_axis, tables.at_middles, tables.at_nodes),
            *(times_linear(k), self.force, energies.upper, np.ascontiguousarray(x), stress),
        )
        return stress


def law_of_cells(matrix: ElasticMatrix, corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the matrix of the material, without circumference, at points of cells.

    Args:
        matrix: The matrix.
        corners: Vertices of the first cells [length], shape (n, 3, 2).
        points: Reference points, shape (P, 2).

    Returns:
        Shape (n, P, 4, 4), with 1 in place of n or P where it does not vary.
    """
    numbers = np.arange(len(corners), dtype=np.int32)
    places = np.matmul(barycentric(points), corners)
    return np.ascontiguousarray(matrix.of_material(places, numbers))


def strides(matrices: np.ndarray) -> tuple[int, int]:
    """Return how far matrices (n or 1, P or 1, s, s) of the next cell and point are."""
    n, points, s, _ = matrices.shape
    return (points * s * s if n > 1 else 0), (s * s if points > 1 else 0)


class _Tables(NamedTuple):
    """Hold stresses of the reference cell for each input, as its two components.

    Rows are filled up with zeros to whole blocks.

    Attributes:
        at_nodes: Coefficients of the pieces, shape (3 N_k, 3, 2, inputs).
        at_middles: Stress amid the facets, shape (3, 3, 2, inputs).
    """

    at_nodes: np.ndarray
    at_middles: np.ndarray


@cache
def _tables(k: int) -> _Tables:
    """Return the tables of a degree."""
    table = reference_map(2, k, on_pieces=True)
    bubble = bubbles(2, k)
    m, b = len(nodes(1, k)), len(nodes(2, k - 1))
    of_facets = np.repeat(table[..., : 3 * m, :], 2, axis=-2)
    of_pieces = table[..., 3 * m :, :]
    # Bubbles are no vectors: their first component is all of them.
    of_bubbles = np.stack([bubble, np.zeros_like(bubble)], axis=-1)
    of_body = np.einsum("pnsbi,bc->pnsci", of_pieces, on_pieces(k).reshape(3 * b, b))
    inputs = np.concatenate([of_pieces, of_bubbles, of_facets, of_body], axis=-2)
    to_blocks = [(0, 0)] * 4 + [(0, -inputs.shape[-2] % BLOCK)]
    at_nodes = np.pad(inputs.swapaxes(-1, -2), to_blocks)
    middles = at_nodes[np.arange(VERTICES), local_facet_nodes(2, k)[:, -1]]
    return _Tables(
        at_nodes=np.ascontiguousarray(at_nodes),
        at_middles=np.ascontiguousarray(middles),
    )


@cache
def _at_points(k: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return stresses of the reference cell at the points of a rule for each input.

    Returns:
        The stresses, of :class:`_Tables`, shape (count, 3, 2, inputs), and the hoop
        force of a piece at its points, shape (count/3, b).
    """
    shape, points, _ = rule_of(2, k, count)
    at_nodes = _tables(k).at_nodes
    stresses = np.tensordot(shape, at_nodes, axes=(1, 1)).swapaxes(0, 1)
    in_piece = barycentric(points[: len(shape)]) @ np.linalg.inv(cell_pieces(2)[0])
    of_points = bernstein(2, k - 1, in_piece[:, 1:])
    return np.ascontiguousarray(stresses), np.ascontiguousarray(of_points)


def _inner(k: int) -> int:
    """Return the number of inner amounts of a cell, before they are balanced."""
    return 3 * len(nodes(2, k - 1)) + bubbles(2, k).shape[-1]


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
