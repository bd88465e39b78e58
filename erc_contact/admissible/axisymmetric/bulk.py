"""From balanced cell stresses to the admissible stress of axisymmetric bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.admissible.axisymmetric.elements import CellEnergies, Elements, law_of_cells
from erc_contact.admissible.axisymmetric.missing import missing_forces
from erc_contact.admissible.axisymmetric.tighten import tighten_forces
from erc_contact.admissible.cells import CellGeometry, moments_of_cells
from erc_contact.admissible.elastic import elastic_coefficients, macro_places
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.reconstruction import BulkStress, Reconstruction
from erc_contact.admissible.tighten.iteration import Ending
from erc_contact.admissible.tighten.rounds import CellLaw, Tight, tightened_in_rounds
from erc_contact.model.meridian import without_axis
from erc_contact.model.space import Space
from namedmesh.simplex import mass, of_facets


def axisymmetric_bulk(given: Reconstruction) -> BulkStress:
    """Reconstruct S, with the hoop force as a body force that is free in each cell.

    The first tractions are found as in the plane, with the hoop force of the solver as
    a body force, and moved off the axis.
    """
    model, cells, around = given.model, given.cells, given.around
    owned = model.domain.owned_cells
    count = len(given.boundary)
    off = _off_axis(model.space, around)
    # Nodes on the axis have no radial equilibrium: whatever is left there is free.
    with_axis = given.fixed.copy()
    with_axis[:, 0] |= ~off[:count].any(axis=1)
    first = without_axis(given.first_moments(with_axis), off)
    force = None if given.force is None else around.images.vectors(given.force)
    elements = Elements(model.space, around, force)
    law = _law(given)

    def energies_of(law: CellLaw) -> CellEnergies:
        return elements.energies(law.elastic, around.images.matrices(law.compliance))

    def balanced(forces: np.ndarray, energies: CellEnergies) -> Tight:
        of_cells = moments_of_cells(cells, forces)[:owned]
        return Tight(forces, of_cells, elements.stresses(of_cells, energies))

    free_of_facets = around.has_second[:, None] | around.images.of_facets(given.fixed)
    free = off[..., None] & free_of_facets[:, None, :]

    def tighten(forces: np.ndarray, law: CellLaw, ending: Ending) -> Tight:
        energies = energies_of(law)
        # Patches take the mean of the moduli of a cell: of ghosts no more is known.
        of_means = energies
        if law.compliance.shape[1] > 1:
            mean = law.compliance.mean(axis=1, keepdims=True)
            of_means = energies_of(law._replace(compliance=mean))
        forces, done, square = tighten_forces(
            model.space, elements, energies, of_means.matrix, forces, free, ending
        )
        return replace(balanced(forces, energies), iterations=done, square=square)

    to_moments = mass(1, cells.degree, cells.degree)
    correction = None
    if given.tighten > 0:
        forces = first
        if given.correction is not None:
            forces = first + np.linalg.solve(to_moments, given.correction)
        tight = tightened_in_rounds(given, forces, law, tighten)
        correction = np.matmul(to_moments, tight.moment - first)
    else:
        tight = balanced(first, energies_of(law))
    return BulkStress(
        stress=tight.stress,
        moment=np.matmul(to_moments, tight.moment[:count]),
        iterations=tight.iterations,
        correction=correction,
        square=tight.square,
        missing=missing_forces(elements, tight.stress, tight.forces),
        # Springs pull at the axis, too, where sigma^ vanishes.
        boundary=np.matmul(to_moments, without_axis(given.boundary, off[:count])),
    )


def _law(given: Reconstruction) -> CellLaw:
    """Return the linear law of a body of revolution, less its hoop load."""
    model, cells = given.model, given.cells
    owned = model.domain.owned_cells
    elastic = elastic_coefficients(model, cells, given.displacement, owned)
    places = macro_places(model.space, cells, owned)
    elastic = model.hoop_load.minus(elastic, places, model.space.owned_cells)
    _, points, _ = macro_points(2, cells.degree)
    return CellLaw(elastic, law_of_cells(model.constitution.metric, cells.corners, points))


def _off_axis(space: Space, cells: CellGeometry) -> np.ndarray:
    """Tell which nodes of facets are off the axis, shape (facets, m)."""
    cell, i = np.divmod(np.maximum(cells.side[0], 0), cells.d + 1)
    return space.section.off_axis(of_facets(cells.corners[cell], i), cells.degree)
