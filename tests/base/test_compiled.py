"""A form that is known is not compiled again, and the folder of compiled forms is not read again for it."""

import ctypes
import os

import ffcx
import numpy as np
import pytest
import ufl
from dolfinx import fem
from ffcx.naming import compute_signature
from mpi4py import MPI
from scenes import block

import erc_contact as ec
from erc_contact.base.runtime import compiled
from erc_contact.base.runtime.compiled import FIRST_NUMBER, _key
from erc_contact.base.runtime.form_library import form_library
from namedmesh.base.releases import c_code


def area(domain: ec.Domain) -> fem.Form:
    return compiled.form(compiled.constant(domain.mesh, 2.0) * ufl.dx(domain.mesh))


def test_known_forms_are_not_searched(monkeypatch):
    """On another mesh the same form is the same compiled module, found without a look at the disk."""
    first = area(block(2))
    monkeypatch.setattr(
        os, "listdir", lambda *_: (_ for _ in ()).throw(AssertionError("searched on the disk"))
    )
    again = area(block(3))
    assert again.module is first.module
    assert fem.assemble_scalar(again) > 0


def test_numbers_of_constants_have_as_many_digits():
    """UFL sorts factors by the text of these numbers.

    "10" comes before "9", but "11" after "10".
    """
    mesh = block(2).mesh
    assert FIRST_NUMBER <= compiled.constant(mesh, 1.0).count() < 10 * FIRST_NUMBER


def forms(domain: ec.Domain) -> list[ufl.Form]:
    """Forms that differ from their neighbours in one thing that decides on their code."""
    mesh = domain.mesh
    V, W = (fem.functionspace(mesh, ("Lagrange", degree, (2,))) for degree in (1, 2))
    f, g, h = fem.Function(V), fem.Function(V), fem.Function(W)
    a, b, c = fem.Constant(mesh, 1.0), fem.Constant(mesh, 2.0), fem.Constant(mesh, (1.0, 2.0))
    u, v, n, x = (
        ufl.TrialFunction(V),
        ufl.TestFunction(V),
        ufl.FacetNormal(mesh),
        ufl.SpatialCoordinate(mesh),
    )
    i, j = ufl.indices(2)
    label = ufl.variable(f[0])
    dx, ds = ufl.dx(mesh), ufl.Measure("ds", mesh)
    at = [np.array([[0.0], [end]]) for end in (1.0, 1.0 - 1e-7)]
    rule = {"quadrature_rule": "custom", "quadrature_weights": np.array([0.5, 0.5])}
    scalars = [
        *(f[0] / g[1], g[0] / f[1], f[0] / f[1], f[1] / f[1], f[0] / h[1]),
        *(a / b, b / a, a / c[0], c[0] / a, 2 / a, 2.0 / a, 3 / a),
        *(
            f[i].dx(i),
            f[0].dx(0),
            ufl.grad(f)[i, j] * ufl.grad(f)[i, j],
            ufl.grad(f)[i, j] * ufl.grad(f)[j, i],
        ),
        *(ufl.exp(x[0]), ufl.sin(x[0]), ufl.diff(label**2, label)),
        *(ufl.conditional(ufl.lt(f[0], a), f[0], 0), ufl.conditional(ufl.le(f[0], a), f[0], 0)),
    ]
    return [
        *(scalar * dx for scalar in scalars),
        *(u[0] * v[1] * dx, u[1] * v[0] * dx, ufl.derivative(ufl.inner(f, f) ** 2 * dx, f, v)),
        *(
            n[0] * ds,
            n[0] * ds(1),
            n[0] * ds(2),
            n[0] * ds((1, 2)),
            x[0] * ds,
            x[0] * dx,
            x[0] * dx + x[0] * ds,
        ),
        *(x[0] * ds(metadata={"quadrature_degree": degree}) for degree in (2, 3)),
        *(x[0] * ds(metadata={**rule, "quadrature_points": points}) for points in at),
    ]


def test_forms_have_the_same_key_if_ufl_signs_them_alike():
    """So they have on two meshes.

    Forms that differ have other keys, as they have other signatures.
    """
    first, second = (
        [(_key(one, None, None), one.signature()) for one in forms(block(n))] for n in (2, 3)
    )
    assert first == second
    for column in zip(*first, strict=True):
        assert len(set(column)) == len(first)


def test_parts_of_one_content_are_one_part():
    """Whether they are one object or two, as parts of an expression that UFL has kept are."""
    mesh = block(2).mesh
    x = ufl.SpatialCoordinate(mesh)

    def root():
        return ufl.sqrt(1.0 + ufl.inner(x, x))

    one = root()
    shared, apart, other = (
        total * ufl.dx(mesh) for total in (one * (2.0 + one), root() * (2.0 + root()), one + one)
    )
    assert _key(shared, None, None) == _key(apart, None, None)
    assert _key(shared, None, None) != _key(other, None, None)


@pytest.mark.serial
def test_a_second_plastic_body_compiles_nothing():
    law = ec.Plastic(E=1.0, nu=0.3, yield_stress=0.004, hardening=0.05)
    down = ec.Displacement("top", (0.0, -0.01))
    known = []
    for _ in range(2):
        domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
        ec.solve(ec.Scene(law, down, contacts=ec.Contact("bottom", friction=0.3)), domain)
        known.append(len(compiled._known))
    assert known[1] == known[0]


