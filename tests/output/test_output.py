"""What is written is what was computed, on any number of ranks.

Properties: fields read back from the files equal the arrays of the error (sum of
eps_E^2, largest displacement, integral of the stress, traction resultant), cells are
positively oriented; a homogeneous stress comes back exactly, with the stress out of
plane; a status says open, slip or stick as the traction does; pictures show something,
in 2D and 3D; ranks > 0 load no plotting package; what fails on rank 0 fails on all
ranks; a body without load is drawn too; a relative error that is told in percent can be
read back as a number, however small.

Of degree 2 all nodes are written, drawn and can be integrated; the area under a drawn
pressure is the resultant, also of a curved or closed contact; a picture magnifies gap
and displacement alike, so that no body enters its foundation; a contact in 3D is
seen; directions have clean names; a stress out of plane that nobody knows is not shown
as zero; files are no larger than what they hold.
"""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import ufl
from domains import partly_broad
from mpi4py import MPI
from processes import ROOT
from scenes import block, measured, mostly_serial, patch_test, random_scene, resultant

import erc_contact as ec
from erc_contact import output, results
from erc_contact.admissible.traction import ContactTraction
from erc_contact.output import contact_plots, gathered
from erc_contact.output.gallery import Gallery
from namedmesh.base.percent import percent
from namedmesh.base.releases import cell_nodes
from namedmesh.pictures import new_figure, views

COMM = MPI.COMM_WORLD
PLOTTING = {"pyvista", "vtkmodules", "matplotlib"}


def punch(d: int) -> tuple[ec.Scene, ec.Domain]:
    """A block on a bump.

    It sticks in the middle, slips at the ends of the contact, and is open beyond.
    """
    cells, size = ((32, 8), (4.0, 1.0)) if d == 2 else ((5, 5, 2), (4.0, 4.0, 1.0))

    def gap(x):
        return 0.03 * sum((x[i] - 1.9) ** 2 for i in range(d - 1))

    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.01, *[0.0] * (d - 2), -0.05))],
        contacts=[ec.Contact("bottom", friction=0.4, gap=gap)],
    )
    return scene, (ec.rectangle if d == 2 else ec.box)((0.0,) * d, size, cells=cells)


@pytest.fixture(scope="module", params=[2, 3])
def error(request):
    return measured(*punch(request.param))


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


@pytest.fixture
def seen(monkeypatch):
    """What rank 0 would draw: figures, meshes with their looks, directions of view.

    Nothing is rendered or saved.
    """
    record = SimpleNamespace(figures=[], meshes=[], views=[])
    if COMM.rank == 0:
        import pyvista
        from matplotlib.figure import Figure

        add = pyvista.Plotter.add_mesh

        def savefig(figure, *args, **kwargs):
            record.figures.append(figure)

        def add_mesh(plotter, mesh, **look):
            record.meshes.append((mesh.copy(), look))
            return add(plotter, mesh, **look)

        def screenshot(plotter, **kwargs):
            record.views.append(np.array(plotter.camera.direction))
            return np.full((9, 9, 3), 255, dtype=np.uint8)

        def add_flat(axes, data, look):
            record.meshes.append((data.copy(), look))
            draw_flat(axes, data, look)

        draw_flat = views.add_flat
        monkeypatch.setattr(views, "add_flat", add_flat)
        monkeypatch.setattr(Figure, "savefig", savefig)
        monkeypatch.setattr(pyvista.Plotter, "add_mesh", add_mesh)
        monkeypatch.setattr(pyvista.Plotter, "screenshot", screenshot)
    return record


def texts(figure) -> list[str]:
    """All words of a figure."""
    from matplotlib.text import Text

    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def areas(axes, width: float) -> list[float]:
    """Areas under the curves of a contact of some line width, from left to right.

    Of the pressure and of the shear.
    """
    found = []
    for colour in (contact_plots.PRESSURE, contact_plots.SHEAR):
        (line,) = [
            line
            for line in axes.lines
            if line.get_color() == colour and line.get_linewidth() == width
        ]
        x, y = line.get_xdata(), line.get_ydata()
        assert np.all(np.diff(x[np.isfinite(x)]) >= -1e-12 * np.nanmax(abs(x)))
        found.append(float(np.nansum(0.5 * (y[1:] + y[:-1]) * np.diff(x))))
    return found


CURVE, FACETS = 1.6, 0.5
"""Widths of the curves of a traction, and of the lines that show it facet by facet."""


def total(values) -> float:
    return COMM.allreduce(float(np.sum(values)), MPI.SUM)


