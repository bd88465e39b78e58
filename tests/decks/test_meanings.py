"""What single cards mean, on a column of two hexahedra of 10 x 10 x 10."""

import numpy as np
import pytest

import erc_contact as ec
from erc_contact.base.code import code_of
from erc_contact.decks.distances import DrawnDistance

E, NU = 1000.0, 0.0
MESH = """*NODE, NSET=Nall
1, 0, 0, 0
2, 10, 0, 0
3, 10, 10, 0
4, 0, 10, 0
5, 0, 0, 10
6, 10, 0, 10
7, 10, 10, 10
8, 0, 10, 10
9, 0, 0, 20
10, 10, 0, 20
11, 10, 10, 20
12, 0, 10, 20
20, 5, 5, 20
21, 5, 5, 20
*ELEMENT, TYPE=C3D8, ELSET=Lower
1, 1, 2, 3, 4, 5, 6, 7, 8
*ELEMENT, TYPE=C3D8, ELSET=Upper
2, 5, 6, 7, 8, 9, 10, 11, 12
*ELSET, ELSET=Eall
Lower, Upper
*NSET, NSET=Foot, GENERATE
1, 4, 1
*NSET, NSET=Head, GENERATE
9, 12
*SURFACE, NAME=Top
2, S2
*MATERIAL, NAME=M
*ELASTIC
1000., 0.
"""
SECTION = "*SOLID SECTION, ELSET=Eall, MATERIAL=M\n"


def step(cards, heading="*STEP", static="*STATIC"):
    """The text of a step."""
    return f"{heading}\n{static}\n{cards}\n*END STEP\n"


FIXED = "*BOUNDARY\nFoot, 1, 3\n"


@pytest.fixture
def read(tmp_path):
    """Function that reads a deck from text after its mesh."""

    def read_text(text, section=SECTION, **options):
        path = tmp_path / "job.inp"
        path.write_text(MESH + section + text)
        return ec.read_deck(path, **options)

    return read_text


def risen(deck, t=None):
    """Rise of the top."""
    scene = deck.scene if t is None else deck.scene_at(t)
    return ec.solve(scene, deck.domain, degree=2).at((5.0, 5.0, 20.0)).displacement[0, 2]


def test_loads_ramp_hold_and_are_replaced(read):
    pulls = [step(FIXED + "*DSLOAD\nTop, P, -10."), step("*DSLOAD\nTop, P, -30.")]
    deck = read("".join(pulls) + step("*DSLOAD, OP=NEW"))
    found = [risen(deck, t) for t in (0.5, 1.0, 1.5, 2.0, 2.5)]
    assert np.allclose(found, [0.1, 0.2, 0.4, 0.6, 0.3])
    assert not deck.scene.loads
    assert deck.times == [1.0, 2.0, 3.0]


def test_forces_on_nodes_are_replaced_too(read):
    one = step(FIXED + "*CLOAD\nHead, 3, 250.")
    deck = read(one + step("*CLOAD\n9, 3, 500.\n10, 3, 500.\n11, 3, 500.\n12, 3, 500."))
    assert np.allclose([risen(deck, 1.0), risen(deck, 2.0)], [0.2, 0.4])
    with pytest.raises(ec.InputError, match="a part of what"):
        read(one + step("*CLOAD\n9, 3, 500."))


def test_amplitudes_jumps_and_periods(read):
    table = "*AMPLITUDE, NAME=A\n0., 0., 1., 2., 4., 0.\n"
    deck = read(
        table + step(FIXED + "*DSLOAD, AMPLITUDE=A\nTop, P, -10.", static="*STATIC\n1., 4.")
    )
    assert deck.times == [4.0]
    assert np.allclose([risen(deck, 1.0), risen(deck, 2.5)], [0.4, 0.2])
    deck = read(step(FIXED + "*DSLOAD\nTop, P, -10.", "*STEP, AMPLITUDE=STEP"))
    assert np.isclose(risen(deck, 0.5), 0.2)


def test_supports_end_with_op_new(read):
    held = step(FIXED + "Head, 3, 3, 0.5")
    freed = step("*BOUNDARY, OP=NEW\nFoot, 1, 3\n*DSLOAD\nTop, P, -10.")
    deck = read(held + freed)
    assert np.isclose(risen(deck, 1.0), 0.5)
    assert np.isclose(risen(deck, 2.0), 0.2)


def test_prescribed_values_that_are_linear(read):
    lines = "9, 3, 3, 0.\n10, 3, 3, 0.1\n11, 3, 3, 0.1\n12, 3, 3, 0.\n"
    deck = read(step(FIXED + lines))
    value = deck.scene.supports[-1].value[2]
    assert np.isclose(value(np.array([5.0, 5.0, 20.0])), 0.05)


