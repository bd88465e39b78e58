"""The condensed contact solve.

It is the whole body's, whatever the method, the law, the start and the stop.

- the residual of the whole body vanishes, interior nodes included, for every method, in
  2D and 3D, on all ranks;
- GRECO: both methods within 20 Newton steps on all meshes, and the same answer;
- many solutions are reported: the triangle with a continuum of them has a singular
  tangent, its neighbours do not;
- Newton that cycles is stopped; Newton that may stop early is as near as it says;
- Tresca friction and bilateral contact against a published norm; a law of the user's
  own against its limits;
- foundations whose normal comes from their gap.
"""

from itertools import product

import numpy as np
import pytest
import ufl
from dolfinx import fem, la
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import block, common_block, greco, prototype_block, random_scene, resultant

import erc_contact as ec
from erc_contact.model.model import Model
from erc_contact.newton import first_guess as start
from erc_contact.newton.condensed import Condensed
from erc_contact.newton.dense import Dense
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.ladder import Attempt
from erc_contact.newton.linear.stiffness import Stiffness

COMM = MPI.COMM_WORLD
METHODS = [ec.Nitsche(), ec.Nitsche(theta=-1), ec.AugmentedLagrangian()]


def whole_residual(solution: ec.Solution) -> float:
    """Largest nodal force out of balance in the whole body, over the largest internal one."""
    model, u, v = solution.model, solution.u, ufl.TestFunction(solution.model.space.V)
    inner = model.stiffness(u, v)
    residual = inner - (model.loads(v) or 0)
    for k, contact in enumerate(model.contacts):
        if solution.method.multiplier:
            residual -= ufl.inner(solution.multipliers[k], v) * contact.ds(
                metadata=solution.model.space.nodal_rule
            )
        else:
            residual += solution.method.equations(model, contact, u, v)
    sizes = []
    for form in (residual, inner):
        force = fem.Function(model.space.V)
        fem.assemble_vector(force.x.array, fem.form(form))
        force.x.scatter_reverse(la.InsertMode.add)
        force.x.array[model.fixed.ravel()] = 0.0
        owned = model.space.V.dofmap.index_map.size_local * model.space.d
        sizes.append(COMM.allreduce(float(abs(force.x.array[:owned]).max(initial=0.0)), MPI.MAX))
    return sizes[0] / sizes[1]


@pytest.mark.on_ranks("2-Nitsche(theta=-1, gamma=10.0)", "3-AugmentedLagrangian(gamma=1.0)")
@pytest.mark.parametrize(
    ("seed", "method"),
    # The variants of Nitsche's method differ by terms that know no dimension.
    [*product((0, 2), METHODS), (3, METHODS[0]), (3, METHODS[2])],
    ids=str,
)
def test_whole_body_is_in_equilibrium(seed, method):
    assert whole_residual(ec.solve(*random_scene(seed), method)) < 1e-9


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_body_that_only_contact_holds(method):
    solution = ec.solve(greco(), ec.rectangle((0.0, 0.0), (40.0, 40.0), cells=(16, 16)), method)
    assert whole_residual(solution) < 1e-9


@pytest.mark.serial
@pytest.mark.parametrize("n", [16, 64, 128])
@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()], ids=str)
def test_greco_takes_few_steps(n, method):
    solution = ec.solve(greco(), ec.rectangle((0.0, 0.0), (40.0, 40.0), cells=(n, n)), method)
    assert 0 < solution.newton_steps <= 20


@pytest.mark.broad
@pytest.mark.serial
def test_parameters_change_little():
    eps = []
    for method in (ec.Nitsche(gamma=g) for g in (1.0, 10.0, 100.0, 1000.0)):
        eps.append(
            ec.constitutive_error(
                ec.equilibrate(ec.solve(common_block(), block(16), method))
            ).relative
        )
    assert max(eps) < 1.1 * min(eps)
    u = [
        ec.solve(common_block(), block(16), ec.AugmentedLagrangian(g)).u.x.array
        for g in (0.1, 1.0, 100.0)
    ]
    assert max(abs(v - u[0]).max(initial=0.0) for v in u) < 1e-9


