"""The error of a displacement from anywhere, and what causes it.

- a solution of the augmented Lagrangian gets the error that it has; one of Nitsche's
  method one that is as good;
- the squares of the causes sum to e^2; a disturbance raises the square of the
  displacement by its energy norm, and leaves the square of the mesh;
- e bounds the true error of an interpolated, a disturbed and a penetrating
  displacement, and the words name the greatest cause;
- Functions, callables and points in any order are the same, on any ranks, for two
  bodies, and with heat; what does not fit is refused in words.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from bricks import bricks
from mpi4py import MPI
from reference import true_errors
from scenes import block, prototype_block

import erc_contact as ec

SCENE = prototype_block()


def solved(degree, n=4, method=None, scene=SCENE):
    return ec.solve(scene, block(n), method or ec.AugmentedLagrangian(), degree=degree)


def error_of(solution):
    return ec.constitutive_error(ec.equilibrate(solution))


def disturbed(u, share):
    """A Function whose values are wrong by a share, the same on any ranks."""
    other = u.copy()
    x = u.function_space.tabulate_dof_coordinates()
    noise = np.sin(57.0 * x[:, :1] + 91.0 * x[:, 1:2] + np.array([1.0, 2.0]))
    other.x.array[:] *= 1 + share * noise.ravel()
    return other


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("degree", [1, 2])
def test_a_solution_has_the_error_that_it_has(degree):
    solution = solved(degree)
    error = error_of(solution)
    certificate = ec.certify(SCENE, solution.domain, solution.u)
    assert certificate.error.relative == pytest.approx(error.relative, rel=1e-8)
    parts = [certificate.mesh, certificate.displacement, certificate.contact]
    assert np.linalg.norm(parts) == pytest.approx(error.absolute, rel=1e-8)
    assert certificate.off_supports == 0.0
    assert certificate.penetration == 0.0
    assert certificate.cause == "the mesh"
    of_nitsche = ec.solve(SCENE, solution.domain, ec.Nitsche(), degree=degree).u
    nitsche = ec.certify(SCENE, solution.domain, of_nitsche)
    assert nitsche.error.relative == pytest.approx(error.relative, rel=0.05)
    assert nitsche.penetration > 0


def test_a_disturbance_is_the_fault_of_the_displacement():
    solution = solved(2)
    clean = ec.certify(SCENE, solution.domain, solution.u)
    noisy = ec.certify(SCENE, solution.domain, disturbed(solution.u, 0.05))
    assert noisy.cause == "the displacement"
    assert "not in equilibrium" in str(noisy)
    assert noisy.off_supports > 0
    # The contact traction is disturbed, too, so the mesh costs somewhat more.
    assert noisy.mesh < 1.5 * clean.mesh
    assert noisy.displacement > 3 * clean.displacement


@cache
def nearly_exact():
    """Return the solution on a mesh that has the nodes of the coarse meshes, too."""
    return ec.solve(SCENE, block(16), degree=2)


@pytest.mark.broad
@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2])
def test_e_bounds_the_true_error_of_anything(degree):
    reference = nearly_exact()
    coarse = solved(degree)
    nodes = coarse.model.space.V.tabulate_dof_coordinates()
    sunk = coarse.u.copy()
    sunk.x.array[1::2] -= 0.002 * (7.0 - nodes[:, 1])
    x = reference.model.space.V.tabulate_dof_coordinates()[:, :2]
    # The nodes of the coarse mesh are among the nodes of the fine mesh.
    fine = x, reference.u.x.array.reshape(-1, 2)
    given = {
        "interpolated": fine,
        "disturbed": disturbed(coarse.u, 0.02),
        "sunk": sunk,
        "at rest": lambda x: np.zeros((2, x.shape[1])),
    }
    for name, u in given.items():
        certificate = ec.certify(SCENE, coarse.domain, u, degree=degree)
        true = true_errors(certificate.error.admissible, reference)
        third = max(-true.friction, 0.0)
        assert true.both**2 - third <= 1.02 * certificate.error.absolute**2, name
        assert certificate.error.absolute < 3 * true.both, name
    assert certificate.off_supports == pytest.approx(0.05, rel=1e-9)
    assert certificate.cause == "the displacement"
    assert ec.certify(SCENE, coarse.domain, sunk).penetration == pytest.approx(0.014, rel=0.05)


def test_points_in_any_order_and_digits():
    solution = solved(2, n=3)
    if MPI.COMM_WORLD.size == 1:
        x = solution.model.space.V.tabulate_dof_coordinates()[:, :2]
        u = solution.u.x.array.reshape(-1, 2)
        order = np.random.default_rng(0).permutation(len(x))
        rounded = np.array([[float(f"{value:.5e}") for value in row] for row in x[order]])
        certificate = ec.certify(SCENE, solution.domain, (rounded, u[order]))
        assert certificate.error.degree == 2
        assert certificate.error.relative == pytest.approx(error_of(solution).relative, rel=1e-8)
        with pytest.raises(ec.InputError, match="nodes have no point"):
            ec.certify(SCENE, solution.domain, (x[5:], u[5:]), degree=2)
    with pytest.raises(ec.InputError, match=r"give \(n, 2\) of both"):
        ec.certify(SCENE, solution.domain, ([1.0, 2.0], [3.0]))


def test_ranks_and_heat():
    scene = replace(SCENE, strains=ec.ThermalStrain(1e-3, 5.0))

    def field(x):
        return np.array([0.002 * x[1], -0.05 * x[1] / 7.0 + 0.001 * x[0]])

    certificates = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        domain = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(2, 7), comm=comm)
        certificates.append(ec.certify(scene, domain, field))
    alone, together = certificates
    assert together.error.relative == pytest.approx(alone.error.relative, rel=1e-9)
    assert together.displacement == pytest.approx(alone.displacement, rel=1e-8)
    assert together.penetration == pytest.approx(alone.penetration, abs=1e-15)


def test_two_bodies():
    bodies = bricks(2, (4, 2))
    scene = ec.Scene(
        ec.Elastic({"upper": 10.0, "lower": 1.0}, 0.3),
        [ec.Displacement("upper outer", (0.01, -0.05)), ec.Displacement("lower outer", (0.0, 0.0))],
        contacts=ec.Contact("upper contact", against="lower contact", friction=0.3),
    )
    solution = ec.solve(scene, bodies, ec.AugmentedLagrangian())
    certificate = ec.certify(scene, bodies, solution.u)
    assert certificate.error.relative == pytest.approx(error_of(solution).relative, rel=1e-8)
    with pytest.raises(ec.InputError, match="two nodes lie at one place"):
        ec.certify(scene, bodies, (np.zeros((3, 2)), np.zeros((3, 2))))


BAD = {
    "number": (3.0, "give a Function of the mesh"),
    "shape": (lambda x: x[:1], "return 2 rows"),
    "not finite": (lambda x: np.nan * x, "not finite"),
    "raises": (lambda x: 1 / 0, "failed with ZeroDivisionError"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_does_not_fit_is_refused_in_words(case):
    u, words = BAD[case]
    with pytest.raises(ec.InputError, match=words):
        ec.certify(SCENE, block(2), u)


def test_a_function_of_another_mesh_is_refused():
    solution = solved(1, n=2)
    with pytest.raises(ec.InputError, match="another mesh"):
        ec.certify(SCENE, block(2), solution.u)


def pressed_ball(d):
    """A block on a curved foundation, of which a part is closed."""
    corners = ((-1.0,) * (d - 1) + (0.0,), (1.0,) * d)
    body = ec.rectangle(*corners, cells=(4, 2)) if d == 2 else ec.box(*corners, cells=(4, 4, 2))
    contact = ec.Contact(
        "bottom", friction=0.3, gap=lambda x: 0.2 * sum(x[i] ** 2 for i in range(d - 1))
    )
    down = ec.Displacement("top", (0.0,) * (d - 1) + (-0.1,))
    return ec.Scene(ec.Elastic(1.0, 0.3), down, contacts=contact), body


@pytest.mark.broad
@pytest.mark.on_ranks("2-2")
@pytest.mark.parametrize(("d", "degree"), [(2, 2), (3, 1)])
def test_a_solution_of_nitsche_has_the_error_that_it_has(d, degree):
    scene, body = pressed_ball(d)
    solution = ec.solve(scene, body, ec.Nitsche(), degree=degree)
    certificate = ec.certify(scene, body, solution.u)
    own = error_of(solution).absolute
    assert certificate.error.absolute <= own * (1 + 1e-8)
    parts = [certificate.mesh, certificate.displacement, certificate.contact]
    assert np.linalg.norm(parts) == pytest.approx(certificate.error.absolute, rel=1e-8)


@pytest.mark.on_ranks("2-2", "3-1")
@pytest.mark.parametrize(("d", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_a_traction_from_elsewhere(d, degree):
    scene, body = pressed_ball(d)
    solution = ec.solve(scene, body, ec.AugmentedLagrangian(), degree=degree)
    (multiplier,) = solution.multipliers
    own = error_of(solution).absolute
    taken = ec.certify(scene, body, solution.u, traction={"bottom": multiplier})
    assert taken.error.absolute == pytest.approx(own, rel=1e-8)
    x = multiplier.function_space.tabulate_dof_coordinates()[:, :d]
    values = multiplier.x.array.reshape(-1, d)
    if body.mesh.comm.size == 1:
        table = ec.certify(scene, body, solution.u, traction={"bottom": (x[::-1], values[::-1])})
        assert table.error.absolute == pytest.approx(own, rel=1e-8)
    # No pressure at all is a bad guess, and bounded as any other.
    none = ec.certify(scene, body, solution.u, traction={"bottom": np.zeros_like})
    assert none.error.absolute > own
    assert none.error.force("bottom").force[-1] == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize(
    ("traction", "said"),
    [
        ({"floor": np.zeros_like}, "the contacts are bottom"),
        (np.zeros_like, "mapping"),
        ({"bottom": lambda x: x[:1]}, "return 2 rows"),
        ({"bottom": (np.zeros((3, 2)), np.zeros((3, 2)))}, "have no point"),
        ({"bottom": (np.zeros((0, 2)), np.zeros((0, 2)))}, "of both"),
        ({"bottom": (np.full((3, 2), np.nan), np.zeros((3, 2)))}, "not finite; leave"),
        ({"bottom": lambda x: np.full(x.shape, np.nan)}, "not finite"),
    ],
)
@pytest.mark.serial
def test_a_traction_that_does_not_fit_is_refused(traction, said):
    scene, body = pressed_ball(2)
    with pytest.raises(ec.InputError) as refused:
        ec.certify(scene, body, np.zeros_like, traction=traction)
    assert said in str(refused.value)


# -- files of results
# ---------------------------------------------------------------------------------

CALCULIX = Path(__file__).parents[2] / "meshes" / "calculix"


def test_a_result_of_calculix_on_hexahedra():
    """A block 2 x 1 x 1 of 16 hexahedra of second order, sheared between two plates."""
    domain = ec.read_mesh(CALCULIX / "hexahedra.inp")
    supports = [ec.Displacement("roof", (0.02, 0.0, -0.05)), ec.Displacement("foot", (0.0,) * 3)]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports)
    certificate = ec.certify(scene, domain, CALCULIX / "hexahedra.frd")
    assert certificate.error.degree == 2
    assert certificate.interpolated
    assert "in the cells of the file" in str(certificate)
    assert certificate.cause == "the mesh"
    assert certificate.transfer == 0.0
    # In their own cells hexahedra are better than interpolated, and than tetrahedra.
    assert certificate.relative < 0.9 * certificate.error.relative
    own = error_of(ec.solve(scene, domain, degree=2)).relative
    assert 0.9 * own < certificate.relative < certificate.error.relative < 1.2 * own
    # The supports hold but for the digits of the file.
    assert certificate.off_supports < 1e-7


@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_a_result_of_triangles_is_that_of_its_points(degree, shared_tmp_path):
    solution = solved(degree, n=3)
    path = shared_tmp_path / "result.vtu"
    if MPI.COMM_WORLD.size == 1:
        import meshio

        x = solution.model.space.V.tabulate_dof_coordinates()
        # DOLFINx has the middle of the edge opposite to a vertex first.
        order = [0, 1, 2] if degree == 1 else [0, 1, 2, 5, 3, 4]
        cells = {
            "triangle" if degree == 1 else "triangle6": solution.model.space.V.dofmap.list[:, order]
        }
        u = np.pad(solution.u.x.array.reshape(-1, 2), ((0, 0), (0, 1)))
        meshio.Mesh(x, cells, point_data={"disp": u}).write(path)
        certificate = ec.certify(SCENE, solution.domain, path)
        assert certificate.error.degree == degree
        assert not certificate.interpolated
        assert certificate.error.relative == pytest.approx(error_of(solution).relative, rel=1e-8)


def test_a_file_tells_two_bodies_apart(shared_tmp_path):
    """On both sides of the contact nodes lie at one place, with other displacements."""
    bodies = bricks(2, (4, 2))
    held = ec.Displacement("lower outer", (0.0, 0.0))
    scene = ec.Scene(
        ec.Elastic({"upper": 10.0, "lower": 1.0}, 0.3),
        [ec.Displacement("upper outer", (0.03, -0.05)), held],
        contacts=ec.Contact("upper contact", against="lower contact", friction=0.1),
    )
    solution = ec.solve(scene, bodies, ec.AugmentedLagrangian())
    certificate = ec.certify(scene, bodies, solution.u)
    parts = MPI.COMM_WORLD.gather(
        (
            solution.model.space.V.tabulate_dof_coordinates(),
            solution.model.space.V.dofmap.list[: bodies.owned_cells],
            solution.u.x.array.reshape(-1, 2),
        )
    )
    path = shared_tmp_path / "result.vtu"
    if parts is not None:
        import meshio

        # Nodes of several ranks are there twice, with the same displacement.
        begins = np.cumsum([0, *(len(x) for x, _, _ in parts)])
        x = np.concatenate([x for x, _, _ in parts])
        cells = np.concatenate([c + b for (_, c, _), b in zip(parts, begins, strict=False)])
        u = np.pad(np.concatenate([u for _, _, u in parts]), ((0, 0), (0, 1)))
        meshio.Mesh(x, {"triangle": cells}, point_data={"U": u}).write(path)
    MPI.COMM_WORLD.barrier()
    of_file = ec.certify(scene, bodies, path)
    assert of_file.error.relative == pytest.approx(certificate.error.relative, rel=1e-8)


def test_a_function_of_dolfinx_in_a_file(shared_tmp_path):
    from dolfinx import io

    solution = solved(1)
    path = shared_tmp_path / "result.xdmf"
    mesh = solution.domain.mesh
    with io.XDMFFile(mesh.comm, path, "w") as file:
        file.write_mesh(mesh)
        file.write_function(solution.u)
    certificate = ec.certify(SCENE, solution.domain, path)
    assert certificate.error.relative == pytest.approx(error_of(solution).relative, rel=1e-6)


@pytest.mark.broad
def test_files_without_a_displacement_are_refused(shared_tmp_path):
    solution = solved(1, n=2)
    with pytest.raises(ec.InputError, match="does not exist"):
        ec.certify(SCENE, solution.domain, shared_tmp_path / "missing.frd")
    with pytest.raises(ec.InputError, match="no vector at points"):
        ec.certify(SCENE, solution.domain, CALCULIX / "block.msh")
    with pytest.raises(ec.InputError, match="outside of the bodies"):
        ec.certify(SCENE, solution.domain, CALCULIX / "block_10.vtu")
