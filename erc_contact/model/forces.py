"""Compute forces of supports, contacts and loads on the body, with their moments.

The residual ``R(v) = (sigma, eps(v)) - f(v) - F(v)`` of elasticity, tested with the
basis function of a node, is the force that supports and contacts exert on this node.
For a rigid motion v it is ``-f(v) - F(v)``. So these nodal forces and their moments
balance the loads to round-off, for any contact method and after any number of Newton
steps.

Symbols: u displacement, r contact traction of the method, d dimension, k degree, m
nodes of a facet.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import ufl
from dolfinx import fem, la
from mpi4py import MPI

from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.ties import Claim, tie_forces
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.scene.scene import BALANCE, BODY_FORCE, TRACTIONS
from erc_contact.scene.units import in_units, unit_of
from namedmesh.base.html import table
from namedmesh.for_solvers import in_space
from namedmesh.simplex import coefficients, lagrange, rule


@dataclass(frozen=True, eq=False)
class Force:
    """Hold a force on the body with its moment.

    Attributes:
        force: Resultant [force], shape (d,). Of an axisymmetric body it is the axial
            force on the full ring, and before it the sum of all radial forces around
            the ring, ``int p dA`` of a press fit, which hoop stresses balance.
        moment: Moment about the origin [force length], shape (1,) in 2D, (3,) in 3D; 0
            of an axisymmetric body.
        units: Units of length, force and stress, as of :class:`Scene`.

    Example:
        >>> print(solution.force("bottom"))
        force (..., 25.1...), moment 12.5...
    """

    force: np.ndarray
    moment: np.ndarray
    units: str = field(default="", repr=False)

    def __str__(self) -> str:
        """Write force and moment, of a history a line for each step."""
        lines = []
        for force, moment in self._in_digits():
            numbers = [f"({', '.join(row)})" if len(row) > 1 else row[0] for row in (force, moment)]
            lines.append(
                f"force {numbers[0]}{unit_of('force', self.units)}, "
                f"moment {numbers[1]}{unit_of('force length', self.units)}"
            )
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return force and moment as a table in a notebook."""
        rows = []
        for force, moment in self._in_digits():
            rows.append((in_units("force [force]", self.units), *force))
            rows.append((in_units("moment [force length]", self.units), *moment))
        return table(rows)

    def _in_digits(self) -> list[tuple[list[str], list[str]]]:
        """Return the components of force and moment in words, of each step."""
        of_steps = zip(np.atleast_2d(self.force), np.atleast_2d(self.moment), strict=True)
        return [
            ([f"{value:.5g}" for value in force], [f"{value:.5g}" for value in moment])
            for force, moment in of_steps
        ]

    def __add__(self, other: Force) -> Force:
        """Return the sum of two forces with their moments."""
        return Force(self.force + other.force, self.moment + other.moment, self.units)


def total_force(model: Model, nodes: np.ndarray, forces: np.ndarray) -> Force:
    """Compute resultant and moment of forces at nodes over all ranks; collective.

    Args:
        model: The scene on a mesh.
        nodes: Nodes of this rank, shape (n,).
        forces: Forces at them [force], shape (n, d).
    """
    space = model.space
    x = space.V.tabulate_dof_coordinates()[nodes]
    moment = np.cross(x, in_space(forces)).sum(axis=0)
    if space.d == 2:
        moment = moment[[2]] * (not space.axisymmetric)
    local = np.concatenate([forces.sum(axis=0), moment])
    total = space.comm.allreduce(local, MPI.SUM)
    return Force(total[: space.d], total[space.d :], model.scene.units)


