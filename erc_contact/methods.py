"""Contact methods: a model and a displacement -> UFL equations and a contact traction.

A method is two things, its equations and its traction; every later stage reads only the traction.

Symbols: u displacement, v test function, n facet normal, g gap, r contact traction on the body,
gamma = gamma_0 E k^2/h [force/volume] with h = d |cell|/|facet| the height of the cell over its facet and
k the degree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any

import ufl
from dolfinx import fem

from erc_contact.exceptions import InputError
from erc_contact.law import project_on_cone
from erc_contact.model import BoundContact, Model

CONTACT_DEGREE = 4
"""Quadrature degree on contact facets: the traction has kinks, a polynomial rule is never exact there."""

Law = Callable[[Any, BoundContact], Any]


def coulomb(z: Any, contact: BoundContact) -> Any:
    """The projection of a trial traction on the cone of a contact."""
    return project_on_cone(z, contact.normal, contact.friction)


def glued(z: Any, contact: BoundContact) -> Any:
    """No projection: a bilateral contact without slip, which makes the equations linear."""
    return z


@dataclass(frozen=True)
class Nitsche:
    """Nitsche's method for contact with friction; it has no unknowns beside the displacement.

    Args:
        theta: 0 (simplest, default), 1 (symmetric without friction) or -1 (skew; converges for any gamma).
        gamma: Dimensionless parameter gamma_0 > 0.

    Raises:
        InputError: If theta is not in {0, 1, -1} or gamma is not positive.

    Source: Chouly, Hild, Renard, "Symmetric and non-symmetric variants of Nitsche's method for contact problems in
        elasticity", Math. Comp. 84 (2015); with Coulomb friction: Chouly et al., "An overview of recent results
        on Nitsche's method for contact problems" (2017).
    """

    theta: int = 0
    gamma: float = 10.0

    def __post_init__(self) -> None:
        if self.theta not in (0, 1, -1):
            raise InputError(f"Nitsche: theta is {self.theta!r}; allowed are 0, 1 and -1.")
        if not (isfinite(self.gamma) and self.gamma > 0):
            raise InputError(f"Nitsche: gamma is {self.gamma!r}; it must be > 0 (dimensionless; 1 to 100 is usual).")

    def equations(self, model: Model, u: Any, v: Any, law: Law = coulomb) -> Any:
        """The residual, a UFL form linear in v.

        ``a(u, v) - f(v) - F(v) - int_C r(u).v - theta int_C (sigma(u)n - r(u))/gamma . sigma(v)n``

        Args:
            model: The scene on a mesh.
            u: Displacement [length].
            v: Test function.
            law: The projection of the trial traction; ``glued`` gives the linear bilateral problem.
        """
        residual = model.stiffness(u, v)
        loads = model.loads(v)
        if loads is not None:
            residual -= loads
        theta = fem.Constant(model.mesh, float(self.theta)) if self.theta else None
        for contact in model.contacts:
            gamma = self._parameter(model)
            ds = contact.ds(metadata={"quadrature_degree": CONTACT_DEGREE})
            r = law(self._trial(model, contact, u, gamma), contact)
            residual -= ufl.inner(r, v) * ds
            if theta is not None:
                difference = ufl.dot(model.stress(u), model.n) - r
                residual -= theta / gamma * ufl.inner(difference, ufl.dot(model.stress(v), model.n)) * ds
        return residual

    def traction(self, model: Model, contact: BoundContact, u: Any) -> Any:
        """The contact traction ``r(u) = P(sigma(u)n - gamma (u - g n))`` [force/area], UFL, shape (d,)."""
        return coulomb(self._trial(model, contact, u, self._parameter(model)), contact)

    def _parameter(self, model: Model) -> Any:
        gamma_0 = fem.Constant(model.mesh, float(self.gamma))
        modulus = model.scene.material.modulus(**model.parameters)
        return gamma_0 * modulus * ufl.FacetArea(model.mesh) / (model.d * ufl.CellVolume(model.mesh))

    def _trial(self, model: Model, contact: BoundContact, u: Any, gamma: Any) -> Any:
        beyond = u if contact.gap is None else u - contact.gap * contact.normal
        return ufl.dot(model.stress(u), model.n) - gamma * beyond
