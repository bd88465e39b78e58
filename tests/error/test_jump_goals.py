"""Goals of the slip and the opening of a contact.

- Intervals hold the means of fine meshes: on foundations and between bodies, in the
  plane, in 3D and of rings, of both degrees, by both methods, without friction, with
  Tresca friction and Coulomb's; open, closed, sticking, on curved sides, in cracks.
- Only Coulomb's are estimates. Names of the sides change the sign at most.
- What the contact bears is told: a closed contact has a narrow opening.
- The report says where eps is no error of the slip.
- Ends are the same on one to three ranks; bad input is told.
"""

from functools import cache

import numpy as np
import pytest
from domains import partly_broad, refused
from mpi4py import MPI
from scenes import flat_block, measured, mostly_serial
from test_cracks import cracked, plate

import erc_contact as ec
from erc_contact.error.slip_share import small_slips

COMM = MPI.COMM_WORLD
METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]
LAWS = {"none": 0.0, "given": ec.Tresca(0.002), "Coulomb": 0.3}
RINGS = ec.Elastic(1.0, 0.3, hypothesis="axisymmetric")


def mean(error, part, name):
    """The mean of a column of the profile."""
    table = error.profile(part)
    return table["weight"] @ table[name] / table["weight"].sum()


def assert_inside(coarse, fine, goals, *, proved=True):
    """Intervals hold the means of a fine mesh; goals -> (part, column, sign)."""
    for goal, (part, name, sign) in goals.items():
        bounds = ec.interval(coarse, goal)
        exact = sign * mean(fine, part, name)
        assert bounds.low - 1e-12 <= exact <= bounds.high + 1e-12, goal
        assert bounds.guaranteed == proved, goal


def lifted(d, friction):
    """A block that is pressed on its left and lifted on its right."""
    supports = [
        ec.Displacement("left", (0.0, *(None,) * (d - 1))),
        ec.Displacement("top", (*(None,) * (d - 1), -0.01)),
    ]
    if d == 3:
        supports.append(ec.Displacement("front", (None, 0.0, None)))
    lift = ec.Traction("right", (*(0.0,) * (d - 1), 0.02))
    return ec.Scene(ec.Elastic(1.0, 0.3), supports, lift, ec.Contact("bottom", friction=friction))


@cache
def fine_block(law):
    return measured(lifted(2, LAWS[law]), flat_block(2, 16), degree=2)


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.on_ranks("given-1-method1")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1]))
@pytest.mark.parametrize("law", LAWS)
def test_on_a_foundation(law, degree, method):
    coarse = measured(lifted(2, LAWS[law]), flat_block(2, 4 // degree), method, degree)
    goals = {
        ec.Slip("bottom", (1.0, 0.0)): ("bottom", "slip", 1.0),
        ec.Opening("bottom"): ("bottom", "gap", 1.0),
    }
    assert_inside(coarse, fine_block(law), goals, proved=law != "Coulomb")
    tangent = ec.interval(coarse, ec.Slip("bottom"))
    along = ec.interval(coarse, ec.Slip("bottom", (2.0, 3.0)))
    assert (along.low, along.high) == pytest.approx((2 * tangent.low, 2 * tangent.high), rel=1e-3)


@cache
def fine_in_space():
    return measured(lifted(3, LAWS["given"]), flat_block(3, 4))


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("method", METHODS)
def test_in_space(method, degree):
    scene = lifted(3, LAWS["given"])
    coarse = measured(scene, flat_block(3, 3 - degree), method, degree)
    fine = fine_in_space()
    bounds = ec.interval(coarse, ec.Slip("bottom", (1.0, 0.0, 0.0)))
    assert bounds.guaranteed
    # The slip is nearly along x; the profile has its length.
    assert bounds.low <= mean(fine, "bottom", "slip") <= bounds.high
    opening = ec.interval(coarse, ec.Opening("bottom"))
    assert opening.low <= mean(fine, "bottom", "gap") <= opening.high


def ring(cells):
    return ec.rectangle((0.5, 0.0), (1.5, 1.0), cells=(cells, cells))


def foot():
    """A ring on a foundation that falls away from it outwards."""
    top = ec.Displacement("top", (None, -0.02))
    contact = ec.Contact("bottom", friction=LAWS["given"], gap=lambda x: 0.02 * x[0])
    return ec.Scene(RINGS, top, contacts=contact)


@cache
def fine_ring():
    return measured(foot(), ring(16), degree=2)


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.on_ranks("1-method1")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1]))
def test_of_rings(degree, method):
    """Means are over rings; a homogeneous state is met."""
    top = ec.Displacement("top", (None, -0.02))
    free = ec.Scene(RINGS, top, contacts=ec.Contact("bottom"))
    bounds = ec.interval(measured(free, ring(3), method, degree), ec.Slip("bottom", (1.0, 0.0)))
    # u_r = 0.3 * 0.02 r, and the mean of r over the ring is 13/12.
    assert (bounds.low, bounds.high) == pytest.approx((0.0065, 0.0065), abs=1e-9)
    goals = {
        ec.Slip("bottom", (1.0, 0.0)): ("bottom", "slip", 1.0),
        ec.Opening("bottom"): ("bottom", "gap", 1.0),
    }
    assert_inside(measured(foot(), ring(4), method, degree), fine_ring(), goals)