def test_body_file_holds_the_fields(error, shared_tmp_path):
    admissible, domain = error.admissible, error.domain
    d, owned = domain.dim, domain.owned_cells
    u = admissible.displacement.x.array.reshape(-1, d)
    largest = COMM.allreduce(float(np.linalg.norm(u, axis=1).max()), MPI.MAX)
    volume = admissible.cell_geometry.volume[:owned]
    means = {
        "stress": results.mean_stress(admissible)[:, :d, :d],
        "stress_fe": admissible.fe_stress[:owned].mean(axis=1),
    }
    sums = {
        name: COMM.allreduce(np.einsum("n,nij->ij", volume, mean), MPI.SUM)
        for name, mean in means.items()
    }
    body = total(volume)
    output.write_fields(error, shared_tmp_path)
    if COMM.rank == 0:
        grid = read(shared_tmp_path / "body.vtkhdf")
        assert (grid.n_cells, grid.n_points) == (domain.cells, domain.vertices)
        assert np.sum(grid["eps_E"] ** 2) == pytest.approx(error.relative**2, rel=1e-12)
        assert np.linalg.norm(grid["displacement"], axis=1).max() == pytest.approx(
            largest, rel=1e-12
        )
        x = grid.points[grid.cells.reshape(-1, d + 2)[:, 1:], :d]
        signed = np.linalg.det(x[:, 1:] - x[:, :1]) / (1, 1, 2, 6)[d]
        assert np.all(signed > 0)
        assert signed.sum() == pytest.approx(body, rel=1e-12)
        for name, expected in sums.items():
            tensor = grid[name].reshape(-1, 3, 3)
            assert np.einsum("n,nij->ij", signed, tensor)[:d, :d] == pytest.approx(
                expected, rel=1e-10, abs=1e-14
            )
        tensor = grid["stress"].reshape(-1, 3, 3)
        assert tensor[:, 2, 2] == pytest.approx(0.3 * (tensor[:, 0, 0] + tensor[:, 1, 1])) or d == 3
        moved = grid["displacement"][grid.points[:, d - 1] > 1 - 1e-12]
        assert moved == pytest.approx(
            np.tile([0.01, -0.05, 0.0] if d == 2 else [0.01, 0.0, -0.05], (len(moved), 1))
        )


def test_displacement_belongs_to_its_point(shared_tmp_path):
    scene, (b, c, e) = patch_test(0.3, 0.2)
    error = measured(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), size=0.3))
    output.write_fields(error, shared_tmp_path)
    if COMM.rank == 0:
        grid = read(shared_tmp_path / "body.vtkhdf")
        exact = np.column_stack(
            [c + b * grid.points[:, 1], e * grid.points[:, 1], 0 * grid.points[:, 1]]
        )
        assert grid["displacement"] == pytest.approx(exact, abs=1e-9)
        E, nu = 1.7, 0.2
        lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
        sigma = np.diag([lam * e, (lam + 2 * G) * e, lam * e])
        sigma[0, 1] = sigma[1, 0] = G * b
        for name in ("stress", "stress_fe"):
            assert grid[name] == pytest.approx(
                np.broadcast_to(sigma.ravel(), grid[name].shape), abs=1e-8
            )
        mises = np.sqrt((2 * G * e) ** 2 + 3 * (G * b) ** 2)
        assert grid["von_mises"] == pytest.approx(np.full(grid.n_cells, mises), rel=1e-6)


@pytest.mark.serial
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
    stress = results.mean_stress(admissible)
    x = domain.mesh.geometry.x[cell_nodes(domain.mesh.geometry)[: domain.owned_cells]].mean(axis=1)
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
    own = traction.contact.facets[:, 0] < error.domain.owned_cells
    counts = COMM.allreduce(
        np.bincount(results.contact_status(error, "bottom")[own], minlength=3), MPI.SUM
    )
    profile = error.profile("bottom")
    output.write_fields(error, shared_tmp_path)
    if COMM.rank == 0:
        grid = read(shared_tmp_path / "contact_bottom.vtkhdf")
        nodes = grid.cells.reshape(-1, d + 1)[:, 1:]
        assert grid.n_points == nodes.size == d * counts.sum()
        area = np.abs(grid.compute_cell_sizes(volume=False)["Length" if d == 2 else "Area"])
        mean = grid["traction"][nodes].mean(axis=1)
        assert (area[:, None] * mean).sum(axis=0)[:d] == pytest.approx(force, rel=1e-10, abs=1e-14)
        assert grid["pressure"] == pytest.approx(grid["traction"][:, d - 1])
        assert grid["friction_bound"] == pytest.approx(0.4 * grid["pressure"])
        assert np.bincount(grid["status"], minlength=3).tolist() == counts.tolist()
        assert counts[results.OPEN] > 0 < counts[results.STICK]
        from_middle = abs(grid.points[nodes].mean(axis=1)[:, : d - 1] - 1.9).max(axis=1)
        assert grid["status"][from_middle.argmin()] == results.STICK
        assert grid["status"][from_middle.argmax()] == results.OPEN
        assert abs(grid.points[:, d - 1]).max() < 1e-15
        slip = np.linalg.norm(grid["slip"], axis=1)
        for name, written in (("gap", grid["gap"]), ("slip", slip)):
            expected = np.sort(abs(profile[name]))
            assert np.sort(written) == pytest.approx(expected, rel=1e-9, abs=1e-14)
        assert grid["gap"].max() > 1e-3


def contact_with(direction):
    """Return what pictures read of a contact whose facets have given normals."""
    trace = SimpleNamespace(corner_normals=None, normals=direction[:, None])
    return SimpleNamespace(
        direction=direction, trace=trace, bilateral=False, sampled=False, against=None
    )


@pytest.mark.broad
@pytest.mark.serial
def test_pictures_show_something(error, shared_tmp_path):
    before = PLOTTING & set(sys.modules)
    domain = error.domain
    names = ["new/meshes", "sizes", "deformed", "contact"]
    output.draw_meshes(
        [(domain, error.indicators)] * (7 if domain.dim == 2 else 2),
        shared_tmp_path / "new" / "meshes.png",
    )
    output.draw_sizes(ec.size_map(error, 0.5 * error.relative), shared_tmp_path / "sizes.png")
    run = SimpleNamespace(error=error)  # as a history has it
    output.draw_deformed(run, shared_tmp_path / "deformed.png")
    output.plot_contact(error, "bottom", shared_tmp_path / "contact.png")
    if domain.dim == 2:  # in 3D they are drawn as the sizes and the deformed body are
        names += ["error", "as_it_is"]
        output.draw_error(run, shared_tmp_path / "error.png")
        output.draw_deformed(error, shared_tmp_path / "as_it_is.png", factor=1.0)
    for name in names:
        check_picture(shared_tmp_path / f"{name}.png")
    if COMM.rank > 0:
        assert PLOTTING & set(sys.modules) == before


