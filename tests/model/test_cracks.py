"""Contacts that end inside a body: closed cracks, and layers that are bonded in part.

- The slip of an inclined crack under compression is the closed form of a large plate,
  with both methods; the pressure is the remote one.
- Both solvers, both methods, one to three ranks agree; in 3D, too.
- e over the true errors is at least 1 without friction and with Tresca friction; proved
  intervals of two meshes meet.
- An open crack is the body without a contact; a closed one is refined, meshed anew,
  loaded in steps.
- An interference at the end of a crack is refused in words.
"""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from reference import true_errors
from scenes import certified, mostly_serial
from test_split import tagged

import erc_contact as ec
from namedmesh.gmsh_session import session

COMM = MPI.COMM_WORLD
E, NU, MU, PRESSURE = 1000.0, 0.3, 0.3, 1.0
LEAN = np.pi / 4
METHODS = [ec.Nitsche(), ec.AugmentedLagrangian()]


def plate(half_width, size, at_crack):
    """A plate with a crack of half length 1 in its middle, on the line that leans by 45 degrees."""

    def build(gmsh):
        model, occ = gmsh.model, gmsh.model.occ
        square = occ.addRectangle(-half_width, -half_width, 0, 2 * half_width, 2 * half_width)
        c, s = np.cos(LEAN), np.sin(LEAN)
        ends = [occ.addPoint(t * c, t * s, 0) for t in (-3 * half_width, -1, 1, 3 * half_width)]
        lines = [occ.addLine(*ends[i : i + 2]) for i in range(3)]
        _, parts = occ.fragment([(2, square)], [(1, line) for line in lines])
        occ.synchronize()
        for _, tag in parts[0]:
            x, y, _ = occ.getCenterOfMass(2, tag)
            model.addPhysicalGroup(2, [tag], name="up" if y > x else "down")
        crack = [tag for _, tag in parts[2]]
        model.addPhysicalGroup(1, crack, name="crack")
        sides = {"left": (0, -1), "right": (0, 1), "bottom": (1, -1)}
        for name, (axis, sign) in sides.items():
            tags = []
            for _, tag in model.getEntities(1):
                if np.isclose(occ.getCenterOfMass(1, tag)[axis], sign * half_width):
                    tags.append(tag)
            model.addPhysicalGroup(1, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        tips = model.getBoundary([(1, tag) for tag in crack], combined=False, oriented=False)
        model.mesh.setSize(tips, at_crack)

    with session(COMM, build, "The plate") as model:
        whole = ec.from_gmsh(model, COMM)
    return whole.split({"upper lip": "up", "lower lip": "down"}, on="crack")


def cracked(friction=MU, gap=0.0, load=-PRESSURE, **more):
    """The plate under a uniform pressure along x."""
    crack = ec.Contact("upper lip", against="lower lip", friction=friction, gap=gap, **more)
    supports = [ec.Displacement("left", (0.0, None)), ec.Displacement("bottom", (None, 0.0))]
    return ec.Scene(ec.Elastic(E, NU), supports, ec.Traction("right", (load, 0.0)), crack)


@pytest.mark.broad
@pytest.mark.on_ranks("method0")
@pytest.mark.parametrize("method", METHODS)
def test_an_inclined_crack_slips_as_the_closed_form_says(method):
    """In a large plate: 4 (1 - nu^2)/E tau sqrt(1 - s^2), with the shear tau beyond friction."""
    domain = plate(40.0, 8.0, 0.15)
    history = ec.adapt(cracked(), domain, accuracy=0.0005, degree=2, method=method)
    assert history.reached
    lip = history.profile("upper lip")
    along = lip["x"] * np.cos(LEAN) + lip["y"] * np.sin(LEAN)
    shear = PRESSURE * np.sin(LEAN) * (np.cos(LEAN) - MU * np.sin(LEAN))
    exact = 4 * (1 - NU**2) / E * shear * np.sqrt(np.maximum(1 - along**2, 0.0))
    area = lip["weight"].sum()
    assert lip["weight"] @ abs(lip["slip"]) == pytest.approx(lip["weight"] @ exact, rel=0.01)
    assert abs(lip["slip"]).max() == pytest.approx(exact.max(), rel=0.006)
    mean = lip["weight"] @ lip["pressure"] / area
    assert mean == pytest.approx(PRESSURE * np.sin(LEAN) ** 2, rel=2e-3)
    assert np.allclose(abs(lip["shear"]), MU * lip["pressure"], atol=0.02)


@pytest.mark.broad
@pytest.mark.pairs
@pytest.mark.on_ranks("0.3-1-method0")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("degree", mostly_serial([1, 2], [1]))
@pytest.mark.parametrize("friction", [0.0, 0.3, ec.Tresca(0.1)], ids=["0", "0.3", "given"])
def test_both_solvers_agree(friction, degree, method):
    domain = plate(4.0, 2.0, 0.4)
    errors = []
    for solver in ("direct", "iterative"):
        options = {"degree": degree, "method": method, "solver": solver}
        errors.append(certified(cracked(friction), domain, **options))
    direct, iterative = errors
    assert direct.relative == pytest.approx(iterative.relative, rel=1e-6)
    one, two = (error.profile("upper lip")["slip"] for error in errors)
    assert np.allclose(one, two, atol=1e-6 * abs(one).max())
    assert abs(one).max() > 0


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("friction", [0.0, ec.Tresca(0.1)], ids=["0", "given"])
def test_e_bounds_true_errors(friction, degree):
    domain = plate(3.0, 1.5, 0.5)
    scene = cracked(friction)
    error = certified(scene, domain, degree=degree)
    fine_domain = domain.refined().refined().refined()
    fine = ec.solve(scene, fine_domain, degree=degree)
    found = true_errors(error.admissible, fine)
    both = np.hypot(found.displacement, found.stress)
    assert 0.97 * both <= error.absolute <= 1.3 * both
    intervals = [
        ec.potential_energy(e) for e in (error, ec.constitutive_error(ec.equilibrate(fine)))
    ]
    coarse, finer = intervals
    assert coarse.guaranteed
    assert coarse.low <= finer.high <= coarse.high + 1e-12 * abs(coarse.high)
    assert finer.high - finer.low < coarse.high - coarse.low


def test_an_open_crack_is_no_contact():
    domain = plate(3.0, 1.5, 0.5)
    closed = certified(cracked(load=PRESSURE), domain)
    without = certified(replace(cracked(load=PRESSURE), contacts=()), domain)
    assert closed.relative == pytest.approx(without.relative, rel=1e-9)
    assert not closed.profile("upper lip")["pressure"].any()
    assert closed.profile("upper lip")["gap"].max() > 0


@pytest.mark.broad
@pytest.mark.serial
def test_a_crack_is_refined_meshed_anew_and_loaded_in_steps():
    domain = plate(4.0, 2.0, 0.4)
    slips = []
    for strategy in (ec.Mark(), ec.SizeMap()):
        run = ec.adapt(cracked(), domain, accuracy=0.01, strategy=strategy)
        assert run.reached
        lip = run.profile("upper lip")
        slips.append(lip["weight"] @ abs(lip["slip"]))
    assert slips[0] == pytest.approx(slips[1], rel=0.05)
    loads = [0.0, 1.0, 0.5, 0.0]
    history = ec.evolve(lambda t: cracked(load=-loads[round(t)]), domain, range(4), accuracy=0.1)
    assert history.reached
    assert history.column("dissipated")[-1] > history.column("dissipated")[1] > 0
    assert ec.coulomb_certificate(history.errors[1]).q < 1.0


@pytest.mark.broad
@pytest.mark.on_ranks("method0")
@pytest.mark.parametrize("method", METHODS)
def test_a_crack_in_space(method):
    """The edge at which it ends crosses the body; below it a corner of the block is loose."""

    def build(gmsh):
        model, occ = gmsh.model, gmsh.model.occ
        lower = occ.addBox(0, 0, 0, 2, 1, 1)
        upper = [occ.addBox(0, 0, 1, 1, 1, 0.5), occ.addBox(1, 0, 1, 1, 1, 0.5)]
        _, parts = occ.fragment([(3, lower)], [(3, tag) for tag in upper])
        occ.synchronize()
        model.addPhysicalGroup(3, [tag for _, tag in parts[0]], name="down")
        model.addPhysicalGroup(3, [tag for of_part in parts[1:] for _, tag in of_part], name="up")
        places = {"crack": (0.5, 1.0), "bottom": (1.0, 0.0)}
        for name, (x, z) in places.items():
            tags = []
            for _, tag in model.getEntities(2):
                if np.allclose(np.array(occ.getCenterOfMass(2, tag))[[0, 2]], (x, z)):
                    tags.append(tag)
            model.addPhysicalGroup(2, tags, name=name)
        top = [t for _, t in model.getEntities(2) if np.isclose(occ.getCenterOfMass(2, t)[2], 1.5)]
        model.addPhysicalGroup(2, top, name="top")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)

    with session(COMM, build, "The block") as model:
        whole = ec.from_gmsh(model, COMM)
    domain = whole.split({"upper lip": "up", "lower lip": "down"}, on="crack")
    crack = ec.Contact("upper lip", against="lower lip", friction=0.2)
    held = ec.Displacement("bottom", (0.0, 0.0, 0.0))
    load = ec.Traction("top", (0.004, 0.0, -0.02))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), held, load, crack)
    errors = [certified(scene, domain, method=method, solver=s) for s in ("direct", "iterative")]
    assert errors[0].relative == pytest.approx(errors[1].relative, rel=1e-6)
    assert errors[0].relative < 0.3
    force = errors[0].force("upper lip").force
    assert np.allclose(force, -errors[0].force("lower lip").force, atol=1e-12)
    assert force[2] > 0.01


