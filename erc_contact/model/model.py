"""Put a scene on a mesh: its data as UFL, and the forms of elasticity."""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property
from typing import TYPE_CHECKING, Any
from warnings import warn

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.carrying import state_of
from erc_contact.model.contact.connections import Connections
from erc_contact.model.contact.contact_values import at_nodes, friction_parameters, gap_at_nodes
from erc_contact.model.contact.contacts import bind_contact
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.friction import PROPORTIONAL
from erc_contact.model.contact.jumps import gap_by_coefficients
from erc_contact.model.contact.periodic import periodic_pairs
from erc_contact.model.contact.ties import bind_tie
from erc_contact.model.data.symbolic import has_arguments, sum_of, varies_in_cells
from erc_contact.model.data.users import try_material, try_potential
from erc_contact.model.data.values import DATA_DEGREE, moduli
from erc_contact.model.dimension import check_dimension, check_half_plane
from erc_contact.model.last_step import Greatest, LastStep
from erc_contact.model.law.constitution import Constitution
from erc_contact.model.law.point_law import PointLaw
from erc_contact.model.law.potential import ConvexConstitution, Linearised
from erc_contact.model.law.strains import Strains, bind_strains, moved_by
from erc_contact.model.loads import bind_hoop_load, bind_loads
from erc_contact.model.meridian import Meridian
from erc_contact.model.motions.held_motions import held_products, loose_motions, resisted_by_all
from erc_contact.model.motions.rigid_faces import face_forces
from erc_contact.model.motions.rigid_motions import bodies_of_nodes, body_motions, motions_not_held
from erc_contact.model.motions.unheld import Relief, find_unheld, relief_of
from erc_contact.model.preload import (
    bind_preloads,
    check_beside_cuts,
    jump_gradients,
    jump_strains,
    jumps_at,
    shifts_of,
)
from erc_contact.model.section import Section
from erc_contact.model.space import Space
from erc_contact.model.springs import bind_springs
from erc_contact.model.supports import bind_supports, check_neighbours, dirichlet_conditions
from erc_contact.scene.material import Elastic, is_axisymmetric
from erc_contact.scene.potential import has_potential
from erc_contact.scene.scene import Scene, count_varying
from namedmesh import Domain
from namedmesh.base.names import known_names

OF_SPACE = "mesh", "n", "x", "V", "d", "contact_degree", "nodal_rule"
"""What methods of users read of a model in version 0.1 and of its space now."""