def test_augmented_lagrangian_keeps_the_conditions_at_the_nodes():
    solution = ec.solve(common_block(), block(16), ec.AugmentedLagrangian())
    model, contact = solution.model, solution.model.contacts[0]
    nodes = model.space.facet_nodes(contact.facets)
    u = solution.u.x.array.reshape(-1, 2)[nodes]
    r = solution.multipliers[0].x.array.reshape(-1, 2)[nodes]
    size = COMM.allreduce(abs(r).max(initial=0.0), MPI.MAX)
    length = COMM.allreduce(abs(u).max(initial=0.0), MPI.MAX)
    assert (-u[..., 1]).max(initial=0.0) <= 1e-12 * length  # the normal of the foundation is -y
    assert (-r[..., 1]).max(initial=0.0) <= 1e-10 * size
    assert (abs(r[..., 0]) - 0.3 * r[..., 1]).max(initial=0.0) <= 1e-10 * size
    assert abs(u[..., 1] * r[..., 1]).max(initial=0.0) <= 1e-10 * size * length
    assert (u[..., 0] * r[..., 0]).max(
        initial=0.0
    ) <= 1e-10 * size * length  # friction opposes the slip


def test_multiplier_where_a_support_fixes_the_node():
    """The end node is fixed in both directions.

    Its multiplier is its neighbour's, and the forces balance.
    """
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("left", (0.0, 0.0))],
        loads=[ec.Traction("top", (0.0, -0.02))],
        contacts=[ec.Contact("bottom", friction=0.4)],
    )
    solution = ec.solve(
        scene, ec.rectangle((0.0, 0.0), (1.0, 0.5), cells=(8, 4)), ec.AugmentedLagrangian()
    )
    assert whole_residual(solution) < 1e-10
    other = ec.solve(scene, solution.domain)
    forces = [resultant(ec.equilibrate(s).tractions[0]) for s in (solution, other)]
    assert forces[0] == pytest.approx(forces[1], rel=0.15)


# -- many solutions, cycles, early stops
# --------------------------------------------------------------------------


def triangle(friction: float) -> tuple[ec.Scene, ec.Domain]:
    """At friction 2 every u = (0.1 + 0.533333 y + a (x - 4 y/3), -0.1 y), a in [-0.1, 0.4], solves it."""
    import basix.ufl

    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.4, 0.3]])
    cells = np.array([[0, 1, 2]]) if COMM.rank == 0 else np.zeros((0, 3), dtype=np.int64)
    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))
    mesh = dmesh.create_mesh(COMM, cells, element, corners if COMM.rank == 0 else corners[:0])
    sides = [
        lambda x: x[1] < 1e-9,
        lambda x: abs(0.4 * x[1] - 0.3 * x[0]) < 1e-9,
        lambda x: x[0] > 0.4 - 1e-9,
    ]
    found = [dmesh.locate_entities_boundary(mesh, 1, side) for side in sides]
    facets = np.concatenate(found).astype(np.int32)
    values = np.repeat(np.arange(1, 4, dtype=np.int32), [len(f) for f in found])
    order = np.argsort(facets)
    tags = dmesh.meshtags(mesh, 1, facets[order], values[order])
    domain = ec.Domain(mesh, tags, {"foot": 1, "held": 2, "pushed": 3})
    scene = ec.Scene(
        material=ec.Elastic(E=1.2, nu=0.2),
        supports=[
            ec.Displacement("held", (lambda x: 0.1 + 0.533333 * x[1], lambda x: -0.1 * x[1]))
        ],
        loads=[ec.Traction("pushed", (0.2236068, 0.0))],
        contacts=[ec.Contact("foot", friction=friction)],
    )
    return scene, domain.refined()


