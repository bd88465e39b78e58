"""Functions of the user at points of cells: nodal polynomials, and elements that have no nodes; matrices there."""

import numpy as np
import pytest
from mpi4py import MPI

import erc_contact as ec
from erc_contact.model.data.expressions import definite_inverses, function_at
from erc_contact.model.model import Model
from namedmesh.base.releases import cell_nodes

import basix.ufl  # isort: skip - MPI first
from dolfinx import fem, mesh  # isort: skip

assert ec  # loads MPI

LINEAR = basix.ufl.element("P", "triangle", 1)
ELEMENTS = {
    "linear": LINEAR,
    "vector": basix.ufl.element("P", "triangle", 2, shape=(2,)),
    "discontinuous": basix.ufl.element("DG", "triangle", 2),
    "enriched": basix.ufl.enriched_element([LINEAR, basix.ufl.element("bubble", "triangle", 3)]),
    "Raviart-Thomas": basix.ufl.element("RT", "triangle", 1),
}


@pytest.mark.parametrize("name", ELEMENTS)
def test_values_are_those_of_dolfinx(name):
    body = mesh.create_rectangle(MPI.COMM_SELF, ((0.0, 0.0), (2.0, 1.0)), (3, 2))
    function = fem.Function(fem.functionspace(body, ELEMENTS[name]))
    rng = np.random.default_rng(0)
    function.x.array[:] = rng.normal(size=len(function.x.array))
    cells = np.arange(12, dtype=np.int32)
    shares = rng.dirichlet((1.0, 1.0, 1.0), size=(12, 4))
    x = shares @ body.geometry.x[cell_nodes(body.geometry), :2]
    places = np.zeros((48, 3))
    places[:, :2] = x.reshape(48, 2)
    known = function.eval(places, np.repeat(cells, 4)).reshape(48, -1)
    assert function_at(function, x, cells) == pytest.approx(known, abs=1e-12)


@pytest.mark.serial
@pytest.mark.parametrize("size", [3, 4, 6])
def test_inverses_of_definite_matrices(size):
    """As numpy's, at the condition of a body that hardly hardens; singular ones are told."""
    rng = np.random.default_rng(size)
    basis = np.linalg.qr(rng.standard_normal((5, 7, size, size)))[0]
    matrices = np.matmul(basis * np.geomspace(1e-5, 1.0, size), basis.swapaxes(-1, -2))
    products = np.matmul(definite_inverses(matrices), matrices)
    assert abs(products - np.eye(size)).max() < 1e-9
    matrices[2, 3] = 0.0
    with pytest.raises(np.linalg.LinAlgError):
        definite_inverses(matrices)


@pytest.mark.serial
@pytest.mark.parametrize("points", [0, 1, 5], ids="{} points".format)
@pytest.mark.parametrize("hypothesis", ["plane strain", "axisymmetric", "3D"])
def test_products_with_moduli_that_vary(hypothesis, points):
    """They are the products with the matrices at the points; metric and stiffness are inverse."""
    d = 3 if hypothesis == "3D" else 2
    make = ec.box if d == 3 else ec.rectangle
    body = make((0.1,) * d, (1.1,) * d, cells=(2,) * d, comm=MPI.COMM_SELF)
    kind = {} if d == 3 else {"hypothesis": hypothesis}
    material = ec.Elastic(lambda x: 1.0 + x[0] * x[1], lambda x: 0.1 + 0.2 * x[1], **kind)
    top = ec.Displacement("top", (None,) * (d - 1) + (-0.01,))
    law = Model(ec.Scene(material, [top], contacts=ec.Contact("bottom")), body).constitution
    rng = np.random.default_rng(points)
    cells = np.arange(3, dtype=np.int32)
    x = rng.uniform(0.1, 1.1, (3, points, d))
    of_cells = rng.normal(size=(3, 1, law.stiffness.size))
    for tensor in (of_cells, rng.normal(size=(3, points, law.stiffness.size))):
        products = law.stiffness.times(tensor, x, cells)
        everywhere = np.broadcast_to(tensor, products.shape)
        known = np.einsum("nqij,nqj->nqi", law.stiffness(x, cells), everywhere)
        assert products == pytest.approx(known, rel=1e-12, abs=1e-12)
        assert law.metric.times(products, x, cells) == pytest.approx(everywhere, rel=1e-9, abs=1e-9)
