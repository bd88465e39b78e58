"""What a user asks of a result.

The same on all ranks, and consistent with the fields that it is read off.

Properties: all forces on a body balance, with their moments; the force of a contact is
the integral of its profile and of r^; the profile is in order along open and closed
curves; values at points are values of the fields, and do not depend on the ranks, also
between cells; points outside and unknown names are errors. A solution answers as an
error does, by its own fields: its forces are the forces of the discrete equations.
"""

import numpy as np
import pytest
from domains import refused
from mpi4py import MPI
from processes import ROOT
from scenes import block, common_block, measured, mostly_serial, moved_box, random_scene, resultant

import erc_contact as ec
from erc_contact import results
from namedmesh.graphs import order_along_curves

COMM = MPI.COMM_WORLD


USUAL = ec.AugmentedLagrangian()


@pytest.mark.broad
@pytest.mark.on_ranks("case0")
@pytest.mark.parametrize("case", mostly_serial([(2, 1), (2, 2), (3, 1), (3, 2)], [(2, 1), (3, 2)]))
def test_forces_balance(case):
    seed, degree = case
    error = measured(*random_scene(seed), degree=degree)
    (traction,) = error.admissible.tractions
    name = traction.contact.name
    for result, tolerance in ((error, 1e-11), (error.solution, 1e-12)):
        forces = result.reactions()
        size = max(np.linalg.norm(f.force) for f in forces.values())
        assert np.linalg.norm(forces["balance"].force) < tolerance * size
        assert np.linalg.norm(forces["balance"].moment) < tolerance * size * error.domain.extent
        assert np.allclose(forces[name].force, result.force(name).force, rtol=0, atol=1e-14 * size)
    assert np.allclose(error.force(name).force, resultant(traction), rtol=0, atol=1e-12 * size)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("degree", [1, 2])
def test_reactions_of_a_linear_solution(dim, degree):
    """A bar in uniaxial strain between rollers.

    The stress is the same everywhere, and the elements hold it.
    """
    lam, G = 0.3 / (1.3 * 0.4), 1 / 2.6
    stress = 0.01 * np.array([lam + 2 * G, lam, lam][:dim])
    size = np.array([2.0, 1.0, 0.5][:dim])
    make = ec.rectangle if dim == 2 else ec.box
    domain = make((0.0,) * dim, tuple(size), cells=(2,) * dim)
    sides = {"left": (0, 0), "right": (0, 1), "bottom": (dim - 1, 0), "top": (dim - 1, 1)}
    sides |= {"front": (1, 0), "back": (1, 1)} if dim == 3 else {}
    held = [
        ec.Displacement(
            side,
            tuple((0.02 if side == "right" else 0.0) if i == axis else None for i in range(dim)),
        )
        for side, (axis, _) in sides.items()
    ]
    reactions = ec.solve(ec.Scene(ec.Elastic(1.0, 0.3), held), domain, degree=degree).reactions()
    assert set(reactions) == {*sides, "balance"}
    for side, (axis, end) in sides.items():
        force = np.zeros(3)
        force[axis] = (2 * end - 1) * stress[axis] * size.prod() / size[axis]
        middle = np.pad(size / 2, (0, 3 - dim))
        middle[axis] = end * size[axis]
        moment = np.cross(middle, force)
        assert np.allclose(reactions[side].force, force[:dim], rtol=0, atol=1e-14)
        assert np.allclose(
            reactions[side].moment, moment[2:] if dim == 2 else moment, rtol=0, atol=1e-14
        )


def test_force_of_a_solution_is_the_integral_of_its_profile():
    """Forces at nodes are the multiplier times the share of the area.

    The trapezes of the profile, exactly.
    """
    solution = ec.solve(common_block(), block(4), ec.AugmentedLagrangian())
    profile, force = solution.profile("bottom"), solution.force("bottom")
    assert np.trapezoid(profile["pressure"], profile["s"]) == pytest.approx(
        force.force[1], rel=1e-12
    )
    assert np.trapezoid(profile["shear"], profile["s"]) == pytest.approx(force.force[0], rel=1e-12)
    assert np.trapezoid(profile["pressure"] * profile["x"], profile["s"]) == pytest.approx(
        force.moment[0], rel=1e-12
    )