@pytest.mark.on_ranks("AugmentedLagrangian(gamma=1.0)")
@pytest.mark.parametrize(
    "method",
    [pytest.param(ec.Nitsche(), marks=pytest.mark.broad), ec.AugmentedLagrangian()],
    ids=str,
)
def test_continuum_of_solutions_is_reported(method, caplog):
    many = ec.solve(*triangle(2.0), method)
    assert many.singular
    assert "one of many" in many.reason
    assert COMM.rank != 0 or "one of many" in caplog.text
    assert (
        ec.constitutive_error(ec.equilibrate(many)).relative < 1e-5
    )  # each of them solves the problem
    for friction in (1.9, 2.1):
        one = ec.solve(*triangle(friction), method)
        assert not one.singular
        assert one.least_singular_value > 1e-6
    u = ec.solve(*triangle(1.9), method).u.x.array.reshape(-1, 2)
    x = many.model.space.V.tabulate_dof_coordinates()
    exact = 0.1 + 0.533333 * x[:, 1] + 0.4 * (x[:, 0] - 4 * x[:, 1] / 3), -0.1 * x[:, 1]
    assert abs(u - np.column_stack(exact)).max(initial=0.0) < 1e-5


def attempt(scene, domain, method, line_search, accuracy=None):
    """One attempt of Newton from the glued contact."""
    model = Model(scene, domain)
    stiffness = Stiffness(model)
    w = stiffness.solve_glued(stiffness.load_vector())
    problem = Condensed(model, ContactForms(model, method), stiffness, w)
    glued = start.solve_glued(model, stiffness, w)
    step = Attempt(method, "glued", line_search)
    return problem.run(lambda: Dense(problem, accuracy).solve(problem.from_contact(glued), step)[1])


@pytest.mark.serial
def test_a_body_of_one_row_of_cells():
    """Nearly all of its equations belong to the contact: MUMPS has little to eliminate."""
    layer = ec.rectangle((0.0, 0.0), (1.0, 0.1), cells=(40, 1))
    law = ec.Contact("bottom", friction=ec.Tresca(0.01))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), loads=[ec.Traction("top", (0.0, -0.02))], contacts=law)
    layers = [ec.solve(scene, layer, solver=solver) for solver in ("direct", "iterative")]
    heights = [solution.u.x.array[1::2] for solution in layers]
    assert heights[0] == pytest.approx(heights[1], abs=1e-6 * abs(heights[0]).max())


@pytest.mark.broad
@pytest.mark.serial
def test_cycle_is_seen():
    outcome = attempt(common_block(), block(64), ec.Nitsche(gamma=100.0), "basic")
    assert not outcome.converged
    assert "cycle" in outcome.reason
    assert outcome.steps < 40
    assert attempt(common_block(), block(64), ec.Nitsche(gamma=100.0), "bisection").converged


@pytest.mark.serial
def test_certified_stop_is_as_near_as_it_says():
    """What Newton leaves, by the proxy of the solver, against the estimator itself.

    e^2 = e_converged^2 + rest^2.
    """
    converged = ec.solve(common_block(), block(16))
    full = ec.constitutive_error(ec.equilibrate(converged)).absolute
    rests = []
    for share in (1.0, 0.3, 0.1):
        early = ec.solve(common_block(), block(16), tolerance=share * full)
        assert early.distance <= share * full
        assert converged.newton_steps >= early.newton_steps
        e = ec.constitutive_error(ec.equilibrate(early)).absolute
        assert abs(e**2 - full**2) <= 4 * (share * full) ** 2
        rests.append(early.distance)
    assert converged.distance < 1e-6 * full < rests[0]


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(("tighten", "accuracy", "share"), [(0, 0.04, 0.6), (10, 0.015, 0.75)])
def test_adaptive_run_saves_steps(tighten, accuracy, share):
    """The tightened error is a third of the loose one.

    Its meshes are coarser, and Newton goes further on each.
    """
    plain, domain = 0, block(4)
    runs = {
        stop: ec.adapt(common_block(), domain, accuracy, stop=stop, tighten=tighten)
        for stop in ("converged", "certified")
    }
    for mesh, _ in runs["converged"].meshes:
        plain += ec.solve(common_block(), mesh).newton_steps
    assert runs["certified"].column("newton_steps").sum() <= share * plain
    converged, certified = (run.steps[-1].eps * run.steps[-1].cells ** 0.5 for run in runs.values())
    assert certified == pytest.approx(
        converged, rel=0.02
    )  # eps falls like cells^(-1/2); one run may have a mesh less


