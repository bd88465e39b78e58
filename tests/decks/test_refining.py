"""Decks on finer meshes: sets, surfaces and what is prescribed follow.

- weights of old nodes in new ones are a partition of unity, and carry linear values;
- the new deck has the regions, the parts with their areas, the steps and the scene of
  the old one; forces on nodes keep their sum and their moment;
- what cannot follow is refused in words.
"""

from pathlib import Path

import numpy as np
import pytest
from calculix_boxes import two_boxes

import erc_contact as ec
from erc_contact.decks.rewriting import written_anew
from erc_contact.scene.words import in_words
from namedmesh.for_solvers import read_deck_mesh, refined_deck_mesh

HERE = Path(__file__).parent
pytestmark = pytest.mark.serial
NAMES = ["freecad_column", "freecad_contact", "freecad_pressure", "freecad_tie", "prepomax_bolt"]
NAMES += ["prepomax_heat", "prepomax_plate", "prepomax_slide", "prepomax_strip", "blocks"]
"""All decks but those all of whose nodes are held along an axis."""


def refined(path, degree, share=0.6):
    """The mesh of a deck, with sizes that are a share of its own."""
    deck = read_deck_mesh(path)
    volume = deck.measures(np.flatnonzero(deck.outer)).mean()
    size = np.array([share * volume ** (1 / (deck.d - 1))])
    return refined_deck_mesh(deck, deck.x[:1], size, degree=degree, most=100_000)


def deck_of(name, folder):
    path = folder / f"{name}.inp"
    text = two_boxes("C3D20") if name == "blocks" else (HERE / path.name).read_text()
    path.write_text(text)
    return path


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", ["blocks", "prepomax_slide", "freecad_tie"])
def test_weights_carry_linear_values(name, degree, tmp_path):
    finer = refined(deck_of(name, tmp_path), degree)
    d = finer.deck.d
    assert len(finer.cells) > len(finer.deck.simplicial.cells)
    assert abs(finer.weights.sum(axis=1) - 1).max() < 1e-12
    assert abs(finer.weights @ finer.deck.x - finer.x).max() < 1e-10 * np.ptp(finer.x)
    old = finer.old_nodes >= 0
    assert (finer.node_numbers[old] == finer.deck.numbers[finer.old_nodes[old]]).all()
    assert len(np.unique(finer.node_numbers)) == len(finer.x)
    corners = finer.x[finer.cells[:, : d + 1]]
    assert (np.linalg.det(corners[:, 1:] - corners[:, :1]) > 0).all()
    # The sides on each face of the boundary fill it.
    cell, side = finer.sides_on(np.flatnonzero(finer.deck.outer))
    x = finer.x[finer.corners_of_sides(cell, side)]
    if d == 2:
        areas = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    else:
        areas = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2
    filled = np.bincount(finer.faces[cell, side], areas, minlength=len(finer.deck.outer))
    outer = np.flatnonzero(finer.deck.outer)
    whole = finer.deck.measures(outer)
    owners = finer.deck.owners_of_simplices(outer)
    assert np.allclose(filled[outer], np.bincount(owners, whole), rtol=1e-10)


def areas(domain):
    parts = domain.parts()
    return dict(zip(parts["name"], map(float, parts["area"]), strict=True))


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_the_new_deck_is_the_old_one(name, degree, tmp_path):
    path = deck_of(name, tmp_path)
    finer = refined(path, degree)
    new_path = tmp_path / "next.inp"
    new_path.write_text(written_anew(finer))
    old, new = ec.read_deck(path), ec.read_deck(new_path)
    of_mesh = {"*NODE", "*ELEMENT", "*NSET", "*ELSET", "*SURFACE", "*SYSTEM"}
    kept = [
        {word: count for word, count in deck.taken.items() if word not in of_mesh}
        for deck in (old, new)
    ]
    assert kept[0] == kept[1]
    assert new.times == old.times
    assert list(new.domain.regions) == list(old.domain.regions)
    assert areas(new.domain) == pytest.approx(areas(old.domain), rel=1e-6)
    assert [name for name, _ in in_words(new.scene)] == [name for name, _ in in_words(old.scene)]


def force_and_moment(x, forces):
    return np.array([forces.sum(axis=0), np.cross(x, forces).sum(axis=0)])