def test_keys_know_the_element_of_the_mesh():
    """Also where nothing in the form has it but the measure."""
    meshes = [block(2).mesh, ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(1, 1, 1)).mesh]
    assert len({_key(ufl.as_ufl(1.0) * ufl.dx(mesh), {}, None) for mesh in meshes}) == 2
    areas = [fem.assemble_scalar(fem.form(ufl.as_ufl(1.0) * ufl.dx(mesh))) for mesh in meshes]
    assert [meshes[0].comm.allreduce(area) for area in areas] == [
        pytest.approx(14.0),
        pytest.approx(1.0),
    ]


def test_keys_know_options_and_all_digits_of_points():
    x, points = ufl.SpatialCoordinate(block(2).mesh), np.array([[0.25, 0.25]])
    assert _key((x, points), {}, None) == _key((x, points.copy()), {}, None)
    others = [
        ((x, points + 1e-15), {}, None),
        ((x, points), {"scalar_type": float}, None),
        ((x, points), {}, {"timeout": 1}),
    ]
    assert len({_key(*other) for other in [((x, points), {}, None), *others]}) == 4


def test_variables_are_signed_alike_whatever_was_made_before():
    """The numbers that UFL gives to variables in a process are not in the signature."""
    x, points = ufl.SpatialCoordinate(block(2).mesh), np.array([[0.25, 0.25]])

    def signature(factor: int) -> str:
        first, second = ufl.variable(x[0]), ufl.variable(x[1])
        slope = ufl.diff(first**2 * second ** (factor + 2), first)
        with compiled._variables_by_order():
            return compute_signature([(slope, points)], "")

    assert signature(1) == signature(1)
    assert signature(1) != signature(2)


def test_nodes_that_are_found_by_their_numbers_give_the_same_code():
    """Of a form with tensors, indices, conditions and a derivative."""
    mesh = block(2).mesh
    V = fem.functionspace(mesh, ("Lagrange", 2, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    strain = ufl.sym(ufl.grad(u))
    energy = ufl.conditional(ufl.lt(u[0], 0.1), ufl.tr(strain) ** 2, ufl.inner(strain, strain))
    source = ufl.derivative(energy * ufl.dx(mesh), u, v)
    options = ffcx.get_options({"scalar_type": np.float64})
    usual = c_code([source], "form", options)
    with compiled._nodes_by_number():
        assert c_code([source], "form", options) == usual


@pytest.mark.parametrize("parts", [("top",), ("left", "top"), ("top", "left")])
def test_forms_on_other_parts_are_the_same_code(parts):
    """They integrate over their own parts nevertheless."""
    domain = block(2)
    x, ds = (
        ufl.SpatialCoordinate(domain.mesh),
        ufl.Measure("ds", domain.mesh, subdomain_data=domain.facet_tags),
    )

    def integral(names: tuple[str, ...]) -> ufl.Form:
        terms = [(x[k] + 1) * ds(domain.tag(name)) for k, name in enumerate(names)]
        return sum(terms[1:], start=terms[0])

    form = compiled.form(integral(parts))
    others = tuple({"top": "bottom"}.get(name, name) for name in parts)
    assert form.module is compiled.form(integral(others)).module
    total = domain.mesh.comm.allreduce(fem.assemble_scalar(form), MPI.SUM)
    usual = domain.mesh.comm.allreduce(fem.assemble_scalar(fem.form(integral(parts))), MPI.SUM)
    assert total == pytest.approx(usual, rel=1e-14)


def test_forms_and_expressions_in_one_module():
    """Both are found there, and have the values that they have when they are compiled by themselves."""
    domain = block(2)
    mesh = domain.mesh
    x, points = ufl.SpatialCoordinate(mesh), np.array([[0.25, 0.5]])
    integral, value = (7 + x[1]) * ufl.dx(mesh), 7 * x[0] - x[1]
    # Twice, as two contacts that are alike have it.
    twice = [(value, points), (value, points)]
    (form,), (expression, again) = compiled.together(mesh.comm, [integral], twice)
    assert fem.assemble_scalar(form) == fem.assemble_scalar(fem.form(integral))
    cells = np.arange(3, dtype=np.int32)
    alone = fem.Expression(value, points, comm=mesh.comm).eval(mesh, cells)
    assert np.array_equal(expression.eval(mesh, cells), alone)
    assert np.array_equal(again.eval(mesh, cells), alone)
    assert (
        form.module is compiled._known[_key((value, points), {"scalar_type": np.float64}, None)][1]
    )


SUM = "double total(double a, double b) { return a + b; }\n"


@pytest.mark.serial
def test_libraries_of_forms(tmp_path):
    """Compiled once; also where no folder can be written to; a compiler that fails says why."""
    path = tmp_path / "forms" / "libtotal.so"
    for code in (lambda: SUM, lambda: pytest.fail("compiled again")):
        total = form_library(path, ["-O0"], code).functions.total
        total.restype = ctypes.c_double
        assert total(ctypes.c_double(1.0), ctypes.c_double(2.0)) == 3.0
    (tmp_path / "file").touch()
    assert form_library(tmp_path / "file" / "libtotal.so", [], lambda: SUM).functions.total
    broken = tmp_path / "libbroken.so"
    with pytest.raises(RuntimeError, match=r"(?s)C compiler failed.*CC"):
        form_library(broken, [], lambda: "not C")
    assert not broken.exists()