def test_weight_of_regions_of_their_own(read):
    light = "*DENSITY\n1.\n*MATERIAL, NAME=HEAVY\n*ELASTIC\n1000., 0.\n*DENSITY\n3.\n"
    sections = (
        "*SOLID SECTION, ELSET=Lower, MATERIAL=M\n*SOLID SECTION, ELSET=Upper, MATERIAL=HEAVY\n"
    )
    deck = read(step(FIXED + "*DLOAD\nEall, GRAV, 0.1, 0., 0., -1."), light + sections)
    assert {load.region for load in deck.scene.loads} == {"Lower", "Upper"}
    # Stress: 3 at the middle, 4 at the foot; strain integrated along the column.
    assert np.isclose(risen(deck), -(1.5 * 10 + 3.5 * 10) / E)


def test_a_shaft_that_spins(read):
    """Inertia along x from the axis z through (0, 5, 0): stress at x = 0 and rise at 10."""
    density = "*DENSITY\n2.\n"
    side = "*NSET, NSET=Axis\n1, 4, 5, 8, 9, 12\n"
    cards = side + "*BOUNDARY\nAxis, 1, 1\n"
    spun = step(cards + "*DLOAD\nEall, CENTRIF, 0.01, 0., 5., 0., 0., 0., 1.")
    deck = read(spun, density + SECTION)
    far = ec.solve(deck.scene, deck.domain, degree=2).at((10.0, 5.0, 10.0)).displacement[0, 0]
    assert np.isclose(far, 2.0 * 0.01 * 10**3 / (3 * E), rtol=0.05)


def test_a_plane_across_a_local_axis(read):
    """The foot is a plane across the local axis x, which is z."""
    turned = "*TRANSFORM, NSET=Foot, TYPE=R\n0., 0., 1., 1., 0., 0.\n"
    deck = read(turned + step("*BOUNDARY\nFoot, 1, 1\n*DSLOAD\nTop, P, -10."))
    assert deck.scene.supports[0].value == (None, None, 0.0)


def test_temperatures_at_nodes(read):
    heat = "*EXPANSION\n1.E-3\n"
    warm = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNall, 20.\n"
    linear = step(FIXED + "*TEMPERATURE\nFoot, 20.\n5, 30.\n6, 30.\n7, 30.\n8, 30.\nHead, 40.")
    deck = read(warm + linear, heat + SECTION)
    (strain,) = deck.scene.strains
    assert np.isclose(strain.temperature(np.array([0.0, 0.0, 20.0])), 20.0)
    bent = step(FIXED + "*TEMPERATURE\nHead, 40.")
    deck = read(warm + bent, heat + SECTION)
    (strain,) = deck.scene.strains
    places = np.array([[5.0, 5.0, 5.0], [3.0, 2.0, 15.0], [5.0, 5.0, 20.0]])
    assert np.allclose(strain.temperature.interpolated(places), [0.0, 10.0, 20.0])
    assert np.allclose(strain.temperature.interpolated(places[1:2], 2), [2.0])
    # The head is free: it rises by the strain of heat about the axis.
    assert 0.1 < risen(deck) < 0.15


def test_sets_that_later_steps_warm_anew(read):
    """The head is at 40, then at 20 as the foot: no change beside the beginning."""
    heat = "*EXPANSION\n1.E-3\n"
    warm = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNall, 20.\n"
    deck = read(
        warm + step(FIXED + "*TEMPERATURE\nNall, 40.") + step("*TEMPERATURE\nHead, 20."),
        heat + SECTION,
    )
    changes = []
    for t, place in ((1.0, 20.0), (2.0, 20.0), (2.0, 0.0)):
        at = np.array([[5.0, 5.0, place]])
        total = 0.0
        for strain in deck.scene_at(t).strains:
            value = strain.temperature
            is_table = hasattr(value, "interpolated")
            number = value(at[0]) if callable(value) and not is_table else value
            total += value.interpolated(at)[0] if is_table else number
        changes.append(total)
    assert np.allclose(changes, [20.0, 0.0, 20.0])


