"""From balanced cell stresses to the admissible stress of a body in plane or space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.admissible.cells import force_coefficients, moments_of_cells
from erc_contact.admissible.elastic import elastic_coefficients, macro_moduli
from erc_contact.admissible.images import NoImages
from erc_contact.admissible.macro import macro_stress
from erc_contact.admissible.reconstruction import BulkStress, Reconstruction
from erc_contact.admissible.tighten.complementary import relax
from erc_contact.admissible.tighten.iteration import Ending, tighten_moments
from erc_contact.admissible.tighten.rounds import CellLaw, Tight, tightened_in_rounds
from erc_contact.admissible.unbalanced import unbalanced_cells
from erc_contact.model.model import Model


def _turning(model: Model, images: NoImages) -> np.ndarray | None:
    """Number the loose faces that turn freely on their facets, see :class:`.Patches`.

    Args:
        model: The scene on a mesh.
        images: What images of facets have.
    """
    d = model.space.d
    faces = [face for face in model.loose_faces if face.free[d:].any()]
    if not faces:
        return None
    turning = np.zeros(model.space.facet_count, dtype=np.int32)
    for number, face in enumerate(faces, start=1):
        turning[model.space.facet_numbers(face.facets)] = number
    return images.of_facets(turning)


def plane_bulk(given: Reconstruction) -> BulkStress:
    """Reconstruct the stress of a body in the plane or in 3D."""
    model, cells, force = given.model, given.cells, given.force
    owned = model.domain.owned_cells
    first = given.first_moments(given.fixed)
    # From degree 2 on, the tractions leave the bubbles of sigma^ to be chosen.
    has_bubbles = model.space.degree > 1
    law = None
    if given.tighten > 0 or has_bubbles:
        elastic = elastic_coefficients(model, cells, given.displacement, owned)
        law = CellLaw(elastic, macro_moduli(model, cells, len(cells.nodes), inverse=True))

    def balanced(moment: np.ndarray, law: CellLaw | None) -> Tight:
        forces = force_coefficients(moments_of_cells(cells, moment)[:owned], model.space.degree)
        stress = macro_stress(cells, owned, given.balanced.in_plane, forces, force)
        if has_bubbles and law is not None:
            stress = relax(cells, stress, *law)
        return Tight(moment, forces, stress)

    around = given.around
    free = around.has_second[:, None] | around.images.of_facets(given.fixed)
    turning = _turning(model, around.images)

    def tighten(moment: np.ndarray, law: CellLaw, ending: Ending) -> Tight:
        of_law = law.elastic, around.images.matrices(law.compliance)
        moment, done, square = tighten_moments(
            model.space, around, moment, force, free, turning, *of_law, ending
        )
        return replace(balanced(moment, law), iterations=done, square=square)

    correction = None
    if given.tighten > 0 and law is not None:
        moment = first.copy() if given.correction is None else first + given.correction
        tight = tightened_in_rounds(given, moment, law, tighten)
        correction = tight.moment - first
    else:
        tight = balanced(first, law)
    missing = unbalanced_cells(cells, tight.stress, tight.forces, force)
    return BulkStress(
        stress=tight.stress,
        moment=tight.moment[: len(given.boundary)],
        iterations=tight.iterations,
        correction=correction,
        square=tight.square,
        missing=missing,
        boundary=given.boundary,
    )