class Model:
    """Hold a scene on a domain: its data as UFL, and forms of elasticity.

    Construction is collective.

    Args:
        scene: The scene.
        domain: The mesh with names. It gets the tied joints of the scene, and the pairs
            of its periodic sides.
        degree: Degree k of the displacement, 1 or 2.
        last: The last step of a history, after which friction counts the tangential
            displacement; None without.

    Attributes:
        scene: As given.
        domain: The domain with the tied joints and periodic sides of the scene.
        space: The displacement's space on it.
        parameters: Parameters of the material, UFL.
        material: The linear law of the body; of a potential its linearisation.
        linearised: This linearisation, None for a linear law.
        strains: The given strains; None without any.
        constitution: The law between strain and stress.
        springs: The springs on parts of the boundary.
        surface_loads: Loads on parts of the boundary.
        body_force: Sum of the loads in the body [force/volume], UFL of shape (d,), or
            None.
        hoop_load: The radial body force f_r of an axisymmetric body as the hoop
            component ``c r f_r`` of a stress (``erc_contact.model.meridian``).
        fixed: Which components are prescribed, or anchored, at each node, shape (nodes,
            d).
        prescribed: Prescribed displacement, a Function of V, zero elsewhere [length].
        bcs: The prescribed displacement as a Dirichlet condition of DOLFINx, in a list.
        held: Which components have a given value; on a loose rigid face components are
            fixed up to its motion.
        loose_faces: The rigid faces whose motions are not all given.
        face_forces: Nodal forces of their resultants, or None.
        fixed_facets: Facets (cell, local facet) and prescribed components of each
            support.
        contacts: The scene's contacts.
        ties: The scene's tied joints.
        preloads: Its preloads, each one of the joints.
        connections: The nodes that contacts between bodies connect.
        bodies: Number of the body of each node of this rank, and number of bodies.
        unheld: The motions that nothing holds, and their anchors.
        relief: What takes up a small resultant of loads on these; None without any.
        centres: Centre of each body [length], shape (bodies, d).
        body_sizes: Size of each body [length], shape (bodies,).
        loose: Motions of each body that neither supports nor bilateral contacts hold,
            in shares of the motions about its centre, shape (m, K) each.
        free_motions: Rigid motions that neither supports nor anchors hold, Functions of
            V, see :func:`motions_not_held`.
        is_later_step: Whether the scene is a step of a history after another one.
        greatest_before: The sizes of the history before this step, 0 without one.
        gap_limits: Polynomials below the gap that were found [length], shape (f, c, m),
            contact -> coefficients.

    Raises:
        InputError: If a name is unknown, a value or the degree is out of range, or
            supports contradict each other.
        NotHeldError: If loads are not in balance on a rigid motion that nothing holds.
    """

    strains: Strains | Linearised | None
    constitution: Constitution

    def __init__(
        self, scene: Scene, domain: Domain, degree: int = 1, last: LastStep | None = None
    ) -> None:
        section = Meridian if is_axisymmetric(scene.material) else Section
        tied = domain.tied([tie.sides for tie in scene.ties])
        self.domain = tied.with_periodic(periodic_pairs(scene.contacts, tied))
        space = Space(self.domain, degree, section, count_varying(scene))
        self.space = space
        self.scene = scene
        self.is_later_step = last is not None
        self.greatest_before = Greatest() if last is None else last.greatest
        check_dimension(scene, space.d)
        check_half_plane(space, scene)
        self.parameters = moduli(space, scene.material) | moved_by(space, scene)
        material: Any = scene.material
        self.material = material
        self.linearised: Linearised | None = None
        if has_potential(scene.material):
            try_potential(space.comm, scene.material, self.parameters)
            state = None if last is None else last.state
            state = state_of(space, scene.material, state)
            law = PointLaw(space, scene.material, self.parameters, state)
            self.linearised = Linearised(space, scene.material, law, self.parameters)
            self.material = self.linearised
            self.strains = self.linearised
            self.constitution = ConvexConstitution(self.linearised)
        elif type(scene.material) is not Elastic:
            try_material(space.V, self.material, self.parameters, space.section.strain)
        self.ties = [bind_tie(space, tie, self.modulus) for tie in scene.ties]
        self.preloads = bind_preloads(space, scene.ties, self.ties)
        self.bind_strains(scene)
        self.springs = bind_springs(space, scene.springs, self.modulus)
        self.bind_supports_and_loads(scene)
        self.contacts = []
        for contact in scene.contacts:
            self.contacts.append(bind_contact(space, contact, self.modulus, last))
        self.gap_limits: dict[ContactOnMesh, np.ndarray] = {}
        check_neighbours(space, self.loose_faces, self.held, self.contacts)
        check_beside_cuts(space, self.preloads, self._held_facets(), self.contacts)
        self.bodies = bodies_of_nodes(space)
        motions = body_motions(space, *self.bodies)
        resisting = self.springs, self.loose_faces
        held = held_products(space, self.bodies, motions.values, self.held, *resisting)
        by_all = resisted_by_all(space, self.bodies, motions.values, held, self.contacts)
        self.unheld = find_unheld(space, self.bodies, motions, self.fixed, by_all, self.contacts)
        self.anchor()
        self.bind_connections()
        if self.unheld.functions:
            # Anchors hold motions, too.
            fixed = self.held_or_anchored
            held = held_products(space, self.bodies, motions.values, fixed, *resisting)
        self.free_motions = motions_not_held(space, self.bodies[0], motions.values, held)
        self.centres = motions.centres
        self.body_sizes = motions.sizes
        self.loose = loose_motions(space, self.bodies, motions.values, held, self.contacts)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Return what a method of users reads of the space, as in version 0.1.

            It is to go with version 0.4.
            """
            if name not in OF_SPACE:
                raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
            warn(f"Write model.space.{name} for model.{name}.", DeprecationWarning, stacklevel=2)
            return getattr(self.space, name)

    def bind_supports_and_loads(self, scene: Scene) -> None:
        """Put the supports and loads of a scene on the mesh; collective."""
        supports = bind_supports(self.space, scene.supports)
        self.fixed = supports.fixed
        self.prescribed = supports.prescribed
        self.bcs = dirichlet_conditions(self.space, self.prescribed, self.fixed)
        self.fixed_facets = supports.facets
        self.held = supports.held
        self.loose_faces = supports.loose_faces
        self.face_forces = face_forces(self.space, self.loose_faces)
        self.surface_loads, self.body_force = bind_loads(self.space, scene.loads)
        self.relief: Relief | None = None
        self.hoop_load = bind_hoop_load(self.space, self.body_force)

    def bind_strains(self, scene: Scene) -> None:
        """Put the strains and the preloads of a scene on the mesh; collective."""
        shifts = shifts_of(scene.ties)
        if self.linearised is not None:
            if self.preloads:
                self.linearised.take_jumps(jump_strains(self.space, self.preloads, shifts))
            return
        of_preloads = []
        for preload in self.preloads:
            strain = preload.strain(shifts[preload.name])
            of_preloads.append(self.space.section.in_body(strain))
        self.strains = bind_strains(
            self.space, scene.strains, self.material, self.parameters, of_preloads
        )
        self.constitution = Constitution(self.space, self.material, self.parameters, self.strains)

    def _held_facets(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Return name, facets and held components of each support and spring."""
        held = []
        for support, (facets, components) in zip(
            self.scene.supports, self.fixed_facets, strict=True
        ):
            held.append((support.facets, facets, components))
        for spring in self.springs:
            held.append((spring.name, spring.side.facets, np.ones(self.space.d, dtype=bool)))
        return held

    def anchor(self) -> None:
        """Anchor the motions that nothing holds, if loads are in balance; collective.

        Raises:
            NotHeldError: If they are not.
        """
        if not self.unheld.functions:
            return
        loads = self.load_forces(strains=False)
        loaded = [load.facets for load in self.surface_loads]
        in_body = self.body_force is not None
        self.relief = relief_of(self.space, self.unheld, loads, loaded, in_body=in_body)
        if self.relief is not None:
            force = self.relief.density
            self.body_force = force if self.body_force is None else self.body_force + force
            self.hoop_load = bind_hoop_load(self.space, self.body_force)
        self.fixed = self.fixed | self.unheld.anchors
        self.bcs = dirichlet_conditions(self.space, self.prescribed, self.fixed)

    @property
    def held_or_anchored(self) -> np.ndarray:
        """Tell which components supports or anchors hold, shape (nodes, d)."""
        return self.held | self.unheld.anchors

    @property
    def supported(self) -> np.ndarray:
        """Tell which fixed components supports prescribe, shape (nodes, d)."""
        return self.fixed & ~self.unheld.anchors

    def without_unheld(self, u: fem.Function) -> fem.Function:
        """Return a displacement less its motions that nothing holds; collective.

        What is left has ``int u . q = 0`` for each of these motions q.
        """
        functions = self.unheld.functions
        if not functions:
            return u
        products = np.zeros((len(functions), len(functions) + 1))
        for k, q in enumerate(functions):
            for i, v in enumerate([*functions, u]):
                products[k, i] = self._product(q, v)
        amounts = np.linalg.solve(products[:, :-1], products[:, -1])
        without_motions = u.copy()
        for amount, q in zip(amounts, functions, strict=True):
            without_motions.x.array[:] -= amount * q.x.array
        return without_motions

    def _product(self, u: fem.Function, v: fem.Function) -> float:
        """Return ``int u . v`` over the bodies; collective."""
        form = compiled.form(self.space.on_meridian(ufl.inner(u, v)) * self.space.dx)
        return float(self.space.comm.allreduce(fem.assemble_scalar(form), MPI.SUM))

    def bind_connections(self) -> None:
        """Find the nodes that contacts connect, given supports; collective."""
        traces = [contact.trace for contact in self.contacts]
        self.connections = Connections(self.space, traces, self.fixed)

    # -- forms

    def stress(self, u: Ufl) -> Ufl:
        """Return the stress ``C (eps(u) - eps_0)`` [force/area], UFL, shape (d, d).

        Its variation has no given strain eps_0: it is ``C eps(v)`` for a test or trial
        function v. Of an axisymmetric body it is the part in the half plane, times the
        circumference [force/length].
        """
        elastic_strain = self.space.section.strain(u)
        given = None if has_arguments(u) else self.strains
        if isinstance(given, Strains):
            elastic_strain -= given.tensor
        stress = self._stress_of(elastic_strain)
        if isinstance(given, Linearised):
            stress -= self.space.on_meridian(given.given_stress)
        return self.space.section.in_mesh(stress)

    def _stress_of(self, elastic_strain: Ufl) -> Ufl:
        """Return ``C eps`` [force/area], on rings times the circumference, UFL."""
        stress = self.material.stress(elastic_strain, **self.parameters)
        return self.space.on_meridian(stress)

    @cached_property
    def modulus(self) -> Ufl:
        """Return the modulus that scales contact parameters [force/area], UFL.

        It is times the circumference if there is one.
        """
        return self.space.on_meridian(self.material.modulus(**self.parameters))

    def stiffness(self, u: Ufl, v: Ufl) -> Ufl:
        """Return the UFL form ``a(u, v) = int C eps(u) : eps(v)``, with the springs."""
        stress = self._stress_of(self.space.section.strain(u))
        measure = self._measure(self.constitution.stiffness.form_varies)
        form = ufl.inner(stress, self.space.section.strain(v)) * measure
        for spring in self.springs:
            form += spring.work(u, v)
        return form

    def strain_loads(self, v: Ufl) -> Ufl | None:
        """Return the UFL form ``int C eps_0 : eps(v)``, or None without given strains.

        Args:
            v: Test function, or a displacement.
        """
        if self.strains is None:
            return None
        if isinstance(self.strains, Linearised):
            stress = self.space.on_meridian(self.strains.given_stress)
        else:
            stress = self._stress_of(self.strains.tensor)
        measure = self._measure(self.constitution.form_varies)
        return ufl.inner(stress, self.space.section.strain(v)) * measure

    def _measure(self, varying: bool) -> Ufl:
        """Return dx for data that vary in cells or do not.

        The solver and the reconstruction integrate varying data by one rule, so that
        both know the same body.
        """
        return (
            self.space.dx(metadata={"quadrature_degree": DATA_DEGREE}) if varying else self.space.dx
        )

    def load_forces(self, *, strains: bool) -> fem.Function:
        """Return the nodal forces of the loads [force], not yet summed over ranks.

        Args:
            strains: Whether they are with the forces of given strains.
        """
        b = self.space.function()
        loads = self.loads(ufl.TestFunction(self.space.V))
        if loads is not None:
            fem.assemble_vector(b.x.array, compiled.form(loads))
        if strains and self.strains is not None:
            if self.strains.load_form is None:
                v = ufl.TestFunction(self.space.V)
                self.strains.load_form = compiled.form(self.strain_loads(v))
            fem.assemble_vector(b.x.array, self.strains.load_form)
        if self.face_forces is not None:
            b.x.array[:] += self.face_forces.x.array
        return b

    def loads(
        self, v: Ufl, *, varying: bool = True, on: Collection[str | None] | None = None
    ) -> Ufl | None:
        """Return the UFL form ``f(v) + F(v)``, or None without loads.

        Args:
            v: Test function, or a displacement.
            varying: Whether loads that vary inside cells are included.
            on: Names of the boundary parts whose loads are included; None among them
                stands for the body. By default all loads are included.
        """
        loads: list[tuple[str | None, Ufl, Ufl]] = []
        for load in self.surface_loads:
            loads.append((load.facets, load.density, load.ds))
        if self.body_force is not None:
            loads.append((None, self.body_force, self.space.dx))
        terms = []
        for part, density, measure in loads:
            if on is not None and part not in on:
                continue
            if varying or not varies_in_cells(density):
                terms.append(ufl.inner(density, v) * measure)
        return sum_of(terms)

    @cached_property
    def cell_modulus(self) -> fem.Function:
        """Return the modulus at the middle of each cell [force/area]; collective.

        It is constant in cells. Forms that need only the size of the modulus contain
        this. They are then the same for all materials.
        """
        modulus = self.domain.function("DG", 0)
        cells = np.arange(len(modulus.x.array), dtype=np.int32)
        modulus.x.array[:] = self.space.at_middles(self.modulus, cells)
        return modulus

    def stiffness_per_area(self, gamma: Ufl, modulus: Ufl = None) -> Ufl:
        """Return ``gamma E k^2/h`` on facets [force/volume], UFL.

        Here h is the height of a cell over its facet.

        Args:
            gamma: Factor gamma_0 [-].
            modulus: E [force/area], by default the modulus of the material.
        """
        h = self.space.d * ufl.CellVolume(self.space.mesh) / ufl.FacetArea(self.space.mesh)
        E = self.modulus if modulus is None else modulus
        return gamma * self.space.degree**2 * E / h

    def stiffest(self) -> float:
        """Return the greatest modulus at middles of cells [force/area]; collective."""
        return self.space.extremes(self.space.at_middles(self.modulus, self.space.owned_cells))[1]

    def jumps_at(self, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return what shifts of preloads add to the displacement [length], (n, d).

        Args:
            cell: A cell of this rank for each point, shape (n,).
            x: The points [length], shape (n, d).
        """
        return jumps_at(
            self.preloads, shifts_of(self.scene.ties), cell, x, self.space.cell_corners()
        )

    def jump_gradients(self, cells: np.ndarray) -> np.ndarray:
        """Return the derivatives of what these shifts add in cells [-], (n, d, d)."""
        return jump_gradients(self.preloads, shifts_of(self.scene.ties), cells, self.space.d)

    # -- data on contacts

    def contact(self, name: str) -> ContactOnMesh:
        """Return the contact or tied joint of a name; each of two bodies has one.

        Raises:
            InputError: If no contact has this name.
        """
        contacts: dict[str, ContactOnMesh] = {}
        for contact in (*self.contacts, *self.ties):
            contacts |= dict.fromkeys(contact.side_names, contact)
        if name not in contacts:
            raise InputError(
                f"No contact is called {name!r}; this scene has {known_names(name, contacts)}"
            )
        return contacts[name]

    def can_open(self, contact: ContactOnMesh) -> bool:
        """Tell whether a contact or tied joint may open."""
        return not contact.bilateral and contact not in self.ties

    def carries_any_shear(self, contact: ContactOnMesh) -> bool:
        """Tell whether no friction bounds a tied joint, or the sides of copies."""
        return contact.is_periodic or contact in self.ties

    def greatest_coefficient(self, contact: ContactOnMesh) -> float:
        """Return the greatest coefficient of Coulomb friction [-]; collective.

        It is zero without friction, and where the bound is no multiple of the pressure.
        """
        if contact.friction is None or contact.friction.dependence != PROPORTIONAL:
            return 0.0
        parameters = friction_parameters(self.space, contact, self.space.facet_points)
        ones = np.ones((len(contact.facets), len(self.space.facet_points)))
        _, most = self.space.extremes(contact.friction_bound(ones, parameters))
        return most * contact.friction_set.longest

    def at_nodes(self, contact: ContactOnMesh) -> ContactOnMesh:
        """Return a contact with its data as Functions; collective.

        It is for quadrature at the nodes. So the forms do not contain the callables of
        the user. The nodal values of the Functions are the values of the friction
        parameters, and the Bernstein coefficients of the gap and of the displacement of
        the last step.
        """
        gaps = gap_at_nodes(self.space, contact)
        return at_nodes(self.space, contact, gap_by_coefficients(self.space, contact, gaps))
