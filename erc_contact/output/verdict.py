"""What an error proves, what it estimates and what it leaves open, in words.

The words follow from the scene and from numbers that the error has already; nothing is
computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from erc_contact.base.percent import percent
from erc_contact.error.constitutive import ROUND_OFF, ConstitutiveError
from erc_contact.model.maximum import Maximum

BOUND, UP_TO, ESTIMATE, OPEN = "bound", "bound up to a term", "estimate", "not known"
"""Kinds of statements."""
MEANS = {
    "loads": "loads",
    "supports": "prescribed displacements",
    "moduli": "moduli",
    "gaps": "gaps and normals",
    "friction": "friction bounds",
    "history": "slip at the end of the last step",
}
"""Parts of the oscillation in words."""


def verdict(error: ConstitutiveError) -> list[tuple[str, str]]:
    """Statements about an error, each with its kind: :data:`BOUND`, :data:`UP_TO`, :data:`ESTIMATE`, :data:`OPEN`."""
    return [
        *_of_the_bound(error),
        *_of_the_data(error),
        *_of_the_steps_before(error),
        *_of_other_solutions(error),
        _of_points(),
    ]


def _of_the_bound(error: ConstitutiveError) -> list[tuple[str, str]]:
    """What e bounds, and up to what."""
    size = f"e = {error.absolute:.4g} is {percent(error.relative)} of |sigma^ + C eps(u^)| = {error.scale:.4g}"
    rough = error.pressure_dependent
    if not rough:
        proved = (
            "This is proved, up to round-off and to integrals that are resolved at the points of quadrature."
            if error.guaranteed
            else "This is proved for the problem on this mesh with the data that the mesh carries; what differs from "
            "your data is estimated below."
        )
        return [
            (BOUND, f"{size}. e bounds the errors of u^ and of sigma^ in the energy norm. {proved}")
        ]
    term = (
        f"{size}. e bounds the errors of u^ and of sigma^ in the energy norm, up to a third term: the friction "
        f"bound of {', '.join(rough)} depends on the pressure. The term is a product of two errors and has no sign. It "
        "is of higher order, and it is not proved to be harmless."
    )
    certificate = (
        "Whether more is proved with this friction: ec.coulomb_certificate(error) computes it. A run does not, so "
        "nothing is said here."
    )
    return [(UP_TO, term), (OPEN, certificate)]


def _of_the_data(error: ConstitutiveError) -> list[tuple[str, str]]:
    """What the mesh does not carry of shape and data."""
    found, scale = [], error.scale or 1.0
    if error.domain.geometry is None:
        found.append(
            (
                OPEN,
                "The body is that of the mesh given, with its flat facets. No true shape is known to compare with.",
            )
        )
    elif error.geometry_error > ROUND_OFF * scale:
        found.append(
            (
                ESTIMATE,
                f"Flat facets of the curved body: {percent(error.geometry_error / scale)} beside e.",
            )
        )
    for name, part in asdict(error.oscillations).items():
        if part > ROUND_OFF * scale:
            words = f"What the mesh does not carry of the {MEANS[name]}: {percent(part / scale)} beside e"
            found.append((ESTIMATE, f"{words}, without constants of Korn and Poincare type."))
    return found


def _of_the_steps_before(error: ConstitutiveError) -> list[tuple[str, str]]:
    """What is left out of the error of a step of a loading history."""
    if all(contact.trace.before is None for contact in error.model.contacts):
        return []
    words = (
        "e is the error of this step given the slip of the steps before. Their errors are in that slip, and no proof "
        "sums them up. What the length of the steps costs is not in e."
    )
    return [(OPEN, words)]


def _of_other_solutions(error: ConstitutiveError) -> list[tuple[str, str]]:
    if not error.solution.singular:
        return []
    words = "The tangent of the contact problem is singular: there may be other solutions arbitrarily near."
    return [(OPEN, words)]


def _of_points() -> tuple[str, str]:
    words = (
        "Forces, pressures and stresses below are those of the admissible pair. e bounds its error in the energy norm, "
        "and not at single points. ec.resultant(error, contact, direction) gives an interval for a contact force."
    )
    return OPEN, words


def of_maxima(maxima: Mapping[str, Maximum]) -> list[tuple[str, str]]:
    """Say of maxima of a run, by their quantities, which of them grow with refinement.

    Nothing is said of one whose trend is not known.
    """
    found = []
    for quantity, maximum in maxima.items():
        if maximum.grows is None:
            continue
        words = f"The greatest {quantity}{' stress' * (quantity == 'von Mises')} is {maximum}."
        if maximum.grows:
            words += (
                " At a sharp edge the stress of linear elasticity is infinite; then this value tells the size of the "
                "elements there, not the load of the part."
            )
        found.append((OPEN if maximum.grows else ESTIMATE, words))
    return found