def test_temperatures_in_the_middles_of_edges(tmp_path):
    """A field that is quadratic in an element is taken as it is, and moduli follow it."""
    corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)]
    middles = [(2.0, 0.0), (4.0, 1.0), (2.0, 2.0), (0.0, 1.0)]
    nodes = np.array(corners + middles)
    warm = 100.0 + nodes[:, 0] ** 2 - nodes[:, 0] * nodes[:, 1]
    lines = [f"{i + 1}, {x}, {y}" for i, (x, y) in enumerate(nodes)]
    heat = [f"{i + 1}, {value}" for i, value in enumerate(warm)]
    text = (
        "*NODE\n" + "\n".join(lines) + "\n*ELEMENT, TYPE=CPE8, ELSET=E\n1, 1, 2, 3, 4, 5, 6, 7, 8\n"
        "*MATERIAL, NAME=M\n*ELASTIC\n2000., 0.3, 0.\n1000., 0.3, 1000.\n"
        "*EXPANSION, ZERO=50.\n1.E-5, 0.\n2.E-5, 1000.\n*SOLID SECTION, ELSET=E, MATERIAL=M\n"
        "*BOUNDARY\n1, 1, 2\n4, 1, 2\n8, 1, 2\n*STEP\n*STATIC\n*TEMPERATURE\n"
    )
    path = tmp_path / "job.inp"
    path.write_text(text + "\n".join(heat) + "\n*END STEP\n")
    scene = ec.read_deck(path).scene
    at = np.array([[1.0, 0.5], [3.0, 1.5], [2.5, 0.2]])
    now = 100.0 + at[:, 0] ** 2 - at[:, 0] * at[:, 1]
    assert np.allclose(scene.material.E.interpolated(at), 2000.0 - now)
    (strain,) = scene.strains
    mean = strain.alpha.interpolated(nodes)
    found = mean * strain.temperature.interpolated(nodes)
    # From T = 0, as nothing else is said.
    expected = (1e-5 + 1e-8 * warm) * (warm - 50.0) + 1e-5 * 50.0
    assert np.allclose(found, expected)


def test_a_stress_before_all_steps(read):
    """The upper half is compressed by 10, and free: it is longer by 10 h/E."""
    before = "*INITIAL CONDITIONS, TYPE=STRESS\n2, 1, 0., 0., -10., 0., 0., 0.\n"
    deck = read(before + step(FIXED))
    assert list(deck.domain.regions) == ["Lower", "Upper"]
    assert np.isclose(risen(deck), 10.0 * 10 / E)
    uneven = before + "2, 2, 0., 0., -20., 0., 0., 0.\n"
    with pytest.raises(ec.InputError, match="varies inside element 2"):
        read(uneven + step(FIXED))


def test_a_plastic_strain_before_all_steps(read):
    """The upper half is longer by the strain, free of stress."""
    before = "*INITIAL CONDITIONS, TYPE=PLASTIC STRAIN\n2, 1, 0., 0., 0.001, 0., 0., 0.\n"
    deck = read(before + step(FIXED))
    assert list(deck.domain.regions) == ["Lower", "Upper"]
    assert np.isclose(risen(deck), 0.001 * 10)
    stress = before.replace("PLASTIC STRAIN", "STRESS")
    with pytest.raises(ec.InputError, match="has a tensor of element 2, too"):
        read(before + stress + step(FIXED))


def test_drawn_distances_have_a_sign_and_a_slope():
    """Of a plane z = 1 over a tilted plane below it, which overlaps it at x > 2."""
    square = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)])
    above = np.column_stack([square, np.ones(4)])
    below = np.column_stack([square, 0.5 * square[:, 0]])
    halves = [[0, 1, 2], [0, 2, 3]]
    # Outward: the upper body looks down, and the lower body looks up.
    distance = DrawnDistance(above[halves][:, ::-1], below[halves])
    places = np.array([(1.0, 1.0, 1.0), (3.0, 0.5, 1.0), (2.0, 3.0, 1.0)])
    cosine = 2 / np.sqrt(5)
    assert np.allclose(distance.interpolated(places), cosine * (1.0 - 0.5 * places[:, 0]))
    assert np.allclose(distance.interpolated(places, 0), -0.5 * cosine)
    on_lower = places * [1, 1, 0] + np.outer(0.5 * places[:, 0], [0, 0, 1])
    assert np.allclose(distance.interpolated(on_lower), 1.0 - 0.5 * places[:, 0])


def test_a_shared_force_and_a_moment(read):
    coupled = "*COUPLING, REF NODE=20, SURFACE=Top, CONSTRAINT NAME=C\n*DISTRIBUTING\n1, 3\n"
    deck = read(coupled + step(FIXED + "*CLOAD\n20, 3, 1000.\n20, 4, 2000."))
    solution = ec.solve(deck.scene, deck.domain, degree=2)
    force = solution.force("Foot")
    assert np.allclose(force.force, (0.0, 0.0, -1000.0), atol=1e-8)
    about_axis = np.array(force.moment) - np.cross((5.0, 5.0, 0.0), force.force)
    assert np.allclose(about_axis, (-2000.0, 0.0, 0.0), atol=1e-6)


