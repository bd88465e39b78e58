"""Points where three and four bodies meet: known solutions, supports, certified errors.

Properties: a homogeneous stress under which all contacts of the point slip is found and
certified to round-off by both methods, whichever body a contact names first, and so is
one of two bodies beside each other on a foundation; rows of groups are told apart by the
components that supports leave free; the error falls with the mesh; a soft body gets no
force that stiff ones leave.
"""

from dataclasses import replace

import numpy as np
import pytest
from attack_families import scene_generator
from bricks import joint
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import certified
from test_two_bodies import vector
from two_bodies import random_joint

import erc_contact as ec
from erc_contact.model.contact.groups import Groups
from erc_contact.model.contact.trace import NOBODY
from namedmesh.tags import tags_of

COMM = MPI.COMM_WORLD
METHODS = (ec.Nitsche(), ec.AugmentedLagrangian())
NU = {"a": 0.2, "b": 0.3, "c": 0.25, "d": 0.1}
SHEAR_MODULUS = 400.0
PRESSURE, SIDE, SHEAR = 10.0, 8.0, 3.0
"""The stress has the components -PRESSURE, -SIDE along x, and SHEAR."""


def material(count: int) -> ec.Elastic:
    """Bodies of the same shear modulus with different ratios of Poisson."""
    nu = {body: NU[body] for body in "abcd"[:count]}
    return ec.Elastic({body: 2 * SHEAR_MODULUS * (1 + ratio) for body, ratio in nu.items()}, nu)


def contacts(order: str, friction: dict[str, float]) -> list[ec.Contact]:
    """A contact of each pair, with the friction of its first letters."""
    result = []
    for pair in order.split():
        mu = friction.get("".join(sorted(pair)), 0.0)
        result.append(ec.Contact(pair, against=pair[::-1], friction=mu))
    return result


def rollers(d: int) -> list[ec.Displacement]:
    """Supports of the front and the back, in 3D."""
    names = ("front", "back") if d == 3 else ()
    return [ec.Displacement(name, (None, 0.0, None)) for name in names]


SLIP = 0.02


def slipping(d: int, order: str) -> tuple[ec.Scene, dict]:
    """Three bodies in one stress that slip at all contacts, and u of each body.

    All have the same shear modulus, so that contacts stay closed while they slip.
    """
    exact = {}
    for body in "abc":
        mean = NU[body] * (PRESSURE + SIDE)
        eps_x = (mean - SIDE) / (2 * SHEAR_MODULUS)
        eps_y = (mean - PRESSURE) / (2 * SHEAR_MODULUS)
        move = 0.0 if body == "c" else SLIP

        def u(x, eps_x=eps_x, eps_y=eps_y, move=move):
            y = x[d - 1] - 1
            return eps_x * (x[0] - 1) + SHEAR / SHEAR_MODULUS * y + move, eps_y * y

        exact[body] = u
    supports = []
    for part, body in (("bottom", "c"), ("top of a", "a"), ("top", "b")):
        of_body = exact[body]
        along = lambda x, u=of_body: u(x)[0]  # noqa: E731
        across = lambda x, u=of_body: u(x)[1]  # noqa: E731
        supports.append(ec.Displacement(part, vector(d, along, across)))
    friction = {"ab": SHEAR / SIDE, "ac": SHEAR / PRESSURE, "bc": SHEAR / PRESSURE}
    loads = [
        ec.Traction("left", vector(d, SIDE, -SHEAR)),
        ec.Traction("right", vector(d, -SIDE, SHEAR)),
    ]
    return ec.Scene(material(3), supports + rollers(d), loads, contacts(order, friction)), exact


def distance(solution: ec.Solution, exact: dict) -> float:
    """Largest difference of u from the exact one of its body, over the slip; collective."""
    space = solution.model.space
    x = space.V.tabulate_dof_coordinates()
    u = solution.u.x.array.reshape(-1, space.d)
    worst = 0.0
    for body, of_body in exact.items():
        nodes = np.unique(space.nodes[space.domain.region(body)])
        along, across = of_body(x[nodes].T)
        difference = np.column_stack([u[nodes, 0] - along, u[nodes, -1] - across])
        worst = max(worst, abs(difference).max(initial=0.0))
    return COMM.allreduce(worst, MPI.MAX) / SLIP


