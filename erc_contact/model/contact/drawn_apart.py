"""Measure the gap between two bodies that were drawn and meshed apart.

Their facets face each other across a distance. Facets are chords of round bodies: the
distance of chords is linear between the vertices, and a pressure that follows it has a
peak at each of them. Where the true surfaces are known, the gap is their distance.

Symbols: f facets, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.trace import Trace
from erc_contact.model.space import Space


@dataclass(frozen=True, eq=False)
class DrawnApart:
    """Hold the gap between two bodies, none of bodies in one place.

    Attributes:
        of_facets: The gap between the facets [length], UFL, or None.
        beside_facets: What true surfaces add to it [length], UFL; None where they are
            not known.
        between: Vectors from the vertices of the facets to their partners of the other
            body [length], shape (f, d, d), or None.
    """

    of_facets: Ufl | None = None
    beside_facets: Ufl | None = None
    between: np.ndarray | None = None

    @property
    def gaps(self) -> list[Ufl]:
        """Return the parts of the gap, the gap of the facets first."""
        return [gap for gap in (self.of_facets, self.beside_facets) if gap is not None]


def between_surfaces(space: Space, trace: Trace) -> fem.Function | None:
    """Return how much farther apart true surfaces are than facets [length]; collective.

    Args:
        space: The mesh.
        trace: The contact.

    Returns:
        The vectors at the nodes of degree 2 of this side, P2; None where the true
        surface of neither side is known.
    """
    sides = [trace.here, trace.there]
    facets = np.concatenate([side.facets for side in sides])
    if not space.comm.allreduce(bool(space.domain.are_curved(facets).any()), MPI.LOR):
        return None
    # The offset is P2, so that its jump is known at the nodes of degree 2.
    quadratic = space if space.degree == 2 else Space(space.domain, 2)
    of_degree_2 = []
    offsets = []
    for side in sides:
        nodes = quadratic.facet_nodes(side.facets)
        of_degree_2.append(replace(side, degree=2, nodes=nodes))
        offset = space.evaluate(space.domain.offset, quadratic.facet_points, side.facets)
        offsets.append(offset)
    here, there = of_degree_2
    pairs = Trace(here, there, trace.direction)
    field = quadratic.function()
    at_nodes = field.x.array.reshape(-1, space.d)
    # Both offsets lead from facets to surfaces: what lies between surfaces grows by one
    # and falls by the other.
    farther = pairs.at_partners(offsets[1]) - offsets[0][pairs.facing]
    at_nodes[here.nodes[pairs.facing]] = farther
    return field
