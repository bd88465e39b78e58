"""Put the displacement's space on a domain: nodes, facets, measures.

Nothing here knows of a scene.

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
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.side import Side
from erc_contact.model.data.expressions import Everywhere, evaluate
from erc_contact.model.data.quadrature import MOST_POINTS
from erc_contact.model.section import Section
from namedmesh.base.ranks import global_numbers
from namedmesh.base.releases import cell_nodes
from namedmesh.for_solvers import Bodies, check_shape
from namedmesh.simplex import (
    at_nodes,
    barycentric,
    coefficients,
    facet_vertices,
    lattice,
    measures,
    node_between,
    node_vertices,
    nodes,
    outward_normals,
    rule,
)

IN_CELLS = (0, 0, 10, 100)
"""Number of points for each unknown at which data in cells are searched, by dimension.

The search then takes the processor about as long as the solve.
"""
ON_FACETS = (0, 0, 10, 60)
"""The same on facets, where a point takes longer and there are several searches."""
FURTHER_IN_CELLS = (0, 0, 160_000, 60_000)
"""Number of points beyond these, for the part of a solve that any mesh takes."""
FURTHER_ON_FACETS = 25_000
"""The same on facets."""
FACET_SAMPLES = 12
"""Number of parts of a facet's edge between the samples of data that vary along it."""


class OnFacets(Protocol):
    """Describe anything that lives on facets, as a contact does."""

    @property
    def facets(self) -> np.ndarray:
        """Return the pairs (cell, local facet), shape (f, 2)."""