# -- solutions
# ---------------------------------------------------------------------------------------------------


@pytest.mark.broad
@pytest.mark.on_ranks("2-2-ba ac cb", "3-1-ca ba cb")
@pytest.mark.parametrize(
    ("d", "degree", "order"),
    [(2, 2, "ba ac cb"), (2, 1, "ab bc ca"), (3, 1, "ca ba cb")],
)
def test_slip_at_all_contacts(d, degree, order):
    """Both methods and solvers find the solution, and it has no error."""
    scene, exact = slipping(d, order)
    for method in METHODS:
        for solver in ("direct", "iterative"):
            solution = ec.solve(scene, joint(d), method, degree=degree, solver=solver)
            assert solution.method == method
            assert distance(solution, exact) < 1e-8, solver
            if solver == "direct":
                assert ec.constitutive_error(ec.equilibrate(solution)).relative < 1e-9


@pytest.mark.serial
def test_round_off_of_jumps_is_no_error():
    """Displacements have it, and e^2 is of first order in a jump: e was 6e-9."""
    scene, _ = slipping(3, "ca ba cb")
    solution = ec.solve(scene, joint(3), ec.AugmentedLagrangian(), degree=2)
    assert ec.constitutive_error(ec.equilibrate(solution)).relative < 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_four_bodies_and_orders_that_mix(method):
    """A pressure without friction is exact, whichever bodies the contacts name first."""
    loads = [ec.Traction(name, (0.0, -PRESSURE)) for name in ("top", "top of a")]
    loads.append(ec.Traction("left", (SIDE, 0.0)))
    supports = [ec.Displacement("bottom", (None, 0.0)), ec.Displacement("right", (0.0, None))]
    scene = ec.Scene(material(4), supports, loads, contacts("ba ac bd dc", {}))
    error = certified(scene, joint(2, 4), method)
    assert error.relative < 1e-9


@pytest.mark.broad
@pytest.mark.parametrize("degree", [1, 2])
def test_bodies_beside_each_other_on_a_foundation(degree):
    """The foundation acts on the jump and on the displacement of the other body, too."""
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    cells = block.mesh.topology.index_map(2)
    numbers = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    x = dmesh.compute_midpoints(block.mesh, 2, numbers)
    body = tags_of(block.mesh, 2, numbers, np.where(x[:, 0] < 1, 1, 2).astype(np.int32))
    whole = ec.Domain(block.mesh, block.facet_tags, block.names, body, {"a": 1, "b": 2})
    bodies = whole.split({"ab": "a", "ba": "b"})
    held = [ec.Displacement("left", (0.0, None))]
    loads = [ec.Traction("top", (0.0, -PRESSURE)), ec.Traction("right", (-SIDE, 0.0))]
    for solver in ("direct", "iterative"):
        for names in (("ab", "ba"), ("ba", "ab")):
            solutions = []
            for mu in (0.0, 0.2):
                pair = ec.Contact(names[0], against=names[1], friction=0.3)
                floor = ec.Contact("bottom", friction=mu)
                scene = ec.Scene(ec.Elastic(1000.0, 0.3), held, loads, [floor, pair])
                method = ec.AugmentedLagrangian()
                solutions.append(ec.solve(scene, bodies, method, degree=degree, solver=solver))
            without, rubbing = solutions
            if solver == "direct":
                assert ec.constitutive_error(ec.equilibrate(without)).relative < 1e-9
            forces = rubbing.reactions()
            assert forces["bottom"].force[1] == pytest.approx(2 * PRESSURE, rel=1e-8)
            assert abs(forces["ab"].force + forces["ba"].force).max() < 1e-8


