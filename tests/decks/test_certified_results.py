"""Results of CalculiX, certified, and the decks with finer meshes that follow.

- what the transfer from hexahedra costs is below a tenth of the error, where meshes of
  both bodies do not match;
- the certified intervals have the forces that CalculiX has;
- end to end: CalculiX solves a deck, ``refine`` writes the next one, CalculiX solves
  that, and its error has fallen to what was asked for.
"""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from calculix_boxes import two_boxes
from domains import partly_broad

import erc_contact as ec
from erc_contact.__main__ import main

HERE = Path(__file__).parent
SECONDS = 60
pytestmark = [
    pytest.mark.serial,
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed"),
]


def computed(name):
    """The result of CalculiX for a deck in this folder."""
    subprocess.run(["ccx", name], check=True, capture_output=True, timeout=SECONDS)
    return f"{name}.frd"


def certified(name):
    """The certificate of a result in this folder."""
    deck = ec.read_deck(f"{name}.inp")
    return ec.certify(deck.scene, deck.domain, f"{name}.frd")


@pytest.mark.broad
@pytest.mark.parametrize("kind", ["C3D8", "C3D20", "C3D20R", "C3D10"])
def test_the_transfer_costs_less_than_a_tenth(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("blocks.inp").write_text(two_boxes(kind, (1, 1, 1)))
    computed("blocks")
    certificate = certified("blocks")
    assert certificate.interpolated
    assert 0.0 < certificate.transfer < 0.1 * certificate.absolute
    assert certificate.cause == "the mesh"


DECKS = {"prepomax_weight": 0.02, "prepomax_tube": 0.003, "prepomax_slide": 0.1, "press": 0.05}
"""Decks by their names, and the accuracy that is asked for."""


def text_of(name):
    """The text of a deck; the one of the docs is called "press"."""
    if name != "press":
        return (HERE / f"{name}.inp").read_text()
    page = (HERE.parents[1] / "docs" / "yours" / "decks.md").read_text()
    return re.search(r'write_text\("""\n(.*?)"""\)', page, re.DOTALL).group(1)


@pytest.mark.parametrize("name", partly_broad(DECKS, ["prepomax_weight", "press"]))
def test_end_to_end(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path(f"{name}.inp").write_text(text_of(name))
    result = computed(name)
    before = certified(name)
    accuracy = DECKS[name]
    words = ["refine", f"{name}.inp", result, "--accuracy", str(accuracy), "-o", "next.inp"]
    returned = main(words)
    told = capsys.readouterr().out
    assert told.rstrip().endswith("Deck: next.inp")
    assert returned == (0 if before.cause == "the mesh" else 1)
    computed("next")
    after = certified("next")
    assert after.total < 0.7 * before.total
    assert after.total < 1.5 * accuracy


PLATE = """*NODE
1, 1, 0
2, 2, 0
3, 3, 0
4, 1, 1
5, 2, 1
6, 3, 1
*ELEMENT, TYPE=CPE4, ELSET=E
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*NSET, NSET=FOOT
1, 2, 3
*MATERIAL, NAME=M
*ELASTIC
1000., 0.3
*SOLID SECTION, ELSET=E, MATERIAL=M
0.5
*BOUNDARY
FOOT, 1, 2
*STEP
*STATIC
*DLOAD
1, P3, 1.
2, P3, 1.
*NODE FILE
U, RF
*END STEP
"""


@pytest.mark.parametrize("kind", [pytest.param("CPE4", marks=pytest.mark.broad), "CAX4"])
def test_forces_of_plane_cells_and_rings_are_in_their_intervals(
    kind, tmp_path, monkeypatch, capsys
):
    """Of a thickness of 0.5, and of a whole circle: 2 and 8 pi."""
    monkeypatch.chdir(tmp_path)
    Path("plate.inp").write_text(PLATE.replace("CPE4", kind))
    main(["certify", "plate.inp", computed("plate"), "--accuracy", "0.9"])
    told = capsys.readouterr().out
    letter, force = ("y", 2.0) if kind == "CPE4" else ("z", 8 * np.pi)
    # CalculiX adds the hoop stress of the section to the radial forces of a ring.
    assert f"Forces: 1 of {len(re.findall('^FOOT', told, re.MULTILINE))} are known" in told
    assert "and it is in all of these" in told
    computed_force = re.search(rf"FOOT +{letter} +(\S+)", told)[1]
    assert float(computed_force) == pytest.approx(force, rel=1e-3)


HEAVY = "*DLOAD\nEall, GRAV, 9.81, 0.3, 0., -1.\n"
"""A weight of hexahedra, which a file of CalculiX has among the forces on all nodes."""


@pytest.mark.broad
@pytest.mark.parametrize("weight", ["", HEAVY], ids=["light", "heavy"])
def test_forces_of_hexahedra_are_in_their_intervals(weight, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = (HERE.parents[1] / "meshes" / "calculix" / "hexahedra.inp").read_text()
    text = text.replace("*ELASTIC", "*DENSITY\n0.01\n*ELASTIC", 1)
    Path("block.inp").write_text(text.replace("*NODE FILE\nU\n", f"{weight}*NODE FILE\nU, RF\n"))
    assert main(["certify", "block.inp", computed("block"), "--accuracy", "0.2"]) == 0
    told = capsys.readouterr().out
    assert "6 of 6 are known of block.frd and have an interval, and it is in all of these" in told
    assert "The transfer from its cells to simplices" in told
