"""Points that a deck holds: their reactions follow from balance, or pads stand for them."""

import logging

import numpy as np
import pytest
from calculix_boxes import box, rows

import erc_contact as ec

CUBE = """*NODE, NSET=Nall
1, 0, 0, 0
2, 10, 0, 0
3, 10, 10, 0
4, 0, 10, 0
5, 0, 0, 10
6, 10, 0, 10
7, 10, 10, 10
8, 0, 10, 10
*ELEMENT, TYPE=C3D8, ELSET=E
1, 1, 2, 3, 4, 5, 6, 7, 8
*MATERIAL, NAME=M
*ELASTIC
1000., 0.3
*SOLID SECTION, ELSET=E, MATERIAL=M
"""
THREE_TWO_ONE = "*BOUNDARY\n1, 1, 3\n2, 2, 3\n4, 3, 3\n"


def strip(columns, *, thickness="1.", rows=1):
    """A strip of unit squares as cells of plane stress."""
    nodes = []
    cells = []
    across = columns + 1
    for j in range(rows + 1):
        nodes += [f"{1 + i + j * across}, {i}, {j}" for i in range(across)]
    for j in range(rows):
        for i in range(columns):
            a = 1 + i + j * across
            cells.append(f"{1 + i + j * columns}, {a}, {a + 1}, {a + 1 + across}, {a + across}")
    return (
        "*NODE\n"
        + "\n".join(nodes)
        + "\n*ELEMENT, TYPE=CPS4, ELSET=E\n"
        + "\n".join(cells)
        + "\n*MATERIAL, NAME=M\n*ELASTIC\n1000., 0.\n"
        + f"*SOLID SECTION, ELSET=E, MATERIAL=M\n{thickness}\n"
    )


@pytest.fixture
def read(tmp_path):
    """Function that reads a deck from text."""

    def read_text(text):
        path = tmp_path / "job.inp"
        path.write_text(text)
        return ec.read_deck(path)

    return read_text


def total_force(deck):
    """Sum of the tractions of a scene; their mean is their value in the middle of a part."""
    parts = deck.domain.parts()
    total = np.zeros(3)
    size = 0.0
    for load in deck.scene.loads:
        row = parts["name"].index(load.facets)
        middle = np.array(parts["centre"][row])
        values = [value(middle) if callable(value) else value for value in load.value]
        force = parts["area"][row] * np.array(values)
        total += force
        size += abs(force).max()
    return total, size


@pytest.mark.parametrize("seed", range(4))
def test_reactions_of_three_points_balance_any_forces(seed, read):
    """The solver refuses loads whose moments are out of balance, too."""
    forces = np.random.default_rng(seed).normal(size=(4, 3))
    lines = [f"{5 + i}, {k + 1}, {forces[i, k]:.9f}" for i in range(4) for k in range(3)]
    step = "*STEP\n*STATIC\n*CLOAD\n" + "\n".join(lines) + "\n*END STEP\n"
    deck = read(CUBE + THREE_TWO_ONE + step)
    assert any("follow from balance" in note.words for note in deck.assumed)
    assert not deck.scene.supports
    total, size = total_force(deck)
    assert abs(total).max() < 1e-6 * size
    if seed == 0:
        assert np.isfinite(ec.solve(deck.scene, deck.domain).at((5.0, 5.0, 5.0)).displacement).all()


def test_points_without_reactions_leave_no_loads(read):
    pulls = "*STEP\n*STATIC\n*DLOAD\nE, P1, -1.\nE, P2, -1.\n*END STEP\n"
    deck = read(CUBE + THREE_TWO_ONE + pulls)
    assert len(deck.scene.loads) == 2
    assert not any("follow from balance" in note.words for note in deck.assumed)


def test_a_beam_on_three_points_has_pads(read):
    """Two spans of length l under q: the middle carries 5/4 q l."""
    held = "*BOUNDARY\n1, 1, 2\n11, 2, 2\n21, 2, 2\n"
    top = "\n".join(f"{20 + i}, P3, 1." for i in range(1, 21))
    deck = read(strip(20, rows=2) + held + f"*STEP\n*STATIC\n*DLOAD\n{top}\n*END STEP\n")
    assert any("a rigid pad" in note.words for note in deck.assumed)
    solution = ec.solve(deck.scene, deck.domain, degree=2)
    carried = [solution.force(f"pad {node}").force[1] for node in (1, 11, 21)]
    assert sum(carried) == pytest.approx(20.0, rel=1e-9)
    assert carried[0] == pytest.approx(carried[2], rel=0.1)
    assert carried[1] == pytest.approx(1.25 * 10.0, rel=0.05)


