"""Energies of shifts: the work of loads and of given forces on jumps of displacements.

The displacement of a body with preloads is ``u = u_c + sum q psi``
(:mod:`erc_contact.model.preload`), and loads do work on all of it. If the force F of a
bolt is given, its shift q is unknown, too, and the potential energy has the work of the
force:

    J(u_c, q) = psi(u) - f(u) - F(u) - F q.

A stress in equilibrium whose resultant at the cut is F has the complementary energy of
this problem. So ``J(u^) - J(u) <= e^2/2`` holds for any q, and each mesh may have a
shift of its own. Likewise the jump of periodic sides under a mean stress: it is part of
u, and the force of a side does work on it.
"""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.error.load_work import load_work_on_jump
from erc_contact.error.numbers import BoundedNumber
from erc_contact.model.given_forces import given_forces
from erc_contact.model.preload import shifts_of
from erc_contact.results.forces import force as force_of

SAME_FORCE = 1e-9
"""Difference of the force of sigma^ from the given one that is round-off [-]."""


def work_on_jumps(pair: Admissible) -> BoundedNumber:
    """Compute ``sum f(q psi) + F(q psi) + F q`` [force length]; collective.

    It is zero without shifts. It is not resolved where sigma^ has other forces than the
    given ones: the energy of the pair is then no bound.
    """
    model = pair.model
    total = BoundedNumber(0.0)
    shifts = shifts_of(model.scene.ties)
    for preload in model.preloads:
        total += shifts[preload.name] * load_work_on_jump(model, preload)
    for given in given_forces(model.scene, model):
        assert given.shift is not None
        total += BoundedNumber(given.force * given.shift)
    return total + BoundedNumber(0.0, resolved=has_forces(pair))


def has_forces(pair: Admissible) -> bool:
    """Tell whether sigma^ has the given forces of bolts and sides; collective."""
    sizes = [0.0]
    missing = [0.0]
    for given in given_forces(pair.model.scene, pair.model):
        of_part = force_of(pair, given.part).force
        sizes.append(float(np.linalg.norm(of_part)))
        missing.append(abs(float(of_part @ given.direction) - given.force))
    return max(missing) <= SAME_FORCE * max(sizes)
