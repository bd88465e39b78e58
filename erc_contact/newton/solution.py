"""The result of a contact solve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem

from erc_contact.mesh.domain import Domain
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.model.points import at_points, elastic_stress_at, in_space
from erc_contact.newton.elastic import ElasticSolver
from erc_contact.newton.methods import Method
from erc_contact.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class ElasticValues:
    """Values of a solution at points.

    Attributes:
        displacement: u [length], shape (n, d).
        elastic_stress: C eps(u) [force/area], shape (n, d, d).
    """

    displacement: np.ndarray
    elastic_stress: np.ndarray


SINGULAR = 1e-12
"""The tangent counts as singular below this least singular value, scaled by the elastic diagonal [-]."""


@dataclass(frozen=True, eq=False)
class Solution:
    """A converged displacement, with the model, the method and the stiffness that it was computed with.

    Attributes:
        model: The scene on its domain, with forms.
        method: The contact method that it is the solution of.
        u: Displacement [length], a continuous P1 or P2 Function.
        multipliers: Multiplier of each contact [force/area], or () for a method without.
        newton_steps: Newton steps of all attempts together; 0 for a scene without contact.
        reason: Which attempt converged, and how.
        remaining: Energy norm of the distance to the solution of the discrete problem [sqrt(force length)].
        regularity: Least singular value of the tangents of the contact problem at the solution, scaled by the elastic
            diagonal [-].
        stiffness: The elastic stiffness; see :attr:`factorised`.
        seconds: Wall time, the largest over the ranks [s].
    """

    model: Model
    method: Method
    u: fem.Function
    multipliers: tuple[fem.Function, ...]
    newton_steps: int
    reason: str
    remaining: float
    regularity: float
    stiffness: ElasticSolver
    seconds: float

    @property
    def domain(self) -> Domain:
        """The mesh with names."""
        return self.model.domain

    @property
    def scene(self) -> Scene:
        """What the user declared."""
        return self.model.scene

    @property
    def factorised(self) -> bool:
        """Whether the factor of the stiffness is in memory; :func:`equilibrate` makes it if it is not, and frees it."""
        return self.stiffness.factorised

    @property
    def singular(self) -> bool:
        """Whether the tangent is singular: there may be other solutions arbitrarily near."""
        return self.regularity < SINGULAR

    def at(self, points: Any) -> ElasticValues:
        """Displacement and elastic stress at points; a point between several cells has the mean; collective.

        The stress is that of the displacement. It is not in equilibrium; that of an error is (``error.at``).

        Args:
            points: The same on all ranks [length], shape (n, d) or (d,).

        Raises:
            InputError: If the points have another shape or are not finite, or one lies outside the mesh.
        """
        model, d = self.model, self.model.d

        def values(cell: np.ndarray, x: np.ndarray) -> np.ndarray:
            u = self.u.eval(in_space(x), cell).reshape(-1, d) if len(x) else np.zeros((0, d))
            return np.hstack([u, elastic_stress_at(model, self.u, cell, x).reshape(-1, d * d)])

        u, stress = np.split(at_points(model, points, values), [d], axis=1)
        return ElasticValues(u, stress.reshape(-1, d, d))

    def traction(self, contact: BoundContact) -> Any:
        """The contact traction of the method on a contact of the model [force/area], UFL, shape (d,)."""
        place = self.model.contacts.index(contact)
        multiplier = self.multipliers[place] if self.multipliers else None
        return self.method.traction(self.model, contact, self.u, multiplier)
