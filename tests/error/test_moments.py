"""Intervals of moments and of rotations: closed forms with their signs, and equilibrium.

Loads on components that a support leaves free are part of its force and of its moment.
"""

import numpy as np
import pytest
from domains import refused
from scenes import certified, flat_block

import erc_contact as ec

SLACK = 1e-6
"""Width of an interval that is a number, over the number."""


def is_number(bounds: ec.Bounds, exact: float, slack: float = SLACK) -> None:
    assert bounds.guaranteed
    assert bounds.low - slack * abs(exact) <= exact <= bounds.high + slack * abs(exact)
    assert bounds.high - bounds.low < 2 * slack * abs(exact)


def moment_about(force: ec.results.Force, point: tuple[float, ...]) -> np.ndarray:
    """A force's moment about a point, from that about the origin."""
    moved = np.cross([*point, 0.0][:3], [*force.force, 0.0][:3])
    return force.moment - (moved[2:] if len(point) == 2 else moved)


def test_beam_in_pure_bending():
    """Its end turns by ``12 M L/E``, counterclockwise as the moment; the wall holds -M."""
    M = 0.001
    end = ec.Rigid("right", (None, 0.0), force=(0.0, None), moment=M)
    wall = ec.Displacement("left", (0.0, None))
    error = certified(ec.Scene(ec.Elastic(1.0, 0.0), [wall, end]), flat_block(2, 2), degree=2)
    is_number(ec.interval(error, ec.Rotation("right")), 24 * M)
    is_number(ec.interval(error, ec.Moment("left")), -M)
    # A force of the wall would show the point; there is none.
    is_number(ec.interval(error, ec.Moment("left", about=(1.0, 5.0))), -M)
    refused(lambda: ec.interval(error, ec.Moment("right")), "given", "Rotation")


def test_moment_in_space_that_loads_dictate():
    """The force t on a face at r has the moment ``r x t``; a support holds the opposite."""
    box = ec.box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), cells=(1, 1, 1))
    load = ec.Traction("right", (0.3, 0.5, 0.7))
    held = ec.Displacement("bottom", (0.0, 0.0, 0.0))
    error = certified(ec.Scene(ec.Elastic(100.0, 0.3), held, load), box)
    axis = np.array([1.0, -2.0, 0.5])
    about = np.array([0.2, 0.1, -0.4])
    r = np.array([1.0, 1.0, 1.5]) - about
    exact = -axis @ np.cross(r, 6.0 * np.array(load.value))
    is_number(ec.interval(error, ec.Moment("bottom", about=about, axis=axis)), exact, 1e-4)
    refused(lambda: ec.interval(error, ec.Moment("bottom")), "axis in 3D")


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("rigid", [False, True])
def test_moments_hold_those_of_a_fine_mesh(rigid):
    """On a press that turns, a loaded roller, and the contact, about any point."""
    turned = ec.Displacement("top", (None, lambda x: -0.01 + 0.005 * (x[0] - 1.0)))
    if rigid:
        turned = ec.Rigid("top", (0.0, None), rotation=0.005, force=(None, -0.02))
    supports = [turned]
    loads = [ec.Traction("right", (0.0, 0.01))]
    parts = ["top", "bottom"]
    if not rigid:
        supports.append(ec.Displacement("left", (0.0, None)))
        loads.append(ec.Traction("left", (0.0, 0.003)))
        parts.append("left")
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, loads, ec.Contact("bottom"))
    fine = certified(scene, flat_block(2, 2).refined().refined().refined(), degree=2)
    error = certified(scene, flat_block(2, 2).refined(), degree=2)
    about = (-1.0, 3.0)
    for part in parts:
        exact = moment_about(fine.force(part), about)[0]
        bounds = ec.interval(error, ec.Moment(part, about=about))
        assert bounds.guaranteed
        assert bounds.low < exact < bounds.high, part
        assert bounds.high - bounds.low < 0.003, part
    if not rigid:
        # The support has no force along y; the load has.
        is_number(ec.interval(error, ec.Resultant("left", (0.0, 1.0))), 0.003, 1e-5)


def test_what_is_no_moment():
    scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.0, -0.01)))
    error = certified(scene, flat_block(2, 2))
    refused(lambda: ec.interval(error, ec.Moment("top", axis=(0, 0, 1))), "leave axis out")
    refused(lambda: ec.interval(error, ec.Moment("top", about=(0, 0, 1))), "3 numbers", "2D")
    refused(lambda: ec.interval(error, ec.Rotation("top")), "no rigid face", "'top'")
    refused(lambda: ec.Moment("top", about="centre"), "Moment('top'): about")