def test_warm_start_of_a_refined_mesh_is_exact_at_old_nodes():
    old = ec.solve(common_block(), block(8))
    given, itself = (
        Stiffness(model).gather(start.from_mesh(old.model, old.u, model))
        for model in (Model(common_block(), old.domain.refined()), old.model)
    )
    if COMM.rank == 0:
        assert np.count_nonzero(given) > np.count_nonzero(itself) > 0
        assert np.isin(np.round(itself, 10), np.round(given, 10)).all()


# -- laws and foundations
# -----------------------------------------------------------------------------------------


def tresca_square() -> ec.Scene:
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("left", (0.0, 0.0))],
        contacts=[ec.Contact("right", friction=ec.Tresca(0.02), gap=-0.1, bilateral=True)],
    )


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(
    ("method", "degree", "accuracy", "tighten"),
    [(ec.Nitsche(), 2, 0.002, 10), (ec.AugmentedLagrangian(), 1, 0.02, 0)],
    ids=str,
)
def test_bilateral_tresca_square(method, degree, accuracy, tighten):
    """Its H1 norm tends to 0.125386 (published computation)."""
    square = ec.rectangle((0.0, -0.5), (1.0, 0.5), cells=(4, 4))
    history = ec.adapt(
        tresca_square(), square, accuracy, method=method, degree=degree, tighten=tighten
    )
    solution = history.best.admissible.solution
    u = solution.u
    square = fem.assemble_scalar(
        fem.form((ufl.inner(u, u) + ufl.inner(ufl.grad(u), ufl.grad(u))) * ufl.dx)
    )
    norm = np.sqrt(COMM.allreduce(square))
    print(norm, len(history.meshes), solution.domain.cells)
    assert norm == pytest.approx(0.125386, abs=5e-5)
    traction = history.best.admissible.tractions[0]
    own = traction.contact.facets[:, 0] < solution.domain.owned_cells
    assert np.linalg.norm(traction.tangential_part[own], axis=-1).max(initial=0.0) <= 0.02 * (
        1 + 1e-12
    )


class Saturating:
    """Friction mu p that never exceeds a limit."""

    parameters = ("mu", "limit")

    def __init__(self, mu, limit):
        self.mu, self.limit = mu, limit

    def friction_bound(self, pressure, mu, limit):
        return limit * ufl.tanh(mu * pressure / limit)


def with_friction(friction) -> ec.Scene:
    base = prototype_block()
    return ec.Scene(
        base.material,
        [ec.Displacement("top", (0.1, -0.05))],
        (),
        [ec.Contact("bottom", friction=friction)],
    )


@pytest.mark.serial
@pytest.mark.parametrize(
    "method",
    [pytest.param(ec.Nitsche(), marks=pytest.mark.broad), ec.AugmentedLagrangian()],
    ids=str,
)
def test_law_of_the_user(method):
    """Between Coulomb (a high limit) and Tresca (high friction).

    Its traction is allowed, its error goes down.
    """

    def force(friction):
        pair = ec.equilibrate(ec.solve(with_friction(friction), block(8), method))
        return resultant(pair.tractions[0])

    assert force(Saturating(0.3, 1e6)) == pytest.approx(force(0.3), rel=1e-6)
    scene = with_friction(Saturating(0.3, 0.0008))
    weak = resultant(ec.equilibrate(ec.solve(scene, block(8), method)).tractions[0])
    assert abs(weak[0]) < 0.8 * abs(force(0.3)[0])
    errors = []
    for n in (8, 16):
        pair = ec.equilibrate(ec.solve(scene, block(n), method))
        t = pair.tractions[0]
        size = np.linalg.norm(t.tangential_part, axis=-1)
        assert (size - 0.0008 * np.tanh(0.3 * abs(t.normal_component) / 0.0008)).max(
            initial=0.0
        ) <= 1e-14
        errors.append(ec.constitutive_error(pair).relative)
    assert errors[1] < 0.75 * errors[0]


