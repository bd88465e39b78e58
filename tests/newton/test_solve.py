"""The contact solve.

Known cases, the default start on all meshes, and what a scene does not need is not
there.

- GRECO and the common block against converged values of independent codes, within the
  stated tolerances;
- a scene without contact is one linear solve; without friction no friction term is
  formed;
- the way of starting does not change the solution; nothing is left in PETSc's options;
- NotConverged says what was tried; the default solves what one of the two methods
  solves, and says which it was.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from domains import two_halves
from mpi4py import MPI
from petsc4py import PETSc
from scenes import block, certified, common_block, greco, prototype_block, resultant, two_squares

import erc_contact as ec
from erc_contact.admissible.traction import ContactTraction
from erc_contact.newton import ladder

GRECO_X = np.array([0.0, 1.25, 5.0, 7.5, 11.25])  # mm
GRECO_U = np.array([2.8603, 2.7226, 2.2868, 1.9807, 1.5414]) * 1e-2  # mm, converged
GRECO_ENERGY, GRECO_FRICTION = 108.258, -1405.4  # N mm and N, per mm of thickness


def ends(traction: ContactTraction, solution: ec.Solution) -> tuple[np.ndarray, np.ndarray]:
    """Facets of a contact sorted along x.

    Their ends, and their status (0 open, 1 slip, 2 stick).
    """
    x = np.sort(solution.model.space.V.tabulate_dof_coordinates()[traction.nodes][:, :, 0], axis=1)
    pressure = -traction.normal_component.mean(axis=1)
    shear = np.linalg.norm(traction.tangential_part.mean(axis=1), axis=1)
    bound = traction.friction_bound.mean(axis=1)
    status = np.where(
        pressure <= 1e-9 * pressure.max(), 0, np.where(shear >= (1 - 1e-6) * bound, 1, 2)
    )
    order = np.argsort(x[:, 0])
    return x[order], status[order]


def check_greco(solution: ec.Solution) -> None:
    pair = ec.equilibrate(solution)
    x = solution.model.space.V.tabulate_dof_coordinates()
    bottom = np.flatnonzero(abs(x[:, 1]) < 1e-9)
    bottom = bottom[np.argsort(x[bottom, 0])]
    u = np.interp(GRECO_X, x[bottom, 0], solution.u.x.array.reshape(-1, 2)[bottom, 0])
    assert np.abs(u / GRECO_U - 1).max() < 5e-3
    energy = fem.assemble_scalar(fem.form(0.5 * solution.model.stiffness(solution.u, solution.u)))
    assert energy == pytest.approx(GRECO_ENERGY, rel=1e-3)
    force = resultant(pair.tractions[0])
    assert force[0] == pytest.approx(GRECO_FRICTION, rel=3e-3)
    assert force[1] == pytest.approx(2000.0, rel=1e-12)
    x, status = ends(pair.tractions[0], solution)
    facet = (x[:, 1] - x[:, 0]).max()
    assert x[status == 0].max() == pytest.approx(3.34, abs=facet)
    assert x[status == 1].max() == pytest.approx(29.85, abs=facet)
    assert x[status == 2].max() == pytest.approx(40.0, abs=facet)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("n", [16, 32, 64, 128])
def test_greco_converges_from_the_default_start(n):
    solution = ec.solve(greco(), ec.rectangle((0.0, 0.0), (40.0, 40.0), cells=(n, n)))
    assert solution.newton_steps <= 20
    if n == 128:
        check_greco(solution)


@pytest.mark.serial
def test_greco_on_an_adapted_mesh():
    history = ec.adapt(
        greco(), ec.rectangle((0.0, 0.0), (40.0, 40.0), cells=(8, 8)), accuracy=0.007
    )
    check_greco(history.best.admissible.solution)
    assert history.steps[-1].cells < 32768


@pytest.mark.serial
def test_common_block_forces_and_zones():
    """Forces to the digits on which eight codes agree, at n = 64.

    Zones within one node.
    """
    solution = ec.solve(common_block(), block(64))
    traction = ec.equilibrate(solution).tractions[0]
    force = resultant(traction)
    assert force[1] == pytest.approx(0.015997, abs=1.0e-6)
    # the equilibrated r^ changes the shear by 0.1%; the method's own traction gives the
    # digits of the codes
    model, contact = solution.model, solution.model.contacts[0]
    shear = fem.form(solution.traction(contact)[0] * contact.ds(metadata={"quadrature_degree": 4}))
    assert model.space.comm.allreduce(fem.assemble_scalar(shear)) == pytest.approx(
        -0.001350, abs=0.6e-6
    )
    if model.space.comm.size == 1:
        nodes = np.unique(traction.nodes)
        pressure = np.bincount(traction.nodes.ravel(), -traction.normal_component.ravel())[nodes]
        slide = np.bincount(traction.nodes.ravel(), traction.tangential_part[..., 0].ravel())[nodes]
        is_open = pressure <= 1e-12
        slips = ~is_open & (abs(slide) >= 0.3 * pressure * (1 - 1e-6))
        counts = np.array([is_open.sum(), (~is_open & ~slips).sum(), slips.sum()])
        assert np.abs(counts - (4, 45, 16)).max() <= 1


def test_scene_without_contact_is_a_linear_solve():
    base = prototype_block()
    scene = ec.Scene(base.material, [*base.supports, ec.Displacement("bottom", (None, 0.0))])
    solution = ec.solve(scene, block(4))
    assert solution.newton_steps == 0
    pair = ec.equilibrate(solution)
    assert pair.tractions == []
    assert pair.cell_forces is None
    assert ec.constitutive_error(pair).contact_error == 0.0


@pytest.mark.serial
def test_frictionless_scene_has_no_friction_term():
    scene = ec.Scene(
        prototype_block().material, prototype_block().supports, (), [ec.Contact("bottom")]
    )
    solution = ec.solve(scene, block(4))
    model = solution.model
    form = solution.method.equations(
        model, model.contacts[0], solution.u, ufl.TestFunction(model.space.V)
    )
    assert model.contacts[0].friction is None
    assert model.contacts[0].gap is None
    assert not ufl.algorithms.extract_type(form, ufl.classes.Sqrt)
    pair = ec.equilibrate(solution)
    assert np.abs(pair.tractions[0].tangential_part).max(initial=0.0) == 0.0


@pytest.mark.serial
def test_start_does_not_change_the_solution():
    coarse = ec.solve(common_block(), block(8))
    cold, warm = (
        ec.solve(common_block(), block(16)),
        ec.solve(common_block(), block(16), start=coarse),
    )
    difference = np.abs(cold.u.x.array - warm.u.x.array).max(initial=0.0)
    assert cold.domain.mesh.comm.allreduce(difference, MPI.MAX) < 1e-9
    assert "glued" not in warm.reason


@pytest.mark.serial
@pytest.mark.parametrize("theta", [0, 1, -1])
def test_methods_agree_within_the_discretisation(theta):
    solution = ec.solve(
        common_block(), block(16), ec.Nitsche(theta=theta, gamma=10.0 if theta else 100.0)
    )
    force = resultant(ec.equilibrate(solution).tractions[0])
    assert force[1] == pytest.approx(0.0160, rel=5e-3)


@pytest.mark.serial
def test_gap_closes():
    """A body above the foundation touches only when the push exceeds the gap.

    Tractions then follow the excess.
    """

    def pressure(push: float) -> float:
        scene = ec.Scene(
            material=ec.Elastic(E=1.0, nu=0.0),
            supports=[ec.Displacement("top", (0.0, -push))],
            contacts=[ec.Contact("bottom", gap=0.01)],
        )
        return resultant(
            ec.equilibrate(ec.solve(scene, ec.rectangle((0, 0), (1, 1), cells=(4, 4)))).tractions[0]
        )[1]

    assert pressure(0.005) == pytest.approx(0.0, abs=1e-12)
    assert pressure(0.03) == pytest.approx(
        0.02, rel=1e-9
    )  # nu = 0: a bar of length 1, width 1, E = 1


def test_options_of_the_user_win_and_ours_are_not_left():
    before = dict(PETSc.Options().getAll())
    PETSc.Options()["erc_contact_snes_max_it"] = 0
    try:
        with pytest.raises(ec.NotConverged, match="steps") as failure:
            ec.solve(common_block(), block(8))
        assert len(failure.value.rungs) >= 2
        assert "Nitsche" in str(failure.value)
    finally:
        del PETSc.Options()["erc_contact_snes_max_it"]
    assert PETSc.Options().getAll() == before


@pytest.mark.serial
@pytest.mark.parametrize(
    ("degree", "method"), [(1, ec.AugmentedLagrangian()), (2, ec.Nitsche())], ids=str
)
def test_two_bodies_are_solved_as_each_alone(degree, method):
    """Each is held vertically by its contact only.

    Two motions that no support holds, each of one body.

    Without tightening: its iterations take all bodies together.
    """

    def entries(body, push):
        supports = [ec.Displacement(f"right{body}", (0.0, None))]
        loads = [
            ec.Traction(f"top{body}", pressure=0.02),
            ec.Traction(f"left{body}", pressure=push),
        ]
        return supports, loads, [ec.Contact(f"bottom{body}", friction=0.5)]

    def error(supports, loads, contacts):
        solution = ec.solve(
            ec.Scene(ec.Elastic(1.0, 0.3), supports, loads, contacts), domain, method, degree=degree
        )
        return ec.constitutive_error(ec.equilibrate(solution, tighten=0))

    domain, first, second = two_squares(), entries(1, 0.03), entries(2, 0.01)
    both = error(*(a + b for a, b in zip(first, second, strict=True)))
    alone = []
    for body, (supports, loads, contacts) in ((2, first), (1, second)):
        alone.append(error([*supports, ec.Displacement(f"top{body}", (0.0, 0.0))], loads, contacts))
    assert len(both.admissible.solution.model.free_motions) == 2
    assert both.absolute**2 == pytest.approx(sum(e.absolute**2 for e in alone), rel=1e-9)
    assert both.scale**2 == pytest.approx(sum(e.scale**2 for e in alone), rel=1e-9)


HARD = {
    "block": [0.203, *np.linspace(0.204, 0.208, 5)],
    "block, nu 0.35": [0.19, 0.2, 0.24, 0.245],
    "GRECO": [0.05, 0.4],
    "cube on a sphere": [0.3],
}
"""Friction coefficients at which Nitsche's method found no solution from the starts of earlier versions, and others."""