def test_points_at_both_ends_of_a_bar_are_redundant(read):
    """They hold the same motion, and a strain: balance does not tell their forces."""
    held = "*BOUNDARY\n1, 1, 2\n21, 1, 2\n"
    deck = read(strip(20, rows=2) + held + "*STEP\n*STATIC\n*DLOAD\n30, P3, 1.\n*END STEP\n")
    assert not any("follow from balance" in note.words for note in deck.assumed)
    assert len(deck.scene.supports) == 2


def test_points_whose_pads_are_large_are_refused(read):
    held = "*BOUNDARY\n1, 1, 3\n2, 1, 3\n4, 3, 3\n"
    with pytest.raises(ec.InputError, match="held as points, which carry no force"):
        read(CUBE + held + "*STEP\n*STATIC\n*DLOAD\nE, P2, 1.\n*END STEP\n")


@pytest.mark.parametrize("seed", range(3))
def test_forces_inside_a_body_keep_their_force_and_moment(seed, read):
    random = np.random.default_rng(seed)
    text = strip(4, rows=2, thickness="2.")
    x, y = 2 + 0.3 * random.uniform(-1, 1), 1 + 0.3 * random.uniform(-1, 1)
    text = text.replace("8, 2, 1\n", f"8, {x}, {y}\n")
    force = random.normal(size=2)
    loads = f"*CLOAD\n8, 1, {force[0]}\n8, 2, {force[1]}\n"
    held = "*NSET, NSET=LEFT\n1, 6, 11\n*BOUNDARY\nLEFT, 1, 2\n"
    deck = read(text + held + "*STEP\n*STATIC\n" + loads + "*END STEP\n")
    assert any("inside the body" in note.words for note in deck.assumed)
    found = ec.solve(deck.scene, deck.domain, degree=2).force("LEFT")
    assert found.force * 2 == pytest.approx(-force, rel=1e-9)
    moment = x * force[1] - y * force[0]
    assert found.moment * 2 == pytest.approx(-moment, rel=1e-9, abs=1e-9)