def stack(cells, friction, *, upper_first):
    """A block that is pressed and pushed on another one, which is held."""
    upper = ec.rectangle((0.5, 1.0), (1.5, 2.0), cells=(cells, cells))
    lower = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2 * cells, cells))
    domain = ec.assembly({"upper": upper, "lower": lower}).joined("upper bottom", "lower top")
    sides = ("upper bottom", "lower top") if upper_first else ("lower top", "upper bottom")
    supports = [
        ec.Displacement("upper top", (0.006, -0.01)),
        ec.Displacement("lower bottom", (0, 0)),
    ]
    contact = ec.Contact(sides[0], against=sides[1], friction=friction)
    return ec.Scene(ec.Elastic({"upper": 1.0, "lower": 3.0}, 0.3), supports, [], contact), domain


@cache
def fine_stack(law):
    return measured(*stack(12, LAWS[law], upper_first=True), degree=2)


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.on_ranks("given-1-method1")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1]))
@pytest.mark.parametrize("law", LAWS)
def test_between_bodies(law, degree, method):
    """Of either side, in either order: Nitsche's method tests the softer body."""
    fine = fine_stack(law)
    widths = []
    for upper_first in (True, False):
        scene, domain = stack(4 // degree, LAWS[law], upper_first=upper_first)
        coarse = measured(scene, domain, method, degree)
        goals = {
            ec.Slip("upper bottom", (1.0, 0.0)): ("upper bottom", "slip", 1.0),
            ec.Slip("lower top", (1.0, 0.0)): ("upper bottom", "slip", -1.0),
            ec.Slip("lower top"): ("upper bottom", "slip", 1.0),
            ec.Opening("lower top"): ("upper bottom", "gap", 1.0),
        }
        assert_inside(coarse, fine, goals, proved=law != "Coulomb")
        widths.append(ec.interval(coarse, ec.Slip("upper bottom")).relative)
    assert widths[0] == pytest.approx(widths[1], rel=1e-3)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("material", [ec.Elastic(1.0, 0.3), RINGS], ids=["plane", "rings"])
def test_a_contact_that_sticks_and_stays_closed(material, method):
    """The forces of a goal are borne by the contact: no displacement, but a stress."""
    held = ec.Displacement("top", (None, -0.02))
    error = measured(
        ec.Scene(material, held, contacts=ec.Contact("bottom", friction=ec.Tresca(0.1))),
        ring(4),
        method,
    )
    opening = ec.interval(error, ec.Opening("bottom"))
    slip = ec.interval(error, ec.Slip("bottom"))
    assert opening.low == 0.0 <= opening.high < 5e-4
    assert slip.low <= 0.0 <= slip.high
    assert slip.high - slip.low < 5e-4


def test_a_foundation_that_moves():
    """Slip counts against it."""
    bounds = []
    for motion, top in (((0.02, 0.0), (0.0, -0.01)), (None, (-0.02, -0.01))):
        foot = ec.Contact("bottom", friction=LAWS["given"], motion=motion)
        scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", top), contacts=foot)
        error = measured(scene, flat_block(2, 4))
        bounds.append(ec.interval(error, ec.Slip("bottom", (1.0, 0.0))))
        slip = mean(measured(scene, flat_block(2, 12)), "bottom", "slip")
        assert bounds[-1].low < slip < bounds[-1].high < -0.01
    assert bounds[0].value == pytest.approx(bounds[1].value, rel=0.02)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("load", [-1.0, 1.0], ids=["closed", "open"])
@pytest.mark.parametrize("method", METHODS)
def test_a_crack(method, load):
    domain = plate(4.0, 2.0, 0.4)
    scene = cracked(ec.Tresca(0.1), load=load)
    coarse = measured(scene, domain, method, 2)
    fine = measured(scene, domain.refined().refined(), degree=2)
    goals = {
        ec.Slip("upper lip"): ("upper lip", "slip", 1.0),
        ec.Slip("lower lip", (1.0, 1.0)): ("upper lip", "slip", -np.sqrt(2.0)),
        ec.Opening("upper lip"): ("upper lip", "gap", 1.0),
    }
    assert_inside(coarse, fine, goals)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS)
