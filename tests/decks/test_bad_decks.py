"""What a deck says and a scene cannot is told by its line, and nothing is passed over."""

from pathlib import Path

import numpy as np
import pytest

import erc_contact as ec

HERE = Path(__file__).parent
BASE = (HERE / "freecad_pressure.inp").read_text()
MODEL = "*SOLID SECTION, ELSET=MaterialSolidSolid"
STEP = "*NODE FILE"
OPPOSITE = ("1,P1,5.0", "3,P2,5.0")
"""The pressure on the foot that is in balance with the pressure on the head."""


def read(folder, text, **options):
    """Read a deck from its text."""
    path = folder / "job.inp"
    path.write_text(text)
    return ec.read_deck(path, **options)


def with_card(card, before=STEP):
    """The base deck with a card more."""
    return BASE.replace(before, f"{card}\n{before}", 1)


@pytest.mark.parametrize(
    ("card", "before", "words"),
    [
        ("*EQUATION\n2\n1,1,1.,2,1,-1.", MODEL, "give the symmetry as a support"),
        ("*FROBNICATE", MODEL, "not known"),
        ("*PLASTIC\n100.,0.\n120.,0.1\n110.,0.2", MODEL, "the stress falls from 120 to 110"),
        (
            "*PLASTIC, HARDENING=KINEMATIC\n100.,0.\n120.,0.1\n130.,0.2",
            MODEL,
            "kinematic hardening is linear",
        ),
        ("*ELASTIC, TYPE=ANISO\n1.,2.", MODEL, "TYPE=ANISO"),
        ("*ELASTIC, TYPE=ORTHO\n1.,2.", MODEL, "it has 2 numbers"),
        (
            "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n1.,1.,1.,4.,.3,.3,1.,1.\n1.",
            MODEL,
            "no positive energy",
        ),
        ("*FREQUENCY\n5", STEP, "statics is solved"),
        ("*DLOAD\n1,P9,2.", STEP, "no face of a solid"),
        ("*DLOAD\nEall,GRAV,9.81,0.,0.,-1.", STEP, "no *DENSITY"),
        ("*BOUNDARY\nNowhere,1,3", STEP, "no node or set 'Nowhere'"),
        (
            "*BOUNDARY\n5,1,3,0.1\n6,1,3,0.1\n7,1,3,0.1\n8,1,3,0.1",
            STEP,
            "nodes 5, 6, 7, 8 are held",
        ),
        ("*CLOAD\n99999,1,3.", STEP, "no node or set '99999'"),
        ("*CONTACT PAIR, INTERACTION=I\nA,B", MODEL, "no surface is called 'A'"),
        ("*DLOAD, AMPLITUDE=Gone\nEall,P1,2.", STEP, "no *AMPLITUDE is called 'Gone'"),
        ("*ELEMENT, TYPE=SPRING2\n900, 1, 2", MODEL, "SPRING2 are no solids"),
    ],
)
def test_cards_that_are_refused_say_why_and_where(card, before, words, tmp_path):
    text = with_card(card, before)
    with pytest.raises(ec.InputError, match="cards that cannot be taken") as caught:
        read(tmp_path, text)
    keyword = card.split("\n")[0].split(",")[0]
    lines = text.splitlines()
    number = max(i for i, line in enumerate(lines, start=1) if line == card.split("\n")[0])
    assert words in str(caught.value)
    if "CONTACT PAIR" not in card:
        assert f"{keyword} (job.inp:{number})" in str(caught.value)


def test_all_refused_cards_are_told_at_once(tmp_path):
    text = with_card("*EQUATION\n1\n1,1,1.\n*MPC\nPLANE,1,2,3", MODEL)
    with pytest.raises(ec.InputError) as caught:
        read(tmp_path, text)
    assert "2 cards" in str(caught.value)
    assert "without=['*EQUATION', '*MPC']" in str(caught.value)
    deck = read(tmp_path, text, without=["*equation", "*MPC"])
    assert {"*EQUATION", "*MPC"} <= {note.card for note in deck.left_out}


def test_elements_are_left_out_by_their_type(tmp_path):
    text = with_card("*ELEMENT, TYPE=SPRING2\n900, 1, 2", MODEL)
    deck = read(tmp_path, text, without=["*ELEMENT, TYPE=SPRING2"])
    assert deck.domain.cells == 12


def test_elements_without_a_section(tmp_path):
    with pytest.raises(ec.InputError, match=r"12 elements have no \*SOLID SECTION"):
        read(tmp_path, BASE, without=["*SOLID SECTION"])


def test_points_that_stop_rigid_motions_are_left_out(tmp_path):
    """Opposite pressures need no support; three nodes may stop the rigid motions."""
    text = BASE.replace(
        "ConstraintFixed,1\nConstraintFixed,2\nConstraintFixed,3", "1,1,3\n2,2,3\n3,3"
    )
    assert text != BASE
    assert len(read(tmp_path, text).scene.loads) > 1
    pushed = text.replace("*DLOAD\n", "*DLOAD\n" + "\n".join(OPPOSITE) + "\n")
    deck = read(tmp_path, pushed)
    assert any("stop rigid motions alone" in note.words for note in deck.assumed)
    assert not deck.scene.supports
    assert {load.pressure for load in deck.scene.loads} == {5.0}
    solution = ec.solve(deck.scene, deck.domain, degree=2)
    ends = solution.at([(5.0, 5.0, 0.0), (5.0, 5.0, 20.0)]).displacement[:, 2]
    assert np.isclose(ends[1] - ends[0], -5.0 * 20 / 70000)


def test_dialects_of_text(tmp_path):
    """Continued lines, small letters, blanks, includes in includes, UTF-8 and UTF-16."""
    (tmp_path / "material.inc").write_text(
        "*material,\nname=Stähl\n*elastic\n 7.D4, 0.\n*INCLUDE, INPUT=section.inc\n", "utf-8"
    )
    (tmp_path / "section.inc").write_text(
        '*SolidSection,elset = MaterialSolidSolid ,\n material="Stähl"\n', "utf-8"
    )
    begin = BASE.index("*MATERIAL")
    end = BASE.index("\n", BASE.index(MODEL)) + 1
    text = BASE[:begin] + "*include, input=material.inc\n" + BASE[end:]
    plain = read(tmp_path, BASE)
    deck = read(tmp_path, text)
    assert deck.scene.material == plain.scene.material
    (tmp_path / "job.inp").write_text(text, "utf-16")
    assert ec.read_deck(tmp_path / "job.inp").scene.material == plain.scene.material


def test_wrong_arguments(tmp_path):
    with pytest.raises(ec.InputError, match="does not exist"):
        ec.read_deck(tmp_path / "none.inp")
    with pytest.raises(ec.InputError, match="penalty"):
        read(tmp_path, BASE, penalty="soft")
    with pytest.raises(ec.InputError, match="the path is 3"):
        ec.read_deck(3)


def test_a_force_at_a_node_keeps_force_and_moment(tmp_path):
    text = BASE.replace("*DLOAD", "*CLOAD\n12,1,30.\n*DLOAD")
    deck = read(tmp_path, text)
    assert any("acts on the faces around it" in note.words for note in deck.assumed)
    solution = ec.solve(deck.scene, deck.domain)
    force = solution.force("ConstraintFixed").force
    assert np.allclose(force, (-30.0, 0.0, 500.0), atol=1e-8)