@pytest.mark.broad
@pytest.mark.serial
def test_normal_from_the_gap():
    """A tilted plane given by its distance is the plane given by its normal.

    A cylinder turns its normals.
    """
    n = np.array([0.2, -1.0]) / np.hypot(0.2, 1.0)
    plane = lambda x: 0.001 - (n[0] * x[0] + n[1] * x[1])  # noqa: E731
    results = []
    for contact in (
        ec.Contact("bottom", friction=0.3, gap=plane, normal="gap"),
        ec.Contact("bottom", friction=0.3, gap=plane, normal=tuple(n)),
        ec.Contact(
            "bottom",
            friction=0.3,
            gap=plane,
            normal=lambda x: ufl.as_vector([0.2 * (1 + 0 * x[0]), -1.0]),
        ),
    ):
        scene = ec.Scene(ec.Elastic(1.0, 0.3), [ec.Displacement("top", (0.0, -0.1))], [], [contact])
        solution = ec.solve(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(8, 8)))
        results.append(ec.constitutive_error(ec.equilibrate(solution)).relative)
    assert results[1:] == pytest.approx([results[0]] * 2, rel=1e-10)


@pytest.mark.broad
@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, 3])
def test_foundation_with_turning_normals(d):
    """A cylinder or sphere of radius 2 by its distance: normals point to its middle.

    r^ along them; error goes down.
    """
    centre = [0.5, -2.0] if d == 2 else [0.5, 0.5, -2.0]
    distance = lambda x: ufl.sqrt(sum((x[i] - centre[i]) ** 2 for i in range(d))) - 2.0  # noqa: E731
    push = [0.0] * (d - 1) + [-0.1]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", push)],
        [],
        [ec.Contact("bottom", gap=distance, normal="gap")],
    )
    errors = []
    for n in (4, 8):
        make = ec.rectangle if d == 2 else ec.box
        pair = ec.equilibrate(ec.solve(scene, make((0.0,) * d, (1.0,) * d, cells=(n,) * d)))
        t = pair.tractions[0]
        x = pair.solution.model.space.V.tabulate_dof_coordinates()[t.nodes].mean(axis=1)[:, :d]
        inward = (np.array(centre) - x) / np.linalg.norm(np.array(centre) - x, axis=1)[:, None]
        assert np.allclose(t.contact.direction, inward, atol=0.03)
        assert np.abs(t.tangential_part).max(initial=0.0) <= 1e-15
        points = np.linalg.norm(pair.displacement.x.array.reshape(-1, d)[t.nodes], axis=-1)
        assert points.max(initial=0.0) > 0 or len(points) == 0
        errors.append(ec.constitutive_error(pair).relative)
    assert errors[1] < (0.75 if d == 2 else 0.85) * errors[0]


def test_integral_of_the_traction_balances_the_load():
    """Sign: what the foundation pushes is what the load presses, for both methods (a flipped sign would fail)."""
    for method in (ec.Nitsche(), ec.AugmentedLagrangian()):
        solution = ec.solve(greco(), ec.rectangle((0.0, 0.0), (40.0, 40.0), cells=(8, 8)), method)
        contact = solution.model.contacts[0]
        ds = contact.ds(metadata={"quadrature_degree": solution.model.space.contact_degree})
        pressure = solution.traction(contact)[1] * ds
        assert COMM.allreduce(fem.assemble_scalar(fem.form(pressure))) == pytest.approx(
            2000.0, rel=1e-9
        )
