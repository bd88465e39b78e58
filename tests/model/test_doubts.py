"""What is accepted and doubtful is told, in words, once.

On rank 0, whatever the number of meshes or steps.

No scene of which nothing is doubtful says a word.
"""

import logging
from pathlib import Path

import pytest
import ufl
from mpi4py import MPI
from scenes import prototype_block

import erc_contact as ec
from erc_contact.base import logs

COMM = MPI.COMM_WORLD
STEEL = ec.Elastic(E=1.0, nu=0.3)
FLOOR = ec.Contact("bottom", friction=0.3)


def square(n=4):
    return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(n, n))


@pytest.fixture
def warnings(caplog):
    """What is told as a warning on this rank; none is told on the others."""
    caplog.set_level(logging.WARNING, logger="erc_contact")

    def told(*, of):
        words = [
            record.getMessage() for record in caplog.records if record.levelno == logging.WARNING
        ]
        found = [one for one in words if of in one]
        return found if COMM.rank == 0 else ["nothing is told here"] * (not words)

    return told


def on_floor(**entries):
    scene = {
        "material": STEEL,
        "supports": [ec.Displacement("top", (0.0, -0.01))],
        "contacts": [FLOOR],
    }
    return ec.Scene(**{**scene, **entries})


DOUBTFUL = {
    "friction is 30": on_floor(contacts=[ec.Contact("bottom", friction=30.0)]),
    "percent (30% is 0.3)": on_floor(
        contacts=[ec.Contact("bottom", friction=lambda x: 30.0 * x[0])]
    ),
    "times its least side (1)": on_floor(supports=[ec.Displacement("top", (5.0, -0.01))]),
    "of the body strains by more than 5%": on_floor(supports=[ec.Displacement("top", (0, -0.3))]),
    "of the body rotates": on_floor(supports=[ec.Displacement("top", (0.4, -0.3))]),
    "Nothing touches the contact 'bottom'": on_floor(contacts=[ec.Contact("bottom", gap=0.5)]),
}


@pytest.mark.parametrize("of", DOUBTFUL)
def test_doubts_are_told(of, warnings):
    ec.solve(DOUBTFUL[of], square(), ec.AugmentedLagrangian())
    assert len(warnings(of=of)) == 1


def squeezed(by, d=2, **entries):
    """A block that is pressed by a share of its height, uniformly."""
    down = ec.Displacement("top", (*[None] * (d - 1), -by))
    along = [ec.Displacement(side, tuple(side_values(side, d))) for side in ("left", "front")]
    scene = {"supports": [down, *along[: d - 1]], "contacts": [ec.Contact("bottom")]}
    return on_floor(**{**scene, **entries})


def side_values(side, d):
    axis = {"left": 0, "front": 1}[side]
    return [0.0 if i == axis else None for i in range(d)]


def block_of(d, n=2):
    return square(n) if d == 2 else ec.box((0.0,) * 3, (1.0,) * 3, cells=(n,) * 3)


@pytest.mark.on_ranks("2-1", "3-2")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_strains_are_told_as_they_are(d, degree):
    """Uniform strain 0.6 of all of the body, without rotation; from 1 on it is refused."""
    distortion = ec.solve(squeezed(0.6, d), block_of(d), degree=degree).distortion
    assert distortion.strained == pytest.approx([1.0])
    assert distortion.strain == pytest.approx([0.6], rel=1e-9)
    assert distortion.rotation.max() < 1e-9
    assert distortion.inverted.max() == 0.0
    for by in (1.0, 1.2):
        with pytest.raises(ec.InputError, match=r"u turns 100% of the body inside out or flat"):
            ec.adapt(squeezed(by, d), block_of(d), accuracy=0.5, degree=degree)


@pytest.mark.serial
def test_rings_are_inverted_along_their_axis():
    rings = ec.Elastic(E=1.0, nu=0.3, hypothesis="axisymmetric")
    for by in (0.3, 1.0):
        scene = ec.Scene(rings, ec.Displacement("top", (None, -by)), contacts=ec.Contact("bottom"))
        if by < 1.0:
            assert ec.solve(scene, square()).distortion.strain == pytest.approx([by], rel=1e-9)
        else:
            with pytest.raises(ec.InputError, match="inside out"):
                ec.adapt(scene, square(), accuracy=0.5)


def test_a_foundation_that_moves_by_the_height():
    raised = ec.Contact("bottom", friction=0.3, motion=(0.0, 1.0))
    with pytest.raises(ec.InputError, match="inside out or flat"):
        ec.adapt(on_floor(contacts=[raised]), square(), accuracy=0.5)


def test_a_scene_without_contact_is_linear(warnings):
    """Its numbers hold for small loads: it is told, and not refused."""
    held = [ec.Displacement("bottom", (0.0, 0.0)), ec.Displacement("top", (0.0, -1.2))]
    ec.solve(ec.Scene(STEEL, held), square())
    assert len(warnings(of="is turned inside out): strains count as small")) == 1


