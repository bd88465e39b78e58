"""The answer does not depend on the number of ranks.

Cells, eps to 1e-8 and Newton steps, through 2 to 5 refinements.

With friction that varies on the contact, eps to 1e-10; also where data jump between
facets, and in the interval, whose friction bounds do.

Every rank solves the scene alone on its own communicator; all together solve it once
more.
"""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from scenes import block, measured, random_scene

import erc_contact as ec
from namedmesh.base.releases import cell_nodes

pytestmark = pytest.mark.ranks


def run_2d(comm: MPI.Comm) -> ec.History:
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, -0.05))],
        loads=[ec.Traction("right", (-0.002, 0.0))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    return ec.adapt(scene, block(4, comm), accuracy=1e-6, max_steps=5)


def run_unstructured(comm: MPI.Comm) -> ec.History:
    scene, domain = random_scene(2, comm)
    return ec.adapt(scene, domain, accuracy=1e-6, max_steps=3)


def run_degree_2(comm: MPI.Comm) -> ec.History:
    scene, domain = random_scene(2, comm)
    return ec.adapt(scene, domain, accuracy=1e-9, degree=2, max_steps=3)


def run_3d(comm: MPI.Comm) -> ec.History:
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[
            ec.Displacement("top", (0.02, 0.01, -0.05)),
            ec.Displacement("left", (None, 0.01, None)),
        ],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    domain = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 2), comm=comm)
    return ec.adapt(scene, domain, accuracy=1e-6, strategy=ec.Mark(0.3), max_steps=3)


def run_free(comm: MPI.Comm) -> ec.History:
    """A block on a smooth plane, bent by tractions in balance: it may slide."""
    # Marks of symmetric scenes are chosen by round-off.
    loads = [ec.Traction("right", (lambda x: 0.002 * (x[1] - 3.5) ** 3, 0.0))]
    loads.append(ec.Traction("left", (lambda x: -0.0147 * (x[1] - 3.5), 0.0)))
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        loads=[*loads, ec.Traction("top", (0.0, -0.05))],
        contacts=ec.Contact("bottom"),
    )
    return ec.adapt(scene, block(4, comm), accuracy=1e-6, max_steps=4)


@pytest.mark.parametrize("run", [run_2d, run_unstructured, run_degree_2, run_3d, run_free])
def test_rank_independence(run):
    alone, together = run(MPI.COMM_SELF), run(MPI.COMM_WORLD)
    assert len(alone.steps) == len(together.steps) >= 3
    for a, b in zip(alone.steps, together.steps, strict=True):
        assert (a.cells, a.vertices, a.newton_steps) == (b.cells, b.vertices, b.newton_steps)
        assert a.eps == pytest.approx(b.eps, rel=1e-8)
        assert a.eps_contact == pytest.approx(b.eps_contact, abs=1e-8 * a.eps)
    mid = []
    for history in (alone, together):
        domain = history.meshes[-1][0]
        x = domain.mesh.geometry.x[cell_nodes(domain.mesh.geometry)[: domain.owned_cells]].mean(
            axis=1
        )
        every = np.concatenate(domain.mesh.comm.allgather(x))
        mid.append(np.sort(np.round(every, 9) @ np.array([1.0, 1e3, 1e6])))
    assert np.allclose(mid[0], mid[1], rtol=0, atol=1e-3)


@pytest.mark.parametrize("d", [2, 3])
def test_optimal_meshes_are_the_same(d):
    """Sizes that differ in their last digit, or come in another order, make gmsh mesh another way."""
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("top", (*[0.0] * (d - 1), -0.05))],
        contacts=[
            ec.Contact(
                "bottom",
                friction=0.3,
                gap=lambda x: sum((x[i] - 0.5) ** 2 for i in range(d - 1)) / 4,
            )
        ],
    )
    meshes = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        make = ec.rectangle if d == 2 else ec.box
        domain = make((0.0,) * d, (1.0,) * d, size=0.25 if d == 2 else 0.5, comm=comm)
        history = ec.adapt(scene, domain, (0.03, 0.35)[d - 2], degree=4 - d, strategy=ec.SizeMap())
        meshes.append([step.cells for step in history.steps])
    assert len(meshes[0]) > 1
    assert meshes[0] == meshes[1]


