"""Tangents of the contact equations at the nodes of two bodies and a foundation.

Properties: the tangent is the derivative of the residual; contacts between bodies exert
no resultant and do not feel a common translation; the operations of a factor are the
known numbers.
"""

import numpy as np
import pytest
from bricks import NAMES, bricks
from mpi4py import MPI
from petsc4py import PETSc

import erc_contact as ec
from erc_contact.model.promises import bind
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.full import FullSpace
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.linear.mumps import operations
from erc_contact.newton.node_sum import NodeSum

SUPPORTS = [ec.Displacement("upper outer", (0.0, 0.0, -0.05))]


def two_bricks(*on_foundations: ec.Contact) -> tuple[ec.Scene, ec.Domain]:
    """Two bricks with friction between them."""
    between = ec.Contact(NAMES[0], against=NAMES[1], friction=0.3)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), SUPPORTS, contacts=[between, *on_foundations])
    return scene, bricks(3, (2, 2, 1))


def oscillating(vector: PETSc.Vec) -> np.ndarray:
    """Return values without structure that do not depend on the number of ranks."""
    return np.cos(np.arange(*vector.getOwnershipRange()) ** 2)


@pytest.mark.broad
@pytest.mark.parametrize("degree", [1, 2])
def test_contacts_between_bodies_feel_no_common_translation(degree):
    scene, domain = two_bricks()
    model = bind(scene, domain, degree)
    forms = ContactForms(model, ec.Nitsche())
    u = model.space.function()
    u.x.array[:] = 1e-3 * np.sin(np.arange(len(u.x.array)))
    u.x.scatter_forward()
    forms.set_displacement(u)
    tangent = NodeSum(forms)
    tangent.assemble()
    x, y = tangent.matrix.createVecs()
    x.array[:] = oscillating(x)
    tangent.matrix.mult(x, y)
    size = y.norm()
    assert size > 0.0
    x.array.reshape(-1, 3)[:] = (1.0, 2.0, 3.0)
    for product in (tangent.matrix.mult, tangent.matrix.multTranspose):
        product(x, y)
        assert y.norm() < 1e-12 * size
    tangent.free()


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_the_tangent_is_the_derivative_of_the_residual(degree):
    """Away from kinks; a sum of all pairs that misses an entry, or a sign, is far from it."""
    foundation = ec.Contact("lower outer", friction=0.2)
    model = bind(*two_bricks(foundation), degree)
    elastic = Multigrid(model)
    loads = elastic.right_side(elastic.load_vector(), supports=True)
    problem = FullSpace(model, ContactForms(model, ec.Nitsche()), elastic, loads, 1.0, 1.0)
    x, v, ahead, behind, forward, backward, expected = (problem.vector() for _ in range(7))
    x.array[:] = 1e-2 * oscillating(x)
    v.array[:] = np.where(elastic.fixed, 0.0, np.sin(np.arange(*v.getOwnershipRange())))
    h = 1e-7
    ahead.waxpy(h, v, x)
    behind.waxpy(-h, v, x)
    problem.function(None, ahead, forward)
    problem.function(None, behind, backward)
    forward.axpy(-1.0, backward)
    forward.scale(0.5 / h)
    problem._renew(None, x)
    problem._tangent.mult(v, expected)
    size = expected.norm()
    expected.axpy(-1.0, forward)
    expected.array[elastic.fixed] = 0.0
    assert expected.norm() < 1e-6 * size
    problem.free()
    elastic.free()


@pytest.mark.serial
def test_operations_of_a_factor():
    """A dense matrix takes n^3/3, and bodies apart as much as all of them."""
    n = 120
    dense = PETSc.Mat().createAIJ((n, n), nnz=n, comm=MPI.COMM_SELF)
    dense.setValues(range(n), range(n), np.eye(n) * n + 1.0)
    dense.assemble()
    assert operations(dense) == pytest.approx(n**3 / 3, rel=0.05)

    counts = []
    for copies in (1, 3):
        parts = {}
        for k in range(copies):
            corners = (2.0 * k, 0.0, 0.0), (2.0 * k + 1.0, 1.0, 1.0)
            parts[f"part {k}"] = ec.box(*corners, cells=(2, 2, 2))
        domain = ec.assembly(parts)
        held = [ec.Displacement(f"{part} bottom", (0.0, 0.0, 0.0)) for part in parts]
        stiffness = Multigrid(bind(ec.Scene(ec.Elastic(1.0, 0.3), held), domain, 1)).matrix
        counts.append(operations(stiffness))
    assert counts[1] == pytest.approx(3 * counts[0], rel=0.1)
