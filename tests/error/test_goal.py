"""Certified bounds on resultants, energy and work of the loads.

Properties against much finer meshes and exact values.

- the interval holds the number of a fine mesh, has the sign of the physics, and shrinks
  with the mesh;
- the two halves of its middle agree with integrals of sigma^ and of C eps(u^) against
  eps(phi);
- resultants that equilibrium dictates are exact, also with Coulomb friction;
- where a support holds the edge of a contact, the weighted resultant is bounded, and
  said to be weighted;
- the answer does not depend on the number of ranks.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import block, greco, opening, patch_test, prototype_block
from scenes import resultant as sum_of

import erc_contact as ec
from erc_contact.admissible.elastic import elastic_stress, strains
from erc_contact.admissible.macro import macro_points
from erc_contact.error.lifting import lifting
from erc_contact.error.load_work import load_work
from namedmesh.simplex import bernstein

TRESCA = ec.Tresca(0.0015)


def rolling() -> ec.Scene:
    """A rigid roller under the block, frictionless: the gap varies."""
    return replace(
        prototype_block(),
        supports=[ec.Displacement("top", (0.0, -0.05))],
        contacts=[ec.Contact("bottom", gap=lambda x: 0.02 * (x[0] - 0.8) ** 2)],
    )


def cube(friction) -> ec.Scene:
    return ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("top", (0.06, 0.01, -0.04))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def cubes(n: int, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    return ec.box((0.0,) * 3, (1.0,) * 3, cells=(n,) * 3, comm=comm)


def error_of(
    scene: ec.Scene, domain: ec.Domain, tighten: int = 10, degree: int = 1
) -> ec.ConstitutiveError:
    solution = ec.solve(scene, domain, ec.AugmentedLagrangian(), degree=degree)
    return ec.constitutive_error(ec.equilibrate(solution, tighten=tighten))


CASES = {
    "frictionless": (opening(0.0), block, "bottom", (4, 8), 24),
    "Tresca friction": (opening(TRESCA), block, "bottom", (4, 8), 24),
    "gap": (rolling(), block, "bottom", (4, 8), 24),
    "cube": (cube(0.0), cubes, "bottom", (2, 4), 12),
    "cube, Tresca friction": (cube(ec.Tresca(0.008)), cubes, "bottom", (2, 4), 12),
}


@cache
def errors(case: str) -> tuple[list[ec.ConstitutiveError], ec.ConstitutiveError]:
    scene, mesh, _, coarse, fine = CASES[case]
    return [error_of(scene, mesh(n)) for n in coarse], error_of(scene, mesh(fine), tighten=0)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("case", CASES)
def test_resultants_hold_those_of_a_fine_mesh(case):
    coarse, fine = errors(case)
    name = CASES[case][2]
    d = fine.admissible.solution.model.space.d
    true = sum_of(fine.admissible.tractions[0])
    for axis in range(d):
        bounds = [ec.resultant(error, name, np.eye(d)[axis]) for error in coarse]
        print(
            f"\n{case}, axis {axis}: {true[axis]:.5g} in",
            *(f"[{b.low:.5g}, {b.high:.5g}]" for b in bounds),
        )
        for b in bounds:
            assert b.guaranteed
            assert not b.weighted
            assert b.low <= true[axis] <= b.high
            assert b.value == pytest.approx((b.low + b.high) / 2, rel=1e-12, abs=1e-300)
            assert abs(true[axis] - b.value) <= 0.4 * (b.high - b.low) or true[axis] == 0.0
        widths = [b.high - b.low for b in bounds]
        assert widths[1] <= 0.75 * widths[0]
    assert (
        ec.resultant(coarse[1], name, np.eye(d)[d - 1]).low > 0.5 * true[d - 1] > 0
    )  # the foundation pushes
    if "Tresca" in case:
        friction = ec.resultant(coarse[1], name, np.eye(d)[0])
        assert friction.low * friction.high > 0  # its sign is certain
        opposite = ec.resultant(coarse[1], name, -2 * np.eye(d)[0])
        assert opposite.value == pytest.approx(-2 * friction.value, rel=1e-6)
    else:
        assert ec.resultant(coarse[1], name, np.eye(d)[0]).high == 0.0


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("case", CASES)
def test_energy_holds_that_of_a_fine_mesh(case):
    coarse, fine = errors(case)
    true, bounds = ec.potential_energy(fine), [ec.potential_energy(error) for error in coarse]
    for b in bounds:
        assert b.guaranteed
        assert (
            b.low <= true.high <= b.high == b.value
        )  # J of the fine mesh is above the least, but below all coarser
    widths = [b.high - b.low for b in bounds]
    assert widths[1] <= 0.6 * widths[0]
    assert widths[1] < 0.1 * abs(true.high)


@pytest.mark.on_ranks("Tresca friction-1", "cube, Tresca friction-2")
@pytest.mark.parametrize(
    ("case", "degree"),
    [
        ("Tresca friction", 1),
        ("Tresca friction", 2),
        pytest.param("cube, Tresca friction", 2, marks=pytest.mark.broad),
        ("frictionless", 1),
    ],
)
def test_middle_is_that_of_both_stresses(case, degree):
    """The resultant from r^ is the resultant of sigma^ by integration.

    Equilibrium, with all signs.
    """
    scene, mesh, name, (n, _), _ = CASES[case]
    error = error_of(scene, mesh(n), tighten=2, degree=degree)
    pair = error.admissible
    model, cells, count = pair.solution.model, pair.cell_geometry, pair.solution.domain.owned_cells
    d = model.space.d
    shape, points, weights = macro_points(d, degree)
    sigma = np.matmul(shape, pair.stress).reshape(count, len(points), -1)
    elastic = elastic_stress(model, cells, pair.displacement, count)
    lower = bernstein(d, degree - 1, points)
    for a in np.eye(d):
        phi, _ = lifting(model, pair.solution.stiffness, 0, a)
        strain = np.matmul(lower, strains(cells, phi)[:count])
        value = np.einsum(
            "n,q,nqs,nqs->", cells.volume[:count], weights, 0.5 * (sigma + elastic), strain
        )
        value = model.space.comm.allreduce(float(value), MPI.SUM)
        loads = load_work(model, phi).value
        b = ec.resultant(error, name, a)
        assert b.value == pytest.approx(value - loads, rel=1e-9, abs=1e-12 * error.scale)


@pytest.mark.serial
def test_no_error_of_petsc_is_swallowed(capfd):
    """DOLFINx ignored one for each fixed component that no spring of a contact has."""
    error = error_of(prototype_block(), block(2))
    PETSc.Sys.pushErrorHandler("traceback")
    ec.resultant(error, "bottom", (0.0, 1.0))
    PETSc.Sys.popErrorHandler()
    assert "PETSC ERROR" not in capfd.readouterr().err


@pytest.mark.broad
@pytest.mark.on_ranks("GRECO")
@pytest.mark.parametrize("case", ["cube, Tresca friction", "GRECO"])
def test_multigrid_gives_the_same_bounds(case):
    """In GRECO the loads alone dictate the resultant, because phi is a rigid motion.

    The interval is a point.
    """
    found = []
    for solver in ("direct", "iterative"):
        if case == "GRECO":
            scene, domain, name, a = (
                greco(),
                ec.rectangle((0, 0), (40, 40), cells=(8, 8)),
                "bottom",
                (0.0, 1.0),
            )
        else:
            scene, mesh, name, _, _ = CASES[case]
            domain, a = mesh(3), (0.3, -0.2, 1.0)
        solution = ec.solve(scene, domain, ec.Nitsche(), solver=solver)
        found.append(ec.resultant(ec.constitutive_error(ec.equilibrate(solution)), name, a))
    direct, iterative = found
    assert (iterative.low, iterative.high) == pytest.approx((direct.low, direct.high), rel=1e-6)
    assert (iterative.guaranteed, iterative.weighted) == (direct.guaranteed, direct.weighted)
    assert (case == "GRECO") == (iterative.high - iterative.low <= 1e-10 * iterative.high)


def test_equilibrium_dictates_a_resultant():
    """GRECO: 50 MPa on 40 mm, whatever the mesh.

    Friction is an estimate that holds the converged value.
    """
    error = error_of(greco(), ec.rectangle((0, 0), (40, 40), cells=(8, 8)))
    vertical = ec.resultant(error, "bottom", (0.0, 1.0))
    assert vertical.value == pytest.approx(2000.0, rel=1e-10)
    assert vertical.high - vertical.low < 1e-7
    assert vertical.guaranteed
    friction = ec.resultant(error, "bottom", (1.0, 0.0))
    assert friction.low < -1405.4 < friction.high < 0
    assert friction.weighted  # the symmetry line holds the last node of the contact
    assert not friction.guaranteed
    assert not ec.potential_energy(error).guaranteed


@pytest.mark.serial
def test_coulomb_friction_is_no_guarantee_where_e_is_zero():
    """There may be other solutions: only what equilibrium dictates is certain."""
    scene, _ = patch_test(0.3, 0.3)
    error = error_of(scene, ec.rectangle((0.0, 0.0), (1.0, 2.0), size=0.3))
    assert error.absolute < 1e-10 * error.scale
    for a in np.eye(2):
        assert not ec.resultant(error, "bottom", a).guaranteed


def held_at_the_side(limit: float = 0.002) -> ec.Scene:
    """The left side is clamped, and the contact ends there."""
    return ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("left", (0.0, 0.0))],
        loads=[ec.Traction("top", (0.003, -0.02))],
        contacts=[ec.Contact("bottom", friction=ec.Tresca(limit) if limit else 0.0)],
    )


@pytest.mark.serial
def test_weighted_resultant():
    square = [ec.rectangle((0, 0), (1, 1), cells=(n, n)) for n in (4, 64)]
    coarse, fine = (error_of(held_at_the_side(), domain) for domain in square)
    traction = fine.admissible.tractions[0]
    ends = fine.admissible.solution.model.space.V.tabulate_dof_coordinates()[traction.nodes][..., 0]
    for a in np.eye(2):
        b = ec.resultant(coarse, "bottom", a)
        assert b.weighted
        x = np.array([0.0, 0.25, 1.0])
        on_fine = (
            np.interp(ends, x, [0.0, 1.0, 1.0])[..., None] * a
        )  # r^ and phi are linear on fine facets
        mass = (np.ones((2, 2)) + np.eye(2)) / 6
        true = np.einsum("f,mk,fmi,fki->", traction.area, mass, traction.values, on_fine)
        assert b.low < true < b.high


@pytest.mark.broad
@pytest.mark.serial
def test_work_of_loads():
    coarse, fine = (
        error_of(held_at_the_side(0.0), ec.rectangle((0, 0), (1, 1), cells=(n, n)))
        for n in (8, 128)
    )
    b, true = ec.work_of_loads(coarse), ec.work_of_loads(fine)
    assert b.guaranteed
    assert b.low == b.value <= true.value <= b.high
    assert b.high - b.low == pytest.approx(coarse.absolute**2, rel=1e-9)
    assert true.high - true.low < 0.2 * (b.high - b.low)


def test_work_of_loads_of_an_exact_solution():
    E, nu, p = 2.0, 0.3, 0.01
    scene = ec.Scene(
        material=ec.Elastic(E, nu),
        supports=[ec.Displacement("left", (0.0, None))],
        loads=[ec.Traction("top", pressure=p)],
        contacts=[ec.Contact("bottom")],
    )
    b = ec.work_of_loads(error_of(scene, block(2)))
    assert b.value == pytest.approx(p**2 * 2 * 7 * (1 - nu**2) / E, rel=1e-10)
    assert b.high - b.low < 1e-15
    assert b.guaranteed


@pytest.mark.serial
def test_oscillation_ends_the_guarantee():
    loads = [ec.BodyForce((0.0, lambda x: -0.001 * x[0] ** 2))]
    error = error_of(replace(opening(0.0), loads=loads), block(2))
    assert error.oscillation > 0
    assert not ec.resultant(error, "bottom", (0.0, 1.0)).guaranteed
    assert not ec.potential_energy(error).guaranteed


@pytest.mark.serial
def test_bad_input():
    error = error_of(opening(TRESCA), block(2), tighten=0)
    with pytest.raises(ec.InputError, match=r"No contact is called 'top'; this scene has bottom"):
        ec.resultant(error, "top", (1.0, 0.0))
    with pytest.raises(ec.InputError, match="give 2 finite numbers"):
        ec.resultant(error, "bottom", (1.0, 0.0, 0.0))
    for scene, reason in (
        (opening(0.0), "a support that is not zero"),
        (held_at_the_side(), "friction"),
        (replace(held_at_the_side(0.0), contacts=[ec.Contact("bottom", gap=0.001)]), "a gap"),
    ):
        with pytest.raises(ec.InputError, match=reason):
            ec.work_of_loads(error_of(scene, block(2), tighten=0))


def in_a_corner(comm: MPI.Comm, friction=0.0) -> ec.ConstitutiveError:
    """A box in a corner: contact on three sides, which share edges and a vertex."""
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        loads=[
            ec.Traction("top", (-0.002, -0.003, -0.02)),
            ec.Traction("right", (-0.01, 0.0, 0.0)),
        ],
        contacts=[ec.Contact("bottom", friction=friction), ec.Contact("left"), ec.Contact("front")],
    )
    return error_of(scene, cubes(3, comm))


def with_friction(comm: MPI.Comm) -> ec.ConstitutiveError:
    return in_a_corner(comm, TRESCA)


def given_friction(comm: MPI.Comm) -> ec.ConstitutiveError:
    return error_of(opening(TRESCA), block(6, comm))


@pytest.mark.ranks
@pytest.mark.parametrize("make", [with_friction, given_friction])
def test_rank_independence(make):
    results = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        error = make(comm)
        model = error.solution.model
        bounds = [ec.potential_energy(error)]
        for contact in model.contacts:
            bounds += [ec.resultant(error, contact.name, a) for a in np.eye(model.space.d)]
        results.append(bounds)
    scale = max(abs(b.value) for b in results[0])
    for a, b in zip(*results, strict=True):
        assert (a.guaranteed, a.weighted) == (b.guaranteed, b.weighted)
        assert [a.value, a.low, a.high] == pytest.approx(
            [b.value, b.low, b.high], rel=1e-7, abs=1e-9 * scale
        )


def test_contacts_that_share_nodes():
    """Without friction equilibrium dictates all normal forces of a box in a corner.

    Friction holds edges of others.
    """
    for friction in (0.0, TRESCA):
        error = in_a_corner(MPI.COMM_WORLD, friction)
        for name, axis, load in (("bottom", 2, 0.02), ("left", 0, 0.012), ("front", 1, 0.003)):
            b = ec.resultant(error, name, np.eye(3)[axis])
            assert b.weighted == (friction == TRESCA and name != "bottom")
            if not b.weighted:
                assert b.value == pytest.approx(load, rel=1e-9)
                assert b.high - b.low < 1e-9 * load
