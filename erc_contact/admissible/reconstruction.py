"""Hold what an admissible stress is reconstructed from, and what it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from dolfinx import fem

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.elastic import CellStress
from erc_contact.admissible.facets import equilibrated_moments
from erc_contact.admissible.shared_moments import SharedMoments
from erc_contact.model.model import Model
from namedmesh.simplex import mass


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """Hold what an admissible stress is reconstructed from.

    Attributes:
        model: The scene on a mesh.
        cells: Geometry, n cells.
        around: The same with images of cells around them, see
            :mod:`erc_contact.admissible.surrounded`; F facets.
        displacement: u^ [length].
        balanced: The stress in discrete equilibrium with all tractions.
        force: Body force times volume of each cell [force], shape (n, N_(k-1), d), or
            None.
        boundary: Moments of the tractions that are given on the boundary [force], shape
            (facets, m, d).
        fixed: Components of boundary facets whose traction is not given, shape (facets,
            d).
        tighten: Greatest number of iterations that tighten the stress.
        correction: What they start from, moments of F facets [force], or None.
    """

    model: Model
    cells: CellGeometry
    around: CellGeometry
    displacement: fem.Function
    balanced: CellStress
    force: np.ndarray | None
    boundary: np.ndarray
    fixed: np.ndarray
    tighten: int
    correction: np.ndarray | None

    def first_moments(self, fixed: np.ndarray) -> np.ndarray:
        """Return moments of facet tractions that balance every cell, not yet tight.

        Args:
            fixed: As in the attribute.

        Returns:
            Moments on the first side of each facet [force], shape (F, m, d).
        """
        model, cells, around = self.model, self.cells, self.around
        body = None
        if self.force is not None:
            body = np.matmul(mass(cells.d, cells.degree, cells.degree - 1), self.force)
        body = self.balanced.as_body_force(body)
        if body is not None:
            body = around.images.vectors(body)
        # A rank has all cells around the nodes of its own cells, but not around others.
        complete = np.zeros(len(model.fixed) + around.images.more_nodes, dtype=bool)
        complete[model.space.nodes[: model.domain.owned_cells]] = True
        stress = around.images.tensors(self.balanced.in_plane)
        boundary = around.images.moments(self.boundary)
        of_facets = (boundary, around.images.of_facets(fixed))
        moment = equilibrated_moments(around, stress, body, *of_facets, complete)
        if around is not cells:
            # A rank may lack the patches at one side of a pair of facets.
            moment = SharedMoments(model.space, around).agreed(moment)
        return moment


class BulkStress(NamedTuple):
    """Hold a stress in equilibrium, and how it was made.

    Attributes:
        stress: Coefficients of the owned cells [force/area], shape (owned, d+1, N_k,
            s).
        moment: Moments of the facet tractions [force], shape (facets, m, d).
        iterations: Number of iterations that tightened it.
        correction: What they have added to the moments of F facets [force]; None
            without any.
        square: Bound of the bulk part of e^2, before bubbles are chosen [force length];
            infinite where nothing was tightened.
        missing: Greatest missing force in each owned cell, and greatest force [force].
        boundary: Moments of the tractions that it has of those that are given [force],
            shape (facets, m, d).
    """

    stress: np.ndarray
    moment: np.ndarray
    iterations: int
    correction: np.ndarray | None
    square: float
    missing: tuple[np.ndarray, np.ndarray]
    boundary: np.ndarray