@pytest.mark.serial
def test_picture_of_a_contact_on_a_slope(shared_tmp_path):
    scene, domain = punch(2)
    contact = ec.Contact("bottom", friction=0.3, normal=(0.1, -1.0))
    error = measured(replace(scene, contacts=[contact]), domain)
    output.plot_contact(error.admissible, "bottom", shared_tmp_path / "contact.png")
    check_picture(shared_tmp_path / "contact.png")


@pytest.mark.serial
def test_nothing_to_show_has_no_picture(shared_tmp_path):
    """One mesh has no curve of its error, no load no error and no displacement."""
    scene = ec.Scene(material=ec.Elastic(1.0, 0.3), supports=[ec.Displacement("top", (0, 0))])
    history = ec.adapt(scene, block(2), accuracy=0.1)
    assert history.steps[-1].eps == 0
    history.save(shared_tmp_path)
    if COMM.rank == 0:
        names = {path.name for path in shared_tmp_path.iterdir()}
        assert names == {
            "report.html",
            "history.csv",
            "history.json",
            "body.vtkhdf",
            "meshes.vtkhdf",
            "domain.vtkhdf",
        }
        assert not read(shared_tmp_path / "body.vtkhdf")["von_mises"].any()


def number(text: str) -> float:
    """A percentage as a ratio."""
    assert text.endswith("%")
    return float(text[:-1]) / 100


@pytest.mark.serial
@pytest.mark.parametrize("digits", [3, 4])
def test_percentages_are_numbers(digits):
    for ratio in [*np.geomspace(1.1e-17, 1e7, 241), 0.0, 0.9996, 0.99996, 9.9999e-5]:
        told = percent(float(ratio), digits)
        significant = digits - (ratio < 1e-4 or ratio >= 1e4) - (ratio < 1e-11)
        assert number(told) == pytest.approx(
            ratio, rel=0.51 * 10.0 ** (1 - significant), abs=0.0051 * (ratio >= 1)
        )
        assert digits > 3 or len(told) <= 7
    assert percent(float("nan"), digits) == "nan%"


@pytest.mark.serial
def test_small_errors_are_told():
    """The patch test is solved to round-off.

    Table and outcome say to how much of it.
    """
    scene, _ = patch_test(0.3, 0.2)
    history = ec.adapt(scene, ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 3)), accuracy=2.5e-6)
    (step,) = history.steps
    header, row, outcome = str(history).splitlines()
    assert 0 < step.eps < 2.5e-6
    told = [word for word in row.split() if word.endswith("%")]
    assert [number(word) for word in told] == pytest.approx(
        [step.eps, step.eps_bulk, step.eps_contact], rel=0.5
    )
    assert len(row) == len(header)
    reached, _, accuracy = outcome.removeprefix("Reached: ").removesuffix(".").split()
    assert number(reached) == pytest.approx(step.eps, rel=0.05)
    assert number(accuracy) == pytest.approx(2.5e-6, rel=1e-12)


@pytest.mark.on_ranks("3")
@pytest.mark.parametrize("d", [2, 3])
def test_degree_2_is_written_at_all_nodes(d, shared_tmp_path):
    from dolfinx import fem

    scene, domain = (
        punch(d) if d == 2 else (punch(3)[0], ec.box((0.0,) * 3, (4.0, 4.0, 1.0), cells=(3, 3, 1)))
    )
    error = measured(scene, domain, degree=2)
    u, (traction,) = error.admissible.displacement, error.admissible.tractions
    integral = [
        COMM.allreduce(fem.assemble_scalar(fem.form(u[i] * ufl.dx)), MPI.SUM) for i in range(d)
    ]
    nodes = u.function_space.dofmap.index_map.size_global
    force = resultant(traction)
    output.write_fields(error, shared_tmp_path)
    if COMM.rank == 0:
        import pyvista

        grid = read(shared_tmp_path / "body.vtkhdf")
        kind = {2: pyvista.CellType.QUADRATIC_TRIANGLE, 3: pyvista.CellType.QUADRATIC_TETRA}[d]
        assert set(grid.celltypes) == {kind}
        assert grid.n_points == nodes
        cells = grid.cells_dict[kind]
        ends = np.array(
            [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)][: 3 * d - 3]
        )  # as VTK numbers them
        x = grid.points[cells]
        assert x[:, d + 1 :] == pytest.approx(x[:, ends].mean(axis=2), abs=1e-14)
        volume = np.linalg.det(x[:, 1 : d + 1, :d] - x[:, :1, :d]) / (1, 1, 2, 6)[d]
        weights = np.repeat([[0.0, 1 / 3], [-1 / 20, 1 / 5]][d - 2], [d + 1, 3 * d - 3])
        values = grid["displacement"][cells]
        assert np.einsum("n,v,nvi->i", volume, weights, values)[:d] == pytest.approx(
            integral, rel=1e-10, abs=1e-14
        )
        assert np.all(volume > 0)

        surface = read(shared_tmp_path / "contact_bottom.vtkhdf")
        kind = {2: pyvista.CellType.POLY_LINE, 3: pyvista.CellType.QUADRATIC_TRIANGLE}[d]
        facets = surface.cells_dict[kind]
        assert facets.size == surface.n_points
        x, values = surface.points[facets], surface["traction"][facets][..., :d]
        if d == 2:
            written = np.sum(
                abs(np.diff(x[..., :1], axis=1)) * 0.5 * (values[:, 1:] + values[:, :-1]),
                axis=(0, 1),
            )
            assert written == pytest.approx(force, rel=1e-3, abs=1e-4)
            assert surface.integrate_data()["pressure"][0] == pytest.approx(force[1], rel=1e-3)
        else:
            assert x[:, 3:] == pytest.approx(x[:, ends[:3]].mean(axis=2), abs=1e-14)
            area = abs(np.linalg.det(x[:, 1:3, :2] - x[:, :1, :2])) / 2
            written = np.einsum("n,nvi->i", area / 3, values[:, 3:])
            assert written == pytest.approx(force, rel=1e-10, abs=1e-14)
        assert surface["pressure"] == pytest.approx(surface["traction"][:, d - 1])
        assert surface["friction_bound"] == pytest.approx(0.4 * surface["pressure"])
        sums = surface.integrate_data().cell_data["mean_traction"][0, :d]
        assert sums == pytest.approx(force, rel=1e-10, abs=1e-14)