@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_ranks_without_cells_or_contact(degree):
    """Two cells on any number of ranks.

    Some have no cell, or no facet of the contact.
    """
    loads = [ec.Traction("top", (0.001, -0.01)), ec.BodyForce((0.0, lambda x: -0.01 * x[1]))]
    held_by_contact = ec.Scene(
        ec.Elastic(1.0, 0.3), [], loads, [ec.Contact("bottom", friction=0.3)]
    )
    eps = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1), comm=comm)
        eps.append(
            ec.constitutive_error(
                ec.equilibrate(ec.solve(held_by_contact, domain, degree=degree))
            ).relative
        )
    assert eps[0] == pytest.approx(eps[1], rel=1e-8)


@pytest.mark.parametrize(
    "material",
    [
        ec.Elastic(1.0, 0.3),
        ec.Elastic(1.0, 0.3, hypothesis="axisymmetric"),
        pytest.param(
            ec.Plastic(1.0, 0.3, yield_stress=0.005, hardening=0.05), marks=pytest.mark.broad
        ),
        ec.Plastic(1.0, 0.3, 0.005, 0.05, hypothesis="axisymmetric"),
    ],
    ids=["plane", "rings", "plastic", "plastic rings"],
)
def test_a_run_on_ranks_without_cells(material):
    """From two cells on, with all that a run tells: some ranks have none at first."""
    top = ec.Displacement("top", (None, -0.02))
    scene = ec.Scene(material, [*held_along(material), top], contacts=ec.Contact("bottom"))
    runs = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(1, 1), comm=comm)
        history = ec.adapt(scene, domain, 1e-3, max_steps=2)
        history.error.admissible.stress_function()  # hangs where a rank fails
        runs.append([(step.cells, step.eps) for step in history.steps])
    for alone, together in zip(*runs, strict=True):
        assert together == pytest.approx(alone, rel=1e-8, abs=1e-12)


def held_along(material):
    """What holds a body of a material along the contact: nothing on rings."""
    return [] if material.hypothesis == "axisymmetric" else [ec.Symmetry("left")]


@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_friction_that_vanishes_at_an_edge(degree):
    """Friction that varies in space, zero on one edge, where both the bound and the traction are round-off."""
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("top", (0.0, 0.0, -0.02))],
        contacts=[ec.Contact("bottom", friction=lambda x: 0.8 * x[0])],
    )
    eps = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        domain = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(2, 2, 2), comm=comm)
        pair = ec.equilibrate(ec.solve(scene, domain, degree=degree), tighten=2)
        eps.append(ec.constitutive_error(pair).relative)
    assert eps[0] == pytest.approx(eps[1], rel=1e-10)


@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
@pytest.mark.parametrize("d", [2, 3])
def test_data_that_jump_between_facets(d, degree):
    """A node has the values of several facets, of which none is the last on all ranks."""
    low, high = (0.0,) * d, (2.0, *(1.0,) * (d - 1))
    push = ec.Displacement("top", (0.02, *(0.0,) * (d - 2), -0.02))
    eps, forces = [], []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        make = ec.rectangle if d == 2 else ec.box
        domain = make(low, high, cells=(6, *(3,) * (d - 1)), comm=comm)

        def jumping(x, domain=domain):
            of_cells = fem.Function(fem.functionspace(domain.mesh, ("DG", 0)))
            of_cells.interpolate(lambda x: 1.5 + np.sin(1e4 * x[0] + 3e3 * x[1]))
            function = fem.Function(fem.functionspace(domain.mesh, ("DG", 1)))
            function.interpolate(of_cells)
            return function

        contact = ec.Contact(
            "bottom",
            friction=lambda x, jumping=jumping: 0.2 * jumping(x),
            foundation=ec.Foundation(jumping),
        )
        error = measured(
            ec.Scene(ec.Elastic(1.0, 0.3), push, contacts=contact), domain, degree=degree
        )
        eps.append(error.relative)
        forces.append(error.force("bottom").force)
    assert eps[0] == pytest.approx(eps[1], rel=1e-8)
    assert forces[0] == pytest.approx(forces[1], rel=1e-7)


def test_interval_with_coulomb_friction():
    """Its problem has a friction bound that jumps between facets."""
    plate = ec.Rigid("top", (0.004, None), force=(None, -0.02), moment=0.001)
    pull = ec.Traction("right", (0.001, 0.0))
    scene = ec.Scene(ec.Elastic(1.0, 0.3), plate, pull, ec.Contact("bottom", friction=0.3))
    bounds = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        domain = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(3, 3), comm=comm)
        interval = ec.interval(measured(scene, domain), ec.Resultant("top", (1.0, 0.0)))
        bounds.append([interval.low, interval.high])
    assert bounds[0] == pytest.approx(bounds[1], rel=1e-7)
