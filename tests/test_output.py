"""What is written is what was computed, on any number of ranks.

Properties: fields read back from the files equal the arrays of the error (sum of eps_E^2, largest displacement,
integral of the stress, traction resultant), cells are positively oriented; a homogeneous stress comes back exactly,
with the stress out of plane; a status says open, slip or stick as the traction does; pictures show something, in 2D
and 3D; ranks > 0 load no plotting package; what fails on rank 0 fails on all ranks; a body without load is drawn too;
a relative error that is told in percent can be read back as a number, however small.
"""

import csv
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import block, patch_test, random_scene, resultant

import erc_contact as ec
from erc_contact import fields, output
from erc_contact.adapt import COLUMNS
from erc_contact.admissible.contact import ContactTraction
from erc_contact.percent import percent

COMM = MPI.COMM_WORLD
PLOTTING = {"pyvista", "vtkmodules", "matplotlib"}


def punch(d: int) -> tuple[ec.Scene, ec.Domain]:
    """A block on a bump: it sticks in the middle, slips at the ends of the contact, and is open beyond."""
    cells, size = ((32, 8), (4.0, 1.0)) if d == 2 else ((5, 2, 5), (4.0, 1.0, 4.0))

    def gap(x):
        return 0.03 * sum((x[i] - 1.9) ** 2 for i in range(0, d, 2))

    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.01, -0.05, 0.0)[:d])],
        contacts=[ec.Contact("bottom", friction=0.4, gap=gap)],
    )
    return scene, (ec.rectangle if d == 2 else ec.box)((0.0,) * d, size, cells=cells)


def error_of(scene: ec.Scene, domain: ec.Domain) -> ec.ConstitutiveError:
    return ec.constitutive_error(ec.equilibrate(ec.solve(scene, domain)))


@pytest.fixture(scope="module", params=[2, 3])
def error(request):
    return error_of(*punch(request.param))


@pytest.fixture(scope="module")
def history():
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    return ec.adapt(scene, block(2), accuracy=0.2, strategy=ec.Mark(0.3))


def read(path):
    """A file's grid on rank 0, as all ranks left it."""
    import pyvista

    assert path.is_file()
    return pyvista.read(path)


def check_picture(path):
    """On rank 0: a picture of some size that is neither blank nor of few colours, with a white frame."""
    if COMM.rank == 0:
        from matplotlib.image import imread

        assert path.stat().st_size > 10_000
        image = (imread(path)[..., :3] * 255).round().astype(int)
        colours, counts = np.unique(image @ [1, 256, 65536], return_counts=True)
        assert len(colours) > 50
        assert counts.max() < 0.98 * counts.sum()
        assert np.mean(image[:3] == 255) > 0.95
        assert min(image.shape[:2]) > 300


def total(values) -> float:
    return COMM.allreduce(float(np.sum(values)), MPI.SUM)


