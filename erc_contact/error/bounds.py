"""Certified bounds on single numbers.

These are the resultant of a contact traction, the energy, and the work of the loads.
The error of an admissible pair bounds the distance to both of its fields (no friction,
or a given bound b):

    |sigma - sigma^|^2 + |sigma - C eps(u^)|^2 <= e^2,

so with the middle ``sigma_m = (sigma^ + C eps(u^))/2``

    |sigma - sigma_m|^2 <= rho^2 = e^2/2 - bulk^2/4                                (a)

by the parallelogram identity, with ``bulk = |sigma^ - C eps(u^)|``. (rho = e/2 where
the contact part of e is zero.) For any continuous phi that is zero where a support
holds, the work of the tractions on all contacts is ``int r.phi = (sigma, eps(phi)) -
f(phi) - F(phi)``. Hence

    | int r.phi - ( ((sigma^, eps(phi)) + a(u^, phi))/2 - f(phi) - F(phi) ) |
        <=  rho |phi|                                                              (b)

in energy norms. Let phi equal the direction a on one contact, in the components that
its traction can have there, and do no work on the other contacts. Then (b) bounds the
resultant ``int r.a``. The phi of least energy, which takes one elastic solve, gives the
best bounds. A rigid motion that no support holds has no energy; the resultant then
follows from the loads alone.

Without friction or with Tresca friction, u minimises the potential energy J, and
``J(u^) - J(u) <= e^2/2``: this bound is of second order in e. The bounds (b) are of
first order. For bounds of second order one would need a dual problem whose contact set
is certain.

``guaranteed`` means that the interval is proved, up to round-off and to integrals that
are resolved at the points of quadrature (:mod:`erc_contact.model.data.quadrature`).
This needs

- no friction, or Tresca friction: if the bound depends on the pressure, (a) has a
  further term of no sign;
- no oscillation (:mod:`erc_contact.error.oscillation`): sigma^ balances the loads
  themselves, and u^ and r^ satisfy supports, gaps, normals and friction bounds at every
  point. A pair that is admissible for other data bounds another problem;
- integrals with the true moduli, gaps and bounds, not only at the points of a fixed
  rule. What they leave unknown widens the interval. The stiffness matrix may be
  integrated by any rule, because (a) holds for any u^.

Otherwise the same numbers are estimates. Resultants that follow from rigid motions need
only the integrals of the loads.

Nothing is guaranteed for a curved body whose flat facets change the energy; an estimate
of this change is then added to e^2. If a body is known only as a mesh, the bounds hold
for the body with flat facets.

Symbols: V continuous P_k displacements, J(v) = a(v, v)/2 - f(v) - F(v) + int b |v_t -
s| with Tresca's friction bound b; s is the tangential displacement at the end of the
last step of a history, which is zero without history. The energies of springs and of
compliant foundations are part of J; where these are tangentially compliant, b acts on
the slip alone.

Source: Prager, Synge, Quart. Appl. Math. 5 (1947), for (a) without contact; Coorevits,
Hild, Hjiaj, (16), for e.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.error.bolts import work_on_jumps
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.laws import UNKNOWN_SHARE
from erc_contact.error.lifting import lifting
from erc_contact.error.load_work import load_work
from erc_contact.error.numbers import ROUND_OFF, Bounds
from erc_contact.error.runs import Run, error_of
from erc_contact.error.works import (
    elastic_work,
    foundation_energy,
    friction_work,
    strain_energy,
    strain_work,
    stress_work,
)
from erc_contact.scene.potential import BY_FORCE, refuse_potential
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload

RIGID_ENERGY = 1e-8
"""Energy norm of phi below which it is a rigid motion [-].