@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
@pytest.mark.parametrize("degree", [1, 2])
def test_profile_on_a_curved_gap_has_the_force_of_its_method(d, degree):
    """Tractions of Nitsche's method at single points are far from their means there."""
    n = 8 if d == 2 else 4
    middle = (0.5,) * (d - 1)
    domain = (
        ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(n, n // 2))
        if d == 2
        else ec.box((0.0,) * 3, (1.0,) * 3, cells=(n, n, n // 2))
    )
    gap = ec.Contact(
        "bottom",
        friction=0.2,
        gap=lambda x: 0.05 * sum((x[i] - middle[i]) ** 2 for i in range(d - 1)),
    )
    moved = ec.Displacement("top", (*(0.001,) * (d - 1), -0.02))
    solution = ec.solve(ec.Scene(ec.Elastic(1.0, 0.3), moved, contacts=gap), domain, degree=degree)
    profile, force = solution.profile("bottom"), solution.force("bottom").force
    assert profile["weight"] @ profile["pressure"] == pytest.approx(force[-1], rel=1e-9)


def test_solution_and_error_agree():
    """The multiplier of degree 1 is allowed and is r^, u does not penetrate and is u^; forces meet on fine meshes."""
    gaps = []
    for n in (4, 16):
        error = measured(common_block(), block(n))
        solution = error.solution
        own, other = solution.profile("bottom"), error.profile("bottom")
        for column in own.dtype.names:
            assert np.allclose(own[column], other[column], rtol=0, atol=1e-12), column
        own, other = solution.force("bottom"), error.force("bottom")
        assert np.allclose(own.force, other.force, rtol=0, atol=1e-12)
        gaps.append(abs(own.moment - other.moment)[0] / abs(other.moment)[0])
    assert (
        gaps[1] < 0.1 * gaps[0]
    )  # nodal forces are lumped: second order, but for the singular corners
    assert gaps[1] < 0.005


@pytest.mark.parametrize("method", [ec.Nitsche(), ec.AugmentedLagrangian()])
def test_contacts_that_meet_have_their_own_forces(method):
    """A square pressed into a corner without friction.

    Each wall pushes along its normal, also at the common node.
    """
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        loads=[ec.Traction("right", (-0.03, 0.0)), ec.Traction("top", (0.0, -0.02))],
        contacts=[ec.Contact("bottom"), ec.Contact("left")],
    )
    reactions = ec.solve(
        scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4)), method
    ).reactions()
    for name, force, moment in (("bottom", (0.0, 0.02), 0.01), ("left", (0.03, 0.0), -0.015)):
        assert np.allclose(reactions[name].force, force, rtol=0, atol=1e-14)
        assert np.allclose(reactions[name].moment, moment, rtol=0, atol=1e-14)


@pytest.mark.parametrize("degree", [1, 2])
def test_profile_of_a_line(degree):
    error = measured(common_block(), block(4), degree=degree, method=ec.Nitsche())
    profile = error.profile("bottom")
    assert np.all(np.diff(profile["s"]) >= 0)
    assert np.allclose(profile["s"], profile["x"])
    assert np.allclose(profile["y"], 0.0)
    force = error.force("bottom")
    tolerance = {1: 1e-12, 2: 0.02}[degree]  # trapezes of four parts of a parabola
    assert np.trapezoid(profile["pressure"], profile["s"]) == pytest.approx(
        force.force[1], rel=tolerance
    )
    assert np.trapezoid(profile["shear"], profile["s"]) == pytest.approx(
        force.force[0], rel=4 * tolerance
    )
    assert np.trapezoid(profile["pressure"] * profile["x"], profile["s"]) == pytest.approx(
        force.moment[0], rel=0.02
    )
    assert profile["gap"].min() >= -1e-12
    assert np.all(abs(profile["shear"]) <= profile["friction_bound"] + 1e-14)
    assert np.allclose(profile["friction_bound"], 0.3 * profile["pressure"], rtol=0, atol=1e-14)
    slips = profile["status"] == 1
    assert np.allclose(
        abs(profile["shear"])[slips], profile["friction_bound"][slips], rtol=0, atol=1e-6
    )
    assert set(profile["status"]) == {0, 1, 2} if degree == 1 else set(profile["status"]) >= {1, 2}


