"""Compile the equations that a method adds to the equations of elasticity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.exceptions import InputError, together
from erc_contact.base.runtime import compiled
from erc_contact.base.runtime.parts import renumber
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.data.users import linear
from erc_contact.model.model import Model
from erc_contact.newton.methods import OURS, Method
from namedmesh.base.checks import description
from namedmesh.simplex import rule

Counts = tuple[int, int, int]
"""Numbers of open, slipping and sticking points."""


class Reader:
    """Hold the equations that are forces on the same field of the displacement.

    All foundations read u, and each contact between bodies its jump ``w = B u``. Forces
    on w are ``B^T`` times as many on u (:meth:`.connections.Connections.jump`).

    Args:
        contact: Number of the contact between bodies on whose jump the forces are; None
            for forces on u.
        count: Number of fields by which forms are derived.

    Attributes:
        contact: As given.
        equations: The compiled equations.
        tangents: For each of the fields the compiled derivatives by it.
    """

    def __init__(self, contact: int | None, count: int) -> None:
        self.contact = contact
        self.equations: list[fem.Form] = []
        self.tangents: list[list[fem.Form]] = [[] for _ in range(count)]

    def assemble(self, forces: np.ndarray) -> None:
        """Add the equations to the forces of this rank on what is read [force]."""
        for equations in self.equations:
            fem.assemble_vector(forces, equations)


class ContactForms:
    """Hold the equations of a method on all contacts of a model.

    Args:
        model: The scene on a mesh.
        method: The contact method.

    Attributes:
        share: Share of the friction bound, a Constant; a solver may raise friction in
            steps.
        gap_share: Share of the gaps, likewise.
        contacts: The contacts of the model with this share.
        u: Displacement that the forms read [length]; for a method with multiplier its
            nodal values at the contact are the Bernstein coefficients.
        jumps: Jump of the displacement that the forms read at each contact between
            bodies [length], with multiplier its Bernstein coefficients -> the contact.
        multipliers: Multiplier of each contact [force/area] that the forms read, or ()
            for a method without.
        displacements: u and the jumps, as far as they are in the forms.
        fields: The displacements and the multipliers, by which the forms are derived.
        equations: The compiled equations of each contact [force], forces on its jump or
            on u. Contacts that are alike share their code.
        readers: The equations, by what they are forces on.

    Raises:
        InputError: If the equations of the method are no form linear in the test
            function.
    """

    def __init__(self, model: Model, method: Method) -> None:
        space = model.space
        self.model = model
        self.method = method
        self.share = compiled.constant(space.mesh, 1.0)
        self.gap_share = compiled.constant(space.mesh, 1.0)
        self.u = space.function()
        self.jumps: dict[fem.Function, ContactOnMesh] = {}
        self.contacts = []
        for contact in model.contacts:
            self.contacts.append(self._of_solver(contact))
        self.multipliers: tuple[fem.Function, ...] = ()
        if method.multiplier:
            self.multipliers = tuple(space.function() for _ in model.contacts)

        # A method of the user's may make Constants, and may fail on one rank only.
        with compiled.constants_with_ten_digits():
            equations, projections = together(space.comm, self._parts)
            looked_at = together(space.comm, partial(self._look_at, projections))
        read = {field for parts in equations for _, form in parts for field in form.coefficients()}
        # Between bodies the equations of a multiplier contain the jump only.
        self.displacements = [w for w in (self.u, *self.jumps) if w in read]
        self.fields = (*self.displacements, *self.multipliers)
        self.equations: list[fem.Form] = []
        readers: dict[fem.Function, Reader] = {}
        self._values_of_facets = []
        for number, parts in enumerate(equations):
            contact = self.contacts[number]
            forms: list[ufl.Form] = []
            places: list[list[fem.Form]] = []
            for field, form in parts:
                reads = number if field in self.jumps else None
                reader = readers.setdefault(field, Reader(reads, len(self.fields)))
                forms.append(form)
                places.append(reader.equations)
                for of_field, tangent in self._derivatives(form):
                    forms.append(tangent)
                    places.append(reader.tangents[of_field])
            # One module for each contact: contacts that are alike have the same one.
            at_points = (looked_at[number], self._points)
            compiled_forms, (values,) = compiled.together(space.comm, forms, [at_points])
            for form, place in zip(compiled_forms, places, strict=True):
                place.append(form)
            self.equations.append(compiled_forms[0])
            owned = contact.facets[contact.trace.here.owned]
            self._values_of_facets.append((values, owned))
        self.readers = list(readers.values())

    def _of_solver(self, contact: ContactOnMesh) -> ContactOnMesh:
        """Return a contact as the forms see it, and keep its jump.

        It has the shares of friction and gap and, between bodies, the jump that is
        varied.
        """
        of_solver = contact.with_shares(self.share, self.gap_share)
        if contact.against is None:
            return of_solver
        jump = self.model.space.function()
        self.jumps[jump] = contact
        return replace(of_solver, variable=(self.u, jump))

    def _derivatives(self, form: ufl.Form) -> list[tuple[int, ufl.Form]]:
        """Return the derivatives of a form by the fields in it, with their numbers."""
        du = ufl.TrialFunction(self.model.space.V)
        fields = form.coefficients()
        derivatives = []
        for number, field in enumerate(self.fields):
            if field in fields:
                derivatives.append((number, ufl.derivative(form, field, du)))
        return derivatives

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
                model.space.to_coefficients(nodal.reshape(-1, model.space.d), contacts)
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
        for expression, facets in self._values_of_facets:
            values.append(expression.eval(self.model.space.mesh, facets).ravel().astype(np.int8))
        return np.concatenate(values)

    def counts(self) -> tuple[Counts, ...]:
        """Count the open, slipping and sticking points of each contact; collective."""
        counts = []
        for expression, facets in self._values_of_facets:
            values = expression.eval(self.model.space.mesh, facets).ravel().astype(np.int8)
            counts.append(np.bincount(values, minlength=3))
        whole = self.model.space.comm.allreduce(np.array(counts))
        return tuple((int(open_), int(slip), int(stick)) for open_, slip, stick in whole)

    def nodal_multipliers(self, multipliers: Sequence[fem.Function]) -> tuple[fem.Function, ...]:
        """Replace Bernstein coefficients of multipliers by nodal values, in place.

        Args:
            multipliers: The multiplier of each contact [force/area], also returned.
        """
        model = self.model
        space = model.space
        x = space.V.tabulate_dof_coordinates()
        for contact, multiplier in zip(model.contacts, multipliers, strict=True):
            nodal = multiplier.x.array.reshape(-1, space.d)
            space.section.to_tractions(nodal, contact.trace.here, x)
            space.to_coefficients(nodal, [contact], back=True)
        return tuple(multipliers)

    def _with_multipliers(self) -> list[tuple[ContactOnMesh, fem.Function | None]]:
        """Return each contact with its multiplier, None for a method without."""
        fields: tuple[fem.Function | None, ...] = self.multipliers
        if not fields:
            fields = (None,) * len(self.contacts)
        return list(zip(self.contacts, fields, strict=True))

    def _parts(self) -> tuple[list[list[tuple[fem.Function, ufl.Form]]], list[Ufl]]:
        """Return the method's equations on each contact and its projections, in UFL.

        Each part is with the field on which its forces are. Between bodies that is the
        jump, and u for what tests the stress.
        """
        v = ufl.TestFunction(self.model.space.V)
        jumps = {contact.name: jump for jump, contact in self.jumps.items()}
        equations, projections = [], []
        for contact, multiplier in self._with_multipliers():
            form, projected = self._equations(contact, multiplier, v)
            field = jumps.get(contact.name, self.u)
            parts = [(field, form)]
            if self.method.in_layer and field is not self.u:
                of_stress = replace(contact, tests_jump=False)
                form_of_stress, _ = self._equations(of_stress, multiplier, v)
                parts = [(field, form - form_of_stress), (self.u, form_of_stress)]
            equations.append([(field, renumber(form)) for field, form in parts])
            projections.append(projected)
        return equations, projections

    @property
    def _points(self) -> np.ndarray:
        """Return reference points of a facet at which :meth:`_look_at` is known."""
        points, _ = rule(self.model.space.d - 1, 2 * self.model.space.degree)
        return points

    def _look_at(self, projections: list[Ufl]) -> list[Ufl]:
        """Return what is evaluated on each contact: its status, in UFL."""
        contacts = zip(self.contacts, projections, strict=True)
        return [contact.status(projected) for contact, projected in contacts]

    def _equations(self, contact: ContactOnMesh, multiplier: Ufl, v: Ufl) -> tuple[ufl.Form, Ufl]:
        """Return the method's equations on a contact, linear in v, and its projection.

        The equations of a method of the user's are checked.
        """
        method = self.method
        of_contact = (self.model, contact, self.u)
        # A user's method may be derived from ours, with equations of its own.
        if isinstance(method, OURS) and type(method) in OURS:
            # The projection is most of the equations: UFL makes it once for both.
            projected = method.projected(*of_contact, multiplier)
            return method.equations_with(projected, *of_contact, v, multiplier), projected
        method.traction(*of_contact, multiplier)
        what = f"The equations of {type(method).__name__}"
        form = method.equations(*of_contact, v, multiplier)
        if not isinstance(form, ufl.Form):
            raise InputError(
                f"{what} are {description(form)}; return a UFL form, e.g. "
                "-ufl.inner(r, v) * contact.ds."
            )
        for integral in form.integrals():
            linear(what, integral.integrand(), v)
        return form, method.projected(*of_contact, multiplier)
