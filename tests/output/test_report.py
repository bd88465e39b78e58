"""What a run leaves in its folder can be read by others, and says the same as the run.

- The report is one page of HTML that needs nothing else: no link, no script but of the
  view in 3D, pictures inside; it has the numbers of the history, the scene as code, the forces, and neither
  the name of the machine nor a path.
- What it calls proved, estimated and not known follows from friction, data and shape.
- CSV, JSON and the series of meshes hold the numbers of the history; pyvista and meshio
  read the meshes.
- Notebooks show short tables; one rank alone may ask for them.
"""

import csv
import json
import platform
import re
import shutil
import tempfile
from dataclasses import replace
from datetime import date
from functools import partial
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scenes import block
from test_output import check_picture, read

import erc_contact as ec
from erc_contact import output, results
from erc_contact.base.code import code_of, definitions
from erc_contact.output import gallery
from erc_contact.output.bounded_forces import BoundedForce, forces_in_html
from erc_contact.output.verdict import of_maxima, verdict
from erc_contact.run.history import COLUMNS
from namedmesh.base.percent import percent

COMM = MPI.COMM_WORLD


@pytest.fixture(scope="module")
def history():
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (lambda x: 0.02 + 0.0 * x[0], -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    return ec.adapt(scene, block(2), accuracy=0.07, strategy=ec.Mark(0.3))


@pytest.fixture(scope="module")
def folder(history):
    """The folder of the history."""
    path = Path(COMM.bcast(tempfile.mkdtemp(prefix="erc_contact_") if COMM.rank == 0 else None))
    history.save(path / "run", pictures=True)
    yield path / "run"
    COMM.barrier()
    if COMM.rank == 0:
        shutil.rmtree(path)


class Page(HTMLParser):
    """A page as a browser meets it."""

    def __init__(self, text):
        super().__init__()
        self.links, self.images, self.words, self.depth, self.style = [], [], "", [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        if tag not in ("meta", "img", "link", "br"):
            self.depth.append(tag)
        for name, value in attributes:
            if name in ("src", "href", "srcset", "action", "data", "poster", "background"):
                (self.images if value.startswith("data:image/png;base64,") else self.links).append(
                    value
                )
        assert tag not in ("script", "link", "object", "embed")
        # The view in 3D is a page inside the page.
        assert tag != "iframe" or "srcdoc" in dict(attributes)

    def handle_endtag(self, tag):
        assert self.depth.pop() == tag

    def handle_data(self, data):
        if self.depth and self.depth[-1] == "style":
            self.style += data
        else:
            self.words += f"{data}\n"


def page_alone(path, pictures):
    """A report that needs nothing else, with so many pictures.

    It tells neither of the machine nor of a path.
    """
    text = path.read_text()
    page = Page(text)
    assert page.depth == []
    assert page.links == []
    assert "url(" not in page.style
    assert "@import" not in page.style
    assert "http" not in page.words
    assert [len(image) > 10_000 for image in page.images] == [True] * pictures
    assert 'name="viewport"' in text
    assert platform.node() not in page.words.split()
    assert str(Path.home()) not in text
    assert str(path.parent) not in text
    return page


@pytest.mark.broad
def test_report_needs_nothing_else(history, folder):
    forces = history.reactions()
    if COMM.rank > 0:
        return
    page = page_alone(folder / "report.html", 3)
    lines = page.words.splitlines()
    for step in history.steps:
        assert {
            str(step.cells),
            str(step.dofs),
            percent(step.eps, 3),
            f"{step.seconds:.2f}",
        } <= set(lines)
    assert history.outcome in lines
    assert str(date.today()) in lines
    assert any(line.startswith(f"{folder.name}: relative error ") for line in lines)
    headings = ["Forces and their intervals", "What the number means", "Scene", "Meshes"]
    headings += ["Forces on the body", "What is not known", "How to reproduce it"]
    places = [lines.index(heading) for heading in headings]
    assert places == sorted(places)
    assert "not known" not in lines[: places[-2]]
    assert any(line.startswith("between ") for line in lines[places[0] : places[1]])
    assert f"{forces['bottom'].force[1]:.6g}" in lines
    for code in (
        "ec.Elastic(E=1.0, nu=0.3)",
        "lambda x: 0.02 + 0.0 * x[0]",
        "strategy=ec.Mark(fraction=0.3)",
    ):
        assert code in page.words


@pytest.mark.serial
def test_intervals_are_drawn_to_scale():
    """Bars begin and end where the intervals do, from the computed component on."""
    ends = {"punch": (9.0, 12.0), "block <2>": (-10.5, -10.0)}
    rows = [
        BoundedForce(part, "y", 10.0 * np.sign(low), ec.Bounds(0.0, low, high, True))
        for part, (low, high) in ends.items()
    ]
    drawing = forces_in_html([*rows, BoundedForce("rim", "x", 1.0, None, "it slides")])
    bars = re.findall(r'<line x1="(\S+)" x2="(\S+)" \S+ \S+ class="interval"/>', drawing)
    circles = re.findall(r'<circle cx="(\S+)"', drawing)
    (first, second), zero = np.array(bars, dtype=float), float(circles[0])
    unit = (first[1] - zero) / 2.0
    assert first - zero == pytest.approx([-unit, 2 * unit], abs=0.1)
    assert second - zero == pytest.approx([-0.5 * unit, 0.0], abs=0.1)
    assert ">block &lt;2&gt; y</text>" in drawing
    assert len(circles) == 2
    assert "<svg" not in forces_in_html([BoundedForce("rim", "x", 1.0, None, "it slides")])


def test_pictures_without_time_are_named(history, folder, monkeypatch):
    """Each picture takes 1.5 s of the clock: a run of 10 s has time for two of them."""
    monkeypatch.setattr(gallery, "LIBRARY_SECONDS", dict.fromkeys(gallery.LIBRARY_SECONDS, 0.0))
    clock = iter(np.arange(0.0, 100.0, 0.5))
    # the ranks' clocks differ, and all ranks do what the clock of rank 0 tells
    slower = 1 + COMM.rank
    monkeypatch.setattr(gallery, "perf_counter", lambda: slower * next(clock))
    last = replace(history.steps[-1], seconds=10.0)
    long_run = replace(history, steps=(*history.steps[:-1], last))
    other = folder.parent / "other"
    old = other / "error_map.png"
    if COMM.rank == 0:
        other.mkdir()
        old.write_bytes(b"of an older run")
    COMM.barrier()
    long_run.save(other)
    if COMM.rank > 0:
        return
    assert {path.name for path in other.glob("*.png")} == {"deformed.png", "contact_bottom.png"}
    page = page_alone(other / "report.html", 2)
    assert "Not drawn are view.html, error_map.png: saving takes at most 3.0 s" in page.words
    assert 'erc_contact.output.draw_error(history.best, "error_map.png")' in page.words


def test_history_is_saved(history, folder):
    assert history.reached
    other, profile = replace(history, accuracy=0.4), history.profile("bottom")
    output.plot_history({"one": history, "other": other}, folder / "both.png")
    for name in ("error_map", "deformed", "contact_bottom", "both"):
        check_picture(folder / f"{name}.png")
    forces = history.reactions()
    if COMM.rank == 0:
        with (folder / "history.csv").open() as file:
            rows = list(csv.DictReader(file))
        told = json.loads((folder / "history.json").read_text())
        assert len(rows) == len(told["steps"]) == len(history.steps)
        for name in COLUMNS:
            given = history.column(name)
            assert [given.dtype.type(row[name]) for row in rows] == given.tolist()
            assert [row[name] for row in told["steps"]] == given.tolist()
        assert told["error"]["relative"] == history.best.relative
        assert told["forces"]["bottom"]["force"] == forces["bottom"].force.tolist()
        assert told["settings"]["strategy"] == "ec.Mark(fraction=0.3)"
        along = np.genfromtxt(folder / "contact_bottom.csv", delimiter=",", names=True)
        assert np.all(along["pressure"] == profile["pressure"])
        grid = read(folder / "body.vtkhdf")
        assert np.sum(grid["eps_E"] ** 2) == pytest.approx(history.best.relative**2, rel=1e-12)


def test_all_meshes_are_one_file(history, folder):
    """ParaView's reader has a mesh for each time.

    Meshio reads it from what pyvista writes of it.
    """
    if COMM.rank > 0:
        return
    import meshio
    import pyvista

    reader = pyvista.get_reader(folder / "meshes.vtkhdf")
    assert len(history.steps) > 2
    for number, step in enumerate(history.steps):
        reader.reader.SetStep(number)
        grid = reader.read()
        assert grid.n_cells == step.cells
        assert grid.n_points == step.vertices
        assert np.sum(grid["eps_E"] ** 2) == pytest.approx(step.eps**2, rel=1e-12)
        x = grid.points[grid.cells_dict[pyvista.CellType.TRIANGLE]]
        area = 0.5 * np.linalg.det(x[:, 1:, :2] - x[:, :1, :2])
        assert area.min() > 0
        pyvista.save_meshio(folder / "mesh.vtu", grid)
        other = meshio.read(folder / "mesh.vtu")
        assert np.array_equal(other.points, grid.points)
        assert np.array_equal(
            other.cells_dict["triangle"], grid.cells_dict[pyvista.CellType.TRIANGLE]
        )
        assert np.array_equal(other.cell_data_dict["eps_E"]["triangle"], grid["eps_E"])


@pytest.mark.serial
def test_verdict_follows_from_friction_data_and_shape():
    def said(friction, top=-0.05, domain=None, part="bottom", **options):
        support = ec.Displacement("top", (0.01, top))
        scene = ec.Scene(
            ec.Elastic(1.0, 0.3), support, contacts=[ec.Contact(part, friction=friction, **options)]
        )
        error = ec.constitutive_error(
            ec.equilibrate(ec.solve(scene, domain or block(1), ec.AugmentedLagrangian()))
        )
        return error, verdict(error)

    for friction in (0.0, ec.Tresca(0.01)):
        error, claims = said(friction)
        assert error.guaranteed
        assert claims[0][0] == "bound"
        assert "This is proved" in claims[0][1]
        assert percent(error.relative) in claims[0][1]
        assert [kind for kind, _ in claims] == ["bound", "not known"]
    error, claims = said(0.3)
    assert not error.guaranteed
    assert error.pressure_dependent == ("bottom",)
    assert claims[0][0] == "bound up to a term"
    assert "third term" in claims[0][1]
    assert "This is proved" not in claims[0][1]
    assert "coulomb_certificate" in claims[1][1]
    error, claims = said(0.0, top=lambda x: -0.05 - 0.01 * x[0] ** 3)
    assert not error.guaranteed
    assert "with the data that the mesh represents exactly" in claims[0][1]
    (estimate,) = [words for kind, words in claims if kind == "estimate"]
    assert "prescribed displacements" in estimate
    assert percent(error.oscillations.supports / error.scale) in estimate
    disc = ec.read_mesh(Path(__file__).parents[2] / "meshes" / "half_disc.msh")
    _, claims = said(0.0, domain=disc, part="arc", normal=(0.0, -1.0), gap=lambda x: x[1])
    assert any("No true shape is known" in words for _, words in claims)


R = 2.0


def bump(x):
    """A gap."""
    return x[0] ** 2 / R + len("/home/me/shape.txt")


MATERIAL = ec.Elastic(1.0, 0.3)


def down_in_time(t):
    """A scene that takes a module, a part of it and a function from around it."""
    return ec.Scene(
        MATERIAL, ec.Displacement("top", (0.0, -np.sin(t))), contacts=ec.Contact("bottom", gap=bump)
    )


@pytest.mark.serial
def test_report_says_which_maxima_grow():
    at = np.array([0.0, 7.0])
    growing = results.Maximum(4.0, at, (1.0, 2.0, 4.0), (1.0, 0.5, 0.25))
    steady = results.Maximum(1.1, at, (1.0, 1.1, 1.1), (1.0, 0.5, 0.25))
    said = of_maxima(
        {"von Mises": growing, "pressure": steady, "shear": replace(steady, values=(), sizes=())}
    )
    assert [kind for kind, _ in said] == ["not known", "estimate"]
    assert "greatest von Mises stress is 4 at (0, 7); on the meshes 1, 2, 4: it grows" in said[0][1]
    assert "infinite" in said[0][1]
    assert "greatest pressure is 1.1" in said[1][1]


@pytest.mark.serial
def test_values_as_code():
    assert (
        code_of(ec.Traction("right", (np.float64(1), 0.0)))
        == "ec.Traction(facets='right', value=(1.0, 0.0))"
    )
    contact = ec.Contact("a", gap=lambda x: R - x[0])
    assert code_of(contact) == "ec.Contact(facets='a', gap=lambda x, R=2.0: R - x[0])"
    two = {"steel": lambda x: 1 + x[0], "rubber": lambda x: 2 * x[1]}
    assert code_of(two) == "{'steel': lambda x: 1 + x[0], 'rubber': lambda x: 2 * x[1]}"
    named = ec.Contact("a", friction=bump, gap=bump)
    assert code_of(named) == "ec.Contact(facets='a', friction=bump, gap=bump)"
    numbers, source = definitions([named])
    assert numbers == "R = 2.0"
    assert source.startswith("def bump(x):")
    assert source.endswith('return x[0] ** 2 / R + len("...")')
    names = {"ec": ec}
    exec("\n".join(definitions(down_in_time)), names)
    assert names["down_in_time"](1.0).supports == down_in_time(1.0).supports
    assert names["bump"]([1.0]) == 0.5 + len("...")
    for unknown in (np.sin, eval("lambda x: x[0]"), partial(bump, 2.0)):
        assert code_of(unknown) == "callable"


def test_notebooks_show_tables(history):
    """Only one rank asks: nothing may wait for the others."""
    if COMM.rank == COMM.size - 1:
        error = history.error
        shown = {
            "history": (
                history,
                [history.outcome.replace("<", "&lt;"), percent(error.relative, 3)],
            ),
            "error": (error, [percent(error.relative), "contact part"]),
            "solution": (error.solution, [str(error.solution.newton_steps), "converged"]),
            "domain": (
                error.domain,
                [str(error.domain.cells), "left, right, bottom, top", "rectangle from"],
            ),
            "scene": (
                error.solution.scene,
                ["Elastic: E = 1.0, nu = 0.3", "Coulomb friction 0.3", "lambda x: 0.02"],
            ),
            "interval": (ec.Bounds(2.0, 1.0, 3.0, guaranteed=True), ["proved", "between 1 and 3"]),
            "force": (ec.results.Force(np.array([1.5, 2.5]), np.array([4.0])), ["1.5", "moment"]),
        }
        for value, words in shown.values():
            page = Page(value._repr_html_())
            assert page.depth == []
            assert all(word in value._repr_html_() for word in words)
            assert len(value._repr_html_()) < 3000
