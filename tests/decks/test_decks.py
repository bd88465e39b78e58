"""Decks in the dialects of FreeCAD, PrePoMax and Abaqus are whole models.

Each is solved, and a number is compared with a closed form.
"""

from pathlib import Path

import numpy as np
import pytest

import erc_contact as ec

HERE = Path(__file__).parent
NAMES = sorted(path.name for path in HERE.glob("*.inp"))
UNIAXIAL = 1e-8
"""Deviation of a state that elements of degree 2 have exactly [-]."""


def solved(name, **options):
    """Deck and solution of degree 2."""
    deck = ec.read_deck(HERE / name, **options)
    return deck, ec.solve(deck.scene, deck.domain, degree=2)


def moved(solution, *place):
    """Displacement at a point."""
    return np.asarray(solution.at(place).displacement)[0]


def test_all_decks_are_taken_and_tell_all_cards():
    assert len(NAMES) >= 10
    for name in NAMES:
        deck = ec.read_deck(HERE / name)
        text = (HERE / name).read_text().upper()
        told = {note.card for note in [*deck.left_out, *deck.assumed]} | set(deck.taken)
        for line in text.splitlines():
            if line.startswith("*") and not line.startswith("**"):
                assert line.split(",")[0].strip() in told, (name, line)
        assert name in str(deck)


def test_consistent_forces_pull_a_column():
    """The nodal forces of C3D10 are of a uniform traction of 100."""
    deck, solution = solved("freecad_column.inp")
    (load,) = deck.scene.loads
    assert np.allclose(load.value, (0.0, 0.0, 100.0))
    strain = 100.0 / 210e3
    expected = (-0.3 * strain * 10, -0.3 * strain * 10, strain * 40)
    assert moved(solution, 10.0, 10.0, 40.0) == pytest.approx(expected, rel=UNIAXIAL)


def test_pressure_on_faces_of_elements_and_crlf():
    _, solution = solved("freecad_pressure.inp")
    assert moved(solution, 5.0, 5.0, 20.0)[2] == pytest.approx(-5.0 * 20 / 70000, rel=UNIAXIAL)


@pytest.mark.broad
@pytest.mark.parametrize(("penalty", "layer"), [("hard", 0.0), ("kept", 1e-6)])
def test_contact_of_two_materials(penalty, layer):
    deck, solution = solved("freecad_contact.inp", penalty=penalty)
    assert deck.domain.pairs == (("DEPConstraintContact", "INDConstraintContact"),)
    assert list(deck.domain.regions) == ["MaterialSolid", "MaterialSolid001"]
    assert deck.scene.contacts[0].friction == 0.3
    compliance = 10 / 200e3 + 20 / 50e3 + layer
    assert moved(solution, 5.0, 5.0, 30.0)[2] == pytest.approx(-8.0 * compliance, rel=1e-6)
    assert solution.force("INDConstraintContact").force[2] == pytest.approx(-800.0, rel=1e-6)


def test_a_tie_of_meshes_that_do_not_match():
    deck, solution = solved("freecad_tie.inp")
    assert len(deck.scene.ties) == 1
    assert moved(solution, 5.0, 5.0, 20.0)[2] == pytest.approx(4.0 * 20 / 1000, rel=UNIAXIAL)


def test_plane_stress_with_a_thickness():
    deck, solution = solved("prepomax_strip.inp")
    assert deck.scene.material.hypothesis == "plane stress"
    assert any("thickness" in note.words for note in deck.assumed)
    expected = (2000 / (10 * 2) / 200e3 * 40, -0.3 * 2000 / (10 * 2) / 200e3 * 10)
    assert moved(solution, 40.0, 10.0) == pytest.approx(expected, rel=UNIAXIAL)


def test_a_tube_under_inner_pressure():
    deck, solution = solved("prepomax_tube.inp")
    assert "Bore" in deck.domain.names
    factor = 60 * 10**2 / (20**2 - 10**2) * 1.3 / 210e3
    lame = factor * (0.4 * 10 + 20**2 / 10)
    assert moved(solution, 10.0, 2.0)[0] == pytest.approx(lame, rel=5e-4)