@pytest.mark.serial
def test_elements_that_lock_are_no_inverted_body(warnings):
    """A rubber pad, down by 1%: linear elements bulge by 190% on a coarse mesh, eps is 100%."""
    rubber = ec.Elastic(1.0, 0.4999)
    floor = ec.Contact("bottom", friction=1.0)
    scene = ec.Scene(rubber, ec.Displacement("top", (0.0, -0.01)), contacts=floor)
    pad = ec.rectangle((0.0, 0.0), (4.0, 1.0), cells=(16, 4))
    history = ec.adapt(scene, pad, accuracy=0.5, max_steps=1)
    assert history.best.relative > 0.9
    assert history.solution.distortion.inverted.max() > 0.1
    assert warnings(of="is turned inside out")


def test_a_run_keeps_what_it_has_before_a_body_is_inverted():
    """In a history; the step that inverts it ends it in words, without halves."""
    evolution = ec.evolve(squeezed, square(), [0.01, 0.02, 1.5], accuracy=0.5)
    assert len(evolution.steps) > 2
    assert evolution.steps[-1].time < 1.0
    assert "before 1.5: u turns 100% of the body inside out or flat" in evolution.outcome
    assert "Displacements are not small: 100% of the body strains" in evolution.outcome
    history = ec.adapt(squeezed(0.5), square(), accuracy=0.5)
    assert "Displacements are not small: 100% of the body strains" in history.outcome
    assert "strains by more than 5%, up to 50%" in str(history)


def test_a_small_body_is_not_lost_in_a_large_one(warnings):
    """A cube of a thousandth of the volume strains by a third, and turns into a brick."""
    large = ec.rectangle((0.0, 0.0), (4.0, 2.0), cells=(16, 8))
    small = ec.rectangle((0.0, 2.0), (0.125, 2.125), cells=(2, 2))
    bodies = ec.assembly({"large": large, "small": small}).joined("small bottom", "large top")
    law = ec.Elastic(E={"large": 1.0, "small": 1e-3}, nu=0.0)
    down = [ec.Displacement("small top", (0.0, -0.04)), ec.Displacement("large bottom", (0.0, 0.0))]
    contact = ec.Contact("small bottom", against="large top")
    ec.solve(ec.Scene(law, down, contacts=contact), bodies)
    assert len(warnings(of="of the body with 'small bottom'")) == 1


@pytest.mark.serial
def test_a_preload_does_not_strain_what_it_draws():
    """The jump of the cut lies in a layer of cells: it is no strain of them."""
    cut = two_bodies(2)
    held = [ec.Displacement("A top", (None, 0.0)), ec.Displacement("B bottom", (0.0, 0.0))]
    bolt = ec.Preload("A bottom", "B top", shortening=0.04)
    solution = ec.solve(ec.Scene(ec.Elastic(1.0, 0.0), held, ties=bolt), cut)
    assert solution.distortion.strain.max() < 0.07
    assert solution.distortion.inverted.max() == 0.0


@pytest.mark.on_ranks("friction is 30")
@pytest.mark.parametrize("of", ["friction is 30", "Nothing touches"])
def test_a_run_tells_a_doubt_once(of, warnings):
    floor = ec.Contact("bottom", friction=30.0, gap=0.5 if "touches" in of else 0.0)
    scene = on_floor(
        supports=[ec.Displacement("top", (0.0, lambda x: -0.01 * x[0] ** 2))], contacts=[floor]
    )
    history = ec.adapt(
        scene, square(2), accuracy=1e-9, max_steps=3, method=ec.AugmentedLagrangian()
    )
    assert len(history.steps) == 3
    assert len(warnings(of=of)) == 1


def test_a_history_tells_a_doubt_once(warnings):
    def scene_at(t):
        return on_floor(
            supports=[ec.Displacement("top", (0.0, -0.1 * t))],
            contacts=[ec.Contact("bottom", friction=30.0, gap=0.05), ec.Contact("right", gap=1.0)],
        )

    ec.evolve(scene_at, square(2), [0.1, 0.2, 0.6], accuracy=0.9)
    assert len(warnings(of="friction is 30")) == 1
    assert not warnings(of="contact 'bottom': ") or COMM.rank > 0  # the last step touches it
    assert len(warnings(of="contact 'right': ")) == 1


@pytest.mark.parametrize(
    "run",
    [
        lambda scene, domain: ec.adapt(scene, domain, accuracy=5),
        lambda scene, domain: ec.evolve(lambda t: scene, domain, [1.0], accuracy=5),
    ],
    ids=["adapt", "evolve"],
)
def test_percent_for_an_accuracy_is_told(run, warnings):
    run(on_floor(), square())
    assert warnings(of="accuracy is 5, a relative error of 500%") in (
        ["accuracy is 5, a relative error of 500%: any mesh reaches it. For 5% write 0.05."],
        ["nothing is told here"],
    )


def two_bodies(d):
    """One above the other."""
    if d == 2:
        upper = ec.rectangle((0.3, 1.0), (1.3, 2.0), cells=(3, 3))
        lower = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    else:
        upper = ec.box((0.0, 0.0, 1.0), (1.0, 1.0, 2.0), cells=(2, 2, 2))
        lower = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 2))
    return ec.assembly({"A": upper, "B": lower}).joined("A bottom", "B top")