def forces_of(finer):
    """Places of nodes and the components of their forces in a deck that is written anew."""
    lines = written_anew(finer).splitlines()
    begin = lines.index("*CLOAD") + 1
    rows = [line.split(", ") for line in lines[begin : lines.index("*NODE FILE")]]
    place = dict(zip(finer.node_numbers.tolist(), finer.x, strict=True))
    components = np.zeros((len(rows), 3))
    components[np.arange(len(rows)), [int(row[1]) - 1 for row in rows]] = [
        float(r[2]) for r in rows
    ]
    return np.array([place[int(row[0])] for row in rows]), components


@pytest.mark.parametrize("degree", [1, 2])
def test_forces_on_nodes_keep_their_moment(degree, tmp_path):
    path = tmp_path / "beam.inp"
    text = two_boxes("C3D20").replace("*NODE FILE", "*CLOAD\nROOF, 1, 2.\n61, 2, 5.\n*NODE FILE")
    path.write_text(text)
    finer = refined(path, degree)
    deck = finer.deck
    (space,) = deck.spaces
    known = np.zeros((len(deck.x), 3))
    known[deck.nodes("ROOF", space), 0] = 2.0
    known[deck.nodes("61", space), 1] += 5.0
    expected = force_and_moment(deck.x, known)
    assert np.allclose(force_and_moment(*forces_of(finer)), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("kind", ["R", "C"])
def test_forces_along_local_axes_keep_their_moment(kind, tmp_path):
    """Axes that are turned about z, and radial ones about an axis beside the box."""
    path = tmp_path / "axes.inp"
    line = "0., 1., 0., -1., 0., 0." if kind == "R" else "-3., 0., 0., -3., 0., 1."
    transform = f"*TRANSFORM, NSET=ROOF, TYPE={kind}\n{line}\n*STEP"
    text = two_boxes("C3D8").replace("*STEP", transform)
    path.write_text(text.replace("*NODE FILE", "*CLOAD\nROOF, 1, 2.\nROOF, 3, 1.\n*NODE FILE"))
    finer = refined(path, 1)

    def in_coordinates(x, components):
        first = np.tile([0.0, 1.0, 0.0], (len(x), 1))
        if kind == "C":
            first = (x - np.array([-3.0, 0.0, 0.0])) * (1.0, 1.0, 0.0)
            first /= np.linalg.norm(first, axis=1)[:, None]
        second = np.cross((0.0, 0.0, 1.0), first)
        third = np.tile([0.0, 0.0, 1.0], (len(x), 1))
        return np.einsum("nk,kni->ni", components, np.array([first, second, third]))

    deck = finer.deck
    roof = deck.nodes("ROOF", deck.spaces[0])
    known = in_coordinates(deck.x[roof], np.tile([2.0, 0.0, 1.0], (len(roof), 1)))
    x, components = forces_of(finer)
    found = force_and_moment(x, in_coordinates(x, components))
    assert np.allclose(found, force_and_moment(deck.x[roof], known), rtol=1e-9, atol=1e-9)


def test_what_cannot_follow_is_refused(tmp_path):
    with pytest.raises(ec.InputError, match="parts and instances"):
        written_anew(refined(HERE / "abaqus_press.inp", 1))
    path = tmp_path / "job.inp"
    shared = "*ELEMENT, TYPE=DCOUP3D, ELSET=C\n99, 99\n*NODE\n99, 0., 0., 0.\n"
    shared += "*DISTRIBUTING COUPLING, ELSET=C\nROOF, 1.\n*STEP"
    path.write_text(two_boxes("C3D8").replace("*STEP", shared, 1))
    with pytest.raises(ec.InputError, match="weights of nodes"):
        written_anew(refined(path, 1))
    path.write_text(
        "*NODE\n1, 1, 0\n2, 2, 0\n3, 2, 1\n4, 1, 1\n*ELEMENT, TYPE=CAX4, ELSET=E\n1, 1, 2, 3, 4\n"
        "*MATERIAL, NAME=M\n*ELASTIC\n1., 0.\n*SOLID SECTION, ELSET=E, MATERIAL=M\n"
        "*STEP\n*STATIC\n*CLOAD\n3, 2, 1.\n*END STEP\n"
    )
    with pytest.raises(ec.InputError, match=r"\*CLOAD .*axisymmetric"):
        written_anew(refined(path, 1))