def test_a_column_under_its_weight():
    _, solution = solved("prepomax_weight.inp")
    sunk = 2.4e-9 * 9810 * 2000**2 / (2 * 30000)
    assert moved(solution, 50.0, 50.0, 2000.0)[2] == pytest.approx(-sunk, rel=UNIAXIAL)


def test_heat_between_two_walls():
    _, solution = solved("prepomax_heat.inp")
    history = ec.constitutive_error(ec.equilibrate(solution))
    force = 210e3 * 1.2e-5 * 100 * 100
    assert history.reactions()["Wall-1"].force[0] == pytest.approx(force, rel=UNIAXIAL)


def test_a_bolt_is_preloaded():
    deck, solution = solved("prepomax_bolt.inp")
    assert deck.scene.ties[0].force == 20000.0
    stretched = 20000 / 100 / 200e3 * 5
    assert moved(solution, 5.0, 5.0, 5.0)[2] == pytest.approx(stretched, rel=1e-6)
    assert moved(solution, 5.0, 5.0, 35.0)[2] == pytest.approx(-stretched, rel=1e-6)


def test_a_rigid_plate_on_a_column():
    _, solution = solved("prepomax_plate.inp")
    sunk = 80000 / 400 * 40 / 100e3
    assert solution.motion("Head").displacement[2] == pytest.approx(-sunk, rel=UNIAXIAL)


def test_instances_of_a_part_in_contact():
    deck, solution = solved("abaqus_press.inp")
    assert list(deck.domain.regions) == ["Lower", "Upper"]
    assert solution.force("Bottom").force[1] == pytest.approx(10 * 1000 * 0.04 / 20, rel=1e-6)


def test_steps_are_a_history():
    """A block is pressed and pushed: at the end friction is at its bound."""
    deck = ec.read_deck(HERE / "prepomax_slide.inp")
    assert deck.times == [1.0, 2.0]
    assert deck.scene_at(0.5).supports[1].value == (0.0, pytest.approx(-0.05))
    assert deck.scene_at(1.5).supports[1].value == pytest.approx((0.5, -0.1))
    evolution = ec.evolve(deck.scene_at, deck.domain, deck.times, accuracy=0.9, degree=2)
    shear, normal = evolution.force("Slave")[-1]
    assert shear / normal == pytest.approx(-0.25, rel=1e-6)


def test_the_deck_is_the_scene_written_by_hand():
    deck, solution = solved("abaqus_press.inp")
    lower = ec.rectangle((0.0, 0.0), (10.0, 10.0), cells=(2, 2))
    upper = ec.rectangle((0.0, 10.0), (10.0, 20.0), cells=(2, 2))
    bodies = ec.assembly({"lower": lower, "upper": upper}).joined("upper bottom", "lower top")
    scene = ec.Scene(
        ec.Elastic(1000.0, 0.0),
        [
            ec.Displacement("lower bottom", (0.0, 0.0)),
            ec.Displacement("upper top", (0.0, -0.04)),
        ],
        contacts=ec.Contact("upper bottom", against="lower top", friction=0.2),
    )
    by_hand = ec.solve(scene, bodies, degree=2)
    for place in ((3.0, 4.0), (7.0, 16.0)):
        assert moved(solution, *place) == pytest.approx(moved(by_hand, *place), abs=1e-12)
    assert deck.scene.contacts[0].law.friction == scene.contacts[0].law.friction


def test_a_beam_on_two_lines_of_nodes():
    """Pads are hinges: a beam with shear on two supports deflects so.

    The load q = 3 is on a length a = 4 in the middle of the span l = 16, and I = 2.
    """
    _, solution = solved("prepomax_bending.inp")
    span, part, EI, G, area = 16.0, 4.0, 1000 * 2.0, 1000 / 2.6, 6.0
    force = 3.0 * part
    bent = force * (8 * span**3 - 4 * span * part**2 + part**3) / (384 * EI)
    sheared = 1.2 * force * (span - part / 2) / (4 * G * area)
    sunk = moved(solution, 10.0, 1.5, 1.0)[2]
    assert sunk == pytest.approx(-(bent + sheared), rel=0.1)
    for pad in ("pad 35", "pad 51"):
        assert pad in solution.model.space.domain.names
        assert solution.force(pad).force[2] == pytest.approx(force / 2, rel=1e-6)
