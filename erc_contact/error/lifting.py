"""Displacements of least energy that equal a direction on one contact.

Such a displacement phi does no work on the other contacts. It tests the resultant of
the contact traction (:mod:`erc_contact.error.bounds`). On a contact between two bodies
all that is said of phi is said of its jump.

Symbols: n nodes, d dimension.
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fp
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.error.numbers import ROUND_OFF
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.data.over_ranks import product
from erc_contact.model.data.symbolic import sum_of
from erc_contact.model.model import Model
from erc_contact.newton.linear.solver import ElasticSolver

SPRING_FACTOR = 1e6
"""gamma_0 of the springs that hold phi on the contacts [-].

Afterwards its values there are set exactly.
"""


def lifting(
    model: Model, elastic: ElasticSolver, which: int, a: np.ndarray
) -> tuple[fem.Function, bool]:
    """Compute the phi that equals a direction on one contact; collective.

    It has the least energy.

    On the contact all components are a, or only the normal one where the contact is
    flat and frictionless; on the other contacts they are zero; components that supports
    fix are zero.

    Args:
        model: The scene on a mesh.
        elastic: The solver of its elastic equations; its memory is freed.
        which: Place of the contact among the model's.
        a: Direction, shape (d,).

    Returns:
        phi [-], and whether it differs from a on the contact because a support or
        another contact fixes it there.
    """
    phi = _least_energy(model, elastic, which, a)
    values = phi.x.array.reshape(-1, model.space.d)
    contact = model.contacts[which]
    surface = _ContactNodes(model, contact)
    others = [_ContactNodes(model, beside) for beside in model.contacts if beside is not contact]
    surface.add(values, _working_part(contact, a - surface.jump(values)))
    for nodes in others:
        nodes.add(values, -_working_part(nodes.contact, nodes.jump(values)))
    values[model.fixed] = 0.0
    values[model.connections.is_joint] = 0.0
    # A node of several contacts is not free for all of them: phi is zero there.
    tolerance = ROUND_OFF * float(np.linalg.norm(a))
    for nodes in others:
        wrong = abs(_working_part(nodes.contact, nodes.jump(values))).max(axis=1, initial=0.0)
        nodes.set_to_zero(values, wrong > tolerance)
    phi.x.scatter_forward()
    missing = abs(_working_part(contact, a - surface.jump(values))).max(initial=0.0) > tolerance
    return phi, bool(model.space.comm.allreduce(bool(missing) or surface.has_joint, MPI.LOR))


class _ContactNodes:
    """Represent the nodes of a contact that this rank has; construction is collective.

    They include those that only facets of other ranks have.

    Args:
        model: The scene on a mesh.
        contact: The contact.

    Attributes:
        nodes: The nodes, without those where more than two bodies meet, shape (n,). The
            first ones face another body, and not a foundation.
        has_joint: Whether there are such nodes.
    """

    def __init__(self, model: Model, contact: ContactOnMesh) -> None:
        space = model.space
        self.contact = contact
        nodes = fem.locate_dofs_topological(
            space.V, space.d - 1, space.facet_numbers(contact.facets)
        )
        # Where more than two bodies meet, phi is zero: the jumps are not independent.
        is_joint = model.connections.is_joint[nodes]
        self.has_joint = bool(is_joint.any())
        nodes = nodes[~is_joint]
        pairs = model.connections.pairs[model.contacts.index(contact)]
        pairs = space.local_nodes(pairs.ravel()).reshape(-1, 2)
        on_foundation = np.setdiff1d(nodes, pairs[:, 0])
        # The owners of both nodes of a pair have both of them.
        pairs = pairs[np.isin(pairs[:, 0], nodes) & (pairs[:, 1] >= 0)]
        self.nodes = np.concatenate([pairs[:, 0], on_foundation])
        self._partners = pairs[:, 1]
        self._facing = slice(len(pairs))
        # Components that a pair does not move here, but on the other side.
        self._moves_there = model.fixed[self.nodes]
        self._moves_there[len(pairs) :] = False

    def jump(self, values: np.ndarray) -> np.ndarray:
        """Return phi, or its jump, of values (all nodes, d), shape (n, d)."""
        jump = values[self.nodes]
        jump[self._facing] -= self.contact.trace.seen(values[self._partners])
        return jump

    def add(self, values: np.ndarray, change: np.ndarray) -> None:
        """Add a change (n, d) to phi, or to its jump, in place.

        This body moves, and where a support holds it the other one.
        """
        there = np.where(self._moves_there, change, 0.0)
        values[self.nodes] += np.where(self._moves_there, 0.0, change)
        values[self._partners] -= self.contact.trace.sent(there[self._facing])

    def set_to_zero(self, values: np.ndarray, which: np.ndarray) -> None:
        """Set phi to zero at some of the nodes (n,), in place."""
        values[self.nodes[which]] = 0.0
        values[self._partners[which[self._facing]]] = 0.0


def _least_energy(model: Model, elastic: ElasticSolver, which: int, a: np.ndarray) -> fem.Function:
    """Compute phi with stiff springs that hold it on the contacts; collective."""
    space = model.space
    gamma = model.stiffness_per_area(compiled.constant(space.mesh, SPRING_FACTOR))
    matrix = _springs(model, gamma)
    contact = model.contacts[which]
    v = ufl.TestFunction(space.V)
    direction = compiled.constant(space.mesh, a)
    pull = gamma * ufl.inner(_working_part_ufl(contact, direction), v) * contact.ds
    b = space.function()
    fem.assemble_vector(b.x.array, compiled.form(pull))
    start = space.function()
    if not model.connections.any:
        # The solver starts from a rigid motion, if the body is free to make it.
        start.x.array.reshape(-1, space.d)[:] = _working_part(contact, a[None])
        start.x.array[model.fixed.ravel()] = 0.0
    if contact.against is not None:
        # The springs pull at the jump.
        b.x.scatter_reverse(la.InsertMode.add)
        b = product(space, model.connections.jump(which), b, transpose=True)
        b.x.array[space.V.dofmap.index_map.size_local * space.d :] = 0.0
    with elastic.in_memory():
        phi = elastic.solve_with_springs(matrix, b, start)
    matrix.destroy()
    error = None
    if not np.isfinite(phi.x.array).all():
        error = InputError("The body cannot be factorised; look at its moduli.")
    raise_together(space.comm, error)
    return phi


def _springs(model: Model, gamma: Ufl) -> PETSc.Mat:
    """Assemble the springs of all contacts; collective."""
    u = ufl.TrialFunction(model.space.V)
    v = ufl.TestFunction(model.space.V)
    on_foundations: list[Ufl] = []
    matrices = []
    # Without supports: fixed components beside the contacts have no entry, and DOLFINx
    # would make PETSc fail, unheard, for each of them.
    for number, contact in enumerate(model.contacts):
        term = gamma * ufl.inner(_working_part_ufl(contact, u), v) * contact.ds
        if contact.against is None:
            on_foundations.append(term)
            continue
        of_jump = fp.assemble_matrix(compiled.form(term))
        of_jump.assemble()
        matrices.append(of_jump.ptap(model.connections.jump(number)))
        of_jump.destroy()
    if on_foundations:
        on_bodies = fp.assemble_matrix(compiled.form(sum_of(on_foundations)))
        on_bodies.assemble()
        matrices.append(on_bodies)
    matrix, *others = matrices
    for summand in others:
        matrix.axpy(1.0, summand, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        summand.destroy()
    matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
    first, last = matrix.getOwnershipRange()
    fixed = first + np.flatnonzero(model.fixed.ravel()[: last - first])
    matrix.zeroRowsColumns(fixed.astype(PETSc.IntType), diag=0.0)
    return matrix


def _only_normal(contact: ContactOnMesh) -> bool:
    """Tell whether the traction can only be along one normal.

    The normal is then the same on the whole contact.
    """
    return contact.friction is None and isinstance(contact.normal, fem.Constant)


def _working_part(contact: ContactOnMesh, values: np.ndarray) -> np.ndarray:
    """Return the part of vectors (n, d) on which a traction of the contact can work."""
    if not _only_normal(contact):
        return values
    n = contact.normal.value
    return (values @ n)[:, None] * n


def _working_part_ufl(contact: ContactOnMesh, v: Ufl) -> Ufl:
    """Return the same part of a UFL vector."""
    if not _only_normal(contact):
        return v
    return ufl.dot(v, contact.normal) * contact.normal