def test_name_of_a_contact_with_a_slash(shared_tmp_path):
    """Names of parts of a drawing may look like paths."""
    scene, domain = punch(2)
    names = {name.replace("bottom", "Shapes/bottom"): tag for name, tag in domain.names.items()}
    domain = ec.Domain(domain.mesh, domain.facet_tags, names)
    scene = replace(scene, contacts=[ec.Contact("Shapes/bottom", friction=0.3)])
    output.write_fields(measured(scene, domain), shared_tmp_path)
    if COMM.rank == 0:
        (file,) = shared_tmp_path.glob("contact_Shapes-bottom-*.vtkhdf")
        assert read(file)["pressure"].max() > 0
        with h5py.File(file) as whole:
            assert whole["part"].asstr()[()] == "Shapes/bottom"


@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_files_are_small(degree, shared_tmp_path):
    for cells in ((4, 2), (32, 16)):
        error = measured(
            punch(2)[0], ec.rectangle((0.0, 0.0), (4.0, 1.0), cells=cells), degree=degree
        )
        output.write_fields(error, shared_tmp_path)
        if COMM.rank == 0:
            for name, many in (("body", error.domain.cells), ("contact_bottom", cells[0])):
                assert (shared_tmp_path / f"{name}.vtkhdf").stat().st_size < 60e3 + 1e3 * many


def test_file_that_cannot_be_written(error, shared_tmp_path):
    if COMM.rank == 0:
        (shared_tmp_path / "body.vtkhdf").mkdir()
    with pytest.raises(OSError, match="body"):
        output.write_fields(error, shared_tmp_path)


@pytest.mark.on_ranks("1-half disc", "2-block")
@pytest.mark.parametrize("body", ["block", "half disc"])
@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.broad)])
def test_area_under_the_pressure_is_the_force(degree, body, shared_tmp_path, seen):
    scene, domain = punch(2)
    if body == "half disc":
        domain = ec.read_mesh(Path(__file__).parents[2] / "meshes" / "half_disc.msh")
        scene = replace(
            scene,
            contacts=[ec.Contact("arc", friction=0.4, normal=(0.0, -1.0), gap=lambda x: x[1])],
        )
    error = measured(scene, domain, degree=degree)
    output.plot_contact(error.admissible, scene.contacts[0].facets, shared_tmp_path / "contact.png")
    force = resultant(error.admissible.tractions[0])
    if COMM.rank == 0:
        shear, pressure = force
        for width in (CURVE, FACETS)[: 3 - degree]:
            found = areas(seen.figures[0].axes[0], width)
            assert found == pytest.approx([pressure, shear], rel=1e-3, abs=1e-3 * pressure)


@pytest.mark.serial
@pytest.mark.parametrize("shape", ["arc", "ring", "two arcs", "two feet"])
def test_area_under_the_pressure_of_any_contact(shape):
    """A ring is cut where nothing presses; facets come in any order and direction.

    Parts may lie apart.
    """
    if COMM.rank > 0:
        return
    rng = np.random.default_rng(3)
    many = 40
    angle = np.linspace(0.0, 2 * np.pi if shape == "ring" else 2.5, many + 1)
    ends = np.column_stack(
        [np.arange(many), np.arange(1, many + 1) % (many if shape == "ring" else many + 1)]
    )
    if "two" in shape:
        ends = np.delete(ends, 9, axis=0)
    ends = ends[rng.permutation(len(ends))]
    turned = rng.random(len(ends)) < 0.5
    ends[turned] = ends[turned, ::-1]
    x = 3e-3 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])[ends]
    if shape == "two feet":
        x = 3e-3 * np.column_stack([angle, 0 * angle, 0 * angle])[ends]
    n = x.mean(axis=1)[:, :2]
    n = (
        n / np.linalg.norm(n, axis=1)[:, None]
        if shape != "two feet"
        else np.array([[0.0, -1.0]] * len(ends))
    )
    area = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    pressure = 5e6 * np.maximum(np.cos(angle - 1.0), 0.0)[ends]
    values = (
        -pressure[..., None] * n[:, None]
        + 0.1 * pressure[..., None] * np.column_stack([-n[:, 1], n[:, 0]])[:, None]
    )
    contact = contact_with(n)
    traction = ContactTraction(contact, ends, area, values, 0.3 * pressure)
    zero = np.zeros(ends.shape)
    status = np.full(len(ends), results.STICK)
    axes = contact_plots.contact_curves(
        gathered.WholeContact(
            traction, x, ends, zero, zero, 0 * x, x, zero, status, partners=ends[:0]
        )
    )
    force = float(area @ pressure.mean(axis=1))
    assert areas(axes, FACETS) == pytest.approx([force, 0.1 * force], rel=1e-9)
    assert areas(axes, CURVE) == pytest.approx([force, 0.1 * force], rel=1e-3)
    line = axes.lines[1]
    apart = {"two arcs": 0.05 * area.sum(), "two feet": 3e-3 * angle[1]}.get(shape, 0.0)
    assert np.ptp(line.get_xdata()[np.isfinite(line.get_xdata())]) == pytest.approx(
        area.sum() + apart, rel=1e-9
    )
    assert (
        np.nanmax(abs(np.diff(line.get_ydata()))) < 0.3 * pressure.max()
    )  # neighbours stand side by side
    expected = "x [length]" if shape == "two feet" else "arc length from ("
    assert axes.get_xlabel().startswith(expected)


