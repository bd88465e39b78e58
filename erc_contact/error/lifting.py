"""Displacements of least energy that equal a direction on one contact.

Such a displacement phi does no work on the other contacts. It tests the resultant of
the contact traction (:mod:`erc_contact.error.bounds`).

Symbols: n nodes, d dimension.
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fp
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.error.constitutive import ROUND_OFF
from erc_contact.model.foundation import BoundContact
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
    values = phi.x.array.reshape(-1, model.d)
    contact = model.contacts[which]
    nodes = _nodes(model, contact)
    others = []
    for other in model.contacts:
        if other is not contact:
            others.append((other, _nodes(model, other)))
    values[nodes] += _working_part(contact, a - values[nodes])
    for other, at_other in others:
        values[at_other] -= _working_part(other, values[at_other])
    values[model.fixed] = 0.0
    # A node of several contacts is not free for all of them: phi is zero there.
    tolerance = ROUND_OFF * float(np.linalg.norm(a))
    for other, at_other in others:
        wrong = abs(_working_part(other, values[at_other])).max(axis=1, initial=0.0)
        values[at_other[wrong > tolerance]] = 0.0
    phi.x.scatter_forward()
    missing = abs(_working_part(contact, a - values[nodes])).max(initial=0.0) > tolerance
    return phi, bool(model.comm.allreduce(bool(missing), MPI.LOR))


def _least_energy(model: Model, elastic: ElasticSolver, which: int, a: np.ndarray) -> fem.Function:
    """Compute phi with stiff springs that hold it on the contacts; collective."""
    u = ufl.TrialFunction(model.V)
    v = ufl.TestFunction(model.V)
    contact = model.contacts[which]
    gamma = model.stiffness_per_area(compiled.constant(model.mesh, SPRING_FACTOR))
    springs: Ufl = 0
    for c in model.contacts:
        springs = springs + gamma * ufl.inner(_working_part_ufl(c, u), v) * c.ds
    direction = compiled.constant(model.mesh, a)
    pull = gamma * ufl.inner(_working_part_ufl(contact, direction), v) * contact.ds
    matrix = fp.assemble_matrix(compiled.form(springs), bcs=model.bcs, diag=0.0)
    matrix.assemble()
    b = model.function()
    fem.assemble_vector(b.x.array, compiled.form(pull))
    # The solver starts from a rigid motion, if the body is free to make it.
    start = model.function()
    start.x.array.reshape(-1, model.d)[:] = _working_part(contact, a[None])
    start.x.array[model.fixed.ravel()] = 0.0
    with elastic.in_memory():
        phi = elastic.solve_with_springs(matrix, b, start)
    matrix.destroy()
    error = None
    if not np.isfinite(phi.x.array).all():
        error = InputError("The body cannot be factorised; look at its moduli.")
    raise_together(model.comm, error)
    return phi


def _only_normal(contact: BoundContact) -> bool:
    """Tell whether the traction can only be along one normal.

    The normal is then the same on the whole contact.
    """
    return contact.friction is None and isinstance(contact.normal, fem.Constant)


def _working_part(contact: BoundContact, values: np.ndarray) -> np.ndarray:
    """Return the part of vectors (n, d) on which a traction of the contact can work."""
    if not _only_normal(contact):
        return values
    n = contact.normal.value
    return (values @ n)[:, None] * n


def _working_part_ufl(contact: BoundContact, v: Ufl) -> Ufl:
    """Return the same part of a UFL vector."""
    if not _only_normal(contact):
        return v
    return ufl.dot(v, contact.normal) * contact.normal


def _nodes(model: Model, contact: BoundContact) -> np.ndarray:
    """Find the nodes on a contact; collective.

    They include those that only facets of other ranks have.
    """
    return fem.locate_dofs_topological(model.V, model.d - 1, model.facet_numbers(contact.facets))
