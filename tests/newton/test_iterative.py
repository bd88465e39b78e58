"""The iterative contact solve.

The same answer as the direct one, on any scene, in any units, on any ranks.

Properties: eps of both solvers agree to 1e-8 for both methods and degrees, all laws,
gaps and supports; a scene without a solution is refused by both; "auto" falls back
where multigrid fails; an adaptive run makes the same meshes.
"""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from bricks import NAMES, bricks
from dolfinx.fem.petsc import assemble_matrix
from domains import partly_broad
from mpi4py import MPI
from petsc4py import PETSc
from scenes import (
    block,
    common_block,
    greco,
    mostly_serial,
    moved_box,
    opening,
    random_scene,
)
from test_newton import Saturating, triangle

import erc_contact as ec
from erc_contact.model.promises import bind
from erc_contact.newton import solve
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear import amg, choice, factor_cost, krylov, multigrid
from erc_contact.newton.linear.stiffness import contact_layer

METHODS = {
    "Nitsche": ec.Nitsche(),
    "symmetric": ec.Nitsche(theta=1),
    "AL": ec.AugmentedLagrangian(),
}
SAME = 1e-8
"""Relative difference of eps between two solvers that counts as none [-]."""


def cube(comm: MPI.Comm = MPI.COMM_WORLD, n: int = 3) -> ec.Domain:
    return ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(n, n, n), comm=comm)


def pressed_cube(**contact: object) -> tuple[ec.Scene, ec.Domain]:
    """A cube pressed and sheared at its top."""
    top = ec.Displacement("top", (0.02, 0.01, -0.05))
    return ec.Scene(
        ec.Elastic(E=1.0, nu=0.3), [top], contacts=[ec.Contact("bottom", **contact)]
    ), cube()


def wedge() -> tuple[ec.Scene, ec.Domain]:
    """A square on two contacts that share a corner; nothing else holds it."""
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        loads=[ec.BodyForce((-0.001, -0.002))],
        contacts=[ec.Contact("bottom", friction=0.3), ec.Contact("left", friction=0.2)],
    )
    return scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(6, 6))


SCENES = {
    "block": lambda: (common_block(), block(4)),
    "held by the contact and a roller": lambda: (
        greco(),
        ec.rectangle((0.0, 0.0), (40.0, 40.0), cells=(8, 8)),
    ),
    "held by two contacts": wedge,
    "a support at nodes of the contact": lambda: (
        ec.Scene(
            ec.Elastic(E=1.0, nu=0.3),
            [
                ec.Displacement("top", (lambda x: 0.02 * x[0], -0.05)),
                ec.Displacement("left", (0.0, None)),
            ],
            contacts=[ec.Contact("bottom", friction=0.3, gap=0.02)],
        ),
        ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(6, 6)),
    ),
    "opening": lambda: (opening(0.3), ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(6, 6))),
    "nonlinear law": lambda: (
        opening(Saturating(0.3, 0.01)),
        ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(6, 6)),
    ),
    "cube": lambda: pressed_cube(friction=0.3),
    "cube on rollers": lambda: (
        ec.Scene(
            ec.Elastic(E=1.0, nu=0.3),
            [
                ec.Displacement("top", (0.0, None, -0.05)),
                ec.Displacement("left", (0.0, None, None)),
            ],
            contacts=[ec.Contact("bottom", friction=0.3)],
        ),
        cube(),
    ),
    "cube without friction": pressed_cube,
    "cube on a sphere": lambda: pressed_cube(
        friction=0.3, gap=lambda x: 0.1 * ((x[0] - 0.4) ** 2 + (x[1] - 0.5) ** 2)
    ),
    "cube glued by a bilateral contact": lambda: pressed_cube(
        friction=ec.Tresca(0.004), bilateral=True
    ),
}


def eps(solution: ec.Solution) -> float:
    return ec.constitutive_error(ec.equilibrate(solution)).relative


CASES = [
    (name, method)
    for name in SCENES
    for method in METHODS
    if method == "Nitsche"
    or name in ("opening", "cube")
    or (method == "AL" and name in ("nonlinear law", "held by two contacts", "cube on a sphere"))
]
BROADER = [
    *((name, "Nitsche") for name in ("block", "opening", "cube", "cube without friction")),
    *((name, "symmetric") for name in ("opening", "cube")),
    ("held by two contacts", "Nitsche"),
    ("cube", "AL"),
    ("nonlinear law", "AL"),
]