def test_soft_body_between_stiff_ones():
    """The multipliers of a joint do not depend on names, and a soft body has its own.

    Where all reactions were shared alike e would be four times as large.
    """
    case = random_joint(scene_generator(2, 57))
    nitsche = certified(case.scene, case.domain, degree=2)
    forces = []
    for exchange in (False, True):
        contacts = []
        for contact in case.scene.contacts:
            names = (contact.facets, contact.against)
            first, second = names[::-1] if exchange else names
            contacts.append(replace(contact, facets=first, against=second))
        scene = replace(case.scene, contacts=contacts[::-1] if exchange else contacts)
        solution = ec.solve(scene, case.domain, ec.AugmentedLagrangian(), degree=2)
        forces.append([solution.force(pair).force for pair in ("ab", "ac", "bc")])
    error = ec.constitutive_error(ec.equilibrate(solution))
    assert error.relative < 1.1 * nitsche.relative
    size = abs(np.array(forces)).max()
    assert forces[1] == pytest.approx(np.array(forces[0]), abs=1e-8 * size)


def pushed(friction: float, **options: object) -> ec.Scene:
    """Bodies a and b, pressed on c and pushed to the right."""
    supports = [ec.Displacement("bottom", (None, 0.0)), ec.Displacement("top", (None, -0.03))]
    supports.append(ec.Displacement("right", (0.0, None)))
    loads = [ec.Traction("left", (SIDE, 0.0)), ec.Traction("top of a", (0.0, -PRESSURE))]
    law = {"ab": friction, "ac": friction, "bc": friction}
    return ec.Scene(material(3), supports, loads, contacts("ab ac bc", law), **options)


@pytest.mark.broad
@pytest.mark.serial
def test_error_falls_and_solvers_agree():
    """Half the size of cells takes nearly half of e; pushing a takes b along."""
    scene = pushed(0.4)
    errors = []
    for cells in (4, 8, 16):
        solutions = [
            ec.solve(scene, joint(2, cells=cells), solver=solver)
            for solver in ("direct", "iterative")
        ]
        direct, iterative = (ec.constitutive_error(ec.equilibrate(u)) for u in solutions)
        assert iterative.relative == pytest.approx(direct.relative, rel=1e-6)
        errors.append(direct)
    assert errors[2].absolute < 0.45 * errors[0].absolute
    forces = errors[2].solution.reactions()
    for pair in ("ab", "ac", "bc"):
        size = np.linalg.norm(forces[pair].force)
        total = forces[pair].force + forces[pair[::-1]].force
        assert np.linalg.norm(total) < 1e-9 * size
    assert forces["ba"].force[0] > 0
    certificate = ec.certify(scene, errors[2].domain, errors[2].solution.u)
    # Its tractions come from the reactions: they are better, here.
    assert 0.8 < certificate.error.relative / errors[2].relative < 1.01


@pytest.mark.broad
@pytest.mark.serial
def test_histories_of_proportional_loads_are_one_step():
    """Without gaps the solution grows with the loads, whatever the steps."""
    whole = pushed(0.4)

    def scene_at(t):
        top = ec.Displacement("top", (None, -0.03 * t))
        supports = [support for support in whole.supports if support.facets != "top"]
        loads = [
            ec.Traction("left", (SIDE * t, 0.0)),
            ec.Traction("top of a", (0.0, -PRESSURE * t)),
        ]
        return replace(whole, supports=[*supports, top], loads=loads)

    evolution = ec.evolve(scene_at, joint(2), [0.25, 1.0], accuracy=1.0)
    at_once = ec.solve(whole, joint(2), ec.AugmentedLagrangian())
    assert evolution.solution.method == at_once.method
    size = np.linalg.norm(at_once.force("ac").force)
    for name in ("ab", "ac", "bc"):
        force = evolution.solution.force(name).force
        assert force == pytest.approx(at_once.force(name).force, abs=3e-3 * size)


# -- unknowns
# ---------------------------------------------------------------------------------------------------