def test_body_file_holds_the_fields(error, shared_tmp_path):
    admissible, domain = error.admissible, error.admissible.solution.domain
    d, owned = domain.dim, domain.owned_cells
    u = admissible.displacement.x.array.reshape(-1, d)
    largest = COMM.allreduce(float(np.linalg.norm(u, axis=1).max()), MPI.MAX)
    volume = admissible.cells.volume[:owned]
    means = {
        "stress": fields.mean_stress(admissible)[:, :d, :d],
        "stress_fe": admissible.fe_stress[:owned].mean(axis=1),
    }
    sums = {name: COMM.allreduce(np.einsum("n,nij->ij", volume, mean), MPI.SUM) for name, mean in means.items()}
    body = total(volume)
    fields.write_fields(error, shared_tmp_path)
    if COMM.rank == 0:
        grid = read(shared_tmp_path / "body.vtkhdf")
        assert (grid.n_cells, grid.n_points) == (domain.cells, domain.vertices)
        assert np.sum(grid["eps_E"] ** 2) == pytest.approx(error.relative**2, rel=1e-12)
        assert np.linalg.norm(grid["displacement"], axis=1).max() == pytest.approx(largest, rel=1e-12)
        x = grid.points[grid.cells.reshape(-1, d + 2)[:, 1:], :d]
        signed = np.linalg.det(x[:, 1:] - x[:, :1]) / (1, 1, 2, 6)[d]
        assert np.all(signed > 0)
        assert signed.sum() == pytest.approx(body, rel=1e-12)
        for name, expected in sums.items():
            tensor = grid[name].reshape(-1, 3, 3)
            assert np.einsum("n,nij->ij", signed, tensor)[:d, :d] == pytest.approx(expected, rel=1e-10, abs=1e-14)
        tensor = grid["stress"].reshape(-1, 3, 3)
        assert tensor[:, 2, 2] == pytest.approx(0.3 * (tensor[:, 0, 0] + tensor[:, 1, 1])) or d == 3
        gradient_free = grid["displacement"][grid.points[:, 1] > 1 - 1e-12]
        assert gradient_free == pytest.approx(np.broadcast_to([0.01, -0.05, 0.0], gradient_free.shape), abs=1e-15)


def test_displacement_belongs_to_its_point(shared_tmp_path):
    scene, (b, c, e) = patch_test(0.3, 0.2)
    error = error_of(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), size=0.3))
    fields.write_fields(error, shared_tmp_path)
    if COMM.rank == 0:
        grid = read(shared_tmp_path / "body.vtkhdf")
        exact = np.column_stack([c + b * grid.points[:, 1], e * grid.points[:, 1], 0 * grid.points[:, 1]])
        assert grid["displacement"] == pytest.approx(exact, abs=1e-9)
        E, nu = 1.7, 0.2
        lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
        sigma = np.diag([lam * e, (lam + 2 * G) * e, lam * e])
        sigma[0, 1] = sigma[1, 0] = G * b
        for name in ("stress", "stress_fe"):
            assert grid[name] == pytest.approx(np.broadcast_to(sigma.ravel(), grid[name].shape), abs=1e-8)
        mises = np.sqrt((2 * G * e) ** 2 + 3 * (G * b) ** 2)
        assert grid["von_mises"] == pytest.approx(np.full(grid.n_cells, mises), rel=1e-6)


@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
def test_stress_out_of_plane(hypothesis):
    _, domain = random_scene(0)
    nu = {"lower": 0.3, "upper": lambda x: 0.1 + 0.05 * x[0]}
    scene = ec.Scene(
        material=ec.Elastic(1.0, nu, hypothesis),
        supports=[ec.Displacement("bottom", (0, 0))],
        loads=[ec.Traction("top", (0.01, -0.02))],
    )
    admissible = ec.equilibrate(ec.solve(scene, domain))
    stress = fields.mean_stress(admissible)
    x = domain.mesh.geometry.x[domain.mesh.geometry.dofmaps[0][: domain.owned_cells]].mean(axis=1)
    lower = np.isin(np.arange(domain.owned_cells), domain.region("lower"))
    expected = np.where(lower, 0.3, 0.1 + 0.05 * x[:, 0]) * (stress[:, 0, 0] + stress[:, 1, 1])
    if hypothesis == "plane stress":
        expected = 0 * expected
    assert stress[:, 2, 2] == pytest.approx(expected, abs=1e-15)
    assert not stress[:, 2, :2].any()