@pytest.mark.on_ranks("held by two contacts AL", "cube on a sphere Nitsche")
@pytest.mark.parametrize("case", partly_broad(CASES, BROADER), ids=" ".join)
def test_same_as_the_direct_solver(case):
    name, method = case
    scene, domain = SCENES[name]()
    direct, iterative = (
        ec.solve(scene, domain, METHODS[method], solver=s) for s in ("direct", "iterative")
    )
    assert eps(iterative) == pytest.approx(eps(direct), rel=SAME)


ON_A_SPHERE = [("cube on a sphere", "Nitsche"), ("cube on a sphere", "AL")]
DEGREE_2 = [("block", "AL"), ("a support at nodes of the contact", "Nitsche"), ON_A_SPHERE[1]]


@pytest.mark.on_ranks("cube on a sphere AL")
@pytest.mark.parametrize("case", mostly_serial(DEGREE_2, ON_A_SPHERE, DEGREE_2[1:2]), ids=" ".join)
def test_same_as_the_direct_solver_for_degree_2(case):
    name, method = case
    scene, domain = SCENES[name]()
    direct, iterative = (
        ec.solve(scene, domain, METHODS[method], degree=2, solver=s)
        for s in ("direct", "iterative")
    )
    assert eps(iterative) == pytest.approx(eps(direct), rel=SAME)


@pytest.mark.serial
@pytest.mark.parametrize(
    "seed", [*(pytest.param(seed, marks=pytest.mark.broad) for seed in (0, 2)), 3]
)
def test_same_on_random_scenes(seed):
    scene, domain = random_scene(seed)
    direct, iterative = (ec.solve(scene, domain, solver=s) for s in ("direct", "iterative"))
    assert eps(iterative) == pytest.approx(eps(direct), rel=SAME)


@pytest.mark.parametrize("method", ["Nitsche", pytest.param("symmetric", marks=pytest.mark.broad)])
def test_the_hierarchy_follows_the_tangent(method, monkeypatch):
    """A cycle equals a cycle with the matrices that PETSc computes anew with the same interpolation, on three levels."""
    monkeypatch.setitem(amg.OPTIONS, "pc_gamg_coarse_eq_limit", 20)
    scene, _ = pressed_cube(friction=0.3)
    model = bind(scene, cube(n=7), 1)
    elastic = multigrid.Multigrid(model)
    guess = elastic.solve_glued(elastic.load_vector())
    forms = ContactForms(model, METHODS[method])
    x, followed, anew = (elastic.matrix.createVecRight() for _ in range(3))
    x.array[:] = np.cos(np.arange(*x.getOwnershipRange()) ** 2)
    for stretch in (1.0, -1.0):  # pressed, and open
        forms.u.x.array[:] = stretch * guess.x.array
        tangent = assemble_matrix(forms.readers[0].tangents[0][0], bcs=model.bcs, diag=0.0)
        tangent.assemble()
        elastic.renew(tangent)
        elastic.cycle(x, followed)
    pc = elastic.hierarchy.pc
    assert pc.getMGLevels() > 2
    pc.setReusePreconditioner(False)
    pc.setOperators(elastic.hierarchy.matrix)
    pc.setUp()
    elastic.cycle(x, anew)
    followed.axpy(-1.0, anew)
    assert followed.norm() <= 1e-10 * anew.norm()