def on_each_other(d, down, **entries):
    moved = ec.Displacement("A top", (*(0.0,) * (d - 1), -down))
    held = ec.Displacement("B bottom", (0.0,) * d)
    return ec.Scene(STEEL, [moved, held], **entries)


@pytest.mark.parametrize("d", [2, 3])
def test_bodies_without_a_contact(d, warnings):
    """It is told that they go through each other, and of a foundation between them."""
    bodies = two_bodies(d)
    ec.solve(on_each_other(d, 0.02), bodies)
    entered = "go into each other by 0.02: no Contact is between them"
    assert len(warnings(of=entered)) == 1
    contact = ec.Contact("B top")
    ec.solve(on_each_other(d, -0.02, contacts=contact), bodies, ec.AugmentedLagrangian())
    assert len(warnings(of="Contact('B top') has no against=")) == 1
    if COMM.rank == 0:
        assert len(warnings(of="Give Contact('A bottom', against='B top')")) == 2


def test_bodies_with_a_contact_or_apart(caplog):
    caplog.set_level(logging.WARNING, logger="erc_contact")
    bodies = two_bodies(2)
    ec.solve(on_each_other(2, -0.02), bodies)
    ec.solve(on_each_other(2, 0.02, contacts=ec.Contact("B top", against="A bottom")), bodies)
    ec.solve(on_each_other(2, 0.02, ties=ec.Tied("A bottom", "B top")), bodies)
    assert not caplog.records


def test_what_is_usual_is_not_doubtful(caplog):
    caplog.set_level(logging.WARNING, logger="erc_contact")
    block = ec.rectangle((0.0, 0.0), (2.0, 7.0), size=1.0)
    ec.adapt(prototype_block(), block, accuracy=0.05)
    held = ec.Scene(
        STEEL, [ec.Displacement("bottom", (0.0, 0.0))], contacts=[ec.Contact("top", gap=0.1)]
    )
    ec.solve(held, square())  # at rest
    roller = on_floor(contacts=[ec.Contact("bottom", bilateral=True, gap=0.02)])
    ec.solve(roller, square())
    assert not caplog.records


def half_disc_on_a_plane(push):
    """The half disc that touches y = 0 with its lowest point; its top is moved by ``push``."""
    foundation = ec.Contact("arc", normal=(0.0, -1.0), gap=lambda x: 1.0 - ufl.sqrt(1 - x[0] ** 2))
    scene = on_floor(supports=[ec.Displacement("top", (0.0, push))], contacts=[foundation])
    return scene, ec.read_mesh(Path(__file__).parents[2] / "meshes" / "half_disc.geo", scripts=True)


def test_an_arc_that_is_pressed_touches(caplog):
    """Its lowest node is apart by 4% of the displacement, and there is a force."""
    caplog.set_level(logging.WARNING, logger="erc_contact")
    solution = ec.solve(*half_disc_on_a_plane(-0.01), ec.Nitsche(), degree=2)
    assert solution.force("arc").force[1] > 1e-3
    assert not caplog.records


@pytest.mark.parametrize("solver", ["direct", "iterative"])
@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()], ids=str)
def test_an_arc_that_is_pulled_off_does_not(method, solver, warnings):
    """What a solver leaves of its multiplier is no force."""
    ec.solve(*half_disc_on_a_plane(0.01), method, degree=2, solver=solver)
    assert len(warnings(of="Nothing touches the contact 'arc'")) == 1


@pytest.mark.parametrize(
    ("d", "method", "degree"),
    [(2, ec.Nitsche(), 1), pytest.param(3, ec.AugmentedLagrangian(), 2, marks=pytest.mark.broad)],
)
def test_a_round_foundation_may_touch_between_nodes(d, method, degree, warnings):
    """The middle of the bottom is in the middle of a facet, or of two."""
    brick = ec.rectangle if d == 2 else ec.box
    domain = brick((-1.0,) * (d - 1) + (0.0,), (1.0,) * d, cells=(3,) * (d - 1) + (2,))
    along = range(d - 1)
    floor = ec.Contact("bottom", gap=lambda x: 0.5 * sum(x[i] ** 2 for i in along))
    scene = on_floor(
        supports=[ec.Displacement("top", (0.0,) * (d - 1) + (-0.03,))], contacts=[floor]
    )
    assert ec.solve(scene, domain, method, degree=degree).force("bottom").force[-1] > 1e-3
    assert not warnings(of="Nothing touches") or COMM.rank > 0


def test_doubts_in_space(warnings):
    cube = ec.box((0.0,) * 3, (1.0,) * 3, cells=(2, 2, 2))
    ec.solve(
        on_floor(supports=[ec.Displacement("top", (0.3, 0.3, -0.3))]),
        cube,
        ec.AugmentedLagrangian(),
    )
    assert len(warnings(of="of the body rotates")) == 1
    assert logs.log_of(COMM).disabled == (COMM.rank > 0)
