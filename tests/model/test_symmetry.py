"""Planes of symmetry of any inclination: the same as rollers, in words, and times their copies."""

import numpy as np
import pytest
from scenes import certified

import erc_contact as ec
from erc_contact.base.code import code_of
from erc_contact.scene.words import in_words


def half(d, degree, symmetry, turned=0.0):
    """The half of a block that is pressed on its foundation."""
    if d == 2:
        body = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3))
        down = (0.0, -0.01)
        roller = ec.Displacement("left", (0.0, None))
        others = []
    else:
        body = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 2))
        down = (0.0, 0.0, -0.01)
        roller = ec.Displacement("left", (0.0, None, None))
        others = (
            [ec.Symmetry("front")] if symmetry else [ec.Displacement("front", (None, 0.0, None))]
        )
    plane = ec.Symmetry("left") if symmetry else roller
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        supports=[plane, *others, ec.Displacement("top", (None,) * (d - 1) + (-0.01,))],
        loads=ec.Traction("right", down),
        contacts=ec.Contact("bottom", friction=ec.Tresca(0.002)),
    )
    return certified(scene, body, degree=degree)


@pytest.mark.on_ranks("2-2", "3-1")
@pytest.mark.parametrize(
    ("d", "degree"), [(2, 1), (2, 2), pytest.param(3, 1, marks=pytest.mark.broad)]
)
def test_it_is_a_roller(d, degree):
    plane = half(d, degree, symmetry=True)
    roller = half(d, degree, symmetry=False)
    assert plane.relative == pytest.approx(roller.relative, rel=0.03)
    if degree == 2:
        there = roller.force("left").force
        assert plane.force("left").force == pytest.approx(there, abs=6e-5)
    assert abs(plane.force("left").force[1:]).max() < 1e-15
    assert (
        abs(
            plane.at(np.full((1, d), 0.5)).displacement
            - roller.at(np.full((1, d), 0.5)).displacement
        ).max()
        < 2e-4
    )
    copies = 2 if d == 2 else 4
    whole = ec.results.whole_force(plane, "bottom")
    up = plane.force("bottom").force[-1]
    assert whole.force == pytest.approx([0.0] * (d - 1) + [copies * up], abs=1e-14)
    if d == 3:
        assert whole.moment == pytest.approx([0.0] * 3, abs=1e-13)
    with pytest.raises(ec.InputError, match="no Symmetry"):
        ec.results.whole_force(roller, "bottom")


def test_moments_of_copies_off_the_origin():
    """A body right of x = 2: the copy pulls at the mirrored place."""
    body = ec.rectangle((2.0, 0.0), (3.0, 1.0), cells=(2, 2))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        supports=[ec.Symmetry("left"), ec.Displacement("bottom", (None, 0.0))],
        loads=ec.Traction("right", (0.3, -0.1)),
    )
    error = certified(scene, body)
    whole = ec.results.whole_force(error, "right")
    assert whole.force == pytest.approx([0.0, -0.2], abs=1e-13)
    assert whole.moment == pytest.approx([-0.1 * 3.0 - 0.3 * 0.5 - 0.1 * 1.0 + 0.3 * 0.5])


def test_it_stands_among_supports_or_contacts():
    material = ec.Elastic(1.0, 0.3)
    held = ec.Displacement("top", (None, 0.0))
    first = ec.Scene(material, supports=[ec.Symmetry("left"), held])
    second = ec.Scene(material, supports=held, contacts=ec.Symmetry("left"))
    assert first == second
    assert ec.Scene(material, supports=ec.Symmetry("left")).contacts == first.contacts
    assert ("left", "plane of symmetry") in in_words(first)
    assert code_of(first.contacts[0]) == "ec.Symmetry(facets='left')"
    with pytest.raises(ec.InputError, match="left"):
        ec.Scene(material, [ec.Symmetry("left"), ec.Displacement("left", (0.0, None))])


@pytest.mark.serial
def test_a_picture_draws_it_without_foundation(tmp_path):
    error = half(2, 1, symmetry=True)
    axes = ec.output.draw_deformed(error, tmp_path / "half.png")
    assert "plane of symmetry" in axes.get_title()
    assert "closed contact" in axes.get_title()