def pushed_block(
    friction: float, nu: float = 0.3, push: tuple[float, float] = (0.1, -0.05)
) -> ec.Scene:
    return ec.Scene(
        ec.Elastic(1.0, nu),
        [ec.Displacement("top", push)],
        [],
        [ec.Contact("bottom", friction=friction)],
    )


def on_a_sphere(friction: float) -> ec.Scene:
    """A cube of two materials above a sphere."""

    def gap(x):
        return 2.0 - ufl.sqrt(4.0 - (x[0] - 0.5) ** 2 - (x[1] - 0.5) ** 2)

    return ec.Scene(
        ec.Elastic({"lower": 1.0, "upper": 10.0}, 0.3),
        [ec.Displacement("top", (0.04, 0.02, -0.08))],
        contacts=[ec.Contact("bottom", friction=friction, gap=gap)],
    )


SCENES = {
    "block": (pushed_block, lambda: block(4)),
    "block, nu 0.35": (
        lambda friction: pushed_block(friction, 0.35, (0.12, -0.05)),
        lambda: block(4),
    ),
    "GRECO": (greco, lambda: ec.rectangle((0.0, 0.0), (40.0, 40.0), cells=(6, 6))),
    "cube on a sphere": (
        on_a_sphere,
        lambda: two_halves(ec.box((0.0,) * 3, (1.0,) * 3, cells=(2, 2, 2)), 2, 0.4),
    ),
}