@pytest.mark.parametrize("below", ["factor", "multigrid"])
def test_cycles_at_degree_2(below, monkeypatch):
    """A coarse matrix of degree 1 that is wrong, or does not follow the contact, takes more cycles."""
    monkeypatch.setattr(factor_cost, "CHEAP_BELOW", np.inf if below == "factor" else 0.0)
    scene, _ = pressed_cube(friction=0.3)
    elastic = multigrid.Multigrid(bind(scene, cube(n=5), 2))
    cycles = []
    for share in (0.0, 1.0, 0.0):
        elastic.hierarchy.set_share(share)
        matrix = elastic.hierarchy.matrix
        x, b = matrix.createVecs()
        b.array[:] = np.cos(np.arange(*b.getOwnershipRange()) ** 2)
        ksp = PETSc.KSP().create(matrix.comm)
        ksp.setOperators(matrix)
        ksp.setPC(elastic.hierarchy.pc)
        ksp.setType("cg")
        ksp.setTolerances(rtol=1e-8)
        ksp.solve(b, x)
        assert ksp.getConvergedReason() > 0
        cycles.append(ksp.getIterationNumber())
    assert max(cycles) <= 15


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("scene", ["foundation", "two bodies"])
def test_blocks_multiply_as_entries_do(scene, d):
    """At degree 2 K is multiplied in blocks, and what contacts change beside it."""
    domain, contact = bricks(d, (2,) * (d - 1) + (1,)), ec.Contact(NAMES[0], friction=0.3)
    if scene == "two bodies":
        contact = replace(contact, against=NAMES[1])
    supports = []
    for part in ("upper outer", "lower outer"):
        supports.append(ec.Displacement(part, (0.0,) * (d - 1) + (-0.05,)))
    model = bind(ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=[contact]), domain, 2)
    elastic = multigrid.Multigrid(model)
    hierarchy = elastic.hierarchy
    # A factor of K sees the bodies apart.
    info = PETSc.Mat.InfoType.GLOBAL_SUM
    entries_alone = elastic.stiffness().getInfo(info)["nz_used"]
    assert elastic.matrix.getInfo(info)["nz_used"] == entries_alone
    for share in (0.0, 1.0, 0.5):
        hierarchy.set_share(share)
        entries = elastic.matrix.copy()
        x, expected = entries.createVecs()
        x.array[:] = np.cos(np.arange(*x.getOwnershipRange()) ** 2)
        product = expected.duplicate()
        elastic.times(x, product)
        glue = elastic.glue.matrix()
        glue.scale(share)
        glue.multAdd(x, product, product)
        entries.axpy(1.0, glue, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        diagonal = entries.getDiagonal()
        entries.mult(x, expected)
        for factor, found in ((1.0, product), (hierarchy.scale, hierarchy.matrix * x)):
            found.axpy(-factor, expected)
            assert found.norm() < 1e-13 * factor * expected.norm()
        found = hierarchy.matrix.getDiagonal()
        found.axpy(-hierarchy.scale, diagonal)
        assert found.norm() < 1e-14 * hierarchy.scale * diagonal.norm()


@pytest.mark.serial
def test_units_do_not_change_the_error():
    scene, domain = SCENES["cube on a sphere"]()
    found = []
    for E in (1e-9, 1.0, 1e12):
        material = ec.Elastic(E=E, nu=0.3)
        found.append(
            eps(
                ec.solve(
                    ec.Scene(material, scene.supports, contacts=scene.contacts),
                    domain,
                    solver="iterative",
                )
            )
        )
    assert found == pytest.approx([found[1]] * 3, rel=SAME)


@pytest.mark.broad
@pytest.mark.on_ranks("foundation-1", "two bodies-1")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", ["foundation", "two bodies"])
def test_units_of_length_and_stress(name, degree):
    """Rows of supports and pivots have the size of the matrix, whatever the units."""
    method = METHODS["Nitsche" if degree == 1 else "AL"]
    found = []
    for length, stress in ((1.0, 1.0), (1e9, 1e9), (1e-9, 1e-9)):
        if name == "foundation":
            high, cells = (length,) * 3, (3, 3, 3)
            domain = ec.box((0.0, 0.0, 0.0), high, cells=cells)
            law = ec.Contact("bottom", friction=0.3)
            push = {"top": (0.02 * length, 0.01 * length, -0.05 * length)}
        else:
            domain = bricks(3, (2, 2, 1), size=length)
            law = ec.Contact(NAMES[0], against=NAMES[1], friction=0.3)
            push = {"upper outer": (0.01 * length, 0.0, -0.05 * length), "lower outer": (0.0,) * 3}
        supports = [ec.Displacement(part, u) for part, u in push.items()]
        scene = ec.Scene(ec.Elastic(stress, 0.3), supports, contacts=[law])
        solution = ec.solve(scene, domain, method, degree=degree, solver="iterative")
        found.append(eps(solution))
    assert found == pytest.approx([found[0]] * 3, rel=SAME)


@pytest.mark.serial
def test_scene_without_contact():
    scene = ec.Scene(
        ec.Elastic(E=1.0, nu=0.3), [ec.Displacement("top", (0.0, 0.0))], [ec.BodyForce((0.1, -1.0))]
    )
    domain = ec.rectangle((0.0, 0.0), (1.0, 2.0), cells=(4, 8))
    direct, iterative = (ec.solve(scene, domain, solver=s) for s in ("direct", "iterative"))
    scale = abs(direct.u.x.array).max()
    assert abs(iterative.u.x.array - direct.u.x.array).max() < 1e-9 * scale


@pytest.mark.serial
def test_body_that_flies_away_is_refused():
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        loads=[ec.BodyForce((0.0, 0.001))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    with pytest.raises(ec.NotConverged):
        ec.solve(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4)), solver="iterative")


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("method", ["Nitsche", "AL"])
def test_many_solutions_are_reported(method):
    assert ec.solve(*triangle(2.0), METHODS[method], solver="iterative").singular
    assert not ec.solve(*triangle(1.9), METHODS[method], solver="iterative").singular


