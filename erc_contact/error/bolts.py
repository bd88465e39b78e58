"""Energies of preloads: the work of loads and of given forces on the jumps at cuts.

The displacement of a body with preloads is ``u = u_c + sum q psi``
(:mod:`erc_contact.model.preload`), and loads do work on all of it. If the force F of a
bolt is given, its shift q is unknown, too, and the potential energy has the work of the
force:

    J(u_c, q) = psi(u) - f(u) - F(u) - F q.

A stress in equilibrium whose resultant at the cut is F has the complementary energy of
this problem. So ``J(u^) - J(u) <= e^2/2`` holds for any q, and each mesh may have a
shift of its own.
"""

from __future__ import annotations

from erc_contact.admissible.pair import Admissible
from erc_contact.error.load_work import load_work_on_jump
from erc_contact.error.numbers import BoundedNumber
from erc_contact.model.preload import shifts_of
from erc_contact.results.forces import force as force_of
from erc_contact.scene.tied import Preload

SAME_FORCE = 1e-9
"""Difference of the force of sigma^ from the given one that is round-off [-]."""


def work_on_jumps(pair: Admissible) -> BoundedNumber:
    """Compute ``sum f(q psi) + F(q psi) + F q`` [force length]; collective.

    It is zero without preloads. It is not resolved where sigma^ has other forces than
    the given ones: the energy of the pair is then no bound.
    """
    model = pair.model
    total = BoundedNumber(0.0)
    if not model.preloads:
        return total
    shifts = shifts_of(model.scene.ties)
    for preload in model.preloads:
        total += shifts[preload.name] * load_work_on_jump(model, preload)
    for tie in model.scene.ties:
        if isinstance(tie, Preload) and tie.force is not None:
            total += BoundedNumber(tie.force * shifts[tie.facets])
    return total + BoundedNumber(0.0, resolved=has_forces(pair))


def has_forces(pair: Admissible) -> bool:
    """Tell whether sigma^ has the given forces of all bolts; collective."""
    axes = {preload.name: preload.axis for preload in pair.model.preloads}
    given = [0.0]
    missing = [0.0]
    for tie in pair.model.scene.ties:
        if isinstance(tie, Preload) and tie.force is not None:
            given.append(abs(tie.force))
            of_stress = force_of(pair, tie.facets).force @ axes[tie.facets]
            missing.append(abs(of_stress - tie.force))
    return max(missing) <= SAME_FORCE * max(given)