def test_profile_in_space():
    scene, domain = random_scene(5)
    error = measured(scene, domain)
    (traction,) = error.admissible.tractions
    profile = error.profile(traction.contact.name)
    corners = profile["pressure"].reshape(-1, 3)
    x = np.stack([profile[axis] for axis in "xyz"], axis=1).reshape(-1, 3, 3)
    area = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    assert area @ corners.mean(axis=1) == pytest.approx(
        error.force(traction.contact.name).force[2], rel=1e-10
    )


@pytest.mark.on_ranks("2-2", "3-1")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_weights_of_a_profile_integrate(d, degree):
    """The force of a contact is a sum over the rows of its profile."""
    scene, domain = (common_block(), block(4)) if d == 2 else random_scene(3)
    error = measured(scene, domain, degree=degree)
    name = scene.contacts[0].facets
    profile, force, model = error.profile(name), error.force(name), error.solution.model
    contact = model.contact(name)
    own = model.space.owned(contact.facets)
    area = COMM.allreduce(model.space.facet_areas(contact.facets[own]).sum())
    weight, pressure = profile["weight"], profile["pressure"]
    assert weight.min() > 0.0
    assert weight.sum() == pytest.approx(area, rel=1e-13)
    assert weight @ pressure == pytest.approx(force.force[d - 1], rel=1e-11)
    if d == 2:
        assert weight @ profile["shear"] == pytest.approx(force.force[0], rel=1e-11)


@pytest.mark.serial
def test_order_along_curves():
    """Two open curves and a closed one, their facets shuffled."""
    rng = np.random.default_rng(0)
    open_1, open_2, closed = np.arange(8), np.arange(8, 12), np.arange(12, 29)
    start = np.concatenate([open_1[:-1], open_2[:-1], closed])
    end = np.concatenate([open_1[1:], open_2[1:], np.roll(closed, -1)])
    x = rng.uniform(1.0, 2.0, (29, 2))
    x[8], x[0], x[20] = (0.0, 0.0), (0.1, 0.0), (0.2, 0.0)  # where the curves begin
    names = rng.permutation(29)
    expected = [*open_2[:-1], *open_1[:-1], *np.roll(closed, -8)]
    for _ in range(5):
        mixed = rng.permutation(len(start))
        order = order_along_curves(names[start[mixed]], names[end[mixed]], x[start[mixed]])
        assert start[mixed][order].tolist() == [int(v) for v in expected]


@pytest.mark.on_ranks("2-2", "1-3")
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("degree", [1, 2])
def test_values_at_points(dim, degree):
    """A body in a state of degree ``degree`` that the elements hold.

    The formula gives the values at any point.
    """
    E, nu = (lambda x: 1.0 + x[0] ** 2) if degree == 2 else 1.0, 0.0
    make = ec.rectangle if dim == 2 else ec.box
    domain = make((0.0,) * dim, (1.0,) * dim, cells=(5 - dim,) * dim)
    bent = float(degree - 1)
    values = [lambda x: 0.01 * (x[0] + bent * x[0] ** 2), *[0.0] * (dim - 1)]
    sides = ("left", "right", "bottom", "top", "front", "back")[: 2 * dim]
    scene = ec.Scene(ec.Elastic(E, nu), [ec.Displacement(side, tuple(values)) for side in sides])
    if degree == 2:  # -div of E(x) u' = 0.01 (1 + x^2)(1 + 2x)
        force = (
            lambda x: -0.01 * (2 * x[0] * (1 + 2 * x[0]) + 2 * (1 + x[0] ** 2)),
            *[0.0] * (dim - 1),
        )
        scene = ec.Scene(scene.material, scene.supports, [ec.BodyForce(force)])
    error = measured(scene, domain, degree=degree)
    points = np.random.default_rng(1).uniform(0.0, 1.0, (40, dim))
    points[0], points[1] = 1 / 3, 0.0  # a vertex, a corner
    found = error.at(points)
    x = points[:, 0]
    assert np.allclose(
        found.displacement[:, 0], 0.01 * (x + bent * x**2), rtol=0, atol=2e-5 * bent + 1e-15
    )
    sigma = (1 + bent * x**2) * 0.01 * (1 + 2 * bent * x)
    assert np.allclose(found.elastic_stress[:, 0, 0], sigma, rtol=0, atol=2e-3 * bent + 1e-14)
    assert np.allclose(found.stress[:, 0, 0], sigma, rtol=0, atol=2e-3 * bent + 1e-14)
    assert abs(found.stress[:, 0, 1]).max() < 2e-3 * bent + 1e-14