It is relative to the energy norm of strains of size one in the body.
"""


def resultant(error: ConstitutiveError | Run, contact: str, direction: Sequence[float]) -> Bounds:
    """Bound the resultant ``int r.a`` of a contact traction by (b); collective.

    The traction is that on the body of the boundary part, from the foundation or the
    other body.

    Args:
        error: The error of an admissible pair, or a history, whose error is taken.
        contact: Name of the boundary part in contact.
        direction: a [-], d numbers, of any length: the normal, a tangent, or any other
            direction.

    Returns:
        An interval around the mean of the resultants of the two fields [force].

    Raises:
        InputError: If no contact has this name, or the direction is not d finite
            numbers.

    Example:
        >>> bounds = ec.resultant(error, "bottom", direction=(0.0, 1.0))
        >>> f"{bounds.value:.1f} in [{bounds.low:.1f}, {bounds.high:.1f}]"
        '25.1 in [22.0, 28.2]'
    """
    error = error_of(error)
    refuse_potential(error.solution.scene.material, "resultant()", BY_FORCE)
    pair = error.admissible
    model = pair.model
    bound = model.contact(contact)
    if bound in model.ties:
        raise InputError(
            f"resultant: {contact!r} is in a tied joint, whose force has no certified bounds; "
            "force() gives it. Ask for the reaction of a contact."
        )
    which = model.contacts.index(bound)
    a = np.asarray(direction, dtype=float)
    if a.shape != (model.space.d,) or not np.isfinite(a).all():
        raise InputError(f"The direction is {direction!r}; give {model.space.d} finite numbers.")
    if contact != bound.side_names[0]:
        # Action and reaction: the traction on the other body is the opposite one.
        a = -a
    phi, weighted = lifting(model, pair.solution.stiffness, which, a)
    of_u = elastic_work(pair, pair.displacement, phi) - strain_work(pair, phi)
    both_works = of_u + stress_work(pair, phi)
    middle = 0.5 * both_works - load_work(model, phi)
    square = elastic_work(pair, phi, phi)
    size = float(np.sqrt(max(square.value + square.bound, 0.0)))
    # If phi is a rigid motion, (b) is the balance of forces, which needs no friction
    # law.
    stiffest = model.stiffest() * model.domain.extent ** (model.space.d - 2)
    is_rigid = bool(size <= RIGID_ENERGY * np.linalg.norm(a) * np.sqrt(stiffest))
    from_loads = is_rigid and error.geometry_error <= ROUND_OFF * error.scale
    proved = middle.resolved and square.resolved and (from_loads or error.guaranteed)
    rho = np.sqrt(_square(error) / 2 - error.bulk_error**2 / 4)
    radius = float(rho * size) + middle.bound
    low = middle.value - radius
    high = middle.value + radius
    return Bounds(middle.value, low, high, proved, weighted, model.scene.unit("force"))


def potential_energy(error: ConstitutiveError | Run) -> Bounds:
    """Bound the potential energy J(u), in ``[J(u^) - e^2/2, J(u^)]``; collective.

    With loads only (supports and gaps zero) the strain energy ``a(u, u)/2`` is -J(u);
    with supports only (no loads, no gap, no friction) it is J(u). With given strains
    the strain energy in J is the energy of the elastic strain. A preload with a given
    force F adds ``- F q`` of its shift q, as loads add their work.

    Args:
        error: The error of an admissible pair, or a history, whose error is taken.

    Returns:
        An interval that ends in J(u^) [force length]. With Coulomb friction J has the
        friction bound of r^.

    Example:
        >>> bounds = ec.potential_energy(error)
        >>> bool(bounds.low <= bounds.value <= bounds.high)
        True
    """
    error = error_of(error)
    pair = error.admissible
    model = pair.model
    u = pair.displacement
    # It is small beside the interval.
    stored = strain_energy(pair, u, UNKNOWN_SHARE * error.absolute**2 / 2)
    J = stored - load_work(model, u) - work_on_jumps(pair)
    for traction in pair.tractions:
        J += friction_work(model.space, traction, u, 2 * ROUND_OFF * stored.value)
        J += foundation_energy(model.space, traction, u, 2 * ROUND_OFF * stored.value)
    facets = error.geometry_error**2 / 2
    # The round-off of strains does work on the stresses.
    unknown = J.bound + error.round_off * (error.scale + error.absolute)
    high = J.value + unknown
    low = J.value - unknown - error.absolute**2 / 2 - facets
    proved = J.resolved and error.guaranteed
    return Bounds(high, low, high + facets, proved, unit=model.scene.unit("force length"))


def work_of_loads(error: ConstitutiveError | Run) -> Bounds:
    """Bound the work of the loads, the compliance; collective.

    It is ``f(u) + F(u) = -2 J(u)``. The bounds are ``[-2 J(u^), -2 J(u^) + e^2]``.

    Args:
        error: The error, or a history, of a frictionless scene whose supports and gaps
            are zero: its admissible displacements are a cone.

    Returns:
        An interval that begins with -2 J(u^) [force length].

    Raises:
        InputError: If the scene has friction, given or mean strains, a gap or a support
            that is not zero.

    Example:
        >>> bounds = ec.work_of_loads(loaded)  # the error of a scene with loads alone
        >>> bool(bounds.low <= bounds.value <= bounds.high)
        True
    """
    error = error_of(error)
    scene = error.solution.scene
    refuse_potential(scene.material, "work_of_loads()", "potential_energy() has an interval.")
    _raise_if_no_cone(scene)
    J = potential_energy(error)
    return replace(J, value=-2 * J.value, low=-2 * J.high, high=-2 * J.low)


def _raise_if_no_cone(scene: Scene) -> None:
    """Raise an error if the admissible displacements of a scene are no cone."""
    moved = []
    for support in scene.supports:
        if support.is_moved:
            moved.append(support.facets)
    gaps = [contact.facets for contact in scene.contacts if callable(contact.gap) or contact.gap]
    rubbing = [contact for contact in scene.contacts if not contact.is_symmetry]
    rough = [contact.facets for contact in rubbing if contact.law is not None]
    strained_sides = [
        contact.facets for contact in scene.contacts if getattr(contact, "mean_strain", None)
    ]
    strained = [type(strain).__name__ for strain in scene.strains]
    obstacles = {
        "a support that is not zero": moved,
        "a gap": gaps,
        "friction": rough,
        "a mean strain": strained_sides,
        "given strains": strained,
        "a preload": [tie.facets for tie in scene.ties if isinstance(tie, Preload)],
    }
    for obstacle, parts in obstacles.items():
        if parts:
            raise InputError(
                f"The work of the loads has no certified bounds with {obstacle} "
                f"({', '.join(parts)}); ask for potential_energy()."
            )


def _square(error: ConstitutiveError) -> float:
    """Return ``e^2`` with the estimate for the flat facets of a curved body."""
    return error.absolute**2 + error.geometry_error**2