def test_nodes_that_share_a_force_by_weights(read):
    """The place of the node does not matter; one corner of the head has a weight of 2."""
    shared = "*ELEMENT, TYPE=DCOUP3D, ELSET=C\n99, 20\n"
    shared += "*DISTRIBUTING COUPLING, ELSET=C\n9, 2.\n10, 1.\n11, 1.\n12, 1.\n"
    deck = read(shared + step(FIXED + "*CLOAD\n20, 1, 500."))
    (load,) = deck.scene.loads
    assert isinstance(load, ec.RemoteForce)
    corners = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)])
    assert np.allclose(load.at[:2], np.average(corners, axis=0, weights=[2, 1, 1, 1]))
    assert load.force == (500.0, 0.0, 0.0)


def test_a_coupled_face_moves_as_its_node(read):
    coupled = "*COUPLING, REF NODE=20, SURFACE=Top, CONSTRAINT NAME=C\n*KINEMATIC\n1, 6\n"
    deck = read(coupled + step(FIXED + "*BOUNDARY\n20, 1, 2\n20, 4, 6\n*CLOAD\n20, 3, 1000."))
    assert np.isclose(risen(deck), 0.2)


@pytest.mark.parametrize(("normal", "sign"), [("", 1), ("0., 0., 1.", 1), ("0., 0., -1.", -1)])
def test_the_sign_of_a_pretension(normal, sign, read):
    """A positive force along the outward normal of the elements of the cut is tension."""
    cut = f"*SURFACE, NAME=Cut\n1, S2\n*PRE-TENSION SECTION, SURFACE=Cut, NODE=21\n{normal}\n"
    deck = read(cut + step(FIXED + "Head, 1, 3\n*CLOAD\n21, 1, 500."))
    assert deck.scene.ties[0].force == sign * 500.0
    assert list(deck.domain.regions) == ["Lower", "Upper"]


def test_a_bolt_that_is_fixed_keeps_its_shortening(read):
    """The head is pulled up by 0.1: the strain of both steps adds up."""
    cut = "*SURFACE, NAME=Cut\n1, S2\n*PRE-TENSION SECTION, SURFACE=Cut, NODE=21\n"
    drawn = step(FIXED + "Head, 1, 3\n*CLOAD\n21, 1, 500.")
    pulled = step("*BOUNDARY, FIXED\n21, 1, 1\n*BOUNDARY\nHead, 3, 3, 0.1")
    deck = read(cut + drawn + pulled)
    assert deck.scene.ties[0].locked
    history = ec.evolve(deck.scene_at, deck.domain, deck.times, accuracy=0.9)
    found = [error.force("Head").force[2] for error in history.errors]
    assert np.allclose(found, (500.0, 500.0 + 100 * E * 0.1 / 20), rtol=1e-6)


def test_a_face_that_is_fixed_stays_where_a_step_has_left_it(read):
    """The head is pushed by a force, held there, and pushed no more: the stress stays."""
    pushed = step(FIXED + "*DSLOAD\nTop, P, 5.")
    stays = step("*BOUNDARY, FIXED\nHead, 1, 3\n*DSLOAD, OP=NEW")
    deck = read(pushed + stays)
    sunk = -20 * 5.0 / E
    assert any("stays where the solution" in note.words for note in deck.assumed)
    for t in (1.0, 1.5, 2.0):
        solution = ec.solve(deck.scene_at(t), deck.domain, degree=2)
        assert np.isclose(solution.at((5.0, 5.0, 20.0)).displacement[0, 2], sunk, rtol=1e-9)
        assert np.isclose(solution.force("Foot").force[2], 500.0, rtol=1e-9)
    with pytest.raises(ec.InputError, match="no step before has reached"):
        read(stays + pushed)
    with pytest.raises(ec.InputError, match="depends on its way"):
        read(pushed + stays, "*PLASTIC\n5., 0.\n15., 0.1\n" + SECTION)


@pytest.mark.broad
def test_plasticity_with_linear_hardening(read):
    plastic = "*PLASTIC\n5., 0.\n15., 0.1\n"
    deck = read(step("*BOUNDARY\nFoot, 3, 3\n*DSLOAD\nTop, P, -10."), plastic + SECTION)
    assert deck.scene.material.hardening == 100.0
    assert np.isclose(risen(deck), 20 * (10 / E + 5 / 100), rtol=1e-6)


