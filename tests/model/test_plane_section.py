"""Sections that stay plane and slide in themselves.

- a bar in tension widens, a bar bends between two sections: exact, in the plane and in
  3D; a cell between four sections; a ring, whose section is a rigid face;
- u^ is plane on the section, sigma^ has no shear there and the given resultants, beside
  rollers, too;
- energies of finer meshes lie in the bounds of random blocks;
- a face that is held in itself is stiffer;
- adaptive runs, histories, ranks; what is wrong is refused in words.
"""

from dataclasses import replace

import numpy as np
import pytest
from domains import refused
from mpi4py import MPI
from scenes import measured

import erc_contact as ec
from namedmesh.simplex import nodes

E, NU = 1000.0, 0.3
PLANE = ((0.0, 0.0), (2.0, 1.0))
SPACE = ((0.0, 0.0, 0.0), (2.0, 1.5, 1.0))
STEEL = ec.Elastic(E, NU)
SHEET = ec.Elastic(E, NU, hypothesis="plane stress")


def plate(n: int = 2, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    return ec.rectangle(*PLANE, cells=(2 * n, n), comm=comm)


def brick(n: int = 1) -> ec.Domain:
    return ec.box(*SPACE, cells=(2 * n, 2 * n, n))


def stress_on(error: ec.ConstitutiveError, part: str) -> np.ndarray:
    """sigma^ at the nodes of the facets of a part, in Mandel components, (facets, m, s)."""
    space, cells = error.model.space, error.admissible.cell_geometry
    facets = space.facet_numbers(space.domain.owned_facets(part))
    cell, local = np.divmod(cells.side[0][facets], space.d + 1)
    corners = np.array([np.delete(np.eye(space.d + 1), i, axis=0) for i in range(space.d + 1)])
    bary = np.insert(nodes(space.d - 1, 2), 0, 1 - nodes(space.d - 1, 2).sum(axis=1), axis=1)
    places = np.einsum("qk,fkv->fqv", bary, corners[local])
    x = np.einsum("fqv,fvi->fqi", places, cells.corners[cell])
    return error.admissible.stress_at(cell, places, x)


def check_section(error: ec.ConstitutiveError, section: ec.PlaneSection) -> None:
    """u^ . n is plane, there is no shear, and force and moments are what is given."""
    space, d, axis = error.model.space, section.d, section.axis
    comm = space.comm
    motion = error.solution.motion(section.facets)
    rotation = np.zeros(3)
    rotation[-len(motion.rotation) :] = motion.rotation
    # What is given.
    for given, found in zip(section.motions, (*motion.displacement, *motion.rotation), strict=True):
        assert given is None or found == pytest.approx(given, abs=1e-14)
    # u^ is plane.
    facets = space.domain.facets(section.facets)
    on_face = np.unique(space.facet_nodes(facets))
    arm = np.zeros((len(on_face), 3))
    arm[:, :d] = space.V.tabulate_dof_coordinates()[on_face, :d] - motion.about
    plane = motion.displacement[axis] + np.cross(rotation, arm)[:, axis]
    hat = error.admissible.displacement.x.array.reshape(-1, d)[on_face, axis]
    assert hat == pytest.approx(plane, abs=1e-13)
    # sigma^ has no shear: of two indices one is the axis.
    stress = stress_on(error, section.facets)
    pairs = [(0, 1)] if d == 2 else [(0, 1), (0, 2), (1, 2)]
    shear = np.array([axis in pair for pair in pairs])
    greatest = comm.allreduce(abs(stress).max(initial=0.0), MPI.MAX)
    sheared = abs(stress[..., -len(pairs) :][..., shear]).max(initial=0.0)
    assert sheared <= 1e-9 * greatest
    # Resultants, about the point of the section.
    force = error.force(section.facets)
    about = np.zeros(3)
    about[:d] = motion.about
    whole = np.zeros(3)
    whole[:d] = force.force
    moved = np.cross(about, whole)
    moment = np.atleast_1d(force.moment) - moved[-len(motion.rotation) :]
    scale = abs(np.concatenate([force.force, moment])).max() + 1e-12
    for given, found in zip(section.resultants, (*force.force, *moment), strict=True):
        assert given is None or found == pytest.approx(given, abs=1e-10 * scale)
    across = np.delete(force.force, axis)
    assert abs(across).max() <= 1e-10 * scale


def test_bars_are_exact():
    """Tension with free widening, and St-Venant's bending of a long bar."""
    held = ec.PlaneSection("left", (0.0, None), rotation=0.0)
    pull, moment = 6.0, 0.5
    for load, turn in ((pull, 0.0), (0.0, moment)):
        end = ec.PlaneSection("right", force=(load, None), moment=turn)
        error = measured(ec.Scene(SHEET, [held, end]), plate(), degree=2)
        assert error.relative < 1e-10
        motion = error.solution.motion("right")
        assert motion.displacement[0] == pytest.approx(2.0 * load / E, abs=1e-14)
        assert motion.rotation[0] == pytest.approx(2.0 * turn / (E / 12), abs=1e-14)
        check_section(error, end)
        work = load * motion.displacement[0] + turn * motion.rotation[0]
        assert ec.potential_energy(error).value == pytest.approx(-work / 2, rel=1e-9)
    bounds = ec.interval(error, ec.Rotation("right"))
    # Nothing is left of the error: both ends are the exact number up to round-off.
    exact = 2.0 * moment / (E / 12)
    assert bounds.low <= exact * (1 + 1e-13)
    assert bounds.high >= exact * (1 - 1e-13)
    assert ec.interval(error, ec.Resultant("right", (0.0, 1.0))).value == 0.0


def test_a_beam_in_space_is_exact():
    held = ec.PlaneSection("left", (0.0, None, None), (None, 0.0, 0.0))
    end = ec.PlaneSection("right", force=(6.0, None, None), moment=(None, 0.5, -0.3))
    error = measured(ec.Scene(STEEL, [held, end]), brick(), degree=2)
    assert error.relative < 1e-10
    motion = error.solution.motion("right")
    width, height = 1.5, 1.0
    assert motion.displacement[0] == pytest.approx(2.0 * 6.0 / (E * width * height), rel=1e-9)
    turned = 2.0 / E * np.array([0.5 / (width * height**3 / 12), -0.3 / (height * width**3 / 12)])
    assert motion.rotation[1:] == pytest.approx(turned, rel=1e-9)
    check_section(error, end)


def test_a_cell_between_four_sections():
    """Each side gives the mean strain of its direction, and slides along the others."""
    sections = [
        ec.PlaneSection("left", (0.0, None), rotation=0.0),
        ec.PlaneSection("bottom", (None, 0.0), rotation=0.0),
        ec.PlaneSection("right", force=(6.0, None), rotation=0.0),
        ec.PlaneSection("top", force=(None, -2.0), rotation=0.0),
    ]
    error = measured(ec.Scene(SHEET, sections), plate())
    assert error.relative < 1e-12
    along, across = 6.0, -2.0 / 2.0
    strain = (along - NU * across) / E, (across - NU * along) / E
    assert error.solution.motion("right").displacement[0] == pytest.approx(2.0 * strain[0])
    assert error.solution.motion("top").displacement[1] == pytest.approx(strain[1])


def test_a_section_of_a_ring_is_a_rigid_face():
    ring = ec.rectangle((1.0, 0.0), (2.0, 1.0), cells=(3, 3))
    material = ec.Elastic(E, NU, hypothesis="axisymmetric")
    found = []
    for face in (
        ec.PlaneSection("top", force=(None, -5.0)),
        ec.Rigid("top", force=(None, -5.0)),
    ):
        scene = ec.Scene(material, [ec.Displacement("bottom", (0.0, 0.0)), face])
        found.append(measured(scene, ring))
    assert found[0].absolute == found[1].absolute
    assert found[0].force("bottom").force[1] == pytest.approx(5.0)
    # Components rr, zz, rz, hoop.
    assert abs(stress_on(found[0], "top")[..., 2]).max(initial=0.0) < 1e-9


def random_half(d: int, seed: int) -> tuple[ec.Scene, ec.PlaneSection]:
    """A block on a foundation, on rollers at its planes of symmetry, under a section."""
    random = np.random.default_rng([d, seed])
    rollers = [ec.Displacement("left", (0.0, *(None,) * (d - 1)))]
    if d == 3:
        rollers.append(ec.Displacement("front", (None, 0.0, None)))
    free = random.random(3) < 0.6
    amounts = random.uniform(-1.0, 1.0, 3)
    motions = [-0.004, *0.002 * amounts[1:]]
    resultants = [-8.0, *0.6 * amounts[1:]]
    motion = [None if free[k] else motions[k] for k in range(3)]
    resultant = [resultants[k] if free[k] else None for k in range(3)]
    if d == 2:
        section = ec.PlaneSection(
            "top", (None, motion[0]), motion[1], (None, resultant[0]), resultant[1]
        )
    else:
        section = ec.PlaneSection(
            "top",
            (None, None, motion[0]),
            (*motion[1:], None),
            (None, None, resultant[0]),
            (*resultant[1:], None),
        )
    friction = ec.Tresca(0.3) if random.random() < 0.5 else 0.0
    scene = ec.Scene(
        ec.Elastic(E, float(random.uniform(0.0, 0.45))),
        [*rollers, section],
        loads=ec.BodyForce(tuple(random.uniform(-0.5, 0.0, d))),
        contacts=ec.Contact("bottom", friction=friction),
    )
    return scene, section


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_energies_of_finer_meshes_lie_in_the_bounds(d, seed):
    scene, section = random_half(d, seed)
    coarse = measured(scene, plate() if d == 2 else brick())
    fine = measured(scene, plate(6) if d == 2 else brick(2), degree=2 if d == 2 else 1)
    for error in (coarse, fine):
        check_section(error, section)
    found, exact = ec.potential_energy(coarse), ec.potential_energy(fine)
    assert found.low <= exact.high
    assert found.high >= exact.low
    assert exact.high - exact.low < found.high - found.low


def test_a_face_that_is_held_in_itself_is_stiffer():
    """Under one force it goes less far, however the mesh: by the bounds of the motions."""
    moved = []
    for face in (
        ec.PlaneSection("top", rotation=0.0, force=(None, -8.0)),
        ec.Rigid("top", (0.0, None), rotation=0.0, force=(None, -8.0)),
    ):
        scene = ec.Scene(STEEL, [face, ec.Symmetry("left")], contacts=ec.Contact("bottom"))
        error = measured(scene, plate(6))
        moved.append(ec.interval(error, ec.MeanDisplacement("top", (0.0, 1.0))))
    assert moved[0].high < moved[1].low < 0.0
    # Between smooth planes the block widens freely.
    exact = -8.0 / 2.0 * (1 - NU**2) / E
    assert moved[0].low <= exact <= moved[0].high


@pytest.mark.parametrize("solver", ["direct", "iterative"])
def test_both_solvers(solver):
    scene, section = random_half(3, 0)
    error = measured(scene, brick(), solver=solver)
    assert error.solution.stiffness.iterative == (solver == "iterative")
    check_section(error, section)


def growing(t: float) -> ec.Scene:
    section = ec.PlaneSection("top", force=(None, -8.0 * t), moment=0.5 * t)
    roller = ec.Displacement("left", (0.0, None))
    return ec.Scene(STEEL, [roller, section], contacts=ec.Contact("bottom", friction=0.3))


@pytest.mark.broad
@pytest.mark.serial
def test_runs_go_on_from_their_folders(tmp_path):
    whole = ec.adapt(growing(1.0), plate(), 0.03)
    ec.adapt(growing(1.0), plate(), 0.03, max_steps=2, checkpoint=tmp_path / "run")
    again = ec.adapt(growing(1.0), plate(), 0.03, checkpoint=tmp_path / "run")
    assert len(whole.steps) > 2
    assert [step.cells for step in again.steps] == [step.cells for step in whole.steps]
    check_section(again.error, growing(1.0).supports[1])
    read = ec.read_history(tmp_path / "run")
    assert read.error.relative == pytest.approx(whole.best.relative, rel=1e-8)
    times = [0.5, 1.0]
    arguments = {"accuracy": 0.2, "checkpoint": tmp_path / "history"}
    steps = ec.evolve(growing, plate(), times, **arguments)
    made = []
    kept = ec.evolve(growing, plate(), times, callback=made.append, **arguments)
    assert not made
    for t, error in zip(times, kept.errors, strict=True):
        check_section(error, growing(t).supports[1])
    assert len(steps.steps) == len(kept.steps)


@pytest.mark.ranks
def test_ranks_agree():
    numbers = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        error = measured(growing(1.0), plate(4, comm))
        motion = error.solution.motion("top")
        numbers.append([error.relative, *motion.displacement, *motion.rotation])
    assert numbers[1] == pytest.approx(numbers[0], rel=1e-8)


def on_a_plate(*supports, **others) -> ec.Solution:
    return ec.solve(ec.Scene(STEEL, supports, **others), plate())


TURNING = ec.Rigid("top", force=(1.0, -8.0), moment=0.0)
BAD = {
    "two axes": (
        lambda: ec.PlaneSection("top", (0.0, None), force=(None, -1.0), rotation=0.0),
        ("along x, y", "moves along its normal alone"),
    ),
    "in the plane": (
        lambda: ec.PlaneSection("top", force=(None, None, 2.0), moment=(0.0, 0.0, 0.0)),
        ("turns freely in its plane",),
    ),
    "neither": (
        lambda: ec.Scene(STEEL, ec.PlaneSection("top", force=(None, 2.0))),
        ("neither of rotation and moment",),
    ),
    "both": (
        lambda: ec.PlaneSection("top", (None, 0.0), 0.0, force=(None, 2.0)),
        ("both of displacement in y",),
    ),
    "not flat": (
        lambda: on_a_plate(ec.PlaneSection("top", (0.0, None), rotation=0.0)),
        ("reaches over 2 along x", "turn the mesh"),
    ),
    "a ring turns not": (
        lambda: ec.Scene(
            ec.Elastic(E, NU, hypothesis="axisymmetric"),
            ec.PlaneSection("top", force=(None, 2.0), moment=0.0),
        ),
        ("moves along the axis only",),
    ),
    "a ring has no flat side along its axis": (
        lambda: ec.Scene(
            ec.Elastic(E, NU, hypothesis="axisymmetric"),
            ec.PlaneSection("right", displacement=(0.0, None)),
        ),
        ("neither of displacement in y",),
    ),
    "pressure": (
        lambda: on_a_plate(
            ec.PlaneSection("top", force=(None, 2.0), moment=0.0),
            loads=ec.Traction("top", lambda x: (0.0, x[0])),
        ),
        ("Add the load to the force",),
    ),
    "a load along its force": (
        lambda: on_a_plate(
            ec.PlaneSection("top", force=(None, 2.0), moment=0.0),
            loads=ec.Traction("top", (0.0, 1.0)),
        ),
        ("and a PlaneSection in component 1",),
    ),
    "two faces of one corner": (
        lambda: on_a_plate(TURNING, replace(TURNING, facets="right"), springs=ec.Spring("left", E)),
        ("Rigid('top') and Rigid('right') have nodes in common",),
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_sections_are_refused_in_words(case):
    make, words = BAD[case]
    refused(make, *words)
