"""A scene on a mesh: names become measures, numbers become Constants, callables become UFL of x.

Everything that one may sweep (moduli, friction, loads, parameters of the method) is a ``fem.Constant``: no
form is compiled anew because a number changed.

Symbols: d dimension, k degree, V continuous vector P_k, m nodes of a facet, x position [length].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.partition import check_shape
from erc_contact.mesh.simplex import (
    at_nodes,
    coefficients,
    facet_vertices,
    lattice,
    node_between,
    node_vertices,
    nodes,
    rule,
)
from erc_contact.mesh.surface import offset
from erc_contact.model import promises
from erc_contact.model.expressions import evaluate, varies, varies_in_cells
from erc_contact.model.foundation import BoundContact
from erc_contact.model.motions import free_motions
from erc_contact.model.users import called, scalar, try_material, vector
from erc_contact.scene.law import Coulomb, Tresca
from erc_contact.scene.material import Elastic, mandel_matrix, strain
from erc_contact.scene.scene import Contact, Scene, Traction

FLAT = 1e-8
"""Largest deviation of the facet normals of a contact that counts as flat [-]."""


DATA_DEGREE = 4
"""Quadrature degree for moduli and loads that vary in space, the same in the solver and in what reads its stress."""


class Model:
    """A scene on a domain: spaces, measures, data, and the forms of elasticity.

    Args:
        scene: What the user declared.
        domain: The mesh with names.
        degree: Degree k of the displacement, 1 or 2.

    Attributes:
        V: Continuous vector P_k space.
        nodes: Block degrees of freedom of each cell, vertices first, ghosts included, shape (cells, N).
        vertices: Those of the vertices, shape (cells, d+1).
        fixed: Which components are prescribed at each node, shape (nodes, d).
        prescribed: Prescribed displacement, a Function of V, zero elsewhere [length].
        bcs: The same as Dirichlet conditions.
        contacts: The scene's contacts.
        friction_share: Factor of all friction coefficients, 1 but while a solver raises friction in steps.
        free_motions: Rigid motions that no support holds, a list of Functions of V (orthonormal combinations).

    Raises:
        InputError: If a name is unknown, a value or the degree is out of range, supports contradict each other at
            a node, a support violates the gap, or the scene breaks a promise (:mod:`erc_contact.model.promises`).
        NotHeldError: If neither supports nor contacts hold a rigid motion.
    """

    def __init__(self, scene: Scene, domain: Domain, degree: int = 1) -> None:
        if degree not in (1, 2):
            raise InputError(f"degree is {degree!r}; allowed are 1 and 2.")
        self.scene, self.domain, self.degree = scene, domain, degree
        self.mesh, self.d = domain.mesh, domain.dim
        self.comm = self.mesh.comm
        self.x = ufl.SpatialCoordinate(self.mesh)
        self.n = ufl.FacetNormal(self.mesh)
        self._check_dimension()
        check_shape(self.mesh)
        self.V = fem.functionspace(self.mesh, ("Lagrange", degree, (self.d,)))
        self.nodes = self.V.dofmap.list
        self.vertices = self.nodes[:, : self.d + 1]
        self.local_facets = facet_vertices(self.d)
        self._facet_vertices = self._ordered_vertices()
        self.ds = ufl.Measure("ds", domain=self.mesh, subdomain_data=domain.facet_tags)
        self.dx = ufl.Measure("dx", domain=self.mesh)
        self.parameters = {name: self._parameter(name) for name in scene.material.parameters}
        if not isinstance(scene.material, Elastic):
            try_material(self)
        self._bind_supports()
        self.body_force = self._sum([self._vector(b.value, "BodyForce") for b in scene.body_forces])
        self.tractions = [(t.facets, self.ds(domain.tag(t.facets)), self._traction(t)) for t in scene.tractions]
        self._check_loads()
        self.friction_share = fem.Constant(self.mesh, 1.0)
        self.contacts = [self._contact(c) for c in scene.contacts]
        promises.check(self)
        self._check_supports_in_gap()
        self.free_motions = free_motions(self)

    # -- forms -----------------------------------------------------------------------------------------

    def stress(self, u: Any) -> Any:
        """``sigma(u) = C eps(u)`` [force/area]."""
        return self.scene.material.stress(strain(u), **self.parameters)

    @cached_property
    def stiffness_matrix(self) -> Any:
        """C in Mandel components [force/area]: numbers (s, s) where the material does not vary, else UFL."""
        return self._matrix(self.scene.material.stress)

    @cached_property
    def compliance_matrix(self) -> Any:
        """C^-1 in Mandel components [area/force]: numbers (s, s) where the material does not vary, else UFL."""
        return self._matrix(self.scene.material.compliance)

    @property
    def varying_moduli(self) -> bool:
        """Whether the moduli vary inside cells."""
        matrices = self.stiffness_matrix, self.compliance_matrix
        return any(not isinstance(matrix, np.ndarray) and varies_in_cells(matrix) for matrix in matrices)

    def _matrix(self, act: Callable[..., Any]) -> Any:
        matrix = mandel_matrix(act, self.d, **self.parameters)
        return matrix if varies(matrix) else evaluate(matrix, self.domain, nodes(self.d, 0), np.zeros(1))[0, 0]

    def stiffness(self, u: Any, v: Any) -> Any:
        """``a(u, v) = int sigma(u) : eps(v)``, a UFL form."""
        varies = any(varies_in_cells(parameter) for parameter in self.parameters.values())
        dx = self.dx(metadata={"quadrature_degree": DATA_DEGREE}) if varies else self.dx
        return ufl.inner(self.stress(u), strain(v)) * dx

    def loads(self, v: Any, *, varying: bool = True) -> Any | None:
        """``f(v) + F(v)``, a UFL form, or None without loads; ``varying=False`` leaves out what varies in cells."""
        terms = [ufl.inner(F, v) * ds for _, ds, F in self.tractions if varying or not varies_in_cells(F)]
        if self.body_force is not None and (varying or not varies_in_cells(self.body_force)):
            terms.append(ufl.inner(self.body_force, v) * self.dx)
        return self._sum(terms)

    def greatest(self, expression: Any) -> float:
        """Greatest value of a scalar UFL expression at the middle of the cells of all ranks; collective."""
        middle = np.full((1, self.d), 1 / (self.d + 1))
        return self._range(
            evaluate(expression, self.domain, middle, np.arange(self.domain.owned_cells, dtype=np.int32))
        )[1]

    def facet_nodes(self, facets: np.ndarray) -> np.ndarray:
        """Nodes of facets given as (cell, local facet), in the order of a facet's reference nodes, shape (n, m).

        DOLFINx turns the reference facet by the global numbers of its vertices; where the reference vertices of
        each facet come to lie tells the order, so that nodal values and :func:`evaluate` agree.
        """
        ends = self._facet_vertices[facets[:, 0], facets[:, 1]][:, node_vertices(self.d - 1, self.degree)]
        number = node_between(self.d, self.degree)[ends[..., 0], ends[..., 1]]
        return np.take_along_axis(self.nodes[facets[:, 0]], number, axis=1)

    def _ordered_vertices(self) -> np.ndarray:
        """Local vertices of the named facets in the order of the reference facet, shape (cells, d+1, d)."""
        facets = np.concatenate([self.domain.facets(name) for name in self.domain.outer])
        vertices = self.local_facets[facets[:, 1]]
        local = np.take_along_axis(self.mesh.geometry.dofmaps[0][facets[:, 0]], vertices, axis=1)
        known = self.mesh.geometry.x[local][:, None, :, : self.d]
        found = evaluate(self.x, self.domain, nodes(self.d - 1, 1), facets)[:, :, None, :]
        order = np.linalg.norm(found - known, axis=-1).argmin(axis=2)
        every = np.tile(self.local_facets.astype(np.int8), (len(self.nodes), 1, 1))
        every[facets[:, 0], facets[:, 1]] = np.take_along_axis(vertices, order, axis=1)
        return every

    def global_numbers(self, nodes: np.ndarray) -> np.ndarray:
        """Global numbers of nodes of this rank."""
        return self.V.dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32)).reshape(nodes.shape)

    @property
    def facet_points(self) -> np.ndarray:
        """Reference points of the nodes of a facet, shape (m, d-1)."""
        return nodes(self.d - 1, self.degree)

    def facet_areas(self, facets: np.ndarray) -> np.ndarray:
        """Areas of facets given as (cell, local facet) [length^(d-1)], shape (n,)."""
        local = self.mesh.geometry.dofmaps[0][facets[:, 0]]
        x = self.mesh.geometry.x[np.take_along_axis(local, self.local_facets[facets[:, 1]], axis=1), : self.d]
        edges = x[:, 1:] - x[:, :1]
        return np.sqrt(np.linalg.det(edges @ edges.transpose(0, 2, 1))) / (self.d - 1)

    def facet_corners(self, facets: np.ndarray) -> np.ndarray:
        """Vertices of facets given as (cell, local facet) in the order of the reference facet [length], (n, d, d)."""
        local = self.mesh.geometry.dofmaps[0][facets[:, 0]]
        ends = self._facet_vertices[facets[:, 0], facets[:, 1]]
        return self.mesh.geometry.x[np.take_along_axis(local, ends, axis=1), : self.d]

    def cell_corners(self) -> np.ndarray:
        """Vertices of all cells in DOLFINx's order [length], shape (cells, d+1, d)."""
        return self.mesh.geometry.x[self.mesh.geometry.dofmaps[0], : self.d]

    # -- values ----------------------------------------------------------------------------------------

    def _sum(self, terms: list[Any]) -> Any | None:
        return sum(terms[1:], start=terms[0]) if terms else None

    def _value(self, value: Any, what: str, x: Any = None) -> Any:
        """A number as a Constant, a callable as UFL of the position, x unless another one is given; collective."""
        if not callable(value):
            return fem.Constant(self.mesh, float(value))
        return called(self.comm, what, lambda: scalar(what, value(self.x if x is None else x)))

    def _vector(self, value: Any, what: str, x: Any = None) -> Any:
        """The same for a vector."""
        if not callable(value):
            bound = ufl.as_vector([self._value(component, what) for component in value])
        else:
            bound = called(self.comm, what, lambda: vector(value(self.x if x is None else x)))
        if bound.ufl_shape != (self.d,):
            raise InputError(f"{what} has shape {bound.ufl_shape}; the mesh needs ({self.d},).")
        return bound

    def _traction(self, traction: Traction) -> Any:
        what = f"Traction({traction.facets!r})"
        if traction.pressure is not None:
            return -self._value(traction.pressure, f"{what}: pressure") * self.n
        return self._vector(traction.value, what)

    def _parameter(self, name: str) -> Any:
        value = getattr(self.scene.material, name)
        what = f"Material parameter {name}"
        bound = self._by_region(name, value) if isinstance(value, Mapping) else self._value(value, what)
        if isinstance(value, Mapping) or callable(value):
            owned = np.arange(self.domain.owned_cells, dtype=np.int32)
            values = evaluate(bound, self.domain, lattice(self.d, DATA_DEGREE), owned)
            called(self.comm, what, self.scene.material.check, name, *self._range(values))
        return bound

    def _by_region(self, name: str, value: Mapping[str, Any]) -> Any:
        """Sum over regions of indicator times value; numbers share one piecewise constant function."""
        W = fem.functionspace(self.mesh, ("DG", 0))
        numbers, terms = fem.Function(W), []
        covered = np.zeros(len(numbers.x.array), dtype=int)
        for region, entry in value.items():
            cells = self.domain.region(region)
            covered[cells] += 1
            if callable(entry):
                indicator = fem.Function(W)
                indicator.x.array[cells] = 1.0
                terms.append(indicator * self._value(entry, f"Material parameter {name} in {region!r}"))
            else:
                numbers.x.array[cells] = float(entry)
        missing = self.comm.allreduce(int(np.count_nonzero(covered[: self.domain.owned_cells] != 1)), MPI.SUM)
        if missing:
            raise InputError(
                f"Material parameter {name}: {missing} cells are in no region or in two of {sorted(value)}; "
                f"this domain has {sorted(self.domain.regions)}."
            )
        return self._sum([numbers, *terms])

    def _range(self, values: np.ndarray) -> tuple[float, float]:
        """Least and greatest value over all ranks (nan is passed on)."""
        low = float(values.min(initial=np.inf)) if not np.isnan(values).any() else np.nan
        high = float(values.max(initial=-np.inf)) if not np.isnan(values).any() else np.nan
        lows, highs = self.comm.allgather(low), self.comm.allgather(high)
        return float(np.min(lows)), float(np.max(highs))

    # -- boundary --------------------------------------------------------------------------------------

    def _check_dimension(self) -> None:
        vectors: list[Any] = [s.value for s in self.scene.supports]
        vectors += [c.normal for c in self.scene.contacts if isinstance(c.normal, tuple)]
        vectors += [load.value for load in self.scene.tractions if load.value is not None]
        vectors += [load.value for load in self.scene.body_forces]
        for value in vectors:
            if not callable(value) and len(value) != self.d:
                raise InputError(f"The scene has the vector {value}, but the mesh is {self.d}D.")

    def _bind_supports(self) -> None:
        """Nodal values of the supports; two supports that meet at a node must agree there."""
        g = fem.Function(self.V)
        values = g.x.array.reshape(-1, self.d)
        fixed = np.zeros(values.shape, dtype=bool)
        error = None
        self.fixed_facets: list[tuple[np.ndarray, np.ndarray]] = []
        for support in self.scene.supports:
            facets, what = self.domain.facets(support.facets), f"Displacement({support.facets!r})"
            nodes = self.facet_nodes(facets)
            components = np.array([value is not None for value in support.value])
            self.fixed_facets.append((facets, components))
            for i, value in enumerate(support.value):
                if value is None:
                    continue
                new = np.full(nodes.shape, 0.0 if callable(value) else float(value))
                if callable(value):
                    new[:] = evaluate(self._value(value, what), self.domain, self.facet_points, facets)
                clash = fixed[nodes, i] & (abs(values[nodes, i] - new) > 1e-9 * float(abs(new).max(initial=1e-300)))
                if clash.any():
                    error = InputError(
                        f"Displacement({support.facets!r}) contradicts another support at a common node in component "
                        f"{i}; make the values agree there, or free a component (None)."
                    )
                values[nodes, i] = new
                fixed[nodes, i] = True
        raise_together(self.comm, error)
        if not np.isfinite(values).all():
            error = InputError("A prescribed displacement is not finite; look at the callables of the supports.")
        raise_together(self.comm, error)
        marks = fem.Function(self.V)  # a rank may see a node without the facet that fixes it: its owner sees all
        marks.x.array[:] = fixed.ravel()
        for function in (marks, g):
            function.x.scatter_forward()
        fixed = marks.x.array.reshape(-1, self.d) > 0.5
        self.prescribed, self.fixed = g, fixed
        self.bcs = []
        for i in range(self.d):
            if self.comm.allreduce(bool(fixed[:, i].any()), MPI.LOR):
                scalar, to_vector = self.V.sub(i).collapse()
                to_vector = np.asarray(to_vector).ravel()
                at = np.flatnonzero(fixed[to_vector // self.d, i]).astype(np.int32)
                component = fem.Function(scalar)
                component.x.array[:] = g.x.array[to_vector]
                self.bcs.append(fem.dirichletbc(component, [to_vector[at].astype(np.int32), at], self.V.sub(i)))

    def _contact(self, contact: Contact) -> BoundContact:
        facets, surface = self.domain.facets(contact.facets), self._true_surface(contact)
        what = f"Contact({contact.facets!r})"
        law = contact.law
        parameters = {p: self._value(getattr(law, p), f"{what}: {p}") for p in law.parameters} if law else {}
        for name, value in parameters.items():
            if callable(getattr(law, name)):
                low, high = self._range(evaluate(value, self.domain, self.facet_points, facets))
                if not 0 <= low <= high < np.inf:
                    raise InputError(
                        f"Contact({contact.facets!r}): {name} is {low:g} somewhere; it must be >= 0 and finite."
                    )
        if callable(contact.gap):
            values = evaluate(self._value(contact.gap, f"{what}: gap", surface), self.domain, self.facet_points, facets)
            if not np.isfinite(self._range(values)).all():
                raise InputError(f"{what}: the gap is not finite everywhere; look at it.")
        gap = None if contact.gap == 0 else self._value(contact.gap, f"{what}: gap", surface)
        normal, direction, given_normal = self._normal(contact, facets, surface)
        plain = isinstance(law, (Coulomb, Tresca)) and not any(callable(getattr(law, p)) for p in law.parameters)
        bound_contact = BoundContact(
            name=contact.facets,
            facets=facets,
            ds=self.ds(self.domain.tag(contact.facets)),
            normal=normal,
            direction=direction,
            given_normal=given_normal,
            law=law,
            parameters=parameters,
            share=self.friction_share,
            gap=gap,
            gap_varies=callable(contact.gap),
            sampled=law is not None and not plain,
            bilateral=contact.bilateral,
        )
        if law is not None and not isinstance(law, (Coulomb, Tresca)):
            called(self.comm, f"{what}: the friction bound", bound_contact.check)
        return bound_contact

    @cached_property
    def offset(self) -> fem.Function | None:
        """From the facets to the true surface where that is known and curved [length]; None elsewhere; collective."""
        if self.domain.marks is None or self.domain.geometry is None:
            return None
        return offset(self.mesh, self.domain.marks, self.domain.geometry.nearest)

    def _true_surface(self, contact: Contact) -> Any:
        """The position on the true surface, where gap and normal are taken: those of the polygon are O(h^2) off."""
        varies = callable(contact.gap) or callable(contact.normal)
        return self.x if not varies or self.offset is None else self.x + self.offset

    def _normal(self, contact: Contact, facets: np.ndarray, surface: Any) -> tuple[Any, np.ndarray, Any]:
        """The normal of the foundation: UFL, on each facet (f, d), and as given where it varies (of any length)."""
        centre = np.full((1, self.d - 1), 1.0 / self.d)
        if contact.normal is None:
            normals = evaluate(self.n, self.domain, centre, facets)[:, 0]
            first = next(n for n in self.comm.allgather(normals[0] if len(normals) else None) if n is not None)
            error = None
            if len(normals) and abs(normals - first).max() > FLAT:
                error = InputError(
                    f"Contact({contact.facets!r}): the boundary part is not flat; give the normal of the foundation, "
                    f"e.g. normal={(0.0, -1.0) if self.d == 2 else (0.0, 0.0, -1.0)}, and the gap along it."
                )
            raise_together(self.comm, error)
            direction = first + 0.0
        elif isinstance(contact.normal, tuple):
            direction = np.array(contact.normal)
        else:
            return self._varying_normal(contact, facets, centre, surface)
        return fem.Constant(self.mesh, direction), np.broadcast_to(direction, (len(facets), self.d)), None

    def _varying_normal(
        self, contact: Contact, facets: np.ndarray, centre: np.ndarray, surface: Any
    ) -> tuple[Any, np.ndarray, Any]:
        """One normal for each cell at the contact, the mean of its facets."""
        what = f"Contact({contact.facets!r})"
        if contact.normal == "gap":
            slope = ufl.algorithms.expand_derivatives(-ufl.grad(self._value(contact.gap, f"{what}: gap")))
            expression = ufl.replace(slope, {self.x: surface})
        else:
            expression = self._vector(contact.normal, f"{what}: normal", surface)
        given = evaluate(expression, self.domain, centre, facets)[:, 0]
        length = np.linalg.norm(given, axis=1)
        error = None
        if not (np.isfinite(length).all() and np.all(length > 0)):
            error = InputError(
                f"Contact({contact.facets!r}): the normal is zero or not finite at the middle of a facet; look at "
                f"{'the gap' if contact.normal == 'gap' else 'its callable'}."
            )
        raise_together(self.comm, error)
        function = fem.Function(fem.functionspace(self.mesh, ("DG", 0, (self.d,))))
        of_cell = function.x.array.reshape(-1, self.d)
        np.add.at(of_cell, facets[:, 0], given / length[:, None])
        direction = of_cell[facets[:, 0]]
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        of_cell[facets[:, 0]] = direction
        return function, direction, expression

    def friction_parameters(self, contact: BoundContact, points: np.ndarray) -> dict[str, np.ndarray]:
        """The law's parameters at reference points (q, d-1) of the facets of a contact, each of shape (f, q)."""
        return {k: evaluate(v, self.domain, points, contact.facets) for k, v in contact.parameters.items()}

    def gap_at_nodes(self, contact: BoundContact) -> np.ndarray:
        """The gap at the nodes of each facet of a contact [length], shape (facets, m)."""
        if contact.gap is None:
            return np.zeros((len(contact.facets), len(self.facet_points)))
        return evaluate(contact.gap, self.domain, self.facet_points, contact.facets)

    def gap_coefficients(self, contact: BoundContact) -> Any | None:
        """UFL whose values at the nodes of the contact are the Bernstein coefficients of the gap, or None."""
        if self.degree == 1 or not contact.gap_varies:
            return contact.gap
        nodal = fem.Function(self.V)
        values = nodal.x.array.reshape(-1, self.d)
        values[self.facet_nodes(contact.facets), 0] = self.gap_at_nodes(contact)
        self.to_coefficients(values, [contact])
        return nodal[0]

    def to_coefficients(self, values: np.ndarray, contacts: list[BoundContact], *, back: bool = False) -> None:
        """Turn nodal values into Bernstein coefficients on the facets of contacts, or back, in place.

        Args:
            values: Of all nodes, shape (nodes, ...).
            contacts: Contacts of this model.
            back: From coefficients to values.
        """
        if self.degree == 1:
            return
        matrix = (at_nodes if back else coefficients)(self.d - 1, self.degree)
        facets = np.concatenate([self.facet_nodes(c.facets) for c in contacts])
        values[facets] = np.matmul(matrix, values[facets])

    def _check_supports_in_gap(self) -> None:
        values = self.prescribed.x.array.reshape(-1, self.d)
        for contact in self.contacts:
            nodes = self.facet_nodes(contact.facets)
            gap = self.gap_at_nodes(contact)
            n = contact.direction[:, None, :]
            known = (self.fixed[nodes] | (abs(n) < 1e-12)).all(axis=-1)
            beyond = (values[nodes] * n).sum(axis=-1) - gap
            excess = np.where(known, abs(beyond) if contact.bilateral else beyond, -np.inf).max(initial=-np.inf)
            worst = self.comm.allreduce(float(excess), MPI.MAX)
            scale = max(
                1e-12 * self.domain.size, 1e-9 * self.comm.allreduce(float(abs(values).max(initial=0)), MPI.MAX)
            )
            if worst > scale:
                raise InputError(
                    f"A support pushes {contact.name!r} into the foundation by {worst:g} [length] beyond the gap; "
                    "no displacement is admissible. Change the support or the gap."
                )

    def _check_loads(self) -> None:
        """Loads are finite where they are integrated."""
        loads = []
        if self.body_force is not None:
            points, _ = rule(self.d, DATA_DEGREE)
            loads.append(("A BodyForce", self.body_force, points, np.arange(self.domain.owned_cells, dtype=np.int32)))
        points, _ = rule(self.d - 1, DATA_DEGREE)
        for name, _, traction in self.tractions:
            loads.append((f"Traction({name!r})", traction, points, self.domain.facets(name)))
        for what, expression, at, entities in loads:
            if varies_in_cells(expression):
                values = evaluate(expression, self.domain, at, entities)
                if not np.isfinite(self._range(values)).all():
                    raise InputError(f"{what} is not finite everywhere; look at its callables.")
