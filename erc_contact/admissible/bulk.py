"""From balanced cell stresses to the admissible stress of a body in plane or space."""

from __future__ import annotations

from erc_contact.admissible.cells import force_coefficients, signed
from erc_contact.admissible.elastic import elastic_coefficients, macro_moduli
from erc_contact.admissible.macro import macro_stress
from erc_contact.admissible.reconstruction import BulkStress, Reconstruction
from erc_contact.admissible.tighten.complementary import relaxed
from erc_contact.admissible.tighten.iteration import tightened
from erc_contact.admissible.unbalanced import unbalanced_cells


def plane_bulk(given: Reconstruction) -> BulkStress:
    """Reconstruct the stress of a body in the plane or in space."""
    model, cells, force = given.model, given.cells, given.force
    owned = model.domain.owned_cells
    moment = given.first_moments(given.fixed)
    # From degree 2 on, the tractions leave the bubbles of sigma^ to be chosen.
    has_bubbles = model.degree > 1
    iterations = 0
    correction = None
    square = None
    if given.tighten > 0 or has_bubbles:
        elastic = elastic_coefficients(model, cells, given.displacement, owned)
        compliance = macro_moduli(model, cells, len(cells.nodes), inverse=True)
    if given.tighten > 0:
        free = cells.has_second[:, None] | given.fixed
        untightened = moment.copy()
        if given.correction is not None:
            moment += given.correction
        moment, iterations, square = tightened(
            model, cells, moment, force, free, elastic, compliance, given.tighten
        )
        correction = moment - untightened
    forces = force_coefficients(signed(cells, moment)[:owned], model.degree)
    stress = macro_stress(cells, owned, given.balanced.in_plane, forces, force)
    if has_bubbles:
        stress = relaxed(cells, stress, elastic, compliance)
    missing = unbalanced_cells(cells, stress, forces, force)
    return BulkStress(stress, moment, iterations, correction, square, missing)
