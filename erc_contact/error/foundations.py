"""Compliant foundations: the error in their law, and their energy.

A foundation that gives way by p/k has the energy ``psi = k/2 <w_n - g>_+^2`` of the
penetration, [.]_+ the positive part, and the complementary energy ``psi* = p^2/(2k) + g
p`` of the pressure p >= 0. Its law ``p = k <w_n - g>_+`` holds where Fenchel's
inequality is an equality,

    psi(w_n) + psi*(p) - p w_n  >=  0,                                             (F)

and the left side is the error in the law: the normal part of the contact in e^2/2
(:func:`erc_contact.error.contact_term.law_error`). For large k the foundation tends to
a rigid one: psi to the condition ``w_n <= g``, psi* to ``g p``, and the left side to
``p (g - w_n)``.

Symbols: p pressure, w_n normal displacement, g gap, k stiffness of the foundation.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from erc_contact.error.contact_integral import contact_integral
from erc_contact.mesh.quadrature import Integral
from erc_contact.model.contact_data import ContactData
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.kinks import kinks_on_facets
from erc_contact.model.model import Model
from erc_contact.model.trace import split


def foundation_energies(
    model: Model, contact: ContactOnMesh, u: fem.Function, floor: float
) -> Integral:
    """Compute the energy ``int k/2 <u_n - g>_+^2`` on each facet [force length].

    It is 0 for ghosts. The integrals may leave their share or ``floor`` unknown.
    Collective.
    """
    data = ContactData(contact, model.mesh)

    def energy(
        facet: np.ndarray, shape: np.ndarray, w: np.ndarray, n: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        w_n, _, _ = split(w, n)
        stiffness = data.stiffness(facet, x)
        assert stiffness is not None
        return 0.5 * stiffness * np.maximum(w_n - data.gap(facet, x), 0.0) ** 2

    cuts = kinks_on_facets(model, contact.data, contact.facets)
    return contact_integral(model, contact, u, energy, floor, cuts)
