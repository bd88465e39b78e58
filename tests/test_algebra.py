"""Algebra of materials and of the friction cone, and derivatives of the contact equations.

- compliance of stress is the identity, also near incompressibility; rigid motions have no strain;
- projections on the cone are idempotent; the Euclidean one does not expand distances; both agree with the law in UFL;
- the Taylor remainder of the residual is of second order in open, slip and stick states (a wrong tangent would show).
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from scenes import block, common_block

import erc_contact as ec
from erc_contact.admissible import contact as cone
from erc_contact.law import project_on_cone
from erc_contact.material import strain
from erc_contact.model import Model, evaluate

MIDDLE = {2: np.array([[0.3, 0.2]]), 3: np.array([[0.3, 0.2, 0.1]])}


def value(expression: object, domain: ec.Domain) -> np.ndarray:
    return evaluate(expression, domain, MIDDLE[domain.dim], np.zeros(1, dtype=np.int32))[0, 0]


def domain_of(d: int) -> ec.Domain:
    from mpi4py import MPI

    if d == 2:
        return ec.rectangle((0, 0), (1, 1), cells=(1, 1), comm=MPI.COMM_SELF)
    return ec.box((0, 0, 0), (1, 1, 1), cells=(1, 1, 1), comm=MPI.COMM_SELF)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.3, 0.4999])
def test_compliance_inverts_stress(d, hypothesis, nu):
    rng, domain = np.random.default_rng(0), domain_of(d)
    eps = rng.standard_normal((d, d))
    eps = eps + eps.T
    material = ec.Elastic(E=2.0, nu=nu, hypothesis=hypothesis)
    parameters = {"E": fem.Constant(domain.mesh, 2.0), "nu": fem.Constant(domain.mesh, nu)}
    tensor = fem.Constant(domain.mesh, eps)
    back = value(material.compliance(material.stress(tensor, **parameters), **parameters), domain)
    assert np.abs(back - eps).max() < 1e-12


def test_uniaxial_stress():
    """In 3D and in plane stress, uniaxial tension stretches by sigma/E and contracts by nu sigma/E."""
    for d, hypothesis in ((3, "plane strain"), (2, "plane stress")):
        domain = domain_of(d)
        sigma = np.zeros((d, d))
        sigma[0, 0] = 3.0
        parameters = {"E": fem.Constant(domain.mesh, 2.0), "nu": fem.Constant(domain.mesh, 0.3)}
        material = ec.Elastic(2.0, 0.3, hypothesis)
        eps = value(material.compliance(fem.Constant(domain.mesh, sigma), **parameters), domain)
        assert np.allclose(eps, np.diag([1.5, -0.45, -0.45][:d]), atol=1e-14)


@pytest.mark.parametrize("d", [2, 3])
def test_rigid_motions_have_no_strain(d):
    domain = domain_of(d)
    spin = np.random.default_rng(0).standard_normal((d, d))
    motion = fem.Function(fem.functionspace(domain.mesh, ("Lagrange", 1, (d,))))
    motion.interpolate(lambda x: (spin - spin.T) @ x[:d] + 1.0)
    assert np.abs(value(strain(motion), domain)).max() < 1e-14


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("mu", [0.0, 0.3, 5.0])
def test_cone_projections(d, mu):
    rng = np.random.default_rng(0)
    n = rng.standard_normal(d)
    n /= np.linalg.norm(n)
    z, other = rng.standard_normal((2, 1000, d))
    factor = np.full(1000, mu)
    for project in (cone.project_on_cone, cone.nearest_in_cone):
        once = project(z, n, factor)
        assert np.abs(project(once, n, factor) - once).max() < 1e-14
        r_n = once @ n
        assert r_n.max() <= 1e-15
        assert (np.linalg.norm(once - r_n[:, None] * n, axis=1) - mu * abs(r_n)).max() <= 1e-14
    near = cone.nearest_in_cone(z, n, factor) - cone.nearest_in_cone(other, n, factor)
    assert (np.linalg.norm(near, axis=1) - np.linalg.norm(z - other, axis=1)).max() <= 1e-14
    # nearest: the residual is normal to the cone at the projection
    nearest = cone.nearest_in_cone(z, n, factor)
    assert np.abs(np.einsum("ni,ni->n", z - nearest, nearest)).max() < 1e-13
    domain = domain_of(d)
    for row in range(5):
        tractions = fem.Constant(domain.mesh, z[row]), fem.Constant(domain.mesh, n)
        law = value(project_on_cone(*tractions, fem.Constant(domain.mesh, mu) if mu else None), domain)
        assert np.allclose(law, cone.project_on_cone(z[row], n, factor[row]), atol=1e-14)


@pytest.mark.parametrize("theta", [0, 1, -1])
@pytest.mark.parametrize("state", ["open", "slip", "stick"])
def test_taylor_remainder(theta, state):
    scene = common_block()
    model = Model(scene, block(2))
    method = ec.Nitsche(theta=theta)
    u, du, v = fem.Function(model.V), fem.Function(model.V), ufl.TestFunction(model.V)
    shear = {"open": (0.01, 0.02), "slip": (0.3, -0.01), "stick": (0.001, -0.01)}[state]
    # displacement at the bottom: away from, along, or into the foundation
    u.interpolate(lambda x: np.array([shear[0] * (1 + 0.1 * x[0]), shear[1] * (1 + 0.01 * x[1])]))
    rng = np.random.default_rng(0)
    du.x.array[:] = rng.standard_normal(len(du.x.array))
    du.x.scatter_forward()
    residual = method.equations(model, u, v)
    form, tangent = fem.form(residual), fem.form(ufl.derivative(residual, u, du))
    r_0, slope = fem.assemble_vector(form), fem.assemble_vector(tangent)
    start = u.x.array.copy()

    def remainder(h: float) -> float:
        u.x.array[:] = start + h * du.x.array
        return float(np.abs(fem.assemble_vector(form).array - r_0.array - h * slope.array).max())

    coarse, fine = remainder(1e-4), remainder(5e-5)
    linear = 1e-4 * float(np.abs(slope.array).max())
    assert coarse < 0.05 * linear
    # second order, or exactly linear (open, stick)
    assert fine < 0.3 * coarse or coarse < 1e-12 * linear / 1e-4
