"""Give what moved strains and shifts add to a difference-quotient bound.

Symbols of :mod:`erc_contact.error.goals.difference_quotient` and
:mod:`erc_contact.model.preload`: p difference of two shifts over t, psi the field of
the jump of one preload, E = - eps(psi) its given strain. Jumps of periodic sides under
a mean stress are part of u, so that given forces alone do work on their p.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.error.goals.singular_strain import SingularStrain
from erc_contact.error.load_work import load_work_on_jump
from erc_contact.error.numbers import BoundedNumber
from erc_contact.error.works import strain_energy
from erc_contact.model.given_forces import given_forces
from erc_contact.model.model import Model
from erc_contact.newton.given_forces import shifts_in, with_shifts
from erc_contact.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class MovedLaw:
    """Hold the differences of what is given of the strains of two scenes, over t.

    Attributes:
        shifts: p of each shift that has moved, by its name [-].
        singular: The difference of the strains of a crack tip over t; None without.
    """

    shifts: dict[str, float] = field(default_factory=dict)
    singular: SingularStrain | None = None

    @classmethod
    def between(cls, first: Model, second: Model, t: float) -> MovedLaw:
        """Return what the first scene has more than the second, over t."""
        more, less = shifts_in(first.scene), shifts_in(second.scene)
        shifts = {name: (more[name] - less[name]) / t for name in more if more[name] != less[name]}
        more_strain, less_strain = _singular(first.scene), _singular(second.scene)
        either = more_strain or less_strain
        if either is None:
            return cls(shifts)
        amount = 0.0 if more_strain is None else more_strain.amount
        amount -= 0.0 if less_strain is None else less_strain.amount
        return cls(shifts, replace(either, amount=amount / t))

    def move(self, pair: Admissible, amount: float) -> Admissible:
        """Return a pair whose law has moved by this times an amount; collective."""
        if amount == 0.0 or not (self.shifts or self.singular):
            return pair
        scene = pair.model.scene
        if self.singular is not None:
            singular = replace(self.singular, amount=amount * self.singular.amount)
            scene = replace(scene, strains=(*scene.strains, singular))
        shifts = shifts_in(scene)
        for name, p in self.shifts.items():
            shifts[name] += amount * p
        model = copy(pair.model)
        model.scene = with_shifts(scene, shifts)
        model.bind_strains(model.scene)
        return replace(pair, solution=replace(pair.solution, model=model))

    def work(self, pair: Admissible, t: float) -> BoundedNumber:
        """Compute what V has of the jumps of phi [force length]; collective.

        It is ``f(p psi) + F p + int C (eps(u^) - eps_0) : p E``. The last term is minus
        the derivative of the strain energy of u^ by the shifts, of which it is a
        polynomial of degree 2.

        Args:
            pair: The pair of the scene that is not moved.
            t: t.
        """
        if not self.shifts:
            return BoundedNumber(0.0)
        model = pair.model
        total = BoundedNumber(0.0)
        shifts = shifts_in(model.scene)
        amount = t
        for name, p in self.shifts.items():
            amount = max(amount, abs(shifts[name] / p))
        u = pair.displacement
        more, less = (strain_energy(self.move(pair, s), u) for s in (amount, -amount))
        total += (0.5 / amount) * (less - more)
        for preload in model.preloads:
            p = self.shifts.get(preload.name, 0.0)
            if p != 0.0:
                total += p * load_work_on_jump(model, preload)
        for given in given_forces(model.scene, model):
            total += BoundedNumber(given.force * self.shifts.get(given.name, 0.0))
        # Shifts are rounded before their small differences are taken.
        largest = max(abs(shifts[name]) for name in self.shifts)
        round_off = 2 * np.finfo(float).eps * largest / t
        return total + BoundedNumber(0.0, round_off * abs(total.value))


def _singular(scene: Scene) -> SingularStrain | None:
    """Return the strain of a crack tip that a scene has."""
    for strain in scene.strains:
        if isinstance(strain, SingularStrain):
            return strain
    return None