def test_an_interference_at_the_end_is_refused():
    domain = plate(3.0, 1.5, 0.5)
    with pytest.raises(ec.InputError, match="ends inside a body"):
        ec.solve(cracked(gap=-1e-3), domain)
    with pytest.raises(ec.InputError, match="ends inside a body"):
        ec.solve(cracked(friction=0.0, gap=1e-3, bilateral=True), domain)


def cube_with_a_square_crack():
    """A structured mesh of two layers; the crack has two triangles that cut its corners."""
    tag = 90
    box = ec.box((0.0,) * 3, (2.0, 2.0, 1.0), cells=(8, 8, 4))

    def crack(x):
        in_square = (abs(x[:, 0] - 1.0) < 0.5) & (abs(x[:, 1] - 1.0) < 0.5)
        return np.where(in_square & (abs(x[:, 2] - 0.5) < 1e-9), tag, -1)

    regions = {"up": 1, "down": 2}
    return tagged(box, lambda x: np.where(x[:, 2] > 0.5, 1, 2), regions, crack, {"crack": tag})


def test_a_facet_in_the_corner_of_a_crack_stays_closed():
    """All its vertices are on the rim, so that it cannot open: it is no part of the lips."""
    whole = cube_with_a_square_crack()
    cracked = whole.split({"upper lip": "up", "lower lip": "down"}, on="crack")
    parts = cracked.parts()
    areas = dict(zip(parts["name"], parts["area"], strict=True))
    triangle = 0.25**2 / 2
    assert areas["upper lip"] == pytest.approx(1.0 - 2 * triangle, rel=1e-12)
    assert areas["upper lip"] == pytest.approx(areas["lower lip"], rel=1e-12)
    held = ec.Displacement("bottom", (0.0, 0.0, 0.0))
    crack = ec.Contact("upper lip", against="lower lip", friction=0.2)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), held, ec.Traction("top", (0.01, 0.0, -0.02)), crack)
    error = certified(scene, cracked)
    assert error.relative < 0.2
    assert error.admissible.imbalance < 1e-9
    fine = cracked.refined()
    refined = fine.parts()
    assert (
        dict(zip(refined["name"], refined["area"], strict=True))["upper lip"] > areas["upper lip"]
    )


def test_a_crack_of_one_facet_is_refused():
    with pytest.raises(ec.InputError, match="do not open"):
        plate(3.0, 2.0, 2.5)