def test_values_near_a_facet_are_those_of_the_cell_there():
    """In any unit of length; a neighbour's would go on beyond the kink of a gap."""
    beyond = np.concatenate([-np.logspace(-12, -1, 23), [0.0], np.logspace(-12, -1, 23)])
    points = np.column_stack([1.0 + beyond, np.full(47, 0.3), np.zeros(47)])
    points = np.vstack([points, np.random.default_rng(2).uniform(0.0, 1.0, (20, 3))])
    moved = []
    for size in (1.0, 1e-6):
        domain = ec.box((0.0,) * 3, (3.0 * size, size, size), cells=(6, 2, 1))
        gap = ec.table([0.0, size, 3.0 * size], [0.0, 0.0, -0.006 * size])
        top = ec.Displacement("top", (0.0, 0.0, -0.05 * size))
        scene = ec.Scene(ec.Elastic(1.0, 0.3), [top], contacts=[ec.Contact("bottom", gap=gap)])
        error = measured(scene, domain)
        moved.append(error.at(size * points).displacement / size)
        on_contact = moved[-1][:47]
        assert (-on_contact[:, 2] - np.minimum(-0.003 * beyond, 0.0)).max() < 1e-14
        with pytest.raises(ec.InputError, match="outside the mesh"):
            error.at((size, 0.3 * size, -1e-5 * size))
    assert np.allclose(*moved, rtol=0, atol=1e-12)


def test_errors_say_what_is_wrong():
    error = measured(common_block(), block(4))
    with pytest.raises(ec.InputError, match=r"1 of the 2 points lie outside .* \(3\.0, 0\.0\)"):
        error.at([(1.0, 1.0), (3.0, 0.0)])
    with pytest.raises(ec.InputError, match=r"shape \(n, 2\)"):
        error.at((1.0, 1.0, 1.0))
    for result in (error, error.solution):
        with pytest.raises(
            ec.InputError, match="No contact is called 'top'; this scene has bottom"
        ):
            result.profile("top")
        with pytest.raises(ec.InputError, match="No boundary part is called 'foot'"):
            result.force("foot")
        with pytest.raises(ec.InputError, match="'von Mises'"):
            result.maximum("mises")


@pytest.mark.ranks
@pytest.mark.parametrize("seed", [2, 3])
def test_ranks_agree(seed):
    found, points = [], None
    for comm in (MPI.COMM_SELF, COMM):
        scene, domain = random_scene(seed, comm)
        error = measured(scene, domain)
        name = error.admissible.tractions[0].contact.name
        if points is None:  # one inside a cell, one at a vertex
            points = COMM.bcast(
                np.array([np.full(domain.dim, 0.37), domain.mesh.geometry.x[0, : domain.dim]])
            )
        found.append(
            [
                (one.profile(name), one.at(points), one.reactions())
                for one in (error, error.solution)
            ]
        )
    for (profile, at, forces), (profile_2, at_2, forces_2) in zip(*found, strict=True):
        for column in profile.dtype.names:
            size = max(abs(profile[column]).max(), 1e-3)
            assert np.allclose(profile[column], profile_2[column], rtol=0, atol=1e-9 * size)
        assert np.allclose(at.elastic_stress, at_2.elastic_stress, rtol=0, atol=1e-9)
        assert np.allclose(at.displacement, at_2.displacement, rtol=0, atol=1e-11)
        for name in forces:
            assert np.allclose(forces[name].force, forces_2[name].force, rtol=0, atol=1e-12)
            assert np.allclose(forces[name].moment, forces_2[name].moment, rtol=0, atol=1e-12)
    assert np.allclose(found[0][0][1].stress, found[1][0][1].stress, rtol=0, atol=1e-9)


