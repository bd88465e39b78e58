"""Algebra of materials and of the friction cone, and derivatives of the contact equations.

- compliance of stress is the identity, also near incompressibility; rigid motions have
  no strain;
- the projection of each law is what its formula says, and idempotent; the Euclidean one
  does not expand distances;
- the Taylor remainder of the residual is of second order in open, slip and stick states
  (a wrong tangent would show);
- closest points on facets are the closest of the feet on all their faces.
"""

from itertools import combinations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from scenes import block, common_block

import erc_contact as ec
from erc_contact.admissible.cones import Cones
from erc_contact.model.contact.friction_set import DISC
from erc_contact.model.contact.trace import split
from erc_contact.model.data.expressions import evaluate
from erc_contact.model.model import Model
from erc_contact.scene.law import project
from erc_contact.scene.material import strain
from namedmesh.closest import closest

pytestmark = pytest.mark.serial

MIDDLE = {2: np.array([[0.3, 0.2]]), 3: np.array([[0.3, 0.2, 0.1]])}


METHODS = [ec.Nitsche(), ec.Nitsche(theta=1), ec.Nitsche(theta=-1), ec.AugmentedLagrangian()]


def value(expression: object, domain: ec.Domain) -> np.ndarray:
    return evaluate(expression, domain.mesh, MIDDLE[domain.dim], np.zeros(1, dtype=np.int32))[0, 0]


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
def test_nearest_point_of_the_cone(d, mu):
    rng = np.random.default_rng(0)
    n = rng.standard_normal(d)
    n = np.broadcast_to(n / np.linalg.norm(n), (1000, d))
    z, other = rng.standard_normal((2, 1000, d))
    zero = np.zeros((1000, 1))
    cones = Cones(n[:, None], zero + mu, zero, zero > 0)

    def nearest_in_cone(z: np.ndarray) -> np.ndarray:
        return cones.nearest(z[:, None])[:, 0]

    nearest = nearest_in_cone(z)
    assert np.abs(nearest_in_cone(nearest) - nearest).max() < 1e-14
    r_n, _, size = split(nearest, n)
    assert r_n.max() <= 1e-15
    assert (size - mu * abs(r_n)).max() <= 1e-14
    moved = nearest - nearest_in_cone(other)
    assert (np.linalg.norm(moved, axis=1) - np.linalg.norm(z - other, axis=1)).max() <= 1e-14
    # nearest: the residual is normal to the cone at the projection
    assert np.abs(np.einsum("ni,ni->n", z - nearest, nearest)).max() < 1e-13