@pytest.mark.on_ranks("2")
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.broad)])
def test_curved_edges_are_drawn(d, shared_tmp_path, seen):
    """Pure bending is quadratic.

    A lower edge, drawn by two elements, becomes a parabola.
    """
    nu, bend, factor = 0.25, 0.01, 20.0
    u = [
        (
            lambda x: -bend * x[0] * x[1],
            lambda x: bend / 2 * (x[0] ** 2 + nu / (1 - nu) * x[1] ** 2),
        ),
        (
            lambda x: -bend * x[0] * x[1],
            lambda x: bend / 2 * (x[0] ** 2 + nu * (x[1] ** 2 - x[2] ** 2)),
            lambda x: bend * nu * x[1] * x[2],
        ),
    ][d - 2]
    sides = ("left", "right", "bottom", "top", "front", "back")[: 2 * d]
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=nu), supports=[ec.Displacement(name, u) for name in sides]
    )
    make = ec.rectangle if d == 2 else ec.box
    error = measured(scene, make((0.0,) * d, (2.0, 1.0, 1.0)[:d], cells=(2, 1, 1)[:d]), degree=2)
    assert error.relative < 1e-8
    output.draw_deformed(error, shared_tmp_path / "deformed.png", factor=factor)
    if COMM.rank == 0:
        x, y, z = np.concatenate([mesh.points for mesh, _ in seen.meshes]).T
        lower = (abs(y - factor * bend / 2 * x**2) < 0.01) & (
            abs(z) < 0.01
        )  # lines are drawn a little in front
        assert len(np.unique(x[lower].round(2))) >= 9
        assert "displacement × 20" in texts(seen.figures[0])


def ground_and_nodes(error, seen):
    """On rank 0: the drawn line of the only foundation, from left to right, and the contact nodes with their u^."""
    model, (traction,) = error.solution.model, error.admissible.tractions
    nodes = np.unique(traction.nodes[model.space.owned(traction.contact.facets)])
    x = model.space.V.tabulate_dof_coordinates()[nodes, :2]
    u = error.admissible.displacement.x.array.reshape(-1, 2)[nodes]
    every = np.concatenate(COMM.allgather(np.column_stack([x, u])))
    if COMM.rank > 0:
        return None, every
    ground = [mesh.points for mesh, look in seen.meshes if look.get("color") == "#505050"][-1]
    return ground[np.argsort(ground[:, 0])], every


GAPS = {"none": 0.0, "constant": 0.02, "linear": lambda x: 0.01 * x[0]}


@pytest.mark.on_ranks("linear")
@pytest.mark.parametrize("gap", partly_broad(GAPS, list(GAPS)[1:-1]))
def test_flat_foundation_is_met_where_the_contact_is_closed(gap, shared_tmp_path, seen):
    """Its gap is not magnified.

    It is moved with the body, so that what is closed looks closed, and nothing enters.
    """
    scene, domain = punch(2)
    scene = replace(scene, contacts=[replace(scene.contacts[0], gap=GAPS[gap])])
    error, factor = measured(scene, domain), 7.0
    output.draw_deformed(error, shared_tmp_path / "deformed.png", factor=factor)
    ground, nodes = ground_and_nodes(error, seen)
    if COMM.rank == 0:
        x, y = (nodes[:, :2] + factor * nodes[:, 2:]).T
        known = (x >= ground[0, 0]) & (x <= ground[-1, 0])
        clear = (y - np.interp(x, *ground[:, :2].T))[known]
        assert np.count_nonzero(known) > 30
        assert (
            clear.min() > -1e-3
        )  # where the contact slips along a slope, it does so on the drawn slope, too
        assert np.count_nonzero(clear < 1e-3) > 15
        line = np.polynomial.Polynomial.fit(*ground[:, :2].T, 1)
        assert ground[:, 1] == pytest.approx(line(ground[:, 0]), abs=1e-9)
        if gap != "linear":
            assert clear.min() > -1e-9
            assert np.count_nonzero(clear < 1e-9) > 15
            assert ground[0, 0] < x.min() < x.max() < ground[-1, 0]
        body = np.concatenate([mesh.points for mesh, _ in seen.meshes])
        assert (
            max(abs(body[:, :2] - point).max(axis=1).min() for point in np.column_stack([x, y]))
            < 1e-6
        )
        words = texts(seen.figures[0])
        moved = ", foundation moved with it" * (gap != "none")
        assert f"displacement × 7{moved}\norange: closed contact" in words
        orange = [mesh for mesh, look in seen.meshes if look.get("color") == "#D55E00"]
        assert len(orange) == 1


