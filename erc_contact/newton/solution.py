"""The solution of a contact problem."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.base.views import view_of
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import split
from erc_contact.model.contact_area import ContactArea
from erc_contact.model.contact_force import ContactForce
from erc_contact.model.copies import mean_strain
from erc_contact.model.forces import Force, body_force, by_cause, nodal_reactions, part_force
from erc_contact.model.greatest import find_maximum
from erc_contact.model.maximum import Maximum
from erc_contact.model.model import Model
from erc_contact.model.motions.rigid_faces import Motion, motion_of
from erc_contact.model.points import along_line, at_points, elastic_stress_at, tensors_of_points
from erc_contact.model.profile import (
    contact_area,
    contact_force,
    profile_points,
    profile_table,
    profile_traction,
    slip_before_table,
)
from erc_contact.model.stress import stress_in_space
from erc_contact.model.von_mises import von_mises
from erc_contact.newton.distortion import Distortion, measure
from erc_contact.newton.linear.solver import ElasticSolver
from erc_contact.newton.methods import Method
from erc_contact.newton.rest import REST_ROUND_OFF, displacement_at_rest, displacement_back_at_rest
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload
from namedmesh import Domain
from namedmesh.base.html import table
from namedmesh.base.names import listed
from namedmesh.base.ranks import greatest
from namedmesh.for_solvers import in_space


@dataclass(frozen=True, eq=False)
class ElasticValues:
    """Hold values of a solution at points.

    Attributes:
        displacement: u [length], shape (n, d).
        elastic_stress: C eps(u) [force/area], shape (n, d, d); of an axisymmetric body
            (n, 3, 3) with the rows r, z and hoop.
    """

    displacement: np.ndarray
    elastic_stress: np.ndarray


SINGULAR = 1e-12
"""Least singular value of the scaled tangent below which it counts as singular [-]."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Hold a converged displacement, its model, its method and its elastic solver.

    Attributes:
        model: The scene on its domain, with forms.
        method: The contact method that it is the solution of.
        u: Displacement [length], a continuous P1 or P2 Function.
        multipliers: Multiplier of each contact [force/area], or () for a method
            without.
        reason: Which attempt converged, and how.
        stiffness: The elastic solver; ``newton.linear.solver`` tells
            when its factor is made and freed. See :attr:`factorised`.
        newton_steps: Newton steps of all attempts together; 0 for a scene without
            contact.
        distance: Energy norm of the distance to the solution of the discrete problem
            [sqrt(force length)].
        least_singular_value: Least singular value of the tangents of the contact
            problem at the solution, scaled by the elastic diagonal [-]; 1 without any.
        seconds: Wall time, the largest over the ranks [s].
        forms: Equations of the methods that were tried, for solves of scenes near by.
        carried: Contacts and displacement without the rigid motion that has brought
            bodies to their contacts, from which tractions of the method have no
            round-off of the way; None without one.

    Example:
        >>> solution.force("bottom").force.round(1)
        array([-0.1, 25.1])
        >>> solution.at((1.0, 0.5)).displacement.shape
        (1, 2)
    """

    model: Model
    method: Method
    u: fem.Function
    multipliers: tuple[fem.Function, ...]
    reason: str
    stiffness: ElasticSolver
    newton_steps: int = 0
    distance: float = 0.0
    least_singular_value: float = 1.0
    seconds: float = 0.0
    forms: dict[Method, Any] = field(default_factory=dict)
    carried: tuple[list[ContactOnMesh], fem.Function] | None = None

    def __repr__(self) -> str:
        """Return one line; nothing is computed, so one rank alone may call it."""
        tangent = ", singular tangent" if self.singular else ""
        return (
            f"<Solution of degree {self.model.space.degree} on {self.domain.cells} cells by "
            f"{self.method}, {self.newton_steps} Newton steps{tangent}>"
        )

    def _repr_html_(self) -> str:
        """Return a table for a notebook; one rank alone may call it."""
        space = self.model.space
        rows = [
            ("method", self.method),
            ("cells", self.domain.cells),
            ("unknowns", space.V.dofmap.index_map.size_global * space.d),
            ("degree", space.degree),
            ("Newton steps", self.newton_steps),
            ("converged", self.reason),
            ("tangent", "singular" if self.singular else "regular"),
            ("seconds", f"{self.seconds:.2f}"),
        ]
        return table(rows, caption="Solution")

    @property
    def domain(self) -> Domain:
        """Return the mesh with names."""
        return self.model.domain

    @property
    def scene(self) -> Scene:
        """Return the scene that the user declared."""
        return self.model.scene

    @property
    def factorised(self) -> bool:
        """Tell whether the factor of the stiffness is in memory.

        :func:`equilibrate` makes it if it is not, and frees it.
        """
        return self.stiffness.factorised

    @property
    def remaining(self) -> float:
        """Return :attr:`distance`: its former name, kept for one version."""
        return self.distance

    @property
    def regularity(self) -> float:
        """Return :attr:`least_singular_value`; a former name, kept a version."""
        return self.least_singular_value

    @property
    def singular(self) -> bool:
        """Tell whether the tangent is singular.

        There may then be other solutions arbitrarily near.
        """
        return self.least_singular_value < SINGULAR

    @cached_property
    def at_rest(self) -> bool:
        """Tell whether nothing loads or strains the body; collective.

        Then u is the displacement of a body at rest, up to round-off.
        """
        loads = self.stiffness.load_vector()
        at_rest = displacement_at_rest(self.model, loads)
        if at_rest is None:
            return displacement_back_at_rest(self.model, loads, self.u) is not None
        moved = greatest(self.domain.comm, self.u.x.array - at_rest.x.array)
        return moved <= REST_ROUND_OFF * self.domain.extent

    @cached_property
    def distortion(self) -> Distortion:
        """Return how far u strains, turns and inverts the bodies; collective."""
        return measure(self.model, self.u)

    def force(self, part: str) -> Force:
        """Return the force and the moment on a boundary part; collective.

        The consistent nodal forces have them [force; force length]. On a contact it is
        what the foundation exerts on the body, on a support the reaction with the loads
        on the components that it leaves free, elsewhere the load. See
        :mod:`erc_contact.model.forces`.

        Raises:
            InputError: If no boundary part has this name.
        """
        return part_force(self.model, part, self._nodal_reactions())

    def reactions(self) -> dict[str, Force]:
        """Return the forces of supports, contacts and loads [force]; collective.

        Their balance, zero up to round-off, is among them. See
        :func:`erc_contact.model.forces.by_cause`.
        """
        nodal = self._nodal_reactions()
        force_on = partial(part_force, self.model, nodal=nodal)
        return by_cause(self.model, force_on, partial(body_force, self.model))

    def motion(self, part: str) -> Motion:
        """Return displacement and rotation of a rigid face; collective.

        Raises:
            InputError: If no rigid face has this name.
        """
        return motion_of(self.model.space, self.scene.supports, part, self.u)

    def shortening(self, part: str) -> float:
        """Return the shift of a preload [length], > 0 where it draws sides together.

        Args:
            part: Name of either side of its cut.

        Raises:
            InputError: If no preload has this part.
        """
        shift = self._preload(part).shortening
        assert shift is not None
        return float(shift)

    def mean_strain(self, part: str) -> np.ndarray:
        """Return the mean strain across periodic sides, given or found; collective.

        It is ``E t/|t|`` of the translation t between the sides [-], shape (d,): of
        sides across x the column (E_xx, E_xy) of E in the plane.

        Args:
            part: Name of either side.

        Raises:
            InputError: If no periodic sides have this part.
        """
        return mean_strain(self.model.space, self.scene.contacts, part)

    def bolt_force(self, part: str) -> float:
        """Return the force of a preload along its axis, in tension > 0; collective.

        It is the force of u [force], which in the steps of a history changes with the
        load. ``force(part)`` has all its components.

        Args:
            part: Name of either side of its cut.

        Raises:
            InputError: If no preload has this part.
        """
        first = self._preload(part).facets
        axes = {preload.name: preload.axis for preload in self.model.preloads}
        return float(self.force(first).force @ axes[first])

    def _preload(self, part: str) -> Preload:
        """Return the preload that has a part."""
        preloads: dict[str, Preload] = {}
        for tie in self.scene.ties:
            if isinstance(tie, Preload):
                preloads |= dict.fromkeys(tie.sides, tie)
        if part not in preloads:
            raise InputError(
                f"No preload has the part {part!r}; this scene has {listed(list(preloads))}."
            )
        return preloads[part]

    def profile(self, contact: str) -> np.ndarray:
        """Return gap, slip and tractions of the method along a contact; collective.

        For its columns see :func:`erc_contact.model.profile.profile_table`. The
        tractions are projected on polynomials on each facet, which have its force.

        Raises:
            InputError: If no contact has this name.
        """
        where = self.model.contact(contact)
        r, bound = self._at_profile_points(where)
        return profile_table(self.model.space, where, self.u, r, bound)

    def contact_area(self, contact: str) -> ContactArea:
        """Return the area of a contact and where it ends; collective.

        The margins contain what the mesh leaves unknown near the ends, and not the
        error of the solution, which an error knows (``error.contact_area``). See
        :func:`erc_contact.results.contact_area`.

        Raises:
            InputError: If no contact has this name.
        """
        where = self.model.contact(contact)
        r, bound = self._at_profile_points(where)
        can_open = self.model.can_open(where)
        return contact_area(self.model.space, where, self.u, r, bound, can_open=can_open)

    def contact_force(self, contact: str) -> ContactForce:
        """Return forces and pressures of a contact in a line; collective.

        See :func:`erc_contact.results.contact_force`.

        Raises:
            InputError: If no contact has this name.
        """
        where = self.model.contact(contact)
        r, _ = self._at_profile_points(where)
        return contact_force(self.model.space, where, r, self.contact_area(contact).area)

    def slip_before(self, contact: str) -> np.ndarray:
        """Return the displacement s that friction counts from [length]; collective.

        It is tangential, at the points of :meth:`profile` and the same on all ranks,
        shape (points, d). On a contact between bodies it is the displacement of this
        side relative to the other side. It is zero without history, and without
        friction. In a step of a history it is what the last solution ends with. But
        where Nitsche's method lets a point stick it is s of the last step: so points
        that stick do not creep.

        Raises:
            InputError: If no contact has this name.
        """
        where = self.model.contact(contact)
        s = slip_before_table(self.model.space, where)
        return s if contact == where.name else -s

    def maximum(self, quantity: str) -> Maximum:
        """Return the greatest value of a quantity and its place; collective.

        It may be the "von Mises" stress, the "pressure", ...: see
        :func:`erc_contact.model.greatest.find_maximum`. "displacement" reads u, "von
        Mises" the elastic stress at the middle of each cell, and quantities of contacts
        read :meth:`profile`.
        """
        return find_maximum(self.model, quantity, self.u, self.mises_at_middles, self.profile)

    def at(self, points: Any) -> ElasticValues:
        """Return displacement and elastic stress at points; collective.

        A point between several cells has the mean of their values. The stress follows
        from the displacement, and is not in equilibrium; the stress of an error is
        (``error.at``).

        Args:
            points: The same on all ranks [length], shape (n, d) or (d,).

        Raises:
            InputError: If the points have another shape or are not finite, or one lies
                outside the mesh.
        """
        model = self.model
        rows = at_points(model.space, points, self._values_at)
        u, stress = np.split(rows, [model.space.d], axis=1)
        return ElasticValues(u, tensors_of_points(model, stress))

    def along(self, start: Any, stop: Any, count: int = 101) -> np.ndarray:
        """Tabulate displacement and elastic stress along a straight line; collective.

        See :func:`erc_contact.model.points.along_line`.

        Args:
            start: Where the line starts [length], shape (d,).
            stop: Where it ends [length], shape (d,).
            count: Number of its points, evenly distributed.

        Raises:
            InputError: If an end has another shape, or a point lies outside the mesh.
        """
        model, d = self.model, self.model.space.d

        def values(cell: np.ndarray, x: np.ndarray) -> np.ndarray:
            u, mandel = np.split(self._values_at(cell, x), [d], axis=1)
            stress = stress_in_space(model, mandel, cell)
            return np.hstack([u, stress.reshape(-1, 9)])

        return along_line(model.space, (start, stop), count, values)

    def _values_at(self, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return rows of u and the elastic stress at points of owned cells."""
        model, d = self.model, self.model.space.d
        # DOLFINx does not evaluate at no points.
        u = np.zeros((0, d))
        if len(x):
            u = self.u.eval(in_space(x), cell).reshape(-1, d) + model.jumps_at(cell, x)
        return np.hstack([u, elastic_stress_at(model, self.u, cell, x)])

    def show(self) -> Any:
        """Show the deformed body with its elastic stress in 3D; collective.

        A notebook shows the view by itself, ``show().save(path)`` writes its page. See
        :func:`erc_contact.output.show_solution`.
        """
        return view_of(self)

    def traction(self, contact: str | ContactOnMesh) -> Ufl:
        """Return the traction of the method on a contact [force/area], UFL, shape (d,).

        On a tied joint it is the traction of the elastic stress of the first part.
        Between two bodies it is the traction on the softer body, for integrals over its
        part, which is the first of ``model.contact(name).side_names``.

        Args:
            contact: Its name, or the contact of the model.

        Raises:
            InputError: If no contact has this name.
        """
        if isinstance(contact, str):
            contact = self.model.contact(contact)
        if contact in self.model.ties:
            return ufl.dot(self.model.stress(self.u), contact.normal)
        place = self.model.contacts.index(contact)
        multiplier = self.multipliers[place] if self.multipliers else None
        contacts, u = self.carried or (self.model.contacts, self.u)
        return self.method.traction(self.model, contacts[place], u, multiplier)

    def _at_profile_points(self, contact: ContactOnMesh) -> tuple[np.ndarray, np.ndarray]:
        """Return traction and friction bound at the points of a profile [force/area].

        Their shapes are (f, q, d) and (f, q); the bound is infinite of a tied joint and
        of sides of copies.
        """
        space = self.model.space
        points = profile_points(space)
        r = profile_traction(space, contact, self.traction(contact))
        pressure = -split(r, contact.trace.normals_at(points)).normal
        if self.model.carries_any_shear(contact):
            return r, np.full_like(pressure, np.inf)
        return r, self._bound(contact, np.maximum(pressure, 0.0), points)

    def _bound(
        self, contact: ContactOnMesh, pressure: np.ndarray, points: np.ndarray
    ) -> np.ndarray:
        """Return the friction bound [force/area] of pressures at points of facets."""
        parameters = friction_parameters(self.model.space, contact, points)
        weights = self.model.space.section.weight(contact.trace.here.points_at(points))[..., 0]
        # On the axis the bound is a limit, 0 over 0.
        weights = np.maximum(weights, np.finfo(float).tiny)
        return contact.friction_bound(weights * pressure, parameters) / weights

    def _nodal_reactions(self) -> dict[str, np.ndarray]:
        """Return the nodal forces of each cause [force]; collective."""
        method = self.method
        options = {"in_layer": method.in_layer, "at_nodes": method.multiplier}
        return nodal_reactions(self.model, self.u, self.traction, **options)

    def mises_at_middles(self) -> np.ndarray:
        """Return the von Mises stress in the middle of owned cells [force/area]."""
        cells = self.model.space.owned_cells
        middles = self.model.space.cell_corners()[cells].mean(axis=1)
        stress = elastic_stress_at(self.model, self.u, cells, middles)
        return von_mises(stress_in_space(self.model, stress))