@pytest.mark.broad
def test_plasticity_with_a_curve(read):
    plastic = "*PLASTIC\n5., 0.\n8., 0.01\n15., 0.1\n"
    deck = read(step("*BOUNDARY\nFoot, 3, 3\n*DSLOAD\nTop, P, -10."), plastic + SECTION)
    assert deck.scene.material.hardening == ec.HardeningCurve([0.0, 0.01, 0.1], [5.0, 8.0, 15.0])
    plastic_strain = 0.01 + 0.09 * 2 / 7
    assert np.isclose(risen(deck), 20 * (10 / E + plastic_strain), rtol=1e-6)


def test_a_layer_of_elements_that_is_held_across(read):
    """All nodes are held along y: both planes across y are."""
    deck = read(step("*BOUNDARY\nNall, 2, 2\nFoot, 3, 3\n*DSLOAD\nTop, P, -10."))
    held = [support for support in deck.scene.supports if support.value[1] == 0.0]
    (part,) = {support.facets for support in held}
    normals = deck.domain.parts()
    assert np.isclose(normals["area"][normals["name"].index(part)], 400.0)


def test_the_scene_of_a_deck_is_written_as_code(read):
    """Its code, as reports show it, makes the same scene."""
    heat = "*EXPANSION\n1.E-3\n"
    deck = read(step(FIXED + "*CLOAD\n9, 3, 10.\n*TEMPERATURE\nHead, 40."), heat + SECTION)
    scene = eval(code_of(deck.scene), {"ec": ec})
    by_code = ec.solve(scene, deck.domain).at((3.0, 4.0, 15.0)).displacement
    by_deck = ec.solve(deck.scene, deck.domain).at((3.0, 4.0, 15.0)).displacement
    assert np.allclose(by_code, by_deck, rtol=1e-12)


ORTHOTROPIC = """*MATERIAL, NAME=O
*ELASTIC, TYPE=ENGINEERING CONSTANTS
1000., 500., 250., 0.2, 0.1, 0.3, 300., 200.,
100.
*ORIENTATION, NAME=TURNED
0., 0., 1., 1., 0., 0.
"""


@pytest.mark.broad
@pytest.mark.parametrize(("axes", "modulus"), [("", 250.0), (", ORIENTATION=turned", 1000.0)])
def test_orthotropic_moduli_in_axes(read, axes, modulus):
    """The first axis of the orientation is z, the second one x; the column has no friction."""
    section = f"{ORTHOTROPIC}*SOLID SECTION, ELSET=Eall, MATERIAL=O{axes}\n"
    held = "*BOUNDARY\nFoot, 3, 3\n1, 1, 2\n2, 2, 2\n*DSLOAD\nTop, P, -10.\n"
    assert np.isclose(risen(read(step(held), section)), 10.0 * 20.0 / modulus)


def test_the_stiffness_of_an_orthotropic_material(read):
    law = ec.OrthotropicElastic((1000.0, 500.0, 250.0), (0.2, 0.1, 0.3), (300.0, 200.0, 100.0))
    S = np.diag([1 / modulus for modulus in law.E])
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), law.nu, strict=True):
        S[i, j] = S[j, i] = -ratio / law.E[i]
    D = np.linalg.inv(S)
    normal = [D[0, 0], D[0, 1], D[1, 1], D[0, 2], D[1, 2], D[2, 2]]
    entries = ", ".join(f"{entry:.12g}" for entry in [*normal, *law.G[:2]])
    cards = f"*MATERIAL, NAME=O\n*ELASTIC, TYPE=ORTHO\n{entries},\n{law.G[2]}, 294.\n"
    section = f"{cards}*SOLID SECTION, ELSET=Eall, MATERIAL=O\n"
    found = read(step(FIXED + "*DSLOAD\nTop, P, -10."), section).scene.material
    assert pytest.approx(law.E) == found.E
    assert found.nu == pytest.approx(law.nu)
    assert found.G == law.G


@pytest.mark.parametrize(
    ("card", "words"),
    [
        ("*ORIENTATION, NAME=Other\n1., 0., 0., 0., 1., 0.", "is called 'A'"),
        ("*ORIENTATION, NAME=A, SYSTEM=CYLINDRICAL\n0., 0., 0., 0., 0., 1.", "rectangular axes"),
        ("*ORIENTATION, NAME=A\n1., 0., 0., 0., 1., 0.\n3, 30.", "second line"),
    ],
)
def test_axes_that_are_refused(read, card, words):
    section = f"{ORTHOTROPIC}{card}\n*SOLID SECTION, ELSET=Eall, MATERIAL=O, ORIENTATION=A\n"
    with pytest.raises(ec.InputError, match=words):
        read(step(FIXED), section)