@pytest.mark.parametrize("factor", [None, pytest.param(9.0, marks=pytest.mark.broad)])
def test_curved_foundation_is_drawn_as_it_is(factor, shared_tmp_path, seen):
    """Not magnified.

    The default magnification is so small that the body hardly enters it.
    """
    error = measured(*punch(2))
    output.draw_deformed(error, shared_tmp_path / "deformed.png", factor=factor)
    ground, nodes = ground_and_nodes(error, seen)
    if COMM.rank == 0:
        size = float(np.hypot(4.0, 1.0))
        drawn = np.polynomial.Polynomial.fit(*ground[:, :2].T, 2, domain=[])
        assert drawn.coef[2] == pytest.approx(-0.03, rel=0.02)
        times = 1.0 if factor is None else factor
        (title,) = [text for text in texts(seen.figures[0]) if text.startswith("displacement")]
        if factor is None:
            times = float(title.split(",")[0].split()[2])
            assert 1.2 <= times < 4.0
        x, y = (nodes[:, :2] + times * nodes[:, 2:]).T
        entered = (np.interp(x, *ground[:, :2].T) - y)[
            (x >= ground[0, 0]) & (x <= ground[-1, 0])
        ].max()
        if factor is None:
            assert entered < 0.004 * size
            assert "entered" not in title
        else:
            told = float(title.split("up to ")[1].split()[0])
            assert entered == pytest.approx(told, rel=0.2)


def test_plane_below_a_curved_body_is_flat(shared_tmp_path, seen):
    """A half disc on a plane, with its true shape; it was a thorn."""
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=ec.Displacement("top", (0.0, -0.01)),
        contacts=ec.Contact("arc", gap=lambda x: x[1], normal=(0.0, -1.0)),
    )
    error = measured(scene, ec.read_mesh(ROOT / "meshes" / "half_disc.geo", scripts=True), degree=2)
    for factor in (None, 20.0):
        output.draw_deformed(error, shared_tmp_path / "deformed.png", factor=factor)
        ground, _ = ground_and_nodes(error, seen)
        if COMM.rank == 0:
            assert np.ptp(ground[:, 1]) < 1e-9
            assert abs(ground[:, 1]).max() < (0.02 if factor is None else 0.3)
            assert np.ptp(ground[:, 0]) > 1.0


@pytest.mark.parametrize("kind", ["rest", "above"])
def test_magnification_of_a_body_that_nothing_presses(kind, shared_tmp_path, seen):
    """A gap that stays open is drawn open; of a rigid motion no round-off is drawn."""
    down = {"rest": 0.0, "above": -0.01}[kind]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        ec.Displacement("top", (0.0, down)),
        contacts=ec.Contact("bottom", gap=0.02),
    )
    error = measured(scene, ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2)))
    output.draw_deformed(error, shared_tmp_path / "deformed.png")
    ground, nodes = ground_and_nodes(error, seen)
    if COMM.rank == 0:
        times = 1.0 if kind == "rest" else 13.0
        clear = nodes[:, 1] + times * nodes[:, 3] - ground[0, 1]
        assert clear == pytest.approx(times * (0.02 + down) + 0 * clear, abs=1e-9)
        rgb = next(look["scalars"] for _, look in seen.meshes if "scalars" in look)
        assert len(np.unique(rgb, axis=0)) == 1


@pytest.mark.broad
@pytest.mark.on_ranks("0")
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_contact_in_space_is_seen(axis, shared_tmp_path, seen):
    """One view looks at the contact, one at the other side; all have labelled axes."""
    low, high = (("left", "right"), ("front", "back"), ("bottom", "top"))[axis]
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement(high, tuple(-0.01 * np.eye(3)[axis]))],
        contacts=[ec.Contact(low, friction=0.3)],
    )
    error = measured(scene, ec.box((0.0,) * 3, (1.0, 1.0, 1.0), cells=(2, 2, 2)))
    output.draw_error(error, shared_tmp_path / "error.png")
    output.draw_deformed(error, shared_tmp_path / "deformed.png")
    output.draw_meshes([(error.domain, error.indicators)], shared_tmp_path / "meshes.png")
    if COMM.rank == 0:
        along = np.array(seen.views)[:4, axis]
        assert along[::2] == pytest.approx([-0.4, -0.4], abs=0.1)
        assert along[1::2] == pytest.approx([0.55, 0.55], abs=0.1)
        assert np.all(seen.views[4] * seen.views[5] < 0)  # meshes, which know no contact: all sides
        for figure in seen.figures[:2]:
            words = texts(figure)
            assert all(words.count(f"{name} [length]") == 2 for name in "xyz")
            assert {"from above", "from below", "0", "1"} <= set(words)


