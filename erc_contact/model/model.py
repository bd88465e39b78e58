"""A scene on a mesh: the data of the scene as UFL, and the forms of elasticity."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.simplex import rule
from erc_contact.model.contacts import bind_contact
from erc_contact.model.elasticity import ElasticMatrix
from erc_contact.model.expressions import evaluate, without_plain_numbers
from erc_contact.model.foundation import BoundContact
from erc_contact.model.last_step import LastStep
from erc_contact.model.motions import free_motions
from erc_contact.model.space import Space
from erc_contact.model.supports import bind_supports
from erc_contact.model.symbolic import varies_in_cells
from erc_contact.model.users import IN_UFL, call_of_user, try_material, vector
from erc_contact.model.values import DATA_DEGREE, moduli, parameter, value_of
from erc_contact.scene.load import Load
from erc_contact.scene.material import PLANE_STRAIN, Elastic, strain
from erc_contact.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class SurfaceLoad:
    """A load on a part of the boundary of a mesh.

    Attributes:
        facets: Name of the boundary part.
        ds: Measure of the part.
        density: Force per area [force/area], UFL, shape (d,).
    """

    facets: str
    ds: Any
    density: Any

    @property
    def varies(self) -> bool:
        """Tell whether the load varies inside facets."""
        return varies_in_cells(self.density)


class Model(Space):
    """A scene on a domain: its data as UFL and nodal values, and the forms of elasticity. Construction is collective.

    Args:
        scene: The scene.
        domain: The mesh with names.
        degree: Degree k of the displacement, 1 or 2.
        last: The last step of a history, after which friction counts the tangential
            displacement; None without.

    Attributes:
        parameters: Parameters of the material, UFL.
        surface_loads: Loads on parts of the boundary.
        body_force: Sum of the loads in the body [force/volume], UFL of shape (d,), or
            None.
        fixed: Which components are prescribed at each node, shape (nodes, d).
        prescribed: Prescribed displacement, a Function of V, zero elsewhere [length].
        bcs: The prescribed displacement as a Dirichlet condition of DOLFINx, in a list.
        fixed_facets: Facets (cell, local facet) and prescribed components of each
            support.
        contacts: The scene's contacts.
        free_motions: Rigid motions that no support holds, Functions of V, see
            :func:`free_motions`.

    Raises:
        InputError: If a name is unknown, a value or the degree is out of range, or
            supports contradict each other.
        NotHeldError: If neither supports nor contacts hold a rigid motion.
    """

    def __init__(
        self, scene: Scene, domain: Domain, degree: int = 1, last: LastStep | None = None
    ) -> None:
        super().__init__(domain, degree)
        self.scene = scene
        _check_dimension(scene, self.d)
        self.parameters = moduli(self, scene.material)
        if type(scene.material) is not Elastic:
            try_material(self.V, scene.material, self.parameters)
        supports = bind_supports(self, scene.supports)
        self.fixed, self.prescribed, self.bcs = supports.fixed, supports.prescribed, supports.bcs
        self.fixed_facets = supports.facets
        loads = [(load.facets, self._density(load)) for load in scene.loads]
        self.surface_loads = [
            SurfaceLoad(f, self.ds(domain.tag(f)), density) for f, density in loads if f is not None
        ]
        self.body_force = _sum([density for facets, density in loads if facets is None])
        self.contacts = [
            bind_contact(self, contact, self.modulus, last) for contact in scene.contacts
        ]
        self.free_motions = free_motions(self, self.fixed, self.contacts)

    # -- forms
    # -----------------------------------------------------------------------------------------

    def stress(self, u: Any) -> Any:
        """``sigma(u) = C eps(u)`` [force/area]."""
        return self.scene.material.stress(strain(u), **self.parameters)

    @cached_property
    def modulus(self) -> Any:
        """The modulus of the material, which scales contact parameters [force/area], UFL."""
        return self.scene.material.modulus(**self.parameters)

    @cached_property
    def elasticity(self) -> ElasticMatrix:
        """C in Mandel components [force/area] at points; collective."""
        return ElasticMatrix(self.scene.material, self.parameters, self.mesh)

    @cached_property
    def compliance(self) -> ElasticMatrix:
        """C^-1 in Mandel components [area/force] at points; collective."""
        return ElasticMatrix(self.scene.material, self.parameters, self.mesh, inverse=True)

    def stiffness(self, u: Any, v: Any) -> Any:
        """``a(u, v) = int sigma(u) : eps(v)``, a UFL form."""
        varies = any(varies_in_cells(parameter) for parameter in self.parameters.values())
        dx = self.dx(metadata={"quadrature_degree": DATA_DEGREE}) if varies else self.dx
        return ufl.inner(self.stress(u), strain(v)) * dx

    def loads(
        self, v: Any, *, varying: bool = True, on: Collection[str | None] | None = None
    ) -> Any | None:
        """``f(v) + F(v)``, a UFL form, or None without loads.

        Args:
            v: Test function, or a displacement.
            varying: Whether loads that vary inside cells are included.
            on: Names of the boundary parts whose loads are included; None among them
                stands for the body. By default all loads are included.
        """
        loads: list[tuple[str | None, Any, Any]] = [
            (one.facets, one.density, one.ds) for one in self.surface_loads
        ]
        if self.body_force is not None:
            loads.append((None, self.body_force, self.dx))
        taken = [(density, measure) for part, density, measure in loads if on is None or part in on]
        return _sum(
            [ufl.inner(f, v) * measure for f, measure in taken if varying or not varies_in_cells(f)]
        )

    @cached_property
    def cell_modulus(self) -> fem.Function:
        """The modulus at the middle of each cell [force/area], constant in cells; collective.

        Forms that need only the size of the modulus contain this. They are then the
        same for all materials.
        """
        modulus = self.domain.function("DG", 0)
        cells = np.arange(len(modulus.x.array), dtype=np.int32)
        modulus.x.array[:] = self.at_middles(self.modulus, cells)
        return modulus

    def stiffness_per_area(self, gamma: Any, modulus: Any = None) -> Any:
        """``gamma E k^2/h`` [force/volume] with h the height of a cell over its facet, UFL on facets.

        Args:
            gamma: Factor gamma_0 [-].
            modulus: E [force/area], by default the modulus of the material.
        """
        h = self.d * ufl.CellVolume(self.mesh) / ufl.FacetArea(self.mesh)
        return gamma * self.degree**2 * (self.modulus if modulus is None else modulus) / h

    def stiffest(self) -> float:
        """Greatest modulus at the middle of the cells of all ranks [force/area]; collective."""
        return self.extremes(self.at_middles(self.modulus, self.owned_cells))[1]

    # -- data on contacts
    # ------------------------------------------------------------------------------

    def contact(self, name: str) -> BoundContact:
        """The contact of a name.

        Raises:
            InputError: If no contact has this name.
        """
        found = {contact.name: contact for contact in self.contacts}
        if name not in found:
            raise InputError(
                f"No contact is called {name!r}; this scene has {', '.join(sorted(found)) or 'none'}."
            )
        return found[name]

    def friction_parameters(
        self, contact: BoundContact, points: np.ndarray
    ) -> dict[str, np.ndarray]:
        """The law's parameters at reference points (q, d-1) of the facets of a contact, each of shape (f, q)."""
        parameters = contact.friction.parameters if contact.friction else {}
        return {k: evaluate(v, self.mesh, points, contact.facets) for k, v in parameters.items()}

    def gap_at_nodes(self, contact: BoundContact) -> np.ndarray:
        """The gap at the nodes of each facet of a contact [length], shape (facets, m)."""
        if contact.gap is None:
            return np.zeros((len(contact.facets), len(self.facet_points)))
        return evaluate(contact.gap, self.mesh, self.facet_points, contact.facets)

    def at_nodes(self, contact: BoundContact) -> BoundContact:
        """The contact with gap and friction parameters as Functions, for quadrature at its nodes; collective.

        So the forms do not contain the callables of the user. The nodal values of the
        Functions are the values of the friction parameters, and the Bernstein
        coefficients of the gap and of the displacement of the last step.
        """
        gap, friction, trace = contact.gap, contact.friction, contact.trace
        if trace.before is not None:
            before = trace.before.copy()
            self.to_coefficients(before.x.array.reshape(-1, self.d), [contact])
            trace = replace(trace, before=before)
        if contact.gap_varies:
            gap = self._nodal(contact, self.gap_at_nodes(contact), coefficients=True)
        if friction is not None:
            varying = {
                name: value for name, value in friction.parameters.items() if varies_in_cells(value)
            }
            at = {
                name: evaluate(v, self.mesh, self.facet_points, contact.facets)
                for name, v in varying.items()
            }
            nodal = {name: self._nodal(contact, values) for name, values in at.items()}
            friction = replace(friction, parameters={**friction.parameters, **nodal})
        return replace(contact, gap=gap, friction=friction, trace=trace)

    def _nodal(
        self, contact: BoundContact, values: np.ndarray, *, coefficients: bool = False
    ) -> Any:
        """A scalar, UFL, from its values (facets, m) at the nodes of a contact.

        Its nodal values are these values, or their Bernstein coefficients.
        """
        nodal = self.function()
        at = nodal.x.array.reshape(-1, self.d)
        at[contact.trace.here.nodes, 0] = values
        if coefficients:
            self.to_coefficients(at, [contact])
        return nodal[0]

    # -- loads
    # -----------------------------------------------------------------------------------------

    def _density(self, load: Load) -> Any:
        """The density of a load [force/area] or [force/volume], UFL, shape (d,); collective.

        Raises:
            InputError: If it has another shape, is not finite, or the code of the user
                raises.
        """
        on_boundary = load.facets is not None
        what = type(load).__name__ + (f"({load.facets!r})" if on_boundary else "")
        parameters = {
            name: value_of(
                self, parameter(load, name), what if name == "value" else f"{what}: {name}"
            )
            for name in load.parameters
        }
        normal = self.n if on_boundary else None
        density = call_of_user(
            self.comm, what, lambda: vector(load.density(self.x, normal, **parameters))
        )
        density = without_plain_numbers(density, self.mesh)
        if density.ufl_shape != (self.d,):
            raise InputError(
                f"{what} has shape {density.ufl_shape}; the mesh needs ({self.d},). {IN_UFL}"
            )
        if varies_in_cells(density):
            entities = (
                self.domain.facets(load.facets) if load.facets is not None else self.owned_cells
            )
            points, _ = rule(self.d - 1 if on_boundary else self.d, DATA_DEGREE)
            if not np.isfinite(self.extremes(evaluate(density, self.mesh, points, entities))).all():
                raise InputError(f"{what} is not finite everywhere; look at its callables.")
        return density


def _sum(terms: list[Any]) -> Any | None:
    return sum(terms[1:], start=terms[0]) if terms else None


def _check_dimension(scene: Scene, d: int) -> None:
    """Check that the vectors of the scene have as many components as the mesh has dimensions."""
    vectors: list[tuple[Any, Any]] = [(support, support.value) for support in scene.supports]
    vectors += [(contact, contact.normal) for contact in scene.contacts]
    for load in scene.loads:
        vectors += [(load, parameter(load, name)) for name in load.parameters]
    for owner, value in vectors:
        if isinstance(value, tuple) and len(value) != d:
            part = "" if owner.facets is None else f"({owner.facets!r})"
            raise InputError(
                f"{type(owner).__name__}{part} has the vector {value} of {len(value)} components, but the mesh is "
                f"{d}D: give {d}."
            )
    hypothesis = getattr(scene.material, "hypothesis", PLANE_STRAIN)
    if d == 3 and hypothesis != PLANE_STRAIN:
        raise InputError(
            f"{type(scene.material).__name__}: hypothesis is {hypothesis!r}, and the mesh is 3D: leave it out, a body "
            "in space has none."
        )