@pytest.mark.broad
def test_auto_falls_back_where_multigrid_fails(monkeypatch):
    scene, domain = SCENES["cube"]()
    expected = eps(ec.solve(scene, domain, solver="direct"))
    monkeypatch.setattr(choice, "MULTIGRID", {3: 1e-5})
    assert ec.solve(scene, domain).stiffness.iterative
    monkeypatch.setattr(krylov, "FGMRES_LIMIT", 1)
    with pytest.raises(ec.NotConverged, match="multigrid"):
        ec.solve(scene, domain, solver="iterative")
    solution = ec.solve(scene, domain)
    assert not solution.stiffness.iterative
    assert eps(solution) == pytest.approx(expected, rel=SAME)


@pytest.mark.parametrize(("nu", "iterative"), [(0.49, True), (0.4999, False)])
def test_auto_gives_multigrid_up_early_where_it_is_slow(nu, iterative, monkeypatch):
    """The first guess tells; no cycle of Newton's method is spent."""
    scene, domain = SCENES["cube"]()
    scene = replace(scene, material=ec.Elastic(1.0, nu))
    monkeypatch.setattr(choice, "MULTIGRID", {3: 1e-5})
    used = []
    cycle = multigrid.Multigrid.cycle
    monkeypatch.setattr(multigrid.Multigrid, "cycle", lambda *vectors: used.append(cycle(*vectors)))
    solution = ec.solve(scene, domain, degree=2)
    assert solution.stiffness.iterative == iterative
    assert bool(used) == iterative


@pytest.mark.broad
def test_multigrid_goes_on_where_the_direct_solver_would_take_for_ever(monkeypatch):
    """A slow first guess is worth patience there; assemblies of 93 000 cells had none."""
    scene, domain = SCENES["cube"]()
    scene = replace(scene, material=ec.Elastic(1.0, 0.4999))
    monkeypatch.setattr(choice, "MULTIGRID", {3: 1e-5})
    monkeypatch.setattr(solve, "STANDS_BY", 1.0)
    solution = ec.solve(scene, domain, degree=2)
    assert solution.stiffness.iterative


def layer(length):
    """A layer of thickness 1 on a foundation, which may slide; pressed and pulled a little."""
    domain = ec.rectangle((0.0, 0.0), (length, 1.0), cells=(int(length), 1))
    pull = ec.Traction("top", (lambda x: 0.01 * ufl.sin(x[0]), -1.0))
    return ec.Scene(
        ec.Elastic(100.0, 0.3), loads=[pull], contacts=[ec.Contact("bottom", friction=0.3)]
    ), domain


@pytest.mark.parametrize(("length", "iterative"), [(8.0, False), (500.0, True)])
def test_auto_takes_multigrid_for_long_contacts(length, iterative):
    model = bind(*layer(length), 2)
    assert choice.multigrid_is_faster(model) == iterative
    # No support fixes any of them.
    assert choice.layer_size(model) == len(contact_layer(model).numbers)


def test_slender_loose_bodies_are_rebalanced_by_few_iterations(monkeypatch):
    """Springs that hold the free motions carry no force, and are softer than no bending."""
    scene, domain = layer(40.0)
    direct, iterative = (
        ec.solve(scene, domain, degree=2, solver=solver) for solver in ("direct", "iterative")
    )
    monkeypatch.setattr(multigrid, "FACTOR_LIMIT", 2)
    assert eps(iterative) == pytest.approx(eps(direct), rel=SAME)