def test_normals_that_are_given(method):
    """Opening is along them: on a slope the gap is vertical."""
    contact = ec.Contact("bottom", normal=(0.6, -0.8), gap=lambda x: 0.004 + 0.01 * x[0])
    supports = [ec.Displacement("top", (0.0, -0.03))]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=contact)
    coarse = measured(scene, flat_block(2, 4), method)
    fine = measured(scene, flat_block(2, 16), degree=2)
    assert_inside(coarse, fine, {ec.Opening("bottom"): ("bottom", "gap", 1.0)})
    turning = ec.Contact("bottom", normal=lambda x: (0.2 * x[0], -1.0), gap=0.004)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, contacts=turning)
    coarse = measured(scene, flat_block(2, 4), method)
    fine = measured(scene, flat_block(2, 16), degree=2)
    goals = {
        ec.Opening("bottom"): ("bottom", "gap", 1.0),
        ec.Slip("bottom"): ("bottom", "slip", 1.0),
    }
    assert_inside(coarse, fine, goals, proved=False)


@pytest.mark.broad
def test_a_run_aims_at_a_slip():
    """It ends where half of the interval is below the accuracy."""
    history = ec.adapt(
        lifted(2, LAWS["given"]), flat_block(2, 2), 0.05, goal=ec.Slip("bottom"), degree=2
    )
    bounds = history.bounds
    assert history.reached
    assert bounds.relative <= 0.05
    assert bounds.low <= mean(fine_block("given"), "bottom", "slip") <= bounds.high


@pytest.mark.broad
@pytest.mark.serial
def test_the_report_tells_a_slip_that_eps_does_not_know(tmp_path):
    """A crack in a large plate: eps is small, and the slip far off."""
    domain = plate(10.0, 2.0, 0.3)
    history = ec.adapt(cracked(ec.Tresca(0.1)), domain, 0.02, degree=2)
    fine = measured(cracked(ec.Tresca(0.1)), domain.refined().refined(), degree=2)
    off = 1 - mean(history.best, "upper lip", "slip") / mean(fine, "upper lip", "slip")
    share = small_slips(history.best)["upper lip"]
    assert off > 3 * history.best.relative > 3 * share
    # The energy of a shear crack, over the energy of the plate under a pressure of 1.
    energy = np.pi * (1 - 0.3**2) * (0.5 - 0.1) ** 2 / 1000.0
    assert share == pytest.approx(energy / (0.5 * 400.0 * (1 - 0.3**2) / 1000.0), rel=0.3)
    history.save(tmp_path / "by eps", pictures=False)
    told = (tmp_path / "by eps" / "report.html").read_text()
    assert "goal=ec.Slip(&#x27;upper lip&#x27;)" in told
    aimed = ec.adapt(cracked(ec.Tresca(0.1)), domain, 0.1, degree=2, goal=ec.Slip("upper lip"))
    aimed.save(tmp_path / "by slip", pictures=False)
    assert (
        "ec.Slip(&#x27;upper lip&#x27;) aims"
        not in (tmp_path / "by slip" / "report.html").read_text()
    )