def test_contact_file_holds_the_traction(error, shared_tmp_path):
    traction = error.admissible.tractions[0]
    d = traction.values.shape[-1]
    force = resultant(traction)
    own = traction.contact.facets[:, 0] < error.admissible.solution.domain.owned_cells
    counts = COMM.allreduce(np.bincount(fields.contact_status(traction)[own], minlength=3), MPI.SUM)
    fields.write_fields(error, shared_tmp_path)
    if COMM.rank == 0:
        grid = read(shared_tmp_path / "contact_bottom.vtkhdf")
        nodes = grid.cells.reshape(-1, d + 1)[:, 1:]
        assert grid.n_points == nodes.size == d * counts.sum()
        area = np.abs(grid.compute_cell_sizes(volume=False)["Length" if d == 2 else "Area"])
        mean = grid["traction"][nodes].mean(axis=1)
        assert (area[:, None] * mean).sum(axis=0)[:d] == pytest.approx(force, rel=1e-10, abs=1e-14)
        assert grid["pressure"] == pytest.approx(grid["traction"][:, 1])
        assert grid["friction_bound"] == pytest.approx(0.4 * grid["pressure"])
        assert np.bincount(grid["status"], minlength=3).tolist() == counts.tolist()
        assert counts[fields.OPEN] > 0 < counts[fields.STICK]
        from_middle = abs(grid.points[nodes].mean(axis=1)[:, 0:d:2] - 1.9).max(axis=1)
        assert grid["status"][from_middle.argmin()] == fields.STICK
        assert grid["status"][from_middle.argmax()] == fields.OPEN
        assert abs(grid.points[:, 1]).max() < 1e-15


def test_status_of_tractions():
    contact = SimpleNamespace(direction=np.array([[0.0, -1.0]] * 5), bilateral=False, sampled=False)
    values = np.array(
        [
            [[0.0, 0.0], [0.0, 0.0]],  # open
            [[0.3, 1.0], [0.6, 2.0]],  # both nodes on the cone
            [[0.3, 1.0], [0.5, 2.0]],  # one of them
            [[0.0, 0.0], [-0.3, 1.0]],  # open at one node, slips at the other
            [[0.0, 1e-14], [0.0, 0.0]],  # pressure of round-off
        ]
    )
    traction = ContactTraction(contact, np.zeros((5, 2), dtype=int), np.ones(5), values, 0.3 * values[..., 1])
    O, L, S = fields.OPEN, fields.SLIP, fields.STICK  # noqa: E741
    assert fields.contact_status(traction).tolist() == [O, L, S, L, O]
    frictionless = replace(traction, values=values * [0, 1], bound=np.zeros((5, 2)))
    assert fields.contact_status(frictionless).tolist() == [O, L, L, L, O]
    nothing = replace(traction, values=0 * values, bound=np.zeros((5, 2)))
    assert fields.contact_status(nothing).tolist() == [O] * 5


def test_status_with_varying_friction():
    """A block that slides as a whole slips everywhere, also where friction varies."""
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.2, -0.03))],
        contacts=[ec.Contact("bottom", friction=lambda x: 0.1 + 0.2 * x[0])],
    )
    admissible = ec.equilibrate(ec.solve(scene, ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(16, 8))))
    status = fields.contact_status(admissible.tractions[0])
    assert np.all(status != fields.STICK)
    assert total(status == fields.SLIP) > 12


def test_pictures_show_something(error, shared_tmp_path):
    before = PLOTTING & set(sys.modules)
    domain = error.admissible.solution.domain
    output.draw_meshes([(domain, error.cells)] * (7 if domain.dim == 2 else 2), shared_tmp_path / "new" / "meshes.png")
    output.draw_error(error, shared_tmp_path / "error.png")
    output.draw_deformed(error, shared_tmp_path / "deformed.png")
    output.draw_deformed(error, shared_tmp_path / "as_it_is.png", factor=1.0)
    output.plot_contact(error.admissible, "bottom", shared_tmp_path / "contact.png")
    for name in ("new/meshes", "error", "deformed", "as_it_is", "contact"):
        check_picture(shared_tmp_path / f"{name}.png")
    if COMM.rank > 0:
        assert PLOTTING & set(sys.modules) == before


def test_picture_of_a_contact_on_a_slope(shared_tmp_path):
    scene, domain = punch(2)
    contact = ec.Contact("bottom", friction=0.3, normal=(0.1, -1.0))
    error = error_of(replace(scene, contacts=[contact]), domain)
    output.plot_contact(error.admissible, "bottom", shared_tmp_path / "contact.png")
    check_picture(shared_tmp_path / "contact.png")


