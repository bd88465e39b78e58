"""Rigid faces, which a stiff holder moves.

- a bar that a rigid end pulls and bends has the closed form, signs included;
- a face in a holder of 1e6 E moves as the rigid face does;
- sigma^ has the resultants that are given, and u^ is rigid on the face, in the plane
  and in 3D;
- e bounds true errors, energies and motions of a fine mesh lie in the intervals;
- a punch between two bodies, histories, ranks;
- what is wrong is refused in words.
"""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from domains import refused
from mpi4py import MPI
from reference import true_errors
from scenes import measured, mostly_serial

import erc_contact as ec

E, NU = 1000.0, 0.3
PLANE = ((0.0, 0.0), (2.0, 1.0))
SPACE = ((0.0, 0.0, 0.0), (2.0, 1.5, 1.0))


def plate(n: int = 3, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    return ec.rectangle(*PLANE, cells=(2 * n, n), comm=comm)


def resting(*supports, friction=0.3, nu=NU, **others) -> ec.Scene:
    contact = ec.Contact("bottom", friction=friction)
    return ec.Scene(ec.Elastic(E, nu), supports, contacts=contact, **others)


def free_face() -> ec.Rigid:
    return ec.Rigid("top", force=(0.4, -8.0), moment=1.5)


def test_bar_pulled_and_bent():
    """Without Poisson's effect degree 2 represents the solution; nu would warp the ends."""
    pull, moment = 6.0, 0.5
    rigid = ec.Rigid("right", (None, 0.0), force=(pull, None), moment=moment)
    scene = ec.Scene(ec.Elastic(E, 0.0), [ec.Symmetry("left"), rigid])
    error = measured(scene, plate(), degree=2, method=ec.Nitsche())
    assert error.relative < 1e-12
    motion = error.solution.motion("right")
    assert motion.displacement == pytest.approx([2.0 * pull / E, 0.0], abs=1e-14)
    # Counterclockwise, as the moment.
    assert motion.rotation[0] == pytest.approx(2.0 * moment / (E / 12), rel=1e-12)
    assert motion.about == pytest.approx([2.0, 0.5])
    work = pull * motion.displacement[0] + moment * motion.rotation[0]
    assert ec.potential_energy(error).value == pytest.approx(-work / 2, rel=1e-12)
    assert ec.work_of_loads(error).value == pytest.approx(work, rel=1e-12)


def test_eccentric_force_on_a_smooth_foundation():
    """Inside the middle third nothing opens: pressure and tilt are as in a bent bar."""
    force, arm = -8.0, 0.25
    face = ec.Rigid("top", (0.0, None), force=(None, force), moment=arm * force)
    error = measured(resting(face, friction=0.0, nu=0.0), plate(), degree=2, method=ec.Nitsche())
    assert error.relative < 1e-10
    motion = error.solution.motion("top")
    second_moment = 2.0**3 / 12
    assert motion.displacement[1] == pytest.approx(force / 2.0 / E, rel=1e-9)
    assert motion.rotation[0] == pytest.approx(arm * force / second_moment / E, rel=1e-9)
    # The pressure is below the force.
    assert error.force("bottom").moment == pytest.approx((1.0 + arm) * -force, rel=1e-9)


@pytest.mark.serial
def test_face_in_a_stiff_holder():
    """The loads on the holder have the resultants of the face."""
    Q, M = (0.4, -8.0), 1.5
    domain = ec.rectangle((0.0, 0.0), (2.0, 1.5), cells=(8, 6))

    def modulus(x):
        return ufl.conditional(x[1] > 1.0, 1e6 * E, E)

    def load(x):
        # The shear on the holder's top has a moment about the face, too.
        linear = (M + 0.5 * Q[0]) * (x[0] - 1.0) / (2.0**3 / 12)
        return Q[0] / 2.0, Q[1] / 2.0 + linear

    contact = ec.Contact("bottom", friction=0.3)
    held = ec.Scene(ec.Elastic(modulus, NU), [], ec.Traction("top", load), contact)
    reference = ec.solve(held, domain, degree=2)
    moved = reference.at([(1.0, 1.0), (0.0, 1.0), (2.0, 1.0)]).displacement
    solution = ec.solve(resting(free_face()), plate(4), degree=2)
    motion = solution.motion("top")
    size = abs(moved).max()
    assert motion.displacement == pytest.approx(moved[0], abs=1e-5 * size)
    assert motion.rotation[0] == pytest.approx((moved[2] - moved[1])[1] / 2.0, abs=1e-5 * size)
    turned = replace(resting(replace(free_face(), moment=-M)))
    assert ec.solve(turned, plate(4), degree=2).motion("top").rotation[0] < 0 < motion.rotation[0]


@pytest.mark.serial
def test_strip_under_a_plate():
    """Between planes of symmetry, in any unit."""
    rotations = []
    for length in (1.0, 1e-9, 1e9):
        domain = ec.rectangle((0.0, 0.0), (2.0 * length, length), cells=(6, 3))
        force = -8.0 * length
        face = ec.Rigid("top", (0.0, None), force=(None, force), moment=0.0)
        sides = [ec.Symmetry("left"), ec.Symmetry("right")]
        error = measured(resting(face, *sides, friction=0.0), domain)
        assert error.relative < 1e-12
        motion = error.solution.motion("top")
        strain = force / (2.0 * length) * (1 + NU) * (1 - 2 * NU) / (1 - NU) / E
        assert motion.displacement[1] == pytest.approx(strain * length, rel=1e-10)
        assert abs(motion.rotation[0]) < 1e-12 * abs(strain)
        # A force at the right of the middle turns it clockwise.
        eccentric = replace(face, moment=0.2 * length * force)
        solution = ec.solve(resting(eccentric, *sides, friction=0.0), domain)
        rotations.append(solution.motion("top").rotation[0])
    assert rotations[0] < 0
    assert rotations == pytest.approx(3 * [rotations[0]], rel=1e-9)


# Boundary parts, freedoms and cells: all free, some given, one cell high, a body of two parts.
FACES = {
    "free": (free_face(), (6, 3), 1),
    "free, degree 2": (free_face(), (6, 3), 2),
    "coarse": (free_face(), (2, 1), 2),
    "guided": (ec.Rigid("top", (0.001, None), rotation=0.0, force=(None, -8.0)), (6, 3), 1),
    "pushed": (ec.Rigid("top", (None, -0.004), force=(0.5, None), moment=0.2), (6, 3), 2),
    "in 3D": (
        ec.Rigid("top", force=(0.4, 0.3, -8.0), moment=(0.5, -0.4, 0.2)),
        (3, 2, 2),
        1,
    ),
    "in 3D, degree 2": (
        ec.Rigid(
            "top", (None, None, -0.004), (0.0, 0.001, None), (0.4, 0.3, None), (None, None, 0.2)
        ),
        (2, 2, 1),
        2,
    ),
}


@pytest.mark.parametrize("case", mostly_serial(FACES, ["free", "in 3D"]))
def test_resultants_and_motions(case):
    rigid, cells, degree = FACES[case]
    box = ec.rectangle(*PLANE, cells=cells) if rigid.d == 2 else ec.box(*SPACE, cells=cells)
    error = measured(resting(rigid), box, degree=degree)
    motion = error.solution.motion("top")
    motions = (*motion.displacement, *motion.rotation)
    for result in (error, error.solution):
        force = result.force("top")
        # Moments are about the origin; moments of the face about its point.
        arm = motion.about
        if rigid.d == 2:
            moved = arm[0] * force.force[1] - arm[1] * force.force[0]
        else:
            moved = np.cross(arm, force.force)
        resultants = (*force.force, *(force.moment - moved))
        for given, found in zip(rigid.resultants, resultants, strict=True):
            assert given is None or found == pytest.approx(given, abs=1e-10 * 8.0)
        assert abs(result.reactions()["balance"].force).max() < 1e-10 * 8.0
    for given, found in zip(rigid.motions, motions, strict=True):
        assert given is None or found == pytest.approx(given, abs=1e-14)
    # u^ is rigid on the face.
    x = error.model.space.V.tabulate_dof_coordinates()[:, : rigid.d]
    on_face = abs(x[:, -1] - 1.0) < 1e-12
    turned = x[on_face] - arm
    if rigid.d == 2:
        turned = motion.rotation[0] * np.column_stack([-turned[:, 1], turned[:, 0]])
    else:
        turned = np.cross(motion.rotation, turned)
    hat = error.admissible.displacement.x.array.reshape(-1, rigid.d)[on_face]
    assert hat == pytest.approx(motion.displacement + turned, abs=1e-13)


BOUNDED = {
    "frictionless": resting(
        ec.Rigid("top", (0.0, None), force=(None, -8.0), moment=1.5), friction=0.0
    ),
    "Tresca friction": resting(
        ec.Rigid("top", (0.002, None), force=(None, -8.0), moment=-1.0),
        friction=ec.Tresca(0.5),
        loads=[ec.BodyForce((0.0, -1.0))],
    ),
    "cantilever": ec.Scene(
        ec.Elastic(E, NU),
        [ec.Displacement("left", (0.0, 0.0)), ec.Rigid("right", force=(0.5, -1.0), moment=0.1)],
    ),
}


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(
    ("case", "degree"), [("frictionless", 2), ("Tresca friction", 1), ("cantilever", 1)]
)
def test_e_and_intervals_hold_those_of_a_fine_mesh(case, degree):
    scene = BOUNDED[case]
    part = scene.supports[-1].facets
    reference = ec.solve(scene, plate(16), degree=2)
    energy = ec.potential_energy(measured(scene, plate(8), degree=2)).value
    moved = reference.motion(part).displacement
    for n in (2, 4):
        error = measured(scene, plate(n), degree=degree)
        true = true_errors(error.admissible, reference)
        assert true.both <= 1.02 * error.absolute < 1.4 * 1.02 * true.both
        bounds = ec.potential_energy(error)
        assert bounds.low <= energy <= bounds.high
        motion = ec.interval(error, ec.MeanDisplacement(part, (0.0, 1.0)))
        assert motion.guaranteed
        assert motion.low <= moved[1] <= motion.high
        assert motion.relative < 1.2 * error.relative
        # The exact motion of the face is no error of another displacement, a bend is.
        found = ec.certify(scene, error.domain, error.solution.u).error
        assert found.absolute < 1.3 * error.absolute
        bent = ec.certify(scene, plate(n), lambda x: 0.001 * x[::-1] ** 2, degree=degree).error
        assert bent.absolute > error.absolute


GUIDED = ec.Rigid("top", (0.001, None), rotation=0.0, force=(None, -8.0))
HELD = ec.Scene(
    ec.Elastic(E, NU), [ec.Displacement("left", (0.0, 0.0)), replace(free_face(), facets="right")]
)
SPRUNG = ec.Spring("right", normal=E)
SOLVED = {
    "free": (lambda: (resting(free_face(), loads=ec.BodyForce((0.0, -2.0))), plate()), 1),
    "coarse": (lambda: (resting(free_face()), plate(1)), 2),
    "certified": (lambda: (resting(GUIDED, friction=0.2), plate(6)), 1),
    "sprung": (lambda: (resting(GUIDED, friction=0.2, springs=SPRUNG), plate()), 2),
    "without contact": (lambda: (HELD, plate()), 1),
    "in 3D": (
        lambda: (resting(FACES["in 3D"][0]), ec.box(*SPACE, cells=(3, 2, 2))),
        2,
    ),
    "two bodies": (lambda: two_bodies(3), 1),
}


@pytest.mark.broad
@pytest.mark.parametrize("case", mostly_serial(SOLVED, ["free", "in 3D", "two bodies"]))
def test_both_solvers(case):
    """The factor and multigrid, with all that solves for the body after the contact."""
    make, degree = SOLVED[case]
    scene, domain = make()
    face = next(support for support in scene.supports if isinstance(support, ec.Rigid))
    numbers = []
    for solver in ("direct", "iterative"):
        error = measured(scene, domain, degree=degree, solver=solver)
        assert error.solution.stiffness.iterative == (solver == "iterative")
        motion = error.solution.motion(face.facets)
        of_solver = [error.relative, *motion.displacement, *motion.rotation]
        if case == "certified":
            # Norms by multigrid have two or three digits.
            assert ec.coulomb_certificate(error).q == pytest.approx(0.395, rel=0.02)
        if scene.contacts:
            up = (0.0,) * (domain.dim - 1) + (1.0,)
            force = ec.resultant(error, scene.contacts[0].facets, up)
            of_solver += [force.low, force.high]
        numbers.append(of_solver)
    assert numbers[1] == pytest.approx(numbers[0], rel=1e-8, abs=1e-12)


def test_a_roller_beside_a_face_that_turns():
    """The traction on a roller is chosen, but no couple about the corner comes from it."""
    face = ec.Rigid("top", (0.0, None), force=(None, -8.0), moment=1.0)
    roller = ec.Displacement("left", (0.0, None))
    error = measured(resting(roller, face, friction=0.0), plate())
    plane = measured(resting(ec.Symmetry("left"), face, friction=0.0), plate())
    force = error.force("top")
    # About the origin: the face is at (1, 1).
    assert force.moment == pytest.approx(1.0 - 8.0 - force.force[0], abs=1e-10 * 8.0)
    assert error.relative == pytest.approx(plane.relative, rel=0.02)


def test_given_motions_are_a_support():
    rigid = measured(resting(ec.Rigid("top", (0.001, -0.004), rotation=0.002)), plate())
    plane = ec.Displacement("top", (0.001, lambda x: -0.004 + 0.002 * (x[0] - 1.0)))
    support = measured(resting(plane), plate())
    assert rigid.absolute == pytest.approx(support.absolute, rel=1e-10)


def two_bodies(n: int) -> tuple[ec.Scene, ec.Domain]:
    upper = ec.rectangle((0.0, 1.0), (2.0, 2.0), cells=(2 * n, n))
    both = ec.assembly({"upper": upper, "lower": plate(n + 1)})
    supports = [
        ec.Rigid("upper top", force=(0.3, -8.0), moment=0.5),
        ec.Displacement("lower bottom", (0.0, 0.0)),
    ]
    contact = ec.Contact("upper bottom", against="lower top", friction=0.3)
    material = ec.Elastic({"upper": E, "lower": 3 * E}, NU)
    return ec.Scene(material, supports, contacts=contact), both.joined("upper bottom", "lower top")


def test_upper_body_pressed_by_a_rigid_face():
    errors = []
    for n in (3, 6):
        errors.append(measured(*two_bodies(n)))
        assert errors[-1].force("upper top").force == pytest.approx([0.3, -8.0], abs=1e-9)
        assert errors[-1].force("lower bottom").force == pytest.approx([-0.3, 8.0], abs=1e-9)
    assert 0.4 < errors[1].absolute / errors[0].absolute < 0.85


@pytest.mark.serial
def test_fretting_in_a_rigid_holder():
    """After the first turn the loop is symmetric, and the face does not rock."""

    def scene_at(t):
        moved = float(0.004 * np.sin(np.pi * t / 2))
        return resting(ec.Rigid("top", (moved, None), rotation=0.0, force=(None, -8.0)))

    evolution = ec.evolve(scene_at, plate(4), np.arange(8.0), accuracy=0.5)
    there, back = (evolution.steps[i].force["bottom"] for i in (5, 7))
    assert there[0] < -0.5
    assert back[0] > 0.5
    assert there[0] == pytest.approx(-back[0], rel=0.05)
    assert there[1] == pytest.approx(8.0)
    assert abs(evolution.solution.motion("top").rotation[0]) < 1e-14


@pytest.mark.serial
def test_a_run_goes_on_from_its_folder(tmp_path):
    scene = resting(ec.Rigid("top", (0.001, None), force=(None, -8.0), moment=0.5))
    whole = ec.adapt(scene, plate(2), 0.06)
    ec.adapt(scene, plate(2), 0.06, max_steps=2, checkpoint=tmp_path)
    again = ec.adapt(scene, plate(2), 0.06, checkpoint=tmp_path)
    assert len(whole.steps) > 2
    assert [step.cells for step in again.steps] == [step.cells for step in whole.steps]
    assert again.best.relative == pytest.approx(whole.best.relative, rel=1e-8)


@pytest.mark.ranks
def test_ranks_agree():
    numbers = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        error = measured(resting(free_face()), plate(4, comm))
        motion = error.solution.motion("top")
        numbers.append([error.relative, *motion.displacement, *motion.rotation])
    assert numbers[1] == pytest.approx(numbers[0], rel=1e-8)


def shares_nodes(friction, *supports):
    return ec.solve(resting(*supports, friction=friction), plate())


BAD = {
    "neither": (lambda: ec.Rigid("top", (0.0, None), rotation=0.0), "neither of displacement in y"),
    "both": (lambda: ec.Rigid("top", (0.0, 1.0), 0.0, force=(1.0, None)), "both of displacement"),
    "nothing": (lambda: ec.Rigid("top", rotation=0.0), "neither displacement nor force"),
    "no number": (lambda: ec.Rigid("top", (0.0, np.nan), 0.0), "finite numbers"),
    "rotations": (lambda: ec.Rigid("top", (0.0, 0.0), (0.0, 0.0)), "rotation has 2 numbers"),
    "in the plane": (
        lambda: ec.solve(resting(ec.Rigid("top", (0, 0, 0), (0, 0, 0))), plate()),
        "the mesh is 2D",
    ),
    "contact": (
        lambda: resting(ec.Rigid("bottom", (0.0, 0.0), 0.0)),
        "in a Contact and in a Rigid",
    ),
    "load": (
        lambda: resting(free_face(), loads=ec.Traction("top", (0.0, 1.0))),
        "a Traction and a Rigid; give the Rigid its resultant",
    ),
    "rough corner": (
        lambda: shares_nodes(0.3, ec.Rigid("right", force=(1.0, -1.0), moment=0.0)),
        "beside a contact with friction",
    ),
    "corner that moves": (
        lambda: shares_nodes(0.0, ec.Rigid("right", force=(1.0, -1.0), moment=0.0)),
        "hold a component there in which the face moves",
    ),
    "support": (
        lambda: shares_nodes(0.0, free_face(), ec.Displacement("left", (0.0, None))),
        "and a support have nodes in common",
    ),
    "stress of a cell that touches both": (
        lambda: ec.solve(resting(free_face()), plate(1), ec.Nitsche()),
        "A cell touches both",
    ),
    "not held": (
        lambda: ec.solve(ec.Scene(ec.Elastic(E, NU), [free_face()]), plate()),
        "Nothing holds the body",
    ),
    "force that is given": (
        lambda: ec.interval(
            measured(BOUNDED["frictionless"], plate()), ec.Resultant("top", (0.0, 1.0))
        ),
        "is given; ask for the other",
    ),
    "name": (lambda: ec.solve(resting(free_face()), plate()).motion("left"), "is called 'left'"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_faces_are_refused_in_words(case):
    refused(*BAD[case])