@pytest.mark.broad
def test_order_of_contacts_changes_nothing():
    """Contacts of a common node are set one after the other, whatever the order of the scene."""
    left = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(2, 2))
    right = ec.rectangle((1.0, 0.0), (2.0, 1.0), cells=(3, 2))
    above = ec.rectangle((0.4, 1.0), (1.6, 2.0), cells=(3, 2))
    bodies = ec.assembly({"left": left, "right": right, "above": above})
    bodies = bodies.joined("left right", "right left").joined("above bottom", "left top")
    bodies = bodies.joined("above bottom outside", "right top")
    contacts = [ec.Contact(one, against=other, friction=0.8) for one, other in bodies.pairs]
    contacts += [ec.Contact("left bottom"), ec.Contact("right bottom")]
    scene = ec.Scene(
        ec.Elastic({"left": 1.0, "right": 1.0, "above": 3.0}, 0.3),
        ec.Displacement("above top", (0.004, -0.02)),
        ec.BodyForce((0.0, -0.003)),
        contacts,
        springs=[ec.Spring("left left", normal=0.3), ec.Spring("right right", normal=0.3)],
    )
    eps = []
    for ordered in (contacts, contacts[::-1], [*contacts[1:], contacts[0]]):
        solution = ec.solve(replace(scene, contacts=ordered), bodies, ec.Nitsche())
        eps.append(ec.constitutive_error(ec.equilibrate(solution)).relative)
    assert eps[1:] == pytest.approx([eps[0]] * 2, rel=1e-10)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_rows_of_a_group_with_supports(count):
    """Whatever supports fix: P projects to what changes jumps, and forces fit reactions."""
    pairs = {2: [(0, 1)], 3: [(0, 1), (0, 2), (2, 1)], 4: [(1, 0), (0, 2), (1, 3), (3, 2)]}[count]
    here, there = np.array([*pairs, (0, NOBODY)]).T
    rng = np.random.default_rng(count)
    for _ in range(40):
        free = rng.random((count, 1)) < rng.random()
        groups = Groups(
            5 + here, np.where(there < 0, NOBODY, 5 + there), 5 + np.arange(count), free
        )
        B = np.zeros((len(here), count))
        B[np.arange(len(here)), here] = 1.0
        B[np.arange(len(pairs)), there[: len(pairs)]] = -1.0
        B *= free.ravel()
        P = groups.projector[0, 0]
        assert abs(P @ P - P).max() < 1e-14
        assert abs(P - P.T).max() < 1e-14
        assert abs(B @ P - B).max() < 1e-14
        assert np.trace(P) == pytest.approx(np.linalg.matrix_rank(B))
        vectors, is_jump, is_alike = (part[0, 0] for part in groups.bases)
        assert is_jump.sum() + is_alike.sum() == free.sum()
        assert abs(B @ vectors[:, is_alike]).max(initial=0.0) < 1e-14
        assert abs(vectors[:, is_jump] @ vectors[:, is_jump].T - P).max() < 1e-14
        # Rows are independent where no self-balanced forces have a part in them.
        alone = [np.linalg.matrix_rank(np.delete(B, k, axis=0)) for k in range(len(B))]
        is_needed = np.array(alone) < np.linalg.matrix_rank(B)
        assert (groups.is_independent[:, 0] == is_needed).all()
        # Forces by stiffness have the resultants of any reaction that rows can have.
        stiffness = 10.0 ** rng.uniform(-3.0, 3.0, len(here))
        reaction = P @ rng.normal(size=count)
        forces = groups.shares(stiffness)[0, 0] @ reaction
        assert B.T @ forces == pytest.approx(reaction, abs=1e-9)


def test_an_open_joint_moves_bodies_apart():
    """Supports on one side alone leave the jump to the other side, at a joint, too."""
    held = [ec.Displacement(name, (0.0, 0.0)) for name in ("bottom", "left")]
    pull = ec.Displacement("top", (0.01, 0.01))
    loads = [ec.Traction("right", (0.5, 0.0))]
    scene = ec.Scene(material(3), [*held, pull], loads, contacts("ab ac bc", {"ab": 0.3}))
    found = []
    for method in METHODS:
        for solver in ("direct", "iterative"):
            solution = ec.solve(scene, joint(2), method, solver=solver)
            found.append(ec.constitutive_error(ec.equilibrate(solution)).absolute)
            for pair in ("ab", "ac", "bc"):
                assert abs(solution.force(pair).force).max() < 1e-7
    assert found[1:] == pytest.approx(found[:1] * 3, rel=1e-7)