def test_pictures_without_load(shared_tmp_path):
    scene = ec.Scene(material=ec.Elastic(1.0, 0.3), supports=[ec.Displacement("top", (0, 0))])
    history = ec.adapt(scene, block(2), accuracy=0.1)
    assert history.steps[-1].eps == 0
    history.save(shared_tmp_path)
    if COMM.rank == 0:
        names = {path.name for path in shared_tmp_path.iterdir()}
        assert names == {"history.csv", "error.png", "meshes.png", "error_map.png", "deformed.png", "body.vtkhdf"}
        assert not read(shared_tmp_path / "body.vtkhdf")["von_mises"].any()


def test_history_is_saved(history, shared_tmp_path):
    assert history.reached
    history.save(shared_tmp_path / "run")
    other = replace(history, accuracy=0.4)
    output.plot_history({"one": history, "other": other}, shared_tmp_path / "run" / "both.png")
    for name in ("error", "meshes", "error_map", "deformed", "contact_bottom", "both"):
        check_picture(shared_tmp_path / "run" / f"{name}.png")
    if COMM.rank == 0:
        with (shared_tmp_path / "run" / "history.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == len(history.steps)
        for name in COLUMNS:
            assert [float(row[name]) for row in rows] == history.column(name).tolist()
        grid = read(shared_tmp_path / "run" / "body.vtkhdf")
        assert np.sum(grid["eps_E"] ** 2) == pytest.approx(history.best.relative**2, rel=1e-12)


def number(text: str) -> float:
    """A percentage as a ratio."""
    assert text.endswith("%")
    return float(text[:-1]) / 100


@pytest.mark.parametrize("digits", [3, 4])
def test_percentages_are_numbers(digits):
    for ratio in [*np.geomspace(1.1e-17, 1e7, 241), 0.0, 0.9996, 0.99996, 9.9999e-5]:
        told = percent(float(ratio), digits)
        significant = digits - (ratio < 1e-4 or ratio >= 1e4) - (ratio < 1e-11)
        assert number(told) == pytest.approx(ratio, rel=0.51 * 10.0 ** (1 - significant), abs=0.0051 * (ratio >= 1))
        assert digits > 3 or len(told) <= 7
    assert percent(float("nan"), digits) == "nan%"


def test_small_errors_are_told():
    """The patch test is solved to round-off: table and outcome say to how much of it."""
    scene, _ = patch_test(0.3, 0.2)
    history = ec.adapt(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3)), accuracy=2.5e-6)
    (step,) = history.steps
    header, row, outcome = str(history).splitlines()
    assert 0 < step.eps < 2.5e-6
    told = [word for word in row.split() if word.endswith("%")]
    assert [number(word) for word in told] == pytest.approx([step.eps, step.bulk, step.contact], rel=0.5)
    assert len(row) == len(header)
    reached, _, accuracy = outcome.removeprefix("Reached: ").removesuffix(".").split()
    assert number(reached) == pytest.approx(step.eps, rel=0.05)
    assert number(accuracy) == pytest.approx(2.5e-6, rel=1e-12)


def test_unknown_contact_and_empty_input(error, shared_tmp_path):
    with pytest.raises(ec.InputError, match="no contact is called 'botom'; the scene has bottom"):
        output.plot_contact(error.admissible, "botom", shared_tmp_path / "x.png")
    with pytest.raises(ec.InputError, match="no history"):
        output.plot_history({}, shared_tmp_path / "x.png")
    with pytest.raises(ec.InputError, match="no mesh"):
        output.draw_meshes([], shared_tmp_path / "x.png")


def test_what_fails_on_one_rank_fails_on_all(error, shared_tmp_path):
    if COMM.rank == 0:
        (shared_tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        output.draw_error(error, shared_tmp_path / "file" / "x.png")
    with pytest.raises(OSError, match="file"):
        fields.write_fields(error, shared_tmp_path / "file")