def test_no_such_words_where_the_slip_is_known():
    """Of a block that slides, of rings, where nothing slips, on a plane of symmetry."""
    assert not small_slips(fine_block("given"))
    pressed_ring = ec.Displacement("top", (None, -0.02))
    for friction in (0.0, ec.Tresca(1.0)):
        foot = ec.Contact("bottom", friction=friction)
        assert not small_slips(measured(ec.Scene(RINGS, pressed_ring, contacts=foot), ring(4)))
    sides = [ec.Displacement("top", (None, -0.02)), ec.Symmetry("left")]
    foot = ec.Contact("bottom", friction=ec.Tresca(1.0))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), sides, contacts=foot)
    assert not small_slips(measured(scene, flat_block(2, 4)))


@pytest.mark.ranks
@pytest.mark.parametrize("method", partly_broad(METHODS, METHODS[:1]))
def test_ranks(method):
    ends = []
    for comm in (MPI.COMM_SELF, COMM):
        domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(6, 3), comm=comm)
        error = measured(lifted(2, LAWS["given"]), domain, method)
        of_goals = [ec.interval(error, goal) for goal in (ec.Slip("bottom"), ec.Opening("bottom"))]
        ends.append([end for bounds in of_goals for end in (bounds.low, bounds.high)])
    assert ends[0] == pytest.approx(ends[1], rel=1e-7)


def test_bad_input():
    error = measured(lifted(2, 0.0), flat_block(2, 2))

    def asked(goal, error=error):
        return lambda: ec.interval(error, goal)

    refused(asked(ec.Slip("botom")), "botom", "bottom")
    refused(asked(ec.Opening("top")), "top", "bottom")
    refused(asked(ec.Slip("bottom", (1.0, 0.0, 0.0))), "2 finite numbers")
    refused(asked(ec.Slip("bottom", (0.0, 1.0))), "no part along")
    refused(asked(ec.Slip("bottom", (0.0, 0.0))), "not all zero")
    refused(lambda: ec.Slip("bottom", (lambda x: x[0], 0.0)), "Slip('bottom')", "numbers")
    refused(lambda: ec.Slip("bottom", 1.0), "Slip('bottom')")
    refused(lambda: ec.Opening(3), "Opening")
    refused(lambda: ec.adapt(lifted(2, 0.0), flat_block(2, 2), 0.1, goal="slip"), "Slip", "Opening")
    solid = measured(lifted(3, 0.0), flat_block(3, 1))
    refused(asked(ec.Slip("bottom"), solid), "direction in 3D")
    plane = ec.Scene(
        ec.Elastic(1.0, 0.3), [ec.Displacement("top", (0, -0.1)), ec.Symmetry("bottom")]
    )
    refused(asked(ec.Opening("bottom"), measured(plane, flat_block(2, 2))), "does not open")
    soft = ec.Contact("bottom", foundation=ec.Foundation(1.0))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.0, -0.1)), contacts=soft)
    refused(asked(ec.Opening("bottom"), measured(scene, flat_block(2, 2))), "compliant")
    load = ec.Functional(ec.Traction("bottom", (0.0, 1.0)))
    refused(asked(load), "'bottom'", "Contact")


def test_a_body_that_slides_freely_has_no_slip():
    """Nothing holds the body along the foundation; its opening is known."""
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), loads=ec.Traction("top", (0.0, -0.01)), contacts=ec.Contact("bottom")
    )
    error = measured(scene, flat_block(2, 2))
    refused(lambda: ec.interval(error, ec.Slip("bottom")), "nothing holds")
    assert ec.interval(error, ec.Opening("bottom")).high < 1e-6