@pytest.mark.parametrize("kind", mostly_serial(["sphere", "plane", "slope"], ["plane"], ["slope"]))
def test_directions_in_space_have_clean_names(kind, shared_tmp_path, seen):
    def distance(x):
        return ufl.sqrt((x[0] - 0.5001) ** 2 + (x[1] - 0.5) ** 2 + (x[2] + 2.0) ** 2) - 2.0

    n = np.array([0.2, 0.1, -1.0]) if kind == "slope" else np.array([2e-6, -1.6e-5, -1.0])
    given = (
        {"gap": distance, "normal": "gap"}
        if kind == "sphere"
        else {"normal": tuple(n / np.linalg.norm(n))}
    )
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("top", (0.0, 0.0, -0.01))],
        contacts=[ec.Contact("bottom", friction=0.3, **given)],
    )
    admissible = ec.equilibrate(
        ec.solve(scene, ec.box((0.0,) * 3, (1.0, 1.0, 1.0), cells=(3, 3, 3)))
    )
    output.plot_contact(admissible, "bottom", shared_tmp_path / "contact.png")
    if COMM.rank == 0:
        panels = seen.figures[0].axes
        names = {panels[0].get_xlabel(), panels[0].get_ylabel()}
        if kind == "slope":
            assert names == {
                "along (0.981, -0.019, 0.194) [length]",
                "along (0, 0.995, 0.1) [length]",
            }
        else:
            assert names == {"x [length]", "y [length]"}


class PlaneStrain:
    """A user's own isotropic material in plane strain.

    It does not tell its stress out of plane.
    """

    parameters = ("E",)
    hypothesis = "plane strain"
    nu = 0.3

    def __init__(self, E):
        self.E, self.known = E, ec.Elastic(1.0, self.nu)

    def check(self, name, low, high):
        assert low > 0

    def stress(self, eps, E):
        return self.known.stress(eps, E, self.nu)

    def compliance(self, sigma, E):
        return self.known.compliance(sigma, E, self.nu)

    def modulus(self, E):
        return E


class Telling(PlaneStrain):
    """The same; it does."""

    def out_of_plane(self, sigma, E):
        return self.nu * (sigma[0, 0] + sigma[1, 1])


@pytest.mark.broad
@pytest.mark.serial
def test_stress_out_of_plane_that_nobody_knows(shared_tmp_path, seen):
    scene, domain = punch(2)
    E = {True: 1.0, False: lambda x: 1.0 + 0.1 * x[0]}
    for material, known in (
        (ec.Elastic(1.0, 0.3), True),
        (PlaneStrain(1.0), False),
        (Telling(1.0), True),
        (Telling(E[False]), True),
    ):
        error = measured(replace(scene, material=material), domain)
        folder = shared_tmp_path / f"{type(material).__name__}{callable(material.E)}"
        output.write_fields(error, folder)
        output.draw_deformed(error, folder / "deformed.png")
        if COMM.rank == 0:
            grid = read(folder / "body.vtkhdf")
            xx, xy, yy, zz = grid["stress"][:, [0, 1, 4, 8]].T
            label = [text for text in texts(seen.figures[-1]) if "Mises" in text]
            if known:
                assert zz == pytest.approx(0.3 * (xx + yy), abs=1e-15)
                expected = np.sqrt(
                    ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2
                )
                assert grid["von_mises"] == pytest.approx(expected, rel=1e-12)
                assert "von_mises_in_plane" not in grid.array_names
                assert "plane" not in label[0]
            else:
                assert np.isnan(zz).all()
                assert np.isnan(grid["stress_fe"][:, 8]).all()
                expected = np.sqrt(xx**2 - xx * yy + yy**2 + 3 * xy**2)
                assert grid["von_mises_in_plane"] == pytest.approx(expected, rel=1e-12)
                assert "von_mises" not in grid.array_names
                assert "of the plane part" in label[0]


@pytest.mark.broad
@pytest.mark.serial
def test_one_mesh_is_a_history(shared_tmp_path, seen):
    """A run may end with its first mesh, of any number of degrees of freedom."""
    scene = punch(2)[0]
    for cells in ((4, 2), (6, 2), (7, 2), (9, 2), (5, 4)):
        domain = ec.rectangle((0.0, 0.0), (4.0, 1.0), cells=cells)
        history = ec.adapt(scene, domain, accuracy=0.5, max_steps=1, tighten=0)
        output.plot_history({"one": history}, shared_tmp_path / "error.png")
        if COMM.rank == 0:
            left, right = seen.figures[-1].axes
            assert left.lines[0].get_ydata() == pytest.approx([100 * history.steps[0].eps])
            assert right.lines[0].get_xdata().tolist() == [history.steps[0].dofs]


@pytest.mark.serial
def test_open_contact_has_no_picture(shared_tmp_path):
    contacts = [ec.Contact("bottom", gap=0.0), ec.Contact("right", gap=1.0)]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), ec.Displacement("top", (0.0, -0.05)), contacts=contacts)
    ec.adapt(scene, ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2)), 0.9).save(
        shared_tmp_path, pictures=True
    )
    if COMM.rank == 0:
        names = {path.name for path in shared_tmp_path.iterdir()}
        pictures = {"error_map.png", "deformed.png", "contact_bottom.png"}
        assert {name for name in names if name.endswith(".png")} == pictures
        assert {"contact_right.csv", "contact_right.vtkhdf"} <= names
        page = (shared_tmp_path / "report.html").read_text()
        assert page.count("<figure>") == len(pictures | {"view.html", "the intervals"})