def test_rebalance_goes_on_with_a_factor_where_cycles_would_take_longer(monkeypatch):
    """The first cycles tell, and later solves try none."""
    scene, domain = SCENES["cube"]()
    solution = ec.solve(scene, domain, solver="iterative")
    for module in (krylov, multigrid):
        monkeypatch.setattr(module, "TRIAL", 6)
    monkeypatch.setattr(multigrid, "cycles_of_factor", lambda *_: 8.0)
    tried = []
    of_way = multigrid.Multigrid._iterate

    def iterate(self, matrix, way, *arguments):
        tried.append(way.name)
        return of_way(self, matrix, way, *arguments)

    monkeypatch.setattr(multigrid.Multigrid, "_iterate", iterate)
    eps(solution)
    assert tried == ["multigrid", "a factor"]
    tried.clear()
    eps(solution)
    assert tried == ["a factor"]


def test_rebalance_falls_back_where_multigrid_is_slow(monkeypatch):
    scene, domain = SCENES["cube"]()
    solution = ec.solve(scene, domain, solver="iterative")
    # A factor costs so much that cycles solve.
    monkeypatch.setattr(factor_cost, "OPERATIONS_OF_CYCLE", 1e-3)
    expected = eps(solution)
    # And now they fail.
    monkeypatch.setattr(multigrid, "CG_LIMIT", 8)
    assert eps(solution) == pytest.approx(expected, rel=SAME)


@pytest.mark.broad
@pytest.mark.serial
def test_adaptive_run_makes_the_same_meshes():
    scene, domain = SCENES["cube on a sphere"]()
    runs = [
        ec.adapt(scene, domain, accuracy=1e-6, max_steps=3, solver=s)
        for s in ("direct", "iterative")
    ]
    cells = [[step.cells for step in run.steps] for run in runs]
    assert cells[0] == cells[1]
    assert runs[1].steps[-1].eps == pytest.approx(runs[0].steps[-1].eps, rel=SAME)


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("degree", "method"),
    [(1, "Nitsche"), pytest.param(1, "AL", marks=pytest.mark.broad), (2, "AL")],
)
def test_rank_independence(degree, method):
    """A column of cubes, so that a rank has no facet of the contact."""
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        domain = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 4.0), cells=(2, 2, 8), comm=comm)
        top = ec.Displacement("top", (0.02, 0.01, -0.05))
        gap = {"friction": 0.3, "gap": lambda x: 0.02 * x[0] ** 2}
        scene = ec.Scene(ec.Elastic(E=1.0, nu=0.3), [top], contacts=[ec.Contact("bottom", **gap)])
        found.append(
            eps(ec.solve(scene, domain, METHODS[method], degree=degree, solver="iterative"))
        )
    assert found[0] == pytest.approx(found[1], rel=SAME)


@pytest.mark.ranks
@pytest.mark.parametrize(("d", "degree"), [(2, 2), (3, 1)])
def test_nearly_incompressible_bodies_on_ranks(d, degree):
    """Where three ranks meet, their sweeps together go more than twice as far as one matrix allows."""
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        make, cells = {2: (ec.rectangle, (5, 4)), 3: (ec.box, (4, 4, 4))}[d]
        domain = make((0.0,) * d, (1.0,) * d, cells=cells, comm=comm)
        scene = replace(moved_box(d, 0.02, 0.05)[0], material=ec.Elastic(1.0, 0.49))
        found.append(eps(ec.solve(scene, domain, METHODS["AL"], degree=degree, solver="iterative")))
    assert found[0] == pytest.approx(found[1], rel=SAME)


def test_bad_solver_is_refused():
    scene, domain = SCENES["block"]()
    with pytest.raises(
        ec.InputError, match="solver is 'multigrid'; allowed are 'auto', 'direct', 'iterative'"
    ):
        ec.solve(scene, domain, solver="multigrid")


def failing_stage(elastic):
    """Make the factor, and fail."""
    with elastic.in_memory():
        elastic.solve(elastic.load_vector())
        assert elastic.factorised
        raise KeyError("stage")


@pytest.mark.parametrize("solver", ["direct", "iterative"])
def test_the_factor_lives_in_the_block_of_its_owner(solver):
    """The contact solve leaves it, the outermost block frees it, and a later stage makes it again."""
    solution = ec.solve(*pressed_cube(friction=0.3), solver=solver)
    elastic = solution.stiffness
    assert solution.factorised
    with elastic.in_memory():
        with elastic.in_memory():
            assert solution.factorised
        assert solution.factorised
    assert not solution.factorised
    with pytest.raises(KeyError, match="stage"):
        failing_stage(elastic)
    assert not solution.factorised
    pair = ec.equilibrate(solution)
    assert not solution.factorised
    assert ec.coulomb_certificate(ec.constitutive_error(pair)).bound < np.inf
    assert not solution.factorised
