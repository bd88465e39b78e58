"""UFL expressions that numpy carries out have the values that the compiler gives them."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from ffcx.naming import compute_signature
from laws import TwoModuli
from mpi4py import MPI

import erc_contact as ec
from erc_contact.model.data import array_code as module
from erc_contact.model.data.array_code import array_code
from erc_contact.model.data.expressions import OfNumbers, evaluate
from erc_contact.model.law import law_code

pytestmark = pytest.mark.serial
POINTS = np.array([[0.2, 0.3], [0.6, 0.1], [1 / 3, 1 / 3]])


def of_all_operators(mesh):
    """One scalar for each kind of operator and of indices, of x and a function that is constant in cells."""
    x = ufl.SpatialCoordinate(mesh)
    E = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    E.x.array[:] = np.linspace(0.5, 2.0, len(E.x.array))
    c, shift = fem.Constant(mesh, 1.7), fem.Constant(mesh, (0.3, -0.2))
    a = ufl.as_matrix([[1 + x[0], x[1] * E], [c, 2 - x[0] * x[1]]])
    i, j, k = ufl.indices(3)
    variable = ufl.variable(x[0] / (2 + x[1]))
    near, open_ = ufl.lt(x[0], 0.5), ufl.And(ufl.ge(x[1], 0.4), ufl.Not(ufl.eq(x[0], x[1])))
    return [
        *(
            f(0.3 + x[0] / 3)
            for f in (ufl.exp, ufl.ln, ufl.sqrt, abs, ufl.sinh, ufl.cosh, ufl.tanh)
        ),
        *(f(0.3 + x[1] / 3) for f in (ufl.sin, ufl.cos, ufl.tan, ufl.asin, ufl.acos, ufl.atan)),
        *(ufl.atan2(x[0], x[1] + 1), ufl.max_value(x[0], x[1]), ufl.min_value(x[0], E)),
        *(x[0] ** 2, (1 + x[1]) ** 3, (1 + x[0]) ** c, (1 + x[0]) ** -0.5, -E / (1 + x[1])),
        *(ufl.conditional(near, x[0], 1 / (1 - x[1])), ufl.conditional(open_, 1, 0) * x[0]),
        *(ufl.conditional(ufl.Or(ufl.le(x[0], x[1]), ufl.ne(E, c)), x[0], 0), variable**2),
        *(
            ufl.det(a),
            ufl.tr(ufl.inv(a)),
            ufl.inner(a, ufl.dev(a.T)),
            ufl.dot(ufl.dot(a, x), shift),
        ),
        *(a[i, j] * a[j, i] + a[i, i], ufl.as_tensor(a[i, k] * a[j, k], (j, i))[0, 1]),
        *(ufl.outer(x, shift)[1, 0] + ufl.Identity(2)[1, 1], ufl.sym(a)[0, 1] - ufl.skew(a)[1, 0]),
        ufl.as_tensor(x[i] * shift[j] * a[k, i], (k, j))[1, 0],
    ]


def test_all_operators():
    mesh = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 2)).mesh
    expression = ufl.as_vector(of_all_operators(mesh))
    assert array_code(expression) is not None
    cells = np.arange(12, dtype=np.int32)
    expected = fem.Expression(expression, POINTS, comm=mesh.comm).eval(mesh, cells)
    assert np.allclose(evaluate(expression, mesh, POINTS, cells), expected, rtol=1e-14, atol=1e-14)


def test_tensors_and_normals_in_chunks(monkeypatch):
    """The components have their places, Constants their values of today, and chunks their points."""
    monkeypatch.setattr(module, "POINTS_AT_ONCE", 3)
    domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    x, n = ufl.SpatialCoordinate(domain.mesh), ufl.FacetNormal(domain.mesh)
    c = fem.Constant(domain.mesh, 3.0)
    facets = domain.facets("right")
    points = np.array([[0.25], [0.75]])
    expression = c * ufl.outer(n, x)
    c.value = 2.0
    values = evaluate(expression, domain.mesh, points, facets)
    places = evaluate(x, domain.mesh, points, facets)
    assert values.shape == (len(facets), 2, 2, 2)
    assert np.allclose(values[..., 0, :], 2 * places)
    assert np.allclose(values[..., 1, :], 0.0)
    # A rank may have no facet of a part.
    assert evaluate(expression, domain.mesh, points, facets[:0]).shape == (0, 2, 2, 2)


def test_an_operator_that_numpy_does_not_know_is_compiled():
    mesh = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1)).mesh
    x = ufl.SpatialCoordinate(mesh)
    assert array_code(ufl.erf(x[0])) is None
    values = OfNumbers(ufl.erf(x[0]), MPI.COMM_WORLD)({x: np.array([[0.0, 0.0], [10.0, 0.0]])}, 2)
    assert np.allclose(values, [[0.0], [1.0]])


def kind_of(*names):
    """Plane strain, with parameters that vary."""
    return law_code.LawKind(names, {}, True, (0, 1, 2, 3), MPI.COMM_SELF)


@pytest.mark.parametrize("part", ["energy", "stress", "tangent", "conjugate", "dual"])
def test_the_code_of_a_law_has_one_name(part, monkeypatch):
    """Whatever was made before in a process: else each would compile it anew."""
    monkeypatch.setattr(law_code, "OfNumbers", lambda expression, *_, **__: expression)
    names = set()
    for _ in range(2):
        law = TwoModuli(1.0, 0.4, 0.2)
        code = law_code.LawCode(law, kind_of(*law.parameters))
        names.add(compute_signature([(getattr(code, part), np.array([[0.5]]))], ""))
    assert len(names) == 1


def test_equal_laws_have_one_code():
    """Each step of a history may make its material anew; a new array is another law."""

    def code_of(potential):
        return law_code.law_code(potential, kind_of("E"))

    def curve(last):
        return ec.HardeningCurve([0.0, 0.1], [0.01, last])

    first = code_of(ec.Plastic(1.0, 0.3, hardening=curve(0.02)))
    assert code_of(ec.Plastic(1.0, 0.3, hardening=curve(0.02))) is first
    assert code_of(ec.Plastic(1.0, 0.3, hardening=curve(0.03))) is not first

    class Weighted(ec.Potential):
        pass

    law = Weighted()
    law.weights = np.array([1.0])
    second = code_of(law)
    assert code_of(law) is second
    law.weights = np.array([1.0])
    assert code_of(law) is not second