@pytest.mark.parametrize("dim", [2, 3])
def test_maxima_and_their_places(dim):
    """A column under pressure.

    Uniaxial stress everywhere, the greatest displacement at its top.
    """
    make = ec.rectangle if dim == 2 else ec.box
    domain = make((0.0,) * dim, (1.0,) * (dim - 1) + (2.0,), cells=(2,) * dim)
    rollers = [ec.Displacement(name, (0.0, None, None)[:dim]) for name in ("left",)]
    rollers += [ec.Displacement("front", (None, 0.0, None))] if dim == 3 else []
    scene = ec.Scene(
        ec.Elastic(1.0, 0.0),
        rollers,
        [ec.Traction("top", pressure=0.01)],
        [ec.Contact("bottom", friction=0.3)],
    )
    error = measured(scene, domain)
    for result in (error, error.solution):
        assert result.maximum("von Mises").value == pytest.approx(0.01, rel=1e-9)
        deepest = result.maximum("displacement")
        assert deepest.value == pytest.approx(0.02, rel=1e-9)
        assert deepest.place[-1] == pytest.approx(2.0, rel=1e-14)
        pressure = result.maximum("pressure")
        assert pressure.value == pytest.approx(0.01, rel=1e-9)
        assert pressure.place[-1] == 0.0


def test_history_answers_for_its_best_result():
    history = ec.adapt(common_block(), block(4), 0.1)
    assert np.array_equal(history.profile("bottom"), history.error.profile("bottom"))
    assert np.array_equal(history.force("bottom").force, history.error.force("bottom").force)
    assert history.maximum("pressure").value == history.profile("bottom")["pressure"].max()
    assert history.at((1.0, 3.0)).stress.shape == (1, 2, 2)
    assert np.allclose(history.reactions()["balance"].force, 0.0, atol=1e-12)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_solution_has_values_at_points(degree):
    """Values of its own displacement: a patch of linear displacement."""
    sides = [
        ec.Displacement(side, (lambda x: 0.01 * x[0], lambda x: 0.02 * x[0]))
        for side in ("left", "right")
    ]
    sides += [
        ec.Displacement(side, (lambda x: 0.01 * x[0], lambda x: 0.02 * x[0]))
        for side in ("bottom", "top")
    ]
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3))
    solution = ec.solve(ec.Scene(ec.Elastic(2.0, 0.0), sides), domain, degree=degree)
    found = solution.at([(0.3, 0.4), (1 / 3, 1 / 3), (1.0, 0.0)])
    assert np.allclose(
        found.displacement, [[0.003, 0.006], [0.01 / 3, 0.02 / 3], [0.01, 0.02]], atol=1e-15
    )
    assert np.allclose(found.elastic_stress, [[0.02, 0.02], [0.02, 0.0]], atol=1e-14)
    with pytest.raises(ec.InputError, match="outside the mesh"):
        solution.at((1.5, 0.0))


@pytest.mark.ranks
def test_the_place_of_equal_maxima_does_not_depend_on_the_ranks():
    """A symmetric cube has each of its maxima at several places, equal but for round-off."""
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        [ec.Displacement("top", (0.0, 0.0, -0.05))],
        [],
        [ec.Contact("bottom", friction=0.3)],
    )
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        error = measured(
            scene, ec.box((0.0,) * 3, (1.0,) * 3, cells=(3, 3, 2), comm=comm), degree=2
        )
        found.append(
            [error.maximum(name) for name in ("von Mises", "displacement", "pressure", "shear")]
        )
    for alone, together in zip(*found, strict=True):
        assert together.value == pytest.approx(alone.value, rel=1e-9)
        assert np.allclose(together.place, alone.place, rtol=0, atol=1e-12)