LAWS = {
    "frictionless": (None, lambda p: 0.0, False),
    "Coulomb": (lambda p: 0.3 * p, lambda p: 0.3 * p, False),
    "Tresca": (lambda p: 0.2, lambda p: 0.2, False),
    "bilateral Tresca": (lambda p: 0.2, lambda p: 0.2, True),
    "saturating": (lambda p: 0.2 * ufl.tanh(3 * p), lambda p: 0.2 * np.tanh(3 * p), False),
}


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", LAWS)
def test_projection_of_a_law(d, name):
    """Normal part cut at zero, tangential part shortened to the bound of that pressure; idempotent."""
    bound, number, bilateral = LAWS[name]
    rng = np.random.default_rng(0)
    domain = domain_of(d)
    n = rng.standard_normal(d)
    n /= np.linalg.norm(n)
    z, direction = (fem.Constant(domain.mesh, v) for v in (np.zeros(d), n))
    nearest = project(z, direction, bound, DISC.gauge_in_ufl, bilateral=bilateral)
    projection = fem.Expression(nearest, np.zeros((1, d)))
    cell = np.zeros(1, dtype=np.int32)
    for trial in (*rng.standard_normal((20, d)), np.zeros(d), n):
        z.value[:] = trial
        r = projection.eval(domain.mesh, cell).ravel()
        z_n = trial @ n
        pressure = -z_n if bilateral else max(-z_n, 0.0)
        z_t = trial - z_n * n
        size = np.linalg.norm(z_t)
        expected = -pressure * n + z_t * min(1.0, number(pressure) / size if size > 0 else 1.0)
        assert np.allclose(r, expected, atol=1e-14)
        z.value[:] = r
        assert np.allclose(projection.eval(domain.mesh, cell).ravel(), r, atol=1e-14)


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("state", ["open", "slip", "stick"])
def test_taylor_remainder(method, state):
    """The derivative of the equations in u and in the multiplier is right.

    Remainders of second order.
    """
    model = Model(common_block(), block(2))
    space = model.space
    contact = model.contacts[0]
    u, field, v = (
        fem.Function(space.V),
        fem.Function(space.V),
        ufl.TestFunction(space.V),
    )
    shear = {"open": (0.01, 0.02), "slip": (0.3, -0.01), "stick": (0.001, -0.01)}[state]
    # displacement at the bottom: away from, along, or into the foundation
    u.interpolate(lambda x: np.array([shear[0] * (1 + 0.1 * x[0]), shear[1] * (1 + 0.01 * x[1])]))
    residual = method.equations(model, contact, u, v, field if method.multiplier else None)
    form = fem.form(residual)
    rng = np.random.default_rng(0)
    for unknown in (u, field) if method.multiplier else (u,):
        change = fem.Function(space.V)
        change.x.array[:] = rng.standard_normal(len(change.x.array))
        change.x.scatter_forward()
        r_0 = fem.assemble_vector(form).array.copy()
        slope = fem.assemble_vector(fem.form(ufl.derivative(residual, unknown, change))).array
        start = unknown.x.array.copy()

        def remainder(h, unknown=unknown, change=change, r_0=r_0, slope=slope, start=start):
            unknown.x.array[:] = start + h * change.x.array
            difference = fem.assemble_vector(form).array - r_0 - h * slope
            unknown.x.array[:] = start
            return float(np.abs(difference).max(initial=0.0))

        coarse, fine = remainder(1e-4), remainder(5e-5)
        linear = 1e-4 * float(np.abs(slope).max(initial=0.0))
        assert coarse <= 0.05 * linear
        # second order, or exactly linear (open, stick)
        assert fine < 0.3 * coarse or coarse <= 1e-12 * max(
            linear / 1e-4, abs(r_0).max(initial=0.0)
        )


@pytest.mark.parametrize(("d", "corner_count"), [(2, 2), (3, 2), (3, 3)])
def test_closest_points_are_those_of_all_faces_of_all_facets(d, corner_count):
    """Beside a flat triangle, clamped barycentric coordinates are up to 1.3 times too far."""
    rng = np.random.default_rng(3)
    corners = rng.normal(size=(30, corner_count, d))
    x = 2.0 * rng.normal(size=(100, d))
    facet, local, distance = closest(x, corners)
    of_faces = []
    for size in range(1, corner_count + 1):
        for face in combinations(range(corner_count), size):
            of_faces.append(feet_on_faces(x, corners[:, face]))
    least = np.min(of_faces, axis=(0, 2))
    assert abs(distance - least).max() <= 1e-13 * abs(x).max()
    assert local.min() >= 0.0
    feet = np.einsum("nm,nmi->ni", local, corners[facet])
    assert abs(np.linalg.norm(feet - x, axis=1) - distance).max() <= 1e-13 * abs(x).max()


def feet_on_faces(x, faces):
    """Return distances of points (n, d) from feet on faces (f, k, d), inf off them."""
    along = (faces[:, 1:] - faces[:, :1]).transpose(0, 2, 1)
    offset = x[:, None] - faces[:, 0]
    inner = np.einsum("fkd,nfd->nfk", np.linalg.pinv(along), offset)
    is_on = np.all(inner >= 0, axis=2) & (inner.sum(axis=2) <= 1)
    distance = np.linalg.norm(offset - np.einsum("fdk,nfk->nfd", along, inner), axis=2)
    return np.where(is_on, distance, np.inf)