def by_cause(
    model: Model, force: Callable[[str], Force], body_force: Callable[[], Force]
) -> dict[str, Force]:
    """Compute the forces on the body by their cause; collective.

    Args:
        model: The scene on a mesh.
        force: The force on a boundary part.
        body_force: The force of the loads in the body. It is called only if the scene
            has such loads.

    Returns:
        The forces of supports, springs, contacts and ties by the names of their parts,
        with the loads on these. "tractions" is the force of the loads on all other
        parts, and "body force" the force of the loads in the body, where the scene has
        them. "balance" is the sum of all forces, which is zero up to round-off.
    """
    supports = [support.facets for support in model.scene.supports]
    supports += [spring.facets for spring in model.scene.springs]
    contacts: list[str] = []
    for contact in model.scene.contacts:
        contacts += contact.sides
    for tie in model.scene.ties:
        contacts += tie.sides
    # A part may have several supports: each name counts once.
    reacting = dict.fromkeys(supports + contacts)
    result = {name: force(name) for name in reacting}
    loads = [load.facets for load in model.surface_loads]
    loaded = dict.fromkeys(name for name in loads if name not in reacting)
    if loaded:
        result[TRACTIONS] = _sum([force(name) for name in loaded])
    if model.body_force is not None:
        result[BODY_FORCE] = body_force()
    balance = _sum(list(result.values()))
    result[BALANCE] = replace(balance, force=model.space.section.carried(balance.force))
    return result


def _sum(forces: list[Force]) -> Force:
    """Add up forces, at least one force."""
    return sum(forces[1:], start=forces[0])


def nodal_reactions(
    model: Model,
    u: fem.Function,
    traction: Callable[[ContactOnMesh], Ufl],
    *,
    in_layer: bool,
    at_nodes: bool,
) -> dict[str, np.ndarray]:
    """Compute the nodal forces of supports, springs, contacts and ties; collective.

    A contact first gets the integrals of its traction against the basis functions of
    its nodes. The rest of the residual goes to the supports that fix the component at
    the node. If there is none, it goes to the contacts of the node. Several of them get
    equal shares. Between bodies such shares would not be opposite on both sides: where
    a method has its traction at the nodes, it tells the force of each contact there.

    Args:
        model: The scene on a mesh.
        u: Displacement [length].
        traction: The traction of the method on a contact [force/area], UFL, shape (d,).
        in_layer: Whether the equations of the method act on all nodes of the cells at
            the contact.
        at_nodes: Whether the traction is a multiplier at the nodes.

    Returns:
        Forces by the names of the parts [force], shape (nodes, d). At ghost nodes they
        are not complete.
    """
    space = model.space
    v = ufl.TestFunction(space.V)

    def residual_of(v: Ufl) -> np.ndarray:
        of_loads = _assemble(space, model.loads(v))
        of_strains = _assemble(space, model.strain_loads(v))
        return _assemble(space, model.stiffness(u, v)) - of_loads - of_strains

    residual = residual_of(v)
    several = _with_several_forces(model) if at_nodes else None
    forces = {}
    claims = {}
    for contact in model.contacts:
        trace = contact.trace
        of_facets = _of_traction(space, contact, traction(contact))
        if several is not None:
            is_known = several[trace.here.nodes]
            of_multiplier = _of_multiplier(space, contact, traction(contact))
            of_facets = np.where(is_known[..., None], of_multiplier, of_facets)
        residual -= trace.back(of_facets)
        nodes = space.nodes[contact.facets[:, 0]] if in_layer else trace.here.nodes
        here = trace.back_here(of_facets), nodes
        there = trace.back_there(of_facets), trace.partners
        # A foundation has no name.
        for side, (of_side, claimed) in zip(contact.side_names, (here, there), strict=False):
            forces[side] = of_side
            claims[side] = _claim(model, claimed)
    for support, (facets, components) in zip(model.scene.supports, model.fixed_facets, strict=True):
        claim = claims.setdefault(support.facets, np.zeros(residual.shape, dtype=bool))
        claim[space.facet_nodes(facets)] |= components
    # What the tractions leave of the residual is shared by those who fix the node.
    number_of_claims = sum(claims.values(), start=np.zeros(residual.shape))
    share = residual / np.maximum(number_of_claims, 1.0)
    reactions = {}
    for spring in model.springs:
        reactions[spring.name] = -_assemble(space, spring.work(u, v))
    for name, claim in claims.items():
        reactions[name] = forces.get(name, 0.0) + np.where(claim, share, 0.0)
    for tie in model.ties:
        first, second = tie.side_names
        reactions[first] = tie_forces(space, tie, residual_of, _list_claims(model, in_layer))
        reactions[second] = -reactions[first]
    return reactions


