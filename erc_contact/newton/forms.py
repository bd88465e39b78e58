"""What a method adds to the elastic equations of a model, as compiled forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.checks import description
from erc_contact.base.exceptions import InputError, together
from erc_contact.base.runtime import compiled
from erc_contact.mesh.simplex import rule
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.model.users import linear
from erc_contact.newton.methods import OURS, Method


class ContactForms:
    """The equations of a method on all contacts of a model.

    Args:
        model: The scene on a mesh.
        method: The contact method.

    Attributes:
        share: Share of the friction bound, a Constant; a solver may raise friction in
            steps.
        contacts: The contacts of the model with this share.
        u: Displacement that the forms read [length]; for a method with multiplier its
            nodal values at the contact are the Bernstein coefficients.
        multipliers: Multiplier of each contact [force/area] that the forms read, or ()
            for a method without.
        residual: The compiled form of the equations e [force].
        tangents: The compiled derivatives of e by u and by each multiplier.

    Raises:
        InputError: If the equations of the method are no form linear in the test
            function.
    """

    def __init__(self, model: Model, method: Method) -> None:
        self.model, self.method = model, method
        self.share = compiled.constant(model.mesh, 1.0)
        self.contacts = [c.with_share(self.share) for c in model.contacts]
        self.u = model.function()
        self.multipliers = (
            tuple(model.function() for _ in model.contacts) if method.multiplier else ()
        )
        fields: tuple[Any, ...] = self.multipliers or (None,) * len(self.contacts)
        v, du = ufl.TestFunction(model.V), ufl.TrialFunction(model.V)
        pairs = list(zip(self.contacts, fields, strict=True))
        with compiled.numbers_alike():  # for Constants that a method of the user's makes
            parts = together(model.comm, lambda: [self._equations(c, f, v) for c, f in pairs])
            shown = together(
                model.comm,
                lambda: [c.status(method.projected(model, c, self.u, f)) for c, f in pairs],
            )
        equations = sum(parts[1:], start=parts[0])
        tangents = [ufl.derivative(equations, f, du) for f in (self.u, *self.multipliers)]
        compiled.compile_together(model.comm, [equations, *tangents])
        self.residual, self.tangents = (
            compiled.form(equations),
            [compiled.form(tangent) for tangent in tangents],
        )
        points, _ = rule(model.d - 1, 2 * model.degree)
        self._shown = []
        for contact, status in zip(self.contacts, shown, strict=True):
            own = contact.facets[contact.trace.here.owned]
            self._shown.append((compiled.expression(status, points, model.comm), own))

    def status(self) -> np.ndarray:
        """The status open (0), slip (1) or stick (2) at points of the contact facets of this rank."""
        local = [
            e.eval(self.model.mesh, facets).ravel().astype(np.int8) for e, facets in self._shown
        ]
        return np.concatenate(local)

    def found_multipliers(self) -> tuple[fem.Function, ...]:
        """The multipliers as new Functions of nodal values [force/area]."""
        found = []
        for contact, multiplier in zip(
            self.model.contacts, self.multipliers, strict=bool(self.multipliers)
        ):
            found.append(multiplier.copy())
            self.model.to_coefficients(
                found[-1].x.array.reshape(-1, self.model.d), [contact], back=True
            )
        return tuple(found)

    def _equations(self, contact: BoundContact, multiplier: Any, v: Any) -> Any:
        """The equations of the method on a contact, a form linear in v; a method of the user's is tried."""
        if type(self.method) in OURS:
            return self.method.equations(self.model, contact, self.u, v, multiplier)
        self.method.traction(self.model, contact, self.u, multiplier)
        what = f"The equations of {type(self.method).__name__}"
        form = self.method.equations(self.model, contact, self.u, v, multiplier)
        if not isinstance(form, ufl.Form):
            raise InputError(
                f"{what} are {description(form)}; return a UFL form, e.g. -ufl.inner(r, v) * contact.ds."
            )
        for integral in form.integrals():
            linear(what, integral.integrand(), v)
        return form
