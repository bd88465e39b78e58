"""Orthotropic friction: the tractions that are allowed lie in an ellipse.

- equal coefficients are Coulomb's law to round-off, and it does not matter which axis
  is named first;
- a box that is turned with its axes has the same answer;
- where a box slides, the friction is the point of the ellipse whose normal is opposite
  to the slip;
- r^ lies in its ellipse, and the contact part of e^2 is what formulas of this file say;
- e bounds true errors where the ellipse does not depend on the pressure;
- a goal, bodies in contact, histories, curved foundations, ranks;
- what is wrong is refused in words.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from domains import two_halves
from mpi4py import MPI
from reference import nested, true_errors
from test_bad_input import refused

import erc_contact as ec
from erc_contact.error.contact import contact_parts
from namedmesh.simplex import bernstein

MU = 0.1, 0.4
AXIS = 0.8, 0.6, 0.0
METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]


@dataclass(frozen=True)
class Woven:
    """An ellipse of Tresca's kind: the bound does not depend on the pressure."""

    limit: float
    axes: tuple = AXIS
    ratio: float = 3.0
    parameters: ClassVar[tuple[str, ...]] = ("limit",)

    def friction_bound(self, pressure, limit):
        return limit


def brushed(mu=MU, axes=AXIS) -> ec.Orthotropic:
    return ec.Orthotropic(mu, axes=axes)


def cube(n: int = 2, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    return ec.box((0.0, 0.0, 0.0), (1.0, 0.8, 0.7), cells=(n, n, n), comm=comm)


def pushed(law, push=(0.02, -0.01, -0.03), **options) -> ec.Scene:
    contact = ec.Contact("bottom", friction=law, **options)
    return ec.Scene(ec.Elastic(1.0, 0.3), [ec.Displacement("top", push)], contacts=[contact])


def error_of(scene, domain, **options) -> ec.ConstitutiveError:
    return ec.constitutive_error(ec.equilibrate(ec.solve(scene, domain, **options)))


def ellipse_of(vectors, ratio, axis=AXIS):
    """Components of tangential vectors along the axis, and across it over the ratio."""
    return vectors @ np.array([axis[:2], (-axis[1] / ratio, axis[0] / ratio)]).T


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("method", METHODS)
def test_equal_coefficients_are_coulomb(method, degree):
    coulomb, same = (
        error_of(pushed(law), cube(), method=method, degree=degree)
        for law in (ec.Coulomb(0.3), brushed((0.3, 0.3)))
    )
    assert abs(same.solution.u.x.array - coulomb.solution.u.x.array).max() < 1e-12
    assert same.absolute == pytest.approx(coulomb.absolute, rel=1e-12)


def test_either_axis_may_be_named_first():
    first, second = (
        error_of(pushed(law), cube())
        for law in (brushed(), brushed(MU[::-1], axes=(-0.6, 0.8, 0.0)))
    )
    assert abs(first.solution.u.x.array - second.solution.u.x.array).max() < 1e-9 * 0.03
    assert second.relative == pytest.approx(first.relative, rel=1e-8)


def test_turned_box_has_the_same_answer():
    Q, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    Q *= np.linalg.det(Q)
    forces = []
    for turn in (np.eye(3), Q):
        box = cube()
        box.mesh.geometry.x[:] = box.mesh.geometry.x @ turn.T
        law = brushed(axes=tuple(turn @ AXIS))
        error = error_of(pushed(law, tuple(turn @ [0.02, -0.01, -0.03])), box)
        forces.append((turn.T @ error.solution.force("bottom").force, error.relative))
    assert forces[1][0] == pytest.approx(forces[0][0], rel=1e-9)
    assert forces[1][1] == pytest.approx(forces[0][1], rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_slip_is_normal_to_the_ellipse(method):
    slip = np.array([300.0, 400.0])
    solution = ec.solve(pushed(brushed(), (*slip, -0.03)), cube(), method)
    force = solution.force("bottom").force
    along = np.array([AXIS[:2], (-AXIS[1], AXIS[0])]) @ slip
    opposite = np.array(MU) ** 2 * along / np.linalg.norm(np.array(MU) * along)
    expected = -force[2] * opposite @ np.array([AXIS[:2], (-AXIS[1], AXIS[0])])
    # The slip differs from the push by elastic displacements of some 0.01.
    assert force[:2] == pytest.approx(expected, rel=1e-3)
    assert np.all(solution.profile("bottom")["status"] == 1)
    profile = solution.profile("bottom")
    used = (
        profile["shear"][profile["pressure"] > 0]
        / profile["friction_bound"][profile["pressure"] > 0]
    )
    assert np.linalg.norm(force[:2]) < 0.9 * MU[1] * force[2]
    assert used == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("degree", [1, 2])
def test_contact_part_by_other_formulas(degree):
    """They are evaluated at random points, of which one in a thousand is enough."""
    law = Woven(0.004)
    error = error_of(pushed(law), cube(), degree=degree)
    pair = error.admissible
    (traction,) = pair.tractions
    rng = np.random.default_rng(0)
    places = rng.dirichlet((1.0, 1.0, 1.0), 5000)
    shape = bernstein(2, degree, places[:, 1:])
    trace = traction.contact.trace
    w = shape @ trace.coefficients(trace.of(pair.displacement.x.array))
    r = shape @ traction.values
    r_t, w_t = r[..., :2], w[..., :2]
    excess = np.linalg.norm(ellipse_of(r_t, law.ratio), axis=-1) - law.limit
    assert excess.max() < 1e-12 * law.limit
    work = law.limit * np.linalg.norm(ellipse_of(w_t, 1 / law.ratio), axis=-1)
    density = work + (r * w).sum(axis=-1)
    assert density.min() > -1e-12 * work.max()
    comm = error.domain.comm
    own = comm.allreduce(float(2 * trace.here.owned_areas @ density.mean(axis=1)))
    parts = comm.allreduce(
        float(contact_parts(error.model.space, pair.displacement, traction).sum())
    )
    assert own > 1e-3 * error.absolute**2
    assert parts == pytest.approx(own, rel=0.03)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("method", METHODS)
def test_friction_alone_holds_a_body(method, degree):
    """Its tractions are balanced where the ellipse is a disc, and balance the loads here."""
    push = ec.Traction("top", (0.0006, 0.0004, -0.01))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [], [push], [ec.Contact("bottom", friction=brushed())])
    error = error_of(scene, cube(), method=method, degree=degree)
    (traction,) = error.admissible.tractions
    force = traction.contact.trace.here.owned_areas @ traction.values.mean(axis=1)
    total = error.domain.comm.allreduce(force)
    assert total == pytest.approx(0.8 * np.array([-0.0006, -0.0004, 0.01]), rel=1e-9)
    pressure, needed, bound = traction.in_law()
    assert (needed - bound).max(initial=0.0) < 1e-12 * 0.01
    assert pressure.min(initial=0.0) > -1e-12 * 0.01


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_bound_of_true_errors(degree):
    error = error_of(pushed(Woven(0.004)), cube(), degree=degree)
    fine = ec.solve(error.solution.scene, nested(error.domain, 1), degree=2)
    true = true_errors(error.admissible, fine)
    assert error.guaranteed
    assert 1.0 <= error.absolute / true.both < 1.3


@pytest.mark.broad
@pytest.mark.serial
def test_goal_is_as_sharp_as_with_coulomb():
    goal = ec.Resultant("top", (1.0, 0.0, 0.0))
    widths = []
    for law in (brushed(), ec.Coulomb(0.2)):
        bounds = ec.interval(error_of(pushed(law), cube(), degree=2), goal)
        fine = ec.solve(pushed(law), cube(4), degree=2).force("top").force[0]
        assert bounds.low < fine < bounds.high
        widths.append((bounds.high - bounds.low) / abs(fine))
    # On 20 random boxes half to twice as wide, in the median narrower.
    assert widths[0] < 2.0 * widths[1]


def test_bodies_histories_and_curved_foundations():
    """Between halves of a box, back and forth; on a ball, with axes about its pole."""
    bodies = two_halves(cube(), axis=2, at=0.35).split({"under": "lower", "over": "upper"})
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("bottom", (0.0, 0.0, 0.0)), ec.Displacement("top", (0.02, 0.01, -0.03))],
        contacts=[ec.Contact("under", against="over", friction=brushed())],
    )
    solution = ec.solve(scene, bodies)
    back = replace(scene, supports=[scene.supports[0], ec.Displacement("top", (0.0, 0.01, -0.03))])
    later = ec.constitutive_error(ec.equilibrate(ec.solve(back, bodies, after=solution)))
    assert 0.0 < later.relative < 0.5
    ball = pushed(
        brushed(axes=lambda x: (x[0] + 2.0, x[1], 0.0)),
        normal=lambda x: (0.1 * x[0], 0.1 * x[1], -1.0),
        gap=lambda x: 0.05 * (x[0] ** 2 + x[1] ** 2),
    )
    error = error_of(ball, cube(), degree=2)
    assert 0.0 < error.relative < 0.5
    assert not error.guaranteed