@pytest.mark.serial
@pytest.mark.parametrize(
    ("name", "degree"),
    [
        ("block", 1),
        ("GRECO", 2),
        ("cube on a sphere", 1),
        *(
            pytest.param(*case, marks=pytest.mark.broad)
            for case in [("block", 2), ("block, nu 0.35", 1), ("GRECO", 1)]
        ),
    ],
)
def test_default_solves_every_friction(name, degree):
    make, mesh = SCENES[name]
    domain = mesh()
    for friction in (
        *HARD[name],
        *np.geomspace(0.001, 2.0, 3 if name == "cube on a sphere" else 4),
    ):
        ec.solve(make(friction), domain, degree=degree)


def test_default_falls_back_on_the_augmented_lagrangian(monkeypatch):
    """A real failure.

    With so few Newton steps, and without interior points, only the augmented Lagrangian
    converges.
    """
    monkeypatch.setattr(ladder, "_interior", lambda *_: iter(()))
    scene, domain = pushed_block(0.206), block(4)
    expected = ec.solve(scene, domain, ec.AugmentedLagrangian())
    PETSc.Options()["erc_contact_snes_max_it"] = 2
    try:
        with pytest.raises(ec.NotConverged, match="the other method"):
            ec.solve(scene, domain, ec.Nitsche())
        solution = ec.solve(scene, domain)
        history = ec.adapt(scene, domain, accuracy=1e-3, max_steps=1)
    finally:
        del PETSc.Options()["erc_contact_snes_max_it"]
    assert solution.method == ec.AugmentedLagrangian()
    assert "Nitsche(theta=0, gamma=10.0) did not converge" in solution.reason
    assert len(solution.multipliers) == 1
    scale = abs(expected.u.x.array).max()
    assert abs(solution.u.x.array - expected.u.x.array).max() < 1e-10 * scale
    eps = [ec.constitutive_error(ec.equilibrate(s)).relative for s in (solution, expected)]
    assert eps[0] == pytest.approx(eps[1], rel=1e-8)
    assert history.steps[0].method == "AugmentedLagrangian"
    assert "AugmentedLagrangian on 1 of 1 meshes" in history.outcome