class Space:
    """Hold the displacement's space on a domain.

    Args:
        domain: The mesh with names.
        degree: Degree k of the displacement, 1 or 2.
        section: The kind of section that the mesh is of its bodies.
        data: Number of data that vary, to share the points of searches.

    Attributes:
        section: What the bodies are of which the mesh is a section. Stresses,
            tractions, loads and stiffnesses of axisymmetric bodies are times the
            circumference, forces per length and per area of the half plane
            (``erc_contact.model.meridian``).
        axisymmetric: Whether the mesh is the half plane (r, z) of bodies of revolution.
        V: Continuous vector P_k space.
        nodes: Block degrees of freedom of each cell, vertices first, ghosts included,
            shape (cells, N).
        vertices: The first ones of these, at the vertices, shape (cells, d+1).
        x: Position, UFL.
        n: Outward normal of the boundary, UFL.
        dx: Measure of the cells.
        ds: Measure of the boundary with the tags of its parts.
        points_in_cells: At how many points of all ranks a search may evaluate data in
            cells, so that searches take no longer than the solve.
        points_on_facets: The same on the facets of a part.
        points_of_numbers: The same of a number that is asked for, once there is a pair.

    Raises:
        InputError: If the degree is not 1 or 2, or cells are flat or folded.
    """

    def __init__(
        self, domain: Bodies, degree: int, section: type[Section] = Section, data: int = 1
    ) -> None:
        if degree not in (1, 2):
            raise InputError(f"degree is {degree!r}; allowed are 1 and 2.")
        self.domain = domain
        self.degree = degree
        self.mesh = domain.mesh
        self.d = domain.dim
        self.comm = domain.comm
        check_shape(self.mesh)
        self.x = ufl.SpatialCoordinate(self.mesh)
        self.section = section(self.x, self.d, degree, domain.extent)
        self.axisymmetric = self.section.axisymmetric
        self.n = ufl.FacetNormal(self.mesh)
        self.V = self.function().function_space
        self.nodes = self.V.dofmap.list
        self.vertices = self.nodes[:, : self.d + 1]
        self._local_facets = facet_vertices(self.d)
        self._facet_vertices = self._order_vertices()
        self.ds = ufl.Measure("ds", domain=self.mesh, subdomain_data=domain.facet_tags)
        self.dx = ufl.Measure("dx", domain=self.mesh)
        unknowns = self.V.dofmap.index_map.size_global * self.d
        in_cells = IN_CELLS[self.d] * unknowns + FURTHER_IN_CELLS[self.d]
        on_facets = ON_FACETS[self.d] * unknowns + FURTHER_ON_FACETS
        self.points_in_cells = in_cells // max(data, 1)
        self.points_on_facets = on_facets // max(data, 1)
        self.points_of_numbers = max(MOST_POINTS, self.points_in_cells)

    def function(self) -> fem.Function:
        """Make a new Function of V, zero everywhere."""
        return self.domain.function("Lagrange", self.degree, (self.d,))

    def on_meridian(self, density: Ufl) -> Ufl:
        """Return a density per area or volume, on rings times the circumference."""
        return self.section.on_mesh(density)

    @property
    def owned_cells(self) -> np.ndarray:
        """Return the numbers of the cells that this rank owns."""
        return np.arange(self.domain.owned_cells, dtype=np.int32)

    def owned(self, facets: np.ndarray) -> np.ndarray:
        """Tell which boundary facets (n, 2) this rank owns, shape (n,).

        These are the facets of the cells that it owns.
        """
        return facets[:, 0] < self.domain.owned_cells

    @property
    def node_count(self) -> int:
        """Return the number of nodes of this rank, ghosts included."""
        index_map = self.V.dofmap.index_map
        return index_map.size_local + index_map.num_ghosts

    @property
    def facet_points(self) -> np.ndarray:
        """Return the reference points of the nodes of a facet, shape (m, d-1)."""
        return nodes(self.d - 1, self.degree)

    @property
    def facet_samples(self) -> np.ndarray:
        """Return fine samples of a reference facet, edges included, shape (q, d-1)."""
        return lattice(self.d - 1, FACET_SAMPLES)

    @property
    def contact_degree(self) -> int:
        """Return the quadrature degree on contact facets.

        The traction has kinks there, so no rule is exact.
        """
        return 2 * self.degree + 2

    @property
    def nodal_rule(self) -> dict[str, Any]:
        """Return metadata of a measure for quadrature at nodes with equal weights.

        It decouples the nodes.
        """
        points = self.facet_points
        weights = np.full(len(points), 1 / (len(points) * factorial(self.d - 1)))
        return {
            "quadrature_rule": "custom",
            "quadrature_points": points,
            "quadrature_weights": weights,
        }

    def facet_nodes(self, facets: np.ndarray) -> np.ndarray:
        """Return the nodes of facets in the order of a facet's reference nodes.

        DOLFINx turns the reference facet by the global numbers of its vertices. The
        order here is found from the places of the reference vertices in each facet. So
        nodal values and :func:`evaluate` agree.

        Args:
            facets: Facets given as (cell, local facet), shape (n, 2).

        Returns:
            Nodes of this rank, shape (n, m).
        """
        vertices = self.local_vertices(facets)
        # A node lies between two vertices of the facet, or twice at the same one.
        ends = vertices[:, node_vertices(self.d - 1, self.degree)]
        number = node_between(self.d, self.degree)[ends[..., 0], ends[..., 1]]
        return np.take_along_axis(self.nodes[facets[:, 0]], number, axis=1)

    def local_vertices(self, facets: np.ndarray) -> np.ndarray:
        """Return the vertices of facets in their cells, 0 to d, shape (n, d).

        They are in the order of the reference facet, as in :meth:`facet_nodes`.
        """
        return self._facet_vertices[facets[:, 0], facets[:, 1]]

    def global_numbers(self, nodes: np.ndarray) -> np.ndarray:
        """Return the global numbers of nodes of this rank, in the same shape."""
        return global_numbers(self.V.dofmap.index_map, nodes)

    def local_nodes(self, numbers: np.ndarray) -> np.ndarray:
        """Return local numbers of nodes by global numbers, -1 off this rank, (n,)."""
        return self.V.dofmap.index_map.global_to_local(numbers).astype(np.int64)

    def global_dofs(self, dofs: np.ndarray) -> np.ndarray:
        """Return the global numbers of degrees of freedom of this rank, shape (n,)."""
        return self.global_numbers(dofs // self.d) * self.d + dofs % self.d

    def find_owned(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tell which nodes this rank owns, shape (n,), and return their local numbers.

        Args:
            numbers: Global numbers of nodes, shape (n,).
        """
        first, last = self.V.dofmap.index_map.local_range
        owned = (numbers >= first) & (numbers < last)
        return owned, numbers[owned] - first

    def facet_numbers(self, facets: np.ndarray) -> np.ndarray:
        """Return the indices of facets given as (cell, local facet), shape (n,)."""
        cell_to_facet = self.mesh.topology.connectivity(self.d, self.d - 1)
        of_cells = cell_to_facet.array.reshape(-1, self.d + 1)
        return of_cells[facets[:, 0], facets[:, 1]]

    @property
    def facet_count(self) -> int:
        """Return the number of facets of this rank, ghosts included."""
        index_map = self.mesh.topology.index_map(self.d - 1)
        return index_map.size_local + index_map.num_ghosts

    def facet_areas(self, facets: np.ndarray) -> np.ndarray:
        """Compute areas of facets (cell, local facet) [length^(d-1)], shape (n,)."""
        return measures(self.facet_corners(facets))

    def facet_weights(
        self, facets: np.ndarray, points: np.ndarray, weights: np.ndarray
    ) -> np.ndarray:
        """Return the weights of a rule on facets, their areas among them, shape (f, q).

        Of an axisymmetric body they are areas of rings.

        Args:
            facets: Facets given as (cell, local facet), shape (f, 2).
            points: Reference points of the rule, shape (q, d-1).
            weights: Its weights, with the sum 1, shape (q,).
        """
        x = np.matmul(barycentric(points), self.facet_corners(facets))
        return self.section.times(self.facet_areas(facets)[:, None] * weights, x)

    def side(self, facets: np.ndarray, modulus: Ufl) -> Side:
        """Make the side of a contact; collective.

        Args:
            facets: Its facets (cell, local facet), ghosts included, shape (f, 2).
            modulus: The modulus of the material [force/area], UFL.
        """
        return Side(
            facets=facets,
            nodes=self.facet_nodes(facets),
            corners=self.facet_corners(facets),
            owned=self.owned(facets),
            modulus=self.at_middles(modulus, facets[:, 0]),
            degree=self.degree,
            node_count=self.node_count,
            cell_count=len(self.nodes),
        )

    def facet_corners(self, facets: np.ndarray) -> np.ndarray:
        """Return vertices of facets in the order of the reference facet [length].

        Args:
            facets: Facets given as (cell, local facet), shape (n, 2).

        Returns:
            Positions, shape (n, d, d).
        """
        of_cells = cell_nodes(self.mesh.geometry)[facets[:, 0]]
        vertices = self.local_vertices(facets)
        points = np.take_along_axis(of_cells, vertices, axis=1)
        return self.mesh.geometry.x[points, : self.d]

    def true_places(self, facets: np.ndarray) -> np.ndarray:
        """Find the nodes of facets on the true surface; collective.

        Where that is unknown, they are on the facets.

        Args:
            facets: Facets given as (cell, local facet), shape (n, 2).

        Returns:
            Positions [length], shape (n, m, d).
        """
        if self.domain.offset is None:
            return self.V.tabulate_dof_coordinates()[self.facet_nodes(facets), : self.d]
        return self.evaluate(self.x + self.domain.offset, self.facet_points, facets)

    def area_factor(self, part: str) -> fem.Function | None:
        """Return the area of the true surface over the area of facets [-]; collective.

        They differ by O(h^2) on a curved part, and a force per area has its resultant
        on the true surface. A cell with two facets of the part has the mean of both.

        Args:
            part: Name of the part.

        Returns:
            A factor of each cell, 1 without facets of the part; None on a flat part.
        """
        sides = self.domain.facets(part)
        ratio = self.domain.area_ratio(sides)
        if ratio is None:
            return None
        factor = self.domain.function("DG", 0)
        flat = self.facet_areas(sides)
        sums = np.zeros((2, len(factor.x.array)))
        np.add.at(sums[0], sides[:, 0], flat)
        np.add.at(sums[1], sides[:, 0], ratio * flat)
        factor.x.array[:] = np.divide(
            sums[1], sums[0], out=np.ones_like(sums[0]), where=sums[0] > 0
        )
        factor.x.scatter_forward()
        return factor

    def cell_corners(self) -> np.ndarray:
        """Return vertices of cells in DOLFINx's order [length], (cells, d+1, d)."""
        return self.mesh.geometry.x[cell_nodes(self.mesh.geometry), : self.d]

    def cell_points(self, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the places of reference points (q, d) in cells [length], (n, q, d)."""
        return np.matmul(barycentric(points), self.cell_corners()[cells])

    def cell_rule(self, degree: int) -> tuple[np.ndarray, np.ndarray]:
        """Return points of a rule in the owned cells, and weights with their volumes.

        Args:
            degree: Degree of the polynomials that it integrates exactly.

        Returns:
            Points [length], shape (n, q, d), and weights [length^d], shape (n, q); of
            an axisymmetric body they are volumes of rings.
        """
        points, weights = rule(self.d, degree)
        x = self.cell_points(points, self.owned_cells)
        volumes = measures(self.cell_corners()[self.owned_cells])[:, None] * weights
        return x, self.section.times(volumes, x)

    def indicator(self, cells: np.ndarray) -> fem.Function:
        """Return the function that is 1 in some cells and 0 in all others."""
        indicator = self.domain.function("DG", 0)
        indicator.x.array[cells] = 1.0
        return indicator

    def sides_of_joint(self, names: tuple[str, ...]) -> list[fem.Function]:
        """Return the indicators of the regions on both sides of a joint.

        Args:
            names: Names of its parts, which are glued.
        """
        assert self.domain.cell_tags is not None
        tags = self.domain.cell_tags
        sides = []
        for name in names:
            of_side = np.zeros(len(tags.values), dtype=bool)
            for interface in self.domain.interfaces:
                if name in interface.names:
                    regions = interface.regions[interface.names.index(name)]
                    of_side |= np.isin(tags.values, regions)
            sides.append(self.indicator(tags.indices[of_side]))
        return sides

    def outward_normals(self, facets: np.ndarray) -> np.ndarray:
        """Compute the outward unit normals of facets (cell, local facet), (n, d)."""
        return outward_normals(self.cell_corners()[facets[:, 0]], facets[:, 1])

    def evaluate(self, expression: Ufl, points: np.ndarray, entities: np.ndarray) -> np.ndarray:
        """Evaluate a UFL expression on its mesh, see :func:`.expressions.evaluate`."""
        return evaluate(expression, self.mesh, points, entities)

    def everywhere(self, expression: Ufl) -> Everywhere:
        """Make a function of points and cells of a UFL expression."""
        return Everywhere(expression, self.mesh)

    def at_middles(self, expression: Ufl, cells: np.ndarray) -> np.ndarray:
        """Evaluate a UFL expression at the middle of cells, shape (n, *s)."""
        middle = np.full((1, self.d), 1 / (self.d + 1))
        return self.evaluate(expression, middle, cells)[:, 0]

    def extremes(self, values: np.ndarray) -> tuple[float, float]:
        """Return the least and the greatest value of all ranks, or nan; collective."""
        low = high = np.nan
        if not np.isnan(values).any():
            low = float(values.min(initial=np.inf))
            high = float(values.max(initial=-np.inf))
        # Minimum and maximum of numpy pass nan on, MPI's operations need not.
        lows = self.comm.allgather(low)
        highs = self.comm.allgather(high)
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
        transform = at_nodes if back else coefficients
        matrix = transform(self.d - 1, self.degree)
        facets = np.concatenate([self.facet_nodes(part.facets) for part in parts])
        values[facets] = np.matmul(matrix, values[facets])

    def _order_vertices(self) -> np.ndarray:
        """Find local vertices of named facets in the order of the reference facet.

        Returns:
            Shape (cells, d+1, d); other facets keep the order of the cell.
        """
        none = np.empty((0, 2), dtype=np.int32)
        of_parts = [self.domain.facets(name) for name in self.domain.outer]
        facets = np.concatenate([none, *of_parts, *self.domain.tied_sides])
        vertices = self._local_facets[facets[:, 1]]
        local = np.take_along_axis(cell_nodes(self.mesh.geometry)[facets[:, 0]], vertices, axis=1)
        places = self.mesh.geometry.x[local][:, None, :, : self.d]
        # The position at a vertex of the reference facet tells which vertex it is.
        reference_places = self.evaluate(self.x, nodes(self.d - 1, 1), facets)
        distance = np.linalg.norm(reference_places[:, :, None, :] - places, axis=-1)
        order = distance.argmin(axis=2)
        of_cells = np.tile(self._local_facets.astype(np.int8), (len(self.nodes), 1, 1))
        of_cells[facets[:, 0], facets[:, 1]] = np.take_along_axis(vertices, order, axis=1)
        return of_cells
