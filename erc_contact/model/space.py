"""A domain with the displacement's space on it: nodes, facets, measures. It knows nothing of a scene.

Symbols: d dimension, k degree, V continuous vector P_k, N nodes of a cell, m nodes of a
facet, x position [length].
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial
from typing import Any, Protocol

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.partition import check_shape
from erc_contact.mesh.simplex import (
    at_nodes,
    coefficients,
    facet_vertices,
    lattice,
    measures,
    node_between,
    node_vertices,
    nodes,
)
from erc_contact.model.expressions import evaluate
from erc_contact.model.trace import Side

SAMPLES = 12
"""Number of parts of a facet's edge between the samples of data that vary along it."""


class OnFacets(Protocol):
    """Anything that lives on facets, as a contact does."""

    @property
    def facets(self) -> np.ndarray:
        """Pairs (cell, local facet), shape (f, 2)."""


class Space:
    """The displacement's space on a domain.

    Args:
        domain: The mesh with names.
        degree: Degree k of the displacement, 1 or 2.

    Attributes:
        V: Continuous vector P_k space.
        nodes: Block degrees of freedom of each cell, vertices first, ghosts included,
            shape (cells, N).
        vertices: The first ones of these, at the vertices, shape (cells, d+1).
        x: Position, UFL.
        n: Outward normal of the boundary, UFL.
        dx: Measure of the cells.
        ds: Measure of the boundary with the tags of its parts.

    Raises:
        InputError: If the degree is not 1 or 2, or cells are flat or folded.
    """

    def __init__(self, domain: Domain, degree: int) -> None:
        if degree not in (1, 2):
            raise InputError(f"degree is {degree!r}; allowed are 1 and 2.")
        self.domain, self.degree = domain, degree
        self.mesh, self.d = domain.mesh, domain.dim
        self.comm = self.mesh.comm
        check_shape(self.mesh)
        self.x = ufl.SpatialCoordinate(self.mesh)
        self.n = ufl.FacetNormal(self.mesh)
        self.V = self.function().function_space
        self.nodes = self.V.dofmap.list
        self.vertices = self.nodes[:, : self.d + 1]
        self._local_facets = facet_vertices(self.d)
        self._facet_vertices = self._ordered_vertices()
        self.ds = ufl.Measure("ds", domain=self.mesh, subdomain_data=domain.facet_tags)
        self.dx = ufl.Measure("dx", domain=self.mesh)

    def function(self) -> fem.Function:
        """A new Function of V, zero everywhere."""
        return self.domain.function("Lagrange", self.degree, (self.d,))

    @property
    def owned_cells(self) -> np.ndarray:
        """The numbers of the cells of this rank."""
        return np.arange(self.domain.owned_cells, dtype=np.int32)

    def owned(self, facets: np.ndarray) -> np.ndarray:
        """Which boundary facets (n, 2) this rank owns, shape (n,): the facets of the cells that it owns."""
        return facets[:, 0] < self.domain.owned_cells

    @property
    def node_count(self) -> int:
        """Number of nodes of this rank, ghosts included."""
        return self.V.dofmap.index_map.size_local + self.V.dofmap.index_map.num_ghosts

    @property
    def facet_points(self) -> np.ndarray:
        """Reference points of the nodes of a facet, shape (m, d-1)."""
        return nodes(self.d - 1, self.degree)

    @property
    def facet_samples(self) -> np.ndarray:
        """Reference points of a fine sampling of a facet, its edges included, shape (q, d-1)."""
        return lattice(self.d - 1, SAMPLES)

    @property
    def contact_degree(self) -> int:
        """Quadrature degree on contact facets. The traction has kinks there, so no rule is exact."""
        return 2 * self.degree + 2

    @property
    def nodal_rule(self) -> dict[str, Any]:
        """Metadata of a measure for quadrature at the nodes of a facet with equal weights. It decouples the nodes."""
        points = self.facet_points
        weights = np.full(len(points), 1 / (len(points) * factorial(self.d - 1)))
        return {
            "quadrature_rule": "custom",
            "quadrature_points": points,
            "quadrature_weights": weights,
        }

    def facet_nodes(self, facets: np.ndarray) -> np.ndarray:
        """Nodes of facets given as (cell, local facet), in the order of a facet's reference nodes, shape (n, m).

        DOLFINx turns the reference facet by the global numbers of its vertices. The
        order here is found from the places of the reference vertices in each facet. So
        nodal values and :func:`evaluate` agree.
        """
        ends = self._facet_vertices[facets[:, 0], facets[:, 1]][
            :, node_vertices(self.d - 1, self.degree)
        ]
        number = node_between(self.d, self.degree)[ends[..., 0], ends[..., 1]]
        return np.take_along_axis(self.nodes[facets[:, 0]], number, axis=1)

    def global_numbers(self, nodes: np.ndarray) -> np.ndarray:
        """Global numbers of nodes of this rank."""
        return self.V.dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32)).reshape(
            nodes.shape
        )

    def global_dofs(self, dofs: np.ndarray) -> np.ndarray:
        """Global numbers of degrees of freedom of this rank, shape (n,)."""
        return self.global_numbers(dofs // self.d) * self.d + dofs % self.d

    def facet_numbers(self, facets: np.ndarray) -> np.ndarray:
        """Indices of facets given as (cell, local facet), shape (n,)."""
        of_cell = self.mesh.topology.connectivity(self.d, self.d - 1).array.reshape(-1, self.d + 1)
        return of_cell[facets[:, 0], facets[:, 1]]

    def facet_areas(self, facets: np.ndarray) -> np.ndarray:
        """Areas of facets given as (cell, local facet) [length^(d-1)], shape (n,)."""
        return measures(self.facet_corners(facets))

    def side(self, facets: np.ndarray, modulus: Any) -> Side:
        """Make the side of a contact from facets (cell, local facet) and the modulus of the material; collective.

        Args:
            facets: The facets, ghosts included, shape (f, 2).
            modulus: The modulus [force/area], UFL.
        """
        return Side(
            facets=facets,
            nodes=self.facet_nodes(facets),
            corners=self.facet_corners(facets),
            owned=self.owned(facets),
            modulus=self.at_middles(modulus, facets[:, 0]),
            degree=self.degree,
            node_count=self.node_count,
            cell_count=self.domain.owned_cells,
        )

    def facet_corners(self, facets: np.ndarray) -> np.ndarray:
        """Vertices of facets given as (cell, local facet) in the order of the reference facet [length], (n, d, d)."""
        local = self.mesh.geometry.dofmaps[0][facets[:, 0]]
        ends = self._facet_vertices[facets[:, 0], facets[:, 1]]
        return self.mesh.geometry.x[np.take_along_axis(local, ends, axis=1), : self.d]

    def true_places(self, facets: np.ndarray) -> np.ndarray:
        """Find the nodes of facets on the true surface; where that is unknown, on the facets; collective.

        Args:
            facets: Facets given as (cell, local facet), shape (n, 2).

        Returns:
            Positions [length], shape (n, m, d).
        """
        if self.domain.offset is None:
            return self.V.tabulate_dof_coordinates()[self.facet_nodes(facets), : self.d]
        return evaluate(self.x + self.domain.offset, self.mesh, self.facet_points, facets)

    def cell_corners(self) -> np.ndarray:
        """Vertices of all cells in DOLFINx's order [length], shape (cells, d+1, d)."""
        return self.mesh.geometry.x[self.mesh.geometry.dofmaps[0], : self.d]

    def at_middles(self, expression: Any, cells: np.ndarray) -> np.ndarray:
        """Values of a UFL expression at the middle of cells, shape (n, *s)."""
        return evaluate(expression, self.mesh, np.full((1, self.d), 1 / (self.d + 1)), cells)[:, 0]

    def extremes(self, values: np.ndarray) -> tuple[float, float]:
        """Least and greatest value over all ranks (nan is passed on); collective."""
        low = float(values.min(initial=np.inf)) if not np.isnan(values).any() else np.nan
        high = float(values.max(initial=-np.inf)) if not np.isnan(values).any() else np.nan
        lows, highs = self.comm.allgather(low), self.comm.allgather(high)
        return float(np.min(lows)), float(np.max(highs))

    def to_coefficients(
        self, values: np.ndarray, parts: Sequence[OnFacets], *, back: bool = False
    ) -> None:
        """Replace nodal values on facets by Bernstein coefficients, or back, in place.

        Args:
            values: Values at all nodes, shape (nodes, ...).
            parts: Contacts; the nodes of their facets are changed.
            back: Whether coefficients are replaced by values.
        """
        if self.degree == 1:
            return
        matrix = (at_nodes if back else coefficients)(self.d - 1, self.degree)
        facets = np.concatenate([self.facet_nodes(part.facets) for part in parts])
        values[facets] = np.matmul(matrix, values[facets])

    def _ordered_vertices(self) -> np.ndarray:
        """Local vertices of the named facets in the order of the reference facet, shape (cells, d+1, d)."""
        facets = np.concatenate([self.domain.facets(name) for name in self.domain.outer])
        vertices = self._local_facets[facets[:, 1]]
        local = np.take_along_axis(self.mesh.geometry.dofmaps[0][facets[:, 0]], vertices, axis=1)
        known = self.mesh.geometry.x[local][:, None, :, : self.d]
        found = evaluate(self.x, self.mesh, nodes(self.d - 1, 1), facets)[:, :, None, :]
        order = np.linalg.norm(found - known, axis=-1).argmin(axis=2)
        every = np.tile(self._local_facets.astype(np.int8), (len(self.nodes), 1, 1))
        every[facets[:, 0], facets[:, 1]] = np.take_along_axis(vertices, order, axis=1)
        return every