def _list_claims(model: Model, in_layer: bool) -> list[Claim]:
    """Return cells and nodes on which supports and contacts act."""
    result = []
    for facets, _ in model.fixed_facets:
        result.append((facets[:, 0], model.space.facet_nodes(facets)))
    for contact in model.contacts:
        cells = contact.facets[:, 0]
        result.append((cells, model.space.nodes[cells] if in_layer else contact.trace.here.nodes))
        result.append((contact.trace.there.facets[:, 0], contact.trace.partners))
    return result


def _claim(model: Model, nodes: np.ndarray) -> np.ndarray:
    """Mark the components at nodes that no support fixes, shape (all nodes, d)."""
    claim = np.zeros(model.fixed.shape, dtype=bool)
    claim[nodes] = True
    # A component that a support fixes is the support's.
    return claim & ~model.fixed


def part_force(model: Model, part: str, nodal: dict[str, np.ndarray]) -> Force:
    """Compute the force of reactions and loads on a boundary part; collective.

    Args:
        model: The scene on a mesh.
        part: Name of the part.
        nodal: The reactions, from :func:`nodal_reactions`.

    Raises:
        InputError: If no boundary part has this name.
    """
    space = model.space
    if any(part in tie.side_names for tie in model.ties):
        return _of_nodes(model, nodal[part])
    model.domain.tag(part)
    loads = _assemble(space, model.loads(ufl.TestFunction(space.V), on=[part]))
    return _of_nodes(model, loads + nodal.get(part, 0.0))


def body_force(model: Model) -> Force:
    """Compute resultant and moment of the loads in the body; collective."""
    loads = model.loads(ufl.TestFunction(model.space.V), on=[None])
    return _of_nodes(model, _assemble(model.space, loads))


def _of_nodes(model: Model, forces: np.ndarray) -> Force:
    """Compute resultant and moment of nodal forces (nodes, d); collective.

    The force of each node comes from its owner.
    """
    owned = np.arange(model.space.V.dofmap.index_map.size_local)
    return total_force(model, owned, forces[owned])


def _assemble(space: Space, form: Ufl | None) -> np.ndarray:
    """Assemble a linear form at the nodes [force], shape (nodes, d); collective.

    It is zero for None. At ghost nodes the values are not complete.
    """
    b = space.function()
    if form is not None:
        fem.assemble_vector(b.x.array, compiled.form(form))
        b.x.scatter_reverse(la.InsertMode.add)
    return b.x.array.reshape(-1, space.d)


def _of_traction(space: Space, contact: ContactOnMesh, traction: Ufl) -> np.ndarray:
    """Integrate a traction against the basis functions on each facet; collective.

    Returns:
        Forces at the nodes of the facets [force], shape (f, m, d).
    """
    points, weights = rule(space.d - 1, space.contact_degree)
    weighted = weights[:, None] * lagrange(space.d - 1, space.degree, points)
    values = space.evaluate(traction, points, contact.facets)
    areas = contact.trace.here.areas[:, None, None]
    return np.einsum("qm,fqi->fmi", weighted, values) * areas


def _of_multiplier(space: Space, contact: ContactOnMesh, traction: Ufl) -> np.ndarray:
    """Return the forces that a multiplier has at the nodes of each facet; collective.

    They are the forces on the Bernstein coefficients, in shares of the area, at the
    nodes.

    Returns:
        Forces at the nodes of the facets [force], shape (f, m, d).
    """
    trace = contact.trace
    values = space.evaluate(traction, space.facet_points, contact.facets)
    m = values.shape[1]
    shares = trace.here.areas[:, None, None] / m
    to_coefficients = coefficients(space.d - 1, space.degree)
    x = space.V.tabulate_dof_coordinates()
    of_nodes = space.section.from_tractions(trace.coefficients(values), trace.here, x)
    return np.einsum("cn,fci->fni", to_coefficients, shares * of_nodes)


def _with_several_forces(model: Model) -> np.ndarray | None:
    """Mark nodes between bodies that more than one contact acts on; collective.

    That is several contacts, or a support, which may hold one of the bodies alone.
    Shape (nodes,); None where there are none on any rank.
    """
    if not model.connections.any:
        return None
    several = model.connections.has_several
    return several if model.space.comm.allreduce(bool(several.any()), MPI.LOR) else None