class Orthotropic:
    """A user's own material, by its moduli in plane [force/area].

    Written with UFL alone.
    """

    parameters = ("Cxx", "Cyy", "Cxy", "G")

    def __init__(self, Cxx, Cyy, Cxy, G):
        self.Cxx, self.Cyy, self.Cxy, self.G = Cxx, Cyy, Cxy, G

    def check(self, name, low, high):
        assert low > 0

    def stress(self, eps, Cxx, Cyy, Cxy, G):
        xx, yy, xy = eps[0, 0], eps[1, 1], eps[0, 1]
        return ufl.as_matrix([[Cxx * xx + Cxy * yy, 2 * G * xy], [2 * G * xy, Cxy * xx + Cyy * yy]])

    def compliance(self, sigma, Cxx, Cyy, Cxy, G):
        xx, yy, xy = sigma[0, 0], sigma[1, 1], sigma[0, 1]
        det = Cxx * Cyy - Cxy**2
        eps = [
            [(Cyy * xx - Cxy * yy) / det, xy / (2 * G)],
            [xy / (2 * G), (Cxx * yy - Cxy * xx) / det],
        ]
        return ufl.as_matrix(eps)

    def modulus(self, Cxx, Cyy, Cxy, G):
        return Cyy


@pytest.mark.serial
def test_material_of_the_user():
    """With isotropic moduli it gives what Elastic gives.

    With others it converges and the error goes down.
    """
    E, nu = 1.0, 0.3
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    base = common_block()

    def eps(material, n):
        scene = ec.Scene(material, base.supports, base.loads, base.contacts)
        # gamma is scaled by the modulus of the material
        method = ec.Nitsche(
            gamma=10.0 if isinstance(material, ec.Elastic) else 10.0 * E / (lam + 2 * G)
        )
        return certified(scene, block(n), method).relative

    same = Orthotropic(lam + 2 * G, lam + 2 * G, lam, G)
    assert eps(same, 8) == pytest.approx(eps(base.material, 8), rel=1e-9)
    stiff = Orthotropic(5.0, lambda x: 1.0 + 0.1 * x[0], 0.3, 0.5)
    assert eps(stiff, 16) < 0.8 * eps(stiff, 8)


NORMALS = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "bottom": (0.0, -1.0), "top": (0.0, 1.0)}


@pytest.mark.on_ranks("cells1-bottom top-2", "cells3-left right bottom top-1")
@pytest.mark.parametrize(
    ("cells", "sides", "degree"),
    [
        ((5, 1), "bottom top", 1),
        ((2, 1), "bottom top", 2),
        ((1, 1), "bottom left", 1),
        ((3, 3), "left right bottom top", 1),
        ((1, 1), "bottom", 2),
    ],
)
def test_contact_layer_that_is_the_whole_body(cells, sides, degree):
    """All unknowns belong to cells at a contact, and no support fixes any.

    Nothing is left to eliminate.
    """
    sides = sides.split()
    push = 0.01 * np.sum([NORMALS[side] for side in sides], axis=0)
    loads = [ec.BodyForce(tuple(push))] if push.any() else []
    contacts = [ec.Contact(side, friction=0.5, gap=-0.01) for side in sides]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [], loads, contacts)
    domain = ec.rectangle((0.0, 0.0), cells, cells=cells)
    solution = ec.solve(scene, domain, ec.AugmentedLagrangian(), degree=degree, solver="direct")
    error = ec.constitutive_error(ec.equilibrate(solution))
    forces = [error.force(side).force for side in sides]
    area = cells[0] * cells[1]
    assert np.sum(forces, axis=0) == pytest.approx(-area * push, abs=1e-12)
    assert 0 < error.relative < 1
