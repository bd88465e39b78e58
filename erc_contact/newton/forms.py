"""The equations that a method adds to those of elasticity, as compiled forms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.checks import description
from erc_contact.base.exceptions import InputError, together
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.mesh.simplex import rule
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.model.users import linear
from erc_contact.newton.jump_sums import JumpSums
from erc_contact.newton.methods import OURS, Method


class Pass:
    """Describe one assembly of the equations, of all that a term of them is.

    Args:
        tested: Factors of the jumps of test functions between bodies, one for each
            colour of contacts [-], as :meth:`ContactForms.test`.
        row_of: Place in u_A of the equation of each degree of freedom, -1 without.
        factor_of: Factor of this equation [-].

    Attributes:
        rows: Degrees of freedom with a place.
        places: Their places.
        factors: Their factors.
    """

    def __init__(
        self, tested: tuple[float, ...], row_of: np.ndarray, factor_of: np.ndarray
    ) -> None:
        self.tested = tested
        self.row_of = row_of
        self.factor_of = factor_of
        self.rows = np.flatnonzero(row_of >= 0)
        self.places = row_of[self.rows]
        self.factors = factor_of[self.rows]


class ContactForms:
    """Hold the equations of a method on all contacts of a model.

    Args:
        model: The scene on a mesh.
        method: The contact method.

    Attributes:
        share: Share of the friction bound, a Constant; a solver may raise friction in
            steps.
        gap_share: Share of the gaps, likewise.
        jump_sums: Jumps that are sums of unknowns.
        test_jumps: Factors of the jumps of test functions between bodies, a Constant
            for each colour of contacts (:mod:`erc_contact.newton.jump_sums`).
        contacts: The contacts of the model with this share.
        u: Displacement that the forms read [length]; for a method with multiplier its
            nodal values at the contact are the Bernstein coefficients.
        jumps: Jump of the displacement that the forms read at each contact between
            bodies [length], with multiplier its Bernstein coefficients -> the contact.
        multipliers: Multiplier of each contact [force/area] that the forms read, or ()
            for a method without.
        displacements: Those of u and the jumps that are in the forms.
        equations: The compiled equations e of each contact [force]. Contacts that are
            alike share their code.
        tangents: For each displacement, and then for each multiplier, the compiled
            derivatives by it, of the contacts whose equations contain it.

    Raises:
        InputError: If the equations of the method are no form linear in the test
            function.
    """

    def __init__(self, model: Model, method: Method) -> None:
        self.model = model
        self.method = method
        self.share = compiled.constant(model.mesh, 1.0)
        self.gap_share = compiled.constant(model.mesh, 1.0)
        self.jump_sums = JumpSums(model, with_foundations=method.multiplier)
        self.test_jumps = []
        for _ in range(self.jump_sums.count):
            self.test_jumps.append(compiled.constant(model.mesh, 1.0))
        self.u = model.function()
        self.jumps: dict[fem.Function, BoundContact] = {}
        self.contacts = []
        for contact, colour in zip(model.contacts, self.jump_sums.colours, strict=True):
            self.contacts.append(self._of_solver(contact, colour))
        self.multipliers: tuple[fem.Function, ...] = ()
        if method.multiplier:
            self.multipliers = tuple(model.function() for _ in model.contacts)

        # A method of the user's may make Constants, and may fail on one rank only.
        with compiled.constants_with_ten_digits():
            equations = together(model.comm, self._parts)
            status = together(model.comm, self._status)
        fields_of_contacts = [ufl.algorithms.extract_coefficients(part) for part in equations]
        read = set().union(*fields_of_contacts)
        # Between bodies the equations of a multiplier contain the jump only.
        self.displacements = [w for w in (self.u, *self.jumps) if w in read]

        fields = (*self.displacements, *self.multipliers)
        self.equations: list[fem.Form] = []
        self.tangents: list[list[fem.Form]] = [[] for _ in fields]
        self._status_of_facets = []
        du = ufl.TrialFunction(model.V)
        points, _ = rule(model.d - 1, 2 * model.degree)
        for number, part in enumerate(equations):
            places = [k for k, field in enumerate(fields) if field in fields_of_contacts[number]]
            derivatives = [ufl.derivative(part, fields[k], du) for k in places]
            at_points = (status[number], points)
            # One module for each contact: contacts that are alike have the same one.
            compiled.compile_together(model.comm, [part, *derivatives], [at_points])
            self.equations.append(compiled.form(part))
            for k, derivative in zip(places, derivatives, strict=True):
                self.tangents[k].append(compiled.form(derivative))
            contact = self.contacts[number]
            owned = contact.facets[contact.trace.here.owned]
            compiled_status = compiled.expression(status[number], points, model.comm)
            self._status_of_facets.append((compiled_status, owned))

    def _of_solver(self, contact: BoundContact, colour: int) -> BoundContact:
        """Return a contact of a colour as the forms see it, and keep its jump.

        It has the shares of friction and gap and, between bodies, the jump that is
        varied.
        """
        of_solver = contact.with_shares(self.share, self.gap_share)
        if contact.trace.there is None:
            return of_solver
        jump = self.model.function()
        self.jumps[jump] = contact
        test_jump = None if self.method.multiplier else self.test_jumps[colour]
        return replace(of_solver, variable=(self.u, jump), test_jump=test_jump)

    @property
    def all_jumps(self) -> tuple[float, ...]:
        """Return the factors that test the jumps of all contacts."""
        return (1.0,) * len(self.test_jumps)

    @property
    def no_jumps(self) -> tuple[float, ...]:
        """Return the factors that test what moves both sides of a contact alike."""
        return (0.0,) * len(self.test_jumps)

    def jumps_of(self, colour: int) -> tuple[float, ...]:
        """Return the factors that test the jumps of the contacts of one colour."""
        return tuple(float(k == colour) for k in range(len(self.test_jumps)))

    def test(self, tested: tuple[float, ...]) -> None:
        """Set the factors of the jumps of test functions, one for each colour [-]."""
        for constant, factor in zip(self.test_jumps, tested, strict=True):
            constant.value = factor

    @property
    def test_alike(self) -> bool:
        """Tell whether the equations act on unknowns that move both sides alike.

        Between bodies Nitsche's stress does so if it is tested, and so does a
        foundation at the node of a pair.
        """
        if self.model.coordinates.is_identity or self.method.multiplier:
            return False
        on_foundation = any(contact.trace.there is None for contact in self.contacts)
        return self.method.in_layer or on_foundation

    def assemble(self, forces: np.ndarray) -> None:
        """Add the equations of all contacts to the forces of this rank [force]."""
        for equations in self.equations:
            fem.assemble_vector(forces, equations)

    def read(self, u: fem.Function) -> list[np.ndarray]:
        """Return the values that a displacement gives to the displacements read.

        With a multiplier they are Bernstein coefficients at the contacts.

        Args:
            u: The displacement [length], linear in which they are.
        """
        model = self.model
        values = []
        for field in self.displacements:
            contacts = model.contacts
            nodal = u.x.array.copy()
            if field in self.jumps:
                contact = self.jumps[field]
                contacts = [contact]
                nodal[:] = 0.0
                contact.trace.assign(nodal, contact.trace.of(u.x.array))
            if self.method.multiplier:
                model.to_coefficients(nodal.reshape(-1, model.d), contacts)
            values.append(nodal)
        return values

    def set_displacement(self, u: fem.Function) -> None:
        """Set the fields that the forms read to a displacement [length]."""
        for field, values in zip(self.displacements, self.read(u), strict=True):
            field.x.array[:] = values

    def set_shares(self, friction: float, gap: float) -> None:
        """Set the shares of friction and gaps [-]."""
        self.share.value = friction
        self.gap_share.value = gap

    def status(self) -> np.ndarray:
        """Return the status open (0), slip (1) or stick (2) at points of the contact.

        They are the points of the contact facets that this rank owns.
        """
        values = []
        for expression, facets in self._status_of_facets:
            values.append(expression.eval(self.model.mesh, facets).ravel().astype(np.int8))
        return np.concatenate(values)

    def nodal_multipliers(
        self, coefficients: Sequence[fem.Function] | None = None
    ) -> tuple[fem.Function, ...]:
        """Return multipliers as new Functions of nodal values [force/area].

        Args:
            coefficients: Their Bernstein coefficients; None for those of the forms.
        """
        model = self.model
        nodal = []
        multipliers = self.multipliers if coefficients is None else coefficients
        for contact, multiplier in zip(model.contacts, multipliers, strict=False):
            values = multiplier.copy()
            model.to_coefficients(values.x.array.reshape(-1, model.d), [contact], back=True)
            nodal.append(values)
        return tuple(nodal)

    def _with_multipliers(self) -> list[tuple[BoundContact, fem.Function | None]]:
        """Return each contact with its multiplier, None for a method without."""
        fields: tuple[fem.Function | None, ...] = self.multipliers
        if not fields:
            fields = (None,) * len(self.contacts)
        return list(zip(self.contacts, fields, strict=True))

    def _parts(self) -> list[Ufl]:
        """Return the equations of the method on each contact, in UFL."""
        v = ufl.TestFunction(self.model.V)
        parts = []
        colours = self.jump_sums.colours
        for (contact, multiplier), colour in zip(self._with_multipliers(), colours, strict=True):
            equations = self._equations(contact, multiplier, v)
            if self.method.multiplier and self.jump_sums.any:
                # The equations of a multiplier test no jump: they are told apart here.
                equations = self.test_jumps[colour] * equations
            parts.append(equations)
        return parts

    def _status(self) -> list[Ufl]:
        """Return the status of each contact, in UFL."""
        status = []
        for contact, multiplier in self._with_multipliers():
            trial = self.method.projected(self.model, contact, self.u, multiplier)
            status.append(contact.status(trial))
        return status

    def _equations(self, contact: BoundContact, multiplier: Ufl, v: Ufl) -> Ufl:
        """Return the equations of the method on a contact, a form linear in v.

        Those of a method of the user's are checked.
        """
        if type(self.method) in OURS:
            return self.method.equations(self.model, contact, self.u, v, multiplier)
        self.method.traction(self.model, contact, self.u, multiplier)
        what = f"The equations of {type(self.method).__name__}"
        form = self.method.equations(self.model, contact, self.u, v, multiplier)
        if not isinstance(form, ufl.Form):
            raise InputError(
                f"{what} are {description(form)}; return a UFL form, e.g. "
                "-ufl.inner(r, v) * contact.ds."
            )
        for integral in form.integrals():
            linear(what, integral.integrand(), v)
        return form
