"""A contact on a mesh: its measure, the normal of its foundation, its gap and its friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl

from erc_contact.mesh.domain import Domain
from erc_contact.model.expressions import Everywhere, pointwise, varies_in_cells
from erc_contact.model.users import scalar
from erc_contact.scene.law import Coulomb, Law, Tresca, project


@dataclass(frozen=True, eq=False)
class BoundContact:
    """A contact on a mesh: its measure and its values as UFL (None: the scene has no such term).

    Attributes:
        name: Name of the boundary part.
        facets: Pairs (cell, local facet) with ghosts, shape (f, 2).
        ds: Measure of the part.
        normal: Unit normal of the foundation, UFL.
        direction: The same on each facet, shape (f, d).
        given_normal: The normal as the scene gives it, of any length, UFL; None where it does not vary.
        law: Friction law, or None without friction.
        parameters: Values of the law's parameters, UFL.
        share: Factor of the friction bound, 1 but while a solver raises friction in steps.
        gap: Gap, UFL, or None.
        gap_varies: Whether the gap is a callable.
        sampled: Whether the friction bound must be sampled on a facet: nodal values of a traction in the cone do not
            tell that it lies there everywhere.
        bilateral: Whether the contact cannot open.
    """

    name: str
    facets: np.ndarray
    ds: Any
    normal: Any
    direction: np.ndarray
    given_normal: Any | None
    law: Law | None
    parameters: dict[str, Any]
    share: Any
    gap: Any | None
    gap_varies: bool
    sampled: bool
    bilateral: bool

    @property
    def varies(self) -> bool:
        """Whether gap, normal or friction vary along facets."""
        data = self.gap, self.given_normal, *self.parameters.values()
        return any(one is not None and varies_in_cells(one) for one in data)

    def project(self, z: Any) -> Any:
        """The traction that the law allows for a trial traction z [force/area], UFL."""
        bound = None if self.law is None else self._bound
        return project(z, self.normal, bound, bilateral=self.bilateral)

    def status(self, r: Any) -> Any:
        """Whether a traction of :meth:`project` shows the contact open (0), in slip (1) or in stick (2), UFL."""
        r_n = ufl.dot(r, self.normal)
        r_t = r - r_n * self.normal
        limit = self._bound(-r_n)
        slips = ufl.ge(ufl.dot(r_t, r_t), (1 - 1e-9) * limit**2)
        closed = ufl.conditional(slips, 1, 2)
        return closed if self.bilateral else ufl.conditional(ufl.lt(r_n, 0), closed, 0)

    def friction_bound(self, pressure: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """The friction bound b(p) at points of the facets [force/area].

        Args:
            pressure: p >= 0 at the points [force/area], shape (f, q).
            values: The law's parameters there, of :meth:`Model.friction_parameters`.

        Returns:
            Shape (f, q); zero without friction.
        """
        if self.law is None:
            return np.zeros(pressure.shape)
        if isinstance(self.law, (Coulomb, Tresca)):  # arithmetic that numbers understand
            return np.broadcast_to(self.law.bound(pressure, **values), pressure.shape)
        return pointwise(self.law.bound, {"pressure": pressure, **values})

    def check(self) -> None:
        """Call the law as the solver and the error do; what it raises is its user's to mend."""
        numbers = {name: np.ones((1, 1)) for name in self.parameters}
        scalar(f"Contact({self.name!r}): the friction bound", self._bound(abs(self.normal[0])))
        self.friction_bound(np.ones((1, 1)), numbers)

    def _bound(self, pressure: Any) -> Any:
        return self.share * self.law.bound(pressure, **self.parameters) if self.law else 0


class ContactData:
    """Gap, normal and friction bound of a contact at any points of its facets; construction is collective."""

    def __init__(self, contact: BoundContact, domain: Domain) -> None:
        self.contact = contact
        self._gap, self._normal = (
            None if one is None else Everywhere(one, domain) for one in (contact.gap, contact.given_normal)
        )
        self._parameters = {name: Everywhere(value, domain) for name, value in contact.parameters.items()}

    def gap(self, of: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The gap [length] at points x (n, q, d) of facets of given numbers (n,), shape (n, q)."""
        return np.zeros(x.shape[:2]) if self._gap is None else self._gap(x, self.contact.facets[of])

    def normal(self, of: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The unit normal of the foundation there, shape (n, q, d), or (n, 1, d) where it does not vary."""
        if self._normal is None:
            return self.contact.direction[of][:, None, :]
        normal = self._normal(x, self.contact.facets[of])
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def bound(self, of: np.ndarray, x: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """The friction bound there for pressures (n, q) [force/area], shape (n, q)."""
        parameters = {name: value(x, self.contact.facets[of]) for name, value in self._parameters.items()}
        return self.contact.friction_bound(pressure, parameters)