@pytest.mark.serial
@pytest.mark.parametrize(
    "dofs",
    partly_broad(
        [(100, 300), (100, 200, 300), (100, 200, 400), (100, 300, 500, 900)],
        [(100, 300), (100, 300, 500, 900)],
    ),
)
def test_slope_takes_three_meshes_and_a_factor_of_four(dofs, shared_tmp_path, seen):
    """From two meshes a slope of -17.94 was told."""
    history = ec.adapt(
        punch(2)[0], ec.rectangle((0.0, 0.0), (4.0, 1.0), cells=(4, 2)), 0.9, tighten=0
    )
    steps = tuple(replace(history.steps[0], dofs=number, eps=number**-0.5) for number in dofs)
    history = replace(history, steps=steps)
    tells = max(dofs) >= 4 * min(dofs) and len(dofs) > 2
    assert history.slope("dofs") == pytest.approx(-0.5 if tells else np.nan, nan_ok=True)
    assert history.slope("dofs", last=2) == pytest.approx(-0.5)
    # a run is saved with a curve of its error where it tells a slope
    gallery = Gallery(history.best.domain, shared_tmp_path, 0.0, every=True)
    history._draw_run(gallery)
    assert bool(gallery.drawn) == tells
    output.plot_history({"run": history}, shared_tmp_path / "error.png")
    if COMM.rank == 0:
        words = texts(seen.figures[-1])
        assert ("run (slope -0.50)" in words) == tells
        assert ("slope -1/2" in words) == tells


@pytest.mark.on_ranks("3-meshes")
@pytest.mark.parametrize(
    "what", [pytest.param("deformed", marks=pytest.mark.broad), "error", "meshes"]
)
def test_words_in_space_are_legible_on_a_page(what, error, shared_tmp_path, seen):
    """On a page of 6.5 inches no word is smaller than 6 points."""
    if error.domain.dim == 2:
        return
    if what == "meshes":
        output.draw_meshes([(error.domain, error.indicators)] * 5, shared_tmp_path / "meshes.png")
    elif what == "error":
        output.draw_error(error, shared_tmp_path / "error.png")
    else:
        output.draw_deformed(error, shared_tmp_path / "deformed.png")
    if COMM.rank == 0:
        from matplotlib.text import Text

        (figure,) = seen.figures
        sizes = [text.get_fontsize() for text in figure.findobj(Text) if text.get_text()]
        assert min(sizes) * 6.5 / figure.get_figwidth() >= 6.0


@pytest.mark.serial
def test_map_of_nothing_has_the_lowest_colour(shared_tmp_path, seen):
    scene = ec.Scene(material=ec.Elastic(1.0, 0.3), supports=[ec.Displacement("top", (0, 0))])
    error = measured(scene, block(2))
    output.draw_error(error, shared_tmp_path / "error.png")
    if COMM.rank == 0:
        from matplotlib import colormaps

        rgb = next(look["scalars"] for _, look in seen.meshes if "scalars" in look)
        assert np.unique(rgb, axis=0).tolist() == [list(colormaps["viridis"](0, bytes=True)[:3])]


@pytest.mark.serial
def test_colours_of_any_range_are_told(shared_tmp_path, seen):
    """Each colour bar has some ticks, with plain numbers, however narrow or wide its range is."""
    error = measured(*punch(2))
    for ratio in (1.0, 1.5, 2.0, 8.0, 1e3, 1e6):
        indicators = np.geomspace(2.1e-3 / ratio, 2.1e-3, len(error.indicators))
        output.draw_error(replace(error, indicators=indicators), shared_tmp_path / "error.png")
        if COMM.rank == 0:
            (bar,) = [axes for axes in seen.figures[-1].axes if axes.get_label() == "<colorbar>"]
            axis = bar.xaxis if len(bar.get_xticks()) else bar.yaxis
            low, high = sorted(axis.get_view_interval())
            ticks = axis.get_ticklocs()
            assert 2 <= len(ticks) <= 10
            assert np.all((ticks >= low) & (ticks <= high))
            told = [float(label.get_text()) for label in axis.get_ticklabels()]
            assert told == pytest.approx(ticks, rel=1e-3)


def test_ball_has_no_edges(gmsh_session, shared_tmp_path, seen):
    model = None
    if gmsh_session:
        model = gmsh_session.model
        ball = model.occ.addSphere(0, 0, 0, 1)
        model.occ.synchronize()
        model.addPhysicalGroup(3, [ball], name="ball")
        model.addPhysicalGroup(2, [tag for _, tag in model.getEntities(2)], name="surface")
        gmsh_session.option.setNumber("Mesh.MeshSizeMax", 0.3)
        model.mesh.generate(3)
    scene = ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("surface", (0.0, 0.0, lambda x: 0.01 * x[2]))],
    )
    error = measured(scene, ec.from_gmsh(model))
    output.draw_deformed(error, shared_tmp_path / "deformed.png")
    if COMM.rank == 0:
        assert len(seen.views) == 2


@pytest.mark.serial
def test_package_is_typed():
    assert (Path(ec.__file__).parent / "py.typed").is_file()


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
        output.write_fields(error, shared_tmp_path / "file")


@pytest.mark.serial
def test_labels_of_a_high_peak_do_not_overlap():
    """Below a high peak of the pressure the shear has a short logarithmic part."""
    axes = new_figure(7.2, 4.0).subplots()
    axes.set_ylim(-0.35, 0.55)
    contact_plots._keep_peaks(axes, 0.063, 0.55)
    places = axes.yaxis.get_transform().transform(np.sort(axes.get_yticks()))
    ends = axes.yaxis.get_transform().transform(np.array(axes.get_ylim()))
    assert len(places) > 4
    assert np.diff(places).min() >= contact_plots.LABEL_DISTANCE * np.ptp(ends)