@pytest.mark.ranks
def test_ranks():
    errors = [
        error_of(pushed(brushed()), cube(comm=comm)) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    ]
    forces = [error.solution.force("bottom").force for error in errors]
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)
    assert errors[1].relative == pytest.approx(errors[0].relative, rel=1e-8)


SOLVED = {
    "in the plane": (
        lambda: ec.solve(
            replace(pushed(brushed()), supports=[ec.Displacement("top", (0.0, -0.01))]),
            ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2)),
        ),
        "has axes, and the mesh is in the plane",
    ),
    "normal": (
        lambda: ec.solve(pushed(brushed(axes=(0.0, 0.0, 2.0))), cube()),
        "along the normal on a facet",
    ),
    "foundation": (
        lambda: ec.solve(
            pushed(brushed(), foundation=ec.Foundation(normal=1.0, tangential=1.0)), cube()
        ),
        "the foundation is tangentially compliant",
    ),
    "bilateral": (
        lambda: ec.solve(pushed(brushed(), bilateral=True), cube()),
        "depends on the pressure, and the contact is bilateral",
    ),
    "one number": (lambda: ec.Orthotropic(0.3, axes=AXIS), "friction is 0.3; give two numbers > 0"),
    "zero": (lambda: ec.Orthotropic((0.0, 0.3), axes=AXIS), "(0.0, 0.3); give two numbers > 0"),
    "no vector": (lambda: ec.Orthotropic(MU, axes="x"), "Orthotropic: axes is 'x'; give"),
}


@pytest.mark.parametrize("case", SOLVED)
def test_refused(case):
    call, words = SOLVED[case]
    refused(call, words)


def test_a_method_that_does_not_know_the_slip_is_refused():
    @dataclass(frozen=True)
    class Plain(ec.Nitsche):
        def traction(self, model, contact, u, multiplier=None):
            return contact.project(-1e3 * contact.jump(u), 1e3)

        projected = traction

    words = "a method calls contact.allowed_traction(r, u, gamma) there"
    refused(lambda: ec.solve(pushed(brushed()), cube(1), Plain()), words)


def test_nothing_is_claimed_of_uniqueness():
    certificate = ec.coulomb_certificate(error_of(pushed(brushed()), cube()))
    assert "no isotropic multiple of the pressure" in str(certificate)
    assert certificate.bound == np.inf
