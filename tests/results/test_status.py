"""The status of facets is what an engineer reads: where the contact is open, slips, sticks.

- Zones of closed forms are met within a facet: Cattaneo and Mindlin in the plane, on the
  way forward and back, and on a sphere in 3D; the solution and its pair agree.
- A body that slides as a whole slips everywhere, also where friction varies; one that is
  held sticks everywhere, however near to its limit.
- Without friction a facet is closed, and neither slips nor sticks; a tied joint sticks.
"""

from pathlib import Path

import numpy as np
import pytest
from dolfinx.mesh import compute_midpoints
from domains import two_halves
from scenes import pressed

import erc_contact as ec
from erc_contact.results import CLOSED, OPEN, SLIP, STICK, contact_status

MESHES = Path(__file__).parents[2] / "meshes"
MU = 0.3


def refined_at(domain, centre, radius):
    """The domain with the cells refined whose midpoints are in a ball."""
    cells = np.arange(domain.owned_cells, dtype=np.int32)
    x = compute_midpoints(domain.mesh, domain.dim, cells)[:, : domain.dim]
    near = np.linalg.norm(x - centre, axis=1) < radius
    return domain.refined(np.flatnonzero(near).astype(np.int32))


def on_ball(domain, push, friction, radius, nu):
    """A body pressed on a cylinder or a sphere, and pushed along it."""
    d = domain.dim

    def gap(x):
        return sum(x[i] ** 2 for i in range(d - 1)) / (2 * radius)

    way = (push, *[0.0] * (d - 2), -0.05)
    return pressed(ec.Elastic(1.0, nu), way, friction=friction, gap=gap)


def solve(scene, domain, **options):
    return ec.solve(scene, domain, ec.AugmentedLagrangian(), **options)


def share(profile, status):
    """The share of a status in the area of the contact."""
    weight = profile["weight"]
    return weight[profile["status"] == status].sum() / weight.sum()


def area(profile, status):
    return profile["weight"][profile["status"] == status].sum()


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize(("degree", "nu"), [(1, 0.3), (2, 0.4999)])
def test_stick_zone_in_the_plane(degree, nu):
    """Cattaneo and Mindlin: pressed without friction, pushed, and pushed back."""
    radius = 10.0
    facet = 1 / 32
    domain = ec.rectangle((-10.0, 0.0), (10.0, 20.0), cells=(10, 10))
    for size in 2.0 / 2.0 ** np.arange(6):
        domain = refined_at(domain, (0.0, 0.0), max(0.6, 3 * size))
    last = solve(on_ball(domain, 0.0, 0.0, radius, nu), domain, degree=degree)
    pushed = 0.0
    for push in (0.02, 0.0):
        last = solve(on_ball(domain, push, MU, radius, nu), domain, degree=degree, after=last)
        pair = ec.equilibrate(last)
        Q, P = ec.results.force(pair, "bottom").force * (-1, 1)
        # On the way back half of the change of the force counts.
        change = Q if push else (pushed - Q) / 2
        pushed = Q
        a = np.sqrt(4 * P * radius * (1 - nu**2) / np.pi)
        c = a * np.sqrt(1 - change / (MU * P))
        for profile in (ec.results.profile(pair, "bottom"), last.profile("bottom")):
            stuck = area(profile, STICK) / 2
            print(f"\ndegree {degree}, push {push}: stick to {stuck:.4f} for {c:.4f}")
            assert abs(stuck - c) < facet
            sticks = profile["x"][profile["status"] == STICK]
            slips = profile["x"][profile["status"] == SLIP]
            # The square bends, and the contact moves a little.
            centre = (sticks.max() + sticks.min()) / 2
            assert np.ptp(sticks) / 2 < c + facet
            assert abs(slips - centre).min() > c - facet
            assert area(profile, CLOSED) == 0.0


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_stick_zone_in_space(degree):
    """Mindlin: on a sphere the disc sticks whose radius is a (1 - Q/mu P)^(1/3)."""
    nu = 0.3
    domain = ec.read_mesh(MESHES / "dome.geo", scripts=True)
    for radius in (0.5, 0.4)[: 3 - degree]:
        domain = refined_at(domain, (0.0, 0.0, 0.0), radius)
    last = solve(on_ball(domain, 0.0, 0.0, 1.0, nu), domain, degree=degree)
    last = solve(on_ball(domain, 0.012, MU, 1.0, nu), domain, degree=degree, after=last)
    pair = ec.equilibrate(last)
    force = ec.results.force(pair, "bottom").force
    Q, P = -force[0], force[2]
    a = (3 * P * (1 - nu**2) / 4) ** (1 / 3)
    c = a * (1 - Q / (MU * P)) ** (1 / 3)
    here = last.model.contact("bottom").trace.here
    middles = here.corners.mean(axis=1)[:, :2]
    facet = np.sqrt(here.areas[np.linalg.norm(middles, axis=1) < a].max())
    for profile in (ec.results.profile(pair, "bottom"), last.profile("bottom")):
        stuck = np.sqrt(area(profile, STICK) / np.pi)
        near = np.hypot(profile["x"], profile["y"]) < 0.4 * a
        print(f"\ndegree {degree}: stick to {stuck:.4f} for {c:.4f}, facet {facet:.4f}")
        assert abs(stuck - c) < facet
        assert set(profile["status"][near]) == {STICK}
        # Slip bears the force of the ring beyond c.
        force = profile["weight"] * profile["pressure"]
        slips = force[profile["status"] == SLIP].sum() / force.sum()
        assert slips == pytest.approx((1 - (c / a) ** 2) ** 1.5, abs=0.1)


