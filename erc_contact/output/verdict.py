"""Say in words what an error proves, what it estimates and what it leaves open.

The words follow from the scene and from numbers that the error has already, or that
cost little.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.numbers import ROUND_OFF
from erc_contact.model.maximum import Maximum
from erc_contact.newton.plausibility import beyond_theory
from erc_contact.scene.potential import has_potential
from namedmesh.base.percent import percent

BOUND = "bound"
"""Kind of a statement that is proved."""
BOUND_UP_TO = "bound up to a term"
"""Kind of a statement that is proved but for a term."""
ESTIMATE = "estimate"
"""Kind of a statement that is not proved."""
NOT_KNOWN = "not known"
"""Kind of a statement about what is left open."""
MEANS = {
    "loads": "loads",
    "supports": "prescribed displacements",
    "moduli": "moduli",
    "gaps": "gaps and normals",
    "friction": "friction bounds",
    "history": "slip at the end of the last step",
}
"""Parts of the oscillation in words."""


def parted(statements: Sequence[tuple[str, str]]) -> tuple[list[tuple[str, str]], list[str]]:
    """Part statements into claims with their kinds and words of what is not known."""
    claims = [statement for statement in statements if statement[0] != NOT_KNOWN]
    unknown = [words for kind, words in statements if kind == NOT_KNOWN]
    return claims, unknown


def verdict(error: ConstitutiveError) -> list[tuple[str, str]]:
    """Make statements about an error, each with its kind; collective.

    Kinds are :data:`BOUND`, :data:`BOUND_UP_TO`, :data:`ESTIMATE`, :data:`NOT_KNOWN`.
    """
    return [
        *_of_the_bound(error),
        *_of_the_data(error),
        *_of_the_steps_before(error),
        *_of_other_solutions(error),
        *[(NOT_KNOWN, str(limit)) for limit in beyond_theory(error.solution).values()],
        _of_points(error),
    ]


def _of_the_bound(error: ConstitutiveError) -> list[tuple[str, str]]:
    """Say what e bounds, and up to what."""
    norm = "|sigma^ + C eps(u^)|"
    bounds = "e bounds the errors of u^ and of sigma^ in the energy norm"
    if has_potential(error.model.scene.material):
        norm = "sqrt(2 int psi + psi* + sigma^ : eps(u^))"
        bounds = (
            "e^2/2 bounds how far the potential energy of u^ and the complementary energy of "
            "sigma^ are from their least values, together"
        )
    unit = error.solution.scene.unit("sqrt(force length)")
    size = (
        f"e = {error.absolute:.4g}{unit} is {percent(error.relative)} of {norm} = "
        f"{error.scale:.4g}{unit}"
    )
    if not error.pressure_dependent:
        if error.guaranteed:
            proved = (
                "This is proved, up to round-off and to integrals that are resolved at the points "
                "of quadrature."
            )
        else:
            proved = (
                "This is proved for the problem with the data that the mesh represents exactly; "
                "what differs from your data is estimated below."
            )
        return [(BOUND, f"{size}. {bounds}. {proved}")]
    model = error.model
    contacts = ", ".join(model.contact(name).title for name in error.pressure_dependent)
    term = (
        f"{size}. {bounds}, up to a third term: the friction bound of {contacts} depends on the "
        "pressure. The term is a product of two errors and has no sign. It is not proved to be "
        "small."
    )
    certificate = (
        "Whether more is proved with this friction: ec.coulomb_certificate(error) computes it. A "
        "run does not, so nothing is said here."
    )
    return [(BOUND_UP_TO, term), (NOT_KNOWN, certificate)]


def _of_the_data(error: ConstitutiveError) -> list[tuple[str, str]]:
    """Say what the mesh does not represent of shape and data."""
    statements = []
    scale = error.scale or 1.0
    if not error.domain.knows_shape:
        words = (
            "The body is the given mesh, with its flat facets. No true shape is known to "
            "compare with."
        )
        statements.append((NOT_KNOWN, words))
    elif error.geometry_error > ROUND_OFF * scale:
        share = percent(error.geometry_error / scale)
        words = f"Flat facets of the curved body: {share} beside e."
        statements.append((ESTIMATE, words))
    for name, part in asdict(error.oscillations).items():
        if part > ROUND_OFF * scale:
            words = (
                f"What the mesh does not represent of the {MEANS[name]}: {percent(part / scale)} "
                "beside e, without constants of Korn and Poincare type."
            )
            statements.append((ESTIMATE, words))
    return statements


def _of_the_steps_before(error: ConstitutiveError) -> list[tuple[str, str]]:
    """Say what is left out of the error of a step of a loading history."""
    if not error.model.is_later_step:
        return []
    linearised = error.model.linearised
    state = None if linearised is None else linearised.law.state
    also = ", and the state of the material that they left" if state is not None else ""
    words = (
        f"e is the error of this step given the slip of the steps before{also}. Their errors are "
        "in it, and no proof sums them up. What the length of the steps costs is not in e."
    )
    statements = [(NOT_KNOWN, words)]
    moved = 0.0 if state is None else state.moved
    if moved > ROUND_OFF:
        words = (
            f"The new mesh moved {percent(moved)} of the state of the material, in the root of the "
            "mean square. Mark refines without this."
        )
        statements.append((ESTIMATE, words))
    return statements


def _of_other_solutions(error: ConstitutiveError) -> list[tuple[str, str]]:
    """Say whether there may be other solutions."""
    if not error.solution.singular:
        return []
    words = (
        "The tangent of the contact problem is singular: there may be other solutions arbitrarily "
        "near."
    )
    return [(NOT_KNOWN, words)]


def _of_points(error: ConstitutiveError) -> tuple[str, str]:
    """Say what e leaves open of forces and stresses."""
    norm = "the energy norm"
    interval = "ec.resultant(error, contact, direction) gives an interval for a contact force."
    if has_potential(error.model.scene.material):
        norm = "energies"
        interval = "ec.potential_energy(error) gives an interval for the energy."
    words = (
        "Forces, pressures and stresses below belong to the admissible pair. e bounds its "
        f"error in {norm}, and not at single points. {interval}"
    )
    return NOT_KNOWN, words


def of_gaps(error: ConstitutiveError) -> list[tuple[str, str]]:
    """Say what linear kinematics cost where bodies keep their shapes; collective.

    Nothing is said of sides that are drawn in one place.
    """
    statements = []
    for contact in error.model.contacts:
        if contact.between is None:
            continue
        distance = error.domain.distance(*contact.side_names)
        deviation = error.gap_deviation(contact.name)
        sides = (error.force(name) for name in contact.side_names)
        moment = np.linalg.norm(sum(side.moment for side in sides))
        words = (
            f"The sides of {contact.title} are drawn up to {distance:.3g} apart. Displacements "
            "count as small: where it is closed, the gap of the law is up to "
            f"{deviation:.2g} [length] from the distance of the deformed bodies, and its tractions "
            f"act on both sides at two places, which leaves the moment {moment:.2g} in the "
            "balance."
        )
        statements.append((ESTIMATE, words))
    return statements


def of_slips(error: ConstitutiveError, shares: Mapping[str, float]) -> list[tuple[str, str]]:
    """Say of contacts that the error of their slip may be greater than eps.

    Args:
        error: The error.
        shares: Share of the slip of each of them in the energy, by their names.
    """
    statements = []
    for name, share in shares.items():
        direction = "" if error.model.space.d == 2 else ", (1.0, 0.0, 0.0)"
        words = (
            f"The slip of {error.model.contact(name).title} has about {percent(share, 2)} of the "
            f"energy. Its error may be greater than eps = {percent(error.relative)}: a run with "
            f"goal=ec.Slip({name!r}{direction}) aims at it, and has an interval for its mean."
        )
        statements.append((NOT_KNOWN, words))
    return statements


def of_maxima(maxima: Mapping[str, Maximum]) -> list[tuple[str, str]]:
    """Say of maxima of a run, by their quantities, which of them grow with refinement.

    Nothing is said of one whose trend is not known, if it lies at no singular place.
    """
    statements = []
    for quantity, maximum in maxima.items():
        if maximum.grows is None and not maximum.beside:
            continue
        name = "von Mises stress" if quantity == "von Mises" else quantity
        words = f"The greatest {name} is {maximum}."
        is_doubtful = bool(maximum.grows or maximum.beside)
        if is_doubtful:
            words += (
                " At a sharp edge the stress of linear elasticity is infinite; then this value "
                "tells the size of the elements there, not the load of the part."
            )
        statements.append((NOT_KNOWN if is_doubtful else ESTIMATE, words))
    return statements