@pytest.mark.serial
def test_histories_where_a_result_is_asked_for():
    """All that takes an error or a pair takes a run, too: its best result.

    A traction is had by its name.
    """
    scene, domain = moved_box(2, 0.02, 0.05)
    history = ec.adapt(scene, domain, accuracy=0.2, max_steps=2)
    error = history.error
    for question in (
        lambda of: ec.resultant(of, "bottom", (0.0, 1.0)).value,
        lambda of: ec.potential_energy(of).low,
        lambda of: ec.coulomb_certificate(of).q,
        lambda of: ec.size_map(of, 0.05).predicted_cells,
        lambda of: ec.mark(of).sum(),
        lambda of: results.force(of, "bottom").force,
        lambda of: results.reactions(of)["balance"].moment,
        lambda of: results.at(of, (0.3, 0.2)).stress,
        lambda of: results.profile(of, "bottom")["pressure"],
        results.mean_stress,
    ):
        assert np.array_equal(question(history), question(error))
    assert len(ec.other_solutions(history)) == len(ec.other_solutions(history.solution))
    by_name = history.solution.traction("bottom")
    assert (
        by_name.ufl_shape
        == history.solution.traction(history.solution.model.contact("bottom")).ufl_shape
        == (2,)
    )
    refused(lambda: history.solution.traction("foot"), "'foot'", "bottom")
    refused(lambda: ec.resultant(scene, "bottom", (0.0, 1.0)), "history", "constitutive_error")
    refused(lambda: results.force(history.solution, "bottom"), "history", "equilibrate")


def test_results_of_all_steps():
    """A history of loads has what a history of meshes has, with one axis more."""
    history = ec.evolve(
        lambda t: moved_box(2, 0.02 * t, 0.05)[0], moved_box(2, 0.0, 0.05)[1], [0.0, 0.5, 1.0], 0.9
    )
    at = history.at([(0.3, 0.2), (0.5, 0.5)])
    assert at.displacement.shape == (3, 2, 2)
    assert at.stress.shape == at.elastic_stress.shape == (3, 2, 2, 2)
    assert np.array_equal(at.stress[2], history.error.at([(0.3, 0.2), (0.5, 0.5)]).stress)
    greatest = history.maximum("von Mises")
    assert [step.value for step in greatest] == [
        error.maximum("von Mises").value for error in history.errors
    ]
    forces = history.reactions()
    assert np.array_equal(forces["bottom"].force, history.force("bottom"))
    assert forces["top"].moment.shape == (3, 1)
    assert abs(forces["balance"].force).max() <= 1e-12


@pytest.mark.parametrize("kind", ["meshes", "loads"])
def test_save_into_nowhere(kind, shared_tmp_path):
    """It is refused before anything is drawn, and the results can be saved elsewhere.

    Without pictures, too.
    """
    scene, domain = moved_box(2, 0.02, 0.05)
    if kind == "meshes":
        history = ec.adapt(scene, domain, accuracy=0.9)
    else:
        history = ec.evolve(lambda t: moved_box(2, 0.02 * t, 0.05)[0], domain, [0.0, 1.0], 0.9)
    file = shared_tmp_path / "file"
    if domain.mesh.comm.rank == 0:
        file.write_text("no folder")
    domain.mesh.comm.barrier()
    refused(lambda: history.save(file / "folder"), "file/folder", "Nothing can be saved", "save()")
    history.save(shared_tmp_path / "saved", pictures=False)
    if domain.mesh.comm.rank == 0:
        names = {path.name for path in (shared_tmp_path / "saved").iterdir()}
        assert {"report.html", "body.vtkhdf"} <= names
        assert not [name for name in names if name.endswith(".png")]
        assert "Pictures" not in (shared_tmp_path / "saved" / "report.html").read_text()