def plate(d):
    cells = (16, 8) if d == 2 else (4, 4, 2)
    size = (2.0, 1.0) if d == 2 else (2.0, 2.0, 1.0)
    return (ec.rectangle if d == 2 else ec.box)((0.0,) * d, size, cells=cells)


@pytest.mark.on_ranks("2-True", "3-False")
@pytest.mark.parametrize("varies", [False, True])
@pytest.mark.parametrize("d", [2, 3])
def test_sliding_blocks_slip_everywhere(d, varies):
    friction = (lambda x: 0.1 + 0.2 * x[0]) if varies else 0.2
    top = ec.Displacement("top", (0.2, *[0.0] * (d - 2), -0.03))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), top, contacts=ec.Contact("bottom", friction=friction))
    pair = ec.equilibrate(solve(scene, plate(d)))
    profile = ec.results.profile(pair, "bottom")
    assert share(profile, STICK) == 0.0
    assert share(profile, SLIP) > 0.7
    owned = pair.model.contact("bottom").trace.here.owned
    status = contact_status(pair, "bottom")[owned]
    counts = pair.model.space.comm.allreduce(np.bincount(status, minlength=4))
    points = np.bincount(profile["status"], minlength=4)
    assert np.array_equal(counts * (points.sum() // counts.sum()), points)


@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
def test_held_blocks_stick_everywhere(d):
    """The shear of a sheared layer is even, at 97% of the bound of an even pressure."""
    sheared = 0.97 * MU * 0.01
    top = ec.Traction("top", (sheared, *[0.0] * (d - 2), -0.01))
    sides = []
    for side in ("left", "right"):
        along = ec.Traction(side, (0.0, *[0.0] * (d - 2), sheared if side == "right" else -sheared))
        sides.append(along)
    scene = ec.Scene(
        ec.Elastic(1.0, 0.0),
        loads=[top, *sides],
        contacts=ec.Contact("bottom", friction=MU),
    )
    pair = ec.equilibrate(solve(scene, plate(d)))
    assert set(contact_status(pair, "bottom")) == {STICK}


@pytest.mark.serial
def test_contacts_without_friction_are_closed():
    contact = ec.Contact("bottom", gap=lambda x: 0.02 * (x[0] - 1.0) ** 2)
    top = ec.Displacement("top", (0.0, -0.01))
    symmetry = ec.Contact("left", bilateral=True)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), top, contacts=[contact, symmetry])
    pair = ec.equilibrate(solve(scene, plate(2)))
    assert set(contact_status(pair, "bottom")) == {OPEN, CLOSED}
    assert set(contact_status(pair, "left")) == {CLOSED}
    assert set(pair.solution.profile("bottom")["status"]) == {OPEN, CLOSED}


@pytest.mark.serial
def test_tied_joints_stick():
    domain = two_halves(plate(2)).split({"above": "upper", "below": "lower"})
    supports = [ec.Displacement("top", (0.1, 0.1)), ec.Displacement("bottom", (0.0, 0.0))]
    joint = ec.Tied("above", against="below")
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, ties=joint)
    pair = ec.equilibrate(solve(scene, domain))
    assert set(contact_status(pair, "above")) == {STICK}
