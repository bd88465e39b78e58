"""Integrate densities of the displacement over a contact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from dolfinx import fem

from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import split
from erc_contact.model.data.quadrature import Cuts, Integral, facet_pieces, integrate, polynomials
from erc_contact.model.space import Space

type ContactDensity = Callable[
    [np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray
]
"""Gets facets (f,), shape functions (f, q, m), w^ and normals (f, q, d), points (f, q,
d); returns (f, q)."""


def contact_integral(
    space: Space,
    contact: ContactOnMesh,
    u: fem.Function,
    density: ContactDensity,
    floor: float = 0.0,
    cuts: Cuts | None = None,
) -> Integral:
    """Integrate a density of w^ since the last step over each facet of a contact.

    It is 0 for ghosts; collective.

    Args:
        space: The mesh.
        contact: The contact.
        u: u^.
        density: The density.
        floor: What the integrals may leave unknown.
        cuts: Where the density has kinks, see
            :func:`erc_contact.model.data.quadrature.integrate`.
    """
    trace = contact.trace
    of_w = trace.coefficients(trace.of(u.x.array))
    of_before = trace.coefficients(trace.of_before)

    def values(facet: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape = polynomials(space.degree, places)
        n = trace.normals_at_places(places, facet)
        s = split(np.matmul(shape, of_before[facet]), n).tangential
        w = np.matmul(shape, of_w[facet]) - s
        return density(facet, shape, w, n, x)[..., None]

    pieces = facet_pieces(space.d - 1)
    area = trace.here.owned_areas
    corners = trace.here.corners
    most = space.points_of_numbers
    return integrate(space.comm, values, corners, area, pieces, floor=floor, cuts=cuts, most=most)