@pytest.mark.serial
def test_a_maximum_at_a_sharp_edge_grows():
    """At the ends of a clamped top the stress is infinite.

    15% more with each halving, and more.
    """
    history = ec.adapt(common_block(), block(4), 0.03)
    for quantity in ("von Mises", "pressure", "shear"):
        peak = history.maximum(quantity)
        best = int(np.argmin([step.total for step in history.steps]))
        assert len(peak.values) == len(peak.sizes) == len(history.steps)
        assert peak.values[best] == pytest.approx(history.error.maximum(quantity).value, rel=1e-12)
    peak = history.maximum("von Mises")
    assert peak.grows
    assert peak.values[-1] > 1.5 * peak.values[0]
    assert f"{peak.values[0]:.4g}, " in repr(peak)
    assert repr(peak).endswith("it grows: no limit is seen")
    assert history.maximum("displacement").values == ()
    assert "meshes" not in repr(history.error.maximum("von Mises"))


@pytest.mark.broad
@pytest.mark.serial
def test_a_maximum_inside_a_body_does_not_grow():
    """Half a disc on a plane.

    The greatest stress is below the middle of the contact.
    """
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=ec.Displacement("top", (0.0, -0.01)),
        contacts=ec.Contact("arc", gap=lambda x: x[1], normal=(0.0, -1.0)),
    )
    history = ec.adapt(
        scene, ec.read_mesh(ROOT / "meshes" / "half_disc.geo", scripts=True), 0.02, degree=2
    )
    for quantity in ("von Mises", "pressure"):
        assert history.maximum(quantity).grows is False
        assert repr(history.maximum(quantity)).endswith("no growth is seen")
    assert history.maximum("shear").grows is None  # there is none


@pytest.mark.serial
@pytest.mark.parametrize(
    ("exponent", "limit", "sizes", "grows"),
    [
        (0.3, 0.0, (1.0, 0.5, 0.25), True),
        (0.3, 0.0, (1.0, 1.0, 0.5, 0.5, 0.25), True),
        (0.3, 0.0, (1.0, 0.5), None),
        (0.3, 0.0, (1.0, 0.7, 0.5), None),
        (0.0, 0.0, (1.0, 0.5, 0.25), False),
        (-1.0, 2.0, (1.0, 0.5, 0.25, 0.125), False),
    ],
)
def test_trend_of_values(exponent, limit, sizes, grows):
    h = np.array(sizes)
    values = tuple(limit + np.sign(1 - limit) * h**-exponent)
    assert ec.results.Maximum(values[-1], np.zeros(2), values, sizes).grows is grows


@pytest.mark.ranks
def test_peaks_do_not_depend_on_the_ranks():
    scene = common_block()
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        history = ec.adapt(
            scene, ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14), comm=comm), 0.05
        )
        found.append([history.maximum(name) for name in ("von Mises", "pressure", "shear")])
    for alone, together in zip(*found, strict=True):
        assert together.values == pytest.approx(alone.values, rel=1e-6)
        assert together.sizes == pytest.approx(alone.sizes, rel=1e-9)
        assert together.grows is alone.grows


@pytest.mark.serial
@pytest.mark.parametrize("part", ["top", "bottom", "left", "right"])
def test_profiles_run_along_ascending_coordinates(part):
    """A user interpolates in them: ``np.interp(x, profile["x"], profile["pressure"])``."""
    bodies = {"top": "bottom", "bottom": "top", "left": "right", "right": "left"}
    block = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(6, 3))
    axis = 0 if part in ("top", "bottom") else 1
    inward = {"top": (0.01, -0.05), "bottom": (0.01, 0.05)}
    inward |= {"left": (0.05, 0.01), "right": (-0.05, 0.01)}
    # the opposite side pushes the body against the contact, and along it
    push = tuple(-step if place != axis else step for place, step in enumerate(inward[part]))
    support = ec.Displacement(bodies[part], push)
    scene = ec.Scene(ec.Elastic(1.0, 0.3), support, contacts=ec.Contact(part, friction=0.1))
    solution = ec.solve(scene, block)
    error = ec.constitutive_error(ec.equilibrate(solution))
    of_error = error.profile(part)
    for table in (solution.profile(part), of_error):
        assert np.all(np.diff(table["xy"[axis]]) >= 0)
        assert np.all(np.diff(table["s"]) >= 0)
    # the push is along the order, friction acts against it
    force = error.force(part).force[axis]
    assert force < 0
    assert of_error["weight"] @ of_error["shear"] == pytest.approx(force, rel=1e-9)