def test_forces_inside_hexahedra_keep_their_force_and_moment(read):
    """On corners and on middles of edges, in space."""
    x, cells = box("C3D20", (0.0, 0.0, 0.0), (3.0, 2.0, 2.0), (3, 2, 2))
    random = np.random.default_rng(0)
    inside = np.flatnonzero((x > 0).all(axis=1) & (x < (3.0, 2.0, 2.0)).all(axis=1))
    forces = random.normal(size=(len(inside), 3))
    lines = ["*NODE", *(f"{i}, {a}, {b}, {c}" for i, (a, b, c) in enumerate(x.tolist(), 1))]
    lines += ["*ELEMENT, TYPE=C3D20, ELSET=E", *rows(1, cells), "*NSET, NSET=LEFT"]
    lines += [f"{i + 1}," for i in np.flatnonzero(x[:, 0] == 0.0)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", "1000., 0.3", "*SOLID SECTION, ELSET=E, MATERIAL=M"]
    lines += ["*BOUNDARY", "LEFT, 1, 3", "*STEP", "*STATIC", "*CLOAD"]
    for i, force in zip(inside + 1, forces, strict=True):
        lines += [f"{i}, {k}, {value:.15g}" for k, value in enumerate(force, 1)]
    deck = read("\n".join([*lines, "*END STEP", ""]))
    found = ec.solve(deck.scene, deck.domain).force("LEFT")
    assert found.force == pytest.approx(-forces.sum(axis=0), rel=1e-9)
    assert found.moment == pytest.approx(-np.cross(x[inside], forces).sum(axis=0), rel=1e-9)


ROLLER = "*NSET, NSET=LEFT\n1, 22, 43\n*BOUNDARY\nLEFT, 1, 2\n"
"""The left end of a strip of 20 columns and 2 rows is held."""


def test_a_loaded_pad_has_the_force_and_the_moment_of_its_load(read):
    """The middle of an end is held upwards, and pulled: F/(E A) is the strain."""
    step = "*STEP\n*STATIC\n*BOUNDARY\n42, 2, 2\n*CLOAD\n42, 1, 6.\n*END STEP\n"
    deck = read(strip(20, rows=2) + ROLLER + step)
    assert any("on a rigid body" in note.words for note in deck.assumed)
    assert not deck.scene.loads
    solution = ec.solve(deck.scene, deck.domain, degree=2)
    assert solution.at((20.0, 1.0)).displacement[0] == pytest.approx((20 * 3e-3, 0.0), abs=1e-9)
    assert solution.force("LEFT").force == pytest.approx((-6.0, 0.0), abs=1e-9)


def test_pads_follow_what_each_step_holds(read):
    step = "*STEP\n*STATIC\n*BOUNDARY, OP=NEW\nLEFT, 1, 2\n42, {}\n*END STEP\n"
    held = ROLLER.replace("*BOUNDARY\nLEFT, 1, 2\n", "")
    steps = step.format("2, 2, 0.1") + step.format("2, 2, 0.3") + step.format("1, 1, 0.2")
    deck = read(strip(20, rows=2) + held + steps)

    def motions(t):
        (pad,) = [s for s in deck.scene_at(t).supports if isinstance(s, ec.Rigid)]
        return pad.displacement

    assert motions(1.0) == pytest.approx((None, 0.1))
    assert motions(1.5) == pytest.approx((None, 0.2))
    assert motions(2.0) == pytest.approx((None, 0.3))
    assert motions(3.0) == pytest.approx((0.2, None))


def test_nodes_of_a_rigid_body_without_a_face_are_a_flat_pad(read):
    """The two corners of an end: the end, not the sides around the corners."""
    rigid = "*NODE\n99, 20., 1.\n*NSET, NSET=CORNERS\n21, 63\n"
    rigid += "*RIGID BODY, NSET=CORNERS, REF NODE=99\n"
    step = "*STEP\n*STATIC\n*CLOAD\n99, 2, 1.\n*END STEP\n"
    deck = read(strip(20, rows=2) + rigid + ROLLER + step)
    parts = deck.domain.parts()
    assert parts["area"][parts["name"].index("CORNERS")] == pytest.approx(2.0)
    (pad,) = [s for s in deck.scene.supports if isinstance(s, ec.Rigid)]
    assert pad.force == (0.0, 1.0)


def test_a_circle_of_a_ring_is_held_as_a_band(read):
    text = strip(20, rows=2).replace("CPS4", "CAX4")
    for node in (1, 22, 43):
        text = text.replace(f"\n{node}, 0, ", f"\n{node}, 0.5, ")
    held = "*NSET, NSET=FOOT, GENERATE\n1, 21\n*BOUNDARY\nFOOT, 2, 2\n43, 1, 1, 0.01\n"
    deck = read(text + held + "*STEP\n*STATIC\n*END STEP\n")
    (band,) = [s for s in deck.scene.supports if s.facets == "band 43"]
    assert band.value == (0.01, None)
    parts = deck.domain.parts()
    assert parts["area"][parts["name"].index("band 43")] == pytest.approx(1.0)


def test_plane_stress_of_two_thicknesses_is_two_springs(read):
    """A strip of two squares, twice as thick in the second: u = F/E (1/t + 1/2t)."""
    text = strip(2).replace(
        "*SOLID SECTION, ELSET=E, MATERIAL=M\n1.\n",
        "*ELSET, ELSET=A\n1\n*ELSET, ELSET=B\n2\n"
        "*SOLID SECTION, ELSET=A, MATERIAL=M\n0.5\n*SOLID SECTION, ELSET=B, MATERIAL=M\n1.\n",
    )
    step = "*STEP\n*STATIC\n*DLOAD\n2, P2, -3.\n*END STEP\n"
    deck = read(text + "*BOUNDARY\n1, 1, 2\n4, 1, 2\n" + step)
    pulled = ec.solve(deck.scene, deck.domain, degree=2).at((2.0, 0.5)).displacement[0, 0]
    assert pulled == pytest.approx(3.0 * 1.0 / 1000.0 * (1 / 0.5 + 1 / 1.0), rel=1e-9)


def test_large_rotations_under_nlgeom_are_told(read, caplog):
    """A force whose deflection is as great as the strip is long."""
    caplog.set_level(logging.WARNING, logger="erc_contact")
    step = "*STEP, NLGEOM\n*STATIC\n*DLOAD\n8, P2, 0.\n8, P3, 1.\n*END STEP\n"
    deck = read(strip(8) + "*BOUNDARY\n1, 1, 2\n10, 1, 2\n" + step)
    assert any("NLGEOM" in note.words for note in deck.assumed)
    solution = ec.solve(deck.scene, deck.domain, degree=2)
    if solution.model.space.comm.rank == 0:
        assert "rotates by more than" in caplog.text
