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

from collections.abc import Callable

import numpy as np
from dolfinx import fem

from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.traction import ContactTraction
from erc_contact.error.contact_integral import contact_integral
from erc_contact.mesh.quadrature import Integral
from erc_contact.model.contact_data import ContactData
from erc_contact.model.foundation import pressures
from erc_contact.model.kinks import kinks_on_facets
from erc_contact.model.model import Model
from erc_contact.model.trace import split


def add_foundations(admissible: Admissible, both: np.ndarray) -> None:
    """Add the squares of compliant foundations to those of sums, in place; collective.

    They are ``int (p^ + k <w_n - g>_+)^2/k``, as ``|sigma^ + C eps(u^)|^2`` of a cell.

    Args:
        admissible: The pair.
        both: Squares of sums on each owned cell [force length].
    """
    model = admissible.model

    def square(entry: np.ndarray, pressure: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        return (pressure + stiffness * np.maximum(entry, 0.0)) ** 2 / stiffness

    for traction in admissible.tractions:
        if traction.contact.stiffness is not None:
            squares = _on_facets(model, traction, admissible.displacement, square, 0.0)
            of_cells = traction.contact.trace.share(squares.value.ravel())
            both += of_cells[: len(both)]


def foundation_energies(
    model: Model, traction: ContactTraction, u: fem.Function, floor: float
) -> Integral:
    """Compute the energy ``int k/2 <u_n - g>_+^2`` on each facet [force length].

    It is 0 for ghosts. The integrals may leave their share or ``floor`` unknown.
    Collective.
    """

    def energy(entry: np.ndarray, _: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        return 0.5 * stiffness * np.maximum(entry, 0.0) ** 2

    return _on_facets(model, traction, u, energy, floor)


def _on_facets(
    model: Model,
    traction: ContactTraction,
    u: fem.Function,
    density: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    floor: float,
) -> Integral:
    """Integrate a density of entry, pressure and stiffness on each facet; collective.

    Args:
        model: The scene on a mesh.
        traction: The traction that gives the pressure, on a compliant foundation.
        u: The displacement [length].
        density: The density at points, from arrays.
        floor: What the integrals may leave unknown [force length].
    """
    contact = traction.contact
    data = ContactData(contact, model.mesh)

    def at_points(
        facet: np.ndarray, shape: np.ndarray, w: np.ndarray, n: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        pressure = pressures(np.matmul(shape, traction.values[facet]), n)
        w_n, _, _ = split(w, n)
        stiffness = data.stiffness(facet, x)
        assert stiffness is not None
        return density(w_n - data.gap(facet, x), pressure, stiffness)

    cuts = kinks_on_facets(model, contact.data, contact.facets)
    return contact_integral(model, contact, u, at_points, floor, cuts)
